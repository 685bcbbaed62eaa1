//! What a run cost: counters that are the same on every machine.

use crate::diagnostic::Diagnostic;
use serde::Serialize;
use std::fmt;

/// Counters of one run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// The integration method that ran.
    pub method: String,
    /// Why it was chosen.
    pub reason: String,
    /// Equations of the circuit, charges and fluxes, entries of the matrix.
    pub equations: usize,
    /// Charges and fluxes.
    pub charges: usize,
    /// Entries of the matrix.
    pub entries: usize,
    /// Steps that were kept.
    pub accepted: u64,
    /// Steps that were cut, by cause.
    pub rejected: Rejected,
    /// Evaluations of the laws, values only or with their derivatives.
    pub evaluations: u64,
    /// Evaluations that also gave derivatives.
    pub jacobians: u64,
    /// Factorisations with a new choice of pivots.
    pub factorisations: u64,
    /// Factorisations that replayed the chosen pivots.
    pub refactorisations: u64,
    /// How many of both were those of a symmetric matrix, without a choice of pivots.
    #[serde(skip_serializing_if = "is_zero")]
    pub symmetric: u64,
    /// Solutions of a linear system.
    pub solves: u64,
    /// Newton iterations of implicit steps, of starts and of operating points.
    pub iterations: u64,
    /// Changes of switches and of conditions.
    pub events: u64,
    /// Conditions that became ramps because no side of them lasted.
    pub slides: u64,
    /// Times that TR-BDF2 led round a place where the run's own method found no way.
    pub detours: u64,
    /// Corners of sources landed on.
    pub corners: u64,
    /// Rows written.
    pub rows: u64,
    /// Accepted steps of the pilot pass that finds the magnitudes of the unknowns.
    pub pilot: u64,
    /// What whoever started the run should know.
    #[serde(skip)]
    pub warnings: Vec<Diagnostic>,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Why steps were cut.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rejected {
    /// Local error above the tolerance.
    pub error: u64,
    /// Newton's method did not converge.
    pub newton: u64,
    /// A singular matrix.
    pub singular: u64,
    /// A value that is no number or infinite.
    pub non_finite: u64,
    /// A step redone to end on an event.
    pub event: u64,
}

impl Rejected {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.error + self.newton + self.singular + self.non_finite + self.event
    }
}

impl Statistics {
    /// As one JSON object, with `"schema": 1`.
    pub fn to_json(&self) -> serde_json::Value {
        let mut object = serde_json::Map::new();
        object.insert("schema".into(), 1.into());
        if let Ok(serde_json::Value::Object(counters)) = serde_json::to_value(self) {
            object.extend(counters);
        }
        serde_json::Value::Object(object)
    }

    /// Adds the work (not the steps, rows or events) of another pass.
    pub fn add_work(&mut self, other: &Statistics) {
        self.evaluations += other.evaluations;
        self.jacobians += other.jacobians;
        self.factorisations += other.factorisations;
        self.refactorisations += other.refactorisations;
        self.symmetric += other.symmetric;
        self.solves += other.solves;
        self.iterations += other.iterations;
    }

    /// Adds another run to this one: of the steps of a sweep.
    pub fn add(&mut self, other: &Statistics) {
        self.add_work(other);
        self.accepted += other.accepted;
        self.rejected.error += other.rejected.error;
        self.rejected.newton += other.rejected.newton;
        self.rejected.singular += other.rejected.singular;
        self.rejected.non_finite += other.rejected.non_finite;
        self.rejected.event += other.rejected.event;
        self.events += other.events;
        self.slides += other.slides;
        self.corners += other.corners;
        self.rows += other.rows;
        self.pilot += other.pilot;
        for warning in &other.warnings {
            if !self.warnings.contains(warning) {
                self.warnings.push(warning.clone());
            }
        }
    }
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "method           {} ({})", self.method, self.reason)?;
        writeln!(
            f,
            "system           {} equations, {} charges and fluxes, {} matrix entries",
            self.equations, self.charges, self.entries
        )?;
        writeln!(f, "steps            {} accepted, {} cut", self.accepted, self.rejected.total())?;
        let r = &self.rejected;
        for (count, cause) in [
            (r.error, "local error"),
            (r.newton, "no convergence"),
            (r.singular, "singular matrix"),
            (r.non_finite, "not a number"),
            (r.event, "redone to an event"),
        ] {
            if count > 0 {
                writeln!(f, "                   {count} {cause}")?;
            }
        }
        if self.pilot > 0 {
            writeln!(f, "pilot pass       {} steps", self.pilot)?;
        }
        writeln!(f, "evaluations      {} ({} with derivatives)", self.evaluations, self.jacobians)?;
        write!(
            f,
            "factorisations   {} new, {} replayed",
            self.factorisations, self.refactorisations
        )?;
        match self.symmetric {
            0 => writeln!(f)?,
            count => writeln!(f, ", {count} of them by Cholesky")?,
        }
        writeln!(f, "solves           {}", self.solves)?;
        writeln!(f, "iterations       {}", self.iterations)?;
        writeln!(f, "corners, events  {}, {}", self.corners, self.events)?;
        if self.slides > 0 {
            writeln!(f, "sliding          {} conditions", self.slides)?;
        }
        if self.detours > 0 {
            writeln!(f, "detours          {} by TR-BDF2", self.detours)?;
        }
        write!(f, "rows             {}", self.rows)
    }
}
