//! The flat circuit: devices between nodes, every value a number or a law, and the stamps that it comes down to.
//!
//! Signs (as SPICE): a branch current runs from the first node through the device to the second.

pub mod waveform;
pub mod sweep;
pub mod devices;
pub mod stamper;
pub mod stamps;

use crate::expr;
use crate::source::Span;
use crate::trace::measure::Measure;
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

/// A device between nodes.
#[derive(Clone, Debug)]
pub struct Device {
    /// Its name with its letter, `r_load`, `x1.r_load`, as written in the netlist.
    pub name: String,
    /// Its nodes.
    pub nodes: Vec<NodeId>,
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
        waveform: Waveform,
        parts: Parts,
    },
    CurrentSource {
        waveform: Waveform,
        parts: Parts,
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
    /// Two-state switch with hysteresis, by a voltage or a current.
    Switch {
        control: Expr,
        on: f64,
        off: f64,
        on_resistance: f64,
        off_resistance: f64,
        initially_on: Option<bool>,
    },
    /// Lossless transmission line between two ports.
    Line {
        impedance: f64,
        delay: f64,
        /// v1, i1, v2, i2 until the first delay is over.
        initial: Option<[f64; 4]>,
    },
    /// The voltage of the second node as it was at the last multiple of the period, at the first node.
    Hold {
        period: f64,
        round: u32,
    },
    /// Junction diode, level 1.
    Diode {
        model: DiodeModel,
        area: f64,
    },
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

/// Parameters of the level-1 diode in SI, at the nominal temperature of 27 °C.
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
            None => format!("i({name})"),
        }
    }
}
