//! Writing RAW files as ngspice does, binary or ASCII; each run of a stepped trace is a plot of its own, one below the
//! other, as `set appendwrite` leaves them.

use super::layout::{Layout, title};
use crate::trace::formats::Heading;
use crate::trace::{Sink, Trace, send};
use std::io::{self, Seek, SeekFrom, Write};

/// Writes rows as they come, and their number when they have all come.
pub struct Rows<W: Write + Seek> {
    to: io::BufWriter<W>,
    heading: Heading,
    layout: Layout,
    /// The step whose plot is being written.
    step: Option<f64>,
    points_at: u64,
    points: u64,
}

impl<W: Write + Seek> Rows<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn new(to: W, heading: &Heading, names: &[String], units: &[String]) -> io::Result<Self> {
        let to = io::BufWriter::with_capacity(1 << 16, to);
        let layout = Layout::new(names, units);
        let mut rows =
            Rows { to, heading: heading.clone(), layout, step: None, points_at: 0, points: 0 };
        if !rows.layout.stepped {
            rows.begin()?;
        }
        Ok(rows)
    }

    /// The header of a plot whose number of points is not known yet.
    fn begin(&mut self) -> io::Result<()> {
        let (header, points_at) = header(&self.heading, &self.layout, self.step, 0, "Binary:");
        self.points_at = self.to.stream_position()? + points_at as u64;
        self.points = 0;
        self.to.write_all(header.as_bytes())
    }

    /// Puts the number of points into the header of the plot.
    fn end(&mut self) -> io::Result<()> {
        self.to.flush()?;
        let to = self.to.get_mut();
        to.seek(SeekFrom::Start(self.points_at))?;
        write!(to, "{:<8}", self.points)?;
        to.seek(SeekFrom::End(0))?;
        Ok(())
    }

    /// Writes the number of rows and gives the writer back.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn finish(mut self) -> io::Result<W> {
        if self.layout.stepped && self.step.is_none() {
            self.begin()?;
        }
        self.end()?;
        self.to.flush()?;
        self.to.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

impl<W: Write + Seek> Sink for Rows<W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        let step = values.first().copied().filter(|_| self.layout.stepped);
        if step.is_some() && step != self.step {
            if self.step.is_some() {
                self.end()?;
            }
            self.step = step;
            self.begin()?;
        }
        self.points += 1;
        binary_row(&mut self.to, &self.layout, values)
    }
}

fn binary_row(to: &mut dyn Write, layout: &Layout, row: &[f64]) -> io::Result<()> {
    for (real, imaginary) in layout.values(row) {
        to.write_all(&real.to_le_bytes())?;
        if layout.complex {
            to.write_all(&imaginary.to_le_bytes())?;
        }
    }
    Ok(())
}

/// The header of a plot, and where the number of points stands in it. ngspice pads that number, so that it can be put
/// in when the run is over; so do we. `Command:` stands after it, where other readers look for the version.
fn header(
    heading: &Heading,
    layout: &Layout,
    step: Option<f64>,
    points: usize,
    data: &str,
) -> (String, usize) {
    let mut text = format!(
        "Title: {}\nDate: Thu Jan  1 00:00:00  1970\nPlotname: {}\nFlags: {}\n\
         No. Variables: {}\nNo. Points: ",
        title(heading),
        layout.plot_of(step),
        layout.flags(),
        layout.variables.len()
    );
    let points_at = text.len();
    text +=
        &format!("{points:<8}\nCommand: version 39 (ngspice format, bondspice 0.1)\nVariables:\n");
    for (at, variable) in layout.variables.iter().enumerate() {
        text += &format!("\t{at}\t{}\t{}\n", variable.name, variable.kind);
    }
    text += data;
    text.push('\n');
    (text, points_at)
}

/// Writes a whole trace, binary.
///
/// # Errors
/// What writing failed with.
pub fn write(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    whole(trace, heading, to, "Binary:", &mut |to, layout, _, row| binary_row(to, layout, row))
}

/// Writes a whole trace as ASCII: an index before each point, an empty line after it, 17 figures.
///
/// # Errors
/// What writing failed with.
pub fn write_ascii(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    whole(trace, heading, to, "Values:", &mut |to, layout, index, row| {
        for (at, (real, imaginary)) in layout.values(row).enumerate() {
            if at == 0 {
                write!(to, " {index}")?;
            }
            match layout.complex {
                true => writeln!(to, "\t{},{}", figures(real), figures(imaginary))?,
                false => writeln!(to, "\t{}", figures(real))?,
            }
        }
        writeln!(to)
    })
}

/// As C's `%.16e` writes a number.
fn figures(value: f64) -> String {
    let text = format!("{value:.16e}");
    match text.split_once('e') {
        Some((digits, power)) => {
            let (sign, power) = power.strip_prefix('-').map_or(('+', power), |power| ('-', power));
            format!("{digits}e{sign}{power:0>2}")
        }
        None => text.to_lowercase(),
    }
}

/// Writes the points of one plot: the layout, the point's index, its row.
type Point<'a> = &'a mut dyn FnMut(&mut dyn Write, &Layout, usize, &[f64]) -> io::Result<()>;

fn whole(
    trace: &Trace,
    heading: &Heading,
    to: &mut dyn Write,
    data: &str,
    point: Point,
) -> io::Result<()> {
    let mut to = io::BufWriter::with_capacity(1 << 16, to);
    let layout = Layout::new(&trace.names, &trace.units);
    let runs = trace.runs();
    let empty = std::iter::once(0..0).take(usize::from(runs.is_empty()));
    for run in runs.iter().cloned().chain(empty) {
        let step = trace.columns.first().and_then(|column| column.get(run.start)).copied();
        to.write_all(header(heading, &layout, step, run.len(), data).0.as_bytes())?;
        let part = Trace {
            columns: trace.columns.iter().map(|c| c[run.clone()].to_vec()).collect(),
            ..Trace::default()
        };
        let mut points = Points { to: &mut to, layout: &layout, index: 0, point: &mut *point };
        send(&part, &mut points)?;
    }
    to.flush()
}

struct Points<'a> {
    to: &'a mut dyn Write,
    layout: &'a Layout,
    index: usize,
    point: Point<'a>,
}

impl Sink for Points<'_> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        (self.point)(self.to, self.layout, self.index, values)?;
        self.index += 1;
        Ok(())
    }
}
