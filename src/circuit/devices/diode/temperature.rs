//! The parameters of one diode at its temperature T, from those of its model at TNOM:
//!
//! ```text
//! Is(T)  = Is·(T/Tn)^(XTI/N)·e^((T/Tn − 1)·EG/(N·Vt))        the same for JSW; ISR with 1/NR
//! Eg(T)  = 1.16 − 7.02e-4·T²/(T + 1108)                      the gap of silicon, in eV
//! P(T)   = −2·Vt·(1.5·ln(T/Tr) − Eg(T)/(2·Vt) + 1.1150877/(2·Vt(Tr)))
//! Vj(T)  = P(T) + T/Tr·Vr,  Vr = (Vj − P(Tn))·Tr/Tn           Tr = 300.15 K
//! Cjo(T) = Cjo·(1 + M·(4e-4·(T − Tr) − (Vj(T) − Vr)/Vr)) / (1 + M·(4e-4·(Tn − Tr) − (Vj − Vr)/Vr))
//! Rs(T)  = Rs·(1 + TRS1·(T − Tn) + TRS2·(T − Tn)²)            likewise M and TT
//! ```
//!
//! Units: V, A, F, Ω, K. Source: T. Quarles, The SPICE3 implementation guide, UCB/ERL M89/44, 1989, appendix on
//! temperature; R. S. Muller, T. I. Kamins, Device Electronics for Integrated Circuits, 1986 (the gap).

use super::{BOLTZMANN_OVER_CHARGE, Depletion};
use crate::circuit::{DiodeInstance, DiodeModel, Knee};

/// 0 °C in K.
pub const CELSIUS: f64 = 273.15;

/// The temperature that the gap's formula starts from, in K.
const REFERENCE: f64 = 300.15;

/// One diode at its temperature, of its area, perimeter and number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diode {
    pub saturation: f64,
    /// N·Vt, NBV·Vt and NR·Vt.
    pub thermal: f64,
    pub breakdown_thermal: f64,
    pub recombination_thermal: f64,
    pub recombination: f64,
    pub knee: Option<(f64, Knee)>,
    pub resistance: f64,
    /// BV', matched.
    pub breakdown: Option<f64>,
    pub transit_time: f64,
    pub depletion: Depletion,
    pub sidewall: Depletion,
}

impl Diode {
    /// What an instance is.
    pub fn at(model: &DiodeModel, own: &DiodeInstance) -> Diode {
        let (t, nominal) = (own.temperature + CELSIUS, model.nominal_temperature + CELSIUS);
        let thermal = BOLTZMANN_OVER_CHARGE * t;
        let (area, perimeter) = (own.area * own.multiplicity, own.perimeter * own.multiplicity);
        let relative = t / nominal;
        let grown = |emission: f64| {
            let gap = (relative - 1.0) * model.energy_gap / (emission * thermal);
            libm::exp(gap + model.saturation_exponent / emission * libm::log(relative))
        };
        let change = |[linear, quadratic]: [f64; 2]| {
            let by = t - nominal;
            1.0 + linear * by + quadratic * by * by
        };
        let saturation = grown(model.emission)
            * (model.saturation_current * area + model.sidewall_current * perimeter);
        let breakdown_thermal = model.breakdown_emission.unwrap_or(model.emission) * thermal;
        let current = model.breakdown_current * area / saturation;
        let layer = |capacitance: f64, potential: f64, grading: f64, forward: f64| {
            let (potential, ratio) = warmed(potential, grading, t, nominal);
            Depletion { capacitance: capacitance * ratio, potential, grading, forward }
        };
        Diode {
            saturation,
            thermal: model.emission * thermal,
            breakdown_thermal,
            recombination_thermal: model.recombination_emission * thermal,
            recombination: model.recombination_current * area * grown(model.recombination_emission),
            knee: model.knee.map(|(knee, law)| (knee * area, law)),
            resistance: model.series_resistance * change(model.resistance_slopes) / area,
            breakdown: model
                .breakdown_voltage
                .map(|breakdown| matched_breakdown(breakdown, current, breakdown_thermal)),
            transit_time: model.transit_time * change(model.transit_slopes),
            depletion: layer(
                model.junction_capacitance * area,
                model.junction_potential,
                model.grading * change(model.grading_slopes),
                model.forward_bias_depletion,
            ),
            sidewall: layer(
                model.sidewall_capacitance * perimeter,
                model.sidewall_potential,
                model.sidewall_grading,
                model.sidewall_depletion,
            ),
        }
    }
}

/// The potential of a junction at T, and what its capacitance is multiplied with.
fn warmed(potential: f64, grading: f64, t: f64, nominal: f64) -> (f64, f64) {
    if t == nominal {
        return (potential, 1.0);
    }
    let shift = |t: f64| {
        let gap = 1.16 - 7.02e-4 * t * t / (t + 1108.0);
        let [thermal, reference] = [t, REFERENCE].map(|t| BOLTZMANN_OVER_CHARGE * t);
        let change = -gap / (2.0 * thermal) + 1.1150877 / (2.0 * reference);
        -2.0 * thermal * (1.5 * libm::log(t / REFERENCE) + change)
    };
    let at_reference = (potential - shift(nominal)) * REFERENCE / nominal;
    let warm = shift(t) + t / REFERENCE * at_reference;
    let factor = |t: f64, potential: f64| {
        let change = (potential - at_reference) / at_reference;
        1.0 + grading * (4e-4 * (t - REFERENCE) - change)
    };
    (warm, factor(t, warm) / factor(nominal, potential))
}

/// BV' of the header: the voltage whose exponential gives IBV at −BV, by the fixed point of SPICE3; `current` is IBV/Is.
fn matched_breakdown(breakdown: f64, current: f64, thermal: f64) -> f64 {
    if current < breakdown / thermal {
        // The leakage alone is more than IBV there: SPICE3 then takes BV as it stands.
        return breakdown;
    }
    let mut matched = breakdown - thermal * libm::log(1.0 + current);
    for _ in 0..25 {
        matched = breakdown - thermal * libm::log(current + 1.0 - matched / thermal);
    }
    if matched.is_finite() { matched } else { breakdown }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_its_nominal_temperature_nothing_changes() {
        let model = DiodeModel { junction_capacitance: 2e-12, ..DiodeModel::DEFAULT };
        let own = DiodeInstance { area: 3.0, multiplicity: 2.0, ..DiodeInstance::default() };
        let diode = Diode::at(&model, &own);
        assert!((diode.saturation / 6e-14 - 1.0).abs() < 1e-14);
        assert!((diode.depletion.capacitance / 12e-12 - 1.0).abs() < 1e-14);
        assert_eq!(diode.depletion.potential, 1.0);
    }

    #[test]
    fn heat_multiplies_the_saturation_current() {
        // At 127 °C: (400.15/300.15)³·exp((400.15/300.15 − 1)·1.11/Vt), Vt = 0.034482…
        let own = DiodeInstance { temperature: 127.0, ..DiodeInstance::default() };
        let diode = Diode::at(&DiodeModel::DEFAULT, &own);
        let vt = 8.617333262e-5 * 400.15;
        let ratio: f64 = 400.15 / 300.15;
        let expected = 1e-14 * ratio.powi(3) * ((ratio - 1.0) * 1.11 / vt).exp();
        assert!((diode.saturation / expected - 1.0).abs() < 1e-9);
        // By the header's formula: P(400.15 K) + 400.15/300.15·(1 − P(300.15 K)).
        assert!((diode.depletion.potential - 0.9022907731).abs() < 1e-6);
    }

    #[test]
    fn the_perimeter_adds_to_current_and_capacitance() {
        let model = DiodeModel {
            sidewall_current: 1e-12,
            sidewall_capacitance: 5e-12,
            ..DiodeModel::DEFAULT
        };
        let own = DiodeInstance { perimeter: 0.5, ..DiodeInstance::default() };
        let diode = Diode::at(&model, &own);
        assert!((diode.saturation / 5.1e-13 - 1.0).abs() < 1e-12);
        assert!((diode.sidewall.capacitance / 2.5e-12 - 1.0).abs() < 1e-12);
    }
}
