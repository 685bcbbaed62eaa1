//! Traces as CSV (RFC 4180): a header, one row a point, the shortest numbers that read back the same.

use super::formats::{Failed, Heading, bad, worse};
use super::{Sink, Trace};
use std::io::{self, BufWriter, Write};

/// Writes rows as they come.
pub struct Rows<W: Write> {
    writer: BufWriter<W>,
    /// A row. Numbers need no quotes.
    line: String,
}

impl<W: Write> Rows<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn new(
        mut to: W,
        heading: &Heading,
        names: &[String],
        units: &[String],
    ) -> io::Result<Self> {
        let heads = names.iter().enumerate().map(|(at, name)| match units.get(at) {
            Some(unit) if heading.units && !unit.is_empty() => format!("{name} [{unit}]"),
            _ => name.clone(),
        });
        let line: Vec<String> = heads.map(|head| quoted(&head)).collect();
        writeln!(to, "{}", line.join(","))?;
        Ok(Rows { writer: BufWriter::with_capacity(1 << 16, to), line: String::new() })
    }

    /// Writes what is still held back and gives the writer back.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn finish(self) -> io::Result<W> {
        self.writer.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

impl<W: Write> Sink for Rows<W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        self.line.clear();
        for (at, value) in values.iter().enumerate() {
            if at > 0 {
                self.line.push(',');
            }
            number(*value, &mut self.line);
        }
        self.line.push('\n');
        self.writer.write_all(self.line.as_bytes())
    }
}

/// A name as it stands in a header: in quotes where it holds anything that may separate names, or nothing.
pub(crate) fn quoted(name: &str) -> String {
    match name.is_empty() || name.contains([',', ';', '\t', '"', '\r', '\n']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_string(),
    }
}

/// What separates the names of a header: a comma, semicolon or tab that stands outside of quotes.
fn separator(text: &[u8]) -> u8 {
    let (mut quoted, mut found) = (false, [false; 3]);
    for byte in text {
        match byte {
            b'"' => quoted = !quoted,
            b'\n' if !quoted => break,
            _ if quoted => {}
            b',' => found[0] = true,
            b';' => found[1] = true,
            b'\t' => found[2] = true,
            _ => {}
        }
    }
    match found {
        [false, true, _] => b';',
        [false, false, true] => b'\t',
        _ => b',',
    }
}

/// Appends the shortest decimal number that reads back as the same value; zero has no sign, whole numbers no point.
pub fn number(value: f64, text: &mut String) {
    let size = value.abs();
    if value == 0.0 {
        text.push('0');
    } else if !size.is_finite() {
        text.push_str(&value.to_string());
    } else if size >= 1e16 {
        text.push_str(&format!("{value:e}"));
    } else {
        let mut digits = zmij::Buffer::new();
        let digits = digits.format_finite(value);
        text.push_str(digits.strip_suffix(".0").unwrap_or(digits));
    }
}

/// Writes a whole trace.
pub fn write(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let mut rows = Rows::new(to, heading, &trace.names, &trace.units)?;
    let mut row = vec![0.0; trace.columns.len()];
    for at in 0..trace.rows() {
        for (value, column) in row.iter_mut().zip(&trace.columns) {
            *value = column[at];
        }
        rows.row(&row)?;
    }
    rows.finish()?.flush()
}

/// Reads a trace; commas, semicolons or tabs separate, whichever the header holds.
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut reader = ::csv::ReaderBuilder::new()
        .delimiter(separator(bytes))
        .has_headers(false)
        .flexible(true)
        .trim(::csv::Trim::All)
        .from_reader(bytes);
    let mut record = ::csv::StringRecord::new();
    let mut next = |record: &mut ::csv::StringRecord| {
        reader.read_record(record).map_err(|error| match error.position() {
            Some(place) => worse("E0921", "the table is no text", at(place.line())),
            None => bad("E0921", format!("the table cannot be read: {error}")),
        })
    };
    if !next(&mut record)? {
        return Err(bad("E0924", "the trace has no rows"));
    }
    let (names, units) = record.iter().map(split_unit).unzip();
    let mut trace = Trace::new(names, units);
    let width = trace.names.len();
    while next(&mut record)? {
        let line = record.position().map_or(0, ::csv::Position::line);
        if record.len() != width {
            let message = format!("a row has {} fields, the header {width}", record.len());
            return Err(worse("E0921", message, at(line)));
        }
        for (field, (column, name)) in record.iter().zip(trace.columns.iter_mut().zip(&trace.names))
        {
            let value: f64 = field.parse().map_err(|_| {
                let place = format!("{}, column `{name}`", at(line));
                worse("E0921", format!("`{field}` is no number"), place)
            })?;
            column.push(value);
        }
    }
    Ok(trace)
}

fn at(line: u64) -> String {
    format!("at line {line}")
}

/// `name [unit]` into its parts.
fn split_unit(head: &str) -> (String, String) {
    let parts = head.strip_suffix(']').and_then(|rest| rest.rsplit_once(" ["));
    match parts {
        Some((name, unit)) => (name.to_string(), unit.to_string()),
        None => (head.to_string(), String::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_it_looks() {
        let trace = super::super::formats::tests::awkward();
        let mut bytes = vec![];
        let heading = Heading { units: true, ..Heading::default() };
        write(&trace, &heading, &mut bytes).unwrap();
        insta::assert_snapshot!(String::from_utf8(bytes).unwrap());
    }

    #[test]
    fn numbers_are_the_shortest() {
        use crate::quantity::random::fraction;
        let mut values =
            vec![0.0, -0.0, 1.0, -1.0, 1e-5, 9.999999999999999e-6, 1e16, 9.999999999999998e15];
        values.extend([
            f64::MAX,
            f64::MIN_POSITIVE,
            5e-324,
            f64::INFINITY,
            f64::NAN,
            123456.0,
            1e15,
        ]);
        values.extend(
            (0..20_000u64).map(|k| f64::from_bits((fraction(7, k) * 2f64.powi(64)) as u64)),
        );
        values.extend((0..20_000u64).map(|k| fraction(9, k) - 0.5));
        for value in values {
            let mut text = String::new();
            number(value, &mut text);
            if value.is_nan() {
                assert_eq!(text, "NaN");
                continue;
            }
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), (value + 0.0).to_bits());
            // As long as the standard library's shortest; of two equally near ones it may take the other.
            let plain = value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs());
            let other = if plain { format!("{}", value + 0.0) } else { format!("{value:e}") };
            assert_eq!((text.len(), text.contains('e')), (other.len(), other.contains('e')));
        }
    }

    #[test]
    fn semicolons_and_tabs_are_read_too() {
        for text in ["time;x\n0;1.5\n", "time\tx\n0\t1.5\n", "time, x\r\n0, 1.5\r\n"] {
            let trace = read(text.as_bytes()).unwrap();
            assert_eq!(trace.column("x"), Some(&[1.5][..]), "{text}");
        }
    }
}
