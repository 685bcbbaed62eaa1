//! Rows of a run at steps and on grids, and the ways it ends early.

use super::Run;
use crate::diagnostic::Diagnostic;
use crate::sim::explain::{Failure, FailureKind, Moment, failure};
use crate::sim::op::Trouble;
use crate::sim::output::Stopped;
use crate::source::Span;
use std::io;
use std::sync::atomic::Ordering;

impl Run<'_> {
    pub(super) fn check_interrupt(&self) -> Result<(), Failure> {
        let interrupted =
            self.settings.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed));
        if !interrupted {
            return Ok(());
        }
        let message = format!("interrupted at t = {:.6e} s", self.state.t);
        Err(Failure {
            kind: FailureKind::Interrupted,
            diagnostic: Box::new(Diagnostic::error("E0808", Span::NONE, message)),
            time: self.state.t,
            statistics: Box::new(self.network.statistics.clone()),
        })
    }

    pub(super) fn row_failure(&self, stopped: Stopped) -> Failure {
        match stopped {
            Stopped::Write(error) => self.write_failure(&error),
            Stopped::Values(time, cut) => {
                let network = &self.network;
                let trouble = Trouble::Cut(cut);
                failure(network.system, Moment::Row, time, &trouble, &network.statistics)
            }
        }
    }

    fn write_failure(&self, error: &io::Error) -> Failure {
        let message = format!("a row cannot be written: {error}");
        Failure {
            kind: FailureKind::Output,
            diagnostic: Box::new(Diagnostic::error("E0905", Span::NONE, message)),
            time: self.state.t,
            statistics: Box::new(self.network.statistics.clone()),
        }
    }

    /// The first row of a run that follows steps.
    pub(super) fn rows_first(&mut self) -> Result<(), Failure> {
        self.row_here_at(0.0)
    }

    /// A row at the present state, in a run that follows steps.
    pub(super) fn row_here(&mut self) -> Result<(), Failure> {
        self.row_here_at(self.state.t)
    }

    fn row_here_at(&mut self, time: f64) -> Result<(), Failure> {
        let Run { network, state, weights, work, index2, rows, .. } = self;
        let Some(rows) = rows.as_mut().filter(|rows| rows.follows_steps()) else { return Ok(()) };
        let outcome = rows.here(network, state, time, *index2, weights, work);
        outcome.map_err(|stopped| self.row_failure(stopped))
    }

    /// The rows of a grid or list that are due now.
    pub(super) fn rows_at_state(&mut self) -> Result<(), Failure> {
        let as_is = self.index2;
        self.rows_due(as_is)
    }

    /// The same with the unknowns as they stand.
    pub(super) fn rows_as_arrived(&mut self) -> Result<(), Failure> {
        self.rows_due(true)
    }

    /// The first rows of a run that starts from stated values, with nothing solved: what is not stored is 0.
    pub(super) fn rows_as_stated(&mut self) -> Result<(), Failure> {
        let solved = self.state.x.clone();
        self.network.system.keep_stored(&mut self.state.x);
        let outcome = self.rows_due(true);
        self.state.x = solved;
        outcome
    }

    fn rows_due(&mut self, as_is: bool) -> Result<(), Failure> {
        let Run { network, state, weights, work, rows, .. } = self;
        let Some(rows) = rows.as_mut() else { return Ok(()) };
        let outcome = rows.at(network, state, state.t, as_is, weights, work);
        outcome.map_err(|stopped| self.row_failure(stopped))
    }
}
