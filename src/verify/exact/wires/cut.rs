//! Which cards are laws that are cut, which way round they stand, and what they follow.

use super::{CutCard, Wires};
use crate::bond::graph::{Law, Memory, Power, SignalLaw};
use crate::circuit::DeviceKind;
use crate::netlist::flatten::scope::TOP;
use crate::netlist::{Element, Waveform};
use crate::verify::exact::bonds::{Cut, Follows, Place};
use crate::verify::exact::draw::{Modular, Of};
use crate::verify::exact::form::{Form, Trouble};
use crate::verify::exact::text::Text;

impl<F: Modular> Wires<'_, F> {
    /// Whether a behavioural card that is affine stands for a law that is cut: one of its arguments is 0 in this circuit,
    /// and none of its other cards is the law.
    pub(super) fn must_be_cut(&self, device: usize) -> bool {
        let Some(place) = self.text.claims[device] else { return false };
        if !self.bonds.cuts.contains_key(&place) {
            return false;
        }
        let Some(devices) = self.text.devices.get(&place) else { return false };
        let laws = devices.iter().filter_map(|k| match self.text.element(*k)? {
            (
                pending,
                Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law },
            ) => Some((*k, self.form(pending.scope, law))),
            _ => None,
        });
        let laws: Vec<_> = laws.collect();
        laws.first().is_some_and(|(first, _)| *first == device)
            && !laws.iter().any(|(_, form)| *form == Err(Trouble::Nonlinear))
    }

    /// What a behavioural card that is not affine is cut to.
    pub(super) fn cut(&mut self, device: usize, is_voltage: bool) -> Result<Form<F>, Trouble> {
        let place = self.text.claims[device];
        if let Some(Place::Signal(id)) = place
            && let SignalLaw::Memory { kind: Memory::Hysteresis { .. }, .. } =
                self.graph.signals[id.index()].law
            && self.text.gives_memory(device)
        {
            return Ok(Form::number(self.bonds.draw.of(Of::Remembered(id.index()))));
        }
        let cut = place.and_then(|place| Some((place, self.bonds.cuts.get(&place)?)));
        let Some((place, cut)) = cut else {
            let message = "it computes what no law of the bond graph says";
            self.strange.push((device, message.to_string()));
            return Ok(Form::number(self.bonds.draw.of(Of::Unclaimed(device))));
        };
        let turned = self.turned(device, place);
        self.cuts.push(CutCard { device, place, turned });
        let followed = self.followed(device, is_voltage, cut, turned)?;
        let value = followed.times(cut.slope).plus(cut.offset, &Form::number(F::ONE));
        Ok(if turned { value.times(-F::ONE) } else { value })
    }

    /// Whether a card gives the negative of a law.
    fn turned(&self, device: usize, place: Place) -> bool {
        let Place::Port(end) = place else { return false };
        // An integrator's feed says the rate or the stored quantity itself; a source's current is its bond's flow.
        let along = match self.graph.law_at(end) {
            Law::Rate { .. } => return false,
            Law::Store { law: crate::bond::graph::StoreLaw::OfPower(_), .. } => return false,
            Law::Source { sets: Power::Flow, .. } => self
                .graph
                .bond_at(end)
                .is_some_and(|bond| self.graph.sign_into(bond, end.vertex, end.port) < 0.0),
            _ => false,
        };
        self.stands_turned(device, end) ^ along
    }

    /// Whether a device stands with its first node at the − of a port.
    fn stands_turned(&self, device: usize, end: crate::bond::graph::End) -> bool {
        let Some(effort) = self.text.effort(self.graph, end) else { return false };
        let own = self.joined(&self.between(&self.text.circuit.devices[device].nodes));
        match self.form(TOP, effort) {
            Ok(effort) => self.joined(&effort.times(-F::ONE)) == own && !own.terms.is_empty(),
            Err(_) => false,
        }
    }

    /// A form in which nodes that sources of 0 V join are one, as those are that sense a port's current.
    fn joined(&self, form: &Form<F>) -> Form<F> {
        let mut all = Form::number(form.constant);
        for (column, factor) in &form.terms {
            let one = match self.joined.get(*column as usize + 1) {
                Some(0) => Form::number(F::ZERO),
                Some(node) => Form::unknown(node - 1),
                None => Form::unknown(*column),
            };
            all = all.plus(*factor, &one);
        }
        all
    }

    /// What a cut law follows, in the unknowns of the circuit.
    fn followed(
        &self,
        device: usize,
        is_voltage: bool,
        cut: &Cut<F>,
        turned: bool,
    ) -> Result<Form<F>, Trouble> {
        let signed = |form: Form<F>, negative: bool| {
            if negative { form.times(-F::ONE) } else { form }
        };
        match cut.follows {
            Follows::Nothing => Ok(Form::number(F::ZERO)),
            Follows::Stored(end) => match self.text.stored(self.graph, end) {
                Some(expr) => self.form(TOP, expr),
                None => Err(Trouble::Unknown(format!("what {} stores", self.graph.port_name(end)))),
            },
            Follows::Port(end, Power::Effort) => {
                let own = self.text.claims[device] == Some(Place::Port(end)) && !is_voltage;
                let feeds = matches!(self.graph.law_at(end), Law::Rate { .. });
                if own && !feeds {
                    let voltage = self.between(&self.text.circuit.devices[device].nodes);
                    return Ok(signed(voltage, turned));
                }
                match self.text.effort(self.graph, end) {
                    Some(expr) => self.form(TOP, expr),
                    None => Err(Trouble::Unknown(format!("e({})", self.graph.port_name(end)))),
                }
            }
            Follows::Port(end, Power::Flow) => {
                // The current of a voltage source that stands at the port.
                let effort = self.text.effort(self.graph, end);
                let effort = effort.map(|expr| Ok(self.joined(&self.form(TOP, expr)?)));
                let effort: Option<Result<Form<F>, Trouble>> = effort;
                let devices = self.text.devices.get(&Place::Port(end)).into_iter().flatten();
                for other in devices {
                    let kind = &self.text.circuit.devices[*other].kind;
                    let carries = matches!(
                        kind,
                        DeviceKind::Vcvs { .. }
                            | DeviceKind::Ccvs { .. }
                            | DeviceKind::BehaviouralVoltage { .. }
                    );
                    let own = self.joined(&self.between(&self.text.circuit.devices[*other].nodes));
                    let current = self.currents[*other].clone();
                    match &effort {
                        Some(Ok(effort)) if carries && *effort == own => return Ok(current),
                        Some(Ok(effort)) if carries && effort.clone().times(-F::ONE) == own => {
                            return Ok(current.times(-F::ONE));
                        }
                        _ => {}
                    }
                }
                match self.text.flow(self.graph, end) {
                    Some((expr, negative)) => Ok(signed(self.form(TOP, expr)?, negative)),
                    None => Err(Trouble::Unknown(format!("f({})", self.graph.port_name(end)))),
                }
            }
        }
    }
}

/// By node of a circuit: the first that sources of 0 V join it to.
pub fn joined(text: &Text<'_>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..text.circuit.nodes.len() as u32).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    for (k, device) in text.circuit.devices.iter().enumerate() {
        let sense = match text.element(k) {
            Some((_, Element::VoltageSource(source))) => match &source.waveform {
                Waveform::Constant(value) => value.as_number() == Some(0.0),
                _ => false,
            },
            _ => false,
        };
        if let (true, [a, b, ..]) = (sense, &device.nodes[..]) {
            let (a, b) = (root(&mut parent, a.0), root(&mut parent, b.0));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    (0..parent.len() as u32).map(|node| root(&mut parent, node)).collect()
}
