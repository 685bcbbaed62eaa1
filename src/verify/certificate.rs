//! The parts of the certificate that look at a text: exact, laws, values.

use super::exact::text::Text;
use super::report::{Exact, Laws, Mismatch, Values};
use super::{exact, values};
use crate::bond::graph::BondGraph;
use crate::bond::initial::InitialState;
use crate::diagnostic::Diagnostic;
use crate::netlist::{Card, CardKind, Netlist, write};
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
}

impl Certificate {
    /// Whether nothing differs.
    pub fn holds(&self) -> bool {
        self.exact.mismatches.is_empty()
            && self.laws.mismatches.is_empty()
            && self.values.mismatches.is_empty()
    }

    /// The first difference.
    pub fn first(&self) -> Option<&Mismatch> {
        let laws = self.laws.mismatches.iter().chain(&self.exact.mismatches);
        laws.chain(&self.values.mismatches).next()
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
    Some(Certificate { exact, laws, values })
}

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
