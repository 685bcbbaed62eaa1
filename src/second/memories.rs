//! Memories of the second route: the past of delayed inputs, samples at their instants, switches with hysteresis.

use super::events::Conditions;
use super::radau::Step;
use crate::bond::equations::Equations;
use crate::bond::equations::memory::{Kind, Memory, Remembered};

/// All memories of a run.
pub struct Memories {
    all: Vec<(Remembered, Memory)>,
    /// The shortest delay: no step is longer.
    pub longest: f64,
    /// Instants closer than this are one.
    pub room: f64,
}

impl Memories {
    /// Those of the equations at the start of a run until a time, with what they hold then.
    pub fn new(equations: &Equations, start: &[f64], until: f64) -> Memories {
        let mut all = vec![];
        for memory in &equations.memories {
            if let Some(content) = equations.content(memory) {
                content.set(start[memory.unknown]);
                all.push((memory.clone(), content.clone()));
            }
        }
        let delays = all.iter().filter_map(|(memory, _)| delay(memory));
        let longest = delays.fold(f64::INFINITY, f64::min);
        Memories { longest, all, room: 1e-12 * until }
    }

    /// Takes a step within a segment into the past.
    pub fn extend(&self, step: &Step, segment: (f64, f64)) {
        for (memory, content) in &self.all {
            if delay(memory).is_some() {
                content.extend(step.t, step.h, segment, &mut |part, y| step.part(part, y));
            }
        }
    }

    /// Lets switches with hysteresis follow their conditions; says whether any has changed.
    pub fn flip(&self, conditions: &Conditions) -> bool {
        let mut any = false;
        for (memory, content) in &self.all {
            let (Kind::Hysteresis { .. }, Some(condition)) = (memory.kind, memory.condition) else {
                continue;
            };
            let (now, then) = (conditions.mode(condition), content.value(0.0, 0.0));
            let next = if now > 0.0 { 1.0 } else { 0.0 };
            if now != 0.0 && next != then {
                content.set(next);
                any = true;
            }
        }
        any
    }

    /// An event within a segment that ends at `to`: it now ends at the event. The times at which delays echo it, before
    /// `until`.
    pub fn echoes(&self, t: f64, until: f64) -> Vec<f64> {
        let mut times = vec![];
        for (memory, content) in &self.all {
            if let Some(by) = delay(memory) {
                content.close(t);
                times.extend([t + by, t + 2.0 * by]);
            }
        }
        times.retain(|time| *time < until - self.room);
        times
    }

    /// Whether there are delays.
    pub fn any_delay(&self) -> bool {
        self.longest.is_finite()
    }
}

fn delay(memory: &Remembered) -> Option<f64> {
    match memory.kind {
        Kind::Delay { by } => Some(by),
        Kind::Hysteresis { .. } | Kind::Sample { .. } => None,
    }
}
