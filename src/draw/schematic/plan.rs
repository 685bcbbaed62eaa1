//! Which nodes stand along the line, and what hangs on each.

use crate::circuit::{Circuit, DeviceId, NodeId};
use std::collections::{BTreeMap, BTreeSet};

/// A way from a node to ground.
#[derive(Clone, Debug)]
pub struct Shunt {
    /// Its first device.
    pub device: DeviceId,
    /// The node behind it, and what leads on from there; nothing where that is ground.
    pub behind: Option<(NodeId, Vec<Shunt>)>,
}

/// A device between two nodes of the line, by their numbers along it.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// The device.
    pub device: DeviceId,
    /// The node further to the left, and to the right.
    pub ends: (usize, usize),
}

/// A part of the circuit that hangs together without ground.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// The nodes along the line, and what hangs on each.
    pub line: Vec<(NodeId, Vec<Shunt>)>,
    /// What stands between them.
    pub spans: Vec<Span>,
}

/// Two-terminal devices by the nodes they join; a device of four nodes counts as one for each pair.
struct Graph {
    ends: Vec<(DeviceId, NodeId, NodeId)>,
    /// By node: its neighbours but ground.
    beside: BTreeMap<NodeId, BTreeSet<NodeId>>,
}

const GROUND: NodeId = NodeId(0);

/// Plans the drawing of the devices that are kept.
///
/// # Errors
/// How many devices a part has that has more than `most`.
pub fn plan(
    circuit: &Circuit,
    keep: &dyn Fn(DeviceId) -> bool,
    most: usize,
) -> Result<Vec<Part>, usize> {
    let mut graph = Graph { ends: vec![], beside: BTreeMap::new() };
    for (k, device) in circuit.devices.iter().enumerate() {
        let id = DeviceId(k as u32);
        let [a, b, ..] = device.nodes[..] else { continue };
        if !keep(id) || a == b {
            continue;
        }
        graph.ends.push((id, a, b));
        for (own, other) in [(a, b), (b, a)] {
            if own != GROUND {
                let beside = graph.beside.entry(own).or_default();
                if other != GROUND {
                    beside.insert(other);
                }
            }
        }
    }
    // Parts in the order of their first devices.
    let mut parts = vec![];
    let mut seen = BTreeSet::new();
    let order: Vec<NodeId> = graph.ends.iter().flat_map(|(_, a, b)| [*a, *b]).collect();
    for node in order {
        if node != GROUND && !seen.contains(&node) {
            let nodes = graph.reach(node);
            let own: BTreeSet<NodeId> = nodes.iter().copied().collect();
            let is_own =
                |(_, a, b): &&(DeviceId, NodeId, NodeId)| own.contains(a) || own.contains(b);
            let devices = graph.ends.iter().filter(is_own).count();
            if devices > most {
                return Err(devices);
            }
            seen.extend(own);
            parts.push(graph.part(&nodes));
        }
    }
    Ok(parts)
}

impl Graph {
    /// All nodes that hang together with one.
    fn reach(&self, start: NodeId) -> Vec<NodeId> {
        let mut found = vec![start];
        let mut seen = BTreeSet::from([start]);
        let mut at = 0;
        while at < found.len() {
            found.extend(self.beside[&found[at]].iter().copied().filter(|next| seen.insert(*next)));
            at += 1;
        }
        found
    }

    fn part(&self, nodes: &[NodeId]) -> Part {
        let line = self.line(nodes);
        let place: BTreeMap<NodeId, usize> =
            line.iter().enumerate().map(|(k, n)| (*n, k)).collect();
        let on_line: BTreeSet<NodeId> = line.iter().copied().collect();
        let mut part = Part::default();
        for node in &line {
            part.line.push((*node, self.shunts(*node, None, &on_line)));
        }
        for (device, a, b) in &self.ends {
            if let (Some(a), Some(b)) = (place.get(a), place.get(b)) {
                part.spans.push(Span { device: *device, ends: (*a.min(b), *a.max(b)) });
            }
        }
        part
    }

    /// What leads from a node to ground without the line.
    fn shunts(&self, node: NodeId, from: Option<NodeId>, line: &BTreeSet<NodeId>) -> Vec<Shunt> {
        let mut found = vec![];
        for (device, a, b) in &self.ends {
            let other = if *a == node {
                *b
            } else if *b == node {
                *a
            } else {
                continue;
            };
            if other == GROUND {
                found.push(Shunt { device: *device, behind: None });
            } else if Some(other) != from && !line.contains(&other) {
                let behind = self.shunts(other, Some(node), line);
                found.push(Shunt { device: *device, behind: Some((other, behind)) });
            }
        }
        found
    }

    /// The nodes along the line: those of all meshes without ground, then the longest ways on from its ends; where there
    /// is no mesh, the longest way of all.
    fn line(&self, nodes: &[NodeId]) -> Vec<NodeId> {
        let mut core: BTreeSet<NodeId> = nodes.iter().copied().collect();
        let several = |a: NodeId, b: NodeId| {
            let joins =
                |(_, p, q): &&(DeviceId, NodeId, NodeId)| (*p, *q) == (a, b) || (*p, *q) == (b, a);
            self.ends.iter().filter(joins).count() > 1
        };
        // Leaves fall off, again and again; one that is joined twice is no leaf.
        loop {
            let leaf = core.iter().copied().find(|node| {
                let mut beside = self.beside[node].iter().filter(|other| core.contains(other));
                match (beside.next(), beside.next()) {
                    (None, _) => true,
                    (Some(other), None) => !several(*node, *other),
                    _ => false,
                }
            });
            match leaf {
                Some(leaf) => core.remove(&leaf),
                None => break,
            };
        }
        if core.is_empty() {
            let (far, _) = self.farthest(nodes[0], &|_| true);
            let mut way = self.farthest(far, &|_| true).1;
            // In the order of the cards, as far as an order shows.
            let first = |node: &NodeId| nodes.iter().position(|other| other == node);
            if way.first().map(first) > way.last().map(first) {
                way.reverse();
            }
            return way;
        }
        let mut line = self.core_order(nodes, &core);
        for last in [true, false] {
            let end = if last { line.last() } else { line.first() };
            let Some(end) = end.copied() else { break };
            let free =
                |node: NodeId| node == end || (!core.contains(&node) && !line.contains(&node));
            let mut way = self.farthest(end, &free).1;
            way.retain(|node| *node != end);
            if last {
                line.extend(way.into_iter().rev().collect::<Vec<_>>().into_iter().rev());
            } else {
                way.reverse();
                line.splice(0..0, way);
            }
        }
        line
    }

    /// The nodes of meshes: one after the other, each next to as many as stand already as can be.
    fn core_order(&self, nodes: &[NodeId], core: &BTreeSet<NodeId>) -> Vec<NodeId> {
        let start = nodes.iter().copied().find(|node| core.contains(node));
        let mut line: Vec<NodeId> = start.into_iter().collect();
        while line.len() < core.len() {
            let score = |node: &&NodeId| {
                let beside = &self.beside[*node];
                let before = line.iter().enumerate().filter(|(_, n)| beside.contains(n));
                // The nearest of those that stand already weighs most.
                let near = before.clone().map(|(k, _)| k + 1).max().unwrap_or(0);
                (near, before.count())
            };
            let next = core.iter().filter(|node| !line.contains(node)).max_by_key(score);
            line.extend(next.copied());
        }
        line
    }

    /// The node farthest from one, and the way there.
    fn farthest(&self, start: NodeId, allowed: &dyn Fn(NodeId) -> bool) -> (NodeId, Vec<NodeId>) {
        let mut before: BTreeMap<NodeId, NodeId> = BTreeMap::new();
        let mut order = vec![start];
        let mut at = 0;
        while at < order.len() {
            for next in &self.beside[&order[at]] {
                if allowed(*next) && *next != start && !before.contains_key(next) {
                    before.insert(*next, order[at]);
                    order.push(*next);
                }
            }
            at += 1;
        }
        let last = order[order.len() - 1];
        let mut way = vec![last];
        while let Some(next) = before.get(&way[way.len() - 1]) {
            way.push(*next);
        }
        way.reverse();
        (last, way)
    }
}
