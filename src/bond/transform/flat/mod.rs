//! A model with all its instances, loops and conditions laid open: one flat text in which everything can be changed.
//!
//! `motor.rotor` becomes `motor_rotor`. What only passes a value on (a parameter of an instance that is given one of the
//! file, an input that is given a signal) stands by the name of what it passes on. Numbers stand as they are written where
//! they come from, with their units.

mod elements;

use super::rewrite::comment;
use crate::bond::graph::{
    BondGraph, BondId, End, Expr, Initial, Law, Leaf, ParameterId, Power, SignalId, SignalLaw,
    SignalOrigin, Storage, Variable,
};
use crate::bond::syntax::{self, format};
use crate::bond::words::{letter, signal_law_in};
use crate::diagnostic::Diagnostic;
use crate::expr::print::print;
use crate::expr::{Binary, Dialect, Expr as Tree, Node, Unary};
use crate::source::{SourceMap, Span};
use elements::initials;
use std::collections::HashSet;

/// The name of an element in a flat text.
pub fn flat_name(name: &str) -> String {
    name.chars().filter(|c| *c != ']').map(|c| if ".[,".contains(c) { '_' } else { c }).collect()
}

/// Names in a flat text.
struct Names {
    vertices: Vec<String>,
    parameters: Vec<String>,
    signals: Vec<String>,
}

struct Writer<'g> {
    graph: &'g BondGraph,
    map: &'g SourceMap,
    names: Names,
    /// What stands for a parameter or a signal that only passes another on.
    parameters: Vec<ParameterId>,
    signals: Vec<SignalId>,
}

/// What stands in a flat expression: a leaf of the graph, or a number as it is written.
#[derive(Clone)]
enum Piece {
    Leaf(Leaf),
    Text(String),
}

/// The flat text of a graph.
///
/// # Errors
/// What cannot be written.
pub fn flat(graph: &BondGraph, map: &SourceMap) -> Result<String, super::Trouble> {
    let writer = Writer {
        graph,
        map,
        names: names(graph),
        parameters: (0..graph.parameters.len() as u32)
            .map(|k| resolve_parameter(graph, k))
            .collect(),
        signals: (0..graph.signals.len() as u32).map(|k| resolve_signal(graph, k)).collect(),
    };
    writer.text()
}

fn resolve_parameter(graph: &BondGraph, k: u32) -> ParameterId {
    let mut id = ParameterId(k);
    // As deep as instances stand in each other at most.
    for _ in 0..graph.parameters.len() {
        let parameter = &graph.parameters[id.index()];
        match &*parameter.expr.node {
            Node::Leaf(Leaf::Parameter(other)) if parameter.name.contains('.') => id = *other,
            _ => break,
        }
    }
    id
}

fn resolve_signal(graph: &BondGraph, k: u32) -> SignalId {
    let mut id = SignalId(k);
    for _ in 0..graph.signals.len() {
        let signal = &graph.signals[id.index()];
        match &signal.law {
            SignalLaw::Algebraic(expr) if signal.name.contains('.') => match &*expr.node {
                Node::Leaf(Leaf::Signal(other)) => id = *other,
                _ => break,
            },
            _ => break,
        }
    }
    id
}

/// A flat name for each, no two alike.
fn names(graph: &BondGraph) -> Names {
    fn all<'n>(
        names: impl Iterator<Item = &'n str> + Clone,
        taken: &mut HashSet<String>,
    ) -> Vec<String> {
        // Names that are flat already stay.
        taken.extend(names.clone().filter(|name| flat_name(name) == *name).map(String::from));
        let one = |name: &str| {
            let flat = flat_name(name);
            if flat == name {
                return flat;
            }
            let tries = std::iter::once(flat.clone()).chain((2..).map(|k| format!("{flat}_{k}")));
            let mut free = tries.filter(|name| !taken.contains(name));
            let free = free.next().unwrap_or(flat);
            taken.insert(free.clone());
            free
        };
        names.map(one).collect()
    }
    let mut taken = HashSet::new();
    let vertices = all(graph.vertices.iter().map(|vertex| vertex.name.as_str()), &mut taken);
    let reserved = ["e", "f", "q", "p", "time", "pi"];
    let mut taken: HashSet<String> = reserved.map(String::from).into();
    taken.extend(graph.signals.iter().map(|s| s.name.clone()).filter(|n| flat_name(n) == *n));
    let parameters = all(graph.parameters.iter().map(|p| p.name.as_str()), &mut taken);
    let signals = all(graph.signals.iter().map(|signal| signal.name.as_str()), &mut taken);
    Names { vertices, parameters, signals }
}

impl Writer<'_> {
    fn text(&self) -> Result<String, super::Trouble> {
        let graph = self.graph;
        let (parameters, signals) = self.needed();
        let mut text = self.head();
        for k in parameters {
            let parameter = &graph.parameters[k];
            text +=
                &format!("param {} = {}", self.names.parameters[k], self.expr(&parameter.expr, ""));
            match parameter.description.as_str() {
                "" => text += "\n",
                words => text += &format!(" \"{words}\"\n"),
            }
        }
        text += "\n";
        text += &self.chains()?;
        text += "\n";
        let undriven: HashSet<usize> =
            graph.experiment.undriven.iter().map(|id| id.index()).collect();
        let mut drives = String::new();
        for k in signals {
            let (signal, name) = (&graph.signals[k], &self.names.signals[k]);
            let law = self.signal(k)?;
            if signal.origin == SignalOrigin::Input && !signal.name.contains('.') {
                text += &format!("input {name}\n");
                if !undriven.contains(&k) {
                    drives += &format!("drive {name} = {law}\n");
                }
            } else {
                text += &format!("signal {name} = {law}\n");
            }
        }
        for id in graph.tree.first().iter().flat_map(|file| &file.outputs) {
            text += &format!("output {}\n", self.names.signals[id.index()]);
        }
        text += "\n";
        text += &drives;
        text += &self.experiment();
        Ok(format(&text))
    }

    /// The comment that the file begins with, and what has become of it.
    fn head(&self) -> String {
        let file = self.graph.tree.first().map(|file| file.span.file);
        let spans = self.graph.vertices.iter().map(|vertex| vertex.span.file);
        let file = file.into_iter().chain(spans).find_map(|file| self.map.file(file));
        let lines = file.map_or("", |file| file.text.as_str()).lines();
        let own: Vec<&str> = lines.take_while(|line| line.starts_with('#')).collect();
        let mut head = own.join("\n");
        if !own.is_empty() {
            head += "\n";
        }
        head += &comment(
            "Laid open: every instance stands as its parts, `a.b` as `a_b`; what only passed a value on is that value.",
            "",
        );
        if !self.graph.regulators.is_empty() {
            let what = "Regulators stand as integrators and limits, so that `loop` statements are left out.";
            head += &comment(what, "");
        }
        head + "\n"
    }

    /// What is written of parameters and signals: the file's own, and what these and the laws need.
    fn needed(&self) -> (Vec<usize>, Vec<usize>) {
        let graph = self.graph;
        let mut parameters = vec![false; graph.parameters.len()];
        let mut signals = vec![false; graph.signals.len()];
        let mut open: Vec<Leaf> = vec![];
        for (k, parameter) in graph.parameters.iter().enumerate() {
            if !parameter.name.contains('.') {
                open.push(Leaf::Parameter(ParameterId(k as u32)));
            }
        }
        for (k, signal) in graph.signals.iter().enumerate() {
            if !signal.name.contains('.') && signal.origin != SignalOrigin::Hidden {
                open.push(Leaf::Signal(SignalId(k as u32)));
            }
        }
        let mut need = |expr: &Expr| {
            let mut found = vec![];
            expr.leaves(&mut |leaf, _| found.push(leaf.clone()));
            open.extend(found);
        };
        for vertex in &graph.vertices {
            vertex.law.expressions(&mut |expr| need(expr));
            for initial in initials(&vertex.law) {
                need(initial);
            }
            if let Law::Field(field) = &vertex.law {
                field.matrix.iter().flatten().flatten().for_each(&mut need);
            }
        }
        graph.experiment.observe.iter().for_each(|item| need(&item.expr));
        while let Some(leaf) = open.pop() {
            match leaf {
                Leaf::Parameter(id) => {
                    let id = self.parameters[id.index()];
                    if !std::mem::replace(&mut parameters[id.index()], true) {
                        let expr = &graph.parameters[id.index()].expr;
                        expr.leaves(&mut |leaf, _| open.push(leaf.clone()));
                    }
                }
                Leaf::Signal(id) => {
                    let id = self.signals[id.index()];
                    if !std::mem::replace(&mut signals[id.index()], true) {
                        // All that its law speaks of, a waveform's parameters, too.
                        graph.signals[id.index()].law.expressions(&mut |expr| {
                            expr.leaves(&mut |leaf, _| open.push(leaf.clone()));
                        });
                    }
                }
                _ => {}
            }
        }
        let kept = |all: Vec<bool>| (0..all.len()).filter(|k| all[*k]).collect();
        (kept(parameters), kept(signals))
    }

    /// An expression as text; `stored` is what the element itself stores.
    fn expr(&self, expr: &Expr, stored: &str) -> String {
        let pieces = self.pieces(expr, true);
        print(&pieces, Dialect::Bond, &mut |piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Leaf(leaf) => self.leaf(leaf, stored),
        })
    }

    fn pieces(&self, expr: &Expr, whole: bool) -> Tree<Piece> {
        let part = |expr: &Expr| self.pieces(expr, false);
        let node = match &*expr.node {
            Node::Number(value) => match self.as_written(expr.span, *value) {
                Some(text) if whole => Node::Leaf(Piece::Text(text)),
                Some(text) => Node::Leaf(Piece::Text(format!("({text})"))),
                None => Node::Number(*value),
            },
            Node::Leaf(leaf) => Node::Leaf(Piece::Leaf(leaf.clone())),
            Node::Unary(op, a) => Node::Unary(*op, part(a)),
            Node::Binary(op, a, b) => Node::Binary(*op, part(a), part(b)),
            Node::Call(function, arguments) => {
                let arguments = arguments.iter().map(|a| self.pieces(a, true)).collect();
                Node::Call(*function, arguments)
            }
            Node::If(c, a, b) => Node::choice(part(c), part(a), part(b)),
            Node::Table(a, table) => Node::Table(self.pieces(a, true), table.clone()),
        };
        Tree::new(node, expr.span)
    }

    /// A number with its unit, as the text has it.
    fn as_written(&self, span: Span, value: f64) -> Option<String> {
        let text = self.map.text(span).trim();
        if text.is_empty() || text.parse::<f64>().is_ok() {
            return None;
        }
        let read = syntax::parse_value(text, Span::NONE.file, &mut vec![])?;
        let same = match &*read.node {
            Node::Leaf(syntax::Leaf::Quantity(same, _)) => *same,
            Node::Unary(Unary::Negate, a) => match &*a.node {
                Node::Leaf(syntax::Leaf::Quantity(same, _)) => -same,
                _ => return None,
            },
            _ => return None,
        };
        (same.to_bits() == value.to_bits()).then(|| text.to_string())
    }

    fn leaf(&self, leaf: &Leaf, stored: &str) -> String {
        match leaf {
            Leaf::Parameter(id) => {
                self.names.parameters[self.parameters[id.index()].index()].clone()
            }
            Leaf::Signal(id) => self.names.signals[self.signals[id.index()].index()].clone(),
            Leaf::Time => "time".into(),
            Leaf::Own(Variable::Power(power)) => letter(*power).into(),
            Leaf::Own(Variable::Stored) => stored.into(),
            Leaf::Bond { bond, variable, negated } => self.reading(*bond, *variable, *negated),
            Leaf::Stored(end) => {
                let compliance = self.graph.storage(*end) == Some(Storage::Compliance);
                format!("{}({})", if compliance { "q" } else { "p" }, self.port(*end))
            }
        }
    }

    /// A port as readings name it.
    fn port(&self, end: End) -> String {
        let name = &self.names.vertices[end.vertex.index()];
        match self.graph.vertex(end.vertex).law {
            Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {
                format!("{name}.{}", end.port + 1)
            }
            _ => name.clone(),
        }
    }

    /// A variable of a bond: that of a junction or an element where one has it.
    fn reading(&self, id: BondId, variable: Power, negated: bool) -> String {
        let (what, bond) = (letter(variable), self.graph.bond(id));
        let law = |end: End| &self.graph.vertex(end.vertex).law;
        let ends = [bond.from, bond.to];
        let common = ends.iter().find(|end| {
            matches!(
                (law(**end), variable),
                (Law::Zero, Power::Effort)
                    | (Law::One, Power::Flow)
                    | (Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. }, Power::Effort)
                    | (Law::Source { detector: false, .. }, _)
            )
        });
        let into =
            matches!(law(bond.to), Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. });
        let text = match common {
            Some(end) => format!("{what}({})", self.port(*end)),
            None if into => format!("{what}({})", self.port(bond.to)),
            None => {
                let name = |end: End| match law(end) {
                    Law::Field(_) => self.port(end),
                    _ => self.names.vertices[end.vertex.index()].clone(),
                };
                let same: Vec<BondId> = self
                    .graph
                    .bond_ids()
                    .filter(|other| {
                        let other = self.graph.bond(*other);
                        other.from.vertex == bond.from.vertex && other.to.vertex == bond.to.vertex
                    })
                    .collect();
                let index = match same.iter().position(|other| *other == id) {
                    Some(k) if same.len() > 1 => format!("[{}]", k + 1),
                    _ => String::new(),
                };
                format!("{what}({} -> {}){index}", name(bond.from), name(bond.to))
            }
        };
        if negated { format!("(-{text})") } else { text }
    }

    fn signal(&self, k: usize) -> Result<String, super::Trouble> {
        let signal = &self.graph.signals[k];
        if let SignalLaw::Integrator { rate, initial: Initial::Implied } = &signal.law {
            let Some((x, tau)) = self.lagged(rate, SignalId(k as u32)) else {
                let message = format!(
                    "`{}` starts where its own law says, which no text can say",
                    signal.name
                );
                return Err(Box::new(Diagnostic::error("E1101", signal.span, message)));
            };
            return Ok(format!("lag({}, {})", self.expr(x, ""), self.expr(tau, "")));
        }
        if let SignalLaw::Integrator { rate, initial: Initial::Given(zero) } = &signal.law
            && zero.constant() == Some(0.0)
        {
            return Ok(format!("integ({})", self.expr(rate, "")));
        }
        Ok(signal_law_in(&|expr| self.expr(expr, ""), &signal.law))
    }

    /// x and tau of an integrator of (x − itself)/tau, or of a signal that is that.
    fn lagged<'e>(&'e self, rate: &'e Expr, own: SignalId) -> Option<(&'e Expr, &'e Expr)> {
        match &*rate.node {
            Node::Binary(Binary::Divide, difference, tau) => match &*difference.node {
                Node::Binary(Binary::Subtract, x, y) => {
                    matches!(&*y.node, Node::Leaf(Leaf::Signal(id)) if *id == own)
                        .then_some((x, tau))
                }
                _ => None,
            },
            Node::Leaf(Leaf::Signal(id)) if *id != own => match &self.graph.signals[id.index()].law
            {
                SignalLaw::Algebraic(expr) => match &*expr.node {
                    Node::Binary(Binary::Divide, ..) => self.lagged(expr, own),
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        }
    }

    fn experiment(&self) -> String {
        let experiment = &self.graph.experiment;
        let mut text = String::new();
        if let Some(until) = experiment.until {
            text += &format!("simulate until {until} s");
            if let Some(step) = experiment.step {
                text += &format!(" step {step} s");
            }
            text += "\n";
        }
        if !experiment.options.is_empty() {
            let all: Vec<String> =
                experiment.options.iter().map(|(key, value)| format!("{key} = {value}")).collect();
            text += &format!("options {}\n", all.join(", "));
        }
        let item = |item: &crate::bond::graph::Observation| {
            let value = self.expr(&item.expr, "");
            let unit = match item.unit.0.as_str() {
                "" => String::new(),
                unit => format!(" in {unit}"),
            };
            let bare: String = value.chars().filter(|c| !c.is_whitespace()).collect();
            let name =
                if bare == item.name { String::new() } else { format!(" as \"{}\"", item.name) };
            format!("{value}{unit}{name}")
        };
        let items: Vec<String> = experiment.observe.iter().map(item).collect();
        if !items.is_empty() {
            text += &format!("observe {}\n", items.join(", "));
        }
        text
    }
}
