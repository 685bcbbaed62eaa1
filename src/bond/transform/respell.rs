//! Texts of expressions with some of their names and readings spelt otherwise.

use crate::bond::syntax::{Argument, Call, Expr, Leaf, Value};
use crate::expr::Node;
use crate::source::Span;

/// Calls `visit` for every name and call of an expression, outermost first; what it answers with `false` is not entered.
pub fn visit(expr: &Expr, see: &mut dyn FnMut(&Leaf, Span) -> bool) {
    match &*expr.node {
        Node::Number(_) => {}
        Node::Leaf(leaf) => {
            if !see(leaf, expr.span) {
                return;
            }
            match leaf {
                Leaf::Call(Call { rows, .. }) => {
                    rows.iter().flatten().for_each(|argument| visit_argument(argument, see));
                }
                Leaf::Sum(sum) => visit(&sum.term, see),
                Leaf::Quantity(..) | Leaf::Name(_) => {}
            }
        }
        Node::Unary(_, a) | Node::Table(a, _) => visit(a, see),
        Node::Binary(_, a, b) => {
            visit(a, see);
            visit(b, see);
        }
        Node::Call(_, arguments) => arguments.iter().for_each(|a| visit(a, see)),
        Node::If(c, a, b) => {
            visit(c, see);
            visit(a, see);
            visit(b, see);
        }
    }
}

/// The same for the value of an argument.
pub fn visit_argument(argument: &Argument, see: &mut dyn FnMut(&Leaf, Span) -> bool) {
    match &argument.value {
        Value::Expr(expr) => visit(expr, see),
        Value::Matrix(rows) => rows.iter().flatten().for_each(|expr| visit(expr, see)),
        Value::Bond(..) | Value::Text(_) => {}
    }
}

/// A text from `start` on with pieces of it replaced.
pub fn splice(text: &str, start: u32, edits: &mut [(Span, String)]) -> String {
    edits.sort_by_key(|(span, _)| span.start);
    let mut spelt = String::with_capacity(text.len());
    let mut at = 0;
    for (span, instead) in edits.iter() {
        let (from, to) = ((span.start - start) as usize, (span.end - start) as usize);
        if from >= at
            && let Some(before) = text.get(at..from)
        {
            spelt += before;
            spelt += instead;
            at = to;
        }
    }
    spelt += text.get(at..).unwrap_or("");
    spelt
}
