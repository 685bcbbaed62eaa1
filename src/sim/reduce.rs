//! Dependent storages: where charges are tied to each other by a constant linear constraint, one of them is no state.
//!
//! A null vector (y, z) of the transposed frozen network says y·A = 0 and y·G + z·C = 0, so that z·Q = −y·b for ever.
//! With b constant in those equations, z·dQ/dt = 0: the rate of one such charge becomes an unknown w with this row, and
//! the circuit is of index 1 again (two inertias on one gear; capacitors in parallel through an ideal transformer).
//! Where b moves or laws take part, nothing is changed: the run then treats the circuit as one of index 2.
//!
//! Only rows with a constant b and without laws are looked at, and of those none that alone speaks of some unknown: its
//! factor is 0 in every null vector. What remains, mostly nothing, goes through one elimination.

use crate::linear::relations::{Relations, Taken};
use std::cmp::Reverse;

/// A linear circuit's parts as triplets, as far as the reduction needs them.
pub(crate) struct Parts<'a> {
    /// Number of equations.
    pub n: usize,
    pub conductances: &'a [(u32, u32, f64)],
    /// (charge, unknown, factor)
    pub charges: &'a [(u32, u32, f64)],
    /// (charge, equation, factor)
    pub rates: &'a [(u32, u32, f64)],
    /// Charges that are no states already, and those with laws.
    pub dependent: &'a [bool],
    pub curved: &'a [bool],
    /// For each equation b, where it never changes and no law takes part.
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
/// A constraint of more rows than this is left to the run.
const LONGEST: usize = 64;
/// How often rows that alone speak of some unknown are looked for.
const ROUNDS: usize = 32;
/// Multiplications that the elimination may take; what it has found until then is used.
const MULTIPLICATIONS: usize = 20_000_000;
const NONE: u32 = u32::MAX;

/// A circuit's constraints that can be used, each with a charge of its own.
pub(crate) fn constraints(parts: &Parts) -> Vec<Constraint> {
    let rows = kernel(parts);
    let mut relations = Relations::new(
        parts.n + parts.dependent.len(),
        rows.iter().map(|(_, entries)| entries.as_slice()),
        MULTIPLICATIONS,
    );
    let mut found: Vec<Vec<(u32, f64)>> = vec![];
    for (_, entries) in &rows {
        match relations.take(entries) {
            Taken::Relation(relation) if relation.len() <= LONGEST => {
                let relation = relation.iter().map(|(at, y)| (rows[*at as usize].0, *y));
                found.extend(usable(parts, &relation.collect::<Vec<_>>()));
            }
            Taken::Enough => break,
            Taken::Relation(_) | Taken::Independent(_) | Taken::Unclear => {}
        }
    }
    // Each is solved for a charge of its own, such that all are solved for at once.
    found.sort_by_key(Vec::len);
    let all = found.iter().map(Vec::as_slice);
    let mut pivots = Relations::new(parts.dependent.len(), all, MULTIPLICATIONS).level();
    let solved = found.into_iter().filter_map(|factors| match pivots.take(&factors) {
        Taken::Independent(charge) => Some(Constraint { charge, factors }),
        Taken::Relation(_) | Taken::Unclear | Taken::Enough => None,
    });
    solved.collect()
}

/// Rows (equations, then charges) that may take part in a constraint, in the order in which they are to be eliminated:
/// charges first, so that constraints are short, of those the large ones, which then are states.
fn kernel(parts: &Parts) -> Vec<(u32, Vec<(u32, f64)>)> {
    let (n, count) = (parts.n, parts.dependent.len());
    let of_charge = |k: usize| !parts.curved[k] && !parts.dependent[k];
    let mut takes_part: Vec<bool> =
        parts.constant.iter().map(Option::is_some).chain((0..count).map(of_charge)).collect();
    let conductances = parts.conductances.iter().copied();
    let rates = parts.rates.iter().map(|(k, row, factor)| (*row, n as u32 + k, *factor));
    let charges = parts.charges.iter().map(|(k, column, value)| (n as u32 + k, *column, *value));
    let mut entries: Vec<(u32, u32, f64)> = vec![];
    let mut only: Vec<u32> = vec![];
    for round in 0..ROUNDS {
        if !takes_part[n..].contains(&true) {
            return vec![];
        }
        const SEVERAL: u32 = NONE - 1;
        only.clear();
        only.resize(n + count, NONE);
        let mut see = |(row, column, value): (u32, u32, f64)| {
            if takes_part[row as usize] && value != 0.0 {
                let known = &mut only[column as usize];
                *known = if *known == NONE || *known == row { row } else { SEVERAL };
            }
        };
        if round == 0 {
            conductances.clone().chain(rates.clone()).chain(charges.clone()).for_each(&mut see);
        } else {
            entries.iter().copied().for_each(&mut see);
        }
        let mut any = false;
        for row in only.iter().filter(|row| **row < SEVERAL) {
            takes_part[*row as usize] = false;
            any = true;
        }
        if round == 0 {
            let all = conductances.clone().chain(rates.clone()).chain(charges.clone());
            entries = all.filter(|(row, ..)| takes_part[*row as usize]).collect();
        } else {
            entries.retain(|(row, ..)| takes_part[*row as usize]);
        }
        if !any {
            break;
        }
    }
    let mut rows = summed(entries);
    rows.sort_by_cached_key(|(row, entries)| {
        let largest = entries.iter().fold(0.0f64, |most, (_, value)| most.max(value.abs()));
        // Bits of numbers that are not negative are ordered as these are.
        ((*row as usize) < n, entries.len(), Reverse(largest.to_bits()), *row)
    });
    rows
}

/// Entries row by row, those of one place added up, and left out where nothing but rounding is left.
fn summed(mut entries: Vec<(u32, u32, f64)>) -> Vec<(u32, Vec<(u32, f64)>)> {
    entries.sort_by_key(|(row, column, _)| (*row, *column));
    let mut rows: Vec<(u32, Vec<(u32, f64)>)> = vec![];
    for of_row in entries.chunk_by(|a, b| a.0 == b.0) {
        let mut sums = vec![];
        for of_place in of_row.chunk_by(|a, b| a.1 == b.1) {
            let sum: f64 = of_place.iter().map(|entry| entry.2).sum();
            let largest = of_place.iter().fold(0.0f64, |most, entry| most.max(entry.2.abs()));
            if sum.abs() > of_place.len() as f64 * f64::EPSILON * largest {
                sums.push((of_place[0].1, sum));
            }
        }
        rows.push((of_row[0].0, sums));
    }
    rows
}

/// The factors of the charges in a null vector, if the initial charges satisfy its constraint.
fn usable(parts: &Parts, vector: &[(u32, f64)]) -> Option<Vec<(u32, f64)>> {
    let n = parts.n as u32;
    let mut factors: Vec<(u32, f64)> = vec![];
    let (mut sum, mut size) = (0.0f64, 0.0f64);
    for (row, y) in vector {
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
    factors.iter_mut().for_each(|(_, z)| *z /= largest);
    Some(factors)
}
