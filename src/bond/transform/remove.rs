//! Elements and junctions left out: on a 1-junction the effort of an element counts as 0, on a 0-junction its flow; a
//! junction that is left out passes nothing on.

use super::plan::Plan;
use super::{Source, Trouble};
use crate::bond::graph::{Law, VertexId};
use crate::diagnostic::Diagnostic;
use std::collections::BTreeSet;

/// Leaves out an element, or a junction with the elements that hang on it alone. A junction that nothing is left at but
/// one bond goes, too, and the two-ports behind it: the branch carries nothing any more.
///
/// # Errors
/// That there is no junction that would do without it.
pub fn without(source: &Source, id: VertexId) -> Result<Plan, Trouble> {
    let graph = &source.graph;
    let vertex = graph.vertex(id);
    let title = source.title(id);
    let refuse = |why: String| {
        let message = format!("`{title}` cannot be left out: {why}");
        Err(Box::new(Diagnostic::error("E1104", vertex.span, message)))
    };
    let junction = matches!(vertex.law, Law::Zero | Law::One);
    if !junction && vertex.bonds.len() != 1 {
        return refuse("it has more than one bond".into());
    }
    let mut plan = Plan::default();
    plan.gone.insert(id);
    plan.cut.extend(vertex.bonds.iter().copied());
    let mut open: BTreeSet<VertexId> =
        vertex.bonds.iter().map(|bond| source.beyond(*bond, id)).collect();
    let first = open.first().map_or("", |at| graph.vertex(*at).kind);
    if !junction && !matches!(first, "0" | "1") {
        let near = open.first().map_or(String::new(), |at| source.title(*at));
        return refuse(format!("it hangs on `{near}`, which is no junction"));
    }
    while let Some(at) = open.pop_first() {
        let next = graph.vertex(at);
        let left: Vec<_> =
            next.bonds.iter().copied().filter(|bond| !plan.cut.contains(bond)).collect();
        match (&next.law, left.as_slice()) {
            (Law::Zero | Law::One, [_, _, ..]) => {}
            (Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_), [bond]) => {
                plan.gone.insert(at);
                plan.cut.insert(*bond);
                open.insert(source.beyond(*bond, at));
            }
            // What hung on the junction alone, or on what goes with it.
            (_, []) if junction => {
                plan.gone.insert(at);
            }
            _ => return refuse(format!("nothing would be left of `{}`", source.title(at))),
        }
    }
    if plan.gone.len() == graph.vertices.len() {
        return refuse("nothing would be left of the model".into());
    }
    let counts = match (junction, vertex.kind, first) {
        (true, "1", _) => "flow counts as 0",
        (true, ..) => "effort counts as 0",
        (false, _, "1") => "effort counts as 0 on its 1-junction",
        _ => "flow counts as 0 on its 0-junction",
    };
    let mut others: Vec<_> = plan.gone.iter().copied().filter(|gone| *gone != id).collect();
    others.sort_unstable();
    let others: Vec<String> = others.into_iter().map(|gone| source.title(gone)).collect();
    plan.why = format!("Left out: {title}, whose {counts}");
    if !others.is_empty() {
        plan.why += &format!("; with it {}, which carries nothing more", others.join(", "));
    }
    plan.why += ".";
    Ok(plan)
}
