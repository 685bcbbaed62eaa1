//! What linear theory says of a model: matrices, poles and zeros, frequency responses, transfer functions in its own
//! parameters, causal paths and loops, gains of regulators; and sweeps over parameters.
//!
//! ```text
//! E·y' = A·y + B·u        w = C·y + D·u        y: states, efforts, flows, signals of the bond graph
//! ```
//!
//! All of it starts from the bond graph's own equations, linearised by exact derivatives at a [`point`]: no circuit, no
//! causality is needed for that. Causality says what a variable is determined by, and so what is put aside when something
//! else is to impose it.

pub mod point;
pub mod linear;
pub mod circuit;
pub mod state_space;
pub mod poles;
pub mod response;
pub mod export;
pub mod symbolic;
pub mod paths;
pub mod resonance;
pub mod tune;
pub mod activity;
pub mod sweep;
