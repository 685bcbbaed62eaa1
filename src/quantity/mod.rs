//! Units with rational exponents, and the domains of bond graphs.

mod dimension;
mod symbols;
mod unit;
mod domain;
mod nearest;
mod words;
mod relations;
pub mod random;

pub use dimension::Dimension;
pub use domain::{DOMAINS, Domain, DomainRow};
pub use nearest::{did_you_mean, is_slip, nearest};
pub use relations::{Disagreement, Formula, Relations};
pub use symbols::{PREFIXES, SYMBOLS, Symbol, is_unit_name};
pub use unit::{Unit, UnitError, number_and_unit, scan_unit};
