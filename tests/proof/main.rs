//! The certificate: of shipped models, of random graphs, and of texts that are wrong.

#[path = "../models/stock_ngspice/mod.rs"]
mod stock_ngspice;
#[path = "../peers/mod.rs"]
mod peers;
mod random_graphs;

mod certificate;
mod certificate_random;
mod verify;
mod mutations;
mod random_in_ngspice;
mod energy;
