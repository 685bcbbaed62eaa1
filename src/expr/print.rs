//! Expressions as text: as `.bg` files write them, and as netlists do.
//!
//! Text for netlists must mean the same in every reader and never rest on a sign convention: `^`, `pow` and `pwr`
//! differ between simulators (and between versions of one), so whole powers become products and other powers go
//! through `exp` and `ln`; limits are `min(max())`; tables hold their ends by clamping the argument of `pwl`, which
//! would extrapolate; numbers carry no suffix. Where spellings of one meaning differ, [`Dialect`] decides.

use super::curves::Curve;
use super::functions::{Dialect, Function, Slot, Spelling, Template};
use super::tree::{Binary, Expr, Node, Table, Unary};

/// Whole powers up to this are written as products.
const LONGEST_PRODUCT: u32 = 8;
/// Products of longer text than this are not written out.
const LONGEST_TEXT: usize = 2000;

/// Writes an expression; `leaf` gives the text of a leaf, which must stand as an operand as it is.
///
/// In `.bg` spelling the text reads back as the same tree.
pub fn print<L>(expr: &Expr<L>, dialect: Dialect, leaf: &mut dyn FnMut(&L) -> String) -> String {
    piece(expr, dialect, &mut |name| Piece::atom(leaf(name))).text
}

/// The shortest digits that read back as the same number: plain between 0.001 and a million, else with an exponent.
pub fn number(value: f64) -> String {
    if value.is_nan() {
        return "(0/0)".to_string();
    }
    if value.is_infinite() {
        return if value > 0.0 { "1e999" } else { "-1e999" }.to_string();
    }
    let size = value.abs();
    if size == 0.0 || (1e-3..1e7).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// A text and how tightly its outermost operator binds.
#[derive(Clone, Debug)]
struct Piece {
    text: String,
    level: u8,
}

// Levels, from the loosest; the numbers of `parse::precedence`, but that a sign is written as loosely as a sum, so
// that it stands in brackets within products.
const CONDITIONAL: u8 = 0;
const OR: u8 = 1;
const AND: u8 = 2;
const NOT: u8 = 3;
const COMPARISON: u8 = 4;
const SUM: u8 = 5;
const PRODUCT: u8 = 6;
const POWER: u8 = 8;
const ATOM: u8 = 9;

impl Piece {
    fn atom(text: String) -> Piece {
        Piece { text, level: ATOM }
    }

    fn new(text: String, level: u8) -> Piece {
        Piece { text, level }
    }

    fn number(value: f64) -> Piece {
        let level =
            if value < 0.0 || (value == 0.0 && value.is_sign_negative()) { SUM } else { ATOM };
        Piece { text: number(value), level }
    }

    /// In one pair of brackets.
    fn bracketed(&self) -> String {
        if self.level == ATOM && self.text.starts_with('(') {
            self.text.clone()
        } else {
            format!("({})", self.text)
        }
    }

    /// In brackets unless it binds at least as tightly as `level`.
    fn at(&self, level: u8) -> String {
        if self.level >= level { self.text.clone() } else { format!("({})", self.text) }
    }
}

fn piece<L>(expr: &Expr<L>, dialect: Dialect, leaf: &mut dyn FnMut(&L) -> Piece) -> Piece {
    let spice = dialect != Dialect::Bond;
    match &*expr.node {
        Node::Number(value) => Piece::number(*value),
        Node::Leaf(name) => leaf(name),
        Node::Unary(Unary::Negate, a) => {
            Piece::new(format!("-{}", piece(a, dialect, leaf).at(PRODUCT + 1)), SUM)
        }
        Node::Unary(Unary::Not, a) if !spice => {
            Piece::new(format!("not {}", piece(a, dialect, leaf).at(NOT)), NOT)
        }
        Node::Binary(Binary::Power, a, b) if spice => {
            let (base, exponent) = (piece(a, dialect, leaf), piece(b, dialect, leaf));
            real_power(&base, b.constant(), &exponent, dialect)
        }
        _ if is_condition(expr) && spice => {
            let condition = condition(expr, dialect, leaf);
            match dialect {
                Dialect::Ngspice => condition,
                _ => choice(&condition, &Piece::number(1.0), &Piece::number(0.0), dialect),
            }
        }
        Node::Unary(Unary::Not, a) => piece(a, dialect, leaf),
        Node::Binary(op, a, b) => binary(*op, &piece(a, dialect, leaf), &piece(b, dialect, leaf)),
        Node::Call(function, arguments) => {
            let pieces: Vec<Piece> = arguments.iter().map(|a| piece(a, dialect, leaf)).collect();
            let exponent = arguments.get(1).and_then(Expr::constant);
            call(*function, &pieces, exponent, dialect)
        }
        Node::If(c, a, b) => {
            let c = condition(c, dialect, leaf);
            let a = piece(a, dialect, leaf);
            let b = piece(b, dialect, leaf);
            choice(&c, &a, &b, dialect)
        }
        Node::Table(a, table) => interpolation(&piece(a, dialect, leaf), table, dialect),
    }
}

/// Whether a value is the truth of something.
fn is_condition<L>(expr: &Expr<L>) -> bool {
    match &*expr.node {
        Node::Unary(Unary::Not, _) => true,
        Node::Binary(op, ..) => is_truth(*op),
        _ => false,
    }
}

fn is_truth(op: Binary) -> bool {
    op.is_comparison() || matches!(op, Binary::And | Binary::Or)
}

/// What stands where a condition is asked for. Simulators differ in which numbers are true, so that other than with
/// ngspice a number is compared with zero first.
fn condition<L>(expr: &Expr<L>, dialect: Dialect, leaf: &mut dyn FnMut(&L) -> Piece) -> Piece {
    match (&*expr.node, dialect) {
        (_, Dialect::Bond) => piece(expr, dialect, leaf),
        (Node::Unary(Unary::Not, a), _) => {
            Piece::atom(format!("(!{})", condition(a, dialect, leaf).bracketed()))
        }
        (Node::Binary(op @ (Binary::And | Binary::Or), a, b), _) => {
            let (a, b) = (condition(a, dialect, leaf), condition(b, dialect, leaf));
            compared(*op, &a, &b, dialect)
        }
        (Node::Binary(op, a, b), _) if is_truth(*op) => {
            let (a, b) = (piece(a, dialect, leaf), piece(b, dialect, leaf));
            compared(*op, &a, &b, dialect)
        }
        (_, Dialect::Ngspice) => piece(expr, dialect, leaf),
        _ => Piece::atom(format!("(abs({}) > 0)", piece(expr, dialect, leaf).text)),
    }
}

/// A comparison, or two of them joined, in a netlist. Precedences differ between simulators: brackets everywhere.
fn compared(op: Binary, a: &Piece, b: &Piece, dialect: Dialect) -> Piece {
    let (a, b) = (a.at(PRODUCT), b.at(PRODUCT));
    let sign = match (op, dialect) {
        (Binary::Equal, Dialect::Ltspice) => {
            return Piece::atom(format!("(abs({a}-({b})) <= 0)"));
        }
        (Binary::NotEqual, Dialect::Ltspice) => {
            return Piece::atom(format!("(abs({a}-({b})) > 0)"));
        }
        (Binary::And, Dialect::Ltspice) => " & ",
        (Binary::Or, Dialect::Ltspice) => " | ",
        (Binary::And, _) => " && ",
        (Binary::Or, _) => " || ",
        (op, _) => signs(op).0,
    };
    Piece::atom(format!("({a}{sign}{b})"))
}

/// One of two values.
fn choice(condition: &Piece, then: &Piece, otherwise: &Piece, dialect: Dialect) -> Piece {
    match dialect {
        Dialect::Bond => {
            let (c, a, b) = (condition.at(OR), then.at(OR), &otherwise.text);
            Piece::new(format!("if {c} then {a} else {b}"), CONDITIONAL)
        }
        Dialect::Ngspice => {
            let [c, a, b] = [condition, then, otherwise].map(Piece::bracketed);
            Piece::atom(format!("({c} ? {a} : {b})"))
        }
        Dialect::Xyce | Dialect::Ltspice => {
            let [c, a, b] = [condition, then, otherwise].map(|piece| piece.text.as_str());
            Piece::atom(format!("if({c},{a},{b})"))
        }
    }
}

/// The sign of an operator, its level, and the least levels of its operands.
fn signs(op: Binary) -> (&'static str, u8, u8, u8) {
    match op {
        Binary::Add => ("+", SUM, SUM, SUM + 1),
        Binary::Subtract => ("-", SUM, SUM, SUM + 1),
        Binary::Multiply => ("*", PRODUCT, PRODUCT, PRODUCT + 1),
        Binary::Divide => ("/", PRODUCT, PRODUCT, PRODUCT + 1),
        Binary::Power => ("^", POWER, ATOM, POWER),
        Binary::Less => (" < ", COMPARISON, SUM, SUM),
        Binary::LessEqual => (" <= ", COMPARISON, SUM, SUM),
        Binary::Greater => (" > ", COMPARISON, SUM, SUM),
        Binary::GreaterEqual => (" >= ", COMPARISON, SUM, SUM),
        Binary::Equal => (" == ", COMPARISON, SUM, SUM),
        Binary::NotEqual => (" != ", COMPARISON, SUM, SUM),
        Binary::And => (" and ", AND, AND, NOT),
        Binary::Or => (" or ", OR, OR, AND),
    }
}

fn binary(op: Binary, a: &Piece, b: &Piece) -> Piece {
    let (sign, level, left, right) = signs(op);
    Piece::new(format!("{}{sign}{}", a.at(left), b.at(right)), level)
}

fn call(function: Function, arguments: &[Piece], exponent: Option<f64>, dialect: Dialect) -> Piece {
    let row = function.row();
    let name = match (dialect, row.netlist) {
        (Dialect::Bond, _) => row.name,
        (_, Spelling::Name(name)) => name,
        (_, Spelling::Expansion(template)) => {
            return match (function, arguments) {
                (Function::PowerOfAbs, [base, power]) => {
                    let even = exponent.is_some_and(|y| y % 2.0 == 0.0);
                    let base = if even { base.clone() } else { abs(base) };
                    magnitude_power(&base, exponent, power)
                }
                (Function::SignedPower, [base, power]) => signed_power(base, exponent, power),
                _ => expansion(&template(), arguments, dialect),
            };
        }
    };
    let texts: Vec<&str> = arguments.iter().map(|a| a.text.as_str()).collect();
    Piece::atom(format!(
        "{name}({})",
        texts.join(if dialect == Dialect::Bond { ", " } else { "," })
    ))
}

fn expansion(template: &Template, arguments: &[Piece], dialect: Dialect) -> Piece {
    piece(template, dialect, &mut |slot| match slot {
        Slot::Argument(k) if *k < arguments.len() => arguments[*k].clone(),
        _ => Piece::number(f64::NAN),
    })
}

fn abs(a: &Piece) -> Piece {
    Piece::atom(format!("abs({})", a.text))
}

/// |base|^y, or base^y where the base cannot be negative.
fn magnitude_power(base: &Piece, exponent: Option<f64>, power: &Piece) -> Piece {
    match exponent.and_then(|y| product_power(base, y)) {
        Some(product) => product,
        None => by_logarithm(&abs(base), power),
    }
}

/// The real power, for bases of either sign.
fn real_power(base: &Piece, exponent: Option<f64>, power: &Piece, dialect: Dialect) -> Piece {
    let Some(y) = exponent else {
        // Whole exponents have a sign for negative bases; for others the power is not real anyway.
        let (b, y) = (base.at(PRODUCT), power.at(ATOM));
        let negative = Piece::atom(format!("({b} < 0)"));
        let odd = Piece::new(format!("1-2*({y}-2*floor({y}/2))"), SUM);
        let sign = choice(&negative, &odd, &Piece::number(1.0), dialect);
        return Piece::new(
            format!("{}*{}", sign.text, by_logarithm(&abs(base), power).text),
            PRODUCT,
        );
    };
    if let Some(product) = product_power(base, y) {
        return product;
    }
    if y != y.trunc() {
        return by_logarithm(base, power);
    }
    let size = by_logarithm(&abs(base), power);
    if y % 2.0 == 0.0 {
        size
    } else {
        Piece::new(format!("sgn({})*{}", base.text, size.text), PRODUCT)
    }
}

/// sign(base)·|base|^y
fn signed_power(base: &Piece, exponent: Option<f64>, power: &Piece) -> Piece {
    let odd = exponent.is_some_and(|y| y.abs() % 2.0 == 1.0);
    if odd && let Some(product) = exponent.and_then(|y| product_power(base, y)) {
        return product;
    }
    let size = magnitude_power(&abs(base), exponent, power);
    Piece::new(format!("sgn({})*{}", base.text, size.at(PRODUCT + 1)), PRODUCT)
}

/// b^n by squaring, bracketed as `values::power` multiplies, so that a text read back has the same bits; `None` is 1.
fn whole_product(base: &str, mut exponent: u32) -> Option<String> {
    let join = |a: &str, b: &str| {
        let bracket =
            |part: &str| if part == base { part.to_string() } else { format!("({part})") };
        format!("{}*{}", bracket(a), bracket(b))
    };
    let (mut result, mut square): (Option<String>, _) = (None, base.to_string());
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = Some(result.map_or_else(|| square.clone(), |so_far| join(&so_far, &square)));
        }
        exponent >>= 1;
        if exponent > 0 {
            square = join(&square, &square);
        }
    }
    result
}

/// Small whole and half powers by products and a root.
fn product_power(base: &Piece, y: f64) -> Option<Piece> {
    let whole = y.abs().trunc();
    let half = y.abs() - whole;
    let factors = whole as u32;
    if whole > f64::from(LONGEST_PRODUCT)
        || (half != 0.0 && half != 0.5)
        || (factors > 1 && base.text.len() * factors as usize > LONGEST_TEXT)
    {
        return None;
    }
    let mut parts: Vec<String> = whole_product(&base.at(ATOM), factors).into_iter().collect();
    if half == 0.5 {
        parts.push(format!("sqrt({})", base.text));
    }
    let product = match parts.len() {
        0 => Piece::number(1.0),
        1 => Piece::new(parts.concat(), if factors > 1 { PRODUCT } else { ATOM }),
        _ => Piece::new(parts.join("*"), PRODUCT),
    };
    Some(if y < 0.0 {
        Piece::new(format!("1/{}", product.at(PRODUCT + 1)), PRODUCT)
    } else {
        product
    })
}

fn by_logarithm(base: &Piece, power: &Piece) -> Piece {
    Piece::atom(format!("exp({}*ln({}))", power.at(PRODUCT + 1), base.text))
}

/// A curve as a choice between its cells, halved again and again, each a polynomial.
fn pieces(argument: &Piece, table: &Table, dialect: Dialect) -> Piece {
    let cells = table.cells();
    let (Some(first), Some(last)) = (table.x.first(), table.x.last()) else {
        return Piece::number(f64::NAN);
    };
    let x = &argument.text;
    // Beyond its ends it holds their values.
    let held = format!("min(max({x},{}),{})", number(*first), number(*last));
    fn between(
        held: &str,
        table: &Table,
        cells: &[Vec<f64>],
        from: usize,
        dialect: Dialect,
    ) -> Piece {
        if let [cell] = cells {
            let start = table.x[from];
            let sign = if start < 0.0 { '+' } else { '-' };
            let u = format!("({held}{sign}{})", number(start.abs()));
            let sum = cell.iter().rev().fold(String::new(), |inner, factor| {
                let factor = Piece::number(*factor).at(PRODUCT);
                if inner.is_empty() { factor } else { format!("({factor}+{u}*{inner})") }
            });
            return Piece::atom(sum);
        }
        let middle = cells.len() / 2;
        let limit = number(table.x[from + middle]);
        let condition = match dialect {
            Dialect::Bond => Piece::new(format!("{held} < {limit}"), COMPARISON),
            _ => Piece::atom(format!("({held} < {limit})")),
        };
        let below = between(held, table, &cells[..middle], from, dialect);
        let above = between(held, table, &cells[middle..], from + middle, dialect);
        choice(&condition, &below, &above, dialect)
    }
    match cells.is_empty() {
        true => Piece::number(table.y.first().copied().unwrap_or(f64::NAN)),
        false => between(&held, table, &cells, 0, dialect),
    }
}

fn interpolation(argument: &Piece, table: &Table, dialect: Dialect) -> Piece {
    let (between, after) = if dialect == Dialect::Bond { (", ", "; ") } else { (",", ",") };
    if table.curve != Curve::Lines {
        return pieces(argument, table, dialect);
    }
    let points = table.x.iter().zip(&table.y);
    let rows: Vec<String> =
        points.map(|(x, y)| format!("{}{between}{}", number(*x), number(*y))).collect();
    let rows = rows.join(after);
    match (table.x.first(), table.x.last(), dialect) {
        (_, _, Dialect::Bond) => Piece::atom(format!("table({}, [{rows}])", argument.text)),
        (Some(first), Some(last), Dialect::Ngspice) if first < last => {
            let (x, first, last) = (&argument.text, number(*first), number(*last));
            Piece::atom(format!("pwl(min(max({x},{first}),{last}),{rows})"))
        }
        (Some(first), Some(last), _) if first < last => {
            Piece::atom(format!("table({},{rows})", argument.text))
        }
        _ => Piece::number(table.y.first().copied().unwrap_or(f64::NAN)),
    }
}
