//! Conditions over time alone: their modes and the times at which they change, known beforehand.
//!
//! Where a − b is constant + slope·t + Σ factor·mode, as in `mod(time, T) < D`, the time of a change is the root of a
//! straight line: it is exact but for rounding, however long the run. Otherwise (`sin(w*time) > 0`) the run is searched
//! on a grid and the change found by bisection to the last bit. All values are those just after their time.

use super::conditions::Question;
use crate::circuit::stamps::{Course, Law, Leaf, Line};
use crate::expr::values::sign;
use crate::expr::{Binary, Dag, NodeId};

/// A condition, or the state of a switch, over time alone.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    question: Question,
    shape: Shape,
}

#[derive(Clone, Debug)]
enum Shape {
    /// constant + slope·t + Σ factor·mode; modes by their place among a network's modes.
    Line { constant: f64, slope: f64, terms: Vec<(u32, f64)> },
    /// Anything else: a and b.
    Curve(Box<[Law; 2]>),
    /// A switch whose control has a course: 1 when that rises through `on`, 0 when it falls through `off`.
    Switch { course: Course, on: f64, off: f64 },
}

/// A change is looked for in so many pieces of a course at once; where there is none, nothing changes at their end.
const PIECES: usize = 100_000;

/// How many intervals a run is searched in for changes that have no closed form.
const GRID: f64 = 16384.0;

/// What is read of a curve exactly on a change is read this part of the run later.
const AFTER: f64 = 1e-12;

impl Clock {
    /// The clock of a condition with the guards `a` and `b`, `trees` in the law. `time` is the input that time is; the
    /// modes follow it.
    pub fn new(
        question: Question,
        guards: &mut Dag,
        [a, b]: [NodeId; 2],
        trees: [Law; 2],
        time: u32,
    ) -> Clock {
        let difference = guards.binary(Binary::Subtract, a, b);
        let shape = match guards.affine(difference) {
            Some((constant, factors)) => {
                let slope = factors.iter().find(|(k, _)| *k == time).map_or(0.0, |(_, f)| *f);
                let modes = factors.iter().filter(|(k, _)| *k > time);
                let terms = modes.map(|(k, f)| (k - time - 1, *f)).collect();
                Shape::Line { constant, slope, terms }
            }
            None => Shape::Curve(Box::new(trees)),
        };
        Clock { question, shape }
    }

    /// That of a switch.
    pub fn of_switch(course: Course, on: f64, off: f64) -> Clock {
        Clock { question: Question::Side, shape: Shape::Switch { course, on, off } }
    }

    /// Whether its changes are searched for, and do not depend on other modes.
    pub fn is_searched(&self) -> bool {
        matches!(self.shape, Shape::Curve(_) | Shape::Switch { .. })
    }

    /// Its mode just after `t`, where it is `before` just before.
    pub fn value(&self, t: f64, before: f64, modes: &[f64], stop: f64) -> f64 {
        match &self.shape {
            Shape::Switch { course, on, off } => switched(&course.line(t), [*on, *off], before),
            Shape::Line { constant, slope, terms } => {
                let (mut at, mut size) = (constant + slope * t, constant.abs());
                size += (slope * t).abs();
                for (k, factor) in terms {
                    let term = factor * modes.get(*k as usize).copied().unwrap_or(0.0);
                    at += term;
                    size += term.abs();
                }
                self.of_line(at, 8.0 * f64::EPSILON * size, *slope)
            }
            Shape::Curve(guards) => {
                let now = self.of_curve(guards, t);
                if now == 0.0 { self.of_curve(guards, t + AFTER * stop) } else { now }
            }
        }
    }

    /// The time after `t` at which the mode changes from `value`; infinite when it does not.
    pub fn next(&self, t: f64, value: f64, modes: &[f64], stop: f64) -> f64 {
        let next = match &self.shape {
            Shape::Line { slope: 0.0, .. } => f64::INFINITY,
            Shape::Line { constant, slope, terms } => {
                let term = |(k, factor): &(u32, f64)| {
                    factor * modes.get(*k as usize).copied().unwrap_or(0.0)
                };
                let offset = constant + terms.iter().map(term).sum::<f64>();
                let edge = match self.question {
                    Question::Side => 0.0,
                    Question::Cell if *slope > 0.0 => value + 1.0,
                    Question::Cell => value,
                };
                (edge - offset) / slope
            }
            Shape::Curve(guards) => self.search(guards, t, value, stop),
            Shape::Switch { course, on, off } => next_switched(course, [*on, *off], t, value, stop),
        };
        if next > t { next } else { f64::INFINITY }
    }

    /// The mode where the line stands at `at`, give or take `rounding`, and goes on with its slope.
    fn of_line(&self, at: f64, rounding: f64, slope: f64) -> f64 {
        match self.question {
            Question::Side if at.abs() <= rounding => sign(slope),
            Question::Side => sign(at),
            Question::Cell if (at - at.round()).abs() <= rounding => {
                if slope < 0.0 {
                    at.round() - 1.0
                } else {
                    at.round()
                }
            }
            Question::Cell => at.floor(),
        }
    }

    fn of_curve(&self, [a, b]: &[Law; 2], t: f64) -> f64 {
        let at = |law: &Law| {
            law.evaluate(&mut |leaf| if matches!(leaf, Leaf::Time) { t } else { f64::NAN })
        };
        let value = match self.question {
            Question::Side => sign(at(a) - at(b)),
            Question::Cell => at(a).floor(),
        };
        // What is no number is for the laws to say.
        if value.is_nan() { 0.0 } else { value }
    }

    fn search(&self, guards: &[Law; 2], t: f64, value: f64, stop: f64) -> f64 {
        // Away from round fractions of the run, where changes are wont to be.
        let place = |i: f64| stop * (i + 0.382) / GRID;
        let mut i = (t / stop * GRID - 0.382).floor() + 1.0;
        let mut left = t;
        while left < stop {
            let right = place(i).min(stop);
            if right > left && self.of_curve(guards, right) != value {
                let (mut a, mut b) = (left, right);
                loop {
                    let middle = 0.5 * (a + b);
                    if middle <= a || middle >= b {
                        return b;
                    }
                    if self.of_curve(guards, middle) == value { a = middle } else { b = middle }
                }
            }
            left = left.max(right);
            i += 1.0;
        }
        f64::INFINITY
    }
}

/// The state of a switch at the beginning of a line.
fn switched(line: &Line, [on, off]: [f64; 2], before: f64) -> f64 {
    let past = |edge: f64, way: f64| {
        let by = way * (line.value - edge);
        by > line.rounding || (by >= -line.rounding && way * line.slope > 0.0)
    };
    match before > 0.5 {
        true if past(off, -1.0) => 0.0,
        false if past(on, 1.0) => 1.0,
        _ => before,
    }
}

/// The time after `t` at which a switch changes.
fn next_switched(course: &Course, [on, off]: [f64; 2], t: f64, value: f64, stop: f64) -> f64 {
    let (edge, way) = if value > 0.5 { (off, -1.0) } else { (on, 1.0) };
    let mut at = t;
    for _ in 0..PIECES {
        let line = course.line(at);
        if at > t && switched(&line, [on, off], value) != value {
            return at;
        }
        if way * line.slope > 0.0 {
            let root = at + (edge - line.value) / line.slope;
            if root > at && root < line.end {
                return root;
            }
        }
        if !(line.end > at && line.end < stop) {
            return f64::INFINITY;
        }
        at = line.end;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::Waveform;

    fn pulse(rise: f64, fall: f64) -> Waveform {
        let (low, high, delay, width, period) = (0.0, 5.0, 1.0, 2.0, 8.0);
        Waveform::Pulse { low, high, delay, rise, fall, width, period }
    }

    /// The changes up to `stop`: times, and values from then on.
    fn changes(terms: Vec<(f64, Waveform)>, [on, off]: [f64; 2], stop: f64) -> Vec<(f64, f64)> {
        let clock = Clock::of_switch(Course { constant: 0.0, terms }, on, off);
        let mut value = clock.value(0.0, 0.0, &[], stop);
        let (mut t, mut found) = (0.0, vec![]);
        loop {
            t = clock.next(t, value, &[], stop);
            if t >= stop {
                return found;
            }
            let after = clock.value(t, value, &[], stop);
            if after != value {
                found.push((t, after));
            }
            value = after;
        }
    }

    #[test]
    fn a_switch_changes_where_its_course_crosses_each_threshold() {
        // 2.6 of 5 is reached after 0.52 of the rise, 2.4 after 0.52 of the fall.
        let found = changes(vec![(1.0, pulse(1.0, 1.0))], [2.6, 2.4], 16.0);
        let expected = [(1.52, 1.0), (4.52, 0.0), (9.52, 1.0), (12.52, 0.0)];
        assert_eq!(found.len(), expected.len());
        for ((t, value), (expected, state)) in found.into_iter().zip(expected) {
            assert!((t - expected).abs() < 1e-14 && value == state, "{t} for {expected}");
        }
    }

    #[test]
    fn jumps_change_it_at_once_and_what_stays_between_the_thresholds_does_not() {
        assert_eq!(
            changes(vec![(1.0, pulse(0.0, 0.0))], [2.6, 2.4], 8.0),
            [(1.0, 1.0), (3.0, 0.0)]
        );
        assert_eq!(changes(vec![(0.5, pulse(1.0, 1.0))], [2.6, 2.4], 80.0), []);
        // The fall ends at the lower threshold: that is not past it.
        let saw = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 4.0), (2.0, 2.0), (3.0, 4.0), (4.0, 1.0)]);
        let found = changes(vec![(1.0, saw)], [3.0, 2.0], 5.0);
        assert_eq!(found.iter().map(|(_, value)| *value).collect::<Vec<_>>(), [1.0, 0.0]);
        assert!((found[1].0 - (3.0 + 2.0 / 3.0)).abs() < 1e-15);
    }

    #[test]
    fn a_sum_of_sources_has_the_corners_of_all() {
        let ramp = Waveform::Pwl(vec![(0.0, 0.0), (8.0, -2.0)]);
        let found = changes(vec![(1.0, pulse(1.0, 1.0)), (1.0, ramp)], [2.5, 2.5], 8.0);
        // 5·(t − 1) − t/4 = 2.5 and 5 − 5·(t − 4) − t/4 = 2.5
        let expected = [7.5 / 4.75, 22.5 / 5.25];
        assert_eq!(found.len(), 2);
        assert!(found.iter().zip(expected).all(|((t, _), at)| (t - at).abs() < 1e-14), "{found:?}");
    }
}
