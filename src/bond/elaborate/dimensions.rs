//! Dimensions of expressions, as far as their units tell: the base of domains and of the units of columns.
//!
//! A bare number is dimensionless as a factor, dividend, divisor or exponent; as a whole value its unit is unknown,
//! which agrees with anything. Nothing is checked here.

use super::frames::{Thing, name_alone};
use super::scope::{Meaning, Scope, Valued};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Call, Path, Value};
use crate::expr::{Binary, Function, Node, Unary};
use crate::quantity::{Dimension, Domain};

/// What is known of the dimension of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Dim {
    /// Nothing.
    Unknown,
    /// A bare number, or made of such alone.
    Bare,
    /// This.
    Known(Dimension),
}

pub(super) const SECOND: Dimension = Dimension::new(0, 0, 1, 0, 0);

impl Dim {
    fn of(dimension: Option<Dimension>) -> Dim {
        dimension.map_or(Dim::Unknown, Dim::Known)
    }

    /// As a whole value.
    pub fn whole(self) -> Dim {
        if self == Dim::Bare { Dim::Unknown } else { self }
    }

    /// The dimension, where it is known.
    pub fn known(self) -> Option<Dimension> {
        if let Dim::Known(dimension) = self { Some(dimension) } else { None }
    }

    /// Of a sum, or of two branches.
    fn same(self, other: Dim) -> Dim {
        match (self, other) {
            (Dim::Known(a), _) | (_, Dim::Known(a)) => Dim::Known(a),
            (Dim::Bare, Dim::Bare) => Dim::Bare,
            _ => Dim::Unknown,
        }
    }

    fn times(self, other: Dim) -> Dim {
        match (self, other) {
            (Dim::Unknown, _) | (_, Dim::Unknown) => Dim::Unknown,
            (Dim::Bare, Dim::Bare) => Dim::Bare,
            (Dim::Bare, known) | (known, Dim::Bare) => known,
            (Dim::Known(a), Dim::Known(b)) => Dim::of(a.times(b)),
        }
    }

    fn inverse(self) -> Dim {
        match self {
            Dim::Known(a) => Dim::of(a.power(-1, 1)),
            other => other,
        }
    }

    fn power(self, exponent: Option<f64>) -> Dim {
        let Dim::Known(base) = self else { return self };
        if base.is_none() {
            return self;
        }
        let Some(exponent) = exponent else { return Dim::Unknown };
        for denominator in [1i64, 2, 3, 4, 5, 6, 10] {
            let numerator = exponent * denominator as f64;
            if numerator.fract() == 0.0 && numerator.abs() < 1e4 {
                return Dim::of(base.power(numerator as i64, denominator));
            }
        }
        Dim::Unknown
    }
}

impl Scope<'_> {
    /// Finds the dimensions of parameters, whatever their order.
    pub fn infer_parameter_dimensions(&mut self) {
        // Each round settles at least the parameters whose operands were settled before it.
        for _ in 0..self.parameters.len().min(64) {
            let mut changed = false;
            for k in 0..self.parameters.len() {
                let Some(Valued { value, here, .. }) = self.parameters[k] else { continue };
                let found = self.at(here, |scope| scope.dimension(value, None)).whole();
                if found != Dim::Unknown && self.parameter_dimensions[k] == Dim::Unknown {
                    self.parameter_dimensions[k] = found;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// Finds the dimensions of signals, whatever their order; what drives an input tells the input's.
    pub fn infer_signal_dimensions(&mut self) {
        self.signal_dimensions = vec![Dim::Unknown; self.graph.signals.len()];
        for _ in 0..self.signals.len().min(64) {
            let mut changed = false;
            let mut values: Vec<(usize, Valued<'_>)> = vec![];
            values.extend(
                self.signals.iter().enumerate().filter_map(|(k, valued)| Some((k, (*valued)?))),
            );
            for at in 0..self.drives.len() {
                let (name, valued) = self.drives[at];
                let meaning =
                    self.at(valued.here, |scope| scope.key(name).and_then(|key| scope.value(&key)));
                if let Some(Meaning::Signal(id)) = meaning {
                    values.push((id.index(), valued));
                }
            }
            for (k, valued) in values {
                let dim = self.at(valued.here, |scope| scope.dimension(valued.value, None)).whole();
                if dim != Dim::Unknown && self.signal_dimensions[k] == Dim::Unknown {
                    self.signal_dimensions[k] = dim;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// The dimension of an expression; `own` is the element in whose law it stands.
    pub fn dimension(&self, expr: &syntax::Expr, own: Option<VertexId>) -> Dim {
        let dim = |expr| self.dimension(expr, own);
        match &*expr.node {
            Node::Number(_) => Dim::Bare,
            Node::Leaf(syntax::Leaf::Quantity(_, unit)) => Dim::Known(unit.dimension),
            Node::Leaf(syntax::Leaf::Name(path)) => self.name_dimension(path, own),
            Node::Leaf(syntax::Leaf::Call(call)) => self.call_dimension(call, own),
            Node::Leaf(syntax::Leaf::Sum(sum)) => dim(&sum.term),
            Node::Unary(Unary::Negate, a) => dim(a),
            Node::Unary(Unary::Not, _) => Dim::Known(Dimension::NONE),
            Node::Binary(op, a, b) => match op {
                Binary::Add | Binary::Subtract => dim(a).same(dim(b)),
                Binary::Multiply => dim(a).times(dim(b)),
                Binary::Divide => dim(a).times(dim(b).inverse()),
                Binary::Power => dim(a).power(b.constant()),
                _ => Dim::Known(Dimension::NONE),
            },
            Node::Call(function, arguments) => match (function, arguments.as_slice()) {
                (Function::Abs | Function::Floor | Function::Mod, [a, ..]) => dim(a),
                (Function::Min | Function::Max | Function::Clamp, [a, rest @ ..]) => {
                    rest.iter().fold(dim(a), |known, b| known.same(dim(b)))
                }
                (Function::Sqrt, [a]) => dim(a).power(Some(0.5)),
                (Function::PowerOfAbs | Function::SignedPower, [a, b]) => {
                    dim(a).power(b.constant())
                }
                _ => Dim::Known(Dimension::NONE),
            },
            Node::If(_, a, b) => dim(a).same(dim(b)),
            Node::Table(..) => Dim::Unknown,
        }
    }

    fn name_dimension(&self, path: &Path, own: Option<VertexId>) -> Dim {
        match path.name.text.as_str() {
            "pi" => return Dim::Bare,
            "time" => return Dim::Known(SECOND),
            name @ ("e" | "f" | "q" | "p") => {
                let bond = own.and_then(|id| self.graph.vertex(id).bonds.first());
                return bond.map_or(Dim::Unknown, |bond| self.bond_dimension(name, *bond));
            }
            _ => {}
        }
        match self.look_up_value(path).map(|(meaning, _)| meaning) {
            Some(Meaning::Parameter(id)) => self.parameter_dimensions[id.index()],
            Some(Meaning::Signal(id)) => {
                self.signal_dimensions.get(id.index()).copied().unwrap_or(Dim::Unknown)
            }
            None => Dim::Unknown,
        }
    }

    /// The dimension of a variable of a bond, from its domain.
    pub fn bond_dimension(&self, what: &str, bond: BondId) -> Dim {
        let domain = self.graph.bond(bond).domain;
        if domain == Domain::Any {
            return Dim::Unknown;
        }
        let row = domain.row();
        Dim::of(match what {
            "e" => Some(row.effort_dimension),
            "f" => Some(row.flow_dimension),
            "q" => row.flow_dimension.times(SECOND),
            "p" => row.effort_dimension.times(SECOND),
            _ => row.effort_dimension.times(row.flow_dimension),
        })
    }

    fn call_dimension(&self, call: &Call, own: Option<VertexId>) -> Dim {
        let argument = |name: &str, position: usize| {
            let mut all = call.rows.iter().flatten();
            let labelled = all.clone().find(|argument| {
                argument.label.as_ref().is_some_and(|label| label.name.text == name)
            });
            let found = labelled.or(all.nth(position).filter(|argument| argument.label.is_none()));
            match found.map(|argument| &argument.value) {
                Some(Value::Expr(expr)) => self.dimension(expr, own),
                _ => Dim::Unknown,
            }
        };
        match call.name.text.as_str() {
            what @ ("e" | "f" | "q" | "p" | "power") => {
                self.read_bond(call).map_or(Dim::Unknown, |bond| self.bond_dimension(what, bond))
            }
            "integ" => argument("x", 0).whole().times(Dim::Known(SECOND)),
            "lag" => argument("x", 0).whole(),
            "pi" => {
                let x = argument("x", 0).whole();
                let proportional = x.times(argument("Kp", usize::MAX).whole());
                let integral =
                    x.times(argument("Ki", usize::MAX).whole()).times(Dim::Known(SECOND));
                let limits =
                    argument("lo", usize::MAX).whole().same(argument("hi", usize::MAX).whole());
                proportional.same(integral).same(limits)
            }
            "step" => argument("before", 1).same(argument("after", 2)).whole(),
            "ramp" => argument("slope", 1).whole().times(Dim::Known(SECOND)),
            "pulse" => argument("low", 0).same(argument("high", 1)).whole(),
            "sine" => argument("offset", 0).same(argument("amplitude", 1)).whole(),
            "pwl" => call
                .rows
                .iter()
                .filter_map(|row| match row.get(1).map(|argument| &argument.value) {
                    Some(Value::Expr(y)) => Some(self.dimension(y, own)),
                    _ => None,
                })
                .fold(Dim::Unknown, Dim::same)
                .whole(),
            "coulomb" => argument("F", 1).whole(),
            "check" => argument("e", 0).whole().times(argument("Ron", 1).whole().inverse()),
            "relief" => argument("e", 0).whole().times(argument("Ron", 2).whole().inverse()),
            _ => Dim::Unknown,
        }
    }

    /// The bond that a reading reads, when it can be found without an error.
    fn read_bond(&self, call: &Call) -> Option<BondId> {
        match &call.rows.first()?.first()?.value {
            Value::Bond(from, to) => {
                let (from, to) = (self.look_up(from)?.thing, self.look_up(to)?.thing);
                self.bonds_between(from, to).first().copied()
            }
            Value::Expr(expr) => {
                let found = self.look_up(name_alone(expr)?)?;
                let id = match found.thing {
                    Thing::Vertex(id) => id,
                    Thing::Port(port) => return self.ports[port.0 as usize].bond,
                    Thing::Instance(_) => return None,
                };
                let bonds = &self.graph.vertex(id).bonds;
                let second = found.rest.first().is_some_and(|member| member.text == "2");
                bonds.get(usize::from(second)).copied()
            }
            _ => None,
        }
    }

    /// What the arguments of an element tell of its bond: the dimension of a variable of it, or of a quotient.
    pub fn clues(&self, id: VertexId) -> Vec<(Clue, Dimension)> {
        let declaration = &self.declarations[id.index()];
        let shape = declaration.element.shape;
        let linear = match shape {
            Shape::EffortSource => Clue::Effort,
            Shape::FlowSource => Clue::Flow,
            Shape::Dissipator => Clue::Resistance,
            Shape::Compliance => Clue::Compliance,
            Shape::Inertia => Clue::Inertia,
            _ => return vec![],
        };
        let mut clues = vec![];
        let mut add = |clue, dim: Dim| {
            if let Dim::Known(dimension) = dim.whole() {
                clues.push((clue, dimension));
            }
        };
        let Some(arguments) = declaration.arguments.filter(|arguments| !arguments.is_empty())
        else {
            let meaning = self.key(declaration.name).and_then(|key| self.value(&key));
            if let Some(Meaning::Parameter(parameter)) = meaning {
                add(linear, self.parameter_dimensions[parameter.index()]);
            }
            return clues;
        };
        for argument in arguments {
            let Value::Expr(value) = &argument.value else { continue };
            let dim = self.dimension(value, Some(id));
            let Some(label) = &argument.label else {
                add(linear, dim);
                continue;
            };
            let dim = if label.derivative { dim.whole().times(Dim::Known(SECOND)) } else { dim };
            match label.name.text.as_str() {
                "e" | "e0" => add(Clue::Effort, dim),
                "f" | "f0" => add(Clue::Flow, dim),
                "q" | "q0" => add(Clue::Charge, dim),
                "p" | "p0" => add(Clue::Momentum, dim),
                _ => {}
            }
        }
        clues
    }
}

/// What a dimension is the dimension of.
#[derive(Clone, Copy, Debug)]
pub(super) enum Clue {
    Effort,
    Flow,
    Charge,
    Momentum,
    /// e/f
    Resistance,
    /// q/e
    Compliance,
    /// p/f
    Inertia,
}

impl Clue {
    /// The dimension in a domain.
    pub fn dimension(self, domain: Domain) -> Option<Dimension> {
        let row = domain.row();
        let (e, f) = (row.effort_dimension, row.flow_dimension);
        match self {
            Clue::Effort => Some(e),
            Clue::Flow => Some(f),
            Clue::Charge => f.times(SECOND),
            Clue::Momentum => e.times(SECOND),
            Clue::Resistance => e.over(f),
            Clue::Compliance => f.times(SECOND)?.over(e),
            Clue::Inertia => e.times(SECOND)?.over(f),
        }
    }
}
