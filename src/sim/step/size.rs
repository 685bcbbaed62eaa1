//! The size of the next step from the errors of the last ones.

use super::Run;
use crate::sim::methods::{self, Method};

/// The part of the step that an error allows which is taken.
const SAFETY: f64 = 0.9;
/// A step becomes no smaller than this part of the last one without having failed.
const LEAST: f64 = 0.2;
/// Errors below this say nothing of how the solution changes.
const NOTHING: f64 = 1e-2;

/// Rosenbrock methods take this part of the step that an error and how it changes allow; and parts of the power of both.
const STEADY: f64 = 0.95;
const INTEGRAL: f64 = 0.3;
const PROPORTIONAL: f64 = 0.4;

/// The factor by which a step is shortened whose error was too large.
pub(super) fn after_error(error: f64, power: f64) -> f64 {
    (SAFETY * methods::growth(error, power)).clamp(0.1, 0.9)
}

/// Where factors are dear, a step that could change by these factors keeps its length.
const KEPT: std::ops::Range<f64> = 0.95..1.7;

impl Run<'_> {
    /// A step on the way to where the last one failed: something happens before that, which errors do not show until it
    /// does. Half of the way is gone at most, or as much as the step before went.
    pub(super) fn before_wall(&self, h: f64) -> f64 {
        let way = self.wall - self.state.t;
        match self.last {
            Some((_, last)) if way > 0.0 && self.method.error_power() <= 3.0 => {
                h.min((0.5 * way).max(last))
            }
            _ => h,
        }
    }

    /// The factor by which the next step is longer than this one, which had `error` in parts of its tolerance.
    pub(super) fn factor(&mut self, error: f64, h: f64, failed: bool, power: f64) -> f64 {
        // Gear's method is stable while steps grow by less than 1 + √2.
        let most = if self.method == Method::Gear2 { 2.0 } else { 6.0 };
        let size = error.max(1e-12);
        let before = self.last.replace((size.max(NOTHING), h));
        let most_allowed = if failed { 1.0 } else { most };
        // Most steps under a limit err by next to nothing, and need no root to know it.
        let longer = before.is_none_or(|(_, last)| h >= 0.7 * last);
        if longer && size <= (SAFETY / most).powi(power as i32).min(NOTHING) {
            return most_allowed;
        }
        let mut factor = SAFETY * methods::growth(size, power);
        match before {
            // Proportional and integral control (E. Hairer, G. Wanner, Solving ODEs II, 1996, IV.2): of long steps every error
            // is of something else, and what grows after a small one is refused.
            Some((last_error, _)) if self.method.is_rosenbrock() => {
                let by = |error: f64, part: f64| libm::pow(error, part / power);
                factor = STEADY * by(size, -INTEGRAL - PROPORTIONAL) * by(last_error, PROPORTIONAL);
            }
            Some((last_error, last_h)) => {
                // Gustafsson's predictive controller: the error of the last step says how the solution changes.
                let trend = h / last_h * methods::growth(size / last_error, power);
                factor = factor.min(factor * trend.max(LEAST)).max(LEAST);
            }
            None => {}
        }
        let keeps = KEPT.contains(&factor) && self.network.favours_equal_steps();
        if keeps && !failed { 1.0 } else { factor.clamp(LEAST, most_allowed) }
    }
}
