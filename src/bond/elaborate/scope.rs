//! The names of a file: elements and junctions in one space, parameters, signals and inputs in another.

use crate::bond::elements::{ELEMENTS, Element, element};
use crate::bond::graph::*;
use crate::bond::syntax::{
    Argument, Chain, ChainEnd, Expr as Syntax, File, Name, ObserveItem, Part, Path, StatementKind,
};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Table};
use crate::quantity::nearest;
use crate::source::{FileId, SourceMap, Span};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// What a name of the space of values means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    Parameter(ParameterId),
    Signal(SignalId),
}

/// An element's declaration.
#[derive(Clone, Copy)]
pub(super) struct Declaration<'a> {
    pub element: &'static Element,
    pub arguments: Option<&'a [Argument]>,
    pub name: &'a Part,
    /// What stands in the file for it: kind, name and arguments.
    pub span: Span,
    /// Index of its statement.
    pub statement: usize,
}

/// A parameter's or signal's statement.
pub(super) struct Valued<'a> {
    pub value: &'a Syntax,
    pub statement: usize,
}

/// Everything known while a file is elaborated.
pub(super) struct Scope<'a> {
    pub map: &'a SourceMap,
    pub graph: BondGraph,
    pub vertices: HashMap<&'a str, VertexId>,
    pub values: HashMap<&'a str, Meaning>,
    pub declarations: Vec<Declaration<'a>>,
    pub chains: Vec<&'a Chain>,
    pub parameters: Vec<Valued<'a>>,
    /// By signal; `None` for inputs.
    pub signals: Vec<Option<Valued<'a>>>,
    /// Statement and rank within it, by signal: hidden ones come before the signal that they belong to.
    pub signal_order: Vec<(usize, usize)>,
    pub outputs: Vec<&'a Part>,
    pub drives: Vec<(&'a Part, Valued<'a>)>,
    pub simulate: Vec<(&'a Option<Syntax>, &'a Option<Syntax>, Span)>,
    pub options: Vec<&'a (Name, Name)>,
    pub observe: Vec<&'a ObserveItem>,
    /// Words of statements that could not be read, and names of elements of unknown kind: what is missing because of
    /// them needs no second error.
    pub excused: HashSet<&'a str>,
    /// Names that hidden signals cannot take, with the last number tried behind each; filled by the first of them.
    pub hidden: HashMap<String, u32>,
    /// Tables that were read from files.
    pub tables: HashMap<FileId, Option<Arc<Table>>>,
    /// Whether a parameter's value is known, by parameter.
    pub evaluated: Vec<bool>,
    /// The dimension of each parameter's value.
    pub parameter_dimensions: Vec<super::dimensions::Dim>,
    /// The dimension of each signal, as far as known.
    pub signal_dimensions: Vec<super::dimensions::Dim>,
}

impl<'a> Scope<'a> {
    /// Collects every declaration of a file.
    pub fn collect(file: &'a File, map: &'a SourceMap, d: &mut Vec<Diagnostic>) -> Scope<'a> {
        let mut scope = Scope {
            map,
            graph: BondGraph { name: stem(map, file), ..BondGraph::default() },
            vertices: HashMap::new(),
            values: HashMap::new(),
            declarations: vec![],
            chains: vec![],
            parameters: vec![],
            signals: vec![],
            signal_order: vec![],
            outputs: vec![],
            drives: vec![],
            simulate: vec![],
            options: vec![],
            observe: vec![],
            excused: HashSet::new(),
            hidden: HashMap::new(),
            tables: HashMap::new(),
            evaluated: vec![],
            parameter_dimensions: vec![],
            signal_dimensions: vec![],
        };
        for (statement, item) in file.statements.iter().enumerate() {
            match &item.kind {
                StatementKind::Chain(chain) => {
                    scope.chains.push(chain);
                    let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, l)| l));
                    ends.for_each(|end| scope.declare(end, statement, d));
                }
                StatementKind::Parameter { name, value, description } => {
                    scope.declare_parameter(name, value, description.as_ref(), statement, d);
                }
                StatementKind::Signal { name, value } => {
                    let valued = Some(Valued { value, statement });
                    scope.declare_signal(name, SignalOrigin::Signal, valued, statement, d);
                }
                StatementKind::Input(names) => {
                    for name in names {
                        scope.declare_signal(name, SignalOrigin::Input, None, statement, d);
                    }
                }
                StatementKind::Output(names) => scope.outputs.extend(names),
                StatementKind::Drive { name, value } => {
                    scope.drives.push((name, Valued { value, statement }));
                }
                StatementKind::Simulate { until, step } => {
                    scope.simulate.push((until, step, item.span));
                }
                StatementKind::Options(options) => scope.options.extend(options),
                StatementKind::Observe(items) => scope.observe.extend(items),
                // Of hierarchy; the parser does not make them yet.
                StatementKind::Import(_)
                | StatementKind::Model(_)
                | StatementKind::Port(_)
                | StatementKind::For { .. }
                | StatementKind::If { .. }
                | StatementKind::Loop(_) => {}
                StatementKind::Unreadable => {
                    let text = map.text(item.span);
                    let parts = text.split(|c: char| !(c.is_alphanumeric() || c == '_'));
                    scope.excused.extend(parts.filter(|part| !part.is_empty()));
                }
            }
        }
        scope
    }

    fn declare(&mut self, end: &'a ChainEnd, statement: usize, d: &mut Vec<Diagnostic>) {
        let Some(kind) = &end.kind else {
            if let Some(arguments) = &end.arguments {
                let name = end.path.text();
                let at = arguments.first().map_or(end.span, |argument| argument.span);
                d.push(
                    Diagnostic::error("E0209", at, format!("`{name}` has arguments but no kind"))
                        .label(end.path.span, "no kind before this name")
                        .help(format!(
                            "arguments belong where the element is declared, as in `R:{name}(…)`"
                        )),
                );
            }
            return;
        };
        let name = &end.path.name;
        let Some(row) = element(&kind.text) else {
            self.excused.insert(&name.text);
            d.push(unknown_kind(kind, name));
            return;
        };
        if let Some(member) = end.path.members.first() {
            d.push(
                Diagnostic::error(
                    "E0204",
                    member.span,
                    "a port cannot be named where its element is declared",
                )
                .help(format!(
                    "declare `{}:{}` in a statement of its own, then write `{}`",
                    kind.text,
                    name.text,
                    end.path.text()
                )),
            );
        }
        if let Some(&first) = self.vertices.get(name.text.as_str()) {
            let first = self.declarations[first.index()];
            let mut error =
                Diagnostic::error("E0203", end.span, format!("`{}` is declared twice", name.text))
                    .says("declared again here")
                    .label(first.span, "first declared here");
            if first.element.kind == row.kind && end.arguments.is_none() {
                error = error
                    .help("write the name alone to speak of the same element")
                    .fix("leave out the kind", vec![(end.span, end.path.text())]);
            } else {
                error = error.help("exactly one occurrence of a name carries its kind");
            }
            d.push(error);
            return;
        }
        let id = VertexId(self.graph.vertices.len() as u32);
        self.vertices.insert(&name.text, id);
        self.graph.vertices.push(Vertex {
            name: name.text.clone(),
            kind: row.kind,
            law: Law::One,
            span: kind.span.join(name.span),
            bonds: vec![],
        });
        self.declarations.push(Declaration {
            element: row,
            arguments: end.arguments.as_deref(),
            name,
            span: end.span,
            statement,
        });
    }

    fn declare_parameter(
        &mut self,
        name: &'a Part,
        value: &'a Syntax,
        description: Option<&Name>,
        statement: usize,
        d: &mut Vec<Diagnostic>,
    ) {
        let id = ParameterId(self.graph.parameters.len() as u32);
        if !self.declare_value(name, Meaning::Parameter(id), d) {
            return;
        }
        self.graph.parameters.push(Parameter {
            name: name.text.clone(),
            expr: Tree::number(f64::NAN),
            value: f64::NAN,
            unit: None,
            description: description.map(|text| text.text.clone()).unwrap_or_default(),
            span: name.span,
        });
        self.parameters.push(Valued { value, statement });
    }

    fn declare_signal(
        &mut self,
        name: &'a Part,
        origin: SignalOrigin,
        valued: Option<Valued<'a>>,
        statement: usize,
        d: &mut Vec<Diagnostic>,
    ) {
        let id = SignalId(self.graph.signals.len() as u32);
        if !self.declare_value(name, Meaning::Signal(id), d) {
            return;
        }
        self.graph.signals.push(Signal {
            name: name.text.clone(),
            law: SignalLaw::Algebraic(Tree::number(0.0)),
            origin,
            span: name.span,
            unit: None,
        });
        self.signals.push(valued);
        self.signal_order.push((statement, usize::MAX));
    }

    /// Takes a name into the space of values, unless it is taken or reserved.
    fn declare_value(&mut self, name: &'a Part, meaning: Meaning, d: &mut Vec<Diagnostic>) -> bool {
        if RESERVED.contains(&name.text.as_str()) {
            self.excused.insert(&name.text);
            let means = match name.text.as_str() {
                "time" => "the time",
                "pi" => "the number π",
                _ => "an element's own variable",
            };
            d.push(
                Diagnostic::error(
                    "E0205",
                    name.span,
                    format!("`{}` cannot name a parameter or a signal", name.text),
                )
                .says(format!("in a law this is {means}"))
                .help("choose another name"),
            );
            return false;
        }
        if let Some(first) = self.values.get(name.text.as_str()) {
            let first = self.value_span(*first);
            d.push(
                Diagnostic::error("E0203", name.span, format!("`{}` is declared twice", name.text))
                    .says("declared again here")
                    .label(first, "first declared here")
                    .because("parameters, signals and inputs share one space of names"),
            );
            return false;
        }
        self.values.insert(&name.text, meaning);
        true
    }

    /// Where a parameter or signal is declared.
    pub fn value_span(&self, meaning: Meaning) -> Span {
        match meaning {
            Meaning::Parameter(id) => self.graph.parameters[id.index()].span,
            Meaning::Signal(id) => self.graph.signals[id.index()].span,
        }
    }

    /// The element of a name; an error tells the nearest.
    pub fn vertex(&self, path: &Path, d: &mut Vec<Diagnostic>) -> Option<VertexId> {
        let name = path.name.text.as_str();
        if let Some(id) = self.vertices.get(name) {
            return Some(*id);
        }
        if self.excused.contains(name) {
            return None;
        }
        let error = Diagnostic::error(
            "E0206",
            path.name.span,
            format!("no element or junction is called `{name}`"),
        )
        .says("not declared anywhere");
        let declared = self.graph.vertices.iter().map(|vertex| vertex.name.as_str());
        // Names in statements that could not be read may be meant too; sorted, so that a tie has one winner.
        let unread: std::collections::BTreeSet<&str> = self.excused.iter().copied().collect();
        let names = declared.chain(unread);
        d.push(if let Some(meant) = nearest(name, names) {
            did_you_mean(error, path.name.span, meant)
        } else if self.values.contains_key(name) {
            error.because(format!("`{name}` is a parameter or signal, which no bond can join"))
        } else {
            error.help(format!("give it a kind where it is declared, as in `1:{name}`"))
        });
        None
    }
}

/// Names that mean something of their own in a law.
pub(super) const RESERVED: [&str; 6] = ["e", "f", "q", "p", "time", "pi"];

/// A noun with its article: `an inertia`.
pub(super) fn a(noun: &str) -> String {
    format!("{} {noun}", if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" })
}

/// Adds the nearest name as a hint and a fix.
pub(super) fn did_you_mean(error: Diagnostic, span: Span, meant: &str) -> Diagnostic {
    let error = error.help(format!("did you mean `{meant}`?"));
    if span.is_none() {
        return error;
    }
    error.fix(format!("write `{meant}`"), vec![(span, meant.to_string())])
}

fn unknown_kind(kind: &Name, name: &Part) -> Diagnostic {
    let text = kind.text.as_str();
    if text == "IC" || text == "MIC" {
        return Diagnostic::error("E0201", kind.span, "fields are not part of the language yet")
            .says("a field");
    }
    let error = Diagnostic::error("E0204", kind.span, format!("`{text}` is no kind of element"))
        .says("unknown kind");
    match nearest(text, ELEMENTS.iter().map(|row| row.kind)) {
        Some(meant) => did_you_mean(error, kind.span, meant),
        None => error
            .because(format!(
                "the kinds are {}",
                ELEMENTS.iter().map(|row| row.kind).collect::<Vec<_>>().join(" ")
            ))
            .help(format!(
                "instances of models are not part of the language yet; `{}` must be one of these",
                name.text
            )),
    }
}

/// The name of a file without folders and ending.
fn stem(map: &SourceMap, file: &File) -> String {
    let name = map.file(file.file).map_or("", |file| file.name.as_str());
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let stem = last.strip_suffix(".bg").unwrap_or(last);
    stem.trim_matches(['<', '>']).to_string()
}
