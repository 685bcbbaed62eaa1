//! `.dc`: operating points one after the other, each sought from the last.
//!
//! Sources are set in the circuit at hand; for anything else (parameters, the temperature, values of devices) the
//! circuit is made anew and goes on from the same voltages and currents. Switches keep their states, so that a sweep up
//! and one down may differ where they have hysteresis.

use super::analyses::{Job, axes, interrupted, no_circuit, unwritten};
use super::compile::compile;
use super::explain::{Failure, Moment, failure};
use super::methods::Work;
use super::network::Network;
use super::newton::{Frozen, solve_frozen};
use super::op::{self, State, Trouble};
use super::statistics::Statistics;
use super::step::{self, past};
use super::system::System;
use crate::circuit::sweep;
use crate::circuit::{Circuit, DeviceKind, Waveform, stamps};
use crate::trace::Sink;

/// Newton iterations from the last point before the search begins anew.
const MOST: u64 = 100;

/// Runs the sweep.
pub(super) fn dc(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let axes = axes(job.analysis);
    let names: Vec<&str> =
        axes.iter().flat_map(|axis| axis.names.iter().map(String::as_str)).collect();
    let sources: Vec<Option<usize>> =
        names.iter().map(|name| source(job.circuit, job.system, name)).collect();
    let count = sweep::total(axes);
    let mut statistics = Statistics::default();
    let mut values = vec![];
    let mut start: Option<Kept> = None;
    let mut row = vec![];
    let mut point = 0;
    while point < count {
        sweep::values(axes, point, &mut values);
        let made = match sources.iter().any(Option::is_none) {
            true => Some(made(job, &names, &values, &statistics)?),
            false => None,
        };
        let system = made.as_ref().unwrap_or(job.system);
        let mut network = Network::new(system, 0.0, 0.0);
        step::set_to_dc(&mut network);
        network.start_modes(0.0);
        let floors = op::floors(&network);
        let mut work = Work::new(system.equations(), system.charges());
        network.statistics = std::mem::take(&mut statistics);
        let fixed: Vec<u64> = fixed(&sources, &values);
        if let Some(kept) = &start {
            kept.give(&mut network);
        }
        // As long as only sources change, the network stays.
        while point < count {
            sweep::values(axes, point, &mut values);
            if self::fixed(&sources, &values) != fixed {
                break;
            }
            let swept = sources.iter().zip(&values).filter_map(|(at, value)| Some(((*at)?, value)));
            let constant =
                |(at, value): (usize, &f64)| (at, Waveform::Constant(*value).segment(0.0));
            network.set_segments(swept.map(constant));
            network.forget_constant_factors();
            let state =
                solve(&mut network, start.as_ref(), &floors, &mut work).map_err(|trouble| {
                    let found =
                        failure(system, Moment::OperatingPoint, 0.0, &trouble, &network.statistics);
                    at_values(found, &names, &values)
                })?;
            row.clear();
            row.push(values.first().copied().unwrap_or(f64::NAN));
            row.resize(1 + system.outputs.len(), 0.0);
            network.outputs(&state.x, &state.w, 0.0, &mut row[1..]);
            network.statistics.rows += 1;
            sink.row(&row).map_err(|error| unwritten(&error, &network.statistics))?;
            if let Some(failure) = interrupted(job, &network.statistics) {
                return Err(failure);
            }
            start = Some(Kept::of(&network, state));
            point += 1;
            if let Some(progress) = &job.settings.progress {
                progress(point as f64 / count as f64);
            }
        }
        statistics = std::mem::take(&mut network.statistics);
    }
    statistics.method = "newton".into();
    statistics.reason = "operating points".into();
    statistics.equations = job.system.equations();
    statistics.charges = job.system.charges();
    statistics.entries = job.system.dynamic.pattern.len();
    Ok(statistics)
}

/// What a point hands on to the next.
struct Kept {
    state: State,
    modes: Vec<f64>,
}

impl Kept {
    fn of(network: &Network, state: State) -> Kept {
        Kept { state, modes: network.modes.clone() }
    }

    /// Switches stay as they are where the circuit has as many.
    fn give(&self, network: &mut Network) {
        if self.modes.len() == network.modes.len() {
            network.modes.copy_from_slice(&self.modes);
            network.forget_modes();
        }
    }
}

/// The bits of the values that are no sources'.
fn fixed(sources: &[Option<usize>], values: &[f64]) -> Vec<u64> {
    let others = sources.iter().zip(values).filter(|(source, _)| source.is_none());
    others.map(|(_, value)| value.to_bits()).collect()
}

/// The place among a system's sources of a source of the top; `None` for anything else.
fn source(circuit: &Circuit, system: &System, name: &str) -> Option<usize> {
    let (id, _) = circuit.ids().find(|(_, device)| {
        let source = matches!(
            device.kind,
            DeviceKind::VoltageSource { .. } | DeviceKind::CurrentSource { .. }
        );
        source && device.name.eq_ignore_ascii_case(name)
    })?;
    system.sources.iter().position(|source| source.device == id)
}

/// The system with other values.
fn made(
    job: &Job,
    names: &[&str],
    values: &[f64],
    statistics: &Statistics,
) -> Result<System, Failure> {
    let pairs: Vec<(&str, f64)> = names.iter().copied().zip(values.iter().copied()).collect();
    let circuit = (job.vary)(&pairs).map_err(|found| no_circuit(found, statistics))?;
    let mut d = vec![];
    let system = stamps::stamp(&circuit, &mut d).and_then(|stamps| compile(&stamps, &mut d));
    system.ok_or_else(|| at_values(no_circuit(d, statistics), names, values))
}

/// Says at which values it was.
fn at_values(mut failure: Failure, names: &[&str], values: &[f64]) -> Failure {
    let point: Vec<String> =
        names.iter().zip(values).map(|(name, value)| format!("{name} = {value:e}")).collect();
    failure.diagnostic.notes.push(format!("at {}", point.join(", ")));
    failure
}

/// The operating point: from the last one, else by the search.
fn solve(
    network: &mut Network,
    start: Option<&Kept>,
    floors: &[f64],
    work: &mut Work,
) -> Result<State, Trouble> {
    let system = network.system;
    let known = start.filter(|kept| kept.state.x.len() == system.equations());
    if let Some(kept) = known.filter(|kept| kept.state.q.len() == system.charges()) {
        network.free_conditions();
        let mut state = kept.state.clone();
        let held = vec![false; system.charges()];
        let found = past::at_rest(network, &mut state, |network, state| {
            let targets = state.q.clone();
            super::events::settle_modes(network, state, &mut vec![], |network, state| {
                let frozen = Frozen {
                    t: 0.0,
                    held: &held,
                    targets: &targets,
                    floors,
                    most: MOST,
                    prime: false,
                };
                let State { x, w, q, .. } = state;
                solve_frozen(network, &frozen, x, w, q, &mut work.scratch)
            })
        });
        if found.is_ok() {
            return Ok(state);
        }
        kept.give(network);
        network.forget_pivots();
    }
    let mut state = op::initial_values(network, 0.0);
    past::at_rest(network, &mut state, |network, state| {
        op::operating_point(network, state, floors, &mut vec![], &mut work.scratch)
    })?;
    Ok(state)
}
