//! Traces as JSON: `{"schema": 1, "names": […], "units": […], "columns": [[…], …]}`.

use super::Trace;
use super::formats::{Failed, Heading, bad, worse};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};

#[derive(Serialize)]
struct Out<'a> {
    schema: u32,
    names: &'a [String],
    units: &'a [String],
    columns: &'a [Vec<f64>],
}

#[derive(Deserialize)]
struct In {
    names: Vec<String>,
    #[serde(default)]
    units: Vec<String>,
    columns: Vec<Vec<Number>>,
}

/// A number; `null` is none.
struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Number, D::Error> {
        Ok(Number(Option::deserialize(from)?.unwrap_or(f64::NAN)))
    }
}

/// Writes a whole trace. JSON has no NaN and no infinity: they become `null`.
pub fn write(trace: &Trace, _: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let Trace { names, units, columns } = trace;
    serde_json::to_writer(&mut *to, &Out { schema: 1, names, units, columns })?;
    to.write_all(b"\n")?;
    to.flush()
}

/// Reads a trace; `null` is NaN.
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    let trace: In = serde_json::from_slice(bytes)
        .map_err(|error| worse("E0923", "not the JSON of a trace", error.to_string()))?;
    let In { names, mut units, columns } = trace;
    let rows = columns.first().map_or(0, Vec::len);
    if columns.len() != names.len() || columns.iter().any(|column| column.len() != rows) {
        return Err(bad("E0923", "names and columns differ in number, or columns in length"));
    }
    units.resize(names.len(), String::new());
    let number = |Number(value)| value;
    let columns = columns.into_iter().map(|c| c.into_iter().map(number).collect()).collect();
    Ok(Trace { names, units, columns })
}

/// Whether a file begins as a JSON object does; the head of a table may begin with `{v(a)*2}`.
pub fn recognises(bytes: &[u8]) -> bool {
    let mut solid = bytes.iter().filter(|byte| !byte.is_ascii_whitespace());
    solid.next() == Some(&b'{') && matches!(solid.next(), Some(b'"' | b'}') | None)
}
