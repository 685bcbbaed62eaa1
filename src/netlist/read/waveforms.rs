//! The waveform functions of sources: their names, and the names of their arguments.

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
use crate::netlist::{Expr, Shape, Waveform};

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
];

/// The row of a waveform.
pub fn row(shape: Shape) -> &'static Row {
    match shape {
        Shape::Pulse => &WAVEFORMS[0],
        Shape::Sin => &WAVEFORMS[1],
        Shape::Pwl => &WAVEFORMS[2],
        Shape::Exp => &WAVEFORMS[3],
        Shape::Sffm => &WAVEFORMS[4],
    }
}

/// `[DC] value`, `AC …`, `PULSE( … )` and so on to the end of the line. Without any of them the value is 0.
pub fn source(reader: &mut Reader, cursor: &mut Cursor) -> Option<Waveform> {
    let (mut constant, mut function) = (None, None);
    while !cursor.is_done() {
        let word = cursor.next_word();
        if word.eq_ignore_ascii_case("dc") {
            cursor.word();
            cursor.take(b'=');
            constant = Some(reader.value(cursor, "the value")?);
        } else if word.eq_ignore_ascii_case("ac") {
            // Magnitude and phase count in AC analysis alone.
            cursor.word();
            cursor.take(b'=');
            for _ in 0..2 {
                let starts = cursor
                    .next_word()
                    .starts_with(|c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+'));
                if starts || matches!(cursor.peek(), Some(b'{' | b'\'')) {
                    reader.value(cursor, "the magnitude")?;
                }
            }
        } else if let Some(row) = WAVEFORMS.iter().find(|row| row.name.eq_ignore_ascii_case(word)) {
            function = Some(arguments(reader, cursor, row)?);
        } else if constant.is_none() && function.is_none() {
            constant = Some(reader.value(cursor, "the value")?);
        } else {
            reader.leftover(cursor);
            return None;
        }
    }
    match (function, constant) {
        (Some(function), _) => Some(function),
        (None, Some(value)) => Some(Waveform::Constant(value)),
        (None, None) => Some(Waveform::Constant(Expr::number(0.0))),
    }
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
