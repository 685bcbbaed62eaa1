//! `bondspice man`: manual pages, one for each command, made from the same tables as the help.

use super::output;
use super::session::{Exit, Session};
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str = "Print a manual page, or write all of them into a folder";

/// An example for the help.
pub const EXAMPLE: &str = "\
Example: bondspice man simulate | man -l -
         bondspice man -o ~/.local/share/man/man1";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The command whose page is printed; without it that of the program
    command: Option<String>,
    /// Write the pages of all commands into this folder, which is made where there is none
    #[arg(short, long, value_name = "DIR", conflicts_with = "command")]
    output: Option<String>,
}

/// Prints or writes pages.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    match write(&arguments, session) {
        Ok(()) => Exit::Fine,
        Err(exit) => exit,
    }
}

fn write(arguments: &Arguments, session: &mut Session) -> Result<(), Exit> {
    let pages = pages();
    let Some(folder) = &arguments.output else {
        let wanted = match &arguments.command {
            Some(command) => format!("bondspice-{command}"),
            None => "bondspice".to_string(),
        };
        let Some((_, text)) = pages.iter().find(|(name, _)| *name == wanted) else {
            let command = arguments.command.as_deref().unwrap_or("");
            return Err(session.fail(super::unknown_command(command)));
        };
        return output::write_text(None, text, session);
    };
    std::fs::create_dir_all(folder).map_err(|error| session.unwritable(folder, &error))?;
    for (name, text) in &pages {
        let path = Path::new(folder).join(format!("{name}.1"));
        output::write_text(Some(&path.to_string_lossy()), text, session)?;
    }
    session.remark(&format!("{} pages in {folder}", pages.len()));
    Ok(())
}

/// The name of each page, without its section, and its text.
fn pages() -> Vec<(String, String)> {
    let mut program = super::describe().disable_help_subcommand(true);
    program.build();
    let mut pages = vec![];
    let mut waiting = vec![program];
    while let Some(command) = waiting.pop() {
        let visible = command.get_subcommands().filter(|inner| !inner.is_hide_set());
        waiting.extend(visible.cloned().collect::<Vec<_>>().into_iter().rev());
        let name = command.get_display_name().unwrap_or(command.get_name()).to_string();
        let mut text = vec![];
        // Writing into memory does not fail.
        let _ = clap_mangen::Man::new(command).render(&mut text);
        pages.push((name, String::from_utf8_lossy(&text).into_owned()));
    }
    pages
}
