//! The second route: the bond graph's own equations, integrated without any circuit.
//!
//! Only the graph, its expressions and the linear solver are shared with the first route; equations, numbering,
//! integrator, output and energy are its own. First a coarse pilot run finds the size of every unknown; then a run whose
//! steps are allowed the stated part of these sizes as error, for every unknown.

pub mod energy;
pub mod events;
pub mod flows;
mod memories;
pub mod radau;
mod rounding;

use crate::bond::causality::Causality;
use crate::bond::consistent;
use crate::bond::equations::compiled::{Compiled, Readings};
use crate::bond::equations::{Equations, Unknown};
use crate::bond::graph::BondGraph;
use crate::bond::initial;
use crate::bond::prepared::{self, Prepared};
use crate::diagnostic::Diagnostic;
use energy::{Energy, Meter};
use events::Conditions;
use flows::{Flow, Flows};
use memories::Memories;
use radau::{B, Radau, Statistics, Step, Stop, Verdict};
use rounding::Rounding;

/// How to run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The error allowed to a step, in parts of the largest value of each unknown.
    pub tolerance: f64,
    /// Attempted steps after which a run is given up.
    pub maximum_steps: usize,
    /// Whether the power and energy of every element are kept for every row.
    pub flows: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { tolerance: 1e-9, maximum_steps: 20_000_000, flows: false }
    }
}

/// What a run gives.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Headers, one for each column: `time`, then the observed items.
    pub names: Vec<String>,
    /// Their values at the times asked for, in the units of the observed items; at a jump those just after it.
    pub columns: Vec<Vec<f64>>,
    /// Of each column a magnitude that is still rounding of 0: a small part of what the terms that make it are.
    pub least: Vec<f64>,
    /// The balance of energy over the run.
    pub energy: Energy,
    /// What flows where at every row, where it was asked for.
    pub flows: Vec<Flow>,
    /// Of the second, fine run.
    pub statistics: Statistics,
    /// The corners within the run, seconds.
    pub corners: Vec<f64>,
    /// All unknowns of the equations at the end.
    pub end: Vec<f64>,
}

/// Integrates from 0 to the last of `times`, which ascend.
pub fn integrate(
    graph: &BondGraph,
    causality: &Causality,
    times: &[f64],
    settings: &Settings,
    d: &mut Vec<Diagnostic>,
) -> Option<Run> {
    // What the equations lack has been said when the initial values were found.
    let mut unheard = vec![];
    let mut said = |found: Vec<Diagnostic>| {
        d.extend(found.into_iter().filter(|f| f.severity == crate::diagnostic::Severity::Error));
    };
    let Some(mut prepared) = prepared::prepare(graph, causality, &mut unheard) else {
        said(unheard);
        return None;
    };
    let formulas: Vec<_> = graph
        .experiment
        .observe
        .iter()
        .map(|item| prepared.equations.lower(graph, &item.expr, None))
        .collect();
    let start = initial::start(graph, &mut prepared, &mut unheard);
    said(unheard);
    let start = start?;
    let factors: Vec<f64> = graph.experiment.observe.iter().map(|item| item.unit.1).collect();
    let mut readings = Readings::new(&prepared.equations, &formulas);
    let until = times.last().copied().unwrap_or(0.0);

    let mut run = Run {
        names: std::iter::once("time".to_string())
            .chain(graph.experiment.observe.iter().map(|item| item.name.clone()))
            .collect(),
        columns: vec![Vec::with_capacity(times.len()); formulas.len() + 1],
        corners: prepared.equations.corners(until),
        ..Run::default()
    };
    let mut meter = Meter::new(graph, &prepared.equations);
    let mut flows = match settings.flows {
        true => Flows::new(graph, &prepared.equations, &start),
        false => Flows::default(),
    };
    // Where each unknown stands does not change while the equations are at work.
    let places = prepared.equations.clone();
    let mut end = start.clone();
    let mut failed = None;
    let mut sizes = Sizes::new(graph, &prepared, &start);
    if until > 0.0 {
        let pilot = Settings { tolerance: 1e-4f64.max(settings.tolerance), ..*settings };
        let mut nothing = |_: &Event| {};
        let outcome =
            march(&mut prepared, &run.corners, &start, &mut sizes, &pilot, None, &mut nothing);
        match outcome {
            Err(failure) => failed = Some(failure),
            Ok((_, known)) => {
                let mut row = vec![0.0; start.len()];
                let mut next = 0;
                let mut observe = |event: &Event| match event {
                    Event::Step { step, from, to, ends, compiled } => {
                        for (stage, b) in step.stages.iter().zip(B) {
                            row.iter_mut()
                                .zip(step.start.iter().zip(stage))
                                .for_each(|(r, (y, z))| *r = y + z);
                            meter.add(b * step.h, &row);
                        }
                        let near = 1e-12 * until;
                        // At the end of a segment, and where a condition changes, the later values hold.
                        let stop = step.t + step.h - if *ends { near } else { 0.0 };
                        readings.follow(compiled);
                        while next < times.len()
                            && times[next] <= stop
                            && (times[next] < to - near || *to >= until)
                        {
                            step.at(times[next], &mut row);
                            if times[next] <= step.t {
                                row.copy_from_slice(step.start);
                            }
                            meter.check(&row);
                            flows.row(graph, &places, step, times[next], &row);
                            run.columns[0].push(times[next]);
                            let values = readings.read(times[next], 0.5 * (from + to), &row);
                            for ((column, value), factor) in
                                run.columns[1..].iter_mut().zip(values).zip(&factors)
                            {
                                column.push(value / factor);
                            }
                            next += 1;
                        }
                        flows.pass(step);
                    }
                    Event::Jump { from, to, equations } => meter.jump(graph, equations, from, to),
                    Event::End(y) => end.copy_from_slice(y),
                };
                match march(
                    &mut prepared,
                    &run.corners,
                    &start,
                    &mut sizes,
                    settings,
                    Some(&known),
                    &mut observe,
                ) {
                    Ok((statistics, _)) => run.statistics = statistics,
                    Err(failure) => failed = Some(failure),
                }
            }
        }
    }
    if let Some(failure) = failed {
        d.push(explain(graph, &prepared, &failure));
        return None;
    }
    run.least = vec![0.0; run.names.len()];
    let rounding = Rounding::new(graph, &prepared.equations, &sizes, until);
    for ((least, formula), factor) in run.least[1..].iter_mut().zip(&formulas).zip(&factors) {
        *least = rounding.least(formula) / factor.abs();
    }
    run.energy = energy::balance(graph, &prepared.equations, &meter, &start, &end);
    run.energy.junctions = meter.worst(graph);
    run.flows = flows.elements;
    run.end = end;
    Some(run)
}

/// What a run reports while it goes.
enum Event<'a> {
    /// An accepted step within the segment `from..to`.
    /// Whether it ends on an event, and the equations with their conditions held.
    Step { step: &'a Step<'a>, from: f64, to: f64, ends: bool, compiled: &'a Compiled },
    /// Efforts and flows were found anew, at a corner or where a condition changes.
    Jump { from: &'a [f64], to: &'a [f64], equations: &'a Equations },
    /// The values at the end.
    End(&'a [f64]),
}

/// Why a run failed.
enum Failure {
    Stop(Stop),
    Restart { t: f64, trouble: consistent::Trouble },
}

/// Runs through all segments.
fn march(
    prepared: &mut Prepared,
    corners: &[f64],
    start: &[f64],
    sizes: &mut Sizes,
    settings: &Settings,
    known: Option<&Conditions>,
    report: &mut dyn FnMut(&Event),
) -> Result<(Statistics, Conditions), Failure> {
    // What is known of the conditions comes from a pilot run.
    let pilot = known.is_none();
    let mut y = start.to_vec();
    let mut statistics = Statistics::default();
    let mut h = None;
    let first_end = corners.get(1).copied().unwrap_or(0.0);
    let until = corners.last().copied().unwrap_or(0.0);
    let mut conditions = Conditions::new(&mut prepared.compiled, until, 0.5 * first_end, &y);
    if let Some(known) = known {
        conditions.learn(known);
    }
    let memories = Memories::new(&prepared.equations, start, until);
    let mut corners = corners.to_vec();
    let mut next = 0;
    while let Some(&[from, to]) = corners.get(next..next + 2) {
        next += 1;
        let inside = 0.5 * (from + to);
        let Prepared { compiled, structure, equations } = &mut *prepared;
        if from > 0.0 || !conditions.is_empty() {
            let mut settle = |y: &mut [f64]| {
                conditions.settle(compiled, structure, from, [from, to], y)?;
                while memories.flip(&conditions) {
                    conditions.settle(compiled, structure, from, [from, to], y)?;
                }
                Ok(())
            };
            let before = y.clone();
            let settled = match from > 0.0 {
                true => equations.take(from, inside, memories.room, &mut y, &mut settle),
                false => settle(&mut y),
            };
            settled.map_err(|trouble| Failure::Restart { t: from, trouble })?;
            sizes.see(&y);
            report(&Event::Jump { from: &before, to: &y, equations });
        }
        let (mut t, mut turns) = (from, 0);
        while t < to {
            let weights = sizes.weights(settings.tolerance, pilot);
            conditions.see_noise(compiled, [t, inside], &y, &weights, settings.tolerance);
            let mut radau = Radau::new(compiled, weights);
            radau.growing = if pilot { settings.tolerance } else { 0.0 };
            if pilot {
                radau.mind_rounding(from, to, &y);
            }
            radau.longest = memories.longest;
            radau.maximum_steps = settings.maximum_steps.saturating_sub(statistics.accepted);
            let first = first_step(&mut radau, [t, from, to], &y, h);
            let mut reached = t;
            let was_loose = conditions.loose;
            let outcome = radau.segment([t, from, to], &mut y, first, &mut |compiled, step| {
                let verdict = conditions.judge(compiled, step, inside);
                if !matches!(verdict, Verdict::Again(_)) {
                    let ends = verdict == Verdict::End && step.t + step.h < to;
                    sizes.see(step.start);
                    memories.extend(step, (from, to));
                    report(&Event::Step { step, from, to, ends, compiled });
                    reached = step.t + step.h;
                }
                verdict
            });
            statistics.add(&radau.statistics);
            sizes.see(&y);
            let ended = match outcome {
                Ok(ended) => ended,
                Err(Stop::StepTooSmall { .. }) if conditions.widen(compiled) => {
                    t = reached;
                    continue;
                }
                // A condition that has just changed and at once contradicts itself changes back, and slides at last.
                Err(Stop::StepTooSmall { .. })
                    if turns < MOST_TURNS
                        && conditions.stands_on_threshold(compiled, [reached, inside], &y) =>
                {
                    turns += 1;
                    t = reached;
                    let before = y.clone();
                    conditions
                        .pass(compiled, structure, t, [from, to], &mut y)
                        .map_err(|trouble| Failure::Restart { t, trouble })?;
                    report(&Event::Jump { from: &before, to: &y, equations });
                    continue;
                }
                // A branch may have no values past its threshold, where the other one has.
                Err(Stop::StepTooSmall { .. }) if !was_loose && !conditions.is_empty() => {
                    conditions.let_go(compiled);
                    t = reached;
                    continue;
                }
                Err(stop) => return Err(Failure::Stop(stop)),
            };
            (t, h, turns) = (ended.t, Some(ended.h), 0);
            if t < to {
                let before = y.clone();
                conditions
                    .pass(compiled, structure, t, [from, to], &mut y)
                    .map_err(|trouble| Failure::Restart { t, trouble })?;
                while memories.flip(&conditions) {
                    conditions
                        .settle(compiled, structure, t, [from, to], &mut y)
                        .map_err(|trouble| Failure::Restart { t, trouble })?;
                }
                sizes.see(&y);
                report(&Event::Jump { from: &before, to: &y, equations });
                if memories.any_delay() {
                    // What jumps here jumps again when a delay is over: the rest is segments of their own.
                    let echoes = memories.echoes(t, until);
                    corners.insert(next, t);
                    for echo in echoes {
                        let at = corners.partition_point(|corner| *corner < echo - memories.room);
                        if corners.get(at).is_none_or(|corner| *corner > echo + memories.room) {
                            corners.insert(at, echo);
                        }
                    }
                    break;
                }
            }
        }
    }
    statistics.events = conditions.events;
    report(&Event::End(&y));
    Ok((statistics, conditions))
}

/// How often conditions turn at one place before that is said to lead nowhere.
const MOST_TURNS: u32 = 16;

/// A first step within which no state moves by more than a small part of what is allowed times a hundred.
fn first_step(radau: &mut Radau, [start, from, to]: [f64; 3], y: &[f64], last: Option<f64>) -> f64 {
    let mut f = vec![0.0; y.len()];
    radau.compiled.residual(start, 0.5 * (from + to), y, &mut f);
    let from = start;
    let fastest = (0..radau.compiled.states)
        .map(|k| (f[k] / (100.0 * radau.weights[k])).abs())
        .filter(|rate| rate.is_finite())
        .fold(0.0, f64::max);
    let careful =
        (1e-3 * (to - from)).min(if fastest > 0.0 { 1.0 / fastest } else { f64::INFINITY });
    careful.max(1e-9 * (to - from)).min(last.map_or(f64::INFINITY, |h| h.max(1e-9 * (to - from))))
}

/// Below this part of the largest effort or flow of the same kind a value counts as what rounding leaves of 0.
const ROUNDING: f64 = 1e-8;

/// The largest magnitude of each unknown so far, and what is not to be told from 0.
struct Sizes {
    largest: Vec<f64>,
    kind: Vec<Kind>,
    index_two: Vec<bool>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// An effort or flow, by domain.
    Power(usize),
    Other,
}

impl Sizes {
    fn new(graph: &BondGraph, prepared: &Prepared, start: &[f64]) -> Sizes {
        let kind = prepared.equations.unknowns.iter().map(|unknown| match unknown {
            Unknown::Effort(bond) => Kind::Power(2 * graph.bond(*bond).domain as usize),
            Unknown::Flow(bond) => Kind::Power(2 * graph.bond(*bond).domain as usize + 1),
            _ => Kind::Other,
        });
        let mut sizes = Sizes {
            largest: vec![0.0; start.len()],
            kind: kind.collect(),
            index_two: prepared.structure.index_two.clone(),
        };
        sizes.see(start);
        sizes
    }

    fn see(&mut self, y: &[f64]) {
        for (largest, value) in self.largest.iter_mut().zip(y) {
            *largest = largest.max(value.abs());
        }
    }

    /// The largest effort or flow of each kind.
    fn largest_of_kinds(&self) -> Vec<f64> {
        let mut largest = vec![0.0f64; 2 * 16];
        for (size, kind) in self.largest.iter().zip(&self.kind) {
            if let Kind::Power(kind) = kind {
                largest[*kind] = largest[*kind].max(*size);
            }
        }
        largest
    }

    /// The error allowed: the tolerance times the size, and not less than a hundred-millionth of that of the largest
    /// unknown of the same kind, below which a value is what rounding leaves of 0. Unknowns of index 2 are not tested
    /// (infinity): their estimate carries rounding of the states divided by the step, and they act on the states by no
    /// more than the step times their error.
    fn weights(&self, tolerance: f64, pilot: bool) -> Vec<f64> {
        let largest = self.largest_of_kinds();
        let least = if pilot { 1e-6 } else { ROUNDING };
        self.largest
            .iter()
            .zip(self.kind.iter().zip(&self.index_two))
            .map(|(size, (kind, index_two))| {
                let floor = match kind {
                    Kind::Power(kind) => least * largest[*kind],
                    Kind::Other => 0.0,
                };
                if *index_two {
                    return f64::INFINITY;
                }
                tolerance * size.max(floor).max(1e-15)
            })
            .collect()
    }
}

fn explain(graph: &BondGraph, prepared: &Prepared, failure: &Failure) -> Diagnostic {
    let Prepared { equations, compiled, .. } = prepared;
    match failure {
        Failure::Restart { t, trouble } => prepared::explain(
            graph,
            equations,
            compiled,
            trouble,
            "E0851",
            &format!("at t = {t} s"),
        ),
        Failure::Stop(Stop::TooManySteps { t }) => Diagnostic::error(
            "E0852",
            crate::source::Span::NONE,
            format!("the second route took too many steps and stands at t = {t} s"),
        ),
        Failure::Stop(Stop::StepTooSmall { t, unknown }) => {
            let unknown = equations.unknowns[*unknown];
            let span = match unknown {
                Unknown::Stored(end) => graph.vertex(end.vertex).span,
                Unknown::Rated(id) => graph.vertex(id).span,
                Unknown::Signal(id) => graph.signals[id.index()].span,
                Unknown::Effort(id) | Unknown::Flow(id) => graph.bond(id).span,
            };
            let name = crate::bond::equations::unknown_name(graph, unknown);
            Diagnostic::error(
                "E0850",
                span,
                format!("the second route cannot go on past t = {t} s"),
            )
            .says(format!("{name} moves most"))
            .help("a law with a jump or a pole there needs a smooth form")
        }
    }
}

#[cfg(test)]
mod tests;
