//! Where the entries of a square sparse matrix are: compressed columns, built from triplets.

use super::Field;

/// Places of entries, column by column, rows ascending. The entries' values are a slice of the same order.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Pattern {
    /// Number of rows and of columns.
    pub n: usize,
    /// Column `j` holds the entries `starts[j]..starts[j + 1]`.
    pub starts: Vec<u32>,
    /// Row of each entry.
    pub rows: Vec<u32>,
}

impl Pattern {
    /// The pattern of (row, column) pairs, and for each pair the slot of its entry: equal pairs share one, so that
    /// their values add up. All indices must be less than `n`.
    pub fn from_triplets(n: usize, triplets: &[(u32, u32)]) -> (Pattern, Vec<u32>) {
        let by_row = sorted(n, (0..triplets.len() as u32).collect(), |t| triplets[t as usize].0);
        let by_column = sorted(n, by_row, |t| triplets[t as usize].1);
        let mut pattern =
            Pattern { n, starts: vec![0; n + 1], rows: Vec::with_capacity(triplets.len()) };
        let mut slots = vec![0; triplets.len()];
        let mut last = None;
        for t in by_column {
            let place = triplets[t as usize];
            if last != Some(place) {
                last = Some(place);
                pattern.rows.push(place.0);
                pattern.starts[place.1 as usize + 1] += 1;
            }
            slots[t as usize] = pattern.rows.len() as u32 - 1;
        }
        for j in 0..n {
            pattern.starts[j + 1] += pattern.starts[j];
        }
        (pattern, slots)
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether it has no entries.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Slots of a column.
    pub fn column(&self, j: usize) -> std::ops::Range<usize> {
        self.starts[j] as usize..self.starts[j + 1] as usize
    }

    /// The slot of a place, if it has one.
    pub fn slot(&self, row: u32, column: u32) -> Option<usize> {
        let range = self.column(column as usize);
        let at = self.rows[range.clone()].binary_search(&row).ok()?;
        Some(range.start + at)
    }

    /// y = A·x.
    pub fn multiply<T: Field>(&self, values: &[T], x: &[T], y: &mut [T]) {
        y.fill(T::ZERO);
        for (j, &xj) in x.iter().enumerate().take(self.n) {
            for slot in self.column(j) {
                let row = self.rows[slot] as usize;
                y[row] = y[row] + values[slot] * xj;
            }
        }
    }

    /// The same entries row by row: for each row its columns.
    pub fn transposed(&self) -> Pattern {
        let mut result =
            Pattern { n: self.n, starts: vec![0; self.n + 1], rows: vec![0; self.rows.len()] };
        for &row in &self.rows {
            result.starts[row as usize + 1] += 1;
        }
        for j in 0..self.n {
            result.starts[j + 1] += result.starts[j];
        }
        let mut next = result.starts.clone();
        for j in 0..self.n {
            for slot in self.column(j) {
                let at = &mut next[self.rows[slot] as usize];
                result.rows[*at as usize] = j as u32;
                *at += 1;
            }
        }
        result
    }
}

/// Indices sorted by a key below `n`, stable.
fn sorted(n: usize, indices: Vec<u32>, key: impl Fn(u32) -> u32) -> Vec<u32> {
    let mut starts = vec![0u32; n + 1];
    for &index in &indices {
        starts[key(index) as usize + 1] += 1;
    }
    for j in 0..n {
        starts[j + 1] += starts[j];
    }
    let mut result = vec![0; indices.len()];
    for &index in &indices {
        let at = &mut starts[key(index) as usize];
        result[*at as usize] = index;
        *at += 1;
    }
    result
}
