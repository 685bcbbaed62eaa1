//! The lines of a netlist in the order in which they count: those of a file that a card names stand in the card's place.

use super::include::{Includes, section};
use super::lines::{Line, Lines};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, SourceMap, Span};

/// Files within files, at most.
const DEEPEST: usize = 100;

/// Times that a file or a section is put in a card's place, at most; each may name others.
const MOST: usize = 100_000;

/// Bytes of all that is put in, at most.
const MOST_BYTES: u64 = 1 << 31;

/// Open files, the one that is read last.
pub struct Pile<'m> {
    map: &'m SourceMap,
    marks: &'static [&'static str],
    open: Vec<Open<'m>>,
    taken: usize,
    bytes: u64,
}

struct Open<'m> {
    file: FileId,
    lines: Lines<'m>,
    /// The card that names it.
    span: Span,
    /// Of a library, the section that is wanted, and where one is in it.
    section: Option<(String, Place)>,
    /// A section that is passed over, with the line that begins it.
    passed: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Before,
    Within,
    Behind,
}

impl<'m> Pile<'m> {
    /// The lines of a file behind its title.
    pub fn new(map: &'m SourceMap, file: FileId, marks: &'static [&'static str]) -> Pile<'m> {
        let text = map.file(file).map_or("", |file| file.text.as_str());
        let body = text.find('\n').map_or(text.len(), |end| end + 1);
        let lines = Lines::new(text, body, marks);
        let first = Open { file, lines, span: Span::NONE, section: None, passed: false };
        Pile { map, marks, open: vec![first], taken: 0, bytes: 0 }
    }

    /// The next line that counts, and its file.
    pub fn next(&mut self, d: &mut Vec<Diagnostic>) -> Option<(FileId, Line<'m>)> {
        loop {
            let open = self.open.last_mut()?;
            let Some(line) = open.lines.next() else {
                if let Some((name, Place::Before)) = &open.section {
                    let message = format!("the library has no section `{name}`");
                    let error = Diagnostic::error("E0715", open.span, message)
                        .because("a section begins with `.lib name` and ends with `.endl`");
                    d.push(error);
                }
                self.open.pop();
                continue;
            };
            let (keyword, rest) = split(&line.text);
            let begins = keyword.eq_ignore_ascii_case(".lib") && section(rest).is_none();
            let ends = keyword.eq_ignore_ascii_case(".endl");
            if open.passed {
                open.passed = !ends;
                continue;
            }
            match &mut open.section {
                Some((name, place @ Place::Before)) => {
                    let own = rest.trim().trim_matches(['"', '\'']);
                    if begins && own.eq_ignore_ascii_case(name) {
                        *place = Place::Within;
                    }
                    continue;
                }
                Some((_, place @ Place::Within)) if ends => {
                    *place = Place::Behind;
                    continue;
                }
                Some((_, Place::Behind)) => continue,
                _ => return Some((open.file, line)),
            }
        }
    }

    /// Leaves the file that is read: `.end`.
    pub fn end(&mut self) {
        // Behind `.end` of the netlist itself nothing counts; an included file only ends itself.
        self.open.pop();
    }

    /// Puts a file in the place of a card.
    pub fn include(
        &mut self,
        includes: &Includes,
        keyword: &str,
        rest: &str,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) {
        let Some(open) = self.open.last_mut() else { return };
        let named = section(rest).filter(|_| keyword.eq_ignore_ascii_case("lib"));
        let Some(file) = includes.file(open.file, span.start as usize) else {
            match () {
                () if keyword.eq_ignore_ascii_case("endl") => {
                    d.push(Diagnostic::error("E0709", span, "`.endl` ends no section"));
                }
                () if rest.trim().is_empty() => {
                    let error = Diagnostic::error("E0703", span, "the name of the file is missing");
                    d.push(error.help(format!(".{} \"models.lib\"", keyword.to_lowercase())));
                }
                // A section that nobody asked for; what cannot be read has been said.
                () if keyword.eq_ignore_ascii_case("lib") && named.is_none() => open.passed = true,
                () => {}
            }
            return;
        };
        let wanted = named.map(|name| (name.to_string(), Place::Before));
        let same = |open: &&Open| {
            let name = |section: &Option<(String, Place)>| {
                section.as_ref().map(|(name, _)| name.to_lowercase())
            };
            open.file == file && name(&open.section) == name(&wanted)
        };
        if self.open.iter().any(|open| same(&open)) || self.open.len() >= DEEPEST {
            let files = self.open.iter().map(|open| open.file).chain([file]);
            let names = files.filter_map(|file| Some(self.map.file(file)?.name.as_str()));
            let names: Vec<&str> = names.collect();
            let round = names[names.len().saturating_sub(6)..].join(" → ");
            let error = Diagnostic::error("E0711", span, "a file that includes itself");
            d.push(error.because(round));
            return;
        }
        let text = self.map.file(file).map_or("", |file| file.text.as_str());
        self.taken += 1;
        self.bytes += text.len() as u64;
        if self.taken > MOST || self.bytes > MOST_BYTES {
            if self.taken <= MOST + 1 {
                let message = format!("more than {MOST} files, or 2 GiB, are included");
                // The card of the netlist itself that led here.
                let place = self.open.get(1).map_or(span, |open| open.span);
                d.push(Diagnostic::error("E0713", place, message));
            }
            // Nothing more is read, so that the end comes soon.
            self.taken = MOST + 1;
            self.open.clear();
            return;
        }
        let lines = Lines::new(text, 0, self.marks);
        self.open.push(Open { file, lines, span, section: wanted, passed: false });
    }
}

fn split(line: &str) -> (&str, &str) {
    if !line.starts_with('.') {
        return ("", "");
    }
    line.split_at(line.find([' ', '\t']).unwrap_or(line.len()))
}
