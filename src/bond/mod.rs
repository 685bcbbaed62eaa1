//! Bond graphs: the language, the graph, causality, and the graph's own equations.

pub mod graph;
pub mod causality;
pub mod initial;
