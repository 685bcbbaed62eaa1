//! Reading files and standard input: the only place of the project that does.
//!
//! A text must be UTF-8 without zero bytes and at most [`LIMIT`] bytes long, so that places in it fit into 32 bits.

use super::{FileId, SourceMap, Span};
use std::io::Read;
use std::path::Path;

/// The largest text that is read, in bytes.
pub const LIMIT: u64 = 1 << 30;

/// The largest file of results that is read, in bytes.
pub const DATA_LIMIT: u64 = 1 << 34;

/// Why a file could not be read.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadError {
    /// The file as the user named it.
    pub name: String,
    /// What went wrong.
    pub kind: LoadErrorKind,
}

/// What can go wrong while reading; the first four are the file's, the others its content's.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadErrorKind {
    /// Nothing has this name; a file of a similar one stands beside it.
    Missing {
        /// The similar name.
        nearest: Option<String>,
    },
    /// A folder.
    Folder,
    /// The system's reason.
    Unreadable(String),
    /// More bytes than the limit.
    TooLarge {
        /// The limit.
        limit: u64,
    },
    /// A byte that UTF-8 forbids.
    NotUtf8 {
        /// Which.
        offset: usize,
        /// Its place in the text as shown.
        span: Span,
    },
    /// A zero byte.
    Binary {
        /// Which.
        offset: usize,
        /// Its place in the text as shown.
        span: Span,
    },
    /// Nothing but blanks.
    Empty {
        /// Its beginning.
        span: Span,
    },
}

/// Reads a text into the map; `-` is standard input.
///
/// # Errors
/// Says why the file could not be read; a bad text is in the map nevertheless, so that its place can be shown.
pub fn load(path: &str, map: &mut SourceMap) -> Result<FileId, LoadError> {
    let bytes = read_bytes(path, LIMIT)?;
    let name = if path == "-" { "<stdin>" } else { path };
    decode(name, bytes, map)
}

/// Takes a text that is in memory already, under the rules of [`load`].
///
/// # Errors
/// Says why the text cannot be taken.
pub fn decode(name: &str, bytes: Vec<u8>, map: &mut SourceMap) -> Result<FileId, LoadError> {
    let fail = |kind| Err(LoadError { name: name.to_string(), kind });
    let bytes = match bytes.strip_prefix(b"\xEF\xBB\xBF") {
        Some(rest) => rest.to_vec(),
        None => bytes,
    };
    let bytes = match utf16(&bytes) {
        Some(text) => text.into_bytes(),
        None => bytes,
    };
    if let Some(offset) = memchr::memchr(0, &bytes) {
        let span = show(name, &bytes, offset, map);
        return fail(LoadErrorKind::Binary { offset, span });
    }
    let bytes = match std::str::from_utf8(&bytes) {
        Err(_) if !name.ends_with(".bg") => latin(&bytes).into_bytes(),
        _ => bytes,
    };
    match String::from_utf8(bytes) {
        Ok(text) => {
            let empty = text.trim().is_empty();
            let file = map.add(name, text);
            if empty {
                return fail(LoadErrorKind::Empty { span: Span::new(file, 0, 0) });
            }
            Ok(file)
        }
        Err(error) => {
            let offset = error.utf8_error().valid_up_to();
            let span = show(name, error.as_bytes(), offset, map);
            fail(LoadErrorKind::NotUtf8 { offset, span })
        }
    }
}

/// The text of bytes that a byte order mark says to be UTF-16, as LTspice writes netlists; also of those without one whose
/// first letter says so.
fn utf16(bytes: &[u8]) -> Option<String> {
    let unit = |pair: &[u8], big: bool| match pair {
        [a, b] if big => u16::from_be_bytes([*a, *b]),
        [a, b] => u16::from_le_bytes([*a, *b]),
        _ => 0xFFFD,
    };
    let (big, from) = match bytes {
        [0xFF, 0xFE, ..] => (false, 2),
        [0xFE, 0xFF, ..] => (true, 2),
        [b'*', 0, ..] => (false, 0),
        _ => return None,
    };
    let units = bytes[from..].chunks(2).map(|pair| unit(pair, big));
    Some(char::decode_utf16(units).map(|letter| letter.unwrap_or('\u{FFFD}')).collect())
}

/// The text of bytes that are one letter each, as older programs write netlists (Latin-1): `µ` is 0xB5.
fn latin(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| char::from(*byte)).collect()
}

/// Whether something that can be read has this name.
pub fn is_file(path: &str) -> bool {
    // A folder is one that cannot be read, and is said to be.
    Path::new(path).exists()
}

/// Whether a path stays within a folder, links followed. Of what does not exist, whether its folder does.
pub fn lies_within(path: &str, folder: &str) -> bool {
    let Ok(folder) = Path::new(folder).canonicalize() else { return false };
    let path = Path::new(path);
    let whole = path.canonicalize().or_else(|_| {
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        parent.unwrap_or(Path::new(".")).canonicalize()
    });
    whole.is_ok_and(|whole| whole.starts_with(&folder))
}

/// Reads a whole file of data; `-` is standard input.
///
/// # Errors
/// Says why the file could not be read.
pub fn read_data(path: &str) -> Result<Vec<u8>, LoadError> {
    read_bytes(path, DATA_LIMIT)
}

fn read_bytes(path: &str, limit: u64) -> Result<Vec<u8>, LoadError> {
    let fail = |kind| LoadError { name: path.to_string(), kind };
    let unreadable = |error: std::io::Error| fail(LoadErrorKind::Unreadable(reason(&error)));
    let mut bytes = vec![];
    if path == "-" {
        let name = "<stdin>".to_string();
        std::io::stdin().lock().take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > limit {
            return Err(LoadError { name, kind: LoadErrorKind::TooLarge { limit } });
        }
        return Ok(bytes);
    }
    let file = std::fs::File::open(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => fail(LoadErrorKind::Missing { nearest: nearest(path) }),
        _ => unreadable(error),
    })?;
    let metadata = file.metadata().map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(fail(LoadErrorKind::Folder));
    }
    if metadata.len() > limit {
        return Err(fail(LoadErrorKind::TooLarge { limit }));
    }
    file.take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        return Err(fail(LoadErrorKind::TooLarge { limit }));
    }
    Ok(bytes)
}

/// The files below a folder whose names have an ending, sorted, `most` at most; hidden folders and what builds leave
/// behind are passed over.
pub fn list(folder: &str, ending: &str, most: usize) -> Vec<String> {
    const DEPTH: usize = 8;
    const MOST_ENTRIES: usize = 100_000;
    let mut found = vec![];
    let mut seen = 0;
    let mut folders = vec![(std::path::PathBuf::from(folder), 0)];
    while let Some((folder, depth)) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for entry in entries.flatten() {
            seen += 1;
            if seen > MOST_ENTRIES || found.len() >= most {
                break;
            }
            let name = entry.file_name().to_string_lossy().into_owned();
            // Links are not followed: they may lead in circles.
            let Ok(kind) = entry.file_type() else { continue };
            if kind.is_dir() {
                let skipped = name.starts_with('.') || name == "target" || name == "node_modules";
                if !skipped && depth < DEPTH {
                    folders.push((entry.path(), depth + 1));
                }
            } else if name.ends_with(ending) {
                found.push(entry.path().to_string_lossy().replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

/// A system error without Rust's `(os error 2)`.
pub fn reason(error: &std::io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or(&text);
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
}

/// Puts the text around a bad byte into the map, its line being the last, and returns the byte's place there.
fn show(name: &str, bytes: &[u8], offset: usize, map: &mut SourceMap) -> Span {
    // What follows the line is of no use and may be anything; what stands before keeps line numbers right.
    let end = bytes[offset..].iter().take(200).position(|b| *b == b'\n').unwrap_or(200);
    let before = String::from_utf8_lossy(&bytes[..offset]).into_owned();
    let after = String::from_utf8_lossy(&bytes[offset..bytes.len().min(offset + end)]).into_owned();
    let width = after.chars().next().map_or(0, char::len_utf8);
    let start = before.len();
    let file = map.add(name, before + &after);
    Span::new(file, start, start + width)
}

/// The file beside a missing one whose name is most like it.
fn nearest(path: &str) -> Option<String> {
    let path = Path::new(path);
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut best: Option<(usize, String)> = None;
    for entry in std::fs::read_dir(folder).ok()?.take(10_000).flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let distance = edit_distance(wanted, &name);
        let better = best.as_ref().is_none_or(|(d, n)| (distance, &name) < (*d, n));
        if distance <= wanted.chars().count() / 3 && better {
            best = Some((distance, name));
        }
    }
    let (_, name) = best?;
    Some(match path.parent().filter(|p| !p.as_os_str().is_empty()) {
        Some(parent) => parent.join(name).to_string_lossy().into_owned(),
        None => name,
    })
}

/// The number of single-letter changes, insertions and deletions between two words, without regard to case
/// (Levenshtein).
pub fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.to_lowercase().chars().collect();
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_keeps_its_bytes_but_the_byte_order_mark() {
        let mut map = SourceMap::default();
        let file = decode("a", b"\xEF\xBB\xBFSe:U".to_vec(), &mut map).unwrap();
        assert_eq!(map.file(file).unwrap().text, "Se:U");
    }

    #[test]
    fn bad_bytes_are_named_with_their_place() {
        let mut map = SourceMap::default();
        let error = decode("a.bg", b"1:x\n  \xFF -> 0:y\nmore".to_vec(), &mut map).unwrap_err();
        let LoadErrorKind::NotUtf8 { offset: 6, span } = error.kind else { panic!("{error:?}") };
        assert_eq!(map.position(span), Some((2, 3)));
        let error = decode("b", b"\x7fELF\x00\x01".to_vec(), &mut map).unwrap_err();
        assert!(matches!(error.kind, LoadErrorKind::Binary { offset: 4, .. }), "{error:?}");
        let error = decode("c", b" \n\t\n".to_vec(), &mut map).unwrap_err();
        assert!(matches!(error.kind, LoadErrorKind::Empty { .. }), "{error:?}");
    }

    #[test]
    fn missing_files_and_folders_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("actuator.bg"), "Se:U").unwrap();
        let name = |file: &str| folder.path().join(file).to_string_lossy().into_owned();
        let mut map = SourceMap::default();
        let error = load(&name("actuater.bg"), &mut map).unwrap_err();
        let nearest = Some(name("actuator.bg"));
        assert_eq!(error.kind, LoadErrorKind::Missing { nearest });
        let error = load(&name("zebra.cir"), &mut map).unwrap_err();
        assert_eq!(error.kind, LoadErrorKind::Missing { nearest: None });
        let error = load(&name(""), &mut map).unwrap_err();
        assert_eq!(error.kind, LoadErrorKind::Folder);
        assert!(load(&name("actuator.bg"), &mut map).is_ok());
    }

    #[test]
    fn edit_distances() {
        for (a, b, distance) in [("", "abc", 3), ("Flow", "flaw", 1), ("kitten", "sitting", 3)] {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
        }
    }
}
