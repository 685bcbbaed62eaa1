//! Pivots column by column in a given order, with a preferred row for each (Gilbert and Peierls, 1988): time
//! proportional to the arithmetic.

use super::pivots::{Elimination, NOISE};
use super::{Field, Pattern, Singular};

/// A preferred pivot is taken when it is at least this large relative to the largest of its column.
const THRESHOLD: f64 = 1e-2;
/// Where the preferred row is not to be had, the sparsest of those is taken that are this large.
const SPARSEST: f64 = 0.1;
const NONE: u32 = u32::MAX;

struct Work<T> {
    /// The column being made, and what bounds its rounding noise.
    value: Vec<T>,
    size: Vec<f64>,
    /// Rows of it, pivot rows in an order in which they may be used.
    rows: Vec<u32>,
    mark: Vec<u32>,
    stack: Vec<(u32, u32)>,
    /// The place in the order of each row that is a pivot row.
    order_of: Vec<u32>,
    /// Bounds of noise of the multipliers, beside `lower`.
    lower_size: Vec<f64>,
    /// How many entries each row of the matrix has.
    counts: Vec<u32>,
}

/// Chooses pivots for (scaled) values, taking columns in `order`, of each column the row `preferred[column]` if it can.
pub fn eliminate<T: Field>(
    pattern: &Pattern,
    values: &[T],
    order: &[u32],
    preferred: &[u32],
) -> Result<Elimination<T>, Singular> {
    let n = pattern.n;
    let mut result = Elimination::new();
    let mut work = Work {
        value: vec![T::ZERO; n],
        size: vec![0.0; n],
        rows: Vec::new(),
        mark: vec![NONE; n],
        stack: Vec::new(),
        order_of: vec![NONE; n],
        lower_size: Vec::new(),
        counts: vec![0; n],
    };
    pattern.rows.iter().for_each(|row| work.counts[*row as usize] += 1);
    let mut noise = if T::EXACT { 0.0 } else { NOISE };
    let mut waiting: Vec<u32> = order.to_vec();
    // Columns without a usable pivot wait until the others are done.
    while !waiting.is_empty() {
        let mut again = Vec::new();
        for &column in &waiting {
            work.column(&result, pattern, values, column);
            match work.choose(preferred[column as usize], noise) {
                Some(row) => work.store(&mut result, column, row),
                None => again.push(column),
            }
        }
        if again.len() == waiting.len() {
            let mut noisy = false;
            let left_over: Vec<_> = again
                .iter()
                .map(|&column| {
                    work.column(&result, pattern, values, column);
                    let mut above = Vec::new();
                    for &row in &work.rows {
                        let value = work.value[row as usize];
                        match work.order_of[row as usize] {
                            NONE => noisy |= !value.is_zero(),
                            k => above.push((k, value)),
                        }
                    }
                    (column, above)
                })
                .collect();
            if let Some(singular) = result.singular(pattern, values, &left_over, noisy) {
                return Err(singular);
            }
            noise = 0.0;
        }
        waiting = again;
    }
    Ok(result)
}

impl<T: Field> Work<T> {
    /// Makes one column of L and U: solves with the multipliers so far.
    fn column(&mut self, done: &Elimination<T>, pattern: &Pattern, values: &[T], column: u32) {
        for &row in &self.rows {
            self.value[row as usize] = T::ZERO;
            self.size[row as usize] = 0.0;
            self.mark[row as usize] = NONE;
        }
        self.rows.clear();
        for slot in pattern.column(column as usize) {
            self.reach(done, pattern.rows[slot]);
        }
        self.rows.reverse();
        for slot in pattern.column(column as usize) {
            let row = pattern.rows[slot] as usize;
            self.value[row] = values[slot];
            self.size[row] = values[slot].magnitude();
        }
        for at in 0..self.rows.len() {
            let row = self.rows[at] as usize;
            let k = self.order_of[row];
            if k == NONE {
                continue;
            }
            let (u, u_size) = (self.value[row], self.size[row]);
            for at in done.lower.range(k as usize) {
                let target = done.lower.index[at] as usize;
                let l = done.lower.value[at];
                self.value[target] = self.value[target] - l * u;
                self.size[target] = self.size[target]
                    .max(l.magnitude() * u_size)
                    .max(self.lower_size[at] * u.magnitude());
            }
        }
    }

    /// Depth first through the multipliers; rows are listed when all that follow from them are.
    fn reach(&mut self, done: &Elimination<T>, start: u32) {
        if self.mark[start as usize] != NONE {
            return;
        }
        self.mark[start as usize] = 0;
        self.stack.push((start, 0));
        while let Some((row, next)) = self.stack.last_mut() {
            let k = self.order_of[*row as usize];
            let child = (k != NONE)
                .then(|| done.lower.range(k as usize))
                .and_then(|range| range.clone().nth(*next as usize))
                .map(|at| done.lower.index[at]);
            match child {
                Some(child) => {
                    *next += 1;
                    if self.mark[child as usize] == NONE {
                        self.mark[child as usize] = 0;
                        self.stack.push((child, 0));
                    }
                }
                None => {
                    self.rows.push(*row);
                    self.stack.pop();
                }
            }
        }
    }

    fn choose(&self, preferred: u32, noise: f64) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        let mut wanted = None;
        for &row in &self.rows {
            let size = self.value[row as usize].magnitude();
            if self.order_of[row as usize] != NONE || size <= noise * self.size[row as usize] {
                continue;
            }
            if row == preferred {
                wanted = Some(size);
            }
            if best.is_none_or(|(largest, _)| size > largest) {
                best = Some((size, row));
            }
        }
        let (largest, row) = best?;
        if wanted.is_some_and(|size| size >= THRESHOLD * largest) {
            return Some(preferred);
        }
        let usable = |row: &&u32| {
            let size = self.value[**row as usize].magnitude();
            self.order_of[**row as usize] == NONE && size >= SPARSEST * largest
        };
        let sparsest =
            self.rows.iter().filter(usable).min_by_key(|row| self.counts[**row as usize]);
        Some(sparsest.copied().unwrap_or(row))
    }

    fn store(&mut self, result: &mut Elimination<T>, column: u32, pivot_row: u32) {
        let pivot = self.value[pivot_row as usize];
        let pivot_magnitude = pivot.magnitude();
        let relative = self.size[pivot_row as usize] / pivot_magnitude;
        for &row in &self.rows {
            let value = self.value[row as usize];
            match self.order_of[row as usize] {
                NONE if row == pivot_row => {}
                NONE => {
                    let l = value / pivot;
                    result.lower.push(row, l);
                    self.lower_size.push(
                        (self.size[row as usize] / pivot_magnitude).max(l.magnitude() * relative),
                    );
                }
                k => result.upper.push(k, value),
            }
        }
        result.lower.close();
        result.upper.close();
        self.order_of[pivot_row as usize] = result.pivots.len() as u32;
        result.rows.push(pivot_row);
        result.columns.push(column);
        result.pivots.push(pivot);
    }
}
