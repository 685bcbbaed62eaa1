//! The flat bond graph: what elaboration makes of a file, and all that later stages know of it.
//!
//! Signs. A bond carries an effort e and a flow f, both counted along its half arrow: its power e·f is positive from
//! `from` to `to`. At a 0-junction all efforts are equal and Σ(±f) = 0; at a 1-junction all flows are equal and
//! Σ(±e) = 0, + for half arrows that point in. An element's own e and f are its bond's, f counted into the element
//! (so −f of the bond when the half arrow points out of it). A source *sets its bond's* variable whichever way the
//! half arrow points. Two-ports: port 0 is counted into the element, port 1 out of it; a bond drawn the other way
//! enters with −f. (Karnopp, Margolis, Rosenberg, *System Dynamics*, ch. 3 and 4.)

use crate::expr;
use crate::quantity::Domain;
use crate::source::Span;
use std::collections::HashMap;

macro_rules! index {
    ($(#[$doc:meta] $name:ident)*) => { $(
        #[$doc]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub u32);
        impl $name {
            /// The index for a slice.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    )* };
}

index! {
    /// Index into [`BondGraph::parameters`].
    ParameterId
    /// Index into [`BondGraph::signals`].
    SignalId
    /// Index into [`BondGraph::vertices`].
    VertexId
    /// Index into [`BondGraph::bonds`].
    BondId
}

/// An expression of the bond graph.
pub type Expr = expr::Expr<Leaf>;

/// What an expression of the bond graph may speak of.
#[derive(Clone, Debug, PartialEq)]
pub enum Leaf {
    /// A parameter.
    Parameter(ParameterId),
    /// A signal or input.
    Signal(SignalId),
    /// Time in seconds.
    Time,
    /// Inside a law: the element's own variable.
    Own(Variable),
    /// A bond's variable, counted along the half arrow, or negated.
    #[allow(missing_docs)]
    Bond { bond: BondId, variable: Power, negated: bool },
    /// q of a compliance or p of an inertia, at its port.
    Stored(End),
}

/// The two power variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Power {
    Effort,
    Flow,
}

impl Power {
    /// Effort for flow and flow for effort.
    pub fn dual(self) -> Power {
        match self {
            Power::Effort => Power::Flow,
            Power::Flow => Power::Effort,
        }
    }
}

/// An element's own variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variable {
    /// e or f, f counted into the element.
    Power(Power),
    /// q of a compliance, p of an inertia.
    Stored,
}

/// A named value, in SI.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Its name; `motor.L` for one of an instance.
    pub name: String,
    /// How it was given, over other parameters only; a literal stays a literal.
    pub expr: Expr,
    /// Its value in SI.
    pub value: f64,
    /// The unit as written, for messages.
    pub unit: Option<crate::quantity::Unit>,
    /// The text in quotes after it.
    pub description: String,
    /// Where it is declared.
    pub span: Span,
}

/// A signal: carries no power.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Its name; one made by elaboration (the state of a `pi`, a waveform within an expression) has a name that no
    /// other has, built from the name of the signal it belongs to (`alpha_z`).
    pub name: String,
    /// What it is.
    pub law: SignalLaw,
    /// How it came to be.
    pub origin: SignalOrigin,
    /// Where it is declared.
    pub span: Span,
    /// Its unit, where one was found.
    pub unit: Option<crate::quantity::Unit>,
    /// In whose words its law is written: an index into [`BondGraph::tree`]. That of an input is around the instance that
    /// is given it.
    pub home: u32,
}

/// How a signal came to be; decides the default columns and how it is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalOrigin {
    /// An `input` statement.
    Input,
    /// A `signal` statement.
    Signal,
    /// Made by elaboration.
    Hidden,
}

/// The shapes of signals; every function with memory is written in terms of them.
#[derive(Clone, Debug)]
pub enum SignalLaw {
    /// A value at each instant.
    Algebraic(Expr),
    /// dy/dt = rate, y(0) = initial.
    #[allow(missing_docs)]
    Integrator { rate: Expr, initial: Initial },
    /// A function of time alone with corners that the solver lands on.
    Waveform(Waveform),
    /// What another value was, as its kind says; constant, or known, between instants.
    #[allow(missing_docs)]
    Memory { kind: Memory, input: Expr },
}

/// How a value is remembered; arguments are expressions of parameters only.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Memory {
    /// 1 from when the input rises above `high`, 0 from when it falls below `low`; 0 at first in between.
    Hysteresis { low: Expr, high: Expr },
    /// The input at 0, `period`, 2·`period` …, held until the next of these instants.
    Sample { period: Expr },
    /// The input `by` seconds before; until then its value at the start.
    Delay { by: Expr },
}

impl SignalLaw {
    /// The expression that holds during the run: the value, the rate of an integrator, what is remembered.
    pub fn expression(&self) -> Option<&Expr> {
        match self {
            SignalLaw::Algebraic(expr)
            | SignalLaw::Integrator { rate: expr, .. }
            | SignalLaw::Memory { input: expr, .. } => Some(expr),
            SignalLaw::Waveform(_) => None,
        }
    }

    /// Calls `visit` for every expression in it, those of parameters alone, too.
    pub fn expressions<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        self.expression().into_iter().for_each(&mut *visit);
        match self {
            SignalLaw::Integrator { initial: Initial::Given(value), .. } => visit(value),
            SignalLaw::Memory { kind: Memory::Hysteresis { low, high }, .. } => {
                [low, high].into_iter().for_each(visit);
            }
            SignalLaw::Memory {
                kind: Memory::Sample { period: value } | Memory::Delay { by: value },
                ..
            } => visit(value),
            SignalLaw::Waveform(waveform) => waveform.expressions(visit),
            SignalLaw::Algebraic(_) | SignalLaw::Integrator { .. } => {}
        }
    }
}

impl Waveform {
    /// Calls `visit` for every expression in it.
    pub fn expressions<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        match self {
            Waveform::Step { at, before, after } => [at, before, after].into_iter().for_each(visit),
            Waveform::Ramp { at, slope } => [at, slope].into_iter().for_each(visit),
            Waveform::Pulse { low, high, delay, rise, fall, width, period } => {
                [low, high, delay, rise, fall, width, period].into_iter().for_each(visit);
            }
            Waveform::Sine { offset, amplitude, frequency, delay, damping, phase } => {
                [offset, amplitude, frequency, delay, damping, phase].into_iter().for_each(visit);
            }
            Waveform::Pwl(points) => points.iter().for_each(|(t, y)| {
                visit(t);
                visit(y);
            }),
            Waveform::Noise { seed, rms, dt } => [seed, rms, dt].into_iter().for_each(visit),
        }
    }
}

/// A value at t = 0.
#[derive(Clone, Debug)]
pub enum Initial {
    /// As given.
    Given(Expr),
    /// As [`super::initial`] found it: an integrator that starts where its rate vanishes (`lag` without `ic`), or a
    /// storage that takes the value its neighbours imply.
    Implied,
}

/// Functions of time; arguments are expressions of parameters only. All are right-continuous.
#[derive(Clone, Debug)]
pub enum Waveform {
    /// `before` until `at`, then `after`.
    #[allow(missing_docs)]
    Step { at: Expr, before: Expr, after: Expr },
    /// 0 until `at`, then `slope`·(t − at).
    #[allow(missing_docs)]
    Ramp { at: Expr, slope: Expr },
    /// As SPICE's PULSE; a rise or fall of 0 is an exact jump.
    #[allow(missing_docs)]
    Pulse { low: Expr, high: Expr, delay: Expr, rise: Expr, fall: Expr, width: Expr, period: Expr },
    /// As SPICE's SIN: `offset` + amplitude·exp(−(t−delay)·damping)·sin(2π·frequency·(t−delay) + phase) from `delay`
    /// on, before it the value at `delay`; phase in radians.
    #[allow(missing_docs)]
    Sine { offset: Expr, amplitude: Expr, frequency: Expr, delay: Expr, damping: Expr, phase: Expr },
    /// Straight lines between points, holding the end values; two equal times make a jump.
    Pwl(Vec<(Expr, Expr)>),
    /// Normal random numbers of mean 0, each held for `dt`; see [`crate::quantity::random`].
    #[allow(missing_docs)]
    Noise { seed: Expr, rms: Expr, dt: Expr },
}

/// A junction or an element.
#[derive(Clone, Debug)]
pub struct Vertex {
    /// Its name.
    pub name: String,
    /// What stands before the colon: `R`, `MTF`, `Se`, `0`.
    pub kind: &'static str,
    /// Its law.
    pub law: Law,
    /// Where it is declared.
    pub span: Span,
    /// Its bonds: one for a one-port, one a port in their order for two-ports and fields, in file order for a junction.
    pub bonds: Vec<BondId>,
}

/// The closed set of shapes that laws have.
#[derive(Clone, Debug)]
pub enum Law {
    /// Common effort.
    Zero,
    /// Common flow.
    One,
    /// Sets its bond's effort or flow. Detectors are sources of 0 (`De` sets flow 0, `Df` effort 0).
    #[allow(missing_docs)]
    Source { sets: Power, value: Expr, detector: bool },
    /// e and f at the same instant.
    Dissipator(Dissipation),
    /// Integrates one power variable into a stored one, whose law gives the other.
    #[allow(missing_docs)]
    Store { kind: Storage, law: StoreLaw, initial: StoreInitial },
    /// Rate form: der(e) = rate (compliance) or der(f) = rate (inertia), over its own f (or e) and anything else.
    #[allow(missing_docs)]
    Rate { kind: Storage, rate: Expr, initial: Initial },
    /// Ratio r: e1 = r·e2, f2 = r·f1. Gain g: e2 = g·e1, f1 = g·f2.
    Transformer(Modulus),
    /// Ratio r: e1 = r·f2, e2 = r·f1. Gain g: f1 = g·e2, f2 = g·e1.
    Gyrator(Modulus),
    /// Several ports whose laws speak of each other.
    Field(Field),
}

/// A multiport C, I, IC or R: every port has the law of a dissipator or a storage, over the variables of all ports. f of
/// each port is counted into the element. [`fields`](super::fields) holds the theory.
#[derive(Clone, Debug)]
pub struct Field {
    /// By port: a [`Law::Dissipator`] or a [`Law::Store`] (not the linear ones), in which the own variables of all ports
    /// are [`Leaf::Bond`] and [`Leaf::Stored`].
    pub ports: Vec<Law>,
    /// Its matrix by rows, when it was given as one: e = R·f, q = C·e, p = I·f.
    pub matrix: Option<Vec<Vec<Expr>>>,
}

/// Laws of dissipators.
#[derive(Clone, Debug)]
pub enum Dissipation {
    /// e = R·f.
    Linear(Expr),
    /// e = law, over its own f.
    Effort(Expr),
    /// f = law, over its own e.
    Flow(Expr),
}

/// The two kinds of storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Storage {
    /// q = ∫f dt, gives e.
    Compliance,
    /// p = ∫e dt, gives f.
    Inertia,
}

impl Storage {
    /// The variable that is integrated: flow for a compliance, effort for an inertia.
    pub fn integrates(self) -> Power {
        match self {
            Storage::Compliance => Power::Flow,
            Storage::Inertia => Power::Effort,
        }
    }

    /// The variable that the stored quantity gives.
    pub fn gives(self) -> Power {
        self.integrates().dual()
    }
}

/// Laws of storages.
#[derive(Clone, Debug)]
pub enum StoreLaw {
    /// e = q/C, f = p/I; the expression is C or I. May be modulated.
    Linear(Expr),
    /// e = law(q), f = law(p), over its own stored variable.
    OfStored(Expr),
    /// q = law(e), p = law(f), over its own power variable.
    OfPower(Expr),
}

/// The initial value of a storage.
#[derive(Clone, Debug)]
pub enum StoreInitial {
    /// `q0 =` or `p0 =`.
    Stored(Expr),
    /// `e0 =` or `f0 =`: the law is inverted.
    Power(Expr),
    /// Nothing stated: 0, or what its neighbours imply.
    Unstated,
}

/// The modulus of a two-port, as it is stored: a reciprocal of a signal has become a gain.
#[derive(Clone, Debug)]
pub enum Modulus {
    /// As the paper's r.
    Ratio(Expr),
    /// 1/r, never divided.
    Gain(Expr),
}

/// An end of a bond: a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct End {
    /// The junction or element.
    pub vertex: VertexId,
    /// 0 for one-ports and junctions; 0 or 1 for two-ports; the port's number less one for fields.
    pub port: u32,
}

impl End {
    /// The only port of a one-port.
    pub fn only(vertex: VertexId) -> End {
        End { vertex, port: 0 }
    }
}

/// A bond with its half arrow from `from` to `to`.
#[derive(Clone, Debug)]
pub struct Bond {
    /// The tail of the half arrow.
    pub from: End,
    /// Its head.
    pub to: End,
    /// A causal stroke drawn in the text.
    pub given: Option<Stroke>,
    /// Domain, [`Domain::Any`] when nothing says.
    pub domain: Domain,
    /// Where the arrow stands.
    pub span: Span,
}

/// The end of a bond where the causal stroke is: the end on which the effort is imposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stroke {
    /// At the tail: `to` imposes the effort, `from` the flow.
    AtFrom,
    /// At the head: `from` imposes the effort, `to` the flow.
    AtTo,
}

/// What a plain run does.
#[derive(Clone, Debug, Default)]
pub struct Experiment {
    /// End of the run, seconds.
    pub until: Option<f64>,
    /// Output interval, seconds.
    pub step: Option<f64>,
    /// Options as (key, value), later ones win.
    pub options: Vec<(String, String)>,
    /// Observed variables in order.
    pub observe: Vec<Observation>,
    /// Inputs that nothing drives: 0, which checking and converting accept and simulating does not.
    pub undriven: Vec<SignalId>,
}

/// One observed column.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Its header.
    pub name: String,
    /// The value in SI.
    pub expr: Expr,
    /// The unit of the column as written after `in`, and how many SI units it is; (“”, 1) for SI.
    pub unit: (String, f64),
    /// The SI unit of the value where it is known (`Pa`, `rad/s`), else empty.
    pub si_unit: String,
}

/// The whole graph, flat.
#[derive(Clone, Debug, Default)]
pub struct BondGraph {
    /// The file's stem.
    pub name: String,
    /// Parameters, in file order.
    pub parameters: Vec<Parameter>,
    /// Signals and inputs, in file order, hidden ones before the signal that they belong to.
    pub signals: Vec<Signal>,
    /// Junctions and elements, in file order.
    pub vertices: Vec<Vertex>,
    /// Bonds, in file order.
    pub bonds: Vec<Bond>,
    /// Ports of instances by name, in file order, and their bonds, whose half arrows point as the model declares it.
    pub ports: Vec<(String, BondId)>,
    /// Instances that the file itself declares: by name, where.
    pub instances: HashMap<String, Span>,
    /// The file, and every instance behind the one that it stands in; empty for a graph that came from no text.
    pub tree: Vec<Instance>,
    /// What regulates what, in file order.
    pub regulators: Vec<Regulator>,
    /// What a plain run does.
    pub experiment: Experiment,
    /// The domains whose efforts and flows stand scaled.
    pub scales: Vec<super::scale::Scale>,
}

/// An instance of a model, or the file itself.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its full name, `eha[2].motor`; empty for the file.
    pub name: String,
    /// Its model.
    pub model: String,
    /// The instance that it stands in: an index into [`BondGraph::tree`].
    pub parent: Option<u32>,
    /// Where it is declared.
    pub span: Span,
    /// Its ports by their names in the model, and their bonds.
    pub ports: Vec<(String, BondId)>,
    /// Its inputs.
    pub inputs: Vec<SignalId>,
    /// Its outputs.
    pub outputs: Vec<SignalId>,
    /// Its parameters in the order of the model.
    pub parameters: Vec<InstanceParameter>,
}

/// A parameter of an instance.
#[derive(Clone, Debug)]
pub struct InstanceParameter {
    /// Which.
    pub id: ParameterId,
    /// Its name in the model.
    pub name: String,
    /// Whether instances may set it.
    pub public: bool,
    /// Whether this one's value was given from outside, in the words of what is around.
    pub given: bool,
    /// The model's default, in the words of the model, where the value was given instead.
    pub default: Option<Expr>,
}

/// A signal that regulates, and what for: nothing that a simulation needs, but what the design of its gains starts
/// from.
#[derive(Clone, Debug)]
pub struct Regulator {
    /// The signal, made with `pi` or `pid`.
    pub signal: SignalId,
    /// What it controls.
    pub controlled: Expr,
    /// What that shall follow.
    pub reference: Expr,
    /// The bandwidth wanted, rad/s.
    pub bandwidth: Option<f64>,
    /// The phase margin wanted, rad.
    pub margin: Option<f64>,
    /// Kp and Ki of a `pi`, as they are given.
    pub gains: Option<[Expr; 2]>,
    /// Where it stands.
    pub span: Span,
}

/// Instances by their names.
pub struct Homes<'g>(HashMap<&'g str, u32>);

impl Homes<'_> {
    /// The innermost instance that a full name stands in, 0 for the file: an index into [`BondGraph::tree`].
    pub fn of(&self, name: &str) -> u32 {
        let outer = name.rsplit_once('.').and_then(|(outer, _)| self.0.get(outer));
        outer.copied().unwrap_or(0)
    }
}

impl BondGraph {
    /// The junction or element of an index.
    pub fn vertex(&self, id: VertexId) -> &Vertex {
        &self.vertices[id.index()]
    }

    /// The bond of an index.
    pub fn bond(&self, id: BondId) -> &Bond {
        &self.bonds[id.index()]
    }

    /// Finds the instance that a name stands in.
    pub fn homes(&self) -> Homes<'_> {
        let named = self.tree.iter().enumerate().skip(1);
        Homes(named.map(|(k, instance)| (instance.name.as_str(), k as u32)).collect())
    }

    /// Where the file declares the instance that an element is a part of, however deep in it; `None` for the file's own.
    pub fn instance_of(&self, id: VertexId) -> Option<(&str, Span)> {
        let (instance, _) = self.vertex(id).name.split_once('.')?;
        self.instances.get(instance).map(|span| (instance, *span))
    }

    /// What a variable of a domain is to be multiplied by for SI: e and p carry the domain's factor with the power 1, f
    /// and q with −1.
    pub fn unscale(&self, domain: Domain, power: i32) -> f64 {
        let scale = self.scales.iter().find(|scale| scale.domain == domain);
        scale.map_or(1.0, |scale| scale.factor.powi(power))
    }

    /// All vertex indices.
    pub fn vertex_ids(&self) -> impl Iterator<Item = VertexId> + use<> {
        (0..self.vertices.len() as u32).map(VertexId)
    }

    /// All bond indices.
    pub fn bond_ids(&self) -> impl Iterator<Item = BondId> + use<> {
        (0..self.bonds.len() as u32).map(BondId)
    }

    /// +1 where the bond's half arrow points into the vertex at this port, −1 where it points out.
    pub fn sign_into(&self, bond: BondId, vertex: VertexId, port: u32) -> f64 {
        let bond = self.bond(bond);
        if bond.to == (End { vertex, port }) { 1.0 } else { -1.0 }
    }

    /// `from -> to` in the words of the file.
    pub fn bond_name(&self, id: BondId) -> String {
        let bond = self.bond(id);
        format!("{} -> {}", self.end_name(bond.from), self.end_name(bond.to))
    }

    /// The name of a bond's end, a field's with its port, since no direction tells its ports apart.
    pub fn end_name(&self, end: End) -> String {
        match self.vertex(end.vertex).law {
            Law::Field(_) => self.port_name(end),
            _ => self.vertex(end.vertex).name.clone(),
        }
    }

    /// The law that holds at a port: a field's own one there, else the element's.
    pub fn law_at(&self, end: End) -> &Law {
        let law = &self.vertex(end.vertex).law;
        match law {
            Law::Field(field) => field.ports.get(end.port as usize).unwrap_or(law),
            _ => law,
        }
    }

    /// The ports of an element that have a law of their own: all of a field's, else port 0.
    pub fn law_ports(&self, vertex: VertexId) -> impl Iterator<Item = End> + use<> {
        let count = match &self.vertex(vertex).law {
            Law::Field(field) => field.ports.len(),
            _ => 1,
        };
        (0..count as u32).map(move |port| End { vertex, port })
    }

    /// The ports that store, in the order of the file.
    pub fn stores(&self) -> impl Iterator<Item = (End, Storage)> + '_ {
        let ends = self.vertex_ids().flat_map(|id| self.law_ports(id));
        ends.filter_map(|end| Some((end, self.storage(end)?)))
    }

    /// What a port stores, if anything.
    pub fn storage(&self, end: End) -> Option<Storage> {
        match self.law_at(end) {
            Law::Store { kind, .. } | Law::Rate { kind, .. } => Some(*kind),
            _ => None,
        }
    }

    /// The bond of a port that is not a junction's.
    pub fn bond_at(&self, end: End) -> Option<BondId> {
        self.vertex(end.vertex).bonds.get(end.port as usize).copied()
    }

    /// The name of a port as the file would write it: that of two-ports and fields with its number.
    pub fn port_name(&self, end: End) -> String {
        let vertex = self.vertex(end.vertex);
        match vertex.law {
            Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {
                format!("{}.{}", vertex.name, end.port + 1)
            }
            _ => vertex.name.clone(),
        }
    }
}

impl Law {
    /// Calls `visit` for every expression that holds during a run.
    pub fn expressions<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        match self {
            Law::Zero | Law::One => {}
            Law::Source { value, .. } => visit(value),
            Law::Dissipator(
                Dissipation::Linear(law) | Dissipation::Effort(law) | Dissipation::Flow(law),
            ) => visit(law),
            Law::Store { law, .. } => match law {
                StoreLaw::Linear(law) | StoreLaw::OfStored(law) | StoreLaw::OfPower(law) => {
                    visit(law)
                }
            },
            Law::Rate { rate, .. } => visit(rate),
            Law::Transformer(modulus) | Law::Gyrator(modulus) => match modulus {
                Modulus::Ratio(value) | Modulus::Gain(value) => visit(value),
            },
            Law::Field(field) => field.ports.iter().for_each(|law| law.expressions(visit)),
        }
    }
    /// The same, to change them; a field's matrix too.
    pub fn expressions_mut(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        match self {
            Law::Zero | Law::One => {}
            Law::Source { value, .. } => visit(value),
            Law::Dissipator(
                Dissipation::Linear(law) | Dissipation::Effort(law) | Dissipation::Flow(law),
            ) => visit(law),
            Law::Store { law, .. } => match law {
                StoreLaw::Linear(law) | StoreLaw::OfStored(law) | StoreLaw::OfPower(law) => {
                    visit(law)
                }
            },
            Law::Rate { rate, .. } => visit(rate),
            Law::Transformer(modulus) | Law::Gyrator(modulus) => match modulus {
                Modulus::Ratio(value) | Modulus::Gain(value) => visit(value),
            },
            Law::Field(field) => {
                field.ports.iter_mut().for_each(|law| law.expressions_mut(visit));
                field.matrix.iter_mut().flatten().flatten().for_each(visit);
            }
        }
    }
}
