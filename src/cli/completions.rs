//! `bondspice completions SHELL`: what a shell needs to complete commands and flags.

use super::output;
use super::session::{Exit, Session};

/// What it does, in a line.
pub const ABOUT: &str = "Print a script that lets a shell complete commands and flags";

/// An example for the help.
pub const EXAMPLE: &str = "\
Example: bondspice completions bash > ~/.local/share/bash-completion/completions/bondspice
         bondspice completions zsh > ~/.zfunc/_bondspice       (a folder of fpath)
         bondspice completions fish > ~/.config/fish/completions/bondspice.fish";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Prints the script.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let mut script = vec![];
    clap_complete::generate(arguments.shell, &mut super::describe(), "bondspice", &mut script);
    match output::write_text(None, &String::from_utf8_lossy(&script), session) {
        Ok(()) => Exit::Fine,
        Err(exit) => exit,
    }
}
