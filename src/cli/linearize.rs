//! `bondspice linearize MODEL.bg`: A, B, C, D with names and units, as equations, JSON, MATLAB or python-control.

use super::linear::{self, PointFlags};
use super::output::write_text;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::analysis::linear::Channel;
use crate::analysis::state_space::{StateSpace, state_space};
use crate::analysis::{export, linear::Linear};
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str =
    "Linearise a model: matrices with names and units, for MATLAB and python-control too";

/// An example for the help.
pub const EXAMPLE: &str = "\
Inputs are the model's inputs and sources (of a netlist its sources), outputs what it observes, unless --from and --to name others. A variable
of the model that is made an input is imposed: what determines it otherwise is put aside. States are what storages hold
(q, p) and what signals integrate.

Example: bondspice linearize models/dc_motor_load.bg
         bondspice linearize models/eha_one_line.bg --at 2s --from x_ref --to 'x, f(shaft) in rpm' -o eha.py
         bondspice linearize models/rlc.bg -o rlc.m
         bondspice linearize deck.cir --from V1 --to 'v(out), i(l1)'";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    /// Inputs, which are imposed: 'x_ref, e(bus)'; without it the model's inputs and sources
    #[arg(long, value_name = "LIST")]
    from: Option<String>,
    /// Outputs: 'EXPR [in UNIT] [as "NAME"], …', or all; without it what the model observes
    #[arg(long, value_name = "LIST")]
    to: Option<String>,
    /// Form of the result; without it the ending of -o says (.json, .m, .py)
    #[arg(long, value_name = "FORM", value_parser = ["text", "json", "matlab", "python"])]
    format: Option<String>,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Linearises and shows.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (inputs, outputs) = (arguments.from.as_deref(), arguments.to.as_deref());
    let linear = linear::linearise(&arguments.point, inputs, outputs, session)?;
    let space = state_space(&linear).map_err(|error| session.fail(*error))?;
    let to = arguments.output.as_deref();
    let ending = to.and_then(|to| Path::new(to).extension()).and_then(|e| e.to_str());
    let format = arguments.format.as_deref().unwrap_or(match ending {
        Some("json") => "json",
        Some("m") => "matlab",
        Some("py") => "python",
        _ => "text",
    });
    let text = match format {
        "json" => format!("{:#}\n", export::to_json(&linear, &space)),
        "matlab" => export::to_matlab(&linear, &space),
        "python" => export::to_python(&linear, &space),
        _ => to_text(&linear, &space),
    };
    write_text(to, &text, session)
}

fn to_text(linear: &Linear, space: &StateSpace) -> String {
    let mut states = Table::new(&["state", "unit", "at the point"]);
    for state in &space.states {
        states.row([state.name.clone(), state.unit.clone(), short(state.value)]);
    }
    let list = |what: &str, channels: &[Channel]| {
        let mut table = Table::new(&[what, "unit"]);
        for channel in channels {
            table.row([channel.name.clone(), channel.unit.clone()]);
        }
        if channels.is_empty() { String::new() } else { table.to_text() + "\n" }
    };
    let form = match space.descriptor {
        Some(_) => "linear in descriptor form",
        None => "linear",
    };
    format!(
        "{} {form} {}\n\n{}\n{}{}{}",
        linear.name,
        export::place(linear),
        if space.states.is_empty() { "no states\n".into() } else { states.to_text() },
        list("input", &linear.inputs),
        list("output", &linear.outputs),
        export::equations(linear, space, &short)
    )
}
