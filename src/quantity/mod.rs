//! Units with rational exponents, and the domains of bond graphs.

mod dimension;
mod unit;
mod domain;
mod nearest;

pub use dimension::Dimension;
pub use domain::{DOMAINS, Domain, DomainRow};
pub use nearest::nearest;
pub use unit::{PREFIXES, SYMBOLS, Unit, UnitError, is_unit_name, scan_unit};
