//! The report of `verify`: a short table and JSON.

use crate::second::energy::{Energy, Role};
use serde::Serialize;
use std::fmt::Write;

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the form.
    pub schema: u32,
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// Every observed variable on both routes.
    pub trajectories: Vec<Trajectory>,
    /// The balance.
    pub energy: EnergyReport,
}

/// One observed variable on both routes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trajectory {
    /// Its column.
    pub name: String,
    /// The largest difference, in parts of the variable's range on the second route; infinite (`null` in JSON) where a
    /// value is no number.
    pub max: f64,
    /// The root mean square of the differences.
    pub rms: f64,
    /// Where the largest one is, seconds.
    pub at: f64,
    /// max − min on the second route, in the column's unit.
    pub range: f64,
    /// What `max` may be.
    pub tolerance: f64,
}

/// The balance of energy, joules.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EnergyReport {
    /// Delivered by sources.
    #[serde(rename = "in")]
    pub delivered: f64,
    /// Gained by stores.
    pub stored: f64,
    /// Dissipated.
    pub dissipated: f64,
    /// Exchanged by modulation.
    pub modulated: f64,
    /// What is left over, in parts of the sum of what each source delivers or takes.
    pub residual: f64,
    /// What the residual may be.
    pub tolerance: f64,
    /// The largest power that a junction or two-port makes or loses, in parts of what goes through it.
    pub junctions: f64,
    /// Each element's part.
    pub elements: Vec<ElementEnergy>,
}

/// One element's part of the energy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElementEnergy {
    /// Its name.
    pub name: String,
    /// `in`, `dissipated`, `stored` or `modulated`.
    pub role: &'static str,
    /// Joules.
    pub energy: f64,
}

impl Report {
    /// Whether nothing differs.
    pub fn passes(&self) -> bool {
        self.verdict == "pass"
    }

    /// The report as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or(serde_json::Value::Null)
    }

    /// The report as a table.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let width =
            self.trajectories.iter().map(|t| t.name.chars().count()).max().unwrap_or(0).max(8);
        let _ = writeln!(text, "{:width$}  {:>9}  {:>9}  {:>12}", "variable", "max", "rms", "at");
        for t in &self.trajectories {
            let verdict = if t.holds() { "" } else { "  differs" };
            let at = format!("{} s", short(t.at));
            let _ = writeln!(
                text,
                "{:width$}  {:>9.1e}  {:>9.1e}  {at:>12}{verdict}",
                t.name, t.max, t.rms
            );
        }
        let e = &self.energy;
        let _ = writeln!(text);
        for (name, value) in [
            ("energy in", e.delivered),
            ("dissipated", e.dissipated),
            ("stored", e.stored),
            ("modulated", e.modulated),
        ] {
            let _ = writeln!(text, "{name:width$}  {:>12} J", short(value));
        }
        let verdict = if e.holds() { "" } else { "  does not close" };
        let _ = writeln!(text, "{:width$}  {:>9.1e}{verdict}", "residual", e.residual);
        let _ = writeln!(text, "{:width$}  {:>9.1e}", "junctions", e.junctions);
        let worst = self.trajectories.iter().max_by(|a, b| a.max.total_cmp(&b.max));
        let _ = writeln!(text);
        let _ = match (self.passes(), worst) {
            (true, Some(worst)) => writeln!(
                text,
                "pass: both routes agree within {:.1e} of range, worst {} with {:.1e}",
                worst.tolerance, worst.name, worst.max
            ),
            (true, None) => writeln!(text, "pass"),
            (false, _) => {
                let mut wrong: Vec<String> = self
                    .trajectories
                    .iter()
                    .filter(|t| !t.holds())
                    .map(|t| t.name.clone())
                    .collect();
                if !e.holds() {
                    wrong.push("energy".to_string());
                }
                writeln!(text, "fail: {}", wrong.join(", "))
            }
        };
        text
    }
}

impl Trajectory {
    /// Whether both routes agree.
    pub fn holds(&self) -> bool {
        self.max <= self.tolerance
    }
}

/// What a junction or two-port may make or lose, in parts of what goes through it.
const JUNCTIONS: f64 = 1e-6;

impl EnergyReport {
    /// Of a run's balance.
    pub fn of(energy: &Energy, tolerance: f64) -> EnergyReport {
        EnergyReport {
            delivered: energy.delivered,
            stored: energy.stored,
            dissipated: energy.dissipated,
            modulated: energy.modulated,
            residual: if energy.turnover > 0.0 { energy.residual / energy.turnover } else { 0.0 },
            tolerance,
            junctions: energy.junctions.0,
            elements: energy
                .shares
                .iter()
                .map(|share| ElementEnergy {
                    name: share.name.clone(),
                    role: match share.role {
                        Role::Source => "in",
                        Role::Dissipated => "dissipated",
                        Role::Stored => "stored",
                        Role::Modulated => "modulated",
                    },
                    energy: share.energy,
                })
                .collect(),
        }
    }

    /// Whether the balance closes.
    pub fn holds(&self) -> bool {
        // A sum that is no number is no balance, whatever the residual says.
        let sums = [self.delivered, self.stored, self.dissipated, self.modulated];
        sums.iter().all(|sum| sum.is_finite())
            && self.residual.abs() <= self.tolerance
            && self.junctions <= JUNCTIONS
    }
}

/// Six significant digits.
fn short(value: f64) -> String {
    let text = format!("{value:.5e}");
    let number: f64 = text.parse().unwrap_or(value);
    if number == 0.0 || (1e-3..1e6).contains(&number.abs()) {
        format!("{number}")
    } else {
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'))
    }
}
