//! The cards of the flat circuit, and what each of them touches.

use crate::netlist::references::Reference;
use crate::netlist::{CardKind, Element, Expr, Leaf, Name};
use crate::translate::{Mark, Translation};

/// A card of a device, or the `.model` of one.
pub struct Part {
    /// Index among the flat cards.
    pub card: usize,
    /// Which part of the graph it stands for.
    pub mark: Mark,
    /// Its device.
    pub device: Option<Name>,
    /// The pairs of nodes between which its currents run.
    pub edges: Vec<[Name; 2]>,
    /// The nodes that it stands at or reads, ground left out.
    pub nodes: Vec<Name>,
    /// The devices whose currents it reads, and those that it couples.
    pub devices: Vec<Name>,
    /// The parameters that it uses.
    pub parameters: Vec<Name>,
    /// Whether it stands in the circuit of powers, not in that of signals.
    pub power: bool,
}

/// Every part, in the order of the cards.
pub fn parts(flat: &Translation, ground: Name) -> Vec<Part> {
    let mut found = vec![];
    for (at, card) in flat.netlist.cards.iter().enumerate() {
        let mark = flat.origins.marks.get(at).copied().unwrap_or_default();
        let mut part = Part {
            card: at,
            mark,
            device: None,
            edges: vec![],
            nodes: vec![],
            devices: vec![],
            parameters: vec![],
            power: false,
        };
        match &card.kind {
            CardKind::Device(device) => {
                let mut device = device.clone();
                part.device = Some(device.name);
                let line = matches!(device.element, Element::Line { .. });
                device.references(&mut |reference| match reference {
                    Reference::Terminals(nodes) => {
                        part.nodes.extend_from_slice(nodes);
                        let pairs = nodes.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
                        part.edges.extend(pairs.take(if line { 2 } else { 1 }));
                    }
                    Reference::Control(nodes) => part.nodes.extend_from_slice(nodes),
                    Reference::Device(name) => part.devices.push(*name),
                    Reference::Model(_) => {}
                    Reference::Expr(expr) => part.read(expr),
                });
            }
            CardKind::Model { parameters, .. } => {
                parameters.iter().for_each(|(_, value)| part.read(value));
            }
            _ => continue,
        }
        part.nodes.retain(|node| *node != ground);
        part.power = part.edges.iter().flatten().any(|node| flat.origins.power.contains(node));
        found.push(part);
    }
    found
}

impl Part {
    fn read(&mut self, expr: &Expr) {
        expr.leaves(&mut |leaf, _| match leaf {
            Leaf::Parameter(name) => self.parameters.push(*name),
            Leaf::Voltage(plus, minus) => self.nodes.extend([*plus].into_iter().chain(*minus)),
            Leaf::Current(name) => self.devices.push(*name),
            _ => {}
        });
    }
}
