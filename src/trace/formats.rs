//! The formats of traces, one row each, and telling them apart.

use super::Trace;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::collections::HashSet;
use std::io::{self, Write};
use std::ops::Range;

/// What a format says beside the rows.
#[derive(Clone, Debug, Default)]
pub struct Heading {
    /// What was run, for formats that have a title.
    pub title: String,
    /// Head columns as `name [unit]` where the unit is known.
    pub units: bool,
}

/// One format.
pub struct Format {
    /// Its name for `--format`.
    pub name: &'static str,
    /// Endings of file names, without the dot.
    pub endings: &'static [&'static str],
    /// What it is, in a line.
    pub about: &'static str,
    /// Writes a whole trace.
    pub write: fn(&Trace, &Heading, &mut dyn Write) -> io::Result<()>,
    /// Reads a whole trace. Of several, the last.
    pub read: fn(&[u8]) -> Result<Trace, Failed>,
    /// Whether a file that begins so is probably one.
    pub recognises: fn(&[u8]) -> bool,
    /// Why it cannot hold columns of these names, where it cannot.
    pub refuses: fn(&[String]) -> Option<&'static str>,
}

/// A format that holds columns of all names.
const ANY: fn(&[String]) -> Option<&'static str> = |_| None;

/// All formats; the first that recognises a file reads it.
pub const FORMATS: &[Format] = &[
    Format {
        name: "raw",
        endings: &["raw"],
        about: "ngspice's binary layout",
        write: super::raw::write,
        read: super::raw::read,
        recognises: super::raw::recognises,
        refuses: ANY,
    },
    Format {
        name: "rawascii",
        endings: &[],
        about: "ngspice's RAW as text",
        write: super::raw::write_ascii,
        read: super::raw::read,
        recognises: super::raw::recognises,
        refuses: ANY,
    },
    Format {
        name: "ltspice",
        endings: &[],
        about: "LTspice's RAW, its header in UTF-16",
        write: super::raw::write_ltspice,
        read: super::raw::read,
        recognises: super::raw::recognises,
        refuses: ANY,
    },
    Format {
        name: "vcd",
        endings: &["vcd"],
        about: "value change dump, times rounded to a time scale",
        write: super::vcd::write,
        read: super::vcd::read,
        recognises: super::vcd::recognises,
        refuses: super::vcd::refuses,
    },
    Format {
        name: "json",
        endings: &["json"],
        about: "{schema, names, units, columns}",
        write: super::json::write,
        read: super::json::read,
        recognises: super::json::recognises,
        refuses: ANY,
    },
    Format {
        name: "prn",
        endings: &["prn", "dat", "print"],
        about: "a table of blanks, as Xyce writes it",
        write: super::prn::write,
        read: super::prn::read,
        recognises: super::prn::recognises,
        refuses: ANY,
    },
    Format {
        name: "csv",
        endings: &["csv", "tsv", "txt"],
        about: "a header and one row a point, as pandas.read_csv takes it",
        write: super::csv::write,
        read: super::csv::read,
        recognises: |bytes| !bytes.contains(&0),
        refuses: ANY,
    },
];

/// The format of a name (`--format`).
pub fn by_name(name: &str) -> Option<&'static Format> {
    FORMATS.iter().find(|format| format.name.eq_ignore_ascii_case(name))
}

/// The format that a file's ending says.
pub fn by_ending(path: &str) -> Option<&'static Format> {
    let ending = std::path::Path::new(path).extension()?.to_str()?.to_lowercase();
    FORMATS.iter().find(|format| format.endings.contains(&ending.as_str()))
}

/// Reads a trace of whatever format; `name` is only for messages. The content decides, not the ending.
///
/// # Errors
/// Says what is wrong with the content.
pub fn read(name: &str, bytes: &[u8]) -> Result<Trace, Failed> {
    let format = FORMATS.iter().find(|format| (format.recognises)(bytes));
    let trace = match format {
        Some(format) => (format.read)(bytes),
        None => Err(bad("E0920", "not a trace")),
    };
    let trace = trace.and_then(|mut trace| {
        // A name that no table could hold.
        for name in trace.names.iter_mut().filter(|name| name.contains(char::is_control)) {
            *name = name.replace(char::is_control, "_");
        }
        check(&trace).map(|()| trace)
    });
    trace.map_err(|mut diagnostic| {
        diagnostic.message = format!("`{name}`: {}", diagnostic.message);
        diagnostic
    })
}

/// A trace must have an abscissa that does not turn back within a run, and no two columns of one name.
fn check(trace: &Trace) -> Result<(), Failed> {
    if trace.names.is_empty() || trace.rows() == 0 {
        return Err(bad("E0924", "the trace has no rows"));
    }
    let mut seen = HashSet::new();
    if let Some(name) = trace.names.iter().find(|name| !seen.insert(name.as_str())) {
        return Err(bad("E0925", format!("two columns are called `{name}`")));
    }
    if trace.is_stepped() {
        rises(trace, 0, 0..trace.rows())?;
    }
    let at = trace.abscissa();
    trace.runs().into_iter().try_for_each(|run| rises(trace, at, run))
}

/// Whether an abscissa holds numbers and does not turn back. Only a sweep may fall.
fn rises(trace: &Trace, at: usize, rows: Range<usize>) -> Result<(), Failed> {
    let column = &trace.columns[at];
    let name = &trace.names[at];
    let (first, last) = (column[rows.start], column[rows.end - 1]);
    let sweep =
        at == trace.abscissa() && !["time", "frequency"].contains(&name.to_lowercase().as_str());
    let sign = if sweep && last < first { -1.0 } else { 1.0 };
    let backwards = |row: &usize| {
        let before = if *row > rows.start { column[row - 1] } else { column[*row] };
        if column[*row].is_infinite() {
            return true;
        }
        (sign * before).partial_cmp(&(sign * column[*row])).is_none_or(|order| order.is_gt())
    };
    let Some(row) = rows.clone().find(backwards) else { return Ok(()) };
    let before = column[if row > rows.start { row - 1 } else { row }];
    let message = format!("`{name}` goes from {before} to {}", column[row]);
    Err(worse("E0926", message, format!("at row {} of {}", row + 1, trace.rows())))
}

/// Why a trace cannot be read.
pub type Failed = Box<Diagnostic>;

/// An error about content, without a place in a text.
pub(super) fn bad(code: &'static str, message: impl Into<String>) -> Failed {
    Box::new(Diagnostic::error(code, Span::NONE, message))
}

/// The same with a fact about it.
pub(super) fn worse(code: &'static str, message: impl Into<String>, note: String) -> Failed {
    Box::new(bad(code, message).because(note))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A trace with what is hard to write: quotes, commas, extreme numbers, a jump.
    pub fn awkward() -> Trace {
        Trace {
            names: vec!["time".into(), "v(a,b)".into(), "the \"duty\" cycle".into(), "Ω".into()],
            units: vec!["s".into(), String::new(), "%".into(), "rad/s".into()],
            columns: vec![
                vec![0.0, 0.1, 0.1, 1.0],
                vec![5e-324, -1e300, 0.1 + 0.2, 1.0 / 3.0],
                vec![0.0, 1e-7, 123456789.25, -2.5e-5],
                vec![f64::MAX, f64::MIN_POSITIVE, 1e16, 9.007199254740993e15],
            ],
        }
    }

    #[test]
    fn every_format_gives_back_the_very_numbers() {
        let trace = awkward();
        for format in FORMATS {
            for units in [false, true] {
                let heading = Heading { title: "test".into(), units };
                let mut bytes = vec![];
                (format.write)(&trace, &heading, &mut bytes).unwrap();
                let back = read("x", &bytes).unwrap();
                let bits = |t: &Trace| -> Vec<Vec<u64>> {
                    t.columns.iter().map(|c| c.iter().map(|v| v.to_bits()).collect()).collect()
                };
                assert_eq!(bits(&back), bits(&trace), "{}", format.name);
                if ["csv", "json"].contains(&format.name) {
                    assert_eq!(back.names, trace.names, "{}", format.name);
                }
            }
        }
    }

    #[test]
    fn formats_are_found_by_name_and_ending() {
        for format in FORMATS {
            assert_eq!(by_name(format.name).unwrap().name, format.name);
            for ending in format.endings {
                assert_eq!(by_ending(&format!("a.b.{ending}")).unwrap().name, format.name);
            }
        }
        assert!(by_ending("run").is_none() && by_name("xml").is_none());
    }

    #[test]
    fn garbage_is_refused_in_words() {
        for (bytes, code) in [
            (&b""[..], "E0924"),
            (b"time,x\n", "E0924"),
            (b"time,x\n0,1\n1\n", "E0921"),
            (b"time,x\n0,one\n", "E0921"),
            (b"time,x,x\n0,1,2\n", "E0925"),
            (b"time,x\n1,1\n0,2\n", "E0926"),
            (b"time,x\nNaN,1\n0,2\n", "E0926"),
            (b"time,x\nNaN,1\n", "E0926"),
            (b"time,x\n0,1\n1e999,2\n", "E0926"),
            (b"step,time,x\n1,1,1\n1,0,1\n", "E0926"),
            (b"step,time,x\n2,0,1\n1,0,1\n", "E0926"),
            (b"t x\n0 1\n1 one\n", "E0921"),
            (b"$timescale 7 ns $end", "E0934"),
            (b"$enddefinitions $end\n", "E0924"),
            (b"{\"schema\": 1}", "E0923"),
            (b"{\"schema\": 1, \"names\": [\"t\"], \"columns\": [[1], [2]]}", "E0923"),
            (b"Title: x\nPlotname: y\n", "E0922"),
            (b"Title: x\nNo. Variables: 99999999999\nNo. Points: 1\nVariables:\n", "E0922"),
            (b"Title: x\nFlags: real\nNo. Variables: 1\nNo. Points: 9\nVariables:\n\t0\ttime\ttime\nBinary:\n12345678", "E0922"),
            (b"\xff\xfegarbage", "E0921"),
            (b"\xff\xfe\x00garbage", "E0920"),
        ] {
            let text = String::from_utf8_lossy(bytes);
            let error = read("x", bytes).expect_err(&text);
            assert_eq!(error.code, code, "{text}: {}", error.message);
            assert!(error.message.starts_with("`x`: "));
        }
    }
}
