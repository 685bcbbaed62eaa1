//! What names of functions mean in each dialect of SPICE, one row each, and in `.bg`.
//!
//! A column is empty where the simulator has no such function; the reader then says which name comes nearest. Sources:
//! ngspice 39, src/frontend/inpptree.c and numparam; Xyce's Reference Guide, "Expressions"; LTspice's help, "B. Arbitrary
//! behavioral voltage or current sources". Differences that change results:
//!
//! | | ngspice | Xyce | LTspice |
//! |---|---|---|---|
//! | `log(x)` | natural | base 10 | natural |
//! | `pow(x, y)`, `x**y` | abs(x)^y | real part of x^y | real part of x^y |
//! | `pwr(x, y)` | sgn(x)·abs(x)^y | real part of x^y | abs(x)^y |
//! | `u(0)` | ½ | (`stp(0)`) 0 | 0 |
//! | `if(c, a, b)` holds | c ≠ 0 | c ≠ 0 | c > ½ |
//! | `nint(±0.5)` | to the even number | away from 0 | (`round`) away from 0 |
//! | `atanh` beyond ±1 | NaN | held within ±(1 − 1e-12) | NaN |

use super::functions::{self, Dialect, FUNCTIONS, Function, Slot, Template};
use super::tree::{Binary, Expr};

/// What a name of a dialect's text means.
#[derive(Clone, Copy)]
pub enum Meaning {
    /// The function.
    Function(Function),
    /// A tree over arguments, the first `least` of which must be given.
    Expansion {
        /// How many arguments at least.
        least: usize,
        /// How many at most.
        most: usize,
        /// The tree.
        template: fn() -> Template,
    },
}

impl Meaning {
    /// How many arguments it takes, at least and at most.
    pub fn arguments(&self) -> (usize, usize) {
        match self {
            Meaning::Function(function) => {
                let count = function.row().value.arguments();
                (count, count)
            }
            Meaning::Expansion { least, most, .. } => (*least, *most),
        }
    }
}

/// A name and its meaning in ngspice, Xyce and LTspice.
struct Row {
    name: &'static str,
    means: [Option<Meaning>; 3],
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

fn n(value: f64) -> Template {
    Expr::number(value)
}

fn f(function: Function, arguments: Vec<Template>) -> Template {
    Expr::call(function, arguments)
}

fn above(left: Template, right: Template) -> Template {
    left.binary(Binary::Greater, right)
}

/// sgn(x)·floor(|x|): towards 0.
fn whole() -> Template {
    f(Function::Sign, vec![a()]) * f(Function::Floor, vec![f(Function::Abs, vec![a()])])
}

/// sgn(x)·floor(|x| + ½): halves away from 0.
fn rounded() -> Template {
    f(Function::Sign, vec![a()]) * f(Function::Floor, vec![f(Function::Abs, vec![a()]) + n(0.5)])
}

/// floor(x + ½), one less where x lies halfway and that is odd: halves to the even number.
fn to_even() -> Template {
    let up = || f(Function::Floor, vec![a() + n(0.5)]);
    let halfway = (a() + n(0.5)).binary(Binary::Equal, up());
    up() - halfway * f(Function::Mod, vec![up(), n(2.0)])
}

/// sgn(x)·(|x| mod |y|): the remainder with the sign of x.
fn remainder() -> Template {
    let size = |argument| f(Function::Abs, vec![argument]);
    f(Function::Sign, vec![a()]) * f(Function::Mod, vec![size(a()), size(b())])
}

fn held_atanh() -> Template {
    let most = 1.0 - 1e-12;
    f(Function::Atanh, vec![f(Function::Clamp, vec![a(), n(-most), n(most)])])
}

fn choice() -> Template {
    Expr::choice(a(), b(), c())
}

/// LTspice's conditions hold above ½.
fn choice_above_half() -> Template {
    Expr::choice(above(a(), n(0.5)), b(), c())
}

/// The middle of three.
fn middle() -> Template {
    let low = f(Function::Min, vec![b(), c()]);
    let high = f(Function::Max, vec![b(), c()]);
    f(Function::Clamp, vec![a(), low, high])
}

const fn known(function: Function) -> Option<Meaning> {
    Some(Meaning::Function(function))
}

const fn tree(arguments: usize, template: fn() -> Template) -> Option<Meaning> {
    Some(Meaning::Expansion { least: arguments, most: arguments, template })
}

/// What draws a random number elsewhere and gives its mean here, the first argument, as Xyce does without a sampling analysis.
const fn mean(least: usize, most: usize) -> Option<Meaning> {
    Some(Meaning::Expansion { least, most, template: a })
}

macro_rules! row {
    ($name:literal, $ngspice:expr, $xyce:expr, $ltspice:expr) => {
        Row { name: $name, means: [$ngspice, $xyce, $ltspice] }
    };
}

/// Names whose meanings differ, or that are not those of the table of functions.
#[rustfmt::skip]
const NAMES: &[Row] = &[
    row!("sgn", known(Function::Sign), known(Function::Sign), known(Function::Sign)),
    row!("sign", tree(2, || f(Function::Sign, vec![b()]) * f(Function::Abs, vec![a()])), tree(2, || f(Function::Sign, vec![b()]) * f(Function::Abs, vec![a()])), None),
    row!("log", known(Function::Ln), known(Function::Log10), known(Function::Ln)),
    row!("pow", known(Function::PowerOfAbs), known(Function::RealPower), known(Function::RealPower)),
    row!("pwr", known(Function::SignedPower), known(Function::RealPower), known(Function::PowerOfAbs)),
    row!("pwrs", known(Function::SignedPower), known(Function::SignedPower), known(Function::SignedPower)),
    row!("square", tree(1, || a() * a()), None, tree(1, || a() * a())),
    row!("hypot", None, None, tree(2, || f(Function::Sqrt, vec![a() * a() + b() * b()]))),
    row!("u", tree(1, || n(0.5) * (n(1.0) + f(Function::Sign, vec![a()]))), None, tree(1, || above(a(), n(0.0)))),
    row!("u2", tree(1, || f(Function::Clamp, vec![a(), n(0.0), n(1.0)])), None, None),
    row!("stp", None, tree(1, || above(a(), n(0.0))), None),
    row!("uramp", tree(1, || f(Function::Max, vec![a(), n(0.0)])), tree(1, || f(Function::Max, vec![a(), n(0.0)])), tree(1, || f(Function::Max, vec![a(), n(0.0)]))),
    row!("ceil", tree(1, || -f(Function::Floor, vec![-a()])), tree(1, || -f(Function::Floor, vec![-a()])), tree(1, || -f(Function::Floor, vec![-a()]))),
    row!("int", tree(1, whole), tree(1, whole), tree(1, whole)),
    row!("nint", tree(1, to_even), tree(1, rounded), None),
    row!("round", None, None, tree(1, rounded)),
    row!("fmod", None, tree(2, remainder), tree(2, remainder)),
    row!("buf", None, None, tree(1, || above(a(), n(0.5)))),
    row!("inv", None, None, tree(1, || n(1.0) - above(a(), n(0.5)))),
    row!("arctan", known(Function::Atan), known(Function::Atan), known(Function::Atan)),
    row!("arcsin", None, None, known(Function::Asin)),
    row!("arccos", None, None, known(Function::Acos)),
    row!("atanh", known(Function::Atanh), tree(1, held_atanh), known(Function::Atanh)),
    row!("if", tree(3, choice), tree(3, choice), tree(3, choice_above_half)),
    row!("ternary_fcn", tree(3, choice), None, None),
    row!("limit", tree(3, || f(Function::Clamp, vec![a(), b(), c()])), tree(3, || f(Function::Clamp, vec![a(), b(), c()])), tree(3, middle)),
    row!("m", None, known(Function::Abs), None),
    row!("re", tree(1, a), tree(1, a), tree(1, a)),
    row!("r", None, tree(1, a), None),
    row!("im", tree(1, || n(0.0)), None, tree(1, || n(0.0))),
    row!("img", None, tree(1, || n(0.0)), None),
    row!("db", None, tree(1, || n(20.0) * f(Function::Log10, vec![f(Function::Abs, vec![a()])])), None),
    row!("agauss", None, mean(2, 3), None),
    row!("gauss", None, mean(2, 3), None),
    row!("aunif", None, mean(2, 2), None),
    row!("unif", None, mean(2, 2), None),
    row!("rand", None, tree(0, || n(0.5)), None),
];

/// Names of the table of functions that netlists do not use, or use otherwise; and what they call it.
const BOND_ONLY: &[(&str, &str)] = &[
    ("sign", "sgn"),
    ("clamp", "limit"),
    ("abspow", "pow"),
    ("signpow", "pwrs"),
    ("realpow", "pow"),
];

/// The name in a dialect that is nearest to one that it does not know, for a hint.
pub fn nearest(dialect: Dialect, name: &str) -> Option<&'static str> {
    let folded = name.to_lowercase();
    if dialect == Dialect::Bond {
        return functions::nearest(name);
    }
    let other = BOND_ONLY.iter().find(|(own, _)| *own == folded).map(|(_, other)| *other);
    let own = FUNCTIONS.iter().map(|row| row.name).chain(NAMES.iter().map(|row| row.name));
    let own = own.filter(|own| find(dialect, own).is_some());
    other.filter(|other| find(dialect, other).is_some()).or_else(|| {
        let near = own.map(|own| (functions::edit_distance(&folded, own), own));
        near.filter(|(distance, _)| *distance <= 1 + name.len() / 4).min().map(|(_, own)| own)
    })
}

/// What a name means in a dialect. Netlists fold case; `.bg` files do not.
pub fn find(dialect: Dialect, name: &str) -> Option<Meaning> {
    let in_table = |name: &str| {
        FUNCTIONS.iter().find(|row| row.name == name).map(|row| Meaning::Function(row.function))
    };
    let column = match dialect {
        Dialect::Bond => return in_table(name),
        Dialect::Ngspice => 0,
        Dialect::Xyce => 1,
        Dialect::Ltspice => 2,
    };
    let folded = name.to_lowercase();
    match NAMES.iter().find(|row| row.name == folded) {
        Some(row) => row.means[column],
        None if BOND_ONLY.iter().any(|(own, _)| *own == folded) => None,
        None => in_table(&folded),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(dialect: Dialect, name: &str, arguments: &[f64]) -> Option<f64> {
        Some(match find(dialect, name)? {
            Meaning::Function(function) => function.row().value.at(arguments),
            Meaning::Expansion { template, .. } => template().evaluate(&mut |slot| match slot {
                Slot::Argument(k) => arguments.get(*k).copied().unwrap_or(f64::NAN),
                Slot::Result => f64::NAN,
            }),
        })
    }

    #[test]
    #[rustfmt::skip]
    fn names_have_the_values_of_their_simulators() {
        let all = [Dialect::Ngspice, Dialect::Xyce, Dialect::Ltspice];
        for (name, arguments, expected) in [
            ("log", &[100.0][..], [Some(100f64.ln()), Some(2.0), Some(100f64.ln())]),
            ("pow", &[-2.0, 3.0], [Some(8.0), Some(-8.0), Some(-8.0)]),
            ("pow", &[-1.0, 0.5], [Some(1.0), Some(0.0), Some(0.0)]),
            ("pwr", &[-2.0, 3.0], [Some(-8.0), Some(-8.0), Some(8.0)]),
            ("pwrs", &[-2.0, 2.0], [Some(-4.0), Some(-4.0), Some(-4.0)]),
            ("u", &[0.0], [Some(0.5), None, Some(0.0)]),
            ("stp", &[0.0], [None, Some(0.0), None]),
            ("stp", &[1e-9], [None, Some(1.0), None]),
            ("if", &[0.25, 7.0, 8.0], [Some(7.0), Some(7.0), Some(8.0)]),
            ("nint", &[0.5], [Some(0.0), Some(1.0), None]),
            ("nint", &[2.5], [Some(2.0), Some(3.0), None]),
            ("nint", &[-1.5], [Some(-2.0), Some(-2.0), None]),
            ("nint", &[3.2], [Some(3.0), Some(3.0), None]),
            ("round", &[-2.5], [None, None, Some(-3.0)]),
            ("int", &[-2.7], [Some(-2.0); 3]),
            ("fmod", &[-7.0, 3.0], [None, Some(-1.0), Some(-1.0)]),
            ("sign", &[-3.0, -0.1], [Some(-3.0), Some(-3.0), None]),
            ("limit", &[5.0, 2.0, 1.0], [Some(1.0), Some(1.0), Some(2.0)]),
            ("limit", &[1.5, 2.0, 1.0], [Some(1.0), Some(1.0), Some(1.5)]),
            ("buf", &[0.6], [None, None, Some(1.0)]),
            ("inv", &[0.6], [None, None, Some(0.0)]),
            ("ceil", &[1.2], [Some(2.0); 3]),
            ("agauss", &[3.0, 1.0, 1.0], [None, Some(3.0), None]),
            ("rand", &[], [None, Some(0.5), None]),
            ("m", &[-3.0], [None, Some(3.0), None]),
        ] {
            for (dialect, expected) in all.into_iter().zip(expected) {
                let found = value(dialect, name, arguments);
                let same = match (found, expected) {
                    (Some(found), Some(expected)) => (found - expected).abs() < 1e-15 * expected.abs().max(1.0),
                    (found, expected) => found == expected,
                };
                assert!(same, "{name}{arguments:?} in {dialect:?}: {found:?}, not {expected:?}");
            }
        }
        assert!(value(Dialect::Ngspice, "atanh", &[2.0]).unwrap().is_nan());
        let held = value(Dialect::Xyce, "atanh", &[2.0]).unwrap();
        assert!((held - (1.0 - 1e-12f64).atanh()).abs() < 1e-9 && held.is_finite());
    }

    #[test]
    fn rows_are_unique_and_say_their_arguments() {
        for (k, row) in NAMES.iter().enumerate() {
            assert!(NAMES[..k].iter().all(|other| other.name != row.name), "{}", row.name);
            for meaning in row.means.iter().flatten() {
                let (least, most) = meaning.arguments();
                assert!(least <= most && most <= 3, "{}", row.name);
                if let Meaning::Expansion { template, .. } = meaning {
                    let mut highest = 0;
                    template().leaves(&mut |slot, _| {
                        let Slot::Argument(k) = slot else { panic!("{}", row.name) };
                        highest = highest.max(k + 1);
                    });
                    assert!(highest <= most, "{}", row.name);
                }
            }
        }
    }
}
