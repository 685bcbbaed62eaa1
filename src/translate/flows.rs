//! Where each flow can be read: classes of equal flows, the devices that carry them, and the 0 V sources that must be
//! added because a law, a linked source or a column needs a flow that nothing carries.

use super::forest::Forest;
use super::forms::{Form, SourceValue, constant_value, form_at, is_constant};
use super::islands::is_junction;
use super::names::Namer;
use crate::bond::graph::{BondGraph, BondId, End, Expr, Law, Leaf, Power, Variable, VertexId};
use crate::netlist::Name;

/// A device whose current is a flow, or its negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    /// A voltage source (V, or E).
    pub device: Name,
    /// Whether the flow is the negative of its current.
    pub negated: bool,
}

/// Who asks for a carrier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reader {
    /// The device whose law it is, which cannot name its own current.
    pub except: Option<Name>,
    /// The instance that its card stands in, an index into [`BondGraph::tree`].
    pub home: u32,
}

/// How a flow is known without a source that carries it. Signs are the reader's business.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// The current of a voltage source.
    Carrier(Carrier),
    /// The current of a linear inertia's inductor.
    Inductor(End),
    /// Effort over resistance of a linear dissipator.
    Ohm(VertexId),
    /// An element's law gives its flow at this port.
    Law(End),
    /// A two-port's law gives the flow of this port.
    Port(VertexId, usize),
    /// A detector of effort: 0.
    Nothing,
    /// The flows of a 0-junction add up to zero; of this bond all others are known.
    Balance(VertexId, BondId),
    /// The current of a capacitor or current source: our simulator knows it, others do not save it by that name.
    Current(End),
}

/// A 0 V source in a bond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sense {
    /// The bond; its current is the bond's flow.
    pub bond: BondId,
    /// The source.
    pub device: Name,
}

/// A carrier, how well it reads (lower is better), and the instance that it stands in.
#[derive(Clone, Copy)]
struct Candidate {
    rank: u32,
    carrier: Carrier,
    home: u32,
}

/// The flows of a graph.
pub struct Flows {
    /// Bonds of equal flow, up to sign.
    classes: Forest,
    /// By the head of a class, best first: how its flow counts against the head's, and the device.
    carriers: Vec<Vec<Candidate>>,
    /// By bond: the instances that its ends stand in.
    homes: Vec<[u32; 2]>,
    /// By the head of a class: a linear dissipator of that flow, and its bond.
    ohms: Vec<Option<(VertexId, BondId)>>,
    /// By the head of a class: the best way to know its flow, and the bond that this way speaks of.
    pub origins: Vec<Option<(BondId, Origin)>>,
    /// The sources that had to be added.
    pub senses: Vec<Sense>,
}

impl Flows {
    /// Finds the flows that are carried, and adds sources for those that something needs and nothing carries.
    pub fn plan(graph: &BondGraph, forms: &[Form], namer: &mut Namer) -> Flows {
        let homes = graph.homes();
        let home = |vertex: VertexId| homes.of(&graph.vertex(vertex).name);
        let mut flows = Flows {
            homes: graph.bonds.iter().map(|b| [b.from, b.to].map(|end| home(end.vertex))).collect(),
            classes: classes(graph),
            carriers: vec![Vec::new(); graph.bonds.len()],
            ohms: vec![None; graph.bonds.len()],
            origins: vec![None; graph.bonds.len()],
            senses: Vec::new(),
        };
        for bond in graph.bond_ids() {
            if let Some(vertex) = resistor_of(graph, bond) {
                flows.ohms[flows.classes.root(bond.index())].get_or_insert((vertex, bond));
            }
        }
        for (index, form) in forms.iter().enumerate() {
            let vertex = VertexId(index as u32);
            for (port, rank, device, negated) in carriers(form) {
                if let Some(bond) = graph.vertex(vertex).bonds.get(port) {
                    let outward = graph.sign_into(*bond, vertex, port as u32) < 0.0;
                    let carrier = Carrier { device, negated: negated ^ outward };
                    flows.add_carrier(*bond, Candidate { rank, carrier, home: home(vertex) });
                }
            }
        }
        for need in needs(graph, forms) {
            let reader = Reader { except: need.except, home: 0 };
            let met = flows.carrier(need.bond, reader).is_some()
                || (!need.hard && flows.ohm(need.bond).is_some());
            if !met {
                flows.add_sense(graph, need.bond, namer);
            }
        }
        flows.find_origins(graph, forms);
        let mut observed = Vec::new();
        for observation in &graph.experiment.observe {
            needs_of(graph, forms, &observation.expr, None, &mut |bond| observed.push(bond));
        }
        for bond in observed {
            if matches!(flows.origin(bond), None | Some((_, Origin::Current(_), _))) {
                flows.add_sense(graph, bond, namer);
                flows.find_origins(graph, forms);
            }
        }
        flows
    }

    /// The best voltage source that carries a bond's flow: one that stands where it is asked for, else where the bond
    /// does, so that parts of the circuit need not look into each other.
    pub fn carrier(&self, bond: BondId, reader: Reader) -> Option<Carrier> {
        let (head, flipped) = self.classes.signed(bond.index());
        let others = self.carriers[head].iter().filter(|c| Some(c.carrier.device) != reader.except);
        let near = |c: &&Candidate| {
            (c.home != reader.home, !self.homes[bond.index()].contains(&c.home), c.rank)
        };
        let found = others.min_by_key(near)?;
        // Rather than look into another part, a law takes its own current for its argument.
        let own = (found.home != reader.home)
            .then(|| self.carriers[head].iter().find(|c| Some(c.carrier.device) == reader.except));
        let found = own.flatten().unwrap_or(found).carrier;
        Some(Carrier { device: found.device, negated: found.negated ^ flipped })
    }

    /// A linear dissipator of the same flow, its bond, and whether that bond's flow is the negative.
    pub fn ohm(&self, bond: BondId) -> Option<(VertexId, BondId, bool)> {
        let (head, flipped) = self.classes.signed(bond.index());
        let (vertex, of) = self.ohms[head]?;
        Some((vertex, of, flipped ^ self.classes.signed(of.index()).1))
    }

    /// How a bond's flow is known: the bond that the origin speaks of, the origin, whether the flow is the negative.
    pub fn origin(&self, bond: BondId) -> Option<(BondId, Origin, bool)> {
        let (head, flipped) = self.classes.signed(bond.index());
        let (of, origin) = self.origins[head]?;
        Some((of, origin, flipped ^ self.classes.signed(of.index()).1))
    }

    fn add_carrier(&mut self, bond: BondId, candidate: Candidate) {
        let (head, flipped) = self.classes.signed(bond.index());
        let Carrier { device, negated } = candidate.carrier;
        let carrier = Carrier { device, negated: negated ^ flipped };
        self.carriers[head].push(Candidate { carrier, ..candidate });
    }

    fn add_sense(&mut self, graph: &BondGraph, bond: BondId, namer: &mut Namer) {
        let ends = [graph.bond(bond).from.vertex, graph.bond(bond).to.vertex];
        let series = ends.into_iter().find(|v| matches!(graph.vertex(*v).law, Law::One));
        let element = ends.into_iter().find(|v| !is_junction(graph, *v));
        let named = series.or(element).unwrap_or(ends[0]);
        let name = &graph.vertex(named).name;
        let full = match name.rsplit_once('.') {
            Some((instance, own)) => format!("{instance}.sense_{own}"),
            None => format!("sense_{name}"),
        };
        let device = namer.device_of('V', &format!("sense_{name}"), full);
        self.senses.push(Sense { bond, device });
        let home = self.homes[bond.index()][usize::from(named != ends[0])];
        let carrier = Carrier { device, negated: false };
        self.add_carrier(bond, Candidate { rank: 0, carrier, home });
    }

    /// Fills `origins`: what elements tell first, then what follows from it.
    fn find_origins(&mut self, graph: &BondGraph, forms: &[Form]) {
        self.origins = vec![None; graph.bonds.len()];
        for bond in graph.bond_ids() {
            let own = Reader { except: None, home: self.homes[bond.index()][0] };
            if let Some(carrier) = self.carrier(bond, own) {
                self.learn(bond, Origin::Carrier(carrier));
            }
        }
        type Tell = fn(&Form, End) -> Option<Origin>;
        let told_by_elements: [Tell; 2] = [
            |form, end| match form {
                Form::Inductor { .. } => Some(Origin::Inductor(end)),
                Form::Open => Some(Origin::Nothing),
                _ => None,
            },
            |form, end| match form {
                Form::Resistor { .. } => Some(Origin::Ohm(end.vertex)),
                Form::FlowSource {
                    value: SourceValue::Constant(_) | SourceValue::Copy(_), ..
                } => Some(Origin::Law(end)),
                _ => None,
            },
        ];
        for tell in told_by_elements {
            for bond in graph.bond_ids() {
                for end in [graph.bond(bond).from, graph.bond(bond).to] {
                    let told = tell(form_at(forms, end), end);
                    match told {
                        Some(Origin::Ohm(_)) if resistor_of(graph, bond).is_none() => {}
                        Some(origin) => self.learn(bond, origin),
                        None => {}
                    }
                }
            }
        }
        while self.follow_laws(graph, forms) || self.follow_balances(graph) {}
        for bond in graph.bond_ids() {
            for end in [graph.bond(bond).from, graph.bond(bond).to] {
                if let Form::Capacitor { .. } | Form::FlowSource { .. } = form_at(forms, end) {
                    self.learn(bond, Origin::Current(end));
                }
            }
        }
        while self.follow_laws(graph, forms) || self.follow_balances(graph) {}
    }

    fn learn(&mut self, bond: BondId, origin: Origin) {
        let head = self.classes.root(bond.index());
        self.origins[head].get_or_insert((bond, origin));
    }

    fn known(&self, bond: BondId) -> bool {
        self.origins[self.classes.root(bond.index())].is_some()
    }

    /// Learns flows from laws whose own arguments are known; says whether it learnt any.
    fn follow_laws(&mut self, graph: &BondGraph, forms: &[Form]) -> bool {
        let mut learnt = false;
        for bond in graph.bond_ids() {
            for end in [graph.bond(bond).from, graph.bond(bond).to] {
                if self.known(bond) {
                    continue;
                }
                let (vertex, port) = (end.vertex, end.port as usize);
                let form = form_at(forms, end);
                let (law, origin, also) = match form {
                    Form::FlowSource { value: SourceValue::Law(law), .. }
                    | Form::FlowLaw { law, .. }
                    | Form::StoredFlow { law, .. } => (Some(law), Origin::Law(end), None),
                    Form::RateFlow { .. } => (None, Origin::Law(end), None),
                    Form::Transformer { modulus, .. } => {
                        (Some(modulus), Origin::Port(vertex, port), Some(1 - port))
                    }
                    Form::GyratorFlows { modulus, .. } => {
                        (Some(modulus), Origin::Port(vertex, port), None)
                    }
                    _ => continue,
                };
                let mut ready = also.is_none_or(|port| {
                    graph.vertex(vertex).bonds.get(port).is_some_and(|bond| self.known(*bond))
                });
                // A transformer's law gives the flow of the port that follows; the other way it would divide.
                if let Form::Transformer { lead, .. } = form {
                    ready &= port != *lead;
                }
                if let Some(law) = law {
                    needs_of(graph, forms, law, Some(vertex), &mut |b| ready &= self.known(b));
                }
                if ready {
                    self.learn(bond, origin);
                    learnt = true;
                }
            }
        }
        learnt
    }

    /// Learns flows from 0-junctions of which all others are known; says whether it learnt any.
    fn follow_balances(&mut self, graph: &BondGraph) -> bool {
        let mut learnt = false;
        for vertex in graph.vertex_ids() {
            let junction = graph.vertex(vertex);
            if !matches!(junction.law, Law::Zero) {
                continue;
            }
            let mut unknown = junction.bonds.iter().filter(|bond| !self.known(**bond));
            if let (Some(bond), None) = (unknown.next().copied(), unknown.next()) {
                self.learn(bond, Origin::Balance(vertex, bond));
                learnt = true;
            }
        }
        learnt
    }
}

/// Flows that 1-junctions and 0-junctions of two bonds make equal.
fn classes(graph: &BondGraph) -> Forest {
    let mut classes = Forest::new(graph.bonds.len());
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        match (&vertex.law, vertex.bonds.as_slice()) {
            (Law::One, [first, rest @ ..]) => {
                for bond in rest {
                    classes.join(first.index(), bond.index());
                }
            }
            (Law::Zero, [a, b]) => {
                let same = graph.sign_into(*a, id, 0) == graph.sign_into(*b, id, 0);
                classes.join_signed(a.index(), b.index(), same);
            }
            _ => {}
        }
    }
    classes
}

/// The ports of a form where a voltage source carries the flow: port, rank (lower reads better), device, whether the
/// flow into the element is the negative of its current.
fn carriers(form: &Form) -> Vec<(usize, u32, Name, bool)> {
    match form {
        Form::EffortSource {
            device,
            value: SourceValue::Constant(_) | SourceValue::Waveform(_),
        }
        | Form::Short { device } => vec![(0, 0, *device, false)],
        Form::EffortSource { device, value: SourceValue::Copy(_) }
        | Form::RateEffort { device, .. } => vec![(0, 1, *device, false)],
        Form::EffortSource { device, value: SourceValue::Law(_) }
        | Form::EffortLaw { device, .. }
        | Form::StoredEffort { device, .. } => vec![(0, 3, *device, false)],
        Form::ChargeLaw { state, .. } => vec![(0, 3, state.feed, true)],
        Form::Transformer { lead, effort, modulated, .. } => {
            vec![(*lead, if *modulated { 2 } else { 1 }, *effort, false)]
        }
        Form::GyratorEfforts { devices, modulated, .. } => {
            let rank = if *modulated { 2 } else { 4 };
            vec![(0, rank, devices[0], false), (1, rank, devices[1], false)]
        }
        Form::Field { ports, .. } => {
            let at = |port: usize, form: &Form| {
                let carried = carriers(form).into_iter();
                carried.map(move |(_, rank, device, negated)| (port, rank, device, negated))
            };
            ports.iter().enumerate().flat_map(|(port, form)| at(port, form)).collect()
        }
        Form::Junction
        | Form::Open
        | Form::FlowSource { .. }
        | Form::Resistor { .. }
        | Form::FlowLaw { .. }
        | Form::Capacitor { .. }
        | Form::Inductor { .. }
        | Form::StoredFlow { .. }
        | Form::FluxLaw { .. }
        | Form::RateFlow { .. }
        | Form::GyratorFlows { .. } => vec![],
    }
}

/// A flow that some card must name.
struct Need {
    bond: BondId,
    /// The device that needs it, which cannot be its own control.
    except: Option<Name>,
    /// Whether it must be the current of a voltage source: a control of F or H.
    hard: bool,
}

/// The device of a form that cannot name its own current: the law would be its own argument.
pub fn own_device(form: &Form) -> Option<Name> {
    match form {
        Form::EffortSource { device, .. }
        | Form::EffortLaw { device, .. }
        | Form::StoredEffort { device, .. } => Some(*device),
        Form::ChargeLaw { state, .. } => Some(state.feed),
        Form::Transformer { effort, .. } => Some(*effort),
        _ => None,
    }
}

fn needs(graph: &BondGraph, forms: &[Form]) -> Vec<Need> {
    let mut needs = Vec::new();
    for (index, form) in forms.iter().enumerate() {
        let id = VertexId(index as u32);
        let vertex = graph.vertex(id);
        if let Form::GyratorEfforts { devices, modulated, .. } = form {
            for port in [1, 0] {
                if let Some(bond) = vertex.bonds.get(port) {
                    let except = modulated.then_some(devices[1 - port]);
                    needs.push(Need { bond: *bond, except, hard: !modulated });
                }
            }
        }
        for end in graph.law_ports(id) {
            let form = form_at(forms, end);
            // Coupled inductors need nobody to tell them each other's currents.
            if let Form::Inductor { .. } = form {
                continue;
            }
            graph.law_at(end).expressions(&mut |expr| {
                needs_of(graph, forms, expr, Some(id), &mut |bond| {
                    needs.push(Need { bond, except: own_device(form), hard: false });
                });
            });
        }
        // A resistance that is modulated multiplies the element's own flow, which its expression does not name.
        if let (Form::EffortLaw { device, law }, Some(bond)) = (form, vertex.bonds.first()) {
            let mut own = false;
            law.leaves(&mut |leaf, _| {
                own |= *leaf == Leaf::Own(Variable::Power(Power::Flow));
            });
            if own {
                needs.push(Need { bond: *bond, except: Some(*device), hard: false });
            }
        }
    }
    for signal in &graph.signals {
        if let Some(expr) = signal.law.expression() {
            needs_of(graph, forms, expr, None, &mut |bond| {
                needs.push(Need { bond, except: None, hard: false });
            });
        }
    }
    needs
}

/// Calls `need` with each bond whose flow an expression speaks of.
fn needs_of(
    graph: &BondGraph,
    forms: &[Form],
    expr: &Expr,
    own: Option<VertexId>,
    need: &mut dyn FnMut(BondId),
) {
    let own = own.map(End::only);
    let mut bonds = Vec::new();
    expr.leaves(&mut |leaf, _| match leaf {
        Leaf::Bond { bond, variable: Power::Flow, .. } => bonds.push(*bond),
        Leaf::Own(Variable::Power(Power::Flow)) => {
            bonds.extend(own.and_then(|end| graph.bond_at(end)));
        }
        Leaf::Own(Variable::Stored) => {
            if let Some(end) = own {
                flux_needs(graph, forms, end, &mut bonds);
            }
        }
        Leaf::Stored(end) => flux_needs(graph, forms, *end, &mut bonds),
        _ => {}
    });
    bonds.into_iter().for_each(need);
}

/// The flows that p of an inductor is made of: its own, and in a field those of the others.
fn flux_needs(graph: &BondGraph, forms: &[Form], end: End, bonds: &mut Vec<BondId>) {
    let Form::Inductor { .. } = form_at(forms, end) else { return };
    match (&graph.vertex(end.vertex).law, graph.law_at(end)) {
        (Law::Field(_), law) => law.expressions(&mut |expr| {
            needs_of(graph, forms, expr, None, &mut |bond| bonds.push(bond));
        }),
        _ => bonds.extend(graph.bond_at(end)),
    }
}

/// The linear dissipator of constant resistance other than 0 at an end of a bond.
fn resistor_of(graph: &BondGraph, bond: BondId) -> Option<VertexId> {
    let bond = graph.bond(bond);
    [bond.from, bond.to].into_iter().find_map(|End { vertex, .. }| {
        match &graph.vertex(vertex).law {
            Law::Dissipator(crate::bond::graph::Dissipation::Linear(value)) => {
                let value = is_constant(value).then(|| constant_value(graph, value)).flatten()?;
                (value != 0.0).then_some(vertex)
            }
            _ => None,
        }
    })
}
