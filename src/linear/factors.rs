//! The factors of a matrix, made in the way that suits it.
//!
//! Small matrices have an LU with pivots of Markowitz's choice. Of others what solves itself is taken off first; what is left
//! is factored as a symmetric matrix where it is one and that costs something, or by columns. Where anything of that
//! does not go, the LU of the whole matrix says what is wrong with it.

use super::cholesky::{Cholesky, Orders};
use super::dense::Dense;
use super::flat::Flat;
use super::singletons::{Singletons, Unfit};
use super::{Lu, Pattern, SMALL, Singular};

/// Up to this many multiplications an LU stays as it is, whatever the matrix.
const CHEAP: usize = 100_000;

/// Paths of fewer nodes are short: that each waits for the one before costs little there.
const LONG: usize = 256;

/// Factors of a real matrix.
#[derive(Debug)]
pub struct Factors {
    kind: Kind,
    work: Vec<f64>,
}

#[derive(Debug)]
enum Kind {
    Whole(Box<Lu<f64>>),
    Tiny(Box<Tiny>),
    Parts(Box<Parts>),
}

/// An order of elimination, and dense factors in it; those of the order's own stand where the dense ones are not good.
#[derive(Debug)]
struct Tiny {
    lu: Lu<f64>,
    dense: Dense,
    is_dense: bool,
}

/// What solves itself, and the rest.
#[derive(Debug)]
struct Parts {
    ends: Singletons,
    core: Core,
    /// The core's values and unknowns, where it has an LU.
    values: Vec<f64>,
    vector: Vec<f64>,
}

#[derive(Debug)]
enum Core {
    None,
    Symmetric(Cholesky),
    General(Box<Lu<f64>>),
}

impl Factors {
    /// Chooses a way and an order for these values and factors them. `keep_zeros`: entries that are 0 now may be others
    /// later.
    pub fn new(
        pattern: &Pattern,
        values: &[f64],
        keep_zeros: bool,
        orders: &mut Orders,
    ) -> Result<Factors, Singular> {
        let whole = |lu| {
            let kind = match Dense::new(pattern, &lu) {
                Some(mut dense) => {
                    let is_dense = dense.load(values);
                    Kind::Tiny(Box::new(Tiny { lu, dense, is_dense }))
                }
                None => Kind::Whole(Box::new(lu)),
            };
            Factors { kind, work: vec![0.0; pattern.n] }
        };
        let small = pattern.n <= SMALL;
        if small {
            let paths = (pattern.n >= LONG)
                .then(|| Parts::find(pattern, values, keep_zeros, true, orders))
                .flatten()
                .filter(|parts| matches!(&parts.core, Core::Symmetric(core) if core.is_of_paths()));
            if let Some(parts) = paths {
                return Ok(parts.into_factors(pattern.n));
            }
            let lu = Lu::factor(pattern, values)?;
            if lu.operations() <= CHEAP {
                return Ok(whole(lu));
            }
            return Ok(match Parts::find(pattern, values, keep_zeros, true, orders) {
                Some(parts) => parts.into_factors(pattern.n),
                None => whole(lu),
            });
        }
        match Parts::find(pattern, values, keep_zeros, false, orders) {
            Some(parts) => Ok(parts.into_factors(pattern.n)),
            None => Lu::factor(pattern, values).map(whole),
        }
    }

    /// In parts, however small the matrix is.
    #[cfg(test)]
    pub(super) fn in_parts(
        pattern: &Pattern,
        values: &[f64],
        orders: &mut Orders,
    ) -> Option<Factors> {
        let parts = Parts::find(pattern, values, false, false, orders)?;
        Some(parts.into_factors(pattern.n))
    }

    #[cfg(test)]
    pub(super) fn is_general(&self) -> bool {
        matches!(&self.kind, Kind::Parts(parts) if matches!(parts.core, Core::General(_)))
    }

    /// Factors new values in the same way; not where that does not go any more.
    pub fn refactor(&mut self, values: &[f64]) -> Result<(), Unfit> {
        match &mut self.kind {
            Kind::Whole(lu) => lu.refactor(values).map_err(|_| Unfit::Values),
            Kind::Tiny(tiny) => {
                tiny.is_dense = tiny.dense.load(values);
                if tiny.is_dense {
                    return Ok(());
                }
                tiny.lu.refactor(values).map_err(|_| Unfit::Values)
            }
            Kind::Parts(parts) => parts.load(values),
        }
    }

    /// Solves A·x = b in place.
    pub fn solve(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            Kind::Whole(lu) => lu.solve(b, &mut self.work),
            Kind::Tiny(tiny) if tiny.is_dense => tiny.dense.solve(b),
            Kind::Tiny(tiny) => tiny.lu.solve(b, &mut self.work),
            Kind::Parts(parts) => {
                self.work.copy_from_slice(b);
                parts.solve(&mut self.work, b);
            }
        }
    }

    /// The two triangles as flat lists, where solving goes by these.
    pub fn flat(&self) -> Option<&Flat<f64>> {
        match &self.kind {
            Kind::Whole(lu) => lu.flat(),
            _ => None,
        }
    }

    /// Whether the determinant is negative, where that can be told.
    pub fn is_negative(&self) -> Option<bool> {
        match &self.kind {
            Kind::Whole(lu) => Some(lu.is_negative()),
            Kind::Tiny(tiny) if tiny.is_dense => {
                Some(tiny.lu.is_negative_with(tiny.dense.inverse()))
            }
            Kind::Tiny(tiny) => Some(tiny.lu.is_negative()),
            Kind::Parts(_) => None,
        }
    }

    /// Whether they are those of a symmetric matrix.
    pub fn is_symmetric(&self) -> bool {
        matches!(&self.kind, Kind::Parts(parts) if matches!(parts.core, Core::Symmetric(_)))
    }
}

impl Parts {
    /// The parts with their factors; `None` where the whole matrix had better be factored as it is.
    fn find(
        pattern: &Pattern,
        values: &[f64],
        keep_zeros: bool,
        symmetric_only: bool,
        orders: &mut Orders,
    ) -> Option<Parts> {
        if values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let mut ends = Singletons::find(pattern, values, keep_zeros);
        ends.load(values).ok()?;
        let mut parts = Parts { ends, core: Core::None, values: vec![], vector: vec![] };
        let Singletons { rows, columns, core, .. } = &parts.ends;
        if rows.is_empty() {
            return (!symmetric_only).then_some(parts);
        }
        if rows == columns {
            let found = Cholesky::find(pattern, values, rows, core, orders);
            if let Some(mut cholesky) = found
                && cholesky.load(values).is_ok()
            {
                parts.core = Core::Symmetric(cholesky);
                return Some(parts);
            }
        }
        if symmetric_only || parts.ends.len() == 0 {
            return None;
        }
        let mut number = vec![0u32; pattern.n];
        for (k, row) in rows.iter().enumerate() {
            number[*row as usize] = k as u32;
        }
        let mut inner =
            Pattern { n: rows.len(), starts: vec![0], rows: Vec::with_capacity(core.len()) };
        let mut slots = core.iter().copied().peekable();
        for &column in columns {
            let range = pattern.column(column as usize);
            while let Some(slot) = slots.next_if(|slot| range.contains(&(*slot as usize))) {
                inner.rows.push(number[pattern.rows[slot as usize] as usize]);
            }
            inner.starts.push(inner.rows.len() as u32);
        }
        parts.values = core.iter().map(|slot| values[*slot as usize]).collect();
        parts.vector = vec![0.0; 2 * inner.n];
        parts.core = Core::General(Box::new(Lu::factor(&inner, &parts.values).ok()?));
        Some(parts)
    }

    fn into_factors(self, n: usize) -> Factors {
        Factors { kind: Kind::Parts(Box::new(self)), work: vec![0.0; n] }
    }

    fn load(&mut self, values: &[f64]) -> Result<(), Unfit> {
        self.ends.load(values)?;
        match &mut self.core {
            Core::None => Ok(()),
            Core::Symmetric(cholesky) => cholesky.load(values),
            Core::General(lu) => {
                for (own, slot) in self.values.iter_mut().zip(&self.ends.core) {
                    *own = values[*slot as usize];
                }
                lu.refactor(&self.values).map_err(|_| Unfit::Values)
            }
        }
    }

    fn solve(&mut self, b: &mut [f64], x: &mut [f64]) {
        self.ends.forward(b, x);
        match &mut self.core {
            Core::None => {}
            Core::Symmetric(cholesky) => cholesky.solve(b, x),
            Core::General(lu) => {
                let (vector, work) = self.vector.split_at_mut(lu.n());
                for (own, row) in vector.iter_mut().zip(&self.ends.rows) {
                    *own = b[*row as usize];
                }
                lu.solve(vector, work);
                for (own, column) in vector.iter().zip(&self.ends.columns) {
                    x[*column as usize] = *own;
                }
            }
        }
        self.ends.backward(b, x);
    }
}
