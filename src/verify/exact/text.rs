//! A netlist's text, flat, with its parameters as written; and what its cards claim to stand for.

use super::bonds::{Place, constant_inertias};
use crate::bond::graph::{BondGraph, End, Law, SignalId, SignalLaw, SignalOrigin, StoreLaw};
use crate::circuit::{Circuit, DeviceId, DeviceKind, NodeId};
use crate::diagnostic::Diagnostic;
use crate::netlist::dialects::NGSPICE;
use crate::netlist::flatten::expand::{Flat, Pending, expand};
use crate::netlist::flatten::scope::{ScopeId, TOP};
use crate::netlist::flatten::values::Lookup;
use crate::netlist::header::Header;
use crate::netlist::read::expression::expression;
use crate::netlist::{Element, Expr, Leaf, Name, Names, Netlist, flatten};
use crate::source::{FileId, Span};
use crate::translate::Map;
use std::collections::HashMap;

/// A text that was read.
pub struct Text<'n> {
    /// The netlist.
    pub netlist: &'n Netlist,
    /// Its names, and those that lead into its subcircuits.
    pub names: Names,
    /// The same flat.
    pub flat: Flat<'n>,
    /// The same in numbers.
    pub circuit: Circuit,
    /// Its header.
    pub header: Header,
    /// By column of the header: its expression, where every name leads to something.
    pub columns: Vec<Option<Expr>>,
    /// By device: what it claims to stand for.
    pub claims: Vec<Option<Place>>,
    /// By place: its devices.
    pub devices: HashMap<Place, Vec<usize>>,
    /// The map in the names of the text; `None` where the text does not have a name.
    pub variables: Vec<Variable>,
    /// By the text of its name: the variable.
    by_name: HashMap<String, usize>,
    /// By parameter of the graph: where the text has it, and its name there.
    pub parameters: Vec<Option<(ScopeId, Name)>>,
}

/// A variable of the map.
pub struct Variable {
    /// As the bond graph calls it.
    pub bg: String,
    /// What it is in the text.
    pub expr: Result<Expr, String>,
    /// Its value in its unit is the expression times this.
    pub factor: f64,
    /// Whether it is an observed column.
    pub observed: bool,
}

/// What a capacitor or an inductor starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The power variable that a store gives.
    Power(End),
    /// What it stores.
    Stored(End),
    /// A signal's value.
    Signal(SignalId),
    /// What its card says.
    Card,
}

impl<'n> Text<'n> {
    /// Lays a netlist flat and finds out what its cards stand for; `None` when it cannot be read.
    pub fn new(
        graph: &BondGraph,
        netlist: &'n Netlist,
        map: &Map,
        names: &crate::netlist::Names,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Text<'n>> {
        let circuit = flatten::flatten(netlist, d)?;
        // What is wrong has been said.
        let flat = expand(netlist, &mut vec![]);
        let (header, _) = Header::read(&netlist.header);
        // Paths into subcircuits are no names of the text, but lead to some.
        let mut known = netlist.names.clone();
        let leaves = map.variables.iter().filter_map(|variable| variable.expr.as_ref());
        let mut paths: Vec<Name> = map.parameters.iter().map(|(name, _)| *name).collect();
        leaves.for_each(|expr| {
            expr.leaves(&mut |leaf, _| match leaf {
                Leaf::Parameter(name) | Leaf::Current(name) => paths.push(*name),
                Leaf::Voltage(plus, minus) => paths.extend([*plus].into_iter().chain(*minus)),
                _ => {}
            });
        });
        for path in paths {
            if names.text(path).contains('.') {
                known.intern(names.text(path));
            }
        }
        // The header speaks as ngspice does whatever the dialect, and so of names that no card has.
        let columns: Vec<_> = header
            .columns
            .iter()
            .map(|c| expression(&c.expr, &mut known, &NGSPICE, FileId(u32::MAX), 0, &mut vec![]))
            .collect();
        let lookup = Lookup::new(&flat, &known);
        let columns = columns
            .into_iter()
            .map(|column| column.filter(|expr| leads_somewhere(&lookup, expr)))
            .collect();
        let find = |name: Name| known.find(names.text(name));
        let none = Span::NONE;
        let node = |name: Name| {
            let found = find(name)?;
            let path = known.text(found).contains('.');
            (!path || lookup.node(TOP, found, none, &mut vec![]).is_some()).then_some(found)
        };
        let device = |name: Name| {
            let found = find(name)?;
            let path = known.text(found).contains('.');
            (!path || lookup.device(TOP, found, none, &mut vec![]).is_some()).then_some(found)
        };
        let variables: Vec<Variable> = map
            .variables
            .iter()
            .filter_map(|variable| {
                let expr = variable.expr.as_ref()?.try_map(&mut |leaf, span| {
                    let lacks = |name: Name| names.text(name).to_string();
                    let at = |name: Name| node(name).ok_or_else(|| lacks(name));
                    let leaf = match leaf {
                        Leaf::Parameter(name) => {
                            Leaf::Parameter(find(*name).ok_or_else(|| lacks(*name))?)
                        }
                        Leaf::Voltage(plus, minus) => {
                            Leaf::Voltage(at(*plus)?, minus.map(at).transpose()?)
                        }
                        Leaf::Current(name) => {
                            Leaf::Current(device(*name).ok_or_else(|| lacks(*name))?)
                        }
                        Leaf::Operator(..) => return Err("an operator".to_string()),
                        other => other.clone(),
                    };
                    Ok(Expr::new(crate::expr::Node::Leaf(leaf), span))
                });
                let (bg, observed) = (variable.bg.clone(), variable.observed);
                Some(Variable { bg, expr, factor: variable.factor, observed })
            })
            .collect();
        let by_name = (0..variables.len()).map(|k| (variables[k].bg.clone(), k)).collect();
        let labels: HashMap<String, Label> = map
            .cards
            .iter()
            .map(|card| (card.card.to_lowercase(), (card.element.clone(), card.bond.clone())))
            .collect();
        let places = places(graph);
        let mut devices: HashMap<Place, Vec<usize>> = HashMap::new();
        let mut claims = vec![];
        for (k, pending) in flat.devices.iter().enumerate() {
            let name = flat.device_name(pending).to_lowercase();
            let place = labels.get(&name).and_then(|(element, bond)| {
                let by_bond = places.get(&(element.clone(), bond.clone()));
                by_bond.or_else(|| places.get(&(element.clone(), None))).copied()
            });
            if let Some(place) = place {
                devices.entry(place).or_default().push(k);
            }
            claims.push(place);
        }
        let parameters = map.parameters.iter().map(|(name, _)| {
            let (scope, own) = lookup.parameter(TOP, find(*name)?);
            flat.scopes.get(scope).written.contains_key(&own).then_some((scope, own))
        });
        let parameters = parameters.collect();
        Some(Text {
            netlist,
            circuit,
            header,
            columns,
            claims,
            devices,
            variables,
            by_name,
            parameters,
            names: known,
            flat,
        })
    }

    /// A variable of the map, by what the bond graph calls it.
    pub fn variable(&self, bg: &str) -> Option<&Expr> {
        self.variables.get(*self.by_name.get(bg)?)?.expr.as_ref().ok()
    }

    /// `e(name)` of a port as an expression of the text.
    pub fn effort(&self, graph: &BondGraph, end: End) -> Option<&Expr> {
        self.variable(&format!("e({})", port_name(graph, end)))
    }

    /// `f(name)` of a port, and whether the flow into the element is its negative.
    pub fn flow(&self, graph: &BondGraph, end: End) -> Option<(&Expr, bool)> {
        let expr = self.variable(&format!("f({})", port_name(graph, end)))?;
        let bond = graph.bond_at(end)?;
        let outward = graph.sign_into(bond, end.vertex, end.port) < 0.0;
        // Sources and two-ports count along the half arrow, all others into the element.
        let along = match graph.vertex(end.vertex).law {
            Law::Source { detector, .. } => !detector,
            Law::Transformer(_) | Law::Gyrator(_) => true,
            _ => false,
        };
        Some((expr, along && outward))
    }

    /// `q(name)` or `p(name)` of a port.
    pub fn stored(&self, graph: &BondGraph, end: End) -> Option<&Expr> {
        let name = port_name(graph, end);
        self.variable(&format!("q({name})")).or_else(|| self.variable(&format!("p({name})")))
    }

    /// What a capacitor, an inductor or a line starts from.
    pub fn start(&self, graph: &BondGraph, device: usize) -> Start {
        let end = match self.claims.get(device).copied().flatten() {
            Some(Place::Signal(id)) => return Start::Signal(id),
            Some(Place::Port(end)) => end,
            None => return Start::Card,
        };
        match (graph.law_at(end), &graph.vertex(end.vertex).law) {
            (_, Law::Field(field)) if constant_inertias(field) => Start::Power(end),
            (Law::Store { law: StoreLaw::Linear(size), .. }, _) => {
                let mut constant = true;
                size.leaves(&mut |leaf, _| {
                    constant &= matches!(leaf, crate::bond::graph::Leaf::Parameter(_));
                });
                if constant { Start::Power(end) } else { Start::Stored(end) }
            }
            (Law::Store { .. }, _) => Start::Stored(end),
            (Law::Rate { .. }, _) => {
                // One integrator holds the state, another, where somebody asks, what is stored.
                let counted = self.stored(graph, end).map(|expr| &*expr.node);
                let node = self.circuit.devices.get(device).and_then(|d| d.nodes.first());
                match (counted, node) {
                    (Some(crate::expr::Node::Leaf(Leaf::Voltage(at, None))), Some(node))
                        if self.names.text(*at).eq_ignore_ascii_case(self.node_name(*node)) =>
                    {
                        Start::Stored(end)
                    }
                    _ => Start::Power(end),
                }
            }
            _ => Start::Card,
        }
    }

    /// Whether a behavioural card of a signal that remembers gives what is remembered, not what goes in.
    pub fn gives_memory(&self, device: usize) -> bool {
        let Some(place) = self.claims.get(device).copied().flatten() else { return false };
        let own = self.circuit.devices.get(device).and_then(|d| d.nodes.first()).copied();
        let taken = self.devices.get(&place).into_iter().flatten().any(|k| {
            let Some(other) = self.circuit.devices.get(*k) else { return false };
            match &other.kind {
                DeviceKind::Switch { control, .. } => {
                    let mut found = false;
                    control.leaves(&mut |leaf, _| {
                        if let crate::circuit::Leaf::Voltage(a, b) = leaf {
                            found |= Some(*a) == own || Some(*b) == own;
                        }
                    });
                    found
                }
                DeviceKind::Line { .. } => other.nodes.first().copied() == own,
                DeviceKind::Hold { .. } => other.nodes.get(1).copied() == own,
                _ => false,
            }
        });
        !taken
    }

    /// What a device's card says.
    pub fn element(&self, device: usize) -> Option<(&Pending<'n>, &'n Element)> {
        let pending = self.flat.devices.get(device)?;
        Some((pending, &pending.device.element))
    }

    /// The name of a device.
    pub fn device_name(&self, device: usize) -> String {
        self.flat.devices.get(device).map_or_else(String::new, |p| self.flat.device_name(p))
    }

    /// The name of a node.
    pub fn node_name(&self, node: NodeId) -> &str {
        self.circuit.nodes.get(node.0 as usize).map_or("", |node| node.name.as_str())
    }
}

/// Whether every name of an expression is that of something in the text.
fn leads_somewhere(lookup: &Lookup, expr: &Expr) -> bool {
    let mut all = true;
    expr.leaves(&mut |leaf, span| {
        let mut unknown = vec![];
        let node = |name: Name, d: &mut Vec<_>| lookup.node(TOP, name, span, d).is_some();
        all &= match leaf {
            Leaf::Voltage(a, b) => {
                node(*a, &mut unknown) && b.is_none_or(|b| node(b, &mut unknown))
            }
            Leaf::Current(name) => lookup.device(TOP, *name, span, &mut unknown).is_some(),
            // One that is not there has no value, which is found when it is asked for.
            Leaf::Parameter(_) | Leaf::Time => true,
            Leaf::Operator(..) | Leaf::Power(_) | Leaf::Part(..) => false,
        };
    });
    all
}

/// What a name that is read or saved leads to, however it is spelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Seen {
    /// A node.
    Node(NodeId),
    /// A device.
    Device(DeviceId),
}

/// What a voltage or a current is taken from.
pub fn seen(lookup: &Lookup, leaf: &Leaf) -> Vec<Seen> {
    let (span, mut unknown) = (Span::NONE, vec![]);
    match leaf {
        Leaf::Voltage(a, b) => std::iter::once(*a)
            .chain(*b)
            .filter_map(|name| lookup.node(TOP, name, span, &mut unknown).map(Seen::Node))
            .collect(),
        Leaf::Current(name) => {
            let device = lookup.device(TOP, *name, span, &mut unknown);
            device.map(Seen::Device).into_iter().collect()
        }
        _ => vec![],
    }
}

/// The name of a port within `e(…)` of the map.
pub fn port_name(graph: &BondGraph, end: End) -> String {
    match graph.vertex(end.vertex).law {
        Law::Transformer(_) | Law::Gyrator(_) => graph.port_name(end),
        _ => graph.end_name(end),
    }
}

/// What a card is labelled with: an element or a signal, and the bond of its port.
type Label = (String, Option<String>);

/// What the cards of each port and signal are labelled with. The ports of a two-port share a name and differ by their
/// bonds.
fn places(graph: &BondGraph) -> HashMap<Label, Place> {
    let mut places = HashMap::new();
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let ports = match vertex.law {
            Law::Transformer(_) | Law::Gyrator(_) => 2,
            Law::Zero | Law::One => 0,
            _ => graph.law_ports(id).count() as u32,
        };
        for port in 0..ports {
            let end = End { vertex: id, port };
            let label = format!("{}:{}", vertex.kind, graph.end_name(end));
            let bond = graph.bond_at(end).map(|bond| graph.bond_name(bond));
            places.insert((label.clone(), bond), Place::Port(end));
            if ports == 1 {
                places.insert((label, None), Place::Port(end));
            }
        }
    }
    for (k, signal) in graph.signals.iter().enumerate() {
        let kind = match signal.origin {
            SignalOrigin::Input => "input ",
            SignalOrigin::Signal => "signal ",
            SignalOrigin::Hidden => "",
        };
        let label = format!("{kind}{}", signal.name);
        places.insert((label, None), Place::Signal(SignalId(k as u32)));
    }
    places
}

/// The waveform that an independent source claims to be.
pub fn waveform_of(graph: &BondGraph, place: Place) -> Option<SignalId> {
    let is_waveform =
        |id: SignalId| matches!(graph.signals[id.index()].law, SignalLaw::Waveform(_));
    let id = match place {
        Place::Signal(id) => id,
        Place::Port(end) => match graph.law_at(end) {
            Law::Source { value, detector: false, .. } => match &*value.node {
                crate::expr::Node::Leaf(crate::bond::graph::Leaf::Signal(id)) => *id,
                _ => return None,
            },
            _ => return None,
        },
    };
    is_waveform(id).then_some(id)
}
