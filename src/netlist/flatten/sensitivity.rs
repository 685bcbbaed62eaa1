//! `.sens` as indices: its outputs, and what its parameters are.

use super::expand::Flat;
use super::experiment::item;
use super::scope::TOP;
use super::values::Lookup;
use super::vary;
use crate::circuit::{Analysis, Gradients, Sensitivity};
use crate::diagnostic::Diagnostic;
use crate::netlist::analysis::{Analysis as Wanted, Over};
use crate::netlist::{Element, Expr, Leaf, Name};
use crate::quantity::nearest;
use crate::source::Span;

/// More parameters than this are not for one run.
const MOST: usize = 2000;

/// What `.options sensitivity` says of `direct` and of `adjoint`.
pub type Ways = [Option<bool>; 2];

/// Takes `direct` and `adjoint` of `.options sensitivity` out of the options.
pub fn ways(options: &mut Vec<(String, String)>) -> Ways {
    let mut ways = [None; 2];
    options.retain(|(key, value)| {
        let on = Some(!matches!(value.as_str(), "0" | "0.0" | "false"));
        match key.as_str() {
            "sensitivity_direct" => ways[0] = on,
            "sensitivity_adjoint" => ways[1] = on,
            _ => return true,
        }
        false
    });
    ways
}

/// The ways that are gone: both where nothing is said, but over time, where an adjoint goes back from each row.
fn gradients([direct, adjoint]: Ways, of: &Analysis) -> Gradients {
    let adjoint =
        adjoint.unwrap_or(!matches!(of, Analysis::Transient { .. }) || direct == Some(false));
    match (direct.unwrap_or(true), adjoint) {
        (true, true) => Gradients::Both,
        (false, true) => Gradients::Adjoint,
        (_, false) => Gradients::Direct,
    }
}

/// The analysis of a card; `None` when it makes no sense, which has been said.
pub fn analysis(
    flat: &Flat,
    wanted: &Wanted,
    others: &[Analysis],
    ways: Ways,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Analysis> {
    let Wanted::Sensitivity { outputs, parameters, over } = wanted else { return None };
    let lookup = Lookup::new(flat, &flat.netlist.names);
    let before = d.len();
    let read = outputs.iter().filter_map(|(text, expr)| item(&lookup, text, expr, d));
    let outputs: Vec<_> = read.collect();
    let of = match over {
        Over::Rest => Analysis::OperatingPoint,
        Over::Frequencies(points) => {
            Analysis::Ac { frequencies: super::analyses::frequencies(flat, points, span, d)? }
        }
        Over::Other => {
            let along = |other: &&Analysis| {
                matches!(
                    other,
                    Analysis::Dc { .. } | Analysis::Ac { .. } | Analysis::Transient { .. }
                )
            };
            others.iter().rev().find(along).cloned().unwrap_or(Analysis::OperatingPoint)
        }
    };
    let parameters = match parameters {
        Some(named) => {
            let value = |(name, span): &(Name, Span)| {
                Some((flat.netlist.names.text(*name).to_string(), value(&lookup, *name, *span, d)?))
            };
            named.iter().filter_map(value).collect::<Vec<_>>()
        }
        None => every(&lookup, matches!(of, Analysis::Ac { .. })),
    };
    if d.len() > before {
        return None;
    }
    if parameters.is_empty() || parameters.len() > MOST {
        let message = format!("slopes by {} values are asked for", parameters.len());
        let help =
            format!("name them, at least one and {MOST} at most: `.sens v(out) param=r1,c1:c`");
        d.push(Diagnostic::error("E0788", span, message).help(help));
        return None;
    }
    let gradients = match over {
        Over::Other => gradients(ways, &of),
        _ => Gradients::Plain,
    };
    Some(Analysis::Sensitivity(Sensitivity { outputs, parameters, of: Box::new(of), gradients }))
}

/// What a parameter, a value of a device or of a model is.
fn value(lookup: &Lookup, name: Name, span: Span, d: &mut Vec<Diagnostic>) -> Option<f64> {
    let netlist = lookup.flat.netlist;
    let text = netlist.names.text(name);
    let mut said = vec![];
    let expr = match vary::model_value(netlist, text) {
        Some(expr) if !lookup.has_device(TOP, name) => expr.clone(),
        _ => Expr::new(crate::expr::Node::Leaf(Leaf::Parameter(name)), span),
    };
    let found = lookup.law(TOP, &expr, &mut said).and_then(|law| law.constant());
    if found.is_none() {
        let message = format!("`{text}` is no number that a slope could be taken by");
        let error = Diagnostic::error("E0788", span, message);
        let devices = lookup.flat.devices.iter().take(super::values::NEAR);
        let known: Vec<String> = devices.map(|pending| lookup.flat.device_name(pending)).collect();
        d.push(match nearest(text, known.iter().map(String::as_str)) {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error.help(
                "a parameter, a device (`r1`, `r1:r`), a value of a model (`model:key`) or `temp`",
            ),
        });
    }
    found
}

/// The first value of every device that has one; capacitances and inductances only where something moves.
fn every(lookup: &Lookup, moving: bool) -> Vec<(String, f64)> {
    let value = |pending: &super::expand::Pending| {
        let element = &pending.device.element;
        let stores = match element {
            Element::Capacitor { .. } | Element::Inductor { .. } | Element::Mutual { .. } => true,
            Element::Passive(_) => {
                let name = lookup.names.text(pending.device.name);
                !name.starts_with(['r', 'R'])
            }
            _ => false,
        };
        if stores && !moving {
            return None;
        }
        let expr = vary::value_in(element, None)?;
        let number = lookup.law(pending.scope, &expr, &mut vec![])?.constant()?;
        Some((lookup.flat.device_name(pending).to_lowercase(), number))
    };
    lookup.flat.devices.iter().filter_map(value).collect()
}
