//! From the text of one statement, or of a block's head, to what it says.

use super::expected;
use super::expression::{BondParser, Reader, Rule};
use super::scan::{BLOCK_WORDS, Piece, STATEMENT_WORDS, Scan};
use super::tree::*;
use crate::bond::graph::Stroke;
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::expr::parse;
use crate::source::Span;
use pest::Parser;
use pest::iterators::{Pair, Pairs};

/// What a piece says.
pub(super) enum Said {
    /// A whole statement.
    Statement(StatementKind),
    /// What stands before a block.
    Head(Head),
}

/// What stands before a block.
pub(super) enum Head {
    Model { name: Name, parameters: Vec<HeaderParameter> },
    For { variable: Name, range: (Expr, Expr) },
    If { condition: Expr },
}

/// The rule of each statement word.
const STATEMENTS: &[(&str, Rule)] = &[
    ("param", Rule::param_statement),
    ("signal", Rule::signal_statement),
    ("input", Rule::names_statement),
    ("output", Rule::names_statement),
    ("port", Rule::port_statement),
    ("model", Rule::model_head),
    ("import", Rule::import_statement),
    ("for", Rule::for_head),
    ("drive", Rule::drive_statement),
    ("simulate", Rule::simulate_statement),
    ("options", Rule::options_statement),
    ("observe", Rule::observe_statement),
    ("loop", Rule::loop_statement),
    ("if", Rule::if_head),
];

/// Reads a piece. `None` when it cannot be read: the errors have been reported.
pub(super) fn read(scan: &Scan<'_>, piece: &Piece, d: &mut Vec<Diagnostic>) -> Option<Said> {
    if piece.bad || piece.opens.is_some_and(|brace| brace.start == piece.span.start) {
        return None;
    }
    let word = statement_word(scan.masked(piece.span));
    let rule = rule(scan.masked(piece.span));
    let (mut reader, pairs) = pairs(scan, piece, rule, d)?;
    let reader = &mut reader;
    Some(match rule {
        Rule::chain_statement => Said::Statement(StatementKind::Chain(chain(reader, pairs, d)?)),
        Rule::observe_statement => {
            Said::Statement(StatementKind::Observe(observed_items(reader, pairs, d)?))
        }
        Rule::options_statement => {
            Said::Statement(StatementKind::Options(options(reader, pairs, d)?))
        }
        Rule::simulate_statement => Said::Statement(simulate(reader, pairs, d)?),
        Rule::loop_statement => Said::Statement(regulator(reader, pairs, d)?),
        Rule::model_head => Said::Head(model(reader, pairs, d)?),
        _ => plain(word.unwrap_or(""), reader, pairs, d)?,
    })
}

/// The rule of a statement, by its first word.
pub(super) fn rule(masked: &str) -> Rule {
    let word = statement_word(masked);
    let row = STATEMENTS.iter().find(|(name, _)| Some(*name) == word);
    row.map_or(Rule::chain_statement, |(_, rule)| *rule)
}

/// Whether a piece begins as a block's head does.
pub(super) fn is_head(masked: &str) -> bool {
    statement_word(masked).is_some_and(|word| BLOCK_WORDS.contains(&word))
}

/// The word that a text begins with.
pub(super) fn first_word(masked: &str) -> &str {
    let end = masked.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(masked.len());
    &masked[..end]
}

/// The statement word that a statement begins with, unless it is the name of an element there: before an arrow, a
/// dot, a comma, a bracket or a colon, or alone.
pub(super) fn statement_word(masked: &str) -> Option<&'static str> {
    let first = first_word(masked);
    let word = STATEMENT_WORDS.iter().find(|word| **word == first)?;
    let rest = &masked[first.len()..];
    let after = rest.trim_start_matches([' ', '\n']);
    let name = after.is_empty()
        || rest.starts_with('.')
        || ["->", "|->", ",", "["].iter().any(|sign| after.starts_with(sign))
        || (after.starts_with([':', '(']) && !matches!(*word, "observe" | "if"));
    (!name).then_some(word)
}

/// What the grammar makes of a piece; its errors are reported.
fn pairs<'s>(
    scan: &'s Scan<'_>,
    piece: &Piece,
    rule: Rule,
    d: &mut Vec<Diagnostic>,
) -> Option<(Reader<'s>, Pairs<'s, Rule>)> {
    let masked = scan.masked(piece.span);
    let offset = piece.span.start as usize;
    if let Some(at) = parse::nesting(masked, None) {
        d.push(parse::too_deep(Span::new(piece.span.file, offset + at, offset + at + 1)));
        return None;
    }
    match BondParser::parse(rule, masked) {
        Ok(mut pairs) => {
            let reader = Reader { file: piece.span.file, text: scan.text(), offset };
            Some((reader, pairs.next()?.into_inner()))
        }
        Err(error) => {
            d.push(expected::report(piece, scan.text(), masked, rule, &error));
            None
        }
    }
}

/// Statements of names and values in an order that says which is which.
fn plain(
    word: &str,
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Said> {
    let mut parts = vec![];
    let mut names = vec![];
    let mut values = vec![];
    let mut texts = vec![];
    let mut into = false;
    for pair in pairs {
        match pair.as_rule() {
            Rule::part => parts.push(reader.part(pair, d)?),
            Rule::name | Rule::domain => names.push(reader.name(&pair)),
            Rule::expression => values.push(parse::expression(reader, pair, d)?),
            Rule::text => texts.push(reader.text(&pair)),
            Rule::direction => into = pair.as_str() == "in",
            _ => {}
        }
    }
    let mut values = values.into_iter();
    Some(Said::Statement(match word {
        "input" => StatementKind::Input(parts),
        "output" => StatementKind::Output(parts),
        "import" => StatementKind::Import(texts.pop()?),
        "port" => StatementKind::Port(Port { into, name: parts.pop()?, domain: names.pop() }),
        "for" => {
            let range = (values.next()?, values.next()?);
            return Some(Said::Head(Head::For { variable: names.pop()?, range }));
        }
        "if" => return Some(Said::Head(Head::If { condition: values.next()? })),
        _ => {
            let (name, value) = (parts.pop()?, values.next()?);
            match word {
                "param" => StatementKind::Parameter { name, value, description: texts.pop() },
                "signal" => StatementKind::Signal { name, value },
                _ => StatementKind::Drive { name, value },
            }
        }
    }))
}

fn model(
    reader: &mut Reader<'_>,
    mut pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Head> {
    let name = pairs.find(|pair| pair.as_rule() == Rule::name)?;
    let name = reader.name(&name);
    let mut parameters = vec![];
    for pair in pairs.filter(|pair| pair.as_rule() == Rule::header_parameter) {
        let mut parts = pair.into_inner();
        let name = reader.name(&parts.next()?);
        let (mut default, mut description) = (None, None);
        for part in parts {
            match part.as_rule() {
                Rule::expression => default = Some(parse::expression(reader, part, d)?),
                Rule::text => description = Some(reader.text(&part)),
                _ => {}
            }
        }
        parameters.push(HeaderParameter { name, default, description });
    }
    Some(Head::Model { name, parameters })
}

fn regulator(
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<StatementKind> {
    let mut signal = None;
    let mut values = vec![];
    let (mut bandwidth, mut margin) = (None, None);
    for pair in pairs {
        let place = reader.place(&pair);
        let slot = match pair.as_rule() {
            Rule::path => {
                signal = Some(reader.path(pair, d)?);
                continue;
            }
            Rule::expression => {
                values.push(parse::expression(reader, pair, d)?);
                continue;
            }
            Rule::bandwidth => &mut bandwidth,
            Rule::margin => &mut margin,
            _ => continue,
        };
        once(slot, place, pair, reader, d)?;
    }
    let mut values = values.into_iter();
    let (controlled, reference) = (values.next()?, values.next()?);
    let signal = signal?;
    Some(StatementKind::Loop(Regulator { signal, controlled, reference, bandwidth, margin }))
}

fn chain(
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Chain> {
    let mut lists: Vec<Vec<ChainEnd>> = vec![];
    let mut arrows = vec![];
    let mut failed = false;
    for pair in pairs {
        match pair.as_rule() {
            Rule::ends => {
                let mut ends = vec![];
                for pair in pair.into_inner().filter(|pair| pair.as_rule() == Rule::end) {
                    match chain_end(reader, pair, d) {
                        Some(end) => ends.push(end),
                        None => failed = true,
                    }
                }
                lists.push(ends);
            }
            Rule::arrow => {
                let stroke = match pair.as_str() {
                    "->|" => Some(Stroke::AtTo),
                    "|->" => Some(Stroke::AtFrom),
                    _ => None,
                };
                arrows.push(Arrow { stroke, span: reader.place(&pair) });
            }
            _ => {}
        }
    }
    let last = lists.len().checked_sub(1)?;
    for (k, list) in lists.iter().enumerate() {
        if let ([_, second, ..], true) = (list.as_slice(), k < last) {
            d.push(
                Diagnostic::error(
                    "E0109",
                    second.span,
                    "a list of ends stands only at the end of a chain",
                )
                .says("an arrow follows this list")
                .help("begin a statement of its own for each of them"),
            );
            failed = true;
        }
    }
    if failed {
        return None;
    }
    let mut lists = lists.into_iter();
    Some(Chain { first: lists.next()?, links: arrows.into_iter().zip(lists).collect() })
}

fn chain_end(
    reader: &mut Reader<'_>,
    pair: Pair<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<ChainEnd> {
    let span = reader.place(&pair);
    let (mut kind, mut path, mut arguments) = (None, None, None);
    for part in pair.into_inner() {
        match part.as_rule() {
            Rule::kind => kind = Some(reader.name(&part)),
            Rule::path => {
                if let Some(before) = path.replace(reader.path(part, d)?) {
                    kind = Some(kind_of(before, d)?);
                }
            }
            Rule::element_arguments => {
                let place = reader.place(&part);
                let mut rows = reader.arguments(part.into_inner(), d)?;
                if rows.len() > 1 {
                    d.push(
                        Diagnostic::error(
                            "E0114",
                            place,
                            "the arguments of an element are separated by commas",
                        )
                        .says("`;` separates points of `pwl` and rows of matrices"),
                    );
                    return None;
                }
                arguments = rows.pop();
            }
            _ => {}
        }
    }
    Some(ChainEnd { kind, path: path?, arguments, span })
}

/// What stands before a colon.
fn kind_of(path: Path, d: &mut Vec<Diagnostic>) -> Option<Name> {
    if path.members.is_empty() && path.name.indices.is_empty() {
        return Some(Name { text: path.name.text, span: path.span });
    }
    d.push(
        Diagnostic::error("E0101", path.span, "a kind is one word")
            .says("expected an arrow or the end of the statement after this")
            .help("write the kind before the colon and the name after it, as in `R:load[2]`"),
    );
    None
}

fn observed_items(
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<ObserveItem>> {
    let mut items = vec![];
    for pair in pairs.filter(|pair| pair.as_rule() == Rule::observed) {
        let span = reader.place(&pair);
        let (mut expr, mut unit, mut name) = (None, None, None);
        for part in pair.into_inner() {
            match part.as_rule() {
                Rule::expression => expr = Some(parse::expression(reader, part, d)?),
                Rule::unit_text => {
                    let place = reader.place(&part);
                    unit = Some((reader.unit(place, d)?, place));
                }
                Rule::text => name = Some(reader.text(&part)),
                _ => {}
            }
        }
        items.push(ObserveItem { expr: expr?, unit, name, span });
    }
    Some(items)
}

fn options(
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<(Name, Name)>> {
    let mut options = vec![];
    for pair in pairs.filter(|pair| pair.as_rule() == Rule::option) {
        let mut parts = pair.into_inner().filter(|part| part.as_rule() != Rule::equals);
        let key = reader.name(&parts.next()?);
        let value = parts.next()?;
        let mut text = reader.name(&value);
        if value.as_rule() == Rule::number {
            // With a unit the text of its value in SI, else as written.
            let number = reader.number(&value, d)?;
            if let Node::Leaf(Leaf::Quantity(value, _)) = &*number.node {
                text.text = value.to_string();
            }
        }
        options.push((key, text));
    }
    Some(options)
}

fn simulate(
    reader: &mut Reader<'_>,
    pairs: Pairs<'_, Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<StatementKind> {
    let (mut until, mut step) = (None, None);
    for pair in pairs {
        let place = reader.place(&pair);
        let slot = match pair.as_rule() {
            Rule::until => &mut until,
            Rule::step => &mut step,
            _ => continue,
        };
        once(slot, place, pair, reader, d)?;
    }
    Some(StatementKind::Simulate { until, step })
}

/// Takes the value of a part of a statement that is said once.
fn once(
    slot: &mut Option<Expr>,
    place: Span,
    pair: Pair<'_, Rule>,
    reader: &mut Reader<'_>,
    d: &mut Vec<Diagnostic>,
) -> Option<()> {
    let value = pair.into_inner().find(|part| part.as_rule() == Rule::expression)?;
    let value = parse::expression(reader, value, d)?;
    if slot.replace(value).is_some() {
        d.push(Diagnostic::error("E0115", place, "this was said before in the statement"));
        return None;
    }
    Some(())
}

/// A value that is all of a text.
pub(super) fn value_alone(scan: &Scan<'_>, piece: &Piece, d: &mut Vec<Diagnostic>) -> Option<Expr> {
    let (mut reader, mut pairs) = pairs(scan, piece, Rule::value_alone, d)?;
    parse::expression(&mut reader, pairs.next()?, d)
}

/// `name = value` that is all of a text.
pub(super) fn drive_alone(
    scan: &Scan<'_>,
    piece: &Piece,
    d: &mut Vec<Diagnostic>,
) -> Option<(Part, Expr)> {
    let (mut reader, mut pairs) = pairs(scan, piece, Rule::drive_alone, d)?;
    let name = reader.part(pairs.next()?, d)?;
    let value = pairs.find(|pair| pair.as_rule() == Rule::expression)?;
    Some((name, parse::expression(&mut reader, value, d)?))
}

/// A list to observe that is all of a text.
pub(super) fn observe_alone(
    scan: &Scan<'_>,
    piece: &Piece,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<ObserveItem>> {
    let (mut reader, pairs) = pairs(scan, piece, Rule::observe_alone, d)?;
    observed_items(&mut reader, pairs, d)
}
