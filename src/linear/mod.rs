//! Sparse linear algebra over any field: ordering, LU, replay of a fixed pattern, pivot guard.
//!
//! Use: [`Pattern::from_triplets`] once; [`Lu::factor`] chooses pivots; [`Lu::refactor`] replays the same elimination
//! with new values; [`Lu::solve`]. When `refactor` reports [`Trouble`], call `factor` again.
//!
//! Pivots are chosen by Markowitz's rule with a threshold up to [`lu::SMALL`] unknowns, beyond that column by column
//! in an order of minimum degree (T. A. Davis, *Direct Methods for Sparse Linear Systems*, 2006).

mod cholesky;
mod choose;
mod components;
mod degree;
mod dense;
mod elimination;
mod factors;
mod field;
mod flat;
mod gilbert;
mod lu;
mod markowitz;
mod matching;
mod pack;
mod paths;
mod pattern;
mod pivots;
pub mod relations;
pub mod roots;
mod singletons;
pub mod symmetric;
#[cfg(test)]
mod mesh_tests;
#[cfg(test)]
mod tests;

pub use cholesky::{Orders, dot};
pub use components::components;
pub use elimination::eliminate;
pub use factors::Factors;
pub use field::{Complex, Field, Prime, Prime61, Prime62};
pub use flat::Flat;
pub use lu::{Lu, SMALL, Trouble, backward_error};
pub use matching::{Matching, maximum_matching};
pub use pack::{LANES, Number, Pack, put_lane, take_lane};
pub use pattern::Pattern;
pub use pivots::{Cause, Singular};
pub use singletons::Unfit;
