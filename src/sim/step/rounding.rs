//! What rounding leaves of each unknown: no step, however short, errs by less, and none is asked to.
//!
//! A current of 1e-18 A that a resistor makes of the difference of two voltages of 270 V is known to 1e-12 A at best. Each
//! equation is evaluated to a few times ε of the sum of its terms' sizes; what that makes of the unknowns follows
//! through the factors at hand.

use super::Run;
use crate::quantity::random;

/// An equation is off by so many times ε of its terms,
const ROUNDINGS: f64 = 8.0;
/// in directions of which so many are tried.
const TRIES: u64 = 3;
/// No current and no voltage has a floor above these, in A and V: what is less well known than that is no rounding.
const MOST: [f64; 2] = [1e-9, 1e-6];
/// It is asked after so many steps whose error matters.
const SEEN_AGAIN: u32 = 32;
/// Errors below this part of the tolerance do not.
const MATTERS: f64 = 0.1;

/// The rounding of each unknown as last seen, and steps whose error mattered since.
#[derive(Debug)]
pub(super) struct Rounding {
    floors: Vec<f64>,
    age: u32,
}

impl Rounding {
    pub fn new(n: usize) -> Rounding {
        Rounding { floors: vec![0.0; n], age: 0 }
    }

    /// Other equations round otherwise.
    pub fn forget(&mut self) {
        self.floors.fill(0.0);
        self.age = 0;
    }

    /// The least weight of each unknown.
    pub fn floors(&self) -> &[f64] {
        &self.floors
    }
}

impl Run<'_> {
    /// Sees with the factors of a step how much of its error may be rounding, where that has not been seen lately.
    pub(super) fn see_rounding(&mut self, error: f64) {
        if error < MATTERS {
            return;
        }
        let due = self.rounding.age == 0;
        self.rounding.age = (self.rounding.age + 1) % SEEN_AGAIN;
        if !due {
            return;
        }
        let Run { network, state, work, rounding, .. } = self;
        // A step that was cut may have asked the laws far out.
        network.evaluate(&state.x, state.t);
        network.term_sizes(&state.x, state.t, &mut work.x);
        rounding.floors.fill(0.0);
        for seed in 0..TRIES {
            for (row, (turned, size)) in work.right.iter_mut().zip(&work.x).enumerate() {
                let sign = if random::fraction(seed, row as u64) < 0.5 { -1.0 } else { 1.0 };
                *turned = sign * ROUNDINGS * f64::EPSILON * size;
            }
            network.solve_dynamic(&mut work.right);
            let unknowns = &network.system.unknowns;
            for ((floor, moved), unknown) in
                rounding.floors.iter_mut().zip(&work.right).zip(unknowns)
            {
                *floor = floor.max(moved.abs()).min(MOST[usize::from(unknown.voltage)]);
            }
        }
        self.weigh();
    }
}
