//! The method that suits a step limit: where the limit, not the error, sets the step, a method of fourth or fifth order
//! pays for stages that gain nothing, and the trapezoidal rule takes the same steps with one solution each. So it does for
//! TR-BDF2 with two, from when all that is fast has died out until something happens.

use super::Run;
use crate::sim::methods::{Method, SMOOTH};
use crate::sim::op;

/// A step that the limit binds errs by less than this part of its tolerance,
const SMALL: f64 = 0.05;
/// and so many of them one after another change the method.
const BOUND: u32 = 10;
/// A step of the trapezoidal rule that errs by more than this part of its tolerance is as long as the error lets it be;
const LARGE: f64 = 0.3;
/// where that is less than this part of the limit, so many times more often than not, the other method comes back.
const SHORT: f64 = 0.2;
const STRUGGLES: u32 = 20;
/// Of TR-BDF2, which is left for as long as a stretch between corners lasts at most, so many steps that the limit binds
/// will do.
const BOUND_AT_ONCE: u32 = 2;
/// Each time it comes back the limit must bind this many times as long.
const PATIENCE: u32 = 2;

/// A limit of no more than this part of the run is likely to bind.
const LIKELY: f64 = 0.05;
/// Why the trapezoidal rule is taken.
const BINDS: &str = "the step limit binds";

/// What the last steps say of the limit.
#[derive(Default)]
pub(super) struct Bound {
    /// Steps, one after another, that the limit bound.
    bound: u32,
    /// Steps of the trapezoidal rule that it did not, less those that it did.
    struggles: u32,
    /// The method that was left for the trapezoidal rule.
    left: Option<Method>,
    /// How often it has come back.
    returns: u32,
}

impl Run<'_> {
    /// Begins with the trapezoidal rule where the limit is likely to bind: linear equations change fast after corners alone.
    pub(super) fn expect_limit(&mut self) {
        let limit = self.settings.hmax.filter(|_| self.settings.method == Method::Auto);
        let binds = limit.is_some_and(|limit| limit <= LIKELY * self.settings.stop);
        let changes = matches!(self.method, Method::Rodas4 | Method::Rodas5p);
        if binds && changes && self.network.system.is_linear() {
            self.bound.left = Some(self.method);
            self.go_on_with(Method::Trapezoidal, BINDS);
        }
    }

    /// Changes the method where the step limit says so, and back. Only one that nobody asked for is changed.
    pub(super) fn suit_limit(&mut self, error: f64, h: f64) {
        let limit = match self.settings.hmax {
            Some(limit) if self.settings.method == Method::Auto && self.detour == 0 => limit,
            _ => return,
        };
        let bound = &mut self.bound;
        match bound.left {
            None if matches!(self.method, Method::Rodas4 | Method::Rodas5p) => {
                let binds = error < SMALL && h > 0.99 * limit;
                bound.bound = if binds { bound.bound + 1 } else { 0 };
                if bound.bound >= BOUND * PATIENCE.saturating_pow(bound.returns)
                    && self.find_rates()
                {
                    let bound = &mut self.bound;
                    bound.left = Some(self.method);
                    (bound.bound, bound.struggles) = (0, 0);
                    self.go_on_with(Method::Trapezoidal, BINDS);
                }
            }
            None if self.method == Method::TrBdf2 && !self.index2 => {
                let binds = error < SMALL && h > 0.99 * limit;
                bound.bound = if binds { bound.bound + 1 } else { 0 };
                if bound.bound >= BOUND_AT_ONCE {
                    (bound.left, bound.bound) = (Some(self.method), 0);
                    self.method = Method::Trapezoidal;
                }
            }
            Some(Method::TrBdf2) if error > LARGE || h < SHORT * limit => self.leave_bound(),
            Some(Method::TrBdf2) => {}
            Some(other) if self.method == Method::Trapezoidal => {
                if error > LARGE && h < SHORT * limit {
                    bound.struggles += 1;
                } else if h > 0.99 * limit {
                    bound.struggles = bound.struggles.saturating_sub(1);
                }
                if bound.struggles >= STRUGGLES {
                    bound.left = None;
                    bound.returns += 1;
                    self.go_on_with(other, SMOOTH);
                }
            }
            _ => {}
        }
    }

    /// Something happens: back to TR-BDF2, where the limit has led away from it.
    pub(super) fn leave_bound(&mut self) {
        if self.bound.left == Some(Method::TrBdf2) {
            self.bound = Bound { returns: self.bound.returns, ..Bound::default() };
            self.method = Method::TrBdf2;
        }
    }

    /// Finds the rates of the charges, which Rosenbrock methods do without. Says whether they were found.
    fn find_rates(&mut self) -> bool {
        let Run { network, state, floors, work, .. } = self;
        let kept = state.clone();
        let mut slides = vec![];
        let found = op::consistent_values(network, state, floors, &mut slides, &mut work.scratch);
        let found = found.is_ok() && slides.is_empty();
        state.x.copy_from_slice(&kept.x);
        if !found {
            state.copy_from(&kept);
        }
        work.history.forget();
        work.linearised = false;
        found
    }

    pub(super) fn go_on_with(&mut self, method: Method, reason: &str) {
        (self.method, self.home) = (method, method);
        self.network.statistics.method.replace_range(.., method.name());
        self.network.statistics.reason.replace_range(.., reason);
    }
}
