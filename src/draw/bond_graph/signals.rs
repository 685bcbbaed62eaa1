//! The signals of a graph: blocks with arrows between them, what of the graph they read, and what follows them.
//!
//! Signals carry no power. In the bond graph itself only short arrows say where they come in and where something is
//! measured; the blocks stand below it. Signals that elaboration made are told within the laws of those that the file
//! names, `∫` for the state of one; so are those of instances that are drawn as one node, and those by which instances hand
//! on what others are.

use super::super::text::cut;
use crate::bond::graph::{
    BondGraph, BondId, End, Expr, Law, Leaf, Memory, Power, Signal, SignalId, SignalLaw,
    SignalOrigin, Storage, VertexId, Waveform,
};
use crate::bond::words;
use crate::expr::print::print;
use crate::expr::{Dialect, Node};

/// More blocks than this are not laid out.
pub const MOST: usize = 48;
/// Letters of a law that are shown.
const SHOWN: usize = 34;
/// So many laws are told one within the other.
const DEEP: usize = 3;

/// What a block is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// A signal or input.
    Signal,
    /// A variable of the bond graph that signals read.
    Measured,
    /// An element that follows signals.
    Follower,
}

/// A block, or what stands at the ends of the chains of blocks.
#[derive(Clone, Debug)]
pub struct Block {
    /// Its name.
    pub title: String,
    /// What it does, short.
    pub law: String,
    /// All of it, where a pointer rests.
    pub told: String,
    /// What it is.
    pub kind: BlockKind,
}

/// A short arrow at a node of the bond graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// The node.
    pub node: usize,
    /// What comes in or is measured.
    pub text: String,
    /// Whether it comes in.
    pub into: bool,
}

/// The signals of a graph.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// Blocks and ends.
    pub blocks: Vec<Block>,
    /// From block to block.
    pub arrows: Vec<(usize, usize)>,
    /// Arrows in the bond graph.
    pub taps: Vec<Tap>,
    /// Named signals, where they are too many for blocks.
    pub left_out: usize,
}

struct Reader<'a> {
    graph: &'a BondGraph,
    /// By signal: whether it has a block.
    shown: Vec<bool>,
}

/// What an expression reads: blocks of signals, and variables of the graph.
#[derive(Default)]
struct Reads {
    signals: Vec<SignalId>,
    variables: Vec<(VertexId, String)>,
    seen: Vec<SignalId>,
}

/// Reads the signals. `closed` says by instance whether it is drawn as one node, `node_of` the node of each vertex.
pub fn read(
    graph: &BondGraph,
    closed: &[bool],
    node_of: &[usize],
    title: &dyn Fn(usize) -> String,
) -> Signals {
    let is_closed = |instance: usize| closed.get(instance).copied().unwrap_or(false);
    let shown = graph.signals.iter().map(|signal| {
        signal.origin != SignalOrigin::Hidden
            && !is_closed(signal.home as usize)
            && !is_alias(signal)
    });
    let mut reader = Reader { graph, shown: shown.collect() };
    // The inputs of an instance that is one node are what comes in there.
    for (_, instance) in graph.tree.iter().enumerate().filter(|(k, _)| is_closed(*k)) {
        instance.inputs.iter().for_each(|input| reader.shown[input.index()] = false);
    }
    let mut found = Signals::default();
    let mut block_of = vec![None; graph.signals.len()];
    for (k, signal) in graph.signals.iter().enumerate().filter(|(k, _)| reader.shown[*k]) {
        block_of[k] = Some(found.blocks.len());
        found.blocks.push(Block {
            title: signal.name.clone(),
            law: cut(&reader.short(SignalId(k as u32)), SHOWN),
            told: format!("{} = {}", signal.name, words::signal_law(graph, &signal.law)),
            kind: BlockKind::Signal,
        });
    }
    if found.blocks.len() > MOST {
        found.left_out = found.blocks.len();
        found.blocks.clear();
    }
    let drawn = found.left_out == 0;
    // At a part of an instance its name goes without saying.
    let homes = graph.homes();
    let inside = |vertex: VertexId, text: &str| {
        let home = graph.tree.get(homes.of(&graph.vertex(vertex).name) as usize);
        match home.map(|home| home.name.as_str()) {
            None | Some("") => text.to_string(),
            Some(home) => text.replace(&format!("{home}."), ""),
        }
    };
    // What each signal reads.
    for (k, block) in block_of.iter().enumerate().filter_map(|(k, b)| Some((k, (*b)?))) {
        let mut reads = Reads { seen: vec![SignalId(k as u32)], ..Reads::default() };
        if let Some(expr) = graph.signals[k].law.expression() {
            reader.follow(expr, &mut reads);
        }
        for signal in &reads.signals {
            if let (true, Some(from)) = (drawn, block_of[signal.index()]) {
                found.arrow(from, block);
            }
        }
        for (vertex, text) in &reads.variables {
            found.tap(node_of[vertex.index()], &inside(*vertex, text), false);
            if drawn {
                let from = found.end(text, BlockKind::Measured);
                found.arrow(from, block);
            }
        }
    }
    // What follows signals, or variables of other elements.
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let mut reads = Reads::default();
        vertex.law.expressions(&mut |expr| reader.follow(expr, &mut reads));
        let node = node_of[id.index()];
        for signal in &reads.signals {
            found.tap(node, &inside(id, &graph.signals[signal.index()].name), true);
            if let (true, Some(from)) = (drawn, block_of[signal.index()]) {
                let name = match is_closed(homes.of(&vertex.name) as usize) {
                    true => title(node),
                    false => format!("{}: {}", vertex.kind, vertex.name),
                };
                let to = found.end(&name, BlockKind::Follower);
                found.arrow(from, to);
            }
        }
        // A field's own ports are no measurement, nor is what stays within one node.
        let measured = |(other, _): &&(VertexId, String)| {
            !touches(graph, *other, id) && node_of[other.index()] != node
        };
        for (other, text) in reads.variables.iter().filter(measured) {
            found.tap(node, &inside(id, text), true);
            found.tap(node_of[other.index()], &inside(*other, text), false);
        }
    }
    found
}

/// Whether a signal of an instance only hands on another one, or a variable of the graph.
fn is_alias(signal: &Signal) -> bool {
    let SignalLaw::Algebraic(expr) = &signal.law else { return false };
    let of_instance = signal.home != 0 || signal.name.contains('.');
    of_instance && matches!(&*expr.node, Node::Leaf(Leaf::Signal(_) | Leaf::Bond { .. }))
}

/// Whether two are one, or share a bond.
fn touches(graph: &BondGraph, a: VertexId, b: VertexId) -> bool {
    a == b || graph.vertex(a).bonds.iter().any(|bond| graph.vertex(b).bonds.contains(bond))
}

impl Signals {
    fn arrow(&mut self, from: usize, to: usize) {
        if from != to && !self.arrows.contains(&(from, to)) {
            self.arrows.push((from, to));
        }
    }

    /// The end of a name, made where there is none.
    fn end(&mut self, title: &str, kind: BlockKind) -> usize {
        let same = |block: &Block| block.kind == kind && block.title == title;
        if let Some(at) = self.blocks.iter().position(same) {
            return at;
        }
        let (title, law, told) = (title.to_string(), String::new(), String::new());
        self.blocks.push(Block { title, law, told, kind });
        self.blocks.len() - 1
    }

    fn tap(&mut self, node: usize, text: &str, into: bool) {
        match self.taps.iter_mut().find(|tap| tap.node == node && tap.into == into) {
            Some(tap) if tap.text.split(", ").any(|other| other == text) => {}
            Some(tap) => tap.text += &format!(", {text}"),
            None => self.taps.push(Tap { node, text: text.to_string(), into }),
        }
    }
}

impl Reader<'_> {
    /// What an expression reads, through signals that have no blocks.
    fn follow(&self, expr: &Expr, reads: &mut Reads) {
        let mut next = vec![];
        expr.leaves(&mut |leaf, _| match leaf {
            Leaf::Signal(id) if reads.seen.contains(id) => {}
            Leaf::Signal(id) => {
                reads.seen.push(*id);
                if self.shown[id.index()] {
                    reads.signals.push(*id);
                } else {
                    next.push(*id);
                }
            }
            Leaf::Bond { bond, variable, .. } => {
                let read = self.measured(*bond, *variable);
                if !reads.variables.contains(&read) {
                    reads.variables.push(read);
                }
            }
            Leaf::Stored(end) => {
                let read = (end.vertex, self.stored(*end));
                if !reads.variables.contains(&read) {
                    reads.variables.push(read);
                }
            }
            _ => {}
        });
        for id in next {
            if let Some(expr) = self.graph.signals[id.index()].law.expression() {
                self.follow(expr, reads);
            }
        }
    }

    /// Where a variable of a bond is measured as one says it: the flow of a 1-junction, the effort of a 0-junction.
    fn measured(&self, bond: BondId, variable: Power) -> (VertexId, String) {
        let graph = self.graph;
        let (from, to) = (graph.bond(bond).from.vertex, graph.bond(bond).to.vertex);
        let common = |id: &VertexId| match graph.vertex(*id).law {
            Law::Zero => variable == Power::Effort,
            Law::One => variable == Power::Flow,
            _ => false,
        };
        let plain = |id: &VertexId| !matches!(graph.vertex(*id).law, Law::Zero | Law::One);
        let ends = [from, to];
        let at = ends.iter().find(|id| common(id)).or(ends.iter().find(|id| plain(id)));
        let at = at.copied().unwrap_or(from);
        (at, format!("{}({})", words::letter(variable), graph.vertex(at).name))
    }

    fn stored(&self, end: End) -> String {
        let letter = match self.graph.storage(end) {
            Some(Storage::Compliance) => "q",
            _ => "p",
        };
        format!("{letter}({})", self.graph.port_name(end))
    }

    /// What a signal does in a few letters, in the words of the instance that it stands in.
    fn short(&self, id: SignalId) -> String {
        let graph = self.graph;
        let text = match graph.regulators.iter().find(|regulator| regulator.signal == id) {
            Some(regulator) if regulator.gains.is_some() => {
                let [of, wanted] = [&regulator.controlled, &regulator.reference];
                format!("PI of {} - {}", self.text(wanted, id, 0), self.text(of, id, 0))
            }
            _ => self.law(id, id, 0),
        };
        // Constants have been put in for what they are.
        let text = text.replace("3.141592653589793", "pi");
        let home = graph.tree.get(graph.signals[id.index()].home as usize);
        match home.map(|home| home.name.as_str()) {
            None | Some("") => text,
            Some(home) => text.replace(&format!("{home}."), ""),
        }
    }

    fn law(&self, id: SignalId, own: SignalId, depth: usize) -> String {
        let text = |expr: &Expr| self.text(expr, own, depth);
        match &self.graph.signals[id.index()].law {
            SignalLaw::Algebraic(_) if self.graph.experiment.undriven.contains(&id) => {
                "input".into()
            }
            SignalLaw::Algebraic(expr) => text(expr),
            SignalLaw::Integrator { rate, .. } => format!("∫ {}", text(rate)),
            SignalLaw::Memory { kind, input } => match kind {
                Memory::Hysteresis { .. } => format!("hysteresis({})", text(input)),
                Memory::Sample { period } => format!("sample({}, {})", text(input), text(period)),
                Memory::Delay { by } => format!("delay({}, {})", text(input), text(by)),
            },
            SignalLaw::Waveform(waveform) => match waveform {
                Waveform::Step { .. } => "step(t)",
                Waveform::Ramp { .. } => "ramp(t)",
                Waveform::Pulse { .. } => "pulse(t)",
                Waveform::Sine { .. } => "sine(t)",
                Waveform::Pwl(_) => "pwl(t)",
                Waveform::Noise { .. } => "noise(t)",
            }
            .into(),
        }
    }

    fn text(&self, expr: &Expr, own: SignalId, depth: usize) -> String {
        print(expr, Dialect::Bond, &mut |leaf| match leaf {
            Leaf::Parameter(id) => self.graph.parameters[id.index()].name.clone(),
            Leaf::Signal(id) if self.shown[id.index()] || *id == own => {
                self.graph.signals[id.index()].name.clone()
            }
            Leaf::Signal(id) => match self.graph.signals[id.index()].law {
                SignalLaw::Integrator { .. } => "∫".into(),
                _ if depth >= DEEP => "…".into(),
                _ => {
                    let inner = self.law(*id, own, depth + 1);
                    // A sum within a product keeps its sense.
                    let plain = inner.ends_with(')') || !inner.contains(['+', '-', '*', '/', ' ']);
                    if plain { inner } else { format!("({inner})") }
                }
            },
            Leaf::Time => "t".into(),
            Leaf::Own(_) => "…".into(),
            Leaf::Bond { bond, variable, negated } => {
                let (_, reading) = self.measured(*bond, *variable);
                if *negated { format!("(-{reading})") } else { reading }
            }
            Leaf::Stored(end) => self.stored(*end),
        })
    }
}
