//! Calls of what the table of functions does not hold: readings, tables, ready laws, functions with memory.

use super::reading::READINGS;
use super::scope::{Scope, did_you_mean};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Call, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Expr as Tree, FUNCTIONS, Function, Node, Table};
use crate::quantity::nearest;
use crate::source::Span;
use std::sync::Arc;

/// The functions of time with corners, and their arguments; those after `required` may be left out.
pub(super) const WAVEFORMS: &[Signature] = &[
    Signature { name: "step", arguments: &["t0", "before", "after"], required: 3 },
    Signature { name: "ramp", arguments: &["t0", "slope"], required: 2 },
    Signature {
        name: "pulse",
        arguments: &["low", "high", "delay", "rise", "fall", "width", "period"],
        required: 7,
    },
    Signature {
        name: "sine",
        arguments: &["offset", "amplitude", "frequency", "delay", "damping", "phase"],
        required: 3,
    },
    Signature { name: "pwl", arguments: &[], required: 0 },
];

/// The functions with memory.
pub(super) const DYNAMICS: &[Signature] = &[
    Signature { name: "integ", arguments: &["x", "ic"], required: 1 },
    Signature { name: "lag", arguments: &["x", "tau", "ic"], required: 2 },
    Signature { name: "pi", arguments: &["x", "Kp", "Ki", "lo", "hi", "Kaw", "z0"], required: 1 },
];

/// Laws that stand ready: each a formula over its arguments.
const READY: &[Signature] = &[
    Signature { name: "orifice", arguments: &["e", "C", "Q0"], required: 3 },
    Signature { name: "check", arguments: &["e", "Ron", "Roff", "width"], required: 4 },
    Signature { name: "relief", arguments: &["e", "limit", "Ron", "Roff", "width"], required: 5 },
    Signature { name: "coulomb", arguments: &["f", "F", "f_break"], required: 3 },
];

/// What the language will have.
const LATER: [&str; 14] = [
    "noise",
    "leadlag",
    "pid",
    "tf",
    "delay",
    "sample",
    "rate",
    "hysteresis",
    "compare",
    "pwm",
    "sum",
    "der",
    "file",
    "gain",
];

/// A function's name and the names of its arguments.
pub(super) struct Signature {
    pub name: &'static str,
    pub arguments: &'static [&'static str],
    /// How many must be given.
    pub required: usize,
}

/// The row of a name.
pub(super) fn signature(table: &'static [Signature], name: &str) -> Option<&'static Signature> {
    table.iter().find(|row| row.name == name)
}

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
        let changing = READINGS.contains(&name)
            || signature(WAVEFORMS, name).is_some()
            || signature(DYNAMICS, name).is_some();
        if let (true, Some(what)) = (changing, place.constant) {
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
        if READINGS.contains(&name) {
            return self.reading(call, span, d);
        }
        if name == "table" {
            return self.table(call, span, place, d);
        }
        if let Some(row) = signature(READY, name) {
            let arguments = self.arguments(call, row, span, d)?;
            let values: Vec<Option<Expr>> = arguments
                .iter()
                .map(|argument| argument.and_then(|value| self.lower(value, place, d)))
                .collect();
            let values: Vec<Expr> = values.into_iter().collect::<Option<_>>()?;
            let mut law = ready(name, &values);
            law.span = span;
            return Some(law);
        }
        if changing {
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
            let law = self.signal_call(hidden, call, span, statement, d)?;
            self.graph.signals[hidden.index()].law = law;
            return Some(Tree::new(Node::Leaf(Leaf::Signal(hidden)), span));
        }
        if !self.excused.contains(name) {
            d.push(self.unknown_call(call));
        }
        None
    }

    fn unknown_call(&self, call: &Call) -> Diagnostic {
        let (name, span) = (call.name.text.as_str(), call.name.span);
        if LATER.contains(&name) {
            return Diagnostic::error(
                "E0222",
                span,
                format!("`{name}(…)` is not part of the language yet"),
            )
            .says("cannot be used yet");
        }
        let error = Diagnostic::error("E0210", span, format!("unknown function `{name}`"));
        if self.values.contains_key(name) {
            return error.says("a parameter or signal").help("write a product with `*`");
        }
        let tables = [WAVEFORMS, DYNAMICS, READY].into_iter().flatten().map(|row| row.name);
        let known =
            FUNCTIONS.iter().map(|row| row.name).chain(tables).chain(READINGS).chain(["table"]);
        match nearest(name, known) {
            Some(meant) => did_you_mean(error.says("not a function"), span, meant),
            None => error.says("not a function"),
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
        let usage = || {
            let names: Vec<String> = row
                .arguments
                .iter()
                .enumerate()
                .map(
                    |(k, name)| {
                        if k < row.required { name.to_string() } else { format!("[{name}]") }
                    },
                )
                .collect();
            format!("`{}({})`", row.name, names.join(", "))
        };
        let wrong = |span, message: String| {
            Diagnostic::error("E0216", span, message).help(format!("its form is {}", usage()))
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
                Some(label) => row.arguments.iter().position(|name| *name == label.name.text),
            };
            let Some(slot) = slot else {
                let error = match label {
                    Some(label) => {
                        let name = &label.name.text;
                        let error =
                            wrong(*span, format!("`{}` has no argument `{name}`", row.name));
                        match nearest(name, row.arguments.iter().copied()) {
                            Some(meant) => did_you_mean(error, label.name.span, meant),
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
                d.push(wrong(*span, format!("`{}` is given twice", row.arguments[slot])));
                failed = true;
            }
        }
        let missing: Vec<String> = row.arguments[..row.required]
            .iter()
            .zip(&found)
            .filter(|(_, value)| value.is_none())
            .map(|(name, _)| format!("`{name}`"))
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

    /// `table(x, [x0, y0; x1, y1; …])`
    fn table(
        &mut self,
        call: &Call,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let rows = match call.rows.as_slice() {
            [row] => match row.as_slice() {
                [Argument { label: None, value: Value::Expr(x), .. }, points]
                    if points.label.is_none() =>
                {
                    match &points.value {
                        Value::Matrix(rows) => Some((x, rows)),
                        Value::Expr(expr) if is_file(expr) => {
                            d.push(
                                Diagnostic::error(
                                    "E0222",
                                    points.span,
                                    "tables from files are not part of the language yet",
                                )
                                .says("cannot be used yet")
                                .help("write the points out: `table(x, [x0, y0; x1, y1])`"),
                            );
                            return None;
                        }
                        _ => None,
                    }
                }
                _ => None,
            },
            _ => None,
        };
        let form = |span, message: &str| {
            Diagnostic::error("E0216", span, message)
                .help("its form is `table(x, [x0, y0; x1, y1; …])`")
        };
        let Some((x, rows)) = rows else {
            d.push(form(span, "`table` takes a value and its points"));
            return None;
        };
        let argument = self.lower(x, place, d);
        let mut table = Table { x: vec![], y: vec![] };
        let mut failed = false;
        for row in rows {
            let [x, y] = row.as_slice() else {
                let at = row.first().map_or(span, |first| first.span);
                d.push(form(at, "each row of a table is a pair"));
                return None;
            };
            let what = "an entry of a table";
            match (self.entry(x, what, d), self.entry(y, what, d)) {
                (Some(at), Some(value)) => {
                    if table.x.last().is_some_and(|last| *last >= at) {
                        d.push(
                            form(x.span, "the first column of a table must increase")
                                .says("not greater than the one before"),
                        );
                        failed = true;
                    }
                    table.x.push(at);
                    table.y.push(value);
                }
                _ => failed = true,
            }
        }
        if failed {
            return None;
        }
        Some(Tree::new(Node::Table(argument?, Arc::new(table)), span))
    }

    /// A number of a table; an error has been reported when there is none.
    fn entry(
        &mut self,
        expr: &syntax::Expr,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let lowered = self.lower(expr, Place::constant(what), d)?;
        let known = d.len();
        let value = self.evaluate(&lowered, what, expr.span, d);
        if value.is_none()
            && d.len() == known
            && self.signal_dimensions.is_empty()
            && varies_in_order(&lowered)
        {
            d.push(
                Diagnostic::error(
                    "E0211",
                    expr.span,
                    "a table within a parameter can hold numbers only",
                )
                .says("a parameter stands here")
                .help("use the table where the parameter is used"),
            );
        }
        value
    }
}

/// Whether an expression speaks of parameters, which have no values while parameters are being read.
fn varies_in_order(expr: &Expr) -> bool {
    let mut any = false;
    expr.leaves(&mut |_, _| any = true);
    any
}

fn is_file(expr: &syntax::Expr) -> bool {
    matches!(&*expr.node, Node::Leaf(syntax::Leaf::Call(call)) if call.name.text == "file")
}

/// The ready laws (`orifice` is the exact inverse of Δp = C²·Q·√(Q² + Q0²); all are smooth).
fn ready(name: &str, x: &[Expr]) -> Expr {
    let number = Tree::number;
    let square = |a: Expr| a.binary(Binary::Power, number(2.0));
    let sqrt = |a: Expr| Tree::call(Function::Sqrt, vec![a]);
    let tanh = |a: Expr| Tree::call(Function::Tanh, vec![a]);
    let x = |k: usize| x[k].clone();
    match name {
        "orifice" => {
            // Q = √2·y/√(Q0² + √(Q0⁴ + 4y²)) with y = e/C².
            let y = || x(0) / square(x(1));
            let inner = sqrt(x(2).binary(Binary::Power, number(4.0)) + number(4.0) * square(y()));
            number(std::f64::consts::SQRT_2) * y() / sqrt(square(x(2)) + inner)
        }
        "check" => {
            // Q = e·(1/Roff + (1/Ron − 1/Roff)·(1 + tanh(e/width))/2), open for e > 0.
            let one = || number(1.0);
            let opening = (one() + tanh(x(0) / x(3))) / number(2.0);
            x(0) * (one() / x(2) + (one() / x(1) - one() / x(2)) * opening)
        }
        "relief" => {
            // Q = e/Roff + (s(e − limit) − s(−e − limit))/Ron with s(z) = width·ln(1 + exp(z/width)), which is z where
            // the exponential would overflow.
            let soft = |z: Expr| {
                let ratio = z.clone() / x(4);
                let far = ratio.clone().binary(Binary::Greater, number(40.0));
                let exp = Tree::call(Function::Exp, vec![ratio]);
                let near = x(4) * Tree::call(Function::Ln, vec![number(1.0) + exp]);
                Tree::choice(far, z, near)
            };
            x(0) / x(3) + (soft(x(0) - x(1)) - soft(-x(0) - x(1))) / x(2)
        }
        _ => x(1) * tanh(x(0) / x(2)),
    }
}
