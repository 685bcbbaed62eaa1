//! Expressions over names become expressions over nodes and devices.

use super::expand::Flat;
use super::scope::{self, ScopeId};
use crate::circuit::{self, DeviceId, NodeId};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::netlist::{Element, Expr, Leaf, Name, Names};
use crate::quantity::nearest;
use crate::source::Span;
use std::collections::HashMap;

/// Among so many names the nearest is looked for; in bigger decks that would take too long.
pub const NEAR: usize = 20_000;

/// So many messages name the nearest name; then the names are not what is wrong.
const HELPED: usize = 100;

/// How many names to look at.
pub fn near(d: &[Diagnostic]) -> usize {
    if d.len() < HELPED { NEAR } else { 0 }
}

/// Looks names up in a flat netlist.
pub struct Lookup<'f, 'n> {
    /// The netlist.
    pub flat: &'f Flat<'n>,
    /// The names: those of the netlist, or a copy with those of the header's columns.
    pub names: &'f Names,
    /// Nodes by their full names, folded; made when first asked for.
    paths: std::cell::OnceCell<Paths>,
}

struct Paths {
    scopes: HashMap<String, ScopeId>,
    nodes: HashMap<String, NodeId>,
    devices: HashMap<String, DeviceId>,
}

impl<'f, 'n> Lookup<'f, 'n> {
    /// A lookup with the names of the netlist.
    pub fn new(flat: &'f Flat<'n>, names: &'f Names) -> Lookup<'f, 'n> {
        Lookup { flat, names, paths: std::cell::OnceCell::new() }
    }

    fn paths(&self) -> &Paths {
        self.paths.get_or_init(|| {
            let nodes = self.flat.nodes.iter().enumerate();
            let devices = self.flat.devices.iter().enumerate();
            let scopes = self.flat.scopes.all.iter().enumerate();
            Paths {
                scopes: scopes
                    .map(|(k, scope)| (scope.path.to_lowercase(), ScopeId(k as u32)))
                    .collect(),
                nodes: nodes
                    .map(|(k, node)| (node.name.to_lowercase(), NodeId(k as u32)))
                    .collect(),
                devices: devices
                    .map(|(k, pending)| {
                        (self.flat.device_name(pending).to_lowercase(), DeviceId(k as u32))
                    })
                    .collect(),
            }
        })
    }

    /// The value of an expression that must be a number.
    pub fn number(&self, id: ScopeId, expr: &Expr, d: &mut Vec<Diagnostic>) -> Option<f64> {
        scope::number(&self.flat.scopes, id, expr, self.names, d)
    }

    /// Where a parameter is to be looked for, and its name there: `x1.x2.r` is that of an instance.
    pub fn parameter(&self, id: ScopeId, name: Name) -> (ScopeId, Name) {
        let found = self.names.text(name).rsplit_once('.').and_then(|(path, own)| {
            let path = format!("{}{path}.", self.flat.scopes.get(id).path).to_lowercase();
            Some((*self.paths().scopes.get(&path)?, self.names.find(own)?))
        });
        found.unwrap_or((id, name))
    }

    /// A node by its name in a scope, or by its full one (`x1.out`).
    pub fn node(
        &self,
        id: ScopeId,
        name: Name,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<NodeId> {
        let text = self.names.text(name);
        if let Some(node) = self.find_node(id, name) {
            return Some(node);
        }
        let near = nearest(
            text,
            self.flat.nodes.iter().skip(1).take(near(d)).map(|node| node.name.as_str()),
        );
        let error =
            Diagnostic::error("E0740", span, format!("no device stands at a node `{text}`"));
        d.push(match near {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error,
        });
        None
    }

    /// A device by its name in a scope, or by its full one: `x1.l1`, or as ngspice writes it, `l.x1.l1`.
    pub fn device(
        &self,
        id: ScopeId,
        name: Name,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<DeviceId> {
        let text = self.names.text(name);
        let scope = self.flat.scopes.get(id);
        let here = |device: &DeviceId| {
            // The name of an instance stands before the number of its first device.
            self.flat
                .devices
                .get(device.0 as usize)
                .is_some_and(|pending| pending.device.name == name && pending.scope == id)
        };
        if let Some(device) = scope.device(name).filter(here) {
            return Some(device);
        }
        let text = &text.replace(':', ".");
        if let Some((first, rest)) = text.split_once('.') {
            let path = format!("{}{text}", scope.path).to_lowercase();
            let short = format!("{}{rest}", scope.path).to_lowercase();
            let devices = &self.paths().devices;
            let found =
                devices.get(&path).or_else(|| devices.get(&short).filter(|_| first.len() == 1));
            if let Some(device) = found {
                return Some(*device);
            }
        }
        let known: Vec<String> = self
            .flat
            .devices
            .iter()
            .take(near(d))
            .map(|pending| self.flat.device_name(pending))
            .collect();
        let error = Diagnostic::error("E0741", span, format!("no device is called `{text}`"));
        d.push(match nearest(text, known.iter().map(String::as_str)) {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error,
        });
        None
    }

    /// Whether a device of this name stands in a scope.
    pub fn has_device(&self, id: ScopeId, name: Name) -> bool {
        self.find_value(id, self.names.text(name)).is_some()
    }

    /// The device whose value a name means, and the key of the value, which may be left out: `r1`, `r1:temp`.
    fn find_value<'t>(&self, id: ScopeId, text: &'t str) -> Option<(DeviceId, Option<&'t str>)> {
        let find = |path: &str| {
            let path = format!("{}{}", self.flat.scopes.get(id).path, path.replace(':', "."));
            self.paths().devices.get(&path.to_lowercase()).copied()
        };
        find(text).map(|device| (device, None)).or_else(|| {
            let (path, key) = text.rsplit_once(':')?;
            Some((find(path)?, Some(key)))
        })
    }

    /// A value of a device as it stands on its card, which may be a law.
    fn device_value(
        &self,
        id: ScopeId,
        name: Name,
        d: &mut Vec<Diagnostic>,
    ) -> Option<circuit::Expr> {
        let (device, key) = self.find_value(id, self.names.text(name))?;
        let pending = self.flat.devices.get(device.0 as usize)?;
        let element = &pending.device.element;
        let is = |other: &str| key.is_some_and(|key| key.eq_ignore_ascii_case(other));
        if is("cd") && matches!(element, Element::Diode { .. }) {
            return Some(circuit::Expr::leaf(circuit::Leaf::Capacitance(device)));
        }
        match super::vary::value_in(element, key) {
            Some(expr) => self.law(pending.scope, &expr, d),
            None if is("temp") => Some(circuit::Expr::number(self.flat.temperature)),
            None => None,
        }
    }

    /// Whether a node of this name stands in a scope.
    pub fn has_node(&self, id: ScopeId, name: Name) -> bool {
        self.find_node(id, name).is_some()
    }

    /// A node by its name in a scope, or by its full one; a terminal of an instance by its name there (`x1:in`).
    fn find_node(&self, id: ScopeId, name: Name) -> Option<NodeId> {
        let text = self.names.text(name);
        if text == "0" {
            return Some(NodeId(0));
        }
        let scope = self.flat.scopes.get(id);
        let global = || {
            let known = self.flat.scopes.globals.contains_key(&name);
            known.then(|| self.flat.scopes.get(scope::TOP).node(name)).flatten()
        };
        if let Some(node) = scope.node(name).or_else(global) {
            return Some(node);
        }
        if !text.contains(['.', ':']) {
            return None;
        }
        let path = format!("{}{}", scope.path, text.replace(':', ".")).to_lowercase();
        if let Some(node) = self.paths().nodes.get(&path) {
            return Some(*node);
        }
        let own = self.names.find(text.rsplit(['.', ':']).next()?)?;
        let around = path.rsplit_once('.')?.0;
        let inner = *self.paths().scopes.get(&format!("{around}."))?;
        self.flat.scopes.get(inner).node(own)
    }

    /// v·i of a device between its first two nodes.
    fn power(
        &self,
        id: ScopeId,
        name: Name,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Node<circuit::Leaf> {
        let Some(device) = self.device(id, name, span, d) else { return Node::Number(f64::NAN) };
        let nodes = self.flat.devices.get(device.0 as usize).map(|pending| &pending.nodes[..]);
        let Some([a, b, ..]) = nodes else { return Node::Number(f64::NAN) };
        let leaf = circuit::Expr::leaf;
        Node::Binary(
            crate::expr::Binary::Multiply,
            leaf(circuit::Leaf::Voltage(*a, *b)),
            leaf(circuit::Leaf::Current(device)),
        )
    }

    fn is_coupling(&self, device: DeviceId) -> bool {
        let pending = self.flat.devices.get(device.0 as usize);
        pending.is_some_and(|pending| matches!(pending.device.element, Element::Mutual { .. }))
    }

    /// A parameter that changes during the run, as it is written.
    fn varying(&self, id: ScopeId, name: Name, d: &mut Vec<Diagnostic>) -> circuit::Expr {
        let place = self.flat.scopes.varying(id, name);
        let written = place.and_then(|place| self.flat.scopes.get(place).written.get(&name));
        let law = written.and_then(|(place, expr)| self.law(*place, expr, d));
        law.unwrap_or(circuit::Expr::number(f64::NAN))
    }

    /// An expression of a scope over nodes and devices.
    pub fn law(&self, id: ScopeId, expr: &Expr, d: &mut Vec<Diagnostic>) -> Option<circuit::Expr> {
        let before = d.len();
        let law = expr.map(&mut |leaf, span| {
            let node = match leaf {
                Leaf::Parameter(name) if self.flat.scopes.varying(id, *name).is_some() => {
                    return self.varying(id, *name, d);
                }
                Leaf::Parameter(name) => {
                    let (place, own) = self.parameter(id, *name);
                    let value = self.flat.scopes.value(place, own, self.names);
                    if value.is_none() {
                        if let Some(law) = self.device_value(id, *name, d) {
                            return law;
                        }
                        let error = scope::unknown_parameter(
                            &self.flat.scopes,
                            id,
                            *name,
                            span,
                            self.names,
                            near(d),
                        );
                        d.push(error);
                    }
                    Node::Number(value.unwrap_or(f64::NAN))
                }
                Leaf::Voltage(plus, minus) => {
                    let plus = self.node(id, *plus, span, d);
                    let minus =
                        minus.map_or(Some(NodeId(0)), |minus| self.node(id, minus, span, d));
                    let ground = NodeId(0);
                    Node::Leaf(circuit::Leaf::Voltage(
                        plus.unwrap_or(ground),
                        minus.unwrap_or(ground),
                    ))
                }
                Leaf::Current(name) => match self.device(id, *name, span, d) {
                    Some(device) if self.is_coupling(device) => {
                        let text = self.names.text(*name);
                        d.push(
                            Diagnostic::error(
                                "E0741",
                                span,
                                format!("`{text}` carries no current"),
                            )
                            .says("it couples two inductors")
                            .help("read the current of one of the inductors"),
                        );
                        Node::Number(f64::NAN)
                    }
                    Some(device) => Node::Leaf(circuit::Leaf::Current(device)),
                    None => Node::Number(f64::NAN),
                },
                Leaf::Time => Node::Leaf(circuit::Leaf::Time),
                Leaf::Operator(operator, arguments) => {
                    return self.operator(id, *operator, arguments, span, d);
                }
                Leaf::Power(name) => self.power(id, *name, span, d),
                Leaf::Part(part, inner) => {
                    let probe = match &**inner {
                        Leaf::Current(name) => {
                            self.device(id, *name, span, d).map(circuit::Probe::Current)
                        }
                        Leaf::Voltage(plus, minus) => {
                            let ground = Some(NodeId(0));
                            let plus = self.node(id, *plus, span, d);
                            let minus = minus.map_or(ground, |node| self.node(id, node, span, d));
                            plus.zip(minus).map(|(a, b)| circuit::Probe::Voltage(a, b))
                        }
                        _ => None,
                    };
                    match probe {
                        Some(probe) => Node::Leaf(circuit::Leaf::Part(*part, probe)),
                        None => Node::Number(f64::NAN),
                    }
                }
            };
            circuit::Expr::new(node, span)
        });
        (d.len() == before).then(|| self.timed_tables(law))
    }
}

impl Flat<'_> {
    /// The full name of a device: `r1`, `x1.r1`.
    pub fn device_name(&self, pending: &super::expand::Pending) -> String {
        let own = self.netlist.names.text(pending.device.name);
        let path = &self.scopes.get(pending.scope).path;
        match pending.pair {
            (0, 0 | 1) => [path, own].concat(),
            // Further pairs of one K.
            (first, second) => format!("{path}{own}#{}_{}", first + 1, second + 1),
        }
    }
}
