//! From statements' texts to statements.

use super::expected;
use super::expression::{BondParser, Reader, Rule, arrays};
use super::scan::{Piece, STATEMENT_WORDS, Scan};
use super::tree::*;
use crate::bond::graph::Stroke;
use crate::diagnostic::{Diagnostic, Severity};
use crate::expr::Node;
use crate::expr::parse;
use crate::quantity::Unit;
use crate::source::{FileId, SourceMap, Span};
use pest::Parser;
use pest::iterators::{Pair, Pairs};

/// Errors of syntax after which reading a file stops telling more: it is probably no bond graph at all.
const MOST_ERRORS: usize = 30;

/// Reads a file. Always gives one: what could not be read is reported, and stands in it as unreadable.
pub fn parse(map: &SourceMap, file: FileId, d: &mut Vec<Diagnostic>) -> File {
    let text = map.file(file).map_or("", |file| file.text.as_str());
    let scan = Scan::new(file, text);
    let mut statements = vec![];
    let before = errors(d);
    let mut at = 0;
    while let Some(piece) = scan.piece(at, d) {
        let known = d.len();
        let statement = if piece.bad { None } else { statement(&scan, text, &piece, d) };
        // A statement that the language will have is whole; one that cannot be read may hold the start of the next.
        let whole = statement.is_some() || d[known..].iter().any(|d| d.code == "E0201");
        at = if whole { piece.next } else { piece.restart };
        let kind = statement.unwrap_or(StatementKind::Unreadable);
        statements.push(Statement { kind, span: piece.span });
        if errors(d) - before >= MOST_ERRORS {
            d.push(
                Diagnostic::note("N0101", Span::NONE, "the rest of the file is not looked at")
                    .because(format!("{MOST_ERRORS} errors of syntax were enough")),
            );
            break;
        }
    }
    File { file, statements, trivia: scan.trivia() }
}

fn errors(d: &[Diagnostic]) -> usize {
    d.iter().filter(|d| d.severity == Severity::Error).count()
}

/// Reads a value that stands alone: `2mH`, `0.5*S`. A text of the command line is of no file, [`Span::NONE`]'s.
pub fn parse_value(text: &str, file: FileId, d: &mut Vec<Diagnostic>) -> Option<Expr> {
    alone(text, file, Rule::value_alone, d, |reader, mut pairs, d| {
        parse::expression(reader, pairs.next()?, d)
    })
}

/// Reads what an input gets: `x_ref = step(0.1 s, 0 mm, 20 mm)`.
pub fn parse_drive(text: &str, file: FileId, d: &mut Vec<Diagnostic>) -> Option<(Part, Expr)> {
    alone(text, file, Rule::drive_alone, d, |reader, mut pairs, d| {
        let name = reader.name(&pairs.next()?);
        let value = pairs.find(|pair| pair.as_rule() == Rule::expression)?;
        Some((Part::from(name), parse::expression(reader, value, d)?))
    })
}

/// Reads a list to observe: `x in mm, e(pump) in bar as "pressure"`.
pub fn parse_observe(
    text: &str,
    file: FileId,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<ObserveItem>> {
    alone(text, file, Rule::observe_alone, d, observed_items)
}

fn alone<T>(
    text: &str,
    file: FileId,
    rule: Rule,
    d: &mut Vec<Diagnostic>,
    read: impl FnOnce(&mut Reader<'_>, Pairs<'_, Rule>, &mut Vec<Diagnostic>) -> Option<T>,
) -> Option<T> {
    let scan = Scan::new(file, text);
    let Some(mut piece) = scan.piece(0, d) else {
        d.push(Diagnostic::error("E0108", Span::new(file, 0, 0), "nothing is written here"));
        return None;
    };
    if piece.bad {
        return None;
    }
    piece.span.end = text.len() as u32;
    pairs(&scan, text, &piece, rule, d).and_then(|(mut reader, masked)| {
        let pairs = masked.parse(rule)?;
        read(&mut reader, pairs, d)
    })
}

/// A statement's text as the grammar sees it.
struct Masked(String);

impl Masked {
    /// The pairs within the statement; its errors have been reported.
    fn parse(&self, rule: Rule) -> Option<Pairs<'_, Rule>> {
        let inner = BondParser::parse(rule, &self.0).ok()?.next()?.into_inner();
        Some(inner)
    }
}

/// The masked text, once it is known to be of the form of a rule; else the error is reported.
fn pairs<'a>(
    scan: &Scan<'_>,
    text: &'a str,
    piece: &Piece,
    rule: Rule,
    d: &mut Vec<Diagnostic>,
) -> Option<(Reader<'a>, Masked)> {
    let masked = scan.masked(piece);
    let offset = piece.span.start as usize;
    if let Some(at) = parse::nesting(&masked, None) {
        d.push(parse::too_deep(Span::new(piece.span.file, offset + at, offset + at + 1)));
        return None;
    }
    if let Err(error) = BondParser::parse(rule, &masked) {
        d.push(expected::report(piece, text, &masked, rule, &error));
        return None;
    }
    Some((Reader { file: piece.span.file, text, offset }, Masked(masked)))
}

/// Reads one statement.
fn statement(
    scan: &Scan<'_>,
    text: &str,
    piece: &Piece,
    d: &mut Vec<Diagnostic>,
) -> Option<StatementKind> {
    let masked = scan.masked(piece);
    let word = statement_word(&masked);
    let rule = match word {
        Some("param") => Rule::param_statement,
        Some("signal") => Rule::signal_statement,
        Some("input" | "output") => Rule::names_statement,
        Some("drive") => Rule::drive_statement,
        Some("simulate") => Rule::simulate_statement,
        Some("options") => Rule::options_statement,
        Some("observe") => Rule::observe_statement,
        Some(word) => {
            d.push(later(word, piece.span));
            return None;
        }
        None => Rule::chain_statement,
    };
    let (mut reader, masked) = pairs(scan, text, piece, rule, d)?;
    let pairs = masked.parse(rule)?;
    let reader = &mut reader;
    let mut names = vec![];
    let mut values = vec![];
    let mut description = None;
    match rule {
        Rule::chain_statement => return chain(reader, pairs, d).map(StatementKind::Chain),
        Rule::observe_statement => {
            return observed_items(reader, pairs, d).map(StatementKind::Observe);
        }
        Rule::options_statement => return options(reader, pairs, d).map(StatementKind::Options),
        Rule::simulate_statement => return simulate(reader, pairs, d),
        _ => {}
    }
    for pair in pairs {
        match pair.as_rule() {
            Rule::name => names.push(Part::from(reader.name(&pair))),
            Rule::expression => values.push(parse::expression(reader, pair, d)?),
            Rule::text => description = Some(reader.text(&pair)),
            _ => {}
        }
    }
    Some(match word {
        Some("input") => StatementKind::Input(names),
        Some("output") => StatementKind::Output(names),
        _ => {
            let (name, value) = (names.pop()?, values.pop()?);
            match word {
                Some("param") => StatementKind::Parameter { name, value, description },
                Some("signal") => StatementKind::Signal { name, value },
                _ => StatementKind::Drive { name, value },
            }
        }
    })
}

/// The statement word that a statement begins with, unless it is the name of an element there: before an arrow, a
/// dot, a comma, a bracket or a colon, or alone.
fn statement_word(masked: &str) -> Option<&'static str> {
    let end = masked.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(masked.len());
    let word = STATEMENT_WORDS.iter().find(|word| **word == &masked[..end])?;
    let after = masked[end..].trim_start_matches([' ', '\n']);
    let name = after.is_empty()
        || ["->", "|->", ".", ","].iter().any(|sign| after.starts_with(sign))
        || (after.starts_with([':', '(']) && !matches!(*word, "observe" | "if"));
    (!name).then_some(word)
}

/// The error for statements that the language will have.
fn later(word: &str, span: Span) -> Diagnostic {
    let (what, instead) = match word {
        "model" | "port" => ("models", "write the elements of the model where it is used"),
        "import" => ("imports", "copy what you need into this file"),
        "for" => ("loops over elements", "write each element out"),
        "if" => ("conditional elements", "write a file for each case"),
        _ => ("named regulator loops", "leave the statement out: it changes no simulation"),
    };
    let start = Span { end: span.start + word.len() as u32, ..span };
    Diagnostic::error("E0201", start, format!("{what} are not part of the language yet"))
        .says("this statement cannot be used yet")
        .help(instead)
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
            Rule::path => path = Some(reader.path(&part)),
            Rule::index => {
                d.push(arrays(reader.place(&part)));
                return None;
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
            if let Node::Leaf(Leaf::Quantity(value, Unit { .. })) = &*number.node {
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
        let value = pair.into_inner().find(|part| part.as_rule() == Rule::expression)?;
        let value = parse::expression(reader, value, d)?;
        if slot.replace(value).is_some() {
            d.push(Diagnostic::error("E0115", place, "this was said before in the statement"));
            return None;
        }
    }
    Some(StatementKind::Simulate { until, step })
}
