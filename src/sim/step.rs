//! A transient run: steps of controlled error from corner to corner, restarts, events, rows.

mod crossing;

use self::crossing::{Located, Search};
use super::events::Controls;
use super::explain::{Failure, FailureKind, Moment, failure};
use super::methods::{self, Method, Work};
use super::network::Network;
use super::newton::{Cut, Stage, solve_stage};
use super::op::{self, State, Trouble};
use super::output::{Rows, Stopped};
use super::settings::{Settings, Tolerance};
use super::statistics::Statistics;
use super::system::System;
use crate::circuit::Waveform;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::Sink;
use std::io;
use std::sync::atomic::Ordering;

/// Values of an operating point.
#[derive(Clone, Debug)]
pub struct OperatingPoint {
    /// Values of the system's output columns.
    pub outputs: Vec<f64>,
    /// Values of all unknowns.
    pub unknowns: Vec<f64>,
    /// What it took.
    pub statistics: Statistics,
}

/// Finds the operating point at t = 0.
///
/// # Errors
/// When there is none, or it was not found.
pub fn operating_point(system: &System) -> Result<OperatingPoint, Failure> {
    let mut network = Network::new(system, 0.0);
    count_system(&mut network, "newton", "operating point");
    let floors = op::floors(&network);
    let mut work = Work::new(system.equations(), system.charges());
    start_modes(&mut network);
    let mut state = op::initial_values(&mut network, 0.0);
    op::operating_point(&mut network, &mut state, &floors, &mut work.scratch).map_err(
        |trouble| failure(system, Moment::OperatingPoint, 0.0, &trouble, &network.statistics),
    )?;
    let mut outputs = vec![0.0; system.outputs.len()];
    network.outputs(&state.x, &state.w, 0.0, &mut outputs);
    Ok(OperatingPoint { outputs, unknowns: state.x, statistics: network.statistics })
}

/// Runs from 0 to `settings.stop` and gives rows to `sink`: time, then the system's output columns.
///
/// # Errors
/// When a step becomes too small, a solution is not found, the run is interrupted or a row cannot be written. The rows
/// given until then are good.
pub fn transient(
    system: &System,
    settings: &Settings,
    sink: &mut dyn Sink,
) -> Result<Statistics, Failure> {
    const PILOT: f64 = 1e-2;
    let needs_pilot = settings.tolerance == Tolerance::Scaled && settings.reltol < PILOT;
    let mut pilot = None;
    if needs_pilot {
        let coarse = Settings { reltol: PILOT, hmax: None, h0: None, ..settings.clone() };
        let mut run = Run::new(system, &coarse, None, None);
        match run.run() {
            Ok(()) => pilot = Some((run.largest, run.network.statistics)),
            Err(failure) if failure.kind == FailureKind::Interrupted => return Err(failure),
            // The real run will say what is wrong, if anything is.
            Err(_) => {}
        }
    }
    let magnitudes = pilot.as_ref().map(|(largest, _)| largest.as_slice());
    let mut run = Run::new(system, settings, magnitudes, Some(sink));
    if let Some((_, statistics)) = &pilot {
        run.network.statistics.add_work(statistics);
        run.network.statistics.pilot = statistics.accepted;
    }
    run.run()?;
    Ok(run.network.statistics)
}

fn count_system(network: &mut Network, method: &str, reason: &str) {
    let system = network.system;
    let statistics = &mut network.statistics;
    statistics.method = method.into();
    statistics.reason = reason.into();
    statistics.equations = system.equations();
    statistics.charges = system.charges();
    statistics.entries = system.dynamic.pattern.len();
}

/// Modes as cards state them; the rest follow from their controls.
fn start_modes(network: &mut Network) {
    for (mode, data) in network.modes.iter_mut().zip(&network.system.modes) {
        *mode = if data.initial == Some(true) { 1.0 } else { 0.0 };
    }
}

/// The part of the tolerance that each step gets where the circuit is of index 2.
const INDEX_2_PART: f64 = 0.05;

/// A pilot pass ends after so many steps: what magnitudes it has seen until then will do.
const PILOT_STEPS: u64 = 1000;

/// Where the first step after a corner would have to be less than this part of the way to the next one, what happens
/// in it counts as a jump.
const LAYER: f64 = 1e-9;

/// No step is longer than this part of a source's period. Where the circuit is of index 2, currents are rates of what
/// the sources prescribe, and no error test sees them.
const SIGHT: f64 = 0.25;
const INDEX_2_SIGHT: f64 = 0.02;

/// The highest frequency that a source swings with after a moment; 0 where it does not.
fn swings(waveform: &Waveform, t: f64) -> f64 {
    let frequency = match waveform {
        Waveform::Sine { amplitude, frequency, delay, .. } if *amplitude != 0.0 && t >= *delay => {
            frequency.abs()
        }
        Waveform::Sffm { amplitude, carrier, index, signal, .. } if *amplitude != 0.0 => {
            carrier.abs() + (index * signal).abs()
        }
        _ => 0.0,
    };
    if frequency.is_finite() { frequency } else { 0.0 }
}

struct Run<'a> {
    network: Network<'a>,
    settings: &'a Settings,
    rows: Option<Rows<'a>>,
    method: Method,
    /// a_i, m_i and a_i + reltol·m_i (infinite where an unknown is not tested).
    absolute: Vec<f64>,
    largest: Vec<f64>,
    weights: Vec<f64>,
    /// Unknowns of index 2.
    untested: Vec<bool>,
    index2: bool,
    floors: Vec<f64>,
    state: State,
    next: State,
    work: Work,
    controls: Controls,
    /// The longest step that sources let nothing be jumped over in.
    sight: f64,
    /// The step to try next, the smallest that time can resolve.
    h: f64,
    smallest: f64,
    /// Error and size of the last accepted step.
    last: Option<(f64, f64)>,
    /// Whether no step has been accepted since the last restart, and whether its fast layer has been passed over.
    fresh: bool,
    smoothed: bool,
    /// Events since a moment, to see when they pile up.
    crowd: (f64, u32),
}

impl<'a> Run<'a> {
    fn new(
        system: &'a System,
        settings: &'a Settings,
        magnitudes: Option<&[f64]>,
        sink: Option<&'a mut dyn Sink>,
    ) -> Run<'a> {
        let network = Network::new(system, 0.0);
        let (n, charges) = (system.equations(), system.charges());
        let rows = sink.map(|sink| Rows::new(&network, settings, sink));
        // Below the rounding of the largest voltage or current an unknown that is really 0 is noise.
        let noise = |voltage: bool| {
            let of_kind = system.unknowns.iter().zip(magnitudes.unwrap_or(&[]));
            let of_kind = of_kind.filter(|(unknown, _)| unknown.voltage == voltage);
            64.0 * f64::EPSILON * of_kind.fold(0.0f64, |most, (_, size)| most.max(*size))
        };
        let noises = [noise(false), noise(true)];
        let absolute = system.unknowns.iter().enumerate().map(|(k, unknown)| {
            let literal = if unknown.voltage { settings.vntol } else { settings.abstol };
            match (settings.tolerance, unknown.nominal, magnitudes.map(|m| m[k])) {
                // A domain's nominal value is a guess: tanks know no pressures of megapascals.
                (Tolerance::Scaled, Some(nominal), size) if nominal > 0.0 => {
                    settings.reltol * size.unwrap_or(0.0).clamp(1e-2 * nominal, nominal)
                }
                (Tolerance::Scaled, _, Some(size)) if size > 0.0 => {
                    let noise = noises[usize::from(unknown.voltage)].min(literal);
                    literal.min(1e-3 * settings.reltol * size).max(noise)
                }
                _ => literal,
            }
        });
        Run {
            rows,
            method: settings.method,
            absolute: absolute.collect(),
            largest: vec![0.0; n],
            weights: vec![0.0; n],
            untested: vec![false; n],
            index2: false,
            floors: op::floors(&network),
            state: State::new(0.0, n, charges),
            next: State::new(0.0, n, charges),
            work: Work::new(n, charges),
            controls: Controls::new(system.modes.len()),
            sight: f64::INFINITY,
            h: settings.stop,
            smallest: 8.0 * f64::EPSILON * settings.stop,
            last: None,
            fresh: true,
            smoothed: false,
            crowd: (0.0, 0),
            network,
            settings,
        }
    }

    fn run(&mut self) -> Result<(), Failure> {
        self.start()?;
        while self.state.t < self.settings.stop - self.smallest {
            if self.rows.is_none() && self.network.statistics.accepted >= PILOT_STEPS {
                return Ok(());
            }
            self.check_interrupt()?;
            let (corner, event) = self.advance()?;
            if let Some(mode) = event {
                self.pass_event(mode)?;
            }
            if corner && self.state.t < self.settings.stop - self.smallest {
                self.pass_corner()?;
            }
            self.rows_at_state()?;
        }
        Ok(())
    }

    fn start(&mut self) -> Result<(), Failure> {
        let network = &mut self.network;
        start_modes(network);
        self.state = op::initial_values(network, 0.0);
        if !self.settings.uic {
            let scratch = &mut self.work.scratch;
            op::operating_point(network, &mut self.state, &self.floors, scratch).map_err(
                |trouble| {
                    failure(
                        network.system,
                        Moment::OperatingPoint,
                        0.0,
                        &trouble,
                        &network.statistics,
                    )
                },
            )?;
        }
        self.restart(Moment::Start)?;
        let (method, reason) = methods::choose(&self.network, self.index2);
        let (method, reason) = match self.settings.method {
            Method::Auto => (method, reason),
            Method::Rodas4 | Method::Rodas5p if self.index2 => (method, reason),
            asked => (asked, "asked for"),
        };
        self.method = method;
        count_system(&mut self.network, method.name(), reason);
        let span = self.distance();
        self.h = self.settings.h0.unwrap_or(1e-3 * span).min(span);
        self.rows_first()?;
        self.rows_at_state()
    }

    /// Time to the next corner or the end.
    fn distance(&self) -> f64 {
        self.network.next_corner().min(self.settings.stop) - self.state.t
    }

    /// Consistent values for the charges of `state`.
    fn restart(&mut self, moment: Moment) -> Result<(), Failure> {
        self.work.before = None;
        self.work.linearised = false;
        self.last = None;
        self.fresh = true;
        self.smoothed = false;
        let network = &mut self.network;
        let (floors, scratch) = (&self.floors, &mut self.work.scratch);
        match op::consistent_values(network, &mut self.state, floors, scratch) {
            Ok(()) => {
                if self.index2 {
                    self.index2 = false;
                    self.untested.fill(false);
                }
            }
            Err(Trouble::Cut(Cut::Singular(singular))) => {
                let n = self.network.system.equations();
                self.index2 = true;
                self.untested.fill(false);
                for column in singular.columns.iter().flatten() {
                    if let Some(untested) =
                        self.untested.get_mut(*column as usize).filter(|_| (*column as usize) < n)
                    {
                        *untested = true;
                    }
                }
                if matches!(self.method, Method::Rodas4 | Method::Rodas5p) {
                    self.method = Method::TrBdf2;
                    self.network.statistics.method = Method::TrBdf2.name().into();
                    self.network.statistics.reason =
                        "the circuit is of index 2 after an event".into();
                }
                self.weigh();
                self.redistribute(moment)?;
            }
            Err(trouble) => {
                let time = self.state.t;
                return Err(failure(network.system, moment, time, &trouble, &network.statistics));
            }
        }
        self.weigh();
        self.look_ahead();
        let Run { network, state, controls, .. } = self;
        network.controls(&state.x, state.t, &mut controls.left);
        Ok(())
    }

    /// Sets the longest step by the periods of the sources that swing.
    fn look_ahead(&mut self) {
        let part = if self.index2 { INDEX_2_SIGHT } else { SIGHT };
        let sources = self.network.system.sources.iter();
        let fastest = sources.map(|source| swings(&source.waveform, self.state.t));
        self.sight = part / fastest.fold(0.0, f64::max);
    }

    /// Three short steps of the backward Euler method: the first lets charges jump to where loops of capacitors and
    /// sources want them, the others give the currents that flow from there on. The straight line through those two
    /// leads back to the moment itself, so that nothing starts late.
    fn redistribute(&mut self, moment: Moment) -> Result<(), Failure> {
        let full = 1e-6 * self.distance();
        let start = self.state.clone();
        let mut outcome = Err(Cut::NoConvergence { worst: 0 });
        for shrink in [1.0, 1e-2, 1e-4] {
            self.state.copy_from(&start);
            outcome = self.jump(full * shrink);
            if outcome.is_ok() {
                return Ok(());
            }
        }
        match outcome {
            Ok(()) => Ok(()),
            Err(cut) => {
                let network = &self.network;
                let trouble = Trouble::Cut(cut);
                Err(failure(network.system, moment, start.t, &trouble, &network.statistics))
            }
        }
    }

    fn jump(&mut self, h: f64) -> Result<(), Cut> {
        let start = self.state.t;
        self.euler(h)?;
        self.euler(h)?;
        let near = self.state.clone();
        self.euler(h)?;
        let back = |far: &mut [f64], near: &[f64]| {
            for (far, near) in far.iter_mut().zip(near) {
                *far = 3.0 * near - 2.0 * *far;
            }
        };
        back(&mut self.state.x, &near.x);
        back(&mut self.state.q, &near.q);
        back(&mut self.state.w, &near.w);
        self.state.t = start;
        Ok(())
    }

    fn euler(&mut self, h: f64) -> Result<(), Cut> {
        let Run { network, state, next, work, weights, .. } = self;
        let alpha = 1.0 / h;
        for (beta, q) in work.beta.iter_mut().zip(&state.q) {
            *beta = -alpha * q;
        }
        next.copy_from(state);
        next.t = state.t + h;
        network.remember_junctions(&state.x);
        let stage = Stage {
            t: next.t,
            alpha,
            beta: &work.beta,
            weights,
            tolerance: methods::trbdf2::ITERATION,
        };
        solve_stage(network, &stage, &mut next.x, &mut next.q, &mut work.scratch)?;
        for (k, w) in next.w.iter_mut().enumerate() {
            *w = alpha * next.q[k] + work.beta[k];
        }
        std::mem::swap(state, next);
        Ok(())
    }

    /// Takes the values of `state` into the weights.
    fn weigh(&mut self) {
        // A method of order 2 makes more of the errors of its steps: over a run they add up to reltol^(2/3).
        let part = if self.index2 { INDEX_2_PART } else { 1.0 };
        let reltol = self.settings.reltol;
        for (k, x) in self.state.x.iter().enumerate() {
            self.largest[k] = self.largest[k].max(x.abs());
            self.weights[k] = if self.untested[k] {
                f64::INFINITY
            } else {
                (part * (reltol * self.largest[k] + self.absolute[k])).max(f64::MIN_POSITIVE)
            };
        }
    }

    /// One accepted step. Says whether it ended on a corner, and on which mode's threshold.
    fn advance(&mut self) -> Result<(bool, Option<usize>), Failure> {
        let corner = self.network.next_corner().min(self.settings.stop);
        let remaining = corner - self.state.t;
        let mut power = self.method.error_power();
        let limit = self.settings.hmax.unwrap_or(f64::INFINITY).min(self.sight);
        let planned = self.h.min(limit);
        let mut h = planned;
        let mut bounded = false;
        let mut search = Search::default();
        let mut failed = false;
        loop {
            // Land on the corner; two equal steps where one would leave a sliver.
            let lands = !bounded && h >= remaining * (1.0 - 1e-6);
            if !bounded && !lands && h > 0.5 * remaining {
                h = 0.5 * remaining;
            }
            self.next.t = if lands { corner } else { self.state.t + h };
            h = self.next.t - self.state.t;
            let Run { network, state, next, weights, work, .. } = self;
            let outcome = methods::step(self.method, network, state, next, weights, work);
            let cut = match outcome {
                Ok(error) if error <= 1.0 => match self.locate(h, &mut search) {
                    Located::Nothing => {
                        self.accept(error, h, planned, lands, failed, power)?;
                        return Ok((lands, None));
                    }
                    Located::Here(mode) => {
                        self.accept(error, h, planned, true, failed, power)?;
                        return Ok((lands, Some(mode)));
                    }
                    Located::Redo(shorter) => {
                        self.network.statistics.rejected.event += 1;
                        h = shorter;
                        bounded = true;
                        continue;
                    }
                },
                Ok(error) => {
                    self.network.statistics.rejected.error += 1;
                    h *= (0.9 * libm::pow(error, -1.0 / power)).clamp(0.1, 0.9);
                    Cut::NoConvergence { worst: self.worst_error() }
                }
                Err(Cut::NonFinite { .. }) if self.slope_by_time_is_infinite() => {
                    self.method = Method::TrBdf2;
                    power = self.method.error_power();
                    let statistics = &mut self.network.statistics;
                    statistics.rejected.non_finite += 1;
                    statistics.method = self.method.name().into();
                    statistics.reason = "a slope by time is infinite".into();
                    continue;
                }
                Err(cut) => {
                    let rejected = &mut self.network.statistics.rejected;
                    match &cut {
                        Cut::NoConvergence { .. } => rejected.newton += 1,
                        Cut::Singular(_) => rejected.singular += 1,
                        Cut::NonFinite { .. } => rejected.non_finite += 1,
                    }
                    h *= 0.25;
                    cut
                }
            };
            failed = true;
            bounded = false;
            search = Search::default();
            if self.fresh && !self.smoothed && h < LAYER * remaining {
                // A layer this thin (a junction's capacitance behind its series resistance) is beyond resolving.
                self.smoothed = true;
                self.redistribute(Moment::Restart)?;
                self.weigh();
                self.work.linearised = false;
                h = 1e-6 * remaining;
                continue;
            }
            if h < self.smallest {
                let network = &self.network;
                let trouble = Trouble::Cut(cut);
                let statistics = &network.statistics;
                return Err(failure(
                    network.system,
                    Moment::Step,
                    self.state.t,
                    &trouble,
                    statistics,
                ));
            }
        }
    }

    /// Whether a Rosenbrock method stands where a law's derivative by time is infinite.
    fn slope_by_time_is_infinite(&self) -> bool {
        matches!(self.method, Method::Rodas4 | Method::Rodas5p)
            && self.work.slopes.iter().any(|slope| !slope.is_finite())
    }

    fn worst_error(&self) -> usize {
        let mut worst = (0.0, 0);
        for (k, (error, weight)) in self.work.error.iter().zip(&self.weights).enumerate() {
            let size = error.abs() / weight;
            if size > worst.0 || size.is_nan() {
                worst = (if size.is_nan() { f64::INFINITY } else { size }, k);
            }
        }
        worst.1
    }

    /// Keeps a step: rows inside it, the next step's size, the weights.
    fn accept(
        &mut self,
        error: f64,
        h: f64,
        planned: f64,
        clipped: bool,
        failed: bool,
        power: f64,
    ) -> Result<(), Failure> {
        self.network.statistics.accepted += 1;
        self.fresh = false;
        let most = match self.method {
            Method::Gear2 => 2.0,
            _ => 6.0,
        };
        let size = error.max(1e-12);
        let mut factor = 0.9 * libm::pow(size, -1.0 / power);
        if let Some((last_error, last_h)) = self.last {
            // Gustafsson's predictive controller: the error of the last step says how the solution changes.
            let trend = h / last_h * libm::pow(last_error / size, 1.0 / power);
            factor = factor.min(factor * trend.max(0.2)).max(0.2);
        }
        let factor = factor.clamp(0.2, if failed { 1.0 } else { most });
        self.last = Some((size.max(1e-2), h));
        // A step that was clipped says little against the size that had been planned.
        self.h = if clipped && !failed { planned.max(factor * h) } else { factor * h };
        if let Some(rows) = &mut self.rows {
            let Run { network, state, next, weights, work, index2, .. } = self;
            let outcome = if rows.follows_steps() {
                rows.pieces(network, state, next, *index2, weights, work)
            } else {
                rows.inside(network, state, next, *index2, weights, work)
            };
            outcome.map_err(|stopped| self.row_failure(stopped))?;
        }
        self.work.remember(&self.state);
        self.work.linearised = false;
        std::mem::swap(&mut self.state, &mut self.next);
        std::mem::swap(&mut self.controls.left, &mut self.controls.right);
        self.weigh();
        self.row_here()?;
        let report = self.rows.is_some() && self.network.statistics.accepted.is_multiple_of(64);
        if let Some(progress) = self.settings.progress.as_ref().filter(|_| report) {
            progress(self.state.t / self.settings.stop);
        }
        Ok(())
    }

    /// Moves sources to their next segments and finds the values after the corner.
    fn pass_corner(&mut self) -> Result<(), Failure> {
        self.network.statistics.corners += 1;
        self.network.pass_corner(self.state.t, self.smallest);
        let events = self.network.statistics.events;
        let before = self.rows.is_some().then(|| self.state.x.clone());
        self.restart(Moment::Restart)?;
        self.shorten();
        // A second row only where something jumped.
        let jumped = before.is_some_and(|before| {
            before
                .iter()
                .zip(&self.state.x)
                .zip(&self.weights)
                .any(|((a, b), weight)| (a - b).abs() > *weight)
        });
        if jumped || self.network.statistics.events != events { self.row_here() } else { Ok(()) }
    }

    /// A careful first step after a corner or event.
    fn shorten(&mut self) {
        let span = self.distance();
        self.h = (0.5 * self.h).min(0.1 * span).max(self.smallest);
    }

    fn check_interrupt(&self) -> Result<(), Failure> {
        let interrupted =
            self.settings.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed));
        if !interrupted {
            return Ok(());
        }
        let message = format!("interrupted at t = {:.6e} s", self.state.t);
        Err(Failure {
            kind: FailureKind::Interrupted,
            diagnostic: Box::new(Diagnostic::error("E0808", Span::NONE, message)),
            time: self.state.t,
            statistics: Box::new(self.network.statistics.clone()),
        })
    }

    fn row_failure(&self, stopped: Stopped) -> Failure {
        match stopped {
            Stopped::Write(error) => self.write_failure(&error),
            Stopped::Values(time, cut) => {
                let network = &self.network;
                let trouble = Trouble::Cut(cut);
                failure(network.system, Moment::Row, time, &trouble, &network.statistics)
            }
        }
    }

    fn write_failure(&self, error: &io::Error) -> Failure {
        let message = format!("a row cannot be written: {error}");
        Failure {
            kind: FailureKind::Output,
            diagnostic: Box::new(Diagnostic::error("E0905", Span::NONE, message)),
            time: self.state.t,
            statistics: Box::new(self.network.statistics.clone()),
        }
    }

    /// The first row of a run that follows steps.
    fn rows_first(&mut self) -> Result<(), Failure> {
        self.row_here_at(0.0)
    }

    /// A row at the present state, in a run that follows steps.
    fn row_here(&mut self) -> Result<(), Failure> {
        self.row_here_at(self.state.t)
    }

    fn row_here_at(&mut self, time: f64) -> Result<(), Failure> {
        let Run { network, state, weights, work, index2, rows, .. } = self;
        let Some(rows) = rows.as_mut().filter(|rows| rows.follows_steps()) else { return Ok(()) };
        let outcome = rows.here(network, state, time, *index2, weights, work);
        outcome.map_err(|stopped| self.row_failure(stopped))
    }

    /// The rows of a grid or list that are due now.
    fn rows_at_state(&mut self) -> Result<(), Failure> {
        let Run { network, state, weights, work, index2, rows, .. } = self;
        let Some(rows) = rows.as_mut() else { return Ok(()) };
        let outcome = rows.at(network, state, state.t, *index2, weights, work);
        outcome.map_err(|stopped| self.row_failure(stopped))
    }
}
