//! Elimination without fractions, rows and pivots sparse.
//!
//! ```text
//! row_i ← (p/g)·row_i − (a/g)·row_p      p: pivot, a: the entry below it, g = gcd(p, a)
//! ```
//!
//! Only the quotient of two entries of the last row is wanted, so that a row may be divided by whatever all its entries
//! share: that does for sparse rows what dividing by the pivot before the last does in Bareiss's elimination (E. H. Bareiss,
//! *Sylvester's identity and multistep integer-preserving Gaussian elimination*, 1968), and takes out more. Pivots are
//! chosen as Markowitz has it, by what they fill in, counted in terms of polynomials.

use super::symbols::Trouble;
use crate::expr::polynomial::{Polynomial, divisor};

/// Entries by ascending column.
pub type Row = Vec<(u32, Polynomial)>;

/// Products of terms in all of an elimination at most.
const MOST_WORK: usize = 60_000_000;

/// Eliminates all columns but those in `kept` from rows that are one more than these columns; what is left of the last.
///
/// # Errors
/// When a column has no pivot, or polynomials become too large.
pub fn eliminate(mut rows: Vec<Row>, kept: &[u32]) -> Result<Row, Trouble> {
    for row in &mut rows {
        reduce(row)?;
    }
    let mut work = 0;
    while rows.len() > 1 {
        let (r, column) = pivot(&rows, kept).ok_or(Trouble::Singular)?;
        let pivot_row = rows.swap_remove(r);
        let Some(p) = entry(&pivot_row, column).cloned() else { return Err(Trouble::Singular) };
        for row in &mut rows {
            let Some(a) = entry(row, column) else { continue };
            let g = p.gcd(a)?;
            let (own, other) = (p.divided(&g), a.divided(&g));
            let (Some(own), Some(other)) = (own, other) else { return Err(Trouble::TooLarge) };
            work += row.iter().map(|(_, x)| x.len() * own.len()).sum::<usize>();
            work += pivot_row.iter().map(|(_, x)| x.len() * other.len()).sum::<usize>();
            if work > MOST_WORK {
                return Err(Trouble::TooLarge);
            }
            *row = combine(row, &own, &pivot_row, &other, column)?;
            reduce(row)?;
        }
    }
    rows.pop().ok_or(Trouble::Singular)
}

fn entry(row: &Row, column: u32) -> Option<&Polynomial> {
    row.binary_search_by_key(&column, |(own, _)| *own).ok().map(|at| &row[at].1)
}

/// The row and column that fill in least.
fn pivot(rows: &[Row], kept: &[u32]) -> Option<(usize, u32)> {
    let mut below: std::collections::HashMap<u32, (usize, usize)> = Default::default();
    for row in rows {
        for (column, entry) in row {
            let sums = below.entry(*column).or_default();
            *sums = (sums.0 + 1, sums.1 + entry.len());
        }
    }
    let mut best: Option<(usize, usize, u32)> = None;
    for (r, row) in rows.iter().enumerate() {
        let own: usize = row.iter().map(|(_, entry)| entry.len()).sum();
        for (column, entry) in row.iter().filter(|(column, _)| !kept.contains(column)) {
            let (count, terms) = below[column];
            let others = (count - 1) * entry.len() * row.len();
            let cost = (own - entry.len()) * (terms - entry.len()) + others;
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, r, *column));
            }
        }
    }
    best.map(|(_, r, column)| (r, column))
}

/// own·row − other·pivot_row, without the pivot's column.
fn combine(
    row: &Row,
    own: &Polynomial,
    pivot_row: &Row,
    other: &Polynomial,
    column: u32,
) -> Result<Row, Trouble> {
    let mut result = Row::with_capacity(row.len() + pivot_row.len());
    let (mut a, mut b) = (row.iter().peekable(), pivot_row.iter().peekable());
    loop {
        let (at, x, y) = match (a.peek(), b.peek()) {
            (None, None) => return Ok(result),
            (Some((i, x)), Some((j, y))) if i == j => (*i, Some(x), Some(y)),
            (Some((i, x)), Some((j, _))) if i < j => (*i, Some(x), None),
            (_, Some((j, y))) => (*j, None, Some(y)),
            (Some((i, x)), None) => (*i, Some(x), None),
        };
        if x.is_some() {
            a.next();
        }
        if y.is_some() {
            b.next();
        }
        if at == column {
            continue;
        }
        let sum = match (x, y) {
            (Some(x), Some(y)) => own.times(x)?.minus(&other.times(y)?),
            (Some(x), None) => own.times(x)?,
            (None, Some(y)) => other.times(y)?.negate(),
            (None, None) => continue,
        };
        if !sum.is_zero() {
            result.push((at, sum));
        }
    }
}

/// Divides a row by what all its entries share.
fn reduce(row: &mut Row) -> Result<(), Trouble> {
    let entries: Vec<&Polynomial> = row.iter().map(|(_, entry)| entry).collect();
    let shared = divisor(&entries)?;
    if shared.is_zero() || shared.is_one() {
        return Ok(());
    }
    for (_, entry) in row {
        *entry = entry.divided(&shared).ok_or(Trouble::TooLarge)?;
    }
    Ok(())
}
