//! Traces in RAW files: a header of text, then the points, in one plot or several below each other.
//!
//! | writer | header | numbers |
//! |---|---|---|
//! | ngspice | ASCII | little-endian doubles, point by point; complex ones as two; or text after `Values:` |
//! | Xyce | as ngspice | as ngspice |
//! | LTspice | UTF-16 (older ones ASCII) | time a double, the rest floats of 32 bits unless the flag `double` says otherwise; complex ones two doubles; variable by variable with `fastaccess`; several runs below each other with `stepped`; points that were compressed have a negative time |
//!
//! Sources: ngspice 39, `rawfile.c`, and files it wrote; for LTspice the description that comes with spicelib. Names may
//! hold no blanks there: they become underscores.

mod header;
mod layout;
mod ltspice;
mod values;
mod write;

pub use ltspice::write as write_ltspice;
pub use write::{Rows, write, write_ascii};

use super::Trace;
use super::formats::{Failed, bad};
use super::runs::STEP;
use header::Header;

/// Whether a file begins as RAW files do.
pub fn recognises(bytes: &[u8]) -> bool {
    let start = bytes.get(..6).unwrap_or(bytes);
    start.eq_ignore_ascii_case(b"title:") || start == b"T\0i\0t\0"
}

/// Reads the last plot of a RAW file, with the runs before it that are steps of the same; complex variables as columns
/// `name.re`, `name.im`.
///
/// # Errors
/// What is wrong with the file, `E0922`.
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    let mut rest = bytes;
    let mut last: Option<Plot> = None;
    while !at_end(rest) {
        let (header, data) = header::read(rest)?;
        let (trace, after) = values::read(&header, data)?;
        rest = after;
        let step = header.step();
        match &mut last {
            // A further step of the same run.
            Some(plot) if step.is_some() && plot.goes_on(&header, &trace) => {
                plot.append(trace, step);
            }
            // A run that was broken off before its first row is passed over where another one has rows.
            Some(_) if trace.rows() == 0 => {}
            _ => last = Some(Plot::new(&header, trace, step)),
        }
    }
    last.map(|plot| plot.trace).ok_or_else(|| bad("E0922", "the RAW file is empty"))
}

/// Nothing but blanks is left.
fn at_end(bytes: &[u8]) -> bool {
    bytes.iter().all(|byte| byte.is_ascii_whitespace() || *byte == 0)
}

/// A plot, or the steps of one so far.
struct Plot {
    trace: Trace,
    /// The name of the plot, without its step.
    name: String,
    /// Whether the runs are numbered.
    numbered: bool,
}

impl Plot {
    fn new(header: &Header, mut trace: Trace, step: Option<f64>) -> Plot {
        if header.stepped {
            trace.count_runs();
        }
        if let Some(step) = step {
            let rows = trace.rows();
            trace.names.insert(0, STEP.into());
            trace.units.insert(0, String::new());
            trace.columns.insert(0, vec![step; rows]);
        }
        Plot { trace, name: header.plot_name().to_string(), numbered: step.is_some() }
    }

    fn goes_on(&self, header: &Header, trace: &Trace) -> bool {
        self.numbered && self.name == header.plot_name() && self.trace.names[1..] == trace.names[..]
    }

    fn append(&mut self, mut trace: Trace, step: Option<f64>) {
        let rows = self.trace.rows() + trace.rows();
        let mut columns = self.trace.columns.iter_mut();
        if let Some(steps) = columns.next() {
            steps.resize(rows, step.unwrap_or(0.0));
        }
        for (column, more) in columns.zip(&mut trace.columns) {
            column.append(more);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Sink;
    use crate::trace::formats::Heading;
    use std::io;

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

    /// An AC result, stepped.
    fn phasors() -> Trace {
        let names = ["step", "frequency", "v(a).re", "v(a).im", "gain"];
        let mut trace = Trace::new(names.map(String::from).to_vec(), vec![]);
        for row in
            [[0.0, 10.0, 1.0, -2.0, 3.0], [0.0, 20.0, 4.0, 5.0, 6.0], [1.0, 10.0, 7.0, 8.0, 9.0]]
        {
            trace.row(&row).unwrap();
        }
        trace
    }

    #[test]
    fn steps_are_plots_and_pairs_are_complex() {
        let trace = phasors();
        let heading = Heading::default();
        let mut binary = vec![];
        write(&trace, &heading, &mut binary).unwrap();
        assert_eq!(binary.windows(9).filter(|w| w == b"Plotname:").count(), 2);
        assert_eq!(binary.windows(14).filter(|w| w == b"Flags: complex").count(), 2);
        let mut rows =
            Rows::new(io::Cursor::new(vec![]), &heading, &trace.names, &trace.units).unwrap();
        crate::trace::send(&trace, &mut rows).unwrap();
        assert_eq!(rows.finish().unwrap().into_inner(), binary);
        let (mut ascii, mut ltspice) = (vec![], vec![]);
        write_ascii(&trace, &heading, &mut ascii).unwrap();
        write_ltspice(&trace, &heading, &mut ltspice).unwrap();
        for bytes in [binary, ascii, ltspice] {
            let back = read(&bytes).unwrap();
            for (at, column) in trace.columns.iter().enumerate().take(4) {
                assert_eq!(&back.columns[at], column, "{:?}", back.names);
            }
            assert_eq!(back.names[..2], trace.names[..2]);
            assert_eq!(back.column("v(a).im"), Some(&[-2.0, 5.0, 8.0][..]));
            assert_eq!(back.column("gain.re"), Some(&[3.0, 6.0, 9.0][..]));
        }
    }

    /// A file as LTspice writes it: floats of 32 bits beside a double.
    fn ltspice(flags: &str, points: usize, numbers: &[u8]) -> Vec<u8> {
        let text = format!(
            "Title: * C:\\a.asc\nDate: x\nPlotname: Transient Analysis\nFlags: {flags}\nNo. Variables: 2\n\
             No. Points: {points:12}\nOffset: 0.0\nCommand: Linear Technology Corporation LTspice XVII\n\
             Variables:\n\t0\ttime\ttime\n\t1\tV(out)\tvoltage\nBinary:\n"
        );
        let mut bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        bytes.extend(numbers);
        bytes
    }

    #[test]
    fn ltspice_in_all_its_forms() {
        let rows = [(0.0_f64, 1.5_f32), (-1e-3, 2.5), (2e-3, -0.25), (0.0, 9.0), (2e-3, 8.0)];
        let flat: Vec<u8> = rows
            .iter()
            .flat_map(|(t, v)| [&t.to_le_bytes()[..], &v.to_le_bytes()].concat())
            .collect();
        let trace = read(&ltspice("real forward", 3, &flat[..36])).unwrap();
        assert_eq!(trace.columns, [[0.0, 1e-3, 2e-3], [1.5, 2.5, -0.25]]);
        let trace = read(&ltspice("real forward stepped", 5, &flat)).unwrap();
        assert_eq!(trace.names, ["step", "time", "V(out)"]);
        assert_eq!(trace.columns[0], [0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(trace.columns[2], [1.5, 2.5, -0.25, 9.0, 8.0]);
        let times: Vec<u8> = rows[..3].iter().flat_map(|(t, _)| t.to_le_bytes()).collect();
        let values: Vec<u8> = rows[..3].iter().flat_map(|(_, v)| v.to_le_bytes()).collect();
        let fast = [times, values].concat();
        let trace = read(&ltspice("real forward fastaccess", 3, &fast)).unwrap();
        assert_eq!(trace.columns, [[0.0, 1e-3, 2e-3], [1.5, 2.5, -0.25]]);
        let doubles: Vec<u8> =
            [0.0, 0.1, 1e-3, 0.2].iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
        for flags in ["real forward double", "real forward"] {
            let trace = read(&ltspice(flags, 2, &doubles)).unwrap();
            assert_eq!(trace.columns, [[0.0, 1e-3], [0.1, 0.2]], "{flags}");
        }
        let text = "Title: t\nFlags: real forward\nNo. Variables: 2\nNo. Points: 1\nVariables:\n\t0\ttime\ttime\n\
                    \t1\tV(a)\tvoltage\nValues:\n0\t\t1.0\n\t2.0\n";
        let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(read(&bytes).unwrap().columns, [[1.0], [2.0]]);
    }

    #[test]
    fn ngspice_loads_what_we_write() {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = vec![];
        write(&trace(), &Heading::default(), &mut bytes).unwrap();
        std::fs::write(folder.path().join("ours.raw"), bytes).unwrap();
        let (mut ascii, mut steps) = (vec![], vec![]);
        write_ascii(&trace(), &Heading::default(), &mut ascii).unwrap();
        std::fs::write(folder.path().join("ascii.raw"), ascii).unwrap();
        write(&phasors(), &Heading::default(), &mut steps).unwrap();
        std::fs::write(folder.path().join("steps.raw"), steps).unwrap();
        let deck = "load\n.control\nset numdgt=15\nload ours.raw\nprint v(a) pump_pressure\n\
            wrdata theirs v(a) pump_pressure\nprint time v(a) pump_pressure > printed\n\
            set filetype=ascii\nwrite back.raw\n\
            load ascii.raw\nset filetype=binary\nwrite again.raw\n\
            load steps.raw\nwrite last.raw\nsetplot previous\nwrite first.raw\nquit\n.endc\n.end\n";
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
        let file = |name: &str| std::fs::read(folder.path().join(name)).expect(&said);
        // What it printed as a table and wrote by `wrdata` are read as well as its RAW files.
        for name in ["back.raw", "again.raw", "printed"] {
            let back = crate::trace::formats::read(name, &file(name)).unwrap();
            let exact = name != "printed";
            let column = |name: &str| back.column(name).expect(name);
            assert_eq!(column("v(a)"), [1.0, -2.5, 3.0], "{name}: {said}");
            assert_eq!(column("pump_pressure"), [1e-30, 200.0, 1e7], "{name}: {said}");
            assert!(!exact || back.time() == [0.0, 0.5, 0.5]);
        }
        let theirs = crate::trace::formats::read("theirs", &file("theirs")).unwrap();
        assert_eq!(theirs.columns[2], [1e-30, 200.0, 1e7]);
        let last = read(&file("last.raw")).unwrap();
        assert_eq!(last.column("v(a).im"), Some(&[8.0][..]), "{said}");
        let first = read(&file("first.raw")).unwrap();
        assert_eq!(first.column("v(a).im"), Some(&[-2.0, 5.0][..]), "{said}");
    }
}
