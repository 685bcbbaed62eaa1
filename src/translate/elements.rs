//! Cards of elements, island by island.

use super::flows::{Carrier, Reader, own_device};
use super::forms::{Coupling, Form, Integrator, SourceValue, constant_value, form_at};
use super::islands::is_junction;
use super::map::Link;
use super::names::{Namer, common_part};
use super::series_parallel::Item;
use super::values::{Speaker, Unreadable, negate, product, signed, tidy};
use super::{Builder, Mark};
use crate::bond::graph::{
    self, BondGraph, BondId, End, Initial, Law, Leaf, StoreInitial, StoreLaw, Variable, VertexId,
};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::netlist::{self, Element, Expr, Name, Waveform};

/// By vertex in rate form whose q or p is spoken of: an integrator that counts it.
pub fn counters(graph: &BondGraph, forms: &[Form], namer: &mut Namer) -> Vec<Option<Integrator>> {
    let mut spoken = vec![false; graph.vertices.len()];
    let mut note = |expr: &crate::bond::graph::Expr, own: Option<VertexId>| {
        expr.leaves(&mut |leaf, _| match (leaf, own) {
            (Leaf::Stored(end), _) => spoken[end.vertex.index()] = true,
            (Leaf::Own(Variable::Stored), Some(id)) => spoken[id.index()] = true,
            _ => {}
        });
    };
    for id in graph.vertex_ids() {
        graph.vertex(id).law.expressions(&mut |expr| note(expr, Some(id)));
    }
    for signal in &graph.signals {
        if let Some(expr) = signal.law.expression() {
            note(expr, None);
        }
    }
    for observation in &graph.experiment.observe {
        note(&observation.expr, None);
    }
    let mut counter = |vertex: usize, variable: &str, feed: char| {
        let full = format!("{}_{variable}", graph.vertices[vertex].name);
        Integrator {
            node: namer.node(&full),
            capacitor: namer.device('C', &full),
            feed: namer.device(feed, &full),
        }
    };
    (0..forms.len())
        .map(|vertex| match forms[vertex] {
            Form::RateEffort { .. } if spoken[vertex] => Some(counter(vertex, "q", 'F')),
            Form::RateFlow { .. } if spoken[vertex] => Some(counter(vertex, "p", 'G')),
            _ => None,
        })
        .collect()
}

impl Builder<'_> {
    /// Ground.
    pub fn ground(&self) -> Name {
        self.points[0]
    }

    /// Adds the cards of every island, each under a heading.
    pub(super) fn island_cards(&mut self, diagnostics: &mut Vec<Diagnostic>) {
        for index in 0..self.islands.len() {
            let items = self.drawing.items[index].clone();
            if items.is_empty() {
                continue;
            }
            let heading = self.heading(index);
            self.mark(Mark::default());
            self.comment(heading);
            for item in items {
                self.mark(self.mark_of(item));
                match item {
                    Item::Port(end) => {
                        if let Err(unreadable) = self.port_card(end) {
                            diagnostics.push(unreadable.diagnostic(self.graph));
                        }
                    }
                    Item::Sense { bond, plus, minus } => self.sense_card(bond, [plus, minus]),
                    Item::Coupler(bond) => self.coupler_cards(bond),
                }
            }
        }
    }

    /// Which part of the graph an item stands for.
    fn mark_of(&self, item: Item) -> Mark {
        let vertex = |bond: BondId| {
            let bond = self.graph.bond(bond);
            let ends = [bond.from.vertex, bond.to.vertex];
            let series = ends.into_iter().find(|v| matches!(self.graph.vertex(*v).law, Law::One));
            let element = ends.into_iter().find(|v| !is_junction(self.graph, *v));
            series.or(element).unwrap_or(ends[0])
        };
        match item {
            Item::Port(end) => {
                Mark { home: self.homes[end.vertex.index()], order: (0, end.vertex.0, end.port) }
            }
            Item::Sense { bond, .. } => {
                let vertex = vertex(bond);
                Mark { home: self.homes[vertex.index()], order: (0, vertex.0, u32::MAX) }
            }
            Item::Coupler(bond) => {
                let bond = self.graph.bond(bond);
                let [mut a, mut b] =
                    [bond.from.vertex, bond.to.vertex].map(|v| self.homes[v.index()]);
                // The instance around both: those within others stand behind them.
                while a != b {
                    let deeper = if a > b { &mut a } else { &mut b };
                    let around = self.graph.tree.get(*deeper as usize);
                    *deeper = around.and_then(|instance| instance.parent).unwrap_or(0);
                }
                Mark { home: a, order: (0, bond.from.vertex.0, u32::MAX - 1) }
            }
        }
    }

    /// ` armature: electrical`.
    fn heading(&self, index: usize) -> String {
        let island = &self.islands[index];
        let name = match (island.junctions.first(), island.bonds.first()) {
            (Some(junction), _) => self.graph.vertex(*junction).name.clone(),
            (None, Some(bond)) => {
                let bond = self.graph.bond(*bond);
                let one_port = |end: End| self.graph.vertex(end.vertex).bonds.len() == 1;
                let end = if one_port(bond.from) { bond.from } else { bond.to };
                self.graph.vertex(end.vertex).name.clone()
            }
            (None, None) => String::new(),
        };
        match island.domain {
            crate::quantity::Domain::Any => format!(" {name}"),
            domain => format!(" {name}: {}", domain.name()),
        }
    }

    fn sense_card(&mut self, bond: BondId, points: [usize; 2]) {
        let sense = self.flows.senses.iter().find(|sense| sense.bond == bond).map(|s| s.device);
        if let Some(device) = sense {
            let nodes = points.map(|point| self.node(point));
            let ends = [self.graph.bond(bond).from.vertex, self.graph.bond(bond).to.vertex];
            let series = ends.into_iter().find(|id| matches!(self.graph.vertex(*id).law, Law::One));
            let what = match series {
                Some(junction) => format!("0 V, carries f({})", self.graph.vertex(junction).name),
                None => format!("0 V, carries f({})", self.graph.bond_name(bond)),
            };
            let span = self.graph.bond(bond).span;
            let value = Element::VoltageSource(Waveform::Constant(Expr::number(0.0)).into());
            self.device(device, nodes, value, span, &what);
        }
    }

    /// e and f of a bond that closes a loop of junctions, carried from its tail to its head.
    fn coupler_cards(&mut self, bond: BondId) {
        let [Some(from), Some(to)] = self.drawing.ends[bond.index()] else { return };
        let (from, to) = (self.nodes(from), self.nodes(to));
        let span = self.graph.bond(bond).span;
        let what = format!("1:1 coupler, closes the loop at {}", self.graph.bond_name(bond));
        let name = format!(
            "{}_{}",
            self.graph.vertex(self.graph.bond(bond).from.vertex).name,
            self.graph.vertex(self.graph.bond(bond).to.vertex).name
        );
        // It stands in the instance around both ends.
        let around = common_part(
            &self.graph.vertex(self.graph.bond(bond).from.vertex).name,
            &self.graph.vertex(self.graph.bond(bond).to.vertex).name,
        );
        let full = format!("{around}{}", name.replace(around, ""));
        let effort = self.namer.device_of('E', &name, full.clone());
        let flow = self.namer.device_of('F', &name, full);
        let one = || Expr::number(1.0);
        self.device(effort, to, Element::Vcvs { gain: one(), control: from }, span, &what);
        // The current of E runs into the head's +, against the half arrow.
        let follow = Element::Cccs { gain: negate(one()), control: effort };
        self.device(flow, from, follow, span, &what);
        self.couplers += 1;
    }

    /// The cards of an element at one of its ports.
    fn port_card(&mut self, end: End) -> Result<(), Unreadable> {
        let (id, port) = (end.vertex, end.port as usize);
        let graph = self.graph;
        let vertex = graph.vertex(id);
        let what = format!("{}:{}", vertex.kind, graph.end_name(end));
        let span = vertex.span;
        let (Some(nodes), Some(bond)) = (self.port(id, port), vertex.bonds.get(port).copied())
        else {
            return Ok(());
        };
        let form = form_at(&self.forms, end).clone();
        let home = self.homes[id.index()];
        let reader = Reader { except: own_device(&form), home };
        let law = |builder: &Self, law| builder.value(law, Some(id), Speaker::Card(reader));
        let from_here = graph.bond(bond).from == end;
        let first = self.cards.len();
        match &form {
            // A field's ports have forms of their own.
            Form::Junction | Form::Open | Form::Field { .. } => {}
            Form::Short { device } => {
                let value = Waveform::Constant(Expr::number(0.0));
                self.device(*device, nodes, Element::VoltageSource(value.into()), span, &what);
            }
            Form::EffortSource { device, value } => {
                let element = match value {
                    SourceValue::Constant(value) => {
                        Element::VoltageSource(Waveform::Constant(self.constant(value)).into())
                    }
                    SourceValue::Waveform(signal) => {
                        Element::VoltageSource(self.waveform(*signal, *device).into())
                    }
                    SourceValue::Copy(signal) => self.copy_of(*signal, true),
                    SourceValue::Law(expr) => Element::BehaviouralVoltage { law: law(self, expr)? },
                };
                self.device(*device, nodes, element, span, &what);
            }
            Form::FlowSource { device, value } => {
                // The source's current runs along the half arrow: out of + when the arrow leaves the element.
                let nodes = if from_here { [nodes[1], nodes[0]] } else { nodes };
                let element = match value {
                    SourceValue::Constant(value) => {
                        Element::CurrentSource(Waveform::Constant(self.constant(value)).into())
                    }
                    SourceValue::Waveform(signal) => {
                        Element::CurrentSource(self.waveform(*signal, *device).into())
                    }
                    SourceValue::Copy(signal) => self.copy_of(*signal, false),
                    SourceValue::Law(expr) => Element::BehaviouralCurrent { law: law(self, expr)? },
                };
                self.device(*device, nodes, element, span, &what);
            }
            Form::Resistor { device, value } => {
                let value = self.constant(value);
                self.device(*device, nodes, Element::Resistor { value }, span, &what);
            }
            Form::EffortLaw { device, law: expr } => {
                let law = law(self, expr)?;
                self.device(*device, nodes, Element::BehaviouralVoltage { law }, span, &what);
            }
            Form::FlowLaw { device, law: expr } => {
                let law = law(self, expr)?;
                self.device(*device, nodes, Element::BehaviouralCurrent { law }, span, &what);
            }
            Form::Capacitor { device, value } => {
                let value = self.constant(value);
                let initial = Some(self.initial_power(end));
                self.device(*device, nodes, Element::Capacitor { value, initial }, span, &what);
            }
            Form::Inductor { device, value } => {
                let value = self.constant(value);
                let initial = Some(self.initial_power(end));
                self.device(*device, nodes, Element::Inductor { value, initial }, span, &what);
            }
            Form::StoredEffort { device, state, law: expr } => {
                let law = law(self, expr)?;
                self.device(*device, nodes, Element::BehaviouralVoltage { law }, span, &what);
                let feed = self.current(Carrier { device: *device, negated: false });
                let initial = self.initial_stored(end);
                self.integrator(*state, feed, initial, span, &what);
            }
            Form::StoredFlow { device, state, law: expr } => {
                let law = law(self, expr)?;
                self.device(*device, nodes, Element::BehaviouralCurrent { law }, span, &what);
                self.integrator(*state, self.voltage(nodes), self.initial_stored(end), span, &what);
            }
            Form::ChargeLaw { device, state, law: expr } => {
                let law = law(self, expr)?;
                self.held_integral(*state, law, self.initial_stored(end), span, &what);
                // The integral's source gives the capacitor its current, dq/dt, out of its own +.
                let gain = Expr::number(-1.0);
                let follow = Element::Cccs { gain, control: state.feed };
                self.device(*device, nodes, follow, span, &what);
            }
            Form::FluxLaw { device, state, law: expr } => {
                let law = law(self, expr)?;
                self.held_integral(*state, law, self.initial_stored(end), span, &what);
                let gain = Expr::number(-1.0);
                let follow = Element::Ccvs { gain, control: state.feed };
                self.device(*device, nodes, follow, span, &what);
            }
            Form::RateEffort { device, state, rate } => {
                let control = [state.node, self.ground()];
                let gain = Expr::number(1.0);
                self.device(*device, nodes, Element::Vcvs { gain, control }, span, &what);
                let rate = law(self, rate)?;
                self.integrator(*state, rate, self.initial_power(end), span, &what);
                if let Some(counter) = self.counters[id.index()] {
                    let flow = self.current(Carrier { device: *device, negated: false });
                    self.integrator(counter, flow, self.initial_stored(end), span, &what);
                }
            }
            Form::RateFlow { device, state, rate } => {
                let control = [state.node, self.ground()];
                let gain = Expr::number(1.0);
                self.device(*device, nodes, Element::Vccs { gain, control }, span, &what);
                let rate = law(self, rate)?;
                self.integrator(*state, rate, self.initial_power(end), span, &what);
                if let Some(counter) = self.counters[id.index()] {
                    let effort = self.voltage(nodes);
                    self.integrator(counter, effort, self.initial_stored(end), span, &what);
                }
            }
            Form::Transformer { lead, effort, flow, modulus, modulated } => {
                let Some(other) = self.port(id, 1 - port) else { return Ok(()) };
                let modulus = law(self, modulus)?;
                let what = format!("{what}.{}", port + 1);
                let (device, nodes, element) = if port == *lead {
                    let element = if *modulated {
                        let law = tidy(product(modulus, self.voltage(other)));
                        Element::BehaviouralVoltage { law }
                    } else {
                        Element::Vcvs { gain: modulus, control: other }
                    };
                    (*effort, nodes, element)
                } else {
                    // What flows into the leading port's + flows out of this one's, m times.
                    let current = self.current(Carrier { device: *effort, negated: false });
                    let element = if *modulated {
                        Element::BehaviouralCurrent { law: tidy(product(modulus, current)) }
                    } else {
                        Element::Cccs { gain: modulus, control: *effort }
                    };
                    (*flow, [nodes[1], nodes[0]], element)
                };
                self.device(device, nodes, element, span, &what);
            }
            Form::GyratorEfforts { devices, modulus, modulated } => {
                // e1 = r·f2 with f2 out of port 2, e2 = r·f1 with f1 into port 1.
                let Some(far) = vertex.bonds.get(1 - port).copied() else { return Ok(()) };
                let reader = Reader { except: modulated.then_some(devices[port]), home };
                let speaker = Speaker::Card(reader);
                let modulus = self.value(modulus, Some(id), speaker)?;
                let outward = graph.sign_into(far, id, 1 - end.port) < 0.0;
                let what = format!("{what}.{}", port + 1);
                let element = if *modulated {
                    let flow = self.inflow(id, 1 - end.port, far, speaker);
                    let flow = flow.unwrap_or_else(|| Expr::number(f64::NAN));
                    let law = tidy(signed(product(modulus, flow), port == 0));
                    Element::BehaviouralVoltage { law }
                } else {
                    let Some(carrier) = self.flows.carrier(far, reader) else { return Ok(()) };
                    let negative = carrier.negated ^ outward ^ (port == 0);
                    let gain = if negative { negate(modulus) } else { modulus };
                    Element::Ccvs { gain, control: carrier.device }
                };
                self.device(devices[port], nodes, element, span, &what);
            }
            Form::GyratorFlows { devices, modulus, modulated } => {
                // f1 = g·e2 into port 1, f2 = g·e1 out of port 2.
                let Some(other) = self.port(id, 1 - port) else { return Ok(()) };
                let modulus = law(self, modulus)?;
                let nodes = if port == 1 { [nodes[1], nodes[0]] } else { nodes };
                let what = format!("{what}.{}", port + 1);
                let element = if *modulated {
                    let law = tidy(product(modulus, self.voltage(other)));
                    Element::BehaviouralCurrent { law }
                } else {
                    Element::Vccs { gain: modulus, control: other }
                };
                self.device(devices[port], nodes, element, span, &what);
            }
        }
        for card in first..self.cards.len() {
            self.links.push(Link { card, element: what.clone(), bond });
        }
        Ok(())
    }

    /// Adds the cards of fields that belong to no single port.
    pub(super) fn coupling_cards(&mut self) {
        for id in self.graph.vertex_ids() {
            let Form::Field { couplings, .. } = &self.forms[id.index()] else { continue };
            let couplings = couplings.clone();
            let vertex = self.graph.vertex(id);
            self.mark(Mark { home: self.homes[id.index()], order: (0, id.0, u32::MAX) });
            if !couplings.is_empty() {
                self.comment(format!(" {}", vertex.name));
            }
            for Coupling { device, inductors, ports: [first, second], value } in couplings {
                let what = format!(
                    "{}:{name}.{} and {name}.{}",
                    vertex.kind,
                    first + 1,
                    second + 1,
                    name = vertex.name
                );
                let element = Element::Mutual {
                    inductors: inductors.to_vec(),
                    coupling: self.constant(&value),
                };
                self.device_on(device, vec![], element, vertex.span, &what);
            }
        }
    }

    /// A node whose voltage is the integral of `rate`, from `initial`.
    pub(super) fn integrator(
        &mut self,
        state: Integrator,
        rate: Expr,
        initial: Expr,
        span: crate::source::Span,
        what: &str,
    ) {
        let nodes = [self.ground(), state.node];
        let element =
            linked(&rate, self.ground(), true).unwrap_or(Element::BehaviouralCurrent { law: rate });
        self.device(state.feed, nodes, element, span, what);
        self.farad(state, initial, span, what);
    }

    /// A node held at `law`, with 1 F whose current is the law's rate.
    fn held_integral(
        &mut self,
        state: Integrator,
        law: Expr,
        initial: Expr,
        span: crate::source::Span,
        what: &str,
    ) {
        let nodes = [state.node, self.ground()];
        self.device(state.feed, nodes, Element::BehaviouralVoltage { law }, span, what);
        self.farad(state, initial, span, what);
    }

    fn farad(&mut self, state: Integrator, initial: Expr, span: crate::source::Span, what: &str) {
        let nodes = [state.node, self.ground()];
        let initial = Some(initial);
        let value = Expr::number(1.0);
        self.device(state.capacitor, nodes, Element::Capacitor { value, initial }, span, what);
    }

    fn copy_of(&self, signal: crate::bond::graph::SignalId, effort: bool) -> Element {
        let gain = Expr::number(1.0);
        let control = match self.signal_places[signal.index()] {
            super::signals::Place::Node(node) => [node, self.ground()],
            super::signals::Place::Source(vertex) => {
                self.port(vertex, 0).unwrap_or([self.ground(); 2])
            }
        };
        if effort { Element::Vcvs { gain, control } } else { Element::Vccs { gain, control } }
    }

    /// The power variable that a storage starts with, as it was stated where that is what it starts with.
    fn initial_power(&self, end: End) -> Expr {
        let value = self.initial.storage(end).map_or(0.0, |s| s.power);
        let stated = match self.graph.law_at(end) {
            Law::Store { initial: StoreInitial::Power(stated), .. }
            | Law::Rate { initial: Initial::Given(stated), .. } => Some(stated.clone()),
            Law::Store {
                initial: StoreInitial::Stored(stated),
                law: StoreLaw::Linear(size),
                ..
            } => Some(stated.clone().binary(Binary::Divide, size.clone())),
            _ => None,
        };
        self.stated(stated.as_ref(), value)
    }

    /// q or p that a storage starts with.
    fn initial_stored(&self, end: End) -> Expr {
        let value = self.initial.storage(end).map_or(0.0, |s| s.stored);
        let stated = match self.graph.law_at(end) {
            Law::Store { initial: StoreInitial::Stored(stated), .. } => Some(stated),
            _ => None,
        };
        self.stated(stated, value)
    }

    /// The expression when it holds parameters and has this value, else the value.
    pub(super) fn stated(&self, expr: Option<&graph::Expr>, value: f64) -> Expr {
        let symbolic = expr.filter(|expr| {
            let mut parameters = 0;
            expr.leaves(&mut |_, _| parameters += 1);
            let stated = constant_value(self.graph, expr).unwrap_or(f64::NAN);
            parameters > 0 && (stated - value).abs() <= 1e-12 * value.abs()
        });
        symbolic.map_or_else(|| Expr::number(value), |expr| self.constant(expr))
    }
}

/// A linear source for ± one voltage or ± one current of a voltage source; `None` for anything else.
pub fn linked(expr: &Expr, ground: Name, current: bool) -> Option<Element> {
    let (leaf, gain) = match &*expr.node {
        Node::Leaf(leaf) => (leaf, 1.0),
        Node::Unary(crate::expr::Unary::Negate, inner) => match &*inner.node {
            Node::Leaf(leaf) => (leaf, -1.0),
            _ => return None,
        },
        _ => return None,
    };
    let gain = Expr::number(gain);
    Some(match (leaf, current) {
        (netlist::Leaf::Voltage(plus, minus), true) => {
            Element::Vccs { gain, control: [*plus, minus.unwrap_or(ground)] }
        }
        (netlist::Leaf::Voltage(plus, minus), false) => {
            Element::Vcvs { gain, control: [*plus, minus.unwrap_or(ground)] }
        }
        (netlist::Leaf::Current(device), true) => Element::Cccs { gain, control: *device },
        (netlist::Leaf::Current(device), false) => Element::Ccvs { gain, control: *device },
        _ => return None,
    })
}
