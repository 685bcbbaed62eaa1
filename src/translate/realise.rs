//! Draws an island from the graph of its ports: nodes, ground, and the voltages between junctions.
//!
//! Connected components of the graph share nothing but ground, so that all are hinged there. Ground is the node against
//! which most 0-junctions have their effort, the − side of most sources among equals: these junctions are nodes then, as
//! an engineer would draw them.

use super::islands::{Island, is_junction};
use super::series_parallel::{Drawing, Fit, Item, Pair, Point};
use super::space::{Kind, Realised, Space};
use crate::bond::graph::{BondGraph, BondId, Law, Power, VertexId};
use std::collections::{BTreeMap, HashMap};

/// A sum of voltages of nodes.
type Sum = BTreeMap<usize, f64>;

/// A graph that an island can be drawn as.
pub struct Plan {
    /// The island's ports.
    pub space: Space,
    /// The graph.
    pub graph: Realised,
    /// Bonds that are cut, and joined by a coupler.
    pub cut: Vec<BondId>,
}

impl Drawing {
    /// Draws an island from its graph.
    pub(super) fn realise(
        &mut self,
        graph: &BondGraph,
        index: usize,
        island: &Island,
        sensed: &[bool],
        plan: &Plan,
    ) {
        let ground = grounds(graph, plan);
        let wishes = wishes(graph, island, plan, &ground);
        let points: Vec<Point> = (0..plan.graph.nodes)
            .map(|node| match ground[plan.graph.component[node]] == node {
                true => 0,
                false => self.point(wishes.get(&node).copied()),
            })
            .collect();
        let place = |[plus, minus]: [usize; 2]| Pair { plus: points[plus], minus: points[minus] };
        let mut item_of = HashMap::new();
        for (port, pair) in plan.space.ports.iter().zip(&plan.graph.pairs) {
            let (bond, pair) = (port.bond, place(*pair));
            match port.kind {
                Kind::Element(end) => {
                    let near = usize::from(!port.outward);
                    self.ends[bond.index()][near] = Some(pair);
                    let near =
                        if port.outward { graph.bond(bond).from } else { graph.bond(bond).to };
                    let named = near.vertex;
                    let mut items = Vec::new();
                    let far = self.cross(graph, &mut items, bond, near, pair, named, sensed);
                    self.ends[bond.index()][usize::from(port.outward)] = Some(far);
                    items.push(Item::Port(end));
                    item_of.insert(bond, items);
                }
                Kind::Sense => {
                    let Pair { plus, minus } = pair;
                    item_of.insert(bond, vec![Item::Sense { bond, plus, minus }]);
                }
                Kind::Cut(side) => {
                    self.ends[bond.index()][side] = Some(pair);
                    if side == 1 {
                        let sense = sensed[bond.index()].then(|| self.sense_before_coupler(bond));
                        let items = sense.flatten().into_iter().chain([Item::Coupler(bond)]);
                        item_of.insert(bond, items.collect());
                    }
                }
            }
        }
        for (bond, efforts) in plan.space.inner_efforts() {
            let ends = [graph.bond(bond).from, graph.bond(bond).to];
            if plan.cut.contains(&bond) || !ends.iter().all(|e| is_junction(graph, e.vertex)) {
                continue;
            }
            for (side, effort) in efforts.into_iter().enumerate() {
                let Some(effort) = effort else { continue };
                let sum = voltages(plan, &effort);
                match pair_of(&sum) {
                    Some(pair) => self.ends[bond.index()][side] = Some(place(pair)),
                    None => {
                        let terms = sum.into_iter().map(|(node, by)| (points[node], by));
                        self.sums.entry(bond).or_insert_with(|| terms.collect());
                    }
                }
            }
        }
        for bond in self.order(graph, island) {
            self.items[index].extend(item_of.remove(&bond).unwrap_or_default());
        }
    }

    /// The bonds of an island as one comes upon them, from the first junction on, sources first.
    fn order(&self, graph: &BondGraph, island: &Island) -> Vec<BondId> {
        let mut seen = std::collections::HashSet::new();
        let mut order = Vec::new();
        let mut waiting: Vec<VertexId> = island.junctions.first().copied().into_iter().collect();
        let mut reached: std::collections::HashSet<VertexId> = waiting.iter().copied().collect();
        while let Some(junction) = waiting.pop() {
            let mut bonds = graph.vertex(junction).bonds.clone();
            bonds.sort_by_key(|bond| self.place(graph, *bond, junction));
            let mut next = Vec::new();
            for bond in bonds.into_iter().filter(|bond| seen.insert(*bond)) {
                order.push(bond);
                let ends = [graph.bond(bond).from.vertex, graph.bond(bond).to.vertex];
                let far = ends.into_iter().find(|vertex| *vertex != junction);
                next.extend(far.filter(|far| is_junction(graph, *far) && reached.insert(*far)));
            }
            waiting.extend(next.into_iter().rev());
        }
        order
    }
}

/// A sum of port efforts as one of node voltages.
fn voltages(plan: &Plan, effort: &[(usize, f64)]) -> Sum {
    let mut sum = Sum::new();
    for (port, by) in effort {
        let [plus, minus] = plan.graph.pairs[*port];
        *sum.entry(plus).or_insert(0.0) += by;
        *sum.entry(minus).or_insert(0.0) -= by;
    }
    sum.retain(|_, by| *by != 0.0);
    sum
}

/// The nodes between which a sum is the voltage.
fn pair_of(sum: &Sum) -> Option<[usize; 2]> {
    let mut terms = sum.iter();
    match (terms.next(), terms.next(), terms.next()) {
        (Some((a, x)), Some((b, y)), None) if *x == 1.0 && *y == -1.0 => Some([*a, *b]),
        (Some((a, x)), Some((b, y)), None) if *x == -1.0 && *y == 1.0 => Some([*b, *a]),
        _ => None,
    }
}

/// 0-junctions in file order, with the nodes between which their effort stands.
fn zeros(graph: &BondGraph, plan: &Plan) -> Vec<(VertexId, [usize; 2])> {
    let mut found = BTreeMap::new();
    for (bond, efforts) in plan.space.inner_efforts() {
        let ends = [graph.bond(bond).from, graph.bond(bond).to];
        for (end, effort) in ends.into_iter().zip(efforts) {
            if matches!(graph.vertex(end.vertex).law, Law::Zero)
                && let Some(pair) = effort.and_then(|effort| pair_of(&voltages(plan, &effort)))
            {
                found.entry(end.vertex).or_insert(pair);
            }
        }
    }
    found.into_iter().collect()
}

/// By component: its ground.
fn grounds(graph: &BondGraph, plan: &Plan) -> Vec<usize> {
    let mut votes = vec![(0, 0); plan.graph.nodes];
    for (_, [_, minus]) in zeros(graph, plan) {
        votes[minus].0 += 1;
    }
    for (port, [_, minus]) in plan.space.ports.iter().zip(&plan.graph.pairs) {
        if let Kind::Element(end) = port.kind
            && let Law::Source { sets: Power::Effort, .. } = graph.vertex(end.vertex).law
        {
            votes[*minus].1 += 1;
        }
    }
    let components = plan.graph.component.iter().max().map_or(0, |last| last + 1);
    let mut ground: Vec<Option<usize>> = vec![None; components];
    for (node, component) in plan.graph.component.iter().enumerate() {
        let best = &mut ground[*component];
        if best.is_none_or(|best| votes[best] < votes[node]) {
            *best = Some(node);
        }
    }
    ground.into_iter().flatten().collect()
}

/// By node: which junction gives it its name.
fn wishes(
    graph: &BondGraph,
    island: &Island,
    plan: &Plan,
    ground: &[usize],
) -> HashMap<usize, (Fit, VertexId)> {
    let mut wishes = HashMap::new();
    for (junction, [plus, minus]) in zeros(graph, plan) {
        if ground[plan.graph.component[minus]] == minus {
            wishes.entry(plus).or_insert((Fit::Exact, junction));
        }
    }
    let mut inner = |kind: fn(&Law) -> bool| {
        for (port, pair) in plan.space.ports.iter().zip(&plan.graph.pairs) {
            let bond = graph.bond(port.bond);
            let ends = [bond.from.vertex, bond.to.vertex].into_iter();
            let mut near = ends.filter(|vertex| is_junction(graph, *vertex));
            if let Some(junction) = near.find(|vertex| kind(&graph.vertex(*vertex).law)) {
                pair.iter().for_each(|node| {
                    wishes.entry(*node).or_insert((Fit::Inner, junction));
                });
            }
        }
    };
    inner(|law| matches!(law, Law::One));
    inner(|law| matches!(law, Law::Zero));
    if let Some(first) = island.junctions.first() {
        for node in 0..plan.graph.nodes {
            wishes.entry(node).or_insert((Fit::Inner, *first));
        }
    }
    wishes
}
