//! Steps that do not succeed: detours over places where a method finds no way, and what is said in the end.

use super::Run;
use crate::sim::explain::{Failure, Moment, failure};
use crate::sim::methods::Method;
use crate::sim::newton::{Cut, worst_rows};
use crate::sim::op::{self, Trouble};

/// So many steps are taken with TR-BDF2 before the run's own method is tried again.
const DETOUR: u32 = 16;

/// Why a step was cut.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reason {
    /// The local error of an unknown, in units of its tolerance.
    Error(usize, f64),
    /// Newton's method did not converge; the equation satisfied worst.
    Newton(usize),
    /// The matrix was singular.
    Singular,
    /// A value was no number.
    NonFinite,
}

/// The last steps that were cut.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cuts {
    last: [Option<(f64, Reason)>; 3],
}

impl Cuts {
    pub fn note(&mut self, h: f64, reason: Reason) {
        self.last.rotate_left(1);
        self.last[2] = Some((h, reason));
    }

    /// Oldest first: the step and why it was cut.
    pub fn iter(&self) -> impl Iterator<Item = &(f64, Reason)> {
        self.last.iter().flatten()
    }

    fn last(&self) -> Option<Reason> {
        self.last[2].map(|(_, reason)| reason)
    }
}

/// A step that became too small.
#[derive(Clone, Debug)]
pub(crate) struct Stuck {
    pub cut: Cut,
    pub cuts: Cuts,
    /// Equations left unsatisfied in the last try: row, what is left over, the sum of its terms' sizes.
    pub rows: Vec<(usize, f64, f64)>,
    /// The unknowns where the step began.
    pub x: Vec<f64>,
}

impl Stuck {
    /// Whether the last step was cut by its error.
    pub fn is_by_error(&self) -> bool {
        matches!(self.cuts.last(), Some(Reason::Error(..)))
    }
}

impl Run<'_> {
    /// Where a Rosenbrock method finds no way, since a law has a kink, no slope or an infinite one where the step begins,
    /// TR-BDF2 takes the next steps: it asks for the laws where the step ends. Says whether it can be tried.
    pub(super) fn take_detour(&mut self) -> bool {
        if !self.method.is_rosenbrock() {
            return false;
        }
        self.home = self.method;
        self.method = Method::TrBdf2;
        self.detour = DETOUR;
        self.network.statistics.detours += 1;
        self.work.linearised = false;
        self.network.forget_pivots();
        true
    }

    /// Whether a Rosenbrock step that ends well has lost its way between: a trigger may flip and all be at rest again by the
    /// end, and only the values there are tested. The equations are asked at the middle of the dense output, as far as
    /// their misfit moves what storages hold.
    pub(super) fn loses_its_way(&mut self) -> bool {
        /// Dense output is of lower order than the step, and yet misses by a tenth of what a step may err at most, unless
        /// something bends within.
        const MOST: f64 = 0.5;
        let rosenbrock = matches!(self.method, Method::Rodas4 | Method::Rodas5p);
        if !rosenbrock || self.stored.is_empty() || self.network.system.is_linear() {
            return false;
        }
        let Run { network, state, next, weights, work, stored, .. } = self;
        let h = next.t - state.t;
        work.dense.unknowns(0.5, state, next, &mut work.x);
        let middle = state.t + 0.5 * h;
        network.evaluate(&work.x, middle);
        network.residual(&work.x, middle, &mut work.right);
        let [_, second, third] = &work.dense.q;
        for (k, rate) in work.sum.iter_mut().enumerate() {
            *rate = (next.q[k] - state.q[k] + 0.25 * (second[k] + third[k])) / h;
        }
        network.system.rates.add_transposed(1.0, &work.sum, &mut work.right);
        network.solve_dynamic(&mut work.right);
        let lost = |k: &u32| {
            let k = *k as usize;
            let size = work.right[k].abs();
            size.is_nan() || size > MOST * weights[k]
        };
        stored.iter().any(lost)
    }

    /// Comes back from a detour when it has lasted long enough.
    pub(super) fn end_detour(&mut self) {
        if self.detour == 0 {
            return;
        }
        self.detour -= 1;
        if self.detour == 0 && !self.index2 {
            self.method = self.home;
            self.work.linearised = false;
        }
    }

    /// Over an instant at which the equations are singular, to where a full search finds values just after it: charges go on
    /// at their rates, algebraic unknowns are sought anew.
    pub(super) fn step_over(&mut self, h: f64) -> bool {
        let Run { network, state, next, floors, work, .. } = self;
        next.copy_from(state);
        next.t = state.t + h;
        for (q, w) in next.q.iter_mut().zip(&next.w) {
            *q += h * w;
        }
        let mut slides = vec![];
        network.forget_pivots();
        let found = op::consistent_values(network, next, floors, &mut slides, &mut work.scratch);
        if found.is_err() || !slides.is_empty() {
            return false;
        }
        std::mem::swap(state, next);
        work.linearised = false;
        work.history.forget();
        let Run { network, state, controls, .. } = self;
        network.controls(&state.x, state.t, &mut controls.left);
        true
    }

    /// The failure of a step that became too small.
    pub(super) fn stuck(&self, cut: Cut, cuts: Cuts) -> Failure {
        let n = self.state.x.len();
        let scratch = &self.work.scratch;
        let rows = match cuts.last() {
            Some(Reason::Newton(_)) => {
                let mut rows = worst_rows(&scratch.residual[..n], &scratch.sizes[..n]);
                rows.truncate(3);
                rows
            }
            _ => vec![],
        };
        let stuck = Stuck { cut, cuts, rows, x: self.state.x.clone() };
        let network = &self.network;
        let trouble = Trouble::Stuck(Box::new(stuck));
        failure(network.system, Moment::Step, self.state.t, &trouble, &network.statistics)
    }
}
