//! Traces in ngspice's RAW layout: a header of text, then little-endian doubles, one row after the other.
//!
//! Source: ngspice 39, `rawfile.c`, and files it wrote. It writes `No. Points:` padded, so that the number can be put
//! in when the run is over; so do we. `Command:` stands after it, where other readers look for the version. Names
//! may hold no blanks there: they become underscores.

use super::formats::{Failed, Heading, bad, worse};
use super::{Sink, Trace};
use std::io::{self, Seek, SeekFrom, Write};

/// More variables than this are not believed.
const MOST_VARIABLES: usize = 1 << 24;

/// Writes rows as they come, and their number when they have all come.
pub struct Rows<W: Write + Seek> {
    to: io::BufWriter<W>,
    points_at: u64,
    points: u64,
}

impl<W: Write + Seek> Rows<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn new(to: W, heading: &Heading, names: &[String], units: &[String]) -> io::Result<Self> {
        let mut to = io::BufWriter::with_capacity(1 << 16, to);
        let (header, points_at) = header(heading, names, units, 0);
        to.write_all(header.as_bytes())?;
        Ok(Rows { to, points_at: points_at as u64, points: 0 })
    }

    /// Writes the number of rows and gives the writer back.
    ///
    /// # Errors
    /// What writing failed with.
    pub fn finish(mut self) -> io::Result<W> {
        self.to.flush()?;
        let mut to = self.to.into_inner().map_err(io::IntoInnerError::into_error)?;
        to.seek(SeekFrom::Start(self.points_at))?;
        write!(to, "{:<8}", self.points)?;
        to.seek(SeekFrom::End(0))?;
        to.flush()?;
        Ok(to)
    }
}

impl<W: Write + Seek> Sink for Rows<W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        self.points += 1;
        values.iter().try_for_each(|value| self.to.write_all(&value.to_le_bytes()))
    }
}

/// The header, and where the number of points stands in it.
fn header(heading: &Heading, names: &[String], units: &[String], points: u64) -> (String, usize) {
    let title = heading.title.split(['\n', '\r']).next().filter(|line| !line.is_empty());
    let mut text = format!(
        "Title: {}\nDate: Thu Jan  1 00:00:00  1970\nPlotname: Transient Analysis\nFlags: real\n\
         No. Variables: {}\nNo. Points: ",
        title.unwrap_or("bondspice"),
        names.len()
    );
    let points_at = text.len();
    text +=
        &format!("{points:<8}\nCommand: version 39 (ngspice format, bondspice 0.1)\nVariables:\n");
    for (at, name) in names.iter().enumerate() {
        let unit = units.get(at).map_or("", String::as_str);
        let plain: String = name.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
        text += &format!("\t{at}\t{plain}\t{}\n", kind(&plain, unit, at));
    }
    text += "Binary:\n";
    (text, points_at)
}

/// What ngspice calls the kind of a vector.
fn kind(name: &str, unit: &str, at: usize) -> &'static str {
    let name = name.to_lowercase();
    match (at, unit) {
        (0, _) if name == "time" => "time",
        (0, _) if name == "frequency" => "frequency",
        (_, "V") => "voltage",
        (_, "A") => "current",
        _ if name.starts_with("v(") => "voltage",
        _ if name.starts_with("i(") => "current",
        _ => "notype",
    }
}

/// Writes a whole trace.
pub fn write(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let points = trace.rows() as u64;
    let mut to = io::BufWriter::with_capacity(1 << 16, to);
    to.write_all(header(heading, &trace.names, &trace.units, points).0.as_bytes())?;
    for row in 0..trace.rows() {
        for column in &trace.columns {
            to.write_all(&column[row].to_le_bytes())?;
        }
    }
    to.flush()
}

/// Whether a file begins as RAW files do.
pub fn recognises(bytes: &[u8]) -> bool {
    let start = bytes.get(..6).unwrap_or(bytes);
    start.eq_ignore_ascii_case(b"title:") || start == b"T\0i\0t\0"
}

/// Reads the last run of a RAW file, binary or ASCII, real or complex (as columns `name.re`, `name.im`).
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    if bytes.starts_with(b"T\0") {
        return Err(bad("E0922", "RAW files in UTF-16, as LTspice writes them, cannot be read"));
    }
    let mut rest = bytes;
    let mut last = None;
    while !rest.trim_ascii_start().is_empty() {
        let (run, after) = read_run(rest)?;
        // A run that was broken off before its first row is passed over where another one has rows.
        if last.as_ref().is_none_or(|_| run.rows() > 0) {
            last = Some(run);
        }
        rest = after;
    }
    last.ok_or_else(|| bad("E0922", "the RAW file is empty"))
}

/// What the header of a run says.
struct Header {
    complex: bool,
    points: usize,
    names: Vec<String>,
    units: Vec<String>,
    binary: bool,
}

fn read_run(bytes: &[u8]) -> Result<(Trace, &[u8]), Failed> {
    let (header, data) = read_header(bytes)?;
    let Header { complex, names, units, .. } = &header;
    let trace = if *complex {
        let split = |at: usize, name: &String| match at {
            // The scale of an AC analysis is real.
            0 => vec![name.clone()],
            _ => vec![format!("{name}.re"), format!("{name}.im")],
        };
        Trace::new(
            names.iter().enumerate().flat_map(|(at, name)| split(at, name)).collect(),
            vec![],
        )
    } else {
        Trace::new(names.clone(), units.clone())
    };
    if header.binary { read_binary(&header, trace, data) } else { read_ascii(&header, trace, data) }
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

fn read_binary<'a>(
    header: &Header,
    mut trace: Trace,
    data: &'a [u8],
) -> Result<(Trace, &'a [u8]), Failed> {
    let row = header.names.len() * if header.complex { 16 } else { 8 };
    // A run that was killed leaves the number of points at 0: then all that is there is taken.
    let points = if header.points == 0 { data.len() / row } else { header.points };
    let size = row.checked_mul(points).filter(|size| *size <= data.len()).ok_or_else(|| {
        let there = data.len() / row;
        let note = format!("{points} points of {row} bytes are announced, {there} are there");
        worse("E0922", "the RAW file ends too early", note)
    })?;
    let (rows, rest) = data.split_at(size);
    let mut numbers = rows
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
    for _ in 0..points {
        push_row(&mut trace, header, || numbers.next());
    }
    Ok((trace, rest))
}

fn read_ascii<'a>(
    header: &Header,
    mut trace: Trace,
    data: &'a [u8],
) -> Result<(Trace, &'a [u8]), Failed> {
    let end = data.windows(7).position(|w| w == b"\nTitle:").map_or(data.len(), |at| at + 1);
    let text = String::from_utf8_lossy(&data[..end]);
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

fn read_header(bytes: &[u8]) -> Result<(Header, &[u8]), Failed> {
    let mut header =
        Header { complex: false, points: 0, names: vec![], units: vec![], binary: false };
    let mut variables = 0;
    let mut rest = bytes;
    let missing = |what: &str| bad("E0922", format!("the header of the RAW file lacks {what}"));
    let count = |text: &str, what: &str| {
        let number = text.trim().parse::<usize>();
        number.map_err(|_| bad("E0922", format!("`{}` is no number of {what}", text.trim())))
    };
    loop {
        let end = rest.iter().position(|byte| *byte == b'\n').ok_or_else(|| missing("its data"))?;
        let line = String::from_utf8_lossy(&rest[..end]);
        rest = &rest[end + 1..];
        let (key, value) = line.split_once(':').unwrap_or((&line, ""));
        match key.trim().to_lowercase().as_str() {
            "flags" => header.complex = value.to_lowercase().contains("complex"),
            "no. variables" => variables = count(value, "variables")?,
            "no. points" => header.points = count(value, "points")?,
            "variables" if variables > MOST_VARIABLES => {
                return Err(bad("E0922", format!("{variables} variables are too many")));
            }
            "variables" => {
                // Some writers put the first variable on the line of the key.
                let mut first = Some(value.to_string()).filter(|text| !text.trim().is_empty());
                for _ in 0..variables {
                    let line = match first.take() {
                        Some(line) => line,
                        None => {
                            let end = rest.iter().position(|byte| *byte == b'\n');
                            let end = end.ok_or_else(|| missing("a variable"))?;
                            let line = String::from_utf8_lossy(&rest[..end]).into_owned();
                            rest = &rest[end + 1..];
                            line
                        }
                    };
                    let mut words = line.split_whitespace().skip(1);
                    header.names.push(words.next().ok_or_else(|| missing("a variable"))?.into());
                    header.units.push(unit(words.next().unwrap_or("")).into());
                }
            }
            "binary" | "values" if header.names.is_empty() => return Err(missing("variables")),
            "binary" => {
                header.binary = true;
                return Ok((header, rest));
            }
            "values" => return Ok((header, rest)),
            _ => {}
        }
    }
}

fn unit(kind: &str) -> &'static str {
    match kind {
        "time" => "s",
        "frequency" => "Hz",
        "voltage" => "V",
        "current" => "A",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace() -> Trace {
        let mut trace = Trace::new(
            vec!["time".into(), "v(a)".into(), "pump pressure".into()],
            vec!["s".into(), "V".into(), "bar".into()],
        );
        for row in [[0.0, 1.0, 1e-30], [0.5, -2.5, 200.0], [0.5, 3.0, 1e7]] {
            trace.row(&row).unwrap();
        }
        trace
    }

    #[test]
    fn rows_that_stream_make_the_same_file() {
        let heading = Heading { title: "two\nlines".into(), units: false };
        let trace = trace();
        let mut whole = vec![];
        write(&trace, &heading, &mut whole).unwrap();
        let file = io::Cursor::new(vec![]);
        let mut rows = Rows::new(file, &heading, &trace.names, &trace.units).unwrap();
        for at in 0..trace.rows() {
            rows.row(&trace.columns.iter().map(|c| c[at]).collect::<Vec<_>>()).unwrap();
        }
        assert_eq!(rows.finish().unwrap().into_inner(), whole);
    }

    #[test]
    fn ascii_complex_and_several_runs() {
        let ascii = b"Title: t\nDate: x\nPlotname: AC Analysis\nFlags: complex\nNo. Variables: 2\n\
            No. Points: 2       \nVariables:\n\t0\tfrequency\tfrequency\tgrid=3\n\t1\tv(a)\tvoltage\n\
            Values:\n0\t\t1.0e+00,-1.2e-131\n\t2.0e+00,-3.0\n\n1\t\t10,0\n\t4,5\n\n";
        let trace = read(ascii).unwrap();
        assert_eq!(trace.names, ["frequency", "v(a).re", "v(a).im"]);
        assert_eq!(trace.columns, [[1.0, 10.0], [2.0, 4.0], [-3.0, 5.0]]);
        let mut two = ascii.to_vec();
        write(&self::trace(), &Heading::default(), &mut two).unwrap();
        two.extend_from_slice(ascii);
        write(&self::trace(), &Heading::default(), &mut two).unwrap();
        assert_eq!(read(&two).unwrap().columns, self::trace().columns);
    }

    #[test]
    fn ngspice_loads_what_we_write() {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = vec![];
        write(&trace(), &Heading::default(), &mut bytes).unwrap();
        std::fs::write(folder.path().join("ours.raw"), bytes).unwrap();
        let deck = "load\n.control\nset numdgt=15\nload ours.raw\nprint v(a) pump_pressure\n\
            wrdata theirs v(a) pump_pressure\nset filetype=ascii\nwrite back.raw\nquit\n.endc\n.end\n";
        std::fs::write(folder.path().join("load.cir"), deck).unwrap();
        let run = std::process::Command::new("ngspice")
            .args(["-b", "load.cir"])
            .current_dir(folder.path())
            .output();
        let Ok(run) = run else {
            let required = std::env::var_os("BONDSPICE_REQUIRE_PEERS").is_some_and(|v| v == "1");
            assert!(!required, "ngspice is required and cannot be run");
            eprintln!("skipped: ngspice cannot be run");
            return;
        };
        let said = String::from_utf8_lossy(&run.stdout);
        let back = std::fs::read(folder.path().join("back.raw")).expect(&said);
        let back = read(&back).unwrap();
        assert_eq!(back.column("v(a)"), Some(&[1.0, -2.5, 3.0][..]), "{said}");
        assert_eq!(back.column("pump_pressure"), Some(&[1e-30, 200.0, 1e7][..]), "{said}");
        assert_eq!(back.time(), [0.0, 0.5, 0.5]);
    }
}
