//! Reads a netlist line by line, by hand: a deck of a million lines takes about a second.
//!
//! The first line is the title, whatever it says. Case is folded, `+` continues a line, `*` `;` `//` and `$` begin
//! comments. What is not understood is an error at its place; nothing that belongs to the circuit is skipped silently.
//! Expressions alone go through a grammar (grammar/spice.pest); plain numbers never do.

pub mod guess;
pub mod lines;
pub mod number;
pub mod cursor;
pub mod expression;
pub mod waveforms;
pub mod devices;
pub mod cards;
pub mod analyses;

use crate::diagnostic::Diagnostic;
use crate::netlist::dialects::{Dialect, Reading};
use crate::netlist::{Card, CardKind, Names, Netlist, Subcircuit};
use crate::source::{FileId, SourceMap, Span};
use cursor::Cursor;
use lines::Lines;
use number::Number;
pub use waveforms::WAVEFORMS;

/// How a netlist is to be read.
#[derive(Clone, Debug, Default)]
pub struct How {
    /// In which dialect; guessed from the text where it is not said.
    pub dialect: Option<&'static Dialect>,
    /// The folder outside of which no file is read that a netlist names.
    pub confine: Option<String>,
}

impl How {
    /// In a dialect.
    pub fn of(dialect: &'static Dialect) -> How {
        How { dialect: Some(dialect), confine: None }
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
    /// What is wrong.
    pub diagnostics: &'d mut Vec<Diagnostic>,
}

/// The netlist that a file holds. Lines that are wrong are left out, with errors.
pub fn read(
    map: &mut SourceMap,
    file: FileId,
    how: &How,
    diagnostics: &mut Vec<Diagnostic>,
) -> Netlist {
    let text = map.file(file).map_or("", |file| file.text.as_str());
    let (title, body) = match text.find('\n') {
        Some(end) => (&text[..end], end + 1),
        None => (text, text.len()),
    };
    let dialect = how.dialect.unwrap_or_else(|| {
        let guess = guess::guess(file, text);
        diagnostics.extend(guess.by.map(|span| guessed(guess.dialect, span)));
        guess.dialect
    });
    let mut netlist = Netlist {
        dialect,
        title: title.trim_start_matches('\u{feff}').trim_end_matches('\r').to_string(),
        ..Netlist::default()
    };
    let reading = dialect.reading();
    let mut reader = Reader { dialect, reading, file, names: Names::default(), diagnostics };
    let mut scopes: Vec<(Subcircuit, Span, Option<String>)> = vec![];
    let mut skipping: Option<Span> = None;
    for line in Lines::new(text, body, reading.comments) {
        let words: &str = &line.text;
        let span = Span::new(file, line.start, line.start + words.len());
        let mut cursor = Cursor { text: words, base: line.start, at: 0 };
        if skipping.is_some() {
            if words.len() >= 5 && words.as_bytes()[..5].eq_ignore_ascii_case(b".endc") {
                skipping = None;
            }
            continue;
        }
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
                    "end" => break,
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
                    "subckt" => {
                        if let Some(subcircuit) = cards::subcircuit(&mut reader, &mut cursor) {
                            scopes.push((subcircuit, span, line.comment));
                        }
                        continue;
                    }
                    "ends" => match scopes.pop() {
                        Some((subcircuit, opening, comment)) => {
                            let kind = CardKind::Subcircuit(subcircuit);
                            let card = Card { kind, span: opening, comment };
                            push(&mut netlist, &mut scopes, card);
                            None
                        }
                        None => {
                            reader.diagnostics.push(Diagnostic::error(
                                "E0709",
                                span,
                                "`.ends` ends no subcircuit",
                            ));
                            None
                        }
                    },
                    _ => cards::card(&mut reader, &mut cursor, span),
                }
            }
            _ => devices::device(&mut reader, &mut cursor).map(CardKind::Device),
        };
        if let Some(kind) = kind {
            push(&mut netlist, &mut scopes, Card { kind, span, comment: line.comment });
        }
    }
    if let Some(span) = skipping {
        reader.diagnostics.push(Diagnostic::error(
            "E0709",
            span,
            "the commands after `.control` never end",
        ));
    }
    while let Some((subcircuit, opening, comment)) = scopes.pop() {
        let name = reader.names.text(subcircuit.name).to_string();
        let error =
            Diagnostic::error("E0709", opening, format!("the subcircuit `{name}` is never ended"));
        reader.diagnostics.push(error);
        push(
            &mut netlist,
            &mut scopes,
            Card { kind: CardKind::Subcircuit(subcircuit), span: opening, comment },
        );
    }
    netlist.names = reader.names;
    netlist
}

/// Says how a text is read that does not say so itself.
fn guessed(dialect: &Dialect, span: Span) -> Diagnostic {
    Diagnostic::note("N0719", span, format!("read as a netlist for {}", dialect.name))
        .says("only that simulator understands this")
        .help(format!("say it with --dialect {}, or that it is another", dialect.name))
}

fn push(netlist: &mut Netlist, scopes: &mut [(Subcircuit, Span, Option<String>)], card: Card) {
    match scopes.last_mut() {
        Some((subcircuit, _, _)) => subcircuit.cards.push(card),
        None => netlist.cards.push(card),
    }
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
    let (meaning, mistaken, plain) = match letters.as_bytes().first()? {
        b'M' if begins("meg") || begins("mil") => return None,
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
