//! `bondspice convert MODEL.bg`: the netlist, and the map of its variables.

use super::emit::Stage;
use super::flags::ModelFlags;
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session, same_file};
use crate::diagnostic::Diagnostic;
use crate::netlist::write;
use crate::source::Span;
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str = "Turn a bond graph into a netlist";

/// An example for the help.
pub const EXAMPLE: &str = "Example: bondspice convert model.bg -o model.cir --map map.json\n         \
bondspice convert model.bg | ngspice -b";

/// Simulators whose netlists are asked for and not written yet.
const PLANNED: &[&str] = &["xyce", "ltspice", "gnucap", "saber"];

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The bond graph (.bg); - for standard input
    file: String,
    #[command(flatten)]
    model: ModelFlags,
    /// Where to write the netlist
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// The simulator that shall read it: ngspice
    #[arg(long, value_name = "SIMULATOR", default_value = "ngspice")]
    to: String,
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
    let to = arguments.to.to_lowercase();
    if to != "ngspice" {
        let message = if PLANNED.contains(&to.as_str()) {
            format!("netlists for {to} cannot be written yet, only for ngspice")
        } else {
            format!("no simulator is called `{}`; netlists are written for ngspice", arguments.to)
        };
        return Err(session.fail(Diagnostic::error("E0943", Span::NONE, message)));
    }
    if arguments.emit.is_none() && one_output(arguments) {
        let message = "the netlist and the map cannot be written to one place";
        let error = Diagnostic::error("E0940", Span::NONE, message);
        return Err(session.fail(error.help("give -o and --map two names")));
    }
    let overrides = arguments.model.overrides(session)?;
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
    if session.global.verbose {
        session.remark(&format!("{}: {}", model.graph.name, model.translation.figures));
    }
    let text = write::write(&model.translation.netlist);
    write_text(arguments.output.as_deref(), &text, session)?;
    if let Some(name) = &arguments.map {
        let map = serde_json::to_string_pretty(
            &model.translation.map.json(&model.translation.netlist.names),
        );
        write_text(Some(name), &(map.unwrap_or_default() + "\n"), session)?;
    }
    Ok(())
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
