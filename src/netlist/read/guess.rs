//! Which dialect a text is in, where nobody says so: by what only one of them writes.
//!
//! The header of an emitted netlist names it. Else the first line that only one simulator understands tells; a text
//! without any is read as ngspice reads it.

use crate::netlist::dialects::{self, Dialect};
use crate::source::{FileId, Span};

/// Cards of Xyce alone.
const XYCE_CARDS: &[&str] =
    &["global_param", "preprocess", "dcvolt", "initcond", "result", "hb", "embeddedsampling"];
/// Packages of Xyce's `.options`.
const XYCE_PACKAGES: &[&str] = &[
    "timeint",
    "timeint-hb",
    "nonlin",
    "nonlin-tran",
    "nonlin-hb",
    "device",
    "linsol",
    "linsol-hb",
    "loca",
    "output",
    "measure",
    "topology",
    "parser",
    "restart",
    "sensitivity",
    "nonlin-twolevel",
    "fft",
    "hbint",
];
/// Words of Xyce's `.print`, each before a `=`.
const XYCE_PRINT: &[&str] = &["format", "file", "width", "precision", "delimiter"];
/// Cards of LTspice alone.
const LTSPICE_CARDS: &[&str] =
    &["backanno", "machine", "endmachine", "ferret", "loadbias", "savebias", "wave"];

/// The dialect, with the place and what was found there.
pub struct Guess {
    /// The dialect.
    pub dialect: &'static Dialect,
    /// What tells; `None` where nothing does, or the header says it.
    pub by: Option<Span>,
}

/// The dialect of a text whose first line is its title.
pub fn guess(file: FileId, text: &str) -> Guess {
    let title = text.lines().next().unwrap_or("");
    if title.starts_with('*') && title.trim_end().to_ascii_lowercase().ends_with(".asc") {
        // The title of a netlist from a schematic: `* C:\circuits\filter.asc`.
        return found("ltspice", Some(Span::new(file, 0, title.len())));
    }
    let (mut at, mut xyce_package) = (0, None);
    while at < text.len() {
        let end =
            memchr::memchr(b'\n', &text.as_bytes()[at..]).map_or(text.len(), |length| at + length);
        let line = text[at..end].trim_start();
        let start = end - line.len();
        // What stands behind a mark is comment.
        let line = line.split(';').next().unwrap_or(line).trim_end();
        let span = Span::new(file, start, start + line.len());
        at = end + 1;
        if let Some(name) = line.strip_prefix("*bondspice dialect=") {
            return found(name.trim(), None);
        }
        let Some(card) = line.strip_prefix('.') else { continue };
        let mut words = card.split([' ', '\t', '=']).filter(|word| !word.is_empty());
        let Some(keyword) = words.next() else { continue };
        let is = |known: &[&str], word: &str| known.iter().any(|k| k.eq_ignore_ascii_case(word));
        if is(&["control"], keyword) {
            return found("ngspice", None);
        }
        if is(XYCE_CARDS, keyword) {
            return found("xyce", Some(span));
        }
        if is(LTSPICE_CARDS, keyword) {
            return found("ltspice", Some(span));
        }
        // A flag of that name would have no others behind it.
        if is(&["options", "option"], keyword)
            && words.next().is_some_and(|word| is(XYCE_PACKAGES, word))
            && words.next().is_some()
        {
            xyce_package = xyce_package.or(Some(span));
        }
        let mut words = card.split([' ', '\t']).filter(|word| !word.is_empty()).skip(2);
        let layout = |word: &str| word.split_once('=').is_some_and(|(key, _)| is(XYCE_PRINT, key));
        if is(&["print"], keyword) && words.any(layout) {
            return found("xyce", Some(span));
        }
    }
    match xyce_package {
        Some(span) => found("xyce", Some(span)),
        None => Guess { dialect: Default::default(), by: None },
    }
}

fn found(name: &str, by: Option<Span>) -> Guess {
    let dialect = dialects::find(name).filter(|dialect| dialect.read.is_some());
    Guess { dialect: dialect.unwrap_or_default(), by }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_only_one_writes_tells() {
        for (text, name, told) in [
            ("t\nr1 a 0 1\n.op\n.end\n", "ngspice", ""),
            ("t\n*bondspice dialect=xyce\n", "xyce", ""),
            ("t\n*bondspice dialect=nosuch\n", "ngspice", ""),
            ("t\n  .Global_Param x=1 \nr1 a 0 1\n", "xyce", ".Global_Param x=1"),
            ("t\n.options nonlin maxstep=20\n", "xyce", ".options nonlin maxstep=20"),
            ("t\n.options reltol=1e-4 method=gear\n", "ngspice", ""),
            ("t\n.print tran format=csv v(a)\n", "xyce", ".print tran format=csv v(a)"),
            ("t\n.print tran v(a) v(b)\n", "ngspice", ""),
            ("* C:\\x\\y.asc\nr1 a 0 1\n", "ltspice", "* C:\\x\\y.asc"),
            ("t\n.backanno\n.end\n", "ltspice", ".backanno"),
            ("t\n.control\nrun\n.endc\n.backanno\n", "ngspice", ""),
        ] {
            let guess = guess(FileId(0), text);
            let by = guess.by.map_or("", |span| &text[span.start as usize..span.end as usize]);
            assert_eq!((guess.dialect.name, by), (name, told), "{text}");
        }
    }
}
