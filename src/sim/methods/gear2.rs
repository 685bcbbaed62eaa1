//! Gear's method of order 2 (BDF2) on charges and fluxes, with variable steps.
//!
//! ```text
//! h·Q'₁ = (1 + 2ω)/(1 + ω)·Q₁ − (1 + ω)·Q₀ + ω²/(1 + ω)·Q₋₁,    ω = h/h₋₁
//! δQ    = h³/6·(1 + ω)²/(ω·(1 + 2ω))·Q'''
//! ```
//!
//! Steps grow by less than 1 + √2, within which the method is stable. After a corner one TR-BDF2 step is taken.
//! Source: E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, III.5.

use super::trapezoidal::{SURE, led_away, second_difference};
use super::{Work, filtered_error, trbdf2, weighted};
use crate::sim::abreast::Company;
use crate::sim::network::Network;
use crate::sim::newton::{Cut, Stage, solve_stage};
use crate::sim::op::State;

pub(crate) async fn step(
    network: &mut Network<'_>,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
    company: Company<'_>,
) -> Result<f64, Cut> {
    let Some(before) = work.history.before() else {
        return trbdf2::step(network, from, to, weights, work, company).await;
    };
    let h = to.t - from.t;
    let last = from.t - before;
    let ratio = h / last;
    let alpha = (1.0 + 2.0 * ratio) / (1.0 + ratio) / h;
    let unconfirmed = work.unconfirmed;
    let Work { beta, sum, error, dense, scratch, history, x, .. } = work;
    let missed = history.predict(from, to.t, x);
    to.x.copy_from_slice(x);
    network.remember_junctions(&from.x);
    for (k, beta) in beta.iter_mut().enumerate() {
        *beta = (ratio * ratio / (1.0 + ratio) * history.q[k] - (1.0 + ratio) * from.q[k]) / h;
    }
    let stage = Stage { t: to.t, alpha, beta, weights, tolerance: trbdf2::ITERATION, unconfirmed };
    solve_stage(network, &stage, &mut to.x, &mut to.q, scratch, company).await?;
    let constant = (1.0 + ratio) * (1.0 + ratio) / (ratio * (1.0 + 2.0 * ratio));
    for (k, rate) in to.w.iter_mut().enumerate() {
        *rate = alpha * to.q[k] + beta[k];
    }
    dense.follow_past();
    let away = missed.map_or(f64::INFINITY, |missed| {
        led_away(constant / (6.0 * missed + constant), x, &to.x, error);
        weighted(error, weights)
    });
    if away <= SURE {
        return Ok(away);
    }
    for (k, sum) in sum.iter_mut().enumerate() {
        let third = 2.0 * second_difference(h, last, history.w[k], from.w[k], to.w[k]);
        *sum = h * h * h / 6.0 * constant * third;
    }
    filtered_error(network, alpha, sum, error);
    Ok(weighted(error, weights).min(away))
}
