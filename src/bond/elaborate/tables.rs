//! Functions given by points: `pwl` over time, `table` over anything, from the text or from a file.
//!
//! A table's file holds two columns of plain numbers in SI, separated by commas, semicolons or blanks, the first column
//! rising. Lines that begin with `#` and empty ones are skipped. A first line that holds no number is a header; a unit in
//! square brackets in it, `angle [deg]`, holds for its column.

use super::scope::Scope;
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Call, File, Name, Value, data_files};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Node, Table};
use crate::quantity::{Dimension, Unit};
use crate::source::{FileId, SourceMap, Span, loader};
use std::sync::Arc;

/// Reads the files of the tables that a text speaks of into the map, unless they are there.
pub fn load_tables(file: &File, map: &mut SourceMap, d: &mut Vec<Diagnostic>) {
    for name in data_files(file) {
        let path = map.beside(name.span.file, &name.text);
        if map.find(&path).is_some() {
            continue;
        }
        let Err(error) = loader::load(&path, map) else { continue };
        d.push(Diagnostic::from(error).label(name.span, "the file of this table"));
    }
}

impl Scope<'_> {
    /// `pwl(t0, y0; t1, y1; …)`
    pub fn points(&mut self, call: &Call, span: Span, d: &mut Vec<Diagnostic>) -> Option<Waveform> {
        let what = "a waveform's argument";
        let form = |span, message: &str| {
            Diagnostic::error("E0216", span, message)
                .help("its form is `pwl(t0, y0; t1, y1; …)`, each point a time and a value")
        };
        let mut points = vec![];
        let mut last = f64::NEG_INFINITY;
        let mut failed = false;
        for row in &call.rows {
            let (t, y) = match row.as_slice() {
                [t, y] if t.label.is_none() && y.label.is_none() => match (&t.value, &y.value) {
                    (Value::Expr(t), Value::Expr(y)) => (t, y),
                    _ => {
                        d.push(form(t.span.join(y.span), "a point of `pwl` is two values"));
                        return None;
                    }
                },
                _ => {
                    let at =
                        row.iter().map(|argument| argument.span).reduce(Span::join).unwrap_or(span);
                    let says = match row.len() {
                        1 => "only one value".to_string(),
                        n => format!("{n} values"),
                    };
                    d.push(form(at, "a point of `pwl` is a time and a value").says(says));
                    return None;
                }
            };
            let place = Place::constant(what);
            let (time, value) = (self.lower(t, place, d), self.lower(y, place, d));
            if let Some(at) = time.as_ref().and_then(|time| self.evaluate(time, what, t.span, d)) {
                if at < last {
                    d.push(
                        form(t.span, "the times of `pwl` must not decrease")
                            .says("earlier than the point before"),
                    );
                    failed = true;
                }
                last = at;
            }
            match (time, value) {
                (Some(time), Some(value)) => points.push((time, value)),
                _ => failed = true,
            }
        }
        (!failed).then_some(Waveform::Pwl(points))
    }

    /// `table(x, [x0, y0; x1, y1; …])`, `table(x, file("name.csv"))`
    pub fn table(
        &mut self,
        call: &Call,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let arguments = match call.rows.as_slice() {
            [row] => row.as_slice(),
            _ => &[],
        };
        let [Argument { label: None, value: Value::Expr(x), .. }, points] = arguments else {
            d.push(form(span, "`table` takes a value and its points"));
            return None;
        };
        let argument = self.lower(x, place, d);
        let table = match (&points.label, &points.value) {
            (None, Value::Matrix(rows)) => self.points_of_text(rows, span, d),
            (None, Value::Expr(expr)) if let Some(name) = file_of(expr) => {
                self.points_of_file(name, d)
            }
            _ => {
                d.push(form(points.span, "`table` takes a value and its points"));
                None
            }
        };
        Some(Tree::new(Node::Table(argument?, table?), span))
    }

    /// The points of `[x0, y0; x1, y1; …]`.
    fn points_of_text(
        &mut self,
        rows: &[Vec<syntax::Expr>],
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Arc<Table>> {
        let mut table = Table::lines(vec![], vec![]);
        let mut failed = rows.is_empty();
        for row in rows {
            let [x, y] = row.as_slice() else {
                let at = row.iter().map(|entry| entry.span).reduce(Span::join).unwrap_or(span);
                d.push(form(at, "each row of a table is a pair"));
                return None;
            };
            let what = "an entry of a table";
            match (self.entry(x, what, d), self.entry(y, what, d)) {
                (Some(at), Some(value)) => {
                    if table.x.last().is_some_and(|last| *last >= at) {
                        d.push(not_rising(x.span));
                        failed = true;
                    }
                    table.x.push(at);
                    table.y.push(value);
                }
                _ => failed = true,
            }
        }
        (!failed).then(|| Arc::new(table))
    }

    /// The points of a file, which has been read before.
    fn points_of_file(&mut self, name: &Name, d: &mut Vec<Diagnostic>) -> Option<Arc<Table>> {
        let path = self.map.beside(name.span.file, &name.text);
        let file = self.map.find(&path);
        if let Some(known) = file.and_then(|file| self.tables.get(&file)) {
            return known.clone();
        }
        // Whoever read the files has said what is wrong with one.
        let said = d.iter().any(|known| known.labels.iter().any(|label| label.span == name.span));
        let Some(file) = file.filter(|_| !said) else {
            if !said {
                d.push(
                    Diagnostic::error("E0901", name.span, format!("no file `{path}`"))
                        .says("was not read"),
                );
            }
            return None;
        };
        let table = read_points(self.map, file, d).map(|(table, units)| {
            self.table_units.insert(file, units);
            Arc::new(table)
        });
        self.tables.insert(file, table.clone());
        table
    }

    /// The units of the columns of a file that holds the points of a table, as far as its header gives them.
    pub(super) fn columns_of_file(&self, points: &syntax::Expr) -> Option<[Option<Dimension>; 2]> {
        let name = file_of(points)?;
        let file = self.map.find(&self.map.beside(name.span.file, &name.text))?;
        self.table_units.get(&file).copied()
    }

    /// A number of a table; an error has been reported when there is none.
    fn entry(
        &mut self,
        expr: &syntax::Expr,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let lowered = self.lower(expr, Place::constant(what), d)?;
        self.evaluate(&lowered, what, expr.span, d)
    }
}

fn form(span: Span, message: &str) -> Diagnostic {
    Diagnostic::error("E0216", span, message)
        .help("its form is `table(x, [x0, y0; x1, y1; …])` or `table(x, file(\"name.csv\"))`")
}

fn not_rising(span: Span) -> Diagnostic {
    Diagnostic::error("E0251", span, "the first column of a table must increase")
        .says("not greater than the one before")
        .help("sort the points by their first column, and say each value of it once")
}

/// The name in `file("name.csv")`.
fn file_of(expr: &syntax::Expr) -> Option<&Name> {
    let Node::Leaf(syntax::Leaf::Call(call)) = &*expr.node else { return None };
    match call.rows.as_slice() {
        [row] if call.name.text == "file" => match row.as_slice() {
            [Argument { label: None, value: Value::Text(name), .. }] => Some(name),
            _ => None,
        },
        _ => None,
    }
}

/// A field of a line, and its place.
struct Cell<'t> {
    text: &'t str,
    span: Span,
}

/// The points of a file of two columns, and the units that its header gives.
fn read_points(
    map: &SourceMap,
    file: FileId,
    d: &mut Vec<Diagnostic>,
) -> Option<(Table, [Option<Dimension>; 2])> {
    let text = &map.file(file)?.text;
    let whole = Span::new(file, 0, 0);
    let wrong = |span, message: String| {
        Diagnostic::error("E0252", span, message)
            .help("a table's file holds two columns of numbers in SI, separated by commas")
    };
    let mut table = Table::lines(vec![], vec![]);
    let mut factors = [1.0, 1.0];
    let mut units = [None, None];
    let mut first = true;
    let mut failed = false;
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let begin = start;
        start += line.len();
        let line = line.trim_end();
        if line.trim_start().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let at = |from: usize, to: usize| Span::new(file, begin + from, begin + to);
        let cells = cells(line, at);
        let [x, y] = cells.as_slice() else {
            let message = format!("a line of a table has 2 fields, this one {}", cells.len());
            d.push(wrong(at(0, line.len()), message));
            return None;
        };
        let values = [number(x.text), number(y.text)];
        if std::mem::take(&mut first) && values == [None, None] {
            for ((factor, unit), cell) in factors.iter_mut().zip(&mut units).zip([x, y]) {
                match unit_of_header(cell) {
                    Ok(Some(found)) => (*factor, *unit) = (found.factor, Some(found.dimension)),
                    Ok(None) => {}
                    Err(error) => {
                        d.push(*error);
                        failed = true;
                    }
                }
            }
            continue;
        }
        let [Some(at), Some(value)] = values else {
            let bad = if values[0].is_none() { x } else { y };
            d.push(wrong(bad.span, format!("`{}` is no number", bad.text)));
            return None;
        };
        let (at, value) = (at * factors[0], value * factors[1]);
        if table.x.last().is_some_and(|last| *last >= at) {
            d.push(not_rising(x.span));
            return None;
        }
        table.x.push(at);
        table.y.push(value);
    }
    if table.x.is_empty() && !failed {
        d.push(wrong(whole, "the file of a table holds no points".to_string()));
        return None;
    }
    (!failed).then_some((table, units))
}

/// The fields of a line: between semicolons, else between commas, tabs or blanks.
fn cells<'t>(line: &'t str, at: impl Fn(usize, usize) -> Span) -> Vec<Cell<'t>> {
    let separator = [';', ',', '\t'].into_iter().find(|separator| line.contains(*separator));
    let mut cells = vec![];
    let mut from = 0;
    let mut push = |from: usize, part: &'t str| {
        let trimmed = part.trim();
        let begin = from + (part.len() - part.trim_start().len());
        let text = trimmed.trim_matches('"');
        cells.push(Cell { text, span: at(begin, begin + trimmed.len()) });
    };
    match separator {
        Some(separator) => {
            for part in line.split(separator) {
                push(from, part);
                from += part.len() + separator.len_utf8();
            }
        }
        None => {
            for part in line.split(' ') {
                if !part.is_empty() {
                    push(from, part);
                }
                from += part.len() + 1;
            }
        }
    }
    cells
}

/// A finite number.
fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// The unit in the brackets of a header.
fn unit_of_header(cell: &Cell<'_>) -> Result<Option<Unit>, Box<Diagnostic>> {
    let bracket = cell.text.split_once('[').and_then(|(_, rest)| rest.strip_suffix(']'));
    let Some(text) = bracket.map(str::trim).filter(|text| !text.is_empty()) else {
        return Ok(None);
    };
    Unit::parse(text).map(Some).map_err(|_| {
        Box::new(
            Diagnostic::error("E0252", cell.span, format!("`{text}` is no unit"))
                .says("the unit of this column")
                .help("write units as in the language, or leave the brackets out for SI"),
        )
    })
}
