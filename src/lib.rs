//! bondspice turns bond graphs into circuits.
//!
//! One river of nouns, one verb between neighbours; nothing flows back:
//!
//! ```text
//! model.bg ─parse→ File ─elaborate→ BondGraph ─assign→ Causality
//!                                       └────translate────┘
//!                                               ↓
//!                        Netlist ─write→ model.cir ─read→ Netlist
//!                                               ↓ flatten
//!                                            Circuit ─compile→ System ─solve→ Trace ─compare→ report
//! ```
//!
//! The modules stand in floors: each uses only those above it in this list.
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod source;
pub mod diagnostic;
pub mod quantity;
pub mod linear;
pub mod expr;
pub mod trace;
pub mod bond;
pub mod circuit;
pub mod netlist;
pub mod translate;
pub mod sim;
pub mod second;
pub mod verify;
pub mod analysis;
pub mod draw;
pub mod report;
pub mod lsp;
pub mod cli;
