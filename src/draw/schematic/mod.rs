//! A circuit as a schematic: ladders with a common return, since series and parallel connections come out so; what
//! bridges nodes that do not stand side by side runs in layers above.
//!
//! Each part of the circuit that hangs together without ground is drawn by itself. Its main nodes stand along a line;
//! what leads from one of them to ground, directly or by nodes of its own, hangs below it. Parts that are alike, as those of
//! an array of models, are drawn once.

mod plan;
mod alike;
mod rows;
mod place;
mod paint;
mod symbols;
mod circuitikz;
#[cfg(test)]
mod tests;

pub use circuitikz::write as circuitikz;
pub use paint::paint;
pub use place::{Placed, Schematic, place};
pub use symbols::Symbol;

/// More devices than this are not drawn: nobody could read the picture.
pub const MOST: usize = 200;
