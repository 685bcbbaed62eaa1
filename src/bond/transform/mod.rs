//! Changes of a model that write a new text of it: elements moved across two-ports, junctions and elements merged, two
//! equal lines lumped into one, elements left out, instances laid open.
//!
//! A change is a [`Plan`](plan::Plan) over the graph: what goes, what hangs elsewhere, what law is another. [`rewrite`] makes
//! it in the author's own text, statement by statement, so that names, units and comments stay; a comment above each
//! change says what was done and why it may be. What stands in instances, loops and conditions has no text of its own to
//! change: [`flat`] lays it open first.

pub mod plan;
pub mod factor;
mod respell;
mod arguments;
pub mod rewrite;
pub mod across;
pub mod simplify;
pub mod lump;
pub mod remove;
pub mod flat;
mod letters;

use crate::bond::elaborate::{self, Overrides};
use crate::bond::graph::{BondGraph, BondId, VertexId};
use crate::bond::syntax::{self, Argument, ChainEnd, File, Name, StatementKind};
use crate::diagnostic::{Diagnostic, Severity, has_errors};
use crate::quantity::nearest;
use crate::source::{FileId, SourceMap, Span};
use std::collections::HashMap;

/// Why a change cannot be made.
pub type Trouble = Box<Diagnostic>;

/// A model that is changed step by step.
pub struct Work<'m> {
    /// All texts, those of the steps, too.
    pub map: &'m mut SourceMap,
    /// In which imports are looked for.
    pub folders: Vec<String>,
    /// The model as it is now.
    pub source: Source,
    /// Whether its instances have been laid open.
    pub opened: bool,
}

impl<'m> Work<'m> {
    /// Begins with a text that is in the map; what is wrong with it is said in `d`.
    pub fn begin(
        map: &'m mut SourceMap,
        file: FileId,
        folders: &[String],
        d: &mut Vec<Diagnostic>,
    ) -> Option<Work<'m>> {
        let source = Source::read(map, file, folders, d)?;
        Some(Work { map, folders: folders.to_vec(), source, opened: false })
    }

    /// Takes another text in the place of that of now.
    fn take(&mut self, text: String) -> Result<(), Trouble> {
        let name = self.map.file(self.source.file).map(|file| file.name.clone());
        let file = self.map.add(name.unwrap_or_default(), text);
        let mut d = vec![];
        match Source::read(self.map, file, &self.folders, &mut d) {
            Some(source) => self.source = source,
            None => {
                let error = d.into_iter().find(|said| said.severity == Severity::Error);
                let unsaid =
                    || Diagnostic::error("E1101", Span::NONE, "the new text cannot be read");
                return Err(Box::new(error.unwrap_or_else(unsaid)));
            }
        }
        Ok(())
    }

    /// Lays all instances open.
    ///
    /// # Errors
    /// What cannot stand in a flat text.
    pub fn lay_open(&mut self) -> Result<(), Trouble> {
        let text = flat::flat(&self.source.graph, self.map)?;
        self.take(text)?;
        self.opened = true;
        Ok(())
    }

    /// Makes one change, and lays instances open where it reaches into them.
    ///
    /// # Errors
    /// Why it cannot be made.
    pub fn change(
        &mut self,
        make: &dyn Fn(&Source) -> Result<plan::Plan, Trouble>,
    ) -> Result<(), Trouble> {
        let mut plan = make(&self.source)?;
        if !rewrite::within(&self.source, &plan) {
            self.lay_open()?;
            plan = make(&self.source)?;
        }
        self.take(rewrite::apply(&self.source, &plan)?)
    }

    /// Simplifies until nothing more can be done; gives the number of steps.
    ///
    /// # Errors
    /// That a text of a step cannot be read.
    pub fn simplify(&mut self) -> Result<usize, Trouble> {
        let mut steps = 0;
        while let Some(text) = simplify::step(&self.source) {
            self.take(text)?;
            steps += 1;
        }
        Ok(steps)
    }
}

/// A model as text, as tree and as graph.
pub struct Source {
    /// Its text, in the map.
    pub file: FileId,
    /// The text.
    pub text: String,
    /// What it says.
    pub syntax: File,
    /// What it means.
    pub graph: BondGraph,
    names: HashMap<String, VertexId>,
    declared: HashMap<VertexId, Declared>,
}

/// Where an element is declared at the top of the file.
#[derive(Clone)]
struct Declared {
    kind: Name,
    arguments: Option<Vec<Argument>>,
    /// All of the end of the arrow.
    span: Span,
}

impl Source {
    /// Reads and elaborates a text that is in the map.
    pub fn read(
        map: &mut SourceMap,
        file: FileId,
        folders: &[String],
        d: &mut Vec<Diagnostic>,
    ) -> Option<Source> {
        let program = elaborate::load(map, file, folders, d);
        let overrides = Overrides { folders: folders.to_vec(), ..Overrides::default() };
        let graph = elaborate::elaborate(&program, map, &overrides, d)?;
        if has_errors(d) {
            return None;
        }
        let syntax = program.files.into_iter().next()?;
        let text = map.file(file)?.text.clone();
        let mut names = HashMap::new();
        for id in graph.vertex_ids() {
            names.insert(graph.vertex(id).name.clone(), id);
        }
        let mut source = Source { file, text, syntax, graph, names, declared: HashMap::new() };
        source.find_declarations();
        Some(source)
    }

    fn find_declarations(&mut self) {
        let mut found = vec![];
        for statement in &self.syntax.statements {
            let StatementKind::Chain(chain) = &statement.kind else { continue };
            let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
            for end in ends {
                if let (Some(kind), Some(id)) = (&end.kind, self.vertex_of(end)) {
                    let declared = Declared {
                        kind: kind.clone(),
                        arguments: end.arguments.clone(),
                        span: end.span,
                    };
                    found.push((id, declared));
                }
            }
        }
        self.declared.extend(found);
    }

    /// The junction or element that an end of an arrow names, where it is the file's own.
    fn vertex_of(&self, end: &ChainEnd) -> Option<VertexId> {
        let plain = end.path.parts().all(|part| part.indices.is_empty());
        plain.then(|| self.names.get(&end.path.name.text).copied()).flatten()
    }

    /// Whether an element stands at the top of the file, so that its text can be changed.
    pub fn own(&self, id: VertexId) -> bool {
        self.declared.contains_key(&id)
    }

    /// The element or junction of a name.
    ///
    /// # Errors
    /// That there is none.
    pub fn find(&self, name: &str) -> Result<VertexId, Trouble> {
        let flat = flat::flat_name(name);
        if let Some(id) = self.names.get(name).or_else(|| self.names.get(&flat)) {
            return Ok(*id);
        }
        let message = format!("`{}` has no element or junction `{name}`", self.graph.name);
        let error = Diagnostic::error("E1100", Span::NONE, message);
        Err(Box::new(match nearest(name, self.names.keys().map(String::as_str)) {
            Some(meant) => error.help(format!("did you mean `{meant}`?")),
            None => error.help("`bondspice causality` and `draw` show its elements"),
        }))
    }

    /// `I:J`, as messages and comments call an element.
    fn title(&self, id: VertexId) -> String {
        let vertex = self.graph.vertex(id);
        format!("{}:{}", vertex.kind, vertex.name)
    }

    /// The text of a place in this file.
    fn slice(&self, span: Span) -> &str {
        match span.file == self.file {
            true => self.text.get(span.start as usize..span.end as usize).unwrap_or(""),
            false => "",
        }
    }

    /// The text of the value that an element is given without a label: its own name where it has none.
    fn value(&self, id: VertexId) -> Option<(String, Option<&syntax::Expr>)> {
        let declared = self.declared.get(&id)?;
        let plain = declared.arguments.iter().flatten().find(|argument| argument.label.is_none());
        match plain {
            Some(argument) => match &argument.value {
                syntax::Value::Expr(expr) => Some((self.slice(expr.span).into(), Some(expr))),
                _ => None,
            },
            None if declared.arguments.iter().flatten().all(is_initial) => {
                Some((self.graph.vertex(id).name.clone(), None))
            }
            None => None,
        }
    }

    /// The other end of a bond.
    fn beyond(&self, bond: BondId, from: VertexId) -> VertexId {
        let bond = self.graph.bond(bond);
        if bond.from.vertex == from { bond.to.vertex } else { bond.from.vertex }
    }

    /// A name that neither an element nor a junction has.
    fn fresh(&self, wanted: &str) -> String {
        let taken =
            |name: &str| self.names.contains_key(name) || self.graph.instances.contains_key(name);
        let tries = std::iter::once(wanted.to_string())
            .chain((2..).map(|k| format!("{wanted}_{k}")))
            .find(|name| !taken(name));
        tries.unwrap_or_default()
    }
}

/// Whether an argument says where a storage starts.
fn is_initial(argument: &Argument) -> bool {
    let label = argument.label.as_ref();
    label.is_some_and(|label| matches!(label.name.text.as_str(), "q0" | "p0" | "e0" | "f0"))
}
