//! Triangular solves with small factors as flat lists: each entry takes a multiple of one unknown off another.
//!
//! ```text
//! x = C·Q·U⁻¹·L⁻¹·P·R·b       L has a unit diagonal; U is divided by its own, row by row
//! ```
//!
//! L works in place on the rows of b, U on the columns of x, so that the order of elimination costs one pass between
//! them; and the powers of two of R and C go into the entries, which is exact.

use super::pack::put_lane;
use super::{Field, Number, Pack};
use std::ops::{Mul, Sub};

/// Scales further apart than this do not go into the entries.
const APART: f64 = 1e150;

/// The two triangles.
#[derive(Clone, Debug)]
pub struct Flat<T> {
    lower: Triangle<T>,
    upper: Triangle<T>,
    /// Row, column and scale of each pivot in the order of elimination, and what it is divided by.
    turns: Vec<([u32; 2], f64)>,
    inverse: Vec<T>,
}

/// The entries off the diagonal, level by level: those of one level wait for none of the same.
#[derive(Clone, Debug)]
struct Triangle<T> {
    /// Each takes a multiple of the second place off the first.
    places: Vec<[u32; 2]>,
    values: Vec<T>,
    origins: Vec<Origin>,
}

/// Where an entry comes from.
#[derive(Clone, Copy, Debug)]
struct Origin {
    /// Its place among the factors.
    at: u32,
    /// Row and column in the order of elimination.
    row: u32,
    column: u32,
    /// The power of two that it takes.
    by: f64,
}

/// What a replay is judged by.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    /// The largest part of what its pivot allows that an entry reached; NaN where one is no number.
    pub worst: f64,
    /// The largest magnitude.
    pub largest: f64,
}

impl Seen {
    /// Takes an entry, as a part of what its pivot allows and in size.
    pub fn take(&mut self, part: f64, size: f64) {
        // What is no number stays: a comparison would lose it.
        if part > self.worst || part.is_nan() {
            self.worst = part;
        }
        if size > self.largest {
            self.largest = size;
        }
    }
}

impl<T: Field> Flat<T> {
    /// Of the entries (row, column, place among the factors) below and above the diagonal, in orders in which they may be
    /// taken; nothing where scales are too far apart.
    pub fn new(
        order: [&[u32]; 2],
        scales: [&[f64]; 2],
        below: impl Iterator<Item = [u32; 3]>,
        above: impl Iterator<Item = [u32; 3]>,
    ) -> Option<Flat<T>> {
        let [rows, columns] = order;
        let [row_scale, column_scale] = scales;
        let near = |by: f64| (APART.recip()..APART).contains(&by);
        let lower = Triangle::new(rows, below, |row, column| row_scale[column] / row_scale[row]);
        let upper =
            Triangle::new(columns, above, |row, column| column_scale[row] / column_scale[column]);
        let turns: Vec<([u32; 2], f64)> = (0..rows.len())
            .map(|k| ([rows[k], columns[k]], row_scale[k] * column_scale[k]))
            .collect();
        let origins = lower.origins.iter().chain(&upper.origins);
        let fits = origins.map(|origin| origin.by).chain(turns.iter().map(|turn| turn.1)).all(near);
        let inverse = vec![T::ZERO; rows.len()];
        fits.then_some(Flat { lower, upper, turns, inverse })
    }

    /// Takes new factors; `inverse` holds 1/pivot. Judges them by what each pivot allows: `floors` are the least ratios of
    /// it to the largest entry below it, and to the largest of its column.
    pub fn load(&mut self, factors: &[T], inverse: &[T], floors: &[(f64, f64)]) -> Seen {
        let mut seen = Seen::default();
        for ((own, (_, by)), inverse) in self.inverse.iter_mut().zip(&self.turns).zip(inverse) {
            *own = inverse.scaled(*by);
        }
        for (value, origin) in self.lower.values.iter_mut().zip(&self.lower.origins) {
            let factor = factors[origin.at as usize];
            let (under, whole) = floors[origin.column as usize];
            let size = factor.magnitude();
            // Entries below were divided by the pivot.
            seen.take(size * under.max(whole), 0.0);
            *value = factor.scaled(origin.by);
        }
        for (value, origin) in self.upper.values.iter_mut().zip(&self.upper.origins) {
            let factor = factors[origin.at as usize];
            let column = origin.column as usize;
            let size = factor.magnitude();
            seen.take(size * inverse[column].magnitude() * floors[column].1, size);
            *value = (factor * inverse[origin.row as usize]).scaled(origin.by);
        }
        seen
    }
}

impl<T: Copy + Sub<Output = T> + Mul<Output = T>> Flat<T> {
    /// Solves in place; `work` is overwritten.
    pub fn solve(&self, b: &mut [T], work: &mut [T]) {
        self.lower.solve(b);
        for (([row, column], _), inverse) in self.turns.iter().zip(&self.inverse) {
            work[*column as usize] = b[*row as usize] * *inverse;
        }
        self.upper.solve(work);
        b.copy_from_slice(work);
    }
}

impl<T: Field> Triangle<T> {
    /// `names` are the rows or columns that stand at the places of the order.
    fn new(
        names: &[u32],
        entries: impl Iterator<Item = [u32; 3]>,
        by: impl Fn(usize, usize) -> f64,
    ) -> Triangle<T> {
        let mut level = vec![0u32; names.len()];
        let mut origins: Vec<Origin> = entries
            .map(|[row, column, at]| {
                let next = level[column as usize] + 1;
                level[row as usize] = level[row as usize].max(next);
                Origin { at, row, column, by: by(row as usize, column as usize) }
            })
            .collect();
        origins.sort_by_key(|origin| level[origin.column as usize]);
        let place = |origin: &Origin| [names[origin.row as usize], names[origin.column as usize]];
        Triangle {
            places: origins.iter().map(place).collect(),
            values: vec![T::ZERO; origins.len()],
            origins,
        }
    }
}

impl<T: Copy + Sub<Output = T> + Mul<Output = T>> Triangle<T> {
    fn solve(&self, x: &mut [T]) {
        let mut take = |[target, source]: [u32; 2], value: T| {
            x[target as usize] = x[target as usize] - value * x[source as usize];
        };
        let (places, last) = self.places.as_chunks::<4>();
        let (values, rest) = self.values.as_chunks::<4>();
        for (places, values) in places.iter().zip(values) {
            (0..4).for_each(|k| take(places[k], values[k]));
        }
        last.iter().zip(rest).for_each(|(place, value)| take(*place, *value));
    }
}

impl Flat<f64> {
    /// The same factors in all lanes.
    pub fn abreast(&self) -> Flat<Pack> {
        Flat {
            lower: self.lower.abreast(),
            upper: self.upper.abreast(),
            turns: self.turns.clone(),
            inverse: self.inverse.iter().copied().map(Pack::splat).collect(),
        }
    }
}

impl Flat<Pack> {
    fn is_like(&self, flat: &Flat<f64>) -> bool {
        let mut turns = self.turns.iter().zip(&flat.turns);
        self.lower.places == flat.lower.places
            && self.upper.places == flat.upper.places
            && self.turns.len() == flat.turns.len()
            && turns.all(|((own, _), (other, _))| own == other)
    }

    /// Puts factors into all lanes, where they are of the same order; says whether they are.
    pub fn put_all(&mut self, flat: &Flat<f64>) -> bool {
        self.put_by(flat, |to, from| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = Pack::splat(*from));
        })
    }

    /// Puts factors into a lane, where they are of the same order; says whether they are.
    pub fn put(&mut self, flat: &Flat<f64>, lane: usize) -> bool {
        self.put_by(flat, |to, from| put_lane(to, lane, from))
    }

    fn put_by(&mut self, flat: &Flat<f64>, put: impl Fn(&mut [Pack], &[f64])) -> bool {
        let alike = self.is_like(flat);
        if alike {
            put(&mut self.lower.values, &flat.lower.values);
            put(&mut self.upper.values, &flat.upper.values);
            put(&mut self.inverse, &flat.inverse);
        }
        alike
    }
}

impl Triangle<f64> {
    fn abreast(&self) -> Triangle<Pack> {
        let Triangle { places, values, .. } = self;
        let values = values.iter().copied().map(Pack::splat).collect();
        Triangle { places: places.clone(), values, origins: vec![] }
    }
}
