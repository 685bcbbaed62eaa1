//! Everything known while a graph is made: frames of names, declarations, and what is still to be lowered.

use super::frames::{Body, Frame, FrameId, Here, Round, Thing};
use super::structure::{Half, ModelPort};
use crate::bond::elements::Element;
use crate::bond::graph::*;
use crate::bond::syntax::{
    Argument, Chain, Expr as Syntax, Name, ObserveItem, Part, Regulator as RegulatorSyntax,
};
use crate::diagnostic::Diagnostic;
use crate::expr::Table;
use crate::quantity::{Dimension, did_you_mean, nearest};
use crate::source::{FileId, SourceMap, Span};
use std::cell::{OnceCell, RefCell};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

pub(super) use super::frames::Meaning;

/// An element's declaration.
#[derive(Clone, Copy)]
pub(super) struct Declaration<'a> {
    pub element: &'static Element,
    pub arguments: Option<&'a [Argument]>,
    pub name: &'a Part,
    /// What stands in the file for it: kind, name and arguments.
    pub span: Span,
    /// Number of its statement, in the order in which statements were carried out.
    pub statement: usize,
    /// Where its arguments' names are looked up.
    pub here: Here,
}

/// A parameter's or signal's value as written.
#[derive(Clone, Copy)]
pub(super) struct Valued<'a> {
    pub value: &'a Syntax,
    pub statement: usize,
    /// Where its names are looked up.
    pub here: Here,
}

/// Everything known while a file is elaborated.
pub(super) struct Scope<'a> {
    pub map: &'a SourceMap,
    pub graph: BondGraph,
    /// In which frame names are looked up now.
    pub here: Here,
    pub frames: Vec<Frame<'a>>,
    pub rounds: Vec<Round>,
    pub bodies: Vec<Body<'a>>,
    /// By file, the models that can be used in it.
    pub kinds: Vec<HashMap<String, usize>>,
    /// By vertex.
    pub declarations: Vec<Declaration<'a>>,
    pub chains: Vec<(&'a Chain, Here)>,
    /// Arrows as drawn, each with the bond that it became a part of.
    pub halves: Vec<Half>,
    pub ports: Vec<ModelPort>,
    /// The bonds by what their arrows are drawn between; found when they are first asked for.
    pub between: OnceCell<HashMap<(Thing, Thing), Vec<BondId>>>,
    /// By parameter; `None` when it has no value.
    pub parameters: Vec<Option<Valued<'a>>>,
    /// By signal; `None` for inputs that nothing sets.
    pub signals: Vec<Option<Valued<'a>>>,
    /// Statement and rank within it, by signal: hidden ones come before the signal that they belong to.
    pub signal_order: Vec<(usize, usize)>,
    pub outputs: Vec<(&'a Part, Here)>,
    pub drives: Vec<(&'a Part, Valued<'a>)>,
    pub regulators: Vec<(&'a RegulatorSyntax, Here)>,
    pub simulate: Vec<(&'a Option<Syntax>, &'a Option<Syntax>, Span)>,
    pub options: Vec<&'a (Name, Name)>,
    pub observe: Vec<&'a ObserveItem>,
    /// Names that hidden signals cannot take, with the last number tried behind each; filled by the first of them.
    pub hidden: HashMap<String, u32>,
    /// Tables that were read from files.
    pub tables: HashMap<FileId, Option<Arc<Table>>>,
    /// The units that their headers give their two columns.
    pub table_units: HashMap<FileId, [Option<Dimension>; 2]>,
    /// What the command line sets: name, text, value, and whether a parameter has taken it.
    pub set: Vec<Setting<'a>>,
    /// How far the evaluation of each parameter has come.
    pub marks: Vec<Mark>,
    /// Whether a parameter's value is known, by parameter.
    pub evaluated: Vec<bool>,
    /// Demands for parameters within one another.
    pub demands: usize,
    /// Statements carried out so far.
    pub clock: usize,
    /// The dimension of each parameter's value.
    pub parameter_dimensions: Vec<super::dimensions::Dim>,
    /// The dimension of each signal, as far as known.
    pub signal_dimensions: Vec<super::dimensions::Dim>,
    /// Places whose unknown name has been searched for a name that was meant.
    pub searched: RefCell<HashSet<Span>>,
    /// What else is known of units.
    pub units: super::inference::Units<'a>,
}

/// How far the evaluation of a parameter has come.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Mark {
    Untouched,
    /// On the way from the parameter that began to the one looked at.
    Open,
    Done,
}

/// A parameter that the command line sets.
pub(super) struct Setting<'a> {
    pub name: &'a str,
    pub text: &'a str,
    pub value: Option<&'a Syntax>,
    /// The parameter that it was for.
    pub taken: Option<ParameterId>,
    /// What the parameter would have been.
    pub declared: Option<Valued<'a>>,
}

impl<'a> Scope<'a> {
    /// The name of an element as messages give it, with those of the instances around it.
    pub fn shown(&self, id: VertexId) -> &str {
        &self.graph.vertices[id.index()].name
    }

    /// Where a parameter or signal is declared.
    pub fn value_span(&self, meaning: Meaning) -> Span {
        match meaning {
            Meaning::Parameter(id) => self.graph.parameters[id.index()].span,
            Meaning::Signal(id) => self.graph.signals[id.index()].span,
        }
    }

    /// Whether what may be meant at a place has been searched for, which takes a look at every name. In further rounds and
    /// instances it needs no second search: of one place the same is said once (`merge_repeats`).
    pub fn searched(&self, span: Span) -> bool {
        !self.searched.borrow_mut().insert(span)
    }

    /// The error for an element that is not declared in a frame; it tells the nearest.
    pub fn unknown_thing(&self, frame: FrameId, part: &Part, key: &str) -> Diagnostic {
        let names = &self.frames[frame.0 as usize];
        let body = &self.bodies[names.body];
        let inside = if frame == self.here.frame {
            String::new()
        } else {
            format!(" in `{}`", names.prefix.trim_end_matches('.'))
        };
        let error = Diagnostic::error(
            "E0206",
            part.span,
            format!("no element or junction is called `{key}`{inside}"),
        )
        .says("not declared anywhere");
        let error = match inside.is_empty() {
            true => error,
            false => error.label(body.span, format!("the model `{}`", body.name)),
        };
        if self.searched(part.span) {
            return error;
        }
        // Names in statements that could not be read may be meant too; sorted, so that a tie has one winner.
        let known: std::collections::BTreeSet<&str> = names
            .things
            .keys()
            .map(|name| name.as_ref())
            .chain(names.excused.iter().copied())
            .collect();
        let array: Vec<&str> = known
            .iter()
            .filter(|name| {
                name.strip_prefix(part.text.as_str()).is_some_and(|rest| rest.starts_with('['))
            })
            .copied()
            .collect();
        if let (Some(first), Some(last)) = (array.first(), array.last()) {
            return match part.indices.is_empty() {
                true => error.help(format!("`{}` has an index, as in `{first}`", part.text)),
                false => error.because(format!(
                    "there are {} of them, `{first}` and `{last}` among them",
                    array.len()
                )),
            };
        }
        if let Some(meant) = nearest(key, known.iter().copied()) {
            did_you_mean(error, part.span, key, meant)
        } else if names.values.contains_key(key) {
            error.because(format!("`{key}` is a parameter or signal, which no bond can join"))
        } else if inside.is_empty() {
            error.help(format!("give it a kind where it is declared, as in `1:{}`", part.text))
        } else {
            error
        }
    }
}

/// Names that mean something of their own in a law.
pub(super) const RESERVED: [&str; 6] = ["e", "f", "q", "p", "time", "pi"];

/// A noun with its article: `an inertia`.
pub(super) fn a(noun: &str) -> String {
    format!("{} {noun}", if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" })
}
