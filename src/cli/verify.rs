//! `bondspice verify MODEL.bg`: the certificate of a netlist's text, the circuit's run against the bond graph's own
//! equations, and the balance of energy.

use super::flags::{DeckFlags, ReportFlags, dialect};
use super::output::write_text;
use super::pipeline::{self, Question};
use super::session::{Exit, Session};
use super::watch::{self, Bar};
use crate::bond::elaborate::Overrides;
use crate::bond::scale;
use crate::sim::FailureKind;
use crate::source::FileId;
use crate::verify::Report;
use std::sync::Arc;

/// What it does, in a line.
pub const ABOUT: &str = "Prove a netlist against its bond graph: 0 right, 1 not";

/// An example for the help.
pub const EXAMPLE: &str = "The netlist's text is read back and its equations are solved exactly, over prime fields with random \
parameters, beside those of the bond graph; laws, values and waveforms are compared; then both are simulated, and the \
energy balance must close.\n\nExample: bondspice verify model.bg --format json\n         \
bondspice verify model.bg --netlist edited.cir\n         \
bondspice verify model.bg --to xyce --scale auto";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    report: ReportFlags,
    /// A netlist to check instead of the bond graph's own
    #[arg(long, value_name = "FILE")]
    netlist: Option<String>,
    #[command(flatten)]
    deck: DeckFlags,
    /// The map of that netlist, as `convert --map` writes it; the bond graph's own map without it
    #[arg(long, value_name = "FILE", requires = "netlist")]
    map: Option<String>,
    /// The dialect in which the bond graph's own netlist is written and read back: ngspice, xyce, ltspice, gnucap
    #[arg(long, value_name = "SIMULATOR", conflicts_with = "netlist")]
    to: Option<String>,
    /// Scale domains, as `convert` does; the scaled graph is proven against the unscaled one besides
    #[arg(long, value_name = "SCALES")]
    scale: Option<String>,
    /// What each part took, on stderr
    #[arg(long, value_name = "FORM", value_parser = ["json", "text"])]
    stats: Option<String>,
    /// What the random numbers follow from
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
}

/// Verifies.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let arguments = &arguments;
    let flags = &arguments.report;
    let mut overrides = flags.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    if let Some(scales) = &arguments.scale {
        overrides.scale = scale::parse(scales).map_err(|error| session.fail(*error))?;
    }
    let to = arguments.to.as_deref().map(dialect).transpose();
    let to = to.map_err(|error| session.fail(*error))?;
    let file = session.load(&flags.file)?;
    let netlist = arguments.netlist.as_deref().map(|path| session.load(path)).transpose()?;
    let map = match arguments.map.as_deref() {
        Some(path) => {
            let file = session.load(path)?;
            let text = session.map.file(file).map_or("", |file| file.text.as_str());
            // What is no JSON is no map, which is said where it is read.
            Some(serde_json::from_str(text).unwrap_or_default())
        }
        None => None,
    };
    let question = Question { netlist, map, to, seed: arguments.seed };
    let report = report(file, &overrides, &question, session)?;
    match arguments.stats.as_deref() {
        Some("json") => eprintln!("{}", report.times.to_json(&report)),
        Some(_) => eprint!("{}", report.times.text(&report)),
        None if session.global.verbose && !session.global.quiet => {
            eprint!("{}", report.times.text(&report));
        }
        None => {}
    }
    let text = match flags.format.as_str() {
        "json" => format!("{}\n", report.json()),
        _ => report.text(),
    };
    write_text(flags.output.as_deref(), &text, session)?;
    Ok(match session.exit() {
        Exit::Fine if !report.passes() => Exit::Negative,
        exit => exit,
    })
}

fn report(
    file: FileId,
    overrides: &Overrides,
    question: &Question,
    session: &mut Session,
) -> Result<Report, Exit> {
    let mut d = vec![];
    let bar = Bar::new(session.global.quiet);
    let progress = bar.clone();
    let report =
        pipeline::verify(&mut session.map, file, overrides, question, &mut d, |settings| {
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
