//! Cards in the words of the subcircuit that they stand in.

use super::naming::{Local, Naming};
use super::parts::Part;
use super::words::Words;
use crate::expr::Node;
use crate::netlist::references::Reference;
use crate::netlist::{Card, CardKind, Device, Element, Expr, Leaf, Name};

/// A number that one instance differs from another in, though no parameter of the model: where a storage starts, say.
#[derive(Clone, Debug, PartialEq)]
pub struct Lift {
    /// The parameter that holds it, should any differ.
    pub name: Name,
    /// Its value here.
    pub value: f64,
}

impl Naming<'_> {
    /// A card of the flat circuit in a subcircuit; numbers that may differ between instances come out as parameters.
    pub fn card(&self, scope: u32, part: &Part, names: &mut Words, lifts: &mut Vec<Lift>) -> Card {
        let card = &self.flat.netlist.cards[part.card];
        let local = &self.locals[scope as usize];
        let kind = match &card.kind {
            CardKind::Device(device) => {
                let mut device = device.clone();
                let mut own = Rename { naming: self, local, names };
                device.name = own.device(device.name);
                device.references(&mut |reference| match reference {
                    Reference::Terminals(nodes) | Reference::Control(nodes) => own.nodes(nodes),
                    Reference::Device(name) => *name = own.device(*name),
                    Reference::Model(name) => *name = own.model(*name),
                    Reference::Expr(expr) => *expr = own.expr(expr),
                });
                if scope > 0 {
                    lift(&mut device, names, lifts);
                }
                CardKind::Device(device)
            }
            CardKind::Model { name, kind, parameters } => {
                let mut own = Rename { naming: self, local, names };
                let value = |(key, value): &(String, Expr)| (key.clone(), own.expr(value));
                let parameters = parameters.iter().map(value).collect();
                let mut own = Rename { naming: self, local, names };
                CardKind::Model { name: own.model(*name), kind: kind.clone(), parameters }
            }
            kind => kind.clone(),
        };
        Card { kind, span: card.span, comment: card.comment.clone() }
    }

    /// An expression of the flat circuit in a subcircuit.
    pub fn expr(&self, scope: u32, expr: &Expr, names: &mut Words) -> Expr {
        Rename { naming: self, local: &self.locals[scope as usize], names }.expr(expr)
    }

    /// The nodes that the terminals of a subcircuit are joined to, in the words of the one around it.
    pub fn joined(&self, inner: u32, around: u32, names: &mut Words) -> Vec<Name> {
        let local = &self.locals[around as usize];
        let terminals = &self.locals[inner as usize].terminals;
        let text = |node| local.nodes.get(node).map_or("0", String::as_str);
        terminals.iter().map(|(_, node)| names.intern(text(node))).collect()
    }
}

/// Renames what a card speaks of.
struct Rename<'n, 'f> {
    naming: &'n Naming<'f>,
    local: &'n Local,
    names: &'n mut Words,
}

impl Rename<'_, '_> {
    /// Nodes of which ground is that of the block of the others.
    fn nodes(&mut self, nodes: &mut [Name]) {
        let block = self.naming.blocks.block(nodes);
        for node in nodes {
            *node = self.node(*node, block);
        }
    }

    fn node(&mut self, node: Name, block: Option<usize>) -> Name {
        let block = block.filter(|_| node == self.naming.ground);
        let text = self.local.nodes.get(&(node, block)).map_or("0", String::as_str);
        self.names.intern(text)
    }

    fn device(&mut self, device: Name) -> Name {
        let flat = self.naming.flat.netlist.names.text(device);
        self.names.intern(self.local.devices.get(&device).map_or(flat, String::as_str))
    }

    /// A model is named after its switch.
    fn model(&mut self, model: Name) -> Name {
        let flat = &self.naming.flat.netlist.names;
        let switch = flat.text(model).strip_suffix("_model").and_then(|switch| flat.find(switch));
        match switch.and_then(|switch| self.local.devices.get(&switch)) {
            Some(switch) => self.names.intern(&format!("{switch}_model")),
            None => self.names.intern(flat.text(model)),
        }
    }

    fn expr(&mut self, expr: &Expr) -> Expr {
        expr.map(&mut |leaf, span| {
            let leaf = match leaf {
                Leaf::Parameter(name) => {
                    let root = &self.naming.locals[0].parameters;
                    let own = self.local.parameters.get(name).or_else(|| root.get(name));
                    let flat = self.naming.flat.netlist.names.text(*name);
                    Leaf::Parameter(self.names.intern(own.map_or(flat, String::as_str)))
                }
                Leaf::Voltage(plus, minus) => {
                    let block = self.naming.blocks.block(&[*plus]);
                    let minus = self.node(minus.unwrap_or(self.naming.ground), block);
                    let ground = self.names.text(minus) == "0";
                    Leaf::Voltage(self.node(*plus, block), (!ground).then_some(minus))
                }
                Leaf::Current(device) => Leaf::Current(self.device(*device)),
                other => other.clone(),
            };
            Expr::new(Node::Leaf(leaf), span)
        })
    }
}

/// Takes the number that a storage starts with out of its card.
fn lift(device: &mut Device, names: &mut Words, lifts: &mut Vec<Lift>) {
    let (Element::Capacitor { initial, .. } | Element::Inductor { initial, .. }) =
        &mut device.element
    else {
        return;
    };
    let Some(value) = initial.as_ref().and_then(Expr::as_number) else { return };
    let name = names.intern(&format!("IC_{}", names.text(device.name)));
    *initial = Some(Expr::leaf(Leaf::Parameter(name)));
    lifts.push(Lift { name, value });
}
