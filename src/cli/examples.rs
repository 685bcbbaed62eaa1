//! `bondspice examples`: the models that come with the program, listed, shown, copied.

use super::output;
use super::session::{Exit, Session};
use super::table::Table;
use crate::bond::syntax::{self, StatementKind};
use crate::diagnostic::Diagnostic;
use crate::quantity::nearest;
use crate::source::examples::{EXAMPLES, find, title};
use crate::source::{SourceMap, Span, library};
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str = "List the models that come with the program, show or copy one";

/// An example for the help.
pub const EXAMPLE: &str = "\
Example: bondspice examples
         bondspice examples show rlc
         bondspice examples copy eha_one_line -o work";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Option<Action>,
}

/// What to do with one of them; without it they are listed.
#[derive(clap::Subcommand)]
enum Action {
    /// Print a model
    Show {
        /// Its name, with or without .bg
        name: String,
    },
    /// Copy a model, with what it imports, into a folder; nothing is overwritten
    Copy {
        /// Its name, with or without .bg
        name: String,
        /// The folder; it is made where there is none
        #[arg(short, long, value_name = "DIR", default_value = ".")]
        output: String,
    },
}

/// Lists, shows or copies.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let done = match arguments.action {
        None => output::write_text(None, &list(), session),
        Some(Action::Show { name }) => {
            model(&name, session).and_then(|(_, text)| output::write_text(None, text, session))
        }
        Some(Action::Copy { name, output }) => copy(&name, &output, session),
    };
    match done {
        Ok(()) => Exit::Fine,
        Err(exit) => exit,
    }
}

/// Every model and what it is; then the files of the library.
fn list() -> String {
    let mut table = Table::new(&["model", "what it is"]);
    for (path, text) in EXAMPLES.iter().filter(|(path, _)| path.ends_with(".bg")) {
        table.row([path.trim_end_matches(".bg").to_string(), title(path, text)]);
    }
    for (path, text) in library::LIBRARY {
        table.row([format!("std/{path}"), title(path, text)]);
    }
    table.to_text()
}

/// The path and the text of a model or of a file of the library.
fn model(name: &str, session: &mut Session) -> Result<(String, &'static str), Exit> {
    if let Some((path, text)) = find(name) {
        return Ok((path.to_string(), text));
    }
    let inside = name.strip_prefix("std/").unwrap_or("");
    let file = if inside.ends_with(".bg") { inside.to_string() } else { format!("{inside}.bg") };
    if let Some(text) = library::find(&file) {
        return Ok((format!("std/{file}"), text));
    }
    let error = Diagnostic::error("E0948", Span::NONE, format!("no example is called `{name}`"));
    let names = EXAMPLES.iter().map(|(path, _)| path.trim_end_matches(".bg"));
    // A name without its folder is meant as often as a slip of the pen.
    let inner = names.clone().find(|known| known.rsplit('/').next() == Some(name));
    Err(session.fail(match inner.or_else(|| nearest(name, names)) {
        Some(meant) => error.help(format!("did you mean `{meant}`?")),
        None => error.help("`bondspice examples` lists them"),
    }))
}

fn copy(name: &str, folder: &str, session: &mut Session) -> Result<(), Exit> {
    let (path, text) = model(name, session)?;
    let files = with_others(&path, text);
    let target = |file: &str| Path::new(folder).join(file).to_string_lossy().into_owned();
    for (file, _) in &files {
        let target = target(file);
        // A link that leads nowhere is something too.
        if Path::new(&target).symlink_metadata().is_ok() {
            let message = format!("`{target}` exists already");
            return Err(session.fail(
                Diagnostic::error("E0907", Span::NONE, message)
                    .help("examples overwrite nothing: name another folder after -o"),
            ));
        }
    }
    for (file, text) in &files {
        let target = target(file);
        if let Some(parent) = Path::new(&target).parent() {
            std::fs::create_dir_all(parent).map_err(|error| session.unwritable(&target, &error))?;
        }
        output::write_text(Some(&target), text, session)?;
        session.remark(&target);
    }
    Ok(())
}

/// A model and the files that it speaks of, by their paths from its folder; files of the library need no copy.
fn with_others(path: &str, text: &'static str) -> Vec<(String, &'static str)> {
    let (base, name) = path.rsplit_once('/').map_or(("", path), |(base, name)| (base, name));
    let mut files = vec![(name.to_string(), text)];
    let mut next = 0;
    while let Some((file, text)) = files.get(next).cloned() {
        next += 1;
        if !file.ends_with(".bg") {
            continue;
        }
        let mut map = SourceMap::default();
        let id = map.add(file.as_str(), text);
        let syntax = syntax::parse(&map, id, &mut vec![]);
        let imports = syntax.statements.iter().filter_map(|statement| match &statement.kind {
            StatementKind::Import(name) => Some(name),
            _ => None,
        });
        for other in imports.chain(syntax::data_files(&syntax)) {
            let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
            let beside = join(folder, &other.text);
            let known = files.iter().any(|(file, _)| *file == beside);
            let shipped = EXAMPLES.iter().find(|(path, _)| *path == join(base, &beside));
            if let (false, Some((_, text))) = (known, shipped) {
                files.push((beside, text));
            }
        }
    }
    files
}

fn join(folder: &str, path: &str) -> String {
    if folder.is_empty() { path.to_string() } else { format!("{folder}/{path}") }
}
