//! Causality: which end of each bond imposes the effort, and what follows from it.
//!
//! The sequential causality assignment procedure (SCAP; Karnopp, Margolis, Rosenberg, *System Dynamics*, ch. 5), in the
//! order: sources and detectors; strokes drawn in the text; two-ports whose modulus may vanish, so that nothing is divided
//! by it; storages in integral causality (stated initial value first, then non-linear laws, then as in the file);
//! dissipators with a law, as it is written; the others.

mod assign;
mod paths;
mod report;
mod structure;
#[cfg(test)]
mod tests;

pub use report::{to_json, to_text};

use super::graph::*;
use crate::diagnostic::{Diagnostic, has_errors};

/// The result of the assignment, and what it shows.
#[derive(Clone, Debug, Default)]
pub struct Causality {
    /// The stroke of each bond, by [`BondId`]; `None` where a conflict left it open, and round a ring of equal junctions.
    pub strokes: Vec<Option<Stroke>>,
    /// Ports of storages in integral causality, in the order in which they were assigned.
    pub states: Vec<End>,
    /// Storages in derivative causality.
    pub dependent: Vec<Dependent>,
    /// Algebraic loops, each as a causal path.
    pub loops: Vec<AlgebraicLoop>,
    /// Where no stroke will do.
    pub conflicts: Vec<Conflict>,
    /// Order of the system: integral storages and integrators of signals.
    pub order: usize,
}

/// A storage that others determine.
#[derive(Clone, Debug)]
pub struct Dependent {
    /// The storage, at its port.
    pub storage: End,
    /// What determines it (storages in integral causality or sources), the nearest first.
    pub on: Vec<End>,
    /// The causal path from the first of them to the storage.
    pub path: Vec<BondId>,
}

/// Variables that determine each other at the same instant, through laws, junctions and signals.
#[derive(Clone, Debug)]
pub struct AlgebraicLoop {
    /// The elements on it.
    pub elements: Vec<VertexId>,
    /// The signals on it.
    pub signals: Vec<SignalId>,
    /// Its bonds along the causal path; where several loops share bonds, they are one with all of their bonds.
    pub path: Vec<BondId>,
}

/// Elements whose demands on a junction or two-port exclude each other.
#[derive(Clone, Debug)]
pub struct Conflict {
    /// The junction or two-port where they meet.
    pub at: VertexId,
    /// The elements (or the ends of bonds with a stroke drawn) that fight.
    pub elements: Vec<VertexId>,
    /// The bonds between them.
    pub path: Vec<BondId>,
}

impl Causality {
    /// Whether the bond's effort is imposed on this vertex, at this port, by the other end.
    pub fn receives_effort(&self, graph: &BondGraph, bond: BondId, end: End) -> Option<bool> {
        let stroke = self.strokes.get(bond.index()).copied().flatten()?;
        let at_tail = graph.bond(bond).from == end;
        Some(at_tail == (stroke == Stroke::AtFrom))
    }
}

/// Checks the graph and assigns causality; `None` when there were errors.
pub fn assign(graph: &BondGraph, diagnostics: &mut Vec<Diagnostic>) -> Option<Causality> {
    let before = diagnostics.len();
    let causality = analyse(graph, diagnostics);
    (!has_errors(&diagnostics[before..])).then_some(causality)
}

/// As [`assign`], but gives what it found in spite of errors.
pub fn analyse(graph: &BondGraph, diagnostics: &mut Vec<Diagnostic>) -> Causality {
    let before = diagnostics.len();
    structure::check(graph, diagnostics);
    if has_errors(&diagnostics[before..]) {
        let strokes = vec![None; graph.bonds.len()];
        return Causality { strokes, ..Causality::default() };
    }
    let rings = structure::rings(graph);
    let mut causality = assign::strokes(graph, &rings);
    if causality.conflicts.is_empty() {
        paths::trace(graph, &mut causality);
    }
    report::explain(graph, &causality, &rings, diagnostics);
    causality
}

/// Which end of its bond a stroke is on when `vertex` receives the effort (`true`) or imposes it.
fn stroke_for(graph: &BondGraph, bond: BondId, end: End, receives_effort: bool) -> Stroke {
    if (graph.bond(bond).from == end) == receives_effort { Stroke::AtFrom } else { Stroke::AtTo }
}

/// Whether a modulus varies: it speaks of more than numbers and parameters.
fn is_modulated(expr: &Expr) -> bool {
    let mut varies = false;
    expr.leaves(&mut |leaf, _| varies |= !matches!(leaf, Leaf::Parameter(_)));
    varies
}

/// Whether the causality at a storage's port is integral: it receives what it integrates.
fn is_integral(graph: &BondGraph, causality: &Causality, end: End, kind: Storage) -> Option<bool> {
    let receives = causality.receives_effort(graph, graph.bond_at(end)?, end)?;
    Some(receives == (kind.integrates() == Power::Effort))
}
