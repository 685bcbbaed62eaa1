//! The table of analyses, one row each: what it is called, the columns it gives, how it is run.

use super::explain::{Failure, FailureKind};
use super::settings::Settings;
use super::statistics::Statistics;
use super::system::System;
use super::{ac, dc, poles, sensitivity, step, transfer};
use crate::circuit::stamps::Stamps;
use crate::circuit::{Analysis, Axis, Circuit};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::Sink;

/// The same circuit with other values of what names mean.
pub type Vary<'a> = dyn Fn(&[(&str, f64)]) -> Result<Circuit, Vec<Diagnostic>> + 'a;

/// What is to be run.
pub struct Job<'a> {
    /// The circuit.
    pub circuit: &'a Circuit,
    /// What it comes down to.
    pub stamps: &'a Stamps,
    /// The same, compiled.
    pub system: &'a System,
    /// Which of its analyses.
    pub analysis: &'a Analysis,
    /// Times and tolerances.
    pub settings: &'a Settings,
    /// Makes the circuit with other values.
    pub vary: &'a Vary<'a>,
}

/// A column: its header and its unit.
pub type Column = (String, &'static str);

/// One analysis.
pub struct Row {
    /// The word of its card, of `.print` and of `--analysis`.
    pub name: &'static str,
    /// How its card goes.
    pub card: &'static str,
    /// What it gives, in a line.
    pub about: &'static str,
    /// Columns; those whose unit is empty may be known by their names.
    pub columns: fn(&Analysis, &Circuit, &Stamps) -> Vec<Column>,
    /// Runs it and sends rows to the sink.
    pub run: fn(&Job, &mut dyn Sink) -> Result<Statistics, Failure>,
}

/// Every analysis, one row each.
pub const ANALYSES: &[Row] = &[
    Row {
        name: "op",
        card: ".op",
        about: "the operating point: nothing changes any more",
        columns: |_, _, stamps| outputs(stamps),
        run: operating_point,
    },
    Row {
        name: "dc",
        card: ".dc src from to by [src2 …]",
        about: "operating points over values of sources, parameters or the temperature",
        columns: |analysis, _, stamps| {
            let axes = axes(analysis);
            let first = axes.first().and_then(|axis| axis.names.first());
            // Nothing says what unit a parameter has.
            first.map(|name| (name.to_string(), "")).into_iter().chain(outputs(stamps)).collect()
        },
        run: dc::dc,
    },
    Row {
        name: "ac",
        card: ".ac lin|dec|oct n from to",
        about: "phasors over frequencies, linearised at the operating point",
        columns: |_, circuit, stamps| ac::columns(circuit, stamps),
        run: ac::ac,
    },
    Row {
        name: "tf",
        card: ".tf v(out) source",
        about: "gain from a source to an output, input and output resistance",
        columns: |_, _, _| {
            let names = [("gain", ""), ("input_resistance", "Ohm"), ("output_resistance", "Ohm")];
            names.map(|(name, unit)| (name.to_string(), unit)).to_vec()
        },
        run: transfer::transfer,
    },
    Row {
        name: "pz",
        card: ".pz in+ in- out+ out- cur|vol pol|zer|pz",
        about: "poles and zeros, linearised at the operating point",
        columns: |analysis, _, _| poles::columns(analysis),
        run: poles::poles,
    },
    Row {
        name: "sens",
        card: ".sens v(out) [ac dec n from to] | .sens objfunc={…} param=r1:r,…",
        about: "slopes of outputs by parameters and values of devices",
        columns: |analysis, _, _| sensitivity::columns(analysis),
        run: sensitivity::sensitivity,
    },
    Row {
        name: "tran",
        card: ".tran step stop [start [hmax]] [uic]",
        about: "the course over time",
        columns: |_, _, stamps| {
            [("time".to_string(), "s")].into_iter().chain(outputs(stamps)).collect()
        },
        run: |job, sink| super::condense::run(job.stamps, job.system, job.settings, sink),
    },
];

/// The row of an analysis.
pub fn row(name: &str) -> Option<&'static Row> {
    ANALYSES.iter().find(|row| row.name == name)
}

fn outputs(stamps: &Stamps) -> Vec<Column> {
    stamps.outputs.iter().map(|(name, _)| (name.to_string(), "")).collect()
}

/// The axes of a sweep; none for anything else.
pub(super) fn axes(analysis: &Analysis) -> &[Axis] {
    match analysis {
        Analysis::Dc { axes } => axes,
        _ => &[],
    }
}

fn operating_point(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let point = step::operating_point(job.system)?;
    sink.row(&point.outputs).map_err(|error| unwritten(&error, &point.statistics))?;
    Ok(point.statistics)
}

/// A row that could not be written.
pub(super) fn unwritten(error: &std::io::Error, statistics: &Statistics) -> Failure {
    let message = format!("the row cannot be written: {error}");
    let diagnostic = Diagnostic::error("E0905", Span::NONE, message);
    Failure::new(FailureKind::Output, diagnostic, statistics)
}

/// The end of a run that was interrupted.
pub(super) fn interrupted(job: &Job, statistics: &Statistics) -> Option<Failure> {
    let flag = job.settings.interrupt.as_ref()?;
    flag.load(std::sync::atomic::Ordering::Relaxed).then(|| {
        let diagnostic = Diagnostic::error("E0808", Span::NONE, "the run was interrupted");
        Failure::new(FailureKind::Interrupted, diagnostic, statistics)
    })
}

/// Values for which there is no circuit.
pub fn no_circuit(found: Vec<Diagnostic>, statistics: &Statistics) -> Failure {
    let errors = found.iter().filter(|d| d.severity == crate::diagnostic::Severity::Error);
    let first = errors.chain(&found).next().cloned();
    let diagnostic = first.unwrap_or_else(|| {
        Diagnostic::error("E0784", Span::NONE, "there is no circuit for these values")
    });
    Failure::new(FailureKind::Input, diagnostic, statistics)
}
