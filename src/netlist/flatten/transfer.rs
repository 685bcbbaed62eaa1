//! LAPLACE: a rational function of s as states, in the controller's canonical form.
//!
//! ```text
//! H(s) = (b0 + b1·s + … + bn·s^n) / (a0 + a1·s + … + an·s^n)
//! x1' = x2, …, x(n−1)' = xn, xn' = (u − a0·x1 − … − a(n−1)·xn)/an
//! y = b0·x1 + … + b(n−1)·xn + bn·xn'
//! ```
//!
//! In an operating point nothing changes: y = b0/a0·u. A factor e^(−T·s) is a delay by T. Anything else that is not
//! rational (a root of s, a table over frequency) is refused.
//!
//! Source: T. Kailath, Linear Systems, 1980, section 2.1.

use super::scope::{self, ScopeId};
use super::values::Lookup;
use crate::circuit::{self, Quantity};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Function, Node, Unary};
use crate::netlist::{Expr, Leaf};
use crate::source::Span;

/// States, at most.
const MOST: usize = 40;

/// A function of s: numerator and denominator, lowest power first, and a delay in s.
#[derive(Clone, Debug, PartialEq)]
struct Rational {
    above: Vec<f64>,
    below: Vec<f64>,
    delay: f64,
}

/// The value of H(s) applied to a law.
pub fn realise(
    lookup: &Lookup,
    id: ScopeId,
    law: circuit::Expr,
    function: &Expr,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<circuit::Expr> {
    let found = match rational(lookup, id, function, d) {
        Ok(found) => found,
        Err(why) => {
            if let Some(why) = why {
                d.push(
                    Diagnostic::error("E0768", span, "this LAPLACE is no rational function of s")
                        .because(why)
                        .help("what can be realised are quotients of polynomials in s, and a delay exp(-T*s)"),
                );
            }
            return None;
        }
    };
    let law = match found.delay == 0.0 {
        true => law,
        false => lookup.quantity(Quantity::Delay { law, by: found.delay }, span),
    };
    let (above, below) = (trimmed(found.above), trimmed(found.below));
    let n = below.len().saturating_sub(1);
    let wrong = if below.is_empty() {
        Some("its denominator is 0".to_string())
    } else if above.len() > below.len() {
        Some(
            "its numerator is of a higher power than its denominator: it differentiates"
                .to_string(),
        )
    } else if n > MOST {
        Some(format!("it needs {n} states, at most {MOST} are taken"))
    } else if above.iter().chain(&below).any(|value| !value.is_finite()) {
        Some("a coefficient is not finite".to_string())
    } else {
        None
    };
    if let Some(why) = wrong {
        d.push(Diagnostic::error("E0768", span, "this LAPLACE cannot be realised").because(why));
        return None;
    }
    let times =
        |factor: f64, e: circuit::Expr| circuit::Expr::number(factor).binary(Binary::Multiply, e);
    let lead = below[n];
    if n == 0 {
        return Some(times(above.first().copied().unwrap_or(0.0) / lead, law));
    }
    // The states are the next n quantities; each speaks of those after it.
    let first = lookup.flat.devices.len() + lookup.flat.quantities.borrow().len();
    let state = |k: usize| {
        circuit::Expr::leaf(circuit::Leaf::Current(circuit::DeviceId((first + k) as u32)))
    };
    let last = (0..n).fold(times(1.0 / lead, law), |sum, k| match below[k] {
        0.0 => sum,
        a => sum.binary(Binary::Subtract, times(a / lead, state(k))),
    });
    for k in 0..n {
        let law = if k + 1 < n { state(k + 1) } else { last.clone() };
        lookup.quantity(Quantity::Integral { law, initial: 0.0, pinned: false }, span);
    }
    let value = (0..n)
        .filter(|k| above.get(*k).is_some_and(|b| *b != 0.0))
        .map(|k| times(above[k], state(k)))
        .chain((above.len() > n).then(|| times(above[n], last.clone())))
        .reduce(|sum, term| sum.binary(Binary::Add, term));
    Some(value.unwrap_or(circuit::Expr::number(0.0)))
}

/// Without the highest powers that vanish.
fn trimmed(mut polynomial: Vec<f64>) -> Vec<f64> {
    while polynomial.last() == Some(&0.0) {
        polynomial.pop();
    }
    polynomial
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            all[i + j] += x * y;
        }
    }
    all
}

fn sum(a: &[f64], b: &[f64], sign: f64) -> Vec<f64> {
    let at = |p: &[f64], k: usize| p.get(k).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|k| at(a, k) + sign * at(b, k)).collect()
}

/// An expression as a rational function of s. An error without words has been reported.
fn rational(
    lookup: &Lookup,
    id: ScopeId,
    expr: &Expr,
    d: &mut Vec<Diagnostic>,
) -> Result<Rational, Option<String>> {
    let number = |value: f64| Rational { above: vec![value], below: vec![1.0], delay: 0.0 };
    let mut speaks_of_s = false;
    expr.leaves(&mut |leaf, _| {
        speaks_of_s |= matches!(leaf, Leaf::Parameter(name) if is_s(lookup, *name));
    });
    if !speaks_of_s {
        return scope::number(&lookup.flat.scopes, id, expr, lookup.names, d)
            .map(number)
            .ok_or(None);
    }
    let mut of = |e: &Expr| rational(lookup, id, e, d);
    Ok(match &*expr.node {
        Node::Leaf(_) => Rational { above: vec![0.0, 1.0], below: vec![1.0], delay: 0.0 },
        Node::Unary(Unary::Negate, a) => {
            let mut a = of(a)?;
            a.above.iter_mut().for_each(|value| *value = -*value);
            a
        }
        Node::Binary(Binary::Add | Binary::Subtract, a, b) => {
            let sign =
                if matches!(&*expr.node, Node::Binary(Binary::Add, ..)) { 1.0 } else { -1.0 };
            let (a, b) = (of(a)?, of(b)?);
            if a.delay != b.delay {
                return Err(Some("a delay stands within a sum".into()));
            }
            let above = match a.below == b.below {
                true => return Ok(Rational { above: sum(&a.above, &b.above, sign), ..a }),
                false => sum(&product(&a.above, &b.below), &product(&b.above, &a.below), sign),
            };
            Rational { above, below: product(&a.below, &b.below), delay: a.delay }
        }
        Node::Binary(Binary::Multiply, a, b) => {
            let (a, b) = (of(a)?, of(b)?);
            Rational {
                above: product(&a.above, &b.above),
                below: product(&a.below, &b.below),
                delay: a.delay + b.delay,
            }
        }
        Node::Binary(Binary::Divide, a, b) => {
            let (a, b) = (of(a)?, of(b)?);
            Rational {
                above: product(&a.above, &b.below),
                below: product(&a.below, &b.above),
                delay: a.delay - b.delay,
            }
        }
        // Powers as any dialect writes them: s is no number that could be negative.
        Node::Binary(Binary::Power, a, b) => power(of(a)?, b)?,
        Node::Call(Function::PowerOfAbs | Function::SignedPower, arguments) => {
            match arguments.as_slice() {
                [a, b] => power(of(a)?, b)?,
                _ => return Err(Some("a power has two arguments".into())),
            }
        }
        Node::Call(Function::Exp, arguments) => {
            let exponent = match arguments.first() {
                Some(exponent) => of(exponent)?,
                None => return Err(Some("an exponent is missing".into())),
            };
            let (above, below) = (trimmed(exponent.above), trimmed(exponent.below));
            match (above.as_slice(), below.as_slice()) {
                ([0.0, slope], [one]) if slope / one <= 0.0 && exponent.delay == 0.0 => {
                    Rational { delay: -slope / one, ..number(1.0) }
                }
                _ => {
                    return Err(Some(
                        "`exp` of s is a delay only as exp(-T*s) with T above 0".into(),
                    ));
                }
            }
        }
        Node::Call(function, _) => {
            return Err(Some(format!("`{}` of s is not rational", function.row().name)));
        }
        _ => return Err(Some("a choice or a table over s is not rational".into())),
    })
    .and_then(|found| match found.delay < 0.0 {
        true => Err(Some("it would know what is to come".into())),
        false => Ok(found),
    })
}

fn power(base: Rational, exponent: &Expr) -> Result<Rational, Option<String>> {
    let Some(n) = exponent.constant().filter(|n| n.trunc() == *n && n.abs() <= MOST as f64) else {
        return Err(Some("a power of s must be a whole number".into()));
    };
    let one = Rational { above: vec![1.0], below: vec![1.0], delay: 0.0 };
    let mut all = (0..n.abs() as usize).fold(one, |all, _| Rational {
        above: product(&all.above, &base.above),
        below: product(&all.below, &base.below),
        delay: all.delay + base.delay,
    });
    if n < 0.0 {
        std::mem::swap(&mut all.above, &mut all.below);
        all.delay = -all.delay;
    }
    Ok(all)
}

fn is_s(lookup: &Lookup, name: crate::netlist::Name) -> bool {
    lookup.names.text(name).eq_ignore_ascii_case("s")
}
