//! The derivative of a tree as a tree, by the rules of the table of functions: for what has to be a text again.
//!
//! Laws that are solved go through the graph of operations instead, where common parts stand once.

use super::functions::{Function, Slot};
use super::tree::{Binary, Expr, Node, Unary};

/// The derivative, given that of each leaf.
pub fn slope<L: Clone>(expr: &Expr<L>, of: &mut dyn FnMut(&L) -> f64) -> Expr<L> {
    let number = Expr::number;
    match &*expr.node {
        Node::Number(_) => number(0.0),
        Node::Leaf(leaf) => number(of(leaf)),
        Node::Unary(Unary::Negate, a) => match slope(a, of) {
            a if is(&a, 0.0) => a,
            a => -a,
        },
        Node::Unary(Unary::Not, _) => number(0.0),
        Node::Binary(op, a, b) => {
            let (da, db) = (slope(a, of), slope(b, of));
            match op {
                Binary::Add => sum(da, db),
                Binary::Subtract if is(&db, 0.0) => da,
                Binary::Subtract => da - db,
                Binary::Multiply => sum(product(da, b.clone()), product(a.clone(), db)),
                // (a' − (a/b)·b')/b needs no b².
                Binary::Divide => {
                    let turned = product(expr.clone(), db);
                    let above = if is(&turned, 0.0) { da } else { da - turned };
                    if is(&above, 0.0) { above } else { above / b.clone() }
                }
                Binary::Power => {
                    let lower = a.clone().binary(Binary::Power, b.clone() - number(1.0));
                    let by_base = product(da, b.clone() * lower);
                    let ln = Expr::call(Function::Ln, vec![a.clone()]);
                    sum(by_base, product(db, expr.clone() * ln))
                }
                _ => number(0.0),
            }
        }
        Node::Call(function, arguments) => {
            let mut total = number(0.0);
            for (k, argument) in arguments.iter().enumerate() {
                let inner = slope(argument, of);
                if is(&inner, 0.0) {
                    continue;
                }
                let partial = (function.row().derivative)(k).map(&mut |slot, _| match slot {
                    Slot::Argument(k) => arguments.get(*k).cloned().unwrap_or(number(f64::NAN)),
                    Slot::Result => expr.clone(),
                });
                total = sum(total, product(partial, inner));
            }
            total
        }
        Node::If(c, a, b) => match (slope(a, of), slope(b, of)) {
            (a, b) if is(&a, 0.0) && is(&b, 0.0) => a,
            (a, b) => Expr::choice(c.clone(), a, b),
        },
        Node::Table(a, table) => {
            let inner = slope(a, of);
            if is(&inner, 0.0) {
                return inner;
            }
            // Cell by cell, 0 beyond the ends.
            let cells = table.x.windows(2).zip(table.y.windows(2)).rev();
            let steps = cells.fold((number(0.0), number(0.0)), |(beyond, _), (x, y)| {
                let here = number((y[1] - y[0]) / (x[1] - x[0]));
                let within = a.clone().binary(Binary::Less, number(x[1]));
                let all = Expr::choice(within, here, beyond);
                let from = a.clone().binary(Binary::Less, number(x[0]));
                (all.clone(), Expr::choice(from, number(0.0), all))
            });
            product(steps.1, inner)
        }
    }
}

fn is<L>(expr: &Expr<L>, value: f64) -> bool {
    expr.as_number() == Some(value)
}

fn sum<L>(a: Expr<L>, b: Expr<L>) -> Expr<L> {
    match (is(&a, 0.0), is(&b, 0.0)) {
        (true, _) => b,
        (_, true) => a,
        _ => a + b,
    }
}

fn product<L>(a: Expr<L>, b: Expr<L>) -> Expr<L> {
    match () {
        () if is(&a, 0.0) || is(&b, 1.0) => a,
        () if is(&b, 0.0) || is(&a, 1.0) => b,
        () => a * b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Table;

    #[test]
    fn slopes_agree_with_differences() {
        let x = || Expr::leaf(());
        let number = Expr::<()>::number;
        let call = |function, arguments| Expr::call(function, arguments);
        let table = Table::lines(vec![-1.0, 0.0, 2.0], vec![3.0, 1.0, 2.0]);
        for law in [
            x() * x() - number(3.0) / x(),
            -(x() + number(2.0)).binary(Binary::Power, number(3.0)),
            (x() + number(3.0)).binary(Binary::Power, x()),
            call(Function::Atan2, vec![x(), x() * x() + number(1.0)]),
            call(Function::Tanh, vec![x()]) * call(Function::Exp, vec![-x()]),
            call(Function::Max, vec![x(), number(0.5)]),
            Expr::choice(x().binary(Binary::Less, number(0.4)), x() * x(), number(2.0) * x()),
            Expr::new(
                Node::Table(x() * number(2.0), table.clone().into()),
                crate::source::Span::NONE,
            ),
        ] {
            for at in [0.31, 0.77, -0.4] {
                let value = |at: f64| law.evaluate(&mut |()| at);
                let h = 1e-4;
                let expected = (value(at + h) - value(at - h)) / (2.0 * h);
                let found = slope(&law, &mut |()| 1.0).evaluate(&mut |()| at);
                assert!(
                    (found - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                    "{law:?} at {at}: {found} {expected}"
                );
            }
        }
        assert_eq!(slope(&(number(2.0) * number(3.0)), &mut |()| 1.0).as_number(), Some(0.0));
    }
}
