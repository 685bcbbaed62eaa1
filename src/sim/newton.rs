//! Newton's method on a step's equations and on the frozen network, with tests of both update and residual.

use super::abreast::Company;
use super::near::{self, Near};
use super::network::Network;
use super::op::State;
use super::search::Sought;
use crate::circuit::DeviceId;
use crate::linear::{Cause, Singular};

/// Why a solution was not found.
#[derive(Clone, Debug)]
pub(crate) enum Cut {
    /// The updates did not shrink; the equation with the largest residual for its terms.
    NoConvergence { worst: usize },
    /// The matrix is singular.
    Singular(Singular),
    /// A value is infinite or no number; the device whose law it is, where one is to blame.
    NonFinite { device: Option<DeviceId> },
    /// No values satisfy the frozen network, as far as was sought.
    NotFound(Box<Sought>),
}

/// Buffers of Newton's method.
#[derive(Debug)]
pub(crate) struct Scratch {
    pub residual: Vec<f64>,
    pub rates: Vec<f64>,
    pub sizes: Vec<f64>,
    update: Vec<f64>,
    /// The update before.
    before: Vec<f64>,
    /// Where iterations with factors of an earlier stage began.
    pub guess: Vec<f64>,
    /// Where a search began, and the charges that it is for.
    pub start: State,
    pub targets: Vec<f64>,
    /// What the second update of a stage is of the first one's square, both weighted, as far as is known: with it, one
    /// iteration tells how far off it is, and no second one need confirm it.
    bend: f64,
    /// Stages since that has been measured.
    age: u32,
    /// What is known of the factors at hand.
    pub near: Near,
}

impl Scratch {
    pub fn new(n: usize, charges: usize) -> Scratch {
        Scratch {
            residual: vec![0.0; n + charges],
            rates: vec![0.0; charges],
            sizes: vec![0.0; n + charges],
            update: vec![0.0; n + charges],
            before: vec![0.0; n + charges],
            guess: vec![0.0; n],
            start: State::new(0.0, n, charges),
            targets: vec![0.0; charges],
            bend: f64::INFINITY,
            age: 0,
            near: Near::UNKNOWN,
        }
    }

    /// What is known of how iterations converge, for steps that are taken beside the run's own.
    pub fn convergence(&self) -> (f64, u32, Near) {
        (self.bend, self.age, self.near)
    }

    /// Goes on with what was known before such steps.
    pub fn go_on_with(&mut self, (bend, age, near): (f64, u32, Near)) {
        (self.bend, self.age, self.near) = (bend, age, near);
    }

    /// What was measured of the equations no longer holds.
    pub fn forget_bend(&mut self) {
        self.bend = f64::INFINITY;
        self.near = Near::UNKNOWN;
    }
}

/// Part of an update that swings back over the last one.
const SWING: f64 = 0.38;

/// Whether an update leads back over most of the one before, so that the next one would do the same: Newton's method
/// goes to and fro between the two sides of a root (of √|x|, say) and never meets it.
fn swings(update: &[f64], before: &[f64], weights: &[f64]) -> bool {
    let (mut across, mut along) = (0.0, 0.0);
    for ((u, b), weight) in update.iter().zip(before).zip(weights) {
        across += (u / weight) * (b / weight);
        along += (b / weight) * (b / weight);
    }
    across < -0.5 * along
}

/// A residual as large as this part of the terms it is made of is none.
const RESIDUAL: f64 = 1e-6;

/// A part of an unknown's floor that counts as nothing: with [`RESIDUAL`], a billionth of the floor.
const UNNOTICED: f64 = 1e-3;

/// After so many stages it is measured again how fast iterations converge.
pub(super) const MEASURED_AGAIN: u32 = 8;

/// What was measured may have become larger by this factor since.
pub(super) const GROWN: f64 = 4.0;

/// The largest first update that no second one confirms: a kink in between would leave no more than about this much.
const NEAR: f64 = 0.5;

/// Most iterations of one step.
const MOST: u64 = 12;

/// What an implicit step solves: G·x + f(x, t) + A·(α·Q(x) + β) = b(t).
pub(crate) struct Stage<'a> {
    pub t: f64,
    pub alpha: f64,
    pub beta: &'a [f64],
    /// Weights of the update test; infinite where an unknown is not tested.
    pub weights: &'a [f64],
    /// Largest weighted error of iteration, where the residual is tested too.
    pub tolerance: f64,
    /// Largest weighted error of iteration without such a test: a part of what the method itself errs by, since over
    /// thousands of steps errors of one sign would add up.
    pub unconfirmed: f64,
}

/// Solves a stage from the guess in `x`; leaves Q(x) in `q`, and the last factors of W(α) in the network.
pub(crate) async fn solve_stage(
    network: &mut Network<'_>,
    stage: &Stage<'_>,
    x: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
    company: Company<'_>,
) -> Result<(), Cut> {
    let near = !network.system.is_linear()
        && stage.unconfirmed > 0.0
        && near::may_solve(network, stage, x, &mut scratch.near);
    if near && near::solve(network, stage, x, q, scratch, company).await {
        return Ok(());
    }
    solve_anew(network, stage, x, q, scratch)
}

/// The same with new factors for each iteration.
pub(crate) fn solve_anew(
    network: &mut Network,
    stage: &Stage,
    x: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    if network.system.is_linear() {
        return solve_linear(network, stage, x, q, scratch);
    }
    let n = x.len();
    let mut before = f64::INFINITY;
    let mut damping = false;
    for iteration in 0..MOST {
        network.statistics.iterations += 1;
        let limited = network.linearise(x, stage.t, true);
        network.charges(x, q);
        let residual = &mut scratch.residual[..n];
        stage_residual(network, stage, x, q, residual, &mut scratch.rates);
        if iteration == 0 && residual.iter().all(|r| *r == 0.0) {
            // At rest, where the matrix may be singular, the guess is the solution.
            return Ok(());
        }
        network.factorise_dynamic(stage.alpha).map_err(|singular| explain(network, singular))?;
        scratch.near.forget();
        network.solve_dynamic(residual);
        let last = &mut scratch.before[..n];
        let damped = damping && swings(residual, last, stage.weights);
        let part = if damped { SWING } else { 1.0 };
        let mut update: f64 = 0.0;
        for ((x, dx), weight) in x.iter_mut().zip(residual.iter()).zip(stage.weights) {
            if !dx.is_finite() {
                return Err(Cut::NonFinite { device: network.non_finite_law() });
            }
            *x -= part * dx;
            update = update.max(dx.abs() / weight);
        }
        last.copy_from_slice(residual);
        let rate = if iteration == 0 { 0.0 } else { update / before };
        if iteration == 0 {
            scratch.age += 1;
        } else if iteration == 1 && before > 0.0 {
            scratch.bend = update / (before * before);
            scratch.age = 0;
        }
        let left = GROWN * scratch.bend * update * update;
        let known = left <= stage.unconfirmed && scratch.age < MEASURED_AGAIN && rate < 1.0;
        if known && !limited && !damped && (update <= NEAR || network.meets_no_kink(x)) {
            // Charges go with the linear terms, as the equations just solved have them.
            network.add_charge_change(-1.0, &scratch.residual[..n], q);
            return Ok(());
        }
        damping = rate >= 0.5;
        let done = match iteration {
            // Once it is measured how fast iterations converge, the next stages need not be confirmed.
            0 => update <= 0.1 * stage.tolerance && (scratch.bend.is_finite() || update == 0.0),
            _ => rate < 1.0 && update * rate / (1.0 - rate) <= stage.tolerance,
        };
        before = update;
        if limited || !done || damped {
            if !limited && iteration >= 4 && rate > 2.0 {
                break;
            }
            continue;
        }
        network.evaluate(x, stage.t);
        network.charges(x, q);
        if residual_is_small(network, stage, x, q, scratch) {
            scratch.age = 0;
            return Ok(());
        }
    }
    network.evaluate(x, stage.t);
    network.charges(x, q);
    let worst = worst_row(network, stage, x, q, scratch);
    Err(Cut::NoConvergence { worst })
}

/// A stage of linear equations, from no guess: W(α)·x = b − f(0) − A·β.
fn solve_linear(
    network: &mut Network,
    stage: &Stage,
    x: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    network.statistics.iterations += 1;
    network.linearise(x, stage.t, false);
    network.factorise_dynamic(stage.alpha).map_err(|singular| explain(network, singular))?;
    scratch.near.forget();
    let right = &mut scratch.residual[..x.len()];
    network.residual_at_zero(stage.t, right);
    network.system.rates.add_transposed(1.0, stage.beta, right);
    network.solve_dynamic(right);
    // 0·x is no number where x is none, or infinite.
    let mut nothing = 0.0;
    for (x, negative) in x.iter_mut().zip(right.iter()) {
        *x = -negative;
        nothing += 0.0 * negative;
    }
    if nothing != 0.0 {
        return Err(Cut::NonFinite { device: None });
    }
    network.charges(x, q);
    Ok(())
}

pub(super) fn stage_residual(
    network: &Network,
    stage: &Stage,
    x: &[f64],
    q: &[f64],
    residual: &mut [f64],
    rates: &mut [f64],
) {
    network.residual(x, stage.t, residual);
    for ((rate, q), beta) in rates.iter_mut().zip(q).zip(stage.beta) {
        *rate = stage.alpha * q + beta;
    }
    network.system.rates.add_transposed(1.0, rates, residual);
}

/// Each residual against the terms of its row; |α·Q| + |β| are the terms of a rate.
fn relative_residuals(
    network: &Network,
    stage: &Stage,
    x: &[f64],
    q: &[f64],
    scratch: &mut Scratch,
) -> (f64, usize) {
    let n = x.len();
    let Scratch { residual, rates, sizes, .. } = scratch;
    stage_residual(network, stage, x, q, &mut residual[..n], rates);
    network.term_sizes(x, stage.t, &mut sizes[..n]);
    for (k, (q, beta)) in q.iter().zip(stage.beta).enumerate() {
        for (row, factor) in network.system.rates.row(k) {
            sizes[row] += factor.abs() * ((stage.alpha * q).abs() + beta.abs());
        }
    }
    worst(&residual[..n], &sizes[..n])
}

fn residual_is_small(
    network: &Network,
    stage: &Stage,
    x: &[f64],
    q: &[f64],
    scratch: &mut Scratch,
) -> bool {
    relative_residuals(network, stage, x, q, scratch).0 <= RESIDUAL
}

fn worst_row(
    network: &Network,
    stage: &Stage,
    x: &[f64],
    q: &[f64],
    scratch: &mut Scratch,
) -> usize {
    relative_residuals(network, stage, x, q, scratch).1
}

fn worst(residual: &[f64], sizes: &[f64]) -> (f64, usize) {
    let mut largest = (0.0, 0);
    for (row, (r, size)) in residual.iter().zip(sizes).enumerate() {
        // A row made of nothing but exact zeros is satisfied.
        let ratio = if *r == 0.0 { 0.0 } else { r.abs() / size.max(f64::MIN_POSITIVE) };
        if ratio > largest.0 || ratio.is_nan() {
            largest = (if ratio.is_nan() { f64::INFINITY } else { ratio }, row);
        }
    }
    largest
}

/// A singular matrix with an entry that is no number is a law's fault, not the circuit's.
fn explain(network: &Network, singular: Singular) -> Cut {
    match singular.cause {
        Cause::NotFinite => Cut::NonFinite { device: network.non_finite_law() },
        _ => Cut::Singular(singular),
    }
}

/// What is asked of the frozen network: charges `held` have the values `targets`, the others have no rate.
pub(crate) struct Frozen<'a> {
    pub t: f64,
    pub held: &'a [bool],
    pub targets: &'a [f64],
    /// What an update is compared with where the unknown itself is small; in [`correct_frozen`] everywhere.
    pub floors: &'a [f64],
    /// Most iterations.
    pub most: u64,
    /// Begin with junctions where they begin to conduct instead of at the guess.
    pub prime: bool,
}

/// Solves the frozen network from the guess in `x`, until only rounding is left.
pub(crate) fn solve_frozen(
    network: &mut Network,
    frozen: &Frozen,
    x: &mut [f64],
    w: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    let n = x.len();
    if frozen.prime {
        network.prime_junctions();
    } else {
        network.remember_junctions(x);
    }
    let linear = network.system.is_linear();
    let mut before = f64::INFINITY;
    let mut damping = false;
    let mut step = 1.0;
    for iteration in 0..frozen.most {
        network.statistics.iterations += 1;
        let mut limited = network.linearise(x, frozen.t, true) || (frozen.prime && iteration == 0);
        network.charges(x, q);
        frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
        if iteration == 0 && network.silence() {
            // A law may have no value at the guess, and one where the others lead to: `acosh` of a voltage still at 0.
            limited = true;
            network.charges(x, q);
            frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
        }
        if scratch.residual.iter().any(|r| !r.is_finite()) {
            // Back half of the last step: the law is not defined where it led.
            if iteration == 0 || step < 1e-3 {
                return Err(Cut::NonFinite { device: network.non_finite_law() });
            }
            step *= 0.5;
            for (x, dx) in x.iter_mut().zip(&scratch.update) {
                *x += step * dx;
            }
            continue;
        }
        step = 1.0;
        let (ratio, _) = relative_frozen(network, frozen, x, w, scratch);
        if let Err(singular) = network.factorise_frozen(frozen.held) {
            let cut = explain(network, singular);
            // Where a slope is infinite (a root at 0) and the equations hold, there is nothing to be bettered.
            let holds =
                ratio <= 1e-9 && charge_misfit(frozen, &scratch.residual[n..]).next().is_none();
            if holds && matches!(cut, Cut::NonFinite { .. }) {
                return Ok(());
            }
            return Err(cut);
        }
        scratch.update.copy_from_slice(&scratch.residual);
        network.solve_frozen(&mut scratch.update);
        let damped = damping && swings(&scratch.update[..n], &scratch.before[..n], frozen.floors);
        if damped {
            scratch.update.iter_mut().for_each(|dx| *dx *= SWING);
        }
        let mut update: f64 = 0.0;
        for ((x, dx), floor) in x.iter_mut().zip(&scratch.update[..n]).zip(frozen.floors) {
            if !dx.is_finite() {
                return Err(Cut::NonFinite { device: network.non_finite_law() });
            }
            *x -= dx;
            update = update.max(dx.abs() / (x.abs() + floor));
        }
        for (w, dw) in w.iter_mut().zip(&scratch.update[n..]) {
            *w -= dw;
        }
        scratch.before.copy_from_slice(&scratch.update);
        damping = update >= 0.5 * before;
        // Settled: the residual was rounding already, and the update is small or has ceased to shrink.
        let settled = update <= 1e-14
            || (ratio <= 1e-9 && (update <= 1e-9 || (iteration >= 2 && update >= 0.5 * before)));
        before = update;
        if linear || (settled && !limited && !damped) {
            network.evaluate(x, frozen.t);
            network.charges(x, q);
            frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
            if relative_frozen(network, frozen, x, w, scratch).0 <= RESIDUAL {
                return Ok(());
            }
            // One solve is exact but for rounding, which a second and third one mend.
            if linear && iteration >= 2 {
                break;
            }
        }
    }
    network.evaluate(x, frozen.t);
    network.charges(x, q);
    frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
    let (_, worst) = relative_frozen(network, frozen, x, w, scratch);
    Err(Cut::NoConvergence { worst })
}

/// One correction with the factors at hand: for rows, where the guess is good already. Returns the largest update
/// relative to the floors.
pub(crate) fn correct_frozen(
    network: &mut Network,
    frozen: &Frozen,
    x: &mut [f64],
    w: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
) -> f64 {
    network.evaluate(x, frozen.t);
    network.charges(x, q);
    frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
    network.solve_frozen(&mut scratch.residual);
    subtract(&scratch.residual, x, w, frozen.floors)
}

/// Subtracts a correction of unknowns and rates. Gives the largest one of an unknown as a part of its weight; infinite where
/// one is no number.
pub(super) fn subtract(correction: &[f64], x: &mut [f64], w: &mut [f64], weights: &[f64]) -> f64 {
    let (unknowns, rates) = correction.split_at(x.len());
    let mut update: f64 = 0.0;
    for ((x, dx), weight) in x.iter_mut().zip(unknowns).zip(weights) {
        *x -= dx;
        let size = dx.abs() / weight;
        update = if size.is_nan() { f64::INFINITY } else { update.max(size) };
    }
    for (w, dw) in w.iter_mut().zip(rates) {
        *w -= dw;
    }
    update
}

/// What the frozen network's equations leave over at a point: (row, what is left, sum of the terms' sizes), worst first.
pub(crate) fn frozen_misfit(
    network: &mut Network,
    frozen: &Frozen,
    x: &[f64],
    w: &[f64],
    q: &mut [f64],
    scratch: &mut Scratch,
) -> Vec<(usize, f64, f64)> {
    network.evaluate(x, frozen.t);
    network.charges(x, q);
    frozen_residual(network, frozen, x, w, q, &mut scratch.residual);
    relative_frozen(network, frozen, x, w, scratch);
    let n = x.len();
    let mut rows = worst_rows(&scratch.residual[..n], &scratch.sizes[..n]);
    let charges = charge_misfit(frozen, &scratch.residual[n..]);
    rows.extend(charges.map(|(k, left, size)| (n + k, left, size)));
    rows
}

/// Charges that are not what they are held at, or not at rest: (charge, what is left over, its size).
fn charge_misfit<'a>(
    frozen: &'a Frozen,
    residual: &'a [f64],
) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
    residual.iter().enumerate().filter_map(|(k, left)| {
        let size = if frozen.held[k] { frozen.targets[k].abs() } else { 0.0 };
        let misses = left.abs() > 1e-9 * size || left.is_nan();
        misses.then_some((k, *left, size.max(left.abs())))
    })
}

/// Rows by how badly they are satisfied, worst first; those that are satisfied left out.
pub(crate) fn worst_rows(residual: &[f64], sizes: &[f64]) -> Vec<(usize, f64, f64)> {
    let ratio = |left: f64, size: f64| {
        let ratio = if left == 0.0 { 0.0 } else { left.abs() / size.max(f64::MIN_POSITIVE) };
        if ratio.is_nan() { f64::INFINITY } else { ratio }
    };
    let all = residual.iter().zip(sizes).enumerate();
    let mut rows: Vec<(usize, f64, f64)> = all
        .filter(|(_, (left, size))| ratio(**left, **size) > RESIDUAL)
        .map(|(row, (left, size))| (row, *left, *size))
        .collect();
    rows.sort_by(|a, b| ratio(b.1, b.2).total_cmp(&ratio(a.1, a.2)));
    rows
}

fn frozen_residual(
    network: &Network,
    frozen: &Frozen,
    x: &[f64],
    w: &[f64],
    q: &[f64],
    residual: &mut [f64],
) {
    let n = x.len();
    network.residual(x, frozen.t, &mut residual[..n]);
    network.system.rates.add_transposed(1.0, w, &mut residual[..n]);
    for (k, r) in residual[n..].iter_mut().enumerate() {
        *r = if frozen.held[k] { q[k] - frozen.targets[k] } else { w[k] };
    }
}

fn relative_frozen(
    network: &Network,
    frozen: &Frozen,
    x: &[f64],
    w: &[f64],
    scratch: &mut Scratch,
) -> (f64, usize) {
    let n = x.len();
    let Scratch { residual, sizes, .. } = scratch;
    network.term_sizes(x, frozen.t, &mut sizes[..n]);
    // What unknowns far below their floors leave over is rounding of the others: currents of 1e-20 A need not balance.
    for (row, size) in sizes[..n].iter_mut().enumerate() {
        for (column, value) in network.system.conductances.row(row) {
            *size += UNNOTICED * (value * frozen.floors[column]).abs();
        }
    }
    for (k, w) in w.iter().enumerate() {
        for (row, factor) in network.system.rates.row(k) {
            sizes[row] += (factor * w).abs();
        }
    }
    worst(&residual[..n], &sizes[..n])
}
