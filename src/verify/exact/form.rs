//! Affine forms: what an expression comes down to over a field, as long as it is linear in the unknowns.

use super::draw::{Draw, Modular, decimal, square_root};
use super::uncut::Uncut;
use crate::expr::functions::{Slot, Spelling};
use crate::expr::{Binary, Expr, Function, Node, Unary};
use crate::source::Span;
use std::hash::{DefaultHasher, Hash, Hasher};

/// c + Σ a·x
#[derive(Clone, Debug, PartialEq)]
pub struct Form<F> {
    /// c
    pub constant: F,
    /// Unknown and factor, by rising unknowns, no factor 0.
    pub terms: Vec<(u32, F)>,
}

/// Why an expression has no form.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// It divides by what is 0 in this draw.
    Zero,
    /// It is not linear in the unknowns.
    Nonlinear,
    /// It speaks of something that is not there, or holds a number that is none.
    Unknown(String),
}

impl<F: Modular> Form<F> {
    /// A number.
    pub fn number(constant: F) -> Form<F> {
        Form { constant, terms: vec![] }
    }

    /// An unknown.
    pub fn unknown(column: u32) -> Form<F> {
        Form { constant: F::ZERO, terms: vec![(column, F::ONE)] }
    }

    /// Its value when it holds no unknown.
    pub fn as_number(&self) -> Option<F> {
        self.terms.is_empty().then_some(self.constant)
    }

    /// self + factor·other
    pub fn plus(mut self, factor: F, other: &Form<F>) -> Form<F> {
        self.constant = self.constant + factor * other.constant;
        if other.terms.is_empty() || factor.is_zero() {
            return self;
        }
        let mut merged = Vec::with_capacity(self.terms.len() + other.terms.len());
        let mut mine = self.terms.iter().copied().peekable();
        for &(column, a) in &other.terms {
            while let Some(term) = mine.next_if(|term| term.0 < column) {
                merged.push(term);
            }
            let own = mine.next_if(|term| term.0 == column).map_or(F::ZERO, |term| term.1);
            let sum = own + factor * a;
            if !sum.is_zero() {
                merged.push((column, sum));
            }
        }
        merged.extend(mine);
        self.terms = merged;
        self
    }

    /// self − other
    pub fn minus(self, other: &Form<F>) -> Form<F> {
        self.plus(-F::ONE, other)
    }

    /// factor·self
    pub fn times(mut self, factor: F) -> Form<F> {
        self.constant = self.constant * factor;
        self.terms.iter_mut().for_each(|term| term.1 = term.1 * factor);
        if factor.is_zero() {
            self.terms.clear();
        }
        self
    }

    /// Its value at a solution.
    pub fn at(&self, solution: &[F]) -> F {
        self.terms.iter().fold(self.constant, |sum, (column, factor)| {
            sum + *factor * solution.get(*column as usize).copied().unwrap_or(F::ZERO)
        })
    }
}

/// How expressions are read.
#[derive(Clone, Copy)]
pub struct Reading<'a, F> {
    /// The draw, for functions that mean nothing in the field.
    pub draw: Draw,
    /// Values of laws and what they were cut to: where a part of the expression has such a value, it counts as the other.
    pub cut: Option<&'a Uncut<'a, F>>,
}

/// What gives the form of a leaf.
pub type LeafForm<'a, L, F> = &'a mut dyn FnMut(&L, Span) -> Result<Form<F>, Trouble>;

impl<F: Modular> Reading<'_, F> {
    /// The form of an expression.
    ///
    /// # Errors
    /// Why it has none.
    pub fn form<L>(&self, expr: &Expr<L>, leaf: LeafForm<'_, L, F>) -> Result<Form<F>, Trouble> {
        let found = match &*expr.node {
            Node::Number(value) => return number(*value),
            Node::Leaf(name) => return leaf(name, expr.span),
            Node::Unary(Unary::Negate, a) => self.form(a, leaf)?.times(-F::ONE),
            Node::Unary(Unary::Not, a) => self.opaque(&"not", &[self.form(a, leaf)?])?,
            Node::Binary(Binary::Power, a, b) => {
                let exponent = b.constant();
                let (a, b) = (self.form(a, leaf)?, self.form(b, leaf)?);
                self.power(a, b, exponent)?
            }
            Node::Binary(op, a, b) => self.binary(*op, self.form(a, leaf)?, self.form(b, leaf)?)?,
            Node::Call(function, arguments) => {
                let second = arguments.get(1).and_then(Expr::constant);
                let mut forms = Vec::with_capacity(arguments.len());
                for argument in arguments {
                    forms.push(self.form(argument, leaf)?);
                }
                self.call(*function, &forms, second)?
            }
            Node::If(c, a, b) => {
                let forms = [self.form(c, leaf)?, self.form(a, leaf)?, self.form(b, leaf)?];
                self.opaque(&"if", &forms)?
            }
            Node::Table(a, table) => {
                let points: Vec<u64> =
                    table.x.iter().chain(&table.y).map(|value| value.to_bits()).collect();
                let curve = format!("{:?}", table.curve);
                self.opaque(&("table", curve, points), &[self.form(a, leaf)?])?
            }
        };
        Ok(self.uncut(found))
    }

    /// The same where it must be a number.
    ///
    /// # Errors
    /// Why it is none.
    pub fn number<L>(&self, expr: &Expr<L>, leaf: LeafForm<'_, L, F>) -> Result<F, Trouble> {
        self.form(expr, leaf)?.as_number().ok_or(Trouble::Nonlinear)
    }

    fn uncut(&self, found: Form<F>) -> Form<F> {
        match (self.cut, found.as_number()) {
            (Some(cut), Some(value)) => Form::number(cut.of(value)),
            _ => found,
        }
    }

    fn opaque(&self, name: &impl Hash, arguments: &[Form<F>]) -> Result<Form<F>, Trouble> {
        let mut hasher = DefaultHasher::new();
        name.hash(&mut hasher);
        let values: Option<Vec<F>> = arguments.iter().map(Form::as_number).collect();
        let values = values.ok_or(Trouble::Nonlinear)?;
        Ok(Form::number(self.draw.opaque(hasher.finish(), &values)))
    }

    fn binary(&self, op: Binary, a: Form<F>, b: Form<F>) -> Result<Form<F>, Trouble> {
        match op {
            Binary::Add => Ok(a.plus(F::ONE, &b)),
            Binary::Subtract => Ok(a.minus(&b)),
            Binary::Multiply => match (a.as_number(), b.as_number()) {
                (Some(a), _) => Ok(b.times(a)),
                (None, Some(b)) => Ok(a.times(b)),
                (None, None) => Err(Trouble::Nonlinear),
            },
            Binary::Divide => match b.as_number() {
                // Where the divisor is 0 by the structure, as the difference of a source and what it sets, every draw
                // has this quotient: no number, but the same thing on both sides.
                Some(divisor) if divisor.is_zero() && a.as_number().is_some() => {
                    self.opaque(&op, &[a, b])
                }
                Some(b) if b.is_zero() => Err(Trouble::Zero),
                Some(b) => Ok(a.times(F::ONE / b)),
                None => Err(Trouble::Nonlinear),
            },
            // a > b is b < a, a >= b is b <= a.
            Binary::Greater => self.opaque(&Binary::Less, &[b, a]),
            Binary::GreaterEqual => self.opaque(&Binary::LessEqual, &[b, a]),
            op => self.opaque(&op, &[a, b]),
        }
    }

    fn power(
        &self,
        base: Form<F>,
        exponent: Form<F>,
        known: Option<f64>,
    ) -> Result<Form<F>, Trouble> {
        const LARGEST: f64 = 1024.0;
        match (known, base.as_number()) {
            (Some(0.0), _) => Ok(Form::number(F::ONE)),
            (Some(1.0), _) => Ok(base),
            (Some(n), Some(x)) if n.fract() == 0.0 && n.abs() <= LARGEST => {
                let size = x.pow(n.abs() as u64);
                match (n < 0.0, size.is_zero()) {
                    (true, true) => self.opaque(&Binary::Power, &[base, exponent]),
                    (true, false) => Ok(Form::number(F::ONE / size)),
                    (false, _) => Ok(Form::number(size)),
                }
            }
            _ => self.opaque(&Binary::Power, &[base, exponent]),
        }
    }

    fn call(
        &self,
        function: Function,
        arguments: &[Form<F>],
        second: Option<f64>,
    ) -> Result<Form<F>, Trouble> {
        let even = second.is_some_and(|n| n % 2.0 == 0.0);
        let odd = second.is_some_and(|n| n.abs() % 2.0 == 1.0);
        match (function, arguments) {
            (Function::Sqrt, [x]) => {
                x.as_number().map(|x| Form::number(square_root(x))).ok_or(Trouble::Nonlinear)
            }
            (Function::PowerOfAbs, [x, y]) if even => self.power(x.clone(), y.clone(), second),
            (Function::SignedPower | Function::RealPower, [x, y]) if odd => {
                self.power(x.clone(), y.clone(), second)
            }
            (Function::PowerOfAbs | Function::SignedPower | Function::RealPower, _) => {
                self.opaque(&function, arguments)
            }
            _ => match function.row().netlist {
                Spelling::Name(_) => self.opaque(&function, arguments),
                Spelling::Expansion(template) => {
                    self.form(&template(), &mut |slot, _| match slot {
                        Slot::Argument(k) => {
                            arguments.get(*k).cloned().ok_or(Trouble::Unknown(String::new()))
                        }
                        Slot::Result => Err(Trouble::Unknown(String::new())),
                    })
                }
            },
        }
    }
}

fn number<F: Modular>(value: f64) -> Result<Form<F>, Trouble> {
    decimal(value).map(Form::number).ok_or_else(|| Trouble::Unknown(format!("the number {value}")))
}
