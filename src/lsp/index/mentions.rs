//! Every place that speaks of a name.

use super::*;
use crate::bond::elaborate::READINGS;
use crate::bond::elements::element;
use crate::bond::syntax::{
    Call, ChainEnd, Expr, Leaf, Name, Part, Path, Statement, StatementKind, Sum, Value,
};

/// Where names are looked up.
struct Place<'i> {
    index: &'i mut Index,
    body: BodyId,
    /// Variables of the loops and sums around, the innermost last.
    variables: Vec<(String, SymbolId)>,
}

/// Collects all places of all files.
pub(super) fn collect(index: &mut Index, files: &BTreeMap<FileId, (&File, Vec<Import>)>) {
    let bodies: Vec<(BodyId, FileId, Span, bool)> = index
        .bodies
        .iter()
        .enumerate()
        .map(|(at, body)| (BodyId(at), body.file, body.span, body.is_file))
        .collect();
    for (body, file, span, is_file) in bodies {
        let Some((file, _)) = files.get(&file) else { continue };
        let mut place = Place { index, body, variables: vec![] };
        if is_file {
            place.statements(&file.statements);
            continue;
        }
        for statement in file.statements.iter().filter(|statement| statement.span == span) {
            if let StatementKind::Model(model) = &statement.kind {
                let defaults = model.parameters.iter().filter_map(|p| p.default.as_ref());
                defaults.for_each(|value| place.expression(value));
                place.statements(&model.body);
            }
        }
    }
}

impl Place<'_> {
    fn statements(&mut self, all: &[Statement]) {
        for statement in all {
            match &statement.kind {
                StatementKind::Chain(chain) => {
                    let ends = chain.first.iter();
                    let ends = ends.chain(chain.links.iter().flat_map(|(_, ends)| ends));
                    ends.for_each(|end| self.end(end));
                }
                StatementKind::Parameter { name, value, .. }
                | StatementKind::Signal { name, value } => {
                    self.indices(name);
                    self.expression(value);
                }
                StatementKind::Input(names) => names.iter().for_each(|name| self.indices(name)),
                StatementKind::Output(names) => names.iter().for_each(|name| self.value(name)),
                StatementKind::Drive { name, value } => {
                    self.value(name);
                    self.expression(value);
                }
                StatementKind::Simulate { until, step } => {
                    until.iter().chain(step).for_each(|value| self.expression(value));
                }
                StatementKind::Observe(items) => {
                    items.iter().for_each(|item| self.expression(&item.expr));
                }
                StatementKind::Port(port) => self.indices(&port.name),
                StatementKind::For { variable, range, body } => {
                    self.expression(&range.0);
                    self.expression(&range.1);
                    self.within(variable, statement.span, |place| place.statements(body));
                }
                StatementKind::If { condition, then, otherwise } => {
                    self.expression(condition);
                    self.statements(then);
                    self.statements(otherwise);
                }
                StatementKind::Loop(regulator) => {
                    self.value_path(&regulator.signal);
                    self.expression(&regulator.controlled);
                    self.expression(&regulator.reference);
                    let more = regulator.bandwidth.iter().chain(&regulator.margin);
                    more.for_each(|value| self.expression(value));
                }
                StatementKind::Options(_)
                | StatementKind::Import(_)
                | StatementKind::Model(_)
                | StatementKind::Unreadable => {}
            }
        }
    }

    /// Does something where a variable counts.
    fn within(&mut self, variable: &Name, scope: Span, what: impl FnOnce(&mut Self)) {
        let symbol = self.index.declare_variable(self.body, variable, scope);
        self.variables.push((variable.text.clone(), symbol));
        what(self);
        self.variables.pop();
    }

    /// An end of a chain: what it names, and its arguments.
    fn end(&mut self, end: &ChainEnd) {
        match &end.kind {
            None => self.thing_path(&end.path),
            Some(_) => self.indices(&end.path.name),
        }
        let arguments = end.arguments.as_deref().unwrap_or(&[]);
        let thing = self.index.body(self.body).things.get(&end.path.name.text).copied();
        let model = thing.filter(|_| end.kind.is_some()).and_then(|id| self.index.inside(id));
        for argument in arguments {
            if let (Some(model), Some(label)) = (model, &argument.label) {
                let known = self.index.body(model).values.get(&label.name.text).copied();
                if let Some(symbol) = known {
                    self.index.mention(label.name.span, symbol, Role::Use);
                }
            }
            self.argument(&argument.value);
        }
        self.implied(end, arguments);
    }

    /// An element without a value takes that of its name.
    fn implied(&mut self, end: &ChainEnd, arguments: &[Argument]) {
        let Some(row) = end.kind.as_ref().and_then(|kind| element(&kind.text)) else { return };
        let takes = !row.shape.is_junction() && !row.noun.ends_with("detector");
        let initial = |argument: &Argument| {
            let label = argument.label.as_ref();
            label.is_some_and(|label| label.name.text.ends_with('0') && !label.derivative)
        };
        if !takes || !arguments.iter().all(initial) {
            return;
        }
        let name = &end.path.name;
        let Some(symbol) = self.index.body(self.body).values.get(&name.text).copied() else {
            return;
        };
        // Its value would stand in brackets after the name and its indices, or before the first argument.
        let after = match arguments.first() {
            Some(first) => Span { end: first.span.start, ..first.span },
            None => Span { start: end.path.span.end, ..end.path.span },
        };
        self.index.mentions.push(Mention { span: name.span, symbol, role: Role::Implied, after });
    }

    fn argument(&mut self, value: &Value) {
        match value {
            Value::Expr(expr) => self.expression(expr),
            Value::Matrix(rows) => rows.iter().flatten().for_each(|expr| self.expression(expr)),
            Value::Bond(from, to) => {
                self.thing_path(from);
                self.thing_path(to);
            }
            Value::Text(_) => {}
        }
    }

    fn expression(&mut self, expr: &Expr) {
        expr.leaves(&mut |leaf, span| match leaf {
            Leaf::Quantity(..) => {}
            Leaf::Name(path) => self.value_path(path),
            Leaf::Call(call) => self.call(call),
            Leaf::Sum(sum) => self.sum(sum, span),
        });
    }

    fn sum(&mut self, sum: &Sum, span: Span) {
        self.expression(&sum.range.0);
        self.expression(&sum.range.1);
        self.within(&sum.variable, span, |place| place.expression(&sum.term));
    }

    fn call(&mut self, call: &Call) {
        let reads = READINGS.contains(&call.name.text.as_str());
        for argument in call.rows.iter().flatten() {
            match &argument.value {
                Value::Expr(expr) if reads => match &*expr.node {
                    crate::expr::Node::Leaf(Leaf::Name(path)) => self.thing_path(path),
                    _ => self.expression(expr),
                },
                value => self.argument(value),
            }
        }
        if let Some(index) = &call.index {
            self.expression(index);
        }
    }

    /// What stands in square brackets after a name.
    fn indices(&mut self, part: &Part) {
        part.indices.iter().for_each(|index| self.expression(index));
    }

    /// A value of this body.
    fn value(&mut self, part: &Part) {
        self.indices(part);
        let variable = self.variables.iter().rev().find(|(name, _)| *name == part.text);
        let symbol = match variable {
            Some((_, symbol)) => Some(*symbol),
            None => self.index.body(self.body).values.get(&part.text).copied(),
        };
        if let Some(symbol) = symbol {
            self.index.mention(part.span, symbol, Role::Use);
        }
    }

    /// `x`, `motor.speed`
    fn value_path(&mut self, path: &Path) {
        let Some((last, instances)) = path.members.split_last() else {
            return self.value(&path.name);
        };
        let parts = std::iter::once(&path.name).chain(instances);
        let Some(body) = self.follow(parts) else { return };
        self.indices(last);
        if let Some(symbol) = self.index.body(body).values.get(&last.text).copied() {
            self.index.mention(last.span, symbol, Role::Use);
        }
    }

    /// `rod`, `t.1`, `motor.rotor`
    fn thing_path(&mut self, path: &Path) {
        self.follow(path.parts());
    }

    /// Notes the elements and instances of a path; gives the body that its last one leads into.
    fn follow<'p>(&mut self, parts: impl Iterator<Item = &'p Part>) -> Option<BodyId> {
        let mut body = Some(self.body);
        for part in parts {
            self.indices(part);
            let symbol =
                body.and_then(|body| self.index.body(body).things.get(&part.text).copied());
            if let Some(symbol) = symbol {
                self.index.mention(part.span, symbol, Role::Use);
            }
            body = symbol.and_then(|symbol| self.index.inside(symbol));
        }
        body
    }
}
