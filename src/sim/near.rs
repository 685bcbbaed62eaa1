//! Stages next to the one before: the factors at hand serve, as long as it is known how fast iterations with them converge.
//!
//! An iteration with factors of an earlier stage leaves ρ times its update. ρ is measured by taking two of them; the stages
//! after that are content with one whose update is small enough for what it leaves, and evaluate the laws without their
//! derivatives. Now and then ρ is measured again. Where it is large, the stage is solved by Newton's method with new
//! factors.

use super::abreast::Company;
use super::methods::weighted;
use super::network::Network;
use super::newton::{GROWN, MEASURED_AGAIN, Scratch, Stage, stage_residual};

/// The largest update that no second one confirms: beyond a kink ρ is not what it was.
const NEAR: f64 = 0.1;
/// Iterations that converge more slowly than this ask for new factors,
const SLOW: f64 = 0.25;
/// and so many stages do without a try then, twice as many each time.
const LONGEST_PAUSE: u32 = 64;

/// Where so many stages of junctions, one after another, have taken two iterations, one with new factors is the cheaper:
const TWICE: u32 = 4;
/// so many stages take that.
const CHEAPER: u32 = 16;

/// ρ is trusted for twice as many stages each time that it has grown by no more than this, and for so many at most.
const STEADY: f64 = 2.0;
const LONGEST_TRUST: u32 = 64;

/// What is known of iterations with the factors at hand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// ρ; infinite where it is not known.
    rate: f64,
    /// Stages since it has been measured, and how many may pass until it is measured again.
    age: u32,
    trusted: u32,
    /// Stages that are still to do without, and how many the next time.
    wait: u32,
    pause: u32,
    /// Stages that took two iterations, one after another.
    twice: u32,
}

impl Near {
    pub const UNKNOWN: Near =
        Near { rate: f64::INFINITY, age: 0, trusted: MEASURED_AGAIN, wait: 0, pause: 1, twice: 0 };

    /// New factors: ρ is not known.
    pub fn forget(&mut self) {
        self.rate = f64::INFINITY;
        self.trusted = MEASURED_AGAIN;
    }

    fn failed(&mut self) {
        self.forget();
        self.wait = self.pause;
        self.pause = (2 * self.pause).min(LONGEST_PAUSE);
    }
}

/// Whether a stage may be solved with the factors at hand.
pub(crate) fn may_solve(network: &Network, stage: &Stage, x: &[f64], near: &mut Near) -> bool {
    if !network.factors_serve(stage.alpha) || !network.junctions_rest(x) {
        return false;
    }
    let waits = near.wait > 0;
    near.wait = near.wait.saturating_sub(1);
    !waits
}

/// Solves a stage with the factors at hand. Says whether it has; otherwise `x` is a guess as good as before, or better.
pub(crate) async fn solve(
    network: &mut Network<'_>,
    stage: &Stage<'_>,
    x: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
    company: Company<'_>,
) -> bool {
    let n = x.len();
    scratch.guess.copy_from_slice(x);
    let Some(update) = iterate(network, stage, x, q, scratch, company).await else { return false };
    let first = update.size;
    let Scratch { near, residual, .. } = scratch;
    let known = GROWN * near.rate * first <= stage.unconfirmed && near.age < near.trusted;
    if first == 0.0 || (known && (first <= NEAR || network.meets_no_kink(x))) {
        near.age += 1;
        near.twice = 0;
        update.follow(network, &residual[..n], q);
        return true;
    }
    let Some(update) = iterate(network, stage, x, q, scratch, company).await else { return false };
    let second = update.size;
    let Scratch { near, residual, .. } = scratch;
    let rate = second / first;
    if rate > SLOW || rate / (1.0 - rate) * second > stage.unconfirmed {
        near.failed();
        if network.system.has_junctions() && rate > 1.0 {
            // An exponential makes much of a step too far.
            x.copy_from_slice(&scratch.guess[..n]);
        }
        return false;
    }
    // What has not become larger is trusted for longer.
    let steady = rate <= STEADY * near.rate;
    near.trusted = if steady { (2 * near.trusted).min(LONGEST_TRUST) } else { MEASURED_AGAIN };
    (near.rate, near.age, near.pause) = (rate, 0, 1);
    near.twice += 1;
    if near.twice >= TWICE && network.system.has_junctions() {
        (near.twice, near.wait) = (0, CHEAPER);
    }
    update.follow(network, &residual[..n], q);
    true
}

/// What an iteration did.
struct Update {
    /// The weighted size of what it has subtracted from the unknowns.
    size: f64,
    /// Whether linear charges have followed already.
    followed: bool,
}

impl Update {
    /// Lets the charges follow what was subtracted, with the linear terms, as the equations just solved have them.
    fn follow(self, network: &Network, subtracted: &[f64], q: &mut [f64]) {
        if !self.followed {
            network.add_linear_change(-1.0, subtracted, q);
        }
        network.add_curved_change(-1.0, subtracted, q);
    }
}

/// One iteration, with what it has subtracted from `x` in the residual's place; nothing where that is no number.
async fn iterate(
    network: &mut Network<'_>,
    stage: &Stage<'_>,
    x: &mut [f64],
    q: &mut [f64],
    scratch: &mut Scratch,
    company: Company<'_>,
) -> Option<Update> {
    let n = x.len();
    network.statistics.iterations += 1;
    let residual = &mut scratch.residual[..n];
    let followed = match company {
        Some(seated) => seated.iterate(network, stage, x, q, residual).await,
        None => false,
    };
    if !followed {
        network.evaluate(x, stage.t);
        network.charges(x, q);
        stage_residual(network, stage, x, q, residual, &mut scratch.rates);
        network.solve_dynamic(residual);
    }
    let size = weighted(residual, stage.weights);
    if !size.is_finite() {
        scratch.near.failed();
        return None;
    }
    for (x, dx) in x.iter_mut().zip(residual.iter()) {
        *x -= dx;
    }
    Some(Update { size, followed })
}
