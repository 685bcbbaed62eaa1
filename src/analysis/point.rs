//! The point that a model is linearised at: its start, an instant of a run, or where it comes to rest.
//!
//! Rest is sought as nature would: implicit Euler steps from the start, each longer than the last, with all functions of
//! time held at their values at the start, until nothing moves any more (C. T. Kelley, D. E. Keyes, *Convergence analysis
//! of pseudo-transient continuation*, 1998). So states that nothing returns, as the position of a free mass, stay where
//! the movement has left them.

use crate::bond::causality::Causality;
use crate::bond::consistent::{self, Slot};
use crate::bond::equations::memory::Kind;
use crate::bond::equations::{Equations, unknown_name};
use crate::bond::graph::BondGraph;
use crate::bond::initial;
use crate::bond::prepared::{self, Prepared};
use crate::diagnostic::{Diagnostic, Severity};
use crate::second;
use crate::source::Span;

/// Where to linearise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// At the initial values.
    Start,
    /// At a time of the run, seconds.
    Time(f64),
    /// Where everything comes to rest, sources being held at their values at the start.
    Rest,
}

/// The values of everything at such a point.
#[derive(Clone, Debug)]
pub struct Point {
    /// Where it is.
    pub at: At,
    /// The time at which functions of time are taken, and a time within the same piece of them.
    pub times: [f64; 2],
    /// The unknowns, in the order of the equations.
    pub y: Vec<f64>,
    /// The equations with what they determine.
    pub prepared: Prepared,
}

/// Longest of the steps that lead to rest, seconds.
const LONGEST: f64 = 1e9;
/// What still changes by this part of its largest value in two long steps is at rest.
const RESTS: f64 = 1e-10;
/// Attempts at steps.
const MOST_STEPS: usize = 400;

/// Finds the point; `None` when what is wrong has been said.
pub fn find(
    graph: &BondGraph,
    causality: &Causality,
    at: At,
    d: &mut Vec<Diagnostic>,
) -> Option<Point> {
    let mut prepared = prepared::prepare(graph, causality, d)?;
    refuse_memories(graph, &prepared.equations, d)?;
    let y = initial::start(graph, &mut prepared, d)?;
    let until = graph.experiment.until.filter(|t| *t > 0.0).unwrap_or(1.0);
    let first = prepared.equations.corners(until).get(1).copied().unwrap_or(until);
    let mut point = Point { at, times: [0.0, 0.5 * first], y, prepared };
    match at {
        At::Start => {}
        At::Time(t) if t > 0.0 => point.run(graph, causality, t, d)?,
        At::Time(_) => {}
        At::Rest => point.rest(graph, d)?,
    }
    Some(point)
}

/// What remembers the past has no linear equations of finite order.
fn refuse_memories(
    graph: &BondGraph,
    equations: &Equations,
    d: &mut Vec<Diagnostic>,
) -> Option<()> {
    let found = equations.memories.iter().find_map(|memory| {
        let what = match memory.kind {
            Kind::Sample { .. } => "samples of instants",
            Kind::Delay { .. } => "what was some time before",
            Kind::Hysteresis { .. } => return None,
        };
        Some((memory.unknown, what))
    });
    let Some((unknown, what)) = found else { return Some(()) };
    let name = unknown_name(graph, equations.unknowns[unknown]);
    let span = graph.signals.iter().find(|signal| signal.name == name).map(|signal| signal.span);
    d.push(
        Diagnostic::error(
            "E0927",
            span.unwrap_or(Span::NONE),
            format!("`{name}` holds {what}: no linear system of finite order does"),
        )
        .help("put its input in its place, or a `lag` of about the same delay"),
    );
    None
}

impl Point {
    /// Goes to a time of the run.
    fn run(
        &mut self,
        graph: &BondGraph,
        causality: &Causality,
        t: f64,
        d: &mut Vec<Diagnostic>,
    ) -> Option<()> {
        let run = second::integrate(graph, causality, &[t], &second::Settings::default(), d)?;
        self.y = run.end;
        let equations = &self.prepared.equations;
        for memory in &equations.memories {
            if let Some(content) = equations.content(memory) {
                content.set(self.y[memory.unknown]);
            }
        }
        // At a jump the later values hold.
        let after =
            equations.corners(2.0 * t).into_iter().find(|corner| *corner > t * (1.0 + 1e-12));
        let after = after.unwrap_or(2.0 * t);
        self.times = [t, 0.5 * (t + after)];
        let Prepared { compiled, structure, .. } = &mut self.prepared;
        let settled =
            consistent::settle(compiled, structure, t, self.times[1], after - t, &mut self.y);
        self.check(graph, settled, &format!("at {t} s"), d)
    }

    /// Goes on until nothing moves any more.
    fn rest(&mut self, graph: &BondGraph, d: &mut Vec<Diagnostic>) -> Option<()> {
        let [t, inside] = self.times;
        let states = self.prepared.compiled.states;
        let mut largest: Vec<f64> = self.y[..states].iter().map(|y| y.abs()).collect();
        let (mut h, mut resting) = (1e-6, 0);
        let mut last = Ok(());
        let mut moving: Option<(usize, f64)> = None;
        for _ in 0..MOST_STEPS {
            let compiled = &mut self.prepared.compiled;
            let slots: Vec<Slot> = (0..compiled.n)
                .map(|i| if i < states { Slot::euler(i, self.y[i], h) } else { Slot::OWN })
                .collect();
            let mut next = self.y.clone();
            last = consistent::newton(compiled, &slots, t, inside, &mut next);
            if last.is_err() || next.iter().any(|y| !y.is_finite()) {
                h *= 0.2;
                if h < 1e-15 {
                    break;
                }
                continue;
            }
            largest.iter_mut().zip(&next).for_each(|(most, y)| *most = most.max(y.abs()));
            let most = largest.iter().copied().fold(0.0, f64::max);
            moving = (0..states)
                .map(|k| (k, (next[k] - self.y[k]).abs() / (largest[k] + 1e-15 * most)))
                .filter(|(_, part)| *part > RESTS)
                .max_by(|a, b| a.1.total_cmp(&b.1));
            self.y = next;
            // Short steps say nothing.
            resting = if moving.is_none() && h > 1e-3 { resting + 1 } else { 0 };
            if resting >= 4 {
                return Some(());
            }
            h = (4.0 * h).min(LONGEST);
        }
        self.check(graph, last, "on the way to rest", d)?;
        let unknowns = &self.prepared.equations.unknowns;
        let name = moving.map_or("it".to_string(), |(k, _)| unknown_name(graph, unknowns[k]));
        d.push(
            Diagnostic::error(
                "E0937",
                Span::NONE,
                format!("no point of rest: {name} keeps moving"),
            )
            .because("sources and inputs are held at their values at the start")
            .help("linearise at a time of a run, `--at 1s`, or let --drive set other inputs"),
        );
        None
    }

    fn check(
        &self,
        graph: &BondGraph,
        found: Result<(), consistent::Trouble>,
        when: &str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<()> {
        let Err(trouble) = found else { return Some(()) };
        let Prepared { equations, compiled, .. } = &self.prepared;
        d.retain(|said| said.severity != Severity::Note);
        d.push(prepared::explain(graph, equations, compiled, &trouble, "E0937", when));
        None
    }
}
