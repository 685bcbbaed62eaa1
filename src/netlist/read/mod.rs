//! Reads a netlist line by line, by hand: a deck of a million lines takes about a second.
//!
//! The first line is the title, whatever it says. Case is folded, `+` continues a line, `*` `;` `//` and `$` begin
//! comments. What is not understood is an error at its place; nothing that belongs to the circuit is skipped silently.
//! Expressions alone go through a grammar (grammar/spice.pest); plain numbers never do.

pub mod guess;
pub mod include;
pub mod lines;
pub mod pile;
pub mod blocks;
pub mod fourier;
mod functions;
pub mod options;
mod random;
pub mod number;
pub mod cursor;
pub mod expression;
pub mod calls;
mod files;
mod sensitivity;
pub mod waveforms;
pub mod passive;
pub mod linked;
pub mod devices;
pub mod cards;
pub mod analyses;
pub mod measure;

use crate::diagnostic::Diagnostic;
use crate::netlist::dialects::{Dialect, Reading};
use crate::netlist::{Card, CardKind, Definition, Names, Netlist};
use crate::source::{FileId, SourceMap, Span};
use blocks::Blocks;
use cursor::Cursor;
use functions::Calls;
use number::Number;
use pile::Pile;
pub use waveforms::WAVEFORMS;

/// How a netlist is to be read.
#[derive(Clone, Debug, Default)]
pub struct How {
    /// In which dialect; guessed from the text where it is not said.
    pub dialect: Option<&'static Dialect>,
    /// The folder outside of which no file is read that a netlist names.
    pub confine: Option<String>,
    /// Folders in which files are looked for, after that of the file that names them.
    pub folders: Vec<String>,
}

impl How {
    /// In a dialect.
    pub fn of(dialect: &'static Dialect) -> How {
        How { dialect: Some(dialect), ..How::default() }
    }
}

/// A netlist on its way.
pub struct Reader<'d> {
    /// The dialect.
    pub dialect: &'static Dialect,
    /// What it differs in.
    pub reading: Reading,
    /// The file.
    pub file: FileId,
    /// The names so far.
    pub names: Names,
    /// Calls of functions that the netlist itself has to define.
    pub calls: Calls,
    /// Whether it defines any.
    pub defined: bool,
    /// Those that the card being read defines besides.
    pub functions: Vec<Definition>,
    /// Options that mean nothing here.
    pub passed: Vec<String>,
    /// What is wrong.
    pub diagnostics: &'d mut Vec<Diagnostic>,
    map: &'d SourceMap,
    how: &'d How,
}

impl Reader<'_> {
    /// The text of a data file that a card names. What is wrong has been said where there is none.
    pub fn data(&mut self, name: &str, span: Span) -> Option<String> {
        let found = include::data(self.map, self.file, name, self.how, span);
        found.map_err(|error| self.diagnostics.push(*error)).ok()
    }
}

/// The netlist that a file holds, and those that it names. Lines that are wrong are left out, with errors.
pub fn read(
    map: &mut SourceMap,
    file: FileId,
    how: &How,
    diagnostics: &mut Vec<Diagnostic>,
) -> Netlist {
    let text = map.file(file).map_or("", |file| file.text.as_str());
    let title = text.lines().next().unwrap_or("").trim_start_matches('\u{feff}').to_string();
    let dialect = how.dialect.unwrap_or_else(|| {
        let guess = guess::guess(file, text);
        diagnostics.extend(guess.by.map(|span| guessed(guess.dialect, span)));
        guess.dialect
    });
    let lines = memchr::memchr_iter(b'\n', text.as_bytes()).count();
    let room = lines.min(text.len() / SHORTEST);
    let includes = include::load(map, file, how, diagnostics);
    let mut reading = dialect.reading();
    if includes.replace_ground {
        reading.grounds = EVERY_GROUND;
    }
    reading.degrees = includes.degrees.unwrap_or(reading.degrees);
    let mut reader = Reader {
        dialect,
        reading,
        file,
        names: Names::default(),
        calls: Calls::default(),
        defined: false,
        functions: vec![],
        passed: vec![],
        diagnostics,
        map,
        how,
    };
    let mut netlist = Netlist { dialect, title, ..Netlist::default() };
    // A card a line, most often: moving a million of them as they come takes longer than reading them.
    netlist.cards.reserve(room);
    let mut pile = Pile::new(map, file, reading.comments);
    let mut blocks = Blocks::default();
    let mut skipping: Option<Span> = None;
    while let Some((file, line)) = pile.next(reader.diagnostics) {
        reader.file = file;
        let words: &str = &line.text;
        let span = Span::new(file, line.start, line.start + words.len());
        if skipping.is_some() {
            if words.len() >= 5 && words.as_bytes()[..5].eq_ignore_ascii_case(b".endc") {
                skipping = None;
            }
            continue;
        }
        let mut cursor = Cursor { text: words, base: line.start, at: 0 };
        let kind = match words.as_bytes().first() {
            Some(b'*') => {
                if header(&mut netlist, words) {
                    continue;
                }
                Some(CardKind::Comment(words[1..].to_string()))
            }
            Some(b'.') => {
                cursor.at = 1;
                let (keyword, _) = cursor.word();
                match keyword.to_ascii_lowercase().as_str() {
                    "end" => {
                        pile.end();
                        continue;
                    }
                    "title" => {
                        netlist.title = cursor.rest().0.to_string();
                        None
                    }
                    "control" => {
                        reader.diagnostics.push(
                            Diagnostic::warning(
                                "W0703",
                                span,
                                "the commands from `.control` to `.endc` are skipped",
                            )
                            .because(
                                "they are a program for ngspice and say nothing of the circuit",
                            ),
                        );
                        skipping = Some(span);
                        None
                    }
                    "include" | "inc" | "lib" | "endl" => {
                        pile.include(&includes, keyword, cursor.rest().0, span, reader.diagnostics);
                        None
                    }
                    word => {
                        let taken = blocks.take(&mut reader, &mut netlist, word, &mut cursor, span);
                        if taken {
                            blocks.comment(line.comment);
                            continue;
                        }
                        cards::card(&mut reader, &mut cursor, span)
                    }
                }
            }
            _ => devices::device(&mut reader, &mut cursor).map(CardKind::Device),
        };
        for definition in reader.functions.drain(..) {
            let kind = CardKind::Function(definition);
            blocks.push(&mut netlist, Card { kind, span, comment: None });
        }
        if let Some(kind) = kind {
            blocks.push(&mut netlist, Card { kind, span, comment: line.comment });
        }
    }
    if let Some(span) = skipping {
        reader.diagnostics.push(Diagnostic::error(
            "E0709",
            span,
            "the commands after `.control` never end",
        ));
    }
    blocks.close(&mut reader, &mut netlist);
    functions::resolve(&mut reader, &mut netlist);
    let passed = options::passed(&reader.passed);
    reader.diagnostics.extend(passed);
    netlist.names = reader.names;
    netlist
}

/// Bytes of a card, at least on average: room is made for no more cards than that.
const SHORTEST: usize = 16;

/// Names of the ground where `.preprocess replaceground` asks for all of them.
const EVERY_GROUND: &[&str] = &["0", "gnd", "gnd!", "ground"];

/// Says how a text is read that does not say so itself.
fn guessed(dialect: &Dialect, span: Span) -> Diagnostic {
    Diagnostic::note("N0719", span, format!("read as a netlist for {}", dialect.name))
        .says("only that simulator understands this")
        .help(format!("say it with --dialect {}, or that it is another", dialect.name))
}

/// `*bondspice key=value`, or `*bondspice+ …`, which goes on with the value before.
fn header(netlist: &mut Netlist, line: &str) -> bool {
    let Some(rest) = line.strip_prefix("*bondspice") else { return false };
    if let Some(more) = rest.strip_prefix("+ ") {
        if let Some((_, value)) = netlist.header.last_mut() {
            value.push_str(more);
            return true;
        }
        return false;
    }
    let pair = rest.strip_prefix(' ').and_then(|rest| rest.split_once('='));
    if let Some((key, value)) = pair {
        netlist.header.push((key.trim().to_string(), value.to_string()));
    }
    pair.is_some()
}

/// `1M`, `1F` and `1A` seldom mean what they say.
pub fn suffix_warning(text: &str, number: &Number, span: Span) -> Option<Diagnostic> {
    let letters = &text[number.letters..number.end];
    let begins = |suffix: &str| {
        letters.get(..suffix.len()).is_some_and(|own| own.eq_ignore_ascii_case(suffix))
    };
    // `0.5MS`, `100FA`: the unit behind it shows that a small quantity is meant.
    let unit = letters.get(1..).unwrap_or("");
    let small = ["s", "v", "a", "h", "f", "w", "sec", "volt", "amp"];
    let meant = small.iter().any(|small| small.eq_ignore_ascii_case(unit));
    let (meaning, mistaken, plain) = match letters.as_bytes().first()? {
        b'M' if begins("meg") || begins("mil") => return None,
        b'M' | b'F' if meant => return None,
        b'M' => ("milli, 1e-3", "for 1e6 write `meg`", "m"),
        b'F' => ("femto, 1e-15", "a farad needs no letter", "f"),
        b'A' if letters.len() == 1 => ("atto, 1e-18", "an ampere needs no letter", "a"),
        _ => return None,
    };
    let capital = Span {
        start: span.start + number.letters as u32,
        end: span.start + number.letters as u32 + 1,
        ..span
    };
    let message = format!(
        "`{text}` is {} {}",
        &text[..number.letters],
        meaning.split(',').next().unwrap_or(meaning)
    );
    Some(
        Diagnostic::warning("W0701", span, message)
            .says(format!("`{}` means {meaning}", &letters[..1]))
            .help(format!("{mistaken}; if it was meant so, write `{plain}`"))
            .fix(format!("write `{plain}`"), vec![(capital, plain.to_string())]),
    )
}

#[cfg(test)]
mod tests;
