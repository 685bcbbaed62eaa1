//! Variables that loops of junctions force to 0, whatever the elements: a half arrow too many points round.
//!
//! In terms of the flows of an island, tree flows = N · link flows: a row of zeros is a port whose flow is 0, a column of
//! zeros one whose effort is 0. A source that sets such a variable is contradicted; any other element is idle.

use super::couplers::in_loops;
use super::islands::{self, Island, is_junction};
use super::space::Space;
use crate::bond::graph::{Bond, BondGraph, BondId, End, Law, Power, VertexId};
use crate::diagnostic::Diagnostic;

/// So many bonds are tried to find the one that should be turned or left out.
const MOST_TRIED: usize = 60;

/// Says which flows and efforts junctions alone force to 0: an error where a source sets them, else a warning.
pub fn check(graph: &BondGraph, diagnostics: &mut Vec<Diagnostic>) {
    for island in islands::find(graph) {
        // A tree of junctions forces nothing.
        if island.closing.is_empty() {
            continue;
        }
        let found = forced(graph, &island);
        if found.is_empty() {
            continue;
        }
        let mend = mend(graph, &island);
        for (end, variable) in found {
            diagnostics.push(tell(graph, end, variable).help(mend.as_str()));
        }
    }
}

/// The bonds of loops that, turned round or left out, leave nothing forced and a circuit without couplers.
fn mend(graph: &BondGraph, island: &Island) -> String {
    let name = |bond: &BondId| graph.bond_name(*bond);
    let bonds = in_loops(graph, island);
    let right = |graph: &BondGraph, island: &Island| {
        Space::new(graph, island, &[], &|_| false).realise().is_some()
            && forced(graph, island).is_empty()
    };
    let mut changed = graph.clone();
    let turned = bonds.iter().take(MOST_TRIED).find(|bond| {
        let Bond { from, to, .. } = *graph.bond(**bond);
        (changed.bonds[bond.index()].from, changed.bonds[bond.index()].to) = (to, from);
        let right = right(&changed, island);
        (changed.bonds[bond.index()].from, changed.bonds[bond.index()].to) = (from, to);
        right
    });
    let left_out = bonds.iter().take(MOST_TRIED).filter(|bond| {
        let ends = [graph.bond(**bond).from.vertex, graph.bond(**bond).to.vertex];
        let fewer = island.bonds.iter().copied().filter(|other| other != *bond).collect();
        ends.iter().all(|vertex| graph.vertex(*vertex).bonds.len() > 2)
            && right(graph, &Island { bonds: fewer, ..island.clone() })
    });
    let left_out: Vec<String> = left_out.take(4).map(name).collect();
    match (turned.map(name), left_out.as_slice()) {
        (Some(turned), _) => format!("draw the half arrow of {turned} the other way round"),
        (None, []) => "leave out a bond of the loop of junctions".to_string(),
        (None, [one]) => format!("leave out {one}"),
        (None, some) => format!("leave out one of {}", some.join(", ")),
    }
}

fn forced(graph: &BondGraph, island: &Island) -> Vec<(End, Power)> {
    let forced = Space::new(graph, island, &[], &|_| false).forced();
    let flows = forced.flows.into_iter().map(|end| (end, Power::Flow));
    let mut found: Vec<(End, Power)> =
        flows.chain(forced.efforts.into_iter().map(|end| (end, Power::Effort))).collect();
    found.sort_by_key(|(end, _)| *end);
    found
}

fn tell(graph: &BondGraph, end: End, variable: Power) -> Diagnostic {
    let vertex = graph.vertex(end.vertex);
    let what = match variable {
        Power::Effort => "effort",
        Power::Flow => "flow",
    };
    let name = format!("{}:{}", vertex.kind, graph.port_name(end));
    let message = format!("the junctions force the {what} of {name} to 0");
    let junction = graph.bond_at(end).and_then(|bond| {
        let bond = graph.bond(bond);
        [bond.from.vertex, bond.to.vertex].into_iter().find(|id| is_junction(graph, *id))
    });
    let name = |id: VertexId| graph.vertex(id).name.clone();
    let cancels = match (junction, variable) {
        (None, _) => String::new(),
        (Some(junction), Power::Flow) => format!(
            "round the loop of junctions, all other flows at `{}` cancel each other",
            name(junction)
        ),
        (Some(junction), Power::Effort) => format!(
            "round the loop of junctions, all other efforts at `{}` cancel each other",
            name(junction)
        ),
    };
    match &vertex.law {
        Law::Source { sets, detector: false, .. } if *sets == variable => {
            Diagnostic::error("E0604", vertex.span, message)
                .says(format!("and it imposes its {what}"))
                .because(cancels)
        }
        _ => Diagnostic::warning("W0601", vertex.span, message).because(cancels),
    }
}
