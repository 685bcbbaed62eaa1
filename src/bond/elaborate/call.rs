//! Calls of what the table of functions of expressions does not hold: readings, tables, ready laws, functions with
//! memory.

use super::functions::{self, CALLS, Make, Signature};
use super::reading::READINGS;
use super::scope::Scope;
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Call, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, FUNCTIONS, Node};
use crate::quantity::{did_you_mean, nearest};
use crate::source::Span;

impl Scope<'_> {
    /// What a call means.
    pub fn call(
        &mut self,
        call: &Call,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let name = call.name.text.as_str();
        let row = functions::find(name);
        let reads = READINGS.contains(&name);
        if let (true, Some(what)) = (reads || row.is_some_and(Signature::changes), place.constant) {
            d.push(
                Diagnostic::error(
                    "E0211",
                    span,
                    format!("`{name}(…)` changes with time, {what} does not"),
                )
                .says("only parameters and numbers can stand here"),
            );
            return None;
        }
        if reads {
            return self.reading(call, span, d);
        }
        let Some(row) = row else {
            if !self.excused(name) {
                d.push(self.unknown_call(call));
            }
            return None;
        };
        match row.make {
            Make::Table => return self.table(call, span, place, d),
            Make::Formula(make) => {
                let given = self.given(call, row, span, place, d)?;
                let values: Vec<Expr> = given.0.collect::<Option<_>>()?;
                let mut law = make(&values);
                law.span = span;
                return Some(law);
            }
            Make::Waveform(_) | Make::Points | Make::Dynamic(_) | Make::TransferFunction => {}
        }
        let Some((owner, statement)) = place.owner else {
            d.push(
                Diagnostic::error(
                    "E0225",
                    span,
                    format!("`{name}(…)` has a memory and cannot stand in what is observed"),
                )
                .says("a new signal")
                .help(format!("name it, `signal … = {name}(…)`, and observe the signal")),
            );
            return None;
        };
        let owner = owner.to_string();
        let hidden = self.hide(&owner, name, span, statement);
        let law = self.signal_call(hidden, call, row, span, statement, d)?;
        self.graph.signals[hidden.index()].law = law;
        Some(Tree::new(Node::Leaf(Leaf::Signal(hidden)), span))
    }

    fn unknown_call(&self, call: &Call) -> Diagnostic {
        let (name, span) = (call.name.text.as_str(), call.name.span);
        let error = Diagnostic::error("E0210", span, format!("unknown function `{name}`"));
        if self.value(name).is_some() {
            return Diagnostic::error(
                "E0210",
                span,
                format!("`{name}` is a value, not a function"),
            )
            .says("a parameter or signal")
            .help(format!("write a product with `*`: `{name}*(…)`"));
        }
        if name == "file" {
            return error
                .says("only in tables")
                .help("its place is `table(x, file(\"name.csv\"))`");
        }
        let own = CALLS.iter().map(|row| row.name);
        let known = FUNCTIONS.iter().map(|row| row.name).chain(own).chain(READINGS);
        match nearest(name, known) {
            Some(meant) => {
                let error = did_you_mean(error.says("not a function"), span, name, meant);
                match functions::find(meant) {
                    Some(row) => error.because(format!("its form is `{}`", row.form())),
                    None => error,
                }
            }
            None => {
                let forms: Vec<String> = CALLS.iter().map(Signature::form).collect();
                let plain: Vec<&str> = FUNCTIONS.iter().map(|row| row.name).collect();
                error
                    .says("not a function")
                    .because(format!("functions of numbers are {}", plain.join(" ")))
                    .because(format!("functions of signals are {}", forms.join(", ")))
            }
        }
    }

    /// The arguments of a call in the order of a signature; `None` where one is left out. An error has been reported
    /// when the whole is `None`.
    pub fn arguments<'c>(
        &self,
        call: &'c Call,
        row: &Signature,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Vec<Option<&'c syntax::Expr>>> {
        let wrong = |span, message: String| {
            Diagnostic::error("E0216", span, message).help(format!("its form is `{}`", row.form()))
        };
        let [arguments] = call.rows.as_slice() else {
            d.push(wrong(span, format!("`{}` takes one row of arguments, without `;`", row.name)));
            return None;
        };
        let mut found = vec![None; row.arguments.len()];
        let mut failed = false;
        for (position, Argument { label, value, span }) in arguments.iter().enumerate() {
            let slot = match label {
                None => Some(position).filter(|k| *k < found.len()),
                Some(label) if label.derivative => None,
                Some(label) => row.arguments.iter().position(|(name, _)| *name == label.name.text),
            };
            let Some(slot) = slot else {
                let error = match label {
                    Some(label) => {
                        let name = &label.name.text;
                        let error =
                            wrong(*span, format!("`{}` has no argument `{name}`", row.name));
                        match nearest(name, row.arguments.iter().map(|(name, _)| *name)) {
                            Some(meant) => did_you_mean(error, label.name.span, name, meant),
                            None => error,
                        }
                    }
                    None => wrong(*span, format!("`{}` has too many arguments", row.name)),
                };
                d.push(error);
                failed = true;
                continue;
            };
            let Value::Expr(value) = value else {
                d.push(wrong(*span, format!("`{}` takes plain values", row.name)));
                failed = true;
                continue;
            };
            if found[slot].replace(value).is_some() {
                d.push(wrong(*span, format!("`{}` is given twice", row.arguments[slot].0)));
                failed = true;
            }
        }
        let missing: Vec<String> = row.arguments[..row.required]
            .iter()
            .zip(&found)
            .filter(|(_, value)| value.is_none())
            .map(|((name, _), _)| format!("`{name}`"))
            .collect();
        if !missing.is_empty() && !failed {
            let s = if missing.len() > 1 { "s" } else { "" };
            d.push(
                wrong(span, format!("`{}` lacks its argument{s} {}", row.name, missing.join(", ")))
                    .says("incomplete"),
            );
            failed = true;
        }
        (!failed).then_some(found)
    }
}
