//! Decks: reading, analyses, measures, formats, and what other simulators make of them.

#[path = "../peers/mod.rs"]
mod peers;
mod small_signal;

mod analyses;
mod fourier;
mod poles;
mod sensitivity;
mod layers;
mod measures;
mod condensed;
mod meshes;
mod exponential;
mod difficult_decks;
mod decks_in_ngspice;
mod expressions_in_ngspice;
mod formats;
mod reading;
mod xyce;
mod abreast;
mod allocations;
