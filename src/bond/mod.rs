//! Bond graphs: the language, the graph, causality, and the graph's own equations.

pub mod syntax;
pub mod elaborate;
pub mod elements;
pub mod graph;
pub mod words;
pub mod memory;
pub mod causality;
pub mod equations;
pub mod structure;
pub mod roots;
pub mod consistent;
pub mod fields;
pub mod prepared;
pub mod initial;
pub mod scale;
pub mod transform;
#[cfg(test)]
pub(crate) mod build;
