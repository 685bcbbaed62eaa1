//! What the arguments of an element state: which variable of which bond, or quotient of two, each value is.

use super::dimensions::{Dim, SECOND, Walk, own_variable};
use super::scope::Declaration;
use crate::bond::elements::Shape;
use crate::bond::syntax::{self, Argument, Path, Value};
use crate::quantity::{DOMAINS, Dimension, Domain};
use crate::source::Span;
use std::collections::HashMap;
use std::sync::LazyLock;

/// A variable of a bond, or a quotient of variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Clue {
    Effort,
    Flow,
    /// ∫f dt
    Charge,
    /// ∫e dt
    Momentum,
    /// e/f
    Resistance,
    /// q/e
    Compliance,
    /// p/f
    Inertia,
}

const CLUES: [Clue; 7] = [
    Clue::Effort,
    Clue::Flow,
    Clue::Charge,
    Clue::Momentum,
    Clue::Resistance,
    Clue::Compliance,
    Clue::Inertia,
];

/// A set of domains, a bit each.
pub(super) type Mask = u16;

/// The bit of a domain.
pub(super) fn bit(domain: Domain) -> Mask {
    1 << domain as usize
}

/// The domains of a set, in the order of their table.
pub(super) fn domains(mask: Mask) -> impl Iterator<Item = Domain> {
    DOMAINS[1..].iter().map(|row| row.domain).filter(move |domain| mask & bit(*domain) != 0)
}

impl Clue {
    /// The dimension between two ports of these domains; they are the same but within a field.
    pub fn between(self, first: Domain, second: Domain) -> Option<Dimension> {
        let (e, f) = (first.row().effort_dimension, first.row().flow_dimension);
        let (e2, f2) = (second.row().effort_dimension, second.row().flow_dimension);
        match self {
            Clue::Effort => Some(e),
            Clue::Flow => Some(f),
            Clue::Charge => f.times(SECOND),
            Clue::Momentum => e.times(SECOND),
            Clue::Resistance => e.over(f2),
            Clue::Compliance => f.times(SECOND)?.over(e2),
            Clue::Inertia => e.times(SECOND)?.over(f2),
        }
    }

    /// The domains in which it has a dimension.
    pub fn fitting(self, dimension: Dimension) -> Mask {
        static FITTING: LazyLock<HashMap<(Clue, Dimension), Mask>> = LazyLock::new(|| {
            let mut fitting = HashMap::new();
            for clue in CLUES {
                for row in &DOMAINS[1..] {
                    if let Some(dimension) = clue.between(row.domain, row.domain) {
                        *fitting.entry((clue, dimension)).or_insert(0) |= bit(row.domain);
                    }
                }
            }
            fitting
        });
        FITTING.get(&(self, dimension)).copied().unwrap_or(0)
    }
}

/// What a value stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated<'a> {
    pub clue: Clue,
    /// Of which ports, from 0; they differ only within a field's matrix.
    pub ports: (usize, usize),
    /// Whether it is the derivative of it.
    pub rate: bool,
    pub value: Stands<'a>,
    /// What stands before `=`.
    pub label: Option<Span>,
}

/// How a value is written.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stands<'a> {
    Written(&'a syntax::Expr),
    /// Not at all: the parameter or signal of the element's name.
    Implied(&'a syntax::Part),
}

impl Stands<'_> {
    pub fn span(self) -> Span {
        match self {
            Stands::Written(expr) => expr.span,
            Stands::Implied(part) => part.span,
        }
    }

    /// Its expression.
    pub fn expr(self) -> syntax::Expr {
        match self {
            Stands::Written(expr) => expr.clone(),
            Stands::Implied(part) => {
                let path = Path { name: part.clone(), members: vec![], span: part.span };
                syntax::Expr::new(crate::expr::Node::Leaf(syntax::Leaf::Name(path)), part.span)
            }
        }
    }

    /// Its dimension as a whole value.
    pub fn dimension(self, walk: &mut Walk<'_, '_>) -> Dim {
        let dim = match self {
            Stands::Written(expr) => walk.dimension(expr).whole(),
            Stands::Implied(part) => walk.named(part).whole(),
        };
        walk.counts(dim)
    }
}

/// What a value without a label is.
fn plain(shape: Shape) -> Option<Clue> {
    match shape {
        Shape::EffortSource => Some(Clue::Effort),
        Shape::FlowSource => Some(Clue::Flow),
        Shape::Dissipator => Some(Clue::Resistance),
        Shape::Compliance => Some(Clue::Compliance),
        Shape::Inertia => Some(Clue::Inertia),
        _ => None,
    }
}

/// What a value before whose `=` a label stands is, and its port: `e2`, `q0`, `f`.
fn labelled(argument: &Argument) -> Option<(Clue, Option<usize>)> {
    let name = argument.label.as_ref()?.name.text.as_str();
    let (what, port) = match name {
        "e0" | "f0" | "q0" | "p0" => (&name[..1], None),
        // `q2_0` is the initial value of a field's port.
        _ => own_variable(name.strip_suffix("_0").unwrap_or(name))
            .map(|(what, port)| (what, Some(port)))?,
    };
    let clue = match what {
        "e" => Clue::Effort,
        "f" => Clue::Flow,
        "q" => Clue::Charge,
        _ => Clue::Momentum,
    };
    Some((clue, port))
}

/// What a declaration states of its bonds.
pub(super) fn stated<'a>(declaration: &Declaration<'a>, found: &mut Vec<Stated<'a>>) {
    found.clear();
    let shape = declaration.element.shape;
    let arguments = declaration.arguments.unwrap_or(&[]);
    let mut add = |clue, ports, rate, value, label| {
        found.push(Stated { clue, ports, rate, value, label });
    };
    if arguments.is_empty()
        && let Some(clue) = plain(shape)
    {
        add(clue, (0, 0), false, Stands::Implied(declaration.name), None);
    }
    for argument in arguments {
        let label = argument.label.as_ref();
        let (clue, port) = match label {
            None => match plain(shape) {
                Some(clue) => (clue, None),
                None => continue,
            },
            Some(_) => match labelled(argument) {
                Some(found) => found,
                None => continue,
            },
        };
        let rate = label.is_some_and(|label| label.derivative);
        let place = label.map(|label| label.span);
        match &argument.value {
            Value::Expr(value) => {
                let port = port.unwrap_or(0);
                add(clue, (port, port), rate, Stands::Written(value), place);
            }
            Value::Matrix(rows) => {
                for (i, row) in rows.iter().enumerate() {
                    for (j, value) in row.iter().enumerate() {
                        // A list of initial values has one for each port.
                        let ports = if label.is_some() { (j.max(i), j.max(i)) } else { (i, j) };
                        add(clue, ports, rate, Stands::Written(value), place);
                    }
                }
            }
            _ => {}
        }
    }
}

/// The modulus of a two-port, and whether it is a gain.
pub(super) fn modulus<'a>(declaration: &Declaration<'a>) -> Option<(Stands<'a>, bool)> {
    match declaration.arguments.unwrap_or(&[]) {
        [] => Some((Stands::Implied(declaration.name), false)),
        [argument, ..] => {
            let Value::Expr(value) = &argument.value else { return None };
            let gain = argument.label.as_ref().is_some_and(|label| label.name.text == "gain");
            Some((Stands::Written(value), gain))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Unit;

    #[test]
    fn what_units_tell() {
        for (clue, unit, expected) in [
            (Clue::Resistance, "Ohm", vec![Domain::Electrical]),
            (Clue::Compliance, "F", vec![Domain::Electrical]),
            (Clue::Compliance, "H", vec![Domain::Magnetic]),
            (Clue::Inertia, "H", vec![Domain::Electrical]),
            (Clue::Effort, "bar", vec![Domain::Hydraulic, Domain::Pneumatic]),
            (Clue::Effort, "degC", vec![Domain::Thermal, Domain::PseudoThermal]),
            (Clue::Resistance, "K/W", vec![Domain::PseudoThermal]),
            (Clue::Charge, "rad", vec![Domain::Rotation]),
            (Clue::Inertia, "kg", vec![Domain::Translation]),
            (Clue::Resistance, "H", vec![]),
        ] {
            let dimension = Unit::parse(unit).unwrap().dimension;
            let found: Vec<Domain> = domains(clue.fitting(dimension)).collect();
            assert_eq!(found, expected, "{clue:?} in {unit}");
        }
    }

    #[test]
    fn no_two_domains_share_a_resistance_a_compliance_or_an_inertia() {
        for clue in [Clue::Resistance, Clue::Compliance, Clue::Inertia, Clue::Flow] {
            for row in &DOMAINS[1..] {
                let dimension = clue.between(row.domain, row.domain).unwrap();
                assert_eq!(clue.fitting(dimension), bit(row.domain), "{clue:?} {}", row.name);
            }
        }
    }
}
