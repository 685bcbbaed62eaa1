//! Junction diode: level 1 of SPICE3 with the sidewall, high injection and recombination of later simulators, without a
//! gmin of its own.
//!
//! ```text
//! Vt = k·T/q
//! v ≥ −3·N·Vt        i = Is·(e^(v/(N·Vt)) − 1)               lessened by high injection, see `Knee`
//! −BV ≤ v < −3·N·Vt  i = −Is·(1 + (3·N·Vt/(e·v))³)
//! v < −BV'           i = −Is·e^(−(BV' + v)/(NBV·Vt))         BV' such that i(−BV) = −IBV
//! besides            i = ISR·(e^(v/(NR·Vt)) − 1)·((1 − v/Vj)² + 0.005)^(M/2)
//! v < FC·Vj          q = TT·i + Cjo·Vj/(1 − M)·(1 − (1 − v/Vj)^(1 − M))
//! v ≥ FC·Vj          q = TT·i + Cjo·(F1 + (F3·(v − FC·Vj) + M/(2·Vj)·(v² − (FC·Vj)²))/F2)
//! F1 = Vj/(1 − M)·(1 − (1 − FC)^(1 − M)), F2 = (1 − FC)^(1 + M), F3 = 1 − FC·(1 + M)
//! ```
//!
//! Is is that of the area and of the perimeter (JSW) together; i and q scale with area and number, Rs by their reciprocals;
//! the charge of the sidewall has Cjsw, PHP, Mjsw and FCS in the places of Cjo, Vj, M and FC. v is across the junction; a
//! series resistance Rs stands between the anode and an internal node. The middle region is what SPICE3 has instead of
//! the exponential far below zero; it joins with equal slope. What temperature does to the parameters is told in
//! `diode/temperature.rs`.
//!
//! Source: T. Quarles, The SPICE3 implementation guide, UCB/ERL M89/44, 1989; P. Antognetti, G. Massobrio,
//! Semiconductor Device Modeling with SPICE, 1988, chapter 1; ngspice manual, version 39, section 7; PSpice Reference Guide,
//! diode (recombination, knee).

mod temperature;

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper, voltage};
use crate::circuit::stamps::{Junction, Law, LawStamp, Leaf, UnknownId};
use crate::circuit::{DeviceId, DeviceKind, DiodeInstance, DiodeModel, Knee};
use crate::expr::{Binary, Function, Node};
use crate::source::Span;
use temperature::Diode;

/// Boltzmann's constant over the elementary charge (both exact in the SI of 2019), in V/K.
pub const BOLTZMANN_OVER_CHARGE: f64 = 1.380649e-23 / 1.602176634e-19;

/// Vt at 27 °C, in V.
pub const THERMAL_VOLTAGE: f64 = BOLTZMANN_OVER_CHARGE * 300.15;

/// The row of the table.
pub const ROW: Row = Row {
    name: "diode",
    letters: "D",
    equation: "i = Is (exp(v/(N Vt)) - 1) + dq/dt",
    needs: |kind| match kind {
        DeviceKind::Diode { model, instance } => Needs {
            internal: model.series_resistance != 0.0,
            charge: model.junction_capacitance != 0.0
                || model.transit_time != 0.0
                || model.sidewall_capacitance * instance.perimeter != 0.0,
            ..Needs::NOTHING
        },
        _ => Needs::NOTHING,
    },
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Diode { model, instance } = &stamper.device(id).kind else { return };
    if !plausible(stamper, id, model, instance) {
        return;
    }
    let diode = Diode::at(model, instance);
    let [anode, cathode] = stamper.ends(id);
    let across = junction(stamper, id);
    if let Some(internal) = stamper.internal(id) {
        let conductance = 1.0 / diode.resistance;
        stamper.difference(anode, [anode, Some(internal)], conductance);
        stamper.difference(Some(internal), [Some(internal), anode], conductance);
    }
    let into = stamper.leaving([across[0], cathode]);
    let thermal = diode.thermal;
    let critical = thermal * (thermal / (std::f64::consts::SQRT_2 * diode.saturation)).ln();
    let law = conduction(&diode, across);
    if !into.is_empty() {
        let off = [-diode.breakdown.unwrap_or(f64::INFINITY), -5.0 * thermal];
        let junction = Some(Junction { across, thermal, critical, off });
        stamper.stamps.laws.push(LawStamp { device: id, law, into: into.clone(), junction });
    }
    let stored = storage(&diode, across);
    if let Some(charge) = stamper.charge_mut(id) {
        charge.law = Some(stored);
        charge.into = into;
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::Diode { model, instance } = &stamper.device(id).kind else {
        return Current::nothing();
    };
    let conducted = conduction(&Diode::at(model, instance), junction(stamper, id));
    Current::Law(match stamper.charge(id) {
        Some(charge) => conducted.binary(Binary::Add, Law::leaf(Leaf::Rate(charge))),
        None => conducted,
    })
}

/// What the junction is across: the internal node instead of the anode where there is one.
fn junction(stamper: &Stamper, id: DeviceId) -> [Option<UnknownId>; 2] {
    let [anode, cathode] = stamper.ends(id);
    [stamper.internal(id).or(anode), cathode]
}

fn plausible(stamper: &mut Stamper, id: DeviceId, model: &DiodeModel, own: &DiodeInstance) -> bool {
    let positive = [
        ("Is", model.saturation_current),
        ("N", model.emission),
        ("Vj", model.junction_potential),
        ("area", own.area),
        ("IBV", model.breakdown_current),
        ("BV", model.breakdown_voltage.unwrap_or(1.0)),
        ("NBV", model.breakdown_emission.unwrap_or(1.0)),
        ("NR", model.recombination_emission),
        ("IKF", model.knee.map_or(1.0, |(knee, _)| knee)),
        ("EG", model.energy_gap),
        ("PHP", model.sidewall_potential),
        ("M=, the number,", own.multiplicity),
        ("the temperature in K", own.temperature + temperature::CELSIUS),
        ("TNOM in K", model.nominal_temperature + temperature::CELSIUS),
    ];
    let parts = [
        ("M", model.grading),
        ("FC", model.forward_bias_depletion),
        ("MJSW", model.sidewall_grading),
        ("FCS", model.sidewall_depletion),
    ];
    let others = [
        ("Rs", model.series_resistance),
        ("Cjo", model.junction_capacitance),
        ("TT", model.transit_time),
        ("XTI", model.saturation_exponent),
        ("ISR", model.recombination_current),
        ("JSW", model.sidewall_current),
        ("CJSW", model.sidewall_capacitance),
        ("PJ", own.perimeter),
    ];
    if !(stamper.finite(id, &positive) && stamper.finite(id, &parts) && stamper.finite(id, &others))
    {
        return false;
    }
    let name = &stamper.device(id).name;
    if let Some((what, value)) = positive.iter().find(|(_, value)| *value <= 0.0) {
        let message = format!("{what} of the diode `{name}` is {value}, but must be above 0");
        stamper.error("E0753", id, message);
        return false;
    }
    if let Some((what, value)) = parts.iter().find(|(_, value)| !(0.0..1.0).contains(value)) {
        stamper.error(
            "E0753",
            id,
            format!("{what} of the diode `{name}` is {value}, outside 0 to 1"),
        );
        return false;
    }
    true
}

fn number(value: f64) -> Law {
    Law::number(value)
}

fn add(a: Law, b: Law) -> Law {
    a.binary(Binary::Add, b)
}

fn times(a: Law, b: Law) -> Law {
    a.binary(Binary::Multiply, b)
}

/// a where v < limit, else b.
fn below(v: Law, limit: f64, a: Law, b: Law) -> Law {
    Law::new(Node::choice(v.binary(Binary::Less, number(limit)), a, b), Span::NONE)
}

/// factor·(e^(v/thermal) − 1)
fn exponential(v: Law, factor: f64, thermal: f64) -> Law {
    let power = Law::call(Function::Exp, vec![times(v, number(1.0 / thermal))]);
    times(number(factor), add(power, number(-1.0)))
}

/// The current through the junction.
fn conduction(diode: &Diode, across: [Option<UnknownId>; 2]) -> Law {
    let v = || voltage(across);
    let (saturation, thermal) = (diode.saturation, diode.thermal);
    let mut forward = exponential(v(), saturation, thermal);
    if let Some((knee, law)) = diode.knee {
        // Below zero nothing is lessened.
        let current =
            || Law::call(Function::Max, vec![exponential(v(), saturation, thermal), number(0.0)]);
        let root = |law| Law::call(Function::Sqrt, vec![law]);
        // A trifle keeps the slope of the root finite at zero current.
        let trifle = 1e-18;
        forward = match law {
            Knee::Quotient => {
                let part = add(times(current(), number(1.0 / knee)), number(trifle));
                forward.binary(Binary::Divide, add(number(1.0), root(part)))
            }
            Knee::Root => {
                let part = number(knee).binary(Binary::Divide, add(number(knee), current()));
                times(forward, root(part))
            }
        };
    }
    let ratio = || number(3.0 * thermal / std::f64::consts::E).binary(Binary::Divide, v());
    let cube = times(times(ratio(), ratio()), ratio());
    let mut reverse = times(number(-saturation), add(number(1.0), cube));
    if let Some(breakdown) = diode.breakdown {
        let argument = times(add(v(), number(breakdown)), number(-1.0 / diode.breakdown_thermal));
        let steep = Law::call(Function::Exp, vec![argument]);
        reverse = below(v(), -breakdown, times(number(-saturation), steep), reverse);
    }
    let conducted = below(v(), -3.0 * thermal, reverse, forward);
    if diode.recombination == 0.0 {
        return conducted;
    }
    let base = add(number(1.0), times(v(), number(-1.0 / diode.depletion.potential)));
    let square = add(times(base.clone(), base), number(0.005));
    let width =
        Law::call(Function::PowerOfAbs, vec![square, number(0.5 * diode.depletion.grading)]);
    let own = exponential(v(), diode.recombination, diode.recombination_thermal);
    add(conducted, times(own, width))
}

/// A depletion layer: what its charge follows from.
#[derive(Clone, Copy, Debug)]
struct Depletion {
    capacitance: f64,
    potential: f64,
    grading: f64,
    forward: f64,
}

impl Depletion {
    /// Its charge at a voltage.
    fn charge(&self, v: &dyn Fn() -> Law) -> Law {
        let Depletion { capacitance: cj, potential: vj, grading: m, forward: fc } = *self;
        let base = add(number(1.0), times(v(), number(-1.0 / vj)));
        // The base is positive where this branch counts; elsewhere |base| keeps it a number.
        let depleted = if m == 0.5 {
            // The same as 2·cj·vj·(1 − √base), which for small voltages would be the difference of two that are almost equal.
            let root = Law::call(Function::Sqrt, vec![Law::call(Function::Abs, vec![base])]);
            times(number(2.0 * cj), v().binary(Binary::Divide, add(number(1.0), root)))
        } else {
            let power = Law::call(Function::PowerOfAbs, vec![base, number(1.0 - m)]);
            times(number(cj * vj / (1.0 - m)), add(number(1.0), power.negate()))
        };
        let (limit, f2, f3) = (fc * vj, (1.0 - fc).powf(1.0 + m), 1.0 - fc * (1.0 + m));
        let f1 = vj / (1.0 - m) * (1.0 - (1.0 - fc).powf(1.0 - m));
        let constant = cj * (f1 - (f3 * limit + m / (2.0 * vj) * limit * limit) / f2);
        let linear = times(number(cj * f3 / f2), v());
        let quadratic = times(number(cj * m / (2.0 * vj * f2)), times(v(), v()));
        below(v(), limit, depleted, add(number(constant), add(linear, quadratic)))
    }
}

/// The charge of the junction.
fn storage(diode: &Diode, across: [Option<UnknownId>; 2]) -> Law {
    let v = || voltage(across);
    let layers = [diode.depletion, diode.sidewall];
    let mut terms: Vec<Law> = layers
        .iter()
        .filter(|layer| layer.capacitance != 0.0)
        .map(|layer| layer.charge(&v))
        .collect();
    if diode.transit_time != 0.0 {
        terms.push(times(number(diode.transit_time), conduction(diode, across)));
    }
    terms.into_iter().reduce(add).unwrap_or(number(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::devices::testing::*;

    const MODEL: DiodeModel = DiodeModel::DEFAULT;

    fn diode(model: DiodeModel, area: f64) -> crate::circuit::stamps::Stamps {
        let instance = DiodeInstance { area, ..DiodeInstance::default() };
        stamps(vec![(
            "D1",
            vec![1, 0],
            DeviceKind::Diode { model: Box::new(model), instance: Box::new(instance) },
        )])
    }

    fn at(law: &Law, v: f64) -> f64 {
        value(law, &[v], &[], &[], 0.0)
    }

    /// The slope on one side, by differences.
    fn slope(law: &Law, v: f64, h: f64) -> f64 {
        (at(law, v + h) - at(law, v)) / h
    }

    #[test]
    fn conducts_as_the_equation_says() {
        let stamps = diode(MODEL, 2.0);
        let law = &stamps.laws[0].law;
        let vt = 1.380649e-23 * 300.15 / 1.602176634e-19;
        let expected = 2e-14 * ((0.6f64 / vt).exp() - 1.0);
        assert!((at(law, 0.6) / expected - 1.0).abs() < 1e-12);
        assert_eq!(at(law, 0.0), 0.0);
        assert!((at(law, -5.0) / -2e-14 - 1.0).abs() < 1e-6);
        let junction = stamps.laws[0].junction.unwrap();
        assert_eq!(junction.across, [Some(UnknownId(0)), None]);
        assert!((junction.critical - vt * (vt / (2f64.sqrt() * 2e-14)).ln()).abs() < 1e-15);
    }

    #[test]
    fn regions_join_smoothly() {
        let model = DiodeModel { junction_capacitance: 1e-12, transit_time: 0.0, ..MODEL };
        let stamps = diode(model, 1.0);
        let edge = -3.0 * THERMAL_VOLTAGE;
        for (law, v, h) in [
            (&stamps.laws[0].law, edge, 1e-7),
            (stamps.charges[0].law.as_ref().unwrap(), 0.5, 1e-6),
        ] {
            let (before, after) = (slope(law, v, -h), slope(law, v, h));
            assert!((before / after - 1.0).abs() < 1e-3, "{before} {after} at {v}");
            assert!((at(law, v - 1e-12) / at(law, v) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn breaks_down_at_its_voltage_with_its_current() {
        let model = DiodeModel { breakdown_voltage: Some(5.0), breakdown_current: 1e-3, ..MODEL };
        let stamps = diode(model, 1.0);
        let law = &stamps.laws[0].law;
        assert!((at(law, -5.0) / -1e-3 - 1.0).abs() < 1e-3, "{}", at(law, -5.0));
        assert!(at(law, -4.0).abs() < 1e-13);
    }

    #[test]
    fn stores_depletion_and_transit_charge() {
        let model = DiodeModel { junction_capacitance: 4e-12, transit_time: 1e-9, ..MODEL };
        let stamps = diode(model, 1.0);
        let charge = stamps.charges[0].law.as_ref().unwrap();
        // C(v) = Cjo/√(1 − v/Vj) at v = −3 is Cjo/2; the conduction there has no slope.
        assert!((slope(charge, -3.0, 1e-4) / 2e-12 - 1.0).abs() < 1e-3);
        let i = at(&stamps.laws[0].law, 0.65);
        let depletion = diode(DiodeModel { transit_time: 0.0, ..model }, 1.0);
        let depletion = at(depletion.charges[0].law.as_ref().unwrap(), 0.65);
        assert!((at(charge, 0.65) - depletion - 1e-9 * i).abs() < 1e-24);
    }

    #[test]
    fn small_voltages_keep_all_their_digits() {
        // Cjo·v·(1 + v/(4·Vj)) at a grading of a half; the difference of 1 and a root has none of them left.
        let model = DiodeModel { junction_capacitance: 1e-12, transit_time: 0.0, ..MODEL };
        let stamps = diode(model, 1.0);
        let charge = stamps.charges[0].law.as_ref().unwrap();
        for v in [1e-18, -1e-12, 1e-9] {
            assert!((at(charge, v) / (1e-12 * v * (1.0 + 0.25 * v)) - 1.0).abs() < 1e-14, "{v}");
        }
    }

    #[test]
    fn a_series_resistance_adds_a_node() {
        let stamps = diode(DiodeModel { series_resistance: 4.0, ..MODEL }, 2.0);
        assert_eq!(&*stamps.unknowns[1].name, "v(d1#internal)");
        assert_eq!(stamps.nodes, 2);
        assert_eq!(conductances(&stamps), [[0.5, -0.5], [-0.5, 0.5]]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(1), 1.0)]);
        assert_eq!(stamps.outputs.len(), 1);
    }

    #[test]
    fn senseless_parameters_are_errors() {
        for model in [
            DiodeModel { saturation_current: 0.0, ..MODEL },
            DiodeModel { emission: -1.0, ..MODEL },
            DiodeModel { grading: 1.0, ..MODEL },
        ] {
            let instance = Box::<DiodeInstance>::default();
            let model = Box::new(model);
            let circuit = circuit(vec![("d1", vec![1, 0], DeviceKind::Diode { model, instance })]);
            let mut diagnostics = vec![];
            assert!(crate::circuit::stamps::stamp(&circuit, &mut diagnostics).is_none());
            assert_eq!(diagnostics[0].code, "E0753");
        }
    }
}
