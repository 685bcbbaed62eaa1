//! `bondspice transform MODEL.bg`: another text of the same model, in which elements stand elsewhere, or fewer of them.

use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::transform::across::across;
use crate::bond::transform::lump::lump;
use crate::bond::transform::remove::without;
use crate::bond::transform::{Trouble, Work};
use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// What it does, in a line.
pub const ABOUT: &str =
    "Rewrite a bond graph: move elements over two-ports, merge, lump two lines, leave out";

/// An example for the help.
pub const EXAMPLE: &str = "\
The new text keeps names, units and comments; a comment above each change says what was done and which law justifies it.
Changes are made in the order drop, lump, move, simplify; for another order pipe one run into the next. What stands in
instances is laid open first.

Example: bondspice transform model.bg --move 'J over lever' -o moved.bg
         bondspice transform model.bg --move chamber --simplify -o simple.bg
         bondspice transform models/eha_two_line.bg --drop valve1.flow --drop valve2.flow --lump pump1,pump2
         bondspice transform models/eha_components.bg --flatten -o flat.bg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    /// Lay all instances, loops and conditions open
    #[arg(long)]
    flatten: bool,
    /// Leave out an element, or a junction with what hangs on it alone (repeatable)
    #[arg(long, value_name = "NAME")]
    drop: Vec<String>,
    /// Lump two equal lines into one, named by a 0-junction of each; the first stays (repeatable)
    #[arg(long, value_name = "A,B")]
    lump: Vec<String>,
    /// Move an element, or a junction with all that hangs on it, over a transformer or gyrator: 'J over lever', or J where only one is beside it (repeatable)
    #[arg(long = "move", value_name = "WHAT")]
    moves: Vec<String>,
    /// Merge junctions, elements and chains of two-ports as far as that goes
    #[arg(long)]
    simplify: bool,
    /// A folder in which imports are looked for, after that of the file that imports (repeatable)
    #[arg(short = 'I', value_name = "DIR")]
    include: Vec<String>,
    /// Where to write the new text; without it to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Changes the model and writes it.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let named = arguments.drop.len() + arguments.lump.len() + arguments.moves.len();
    if named == 0 && !arguments.flatten && !arguments.simplify {
        let error = Diagnostic::error("E0940", Span::NONE, "nothing is said to be changed");
        return Err(session
            .fail(error.help(
                "add --move, --drop, --lump, --simplify or --flatten; --help shows examples",
            )));
    }
    let file = session.load(&arguments.file)?;
    pipeline::require_bond(session, file, "transformed")?;
    let mut d = vec![];
    let Some(mut work) = Work::begin(&mut session.map, file, &arguments.include, &mut d) else {
        session.say(d);
        return Err(session.exit());
    };
    let done = steps(arguments, &mut work);
    let (text, opened) = (work.source.text, work.opened);
    if let Err(trouble) = done {
        return Err(session.fail(*trouble));
    }
    if opened && !arguments.flatten {
        let message = "the change reaches into instances: all of them are laid open";
        let note = Diagnostic::note("N1106", Span::NONE, message);
        session.say([note.help("elements are named `motor_rotor` for `motor.rotor` now")]);
    }
    write_text(arguments.output.as_deref(), &text, session)
}

fn steps(arguments: &Arguments, work: &mut Work) -> Result<(), Trouble> {
    if arguments.flatten {
        work.lay_open()?;
    }
    for name in &arguments.drop {
        work.change(&|source| without(source, source.find(name.trim())?))?;
    }
    for pair in &arguments.lump {
        let Some((first, second)) = pair.split_once(',') else {
            let message = format!("--lump takes two 0-junctions, as in pump1,pump2, not `{pair}`");
            return Err(Box::new(Diagnostic::error("E0940", Span::NONE, message)));
        };
        work.change(&|source| lump(source, first.trim(), second.trim()))?;
    }
    for what in &arguments.moves {
        let (what, over) = match what.split_once(" over ") {
            Some((what, over)) => (what.trim(), Some(over.trim())),
            None => (what.trim(), None),
        };
        work.change(&|source| across(source, what, over))?;
    }
    if arguments.simplify {
        work.simplify()?;
    }
    Ok(())
}
