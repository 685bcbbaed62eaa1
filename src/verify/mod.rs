//! The certificate of a translation: a netlist's text against the bond graph, exactly, in its laws and in its values; the
//! netlist's transient against the bond graph's own equations, integrated without any circuit; and the balance of energy.

pub mod exact;
pub mod values;
pub mod certificate;
pub mod report;
pub mod routes;

pub use certificate::{Certificate, SEED, certify, scaling};
pub use report::{EnergyReport, Exact, Laws, Mismatch, Report, Times, Trajectory, Values};
pub use routes::{Settings, circuit_route, judge, verify_netlist};
