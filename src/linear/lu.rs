//! LU factors of a fixed pattern that are made again and again with new values.
//!
//! ```text
//! P·(R·A·C)·Q = L·U       R, C: powers of two; L has a unit diagonal
//! ```
//!
//! [`Lu::factor`] chooses P and Q for given values; [`Lu::refactor`] replays that elimination as a flat program: every
//! place is an index that was worked out once, nothing is searched for and nothing allocated. A replay with pivots that
//! have become bad for the new values ends with [`Trouble`].

use super::pivots::{Cause, Elimination, Singular};
use super::{Field, Pattern, degree, gilbert, markowitz, matching};

/// Up to this many unknowns pivots are chosen by Markowitz's rule.
pub const SMALL: usize = 2000;
/// Above this many multiplications the replay goes through a dense column instead of a list of targets.
const LISTED: usize = 4_000_000;
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
    /// Powers of two for the matrix's rows and columns.
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
    /// For each entry above the diagonal in turn, where the entries of that pivot's column of L go in this column.
    targets: Option<Vec<u32>>,
    /// One column, when there are no targets.
    dense: Vec<T>,
    operations: usize,
    /// The least allowed ratio of each pivot to the largest entry below it, and to the largest of its column.
    floors: Vec<(f64, f64)>,
    growth: f64,
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
        let mut lu = Lu::lay_out(pattern, &elimination, row_scale, column_scale, scale);
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
        self.replay(values, true)
    }

    /// Solves A·x = b in place; `work` has `n` elements and is overwritten.
    pub fn solve(&self, b: &mut [T], work: &mut [T]) {
        for (w, &row) in work.iter_mut().zip(&self.rows) {
            *w = b[row as usize].scaled(self.row_scale[row as usize]);
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
        for (&w, &column) in work.iter().zip(&self.columns) {
            b[column as usize] = w.scaled(self.column_scale[column as usize]);
        }
    }

    /// Solves Aᵀ·x = b in place; `work` has `n` elements and is overwritten.
    pub fn solve_transposed(&self, b: &mut [T], work: &mut [T]) {
        for (w, &column) in work.iter_mut().zip(&self.columns) {
            *w = b[column as usize].scaled(self.column_scale[column as usize]);
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
        for (&w, &row) in work.iter().zip(&self.rows) {
            b[row as usize] = w.scaled(self.row_scale[row as usize]);
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
    pub fn order(&self) -> (&[u32], &[u32]) {
        (&self.rows, &self.columns)
    }

    /// Works out all places for an elimination.
    fn lay_out(
        pattern: &Pattern,
        elimination: &Elimination<T>,
        row_scale: Vec<f64>,
        column_scale: Vec<f64>,
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
        let targets = (operations <= LISTED).then(|| {
            let mut targets = Vec::with_capacity(operations);
            for k in 0..n {
                let start = starts[k] as usize;
                for (at, &i) in index[start..starts[k + 1] as usize].iter().enumerate() {
                    where_is[i as usize] = at as u32;
                }
                for &source in &index[above(k)] {
                    targets.extend(index[below(source)].iter().map(|&i| where_is[i as usize]));
                }
            }
            targets
        });
        Lu {
            n,
            rows: elimination.rows.clone(),
            columns: elimination.columns.clone(),
            row_scale,
            column_scale,
            factors: vec![T::ZERO; entries],
            dense: vec![T::ZERO; if targets.is_some() { 0 } else { n }],
            index,
            starts,
            diagonal,
            inverse: vec![T::ZERO; n],
            place,
            scale,
            targets,
            operations,
            floors: vec![(0.0, 0.0); n],
            growth: 1.0,
        }
    }

    /// The elimination with these values. Unguarded, it sets the guards for later ones.
    fn replay(&mut self, values: &[T], guarded: bool) -> Result<(), Trouble> {
        self.factors.fill(T::ZERO);
        for ((&at, &by), &value) in self.place.iter().zip(&self.scale).zip(values) {
            self.factors[at as usize] = value.scaled(by);
        }
        let before = if T::EXACT { 1.0 } else { largest(&self.factors) };
        let mut listed = 0;
        for k in 0..self.n {
            let (start, diagonal) = (self.starts[k] as usize, self.diagonal[k] as usize);
            let (done, column) = self.factors.split_at_mut(start);
            let column = &mut column[..self.starts[k + 1] as usize - start];
            let column_before = if T::EXACT { 1.0 } else { largest(column) };
            if let Some(targets) = &self.targets {
                for at in 0..diagonal - start {
                    let u = column[at];
                    let source = self.index[start + at] as usize;
                    let below =
                        self.diagonal[source] as usize + 1..self.starts[source + 1] as usize;
                    let goals = &targets[listed..listed + below.len()];
                    listed += below.len();
                    for (&goal, &l) in goals.iter().zip(&done[below]) {
                        column[goal as usize] = column[goal as usize] - l * u;
                    }
                }
            } else {
                let index = &self.index[start..start + column.len()];
                for (&i, &value) in index.iter().zip(column.iter()) {
                    self.dense[i as usize] = value;
                }
                for &source in &index[..diagonal - start] {
                    let source = source as usize;
                    let u = self.dense[source];
                    let below =
                        self.diagonal[source] as usize + 1..self.starts[source + 1] as usize;
                    for (&i, &l) in self.index[below.clone()].iter().zip(&done[below]) {
                        self.dense[i as usize] = self.dense[i as usize] - l * u;
                    }
                }
                for (&i, value) in index.iter().zip(column.iter_mut()) {
                    *value = self.dense[i as usize];
                }
            }
            let (above, below) = column.split_at_mut(diagonal - start);
            let [pivot, below @ ..] = below else { continue };
            let size = pivot.magnitude();
            let name = (self.rows[k], self.columns[k]);
            if !pivot.is_finite() {
                return Err(Trouble::NotFinite { row: name.0, column: name.1 });
            }
            if size == 0.0 {
                return Err(Trouble::Pivot { row: name.0, column: name.1 });
            }
            if !T::EXACT {
                let under = largest(below);
                let whole = largest(above).max(column_before).max(under).max(size);
                if guarded {
                    let (floor_under, floor_whole) = self.floors[k];
                    if size < floor_under * under || size < floor_whole * whole {
                        return Err(Trouble::Pivot { row: name.0, column: name.1 });
                    }
                } else {
                    self.floors[k] = (
                        GUARD_BELOW * (size / under).min(1.0),
                        GUARD_COLUMN * (size / whole).min(1.0),
                    );
                }
            }
            let inverse = T::ONE / *pivot;
            self.inverse[k] = inverse;
            for l in below {
                *l = *l * inverse;
            }
        }
        if T::EXACT {
            return Ok(());
        }
        let growth = largest(&self.factors) / before;
        if !growth.is_finite() || self.inverse.iter().any(|inverse| !inverse.is_finite()) {
            let k = (0..self.n)
                .find(|&k| {
                    let column = self.starts[k] as usize..self.starts[k + 1] as usize;
                    !self.inverse[k].is_finite()
                        || self.factors[column].iter().any(|value| !value.is_finite())
                })
                .unwrap_or(0);
            return match (self.rows.get(k), self.columns.get(k)) {
                (Some(&row), Some(&column)) => Err(Trouble::NotFinite { row, column }),
                _ => Ok(()),
            };
        }
        if !guarded {
            self.growth = growth.max(1.0);
        } else if growth > GUARD_GROWTH * self.growth {
            return Err(Trouble::Growth);
        }
        Ok(())
    }
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

/// The larger; NaN where there is one.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The largest magnitude; NaN where there is one.
fn largest<T: Field>(values: &[T]) -> f64 {
    values.iter().fold(0.0, |largest, value| larger(largest, value.magnitude()))
}

fn choose_pivots<T: Field>(
    pattern: &Pattern,
    scaled: &[T],
    small: bool,
) -> Result<Elimination<T>, Singular> {
    let structural = |matching: &matching::Matching| Singular {
        cause: Cause::Structural,
        rows: matching.overdetermined(pattern),
        columns: matching.underdetermined(pattern),
    };
    if small {
        return markowitz::eliminate(pattern, scaled).map_err(|numeric| {
            let matching = matching::maximum_matching(pattern, |_| true);
            if matching.is_perfect() { numeric } else { structural(&matching) }
        });
    }
    // Diagonals that are not small, as nodes have, make good pivots; branches without one take a row of their nodes.
    let matching = matching::maximum_matching(pattern, |slot| scaled[slot].magnitude() > 0.01);
    if !matching.is_perfect() {
        return Err(structural(&matching));
    }
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); pattern.n];
    for j in 0..pattern.n {
        for slot in pattern.column(j) {
            let i = matching.column_of[pattern.rows[slot] as usize];
            if i as usize != j {
                neighbours[i as usize].push(j as u32);
                neighbours[j].push(i);
            }
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    let order = degree::minimum_degree(neighbours);
    gilbert::eliminate(pattern, scaled, &order, &matching.row_of)
}

/// Powers of two for rows and columns that bring the largest entry of each near to 1 (Ruiz, 2001).
fn equilibrate<T: Field>(pattern: &Pattern, values: &[T]) -> (Vec<f64>, Vec<f64>) {
    let n = pattern.n;
    let (mut rows, mut columns) = (vec![0i32; n], vec![0i32; n]);
    if !T::EXACT {
        for _ in 0..4 {
            let (mut row_largest, mut column_largest) = (vec![i32::MIN; n], vec![i32::MIN; n]);
            for j in 0..n {
                for slot in pattern.column(j) {
                    let size = values[slot].magnitude();
                    if size > 0.0 {
                        let i = pattern.rows[slot] as usize;
                        let exponent = exponent(size) + rows[i] + columns[j];
                        row_largest[i] = row_largest[i].max(exponent);
                        column_largest[j] = column_largest[j].max(exponent);
                    }
                }
            }
            let adjust = |scales: &mut [i32], largest: &[i32]| {
                for (scale, &largest) in scales.iter_mut().zip(largest) {
                    if largest != i32::MIN {
                        *scale = (*scale - largest.div_euclid(2)).clamp(-500, 500);
                    }
                }
            };
            adjust(&mut rows, &row_largest);
            adjust(&mut columns, &column_largest);
        }
    }
    let power = |scales: Vec<i32>| {
        scales.into_iter().map(|k| f64::from_bits(((1023 + k) as u64) << 52)).collect()
    };
    (power(rows), power(columns))
}

/// The whole part of log₂ of a positive number.
fn exponent(size: f64) -> i32 {
    let bits = (size.to_bits() >> 52) as i32 & 0x7ff;
    if bits == 0 { exponent(size * 18_014_398_509_481_984.0) - 54 } else { bits - 1023 }
}
