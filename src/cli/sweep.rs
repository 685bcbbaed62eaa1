//! `bondspice sweep PLAN|MODEL`: many runs with other parameters, and what is measured in each.

mod rows;
mod runner;

use self::rows::{Table, merge};
use self::runner::Runner;
use super::flags::{DeckFlags, ModelFlags};
use super::pipeline::{Language, language};
use super::session::{Exit, Session};
use super::watch::{self, Bar};
use crate::analysis::sweep::axis::FORMS;
use crate::analysis::sweep::measure::{FUNCTIONS, Wanted};
use crate::analysis::sweep::plan::{self, Plan};
use crate::analysis::sweep::shard::Shard;
use crate::analysis::sweep::{Axis, Reading, Space};
use crate::bond::elaborate::Overrides;
use crate::diagnostic::{Diagnostic, has_errors};
use crate::quantity::Unit;
use crate::sim::Group;
use crate::source::{FileId, Span};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;

/// What it does, in a line.
pub const ABOUT: &str = "Run a model many times with other parameters, and measure each run";

/// An example for the help.
pub const EXAMPLE: &str = "\
Values: L=1mH,2mH  L=1mH..3mH:5  L=1mH..100mH:7:log  L=normal(2mH, 0.1mH)  L=uniform(1mH, 3mH)
Measures: max min pp mean rms integral max_at min_at (ITEM, [FROM, TO]), initial final (ITEM), at(ITEM, TIME), \
rise fall cross (ITEM, LEVEL, [AFTER]); the .measure cards of a netlist count too. Levels are in the unit of their item.
The result is a table of runs as CSV: run, parameters in SI, measures. It has the same bytes for any number of threads. \
A sweep that was interrupted leaves OUT.partial, and --resume goes on from there. In an array of a batch system (Slurm, SGE, \
LSF) each task makes its own part, and --merge puts the parts together.

Example: bondspice sweep models/eha_one_line.bg --vary 'L=1mH..3mH:5' --measure 'peak=max(f(armature))'
         bondspice sweep plan.toml -o out.csv
         bondspice sweep plan.toml -o out.csv --shard 2/4
         bondspice sweep --merge out.*of4.csv -o out.csv";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// A plan (.toml), a bond graph (.bg) or a netlist; with --merge the parts of a result
    #[arg(required = true)]
    files: Vec<String>,
    #[command(flatten)]
    model: ModelFlags,
    #[command(flatten)]
    deck: DeckFlags,
    /// Vary a parameter: NAME=LIST|RANGE|DISTRIBUTION (repeatable; the last runs fastest)
    #[arg(long, value_name = "NAME=VALUES")]
    vary: Vec<String>,
    /// Take this from each run: peak=max(x) (repeatable)
    #[arg(long, value_name = "NAME=MEASURE")]
    measure: Vec<String>,
    /// Samples of random values, at each point of the grid
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// What random values follow from
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Threads, each of which makes up to four runs at a time; without it as many as there are processors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Make only part K of N; OUT becomes OUT.KofN. In an array of a batch system its task says so
    #[arg(long, value_name = "K/N")]
    shard: Option<String>,
    /// Go on from OUT.partial, where a sweep before was stopped
    #[arg(long, requires = "output")]
    resume: bool,
    /// Write the trace of each run into this folder, as run-K.csv
    #[arg(long, value_name = "DIR")]
    traces: Option<String>,
    /// Put the parts of a result together
    #[arg(long)]
    merge: bool,
    /// Where to write the table of runs, as CSV
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Sweeps, or merges.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let outcome = match arguments.merge {
        true => merge(&arguments.files, arguments.output.as_deref(), session),
        false => sweep(&arguments, session),
    };
    match outcome {
        Ok(exit) | Err(exit) => exit,
    }
}

/// A sweep that is ready to be made.
struct Sweep {
    file: FileId,
    overrides: Overrides,
    space: Space,
    measures: Vec<(Wanted, Span)>,
}

fn sweep(arguments: &Arguments, session: &mut Session) -> Result<Exit, Exit> {
    let sweep = prepare(arguments, session)?;
    let shard = shard(arguments, session)?;
    let output = match (&arguments.output, shard) {
        (Some(name), Some(shard)) => Some(shard.file(name)),
        (name, _) => name.clone(),
    };
    let part = Part { shard: shard.unwrap_or(Shard::WHOLE), total: sweep.space.runs() };
    let mut runner = Runner::new(&sweep, arguments.traces.as_deref(), session)?;
    let mut d = vec![];
    // Whatever is wrong with all runs is said once, by the first of them.
    let first = part.run(0).unwrap_or(0);
    let header = runner.header(first, &mut session.map, &mut d);
    session.say(d);
    let Some(header) = header else { return Err(session.exit()) };
    let mut table = Table::open(output.as_deref(), &header, session)?;
    let done = match arguments.resume {
        true => table.resume(part, &sweep.space, session)?,
        false => 0,
    };
    table.begin(session)?;
    go(arguments, &runner, (part, done), &mut table, session)
}

/// The runs that are made here.
#[derive(Clone, Copy)]
struct Part {
    shard: Shard,
    total: u64,
}

impl Part {
    fn run(self, at: u64) -> Option<u64> {
        self.shard.run(at, self.total)
    }

    fn runs(self) -> u64 {
        self.shard.runs(self.total)
    }
}

/// Makes the runs, and writes their rows in order.
fn go(
    arguments: &Arguments,
    runner: &Runner,
    (part, done): (Part, u64),
    table: &mut Table,
    session: &mut Session,
) -> Result<Exit, Exit> {
    let processors = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = arguments.threads.map_or_else(processors, |threads| threads as usize);
    let threads = threads.min((part.runs() - done) as usize).max(1);
    // No thread has more of the runs than its part.
    let abreast = (part.runs() - done).div_ceil(threads as u64) as usize;
    let stop = watch::stop_flag();
    let bar = Bar::new(session.global.quiet);
    let next = AtomicU64::new(done);
    let (sender, receiver) = mpsc::sync_channel(4 * threads);
    let mut failed: Vec<(u64, Diagnostic)> = vec![];
    let map = session.map.clone();
    let written = std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, map, stop) = (sender.clone(), &next, &map, &stop);
            let work = move || {
                let begin = |seat| {
                    let at = match stop.load(Ordering::Relaxed) {
                        true => return None,
                        false => next.fetch_add(1, Ordering::Relaxed),
                    };
                    let run = part.run(at)?;
                    Some(async move { (at, runner.run(run, map, stop, seat).await) })
                };
                Group::default().run(abreast, begin, |outcome| sender.send(outcome).is_ok());
            };
            // As deep as the main thread: trees are walked by recursion.
            let builder = std::thread::Builder::new().stack_size(super::STACK);
            builder.spawn_scoped(scope, work)?;
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let mut due = done;
        for (at, outcome) in receiver {
            waiting.insert(at, outcome);
            while let Some(outcome) = waiting.remove(&due) {
                let Some(mut row) = outcome else { return Ok(false) };
                failed.extend(row.failure.take().map(|why| (row.run, *why)));
                table.row(&row)?;
                due += 1;
                if let Some(bar) = &bar {
                    bar.show(due as f64 / part.runs() as f64);
                }
            }
        }
        Ok(due == part.runs())
    });
    if let Some(bar) = bar {
        bar.clear();
    }
    let whole = written.map_err(|error| table.unwritable(&error, session))?;
    say_failures(failed, session);
    if !whole {
        let hint = table.partial().map_or(String::new(), |name| {
            format!("; `{name}` holds the runs so far, --resume goes on")
        });
        session.remark(&format!("interrupted{hint}"));
        return Err(Exit::Interrupted);
    }
    table.close(session)?;
    Ok(session.exit())
}

/// The first failure in full, the others by their numbers.
fn say_failures(failed: Vec<(u64, Diagnostic)>, session: &mut Session) {
    let count = failed.len();
    let numbers: Vec<String> = failed.iter().take(10).map(|(run, _)| run.to_string()).collect();
    let Some((run, mut first)) = failed.into_iter().next() else { return };
    first.notes.push(format!("in run {run}"));
    session.say([first]);
    if count > 1 {
        let more = if count > numbers.len() { ", …" } else { "" };
        let message = format!("{count} runs failed: {}{more}", numbers.join(", "));
        let warning = Diagnostic::warning("W1200", Span::NONE, message);
        session.say([warning.because("their measures are empty")]);
    }
}

/// Reads plan and flags.
fn prepare(arguments: &Arguments, session: &mut Session) -> Result<Sweep, Exit> {
    let [name] = &arguments.files[..] else {
        let message = "a sweep takes one plan or one model";
        return Err(session.fail(
            Diagnostic::error("E0940", Span::NONE, message)
                .help("--merge takes the parts of a result"),
        ));
    };
    let mut plan = Plan::default();
    let mut model = name.clone();
    if name.ends_with(".toml") {
        let file = session.load(name)?;
        let mut d = vec![];
        plan = plan::read(&session.map, file, &mut d);
        let whole = Span::new(file, 0, 0);
        match &plan.model {
            Some((text, _)) => model = session.map.beside(file, text),
            None if !has_errors(&d) => {
                let error = Diagnostic::error("E1201", whole, "the plan names no model");
                d.push(error.help("add `model = \"name.bg\"` at its top"));
            }
            None => {}
        }
        let wrong = has_errors(&d);
        session.say(d);
        if wrong {
            return Err(session.exit());
        }
    }
    let mut overrides = arguments.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    overrides.until = overrides.until.or(plan.until.take());
    overrides.step = overrides.step.or(plan.step.take());
    overrides.observe = overrides.observe.or(plan.observe.take());
    // Of two options of one name the last holds: that of the command line.
    let options = std::mem::take(&mut overrides.options);
    overrides.options = plan.options.drain(..).chain(options).collect();
    let mut d = vec![];
    add_flags(arguments, &mut plan, &mut d);
    let file = session.load(&model)?;
    let bond = language(&session.map, file) == Language::Bond;
    let read = |text: &str| reading(text, bond);
    let axes: Vec<Axis> = plan.axes.iter().map(|(axis, _)| axis.clone()).collect();
    let runs = arguments.runs.or(plan.runs);
    let space = Space::new(&axes, runs, arguments.seed.or(plan.seed).unwrap_or(0), &read);
    let space = space.map_err(|(axis, why)| {
        let place = axis.and_then(|at| plan.axes.get(at)).map_or(Span::NONE, |(_, span)| *span);
        let name = axis.and_then(|at| axes.get(at)).map(|axis| format!("`{}`: ", axis.name));
        d.push(Diagnostic::error("E1202", place, name.unwrap_or_default() + &why));
    });
    let wrong = has_errors(&d);
    session.say(d);
    match space {
        Ok(space) if !wrong => Ok(Sweep { file, overrides, space, measures: plan.measures }),
        _ => Err(session.exit()),
    }
}

/// What the command line adds to a plan; an axis of the same name takes the other's place.
fn add_flags(arguments: &Arguments, plan: &mut Plan, d: &mut Vec<Diagnostic>) {
    for text in &arguments.vary {
        match Axis::parse(text) {
            Ok(axis) => {
                // `--vary` twice for one name is an error of its own.
                plan.axes.retain(|(other, span)| other.name != axis.name || span.is_none());
                plan.axes.push((axis, Span::NONE));
            }
            Err(why) => {
                let error =
                    Diagnostic::error("E1202", Span::NONE, format!("--vary `{text}`: {why}"));
                d.push(error.help(format!("it takes NAME= and {FORMS}")));
            }
        }
    }
    for text in &arguments.measure {
        match Wanted::parse_flag(text) {
            Ok(wanted) => {
                plan.measures.retain(|(other, span)| other.name != wanted.name || span.is_none());
                plan.measures.push((wanted, Span::NONE));
            }
            Err(why) => {
                let error = Diagnostic::error("E1203", Span::NONE, format!("--measure: {why}"));
                let names: Vec<&str> = FUNCTIONS.iter().map(|row| row.name).collect();
                d.push(error.help(format!("it takes NAME=MEASURE(ITEM): {}", names.join(", "))));
            }
        }
    }
}

/// A number as the model's language writes it.
fn reading(text: &str, bond: bool) -> Result<Reading, String> {
    if bond {
        return Reading::of(text, &|unit| Unit::parse(unit).ok().map(|unit| unit.factor));
    }
    let mut said = vec![];
    match super::deck::number(text, "the sweep", &mut said) {
        Some(number) => Ok(Reading { number, unit: String::new(), factor: 1.0 }),
        None => Err(format!("`{text}` is no number")),
    }
}

/// The part of the sweep that this process makes.
fn shard(arguments: &Arguments, session: &mut Session) -> Result<Option<Shard>, Exit> {
    match &arguments.shard {
        Some(text) => Shard::parse(text).map(Some).map_err(|why| {
            session.fail(Diagnostic::error("E0940", Span::NONE, format!("--shard: {why}")))
        }),
        None => Ok(Shard::of_task(&|name| std::env::var(name).ok())),
    }
}
