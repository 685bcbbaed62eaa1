//! A circuit that is ready to run: which analysis, over which steps, with which columns.

use super::fourier::Harmonics;
use super::measures::{self, Measured, Measuring, Taken};
use super::pipeline::{self, Deck, Language, Units};
use crate::bond::elaborate::Overrides;
use crate::circuit::stamps::{self, Stamps};
use crate::circuit::{Analysis, Axis, Circuit, Gradients, Sensitivity, sweep};
use crate::diagnostic::{Diagnostic, has_errors};
use crate::quantity::nearest;
use crate::sim::analyses::{self, ANALYSES, Job};
use crate::sim::{
    self, Failure, FailureKind, Interval, Progress, Seat, Settings, Statistics, System,
};
use crate::source::{FileId, SourceMap, Span};
use crate::trace::measure::Measure;
use crate::trace::{Sink, Trace};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A circuit that is ready to run.
pub struct Run {
    /// The title of the netlist.
    pub title: String,
    /// Headers of the columns, `step` first where there are steps, then time, frequency or what is swept.
    pub names: Vec<String>,
    /// Their units.
    pub units: Vec<String>,
    /// What the circuit comes down to.
    pub stamps: Stamps,
    /// The same, ready to be solved; with steps that of the first.
    pub system: System,
    /// How the transient is run; `None` for other analyses.
    pub settings: Option<Settings>,
    /// Analyses that the text asks for.
    pub analyses: usize,
    /// The one that is run.
    pub analysis: Analysis,
    /// Everything is run at each of these values.
    pub steps: Vec<Axis>,
    /// Headers of all columns, those that are only measured included.
    all: Vec<String>,
    circuit: Circuit,
    /// Tolerances of analyses without time.
    still: Settings,
    native: bool,
    deck: Option<Deck>,
}

/// From a text to a circuit ready to run. Of several analyses the last, unless one is picked by its name.
pub fn prepare(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    pick: Option<&str>,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    prepare_with(map, file, overrides, pick, &mut |_, _| {}, None, d)
}

/// The same, with a circuit that is completed before anything follows from it; and with a run that it may be like.
pub fn prepare_with(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    pick: Option<&str>,
    complete: Complete,
    like: Option<&Run>,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    if let Some(name) = pick
        && analyses::row(name).is_none()
    {
        d.push(unknown(name));
        return None;
    }
    if pipeline::language(map, file) == Language::Bond {
        let (mut circuit, units) = pipeline::circuit(map, file, overrides, d)?;
        complete(&mut circuit, d);
        if circuit.analyses.is_empty() {
            d.push(endless());
            return None;
        }
        return ready_like(circuit, &units, true, pick, like, d);
    }
    let deck = pipeline::deck(map, file, overrides, d)?;
    prepare_deck(deck, pick, complete, like, d)
}

/// Completes a circuit.
pub type Complete<'a> = &'a mut dyn FnMut(&mut Circuit, &mut Vec<Diagnostic>);

/// The same of a netlist that has been read.
pub fn prepare_deck(
    deck: Deck,
    pick: Option<&str>,
    complete: Complete,
    like: Option<&Run>,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    let mut circuit = deck.circuit(0, &[], pick, d)?;
    if !circuit.steps.is_empty() {
        let steps = std::mem::take(&mut circuit.steps);
        let mut said = vec![];
        let first = deck.circuit(0, &pairs(&steps, 0, &mut vec![]), pick, &mut said);
        let new: Vec<_> = said.into_iter().filter(|found| !says(d, found)).collect();
        d.extend(new);
        circuit = first?;
        circuit.steps = steps;
    }
    complete(&mut circuit, d);
    // Other values than these are asked for by steps, and by analyses that are not over time.
    let varies = !circuit.steps.is_empty() || !is_over_time(pick, &circuit);
    let units = deck.units.clone();
    let deck = varies.then_some(deck);
    let mut run = ready_like(circuit, &units, false, pick, like, d)?;
    run.deck = deck;
    Some(run)
}

/// Whether it is run over time, and nothing else is asked of that.
fn is_over_time(pick: Option<&str>, circuit: &Circuit) -> bool {
    let last = circuit.analyses.last();
    pick.map_or_else(|| matches!(last, Some(Analysis::Transient { .. })), |name| name == "tran")
}

/// That nothing says until when to simulate.
pub fn endless() -> Diagnostic {
    let message = "nothing says until when to simulate";
    let help = "add `simulate until 1 s step 1 ms` to the file, or --until and --step";
    Diagnostic::error("E0806", Span::NONE, message).help(help)
}

/// Names and values of a step.
fn pairs<'a>(steps: &'a [Axis], step: u64, values: &mut Vec<f64>) -> Vec<(&'a str, f64)> {
    sweep::values(steps, step, values);
    let names = steps.iter().flat_map(|axis| axis.names.iter().map(String::as_str));
    names.zip(values.iter().copied()).collect()
}

fn unknown(name: &str) -> Diagnostic {
    let names = || ANALYSES.iter().map(|row| row.name);
    let error = Diagnostic::error("E0944", Span::NONE, format!("no analysis is called `{name}`"));
    match nearest(name, names()) {
        Some(meant) => error.help(format!("did you mean `{meant}`?")),
        None => error.because(format!("known are {}", names().collect::<Vec<_>>().join(", "))),
    }
}

/// Makes a circuit ready to run. `native`: it comes from a bond graph.
pub fn ready(
    circuit: Circuit,
    units: &Units,
    native: bool,
    pick: Option<&str>,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    ready_like(circuit, units, native, pick, None, d)
}

/// The same; what was compiled for a run like it is not compiled again.
fn ready_like(
    mut circuit: Circuit,
    units: &Units,
    native: bool,
    pick: Option<&str>,
    like: Option<&Run>,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    let stamps = stamps::stamp(&circuit, d)?;
    let wanted = match pick {
        Some("op") => Some(Analysis::OperatingPoint),
        Some(name) => circuit.analyses.iter().rev().find(|a| a.name() == name).cloned(),
        None => circuit.analyses.last().cloned(),
    };
    let before = d.len();
    let point = matches!(wanted, Some(Analysis::OperatingPoint));
    let timed = match &wanted {
        None | Some(Analysis::Transient { .. }) => true,
        Some(Analysis::Sensitivity(own)) => matches!(*own.of, Analysis::Transient { .. }),
        _ => false,
    };
    let mut settings = None;
    let mut still = Settings::new(1.0);
    if timed && pick.is_none_or(|name| name == "tran" || wanted.is_some()) {
        settings = Some(Settings::of(&circuit, native, d)?);
    } else if !point {
        for (key, value) in &circuit.options {
            if let Err(found) = still.set(key, value) {
                d.push(*found);
            }
        }
    }
    // What the file's own options are wrong about has been said at their place.
    let (said, again) = d.split_at(before);
    let again: Vec<_> = again.iter().filter(|d| !says(said, d)).cloned().collect();
    d.truncate(before);
    d.extend(again);
    if has_errors(&d[before..]) {
        return None;
    }
    if let Some(settings) = &settings {
        limit_rows(settings, d)?;
    }
    let Some(analysis) = wanted else {
        let name = pick.unwrap_or("tran");
        let card = analyses::row(name).map_or("", |row| row.card);
        let message = format!("the netlist has no `.{name}`");
        d.push(Diagnostic::error("E0806", Span::NONE, message).help(format!("add `{card}`")));
        return None;
    };
    if circuit.steps.is_empty() && matches!(analysis, Analysis::Transient { .. }) {
        // All that follows is made of the stamps: of a large circuit the devices take as much memory as the run.
        circuit.devices = vec![];
    }
    let system = compiled(&analysis, &stamps, like, d)?;
    let row = analyses::row(analysis.name())?;
    let stepped = (!circuit.steps.is_empty()).then(|| ("step".to_string(), ""));
    let columns = stepped.into_iter().chain((row.columns)(&analysis, &circuit, &stamps));
    let (mut names, mut units): (Vec<String>, Vec<String>) = columns
        .map(|(name, unit)| {
            let unit = if unit.is_empty() { pipeline::unit_of(&name, units) } else { unit.into() };
            (name, unit)
        })
        .unzip();
    // An item may be what is swept, too.
    let leading = names.len().saturating_sub(circuit.outputs.len());
    let (swept, items) = names.split_at_mut(leading);
    for item in items.iter_mut().filter(|item| swept.contains(item)) {
        *item = format!("{{{item}}}");
    }
    let all = names.clone();
    names.truncate(measures::shown(&all));
    units.truncate(names.len());
    let mut seen = std::collections::HashSet::new();
    if let Some(name) = names.iter().find(|name| !seen.insert(name.as_str())) {
        let message = format!("two columns are called `{name}`");
        let help = "give one of them another name with `as`";
        d.push(Diagnostic::error("E0945", Span::NONE, message).help(help));
        return None;
    }
    let own = analysis.name();
    if let Some(other) = circuit.measures.iter().find(|measure| !measure.is_of(own)) {
        let message = format!("measures of `{}` are not taken: `{own}` is run", other.analysis);
        let warning = Diagnostic::warning("W0792", other.span, message);
        d.push(warning.help("pick the analysis with --analysis"));
    }
    if let Some(other) = circuit.harmonics.first().filter(|_| settings.is_none()) {
        let message = format!("there are no harmonics: `{own}` is run");
        let warning = Diagnostic::warning("W0793", other.span, message);
        d.push(warning.help("pick the run over time with --analysis tran"));
    }
    Some(Run {
        all,
        title: circuit.title.clone(),
        names,
        units,
        stamps,
        system,
        settings,
        analyses: rivals(&circuit, &analysis),
        analysis,
        steps: circuit.steps.clone(),
        circuit,
        still,
        native,
        deck: None,
    })
}

/// A circuit compiled for an analysis; not anew where what was compiled for a run over time serves with other sources.
fn compiled(
    analysis: &Analysis,
    stamps: &Stamps,
    like: Option<&Run>,
    d: &mut Vec<Diagnostic>,
) -> Option<System> {
    let over_time = |analysis: &Analysis| matches!(analysis, Analysis::Transient { .. });
    if !over_time(analysis) {
        return sim::compile(stamps, d);
    }
    let like = like.filter(|like| over_time(&like.analysis));
    let known = like.and_then(|like| sim::compile_like(stamps, &like.stamps, &like.system));
    known.or_else(|| sim::compile_for_run(stamps, d))
}

/// Analyses that could be run; the one that sensitivities go along with is none of its own.
fn rivals(circuit: &Circuit, run: &Analysis) -> usize {
    let along = |own: &Sensitivity| {
        own.gradients != Gradients::Plain && *own.of != Analysis::OperatingPoint
    };
    let goes_along = matches!(run, Analysis::Sensitivity(own) if along(own));
    circuit.analyses.len() - usize::from(goes_along)
}

/// Whether a warning or error has been said, wherever.
fn says(said: &[Diagnostic], diagnostic: &Diagnostic) -> bool {
    said.iter().any(|d| (d.code, &d.message) == (diagnostic.code, &diagnostic.message))
}

/// More rows than this are a slip of the pen.
const MOST_ROWS: f64 = 1e9;

fn limit_rows(settings: &Settings, d: &mut Vec<Diagnostic>) -> Option<()> {
    let Interval::Grid(step) = settings.rows else { return Some(()) };
    let span = settings.stop - settings.start;
    if span / step <= MOST_ROWS {
        return Some(());
    }
    let message = format!("a row every {step:e} s for {span:e} s: that is more than 1e9 rows");
    let error = Diagnostic::error("E0807", Span::NONE, message);
    d.push(error.help("end the run earlier (--until), or give a longer output interval (--step)"));
    None
}

impl Run {
    /// Lets a flag end the run, and tells of progress.
    pub fn watch(&mut self, interrupt: Arc<AtomicBool>, progress: Option<Progress>) {
        for settings in self.settings.iter_mut().chain([&mut self.still]) {
            settings.interrupt = Some(interrupt.clone());
            settings.progress = progress.clone();
        }
    }

    /// Gives back what the circuit was made of, unless it may have to be made again: with other values, or with all of its
    /// unknowns.
    pub fn give_back(&mut self) {
        if self.is_one_over_time() && self.deck.is_none() && !self.system.condensed {
            self.stamps.give_back();
        }
    }

    /// Of a run whose rows nobody keeps: where measures are of its end alone, none is made but the last.
    pub fn keep_no_rows(&mut self) {
        let ends = self.measures().all(|measure| measure.kind.is_of_end());
        let ends = ends && self.circuit.harmonics.is_empty();
        if let Some(settings) = self.settings.as_mut().filter(|_| ends) {
            settings.between = false;
        }
    }

    /// Runs, and sends rows to a sink.
    ///
    /// # Errors
    /// Why the run did not reach its end.
    pub fn go(&self, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
        self.go_measured(sink).0
    }

    /// Runs, and sends rows to a sink; also tells what was measured.
    pub fn go_measured(&self, sink: &mut dyn Sink) -> (Result<Statistics, Failure>, Taking) {
        let mut measuring = self.measuring(sink);
        let result = self.analyse(&mut measuring);
        let (measured, harmonics) = measuring.finish();
        (result, Taking { measured, harmonics })
    }

    /// The same beside other runs, where it is one over time.
    pub async fn go_beside(
        &self,
        sink: &mut dyn Sink,
        seat: Seat<'_>,
    ) -> (Result<Statistics, Failure>, Taking) {
        let Some(settings) = self.settings.as_ref().filter(|_| self.is_one_over_time()) else {
            return self.go_measured(sink);
        };
        let mut measuring = self.measuring(sink);
        let Run { stamps, system, .. } = self;
        let run = sim::run_in_company(stamps, system, settings, &mut measuring, Some(seat));
        let result = run.await;
        let (measured, harmonics) = measuring.finish();
        (result, Taking { measured, harmonics })
    }

    fn measuring<'s>(&'s self, sink: &'s mut dyn Sink) -> Measuring<'s> {
        let times = self.settings.as_ref().is_some_and(|s| s.rows != Interval::Steps);
        let own = self.analysis.name();
        let over_time = self.settings.as_ref().filter(|_| own == "tran");
        let taken = taken(&self.circuit, over_time);
        Measuring::new(sink, taken, own, &self.all, times)
    }

    fn is_one_over_time(&self) -> bool {
        matches!(self.analysis, Analysis::Transient { .. }) && self.steps.is_empty()
    }

    fn analyse(&self, sink: &mut Measuring) -> Result<Statistics, Failure> {
        if self.steps.is_empty() {
            let settings = self.settings.as_ref().unwrap_or(&self.still);
            return self.one(&self.circuit, &self.stamps, &self.system, settings, (0, &[]), sink);
        }
        let mut total = Statistics::default();
        let mut values = vec![];
        for step in 0..sweep::total(&self.steps) {
            let pairs = pairs(&self.steps, step, &mut values);
            let outcome = self.step(step, &pairs, sink);
            let outcome = outcome.map_err(|failure| at_step(failure, step, &pairs))?;
            let mut sum = outcome;
            sum.add(&total);
            total = sum;
        }
        Ok(total)
    }

    /// One step: the circuit with its values.
    fn step(
        &self,
        step: u64,
        pairs: &[(&str, f64)],
        to: &mut Measuring,
    ) -> Result<Statistics, Failure> {
        let base = self.settings.as_ref().unwrap_or(&self.still);
        if step == 0 {
            let mut sink = Stepped { to, row: vec![step as f64] };
            let at = (step, pairs);
            return self.one(&self.circuit, &self.stamps, &self.system, base, at, &mut sink);
        }
        let circuit = self.vary(step, pairs).map_err(input)?;
        let mut d = vec![];
        let stamps = stamps::stamp(&circuit, &mut d);
        let made = stamps.and_then(|stamps| {
            compiled(&self.analysis, &stamps, Some(self), &mut d).map(|system| (stamps, system))
        });
        let Some((stamps, system)) = made else { return Err(input(d)) };
        if stamps.outputs.len() != self.stamps.outputs.len() {
            let message = "this step has other columns than the first";
            return Err(input(vec![Diagnostic::error("E0810", Span::NONE, message)]));
        }
        let mut settings = base.clone();
        if self.settings.is_some() && circuit.analyses != self.circuit.analyses {
            let own = Settings::of(&circuit, self.native, &mut d).ok_or_else(|| input(d))?;
            let Settings { rows, interrupt, progress, .. } = settings;
            settings = Settings { rows, interrupt, progress, ..own };
        }
        to.follow(taken(&circuit, self.settings.is_some().then_some(&settings)));
        let mut sink = Stepped { to, row: vec![step as f64] };
        self.one(&circuit, &stamps, &system, &settings, (step, pairs), &mut sink)
    }

    fn one(
        &self,
        circuit: &Circuit,
        stamps: &Stamps,
        system: &System,
        settings: &Settings,
        (step, pairs): (u64, &[(&str, f64)]),
        sink: &mut dyn Sink,
    ) -> Result<Statistics, Failure> {
        let name = self.analysis.name();
        let own = circuit.analyses.iter().rev().find(|analysis| analysis.name() == name);
        let vary = |more: &[(&str, f64)]| {
            let all: Vec<(&str, f64)> = pairs.iter().chain(more).copied().collect();
            self.vary(step, &all)
        };
        // Frequencies of the command line stay in every step.
        let own = own.filter(|_| !matches!(self.analysis, Analysis::Ac { .. }));
        let analysis = own.unwrap_or(&self.analysis);
        let job = Job { circuit, stamps, system, analysis, settings, vary: &vary };
        match analyses::row(name) {
            Some(row) => (row.run)(&job, sink),
            None => Err(input(vec![unknown(name)])),
        }
    }

    /// The circuit with other values.
    fn vary(&self, step: u64, pairs: &[(&str, f64)]) -> Result<Circuit, Vec<Diagnostic>> {
        let mut d = vec![];
        let made = match &self.deck {
            Some(deck) => deck.circuit(step, pairs, Some(self.analysis.name()), &mut d),
            None => None,
        };
        made.ok_or(d)
    }

    /// What it measures.
    pub fn measures(&self) -> impl Iterator<Item = &Measure> {
        let own = self.analysis.name();
        self.circuit.measures.iter().filter(move |measure| measure.is_of(own))
    }

    /// An empty trace with this run's columns.
    pub fn trace(&self) -> Trace {
        Trace::new(self.names.clone(), self.units.clone())
    }
}

/// What was taken from the rows of a run.
pub struct Taking {
    /// Measures.
    pub measured: Vec<Measured>,
    /// Harmonics.
    pub harmonics: Vec<Harmonics>,
}

/// What a circuit wants to be taken from rows; `settings` are those of a run over time.
fn taken<'c>(circuit: &'c Circuit, settings: Option<&Settings>) -> Taken<'c> {
    Taken {
        measures: &circuit.measures,
        harmonics: if settings.is_some() { &circuit.harmonics } else { &[] },
        stop: settings.map_or(0.0, |settings| settings.stop),
    }
}

/// A failure for what is wrong with the circuit of a step.
fn input(found: Vec<Diagnostic>) -> Failure {
    sim::analyses::no_circuit(found, &Statistics::default())
}

fn at_step(mut failure: Failure, step: u64, pairs: &[(&str, f64)]) -> Failure {
    let values: Vec<String> =
        pairs.iter().map(|(name, value)| format!("{name} = {value:e}")).collect();
    if failure.kind != FailureKind::Output {
        failure.diagnostic.notes.push(format!("in step {step}: {}", values.join(", ")));
    }
    failure
}

/// Puts the number of the step before each row.
struct Stepped<'a> {
    to: &'a mut dyn Sink,
    row: Vec<f64>,
}

impl Stepped<'_> {
    fn number(&mut self, values: &[f64]) {
        self.row.truncate(1);
        self.row.extend_from_slice(values);
    }
}

impl Sink for Stepped<'_> {
    fn row(&mut self, values: &[f64]) -> std::io::Result<()> {
        self.number(values);
        self.to.row(&self.row)
    }

    fn step(&mut self, values: &[f64]) -> std::io::Result<()> {
        self.number(values);
        self.to.step(&self.row)
    }
}

/// Runs a text from memory; its name's ending says what it is written in. For tests and small programs.
///
/// # Errors
/// Everything that was said, errors and warnings.
pub fn run_text(
    name: &str,
    text: &str,
    overrides: &Overrides,
) -> Result<(Trace, Statistics), Vec<Diagnostic>> {
    let mut map = SourceMap::default();
    let file = map.add(name, text);
    let mut d = vec![];
    let Some(run) = prepare(&mut map, file, overrides, None, &mut d) else { return Err(d) };
    let mut trace = run.trace();
    match run.go(&mut trace) {
        Ok(statistics) => Ok((trace, statistics)),
        Err(failure) => {
            d.push(*failure.diagnostic);
            Err(d)
        }
    }
}
