//! The parts of the language that the parser reads and the elaborator does not build yet: each is refused by name.

use crate::bond::syntax::{
    ChainEnd, Expr, File, Leaf, Part, Path, Statement, StatementKind, Value,
};
use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// Reports every construct of the file that would otherwise be passed over; whether there was any.
pub(super) fn refuse(file: &File, d: &mut Vec<Diagnostic>) -> bool {
    let before = d.len();
    file.statements.iter().for_each(|statement| refuse_statement(statement, d));
    d.len() > before
}

fn refuse_statement(statement: &Statement, d: &mut Vec<Diagnostic>) {
    let (word, what, instead) = match &statement.kind {
        StatementKind::Model(_) => {
            ("model", "models", "write the elements of the model where it is used")
        }
        StatementKind::Port(_) => {
            ("port", "models", "write the elements of the model where it is used")
        }
        StatementKind::Import(_) => ("import", "imports", "copy what you need into this file"),
        StatementKind::For { .. } => ("for", "loops over elements", "write each element out"),
        StatementKind::If { .. } => ("if", "conditional elements", "write a file for each case"),
        StatementKind::Loop(_) => {
            ("loop", "named regulator loops", "leave the statement out: it changes no simulation")
        }
        StatementKind::Chain(chain) => {
            let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, list)| list));
            ends.for_each(|end| refuse_end(end, d));
            return;
        }
        StatementKind::Parameter { name, value, .. }
        | StatementKind::Signal { name, value }
        | StatementKind::Drive { name, value } => {
            refuse_part(name, d);
            refuse_value(value, d);
            return;
        }
        StatementKind::Input(names) | StatementKind::Output(names) => {
            names.iter().for_each(|name| refuse_part(name, d));
            return;
        }
        StatementKind::Observe(items) => {
            items.iter().for_each(|item| refuse_value(&item.expr, d));
            return;
        }
        StatementKind::Simulate { .. } | StatementKind::Options(_) | StatementKind::Unreadable => {
            return;
        }
    };
    let start = Span { end: statement.span.start + word.len() as u32, ..statement.span };
    d.push(
        Diagnostic::error("E0201", start, format!("{what} are not part of the language yet"))
            .says("this statement cannot be used yet")
            .help(instead),
    );
}

fn refuse_end(end: &ChainEnd, d: &mut Vec<Diagnostic>) {
    refuse_path(&end.path, d);
    for argument in end.arguments.iter().flatten() {
        refuse_argument(&argument.value, d);
    }
}

fn refuse_path(path: &Path, d: &mut Vec<Diagnostic>) {
    path.parts().for_each(|part| refuse_part(part, d));
}

fn refuse_part(part: &Part, d: &mut Vec<Diagnostic>) {
    if let (Some(first), Some(last)) = (part.indices.first(), part.indices.last()) {
        let span = first.span.join(last.span);
        d.push(
            Diagnostic::error("E0202", span, "arrays of elements are not part of the language yet")
                .says("an index after a name")
                .help("give each element a name of its own, such as `ph_1`, `ph_2`"),
        );
    }
}

fn refuse_argument(value: &Value, d: &mut Vec<Diagnostic>) {
    match value {
        Value::Expr(expr) => refuse_value(expr, d),
        Value::Matrix(rows) => rows.iter().flatten().for_each(|expr| refuse_value(expr, d)),
        Value::Bond(from, to) => {
            refuse_path(from, d);
            refuse_path(to, d);
        }
        Value::Text(_) => {}
    }
}

fn refuse_value(expr: &Expr, d: &mut Vec<Diagnostic>) {
    expr.leaves(&mut |leaf, span| match leaf {
        Leaf::Quantity(..) => {}
        Leaf::Name(path) => refuse_path(path, d),
        Leaf::Call(call) => {
            call.rows.iter().flatten().for_each(|argument| refuse_argument(&argument.value, d));
        }
        Leaf::Sum(_) => d.push(
            Diagnostic::error("E0202", span, "sums over an index are not part of the language yet")
                .help("write the terms out"),
        ),
    });
}
