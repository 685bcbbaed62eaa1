//! The trapezoidal rule on charges and fluxes: Q₁ = Q₀ + h/2·(Q'₀ + Q'₁), order 2, A-stable.
//!
//! Algebraic equations hold at the step's right end, so that they do not ring; stiff charges do. The local error
//! h³/12·x''' comes from how far the step leads away from the parabola through the points before it, which costs nothing;
//! where that is large, or there are not yet enough points, h³/12·Q''' from the rates at three. After a corner, where
//! there is no past at all, one TR-BDF2 step is taken.

use super::{Work, filtered_error, trbdf2, weighted};
use crate::sim::abreast::Company;
use crate::sim::network::Network;
use crate::sim::newton::{Cut, Stage, solve_stage};
use crate::sim::op::State;

/// The local error is this part of h³·x'''.
const ERROR: f64 = 1.0 / 12.0;

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
    let alpha = 2.0 / h;
    let unconfirmed = work.unconfirmed;
    let Work { beta, sum, error, dense, scratch, history, x, .. } = work;
    let missed = history.predict(from, to.t, x);
    // Linear equations are solved from no guess.
    let guessed = !network.system.is_linear();
    if guessed {
        to.x.copy_from_slice(x);
    }
    let followed = missed.filter(|_| guessed);
    if let Some(missed) = followed {
        history.lead(missed, h, &mut to.x);
    }
    network.remember_junctions(&from.x);
    for (beta, (q, w)) in beta.iter_mut().zip(from.q.iter().zip(&from.w)) {
        *beta = -alpha * q - w;
    }
    let stage = Stage { t: to.t, alpha, beta, weights, tolerance: trbdf2::ITERATION, unconfirmed };
    solve_stage(network, &stage, &mut to.x, &mut to.q, scratch, company).await?;
    for (rate, (q, beta)) in to.w.iter_mut().zip(to.q.iter().zip(beta.iter())) {
        *rate = alpha * q + beta;
    }
    dense.follow_past();
    if let Some(missed) = followed {
        history.learn(missed, h, x, &to.x);
    }
    let away = missed.map_or(f64::INFINITY, |missed| {
        led_away(ERROR / (missed + ERROR), x, &to.x, error);
        weighted(error, weights)
    });
    if away <= SURE {
        return Ok(away);
    }
    let last = from.t - before;
    let rates = history.w.iter().zip(&from.w).zip(&to.w);
    for (sum, ((before, from), to)) in sum.iter_mut().zip(rates) {
        *sum = h * h * h / 6.0 * second_difference(h, last, *before, *from, *to);
    }
    filtered_error(network, alpha, sum, error);
    Ok(weighted(error, weights).min(away))
}

/// Above this part of the tolerance what led away from the prediction may be a layer that dies out at once, of which the
/// rates say, through the step's own matrix, how little it matters.
pub(super) const SURE: f64 = 0.5;

/// The error of a step that led elsewhere than predicted.
pub(super) fn led_away(part: f64, predicted: &[f64], reached: &[f64], error: &mut [f64]) {
    for ((error, reached), predicted) in error.iter_mut().zip(reached).zip(predicted) {
        *error = part * (reached - predicted);
    }
}

/// The second divided difference over steps `last` and `h`: half a second derivative.
pub(super) fn second_difference(h: f64, last: f64, a: f64, b: f64, c: f64) -> f64 {
    ((c - b) / h - (b - a) / last) / (h + last)
}
