//! Instances as subcircuits: the flat circuit of a translation folded along the models that it came from.
//!
//! The circuit stays the same device by device: expanding the subcircuits again gives the flat one. What is decided here
//! is where each card stands.
//!
//! 1. `parts`: what each card touches;
//! 2. `ports`: which instances meet the rest at their ports alone (the port condition);
//! 3. `places`: which cards stand in which of them, and what must stand inlined since somebody looks into it;
//! 4. `naming`: terminals, nodes, devices and parameters of each;
//! 5. `bodies`, `variants`: equal ones share a subcircuit;
//! 6. `told`: the map and the header in the new names.

mod bodies;
mod naming;
mod parts;
mod places;
mod ports;
mod told;
mod tree;
mod variants;
mod words;
#[cfg(test)]
mod tests;

use super::experiment::portable;
use super::names::common_part;
use super::{Map, Translation};
use crate::bond::causality::Causality;
use crate::bond::graph::{self, BondGraph, InstanceParameter};
use crate::expr::Node;
use crate::netlist::{Card, CardKind, Device, Element, Expr, Leaf, Name, Netlist};
use crate::source::{SourceMap, Span};
use bodies::Lift;
use naming::Naming;
use parts::Part;
use ports::Blocks;
use std::collections::{HashMap, HashSet};
use tree::Tree;
use variants::{Body, Definitions, Public};
use words::Words;

/// A circuit with subcircuits.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    /// The circuit.
    pub netlist: Netlist,
    /// The map in its names.
    pub map: Map,
    /// Instances that stand inlined, and why.
    pub inlined: Vec<(String, String)>,
    /// By instance that is a subcircuit: its full name and that of the subcircuit.
    pub subcircuits: Vec<(String, String)>,
}

/// Folds a flat circuit. That of a graph without instances stays as it is.
pub fn fold(
    graph: &BondGraph,
    causality: &Causality,
    source: &SourceMap,
    flat: &Translation,
) -> Hierarchy {
    let mut names = flat.netlist.names.clone();
    let ground = names.intern("0");
    let parts = parts::parts(flat, ground);
    let inlined = vec![None; graph.tree.len()];
    let mut tree = Tree { instances: &graph.tree, inlined };
    if graph.tree.len() < 2 {
        let (netlist, map) = (flat.netlist.clone(), flat.map.clone());
        return Hierarchy { netlist, map, inlined: vec![], subcircuits: vec![] };
    }
    let blocks = Blocks::of(&parts, ground, &names, &graph.tree);
    let ports = find_ports(graph, flat, &parts, &blocks, &mut tree);
    let owners = places::Owners {
        devices: parts.iter().enumerate().filter_map(|(k, part)| Some((part.device?, k))).collect(),
        parameters: (flat.map.parameters.iter().map(|(name, _)| *name))
            .zip(naming::parameter_homes(graph, &tree))
            .collect(),
    };
    let mut places;
    loop {
        places = places::places(&parts, &owners, &mut tree, &flat.netlist.names);
        // Those inside stand behind those around them, so that one pass finds the empty.
        let mut held = vec![false; graph.tree.len()];
        for scope in &places {
            held[*scope as usize] = true;
        }
        let mut empty = false;
        for at in (1..held.len()).rev() {
            if tree.scope(at as u32) != at as u32 {
                continue;
            }
            if held[at] {
                held[tree.around(at as u32) as usize] = true;
            } else {
                tree.inlined[at] = Some("it holds no device".to_string());
                empty = true;
            }
        }
        if !empty {
            break;
        }
    }
    if (1..graph.tree.len() as u32).all(|instance| tree.scope(instance) == 0) {
        // Nothing is left to fold: the flat circuit as it is, and why.
        let (mut netlist, map) = (flat.netlist.clone(), flat.map.clone());
        let inlined = reasons(&tree);
        netlist.cards.splice(0..0, said(&inlined));
        return Hierarchy { netlist, map, inlined, subcircuits: vec![] };
    }
    let naming = Naming::new(graph, flat, &parts, &places, &tree, &ports, blocks, ground);
    let writer = Writer {
        graph,
        causality,
        source,
        flat,
        parts: &parts,
        tree: &tree,
        naming: &naming,
        values: values(flat),
    };
    writer.write()
}

/// The ports of every instance as pairs of nodes; what cannot be a subcircuit is inlined.
fn find_ports(
    graph: &BondGraph,
    flat: &Translation,
    parts: &[Part],
    blocks: &Blocks,
    tree: &mut Tree,
) -> naming::Ports {
    let homes = graph.homes();
    let homes: Vec<u32> = graph.vertices.iter().map(|vertex| homes.of(&vertex.name)).collect();
    let mut touched: HashMap<Name, Vec<u32>> = HashMap::new();
    for part in parts.iter().filter(|part| part.power) {
        for node in part.edges.iter().flatten() {
            touched.entry(*node).or_default().push(part.mark.home);
        }
    }
    let mut found = naming::Ports::new();
    for instance in 1..graph.tree.len() as u32 {
        let obstacle = match ports::ports(graph, flat, tree, instance, &homes, &touched) {
            Ok(ports) => {
                let obstacle = blocks.obstacle(tree, instance, &ports, &flat.netlist.names);
                found.insert(instance, ports);
                obstacle
            }
            Err(why) => Some(why),
        };
        tree.inlined[instance as usize] = obstacle;
    }
    found
}

/// The cards of parameters, by parameter: where they stand among the cards, and what they say.
fn values(flat: &Translation) -> HashMap<Name, (usize, Expr)> {
    let mut values = HashMap::new();
    for (at, card) in flat.netlist.cards.iter().enumerate() {
        if let CardKind::Parameters(parameters) = &card.kind {
            values.extend(parameters.iter().map(|(name, expr)| (*name, (at, expr.clone()))));
        }
    }
    values
}

/// Writes subcircuits from the innermost outwards, then the circuit.
struct Writer<'w> {
    graph: &'w BondGraph,
    causality: &'w Causality,
    source: &'w SourceMap,
    flat: &'w Translation,
    parts: &'w [Part],
    tree: &'w Tree<'w>,
    naming: &'w Naming<'w>,
    values: HashMap<Name, (usize, Expr)>,
}

/// What the card of an instance says: its subcircuit, what it is given, and numbers of its own.
struct Use {
    subcircuit: Name,
    given: Vec<(Name, Expr)>,
    own: Vec<Lift>,
}

impl Writer<'_> {
    fn write(&self) -> Hierarchy {
        let mut names = Words::default();
        names.intern("0");
        let mut definitions = Definitions::default();
        let mut uses: HashMap<u32, Use> = HashMap::new();
        let scopes: Vec<u32> = (1..self.tree.instances.len() as u32)
            .filter(|scope| self.tree.scope(*scope) == *scope)
            .collect();
        let depths: Vec<usize> = scopes.iter().map(|scope| self.tree.depth(*scope)).collect();
        let mut subcircuits = vec![];
        for depth in (1..=depths.iter().copied().max().unwrap_or(0)).rev() {
            let level: Vec<u32> = (scopes.iter().zip(&depths))
                .filter(|(_, d)| **d == depth)
                .map(|(s, _)| *s)
                .collect();
            let bodies: Vec<Body> =
                level.iter().map(|scope| self.body(*scope, &uses, &mut names)).collect();
            let found: Vec<usize> =
                bodies.iter().map(|body| definitions.find(body, &mut names)).collect();
            for (at, definition) in definitions.all.iter_mut().enumerate() {
                let own = || (0..level.len()).filter(|k| found[*k] == at);
                let members: Vec<&Body> = own().map(|k| &bodies[k]).collect();
                let differs = definition.vary(&members);
                for k in own() {
                    let given = bodies[k].publics.iter();
                    let given =
                        given.filter_map(|public| Some((public.name, public.given.clone()?)));
                    let lifts =
                        bodies[k].lifts.iter().zip(&differs).filter(|(_, differs)| **differs);
                    let own = lifts.map(|(lift, _)| lift.clone()).collect();
                    let subcircuit = definition.name;
                    let name = self.tree.instances[level[k] as usize].name.clone();
                    subcircuits.push((name, names.text(subcircuit).to_string()));
                    uses.insert(level[k], Use { subcircuit, given: given.collect(), own });
                }
            }
        }
        let mut cards = self.circuit(&uses, &definitions, &mut names);
        let inlined = reasons(self.tree);
        cards.splice(0..0, said(&inlined));
        let (header, map) = told::told(self.naming, self.tree, &mut names, &mut cards);
        let title = self.flat.netlist.title.clone();
        let dialect = self.flat.netlist.dialect;
        let netlist = Netlist { title, dialect, names: names.names, header, cards };
        Hierarchy { netlist, map, inlined, subcircuits }
    }

    /// An instance as a subcircuit.
    fn body(&self, scope: u32, uses: &HashMap<u32, Use>, names: &mut Words) -> Body {
        let instance = &self.tree.instances[scope as usize];
        let local = &self.naming.locals[scope as usize];
        let terminals = local.terminals.iter().map(|(text, _)| names.intern(text)).collect();
        let mut lifts = vec![];
        let mut publics = vec![];
        let mut private = vec![];
        for parameter in &instance.parameters {
            match self.public(scope, parameter, names) {
                Some(public) => publics.push(public),
                None => private.push(parameter.id.index()),
            }
        }
        // Those of instances that stand inlined here, too.
        let own: HashSet<usize> = instance.parameters.iter().map(|own| own.id.index()).collect();
        let inlined = self.naming.owned[scope as usize].iter();
        private.extend(inlined.filter(|at| !own.contains(at)));
        let mut cards = self.private(scope, private, names, &mut lifts);
        let power = local.parts.iter().filter(|at| self.parts[**at].power);
        cards.extend(power.map(|at| self.own_card(scope, *at, names, &mut lifts)));
        for inner in &local.inner {
            cards.extend(self.instance_card(scope, *inner, uses, names, &mut lifts));
        }
        let signals = local.parts.iter().filter(|at| !self.parts[**at].power);
        cards.extend(signals.map(|at| self.own_card(scope, *at, names, &mut lifts)));
        let strokes = instance.ports.iter().map(|(_, bond)| {
            let stroke = self.causality.strokes.get(bond.index()).copied().flatten()?;
            let head = self.graph.bond(*bond).to.vertex;
            let inside = self.graph.vertex(head).name.starts_with(&format!("{}.", instance.name));
            Some((stroke == graph::Stroke::AtTo) == inside)
        });
        let (model, strokes) = (instance.model.clone(), strokes.collect());
        Body { model, strokes, terminals, publics, cards, lifts }
    }

    /// A parameter that the card of an instance may set; `None` for one that is the model's own business.
    fn public(&self, scope: u32, own: &InstanceParameter, names: &mut Words) -> Option<Public> {
        let flat = self.flat.map.parameters.get(own.id.index())?.0;
        let parameter = self.graph.parameters.get(own.id.index())?;
        let value = &self.values.get(&flat)?.1;
        let default = match (own.given, &own.default) {
            (false, _) => Some(value.clone()),
            (true, Some(default)) => Some(self.default(default)),
            (true, None) => None,
        };
        let mut derived = false;
        default.iter().for_each(|default| default.leaves(&mut |_, _| derived = true));
        if !own.public || (derived && !own.given) {
            return None;
        }
        let around = self.tree.around(scope);
        let local = &self.naming.locals[scope as usize];
        Some(Public {
            name: names.intern(local.parameters.get(&flat)?),
            default: default.filter(|_| !derived),
            given: own.given.then(|| self.naming.expr(around, value, names)),
            value: parameter.value,
            description: parameter.description.clone(),
        })
    }

    /// A model's default, as far as other simulators can compute it.
    fn default(&self, default: &graph::Expr) -> Expr {
        let parameter = |id: graph::ParameterId| self.flat.map.parameters[id.index()];
        if !portable(default) {
            return Expr::number(default.evaluate(&mut |leaf| match leaf {
                graph::Leaf::Parameter(id) => parameter(*id).1,
                _ => f64::NAN,
            }));
        }
        default.map(&mut |leaf, span| match leaf {
            graph::Leaf::Parameter(id) => {
                Expr::new(Node::Leaf(Leaf::Parameter(parameter(*id).0)), span)
            }
            _ => Expr::number(f64::NAN),
        })
    }

    /// `.param` cards of a subcircuit or the circuit, in the order of the flat one's.
    fn private(
        &self,
        scope: u32,
        parameters: Vec<usize>,
        names: &mut Words,
        lifts: &mut Vec<Lift>,
    ) -> Vec<Card> {
        let local = &self.naming.locals[scope as usize];
        let mut cards = vec![];
        for at in parameters {
            let flat = self.flat.map.parameters[at].0;
            let (Some((order, value)), Some(text)) =
                (self.values.get(&flat), local.parameters.get(&flat))
            else {
                continue;
            };
            let name = names.intern(text);
            let mut expr = self.naming.expr(scope, value, names);
            // What had to be computed beforehand may be another number in another instance.
            let literal = self.graph.parameters[at].expr.as_number().is_some();
            if let Some(value) = expr.as_number().filter(|_| scope > 0 && !literal) {
                let held = names.intern(&format!("{text}_value"));
                lifts.push(Lift { name: held, value });
                expr = Expr::leaf(Leaf::Parameter(held));
            }
            let card = &self.flat.netlist.cards[*order];
            let kind = CardKind::Parameters(vec![(name, expr)]);
            cards.push((*order, Card { kind, span: card.span, comment: card.comment.clone() }));
        }
        cards.sort_by_key(|(order, _)| *order);
        cards.into_iter().map(|(_, card)| card).collect()
    }

    /// A card in its subcircuit, its comment without the names of the instances around.
    fn own_card(&self, scope: u32, at: usize, names: &mut Words, lifts: &mut Vec<Lift>) -> Card {
        let mut card = self.naming.card(scope, &self.parts[at], names, lifts);
        card.comment = card.comment.map(|comment| self.without_prefix(scope, &comment));
        card
    }

    fn without_prefix(&self, scope: u32, text: &str) -> String {
        match self.tree.instances[scope as usize].name.as_str() {
            "" => text.to_string(),
            name => {
                let prefix = format!("{name}.");
                // Behind the place in the file, which may be called alike.
                let (place, what) = text.split_once(' ').unwrap_or(("", text));
                let mut own = String::from(place);
                for word in what.split_inclusive([' ', ':', '(']) {
                    if own.len() == place.len() && !place.is_empty() {
                        own.push(' ');
                    }
                    own.push_str(&word[common_part(word, &prefix).len()..]);
                }
                own
            }
        }
    }

    /// The X card of an instance.
    fn instance_card(
        &self,
        around: u32,
        inner: u32,
        uses: &HashMap<u32, Use>,
        names: &mut Words,
        lifts: &mut Vec<Lift>,
    ) -> Option<Card> {
        let instance = &self.tree.instances[inner as usize];
        let Use { subcircuit, given, own } = uses.get(&inner)?;
        let card = self.naming.locals[around as usize].cards.get(&inner)?;
        let name = names.intern(card);
        let nodes = self.naming.joined(inner, around, names);
        let mut parameters = given.clone();
        for lift in own {
            let value = match around {
                0 => Expr::number(lift.value),
                // Another instance of what is around may differ.
                _ => {
                    let held = names.intern(&format!("{card}_{}", names.text(lift.name)));
                    lifts.push(Lift { name: held, value: lift.value });
                    Expr::leaf(Leaf::Parameter(held))
                }
            };
            parameters.push((lift.name, value));
        }
        let what = format!("{}:{}", instance.model, instance.name);
        let what = self.without_prefix(around, &what);
        let place = self.source.file(instance.span.file).zip(self.source.position(instance.span));
        let comment = match place {
            Some((file, (line, _))) => {
                let file = file.name.rsplit(['/', '\\']).next().unwrap_or(&file.name);
                format!("{file}:{line} {what}")
            }
            None => what,
        };
        let element = Element::Instance { subcircuit: *subcircuit, parameters };
        let kind = CardKind::Device(Device { name, nodes: nodes.into(), element });
        Some(Card { kind, span: instance.span, comment: Some(comment) })
    }

    /// The circuit around all subcircuits: the flat one's cards that stand in none, in their order.
    fn circuit(
        &self,
        uses: &HashMap<u32, Use>,
        definitions: &Definitions,
        names: &mut Words,
    ) -> Vec<Card> {
        let local = &self.naming.locals[0];
        let (mut cards, mut none) = (vec![], vec![]);
        let own = self.private(0, self.naming.owned[0].clone(), names, &mut none);
        if !own.is_empty() {
            cards.push(comment(" parameters, in SI units"));
        }
        cards.extend(own);
        cards.extend(definitions.all.iter().map(|definition| definition.card(names)));
        let mut instances: Vec<Card> = vec![];
        for inner in &local.inner {
            instances.extend(self.instance_card(0, *inner, uses, names, &mut none));
        }
        if !instances.is_empty() {
            instances.insert(0, comment(" instances"));
        }
        let here: HashMap<usize, usize> =
            local.parts.iter().map(|at| (self.parts[*at].card, *at)).collect();
        let mut heading = None;
        for (at, card) in self.flat.netlist.cards.iter().enumerate() {
            match &card.kind {
                CardKind::Parameters(_) => {}
                CardKind::Comment(_) => heading = Some(card.clone()),
                CardKind::Device(_) | CardKind::Model { .. } => {
                    let Some(part) = here.get(&at) else { continue };
                    if !self.parts[*part].power {
                        cards.append(&mut instances);
                    }
                    cards.extend(heading.take());
                    cards.push(self.own_card(0, *part, names, &mut none));
                }
                _ => {
                    cards.append(&mut instances);
                    cards.extend(heading.take());
                    cards.push(card.clone());
                }
            }
        }
        cards.append(&mut instances);
        cards
    }
}

fn comment(text: &str) -> Card {
    Card { kind: CardKind::Comment(text.to_string()), span: Span::NONE, comment: None }
}

/// The instances that stand inlined, and why.
fn reasons(tree: &Tree) -> Vec<(String, String)> {
    let instances = tree.instances.iter().zip(&tree.inlined);
    instances.filter_map(|(instance, why)| Some((instance.name.clone(), why.clone()?))).collect()
}

/// The same as comments.
fn said(inlined: &[(String, String)]) -> Vec<Card> {
    let lines = inlined.iter().flat_map(|(name, why)| {
        [comment(&format!(" {name} stands inlined:")), comment(&format!("   {why}"))]
    });
    lines.collect()
}
