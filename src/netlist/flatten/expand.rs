//! The first pass: scopes, nodes and numbered devices.

use super::scope::{self, Scope, ScopeId, Scopes, TOP, Table};
use super::values::near;
use super::vary::Variation;
use crate::circuit::{DeviceId, Node, NodeId};
use crate::diagnostic::Diagnostic;
use crate::netlist::{Card, CardKind, Device, Element, Expr, Name, Netlist, Subcircuit};
use crate::quantity::nearest;
use crate::source::Span;

/// Instances within instances, at most.
const DEEPEST: usize = 100;
/// Devices, at most.
const MOST: usize = 8_000_000;
/// Instances, at most.
const MOST_INSTANCES: usize = 500_000;

/// The netlist laid flat, its devices not yet resolved.
pub struct Flat<'n> {
    /// The netlist.
    pub netlist: &'n Netlist,
    /// Scopes.
    pub scopes: Scopes<'n>,
    /// Nodes, ground first.
    pub nodes: Vec<Node>,
    /// Devices in order.
    pub devices: Vec<Pending<'n>>,
    /// `.ic` values with their scopes.
    pub initial: Vec<(ScopeId, Name, &'n Expr, Span)>,
}

/// A device that is not yet resolved.
pub struct Pending<'n> {
    /// Its card.
    pub card: &'n Card,
    /// What the card says.
    pub device: &'n Device,
    /// Where it stands.
    pub scope: ScopeId,
    /// Its nodes.
    pub nodes: Vec<NodeId>,
    /// Which pair of inductors, for a K of several.
    pub pair: (usize, usize),
}

/// Expands a netlist.
pub fn expand<'n>(netlist: &'n Netlist, d: &mut Vec<Diagnostic>) -> Flat<'n> {
    static NONE: std::sync::LazyLock<Variation> = std::sync::LazyLock::new(Variation::default);
    expand_with(netlist, &NONE, d)
}

/// Expands a netlist with other values in some places.
pub fn expand_with<'n>(
    netlist: &'n Netlist,
    variation: &'n Variation,
    d: &mut Vec<Diagnostic>,
) -> Flat<'n> {
    let ground = Node { name: "0".into(), nominal: None, span: Span::NONE };
    let mut flat = Flat {
        netlist,
        scopes: Scopes::default(),
        nodes: vec![ground],
        devices: Vec::with_capacity(netlist.cards.len()),
        initial: vec![],
    };
    flat.scopes.all.push(Scope::default());
    flat.scopes.temperature = variation.temperature.unwrap_or(scope::NOMINAL);
    let ground = netlist.names.find("0");
    let mut expander = Expander { flat, variation, ground, chain: vec![], full: false };
    let mut given = definitions(&mut expander.flat, TOP, &netlist.cards, d);
    for (name, expr) in &mut given {
        *expr = variation.parameters.get(name).unwrap_or(expr);
    }
    for (name, model) in &mut expander.flat.scopes.get_mut(TOP).models {
        if let Some(changed) = variation.models.get(name) {
            model.2 = changed;
        }
    }
    expander.flat.scopes.get_mut(TOP).written =
        given.iter().map(|(name, expr)| (*name, (TOP, *expr))).collect();
    scope::parameters(&mut expander.flat.scopes, TOP, &given, &netlist.names, d);
    expander.body(TOP, &netlist.cards, d);
    let flat = expander.flat;
    if flat.devices.is_empty() && !crate::diagnostic::has_errors(d) {
        d.push(
            Diagnostic::error("E0734", Span::NONE, "the netlist holds no device")
                .because("its first line is the title, even when it looks like a card"),
        );
    }
    flat
}

struct Expander<'n> {
    flat: Flat<'n>,
    variation: &'n Variation,
    ground: Option<Name>,
    /// The subcircuits that are being expanded, outermost first.
    chain: Vec<&'n Subcircuit>,
    full: bool,
}

/// Notes models and subcircuits of a body; gives its `.param`s.
fn definitions<'n>(
    flat: &mut Flat<'n>,
    id: ScopeId,
    cards: &'n [Card],
    d: &mut Vec<Diagnostic>,
) -> Vec<(Name, &'n Expr)> {
    let names = &flat.netlist.names;
    let scope = flat.scopes.get_mut(id);
    let mut given = vec![];
    for card in cards {
        match &card.kind {
            CardKind::Parameters(parameters) => {
                given.extend(parameters.iter().map(|(name, expr)| (*name, expr)))
            }
            CardKind::Model { name, kind, parameters } => {
                let before = scope.models.insert(*name, (card, kind, parameters));
                if let Some((first, ..)) = before {
                    d.push(twice("models", names.text(*name), card.span, first.span));
                }
            }
            CardKind::Subcircuit(subcircuit) => {
                let before = scope.subcircuits.insert(subcircuit.name, subcircuit);
                if before.is_some() {
                    d.push(twice(
                        "subcircuits",
                        names.text(subcircuit.name),
                        card.span,
                        Span::NONE,
                    ));
                }
            }
            _ => {}
        }
    }
    given
}

fn twice(what: &str, name: &str, span: Span, first: Span) -> Diagnostic {
    Diagnostic::error("E0735", span, format!("two {what} are called `{name}`"))
        .because("SPICE folds case: names that differ only in case are one")
        .label(first, "the first")
}

impl<'n> Expander<'n> {
    fn body(&mut self, id: ScopeId, cards: &'n [Card], d: &mut Vec<Diagnostic>) {
        for card in cards {
            match &card.kind {
                CardKind::Device(device) => self.device(id, card, device, d),
                CardKind::Initial(values) => {
                    self.flat
                        .initial
                        .extend(values.iter().map(|(node, value)| (id, *node, value, card.span)));
                }
                CardKind::Options(_)
                | CardKind::Save { .. }
                | CardKind::Transient { .. }
                | CardKind::OperatingPoint
                | CardKind::Analysis(_)
                | CardKind::Step(_)
                | CardKind::Data(_)
                    if id != TOP =>
                {
                    let message = "this card belongs outside `.subckt`";
                    let error = Diagnostic::error("E0736", card.span, message);
                    // Once for each card, however many instances there are.
                    let said = d.len() >= 1000 || d.contains(&error);
                    if !said {
                        d.push(error);
                    }
                }
                _ => {}
            }
        }
    }

    fn node(&mut self, id: ScopeId, name: Name, span: Span) -> NodeId {
        if Some(name) == self.ground {
            return NodeId(0);
        }
        let (scopes, nodes) = (&mut self.flat.scopes, &mut self.flat.nodes);
        let Scope { nodes: known, path, .. } = scopes.get_mut(id);
        *known.entry(name).or_insert_with(|| {
            let text = self.flat.netlist.names.text(name);
            nodes.push(Node { name: format!("{path}{text}"), nominal: None, span });
            NodeId(nodes.len() as u32 - 1)
        })
    }

    fn device(&mut self, id: ScopeId, card: &'n Card, device: &'n Device, d: &mut Vec<Diagnostic>) {
        if self.full {
            return;
        }
        let device = match self.variation.devices.is_empty() {
            true => device,
            false => {
                let own = self.flat.netlist.names.text(device.name);
                let path = format!("{}{own}", self.flat.scopes.get(id).path).to_lowercase();
                self.variation.devices.get(&path).unwrap_or(device)
            }
        };
        let nodes: Vec<NodeId> =
            device.nodes.iter().map(|name| self.node(id, *name, card.span)).collect();
        let names = &self.flat.netlist.names;
        let number = DeviceId(self.flat.devices.len() as u32);
        if let Some(before) = self.flat.scopes.get_mut(id).devices.insert(device.name, number) {
            let first = self
                .flat
                .devices
                .get(before.0 as usize)
                .map_or(Span::NONE, |first| first.card.span);
            d.push(twice("devices", names.text(device.name), card.span, first));
        }
        match &device.element {
            Element::Instance { subcircuit, parameters } => {
                self.instance(id, card, device, *subcircuit, parameters, &nodes, d);
            }
            Element::Mutual { inductors, .. } => {
                for first in 0..inductors.len() {
                    for second in first + 1..inductors.len() {
                        let pair = (first, second);
                        self.flat.devices.push(Pending {
                            card,
                            device,
                            scope: id,
                            nodes: vec![],
                            pair,
                        });
                    }
                }
            }
            _ => self.flat.devices.push(Pending { card, device, scope: id, nodes, pair: (0, 0) }),
        }
        let instances = self.flat.scopes.all.len();
        if !self.full && (self.flat.devices.len() > MOST || instances > MOST_INSTANCES) {
            self.full = true;
            let message = format!(
                "the netlist expands to more than {MOST} devices or {MOST_INSTANCES} instances"
            );
            d.push(Diagnostic::error("E0737", card.span, message));
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn instance(
        &mut self,
        id: ScopeId,
        card: &'n Card,
        device: &'n Device,
        name: Name,
        parameters: &'n [(Name, Expr)],
        nodes: &[NodeId],
        d: &mut Vec<Diagnostic>,
    ) {
        let names = &self.flat.netlist.names;
        let found = self
            .flat
            .scopes
            .around(id)
            .find_map(|(place, scope)| Some((place, *scope.subcircuits.get(&name)?)));
        let Some((place, subcircuit)) = found else {
            let text = names.text(name);
            let error =
                Diagnostic::error("E0738", card.span, format!("unknown subcircuit `{text}`"));
            let known = (0..names.len().min(near(d)) as u32).map(Name).filter(|name| {
                self.flat.scopes.around(id).any(|(_, scope)| scope.subcircuits.contains_key(name))
            });
            d.push(match nearest(text, known.map(|name| names.text(name))) {
                Some(near) => error.help(format!("did you mean `{near}`?")),
                None => error.help(format!("define it: .subckt {text} … .ends")),
            });
            return;
        };
        if subcircuit.ports.len() != nodes.len() {
            let (text, ports) = (names.text(name), subcircuit.ports.len());
            let message = format!(
                "`{text}` has {ports} terminals, `{}` joins {}",
                names.text(device.name),
                nodes.len()
            );
            d.push(Diagnostic::error("E0738", card.span, message));
            return;
        }
        let recursive = self.chain.iter().any(|open| std::ptr::eq(*open, subcircuit));
        if recursive || self.chain.len() >= DEEPEST {
            let chain: Vec<_> =
                self.chain.iter().chain([&subcircuit]).map(|open| names.text(open.name)).collect();
            let start = chain.len().saturating_sub(8);
            let message = if recursive {
                "a subcircuit that contains itself"
            } else {
                "subcircuits are nested too deeply"
            };
            let error =
                Diagnostic::error("E0739", card.span, message).because(chain[start..].join(" → "));
            if d.len() < 1000 && !d.contains(&error) {
                d.push(error);
            }
            return;
        }
        let mut table: Table<NodeId> = Table::default();
        for (port, node) in subcircuit.ports.iter().zip(nodes) {
            table.insert(*port, *node);
        }
        let mut values: Vec<(Name, Expr)> = vec![];
        for (name, expr) in parameters {
            if !subcircuit.parameters.iter().any(|(own, _)| own == name) {
                let text = names.text(*name);
                let error = Diagnostic::error(
                    "E0733",
                    card.span,
                    format!("`{}` has no parameter `{text}`", names.text(subcircuit.name)),
                );
                let near =
                    nearest(text, subcircuit.parameters.iter().map(|(own, _)| names.text(*own)));
                d.push(match near {
                    Some(near) => error.help(format!("did you mean `{near}`?")),
                    None => error,
                });
            }
            let value = scope::number(&self.flat.scopes, id, expr, names, d).unwrap_or(f64::NAN);
            values.push((*name, Expr::new(crate::expr::Node::Number(value), expr.span)));
        }
        let inner = ScopeId(self.flat.scopes.all.len() as u32);
        let path = format!("{}{}.", self.flat.scopes.get(id).path, names.text(device.name));
        self.flat.scopes.all.push(Scope {
            path,
            parent: Some(place),
            nodes: table,
            ..Scope::default()
        });
        let own = definitions(&mut self.flat, inner, &subcircuit.cards, d);
        let written = (subcircuit.parameters.iter().map(|(name, expr)| (*name, (inner, expr))))
            .chain(parameters.iter().map(|(name, expr)| (*name, (id, expr))))
            .chain(own.iter().map(|(name, expr)| (*name, (inner, *expr))));
        self.flat.scopes.get_mut(inner).written = written.collect();
        let defaults = subcircuit.parameters.iter().map(|(name, expr)| (*name, expr));
        let given: Vec<_> =
            defaults.chain(values.iter().map(|(name, expr)| (*name, expr))).chain(own).collect();
        scope::parameters(&mut self.flat.scopes, inner, &given, names, d);
        self.chain.push(subcircuit);
        self.body(inner, &subcircuit.cards, d);
        self.chain.pop();
    }
}
