//! The trapezoidal rule on charges and fluxes: Q₁ = Q₀ + h/2·(Q'₀ + Q'₁), order 2, A-stable.
//!
//! Algebraic equations hold at the step's right end, so that they do not ring; stiff charges do. The local error
//! h³/12·Q''' comes from the rates at three points; after a corner, where there are no three, one TR-BDF2 step is taken.

use super::{Work, filtered_error, trbdf2, weighted};
use crate::sim::network::Network;
use crate::sim::newton::{Cut, Stage, solve_stage};
use crate::sim::op::State;

pub(crate) fn step(
    network: &mut Network,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
) -> Result<f64, Cut> {
    let Some(before) = work.before else {
        return trbdf2::step(network, from, to, weights, work);
    };
    let h = to.t - from.t;
    let alpha = 2.0 / h;
    let Work { beta, sum, error, dense, scratch, w_before, .. } = work;
    to.x.copy_from_slice(&from.x);
    network.remember_junctions(&from.x);
    for (k, beta) in beta.iter_mut().enumerate() {
        *beta = -alpha * from.q[k] - from.w[k];
    }
    let stage = Stage { t: to.t, alpha, beta, weights, tolerance: trbdf2::ITERATION };
    solve_stage(network, &stage, &mut to.x, &mut to.q, scratch)?;
    let last = from.t - before;
    for k in 0..to.q.len() {
        to.w[k] = alpha * to.q[k] + beta[k];
        sum[k] = h * h * h / 6.0 * second_difference(h, last, w_before[k], from.w[k], to.w[k]);
    }
    filtered_error(network, alpha, sum, error);
    dense.hermite(from, to);
    Ok(weighted(error, weights))
}

/// The second divided difference over steps `last` and `h`: half a second derivative.
pub(super) fn second_difference(h: f64, last: f64, a: f64, b: f64, c: f64) -> f64 {
    ((c - b) / h - (b - a) / last) / (h + last)
}
