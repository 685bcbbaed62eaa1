//! Transfer functions in the model's own parameters.
//!
//! The linear equations are written down with symbols ([`symbols`]), the unknowns that input and output do not need left
//! out, the others eliminated without fractions (`eliminate`); what is left is N·u = D·w. The result is checked against
//! the numeric response at random s and for random values of the parameters.

pub mod symbols;
mod eliminate;
pub mod transfer;
pub mod print;
