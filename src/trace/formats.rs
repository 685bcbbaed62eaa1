//! The formats of traces, one row each, and telling them apart.

use super::Trace;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::io::{self, Write};

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
}

/// All formats; the first that recognises a file reads it.
pub const FORMATS: &[Format] = &[
    Format {
        name: "raw",
        endings: &["raw"],
        about: "ngspice's binary layout",
        write: super::raw::write,
        read: super::raw::read,
        recognises: super::raw::recognises,
    },
    Format {
        name: "json",
        endings: &["json"],
        about: "{schema, names, units, columns}",
        write: super::json::write,
        read: super::json::read,
        recognises: super::json::recognises,
    },
    Format {
        name: "csv",
        endings: &["csv", "tsv", "txt"],
        about: "a header and one row a point, as pandas.read_csv takes it",
        write: super::csv::write,
        read: super::csv::read,
        recognises: |bytes| !bytes.contains(&0),
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
    let trace = trace.and_then(|trace| check(&trace).map(|()| trace));
    trace.map_err(|mut diagnostic| {
        diagnostic.message = format!("`{name}`: {}", diagnostic.message);
        diagnostic
    })
}

/// A trace must have an abscissa that does not fall, and no two columns of one name.
fn check(trace: &Trace) -> Result<(), Failed> {
    if trace.names.is_empty() || trace.rows() == 0 {
        return Err(bad("E0924", "the trace has no rows"));
    }
    for (at, name) in trace.names.iter().enumerate() {
        if trace.names[..at].contains(name) {
            return Err(bad("E0925", format!("two columns are called `{name}`")));
        }
    }
    let time = trace.time();
    if let Some(row) =
        time.windows(2).position(|pair| pair[0].partial_cmp(&pair[1]).is_none_or(|o| o.is_gt()))
    {
        let (a, b) = (time[row], time[row + 1]);
        let message = format!("`{}` goes from {a} to {b}", trace.names[0]);
        return Err(worse("E0926", message, format!("at row {} of {}", row + 2, time.len())));
    }
    Ok(())
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
                if format.name != "raw" {
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
