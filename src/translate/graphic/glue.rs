//! From members back to a graph: each is put onto the marker of the one before it.

use super::Graph;
use super::decomposition::{Decomposition, Kind, What};
use std::collections::HashMap;

impl Decomposition {
    /// The graph: blocks stand apart, a row without columns is an edge between two nodes of its own, and a column
    /// without rows one from a node to itself.
    pub fn glue(mut self) -> Graph {
        let mut graph =
            Graph { nodes: 0, edges: vec![[0; 2]; self.element.len()], component: vec![] };
        let mut components = 0;
        let mut done = vec![false; self.members.len()];
        for first in 0..self.element.len() {
            let node = |graph: &mut Graph| {
                graph.component.push(components);
                graph.nodes += 1;
                graph.nodes - 1
            };
            let Some(edge) = self.element[first] else {
                let tail = node(&mut graph);
                let head = if first < self.rows { node(&mut graph) } else { tail };
                graph.edges[first] = [tail, head];
                components += 1;
                continue;
            };
            let root = self.edges[edge].member;
            if done[root] {
                continue;
            }
            let mut waiting = vec![(edge, [node(&mut graph), node(&mut graph)])];
            while let Some((entry, [s, t])) = waiting.pop() {
                let member = self.edges[entry].member;
                done[member] = true;
                let edges = self.members[member].edges.clone();
                let mut ends = vec![[s, t]; edges.len()];
                match self.members[member].kind {
                    Kind::Bond => {}
                    Kind::Polygon => {
                        let mut at = s;
                        let count = edges.len() - 1;
                        let others = (0..edges.len()).filter(|place| edges[*place] != entry);
                        for (number, place) in others.enumerate() {
                            let next = if number + 1 == count { t } else { node(&mut graph) };
                            ends[place] = [at, next];
                            at = next;
                        }
                    }
                    Kind::Prime => {
                        let [u, v] = self.ends(entry);
                        let mut nodes = HashMap::from([(u, s), (v, t)]);
                        for (place, edge) in edges.iter().enumerate() {
                            ends[place] = self.ends(*edge).map(|inner| {
                                *nodes.entry(inner).or_insert_with(|| node(&mut graph))
                            });
                        }
                    }
                }
                for (edge, ends) in edges.into_iter().zip(ends) {
                    match self.edges[edge].what {
                        What::Element(element) => graph.edges[element] = ends,
                        What::Marker(mate) if edge != entry => waiting.push((mate, ends)),
                        What::Marker(_) => {}
                    }
                }
            }
            components += 1;
        }
        graph
    }
}
