//! What is to be computed: analyses, options, outputs, initial values, usual magnitudes.

use super::expand::Flat;
use super::kinds;
use super::scope::{self, TOP};
use super::values::Lookup;
use crate::circuit::{self, Analysis, Circuit, NodeId, Output};
use crate::diagnostic::{Diagnostic, Severity, has_errors};
use crate::netlist::analysis::{Analysis as WantedAnalysis, Print};
use crate::netlist::dialects::NGSPICE;
use crate::netlist::header::Header;
use crate::netlist::read::expression::expression;
use crate::netlist::read::number;
use crate::netlist::{CardKind, Expr, Leaf, Name};
use crate::source::{FileId, Span};
use std::collections::{HashMap, HashSet};

/// The tolerance where it is elsewhere a part of each present value, rather than of the largest so far.
const PRESENT: &str = "1e-4";

/// Analyses, and options: those of the netlist, of its header, and `own`, the last of which count.
pub fn settings(
    flat: &Flat,
    header: &Header,
    own: &[(String, String)],
    d: &mut Vec<Diagnostic>,
) -> (Vec<Analysis>, Vec<(String, String)>) {
    let mut analyses = vec![];
    let mut options = vec![];
    // A deck is answered as its simulator answers; a text of ours, whatever its dialect, as its bond graph.
    if flat.netlist.dialect.reading().arrives && *header == Header::default() {
        options.push(("jumps".to_string(), "before".to_string()));
        options.push(("reltol".to_string(), PRESENT.to_string()));
    }
    let is_sensitivity =
        |wanted: &WantedAnalysis| matches!(wanted, WantedAnalysis::Sensitivity { .. });
    for card in &flat.live {
        match &card.kind {
            CardKind::Options(given) => options.extend(given.iter().cloned()),
            CardKind::OperatingPoint => analyses.push(Analysis::OperatingPoint),
            CardKind::Transient { step, stop, start, hmax, uic } => {
                let mut number =
                    |expr: &Expr| scope::number(&flat.scopes, TOP, expr, &flat.netlist.names, d);
                let (step, stop) = (number(step), number(stop));
                let start = start.as_ref().map_or(Some(0.0), &mut number);
                let hmax = hmax.as_ref().map_or(Some(None), |hmax| number(hmax).map(Some));
                if let (Some(step), Some(stop), Some(start), Some(hmax)) = (step, stop, start, hmax)
                {
                    let hmax = hmax.filter(|limit| *limit > 0.0 && !header.hmax_auto);
                    // Only ngspice needs a step; to the others 0 says that any will do.
                    let open = step == 0.0 && flat.netlist.dialect.name != NGSPICE.name;
                    let step = if open { stop / 1000.0 } else { step };
                    let sound =
                        step > 0.0 && stop > start && start >= 0.0 && (step + stop).is_finite();
                    if !sound {
                        let error = Diagnostic::error("E0745", card.span, "these times make no sense")
                            .help(".tran step stop [start [hmax]] [uic], with step > 0 and 0 <= start < stop");
                        d.push(error);
                    }
                    analyses.push(Analysis::Transient { step, stop, start, hmax, uic: *uic });
                }
            }
            CardKind::Analysis(wanted) if !is_sensitivity(wanted) => {
                analyses.extend(super::analyses::analysis(flat, wanted, card.span, d));
            }
            _ => {}
        }
    }
    // Sensitivities are those of the other analyses.
    let ways = super::sensitivity::ways(&mut options);
    for card in &flat.live {
        if let CardKind::Analysis(wanted) = &card.kind
            && is_sensitivity(wanted)
        {
            let made = super::sensitivity::analysis(flat, wanted, &analyses, ways, card.span, d);
            analyses.extend(made);
        }
    }
    if header.hmax_auto {
        options.push(("hmax".into(), "auto".into()));
    }
    options.extend(header.options.iter().cloned());
    options.extend(own.iter().cloned());
    (analyses, options)
}

/// The temperatures that options state, in °C; the last of several wins.
pub fn temperatures(flat: &mut Flat, options: &[(String, String)], d: &mut Vec<Diagnostic>) {
    for (key, text) in options {
        let place = match key.as_str() {
            "temp" => &mut flat.temperature,
            "tnom" => &mut flat.nominal_temperature,
            _ => continue,
        };
        let read = number::number(text, flat.netlist.dialect.reading().numbers)
            .filter(|read| read.end == text.len());
        match read.map(|read| read.value).filter(|value| *value > -273.15) {
            Some(value) => *place = value,
            None => {
                let message = format!("`{key}={text}` is no temperature in °C");
                d.push(Diagnostic::error("E0766", Span::NONE, message));
            }
        }
    }
}

/// The time constant in s that options let the laws of voltage sources be followed with; the last of several wins.
pub fn smoothing(options: &[(String, String)], d: &mut Vec<Diagnostic>) -> Option<f64> {
    let last = |name: &str| options.iter().rev().find(|(key, _)| key == name).map(|(_, text)| text);
    if last("smoothbsrc").is_none_or(|text| text == "0") {
        return None;
    }
    let Some(text) = last("rcconst") else { return Some(FOLLOWING) };
    let constant = text.parse().ok().filter(|constant| *constant > 0.0);
    if constant.is_none() {
        let message = format!("`rcconst={text}` is no time in seconds");
        d.push(Diagnostic::error("E0766", Span::NONE, message));
    }
    constant
}

/// Xyce's default of `rcconst`, s.
const FOLLOWING: f64 = 1e-9;

/// Output columns (those of the header, else those of `.save` and `.print`), and `.ic` values.
pub fn readings(
    flat: &Flat,
    header: &Header,
    last: Option<&Analysis>,
    d: &mut Vec<Diagnostic>,
) -> (Vec<Output>, Vec<(NodeId, f64)>) {
    let lookup = Lookup::new(flat, &flat.netlist.names);
    let initial = voltages(&lookup, &flat.initial, d);
    let mut outputs = vec![];
    if !header.columns.is_empty() {
        columns(flat, header, &mut outputs, d);
        return (outputs, initial);
    }
    let prints = || {
        flat.live.iter().filter_map(|card| match &card.kind {
            CardKind::Save { of, .. } => Some(*of),
            _ => None,
        })
    };
    // The items of the analysis that is run; where none are, those of any other.
    let own = last.map(print_of);
    let said = prints().any(|of| of == Print::Any || Some(of) == own);
    let wanted = |of: Print| !said || own.is_none() || of == Print::Any || Some(of) == own;
    let mut seen = HashSet::new();
    for card in &flat.live {
        let CardKind::Save { of, items } = &card.kind else { continue };
        if !wanted(*of) {
            continue;
        }
        if items.is_empty() {
            // `.save all`
            return (vec![], initial);
        }
        for (text, expr) in items {
            if let Some(output) = item(&lookup, text, expr, d)
                && seen.insert(output.name.to_lowercase())
            {
                outputs.push(output);
            }
        }
    }
    (outputs, initial)
}

/// Where to look for an operating point: `.nodeset`. Nodes that are not there are passed over, with a warning.
pub fn guesses(flat: &Flat, d: &mut Vec<Diagnostic>) -> Vec<(NodeId, f64)> {
    let lookup = Lookup::new(flat, &flat.netlist.names);
    let mut found = vec![];
    let guesses = voltages(&lookup, &flat.guesses, &mut found);
    d.extend(found.into_iter().map(|error| match error.code {
        "E0740" => Diagnostic { code: "W0705", severity: Severity::Warning, ..error },
        _ => error,
    }));
    guesses
}

fn voltages(
    lookup: &Lookup,
    given: &[(scope::ScopeId, Name, &Expr, Span)],
    d: &mut Vec<Diagnostic>,
) -> Vec<(NodeId, f64)> {
    let mut found = vec![];
    for (id, name, expr, span) in given {
        let (node, value) = (lookup.node(*id, *name, *span, d), lookup.number(*id, expr, d));
        found.extend(node.zip(value));
    }
    found
}

/// An item of `.print` and its like. A bare word is a node, or else a parameter or the value of a device.
pub fn item(lookup: &Lookup, text: &str, expr: &Expr, d: &mut Vec<Diagnostic>) -> Option<Output> {
    if let crate::expr::Node::Leaf(Leaf::Parameter(name)) = &*expr.node {
        let parameter = || lookup.flat.scopes.value(TOP, *name, lookup.names).is_some();
        let value = || text.contains(':') || parameter() || lookup.has_device(TOP, *name);
        if lookup.has_node(TOP, *name) || !value() {
            let node = lookup.node(TOP, *name, expr.span, d)?;
            let expr = circuit::Expr::leaf(circuit::Leaf::Voltage(node, NodeId(0)));
            return Some(Output { name: format!("v({text})"), expr });
        }
    }
    Some(Output { name: text.to_string(), expr: lookup.law(TOP, expr, d)? })
}

/// The `.print` that belongs to an analysis.
fn print_of(analysis: &Analysis) -> Print {
    match analysis {
        Analysis::OperatingPoint => Print::OperatingPoint,
        Analysis::Transient { .. } => Print::Transient,
        Analysis::Dc { .. } => Print::Dc,
        Analysis::Ac { .. } => Print::Ac,
        Analysis::Transfer { .. } => Print::Transfer,
        Analysis::PoleZero { .. } => Print::PoleZero,
        Analysis::Sensitivity(_) => Print::Sensitivity,
    }
}

/// The columns of the header. Their expressions stand in no text that a message could point at; what they lack follows
/// from what is wrong elsewhere, where anything is.
fn columns(flat: &Flat, header: &Header, outputs: &mut Vec<Output>, d: &mut Vec<Diagnostic>) {
    if has_errors(d) {
        return;
    }
    let mut names = flat.netlist.names.clone();
    let mut read = vec![];
    for column in &header.columns {
        let mut found = vec![];
        let expr = expression(&column.expr, &mut names, &NGSPICE, FileId(u32::MAX), 0, &mut found);
        let expr = expr.map(|expr| expr.map(&mut |leaf, _| Expr::leaf(leaf.clone())));
        complain(&column.name, found, d);
        read.push((column, expr));
    }
    let lookup = Lookup::new(flat, &names);
    for (column, expr) in read {
        let mut found = vec![];
        if let Some(expr) = expr.and_then(|expr| lookup.law(TOP, &expr, &mut found)) {
            outputs.push(Output { name: column.name.clone(), expr });
        }
        complain(&column.name, found, d);
    }
}

fn complain(column: &str, found: Vec<Diagnostic>, d: &mut Vec<Diagnostic>) {
    for error in found {
        let message = format!("in the column `{column}` of the header: {}", error.message);
        d.push(Diagnostic { message, labels: vec![], ..error });
    }
}

/// Gives nodes and devices the usual magnitudes of their domains; checks that there is a ground.
pub fn scales(circuit: &mut Circuit, header: &Header, d: &mut Vec<Diagnostic>) {
    if !circuit.devices.is_empty() && !kinds::is_grounded(&circuit.devices) {
        d.push(
            Diagnostic::error(
                "E0746",
                circuit.devices.first().map_or(Span::NONE, |device| device.span),
                "no node is the ground",
            )
            .says("the first of the devices, none of which stands at node 0")
            .help("call the reference node `0` or `gnd`"),
        );
    }
    if header.domains.is_empty() {
        return;
    }
    let (mut efforts, mut flows) = (HashMap::new(), HashMap::new());
    for domain in &header.domains {
        efforts.extend(domain.nodes.iter().map(|node| (node.to_lowercase(), domain.effort)));
        flows.extend(domain.devices.iter().map(|device| (device.to_lowercase(), domain.flow)));
    }
    for node in &mut circuit.nodes {
        node.nominal = efforts.get(&node.name.to_lowercase()).copied();
    }
    for device in &mut circuit.devices {
        device.nominal = flows.get(&device.name.to_lowercase()).copied();
    }
}
