//! Closes loops of junctions: a bond that the spanning tree left out stands between two pairs of nodes, one at each of
//! its ends, which must have equal effort and equal and opposite flow.
//!
//! Where the two pairs share their + or their − node, a wire between the other two does that: what remains of equal and
//! opposite currents at the shared node is a branch without voltage between the other two. So are drawn the networks
//! that are given by their nodes. Where that leaves loops open, the graph of the island's ports is sought, which no
//! drawing decides beforehand ([`super::graphic`]). Where there is none, an ideal 1:1 coupler in a bond does what a wire
//! cannot; the fewest bonds are sought without which a graph exists.

use super::forest::Forest;
use super::islands::{Island, is_junction};
use super::realise::Plan;
use super::series_parallel::{Drawing, Item, Pair};
use super::space::Space;
use crate::bond::graph::{BondGraph, BondId, Law};
use std::collections::HashSet;

/// Graphs are sought for this many sets of cut bonds, times 100 ports and bonds.
const MOST_TRIALS: usize = 4000;

impl Drawing {
    /// Joins the two ends of closing bonds by wires. Returns the bonds for which none will do.
    pub(super) fn close_by_wires(
        &mut self,
        graph: &BondGraph,
        index: usize,
        island: &Island,
        sensed: &[bool],
    ) -> Vec<BondId> {
        if island.closing.is_empty() {
            return vec![];
        }
        let mut equal = equal_junctions(graph, island);
        let mut open: Vec<BondId> = Vec::new();
        for bond in &island.closing {
            if closes_ring(graph, &mut equal, *bond) {
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
                return open;
            }
        }
    }

    /// Couples the two ends of bonds.
    pub(super) fn couple(&mut self, index: usize, open: &[BondId], sensed: &[bool]) {
        for bond in open {
            if sensed[bond.index()] {
                let sense = self.sense_before_coupler(*bond);
                self.items[index].extend(sense);
            }
            self.items[index].push(Item::Coupler(*bond));
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
    pub(super) fn sense_before_coupler(&mut self, bond: BondId) -> Option<Item> {
        let from = self.ends[bond.index()][0]?;
        let wish = self.wishes[from.plus];
        let behind =
            self.point(wish.map(|(_, vertex)| (super::series_parallel::Fit::Inner, vertex)));
        self.ends[bond.index()][0] = Some(Pair { plus: behind, minus: from.minus });
        Some(Item::Sense { bond, plus: from.plus, minus: behind })
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

/// Junctions of one kind that bonds of the spanning tree join.
fn equal_junctions(graph: &BondGraph, island: &Island) -> Forest {
    let mut equal = Forest::new(graph.vertices.len());
    let closing: HashSet<BondId> = island.closing.iter().copied().collect();
    for id in island.bonds.iter().filter(|id| !closing.contains(id)) {
        let ends = [graph.bond(*id).from.vertex, graph.bond(*id).to.vertex];
        let zero = ends.map(|vertex| matches!(graph.vertex(vertex).law, Law::Zero));
        if ends.into_iter().all(|vertex| is_junction(graph, vertex)) && zero[0] == zero[1] {
            equal.join(ends[0].index(), ends[1].index());
        }
    }
    equal
}

/// Whether a bond closes a ring of junctions of one kind: what runs round it is left undetermined.
fn closes_ring(graph: &BondGraph, equal: &mut Forest, bond: BondId) -> bool {
    let bond = graph.bond(bond);
    let kind = |vertex: crate::bond::graph::VertexId| matches!(graph.vertex(vertex).law, Law::Zero);
    kind(bond.from.vertex) == kind(bond.to.vertex)
        && equal.root(bond.from.vertex.index()) == equal.root(bond.to.vertex.index())
}

/// A graph of an island's ports with fewer bonds cut than these, which are known to leave one; as few as are found.
pub fn fewest(
    graph: &BondGraph,
    island: &Island,
    sensed: &[bool],
    open: &[BondId],
) -> Option<Plan> {
    let mut search = Search::new(graph, island, sensed);
    for size in 0..open.len() {
        // All sets of few bonds, as long as they can be counted.
        if choose(search.candidates.len(), size) > search.trials {
            let found = search.exchange(open.to_vec(), size);
            return found.filter(|plan| plan.cut.len() < open.len());
        }
        if let Some(plan) = search.all(size) {
            return Some(plan);
        }
    }
    None
}

/// The number of sets of `size` out of `count`.
fn choose(count: usize, size: usize) -> usize {
    (0..size).fold(1usize, |sofar, at| sofar.saturating_mul(count.saturating_sub(at)) / (at + 1))
}

struct Search<'a> {
    graph: &'a BondGraph,
    island: &'a Island,
    sensed: &'a [bool],
    /// Bonds between junctions that lie in loops.
    candidates: Vec<BondId>,
    /// How many graphs may still be sought.
    trials: usize,
}

impl Search<'_> {
    fn new<'a>(graph: &'a BondGraph, island: &'a Island, sensed: &'a [bool]) -> Search<'a> {
        let size = island.bonds.len().max(1);
        let trials = (MOST_TRIALS * 100 / size).clamp(50, MOST_TRIALS);
        Search { graph, island, sensed, candidates: in_loops(graph, island), trials }
    }

    fn plan(&mut self, cut: &[BondId]) -> Option<Plan> {
        self.trials = self.trials.saturating_sub(1);
        let sensed = |bond: BondId| self.sensed[bond.index()];
        let space = Space::new(self.graph, self.island, cut, &sensed);
        let graph = space.realise()?;
        Some(Plan { space, graph, cut: cut.to_vec() })
    }

    /// The first set of this size that leaves a graph.
    fn all(&mut self, size: usize) -> Option<Plan> {
        let count = self.candidates.len();
        let mut places: Vec<usize> = (0..size).collect();
        loop {
            let cut: Vec<BondId> = places.iter().map(|place| self.candidates[*place]).collect();
            if let Some(plan) = self.plan(&cut) {
                return Some(plan);
            }
            // The next set in order.
            let at = (0..size).rev().find(|at| places[*at] < count + *at - size)?;
            places[at] += 1;
            for later in at + 1..size {
                places[later] = places[later - 1] + 1;
            }
        }
    }

    /// Fewer and fewer cuts: one is left out, or two are exchanged for another one, as long as a graph remains and trials
    /// are left. Sets smaller than `least` are known to leave none.
    fn exchange(&mut self, start: Vec<BondId>, least: usize) -> Option<Plan> {
        let mut best = self.plan(&start)?;
        'smaller: while best.cut.len() > least && self.trials > 0 {
            let cut = best.cut.clone();
            for out in 0..cut.len() {
                let mut fewer = cut.clone();
                fewer.remove(out);
                if let Some(plan) = self.plan(&fewer) {
                    best = plan;
                    continue 'smaller;
                }
            }
            for candidate in self.candidates.clone() {
                for (second, first) in (1..cut.len()).flat_map(|b| (0..b).map(move |a| (b, a))) {
                    if self.trials == 0 || cut.contains(&candidate) {
                        break;
                    }
                    let mut fewer = cut.clone();
                    fewer.remove(second);
                    fewer[first] = candidate;
                    if let Some(plan) = self.plan(&fewer) {
                        best = plan;
                        continue 'smaller;
                    }
                }
            }
            break;
        }
        Some(best)
    }
}

/// Bonds between junctions without which the junctions still hang together: what the leaves of the graph of junctions
/// and of its bridges leave over.
fn in_loops(graph: &BondGraph, island: &Island) -> Vec<BondId> {
    let inner = |bond: &BondId| {
        let bond = graph.bond(*bond);
        is_junction(graph, bond.from.vertex) && is_junction(graph, bond.to.vertex)
    };
    let closing: HashSet<BondId> = island.closing.iter().copied().collect();
    // Each closing bond marks the way through the tree between its ends.
    let mut above = std::collections::HashMap::new();
    let mut depth = std::collections::HashMap::new();
    let mut waiting = Vec::new();
    if let Some(root) = island.junctions.first() {
        depth.insert(*root, 0usize);
        waiting.push(*root);
    }
    while let Some(vertex) = waiting.pop() {
        for bond in graph.vertex(vertex).bonds.iter().filter(|b| inner(b) && !closing.contains(b)) {
            let ends = [graph.bond(*bond).from.vertex, graph.bond(*bond).to.vertex];
            let far = if ends[0] == vertex { ends[1] } else { ends[0] };
            if !depth.contains_key(&far) {
                depth.insert(far, depth[&vertex] + 1);
                above.insert(far, (vertex, *bond));
                waiting.push(far);
            }
        }
    }
    let mut marked: HashSet<BondId> = closing;
    for bond in &island.closing {
        let (mut a, mut b) = (graph.bond(*bond).from.vertex, graph.bond(*bond).to.vertex);
        while a != b {
            if depth.get(&a) < depth.get(&b) {
                std::mem::swap(&mut a, &mut b);
            }
            let Some((up, way)) = above.get(&a) else { break };
            marked.insert(*way);
            a = *up;
        }
    }
    island.bonds.iter().copied().filter(|bond| marked.contains(bond)).collect()
}
