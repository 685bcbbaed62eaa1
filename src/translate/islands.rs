//! Islands: what hangs together through bonds when only TF and GY separate.

use super::forest::Forest;
use crate::bond::graph::{BondGraph, BondId, End, Law, VertexId};
use crate::quantity::Domain;
use std::collections::HashSet;

/// Junctions and bonds that one connected circuit realises.
#[derive(Clone, Debug, PartialEq)]
pub struct Island {
    /// Its junctions in file order; none when two elements share a bond.
    pub junctions: Vec<VertexId>,
    /// Its bonds in file order.
    pub bonds: Vec<BondId>,
    /// Bonds between junctions that close a loop of junctions, left out of the spanning tree.
    pub closing: Vec<BondId>,
    /// The domain of its bonds.
    pub domain: Domain,
}

/// Whether a vertex is a junction.
pub fn is_junction(graph: &BondGraph, vertex: VertexId) -> bool {
    matches!(graph.vertex(vertex).law, Law::Zero | Law::One)
}

/// The end of a bond that is not `end`.
pub fn other_end(graph: &BondGraph, bond: BondId, end: End) -> End {
    let bond = graph.bond(bond);
    if bond.from == end { bond.to } else { bond.from }
}

/// The end of a bond at a junction (port 0; a bond from a junction to itself is refused by elaboration).
pub fn junction_end(vertex: VertexId) -> End {
    End { vertex, port: 0 }
}

/// Junctions must be found before the bonds that close loops: breadth first, so that paths to the root are short.
pub fn find(graph: &BondGraph) -> Vec<Island> {
    let mut groups = Forest::new(graph.vertices.len());
    for bond in &graph.bonds {
        if is_junction(graph, bond.from.vertex) && is_junction(graph, bond.to.vertex) {
            groups.join(bond.from.vertex.index(), bond.to.vertex.index());
        }
    }
    let mut islands: Vec<Island> = Vec::new();
    let mut of_group = vec![None; graph.vertices.len()];
    let mut add = |bond: BondId, junction: Option<VertexId>, islands: &mut Vec<Island>| {
        let fresh =
            || Island { junctions: vec![], bonds: vec![], closing: vec![], domain: Domain::Any };
        let island = match junction {
            None => {
                islands.push(fresh());
                islands.len() - 1
            }
            Some(junction) => {
                let group = groups.root(junction.index());
                *of_group[group].get_or_insert_with(|| {
                    islands.push(fresh());
                    islands.len() - 1
                })
            }
        };
        islands[island].bonds.push(bond);
        let domain = graph.bond(bond).domain;
        if islands[island].domain == Domain::Any {
            islands[island].domain = domain;
        }
    };
    for id in graph.bond_ids() {
        let bond = graph.bond(id);
        let junction =
            [bond.from.vertex, bond.to.vertex].into_iter().find(|v| is_junction(graph, *v));
        add(id, junction, &mut islands);
    }
    for vertex in graph.vertex_ids() {
        if is_junction(graph, vertex) {
            // A junction without any bond belongs nowhere.
            if let Some(island) = of_group[groups.root(vertex.index())] {
                islands[island].junctions.push(vertex);
            }
        }
    }
    for island in &mut islands {
        island.closing = closing_bonds(graph, island);
    }
    islands
}

/// The bonds outside a breadth-first spanning tree from the first junction.
fn closing_bonds(graph: &BondGraph, island: &Island) -> Vec<BondId> {
    let inner = |id: &&BondId| {
        let bond = graph.bond(**id);
        is_junction(graph, bond.from.vertex) && is_junction(graph, bond.to.vertex)
    };
    if island.bonds.iter().filter(inner).count() < island.junctions.len().max(1) {
        // A tree.
        return vec![];
    }
    let mut reached = HashSet::new();
    let mut in_tree = HashSet::new();
    let mut queue = std::collections::VecDeque::new();
    if let Some(root) = island.junctions.first() {
        reached.insert(*root);
        queue.push_back(*root);
    }
    while let Some(vertex) = queue.pop_front() {
        for bond in &graph.vertex(vertex).bonds {
            let far = other_end(graph, *bond, junction_end(vertex)).vertex;
            if is_junction(graph, far) && reached.insert(far) {
                in_tree.insert(*bond);
                queue.push_back(far);
            }
        }
    }
    island
        .bonds
        .iter()
        .copied()
        .filter(|id| {
            let bond = graph.bond(*id);
            is_junction(graph, bond.from.vertex)
                && is_junction(graph, bond.to.vertex)
                && !in_tree.contains(id)
        })
        .collect()
}
