//! One expression language, shared by `.bg` files and netlists.
//!
//! A tree is generic over its leaves: each stage of the river has its own kind of leaf (a name with a span; a bond's
//! effort; a node's voltage), and going from one stage to the next is [`Expr::try_map`].

pub mod tree;
pub mod curves;
pub mod values;
pub mod functions;
pub mod names;
pub mod evaluate;
mod chains;
pub mod parse;
pub mod dag;
mod derivative;
pub mod slope;
mod branches;
pub mod program;
pub mod polynomial;
pub mod print;
#[cfg(test)]
mod tests;

pub use crate::__expression_roles as roles;
pub use curves::Curve;
pub use dag::{Dag, NodeId};
pub use functions::{Dialect, FUNCTIONS, Function};
pub use program::Program;
pub use tree::{Binary, Expr, Node, Table, Unary};
