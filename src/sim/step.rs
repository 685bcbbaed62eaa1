//! A transient run: steps of controlled error from corner to corner, restarts, events, rows.

mod bound;
mod crossing;
mod far;
mod first;
mod layer;
pub(super) mod past;
mod restart;
mod rounding;
mod rows;
mod size;
mod trouble;

use self::bound::Bound;
use self::crossing::{Crossed, Located, Search};
use self::far::Far;
use self::first::First;
use self::layer::Layer;
use self::rounding::Rounding;
use self::trouble::Cuts;
pub(crate) use self::trouble::{Reason, Stuck};
use super::abreast::{Company, Seat, alone};
use super::events::{Controls, Track};
use super::explain::{Failure, FailureKind, Moment, failure};
use super::inside::Inside;
use super::methods::{self, Method, Work, exponential};
use super::network::Network;
use super::newton::Cut;
use super::op::{self, State};
use super::output::Rows;
use super::settings::{Settings, Side, Tolerance};
use super::statistics::Statistics;
use super::system::System;
use crate::circuit::Waveform;
use crate::circuit::stamps::Unknown;
use crate::linear::Orders;
use crate::trace::Sink;

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
    let mut network = Network::new(system, 0.0, 0.0);
    set_to_dc(&mut network);
    count_system(&mut network, "newton", "operating point");
    let floors = op::floors(&network);
    let mut work = Work::new(system.equations(), system.charges());
    network.start_modes(0.0);
    let mut state = op::initial_values(&mut network, 0.0);
    let mut slides = vec![];
    past::at_rest(&mut network, &mut state, |network, state| {
        op::operating_point(network, state, &floors, &mut slides, &mut work.scratch)
    })
    .map_err(|trouble| {
        failure(system, Moment::OperatingPoint, 0.0, &trouble, &network.statistics)
    })?;
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
    alone(in_company(system, settings, sink, None))
}

/// The same beside other runs, where there is a place for it.
///
/// # Errors
/// Those of [`transient`].
pub(super) async fn in_company(
    system: &System,
    settings: &Settings,
    sink: &mut dyn Sink,
    seat: Option<Seat<'_>>,
) -> Result<Statistics, Failure> {
    let seated = seat.and_then(|seat| seat.take(system));
    // Exponentials take what is moved from what they find.
    let far = exponential::suits(system, settings);
    let pilot = if far { None } else { pilot(system, settings, seated.as_ref()).await? };
    let mut run = Run::new(system, settings, pilot.as_ref(), Some(sink));
    run.goes_far = far;
    run.run(seated.as_ref()).await?;
    Ok(run.network.statistics)
}

/// What a pilot pass has seen: magnitudes of unknowns, ranges of guards; and what it took.
struct Seen {
    largest: Vec<f64>,
    statistics: Statistics,
    tracks: Vec<Track>,
    orders: Orders,
}

/// A coarse run beforehand, where floors follow magnitudes.
async fn pilot(
    system: &System,
    settings: &Settings,
    company: Company<'_>,
) -> Result<Option<Seen>, Failure> {
    /// Magnitudes are factors of floors: a tenth is more than is asked of them. Steps of low order, and with few solutions,
    /// are the cheapest then.
    const PILOT: f64 = 1e-1;
    const COARSE: f64 = 1e-2;
    if settings.tolerance != Tolerance::Scaled || settings.reltol >= COARSE {
        return Ok(None);
    }
    let method = match (system.is_linear(), system.has_junctions()) {
        (true, _) => Method::Trapezoidal,
        (_, true) => Method::TrBdf2,
        _ => Method::Rodas3,
    };
    let coarse = Settings { method, reltol: PILOT, hmax: None, h0: None, ..settings.clone() };
    let mut run = Run::new(system, &coarse, None, None);
    run.enough = enough(system, settings);
    match run.run(company).await {
        Ok(()) => {
            let Network { statistics, tracks, orders, .. } = run.network;
            Ok(Some(Seen { largest: run.largest, statistics, tracks, orders }))
        }
        Err(failure) if failure.kind == FailureKind::Interrupted => Err(failure),
        // The real run will say what is wrong, if anything is.
        Err(_) => Ok(None),
    }
}

/// Goes on with what a pilot pass has found, and counts what it took.
fn take_seen(network: &mut Network, seen: &Seen) {
    network.tracks.iter_mut().zip(&seen.tracks).for_each(|(track, known)| track.learn(known));
    network.statistics.add_work(&seen.statistics);
    network.statistics.pilot = seen.statistics.accepted;
    network.orders = seen.orders.clone();
}

/// a_i of each unknown, with the magnitudes of a pilot pass where there was one.
fn absolute_tolerances(system: &System, settings: &Settings, seen: Option<&Seen>) -> Vec<f64> {
    let of = |(k, unknown): (usize, &Unknown)| {
        let literal = if unknown.voltage { settings.vntol } else { settings.abstol };
        match (settings.tolerance, unknown.nominal, seen.map(|seen| seen.largest[k])) {
            // A domain's nominal value is a guess: tanks know no pressures of megapascals.
            (Tolerance::Scaled, Some(nominal), size) if nominal > 0.0 => {
                settings.reltol * size.unwrap_or(0.0).clamp(1e-2 * nominal, nominal)
            }
            (Tolerance::Scaled, _, Some(size)) if size > 0.0 => {
                literal.min(SMALL_PART * settings.reltol * size)
            }
            _ => literal,
        }
    };
    system.unknowns.iter().enumerate().map(of).collect()
}

/// Magnitudes beyond which floors follow no longer.
fn enough(system: &System, settings: &Settings) -> Vec<f64> {
    let of = |unknown: &Unknown| {
        let literal = if unknown.voltage { settings.vntol } else { settings.abstol };
        let nominal = unknown.nominal.filter(|nominal| *nominal > 0.0);
        nominal.unwrap_or(literal / (SMALL_PART * settings.reltol))
    };
    system.unknowns.iter().map(of).collect()
}

/// Gives sources their DC values, where they have one beside what they are over time.
pub(super) fn set_to_dc(network: &mut Network) {
    let sources = network.system.sources.iter().enumerate();
    let stated = sources.filter_map(|(k, source)| Some((k, source.parts.dc?)));
    network.set_segments(stated.map(|(k, value)| (k, Waveform::Constant(value).segment(0.0))));
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

/// What an unknown is off where it is small is no more than this part of what it may be off at its largest.
const SMALL_PART: f64 = 1e-3;

/// A pilot pass ends after so many steps: what magnitudes it has seen until then will do.
const PILOT_STEPS: u64 = 1000;
/// and after so few where every unknown has come to this part of its magnitude that will do.
const FEW_PILOT_STEPS: u64 = 50;
const MOVED: f64 = 1e-9;

/// Where the first step after a corner would have to be less than this part of the way to the next one, what happens
/// in it counts as a jump.
const LAYER: f64 = 1e-9;

/// The error of a step that lost its way between its ends: less than half of it is tried next.
const LOST: f64 = 60.0;

/// Iterations may leave this part of a step's error, and of none less than this part of its tolerance.
const UNCONFIRMED: f64 = 0.05;
const NEGLIGIBLE: f64 = 2e-5;

fn stored(system: &System) -> Vec<u32> {
    let columns = system.charges.triplets().filter(|(.., value)| *value != 0.0);
    let mut stored: Vec<u32> = columns.map(|(_, column, _)| column as u32).collect();
    stored.sort_unstable();
    stored.dedup();
    stored
}

struct Run<'a> {
    network: Network<'a>,
    settings: &'a Settings,
    rows: Option<Rows<'a>>,
    /// Room for values within a step, for delays.
    inside: Inside,
    method: Method,
    /// Of a pilot pass the magnitudes that will do.
    enough: Vec<f64>,
    /// a_i, m_i and a_i + reltol·m_i (infinite where an unknown is not tested).
    absolute: Vec<f64>,
    largest: Vec<f64>,
    weights: Vec<f64>,
    rounding: Rounding,
    /// Unknowns of index 2.
    untested: Vec<bool>,
    /// Rates of index 2, and the largest of each so far.
    untested_rates: Vec<bool>,
    largest_rates: Vec<f64>,
    /// The largest that each charge has been at a corner or event.
    largest_charges: Vec<f64>,
    index2: bool,
    was_index2: bool,
    floors: Vec<f64>,
    /// Unknowns that linear charges are made of.
    stored: Vec<u32>,
    state: State,
    next: State,
    /// The unknowns on the left of a corner.
    before: Vec<f64>,
    work: Work,
    controls: Controls,
    /// Whether any mode follows from the solution; its guards within a step, and those that have crossed.
    watches: bool,
    samples: Vec<[f64; 5]>,
    crossed: Vec<Crossed>,
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
    /// What did after corners and events, and the layers there.
    first: First,
    layer: Layer,
    /// The end of the last step that failed.
    wall: f64,
    /// The method to come back to, and after how many steps; 0 where there is nothing to come back from.
    home: Method,
    detour: u32,
    /// Whether the step limit makes another method the cheaper one.
    bound: Bound,
    /// Events since a moment, to see when they pile up.
    crowd: (f64, u32),
    /// Whether it is to begin with exponentials, and what these have been like.
    goes_far: bool,
    far: Far,
}

impl<'a> Run<'a> {
    fn new(
        system: &'a System,
        settings: &'a Settings,
        seen: Option<&Seen>,
        sink: Option<&'a mut dyn Sink>,
    ) -> Run<'a> {
        let mut network = Network::new(system, 0.0, settings.stop);
        if let Some(seen) = seen {
            take_seen(&mut network, seen);
        }
        let (n, charges) = (system.equations(), system.charges());
        let rows = sink.map(|sink| Rows::new(&network, settings, sink));
        Run {
            inside: Inside::new(&network),
            rows,
            method: settings.method,
            enough: vec![],
            absolute: absolute_tolerances(system, settings, seen),
            largest: vec![0.0; n],
            weights: vec![0.0; n],
            rounding: Rounding::new(n),
            untested: vec![false; n],
            untested_rates: vec![false; charges],
            largest_rates: vec![0.0; charges],
            largest_charges: vec![0.0; charges],
            index2: false,
            was_index2: false,
            floors: op::floors(&network),
            stored: stored(system),
            state: State::new(0.0, n, charges),
            next: State::new(0.0, n, charges),
            before: vec![0.0; n],
            work: Work::new(n, charges),
            controls: Controls::new(system.modes.len()),
            watches: system.modes.iter().any(|mode| mode.clock.is_none()),
            samples: vec![[0.0; 5]; system.modes.len()],
            crossed: Vec::with_capacity(system.modes.len()),
            sight: f64::INFINITY,
            h: settings.stop,
            smallest: 8.0 * f64::EPSILON * settings.stop,
            last: None,
            fresh: true,
            smoothed: false,
            first: First::new(),
            layer: Layer::new(system),
            wall: 0.0,
            home: settings.method,
            detour: 0,
            bound: Bound::default(),
            crowd: (0.0, 0),
            goes_far: false,
            far: Far::default(),
            network,
            settings,
        }
    }

    async fn run(&mut self, company: Company<'_>) -> Result<(), Failure> {
        if let Some(seated) = company {
            seated.begin();
        }
        self.start()?;
        while self.state.t < self.settings.stop - self.smallest {
            if self.rows.is_none() && self.has_seen_enough() {
                return Ok(());
            }
            self.check_interrupt()?;
            let (corner, event) = self.advance(company).await?;
            if self.settings.jumps == Side::Before {
                self.rows_at_state()?;
            }
            if let Some(mode) = event {
                self.pass_event(mode)?;
            }
            if corner && self.state.t < self.settings.stop - self.smallest {
                self.pass_corner()?;
            }
            self.rows_at_state()?;
            self.pass_layer();
        }
        Ok(())
    }

    /// Whether a pilot pass may end: nothing that it is asked for changes any more, or it has been long.
    fn has_seen_enough(&self) -> bool {
        let all_of = |part: f64| {
            self.largest.iter().zip(&self.enough).all(|(most, enough)| *most >= part * enough)
        };
        match self.network.statistics.accepted {
            PILOT_STEPS.. => true,
            // The ranges of guards are asked for, too.
            _ if self.watches => false,
            // Where all have moved, floors that are too small cost less than a longer pass.
            FEW_PILOT_STEPS.. => all_of(MOVED),
            _ => all_of(1.0),
        }
    }

    /// Time to the next corner or the end.
    fn distance(&self) -> f64 {
        self.network.next_corner().min(self.settings.stop) - self.state.t
    }

    /// One accepted step. Says whether it ended on a corner, and on which mode's threshold.
    async fn advance(&mut self, company: Company<'_>) -> Result<(bool, Option<usize>), Failure> {
        let corner = self.network.next_corner().min(self.settings.stop);
        let mut remaining = corner - self.state.t;
        let mut power = self.method.error_power();
        let limit = self.settings.hmax.unwrap_or(f64::INFINITY).min(self.sight);
        let limit = limit.min(self.network.memories.longest_step());
        let planned = match self.far_step(remaining) {
            Some(far) => far,
            None => self.before_wall(self.h).min(limit),
        };
        let mut h = planned;
        let mut bounded = false;
        let mut search = Search::default();
        let (mut failed, mut let_go, mut detoured) = (false, false, false);
        let mut cuts = Cuts::default();
        loop {
            // Land on the corner; two equal steps where one would leave a sliver.
            let lands = !bounded && h >= remaining * (1.0 - 1e-6);
            if !bounded && !lands && h > 0.5 * remaining {
                h = 0.5 * remaining;
            }
            self.next.t = if lands { corner } else { self.state.t + h };
            h = self.next.t - self.state.t;
            let Run { network, state, next, weights, work, .. } = self;
            let step = methods::step(self.method, network, state, next, weights, work, company);
            let mut outcome = step.await;
            if matches!(outcome, Ok(error) if error <= 1.0) && self.loses_its_way() {
                self.work.linearised = false;
                outcome = Ok(LOST);
            }
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
                    Located::Now(mode) => {
                        self.network.statistics.rejected.event += 1;
                        self.h = h;
                        let Run { controls, .. } = self;
                        controls.right.copy_from_slice(&controls.left);
                        return Ok((false, Some(mode)));
                    }
                    Located::Redo(shorter) => {
                        self.network.statistics.rejected.event += 1;
                        h = shorter;
                        bounded = true;
                        continue;
                    }
                    Located::Again => {
                        self.network.statistics.rejected.event += 1;
                        continue;
                    }
                },
                Ok(_) if self.hold_jumps() => {
                    self.network.statistics.rejected.event += 1;
                    continue;
                }
                Ok(error) => {
                    self.network.statistics.rejected.error += 1;
                    cuts.note(h, Reason::Error(self.worst_error(), error));
                    self.see_rounding(error);
                    h = match self.method {
                        Method::Exponential => match self.cut_far(h) {
                            Some(shorter) => shorter,
                            None => return self.leave_exponentials().map(|()| (false, None)),
                        },
                        _ => h * size::after_error(error, power),
                    };
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
                Err(_) if self.method == Method::Exponential => {
                    return self.leave_exponentials().map(|()| (false, None));
                }
                Err(cut) => {
                    let rejected = &mut self.network.statistics.rejected;
                    let reason = match &cut {
                        Cut::Singular(_) => Reason::Singular,
                        Cut::NonFinite { .. } => Reason::NonFinite,
                        Cut::NoConvergence { worst } => Reason::Newton(*worst),
                        Cut::NotFound(_) => Reason::Newton(0),
                    };
                    match reason {
                        Reason::Singular => rejected.singular += 1,
                        Reason::NonFinite => rejected.non_finite += 1,
                        _ => rejected.newton += 1,
                    }
                    cuts.note(h, reason);
                    // A branch may have no values past its threshold.
                    if !let_go && self.watches && self.network.free_all() {
                        let_go = true;
                        self.work.linearised = false;
                        search = Search::default();
                        continue;
                    }
                    h *= 0.25;
                    cut
                }
            };
            failed = true;
            self.wall = self.next.t;
            self.leave_bound();
            bounded = false;
            search = Search::default();
            let hopeless = h < (LAYER * remaining).max(self.smallest);
            let singular = matches!(cut, Cut::Singular(_));
            if (hopeless || singular) && !detoured && self.take_detour() {
                detoured = true;
                power = self.method.error_power();
                h = planned;
                continue;
            }
            if self.fresh && !self.smoothed && h < LAYER * remaining {
                // A layer this thin (a junction's capacitance behind its series resistance) is beyond resolving.
                self.smoothed = true;
                match self.redistribute(Moment::Restart) {
                    Ok(()) => self.settle(LAYER * remaining),
                    Err(failure) => {
                        if !self.step_over(LAYER * remaining) {
                            return Err(failure);
                        }
                    }
                }
                remaining = corner - self.state.t;
                self.weigh();
                self.work.linearised = false;
                h = 1e-6 * remaining;
                continue;
            }
            if h < self.smallest {
                return Err(self.stuck(cut, cuts));
            }
        }
    }

    /// Whether a Rosenbrock method stands where a law's derivative by time is infinite.
    fn slope_by_time_is_infinite(&self) -> bool {
        self.method.is_rosenbrock() && self.work.slopes.iter().any(|slope| !slope.is_finite())
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
        self.see_rounding(error);
        self.end_detour();
        // Of index 2 currents are rates of what is solved for, and take all that iterations leave.
        let left = if self.index2 { 0.0 } else { UNCONFIRMED * error.max(NEGLIGIBLE) };
        self.work.unconfirmed = left;
        let factor = match self.method {
            Method::Exponential => {
                self.learn_far(h, failed);
                1.0
            }
            _ => self.factor(error, h, failed, power),
        };
        self.learn_first(factor * h, failed);
        // A step that was clipped says little against the size that had been planned.
        self.h = if clipped && !failed { planned.max(factor * h) } else { factor * h };
        if let Some(rows) = &mut self.rows {
            let Run { network, state, next, weights, work, index2, .. } = self;
            let mut outcome = Ok(());
            if rows.follows_within() {
                outcome = rows.pieces(network, state, next, *index2, weights, work);
            }
            if outcome.is_ok() && rows.has_times() {
                outcome = rows.inside(network, state, next, *index2, weights, work);
            }
            outcome.map_err(|stopped| self.row_failure(stopped))?;
        }
        self.remember()?;
        self.work.linearised = false;
        std::mem::swap(&mut self.state, &mut self.next);
        self.work.history.take(&mut self.next);
        if self.watches {
            self.network.see_guards(&self.controls.right);
            std::mem::swap(&mut self.controls.left, &mut self.controls.right);
        }
        self.network.memories.forget(self.state.t);
        self.weigh_step();
        self.row_here()?;
        self.suit_limit(error, h);
        let report = self.rows.is_some() && self.network.statistics.accepted.is_multiple_of(64);
        if let Some(progress) = self.settings.progress.as_ref().filter(|_| report) {
            progress(self.state.t / self.settings.stop);
        }
        Ok(())
    }
}
