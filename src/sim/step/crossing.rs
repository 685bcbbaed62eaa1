//! Crossings of thresholds within a step: the step is taken again until it ends on the first of them, then the mode
//! changes.
//!
//! Where guards have crossed is read off the dense output, also between the ends of the step. At the first crossing
//! both branches are evaluated: where no law and no other guard jumps the condition is let go, and error control meets
//! the kink; else the step is redone to the root, which Newton's method corrects at most three times.

use super::Run;
use crate::diagnostic::Diagnostic;
use crate::sim::events::{self, FREE, HELD, LOCATED, RAMPED, Slide};
use crate::sim::explain::{Failure, Moment, failure};
use crate::sim::methods::Method;
use crate::sim::op::Trouble;
use crate::sim::system::Guard;

/// Where within a step guards are looked at.
const PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// So many events within this part of the run are one that never ends.
const CROWD: u32 = 100;
const MOMENT: f64 = 1e-9;

/// One-sided values near a crossing that differ by less than this part are no jump.
const COARSE: f64 = 1e-3;

/// What was found in a step.
pub(super) enum Located {
    Nothing,
    /// The step ends on this mode's threshold.
    Here(usize),
    /// The step's start stands on it, on its way across.
    Now(usize),
    /// Take the step again with this size,
    Redo(f64),
    /// or with the same: a condition has been let go.
    Again,
}

/// So often a condition may turn out to jump and not to jump within one step.
const WAVERING: u32 = 6;

/// The search for a crossing: step sizes and how far past the threshold they ended.
#[derive(Default)]
pub(super) struct Search {
    mode: Option<usize>,
    tries: u32,
    before: (f64, f64),
    after: (f64, f64),
    slope: f64,
    last: Option<(f64, f64)>,
}

/// A guard that has crossed between two parts of the step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossed {
    mode: usize,
    from: f64,
    to: f64,
    /// Where it did.
    root: f64,
}

impl Run<'_> {
    /// Looks for the first crossing of a threshold within the step just tried.
    pub(super) fn locate(&mut self, h: f64, search: &mut Search) -> Located {
        if !self.watches {
            return Located::Nothing;
        }
        self.work.complete(&self.state, &self.next, None);
        let Run { network, next, controls, .. } = self;
        network.controls(&next.x, next.t, &mut controls.right);
        if let Some(mode) = search.mode {
            let other = (0..network.system.modes.len()).any(|other| {
                let (a, b) = events::pair(&controls.right, other);
                other != mode
                    && network.is_watched(other)
                    && network.hold(other) != FREE
                    && network.excess(other, a, b) > network.slack(other, a)
            });
            if !other {
                return self.narrow(mode, h, search);
            }
        }
        self.find_crossings(h);
        while let Some(first) = self.first_crossing() {
            let Crossed { mode, root, .. } = self.crossed[first];
            let ramped = self.network.hold(mode) == RAMPED;
            // One that jumps by about as much as counts may seem to and seem not to, time and again: then it does.
            let wavers = self.network.hold(mode) == HELD && search.tries >= WAVERING;
            if ramped || wavers || self.is_switch(mode) || self.jumps(mode, root, true) {
                if self.network.hold(mode) == FREE {
                    self.network.set_hold(mode, HELD);
                    self.work.linearised = false;
                }
                return self.begin(mode, root, h, search);
            }
            if self.network.hold(mode) == HELD {
                self.network.set_hold(mode, FREE);
                self.work.linearised = false;
                *search = Search { tries: search.tries + 1, ..Search::default() };
                return Located::Again;
            }
            self.crossed.swap_remove(first);
        }
        Located::Nothing
    }

    fn is_switch(&self, mode: usize) -> bool {
        matches!(self.network.system.modes[mode].guard, Guard::Switch { .. })
    }

    /// Collects the guards that have crossed, with the parts of the step between which they did.
    fn find_crossings(&mut self, h: f64) {
        let Run { network, state, next, controls, work, samples, crossed, method, .. } = self;
        // Straight lines tell nothing between their ends.
        let curved = matches!(method, Method::Rodas4 | Method::Rodas5p);
        crossed.clear();
        for (i, theta) in PLACES.iter().enumerate() {
            let values = match i {
                4 => &controls.right,
                0 if curved => &controls.left,
                _ if curved => {
                    work.dense.unknowns(*theta, state, next, &mut work.x);
                    network.controls(&work.x, state.t + theta * h, &mut controls.inside);
                    &controls.inside
                }
                _ => continue,
            };
            for (mode, samples) in samples.iter_mut().enumerate() {
                let (a, b) = events::pair(values, mode);
                samples[i] = network.excess(mode, a, b);
            }
        }
        for (mode, samples) in samples.iter().enumerate() {
            if !network.is_watched(mode) {
                continue;
            }
            let slack = network.slack(mode, controls.right[2 * mode]);
            if !curved {
                if samples[4] > slack {
                    crossed.push(Crossed { mode, from: 0.0, to: 1.0, root: 1.0 });
                }
                continue;
            }
            let past = (1..5).find(|i| samples[*i] > slack);
            if let Some(i) = past {
                crossed.push(Crossed { mode, from: PLACES[i - 1], to: PLACES[i], root: 1.0 });
            } else if let Some((i, theta)) = summit(samples) {
                work.dense.unknowns(theta, state, next, &mut work.x);
                network.controls(&work.x, state.t + theta * h, &mut controls.inside);
                let (a, b) = events::pair(&controls.inside, mode);
                if network.excess(mode, a, b) > slack {
                    crossed.push(Crossed { mode, from: PLACES[i - 1], to: theta, root: 1.0 });
                }
            }
        }
        for found in crossed.iter_mut() {
            let mode = found.mode;
            found.root = root(found.from, found.to, |theta| {
                work.dense.unknowns(theta, state, next, &mut work.x);
                network.controls(&work.x, state.t + theta * h, &mut controls.inside);
                let (a, b) = events::pair(&controls.inside, mode);
                network.excess(mode, a, b)
            });
        }
    }

    fn first_crossing(&self) -> Option<usize> {
        let crossed = self.crossed.iter().enumerate();
        crossed.min_by(|a, b| a.1.root.total_cmp(&b.1.root)).map(|(first, _)| first)
    }

    /// Begins to narrow a crossing down.
    fn begin(&mut self, mode: usize, theta: f64, h: f64, search: &mut Search) -> Located {
        let Run { network, state, next, controls, work, .. } = self;
        let (a, b) = events::pair(&controls.left, mode);
        let start = network.excess(mode, a, b);
        let (a, b) = events::pair(&controls.right, mode);
        let end = network.excess(mode, a, b);
        if start >= 0.0 || theta * h <= self.smallest {
            return Located::Now(mode);
        }
        let mut past = |theta: f64| {
            work.dense.unknowns(theta, state, next, &mut work.x);
            network.controls(&work.x, state.t + theta * h, &mut controls.inside);
            let (a, b) = events::pair(&controls.inside, mode);
            network.excess(mode, a, b)
        };
        let by = (1e-4f64).min(0.5 * theta).min(0.5 * (1.0 - theta)).max(1e-12);
        let slope = (past(theta + by) - past(theta - by)) / (2.0 * by * h);
        // Where the guard has come back by the end of the step, that end says nothing.
        let after = if end > 0.0 { (h, end) } else { (h, f64::INFINITY) };
        *search = Search {
            mode: Some(mode),
            tries: search.tries + 1,
            before: (0.0, start),
            after,
            slope,
            last: None,
        };
        Located::Redo((theta * h).max(self.smallest))
    }

    /// The step was to end on the threshold of this mode: does it?
    fn narrow(&mut self, mode: usize, h: f64, search: &mut Search) -> Located {
        let Run { network, controls, .. } = self;
        let (a, b) = events::pair(&controls.right, mode);
        let (a0, b0) = events::pair(&controls.left, mode);
        let past = network.excess(mode, a, b);
        let tolerance = network.tolerance(mode).max(LOCATED * (a - b - (a0 - b0)).abs());
        if self.is_switch(mode) {
            self.network.tracks[mode].located = 4.0 * tolerance;
        }
        if past.abs() <= tolerance || search.tries >= 3 || h <= self.smallest {
            // Still before the threshold: keep the step, the crossing is in the next one.
            if past < -tolerance {
                return Located::Nothing;
            }
            self.see_middle(mode);
            return Located::Here(mode);
        }
        if past > 0.0 {
            search.after = (h, past);
        } else {
            search.before = (h, past);
        }
        if let Some((at, value)) = search.last
            && at != h
        {
            search.slope = (past - value) / (h - at);
        }
        search.last = Some((h, past));
        search.tries += 1;
        let (low, high) = (search.before, search.after);
        let mut guess = h - past / search.slope;
        if !(guess > low.0 && guess < high.0) {
            let part = if high.1.is_finite() { -low.1 / (high.1 - low.1) } else { 0.5 };
            guess = low.0 + part.clamp(0.0, 1.0) * (high.0 - low.0);
        }
        Located::Redo(guess.max(self.smallest))
    }

    /// How far a guard has been away from its threshold in the middle of a step that ends there.
    fn see_middle(&mut self, mode: usize) {
        let Run { network, state, next, controls, work, .. } = self;
        work.dense.unknowns(0.5, state, next, &mut work.x);
        network.controls(&work.x, 0.5 * (state.t + next.t), &mut controls.inside);
        let (a, b) = events::pair(&controls.inside, mode);
        network.tracks[mode].see(a, b);
    }

    /// Whether any law or guard jumps when this condition changes at a part of the step. The end of a step that error
    /// control has refused says nothing of how large laws are.
    fn jumps(&mut self, mode: usize, theta: f64, accepted: bool) -> bool {
        let Run { network, state, next, controls, work, settings, .. } = self;
        let h = next.t - state.t;
        let hold = network.hold(mode);
        let old = network.mode(mode);
        network.set_hold(mode, HELD);
        work.dense.unknowns(theta, state, next, &mut work.x);
        network.controls(&work.x, state.t + theta * h, &mut controls.inside);
        let (mut a, mut b) = events::pair(&controls.inside, mode);
        if matches!(network.system.modes[mode].guard, Guard::Side) && old == 0.0 {
            (a, b) = events::pair(&controls.right, mode);
        }
        let new = network.next_value(mode, a, b);
        controls.other_sizes.clear();
        let mut compare = |before: f64, after: f64, tolerance: f64, only_if_finite: bool| {
            for (place, value) in [(before, old), (after, new)] {
                work.dense.unknowns(place, state, next, &mut work.x);
                network.set_mode(mode, value);
                let values = if value == old { &mut controls.before } else { &mut controls.after };
                values.clear();
                network.law_values(&work.x, state.t + place * h, values);
                network.controls(&work.x, state.t + place * h, &mut controls.inside);
                values.extend_from_slice(&controls.inside);
            }
            network.set_mode(mode, old);
            controls.sizes.resize(controls.before.len(), 0.0);
            controls.other_sizes.resize(controls.before.len(), 0.0);
            let mut finite = true;
            let mut jump = false;
            let sides = controls.before.iter().zip(&controls.after);
            let sizes = controls.sizes.iter_mut().zip(&mut controls.other_sizes);
            for ((before, after), (size, other)) in sides.zip(sizes) {
                if before.is_finite() && after.is_finite() {
                    // What the other value of the mode would make of the unknowns as they are never comes to be: it counts
                    // in this step only.
                    *size = size.max(before.abs());
                    *other = other.max(after.abs());
                    jump |= (before - after).abs() > tolerance * size.max(*other);
                } else {
                    finite = false;
                }
            }
            if finite || !only_if_finite { Some(jump) } else { None }
        };
        // The magnitudes that laws have at both ends, then the crossing itself; where a law has no value there, the
        // crossing from both sides.
        let near = 1e-9;
        if accepted {
            compare(0.0, 1.0, f64::INFINITY, false);
        }
        let jump = compare(theta, theta, settings.reltol, true)
            .or_else(|| compare((theta - near).max(0.0), (theta + near).min(1.0), COARSE, false));
        network.set_hold(mode, hold);
        jump.unwrap_or(true)
    }

    /// Holds the free conditions that jump within a step that error control has refused. Says whether there are any.
    pub(super) fn hold_jumps(&mut self) -> bool {
        if !self.watches || !self.network.any_free() {
            return false;
        }
        let Run { network, next, controls, work, .. } = self;
        if next.x.iter().any(|x| !x.is_finite()) {
            return false;
        }
        network.controls(&next.x, next.t, &mut controls.right);
        // A refused step has no dense output: straight lines will do to see a jump.
        work.dense.lines();
        let mut any = false;
        for mode in 0..self.network.system.modes.len() {
            let Run { network, controls, .. } = self;
            if network.hold(mode) != FREE {
                continue;
            }
            let at = |values: &[f64]| {
                let (a, b) = events::pair(values, mode);
                network.excess(mode, a, b)
            };
            let (before, after) = (at(&controls.left), at(&controls.right));
            if after <= network.room(mode) {
                continue;
            }
            let theta = if before < 0.0 { before / (before - after) } else { 0.0 };
            if self.jumps(mode, theta, false) {
                self.network.set_hold(mode, HELD);
                any = true;
            }
        }
        self.work.linearised &= !any;
        any
    }

    /// Changes a mode and finds the values after it. A condition that comes back again and again slides.
    pub(super) fn pass_event(&mut self, mode: usize) -> Result<(), Failure> {
        let (since, count) = &mut self.crowd;
        if self.state.t - *since > MOMENT * self.settings.stop {
            *since = self.state.t;
            *count = 0;
        }
        *count += 1;
        let crowded = *count > CROWD;
        let Run { network, controls, crossed, settings, first, .. } = self;
        if crowded && !network.is_condition(mode) {
            let trouble = Trouble::Modes(network.system.modes[mode].device);
            let time = self.state.t;
            return Err(failure(
                network.system,
                Moment::Restart,
                time,
                &trouble,
                &network.statistics,
            ));
        }
        // The step has been kept: the guards at its end are those at the next one's left.
        let (a, b) = events::pair(&controls.left, mode);
        let value = network.next_value(mode, a, b);
        let slides = network.flip(mode, value, a, b) || crowded;
        first.event(mode, value);
        // Others that have come to their thresholds in the same step, on their way across.
        for other in crossed.iter().map(|crossed| crossed.mode).filter(|other| *other != mode) {
            let (a, b) = events::pair(&controls.left, other);
            let (a0, b0) = events::pair(&controls.right, other);
            let range = (a - b - (a0 - b0)).abs();
            // Not of how exactly the last crossing was found: that would grow from each to the next.
            let room = 4.0 * network.rounding(other, a).max(LOCATED * range);
            if network.hold(other) == HELD && network.excess(other, a, b) >= -room {
                if matches!(network.system.modes[other].guard, Guard::Switch { .. }) {
                    network.tracks[other].located = room;
                }
                let value = network.next_value(other, a, b);
                network.flip(other, value, a, b);
            }
        }
        crossed.clear();
        if slides {
            let width = network.ramp(mode, a, b, settings.reltol);
            self.say_slide(&Slide { mode, width });
        }
        self.restart(Moment::Restart)?;
        self.settle_memories(Moment::Restart)?;
        self.shorten();
        self.row_here()
    }

    /// Says once of each condition that it slides.
    pub(super) fn say_slide(&mut self, slide: &Slide) {
        let network = &mut self.network;
        network.statistics.slides += 1;
        if !network.is_news(slide.mode) {
            return;
        }
        let system = network.system;
        let data = &system.modes[slide.mode];
        let name = system.spoken_device(data.device);
        let span = if data.span.is_none() { system.device_span(data.device) } else { data.span };
        let message = format!(
            "the solution slides along a condition of `{name}` from t = {:.6e} s",
            self.state.t
        );
        network.statistics.warnings.push(
            Diagnostic::warning("W0803", span, message)
                .says("both sides of it lead back to it at once")
                .because(format!(
                    "while it slides, the condition is a ramp of width {:.1e} to either side of its threshold",
                    slide.width
                ))
                .help("give the law a slope there, or the condition some hysteresis, to choose the width yourself"),
        );
    }
}

/// Where samples at [`PLACES`] may rise above 0 between two of them: the place of the highest and where a parabola has
/// its summit.
fn summit(samples: &[f64; 5]) -> Option<(usize, f64)> {
    let i = (1..4).max_by(|i, j| samples[*i].total_cmp(&samples[*j]))?;
    let (left, top, right) = (samples[i - 1], samples[i], samples[i + 1]);
    let bend = left - 2.0 * top + right;
    if top < left || top < right || bend >= 0.0 {
        return None;
    }
    let height = top - (left - right) * (left - right) / (8.0 * bend);
    let theta = PLACES[i] + 0.125 * (left - right) / bend;
    (height > 0.1 * bend).then_some((i, theta))
}

/// The root between `low` and `high` of a function that is not positive at the one and positive at the other, by
/// bisection and false position; at the end the side where it is positive.
fn root(mut low: f64, mut high: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (mut below, mut above) = (f(low), f(high));
    if below > 0.0 {
        return low;
    }
    for round in 0..60 {
        let middle = if round % 3 == 2 || above - below <= 0.0 {
            0.5 * (low + high)
        } else {
            low + (high - low) * (-below / (above - below)).clamp(0.01, 0.99)
        };
        let value = f(middle);
        if value > 0.0 {
            (high, above) = (middle, value);
        } else {
            (low, below) = (middle, value);
        }
        if high - low < 1e-12 {
            break;
        }
    }
    high
}
