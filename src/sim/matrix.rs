//! A matrix of a run: values of a fixed pattern, and its factors, which serve again as long as they can.

use super::statistics::Statistics;
use super::system::MatrixPlan;
use crate::linear::{Factors, Flat, Orders, Singular, Unfit};

/// A matrix of fixed pattern with its factors.
#[derive(Debug, Default)]
pub(crate) struct Matrix {
    pub values: Vec<f64>,
    factors: Option<Factors>,
    /// How many factors the run had made until these.
    number: u64,
    /// Whether entries that were 0 have become others.
    changes: bool,
    /// The modes that the pivots are for, and pivots that others had.
    modes: Vec<f64>,
    kept: Vec<(Vec<f64>, Factors)>,
}

/// Pivots are kept for so many sets of modes.
const MOST_KEPT: usize = 8;

impl Matrix {
    /// Puts the pivots away for when these modes come back, and takes those that the new ones had.
    pub fn change_modes(&mut self, modes: &[f64]) {
        if let Some(factors) = self.factors.take() {
            if self.kept.len() >= MOST_KEPT {
                self.kept.remove(0);
            }
            self.kept.push((std::mem::take(&mut self.modes), factors));
        }
        if let Some(known) = self.kept.iter().position(|(known, _)| known == modes) {
            let (known, factors) = self.kept.remove(known);
            (self.modes, self.factors) = (known, Some(factors));
        } else {
            self.modes.clear();
            self.modes.extend_from_slice(modes);
        }
    }

    pub fn forget(&mut self) {
        self.factors = None;
        self.kept.clear();
    }

    /// The first pivots are for the modes that the run begins with.
    pub fn begin(&mut self, modes: &[f64]) {
        if self.modes.is_empty() {
            self.modes.extend_from_slice(modes);
        }
    }

    /// Replays the chosen pivots; chooses new ones where the guard objects.
    pub fn factorise(
        &mut self,
        plan: &MatrixPlan,
        orders: &mut Orders,
        statistics: &mut Statistics,
    ) -> Result<(), Singular> {
        self.number = statistics.factorisations + statistics.refactorisations + 1;
        if let Some(factors) = &mut self.factors {
            statistics.refactorisations += 1;
            match factors.refactor(&self.values) {
                Ok(()) => {
                    statistics.symmetric += u64::from(factors.is_symmetric());
                    return Ok(());
                }
                Err(unfit) => self.changes |= unfit == Unfit::Entry,
            }
        }
        statistics.factorisations += 1;
        self.factors = None;
        let factors = Factors::new(&plan.pattern, &self.values, self.changes, orders)?;
        statistics.symmetric += u64::from(factors.is_symmetric());
        self.factors = Some(factors);
        Ok(())
    }

    /// Its two triangles as flat lists, where solving goes by these; with a number that no other factors of the run have.
    pub fn flat(&self) -> (u64, Option<&Flat<f64>>) {
        (self.number, self.factors.as_ref().and_then(Factors::flat))
    }

    /// Whether its determinant is negative, where that can be told.
    pub fn is_negative(&self) -> Option<bool> {
        self.factors.as_ref()?.is_negative()
    }

    /// Solves in place.
    pub fn solve(&mut self, statistics: &mut Statistics, vector: &mut [f64]) {
        statistics.solves += 1;
        if let Some(factors) = &mut self.factors {
            factors.solve(vector);
        }
    }

    /// Whether its factors are those of a symmetric matrix.
    pub fn is_symmetric(&self) -> bool {
        self.factors.as_ref().is_some_and(Factors::is_symmetric)
    }
}
