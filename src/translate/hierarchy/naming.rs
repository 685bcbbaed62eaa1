//! What everything is called in the subcircuit that it stands in.

use super::parts::Part;
use super::places::Places;
use super::ports::{Blocks, Port};
use super::tree::Tree;
use crate::bond::graph::BondGraph;
use crate::netlist::Name;
use crate::translate::Translation;
use crate::translate::names::{Namer, common_part};
use std::collections::{HashMap, HashSet};

/// A node as it is handed through: ground is one node for each block, so that a port that is grounded outside is none
/// the less a terminal inside.
pub type Node = (Name, Option<usize>);

/// A subcircuit's names.
#[derive(Default)]
pub struct Local {
    /// Terminals in order, and what is joined to them outside.
    pub terminals: Vec<(String, Node)>,
    /// The parts that stand here, in order.
    pub parts: Vec<usize>,
    /// The subcircuits that stand here, in order.
    pub inner: Vec<u32>,
    /// Names of nodes.
    pub nodes: HashMap<Node, String>,
    /// Names of devices.
    pub devices: HashMap<Name, String>,
    /// Names of parameters.
    pub parameters: HashMap<Name, String>,
    /// By subcircuit in it: the name of its X card.
    pub cards: HashMap<u32, String>,
    /// Gives out names here.
    pub namer: Namer,
}

/// Everything's names.
pub struct Naming<'f> {
    /// The flat circuit.
    pub flat: &'f Translation,
    /// The graph.
    pub graph: &'f BondGraph,
    /// The blocks of the flat circuit.
    pub blocks: Blocks,
    /// Ground.
    pub ground: Name,
    /// By instance; those of inlined ones are empty.
    pub locals: Vec<Local>,
    /// By node: the innermost subcircuit that all who touch it stand in.
    pub meets: HashMap<Name, u32>,
    /// By device: its subcircuit.
    pub places: HashMap<Name, u32>,
    /// By parameter: its subcircuit.
    pub owners: HashMap<Name, u32>,
    /// By instance: the parameters, by their index, whose subcircuit it is.
    pub owned: Vec<Vec<usize>>,
}

impl<'f> Naming<'f> {
    /// Names everything.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        graph: &'f BondGraph,
        flat: &'f Translation,
        parts: &[Part],
        places: &Places,
        tree: &Tree,
        ports: &Ports,
        blocks: Blocks,
        ground: Name,
    ) -> Naming<'f> {
        let mut naming = Naming {
            flat,
            graph,
            blocks,
            ground,
            locals: tree.instances.iter().map(|_| Local::default()).collect(),
            meets: HashMap::new(),
            places: HashMap::new(),
            owners: HashMap::new(),
            owned: vec![vec![]; tree.instances.len()],
        };
        let scopes: Vec<u32> =
            (0..tree.instances.len() as u32).filter(|k| tree.scope(*k) == *k).collect();
        for (at, part) in parts.iter().enumerate() {
            naming.locals[places[at] as usize].parts.push(at);
            naming.places.extend(part.device.map(|device| (device, places[at])));
        }
        for scope in scopes.iter().copied().filter(|scope| *scope > 0) {
            naming.locals[tree.around(scope) as usize].inner.push(scope);
        }
        // Elements in the order of the file, however they are drawn: equal instances then have equal bodies.
        for local in naming.locals.iter_mut().skip(1) {
            local.parts.sort_by_key(|at| (parts[*at].mark.order, parts[*at].card));
        }
        naming.name_parameters(tree, parts);
        naming.find_meets(&scopes, parts, places, tree, ports);
        for scope in scopes.iter().copied().rev() {
            naming.name(scope, parts, tree, ports);
        }
        naming
    }

    /// Parameters, in the order of the file, those of the file itself first.
    fn name_parameters(&mut self, tree: &Tree, parts: &[Part]) {
        let flat: Vec<Name> = self.flat.map.parameters.iter().map(|(name, _)| *name).collect();
        for (at, instance) in parameter_homes(self.graph, tree).into_iter().enumerate() {
            let scope = tree.scope(instance);
            self.owners.insert(flat[at], scope);
            self.owned[scope as usize].push(at);
        }
        for scope in 0..self.locals.len() as u32 {
            if scope > 0 {
                self.reserve(scope, parts);
            }
            let prefix = prefix(tree, scope);
            let local = &mut self.locals[scope as usize];
            for at in &self.owned[scope as usize] {
                let parameter = &self.graph.parameters[*at];
                let wish = &parameter.name[common_part(&parameter.name, &prefix).len()..];
                let own = local.namer.parameter(wish);
                let text = local.namer.names.text(own).to_string();
                local.parameters.insert(flat[*at], text);
            }
        }
    }

    /// Leaves the file's parameters that are used in a subcircuit their names there.
    fn reserve(&mut self, scope: u32, parts: &[Part]) {
        for at in self.locals[scope as usize].parts.clone() {
            for name in &parts[at].parameters {
                if let Some(text) = self.locals[0].parameters.get(name).cloned()
                    && !self.locals[scope as usize].parameters.contains_key(name)
                {
                    let local = &mut self.locals[scope as usize];
                    local.namer.parameter(&text);
                    local.parameters.insert(*name, text);
                }
            }
        }
    }

    /// Where each node is at home: in the innermost subcircuit around all that touch it. Ports and outputs are touched
    /// from outside, whether or not anything is joined to them.
    fn find_meets(
        &mut self,
        scopes: &[u32],
        parts: &[Part],
        places: &Places,
        tree: &Tree,
        ports: &Ports,
    ) {
        let mut touch = |node: Name, scope: u32| {
            let at = self.meets.entry(node).or_insert(scope);
            *at = tree.common(*at, scope);
        };
        for (part, place) in parts.iter().zip(places) {
            part.nodes.iter().for_each(|node| touch(*node, *place));
        }
        let known: HashSet<Name> =
            parts.iter().flat_map(|part| part.nodes.iter().copied()).collect();
        for scope in scopes.iter().copied().filter(|scope| *scope > 0) {
            let around = tree.around(scope);
            for port in ports.get(&scope).into_iter().flatten() {
                let nodes = port.nodes.iter().filter(|node| **node != self.ground);
                nodes.for_each(|node| touch(*node, around));
            }
            for signal in &tree.instances[scope as usize].outputs {
                let node = self.flat.origins.signals.get(signal.index()).copied().flatten();
                node.filter(|node| known.contains(node))
                    .into_iter()
                    .for_each(|node| touch(node, around));
            }
        }
    }

    /// Nodes and devices of a subcircuit; those in it have their terminals already.
    fn name(&mut self, scope: u32, parts: &[Part], tree: &Tree, ports: &Ports) {
        let prefix = prefix(tree, scope);
        let mut local = std::mem::take(&mut self.locals[scope as usize]);
        let mut needed: Vec<Name> = vec![];
        for at in &local.parts {
            needed.extend(&parts[*at].nodes);
        }
        for inner in &local.inner {
            let terminals = &self.locals[*inner as usize].terminals;
            needed.extend(
                terminals.iter().map(|(_, node)| node.0).filter(|node| *node != self.ground),
            );
        }
        // What came in from around goes by what is left of its name behind what both stand in.
        let own = |wish: &str| wish[common_part(wish, &prefix).len()..].to_string();
        let wish = |node: Name| match self.flat.origins.nodes.get(&node) {
            Some(wish) => own(&wish.name),
            None => self.flat.netlist.names.text(node).to_string(),
        };
        if scope > 0 {
            for port in ports.get(&scope).into_iter().flatten() {
                let block = self.blocks.block(&port.nodes);
                for (node, side) in port.nodes.into_iter().zip(["p", "m"]) {
                    let node = (node, block.filter(|_| node == self.ground));
                    local.terminal(node, &format!("{}_{side}", port.name));
                }
            }
            let outside =
                |node: &Name| self.meets.get(node).is_some_and(|at| !tree.within(*at, scope));
            let instance = &tree.instances[scope as usize];
            for signal in instance.inputs.iter().chain(&instance.outputs) {
                let node = self.flat.origins.signals.get(signal.index()).copied().flatten();
                if let Some(node) = node.filter(|node| outside(node))
                    && !local.nodes.contains_key(&(node, None))
                {
                    local.terminal((node, None), &own(&self.graph.signals[signal.index()].name));
                }
            }
            for node in needed.iter().filter(|node| outside(node)) {
                if !local.nodes.contains_key(&(*node, None)) {
                    local.terminal((*node, None), &wish(*node));
                }
            }
        }
        for node in needed {
            if !local.nodes.contains_key(&(node, None)) {
                let name = local.namer.inner_node(&wish(node));
                local.nodes.insert((node, None), local.namer.names.text(name).to_string());
            }
        }
        for at in local.parts.clone() {
            let Some(device) = parts[at].device else { continue };
            let text = self.flat.netlist.names.text(device);
            let name = match self.flat.origins.devices.get(&device) {
                Some(wish) => local.namer.device(wish.letter, &own(&wish.name)),
                None => local.namer.names.intern(text),
            };
            local.devices.insert(device, local.namer.names.text(name).to_string());
        }
        for inner in local.inner.clone() {
            let name = local.namer.device('X', &own(&tree.instances[inner as usize].name));
            local.cards.insert(inner, local.namer.names.text(name).to_string());
        }
        self.locals[scope as usize] = local;
    }

    /// What stands before the names of a subcircuit's own things from outside: `X_eha_2.X_motor.`
    pub fn path(&self, tree: &Tree, scope: u32) -> String {
        let (mut path, mut at) = (String::new(), scope);
        while at > 0 {
            let around = tree.around(at);
            let card = self.locals[around as usize].cards.get(&at).map_or("", String::as_str);
            path = format!("{card}.{path}");
            at = around;
        }
        path
    }
}

/// By subcircuit: its ports.
pub type Ports = HashMap<u32, Vec<Port>>;

impl Local {
    fn terminal(&mut self, node: Node, wish: &str) {
        let name = self.namer.node(wish);
        let text = self.namer.names.text(name).to_string();
        // Where two terminals are one node outside, the first stands for both.
        self.nodes.entry(node).or_insert_with(|| text.clone());
        self.terminals.push((text, node));
    }
}

/// By parameter: the instance that declares it.
pub fn parameter_homes(graph: &BondGraph, tree: &Tree) -> Vec<u32> {
    let mut homes = vec![0; graph.parameters.len()];
    for (at, instance) in tree.instances.iter().enumerate() {
        for parameter in &instance.parameters {
            if let Some(home) = homes.get_mut(parameter.id.index()) {
                *home = at as u32;
            }
        }
    }
    homes
}

fn prefix(tree: &Tree, scope: u32) -> String {
    match tree.instances[scope as usize].name.as_str() {
        "" => String::new(),
        name => format!("{name}."),
    }
}
