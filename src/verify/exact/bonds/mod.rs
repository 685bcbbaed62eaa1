//! The bond graph's own equations over a prime field: an effort and a flow for each bond, straight from the definitions
//! of the elements, Laplace-transformed.
//!
//! ```text
//! junction   the common variable is equal on all bonds, Σ ± of the other is 0
//! C, I       s·q − q0 = f,  s·p − p0 = e        q = C·e,  p = I·f
//! rate form  s·e − e0 = rate
//! TF, GY     e1 = r·e2, f2 = r·f1               e1 = r·f2, e2 = r·f1
//! delay      y = θ·x + (1 − θ)/s·y0             θ stands for exp(−s·T)
//! ```
//!
//! A law that is not affine in the unknowns is cut: its value becomes α + β·x, x being its port's own variable; a
//! modulus becomes a number, and so does a signal. Signs are those of [`graph`](crate::bond::graph).

mod rows;
pub mod solved;

use super::draw::{Draw, Modular, Of, decimal};
use super::form::{Form, Reading, Trouble};
use super::system::System;
use crate::bond::graph::{
    BondGraph, BondId, Dissipation, End, Expr, Field, Law, Leaf, ParameterId, Power, SignalId,
    SignalLaw, Storage, StoreLaw, Variable, VertexId,
};
use crate::quantity::Domain;
use crate::source::Span;
use std::collections::HashMap;

/// Whose law is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// A port's.
    Port(End),
    /// A signal's: its value, its rate, or what it remembers.
    Signal(SignalId),
}

/// A variable that a cut law follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Follows {
    /// A power variable of a port; a flow counted into the element.
    Port(End, Power),
    /// What a port stores.
    Stored(End),
    /// Nothing.
    Nothing,
}

/// A law that is cut: its value is offset + slope·(what it follows).
#[derive(Clone, Debug)]
pub struct Cut<F> {
    /// Its value at 0.
    pub offset: F,
    /// By what it follows.
    pub slope: F,
    /// What it follows.
    pub follows: Follows,
    /// The same in the unknowns.
    pub value: Form<F>,
    /// The law.
    pub law: Expr,
    /// The element whose own variables it speaks of.
    pub own: Option<VertexId>,
}

/// Signals of signals are followed so far for a value that is known beforehand.
const DEEPEST_KNOWN: usize = 16;
/// What the numbers of laws that are cut alike are drawn by.
const ALIKE_OFFSET: u64 = 0x6f66_6673;
const ALIKE_SLOPE: u64 = 0x736c_6f70;

/// The equations of a graph.
pub struct Bonds<'g, F> {
    /// The graph.
    pub graph: &'g BondGraph,
    /// The draw.
    pub draw: Draw,
    /// By parameter.
    pub parameters: Vec<F>,
    /// The equations.
    pub system: System<F>,
    /// Where each equation comes from.
    origins: Vec<Place>,
    /// Laws that are cut.
    pub cuts: HashMap<Place, Cut<F>>,
    /// Moduli that are cut, and what to.
    pub moduli: Vec<(Expr, VertexId, F)>,
    /// What is cut alike.
    alike: Alike<F>,
    /// By vertex and port: the unknown that it stores.
    stored: HashMap<End, u32>,
    /// By signal: its unknown. Waveforms have one too, so that a product of two is no number on either side.
    signals: Vec<u32>,
    /// s
    pub s: F,
    /// The domains whose efforts are divided by these factors and whose flows are multiplied, where what is drawn stands
    /// for the unscaled graph.
    scaled: Vec<(Domain, F)>,
}

/// Laws and moduli that have the value of another, or its negative, in a solution: what is one function is cut to one
/// value, so that both may stand in one expression. Each with that value.
#[derive(Clone, Debug)]
pub struct Alike<F> {
    /// Laws.
    pub laws: HashMap<Place, F>,
    /// Moduli of two-ports.
    pub moduli: HashMap<VertexId, F>,
}

/// Whether the ports of a field are inertias whose matrix is constant: coupled inductors hold it.
pub fn constant_inertias(field: &Field) -> bool {
    let inertia = |law: &Law| matches!(law, Law::Store { kind: Storage::Inertia, .. });
    let constant = |expr: &Expr| {
        let mut constant = true;
        expr.leaves(&mut |leaf, _| constant &= matches!(leaf, Leaf::Parameter(_)));
        constant
    };
    field.ports.iter().all(inertia)
        && field.matrix.as_ref().is_some_and(|rows| rows.iter().flatten().all(constant))
}

/// Random values of parameters, those that others define following from these; literals where `literal` says so.
///
/// # Errors
/// What has no value.
pub fn parameters<F: Modular>(
    graph: &BondGraph,
    draw: Draw,
    literal: &[bool],
) -> Result<Vec<F>, Trouble> {
    let count = graph.parameters.len();
    let mut values: Vec<Option<F>> = vec![None; count];
    let reading = Reading { draw, cut: None };
    for first in 0..count {
        let mut open = vec![first];
        while let Some(&k) = open.last() {
            if values[k].is_some() {
                open.pop();
                continue;
            }
            let expr = &graph.parameters[k].expr;
            let (mut others, mut missing) = (0, None);
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Parameter(ParameterId(id)) = leaf {
                    others += 1;
                    if values[*id as usize].is_none() {
                        missing = Some(*id as usize);
                    }
                }
            });
            if literal.get(k) == Some(&true) {
                let value = graph.parameters[k].value;
                values[k] =
                    Some(decimal(value).ok_or_else(|| Trouble::Unknown(value.to_string()))?);
            } else if others == 0 {
                let root: F = draw.of(Of::Parameter(k));
                values[k] = Some(root * root);
            } else if let Some(missing) = missing.filter(|_| open.len() <= count) {
                open.push(missing);
                continue;
            } else {
                values[k] = Some(reading.number(expr, &mut |leaf, _| {
                    match leaf {
                        Leaf::Parameter(ParameterId(id)) => values[*id as usize]
                            .map(Form::number)
                            .ok_or(Trouble::Unknown(graph.parameters[k].name.clone())),
                        _ => Err(Trouble::Nonlinear),
                    }
                })?);
            }
            open.pop();
        }
    }
    Ok(values.into_iter().flatten().collect())
}

impl<'g, F: Modular> Bonds<'g, F> {
    /// The equations of a graph in one draw.
    ///
    /// # Errors
    /// What has no value in it.
    pub fn new(
        graph: &'g BondGraph,
        draw: Draw,
        literal: &[bool],
        alike: Alike<F>,
    ) -> Result<Self, Trouble> {
        Self::drawn(graph, draw, literal, alike, false)
    }

    /// The equations of a scaled graph, what is drawn for its laws and starts being that of the unscaled one.
    ///
    /// # Errors
    /// What has no value in the draw.
    pub fn of_scaled(graph: &'g BondGraph, draw: Draw) -> Result<Self, Trouble> {
        Self::drawn(graph, draw, &[], Alike::default(), true)
    }

    fn drawn(
        graph: &'g BondGraph,
        draw: Draw,
        literal: &[bool],
        alike: Alike<F>,
        unscale: bool,
    ) -> Result<Self, Trouble> {
        let parameters = parameters(graph, draw, literal)?;
        let scales = graph.scales.iter().filter(|_| unscale);
        let scaled = scales
            .filter_map(|scale| Some((scale.domain, *parameters.get(scale.parameter.index())?)));
        let mut bonds = Bonds {
            scaled: scaled.collect(),
            graph,
            draw,
            parameters,
            system: System { unknowns: 2 * graph.bonds.len(), rows: vec![] },
            origins: vec![],
            cuts: HashMap::new(),
            moduli: vec![],
            alike,
            stored: HashMap::new(),
            signals: vec![],
            s: draw.of(Of::S),
        };
        bonds.signals = graph.signals.iter().map(|_| bonds.system.add()).collect();
        for (end, _) in graph.stores() {
            if let Law::Store { law, .. } = graph.law_at(end)
                && !matches!(law, StoreLaw::Linear(size) if bonds.is_number(size))
            {
                let column = bonds.system.add();
                bonds.stored.insert(end, column);
            }
        }
        for id in graph.vertex_ids() {
            bonds.element(id)?;
        }
        for index in 0..graph.signals.len() {
            bonds.signal_rows(SignalId(index as u32))?;
        }
        Ok(bonds)
    }

    fn is_number(&self, expr: &Expr) -> bool {
        let mut constant = true;
        expr.leaves(&mut |leaf, _| constant &= matches!(leaf, Leaf::Parameter(_)));
        constant
    }

    /// The form of a bond's power variable along its half arrow.
    pub fn power(&self, bond: BondId, power: Power) -> Form<F> {
        let of_flow = u32::from(power == Power::Flow);
        Form::unknown(2 * bond.0 + of_flow)
    }

    /// A power variable at a port, the flow counted into the element.
    pub fn at(&self, end: End, power: Power) -> Form<F> {
        let Some(bond) = self.graph.bond_at(end) else { return Form::number(F::ZERO) };
        let form = self.power(bond, power);
        let outward = self.graph.sign_into(bond, end.vertex, end.port) < 0.0;
        if power == Power::Flow && outward { form.times(-F::ONE) } else { form }
    }

    /// What a port stores.
    ///
    /// # Errors
    /// Why it has no form.
    pub fn stored(&self, end: End) -> Result<Form<F>, Trouble> {
        if let Some(column) = self.stored.get(&end) {
            return Ok(Form::unknown(*column));
        }
        match self.graph.law_at(end) {
            Law::Store { kind, law: StoreLaw::Linear(size), .. } => {
                let size = self.constant(size)?;
                Ok(self.at(end, kind.gives()).times(size))
            }
            // What a rate form stores is counted from its start: s·q − q0 = f.
            Law::Rate { kind, .. } => {
                let start = self.start(end, false);
                let integral = self.at(end, kind.integrates()).plus(start, &Form::number(F::ONE));
                Ok(integral.times(F::ONE / self.s))
            }
            _ => Err(Trouble::Unknown(self.graph.port_name(end))),
        }
    }

    /// A signal.
    pub fn signal(&self, id: SignalId) -> Form<F> {
        self.signals.get(id.index()).map_or(Form::number(F::ZERO), |column| Form::unknown(*column))
    }

    /// What a leaf of an expression is.
    ///
    /// # Errors
    /// Why it has no form.
    pub fn leaf(&self, leaf: &Leaf, own: Option<VertexId>) -> Result<Form<F>, Trouble> {
        let nobody = || Trouble::Unknown("an own variable of no element".to_string());
        match leaf {
            Leaf::Parameter(id) => self
                .parameters
                .get(id.index())
                .map(|value| Form::number(*value))
                .ok_or_else(|| Trouble::Unknown(format!("parameter {}", id.0))),
            Leaf::Signal(id) => Ok(self.signal(*id)),
            Leaf::Time => Ok(Form::number(self.draw.of(Of::Time))),
            Leaf::Own(Variable::Power(power)) => {
                Ok(self.at(End::only(own.ok_or_else(nobody)?), *power))
            }
            Leaf::Own(Variable::Stored) => self.stored(End::only(own.ok_or_else(nobody)?)),
            Leaf::Bond { bond, variable, negated } => {
                let form = self.power(*bond, *variable);
                Ok(if *negated { form.times(-F::ONE) } else { form })
            }
            Leaf::Stored(end) => self.stored(*end),
        }
    }

    fn reading(&self) -> Reading<'_, F> {
        Reading { draw: self.draw, cut: None }
    }

    fn form(&self, expr: &Expr, own: Option<VertexId>) -> Result<Form<F>, Trouble> {
        self.reading().form(expr, &mut |leaf, _: Span| self.leaf(leaf, own))
    }

    /// The value of an expression of parameters.
    ///
    /// # Errors
    /// Why it has none.
    pub fn constant(&self, expr: &Expr) -> Result<F, Trouble> {
        self.reading().number(expr, &mut |leaf, _| self.leaf(leaf, None))
    }

    /// An unscaled power variable is the graph's own times this.
    pub fn factor(&self, bond: BondId, power: Power) -> F {
        let domain = self.graph.bond(bond).domain;
        let found = self.scaled.iter().find(|(scaled, _)| *scaled == domain);
        match (found, power) {
            (None, _) => F::ONE,
            (Some((_, factor)), Power::Effort) => *factor,
            (Some((_, factor)), Power::Flow) => F::ONE / *factor,
        }
    }

    fn factor_at(&self, end: End, power: Power) -> F {
        self.graph.bond_at(end).map_or(F::ONE, |bond| self.factor(bond, power))
    }

    /// The same of what a port stores.
    fn factor_of_stored(&self, end: End) -> F {
        self.graph.storage(end).map_or(F::ONE, |kind| self.factor_at(end, kind.integrates()))
    }

    /// The same of what a port's law gives.
    fn factor_of_law(&self, end: End) -> F {
        match self.graph.law_at(end) {
            Law::Source { sets, .. } => self.factor_at(end, *sets),
            Law::Dissipator(Dissipation::Linear(_) | Dissipation::Effort(_)) => {
                self.factor_at(end, Power::Effort)
            }
            Law::Dissipator(Dissipation::Flow(_)) => self.factor_at(end, Power::Flow),
            Law::Store { law: StoreLaw::OfPower(_), .. } => self.factor_of_stored(end),
            Law::Store { kind, .. } | Law::Rate { kind, .. } => self.factor_at(end, kind.gives()),
            Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => F::ONE,
        }
    }

    /// What a storage starts from.
    fn start(&self, end: End, power: bool) -> F {
        let (vertex, port) = (end.vertex.0, end.port);
        match (power, self.graph.storage(end)) {
            (true, kind) => {
                let by = kind.map_or(F::ONE, |kind| self.factor_at(end, kind.gives()));
                self.draw.of::<F>(Of::InitialPower(vertex, port)) / by
            }
            (false, _) => {
                self.draw.of::<F>(Of::InitialStored(vertex, port)) / self.factor_of_stored(end)
            }
        }
    }

    fn row(&mut self, origin: Place, form: Form<F>) {
        self.system.rows.push(form);
        self.origins.push(origin);
    }

    /// The value of an expression of parameters and of signals that nothing but waveforms make, with the functions that
    /// mean nothing in the field: it is known before anything is solved.
    fn known(&self, expr: &Expr, depth: usize) -> Option<F> {
        if depth > DEEPEST_KNOWN {
            return None;
        }
        let leaf = &mut |leaf: &Leaf, _: Span| match leaf {
            Leaf::Parameter(_) | Leaf::Time => self.leaf(leaf, None),
            Leaf::Signal(id) => match &self.graph.signals[id.index()].law {
                SignalLaw::Waveform(_) => Ok(Form::number(self.draw.of(Of::Waveform(id.index())))),
                SignalLaw::Algebraic(law) => {
                    self.known(law, depth + 1).map(Form::number).ok_or(Trouble::Nonlinear)
                }
                _ => Err(Trouble::Nonlinear),
            },
            _ => Err(Trouble::Nonlinear),
        };
        self.reading().number(expr, leaf).ok().filter(|value| !value.is_zero())
    }

    /// The random number of a law or modulus that is cut: its own, or that of all that have its value. What has the
    /// negative value has the negative number.
    fn number(&self, own: Of, alike: Option<F>, which: u64) -> F {
        let Some(value) = alike else { return self.draw.of(own) };
        match value.value() <= (-value).value() {
            true => self.draw.opaque(which, &[value]),
            false => -self.draw.opaque::<F>(which, &[-value]),
        }
    }

    /// The value of a law at a port: its form, or what it is cut to.
    fn law(&mut self, end: End, law: Expr, follows: Follows) -> Result<Form<F>, Trouble> {
        let own = Some(end.vertex);
        match self.form(&law, own) {
            Err(Trouble::Nonlinear) => {}
            found => return found,
        }
        let (vertex, port) = (end.vertex.0, end.port);
        let alike = self.alike.laws.get(&Place::Port(end)).copied();
        let given = self.factor_of_law(end);
        // What is known stays what it is: its text then has its value wherever it stands.
        let known = if follows == Follows::Nothing { self.known(&law, 0) } else { None };
        let drawn = || self.number(Of::Offset(vertex, port), alike, ALIKE_OFFSET) / given;
        let offset = known.unwrap_or_else(drawn);
        let drawn = self.number(Of::Slope(vertex, port), alike, ALIKE_SLOPE) / given;
        let (slope, followed): (F, _) = match follows {
            Follows::Nothing => (F::ZERO, Form::number(F::ZERO)),
            Follows::Stored(end) => (drawn * self.factor_of_stored(end), self.stored(end)?),
            Follows::Port(end, power) => (drawn * self.factor_at(end, power), self.at(end, power)),
        };
        let value = followed.times(slope).plus(offset, &Form::number(F::ONE));
        let cut = Cut { offset, slope, follows, value: value.clone(), law, own };
        self.cuts.insert(Place::Port(end), cut);
        Ok(value)
    }
}

/// What stands for exp(−s·T) of a delay.
pub fn delay_factor<F: Modular>(draw: Draw, by: F) -> F {
    draw.opaque(0x6465_6c61, &[by])
}
