//! A file and all that it imports, read: what elaboration starts from.
//!
//! `import "x.bg"` is looked for beside the importing file, then in the folders given with `-I`; `std/…` is the library
//! that comes with the program. Each file is read once, however often it is imported.

use crate::bond::syntax::{self, File, Name, StatementKind};
use crate::diagnostic::Diagnostic;
use crate::quantity::nearest;
use crate::source::loader::{self, LoadErrorKind};
use crate::source::{FileId, SourceMap, Span, library};
use std::path::Path;

/// More files than this are a slip of the pen.
const MOST_FILES: usize = 1000;

/// A file and its imports.
#[derive(Debug)]
pub struct Program {
    /// The file that is run first, then those imported, each once.
    pub files: Vec<File>,
    /// Of each file, its imports: where they stand, and the index of the file; `None` when it could not be read.
    pub imports: Vec<Vec<(Span, Option<usize>)>>,
}

impl Program {
    /// Whether the file that is run says what is observed.
    pub fn observes(&self) -> bool {
        self.files.first().is_some_and(|file| {
            file.statements.iter().any(|s| matches!(s.kind, StatementKind::Observe(_)))
        })
    }
}

impl From<File> for Program {
    fn from(file: File) -> Program {
        Program { files: vec![file], imports: vec![vec![]] }
    }
}

/// Reads a file that is in the map, all that it imports, and the files of their tables.
pub fn load(
    map: &mut SourceMap,
    file: FileId,
    folders: &[String],
    d: &mut Vec<Diagnostic>,
) -> Program {
    let mut program = Program { files: vec![syntax::parse(map, file, d)], imports: vec![vec![]] };
    let mut next = 0;
    while next < program.files.len() {
        let wanted: Vec<(Name, Span)> = program.files[next]
            .statements
            .iter()
            .filter_map(|statement| match &statement.kind {
                StatementKind::Import(name) => Some((name.clone(), statement.span)),
                _ => None,
            })
            .collect();
        for (name, span) in wanted {
            let importer = program.files[next].file;
            let found = find(map, importer, &name, folders, d).and_then(|file| {
                let known = program.files.iter().position(|known| known.file == file);
                if known.is_some() || program.files.len() >= MOST_FILES {
                    return known;
                }
                program.files.push(syntax::parse(map, file, d));
                program.imports.push(vec![]);
                Some(program.files.len() - 1)
            });
            program.imports[next].push((span, found));
        }
        next += 1;
    }
    report_cycles(&program, map, d);
    for file in &program.files {
        super::tables::load_tables(file, map, d);
    }
    program
}

/// The file of an import, read into the map unless it is there.
fn find(
    map: &mut SourceMap,
    importer: FileId,
    name: &Name,
    folders: &[String],
    d: &mut Vec<Diagnostic>,
) -> Option<FileId> {
    let text = name.text.as_str();
    if let Some(inside) = text.strip_prefix("std/") {
        if let Some(known) = map.find(text) {
            return Some(known);
        }
        let Some(content) = library::find(inside) else {
            let error =
                Diagnostic::error("E0230", name.span, format!("the library has no `{text}`"))
                    .says("no such file in the library");
            let names = library::LIBRARY.iter().map(|(name, _)| *name);
            d.push(match nearest(inside, names) {
                Some(meant) => error.help(format!("did you mean `std/{meant}`?")).fix(
                    format!("write `std/{meant}`"),
                    vec![quoted(name, &format!("std/{meant}"))],
                ),
                None => error.because(format!(
                    "it has {}",
                    library::LIBRARY
                        .iter()
                        .map(|(name, _)| format!("`std/{name}`"))
                        .collect::<Vec<_>>()
                        .join(", ")
                )),
            });
            return None;
        };
        return Some(map.add(text, content));
    }
    let folders = folders.iter().map(|folder| Path::new(folder).join(text));
    let folders = folders.map(|path| path.to_string_lossy().into_owned());
    let beside = std::iter::once(map.beside(importer, text));
    let tried: Vec<String> = beside.chain(folders).map(|path| clean(&path)).collect();
    // What the library imports stands in the library.
    let of_library = map.file(importer).is_some_and(|file| file.name.starts_with("std/"));
    let mut first = None;
    for path in &tried {
        if let Some(known) = map.find(path) {
            return Some(known);
        }
        if let Some(inside) = path.strip_prefix("std/").filter(|_| of_library)
            && let Some(content) = library::find(inside)
        {
            return Some(map.add(path.as_str(), content));
        }
        match loader::load(path, map) {
            Ok(file) => return Some(file),
            Err(error) if matches!(error.kind, LoadErrorKind::Missing { .. }) => {
                first.get_or_insert(error);
            }
            Err(error) => {
                let mut error = Diagnostic::from(error);
                error.labels.insert(
                    0,
                    crate::diagnostic::Label {
                        span: name.span,
                        text: "imported here".into(),
                        of_use: false,
                    },
                );
                d.push(error);
                return None;
            }
        }
    }
    let mut error =
        Diagnostic::error("E0230", name.span, format!("there is no file `{text}` to import"))
            .says("not found");
    if let Some(LoadErrorKind::Missing { nearest: Some(meant) }) = first.map(|error| error.kind) {
        error = error.help(format!("did you mean `{meant}`?"));
    } else {
        error = error.help(
            "an import is looked for beside the file that imports, then in the folders of -I",
        );
    }
    let places: Vec<String> = tried.iter().map(|path| format!("`{path}`")).collect();
    d.push(error.because(format!("looked for {}", places.join(", "))));
    None
}

/// An edit of the text between the quotes of a name.
fn quoted(name: &Name, text: &str) -> (Span, String) {
    (name.span, format!("\"{text}\""))
}

/// A path with `.` and `..` resolved as far as they can be, so that one file has one name.
fn clean(path: &str) -> String {
    let mut parts: Vec<&str> = vec![];
    for part in path.split('/') {
        match part {
            "." => {}
            ".." if parts.last().is_some_and(|last| !last.is_empty() && *last != "..") => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// Imports that come back to where they began: the chain is an error once for each ring.
fn report_cycles(program: &Program, map: &SourceMap, d: &mut Vec<Diagnostic>) {
    // 0: not seen, 1: on the path, 2: done.
    let mut marks = vec![0u8; program.files.len()];
    for first in 0..program.files.len() {
        let mut path: Vec<(usize, usize)> = vec![(first, 0)];
        if marks[first] != 0 {
            continue;
        }
        while let Some((file, next)) = path.last_mut() {
            let file = *file;
            marks[file] = 1;
            let Some((span, imported)) = program.imports[file].get(*next).copied() else {
                marks[file] = 2;
                path.pop();
                continue;
            };
            *next += 1;
            let Some(imported) = imported else { continue };
            match marks[imported] {
                0 => path.push((imported, 0)),
                1 => {
                    let start = path.iter().position(|(on, _)| *on == imported).unwrap_or(0);
                    let name = |file: usize| {
                        let file = map.file(program.files[file].file);
                        format!("`{}`", file.map_or("", |file| file.name.as_str()))
                    };
                    let chain: Vec<String> = path[start..]
                        .iter()
                        .map(|(file, _)| name(*file))
                        .chain([name(imported)])
                        .collect();
                    d.push(
                        Diagnostic::error("E0231", span, "files import each other in a circle")
                            .says("this import closes the circle")
                            .because(format!("the circle is {}", chain.join(" → ")))
                            .help("put what both need into a file of its own"),
                    );
                }
                _ => {}
            }
        }
    }
}
