//! What devices contribute to the one equation of a circuit.
//!
//! Unknowns x: node voltages (ground left out), then branch currents in device order. Equations, one for each
//! unknown: Kirchhoff's current law for a node (Σ of currents *leaving* it = 0), the branch's own law for a branch.
//!
//! ```text
//! G·x + f(x, t, m) + A·d/dt Q(x) = b(t),    Q_k(x) = c_k·x + q_k(x)
//! ```
//!
//! Each charge or flux Q_k is an entity of its own, with its column A_k of ±1: the network with all Q frozen
//! (unknowns x and w = dQ/dt) gives consistent values at the start, after every corner and at output rows. m are
//! modes: values that change only at events.

use super::devices;
use super::stamper::Stamper;
use super::{Circuit, DeviceId, Parts, Waveform};
use crate::diagnostic::Diagnostic;
use crate::expr;
use crate::source::Span;
use std::sync::Arc;

/// The stamps of a circuit, by the rows of [`devices::DEVICES`]. `None` when a device makes no sense; the reasons are
/// in `diagnostics`.
pub fn stamp(circuit: &Circuit, diagnostics: &mut Vec<Diagnostic>) -> Option<Stamps> {
    let before = diagnostics.len();
    let mut stamper = Stamper::new(circuit, diagnostics);
    for (id, device) in circuit.ids() {
        (devices::row(&device.kind).stamp)(&mut stamper, id);
    }
    let stamps = stamper.finish();
    (!crate::diagnostic::has_errors(&diagnostics[before..])).then_some(stamps)
}

/// What a column is called that is measured and not written.
pub fn watched_name(place: usize) -> String {
    format!("measured {}", place + 1)
}

/// Index of an unknown and of its equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct UnknownId(pub u32);

/// Unknowns or equations with factors; mostly one or two.
pub type Terms = smallvec::SmallVec<[(UnknownId, f64); 2]>;

/// A law over unknowns.
pub type Law = expr::Expr<Leaf>;

/// What a law may speak of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf {
    /// ``x[k]``.
    Unknown(UnknownId),
    /// dQ_k/dt, the current of a capacitor or the voltage of an inductor.
    Rate(u32),
    /// Time in seconds.
    Time,
    /// 0 or 1, the state of a mode.
    Mode(u32),
}

/// What an unknown is.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// As ngspice names it: `v(out)`, `i(l1)`.
    pub name: Arc<str>,
    /// Whether it is a voltage (else a current).
    pub voltage: bool,
    /// A typical magnitude, where one is known.
    pub nominal: Option<f64>,
    /// The device whose branch or internal node it is, `None` for a node of the netlist.
    pub device: Option<DeviceId>,
    /// Where the node is first used, or the device's card.
    pub span: Span,
}

/// What messages call a device, and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceLabel {
    /// Its name as the netlist writes it.
    pub name: Arc<str>,
    /// Its card.
    pub span: Span,
}

/// A charge or flux Q = linear·x + law(x), whose rate enters equations.
#[derive(Clone, Debug, PartialEq)]
pub struct Charge {
    /// The device that stores it.
    pub device: DeviceId,
    /// The linear part.
    pub linear: Terms,
    /// The non-linear part.
    pub law: Option<Law>,
    /// The equations that its rate enters, with their signs.
    pub into: Terms,
    /// Q at t = 0 where the card says so (`IC=`).
    pub initial: Option<f64>,
    /// Whether an operating point holds it there.
    pub pinned: bool,
}

/// A term of f: `law` enters each equation of `into` with its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct LawStamp {
    /// The device.
    pub device: DeviceId,
    /// The term.
    pub law: Law,
    /// The equations it enters.
    pub into: Terms,
    /// An exponential junction: Newton limits its voltage (first unknown minus second; `None` is ground).
    pub junction: Option<Junction>,
}

/// What Newton's method must know to limit an exponential.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Junction {
    /// Anode and cathode; `None` is ground.
    pub across: [Option<UnknownId>; 2],
    /// n·Vt.
    pub thermal: f64,
    /// The voltage above which limiting begins, n·Vt·ln(n·Vt/(√2·Is)).
    pub critical: f64,
    /// The voltages between which next to nothing flows: short of breakdown, and of conduction.
    pub off: [f64; 2],
}

/// A term of b: an independent source enters the *right-hand side* of each equation of `into` with its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceStamp {
    /// The device.
    pub device: DeviceId,
    /// The function of time.
    pub waveform: Waveform,
    /// What it is in other analyses.
    pub parts: Parts,
    /// The equations it enters.
    pub into: Terms,
}

impl SourceStamp {
    fn differs_in_course_alone(&self, other: &SourceStamp) -> bool {
        let (own, others) = (&self.waveform, &other.waveform);
        let moves = std::mem::discriminant(own) == std::mem::discriminant(others)
            && !own.is_constant()
            && !others.is_constant();
        self.device == other.device && self.into == other.into && (moves || own == others)
    }
}

/// A two-state mode with hysteresis: becomes 1 when `control` rises through `on`, 0 when it falls through `off`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// The device.
    pub device: DeviceId,
    /// The controlling quantity.
    pub control: Law,
    /// Upper threshold.
    pub on: f64,
    /// Lower threshold; `off <= on`.
    pub off: f64,
    /// Its state at the start where the card says so; else by `control` (1 above `on`, else 0).
    pub initial: Option<bool>,
    /// What the controlling quantity is over time, where that is known beforehand: then nobody reads `control`.
    pub course: Option<Course>,
}

/// A sum of multiples of waveforms that consist of straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// What does not change.
    pub constant: f64,
    /// Factor and waveform.
    pub terms: Vec<(f64, Waveform)>,
}

impl Course {
    /// Just after `t`: the value, its slope, the time until which that holds, and what rounding may make of the value.
    pub fn line(&self, t: f64) -> Line {
        let mut line = Line { value: self.constant, slope: 0.0, end: f64::INFINITY, rounding: 0.0 };
        let mut size = self.constant.abs();
        for (factor, waveform) in &self.terms {
            let segment = waveform.segment(t);
            let (value, slope) = (factor * segment.value(t), factor * segment.derivative(t));
            line.value += value;
            line.slope += slope;
            line.end = line.end.min(segment.end);
            size += value.abs() + (slope * t).abs();
        }
        line.rounding = 8.0 * f64::EPSILON * size;
        line
    }
}

/// A piece of a [`Course`].
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub struct Line {
    pub value: f64,
    pub slope: f64,
    pub end: f64,
    pub rounding: f64,
}

/// A term of b that follows from the past of `input`.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryStamp {
    /// The device.
    pub device: DeviceId,
    /// How it follows.
    pub kind: MemoryKind,
    /// What is remembered.
    pub input: Law,
    /// The right-hand sides that it enters, with factors.
    pub into: Terms,
    /// Its value at the start, where the card says so; else 0 with given initial values, or that of the operating point.
    pub initial: Option<f64>,
}

/// How a memory follows its input.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum MemoryKind {
    /// The input a time before, in seconds.
    Delay { by: f64 },
    /// The input at the last multiple of a period, in seconds; rounds part those that hold at one instant.
    Hold { period: f64, round: u32 },
}

/// All that a circuit comes down to.
#[derive(Clone, Debug, Default)]
pub struct Stamps {
    /// What its parts are called in the text that it was made of.
    pub spoken: super::Spoken,
    /// Unknowns, and with them the equations.
    pub unknowns: Vec<Unknown>,
    /// Number of node voltages; branch currents follow.
    pub nodes: usize,
    /// Entries of G; equal places add up.
    pub conductances: Vec<(UnknownId, UnknownId, f64)>,
    /// Charges and fluxes.
    pub charges: Vec<Charge>,
    /// Non-linear terms.
    pub laws: Vec<LawStamp>,
    /// Independent sources.
    pub sources: Vec<SourceStamp>,
    /// Terms that follow from the past.
    pub memories: Vec<MemoryStamp>,
    /// Modes.
    pub modes: Vec<Mode>,
    /// Output columns: name and value.
    pub outputs: Vec<(Arc<str>, Law)>,
    /// So many of them, the last ones, are measured and not written.
    pub watched: usize,
    /// Node voltages that `.ic` states: the values at t = 0 of charges without one of their own (`uic`; capacitors have
    /// taken theirs already), or held while the operating point is sought. The last of several wins.
    pub initial: Terms,
    /// Node voltages of `.nodeset`, from which the search for an operating point begins.
    pub guesses: Terms,
    /// Node voltages that follow from sources alone, where Newton's method begins.
    pub starts: Terms,
    /// Whether charges that cards state are held while the operating point is sought.
    pub initial_holds: bool,
    /// Names and places, indexed by [`DeviceId`].
    pub devices: Arc<Vec<DeviceLabel>>,
}

impl Stamps {
    /// Whether these are those of another circuit but for the courses of sources, and for those only where they move here
    /// and there: what stands still may be counted upon.
    pub fn differ_in_courses_alone(&self, other: &Stamps) -> bool {
        let Stamps {
            spoken: _,
            unknowns,
            nodes,
            conductances,
            charges,
            laws,
            sources,
            memories,
            modes,
            outputs,
            watched,
            initial,
            guesses,
            starts,
            initial_holds,
            devices,
        } = self;
        let mut pairs = sources.iter().zip(&other.sources);
        (nodes, watched, initial_holds) == (&other.nodes, &other.watched, &other.initial_holds)
            && sources.len() == other.sources.len()
            && pairs.all(|(own, other)| own.differs_in_course_alone(other))
            && conductances == &other.conductances
            && (initial, guesses, starts) == (&other.initial, &other.guesses, &other.starts)
            && (charges, memories, modes) == (&other.charges, &other.memories, &other.modes)
            && (unknowns, laws, outputs) == (&other.unknowns, &other.laws, &other.outputs)
            && devices == &other.devices
    }

    /// Gives back what a system has been compiled from: names of columns stay.
    pub fn give_back(&mut self) {
        self.unknowns = vec![];
        self.conductances = vec![];
        self.charges = vec![];
        self.laws = vec![];
        self.sources = vec![];
        self.memories = vec![];
        self.modes = vec![];
    }
}
