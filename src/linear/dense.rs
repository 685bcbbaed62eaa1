//! Replays of the smallest matrices: dense, with loops of fixed lengths, in an order that an [`Lu`] has found.
//!
//! Up to some eight unknowns a zero costs less than the index that would skip it.

// Places that run over triangles say more than iterators over their rests, and unroll as well.
#![allow(clippy::needless_range_loop)]

use super::{Lu, Pattern};

/// Up to so many unknowns.
pub(super) const TINY: usize = 8;

/// The factors of a matrix of at most [`TINY`] unknowns, judged as those of [`Lu::refactor`] are.
#[derive(Clone, Debug)]
pub(super) struct Dense {
    /// Both triangles in the order of elimination, column after column; L has a unit diagonal.
    factors: Vec<f64>,
    /// 1/pivot, and the diagonal as loaded.
    inverse: Vec<f64>,
    loaded: Vec<f64>,
    /// Where each slot of the pattern goes, and the power of two that it is multiplied by.
    places: Vec<(u32, f64)>,
    /// Row, column and their powers of two at each place of the order.
    rows: Vec<(u32, f64)>,
    columns: Vec<(u32, f64)>,
    /// The least ratio of each pivot to the largest entry below it, or of its column.
    floors: Vec<(f64, f64)>,
    growth: f64,
    work: [f64; TINY],
}

/// Calls a function of a fixed number of unknowns.
macro_rules! of_size {
    ($n:expr, $function:ident, $($argument:expr),*) => {
        match $n {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5 => $function::<5>($($argument),*),
            6 => $function::<6>($($argument),*),
            7 => $function::<7>($($argument),*),
            _ => $function::<8>($($argument),*),
        }
    };
}

impl Dense {
    /// In the order of `lu`, which is that of a matrix of this pattern; nothing where it is too large. There are no
    /// factors before the first [`load`](Dense::load).
    pub fn new(pattern: &Pattern, lu: &Lu<f64>) -> Option<Dense> {
        let n = pattern.n;
        if !(1..=TINY).contains(&n) {
            return None;
        }
        let ([rows, columns], [row_scale, column_scale]) = (lu.order(), lu.scales());
        let (mut row_place, mut column_place) = ([0; TINY], [0; TINY]);
        for (k, (row, column)) in rows.iter().zip(columns).enumerate() {
            row_place[*row as usize] = k;
            column_place[*column as usize] = k;
        }
        let place = |column: usize, row: u32| {
            let (i, k) = (row_place[row as usize], column_place[column]);
            ((k * n + i) as u32, row_scale[i] * column_scale[k])
        };
        let slots =
            (0..n).flat_map(|column| pattern.column(column).map(move |slot| (column, slot)));
        let places = slots.map(|(column, slot)| place(column, pattern.rows[slot])).collect();
        let with = |names: &[u32], scales: &[f64]| {
            names.iter().copied().zip(scales.iter().copied()).collect()
        };
        let mut dense = Dense {
            factors: vec![0.0; n * n],
            inverse: vec![0.0; n],
            loaded: vec![0.0; n],
            places,
            rows: with(rows, row_scale),
            columns: with(columns, column_scale),
            floors: vec![],
            growth: 1.0,
            work: [0.0; TINY],
        };
        dense.judge_as(lu);
        Some(dense)
    }

    /// Takes what `lu` judges replays by.
    fn judge_as(&mut self, lu: &Lu<f64>) {
        let (floors, growth) = lu.guards();
        self.floors = floors.iter().map(|(under, whole)| (under.max(*whole), *whole)).collect();
        self.growth = growth;
    }

    /// Factors new values. Says whether all is well; if not, the careful way says why.
    pub fn load(&mut self, values: &[f64]) -> bool {
        self.factors.fill(0.0);
        let mut before: f64 = 0.0;
        for ((place, by), value) in self.places.iter().zip(values) {
            let value = value * by;
            before = if value.abs() > before { value.abs() } else { before };
            self.factors[*place as usize] = value;
        }
        let n = self.rows.len();
        for (k, loaded) in self.loaded.iter_mut().enumerate() {
            *loaded = self.factors[k * n + k].abs();
        }
        of_size!(n, eliminate, &mut self.factors, &mut self.inverse);
        let Dense { factors, inverse, loaded, floors, .. } = self;
        let (worst, largest) = of_size!(n, judge, factors, inverse, loaded, floors);
        worst <= 1.0 && largest <= self.growth * before
    }

    /// Solves A·x = b in place.
    pub fn solve(&mut self, b: &mut [f64]) {
        for (work, (row, by)) in self.work.iter_mut().zip(&self.rows) {
            *work = b[*row as usize] * by;
        }
        of_size!(self.rows.len(), substitute, &self.factors, &self.inverse, &mut self.work);
        for (work, (column, by)) in self.work.iter().zip(&self.columns) {
            b[*column as usize] = work * by;
        }
    }

    /// 1/pivot, in the order of elimination.
    pub fn inverse(&self) -> &[f64] {
        &self.inverse
    }
}

fn eliminate<const N: usize>(factors: &mut [f64], inverse: &mut [f64]) {
    let (columns, _) = factors.as_chunks_mut::<N>();
    let Ok(columns): Result<&mut [[f64; N]; N], _> = columns.try_into() else { return };
    for k in 0..N {
        let own = columns[k][k].recip();
        inverse[k] = own;
        for i in k + 1..N {
            columns[k][i] *= own;
        }
        for j in k + 1..N {
            let factor = columns[j][k];
            for i in k + 1..N {
                columns[j][i] -= columns[k][i] * factor;
            }
        }
    }
}

/// The largest part of what its pivot allows that an entry has reached, infinite where one is no number; and the largest
/// magnitude of U.
fn judge<const N: usize>(
    factors: &[f64],
    inverse: &[f64],
    loaded: &[f64],
    floors: &[(f64, f64)],
) -> (f64, f64) {
    let (columns, _) = factors.as_chunks::<N>();
    let Ok(columns): Result<&[[f64; N]; N], _> = columns.try_into() else { return (0.0, 0.0) };
    let more = |a: f64, b: f64| if a > b { a } else { b };
    // A sum keeps what a comparison would lose: NaN.
    let (mut worst, mut largest, mut sum): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for k in 0..N {
        let (mut above, mut below): (f64, f64) = (loaded[k], 0.0);
        for i in 0..=k {
            above = more(columns[k][i].abs(), above);
            sum += columns[k][i].abs();
        }
        for i in k + 1..N {
            below = more(columns[k][i].abs(), below);
            sum += columns[k][i].abs();
        }
        let (under, whole) = floors[k];
        let pivot = inverse[k].abs();
        sum += pivot;
        worst = more(below * under, more(above * pivot * whole, worst));
        largest = more(above, largest);
    }
    (if sum.is_finite() { worst } else { f64::INFINITY }, largest)
}

fn substitute<const N: usize>(factors: &[f64], inverse: &[f64], x: &mut [f64; TINY]) {
    let (columns, _) = factors.as_chunks::<N>();
    let Ok(columns): Result<&[[f64; N]; N], _> = columns.try_into() else { return };
    for k in 0..N {
        for i in k + 1..N {
            x[i] -= columns[k][i] * x[k];
        }
    }
    for k in (0..N).rev() {
        x[k] *= inverse[k];
        for i in 0..k {
            x[i] -= columns[k][i] * x[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

        #[test]
        fn dense_factors_solve_what_others_do_and_refuse_what_they_refuse(
            n in 1..=TINY,
            seed in prop::collection::vec((-1.0..1.0f64, -6..6i32, 0.0..1.0f64), TINY * TINY),
            zeroed in 0..TINY,
        ) {
            let entry = |&(mantissa, power, there): &(f64, i32, f64)| match there {
                0.0..0.5 => None,
                _ => Some(mantissa * 10f64.powi(power)),
            };
            let mut triplets = vec![];
            for (at, value) in seed.iter().take(n * n).map(entry).enumerate() {
                let (i, k) = (at % n, at / n);
                if i == k || value.is_some() {
                    triplets.push((i as u32, k as u32, value.unwrap_or(1.0)));
                }
            }
            let places: Vec<(u32, u32)> = triplets.iter().map(|(i, k, _)| (*i, *k)).collect();
            let (pattern, slots) = Pattern::from_triplets(n, &places);
            let mut values = vec![0.0; pattern.len()];
            slots.iter().zip(&triplets).for_each(|(slot, (.., v))| values[*slot as usize] += v);
            let Ok(mut lu) = Lu::factor(&pattern, &values) else { return Ok(()) };
            let mut dense = Dense::new(&pattern, &lu).unwrap();
            prop_assert!(dense.load(&values));
            prop_assert_eq!(lu.is_negative(), lu.is_negative_with(dense.inverse()));
            let b: Vec<f64> = (0..n).map(|k| 1.0 + k as f64).collect();
            let (mut x, mut y) = (b.clone(), b);
            lu.solve(&mut x, &mut vec![0.0; n]);
            dense.solve(&mut y);
            let size = x.iter().fold(0.0f64, |size, x| size.max(x.abs()));
            let growth = dense.factors.iter().fold(1.0f64, |size, x| size.max(x.abs()));
            for (x, y) in x.iter().zip(&y) {
                prop_assert!((x - y).abs() <= 1e-12 * growth * growth * size, "{} {}", x, y);
            }
            // A column of nothing, and one of no numbers.
            for bad in [0.0, f64::NAN, f64::INFINITY] {
                let mut values = values.clone();
                pattern.column(zeroed % n).for_each(|slot| values[slot] = bad);
                prop_assert!(!dense.load(&values));
                prop_assert!(lu.refactor(&values).is_err());
            }
        }
    }
}
