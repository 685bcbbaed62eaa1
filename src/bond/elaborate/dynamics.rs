//! Functions with memory: their equations as integrators and formulas, with hidden signals for their states.

use super::functions::{Given, Make, Signature, Sort};
use super::scope::Scope;
use super::value::{Place, varies};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Call, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Expr as Tree, Function, Node};
use crate::source::Span;

/// A call on its way to the law of a signal.
pub(super) struct Maker<'m, 's> {
    scope: &'m mut Scope<'s>,
    /// The signal whose law is being made.
    id: SignalId,
    owner: String,
    statement: usize,
    span: Span,
    d: &'m mut Vec<Diagnostic>,
}

impl Maker<'_, '_> {
    /// The signal itself.
    fn this(&self) -> Expr {
        signal(self.id, self.span)
    }

    /// A hidden signal with the law that `law` makes from the signal itself.
    fn hidden(&mut self, part: &str, law: impl FnOnce(Expr) -> SignalLaw) -> Expr {
        let id = self.scope.hide(&self.owner, part, self.span, self.statement);
        let leaf = signal(id, self.span);
        self.scope.graph.signals[id.index()].law = law(leaf.clone());
        leaf
    }

    /// A state z with tau·z' = x − z.
    fn follower(&mut self, part: &str, x: &Expr, tau: &Expr, initial: Initial) -> Expr {
        let (x, tau) = (x.clone(), tau.clone());
        self.hidden(part, |z| SignalLaw::Integrator { rate: (x - z) / tau, initial })
    }

    fn error(&mut self, message: &str, says: &str, help: &str) {
        self.d.push(Diagnostic::error("E0216", self.span, message).says(says).help(help));
    }
}

fn signal(id: SignalId, span: Span) -> Expr {
    Tree::new(Node::Leaf(Leaf::Signal(id)), span)
}

fn zero() -> Initial {
    Initial::Given(Tree::number(0.0))
}

pub(super) fn integ(_: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let rate = given.take()?;
    Some(SignalLaw::Integrator { rate, initial: given.take().map_or(zero(), Initial::Given) })
}

pub(super) fn lag(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (x, tau) = (given.take()?, given.take()?);
    let initial = given.take().map_or(Initial::Implied, Initial::Given);
    Some(SignalLaw::Integrator { rate: (x - maker.this()) / tau, initial })
}

pub(super) fn leadlag(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (x, lead, lag) = (given.take()?, given.take()?, given.take()?);
    let z = maker.follower("z", &x, &lag, zero());
    Some(SignalLaw::Algebraic(z.clone() + lead * (x - z) / lag))
}

pub(super) fn der(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (x, tau) = (given.take()?, given.take()?);
    let y = maker.this();
    let z = maker.hidden("z", |_| SignalLaw::Integrator { rate: y, initial: Initial::Implied });
    Some(SignalLaw::Algebraic((x - z) / tau))
}

pub(super) fn pi(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let x = given.take()?;
    let (kp, ki) = (given.take(), given.take());
    if kp.is_none() && ki.is_none() {
        let help = "as in `pi(x, Kp = 2, Ki = 10)`";
        maker.error("`pi` has neither `Kp` nor `Ki`", "a regulator without a gain", help);
        return None;
    }
    Some(regulator(maker, x, kp, ki, None, given))
}

pub(super) fn pid(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let x = given.take()?;
    let (kp, ki, kd, tau) = (given.take(), given.take(), given.take(), given.take());
    if kp.is_none() && ki.is_none() && kd.is_none() {
        let help = "as in `pid(x, Kp = 2, Ki = 10, Kd = 0.1, tau = 1 ms)`";
        let message = "`pid` has none of `Kp`, `Ki` and `Kd`";
        maker.error(message, "a regulator without a gain", help);
        return None;
    }
    let differential = match (kd, tau) {
        (None, None) => None,
        (Some(kd), Some(tau)) => {
            let z = maker.follower("d", &x, &tau, Initial::Implied);
            Some(kd * (x.clone() - z) / tau)
        }
        (given, _) => {
            let (message, says) = match given {
                Some(_) => ("`pid` has `Kd` without `tau`", "a derivative needs a time constant"),
                None => ("`pid` has `tau` without `Kd`", "nothing is differentiated"),
            };
            let help = "Kd·s becomes Kd·s/(tau·s + 1): give both, as in `Kd = 0.1, tau = 1 ms`";
            maker.error(message, says, help);
            return None;
        }
    };
    Some(regulator(maker, x, kp, ki, differential, given))
}

/// u = Kp·x + z + differential, y = clamp(u, lo, hi), z' = Ki·x + Kaw·(y − u); what is left of `given` is lo, hi, Kaw
/// and z0.
fn regulator(
    maker: &mut Maker<'_, '_>,
    x: Expr,
    kp: Option<Expr>,
    ki: Option<Expr>,
    differential: Option<Expr>,
    mut given: Given,
) -> SignalLaw {
    let (lo, hi, kaw, z0) = (given.take(), given.take(), given.take(), given.take());
    // The state is made before its law is known, since u holds it.
    let nothing = |_| SignalLaw::Algebraic(Tree::number(0.0));
    let state = ki.is_some().then(|| maker.hidden("z", nothing));
    let proportional = kp.map(|kp| kp * x.clone());
    let terms = [proportional, state.clone(), differential].into_iter().flatten();
    let u = terms.reduce(|sum, term| sum + term).unwrap_or(Tree::number(0.0));
    if let (Some(ki), Some(state)) = (ki, state) {
        let mut rate = ki * x;
        if let (Some(kaw), true) = (kaw, lo.is_some() || hi.is_some()) {
            rate = rate + kaw * (maker.this() - u.clone());
        }
        let initial = z0.map_or(zero(), Initial::Given);
        if let Node::Leaf(Leaf::Signal(id)) = &*state.node {
            let law = SignalLaw::Integrator { rate, initial };
            maker.scope.graph.signals[id.index()].law = law;
        }
    }
    let mut y = match (lo, hi) {
        (Some(lo), Some(hi)) => Tree::call(Function::Clamp, vec![u, lo, hi]),
        (Some(lo), None) => Tree::call(Function::Max, vec![u, lo]),
        (None, Some(hi)) => Tree::call(Function::Min, vec![u, hi]),
        (None, None) => u,
    };
    y.span = maker.span;
    SignalLaw::Algebraic(y)
}

/// duty > carrier: the carrier is a saw tooth from 0 to 1 whose corners the solver lands on, so that the rising edge is
/// exact, and the falling one where the two meet.
pub(super) fn pwm(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (duty, f) = (given.take()?, given.take()?);
    let n = Tree::number;
    let period = || n(1.0) / f.clone();
    let saw = Waveform::Pulse {
        low: n(0.0),
        high: n(1.0),
        delay: n(0.0),
        rise: period(),
        fall: n(0.0),
        width: n(0.0),
        period: period(),
    };
    let carrier = maker.hidden("carrier", |_| SignalLaw::Waveform(saw));
    let mut law = duty.binary(Binary::Greater, carrier);
    law.span = maker.span;
    Some(SignalLaw::Algebraic(law))
}

pub(super) fn delay(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (input, by) = (given.take()?, given.take()?);
    // What is delayed is a signal: its past is remembered as it was, whatever it was made of.
    let input = match &*input.node {
        Node::Leaf(Leaf::Signal(_)) => input,
        _ => maker.hidden("in", |_| SignalLaw::Algebraic(input)),
    };
    Some(SignalLaw::Memory { kind: Memory::Delay { by }, input })
}

pub(super) fn sample(_: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (input, period) = (given.take()?, given.take()?);
    Some(SignalLaw::Memory { kind: Memory::Sample { period }, input })
}

pub(super) fn hysteresis(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (input, low, high) = (given.take()?, given.take()?, given.take()?);
    let mut value = |expr: &Expr| maker.scope.evaluate(expr, "a threshold", expr.span, maker.d);
    if let (Some(below), Some(above)) = (value(&low), value(&high))
        && below >= above
    {
        let message = "`low` of `hysteresis` is not below `high`";
        maker.d.push(
            Diagnostic::error("E0250", maker.span, message)
                .says(format!("`low` is {below}, `high` {above}"))
                .help("its form is `hysteresis(x, low, high)`; `compare(a, b)` has one threshold"),
        );
        return None;
    }
    Some(SignalLaw::Memory { kind: Memory::Hysteresis { low, high }, input })
}

/// What `tau` of `rate` is where nothing says: this part of the run, and for a run of unknown length this many seconds.
const FOLLOWS: f64 = 1e-6;

pub(super) fn rate(maker: &mut Maker<'_, '_>, mut given: Given) -> Option<SignalLaw> {
    let (x, up, down) = (given.take()?, given.take()?, given.take()?);
    let until = maker.scope.graph.experiment.until.unwrap_or(1.0);
    let tau = given.take().unwrap_or(Tree::number(FOLLOWS * until));
    let y = maker.this();
    let z = maker.hidden("z", |z| SignalLaw::Integrator {
        rate: (y - z) / tau.clone(),
        initial: Initial::Implied,
    });
    let ahead = vec![x - z.clone(), -(tau.clone() * down), tau * up];
    Some(SignalLaw::Algebraic(z + Tree::call(Function::Clamp, ahead)))
}

impl Scope<'_> {
    /// The law of a signal that is one call of a waveform or a function with memory.
    pub fn signal_call(
        &mut self,
        id: SignalId,
        call: &Call,
        row: &'static Signature,
        span: Span,
        statement: usize,
        d: &mut Vec<Diagnostic>,
    ) -> Option<SignalLaw> {
        let owner = self.graph.signals[id.index()].name.clone();
        let place = Place::free(&owner, statement);
        match row.make {
            Make::Waveform(make) => {
                let given = self.given(call, row, span, place, d)?;
                make(given).map(SignalLaw::Waveform)
            }
            Make::Points => self.points(call, span, d).map(SignalLaw::Waveform),
            Make::Dynamic(make) => {
                let given = self.given(call, row, span, place, d)?;
                let owner = owner.clone();
                make(&mut Maker { scope: self, id, owner, statement, span, d }, given)
            }
            Make::TransferFunction => {
                let (factors, x) = self.factors(call, row, span, place, d)?;
                let owner = owner.clone();
                let mut maker = Maker { scope: self, id, owner, statement, span, d };
                Some(transfer(&mut maker, &factors, &x))
            }
            Make::Formula(_) | Make::Table => None,
        }
    }

    /// The arguments of a call as expressions, each as its row says; all of them are looked at.
    pub fn given(
        &mut self,
        call: &Call,
        row: &'static Signature,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Given> {
        let arguments = self.arguments(call, row, span, d)?;
        let mut values = vec![];
        let mut failed = false;
        for ((name, sort), value) in row.arguments.iter().zip(arguments) {
            let Some(value) = value else {
                values.push(None);
                continue;
            };
            let what = match row.make {
                Make::Waveform(_) => "a waveform's argument",
                _ => "this argument",
            };
            let lowered = self.argument(name, *sort, value, (place, what), d);
            failed |= lowered.is_none();
            values.push(lowered);
        }
        (!failed).then_some(Given(values.into_iter()))
    }

    fn argument(
        &mut self,
        name: &str,
        sort: Sort,
        value: &syntax::Expr,
        (place, what): (Place<'_>, &'static str),
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let place = match sort {
            Sort::Any | Sort::Above0 => place,
            Sort::Initial => Place::constant("an initial value"),
            Sort::Constant | Sort::Size | Sort::Positive | Sort::Whole => Place::constant(what),
        };
        let lowered = self.lower(value, place, d)?;
        let least = match sort {
            Sort::Above0 if varies(&lowered) => None,
            Sort::Above0 | Sort::Positive => Some(("above 0", f64::MIN_POSITIVE)),
            Sort::Size => Some(("not below 0", 0.0)),
            Sort::Whole => Some(("a whole number from 0 to 2^53", 0.0)),
            Sort::Any | Sort::Constant | Sort::Initial => None,
        };
        const LARGEST: f64 = (1u64 << 53) as f64;
        let broken =
            |number: f64| sort == Sort::Whole && (number.fract() != 0.0 || number > LARGEST);
        if let Some((size, least)) = least
            && let Some(number) = self.evaluate(&lowered, what, value.span, d)
            && (number < least || broken(number))
        {
            d.push(
                Diagnostic::error("E0250", value.span, format!("`{name}` must be {size}"))
                    .says(format!("this is {number}")),
            );
            return None;
        }
        Some(lowered)
    }

    /// The coefficients of a transfer function, and what it is applied to.
    fn factors(
        &mut self,
        call: &Call,
        row: &'static Signature,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<(Factors, Expr)> {
        let form = |span, message: &str, says: &str| {
            let error = Diagnostic::error("E0216", span, message).says(says);
            error.help(format!("its form is `{}`, in descending powers of s", row.form()))
        };
        let arguments = match call.rows.as_slice() {
            [arguments] => arguments.as_slice(),
            _ => &[],
        };
        let [
            Argument { label: None, value: Value::Matrix(numerator), span: above },
            Argument { label: None, value: Value::Matrix(denominator), span: below },
            Argument { label: None, value: Value::Expr(x), .. },
        ] = arguments
        else {
            d.push(form(span, "`tf` takes two lists of coefficients and a signal", ""));
            return None;
        };
        let x = self.lower(x, place, d);
        let mut lists = vec![];
        for (rows, span) in [(numerator, *above), (denominator, *below)] {
            let [list] = rows.as_slice() else {
                d.push(form(span, "the coefficients of `tf` stand in one row", "several rows"));
                return None;
            };
            let mut coefficients = vec![];
            for expr in list {
                let lowered = self.lower(expr, Place::constant("a coefficient"), d)?;
                let value = self.evaluate(&lowered, "a coefficient", expr.span, d)?;
                coefficients.push((lowered, value));
            }
            // Leading zeros say nothing.
            let zeros = coefficients.iter().take_while(|(_, value)| *value == 0.0).count();
            lists.push((coefficients.split_off(zeros), span));
        }
        let (denominator, below) = lists.pop()?;
        let (numerator, above) = lists.pop()?;
        if denominator.is_empty() {
            d.push(form(below, "the denominator of `tf` is 0", "all coefficients are 0"));
            return None;
        }
        if numerator.len() > denominator.len() {
            let degrees = (numerator.len() - 1, denominator.len() - 1);
            d.push(
                form(above, "this transfer function is improper", "the numerator")
                    .label(below, "the denominator")
                    .because(format!(
                        "its numerator is of degree {}, its denominator of degree {}",
                        degrees.0, degrees.1
                    ))
                    .help("it would differentiate its input: give the denominator a fast pole"),
            );
            return None;
        }
        Some((Factors { numerator, denominator }, x?))
    }
}

/// Coefficients in descending powers, each with its value; the first of each list is not 0.
struct Factors {
    numerator: Vec<(Expr, f64)>,
    denominator: Vec<(Expr, f64)>,
}

/// The controllable canonical form, with states scaled to the size of the input:
///
/// ```text
/// x_k' = w_k·x_(k+1),   x_n' = w_n·(u − Σ β_k·x_k),   y = Σ γ_k·x_k + d·u
/// β_k = (a_(k−1)/a_n)/s_k,   γ_k = ((b_(k−1) − d·a_(k−1))/a_n)/s_k,   d = b_n/a_n,   s_k = w_k·…·w_n
/// ```
///
/// The w_k are the slopes of the Newton polygon of the denominator (about the magnitudes of its poles, rising), so that
/// no β_k is above 1 in magnitude, and every corner of the polygon has one of ±1: whatever the coefficients' sizes,
/// the states are of the size of the input.
fn transfer(maker: &mut Maker<'_, '_>, factors: &Factors, u: &Expr) -> SignalLaw {
    let n = factors.denominator.len() - 1;
    let a: Vec<&(Expr, f64)> = factors.denominator.iter().rev().collect();
    let b: Vec<&(Expr, f64)> = factors.numerator.iter().rev().collect();
    let number = Tree::number;
    let literal = |expr: &Expr| expr.as_number().is_some();
    // a ratio of coefficients as written where they hold parameters, else as a number.
    let ratio = |(top, top_value): &(Expr, f64), scale: f64| {
        let (bottom, bottom_value) = a[n];
        let value = top_value / bottom_value / scale;
        let symbolic = !(literal(top) && literal(bottom)) && scale.is_normal();
        if !symbolic {
            return number(value);
        }
        let quotient = match bottom.as_number() {
            Some(1.0) => top.clone(),
            _ => top.clone() / bottom.clone(),
        };
        if scale == 1.0 { quotient } else { quotient / number(scale) }
    };
    let direct = b.get(n).map(|top| ratio(top, 1.0));
    if n == 0 {
        return SignalLaw::Algebraic(direct.unwrap_or(number(0.0)) * u.clone());
    }
    let corners = corner_frequencies(&a.iter().map(|(_, value)| *value).collect::<Vec<_>>());
    let mut scales = vec![1.0; n];
    let mut product = 1.0;
    for k in (0..n).rev() {
        product *= corners[k];
        scales[k] = product;
    }
    let ids: Vec<Expr> = (1..=n)
        .map(|k| maker.hidden(&format!("x{k}"), |_| SignalLaw::Algebraic(number(0.0))))
        .collect();
    let term = |factor: Expr, state: &Expr| match factor.as_number() {
        Some(1.0) => state.clone(),
        _ => factor * state.clone(),
    };
    let mut inner = u.clone();
    let mut y: Option<Expr> = None;
    for k in 0..n {
        if a[k].1 != 0.0 {
            inner = inner - term(ratio(a[k], scales[k]), &ids[k]);
        }
        // b_k − d·a_k, with d = b_n/a_n.
        let above = b.get(k).filter(|(_, value)| *value != 0.0);
        let through = b.get(n).filter(|_| a[k].1 != 0.0);
        let gain = match (above, through) {
            (None, None) => continue,
            (Some(top), None) => ratio(top, scales[k]),
            (top, Some(last)) => {
                let d = last.1 / a[n].1;
                let value = top.map_or(0.0, |top| top.1) - d * a[k].1;
                let symbols = [Some(a[k]), Some(*last), top.copied()];
                if symbols.into_iter().flatten().all(|(expr, _)| literal(expr)) {
                    number(value / a[n].1 / scales[k])
                } else {
                    let part = ratio(last, 1.0) * ratio(a[k], scales[k]);
                    match top {
                        Some(top) => ratio(top, scales[k]) - part,
                        None => part.negate(),
                    }
                }
            }
        };
        let part = term(gain, &ids[k]);
        y = Some(match y {
            Some(sum) => sum + part,
            None => part,
        });
    }
    for k in 0..n {
        let next = if k + 1 < n { ids[k + 1].clone() } else { inner.clone() };
        let rate = term(number(corners[k]), &next);
        if let Node::Leaf(Leaf::Signal(id)) = &*ids[k].node {
            let law = SignalLaw::Integrator { rate, initial: zero() };
            maker.scope.graph.signals[id.index()].law = law;
        }
    }
    let through = direct.map(|d| term(d, u));
    let sum = match (y, through) {
        (Some(y), Some(through)) => y + through,
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => number(0.0),
    };
    SignalLaw::Algebraic(sum)
}

/// For coefficients in *ascending* powers, the last not 0: for each power from 1 to n the slope of the lower hull of
/// −ln|a_k| that leads to it, as a frequency; below the lowest power with a coefficient that of its neighbour, or 1.
fn corner_frequencies(a: &[f64]) -> Vec<f64> {
    let n = a.len() - 1;
    let points: Vec<(usize, f64)> = a
        .iter()
        .enumerate()
        .filter(|(_, value)| **value != 0.0)
        .map(|(k, value)| (k, libm::log(value.abs())))
        .collect();
    // Upper hull of (k, ln|a_k|), from the left; its slopes fall.
    let mut hull: Vec<(usize, f64)> = vec![];
    for point in points {
        while let [.., first, second] = hull.as_slice() {
            let slope = |p: &(usize, f64), q: &(usize, f64)| (q.1 - p.1) / (q.0 - p.0) as f64;
            if slope(second, &point) < slope(first, second) {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    let mut corners = vec![1.0; n];
    for pair in hull.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        // |a_from/a_to|^(1/(to − from)), kept away from the ends of the numbers.
        let ratio = (a[from.0] / a[to.0]).abs().clamp(1e-200, 1e200);
        corners[from.0..to.0].fill(libm::pow(ratio, 1.0 / (to.0 - from.0) as f64));
    }
    if let Some(first) = hull.first()
        && let Some(lowest) = corners.get(first.0).copied()
    {
        corners[..first.0].fill(lowest);
    }
    corners
}
