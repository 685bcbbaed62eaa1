//! A bond graph as on paper: half arrows, causal strokes, numbered efforts and flows, domains by colour, what is
//! derivative and which loops are algebraic, instances in boxes.
//!
//! Conventions (D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, *System Dynamics*, ch. 3 and 5): the barb of the half
//! arrow stands on the side of the flow, below or to the right of the bond; the effort is written on the other side; the
//! stroke stands at the end on which the effort is imposed. Bonds are numbered in the order of the file.

mod sketch;
mod signals;
mod place;
mod fold;
mod paint;
mod blocks;
mod dot;
#[cfg(test)]
mod tests;

pub use dot::write as dot;
pub use paint::paint;
pub use place::{Placed, place};
pub use signals::{Block, BlockKind, Signals, Tap};
pub use sketch::{Group, Link, Node, NodeKind, Sketch, fitting, sketch};

use super::picture::Ink;
use crate::quantity::Domain;

/// More junctions and elements than this are not laid out: nobody could read the picture.
pub const MOST: usize = 160;

/// A domain's letters for effort and flow, and its colour.
pub fn letters(domain: Domain) -> (&'static str, &'static str, Ink) {
    match domain {
        Domain::Any => ("e", "f", Ink::Plain),
        Domain::Electrical => ("u", "i", Ink::Electrical),
        Domain::Rotation => ("τ", "ω", Ink::Rotation),
        Domain::Translation => ("F", "v", Ink::Translation),
        Domain::Hydraulic => ("p", "Q", Ink::Hydraulic),
        Domain::Magnetic => ("M", "Φ'", Ink::Magnetic),
        Domain::Thermal => ("T", "S'", Ink::Thermal),
        Domain::PseudoThermal => ("T", "H", Ink::Thermal),
        Domain::Pneumatic => ("p", "m'", Ink::Pneumatic),
    }
}
