//! Functions of time of independent sources, as numbers.
//!
//! A waveform is a chain of smooth segments that meet at corners. A step of an integrator takes the segment of its
//! left end and evaluates that throughout, its right end included, so that no stage sees what comes after a corner:
//! [`Waveform::segment`] is right-continuous, [`Waveform::segment_before`] is its left limit.

use std::f64::consts::PI;

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
    /// SPICE's AM(va vo mf fc td): va·(vo + sin(2π·mf·(t − td)))·sin(2π·fc·(t − td)), 0 before td.
    Am {
        amplitude: f64,
        offset: f64,
        signal: f64,
        carrier: f64,
        delay: f64,
    },
    /// Straight lines between (t, y) until `end`, then those from `from` to `end` again and again. `from` is the time of a
    /// point, `end` that of the last one.
    Repeating {
        points: Vec<(f64, f64)>,
        from: f64,
        end: f64,
    },
}

impl Waveform {
    /// The segment that holds just after `t`.
    pub fn segment(&self, t: f64) -> Segment {
        self.piece(t, false)
    }

    /// The segment that holds just before `t`.
    pub fn segment_before(&self, t: f64) -> Segment {
        self.piece(t, true)
    }

    /// The value at `t`; at a jump the later one.
    pub fn value(&self, t: f64) -> f64 {
        self.segment(t).value(t)
    }

    /// The value just before `t`; at a jump the earlier one.
    pub fn value_before(&self, t: f64) -> f64 {
        self.segment_before(t).value(t)
    }

    /// The slope just after `t`.
    pub fn derivative(&self, t: f64) -> f64 {
        self.segment(t).derivative(t)
    }

    /// The first corner after `t`, where value or slope may jump; infinite when there is none.
    pub fn next_corner(&self, t: f64) -> f64 {
        self.segment(t).end
    }

    /// The corners in `from < t <= to`, in order.
    pub fn corners(&self, from: f64, to: f64) -> impl Iterator<Item = f64> + '_ {
        let first = self.next_corner(from);
        std::iter::successors(Some(first), |t| Some(self.next_corner(*t)))
            .take_while(move |t| *t <= to)
    }

    /// Whether it never changes.
    pub fn is_constant(&self) -> bool {
        match self {
            Waveform::Constant(_) => true,
            Waveform::Pulse { low, high, .. } => low == high,
            Waveform::Sine { amplitude, .. } | Waveform::Sffm { amplitude, .. } => {
                *amplitude == 0.0
            }
            Waveform::Pwl(points) | Waveform::Repeating { points, .. } => {
                points.windows(2).all(|pair| pair[0].1 == pair[1].1)
            }
            Waveform::Am { amplitude, .. } => *amplitude == 0.0,
            Waveform::Exponential { from, to, .. } => from == to,
        }
    }

    /// The piece that holds at `t`: right of a corner, or left of it with `left`.
    fn piece(&self, t: f64, left: bool) -> Segment {
        let reached = |corner: f64| if left { corner < t } else { corner <= t };
        match self {
            Waveform::Constant(value) => {
                Segment::constant(f64::NEG_INFINITY, f64::INFINITY, *value)
            }
            Waveform::Pulse { low, high, delay, rise, fall, width, period } => {
                if !reached(*delay) {
                    return Segment::constant(f64::NEG_INFINITY, *delay, *low);
                }
                let repeats = *period > 0.0 && period.is_finite();
                // Corners are always computed by this one formula, so that a step that landed on one is exactly on it.
                let base =
                    |cycle: f64| if cycle == 0.0 { *delay } else { *delay + cycle * *period };
                let mut cycle = 0.0;
                if repeats {
                    cycle = ((t - *delay) / *period).floor().max(0.0);
                    if !reached(base(cycle)) && cycle > 0.0 {
                        cycle -= 1.0;
                    }
                    if reached(base(cycle + 1.0)) {
                        cycle += 1.0;
                    }
                }
                let start = base(cycle);
                let next = if repeats { base(cycle + 1.0) } else { f64::INFINITY };
                let top = start + rise;
                let turn = top + width;
                let bottom = turn + fall;
                let corners = [start, top, turn, bottom, next];
                let stage = corners[..4].iter().rposition(|c| reached(*c)).unwrap_or(0);
                let end = corners[stage + 1..].iter().copied().fold(next, f64::min);
                // Where the period is shorter than the rounding of t, still move on.
                let end = if end > t || (left && end >= t) { end } else { t.next_up() };
                let shape = match stage {
                    0 => Shape::Line { t0: start, y0: *low, t1: top, y1: *high },
                    1 => Shape::constant(*high),
                    2 => Shape::Line { t0: turn, y0: *high, t1: bottom, y1: *low },
                    _ => Shape::constant(*low),
                };
                Segment { start: corners[stage], end, shape }
            }
            Waveform::Sine { offset, amplitude, frequency, delay, damping, phase } => {
                if !reached(*delay) {
                    let value = offset + amplitude * libm::sin(*phase);
                    return Segment::constant(f64::NEG_INFINITY, *delay, value);
                }
                let shape = Shape::Sine {
                    offset: *offset,
                    amplitude: *amplitude,
                    omega: 2.0 * PI * frequency,
                    phase: *phase,
                    damping: *damping,
                    delay: *delay,
                };
                Segment { start: *delay, end: f64::INFINITY, shape }
            }
            Waveform::Pwl(points) => between(points, &reached),
            Waveform::Am { amplitude, offset, signal, carrier, delay } => {
                if !reached(*delay) {
                    return Segment::constant(f64::NEG_INFINITY, *delay, 0.0);
                }
                let shape = Shape::Am {
                    amplitude: *amplitude,
                    offset: *offset,
                    signal: 2.0 * PI * signal,
                    carrier: 2.0 * PI * carrier,
                    delay: *delay,
                };
                Segment { start: *delay, end: f64::INFINITY, shape }
            }
            Waveform::Repeating { points, from, end } => {
                if !reached(*end) {
                    return between(points, &reached);
                }
                // Corners are always computed by this one formula, so that a step that landed on one is exactly on it.
                let period = end - from;
                let shift = |round: f64| round * period;
                let mut round = ((t - end) / period).floor().max(0.0) + 1.0;
                if !reached(end + shift(round - 1.0)) && round > 1.0 {
                    round -= 1.0;
                }
                if reached(end + shift(round)) {
                    round += 1.0;
                }
                let shift = shift(round);
                let first = points.partition_point(|(time, _)| time < from);
                // At `from` itself the later of two values holds, as after any jump.
                let mut piece = between(&points[first..], &|corner| reached(corner + shift));
                piece.shape = piece.shape.later(shift);
                piece.start += shift;
                piece.end += shift;
                // Where the period is shorter than the rounding of t, still move on.
                if !(piece.end > t || (left && piece.end >= t)) {
                    piece.end = t.next_up();
                }
                piece
            }
            Waveform::Exponential { from, to, rise_delay, rise_tau, fall_delay, fall_tau } => {
                let rise = Relaxation { by: to - from, after: *rise_delay, tau: *rise_tau };
                let fall = Relaxation { by: from - to, after: *fall_delay, tau: *fall_tau };
                let parts =
                    [reached(*rise_delay).then_some(rise), reached(*fall_delay).then_some(fall)];
                let corners = [f64::NEG_INFINITY, *rise_delay, *fall_delay];
                let passed = corners.iter().copied().filter(|c| reached(*c));
                let ahead = corners.iter().copied().filter(|c| !reached(*c));
                Segment {
                    start: passed.fold(f64::NEG_INFINITY, f64::max),
                    end: ahead.fold(f64::INFINITY, f64::min),
                    shape: Shape::Relaxing { from: *from, parts },
                }
            }
            Waveform::Sffm { offset, amplitude, carrier, index, signal } => Segment {
                start: f64::NEG_INFINITY,
                end: f64::INFINITY,
                shape: Shape::Sffm {
                    offset: *offset,
                    amplitude: *amplitude,
                    carrier: 2.0 * PI * carrier,
                    index: *index,
                    signal: 2.0 * PI * signal,
                },
            },
        }
    }
}

/// The line that holds at a time, of straight lines between points.
fn between(points: &[(f64, f64)], reached: &dyn Fn(f64) -> bool) -> Segment {
    let after = points.partition_point(|(time, _)| reached(*time));
    let before = after.checked_sub(1).and_then(|k| points.get(k));
    match (before, points.get(after)) {
        (Some(&(t0, y0)), Some(&(t1, y1))) => {
            Segment { start: t0, end: t1, shape: Shape::Line { t0, y0, t1, y1 } }
        }
        (None, Some(&(t1, y1))) => Segment::constant(f64::NEG_INFINITY, t1, y1),
        (Some(&(t0, y0)), None) => Segment::constant(t0, f64::INFINITY, y0),
        (None, None) => Segment::constant(f64::NEG_INFINITY, f64::INFINITY, 0.0),
    }
}

/// A smooth piece of a waveform. It may be evaluated anywhere; it is the waveform from `start` to `end`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The corner that it begins at, or −∞.
    pub start: f64,
    /// The corner that it ends at, or ∞.
    pub end: f64,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Line { t0: f64, y0: f64, t1: f64, y1: f64 },
    Sine { offset: f64, amplitude: f64, omega: f64, phase: f64, damping: f64, delay: f64 },
    Relaxing { from: f64, parts: [Option<Relaxation>; 2] },
    Sffm { offset: f64, amplitude: f64, carrier: f64, index: f64, signal: f64 },
    Am { amplitude: f64, offset: f64, signal: f64, carrier: f64, delay: f64 },
}

/// by·(1 − e^(−(t − after)/tau))
#[derive(Clone, Copy, Debug, PartialEq)]
struct Relaxation {
    by: f64,
    after: f64,
    tau: f64,
}

impl Shape {
    fn constant(value: f64) -> Shape {
        Shape::Line { t0: 0.0, y0: value, t1: 1.0, y1: value }
    }

    /// A line that comes later.
    fn later(self, by: f64) -> Shape {
        match self {
            Shape::Line { t0, y0, t1, y1 } => Shape::Line { t0: t0 + by, y0, t1: t1 + by, y1 },
            other => other,
        }
    }
}

impl Segment {
    fn constant(start: f64, end: f64, value: f64) -> Segment {
        Segment { start, end, shape: Shape::constant(value) }
    }

    /// Whether it is a straight line.
    pub fn is_straight(&self) -> bool {
        matches!(self.shape, Shape::Line { .. })
    }

    /// The value where it does not change.
    pub fn unchanging(&self) -> Option<f64> {
        match self.shape {
            Shape::Line { y0, y1, .. } if y0 == y1 => Some(y0),
            _ => None,
        }
    }

    /// The value at `t`.
    pub fn value(&self, t: f64) -> f64 {
        match self.shape {
            // Exact at both ends, so that a corner has one value.
            Shape::Line { t1, y1, .. } if t == t1 => y1,
            Shape::Line { t0, y0, t1, y1 } => {
                if y0 == y1 {
                    y0
                } else {
                    y0 + (y1 - y0) * ((t - t0) / (t1 - t0))
                }
            }
            Shape::Sine { offset, amplitude, omega, phase, damping, delay } => {
                let since = t - delay;
                let swing = amplitude * libm::sin(omega * since + phase);
                offset + if damping == 0.0 { swing } else { swing * libm::exp(-since * damping) }
            }
            Shape::Relaxing { from, parts } => parts.iter().flatten().fold(from, |sum, part| {
                sum + if part.tau > 0.0 {
                    -part.by * libm::expm1(-(t - part.after) / part.tau)
                } else {
                    part.by
                }
            }),
            Shape::Sffm { offset, amplitude, carrier, index, signal } => {
                offset + amplitude * libm::sin(carrier * t + index * libm::sin(signal * t))
            }
            Shape::Am { amplitude, offset, signal, carrier, delay } => {
                let since = t - delay;
                let envelope = offset + libm::sin(signal * since);
                amplitude * envelope * libm::sin(carrier * since)
            }
        }
    }

    /// The slope at `t`.
    pub fn derivative(&self, t: f64) -> f64 {
        match self.shape {
            Shape::Line { t0, y0, t1, y1 } => {
                if y0 == y1 {
                    0.0
                } else {
                    (y1 - y0) / (t1 - t0)
                }
            }
            Shape::Sine { amplitude, omega, phase, damping, delay, .. } => {
                let since = t - delay;
                let (sine, cosine) = libm::sincos(omega * since + phase);
                let decay = if damping == 0.0 { 1.0 } else { libm::exp(-since * damping) };
                amplitude * decay * (omega * cosine - damping * sine)
            }
            Shape::Relaxing { parts, .. } => parts
                .iter()
                .flatten()
                .filter(|part| part.tau > 0.0)
                .map(|part| part.by / part.tau * libm::exp(-(t - part.after) / part.tau))
                .sum(),
            Shape::Sffm { amplitude, carrier, index, signal, .. } => {
                let angle = carrier * t + index * libm::sin(signal * t);
                amplitude * libm::cos(angle) * (carrier + index * signal * libm::cos(signal * t))
            }
            Shape::Am { amplitude, offset, signal, carrier, delay } => {
                let since = t - delay;
                let (sine, cosine) = libm::sincos(carrier * since);
                let (low, low_cosine) = libm::sincos(signal * since);
                amplitude * (signal * low_cosine * sine + carrier * (offset + low) * cosine)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pulse(rise: f64, fall: f64) -> Waveform {
        Waveform::Pulse { low: 1.0, high: 3.0, delay: 0.5, rise, fall, width: 0.25, period: 1.0 }
    }

    #[test]
    fn a_pulse_repeats_and_has_four_corners_a_period() {
        let wave = pulse(0.125, 0.125);
        let expected = [0.5, 0.625, 0.875, 1.0, 1.5, 1.625, 1.875, 2.0];
        assert_eq!(wave.corners(0.0, 2.4).collect::<Vec<_>>(), expected);
        for (t, value) in
            [(0.0, 1.0), (0.5, 1.0), (0.5625, 2.0), (0.7, 3.0), (0.9375, 2.0), (1.2, 1.0)]
        {
            assert_eq!(wave.value(t), value, "at {t}");
            assert_eq!(wave.value(t + 3.0), value, "at {t} + 3");
        }
        assert_eq!(wave.derivative(0.5), 16.0);
        assert_eq!(wave.segment_before(0.5).derivative(0.5), 0.0);
    }

    #[test]
    fn jumps_take_the_later_value_and_know_the_earlier_one() {
        let wave = pulse(0.0, 0.0);
        assert_eq!((wave.value_before(0.5), wave.value(0.5)), (1.0, 3.0));
        assert_eq!((wave.value_before(0.75), wave.value(0.75)), (3.0, 1.0));
        assert_eq!(wave.corners(0.0, 1.6).collect::<Vec<_>>(), [0.5, 0.75, 1.5]);
        let wave = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 2.0), (1.0, -1.0), (2.0, 0.0)]);
        assert_eq!((wave.value_before(1.0), wave.value(1.0)), (2.0, -1.0));
        assert_eq!(wave.segment(0.25).value(1.0), 2.0);
        assert_eq!((wave.value(-5.0), wave.value(9.0), wave.value(1.5)), (0.0, 0.0, -0.5));
        assert_eq!(wave.corners(0.0, 9.0).collect::<Vec<_>>(), [1.0, 2.0]);
    }

    #[test]
    fn a_period_shorter_than_the_pulse_cuts_it_off() {
        let wave = Waveform::Pulse {
            low: 0.0,
            high: 1.0,
            delay: 0.0,
            rise: 1.0,
            fall: 1.0,
            width: 1.0,
            period: 2.5,
        };
        assert_eq!((wave.value_before(2.5), wave.value(2.5)), (0.5, 0.0));
        assert_eq!(wave.corners(0.0, 5.0).collect::<Vec<_>>(), [1.0, 2.0, 2.5, 3.5, 4.5, 5.0]);
    }

    #[test]
    fn sines_wait_for_their_delay() {
        let wave = Waveform::Sine {
            offset: 1.0,
            amplitude: 2.0,
            frequency: 0.25,
            delay: 1.0,
            damping: 0.5,
            phase: PI / 6.0,
        };
        assert!((wave.value(0.0) - 2.0).abs() < 1e-15);
        assert_eq!(wave.next_corner(0.0), 1.0);
        let exact = 1.0 + 2.0 * (PI / 2.0 + PI / 6.0).sin() * (-0.5f64).exp();
        assert!((wave.value(2.0) - exact).abs() < 1e-15);
        assert_eq!(wave.next_corner(1.0), f64::INFINITY);
    }

    #[test]
    fn exponentials_rise_and_fall() {
        let wave = Waveform::Exponential {
            from: 1.0,
            to: 2.0,
            rise_delay: 1.0,
            rise_tau: 0.5,
            fall_delay: 2.0,
            fall_tau: 0.25,
        };
        assert_eq!(wave.value(0.5), 1.0);
        assert!((wave.value(1.5) - (2.0 - (-1.0f64).exp())).abs() < 1e-15);
        let late = 1.0 + (1.0 - (-4.0f64).exp()) - (1.0 - (-4.0f64).exp());
        assert!((wave.value(3.0) - late).abs() < 1e-15);
        assert_eq!(wave.corners(0.0, 9.0).collect::<Vec<_>>(), [1.0, 2.0]);
    }

    #[test]
    fn repeated_lines_go_on_from_where_they_are_told() {
        let points = vec![(0.0, 1.0), (1.0, 2.0), (1.5, 0.0), (2.0, 3.0)];
        let wave = Waveform::Repeating { points, from: 1.0, end: 2.0 };
        assert_eq!((wave.value(0.5), wave.value(1.75)), (1.5, 1.5));
        for round in 0..5 {
            let t = f64::from(round);
            assert_eq!(
                (wave.value(2.0 + t), wave.value(2.25 + t), wave.value(2.75 + t)),
                (2.0, 1.0, 1.5)
            );
            assert_eq!(wave.value_before(3.0 + t), 3.0);
        }
        assert_eq!(wave.corners(0.0, 3.6).collect::<Vec<_>>(), [1.0, 1.5, 2.0, 2.5, 3.0, 3.5]);
    }

    proptest! {
        #[test]
        fn corners_lie_between_smooth_segments(
            delay in 0.0..2.0f64, rise in 0.0..0.5f64, fall in 0.0..0.5f64, width in 0.0..1.0f64,
            period in 0.01..3.0f64, at in 0.0..1000.0f64,
        ) {
            let wave = Waveform::Pulse { low: -1.0, high: 2.0, delay, rise, fall, width, period };
            let corner = wave.next_corner(at);
            prop_assert!(corner > at);
            prop_assert_eq!(wave.segment_before(corner).end, corner);
            prop_assert!(wave.segment(corner).start <= corner);
            prop_assert!(wave.segment(corner).end > corner);
            let middle = 0.5 * (at + corner);
            prop_assert_eq!(wave.segment(at), wave.segment(middle));
        }

        #[test]
        fn slopes_agree_with_differences(which in 0..6usize, t in 0.01..3.0f64) {
            let wave = [
                pulse(0.125, 0.25),
                Waveform::Sine { offset: 0.1, amplitude: 2.0, frequency: 0.7, delay: 0.3, damping: 0.4, phase: 1.0 },
                Waveform::Exponential {
                    from: 0.0, to: 2.0, rise_delay: 0.2, rise_tau: 0.3, fall_delay: 1.0, fall_tau: 0.7,
                },
                Waveform::Sffm { offset: 0.5, amplitude: 1.5, carrier: 1.1, index: 2.0, signal: 0.3 },
                Waveform::Am { amplitude: 1.5, offset: 0.4, signal: 0.3, carrier: 1.1, delay: 0.2 },
                Waveform::Repeating { points: vec![(0.0, 1.0), (0.3, 2.0), (0.8, -1.0)], from: 0.3, end: 0.8 },
            ][which].clone();
            let piece = wave.segment(t);
            let h = 1e-5;
            let difference = (piece.value(t + h) - piece.value(t - h)) / (2.0 * h);
            prop_assert!((piece.derivative(t) - difference).abs() < 1e-6 * (1.0 + difference.abs()));
        }
    }
}
