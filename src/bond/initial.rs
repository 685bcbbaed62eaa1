//! Initial values: what every storage, integrator, bond and signal is at t = 0+.

/// Values at t = 0+, all in SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InitialState {
    /// By vertex: its storage at the start; `None` for what stores nothing.
    pub storages: Vec<Option<StorageValue>>,
    /// By signal: its value; for an integrator the value that it starts from.
    pub signals: Vec<f64>,
    /// By bond: its effort.
    pub efforts: Vec<f64>,
    /// By bond: its flow, along the half arrow.
    pub flows: Vec<f64>,
}

/// A storage at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StorageValue {
    /// q of a compliance, p of an inertia; 0 for one in rate form, whose charge is counted from the start.
    pub stored: f64,
    /// Its own power variable that the law gives: e of a compliance, f of an inertia, f counted into the element.
    pub power: f64,
}
