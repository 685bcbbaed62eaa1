//! `.sens`: how outputs change with parameters and values of devices, at rest, over frequencies and over time.
//!
//! ```text
//! F(x; p) = 0     o = o(x; p)     do/dp = ∂o/∂p − ∂o/∂x·(∂F/∂x)⁻¹·∂F/∂p
//! direct:  J·x' = −∂F/∂p for each parameter        adjoint:  Jᵀ·λ = (∂o/∂x)ᵀ for each output
//! ```
//!
//! ∂F/∂x and ∂o/∂x are exact, from the expressions' derivatives. ∂F/∂p is that of the residual at fixed unknowns, by
//! central differences of the sixth order in p: no equation is solved for it, so that only rounding is left.

use super::ac::Probed;
use super::analyses::{Column, Job, interrupted, no_circuit, unwritten};
use super::compile::compile_linear;
use super::explain::{Failure, FailureKind};
use super::linearise::{self, Linear, Pencil};
use super::network::Network;
use super::op::State;
use super::statistics::Statistics;
use super::system::System;
use super::{ac, phasor, sensitivity_in_time};
use crate::circuit::sweep;
use crate::circuit::{Analysis, Circuit, Gradients, Output, Sensitivity, stamps};
use crate::diagnostic::Diagnostic;
use crate::linear::{Complex, Field};
use crate::source::Span;
use crate::trace::Sink;
use std::f64::consts::TAU;

/// The step of a difference as a part of the parameter, and where that is 0.
const PART: f64 = 4e-3;
const ABSOLUTE: f64 = 1e-3;
/// Steps of a difference: the parameter is moved to either side by each.
const STEPS: [f64; 3] = [1.0, 0.5, 0.25];

/// The abscissa, the outputs, and for each of them its slopes.
pub(super) fn columns(analysis: &Analysis) -> Vec<Column> {
    let Analysis::Sensitivity(wanted) = analysis else { return vec![] };
    let mut columns: Vec<Column> = match &*wanted.of {
        Analysis::Ac { .. } => vec![("frequency".into(), "Hz")],
        Analysis::Transient { .. } => vec![("time".into(), "s")],
        Analysis::Dc { axes } => axes
            .iter()
            .flat_map(|axis| axis.names.first())
            .take(1)
            .map(|n| (n.clone(), ""))
            .collect(),
        _ => vec![],
    };
    let phasors = matches!(*wanted.of, Analysis::Ac { .. });
    let mut column = |name: &str, output: &Output| match phasors && phasor::is_complex(&output.expr)
    {
        true => columns.extend(ac::both(name).map(|(name, _)| (name, ""))),
        false => columns.push((name.to_string(), "")),
    };
    wanted.outputs.iter().for_each(|output| column(&output.name, output));
    for output in &wanted.outputs {
        for (name, _) in &wanted.parameters {
            for suffix in suffixes(wanted.gradients) {
                column(&format!("d_{}/d_{name}{suffix}", output.name), output);
            }
        }
    }
    columns
}

/// What stands behind the name of a slope.
fn suffixes(gradients: Gradients) -> &'static [&'static str] {
    match gradients {
        Gradients::Plain => &[""],
        Gradients::Direct => &["_dir"],
        Gradients::Adjoint => &["_adj"],
        Gradients::Both => &["_dir", "_adj"],
    }
}

/// Runs it.
pub(super) fn sensitivity(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let Analysis::Sensitivity(wanted) = job.analysis else { return Ok(Statistics::default()) };
    let mut statistics = match &*wanted.of {
        Analysis::Ac { frequencies } => {
            let mut statistics = Statistics::default();
            let phasors = Phasors::new(job, wanted, &mut statistics)?;
            for place in 0..frequencies.len() {
                let row = phasors.row(frequencies.value(place), &mut statistics)?;
                send(job, sink, &row, &mut statistics)?;
            }
            statistics
        }
        Analysis::Transient { .. } => sensitivity_in_time::run(job, wanted, sink)?,
        Analysis::Dc { axes } => {
            let mut statistics = Statistics::default();
            let names: Vec<&str> =
                axes.iter().flat_map(|a| a.names.iter().map(String::as_str)).collect();
            let mut values = vec![];
            for point in 0..sweep::total(axes) {
                sweep::values(axes, point, &mut values);
                let pairs: Vec<_> = names.iter().copied().zip(values.iter().copied()).collect();
                let mut row = vec![values.first().copied().unwrap_or(f64::NAN)];
                row.extend(at_rest(job, wanted, &pairs, &mut statistics)?);
                send(job, sink, &row, &mut statistics)?;
            }
            statistics
        }
        _ => {
            let mut statistics = Statistics::default();
            let row = at_rest(job, wanted, &[], &mut statistics)?;
            send(job, sink, &row, &mut statistics)?;
            statistics
        }
    };
    statistics.method = "linear".into();
    statistics.reason = format!("slopes by {} parameters", wanted.parameters.len());
    statistics.equations = job.system.equations();
    Ok(statistics)
}

pub(super) fn send(
    job: &Job,
    sink: &mut dyn Sink,
    row: &[f64],
    statistics: &mut Statistics,
) -> Result<(), Failure> {
    statistics.rows += 1;
    sink.row(row).map_err(|error| unwritten(&error, statistics))?;
    interrupted(job, statistics).map_or(Ok(()), Err)
}

/// The vector that a system gives, the systems of a parameter being counted.
pub(super) type Vector<'a, T> = dyn FnMut(usize, &System) -> Result<Vec<T>, Failure> + 'a;

/// The same circuit moved to both sides of one parameter's value.
pub(super) struct Moved {
    /// Above and below by each of the steps.
    pub systems: Vec<[System; 2]>,
    /// The first step.
    step: f64,
}

impl Moved {
    /// The systems of every parameter; `pairs` hold what else is set, `outputs` what is read.
    pub fn all(
        job: &Job,
        wanted: &Sensitivity,
        outputs: &[Output],
        pairs: &[(&str, f64)],
        like: &System,
    ) -> Result<Vec<Moved>, Failure> {
        let one = |(name, value): &(String, f64)| {
            // A sweep may set the parameter itself.
            let swept = pairs.iter().rev().find(|(own, _)| own.eq_ignore_ascii_case(name));
            let value = swept.map_or(*value, |(_, value)| *value);
            let step = if value == 0.0 { ABSOLUTE } else { PART * value.abs() };
            let at = |value: f64| {
                let all: Vec<_> = pairs.iter().copied().chain([(name.as_str(), value)]).collect();
                let system = system(job, &all, outputs)?;
                if (system.equations(), system.charges()) == (like.equations(), like.charges()) {
                    return Ok(system);
                }
                let message = format!("with `{name}` = {value:e} the circuit has other unknowns");
                let help =
                    "such a value has no slope: take another parameter, or another value of it";
                let error = Diagnostic::error("E0813", Span::NONE, message).help(help);
                Err(Failure::new(FailureKind::NotSolved, error, &Statistics::default()))
            };
            let pair = |part: &f64| Ok([at(value + part * step)?, at(value - part * step)?]);
            Ok(Moved { systems: STEPS.iter().map(pair).collect::<Result<_, Failure>>()?, step })
        };
        wanted.parameters.iter().map(one).collect()
    }

    /// The slope of a vector that each system gives.
    pub fn slope<T: Field>(&self, of: &mut Vector<T>) -> Result<Vec<T>, Failure> {
        let mut slopes = vec![];
        for (k, ([above, below], part)) in self.systems.iter().zip(STEPS).enumerate() {
            let (above, below) = (of(2 * k, above)?, of(2 * k + 1, below)?);
            let by = 0.5 / (part * self.step);
            slopes.push(
                above.iter().zip(&below).map(|(a, b)| (*a - *b).scaled(by)).collect::<Vec<T>>(),
            );
        }
        // Richardson: errors of the second and of the fourth order in the step fall out.
        let [first, second, third] = &slopes[..] else { return Ok(vec![]) };
        let better = |a: T, b: T, by: f64| b + (b - a).scaled(1.0 / (by - 1.0));
        let both = first.iter().zip(second).zip(third);
        Ok(both.map(|((a, b), c)| better(better(*a, *b, 4.0), better(*b, *c, 4.0), 16.0)).collect())
    }
}

/// The circuit with other values, compiled with these outputs.
pub(super) fn system(
    job: &Job,
    pairs: &[(&str, f64)],
    outputs: &[Output],
) -> Result<System, Failure> {
    let none = Statistics::default();
    let made = match pairs.is_empty() {
        true => job.circuit.clone(),
        false => (job.vary)(pairs).map_err(|found| no_circuit(found, &none))?,
    };
    let outputs = match made.analyses.iter().rev().find_map(own_outputs) {
        // Outputs may speak of parameters, too.
        Some(own) if own.len() == outputs.len() => own.to_vec(),
        _ => outputs.to_vec(),
    };
    let circuit = Circuit { outputs, watched: vec![], ..made };
    let mut d = vec![];
    let stamps = stamps::stamp(&circuit, &mut d);
    let system = stamps.and_then(|stamps| compile_linear(&stamps, &mut d));
    system.ok_or_else(|| no_circuit(d, &none))
}

fn own_outputs(analysis: &Analysis) -> Option<&[Output]> {
    match analysis {
        Analysis::Sensitivity(own) => Some(&own.outputs),
        _ => None,
    }
}

/// The outputs at an operating point and their slopes.
fn at_rest(
    job: &Job,
    wanted: &Sensitivity,
    pairs: &[(&str, f64)],
    statistics: &mut Statistics,
) -> Result<Vec<f64>, Failure> {
    let system = system(job, pairs, &wanted.outputs)?;
    let moved = Moved::all(job, wanted, &wanted.outputs, pairs, &system)?;
    let (mut network, state) = linearise::rest(&system, true)?;
    let State { x, w, .. } = state;
    let none = vec![0.0; w.len()];
    let mut values = vec![0.0; wanted.outputs.len()];
    network.outputs(&x, &none, 0.0, &mut values);
    let modes = network.modes.clone();
    let n = x.len();
    // Of each parameter: the slope of the residual, and that of the outputs at fixed unknowns.
    let mut sides = vec![];
    for moved in &moved {
        sides.push(moved.slope(&mut |_, system| {
            let mut network = Network::new(system, 0.0, 0.0);
            super::step::set_to_dc(&mut network);
            if network.modes.len() == modes.len() {
                network.modes.copy_from_slice(&modes);
            }
            let mut all = vec![0.0; n + values.len()];
            network.evaluate(&x, 0.0);
            network.residual(&x, 0.0, &mut all[..n]);
            network.outputs(&x, &none, 0.0, &mut all[n..]);
            Ok(all)
        })?);
    }
    let linear = Linear::at(network, &x)?;
    let dot = |terms: &[(u32, f64)], x: &[Complex]| -> f64 {
        terms.iter().map(|(k, factor)| factor * x[*k as usize].re).sum()
    };
    let solver = |transposed: bool, statistics: &mut Statistics| {
        let mut pencil = Pencil::new(&linear, transposed);
        let done = pencil.factorise(Complex::ZERO, statistics);
        done.map_err(|found| linearise::singular(&system, &found, "at rest", statistics))?;
        Ok::<_, Failure>(pencil)
    };
    let mut slopes = vec![vec![vec![0.0; 2]; sides.len()]; wanted.outputs.len()];
    if wanted.gradients.direct() {
        let mut pencil = solver(false, statistics)?;
        for (p, side) in sides.iter().enumerate() {
            let mut change: Vec<Complex> = side[..n].iter().map(|r| Complex::from(-r)).collect();
            pencil.solve(&mut change, statistics);
            for (o, reading) in linear.outputs.iter().enumerate() {
                slopes[o][p][0] = side[n + o] + dot(&reading.terms, &change);
            }
        }
    }
    if wanted.gradients.adjoint() {
        let mut pencil = solver(true, statistics)?;
        for (o, reading) in linear.outputs.iter().enumerate() {
            let mut weights = vec![Complex::ZERO; n];
            for (k, factor) in &reading.terms {
                weights[*k as usize] = weights[*k as usize] + Complex::from(*factor);
            }
            pencil.solve(&mut weights, statistics);
            for (p, side) in sides.iter().enumerate() {
                let moved: f64 = weights.iter().zip(&side[..n]).map(|(w, r)| w.re * r).sum();
                slopes[o][p][1] = side[n + o] - moved;
            }
        }
    }
    let mut row = values;
    for slope in slopes.iter().flatten() {
        row.extend(wanted.gradients.picked(slope[0], slope[1]));
    }
    Ok(row)
}

/// The linearised circuit and what its parameters change of it.
struct Phasors<'a> {
    wanted: &'a Sensitivity,
    probed: Probed,
    moved: Vec<Moved>,
    /// The linearised circuits of each parameter in the order of [`Moved::slope`].
    linears: Vec<Vec<Linear>>,
}

impl<'a> Phasors<'a> {
    fn new(
        job: &Job,
        wanted: &'a Sensitivity,
        statistics: &mut Statistics,
    ) -> Result<Phasors<'a>, Failure> {
        let probed = Probed::of(job.circuit, &wanted.outputs)?;
        statistics.clone_from(&probed.linear.statistics);
        let reads = probed.reads();
        // Phasors are linear in unknowns, so that every system reads the probes, not the outputs.
        let probes = Sensitivity { outputs: reads.clone(), ..wanted.clone() };
        let read = Job { analysis: job.analysis, ..*job };
        let vary = |pairs: &[(&str, f64)]| {
            let made = (job.vary)(pairs)?;
            Ok(Circuit { analyses: vec![], ..made })
        };
        let read = Job { vary: &vary, ..read };
        let moved = Moved::all(&read, &probes, &reads, &[], &probed.system)?;
        let linear = |system: &System| Linear::of(system);
        let all = |moved: &Moved| moved.systems.iter().flatten().map(linear).collect();
        let linears = moved.iter().map(all).collect::<Result<_, Failure>>()?;
        Ok(Phasors { wanted, probed, moved, linears })
    }

    /// The outputs at a frequency and their slopes.
    fn row(&self, frequency: f64, statistics: &mut Statistics) -> Result<Vec<f64>, Failure> {
        let linear = &self.probed.linear;
        let s = Complex::new(0.0, TAU * frequency);
        let solver = |transposed: bool, statistics: &mut Statistics| {
            let mut pencil = Pencil::new(linear, transposed);
            let done = pencil.factorise(s, statistics);
            let place = format!("at {frequency} Hz");
            done.map_err(|found| {
                linearise::singular(&self.probed.system, &found, &place, statistics)
            })?;
            Ok::<_, Failure>(pencil)
        };
        let mut pencil = solver(false, statistics)?;
        let mut x = linear.phasors();
        pencil.solve(&mut x, statistics);
        let n = x.len();
        let mut sides: Vec<Vec<Complex>> = vec![];
        for (moved, linears) in self.moved.iter().zip(&self.linears) {
            sides.push(moved.slope(&mut |k, _| {
                let mut all = linears[k].misfit(s, &x);
                all.extend(linears[k].outputs.iter().map(|reading| reading.value(s, &x)));
                Ok(all)
            })?);
        }
        let probes = linear.outputs.len();
        // d(probe)/dp, directly and by the adjoint.
        let mut slopes = vec![vec![[Complex::ZERO; 2]; probes]; sides.len()];
        if self.wanted.gradients.direct() {
            for (side, slopes) in sides.iter().zip(&mut slopes) {
                let mut change: Vec<Complex> = side[..n].iter().map(|r| -*r).collect();
                pencil.solve(&mut change, statistics);
                for (k, reading) in linear.outputs.iter().enumerate() {
                    slopes[k][0] = side[n + k] + reading.value(s, &change);
                }
            }
        }
        if self.wanted.gradients.adjoint() {
            let mut transposed = solver(true, statistics)?;
            for (k, reading) in linear.outputs.iter().enumerate() {
                let mut weights = vec![Complex::ZERO; n];
                for (at, factor) in &reading.terms {
                    weights[*at as usize] = weights[*at as usize] + Complex::from(*factor);
                }
                for (at, factor) in &reading.rates {
                    weights[*at as usize] = weights[*at as usize] + s.scaled(*factor);
                }
                transposed.solve(&mut weights, statistics);
                for (side, slopes) in sides.iter().zip(&mut slopes) {
                    let moved = weights.iter().zip(&side[..n]);
                    let moved = moved.fold(Complex::ZERO, |sum, (w, r)| sum + *w * *r);
                    slopes[k][1] = side[n + k] - moved;
                }
            }
        }
        let values: Vec<Complex> =
            linear.outputs.iter().map(|reading| reading.value(s, &x)).collect();
        let mut row = vec![frequency];
        let push = |value: Complex, complex: bool, row: &mut Vec<f64>| {
            row.push(value.re);
            row.extend(complex.then_some(value.im));
        };
        for output in &self.wanted.outputs {
            let value = phasor::evaluate(&output.expr, &|probe| self.probed.at(probe, &values));
            push(value, phasor::is_complex(&output.expr), &mut row);
        }
        for output in &self.wanted.outputs {
            let complex = phasor::is_complex(&output.expr);
            for slopes in &slopes {
                let along = |which: usize| {
                    let change: Vec<Complex> = slopes.iter().map(|both| both[which]).collect();
                    self.along(output, &values, &change)
                };
                for value in self.wanted.gradients.picked(0, 1).map(along) {
                    push(value, complex, &mut row);
                }
            }
        }
        Ok(row)
    }

    /// The slope of an output along a change of the probes: of parts of phasors there is one only along a direction.
    fn along(&self, output: &Output, values: &[Complex], change: &[Complex]) -> Complex {
        let size = |all: &[Complex]| all.iter().map(|z| z.magnitude()).fold(0.0, f64::max);
        let most = size(change);
        if most == 0.0 {
            return Complex::ZERO;
        }
        let step = 1e-3 * size(values).max(f64::MIN_POSITIVE) / most;
        let at = |by: f64| {
            let moved: Vec<Complex> = values
                .iter()
                .zip(change)
                .map(|(value, change)| *value + change.scaled(by))
                .collect();
            phasor::evaluate(&output.expr, &|probe| self.probed.at(probe, &moved))
        };
        let slope = |by: f64| (at(by) - at(-by)).scaled(0.5 / by);
        let better = |a: Complex, b: Complex, by: f64| b + (b - a).scaled(1.0 / (by - 1.0));
        let [a, b, c] = STEPS.map(|part| slope(part * step));
        better(better(a, b, 4.0), better(b, c, 4.0), 16.0)
    }
}
