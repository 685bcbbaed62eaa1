//! The port condition, decided on the realised circuit.
//!
//! An instance may stand in a subcircuit when its cards and the others meet only at the terminals of its ports, and the
//! currents into each port's two terminals add up to zero whatever the elements do. Cards on both sides are the edges
//! of one graph, and their currents its cycle space; a sum of currents into the instance is zero on that space exactly
//! when it is a cut: when there is a potential that is constant on each component of the outer edges, and, but for the
//! summed terminals, on each component of the inner ones. Ports that share a node need not be told apart there: what
//! the one's terminal takes, the other's gives.
//!
//! Blocks are what hangs together without ground: they share nothing but it, no current runs from one to another, and
//! each has its own piece of ground. So an instance whose ports lie in several islands, all grounded, is no less a set
//! of ports for it.

use super::parts::Part;
use super::tree::Tree;
use crate::bond::graph::{BondGraph, Instance};
use crate::netlist::{Name, Names};
use crate::translate::Translation;
use crate::translate::forest::Forest;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// The circuit of powers in blocks.
pub struct Blocks {
    ground: Name,
    /// By node: the head of its block.
    head: Vec<usize>,
    /// By head: the instances of its cards, and the nodes between which they stand.
    edges: HashMap<usize, Vec<(u32, [Name; 2])>>,
    /// By head and node: how many ends of cards stand there.
    ends: HashMap<(usize, Name), usize>,
    /// By instance: the heads and nodes of its own cards, and the instances in it.
    own: Vec<Vec<(usize, [Name; 2])>>,
    inner: Vec<Vec<u32>>,
    /// By instance: the blocks that its cards, and those of instances in it, stand in.
    touched: Vec<BTreeSet<usize>>,
}

/// A port of an instance: its name, and the nodes of its terminals.
#[derive(Clone, Debug)]
pub struct Port {
    /// As the model calls it.
    pub name: String,
    /// + and −.
    pub nodes: [Name; 2],
}

impl Blocks {
    /// The blocks of a circuit.
    pub fn of(parts: &[Part], ground: Name, names: &Names, instances: &[Instance]) -> Blocks {
        let mut forest = Forest::new(names.len());
        for [a, b] in parts.iter().flat_map(|part| &part.edges) {
            if *a != ground && *b != ground {
                forest.join(a.0 as usize, b.0 as usize);
            }
        }
        let head: Vec<usize> = (0..names.len()).map(|node| forest.root(node)).collect();
        let mut edges: HashMap<usize, Vec<(u32, [Name; 2])>> = HashMap::new();
        let mut touched = vec![BTreeSet::new(); instances.len()];
        let mut ends: HashMap<(usize, Name), usize> = HashMap::new();
        let mut own = vec![vec![]; instances.len()];
        let mut inner = vec![vec![]; instances.len()];
        for part in parts.iter().filter(|part| part.power) {
            for pair in &part.edges {
                if let Some(node) = pair.iter().find(|node| **node != ground) {
                    let head = head[node.0 as usize];
                    edges.entry(head).or_default().push((part.mark.home, *pair));
                    touched[part.mark.home as usize].insert(head);
                    own[part.mark.home as usize].push((head, *pair));
                    pair.iter().for_each(|node| *ends.entry((head, *node)).or_default() += 1);
                }
            }
        }
        // Those inside stand behind those around them.
        for at in (1..instances.len()).rev() {
            let parent = instances[at].parent.unwrap_or(0) as usize;
            let own = touched[at].clone();
            touched[parent].extend(own);
            inner[parent].push(at as u32);
        }
        Blocks { ground, head, edges, ends, own, inner, touched }
    }

    /// The block of some nodes; `None` when all of them are ground.
    pub fn block(&self, nodes: &[Name]) -> Option<usize> {
        nodes.iter().find(|node| **node != self.ground).map(|node| self.head[node.0 as usize])
    }

    /// Why an instance with these ports cannot be a subcircuit; `None` when it can.
    pub fn obstacle(
        &self,
        tree: &Tree,
        instance: u32,
        ports: &[Port],
        names: &Names,
    ) -> Option<String> {
        let mut own: BTreeMap<usize, Vec<&Port>> = BTreeMap::new();
        for port in ports {
            let [plus, minus] = port.nodes;
            let (a, b) = (self.block(&[plus]), self.block(&[minus]));
            match (a, b) {
                (Some(a), Some(b)) if a != b => {
                    return Some(format!(
                        "the sides of its port {} meet at ground alone",
                        port.name
                    ));
                }
                (None, None) => return Some(format!("its port {} is shorted", port.name)),
                (Some(block), _) | (_, Some(block)) => own.entry(block).or_default().push(port),
            }
        }
        for block in &self.touched[instance as usize] {
            own.entry(*block).or_default();
        }
        own.iter().find_map(|(block, ports)| self.obstacle_in(*block, tree, instance, ports, names))
    }

    fn obstacle_in(
        &self,
        block: usize,
        tree: &Tree,
        instance: u32,
        ports: &[&Port],
        names: &Names,
    ) -> Option<String> {
        let boundary = self.boundary(block, instance);
        let terminals: HashSet<Name> = ports.iter().flat_map(|port| port.nodes).collect();
        if let Some(node) = boundary.iter().find(|node| !terminals.contains(node)) {
            let node = if *node == self.ground { "ground" } else { names.text(*node) };
            return Some(format!("it meets the rest at {node}, which is no terminal of its ports"));
        }
        // Ports that share nodes count as one.
        let mut groups: Vec<HashSet<Name>> = vec![];
        for port in ports {
            let mut group: HashSet<Name> = port.nodes.into_iter().collect();
            groups.retain(|other| {
                let apart = other.is_disjoint(&group);
                if !apart {
                    group.extend(other);
                }
                apart
            });
            groups.push(group);
        }
        // The sum of all is zero, so that the last needs no proof.
        let (_, others) = groups.split_last()?;
        if others.is_empty() {
            return None;
        }
        let (inner, outer): (Vec<_>, Vec<_>) =
            (self.edges.get(&block)?.iter()).partition(|(home, _)| tree.stands_in(*home, instance));
        let [inner, outer] = [inner, outer].map(Side::of);
        let unsound = others.iter().find(|group| !is_cut(&inner, &outer, &boundary, group))?;
        let port = ports.iter().find(|port| unsound.contains(&port.nodes[0]));
        let name = port.map_or("", |port| port.name.as_str());
        Some(format!("what enters its port {name} at + need not leave it at −"))
    }
}

impl Blocks {
    /// The nodes of a block at which both cards of an instance, or in it, and others stand.
    fn boundary(&self, block: usize, instance: u32) -> Vec<Name> {
        let mut own: HashMap<Name, usize> = HashMap::new();
        let mut waiting = vec![instance];
        while let Some(at) = waiting.pop() {
            for (head, pair) in &self.own[at as usize] {
                if *head == block {
                    pair.iter().for_each(|node| *own.entry(*node).or_default() += 1);
                }
            }
            waiting.extend(&self.inner[at as usize]);
        }
        let shared = |(node, own): (Name, usize)| {
            self.ends.get(&(block, node)).is_some_and(|all| *all > own).then_some(node)
        };
        let mut boundary: Vec<Name> = own.into_iter().filter_map(shared).collect();
        boundary.sort_unstable();
        boundary
    }
}

/// The edges of one side: by node, its component.
struct Side {
    place: HashMap<Name, usize>,
    count: usize,
}

impl Side {
    fn of(edges: Vec<&(u32, [Name; 2])>) -> Side {
        let mut place = HashMap::new();
        for node in edges.iter().flat_map(|(_, pair)| pair) {
            let next = place.len();
            place.entry(*node).or_insert(next);
        }
        let mut forest = Forest::new(place.len());
        for (_, [a, b]) in edges {
            if let (Some(a), Some(b)) = (place.get(a), place.get(b)) {
                forest.join(*a, *b);
            }
        }
        let count = place.len();
        for at in place.values_mut() {
            *at = forest.root(*at);
        }
        Side { place, count }
    }
}

/// Whether the currents into the inner side at these nodes add up to zero whatever flows.
fn is_cut(inner: &Side, outer: &Side, boundary: &[Name], nodes: &HashSet<Name>) -> bool {
    // Inner components, then outer ones; each node of the boundary sets the difference of two.
    let mut next: Vec<Vec<(usize, i32)>> = vec![vec![]; inner.count + outer.count];
    for node in boundary {
        let (Some(a), Some(b)) = (inner.place.get(node), outer.place.get(node)) else { continue };
        let step = i32::from(nodes.contains(node));
        next[*a].push((inner.count + b, step));
        next[inner.count + b].push((*a, -step));
    }
    let mut potential: Vec<Option<i32>> = vec![None; next.len()];
    for start in 0..next.len() {
        if potential[start].is_some() {
            continue;
        }
        potential[start] = Some(0);
        let mut waiting = vec![start];
        while let Some(at) = waiting.pop() {
            let here = potential[at].unwrap_or(0);
            for (to, step) in &next[at] {
                match potential[*to] {
                    None => {
                        potential[*to] = Some(here + step);
                        waiting.push(*to);
                    }
                    Some(there) if there != here + step => return false,
                    Some(_) => {}
                }
            }
        }
    }
    true
}

/// The ports of an instance as pairs of nodes, or the one that the circuit has no such pair for.
pub fn ports(
    graph: &BondGraph,
    flat: &Translation,
    tree: &Tree,
    instance: u32,
    homes: &[u32],
    outer: &HashMap<Name, Vec<u32>>,
) -> Result<Vec<Port>, String> {
    let own = &tree.instances[instance as usize].ports;
    let mut found = vec![];
    for (name, bond) in own {
        let ends = [graph.bond(*bond).from, graph.bond(*bond).to];
        let inside = ends.map(|end| tree.stands_in(homes[end.vertex.index()], instance));
        let pairs = flat.origins.pairs.get(bond.index()).copied().unwrap_or_default();
        let (inner, outside) = match inside {
            [true, false] => (pairs[0], pairs[1]),
            _ => (pairs[1], pairs[0]),
        };
        // Between the two a source may carry the flow; the terminals are where the others stand.
        let touched = |node: &Name| {
            let homes = outer.get(node).map_or(&[][..], Vec::as_slice);
            homes.iter().any(|home| !tree.stands_in(*home, instance))
        };
        let nodes = match (inner, outside) {
            (Some(inner), Some(outside)) => {
                let new = inner.iter().filter(|node| !outside.contains(node));
                if new.clone().all(touched) { inner } else { outside }
            }
            (Some(pair), None) | (None, Some(pair)) => pair,
            (None, None) => {
                return Err(format!("the effort of its port {name} is that of no two nodes"));
            }
        };
        found.push(Port { name: name.clone(), nodes });
    }
    Ok(found)
}
