//! The certificate of a translation, as far as it is built: trajectories and energy.
//!
//! The bond graph's own equations, integrated without any circuit, are held against the netlist's transient for every
//! observed variable, and the energy of the run is balanced. What is not built is not in the report.

pub mod exact;
pub mod values;
pub mod certificate;
pub mod report;
pub mod routes;

pub use certificate::{Certificate, SEED, certify};
pub use report::{EnergyReport, Exact, Laws, Mismatch, Report, Trajectory, Values};
pub use routes::{Settings, circuit_route, judge, verify_netlist};
