//! Sensitivities over time: the slopes of charges and unknowns along a run, forwards and backwards.
//!
//! ```text
//! z = C·s + ∂Q/∂p      A·dz/dt + G·s + ∂R/∂p = 0      s = dx/dp, G = ∂R/∂x, C = ∂Q/∂x along the run
//! a step:   u₁ = α·(z₁ − z₀) − β·u₀                    trapezoidal α = 2/h, β = 1; after a jump α = 1/h, β = 0
//! a jump:   z goes through; [G A; C 0]·[s; u] = [−∂R/∂p; z − ∂Q/∂p]
//! ```
//!
//! The grid is that of the run's own rows, between which all is straight within its tolerance. The adjoint is that of
//! these very steps, taken from each row back to the start, so that both ways agree but for rounding.

use super::analyses::Job;
use super::explain::{Failure, FailureKind};
use super::linearise;
use super::network::{Network, Triplets};
use super::op;
use super::sensitivity::{Moved, send, system};
use super::settings::{Interval, Settings};
use super::statistics::Statistics;
use super::step;
use super::system::{Guard, ModeData, System};
use crate::circuit::{Expr, Leaf, NodeId, Output, Sensitivity};
use crate::diagnostic::Diagnostic;
use crate::linear::{Lu, Pattern};
use crate::source::Span;
use crate::trace::{Sink, Trace};

/// Rows that the adjoint is taken over, at most: each goes back to the start.
const MOST_ROWS: usize = 5000;

/// Times that differ by this part are the same.
const SAME: f64 = 1e-9;

/// Runs the circuit, then the slopes along it.
pub(super) fn run(
    job: &Job,
    wanted: &Sensitivity,
    sink: &mut dyn Sink,
) -> Result<Statistics, Failure> {
    let plain = system(job, &[], &wanted.outputs)?;
    let moved = Moved::all(job, wanted, &wanted.outputs, &[], &plain)?;
    for system in moved.iter().flat_map(|moved| moved.systems.iter().flatten()).chain([&plain]) {
        check(system)?;
    }
    let held = job.circuit.initial_holds && plain.initial_charges.iter().any(Option::is_some);
    if !wanted.starts_from_charges() && (held || !plain.initial.is_empty()) {
        let message = "an operating point with held voltages has no slopes here".to_string();
        return Err(refuse(
            message,
            "start from stated values with `uic`, or take `.ic` and `ic=` out",
        ));
    }
    let (rows, mut statistics) = course(job, &plain)?;
    // These are counted by the rows that are written.
    statistics.rows = 0;
    let mut along = Along::new(&plain, &moved, wanted);
    for (k, (time, x)) in rows.iter().enumerate() {
        let row = along.row(k, *time, x, &mut statistics)?;
        if *time >= job.settings.start * (1.0 - 1e-12) {
            send(job, sink, &row, &mut statistics)?;
        }
    }
    Ok(statistics)
}

fn refuse(message: String, help: &str) -> Failure {
    let error = Diagnostic::error("E0814", Span::NONE, message).help(help);
    Failure::new(FailureKind::NotSolved, error, &Statistics::default())
}

/// Refuses what has more than charges for a memory.
fn check(system: &System) -> Result<(), Failure> {
    let known =
        |unknown: &crate::circuit::stamps::Unknown| unknown.voltage || unknown.device.is_some();
    let switch = |mode: &&ModeData| matches!(mode.guard, Guard::Switch { .. });
    if let Some(mode) = system.modes.iter().find(switch) {
        let name = system.spoken_device(mode.device).to_string();
        let message = format!("`{name}` switches, which sensitivities over time do not follow");
        return Err(refuse(message, "take the slope by a difference of two runs (`.step`)"));
    }
    if !system.memories.is_empty() || !system.unknowns.iter().all(known) {
        let message = "sensitivities over time do not follow lines, delays and rates".to_string();
        return Err(refuse(message, "take the slope by a difference of two runs (`.step`)"));
    }
    Ok(())
}

/// A time, and the unknowns then.
type Row = (f64, Vec<f64>);

/// Times and unknowns of the rows of a run.
fn course(job: &Job, plain: &System) -> Result<(Vec<Row>, Statistics), Failure> {
    let read = |(k, unknown): (usize, &crate::circuit::stamps::Unknown)| {
        let leaf = match unknown.device {
            Some(device) if !unknown.voltage => Leaf::Current(device),
            _ => Leaf::Voltage(NodeId(k as u32 + 1), NodeId(0)),
        };
        Output { name: k.to_string(), expr: Expr::leaf(leaf) }
    };
    let outputs: Vec<Output> = plain.unknowns.iter().enumerate().map(read).collect();
    let names: Vec<String> =
        std::iter::once("time".into()).chain(outputs.iter().map(|o| o.name.clone())).collect();
    let bare = crate::circuit::Circuit { analyses: vec![], ..job.circuit.clone() };
    let circuit = crate::circuit::Circuit { outputs, watched: vec![], ..bare };
    let mut d = vec![];
    let stamps = crate::circuit::stamps::stamp(&circuit, &mut d);
    let system = stamps.and_then(|stamps| super::compile::compile(&stamps, &mut d));
    let Some(system) = system else {
        return Err(super::analyses::no_circuit(d, &Statistics::default()));
    };
    let mut trace = Trace::new(names, vec![]);
    // Slopes begin where the run does, whatever is written of it.
    let settings = Settings { start: 0.0, rows: Interval::Steps, ..job.settings.clone() };
    let statistics = step::transient(&system, &settings, &mut trace)?;
    let row = |k: usize| {
        let values = trace.columns.iter().skip(1).map(|column| column[k]).collect();
        (trace.columns[0][k], values)
    };
    Ok(((0..trace.rows()).map(row).collect(), statistics))
}

/// What a row's equations were.
struct Kept {
    lu: Lu<f64>,
    kind: Kind,
    /// Rows of C: (charge, unknown, slope).
    storage: Triplets,
    /// ∂R/∂p and ∂Q/∂p of each parameter.
    residual: Vec<Vec<f64>>,
    charge: Vec<Vec<f64>>,
}

#[derive(Clone, Copy)]
enum Kind {
    /// G·s = −∂R/∂p: an operating point.
    Rest,
    /// The frozen network: a start with stated charges, or a jump.
    Frozen { start: bool },
    /// A step: α and β.
    Step(f64, f64),
}

struct Along<'a> {
    plain: &'a System,
    wanted: &'a Sensitivity,
    moved: &'a [Moved],
    network: Network<'a>,
    /// The networks of each parameter in the order of its systems.
    networks: Vec<Vec<Network<'a>>>,
    /// Of each parameter: z and u.
    charges: Vec<Vec<f64>>,
    rates: Vec<Vec<f64>>,
    kept: Vec<Kept>,
    /// d(initial charge)/dp.
    stated: Vec<Vec<f64>>,
    before: f64,
    jumped: bool,
}

impl<'a> Along<'a> {
    fn new(plain: &'a System, moved: &'a [Moved], wanted: &'a Sensitivity) -> Along<'a> {
        let network = |system: &'a System| {
            let mut network = Network::new(system, 0.0, f64::INFINITY);
            network.start_modes(0.0);
            network
        };
        let all = |moved: &'a Moved| moved.systems.iter().flatten().map(network).collect();
        let zero = vec![vec![0.0; plain.charges()]; moved.len()];
        Along {
            plain,
            wanted,
            moved,
            network: network(plain),
            networks: moved.iter().map(all).collect(),
            charges: zero.clone(),
            rates: zero.clone(),
            kept: vec![],
            stated: zero,
            before: 0.0,
            jumped: true,
        }
    }

    /// The outputs and their slopes in a row.
    fn row(
        &mut self,
        k: usize,
        time: f64,
        x: &[f64],
        statistics: &mut Statistics,
    ) -> Result<Vec<f64>, Failure> {
        let (n, charges) = (x.len(), self.plain.charges());
        let again = k > 0 && time == self.before;
        // Within a step waveforms are those of its left end; of two rows of one time the second is after the corner.
        let corner = if again { time } else { self.before };
        if again && (self.network.next_corner() - time).abs() > SAME * time {
            let message =
                format!("something jumps at {time:e} s, when a voltage or a current says so");
            return Err(refuse(message, "slopes follow jumps of sources alone"));
        }
        let every = self.networks.iter_mut().flatten().chain([&mut self.network]);
        every.for_each(|network| network.pass_corner(corner, SAME * corner));
        self.network.linearise(x, time, false);
        let (fixed, _) = self.network.matrices();
        let storage = self.network.storage_slopes();
        let mut values = vec![0.0; self.wanted.outputs.len()];
        self.network.outputs(x, &vec![0.0; charges], time, &mut values);
        let readings = self.network.output_slopes(x);
        if readings.iter().any(|(_, rates)| !rates.is_empty()) {
            let message =
                "an output reads the current of a storage, which has no slope here".to_string();
            return Err(refuse(message, "read the current of a device in series with it"));
        }
        let (mut residual, mut charge, mut direct) = (vec![], vec![], vec![]);
        for (moved, networks) in self.moved.iter().zip(&mut self.networks) {
            let side = moved.slope(&mut |k, _| {
                let mut all = vec![0.0; n + charges + values.len()];
                let network = &mut networks[k];
                network.evaluate(x, time);
                network.residual(x, time, &mut all[..n]);
                network.charges(x, &mut all[n..n + charges]);
                network.outputs(x, &vec![0.0; charges], time, &mut all[n + charges..]);
                Ok(all)
            })?;
            residual.push(side[..n].to_vec());
            charge.push(side[n..n + charges].to_vec());
            direct.push(side[n + charges..].to_vec());
        }
        let kind = match k {
            0 => self.start(&fixed)?,
            _ if again => Kind::Frozen { start: false },
            _ if self.jumped => Kind::Step(1.0 / (time - self.before), 0.0),
            _ => Kind::Step(2.0 / (time - self.before), 1.0),
        };
        let lu = self.factor(kind, &fixed, &storage, statistics)?;
        self.kept.push(Kept { lu, kind, storage, residual, charge });
        self.before = time;
        self.jumped = k == 0 || again;
        let mut row = vec![time];
        row.extend(&values);
        let slopes = self.slopes(&readings, &direct, statistics)?;
        for slope in slopes.iter().flatten() {
            row.extend(self.wanted.gradients.picked(slope[0], slope[1]));
        }
        Ok(row)
    }

    /// How the run began: at rest, or with stated charges.
    fn start(&mut self, fixed: &Triplets) -> Result<Kind, Failure> {
        let stated = self.wanted.starts_from_charges();
        let alone = self.matrix(fixed, &vec![], 0.0);
        if !stated && Lu::factor(&alone.0, &alone.1).is_ok() {
            return Ok(Kind::Rest);
        }
        for (moved, (stated, networks)) in
            self.moved.iter().zip(self.stated.iter_mut().zip(&mut self.networks))
        {
            *stated = moved.slope(&mut |k, _| Ok(op::initial_values(&mut networks[k], 0.0).q))?;
        }
        Ok(Kind::Frozen { start: true })
    }

    /// G + α·A·C.
    fn matrix(&self, fixed: &Triplets, storage: &Triplets, alpha: f64) -> (Pattern, Vec<f64>) {
        let mut all = fixed.clone();
        for (charge, unknown, slope) in storage {
            let rows = self.plain.rates.row(*charge as usize);
            all.extend(rows.map(|(row, sign)| (row as u32, *unknown, alpha * sign * slope)));
        }
        gathered(self.plain.equations(), &all)
    }

    fn factor(
        &self,
        kind: Kind,
        fixed: &Triplets,
        storage: &Triplets,
        statistics: &mut Statistics,
    ) -> Result<Lu<f64>, Failure> {
        let (pattern, values) = match kind {
            Kind::Rest => self.matrix(fixed, &vec![], 0.0),
            Kind::Step(alpha, _) => self.matrix(fixed, storage, alpha),
            Kind::Frozen { .. } => {
                let n = self.plain.equations() as u32;
                let mut all = fixed.clone();
                let rates = self.plain.rates.triplets();
                all.extend(rates.map(|(k, row, sign)| (row as u32, n + k as u32, sign)));
                all.extend(storage.iter().map(|(k, unknown, slope)| (n + k, *unknown, *slope)));
                gathered(self.plain.equations() + self.plain.charges(), &all)
            }
        };
        statistics.factorisations += 1;
        Lu::factor(&pattern, &values).map_err(|singular| match kind {
            Kind::Frozen { .. } => refuse(
                "loops of capacitors and sources, or cutsets of inductors, start or jump here"
                    .into(),
                "a small resistor in the loop, or a rise above 0, gives their slopes a meaning",
            ),
            _ => linearise::singular(self.plain, &singular, "in a step", statistics),
        })
    }

    /// Moves z and u of every parameter on by the last row, and gives the slopes of the outputs both ways.
    #[allow(clippy::type_complexity)]
    fn slopes(
        &mut self,
        readings: &[(Vec<(u32, f64)>, Vec<(u32, f64)>)],
        direct: &[Vec<f64>],
        statistics: &mut Statistics,
    ) -> Result<Vec<Vec<[f64; 2]>>, Failure> {
        let mut slopes = vec![vec![[0.0; 2]; self.moved.len()]; readings.len()];
        if self.wanted.gradients.direct() {
            for p in 0..self.moved.len() {
                let s = self.forward(p);
                statistics.solves += 1;
                for (o, (terms, _)) in readings.iter().enumerate() {
                    let sum: f64 = terms.iter().map(|(k, factor)| factor * s[*k as usize]).sum();
                    slopes[o][p][0] = direct[p][o] + sum;
                }
            }
        }
        if self.wanted.gradients.adjoint() {
            if self.kept.len() > MOST_ROWS {
                let message = format!("more than {MOST_ROWS} rows for an adjoint over time");
                return Err(refuse(message, "`.options sensitivity direct=1 adjoint=0`"));
            }
            for (o, (terms, _)) in readings.iter().enumerate() {
                let found = self.backward(terms);
                statistics.solves += self.kept.len() as u64;
                for (p, slope) in found.iter().enumerate() {
                    slopes[o][p][1] = direct[p][o] + slope;
                }
            }
        }
        Ok(slopes)
    }

    /// s of a parameter in the last row.
    fn forward(&mut self, p: usize) -> Vec<f64> {
        let n = self.plain.equations();
        let Some(kept) = self.kept.last() else { return vec![0.0; n] };
        let (z, u) = (&mut self.charges[p], &mut self.rates[p]);
        let (residual, charge) = (&kept.residual[p], &kept.charge[p]);
        let mut b: Vec<f64> = residual.iter().map(|r| -r).collect();
        match kept.kind {
            Kind::Rest => {}
            Kind::Frozen { start } => {
                if start {
                    z.copy_from_slice(&self.stated[p]);
                }
                b.extend(z.iter().zip(charge).map(|(z, q)| z - q));
            }
            Kind::Step(alpha, beta) => {
                let known: Vec<f64> =
                    (0..z.len()).map(|k| alpha * (z[k] - charge[k]) + beta * u[k]).collect();
                self.plain.rates.add_transposed(1.0, &known, &mut b);
            }
        }
        let mut work = b.clone();
        kept.lu.solve(&mut b, &mut work);
        if let Kind::Frozen { .. } = kept.kind {
            u.copy_from_slice(&b[n..]);
            b.truncate(n);
            return b;
        }
        let mut now = charge.clone();
        for (k, unknown, slope) in &kept.storage {
            now[*k as usize] += slope * b[*unknown as usize];
        }
        for ((u, z), now) in u.iter_mut().zip(z.iter()).zip(&now) {
            *u = match kept.kind {
                Kind::Step(alpha, beta) => alpha * (now - z) - beta * *u,
                _ => 0.0,
            };
        }
        z.copy_from_slice(&now);
        b
    }

    /// The slopes of a linear reading of the last row by every parameter, back to the start.
    fn backward(&self, terms: &[(u32, f64)]) -> Vec<f64> {
        let (n, charges) = (self.plain.equations(), self.plain.charges());
        let mut slopes = vec![0.0; self.moved.len()];
        let (mut on_z, mut on_u) = (vec![0.0; charges], vec![0.0; charges]);
        for (back, kept) in self.kept.iter().rev().enumerate() {
            let mut b = vec![0.0; n];
            if back == 0 {
                terms.iter().for_each(|(k, factor)| b[*k as usize] += factor);
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            if let Kind::Frozen { start } = kept.kind {
                b.extend(&on_u);
                let mut work = b.clone();
                kept.lu.solve_transposed(&mut b, &mut work);
                let (lambda, mu) = b.split_at(n);
                for (z, mu) in on_z.iter_mut().zip(mu) {
                    *z += mu;
                }
                on_u.fill(0.0);
                for (p, slope) in slopes.iter_mut().enumerate() {
                    *slope -= dot(lambda, &kept.residual[p]) + dot(mu, &kept.charge[p]);
                    *slope += if start { dot(&on_z, &self.stated[p]) } else { 0.0 };
                }
                continue;
            }
            let (alpha, beta) = match kept.kind {
                Kind::Step(alpha, beta) => (alpha, beta),
                _ => (0.0, 0.0),
            };
            let onward: Vec<f64> = on_z.iter().zip(&on_u).map(|(z, u)| z + alpha * u).collect();
            for (k, unknown, slope) in &kept.storage {
                b[*unknown as usize] += slope * onward[*k as usize];
            }
            let mut work = b.clone();
            kept.lu.solve_transposed(&mut b, &mut work);
            // Aᵀ·λ
            let mut by_rate = vec![0.0; charges];
            self.plain.rates.add_product(1.0, &b, &mut by_rate);
            for (p, slope) in slopes.iter_mut().enumerate() {
                *slope += dot(&onward, &kept.charge[p]);
                *slope -= dot(&b, &kept.residual[p]) + alpha * dot(&by_rate, &kept.charge[p]);
            }
            for k in 0..charges {
                on_z[k] = alpha * (by_rate[k] - on_u[k]);
                on_u[k] = beta * (by_rate[k] - on_u[k]);
            }
        }
        slopes
    }
}

fn gathered(n: usize, all: &Triplets) -> (Pattern, Vec<f64>) {
    let places: Vec<(u32, u32)> = all.iter().map(|(row, column, _)| (*row, *column)).collect();
    let (pattern, slots) = Pattern::from_triplets(n, &places);
    let mut values = vec![0.0; pattern.len()];
    for ((_, _, value), slot) in all.iter().zip(slots) {
        values[slot as usize] += value;
    }
    (pattern, values)
}
