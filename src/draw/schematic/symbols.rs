//! What stands for each device, and what is written beside it.

use super::super::text::cut;
use crate::circuit::{Circuit, Device, DeviceId, DeviceKind, NodeId, Waveform};

/// The symbols of devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Symbol {
    Resistor,
    Capacitor,
    Inductor,
    VoltageSource,
    CurrentSource,
    /// A source that follows something else.
    ControlledVoltage,
    ControlledCurrent,
    Switch,
    Diode,
    /// A wire that senses a current: a source of 0 V.
    Sense,
    /// Anything else.
    Block,
}

/// The symbol of a device.
pub fn symbol(device: &Device) -> Symbol {
    match &device.kind {
        DeviceKind::Resistor { .. } | DeviceKind::BehaviouralResistor { .. } => Symbol::Resistor,
        DeviceKind::Capacitor { .. } | DeviceKind::BehaviouralCapacitor { .. } => Symbol::Capacitor,
        DeviceKind::Inductor { .. } | DeviceKind::BehaviouralInductor { .. } => Symbol::Inductor,
        DeviceKind::VoltageSource { waveform, .. } if **waveform == Waveform::Constant(0.0) => {
            Symbol::Sense
        }
        DeviceKind::VoltageSource { .. } => Symbol::VoltageSource,
        DeviceKind::CurrentSource { .. } => Symbol::CurrentSource,
        DeviceKind::Vcvs { .. }
        | DeviceKind::Ccvs { .. }
        | DeviceKind::BehaviouralVoltage { .. } => Symbol::ControlledVoltage,
        DeviceKind::Vccs { .. }
        | DeviceKind::Cccs { .. }
        | DeviceKind::BehaviouralCurrent { .. } => Symbol::ControlledCurrent,
        DeviceKind::Switch { .. }
        | DeviceKind::CrossedSwitch { .. }
        | DeviceKind::SmoothSwitch(_) => Symbol::Switch,
        DeviceKind::Diode { .. } => Symbol::Diode,
        _ => Symbol::Block,
    }
}

/// The value of a device in a few letters; empty where its law is long.
pub fn value(circuit: &Circuit, device: &Device) -> String {
    let node = |id: NodeId| circuit.nodes.get(id.0 as usize).map_or("?", |node| &*node.name);
    let name = |id: DeviceId| circuit.devices.get(id.0 as usize).map_or("?", |d| &*d.name);
    let voltage = |[a, b]: [NodeId; 2]| match b.0 {
        0 => format!("v({})", node(a)),
        _ => format!("v({},{})", node(a), node(b)),
    };
    let times = |gain: f64, what: String| match gain {
        1.0 => what,
        -1.0 => format!("−{what}"),
        gain => format!("{}·{what}", short(gain)),
    };
    let text = match &device.kind {
        DeviceKind::Resistor { resistance } => short(*resistance),
        DeviceKind::Capacitor { capacitance, .. } => short(*capacitance),
        DeviceKind::Inductor { inductance, .. } => short(*inductance),
        DeviceKind::VoltageSource { waveform, .. } | DeviceKind::CurrentSource { waveform, .. } => {
            match &**waveform {
                Waveform::Constant(value) if *value != 0.0 => short(*value),
                Waveform::Constant(_) => String::new(),
                _ => "f(t)".into(),
            }
        }
        DeviceKind::Vcvs { gain, control } | DeviceKind::Vccs { gain, control } => {
            times(*gain, voltage(*control))
        }
        DeviceKind::Cccs { gain, control } | DeviceKind::Ccvs { gain, control } => {
            times(*gain, format!("i({})", name(*control)))
        }
        DeviceKind::BehaviouralResistor { .. }
        | DeviceKind::BehaviouralCapacitor { .. }
        | DeviceKind::BehaviouralInductor { .. }
        | DeviceKind::BehaviouralVoltage { .. }
        | DeviceKind::BehaviouralCurrent { .. } => "law".into(),
        _ => String::new(),
    };
    cut(&text, 26)
}

/// A number in four digits, with the letter of a power of a thousand where there is one.
pub fn short(value: f64) -> String {
    const PREFIXES: [&str; 9] = ["p", "n", "µ", "m", "", "k", "M", "G", "T"];
    let size = value.abs();
    let digits = |value: f64| {
        let text = format!("{value:.3e}");
        text.parse().map_or(text, |value: f64| format!("{value}"))
    };
    if size == 0.0 || !size.is_finite() {
        return digits(value);
    }
    let power = (libm::log10(size) + 1e-9).floor() as i32;
    let thousand = power.div_euclid(3);
    let prefix = usize::try_from(thousand + 4).ok().and_then(|at| PREFIXES.get(at));
    let text = match prefix {
        Some(prefix) => {
            let scaled = value / libm::pow(1000.0, f64::from(thousand));
            let unit = if prefix.is_empty() { String::new() } else { format!(" {prefix}") };
            digits(scaled) + &unit
        }
        None => format!("{value:.3e}"),
    };
    text.replace('-', "−")
}
