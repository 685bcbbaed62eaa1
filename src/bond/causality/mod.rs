//! Causality: which end of each bond imposes the effort, and what follows from it.

use super::graph::{BondId, Stroke, VertexId};

/// The result of the sequential causality assignment procedure (SCAP; Karnopp, Margolis, Rosenberg, ch. 5).
#[derive(Clone, Debug, Default)]
pub struct Causality {
    /// The stroke of each bond, by [`BondId`]; `None` only where a conflict left it open.
    pub strokes: Vec<Option<Stroke>>,
    /// Storages in integral causality, in the order in which they were assigned.
    pub states: Vec<VertexId>,
    /// Storages in derivative causality.
    pub dependent: Vec<Dependent>,
    /// Algebraic loops, each as a causal path.
    pub loops: Vec<AlgebraicLoop>,
    /// Order of the system: integral storages and integrators of signals.
    pub order: usize,
}

/// A storage that others determine.
#[derive(Clone, Debug)]
pub struct Dependent {
    /// The storage.
    pub storage: VertexId,
    /// What determines it (storages in integral causality or sources).
    pub on: Vec<VertexId>,
    /// The causal path from the first of them to the storage.
    pub path: Vec<BondId>,
}

/// A causal path from a dissipator back to itself without a storage on it.
#[derive(Clone, Debug)]
pub struct AlgebraicLoop {
    /// The elements on it.
    pub elements: Vec<VertexId>,
    /// Its bonds in order.
    pub path: Vec<BondId>,
}
