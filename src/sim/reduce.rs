//! Dependent storages: where charges are tied to each other by a constant linear constraint, one of them is no state.
//!
//! A null vector (y, z) of the transposed frozen network says y·A = 0 and y·G + z·C = 0, so that z·Q = −y·b for ever.
//! With b constant in those equations, z·dQ/dt = 0: the rate of one such charge becomes an unknown w with this row, and
//! the circuit is of index 1 again (two inertias on one gear; capacitors in parallel through an ideal transformer).
//! Where b moves or laws take part, nothing is changed: the run then treats the circuit as one of index 2.

use crate::linear::{Lu, Pattern};

/// A linear circuit's parts as triplets, as far as the reduction needs them.
pub(crate) struct Parts<'a> {
    /// Number of equations.
    pub n: usize,
    pub conductances: &'a [(u32, u32, f64)],
    /// (equation, unknown) of the laws.
    pub slopes: &'a [(u32, u32)],
    /// (charge, unknown, factor)
    pub charges: &'a [(u32, u32, f64)],
    /// (charge, equation, factor)
    pub rates: &'a [(u32, u32, f64)],
    /// Charges that are no states already, and those with laws.
    pub dependent: &'a [bool],
    pub curved: &'a [bool],
    /// For each equation b, where it never changes.
    pub constant: &'a [Option<f64>],
    /// Initial charges.
    pub initial: &'a [Option<f64>],
}

/// The constraint Σ zₖ·dQₖ/dt = 0, and the charge that it is solved for.
pub(crate) struct Constraint {
    pub charge: u32,
    pub factors: Vec<(u32, f64)>,
}

/// Initial charges satisfy a constraint when they do to this part of its terms; otherwise they have yet to jump there.
const CONSISTENT: f64 = 1e-9;

/// The next constraint of a circuit, if it has one that can be used.
pub(crate) fn constraint(parts: &Parts) -> Option<Constraint> {
    let n = parts.n;
    let count = parts.dependent.len();
    let mut entries: Vec<(u32, u32)> = vec![];
    let mut values: Vec<f64> = vec![];
    let mut put = |row: usize, column: usize, value: f64| {
        entries.push((row as u32, column as u32));
        values.push(value);
    };
    for (row, column, value) in parts.conductances {
        put(*row as usize, *column as usize, *value);
    }
    for (k, row, factor) in parts.rates {
        put(*row as usize, n + *k as usize, *factor);
    }
    for (k, column, value) in parts.charges.iter().filter(|(k, ..)| !parts.dependent[*k as usize]) {
        put(n + *k as usize, *column as usize, *value);
    }
    for k in (0..count).filter(|k| parts.dependent[*k]) {
        put(n + k, n + k, 1.0);
    }
    // Laws have some slope; which one does not matter, as long as it is in no relation to the rest.
    for (at, (row, column)) in parts.slopes.iter().enumerate() {
        put(*row as usize, *column as usize, 1.0 + 0.618_033_988_75 * (at as f64 + 1.0) % 1.0);
    }
    let (pattern, slots) = Pattern::from_triplets(n + count, &entries);
    let mut matrix = vec![0.0; pattern.len()];
    for (slot, value) in slots.iter().zip(&values) {
        matrix[*slot as usize] += value;
    }
    let singular = Lu::factor(&pattern, &matrix).err()?;
    singular.rows.iter().find_map(|set| usable(parts, set, &pattern, &matrix))
}

/// The constraint that a set of dependent rows makes, if b is constant there, no law takes part, and the initial charges
/// satisfy it.
fn usable(parts: &Parts, set: &[u32], pattern: &Pattern, matrix: &[f64]) -> Option<Constraint> {
    let n = parts.n as u32;
    let lawful = |row: u32| {
        if row < n {
            parts.slopes.iter().all(|(equation, _)| *equation != row)
                && parts.constant[row as usize].is_some()
        } else {
            let k = (row - n) as usize;
            !parts.curved[k] && !parts.dependent[k]
        }
    };
    if set.len() > 64 || !set.iter().all(|row| lawful(*row)) {
        return None;
    }
    let y = null_vector(set, pattern, matrix)?;
    let mut factors: Vec<(u32, f64)> = vec![];
    let (mut sum, mut size) = (0.0f64, 0.0f64);
    for (row, y) in set.iter().zip(&y) {
        let term = if *row < n {
            y * parts.constant[*row as usize]?
        } else {
            factors.push((row - n, *y));
            y * parts.initial[(row - n) as usize].unwrap_or(0.0)
        };
        sum += term;
        size += term.abs();
    }
    if factors.is_empty() || sum.abs() > CONSISTENT * size {
        return None;
    }
    let largest = factors.iter().fold(0.0f64, |most, (_, z)| most.max(z.abs()));
    for (_, z) in &mut factors {
        *z /= largest;
    }
    let (charge, _) = *factors.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(Constraint { charge, factors })
}

/// The one combination of these rows that vanishes, by elimination with full pivoting.
pub(crate) fn null_vector(set: &[u32], pattern: &Pattern, matrix: &[f64]) -> Option<Vec<f64>> {
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
