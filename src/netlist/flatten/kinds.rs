//! The second pass: what each device is.

use super::expand::{Flat, Pending};
use super::scope;
use super::sources::{self, Times};
use super::values::Lookup;
use crate::circuit::{self, Device, DeviceKind, DiodeModel, NodeId, Parts};
use crate::diagnostic::Diagnostic;
use crate::netlist::header::Header;
use crate::netlist::{Element, Expr, Name, Source, Waveform};
use crate::quantity::nearest;

/// Every device of a flat netlist. One that is wrong becomes a resistor, with an error, so that the others keep their
/// numbers.
pub fn resolve(flat: &Flat, header: &Header, times: Times, d: &mut Vec<Diagnostic>) -> Vec<Device> {
    let lookup = Lookup::new(flat, &flat.netlist.names);
    flat.devices
        .iter()
        .map(|pending| {
            let kind =
                sampled(flat, pending, header).or_else(|| kind(&lookup, pending, header, times, d));
            Device {
                name: flat.device_name(pending),
                nodes: pending.nodes.clone(),
                kind: kind.unwrap_or(DeviceKind::Resistor { resistance: f64::NAN }),
                nominal: None,
                span: pending.card.span,
            }
        })
        .collect()
}

/// What a device of an exact sample is; `None` for all others.
fn sampled(flat: &Flat, pending: &Pending, header: &Header) -> Option<DeviceKind> {
    if header.samples.is_empty() {
        return None;
    }
    let name = flat.device_name(pending);
    let is = |other: &str| other.eq_ignore_ascii_case(&name);
    header.samples.iter().find_map(|sample| {
        let nothing = circuit::Waveform::Constant(0.0);
        match (is(&sample.switch), is(&sample.capacitor), is(&sample.clock)) {
            (true, ..) => Some(DeviceKind::Hold { period: sample.period, round: sample.round }),
            (_, true, _) => {
                Some(DeviceKind::CurrentSource { waveform: nothing, parts: Parts::default() })
            }
            (.., true) => {
                Some(DeviceKind::VoltageSource { waveform: nothing, parts: Parts::default() })
            }
            _ => None,
        }
    })
}

fn kind(
    lookup: &Lookup,
    pending: &Pending,
    header: &Header,
    times: Times,
    d: &mut Vec<Diagnostic>,
) -> Option<DeviceKind> {
    let (scope, span) = (pending.scope, pending.card.span);
    let number = |expr: &Expr, d: &mut Vec<Diagnostic>| lookup.number(scope, expr, d);
    let perhaps = |expr: &Option<Expr>, d: &mut Vec<Diagnostic>| match expr {
        Some(expr) => number(expr, d).map(Some),
        None => Some(None),
    };
    let nodes = |control: &[Name; 2], d: &mut Vec<Diagnostic>| {
        let [a, b] = control.map(|name| lookup.node(scope, name, span, d));
        Some([a?, b?])
    };
    Some(match &pending.device.element {
        Element::Resistor { value } => DeviceKind::Resistor { resistance: number(value, d)? },
        Element::Capacitor { value, initial } => {
            DeviceKind::Capacitor { capacitance: number(value, d)?, initial: perhaps(initial, d)? }
        }
        Element::Inductor { value, initial } => {
            DeviceKind::Inductor { inductance: number(value, d)?, initial: perhaps(initial, d)? }
        }
        Element::Mutual { inductors, coupling } => {
            let (first, second) = pending.pair;
            let (first, second) = (*inductors.get(first)?, *inductors.get(second)?);
            let first = lookup.device(scope, first, span, d);
            let second = lookup.device(scope, second, span, d);
            DeviceKind::Mutual { inductors: [first?, second?], coupling: number(coupling, d)? }
        }
        // A value that changes with time, or follows from others, is a law.
        Element::VoltageSource(Source { waveform: Waveform::Constant(law), .. })
            if scope::varies(&lookup.flat.scopes, scope, law) =>
        {
            DeviceKind::BehaviouralVoltage { law: lookup.law(scope, law, d)? }
        }
        Element::CurrentSource(Source { waveform: Waveform::Constant(law), .. })
            if scope::varies(&lookup.flat.scopes, scope, law) =>
        {
            DeviceKind::BehaviouralCurrent { law: lookup.law(scope, law, d)? }
        }
        Element::VoltageSource(source) => {
            let waveform = sources::waveform(lookup, pending, &source.waveform, header, times, d);
            let parts = sources::parts(lookup, pending, source, d);
            DeviceKind::VoltageSource { waveform: waveform?, parts: parts? }
        }
        Element::CurrentSource(source) => {
            let waveform = sources::waveform(lookup, pending, &source.waveform, header, times, d);
            let parts = sources::parts(lookup, pending, source, d);
            DeviceKind::CurrentSource { waveform: waveform?, parts: parts? }
        }
        Element::Vcvs { gain, control } => {
            let (gain, control) = (number(gain, d), nodes(control, d));
            DeviceKind::Vcvs { gain: gain?, control: control? }
        }
        Element::Vccs { gain, control } => {
            let (gain, control) = (number(gain, d), nodes(control, d));
            DeviceKind::Vccs { gain: gain?, control: control? }
        }
        Element::Cccs { gain, control } => {
            let (gain, control) = (number(gain, d), lookup.device(scope, *control, span, d));
            DeviceKind::Cccs { gain: gain?, control: control? }
        }
        Element::Ccvs { gain, control } => {
            let (gain, control) = (number(gain, d), lookup.device(scope, *control, span, d));
            DeviceKind::Ccvs { gain: gain?, control: control? }
        }
        Element::Line { impedance, delay, initial } => {
            let values = match initial {
                Some(values) => {
                    let mut numbers = [0.0; 4];
                    for (number_of, value) in numbers.iter_mut().zip(values) {
                        *number_of = number(value, d)?;
                    }
                    Some(numbers)
                }
                None => None,
            };
            let (impedance, delay) = (number(impedance, d), number(delay, d));
            DeviceKind::Line { impedance: impedance?, delay: delay?, initial: values }
        }
        Element::BehaviouralVoltage { law } => {
            DeviceKind::BehaviouralVoltage { law: lookup.law(scope, law, d)? }
        }
        Element::BehaviouralCurrent { law } => {
            DeviceKind::BehaviouralCurrent { law: lookup.law(scope, law, d)? }
        }
        Element::Switch { model, control, on } => {
            let [a, b] = nodes(control, d)?;
            let control = circuit::Expr::leaf(circuit::Leaf::Voltage(a, b));
            switch(lookup, pending, *model, "sw", control, *on, d)?
        }
        Element::CurrentSwitch { model, control, on } => {
            let device = lookup.device(scope, *control, span, d)?;
            let control = circuit::Expr::leaf(circuit::Leaf::Current(device));
            switch(lookup, pending, *model, "csw", control, *on, d)?
        }
        Element::Diode { model, area } => {
            let area = perhaps(area, d)?.unwrap_or(1.0);
            DeviceKind::Diode { model: diode(lookup, pending, *model, d)?, area }
        }
        // Instances have been expanded.
        Element::Instance { .. } => return None,
    })
}

/// A key of a model: its name and its default.
type Key = (&'static str, f64);

/// SW and CSW, with the defaults of ngspice.
const SWITCH: &[Key] = &[("vt", 0.0), ("vh", 0.0), ("ron", 1.0), ("roff", 1e12)];
const CURRENT_SWITCH: &[Key] = &[("it", 0.0), ("ih", 0.0), ("ron", 1.0), ("roff", 1e12)];

/// D, level 1. `cj0` is another spelling of `cjo`; an infinite `bv` is none.
const DIODE: &[Key] = &[
    ("is", 1e-14),
    ("n", 1.0),
    ("rs", 0.0),
    ("cjo", 0.0),
    ("vj", 1.0),
    ("m", 0.5),
    ("tt", 0.0),
    ("fc", 0.5),
    ("bv", f64::INFINITY),
    ("ibv", 1e-3),
    ("level", 1.0),
];

/// Keys of diode models that matter in other analyses or at other temperatures only.
const DIODE_IDLE: &[&str] =
    &["eg", "xti", "kf", "af", "tnom", "trs", "trs1", "trs2", "tm1", "tm2", "mfg", "type"];

/// Other spellings of keys.
const SPELLINGS: &[(&str, &str)] =
    &[("cj0", "cjo"), ("cj", "cjo"), ("js", "is"), ("pb", "vj"), ("mj", "m"), ("vb", "bv")];

/// The values of a model of a kind, in the order of its keys.
fn model(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    kind: &str,
    keys: &[Key],
    idle: &[&str],
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<f64>> {
    let text = lookup.names.text(name);
    let found = lookup
        .flat
        .scopes
        .around(pending.scope)
        .find_map(|(id, scope)| scope.models.get(&name).map(|model| (id, *model)));
    let Some((id, (card, own, parameters))) = found else {
        let models =
            lookup.flat.scopes.around(pending.scope).flat_map(|(_, scope)| scope.models.keys());
        let mut known: Vec<&str> = models.map(|name| lookup.names.text(*name)).collect();
        known.sort_unstable();
        let error =
            Diagnostic::error("E0742", pending.card.span, format!("unknown model `{text}`"));
        d.push(match nearest(text, known) {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error.help(format!("define it: .model {text} {kind}(…)")),
        });
        return None;
    };
    if own != kind {
        let message = format!("`{text}` is a model of type `{own}`, `{kind}` is needed");
        d.push(
            Diagnostic::error("E0742", pending.card.span, message).label(card.span, "the model"),
        );
        return None;
    }
    let mut values: Vec<f64> = keys.iter().map(|(_, default)| *default).collect();
    for (key, expr) in parameters {
        let key =
            SPELLINGS.iter().find(|(other, _)| other == key).map_or(key.as_str(), |(_, key)| key);
        if let Some(k) = keys.iter().position(|(known, _)| *known == key) {
            values[k] = lookup.number(id, expr, d)?;
        } else if !idle.contains(&key) {
            let span = if expr.span.is_none() { card.span } else { expr.span };
            let error = Diagnostic::error(
                "E0743",
                span,
                format!("models of type `{kind}` have no parameter `{key}`"),
            );
            let error = match nearest(key, keys.iter().map(|(known, _)| *known)) {
                Some(near) => error.help(format!("did you mean `{near}`?")),
                None => error,
            };
            // One model, one message, however many devices use it.
            if !d.contains(&error) {
                d.push(error);
            }
            return None;
        }
    }
    Some(values)
}

fn switch(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    kind: &str,
    control: circuit::Expr,
    on: Option<bool>,
    d: &mut Vec<Diagnostic>,
) -> Option<DeviceKind> {
    let keys = if kind == "sw" { SWITCH } else { CURRENT_SWITCH };
    let values = model(lookup, pending, name, kind, keys, &[], d)?;
    let [threshold, hysteresis, on_resistance, off_resistance] = values[..] else { return None };
    Some(DeviceKind::Switch {
        control,
        on: threshold + hysteresis,
        off: threshold - hysteresis,
        on_resistance,
        off_resistance,
        initially_on: on,
    })
}

fn diode(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    d: &mut Vec<Diagnostic>,
) -> Option<DiodeModel> {
    let values = model(lookup, pending, name, "d", DIODE, DIODE_IDLE, d)?;
    let [is, n, rs, cjo, vj, m, tt, fc, bv, ibv, level] = values[..] else { return None };
    if level != 1.0 {
        let message = format!("diodes of level {level} are not read yet");
        d.push(Diagnostic::error("E0743", pending.card.span, message));
        return None;
    }
    Some(DiodeModel {
        saturation_current: is,
        emission: n,
        series_resistance: rs,
        junction_capacitance: cjo,
        junction_potential: vj,
        grading: m,
        transit_time: tt,
        forward_bias_depletion: fc,
        breakdown_voltage: bv.is_finite().then_some(bv),
        breakdown_current: ibv,
    })
}

/// Whether any device stands at ground.
pub fn is_grounded(devices: &[Device]) -> bool {
    devices.iter().any(|device| device.nodes.contains(&NodeId(0)))
}
