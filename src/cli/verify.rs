//! `bondspice verify MODEL.bg`: the circuit's run against the bond graph's own equations, and the balance of energy.

use super::flags::ReportFlags;
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use super::watch::{self, Bar};
use crate::bond::elaborate::Overrides;
use crate::sim::FailureKind;
use crate::source::FileId;
use crate::verify::Report;
use std::sync::Arc;

/// What it does, in a line.
pub const ABOUT: &str = "Check a translation by a second route without a circuit: 0 right, 1 not";

/// An example for the help.
pub const EXAMPLE: &str = "The bond graph's own equations are integrated without any circuit and compared with the \
netlist's transient; the energy balance must close.\n\nExample: bondspice verify model.bg --format json";

/// Its flags.
pub type Arguments = ReportFlags;

/// Verifies.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    match verify(&arguments, session) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn verify(arguments: &Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let overrides = arguments.model.overrides(session)?;
    let file = session.load(&arguments.file)?;
    let report = report(file, &overrides, session)?;
    let text = match arguments.format.as_str() {
        "json" => format!("{}\n", report.json()),
        _ => report.text(),
    };
    write_text(arguments.output.as_deref(), &text, session)?;
    Ok(match session.exit() {
        Exit::Fine if !report.passes() => Exit::Negative,
        exit => exit,
    })
}

fn report(file: FileId, overrides: &Overrides, session: &mut Session) -> Result<Report, Exit> {
    let mut d = vec![];
    let bar = Bar::new(session.global.quiet);
    let progress = bar.clone();
    let report = pipeline::verify(&mut session.map, file, overrides, &mut d, |settings| {
        settings.interrupt = Some(watch::stop_flag());
        if let Some(bar) = progress {
            settings.progress = Some(Arc::new(move |part| bar.show(part)));
        }
    });
    if let Some(bar) = bar {
        bar.clear();
    }
    session.say(d);
    match report {
        Ok(Some(report)) => Ok(report),
        Err(FailureKind::Interrupted) => Err(Exit::Interrupted),
        Ok(None) | Err(_) => Err(session.exit()),
    }
}
