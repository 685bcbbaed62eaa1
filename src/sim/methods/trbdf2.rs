//! TR-BDF2: the trapezoidal rule to t + γh, then BDF2 over the whole step. One matrix, L-stable, order 2.
//!
//! ```text
//! γ = 2 − √2, d = γ/2, w = √2/4
//! Q(γ) = Q₀ + h·d·(Q'₀ + Q'(γ))
//! Q₁   = Q₀ + h·(w·Q'₀ + w·Q'(γ) + d·Q'₁)
//! δQ   = h·((1 − 4w)/3·Q'₀ + 1/3·Q'(γ) − 2d/3·Q'₁)
//! ```
//!
//! Rates are kept for each charge, and algebraic equations hold at each stage, so that nothing rings.
//! Source: M. E. Hosea, L. F. Shampine, Analysis and implementation of TR-BDF2, Appl. Numer. Math. 20:21-37, 1996.

use super::{Work, filtered_error, weighted};
use crate::sim::abreast::Company;
use crate::sim::network::Network;
use crate::sim::newton::{Cut, Stage, solve_stage};
use crate::sim::op::State;
use std::f64::consts::SQRT_2;

/// Error of iteration against the tolerance of the step.
pub(crate) const ITERATION: f64 = 0.02;

/// The part of the step at which the middle stage stands.
const GAMMA: f64 = 2.0 - SQRT_2;

pub(crate) async fn step(
    network: &mut Network<'_>,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
    company: Company<'_>,
) -> Result<f64, Cut> {
    const D: f64 = GAMMA / 2.0;
    const W: f64 = SQRT_2 / 4.0;
    let h = to.t - from.t;
    let alpha = 1.0 / (D * h);
    let unconfirmed = work.unconfirmed;
    let Work {
        x, q, w, beta, sum, error, rate_weights, rate_floors, dense, scratch, history, ..
    } = work;

    let middle = from.t + GAMMA * h;
    history.predict(from, middle, x);
    network.remember_junctions(&from.x);
    for (k, beta) in beta.iter_mut().enumerate() {
        *beta = -alpha * from.q[k] - from.w[k];
    }
    let stage = Stage { t: middle, alpha, beta, weights, tolerance: ITERATION, unconfirmed };
    solve_stage(network, &stage, x, q, scratch, company).await?;
    for (k, w) in w.iter_mut().enumerate() {
        *w = alpha * q[k] + beta[k];
    }

    history.predict_on(from, x, middle, to);
    for (k, beta) in beta.iter_mut().enumerate() {
        *beta = -alpha * (from.q[k] + h * W * (from.w[k] + w[k]));
    }
    let stage = Stage { t: to.t, alpha, beta, weights, tolerance: ITERATION, unconfirmed };
    network.remember_junctions(x);
    solve_stage(network, &stage, &mut to.x, &mut to.q, scratch, company).await?;
    for (k, rate) in to.w.iter_mut().enumerate() {
        *rate = alpha * to.q[k] + beta[k];
    }

    for (k, sum) in sum.iter_mut().enumerate() {
        *sum = h * ((1.0 - 4.0 * W) / 3.0 * from.w[k] + w[k] / 3.0 - 2.0 * D / 3.0 * to.w[k]);
    }
    filtered_error(network, alpha, sum, error);
    dense.parabolas(GAMMA, from, x, to);
    let rates = rate_error(h, q, from, to, [rate_weights, rate_floors]);
    Ok(weighted(error, weights).max(rates))
}

/// The largest weighted error of rates where the circuit is of index 2. Charges follow there from what sources prescribe,
/// at the middle stage as at the ends, and only their rates carry an error: by as much as it makes the cubic through the
/// ends miss the charge at the middle stage.
fn rate_error(
    h: f64,
    middle: &[f64],
    from: &State,
    to: &State,
    [weights, floors]: [&[f64]; 2],
) -> f64 {
    /// Of equal and opposite errors of the rates at the ends the cubic shows θ·(1 − θ)·h.
    const SEEN: f64 = GAMMA * (1.0 - GAMMA);
    let mut largest: f64 = 0.0;
    for (k, weight) in weights.iter().enumerate() {
        if weight.is_infinite() {
            continue;
        }
        let line = (1.0 - GAMMA) * from.q[k] + GAMMA * to.q[k];
        let change = to.q[k] - from.q[k];
        let (left, right) = (h * from.w[k] - change, change - h * to.w[k]);
        let curve = SEEN * (left + GAMMA * (right - left));
        let missed = ((line + curve - middle[k]).abs() - floors[k]).max(0.0);
        largest = largest.max(missed / (SEEN * h * weight));
    }
    largest
}
