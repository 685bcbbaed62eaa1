//! The second pass: what each device is.

use super::expand::{Flat, Pending};
use super::models::{self, Key, Kind, OPEN};
use super::passive;
use super::scope;
use super::sources::{self, Times};
use super::values::Lookup;
use crate::circuit::{
    self, Device, DeviceKind, DiodeInstance, DiodeModel, Knee, LawOf, NodeId, Parts, SmoothSwitch,
};
use crate::diagnostic::Diagnostic;
use crate::netlist::header::Header;
use crate::netlist::{Element, Expr, Name, PassiveKind, Source, Waveform};

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
                name: flat.device_name(pending).into(),
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
        let nothing = Box::new(circuit::Waveform::Constant(0.0));
        let parts = Box::<Parts>::default();
        match (is(&sample.switch), is(&sample.capacitor), is(&sample.clock)) {
            (true, ..) => Some(DeviceKind::Hold { period: sample.period, round: sample.round }),
            (_, true, _) => Some(DeviceKind::CurrentSource { waveform: nothing, parts }),
            (.., true) => Some(DeviceKind::VoltageSource { waveform: nothing, parts }),
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
    let plain = |kind: PassiveKind,
                 value: &Expr,
                 initial: &Option<Expr>,
                 d: &mut Vec<Diagnostic>| {
        if let Some(passive) = passive::modelled(lookup, pending, kind, value, initial) {
            return passive::kind(lookup, pending, &passive, d);
        }
        let start = perhaps(initial, d)?;
        if scope::varies(&lookup.flat.scopes, scope, value) {
            return Some(passive::by_law(kind, lookup.law(scope, value, d)?, start));
        }
        let value = number(value, d)?;
        Some(match kind {
            PassiveKind::Resistor => DeviceKind::Resistor { resistance: value },
            PassiveKind::Capacitor => DeviceKind::Capacitor { capacitance: value, initial: start },
            PassiveKind::Inductor => DeviceKind::Inductor { inductance: value, initial: start },
        })
    };
    // A value that changes with time, or follows from others, is a law.
    let moving = |source: &Source| match &source.waveform {
        Waveform::Constant(law) if scope::varies(&lookup.flat.scopes, scope, law) => {
            Some(law.clone())
        }
        _ => None,
    };
    Some(match &pending.device.element {
        Element::Resistor { value } => plain(PassiveKind::Resistor, value, &None, d)?,
        Element::Capacitor { value, initial } => plain(PassiveKind::Capacitor, value, initial, d)?,
        Element::Inductor { value, initial } => plain(PassiveKind::Inductor, value, initial, d)?,
        Element::Passive(passive) => passive::kind(lookup, pending, passive, d)?,
        Element::Charge { law, initial } => DeviceKind::BehaviouralCapacitor {
            law: lookup.law(scope, law, d)?,
            law_of: LawOf::Stored,
            initial: perhaps(initial, d)?,
        },
        Element::Flux { law, initial } => DeviceKind::BehaviouralInductor {
            law: lookup.law(scope, law, d)?,
            law_of: LawOf::Stored,
            initial: perhaps(initial, d)?,
        },
        Element::Mutual { inductors, coupling } => {
            let (first, second) = pending.pair;
            let first = *inductors.get(first as usize)?;
            let second = *inductors.get(second as usize)?;
            let first = lookup.device(scope, first, span, d);
            let second = lookup.device(scope, second, span, d);
            DeviceKind::Mutual { inductors: [first?, second?], coupling: number(coupling, d)? }
        }
        Element::VoltageSource(source) => {
            if let Some(law) = moving(source) {
                return Some(DeviceKind::BehaviouralVoltage { law: lookup.law(scope, &law, d)? });
            }
            let waveform = sources::waveform(lookup, pending, &source.waveform, header, times, d);
            let parts = sources::parts(lookup, pending, source, d);
            DeviceKind::VoltageSource { waveform: Box::new(waveform?), parts: Box::new(parts?) }
        }
        Element::CurrentSource(source) => {
            if let Some(law) = moving(source) {
                return Some(DeviceKind::BehaviouralCurrent { law: lookup.law(scope, &law, d)? });
            }
            let waveform = sources::waveform(lookup, pending, &source.waveform, header, times, d);
            let parts = sources::parts(lookup, pending, source, d);
            DeviceKind::CurrentSource { waveform: Box::new(waveform?), parts: Box::new(parts?) }
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
                    for (number_of, value) in numbers.iter_mut().zip(values.iter()) {
                        *number_of = number(value, d)?;
                    }
                    Some(numbers)
                }
                None => None,
            };
            let (impedance, delay) = (number(impedance, d), number(delay, d));
            DeviceKind::Line { impedance: impedance?, delay: delay?, initial: values.map(Box::new) }
        }
        Element::BehaviouralVoltage { law } => {
            let law = lookup.law(scope, law, d)?;
            DeviceKind::BehaviouralVoltage { law: lookup.followed(law, &pending.nodes) }
        }
        Element::BehaviouralCurrent { law } => {
            DeviceKind::BehaviouralCurrent { law: lookup.law(scope, law, d)? }
        }
        Element::Switch { model, control, on } => {
            let [a, b] = nodes(control, d)?;
            let control = circuit::Expr::leaf(circuit::Leaf::Voltage(a, b));
            switch(lookup, pending, *model, false, control, *on, d)?
        }
        Element::CurrentSwitch { model, control, on } => {
            let device = lookup.device(scope, *control, span, d)?;
            let control = circuit::Expr::leaf(circuit::Leaf::Current(device));
            switch(lookup, pending, *model, true, control, *on, d)?
        }
        Element::LawSwitch { model, control, on } => {
            let control = lookup.law(scope, control, d)?;
            switch(lookup, pending, *model, false, control, *on, d)?
        }
        Element::Diode { model, area, parameters } => {
            diode(lookup, pending, *model, area, parameters, d)?
        }
        // Instances have been expanded.
        Element::Instance { .. } => return None,
    })
}

/// Switches: thresholds with half widths, or both ends of a smooth transition.
#[rustfmt::skip]
const SWITCH: Kind = Kind {
    names: &["sw", "csw", "vswitch", "iswitch", "switch"],
    keys: &[
        ("vt", OPEN), ("vh", OPEN), ("it", OPEN), ("ih", OPEN), ("ron", OPEN), ("roff", OPEN), ("von", OPEN), ("voff", OPEN),
        ("vhon", OPEN), ("vhoff", OPEN), ("ion", OPEN), ("ioff", OPEN), ("ihon", OPEN), ("ihoff", OPEN), ("on", OPEN),
        ("off", OPEN), ("hon", OPEN), ("hoff", OPEN),
    ],
    idle: &["td", "level"],
    spellings: &[],
};

/// D. `cj0` is another spelling of `cjo`; an infinite `bv` is none.
#[rustfmt::skip]
const DIODE: Kind = Kind {
    names: &["d"],
    keys: &[
        ("level", 1.0), ("is", 1e-14), ("n", 1.0), ("rs", 0.0), ("cjo", 0.0), ("vj", 1.0), ("m", 0.5), ("tt", 0.0), ("fc", 0.5),
        ("bv", f64::INFINITY), ("ibv", 1e-3), ("nbv", OPEN), ("ikf", OPEN), ("isr", 0.0), ("nr", 2.0), ("eg", 1.11),
        ("xti", 3.0), ("tnom", OPEN), ("trs1", 0.0), ("trs2", 0.0), ("tm1", 0.0), ("tm2", 0.0), ("ttt1", 0.0), ("ttt2", 0.0),
        ("jsw", 0.0), ("cjsw", 0.0), ("php", 1.0), ("mjsw", 0.33), ("fcs", 0.5), ("area", 1.0), ("pj", 0.0), ("tlev", 0.0),
        ("tlevc", 0.0),
    ],
    // Noise, ratings and words for humans; Xyce's own for ageing.
    idle: &[
        "kf", "af", "mfg", "type", "vpk", "iave", "irms", "fv_max", "bv_max", "id_max", "te_max", "pd_max", "kc",
    ],
    spellings: &[
        ("cj0", "cjo"), ("cj", "cjo"), ("js", "is"), ("pb", "vj"), ("mj", "m"), ("vb", "bv"), ("ik", "ikf"), ("trs", "trs1"),
        ("tref", "tnom"), ("cjp", "cjsw"), ("cjsw0", "cjsw"), ("vjsw", "php"),
    ],
};

/// What a diode's card may say besides its area.
#[rustfmt::skip]
const DIODE_OWN: &[Key] = &[("area", 1.0), ("pj", OPEN), ("m", 1.0), ("temp", OPEN), ("dtemp", 0.0), ("ic", OPEN)];

/// Resistances of switches with thresholds, and of smooth ones.
const CRISP: [f64; 2] = [1.0, 1e12];
const SMOOTH: [f64; 2] = [1.0, 1e6];

fn switch(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    current: bool,
    control: circuit::Expr,
    on: Option<bool>,
    d: &mut Vec<Diagnostic>,
) -> Option<DeviceKind> {
    let values = models::model(lookup, pending, name, &SWITCH, d)?;
    let either = |voltage: &str, current: &str, neutral: &str| {
        values.given(voltage).or_else(|| values.given(current)).or_else(|| values.given(neutral))
    };
    let ends = (either("von", "ion", "on"), either("voff", "ioff", "off"));
    let middle = (either("vt", "it", ""), either("vh", "ih", ""));
    let smooth = matches!(values.kind.as_str(), "vswitch" | "iswitch" | "switch");
    let mixed = match smooth {
        true => middle.0.is_some() || middle.1.is_some(),
        false => ends.0.is_some() || ends.1.is_some(),
    };
    if mixed {
        let message = format!("models of type `{}` do not go over at these values", values.kind);
        d.push(Diagnostic::error("E0743", pending.card.span, message).help(match smooth {
            true => "von= and voff=, ion= and ioff=, on= and off= say where it is on and off",
            false => "vt= and vh=, it= and ih= say where it goes over",
        }));
        return None;
    }
    let resistances = |[on, off]: [f64; 2]| {
        (values.given("ron").unwrap_or(on), values.given("roff").unwrap_or(off))
    };
    if smooth {
        let (on_resistance, off_resistance) = resistances(SMOOTH);
        return Some(DeviceKind::SmoothSwitch(Box::new(SmoothSwitch {
            control,
            on: ends.0.unwrap_or(if current { 1e-3 } else { 1.0 }),
            off: ends.1.unwrap_or(0.0),
            holds_on: either("vhon", "ihon", "hon"),
            holds_off: either("vhoff", "ihoff", "hoff"),
            on_resistance,
            off_resistance,
            initially_on: on,
        })));
    }
    let (on_resistance, off_resistance) = resistances(CRISP);
    let (threshold, half) = (middle.0.unwrap_or(0.0), middle.1.unwrap_or(0.0));
    let (above, below) = (threshold + half.abs(), threshold - half.abs());
    Some(match half < 0.0 {
        false => DeviceKind::Switch {
            control: Box::new(control),
            on: above,
            off: below,
            on_resistance,
            off_resistance,
            initially_on: on,
        },
        true if lookup.flat.smooth_when_negative() => {
            DeviceKind::SmoothSwitch(Box::new(SmoothSwitch {
                control,
                on: above,
                off: below,
                holds_on: None,
                holds_off: None,
                on_resistance,
                off_resistance,
                initially_on: on,
            }))
        }
        true => DeviceKind::CrossedSwitch {
            control: Box::new(control),
            above,
            below,
            on_resistance,
            off_resistance,
            initially_on: on,
        },
    })
}

fn diode(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    area: &Option<Expr>,
    parameters: &[(String, Expr)],
    d: &mut Vec<Diagnostic>,
) -> Option<DeviceKind> {
    let values = models::model(lookup, pending, name, &DIODE, d)?;
    let own = models::own(lookup, pending, "diodes", parameters, DIODE_OWN, d)?;
    let level = values.get("level");
    if ![1.0, 2.0].contains(&level) {
        let message = format!("diodes of level {level} are not read");
        d.push(
            Diagnostic::error("E0743", pending.card.span, message)
                .because("what is known are those of SPICE 3 (level 1) and of PSpice (level 2)"),
        );
        return None;
    }
    for key in ["tlev", "tlevc"] {
        if values.get(key) != 0.0 {
            let message = format!("`{key}={}` of the diode's model is not read", values.get(key));
            let error = Diagnostic::error("E0743", pending.card.span, message);
            d.push(error.because("temperature changes the parameters as in SPICE 3, which is 0"));
            return None;
        }
    }
    let area = match area {
        Some(expr) => lookup.number(pending.scope, expr, d)?,
        None => own.get("area"),
    };
    let pspice = level == 2.0 || lookup.flat.knee_by_root();
    let model = DiodeModel {
        saturation_current: values.get("is"),
        emission: values.get("n"),
        series_resistance: values.get("rs"),
        junction_capacitance: values.get("cjo"),
        junction_potential: values.get("vj"),
        grading: values.get("m"),
        transit_time: values.get("tt"),
        forward_bias_depletion: values.get("fc"),
        breakdown_voltage: Some(values.get("bv")).filter(|bv| bv.is_finite()),
        breakdown_current: values.get("ibv"),
        breakdown_emission: values.given("nbv"),
        recombination_current: values.get("isr"),
        recombination_emission: values.get("nr"),
        knee: values
            .given("ikf")
            .filter(|knee| *knee != 0.0)
            .map(|knee| (knee, if pspice { Knee::Root } else { Knee::Quotient })),
        energy_gap: values.get("eg"),
        saturation_exponent: values.get("xti"),
        nominal_temperature: values.given("tnom").unwrap_or(lookup.flat.nominal_temperature),
        resistance_slopes: [values.get("trs1"), values.get("trs2")],
        grading_slopes: [values.get("tm1"), values.get("tm2")],
        transit_slopes: [values.get("ttt1"), values.get("ttt2")],
        sidewall_current: values.get("jsw"),
        sidewall_capacitance: values.get("cjsw"),
        sidewall_potential: values.get("php"),
        sidewall_grading: values.get("mjsw"),
        sidewall_depletion: values.get("fcs"),
    };
    let instance = DiodeInstance {
        area: area * values.get("area"),
        perimeter: own.given("pj").unwrap_or(values.get("pj")),
        multiplicity: own.get("m"),
        temperature: own.given("temp").unwrap_or(lookup.flat.temperature + own.get("dtemp")),
    };
    Some(DeviceKind::Diode { model: Box::new(model), instance: Box::new(instance) })
}

/// Whether any device stands at ground.
pub fn is_grounded(devices: &[Device]) -> bool {
    devices.iter().any(|device| device.nodes.contains(&NodeId(0)))
}
