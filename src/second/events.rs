//! Events of the second route: conditions that follow from the unknowns are held during a step.
//!
//! The collocation polynomial of each step is searched for the first crossing, the step is taken again to the root
//! until it ends there to rounding, then the condition changes and efforts and flows are found anew. A condition that
//! comes back from nowhere again and again becomes a ramp, until the solution leaves it. Kinks are events like jumps.

use super::radau::{Step, Verdict};
use crate::bond::consistent::{self, Trouble};
use crate::bond::equations::{Compiled, Question};
use crate::bond::structure::Structure;

/// A crossing is found to this part of the range that its guard has run through.
const LOCATED: f64 = 1e-11;
/// The width of a ramp in the same parts.
const RAMP: f64 = 1e-7;
/// Errors of a guard by this part of what is allowed to the unknowns are none.
const NOISE: f64 = 1e-3;
/// How often a ramp is made four times as wide, at most.
const WIDENED: i32 = 8;
/// How often a condition comes back at once before it becomes a ramp.
const RETURNS: u32 = 3;
/// Intervals in which a step is searched.
const PIECES: usize = 12;
/// Steps are taken again this often at most.
const TRIES: u32 = 12;

/// One condition.
#[derive(Clone, Debug)]
struct State {
    question: Question,
    /// −1, 0, 1 for the side of a − b; of a floor its value.
    mode: f64,
    /// Not 0 on a ramp.
    slope: f64,
    /// Where the ramp or the last crossing is.
    edge: f64,
    low: f64,
    high: f64,
    size: f64,
    /// What the errors that are allowed make of it, and the least width of a ramp: what the law makes of the rounding of
    /// the unknowns on it must stay below what is allowed.
    noise: f64,
    least: f64,
    /// How often its ramp has been made wider.
    widened: i32,
    away: f64,
    returns: u32,
}

/// All conditions of a run.
#[derive(Clone, Debug)]
pub struct Conditions {
    states: Vec<State>,
    values: Vec<f64>,
    point: Vec<f64>,
    until: f64,
    /// The condition that the present step is to end on, and how often it has been taken.
    target: Option<usize>,
    tries: u32,
    /// Events so far.
    pub events: usize,
    /// Whether conditions are let go because a branch has no values past its threshold.
    pub loose: bool,
}

impl State {
    fn distance(&self, a: f64, b: f64) -> f64 {
        match self.question {
            Question::Floor | Question::Sign => a,
            Question::Compare(_) => a - b,
        }
    }

    /// What the guard says.
    fn answer(&self, a: f64, b: f64) -> f64 {
        match self.question {
            Question::Floor => a.floor(),
            _ => crate::expr::values::sign(self.distance(a, b)),
        }
    }

    /// The value of the operation in its mode.
    fn value(&self) -> f64 {
        match self.question {
            Question::Compare(op) => op.value(self.mode, 0.0),
            _ => self.mode,
        }
    }

    fn room(&self) -> f64 {
        let spread = (self.high - self.low).max(0.0);
        let spread = if self.question == Question::Floor { spread.min(1.0) } else { spread };
        (LOCATED * spread).max(16.0 * f64::EPSILON * self.size).max(NOISE * self.noise)
    }

    /// How far the guard is past the threshold of its mode.
    fn excess(&self, a: f64, b: f64) -> f64 {
        let at = self.distance(a, b);
        if self.slope != 0.0 {
            return (at - self.edge).abs() - 1.0 / self.slope;
        }
        match self.question {
            Question::Floor => (at - (self.mode + 1.0)).max(self.mode - at),
            _ if self.mode == 0.0 => at.abs() - self.room(),
            _ => -self.mode * at,
        }
    }

    fn see(&mut self, a: f64, b: f64) {
        let at = self.distance(a, b);
        self.low = self.low.min(at);
        self.high = self.high.max(at);
        self.size = self.size.max(a.abs()).max(b.abs());
        self.away = self.away.max((at - self.edge).abs());
    }

    /// Changes the mode; a condition that has come back at once too often becomes a ramp.
    fn cross(&mut self, a: f64, b: f64) {
        let at = self.distance(a, b);
        if self.slope != 0.0 {
            (self.slope, self.mode) = (0.0, self.answer(a, b));
            return;
        }
        let before = self.mode;
        self.mode = match self.question {
            Question::Floor if at > before + 0.5 => before + 1.0,
            Question::Floor => before - 1.0,
            _ if before == 0.0 => crate::expr::values::sign(at),
            _ => -before,
        };
        let edge = if self.question == Question::Floor { before.max(self.mode) } else { 0.0 };
        let near = 16.0 * self.room().max((at - edge).abs());
        self.returns = if self.edge == edge && self.away <= near { self.returns + 1 } else { 0 };
        (self.edge, self.away) = (edge, 0.0);
        if self.returns >= RETURNS {
            self.ramp(edge);
        }
    }

    fn ramp(&mut self, edge: f64) {
        let spread = (self.high - self.low).max(1e-3 * self.size);
        let width = (RAMP * spread).max(self.least).max(f64::MIN_POSITIVE * 1e16);
        let width = width * 4f64.powi(self.widened);
        (self.edge, self.slope, self.returns) = (edge, 1.0 / width, 0);
        if self.question == Question::Floor {
            self.mode = edge;
        }
    }
}

impl Conditions {
    /// Those of the equations, as they stand at the start of a run until a time.
    pub fn new(compiled: &mut Compiled, until: f64, inside: f64, y: &[f64]) -> Conditions {
        let questions = compiled.conditions().to_vec();
        let state = |question: &Question| State {
            question: *question,
            mode: 0.0,
            slope: 0.0,
            edge: f64::INFINITY,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            size: 0.0,
            noise: 0.0,
            least: 0.0,
            widened: 0,
            away: 0.0,
            returns: 0,
        };
        let mut all = Conditions {
            states: questions.iter().map(state).collect(),
            values: vec![0.0; 2 * questions.len()],
            point: vec![0.0; y.len()],
            until,
            target: None,
            tries: 0,
            events: 0,
            loose: false,
        };
        all.hold_as_they_stand(compiled, 0.0, inside, y);
        all
    }

    /// The side that a condition is on: −1, 0, 1.
    pub fn mode(&self, condition: usize) -> f64 {
        self.states.get(condition).map_or(0.0, |state| state.mode)
    }

    /// Knows the ranges that guards have run through in another run.
    pub fn learn(&mut self, other: &Conditions) {
        for (state, known) in self.states.iter_mut().zip(&other.states) {
            (state.low, state.high) = (known.low, known.high);
            state.size = known.size;
        }
    }

    /// Works out what errors as large as `allowed`, in parts of the unknowns `tolerance`, make of the guards.
    pub fn see_noise(
        &mut self,
        compiled: &mut Compiled,
        [t, inside]: [f64; 2],
        y: &[f64],
        allowed: &[f64],
        tolerance: f64,
    ) {
        let rounding = (f64::EPSILON / (tolerance * tolerance)).clamp(1.0, 1e2);
        let mut seed = 0x9e37_79b9_7f4a_7c15;
        let mut moved = self.values.clone();
        compiled.guards(t, inside, y, &mut self.values);
        self.states.iter_mut().for_each(|state| state.noise = 0.0);
        for _ in 0..4 {
            for ((point, y), error) in self.point.iter_mut().zip(y).zip(allowed) {
                let error = if error.is_finite() { *error } else { 0.0 };
                *point = y + error * consistent::random_sign(&mut seed);
            }
            compiled.guards(t, inside, &self.point, &mut moved);
            for (k, state) in self.states.iter_mut().enumerate() {
                let at = |values: &[f64]| state.distance(values[2 * k], values[2 * k + 1]);
                let change = (at(&moved) - at(&self.values)).abs();
                if change.is_finite() {
                    state.noise = state.noise.max(change);
                    state.least = rounding * state.noise;
                }
            }
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Holds all at what their guards say; conditions within others follow first.
    pub fn hold_as_they_stand(&mut self, compiled: &mut Compiled, t: f64, inside: f64, y: &[f64]) {
        self.loose = false;
        for k in 0..self.states.len() {
            compiled.guards(t, inside, y, &mut self.values);
            let (a, b) = (self.values[2 * k], self.values[2 * k + 1]);
            let state = &mut self.states[k];
            state.see(a, b);
            if state.slope == 0.0 {
                state.mode = state.answer(a, b);
            }
            compiled.hold(k, state.value(), state.slope);
        }
    }

    /// Makes the ramps that the solution is on wider, where steps have become too small on them: what the law makes of
    /// rounding is then more than is allowed. Says whether there are any.
    pub fn widen(&mut self, compiled: &mut Compiled) -> bool {
        let mut any = false;
        for (k, state) in self.states.iter_mut().enumerate() {
            if state.slope != 0.0 && state.widened < WIDENED {
                state.widened += 1;
                state.slope *= 0.25;
                compiled.hold(k, state.value(), state.slope);
                any = true;
            }
        }
        (self.target, self.tries) = (None, 0);
        any
    }

    /// Whether a condition that is held stands on its threshold, and makes it the one to change.
    pub fn stands_on_threshold(
        &mut self,
        compiled: &mut Compiled,
        [t, inside]: [f64; 2],
        y: &[f64],
    ) -> bool {
        if self.loose {
            return false;
        }
        compiled.guards(t, inside, y, &mut self.values);
        self.target = self.states.iter().enumerate().position(|(k, state)| {
            let excess = state.excess(self.values[2 * k], self.values[2 * k + 1]);
            state.slope == 0.0 && excess.abs() <= 16.0 * state.room()
        });
        self.tries = 0;
        self.target.is_some()
    }

    /// Lets all go.
    pub fn let_go(&mut self, compiled: &mut Compiled) {
        self.loose = true;
        (self.target, self.tries) = (None, 0);
        for (k, state) in self.states.iter().enumerate() {
            compiled.hold(k, f64::NAN, state.slope);
        }
    }

    /// Looks for the first crossing within a step.
    pub fn judge(&mut self, compiled: &mut Compiled, step: &Step, inside: f64) -> Verdict {
        if self.states.is_empty() {
            return Verdict::Keep;
        }
        if self.loose {
            // Beyond the threshold there is another branch: hold that.
            step.at(step.t + step.h, &mut self.point);
            let crossed = (0..self.states.len()).any(|k| {
                let excess = self.excess(compiled, k, step.t + step.h, inside);
                excess > self.states[k].room()
            });
            return if crossed { Verdict::End } else { Verdict::Keep };
        }
        let first = self.first_crossing(compiled, step, inside);
        let Some((k, part)) = first else {
            if let Some(k) = self.target {
                // The step ends just before the threshold, or on it.
                let excess = self.at(compiled, k, step, 1.0, inside);
                if excess >= -self.states[k].room() || self.tries > TRIES {
                    self.see_middle(compiled, k, step, inside);
                    return Verdict::End;
                }
            }
            self.target = None;
            self.tries = 0;
            self.see(compiled, step, inside);
            return Verdict::Keep;
        };
        let past = self.at(compiled, k, step, 1.0, inside);
        let close = past >= 0.0 && past <= self.states[k].room();
        let smallest = 8.0 * f64::EPSILON * self.until;
        self.target = Some(k);
        if close || self.tries > TRIES || step.h <= smallest {
            self.see_middle(compiled, k, step, inside);
            return Verdict::End;
        }
        self.tries += 1;
        Verdict::Again((part * step.h).max(smallest))
    }

    /// How far a guard is past its threshold at a part of a step.
    fn at(
        &mut self,
        compiled: &mut Compiled,
        k: usize,
        step: &Step,
        part: f64,
        inside: f64,
    ) -> f64 {
        let t = step.t + part * step.h;
        if part == 0.0 {
            self.point.copy_from_slice(step.start);
        } else {
            step.at(t, &mut self.point);
        }
        self.excess(compiled, k, t, inside)
    }

    fn excess(&mut self, compiled: &mut Compiled, k: usize, t: f64, inside: f64) -> f64 {
        compiled.guards(t, inside, &self.point, &mut self.values);
        self.states[k].excess(self.values[2 * k], self.values[2 * k + 1])
    }

    /// How far a guard has been away in the middle of a step that ends on its threshold.
    fn see_middle(&mut self, compiled: &mut Compiled, k: usize, step: &Step, inside: f64) {
        self.at(compiled, k, step, 0.5, inside);
        self.states[k].see(self.values[2 * k], self.values[2 * k + 1]);
    }

    fn see(&mut self, compiled: &mut Compiled, step: &Step, inside: f64) {
        step.at(step.t + step.h, &mut self.point);
        compiled.guards(step.t + step.h, inside, &self.point, &mut self.values);
        for (k, state) in self.states.iter_mut().enumerate() {
            state.see(self.values[2 * k], self.values[2 * k + 1]);
        }
    }

    /// The condition that crosses first, and the part of the step at which it is past its threshold.
    fn first_crossing(
        &mut self,
        compiled: &mut Compiled,
        step: &Step,
        inside: f64,
    ) -> Option<(usize, f64)> {
        let mut first: Option<(usize, f64)> = None;
        let count = self.states.len();
        for piece in 1..=PIECES {
            let part = piece as f64 / PIECES as f64;
            if first.is_some() {
                break;
            }
            let t = step.t + part * step.h;
            step.at(t, &mut self.point);
            compiled.guards(t, inside, &self.point, &mut self.values);
            let past: Vec<usize> = (0..count)
                .filter(|k| {
                    let excess = self.states[*k].excess(self.values[2 * k], self.values[2 * k + 1]);
                    excess > self.states[*k].room()
                })
                .collect();
            for k in past {
                let (mut low, mut high) = ((piece - 1) as f64 / PIECES as f64, part);
                if self.at(compiled, k, step, low, inside) > 0.0 {
                    high = low;
                }
                while high - low > 1e-16 {
                    let middle = 0.5 * (low + high);
                    if middle <= low || middle >= high {
                        break;
                    }
                    if self.at(compiled, k, step, middle, inside) > 0.0 {
                        high = middle;
                    } else {
                        low = middle;
                    }
                }
                if first.is_none_or(|(_, earliest)| high < earliest) {
                    first = Some((k, high));
                }
            }
        }
        first
    }

    /// After a step that ended on a threshold: changes the condition and finds everything else anew, until nothing
    /// contradicts itself.
    #[allow(clippy::too_many_arguments)]
    pub fn pass(
        &mut self,
        compiled: &mut Compiled,
        structure: &Structure,
        t: f64,
        [from, to]: [f64; 2],
        y: &mut [f64],
    ) -> Result<(), Trouble> {
        let inside = 0.5 * (from + to);
        if self.loose {
            self.hold_as_they_stand(compiled, t, inside, y);
        }
        if let Some(k) = self.target.take() {
            compiled.guards(t, inside, y, &mut self.values);
            self.events += 1;
            let (a, b) = (self.values[2 * k], self.values[2 * k + 1]);
            self.states[k].cross(a, b);
            compiled.hold(k, self.states[k].value(), self.states[k].slope);
        }
        self.tries = 0;
        self.settle(compiled, structure, t, [from, to], y)
    }

    /// Efforts and flows with the conditions that agree with them.
    pub fn settle(
        &mut self,
        compiled: &mut Compiled,
        structure: &Structure,
        t: f64,
        [from, to]: [f64; 2],
        y: &mut [f64],
    ) -> Result<(), Trouble> {
        let inside = 0.5 * (from + to);
        let count = self.states.len();
        for round in 0..4 * count + 1 {
            consistent::settle(compiled, structure, t, inside, to - t, y)?;
            let before = self.values.clone();
            compiled.guards(t, inside, y, &mut self.values);
            let worst = (0..count)
                .filter(|k| self.states[*k].slope == 0.0)
                .map(|k| (k, self.contradiction(k, &before)))
                .filter(|(_, by)| *by > 0.0)
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((k, _)) = worst else { return Ok(()) };
            let (a, b) = (self.values[2 * k], self.values[2 * k + 1]);
            let state = &mut self.states[k];
            self.events += 1;
            if round >= 2 * count {
                // No side agrees: a ramp, from wide to narrow.
                let edge = if state.question == Question::Floor { a.round() } else { 0.0 };
                state.size = state.size.max(a.abs()).max(b.abs());
                state.ramp(edge);
                let narrow = state.slope;
                for wider in (0..=7).rev() {
                    let slope = narrow * 10f64.powi(-wider);
                    compiled.hold(k, self.states[k].value(), slope);
                    consistent::settle(compiled, structure, t, inside, to - t, y)?;
                }
            } else {
                state.mode = state.answer(a, b);
                (state.edge, state.away) = (f64::INFINITY, 0.0);
            }
            let state = &self.states[k];
            compiled.hold(k, state.value(), state.slope);
        }
        Ok(())
    }

    /// By how much a condition's guard contradicts its mode, in parts of its room; also where it has jumped onto its
    /// threshold.
    fn contradiction(&self, k: usize, before: &[f64]) -> f64 {
        let state = &self.states[k];
        let (a, b) = (self.values[2 * k], self.values[2 * k + 1]);
        let room = state.room().max(16.0 * f64::EPSILON * a.abs().max(b.abs()));
        let by = state.excess(a, b);
        if by > 4.0 * room {
            return by / room.max(f64::MIN_POSITIVE);
        }
        let was = state.distance(before[2 * k], before[2 * k + 1]);
        let at = state.distance(a, b);
        let edge = if state.question == Question::Floor { at.round() } else { 0.0 };
        let jumped = (was - edge).abs() > 1e-6 * a.abs().max(b.abs()).max(1e3 * room);
        let lands = (at - edge).abs() <= 16.0 * f64::EPSILON * a.abs().max(b.abs());
        if jumped && lands && state.answer(a, b) != state.mode { 1.0 } else { 0.0 }
    }
}
