//! `bondspice lsp`: the language server, over standard input and output.

use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::elaborate::Overrides;
use crate::lsp::{self, Checked, Host};
use crate::source::{FileId, SourceMap, library};
use std::io;
use std::path::PathBuf;

/// What it does, in a line.
pub const ABOUT: &str =
    "Speak with an editor about .bg files (language server, on standard input and output)";

/// An example for the help.
pub const EXAMPLE: &str = "\
Example: bondspice lsp
An editor starts it; editors/ and docs/editors.md say how.";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// A folder in which imports are looked for, after that of the file that imports (repeatable)
    #[arg(short = 'I', value_name = "DIR")]
    include: Vec<String>,
    /// Taken for the sake of editors that say it: there is no other way
    #[arg(long)]
    stdio: bool,
}

/// Serves until the editor says that it is done; 1 when it goes without saying so, as the protocol has it.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let host = Host { check, folders: arguments.include, library: library_folder(), write_library };
    let input = io::BufReader::new(io::stdin());
    match lsp::serve(&host, input, &mut io::stdout().lock()) {
        Ok(true) => Exit::Fine,
        Ok(false) => Exit::Negative,
        Err(error) => session.unwritable("<stdout>", &error),
    }
}

/// What `bondspice check` says of a bond graph.
fn check(map: &mut SourceMap, file: FileId, folders: &[String]) -> Checked {
    let overrides = Overrides { folders: folders.to_vec(), ..Overrides::default() };
    let mut d = vec![];
    let graph = pipeline::graph(map, file, &overrides, &mut d);
    let causality = graph.as_ref().and_then(|graph| pipeline::causality(graph, &mut d));
    Checked { diagnostics: d, graph, causality }
}

/// The folder in which the files of the library stand so that an editor can show them.
fn library_folder() -> Option<String> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let cache = variable("XDG_CACHE_HOME")
        .or_else(|| Some(variable("HOME")?.join(".cache")))
        .or_else(|| variable("LOCALAPPDATA"))?;
    let folder = cache.join("bondspice").join(env!("CARGO_PKG_VERSION")).join("std");
    Some(folder.to_string_lossy().into_owned())
}

/// Writes the files of the library. What cannot be written cannot be shown, and nothing else suffers.
fn write_library(folder: &str) {
    for (name, text) in library::LIBRARY {
        let path = PathBuf::from(folder).join(name);
        let Some(parent) = path.parent() else { continue };
        if std::fs::read_to_string(&path).is_ok_and(|known| known == *text)
            || std::fs::create_dir_all(parent).is_err()
        {
            continue;
        }
        // A copy to read: what is changed in it changes nothing.
        let _ = std::fs::remove_file(&path);
        let written = std::fs::write(&path, text).and_then(|()| std::fs::metadata(&path));
        if let Ok(metadata) = written {
            let mut rights = metadata.permissions();
            rights.set_readonly(true);
            let _ = std::fs::set_permissions(&path, rights);
        }
    }
}
