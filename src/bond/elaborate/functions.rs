//! The table of the functions of the language beyond those of expressions: waveforms, functions with memory, ready laws.
//!
//! Where a law needs more than a formula, its state is a hidden signal: all of them start at 0, except those that take
//! an initial value and those that start at their input's (`lag`, `der`).
//!
//! | function | equations |
//! |---|---|
//! | `integ(x, ic)` | y' = x, y(0) = ic |
//! | `lag(x, tau, ic)` | tau·y' = x − y, y(0) = ic, else x(0) |
//! | `leadlag(x, t_lead, t_lag)` | t_lag·z' = x − z, z(0) = 0, y = z + t_lead·z' |
//! | `der(x, tau)` | tau·z' = x − z, z(0) = x(0), y = z': it starts at 0 |
//! | `pi(x, Kp, Ki, lo, hi, Kaw, z0)` | u = Kp·x + z, y = clamp(u, lo, hi), z' = Ki·x + Kaw·(y − u), z(0) = z0 |
//! | `pid(…, Kd, tau)` | the same with u = Kp·x + z + Kd·der(x, tau) |
//! | `tf([b_m … b_0], [a_n … a_0], x)` | Y/X = (b_m·s^m + … + b_0)/(a_n·s^n + … + a_0), m ≤ n, all states 0 at first |
//! | `delay(x, T)` | y(t) = x(t − T), x(0) before |
//! | `sample(x, T)` | y(t) = x(k·T) for k·T ≤ t < (k + 1)·T, as x is just after k·T |
//! | `rate(x, up, down, tau)` | z' = clamp((x − z)/tau, −down, up), z(0) = x(0), y = z + tau·z': y = x while x moves slowly enough; else y moves by `up` or `down` a second, up to up·tau (down·tau) ahead. Without `tau` a millionth of the run |
//! | `hysteresis(x, low, high)` | 1 from when x rises above `high`, 0 from when it falls below `low`, 0 at first in between |
//! | `noise(seed, rms, dt)` | normal random numbers of mean 0, each held for `dt`: see [`crate::quantity::random`] |
//! | `compare(a, b)` | 1 where a > b, else 0 |
//! | `pwm(duty, f)` | 1 while frac(f·t) < duty, else 0: duty against a saw tooth |

use super::dynamics::{self, Maker};
use crate::bond::graph::{Expr, SignalLaw, Waveform};
use crate::expr::{Binary, Expr as Tree, Function};

/// What an argument may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sort {
    /// Anything.
    Any,
    /// Anything; above 0 where it is made of parameters alone.
    Above0,
    /// Parameters and numbers alone.
    Constant,
    /// The same, not below 0.
    Size,
    /// The same, above 0.
    Positive,
    /// The same, a whole number from 0 to 2^53.
    Whole,
    /// The same: an initial value.
    Initial,
}

use Sort::{Above0, Any, Constant, Initial, Positive, Size, Whole};

/// How a call becomes what it means.
#[derive(Clone, Copy)]
pub(super) enum Make {
    /// A function of time with corners.
    Waveform(fn(Given) -> Option<Waveform>),
    /// `pwl`
    Points,
    /// A function with memory.
    Dynamic(fn(&mut Maker<'_, '_>, Given) -> Option<SignalLaw>),
    /// `tf`
    TransferFunction,
    /// A formula over its arguments.
    Formula(fn(&[Expr]) -> Expr),
    /// `table`
    Table,
}

/// One row of the table.
pub(super) struct Signature {
    /// Its name.
    pub name: &'static str,
    /// The names of its arguments; those after `required` may be left out.
    pub arguments: &'static [(&'static str, Sort)],
    /// How many must be given.
    pub required: usize,
    /// How it is made.
    pub make: Make,
    /// Its form in a message, where the names of its arguments do not say it.
    form: &'static str,
}

const fn row(
    name: &'static str,
    required: usize,
    make: Make,
    arguments: &'static [(&'static str, Sort)],
) -> Signature {
    Signature { name, arguments, required, make, form: "" }
}

const fn special(name: &'static str, make: Make, form: &'static str) -> Signature {
    Signature { name, arguments: &[], required: 0, make, form }
}

/// Every function, one row each.
#[rustfmt::skip]
pub(super) const CALLS: &[Signature] = &[
    row("step", 3, Make::Waveform(step), &[("t0", Constant), ("before", Constant), ("after", Constant)]),
    row("ramp", 2, Make::Waveform(ramp), &[("t0", Constant), ("slope", Constant)]),
    row("pulse", 7, Make::Waveform(pulse), &[("low", Constant), ("high", Constant), ("delay", Constant), ("rise", Size), ("fall", Size), ("width", Size), ("period", Size)]),
    row("sine", 3, Make::Waveform(sine), &[("offset", Constant), ("amplitude", Constant), ("frequency", Constant), ("delay", Constant), ("damping", Constant), ("phase", Constant)]),
    special("pwl", Make::Points, "pwl(t0, y0; t1, y1; …)"),
    row("noise", 3, Make::Waveform(noise), &[("seed", Whole), ("rms", Size), ("dt", Positive)]),
    row("integ", 1, Make::Dynamic(dynamics::integ), &[("x", Any), ("ic", Initial)]),
    row("lag", 2, Make::Dynamic(dynamics::lag), &[("x", Any), ("tau", Above0), ("ic", Initial)]),
    row("leadlag", 3, Make::Dynamic(dynamics::leadlag), &[("x", Any), ("t_lead", Any), ("t_lag", Above0)]),
    row("der", 2, Make::Dynamic(dynamics::der), &[("x", Any), ("tau", Above0)]),
    row("pi", 1, Make::Dynamic(dynamics::pi), &[("x", Any), ("Kp", Any), ("Ki", Any), ("lo", Any), ("hi", Any), ("Kaw", Any), ("z0", Initial)]),
    row("pid", 1, Make::Dynamic(dynamics::pid), &[("x", Any), ("Kp", Any), ("Ki", Any), ("Kd", Any), ("tau", Above0), ("lo", Any), ("hi", Any), ("Kaw", Any), ("z0", Initial)]),
    special("tf", Make::TransferFunction, "tf([b1, b0], [a1, a0], x)"),
    row("delay", 2, Make::Dynamic(dynamics::delay), &[("x", Any), ("T", Positive)]),
    row("sample", 2, Make::Dynamic(dynamics::sample), &[("x", Any), ("T", Positive)]),
    row("rate", 3, Make::Dynamic(dynamics::rate), &[("x", Any), ("up", Above0), ("down", Above0), ("tau", Above0)]),
    row("hysteresis", 3, Make::Dynamic(dynamics::hysteresis), &[("x", Any), ("low", Constant), ("high", Constant)]),
    row("pwm", 2, Make::Dynamic(dynamics::pwm), &[("duty", Any), ("f", Positive)]),
    row("compare", 2, Make::Formula(compare), &[("a", Any), ("b", Any)]),
    row("orifice", 3, Make::Formula(orifice), &[("e", Any), ("C", Any), ("Q0", Any)]),
    row("check", 4, Make::Formula(check), &[("e", Any), ("Ron", Any), ("Roff", Any), ("width", Any)]),
    row("relief", 5, Make::Formula(relief), &[("e", Any), ("limit", Any), ("Ron", Any), ("Roff", Any), ("width", Any)]),
    row("coulomb", 3, Make::Formula(coulomb), &[("f", Any), ("F", Any), ("f_break", Any)]),
    special("table", Make::Table, "table(x, [x0, y0; x1, y1; …]) or table(x, file(\"name.csv\"))"),
];

/// The row of a name.
pub(super) fn find(name: &str) -> Option<&'static Signature> {
    CALLS.iter().find(|row| row.name == name)
}

impl Signature {
    /// As it is called: `lag(x, tau, [ic])`.
    pub fn form(&self) -> String {
        if !self.form.is_empty() {
            return self.form.to_string();
        }
        let names: Vec<String> = self
            .arguments
            .iter()
            .enumerate()
            .map(
                |(k, (name, _))| {
                    if k < self.required { name.to_string() } else { format!("[{name}]") }
                },
            )
            .collect();
        format!("{}({})", self.name, names.join(", "))
    }

    /// Whether its value changes with time of its own.
    pub fn changes(&self) -> bool {
        !matches!(self.make, Make::Formula(_) | Make::Table)
    }
}

/// The values of the arguments in their order; `None` where one is left out.
pub(super) struct Given(pub std::vec::IntoIter<Option<Expr>>);

impl Given {
    /// The next argument.
    pub fn take(&mut self) -> Option<Expr> {
        self.0.next().flatten()
    }

    /// The next argument, 0 where it is left out.
    fn or_zero(&mut self) -> Expr {
        self.take().unwrap_or(Tree::number(0.0))
    }
}

fn step(mut x: Given) -> Option<Waveform> {
    Some(Waveform::Step { at: x.take()?, before: x.take()?, after: x.take()? })
}

fn ramp(mut x: Given) -> Option<Waveform> {
    Some(Waveform::Ramp { at: x.take()?, slope: x.take()? })
}

fn pulse(mut x: Given) -> Option<Waveform> {
    Some(Waveform::Pulse {
        low: x.take()?,
        high: x.take()?,
        delay: x.take()?,
        rise: x.take()?,
        fall: x.take()?,
        width: x.take()?,
        period: x.take()?,
    })
}

fn sine(mut x: Given) -> Option<Waveform> {
    Some(Waveform::Sine {
        offset: x.take()?,
        amplitude: x.take()?,
        frequency: x.take()?,
        delay: x.or_zero(),
        damping: x.or_zero(),
        phase: x.or_zero(),
    })
}

fn noise(mut x: Given) -> Option<Waveform> {
    Some(Waveform::Noise { seed: x.take()?, rms: x.take()?, dt: x.take()? })
}

fn number(value: f64) -> Expr {
    Tree::number(value)
}

fn square(a: Expr) -> Expr {
    a.binary(Binary::Power, number(2.0))
}

fn call(function: Function, a: Expr) -> Expr {
    Tree::call(function, vec![a])
}

fn compare(x: &[Expr]) -> Expr {
    let [a, b] = x else { return number(f64::NAN) };
    a.clone().binary(Binary::Greater, b.clone())
}

/// The exact inverse of Δp = C²·Q·√(Q² + Q0²): Q = √2·y/√(Q0² + √(Q0⁴ + 4y²)) with y = e/C².
fn orifice(x: &[Expr]) -> Expr {
    let [e, c, q0] = x else { return number(f64::NAN) };
    let y = || e.clone() / square(c.clone());
    let fourth = q0.clone().binary(Binary::Power, number(4.0));
    let inner = call(Function::Sqrt, fourth + number(4.0) * square(y()));
    let root = call(Function::Sqrt, square(q0.clone()) + inner);
    number(std::f64::consts::SQRT_2) * y() / root
}

/// Q = e·(1/Roff + (1/Ron − 1/Roff)·(1 + tanh(e/width))/2), open for e > 0.
fn check(x: &[Expr]) -> Expr {
    let [e, on, off, width] = x else { return number(f64::NAN) };
    let one = || number(1.0);
    let opening = (one() + call(Function::Tanh, e.clone() / width.clone())) / number(2.0);
    e.clone() * (one() / off.clone() + (one() / on.clone() - one() / off.clone()) * opening)
}

/// Q = e/Roff + (s(e − limit) − s(−e − limit))/Ron with s(z) = width·ln(1 + exp(z/width)), written as
/// max(z, 0) + width·ln(1 + exp(−|z|/width)), which no z overflows.
fn relief(x: &[Expr]) -> Expr {
    let [e, limit, on, off, width] = x else { return number(f64::NAN) };
    let soft = |z: Expr| {
        let above = Tree::call(Function::Max, vec![z.clone(), number(0.0)]);
        let far = call(Function::Exp, call(Function::Abs, z).negate() / width.clone());
        above + width.clone() * call(Function::Ln, number(1.0) + far)
    };
    let (over, under) = (e.clone() - limit.clone(), e.clone().negate() - limit.clone());
    e.clone() / off.clone() + (soft(over) - soft(under)) / on.clone()
}

/// F·tanh(f/f_break)
fn coulomb(x: &[Expr]) -> Expr {
    let [f, force, at] = x else { return number(f64::NAN) };
    force.clone() * call(Function::Tanh, f.clone() / at.clone())
}
