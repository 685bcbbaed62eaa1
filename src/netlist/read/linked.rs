//! E, G, F, H and B: gains, polynomials, laws, tables, functions of s.

use super::{Cursor, Reader, expression, passive};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::netlist::{Element, Expr, Leaf, Name, Nodes, Operator};
use crate::source::Span;
use std::sync::Arc;

/// What E and G may say after their nodes.
pub enum Linked {
    /// A gain and two nodes.
    Gain(Expr, [Name; 2]),
    /// A law.
    Law(Expr),
}

/// Variables of a polynomial, and coefficients, at most.
pub const MOST: usize = 1000;

/// The rest of a card of E or G.
pub fn linked(reader: &mut Reader, cursor: &mut Cursor) -> Option<Linked> {
    let mut ahead = *cursor;
    let (word, from) = ahead.word();
    ahead.blanks();
    let keyed = matches!(ahead.peek(), Some(b'=' | b'{' | b'\'' | b'('));
    let is = |keyword: &str| word.eq_ignore_ascii_case(keyword) && keyed;
    if is("value") || is("vol") || is("cur") {
        *cursor = ahead;
        cursor.take(b'=');
        return Some(Linked::Law(law(reader, cursor)?));
    }
    // The expression may stand without braces: `TABLE V(a,b) = (…)`.
    let bare = || {
        let mut after = ahead;
        after.word();
        word.eq_ignore_ascii_case("table") && after.peek() == Some(b'(')
    };
    if is("table") || bare() {
        *cursor = ahead;
        cursor.take(b'=');
        let x = passive::law(reader, cursor, "the expression of the table")?;
        return Some(Linked::Law(table(reader, cursor, x)?));
    }
    if is("laplace") {
        *cursor = ahead;
        cursor.take(b'=');
        let input = reader.value(cursor, "the input")?;
        cursor.take(b'=');
        return Some(Linked::Law(transfer(reader, cursor, input)?));
    }
    if is("freq") || is("chebyshev") {
        let span = cursor.span(reader, from, from + word.len());
        let message = format!("`{word}` is not read");
        let error = Diagnostic::error("E0769", span, message);
        reader.diagnostics.push(
            error
                .because("a table over frequency has no equation in time")
                .help("a rational function of s can be given with LAPLACE"),
        );
        return None;
    }
    if is("poly") {
        *cursor = ahead;
        let count = variables(reader, cursor, from)?;
        let mut inputs = vec![];
        for _ in 0..count {
            let plus = reader.node(cursor, "a controlling node")?;
            let minus = reader.node(cursor, "a controlling node")?;
            inputs.push(voltage(reader, plus, minus));
        }
        cursor.loose();
        return Some(Linked::Law(polynomial(reader, cursor, &inputs)?));
    }
    let first = reader.node(cursor, "the first controlling node")?;
    let second = reader.node(cursor, "the second controlling node")?;
    cursor.loose();
    // LTspice: the input stands before the word.
    let mut ahead = *cursor;
    if let Some((key, _)) = ahead.key() {
        let input = || voltage(reader, first, second);
        if key.eq_ignore_ascii_case("laplace") {
            let input = input();
            *cursor = ahead;
            return Some(Linked::Law(transfer(reader, cursor, input)?));
        }
        if key.eq_ignore_ascii_case("table") {
            let input = input();
            *cursor = ahead;
            return Some(Linked::Law(table(reader, cursor, input)?));
        }
    }
    Some(Linked::Gain(reader.value(cursor, "the gain")?, [first, second]))
}

fn voltage(reader: &Reader, plus: Name, minus: Name) -> Expr {
    let ground = reader.names.text(minus) == "0";
    Expr::leaf(Leaf::Voltage(plus, (!ground).then_some(minus)))
}

/// E.
pub fn vcvs(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    Some(match linked(reader, cursor)? {
        Linked::Gain(gain, control) => Element::Vcvs { gain, control },
        Linked::Law(law) => Element::BehaviouralVoltage { law },
    })
}

/// G.
pub fn vccs(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    Some(match linked(reader, cursor)? {
        Linked::Gain(gain, control) => Element::Vccs { gain, control },
        Linked::Law(law) => Element::BehaviouralCurrent { law },
    })
}

/// What F and H may say after their nodes.
enum Current {
    Gain(Expr, Name),
    Law(Expr),
}

fn current(reader: &mut Reader, cursor: &mut Cursor) -> Option<Current> {
    let mut ahead = *cursor;
    let (word, from) = ahead.node();
    if word.eq_ignore_ascii_case("poly") {
        *cursor = ahead;
        let count = variables(reader, cursor, from)?;
        let mut inputs = vec![];
        for _ in 0..count {
            inputs.push(Expr::leaf(Leaf::Current(control(reader, cursor)?)));
        }
        cursor.loose();
        return Some(Current::Law(polynomial(reader, cursor, &inputs)?));
    }
    let control = control(reader, cursor)?;
    cursor.loose();
    Some(Current::Gain(reader.value(cursor, "the gain")?, control))
}

/// F.
pub fn cccs(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    Some(match current(reader, cursor)? {
        Current::Gain(gain, control) => Element::Cccs { gain, control },
        Current::Law(law) => Element::BehaviouralCurrent { law },
    })
}

/// H.
pub fn ccvs(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    Some(match current(reader, cursor)? {
        Current::Gain(gain, control) => Element::Ccvs { gain, control },
        Current::Law(law) => Element::BehaviouralVoltage { law },
    })
}

/// The name of a controlling device.
pub fn control(reader: &mut Reader, cursor: &mut Cursor) -> Option<Name> {
    let (word, from) = cursor.node();
    if word.is_empty() {
        reader.missing(cursor, "the name of the controlling device");
        return None;
    }
    Some(reader.name((word, from)))
}

/// B: `V=`, `I=`, and LTspice's `R=`.
pub fn behavioural(
    reader: &mut Reader,
    cursor: &mut Cursor,
    _: &mut Nodes<Name>,
) -> Option<Element> {
    let here = cursor.here(reader);
    match cursor.key() {
        Some(("v" | "V", _)) => Some(Element::BehaviouralVoltage { law: law(reader, cursor)? }),
        Some(("i" | "I", _)) => Some(Element::BehaviouralCurrent { law: law(reader, cursor)? }),
        Some(("r" | "R", _)) => Some(Element::Resistor { value: law(reader, cursor)? }),
        _ => {
            reader.diagnostics.push(Diagnostic::error("E0703", here, "`V=` or `I=` is missing"));
            cursor.at = cursor.text.len();
            None
        }
    }
}

/// A law: `{…}`, `'…'`, or the rest of the line as it stands.
fn law(reader: &mut Reader, cursor: &mut Cursor) -> Option<Expr> {
    let (rest, from) = cursor.rest();
    let to = from + rest.len();
    if rest.is_empty() {
        reader.missing(cursor, "the expression");
        return None;
    }
    cursor.at = cursor.text.len();
    reader.grouped(cursor, from, to)
}

/// `= (x0, y0) (x1, y1) …` behind the expression; brackets, `=` and commas may be missing.
fn table(reader: &mut Reader, cursor: &mut Cursor, x: Expr) -> Option<Expr> {
    cursor.take(b'=');
    let (mut points, from) = (vec![], cursor.at);
    cursor.loose();
    while !cursor.is_done() {
        points.push(reader.value(cursor, "a number")?.as_number());
        cursor.loose();
    }
    let points: Option<Vec<f64>> = points.into_iter().collect();
    match points.and_then(|points| expression::table(&points)) {
        Some(table) => {
            let span = x.span;
            Some(Expr::new(Node::Table(x, Arc::new(table)), span))
        }
        None => {
            let span = cursor.span(reader, from, cursor.text.len());
            let message = "a table takes pairs of numbers with rising abscissae";
            reader.diagnostics.push(Diagnostic::error("E0706", span, message));
            None
        }
    }
}

/// H(s) behind its input.
fn transfer(reader: &mut Reader, cursor: &mut Cursor, input: Expr) -> Option<Expr> {
    let from = cursor.at;
    let function = passive::law(reader, cursor, "the function of s")?;
    let span = cursor.span(reader, from, cursor.at);
    Some(Expr::new(Node::Leaf(Leaf::Operator(Operator::Transfer, vec![input, function])), span))
}

/// `(n)` behind POLY.
fn variables(reader: &mut Reader, cursor: &mut Cursor, from: usize) -> Option<usize> {
    cursor.loose();
    let count = reader.value(cursor, "the number of variables")?;
    let read = count.as_number().filter(|n| n.trunc() == *n && (1.0..=MOST as f64).contains(n));
    match read {
        Some(count) => Some(count as usize),
        None => {
            let span = cursor.span(reader, from, cursor.at);
            let message = format!("POLY(n) takes a whole number from 1 to {MOST}");
            reader.diagnostics.push(Diagnostic::error("E0771", span, message));
            None
        }
    }
}

/// The coefficients of a polynomial, in SPICE's order: 1, x, y, x², x·y, y², x³, x²·y and so on.
fn polynomial(reader: &mut Reader, cursor: &mut Cursor, inputs: &[Expr]) -> Option<Expr> {
    let from = cursor.at;
    let mut coefficients = vec![];
    while !cursor.is_done() && cursor.clone().key().is_none() {
        coefficients.push(reader.value(cursor, "a coefficient")?);
        if coefficients.len() > MOST {
            let span = cursor.span(reader, from, cursor.at);
            let message = format!("more than {MOST} coefficients");
            reader.diagnostics.push(Diagnostic::error("E0771", span, message));
            return None;
        }
        cursor.loose();
    }
    if coefficients.is_empty() {
        reader.missing(cursor, "the first coefficient");
        return None;
    }
    let span = cursor.span(reader, from, cursor.at);
    Some(polynomial_of(coefficients, inputs, span))
}

/// A polynomial. One coefficient of one variable is that of x.
pub fn polynomial_of(mut coefficients: Vec<Expr>, inputs: &[Expr], span: Span) -> Expr {
    if coefficients.len() == 1 && inputs.len() == 1 {
        coefficients.insert(0, Expr::number(0.0));
    }
    sum(coefficients, inputs, span)
}

fn sum(coefficients: Vec<Expr>, inputs: &[Expr], span: Span) -> Expr {
    let mut coefficients = coefficients.into_iter();
    let mut terms: Vec<Expr> =
        coefficients.next().filter(|first| !is_zero(first)).into_iter().collect();
    // Powers of one degree, each as the numbers of its variables, none before the one to its left.
    let mut powers: Vec<Vec<usize>> = (0..inputs.len()).map(|k| vec![k]).collect();
    while coefficients.len() > 0 {
        for (power, coefficient) in powers.iter().zip(coefficients.by_ref()) {
            if is_zero(&coefficient) {
                continue;
            }
            let product = power.iter().fold(coefficient, |product, k| {
                product.binary(Binary::Multiply, inputs[*k].clone())
            });
            terms.push(product);
        }
        let higher = powers.iter().flat_map(|power| {
            let last = power.last().copied().unwrap_or(0);
            (last..inputs.len()).map(move |k| [power.as_slice(), &[k]].concat())
        });
        powers = higher.take(coefficients.len()).collect();
    }
    // Balanced, so that many terms stay shallow.
    while terms.len() > 1 {
        let pairs = terms.chunks(2).map(|pair| match pair {
            [a, b] => a.clone().binary(Binary::Add, b.clone()),
            rest => rest[0].clone(),
        });
        terms = pairs.collect();
    }
    let expr = terms.pop().unwrap_or(Expr::number(0.0));
    Expr { span, ..expr }
}

fn is_zero(expr: &Expr) -> bool {
    expr.as_number() == Some(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::Names;

    #[test]
    fn powers_come_in_the_order_of_spice() {
        let mut names = Names::default();
        let [x, y] = ["x", "y"].map(|name| names.intern(name));
        let inputs = [x, y].map(|name| Expr::leaf(Leaf::Voltage(name, None)));
        // 1, x, y, x², x·y, y², x³, x²·y, x·y², y³ at x = 2, y = 3
        let values = [1.0, 2.0, 3.0, 4.0, 6.0, 9.0, 8.0, 12.0, 18.0, 27.0];
        for (k, expected) in values.into_iter().enumerate() {
            let mut coefficients = vec![Expr::number(0.0); k];
            coefficients.push(Expr::number(1.0));
            let law = sum(coefficients, &inputs, Span::NONE);
            let value = law.evaluate(&mut |leaf| match leaf {
                Leaf::Voltage(name, _) if *name == x => 2.0,
                _ => 3.0,
            });
            assert_eq!(value, expected, "coefficient {k}");
        }
    }
}
