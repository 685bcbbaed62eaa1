//! From a bond graph to a circuit: the netlist that an engineer would have drawn, and the map between the two.
//!
//! Effort becomes voltage, flow current. A bond's end at an element is a port of two terminals, + and −: the voltage
//! between them is the bond's effort, the current into + the flow into the element. The steps, a file each:
//!
//! 1. `forms`: which devices stand for each element;
//! 2. `islands`: what hangs together when only TF and GY separate;
//! 3. `flows`: where each flow can be read, and 0 V sources where one is needed and nothing carries it;
//! 4. the nodes between which everything stands: `series_parallel` draws trees of junctions, `couplers` closes loops,
//!    by wires, by the graph that [`graphic`] finds for the flows of an island (`space`, drawn by `realise`), or by
//!    1:1 couplers where there is none;
//! 5. `elements`, `signals`, `experiment`: the cards;
//! 6. [`map`]: every effort, flow, state and signal in terms of the circuit;
//! 7. [`hierarchy`]: the same circuit with its instances as subcircuits.

mod names;
mod forest;
pub mod graphic;
mod forms;
mod islands;
mod flows;
mod series_parallel;
mod space;
mod couplers;
mod realise;
pub mod forced;
mod values;
mod elements;
mod signals;
mod experiment;
pub mod map;
pub mod hierarchy;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod loop_tests;

pub use experiment::portable;
pub use map::{Figures, Map};

use crate::bond::causality::Causality;
use crate::bond::graph::{BondGraph, End, VertexId};
use crate::bond::initial::InitialState;
use crate::diagnostic::Diagnostic;
use crate::netlist::{Card, CardKind, Device, Element, Name, Netlist};
use crate::source::{SourceMap, Span};
use flows::Flows;
use forms::{Form, Integrator, Uses};
use islands::Island;
use names::{Namer, Wish};
use series_parallel::{Drawing, Fit, Pair, Point};
use std::collections::{HashMap, HashSet};

/// What translation makes of a bond graph.
#[derive(Clone, Debug)]
pub struct Translation {
    /// The circuit.
    pub netlist: Netlist,
    /// Which circuit variable is which effort, flow, state, signal.
    pub map: Map,
    /// How much circuit it took.
    pub figures: Figures,
    /// Which card stands for which part of the graph.
    pub origins: Origins,
}

/// Where the cards of a translation come from.
#[derive(Clone, Debug, Default)]
pub struct Origins {
    /// By card.
    pub marks: Vec<Mark>,
    /// What nodes are called after.
    pub nodes: HashMap<Name, Wish>,
    /// What devices are called after.
    pub devices: HashMap<Name, Wish>,
    /// By bond: the + and − nodes of its tail and of its head, where it has such.
    pub pairs: Vec<[Option<[Name; 2]>; 2]>,
    /// The nodes of junctions and elements; all others are signals'.
    pub power: HashSet<Name>,
    /// By signal: its node, where it has one.
    pub signals: Vec<Option<Name>>,
}

/// Which part of the graph a card stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// The instance in whose words it is written: an index into [`BondGraph::tree`].
    pub home: u32,
    /// Elements by index and port, then signals: the order of the file, whatever the drawing's.
    pub order: (u32, u32, u32),
}

/// Turns a bond graph into a circuit. `None` when there were errors.
pub fn translate(
    graph: &BondGraph,
    causality: &Causality,
    initial: &InitialState,
    source: &SourceMap,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Translation> {
    let mut namer = Namer::default();
    let uses = Uses::count(graph);
    let parameters = graph.parameters.iter().map(|p| namer.parameter(&p.name)).collect();
    // Junctions of common effort are nodes: their names go first, then those of signals.
    let junctions = graph
        .vertices
        .iter()
        .map(|v| matches!(v.law, crate::bond::graph::Law::Zero).then(|| namer.node(&v.name)))
        .collect();
    let signals: Vec<Name> = graph.signals.iter().map(|s| namer.node(&s.name)).collect();
    let forms = forms::choose(graph, causality, &uses, &mut namer);
    let islands = islands::find(graph);
    let flows = Flows::plan(graph, &forms, &mut namer);
    let drawing = Drawing::draw(graph, &islands, &flows.senses);
    let homes = graph.homes();
    let mut builder = Builder {
        homes: graph.vertices.iter().map(|vertex| homes.of(&vertex.name)).collect(),
        graph,
        initial,
        source,
        signal_places: signals::places(graph, &forms, &signals),
        counters: elements::counters(graph, &forms, &mut namer),
        namer,
        uses,
        parameters,
        forms,
        islands,
        flows,
        drawing,
        points: Vec::new(),
        cards: Vec::new(),
        links: Vec::new(),
        jumps: Vec::new(),
        samples: Vec::new(),
        rounds: Vec::new(),
        couplers: 0,
        mark: Mark::default(),
        marks: Vec::new(),
    };
    builder.points = builder.name_points(junctions);
    let before = diagnostics.len();
    builder.check(diagnostics);
    noise_lengths(graph, diagnostics);
    builder.parameter_cards();
    builder.island_cards(diagnostics);
    builder.coupling_cards();
    builder.signal_cards(diagnostics);
    let map = builder.map();
    let header = builder.experiment_cards(diagnostics);
    if crate::diagnostic::has_errors(&diagnostics[before..]) {
        return None;
    }
    let figures = map.figures;
    builder.mark(Mark::default());
    let ends = graph.bond_ids().map(|bond| builder.drawing.ends[bond.index()]);
    let pairs = ends.map(|ends| ends.map(|pair| Some(builder.nodes(pair?)))).collect();
    let power = builder.points.iter().copied().filter(|node| *node != builder.ground()).collect();
    let place = |place: &signals::Place| match place {
        signals::Place::Node(node) => Some(*node),
        signals::Place::Source(_) => None,
    };
    let origins = Origins {
        marks: std::mem::take(&mut builder.marks),
        nodes: std::mem::take(&mut builder.namer.node_wishes),
        devices: std::mem::take(&mut builder.namer.device_wishes),
        pairs,
        power,
        signals: builder.signal_places.iter().map(place).collect(),
    };
    let netlist = Netlist {
        title: format!("{}: the circuit of a bond graph", graph.name),
        names: builder.namer.names,
        header: header.pairs(),
        cards: builder.cards,
        ..Netlist::default()
    };
    Some(Translation { netlist, map, figures, origins })
}

/// What the steps share.
struct Builder<'a> {
    graph: &'a BondGraph,
    initial: &'a InitialState,
    source: &'a SourceMap,
    namer: Namer,
    /// By vertex: the instance that it stands in.
    homes: Vec<u32>,
    uses: Uses,
    parameters: Vec<Name>,
    signal_places: Vec<signals::Place>,
    /// By vertex in rate form whose q or p is spoken of: the integrator that counts it.
    counters: Vec<Option<Integrator>>,
    forms: Vec<Form>,
    islands: Vec<Island>,
    flows: Flows,
    drawing: Drawing,
    /// By point: the name of its node.
    points: Vec<Name>,
    cards: Vec<Card>,
    /// By card of an element, in order: card, element, bond.
    links: Vec<map::Link>,
    jumps: Vec<crate::netlist::header::Jumps>,
    samples: Vec<crate::netlist::header::Sample>,
    /// By signal: the round in which a memory takes its value.
    rounds: Vec<u32>,
    couplers: usize,
    /// That of the cards that are being added.
    mark: Mark,
    /// By card, as far as the mark has changed.
    marks: Vec<Mark>,
}

impl Builder<'_> {
    /// Names the nodes: junctions of common effort keep theirs, nodes within a series loop are numbered.
    fn name_points(&mut self, mut junctions: Vec<Option<Name>>) -> Vec<Name> {
        let count = self.drawing.wishes.len();
        let mut best: Vec<Option<(Fit, VertexId)>> = vec![None; count];
        for (point, wish) in self.drawing.wishes.iter().enumerate() {
            let slot = &mut best[self.drawing.points.root(point)];
            *slot = match (*slot, *wish) {
                (Some(old), Some(new)) if old.0 <= new.0 => Some(old),
                (old, new) => new.or(old),
            };
        }
        let ground = self.namer.names.intern("0");
        let mut names = vec![ground; count];
        for fit in [Fit::Exact, Fit::Inner] {
            for point in 1..count {
                let Some((_, vertex)) = best[point].filter(|(wished, _)| *wished == fit) else {
                    continue;
                };
                if self.drawing.points.root(point) == point {
                    let name = &self.graph.vertex(vertex).name;
                    names[point] = match junctions[vertex.index()].take() {
                        Some(name) => name,
                        None if fit == Fit::Exact => self.namer.node(name),
                        None => self.namer.inner_node(name),
                    };
                }
            }
        }
        (0..count).map(|point| names[self.drawing.points.root(point)]).collect()
    }

    /// Says which flow is needed and left undetermined by a ring of junctions. Rings themselves have been said by
    /// causality.
    fn check(&self, diagnostics: &mut Vec<Diagnostic>) {
        for item in self.drawing.items.iter().flatten() {
            if let series_parallel::Item::Sense { bond, plus, minus } = item
                && self.drawing.points.root(*plus) == self.drawing.points.root(*minus)
            {
                diagnostics.push(
                    Diagnostic::error(
                        "E0601",
                        self.graph.bond(*bond).span,
                        format!(
                            "the flow of {} is needed, and the junctions leave it undetermined",
                            self.graph.bond_name(*bond)
                        ),
                    )
                    .help("leave out a bond of the ring of junctions that this bond is part of"),
                );
            }
        }
    }

    /// Which part of the graph the cards from here on stand for.
    fn mark(&mut self, mark: Mark) {
        self.marks.resize(self.cards.len(), self.mark);
        self.mark = mark;
    }

    /// The names of a pair's nodes.
    fn nodes(&self, pair: Pair) -> [Name; 2] {
        [self.node(pair.plus), self.node(pair.minus)]
    }

    fn node(&self, point: Point) -> Name {
        self.points.get(point).copied().unwrap_or(Name(0))
    }

    /// The nodes of an element's port.
    fn port(&self, vertex: VertexId, port: usize) -> Option<[Name; 2]> {
        let bond = *self.graph.vertex(vertex).bonds.get(port)?;
        let pair = self.drawing.pair(self.graph, bond, End { vertex, port: port as u32 })?;
        Some(self.nodes(pair))
    }

    /// `eha.bg:46`.
    fn place(&self, span: Span) -> Option<String> {
        let file = &self.source.file(span.file)?.name;
        let file = file.rsplit(['/', '\\']).next().unwrap_or(file);
        Some(format!("{file}:{}", self.source.position(span)?.0))
    }

    fn comment(&mut self, text: impl Into<String>) {
        self.cards.push(Card {
            kind: CardKind::Comment(text.into()),
            span: Span::NONE,
            comment: None,
        });
    }

    /// Adds a device; its comment is the place in the bond graph and what stands there.
    fn device(&mut self, name: Name, nodes: [Name; 2], element: Element, span: Span, what: &str) {
        self.device_on(name, nodes.to_vec(), element, span, what);
    }

    /// The same for a device of any number of nodes.
    fn device_on(
        &mut self,
        name: Name,
        nodes: Vec<Name>,
        element: Element,
        span: Span,
        what: &str,
    ) {
        let comment = match self.place(span) {
            Some(place) => format!("{place} {what}"),
            None => what.to_string(),
        };
        self.cards.push(Card {
            kind: CardKind::Device(Device { name, nodes: nodes.into(), element }),
            span,
            comment: Some(comment),
        });
    }
}

/// More random numbers than this are no netlist.
pub(crate) const MOST_HELD: f64 = 1e5;

/// Refuses noise whose numbers, written out to the end of the run, would be too many.
fn noise_lengths(graph: &BondGraph, diagnostics: &mut Vec<Diagnostic>) {
    let until = graph.experiment.until.unwrap_or(1.0);
    for signal in &graph.signals {
        let crate::bond::graph::SignalLaw::Waveform(crate::bond::graph::Waveform::Noise {
            dt, ..
        }) = &signal.law
        else {
            continue;
        };
        let count = until / forms::constant_value(graph, dt).unwrap_or(f64::NAN);
        if count.is_nan() || count > MOST_HELD {
            let message =
                format!("`{}` holds {count:.0} random numbers until {until} s", signal.name);
            diagnostics.push(
                Diagnostic::error("E0603", signal.span, message)
                    .says("too many for a netlist")
                    .because(format!("a netlist writes each of them out, {MOST_HELD:.0} at most"))
                    .help("hold each number for longer (`dt`), or end the run earlier"),
            );
        }
    }
}
