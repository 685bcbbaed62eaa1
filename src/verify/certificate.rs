//! The parts of the certificate that look at a text: exact, laws, values.

use super::exact::text::Text;
use super::report::{Exact, Laws, Mismatch, Values};
use super::{exact, values};
use crate::bond::graph::{BondGraph, Power};
use crate::bond::initial::InitialState;
use crate::diagnostic::Diagnostic;
use crate::netlist::{Card, CardKind, Netlist, write};
use crate::quantity::Domain;
use crate::source::Span;
use crate::translate::Translation;
use std::collections::HashMap;

/// Where random numbers come from when nobody says otherwise.
pub const SEED: u64 = 0x626f_6e64;

/// What was found in a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// The exact part.
    pub exact: Exact,
    /// Laws and signals.
    pub laws: Laws,
    /// Values.
    pub values: Values,
    /// The scaled bond graph against the unscaled one, where it is scaled.
    pub scaling: Option<Values>,
}

impl Certificate {
    /// Whether nothing differs.
    pub fn holds(&self) -> bool {
        self.exact.mismatches.is_empty()
            && self.laws.mismatches.is_empty()
            && self.values.mismatches.is_empty()
            && self.scaling.as_ref().is_none_or(|scaling| scaling.mismatches.is_empty())
    }

    /// The first difference.
    pub fn first(&self) -> Option<&Mismatch> {
        let laws = self.laws.mismatches.iter().chain(&self.exact.mismatches);
        let scaling = self.scaling.iter().flat_map(|scaling| &scaling.mismatches);
        laws.chain(&self.values.mismatches).chain(scaling).next()
    }
}

/// Compares a netlist that was read from a text with the bond graph that it is meant to stand for. `translation` tells
/// which variable is which; its own netlist is asked for nothing but the settings of the run. `None` when the text
/// makes no circuit.
pub fn certify(
    graph: &BondGraph,
    initial: &InitialState,
    translation: &Translation,
    netlist: &Netlist,
    seed: u64,
    d: &mut Vec<Diagnostic>,
) -> Option<Certificate> {
    let ours = &translation.netlist;
    let text = Text::new(graph, netlist, &translation.map, &ours.names, d)?;
    let (mut exact, laws) = exact::prove(graph, &text, seed);
    let values = values::compare(graph, initial, &text, ours);
    if !exact.mismatches.is_empty() && exact.singular.is_none() {
        suspect(&mut exact.mismatches, ours, netlist);
    }
    Some(Certificate { exact, laws, values, scaling: None })
}

/// Compares a scaled bond graph, which a text is held against, with the same graph as it was: equations and laws exactly,
/// whatever the factors; parameters, factors and starts in floating point.
pub fn scaling(
    [plain, scaled]: [&BondGraph; 2],
    [start, scaled_start]: [&InitialState; 2],
    asked: &[(Domain, f64)],
    seed: u64,
) -> Values {
    let (exact, laws) = exact::prove_scaled(plain, scaled, seed);
    let mut compared = exact.variables + laws.laws;
    let mut mismatches = laws.mismatches;
    mismatches.extend(exact.mismatches);
    let mut check = |name: &str, is: f64, should: f64, relative: f64| {
        compared += 1;
        // What is 0 in one may be rounding in the other, which the exact part has told apart.
        if is != should && (is - should).abs() > relative * is.abs().max(should.abs()) {
            mismatches.push(Mismatch::of(name, &format!("it is {is:e}, not {should:e}")));
        }
    };
    for (plain, scaled) in plain.parameters.iter().zip(&scaled.parameters) {
        check(&plain.name, scaled.value, plain.value, 0.0);
    }
    let factor = |domain: Domain| {
        let asked = asked.iter().rev().find(|(wanted, _)| *wanted == domain);
        asked.map_or(1.0, |(_, factor)| *factor)
    };
    for scale in &scaled.scales {
        let value = scaled.parameters.get(scale.parameter.index()).map_or(f64::NAN, |p| p.value);
        check(&format!("scale of {}", scale.domain.name()), value, factor(scale.domain), 0.0);
    }
    for id in plain.vertex_ids() {
        for end in plain.law_ports(id) {
            let (Some(kind), Some(bond)) = (plain.storage(end), plain.bond_at(end)) else {
                continue;
            };
            let (Some(is), Some(should)) = (scaled_start.storage(end), start.storage(end)) else {
                continue;
            };
            let factor = factor(plain.bond(bond).domain);
            let by = |power: Power| if power == Power::Effort { factor } else { 1.0 / factor };
            let name = plain.port_name(end);
            let (stored, power) = (by(kind.integrates()), by(kind.gives()));
            check(&format!("start of {name}"), is.stored * stored, should.stored, STARTS);
            check(&format!("start of {name}"), is.power * power, should.power, STARTS);
        }
    }
    let verdict = if mismatches.is_empty() { "pass" } else { "fail" };
    Values { verdict, compared, mismatches }
}

/// What starts that were solved for may differ by, in parts of their size.
const STARTS: f64 = 1e-9;

/// Names the first card that is not as the translation writes it, beside the first variable that differs.
fn suspect(mismatches: &mut [Mismatch], ours: &Netlist, theirs: &Netlist) {
    let (ours, theirs) = (cards(ours, &ours.cards, ""), cards(theirs, &theirs.cards, ""));
    let known: HashMap<&str, &str> =
        ours.iter().map(|(name, text, _)| (name.as_str(), text.as_str())).collect();
    let there: HashMap<&str, usize> =
        theirs.iter().enumerate().map(|(k, (name, ..))| (name.as_str(), k)).collect();
    let changed =
        theirs.iter().find(|(name, text, _)| known.get(name.as_str()) != Some(&text.as_str()));
    let lost = ours.iter().find(|(name, ..)| !there.contains_key(name.as_str()));
    let Some(first) = mismatches.iter_mut().find(|mismatch| mismatch.card.is_none()) else {
        return;
    };
    match (changed, lost) {
        (Some((name, _, span)), _) => {
            first.card = Some(name.clone());
            first.span = *span;
        }
        (None, Some((name, ..))) => first.message.push_str(&format!("; the text has no `{name}`")),
        (None, None) => {}
    }
}

/// The name of each device with that of its subcircuit, its card, and where it stands.
fn cards(netlist: &Netlist, cards: &[Card], within: &str) -> Vec<(String, String, Span)> {
    let mut found = vec![];
    for card in cards {
        match &card.kind {
            CardKind::Device(device) => {
                let name = format!("{within}{}", netlist.names.text(device.name)).to_lowercase();
                let text = write::card(&netlist.names, &card.kind).to_lowercase();
                found.push((name, text, card.span));
            }
            CardKind::Subcircuit(inner) => {
                let within = format!("{within}{}.", netlist.names.text(inner.name));
                found.extend(self::cards(netlist, &inner.cards, &within));
            }
            _ => {}
        }
    }
    found
}
