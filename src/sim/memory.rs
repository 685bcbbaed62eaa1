//! Terms that follow from the past: delays with the history of their inputs, held samples with their instants.
//!
//! They are sources whose values change only with accepted steps. The history of a delay is made of polynomials of
//! degree 4 through five points of a step, each point with the unknowns that belong to the charges there; a step is
//! halved until the polynomial is as exact as the run (see [`Run::remember`](super::step)). No step is longer than the
//! shortest delay, so that what it needs is past. What jumps or bends at the input does so again at the end of the delay:
//! steps land on it, each piece of the history being used on its own side.

use super::laws::{LawSet, Registers};
use super::system::System;
use crate::circuit::DeviceId;
use crate::circuit::stamps::MemoryKind;
use std::collections::VecDeque;

/// A term that follows from the past, compiled; its input is a value of [`System::memory_inputs`].
#[derive(Clone, Debug)]
pub(crate) struct MemoryData {
    pub device: DeviceId,
    pub kind: MemoryKind,
    pub into: Vec<(u32, f64)>,
    pub initial: Option<f64>,
}

/// How often a bend is passed on: each time it has been through the circuit it is smoother by an order or so.
const MOST_ECHOES: u32 = 4;

/// A change by more than this part of the largest value is a jump.
const JUMP: f64 = 1e-9;

/// The present content of all memories.
#[derive(Debug)]
pub(crate) struct Memories {
    states: Vec<Content>,
    registers: Registers,
    /// Inputs at the last point asked for.
    pub inputs: Vec<f64>,
    /// How often what happens at the present corner has been through a delay; 0 for what is new.
    generation: u32,
    /// The round of the last hold, and whether any hold is due.
    rounds: u32,
}

#[derive(Debug)]
enum Content {
    Hold { value: f64, next: f64, turn: u64, period: f64, due: bool },
    Delay(History),
}

/// The past of a delay's input.
#[derive(Debug)]
struct History {
    by: f64,
    /// The value before the start.
    start: f64,
    largest: f64,
    pieces: VecDeque<Piece>,
    /// Pieces that have been forgotten.
    forgotten: usize,
    /// Jumps and bends whose echo is still to come, and the first piece after the last one passed.
    corners: VecDeque<Corner>,
    passed: usize,
}

#[derive(Debug)]
struct Corner {
    t: f64,
    /// The first piece after it, counted from the first ever.
    piece: usize,
    generation: u32,
}

/// A polynomial in u = 4·(t − from)/length, by falling powers' coefficients.
#[derive(Debug)]
pub(crate) struct Piece {
    from: f64,
    length: f64,
    factors: [f64; 5],
}

impl Piece {
    /// Through five values at equal distances.
    pub fn through(from: f64, length: f64, y: [f64; 5]) -> Piece {
        Piece { from, length, factors: factors(y) }
    }

    fn at(&self, t: f64) -> f64 {
        horner(&self.factors, 4.0 * (t - self.from) / self.length)
    }

    fn slope(&self, t: f64) -> f64 {
        let u = 4.0 * (t - self.from) / self.length;
        let [a, b, c, d, _] = self.factors;
        (((4.0 * a * u + 3.0 * b) * u + 2.0 * c) * u + d) * 4.0 / self.length
    }
}

/// Coefficients of the polynomial through five values at u = 0 … 4 (Newton's forward differences).
fn factors(y: [f64; 5]) -> [f64; 5] {
    let first = y[1] - y[0];
    let second = y[2] - 2.0 * y[1] + y[0];
    let third = y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0];
    let fourth = y[4] - 4.0 * y[3] + 6.0 * y[2] - 4.0 * y[1] + y[0];
    [
        fourth / 24.0,
        third / 6.0 - fourth / 4.0,
        second / 2.0 - third / 2.0 + 11.0 * fourth / 24.0,
        first - second / 2.0 + third / 3.0 - fourth / 4.0,
        y[0],
    ]
}

fn horner(factors: &[f64; 5], u: f64) -> f64 {
    factors.iter().fold(0.0, |sum, factor| sum * u + factor)
}

/// The polynomial through five values at u = 0 … 4, at a u.
pub(crate) fn through(y: [f64; 5], u: f64) -> f64 {
    horner(&factors(y), u)
}

impl History {
    /// The piece that holds at `s` on the present side of all corners.
    fn piece(&self, s: f64) -> Option<&Piece> {
        let low = self.passed.saturating_sub(self.forgotten);
        let high = match self.corners.front() {
            Some(corner) => corner.piece.saturating_sub(self.forgotten),
            None => self.pieces.len(),
        };
        let high = high.min(self.pieces.len());
        if low >= high {
            return None;
        }
        let after = self.pieces.partition_point(|piece| piece.from <= s);
        self.pieces.get(after.saturating_sub(1).clamp(low, high - 1))
    }

    fn end(&self) -> Option<f64> {
        self.pieces.back().map(|piece| piece.at(piece.from + piece.length))
    }
}

impl Memories {
    pub fn new(system: &System) -> Memories {
        let content = |data: &MemoryData| match data.kind {
            MemoryKind::Hold { period, .. } => Content::Hold {
                value: data.initial.unwrap_or(0.0),
                next: period,
                turn: 1,
                period,
                due: true,
            },
            MemoryKind::Delay { by } => Content::Delay(History {
                by,
                start: data.initial.unwrap_or(0.0),
                largest: 0.0,
                pieces: VecDeque::new(),
                forgotten: 0,
                corners: VecDeque::from([Corner { t: 0.0, piece: 0, generation: 0 }]),
                passed: 0,
            }),
        };
        let round = |data: &MemoryData| match data.kind {
            MemoryKind::Hold { round, .. } => round + 1,
            MemoryKind::Delay { .. } => 0,
        };
        Memories {
            states: system.memories.iter().map(content).collect(),
            registers: system.memory_inputs.registers(),
            inputs: vec![0.0; system.memories.len()],
            generation: 0,
            rounds: system.memories.iter().map(round).max().unwrap_or(0),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Whether any is a delay.
    pub fn any_delay(&self) -> bool {
        self.states.iter().any(|state| matches!(state, Content::Delay(_)))
    }

    /// The value of a memory at a time within the present step.
    pub fn value(&self, k: usize, t: f64) -> f64 {
        match self.states.get(k) {
            Some(Content::Hold { value, .. }) => *value,
            Some(Content::Delay(history)) => {
                let s = t - history.by;
                history.piece(s).map_or(history.start, |piece| piece.at(s))
            }
            None => 0.0,
        }
    }

    /// Its slope.
    pub fn slope(&self, k: usize, t: f64) -> f64 {
        match self.states.get(k) {
            Some(Content::Delay(history)) => {
                let s = t - history.by;
                history.piece(s).map_or(0.0, |piece| piece.slope(s))
            }
            _ => 0.0,
        }
    }

    /// The next instant of a sample, or the next echo of a corner.
    pub fn next_corner(&self) -> f64 {
        let next = self.states.iter().map(|state| match state {
            Content::Hold { next, .. } => *next,
            Content::Delay(history) => {
                history.corners.front().map_or(f64::INFINITY, |corner| corner.t + history.by)
            }
        });
        next.fold(f64::INFINITY, f64::min)
    }

    /// The longest step within which all delays give what is past.
    pub fn longest_step(&self) -> f64 {
        let delays = self.states.iter().map(|state| match state {
            Content::Hold { .. } => f64::INFINITY,
            Content::Delay(history) => history.by,
        });
        delays.fold(f64::INFINITY, f64::min)
    }

    /// Passes the instants and echoes at `t`; says whether there were any. `new`: something else has a corner there.
    pub fn pass_corner(&mut self, t: f64, slack: f64, new: bool) -> bool {
        let mut any = false;
        let mut generation = if new { 0 } else { u32::MAX };
        for state in &mut self.states {
            match state {
                Content::Hold { next, turn, period, due, .. } => {
                    while *next <= t + slack {
                        *turn += 1;
                        *next = *turn as f64 * *period;
                        *due = true;
                        any = true;
                        generation = 0;
                    }
                }
                Content::Delay(history) => {
                    while let Some(corner) = history.corners.front() {
                        if corner.t + history.by > t + slack {
                            break;
                        }
                        any = true;
                        history.passed = corner.piece;
                        generation = generation.min(corner.generation + 1);
                        history.corners.pop_front();
                    }
                }
            }
        }
        self.generation = if generation == u32::MAX { 0 } else { generation };
        any
    }

    /// Values of the inputs.
    pub fn read(&mut self, laws: &LawSet, inputs: &[f64]) {
        laws.values(inputs, &mut self.registers, &mut self.inputs);
    }

    /// Rounds of holds at one instant; 0 where nothing is due.
    pub fn rounds_due(&self) -> u32 {
        let due = |state: &Content| matches!(state, Content::Hold { due: true, .. });
        if self.states.iter().any(due) { self.rounds } else { 0 }
    }

    /// Lets the holds of a round that are due take their inputs as last read; says whether any did.
    pub fn hold(&mut self, system: &System, round: u32) -> bool {
        let mut any = false;
        for ((state, data), input) in self.states.iter_mut().zip(&system.memories).zip(&self.inputs)
        {
            if let (Content::Hold { value, due, .. }, MemoryKind::Hold { round: own, .. }) =
                (state, data.kind)
                && own == round
                && std::mem::replace(due, false)
            {
                any |= *value != *input;
                *value = *input;
            }
        }
        any
    }

    /// Lets everything follow its input as last read, as in the steady state; gives the largest change, in parts of the
    /// largest value.
    pub fn follow(&mut self, system: &System) -> f64 {
        let mut most = 0.0f64;
        for ((state, data), input) in self.states.iter_mut().zip(&system.memories).zip(&self.inputs)
        {
            let value = match state {
                Content::Hold { value, .. } => value,
                Content::Delay(history) => &mut history.start,
            };
            let next = data.initial.filter(|_| matches!(data.kind, MemoryKind::Delay { .. }));
            let next = next.unwrap_or(*input);
            most = most.max((next - *value).abs() / next.abs().max(value.abs()).max(1e-12));
            *value = next;
        }
        most
    }

    /// Notes a corner at `t` where inputs, as last read, jump or may bend.
    pub fn mark(&mut self, t: f64) {
        let generation = std::mem::replace(&mut self.generation, 0);
        for (state, input) in self.states.iter_mut().zip(&self.inputs) {
            let Content::Delay(history) = state else { continue };
            let Some(before) = history.end() else { continue };
            let piece = history.forgotten + history.pieces.len();
            let jumps = (input - before).abs() > JUMP * history.largest.max(input.abs());
            if !jumps && generation > MOST_ECHOES {
                continue;
            }
            let generation = if jumps { 0 } else { generation };
            match history.corners.back_mut() {
                Some(corner) if corner.piece == piece => {
                    corner.generation = corner.generation.min(generation);
                }
                _ => history.corners.push_back(Corner { t, piece, generation }),
            }
        }
    }

    /// The largest value that the inputs have had, by memory; 0 for holds.
    pub fn largest(&self, k: usize) -> f64 {
        match self.states.get(k) {
            Some(Content::Delay(history)) => history.largest,
            _ => 0.0,
        }
    }

    /// Takes a piece of a step into the past of each delay: five values of each input.
    pub fn extend(&mut self, from: f64, length: f64, values: &[[f64; 5]]) {
        for (state, y) in self.states.iter_mut().zip(values) {
            let Content::Delay(history) = state else { continue };
            let largest = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
            history.largest = history.largest.max(largest);
            history.pieces.push_back(Piece::through(from, length, *y));
        }
    }

    /// Forgets what no delay will ask for after `t`.
    pub fn forget(&mut self, t: f64) {
        for state in &mut self.states {
            let Content::Delay(history) = state else { continue };
            let s = t - history.by;
            while history.pieces.front().is_some_and(|piece| piece.from + piece.length < s)
                && history.pieces.len() > 1
                && history.forgotten < history.passed
            {
                history.pieces.pop_front();
                history.forgotten += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_is_the_polynomial_through_its_points() {
        let f = |t: f64| 3.0 - t + 2.0 * t.powi(2) - 0.5 * t.powi(3) + 0.25 * t.powi(4);
        let slope = |t: f64| -1.0 + 4.0 * t - 1.5 * t.powi(2) + t.powi(3);
        let (from, length) = (1.0, 0.5);
        let piece =
            Piece::through(from, length, std::array::from_fn(|k| f(1.0 + 0.125 * k as f64)));
        for t in [0.9, 1.0, 1.2, 1.4375, 1.5, 1.6] {
            assert!((piece.at(t) - f(t)).abs() < 1e-12, "{t}");
            assert!((piece.slope(t) - slope(t)).abs() < 1e-10, "{t}");
        }
    }
}
