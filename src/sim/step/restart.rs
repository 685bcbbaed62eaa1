//! Restarts of a run: consistent values at its start, after corners and after events.

use super::{Run, count_system, past};
use crate::circuit::Waveform;
use crate::linear::Singular;
use crate::sim::explain::{Failure, Moment, failure};
use crate::sim::methods::exponential::{self, Space};
use crate::sim::methods::{self, Method};
use crate::sim::newton::{Cut, Stage, solve_anew};
use crate::sim::op::{self, State, Trouble};
use crate::sim::settings::Side;

/// The part of the tolerance that each step gets where the circuit is of index 2, at a `reltol` of 1e-6. A method of
/// order 2 makes more of the errors of its steps: over a run they add up to their tolerance^(2/3). Below 1e-6 the part
/// falls with the root of `reltol`, so that the run's error falls with `reltol`; not down to rounding.
const INDEX_2_PART: f64 = 0.05;

fn index_2_part(reltol: f64) -> f64 {
    let part = INDEX_2_PART * (reltol / 1e-6).sqrt();
    part.max(1e-12 / reltol).min(INDEX_2_PART)
}

/// No step is longer than this part of a source's period. Where the circuit is of index 2, currents are rates of what
/// the sources prescribe, and no error test sees them.
const SIGHT: f64 = 0.25;
const INDEX_2_SIGHT: f64 = 0.02;

/// Charges of index 2 that a step misses by this part of `reltol` say nothing of their rates: over a short step that is
/// rounding.
const RATE_FLOOR: f64 = 1e-3;

/// Multiples of it, without their whole parts, lie about evenly between 0 and 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The highest frequency that a source swings with after a moment; 0 where it does not.
fn swings(waveform: &Waveform, t: f64) -> f64 {
    let frequency = match waveform {
        Waveform::Sine { amplitude, frequency, delay, .. } if *amplitude != 0.0 && t >= *delay => {
            frequency.abs()
        }
        Waveform::Sffm { amplitude, carrier, index, signal, .. } if *amplitude != 0.0 => {
            carrier.abs() + (index * signal).abs()
        }
        _ => 0.0,
    };
    if frequency.is_finite() { frequency } else { 0.0 }
}

/// The weight of an unknown: what it may be off, and not less than rounding makes of it.
fn weight(allowed: f64, floor: f64) -> f64 {
    allowed.max(floor).max(f64::MIN_POSITIVE)
}

impl Run<'_> {
    pub(super) fn start(&mut self) -> Result<(), Failure> {
        let network = &mut self.network;
        network.start_modes(0.0);
        self.state = op::initial_values(network, 0.0);
        if !self.settings.uic {
            let scratch = &mut self.work.scratch;
            let mut slides = vec![];
            let (state, floors) = (&mut self.state, &self.floors);
            past::at_rest(network, state, |network, state| {
                op::operating_point(network, state, floors, &mut slides, scratch)
            })
            .map_err(|trouble| {
                failure(network.system, Moment::OperatingPoint, 0.0, &trouble, &network.statistics)
            })?;
        }
        let before = self.settings.jumps == Side::Before;
        if before && !self.settings.uic {
            self.rows_as_arrived()?;
        }
        self.restart(Moment::Start)?;
        self.settle_memories(Moment::Start)?;
        if before && self.settings.uic {
            self.rows_as_stated()?;
        }
        let (method, reason) = methods::choose(&self.network, self.index2);
        if self.goes_far && self.index2 {
            self.learn_magnitudes()?;
        }
        let (method, reason) = match self.settings.method {
            _ if self.goes_far && !self.index2 => {
                let space = Space::new(self.network.system, self.settings);
                self.work.dense.space = Some(Box::new(space));
                (Method::Exponential, exponential::STRAIGHT)
            }
            Method::Auto => (method, reason),
            Method::Exponential => (method, exponential::UNFIT),
            asked if asked.is_rosenbrock() && self.index2 => (method, reason),
            asked => (asked, "asked for"),
        };
        self.method = method;
        self.home = method;
        count_system(&mut self.network, method.name(), reason);
        self.expect_limit();
        if let Some(rows) = self.rows.as_mut().filter(|_| !self.index2) {
            rows.look_at(&mut self.network);
        }
        let span = self.distance();
        self.h = self.settings.h0.unwrap_or(1e-3 * span).min(span);
        self.rows_first()?;
        self.rows_at_state()
    }

    /// Consistent values for the charges of `state`.
    pub(super) fn restart(&mut self, moment: Moment) -> Result<(), Failure> {
        self.leave_bound();
        if let Some(space) = &mut self.work.dense.space {
            space.begin(self.state.t);
        }
        self.work.history.forget();
        self.rounding.forget();
        self.work.scratch.forget_bend();
        self.work.unconfirmed = 0.0;
        self.work.linearised = false;
        self.last = None;
        self.fresh = true;
        self.smoothed = false;
        let network = &mut self.network;
        let (floors, scratch) = (&self.floors, &mut self.work.scratch);
        let mut slides = vec![];
        let found = op::consistent_values(network, &mut self.state, floors, &mut slides, scratch);
        match found {
            Ok(()) => {
                if self.index2 {
                    self.index2 = false;
                    self.untested.fill(false);
                    self.untested_rates.fill(false);
                }
            }
            Err(Trouble::Cut(Cut::Singular(singular))) => {
                self.index2 = true;
                self.untested.fill(false);
                self.untested_rates.fill(false);
                self.leave_untested(&singular);
                self.look_about();
                self.detour = 0;
                if self.method.is_rosenbrock() {
                    self.method = Method::TrBdf2;
                    self.network.statistics.method = Method::TrBdf2.name().into();
                    self.network.statistics.reason =
                        "the circuit is of index 2 after an event".into();
                }
                self.weigh();
                self.redistribute(moment)?;
            }
            Err(trouble) => {
                let time = self.state.t;
                return Err(failure(network.system, moment, time, &trouble, &network.statistics));
            }
        }
        self.weigh();
        self.look_ahead();
        for slide in &slides {
            self.say_slide(slide);
        }
        let Run { network, state, controls, absolute, .. } = self;
        network.controls(&state.x, state.t, &mut controls.left);
        if self.watches {
            if moment == Moment::Start {
                network.hold_all(&controls.left);
            }
            network.see_noise(&state.x, state.t, absolute);
            network.see_guards(&controls.left);
        }
        Ok(())
    }

    /// What a null vector moves is of index 2.
    fn leave_untested(&mut self, singular: &Singular) {
        let n = self.untested.len();
        for column in singular.columns.iter().flatten().map(|column| *column as usize) {
            match column.checked_sub(n) {
                None => self.untested[column] = true,
                Some(k) => self.untested_rates[k] = true,
            }
        }
    }

    /// Looks for null vectors at other points than this one too: where a modulus is 0 they move less than elsewhere.
    fn look_about(&mut self) {
        if self.network.system.is_linear() {
            return;
        }
        let mut point = self.state.x.clone();
        for turn in [GOLDEN, 2.0 * GOLDEN] {
            for (k, x) in point.iter_mut().enumerate() {
                let part = (turn * (k + 1) as f64).fract() - 0.5;
                let size = self.state.x[k].abs().max(1e3 * self.floors[k]);
                *x = self.state.x[k] + part * size;
            }
            self.network.linearise(&point, self.state.t, false);
            let held = &self.network.system.held;
            if self.network.non_finite_law().is_none()
                && let Err(singular) = self.network.factorise_frozen(held)
            {
                self.leave_untested(&singular);
            }
        }
        self.network.forget_pivots();
    }

    /// Sets the longest step by the periods of the sources that swing.
    fn look_ahead(&mut self) {
        let part = if self.index2 { INDEX_2_SIGHT } else { SIGHT };
        let sources = self.network.system.sources.iter();
        let fastest = sources.map(|source| swings(&source.waveform, self.state.t));
        self.sight = part / fastest.fold(0.0, f64::max);
    }

    /// Where charges jump to, and the rates from there on, from short steps of the backward Euler method: taken with a
    /// length and with half of it, twice the latter less the former.
    pub(super) fn redistribute(&mut self, moment: Moment) -> Result<(), Failure> {
        let full = 1e-6 * self.distance();
        let start = self.state.clone();
        let mut outcome = Err(Cut::NoConvergence { worst: 0 });
        for shrink in [1.0, 1e-2, 1e-4] {
            self.state.copy_from(&start);
            outcome = self.jump(full * shrink);
            if outcome.is_err() {
                continue;
            }
            let whole = self.state.clone();
            self.state.copy_from(&start);
            outcome = self.jump(0.5 * full * shrink);
            if outcome.is_ok() {
                let twice = |half: &mut [f64], whole: &[f64]| {
                    half.iter_mut().zip(whole).for_each(|(half, whole)| *half += *half - whole);
                };
                let State { x, w, q, .. } = &mut self.state;
                twice(x, &whole.x);
                twice(w, &whole.w);
                twice(q, &whole.q);
                return Ok(());
            }
        }
        match outcome {
            Ok(()) => Ok(()),
            Err(cut) => {
                self.state.copy_from(&start);
                let network = &self.network;
                let trouble = Trouble::Cut(cut);
                Err(failure(network.system, moment, start.t, &trouble, &network.statistics))
            }
        }
    }

    /// Three steps: the first lets charges jump to where loops of capacitors and sources want them, the others give the
    /// currents that flow from there on. The straight line through those two leads back to the moment itself, so that
    /// nothing starts late.
    fn jump(&mut self, h: f64) -> Result<(), Cut> {
        let start = self.state.t;
        self.euler(h)?;
        self.euler(h)?;
        let near = self.state.clone();
        self.euler(h)?;
        let back = |far: &mut [f64], near: &[f64]| {
            for (far, near) in far.iter_mut().zip(near) {
                *far = 3.0 * near - 2.0 * *far;
            }
        };
        back(&mut self.state.x, &near.x);
        back(&mut self.state.q, &near.q);
        back(&mut self.state.w, &near.w);
        self.state.t = start;
        Ok(())
    }

    /// Lets what moves faster than anything that is resolved die out, over a span that counts as none: after charges have
    /// jumped, a current through a small resistance to a junction's capacitance is off by the last digits of their
    /// voltages over that resistance. Where the equations have no solution on the way, all stays as it was.
    pub(super) fn settle(&mut self, span: f64) {
        const STEPS: u32 = 4;
        if !self.network.system.memories.is_empty() {
            return;
        }
        let start = self.state.clone();
        for _ in 0..STEPS {
            if self.euler(span / f64::from(STEPS)).is_err() {
                self.state.copy_from(&start);
                return;
            }
        }
    }

    pub(super) fn euler(&mut self, h: f64) -> Result<(), Cut> {
        let Run { network, state, next, work, weights, .. } = self;
        let alpha = 1.0 / h;
        for (beta, q) in work.beta.iter_mut().zip(&state.q) {
            *beta = -alpha * q;
        }
        next.copy_from(state);
        next.t = state.t + h;
        network.remember_junctions(&state.x);
        let stage = Stage {
            t: next.t,
            alpha,
            beta: &work.beta,
            weights,
            tolerance: methods::trbdf2::ITERATION,
            unconfirmed: 0.0,
        };
        solve_anew(network, &stage, &mut next.x, &mut next.q, &mut work.scratch)?;
        for (k, w) in next.w.iter_mut().enumerate() {
            *w = alpha * next.q[k] + work.beta[k];
        }
        std::mem::swap(state, next);
        Ok(())
    }

    /// Takes the values at the end of a step into the weights, which seldom changes any.
    pub(super) fn weigh_step(&mut self) {
        if self.index2 || self.was_index2 {
            return self.weigh();
        }
        let Run { state, largest, weights, absolute, rounding, settings, .. } = self;
        for (k, (largest, x)) in largest.iter_mut().zip(&state.x).enumerate() {
            if x.abs() > *largest {
                *largest = x.abs();
                let allowed = settings.reltol * *largest + absolute[k];
                weights[k] = weight(allowed, rounding.floors()[k]);
            }
        }
    }

    /// Takes the values of `state` into the weights.
    pub(super) fn weigh(&mut self) {
        let reltol = self.settings.reltol;
        let part = if self.index2 { index_2_part(reltol) } else { 1.0 };
        let Run { state, largest, weights, absolute, rounding, untested, .. } = self;
        for (largest, x) in largest.iter_mut().zip(&state.x) {
            *largest = if x.abs() > *largest { x.abs() } else { *largest };
        }
        let bases = largest.iter().zip(absolute.iter()).zip(rounding.floors());
        for (own, ((largest, absolute), floor)) in weights.iter_mut().zip(bases) {
            *own = weight(part * (reltol * largest + absolute), *floor);
        }
        if self.index2 || self.was_index2 {
            let tested = weights.iter_mut().zip(untested);
            tested.filter(|(_, untested)| **untested).for_each(|(w, _)| *w = f64::INFINITY);
        }
        if !self.index2 && !self.was_index2 {
            return;
        }
        self.was_index2 = self.index2;
        for (k, w) in self.state.w.iter().enumerate() {
            self.largest_rates[k] = self.largest_rates[k].max(w.abs());
            let floor = RATE_FLOOR * reltol * self.state.q[k].abs();
            self.work.rate_floors[k] = self.work.rate_floors[k].max(floor);
            // What charges were redistributed to is not exact enough to judge a first, short step's rates by.
            self.work.rate_weights[k] = if self.untested_rates[k] && !self.fresh {
                reltol * self.largest_rates[k] + self.settings.abstol
            } else {
                f64::INFINITY
            };
        }
    }

    /// Moves sources to their next segments and finds the values after the corner.
    pub(super) fn pass_corner(&mut self) -> Result<(), Failure> {
        self.network.pass_corner(self.state.t, self.smallest);
        self.first.corner(&self.network, self.state.t, self.smallest);
        let events = self.network.statistics.events;
        let mut before = std::mem::take(&mut self.before);
        before.clone_from(&self.state.x);
        self.restart(Moment::Restart)?;
        self.settle_memories(Moment::Restart)?;
        self.shorten();
        // A second row only where something jumped.
        let mut both = before.iter().zip(&self.state.x).zip(&self.weights);
        let jumped = both.any(|((a, b), weight)| (a - b).abs() > *weight);
        self.before = before;
        if jumped || self.network.statistics.events != events { self.row_here() } else { Ok(()) }
    }
}
