//! What the command line says about a netlist: parameters, columns, times, in the netlist's own spelling.

use crate::analysis::sweep::measure::pieces;
use crate::bond::elaborate::Overrides;
use crate::circuit::{Analysis, Circuit};
use crate::diagnostic::{Diagnostic, Severity};
use crate::expr;
use crate::netlist::analysis::Print;
use crate::netlist::dialects::Dialect;
use crate::netlist::{Card, CardKind, Expr, Names, Netlist, read};
use crate::source::loader::edit_distance;
use crate::source::{SourceMap, Span};

/// Reads a few cards that stand on the command line; errors are told without a place.
fn cards(
    text: &str,
    flag: &str,
    dialect: &'static Dialect,
    d: &mut Vec<Diagnostic>,
) -> Option<Netlist> {
    let mut map = SourceMap::default();
    let file = map.add("<command line>", format!("command line\n{text}\n.end\n"));
    let mut found = vec![];
    let netlist = read::read(&mut map, file, &read::How::of(dialect), &mut found);
    let error = found.into_iter().find(|d| d.severity == Severity::Error);
    match error {
        None => Some(netlist),
        Some(mut error) => {
            error.labels.clear();
            error.fix = None;
            error.message = format!("{flag}: {}", error.message);
            d.push(error);
            None
        }
    }
}

/// An expression with the names of another netlist.
fn adopt(expr: &Expr, from: &Names, to: &mut Names) -> Expr {
    expr.map(&mut |leaf, _| expr::Expr::leaf(leaf.renamed(&mut |name| to.intern(from.text(name)))))
}

/// Gives top-level parameters other values.
pub fn set_parameters(netlist: &mut Netlist, set: &[(String, String)], d: &mut Vec<Diagnostic>) {
    for (name, value) in set {
        let value = value.replace(' ', "");
        let Some(read) = cards(&format!(".param {name}={value}"), "--set", netlist.dialect, d)
        else {
            continue;
        };
        let parameters = read.cards.iter().find_map(|card| match &card.kind {
            CardKind::Parameters(parameters) => parameters.first(),
            _ => None,
        });
        let Some((_, expr)) = parameters else { continue };
        let expr = adopt(expr, &read.names, &mut netlist.names);
        let wanted = netlist.names.find(name);
        let mut places = netlist.cards.iter_mut().flat_map(|card| match &mut card.kind {
            CardKind::Parameters(parameters) => parameters.as_mut_slice(),
            _ => &mut [],
        });
        // The last definition wins.
        let place = places.by_ref().filter(|(known, _)| Some(*known) == wanted).last();
        match place {
            Some((_, old)) => *old = expr,
            None => d.push(unknown(netlist, name)),
        }
    }
}

fn unknown(netlist: &Netlist, name: &str) -> Diagnostic {
    let known = netlist.cards.iter().flat_map(|card| match &card.kind {
        CardKind::Parameters(parameters) => parameters.as_slice(),
        _ => &[],
    });
    let known: Vec<&str> = known.map(|(name, _)| netlist.names.text(*name)).collect();
    let nearest = known.iter().min_by_key(|other| edit_distance(name, other));
    let message = format!("--set: the netlist has no parameter `{name}`");
    let diagnostic = Diagnostic::error("E0944", Span::NONE, message);
    match nearest {
        Some(nearest) => diagnostic.help(format!("did you mean `{nearest}`?")),
        None => diagnostic.because("it has no parameters at all"),
    }
}

/// Puts other columns in the place of those that the netlist names; `all` means every one.
pub fn observe(netlist: &mut Netlist, list: Option<&str>, d: &mut Vec<Diagnostic>) {
    let Some(list) = list else { return };
    let mut items = vec![];
    if list.trim() != "all" {
        for (text, name) in items_of(list) {
            let text = text.replace(' ', "");
            let Some(read) = cards(&format!(".print tran {text}"), "--observe", netlist.dialect, d)
            else {
                continue;
            };
            let saved = read.cards.iter().find_map(|card| match &card.kind {
                CardKind::Save { items, .. } => items.first(),
                _ => None,
            });
            let Some((spelled, expr)) = saved else { continue };
            let expr = adopt(expr, &read.names, &mut netlist.names);
            items.push((name.unwrap_or_else(|| spelled.clone()), expr));
        }
    }
    netlist.cards.retain(|card| !matches!(card.kind, CardKind::Save { .. }));
    netlist.header.retain(|(key, _)| key != "column");
    if !items.is_empty() {
        let kind = CardKind::Save { of: Print::Any, items };
        netlist.cards.push(Card { kind, span: Span::NONE, comment: None });
    }
}

/// The items of a list with the names after `as`.
fn items_of(list: &str) -> Vec<(String, Option<String>)> {
    let split = |item: String| match item.split_once(" as ") {
        Some((text, name)) => (text.trim().into(), Some(name.trim().trim_matches('"').into())),
        None => (item.trim().to_string(), None),
    };
    pieces(list).into_iter().filter(|item| !item.is_empty()).map(split).collect()
}

/// Sets the end of the run and the output interval.
pub fn set_times(circuit: &mut Circuit, overrides: &Overrides, d: &mut Vec<Diagnostic>) {
    let until = overrides.until.as_deref().and_then(|text| time(text, "--until", d));
    let step = overrides.step.as_deref().and_then(|text| time(text, "--step", d));
    if let Some(until) = until {
        let transient = circuit.analyses.iter_mut().rev().find_map(|analysis| match analysis {
            Analysis::Transient { stop, .. } => Some(stop),
            _ => None,
        });
        match transient {
            Some(stop) => *stop = until,
            None => circuit.analyses.push(Analysis::Transient {
                step: step.unwrap_or(until / 50.0),
                stop: until,
                start: 0.0,
                hmax: None,
                uic: false,
            }),
        }
    }
    if step.is_some() {
        circuit.grid = step;
    }
}

/// A number as a netlist writes it, `20ms` or `20 ms`.
pub fn number(text: &str, flag: &str, d: &mut Vec<Diagnostic>) -> Option<f64> {
    let packed = text.replace(' ', "");
    let read = cards(&format!(".param number_={packed}"), flag, Default::default(), d)?;
    read.cards.iter().find_map(|card| match &card.kind {
        CardKind::Parameters(parameters) => parameters.first()?.1.constant(),
        _ => None,
    })
}

/// A time.
fn time(text: &str, flag: &str, d: &mut Vec<Diagnostic>) -> Option<f64> {
    match number(text, flag, d).filter(|value| *value > 0.0 && value.is_finite()) {
        Some(value) => Some(value),
        None => {
            let message = format!("{flag} takes a time above 0, not `{text}`");
            d.push(Diagnostic::error("E0940", Span::NONE, message));
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_split_at_their_own_commas() {
        let item = |text: &str, name: Option<&str>| (text.to_string(), name.map(String::from));
        assert_eq!(
            items_of(r#"v(a,b), i(l1) as "x, y" ,time"#),
            [item("v(a,b)", None), item("i(l1)", Some("x, y")), item("time", None)]
        );
    }
}
