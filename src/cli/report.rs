//! `bondspice report MODEL.bg`: everything on one page.

use super::draw::power_devices;
use super::flags::ModelFlags;
use super::output::write_text;
use super::pipeline::{self, Question};
use super::session::{Exit, Session};
use super::watch::{self, Bar};
use crate::bond::causality;
use crate::bond::elaborate::Overrides;
use crate::diagnostic::{Severity, render};
use crate::draw::{bond_graph, schematic};
use crate::netlist::dialects::NGSPICE;
use crate::netlist::write;
use crate::report::{self, Card, Contents};
use crate::sim::{FailureKind, Progress, Statistics};
use crate::source::{FileId, SourceMap, Span};
use crate::trace::Trace;
use crate::verify::Report as Proof;
use std::collections::HashMap;
use std::sync::Arc;

/// What it does, in a line.
pub const ABOUT: &str =
    "Write a page about a model: waveforms, drawings, certificate, energy, netlist";

/// An example for the help.
pub const EXAMPLE: &str = "One HTML file that needs no network: interactive waveforms, bond graph and circuit, causality, the \
certificate of `verify`, energies, source and netlist with links between element, card and line.\n\n\
Example: bondspice report model.bg -o report.html\n         \
bondspice report model.bg --set L=2mH --until 1s --no-proof -o report.html";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// Where to write the page; without it to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// Leave out the certificate and the balance of energy, which need a second run
    #[arg(long)]
    no_proof: bool,
}

/// Writes the page.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (file, overrides) = arguments.model.of(&arguments.file, "reported on", session)?;
    let mut d = vec![];
    let model = pipeline::model(&mut session.map, file, &overrides, &mut d);
    session.say(d);
    let Some(model) = model else { return Err(session.exit()) };
    let (trace, statistics) = simulate(file, &overrides, session)?;
    let proof = match arguments.no_proof {
        true => None,
        false => Some(prove(file, &overrides, session)?),
    };
    let graph = graph(&model);
    let circuit = circuit(&model);
    let (netlist, map) = model.netlist(&session.map, &NGSPICE, true);
    let places = places(&model);
    let line = |of: &str| line(of, &places, &model, file, &session.map);
    let cards: Vec<Card> = map
        .cards
        .iter()
        .map(|card| Card {
            card: card.card.clone(),
            element: card.element.clone(),
            bond: card.bond.clone(),
            line: line(&card.element),
        })
        .collect();
    let kinds = model.graph.vertices.iter().map(|v| format!("{}:{}", v.kind, v.name));
    let lines = kinds.filter_map(|of| line(&of).map(|line| (of, line))).collect();
    let source = session.map.file(file).map_or(String::new(), |file| file.text.clone());
    let warned = session.said.iter().filter(|d| d.severity != Severity::Note);
    let warnings: Vec<String> =
        warned.map(|d| render::short(d, &session.map).trim_end().to_string()).collect();
    let causality = causality::to_text(&model.graph, &model.causality);
    let text = report::write(&Contents {
        name: &model.graph.name,
        source: &source,
        trace: &trace,
        statistics: counters(&statistics),
        graph,
        circuit,
        causality: &causality,
        proof: proof.as_ref(),
        netlist: &write::write(&netlist),
        cards: &cards,
        lines: &lines,
        warnings: &warnings,
    });
    write_text(arguments.output.as_deref(), &text, session)
}

/// Where junctions, elements and signals are declared, by name.
fn places(model: &pipeline::Model) -> HashMap<&str, Span> {
    let vertices = model.graph.vertices.iter().map(|vertex| (vertex.name.as_str(), vertex.span));
    let signals = model.graph.signals.iter().map(|signal| (signal.name.as_str(), signal.span));
    signals.chain(vertices).collect()
}

/// The line of the page's own text in which something is declared (`R:eta`, `signal alpha`), or the instance that it is a
/// part of where that has a text of its own.
fn line(
    of: &str,
    places: &HashMap<&str, Span>,
    model: &pipeline::Model,
    file: FileId,
    map: &SourceMap,
) -> Option<usize> {
    let name = of.rsplit([':', ' ']).next()?;
    let own = places.get(name).filter(|span| span.file == file);
    let instance = || model.graph.instances.get(name.split_once('.')?.0);
    let (line, _) = map.position(*own.or_else(instance)?)?;
    Some(line)
}

/// The run, all of it in memory.
fn simulate(
    file: FileId,
    overrides: &Overrides,
    session: &mut Session,
) -> Result<(Trace, Statistics), Exit> {
    let mut d = vec![];
    let run = pipeline::prepare(&mut session.map, file, overrides, None, &mut d);
    session.say(d);
    let Some(mut run) = run else { return Err(session.exit()) };
    let bar = Bar::new(session.global.quiet);
    let progress = bar.clone().map(|bar| Arc::new(move |part| bar.show(part)) as Progress);
    run.watch(watch::stop_flag(), progress);
    let mut trace = run.trace();
    let result = run.go(&mut trace);
    if let Some(bar) = bar {
        bar.clear();
    }
    match result {
        Ok(statistics) => {
            session.say(statistics.warnings.clone());
            Ok((trace, statistics))
        }
        Err(failure) if failure.kind == FailureKind::Interrupted => Err(Exit::Interrupted),
        Err(failure) => {
            session.say(failure.statistics.warnings.clone());
            session.say([*failure.diagnostic]);
            Err(session.exit())
        }
    }
}

fn prove(file: FileId, overrides: &Overrides, session: &mut Session) -> Result<Proof, Exit> {
    let mut d = vec![];
    let question = Question::default();
    let proof =
        pipeline::verify(&mut session.map, file, overrides, &question, &mut d, |settings| {
            settings.interrupt = Some(watch::stop_flag());
        });
    session.say(d);
    match proof {
        Ok(Some(proof)) => Ok(proof),
        Err(FailureKind::Interrupted) => Err(Exit::Interrupted),
        Ok(None) | Err(_) => Err(session.exit()),
    }
}

/// The bond graph, with instances closed as far as needed.
fn graph(model: &pipeline::Model) -> Result<crate::draw::picture::Picture, String> {
    let fits = bond_graph::fitting(&model.graph, &model.causality);
    let sketch =
        fits.map_err(|size| format!("{size} junctions and elements are too many for a picture"))?;
    let placed = bond_graph::place(&sketch);
    Ok(bond_graph::paint(&model.graph, &sketch, &placed))
}

fn circuit(model: &pipeline::Model) -> Result<crate::draw::picture::Picture, String> {
    let Some((circuit, _)) = model.circuit(&mut vec![]) else {
        return Err("there is no circuit".to_string());
    };
    let kept = power_devices(model, &circuit);
    let placed = schematic::place(&circuit, &|id| kept[id.0 as usize])
        .map_err(|devices| format!("{devices} devices are too many for a picture"))?;
    Ok(schematic::paint(&placed))
}

/// The counters of a run by name.
fn counters(statistics: &Statistics) -> Vec<(String, String)> {
    let text = statistics.to_json().to_string();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let rows = value.as_object().into_iter().flatten();
    let shown = |value: &serde_json::Value| match value {
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    rows.filter(|(name, _)| *name != "schema")
        .map(|(name, value)| (name.clone(), shown(value)))
        .collect()
}
