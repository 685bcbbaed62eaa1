//! Expressions of netlists, by the shared grammar with SPICE's leaves.

use super::cursor::node_name;
use super::functions::Calls;
use super::linked;
use super::number;
use super::{analyses, calls, random};
use crate::diagnostic::Diagnostic;
use crate::expr::parse::{self, Language, Role};
use crate::expr::{self, Node, Table};
use crate::netlist::dialects::{Dialect, Reading};
use crate::netlist::{Expr, Leaf, Names, Operator};
use crate::source::{FileId, Span};
use pest::Parser;
use pest::iterators::Pair;
use std::sync::Arc;

use grammar::{Grammar, Rule};

#[allow(missing_docs)]
mod grammar {
    #[derive(pest_derive::Parser)]
    #[grammar = "grammar/expression.pest"]
    #[grammar = "grammar/spice.pest"]
    pub struct Grammar;
}

/// Reads an expression that stands at byte `offset` of a file. Errors are pushed.
pub fn expression(
    text: &str,
    names: &mut Names,
    dialect: &Dialect,
    file: FileId,
    offset: usize,
    d: &mut Vec<Diagnostic>,
) -> Option<Expr> {
    with_calls(text, names, dialect, dialect.reading(), None, (file, offset), d)
}

/// The same; calls of unknown functions are noted, where there is a place for them.
pub fn with_calls(
    text: &str,
    names: &mut Names,
    dialect: &Dialect,
    reading: Reading,
    calls: Option<&mut Calls>,
    (file, offset): (FileId, usize),
    d: &mut Vec<Diagnostic>,
) -> Option<Expr> {
    let place = |from: usize, to: usize| Span::new(file, offset + from, offset + to);
    if let Some(at) = parse::nesting(text, None) {
        d.push(parse::too_deep(place(at, at + 1)));
        return None;
    }
    if let Some((count, from)) = polynomial_head(text) {
        return polynomial(text, count, from, names, dialect, reading, calls, (file, offset), d);
    }
    let marked = reading.colons.then(|| mark_colons(text)).flatten();
    let text = marked.as_deref().unwrap_or(text);
    let mut pairs = match Grammar::parse(Rule::whole, text) {
        Ok(pairs) => pairs,
        Err(error) => {
            d.push(syntax_error(text, &error, file, offset));
            return None;
        }
    };
    let (spelling, dialect) = (dialect.spelling, dialect.name);
    let mut language = Spice { names, spelling, dialect, reading, calls, file, offset };
    parse::expression(&mut language, pairs.next()?, d)
}

/// The number of variables, and where they begin, of `POLY(n) x … c0 c1 …`, which Xyce reads as an expression, too.
fn polynomial_head(text: &str) -> Option<(usize, usize)> {
    let word = text.trim_start();
    let rest = word.get(4..).filter(|_| word[..4].eq_ignore_ascii_case("poly"))?.trim_start();
    let inner = rest.strip_prefix('(')?;
    let (count, behind) = inner.split_once(')')?;
    // `poly(x, y)` would be a call.
    let count = count.trim().parse().ok().filter(|count| *count > 0)?;
    (!behind.trim().is_empty()).then_some((count, text.len() - behind.len()))
}

#[allow(clippy::too_many_arguments)]
fn polynomial(
    text: &str,
    count: usize,
    from: usize,
    names: &mut Names,
    dialect: &Dialect,
    reading: Reading,
    mut calls: Option<&mut Calls>,
    (file, offset): (FileId, usize),
    d: &mut Vec<Diagnostic>,
) -> Option<Expr> {
    let mut terms = vec![];
    let (mut depth, mut begin) = (0i32, from);
    for (at, byte) in text.bytes().enumerate().skip(from).chain([(text.len(), b' ')]) {
        match byte {
            b'(' | b'{' => depth += 1,
            b')' | b'}' => depth -= 1,
            b' ' | b'\t' | b',' if depth <= 0 => {
                if begin < at {
                    let place = (file, offset + begin);
                    let own = calls.as_deref_mut();
                    let term = &text[begin..at];
                    terms.push(with_calls(term, names, dialect, reading, own, place, d)?);
                }
                begin = at + 1;
            }
            _ => {}
        }
    }
    let span = Span::new(file, offset, offset + text.len());
    if terms.len() <= count || terms.len() > linked::MOST {
        let message = "POLY(n) takes n variables, and coefficients behind them";
        d.push(Diagnostic::error("E0771", span, message));
        return None;
    }
    let coefficients = terms.split_off(count);
    Some(linked::polynomial_of(coefficients, &terms, span))
}

/// What pest found, in the words of netlists.
fn syntax_error(
    text: &str,
    error: &pest::error::Error<Rule>,
    file: FileId,
    offset: usize,
) -> Diagnostic {
    let at = match error.location {
        pest::error::InputLocation::Pos(at) | pest::error::InputLocation::Span((at, _)) => {
            at.min(text.len())
        }
    };
    let found = text[at..].chars().next();
    let end = at + found.map_or(0, char::len_utf8);
    // At the end of the text there is nothing to point at but the last character.
    let start =
        if at == end { text[..at].char_indices().next_back().map_or(0, |(k, _)| k) } else { at };
    let span = Span::new(file, offset + start, offset + end.max(start));
    let open = text.bytes().filter(|b| *b == b'(').count();
    let closed = text.bytes().filter(|b| *b == b')').count();
    let message = match found {
        None if text.trim().is_empty() => "an expression is missing".to_string(),
        None if open > closed => "the expression ends before its bracket is closed".to_string(),
        None => "the expression ends too early".to_string(),
        Some(_) if closed > open => "a closing bracket without an opening one".to_string(),
        Some(found) => format!("the expression cannot go on with `{found}`"),
    };
    Diagnostic::error("E0705", span, message)
}

/// Stands for the colon of a name while the grammar reads it.
const COLON: char = '\u{1}';

/// The text with the colons of names marked: those that stand between letters without a blank, unless a `?` before still
/// waits for its own and no other follows. `None` where there are none.
fn mark_colons(text: &str) -> Option<String> {
    if !text.contains(':') {
        return None;
    }
    let bytes = text.as_bytes();
    let letter =
        |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'#' | b'@' | b'`');
    let mut marked = text.to_string();
    // For each open bracket, how many `?` wait for their colons.
    let mut waiting = vec![0usize];
    let mut word = None;
    for at in 0..bytes.len() {
        match bytes[at] {
            byte if letter(byte) => {
                word.get_or_insert(at);
                continue;
            }
            b'(' | b'{' => waiting.push(0),
            b')' | b'}' if waiting.len() > 1 => {
                waiting.pop();
            }
            b'?' => *waiting.last_mut()? += 1,
            b':' => {
                let named = word.is_some_and(|from| !bytes[from].is_ascii_digit());
                let goes_on = bytes.get(at + 1).is_some_and(|byte| letter(*byte));
                let last = waiting.last_mut()?;
                let needed = *last > 0 && colons_here(&bytes[at + 1..]) < *last;
                if named && goes_on && !needed {
                    marked.replace_range(at..at + 1, "\u{1}");
                    continue;
                }
                *last = last.saturating_sub(1);
            }
            _ => {}
        }
        word = None;
    }
    Some(marked)
}

/// Colons before the bracket closes that is open.
fn colons_here(bytes: &[u8]) -> usize {
    let (mut depth, mut count) = (0i32, 0);
    for byte in bytes {
        match byte {
            b'(' | b'{' => depth += 1,
            b')' | b'}' if depth == 0 => break,
            b')' | b'}' => depth -= 1,
            b':' if depth == 0 => count += 1,
            _ => {}
        }
    }
    count
}

struct Spice<'a> {
    names: &'a mut Names,
    spelling: expr::Dialect,
    dialect: &'static str,
    reading: Reading,
    calls: Option<&'a mut Calls>,
    file: FileId,
    offset: usize,
}

impl Language for Spice<'_> {
    type Rule = Rule;
    type Leaf = Leaf;
    expr::roles!(Rule);

    fn dialect(&self) -> expr::Dialect {
        self.spelling
    }

    fn span(&self, span: pest::Span<'_>) -> Span {
        Span::new(self.file, span.start() + self.offset, span.end() + self.offset)
    }

    fn atom(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = self.span(pair.as_span());
        let node = match pair.as_rule() {
            Rule::number => {
                let text = pair.as_str();
                let read = number::number(text, self.reading.numbers)?;
                d.extend(super::suffix_warning(text, &read, span));
                Node::Number(read.value)
            }
            Rule::reference => {
                let text = pair.as_str();
                if text.eq_ignore_ascii_case("time") {
                    Node::Leaf(Leaf::Time)
                } else if text.contains(COLON) {
                    let text = text.replace(COLON, ":");
                    Node::Leaf(Leaf::Parameter(self.names.intern(&text)))
                } else {
                    Node::Leaf(Leaf::Parameter(self.names.intern(text)))
                }
            }
            _ => {
                let inner = pair.into_inner().next()?;
                let rule = inner.as_rule();
                let mut parts = inner.into_inner();
                if rule == Rule::points {
                    // `TABLE {x} = (x0, y0) (x1, y1) …`
                    let mut values = vec![];
                    for part in parts {
                        values.push(parse::expression(self, part, d)?);
                    }
                    let x = values.remove(0);
                    let numbers: Option<Vec<f64>> = values.iter().map(|v| v.constant()).collect();
                    let Some(numbers) = numbers else {
                        values.insert(0, x);
                        let leaf = Leaf::Operator(Operator::Table, values);
                        return Some(Expr::new(Node::Leaf(leaf), span));
                    };
                    let Some(table) = table(&numbers) else {
                        let message = "a table takes pairs of numbers with rising abscissae";
                        d.push(Diagnostic::error("E0706", span, message));
                        return None;
                    };
                    return Some(Expr::new(Node::Table(x, Arc::new(table)), span));
                }
                if rule == Rule::braced || rule == Rule::quoted {
                    return parse::expression(self, parts.next()?, d);
                }
                // Within a probe a colon is part of a name anyway.
                let plain = |text: &str| text.replace(COLON, ":");
                let first = plain(parts.next()?.as_str());
                let first = first.as_str();
                if rule == Rule::current {
                    Node::Leaf(Leaf::Current(self.names.intern(first)))
                } else {
                    let grounds = self.reading.grounds;
                    let mut node = |word: &str| node_name(self.names, grounds, word);
                    let first = node(first);
                    let second = parts.next().map(|part| node(&plain(part.as_str())));
                    Node::Leaf(Leaf::Voltage(first, second))
                }
            }
        };
        Some(Expr::new(node, span))
    }

    /// Random values; in outputs, parts of phasors: `vm(a)`, `re(v(a))`.
    fn own_call(
        &mut self,
        name: &str,
        pair: &Pair<'_, Rule>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Option<Expr>> {
        let parts = pair.clone().into_inner();
        let given = parts.filter(|part| Self::role(part.as_rule()) == Role::Expression);
        if self.calls.is_some() && random::is_one(name, self.dialect, given.clone().count()) {
            return Some(self.random(name, given, self.span(pair.as_span()), d));
        }
        if !self.reading.parts {
            return None;
        }
        let span = self.span(pair.as_span());
        let text = pair.as_str().replace(COLON, ":");
        if let Some(leaf @ Leaf::Part(..)) = analyses::reading(self.names, &self.reading, &text) {
            return Some(Some(Expr::new(Node::Leaf(leaf), span)));
        }
        // What the table of functions makes of these is right of real numbers alone.
        let parts = ["re", "im", "img", "r"];
        let lower = text.to_ascii_lowercase();
        if parts.iter().any(|part| part.eq_ignore_ascii_case(name))
            && (lower.contains("v(") || lower.contains("i("))
        {
            let message =
                format!("`{name}` is taken of a voltage or a current, not of an expression");
            let error = Diagnostic::error("E0773", span, message);
            d.push(error.help("`re(v(a))`, `im(v(a,b))`, `re(i(r1))`, `vr(a)`, `vi(a)`"));
            return Some(None);
        }
        None
    }

    /// `table(x, x0, y0, …)` and `pwl(x, x0, y0, …)`.
    fn call(&mut self, name: &str, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = self.span(pair.as_span());
        let folded = name.to_ascii_lowercase();
        let row = calls::find(&folded);
        if row.is_none() && folded != "table" && folded != "pwl" && self.calls.is_none() {
            d.push(parse::unknown_function(self.spelling, name, span));
            return None;
        }
        let mut arguments = vec![];
        for part in pair.into_inner().filter(|part| Self::role(part.as_rule()) == Role::Expression)
        {
            arguments.push(parse::expression(self, part, d)?);
        }
        if let Some(row) = row {
            return calls::apply(row, arguments, span, d);
        }
        if folded != "table" && folded != "pwl" {
            let leaf = self.calls.as_mut()?.add(self.names, name, arguments, span);
            return Some(Expr::new(Node::Leaf(leaf), span));
        }
        // Points that follow from parameters are known when these are.
        let open = arguments.iter().skip(1).any(|point| point.constant().is_none());
        if open && folded == "table" && arguments.len() % 2 == 1 && arguments.len() > 2 {
            return Some(Expr::new(Node::Leaf(Leaf::Operator(Operator::Table, arguments)), span));
        }
        let mut arguments = arguments.into_iter();
        let x = arguments.next();
        let points: Option<Vec<f64>> = arguments.map(|point| point.constant()).collect();
        let table = points.and_then(|points| table(&points));
        match (x, table) {
            (Some(x), Some(table)) => {
                let (x, table) = match (folded == "pwl").then(|| unclamped(&x, &table)) {
                    Some(Some(inner)) => (inner, table),
                    // Beyond its ends ngspice's pwl() goes on with its last slopes.
                    Some(None) => (x, extrapolated(table)),
                    None => (x, table),
                };
                Some(Expr::new(Node::Table(x, Arc::new(table)), span))
            }
            _ => {
                let message =
                    format!("`{name}` takes x and pairs of numbers with rising abscissae");
                d.push(Diagnostic::error("E0706", span, message));
                None
            }
        }
    }
}

impl Spice<'_> {
    fn random<'i>(
        &mut self,
        name: &str,
        parts: impl Iterator<Item = Pair<'i, Rule>>,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let mut arguments = vec![];
        for part in parts {
            arguments.push(parse::expression(self, part, d)?);
        }
        let number = self.calls.as_mut()?.draw();
        random::apply(name, self.dialect, &arguments, number, span, d)
    }
}

/// A table of x0, y0, x1, y1, … with rising x.
pub fn table(points: &[f64]) -> Option<Table> {
    let rising = points.chunks(2).zip(points.chunks(2).skip(1)).all(|(a, b)| a[0] < b[0]);
    let finite = points.iter().all(|value| value.is_finite());
    if points.is_empty() || points.len() % 2 == 1 || !rising || !finite {
        return None;
    }
    let column = |k: usize| points.chunks(2).map(|pair| pair[k]).collect();
    Some(Table::lines(column(0), column(1)))
}

/// x, where the argument is `min(max(x, first), last)`: a table that holds its ends, as a netlist for ngspice has to
/// write it.
fn unclamped(argument: &Expr, table: &Table) -> Option<Expr> {
    let limited = |expr: &Expr, function, limit: Option<&f64>| match &*expr.node {
        Node::Call(called, arguments) if *called == function && arguments.len() == 2 => {
            (arguments[1].as_number().as_ref() == limit).then(|| arguments[0].clone())
        }
        _ => None,
    };
    let above = limited(argument, expr::Function::Min, table.x.last())?;
    limited(&above, expr::Function::Max, table.x.first())
}

/// The table with its end slopes going on, by a point very far out on either side.
fn extrapolated(mut table: Table) -> Table {
    let n = table.x.len();
    if n < 2 {
        return table;
    }
    let slope = |k: usize| (table.y[k + 1] - table.y[k]) / (table.x[k + 1] - table.x[k]);
    let (first, last) = (slope(0), slope(n - 2));
    let far = 1e15 * (table.x[n - 1].abs() + table.x[0].abs());
    let (before, after) = (table.y[0] - first * far, table.y[n - 1] + last * far);
    if before.is_finite() && after.is_finite() {
        table.x.insert(0, table.x[0] - far);
        table.y.insert(0, before);
        table.x.push(table.x[n] + far);
        table.y.push(after);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Binary, Function};
    use crate::netlist::dialects::NGSPICE;

    fn read(text: &str) -> (Option<Expr>, Names, Vec<Diagnostic>) {
        let (mut names, mut d) = (Names::default(), vec![]);
        let expr = expression(text, &mut names, &NGSPICE, FileId(0), 0, &mut d);
        (expr, names, d)
    }

    fn value(text: &str, x: f64) -> f64 {
        let (expr, names, d) = read(text);
        assert!(d.is_empty(), "{text}: {d:?}");
        expr.unwrap().evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(name) if names.text(*name) == "x" => x,
            Leaf::Time => 100.0,
            Leaf::Voltage(a, None) if names.text(*a) == "n+" => 7.0,
            Leaf::Voltage(a, Some(b)) if names.text(*a) == "a" && names.text(*b) == "x1.b" => 5.0,
            Leaf::Current(a) if names.text(*a) == "v.x1.v1" => 3.0,
            other => panic!("{other:?}"),
        })
    }

    #[test]
    fn values_as_ngspice_has_them() {
        for (text, expected) in [
            ("1+2*3", 7.0),
            ("2**3**2", 64.0),
            ("-2^2", -4.0),
            ("(-0.3)^3", 0.027),
            ("pow(-2,3)", 8.0),
            ("pwr(-2,3)", -8.0),
            ("x > 1 ? 5 : 6", 5.0),
            ("x<1?5:x==2?7:8", 7.0),
            ("(x>1 && x<3) || !x", 1.0),
            ("u(x)+u(0)+uramp(-1)+sgn(-x)", 0.5),
            ("V(n+) - v( a , x1.b ) * I(v.x1.v1) + TIME", 7.0 - 15.0 + 100.0),
            ("{x}*1k+2meg", 2002000.0),
            ("log(1)+ln(1)+LOG10(100)", 2.0),
            ("table(x, 0,0, 1,10)", 10.0),
            ("pwl(x, 0,0, 1,10)", 20.0),
            ("min(x,max(1,5))", 2.0),
            ("if(x, 3, 4)", 3.0),
        ] {
            assert!((value(text, 2.0) - expected).abs() < 1e-12, "{text} = {}", value(text, 2.0));
        }
        assert_eq!(value("pwl(x, 0,0, 1,10)", -1.0), -10.0);
        assert_eq!(value("pwl(min(max(x,0),1), 0,0, 1,10)", 2.0), 10.0);
        let (expr, _, _) = read("pwl(min(max(2*x,-1),1), -1,0, 1,10)");
        assert!(
            matches!(&*expr.unwrap().node, Node::Table(x, _) if matches!(*x.node, Node::Binary(..)))
        );
    }

    #[test]
    fn powers_are_of_the_magnitude() {
        let (expr, _, _) = read("x**y");
        assert!(matches!(*expr.unwrap().node, Node::Call(Function::PowerOfAbs, _)));
        let (expr, _, _) = read("x*y");
        assert!(matches!(*expr.unwrap().node, Node::Binary(Binary::Multiply, ..)));
    }

    #[test]
    fn errors_point_at_the_place() {
        for (text, code, at) in [
            ("1+", "E0705", 1),
            ("(1+2", "E0705", 3),
            ("1+2)", "E0705", 3),
            ("", "E0705", 0),
            ("1 $ 2", "E0705", 2),
            ("nosuch(1)", "E0210", 0),
            ("table(x, 1, 2, 0, 3)", "E0706", 0),
        ] {
            let (expr, _, d) = read(text);
            assert!(expr.is_none(), "{text}");
            assert_eq!((d[0].code, d[0].labels[0].span.start), (code, at), "{text}: {d:?}");
        }
        assert_eq!(read(&"(".repeat(100_000)).2[0].code, "E0110");
        assert!(read(&("x".to_string() + &"+x".repeat(10_000))).0.is_some());
    }
}
