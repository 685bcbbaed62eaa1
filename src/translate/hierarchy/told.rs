//! The map, the header and the saved variables of a circuit with subcircuits: whatever stands in one goes by the path of
//! its instances, `X_eha_2.X_motor.rotor`.

use super::naming::Naming;
use super::tree::Tree;
use super::words::Words;
use crate::expr::Node;
use crate::netlist::header::Header;
use crate::netlist::read::expression::expression;
use crate::netlist::{Card, CardKind, Expr, Leaf, Name, write};
use crate::source::FileId;
use crate::translate::Map;
use crate::translate::map::Variable;
use crate::translate::names::Renamed;

/// The header and the map in the names of the circuit with subcircuits; saved variables in its cards.
pub fn told(
    naming: &Naming,
    tree: &Tree,
    names: &mut Words,
    cards: &mut [Card],
) -> (Vec<(String, String)>, Map) {
    let flat = &naming.flat.netlist;
    let mut paths = Paths { naming, tree, names };
    for card in cards {
        if let CardKind::Save { items, .. } = &mut card.kind {
            for (text, expr) in items {
                *expr = paths.expr(expr);
                *text = write::expression(&paths.names.names, expr);
            }
        }
    }
    let (mut header, _) = Header::read(&flat.header);
    for jumps in &mut header.jumps {
        paths.device_text(&mut jumps.device);
    }
    for sample in &mut header.samples {
        [&mut sample.switch, &mut sample.capacitor, &mut sample.clock]
            .into_iter()
            .for_each(|name| paths.device_text(name));
    }
    for domain in &mut header.domains {
        domain.devices.iter_mut().for_each(|name| paths.device_text(name));
        for node in &mut domain.nodes {
            if let Some(name) = flat.names.find(node) {
                let name = paths.node(name);
                *node = paths.names.text(name).to_string();
            }
        }
    }
    let mut flat_names = flat.names.clone();
    for column in &mut header.columns {
        let read = expression(
            &column.expr,
            &mut flat_names,
            flat.dialect,
            FileId(u32::MAX),
            0,
            &mut vec![],
        );
        if let Some(expr) = read {
            let expr = paths.expr(&expr);
            column.expr = write::expression(&paths.names.names, &expr);
        }
    }
    let map = paths.map();
    (header.pairs(), map)
}

struct Paths<'p, 'f> {
    naming: &'p Naming<'f>,
    tree: &'p Tree<'p>,
    names: &'p mut Words,
}

impl Paths<'_, '_> {
    fn at(&mut self, scope: u32, own: Option<&String>, flat: Name) -> Name {
        match own {
            Some(own) => self.names.intern(&format!("{}{own}", self.naming.path(self.tree, scope))),
            None => self.names.intern(self.naming.flat.netlist.names.text(flat)),
        }
    }

    fn node(&mut self, node: Name) -> Name {
        let scope = self.naming.meets.get(&node).copied().unwrap_or(0);
        let own = self.naming.locals[scope as usize].nodes.get(&(node, None));
        self.at(scope, own, node)
    }

    fn device(&mut self, device: Name) -> Name {
        let scope = self.naming.places.get(&device).copied().unwrap_or(0);
        self.at(scope, self.naming.locals[scope as usize].devices.get(&device), device)
    }

    fn parameter(&mut self, parameter: Name) -> Name {
        let scope = self.naming.owners.get(&parameter).copied().unwrap_or(0);
        self.at(scope, self.naming.locals[scope as usize].parameters.get(&parameter), parameter)
    }

    fn device_text(&mut self, text: &mut String) {
        if let Some(name) = self.naming.flat.netlist.names.find(text) {
            let name = self.device(name);
            *text = self.names.text(name).to_string();
        }
    }

    fn expr(&mut self, expr: &Expr) -> Expr {
        expr.map(&mut |leaf, span| {
            let leaf = match leaf {
                Leaf::Parameter(name) => Leaf::Parameter(self.parameter(*name)),
                Leaf::Voltage(plus, minus) => {
                    let minus = minus.map(|minus| self.node(minus));
                    Leaf::Voltage(self.node(*plus), minus)
                }
                Leaf::Current(device) => Leaf::Current(self.device(*device)),
                other => other.clone(),
            };
            Expr::new(Node::Leaf(leaf), span)
        })
    }

    fn map(&mut self) -> Map {
        let flat = &self.naming.flat.map;
        let variable = |own: &mut Self, variable: &Variable| {
            let expr = variable.expr.as_ref().map(|expr| own.expr(expr));
            Variable { expr, ..variable.clone() }
        };
        let variables = flat.variables.iter().map(|v| variable(self, v)).collect();
        let parameters = flat.parameters.iter().map(|(name, v)| (self.parameter(*name), *v));
        let parameters = parameters.collect();
        let mut cards = flat.cards.clone();
        cards.iter_mut().for_each(|card| self.device_text(&mut card.card));
        Map { variables, parameters, cards, renamed: self.renamed(), ..flat.clone() }
    }

    /// What is called otherwise than in the bond graph, where it stands.
    fn renamed(&self) -> Vec<Renamed> {
        let mut renamed = vec![];
        for (scope, local) in self.naming.locals.iter().enumerate() {
            let path = self.naming.path(self.tree, scope as u32);
            let around = match self.tree.instances[scope].name.as_str() {
                "" => String::new(),
                name => format!("{name}."),
            };
            renamed.extend(local.namer.renamed.iter().map(|name| Renamed {
                from: format!("{around}{}", name.from),
                to: format!("{path}{}", name.to),
            }));
        }
        renamed
    }
}
