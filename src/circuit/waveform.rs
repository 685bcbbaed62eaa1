//! Functions of time of independent sources, as numbers.

/// A function of time. Right-continuous at jumps.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Waveform {
    Constant(f64),
    /// SPICE's PULSE(v1 v2 td tr tf pw per); a rise or fall of 0 is an exact jump; a period of 0 means one pulse.
    Pulse {
        low: f64,
        high: f64,
        delay: f64,
        rise: f64,
        fall: f64,
        width: f64,
        period: f64,
    },
    /// SPICE's SIN(vo va freq td theta phase); phase in radians here.
    Sine {
        offset: f64,
        amplitude: f64,
        frequency: f64,
        delay: f64,
        damping: f64,
        phase: f64,
    },
    /// Straight lines between (t, y); two equal times make a jump.
    Pwl(Vec<(f64, f64)>),
    /// SPICE's EXP(v1 v2 td1 tau1 td2 tau2).
    Exponential {
        from: f64,
        to: f64,
        rise_delay: f64,
        rise_tau: f64,
        fall_delay: f64,
        fall_tau: f64,
    },
    /// SPICE's SFFM(vo va fc mdi fs).
    Sffm {
        offset: f64,
        amplitude: f64,
        carrier: f64,
        index: f64,
        signal: f64,
    },
}
