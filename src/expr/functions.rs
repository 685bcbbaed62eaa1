//! The table of functions: name, number of arguments, value, derivative, spelling in each dialect.
//!
//! Derivatives and expansions are small trees over [`Slot`]s, so that the same row serves the graph that
//! differentiates and the printer that spells. Transcendental functions come from `libm` or are our own, never the platform's:
//! the same model gives the same digits everywhere.

use super::tree::{Binary, Expr};
use super::values::{
    atan2, clamp, max, min, modulo, power_of_abs, real_power, sign, signed_power, tanh,
};
use std::f64::consts::{FRAC_PI_2, LN_10, PI};

/// A function that expressions may call; its row in [`FUNCTIONS`] says the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Function {
    Abs,
    /// −1, 0 or 1.
    Sign,
    Sqrt,
    Exp,
    Ln,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Min,
    Max,
    /// `clamp(x, lo, hi)` = min(max(x, lo), hi)
    Clamp,
    Floor,
    /// `mod(x, y)` with the divisor's sign.
    Mod,
    /// `|x|^y` (SPICE's `pow` of ngspice, LTspice's `pwr`).
    PowerOfAbs,
    /// `sign(x)·|x|^y` (ngspice's `pwr`).
    SignedPower,
    /// The real part of x^y: for x < 0, |x|^y·cos(π·y) (`pow` of Xyce and LTspice).
    RealPower,
}

/// The spellings of expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dialect {
    /// Bond-graph files.
    Bond,
    /// Netlists as ngspice 39 reads them by default, and newer ones.
    Ngspice,
    /// Netlists for Xyce: comparisons stand within conditions only.
    Xyce,
    /// Netlists for LTspice: a condition holds above ½, the signs of logic are single.
    Ltspice,
}

/// A leaf of a derivative or an expansion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// An argument of the function, from 0.
    Argument(usize),
    /// The function's value, in derivatives only.
    Result,
}

/// A tree over the arguments of a function.
pub type Template = Expr<Slot>;

/// The value of a function by its number of arguments.
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub enum Value {
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
    Three(fn(f64, f64, f64) -> f64),
}

impl Value {
    /// The number of arguments.
    pub fn arguments(&self) -> usize {
        match self {
            Value::One(_) => 1,
            Value::Two(_) => 2,
            Value::Three(_) => 3,
        }
    }

    /// The value at as many arguments; NaN for another number of them.
    pub fn at(&self, arguments: &[f64]) -> f64 {
        match (self, arguments) {
            (Value::One(f), [a]) => f(*a),
            (Value::Two(f), [a, b]) => f(*a, *b),
            (Value::Three(f), [a, b, c]) => f(*a, *b, *c),
            _ => f64::NAN,
        }
    }
}

/// How a dialect writes a function.
#[derive(Clone, Copy)]
pub enum Spelling {
    /// By this name, with the same arguments.
    Name(&'static str),
    /// By other functions.
    Expansion(fn() -> Template),
}

/// One row of the table.
pub struct Row {
    /// The function.
    pub function: Function,
    /// Its name in `.bg`.
    pub name: &'static str,
    /// Its value; also says how many arguments it has.
    pub value: Value,
    /// Its partial derivative by argument k. Where a function has a corner, the derivative of one side.
    pub derivative: fn(usize) -> Template,
    /// How a netlist writes it: what every simulator of SPICE's family reads alike.
    pub netlist: Spelling,
}

fn a() -> Template {
    Expr::leaf(Slot::Argument(0))
}

fn b() -> Template {
    Expr::leaf(Slot::Argument(1))
}

fn c() -> Template {
    Expr::leaf(Slot::Argument(2))
}

fn y() -> Template {
    Expr::leaf(Slot::Result)
}

fn n(value: f64) -> Template {
    Expr::number(value)
}

fn f(function: Function, argument: Template) -> Template {
    Expr::call(function, vec![argument])
}

fn f2(function: Function, first: Template, second: Template) -> Template {
    Expr::call(function, vec![first, second])
}

fn either(condition: Template, then: Template, otherwise: Template) -> Template {
    Expr::choice(condition, then, otherwise)
}

fn less(left: Template, right: Template) -> Template {
    left.binary(Binary::Less, right)
}

fn is_zero(value: Template) -> Template {
    value.binary(Binary::Equal, n(0.0))
}

/// d/dy of |x|^y and of sign(x)·|x|^y: the value times ln|x|, and its limit 0 at x = 0.
fn by_exponent() -> Template {
    either(is_zero(a()), n(0.0), y() * f(Function::Ln, f(Function::Abs, a())))
}

macro_rules! row {
    ($function:ident, $name:literal, $value:expr, $derivative:expr, $spelling:expr) => {
        Row {
            function: Function::$function,
            name: $name,
            value: $value,
            derivative: $derivative,
            netlist: $spelling,
        }
    };
}

use Spelling::{Expansion, Name};
use Value::{One, Three, Two};

/// Every function, one row each, in the order of [`Function`].
pub const FUNCTIONS: &[Row] = &[
    row!(Abs, "abs", One(f64::abs), |_| f(Function::Sign, a()), Name("abs")),
    row!(Sign, "sign", One(sign), |_| n(0.0), Name("sgn")),
    row!(Sqrt, "sqrt", One(f64::sqrt), |_| n(0.5) / y(), Name("sqrt")),
    row!(Exp, "exp", One(libm::exp), |_| y(), Name("exp")),
    row!(Ln, "ln", One(libm::log), |_| n(1.0) / a(), Name("ln")),
    row!(Log10, "log10", One(libm::log10), |_| n(1.0 / LN_10) / a(), Name("log10")),
    row!(Sin, "sin", One(libm::sin), |_| f(Function::Cos, a()), Name("sin")),
    row!(Cos, "cos", One(libm::cos), |_| -f(Function::Sin, a()), Name("cos")),
    row!(Tan, "tan", One(libm::tan), |_| n(1.0) + y() * y(), Name("tan")),
    row!(
        Asin,
        "asin",
        One(libm::asin),
        |_| n(1.0) / f(Function::Sqrt, (n(1.0) - a()) * (n(1.0) + a())),
        Name("asin")
    ),
    row!(
        Acos,
        "acos",
        One(libm::acos),
        |_| n(-1.0) / f(Function::Sqrt, (n(1.0) - a()) * (n(1.0) + a())),
        Name("acos")
    ),
    row!(Atan, "atan", One(libm::atan), |_| n(1.0) / (n(1.0) + a() * a()), Name("atan")),
    row!(
        Atan2,
        "atan2",
        Two(atan2),
        |k| if k == 0 { b() } else { -a() } / (a() * a() + b() * b()),
        Expansion(atan2_by_atan)
    ),
    row!(Sinh, "sinh", One(libm::sinh), |_| f(Function::Cosh, a()), Name("sinh")),
    row!(Cosh, "cosh", One(libm::cosh), |_| f(Function::Sinh, a()), Name("cosh")),
    row!(Tanh, "tanh", One(tanh), |_| n(1.0) - y() * y(), Name("tanh")),
    row!(
        Asinh,
        "asinh",
        One(libm::asinh),
        |_| n(1.0) / f(Function::Sqrt, a() * a() + n(1.0)),
        Name("asinh")
    ),
    row!(
        Acosh,
        "acosh",
        One(libm::acosh),
        |_| n(1.0) / f(Function::Sqrt, (a() - n(1.0)) * (a() + n(1.0))),
        Name("acosh")
    ),
    row!(
        Atanh,
        "atanh",
        One(libm::atanh),
        |_| n(1.0) / ((n(1.0) - a()) * (n(1.0) + a())),
        Name("atanh")
    ),
    row!(
        Min,
        "min",
        Two(min),
        |k| if k == 0 { less(a(), b()) } else { n(1.0) - less(a(), b()) },
        Name("min")
    ),
    row!(
        Max,
        "max",
        Two(max),
        |k| if k == 0 { n(1.0) - less(a(), b()) } else { less(a(), b()) },
        Name("max")
    ),
    row!(
        Clamp,
        "clamp",
        Three(clamp),
        |k| {
            let above = less(f2(Function::Max, a(), b()), c()); // the upper limit does not hold
            match k {
                0 => either(above, n(1.0) - less(a(), b()), n(0.0)),
                1 => either(above, less(a(), b()), n(0.0)),
                _ => n(1.0) - above,
            }
        },
        Expansion(|| f2(Function::Min, f2(Function::Max, a(), b()), c()))
    ),
    row!(Floor, "floor", One(f64::floor), |_| n(0.0), Name("floor")),
    row!(
        Mod,
        "mod",
        Two(modulo),
        |k| if k == 0 { n(1.0) } else { -f(Function::Floor, a() / b()) },
        Expansion(|| a() - b() * f(Function::Floor, a() / b()))
    ),
    row!(
        PowerOfAbs,
        "abspow",
        Two(power_of_abs),
        |k| {
            if k == 0 { b() * f2(Function::SignedPower, a(), b() - n(1.0)) } else { by_exponent() }
        },
        Expansion(|| f(Function::Exp, b() * f(Function::Ln, f(Function::Abs, a()))))
    ),
    row!(
        SignedPower,
        "signpow",
        Two(signed_power),
        |k| {
            if k == 0 { b() * f2(Function::PowerOfAbs, a(), b() - n(1.0)) } else { by_exponent() }
        },
        Expansion(|| {
            let size = f(Function::Exp, b() * f(Function::Ln, f(Function::Abs, a())));
            f(Function::Sign, a()) * size
        })
    ),
    row!(
        RealPower,
        "realpow",
        Two(real_power),
        |k| {
            if k == 0 {
                return b() * f2(Function::RealPower, a(), b() - n(1.0));
            }
            let turned = f(Function::Exp, b() * f(Function::Ln, f(Function::Abs, a())))
                * f(Function::Sin, n(PI) * b());
            let growth = y() * f(Function::Ln, f(Function::Abs, a()));
            let below = growth.clone() - n(PI) * turned;
            either(is_zero(a()), n(0.0), either(less(a(), n(0.0)), below, growth))
        },
        Expansion(|| {
            let size = f(Function::Exp, b() * f(Function::Ln, f(Function::Abs, a())));
            let turned = size.clone() * f(Function::Cos, n(PI) * b());
            either(less(a(), n(0.0)), turned, size)
        })
    ),
];

impl Function {
    /// Its row of the table.
    pub fn row(self) -> &'static Row {
        &FUNCTIONS[self as usize]
    }
}

/// The name of `.bg` nearest to a wrong one, for a hint.
pub fn nearest(name: &str) -> Option<&'static str> {
    let folded = name.to_lowercase();
    let distance = |row: &&Row| edit_distance(&folded, row.name);
    FUNCTIONS
        .iter()
        .min_by_key(distance)
        .filter(|row| distance(row) <= 1 + name.len() / 4)
        .map(|row| row.name)
}

pub(super) fn edit_distance(left: &str, right: &str) -> usize {
    let right: Vec<char> = right.chars().collect();
    let mut row: Vec<usize> = (0..=right.len()).collect();
    for (i, l) in left.chars().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, r) in right.iter().enumerate() {
            let replaced = corner + usize::from(l != *r);
            corner = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(corner + 1);
        }
    }
    row[right.len()]
}

/// atan2 in all four quadrants; divides by the larger of the two, so that no quotient exceeds 1.
fn atan2_by_atan() -> Template {
    let steep = less(f(Function::Abs, b()), f(Function::Abs, a()));
    let by_steep = f(Function::Sign, a()) * n(FRAC_PI_2) - f(Function::Atan, b() / a());
    let flat = f(Function::Atan, a() / b());
    let behind = flat.clone() + either(less(a(), n(0.0)), n(-PI), n(PI));
    let by_flat = either(less(b(), n(0.0)), behind, either(is_zero(b()), n(0.0), flat));
    either(steep, by_steep, by_flat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rows_stand_in_the_order_of_the_variants() {
        for (k, row) in FUNCTIONS.iter().enumerate() {
            assert_eq!(row.function as usize, k, "{}", row.name);
        }
        assert_eq!(FUNCTIONS.len(), Function::RealPower as usize + 1);
    }

    /// A point where every function is smooth and real.
    fn point(function: Function, u: f64, v: f64, w: f64) -> Vec<f64> {
        match function {
            Function::Asin | Function::Acos | Function::Atanh => vec![0.9 * u],
            Function::Acosh => vec![2.5 + u],
            Function::Sqrt | Function::Ln | Function::Log10 => vec![2.0 + u],
            Function::PowerOfAbs | Function::SignedPower | Function::RealPower => {
                vec![0.1f64.copysign(u) + 2.0 * u, 3.0 * v]
            }
            Function::Mod => vec![5.0 * u, 0.7f64.copysign(v) + v],
            Function::Clamp => vec![2.0 * u, v - 1.0, w + 1.0],
            other => vec![3.0 * u, 3.0 * v][..other.row().value.arguments()].to_vec(),
        }
    }

    /// The derivative by a central difference of sixth order.
    fn difference(function: impl Fn(f64) -> f64, x: f64) -> f64 {
        let h = 1e-3;
        let d = |k: f64| (function(x + k * h) - function(x - k * h)) / h;
        0.75 * d(1.0) - 0.15 * d(2.0) + d(3.0) / 60.0
    }

    fn at(template: &Template, arguments: &[f64], result: f64) -> f64 {
        template.evaluate(&mut |slot| match slot {
            Slot::Argument(k) => arguments[*k],
            Slot::Result => result,
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn derivatives_agree_with_finite_differences(u in -1.0..1.0f64, v in -1.0..1.0f64, w in -1.0..1.0f64) {
            for row in FUNCTIONS {
                let point = point(row.function, u, v, w);
                let result = row.value.at(&point);
                // Points within reach of a corner tell nothing.
                let near = |x: f64, corner: f64| (x - corner).abs() < 5e-3;
                let corner = match row.function {
                    Function::Abs | Function::Sign => near(point[0], 0.0),
                    Function::Min | Function::Max => near(point[0], point[1]),
                    Function::Clamp => near(point[0], point[1]) || near(point[0], point[2]),
                    Function::Floor => near(point[0], point[0].round()),
                    Function::Mod => { let r = point[0] / point[1]; (r - r.round()).abs() < 5e-2 }
                    Function::Tan => near(libm::cos(point[0]).abs(), 0.0) || libm::cos(point[0]).abs() < 0.2,
                    Function::Atan2 => libm::hypot(point[0], point[1]) < 0.2
                        || (point[1] < 0.0 && near(point[0], 0.0)),
                    Function::Asin | Function::Acos => false,
                    _ => false,
                };
                if corner { continue; }
                for k in 0..point.len() {
                    let moved = |x: f64| { let mut p = point.clone(); p[k] = x; row.value.at(&p) };
                    let expected = difference(moved, point[k]);
                    let derivative = at(&(row.derivative)(k), &point, result);
                    // The smallest bases of powers and the ends of asin leave truncation errors.
                    let tolerance = if matches!(row.function, Function::PowerOfAbs | Function::SignedPower) { 1e-4 } else { 1e-7 };
                    prop_assert!((derivative - expected).abs() <= tolerance * (1.0 + expected.abs()),
                        "{} by argument {k} at {point:?}: {derivative} against {expected}", row.name);
                }
            }
        }

        #[test]
        fn expansions_agree_with_values(u in -1.0..1.0f64, v in -1.0..1.0f64, w in -1.0..1.0f64) {
            for row in FUNCTIONS {
                if let Spelling::Expansion(template) = row.netlist {
                    let point = point(row.function, u, v, w);
                    let value = row.value.at(&point);
                    let spelled = at(&template(), &point, f64::NAN);
                    prop_assert!((value - spelled).abs() <= 1e-12 * (1.0 + value.abs()), "{} at {point:?}", row.name);
                }
            }
        }
    }

    #[test]
    fn a_wrong_name_finds_the_nearest() {
        assert_eq!(nearest("sqr"), Some("sqrt"));
        assert_eq!(nearest("Tanh"), Some("tanh"));
        assert_eq!(nearest("frobnicate"), None);
    }
}
