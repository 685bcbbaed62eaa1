//! Sparse matrices of short rows, for products: rows of equal length stand together, so that none needs a loop of its own.

use crate::linear::{Number, Pack, put_lane};

/// A list of rows, each a few entries.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows<T = f64> {
    /// Where each row's entries stand.
    spans: Vec<[u32; 2]>,
    /// The rows by their number of entries, as the entries stand.
    order: Vec<u32>,
    /// Where in `order` the rows of 0, 1, 2, 3, 4 entries end.
    ends: [u32; SHORT + 1],
    columns: Vec<u32>,
    values: Vec<T>,
}

/// Rows of up to so many entries are short.
const SHORT: usize = 4;

impl Rows {
    /// Sorts triplets by row and column; equal places add up in the order given.
    pub fn new(rows: usize, triplets: &[(u32, u32, f64)]) -> Rows {
        // Dealt out by row; then each row, which is short, is sorted by itself.
        let mut ends = vec![0u32; rows + 1];
        for (row, ..) in triplets {
            ends[*row as usize + 1] += 1;
        }
        for row in 0..rows {
            ends[row + 1] += ends[row];
        }
        let mut dealt = vec![(0u32, 0.0); triplets.len()];
        for (row, column, value) in triplets {
            let at = &mut ends[*row as usize];
            dealt[*at as usize] = (*column, *value);
            *at += 1;
        }
        // Now `ends[row]` is where the row ends. Equal places are added up where they stand.
        let mut spans = Vec::with_capacity(rows);
        let mut from = 0;
        for end in &ends[..rows] {
            let row = &mut dealt[from..*end as usize];
            row.sort_by_key(|(column, _)| *column);
            let mut kept = 0;
            for at in 0..row.len() {
                if kept > 0 && row[kept - 1].0 == row[at].0 {
                    row[kept - 1].1 += row[at].1;
                } else {
                    row[kept] = row[at];
                    kept += 1;
                }
            }
            spans.push([from as u32, (from + kept) as u32]);
            from = *end as usize;
        }
        drop(ends);
        let length = |span: &[u32; 2]| (span[1] - span[0]) as usize;
        let mut order: Vec<u32> = (0..rows as u32).collect();
        order.sort_by_key(|row| length(&spans[*row as usize]));
        let ends = std::array::from_fn(|most| {
            order.partition_point(|row| length(&spans[*row as usize]) <= most) as u32
        });
        let entries = spans.iter().map(length).sum();
        let mut columns = Vec::with_capacity(entries);
        let mut values = Vec::with_capacity(entries);
        for row in &order {
            let span = &mut spans[*row as usize];
            let row = &dealt[span[0] as usize..span[1] as usize];
            span[0] = columns.len() as u32;
            columns.extend(row.iter().map(|(column, _)| *column));
            values.extend(row.iter().map(|(_, value)| *value));
            span[1] = columns.len() as u32;
        }
        Rows { spans, order, ends, columns, values }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.spans.len()
    }

    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.values.len()
    }

    /// Every column that has an entry, some more than once.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Entries of a row.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.entries_of(row)
    }

    /// All entries as (row, column, value).
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.len())
            .flat_map(move |row| self.row(row).map(move |(column, value)| (row, column, value)))
    }

    /// The same rows in all lanes.
    pub fn abreast(&self) -> Rows<Pack> {
        let Rows { spans, order, ends, columns, values } = self.clone();
        let values = values.into_iter().map(Pack::splat).collect();
        Rows { spans, order, ends, columns, values }
    }
}

impl Rows<Pack> {
    /// Puts values into a lane, where they stand at the same places; says whether they do.
    pub fn put(&mut self, rows: &Rows, lane: usize) -> bool {
        let alike = self.spans == rows.spans && self.columns == rows.columns;
        if alike {
            put_lane(&mut self.values, lane, &rows.values);
        }
        alike
    }
}

impl<T: Number> Rows<T> {
    fn entries_of(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let [from, to] = self.spans[row];
        let range = from as usize..to as usize;
        self.columns[range.clone()].iter().zip(&self.values[range]).map(|(c, v)| (*c as usize, *v))
    }

    /// y += factor·(rows · x)
    pub fn add_product(&self, factor: T, x: &[T], y: &mut [T]) {
        self.add_short::<1>(factor, x, y);
        self.add_short::<2>(factor, x, y);
        self.add_short::<3>(factor, x, y);
        self.add_short::<4>(factor, x, y);
        for row in self.long() {
            let terms = self.entries_of(row).map(|(column, value)| value * x[column]);
            y[row] = y[row] + factor * terms.fold(T::ZERO, |sum, term| sum + term);
        }
    }

    fn add_short<const N: usize>(&self, factor: T, x: &[T], y: &mut [T]) {
        for (row, columns, values) in self.short::<N>() {
            let mut sum = T::ZERO;
            for (column, value) in columns.iter().zip(values) {
                sum = sum + *value * x[*column as usize];
            }
            y[*row as usize] = y[*row as usize] + factor * sum;
        }
    }

    /// y += factor·(transpose · w): rows are scattered into the places their columns name.
    pub fn add_transposed(&self, factor: T, w: &[T], y: &mut [T]) {
        self.scatter_short::<1>(factor, w, y);
        self.scatter_short::<2>(factor, w, y);
        self.scatter_short::<3>(factor, w, y);
        self.scatter_short::<4>(factor, w, y);
        for row in self.long() {
            let scaled = factor * w[row];
            self.entries_of(row).for_each(|(column, value)| y[column] = y[column] + scaled * value);
        }
    }

    fn scatter_short<const N: usize>(&self, factor: T, w: &[T], y: &mut [T]) {
        for (row, columns, values) in self.short::<N>() {
            let scaled = factor * w[*row as usize];
            for (column, value) in columns.iter().zip(values) {
                y[*column as usize] = y[*column as usize] + scaled * *value;
            }
        }
    }

    /// The rows of N entries.
    #[inline]
    fn short<const N: usize>(&self) -> impl Iterator<Item = (&u32, &[u32; N], &[T; N])> {
        let [first, end] = [self.ends[N - 1] as usize, self.ends[N] as usize];
        let rows = &self.order[first..end];
        let at = rows.first().map_or(0, |row| self.spans[*row as usize][0] as usize);
        let entries = at..at + N * rows.len();
        let columns = self.columns[entries.clone()].as_chunks::<N>().0;
        let values = self.values[entries].as_chunks::<N>().0;
        rows.iter().zip(columns).zip(values).map(|((row, columns), values)| (row, columns, values))
    }

    /// The rows of more entries.
    fn long(&self) -> impl Iterator<Item = usize> + '_ {
        self.order[self.ends[SHORT] as usize..].iter().map(|row| *row as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn products_are_those_of_the_triplets(
            triplets in prop::collection::vec((0..9u32, 0..7u32, -4..5i32), 0..60),
            x in prop::collection::vec(-8..9i32, 7),
            w in prop::collection::vec(-8..9i32, 9),
        ) {
            let real = |whole: &[i32]| -> Vec<f64> { whole.iter().map(|k| f64::from(*k)).collect() };
            let triplets: Vec<(u32, u32, f64)> =
                triplets.into_iter().map(|(r, c, v)| (r, c, f64::from(v))).collect();
            let rows = Rows::new(9, &triplets);
            let (x, w) = (real(&x), real(&w));
            // Whole numbers: sums are exact in any order.
            let (mut product, mut transposed) = (vec![1.0; 9], vec![2.0; 7]);
            let (mut expected, mut expected_transposed) = (product.clone(), transposed.clone());
            for (row, column, value) in &triplets {
                expected[*row as usize] += 3.0 * value * x[*column as usize];
                expected_transposed[*column as usize] += 3.0 * value * w[*row as usize];
            }
            rows.add_product(3.0, &x, &mut product);
            rows.add_transposed(3.0, &w, &mut transposed);
            prop_assert_eq!(product, expected);
            prop_assert_eq!(transposed, expected_transposed);
            let sorted: Vec<(usize, usize)> = rows.triplets().map(|(r, c, _)| (r, c)).collect();
            prop_assert!(sorted.is_sorted_by(|a, b| a < b));
            prop_assert_eq!(rows.len(), 9);
        }
    }
}
