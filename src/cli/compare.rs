//! `bondspice compare A B`: a trace against a reference. As `diff`: 0 same, 1 different, 2 trouble.

use super::output::write_text;
use super::plot;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::diagnostic::Diagnostic;
use crate::draw::plot::{Source, compared};
use crate::source::Span;
use crate::trace::compare::{Comparison, Settings, compare};

/// What it does, in a line.
pub const ABOUT: &str = "Compare a trace with a reference: 0 same, 1 different, 2 trouble";

/// An example for the help.
pub const EXAMPLE: &str = "The error of a signal is the largest |a - b| / (max - min of b) over the rows of the \
reference b, the trace a interpolated there.\n\nExample: bondspice compare run.csv reference.csv --tolerance 1e-4 \
--signals 'x, I = f(armature)'\n         bondspice compare run.csv reference.csv --plot difference.svg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The trace: CSV, RAW (ngspice, Xyce, LTspice), JSON, VCD or a table of blanks; - for standard input
    trace: String,
    /// The reference, in any of these; - for standard input
    reference: String,
    /// Largest error allowed, as a part of the reference's range
    #[arg(long, default_value_t = 1e-3, value_name = "X", allow_hyphen_values = true)]
    tolerance: f64,
    /// Duration of the rises that stand for jumps, in seconds: rows that close to a jump are skipped
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    rise: Option<f64>,
    /// Signals to compare, REFERENCE[=TRACE], …; without it every column of the reference
    #[arg(long, value_name = "NAMES")]
    signals: Option<String>,
    /// Form of the result
    #[arg(long, value_name = "FORM", value_parser = ["table", "json"], default_value = "table")]
    format: String,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// Plot both with the tube of the tolerance, and the errors: .svg or .tex
    #[arg(long, value_name = "FILE")]
    plot: Option<String>,
}

/// Compares.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    // As in `diff`, any trouble is 2.
    compare_files(&arguments, session).unwrap_or(Exit::Usage)
}

fn compare_files(arguments: &Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let usage = |session: &mut Session, message: &str| {
        session.fail(Diagnostic::error("E0940", Span::NONE, message))
    };
    if arguments.trace == "-" && arguments.reference == "-" {
        return Err(usage(session, "only one of the two can be standard input"));
    }
    let positive = |x: f64| x >= 0.0 && x.is_finite();
    if !positive(arguments.tolerance) || !arguments.rise.is_none_or(positive) {
        return Err(usage(session, "--tolerance and --rise cannot be negative"));
    }
    let trace = session.load_trace(&arguments.trace)?;
    let reference = session.load_trace(&arguments.reference)?;
    let signals = arguments.signals.as_deref().map(names);
    let settings = Settings { tolerance: arguments.tolerance, rise: arguments.rise, signals };
    let comparison = compare(&trace, &reference, &settings);
    if comparison.signals.is_empty() {
        let missing = comparison.missing.join(", ");
        let message = format!("`{}` has none of the signals compared", arguments.trace);
        let diagnostic = Diagnostic::error("E0942", Span::NONE, message)
            .because(format!("compared: {missing}"))
            .because(format!("it has: {}", trace.names[1..].join(", ")))
            .help("pair names with --signals 'REFERENCE=TRACE, …'");
        return Err(session.fail(diagnostic));
    }
    if let Some(name) = &arguments.plot {
        let form = plot::form(Some(name), session)?;
        let (own, theirs) = (&arguments.trace, &arguments.reference);
        let (own, theirs) =
            (Source { name: own, trace: &trace }, Source { name: theirs, trace: &reference });
        let panels = compared(own, theirs, &comparison, settings.signals.as_deref());
        plot::show("", &panels, form, Some(name), session)?;
    }
    let text = if arguments.format == "json" {
        serde_json::to_string(&comparison).unwrap_or_default() + "\n"
    } else {
        table(&comparison)
    };
    write_text(arguments.output.as_deref(), &text, session)?;
    Ok(if comparison.same() { Exit::Fine } else { Exit::Negative })
}

/// Signals as a table, the verdict below.
pub fn table(comparison: &Comparison) -> String {
    let mut table = Table::new(&["signal", "max", "rms", "at", "range", "skipped", "verdict"]);
    for signal in &comparison.signals {
        let verdict = match signal.same() {
            true => "same".to_string(),
            false if signal.uncovered > 0 => format!("{} rows not covered", signal.uncovered),
            false => "different".to_string(),
        };
        table.row([
            signal.name.clone(),
            short(signal.max),
            short(signal.rms),
            short(signal.at),
            short(signal.range),
            signal.skipped.to_string(),
            verdict,
        ]);
    }
    let mut text = table.to_text();
    for name in &comparison.missing {
        text += &format!("{name}  missing\n");
    }
    let tolerance = comparison.signals.first().map_or(0.0, |signal| signal.tolerance);
    text + &format!("{} (tolerance {tolerance:e} of range)\n", comparison.verdict)
}

/// `x, I=f(armature)` as pairs; commas and equal signs within brackets belong to names.
pub fn names(text: &str) -> Vec<(String, String)> {
    let split = |text: &str, at: char| -> Vec<String> {
        let mut parts = vec![String::new()];
        let mut depth = 0_i32;
        for letter in text.chars() {
            depth += i32::from("([".contains(letter)) - i32::from(")]".contains(letter));
            match parts.last_mut() {
                Some(part) if letter != at || depth > 0 => part.push(letter),
                _ => parts.push(String::new()),
            }
        }
        parts
    };
    let items = split(text, ',').into_iter().filter(|item| !item.trim().is_empty());
    items
        .map(|item| {
            let mut sides = split(&item, '=').into_iter().map(|side| side.trim().to_string());
            let first = sides.next().unwrap_or_default();
            let second = sides.next().unwrap_or_else(|| first.clone());
            (first, second)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_paired() {
        let pair = |a: &str, b: &str| (a.to_string(), b.to_string());
        assert_eq!(names("x, v(a,b) = f(y) ,"), [pair("x", "x"), pair("v(a,b)", "f(y)")]);
    }
}
