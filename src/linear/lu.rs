//! LU factors of a fixed pattern that are made again and again with new values.
//!
//! ```text
//! P·(R·A·C)·Q = L·U       R, C: powers of two; L has a unit diagonal
//! ```
//!
//! [`Lu::factor`] chooses P and Q for given values; [`Lu::refactor`] replays that elimination as a flat program: every
//! place is an index that was worked out once, nothing is searched for and nothing allocated. A replay with pivots that
//! have become bad for the new values ends with [`Trouble`].

use super::choose::{choose_pivots, equilibrate};
use super::flat::Flat;
use super::pivots::{Cause, Elimination, Singular};
use super::{Field, Pattern};

/// Up to this many unknowns pivots are chosen by Markowitz's rule.
pub const SMALL: usize = 2000;
/// Up to this many multiplications the replay is a flat list of them, above it goes column by column through a dense one.
const LISTED: usize = 100_000;
/// A pivot may shrink by this much relative to the entries below it, or to its whole column, before a replay is refused.
const GUARD_BELOW: f64 = 1e-3;
const GUARD_COLUMN: f64 = 1e-5;
/// Growth of entries beyond that of the first factorisation at which a replay is refused.
const GUARD_GROWTH: f64 = 1e4;

/// Why a replay was refused; the factors are unusable until the next success. `row` and `column` are those of the pivot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Trouble {
    /// The pivot is too small beside its column.
    Pivot { row: u32, column: u32 },
    /// Entries have grown out of proportion.
    Growth,
    /// A value is infinite or NaN.
    NotFinite { row: u32, column: u32 },
}

/// The factors of a matrix.
#[derive(Clone, Debug)]
pub struct Lu<T> {
    n: usize,
    /// Row and column of the matrix at each place of the order.
    rows: Vec<u32>,
    columns: Vec<u32>,
    /// Powers of two for the matrix's rows and columns, in the same order.
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
    /// The factors, column after column: above the diagonal, diagonal, below.
    factors: Vec<T>,
    /// Place (in the order) of the row of each entry.
    index: Vec<u32>,
    starts: Vec<u32>,
    diagonal: Vec<u32>,
    /// 1/pivot.
    inverse: Vec<T>,
    /// Where each slot of the pattern goes, and what it is multiplied by.
    place: Vec<u32>,
    scale: Vec<f64>,
    /// The flat program: after each pivot, factors[a] −= factors[b]·factors[c] for each [a, b, c].
    program: Vec<[u32; 3]>,
    /// What each pivot's part of the program is; empty where there is none.
    program_starts: Vec<u32>,
    /// The factors as solving takes them, when there is a program.
    flat: Option<Flat<T>>,
    /// One column, when there is no program.
    dense: Vec<T>,
    operations: usize,
    /// Magnitudes of the diagonal as loaded, as bits.
    loaded: Vec<u64>,
    /// The least allowed ratio of each pivot to the largest entry below it, and to the largest of its column.
    floors: Vec<(f64, f64)>,
    growth: f64,
    /// Whether the order is an odd permutation of rows against columns.
    odd: bool,
}

impl<T: Field> Lu<T> {
    /// Chooses an order and pivots for these values and factors them.
    pub fn factor(pattern: &Pattern, values: &[T]) -> Result<Lu<T>, Singular> {
        Lu::factor_with(pattern, values, pattern.n <= SMALL)
    }

    fn factor_with(pattern: &Pattern, values: &[T], small: bool) -> Result<Lu<T>, Singular> {
        for j in 0..pattern.n {
            if let Some(slot) = pattern.column(j).find(|&slot| !values[slot].is_finite()) {
                return Err(Singular {
                    cause: Cause::NotFinite,
                    rows: vec![vec![pattern.rows[slot]]],
                    columns: vec![vec![j as u32]],
                });
            }
        }
        let (row_scale, column_scale) = equilibrate(pattern, values);
        let mut scale = vec![1.0; pattern.len()];
        for (j, by) in column_scale.iter().enumerate() {
            for slot in pattern.column(j) {
                scale[slot] = row_scale[pattern.rows[slot] as usize] * by;
            }
        }
        let scaled: Vec<T> = values.iter().zip(&scale).map(|(v, by)| v.scaled(*by)).collect();
        let elimination = choose_pivots(pattern, &scaled, small)?;
        let mut lu = Lu::lay_out(pattern, &elimination, &row_scale, &column_scale, scale);
        match lu.replay(values, false) {
            Ok(()) => Ok(lu),
            Err(Trouble::Pivot { row, column } | Trouble::NotFinite { row, column }) => {
                Err(Singular {
                    cause: Cause::Numeric,
                    rows: vec![vec![row]],
                    columns: vec![vec![column]],
                })
            }
            Err(Trouble::Growth) => {
                Err(Singular { cause: Cause::Numeric, rows: vec![], columns: vec![] })
            }
        }
    }

    /// Factors new values of the same pattern with the same pivots.
    pub fn refactor(&mut self, values: &[T]) -> Result<(), Trouble> {
        if self.replay_quickly(values) { Ok(()) } else { self.replay(values, true) }
    }

    /// Solves A·x = b in place; `work` has `n` elements and is overwritten.
    pub fn solve(&self, b: &mut [T], work: &mut [T]) {
        if let Some(flat) = &self.flat {
            return flat.solve(b, work);
        }
        for ((w, &row), &by) in work.iter_mut().zip(&self.rows).zip(&self.row_scale) {
            *w = b[row as usize].scaled(by);
        }
        for k in 0..self.n {
            let x = work[k];
            let below = self.diagonal[k] as usize + 1..self.starts[k + 1] as usize;
            for (&i, &l) in self.index[below.clone()].iter().zip(&self.factors[below]) {
                work[i as usize] = work[i as usize] - l * x;
            }
        }
        for k in (0..self.n).rev() {
            let x = work[k] * self.inverse[k];
            work[k] = x;
            let above = self.starts[k] as usize..self.diagonal[k] as usize;
            for (&i, &u) in self.index[above.clone()].iter().zip(&self.factors[above]) {
                work[i as usize] = work[i as usize] - u * x;
            }
        }
        for ((&w, &column), &by) in work.iter().zip(&self.columns).zip(&self.column_scale) {
            b[column as usize] = w.scaled(by);
        }
    }

    /// Solves Aᵀ·x = b in place; `work` has `n` elements and is overwritten.
    pub fn solve_transposed(&self, b: &mut [T], work: &mut [T]) {
        for ((w, &column), &by) in work.iter_mut().zip(&self.columns).zip(&self.column_scale) {
            *w = b[column as usize].scaled(by);
        }
        for k in 0..self.n {
            let above = self.starts[k] as usize..self.diagonal[k] as usize;
            let mut sum = work[k];
            for (&i, &u) in self.index[above.clone()].iter().zip(&self.factors[above]) {
                sum = sum - u * work[i as usize];
            }
            work[k] = sum * self.inverse[k];
        }
        for k in (0..self.n).rev() {
            let below = self.diagonal[k] as usize + 1..self.starts[k + 1] as usize;
            let mut sum = work[k];
            for (&i, &l) in self.index[below.clone()].iter().zip(&self.factors[below]) {
                sum = sum - l * work[i as usize];
            }
            work[k] = sum;
        }
        for ((&w, &row), &by) in work.iter().zip(&self.rows).zip(&self.row_scale) {
            b[row as usize] = w.scaled(by);
        }
    }

    /// One step of iterative refinement of A·x = b: `x` is improved, the largest |b − A·x|ᵢ / (|A|·|x| + |b|)ᵢ that it
    /// had *before* is returned. `residual` and `work` have `n` elements and are overwritten.
    pub fn refine(
        &self,
        pattern: &Pattern,
        values: &[T],
        b: &[T],
        x: &mut [T],
        residual: &mut [T],
        work: &mut [T],
    ) -> f64 {
        let error = backward_error(pattern, values, b, x, residual);
        self.solve(residual, work);
        for (x, &d) in x.iter_mut().zip(residual.iter()) {
            *x = *x + d;
        }
        error
    }

    /// The same factors, replayed column by column as large ones are.
    #[cfg(test)]
    pub(super) fn without_program(mut self) -> Lu<T> {
        self.program_starts.clear();
        self.flat = None;
        self.dense = vec![T::ZERO; self.n];
        self
    }

    #[cfg(test)]
    pub(super) fn is_finite(&self) -> bool {
        self.factors.iter().chain(&self.inverse).all(|value| value.is_finite())
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of entries of both factors.
    pub fn entries(&self) -> usize {
        self.factors.len()
    }

    /// Multiplications of one replay.
    pub fn operations(&self) -> usize {
        self.operations
    }

    /// Rows and columns of the matrix in the order in which they are eliminated.
    pub fn order(&self) -> [&[u32]; 2] {
        [&self.rows, &self.columns]
    }

    /// Whether the order takes an odd number of swaps of rows and columns.
    pub fn is_odd(&self) -> bool {
        self.odd
    }

    /// Powers of two for rows and columns, in the same order.
    pub(super) fn scales(&self) -> [&[f64]; 2] {
        [&self.row_scale, &self.column_scale]
    }

    /// The least ratio of each pivot to the largest entry below it and to the largest of its column, and the growth of
    /// entries that is allowed.
    pub(super) fn guards(&self) -> (&[(f64, f64)], f64) {
        (&self.floors, GUARD_GROWTH * self.growth)
    }

    /// The factors as solving takes them, where they are few.
    pub(super) fn flat(&self) -> Option<&Flat<T>> {
        self.flat.as_ref()
    }

    /// The pivots in the order of elimination, those of the scaled matrix.
    pub fn pivots(&self) -> impl Iterator<Item = T> + '_ {
        self.diagonal.iter().map(|at| self.factors[*at as usize])
    }

    /// Works out all places for an elimination.
    fn lay_out(
        pattern: &Pattern,
        elimination: &Elimination<T>,
        row_scale: &[f64],
        column_scale: &[f64],
        scale: Vec<f64>,
    ) -> Lu<T> {
        let n = pattern.n;
        let mut place_of_row = vec![0u32; n];
        for (k, &row) in elimination.rows.iter().enumerate() {
            place_of_row[row as usize] = k as u32;
        }
        let entries = elimination.upper.index.len() + n + elimination.lower.index.len();
        let mut index: Vec<u32> = Vec::with_capacity(entries);
        let mut starts = vec![0u32];
        let mut diagonal = Vec::with_capacity(n);
        let mut place = vec![0u32; pattern.len()];
        let mut where_is = vec![0u32; n];
        for k in 0..n {
            let start = index.len();
            index.extend(elimination.upper.entries(k).map(|(i, _)| i));
            index.extend(elimination.lower.entries(k).map(|(row, _)| place_of_row[row as usize]));
            index.push(k as u32);
            index[start..].sort_unstable();
            for (at, &i) in index.iter().enumerate().skip(start) {
                where_is[i as usize] = at as u32;
            }
            diagonal.push(where_is[k]);
            for slot in pattern.column(elimination.columns[k] as usize) {
                place[slot] = where_is[place_of_row[pattern.rows[slot] as usize] as usize];
            }
            starts.push(index.len() as u32);
        }
        let below = |k: u32| diagonal[k as usize] as usize + 1..starts[k as usize + 1] as usize;
        let above = |k: usize| starts[k] as usize..diagonal[k] as usize;
        let operations: usize =
            (0..n).flat_map(|k| &index[above(k)]).map(|&k| below(k).len()).sum();
        let mut program = Vec::new();
        let mut program_starts = Vec::new();
        let mut flat = None;
        let scales = [
            elimination.rows.iter().map(|row| row_scale[*row as usize]).collect::<Vec<f64>>(),
            elimination.columns.iter().map(|k| column_scale[*k as usize]).collect(),
        ];
        if operations <= LISTED {
            let entries = |k: usize, part: std::ops::Range<usize>| {
                let index = &index;
                part.map(move |at| [index[at], k as u32, at as u32])
            };
            flat = Flat::new(
                [&elimination.rows, &elimination.columns],
                [&scales[0], &scales[1]],
                (0..n).flat_map(|k| entries(k, below(k as u32))),
                (0..n).rev().flat_map(|k| entries(k, above(k))),
            );
            // Column by column in the order in which pivots come, then sorted by pivot: within one pivot's part no
            // two targets are the same, so that nothing waits for the number stored just before.
            let mut parts: Vec<Vec<[u32; 3]>> = vec![Vec::new(); n];
            for k in 0..n {
                let column = starts[k] as usize..starts[k + 1] as usize;
                for (at, &i) in index[column.clone()].iter().enumerate() {
                    where_is[i as usize] = starts[k] + at as u32;
                }
                for (at, &source) in column.zip(&index[above(k)]) {
                    parts[source as usize].extend(
                        below(source).map(|l| [where_is[index[l] as usize], l as u32, at as u32]),
                    );
                }
            }
            program_starts.push(0);
            for part in parts {
                program.extend(part);
                program_starts.push(program.len() as u32);
            }
        }
        let [row_scale, column_scale] = scales;
        Lu {
            n,
            rows: elimination.rows.clone(),
            columns: elimination.columns.clone(),
            row_scale,
            column_scale,
            factors: vec![T::ZERO; entries],
            flat,
            dense: vec![T::ZERO; if program_starts.is_empty() { n } else { 0 }],
            loaded: vec![0; n],
            index,
            starts,
            diagonal,
            inverse: vec![T::ZERO; n],
            place,
            scale,
            program,
            program_starts,
            operations,
            floors: vec![(0.0, 0.0); n],
            growth: 1.0,
            odd: is_odd(&elimination.rows) != is_odd(&elimination.columns),
        }
    }

    /// Puts the scaled values in their places. Gives the largest magnitude, as bits.
    fn load(&mut self, values: &[T]) -> u64 {
        self.factors.fill(T::ZERO);
        let mut largest = 0;
        for ((&at, &by), &value) in self.place.iter().zip(&self.scale).zip(values) {
            let value = value.scaled(by);
            largest = largest.max(bits(value));
            self.factors[at as usize] = value;
        }
        for (loaded, &at) in self.loaded.iter_mut().zip(&self.diagonal) {
            *loaded = bits(self.factors[at as usize]);
        }
        largest
    }

    /// The elimination with these values. Unguarded, it sets the guards for later ones.
    fn replay(&mut self, values: &[T], guarded: bool) -> Result<(), Trouble> {
        let before = self.load(values);
        let mut after = before;
        for k in 0..self.n {
            if self.program_starts.is_empty() {
                self.make_column(k);
            }
            self.pivot(k, guarded, &mut after)?;
            if let [start, end, ..] = self.program_starts[k.min(self.program_starts.len())..] {
                let factors = &mut self.factors[..];
                for &[a, b, c] in &self.program[start as usize..end as usize] {
                    factors[a as usize] =
                        factors[a as usize] - factors[b as usize] * factors[c as usize];
                }
            }
        }
        if let Some(flat) = &mut self.flat {
            flat.load(&self.factors, &self.inverse, &self.floors);
        }
        if !T::EXACT && after > 0 {
            let growth = f64::from_bits(after) / f64::from_bits(before);
            if !guarded {
                self.growth = growth;
            } else if growth > GUARD_GROWTH * self.growth {
                return Err(Trouble::Growth);
            }
        }
        Ok(())
    }

    /// The same for small matrices, judged at its end as a whole. Says whether all is well; if not, the careful way says
    /// why.
    fn replay_quickly(&mut self, values: &[T]) -> bool {
        if T::EXACT || self.flat.is_none() {
            return false;
        }
        let before = f64::from_bits(self.load(values));
        let Lu { flat: Some(flat), factors, inverse, .. } = self else { return false };
        let parts = self.program_starts.windows(2).zip(&self.starts[1..]);
        let pivots = self.diagonal.iter().zip(inverse.iter_mut());
        for ((&at, inverse), (part, &end)) in pivots.zip(parts) {
            *inverse = T::ONE / factors[at as usize];
            for below in &mut factors[at as usize + 1..end as usize] {
                *below = *below * *inverse;
            }
            for &[a, b, c] in &self.program[part[0] as usize..part[1] as usize] {
                factors[a as usize] =
                    factors[a as usize] - factors[b as usize] * factors[c as usize];
            }
        }
        let mut seen = flat.load(factors, inverse, &self.floors);
        let pivots = inverse.iter().zip(&self.loaded).zip(&self.floors);
        for ((inverse, &loaded), (_, floor)) in pivots {
            let (inverse, loaded) = (inverse.magnitude(), f64::from_bits(loaded));
            seen.take(loaded * inverse * floor, loaded.max(inverse.recip()));
        }
        // Where nothing passes its pivot's bound, neither does what stood there before the division.
        seen.worst <= 1.0 && seen.largest <= GUARD_GROWTH * self.growth * before
    }

    /// Subtracts from a column all that the pivots before it take out of it.
    fn make_column(&mut self, k: usize) {
        let (start, diagonal) = (self.starts[k] as usize, self.diagonal[k] as usize);
        let (done, column) = self.factors.split_at_mut(start);
        let column = &mut column[..self.starts[k + 1] as usize - start];
        let index = &self.index[start..start + column.len()];
        for (&i, &value) in index.iter().zip(column.iter()) {
            self.dense[i as usize] = value;
        }
        for &source in &index[..diagonal - start] {
            let source = source as usize;
            let u = self.dense[source];
            let below = self.diagonal[source] as usize + 1..self.starts[source + 1] as usize;
            for (&i, &l) in self.index[below.clone()].iter().zip(&done[below]) {
                self.dense[i as usize] = self.dense[i as usize] - l * u;
            }
        }
        for (&i, value) in index.iter().zip(column.iter_mut()) {
            *value = self.dense[i as usize];
        }
    }

    /// Looks at a finished column and divides what is below its pivot.
    fn pivot(&mut self, k: usize, guarded: bool, after: &mut u64) -> Result<(), Trouble> {
        let diagonal = self.diagonal[k] as usize;
        let column = &mut self.factors[self.starts[k] as usize..self.starts[k + 1] as usize];
        let (above, below) = column.split_at_mut(diagonal - self.starts[k] as usize);
        let [pivot, below @ ..] = below else { return Ok(()) };
        let (row, column) = (self.rows[k], self.columns[k]);
        if pivot.is_zero() {
            return Err(Trouble::Pivot { row, column });
        }
        let inverse = T::ONE / *pivot;
        if !T::EXACT {
            let (size, under) = (bits(*pivot), largest(below));
            let whole = largest(above).max(under).max(size).max(self.loaded[k]);
            if whole >= INFINITE {
                return Err(Trouble::NotFinite { row, column });
            }
            *after = (*after).max(whole);
            let [size, under, whole] = [size, under, whole].map(f64::from_bits);
            if !(under * inverse.magnitude()).is_finite() || !inverse.is_finite() {
                return Err(Trouble::Pivot { row, column });
            }
            let (floor_under, floor_whole) = &mut self.floors[k];
            if !guarded {
                *floor_under = GUARD_BELOW * (size / under).min(1.0);
                *floor_whole = GUARD_COLUMN * (size / whole).min(1.0);
            } else if size < *floor_under * under || size < *floor_whole * whole {
                return Err(Trouble::Pivot { row, column });
            }
        }
        self.inverse[k] = inverse;
        for l in below {
            *l = *l * inverse;
        }
        Ok(())
    }
}

impl Lu<f64> {
    /// Whether the determinant is negative.
    pub fn is_negative(&self) -> bool {
        self.odd != has_odd_signs(&self.inverse)
    }

    /// The same for factors in this order whose pivots have these inverses.
    pub(super) fn is_negative_with(&self, inverse: &[f64]) -> bool {
        self.odd != has_odd_signs(inverse)
    }
}

/// Whether an odd number of values is negative.
fn has_odd_signs(values: &[f64]) -> bool {
    values.iter().filter(|value| **value < 0.0).count() % 2 == 1
}

/// Whether a permutation is made of an odd number of swaps.
fn is_odd(order: &[u32]) -> bool {
    let mut seen = vec![false; order.len()];
    let mut odd = false;
    for start in 0..order.len() {
        let (mut at, mut length) = (start, 0);
        while !seen[at] {
            seen[at] = true;
            at = order[at] as usize;
            length += 1;
        }
        odd ^= length > 0 && length % 2 == 0;
    }
    odd
}

/// The way of large matrices, for small ones.
#[cfg(test)]
pub(super) fn factor_by_columns<T: Field>(
    pattern: &Pattern,
    values: &[T],
) -> Result<Lu<T>, Singular> {
    Lu::factor_with(pattern, values, false)
}

/// The largest |b − A·x|ᵢ / (|A|·|x| + |b|)ᵢ; `residual` becomes b − A·x.
pub fn backward_error<T: Field>(
    pattern: &Pattern,
    values: &[T],
    b: &[T],
    x: &[T],
    residual: &mut [T],
) -> f64 {
    let mut size: Vec<f64> = b.iter().map(|b| b.magnitude()).collect();
    residual.copy_from_slice(b);
    for (j, &xj) in x.iter().enumerate() {
        for slot in pattern.column(j) {
            let (row, term) = (pattern.rows[slot] as usize, values[slot] * xj);
            residual[row] = residual[row] - term;
            size[row] += term.magnitude();
        }
    }
    let ratio = |(r, s): (&T, &f64)| if r.is_zero() { 0.0 } else { r.magnitude() / s };
    residual.iter().zip(&size).map(ratio).fold(0.0, larger)
}

/// The bits of +∞; those of NaN are larger.
const INFINITE: u64 = 0x7ff0_0000_0000_0000;

/// A magnitude as bits, which are ordered as the numbers are, with infinity and NaN above all.
fn bits<T: Field>(value: T) -> u64 {
    value.magnitude().to_bits() & (u64::MAX >> 1)
}

/// The largest magnitude, as bits.
fn largest<T: Field>(values: &[T]) -> u64 {
    values.iter().fold(0, |largest, &value| largest.max(bits(value)))
}

/// The larger; NaN where there is one.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_orders() {
        assert!(!is_odd(&[0, 1, 2]) && is_odd(&[1, 0, 2]) && !is_odd(&[1, 2, 0]));
    }
}
