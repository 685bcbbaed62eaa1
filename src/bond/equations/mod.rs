//! The bond graph's own equations: an effort and a flow for each bond, straight from the definitions of the elements.
//!
//! ```text
//! x' = g(x, z, t)        stored quantities, states of the rate form, integrators of signals
//! 0  = h(x, z, t)        z: e and f of every bond along its half arrow, algebraic signals
//! ```
//!
//! One row of h for each port: a junction of k bonds has k, a one-port 1, a two-port 2; so there are as many rows as
//! efforts and flows. No causality, no elimination, no circuit: ratios and gains stand as written and never divide.
//! Signs are those of [`graph`].

pub mod known;
pub mod compiled;
pub mod memory;
pub mod slopes;
pub mod waveform;

use super::graph::{
    self, BondGraph, BondId, Dissipation, End, Expr, Law, Leaf, Modulus, Power, SignalId,
    SignalLaw, Storage, StoreLaw, Variable, VertexId,
};
use crate::expr::{self, Binary, Function, Node};
use crate::source::Span;
pub use compiled::Compiled;
pub use known::Known;
use known::{held_corners, over_time_alone, resolve};
use memory::{Kind, Memory, Remembered};
pub use waveform::Wave;

/// An unknown; states come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unknown {
    /// q or p of a storage, at its port.
    Stored(End),
    /// e or f of a storage in rate form.
    Rated(VertexId),
    /// A signal that is an integrator, or an algebraic one.
    Signal(SignalId),
    /// The effort of a bond.
    Effort(BondId),
    /// The flow of a bond along its half arrow.
    Flow(BondId),
}

/// Where an equation comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Origin {
    /// The definition of a junction or an element.
    Vertex(VertexId),
    /// A signal's definition.
    Signal(SignalId),
}

/// What an equation speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Input {
    /// The unknown of an index.
    Unknown(u32),
    /// Time in seconds.
    Time,
    /// A function of time with corners, by its index in [`Equations::waves`].
    Wave(u32),
    /// The value of a condition that follows from the unknowns, by its index in [`Equations::conditions`].
    Condition(u32),
    /// A parameter of the graph, where equations keep their names.
    Parameter(u32),
}

/// An equation's right-hand side or residual.
pub type Formula = expr::Expr<Input>;

/// An operation whose value jumps where a − b changes its sign, or `floor(a)` its value.
#[derive(Clone, Debug)]
pub struct Condition {
    /// What it asks.
    pub question: Question,
    /// The values that it compares; b is 0 where there is one only.
    pub a: Formula,
    /// The other one.
    pub b: Formula,
    /// The element or signal in whose law it stands.
    pub span: Span,
}

/// What a condition asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// `a < b` and the like: 1 or 0.
    Compare(Binary),
    /// The sign of a.
    Sign,
    /// The largest whole number that is not above a.
    Floor,
}

/// The equations of a graph.
#[derive(Clone, Debug, Default)]
pub struct Equations {
    /// Unknowns, states first.
    pub unknowns: Vec<Unknown>,
    /// Number of states.
    pub states: usize,
    /// g, one for each state.
    pub rates: Vec<Formula>,
    /// Where each state's equation comes from.
    pub state_origins: Vec<Origin>,
    /// h, one for each other unknown.
    pub algebraic: Vec<Formula>,
    /// Where each row of h comes from.
    pub origins: Vec<Origin>,
    /// Functions of time.
    pub waves: Vec<Known>,
    /// What jumps with the unknowns.
    pub conditions: Vec<Condition>,
    /// Memories, by the round in which they take their values.
    pub memories: Vec<Remembered>,
    /// Whether parameters stand by their names; else they are numbers.
    named: bool,
    /// First index of the bonds' efforts; flows alternate with them.
    first_bond: usize,
    /// By signal: its unknown or its wave.
    signals: Vec<Option<Input>>,
    /// By vertex: the unknown of its stored quantity, of a field that of its first port; the others follow it.
    stored: Vec<Option<u32>>,
    /// By vertex: the unknown of its state in rate form.
    rated: Vec<Option<u32>>,
}

/// Beyond so many corners echoes of delays are no longer landed on.
const MOST_ECHOES: usize = 20_000;

/// The equations of a graph, from the definitions of its elements.
pub fn equations(graph: &BondGraph) -> Equations {
    written(graph, false)
}

/// The same equations with parameters by their names, for what is to be said in the words of the model.
pub fn named_equations(graph: &BondGraph) -> Equations {
    written(graph, true)
}

fn written(graph: &BondGraph, named: bool) -> Equations {
    let mut all = Equations {
        named,
        signals: vec![None; graph.signals.len()],
        stored: vec![None; graph.vertices.len()],
        rated: vec![None; graph.vertices.len()],
        ..Equations::default()
    };
    all.number(graph);
    for id in graph.vertex_ids() {
        all.element(graph, id);
    }
    for (i, signal) in graph.signals.iter().enumerate() {
        let id = SignalId(i as u32);
        match &signal.law {
            SignalLaw::Algebraic(value) => {
                let value = all.lower(graph, value, None);
                let own = all.leaf(all.signals[i]);
                all.row(Origin::Signal(id), own, value);
            }
            SignalLaw::Integrator { rate, .. } => {
                let rate = all.lower(graph, rate, None);
                if let Some(Input::Unknown(k)) = all.signals[i] {
                    all.rates[k as usize] = rate;
                }
            }
            SignalLaw::Waveform(_) | SignalLaw::Memory { .. } => {}
        }
    }
    all.remember(graph);
    all
}

impl Equations {
    /// Index of a bond's effort.
    pub fn effort(&self, bond: BondId) -> usize {
        self.first_bond + 2 * bond.index()
    }

    /// Index of a bond's flow.
    pub fn flow(&self, bond: BondId) -> usize {
        self.effort(bond) + 1
    }

    /// Index of a bond's power variable.
    pub fn power(&self, bond: BondId, variable: Power) -> usize {
        match variable {
            Power::Effort => self.effort(bond),
            Power::Flow => self.flow(bond),
        }
    }

    /// Index of a port's q or p, where it is an unknown.
    pub fn stored(&self, end: End) -> Option<usize> {
        self.stored[end.vertex.index()].map(|first| (first + end.port) as usize)
    }

    /// Index of the state of a storage in rate form.
    pub fn rated(&self, vertex: VertexId) -> Option<usize> {
        self.rated[vertex.index()].map(|k| k as usize)
    }

    /// A signal's unknown or wave.
    pub fn signal(&self, signal: SignalId) -> Option<Input> {
        self.signals[signal.index()]
    }

    /// Numbers the unknowns: storages, integrators, bonds, algebraic signals; waveforms are known.
    fn number(&mut self, graph: &BondGraph) {
        let mut read = vec![false; graph.vertices.len()];
        every_expression(graph, &mut |expr| {
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Stored(end) = leaf {
                    read[end.vertex.index()] = true;
                }
            });
        });
        for id in graph.vertex_ids() {
            let rate_form = matches!(graph.vertex(id).law, Law::Rate { .. });
            if rate_form {
                self.rated[id.index()] = Some(self.state(Unknown::Rated(id), Origin::Vertex(id)));
            }
            for end in graph.law_ports(id) {
                if graph.storage(end).is_some() && (!rate_form || read[id.index()]) {
                    let k = self.state(Unknown::Stored(end), Origin::Vertex(id));
                    self.stored[id.index()].get_or_insert(k);
                }
            }
        }
        for (i, signal) in graph.signals.iter().enumerate() {
            let id = SignalId(i as u32);
            self.signals[i] = match &signal.law {
                SignalLaw::Integrator { .. } => {
                    Some(Input::Unknown(self.state(Unknown::Signal(id), Origin::Signal(id))))
                }
                SignalLaw::Waveform(waveform) => {
                    self.waves.push(Known::Wave(resolve(graph, waveform)));
                    Some(Input::Wave(self.waves.len() as u32 - 1))
                }
                SignalLaw::Algebraic(_) | SignalLaw::Memory { .. } => None,
            };
        }
        self.states = self.unknowns.len();
        self.first_bond = self.states;
        for id in graph.bond_ids() {
            self.unknowns.extend([Unknown::Effort(id), Unknown::Flow(id)]);
        }
        for (i, signal) in graph.signals.iter().enumerate() {
            if matches!(signal.law, SignalLaw::Algebraic(_) | SignalLaw::Memory { .. }) {
                self.signals[i] = Some(Input::Unknown(self.unknowns.len() as u32));
                self.unknowns.push(Unknown::Signal(SignalId(i as u32)));
            }
        }
    }

    /// Memories are unknowns that equal what is remembered, so that what others delay of them is their past too.
    fn remember(&mut self, graph: &BondGraph) {
        let rounds = crate::bond::memory::rounds(graph);
        for (i, signal) in graph.signals.iter().enumerate() {
            let SignalLaw::Memory { kind, input } = &signal.law else { continue };
            let number = |expr: &Expr| {
                expr.evaluate(&mut |leaf| match leaf {
                    Leaf::Parameter(id) => graph.parameters[id.index()].value,
                    _ => f64::NAN,
                })
            };
            let input = self.lower(graph, input, None);
            let (kind, memory) = match kind {
                graph::Memory::Hysteresis { low, high } => {
                    let kind = Kind::Hysteresis { low: number(low), high: number(high) };
                    (kind, Memory::held())
                }
                graph::Memory::Sample { period } => {
                    (Kind::Sample { period: number(period) }, Memory::held())
                }
                graph::Memory::Delay { by } => {
                    let by = number(by);
                    (Kind::Delay { by }, Memory::delayed(by, &input, &self.waves))
                }
            };
            let wave = self.waves.len();
            self.waves.push(Known::Memory(memory));
            // Above `high` while it is 0, above `low` while it is 1.
            let condition = match kind {
                Kind::Hysteresis { low, high } => {
                    let held = Formula::leaf(Input::Wave(wave as u32));
                    let b = Formula::number(high) - Formula::number(high - low) * held;
                    let question = Question::Compare(Binary::Greater);
                    let condition = Condition { question, a: input.clone(), b, span: signal.span };
                    self.conditions.push(condition);
                    Some(self.conditions.len() - 1)
                }
                Kind::Sample { .. } | Kind::Delay { .. } => None,
            };
            let own = self.leaf(self.signals[i]);
            let origin = Origin::Signal(SignalId(i as u32));
            self.row(origin, own, Formula::leaf(Input::Wave(wave as u32)));
            let unknown = match self.signals[i] {
                Some(Input::Unknown(k)) => k as usize,
                _ => continue,
            };
            self.memories.push(Remembered {
                wave,
                unknown,
                kind,
                input,
                condition,
                round: rounds[i],
            });
        }
        self.memories.sort_by_key(|memory| memory.round);
    }

    fn state(&mut self, unknown: Unknown, origin: Origin) -> u32 {
        self.unknowns.push(unknown);
        self.state_origins.push(origin);
        self.rates.push(Formula::number(0.0));
        self.unknowns.len() as u32 - 1
    }

    fn leaf(&self, input: Option<Input>) -> Formula {
        input.map_or(Formula::number(0.0), Formula::leaf)
    }

    fn at(&self, index: usize) -> Formula {
        Formula::leaf(Input::Unknown(index as u32))
    }

    /// 0 = left − right.
    fn row(&mut self, origin: Origin, left: Formula, right: Formula) {
        self.algebraic.push(left.binary(Binary::Subtract, right));
        self.origins.push(origin);
    }

    /// The flow into an element at a port.
    fn flow_into(&self, graph: &BondGraph, bond: BondId, end: End) -> Formula {
        let flow = self.at(self.flow(bond));
        let into = graph.sign_into(bond, end.vertex, end.port) > 0.0;
        if into { flow } else { flow.negate() }
    }

    /// The rows of one junction or element.
    fn element(&mut self, graph: &BondGraph, id: VertexId) {
        let vertex = graph.vertex(id);
        let origin = Origin::Vertex(id);
        match &vertex.law {
            Law::Zero => self.junction(graph, id, Power::Effort),
            Law::One => self.junction(graph, id, Power::Flow),
            Law::Source { .. } | Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. } => {
                self.port(graph, End::only(id), &vertex.law);
            }
            Law::Field(field) => {
                for (port, law) in (0..).zip(&field.ports) {
                    self.port(graph, End { vertex: id, port }, law);
                }
            }
            Law::Transformer(modulus) | Law::Gyrator(modulus) => {
                let [first, second] = vertex.bonds[..] else { return };
                let (e1, e2) = (self.at(self.effort(first)), self.at(self.effort(second)));
                let f1 = self.flow_into(graph, first, End { vertex: id, port: 0 });
                let f2 = self.at(self.flow(second));
                let f2 = if graph.sign_into(second, id, 1) > 0.0 { f2.negate() } else { f2 };
                let gyrates = matches!(vertex.law, Law::Gyrator(_));
                let (value, rows) = match (modulus, gyrates) {
                    (Modulus::Ratio(r), false) => (r, [(e1, e2), (f2, f1)]),
                    (Modulus::Gain(g), false) => (g, [(e2, e1), (f1, f2)]),
                    (Modulus::Ratio(r), true) => (r, [(e1, f2), (e2, f1)]),
                    (Modulus::Gain(g), true) => (g, [(f1, e2), (f2, e1)]),
                };
                let value = self.lower(graph, value, Some(id));
                for (left, right) in rows {
                    self.row(origin, left, value.clone().binary(Binary::Multiply, right));
                }
            }
        }
    }

    /// The row of a one-port, or of one port of a field, and the rate of what it stores.
    fn port(&mut self, graph: &BondGraph, end: End, law: &Law) {
        let (id, origin) = (end.vertex, Origin::Vertex(end.vertex));
        let Some(bond) = graph.bond_at(end) else { return };
        let own = |all: &Equations, variable: Power| match variable {
            Power::Effort => all.at(all.effort(bond)),
            Power::Flow => all.flow_into(graph, bond, end),
        };
        match law {
            Law::Source { sets, value, .. } => {
                let value = self.lower(graph, value, Some(id));
                self.row(origin, self.at(self.power(bond, *sets)), value);
            }
            Law::Dissipator(Dissipation::Linear(resistance)) => {
                let law = self
                    .lower(graph, resistance, Some(id))
                    .binary(Binary::Multiply, own(self, Power::Flow));
                self.row(origin, own(self, Power::Effort), law);
            }
            Law::Dissipator(Dissipation::Effort(law)) => {
                let law = self.lower(graph, law, Some(id));
                self.row(origin, own(self, Power::Effort), law);
            }
            Law::Dissipator(Dissipation::Flow(law)) => {
                let law = self.lower(graph, law, Some(id));
                self.row(origin, own(self, Power::Flow), law);
            }
            Law::Store { kind, law, .. } => {
                let Some(k) = self.stored(end) else { return };
                self.rates[k] = own(self, kind.integrates());
                let (stored, gives) = (self.at(k), own(self, kind.gives()));
                match law {
                    StoreLaw::Linear(value) => {
                        let value = self.lower(graph, value, Some(id));
                        self.row(origin, stored, value.binary(Binary::Multiply, gives));
                    }
                    StoreLaw::OfStored(law) => {
                        let law = self.lower(graph, law, Some(id));
                        self.row(origin, gives, law);
                    }
                    StoreLaw::OfPower(law) => {
                        let law = self.lower(graph, law, Some(id));
                        self.row(origin, stored, law);
                    }
                }
            }
            Law::Rate { kind, rate, .. } => {
                let Some(k) = self.rated(id) else { return };
                self.rates[k] = self.lower(graph, rate, Some(id));
                let (state, gives) = (self.at(k), own(self, kind.gives()));
                self.row(origin, gives, state);
                if let Some(q) = self.stored(end) {
                    self.rates[q] = own(self, kind.integrates());
                }
            }
            Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {}
        }
    }

    /// The common variable is equal on all bonds, the other one sums to 0, + for half arrows that point in.
    fn junction(&mut self, graph: &BondGraph, id: VertexId, common: Power) {
        let bonds = &graph.vertex(id).bonds;
        let Some((first, rest)) = bonds.split_first() else { return };
        let origin = Origin::Vertex(id);
        for bond in rest {
            let (left, right) =
                (self.at(self.power(*bond, common)), self.at(self.power(*first, common)));
            self.row(origin, left, right);
        }
        let mut sum = Formula::number(0.0);
        for bond in bonds {
            let term = self.at(self.power(*bond, common.dual()));
            let sign =
                if graph.sign_into(*bond, id, 0) > 0.0 { Binary::Add } else { Binary::Subtract };
            sum = sum.binary(sign, term);
        }
        self.algebraic.push(sum);
        self.origins.push(origin);
    }

    /// An expression of the graph over unknowns, time and waves; `own` is the element whose law it is.
    pub fn lower(&mut self, graph: &BondGraph, expr: &Expr, own: Option<VertexId>) -> Formula {
        if let Some(held) = self.held(graph, expr) {
            return held;
        }
        let node = match &*expr.node {
            Node::Binary(op, a, b) if op.is_comparison() => {
                let (a, b) = (self.lower(graph, a, own), self.lower(graph, b, own));
                return self.condition(Question::Compare(*op), a, b, expr.span);
            }
            Node::Call(function @ (Function::Floor | Function::Sign), arguments)
                if arguments.len() == 1 =>
            {
                let a = self.lower(graph, &arguments[0], own);
                let question = match function {
                    Function::Sign => Question::Sign,
                    _ => Question::Floor,
                };
                return self.condition(question, a, Formula::number(0.0), expr.span);
            }
            Node::Leaf(leaf) => return self.lower_leaf(graph, leaf, own),
            Node::Number(value) => Node::Number(*value),
            Node::Unary(op, a) => Node::Unary(*op, self.lower(graph, a, own)),
            Node::Binary(op, a, b) => {
                Node::Binary(*op, self.lower(graph, a, own), self.lower(graph, b, own))
            }
            // x − y·floor(x/y), so that its jumps are found as those of the floor.
            Node::Call(Function::Mod, arguments) if arguments.len() == 2 => {
                let (x, y) = (&arguments[0], &arguments[1]);
                let quotient = x.clone().binary(Binary::Divide, y.clone());
                let turns =
                    Expr::call(Function::Floor, vec![quotient]).binary(Binary::Multiply, y.clone());
                return self.lower(graph, &x.clone().binary(Binary::Subtract, turns), own);
            }
            Node::Call(function, arguments) => {
                Node::Call(*function, arguments.iter().map(|a| self.lower(graph, a, own)).collect())
            }
            Node::If(c, a, b) => Node::choice(
                self.lower(graph, c, own),
                self.lower(graph, a, own),
                self.lower(graph, b, own),
            ),
            Node::Table(a, table) => Node::Table(self.lower(graph, a, own), table.clone()),
        };
        Formula::new(node, expr.span)
    }

    fn lower_leaf(&self, graph: &BondGraph, leaf: &Leaf, own: Option<VertexId>) -> Formula {
        let of = |vertex: VertexId, power: Power| match graph.vertex(vertex).bonds.first() {
            Some(bond) if power == Power::Effort => self.at(self.effort(*bond)),
            Some(bond) => self.flow_into(graph, *bond, End::only(vertex)),
            None => Formula::number(f64::NAN),
        };
        let stored = |end: End| self.stored(end).map_or(Formula::number(f64::NAN), |k| self.at(k));
        match leaf {
            Leaf::Parameter(id) if self.named => Formula::leaf(Input::Parameter(id.0)),
            Leaf::Parameter(id) => Formula::number(graph.parameters[id.index()].value),
            Leaf::Signal(id) => self.leaf(self.signals[id.index()]),
            Leaf::Time => Formula::leaf(Input::Time),
            Leaf::Own(Variable::Power(power)) => {
                own.map_or(Formula::number(f64::NAN), |vertex| of(vertex, *power))
            }
            Leaf::Own(Variable::Stored) => {
                own.map_or(Formula::number(f64::NAN), |id| stored(End::only(id)))
            }
            Leaf::Bond { bond, variable, negated } => {
                let value = self.at(self.power(*bond, *variable));
                if *negated { value.negate() } else { value }
            }
            Leaf::Stored(end) => stored(*end),
        }
    }

    /// Comparisons and floors over time alone jump at times that can be known beforehand.
    fn held(&mut self, graph: &BondGraph, expr: &Expr) -> Option<Formula> {
        let jumps = match &*expr.node {
            Node::Binary(op, ..) => op.is_comparison(),
            Node::Call(function, _) => matches!(function, Function::Floor | Function::Sign),
            _ => false,
        };
        if !jumps || !over_time_alone(expr) {
            return None;
        }
        let formula = expr.map(&mut |leaf, _| match leaf {
            Leaf::Parameter(id) => Formula::number(graph.parameters[id.index()].value),
            leaf => self.lower_leaf(graph, leaf, None),
        });
        self.waves.push(Known::Held(formula));
        Some(Formula::leaf(Input::Wave(self.waves.len() as u32 - 1)))
    }

    /// The value of a condition; that of numbers is a number.
    fn condition(&mut self, question: Question, a: Formula, b: Formula, span: Span) -> Formula {
        if let (Some(a), Some(b)) = (a.constant(), b.constant()) {
            return Formula::number(question.value(a, b));
        }
        self.conditions.push(Condition { question, a, b, span });
        Formula::leaf(Input::Condition(self.conditions.len() as u32 - 1))
    }

    /// Sorted times of 0, every corner and `until`.
    pub fn corners(&self, until: f64) -> Vec<f64> {
        let mut corners = vec![];
        for known in &self.waves {
            match known {
                Known::Wave(wave) => wave.corners(until, &mut corners),
                Known::Memory(_) => {}
                Known::Held(formula) => held_corners(formula, until, &mut corners),
            }
        }
        let mut delays = vec![];
        for memory in &self.memories {
            match memory.kind {
                Kind::Sample { period } => {
                    waveform::instants(period, until, &mut |t| corners.push(t));
                }
                Kind::Delay { by } => delays.push(by),
                Kind::Hysteresis { .. } => {}
            }
        }
        let mut corners = waveform::merge_corners(corners, until);
        // What has a corner has one again when a delay is over, and again after the next.
        let mut fresh = corners.clone();
        while !fresh.is_empty() && !delays.is_empty() && corners.len() < MOST_ECHOES {
            let near = 1e-12 * until;
            let is_new = |t: &f64| {
                let next = corners.partition_point(|corner| *corner < t - near);
                *t < until && corners.get(next).is_none_or(|corner| *corner > t + near)
            };
            let echoes = fresh.iter().flat_map(|t| delays.iter().map(move |by| t + by));
            let mut echoes: Vec<f64> = echoes.filter(is_new).collect();
            // Two delays in either order, or two equal ones, make one corner: their echoes would double each time.
            echoes.sort_by(f64::total_cmp);
            echoes.dedup_by(|later, kept| *later - *kept <= near);
            corners =
                waveform::merge_corners(corners.into_iter().chain(echoes.clone()).collect(), until);
            fresh = echoes;
        }
        corners
    }
}

impl Question {
    /// What it has for an answer at (a, b).
    pub fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Question::Compare(op) => op.value(a, b),
            Question::Sign => crate::expr::values::sign(a),
            Question::Floor => a.floor(),
        }
    }
}

/// Calls `visit` for every expression of the graph that holds during a run.
pub fn every_expression<'a>(graph: &'a BondGraph, visit: &mut dyn FnMut(&'a Expr)) {
    for vertex in &graph.vertices {
        vertex.law.expressions(visit);
    }
    for signal in &graph.signals {
        if let Some(expr) = signal.law.expression() {
            visit(expr);
        }
    }
    for observation in &graph.experiment.observe {
        visit(&observation.expr);
    }
}

/// In the words of the graph: `q(tank)`, `e(a -> b)`, a signal's name.
pub fn unknown_name(graph: &BondGraph, unknown: Unknown) -> String {
    let inertia = |end: End| graph.storage(end) == Some(Storage::Inertia);
    match unknown {
        Unknown::Stored(end) => {
            let letter = if inertia(end) { "p" } else { "q" };
            format!("{letter}({})", graph.port_name(end))
        }
        Unknown::Rated(id) => {
            let power = if inertia(End::only(id)) { "f" } else { "e" };
            format!("{power}({})", graph.vertex(id).name)
        }
        Unknown::Signal(id) => graph.signals[id.index()].name.clone(),
        Unknown::Effort(id) => format!("e({})", graph.bond_name(id)),
        Unknown::Flow(id) => format!("f({})", graph.bond_name(id)),
    }
}
