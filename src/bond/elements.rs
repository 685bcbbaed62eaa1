//! The table of elements: what may stand before a colon.

use super::graph::Power;

/// The shapes of laws that a kind can have; [`Law`](super::graph::Law) says their equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Common effort.
    Zero,
    /// Common flow.
    One,
    /// Sets its effort.
    EffortSource,
    /// Sets its flow.
    FlowSource,
    /// Measures effort: sets flow 0.
    EffortDetector,
    /// Measures flow: sets effort 0.
    FlowDetector,
    /// e and f at the same instant.
    Dissipator,
    /// Stores q = ∫f dt.
    Compliance,
    /// Stores p = ∫e dt.
    Inertia,
    /// Several ports, some of which store q and some p.
    Mixed,
    /// e1 = r·e2.
    Transformer,
    /// e1 = r·f2.
    Gyrator,
}

/// One row of the table.
#[derive(Debug)]
pub struct Element {
    /// What stands before the colon.
    pub kind: &'static str,
    /// Its shape.
    pub shape: Shape,
    /// What it is called in messages.
    pub noun: &'static str,
}

const fn row(kind: &'static str, shape: Shape, noun: &'static str) -> Element {
    Element { kind, shape, noun }
}

/// Every kind, one row each. The kinds with an M are the same: what a value speaks of makes an element modulated.
pub const ELEMENTS: &[Element] = &[
    row("0", Shape::Zero, "0-junction"),
    row("1", Shape::One, "1-junction"),
    row("Se", Shape::EffortSource, "effort source"),
    row("MSe", Shape::EffortSource, "effort source"),
    row("Sf", Shape::FlowSource, "flow source"),
    row("MSf", Shape::FlowSource, "flow source"),
    row("R", Shape::Dissipator, "dissipator"),
    row("MR", Shape::Dissipator, "dissipator"),
    row("C", Shape::Compliance, "compliance"),
    row("MC", Shape::Compliance, "compliance"),
    row("I", Shape::Inertia, "inertia"),
    row("MI", Shape::Inertia, "inertia"),
    row("IC", Shape::Mixed, "IC field"),
    row("MIC", Shape::Mixed, "IC field"),
    row("TF", Shape::Transformer, "transformer"),
    row("MTF", Shape::Transformer, "transformer"),
    row("GY", Shape::Gyrator, "gyrator"),
    row("MGY", Shape::Gyrator, "gyrator"),
    row("De", Shape::EffortDetector, "effort detector"),
    row("Df", Shape::FlowDetector, "flow detector"),
];

/// The row of a kind.
pub fn element(kind: &str) -> Option<&'static Element> {
    ELEMENTS.iter().find(|row| row.kind == kind)
}

impl Shape {
    /// Whether any number of bonds may join it.
    pub fn is_junction(self) -> bool {
        matches!(self, Shape::Zero | Shape::One)
    }

    /// What a source or detector sets.
    pub fn sets(self) -> Option<Power> {
        match self {
            Shape::EffortSource | Shape::FlowDetector => Some(Power::Effort),
            Shape::FlowSource | Shape::EffortDetector => Some(Power::Flow),
            _ => None,
        }
    }

    /// Whether it has two ports.
    pub fn is_two_port(self) -> bool {
        matches!(self, Shape::Transformer | Shape::Gyrator)
    }
}
