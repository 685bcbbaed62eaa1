//! What a graph must be before causality has a meaning: every port has its bond, no two ends of a bond impose the same.

use super::super::graph::*;
use crate::diagnostic::Diagnostic;
use std::collections::HashMap;

/// How many bonds a vertex of this law has: (fewest, most).
fn bonds_wanted(law: &Law) -> (usize, usize) {
    match law {
        Law::Zero | Law::One => (2, usize::MAX),
        Law::Transformer(_) | Law::Gyrator(_) => (2, 2),
        Law::Source { .. } | Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. } => (1, 1),
        Law::Field(field) => (field.ports.len(), field.ports.len()),
    }
}

/// Reports vertices with too few or too many bonds, and bonds that cannot be.
pub fn check(graph: &BondGraph, diagnostics: &mut Vec<Diagnostic>) {
    for vertex in &graph.vertices {
        let (fewest, most) = bonds_wanted(&vertex.law);
        let count = vertex.bonds.len();
        let name = format!("{}:{}", vertex.kind, vertex.name);
        if count < fewest {
            let (code, what, help) = match vertex.law {
                Law::Zero | Law::One => (
                    "E0401",
                    "junction",
                    "a junction joins at least two bonds; draw the missing one or leave the junction out",
                ),
                Law::Transformer(_) | Law::Gyrator(_) => {
                    ("E0403", "two-port", "a two-port needs a bond at each of its two ports")
                }
                Law::Field(_) => ("E0403", "field", "a field needs a bond at each of its ports"),
                _ => (
                    "E0403",
                    "element",
                    "join it to a junction or another element: `junction -> element`",
                ),
            };
            let number =
                ["no bond", "only one bond"].get(count).copied().unwrap_or("too few bonds");
            let message = format!("the {what} {name} has {number}");
            diagnostics.push(label_bonds(
                graph,
                vertex,
                Diagnostic::error(code, vertex.span, message).help(help),
            ));
        } else if count > most {
            let what = match most {
                1 => "one port".to_string(),
                2 => "two ports".to_string(),
                _ => format!("{most} ports"),
            };
            let message = format!("{name} has {what} but {count} bonds");
            let help = if most == 1 {
                "put a 0-junction (common effort) or a 1-junction (common flow) between it and its bonds"
            } else {
                "join the further bonds to a junction next to it"
            };
            diagnostics.push(label_bonds(
                graph,
                vertex,
                Diagnostic::error("E0402", vertex.span, message).help(help),
            ));
        }
    }
    let mut pairs: HashMap<(VertexId, VertexId), BondId> = HashMap::new();
    for id in graph.bond_ids() {
        let bond = graph.bond(id);
        let (from, to) = (graph.vertex(bond.from.vertex), graph.vertex(bond.to.vertex));
        if bond.from.vertex == bond.to.vertex {
            let message =
                format!("the bond {} joins {} with itself", graph.bond_name(id), from.name);
            diagnostics.push(Diagnostic::error("E0405", bond.span, message));
            continue;
        }
        if let (Law::Source { sets: a, .. }, Law::Source { sets: b, .. }) = (&from.law, &to.law)
            && a == b
        {
            let what = if *a == Power::Effort { "effort" } else { "flow" };
            let message =
                format!("both ends of the bond {} impose its {what}", graph.bond_name(id));
            diagnostics.push(
                Diagnostic::error("E0404", bond.span, message)
                    .label(from.span, format!("{}:{} imposes the {what}", from.kind, from.name))
                    .label(to.span, format!("{}:{} imposes the {what}", to.kind, to.name)),
            );
        }
        // Several ports of a field may well meet at one junction.
        if [from, to].iter().any(|vertex| matches!(vertex.law, Law::Field(_))) {
            continue;
        }
        let key = (bond.from.vertex.min(bond.to.vertex), bond.from.vertex.max(bond.to.vertex));
        if let Some(first) = pairs.insert(key, id) {
            let message = format!("{} and {} are joined twice", from.name, to.name);
            diagnostics.push(
                Diagnostic::warning("W0404", bond.span, message)
                    .label(graph.bond(first).span, "the first bond between them")
                    .help("each arrow written is one new bond; to speak of a bond again, use only the names"),
            );
        }
    }
}

fn label_bonds(graph: &BondGraph, vertex: &Vertex, mut diagnostic: Diagnostic) -> Diagnostic {
    const MOST: usize = 8;
    for &bond in vertex.bonds.iter().take(MOST) {
        diagnostic = diagnostic.label(graph.bond(bond).span, graph.bond_name(bond));
    }
    diagnostic
}

/// Bonds that close a ring of junctions of one kind: round 0-junctions the flow, round 1-junctions the effort is not
/// determined, so that no stroke is right. Each ring is given as the bonds of the chain that closes it.
pub fn rings(graph: &BondGraph) -> Vec<Vec<BondId>> {
    let mut group: Vec<u32> = (0..graph.vertices.len() as u32).collect();
    let mut seen = vec![false; graph.bonds.len()];
    let mut rings = Vec::new();
    for id in graph.bond_ids() {
        if seen[id.index()] {
            continue;
        }
        let Some((chain, ends)) = chain(graph, id) else { continue };
        for bond in &chain {
            seen[bond.index()] = true;
        }
        let [a, b] = ends.map(|vertex| find(&mut group, vertex.0));
        let same_kind = matches!(
            (&graph.vertex(ends[0]).law, &graph.vertex(ends[1]).law),
            (Law::Zero, Law::Zero) | (Law::One, Law::One)
        );
        if !same_kind {
            continue;
        }
        if a == b {
            rings.push(chain);
        } else {
            group[a as usize] = b;
        }
    }
    rings
}

fn find(group: &mut [u32], mut of: u32) -> u32 {
    while group[of as usize] != of {
        group[of as usize] = group[group[of as usize] as usize];
        of = group[of as usize];
    }
    of
}

/// The bonds from junction to junction through junctions of two bonds with through half arrows, which only pass on.
fn chain(graph: &BondGraph, id: BondId) -> Option<(Vec<BondId>, [VertexId; 2])> {
    let start = graph.bond(id);
    let mut ends = [start.from.vertex, start.to.vertex];
    let mut sides = [Vec::new(), Vec::new()];
    for (end, side) in ends.iter_mut().zip(&mut sides) {
        let mut last = id;
        loop {
            let vertex = graph.vertex(*end);
            if !matches!(vertex.law, Law::Zero | Law::One) {
                return None;
            }
            let [a, b] = vertex.bonds[..] else { break };
            let next = if a == last { b } else { a };
            let (this, other) = (graph.bond(last), graph.bond(next));
            if (this.to.vertex == *end) == (other.to.vertex == *end) {
                break;
            }
            if next == id {
                // All of it is one ring.
                side.push(id);
                return Some((std::mem::take(side), [*end, *end]));
            }
            side.push(next);
            *end = if other.to.vertex == *end { other.from.vertex } else { other.to.vertex };
            last = next;
        }
    }
    let [mut bonds, after] = sides;
    bonds.reverse();
    bonds.push(id);
    bonds.extend(after);
    Some((bonds, ends))
}
