//! Closes loops of junctions: a bond that the spanning tree left out stands between two pairs of nodes, one at each of
//! its ends, which must have equal effort and equal and opposite flow.
//!
//! An ideal 1:1 coupler does that always. Where the two pairs share their + or their − node, a wire between the other
//! two does the same: the coupler's currents at the shared node are i and −i and cancel, and what remains is a branch
//! without voltage between the other two.

use super::islands::{Island, is_junction};
use super::series_parallel::{Drawing, Item, Pair};
use crate::bond::graph::{BondGraph, BondId, Law};

impl Drawing {
    /// Joins the two ends of each closing bond, by a wire where one will do.
    pub(super) fn close_loops(
        &mut self,
        graph: &BondGraph,
        index: usize,
        island: &Island,
        sensed: &[bool],
    ) {
        let mut open: Vec<BondId> = Vec::new();
        for bond in &island.closing {
            if self.closes_ring(graph, island, *bond) {
                self.cut_ring(graph, *bond)
            } else {
                open.push(*bond)
            }
        }
        // A wire may give two other pairs a node in common.
        loop {
            let before = open.len();
            open.retain(|bond| !self.wire(index, *bond, sensed[bond.index()]));
            if open.len() == before {
                break;
            }
        }
        for bond in open {
            if sensed[bond.index()] {
                self.sense_before_coupler(index, bond);
            }
            self.items[index].push(Item::Coupler(bond));
        }
    }

    fn pairs(&self, bond: BondId) -> Option<(Pair, Pair)> {
        let [from, to] = self.ends[bond.index()];
        Some((self.joined(from?), self.joined(to?)))
    }

    /// Joins by a wire, and says whether that was possible.
    fn wire(&mut self, index: usize, bond: BondId, sensed: bool) -> bool {
        let Some((from, to)) = self.pairs(bond) else { return true };
        let (plus, minus) = if from.minus == to.minus {
            (from.plus, to.plus)
        } else if from.plus == to.plus {
            // The flow comes back in the − wire.
            (to.minus, from.minus)
        } else {
            return false;
        };
        if sensed {
            self.items[index].push(Item::Sense { bond, plus, minus });
        } else {
            self.points.join(plus, minus);
        }
        true
    }

    /// A 0 V source in the + wire at the tail, in front of the coupler.
    fn sense_before_coupler(&mut self, index: usize, bond: BondId) {
        let [Some(from), _] = self.ends[bond.index()] else { return };
        let wish = self.wishes[from.plus];
        self.wishes.push(wish.map(|(_, vertex)| (super::series_parallel::Fit::Inner, vertex)));
        let behind = self.points.add();
        self.items[index].push(Item::Sense { bond, plus: from.plus, minus: behind });
        self.ends[bond.index()][0] = Some(Pair { plus: behind, minus: from.minus });
    }

    /// Whether a bond closes a ring of junctions of one kind: what runs round it is left undetermined.
    fn closes_ring(&self, graph: &BondGraph, island: &Island, bond: BondId) -> bool {
        let bond = graph.bond(bond);
        let kind =
            |vertex: crate::bond::graph::VertexId| matches!(graph.vertex(vertex).law, Law::Zero);
        if kind(bond.from.vertex) != kind(bond.to.vertex) {
            return false;
        }
        let mut equal = super::forest::Forest::new(graph.vertices.len());
        for id in &island.bonds {
            let other = graph.bond(*id);
            let ends = [other.from.vertex, other.to.vertex];
            let junctions = ends.into_iter().all(|vertex| is_junction(graph, vertex));
            if junctions && !island.closing.contains(id) && kind(ends[0]) == kind(ends[1]) {
                equal.join(ends[0].index(), ends[1].index());
            }
        }
        equal.root(bond.from.vertex.index()) == equal.root(bond.to.vertex.index())
    }

    /// Takes the undetermined flow round a ring of 0-junctions, or effort round a ring of 1-junctions, as 0.
    fn cut_ring(&mut self, graph: &BondGraph, bond: BondId) {
        if matches!(graph.vertex(graph.bond(bond).from.vertex).law, Law::One) {
            for pair in self.ends[bond.index()].into_iter().flatten() {
                self.points.join(pair.plus, pair.minus);
            }
        }
    }
}
