//! Draws trees of junctions as an engineer would: a 0-junction is a node and its return, a 1-junction a series loop.
//!
//! A bond stands between two nodes, plus and minus: v(plus) − v(minus) is its effort, and its flow runs along its half
//! arrow in the wire of the plus node and back in the other. At a 0-junction all bonds share one pair. At a 1-junction
//! the common flow runs round a loop through each bond's pair in turn: from plus to minus where the half arrow points
//! out of the junction (a drop), from minus to plus where it points in (a rise).

use super::couplers::fewest;
use super::flows::Sense;
use super::forest::Forest;
use super::islands::{Island, is_junction, junction_end, other_end};
use crate::bond::graph::{BondGraph, BondId, End, Law, Power, VertexId};
use std::collections::{HashMap, HashSet};

/// A node while circuits are drawn; nodes may be joined later. 0 is ground.
pub type Point = usize;

/// The nodes between which a bond stands, at one of its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Its + node.
    pub plus: Point,
    /// Its − node.
    pub minus: Point,
}

/// What stands in the circuit, in drawing order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Item {
    /// A port of an element.
    Port(End),
    /// The 0 V source of a bond, + node and − node.
    Sense { bond: BondId, plus: Point, minus: Point },
    /// A 1:1 coupler in a bond that closes a loop of junctions.
    Coupler(BondId),
}

/// How much a name fits a node: the lowest wins where nodes are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fit {
    /// It is the effort of this 0-junction or of this bond between two elements.
    Exact,
    /// It lies within the loop of this 1-junction.
    Inner,
}

/// Where everything stands.
pub struct Drawing {
    /// Points, those joined by a wire in one set.
    pub points: Forest,
    /// By point: which junction or element gives it its name.
    pub wishes: Vec<Option<(Fit, VertexId)>>,
    /// By bond: the pairs at its tail and at its head; the two differ by a 0 V source or a coupler at most.
    pub ends: Vec<[Option<Pair>; 2]>,
    /// Efforts of bonds inside an island that stand between no two nodes: a sum of node voltages.
    pub sums: HashMap<BondId, Vec<(Point, f64)>>,
    /// By island: what stands in it.
    pub items: Vec<Vec<Item>>,
}

/// Where the common flow of a 1-junction enters and leaves the part of the loop that is still to be drawn.
struct Loop {
    start: Point,
    end: Point,
}

impl Drawing {
    /// Draws every island's tree, its first junction first and on ground.
    pub fn draw(graph: &BondGraph, islands: &[Island], senses: &[Sense]) -> Drawing {
        let mut drawing = Drawing {
            points: Forest::new(1),
            wishes: vec![None],
            ends: vec![[None; 2]; graph.bonds.len()],
            sums: HashMap::new(),
            items: vec![Vec::new(); islands.len()],
        };
        let mut sensed = vec![false; graph.bonds.len()];
        senses.iter().for_each(|sense| sensed[sense.bond.index()] = true);
        for (index, island) in islands.iter().enumerate() {
            let before = drawing.points.len();
            drawing.draw_tree(graph, index, island, &sensed);
            let open = drawing.close_by_wires(graph, index, island, &sensed);
            if open.is_empty() {
                continue;
            }
            match fewest(graph, island, &sensed, &open) {
                Some(plan) => {
                    drawing.erase(index, island, before);
                    drawing.realise(graph, index, island, &sensed, &plan);
                }
                None => drawing.couple(index, &open, &sensed),
            }
        }
        drawing
    }

    /// Takes an island, drawn last, out again, with all points from `first` on.
    fn erase(&mut self, index: usize, island: &Island, first: Point) {
        self.points.truncate(first);
        self.wishes.truncate(first);
        self.items[index].clear();
        for bond in &island.bonds {
            self.ends[bond.index()] = [None; 2];
        }
    }

    /// The pair at one end of a bond.
    pub fn pair(&self, graph: &BondGraph, bond: BondId, end: End) -> Option<Pair> {
        self.ends[bond.index()][usize::from(graph.bond(bond).from != end)].map(|p| self.joined(p))
    }

    /// A pair in terms of the points that stand for their sets.
    pub fn joined(&self, pair: Pair) -> Pair {
        Pair { plus: self.points.root(pair.plus), minus: self.points.root(pair.minus) }
    }

    pub(super) fn point(&mut self, wish: Option<(Fit, VertexId)>) -> Point {
        self.wishes.push(wish);
        self.points.add()
    }

    fn draw_tree(&mut self, graph: &BondGraph, index: usize, island: &Island, sensed: &[bool]) {
        let Some(root) = island.junctions.first().copied() else {
            for bond in &island.bonds {
                self.draw_lone(graph, index, *bond, sensed);
            }
            return;
        };
        let closing: HashSet<BondId> = island.closing.iter().copied().collect();
        let first = match graph.vertex(root).law {
            Law::Zero => Pair { plus: self.point(Some((Fit::Exact, root))), minus: 0 },
            _ => Pair { plus: 0, minus: 0 },
        };
        let mut waiting = vec![(root, None, first)];
        while let Some((junction, parent, pair)) = waiting.pop() {
            let mut bonds: Vec<BondId> = graph
                .vertex(junction)
                .bonds
                .iter()
                .copied()
                .filter(|b| Some(*b) != parent)
                .collect();
            bonds.sort_by_key(|bond| self.place(graph, *bond, junction));
            let pairs = match graph.vertex(junction).law {
                Law::Zero => vec![pair; bonds.len()],
                _ => self.series(graph, junction, parent, pair, &bonds),
            };
            let mut children = Vec::new();
            for (bond, near) in bonds.into_iter().zip(pairs) {
                let near_end = junction_end(junction);
                let far_end = other_end(graph, bond, near_end);
                self.set(graph, bond, near_end, near);
                if closing.contains(&bond) {
                    continue;
                }
                let mut items = Vec::new();
                let far = self.cross(graph, &mut items, bond, near_end, near, junction, sensed);
                self.items[index].extend(items);
                self.set(graph, bond, far_end, far);
                if is_junction(graph, far_end.vertex) {
                    children.push((far_end.vertex, Some(bond), far));
                } else {
                    self.items[index].push(Item::Port(far_end));
                }
            }
            waiting.extend(children.into_iter().rev());
        }
    }

    /// Two elements that share a bond: a node and its return.
    fn draw_lone(&mut self, graph: &BondGraph, index: usize, id: BondId, sensed: &[bool]) {
        let bond = graph.bond(id);
        let two_port = |end: End| graph.vertex(end.vertex).bonds.len() > 1;
        let named = if two_port(bond.from) { bond.to.vertex } else { bond.from.vertex };
        let pair = Pair { plus: self.point(Some((Fit::Exact, named))), minus: 0 };
        self.set(graph, id, bond.from, pair);
        self.items[index].push(Item::Port(bond.from));
        let mut items = Vec::new();
        let far = self.cross(graph, &mut items, id, bond.from, pair, named, sensed);
        self.items[index].extend(items);
        self.set(graph, id, bond.to, far);
        self.items[index].push(Item::Port(bond.to));
    }

    fn set(&mut self, graph: &BondGraph, bond: BondId, end: End, pair: Pair) {
        let at = usize::from(graph.bond(bond).from != end);
        self.ends[bond.index()][at] = Some(pair);
        let vertex = graph.vertex(end.vertex);
        if matches!(vertex.law, Law::Zero) && pair.plus != 0 {
            let wish = &mut self.wishes[pair.plus];
            if wish.is_none_or(|(fit, _)| fit != Fit::Exact) {
                *wish = Some((Fit::Exact, end.vertex));
            }
        }
    }

    /// The pair at the far end of a bond: the near one, or behind a 0 V source in the + wire.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn cross(
        &mut self,
        graph: &BondGraph,
        items: &mut Vec<Item>,
        bond: BondId,
        near_end: End,
        near: Pair,
        named: VertexId,
        sensed: &[bool],
    ) -> Pair {
        if !sensed[bond.index()] {
            return near;
        }
        let far = Pair { plus: self.point(Some((Fit::Inner, named))), minus: near.minus };
        let (plus, minus) = if graph.bond(bond).from == near_end {
            (near.plus, far.plus)
        } else {
            (far.plus, near.plus)
        };
        items.push(Item::Sense { bond, plus, minus });
        far
    }

    /// The pairs of a 1-junction's bonds, which stand one behind the other along the common flow.
    fn series(
        &mut self,
        graph: &BondGraph,
        junction: VertexId,
        parent: Option<BondId>,
        pair: Pair,
        bonds: &[BondId],
    ) -> Vec<Pair> {
        let inward = |bond: BondId| graph.bond(bond).to.vertex == junction;
        // The common flow comes in at the parent's + where its half arrow points in, and goes round from − otherwise.
        let way = match parent {
            Some(bond) if !inward(bond) => Loop { start: pair.minus, end: pair.plus },
            _ => Loop { start: pair.plus, end: pair.minus },
        };
        let mut at = way.start;
        let mut pairs = Vec::with_capacity(bonds.len());
        for (position, bond) in bonds.iter().enumerate() {
            let next = if position + 1 == bonds.len() {
                way.end
            } else {
                self.point(Some((Fit::Inner, junction)))
            };
            pairs.push(if inward(*bond) {
                Pair { plus: next, minus: at }
            } else {
                Pair { plus: at, minus: next }
            });
            at = next;
        }
        pairs
    }

    /// The place of a bond among its junction's: sources first, loads last, and 0-junctions at the ends of a loop,
    /// where their return meets ground.
    pub(super) fn place(&self, graph: &BondGraph, bond: BondId, junction: VertexId) -> u32 {
        let far = other_end(graph, bond, junction_end(junction));
        let vertex = graph.vertex(far.vertex);
        let inward = graph.bond(bond).to.vertex == junction;
        let source = matches!(vertex.law, Law::Source { sets: Power::Effort, detector: false, .. });
        let two_port = matches!(vertex.law, Law::Transformer(_) | Law::Gyrator(_));
        match (&vertex.law, inward) {
            (Law::Zero, true) => 0,
            (_, true) if source => 1,
            (_, true) if two_port => 2,
            (Law::One, true) => 4,
            (_, true) => 3,
            (Law::Zero, false) => 9,
            (_, false) if two_port => 8,
            (_, false) if source => 7,
            (Law::One, false) => 6,
            (_, false) => 5,
        }
    }
}
