//! `bondspice check MODEL.bg`: all that can be said about a source without running it.

use super::flags::ModelFlags;
use super::pipeline::{self, Language};
use super::session::{Exit, Session};
use crate::circuit::stamps;
use crate::diagnostic::Severity;
use crate::sim;

/// What it does, in a line.
pub const ABOUT: &str = "Check a model or a netlist: syntax, names, units, domains, causality";

/// An example for the help.
pub const EXAMPLE: &str = "Example: bondspice check model.bg --deny warnings";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg) or netlist; - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// What else than errors ends with exit code 1
    #[arg(long, value_name = "WHAT", value_parser = ["warnings"])]
    deny: Option<String>,
}

/// Checks.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    match check(&arguments, session) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn check(arguments: &Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let overrides = arguments.model.overrides(session)?;
    let file = session.load(&arguments.file)?;
    let mut d = vec![];
    match pipeline::language(&session.map, file) {
        Language::Bond => {
            if let Some(graph) = pipeline::graph(&mut session.map, file, &overrides, &mut d) {
                pipeline::causality(&graph, &mut d);
            }
        }
        Language::Netlist => {
            let circuit = pipeline::circuit(&mut session.map, file, &overrides, &mut d);
            let stamps = circuit.and_then(|(circuit, _)| stamps::stamp(&circuit, &mut d));
            if let Some(stamps) = stamps {
                sim::compile(&stamps, &mut d);
            }
        }
    }
    session.say(d);
    let warned = session.said.iter().any(|d| d.severity == Severity::Warning);
    Ok(match session.exit() {
        Exit::Fine if warned && arguments.deny.is_some() => Exit::Negative,
        exit => exit,
    })
}
