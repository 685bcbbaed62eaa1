//! What a change does to the graph, in the words of the graph.

use super::arguments::Scaling;
use crate::bond::graph::{BondId, VertexId};
use std::collections::{HashMap, HashSet};

/// An end of a bond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The tail of the half arrow.
    From,
    /// Its head.
    To,
}

/// One change, made as a whole or not at all.
#[derive(Debug, Default)]
pub struct Plan {
    /// What was done and the law that justifies it: the comment above the change.
    pub why: String,
    /// Elements and junctions that are no more.
    pub gone: HashSet<VertexId>,
    /// Bonds that are no more.
    pub cut: HashSet<BondId>,
    /// Ends of bonds that hang elsewhere, by the name as the text is to have it.
    pub ends: HashMap<(BondId, Side), String>,
    /// Junctions put into bonds: their kind and name.
    pub through: HashMap<BondId, (&'static str, String)>,
    /// Laws that are others.
    pub laws: HashMap<VertexId, Change>,
    /// What readings become.
    pub readings: Vec<(Read, String)>,
}

/// How a law changes.
#[derive(Clone, Debug)]
pub enum Change {
    /// Its variables are others.
    Scaled(Scaling),
    /// The same, and what is stored starts from nothing.
    Lumped(Scaling),
    /// The kind and the arguments in brackets, as text.
    Text(&'static str, String),
}

/// A reading in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Read {
    /// `e(x)`: what is read, of which element or junction, as the text writes it.
    Of(&'static str, String),
    /// `f(a -> b)`
    Bond(&'static str, BondId),
}
