//! The waveform functions of sources: their names, and the names of their arguments.

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
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
        } else if let Some(row) = WAVEFORMS.iter().find(|row| row.name.eq_ignore_ascii_case(word)) {
            function = Some(arguments(reader, cursor, row)?);
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
        let keyword = ["dc", "ac"].iter().any(|key| key.eq_ignore_ascii_case(word))
            || WAVEFORMS.iter().any(|row| row.name.eq_ignore_ascii_case(word));
        if cursor.is_done() || keyword || cursor.clone().key().is_some() {
            break;
        }
        *part = reader.value(cursor, what)?;
    }
    Some(parts)
}

fn arguments(reader: &mut Reader, cursor: &mut Cursor, row: &Row) -> Option<Waveform> {
    let (_, from) = cursor.word();
    let (mut arguments, mut depth) = (vec![], 0);
    loop {
        cursor.blanks();
        match cursor.peek() {
            Some(b'(') => {
                depth += 1;
                cursor.at += 1;
            }
            Some(b')') if depth > 0 => {
                depth -= 1;
                cursor.at += 1;
                if depth == 0 {
                    break;
                }
            }
            None if depth > 0 => {
                let span = cursor.span(reader, from, from + row.name.len());
                let error =
                    Diagnostic::error("E0704", span, "the bracket of the waveform is not closed");
                reader.diagnostics.push(error);
                return None;
            }
            None => break,
            // `r=` and `td=` of PWL come after its arguments.
            _ if depth == 0 && cursor.clone().key().is_some() => break,
            _ => arguments.push(reader.value(cursor, "a number")?),
        }
    }
    let most = if row.shape == Shape::Pwl { usize::MAX } else { row.arguments.len() };
    let odd = row.shape == Shape::Pwl && arguments.len() % 2 == 1;
    if odd || arguments.len() < row.least || arguments.len() > most {
        let span = cursor.span(reader, from, cursor.at.min(cursor.text.len()));
        let name = row.name.to_uppercase();
        let message = if row.shape == Shape::Pwl {
            "PWL takes pairs of a time and a value".to_string()
        } else {
            format!("{name} takes {} to {} numbers", row.least, row.arguments.len())
        };
        let error = Diagnostic::error("E0707", span, message)
            .says(format!("{} given", arguments.len()))
            .help(format!("{name}({})", row.arguments.join(" ")));
        reader.diagnostics.push(error);
        return None;
    }
    Some(Waveform::Function { shape: row.shape, arguments })
}
