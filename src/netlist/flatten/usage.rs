//! Nodes that a netlist names only once: most often a slip of the pen.

use super::values::NEAR;
use crate::diagnostic::Diagnostic;
use crate::netlist::analysis::Analysis;
use crate::netlist::header::Header;
use crate::netlist::parts::every_leaf;
use crate::netlist::{Card, CardKind, Element, Expr, Fourier, Leaf, Name, Netlist, read};
use crate::quantity::nearest;
use crate::source::Span;

/// Warns of nodes that are named once in a scope, terminals, readings and outputs taken together.
pub fn check(netlist: &Netlist, header: &Header, d: &mut Vec<Diagnostic>) {
    if !header.columns.is_empty() {
        // It comes from a bond graph, where a signal that nothing reads is no slip: an output of a model, say.
        return;
    }
    let cards = every(&netlist.cards);
    let counts = vec![(0, 0); netlist.names.len()];
    let mut usage = Usage { globals: vec![], found: 0, scope: 0, last: 0, counts };
    // Domains of the header name nodes too; what they name is meant.
    let nodes = header.domains.iter().flat_map(|domain| &domain.nodes);
    let meant: Vec<Name> = nodes.filter_map(|name| netlist.names.find(name)).collect();
    usage.scope(netlist, &cards, &meant, d);
    if usage.found > MOST {
        let message = format!("{} more nodes are named only once", usage.found - MOST);
        d.push(Diagnostic::warning("W0731", Span::NONE, message));
    }
}

/// The first scope, that of the cards outside of subcircuits.
const TOP: u32 = 1;

/// As many are named; of a big deck nobody reads more.
const MOST: usize = 20;

/// The cards of a block, those of every branch of its choices too.
fn every(cards: &[Card]) -> Vec<&Card> {
    let mut found = Vec::with_capacity(cards.len());
    for card in cards {
        match &card.kind {
            CardKind::Choice(branches) => {
                found.extend(branches.iter().flat_map(|branch| every(&branch.cards)));
            }
            _ => found.push(card),
        }
    }
    found
}

struct Usage {
    /// Nodes that are one everywhere.
    globals: Vec<Name>,
    found: usize,
    scope: u32,
    last: u32,
    /// For each name the scope that has named it, and how often, 2 meaning more than once.
    counts: Vec<(u32, u8)>,
}

impl Usage {
    fn count(&mut self, name: Name) {
        if let Some((scope, count)) = self.counts.get_mut(name.0 as usize) {
            if *scope != self.scope {
                (*scope, *count) = (self.scope, 0);
            }
            *count = (*count + 1).min(2);
        }
    }

    fn expr(&mut self, expr: &Expr) {
        every_leaf(expr, &mut |leaf, _| {
            if let Leaf::Voltage(plus, minus) = leaf {
                self.count(*plus);
                if let Some(minus) = minus {
                    self.count(*minus);
                }
            }
        });
    }

    fn scope(
        &mut self,
        netlist: &Netlist,
        within: &[&Card],
        meant: &[Name],
        d: &mut Vec<Diagnostic>,
    ) {
        self.last += 1;
        let own = self.last;
        self.scope = own;
        for name in meant.iter().chain(meant) {
            self.count(*name);
        }
        for card in within {
            match &card.kind {
                CardKind::Device(device) => {
                    device.nodes.iter().for_each(|node| self.count(*node));
                    match &device.element {
                        Element::Vcvs { control, .. }
                        | Element::Vccs { control, .. }
                        | Element::Switch { control, .. } => {
                            control.iter().for_each(|node| self.count(*node));
                        }
                        Element::BehaviouralVoltage { law }
                        | Element::BehaviouralCurrent { law }
                        | Element::Resistor { value: law }
                        | Element::Capacitor { value: law, .. }
                        | Element::Inductor { value: law, .. }
                        | Element::Charge { law, .. }
                        | Element::Flux { law, .. }
                        | Element::LawSwitch { control: law, .. } => self.expr(law),
                        Element::Passive(passive) => {
                            passive.value.iter().for_each(|law| self.expr(law));
                        }
                        _ => {}
                    }
                }
                CardKind::Initial(values) | CardKind::Guess(values) => {
                    values.iter().for_each(|(node, _)| self.count(*node));
                }
                // Once more, for what stands elsewhere.
                CardKind::Global(nodes) => {
                    if own == TOP {
                        self.globals.extend(nodes.iter().copied());
                    }
                    nodes.iter().chain(nodes).for_each(|node| self.count(*node));
                }
                CardKind::Save { items, .. } | CardKind::Fourier(Fourier { items, .. }) => {
                    items.iter().for_each(|(_, expr)| {
                        // A bare word is a node.
                        if let crate::expr::Node::Leaf(Leaf::Parameter(name)) = &*expr.node {
                            self.count(*name);
                        }
                        self.expr(expr);
                    })
                }
                CardKind::Analysis(analysis) => match &**analysis {
                    Analysis::Transfer { output, .. } => self.expr(&output.1),
                    Analysis::Sensitivity { outputs, .. } => {
                        outputs.iter().for_each(|(_, expr)| self.expr(expr));
                    }
                    Analysis::PoleZero { input, output, .. } => {
                        input.iter().chain(output).for_each(|node| self.count(*node));
                    }
                    _ => {}
                },
                CardKind::Measure(measure) => {
                    read::measure::expressions(&measure.kind, &mut |expr| self.expr(expr));
                }
                _ => {}
            }
        }
        let once =
            |counts: &[(u32, u8)], name: &Name| counts.get(name.0 as usize) == Some(&(own, 1));
        // Mostly there is none, and the cards need not be gone through again.
        let any = self.counts.contains(&(own, 1));
        for card in within.iter().filter(|_| any) {
            let CardKind::Device(device) = &card.kind else { continue };
            if matches!(device.element, Element::Instance { .. }) {
                // An output of a subcircuit that nobody needs.
                continue;
            }
            for node in &device.nodes {
                if once(&self.counts, node) && netlist.names.text(*node) != "0" {
                    self.found += 1;
                    if self.found <= MOST {
                        d.push(self.warning(netlist, *node, card.span, own));
                    }
                }
            }
        }
        for card in within {
            if let CardKind::Subcircuit(subcircuit) = &card.kind {
                // A terminal is named outside as well.
                let meant: Vec<Name> =
                    subcircuit.ports.iter().chain(&self.globals).copied().collect();
                self.scope(netlist, &every(&subcircuit.cards), &meant, d);
            }
        }
    }

    fn warning(&self, netlist: &Netlist, node: Name, span: Span, scope: u32) -> Diagnostic {
        let text = netlist.names.text(node);
        let known = (0..self.counts.len().min(NEAR) as u32).map(Name).filter(|name| {
            *name != node
                && self
                    .counts
                    .get(name.0 as usize)
                    .is_some_and(|(own, count)| *own == scope && *count > 0)
        });
        let warning =
            Diagnostic::warning("W0731", span, format!("the node `{text}` is named only once"));
        match nearest(text, known.map(|name| netlist.names.text(name))) {
            Some(near) => warning.help(format!("did you mean `{near}`?")),
            None => warning,
        }
    }
}
