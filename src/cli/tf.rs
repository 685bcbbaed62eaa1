//! `bondspice tf MODEL.bg --from A --to B`: a transfer function in the model's own parameters.

use super::linear::{self, PointFlags, one_way};
use super::output::write_text;
use super::session::{Exit, Session};
use super::table::short;
use crate::analysis::symbolic::{print, transfer::transfer};

/// What it does, in a line.
pub const ABOUT: &str =
    "Show a transfer function in the model's own parameters, as text, LaTeX or JSON";

/// An example for the help.
pub const EXAMPLE: &str = "\
Parameters stand by their names, values written at an element by the element's name. Numbers in brackets are the
coefficients' values, in SI. The result has been compared with the numeric response at random points.

Example: bondspice tf models/rlc.bg --from 'e(U)' --to 'f(mesh)'
         bondspice tf models/eha_one_line.bg --from 'e(chopper.2)' --to 'f(armature)' --format latex";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    /// The variable that is imposed; what determines it otherwise is put aside
    #[arg(long, value_name = "VARIABLE")]
    from: String,
    /// The variable that is read
    #[arg(long, value_name = "EXPR")]
    to: String,
    /// Form of the result
    #[arg(long, value_name = "FORM", value_parser = ["text", "latex", "json"], default_value = "text")]
    format: String,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Makes it and shows it.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (from, to) = (Some(arguments.from.as_str()), Some(arguments.to.as_str()));
    let found = linear::linearise_named(&arguments.point, from, to, session)?;
    one_way(&found.linear, session)?;
    let transfer =
        transfer(&found.graph, &found.linear, 0).map_err(|error| session.fail(*error))?;
    let text = match arguments.format.as_str() {
        "json" => format!("{:#}\n", print::to_json(&transfer)),
        "latex" => print::to_latex(&transfer),
        _ => print::to_text(&transfer, &short),
    };
    write_text(arguments.output.as_deref(), &text, session)
}
