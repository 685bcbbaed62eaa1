//! Calls in expressions that are no plain functions: what follows from values over time, waveforms, curves through points.

use super::expression;
use crate::diagnostic::Diagnostic;
use crate::expr::{Node, Table};
use crate::netlist::{Expr, Leaf, Operator, Shape};
use crate::source::Span;
use std::sync::Arc;

/// One row of the table.
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub what: What,
    /// The fewest and the most arguments; for curves of numbers, points besides.
    pub arguments: [usize; 2],
    /// How a call goes, for messages.
    pub form: &'static str,
}

/// What a call is.
#[derive(Clone, Copy)]
pub enum What {
    /// A value over time.
    Operator(Operator),
    /// A curve through points.
    Curve(fn(Table) -> Option<Table>),
}

/// Every such call, one row each.
#[rustfmt::skip]
pub const CALLS: &[Row] = &[
    Row { name: "ddt", what: What::Operator(Operator::Derivative), arguments: [1, 1], form: "ddt(x)" },
    Row { name: "sdt", what: What::Operator(Operator::Integral), arguments: [1, 1], form: "sdt(x)" },
    Row { name: "idt", what: What::Operator(Operator::Integral), arguments: [1, 2], form: "idt(x, initial)" },
    Row { name: "delay", what: What::Operator(Operator::Delay), arguments: [2, 3], form: "delay(x, seconds)" },
    Row { name: "absdelay", what: What::Operator(Operator::Delay), arguments: [2, 3], form: "absdelay(x, seconds)" },
    Row { name: "spice_pulse", what: What::Operator(Operator::Waveform(Shape::Pulse)), arguments: [2, 7], form: "spice_pulse(v1, v2, td, tr, tf, pw, per)" },
    Row { name: "spice_sin", what: What::Operator(Operator::Waveform(Shape::Sin)), arguments: [2, 6], form: "spice_sin(vo, va, freq, td, theta, phase)" },
    Row { name: "spice_exp", what: What::Operator(Operator::Waveform(Shape::Exp)), arguments: [2, 6], form: "spice_exp(v1, v2, td1, tau1, td2, tau2)" },
    Row { name: "spice_sffm", what: What::Operator(Operator::Waveform(Shape::Sffm)), arguments: [2, 5], form: "spice_sffm(vo, va, fc, mdi, fs)" },
    Row { name: "fasttable", what: What::Curve(Some), arguments: [3, usize::MAX], form: "fasttable(x, x0, y0, x1, y1, …)" },
    Row { name: "akima", what: What::Curve(|t| Some(Table::akima(t.x, t.y))), arguments: [3, usize::MAX], form: "akima(x, x0, y0, x1, y1, …)" },
    Row { name: "spline", what: What::Curve(|t| Some(Table::akima(t.x, t.y))), arguments: [3, usize::MAX], form: "spline(x, x0, y0, x1, y1, …)" },
    Row { name: "wodicka", what: What::Curve(|t| Some(Table::akima(t.x, t.y))), arguments: [3, usize::MAX], form: "wodicka(x, x0, y0, x1, y1, …)" },
    Row { name: "cubic", what: What::Curve(|t| Some(Table::natural(t.x, t.y))), arguments: [3, usize::MAX], form: "cubic(x, x0, y0, x1, y1, …)" },
    Row { name: "bli", what: What::Curve(|t| Table::polynomial(t.x, t.y)), arguments: [3, usize::MAX], form: "bli(x, x0, y0, x1, y1, …)" },
    Row { name: "barycentric", what: What::Curve(|t| Table::polynomial(t.x, t.y)), arguments: [3, usize::MAX], form: "barycentric(x, x0, y0, x1, y1, …)" },
];

/// The row of a name, folded to lower case.
pub fn find(name: &str) -> Option<&'static Row> {
    CALLS.iter().find(|row| row.name == name)
}

/// What a call with its arguments is.
pub fn apply(
    row: &Row,
    mut arguments: Vec<Expr>,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Expr> {
    let wrong = |message: String| {
        Diagnostic::error("E0773", span, message).help(format!("write {}", row.form))
    };
    let [least, most] = row.arguments;
    if arguments.len() < least || arguments.len() > most {
        let message = format!("`{}` takes other arguments", row.name);
        d.push(wrong(message).says(format!("{} given", arguments.len())));
        return None;
    }
    let node = match row.what {
        // The third argument of a delay says how much to keep: all that is needed is kept.
        What::Operator(Operator::Delay) => {
            arguments.truncate(2);
            Node::Leaf(Leaf::Operator(Operator::Delay, arguments))
        }
        What::Operator(operator) => Node::Leaf(Leaf::Operator(operator, arguments)),
        What::Curve(curve) => {
            let points: Option<Vec<f64>> =
                arguments.drain(1..).map(|point| point.constant()).collect();
            let table = points.and_then(|points| expression::table(&points)).and_then(curve);
            match (arguments.pop(), table) {
                (Some(x), Some(table)) => Node::Table(x, Arc::new(table)),
                _ => {
                    let message = format!(
                        "`{}` takes x and pairs of numbers with rising abscissae",
                        row.name
                    );
                    d.push(wrong(message));
                    return None;
                }
            }
        }
    };
    Some(Expr::new(node, span))
}
