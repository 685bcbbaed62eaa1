//! The simulator: Stamps → System → rows of a trace.
//!
//! [`compile`] once; then an analysis of the table [`ANALYSES`], as often as wanted. Nothing in here knows text: options
//! come as [`Settings`], rows go to a [`Sink`](crate::trace::Sink), what went wrong comes back as a [`Failure`].

mod abreast;
mod ac;
pub mod analyses;
mod clocks;
mod compile;
mod condense;
mod conditions;
mod dc;
mod driven;
mod events;
mod explain;
mod inside;
mod junctions;
mod laws;
mod linearise;
mod matrix;
mod memory;
pub mod methods;
mod network;
mod near;
mod newton;
mod op;
mod output;
mod phasor;
mod plans;
mod poles;
mod reduce;
mod remarks;
mod search;
mod sensitivity;
mod sensitivity_in_time;
mod settings;
mod sparse;
mod statistics;
mod step;
mod structure;
mod system;
mod transfer;
#[cfg(test)]
mod tests;
mod ties;

pub use crate::circuit::stamps::UnknownId;
pub use abreast::{Group, Seat};
pub use analyses::{ANALYSES, Job};
pub use compile::{compile, compile_for_run, compile_like};
pub use condense::{run, run_in_company};
pub use explain::{Failure, FailureKind};
pub use linearise::{Charge, Input as Source, Linear};
pub use methods::{METHODS, Method};
pub use settings::{Interval, OPTIONS, OptionRow, Progress, Settings, Side, Tolerance};
pub use statistics::{Rejected, Statistics};
pub use step::{OperatingPoint, operating_point, transient};
pub use system::System;
