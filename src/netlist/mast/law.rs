//! Expressions as MAST computes them: formulas of the four operations and plain functions, and cases by `if`.
//!
//! What chooses between values (conditions, limits, signs, tables) becomes statements of a values section, which set
//! numbered values of their own; of comparisons only `<`, `<=`, `>` and `>=` are used, of logic nothing.

use crate::expr::print::{number, print};
use crate::expr::{self, Binary, Expr, Function, Node, Table, Unary};

/// What stands at a leaf: a text that is an operand as it is.
pub type Formula = Expr<String>;

/// A statement of a values section.
#[derive(Clone, Debug)]
pub enum Statement {
    /// `name = formula`
    Set(String, String),
    /// `if (condition) { … } else { … }`
    Cases(String, Vec<Statement>, Vec<Statement>),
}

/// Whether MAST, as far as it is known, can compute an expression: it has no sure word for the whole part of a
/// number, and with it none for whether an exponent is odd.
pub fn sayable<L>(expr: &Expr<L>) -> bool {
    match &*expr.node {
        Node::Number(_) | Node::Leaf(_) => true,
        Node::Unary(_, a) | Node::Table(a, _) => sayable(a),
        Node::Binary(Binary::Power, a, b) => {
            let plain = b.constant().is_some() || a.constant().is_some_and(|a| a > 0.0);
            plain && sayable(a) && sayable(b)
        }
        Node::Binary(_, a, b) => sayable(a) && sayable(b),
        Node::Call(Function::Floor | Function::Mod, _) => false,
        Node::Call(_, arguments) => arguments.iter().all(sayable),
        Node::If(c, a, b) => sayable(c) && sayable(a) && sayable(b),
    }
}

/// Turns expressions into formulas and the statements that they need before them.
#[derive(Default)]
pub struct Writer {
    /// How many values of its own it has set: `x1`, `x2` …
    pub values: usize,
    /// Whether operands that are needed twice are written twice, rather than named.
    inline: bool,
}

impl Writer {
    /// One for places that have no values section: what needs cases still asks for statements.
    pub fn inline() -> Writer {
        Writer { values: 0, inline: true }
    }

    /// The text of an expression; what it needs before it is added to `before`.
    pub fn text<L>(
        &mut self,
        expr: &Expr<L>,
        leaf: &mut dyn FnMut(&L) -> Formula,
        before: &mut Vec<Statement>,
    ) -> String {
        let formula = self.formula(&expr.map(&mut |name, _| leaf(name)), before);
        text(&formula)
    }

    fn formula(&mut self, expr: &Formula, before: &mut Vec<Statement>) -> Formula {
        match &*expr.node {
            Node::Number(_) | Node::Leaf(_) => expr.clone(),
            Node::Unary(Unary::Negate, a) => self.formula(a, before).negate(),
            Node::Binary(Binary::Power, a, b) => self.power(a, b, before),
            Node::Binary(
                op @ (Binary::Add | Binary::Subtract | Binary::Multiply | Binary::Divide),
                a,
                b,
            ) => {
                let a = self.formula(a, before);
                a.binary(*op, self.formula(b, before))
            }
            Node::Unary(Unary::Not, _) | Node::Binary(..) => {
                self.choose(expr, &Expr::number(1.0), &Expr::number(0.0), before)
            }
            Node::If(c, a, b) => self.choose(c, a, b, before),
            Node::Table(a, table) => self.table(a, table, before),
            Node::Call(function, arguments) => self.call(*function, arguments, before),
        }
    }

    /// A value of its own.
    fn own(&mut self) -> String {
        self.values += 1;
        format!("x{}", self.values)
    }

    /// The formula under a name, unless it is a number or a name already.
    fn named(&mut self, expr: &Formula, before: &mut Vec<Statement>) -> Formula {
        let formula = self.formula(expr, before);
        if self.inline || matches!(&*formula.node, Node::Number(_) | Node::Leaf(_)) {
            return formula;
        }
        let name = self.own();
        before.push(Statement::Set(name.clone(), text(&formula)));
        Expr::leaf(name)
    }

    /// One of two values; what each needs is computed in its own case only.
    fn choose(
        &mut self,
        condition: &Formula,
        then: &Formula,
        otherwise: &Formula,
        before: &mut Vec<Statement>,
    ) -> Formula {
        let condition = self.condition(condition, before);
        let name = self.own();
        let mut case = |value: &Formula| {
            let mut statements = vec![];
            let value = text(&self.formula(value, &mut statements));
            statements.push(Statement::Set(name.clone(), value));
            statements
        };
        let (then, otherwise) = (case(then), case(otherwise));
        before.push(Statement::Cases(condition, then, otherwise));
        Expr::leaf(name)
    }

    /// A comparison that holds where the condition does.
    fn condition(&mut self, condition: &Formula, before: &mut Vec<Statement>) -> String {
        let [one, zero] = [1.0, 0.0].map(Expr::number);
        let truth = match &*condition.node {
            Node::Binary(
                op @ (Binary::Less | Binary::LessEqual | Binary::Greater | Binary::GreaterEqual),
                a,
                b,
            ) => {
                let a = self.formula(a, before);
                let b = self.formula(b, before);
                return compared(&a, *op, &b);
            }
            Node::Unary(Unary::Not, a) => self.choose(a, &zero, &one, before),
            // The second is looked at where the first does not decide.
            Node::Binary(Binary::And, a, b) => {
                let b = Expr::choice(b.clone(), one, zero.clone());
                self.choose(a, &b, &zero, before)
            }
            Node::Binary(Binary::Or, a, b) => {
                let b = Expr::choice(b.clone(), one.clone(), zero);
                self.choose(a, &one, &b, before)
            }
            Node::Binary(Binary::Equal, a, b) => {
                self.equal(&a.clone().binary(Binary::Subtract, b.clone()), 1.0, before)
            }
            Node::Binary(Binary::NotEqual, a, b) => {
                self.equal(&a.clone().binary(Binary::Subtract, b.clone()), 0.0, before)
            }
            // A number is true that is not 0.
            _ => self.equal(condition, 0.0, before),
        };
        compared(&truth, Binary::Greater, &Expr::number(0.5))
    }

    /// `at_zero` where a value is 0, else 1 less that.
    fn equal(&mut self, value: &Formula, at_zero: f64, before: &mut Vec<Statement>) -> Formula {
        let elsewhere = 1.0 - at_zero;
        self.by_sign(value, [elsewhere, at_zero, elsewhere], before)
    }

    /// One of three numbers, where a value is below 0, 0, above it.
    fn by_sign(
        &mut self,
        value: &Formula,
        numbers: [f64; 3],
        before: &mut Vec<Statement>,
    ) -> Formula {
        let value = self.named(value, before);
        let [below, at, above] = numbers.map(Expr::number);
        let zero = || Expr::number(0.0);
        let positive = Expr::choice(value.clone().binary(Binary::Greater, zero()), above, at);
        self.choose(&value.binary(Binary::Less, zero()), &below, &positive, before)
    }

    /// Straight lines between points; the ends are held.
    fn table(&mut self, argument: &Formula, table: &Table, before: &mut Vec<Statement>) -> Formula {
        let points: Vec<(f64, f64)> =
            table.x.iter().copied().zip(table.y.iter().copied()).collect();
        let last = points.last().map_or(f64::NAN, |(_, y)| *y);
        if points.len() < 2 {
            return Expr::number(last);
        }
        let x = text(&self.named(argument, before));
        let name = self.own();
        let mut cases = vec![Statement::Set(name.clone(), number(last))];
        let mut cells = table.cells();
        for pair in points.windows(2).rev() {
            let (&[(x0, _), (x1, _)], Some(cell)) = (pair, cells.pop()) else { continue };
            let from = |value: f64| Expr::<String>::number(value);
            let since = || Expr::leaf(x.clone()) - from(x0);
            let inner = cell.last().copied().unwrap_or(f64::NAN);
            let line = cell
                .iter()
                .rev()
                .skip(1)
                .fold(from(inner), |inner, factor| from(*factor) + inner * since());
            let then = vec![Statement::Set(name.clone(), text(&line))];
            cases = vec![Statement::Cases(format!("{x} < {}", number(x1)), then, cases)];
        }
        if let Some((x0, y0)) = points.first() {
            let then = vec![Statement::Set(name.clone(), number(*y0))];
            cases = vec![Statement::Cases(format!("{x} < {}", number(*x0)), then, cases)];
        }
        before.extend(cases);
        Expr::leaf(name)
    }

    fn call(
        &mut self,
        function: Function,
        arguments: &[Formula],
        before: &mut Vec<Statement>,
    ) -> Formula {
        use Function::*;
        let one = || Expr::number(1.0);
        let call = |function, argument: Formula| Expr::call(function, vec![argument]);
        match (function, arguments) {
            (Min | Max, [a, b]) => {
                let (a, b) = (self.named(a, before), self.named(b, before));
                let op = if function == Min { Binary::Less } else { Binary::Greater };
                self.choose(&a.clone().binary(op, b.clone()), &a, &b, before)
            }
            (Clamp, [a, low, high]) => {
                let above = Expr::call(Max, vec![a.clone(), low.clone()]);
                self.call(Min, &[above, high.clone()], before)
            }
            (Sign, [a]) => self.by_sign(a, [-1.0, 0.0, 1.0], before),
            (Log10, [a]) => {
                let a = self.formula(a, before);
                call(Ln, a) / Expr::number(std::f64::consts::LN_10)
            }
            (Asinh, [a]) => {
                // Of the magnitude, where nothing cancels.
                let a = self.named(a, before);
                let size = self.named(&call(Abs, a.clone()), before);
                let root = call(Sqrt, size.clone() * size.clone() + one());
                let sign = self.by_sign(&a, [-1.0, 0.0, 1.0], before);
                sign * call(Ln, size + root)
            }
            (Acosh, [a]) => {
                let a = self.named(a, before);
                call(Ln, a.clone() + call(Sqrt, a.clone() * a - one()))
            }
            (Atanh, [a]) => {
                let a = self.named(a, before);
                Expr::number(0.5) * call(Ln, (one() + a.clone()) / (one() - a))
            }
            (Atan2, [y, x]) => {
                let (y, x) = (self.named(y, before), self.named(x, before));
                let spelled = atan2(&y, &x);
                self.formula(&spelled, before)
            }
            (PowerOfAbs, [a, b]) => {
                let size = self.named(&call(Abs, a.clone()), before);
                self.power(&size, b, before)
            }
            (SignedPower, [a, b]) => {
                let a = self.named(a, before);
                let sign = self.by_sign(&a, [-1.0, 0.0, 1.0], before);
                let size = self.named(&call(Abs, a), before);
                sign * self.power(&size, b, before)
            }
            (RealPower, [a, b]) => {
                let size = || Expr::call(PowerOfAbs, vec![a.clone(), b.clone()]);
                let turn = call(Cos, Expr::number(std::f64::consts::PI) * b.clone());
                let below = a.clone().binary(Binary::Less, Expr::number(0.0));
                self.formula(&Expr::choice(below, size() * turn, size()), before)
            }
            _ => {
                let arguments = arguments.iter().map(|a| self.formula(a, before)).collect();
                Expr::call(function, arguments)
            }
        }
    }

    /// Small whole and half powers are products and roots; others go by the logarithm, of the magnitude where the
    /// exponent is whole.
    fn power(&mut self, a: &Formula, b: &Formula, before: &mut Vec<Statement>) -> Formula {
        let exponent = b.constant();
        let base = self.named(a, before);
        let by_logarithm = |base: Formula, power: Formula| {
            let logarithm = Expr::call(Function::Ln, vec![base]);
            Expr::call(Function::Exp, vec![power * logarithm])
        };
        let Some(y) = exponent else {
            let power = self.formula(b, before);
            return by_logarithm(base, power);
        };
        if y.abs() <= LONGEST_PRODUCT && (2.0 * y).fract() == 0.0 {
            return base.binary(Binary::Power, Expr::number(y));
        }
        if y.fract() != 0.0 {
            return by_logarithm(base, Expr::number(y));
        }
        let size = by_logarithm(Expr::call(Function::Abs, vec![base.clone()]), Expr::number(y));
        if y % 2.0 == 0.0 {
            return size;
        }
        self.by_sign(&base, [-1.0, 0.0, 1.0], before) * size
    }
}

/// Powers up to this are written as products, as in the other dialects.
const LONGEST_PRODUCT: f64 = 8.0;

/// The angle of (x, y) by `atan`, whose argument never exceeds 1.
fn atan2(y: &Formula, x: &Formula) -> Formula {
    use std::f64::consts::{FRAC_PI_2, PI};
    let n = Expr::<String>::number;
    let abs = |a: &Formula| Expr::call(Function::Abs, vec![a.clone()]);
    let atan = |a: Formula| Expr::call(Function::Atan, vec![a]);
    let less = |a: Formula, b: Formula| a.binary(Binary::Less, b);
    let steep = {
        let right = n(FRAC_PI_2) - atan(x.clone() / y.clone());
        let left = n(-FRAC_PI_2) - atan(x.clone() / y.clone());
        Expr::choice(less(y.clone(), n(0.0)), left, right)
    };
    let flat = atan(y.clone() / x.clone());
    let behind = Expr::choice(less(y.clone(), n(0.0)), flat.clone() - n(PI), flat.clone() + n(PI));
    let ahead = Expr::choice(less(n(0.0), x.clone()), flat, n(0.0));
    let shallow = Expr::choice(less(x.clone(), n(0.0)), behind, ahead);
    Expr::choice(less(abs(x), abs(y)), steep, shallow)
}

fn compared(a: &Formula, op: Binary, b: &Formula) -> String {
    let sign = match op {
        Binary::Less => "<",
        Binary::LessEqual => "<=",
        Binary::GreaterEqual => ">=",
        _ => ">",
    };
    format!("{} {sign} {}", text(a), text(b))
}

/// The text of a formula. Only what every dialect of netlists spells alike is left in it.
fn text(formula: &Formula) -> String {
    print(formula, expr::Dialect::Ngspice, &mut |leaf| leaf.clone())
}
