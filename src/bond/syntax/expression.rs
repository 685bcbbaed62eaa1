//! Expressions of `.bg` files: what the shared grammar leaves to the language.

use super::token::UNIT_MARK;
use super::tree::{Argument, Call, Expr, Label, Leaf, Name, Part, Path, Sum, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::parse::{self, Language, Role};
use crate::expr::{Dialect, Node};
use crate::quantity::{Unit, UnitError, is_slip};
use crate::source::{FileId, Span};
use pest::iterators::Pair;

/// The parser that pest derives.
#[derive(pest_derive::Parser)]
#[grammar = "grammar/expression.pest"]
#[grammar = "grammar/bond.pest"]
pub(super) struct BondParser;

/// Knows where the parsed statement stands, and the text behind the mask.
pub(super) struct Reader<'a> {
    pub file: FileId,
    pub text: &'a str,
    pub offset: usize,
}

impl Reader<'_> {
    pub fn place(&self, pair: &Pair<'_, Rule>) -> Span {
        let span = pair.as_span();
        // A rule may have taken the blanks after its last part.
        let end = span.start() + pair.as_str().trim_end_matches([' ', '\n']).len();
        Span::new(self.file, self.offset + span.start(), self.offset + end)
    }

    fn source(&self, span: Span) -> &str {
        self.text.get(span.start as usize..span.end as usize).unwrap_or("")
    }

    pub fn name(&self, pair: &Pair<'_, Rule>) -> Name {
        let span = self.place(pair);
        Name { text: self.source(span).to_string(), span }
    }

    /// The text between quotes.
    pub fn text(&self, pair: &Pair<'_, Rule>) -> Name {
        let mut name = self.name(pair);
        name.text = name.text.trim_matches('"').to_string();
        name
    }

    /// Names joined by dots, with their indices.
    pub fn path(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Path> {
        let span = self.place(&pair);
        let mut parts = pair.into_inner();
        let name = self.part(parts.next()?, d)?;
        let mut members = vec![];
        for part in parts {
            members.push(self.part(part, d)?);
        }
        Some(Path { name, members, span })
    }

    /// A name with its indices, or the number of a port.
    pub fn part(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Part> {
        let mut span = self.place(&pair);
        let mut indices = vec![];
        for inner in pair.into_inner() {
            let before = &self.text[span.start as usize..self.place(&inner).start as usize];
            span.end = span.start + before.trim_end().len() as u32;
            for index in inner.into_inner().filter(|part| part.as_rule() == Rule::expression) {
                indices.push(self.expression(index, d)?);
            }
        }
        Some(Part { text: self.source(span).to_string(), indices, span })
    }

    /// A number with or without a unit.
    pub fn number(&self, pair: &Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = self.place(pair);
        let mut value = f64::NAN;
        let mut unit = None;
        for part in pair.clone().into_inner() {
            let place = self.place(&part);
            match part.as_rule() {
                Rule::literal => value = self.source(place).parse().unwrap_or(f64::NAN),
                _ => match bare_prefix(self.source(place)) {
                    Some(power) => {
                        d.push(self.no_unit(span, place, power));
                        return None;
                    }
                    None => unit = Some(self.unit(place, d)?),
                },
            }
        }
        let node = match unit {
            Some(unit) => {
                value = unit.to_si(value);
                Node::Leaf(Leaf::Quantity(value, unit))
            }
            None => Node::Number(value),
        };
        if !value.is_finite() {
            d.push(
                Diagnostic::error("E0107", span, "the number is too large")
                    .says("beyond the range of double precision, about 1.8e308"),
            );
            return None;
        }
        Some(Expr::new(node, span))
    }

    /// A prefix that stands on a number without a unit.
    fn no_unit(&self, span: Span, place: Span, power: &str) -> Diagnostic {
        let prefix = self.source(place);
        let literal = self.source(Span { end: place.start, ..span }).trim_end();
        let meant = match literal.contains(['e', 'E']) {
            true => format!("{literal}*1{power}"),
            false => format!("{literal}{power}"),
        };
        Diagnostic::error("E0301", place, format!("`{prefix}` is a prefix without a unit"))
            .says("no unit follows it")
            .help(format!("prefixes stand on units, never on bare numbers: write `{meant}`"))
    }

    /// The unit that stands at `span`.
    pub fn unit(&self, span: Span, d: &mut Vec<Diagnostic>) -> Option<Unit> {
        unit(self.source(span), span, d)
    }

    fn expression(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        parse::expression(self, pair, d)
    }

    fn matrix(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Vec<Vec<Expr>>> {
        let mut rows = vec![vec![]];
        for part in pair.into_inner() {
            match part.as_rule() {
                Rule::row_break => rows.push(vec![]),
                _ => {
                    let value = self.expression(part, d)?;
                    if let Some(row) = rows.last_mut() {
                        row.push(value);
                    }
                }
            }
        }
        Some(rows)
    }

    /// An argument of a call or an element.
    fn argument(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Argument> {
        let span = self.place(&pair);
        if pair.as_rule() != Rule::labelled {
            return Some(Argument { label: None, value: self.value(pair, d)?, span });
        }
        let mut parts = pair.into_inner();
        let label = parts.next()?;
        let label_span = self.place(&label);
        let inner = label.into_inner().next()?;
        let derivative = inner.as_rule() == Rule::derivative;
        let name = if derivative { inner.into_inner().next()? } else { inner };
        let label = Label { name: self.name(&name), derivative, span: label_span };
        let value = parts.find(|part| part.as_rule() != Rule::equals)?;
        Some(Argument { label: Some(label), value: self.value(value, d)?, span })
    }

    fn value(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Value> {
        Some(match pair.as_rule() {
            Rule::matrix => Value::Matrix(self.matrix(pair, d)?),
            Rule::text => Value::Text(self.text(&pair)),
            _ => Value::Expr(self.expression(pair, d)?),
        })
    }

    /// The arguments within brackets, by rows. All are read, also after an error.
    pub fn arguments<'p>(
        &mut self,
        pairs: impl Iterator<Item = Pair<'p, Rule>>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Vec<Vec<Argument>>> {
        let mut rows = vec![vec![]];
        let mut failed = false;
        let mut arrow = false;
        for pair in pairs {
            match pair.as_rule() {
                Rule::row_break => {
                    rows.push(vec![]);
                    continue;
                }
                Rule::half_arrow => {
                    arrow = true;
                    continue;
                }
                _ if arrow => {
                    arrow = false;
                    let from = rows.last_mut().and_then(Vec::pop);
                    let to = self.argument(pair, d);
                    match (from.zip(to).and_then(|(from, to)| bond(from, to, d)), rows.last_mut()) {
                        (Some(argument), Some(row)) => row.push(argument),
                        _ => failed = true,
                    }
                    continue;
                }
                _ => {}
            }
            match (self.argument(pair, d), rows.last_mut()) {
                (Some(argument), Some(row)) => row.push(argument),
                _ => failed = true,
            }
        }
        (!failed).then_some(rows)
    }
}

/// What a prefix of SPICE, or of units, means where it is no unit itself.
fn bare_prefix(text: &str) -> Option<&'static str> {
    Some(match text {
        "k" => "e3",
        "M" | "Meg" | "MEG" | "meg" => "e6",
        "G" => "e9",
        "u" | "µ" | "μ" => "e-6",
        "n" => "e-9",
        "p" => "e-12",
        "f" => "e-15",
        _ => return None,
    })
}

/// Reads a unit; an error names the nearest.
pub fn unit(text: &str, span: Span, d: &mut Vec<Diagnostic>) -> Option<Unit> {
    let part = |at: &std::ops::Range<usize>| Span {
        start: span.start + at.start as u32,
        end: span.start + at.end as u32,
        ..span
    };
    let error = match Unit::parse(text) {
        Ok(unit) => return Some(unit),
        Err(UnitError::Unknown { at, name, nearest }) => {
            let error = Diagnostic::error(
                "E0301",
                part(&at),
                format!("`{name}` is not a unit that I know"),
            );
            match nearest {
                Some(nearest) => {
                    let help =
                        error.says("unknown unit").help(format!("did you mean `{nearest}`?"));
                    let whole = format!("{}{nearest}{}", &text[..at.start], &text[at.end..]);
                    if Unit::parse(&whole).is_ok() && is_slip(&name, &nearest) {
                        help.fix(format!("write `{nearest}`"), vec![(part(&at), nearest)])
                    } else {
                        help
                    }
                }
                None => error
                    .says("a name right after a number is its unit")
                    .help("for a product write `*` between them"),
            }
        }
        Err(UnitError::Exponent { at }) => {
            Diagnostic::error("E0302", part(&at), "the unit's exponents are too large")
        }
        Err(UnitError::Syntax { at }) => {
            let at = if at.is_empty() { span } else { part(&at) };
            Diagnostic::error("E0302", at, format!("`{text}` is not a unit"))
                .says("products, quotients and powers of units are, without blanks")
                .help("as in `m^3/(s*Pa)`")
        }
    };
    d.push(error);
    None
}

impl Language for Reader<'_> {
    type Rule = Rule;
    type Leaf = Leaf;

    crate::expr::roles!(Rule);

    fn dialect(&self) -> Dialect {
        Dialect::Bond
    }

    fn span(&self, span: pest::Span<'_>) -> Span {
        let end = span.start() + span.as_str().trim_end_matches([' ', '\n']).len();
        Span::new(self.file, self.offset + span.start(), self.offset + end)
    }

    fn atom(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = self.place(&pair);
        match pair.as_rule() {
            Rule::number => self.number(&pair, d),
            Rule::reference => {
                let path = self.path(pair.into_inner().next()?, d)?;
                Some(Expr::new(Node::Leaf(Leaf::Name(path)), span))
            }
            _ => {
                let mut values = vec![];
                let mut variable = None;
                for part in pair.into_inner() {
                    match part.as_rule() {
                        Rule::name => variable = Some(self.name(&part)),
                        Rule::expression => values.push(self.expression(part, d)),
                        _ => {}
                    }
                }
                let values: Option<Vec<Expr>> = values.into_iter().collect();
                let mut values = values?.into_iter();
                let range = (values.next()?, values.next()?);
                let sum = Sum { variable: variable?, range, term: values.next()? };
                Some(Expr::new(Node::Leaf(Leaf::Sum(sum)), span))
            }
        }
    }

    fn call(&mut self, _: &str, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = self.place(&pair);
        let mut parts: Vec<_> = pair.into_inner().collect();
        let index = parts.pop_if(|last| last.as_rule() == Rule::after_call);
        let mut parts = parts.into_iter();
        let name = self.name(&parts.next()?);
        let rows = self.arguments(parts, d);
        let index = match index {
            Some(index) => Some(self.expression(index.into_inner().next()?, d)?),
            None => None,
        };
        let call = Call { name, rows: rows?, index };
        Some(Expr::new(Node::Leaf(Leaf::Call(call)), span))
    }
}

/// The argument that two ends and an arrow between them make.
fn bond(from: Argument, to: Argument, d: &mut Vec<Diagnostic>) -> Option<Argument> {
    let span = from.span.join(to.span);
    let mut end = |argument: Argument| {
        let place = argument.span;
        if let (None, Value::Expr(expr)) = (argument.label, argument.value)
            && let Node::Leaf(Leaf::Name(path)) = *expr.node
        {
            return Some(path);
        }
        d.push(
            Diagnostic::error("E0111", place, "a bond is read by the names of its ends")
                .says("not a name")
                .help("as in `f(armature -> L)`"),
        );
        None
    };
    let (from, to) = (end(from), end(to));
    Some(Argument { label: None, value: Value::Bond(from?, to?), span })
}

/// Whether a rule is an operand's, for messages.
pub(super) fn is_operand(rule: Rule) -> bool {
    matches!(
        rule,
        Rule::expression
            | Rule::prefix
            | Rule::op_not
            | Rule::key_if
            | Rule::conditional
            | Rule::special
            | Rule::key_sum
            | Rule::call
            | Rule::number
            | Rule::literal
            | Rule::reference
            | Rule::function_name
            | Rule::labelled
            | Rule::label
            | Rule::derivative
            | Rule::matrix
    )
}

/// Whether a rule is an operator's, for messages.
pub(super) fn is_operator(rule: Rule) -> bool {
    matches!(<Reader<'_> as Language>::role(rule), Role::Infix(_))
}

const _: () = assert!(UNIT_MARK as u32 == 1);
