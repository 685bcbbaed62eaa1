//! `bondspice draw FILE`: the bond graph as on paper, or its circuit as a schematic.

use super::flags::{DeckFlags, ModelFlags};
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::causality::{self, Causality};
use crate::bond::elaborate::Overrides;
use crate::bond::graph::BondGraph;
use crate::circuit::{Circuit, NodeId};
use crate::diagnostic::Diagnostic;
use crate::draw::bond_graph::{self, MOST, Sketch};
use crate::draw::{schematic, svg};
use crate::source::{FileId, Span};
use std::collections::HashSet;

/// What it does, in a line.
pub const ABOUT: &str = "Draw a bond graph as on paper, or a circuit as a schematic";

/// An example for the help.
pub const EXAMPLE: &str = "Half arrows, causal strokes, numbered efforts and flows, a colour for each domain. The ending of -o \
says the form: .svg, .tex (TikZ) or .dot (for Graphviz, whatever the size); without -o SVG on standard output.\n\n\
Example: bondspice draw model.bg -o model.svg\n         \
bondspice draw model.bg --depth 0 -o overview.svg\n         \
bondspice draw model.bg --circuit -o circuit.svg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// Where to write the drawing: .svg, .tex or .dot
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// Form of the drawing; else from the ending of -o
    #[arg(long, value_name = "FORM", value_parser = ["svg", "tex", "dot"])]
    format: Option<String>,
    /// How deep instances of models are laid open, 0 for none; deeper ones are one node each
    #[arg(long, value_name = "LEVELS")]
    depth: Option<usize>,
    /// Draw the circuit that the bond graph becomes, or that a netlist holds; .tex is for circuitikz
    #[arg(long, conflicts_with = "depth")]
    circuit: bool,
    #[command(flatten)]
    deck: DeckFlags,
}

/// Draws.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let form = form(arguments, session)?;
    let mut overrides = arguments.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    let file = session.load(&arguments.file)?;
    if arguments.circuit {
        return circuit(arguments, form, file, &overrides, session);
    }
    pipeline::require_bond(session, file, "drawn")?;
    let mut d = vec![];
    let found = pipeline::graph(&mut session.map, file, &overrides, &mut d).map(|graph| {
        let causality = causality::analyse(&graph, &mut d);
        (graph, causality)
    });
    session.say(d);
    let Some((graph, causality)) = found else { return Err(session.exit()) };
    let text = match form {
        "dot" => {
            let depth = arguments.depth.unwrap_or(usize::MAX);
            bond_graph::dot(&graph, &bond_graph::sketch(&graph, &causality, depth))
        }
        form => {
            let sketch = fitting(&graph, &causality, arguments.depth, session)?;
            let placed = bond_graph::place(&sketch);
            let picture = bond_graph::paint(&graph, &sketch, &placed);
            super::plot::text(&picture, form)
        }
    };
    write_text(arguments.output.as_deref(), &text, session)
}

/// Draws the circuit of either language.
fn circuit(
    arguments: &Arguments,
    form: &str,
    file: FileId,
    overrides: &Overrides,
    session: &mut Session,
) -> Result<(), Exit> {
    if form == "dot" {
        let error = Diagnostic::error("E0941", Span::NONE, "a circuit has no form `dot`");
        return Err(session.fail(error.help("end the name in .svg or .tex")));
    }
    let mut d = vec![];
    let found = circuit_of(session, file, overrides, &mut d);
    session.say(d);
    let Some((circuit, kept)) = found else { return Err(session.exit()) };
    let placed = schematic::place(&circuit, &|id| kept[id.0 as usize]).map_err(|devices| {
        let message = format!("`{}` is too large to draw: {devices} devices", circuit.title);
        let error = Diagnostic::error("E1001", Span::NONE, message);
        session.fail(error.because(format!(
            "a schematic holds at most {}, what repeats counted once",
            schematic::MOST
        )))
    })?;
    let text = match form {
        "tex" => schematic::circuitikz(&placed),
        _ => svg::write(&schematic::paint(&placed)),
    };
    write_text(arguments.output.as_deref(), &text, session)
}

/// A flat circuit, and by device whether it is drawn: of a bond graph what carries power, of a netlist everything.
pub fn circuit_of(
    session: &mut Session,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<(Circuit, Vec<bool>)> {
    if pipeline::language(&session.map, file) == pipeline::Language::Netlist {
        let (circuit, _) = pipeline::circuit(&mut session.map, file, overrides, d)?;
        let kept = vec![true; circuit.devices.len()];
        return Some((circuit, kept));
    }
    let model = pipeline::model(&mut session.map, file, overrides, d)?;
    let (circuit, _) = model.circuit(d)?;
    let kept = power_devices(&model, &circuit);
    Some((circuit, kept))
}

/// By device of a bond graph's circuit: whether all its nodes are those of junctions and elements.
pub fn power_devices(model: &pipeline::Model, circuit: &Circuit) -> Vec<bool> {
    let names = &model.translation.netlist.names;
    let power: HashSet<String> = model
        .translation
        .origins
        .power
        .iter()
        .map(|name| names.text(*name).to_lowercase())
        .collect();
    let carries = |node: &NodeId| {
        let name = circuit.nodes.get(node.0 as usize).map_or("", |node| &*node.name);
        node.0 == 0 || power.contains(&name.to_lowercase())
    };
    circuit.devices.iter().map(|device| device.nodes.iter().all(carries)).collect()
}

/// The form that is asked for: by name, else by the ending of the file.
fn form(arguments: &Arguments, session: &mut Session) -> Result<&'static str, Exit> {
    let named = arguments.format.as_deref().or_else(|| {
        let file = arguments.output.as_deref().filter(|file| *file != "-")?;
        file.rsplit_once('.').map(|(_, ending)| ending)
    });
    match named {
        None | Some("svg") => Ok("svg"),
        Some("tex") => Ok("tex"),
        Some("dot" | "gv") => Ok("dot"),
        Some(other) => {
            let message = format!("a drawing has no form `{other}`");
            let error = Diagnostic::error("E0941", Span::NONE, message);
            Err(session.fail(error.help("end the name in .svg, .tex or .dot, or add --format svg")))
        }
    }
}

/// The sketch with as much laid open as can be read, or as asked for.
fn fitting(
    graph: &BondGraph,
    causality: &Causality,
    depth: Option<usize>,
    session: &mut Session,
) -> Result<Sketch, Exit> {
    let found = match depth {
        None => bond_graph::fitting(graph, causality),
        Some(depth) => {
            let sketch = bond_graph::sketch(graph, causality, depth);
            if sketch.nodes.len() > MOST { Err(sketch.nodes.len()) } else { Ok(sketch) }
        }
    };
    match found {
        Ok(sketch) => {
            if depth.is_none() && sketch.depth < sketch.deepest {
                let message = format!(
                    "`{}` has {} junctions and elements, too many for one picture: instances are laid open {} deep",
                    graph.name,
                    graph.vertices.len(),
                    sketch.depth
                );
                let note = Diagnostic::note("N1001", Span::NONE, message);
                session.say([note.help("--depth says how deep; -o FILE.dot holds everything")]);
            }
            Ok(sketch)
        }
        Err(size) => {
            let message =
                format!("`{}` is too large to draw: {size} junctions and elements", graph.name);
            let error = Diagnostic::error("E1001", Span::NONE, message);
            let error = error.because(format!("a picture holds at most {MOST}"));
            let help =
                "write -o FILE.dot and let Graphviz lay it out, or lay less open with --depth 0";
            Err(session.fail(error.help(help)))
        }
    }
}
