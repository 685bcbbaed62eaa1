//! `bondspice reduce MODEL.bg`: elements by their activity over a run, and what leaving out the least active costs.

use super::flags::ModelFlags;
use super::output::write_text;
use super::pipeline;
use super::run::ready;
use super::session::{Exit, Session};
use super::table::{Table, short};
use super::watch;
use crate::analysis::activity::{Activities, metered};
use crate::bond::elaborate::Overrides;
use crate::bond::graph::{BondGraph, VertexId};
use crate::bond::transform::flat::flat_name;
use crate::bond::transform::remove::without;
use crate::bond::transform::{Trouble, Work};
use crate::diagnostic::{Diagnostic, Severity};
use crate::sim::FailureKind;
use crate::source::{FileId, Span};
use crate::trace::Trace;
use crate::trace::compare::{Settings, compare};
use serde_json::{Value, json};

/// What it does, in a line.
pub const ABOUT: &str =
    "Leave out the elements that a run hardly uses, and measure what that costs";

/// An example for the help.
pub const EXAMPLE: &str = "\
The activity of an element is the energy that passes it over the run in whatever direction. Elements are kept, the most
active first, until they make up the part --keep of all activity; the others are left out, unless something reads them.
Both models are run: the error is the largest difference of any column in per cent of its range.

Example: bondspice reduce models/eha_two_line.bg --keep 0.9999,0.999,0.99,0.9
         bondspice reduce models/eha_two_line.bg --keep 0.99 -o less.bg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// Parts of all activity that are kept: 0.99, or several, 0.999,0.99,0.9
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.99")]
    keep: Vec<String>,
    /// Form of the tables
    #[arg(long, value_name = "FORM", value_parser = ["text", "json"], default_value = "text")]
    format: String,
    /// Where to write the reduced model; takes one --keep
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Measures, reduces, and shows.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let keeps = keeps(&arguments.keep, session)?;
    if arguments.output.is_some() && keeps.len() > 1 {
        let message = "-o writes one model: give --keep one number";
        return Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)));
    }
    let (file, overrides) = arguments.model.of(&arguments.file, "reduced", session)?;
    let mut d = vec![];
    let graph = pipeline::graph(&mut session.map, file, &overrides, &mut d);
    session.say(d);
    let Some(graph) = graph else { return Err(session.exit()) };
    let trace = go(metered(&graph), &|d| d, session)?;
    let activities = Activities::of(&graph, &trace);
    // What is left of each element is the same whatever else goes: the fewest first.
    let mut all = vec![];
    for keep in keeps {
        all.push(without_least(keep, file, &graph, &activities, &trace, &overrides, session)?);
    }
    if let (Some(to), [only]) = (&arguments.output, all.as_slice()) {
        write_text(Some(to), &only.text, session)?;
    }
    let text = match arguments.format.as_str() {
        "json" => format!("{:#}\n", to_json(&graph, &activities, &all)),
        _ => to_text(&graph, &activities, &all, trace.time().last().copied().unwrap_or(0.0)),
    };
    write_text(None, &text, session)
}

/// A model with fewer elements, and what that costs.
struct Reduced {
    keep: f64,
    text: String,
    /// Elements left out, and those that would be, and why they stay.
    out: Vec<String>,
    stay: Vec<(String, String)>,
    /// By column, in parts of its range.
    errors: Vec<(String, f64)>,
}

fn keeps(texts: &[String], session: &mut Session) -> Result<Vec<f64>, Exit> {
    let read =
        |text: &String| text.trim().parse::<f64>().ok().filter(|part| *part > 0.0 && *part <= 1.0);
    let found: Option<Vec<f64>> = texts.iter().map(read).collect();
    found.ok_or_else(|| {
        let message = format!(
            "--keep takes parts above 0 and up to 1, as in 0.99, not `{}`",
            texts.join(",")
        );
        session.fail(Diagnostic::error("E0940", Span::NONE, message))
    })
}

/// What is wrong: what a smaller model is warned of was not asked.
fn errors_of(d: Vec<Diagnostic>) -> Vec<Diagnostic> {
    d.into_iter().filter(|said| said.severity == Severity::Error).collect()
}

/// Runs a graph; `heard` says what of its diagnostics is said.
fn go(
    graph: BondGraph,
    heard: &dyn Fn(Vec<Diagnostic>) -> Vec<Diagnostic>,
    session: &mut Session,
) -> Result<Trace, Exit> {
    let mut d = vec![];
    let run = pipeline::model_of(graph, &session.map, &mut d).and_then(|model| {
        let (circuit, units) = model.circuit(&mut d)?;
        if circuit.analyses.is_empty() {
            let message = "activities are those over a run, and nothing says until when";
            let help = "add `simulate until 1 s step 1 ms` to the file, or --until and --step";
            d.push(Diagnostic::error("E0806", Span::NONE, message).help(help));
            return None;
        }
        ready(circuit, &units, true, None, &mut d)
    });
    session.say(heard(d));
    let Some(mut run) = run else { return Err(session.exit()) };
    run.watch(watch::stop_flag(), None);
    let mut trace = run.trace();
    match run.go(&mut trace) {
        Ok(_) => Ok(trace),
        Err(failure) if failure.kind == FailureKind::Interrupted => Err(Exit::Interrupted),
        Err(failure) => {
            session.say([*failure.diagnostic]);
            Err(session.exit())
        }
    }
}

fn without_least(
    keep: f64,
    file: FileId,
    graph: &BondGraph,
    activities: &Activities,
    trace: &Trace,
    overrides: &Overrides,
    session: &mut Session,
) -> Result<Reduced, Exit> {
    let least: Vec<VertexId> =
        activities.elements[activities.kept(keep)..].iter().rev().map(|one| one.element).collect();
    let mut found =
        Reduced { keep, text: String::new(), out: vec![], stay: vec![], errors: vec![] };
    let mut d = vec![];
    let Some(mut work) = Work::begin(&mut session.map, file, &overrides.folders, &mut d) else {
        session.say(d);
        return Err(session.exit());
    };
    for element in &least {
        let name = &graph.vertex(*element).name;
        // It may have gone with a junction.
        if work.source.find(name).is_err() {
            found.out.push(name.clone());
            continue;
        }
        let takes = activities.takes(graph, *element, &|id| least.contains(&id));
        let takes = &graph.vertex(takes).name;
        match leave_out(&mut work, takes) {
            Ok(()) => found.out.push(name.clone()),
            Err(trouble) => found.stay.push((name.clone(), trouble.message.clone())),
        }
    }
    found.text = work.source.text.clone();
    let (smaller, opened) = (work.source.file, work.opened);
    let overrides = if opened { renamed(graph, overrides) } else { overrides.clone() };
    let mut d = vec![];
    let graph = pipeline::graph(&mut session.map, smaller, &overrides, &mut d);
    session.say(errors_of(d));
    let Some(graph) = graph else { return Err(session.exit()) };
    let less = go(graph, &errors_of, session)?;
    found.errors = errors(trace, &less);
    Ok(found)
}

/// What the command line says, in the names of a model that is laid open.
fn renamed(graph: &BondGraph, overrides: &Overrides) -> Overrides {
    let vertices = graph.vertices.iter().map(|vertex| vertex.name.as_str());
    let signals = graph.signals.iter().map(|signal| signal.name.as_str());
    let mut names: Vec<&str> = vertices.chain(signals).filter(|name| name.contains('.')).collect();
    // What begins with another name comes before it.
    names.sort_by_key(|name| std::cmp::Reverse(name.len()));
    let spell = |text: &String| {
        names.iter().fold(text.clone(), |text, name| text.replace(name, &flat_name(name)))
    };
    Overrides {
        observe: overrides.observe.as_ref().map(spell),
        set: overrides.set.iter().map(|(key, value)| (flat_name(key), value.clone())).collect(),
        ..overrides.clone()
    }
}

fn leave_out(work: &mut Work, name: &str) -> Result<(), Trouble> {
    work.change(&|source| without(source, source.find(name)?))
}

/// By column that the second has, too, the largest difference in parts of the range that it has in the first.
fn errors(whole: &Trace, less: &Trace) -> Vec<(String, f64)> {
    let found = compare(less, whole, &Settings::default());
    found.signals.into_iter().map(|signal| (signal.name, signal.max)).collect()
}

fn worst(errors: &[(String, f64)]) -> Option<&(String, f64)> {
    errors.iter().max_by(|a, b| a.1.total_cmp(&b.1))
}

fn to_text(graph: &BondGraph, activities: &Activities, all: &[Reduced], until: f64) -> String {
    let mut table = Table::new(&["element", "activity J", "per cent", "together"]);
    let mut sum = 0.0;
    for one in &activities.elements {
        sum += one.index;
        let vertex = graph.vertex(one.element);
        table.row([
            format!("{}:{}", vertex.kind, vertex.name),
            short(one.joules),
            format!("{:.4}", 100.0 * one.index),
            format!("{:.4}", 100.0 * sum),
        ]);
    }
    let mut text = format!(
        "{} over {} s: {} elements, activity {} J\n\n{}",
        graph.name,
        short(until),
        activities.elements.len(),
        short(activities.total),
        table.to_text()
    );
    let mut table = Table::new(&["keep", "elements", "of", "error %", "largest in"]);
    for one in all {
        let (name, error) = worst(&one.errors).cloned().unwrap_or(("-".into(), 0.0));
        table.row([
            short(one.keep),
            (activities.elements.len() - one.out.len()).to_string(),
            activities.elements.len().to_string(),
            short(100.0 * error),
            name,
        ]);
    }
    text += "\n";
    text += &table.to_text();
    if let [only] = all {
        let mut table = Table::new(&["column", "error %"]);
        for (name, error) in &only.errors {
            table.row([name.clone(), short(100.0 * error)]);
        }
        text += "\n";
        text += &table.to_text();
        let out = if only.out.is_empty() { "nothing".into() } else { only.out.join(", ") };
        text += &format!("\nleft out: {out}\n");
        for (name, why) in &only.stay {
            text += &format!("{name} stays: {why}\n");
        }
    }
    text
}

fn to_json(graph: &BondGraph, activities: &Activities, all: &[Reduced]) -> Value {
    let name = |id: VertexId| graph.vertex(id).name.clone();
    let elements = activities.elements.iter().map(
        |one| json!({"element": name(one.element), "activity": one.joules, "index": one.index}),
    );
    let reduced = all.iter().map(|one| {
        let errors: serde_json::Map<String, Value> =
            one.errors.iter().map(|(name, error)| (name.clone(), json!(error))).collect();
        let stay = one.stay.iter().map(|(name, why)| json!({"element": name, "why": why}));
        json!({
            "keep": one.keep,
            "elements": activities.elements.len() - one.out.len(),
            "left_out": one.out,
            "stay": stay.collect::<Vec<_>>(),
            "error": worst(&one.errors).map(|worst| worst.1),
            "errors": errors,
        })
    });
    json!({
        "schema": 1,
        "model": graph.name,
        "total": activities.total,
        "elements": elements.collect::<Vec<_>>(),
        "reduced": reduced.collect::<Vec<_>>(),
    })
}
