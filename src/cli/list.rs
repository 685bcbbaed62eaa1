//! `--list`: what can be observed, with units.

use super::pipeline::{self, Language};
use super::session::{Exit, Session};
use super::table::Table;
use crate::bond::elaborate::{self, Overrides};
use crate::circuit::stamps;
use crate::source::FileId;

/// Every observable of a text with its unit.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn observables(
    session: &mut Session,
    file: FileId,
    overrides: &Overrides,
) -> Result<String, Exit> {
    let mut d = vec![];
    let mut table = Table::new(&["observable", "unit"]);
    match pipeline::language(&session.map, file) {
        Language::Bond => {
            if let Some(graph) = pipeline::graph(&mut session.map, file, overrides, &mut d) {
                for item in elaborate::observables(&graph) {
                    table.row([item.name, item.si_unit]);
                }
            }
        }
        Language::Netlist => {
            let all = Overrides { observe: Some("all".into()), ..overrides.clone() };
            let circuit = pipeline::circuit(&mut session.map, file, &all, &mut d);
            let stamps = circuit.and_then(|(circuit, _)| stamps::stamp(&circuit, &mut d));
            for (name, _) in stamps.iter().flat_map(|s| &s.outputs[..s.outputs.len() - s.watched]) {
                let unit = if name.starts_with("v(") { "V" } else { "A" };
                table.row([name.to_string(), unit.into()]);
            }
        }
    }
    session.say(d);
    match session.exit() {
        Exit::Fine => Ok(table.to_text()),
        exit => Err(exit),
    }
}
