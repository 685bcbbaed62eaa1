//! `bondspice check MODEL.bg`: all that can be said about a source without running it.

use super::flags::ModelFlags;
use super::pipeline;
use super::session::{Exit, Session};
use crate::diagnostic::Severity;

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
    pipeline::check(&mut session.map, file, &overrides, &mut d);
    session.say(d);
    let warned = session.said.iter().any(|d| d.severity == Severity::Warning);
    Ok(match session.exit() {
        Exit::Fine if warned && arguments.deny.is_some() => Exit::Negative,
        exit => exit,
    })
}
