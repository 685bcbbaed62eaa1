//! Both routes over one experiment, and the judgement of them.
//!
//! The tolerances are chosen before anything runs. The second route keeps the error of a step below 1e-9 of each
//! unknown's size and the circuit is solved with reltol 1e-8, so that each is within some 1e-7 of range of the truth;
//! a trajectory may differ by 1e-5 of its range, a hundred times that and far below what a wrong sign, factor or
//! connection makes. The energy balance must close to 1e-6 of what the sources deliver and take.

use super::report::{EnergyReport, Report, Times, Trajectory};
use crate::bond::causality::Causality;
use crate::bond::graph::BondGraph;
use crate::circuit::stamps::stamp;
use crate::diagnostic::Diagnostic;
use crate::netlist::{Netlist, flatten};
use crate::second::{self, Run};
use crate::sim;
use crate::trace::Trace;

/// What is demanded.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The largest difference of a trajectory, in parts of its range.
    pub trajectories: f64,
    /// The largest residual of the energy, in parts of what sources deliver and take.
    pub energy: f64,
    /// reltol of the circuit's transient.
    pub reltol: f64,
    /// How the second route runs.
    pub second: second::Settings,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            trajectories: 1e-5,
            energy: 1e-6,
            reltol: 1e-8,
            second: second::Settings::default(),
        }
    }
}

/// Runs the graph's own equations and a netlist that is meant to stand for it, and judges them. A netlist that cannot
/// be run is an error, not a verdict.
pub fn verify_netlist(
    graph: &BondGraph,
    causality: &Causality,
    netlist: &Netlist,
    settings: &Settings,
    d: &mut Vec<Diagnostic>,
) -> Option<Report> {
    let circuit = circuit_route(netlist, settings.reltol, d)?;
    judge(graph, causality, &circuit, settings, d)
}

/// The transient of a netlist at the given reltol, on the grid that its header asks for.
pub fn circuit_route(netlist: &Netlist, reltol: f64, d: &mut Vec<Diagnostic>) -> Option<Trace> {
    let circuit = flatten::flatten(netlist, d)?;
    let stamps = stamp(&circuit, d)?;
    let system = sim::compile_for_run(&stamps, d)?;
    let mut settings = sim::Settings::of(&circuit, true, d)?;
    settings.reltol = reltol;
    let names = std::iter::once("time".to_string());
    let names = names.chain(stamps.outputs.iter().map(|output| output.0.to_string())).collect();
    let mut trace = Trace::new(names, vec![]);
    match sim::run(&stamps, &system, &settings, &mut trace) {
        Ok(statistics) => {
            d.extend(statistics.warnings);
            Some(trace)
        }
        Err(failure) => {
            d.push(*failure.diagnostic);
            None
        }
    }
}

/// The second route against a trace of the circuit, whose columns are the observed items in the same units. Rows are
/// compared at the trace's own times.
pub fn judge(
    graph: &BondGraph,
    causality: &Causality,
    circuit: &Trace,
    settings: &Settings,
    d: &mut Vec<Diagnostic>,
) -> Option<Report> {
    let run = second::integrate(graph, causality, circuit.time(), &settings.second, d)?;
    let trajectories = compare(&run, circuit, settings.trajectories);
    let energy = EnergyReport::of(&run.energy, settings.energy);
    let passes = energy.holds() && trajectories.iter().all(Trajectory::holds);
    let verdict = if passes { "pass" } else { "fail" };
    let energy = Some(energy);
    let (exact, laws, values, scaling) = (None, None, None, None);
    let times = Times::default();
    Some(Report { schema: 1, verdict, exact, laws, values, scaling, trajectories, energy, times })
}

/// Differences of each column, in parts of its range on the second route.
fn compare(run: &Run, circuit: &Trace, tolerance: f64) -> Vec<Trajectory> {
    let columns = run.names.iter().zip(&run.columns).zip(&run.least).skip(1);
    columns
        .map(|((name, ours), least)| {
            let (low, high) = ours
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let size = low.abs().max(high.abs());
            // What never changes is measured by its magnitude, what is 0 by what else there is of its kind.
            let range = if high - low > 1e-9 * size { high - low } else { size }.max(*least);
            let mut found = Trajectory {
                name: name.clone(),
                max: 0.0,
                rms: 0.0,
                at: 0.0,
                range: (high - low).max(0.0),
                tolerance,
            };
            let Some(theirs) = circuit.column(name) else {
                found.max = f64::INFINITY;
                found.rms = f64::INFINITY;
                return found;
            };
            let mut squares = 0.0;
            for ((ours, theirs), t) in ours.iter().zip(theirs).zip(circuit.time()) {
                let difference = (ours - theirs).abs();
                let error = if difference == 0.0 { 0.0 } else { difference / range };
                let error = if error.is_nan() { f64::INFINITY } else { error };
                squares += error * error;
                if error > found.max {
                    (found.max, found.at) = (error, *t);
                }
            }
            found.rms = (squares / ours.len().max(1) as f64).sqrt();
            if ours.len() != theirs.len() {
                (found.max, found.rms) = (f64::INFINITY, f64::INFINITY);
            }
            found
        })
        .collect()
}
