//! The rows of each junction, element and signal.

use super::super::draw::{Modular, Of};
use super::super::form::{Form, Trouble};
use super::{ALIKE_OFFSET, Bonds, Cut, Follows, Place, constant_inertias, delay_factor};
use crate::bond::graph::{
    Dissipation, End, Expr, Law, Leaf, Memory, Modulus, Power, SignalId, SignalLaw, Storage,
    StoreLaw, Variable, VertexId,
};
use crate::expr::Binary;

impl<F: Modular> Bonds<'_, F> {
    /// The rows of one junction or element.
    pub(super) fn element(&mut self, id: VertexId) -> Result<(), Trouble> {
        let graph = self.graph;
        match &graph.vertex(id).law {
            Law::Zero => self.junction(id, Power::Effort),
            Law::One => self.junction(id, Power::Flow),
            Law::Transformer(modulus) => self.two_port(id, modulus, false)?,
            Law::Gyrator(modulus) => self.two_port(id, modulus, true)?,
            _ => {
                for end in graph.law_ports(id) {
                    self.port(end)?;
                }
            }
        }
        Ok(())
    }

    fn junction(&mut self, id: VertexId, common: Power) {
        let place = Place::Port(End::only(id));
        let bonds = &self.graph.vertex(id).bonds;
        let Some((first, rest)) = bonds.split_first() else { return };
        for bond in rest {
            let form = self.power(*bond, common).minus(&self.power(*first, common));
            self.row(place, form);
        }
        let mut sum = Form::number(F::ZERO);
        for bond in bonds {
            let into = self.graph.sign_into(*bond, id, 0) > 0.0;
            sum = sum.plus(if into { F::ONE } else { -F::ONE }, &self.power(*bond, common.dual()));
        }
        self.row(place, sum);
    }

    /// Power variables of port 0 counted into, those of port 1 out of the element.
    fn two_port(&mut self, id: VertexId, modulus: &Modulus, gyrates: bool) -> Result<(), Trouble> {
        let ends = [0, 1].map(|port| End { vertex: id, port });
        let [Some(first), Some(second)] = ends.map(|end| self.graph.bond_at(end)) else {
            return Ok(());
        };
        // (port whose variable the modulus gives, which; port of what it multiplies, which).
        use Power::{Effort, Flow};
        let (value, rows) = match (modulus, gyrates) {
            (Modulus::Ratio(r), false) => (r, [(0, Effort, 1, Effort), (1, Flow, 0, Flow)]),
            (Modulus::Gain(g), false) => (g, [(1, Effort, 0, Effort), (0, Flow, 1, Flow)]),
            (Modulus::Ratio(r), true) => (r, [(0, Effort, 1, Flow), (1, Effort, 0, Flow)]),
            (Modulus::Gain(g), true) => (g, [(0, Flow, 1, Effort), (1, Flow, 0, Effort)]),
        };
        let known = match self.form(value, Some(id)) {
            Ok(form) => form.as_number(),
            Err(Trouble::Nonlinear) => None,
            Err(trouble) => return Err(trouble),
        };
        let alike = self.alike.moduli.get(&id).copied();
        // What is known stays what it is: its text then has its value wherever it stands.
        let number = known.or_else(|| self.known(value, 0)).unwrap_or_else(|| {
            let (given, given_power, other, other_power) = rows[0];
            let by = self.factor_at(ends[given], given_power);
            let of = self.factor_at(ends[other], other_power);
            self.number(Of::Slope(id.0, 2), alike, ALIKE_OFFSET) * of / by
        });
        if known.is_none() {
            self.moduli.push((value.clone(), id, number));
        }
        // The variable of a port as the definition counts it, and as a leaf.
        let counted = |all: &Self, port: usize, power: Power| {
            let form = all.at(ends[port], power);
            if port == 1 && power == Flow { form.times(-F::ONE) } else { form }
        };
        for (given, given_power, other, other_power) in rows {
            let left = counted(self, given, given_power);
            let right = counted(self, other, other_power);
            let row = left.minus(&right.clone().times(number));
            let end = ends[given];
            self.row(Place::Port(end), row);
            if known.is_none() {
                // In a circuit the law of a port gives the effort, or the flow into it.
                let negative = given == 1 && given_power == Flow;
                let bond = if other == 0 { first } else { second };
                let inward = self.graph.sign_into(bond, id, other as u32) > 0.0;
                let counted_along = if other_power == Flow { inward == (other == 0) } else { true };
                let leaf = Expr::leaf(Leaf::Bond {
                    bond,
                    variable: other_power,
                    negated: !counted_along ^ negative,
                });
                let slope = if negative { -number } else { number };
                // What is followed is counted into the element.
                let turned = other == 1 && other_power == Flow;
                let cut = Cut {
                    offset: F::ZERO,
                    slope: if turned { -slope } else { slope },
                    follows: Follows::Port(ends[other], other_power),
                    value: right.times(slope),
                    law: value.clone().binary(Binary::Multiply, leaf),
                    own: Some(id),
                };
                self.cuts.insert(Place::Port(end), cut);
            }
        }
        Ok(())
    }

    /// The rows of a one-port, or of one port of a field.
    fn port(&mut self, end: End) -> Result<(), Trouble> {
        let graph = self.graph;
        let Some(bond) = graph.bond_at(end) else { return Ok(()) };
        let place = Place::Port(end);
        let own = |power| Expr::leaf(Leaf::Own(Variable::Power(power)));
        match graph.law_at(end) {
            Law::Source { sets, value, .. } => {
                let value = self.law(end, value.clone(), Follows::Nothing)?;
                let row = self.power(bond, *sets).minus(&value);
                self.row(place, row);
            }
            Law::Dissipator(law) => {
                let (gives, law) = match law {
                    Dissipation::Linear(resistance) => {
                        let law = resistance.clone().binary(Binary::Multiply, own(Power::Flow));
                        (Power::Effort, law)
                    }
                    Dissipation::Effort(law) => (Power::Effort, law.clone()),
                    Dissipation::Flow(law) => (Power::Flow, law.clone()),
                };
                let value = self.law(end, law, Follows::Port(end, gives.dual()))?;
                let row = self.at(end, gives).minus(&value);
                self.row(place, row);
            }
            Law::Store { kind, law, .. } => {
                let start = match law {
                    StoreLaw::Linear(size) if self.is_number(size) => {
                        let power = self.start(end, true);
                        self.constant(size)? * power
                    }
                    StoreLaw::Linear(size) => {
                        let stored = Expr::leaf(Leaf::Own(Variable::Stored));
                        let law = stored.binary(Binary::Divide, size.clone());
                        self.gives(end, *kind, law)?
                    }
                    StoreLaw::OfStored(law) => self.gives(end, *kind, law.clone())?,
                    StoreLaw::OfPower(law) => {
                        let follows = Follows::Port(end, kind.gives());
                        let value = self.law(end, law.clone(), follows)?;
                        let row = self.stored(end)?.minus(&value);
                        self.row(place, row);
                        self.start_of_power(end, law)?
                    }
                };
                let rate = self.at(end, kind.integrates());
                let row = self.stored(end)?.times(self.s).minus(&Form::number(start)).minus(&rate);
                self.row(place, row);
            }
            Law::Rate { kind, rate, .. } => {
                let follows = Follows::Port(end, kind.integrates());
                let rate = self.law(end, rate.clone(), follows)?;
                let start = self.start(end, true);
                let state = self.at(end, kind.gives()).times(self.s);
                self.row(place, state.minus(&Form::number(start)).minus(&rate));
            }
            Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {}
        }
        Ok(())
    }

    /// The row of a store whose law gives its power variable; what it starts from.
    fn gives(&mut self, end: End, kind: Storage, law: Expr) -> Result<F, Trouble> {
        let value = self.law(end, law, Follows::Stored(end))?;
        let row = self.at(end, kind.gives()).minus(&value);
        self.row(Place::Port(end), row);
        Ok(self.start(end, false))
    }

    /// What a store with a law of its power variable starts from. Coupled inductors start from their currents.
    fn start_of_power(&self, end: End, law: &Expr) -> Result<F, Trouble> {
        let coupled = match &self.graph.vertex(end.vertex).law {
            Law::Field(field) => constant_inertias(field),
            _ => false,
        };
        if !coupled {
            return Ok(self.start(end, false));
        }
        self.reading().number(law, &mut |leaf, _| match leaf {
            Leaf::Bond { bond, negated, .. } => {
                let bonds = &self.graph.vertex(end.vertex).bonds;
                let port = bonds.iter().position(|b| b == bond).unwrap_or(0) as u32;
                let power = self.start(End { vertex: end.vertex, port }, true);
                let outward = self.graph.sign_into(*bond, end.vertex, port) < 0.0;
                Ok(Form::number(if outward != *negated { -power } else { power }))
            }
            leaf => self.leaf(leaf, Some(end.vertex)),
        })
    }

    pub(super) fn signal_rows(&mut self, id: SignalId) -> Result<(), Trouble> {
        let graph = self.graph;
        let own = self.signal(id);
        let place = Place::Signal(id);
        let row = match &graph.signals[id.index()].law {
            SignalLaw::Waveform(_) => {
                own.minus(&Form::number(self.draw.of(Of::Waveform(id.index()))))
            }
            SignalLaw::Algebraic(value) => own.minus(&self.signal_law(id, value)?),
            SignalLaw::Integrator { rate, .. } => {
                let start: F = self.draw.of(Of::InitialSignal(id.index()));
                let rate = self.signal_law(id, rate)?;
                own.times(self.s).minus(&Form::number(start)).minus(&rate)
            }
            SignalLaw::Memory { kind: Memory::Delay { by }, input } => {
                let input = self.signal_law(id, input)?;
                let delayed = self.delayed(by)?;
                let start: F = self.draw.of(Of::InitialSignal(id.index()));
                let before = (F::ONE - delayed) / self.s * start;
                own.minus(&input.times(delayed)).minus(&Form::number(before))
            }
            SignalLaw::Memory { input, .. } => {
                self.signal_law(id, input)?;
                own.minus(&Form::number(self.draw.of(Of::Remembered(id.index()))))
            }
        };
        self.row(place, row);
        Ok(())
    }

    /// exp(−s·T)
    fn delayed(&self, by: &Expr) -> Result<F, Trouble> {
        Ok(delay_factor(self.draw, self.constant(by)?))
    }

    fn signal_law(&mut self, id: SignalId, law: &Expr) -> Result<Form<F>, Trouble> {
        match self.form(law, None) {
            Err(Trouble::Nonlinear) => {}
            found => {
                // A law of time alone is a number, which a dialect may spell by other functions: its card is compared.
                if let Ok(Some(offset)) = found.as_ref().map(Form::as_number)
                    && speaks_of_time(law)
                {
                    let (slope, follows) = (F::ZERO, Follows::Nothing);
                    let (value, law) = (Form::number(offset), law.clone());
                    let cut = Cut { offset, slope, follows, value, law, own: None };
                    self.cuts.insert(Place::Signal(id), cut);
                }
                return found;
            }
        }
        let alike = self.alike.laws.get(&Place::Signal(id)).copied();
        let drawn = || self.number(Of::Signal(id.index()), alike, ALIKE_OFFSET);
        let offset = self.known(law, 0).unwrap_or_else(drawn);
        let value = Form::number(offset);
        let cut = Cut {
            offset,
            slope: F::ZERO,
            follows: Follows::Nothing,
            value: value.clone(),
            law: law.clone(),
            own: None,
        };
        self.cuts.insert(Place::Signal(id), cut);
        Ok(value)
    }
}

fn speaks_of_time(law: &Expr) -> bool {
    let mut found = false;
    law.leaves(&mut |leaf, _| found |= *leaf == Leaf::Time);
    found
}
