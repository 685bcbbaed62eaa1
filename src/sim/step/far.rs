//! Steps by exponentials, which go as far as a corner, and the way back to other methods where that does not do.

use super::{Run, absolute_tolerances, pilot, take_seen};
use crate::sim::abreast::alone;
use crate::sim::explain::Failure;
use crate::sim::methods;

/// The part of what is left of the way that is not worth a step of its own.
const SLIVER: f64 = 4.0;
/// A step that the space is not enough for is cut to this part, and grows to so many times its length after that.
const CUT: f64 = 0.2;
const GROWTH: f64 = 4.0;
/// So many times more often than steps do they may be cut; what swings to and fro is for other methods.
const PATIENCE: u32 = 8;
/// A step that the space was not enough for took more solutions than so many steps under a limit would.
const STEPS: f64 = 16.0;

/// What steps by exponentials have been like.
#[derive(Debug)]
pub(super) struct Far {
    /// The longest step worth trying, and how many more may be cut.
    most: f64,
    patience: u32,
}

impl Default for Far {
    fn default() -> Far {
        Far { most: f64::INFINITY, patience: PATIENCE }
    }
}

impl Run<'_> {
    /// The step to try next where the run goes by exponentials.
    pub(super) fn far_step(&self, remaining: f64) -> Option<f64> {
        let space = self.work.dense.space.as_ref()?;
        let (farthest, most) = (space.farthest(self.state.t), self.far.most);
        let all = SLIVER * farthest > remaining && most >= remaining;
        Some(if all { remaining } else { farthest.min(most) })
    }

    /// The length to try after one for which the space was not enough; none where that is better left to others.
    pub(super) fn cut_far(&mut self, h: f64) -> Option<f64> {
        self.far.patience -= 1;
        let shorter = CUT * h;
        let limit = self.settings.hmax.unwrap_or(0.0);
        let goes_on = self.far.patience > 0 && shorter > (STEPS * limit).max(self.smallest);
        goes_on.then_some(shorter)
    }

    /// Learns from an accepted step.
    pub(super) fn learn_far(&mut self, h: f64, failed: bool) {
        self.far.most = if failed { GROWTH * h } else { f64::INFINITY };
        self.far.patience = (self.far.patience + 1).min(PATIENCE);
    }

    /// After a corner the first step is as long as did after the last one of its kind, where longer ones had failed.
    pub(super) fn begin_far(&mut self, known: Option<f64>) {
        self.far.most = known.unwrap_or(f64::INFINITY);
    }

    /// What a pilot pass would have found beforehand.
    pub(super) fn learn_magnitudes(&mut self) -> Result<(), Failure> {
        if let Some(seen) = alone(pilot(self.network.system, self.settings, None))? {
            take_seen(&mut self.network, &seen);
            self.absolute = absolute_tolerances(self.network.system, self.settings, Some(&seen));
        }
        self.weigh();
        Ok(())
    }

    /// Goes on with the method that suits the circuit otherwise.
    pub(super) fn leave_exponentials(&mut self) -> Result<(), Failure> {
        self.work.dense.space = None;
        self.learn_magnitudes()?;
        let (method, reason) = methods::choose(&self.network, self.index2);
        self.go_on_with(method, reason);
        self.expect_limit();
        self.work.history.forget();
        self.work.linearised = false;
        self.h = 1e-3 * self.distance();
        Ok(())
    }
}
