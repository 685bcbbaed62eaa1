//! `bondspice simulate FILE`: runs a bond graph or a netlist.

use super::emit::Stage;
use super::flags::{DeckFlags, ModelFlags};
use super::fourier;
use super::list;
use super::measures;
use super::output::{Output, write_text};
use super::pipeline::{self, Run};
use super::session::{Exit, Session};
use super::watch::{self, Bar};
use crate::bond::elaborate::Overrides;
use crate::circuit::{Analysis, Points};
use crate::diagnostic::Diagnostic;
use crate::sim::{FailureKind, Interval, Progress, Settings, Statistics};
use crate::source::{FileId, Span};
use crate::trace::Sink;
use crate::trace::formats::Heading;
use std::io;
use std::sync::Arc;

/// What it does, in a line.
pub const ABOUT: &str = "Simulate a bond graph or a netlist";

/// An example for the help.
pub const EXAMPLE: &str = "Without -o the rows go to standard output as CSV, and on a terminal a table sums them up.\n\n\
Example: bondspice simulate model.bg -o run.csv --set L=2mH --observe 'f(armature) in A as \"current\"'";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg) or netlist; - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// Where to write the result: .csv, .raw, .json, .vcd or .prn
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// Format of the result (csv, raw, rawascii, ltspice, vcd, json, prn); else from the ending of -o
    #[arg(long, value_name = "FORMAT")]
    format: Option<String>,
    /// Head columns as `name [unit]`
    #[arg(long)]
    units: bool,
    /// Rows at exactly these times, one a line, in seconds; in .ac at these frequencies in Hz
    #[arg(long, value_name = "FILE", conflicts_with = "step")]
    times: Option<String>,
    /// Which analysis of a netlist to run (op, dc, ac, tf, pz, sens, tran); without it the last
    #[arg(long, value_name = "KIND")]
    analysis: Option<String>,
    #[command(flatten)]
    deck: DeckFlags,
    /// Print a stage on the way instead of running
    #[arg(long, value_enum, value_name = "STAGE")]
    emit: Option<Stage>,
    /// List what can be observed, with units, instead of running
    #[arg(long)]
    list: bool,
    /// Where to write what `.measure` asks for: .csv or .json
    #[arg(long, value_name = "FILE")]
    measures: Option<String>,
    /// Where to write the harmonics that `.four` asks for: .csv or .json
    #[arg(long, value_name = "FILE")]
    fourier: Option<String>,
    /// Statistics of the run on stderr
    #[arg(long, value_name = "FORM", value_parser = ["json", "text"])]
    stats: Option<String>,
}

/// Simulates.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let arguments = &arguments;
    let mut overrides = arguments.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    let file = session.load(&arguments.file)?;
    if let Some(stage) = arguments.emit {
        let text = pipeline::emit(session, file, &overrides, stage)?;
        write_text(arguments.output.as_deref(), &text, session)?;
        return Ok(Exit::Fine);
    }
    if arguments.list {
        let text = list::observables(session, file, &overrides)?;
        write_text(arguments.output.as_deref(), &text, session)?;
        return Ok(Exit::Fine);
    }
    let times = arguments.times.as_deref().map(|name| read_times(name, session)).transpose()?;
    let mut run = prepare(arguments, file, &overrides, session)?;
    if let Some(times) = times {
        match (&mut run.analysis, &mut run.settings) {
            (Analysis::Ac { frequencies }, _) => {
                *frequencies = Points::Rows(times.into_iter().map(|f| vec![f]).collect());
            }
            (_, Some(settings)) => {
                set_times(times, settings).map_err(|error| session.fail(*error))?;
            }
            _ => {}
        }
    }
    go(arguments, &mut run, session)
}

fn prepare(
    arguments: &Arguments,
    file: FileId,
    overrides: &Overrides,
    session: &mut Session,
) -> Result<Run, Exit> {
    let mut d = vec![];
    let pick = arguments.analysis.as_deref().map(str::to_lowercase);
    let run = pipeline::prepare(&mut session.map, file, overrides, pick.as_deref(), &mut d);
    session.say(d);
    let Some(run) = run else { return Err(session.exit()) };
    if run.analyses > 1 && arguments.analysis.is_none() {
        let which = run.analysis.name();
        let message = format!("of {} analyses the last is run, `{which}`", run.analyses);
        let note = Diagnostic::note("N0946", Span::NONE, message);
        session.say([note.help("pick another with --analysis")]);
    }
    Ok(run)
}

fn go(arguments: &Arguments, run: &mut Run, session: &mut Session) -> Result<Exit, Exit> {
    let heading = Heading { title: run.title.clone(), units: arguments.units };
    let (to, format) = (arguments.output.as_deref(), arguments.format.as_deref());
    let output = Output::open(to, format, heading, &run.names, &run.units, session)?;
    let mut output = Noting { to: output, error: None };
    let bar = Bar::new(session.global.quiet);
    let progress = bar.clone().map(|bar| Arc::new(move |part| bar.show(part)) as Progress);
    run.watch(watch::stop_flag(), progress);
    run.give_back();
    let (result, taken) = run.go_measured(&mut output);
    if let Some(bar) = bar {
        bar.clear();
    }
    match result {
        Ok(statistics) => {
            session.say(statistics.warnings.clone());
            output.to.close(true, session)?;
            let name = run.analysis.name();
            measures::tell(&taken.measured, name, arguments.measures.as_deref(), session)?;
            fourier::tell(&taken.harmonics, arguments.fourier.as_deref(), session)?;
            say_statistics(arguments, &statistics, session);
            Ok(session.exit())
        }
        Err(failure) => {
            let exit = match (failure.kind, output.error) {
                (FailureKind::Output, Some(io::ErrorKind::BrokenPipe)) => return Ok(Exit::Fine),
                (FailureKind::Interrupted, _) => Exit::Interrupted,
                (FailureKind::Output, _) => Exit::File,
                (FailureKind::NotSolved, _) => Exit::Simulation,
                (FailureKind::Input, _) => Exit::Input,
            };
            session.say(failure.statistics.warnings.clone());
            if failure.kind == FailureKind::Interrupted {
                session.remark(&format!("interrupted at t = {} s", failure.time));
            } else {
                session.say([*failure.diagnostic]);
            }
            output.to.close(false, session)?;
            say_statistics(arguments, &failure.statistics, session);
            Err(exit)
        }
    }
}

/// A sink that remembers why a row could not be written.
struct Noting {
    to: Output,
    error: Option<io::ErrorKind>,
}

impl Sink for Noting {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        self.to.row(values).inspect_err(|error| self.error = Some(error.kind()))
    }
}

fn say_statistics(arguments: &Arguments, statistics: &Statistics, session: &Session) {
    match arguments.stats.as_deref() {
        // Asked for, so said even when quiet.
        Some("json") => eprintln!("{}", statistics.to_json()),
        Some(_) => eprintln!("{statistics}"),
        None if session.global.verbose && !session.global.quiet => eprintln!("{statistics}"),
        None => {}
    }
}

/// Rows at these times, all of which the run must reach.
fn set_times(times: Vec<f64>, settings: &mut Settings) -> Result<(), Box<Diagnostic>> {
    let (start, stop) = (settings.start, settings.stop);
    let outside = |message: String| {
        let error = Diagnostic::error("E0933", Span::NONE, message);
        Err(Box::new(error.help("leave the time out, or set the run's end with --until")))
    };
    if let Some(time) = times.iter().find(|time| **time < start) {
        return outside(format!("there is no row at {time} s: they begin at {start} s"));
    }
    // What rounding adds to a time is no time of its own.
    let reached = stop * (1.0 + 1e-12);
    if let Some(time) = times.iter().find(|time| **time > reached) {
        return outside(format!("there is no row at {time} s: the run ends at {stop} s"));
    }
    settings.stop = times.last().map_or(stop, |last| last.max(stop));
    settings.rows = Interval::Times(times);
    Ok(())
}

/// Times of rows, one a line.
fn read_times(name: &str, session: &mut Session) -> Result<Vec<f64>, Exit> {
    let text = session.load_text(name)?;
    let mut times: Vec<f64> = vec![];
    for (line, word) in text.lines().map(str::trim).enumerate().filter(|(_, w)| !w.is_empty()) {
        let time = word.parse().ok().filter(|t: &f64| t.is_finite());
        let after = time.filter(|t| times.last().is_none_or(|last| last < t) && *t >= 0.0);
        match (time, after) {
            (_, Some(time)) => times.push(time),
            (Some(_), None) => {
                let message = format!("`{name}`: times must rise from 0 on");
                let note = format!("`{word}` at line {}", line + 1);
                let diagnostic = Diagnostic::error("E0933", Span::NONE, message);
                return Err(session.fail(diagnostic.because(note)));
            }
            (None, _) => {
                let message = format!("`{name}`: `{word}` is no time in seconds");
                let diagnostic = Diagnostic::error("E0933", Span::NONE, message);
                return Err(session.fail(diagnostic.because(format!("at line {}", line + 1))));
            }
        }
    }
    Ok(times)
}
