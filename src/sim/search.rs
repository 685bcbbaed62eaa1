//! The search for a solution of the frozen network: Newton's method from the guess, then help of three kinds.
//!
//! 1. A conductance at every node that is taken away step by step (gmin stepping).
//! 2. Sources that are turned up step by step (source stepping).
//! 3. Pseudo-transient: each node is held at its last value by a conductance that shrinks as steps succeed, which is the
//!    backward Euler method with a capacitance at every node and steps that grow (C. T. Kelley, D. E. Keyes, SIAM J. Numer.
//!    Anal. 35:508-523, 1998).
//!
//! What none of them finds is reported with how far each came, and with the equations left worst where they came closest.

use super::network::Network;
use super::newton::{Cut, Frozen, Scratch, frozen_misfit, solve_frozen};
use super::op::State;
use crate::linear::Singular;

/// Conductances are taken away down to this one, S.
const LEAST: f64 = 1e-21;

/// How far the search came.
#[derive(Clone, Debug)]
pub(crate) struct Sought {
    /// The smallest conductance at every node with which there was a solution, S.
    pub gmin: Option<f64>,
    /// The largest part of all sources with which there was one.
    pub drive: f64,
    /// The smallest conductance that the pseudo-transient came down to, S.
    pub pseudo: Option<f64>,
    /// Equations left unsatisfied at the best point, worst first: row, what is left over, the sum of its terms' sizes.
    pub rows: Vec<(usize, f64, f64)>,
    /// The unknowns there.
    pub x: Vec<f64>,
    /// A singular matrix at the guess, where it began with one.
    pub singular: bool,
}

/// What is asked for, apart from the values to start with.
pub(crate) struct Question<'a> {
    pub held: &'a [bool],
    pub targets: &'a [f64],
    pub floors: &'a [f64],
    /// Whether junctions may begin where they begin to conduct, and other guesses be tried from rest.
    pub prime: bool,
}

/// Finds x and w for the question from the guess in `state`, which is left as it was where nothing is found.
pub(crate) fn find(
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    let mut guess = std::mem::take(&mut scratch.start);
    guess.copy_from(state);
    let found = find_from(&guess, network, question, state, scratch);
    scratch.start = guess;
    found
}

fn find_from(
    guess: &State,
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    let first = match solve(network, question, question.prime, 100, state, scratch) {
        Ok(()) => return Ok(()),
        Err(cut) => cut,
    };
    if network.system.is_linear() {
        return Err(first);
    }
    let mut of_storages = false;
    if let Cut::Singular(singular) = &first {
        if network.is_singular_by_storages(singular, question.held) {
            return Err(first);
        }
        // At rest, where a law may have no slope, the guess itself may be the solution; where storages depend on each other
        // the circuit is of index 2, which is for the run to know.
        let n = network.system.equations() as u32;
        of_storages = singular.rows.iter().flatten().any(|row| *row >= n);
        if !of_storages && misfit(network, question, guess, scratch).is_empty() {
            state.copy_from(guess);
            return Ok(());
        }
    }
    let mut best = Best::new(network);
    best.see(network, question, state, scratch);
    if matches!(first, Cut::Singular(_) | Cut::NonFinite { .. })
        && from_beside(network, question, state, scratch)
    {
        return Ok(());
    }
    let gmin = match gmin_stepping(network, question, state, scratch) {
        Ok(()) => return Ok(()),
        Err(reached) => reached,
    };
    best.see(network, question, state, scratch);
    let drive = match source_stepping(network, question, state, scratch) {
        Ok(()) => return Ok(()),
        Err(reached) => reached,
    };
    best.see(network, question, state, scratch);
    state.copy_from(guess);
    let pseudo = match pseudo_transient(network, question, state, scratch) {
        Ok(()) => return Ok(()),
        Err(reached) => reached,
    };
    best.see(network, question, state, scratch);
    state.copy_from(guess);
    network.forget_pivots();
    let helped = gmin.is_some() || drive > 0.0 || pseudo.is_some();
    match first {
        // The helps did not come off the ground either: what stood in the way at first is the reason.
        Cut::NonFinite { .. } => Err(first),
        Cut::Singular(_) if !helped || of_storages => Err(first),
        Cut::Singular(ref singular)
            if stays_singular(network, question, &best, singular, state.t) =>
        {
            Err(first)
        }
        first => Err(Cut::NotFound(Box::new(Sought {
            gmin,
            drive,
            pseudo,
            rows: best.rows,
            x: best.x,
            singular: matches!(first, Cut::Singular(_)),
        }))),
    }
}

/// Whether the matrix is singular near rest too, not just where a law happens to have no slope.
fn stays_singular(
    network: &mut Network,
    question: &Question,
    best: &Best,
    singular: &Singular,
    t: f64,
) -> bool {
    let mut x = best.x.clone();
    for column in singular.columns.iter().flatten().map(|column| *column as usize) {
        if let (Some(x), Some(floor)) = (x.get_mut(column), question.floors.get(column)) {
            *x = 1e3 * floor;
        }
    }
    network.linearise(&x, t, false);
    let singular = network.factorise_frozen(question.held).is_err();
    network.forget_pivots();
    singular
}

fn solve(
    network: &mut Network,
    question: &Question,
    prime: bool,
    most: u64,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    let frozen = Frozen {
        t: state.t,
        held: question.held,
        targets: question.targets,
        floors: question.floors,
        most,
        prime,
    };
    let State { x, w, q, .. } = state;
    solve_frozen(network, &frozen, x, w, q, scratch)
}

/// A law may have no slope, or an infinite one, just where the guess is (f·|f| and √|e| at rest): from beside it.
fn from_beside(
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> bool {
    for scale in [1.0, -1.0, 1e3, -1e3, 1e6, -1e6] {
        for (x, floor) in state.x.iter_mut().zip(question.floors) {
            *x = scale * floor;
        }
        state.w.fill(0.0);
        network.forget_pivots();
        if solve(network, question, question.prime, 100, state, scratch).is_ok() {
            return true;
        }
    }
    network.forget_pivots();
    false
}

/// Says down to which conductance there was a solution where the last one is not found; `state` is that solution.
fn gmin_stepping(
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), Option<f64>> {
    state.x.fill(0.0);
    state.w.fill(0.0);
    let mut prime = question.prime;
    let (mut gmin, mut factor) = (1.0, 10.0);
    let mut kept = state.clone();
    let mut reached = None;
    while gmin > LEAST {
        network.gmin = gmin;
        if solve(network, question, prime, 60, state, scratch).is_ok() {
            kept.copy_from(state);
            reached = Some(gmin);
            prime = false;
            gmin /= factor;
        } else {
            state.copy_from(&kept);
            if factor < 1.2 || reached.is_none() {
                network.gmin = 0.0;
                return Err(reached);
            }
            gmin *= factor;
            factor = factor.sqrt();
            gmin /= factor;
        }
    }
    network.gmin = 0.0;
    let found = solve(network, question, false, 100, state, scratch);
    found.map_err(|_| {
        state.copy_from(&kept);
        reached
    })
}

/// Says up to which part of the sources there was a solution where the last one is not found; `state` is that solution.
fn source_stepping(
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), f64> {
    state.x.fill(0.0);
    state.w.fill(0.0);
    let (mut reached, mut step) = (0.0_f64, 0.125_f64);
    let mut kept = state.clone();
    while reached < 1.0 && step > 1e-4 {
        let next: f64 = (reached + step).min(1.0);
        network.set_drive(next);
        if solve(network, question, false, 60, state, scratch).is_ok() {
            kept.copy_from(state);
            reached = next;
            step *= 2.0;
        } else {
            state.copy_from(&kept);
            step *= 0.25;
        }
    }
    network.set_drive(1.0);
    if reached >= 1.0 { Ok(()) } else { Err(reached) }
}

/// Follows from the values in `state` the circuit with a capacitance at every node to where it comes to rest; says down to
/// which conductance the steps came where it does not.
pub(crate) fn pseudo_transient(
    network: &mut Network,
    question: &Question,
    state: &mut State,
    scratch: &mut Scratch,
) -> Result<(), Option<f64>> {
    const MOST: u32 = 300;
    state.w.fill(0.0);
    network.anchor.copy_from_slice(&state.x);
    network.gmin = 1.0;
    let mut kept = state.clone();
    let mut reached: Option<f64> = None;
    for _ in 0..MOST {
        let before = network.statistics.iterations;
        if solve(network, question, false, 20, state, scratch).is_ok() {
            kept.copy_from(state);
            network.anchor.copy_from_slice(&state.x);
            reached = Some(reached.map_or(network.gmin, |least| least.min(network.gmin)));
            // Steps grow as fast as Newton's method bears it.
            let quick = network.statistics.iterations - before <= 6;
            network.gmin /= if quick { 10.0 } else { 2.0 };
            if network.gmin < LEAST {
                break;
            }
        } else {
            state.copy_from(&kept);
            network.gmin *= 8.0;
            if network.gmin > 1e12 {
                break;
            }
        }
    }
    network.gmin = 0.0;
    network.anchor.fill(0.0);
    if reached.is_some() && solve(network, question, false, 100, state, scratch).is_ok() {
        return Ok(());
    }
    state.copy_from(&kept);
    Err(reached)
}

/// Equations that are not satisfied at a point, worst first.
fn misfit(
    network: &mut Network,
    question: &Question,
    state: &State,
    scratch: &mut Scratch,
) -> Vec<(usize, f64, f64)> {
    let frozen = Frozen {
        t: state.t,
        held: question.held,
        targets: question.targets,
        floors: question.floors,
        most: 0,
        prime: false,
    };
    let mut q = state.q.clone();
    frozen_misfit(network, &frozen, &state.x, &state.w, &mut q, scratch)
}

/// The point at which the equations themselves, without help, are nearest to being satisfied.
struct Best {
    misfit: f64,
    rows: Vec<(usize, f64, f64)>,
    x: Vec<f64>,
}

impl Best {
    fn new(network: &Network) -> Best {
        Best { misfit: f64::INFINITY, rows: vec![], x: vec![f64::NAN; network.system.equations()] }
    }

    fn see(
        &mut self,
        network: &mut Network,
        question: &Question,
        state: &State,
        scratch: &mut Scratch,
    ) {
        const MOST: usize = 3;
        let rows = misfit(network, question, state, scratch);
        let misfit = rows.first().map_or(0.0, |(_, left, size)| left.abs() / size);
        if misfit < self.misfit {
            self.misfit = misfit;
            self.rows = rows.into_iter().take(MOST).collect();
            self.x.copy_from_slice(&state.x);
        }
    }
}
