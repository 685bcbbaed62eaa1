//! The files of data that a text speaks of: the names in `file("…")`.

use super::tree::{
    Argument, Call, ChainEnd, Expr, File, Leaf, Name, Statement, StatementKind, Value,
};

/// The names of all files of data, in the order of the text.
pub fn data_files(file: &File) -> Vec<&Name> {
    let mut names = vec![];
    statements(&file.statements, &mut names);
    names
}

fn statements<'f>(all: &'f [Statement], names: &mut Vec<&'f Name>) {
    for statement in all {
        match &statement.kind {
            StatementKind::Chain(chain) => {
                let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
                ends.filter_map(|ChainEnd { arguments, .. }| arguments.as_ref())
                    .for_each(|all| arguments(all, names));
            }
            StatementKind::Parameter { value, .. }
            | StatementKind::Signal { value, .. }
            | StatementKind::Drive { value, .. } => expression(value, names),
            StatementKind::Simulate { until, step } => {
                until.iter().chain(step).for_each(|value| expression(value, names));
            }
            StatementKind::Observe(items) => {
                items.iter().for_each(|item| expression(&item.expr, names));
            }
            StatementKind::Model(model) => {
                let defaults = model.parameters.iter().filter_map(|p| p.default.as_ref());
                defaults.for_each(|value| expression(value, names));
                statements(&model.body, names);
            }
            StatementKind::For { body, .. } => statements(body, names),
            StatementKind::If { then, otherwise, .. } => {
                statements(then, names);
                statements(otherwise, names);
            }
            StatementKind::Loop(regulator) => {
                expression(&regulator.controlled, names);
                expression(&regulator.reference, names);
            }
            StatementKind::Input(_)
            | StatementKind::Output(_)
            | StatementKind::Options(_)
            | StatementKind::Import(_)
            | StatementKind::Port(_)
            | StatementKind::Unreadable => {}
        }
    }
}

fn arguments<'f>(all: &'f [Argument], names: &mut Vec<&'f Name>) {
    for argument in all {
        match &argument.value {
            Value::Expr(expr) => expression(expr, names),
            Value::Matrix(rows) => rows.iter().flatten().for_each(|expr| expression(expr, names)),
            Value::Bond(..) | Value::Text(_) => {}
        }
    }
}

fn expression<'f>(expr: &'f Expr, names: &mut Vec<&'f Name>) {
    expr.leaves(&mut |leaf, _| match leaf {
        Leaf::Call(Call { name, rows, .. }) => {
            for row in rows {
                if name.text == "file"
                    && let [Argument { value: Value::Text(path), .. }] = row.as_slice()
                {
                    names.push(path);
                }
                arguments(row, names);
            }
        }
        Leaf::Sum(sum) => expression(&sum.term, names),
        Leaf::Quantity(..) | Leaf::Name(_) => {}
    });
}
