//! The value of an expression, by a walk over the tree: for constants, and as the oracle of the faster ways.
//!
//! What each operator means is said here and in [`values`](super::values), once: IEEE arithmetic; comparisons
//! and logic give 1 or 0, and whatever is not 0 is true; a power is real ([`power`]).

use super::tree::{Binary, Expr, Node, Unary};
use super::values::power;

impl<L> Expr<L> {
    /// The value, given the values of its leaves. Only the chosen branch of a condition is looked at.
    pub fn evaluate(&self, leaf: &mut dyn FnMut(&L) -> f64) -> f64 {
        match &*self.node {
            Node::Number(value) => *value,
            Node::Leaf(name) => leaf(name),
            Node::Unary(op, a) => op.value(a.evaluate(leaf)),
            Node::Binary(op, a, b) => {
                let a = a.evaluate(leaf);
                op.value(a, b.evaluate(leaf))
            }
            Node::Call(function, arguments) => {
                let mut values = [0.0; 3];
                if arguments.len() > values.len() {
                    return f64::NAN;
                }
                for (value, argument) in values.iter_mut().zip(arguments) {
                    *value = argument.evaluate(leaf);
                }
                function.row().value.at(&values[..arguments.len()])
            }
            Node::If(c, a, b) => {
                if c.evaluate(leaf) != 0.0 {
                    a.evaluate(leaf)
                } else {
                    b.evaluate(leaf)
                }
            }
            Node::Table(a, table) => table.value(a.evaluate(leaf)),
        }
    }

    /// The value of an expression without leaves; `None` when it has some.
    pub fn constant(&self) -> Option<f64> {
        let mut closed = true;
        self.leaves(&mut |_, _| closed = false);
        closed.then(|| self.evaluate(&mut |_| f64::NAN))
    }
}

impl Unary {
    /// The value of the operation.
    pub fn value(self, a: f64) -> f64 {
        match self {
            Unary::Negate => -a,
            Unary::Not => f64::from(a == 0.0),
        }
    }
}

impl Binary {
    /// The value of the operation.
    pub fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Binary::Add => a + b,
            Binary::Subtract => a - b,
            Binary::Multiply => a * b,
            Binary::Divide => a / b,
            Binary::Power => power(a, b),
            Binary::Less => f64::from(a < b),
            Binary::LessEqual => f64::from(a <= b),
            Binary::Greater => f64::from(a > b),
            Binary::GreaterEqual => f64::from(a >= b),
            Binary::Equal => f64::from(a == b),
            Binary::NotEqual => f64::from(a != b),
            Binary::And => f64::from(a != 0.0 && b != 0.0),
            Binary::Or => f64::from(a != 0.0 || b != 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Table;

    #[test]
    fn tables_hold_their_end_values() {
        let table = Table::lines(vec![0.0, 1.0, 3.0], vec![2.0, 4.0, 0.0]);
        let values: Vec<f64> =
            [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0].iter().map(|x| table.value(*x)).collect();
        assert_eq!(values, [2.0, 2.0, 3.0, 4.0, 2.0, 0.0, 0.0]);
        assert_eq!(table.slope(0.5), 2.0);
        assert_eq!(table.slope(1.0), -2.0);
        assert_eq!(table.slope(3.5), 0.0);
        assert!(table.value(f64::NAN).is_nan());
    }

    #[test]
    fn the_other_branch_is_not_looked_at() {
        let root = Expr::<u8>::call(super::super::Function::Sqrt, vec![Expr::number(-1.0)]);
        let expr = Expr::choice(Expr::number(0.0), root, Expr::number(7.0));
        assert_eq!(expr.constant(), Some(7.0));
    }
}
