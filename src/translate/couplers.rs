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
use crate::bond::graph::{BondGraph, BondId, Law, VertexId};
use std::collections::{BTreeMap, HashMap, HashSet};

/// Graphs are sought for this many sets of cut bonds in a part of a hundred bonds.
const MOST_TRIALS: usize = 3000;
/// And for this many in any.
const LEAST_TRIALS: usize = 30;

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
        let equal = equal_junctions(graph, island);
        let mut open: Vec<BondId> = Vec::new();
        for bond in &island.closing {
            // What runs round a ring of junctions of one kind is left undetermined.
            let ends = [graph.bond(*bond).from.vertex, graph.bond(*bond).to.vertex];
            let [a, b] = ends.map(|vertex| equal.get(&vertex));
            if a == b && of_one_kind(graph, *bond) {
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

/// Junctions of one kind that bonds of the spanning tree join: the set of each.
fn equal_junctions(graph: &BondGraph, island: &Island) -> HashMap<VertexId, usize> {
    let mut sets = Forest::new(island.junctions.len());
    let junctions = island.junctions.iter().enumerate();
    let mut places: HashMap<VertexId, usize> = junctions.map(|(at, id)| (*id, at)).collect();
    let closing: HashSet<BondId> = island.closing.iter().copied().collect();
    for id in island.bonds.iter().filter(|id| !closing.contains(id)) {
        let ends = [graph.bond(*id).from.vertex, graph.bond(*id).to.vertex];
        if let [Some(a), Some(b)] = ends.map(|vertex| places.get(&vertex))
            && of_one_kind(graph, *id)
        {
            sets.join(*a, *b);
        }
    }
    places.values_mut().for_each(|place| *place = sets.root(*place));
    places
}

/// Whether a bond between junctions joins two of one kind.
fn of_one_kind(graph: &BondGraph, bond: BondId) -> bool {
    let ends = [graph.bond(bond).from.vertex, graph.bond(bond).to.vertex];
    let [a, b] = ends.map(|vertex| matches!(graph.vertex(vertex).law, Law::Zero));
    a == b
}

/// A graph of an island's ports with fewer bonds cut than these, which are known to leave one; as few as are found.
pub fn fewest(
    graph: &BondGraph,
    island: &Island,
    sensed: &[bool],
    open: &[BondId],
) -> Option<Plan> {
    let mut cut = Vec::new();
    for (part, candidates) in parts(graph, island) {
        let known = open.iter().copied().filter(|bond| part.closing.contains(bond)).collect();
        cut.extend(Search::new(graph, &part, sensed, candidates).fewest(known));
    }
    if cut.len() >= open.len() {
        return None;
    }
    plan(graph, island, sensed, &cut)
}

/// The graph of an island's ports with some bonds cut.
fn plan(graph: &BondGraph, island: &Island, sensed: &[bool], cut: &[BondId]) -> Option<Plan> {
    let space = Space::new(graph, island, cut, &|bond| sensed[bond.index()]);
    let realised = space.realise()?;
    Some(Plan { space, graph: realised, cut: cut.to_vec() })
}

/// The parts of an island that hang together without any one bond, with the bonds between their junctions. A bond between two parts joins them as one port of
/// either: there is a graph of the whole when there is one of each.
fn parts(graph: &BondGraph, island: &Island) -> Vec<(Island, Vec<BondId>)> {
    let looping = in_loops(graph, island);
    let mut groups: HashMap<VertexId, usize> = HashMap::new();
    let mut sets = Forest::new(island.junctions.len());
    groups.extend(island.junctions.iter().enumerate().map(|(at, junction)| (*junction, at)));
    let place = |vertex: VertexId| groups.get(&vertex).copied();
    for bond in &looping {
        let bond = graph.bond(*bond);
        if let (Some(a), Some(b)) = (place(bond.from.vertex), place(bond.to.vertex)) {
            sets.join(a, b);
        }
    }
    let mut parts: BTreeMap<usize, (Island, Vec<BondId>)> = BTreeMap::new();
    let set_of = |bond: BondId| Some(sets.root(place(graph.bond(bond).from.vertex)?));
    for bond in &looping {
        let fresh =
            || Island { junctions: vec![], bonds: vec![], closing: vec![], domain: island.domain };
        if let Some(set) = set_of(*bond) {
            parts.entry(set).or_insert_with(|| (fresh(), vec![])).1.push(*bond);
        }
    }
    for (at, junction) in island.junctions.iter().enumerate() {
        if let Some((part, _)) = parts.get_mut(&sets.root(at)) {
            part.junctions.push(*junction);
        }
    }
    for bond in &island.bonds {
        let ends = [graph.bond(*bond).from.vertex, graph.bond(*bond).to.vertex];
        let mut sets: Vec<usize> =
            ends.into_iter().filter_map(place).map(|at| sets.root(at)).collect();
        sets.dedup();
        for set in sets {
            if let Some((part, _)) = parts.get_mut(&set) {
                part.bonds.push(*bond);
            }
        }
    }
    for bond in &island.closing {
        if let Some((part, _)) = set_of(*bond).and_then(|set| parts.get_mut(&set)) {
            part.closing.push(*bond);
        }
    }
    parts.into_values().collect()
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
    fn new<'a>(
        graph: &'a BondGraph,
        island: &'a Island,
        sensed: &'a [bool],
        candidates: Vec<BondId>,
    ) -> Search<'a> {
        // Seeking a graph of a hundred bonds takes about half a millisecond, of ten times as many a hundred times that.
        let size = island.bonds.len().max(100) as f64 / 100.0;
        let trials = ((MOST_TRIALS as f64 / (size * size)) as usize).max(LEAST_TRIALS);
        Search { graph, island, sensed, candidates, trials }
    }

    /// As few bonds to be cut as are found: all sets of few bonds, as long as they can be counted; then fewer than those
    /// that are known.
    fn fewest(&mut self, known: Vec<BondId>) -> Vec<BondId> {
        for size in 0..known.len() {
            if choose(self.candidates.len(), size) > self.trials {
                return self.exchange(known, size);
            }
            if let Some(cut) = self.all(size) {
                return cut;
            }
        }
        known
    }

    fn leaves_graph(&mut self, cut: &[BondId]) -> bool {
        self.trials = self.trials.saturating_sub(1);
        plan(self.graph, self.island, self.sensed, cut).is_some()
    }

    /// The first set of this size that leaves a graph.
    fn all(&mut self, size: usize) -> Option<Vec<BondId>> {
        let count = self.candidates.len();
        let mut places: Vec<usize> = (0..size).collect();
        loop {
            let cut: Vec<BondId> = places.iter().map(|place| self.candidates[*place]).collect();
            if self.leaves_graph(&cut) {
                return Some(cut);
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
    fn exchange(&mut self, known: Vec<BondId>, least: usize) -> Vec<BondId> {
        let mut best = known;
        'smaller: while best.len() > least {
            for out in 0..best.len() {
                let mut fewer = best.clone();
                fewer.remove(out);
                if self.trials == 0 {
                    return best;
                }
                if self.leaves_graph(&fewer) {
                    best = fewer;
                    continue 'smaller;
                }
            }
            for candidate in self.candidates.clone() {
                for (second, first) in (1..best.len()).flat_map(|b| (0..b).map(move |a| (b, a))) {
                    if best.contains(&candidate) {
                        break;
                    }
                    let mut fewer = best.clone();
                    fewer.remove(second);
                    fewer[first] = candidate;
                    if self.trials == 0 {
                        return best;
                    }
                    if self.leaves_graph(&fewer) {
                        best = fewer;
                        continue 'smaller;
                    }
                }
            }
            break;
        }
        best
    }
}

/// Bonds between junctions without which the junctions still hang together: what the leaves of the graph of junctions
/// and of its bridges leave over.
pub fn in_loops(graph: &BondGraph, island: &Island) -> Vec<BondId> {
    let inner = |bond: &BondId| {
        let bond = graph.bond(*bond);
        is_junction(graph, bond.from.vertex) && is_junction(graph, bond.to.vertex)
    };
    let closing: HashSet<BondId> = island.closing.iter().copied().collect();
    // Each closing bond marks the way through the tree between its ends.
    let mut above = HashMap::new();
    let mut depth = HashMap::new();
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
