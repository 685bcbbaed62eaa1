//! Measures and harmonics of a run: taken while its rows stream by, told as a table on stderr, written to a file.

use super::fourier::Harmonics;
use super::output::write_text;
use super::session::{Exit, MessageFormat, Session};
use super::table::Table;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::formats::{self, Heading};
use crate::trace::fourier;
use crate::trace::measure::{Measure, Measures, Outcome};
use crate::trace::runs::STEP;
use crate::trace::{Sink, Trace};
use std::io;

/// What was measured in a run, or in each of its steps.
pub struct Measured {
    /// The step, where there are several.
    pub step: Option<f64>,
    /// The measures in the order of their cards.
    pub outcomes: Vec<Outcome>,
}

/// A sink before another that takes measures from the columns which are not written.
pub struct Measuring<'a> {
    to: &'a mut dyn Sink,
    list: Vec<Measure>,
    analysis: &'a str,
    /// Columns that are written, those before them included.
    shown: usize,
    /// Where the abscissa stands: after the step, where there are steps.
    abscissa: usize,
    /// Columns that are watched: the real and the imaginary part.
    watched: Vec<(usize, Option<usize>)>,
    /// Whether rows stand at times of their own, so that only those of steps are measured.
    times: bool,
    taking: Option<(f64, Measures, Vec<fourier::Taking>)>,
    values: Vec<f64>,
    done: Vec<Measured>,
    /// Whose harmonics are told, and where their period ends.
    harmonics: Vec<fourier::Request>,
    stop: f64,
    told: Vec<Harmonics>,
}

/// What is taken from the rows of a run.
#[derive(Clone, Copy)]
pub struct Taken<'c> {
    /// `.measure`.
    pub measures: &'c [Measure],
    /// `.four`; none where the run is not one over time.
    pub harmonics: &'c [fourier::Request],
    /// When the run ends.
    pub stop: f64,
}

/// How the header of a watched column begins.
pub const WATCHED: &str = "measured ";

/// Where the columns that are watched begin among all of a run.
pub fn shown(names: &[String]) -> usize {
    names.iter().position(|name| name.starts_with(WATCHED)).unwrap_or(names.len())
}

impl<'a> Measuring<'a> {
    /// Before a sink; `names` are those of all columns, `times` says whether rows stand at times of their own.
    pub fn new(
        to: &'a mut dyn Sink,
        taken: Taken,
        analysis: &'a str,
        names: &[String],
        times: bool,
    ) -> Measuring<'a> {
        let shown = shown(names);
        let mut watched = vec![];
        let mut at = shown;
        while at < names.len() {
            let pair = names[at].ends_with(".re");
            watched.push((at, pair.then_some(at + 1)));
            at += 1 + usize::from(pair);
        }
        let abscissa = usize::from(names.first().is_some_and(|name| name == STEP));
        let mut measuring = Measuring {
            to,
            list: vec![],
            analysis,
            shown,
            abscissa,
            watched,
            times,
            taking: None,
            values: vec![],
            done: vec![],
            harmonics: vec![],
            stop: 0.0,
            told: vec![],
        };
        measuring.follow(taken);
        measuring
    }

    /// Takes this from the next step on, whose parameters have other values.
    pub fn follow(&mut self, taken: Taken) {
        self.end();
        self.list = taken.measures.to_vec();
        self.harmonics = taken.harmonics.to_vec();
        self.stop = taken.stop;
    }

    fn measure(&mut self, row: &[f64]) {
        let step = if self.abscissa > 0 { row[0] } else { 0.0 };
        if self.taking.as_ref().is_none_or(|(own, ..)| *own != step) {
            self.end();
            let harmonics = self.harmonics.iter();
            let harmonics = harmonics.map(|one| fourier::Taking::new(one, self.stop)).collect();
            self.taking = Some((step, Measures::new(&self.list, self.analysis), harmonics));
        }
        self.values.clear();
        // A phasor counts by its magnitude.
        self.values.extend(self.watched.iter().map(|(re, im)| match im {
            Some(im) => row[*re].hypot(row[*im]),
            None => row[*re],
        }));
        if let Some((_, taking, harmonics)) = &mut self.taking {
            taking.row(row[self.abscissa], &self.values);
            harmonics.iter_mut().for_each(|one| one.row(row[self.abscissa], &self.values));
        }
    }

    fn end(&mut self) {
        if let Some((step, taking, harmonics)) = self.taking.take() {
            let step = (self.abscissa > 0).then_some(step);
            self.done.push(Measured { step, outcomes: taking.finish() });
            let told = harmonics.into_iter().zip(&self.harmonics).map(|(one, request)| Harmonics {
                step,
                span: request.span,
                found: one.finish(),
            });
            self.told.extend(told);
        }
    }

    /// What was measured, and the harmonics.
    pub fn finish(mut self) -> (Vec<Measured>, Vec<Harmonics>) {
        self.end();
        (self.done, self.told)
    }
}

impl Sink for Measuring<'_> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        let any = !self.list.is_empty() || !self.harmonics.is_empty();
        if !self.times && any {
            self.measure(values);
        }
        self.to.row(&values[..self.shown.min(values.len())])
    }

    fn step(&mut self, values: &[f64]) -> io::Result<()> {
        self.measure(values);
        Ok(())
    }
}

/// Tells what was measured, as ngspice does, and warns of what failed; writes it to a file where one is named.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn tell(
    measured: &[Measured],
    analysis: &str,
    file: Option<&str>,
    session: &mut Session,
) -> Result<(), Exit> {
    if measured.iter().all(|run| run.outcomes.is_empty()) && file.is_none() {
        return Ok(());
    }
    let text = if measured.iter().any(|run| run.step.is_some()) {
        table(measured)
    } else {
        measured.iter().map(|run| list(&run.outcomes)).collect()
    };
    // Where messages are for programs, `--measures` is too.
    if session.global.message_format == MessageFormat::Human && !text.is_empty() {
        session.remark(&format!("measurements of {analysis}\n\n{}\n", text.trim_end()));
    }
    let mut warnings = vec![];
    for run in measured {
        for outcome in run.outcomes.iter().filter(|outcome| outcome.value.is_none()) {
            let message = format!("the measure `{}` failed", outcome.name);
            let mut warning = Diagnostic::warning("W0791", Span::NONE, message);
            warning.notes.extend(outcome.why.clone());
            warning.notes.extend(run.step.map(|step| format!("in step {step}")));
            warnings.push(warning);
        }
    }
    session.say(warnings);
    match file {
        Some(file) => write(measured, file, session),
        None => Ok(()),
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or("failed".into(), |value| format!("{value:.6e}"))
}

/// One measure a line, with the places where it was found.
fn list(outcomes: &[Outcome]) -> String {
    let width = outcomes.iter().map(|outcome| outcome.name.chars().count()).max().unwrap_or(0);
    let line = |outcome: &Outcome| {
        let places: String =
            outcome.places.iter().map(|(key, value)| format!(" {key}= {value:.6e}")).collect();
        format!("{:width$}  =  {}{places}\n", outcome.name, number(outcome.value))
    };
    outcomes.iter().map(line).collect()
}

/// One row a step.
fn table(measured: &[Measured]) -> String {
    let Some(first) = measured.first() else { return String::new() };
    let names = first.outcomes.iter().map(|outcome| outcome.name.as_str());
    let head: Vec<&str> = std::iter::once(STEP).chain(names).collect();
    let mut table = Table::new(&head);
    for run in measured {
        let step = run.step.map_or(String::new(), |step| step.to_string());
        table.row(std::iter::once(step).chain(run.outcomes.iter().map(|o| number(o.value))));
    }
    table.to_text()
}

/// Measures as a trace of one row a step; what failed is no number.
fn write(measured: &[Measured], file: &str, session: &mut Session) -> Result<(), Exit> {
    let stepped = measured.iter().any(|run| run.step.is_some());
    let mut names: Vec<String> = stepped.then(|| STEP.to_string()).into_iter().collect();
    names.extend(
        measured.iter().take(1).flat_map(|run| run.outcomes.iter().map(|o| o.name.clone())),
    );
    let mut trace = Trace::new(names, vec![]);
    for run in measured {
        let values = run.outcomes.iter().map(|outcome| outcome.value.unwrap_or(f64::NAN));
        let row: Vec<f64> = run.step.into_iter().chain(values).collect();
        // A trace takes every row.
        let _ = trace.row(&row);
    }
    let format = match formats::by_ending(file) {
        Some(format) if ["csv", "json"].contains(&format.name) => format,
        _ => {
            let message = format!("the ending of `{file}` says no format of measures");
            let error = Diagnostic::error("E0941", Span::NONE, message);
            return Err(session.fail(error.help("measures are written as .csv or .json")));
        }
    };
    let mut bytes = vec![];
    let written = (format.write)(&trace, &Heading::default(), &mut bytes);
    written.map_err(|error| session.unwritable(file, &error))?;
    write_text(Some(file), &String::from_utf8_lossy(&bytes), session)
}
