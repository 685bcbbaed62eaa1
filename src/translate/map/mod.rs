//! The map: which circuit variable is which effort, flow, state and signal of the bond graph.

mod json;

use super::Builder;
use super::names::Renamed;
use super::values::Speaker;
use crate::bond::graph::{self, BondId, Law, Power, SignalOrigin, Storage};
use crate::expr::{Binary, Node, Unary};
use crate::netlist::dialects::{Dialect, NGSPICE};
use crate::netlist::write::expression;
use crate::netlist::{CardKind, Expr, Leaf, Name, Names};
use crate::quantity::Domain;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};

/// The map of a translation.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The dialect whose spelling it has as text.
    pub dialect: &'static Dialect,
    /// Observed columns first, then all variables of the graph in file order.
    pub variables: Vec<Variable>,
    /// Devices and where they come from, in the order of the netlist.
    pub cards: Vec<MapCard>,
    /// Parameters and their values in SI.
    pub parameters: Vec<(Name, f64)>,
    /// Names that SPICE would not take, or not tell apart.
    pub renamed: Vec<Renamed>,
    /// Domains that stand scaled in the circuit, and by what.
    pub scales: Vec<(Domain, f64)>,
    /// How much circuit it took.
    pub figures: Figures,
}

/// A variable of the bond graph in terms of the circuit.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// As the bond graph calls it: `e(pump_port)`, `f(rod -> attachment)`, `q(fluid)`, a signal, a column's header.
    pub bg: String,
    /// Its value in SI; `None` where no variable of the circuit holds it.
    pub expr: Option<Expr>,
    /// The value in `unit` is `expr` times this.
    pub factor: f64,
    /// Its unit, empty where none is known.
    pub unit: String,
    /// Its domain.
    pub domain: Domain,
    /// Whether it is an observed column.
    pub observed: bool,
}

/// A device and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct MapCard {
    /// The device's name.
    pub card: String,
    /// The element, `R:eta`, or what else the card stands for.
    pub element: String,
    /// The bond of its port, `armature -> eta`.
    pub bond: Option<String>,
    /// The line of the bond graph's file.
    pub line: Option<usize>,
}

/// How much circuit it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Figures {
    /// Nodes without ground.
    pub nodes: usize,
    /// Devices.
    pub devices: usize,
    /// Those that stand for no element: 0 V sources that carry a flow, 1:1 couplers.
    pub helpers: usize,
}

impl std::fmt::Display for Figures {
    /// `4 nodes, 7 devices, 0 helpers`.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Figures { nodes, devices, helpers } = self;
        let many = |count: &usize| if *count == 1 { "" } else { "s" };
        write!(f, "{nodes} node{}, ", many(nodes))?;
        write!(f, "{devices} device{}, ", many(devices))?;
        write!(f, "{helpers} helper{}", many(helpers))
    }
}

/// Which bond a card belongs to.
#[derive(Clone, Debug)]
pub struct Link {
    /// Index among the cards.
    pub card: usize,
    /// `R:eta`.
    pub element: String,
    /// The bond of its port.
    pub bond: BondId,
}

impl Map {
    /// What the circuit's devices, voltages and currents are called in the bond graph.
    pub fn spoken(&self, names: &Names) -> BTreeMap<String, String> {
        let mut spoken = BTreeMap::new();
        for card in self.cards.iter().filter(|card| card.line.is_some()) {
            spoken.insert(card.card.to_lowercase(), card.element.clone());
        }
        // Columns may be headed by anything.
        let plain = |v: &&Variable| !v.observed || v.bg.starts_with("e(") || v.bg.starts_with("f(");
        for variable in self.variables.iter().filter(plain) {
            let name = match variable.expr.as_ref().map(|expr| &*expr.node) {
                Some(Node::Leaf(Leaf::Voltage(node, None))) => format!("v({})", names.text(*node)),
                Some(Node::Leaf(Leaf::Current(device))) => format!("i({})", names.text(*device)),
                _ => continue,
            };
            // The junction that gave the node its name before the ports at it.
            let own = variable.bg.get(1..) == name.get(1..);
            match spoken.entry(name.to_lowercase()) {
                Entry::Occupied(mut other) if own => drop(other.insert(variable.bg.clone())),
                Entry::Occupied(_) => {}
                Entry::Vacant(place) => drop(place.insert(variable.bg.clone())),
            }
        }
        spoken
    }
}

impl Builder<'_> {
    /// The map of what has been built.
    pub(super) fn map(&self) -> Map {
        let mut variables = self.observed();
        self.element_variables(&mut variables);
        self.bond_variables(&mut variables);
        self.signal_variables(&mut variables);
        self.leave_out_observed(&mut variables);
        let cards = self.map_cards();
        let mut nodes = std::collections::HashSet::new();
        for card in &self.cards {
            if let CardKind::Device(device) = &card.kind {
                nodes.extend(device.nodes.iter().copied());
            }
        }
        nodes.remove(&self.ground());
        let figures = Figures {
            nodes: nodes.len(),
            devices: cards.len(),
            helpers: self.flows.senses.len() + self.couplers,
        };
        let renamed = self.namer.renamed.clone();
        let values = self.graph.parameters.iter().map(|parameter| parameter.value);
        let parameters = self.parameters.iter().copied().zip(values).collect();
        let scales = self.graph.scales.iter().map(|scale| (scale.domain, scale.factor)).collect();
        Map { dialect: &NGSPICE, variables, cards, parameters, renamed, scales, figures }
    }

    fn observed(&self) -> Vec<Variable> {
        let mut variables = Vec::new();
        for observation in &self.graph.experiment.observe {
            // What cannot be read is said where the columns are made.
            if let Ok(expr) = self.value(&observation.expr, None, Speaker::Output) {
                variables.push(Variable {
                    bg: observation.name.clone(),
                    expr: Some(expr),
                    factor: 1.0 / observation.unit.1,
                    unit: match observation.unit.0.as_str() {
                        "" => observation.si_unit.clone(),
                        unit => unit.to_string(),
                    },
                    domain: self.domain(&observation.expr),
                    observed: true,
                });
            }
        }
        variables
    }

    /// The domain of a reading, of a power, or of what is stored; of anything else none is known.
    fn domain(&self, expr: &graph::Expr) -> Domain {
        let of = |bond: BondId| self.graph.bond(bond).domain;
        match &*expr.node {
            Node::Leaf(graph::Leaf::Bond { bond, .. }) => of(*bond),
            Node::Leaf(graph::Leaf::Stored(end)) => {
                self.graph.bond_at(*end).map_or(Domain::Any, of)
            }
            Node::Unary(Unary::Negate, inner) => self.domain(inner),
            Node::Binary(Binary::Multiply, a, b) => match (&*a.node, &*b.node) {
                (
                    Node::Leaf(graph::Leaf::Bond { bond, variable: Power::Effort, .. }),
                    Node::Leaf(graph::Leaf::Bond { bond: same, variable: Power::Flow, .. }),
                ) if bond == same => of(*bond),
                _ => Domain::Any,
            },
            _ => Domain::Any,
        }
    }

    /// What an observed column holds under its own name stands there alone.
    fn leave_out_observed(&self, variables: &mut Vec<Variable>) {
        let text = |variable: &Variable| {
            let names = &self.namer.names;
            variable.expr.as_ref().map(|expr| expression(names, expr))
        };
        let observed: HashMap<String, Option<String>> = variables
            .iter()
            .filter(|variable| variable.observed)
            .map(|variable| (variable.bg.clone(), text(variable)))
            .collect();
        variables.retain(|variable| {
            variable.observed
                || observed.get(&variable.bg).is_none_or(|held| *held != text(variable))
        });
    }

    /// Efforts of 0-junctions, flows of 1-junctions, both of every port, and what is stored.
    fn element_variables(&self, variables: &mut Vec<Variable>) {
        let graph = self.graph;
        for id in graph.vertex_ids() {
            let vertex = graph.vertex(id);
            let name = &vertex.name;
            let mut push = |bg: String, expr, unit: &str, domain, power| {
                variables.push(Variable {
                    bg,
                    expr,
                    factor: graph.unscale(domain, power),
                    unit: unit.to_string(),
                    domain,
                    observed: false,
                });
            };
            let Some(first) = vertex.bonds.first().copied() else { continue };
            let domain = graph.bond(first).domain;
            let row = domain.row();
            match &vertex.law {
                Law::Zero => push(format!("e({name})"), self.effort(first), row.effort, domain, 1),
                Law::One => {
                    let flow = self.flow(first, Speaker::Output);
                    push(format!("f({name})"), flow, row.flow, domain, -1);
                }
                Law::Transformer(_) | Law::Gyrator(_) => {
                    for (port, bond) in vertex.bonds.iter().enumerate() {
                        let domain = graph.bond(*bond).domain;
                        let (row, port) = (domain.row(), port + 1);
                        push(
                            format!("e({name}.{port})"),
                            self.effort(*bond),
                            row.effort,
                            domain,
                            1,
                        );
                        let flow = self.flow(*bond, Speaker::Output);
                        push(format!("f({name}.{port})"), flow, row.flow, domain, -1);
                    }
                }
                _ => {
                    for end in graph.law_ports(id) {
                        let Some(bond) = graph.bond_at(end) else { continue };
                        let (name, domain) = (graph.end_name(end), graph.bond(bond).domain);
                        let row = domain.row();
                        // Sources count along the half arrow, all others into the element.
                        let flow = match &vertex.law {
                            Law::Source { detector: false, .. } => self.flow(bond, Speaker::Output),
                            _ => self.own_power(end, Power::Flow, Speaker::Output),
                        };
                        push(format!("e({name})"), self.effort(bond), row.effort, domain, 1);
                        push(format!("f({name})"), flow, row.flow, domain, -1);
                        if let Some(kind) = graph.storage(end) {
                            let (letter, unit, power) = match kind {
                                Storage::Compliance => ('q', row.displacement, -1),
                                Storage::Inertia => ('p', row.momentum, 1),
                            };
                            let stored = self.stored(end, Speaker::Output);
                            push(format!("{letter}({name})"), stored, unit, domain, power);
                        }
                    }
                }
            }
        }
    }

    fn bond_variables(&self, variables: &mut Vec<Variable>) {
        let graph = self.graph;
        let mut count = std::collections::HashMap::new();
        for bond in graph.bond_ids() {
            let domain = graph.bond(bond).domain;
            let name = graph.bond_name(bond);
            let nth = count.entry(name.clone()).and_modify(|n| *n += 1).or_insert(1);
            let name = if *nth > 1 { format!("{name} [{nth}]") } else { name };
            for (letter, expr, unit, power) in [
                ('e', self.effort(bond), domain.row().effort, 1),
                ('f', self.flow(bond, Speaker::Output), domain.row().flow, -1),
            ] {
                variables.push(Variable {
                    bg: format!("{letter}({name})"),
                    expr,
                    factor: graph.unscale(domain, power),
                    unit: unit.to_string(),
                    domain,
                    observed: false,
                });
            }
        }
    }

    fn signal_variables(&self, variables: &mut Vec<Variable>) {
        for (signal, place) in self.graph.signals.iter().zip(&self.signal_places) {
            if signal.origin == SignalOrigin::Hidden {
                continue;
            }
            let unit = signal.unit.as_ref().filter(|unit| unit.factor == 1.0);
            variables.push(Variable {
                bg: signal.name.clone(),
                expr: self.signal(*place),
                factor: 1.0,
                unit: unit.map(|unit| unit.text.clone()).unwrap_or_default(),
                domain: Domain::Any,
                observed: false,
            });
        }
    }

    fn map_cards(&self) -> Vec<MapCard> {
        let mut links = self.links.iter().peekable();
        let mut cards = Vec::new();
        for (index, card) in self.cards.iter().enumerate() {
            let CardKind::Device(device) = &card.kind else { continue };
            let link = links.next_if(|link| link.card == index);
            let what = card.comment.as_deref().unwrap_or("");
            // Past the place that the comment begins with.
            let what = what.split_once(' ').map_or(what, |(_, what)| what);
            cards.push(MapCard {
                card: self.namer.names.text(device.name).to_string(),
                element: link.map_or_else(|| what.to_string(), |link| link.element.clone()),
                bond: link.map(|link| self.graph.bond_name(link.bond)),
                line: self.source.position(card.span).map(|(line, _)| line),
            });
        }
        cards
    }
}
