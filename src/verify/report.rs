//! The report of `verify`: a short table and JSON.

use super::certificate::Certificate;
use super::exact::text::Text;
use crate::second::energy::Energy;
use crate::source::Span;
use serde::Serialize;
use std::fmt::Write;

/// Differences that a table shows.
const MOST_LINES: usize = 20;

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the form.
    pub schema: u32,
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// The exact part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exact: Option<Exact>,
    /// Laws and signals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub laws: Option<Laws>,
    /// Values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Values>,
    /// The scaled bond graph against the unscaled one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scaling: Option<Values>,
    /// Every observed variable on both routes; none where the text alone is found to be wrong.
    pub trajectories: Vec<Trajectory>,
    /// The balance, where there was a run.
    pub energy: Option<EnergyReport>,
    /// What each part took.
    #[serde(skip)]
    pub times: Times,
}

/// Seconds that each part took on the machine it ran on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// The parts that look at the text: writing and reading it, exact, laws, values, and scaling.
    pub text: f64,
    /// The circuit's run.
    pub circuit: f64,
    /// The second route.
    pub second: f64,
}

impl Times {
    /// As one JSON object, with `"schema": 1`, beside counters that are the same on every machine.
    pub fn to_json(&self, report: &Report) -> serde_json::Value {
        let exact = report.exact.as_ref();
        serde_json::json!({
            "schema": 1,
            "unknowns": exact.map(|exact| exact.unknowns),
            "operations": exact.map(|exact| exact.operations),
            "seconds": self,
        })
    }

    /// The same in lines.
    pub fn text(&self, report: &Report) -> String {
        let mut text = String::new();
        let _ = match &report.exact {
            Some(exact) => writeln!(
                text,
                "text             {}, {} unknowns, {} multiplications a draw",
                seconds(self.text),
                exact.unknowns,
                exact.operations
            ),
            None => writeln!(text, "text             {}", seconds(self.text)),
        };
        if report.energy.is_some() {
            let _ = writeln!(text, "circuit          {}", seconds(self.circuit));
            let _ = writeln!(text, "second route     {}", seconds(self.second));
        }
        text
    }
}

/// A duration for people.
fn seconds(value: f64) -> String {
    if value < 1.0 { format!("{:.1} ms", 1e3 * value) } else { format!("{value:.2} s") }
}

/// Something that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mismatch {
    /// The variable, parameter or kind of card; empty where a card says enough.
    pub variable: String,
    /// The card, where one can be named.
    pub card: Option<String>,
    /// What differs.
    pub message: String,
    /// Where the card stands.
    #[serde(skip)]
    pub span: Span,
}

impl Mismatch {
    /// Of a variable.
    pub fn of(variable: &str, message: &str) -> Mismatch {
        let (variable, message) = (variable.to_string(), message.to_string());
        Mismatch { variable, card: None, message, span: Span::NONE }
    }

    /// Of a device of a text.
    pub fn card(text: &Text<'_>, device: usize, message: &str) -> Mismatch {
        Mismatch {
            variable: String::new(),
            card: Some(text.device_name(device)),
            message: message.to_string(),
            span: text.circuit.devices.get(device).map_or(Span::NONE, |device| device.span),
        }
    }

    /// In a line.
    pub fn line(&self) -> String {
        let card = self.card.as_deref().map(|card| format!("`{card}`"));
        let what = [Some(self.variable.clone()).filter(|v| !v.is_empty()), card];
        let what: Vec<String> = what.into_iter().flatten().collect();
        format!("{}: {}", what.join(", "), self.message)
    }
}

/// The exact part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exact {
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// What the random numbers follow from.
    pub seed: u64,
    /// Draws, each over a prime field of its own.
    pub draws: usize,
    /// Unknowns of both systems.
    pub unknowns: usize,
    /// Multiplications in the eliminations of both in one draw, the same on every machine.
    pub operations: usize,
    /// Variables that were compared in each draw.
    pub variables: usize,
    /// That a wrong text passes all draws, at most.
    pub probability: f64,
    /// What differs.
    pub mismatches: Vec<Mismatch>,
    /// What the bond graph itself leaves undetermined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub singular: Option<String>,
}

/// Laws and signals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Laws {
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// Texts that were compared with their laws.
    pub laws: usize,
    /// What differs.
    pub mismatches: Vec<Mismatch>,
}

/// Values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Values {
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// Values that were compared.
    pub compared: usize,
    /// What differs.
    pub mismatches: Vec<Mismatch>,
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
    /// Gained by stores in jumps, which no integral of a power holds: what sets them gives it.
    #[serde(skip_serializing_if = "is_nothing")]
    pub jumps: f64,
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

    /// A report of the text alone.
    pub fn of_text(certificate: Certificate) -> Report {
        let verdict = if certificate.holds() { "pass" } else { "fail" };
        let report = Report {
            schema: 1,
            verdict,
            exact: None,
            laws: None,
            values: None,
            scaling: None,
            trajectories: vec![],
            energy: None,
            times: Times::default(),
        };
        report.with(certificate)
    }

    /// The same with what was found in the text.
    pub fn with(mut self, certificate: Certificate) -> Report {
        if !certificate.holds() {
            self.verdict = "fail";
        }
        let Certificate { exact, laws, values, scaling } = certificate;
        (self.exact, self.laws, self.values) = (Some(exact), Some(laws), Some(values));
        self.scaling = scaling;
        self
    }

    /// The same with what each part took.
    pub fn timed(mut self, times: Times) -> Report {
        self.times = times;
        self
    }

    /// What the parts that look at the text found wrong, the most telling first.
    pub fn mismatches(&self) -> impl Iterator<Item = &Mismatch> {
        let laws = self.laws.iter().flat_map(|part| &part.mismatches);
        let exact = self.exact.iter().flat_map(|part| &part.mismatches);
        let values = self.values.iter().chain(&self.scaling);
        laws.chain(exact).chain(values.flat_map(|part| &part.mismatches))
    }

    /// The parts that look at the text, a line each, and what they found.
    fn text_parts(&self) -> String {
        let mut text = String::new();
        let (Some(exact), Some(laws), Some(values)) = (&self.exact, &self.laws, &self.values)
        else {
            return text;
        };
        let _ = writeln!(
            text,
            "exact    {}  {} variables in {} unknowns, {} draws, wrong with probability < {:.0e}",
            exact.verdict, exact.variables, exact.unknowns, exact.draws, exact.probability
        );
        let _ =
            writeln!(text, "laws     {}  {} texts of laws and signals", laws.verdict, laws.laws);
        let _ = writeln!(text, "values   {}  {} values", values.verdict, values.compared);
        if let Some(scaling) = &self.scaling {
            let _ = writeln!(
                text,
                "scaling  {}  {} variables, laws and values of the unscaled bond graph",
                scaling.verdict, scaling.compared
            );
        }
        for mismatch in self.mismatches().take(MOST_LINES) {
            let _ = writeln!(text, "  {}", mismatch.line());
        }
        let more = self.mismatches().count().saturating_sub(MOST_LINES);
        if more > 0 {
            let _ = writeln!(text, "  and {more} more");
        }
        let _ = writeln!(text);
        text
    }

    /// The report as a table.
    pub fn text(&self) -> String {
        let mut text = self.text_parts();
        let Some(e) = &self.energy else {
            let first = self.mismatches().next().map(Mismatch::line);
            let _ = match first {
                Some(first) => writeln!(text, "fail: {first}"),
                None => writeln!(text, "{}", self.verdict),
            };
            return text;
        };
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
        let _ = writeln!(text);
        for (name, value) in [
            ("energy in", e.delivered),
            ("dissipated", e.dissipated),
            ("stored", e.stored),
            ("modulated", e.modulated),
            ("in by jumps", e.jumps),
        ] {
            if name == "in by jumps" && value == 0.0 {
                continue;
            }
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

fn is_nothing(value: &f64) -> bool {
    *value == 0.0
}

impl EnergyReport {
    /// Of a run's balance.
    pub fn of(energy: &Energy, tolerance: f64) -> EnergyReport {
        EnergyReport {
            delivered: energy.delivered,
            stored: energy.stored,
            dissipated: energy.dissipated,
            modulated: energy.modulated,
            jumps: energy.jumps,
            residual: if energy.turnover > 0.0 { energy.residual / energy.turnover } else { 0.0 },
            tolerance,
            junctions: energy.junctions.0,
            elements: energy
                .shares
                .iter()
                .map(|share| ElementEnergy {
                    name: share.name.clone(),
                    role: share.role.name(),
                    energy: share.energy,
                })
                .collect(),
        }
    }

    /// Whether the balance closes.
    pub fn holds(&self) -> bool {
        // A sum that is no number is no balance, whatever the residual says.
        let sums = [self.delivered, self.stored, self.dissipated, self.modulated, self.jumps];
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
