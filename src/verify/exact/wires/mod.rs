//! The circuit's equations over a prime field: node voltages, and the currents of voltage sources, inductors and lines.
//!
//! ```text
//! node     Σ currents out of it = 0
//! R        i = v/R            C     i = C·(s·v − v0)        L, K   v_k = Σ M_kj·(s·i_j − i_j0),  M = k·√(L1·L2)
//! V, E, H  v = …              I, G, F  i = …
//! T        v1 − Z·i1 = θ·(v2 + Z·i2) + (1 − θ)/s·(v2 + Z·i2 at the start), and the same from the other end
//! ```
//!
//! A behavioural card whose text is affine stands as it is; one that is not is cut as the law that it claims to be.

mod cut;

use super::bonds::{Bonds, Place, delay_factor};
use super::draw::{Modular, Of, decimal};
use super::form::{Form, Reading, Trouble};
use super::system::System;
use super::text::{Start, Text, waveform_of};
use super::uncut::Uncut;
use crate::bond::graph::{self, BondGraph, Law, ParameterId, SignalId};
use crate::circuit::{DeviceKind, NodeId};
use crate::netlist::flatten::scope::{self, ScopeId};
use crate::netlist::flatten::values::Lookup;
use crate::netlist::{Element, Expr, Leaf, Name, Waveform};
use std::cell::RefCell;
use std::collections::HashMap;

/// A behavioural card that was cut.
#[derive(Clone, Copy, Debug)]
pub struct CutCard {
    /// The device.
    pub device: usize,
    /// Whose law it is.
    pub place: Place,
    /// Whether its text is the negative of the law, because it stands the other way round.
    pub turned: bool,
}

/// The equations of a text.
pub struct Wires<'t, F> {
    /// The text.
    pub text: &'t Text<'t>,
    pub(super) lookup: Lookup<'t, 't>,
    graph: &'t BondGraph,
    bonds: &'t Bonds<'t, F>,
    /// By the name of a parameter at the top: the graph's.
    parameters: HashMap<(u32, Name), usize>,
    known: RefCell<HashMap<(u32, Name), F>>,
    /// The equations.
    pub system: System<F>,
    /// By device: its current.
    currents: Vec<Form<F>>,
    /// By node: the first that sources of 0 V join it to.
    joined: Vec<u32>,
    /// Cards that were cut.
    pub cuts: Vec<CutCard>,
    /// Devices that cannot be read, and why.
    pub strange: Vec<(usize, String)>,
}

impl<'t, F: Modular> Wires<'t, F> {
    /// The equations of a text in the draw of a graph.
    ///
    /// # Errors
    /// What has no value in it.
    pub fn new(text: &'t Text<'t>, bonds: &'t Bonds<'t, F>) -> Result<Self, Trouble> {
        let parameters = text.parameters.iter().enumerate();
        let mut wires = Wires {
            text,
            lookup: Lookup::new(&text.flat, &text.names),
            graph: bonds.graph,
            bonds,
            parameters: parameters
                .filter_map(|(k, place)| place.map(|(scope, name)| ((scope.0, name), k)))
                .collect(),
            known: RefCell::new(HashMap::new()),
            system: System { unknowns: text.circuit.nodes.len() - 1, rows: vec![] },
            currents: vec![Form::number(F::ZERO); text.flat.devices.len()],
            joined: cut::joined(text),
            cuts: vec![],
            strange: vec![],
        };
        // Nodes come first, in their order: their rows are filled in at the end.
        let nodes = wires.system.unknowns;
        wires.system.rows = vec![Form::number(F::ZERO); nodes];
        let mut far = HashMap::new();
        for device in 0..wires.currents.len() {
            if wires.has_branch(device)? {
                let column = wires.system.add();
                wires.currents[device] = Form::unknown(column);
            }
            if let DeviceKind::Line { .. } = text.circuit.devices[device].kind {
                far.insert(device, Form::unknown(wires.system.add()));
            }
        }
        let mut mutual: HashMap<usize, Vec<(usize, F)>> = HashMap::new();
        for device in 0..wires.currents.len() {
            if let Some((a, b, value)) = wires.mutual(device)? {
                mutual.entry(a).or_default().push((b, value));
                mutual.entry(b).or_default().push((a, value));
            }
        }
        for device in 0..wires.currents.len() {
            let coupled = mutual.get(&device).map_or(&[][..], Vec::as_slice);
            wires.device(device, coupled, &far)?;
        }
        for device in 0..wires.currents.len() {
            let nodes = &text.circuit.devices[device].nodes;
            let current = wires.currents[device].clone();
            wires.leaves(nodes, 0, &current);
            if let Some(current) = far.get(&device) {
                wires.leaves(nodes, 2, current);
            }
        }
        Ok(wires)
    }

    /// Counts the current from one node of a device through it to the next.
    fn leaves(&mut self, nodes: &[NodeId], first: usize, current: &Form<F>) {
        for (node, sign) in nodes.iter().skip(first).take(2).zip([F::ONE, -F::ONE]) {
            if let Some(row) = (node.0 as usize).checked_sub(1)
                && let Some(row) = self.system.rows.get_mut(row)
            {
                *row = std::mem::replace(row, Form::number(F::ZERO)).plus(sign, current);
            }
        }
    }

    /// Whether a device's current is an unknown of its own.
    fn has_branch(&self, device: usize) -> Result<bool, Trouble> {
        Ok(match &self.text.circuit.devices[device].kind {
            DeviceKind::Resistor { .. } => self.value_of(device)?.is_zero(),
            DeviceKind::Capacitor { .. }
            | DeviceKind::Mutual { .. }
            | DeviceKind::CurrentSource { .. }
            | DeviceKind::Vccs { .. }
            | DeviceKind::Switch { .. }
            | DeviceKind::CrossedSwitch { .. }
            | DeviceKind::SmoothSwitch(_)
            | DeviceKind::BehaviouralCapacitor { .. }
            | DeviceKind::Quantity(_)
            | DeviceKind::Diode { .. } => false,
            DeviceKind::Inductor { .. }
            | DeviceKind::VoltageSource { .. }
            | DeviceKind::Vcvs { .. }
            | DeviceKind::Cccs { .. }
            | DeviceKind::Ccvs { .. }
            | DeviceKind::BehaviouralVoltage { .. }
            | DeviceKind::BehaviouralCurrent { .. }
            | DeviceKind::BehaviouralResistor { .. }
            | DeviceKind::BehaviouralInductor { .. }
            | DeviceKind::Line { .. }
            | DeviceKind::Hold { .. } => true,
        })
    }

    /// The value of a resistor, capacitor or inductor, the gain of a source.
    fn value_of(&self, device: usize) -> Result<F, Trouble> {
        let Some((pending, element)) = self.text.element(device) else { return Ok(F::ZERO) };
        match element {
            Element::Resistor { value }
            | Element::Capacitor { value, .. }
            | Element::Inductor { value, .. }
            | Element::Vcvs { gain: value, .. }
            | Element::Vccs { gain: value, .. }
            | Element::Cccs { gain: value, .. }
            | Element::Ccvs { gain: value, .. } => self.number(pending.scope, value),
            _ => Ok(F::ZERO),
        }
    }

    /// An expression of parameters.
    fn number(&self, scope: ScopeId, expr: &Expr) -> Result<F, Trouble> {
        self.form(scope, expr)?.as_number().ok_or(Trouble::Nonlinear)
    }

    /// An expression in the unknowns.
    ///
    /// # Errors
    /// Why it has no form.
    pub fn form(&self, scope: ScopeId, expr: &Expr) -> Result<Form<F>, Trouble> {
        let reading = Reading { draw: self.bonds.draw, cut: None };
        reading.form(expr, &mut |leaf, _| self.leaf(scope, leaf))
    }

    /// The value of an expression at a solution.
    ///
    /// # Errors
    /// Why it has none.
    pub fn value(
        &self,
        scope: ScopeId,
        expr: &Expr,
        solution: &[F],
        cut: Option<&Uncut<F>>,
    ) -> Result<F, Trouble> {
        Reading { draw: self.bonds.draw, cut }
            .number(expr, &mut |leaf, _| Ok(Form::number(self.leaf(scope, leaf)?.at(solution))))
    }

    /// What a leaf is in the unknowns.
    ///
    /// # Errors
    /// What is not there.
    pub fn leaf(&self, scope: ScopeId, leaf: &Leaf) -> Result<Form<F>, Trouble> {
        let names = &self.text.names;
        let unknown = |name: Name| Trouble::Unknown(names.text(name).to_string());
        let node = |name: Name| {
            let node = self.lookup.node(scope, name, crate::source::Span::NONE, &mut vec![]);
            node.map(|node| self.node(node)).ok_or_else(|| unknown(name))
        };
        match leaf {
            Leaf::Parameter(name) => Ok(Form::number(self.parameter(scope, *name)?)),
            Leaf::Voltage(plus, None) => node(*plus),
            Leaf::Voltage(plus, Some(minus)) => Ok(node(*plus)?.minus(&node(*minus)?)),
            Leaf::Current(name) => {
                let span = crate::source::Span::NONE;
                let device = self.lookup.device(scope, *name, span, &mut vec![]);
                let current = device.and_then(|device| self.currents.get(device.0 as usize));
                current.cloned().ok_or_else(|| unknown(*name))
            }
            Leaf::Time => Ok(Form::number(self.bonds.draw.of(Of::Time))),
            Leaf::Operator(..) => Err(Trouble::Nonlinear),
            // They stand in outputs alone.
            Leaf::Power(name) => Err(unknown(*name)),
            Leaf::Part(_, inner) => self.leaf(scope, inner),
        }
    }

    /// The voltage of a node.
    fn node(&self, node: NodeId) -> Form<F> {
        match node.0.checked_sub(1) {
            Some(column) => Form::unknown(column),
            None => Form::number(F::ZERO),
        }
    }

    fn between(&self, nodes: &[NodeId]) -> Form<F> {
        match nodes {
            [plus, minus, ..] => self.node(*plus).minus(&self.node(*minus)),
            _ => Form::number(F::ZERO),
        }
    }

    /// A parameter: the graph's where it has one of this name, else as the text defines it.
    fn parameter(&self, scope: ScopeId, name: Name) -> Result<F, Trouble> {
        let (scope, name) = self.lookup.parameter(scope, name);
        let scopes = &self.text.flat.scopes;
        let found =
            scopes.around(scope).find_map(|(id, scope)| Some((id, *scope.written.get(&name)?)));
        let text = self.text.names.text(name);
        let Some((id, (within, expr))) = found else {
            return scope::constant(text)
                .and_then(decimal)
                .ok_or_else(|| Trouble::Unknown(text.to_string()));
        };
        let drawn = self.parameters.get(&(id.0, name));
        if let Some(value) = drawn.and_then(|k| self.bonds.parameters.get(*k)) {
            return Ok(*value);
        }
        if let Some(value) = self.known.borrow().get(&(id.0, name)) {
            return Ok(*value);
        }
        let value = self.number(within, expr)?;
        self.known.borrow_mut().insert((id.0, name), value);
        Ok(value)
    }

    /// What a `.param` of the text says of a parameter of the graph, where both compute it from others.
    ///
    /// # Errors
    /// What has no value in this draw.
    pub fn written_parameter(&self, id: ParameterId) -> Result<Option<F>, Trouble> {
        let Some((scope, name)) = self.text.parameters.get(id.index()).copied().flatten() else {
            return Ok(None);
        };
        let written = self.text.flat.scopes.get(scope).written.get(&name);
        let Some((scope, expr)) = written else { return Ok(None) };
        let mut parameters = 0;
        expr.leaves(&mut |_, _| parameters += 1);
        if parameters == 0 {
            return Ok(None);
        }
        self.number(*scope, expr).map(Some)
    }

    /// The inductors that a K couples, and by how much.
    fn mutual(&self, device: usize) -> Result<Option<(usize, usize, F)>, Trouble> {
        let circuit = &self.text.circuit;
        let DeviceKind::Mutual { inductors: [a, b], coupling } = circuit.devices[device].kind
        else {
            return Ok(None);
        };
        let (a, b) = (a.0 as usize, b.0 as usize);
        let Some((pending, Element::Mutual { coupling: text, .. })) = self.text.element(device)
        else {
            return Ok(None);
        };
        let inductance = |k: usize| match circuit.devices.get(k).map(|device| &device.kind) {
            Some(DeviceKind::Inductor { inductance, .. }) => *inductance,
            _ => f64::NAN,
        };
        // A number was rounded from the matrix's own.
        if text.as_number().is_some() {
            let mutual = coupling * (inductance(a) * inductance(b)).sqrt();
            if let Some(entry) = self.written_entry(mutual) {
                return Ok(Some((a, b, self.bonds.constant(entry)?)));
            }
        }
        let product = self.value_of(a)? * self.value_of(b)?;
        let value = self.number(pending.scope, text)? * super::draw::square_root(product);
        Ok(Some((a, b, value)))
    }

    /// The entry of a field's matrix, made of literals, that is this number up to rounding.
    fn written_entry(&self, value: f64) -> Option<&'t graph::Expr> {
        let near = |entry: f64| (entry - value).abs() <= 8.0 * f64::EPSILON * entry.abs();
        self.graph.vertices.iter().find_map(|vertex| match &vertex.law {
            Law::Field(field) => {
                let mut entries = field.matrix.iter().flatten().flatten();
                entries.find(|entry| entry.constant().is_some_and(near))
            }
            _ => None,
        })
    }

    /// What a capacitor or an inductor starts from.
    fn start(&self, device: usize, card: Option<&Expr>) -> Result<F, Trouble> {
        let draw = self.bonds.draw;
        Ok(match self.text.start(self.graph, device) {
            Start::Power(end) => draw.of(Of::InitialPower(end.vertex.0, end.port)),
            Start::Stored(end) => draw.of(Of::InitialStored(end.vertex.0, end.port)),
            Start::Signal(id) => draw.of(Of::InitialSignal(id.index())),
            Start::Card => match (card, self.text.element(device)) {
                (Some(card), Some((pending, _))) => self.number(pending.scope, card)?,
                _ => F::ZERO,
            },
        })
    }

    /// The value of an independent source.
    fn source(&self, device: usize, waveform: &Waveform) -> Result<F, Trouble> {
        let claim = self.text.claims[device].and_then(|place| waveform_of(self.graph, place));
        if let Some(id) = claim {
            return Ok(self.bonds.draw.of(Of::Waveform(id.index())));
        }
        match (waveform, self.text.element(device)) {
            (Waveform::Constant(value), Some((pending, _))) => self.number(pending.scope, value),
            _ => Ok(self.bonds.draw.of(Of::Unclaimed(device))),
        }
    }

    /// The equation of a device, or its current.
    fn device(
        &mut self,
        device: usize,
        coupled: &[(usize, F)],
        far: &HashMap<usize, Form<F>>,
    ) -> Result<(), Trouble> {
        let text = self.text;
        let (s, draw) = (self.bonds.s, self.bonds.draw);
        let Some((pending, element)) = text.element(device) else { return Ok(()) };
        let (pending_scope, own) = (pending.scope, &text.circuit.devices[device]);
        let voltage = self.between(&own.nodes);
        let current = self.currents[device].clone();
        match (&own.kind, element) {
            (DeviceKind::Hold { .. }, _) => {
                let held = match text.claims[device] {
                    Some(Place::Signal(id)) => draw.of(Of::Remembered(id.index())),
                    _ => draw.of(Of::Unclaimed(device)),
                };
                let row = own.nodes.first().map_or(Form::number(F::ZERO), |node| self.node(*node));
                self.system.rows.push(row.minus(&Form::number(held)));
            }
            // The capacitor and the clock of an exact sample mean nothing.
            (DeviceKind::CurrentSource { .. }, Element::Capacitor { .. }) => {}
            (DeviceKind::Resistor { .. }, _) => {
                let resistance = self.value_of(device)?;
                if resistance.is_zero() {
                    self.system.rows.push(voltage);
                } else {
                    self.currents[device] = voltage.times(F::ONE / resistance);
                }
            }
            (DeviceKind::Capacitor { .. }, Element::Capacitor { initial, .. }) => {
                let start = self.start(device, initial.as_ref())?;
                let rate = voltage.times(s).minus(&Form::number(start));
                self.currents[device] = rate.times(self.value_of(device)?);
            }
            (DeviceKind::Inductor { .. }, Element::Inductor { initial, .. }) => {
                let start = self.start(device, initial.as_ref())?;
                let rate = current.times(s).minus(&Form::number(start));
                let mut row = voltage.minus(&rate.times(self.value_of(device)?));
                for (other, value) in coupled {
                    let start = match text.element(*other) {
                        Some((_, Element::Inductor { initial, .. })) => {
                            self.start(*other, initial.as_ref())?
                        }
                        _ => F::ZERO,
                    };
                    let current = self.currents[*other].clone();
                    let rate = current.times(s).minus(&Form::number(start));
                    row = row.plus(-*value, &rate);
                }
                self.system.rows.push(row);
            }
            (DeviceKind::Mutual { .. }, _) => {}
            (DeviceKind::VoltageSource { .. }, Element::VoltageSource(source)) => {
                let value = match own.kind {
                    // The clock of an exact sample.
                    _ if self.is_clock(device) => F::ZERO,
                    _ => self.source(device, &source.waveform)?,
                };
                self.system.rows.push(voltage.minus(&Form::number(value)));
            }
            (DeviceKind::CurrentSource { .. }, Element::CurrentSource(source)) => {
                self.currents[device] = Form::number(self.source(device, &source.waveform)?);
            }
            (DeviceKind::Vcvs { control, .. }, _) => {
                let control = self.between(control).times(self.value_of(device)?);
                self.system.rows.push(voltage.minus(&control));
            }
            (DeviceKind::Vccs { control, .. }, _) => {
                self.currents[device] = self.between(control).times(self.value_of(device)?);
            }
            (DeviceKind::Cccs { control, .. }, _) | (DeviceKind::Ccvs { control, .. }, _) => {
                let control = self.currents.get(control.0 as usize).cloned();
                let control = control.unwrap_or_else(|| Form::number(F::ZERO));
                let control = control.times(self.value_of(device)?);
                let given = match own.kind {
                    DeviceKind::Cccs { .. } => current,
                    _ => voltage,
                };
                self.system.rows.push(given.minus(&control));
            }
            (
                DeviceKind::BehaviouralVoltage { .. } | DeviceKind::BehaviouralCurrent { .. },
                Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law },
            ) => {
                let is_voltage = matches!(element, Element::BehaviouralVoltage { .. });
                let value = match self.form(pending_scope, law) {
                    Err(Trouble::Nonlinear) => self.cut(device, is_voltage)?,
                    Ok(_) if self.must_be_cut(device) => self.cut(device, is_voltage)?,
                    found => found?,
                };
                let given = if is_voltage { voltage } else { current };
                self.system.rows.push(given.minus(&value));
            }
            (DeviceKind::Switch { .. }, _) => {
                let conductance: F = draw.of(Of::Switch(device));
                self.currents[device] = voltage.times(conductance);
                if !matches!(text.claims[device], Some(Place::Signal(_))) {
                    self.strange.push((device, "a switch stands for no element".into()));
                }
            }
            (DeviceKind::Line { .. }, Element::Line { impedance, delay, initial }) => {
                let far_current =
                    far.get(&device).cloned().unwrap_or_else(|| Form::number(F::ZERO));
                let z = self.number(pending_scope, impedance)?;
                let delayed = delay_factor(draw, self.number(pending_scope, delay)?);
                let start: [F; 4] = match (text.start(self.graph, device), initial) {
                    (Start::Signal(id), _) => {
                        let start: F = draw.of(Of::InitialSignal(id.index()));
                        [start, start, start, -start]
                    }
                    (_, Some(initial)) => {
                        let mut values = [F::ZERO; 4];
                        for (value, expr) in values.iter_mut().zip(initial.iter()) {
                            *value = self.number(pending_scope, expr)?;
                        }
                        values
                    }
                    (_, None) => [F::ZERO; 4],
                };
                let near = (voltage, current);
                let far = (self.between(own.nodes.get(2..).unwrap_or_default()), far_current);
                let before = (F::ONE - delayed) / s;
                for (here, there, start) in
                    [(&near, &far, start[2] + z * start[3]), (&far, &near, start[0] + z * start[1])]
                {
                    let arrives = there.0.clone().plus(z, &there.1).times(delayed);
                    let row = here.0.clone().plus(-z, &here.1).minus(&arrives);
                    self.system.rows.push(row.minus(&Form::number(before * start)));
                }
            }
            (DeviceKind::Diode { .. }, _) => {
                self.strange.push((device, "a diode stands for no element".into()));
            }
            _ => self.strange.push((device, "this device stands for no element".into())),
        }
        Ok(())
    }

    fn is_clock(&self, device: usize) -> bool {
        let name = self.text.device_name(device);
        self.text.header.samples.iter().any(|sample| sample.clock.eq_ignore_ascii_case(&name))
    }

    /// The value of a device's own variable: the current of a current source, the voltage of any other.
    pub fn own_value(&self, device: usize, solution: &[F]) -> F {
        match self.text.circuit.devices[device].kind {
            DeviceKind::BehaviouralCurrent { .. } => self.currents[device].at(solution),
            _ => self.between(&self.text.circuit.devices[device].nodes).at(solution),
        }
    }

    /// The value of the voltage between two nodes.
    pub fn voltage(&self, nodes: [NodeId; 2], solution: &[F]) -> F {
        self.between(&nodes).at(solution)
    }

    /// The name of an unknown.
    pub fn name(&self, column: u32) -> String {
        let nodes = self.text.circuit.nodes.len() as u32 - 1;
        if column < nodes {
            return format!("v({})", self.text.node_name(NodeId(column + 1)));
        }
        let own = Form::unknown(column);
        let device = self.currents.iter().position(|current| *current == own);
        device.map_or_else(String::new, |device| format!("i({})", self.text.device_name(device)))
    }

    /// The signal that a device stands for.
    pub fn signal(&self, device: usize) -> Option<SignalId> {
        match self.text.claims[device] {
            Some(Place::Signal(id)) => Some(id),
            _ => None,
        }
    }
}
