//! Resistors, capacitors and inductors: values from models and geometry, at a temperature, so many in parallel.
//!
//! ```text
//! R = RSH·(L − SHORT)/(W − NARROW)
//! C = CJ·(L − SHORT)·(W − NARROW) + 2·CJSW·(L − SHORT + W − NARROW)
//! value(T) = value·(1 + TC1·(T − TNOM) + TC2·(T − TNOM)²)
//! C(age)   = C·(1 − D·log10(age in hours))
//! M in parallel: R/M, M·C, L/M
//! R, C and L of a model: the value of what says none; in Xyce and LTspice what every value is multiplied with
//! ```
//!
//! Sources: ngspice manual, version 39, sections 3.2.2 to 3.2.12; Xyce Reference Guide, version 7, tables of R, C and L.

use super::expand::Pending;
use super::models::{self, Key, Kind, OPEN, Values};
use super::scope;
use super::values::Lookup;
use crate::circuit::{self, DeviceKind, LawOf};
use crate::diagnostic::Diagnostic;
use crate::expr::Binary;
use crate::netlist::{Expr, Passive, PassiveKind};

#[rustfmt::skip]
const RESISTOR: Kind = Kind {
    names: &["r", "res"],
    keys: &[
        ("r", OPEN), ("rsh", OPEN), ("defw", OPEN), ("narrow", 0.0), ("short", 0.0), ("l", OPEN), ("w", OPEN), ("tc1", 0.0),
        ("tc2", 0.0), ("tnom", OPEN), ("level", 1.0),
    ],
    idle: &["kf", "af", "bv_max"],
    spellings: &[("res", "r"), ("tc1r", "tc1"), ("tc2r", "tc2"), ("tref", "tnom"), ("dw", "narrow"), ("dlr", "short")],
};

#[rustfmt::skip]
const CAPACITOR: Kind = Kind {
    names: &["c", "cap"],
    keys: &[
        ("c", OPEN), ("cap", OPEN), ("cj", OPEN), ("cjsw", 0.0), ("defw", OPEN), ("defl", OPEN), ("narrow", 0.0),
        ("short", 0.0), ("tc1", 0.0), ("tc2", 0.0), ("tnom", OPEN), ("level", 1.0),
    ],
    idle: &["bv_max"],
    spellings: &[("tref", "tnom")],
};

#[rustfmt::skip]
const INDUCTOR: Kind = Kind {
    names: &["l", "ind"],
    keys: &[("l", OPEN), ("ind", OPEN), ("tc1", 0.0), ("tc2", 0.0), ("tnom", OPEN), ("level", 1.0)],
    idle: &[],
    spellings: &[("tref", "tnom")],
};

/// What a card of any of the three may say.
#[rustfmt::skip]
const OWN: &[Key] = &[
    ("l", OPEN), ("w", OPEN), ("tc1", OPEN), ("tc2", OPEN), ("temp", OPEN), ("dtemp", 0.0), ("m", 1.0), ("scale", 1.0),
    ("age", OPEN), ("d", 0.0233),
];

/// The width in m that geometry has where nothing says one.
const WIDTH: f64 = 1e-5;

/// What a passive device is.
pub fn kind(
    lookup: &Lookup,
    pending: &Pending,
    passive: &Passive,
    d: &mut Vec<Diagnostic>,
) -> Option<DeviceKind> {
    let (rows, what) = match passive.kind {
        PassiveKind::Resistor => (&RESISTOR, "resistors"),
        PassiveKind::Capacitor => (&CAPACITOR, "capacitors"),
        PassiveKind::Inductor => (&INDUCTOR, "inductors"),
    };
    let own = models::own(lookup, pending, what, &passive.parameters, OWN, d)?;
    let model = match passive.model {
        Some(name) => Some(models::model(lookup, pending, name, rows, d)?),
        None => None,
    };
    let model = model.as_ref();
    let initial = match &passive.initial {
        Some(expr) => Some(lookup.number(pending.scope, expr, d)?),
        None => None,
    };
    let multiplies = lookup.flat.models_multiply();
    // For resistors the key is `r`, for inductors `l`, for capacitors `c`.
    let key = passive.kind.model();
    let multiplier = model.and_then(|model| model.given(key)).filter(|_| multiplies).unwrap_or(1.0);
    let factor = multiplier * factor(lookup, passive.kind, &own, model);
    let varies = |value: &&Expr| scope::varies(&lookup.flat.scopes, pending.scope, value);
    let law = passive.value.as_ref().filter(varies);
    if let Some(law) = law {
        let law = lookup.law(pending.scope, law, d)?;
        let law = match factor == 1.0 {
            true => law,
            false => circuit::Expr::number(factor).binary(Binary::Multiply, law),
        };
        return Some(by_law(passive.kind, law, initial));
    }
    let value = match &passive.value {
        Some(expr) => lookup.number(pending.scope, expr, d)?,
        None => match geometry(passive.kind, &own, model, multiplies) {
            Some(value) => value,
            None => {
                let name = lookup.flat.device_name(pending);
                let message = format!("`{name}` has no value");
                d.push(
                    Diagnostic::error("E0765", pending.card.span, message)
                        .because("neither its card nor its model says one")
                        .help("write it behind the nodes, or give its model what it follows from (`rsh=` and `l=`, `cj=`)"),
                );
                return None;
            }
        },
    };
    let value = factor * value;
    Some(match passive.kind {
        PassiveKind::Resistor => DeviceKind::Resistor { resistance: value },
        PassiveKind::Capacitor => DeviceKind::Capacitor { capacitance: value, initial },
        PassiveKind::Inductor => DeviceKind::Inductor { inductance: value, initial },
    })
}

/// One whose value is a law.
pub fn by_law(kind: PassiveKind, law: circuit::Expr, initial: Option<f64>) -> DeviceKind {
    let law_of = LawOf::Factor;
    match kind {
        PassiveKind::Resistor => DeviceKind::BehaviouralResistor { law },
        PassiveKind::Capacitor => DeviceKind::BehaviouralCapacitor { law, law_of, initial },
        PassiveKind::Inductor => DeviceKind::BehaviouralInductor { law, law_of, initial },
    }
}

/// What temperature, age and number multiply the value with.
fn factor(lookup: &Lookup, kind: PassiveKind, own: &Values, model: Option<&Values>) -> f64 {
    let slope = |key: &str| {
        own.given(key).or_else(|| model.and_then(|model| model.given(key))).unwrap_or(0.0)
    };
    let nominal = model.and_then(|model| model.given("tnom"));
    let temperature = own.given("temp").unwrap_or(lookup.flat.temperature + own.get("dtemp"));
    let by = temperature - nominal.unwrap_or(lookup.flat.nominal_temperature);
    let mut factor = (1.0 + slope("tc1") * by + slope("tc2") * by * by) * own.get("scale");
    if let (PassiveKind::Capacitor, Some(age)) = (kind, own.given("age")) {
        // What is newer than an hour has not aged.
        factor *= 1.0 - own.get("d") * libm::log10(age.max(1.0));
    }
    match kind {
        PassiveKind::Capacitor => factor * own.get("m"),
        _ => factor / own.get("m"),
    }
}

/// The value that a model gives: as it stands, or from length and width.
fn geometry(
    kind: PassiveKind,
    own: &Values,
    model: Option<&Values>,
    multiplies: bool,
) -> Option<f64> {
    let model = model?;
    let value = |key: &str| model.given(key).filter(|_| !multiplies);
    let width = || {
        let given = own.given("w").or_else(|| model.given("w")).or_else(|| model.given("defw"));
        given.unwrap_or(WIDTH) - model.get("narrow")
    };
    let length = || {
        let given = own.given("l").or_else(|| model.given("l")).or_else(|| model.given("defl"));
        Some(given? - model.get("short"))
    };
    match kind {
        PassiveKind::Resistor => match (model.given("rsh"), length()) {
            (Some(sheet), Some(length)) => Some(sheet * length / width()),
            _ => value("r"),
        },
        PassiveKind::Capacitor => match (model.given("cj"), length()) {
            (Some(area), Some(length)) => {
                let width = width();
                Some(area * length * width + 2.0 * model.get("cjsw") * (length + width))
            }
            _ => model.given("cap").or_else(|| value("c")),
        },
        PassiveKind::Inductor => model.given("ind").or_else(|| value("l")),
    }
}

/// The passive device that a plain value is when it names a model: `R1 a b rmod`.
pub fn modelled(
    lookup: &Lookup,
    pending: &Pending,
    kind: PassiveKind,
    value: &Expr,
    initial: &Option<Expr>,
) -> Option<Passive> {
    let crate::expr::Node::Leaf(crate::netlist::Leaf::Parameter(name)) = &*value.node else {
        return None;
    };
    let parameter = lookup.flat.scopes.parameter(pending.scope, *name).is_some();
    if parameter || !models::is_model(lookup, pending, *name) {
        return None;
    }
    Some(Passive {
        kind,
        value: None,
        model: Some(*name),
        initial: initial.clone(),
        parameters: vec![],
    })
}
