//! The shipped models: their runs against references, closed forms, other routes and ngspice.

#[path = "../peers/mod.rs"]
mod peers;
#[path = "../translated/mod.rs"]
mod translated;
mod references;
mod stock_ngspice;

mod actuators;
mod models;
mod library;
mod fields;
mod event_models;
mod events;
mod signals;
mod lines;
mod rows;
mod counters;
mod linear;
mod symbolic;
mod transformed;
mod reduced;
mod paths;
mod second_route;
mod ngspice;
