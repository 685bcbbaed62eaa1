//! Where names are looked up: a frame for the file and for each instance, and the variables of loops.

use super::scope::Scope;
use crate::bond::graph::*;
use crate::bond::syntax::{self, HeaderParameter, Part, Path, Statement};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::source::Span;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Index of a frame; 0 is the file that is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct FrameId(pub u32);

/// Index of a port of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PortId(pub u32);

/// A place in the hierarchy: a frame, and the round of the innermost loop there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Here {
    pub frame: FrameId,
    pub round: Option<u32>,
}

impl Here {
    /// The file that is run, outside all loops.
    pub const ROOT: Here = Here { frame: FrameId(0), round: None };
}

/// One round of a loop.
#[derive(Clone, Debug)]
pub(super) struct Round {
    /// The loop's variable.
    pub name: Rc<str>,
    pub value: i64,
    /// That of the loop around.
    pub outer: Option<u32>,
}

/// What a name of the space of elements means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Thing {
    Vertex(VertexId),
    Instance(FrameId),
    Port(PortId),
}

/// What a name of the space of values means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Meaning {
    Parameter(ParameterId),
    Signal(SignalId),
}

/// A model, or the statements of a file that stand outside its models.
pub(super) struct Body<'a> {
    pub name: String,
    /// `None` for a file: all its parameters are public.
    pub header: Option<&'a [HeaderParameter]>,
    pub statements: &'a [Statement],
    /// Index of the file in the program.
    pub file: usize,
    /// Where the model is named.
    pub span: Span,
}

/// An instance, or the file itself.
pub(super) struct Frame<'a> {
    /// What stands before the names of its parts, `eha[2].motor.`; empty for the file.
    pub prefix: String,
    /// Index of its model.
    pub body: usize,
    /// Where it is declared.
    pub outer: Option<Here>,
    /// Its declaration in the text.
    pub span: Span,
    /// What the instance was given.
    pub arguments: &'a [syntax::Argument],
    pub things: HashMap<Cow<'a, str>, Thing>,
    pub values: HashMap<Cow<'a, str>, Meaning>,
    /// Words of statements that could not be read, and names whose declaration was wrong: what is missing because of
    /// them needs no second error.
    pub excused: HashSet<&'a str>,
    pub ports: Vec<PortId>,
    /// What can be read from outside.
    pub public: HashSet<Cow<'a, str>>,
}

/// What a path means: a thing, and what is left of the path.
#[derive(Clone, Copy)]
pub(super) struct Found<'p> {
    pub thing: Thing,
    pub rest: &'p [Part],
    /// Whether the path led into an instance.
    pub within: bool,
}

impl<'a> Scope<'a> {
    /// The frame in which names are looked up.
    pub fn frame(&self) -> &Frame<'a> {
        &self.frames[self.here.frame.0 as usize]
    }

    pub fn frame_mut(&mut self) -> &mut Frame<'a> {
        &mut self.frames[self.here.frame.0 as usize]
    }

    /// What a name without indices or dots means among values.
    pub fn value(&self, name: &str) -> Option<Meaning> {
        self.frame().values.get(name).copied()
    }

    /// The element or junction of a plain name.
    pub fn element_named(&self, name: &str) -> Option<VertexId> {
        match self.frame().things.get(name) {
            Some(Thing::Vertex(id)) => Some(*id),
            _ => None,
        }
    }

    /// Whether what is missing under this name has been reported with something else.
    pub fn excused(&self, name: &str) -> bool {
        self.frame().excused.contains(name)
    }

    /// The value of a loop variable.
    pub fn variable(&self, name: &str) -> Option<i64> {
        self.variable_at(name, self.here)
    }

    fn variable_at(&self, name: &str, here: Here) -> Option<i64> {
        let mut next = here.round;
        while let Some(round) = next.and_then(|at| self.rounds.get(at as usize)) {
            if &*round.name == name {
                return Some(round.value);
            }
            next = round.outer;
        }
        None
    }

    /// Where a thing is declared.
    pub fn thing_span(&self, thing: Thing) -> Span {
        match thing {
            Thing::Vertex(id) => self.declarations[id.index()].span,
            Thing::Instance(frame) => self.frames[frame.0 as usize].span,
            Thing::Port(port) => self.ports[port.0 as usize].span,
        }
    }

    /// Does something as if it stood elsewhere.
    pub fn at<T>(&mut self, here: Here, what: impl FnOnce(&mut Scope<'a>) -> T) -> T {
        let before = std::mem::replace(&mut self.here, here);
        let result = what(self);
        self.here = before;
        result
    }

    /// A name with its indices as they are, `ph[2]`; `None` where an index is no whole number, or not known yet.
    pub fn key<'p>(&self, part: &'p Part) -> Option<Cow<'p, str>> {
        self.key_at(part, self.here)
    }

    /// The same as if it stood elsewhere.
    pub fn key_at<'p>(&self, part: &'p Part, here: Here) -> Option<Cow<'p, str>> {
        if part.indices.is_empty() {
            return Some(Cow::Borrowed(part.text.as_str()));
        }
        let mut key = part.text.clone();
        for (k, index) in part.indices.iter().enumerate() {
            let value = index.evaluate(&mut |leaf| match leaf {
                syntax::Leaf::Quantity(value, _) => *value,
                syntax::Leaf::Name(path) if path.members.is_empty() => self.plain(&path.name, here),
                _ => f64::NAN,
            });
            key.push(if k == 0 { '[' } else { ',' });
            key.push_str(&whole(value)?.to_string());
        }
        key.push(']');
        Some(Cow::Owned(key))
    }

    /// The number of a loop variable or a parameter that has been evaluated.
    fn plain(&self, part: &Part, here: Here) -> f64 {
        if part.indices.is_empty()
            && let Some(value) = self.variable_at(&part.text, here)
        {
            return value as f64;
        }
        let values = &self.frames[here.frame.0 as usize].values;
        match self.key_at(part, here).and_then(|key| values.get(&*key).copied()) {
            Some(Meaning::Parameter(id)) if self.evaluated[id.index()] => {
                self.graph.parameters[id.index()].value
            }
            _ => f64::NAN,
        }
    }

    /// A name with its indices; an error has been reported when there is none.
    pub fn full_key<'p>(
        &mut self,
        part: &'p Part,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Cow<'p, str>> {
        if let Some(key) = self.key(part) {
            return Some(key);
        }
        let mut key = part.text.clone();
        for (k, index) in part.indices.iter().enumerate() {
            let value = self.integer(index, "an index", d)?;
            key.push(if k == 0 { '[' } else { ',' });
            key.push_str(&value.to_string());
        }
        key.push(']');
        Some(Cow::Owned(key))
    }

    /// A whole number that is known before the graph is.
    pub fn integer(
        &mut self,
        expr: &syntax::Expr,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<i64> {
        let value = self.number(expr, what, d)?;
        let found = whole(value);
        if found.is_none() {
            d.push(
                Diagnostic::error("E0232", expr.span, format!("{what} must be a whole number"))
                    .says(format!("this is {value}")),
            );
        }
        found
    }

    /// What a path means; an error has been reported when it means nothing.
    pub fn resolve<'p>(&mut self, path: &'p Path, d: &mut Vec<Diagnostic>) -> Option<Found<'p>> {
        let mut frame = self.here.frame;
        let mut part = &path.name;
        let mut rest = path.members.as_slice();
        let mut within = false;
        loop {
            let key = self.full_key(part, d)?;
            match (self.frames[frame.0 as usize].things.get(&*key).copied(), rest) {
                (Some(Thing::Instance(inner)), [next, others @ ..]) => {
                    frame = inner;
                    part = next;
                    rest = others;
                    within = true;
                }
                (Some(thing), rest) => return Some(Found { thing, rest, within }),
                (None, _) => {
                    if !self.frames[frame.0 as usize].excused.contains(part.text.as_str()) {
                        d.push(self.unknown_thing(frame, part, &key));
                    }
                    return None;
                }
            }
        }
    }

    /// The same without errors.
    pub fn look_up<'p>(&self, path: &'p Path) -> Option<Found<'p>> {
        let mut frame = self.here.frame;
        let mut part = &path.name;
        let mut rest = path.members.as_slice();
        let mut within = false;
        loop {
            let key = self.key(part)?;
            match (self.frames[frame.0 as usize].things.get(&*key).copied()?, rest) {
                (Thing::Instance(inner), [next, others @ ..]) => {
                    frame = inner;
                    part = next;
                    rest = others;
                    within = true;
                }
                (thing, rest) => return Some(Found { thing, rest, within }),
            }
        }
    }

    /// The parameter or signal of a path, and the frame that it was found in; no error is reported.
    pub fn look_up_value(&self, path: &Path) -> Option<(Meaning, FrameId)> {
        let mut frame = self.here.frame;
        let mut part = &path.name;
        for next in &path.members {
            let key = self.key(part)?;
            let Some(Thing::Instance(inner)) = self.frames[frame.0 as usize].things.get(&*key)
            else {
                return None;
            };
            frame = *inner;
            part = next;
        }
        let key = self.key(part)?;
        let meaning = self.frames[frame.0 as usize].values.get(&*key)?;
        Some((*meaning, frame))
    }
}

/// A number that is whole but for rounding.
pub(super) fn whole(value: f64) -> Option<i64> {
    let nearest = value.round();
    ((value - nearest).abs() <= 1e-9 && nearest.abs() < 1e15).then_some(nearest as i64)
}

/// Whether an expression is a name alone.
pub(super) fn name_alone(expr: &syntax::Expr) -> Option<&Path> {
    match &*expr.node {
        Node::Leaf(syntax::Leaf::Name(path)) => Some(path),
        _ => None,
    }
}
