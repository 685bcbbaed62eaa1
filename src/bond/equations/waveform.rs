//! Waveforms as numbers: value within a segment, and corners.
//!
//! A *segment* is the open interval between two neighbouring corners of all waveforms. Within it each waveform is one
//! smooth piece; the piece is chosen by a time strictly `inside` the segment and may then be evaluated at either end
//! of it, so that neither the value before a jump nor the one after it depends on how a corner was rounded.

use crate::quantity::random;
use std::f64::consts::TAU;

/// Periods of a pulse train whose corners are listed; a run with more would not end anyway.
const MOST_TURNS: u32 = 10_000_000;

/// A function of time with numbers for arguments.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Wave {
    Step { at: f64, before: f64, after: f64 },
    Ramp { at: f64, slope: f64 },
    Pulse { low: f64, high: f64, delay: f64, rise: f64, fall: f64, width: f64, period: f64 },
    Sine { offset: f64, amplitude: f64, frequency: f64, delay: f64, damping: f64, phase: f64 },
    Pwl(Vec<(f64, f64)>),
    Noise { seed: u64, rms: f64, dt: f64 },
}

impl Wave {
    /// The value at `t`, of the piece that holds at the time `inside`.
    pub fn value(&self, t: f64, inside: f64) -> f64 {
        match self {
            Wave::Step { at, before, after } => {
                if inside < *at {
                    *before
                } else {
                    *after
                }
            }
            Wave::Ramp { at, slope } => {
                if inside < *at {
                    0.0
                } else {
                    slope * (t - at)
                }
            }
            Wave::Pulse { low, high, delay, rise, fall, width, period } => {
                let turn = |t: f64| {
                    if *period > 0.0 && t > *delay { ((t - delay) / period).floor() } else { 0.0 }
                };
                let begin = delay + turn(inside) * period;
                let (place, u) = (inside - begin, t - begin);
                if place < 0.0 {
                    *low
                } else if place < *rise {
                    low + (high - low) * u / rise
                } else if place < rise + width {
                    *high
                } else if place < rise + width + fall {
                    high + (low - high) * (u - rise - width) / fall
                } else {
                    *low
                }
            }
            Wave::Sine { offset, amplitude, frequency, delay, damping, phase } => {
                let u = if inside < *delay { 0.0 } else { t - delay };
                offset + amplitude * (-u * damping).exp() * (TAU * frequency * u + phase).sin()
            }
            Wave::Noise { seed, rms, dt } => {
                rms * random::normal(*seed, (inside / dt).floor().max(0.0) as u64)
            }
            Wave::Pwl(points) => {
                let next = points.partition_point(|(at, _)| *at <= inside);
                match (next.checked_sub(1).map(|i| points[i]), points.get(next).copied()) {
                    (Some((t0, y0)), Some((t1, y1))) => y0 + (y1 - y0) * (t - t0) / (t1 - t0),
                    (None, Some((_, y))) | (Some((_, y)), None) => y,
                    (None, None) => 0.0,
                }
            }
        }
    }

    /// Appends the corners within (0, until); jumps and kinks alike.
    pub fn corners(&self, until: f64, corners: &mut Vec<f64>) {
        let mut push = |t: f64| {
            if t > 0.0 && t < until {
                corners.push(t);
            }
        };
        match self {
            Wave::Step { at, .. } | Wave::Ramp { at, .. } => push(*at),
            Wave::Sine { delay, .. } => push(*delay),
            Wave::Pwl(points) => points.iter().for_each(|(at, _)| push(*at)),
            Wave::Noise { dt, .. } => instants(*dt, until, &mut push),
            Wave::Pulse { delay, rise, fall, width, period, .. } => {
                for turn in 0..MOST_TURNS {
                    let begin = delay + f64::from(turn) * period;
                    if begin >= until {
                        break;
                    }
                    let parts = [0.0, *rise, rise + width, rise + width + fall];
                    for part in parts {
                        if *period <= 0.0 || part < *period {
                            push(begin + part);
                        }
                    }
                    if *period <= 0.0 {
                        break;
                    }
                }
            }
        }
    }
}

/// Every multiple of a period within (0, until).
pub fn instants(period: f64, until: f64, push: &mut dyn FnMut(f64)) {
    for turn in 1..=MOST_TURNS {
        let t = f64::from(turn) * period;
        if t >= until {
            break;
        }
        push(t);
    }
}

/// Sorted times of 0, all corners and `until`; corners closer than rounding apart become one.
pub fn merge_corners(mut corners: Vec<f64>, until: f64) -> Vec<f64> {
    corners.retain(|t| t.is_finite() && *t > 0.0 && *t < until);
    corners.sort_by(f64::total_cmp);
    let near = 1e-13 * until;
    let mut merged = vec![0.0];
    for t in corners {
        if t - merged[merged.len() - 1] > near && until - t > near {
            merged.push(t);
        }
    }
    merged.push(until);
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_has_its_later_value_after_and_its_earlier_value_before() {
        let step = Wave::Step { at: 1.0, before: 2.0, after: 5.0 };
        assert_eq!(step.value(1.0, 0.5), 2.0);
        assert_eq!(step.value(1.0, 1.5), 5.0);
        let pwl = Wave::Pwl(vec![(0.0, 0.0), (1.0, 1.0), (1.0, 3.0), (2.0, 3.0)]);
        assert_eq!(pwl.value(1.0, 0.5), 1.0);
        assert_eq!(pwl.value(1.0, 1.5), 3.0);
        assert_eq!(pwl.value(9.0, 9.0), 3.0);
    }

    #[test]
    fn a_pulse_train_has_four_corners_a_period_and_equal_ones_merge() {
        let pulse = Wave::Pulse {
            low: 0.0,
            high: 1.0,
            delay: 0.0,
            rise: 0.0,
            fall: 0.0,
            width: 0.4,
            period: 1.0,
        };
        let mut corners = vec![];
        pulse.corners(3.0, &mut corners);
        let corners = merge_corners(corners, 3.0);
        let expected = [0.0, 0.4, 1.0, 1.4, 2.0, 2.4, 3.0];
        assert_eq!(corners.len(), expected.len());
        assert!(corners.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15));
        assert_eq!(pulse.value(1.0, 0.9), 0.0);
        assert_eq!(pulse.value(1.0, 1.1), 1.0);
        assert_eq!(pulse.value(2.4, 2.3), 1.0);
        assert_eq!(pulse.value(2.4, 2.5), 0.0);
    }

    #[test]
    fn a_sine_waits_at_the_value_it_starts_with() {
        let sine = Wave::Sine {
            offset: 1.0,
            amplitude: 2.0,
            frequency: 0.5,
            delay: 1.0,
            damping: 0.0,
            phase: std::f64::consts::FRAC_PI_2,
        };
        assert_eq!(sine.value(0.3, 0.5), 3.0);
        assert!((sine.value(2.0, 1.5) - -1.0).abs() < 1e-15);
    }
}
