//! Subcircuits: instances whose bodies are equal share one, others of a model are variants, named by what differs.

use super::bodies::Lift;
use super::words::Words;
use crate::netlist::{Card, CardKind, Expr, Leaf, Name, Nodes, Subcircuit, write};
use crate::source::Span;
use crate::translate::names::Namer;
use std::collections::BTreeSet;

/// A parameter that instances may set.
#[derive(Clone, Debug)]
pub struct Public {
    /// Its name.
    pub name: Name,
    /// The model's default, where that is no value of other parameters.
    pub default: Option<Expr>,
    /// What this instance gives, in the words of what is around.
    pub given: Option<Expr>,
    /// Its value here.
    pub value: f64,
    /// What it is.
    pub description: String,
}

/// What an instance comes to as a subcircuit.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its model.
    pub model: String,
    /// How its bonds' strokes stand at its ports.
    pub strokes: Vec<Option<bool>>,
    /// Its terminals.
    pub terminals: Vec<Name>,
    /// What can be set.
    pub publics: Vec<Public>,
    /// Its cards.
    pub cards: Vec<Card>,
    /// Numbers that another instance may differ in.
    pub lifts: Vec<Lift>,
}

/// A subcircuit.
pub struct Definition {
    /// Its name.
    pub name: Name,
    key: String,
    body: Body,
    /// By lift: whether instances differ in it.
    varies: Vec<bool>,
}

/// All subcircuits, inner ones first.
#[derive(Default)]
pub struct Definitions {
    /// In the order in which they were found.
    pub all: Vec<Definition>,
    namer: Namer,
}

impl Definitions {
    /// The subcircuit of a body: one that is there already, or a new one.
    pub fn find(&mut self, body: &Body, names: &mut Words) -> usize {
        let key = key(body, names);
        let same = |known: &Definition| known.body.model == body.model && known.key == key;
        if let Some(at) = self.all.iter().position(same) {
            return at;
        }
        let first = self.all.iter().find(|known| known.body.model == body.model);
        let wish = match first {
            None => body.model.clone(),
            Some(first) => format!("{}_{}", body.model, difference(&first.body, body, names)),
        };
        let name = self.namer.subcircuit(&wish);
        let name = names.intern(self.namer.names.text(name));
        let varies = vec![false; body.lifts.len()];
        self.all.push(Definition { name, key, body: body.clone(), varies });
        self.all.len() - 1
    }
}

impl Definition {
    /// Notes which numbers differ among instances; gives those that the card of each instance then states.
    pub fn vary(&mut self, bodies: &[&Body]) -> Vec<bool> {
        let differs: Vec<bool> = (0..self.body.lifts.len())
            .map(|k| {
                let own = self.body.lifts[k].value.to_bits();
                bodies.iter().any(|body| body.lifts.get(k).is_none_or(|l| l.value.to_bits() != own))
            })
            .collect();
        for (varies, differs) in self.varies.iter_mut().zip(&differs) {
            *varies |= differs;
        }
        differs
    }

    /// Its card.
    pub fn card(&self, names: &Words) -> Card {
        let settled = |name: &Name| {
            let lifts = self.body.lifts.iter().zip(&self.varies);
            let found = lifts.filter(|(_, varies)| !**varies).find(|(lift, _)| lift.name == *name);
            found.map(|(lift, _)| Expr::number(lift.value))
        };
        let mut cards = self.body.cards.clone();
        for card in &mut cards {
            match &mut card.kind {
                CardKind::Device(device) => device.references(&mut |reference| {
                    if let crate::netlist::references::Reference::Expr(expr) = reference {
                        *expr = fill(expr, &settled);
                    }
                }),
                CardKind::Parameters(parameters) => {
                    parameters.iter_mut().for_each(|(_, expr)| *expr = fill(expr, &settled));
                }
                _ => {}
            }
        }
        let described = self.body.publics.iter().filter(|public| !public.description.is_empty());
        let described = described.map(|public| {
            let text = format!(" {}: {}", names.text(public.name), public.description);
            Card { kind: CardKind::Comment(text), span: Span::NONE, comment: None }
        });
        let cards = described.chain(cards).collect();
        let mut parameters: Vec<(Name, Expr)> = (self.body.publics.iter())
            .map(|public| {
                let default = public.default.clone();
                (public.name, default.unwrap_or_else(|| Expr::number(public.value)))
            })
            .collect();
        let lifts = self.body.lifts.iter().zip(&self.varies).filter(|(_, varies)| **varies);
        parameters.extend(lifts.map(|(lift, _)| (lift.name, Expr::number(lift.value))));
        let ports = self.body.terminals.clone();
        let kind = CardKind::Subcircuit(Subcircuit { name: self.name, ports, parameters, cards });
        Card { kind, span: Span::NONE, comment: None }
    }
}

fn fill(expr: &Expr, settled: &dyn Fn(&Name) -> Option<Expr>) -> Expr {
    expr.map(&mut |leaf, span| {
        let known = match leaf {
            Leaf::Parameter(name) => settled(name),
            _ => None,
        };
        known.unwrap_or_else(|| Expr { span, ..Expr::leaf(leaf.clone()) })
    })
}

/// All that must be equal for two instances to share a subcircuit.
fn key(body: &Body, names: &Words) -> String {
    let mut key = String::new();
    for terminal in &body.terminals {
        key.push_str(names.text(*terminal));
        key.push(' ');
    }
    for public in &body.publics {
        let default =
            public.default.as_ref().map(|default| write::expression(&names.names, default));
        key.push_str(&format!("{}={} ", names.text(public.name), default.unwrap_or_default()));
    }
    for card in &body.cards {
        key.push('\n');
        key.push_str(&write::card(&names.names, &card.kind));
    }
    key
}

/// In one word, how a body differs from another of the same model.
fn difference(first: &Body, body: &Body, names: &Words) -> String {
    if first.strokes != body.strokes {
        return "causality".to_string();
    }
    let extra = |a: &BTreeSet<String>, b: &BTreeSet<String>| a.difference(b).next().cloned();
    let terminals = |body: &Body| -> BTreeSet<String> {
        body.terminals.iter().map(|terminal| names.text(*terminal).to_string()).collect()
    };
    let (a, b) = (terminals(first), terminals(body));
    if let Some(name) = extra(&b, &a) {
        return format!("with_{name}");
    }
    if let Some(name) = extra(&a, &b) {
        return format!("without_{name}");
    }
    let devices = |body: &Body, letter: usize| -> BTreeSet<String> {
        let devices = body.cards.iter().filter_map(|card| match &card.kind {
            CardKind::Device(device) => names.text(device.name).get(letter..),
            _ => None,
        });
        devices.map(str::to_string).collect()
    };
    // Behind the letter and `_`.
    let (a, b) = (devices(first, 2), devices(body, 2));
    if let Some(name) = extra(&b, &a) {
        return format!("with_{name}");
    }
    if let Some(name) = extra(&a, &b) {
        return format!("without_{name}");
    }
    if devices(first, 0) != devices(body, 0) {
        return "causality".to_string();
    }
    let nodes = |body: &Body, turned: bool| -> Vec<Nodes<Name>> {
        let devices = body.cards.iter().filter_map(|card| match &card.kind {
            CardKind::Device(device) => Some(device.nodes.clone()),
            _ => None,
        });
        let sorted = devices.map(|mut nodes| {
            if turned {
                nodes.sort_unstable();
            }
            nodes
        });
        sorted.collect()
    };
    if nodes(first, true) != nodes(body, true) {
        "realisation".to_string()
    } else if nodes(first, false) != nodes(body, false) {
        "polarity".to_string()
    } else {
        "values".to_string()
    }
}
