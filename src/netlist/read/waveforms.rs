//! The waveform functions of sources: their names, and the names of their arguments.

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::netlist::{Expr, Shape, Source, Waveform};

/// One row of the table.
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// Which it is.
    pub shape: Shape,
    /// The names of its arguments in their order; the first `least` must be there.
    pub arguments: &'static [&'static str],
    /// The fewest arguments.
    pub least: usize,
}

/// Every waveform function, one row each. PWL takes pairs of any number.
#[rustfmt::skip]
pub const WAVEFORMS: &[Row] = &[
    Row { name: "pulse", shape: Shape::Pulse, least: 2, arguments: &["v1", "v2", "td", "tr", "tf", "pw", "per"] },
    Row { name: "sin", shape: Shape::Sin, least: 2, arguments: &["vo", "va", "freq", "td", "theta", "phase"] },
    Row { name: "pwl", shape: Shape::Pwl, least: 2, arguments: &["t", "y"] },
    Row { name: "exp", shape: Shape::Exp, least: 2, arguments: &["v1", "v2", "td1", "tau1", "td2", "tau2"] },
    Row { name: "sffm", shape: Shape::Sffm, least: 2, arguments: &["vo", "va", "fc", "mdi", "fs"] },
    Row { name: "am", shape: Shape::Am, least: 2, arguments: &["va", "vo", "mf", "fc", "td"] },
];

/// The row of a waveform.
pub fn row(shape: Shape) -> &'static Row {
    match shape {
        Shape::Pulse => &WAVEFORMS[0],
        Shape::Sin => &WAVEFORMS[1],
        Shape::Pwl => &WAVEFORMS[2],
        Shape::Exp => &WAVEFORMS[3],
        Shape::Sffm => &WAVEFORMS[4],
        Shape::Am => &WAVEFORMS[5],
    }
}

/// `[DC] value`, `AC magnitude phase`, `PULSE( … )` and so on to the end of the line, in any order. Without any of them the
/// value is 0; without a function of time it is the DC value.
pub fn source(reader: &mut Reader, cursor: &mut Cursor) -> Option<Source> {
    let (mut dc, mut ac, mut function) = (None, None, None);
    while !cursor.is_done() {
        let word = cursor.next_word();
        if word.eq_ignore_ascii_case("dc") {
            cursor.word();
            cursor.take(b'=');
            dc = Some(reader.value(cursor, "the value")?);
        } else if word.eq_ignore_ascii_case("ac") {
            cursor.word();
            cursor.take(b'=');
            ac = Some(phasor(reader, cursor)?);
        } else if is_idle(word) {
            cursor.word();
            cursor.take(b'=');
            phasor(reader, cursor)?;
        } else if word.eq_ignore_ascii_case(PATTERN) {
            function = Some(pattern(reader, cursor)?);
        } else if let Some(row) = find(word) {
            function = Some(waveform(reader, cursor, row)?);
        } else if dc.is_none() && function.is_none() {
            dc = Some(reader.value(cursor, "the value")?);
        } else {
            reader.leftover(cursor);
            return None;
        }
    }
    Some(match function {
        Some(waveform) => Source { waveform, dc, ac },
        None => {
            Source { waveform: Waveform::Constant(dc.unwrap_or(Expr::number(0.0))), dc: None, ac }
        }
    })
}

/// Magnitude and phase in degrees, as far as they are written: 1 and 0 else.
fn phasor(reader: &mut Reader, cursor: &mut Cursor) -> Option<[Expr; 2]> {
    let mut parts = [Expr::number(1.0), Expr::number(0.0)];
    for (part, what) in parts.iter_mut().zip(["the magnitude", "the phase"]) {
        let word = cursor.next_word();
        if cursor.is_done() || is_keyword(word) || cursor.clone().key().is_some() {
            break;
        }
        *part = reader.value(cursor, what)?;
    }
    Some(parts)
}

/// What a pattern of bits is called; its arguments.
const PATTERN: &str = "pat";
const PATTERN_ARGUMENTS: &str = "PAT(vhi vlo td tr tf tsample b0101) [R=times]";

/// The row of a name.
fn find(word: &str) -> Option<&'static Row> {
    let word = if word.eq_ignore_ascii_case("sine") { "sin" } else { word };
    WAVEFORMS.iter().find(|row| row.name.eq_ignore_ascii_case(word))
}

/// Phasors of analyses that there are none of here: of distortion.
const IDLE: &[&str] = &["distof1", "distof2"];

fn is_idle(word: &str) -> bool {
    IDLE.iter().any(|key| key.eq_ignore_ascii_case(word))
}

/// Whether a word of a source's card means more than a value.
fn is_keyword(word: &str) -> bool {
    let own = ["dc", "ac", PATTERN].iter().any(|key| key.eq_ignore_ascii_case(word));
    own || is_idle(word) || find(word).is_some()
}

/// Arguments, with or without brackets, and what has a key among or behind them.
struct Arguments {
    from: usize,
    values: Vec<Expr>,
    bits: Option<String>,
    keyed: Vec<(String, Expr)>,
}

fn arguments(reader: &mut Reader, cursor: &mut Cursor, keys: &[&str]) -> Option<Arguments> {
    let word = cursor.word();
    behind(reader, cursor, word, keys)
}

/// The same behind the name.
fn behind(
    reader: &mut Reader,
    cursor: &mut Cursor,
    (name, from): (&str, usize),
    keys: &[&str],
) -> Option<Arguments> {
    let mut found = Arguments { from, values: vec![], bits: None, keyed: vec![] };
    let (mut depth, mut closed) = (0, false);
    loop {
        cursor.blanks();
        let mut ahead = *cursor;
        let key = ahead.key().map(|(word, _)| word.to_ascii_lowercase());
        match cursor.peek() {
            // A bracket that closes stands before what is behind it.
            Some(byte)
                if !matches!(byte, b'(' | b')')
                    && key.as_deref().is_some_and(|key| keys.contains(&key)) =>
            {
                *cursor = ahead;
                let value = reader.value(cursor, "the value of the parameter")?;
                found.keyed.extend(key.map(|key| (key, value)));
            }
            Some(b'(') if !closed => {
                depth += 1;
                cursor.at += 1;
            }
            Some(b')') if depth > 0 => {
                depth -= 1;
                cursor.at += 1;
                closed = depth == 0;
            }
            None if depth > 0 => {
                let span = cursor.span(reader, from, from + name.len());
                let error =
                    Diagnostic::error("E0704", span, "the bracket of the waveform is not closed");
                reader.diagnostics.push(error);
                return None;
            }
            None => break,
            _ if closed || (depth == 0 && (key.is_some() || is_keyword(cursor.next_word()))) => {
                break;
            }
            _ => {
                let word = cursor.next_word();
                let bits = word.strip_prefix(['b', 'B']).filter(|bits| {
                    !bits.is_empty() && bits.bytes().all(|byte| matches!(byte, b'0' | b'1'))
                });
                match bits.filter(|_| name.eq_ignore_ascii_case(PATTERN)) {
                    Some(bits) => {
                        cursor.word();
                        found.bits = Some(bits.to_string());
                    }
                    None => found.values.push(reader.value(cursor, "a number")?),
                }
            }
        }
    }
    Some(found)
}

impl Arguments {
    fn take(&mut self, key: &str) -> Option<Expr> {
        let k = self.keyed.iter().position(|(own, _)| own == key)?;
        Some(self.keyed.swap_remove(k).1)
    }
}

/// The points of `PWL FILE name`, if the card names a file.
fn file(reader: &mut Reader, cursor: &mut Cursor) -> Option<Option<Vec<Expr>>> {
    let mut ahead = *cursor;
    ahead.word();
    ahead.loose();
    if !ahead.next_word().eq_ignore_ascii_case("file") {
        return None;
    }
    let (_, at) = ahead.word();
    let here = Cursor { at, ..*cursor };
    ahead.blanks();
    let quote = ahead.peek().filter(|byte| matches!(byte, b'"' | b'\''));
    let from = ahead.at + usize::from(quote.is_some());
    let rest = &ahead.text[from..];
    let length = match quote {
        Some(quote) => rest.bytes().position(|byte| byte == quote).unwrap_or(rest.len()),
        None => rest.find([' ', '\t', ')']).unwrap_or(rest.len()),
    };
    let name = rest[..length].to_string();
    let span = ahead.span(reader, from, from + length.max(1));
    let end = (from + length + usize::from(quote.is_some())).min(cursor.text.len());
    *cursor = Cursor { at: end, ..here };
    cursor.take(b')');
    if name.is_empty() {
        reader.missing(&here, "the name of the file");
        return Some(None);
    }
    let numbers = reader.numbers_of(&name, span);
    Some(numbers.map(|numbers| {
        numbers.into_iter().map(|value| Expr::new(Node::Number(value), span)).collect()
    }))
}

fn waveform(reader: &mut Reader, cursor: &mut Cursor, row: &Row) -> Option<Waveform> {
    let lines = row.shape == Shape::Pwl;
    let keys: &[&str] = if lines { &["r", "td"] } else { &[] };
    let start = cursor.at;
    let mut found = match lines.then(|| file(reader, cursor)).flatten() {
        Some(points) => {
            let mut found = behind(reader, cursor, (row.name, start), keys)?;
            found.values = points?;
            found
        }
        None => arguments(reader, cursor, keys)?,
    };
    let count = found.values.len();
    let most = if lines { usize::MAX } else { row.arguments.len() };
    if (lines && count % 2 == 1) || count < row.least || count > most {
        let span = cursor.span(reader, found.from, cursor.at.min(cursor.text.len()));
        let name = row.name.to_uppercase();
        let message = if lines {
            "PWL takes pairs of a time and a value".to_string()
        } else {
            format!("{name} takes {} to {} numbers", row.least, row.arguments.len())
        };
        let error = Diagnostic::error("E0707", span, message)
            .says(format!("{count} given"))
            .help(format!("{name}({})", row.arguments.join(" ")));
        reader.diagnostics.push(error);
        return None;
    }
    let (repeat, delay) = (found.take("r"), found.take("td"));
    if repeat.is_some() || delay.is_some() {
        return Some(Waveform::Points { points: found.values, repeat, delay });
    }
    Some(Waveform::Function { shape: row.shape, arguments: found.values })
}

fn pattern(reader: &mut Reader, cursor: &mut Cursor) -> Option<Waveform> {
    let mut found = arguments(reader, cursor, &["r"])?;
    let repeat = found.take("r");
    match (found.bits, found.values.len()) {
        (Some(bits), 6) => Some(Waveform::Pattern { arguments: found.values, bits, repeat }),
        (bits, count) => {
            let span = cursor.span(reader, found.from, cursor.at.min(cursor.text.len()));
            let message = match bits {
                Some(_) => "PAT takes 6 numbers before its bits",
                None => "PAT takes bits: a `b` with noughts and ones behind it",
            };
            let error = Diagnostic::error("E0772", span, message).says(format!("{count} given"));
            reader.diagnostics.push(error.help(PATTERN_ARGUMENTS));
            None
        }
    }
}
