//! Junctions: how far their voltages may move in an iteration, and when they rest.

use crate::circuit::stamps::Junction;

/// The voltage across it.
pub(crate) fn voltage_across(junction: &Junction, x: impl Fn(usize) -> f64) -> f64 {
    let [anode, cathode] = junction.across.map(|u| u.map_or(0.0, |k| x(k.0 as usize)));
    anode - cathode
}

/// Whether a junction's conductance is about the same at these voltages.
pub(crate) fn rests(junction: &Junction, voltages: &[f64]) -> bool {
    /// In units of n·Vt.
    const MOVED: f64 = 0.3;
    let [least, most] = junction.off;
    let low = voltages.iter().copied().fold(f64::INFINITY, f64::min);
    let high = voltages.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    high - low <= MOVED * junction.thermal || (low >= least && high <= most)
}

/// Limits the change of a junction's voltage (L. W. Nagel, SPICE2, ERL-M520, 1975, section 4.2): above the critical
/// voltage the *current* may change in proportion to the step, so the voltage by its logarithm.
pub(crate) fn limit_junction(new: f64, old: f64, thermal: f64, critical: f64) -> f64 {
    if new <= critical || (new - old).abs() <= 2.0 * thermal {
        return new;
    }
    if old > 0.0 {
        let argument = 1.0 + (new - old) / thermal;
        if argument > 0.0 { old + thermal * libm::log(argument) } else { critical }
    } else {
        thermal * libm::log(new / thermal)
    }
}
