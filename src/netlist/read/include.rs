//! The files that a netlist names: `.include file`, `.lib file section`, and the text of data files.
//!
//! All are read before the first card is, so that reading cards only looks things up. A relative name counts from the
//! folder of the file that names it, then from those of `-I`. Names may stand in quotes; `\` is as good as `/`.
//!
//! | card | meaning |
//! |---|---|
//! | `.include file`, `.inc file` | the whole file, in place of the card |
//! | `.lib file section` | what stands between `.lib section` and `.endl` of the file |
//! | `.lib file` | the whole file, where there is one of that name |
//! | `.lib section` | begins a section, where there is no file of that name |

use super::How;
use crate::diagnostic::Diagnostic;
use crate::source::loader::{self, LoadErrorKind};
use crate::source::{FileId, SourceMap, Span};
use std::collections::HashMap;

/// Files, at most.
const MOST_FILES: usize = 10_000;

/// The files of a netlist, by the card that names them.
#[derive(Default)]
pub struct Includes {
    files: HashMap<(FileId, usize), FileId>,
    /// `.preprocess replaceground true`: other names of the ground count, too.
    pub replace_ground: bool,
    /// Whether phases are in degrees, where `.options output phase_output_radians=` says it.
    pub degrees: Option<bool>,
}

impl Includes {
    /// The file that the card at a place names; `None` where it could not be read, which has been said, or names none.
    pub fn file(&self, file: FileId, at: usize) -> Option<FileId> {
        self.files.get(&(file, at)).copied()
    }
}

/// Reads every file that a text names, and those that these name.
pub fn load(map: &mut SourceMap, file: FileId, how: &How, d: &mut Vec<Diagnostic>) -> Includes {
    let mut includes = Includes::default();
    let mut known: HashMap<String, FileId> = HashMap::new();
    if let Some(file_name) = map.file(file).map(|file| file.name.clone()) {
        known.insert(same_name(&file_name), file);
    }
    let mut open = vec![file];
    while let Some(file) = open.pop() {
        for wanted in wanted(map, file, &mut includes) {
            let found = find(map, file, &wanted.name, how);
            let path = match found {
                Found::File(path) => path,
                Found::Outside(path) => {
                    d.push(outside(&path, how, wanted.span));
                    continue;
                }
                // `.lib section` begins one.
                Found::Nothing(_) if wanted.perhaps => continue,
                Found::Nothing(path) => path,
            };
            let loaded = match known.get(&same_name(&path)) {
                Some(file) => Ok(*file),
                None if known.len() >= MOST_FILES => {
                    let message = format!("the netlist names more than {MOST_FILES} files");
                    d.push(Diagnostic::error("E0713", wanted.span, message));
                    return includes;
                }
                None => loader::load(&path, map),
            };
            match loaded {
                Ok(loaded) => {
                    if known.insert(same_name(&path), loaded).is_none() {
                        open.push(loaded);
                    }
                    includes.files.insert((file, wanted.at), loaded);
                }
                Err(error) => match error.kind {
                    // An empty file adds nothing.
                    LoadErrorKind::Empty { span } => {
                        known.insert(same_name(&path), span.file);
                        includes.files.insert((file, wanted.at), span.file);
                    }
                    _ => d.push(unreadable(error.into(), wanted.span)),
                },
            }
        }
    }
    includes
}

/// The text of a data file that a card names: a table of numbers.
///
/// # Errors
/// Says why it cannot be read.
pub fn data(
    map: &SourceMap,
    file: FileId,
    name: &str,
    how: &How,
    span: Span,
) -> Result<String, Box<Diagnostic>> {
    let path = match find(map, file, name, how) {
        Found::File(path) | Found::Nothing(path) => path,
        Found::Outside(path) => return Err(Box::new(outside(&path, how, span))),
    };
    let mut own = SourceMap::default();
    match loader::load(&path, &mut own) {
        Ok(file) => Ok(own.file(file).map_or(String::new(), |file| file.text.clone())),
        Err(error) => Err(Box::new(unreadable(error.into(), span))),
    }
}

fn unreadable(found: Diagnostic, span: Span) -> Diagnostic {
    // Where a text is bad, its own place matters more than the card that names it.
    if found.labels.is_empty() { found.label(span, "named here") } else { found }
}

fn outside(path: &str, how: &How, span: Span) -> Diagnostic {
    let folder = how.confine.as_deref().unwrap_or(".");
    Diagnostic::error("E0712", span, format!("`{path}` lies outside of `{folder}`"))
        .because("--confine allows no file outside of that folder")
        .help("put the file into the folder, or name a folder that holds both")
}

/// What a name leads to.
enum Found {
    File(String),
    Nothing(String),
    Outside(String),
}

fn find(map: &SourceMap, file: FileId, name: &str, how: &How) -> Found {
    let folders = |name: &str| {
        let beside = map.beside(file, name);
        let others = how
            .folders
            .iter()
            .map(|folder| std::path::Path::new(folder).join(name).to_string_lossy().into_owned());
        std::iter::once(beside).chain(others).collect::<Vec<_>>()
    };
    let mut paths = folders(name);
    if name.contains('\\') {
        paths.extend(folders(&name.replace('\\', "/")));
    }
    for path in &paths {
        if let Some(folder) = &how.confine
            && !loader::lies_within(path, folder)
        {
            return Found::Outside(path.clone());
        }
        if loader::is_file(path) {
            return Found::File(path.clone());
        }
    }
    Found::Nothing(paths.swap_remove(0))
}

/// Two spellings of one path as one.
fn same_name(path: &str) -> String {
    let canonical = std::path::Path::new(path).canonicalize();
    canonical.map_or(path.to_string(), |path| path.to_string_lossy().into_owned())
}

/// A card that names a file.
struct Wanted {
    /// Where its line starts.
    at: usize,
    name: String,
    span: Span,
    /// It may begin a section instead.
    perhaps: bool,
}

/// The cards of a text that name files. Continuations of them are not looked at.
fn wanted(map: &SourceMap, file: FileId, includes: &mut Includes) -> Vec<Wanted> {
    let text = map.file(file).map_or("", |file| file.text.as_str());
    let mut found = vec![];
    let mut at = 0;
    while at < text.len() {
        let end =
            memchr::memchr(b'\n', &text.as_bytes()[at..]).map_or(text.len(), |length| at + length);
        let line = text[at..end].trim_start();
        let start = end - line.len();
        at = end + 1;
        if !line.starts_with('.') {
            continue;
        }
        let (keyword, rest) = line.split_at(line.find([' ', '\t']).unwrap_or(line.len()));
        let is = |card: &str| keyword.eq_ignore_ascii_case(card);
        if is(".preprocess") {
            let folded = rest.to_ascii_lowercase();
            includes.replace_ground |= folded.contains("replaceground") && folded.contains("true");
        }
        if is(".options") || is(".option") {
            // It changes what words of other cards mean, before and behind it.
            let folded = rest.to_ascii_lowercase();
            let said = folded.split_once("phase_output_radians").map(|(_, value)| value);
            let value = said.map(|value| value.trim_start_matches([' ', '\t', '=']));
            if let Some(value) = value {
                includes.degrees = Some(value.starts_with(['0', 'f']));
            }
        }
        if is(".end") {
            break;
        }
        let library = is(".lib");
        if !(library || is(".include") || is(".inc")) {
            continue;
        }
        let Some((name, from)) = file_name(rest, library) else { continue };
        let from = start + keyword.len() + from;
        let span = Span::new(file, from, from + name.len());
        let perhaps = library && section(rest).is_none();
        found.push(Wanted { at: start, name: name.to_string(), span, perhaps });
    }
    found
}

/// The file that stands first in the rest of a card, without quotes, and its place. A name without quotes ends at a blank
/// where a section may follow, else with the line or its comment.
pub fn file_name(rest: &str, library: bool) -> Option<(&str, usize)> {
    let name = rest.trim_start();
    let from = rest.len() - name.len();
    for quote in ['"', '\''] {
        if let Some(quoted) = name.strip_prefix(quote) {
            return Some((&quoted[..quoted.find(quote).unwrap_or(quoted.len())], from + 1));
        }
    }
    let end = match library {
        true => name.find([' ', '\t', '\r', ';']),
        false => name.find([';', '\r']).or_else(|| name.find(" $")),
    };
    let name = name[..end.unwrap_or(name.len())].trim_end();
    (!name.is_empty()).then_some((name, from))
}

/// The section that stands behind the file of a `.lib` card.
pub fn section(rest: &str) -> Option<&str> {
    let (name, from) = file_name(rest, true)?;
    let behind = rest[from + name.len()..].trim_start_matches(['"', '\'']).trim_start();
    let word = behind.split([' ', '\t', '\r', ';']).next().unwrap_or("");
    (!word.is_empty() && !word.starts_with('$')).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_and_sections() {
        for (rest, library, name, found) in [
            (" models.lib", false, "models.lib", None),
            ("\t\"a b.lib\" tt", true, "a b.lib", Some("tt")),
            (" 'x.lib'", true, "x.lib", None),
            (" a b.cir ; comment", false, "a b.cir", None),
            (" x.lib fast ; comment", true, "x.lib", Some("fast")),
            (" x.lib ; comment", true, "x.lib", None),
        ] {
            assert_eq!(file_name(rest, library).map(|(name, _)| name), Some(name), "{rest}");
            let (text, from) = file_name(rest, library).unwrap();
            assert_eq!(&rest[from..from + text.len()], name);
            if library {
                assert_eq!(section(rest), found, "{rest}");
            }
        }
        assert_eq!(file_name("  ", false), None);
    }
}
