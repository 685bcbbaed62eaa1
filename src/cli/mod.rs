//! The command line: one file for each subcommand, all listed in one table.

pub mod session;
pub mod output;
pub mod table;
pub mod measures;
pub mod fourier;
pub mod emit;
pub mod flags;
pub mod watch;
pub mod deck;
pub mod pipeline;
pub mod proof;
pub mod run;
pub mod list;
pub mod check;
pub mod convert;
pub mod simulate;
pub mod verify;
pub mod compare;
pub mod causality;
pub mod linear;
pub mod linearize;
pub mod poles;
pub mod bode;
pub mod tf;
pub mod paths;
pub mod tune;
pub mod transform;
pub mod reduce;
pub mod sweep;
pub mod energy;
pub mod trace;
pub mod draw;
pub mod plot;
pub mod report;
pub mod fmt;
pub mod examples;
pub mod completions;
pub mod man;
pub mod explain;
pub mod lsp;

use crate::diagnostic::Diagnostic;
use crate::quantity::nearest;
use crate::source::Span;
use clap::{Args, FromArgMatches};
use session::{Exit, Global, Session};
use std::process::ExitCode;

/// Room for the deepest inputs: nesting is limited, but trees of thousands of levels are walked by recursion.
const STACK: usize = 256 << 20;

/// One subcommand.
pub struct Command {
    /// Its name.
    pub name: &'static str,
    /// Its flags, with help.
    pub describe: fn(clap::Command) -> clap::Command,
    /// What it does.
    pub run: fn(&clap::ArgMatches, &mut Session) -> Result<Exit, clap::Error>,
}

/// How a command ends.
trait Ending {
    /// The exit code.
    fn exit(self, session: &Session) -> Exit;
}

impl Ending for Exit {
    fn exit(self, _: &Session) -> Exit {
        self
    }
}

/// Done, as far as what has been said allows; or why not, which has been said.
impl Ending for Result<(), Exit> {
    fn exit(self, session: &Session) -> Exit {
        match self {
            Ok(()) => session.exit(),
            Err(exit) => exit,
        }
    }
}

impl Ending for Result<Exit, Exit> {
    fn exit(self, _: &Session) -> Exit {
        match self {
            Ok(exit) | Err(exit) => exit,
        }
    }
}

macro_rules! command {
    ($module:ident) => {
        Command {
            name: stringify!($module),
            describe: |command| {
                $module::Arguments::augment_args(command)
                    .about($module::ABOUT)
                    .after_help($module::EXAMPLE)
            },
            run: |matches, session| {
                let arguments = $module::Arguments::from_arg_matches(matches)?;
                Ok($module::run(arguments, session).exit(session))
            },
        }
    };
}

/// All subcommands, in the order of the help.
pub const COMMANDS: &[Command] = &[
    command!(check),
    command!(convert),
    command!(simulate),
    command!(verify),
    command!(compare),
    command!(causality),
    command!(linearize),
    command!(poles),
    command!(bode),
    command!(tf),
    command!(paths),
    command!(tune),
    command!(transform),
    command!(reduce),
    command!(sweep),
    command!(energy),
    command!(trace),
    command!(draw),
    command!(plot),
    command!(report),
    command!(fmt),
    command!(examples),
    command!(completions),
    command!(man),
    command!(explain),
    command!(lsp),
];

/// The whole command line, as clap knows it.
pub fn describe() -> clap::Command {
    let program = Global::augment_args(clap::Command::new("bondspice"))
        .version(env!("CARGO_PKG_VERSION"))
        .about(
            "Turns bond graphs into circuits, simulates them, checks the result by a second route",
        )
        .after_help("Example: bondspice simulate models/eha_one_line.bg -o run.csv")
        .subcommand_required(true)
        .arg_required_else_help(true)
        .max_term_width(100);
    COMMANDS.iter().fold(program, |program, row| {
        program.subcommand((row.describe)(clap::Command::new(row.name)))
    })
}

/// The error for a command that is not there; it tells the nearest.
fn unknown_command(name: &str) -> Diagnostic {
    let error = Diagnostic::error("E0940", Span::NONE, format!("no command is called `{name}`"));
    match nearest(name, COMMANDS.iter().map(|row| row.name)) {
        Some(meant) => error.help(format!("did you mean `{meant}`?")),
        None => error.help("`bondspice --help` lists them"),
    }
}

/// Runs the command line of this process and returns its exit code.
pub fn main() -> ExitCode {
    let worker = std::thread::Builder::new().stack_size(STACK).spawn(|| {
        let arguments: Vec<std::ffi::OsString> = std::env::args_os().collect();
        run(arguments)
    });
    match worker.map(std::thread::JoinHandle::join) {
        Ok(Ok(exit)) => ExitCode::from(exit as u8),
        // A panic has been reported by its own message; the work was not finished.
        Ok(Err(_)) => ExitCode::from(Exit::Simulation as u8),
        Err(_) => ExitCode::from(Exit::File as u8),
    }
}

/// Runs a command line, the program's name first.
pub fn run(arguments: Vec<std::ffi::OsString>) -> Exit {
    let matches = match describe().try_get_matches_from(arguments) {
        Ok(matches) => matches,
        Err(error) => return tell(&error),
    };
    let global = Global::from_arg_matches(&matches).unwrap_or_default();
    let mut session = Session::new(global);
    let Some((name, matches)) = matches.subcommand() else { return Exit::Usage };
    let Some(row) = COMMANDS.iter().find(|row| row.name == name) else { return Exit::Usage };
    match (row.run)(matches, &mut session) {
        Ok(exit) => {
            session.close();
            exit
        }
        Err(error) => tell(&error),
    }
}

/// Prints clap's message: help and version on stdout, errors on stderr.
fn tell(error: &clap::Error) -> Exit {
    // Where nobody reads it, nobody misses it.
    let _ = error.print();
    if error.use_stderr() { Exit::Usage } else { Exit::Fine }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        describe().debug_assert();
        for row in COMMANDS {
            let command = (row.describe)(clap::Command::new(row.name));
            assert!(command.get_about().is_some(), "{}", row.name);
            let example = command.get_after_help().expect(row.name).to_string();
            assert!(example.contains(&format!("bondspice {}", row.name)), "{example}");
            for argument in command.get_arguments() {
                assert!(argument.get_help().is_some(), "{} {}", row.name, argument.get_id());
            }
        }
    }
}
