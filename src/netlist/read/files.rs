//! Numbers from the files that cards name: `PWL FILE "name"`, `table("name")`, `akimafile("name")` and their kin.
//!
//! A file holds pairs of a time and a value, with blanks or a comma between them. A call with the name of a file is a curve
//! over time: `table("f")` and `tablefile("f")` straight lines, `fasttable` the same, `akima`, `spline`, `cubic`, `wodicka`
//! and `bli` as the calls of these names. A second argument asks for fewer points, of which no use is made: all are kept.

use super::calls::{self, What};
use super::{Cursor, Reader, expression, include};
use crate::diagnostic::Diagnostic;
use crate::expr::{Node, Table};
use crate::netlist::parts::map_leaves;
use crate::netlist::{Expr, Leaf};
use crate::source::Span;
use std::sync::Arc;

/// What stands for a curve while its expression is read; shorter than any call that names a file.
const STAND_IN: &str = "__file";

impl Reader<'_> {
    /// The numbers of a file; an error where it cannot be read or holds anything else.
    pub fn numbers_of(&mut self, name: &str, span: Span) -> Option<Vec<f64>> {
        let text = match include::data(self.map, self.file, name, self.how, span) {
            Ok(text) => text,
            Err(error) => {
                self.diagnostics.push(*error);
                return None;
            }
        };
        let mut numbers = vec![];
        let lines = text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim_start().starts_with(['*', ';', '#']));
        for (number, line) in lines {
            for word in line.split([' ', '\t', ',', ';', '\r']).filter(|word| !word.is_empty()) {
                match word.parse::<f64>() {
                    Ok(value) if value.is_finite() => numbers.push(value),
                    _ => {
                        let message = format!("`{name}` holds what is no number");
                        let error = Diagnostic::error("E0774", span, message);
                        let place = format!("line {}: `{word}`", number + 1);
                        self.diagnostics.push(error.because(place));
                        return None;
                    }
                }
            }
        }
        if numbers.is_empty() || numbers.len() % 2 == 1 {
            let message = format!("`{name}` holds no pairs of a time and a value");
            let error = Diagnostic::error("E0774", span, message);
            self.diagnostics.push(error.says(format!("{} numbers", numbers.len())));
            return None;
        }
        Some(numbers)
    }

    /// An expression whose calls name files.
    pub fn with_files(&mut self, cursor: &Cursor, from: usize, to: usize) -> Option<Expr> {
        let mut text = cursor.text[from..to].to_string();
        let mut curves: Vec<Table> = vec![];
        while let Some(open) = text.find("(\"") {
            let place = |at: usize| from + at;
            let name_end = text[open + 2..].find('"').map(|end| open + 2 + end);
            let close = name_end.and_then(|end| text[end..].find(')').map(|close| end + close));
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            let start = text[..open].trim_end().rfind(|c| !is_word(c)).map_or(0, |k| k + 1);
            let (Some(name_end), Some(close)) = (name_end, close) else {
                let span = cursor.span(self, place(open), place(open + 2));
                let error = Diagnostic::error("E0705", span, "the name of a file is not closed");
                self.diagnostics.push(error);
                return None;
            };
            let span = cursor.span(self, place(start), place(close + 1));
            let word = text[start..open].trim().to_ascii_lowercase();
            let plain = word.strip_suffix("file").unwrap_or(&word);
            let curve = match (plain, calls::find(plain)) {
                ("table", _) => Some as fn(Table) -> Option<Table>,
                (_, Some(calls::Row { what: What::Curve(curve), .. })) => *curve,
                _ => {
                    let message = format!("`{word}` takes no file");
                    self.diagnostics.push(Diagnostic::error("E0774", span, message));
                    return None;
                }
            };
            let name = text[open + 2..name_end].to_string();
            let numbers = self.numbers_of(&name, span)?;
            let Some(table) = expression::table(&numbers).and_then(curve) else {
                let message = format!("the points of `{name}` make no curve");
                let error = Diagnostic::error("E0774", span, message);
                self.diagnostics
                    .push(error.because("their times must rise, and a polynomial takes few"));
                return None;
            };
            // As long as what it stands for, so that places behind it stay right.
            let mut stand_in = format!("{STAND_IN}{}", curves.len());
            let length = close + 1 - start;
            stand_in.extend(std::iter::repeat_n(' ', length.saturating_sub(stand_in.len())));
            text.replace_range(start..=close, &stand_in);
            curves.push(table);
        }
        let expr = super::expression::with_calls(
            &text,
            &mut self.names,
            self.dialect,
            self.reading,
            Some(&mut self.calls),
            (self.file, cursor.base + from),
            self.diagnostics,
        )?;
        let curves: Vec<Arc<Table>> = curves.into_iter().map(Arc::new).collect();
        Some(map_leaves(&expr, &mut |leaf, span| {
            let curve = match leaf {
                Leaf::Parameter(name) => self
                    .names
                    .text(*name)
                    .strip_prefix(STAND_IN)
                    .and_then(|number| number.parse::<usize>().ok())
                    .and_then(|number| curves.get(number)),
                _ => None,
            };
            let node = match curve {
                Some(table) => Node::Table(Expr::leaf(Leaf::Time), table.clone()),
                None => Node::Leaf(leaf.clone()),
            };
            Expr::new(node, span)
        }))
    }
}
