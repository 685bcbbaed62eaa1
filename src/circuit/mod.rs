//! The flat circuit: devices between nodes, every value a number or a law, and the stamps that it comes down to.
//!
//! Signs (as SPICE): a branch current runs from the first node through the device to the second.

pub mod waveform;
pub mod sweep;
pub mod devices;
mod slots;
pub mod stamper;
pub mod stamps;

use crate::expr;
use crate::source::Span;
use crate::trace::fourier::Request;
use crate::trace::measure::Measure;
use std::sync::Arc;
pub use sweep::{Axis, Points};
pub use waveform::Waveform;

/// A node; 0 is ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub u32);

/// Index into [`Circuit::devices`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DeviceId(pub u32);

/// An expression over a circuit's variables; parameters have become numbers.
pub type Expr = expr::Expr<Leaf>;

/// What a law may speak of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf {
    /// v(a) − v(b).
    Voltage(NodeId, NodeId),
    /// The current through a device.
    Current(DeviceId),
    /// A part of a phasor; elsewhere of a real number.
    Part(Part, Probe),
    /// The capacitance in F of a device's stored charge: dq/dv.
    Capacitance(DeviceId),
    /// Time in seconds.
    Time,
}

/// A voltage or a current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// v(a) − v(b).
    Voltage(NodeId, NodeId),
    /// The current through a device.
    Current(DeviceId),
}

/// What is asked of a phasor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Part {
    Real,
    Imaginary,
    Magnitude,
    /// In radians.
    Phase,
    /// In degrees.
    Degrees,
    /// 20·log10 of the magnitude.
    Decibel,
}

impl Part {
    /// The function of SPICE that gives it.
    pub fn name(self) -> &'static str {
        match self {
            Part::Real => "re",
            Part::Imaginary => "im",
            Part::Magnitude => "mag",
            Part::Phase | Part::Degrees => "ph",
            Part::Decibel => "db",
        }
    }
}

/// A node's name and scale.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its name, `x1.out` within an instance.
    pub name: String,
    /// A typical magnitude of its voltage, where the netlist's header says one.
    pub nominal: Option<f64>,
    /// Where it is first used.
    pub span: Span,
}

/// The nodes of a device; most have two or four.
pub type Nodes<N> = smallvec::SmallVec<[N; 4]>;

/// A device between nodes.
#[derive(Clone, Debug)]
pub struct Device {
    /// Its name with its letter, `r_load`, `x1.r_load`, as written in the netlist.
    pub name: Arc<str>,
    /// Its nodes.
    pub nodes: Nodes<NodeId>,
    /// What it is.
    pub kind: DeviceKind,
    /// A typical magnitude of its current, where the netlist's header says one.
    pub nominal: Option<f64>,
    /// Its card; for a `.bg` run the line of the element.
    pub span: Span,
}

/// The devices; each has a file of its own in `devices/` with equation, sign, units and source.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum DeviceKind {
    Resistor {
        resistance: f64,
    },
    Capacitor {
        capacitance: f64,
        initial: Option<f64>,
    },
    Inductor {
        inductance: f64,
        initial: Option<f64>,
    },
    /// Couples two inductors: M = k·√(L1·L2).
    Mutual {
        inductors: [DeviceId; 2],
        coupling: f64,
    },
    VoltageSource {
        waveform: Box<Waveform>,
        parts: Box<Parts>,
    },
    CurrentSource {
        waveform: Box<Waveform>,
        parts: Box<Parts>,
    },
    /// v = gain·(v(c+) − v(c−)).
    Vcvs {
        gain: f64,
        control: [NodeId; 2],
    },
    /// i = gain·(v(c+) − v(c−)).
    Vccs {
        gain: f64,
        control: [NodeId; 2],
    },
    /// i = gain·i(control).
    Cccs {
        gain: f64,
        control: DeviceId,
    },
    /// v = gain·i(control).
    Ccvs {
        gain: f64,
        control: DeviceId,
    },
    /// v = law.
    BehaviouralVoltage {
        law: Expr,
    },
    /// i = law.
    BehaviouralCurrent {
        law: Expr,
    },
    /// v = law·i.
    BehaviouralResistor {
        law: Expr,
    },
    /// q = law, or i = law·dv/dt.
    BehaviouralCapacitor {
        law: Expr,
        law_of: LawOf,
        initial: Option<f64>,
    },
    /// Φ = law, or v = law·di/dt.
    BehaviouralInductor {
        law: Expr,
        law_of: LawOf,
        initial: Option<f64>,
    },
    /// Two-state switch with hysteresis, by a voltage or a current.
    Switch {
        control: Box<Expr>,
        on: f64,
        off: f64,
        on_resistance: f64,
        off_resistance: f64,
        initially_on: Option<bool>,
    },
    /// Switch whose two states within the band of its thresholds are turned round (a negative hysteresis).
    CrossedSwitch {
        control: Box<Expr>,
        above: f64,
        below: f64,
        on_resistance: f64,
        off_resistance: f64,
        initially_on: Option<bool>,
    },
    /// Switch whose resistance goes over smoothly.
    SmoothSwitch(Box<SmoothSwitch>),
    /// A value that laws speak of and that no tree of theirs can say; its current is that value.
    Quantity(Quantity),
    /// Lossless transmission line between two ports.
    Line {
        impedance: f64,
        delay: f64,
        /// v1, i1, v2, i2 until the first delay is over.
        initial: Option<Box<[f64; 4]>>,
    },
    /// The voltage of the second node as it was at the last multiple of the period, at the first node.
    Hold {
        period: f64,
        round: u32,
    },
    /// Junction diode.
    Diode {
        model: Box<DiodeModel>,
        instance: Box<DiodeInstance>,
    },
}

// A circuit of a million devices is a gigabyte or not by these: what is large and rare stands in a box.
const _: () = assert!(size_of::<DeviceKind>() <= 48 && size_of::<Device>() <= 120);

/// A switch whose resistance goes over smoothly.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothSwitch {
    /// What it goes by.
    pub control: Expr,
    /// Where it is wholly on.
    pub on: f64,
    /// Where it is wholly off.
    pub off: f64,
    /// Where it begins to turn off when on; without it at `on`.
    pub holds_on: Option<f64>,
    /// Where it begins to turn on when off; without it at `off`.
    pub holds_off: Option<f64>,
    /// In Ω.
    pub on_resistance: f64,
    /// In Ω.
    pub off_resistance: f64,
    /// Whether it is on at the start; without it its control says so.
    pub initially_on: Option<bool>,
}

/// What the law of a behavioural capacitor or inductor gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LawOf {
    /// The charge or the flux.
    Stored,
    /// The capacitance or the inductance: what the rate is multiplied with.
    Factor,
}

/// A value over time that follows from more than the present.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Quantity {
    /// d/dt of a law.
    Derivative { law: Expr },
    /// The integral of a law over time from `initial` on; `pinned` where an operating point holds it there.
    Integral { law: Expr, initial: f64, pinned: bool },
    /// A law as it was a time ago.
    Delay { law: Expr, by: f64 },
    /// A function of time with corners.
    Signal { waveform: Box<Waveform> },
}

/// What an independent source is outside a run over time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Its value in `.op` and `.dc`, in V or A; without one that of its waveform at t = 0.
    pub dc: Option<f64>,
    /// Its phasor in `.ac`; without one 0.
    pub ac: Option<Phasor>,
}

/// A quantity that swings at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phasor {
    /// In V or A.
    pub magnitude: f64,
    /// In radians.
    pub phase: f64,
}

/// Parameters of the diode in SI, as the model card gives them, at its nominal temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct DiodeModel {
    pub saturation_current: f64,
    pub emission: f64,
    pub series_resistance: f64,
    pub junction_capacitance: f64,
    pub junction_potential: f64,
    pub grading: f64,
    pub transit_time: f64,
    pub forward_bias_depletion: f64,
    pub breakdown_voltage: Option<f64>,
    pub breakdown_current: f64,
    /// Without one that of the forward direction.
    pub breakdown_emission: Option<f64>,
    /// Recombination in the space charge: saturation current and emission.
    pub recombination_current: f64,
    pub recombination_emission: f64,
    /// The current above which the forward current goes with half the exponent, and the law of it.
    pub knee: Option<(f64, Knee)>,
    /// Band gap in eV, and the exponent of the temperature in Is.
    pub energy_gap: f64,
    pub saturation_exponent: f64,
    /// In °C.
    pub nominal_temperature: f64,
    /// Linear and quadratic change of Rs, of M, and linear change of TT, per K.
    pub resistance_slopes: [f64; 2],
    pub grading_slopes: [f64; 2],
    pub transit_slopes: [f64; 2],
    /// Per metre of the perimeter: saturation current, capacitance; and potential, grading, FC of the sidewall.
    pub sidewall_current: f64,
    pub sidewall_capacitance: f64,
    pub sidewall_potential: f64,
    pub sidewall_grading: f64,
    pub sidewall_depletion: f64,
}

impl DiodeModel {
    /// The defaults of SPICE: nothing but an exponential of 1e-14 A.
    pub const DEFAULT: DiodeModel = DiodeModel {
        saturation_current: 1e-14,
        emission: 1.0,
        series_resistance: 0.0,
        junction_capacitance: 0.0,
        junction_potential: 1.0,
        grading: 0.5,
        transit_time: 0.0,
        forward_bias_depletion: 0.5,
        breakdown_voltage: None,
        breakdown_current: 1e-3,
        breakdown_emission: None,
        recombination_current: 0.0,
        recombination_emission: 2.0,
        knee: None,
        energy_gap: 1.11,
        saturation_exponent: 3.0,
        nominal_temperature: 27.0,
        resistance_slopes: [0.0; 2],
        grading_slopes: [0.0; 2],
        transit_slopes: [0.0; 2],
        sidewall_current: 0.0,
        sidewall_capacitance: 0.0,
        sidewall_potential: 1.0,
        sidewall_grading: 0.33,
        sidewall_depletion: 0.5,
    };
}

/// How high injection lessens a forward current i, with the knee at k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knee {
    /// i/(1 + √(i/k)).
    Quotient,
    /// i·√(k/(k + i)).
    Root,
}

/// One diode of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiodeInstance {
    /// Relative area.
    pub area: f64,
    /// Perimeter, as the sidewall's parameters take it.
    pub perimeter: f64,
    /// How many in parallel.
    pub multiplicity: f64,
    /// In °C.
    pub temperature: f64,
}

impl Default for DiodeInstance {
    fn default() -> DiodeInstance {
        DiodeInstance { area: 1.0, perimeter: 0.0, multiplicity: 1.0, temperature: 27.0 }
    }
}

/// An output column.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Its header, as the netlist writes it (`v(out)`).
    pub name: String,
    /// Its value.
    pub expr: Expr,
}

/// What is to be computed.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Analysis {
    OperatingPoint,
    Transient {
        step: f64,
        stop: f64,
        start: f64,
        hmax: Option<f64>,
        uic: bool,
    },
    /// Operating points; the first axis runs fastest.
    Dc {
        axes: Vec<Axis>,
    },
    /// Phasors over frequencies in Hz.
    Ac {
        frequencies: Points,
    },
    /// Gain from a source to an output, and the resistances at both.
    Transfer {
        output: Output,
        source: DeviceId,
    },
    /// Poles and zeros from a pair of nodes to another.
    PoleZero {
        input: [NodeId; 2],
        output: [NodeId; 2],
        drive: Drive,
        roots: Roots,
    },
    /// How outputs change with parameters.
    Sensitivity(Sensitivity),
}

/// What changes with what.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivity {
    /// What changes.
    pub outputs: Vec<Output>,
    /// Parameters and values of devices by their names, and what they are.
    pub parameters: Vec<(String, f64)>,
    /// Where: at an operating point, over values, frequencies or times.
    pub of: Box<Analysis>,
    /// By which way.
    pub gradients: Gradients,
}

impl Sensitivity {
    /// Whether a run over time begins with stated charges.
    pub fn starts_from_charges(&self) -> bool {
        matches!(*self.of, Analysis::Transient { uic: true, .. })
    }
}

/// How slopes are worked out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gradients {
    /// By the adjoint, and headed without saying so.
    Plain,
    /// A solution for each parameter.
    Direct,
    /// A solution for each output.
    Adjoint,
    /// Both, one beside the other.
    Both,
}

impl Gradients {
    /// Whether solutions for parameters are wanted.
    pub fn direct(self) -> bool {
        matches!(self, Gradients::Direct | Gradients::Both)
    }

    /// Whether solutions for outputs are wanted.
    pub fn adjoint(self) -> bool {
        self != Gradients::Direct
    }

    /// Of two values, the direct one first, those that are wanted.
    pub fn picked<T>(self, direct: T, adjoint: T) -> impl Iterator<Item = T> {
        let (direct, adjoint) =
            (self.direct().then_some(direct), self.adjoint().then_some(adjoint));
        direct.into_iter().chain(adjoint)
    }
}

/// What an input is driven by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Drive {
    Voltage,
    Current,
}

/// Which roots of a transfer function are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Roots {
    Poles,
    Zeros,
    Both,
}

impl Roots {
    /// Whether poles are.
    pub fn poles(self) -> bool {
        self != Roots::Zeros
    }

    /// Whether zeros are.
    pub fn zeros(self) -> bool {
        self != Roots::Poles
    }
}

impl Analysis {
    /// What it is called: the word of its card and of `--analysis`.
    pub fn name(&self) -> &'static str {
        match self {
            Analysis::OperatingPoint => "op",
            Analysis::Transient { .. } => "tran",
            Analysis::Dc { .. } => "dc",
            Analysis::Ac { .. } => "ac",
            Analysis::Transfer { .. } => "tf",
            Analysis::PoleZero { .. } => "pz",
            Analysis::Sensitivity(_) => "sens",
        }
    }
}

/// A flat circuit with what is to be computed on it.
#[derive(Clone, Debug, Default)]
pub struct Circuit {
    /// First line of the netlist.
    pub title: String,
    /// Nodes; number 0 is ground.
    pub nodes: Vec<Node>,
    /// Devices, in netlist order.
    pub devices: Vec<Device>,
    /// `.ic` values.
    pub initial: Vec<(NodeId, f64)>,
    /// Where to look for an operating point: `.nodeset`.
    pub guesses: Vec<(NodeId, f64)>,
    /// Node voltages that follow from sources alone, where Newton's method begins.
    pub starts: Vec<(NodeId, f64)>,
    /// Whether the initial values of devices hold in the operating point, too.
    pub initial_holds: bool,
    /// What is to be computed, in netlist order.
    pub analyses: Vec<Analysis>,
    /// Everything is computed at each of these values; the first axis runs fastest.
    pub steps: Vec<Axis>,
    /// Output columns; empty means every node voltage and branch current.
    pub outputs: Vec<Output>,
    /// What is measured, over the columns of `watched`.
    pub measures: Vec<Measure>,
    /// Whose harmonics are told, over the same columns.
    pub harmonics: Vec<Request>,
    /// Columns that are measured and not written; they come after the others.
    pub watched: Vec<Expr>,
    /// `.options` and header options as (key, value), later ones win.
    pub options: Vec<(String, String)>,
    /// Output grid (interval), where the header or the command line asks for one.
    pub grid: Option<f64>,
    /// What the devices, voltages and currents are called in the text that the circuit was made of.
    pub spoken: Spoken,
}

/// What a circuit's `E_eta`, `v(mesh)` and `i(v_bus)` (folded to lower case) are called in the bond graph that it was made of:
/// `R:eta`, `e(mesh)`, `f(bus)`. Empty for a circuit that was written as one.
pub type Spoken = std::collections::BTreeMap<String, String>;

impl Circuit {
    /// The devices with their indices.
    pub fn ids(&self) -> impl Iterator<Item = (DeviceId, &Device)> {
        self.devices.iter().enumerate().map(|(k, device)| (DeviceId(k as u32), device))
    }
}

impl Device {
    /// The name of its current as ngspice writes it: `i(l1)`, within instances `i(l.x1.l1)`.
    pub fn current_name(&self) -> String {
        let name = self.name.to_lowercase();
        match name.rsplit_once('.').and_then(|(_, own)| own.chars().next()) {
            Some(letter) => format!("i({letter}.{name})"),
            None => called('i', &name),
        }
    }
}

/// `v(out)` of a letter and a name, in lower case. Big decks have a million of them.
pub(crate) fn called(letter: char, name: &str) -> String {
    let mut text = String::with_capacity(name.len() + 3);
    text.push(letter);
    text.push('(');
    match name.is_ascii() {
        true => {
            text.push_str(name);
            text.make_ascii_lowercase();
        }
        false => text.push_str(&name.to_lowercase()),
    }
    text.push(')');
    text
}
