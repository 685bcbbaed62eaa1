//! From bond graphs to netlists: texts, hierarchy, dialects, scaling.

#[path = "../models/references/mod.rs"]
mod references;
#[path = "../peers/mod.rs"]
mod peers;
#[path = "../translated/mod.rs"]
mod translated;
mod mast_reader;
mod subcircuits;

mod dialects;
mod golden;
mod figures;
mod hierarchy;
mod mast;
mod scaling;
