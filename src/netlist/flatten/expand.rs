//! The first pass: scopes, nodes and numbered devices.

use super::copies::{COPIES, Joint};
use super::scope::{self, Numbers, Scope, ScopeId, Scopes, TOP, Table};
use super::sources::Times;
use super::values::near;
use super::vary::Variation;
use crate::circuit::{self, Node, NodeId, Nodes};
use crate::diagnostic::Diagnostic;
use crate::netlist::read::number;
use crate::netlist::{
    Branch, Card, CardKind, Device, Element, Expr, Leaf, Name, Netlist, Subcircuit,
};
use crate::quantity::{nearest, random};
use crate::source::Span;
use std::cell::RefCell;

/// Instances within instances, at most.
const DEEPEST: usize = 100;
/// The temperature of what says none, in °C.
const ROOM: f64 = 27.0;
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
    /// The cards outside of subcircuits that are no devices, one branch of each `.if` in its place.
    pub live: Vec<&'n Card>,
    /// `.nodeset` values with their scopes.
    pub guesses: Vec<(ScopeId, Name, &'n Expr, Span)>,
    /// `.ic` values with their scopes.
    pub initial: Vec<(ScopeId, Name, &'n Expr, Span)>,
    /// Step and end of the run.
    pub times: Times,
    /// The circuit's temperature, and that at which values are stated unless they say another, in °C.
    pub temperature: f64,
    /// See there.
    pub nominal_temperature: f64,
    /// The time constant in s that voltages follow their laws with.
    pub following: Option<f64>,
    /// Terminals of instances that stand for several.
    pub joints: Vec<Joint<'n>>,
    /// What laws speak of and is no device of a card; numbered after those.
    pub quantities: RefCell<Vec<circuit::Device>>,
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
    pub nodes: Nodes<NodeId>,
    /// Which pair of inductors, for a K of several.
    pub pair: (u32, u32),
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
        live: vec![],
        guesses: vec![],
        times: Times::default(),
        temperature: ROOM,
        nominal_temperature: ROOM,
        following: None,
        joints: vec![],
        quantities: RefCell::default(),
    };
    let numbers = || Numbers::dense(netlist.names.len());
    flat.scopes.all.push(Scope { nodes: numbers(), devices: numbers(), ..Scope::default() });
    // Devices are by far the most, and say nothing here.
    let is_device = |card: &&Card| matches!(card.kind, CardKind::Device(_));
    let special: Vec<&Card> = netlist.cards.iter().filter(|card| !is_device(card)).collect();
    let options: Vec<&(String, String)> = options(&special).chain(&variation.options).collect();
    let stated = |key: &str| stated(netlist, &options, key);
    flat.scopes.temperature = variation.temperature.or_else(|| stated("temp")).unwrap_or(ROOM);
    let seed = stated("seed").filter(|seed| *seed >= 0.0).unwrap_or(1.0);
    flat.scopes.seed = random::below(seed as u64, &format!("step {}", variation.step));
    let ground = netlist.names.find("0");
    let mut expander = Expander { flat, variation, ground, chain: vec![], several: 0, full: false };
    globals(&mut expander.flat.scopes.globals, special.iter().copied());
    let varied: Vec<(Name, &Expr)> =
        variation.parameters.iter().map(|(name, expr)| (*name, expr)).collect();
    let (live, mut given) = expander.choose(TOP, &netlist.cards, &[], &varied, d);
    // The last of a name counts.
    given.extend(varied);
    for (name, model) in &mut expander.flat.scopes.get_mut(TOP).models {
        if let Some(changed) = variation.models.get(name) {
            model.2 = changed;
        }
    }
    expander.flat.scopes.get_mut(TOP).written =
        given.iter().map(|(name, expr)| (*name, (TOP, *expr))).collect();
    scope::parameters(&mut expander.flat.scopes, TOP, &given, &netlist.names, d);
    expander.body(TOP, &live, d);
    let mut flat = expander.flat;
    flat.live = live;
    flat.live.retain(|card| !matches!(card.kind, CardKind::Device(_)));
    if flat.devices.is_empty() && !crate::diagnostic::has_errors(d) {
        d.push(
            Diagnostic::error("E0734", Span::NONE, "the netlist holds no device")
                .because("its first line is the title, even when it looks like a card"),
        );
    }
    flat
}

/// The options of all cards outside of subcircuits, in order.
fn options<'n>(cards: &[&'n Card]) -> impl Iterator<Item = &'n (String, String)> {
    let cards = cards.iter().filter_map(|card| match &card.kind {
        CardKind::Options(options) => Some(options),
        _ => None,
    });
    cards.flatten()
}

/// The number that an option states, in any case. One that cannot be read is told of elsewhere.
fn stated(netlist: &Netlist, options: &[&(String, String)], key: &str) -> Option<f64> {
    let numbers = netlist.dialect.reading().numbers;
    let texts = options.iter().filter(|(own, _)| own.eq_ignore_ascii_case(key));
    let values = texts.filter_map(|(_, text)| number::number(text, numbers));
    values.map(|read| read.value).reduce(|_, last| last)
}

pub(super) struct Expander<'n> {
    pub(super) flat: Flat<'n>,
    variation: &'n Variation,
    pub(super) ground: Option<Name>,
    /// The subcircuits that are being expanded, outermost first.
    chain: Vec<&'n Subcircuit>,
    /// How many of them stand for several in parallel.
    several: usize,
    full: bool,
}

/// Parameters in their order, with what they are defined by.
type Given<'n> = Vec<(Name, &'n Expr)>;

/// Nodes of `.global`, wherever it stands.
fn globals<'n>(found: &mut Table<()>, cards: impl Iterator<Item = &'n Card>) {
    for card in cards {
        match &card.kind {
            CardKind::Global(nodes) => found.extend(nodes.iter().map(|node| (*node, ()))),
            CardKind::Subcircuit(subcircuit) => globals(found, subcircuit.cards.iter()),
            CardKind::Choice(branches) => {
                branches.iter().for_each(|branch| globals(found, branch.cards.iter()));
            }
            _ => {}
        }
    }
}

fn parameters_of(card: &Card) -> impl Iterator<Item = (Name, &Expr)> {
    let parameters = match &card.kind {
        CardKind::Parameters(parameters) => parameters.as_slice(),
        _ => &[],
    };
    parameters.iter().map(|(name, expr)| (*name, expr))
}

/// Notes models and subcircuits of a body; gives its `.param`s.
fn definitions<'n>(
    flat: &mut Flat<'n>,
    id: ScopeId,
    cards: &[&'n Card],
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
    /// The cards of a body that count, one branch of each `.if` put in its place, and the parameters that they define behind
    /// those that are given. A condition may use every parameter that stands outside of choices or in a branch before it.
    fn choose<'a>(
        &mut self,
        id: ScopeId,
        cards: &'n [Card],
        outer: &[(Name, &'a Expr)],
        varied: &[(Name, &'a Expr)],
        d: &mut Vec<Diagnostic>,
    ) -> (Vec<&'n Card>, Given<'a>)
    where
        'n: 'a,
    {
        let mut live: Vec<&'n Card> = cards.iter().collect();
        let is_choice = |card: &&Card| matches!(card.kind, CardKind::Choice(_));
        let mut known = false;
        while let Some(at) = live.iter().position(is_choice) {
            let card = live[at];
            let CardKind::Choice(branches) = &card.kind else { break };
            if !known {
                let given: Given<'a> = outer
                    .iter()
                    .copied()
                    .chain(live.iter().flat_map(|card| parameters_of(card)))
                    .chain(varied.iter().copied())
                    .collect();
                self.flat.scopes.get_mut(id).parameters.clear();
                // What is unknown as yet may stand in a branch; what stays unknown is said at the end.
                let names = &self.flat.netlist.names;
                scope::parameters(&mut self.flat.scopes, id, &given, names, &mut vec![]);
            }
            let names = &self.flat.netlist.names;
            let holds = |branch: &&Branch| match &branch.condition {
                Some(condition) => {
                    let value = scope::number(&self.flat.scopes, id, condition, names, d);
                    value.is_some_and(|value| value != 0.0)
                }
                None => true,
            };
            let mut chosen = vec![];
            if let Some(branch) = branches.iter().find(holds) {
                chosen.extend(branch.cards.iter());
            }
            known = !chosen.iter().any(|card| matches!(card.kind, CardKind::Parameters(_)));
            live.splice(at..=at, chosen);
        }
        self.flat.scopes.get_mut(id).parameters.clear();
        let mut given: Given<'a> = outer.to_vec();
        given.extend(definitions(&mut self.flat, id, &live, d));
        (live, given)
    }

    fn body(&mut self, id: ScopeId, cards: &[&'n Card], d: &mut Vec<Diagnostic>) {
        for &card in cards {
            match &card.kind {
                CardKind::Device(device) => self.device(id, card, device, d),
                CardKind::Initial(values) | CardKind::Guess(values) => {
                    let kept = match card.kind {
                        CardKind::Initial(_) => &mut self.flat.initial,
                        _ => &mut self.flat.guesses,
                    };
                    kept.extend(values.iter().map(|(node, value)| (id, *node, value, card.span)));
                }
                CardKind::Options(_)
                | CardKind::Save { .. }
                | CardKind::Transient { .. }
                | CardKind::OperatingPoint
                | CardKind::Measure(_)
                | CardKind::Fourier(_)
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
        let id = match scopes.globals.contains_key(&name) {
            true if scopes.get(id).node(name).is_none() => TOP,
            _ => id,
        };
        let scope = scopes.get_mut(id);
        scope.node(name).unwrap_or_else(|| {
            let text = self.flat.netlist.names.text(name);
            let number = nodes.len() as u32;
            nodes.push(Node { name: [&scope.path, text].concat(), nominal: None, span });
            scope.nodes.insert(name, number);
            NodeId(number)
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
        let nodes: Nodes<NodeId> =
            device.nodes.iter().map(|name| self.node(id, *name, card.span)).collect();
        let names = &self.flat.netlist.names;
        if self.several > 0 {
            self.refuse_globals(id, card, device, d);
        }
        let number = self.flat.devices.len() as u32;
        if let Some(before) = self.flat.scopes.get_mut(id).devices.insert(device.name, number) {
            let first =
                self.flat.devices.get(before as usize).map_or(Span::NONE, |first| first.card.span);
            d.push(twice("devices", names.text(device.name), card.span, first));
        }
        match &device.element {
            Element::Instance { subcircuit, parameters } => {
                self.instance(id, card, device, *subcircuit, parameters, &nodes, d);
            }
            Element::Mutual { inductors, .. } => {
                let count = inductors.len() as u32;
                let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
                // Thousands of inductors have millions of pairs.
                let room = (MOST + 1).saturating_sub(self.flat.devices.len());
                self.flat.devices.extend(pairs.take(room).map(|pair| Pending {
                    card,
                    device,
                    scope: id,
                    nodes: Nodes::new(),
                    pair,
                }));
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
        let several = self.copies(id, card, subcircuit, parameters, d);
        let mut inner_nodes = Numbers::default();
        for (port, node) in subcircuit.ports.iter().zip(nodes) {
            let inner = match several {
                Some(copies) if node.0 != 0 => {
                    let own = [self.flat.scopes.get(id).path.as_str(), names.text(device.name)];
                    let name = format!("{}#{}", own.concat(), names.text(*port));
                    let inner = NodeId(self.flat.nodes.len() as u32);
                    let node_name = name.clone();
                    self.flat.nodes.push(Node { name: node_name, nominal: None, span: card.span });
                    self.flat.joints.push(Joint { name, nodes: [*node, inner], copies, card });
                    inner
                }
                _ => *node,
            };
            inner_nodes.insert(*port, inner.0);
        }
        let (mut values, mut varying): (Vec<(Name, Expr)>, Vec<Name>) = (vec![], vec![]);
        for (name, expr) in parameters {
            if !subcircuit.parameters.iter().any(|(own, _)| own == name) {
                if names.text(*name).eq_ignore_ascii_case(COPIES) {
                    continue;
                }
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
            if scope::varies(&self.flat.scopes, id, expr) {
                varying.push(*name);
                continue;
            }
            // What nothing outside is called may be another parameter of this card: `x1 a b s p=2 q={3*p}`.
            let expr = self.of_card(id, parameters, expr, 0);
            let value = scope::number(&self.flat.scopes, id, &expr, names, d).unwrap_or(f64::NAN);
            values.push((*name, Expr::new(crate::expr::Node::Number(value), expr.span)));
        }
        let inner = ScopeId(self.flat.scopes.all.len() as u32);
        let path = format!("{}{}.", self.flat.scopes.get(id).path, names.text(device.name));
        self.flat.scopes.all.push(Scope {
            path,
            parent: Some(place),
            nodes: inner_nodes,
            ..Scope::default()
        });
        self.flat.scopes.get_mut(inner).varying.extend(varying.iter().map(|name| (*name, ())));
        let outer: Vec<(Name, &Expr)> = (subcircuit.parameters.iter())
            .filter(|(name, _)| !varying.contains(name))
            .chain(&values)
            .map(|(name, expr)| (*name, expr))
            .collect();
        let (live, mut given) = self.choose(inner, &subcircuit.cards, &outer, &[], d);
        if self.flat.netlist.dialect.reading().instance_wins {
            let said = |name: &Name| values.iter().any(|(own, _)| own == name);
            let mut k = 0;
            given.retain(|(name, _)| {
                k += 1;
                k <= outer.len() || !said(name)
            });
        }
        let own = live.iter().flat_map(|card| parameters_of(card));
        let written = (subcircuit.parameters.iter().map(|(name, expr)| (*name, (inner, expr))))
            .chain(parameters.iter().map(|(name, expr)| (*name, (id, expr))))
            .chain(own.map(|(name, expr)| (name, (inner, expr))));
        self.flat.scopes.get_mut(inner).written = written.collect();
        let names = &self.flat.netlist.names;
        scope::parameters(&mut self.flat.scopes, inner, &given, names, d);
        self.chain.push(subcircuit);
        self.several += usize::from(several.is_some());
        self.body(inner, &live, d);
        self.several -= usize::from(several.is_some());
        self.chain.pop();
    }
}

impl<'n> Expander<'n> {
    /// An expression of an X card with the card's own parameters in the places of names that mean nothing around it.
    fn of_card(&self, id: ScopeId, parameters: &[(Name, Expr)], expr: &Expr, depth: usize) -> Expr {
        let names = &self.flat.netlist.names;
        expr.map(&mut |leaf, span| {
            let given = match leaf {
                Leaf::Parameter(name) if self.flat.scopes.value(id, *name, names).is_none() => {
                    parameters.iter().find(|(own, _)| own == name)
                }
                _ => None,
            };
            match given {
                Some((_, given)) if depth < parameters.len().min(DEEPEST) => {
                    self.of_card(id, parameters, given, depth + 1)
                }
                _ => Expr::new(crate::expr::Node::Leaf(leaf.clone()), span),
            }
        })
    }
}

impl Flat<'_> {
    /// Whether a negative hysteresis means a smooth switch (LTspice).
    pub fn smooth_when_negative(&self) -> bool {
        self.netlist.dialect.name == "ltspice"
    }

    /// Whether `r=`, `c=` and `l=` of models multiply values (PSpice and its kin), rather than being values.
    pub fn models_multiply(&self) -> bool {
        matches!(self.netlist.dialect.name, "xyce" | "ltspice")
    }

    /// Whether a rise or fall of 0 is a jump (Xyce), rather than one step of the run.
    pub fn zero_is_jump(&self) -> bool {
        self.netlist.dialect.name == "xyce"
    }

    /// Whether the knee of diodes is that of PSpice.
    pub fn knee_by_root(&self) -> bool {
        self.models_multiply()
    }
}
