//! The numbers of a plot in a RAW file.

use super::header::{Header, utf16};
use crate::trace::Trace;
use crate::trace::formats::{Failed, bad, worse};
use std::borrow::Cow;

/// The points of a plot, and what follows them in the file.
pub(super) fn read<'a>(header: &Header, data: &'a [u8]) -> Result<(Trace, &'a [u8]), Failed> {
    let trace = columns(header);
    if header.binary { read_binary(header, trace, data) } else { read_ascii(header, trace, data) }
}

/// A trace without rows, with the columns of a plot.
fn columns(header: &Header) -> Trace {
    let Header { names, units, .. } = header;
    if !header.complex {
        return Trace::new(names.clone(), units.clone());
    }
    let mut trace = Trace::default();
    for (at, (name, unit)) in names.iter().zip(units).enumerate() {
        // The scale of an AC analysis is real.
        let parts: &[&str] = if at == 0 { &[""] } else { &[".re", ".im"] };
        for part in parts {
            trace.names.push(format!("{name}{part}"));
            trace.units.push(unit.clone());
        }
    }
    trace.columns = vec![vec![]; trace.names.len()];
    trace
}

/// How many bytes a number of each variable has.
struct Widths {
    first: usize,
    other: usize,
}

impl Widths {
    fn of(header: &Header, bytes: usize) -> Widths {
        if header.complex {
            return Widths { first: 16, other: 16 };
        }
        let count = header.names.len();
        let short = 8 + 4 * (count - 1);
        // The operating point of LTspice is of doubles without a flag that says so.
        let all = header.points.checked_mul(8 * count) == Some(bytes);
        let doubles = header.double
            || !header.ltspice
            || (all && header.points.checked_mul(short) != Some(bytes));
        Widths { first: 8, other: if doubles { 8 } else { 4 } }
    }
}

fn read_binary<'a>(
    header: &Header,
    mut trace: Trace,
    data: &'a [u8],
) -> Result<(Trace, &'a [u8]), Failed> {
    let widths = Widths::of(header, data.len());
    let count = header.names.len();
    let row = widths.first + widths.other * (count - 1);
    // A run that was killed leaves the number of points at 0: then all that is there is taken.
    let points = if header.points == 0 { data.len() / row } else { header.points };
    let size = row.checked_mul(points).filter(|size| *size <= data.len()).ok_or_else(|| {
        let there = data.len() / row;
        let note = format!("{points} points of {row} bytes are announced, {there} are there");
        worse("E0922", "the RAW file ends too early", note)
    })?;
    let (numbers, rest) = data.split_at(size);
    let mut at = 0;
    for variable in 0..count {
        let width = if variable == 0 { widths.first } else { widths.other };
        // Where a variable's numbers begin, and how far they are apart.
        let (start, stride) = if header.fastaccess { (at * points, width) } else { (at, row) };
        let number = |point: usize, offset: usize| {
            let from = start + point * stride + offset;
            numbers.get(from..).map_or(f64::NAN, |bytes| float(bytes, width == 4))
        };
        let column = match (header.complex, variable) {
            (true, 1..) => 2 * variable - 1,
            _ => variable,
        };
        let whole = (0..points).map(|point| number(point, 0));
        trace.columns[column] = match (variable, header.ltspice && !header.complex) {
            // LTspice marks points that were compressed by the sign of their time.
            (0, true) if trace.names[0].eq_ignore_ascii_case("time") => {
                whole.map(f64::abs).collect()
            }
            _ => whole.collect(),
        };
        if header.complex && variable > 0 {
            trace.columns[column + 1] = (0..points).map(|point| number(point, 8)).collect();
        }
        at += width;
    }
    Ok((trace, rest))
}

/// The number that bytes begin with; a short one has 32 bits.
fn float(bytes: &[u8], short: bool) -> f64 {
    if short {
        bytes.first_chunk().map_or(f64::NAN, |four| f64::from(f32::from_le_bytes(*four)))
    } else {
        bytes.first_chunk().map_or(f64::NAN, |eight| f64::from_le_bytes(*eight))
    }
}

fn read_ascii<'a>(
    header: &Header,
    mut trace: Trace,
    data: &'a [u8],
) -> Result<(Trace, &'a [u8]), Failed> {
    let end = if header.wide {
        data.len()
    } else {
        data.windows(7).position(|w| w == b"\nTitle:").map_or(data.len(), |at| at + 1)
    };
    let text = match header.wide {
        true => Cow::Owned(utf16(&data[..end])),
        false => String::from_utf8_lossy(&data[..end]),
    };
    let mut words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
    let mut row = 0;
    while row < header.points || header.points == 0 {
        match words.next().map(str::parse::<usize>) {
            None if header.points == 0 => break,
            Some(Ok(index)) if index == row => {}
            _ => return Err(bad("E0922", format!("the RAW file has no row {row}"))),
        }
        push_row(&mut trace, header, || words.next()?.parse().ok())
            .ok_or_else(|| bad("E0922", format!("row {row} of the RAW file lacks a number")))?;
        row += 1;
    }
    Ok((trace, &data[end..]))
}

/// Takes values of one row, its imaginary parts included, into the columns.
fn push_row(
    trace: &mut Trace,
    header: &Header,
    mut value: impl FnMut() -> Option<f64>,
) -> Option<()> {
    let mut columns = trace.columns.iter_mut();
    for at in 0..header.names.len() {
        columns.next()?.push(value()?);
        if header.complex {
            let imaginary = value()?;
            if at > 0 {
                columns.next()?.push(imaginary);
            }
        }
    }
    Some(())
}
