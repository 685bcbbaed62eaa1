//! The flows that an island's junctions allow at its ports, and the efforts of the bonds inside, exactly.
//!
//! At a 1-junction all flows along half arrows are equal, at a 0-junction they add up to zero, + for half arrows that
//! point in; efforts the other way round. Flows that are equal are one variable; what is left are the sums, which are
//! eliminated: first the flows of bonds between junctions, then as many ports as can be follow from the others. That is
//! N, the flows of a tree in terms of those of its links. Efforts are the orthogonal complement: a circuit with these
//! flows has them by itself (B. D. H. Tellegen), so that they are eliminated only to read the bonds inside.

use super::forest::Forest;
use super::graphic::elimination::{Row, Solved, eliminate, factor};
use super::graphic::{Graph, Matrix, realise};
use super::islands::{Island, is_junction};
use crate::bond::graph::{BondGraph, BondId, End, Law};

/// What stands at a port.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A port of an element.
    Element(End),
    /// A 0 V source in a bond between two junctions.
    Sense,
    /// One side of a cut bond: 0 at its tail, 1 at its head.
    Cut(usize),
}

/// A pair of terminals of an island.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// What stands there.
    pub kind: Kind,
    /// The bond.
    pub bond: BondId,
    /// Whether the half arrow points away from the junctions.
    pub outward: bool,
    /// Its variable.
    variable: usize,
}

/// A junction: its variables, and whether the half arrow points in.
struct Junction {
    zero: bool,
    ends: Vec<(usize, bool)>,
}

/// An island as variables, one for each bond and two for a bond that is cut or holds a 0 V source, under junctions.
pub struct Space {
    /// Its ports in the order of its bonds.
    pub ports: Vec<Port>,
    junctions: Vec<Junction>,
    variables: usize,
    /// By bond of the island: the variables at its tail and at its head.
    of_bond: Vec<(BondId, [usize; 2])>,
}

/// What junctions alone force to 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forced {
    /// Ports whose flow is 0.
    pub flows: Vec<End>,
    /// Ports whose effort is 0.
    pub efforts: Vec<End>,
}

/// Ports as the edges of a graph, by port: tail and head.
pub struct Realised {
    /// Number of nodes.
    pub nodes: usize,
    /// By port: the + and the − node.
    pub pairs: Vec<[usize; 2]>,
    /// By node: its connected component.
    pub component: Vec<usize>,
}

impl Space {
    /// The space of an island with some of its bonds between junctions cut, and 0 V sources in others.
    pub fn new(
        graph: &BondGraph,
        island: &Island,
        cut: &[BondId],
        sensed: &dyn Fn(BondId) -> bool,
    ) -> Space {
        let mut space = Space {
            ports: vec![],
            junctions: vec![],
            variables: 0,
            of_bond: Vec::with_capacity(island.bonds.len()),
        };
        let mut place = std::collections::HashMap::new();
        for (number, vertex) in island.junctions.iter().enumerate() {
            place.insert(*vertex, number);
            let zero = matches!(graph.vertex(*vertex).law, Law::Zero);
            space.junctions.push(Junction { zero, ends: vec![] });
        }
        for id in &island.bonds {
            let bond = graph.bond(*id);
            let ends = [bond.from, bond.to];
            let inner = ends.iter().all(|end| is_junction(graph, end.vertex));
            let is_cut = inner && cut.contains(id);
            let is_sensed = inner && !is_cut && sensed(*id);
            let tail = space.variable();
            let head = if is_cut || is_sensed { space.variable() } else { tail };
            space.of_bond.push((*id, [tail, head]));
            for (side, (end, variable)) in ends.into_iter().zip([tail, head]).enumerate() {
                let mut port = |kind| {
                    let outward = (side == 0) == is_junction(graph, end.vertex);
                    space.ports.push(Port { kind, bond: *id, outward, variable });
                };
                if let Some(place) = place.get(&end.vertex) {
                    if is_cut {
                        port(Kind::Cut(side));
                    }
                    space.junctions[*place].ends.push((variable, side == 1));
                } else {
                    port(Kind::Element(end));
                }
            }
            if is_sensed {
                let variable = space.variable();
                let ends = vec![(tail, true), (head, false), (variable, false)];
                space.junctions.push(Junction { zero: false, ends });
                space.ports.push(Port { kind: Kind::Sense, bond: *id, outward: true, variable });
            }
        }
        space
    }

    fn variable(&mut self) -> usize {
        self.variables += 1;
        self.variables - 1
    }

    /// Variables that junctions of one kind make equal, and the sums at those of the other, solved. `None` where
    /// numbers grow too large.
    fn solve(&self, flows: bool) -> Option<(Forest, Solved)> {
        let mut equal = Forest::new(self.variables);
        for junction in self.junctions.iter().filter(|junction| junction.zero != flows) {
            for pair in junction.ends.windows(2) {
                equal.join(pair[0].0, pair[1].0);
            }
        }
        let sums = self.junctions.iter().filter(|junction| junction.zero == flows);
        let rows = sums.map(|junction| {
            let mut row = std::collections::BTreeMap::new();
            for (variable, inward) in &junction.ends {
                *row.entry(equal.root(*variable)).or_insert(0) += if *inward { 1 } else { -1 };
            }
            row.into_iter().filter(|(_, value)| *value != 0).collect::<Row>()
        });
        // A variable that is not the head of its set takes no part.
        let mut hidden = vec![true; self.variables];
        self.ports.iter().for_each(|port| hidden[equal.root(port.variable)] = false);
        let solved = eliminate(rows.collect(), &hidden)?;
        Some((equal, solved))
    }

    /// By variable that stands for a set: the ports of the set.
    fn members(&self, equal: &Forest) -> Vec<Vec<usize>> {
        let mut members = vec![vec![]; self.variables];
        for (number, port) in self.ports.iter().enumerate() {
            members[equal.root(port.variable)].push(number);
        }
        members
    }

    /// N with the ports that its rows and then its columns stand for; `None` where it has other entries than 0, 1, −1.
    fn matrix(&self) -> Option<(Matrix, Vec<usize>)> {
        let (equal, solved) = self.solve(true)?;
        let members = self.members(&equal);
        let (mut rows, mut links) = (Vec::new(), Vec::new());
        let mut column_of = vec![None; self.variables];
        let mut matrix = Matrix::default();
        for variable in &solved.free {
            if let [first, others @ ..] = members[*variable].as_slice() {
                column_of[*variable] = Some(links.len());
                let series = others.iter().map(|port| {
                    rows.push(*port);
                    (rows.len() - 1, 1)
                });
                matrix.columns.push(series.collect());
                links.push(*first);
            }
        }
        for (variable, row) in &solved.dependent {
            let own = factor(row, *variable);
            for port in &members[*variable] {
                for (other, value) in row.iter().filter(|(other, _)| other != variable) {
                    if value.abs() != own.abs() {
                        return None;
                    }
                    let sign = if *value == own { -1 } else { 1 };
                    matrix.columns[column_of[*other]?].push((rows.len(), sign));
                }
                rows.push(*port);
            }
        }
        matrix.rows = rows.len();
        rows.extend(links);
        Some((matrix, rows))
    }

    /// The ports as edges of a graph with exactly these flows, if there is one.
    pub fn realise(&self) -> Option<Realised> {
        let (matrix, order) = self.matrix()?;
        let Graph { nodes, edges, component } = realise(&matrix).ok()?;
        let mut pairs = vec![[0; 2]; self.ports.len()];
        for (port, [tail, head]) in order.into_iter().zip(edges) {
            // The flow runs through what stands at the port, from + to − when the half arrow points there.
            pairs[port] = if self.ports[port].outward { [tail, head] } else { [head, tail] };
        }
        Some(Realised { nodes, pairs, component })
    }

    /// What the junctions alone force to 0; nothing where numbers grow too large.
    pub fn forced(&self) -> Forced {
        let mut forced = Forced::default();
        for flows in [true, false] {
            let Some((equal, solved)) = self.solve(flows) else { continue };
            let members = self.members(&equal);
            let alone = solved.dependent.iter().filter(|(_, row)| row.len() == 1);
            for (variable, _) in alone {
                for port in &members[*variable] {
                    if let Kind::Element(end) = self.ports[*port].kind {
                        if flows { &mut forced.flows } else { &mut forced.efforts }.push(end);
                    }
                }
            }
        }
        forced.flows.sort();
        forced.efforts.sort();
        forced
    }

    /// The efforts of bonds between junctions: at tail and head, a sum of port efforts; `None` where the junctions
    /// leave it undetermined.
    #[allow(clippy::type_complexity)]
    pub fn inner_efforts(&self) -> Vec<(BondId, [Option<Vec<(usize, f64)>>; 2])> {
        let Some((equal, solved)) = self.solve(false) else { return vec![] };
        let members = self.members(&equal);
        let mut told: Vec<Option<Vec<(usize, f64)>>> = vec![None; self.variables];
        for (variable, ports) in members.iter().enumerate() {
            told[variable] = ports.first().map(|port| vec![(*port, 1.0)]);
        }
        for (variable, row) in &solved.hidden {
            let own = factor(row, *variable) as f64;
            let others = row.iter().filter(|(other, _)| other != variable);
            told[*variable] = others
                .map(|(other, value)| Some((*members[*other].first()?, -(*value as f64) / own)))
                .collect();
        }
        let ends = self.of_bond.iter();
        ends.map(|(bond, ends)| (*bond, ends.map(|end| told[equal.root(end)].clone()))).collect()
    }
}
