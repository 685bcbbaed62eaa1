//! Columns: what is observed, under which header, in which unit; and what can be.

use super::dimensions::Dim;
use super::experiment::{is_name, si_text};
use super::frames::{FrameId, Here};
use super::reading::variable;
use super::scope::{Meaning, Scope};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{Expr as Syntax, ObserveItem, parse_observe};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Node};
use crate::quantity::{Dimension, Domain, Unit};
use crate::source::Span;
use std::collections::{HashMap, HashSet};

impl Scope<'_> {
    /// The columns of a run: those of the command line, else the file's, else the default ones.
    pub fn set_observed(&mut self, given: Option<&str>, d: &mut Vec<Diagnostic>) {
        self.note_units();
        let before = d.len();
        let columns = match given {
            Some(text) => {
                let items = parse_observe(text, Span::NONE.file, d).unwrap_or_default();
                let columns = self.columns(items.iter(), Some(text), d);
                for error in &mut d[before..] {
                    error.notes.push(format!("in what is to be observed: {text}"));
                }
                columns
            }
            None => {
                let items = std::mem::take(&mut self.observe);
                self.columns(items.iter().copied(), None, d)
            }
        };
        let nothing = columns.is_empty() && d.len() == before;
        self.graph.experiment.observe = match nothing {
            true => self.columns_of_any(),
            false => columns,
        };
    }

    /// Warns of signals of the file that nothing reads: no law, no other signal, no regulator, no output, no column. What
    /// models keep to themselves may be there to be looked at.
    pub fn warn_of_unread(&self, d: &mut Vec<Diagnostic>) {
        let graph = &self.graph;
        let mut read = vec![false; graph.signals.len()];
        let mut note = |expr: &Expr| {
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Signal(id) = leaf {
                    read[id.index()] = true;
                }
            });
        };
        graph.vertices.iter().for_each(|vertex| vertex.law.expressions(&mut note));
        graph.experiment.observe.iter().for_each(|column| note(&column.expr));
        for regulator in &graph.regulators {
            note(&regulator.controlled);
            note(&regulator.reference);
        }
        for (k, signal) in graph.signals.iter().enumerate() {
            let Some(expr) = signal.law.expression() else { continue };
            // What a signal or its hidden parts read of itself is no use of it.
            let statement = self.signal_order.get(k).map(|order| order.0);
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Signal(id) = leaf {
                    let own = self.signal_order.get(id.index()).map(|order| order.0) == statement;
                    read[id.index()] |= !own;
                }
            });
        }
        for (name, here) in self.outputs.iter().filter(|(_, here)| here.frame == FrameId(0)) {
            let values = &self.frames[0].values;
            if let Some(Meaning::Signal(id)) =
                self.key_at(name, *here).and_then(|key| values.get(&*key))
            {
                read[id.index()] = true;
            }
        }
        for (signal, _) in graph.signals.iter().zip(&read).filter(|(_, read)| !**read) {
            if signal.origin != SignalOrigin::Signal || signal.name.contains('.') {
                continue;
            }
            d.push(
                Diagnostic::warning(
                    "W0203",
                    signal.span,
                    format!("nothing reads the signal `{}`", signal.name),
                )
                .says("of no effect, and not observed")
                .help(format!(
                    "add it to `observe`, say `output {0}`, or leave it out",
                    signal.name
                )),
            );
        }
    }

    /// Notes the units of signals that are known.
    fn note_units(&mut self) {
        // There are many signals and few dimensions.
        let mut units: HashMap<Dimension, Unit> = HashMap::new();
        for (signal, dim) in self.graph.signals.iter_mut().zip(&self.signal_dimensions) {
            if let Dim::Known(dimension) = *dim {
                let unit = units.entry(dimension);
                let make = || Unit { text: si_text(dimension), factor: 1.0, dimension };
                signal.unit = Some(unit.or_insert_with(make).clone());
            }
        }
    }

    fn columns<'i>(
        &mut self,
        items: impl Iterator<Item = &'i ObserveItem>,
        given: Option<&str>,
        d: &mut Vec<Diagnostic>,
    ) -> Vec<Observation> {
        let mut columns = vec![];
        let mut heads: HashMap<String, Span> = HashMap::new();
        for item in items {
            if is_name(&item.expr, "all") && self.value("all").is_none() {
                let mut all = self.default_columns();
                all.extend(observables(&self.graph));
                for column in all {
                    if heads.insert(column.name.clone(), item.span).is_none() {
                        columns.push(column);
                    }
                }
                continue;
            }
            let Some(column) = self.column(item, given, d) else { continue };
            if column.name == "time" {
                d.push(
                    Diagnostic::error("E0221", item.span, "two columns would be headed `time`")
                        .says("this one, and the first of every result")
                        .help("give it another name: `… as \"name\"`"),
                );
                continue;
            }
            if let Some(first) = heads.insert(column.name.clone(), item.span) {
                d.push(
                    Diagnostic::error(
                        "E0221",
                        item.span,
                        format!("two columns would be headed `{}`", column.name),
                    )
                    .says("the second one")
                    .label(first, "the first one")
                    .help("give one of them another name: `… as \"name\"`"),
                );
                continue;
            }
            columns.push(column);
        }
        columns
    }

    fn column(
        &mut self,
        item: &ObserveItem,
        given: Option<&str>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Observation> {
        let lowered = self.lower(&item.expr, Place::observed(), d);
        let dim = self.checked_dimension(&item.expr, d).whole();
        let unit = match &item.unit {
            None => (String::new(), 1.0),
            Some((unit, span)) => {
                if let Dim::Known(dimension) = dim
                    && dimension != unit.dimension
                {
                    let found = dimension.describe(self.written_unit(&item.expr).as_deref());
                    let asked = unit.dimension.describe(Some(&unit.text));
                    d.push(
                        Diagnostic::error(
                            "E0303",
                            *span,
                            format!("what is observed is {found}, not {asked}"),
                        )
                        .says(format!("a unit of {asked}"))
                        .label(item.expr.span, format!("this is {found}"))
                        .help(format!("observe it in a unit like {}", dimension.si())),
                    );
                    return None;
                }
                (unit.text.clone(), unit.factor)
            }
        };
        let name = match &item.name {
            Some(name) => name.text.clone(),
            None => self.written(&item.expr, given),
        };
        let expr = lowered?;
        let si_unit = self.si_unit(&expr, dim);
        Some(Observation { name, expr, unit, si_unit })
    }

    /// An expression as written, without blanks and comments.
    fn written(&self, expr: &Syntax, given: Option<&str>) -> String {
        let Span { start, end, .. } = expr.span;
        let text = match given {
            Some(text) => text.get(start as usize..end as usize).unwrap_or(""),
            None => self.map.text(expr.span),
        };
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or(line));
        lines.flat_map(|line| line.chars()).filter(|c| !c.is_whitespace()).collect()
    }

    fn si_unit(&self, expr: &Expr, dim: Dim) -> String {
        let known = unit_of(&self.graph, expr);
        match dim {
            Dim::Known(dimension) if known.is_empty() => si_text(dimension),
            _ => known,
        }
    }

    /// The default columns; where a graph has none, e and f of every element.
    fn columns_of_any(&self) -> Vec<Observation> {
        let columns = self.default_columns();
        if !columns.is_empty() {
            return columns;
        }
        let all = observables(&self.graph).into_iter();
        all.filter(|column| !column.name.starts_with("power(")).collect()
    }

    /// Inputs, outputs, signals, e of 0-junctions, f of 1-junctions, q and p of storages, each in file order.
    fn default_columns(&self) -> Vec<Observation> {
        let mut columns: Vec<Observation> = vec![];
        let mut heads: HashSet<String> = HashSet::new();
        let mut add = |column: Observation| {
            if heads.insert(column.name.clone()) {
                columns.push(column);
            }
        };
        let signals = |origin| {
            let all = self.graph.signals.iter().enumerate();
            all.filter(move |(_, signal)| signal.origin == origin).map(|(k, _)| SignalId(k as u32))
        };
        signals(SignalOrigin::Input).for_each(|id| add(signal_column(&self.graph, id)));
        for (name, here) in &self.outputs {
            let frame = &self.frames[here.frame.0 as usize];
            let at = |here: &Here| {
                self.key_at(name, *here).and_then(|key| frame.values.get(&*key).copied())
            };
            if let Some(Meaning::Signal(id)) = at(here) {
                add(signal_column(&self.graph, id));
            }
        }
        signals(SignalOrigin::Signal).for_each(|id| add(signal_column(&self.graph, id)));
        for (shape, what) in [("0", "e"), ("1", "f")] {
            for vertex in self.graph.vertices.iter().filter(|vertex| vertex.kind == shape) {
                if let Some(bond) = vertex.bonds.first() {
                    add(bond_column(&self.graph, &vertex.name, what, *bond, false));
                }
            }
        }
        for (end, _) in self.graph.stores() {
            stored_column(&self.graph, end).into_iter().for_each(&mut add);
        }
        columns
    }
}

/// Everything that can be observed by a name: inputs and signals, then the readings of every element in file order, then
/// those of the ports of instances.
pub fn observables(graph: &BondGraph) -> Vec<Observation> {
    let mut columns = vec![];
    for (k, signal) in graph.signals.iter().enumerate() {
        if signal.origin != SignalOrigin::Hidden {
            columns.push(signal_column(graph, SignalId(k as u32)));
        }
    }
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let mut add = |name: &str, what, bond, negated| {
            columns.push(bond_column(graph, name, what, bond, negated));
        };
        match (&vertex.law, vertex.bonds.as_slice()) {
            (Law::Zero, [bond, ..]) => add(&vertex.name, "e", *bond, false),
            (Law::One, [bond, ..]) => add(&vertex.name, "f", *bond, false),
            (Law::Transformer(_) | Law::Gyrator(_), [first, second]) => {
                for (port, bond) in [(1, first), (2, second)] {
                    for what in ["e", "f", "power"] {
                        add(&format!("{}.{port}", vertex.name), what, *bond, false);
                    }
                }
            }
            (law, [_, ..]) => {
                let along = matches!(law, Law::Source { detector: false, .. });
                for end in graph.law_ports(id) {
                    let Some(bond) = graph.bond_at(end) else { continue };
                    let negated = !along && graph.bond(bond).from == end;
                    for what in ["e", "f", "power"] {
                        add(&graph.end_name(end), what, bond, negated);
                    }
                }
            }
            _ => {}
        }
        columns.extend(graph.law_ports(id).filter_map(|end| stored_column(graph, end)));
    }
    for (name, bond) in &graph.ports {
        for what in ["e", "f", "power"] {
            columns.push(bond_column(graph, name, what, *bond, false));
        }
    }
    columns
}

fn signal_column(graph: &BondGraph, id: SignalId) -> Observation {
    let expr = Tree::leaf(Leaf::Signal(id));
    let si_unit = unit_of(graph, &expr);
    let name = graph.signals[id.index()].name.clone();
    Observation { name, expr, unit: (String::new(), 1.0), si_unit }
}

fn bond_column(
    graph: &BondGraph,
    element: &str,
    what: &str,
    bond: BondId,
    negated: bool,
) -> Observation {
    let expr = variable(what, bond, negated, Span::NONE);
    let si_unit = unit_of(graph, &expr);
    Observation { name: format!("{what}({element})"), expr, unit: (String::new(), 1.0), si_unit }
}

fn stored_column(graph: &BondGraph, end: End) -> Option<Observation> {
    let what = if graph.storage(end)? == Storage::Compliance { "q" } else { "p" };
    let expr = Tree::leaf(Leaf::Stored(end));
    let si_unit = unit_of(graph, &expr);
    let name = format!("{what}({})", graph.end_name(end));
    Some(Observation { name, expr, unit: (String::new(), 1.0), si_unit })
}

/// The SI unit of a reading or a signal alone, in its domain's words; empty when it is not known.
pub fn unit_of(graph: &BondGraph, expr: &Expr) -> String {
    match &*expr.node {
        Node::Leaf(Leaf::Signal(id)) => {
            let unit = &graph.signals[id.index()].unit;
            unit.as_ref().map_or(String::new(), |unit| unit.text.clone())
        }
        Node::Leaf(Leaf::Bond { bond, variable, .. }) => {
            let row = graph.bond(*bond).domain.row();
            let text = if *variable == Power::Effort { row.effort } else { row.flow };
            text.to_string()
        }
        Node::Leaf(Leaf::Stored(end)) => {
            let row = graph.bond_at(*end).map_or(Domain::Any, |bond| graph.bond(bond).domain).row();
            match graph.storage(*end) {
                Some(Storage::Compliance) => row.displacement.to_string(),
                Some(Storage::Inertia) => row.momentum.to_string(),
                None => String::new(),
            }
        }
        Node::Binary(crate::expr::Binary::Multiply, a, b) => {
            // The power of a bond, as a reading gives it.
            match (&*a.node, &*b.node) {
                (
                    Node::Leaf(Leaf::Bond { bond, variable: Power::Effort, .. }),
                    Node::Leaf(Leaf::Bond { bond: same, variable: Power::Flow, .. }),
                ) if bond == same => {
                    let domain = graph.bond(*bond).domain;
                    let known = domain != Domain::Any && !domain.row().pseudo;
                    if known { "W".to_string() } else { String::new() }
                }
                _ => String::new(),
            }
        }
        _ => String::new(),
    }
}
