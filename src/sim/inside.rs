//! Values at times within an accepted step.
//!
//! Charges are interpolated, or where laws make them those of interpolated unknowns; all unknowns follow from them in the
//! frozen network, so that algebraic relations hold. Where that says too little, shorter steps lead from the step's start
//! to the time: in circuits of index 2, and where a junction bends the solution within the step.

use super::abreast::{Points, alone};
use super::methods::{self, Asked, Dense, Work, trbdf2};
use super::network::Network;
use super::newton::{Cut, Frozen, correct_frozen, subtract};
use super::op::State;
use super::output::Stopped;
use super::system::System;
use crate::linear::LANES;

/// Corrections of one row at most: an exponential that the guess overshoots comes down by one n·Vt each time.
const MOST_CORRECTIONS: u32 = 40;

/// Within this part of a step of index 2 a row lies on the straight line: a step so short would have only rounding in
/// its rates.
const SHORT: f64 = 1e-6;

/// What is corrected by no more than this part of what a step may err by needs no second correction.
const CORRECTED: f64 = 0.02;

/// Steps to one row at most.
const MOST_STEPS: u32 = 200;

/// Values of all unknowns at times within an accepted step.
pub(crate) struct Inside {
    pub point: State,
    /// Charges that are states.
    held: Vec<bool>,
    /// The unknowns that are asked for, as a list and as marks.
    unknowns: Vec<u32>,
    asked: Vec<bool>,
    /// Where every unknown asked for is one of a linear storage's own: unknown, charge, and charge for each unit of it.
    stored: Vec<(u32, u32, f64)>,
    /// What of a step's polynomials is asked for, where that is not everything.
    few: Option<Asked>,
    /// Whether the frozen network is factorised for this step; `None`: not yet tried.
    pub factorised: Option<bool>,
    /// Whether what is interpolated in this step is too far from the equations; `None`: not yet asked.
    rough: Option<bool>,
    /// How far shorter steps have come from the left end.
    reached: State,
    /// Values of a shorter step, and where the dense output of the whole one waits meanwhile.
    shorter: State,
    dense: Dense,
    /// Room to correct several points at once, where that is done, and the points of the next rows.
    points: Option<Points>,
    foreseen: Vec<State>,
    /// Whether that is not done in this step any more.
    gives_up: bool,
}

impl Inside {
    pub fn new(network: &Network) -> Inside {
        let system = network.system;
        Inside {
            point: State::new(0.0, system.equations(), system.charges()),
            held: system.held.clone(),
            unknowns: (0..system.equations() as u32).collect(),
            asked: vec![true; system.equations()],
            stored: vec![],
            few: None,
            factorised: None,
            rough: None,
            reached: State::new(f64::NAN, system.equations(), system.charges()),
            shorter: State::new(0.0, system.equations(), system.charges()),
            dense: Dense::new(system.equations(), system.charges()),
            points: None,
            foreseen: vec![],
            gives_up: false,
        }
    }

    /// For output columns alone.
    pub fn of_outputs(network: &Network) -> Inside {
        let system = network.system;
        let mut inside = Inside::new(network);
        if system.law_columns.is_empty() {
            inside.unknowns = system.observed();
            inside.asked.fill(false);
            inside.unknowns.iter().for_each(|unknown| inside.asked[*unknown as usize] = true);
            inside.stored = stored_alone(system).unwrap_or_default();
            let charges = inside.stored.iter().map(|(_, charge, _)| *charge).collect();
            let few = Asked { unknowns: inside.unknowns.clone(), charges };
            inside.few = (!system.has_junctions()).then_some(few);
        }
        if inside.stored.is_empty() {
            inside.points = Points::new(system, &inside.held);
            let nowhere = State::new(f64::NAN, system.equations(), system.charges());
            inside.foreseen = vec![nowhere; if inside.points.is_some() { LANES } else { 0 }];
        }
        inside
    }

    /// Another step begins.
    pub fn begin(&mut self) {
        self.factorised = None;
        self.rough = None;
        self.reached.t = f64::NAN;
        self.gives_up = false;
        self.foreseen.iter_mut().for_each(|point| point.t = f64::NAN);
    }

    /// Whether the values at a time are not known beforehand and might be.
    pub fn may_foresee(&self, time: f64) -> bool {
        !self.foreseen.is_empty()
            && !self.gives_up
            && self.foreseen.iter().all(|point| point.t.is_nan() || point.t < time)
    }

    /// Finds the values at the next times inside a step at once, as [`between`](Inside::between) does one by one, as far as
    /// one correction suffices.
    #[allow(clippy::too_many_arguments)]
    pub fn foresee(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        times: &[f64],
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) {
        let able = !index2
            && !work.dense.by_unknowns
            && network.is_plain()
            && !network.any_ramped()
            && times.len() > 1
            && self.factorise(network);
        let points = self.points.as_mut().filter(|_| able);
        let Some(points) = points.and_then(|points| points.begin(network).then_some(points)) else {
            self.gives_up = true;
            return;
        };
        work.complete(from, to, None);
        for (lane, (point, time)) in self.foreseen.iter_mut().zip(times).enumerate() {
            guess(point, from, to, *time, work);
            points.put(lane, network, point, &mut work.right);
        }
        points.correct();
        for (lane, (point, _)) in self.foreseen.iter_mut().zip(times).enumerate() {
            let correction = &mut work.scratch.residual;
            points.take(lane, correction);
            if subtract(correction, &mut point.x, &mut point.w, weights) > CORRECTED {
                point.t = f64::NAN;
                continue;
            }
            network.statistics.evaluations += 1;
            network.statistics.solves += 1;
        }
    }

    /// Factorises the frozen network for a step, where that is not done; says whether it can be.
    fn factorise(&mut self, network: &mut Network) -> bool {
        let held = &self.held;
        *self.factorised.get_or_insert_with(|| network.factorise_frozen(held).is_ok())
    }

    /// Makes what is mostly asked of a step's polynomials.
    pub fn look_within(&self, from: &State, to: &State, work: &mut Work) {
        work.complete(from, to, self.few.as_ref());
    }

    /// Puts the values at a time inside a step into `self.point`.
    #[allow(clippy::too_many_arguments)]
    pub fn between(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        time: f64,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<(), Stopped> {
        if let Some(point) = self.foreseen.iter().find(|point| point.t == time) {
            self.point.copy_from(point);
            return Ok(());
        }
        let theta = (time - from.t) / (to.t - from.t);
        if self.few.is_none() {
            work.complete(from, to, None);
        }
        // Rows of linear circuits meet their equations to rounding, whatever the tolerance.
        if index2 && (!work.dense.by_unknowns || network.system.groups.is_empty()) {
            return self.shorter_step(network, from, to, time, weights, work);
        }
        if !index2 && network.is_straight() {
            work.dense.look_at(theta);
            for k in self.unknowns.iter().map(|unknown| *unknown as usize) {
                self.point.x[k] = work.dense.unknown(k, theta, from, to);
            }
            self.point.t = time;
            return Ok(());
        }
        if !index2 && !work.dense.by_unknowns && !self.stored.is_empty() {
            for (unknown, charge, unit) in &self.stored {
                let q = work.dense.charge(*charge as usize, theta, from, to);
                self.point.x[*unknown as usize] = q / unit;
            }
            self.point.t = time;
            return Ok(());
        }
        work.complete(from, to, None);
        let asked = &self.asked;
        let rough =
            *self.rough.get_or_insert_with(|| is_rough(network, from, to, asked, weights, work));
        guess(&mut self.point, from, to, time, work);
        if work.dense.by_unknowns {
            network.evaluate(&self.point.x, time);
            network.charges(&self.point.x, &mut self.point.q);
        }
        if index2 {
            // Not every unknown follows from the charges: the parabola through the stages stands, where it may.
            return match rough {
                true => self.shorter_step(network, from, to, time, weights, work),
                false => Ok(()),
            };
        }
        if rough && self.step_to_point(network, from, theta, weights, work) {
            return Ok(());
        }
        // On a ramp laws make much of the least error of a charge: what was interpolated stands.
        let ramped = network.any_ramped();
        if !self.finish_point(network, time, ramped, weights, work)? {
            // Charges of junctions that are almost empty say little of their voltages: a step says more.
            self.step_to_point(network, from, theta, weights, work);
        }
        Ok(())
    }

    /// Goes from the left end to the time of `self.point` in steps that pass the error test. Says whether it has come there.
    fn step_to_point(
        &mut self,
        network: &mut Network,
        from: &State,
        theta: f64,
        weights: &[f64],
        work: &mut Work,
    ) -> bool {
        if theta < SHORT {
            return false;
        }
        let end = self.point.t;
        // Rows mostly follow each other: the last one's way is gone on with.
        if !(self.reached.t >= from.t && self.reached.t <= end) {
            self.reached.copy_from(from);
        }
        let mut h = end - self.reached.t;
        std::mem::swap(&mut self.dense, &mut work.dense);
        let mut left = MOST_STEPS;
        while self.reached.t < end && left > 0 {
            left -= 1;
            let lands = self.reached.t + h >= end;
            self.shorter.copy_from(&self.point);
            self.shorter.t = if lands { end } else { self.reached.t + h };
            let (from, to) = (&self.reached, &mut self.shorter);
            let error = beside(network, work, |network, work| {
                alone(trbdf2::step(network, from, to, weights, work, None))
            });
            let error = error.unwrap_or(f64::INFINITY);
            if error <= 1.0 {
                std::mem::swap(&mut self.reached, &mut self.shorter);
            }
            h *= (0.9 * libm::cbrt(error.max(1e-3)).recip()).clamp(0.2, 2.0);
        }
        std::mem::swap(&mut self.dense, &mut work.dense);
        self.factorised = None;
        let there = self.reached.t >= end;
        if there {
            self.point.copy_from(&self.reached);
        }
        there
    }

    /// The same by a step of its own, so that algebraic relations between charges and rates hold.
    fn shorter_step(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        time: f64,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<(), Stopped> {
        let theta = (time - from.t) / (to.t - from.t);
        self.point.t = time;
        if theta < SHORT {
            let line = |out: &mut [f64], from: &[f64], to: &[f64]| {
                for (out, (from, to)) in out.iter_mut().zip(from.iter().zip(to)) {
                    *out = from + theta * (to - from);
                }
            };
            line(&mut self.point.x, &from.x, &to.x);
            line(&mut self.point.q, &from.q, &to.q);
            line(&mut self.point.w, &from.w, &to.w);
            return Ok(());
        }
        let to = &mut self.point;
        match beside(network, work, |network, work| {
            alone(trbdf2::step(network, from, to, weights, work, None))
        }) {
            Ok(_) => Ok(()),
            Err(cut) => Err(Stopped::Values(time, cut)),
        }
    }

    /// Corrects the unknowns of `self.point` so that they belong to its charges, unless they are to be left `as_is`. Says
    /// whether they do as far as could be.
    pub fn finish_point(
        &mut self,
        network: &mut Network,
        time: f64,
        as_is: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<bool, Stopped> {
        self.point.t = time;
        if as_is {
            return Ok(true);
        }
        work.x.copy_from_slice(&self.point.x);
        work.w.copy_from_slice(&self.point.w);
        let targets = std::mem::take(&mut self.point.q);
        let corrected = self.correct(network, &targets, time, weights, work);
        self.point.q = targets;
        let belong = corrected.map_err(|cut| Stopped::Values(time, cut))?;
        if belong {
            self.point.x.copy_from_slice(&work.x);
            self.point.w.copy_from_slice(&work.w);
        }
        Ok(belong)
    }

    /// Whether the correction came to its end; an error where there are no finite values.
    fn correct(
        &mut self,
        network: &mut Network,
        targets: &[f64],
        time: f64,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<bool, Cut> {
        self.factorise(network);
        let Work { x, w, q, scratch, .. } = work;
        let held = &self.held;
        let frozen = Frozen { t: time, held, targets, floors: weights, most: 1, prime: false };
        for iteration in 0..MOST_CORRECTIONS {
            if self.factorised != Some(true) || iteration >= 2 {
                // The slopes of the step's start no longer serve.
                network.linearise(x, time, false);
                if network.factorise_frozen(held).is_err() {
                    self.factorised = None;
                    return self.keep_guess(network, time, work);
                }
                self.factorised = Some(true);
            }
            let update = correct_frozen(network, &frozen, x, w, q, scratch);
            if update <= CORRECTED || (iteration == 0 && network.system.is_linear()) {
                return Ok(true);
            }
            if !update.is_finite() {
                break;
            }
        }
        self.factorised = None;
        self.keep_guess(network, time, work)
    }

    /// The corrections may have led astray: what was interpolated stands, where the laws have values there.
    fn keep_guess(&self, network: &mut Network, time: f64, work: &mut Work) -> Result<bool, Cut> {
        network.evaluate(&self.point.x, time);
        network.residual(&self.point.x, time, &mut work.right);
        if work.right.iter().all(|r| r.is_finite()) {
            return Ok(false);
        }
        Err(Cut::NonFinite { device: network.non_finite_law() })
    }
}

/// What a step's polynomials say of a time within it; of the charges too, where they are what is interpolated.
fn guess(point: &mut State, from: &State, to: &State, time: f64, work: &Work) {
    let theta = (time - from.t) / (to.t - from.t);
    work.dense.unknowns(theta, from, to, &mut point.x);
    if !work.dense.by_unknowns {
        work.dense.charges(theta, from, to, &mut point.q);
    }
    for (k, w) in point.w.iter_mut().enumerate() {
        *w = from.w[k] + theta * (to.w[k] - from.w[k]);
    }
    point.t = time;
}

/// Of each unknown that an output column is, the linear storage that it alone makes up; nothing where one has none.
fn stored_alone(system: &System) -> Option<Vec<(u32, u32, f64)>> {
    let mut of_unknown = vec![None; system.equations()];
    for k in (0..system.charges()).filter(|k| system.held[*k] && !system.curved[*k]) {
        let mut entries = system.charges.row(k);
        if let (Some((unknown, unit)), None) = (entries.next(), entries.next()) {
            of_unknown[unknown] = (unit != 0.0).then_some((unknown as u32, k as u32, unit));
        }
    }
    system.plain_outputs.iter().map(|(_, unknown)| of_unknown[*unknown as usize]).collect()
}

/// Takes a step beside the run's own, which go on as if it had not been taken.
fn beside<T>(
    network: &mut Network,
    work: &mut Work,
    step: impl FnOnce(&mut Network, &mut Work) -> T,
) -> T {
    let known = work.scratch.convergence();
    work.scratch.near.forget();
    network.turn_aside();
    let outcome = step(network, work);
    network.turn_aside();
    work.scratch.go_on_with(known);
    outcome
}

/// Whether parabolas of the unknowns asked for miss the equations between the ends of a step by more than the step may
/// err: a diode that begins or ends to conduct bends the solution there, and only the values at the stages are tested.
fn is_rough(
    network: &mut Network,
    from: &State,
    to: &State,
    asked: &[bool],
    weights: &[f64],
    work: &mut Work,
) -> bool {
    /// Halfway between the stages, about.
    const ASKED: [f64; 2] = [0.3, 0.8];
    /// In units of what a step may err by.
    const MOST: f64 = 2.0;
    if !work.dense.by_unknowns || network.rests_within(&work.dense, from, to) {
        return false;
    }
    let h = to.t - from.t;
    ASKED.iter().any(|theta| {
        let time = from.t + theta * h;
        work.dense.unknowns(*theta, from, to, &mut work.x);
        network.linearise(&work.x, time, false);
        network.residual(&work.x, time, &mut work.right);
        for (k, slope) in work.error.iter_mut().enumerate() {
            *slope = to.x[k] - from.x[k] + (1.0 - 2.0 * theta) * work.dense.x[0][k];
        }
        work.sum.fill(0.0);
        network.add_charge_change(1.0 / h, &work.error, &mut work.sum);
        network.system.rates.add_transposed(1.0, &work.sum, &mut work.right);
        network.solve_dynamic(&mut work.right);
        for (missed, asked) in work.right.iter_mut().zip(asked) {
            *missed = if *asked || missed.is_nan() { *missed } else { 0.0 };
        }
        methods::weighted(&work.right, weights) > MOST
    })
}
