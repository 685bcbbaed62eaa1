//! A circuit linearised at its operating point: matrices with names.
//!
//! ```text
//! (G + s·C − Σ D_k·e^(−s·T_k))·x = B·u        y = (P + s·R)·x
//! ```
//!
//! x are the unknowns, u the independent sources, y the output columns, D_k the delays of lines. Small changes of a
//! non-linear circuit obey it near the operating point, a linear circuit everywhere. Switches stay in the states that
//! the operating point finds.

use super::analyses::no_circuit;
use super::compile::compile_linear;
use super::explain::{self, Failure, FailureKind, Moment, failure};
use super::methods::Work;
use super::network::Network;
use super::op;
use super::statistics::Statistics;
use super::step::{self, past};
use super::system::System;
use crate::circuit::stamps::{self, MemoryKind, Unknown};
use crate::circuit::{Circuit, DeviceId, Parts};
use crate::diagnostic::Diagnostic;
use crate::linear::{Complex, Field, Lu, Pattern, Singular};
use crate::source::Span;

/// A linear circuit.
#[derive(Clone, Debug)]
pub struct Linear {
    /// What x is.
    pub unknowns: Vec<Unknown>,
    /// Entries of G: (equation, unknown, value).
    pub conductances: Vec<(u32, u32, f64)>,
    /// Entries of C.
    pub storages: Vec<(u32, u32, f64)>,
    /// What C is made of: s·C·x is the sum of the rates of all charges, each in its equations.
    pub charges: Vec<Charge>,
    /// Delays.
    pub delays: Vec<Delay>,
    /// The independent sources, and what a unit of each adds to the right-hand side.
    pub sources: Vec<Input>,
    /// Output columns.
    pub outputs: Vec<Reading>,
    /// The unknowns at the operating point.
    pub point: Vec<f64>,
    /// What it took to find it.
    pub statistics: Statistics,
}

/// A term D·e^(−s·T).
#[derive(Clone, Debug)]
pub struct Delay {
    /// T in s.
    pub by: f64,
    /// Entries of D.
    pub entries: Vec<(u32, u32, f64)>,
}

/// A charge or a flux.
#[derive(Clone, Debug)]
pub struct Charge {
    /// Whose.
    pub device: DeviceId,
    /// Its value at the operating point.
    pub value: f64,
    /// The equations that its rate enters, with factors.
    pub into: Vec<(u32, f64)>,
    /// Its slopes by unknowns.
    pub slopes: Vec<(u32, f64)>,
}

/// An independent source.
#[derive(Clone, Debug)]
pub struct Input {
    /// Which.
    pub device: DeviceId,
    /// Its phasor, among others.
    pub parts: Parts,
    /// Its column of B.
    pub into: Vec<(u32, f64)>,
}

/// An output: Σ factor·x + s·Σ factor·x.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Its header.
    pub name: String,
    /// Its row of P.
    pub terms: Vec<(u32, f64)>,
    /// Its row of R.
    pub rates: Vec<(u32, f64)>,
    /// The same as charges, whose rates it reads.
    pub charges: Vec<(u32, f64)>,
}

impl Linear {
    /// Linearises a system that was compiled by `compile_linear` at its operating
    /// point.
    ///
    /// # Errors
    /// When there is no operating point, or the circuit holds samples at instants.
    pub fn of(system: &System) -> Result<Linear, Failure> {
        // What is linear is the same everywhere.
        let (network, state) = rest(system, !system.is_linear() || !system.modes.is_empty())?;
        Linear::at(network, &state.x)
    }

    /// Linearises a circuit at its operating point, for its own outputs. That of a circuit that is linear is sought only
    /// where it is `wanted`.
    ///
    /// # Errors
    /// When it cannot be compiled, has no operating point, or holds samples at instants.
    pub fn of_circuit(circuit: &Circuit, wanted: bool) -> Result<(System, Linear), Failure> {
        let mut d = vec![];
        let stamps = stamps::stamp(circuit, &mut d);
        let system = stamps.and_then(|stamps| compile_linear(&stamps, &mut d));
        let Some(system) = system else { return Err(no_circuit(d, &Statistics::default())) };
        let (network, state) =
            rest(&system, wanted || !system.is_linear() || !system.modes.is_empty())?;
        let linear = Linear::at(network, &state.x)?;
        Ok((system, linear))
    }

    /// Linearises a network at values of its unknowns.
    pub(super) fn at(mut network: Network, x: &[f64]) -> Result<Linear, Failure> {
        let system = network.system;
        network.linearise(x, 0.0, false);
        let (conductances, storages) = network.matrices();
        let mut delays = vec![];
        let slopes = network.memory_slopes(x);
        for (memory, slopes) in system.memories.iter().zip(slopes) {
            let MemoryKind::Delay { by } = memory.kind else {
                return Err(sampled(system, memory.device, &network.statistics));
            };
            let entries = memory.into.iter().flat_map(|(row, factor)| {
                slopes.iter().map(move |(column, slope)| (*row, *column, factor * slope))
            });
            delays.push(Delay { by, entries: entries.collect() });
        }
        let sources = system.sources.iter().map(|source| Input {
            device: source.device,
            parts: source.parts,
            into: source.into.clone(),
        });
        let mut charges: Vec<Charge> = charges(&network, x);
        for (charge, unknown, slope) in network.storage_slopes() {
            charges[charge as usize].slopes.push((unknown, slope));
        }
        let outputs = network.output_slopes(x).into_iter().zip(&system.outputs);
        let outputs: Vec<Reading> = outputs
            .map(|((terms, own), name)| {
                let rate = |(k, factor): &(u32, f64)| {
                    let slopes = charges[*k as usize].slopes.iter();
                    slopes.map(|(x, slope)| (*x, factor * slope)).collect::<Vec<_>>()
                };
                let rates = own.iter().flat_map(rate).collect();
                Reading { name: name.to_string(), terms, rates, charges: own }
            })
            .collect();
        Ok(Linear {
            unknowns: system.unknowns.clone(),
            conductances,
            storages,
            charges,
            delays,
            sources: sources.collect(),
            outputs,
            point: x.to_vec(),
            statistics: network.statistics,
        })
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.unknowns.len()
    }

    /// Whether there is nothing to solve.
    pub fn is_empty(&self) -> bool {
        self.unknowns.is_empty()
    }

    /// Right-hand side of the sources' phasors.
    pub fn phasors(&self) -> Vec<Complex> {
        let mut b = vec![Complex::ZERO; self.len()];
        for source in &self.sources {
            let Some(phasor) = source.parts.ac else { continue };
            let (sine, cosine) = libm::sincos(phasor.phase);
            let value = Complex::new(phasor.magnitude * cosine, phasor.magnitude * sine);
            for (row, factor) in &source.into {
                b[*row as usize] = b[*row as usize] + value.scaled(*factor);
            }
        }
        b
    }

    /// (G + sC − ΣD·e^(−sT))·x − B·u: what is left of the equations.
    pub fn misfit(&self, s: Complex, x: &[Complex]) -> Vec<Complex> {
        let mut left: Vec<Complex> = self.phasors().into_iter().map(|b| -b).collect();
        let mut add = |list: &[(u32, u32, f64)], factor: Complex| {
            for (row, column, value) in list {
                let term = factor * x[*column as usize].scaled(*value);
                left[*row as usize] = left[*row as usize] + term;
            }
        };
        add(&self.conductances, Complex::ONE);
        add(&self.storages, s);
        for delay in &self.delays {
            let (sine, cosine) = libm::sincos(-s.im * delay.by);
            let size = libm::exp(-s.re * delay.by);
            add(&delay.entries, -Complex::new(size * cosine, size * sine));
        }
        left
    }

    /// Right-hand side of a unit of one source; `None` when the circuit has no such source.
    pub fn unit(&self, device: DeviceId) -> Option<Vec<f64>> {
        let source = self.sources.iter().find(|source| source.device == device)?;
        let mut b = vec![0.0; self.len()];
        for (row, factor) in &source.into {
            b[*row as usize] += factor;
        }
        Some(b)
    }
}

impl Reading {
    /// Its value where s and the unknowns are known.
    pub fn value(&self, s: Complex, x: &[Complex]) -> Complex {
        let sum = |terms: &[(u32, f64)]| {
            terms
                .iter()
                .fold(Complex::ZERO, |sum, (k, factor)| sum + x[*k as usize].scaled(*factor))
        };
        sum(&self.terms) + s * sum(&self.rates)
    }
}

/// The charges of a network without their slopes.
fn charges(network: &Network, x: &[f64]) -> Vec<Charge> {
    let system = network.system;
    let mut values = vec![0.0; system.charges()];
    network.charges(x, &mut values);
    let one = |(k, device): (usize, &DeviceId)| {
        let into = system.rates.row(k).map(|(row, sign)| (row as u32, sign)).collect();
        Charge { device: *device, value: values[k], into, slopes: vec![] }
    };
    system.charge_devices.iter().enumerate().map(one).collect()
}

/// The matrix of a linear circuit at any s, its pattern found once.
pub struct Pencil {
    pattern: Pattern,
    /// Slots and values of G, of C, and of each delay with its time.
    fixed: Vec<(u32, f64)>,
    storage: Vec<(u32, f64)>,
    delays: Vec<(f64, Vec<(u32, f64)>)>,
    values: Vec<Complex>,
    factors: Option<Lu<Complex>>,
    work: Vec<Complex>,
}

impl Pencil {
    /// The pencil of a linear circuit; `transposed` swaps rows and columns.
    pub fn new(linear: &Linear, transposed: bool) -> Pencil {
        let mut places = vec![];
        let mut ask = |list: &[(u32, u32, f64)]| -> Vec<(u32, f64)> {
            let place = |(row, column, value): &(u32, u32, f64)| {
                places.push(if transposed { (*column, *row) } else { (*row, *column) });
                (places.len() as u32 - 1, *value)
            };
            list.iter().map(place).collect()
        };
        let mut fixed = ask(&linear.conductances);
        let mut storage = ask(&linear.storages);
        let mut delays: Vec<(f64, Vec<(u32, f64)>)> =
            linear.delays.iter().map(|delay| (delay.by, ask(&delay.entries))).collect();
        let (pattern, slots) = Pattern::from_triplets(linear.len(), &places);
        let lists = [&mut fixed, &mut storage].into_iter();
        for list in lists.chain(delays.iter_mut().map(|(_, list)| list)) {
            list.iter_mut().for_each(|(slot, _)| *slot = slots[*slot as usize]);
        }
        let values = vec![Complex::ZERO; pattern.len()];
        let work = vec![Complex::ZERO; linear.len()];
        Pencil { pattern, fixed, storage, delays, values, factors: None, work }
    }

    /// Fills and factorises the matrix at s.
    pub fn factorise(&mut self, s: Complex, statistics: &mut Statistics) -> Result<(), Singular> {
        self.values.fill(Complex::ZERO);
        let values = &mut self.values;
        let mut add = |slot: u32, value: Complex| {
            values[slot as usize] = values[slot as usize] + value;
        };
        for (slot, value) in &self.fixed {
            add(*slot, Complex::from(*value));
        }
        for (slot, value) in &self.storage {
            add(*slot, s.scaled(*value));
        }
        for (by, entries) in &self.delays {
            let (sine, cosine) = libm::sincos(-s.im * by);
            let size = libm::exp(-s.re * by);
            let turn = Complex::new(size * cosine, size * sine);
            for (slot, value) in entries {
                add(*slot, -turn.scaled(*value));
            }
        }
        if let Some(lu) = &mut self.factors {
            statistics.refactorisations += 1;
            if lu.refactor(&self.values).is_ok() {
                return Ok(());
            }
        }
        statistics.factorisations += 1;
        self.factors = None;
        self.factors = Some(Lu::factor(&self.pattern, &self.values)?);
        Ok(())
    }

    /// Solves with the last factors in place, with one step of refinement.
    pub fn solve(&mut self, b: &mut [Complex], statistics: &mut Statistics) {
        let Some(lu) = &self.factors else { return };
        let right = b.to_vec();
        lu.solve(b, &mut self.work);
        let mut residual = right.clone();
        crate::linear::backward_error(&self.pattern, &self.values, &right, b, &mut residual);
        lu.solve(&mut residual, &mut self.work);
        for (x, dx) in b.iter_mut().zip(&residual) {
            *x = *x + *dx;
        }
        statistics.solves += 2;
    }
}

/// A network and its state at the operating point, which is sought only where it matters.
pub(super) fn rest(system: &System, sought: bool) -> Result<(Network<'_>, op::State), Failure> {
    let mut network = Network::new(system, 0.0, 0.0);
    step::set_to_dc(&mut network);
    network.start_modes(0.0);
    let mut state = op::initial_values(&mut network, 0.0);
    if sought {
        let floors = op::floors(&network);
        let mut work = Work::new(system.equations(), system.charges());
        past::at_rest(&mut network, &mut state, |network, state| {
            op::operating_point(network, state, &floors, &mut vec![], &mut work.scratch)
        })
        .map_err(|trouble| {
            failure(system, Moment::OperatingPoint, 0.0, &trouble, &network.statistics)
        })?;
    }
    Ok((network, state))
}

/// Why a linear circuit cannot be solved at a frequency.
pub(super) fn singular(
    system: &System,
    singular: &Singular,
    place: &str,
    statistics: &Statistics,
) -> Failure {
    let mut found = explain::undetermined(system, singular);
    let mut diagnostic = match found.is_empty() {
        true => Diagnostic::error("E0805", Span::NONE, "the matrix is singular"),
        false => found.swap_remove(0),
    };
    diagnostic.code = "E0805";
    diagnostic.notes.push(place.to_string());
    Failure::new(FailureKind::NotSolved, diagnostic, statistics)
}

fn sampled(system: &System, device: DeviceId, statistics: &Statistics) -> Failure {
    let name = system.spoken_device(device);
    let message = format!("`{name}` holds samples of instants, which no linear circuit does");
    let diagnostic = Diagnostic::error("E0811", system.device_span(device), message)
        .help("run it over time, or take the sampling out");
    Failure::new(FailureKind::NotSolved, diagnostic, statistics)
}
