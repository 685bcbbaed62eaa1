//! Dimensions of expressions, inferred and checked by one walk.
//!
//! A bare number is dimensionless as a factor, dividend, divisor or exponent; as a whole value its unit is unknown,
//! which agrees with anything and makes products unknown. Where two sides clash the value is unknown, so that one
//! mistake gives one error. How the arguments of a function hang together is a table (`agreements`); what is said of a
//! clash stands in `clashes`.
//!
//! A model without units is unchecked: its bare numbers are unknown wherever they stand, and only a parameter that was
//! given a unit from outside can clash with something in it.

use super::agreements::{Agreement, Form, agreement};
use super::clashes::{Clash, Side};
use super::frames::{Round, Thing, name_alone};
use super::has_units::says_units;
use super::scope::{Meaning, Scope};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Call, Path, Value};
use crate::expr::{Binary, Function, Node, Unary};
use crate::quantity::{Dimension, Domain, Formula, Relations};
use crate::source::Span;

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
    pub(super) fn of(dimension: Option<Dimension>) -> Dim {
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

    pub fn times(self, other: Dim) -> Dim {
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
}

/// The fraction of a constant exponent, as 1/3 and 1.85 are fractions.
fn fraction(exponent: f64) -> Option<(i64, i64)> {
    (1..=100i64).find_map(|denominator| {
        let numerator = exponent * denominator as f64;
        let whole = numerator.round();
        let exact = (numerator - whole).abs() <= 1e-9 && whole.abs() < 1e4;
        exact.then_some((whole as i64, denominator))
    })
}

/// What the dimension of an expression waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Open {
    Parameter(ParameterId),
    Signal(SignalId),
    /// The domain of a bond.
    Bond(BondId),
}

/// A walk over expressions.
pub(super) struct Walk<'w, 'a> {
    pub scope: &'w mut Scope<'a>,
    /// The element in whose law the expression stands.
    pub own: Option<VertexId>,
    /// Whether the model that it stands in has units.
    strict: bool,
    /// Whether a parameter with a unit was met.
    named: bool,
    /// What was met and is not known, where somebody waits for it.
    pub open: Option<Vec<Open>>,
    /// Where clashes go; they are only looked for when there is a place.
    pub clashes: Option<&'w mut Vec<Clash>>,
}

impl<'w, 'a> Walk<'w, 'a> {
    /// A walk that finds dimensions and reports nothing, over expressions that stand where the scope is.
    pub fn new(scope: &'w mut Scope<'a>, own: Option<VertexId>) -> Walk<'w, 'a> {
        let strict = scope.has_units();
        Walk { scope, own, strict, named: false, open: None, clashes: None }
    }

    /// What the dimension of the expression that was walked over is good for: in a model without units nothing follows
    /// from it unless a parameter with a unit takes part.
    pub fn counts(&self, dim: Dim) -> Dim {
        if self.strict || self.named { dim } else { Dim::Unknown }
    }

    /// The dimension of an expression.
    pub fn dimension(&mut self, expr: &syntax::Expr) -> Dim {
        let bare = if self.strict { Dim::Bare } else { Dim::Unknown };
        match &*expr.node {
            Node::Number(_) => bare,
            Node::Leaf(syntax::Leaf::Quantity(_, unit)) => Dim::Known(unit.dimension),
            Node::Leaf(syntax::Leaf::Name(path)) => self.name(path),
            Node::Leaf(syntax::Leaf::Call(call)) => self.call(call, expr),
            Node::Leaf(syntax::Leaf::Sum(sum)) => self.sum(sum),
            Node::Unary(Unary::Negate, a) => self.dimension(a),
            Node::Unary(Unary::Not, a) => {
                self.dimension(a);
                self.pure()
            }
            Node::Binary(op, a, b) => {
                let (x, y) = (self.dimension(a), self.dimension(b));
                self.operation(*op, expr, (a, x), (b, y))
            }
            Node::Call(
                Function::PowerOfAbs | Function::SignedPower | Function::RealPower,
                arguments,
            ) => match arguments.as_slice() {
                [a, b] => {
                    let (x, y) = (self.dimension(a), self.dimension(b));
                    self.operation(Binary::Power, expr, (a, x), (b, y))
                }
                _ => Dim::Unknown,
            },
            Node::Call(function, arguments) => {
                let found: Vec<Dim> = arguments.iter().map(|a| self.dimension(a)).collect();
                if found.iter().all(|dim| *dim == Dim::Bare) {
                    return Dim::Bare;
                }
                let Some(row) = agreement(function.row().name) else { return Dim::Unknown };
                let given: Vec<_> = (0..).zip(arguments).zip(found).collect();
                let given = given.into_iter().map(|((k, a), dim)| (k, a, dim));
                self.agree(row, expr, given.collect())
            }
            Node::If(condition, a, b) => {
                self.dimension(condition);
                let (x, y) = (self.dimension(a), self.dimension(b));
                self.same(expr, (a, x), (b, y), Clash::branches)
            }
            Node::Table(..) => Dim::Unknown,
        }
    }

    /// A pure number.
    fn pure(&self) -> Dim {
        if self.strict { Dim::Known(Dimension::NONE) } else { Dim::Unknown }
    }

    /// Reports a clash, whose value is unknown.
    pub fn clash(&mut self, make: impl FnOnce(&mut Scope<'a>) -> Clash) -> Dim {
        if self.clashes.is_some() {
            let clash = make(self.scope);
            let parameter = |name: &Meaning| matches!(name, Meaning::Parameter(_));
            if let Some(clashes) = &mut self.clashes
                && (self.strict || clash.names.iter().any(parameter))
            {
                clashes.push(clash);
            }
        }
        Dim::Unknown
    }

    /// Two values that must be of one dimension.
    fn same(
        &mut self,
        expr: &syntax::Expr,
        (a, x): (&syntax::Expr, Dim),
        (b, y): (&syntax::Expr, Dim),
        say: impl FnOnce(Span, &Side, &Side) -> Clash,
    ) -> Dim {
        match (x, y) {
            (Dim::Known(p), Dim::Known(q)) if p != q => self.clash(|scope| {
                let (a, b) = (Side::of(scope, a, p), Side::of(scope, b, q));
                say(expr.span, &a, &b).explain(&[&a, &b])
            }),
            (known @ Dim::Known(_), _) | (_, known @ Dim::Known(_)) => known,
            (Dim::Bare, Dim::Bare) => Dim::Bare,
            _ => Dim::Unknown,
        }
    }

    fn operation(
        &mut self,
        op: Binary,
        expr: &syntax::Expr,
        (a, x): (&syntax::Expr, Dim),
        (b, y): (&syntax::Expr, Dim),
    ) -> Dim {
        match op {
            Binary::Add | Binary::Subtract => {
                self.same(expr, (a, x), (b, y), |_, a, b| Clash::sum(op, a, b))
            }
            Binary::Multiply => x.times(y),
            // A reciprocal is one, in models without units too.
            Binary::Divide if a.as_number() == Some(1.0) => y.inverse(),
            Binary::Divide => x.times(y.inverse()),
            Binary::Power => self.power((a, x), (b, y)),
            Binary::And | Binary::Or => self.pure(),
            _ => {
                self.same(expr, (a, x), (b, y), |_, a, b| Clash::comparison(a, b));
                self.pure()
            }
        }
    }

    fn power(
        &mut self,
        (a, base): (&syntax::Expr, Dim),
        (b, exponent): (&syntax::Expr, Dim),
    ) -> Dim {
        if let Dim::Known(found) = exponent
            && !found.is_none()
        {
            return self.clash(|scope| {
                let side = Side::of(scope, b, found);
                Clash::exponent(&side).explain(&[&side])
            });
        }
        let constant = b.constant().and_then(fraction);
        match (base, constant) {
            (Dim::Known(base), Some((n, d))) if !base.is_none() => Dim::of(base.power(n, d)),
            // What the power of a metre with a changing exponent is, nobody can say.
            (Dim::Known(found), None) if !found.is_none() => {
                let varying = self.varies(b);
                if !varying {
                    return Dim::Unknown;
                }
                self.clash(|scope| {
                    let side = Side::of(scope, a, found);
                    Clash::base(&side, b.span).explain(&[&side])
                })
            }
            (Dim::Bare, Some(_)) => Dim::Bare,
            (Dim::Bare | Dim::Known(_), _) => self.pure(),
            (Dim::Unknown, _) => Dim::Unknown,
        }
    }

    /// Whether an expression changes during a run.
    fn varies(&mut self, expr: &syntax::Expr) -> bool {
        let mut varies = false;
        expr.leaves(&mut |leaf, _| {
            varies |= match leaf {
                syntax::Leaf::Quantity(..) | syntax::Leaf::Sum(_) => false,
                syntax::Leaf::Name(path) => {
                    !matches!(self.scope.value_of(path), Some(Meaning::Parameter(_)) | None)
                        || path.text() == "time"
                }
                syntax::Leaf::Call(call) => call.name.text != "table",
            };
        });
        varies
    }

    fn meet(&mut self, what: Open) -> Dim {
        if let Some(open) = &mut self.open {
            open.push(what);
        }
        Dim::Unknown
    }

    fn name(&mut self, path: &Path) -> Dim {
        if path.members.is_empty() && path.name.indices.is_empty() {
            let name = path.name.text.as_str();
            match name {
                "pi" if self.strict => return Dim::Bare,
                "pi" => return Dim::Unknown,
                "time" => return Dim::Known(SECOND),
                _ => {}
            }
            if self.scope.variable(name).is_some() {
                return if self.strict { Dim::Bare } else { Dim::Unknown };
            }
            // Numbered ones are those of a field; elsewhere they are names like others.
            if let Some((what, port)) = own_variable(name)
                && let Some(id) = self.own
                && (name.len() == 1
                    || self.scope.graph.vertex(id).bonds.len() > 1
                    || self.scope.value(name).is_none())
            {
                let bond = self.scope.graph.vertex(id).bonds.get(port).copied();
                return bond.map_or(Dim::Unknown, |bond| self.bond(what, bond));
            }
        }
        let meaning = self.scope.value_of(path);
        self.meaning(meaning)
    }

    /// The dimension of the parameter or signal of an element's name.
    pub fn named(&mut self, part: &syntax::Part) -> Dim {
        let meaning = self.scope.key(part).and_then(|key| self.scope.value(&key));
        self.meaning(meaning)
    }

    fn meaning(&mut self, meaning: Option<Meaning>) -> Dim {
        match meaning {
            Some(Meaning::Parameter(id)) => match self.scope.parameter_dimensions[id.index()] {
                Dim::Unknown => self.meet(Open::Parameter(id)),
                known => {
                    self.named = true;
                    known
                }
            },
            Some(Meaning::Signal(id)) => {
                match self.scope.signal_dimensions.get(id.index()).copied() {
                    None | Some(Dim::Unknown) => self.meet(Open::Signal(id)),
                    Some(known) => known,
                }
            }
            None => Dim::Unknown,
        }
    }

    /// A sum is of the unit of its terms.
    fn sum(&mut self, sum: &syntax::Sum) -> Dim {
        let bound = |walk: &mut Self, expr| walk.scope.integer(expr, "a bound", &mut vec![]);
        let (from, to) = (bound(self, &sum.range.0), bound(self, &sum.range.1));
        let (Some(from), Some(to)) = (from, to) else { return Dim::Unknown };
        let before = self.scope.here;
        let name: std::rc::Rc<str> = sum.variable.text.as_str().into();
        let mut found = Dim::Bare;
        for value in from..=to.min(from.saturating_add(MOST_TERMS)) {
            let top = self.scope.rounds.len();
            self.scope.here.round = Some(top as u32);
            self.scope.rounds.push(Round { name: name.clone(), value, outer: before.round });
            let term = self.dimension(&sum.term);
            let terms = ((&sum.term, found), (&sum.term, term));
            let sides = self.same(&sum.term, terms.0, terms.1, |_, a, b| Clash::terms(value, a, b));
            self.scope.rounds.truncate(top);
            self.scope.here = before;
            let clash = found.known().is_some() && term.known().is_some() && sides == Dim::Unknown;
            if clash {
                return Dim::Unknown;
            }
            found = if value == from { term } else { sides };
        }
        found
    }

    /// A variable of a bond, from its domain.
    pub fn bond(&mut self, what: &str, bond: BondId) -> Dim {
        match self.scope.graph.bond(bond).domain {
            Domain::Any => self.meet(Open::Bond(bond)),
            domain => Dim::of(variable_dimension(what, domain)),
        }
    }

    fn call(&mut self, call: &Call, expr: &syntax::Expr) -> Dim {
        let name = call.name.text.as_str();
        if let "e" | "f" | "q" | "p" | "power" = name {
            return match self.scope.read_bond(call) {
                Some(bond) => self.bond(name, bond),
                None => Dim::Unknown,
            };
        }
        let Some(row) = agreement(name) else { return Dim::Unknown };
        let mut given: Vec<(usize, &syntax::Expr)> = vec![];
        // What the header of a table's file says of its columns.
        let mut columns: Vec<(usize, &syntax::Expr, Dim)> = vec![];
        let mut powers: Vec<i8> = vec![];
        let whole = |argument: &'_ Argument| argument.label.is_none();
        match row.form {
            Form::Plain => {
                for (k, argument) in call.rows.iter().flatten().enumerate() {
                    let at = match &argument.label {
                        None => Some(k),
                        Some(label) => {
                            row.arguments.iter().position(|(name, _)| *name == label.name.text)
                        }
                    };
                    if let (Some(at), Value::Expr(value)) = (at, &argument.value) {
                        given.push((at, value));
                    }
                }
            }
            Form::Rows => {
                for points in &call.rows {
                    for (k, argument) in points.iter().enumerate().filter(|(_, a)| whole(a)) {
                        if let Value::Expr(value) = &argument.value {
                            given.push((k, value));
                        }
                    }
                }
            }
            Form::Table => {
                for (k, argument) in call.rows.iter().flatten().enumerate() {
                    match &argument.value {
                        Value::Expr(value) if k == 0 => given.push((0, value)),
                        Value::Expr(points) => {
                            let units = self.scope.columns_of_file(points).into_iter().flatten();
                            let known = units.enumerate().filter_map(|(k, unit)| Some((k, unit?)));
                            columns.extend(known.map(|(k, unit)| (k, points, Dim::Known(unit))));
                        }
                        Value::Matrix(rows) => {
                            for points in rows {
                                given.extend((0..).zip(points));
                            }
                        }
                        _ => {}
                    }
                }
            }
            Form::Transfer => {
                for (k, argument) in call.rows.iter().flatten().enumerate() {
                    let at = match &argument.label {
                        None => k,
                        Some(label) => row
                            .arguments
                            .iter()
                            .position(|(name, _)| *name == label.name.text)
                            .unwrap_or(usize::MAX),
                    };
                    match &argument.value {
                        Value::Expr(value) => given.push((at, value)),
                        Value::Matrix(rows) => {
                            let count = rows.iter().map(Vec::len).sum::<usize>();
                            for (k, value) in rows.iter().flatten().enumerate() {
                                given.push((at, value));
                                powers.resize(given.len() - 1, 0);
                                powers.push(i8::try_from(count - 1 - k).unwrap_or(0));
                            }
                        }
                        _ => {}
                    }
                }
            }
        }
        powers.resize(given.len(), 0);
        let given = given.into_iter().zip(powers);
        let mut found: Vec<(usize, &syntax::Expr, Dim)> = vec![];
        for ((at, value), power) in given {
            // The coefficient of sⁿ, times sⁿ (in 1/s), is in the units of its polynomial.
            let mut dim = self.dimension(value);
            if power > 0
                && let Dim::Known(known) = dim
            {
                let seconds = SECOND.power(-i64::from(power), 1);
                dim = Dim::of(seconds.and_then(|seconds| known.times(seconds)));
            }
            found.push((at, value, dim));
        }
        found.append(&mut columns);
        if row.form != Form::Plain {
            usual_first(&mut found);
        }
        self.agree(row, expr, found)
    }

    /// The value of a function whose arguments hang together; each with its position in the row.
    fn agree(
        &mut self,
        row: &'static Agreement,
        expr: &syntax::Expr,
        given: Vec<(usize, &syntax::Expr, Dim)>,
    ) -> Dim {
        let mut relations = Relations::default();
        let mut failed = false;
        for (tag, (at, value, dim)) in given.iter().enumerate() {
            let (Dim::Known(found), Some((name, formula))) = (dim, row.arguments.get(*at)) else {
                continue;
            };
            let Err(mut wrong) = relations.insist(*formula, *found, tag) else { continue };
            failed = true;
            // An argument that is of the same unit shows it better than those from which it follows.
            let alike = given[..tag].iter().position(|(at, _, dim)| {
                let same = row.arguments.get(*at).is_some_and(|(_, other)| other == formula);
                same && *dim == Dim::Known(wrong.expected)
            });
            if let Some(alike) = alike.filter(|_| !wrong.with.is_empty()) {
                wrong.with = vec![alike];
            }
            let (given, found) = (&given, *found);
            self.clash(|scope| {
                let side = Side::of(scope, value, found);
                let with = wrong.with.iter().rev().filter_map(|tag| given.get(*tag));
                let with: Vec<Side> = with
                    .filter_map(|(_, value, dim)| Some(Side::of(scope, value, dim.known()?)))
                    .collect();
                let sides: Vec<&Side> = std::iter::once(&side).chain(&with).collect();
                Clash::argument(row, name, expr.span, &sides, wrong.expected).explain(&sides)
            });
        }
        if failed {
            return Dim::Unknown;
        }
        match relations.of(row.result) {
            // The sine of a bare number may be anything in a model without units.
            Some(_)
                if row.result == PURE
                    && !self.strict
                    && given.iter().any(|(_, _, dim)| dim.known().is_none()) =>
            {
                Dim::Unknown
            }
            Some(dimension) => Dim::Known(dimension),
            None => Dim::Unknown,
        }
    }
}

/// Puts first what most values of a column are of, so that one wrong entry is one error.
fn usual_first(found: &mut [(usize, &syntax::Expr, Dim)]) {
    let columns = found.iter().map(|(at, ..)| *at).max().map_or(0, |last| last.min(2) + 1);
    let usual: Vec<Dim> = (0..columns)
        .map(|column| {
            let mut counts: Vec<(Dim, usize)> = vec![];
            for (_, _, dim) in
                found.iter().filter(|(at, _, dim)| *at == column && dim.known().is_some())
            {
                match counts.iter_mut().find(|(known, _)| known == dim) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((*dim, 1)),
                }
            }
            let most = counts.iter().map(|(_, count)| *count).max();
            let first = counts.iter().find(|(_, count)| Some(*count) == most);
            first.map_or(Dim::Unknown, |(dim, _)| *dim)
        })
        .collect();
    found.sort_by_key(|(at, _, dim)| usual.get(*at) != Some(dim));
}

/// Terms of a sum that are looked at.
const MOST_TERMS: i64 = 1000;

const PURE: Formula = Formula { unknowns: [0; 3], seconds: 0 };

/// The element's own variable of a name and its port from 0: `f`, `q2`.
pub(super) fn own_variable(name: &str) -> Option<(&str, usize)> {
    let (what, number) = name.split_at_checked(1)?;
    if !matches!(what, "e" | "f" | "q" | "p") {
        return None;
    }
    match number.is_empty() {
        true => Some((what, 0)),
        false => Some((what, number.parse::<usize>().ok()?.checked_sub(1)?)),
    }
}

/// The dimension of a variable in a domain: e, f, q, p or power.
pub(super) fn variable_dimension(what: &str, domain: Domain) -> Option<Dimension> {
    let row = domain.row();
    match what {
        "e" => Some(row.effort_dimension),
        "f" => Some(row.flow_dimension),
        "q" => row.flow_dimension.times(SECOND),
        "p" => row.effort_dimension.times(SECOND),
        _ => row.effort_dimension.times(row.flow_dimension),
    }
}

impl Scope<'_> {
    /// The dimension of an expression that stands where the scope is; nothing is reported.
    pub fn dimension(&mut self, expr: &syntax::Expr, own: Option<VertexId>) -> Dim {
        Walk::new(self, own).dimension(expr)
    }

    /// The bond that a reading reads, when it can be found without an error.
    pub(super) fn read_bond(&self, call: &Call) -> Option<BondId> {
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
                let port = found.rest.first().and_then(|member| member.text.parse::<usize>().ok());
                bonds.get(port.unwrap_or(1).checked_sub(1)?).copied()
            }
            _ => None,
        }
    }

    /// What a name means among values, without errors.
    pub(super) fn value_of(&self, path: &Path) -> Option<Meaning> {
        self.look_up_value(path).map(|(meaning, _)| meaning)
    }

    /// Whether the model in which names are looked up says any unit.
    pub(super) fn has_units(&self) -> bool {
        let with_units = self.units.by_body.get_or_init(|| {
            self.bodies.iter().map(|body| says_units(body.header, body.statements)).collect()
        });
        with_units.get(self.frame().body).copied().unwrap_or(true)
    }
}
