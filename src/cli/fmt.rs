//! `bondspice fmt MODEL.bg…`: the one layout of bond graphs.

use super::output::{replace_text, write_text};
use super::session::{Exit, Session};
use crate::bond::syntax;
use crate::diagnostic::has_errors;

/// What it does, in a line.
pub const ABOUT: &str = "Lay out bond graphs: indents, blanks, columns; nothing else changes";

/// An example for the help.
pub const EXAMPLE: &str = "Example: bondspice fmt models/*.bg\n         \
bondspice fmt --check model.bg\n         \
bondspice fmt - < model.bg > tidy.bg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graphs (.bg), each replaced by its new text; - for standard input to standard output
    #[arg(required = true)]
    files: Vec<String>,
    /// Write nothing: list the files that would change, with exit code 1 when there are any
    #[arg(long)]
    check: bool,
}

/// Formats every file; those with errors of syntax stay as they are.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let mut exit = Exit::Fine;
    for name in &arguments.files {
        let done = format(name, arguments.check, session).unwrap_or_else(|failed| failed);
        // Trouble weighs more than a file that would change.
        if exit == Exit::Fine || (exit == Exit::Negative && done != Exit::Fine) {
            exit = done;
        }
    }
    exit
}

fn format(name: &str, check: bool, session: &mut Session) -> Result<Exit, Exit> {
    let file = session.load(name)?;
    let mut d = vec![];
    syntax::parse(&session.map, file, &mut d);
    if has_errors(&d) {
        session.say(d);
        return Err(session.exit());
    }
    let Some(source) = session.map.file(file) else { return Ok(Exit::Fine) };
    let (text, shown) = (syntax::format(&source.text), source.name.clone());
    let changes = text != source.text;
    if check {
        if changes {
            write_text(None, &format!("{shown}\n"), session)?;
        }
        return Ok(if changes { Exit::Negative } else { Exit::Fine });
    }
    if name == "-" {
        write_text(None, &text, session)?;
    } else if changes {
        replace_text(name, &text, session)?;
    }
    Ok(Exit::Fine)
}
