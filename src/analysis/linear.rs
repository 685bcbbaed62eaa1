//! A model's equations linearised at a point, with what imposes values on it, and what is read.
//!
//! ```text
//! E·y' = A·y + B·u        w = C·y + D·u
//! ```
//!
//! Every row determines one unknown: an integrator its state, an element what causality has it give, a signal its own
//! value. An input that is an unknown takes the place of its row: 0 = y − u. So a source's input is its value, a loop is cut
//! where a signal is imposed, and what used to give a bond's effort is put aside where the effort is.

use super::point::{At, Point};
use crate::bond::causality::Causality;
use crate::bond::elaborate::unit_of;
use crate::bond::equations::slopes::{By, Slopes, Stands, slopes};
use crate::bond::equations::{
    Equations, Input as Speaks, Origin, Unknown, named_equations, unknown_name,
};
use crate::bond::graph::{
    BondGraph, BondId, End, Expr, Law, Leaf, Observation, Power, SignalOrigin, Storage, VertexId,
};
use crate::bond::prepared::named;
use crate::diagnostic::Diagnostic;
use crate::expr::{Node, NodeId, Program, Unary};
use crate::linear::{Pattern, maximum_matching};
use crate::source::Span;

/// A linear model.
#[derive(Clone, Debug)]
pub struct Linear {
    /// The model's name.
    pub name: String,
    /// Where it was linearised.
    pub at: At,
    /// The time of that point, seconds.
    pub time: f64,
    /// The unknowns y; those that have a rate come first.
    pub unknowns: Vec<Quantity>,
    /// What they are in the graph; a circuit has none, and nothing of `gives`, `origins` and `slopes`.
    pub kinds: Vec<Unknown>,
    /// Number of unknowns that have a rate.
    pub states: usize,
    /// By row: whether it holds y' of the unknown of its number. Rows of imposed unknowns do not.
    pub rated: Vec<bool>,
    /// A by rows: (column, entry).
    pub rows: Vec<Vec<(u32, Entry)>>,
    /// By row: the unknown that it determines, as causality has it.
    pub gives: Vec<u32>,
    /// Where each row comes from.
    pub origins: Vec<Origin>,
    /// What imposes: each with its column of B.
    pub inputs: Vec<Channel>,
    /// What is read: each with its row of C; `direct` is its row of D.
    pub outputs: Vec<Channel>,
    /// By output, then input: entries of D that are not 0.
    pub direct: Vec<Vec<(u32, Entry)>>,
    /// The operations that entries come from, and the values of their inputs.
    pub slopes: Slopes,
    /// Values of the inputs of `slopes` at the point.
    pub values: Vec<f64>,
}

/// A named value at the point.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// In the words of the graph: `p(coil)`.
    pub name: String,
    /// Its unit, SI; empty when it is not known.
    pub unit: String,
    /// Its value at the point.
    pub value: f64,
}

/// An entry of a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Its value.
    pub value: f64,
    /// The operation that gives it, times `value` of 1; `None` for a number.
    pub node: Option<NodeId>,
}

impl Entry {
    /// A number.
    pub fn number(value: f64) -> Entry {
        Entry { value, node: None }
    }
}

/// An input or output.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// Its unit; SI without one.
    pub unit: String,
    /// How many SI units that is.
    pub factor: f64,
    /// Its column of B, or row of C, in SI.
    pub entries: Vec<(u32, Entry)>,
    /// The unknown that it is, where it is one.
    pub unknown: Option<u32>,
}

/// Linearises a model. `inputs` are variables to impose, the model's own inputs and sources where there are none; outputs are
/// what the graph observes.
pub fn linearise(
    graph: &BondGraph,
    causality: &Causality,
    point: &Point,
    inputs: Option<&[Observation]>,
    d: &mut Vec<Diagnostic>,
) -> Option<Linear> {
    let mut equations = named_equations(graph);
    for memory in &equations.memories {
        if let Some(content) = equations.content(memory) {
            content.set(point.y[memory.unknown]);
        }
    }
    let observed: Vec<_> = graph
        .experiment
        .observe
        .iter()
        .map(|item| equations.lower(graph, &item.expr, None))
        .collect();
    let structure = &point.prepared.structure;
    let idle = structure.idle.iter().map(|(row, _)| *row);
    let pins: Vec<(usize, usize)> = idle.zip(structure.undetermined.iter().copied()).collect();
    let slopes = slopes(&equations, &pins, &observed);
    let values = slopes.inputs(graph, &equations, point.times, &point.y);
    let n = equations.unknowns.len();
    let origin = |row: usize| match row.checked_sub(equations.states) {
        Some(row) => equations.origins[row],
        None => equations.state_origins[row],
    };
    let origins: Vec<Origin> = (0..n).map(origin).collect();
    let numbers = evaluate(&slopes, &values);
    let all = finite(graph, &slopes, &numbers, &origins, d)?;
    let (mut rows, mut by_wave) = (vec![vec![]; all.len()], vec![vec![]; equations.waves.len()]);
    for (row, entries) in all.iter().enumerate() {
        for (by, entry) in entries {
            match by {
                By::Unknown(k) => rows[row].push((*k, *entry)),
                By::Wave(k) => by_wave[*k as usize].push((row as u32, *entry)),
            }
        }
    }
    let readings = rows.split_off(n);
    let outputs = graph.experiment.observe.iter().zip(readings).map(|(item, entries)| {
        let unknown = match entries.as_slice() {
            [(k, Entry { value: 1.0, .. })] => Some(*k),
            _ => None,
        };
        let unit = if item.unit.0.is_empty() { item.si_unit.clone() } else { item.unit.0.clone() };
        Channel { name: item.name.clone(), unit, factor: item.unit.1, entries, unknown }
    });
    let mut linear = Linear {
        name: graph.name.clone(),
        at: point.at,
        time: point.times[0],
        unknowns: quantities(graph, &equations, &point.y),
        kinds: equations.unknowns.clone(),
        states: equations.states,
        rated: (0..n).map(|row| row < equations.states).collect(),
        gives: orient(graph, causality, &equations, &rows, &origins),
        rows,
        origins,
        inputs: vec![],
        outputs: outputs.collect(),
        direct: vec![],
        slopes,
        values,
    };
    let imposed = match inputs {
        Some(items) => items.iter().map(|item| imposed(&equations, item, d)).collect(),
        None => Some(own_inputs(graph, &equations)),
    }?;
    linear.direct = vec![vec![]; linear.outputs.len()];
    for (what, mut channel) in imposed {
        let number = linear.inputs.len() as u32;
        match what {
            What::Unknown(k, sign) => {
                channel.unknown = Some(k);
                channel.entries = vec![(linear.impose(k), Entry::number(-sign))];
            }
            What::Wave(k) => {
                for (row, entry) in by_wave[k as usize].drain(..) {
                    match (row as usize).checked_sub(n) {
                        None => channel.entries.push((row, entry)),
                        Some(output) => linear.direct[output].push((number, entry)),
                    }
                }
            }
        }
        linear.inputs.push(channel);
    }
    Some(linear)
}

impl Linear {
    /// Gives an unknown's row away: it becomes y = …, and the row's number is told.
    fn impose(&mut self, unknown: u32) -> u32 {
        let row = self.gives.iter().position(|given| *given == unknown).unwrap_or(unknown as usize);
        self.rows[row] = vec![(unknown, Entry::number(1.0))];
        self.rated[row] = false;
        row as u32
    }

    /// Entries of −A and E as (row, column, value): the pencil s·E − A.
    pub fn pencil(&self) -> [Vec<(u32, u32, f64)>; 2] {
        let rows = self.rows.iter().zip(0u32..);
        let fixed = rows.flat_map(|(row, i)| row.iter().map(move |(j, a)| (i, *j, -a.value)));
        let rated = self.rated.iter().zip(0u32..).filter(|(rated, _)| **rated);
        [fixed.collect(), rated.map(|(_, k)| (k, k, 1.0)).collect()]
    }

    /// Gives parameters other values, each a random factor between 0.7 and 1.3 of its own, and follows with all entries.
    pub fn vary(&mut self, random: &mut dyn FnMut() -> f64) {
        for (k, value) in self.values.iter_mut().enumerate() {
            if matches!(self.slopes.stands(k as u32), Stands::For(Speaks::Parameter(_))) {
                *value *= 0.7 + 0.6 * random();
            }
        }
        let mut entries: Vec<&mut Entry> =
            self.rows.iter_mut().flatten().map(|(_, entry)| entry).collect();
        let channels = self.inputs.iter_mut().chain(&mut self.outputs);
        entries.extend(channels.flat_map(|channel| &mut channel.entries).map(|(_, entry)| entry));
        entries.extend(self.direct.iter_mut().flatten().map(|(_, entry)| entry));
        let nodes: Vec<NodeId> = entries.iter().filter_map(|entry| entry.node).collect();
        let program = Program::compile(&self.slopes.dag, &nodes);
        let mut registers = program.registers();
        program.run(&self.values, &mut registers);
        let changed = entries.into_iter().filter(|entry| entry.node.is_some());
        changed.zip(program.outputs(&registers)).for_each(|(entry, value)| entry.value = value);
    }

    /// Whether an unknown is what a storage holds or a signal integrates.
    pub fn stores(&self, unknown: usize) -> bool {
        unknown < self.states && self.rated[unknown]
    }
}

/// The values of all partial derivatives.
fn evaluate(slopes: &Slopes, values: &[f64]) -> Vec<f64> {
    let nodes: Vec<NodeId> = slopes.rows.iter().flatten().map(|(_, node)| *node).collect();
    let program = Program::compile(&slopes.dag, &nodes);
    let mut registers = program.registers();
    program.run(values, &mut registers);
    program.outputs(&registers).collect()
}

/// The entries that are not 0; an error where a law has no slope.
fn finite(
    graph: &BondGraph,
    slopes: &Slopes,
    numbers: &[f64],
    origins: &[Origin],
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<Vec<(By, Entry)>>> {
    let mut numbers = numbers.iter();
    let mut all = vec![];
    for (row, partials) in slopes.rows.iter().enumerate() {
        let mut entries = vec![];
        for (by, node) in partials {
            let value = *numbers.next()?;
            if !value.is_finite() {
                let (name, span) = match origins.get(row) {
                    Some(origin) => named(graph, *origin),
                    None => ("an output".to_string(), Span::NONE),
                };
                d.push(
                    Diagnostic::error("E0928", span, format!("the law of {name} has no slope here"))
                        .says(format!("its slope is {value}"))
                        .help("linearise where it has one: `--at 1s` takes that time of a run, `--at rest` the place where all comes to rest"),
                );
                return None;
            }
            if value != 0.0 {
                entries.push((*by, Entry { value, node: Some(*node) }));
            }
        }
        all.push(entries);
    }
    Some(all)
}

/// Names, units and values of the unknowns.
fn quantities(graph: &BondGraph, equations: &Equations, y: &[f64]) -> Vec<Quantity> {
    let bond = |bond, variable| Leaf::Bond { bond, variable, negated: false };
    let unit = |unknown: Unknown| {
        let leaf = match unknown {
            Unknown::Stored(end) => Leaf::Stored(end),
            Unknown::Signal(id) => Leaf::Signal(id),
            Unknown::Effort(id) => bond(id, Power::Effort),
            Unknown::Flow(id) => bond(id, Power::Flow),
            Unknown::Rated(id) => {
                let end = End::only(id);
                let Some(own) = graph.bond_at(end) else { return String::new() };
                let inertia = graph.storage(end) == Some(Storage::Inertia);
                bond(own, if inertia { Power::Flow } else { Power::Effort })
            }
        };
        unit_of(graph, &Expr::leaf(leaf))
    };
    let named = equations.unknowns.iter().zip(y);
    let quantity = |(unknown, value): (&Unknown, &f64)| Quantity {
        name: unknown_name(graph, *unknown),
        unit: unit(*unknown),
        value: *value,
    };
    named.map(quantity).collect()
}

/// What an input is.
enum What {
    /// An unknown, with the sign that its bond's variable has.
    Unknown(u32, f64),
    /// A function of time.
    Wave(u32),
}

fn channel(name: String, unit: String, factor: f64) -> Channel {
    Channel { name, unit, factor, entries: vec![], unknown: None }
}

/// The model's `input`s, then its sources whose values nothing of the model modulates.
fn own_inputs(graph: &BondGraph, equations: &Equations) -> Vec<(What, Channel)> {
    let mut found = vec![];
    let mut driven = vec![];
    for (signal, id) in graph.signals.iter().zip((0..).map(crate::bond::graph::SignalId)) {
        if signal.origin != SignalOrigin::Input || signal.home != 0 || signal.name.contains('.') {
            continue;
        }
        let what = match equations.signal(id) {
            Some(Speaks::Unknown(k)) => What::Unknown(k, 1.0),
            Some(Speaks::Wave(k)) => What::Wave(k),
            _ => continue,
        };
        driven.push(id);
        let unit = unit_of(graph, &Expr::leaf(Leaf::Signal(id)));
        found.push((what, channel(signal.name.clone(), unit, 1.0)));
    }
    for vertex in &graph.vertices {
        let Law::Source { sets, value, detector: false } = &vertex.law else { continue };
        let [bond] = vertex.bonds[..] else { continue };
        let mut own = true;
        value.leaves(&mut |leaf, _| {
            own &= match leaf {
                Leaf::Parameter(_) | Leaf::Time => true,
                Leaf::Signal(id) => graph.signals[id.index()].origin == SignalOrigin::Hidden,
                _ => false,
            }
        });
        if !own {
            continue;
        }
        let letter = if *sets == Power::Effort { "e" } else { "f" };
        let leaf = Leaf::Bond { bond, variable: *sets, negated: false };
        let unit = unit_of(graph, &Expr::leaf(leaf));
        let what = What::Unknown(equations.power(bond, *sets) as u32, 1.0);
        found.push((what, channel(format!("{letter}({})", vertex.name), unit, 1.0)));
    }
    found
}

/// What a variable to impose is in the equations.
fn imposed(
    equations: &Equations,
    item: &Observation,
    d: &mut Vec<Diagnostic>,
) -> Option<(What, Channel)> {
    let (inner, mut sign) = match &*item.expr.node {
        Node::Unary(Unary::Negate, inner) => (inner, -1.0),
        _ => (&item.expr, 1.0),
    };
    let what = match &*inner.node {
        Node::Leaf(Leaf::Signal(id)) => match equations.signal(*id) {
            Some(Speaks::Unknown(k)) => Some(What::Unknown(k, sign)),
            Some(Speaks::Wave(k)) => Some(What::Wave(k)),
            _ => None,
        },
        Node::Leaf(Leaf::Bond { bond, variable, negated }) => {
            if *negated {
                sign = -sign;
            }
            Some(What::Unknown(equations.power(*bond, *variable) as u32, sign))
        }
        Node::Leaf(Leaf::Stored(end)) => {
            equations.stored(*end).map(|k| What::Unknown(k as u32, sign))
        }
        _ => None,
    };
    let Some(what) = what else {
        let message = format!("`{}` is nothing that could be imposed", item.name);
        d.push(Diagnostic::error("E0929", Span::NONE, message).help(
            "name an input, a signal, or a reading: e(x), f(x), q(x), p(x); `bondspice simulate --list` shows them",
        ));
        return None;
    };
    let unit = if item.unit.0.is_empty() { item.si_unit.clone() } else { item.unit.0.clone() };
    Some((what, channel(item.name.clone(), unit, item.unit.1)))
}

/// By row the unknown that it determines. Elements give what causality has them give, and what they store; signals give
/// themselves. Where that pairs not all of them, any pairing does.
fn orient(
    graph: &BondGraph,
    causality: &Causality,
    equations: &Equations,
    rows: &[Vec<(u32, Entry)>],
    origins: &[Origin],
) -> Vec<u32> {
    let ends = |bond: BondId, vertex: VertexId| {
        let bond = graph.bond(bond);
        [bond.from, bond.to].into_iter().filter(move |end| end.vertex == vertex)
    };
    let gives = |origin: Origin, unknown: Unknown| match (origin, unknown) {
        (Origin::Vertex(id), Unknown::Effort(bond)) => {
            ends(bond, id).any(|end| causality.receives_effort(graph, bond, end) != Some(true))
        }
        (Origin::Vertex(id), Unknown::Flow(bond)) => {
            ends(bond, id).any(|end| causality.receives_effort(graph, bond, end) != Some(false))
        }
        (Origin::Vertex(id), Unknown::Stored(end)) => end.vertex == id,
        (Origin::Vertex(id), Unknown::Rated(own)) => own == id,
        (Origin::Signal(id), Unknown::Signal(own)) => own == id,
        _ => false,
    };
    let n = rows.len();
    let pair = |all: bool| {
        let mut places = vec![];
        for (row, entries) in rows.iter().enumerate() {
            let own = (row < equations.states).then_some(row as u32);
            let columns = entries.iter().map(|(column, _)| *column).chain(own);
            for column in columns {
                if all || gives(origins[row], equations.unknowns[column as usize]) {
                    places.push((row as u32, column));
                }
            }
        }
        let (pattern, _) = Pattern::from_triplets(n, &places);
        maximum_matching(&pattern, |_| true)
    };
    let mut matching = pair(false);
    if !matching.is_perfect() {
        matching = pair(true);
    }
    (0..n).map(|row| matching.column_of[row].min(n as u32 - 1)).collect()
}
