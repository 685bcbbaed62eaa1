//! Layers that nobody looks at: a switch closes under a conducting diode, and its charge is gone within picoseconds.
//!
//! Some steps of the backward Euler method lead over all of it. They ask for rates where they end only, so that what moves
//! slowly goes on from the beginning as it does behind the layer, while any method that takes the rates before the layer
//! for a part of its step would have them last for that part; and of what dies out at a rate λ each leaves 1/(1 + λh).
//! They stand where in the last of them nothing moves any more, and where all of them together have moved nothing that is
//! looked at.

use super::{Run, State};
use crate::sim::methods::Method;
use crate::sim::system::System;

/// The span of such steps is this part of the way to the next corner or event in sight.
const SPAN: f64 = 1e-4;
const STEPS: u32 = 3;

/// In the last of them nothing moves by more than this part of its tolerance.
const STILL: f64 = 0.5;

/// So often they are tried after corners or events of a kind without success.
const TRIES: u32 = 3;

/// What is looked at, and room for the way over a layer.
pub(super) struct Layer {
    /// Unknowns of output columns.
    asked: Vec<u32>,
    start: State,
    before: Vec<f64>,
}

impl Layer {
    pub fn new(system: &System) -> Layer {
        let n = system.equations();
        Layer {
            asked: system.observed(),
            start: State::new(0.0, n, system.charges()),
            before: vec![0.0; n],
        }
    }
}

impl Run<'_> {
    /// Passes over the layer after a corner or event, where there is one that need not be resolved: it is thinner than what a
    /// careful first step would be, and nothing that follows from the solution decides when something happens.
    pub(super) fn pass_layer(&mut self) {
        if !self.fresh {
            return;
        }
        let span = SPAN * self.distance();
        let Run { network, rows, index2, method, layer, first, settings, .. } = self;
        let system = network.system;
        let limit = settings.hmax.unwrap_or(f64::INFINITY);
        let may = !*index2
            && self.h < span
            && span < limit
            && matches!(method, Method::TrBdf2 | Method::Trapezoidal | Method::Gear2)
            && system.has_junctions()
            && system.has_junctions_alone()
            && !self.watches
            && network.memories.is_empty()
            && layer.asked.len() < system.equations()
            && rows.as_mut().is_some_and(|rows| !rows.are_due(self.state.t + span))
            && first.stayed().is_some_and(|stayed| *stayed < TRIES);
        if !may {
            return;
        }
        self.layer.start.copy_from(&self.state);
        let passed = self.die_out(span);
        if passed {
            self.network.statistics.accepted += 1;
            self.weigh();
            self.be_careful();
        } else {
            self.state.copy_from(&self.layer.start);
        }
        if let Some(stayed) = self.first.stayed() {
            *stayed = if passed { 0 } else { *stayed + 1 };
        }
    }

    /// Steps over a layer; says whether they stand.
    fn die_out(&mut self, span: f64) -> bool {
        for _ in 0..STEPS {
            self.layer.before.copy_from_slice(&self.state.x);
            if self.euler(span / f64::from(STEPS)).is_err() {
                return false;
            }
        }
        let Run { layer, state, weights, network, .. } = self;
        let moved = |k: usize, from: &[f64]| (state.x[k] - from[k]).abs() / weights[k];
        let still = (0..weights.len()).all(|k| moved(k, &layer.before) <= STILL);
        let unseen = layer.asked.iter().all(|k| moved(*k as usize, &layer.start.x) <= 1.0);
        // A step so long leads to where something would stand that falls to one side or the other.
        still && unseen && network.outgrows_step() == Some(false)
    }
}
