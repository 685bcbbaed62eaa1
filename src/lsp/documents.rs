//! The texts that an editor holds open, and how addresses become names of files and back.

use super::position;
use lsp_types::{TextDocumentContentChangeEvent, Uri};
use std::collections::BTreeMap;
use std::str::FromStr;

/// A text that is open in the editor.
#[derive(Clone, Debug)]
pub struct Document {
    /// Its address as the editor writes it.
    pub uri: String,
    /// Its text now.
    pub text: String,
    /// The editor's number of it.
    pub version: i32,
}

/// All texts that are open, by the names of their files.
#[derive(Debug, Default)]
pub struct Documents {
    open: BTreeMap<String, Document>,
    /// The folder in which the files of the library stand for reading.
    library: Option<String>,
}

impl Documents {
    /// None yet; `library` is the folder in which the files of the library stand.
    pub fn new(library: Option<String>) -> Documents {
        let library = library.map(|folder| clean(&folder.replace('\\', "/")) + "/");
        Documents { open: BTreeMap::new(), library }
    }

    /// Every open text with the name of its file.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Document)> {
        self.open.iter().map(|(name, document)| (name.as_str(), document))
    }

    /// The open text of a file.
    pub fn get(&self, name: &str) -> Option<&Document> {
        self.open.get(name)
    }

    /// Takes a text that was opened.
    pub fn open(&mut self, uri: &str, text: String, version: i32) -> String {
        let name = self.name(uri);
        self.open.insert(name.clone(), Document { uri: uri.to_string(), text, version });
        name
    }

    /// Forgets a text that was closed.
    pub fn close(&mut self, uri: &str) -> String {
        let name = self.name(uri);
        self.open.remove(&name);
        name
    }

    /// Changes a text; changes without a range replace all of it.
    pub fn change(
        &mut self,
        uri: &str,
        version: i32,
        changes: Vec<TextDocumentContentChangeEvent>,
    ) -> Option<String> {
        let name = self.name(uri);
        let document = self.open.get_mut(&name)?;
        document.version = version;
        for change in changes {
            match change.range {
                None => document.text = change.text,
                Some(range) => {
                    let start = position::byte(&document.text, range.start);
                    let end = position::byte(&document.text, range.end).max(start);
                    document.text.replace_range(start..end, &change.text);
                }
            }
        }
        Some(name)
    }

    /// The name of the file at an address: its path, or `std/…` for a file of the library. An address that is no file's
    /// is its own name.
    pub fn name(&self, uri: &str) -> String {
        let Some(path) = path_of(uri) else { return uri.to_string() };
        let path = clean(&path);
        match self.library.as_deref().and_then(|library| path.strip_prefix(library)) {
            Some(inside) => format!("std/{inside}"),
            None => path,
        }
    }

    /// The address of a file, as the editor writes it where it is open. `None` where nothing leads to it.
    pub fn uri(&self, name: &str) -> Option<Uri> {
        if let Some(document) = self.open.get(name) {
            return Uri::from_str(&document.uri).ok();
        }
        match name.strip_prefix("std/") {
            Some(inside) => {
                let library = self.library.as_deref()?;
                Uri::from_str(&address(&format!("{library}{inside}"))).ok()
            }
            None if name.starts_with('<') => None,
            None if name.contains("://") => Uri::from_str(name).ok(),
            None => Uri::from_str(&address(name)).ok(),
        }
    }
}

/// The path of a `file:` address.
fn path_of(uri: &str) -> Option<String> {
    let rest = uri.strip_prefix("file://")?;
    // What stands before the path is the name of this machine.
    let path = &rest[rest.find('/')?..];
    let path = decoded(path);
    // `/c:/models` is `c:/models`.
    let drive = path
        .get(1..3)
        .is_some_and(|d| d.ends_with(':') && d.starts_with(|c: char| c.is_ascii_alphabetic()));
    Some(if drive { path[1..].to_string() } else { path })
}

/// The `file:` address of a path.
fn address(path: &str) -> String {
    let mut text = String::from("file://");
    if !path.starts_with('/') {
        text.push('/');
    }
    for byte in path.bytes() {
        let plain = byte.is_ascii_alphanumeric() || b"/-._~".contains(&byte);
        match plain {
            true => text.push(char::from(byte)),
            false => text.push_str(&format!("%{byte:02X}")),
        }
    }
    text
}

/// An address whose blanks and letters beyond ASCII are written as `%20`.
pub fn escaped(uri: &str) -> String {
    let mut text = String::with_capacity(uri.len());
    for byte in uri.bytes() {
        match byte {
            b' ' | b'"' | b'<' | b'>' | b'\\' | b'^' | b'`' | b'{' | b'|' | b'}' => {
                text.push_str(&format!("%{byte:02X}"));
            }
            byte if byte.is_ascii_graphic() => text.push(char::from(byte)),
            byte => text.push_str(&format!("%{byte:02X}")),
        }
    }
    text
}

/// A text with its `%20` read.
fn decoded(text: &str) -> String {
    let digit = |byte: Option<&u8>| byte.and_then(|byte| char::from(*byte).to_digit(16));
    let bytes = text.as_bytes();
    let mut plain = vec![];
    let mut at = 0;
    while let Some(byte) = bytes.get(at) {
        match (byte, digit(bytes.get(at + 1)), digit(bytes.get(at + 2))) {
            (b'%', Some(high), Some(low)) => {
                plain.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                plain.push(*byte);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&plain).into_owned()
}

/// A path with `.` and `..` resolved, so that one file has one name.
fn clean(path: &str) -> String {
    let mut parts: Vec<&str> = vec![];
    for part in path.split('/') {
        match part {
            "." => {}
            ".." if parts.last().is_some_and(|last| !last.is_empty()) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use lsp_types::{Position, Range};

    #[test]
    fn addresses_and_names() {
        let mut documents = Documents::new(Some("/tmp/x/std".into()));
        for (uri, name) in [
            ("file:///home/u/a%20b/%CE%A6.bg", "/home/u/a b/Φ.bg"),
            ("file:///home/u/./x/../y.bg", "/home/u/y.bg"),
            ("file:///c%3A/m/y.bg", "c:/m/y.bg"),
            ("file://host/m/y.bg", "/m/y.bg"),
            ("untitled:Untitled-1", "untitled:Untitled-1"),
            ("file:///tmp/x/std/electrical.bg", "std/electrical.bg"),
            ("file:///odd%", "/odd%"),
        ] {
            assert_eq!(documents.name(uri), name);
        }
        for name in ["/home/u/a b/Φ.bg", "c:/m/y.bg", "std/electrical.bg"] {
            assert_eq!(documents.name(documents.uri(name).unwrap().as_str()), name);
        }
        assert_eq!(escaped("file:///a b/Φ%20.bg"), "file:///a%20b/%CE%A6%20.bg");
        // The editor's own writing of an address is kept.
        documents.open("file:///c%3A/m/y.bg", String::new(), 1);
        assert_eq!(documents.uri("c:/m/y.bg").unwrap().as_str(), "file:///c%3A/m/y.bg");
        assert!(documents.uri("<stdin>").is_none());
    }

    #[test]
    fn changes_are_carried_out_in_their_order() {
        let mut documents = Documents::new(None);
        documents.open("file:///a.bg", "Φ🚀 one\ntwo".into(), 1);
        let change = |start: (u32, u32), end: (u32, u32), text: &str| {
            let place = |(line, character)| Position { line, character };
            let range = Range { start: place(start), end: place(end) };
            TextDocumentContentChangeEvent {
                range: Some(range),
                range_length: None,
                text: text.into(),
            }
        };
        let changes = vec![
            change((0, 4), (0, 7), "1"),
            change((1, 0), (1, 0), ">"),
            change((0, 1), (0, 3), ""),
            change((9, 9), (9, 9), "!"),
        ];
        assert_eq!(documents.change("file:///a.bg", 2, changes).as_deref(), Some("/a.bg"));
        assert_eq!(documents.get("/a.bg").unwrap().text, "Φ 1\n>two!");
        let all =
            TextDocumentContentChangeEvent { range: None, range_length: None, text: "x".into() };
        documents.change("file:///a.bg", 3, vec![all]);
        assert_eq!(documents.get("/a.bg").unwrap().text, "x");
        assert_eq!(documents.change("file:///b.bg", 3, vec![]), None);
    }
}
