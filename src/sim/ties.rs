//! Storages that an operating point leaves open: a node that only capacitors hold, a loop of inductors and voltage sources.
//!
//! There no equation says what the stored charges are, but what can never change says it: of a node held by capacitors
//! alone the sum of the charges on it, of a loop of inductors the flux through it. A null vector (y, z) of the transposed
//! frozen matrix gives this sum, Σ zₖ·Qₖ over the charges at rest, which keeps its initial value. One of these charges is
//! then held, at such a value that the sum comes out right; the others come to rest.

use super::network::Network;
use super::newton::{Cut, Scratch};
use super::op::State;
use crate::linear::{Pattern, Singular, eliminate};

/// A sum of charges that keeps its value.
#[derive(Clone, Debug)]
pub(crate) struct Tie {
    /// The charge that is held for it.
    pub charge: usize,
    /// The charges in the sum, with their factors.
    pub factors: Vec<(usize, f64)>,
    /// Nodes and branches that the equations left open, as unknowns.
    pub open: Vec<u32>,
}

/// More ties than these are not adjusted: their charges keep their own initial values.
const MOST: usize = 64;

/// Holds one more charge for each set of equations that depend on each other, if there is one to hold. Says whether any was.
pub(crate) fn hold_more(
    network: &Network,
    singular: &Singular,
    scratch: &Scratch,
    held: &mut [bool],
    ties: &mut Vec<Tie>,
) -> bool {
    let system = network.system;
    let n = system.equations() as u32;
    let before = ties.len();
    let is_open = |k: usize, columns: &Vec<u32>| {
        system.charges.row(k).any(|(unknown, _)| columns.contains(&(unknown as u32)))
    };
    for rows in &singular.rows {
        let candidates = || {
            let charges = rows.iter().filter(|row| **row >= n).map(|row| (row - n) as usize);
            charges.filter(|k| system.held[*k] && !held[*k])
        };
        let vector = network.frozen_null_vector(rows);
        let factor = |k: usize| match &vector {
            Some(vector) => {
                rows.iter().position(|row| *row == n + k as u32).map_or(0.0, |at| vector[at])
            }
            None => 1.0,
        };
        // The charge that says most of what is open: the largest in the sum, so that the others follow it gently.
        let weight = |k: usize| {
            let open = singular.columns.iter().any(|columns| is_open(k, columns));
            let size = system.charges.row(k).fold(0.0f64, |most, (_, value)| most.max(value.abs()));
            (open || system.curved[k], factor(k).abs() * size)
        };
        let mut best: Option<(usize, (bool, f64))> = None;
        for k in candidates() {
            let own = weight(k);
            if best.is_none_or(|(_, other)| own > other) {
                best = Some((k, own));
            }
        }
        let Some((charge, _)) = best else { continue };
        let factors = match &vector {
            Some(vector) if !is_driven(rows, vector, scratch) => {
                candidates().map(|k| (k, factor(k))).collect()
            }
            // An integrator that a source moves keeps its own value, and will go on from there.
            _ => vec![(charge, 1.0)],
        };
        let columns = singular.columns.iter().find(|columns| is_open(charge, columns));
        let open = columns.or(singular.columns.first()).cloned().unwrap_or_default();
        ties.push(Tie { charge, factors, open });
        held[charge] = true;
    }
    ties.len() > before
}

/// Whether sources move the sum of charges, so that it keeps no value: y·b is not 0.
fn is_driven(rows: &[u32], vector: &[f64], scratch: &Scratch) -> bool {
    let (mut sum, mut size) = (0.0, 0.0);
    for (row, y) in rows.iter().zip(vector) {
        if let (Some(left), Some(terms)) =
            (scratch.residual.get(*row as usize), scratch.sizes.get(*row as usize))
        {
            sum += y * left;
            size += (y * terms).abs();
        }
    }
    sum.abs() > 1e-9 * size
}

/// What each sum is off by.
fn misfits(ties: &[Tie], state: &State, initial: &[f64]) -> Vec<f64> {
    let sum = |tie: &Tie| tie.factors.iter().map(|(k, z)| z * (state.q[*k] - initial[*k])).sum();
    ties.iter().map(sum).collect()
}

/// Moves the targets of the charges that are held until the sums have their initial values; `solve` finds the values of the
/// circuit for given targets. Where that fails the charges keep their own initial values.
pub(crate) fn settle(
    network: &mut Network,
    ties: &[Tie],
    initial: &[f64],
    state: &mut State,
    mut solve: impl FnMut(&mut Network, &[f64], &mut State) -> Result<(), Cut>,
) {
    const ROUNDS: u32 = 12;
    let several = ties.iter().any(|tie| tie.factors.len() > 1);
    if !several || ties.len() > MOST {
        return;
    }
    let kept = state.clone();
    let m = ties.len();
    let mut targets = initial.to_vec();
    for _ in 0..ROUNDS {
        let misfit = misfits(ties, state, initial);
        let settled = ties.iter().zip(&misfit).all(|(tie, misfit)| {
            let size = |(k, z): &(usize, f64)| (z * state.q[*k]).abs() + (z * initial[*k]).abs();
            let size: f64 = tie.factors.iter().map(size).sum();
            misfit.abs() <= 1e-12 * size
        });
        if settled {
            return;
        }
        // Columns of the matrix: what a change of each target does to the sums.
        let mut matrix = vec![0.0; m * m];
        let base = state.clone();
        for (column, tie) in ties.iter().enumerate() {
            let charge = network.system.charges.row(tie.charge);
            let volt = charge.fold(0.0f64, |most, (_, value)| most.max(value.abs()));
            let change = (1e-3 * base.q[tie.charge].abs()).max(volt).max(f64::MIN_POSITIVE);
            let mut moved = targets.clone();
            moved[tie.charge] += change;
            state.copy_from(&base);
            if solve(network, &moved, state).is_err() {
                state.copy_from(&kept);
                return;
            }
            let there = misfits(ties, state, initial);
            for (row, (there, here)) in there.iter().zip(&misfit).enumerate() {
                matrix[row * m + column] = (there - here) / change;
            }
        }
        let mut step = misfit;
        if !eliminate(m, &mut matrix, 1, &mut step) {
            state.copy_from(&kept);
            return;
        }
        for (tie, step) in ties.iter().zip(step) {
            targets[tie.charge] -= step;
        }
        state.copy_from(&base);
        if solve(network, &targets, state).is_err() {
            state.copy_from(&kept);
            return;
        }
    }
}

/// The one combination of these rows that vanishes, by elimination with full pivoting.
pub(super) fn null_vector(set: &[u32], pattern: &Pattern, matrix: &[f64]) -> Option<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = vec![];
    for j in 0..pattern.n {
        let mut column = vec![0.0; set.len()];
        for slot in pattern.column(j) {
            if let Some(at) = set.iter().position(|row| *row == pattern.rows[slot]) {
                column[at] = matrix[slot];
            }
        }
        let largest = column.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        if largest > 0.0 {
            columns.push(column.iter().map(|v| v / largest).collect());
        }
    }
    // Each column is an equation for y. Gauss-Jordan; one unknown must be left over.
    let count = set.len();
    let mut pivots: Vec<(usize, usize)> = vec![];
    loop {
        let mut best = (1e-9, 0, 0);
        for (e, equation) in columns.iter().enumerate() {
            if pivots.iter().any(|(used, _)| *used == e) {
                continue;
            }
            for (u, value) in equation.iter().enumerate() {
                if value.abs() > best.0 && pivots.iter().all(|(_, taken)| *taken != u) {
                    best = (value.abs(), e, u);
                }
            }
        }
        if best.0 <= 1e-9 {
            break;
        }
        let (e, u) = (best.1, best.2);
        let pivot: Vec<f64> = columns[e].iter().map(|v| v / columns[e][u]).collect();
        for (other, equation) in columns.iter_mut().enumerate() {
            let factor = equation[u];
            if other != e && factor != 0.0 {
                for (value, p) in equation.iter_mut().zip(&pivot) {
                    *value -= factor * p;
                }
            }
        }
        columns[e] = pivot;
        pivots.push((e, u));
    }
    if pivots.len() + 1 != count {
        return None;
    }
    let free = (0..count).find(|u| pivots.iter().all(|(_, taken)| taken != u))?;
    let mut y = vec![0.0; count];
    y[free] = 1.0;
    for (e, u) in pivots {
        y[u] = -columns[e][free];
    }
    Some(y)
}
