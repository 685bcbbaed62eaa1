//! Whether a model says any unit: one that says none is not checked.

use crate::bond::syntax::{
    Argument, Call, Chain, Expr, HeaderParameter, Leaf, Statement, StatementKind, Value,
};

/// Whether a unit stands in the laws, parameters or signals of a model. Those of `simulate`, `observe` and `options` say
/// what a run does, and not what the model is in.
pub(super) fn says_units(header: Option<&[HeaderParameter]>, statements: &[Statement]) -> bool {
    let defaults = header.unwrap_or(&[]).iter().filter_map(|parameter| parameter.default.as_ref());
    defaults.into_iter().any(in_expr) || statements.iter().any(in_statement)
}

fn in_statement(statement: &Statement) -> bool {
    match &statement.kind {
        StatementKind::Chain(chain) => in_chain(chain),
        StatementKind::Parameter { value, .. }
        | StatementKind::Signal { value, .. }
        | StatementKind::Drive { value, .. } => in_expr(value),
        StatementKind::For { body, .. } => body.iter().any(in_statement),
        StatementKind::If { then, otherwise, .. } => then.iter().chain(otherwise).any(in_statement),
        _ => false,
    }
}

fn in_chain(chain: &Chain) -> bool {
    let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
    ends.filter_map(|end| end.arguments.as_ref()).flatten().any(in_argument)
}

fn in_argument(argument: &Argument) -> bool {
    match &argument.value {
        Value::Expr(value) => in_expr(value),
        Value::Matrix(rows) => rows.iter().flatten().any(in_expr),
        _ => false,
    }
}

fn in_expr(expr: &Expr) -> bool {
    let mut found = false;
    expr.leaves(&mut |leaf, _| {
        found = found
            || match leaf {
                Leaf::Quantity(..) => true,
                Leaf::Call(Call { rows, .. }) => rows.iter().flatten().any(in_argument),
                Leaf::Sum(sum) => in_expr(&sum.term),
                Leaf::Name(_) => false,
            }
    });
    found
}
