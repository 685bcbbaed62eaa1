//! Writing RAW files as LTspice does: a header in UTF-16, little-endian, and points of doubles (flag `double`); the runs
//! of a stepped trace stand in one plot, one below the other.

use super::layout::{Layout, title};
use crate::trace::formats::Heading;
use crate::trace::{Sink, Trace, send};
use std::io::{self, Write};

/// Writes a whole trace.
///
/// # Errors
/// What writing failed with.
pub fn write(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let mut to = io::BufWriter::with_capacity(1 << 16, to);
    let layout = Layout::new(&trace.names, &trace.units);
    let mut flags = layout.flags().to_string();
    flags += if layout.complex { " forward" } else { " forward double" };
    flags += if layout.stepped { " stepped" } else { "" };
    let mut text = format!(
        "Title: * {}\nDate: Thu Jan  1 00:00:00 1970\nPlotname: {}\nFlags: {flags}\nNo. Variables: {}\n\
         No. Points: {:12}\nOffset: {:e}\nCommand: bondspice 0.1 (LTspice format)\nVariables:\n",
        title(heading),
        layout.plot,
        layout.variables.len(),
        trace.rows(),
        0.0,
    );
    for (at, variable) in layout.variables.iter().enumerate() {
        let kind = if variable.kind == "current" { "device_current" } else { variable.kind };
        text += &format!("\t{at}\t{}\t{kind}\n", spelled(&variable.name));
    }
    text += "Binary:\n";
    for unit in text.encode_utf16() {
        to.write_all(&unit.to_le_bytes())?;
    }
    send(trace, &mut Points { to: &mut to, layout: &layout })?;
    to.flush()
}

/// `v(a)` and `i(l1)` begin with capitals there.
fn spelled(name: &str) -> String {
    match (name.get(..2), name.get(2..)) {
        (Some("v("), Some(rest)) => format!("V({rest}"),
        (Some("i("), Some(rest)) => format!("I({rest}"),
        _ => name.to_string(),
    }
}

struct Points<'a, W: Write> {
    to: &'a mut W,
    layout: &'a Layout,
}

impl<W: Write> Sink for Points<'_, W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        for (real, imaginary) in self.layout.values(values) {
            self.to.write_all(&real.to_le_bytes())?;
            if self.layout.complex {
                self.to.write_all(&imaginary.to_le_bytes())?;
            }
        }
        Ok(())
    }
}
