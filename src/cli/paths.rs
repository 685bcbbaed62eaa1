//! `bondspice paths MODEL.bg`: causal paths and loops with their gains, and what resonates.

use super::linear::{PointFlags, WayFlags};
use super::output::write_text;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::analysis::linear::Linear;
use crate::analysis::paths::{Flow, Way, flow, names, sink, source};
use crate::analysis::resonance::{Resonance, resonances};
use crate::analysis::symbolic::{print, transfer};
use crate::bond::graph::BondGraph;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use serde_json::{Value, json};

/// What it does, in a line.
pub const ABOUT: &str = "Show causal paths and loops with their gains, and which storages resonate";

/// An example for the help.
pub const EXAMPLE: &str = "\
A path leads from one variable to the next that it gives, as causality has it. Of pairs of storages that resonate frequency
and damping are those of the two alone; the dissipators that damp them are listed, the strongest first.

Example: bondspice paths models/rlc.bg
         bondspice paths models/eha_fig13.bg --from 'f(feed)' --to 'f(surface)'";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    #[command(flatten)]
    way: WayFlags,
    /// Form of the result
    #[arg(long, value_name = "FORM", value_parser = ["text", "json"], default_value = "text")]
    format: String,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// A gain of more letters is told by its number.
const LONGEST: usize = 100;

/// Finds them and shows them.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let named = arguments.way.named(&arguments.point, session)?;
    let (graph, linear) = (&named.graph, &named.linear);
    let states = (0..linear.states).filter(|k| linear.stores(*k)).count();
    let found = find(graph, linear, arguments.way.given());
    let found = found.map_err(|trouble| session.fail(*transfer::explain(trouble, states)))?;
    if found.paths.as_ref().is_some_and(Vec::is_empty) {
        let (from, to) = (&linear.inputs[0].name, &linear.outputs[0].name);
        let message = format!("no causal path leads from {from} to {to}");
        let error = Diagnostic::error("E0928", Span::NONE, message);
        return Err(
            session.fail(error.help("at this point slopes may be 0: choose another with --at"))
        );
    }
    let resonances = resonances(graph, linear).map_err(|error| session.fail(*error))?;
    let found = Found { resonances, ..found };
    let text = match arguments.format.as_str() {
        "json" => format!("{:#}\n", to_json(graph, linear, &found)),
        _ => to_text(graph, linear, &found),
    };
    write_text(arguments.output.as_deref(), &text, session)
}

struct Found {
    paths: Option<Vec<Way>>,
    loops: Vec<Way>,
    flow: Flow,
    resonances: Vec<Resonance>,
}

fn find(
    graph: &BondGraph,
    linear: &Linear,
    ways: bool,
) -> Result<Found, crate::analysis::symbolic::symbols::Trouble> {
    let flow = flow(graph, linear)?;
    let paths = ways.then(|| flow.paths(source(linear), sink(linear))).transpose()?;
    let loops = flow.loops()?;
    Ok(Found { paths, loops, flow, resonances: vec![] })
}

fn damped(graph: &BondGraph, resonance: &Resonance) -> Vec<String> {
    resonance.damped_by.iter().map(|(id, _)| graph.vertex(*id).name.clone()).collect()
}

fn to_text(graph: &BondGraph, linear: &Linear, found: &Found) -> String {
    let mut text = String::new();
    let gain = |way: &Way| {
        let text = print::ratio(&way.gain, &found.flow.symbols);
        match text.len() <= LONGEST {
            true => text,
            false => {
                let values: Vec<f64> = found.flow.symbols.iter().map(|s| s.value).collect();
                let (factor, power) = way.gain.power_of_s(&values);
                match power {
                    0 => short(factor),
                    1 => format!("{} s", short(factor)),
                    -1 => format!("{}/s", short(factor)),
                    power if power > 0 => format!("{} s^{power}", short(factor)),
                    power => format!("{}/s^{}", short(factor), -power),
                }
            }
        }
    };
    let mut list = |title: &str, ways: &[Way], closed: bool| {
        text += &format!("{title}\n");
        for way in ways {
            let mut names = names(graph, linear, way);
            if closed {
                names.extend(names.first().cloned());
            }
            text += &format!("  {}\n      gain {}\n", names.join(" -> "), gain(way));
        }
        if ways.is_empty() {
            text += "  none\n";
        }
        text += "\n";
    };
    if let Some(paths) = &found.paths {
        let (from, to) = (&linear.inputs[0].name, &linear.outputs[0].name);
        list(&format!("paths from {from} to {to}"), paths, false);
    }
    list("loops", &found.loops, true);
    let mut table = Table::new(&["resonance", "Hz", "damping", "damped by"]);
    for resonance in &found.resonances {
        let names = resonance.storages.map(|k| linear.unknowns[k].name.clone());
        table.row([
            names.join(" with "),
            short(resonance.omega / std::f64::consts::TAU),
            short(resonance.damping),
            damped(graph, resonance).join(", "),
        ]);
    }
    text += &if table.is_empty() { "no storages resonate\n".to_string() } else { table.to_text() };
    text
}

fn to_json(graph: &BondGraph, linear: &Linear, found: &Found) -> Value {
    let values: Vec<f64> = found.flow.symbols.iter().map(|symbol| symbol.value).collect();
    let way = |way: &Way| {
        let (factor, power) = way.gain.power_of_s(&values);
        json!({
            "through": names(graph, linear, way),
            "gain": print::ratio(&way.gain, &found.flow.symbols),
            "value": factor,
            "power": power,
        })
    };
    let resonance = |resonance: &Resonance| {
        json!({
            "storages": resonance.storages.map(|k| linear.unknowns[k].name.clone()),
            "frequency": resonance.omega / std::f64::consts::TAU,
            "damping": resonance.damping,
            "damped_by": damped(graph, resonance),
        })
    };
    let mut result = json!({"schema": 1, "model": linear.name});
    if let Some(map) = result.as_object_mut() {
        if let Some(paths) = &found.paths {
            map.insert("paths".into(), paths.iter().map(way).collect());
        }
        map.insert("loops".into(), found.loops.iter().map(way).collect());
        map.insert("resonances".into(), found.resonances.iter().map(resonance).collect());
    }
    result
}
