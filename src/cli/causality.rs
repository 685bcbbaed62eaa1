//! `bondspice causality MODEL.bg`: strokes, order, states, what depends on what, algebraic loops, conflicts.

use super::flags::ReportFlags;
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::causality;

/// What it does, in a line.
pub const ABOUT: &str =
    "Show causal strokes, states, dependent storages, algebraic loops, conflicts";

/// An example for the help.
pub const EXAMPLE: &str = "A stroke stands at the end that receives the effort: a ->| b means that a imposes the \
effort on b.\n\nExample: bondspice causality model.bg --format json";

/// Its flags.
pub type Arguments = ReportFlags;

/// Assigns causality and shows it, conflicts included.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (file, overrides) =
        arguments.model.of(&arguments.file, "asked for its causality", session)?;
    let mut d = vec![];
    let graph = pipeline::graph(&mut session.map, file, &overrides, &mut d);
    let found = graph.map(|graph| {
        let causality = causality::analyse(&graph, &mut d);
        (graph, causality)
    });
    session.say(d);
    let Some((graph, causality)) = found else { return Err(session.exit()) };
    let text = match arguments.format.as_str() {
        "json" => format!("{}\n", causality::to_json(&graph, &causality)),
        _ => causality::to_text(&graph, &causality),
    };
    write_text(arguments.output.as_deref(), &text, session)
}
