//! Cards that ask for analyses and sweeps, in the forms of ngspice, Xyce and LTspice.
//!
//! | card | forms |
//! |---|---|
//! | `.dc` | `src from to by …`, `[lin|dec|oct] src from to n …`, `src list v v … …`, `data=table` |
//! | `.step` | the same; a word `param` before the name is LTspice's |
//! | `.ac` | `lin|dec|oct n from to`, `list f f …`, `data=table` |
//! | `.tf` | `v(out) src` |
//! | `.pz` | `in+ in- out+ out- cur|vol pol|zer|pz` |

use super::{Cursor, Reader};
use crate::circuit::{Drive, Roots};
use crate::diagnostic::Diagnostic;
use crate::netlist::analysis::{Analysis, Data, Points, Print, Sweep};
use crate::netlist::dialects::Reading;
use crate::netlist::{CardKind, Expr, Leaf, Name, Names, Part};

/// `.dc`.
pub fn dc(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    Some(CardKind::Analysis(Box::new(Analysis::Dc(sweeps(reader, cursor)?))))
}

/// `.step`.
pub fn step(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    Some(CardKind::Step(sweeps(reader, cursor)?))
}

/// How the values of a sweep are spaced.
#[derive(Clone, Copy, PartialEq)]
enum Spacing {
    Linear,
    Decade,
    Octave,
    List,
}

fn spacing(word: &str) -> Option<Spacing> {
    match word.to_ascii_lowercase().as_str() {
        "lin" => Some(Spacing::Linear),
        "dec" => Some(Spacing::Decade),
        "oct" => Some(Spacing::Octave),
        "list" | "poi" => Some(Spacing::List),
        _ => None,
    }
}

/// The next word where it says how values are spaced, moving over it.
fn take_spacing(cursor: &mut Cursor) -> Option<Spacing> {
    let found = spacing(cursor.next_word())?;
    cursor.word();
    Some(found)
}

fn sweeps(reader: &mut Reader, cursor: &mut Cursor) -> Option<Vec<Sweep>> {
    let mut sweeps = vec![];
    while !cursor.is_done() {
        sweeps.push(sweep(reader, cursor)?);
    }
    if sweeps.is_empty() {
        reader.missing(cursor, "what is swept, `name from to by`");
        return None;
    }
    Some(sweeps)
}

fn sweep(reader: &mut Reader, cursor: &mut Cursor) -> Option<Sweep> {
    if let Some((name, span)) = table(reader, cursor)? {
        return Some(Sweep::Table { name, span });
    }
    let mut spaced = take_spacing(cursor);
    // LTspice says what kind of thing the name is.
    let mut ahead = *cursor;
    if ahead.word().0.eq_ignore_ascii_case("param") && !ahead.is_done() {
        *cursor = ahead;
    }
    let (word, from) = cursor.word();
    if word.is_empty() || starts_value(word) {
        cursor.at = from;
        reader.missing(cursor, "the name of what is swept");
        return None;
    }
    let mut text = word.to_string();
    let mut to = from + word.len();
    if cursor.peek() == Some(b'(') {
        // model(key), as LTspice writes it.
        cursor.take(b'(');
        let (key, at) = cursor.word();
        if key.is_empty() || !cursor.take(b')') {
            reader.missing(cursor, "the key of the model and `)`");
            return None;
        }
        text = format!("{word}:{key}");
        to = at + key.len() + 1;
    } else if !cursor.next_word().is_empty()
        && spacing(cursor.next_word()).is_none()
        && !starts_value(cursor.next_word())
        && bracket_follows(cursor)
    {
        // A type before `model(key)`: `.step npn 2n2222(vaf) …`.
        let (model, at) = cursor.word();
        cursor.take(b'(');
        let (key, place) = cursor.word();
        cursor.take(b')');
        text = format!("{model}:{key}");
        to = place + key.len().max(1) + usize::from(at > 0);
    }
    let span = cursor.span(reader, from, to.min(cursor.text.len()));
    let name = reader.names.intern(&text);
    if let Some(after) = take_spacing(cursor) {
        spaced = Some(after);
    }
    let points = points(reader, cursor, spaced.unwrap_or(Spacing::Linear))?;
    Some(Sweep::Quantity { name, points, span })
}

/// Whether a bracket follows the next word directly.
fn bracket_follows(cursor: &Cursor) -> bool {
    let mut ahead = *cursor;
    ahead.word();
    ahead.peek() == Some(b'(')
}

/// `data=name`, moving over it.
#[allow(clippy::option_option)]
fn table(reader: &mut Reader, cursor: &mut Cursor) -> Option<Option<(Name, crate::source::Span)>> {
    let mut ahead = *cursor;
    if !ahead.key().is_some_and(|(key, _)| key.eq_ignore_ascii_case("data")) {
        return Some(None);
    }
    let (word, from) = ahead.word();
    *cursor = ahead;
    if word.is_empty() {
        reader.missing(cursor, "the name of the `.data` card");
        return None;
    }
    let span = cursor.span(reader, from, from + word.len());
    Some(Some((reader.names.intern(word), span)))
}

/// Whether a word begins a value rather than a name.
fn starts_value(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-'))
}

/// Whether a value stands next: a number, or an expression in braces or quotes.
fn value_follows(cursor: &Cursor) -> bool {
    let mut ahead = *cursor;
    ahead.blanks();
    matches!(ahead.peek(), Some(b'{' | b'\'' | b'"')) || starts_value(ahead.next_word())
}

fn points(reader: &mut Reader, cursor: &mut Cursor, spacing: Spacing) -> Option<Points> {
    if spacing == Spacing::List {
        return Some(Points::List(list(reader, cursor)?));
    }
    let mut value = |what: &str| reader.value(cursor, what);
    let from = value("the first value")?;
    let to = value("the last value")?;
    Some(match spacing {
        Spacing::Decade => Points::Decade([from, to, value("the number of values a decade")?]),
        Spacing::Octave => Points::Octave([from, to, value("the number of values an octave")?]),
        _ => Points::Linear([from, to, value("the increment")?]),
    })
}

fn list(reader: &mut Reader, cursor: &mut Cursor) -> Option<Vec<Expr>> {
    let mut values = vec![];
    cursor.blanks();
    while value_follows(cursor) {
        values.push(reader.value(cursor, "a value")?);
        cursor.blanks();
    }
    if values.is_empty() {
        reader.missing(cursor, "the first value of the list");
        return None;
    }
    Some(values)
}

/// `.ac`.
pub fn ac(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    Some(CardKind::Analysis(Box::new(Analysis::Ac(frequencies(reader, cursor)?))))
}

/// `lin|dec|oct n from to`, `list …`, `data=…`.
pub fn frequencies(reader: &mut Reader, cursor: &mut Cursor) -> Option<Points> {
    if let Some((name, _)) = table(reader, cursor)? {
        return Some(Points::Table(name));
    }
    let here = cursor.here(reader);
    let Some(spacing) = take_spacing(cursor) else {
        let error = Diagnostic::error("E0703", here, "`lin`, `dec`, `oct` or `list` is missing")
            .help("`.ac dec 10 1 1meg`: ten frequencies a decade from 1 Hz to 1 MHz");
        reader.diagnostics.push(error);
        return None;
    };
    if spacing == Spacing::List {
        return Some(Points::List(list(reader, cursor)?));
    }
    let count = reader.value(cursor, "the number of frequencies")?;
    let from = reader.value(cursor, "the first frequency")?;
    let to = reader.value(cursor, "the last frequency")?;
    Some(match spacing {
        Spacing::Decade => Points::Decade([from, to, count]),
        Spacing::Octave => Points::Octave([from, to, count]),
        _ => Points::Count([from, to, count]),
    })
}

/// `.tf v(out) source`.
pub fn transfer(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let output = output(reader, cursor)?;
    let (word, _) = cursor.word();
    if word.is_empty() {
        reader.missing(cursor, "the source of `.tf v(out) source`");
        return None;
    }
    let source = reader.names.intern(word);
    Some(CardKind::Analysis(Box::new(Analysis::Transfer { output, source })))
}

/// The word after which `.pz` counts.
const PZ: &str = "`.pz in+ in- out+ out- cur|vol pol|zer|pz`";

/// `.pz in+ in- out+ out- cur|vol pol|zer|pz`.
pub fn pole_zero(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let mut node = |what: &str| reader.node(cursor, &format!("{what} of {PZ}"));
    let input = [node("the first node")?, node("the second node")?];
    let output = [node("the third node")?, node("the fourth node")?];
    let mut word = |known: &[&str]| {
        let found = known.iter().position(|word| word.eq_ignore_ascii_case(cursor.next_word()));
        match found {
            Some(_) => drop(cursor.word()),
            None => reader.missing(cursor, &format!("`{}` of {PZ}", known.join("` or `"))),
        }
        found
    };
    let drive = [Drive::Voltage, Drive::Current][word(&["vol", "cur"])?];
    let roots = [Roots::Poles, Roots::Zeros, Roots::Both][word(&["pol", "zer", "pz"])?];
    Some(CardKind::Analysis(Box::new(Analysis::PoleZero { input, output, drive, roots })))
}

/// One output: v(a), v(a, b), i(device).
fn output(reader: &mut Reader, cursor: &mut Cursor) -> Option<(String, Expr)> {
    cursor.blanks();
    let from = cursor.at;
    let to = super::cards::end_of_item(cursor);
    if to == from {
        reader.missing(cursor, "the output, `v(node)` or `i(device)`");
        return None;
    }
    cursor.at = to;
    super::cards::item(reader, cursor, from, to)
}

/// `.data name column … value …`.
pub fn data(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let (word, from) = cursor.word();
    if word.is_empty() {
        reader.missing(cursor, "the name of the table");
        return None;
    }
    let name = reader.names.intern(word);
    let span = cursor.span(reader, from, from + word.len());
    let (mut columns, mut values) = (vec![], vec![]);
    while !cursor.is_done() && !value_follows(cursor) {
        let (word, _) = cursor.word();
        if word.is_empty() {
            reader.leftover(cursor);
            return None;
        }
        columns.push(reader.names.intern(word));
    }
    while value_follows(cursor) {
        values.push(reader.value(cursor, "a value")?);
        cursor.blanks();
    }
    if columns.is_empty() || values.is_empty() || values.len() % columns.len() != 0 {
        let message =
            format!("the table `{word}` has {} columns and {} values", columns.len(), values.len());
        let help = "`.data name p q`, then a value of each column for every row on `+` lines, then `.enddata`";
        reader.diagnostics.push(Diagnostic::error("E0783", span, message).help(help));
        return None;
    }
    Some(CardKind::Data(Data { name, columns, values }))
}

/// Which analysis a `.print` is of.
pub fn print(word: &str) -> Option<Print> {
    Some(match word.to_ascii_lowercase().as_str() {
        "tran" => Print::Transient,
        "dc" => Print::Dc,
        "ac" => Print::Ac,
        "op" => Print::OperatingPoint,
        "tf" => Print::Transfer,
        "pz" => Print::PoleZero,
        "sens" => Print::Sensitivity,
        _ => return None,
    })
}

/// Parts of a phasor by the letters after `v` and `i`.
pub fn part(name: &str) -> Option<(char, &str)> {
    let mut letters = name.chars();
    let kind = letters.next()?.to_ascii_lowercase();
    let rest = letters.as_str();
    let known = ["r", "i", "m", "p", "db"].iter().any(|part| rest.eq_ignore_ascii_case(part));
    (matches!(kind, 'v' | 'i') && known).then_some((kind, rest))
}

/// The part of a phasor that letters or a function mean.
fn phasor_part(text: &str, degrees: bool) -> Option<Part> {
    Some(match text.to_ascii_lowercase().as_str() {
        "r" | "re" | "real" => Part::Real,
        "i" | "im" | "img" | "imag" => Part::Imaginary,
        "m" | "mag" => Part::Magnitude,
        "p" | "ph" | "phase" if degrees => Part::Degrees,
        "p" | "ph" | "phase" => Part::Phase,
        "db" => Part::Decibel,
        _ => return None,
    })
}

/// What outputs read beside v() and i(): parts of phasors (`vdb(out)`, `im(v1)`, `db(v(out))`), powers (`p(r1)`), and
/// Xyce's `n(node)`.
pub fn reading(names: &mut Names, how: &Reading, text: &str) -> Option<Leaf> {
    let (name, rest) = text.split_once('(')?;
    let inner = rest.strip_suffix(')')?;
    let plain =
        |text: &str| !text.is_empty() && !text.contains(['(', ')', '{', '*', '/', ' ', '\'']);
    let words: Vec<&str> = inner.split(',').map(str::trim).collect();
    let node = |names: &mut Names, word: &str| super::cursor::node_name(names, how.grounds, word);
    let voltage = |names: &mut Names, words: &[&str]| match words {
        [a] if plain(a) => Some(Leaf::Voltage(node(names, a), None)),
        [a, b] if plain(a) && plain(b) => {
            let minus = node(names, b);
            Some(Leaf::Voltage(node(names, a), Some(minus)))
        }
        _ => None,
    };
    if let Some((kind, part)) = part(name) {
        let leaf = match (kind, &words[..]) {
            ('v', words) => voltage(names, words),
            (_, [device]) if plain(device) => Some(Leaf::Current(names.intern(device))),
            _ => None,
        };
        // `im(v(a))` is the imaginary part of v(a), `im(v1)` the magnitude of a current.
        if let Some(leaf) = leaf {
            return Some(Leaf::Part(phasor_part(part, how.degrees)?, Box::new(leaf)));
        }
    }
    match (name.to_ascii_lowercase().as_str(), &words[..]) {
        ("p" | "w", [device]) if plain(device) => Some(Leaf::Power(names.intern(device))),
        // An inner variable of a device, else a node.
        ("n", [own]) if own.to_ascii_lowercase().ends_with(":cd") && plain(own) => {
            Some(Leaf::Parameter(names.intern(own)))
        }
        ("n", [_]) => voltage(names, &words),
        _ => {
            let part = phasor_part(name, how.degrees).filter(|_| name.len() > 1)?;
            let (of, rest) = inner.split_once('(')?;
            let words: Vec<&str> = rest.strip_suffix(')')?.split(',').map(str::trim).collect();
            let leaf = match (of.trim().to_ascii_lowercase().as_str(), &words[..]) {
                ("v", words) => voltage(names, words)?,
                ("i", [device]) if plain(device) => Leaf::Current(names.intern(device)),
                _ => return None,
            };
            Some(Leaf::Part(part, Box::new(leaf)))
        }
    }
}
