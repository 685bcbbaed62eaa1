//! Gives every node and branch its unknown, and lets devices write their terms in terms of nodes and devices.

use super::devices::{self, Branch, Needs};
use super::slots::{Index, Slots, readings};
use super::stamps::{
    Charge, DeviceLabel, Law, LawStamp, Leaf, Mode, SourceStamp, Stamps, Terms, Unknown, UnknownId,
    watched_name,
};
use super::{Circuit, Device, DeviceId, Expr, NodeId, Part, Parts, Probe, Waveform, called};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Function, slope::slope};
use smallvec::smallvec;
use std::sync::Arc;

/// A circuit on its way to its stamps.
pub struct Stamper<'a> {
    /// The circuit.
    pub circuit: &'a Circuit,
    /// What there is so far.
    pub stamps: Stamps,
    diagnostics: &'a mut Vec<Diagnostic>,
    slots: Vec<Slots>,
}

/// The current of a device in terms of the unknowns.
#[derive(Clone, Debug)]
pub enum Current {
    /// A sum of unknowns with factors.
    Linear(Terms),
    /// Anything else.
    Law(Law),
}

impl Current {
    /// No current at all.
    pub fn nothing() -> Current {
        Current::Linear(Terms::new())
    }

    /// As a law.
    pub fn law(&self) -> Law {
        match self {
            Current::Law(law) => law.clone(),
            Current::Linear(terms) => terms
                .iter()
                .map(|(unknown, factor)| {
                    let unknown = Law::leaf(Leaf::Unknown(*unknown));
                    if *factor == 1.0 {
                        unknown
                    } else {
                        Law::number(*factor).binary(Binary::Multiply, unknown)
                    }
                })
                .reduce(|sum, term| sum.binary(Binary::Add, term))
                .unwrap_or(Law::number(0.0)),
        }
    }

    /// gain times it.
    pub fn scaled(&self, gain: f64) -> Current {
        match self {
            Current::Linear(terms) => Current::Linear(
                terms.iter().map(|(unknown, factor)| (*unknown, gain * factor)).collect(),
            ),
            Current::Law(law) => {
                Current::Law(Law::number(gain).binary(Binary::Multiply, law.clone()))
            }
        }
    }
}

impl<'a> Stamper<'a> {
    /// Numbers the unknowns: nodes, internal nodes, then branches in device order; and charges and modes.
    pub fn new(circuit: &'a Circuit, diagnostics: &'a mut Vec<Diagnostic>) -> Stamper<'a> {
        let mut stamps = Stamps {
            unknowns: Vec::with_capacity(circuit.nodes.len() + 16),
            conductances: Vec::with_capacity(2 * circuit.devices.len()),
            ..Stamps::default()
        };
        for node in circuit.nodes.iter().skip(1) {
            let name = called('v', &node.name).into();
            stamps.unknowns.push(Unknown {
                name,
                voltage: true,
                nominal: node.nominal,
                device: None,
                span: node.span,
            });
        }
        let label = |device: &Device| DeviceLabel { name: device.name.clone(), span: device.span };
        stamps.devices = Arc::new(circuit.devices.iter().map(label).collect());
        let (read, observed) = readings(circuit);
        let needs = |device: &Device| (devices::row(&device.kind).needs)(&device.kind);
        let needs: Vec<Needs> = circuit.devices.iter().map(needs).collect();
        let mut slots = vec![Slots::NONE; circuit.devices.len()];
        for (id, device) in circuit.ids() {
            let needs = needs[id.0 as usize];
            let slot = &mut slots[id.0 as usize];
            if needs.internal {
                let at = device.nodes.first().and_then(|n| circuit.nodes.get(n.0 as usize));
                slot.internal = Index(stamps.unknowns.len() as u32);
                stamps.unknowns.push(Unknown {
                    name: format!("v({}#internal)", device.name.to_lowercase()).into(),
                    voltage: true,
                    nominal: at.and_then(|node| node.nominal),
                    device: Some(id),
                    span: device.span,
                });
            }
            if needs.charge {
                slot.charge = Index(stamps.charges.len() as u32);
                stamps.charges.push(Charge {
                    device: id,
                    linear: Terms::new(),
                    law: None,
                    into: Terms::new(),
                    initial: None,
                    pinned: false,
                });
            }
            if needs.mode {
                slot.mode = Index(stamps.modes.len() as u32);
                let control = Law::number(0.0);
                stamps.modes.push(Mode {
                    device: id,
                    control,
                    on: 0.0,
                    off: 0.0,
                    initial: None,
                    course: None,
                });
            }
        }
        stamps.nodes = stamps.unknowns.len();
        for (k, needs) in needs.iter().enumerate() {
            let (id, device) = (DeviceId(k as u32), &circuit.devices[k]);
            let branch = match needs.branch {
                Branch::Always => true,
                Branch::Never => false,
                Branch::WhenRead => read[k],
                Branch::WhenObserved => read[k] || observed[k],
            };
            if branch {
                slots[k].branch = Index(stamps.unknowns.len() as u32);
                let (nominal, span) = (device.nominal, device.span);
                stamps.unknowns.push(Unknown {
                    name: device.current_name().into(),
                    voltage: false,
                    nominal,
                    device: Some(id),
                    span,
                });
            }
        }
        for (k, _) in needs.iter().enumerate().filter(|(_, needs)| needs.second) {
            let (id, device) = (DeviceId(k as u32), &circuit.devices[k]);
            {
                slots[k].second = Index(stamps.unknowns.len() as u32);
                stamps.unknowns.push(Unknown {
                    name: format!("i({}#2)", device.name.to_lowercase()).into(),
                    voltage: false,
                    nominal: device.nominal,
                    device: Some(id),
                    span: device.span,
                });
            }
        }
        for (k, needs) in needs.iter().enumerate().filter(|(_, needs)| needs.hidden > 0) {
            let (id, device) = (DeviceId(k as u32), &circuit.devices[k]);
            for slot in slots[k].hidden.iter_mut().take(needs.hidden.into()) {
                *slot = Index(stamps.unknowns.len() as u32);
                stamps.unknowns.push(Unknown {
                    name: format!("u({})", device.name.to_lowercase()).into(),
                    // Like an internal node: no column of its own.
                    voltage: true,
                    nominal: None,
                    device: Some(id),
                    span: device.span,
                });
            }
        }
        Stamper { circuit, stamps, diagnostics, slots }
    }

    /// Adds outputs and initial values, and hands over.
    pub fn finish(mut self) -> Stamps {
        self.stamps.outputs = if self.circuit.outputs.is_empty() {
            let own =
                |unknown: &&(usize, &Unknown)| !(unknown.1.voltage && unknown.1.device.is_some());
            let unknowns = self.stamps.unknowns.iter().enumerate().collect::<Vec<_>>();
            unknowns
                .iter()
                .filter(own)
                .map(|(k, unknown)| {
                    (unknown.name.clone(), Law::leaf(Leaf::Unknown(UnknownId(*k as u32))))
                })
                .collect()
        } else {
            self.circuit
                .outputs
                .iter()
                .map(|output| (output.name.as_str().into(), self.law(&output.expr)))
                .collect()
        };
        let watched = self.circuit.watched.iter().enumerate();
        let watched: Vec<_> =
            watched.map(|(k, expr)| (watched_name(k).into(), self.law(expr))).collect();
        self.stamps.watched = watched.len();
        self.stamps.outputs.extend(watched);
        let of_nodes = |values: &[(NodeId, f64)]| {
            let unknown = |(node, value): &(NodeId, f64)| Some((self.node(*node)?, *value));
            values.iter().filter_map(unknown).collect()
        };
        let starts = of_nodes(&self.circuit.starts);
        (self.stamps.initial, self.stamps.guesses) =
            (of_nodes(&self.circuit.initial), of_nodes(&self.circuit.guesses));
        self.stamps.starts = starts;
        self.stamps.initial_holds = self.circuit.initial_holds;
        self.stamps.spoken = self.circuit.spoken.clone();
        self.stamps
    }

    /// Reports what is wrong with a device.
    pub fn error(&mut self, code: &'static str, id: DeviceId, message: impl Into<String>) {
        let span = self.device(id).span;
        self.diagnostics.push(Diagnostic::error(code, span, message));
    }

    /// Reports an error.
    pub fn report(&mut self, error: Diagnostic) {
        self.diagnostics.push(error);
    }

    /// Reports a value that is not finite; says whether all are.
    pub fn finite(&mut self, id: DeviceId, values: &[(&str, f64)]) -> bool {
        let bad = values.iter().find(|(_, value)| !value.is_finite());
        if let Some((what, value)) = bad {
            let message = format!("the {what} of `{}` is {value}", self.device(id).name);
            self.error("E0750", id, message);
        }
        bad.is_none()
    }

    /// The device of an index.
    pub fn device(&self, id: DeviceId) -> &'a Device {
        &self.circuit.devices[id.0 as usize]
    }

    /// The unknown of a node; `None` for ground.
    pub fn node(&self, node: NodeId) -> Option<UnknownId> {
        node.0.checked_sub(1).map(UnknownId)
    }

    /// The unknowns of a device's first two nodes.
    pub fn ends(&self, id: DeviceId) -> [Option<UnknownId>; 2] {
        let nodes = &self.device(id).nodes;
        [0, 1].map(|k| nodes.get(k).and_then(|node| self.node(*node)))
    }

    /// The unknowns of the nodes of a device's two ports.
    pub fn four_ends(&self, id: DeviceId) -> [Option<UnknownId>; 4] {
        let nodes = &self.device(id).nodes;
        [0, 1, 2, 3].map(|k| nodes.get(k).and_then(|node| self.node(*node)))
    }

    /// The second branch current of a device that has one.
    pub fn second(&self, id: DeviceId) -> Option<UnknownId> {
        self.slots[id.0 as usize].second.unknown()
    }

    /// A hidden unknown of a device that has as many.
    pub fn hidden(&self, id: DeviceId, k: usize) -> Option<UnknownId> {
        self.slots[id.0 as usize].hidden.get(k).and_then(|index| index.unknown())
    }

    /// The branch current of a device that has one.
    pub fn branch(&self, id: DeviceId) -> Option<UnknownId> {
        self.slots[id.0 as usize].branch.unknown()
    }

    /// The internal node of a device that has one.
    pub fn internal(&self, id: DeviceId) -> Option<UnknownId> {
        self.slots[id.0 as usize].internal.unknown()
    }

    /// The charge or flux of a device that has one.
    pub fn charge(&self, id: DeviceId) -> Option<u32> {
        self.slots[id.0 as usize].charge.get()
    }

    /// The mode of a device that has one.
    pub fn mode(&self, id: DeviceId) -> Option<u32> {
        self.slots[id.0 as usize].mode.get()
    }

    /// The charge or flux of a device, to write to.
    pub fn charge_mut(&mut self, id: DeviceId) -> Option<&mut Charge> {
        let index = self.charge(id)?;
        self.stamps.charges.get_mut(index as usize)
    }

    /// Adds to G at (row, column); ground has neither.
    pub fn conductance(&mut self, row: Option<UnknownId>, column: Option<UnknownId>, value: f64) {
        if let (Some(row), Some(column)) = (row, column) {
            self.stamps.conductances.push((row, column, value));
        }
    }

    /// Adds factor·(v(a) − v(b)) to an equation.
    pub fn difference(
        &mut self,
        row: Option<UnknownId>,
        across: [Option<UnknownId>; 2],
        factor: f64,
    ) {
        self.conductance(row, across[0], factor);
        self.conductance(row, across[1], -factor);
    }

    /// Lets a branch current run through its device: it leaves the first node and enters the second.
    pub fn through(&mut self, id: DeviceId, branch: UnknownId) {
        let [a, b] = self.ends(id);
        self.conductance(a, Some(branch), 1.0);
        self.conductance(b, Some(branch), -1.0);
    }

    /// Subtracts a current from the equation of a branch: the branch's own law, moved to the left side.
    pub fn oppose(&mut self, id: DeviceId, row: UnknownId, current: Current) {
        self.add(id, current.scaled(-1.0), smallvec![(row, 1.0)]);
    }

    /// Adds a current with factors to equations.
    pub fn add(&mut self, id: DeviceId, current: Current, into: Terms) {
        match current {
            Current::Linear(terms) => {
                for (row, factor) in into {
                    for (column, value) in &terms {
                        self.conductance(Some(row), Some(*column), factor * value);
                    }
                }
            }
            Current::Law(law) => self.add_law(id, law, into),
        }
    }

    /// Adds a law with factors to equations.
    pub fn add_law(&mut self, device: DeviceId, law: Law, into: Terms) {
        if !into.is_empty() {
            self.stamps.laws.push(LawStamp { device, law, into, junction: None });
        }
    }

    /// Adds an independent source to right-hand sides.
    pub fn add_source(&mut self, device: DeviceId, waveform: &Waveform, parts: Parts, into: Terms) {
        if !into.is_empty() {
            let waveform = waveform.clone();
            self.stamps.sources.push(SourceStamp { device, waveform, parts, into });
        }
    }

    /// The equations of two nodes with the factors +1 and −1: what a current from the first to the second enters.
    pub fn leaving(&self, ends: [Option<UnknownId>; 2]) -> Terms {
        match ends {
            [Some(a), Some(b)] if a == b => Terms::new(),
            [a, b] => a.map(|a| (a, 1.0)).into_iter().chain(b.map(|b| (b, -1.0))).collect(),
        }
    }

    /// The current of a device from its first node to its second: its branch, or what its row says.
    pub fn current(&self, id: DeviceId) -> Current {
        match self.branch(id) {
            Some(branch) => Current::Linear(smallvec![(branch, 1.0)]),
            None => (devices::row(&self.device(id).kind).current)(self, id),
        }
    }

    /// An expression over nodes and devices as a law over unknowns.
    pub fn law(&self, expr: &Expr) -> Law {
        expr.map(&mut |leaf, span| {
            let law = match leaf {
                super::Leaf::Voltage(a, b) => voltage([self.node(*a), self.node(*b)]),
                super::Leaf::Current(id) => self.current(*id).law(),
                super::Leaf::Time => Law::leaf(Leaf::Time),
                super::Leaf::Capacitance(id) => self.capacitance(*id),
                super::Leaf::Part(part, probe) => part_of_real(*part, self.probe(*probe)),
            };
            Law { span, ..law }
        })
    }

    /// dq/dv of the charge of a device with a junction; 0 where it stores none.
    fn capacitance(&self, id: DeviceId) -> Law {
        let stored = self.charge(id).and_then(|charge| self.stamps.charges.get(charge as usize));
        let Some(law) = stored.and_then(|charge| charge.law.as_ref()) else {
            return Law::number(0.0);
        };
        let [anode, cathode] = self.ends(id);
        // The law is of v(a) − v(b): of either end the slope is the same but for its sign.
        let (by, sign) = match (self.internal(id).or(anode), cathode) {
            (Some(plus), _) => (plus, 1.0),
            (None, Some(minus)) => (minus, -1.0),
            (None, None) => return Law::number(f64::NAN),
        };
        slope(law, &mut |leaf| if *leaf == Leaf::Unknown(by) { sign } else { 0.0 })
    }

    /// A voltage or current as a law over unknowns.
    fn probe(&self, probe: Probe) -> Law {
        match probe {
            Probe::Voltage(a, b) => voltage([self.node(a), self.node(b)]),
            Probe::Current(id) => self.current(id).law(),
        }
    }

    /// The value that `.ic` gives the voltage across two nodes, when it speaks of either.
    pub fn initial_voltage(&self, nodes: &[NodeId]) -> Option<f64> {
        // The last card wins.
        let value = |k: usize| {
            let node = nodes.get(k)?;
            self.circuit
                .initial
                .iter()
                .rev()
                .find(|(named, _)| named == node)
                .map(|(_, value)| *value)
        };
        match (value(0), value(1)) {
            (None, None) => None,
            (a, b) => Some(a.unwrap_or(0.0) - b.unwrap_or(0.0)),
        }
    }
}

/// A part of a number that is real: its phase is 0, or π where it is negative.
fn part_of_real(part: Part, law: Law) -> Law {
    let negative = |law: Law, turned: f64| {
        let condition = law.binary(Binary::Less, Law::number(0.0));
        Law::choice(condition, Law::number(turned), Law::number(0.0))
    };
    match part {
        Part::Real => law,
        Part::Imaginary => Law::number(0.0),
        Part::Magnitude => Law::call(Function::Abs, vec![law]),
        Part::Phase => negative(law, std::f64::consts::PI),
        Part::Degrees => negative(law, 180.0),
        Part::Decibel => {
            let logarithm = Law::call(Function::Log10, vec![Law::call(Function::Abs, vec![law])]);
            Law::number(20.0).binary(Binary::Multiply, logarithm)
        }
    }
}

/// v(a) − v(b) as a law.
pub fn voltage(across: [Option<UnknownId>; 2]) -> Law {
    let unknown = |id| Law::leaf(Leaf::Unknown(id));
    match across {
        [a, b] if a == b => Law::number(0.0),
        [Some(a), None] => unknown(a),
        [None, Some(b)] => unknown(b).negate(),
        [Some(a), Some(b)] => unknown(a).binary(Binary::Subtract, unknown(b)),
        [None, None] => Law::number(0.0),
    }
}
