//! What memories take from a run: the history of delayed inputs with each accepted step, samples at their instants.

use super::Run;
use crate::sim::explain::{Failure, Moment};
use crate::sim::memory::through;
use crate::sim::newton::Cut;
use crate::sim::op::{self, Trouble};

/// The history of a delay is as exact as this part of the run's tolerance, as far as rounding lets it.
const PART: f64 = 0.1;
const ROUNDING: f64 = 1e-13;

/// How often a step is halved for it at most.
const MOST_HALVED: u32 = 7;

/// How often the operating point is sought anew until all lines have come to rest.
const MOST_ROUNDS: u32 = 1000;

impl Run<'_> {
    /// Takes the step just accepted, from `state` to `next`, into the past of all delays.
    pub(super) fn remember(&mut self) -> Result<(), Failure> {
        if !self.network.memories.any_delay() {
            return Ok(());
        }
        let (from, to) = (self.state.t, self.next.t);
        self.inside.begin();
        let ends = [self.inputs_of(false), self.inputs_of(true)];
        let mut middle = vec![];
        for theta in [0.25, 0.5, 0.75] {
            middle.push(self.inputs_at(theta)?);
        }
        let count = ends[0].len();
        let five = |a: &[f64], b: &[f64], c: &[f64], d: &[f64], e: &[f64]| -> Vec<[f64; 5]> {
            (0..count).map(|k| [a[k], b[k], c[k], d[k], e[k]]).collect()
        };
        // Pieces still to be judged: beginning, width (as parts of the step), values, how often halved.
        let whole = five(&ends[0], &middle[0], &middle[1], &middle[2], &ends[1]);
        let mut pile = vec![(0.0, 1.0, whole, 0)];
        while let Some((begin, width, y, halved)) = pile.pop() {
            let mut exact = halved >= MOST_HALVED || width * (to - from) <= self.smallest;
            if !exact {
                let left = self.inputs_at(begin + 0.125 * width)?;
                let right = self.inputs_at(begin + 0.625 * width)?;
                exact = (0..count).all(|k| {
                    let largest =
                        y[k].iter().fold(self.network.memories.largest(k), |m, v| m.max(v.abs()));
                    let room = (PART * self.settings.reltol).max(ROUNDING) * largest;
                    (through(y[k], 0.5) - left[k]).abs() <= room
                        && (through(y[k], 2.5) - right[k]).abs() <= room
                });
                if !exact {
                    let second = self.inputs_at(begin + 0.375 * width)?;
                    let fourth = self.inputs_at(begin + 0.875 * width)?;
                    let at = |k: usize| -> Vec<f64> { y.iter().map(|y| y[k]).collect() };
                    let half = 0.5 * width;
                    let first = five(&at(0), &left, &at(1), &second, &at(2));
                    let last = five(&at(2), &right, &at(3), &fourth, &at(4));
                    pile.push((begin + half, half, last, halved + 1));
                    pile.push((begin, half, first, halved + 1));
                }
            }
            if exact {
                let length = width * (to - from);
                self.network.memories.extend(from + begin * (to - from), length, &y);
            }
        }
        Ok(())
    }

    /// Inputs of all memories at an end of the step.
    fn inputs_of(&mut self, end: bool) -> Vec<f64> {
        let state = if end { &self.next } else { &self.state };
        self.network.read_memories(&state.x, state.t);
        self.network.memories.inputs.clone()
    }

    /// Inputs of all memories at a part of the step.
    fn inputs_at(&mut self, theta: f64) -> Result<Vec<f64>, Failure> {
        let Run { network, state, next, weights, work, index2, inside, .. } = self;
        let time = state.t + theta * (next.t - state.t);
        let outcome = inside.between(network, state, next, time, *index2, weights, work);
        outcome.map_err(|stopped| self.row_failure(stopped))?;
        self.network.read_memories(&self.inside.point.x, time);
        Ok(self.network.memories.inputs.clone())
    }

    /// Lets the holds that are due take their values, round after round, and notes what jumps at the inputs of delays.
    pub(super) fn settle_memories(&mut self, moment: Moment) -> Result<(), Failure> {
        if self.network.memories.is_empty() {
            return Ok(());
        }
        for round in 0..self.network.memories.rounds_due() {
            let Run { network, state, .. } = self;
            network.read_memories(&state.x, state.t);
            if network.memories.hold(network.system, round) {
                self.restart(moment)?;
            }
        }
        let Run { network, state, .. } = self;
        network.read_memories(&state.x, state.t);
        network.memories.mark(state.t);
        Ok(())
    }
}

/// Seeks operating points with `find` until what memories hold is what they remember.
pub(in crate::sim) fn at_rest(
    network: &mut crate::sim::network::Network,
    state: &mut op::State,
    mut find: impl FnMut(&mut crate::sim::network::Network, &mut op::State) -> Result<(), Trouble>,
) -> Result<(), Trouble> {
    const SETTLED: f64 = 1e-10;
    let start = state.clone();
    for _ in 0..MOST_ROUNDS {
        state.copy_from(&start);
        find(network, state)?;
        if network.memories.is_empty() {
            return Ok(());
        }
        network.read_memories(&state.x, state.t);
        if network.memories.follow(network.system) <= SETTLED {
            return Ok(());
        }
    }
    Err(Trouble::Cut(Cut::NoConvergence { worst: 0 }))
}
