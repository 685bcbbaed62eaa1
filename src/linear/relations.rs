//! Which rows of a sparse matrix depend on each other, found while the rows come one after the other.
//!
//! Gaussian elimination by rows (Gilbert and Peierls' way, row by row): of each new row all pivots before it are taken
//! out; what is left over gives the next pivot, and a row of which nothing is left is a combination of those before it.
//! Each relation holds by itself, so that the search may stop at any row.

use super::pivots::NOISE;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Of the entries that are this large beside the largest, each in parts of its column, the one in the emptiest column
/// becomes the pivot.
const THRESHOLD: f64 = 0.1;
const NONE: u32 = u32::MAX;

/// A number, and the largest one that entered it, which bounds its rounding.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: f64,
    size: f64,
}

impl Sum {
    fn is_noise(self) -> bool {
        self.value.abs() <= NOISE * self.size
    }

    /// What is left after a factor times another has been taken out.
    fn without(self, factor: Sum, other: Sum) -> Sum {
        let size = (factor.value.abs() * other.size).max(factor.size * other.value.abs());
        Sum { value: self.value - factor.value * other.value, size: self.size.max(size) }
    }
}

/// Rows of one length each, one after the other.
#[derive(Default)]
struct Rows<T> {
    starts: Vec<usize>,
    entries: Vec<(u32, T)>,
}

impl<T> Rows<T> {
    fn close(&mut self) {
        self.starts.push(self.entries.len());
    }

    fn row(&self, k: u32) -> &[(u32, T)] {
        let start = if k == 0 { 0 } else { self.starts[k as usize - 1] };
        &self.entries[start..self.starts[k as usize]]
    }
}

/// What has become of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    /// It depends on none before it; its pivot stands in this column.
    Independent(u32),
    /// Σ y·row = 0, with the row's own y = 1 and only rows that are told to be independent beside it.
    Relation(Vec<(u32, f64)>),
    /// Rounding leaves open which; it is as if it had not come.
    Unclear,
    /// The work allowed is used up.
    Enough,
}

/// The elimination so far.
pub struct Relations {
    /// The largest magnitude of each column, and how many rows have an entry there.
    columns: Vec<(f64, u32)>,
    /// All rows as they came.
    rows: Rows<f64>,
    /// Of each pivot: the row it came from, its column, its value.
    pivots: Vec<(u32, u32, Sum)>,
    /// What stands beside each pivot, and what was taken out of its row: (pivot, factor).
    beside: Rows<Sum>,
    factors: Rows<f64>,
    pivot_of_column: Vec<u32>,
    /// The row at hand, dense, and where it has entries.
    sums: Vec<Sum>,
    touched: Vec<u32>,
    is_touched: Vec<bool>,
    /// Multiplications that may still be done.
    left: usize,
}

impl Relations {
    /// Rows to come, which are looked at beforehand for the sizes of their columns; and how many multiplications may be
    /// done.
    pub fn new<'a>(
        columns: usize,
        rows: impl Iterator<Item = &'a [(u32, f64)]>,
        multiplications: usize,
    ) -> Relations {
        let mut sizes = vec![(0.0f64, 0u32); columns];
        for (column, value) in rows.flatten() {
            let (size, count) = &mut sizes[*column as usize];
            (*size, *count) = (size.max(value.abs()), *count + 1);
        }
        Relations {
            columns: sizes,
            rows: Rows::default(),
            pivots: vec![],
            beside: Rows::default(),
            factors: Rows::default(),
            pivot_of_column: vec![NONE; columns],
            sums: vec![Sum::default(); columns],
            touched: vec![],
            is_touched: vec![false; columns],
            left: multiplications,
        }
    }

    /// Lets all columns count as equally large, so that the largest entries become pivots as they are.
    pub fn level(mut self) -> Relations {
        self.columns.iter_mut().for_each(|(size, _)| *size = 1.0);
        self
    }

    /// Takes in the next row; no column may come twice in it.
    pub fn take(&mut self, row: &[(u32, f64)]) -> Taken {
        let own = self.rows.starts.len() as u32;
        self.rows.entries.extend_from_slice(row);
        self.rows.close();
        let mut waiting = BinaryHeap::new();
        for (column, value) in row {
            self.touch(*column, &mut waiting);
            self.sums[*column as usize] = Sum { value: *value, size: value.abs() };
        }
        // Pivots in their order: taking one out brings in only columns of later ones.
        while let Some(Reverse(k)) = waiting.pop() {
            let (_, column, pivot) = self.pivots[k as usize];
            let sum = std::mem::take(&mut self.sums[column as usize]);
            if sum.is_noise() {
                continue;
            }
            let value = sum.value / pivot.value;
            let size = sum.size.max(value.abs() * pivot.size) / pivot.value.abs();
            let factor = Sum { value, size };
            self.factors.entries.push((k, value));
            let range = self.beside.row(k).len();
            self.left = self.left.saturating_sub(1 + range);
            for at in 0..range {
                let (column, other) = self.beside.row(k)[at];
                self.touch(column, &mut waiting);
                let sum = &mut self.sums[column as usize];
                *sum = sum.without(factor, other);
            }
        }
        let taken = if self.left == 0 { Taken::Enough } else { self.place(own) };
        if !matches!(taken, Taken::Independent(_)) {
            let start = self.factors.starts.last().copied().unwrap_or(0);
            self.factors.entries.truncate(start);
        }
        for column in self.touched.drain(..) {
            self.is_touched[column as usize] = false;
            self.sums[column as usize] = Sum::default();
        }
        taken
    }

    fn touch(&mut self, column: u32, waiting: &mut BinaryHeap<Reverse<u32>>) {
        if !std::mem::replace(&mut self.is_touched[column as usize], true) {
            self.touched.push(column);
            let pivot = self.pivot_of_column[column as usize];
            if pivot != NONE {
                waiting.push(Reverse(pivot));
            }
        }
    }

    /// Makes what is left of a row the next pivot, or a relation.
    fn place(&mut self, own: u32) -> Taken {
        let part = |column: u32, sum: Sum| sum.value.abs() / self.columns[column as usize].0;
        let left = self.touched.iter().map(|column| (*column, self.sums[*column as usize]));
        let left: Vec<(u32, Sum)> = left.filter(|(_, sum)| !sum.is_noise()).collect();
        let largest = left.iter().fold(0.0f64, |most, (column, sum)| most.max(part(*column, *sum)));
        let usable = left.iter().filter(|(column, sum)| part(*column, *sum) >= THRESHOLD * largest);
        let best = usable.min_by_key(|(column, _)| (self.columns[*column as usize].1, *column));
        let Some((column, pivot)) = best.copied() else {
            let relation = self.relation(own);
            return if self.vanishes(&relation) {
                Taken::Relation(relation)
            } else {
                Taken::Unclear
            };
        };
        self.pivot_of_column[column as usize] = self.pivots.len() as u32;
        self.pivots.push((own, column, pivot));
        self.beside.entries.extend(left.into_iter().filter(|(other, _)| *other != column));
        self.beside.close();
        self.factors.close();
        Taken::Independent(column)
    }

    /// The combination of rows that the factors at hand stand for.
    fn relation(&mut self, own: u32) -> Vec<(u32, f64)> {
        let start = self.factors.starts.last().copied().unwrap_or(0);
        let mut relation = vec![(own, 1.0)];
        let mut waiting: BinaryHeap<u32> = BinaryHeap::new();
        let mut parts: std::collections::BTreeMap<u32, f64> = Default::default();
        for (k, factor) in &self.factors.entries[start..] {
            parts.insert(*k, *factor);
            waiting.push(*k);
        }
        while let Some(k) = waiting.pop() {
            let Some(part) = parts.remove(&k) else { continue };
            relation.push((self.pivots[k as usize].0, -part));
            let factors = self.factors.row(k);
            self.left = self.left.saturating_sub(1 + factors.len());
            for (j, factor) in factors {
                let at = parts.entry(*j).or_insert_with(|| {
                    waiting.push(*j);
                    0.0
                });
                *at -= factor * part;
            }
        }
        relation.retain(|(_, factor)| *factor != 0.0);
        relation
    }

    /// Whether the relation holds but for rounding of each of its factors. Uses the dense row up.
    fn vanishes(&mut self, relation: &[(u32, f64)]) -> bool {
        let allowed = f64::EPSILON * (16.0 + 4.0 * relation.len() as f64);
        let mut nothing = BinaryHeap::new();
        for column in &self.touched {
            self.sums[*column as usize] = Sum::default();
        }
        for (row, factor) in relation {
            for at in 0..self.rows.row(*row).len() {
                let (column, value) = self.rows.row(*row)[at];
                self.touch(column, &mut nothing);
                let sum = &mut self.sums[column as usize];
                sum.value += factor * value;
                sum.size += (factor * value).abs();
            }
        }
        self.touched.iter().all(|column| {
            let sum = self.sums[*column as usize];
            sum.value.abs() <= allowed * sum.size
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(columns: usize, rows: &[Vec<(u32, f64)>]) -> Vec<Taken> {
        let mut relations =
            Relations::new(columns, rows.iter().map(|row| row.as_slice()), usize::MAX);
        rows.iter().map(|row| relations.take(row)).collect()
    }

    #[test]
    fn a_row_that_follows_from_others_is_told_with_their_factors() {
        let rows = [
            vec![(0, 1.0), (1, 2.0)],
            vec![(1, 1.0), (2, -3.0)],
            vec![(0, 2.0), (1, 7.0), (2, -9.0)],
            vec![(2, 1e-12)],
            vec![(0, 1.0)],
        ];
        let found = taken(3, &rows);
        let Taken::Relation(relation) = &found[2] else { panic!("{found:?}") };
        let mut relation = relation.clone();
        relation.sort_by_key(|(row, _)| *row);
        assert_eq!(relation, [(0, -2.0), (1, -3.0), (2, 1.0)]);
        assert!(matches!(found[3], Taken::Independent(_)), "small is not nothing");
        assert!(matches!(&found[4], Taken::Relation(relation) if relation.len() == 4), "{found:?}");
    }

    #[test]
    fn rows_of_random_rank_have_as_many_relations_as_they_lack() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
        };
        for rank in 1..12u32 {
            // Products of sparse factors of that rank, with columns of very different sizes.
            let right: Vec<Vec<f64>> =
                (0..rank).map(|_| (0..20).map(|j| next() * 10f64.powi(j - 10)).collect()).collect();
            let rows: Vec<Vec<(u32, f64)>> = (0..30)
                .map(|_| {
                    let a: Vec<f64> = (0..rank).map(|_| next()).collect();
                    let sum = |j: usize| right.iter().zip(&a).map(|(r, a)| r[j] * a).sum();
                    (0..20).map(|j| (j as u32, sum(j))).collect()
                })
                .collect();
            let found = taken(20, &rows);
            let independent = found.iter().filter(|t| matches!(t, Taken::Independent(_))).count();
            assert_eq!(independent, rank as usize, "{found:?}");
        }
    }

    #[test]
    fn the_work_is_bounded() {
        let rows: Vec<Vec<(u32, f64)>> =
            (0..50).map(|i| (0..50).map(|j| (j, 1.0 / f64::from(i + j + 1))).collect()).collect();
        let mut relations = Relations::new(50, rows.iter().map(|row| row.as_slice()), 1000);
        let found: Vec<Taken> = rows.iter().map(|row| relations.take(row)).collect();
        assert_eq!(found.last(), Some(&Taken::Enough));
        assert!(matches!(found[3], Taken::Independent(_)));
    }
}
