//! `bondspice check MODEL.bg`: all that can be said about a source without running it.

use super::flags::{DeckFlags, ModelFlags};
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::elaborate::Overrides;
use crate::diagnostic::{Diagnostic, Severity, fix};
use crate::source::{FileId, SourceMap, Span, loader};

/// What it does, in a line.
pub const ABOUT: &str = "Check a model or a netlist: syntax, names, units, domains, causality";

/// An example for the help.
pub const EXAMPLE: &str = "--fix makes the fixes that messages show, and says which.\n\nExample: bondspice check model.bg --deny warnings";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg) or netlist; - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    #[command(flatten)]
    deck: DeckFlags,
    /// What else than errors ends with exit code 1
    #[arg(long, value_name = "WHAT", value_parser = ["warnings"])]
    deny: Option<String>,
    /// Make all fixes that are certain, in the file itself
    #[arg(long)]
    fix: bool,
}

/// Checks.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let arguments = &arguments;
    let mut overrides = arguments.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    if arguments.fix {
        mend(&arguments.file, &overrides, session)?;
    }
    let file = session.load(&arguments.file)?;
    let mut d = vec![];
    let made = pipeline::check(&mut session.map, file, &overrides, &mut d);
    // The process is about to end: giving a million names back one by one would only take time.
    std::mem::forget(made);
    session.say(d);
    let warned = session.said.iter().any(|d| d.severity == Severity::Warning);
    Ok(match session.exit() {
        Exit::Fine if warned && arguments.deny.is_some() => Exit::Negative,
        exit => exit,
    })
}

/// Fixes of one round may lead to others; more rounds than this go in a circle.
const ROUNDS: usize = 10;

/// Makes the fixes in the file, and says what was done. What a fix would make worse is left as it is.
fn mend(name: &str, overrides: &Overrides, session: &mut Session) -> Result<(), Exit> {
    if name == "-" {
        let error = Diagnostic::error("E0940", Span::NONE, "--fix needs a file to write to");
        return Err(session.fail(error.help("name a file instead of `-`")));
    }
    let mut map = SourceMap::default();
    // What cannot be read is said by the check that follows.
    let Ok(file) = loader::load(name, &mut map) else { return Ok(()) };
    let mut text = map.file(file).map_or(String::new(), |file| file.text.clone());
    let mut done = vec![];
    for _ in 0..ROUNDS {
        let said = said_of(name, &text, overrides);
        let (mended, made) = fix::apply(&text, said.file, &said.diagnostics);
        if made.is_empty() || said_of(name, &mended, overrides).errors > said.errors {
            break;
        }
        done.extend(made.iter().filter_map(|diagnostic| {
            let title = &diagnostic.fix.as_ref()?.title;
            let (line, column) = said.map.position(diagnostic.labels.first()?.span)?;
            Some(format!("fixed {name}:{line}:{column}: {title} ({})", diagnostic.code))
        }));
        text = mended;
    }
    if !done.is_empty() {
        write_text(Some(name), &text, session)?;
        for line in done {
            session.remark(&line);
        }
    }
    Ok(())
}

/// What is said of a text.
struct Said {
    map: SourceMap,
    file: FileId,
    diagnostics: Vec<Diagnostic>,
    errors: usize,
}

fn said_of(name: &str, text: &str, overrides: &Overrides) -> Said {
    let mut map = SourceMap::default();
    let file = map.add(name, text);
    let mut diagnostics = vec![];
    pipeline::check(&mut map, file, overrides, &mut diagnostics);
    let errors = diagnostics.iter().filter(|d| d.severity == Severity::Error).count();
    Said { map, file, diagnostics, errors }
}
