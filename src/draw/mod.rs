//! Pictures: bond graphs as on paper, circuits as schematics, traces as plots; SVG, TikZ, DOT, and text for a terminal.
//!
//! A drawing is made in two steps: a layout places things, and a [`Picture`](picture::Picture) holds the lines and words
//! that follow, which [`svg`] and [`tikz`] write. Nothing depends on a font, a clock or a hash: same input, same bytes.

pub mod text;
pub mod picture;
pub mod svg;
pub mod tikz;
pub mod grid;
pub mod bond_graph;
pub mod plot;
pub mod balance;
pub mod schematic;
