//! `.ac`: phasors of the linearised circuit over frequencies.

use super::analyses::{Column, Job, interrupted, unwritten};
use super::explain::Failure;
use super::linearise::{Linear, Pencil, singular};
use super::phasor;
use super::statistics::Statistics;
use super::system::System;
use crate::circuit::stamps::{Stamps, watched_name};
use crate::circuit::{Analysis, Circuit, Expr, Leaf, Output, Points, Probe};
use crate::linear::Complex;
use crate::trace::Sink;
use std::f64::consts::TAU;

/// Columns: two for a phasor, one for a part of one.
pub(super) fn columns(circuit: &Circuit, stamps: &Stamps) -> Vec<Column> {
    let mut columns = vec![("frequency".to_string(), "Hz")];
    let of = |output: &Output| match phasor::is_complex(&output.expr) {
        true => both(&output.name).to_vec(),
        false => vec![(output.name.clone(), phasor::unit(&output.expr))],
    };
    if circuit.outputs.is_empty() {
        let written = &stamps.outputs[..stamps.outputs.len() - stamps.watched];
        columns.extend(written.iter().flat_map(|(name, _)| both(name)));
    }
    columns.extend(circuit.outputs.iter().chain(&watched(circuit)).flat_map(of));
    columns
}

/// What is measured and not written, as outputs.
fn watched(circuit: &Circuit) -> Vec<Output> {
    let watched = circuit.watched.iter().enumerate();
    let named = |(k, expr): (usize, &Expr)| Output { name: watched_name(k), expr: expr.clone() };
    watched.map(named).collect()
}

/// The columns of a phasor.
pub(super) fn both(name: &str) -> [Column; 2] {
    let unit = match name.get(..2).map(str::to_lowercase).as_deref() {
        Some("v(") => "V",
        Some("i(") => "A",
        _ => "",
    };
    [".re", ".im"].map(|part| (format!("{name}{part}"), unit))
}

/// A circuit whose output columns are the voltages and currents that its outputs speak of, linearised.
pub(super) struct Probed {
    pub system: System,
    pub linear: Linear,
    probes: Vec<Probe>,
    /// Outputs; without any, every probe is one.
    outputs: Vec<Expr>,
}

impl Probed {
    /// Linearises a circuit for its outputs.
    pub fn of(circuit: &Circuit, outputs: &[Output]) -> Result<Probed, Failure> {
        let mut probes: Vec<Probe> = vec![];
        for output in outputs {
            output.expr.leaves(&mut |leaf, _| {
                if let Some(probe) = phasor::probe(leaf)
                    && !probes.contains(&probe)
                {
                    probes.push(probe);
                }
            });
        }
        let circuit = Circuit { outputs: reads(&probes), watched: vec![], ..circuit.clone() };
        let (system, linear) = Linear::of_circuit(&circuit, false)?;
        let outputs = outputs.iter().map(|output| output.expr.clone()).collect();
        Ok(Probed { system, linear, probes, outputs })
    }

    /// The probes as outputs.
    pub fn reads(&self) -> Vec<Output> {
        reads(&self.probes)
    }

    /// The value of a probe among those of all.
    pub fn at(&self, probe: Probe, values: &[Complex]) -> Complex {
        let found = self.probes.iter().position(|known| *known == probe);
        found.and_then(|k| values.get(k)).copied().unwrap_or_default()
    }

    /// Values of the columns at s.
    pub fn row(&self, s: Complex, x: &[Complex], row: &mut Vec<f64>) {
        let values: Vec<Complex> =
            self.linear.outputs.iter().map(|reading| reading.value(s, x)).collect();
        if self.outputs.is_empty() {
            row.extend(values.iter().flat_map(|value| [value.re, value.im]));
            return;
        }
        let at = |probe: Probe| self.at(probe, &values);
        for expr in &self.outputs {
            let value = phasor::evaluate(expr, &at);
            row.push(value.re);
            if phasor::is_complex(expr) {
                row.push(value.im);
            }
        }
    }
}

/// Probes as outputs.
fn reads(probes: &[Probe]) -> Vec<Output> {
    let leaf = |probe: &Probe| match *probe {
        Probe::Voltage(a, b) => Leaf::Voltage(a, b),
        Probe::Current(id) => Leaf::Current(id),
    };
    let read =
        |(k, probe): (usize, &Probe)| Output { name: k.to_string(), expr: Expr::leaf(leaf(probe)) };
    probes.iter().enumerate().map(read).collect()
}

/// Runs over the frequencies.
pub(super) fn ac(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let Analysis::Ac { frequencies } = job.analysis else { return Ok(Statistics::default()) };
    let watched = watched(job.circuit);
    // Where everything is written, what is measured is read apart.
    let apart = job.circuit.outputs.is_empty() && !watched.is_empty();
    let written = job.circuit.outputs.iter().chain(watched.iter().filter(|_| !apart));
    let probed = Probed::of(job.circuit, &written.cloned().collect::<Vec<_>>())?;
    let measured = if apart { Some(Probed::of(job.circuit, &watched)?) } else { None };
    let mut pencil = Pencil::new(&probed.linear, false);
    let phasors = probed.linear.phasors();
    let mut statistics = probed.linear.statistics.clone();
    let mut row = vec![];
    for place in 0..frequencies.len() {
        let frequency = frequencies.value(place);
        let s = Complex::new(0.0, TAU * frequency);
        pencil.factorise(s, &mut statistics).map_err(|found| {
            singular(&probed.system, &found, &format!("at {frequency} Hz"), &statistics)
        })?;
        let mut x = phasors.clone();
        pencil.solve(&mut x, &mut statistics);
        row.clear();
        row.push(frequency);
        probed.row(s, &x, &mut row);
        // Both have the same unknowns.
        if let Some(measured) = &measured {
            measured.row(s, &x, &mut row);
        }
        statistics.rows += 1;
        sink.row(&row).map_err(|error| unwritten(&error, &statistics))?;
        if let Some(failure) = interrupted(job, &statistics) {
            return Err(failure);
        }
    }
    describe(&mut statistics, &probed.linear, frequencies);
    Ok(statistics)
}

fn describe(statistics: &mut Statistics, linear: &Linear, frequencies: &Points) {
    statistics.method = "linear".into();
    statistics.reason = format!("phasors at {} frequencies", frequencies.len());
    statistics.equations = linear.len();
    statistics.entries = linear.conductances.len() + linear.storages.len();
}
