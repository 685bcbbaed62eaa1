//! What we print for ngspice means in ngspice what it means to us.

use bondspice::expr::{
    Binary, Dialect, Expr, FUNCTIONS, Function, Node, Table, Unary, print::print,
};
use bondspice::source::Span;
use std::process::Command;
use std::sync::Arc;

/// The nodes and what they carry: both signs, a zero, small and large.
const VALUES: [(&str, f64); 6] =
    [("a", -0.7), ("b", 0.3), ("c", 2.5), ("d", -3.0), ("z", 0.0), ("w", 1e7)];

type Tree = Expr<usize>;

fn x(k: usize) -> Tree {
    Expr::leaf(k)
}

fn n(value: f64) -> Tree {
    Expr::number(value)
}

fn power(base: Tree, exponent: Tree) -> Tree {
    base.binary(Binary::Power, exponent)
}

fn cases() -> Vec<Tree> {
    use Binary::*;
    let mut cases = vec![];
    // Powers: whole ones of both signs, roots, large and variable exponents.
    for base in [0, 1, 2, 3] {
        for exponent in [-9.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 7.0, 11.0, 12.0] {
            cases.push(power(x(base), n(exponent)));
            cases.push(power(x(base) - n(0.1), n(exponent)));
        }
        for exponent in [0.5, 1.5, -0.5, 0.3, 2.7] {
            let call = |f| Expr::call(f, vec![x(base), n(exponent)]);
            cases.extend([call(Function::PowerOfAbs), call(Function::SignedPower)]);
            cases.push(power(x(base) * x(base), n(exponent)));
        }
        // A variable exponent that is whole: −3.
        cases.push(power(x(base), x(3)));
        cases.push(power(x(base), -x(3)));
        cases.push(-power(x(base), n(2.0)));
        cases.push(power(-x(base), n(3.0)));
    }
    cases.push(power(x(4), n(2.0)));
    cases.push(power(x(4), n(0.5)));
    cases.push(Expr::call(Function::SignedPower, vec![x(4), n(1.5)]));
    // Signs and brackets.
    cases.extend([
        x(0) - (x(1) - x(2)),
        x(0) - (-x(1)),
        x(0) * -x(1),
        x(0) / (x(1) * x(2)),
        x(0) / (x(1) / x(2)),
        -(x(0) + x(1)),
        n(2.0) * -n(3.0) * x(2),
        n(1.5e-18) * x(5),
        n(5.581295990097347e-7) * x(2),
        n(-2e12) * x(0),
    ]);
    // Comparisons, logic, conditions; conditions that are negative are true.
    for op in [Less, LessEqual, Greater, GreaterEqual, Equal, NotEqual, And, Or] {
        for (left, right) in [(0, 1), (1, 0), (2, 2), (4, 2), (3, 4), (4, 4)] {
            cases.push(x(left).binary(op, x(right)) * n(3.0) + n(1.0));
        }
    }
    for k in 0..5 {
        cases.push(Expr::choice(x(k), n(5.0), n(6.0)));
        cases.push(Expr::new(Node::Unary(Unary::Not, x(k)), Span::NONE) + n(1.0));
        let positive = x(k).binary(Greater, n(0.0));
        let nested = Expr::choice(x(2).binary(Less, x(k)), x(0), x(1) + n(1.0));
        cases.push(Expr::choice(positive.clone(), nested, x(3)) * n(2.0));
        // The root of a negative number stands in the branch that is not taken.
        cases.push(Expr::choice(positive, Expr::call(Function::Sqrt, vec![x(k)]), -x(k)));
    }
    // Tables hold their ends.
    let table = Arc::new(Table::lines(vec![-2.0, 0.0, 1.0, 2.0], vec![1.0, -1.0, 4.0, 10.0]));
    for k in 0..6 {
        cases.push(Expr::new(Node::Table(x(k), table.clone()), Span::NONE));
    }
    // Every function, in its domain, with arguments of each sign where it has them.
    for row in FUNCTIONS {
        let first: &[usize] = match row.function {
            Function::Sqrt | Function::Ln | Function::Log10 => &[1, 2, 5],
            Function::Asin | Function::Acos | Function::Atanh => &[0, 1, 4],
            Function::Acosh => &[2],
            // −3 is a multiple of 0.3 but for rounding: either neighbour is right.
            Function::Mod => &[0, 1, 2, 4],
            Function::PowerOfAbs | Function::SignedPower => &[0, 1, 2, 3],
            _ => &[0, 1, 2, 3, 4],
        };
        for k in first {
            let arguments =
                [vec![x(*k), x(1), x(2)], vec![x(*k), x(0), x(2)], vec![x(*k), x(3), x(0)]];
            for mut arguments in arguments {
                arguments.truncate(row.value.arguments());
                if row.function == Function::Acosh {
                    // Real at the zero where ngspice begins, too.
                    arguments = vec![x(*k) * x(*k) + n(2.0)];
                }
                cases.push(Expr::call(row.function, arguments));
            }
        }
    }
    cases
}

#[test]
fn printed_expressions_mean_the_same_in_ngspice() {
    if !crate::peers::has("ngspice") {
        return;
    }
    let cases = cases();
    let mut deck = String::from("* printed expressions\n");
    for (name, value) in VALUES {
        deck += &format!("V{name} {name} 0 {value:e}\n");
    }
    let texts: Vec<String> = cases
        .iter()
        .map(|e| print(e, Dialect::Ngspice, &mut |k| format!("v({})", VALUES[*k].0)))
        .collect();
    for (k, text) in texts.iter().enumerate() {
        deck += &format!("B{k} n{k} 0 V={text}\n");
    }
    deck += ".control\nset numdgt=15\nop\n";
    for k in 0..cases.len() {
        deck += &format!("print v(n{k})\n");
    }
    deck += ".endc\n.end\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.cir");
    std::fs::write(&path, &deck).unwrap();
    let output = Command::new("ngspice").arg("-b").arg(&path).output().unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    let mut values = vec![None; cases.len()];
    for line in stdout.lines() {
        let Some((name, value)) = line.split_once(" = ") else { continue };
        let index = name.trim().strip_prefix("v(n").and_then(|n| n.strip_suffix(')'));
        if let (Some(k), Ok(value)) =
            (index.and_then(|k| k.parse::<usize>().ok()), value.trim().parse::<f64>())
        {
            values[k] = Some(value);
        }
    }
    let mut wrong = vec![];
    for ((expr, text), value) in cases.iter().zip(&texts).zip(&values) {
        let expected = expr.evaluate(&mut |k| VALUES[*k].1);
        if !value.is_some_and(|v| (v - expected).abs() <= 1e-10 * (1.0 + expected.abs())) {
            wrong.push(format!("{text}: {value:?}, not {expected:?}"));
        }
    }
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        wrong.is_empty(),
        "{} of {}:\n{}\n{stderr}",
        wrong.len(),
        cases.len(),
        wrong.join("\n")
    );
}
