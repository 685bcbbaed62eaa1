//! What choosing pivots yields, and the null vectors where pivots run out.

use super::{Field, Pattern};

/// A matrix that cannot be solved with.
#[derive(Clone, Debug, PartialEq)]
pub struct Singular {
    /// Why.
    pub cause: Cause,
    /// Sets of rows that depend on each other: the supports of null vectors of the transpose.
    pub rows: Vec<Vec<u32>>,
    /// Sets of columns that are not determined: the supports of null vectors.
    pub columns: Vec<Vec<u32>>,
}

/// Why a matrix cannot be solved with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// No values at these places could help.
    Structural,
    /// These values cancel, exactly or to the last digits.
    Numeric,
    /// An entry (the row and column given) is infinite or NaN.
    NotFinite,
}

/// Sparse columns without a fixed shape.
#[derive(Clone, Debug, Default)]
pub struct Columns<T> {
    pub starts: Vec<u32>,
    pub index: Vec<u32>,
    pub value: Vec<T>,
}

impl<T: Field> Columns<T> {
    pub fn new() -> Columns<T> {
        Columns { starts: vec![0], index: Vec::new(), value: Vec::new() }
    }

    pub fn push(&mut self, index: u32, value: T) {
        self.index.push(index);
        self.value.push(value);
    }

    pub fn close(&mut self) {
        self.starts.push(self.index.len() as u32);
    }

    pub fn range(&self, k: usize) -> std::ops::Range<usize> {
        self.starts[k] as usize..self.starts[k + 1] as usize
    }

    pub fn entries(&self, k: usize) -> impl DoubleEndedIterator<Item = (u32, T)> + '_ {
        self.range(k).map(|at| (self.index[at], self.value[at]))
    }
}

/// An elimination, complete or as far as it went.
#[derive(Clone, Debug)]
pub struct Elimination<T> {
    /// Pivot rows and columns in order.
    pub rows: Vec<u32>,
    pub columns: Vec<u32>,
    pub pivots: Vec<T>,
    /// Multipliers of each pivot: (row of the matrix, l).
    pub lower: Columns<T>,
    /// What stands above the pivot in each pivot column: (place in the order, u).
    pub upper: Columns<T>,
}

/// Entries are taken for rounding noise below this many units in the last place of what they were made of.
pub const NOISE: f64 = 64.0 * f64::EPSILON;

/// A null vector is accepted when each row of A·x is as small as rounding the entries of A could make it
/// (Oettli and Prager, 1964).
const NULL: f64 = 4.0 * f64::EPSILON;

impl<T: Field> Elimination<T> {
    pub fn new() -> Elimination<T> {
        Elimination {
            rows: Vec::new(),
            columns: Vec::new(),
            pivots: Vec::new(),
            lower: Columns::new(),
            upper: Columns::new(),
        }
    }

    /// The null vector that a column without a pivot gives, where `above` is its part in the pivot rows.
    fn right(&self, n: usize, column: u32, above: &[(u32, T)]) -> Vec<T> {
        let count = self.pivots.len();
        let mut top = vec![T::ZERO; count];
        for &(k, u) in above {
            top[k as usize] = -u;
        }
        let mut x = vec![T::ZERO; n];
        x[column as usize] = T::ONE;
        for k in (0..count).rev() {
            if top[k].is_zero() {
                continue;
            }
            let value = top[k] / self.pivots[k];
            x[self.columns[k] as usize] = value;
            for (row, u) in self.upper.entries(k) {
                top[row as usize] = top[row as usize] - u * value;
            }
        }
        x
    }

    /// The null vector of the transpose that a row without a pivot gives.
    fn left(&self, n: usize, row: u32) -> Vec<T> {
        let mut y = vec![T::ZERO; n];
        y[row as usize] = T::ONE;
        for k in (0..self.pivots.len()).rev() {
            let mut sum = T::ZERO;
            for (row, l) in self.lower.entries(k) {
                sum = sum + l * y[row as usize];
            }
            y[self.rows[k] as usize] = -sum;
        }
        y
    }

    /// What is singular, if the columns left over (with their parts in the pivot rows) give null vectors that hold up
    /// against the matrix itself. `noisy`: whether anything but zeros is left in them.
    pub fn singular(
        &self,
        pattern: &Pattern,
        values: &[T],
        left_over: &[(u32, Vec<(u32, T)>)],
        noisy: bool,
    ) -> Option<Singular> {
        const MOST: usize = 32;
        let n = pattern.n;
        let mut found = Vec::new();
        for (column, above) in left_over.iter().take(MOST) {
            let x = self.right(n, *column, above);
            if !noisy || vanishes(pattern, values, &x) {
                found.push(support(&x));
            }
        }
        if found.is_empty() {
            return None;
        }
        let mut taken = vec![false; n];
        for &row in &self.rows {
            taken[row as usize] = true;
        }
        let rows = (0..n as u32)
            .filter(|&row| !taken[row as usize])
            .take(MOST)
            .map(|row| support(&self.left(n, row)))
            .collect();
        Some(Singular { cause: Cause::Numeric, rows, columns: found })
    }
}

/// Whether A·x is 0 but for rounding of the entries of A.
fn vanishes<T: Field>(pattern: &Pattern, values: &[T], x: &[T]) -> bool {
    let mut sums = vec![(T::ZERO, 0.0f64); pattern.n];
    for (j, &xj) in x.iter().enumerate() {
        if xj.is_zero() {
            continue;
        }
        for slot in pattern.column(j) {
            let term = values[slot] * xj;
            let sum = &mut sums[pattern.rows[slot] as usize];
            *sum = (sum.0 + term, sum.1 + term.magnitude());
        }
    }
    sums.iter().all(|(sum, size)| sum.magnitude() <= NULL * size)
}

/// Where a vector is not negligible.
fn support<T: Field>(x: &[T]) -> Vec<u32> {
    let largest = x.iter().fold(0.0f64, |largest, x| largest.max(x.magnitude()));
    (0..x.len() as u32).filter(|&i| x[i as usize].magnitude() > 1e-9 * largest).collect()
}
