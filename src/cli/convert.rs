//! `bondspice convert MODEL.bg`: the netlist, and the map of its variables.

use super::emit::Stage;
use super::flags::{DeckFlags, ModelFlags};
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session, same_file};
use crate::bond::scale;
use crate::diagnostic::Diagnostic;
use crate::netlist::dialects;
use crate::quantity::nearest;
use crate::source::Span;
use crate::translate::map::MapCard;
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str = "Turn a bond graph into a netlist";

/// An example for the help.
pub const EXAMPLE: &str = "Example: bondspice convert model.bg -o model.cir --map map.json\n         \
bondspice convert model.bg | ngspice -b";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    #[command(flatten)]
    deck: DeckFlags,
    /// Where to write the netlist
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// The simulator that shall read it: ngspice, xyce, ltspice (instances as subcircuits); gnucap, saber (one flat
    /// circuit)
    #[arg(long, value_name = "SIMULATOR", default_value = "ngspice")]
    to: String,
    /// Scale domains, powers unchanged, for simulators with absolute tolerances: auto or DOMAIN=FACTOR,… (efforts are
    /// divided by the factor, flows multiplied)
    #[arg(long, value_name = "SCALES")]
    scale: Option<String>,
    /// One flat circuit, instances laid open, instead of subcircuits
    #[arg(long)]
    flat: bool,
    /// Where to write the map: which circuit variable is which effort or flow
    #[arg(long, value_name = "FILE")]
    map: Option<String>,
    /// Print a stage on the way instead of the netlist
    #[arg(long, value_enum, value_name = "STAGE")]
    emit: Option<Stage>,
}

/// Converts.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    match convert(&arguments, session) {
        Ok(()) => session.exit(),
        Err(exit) => exit,
    }
}

fn convert(arguments: &Arguments, session: &mut Session) -> Result<(), Exit> {
    let dialect = dialects::find(&arguments.to).filter(|dialect| dialect.text.is_some());
    let Some(dialect) = dialect else {
        return Err(session.fail(unknown(&arguments.to)));
    };
    if arguments.emit.is_none() && one_output(arguments) {
        let message = "the netlist and the map cannot be written to one place";
        let error = Diagnostic::error("E0940", Span::NONE, message);
        return Err(session.fail(error.help("give -o and --map two names")));
    }
    let mut overrides = arguments.model.overrides(session)?;
    arguments.deck.add_to(&mut overrides, session)?;
    if let Some(scales) = &arguments.scale {
        overrides.scale = scale::parse(scales).map_err(|error| session.fail(*error))?;
    }
    let file = session.load(&arguments.file)?;
    if let Some(stage) = arguments.emit {
        let text = pipeline::emit(session, file, &overrides, stage)?;
        return write_text(arguments.output.as_deref(), &text, session);
    }
    pipeline::require_bond(session, file, "converted")?;
    let mut d = vec![];
    let model = pipeline::model(&mut session.map, file, &overrides, &mut d);
    session.say(d);
    let Some(model) = model else { return Err(session.exit()) };
    let (netlist, mut map) = model.netlist(&session.map, dialect, arguments.flat);
    let mut d = vec![];
    let written = dialect.write(&netlist, &mut d);
    session.say(d);
    let Some(written) = written else { return Err(session.exit()) };
    write_text(arguments.output.as_deref(), &written.text, session)?;
    // The map holds what was added, too.
    map.dialect = dialect;
    for (card, of) in written.senses {
        map.figures.nodes += 1;
        map.figures.devices += 1;
        map.figures.helpers += 1;
        let element = format!("current of {of}");
        map.cards.push(MapCard { card, element, bond: None, line: None });
    }
    if session.global.verbose {
        session.remark(&format!("{}: {}", model.graph.name, map.figures));
    }
    if let Some(name) = &arguments.map {
        let map = serde_json::to_string_pretty(&map.json(&written.netlist.names));
        write_text(Some(name), &(map.unwrap_or_default() + "\n"), session)?;
    }
    Ok(())
}

/// What is said of a simulator that has no row.
fn unknown(name: &str) -> Diagnostic {
    let names = dialects::written_names;
    let error = Diagnostic::error("E0943", Span::NONE, format!("no simulator is called `{name}`"));
    match nearest(&name.to_lowercase(), names()) {
        Some(meant) => error.help(format!("did you mean `{meant}`?")),
        None => {
            let names: Vec<&str> = names().collect();
            error.help(format!("netlists are written for {}", names.join(", ")))
        }
    }
}

/// Whether the netlist and the map would go to one file, or both to standard output.
fn one_output(arguments: &Arguments) -> bool {
    match (arguments.output.as_deref().unwrap_or("-"), arguments.map.as_deref()) {
        (_, None) => false,
        ("-", Some(map)) => map == "-",
        (netlist, Some(map)) => {
            let (netlist, map) = (Path::new(netlist), Path::new(map));
            // Devices, as /dev/null, take both.
            same_file(netlist, map) && netlist.metadata().map_or(true, |m| m.is_file())
        }
    }
}
