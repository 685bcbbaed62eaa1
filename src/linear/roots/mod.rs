//! The finite roots of det(G + s·C) = 0, sparse, with their multiplicities.
//!
//! ```text
//! p(s) = det(G + s·C)        p'/p = Σ 1/(s − z_k) = d/ds log det, from an elimination in dual numbers
//! Ehrlich and Aberth:        z_j ← z_j − 1/(p'/p − Σ_{i≠j} 1/(z_j − z_i))
//! ```
//!
//! The number of roots comes from exact arithmetic (`count`), so that infinite ones are never mistaken for large ones;
//! where to begin from how many roots lie within circles, the mean of Re(s·p'/p) along them. Each step factorises the
//! pencil itself, so that no root suffers from the size of another. (D. A. Bini, V. Noferini, *Solving polynomial
//! eigenvalue problems by means of the Ehrlich–Aberth method*, 2013.)
//!
//! A root of multiplicity k is determined by numbers of 16 figures to 16/k figures only, but the mean of the k roots
//! that it falls apart into is exact: roots that lie within that distance are told as one, at their mean (`clusters`).
//! Parts that do not act on each other are solved apart (`blocks`).

mod blocks;
mod clusters;
mod count;
mod dual;
mod start;

use super::{Complex, Field, Lu, Pattern};
use dual::Dual;

/// A root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Where it lies.
    pub at: Complex,
    /// How often it counts.
    pub multiplicity: usize,
}

/// Why there are no roots to be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The determinant is 0 for every s.
    Singular,
    /// So many roots did not come to rest.
    Restless(usize),
    /// The caller wants no more of it.
    Stopped,
}

/// G + s·C on one pattern.
pub struct Pencil {
    pattern: Pattern,
    fixed: Vec<f64>,
    storage: Vec<f64>,
    factors: Option<Lu<Dual>>,
    values: Vec<Dual>,
}

/// Sweeps over all roots at most.
const MOST_SWEEPS: usize = 300;
/// A correction that is this part of a root has reached rounding.
const ROUNDING: f64 = 4e-16;
/// Corrections below this part of a root that do not shrink any more are rounding, too.
const NEAR: f64 = 1e-3;
/// So often.
const IDLE: u32 = 4;

/// The finite roots of det(G + s·C), by size; conjugate ones follow each other, the upper first. Triplets are (row,
/// column, value). `go_on` is asked again and again.
///
/// # Errors
/// When every s is a root, roots do not come to rest, or the caller stops the search.
pub fn finite_roots(
    n: usize,
    fixed: &[(u32, u32, f64)],
    storage: &[(u32, u32, f64)],
    go_on: &dyn Fn() -> bool,
) -> Result<Vec<Root>, Trouble> {
    // Equal blocks have equal roots.
    let mut known: Vec<(blocks::Block, Vec<Root>)> = vec![];
    let mut all = vec![];
    for block in blocks::blocks(n, fixed, storage) {
        if let Some((_, roots)) = known.iter().find(|(other, _)| *other == block) {
            all.extend(roots);
            continue;
        }
        let roots = roots_of(&block, go_on)?;
        all.extend(&roots);
        known.push((block, roots));
    }
    let mut all = blocks::merge(all);
    clusters::pair(&mut all);
    Ok(all)
}

/// The roots of one block.
fn roots_of(block: &blocks::Block, go_on: &dyn Fn() -> bool) -> Result<Vec<Root>, Trouble> {
    if block.storage.is_empty() && block.n == 1 {
        let sum: f64 = block.fixed.iter().map(|(_, _, value)| value).sum();
        return if sum == 0.0 { Err(Trouble::Singular) } else { Ok(vec![]) };
    }
    let mut pencil = Pencil::new(block.n, &block.fixed, &block.storage);
    let count = count::degree(&pencil, go_on)?;
    // Exactly the determinant has a degree; where it is 0 to the last digit wherever it is asked, nothing is known of it.
    let probes = [1e-2, 1.7, 33.0, 2.1e4].map(|radius| Complex::new(0.6 * radius, 0.8 * radius));
    let rounding = count > 0 && probes.iter().all(|s| pencil.slope(*s).is_none());
    // Pivots are chosen where the search begins.
    pencil.factors = None;
    if rounding {
        return Err(Trouble::Singular);
    }
    let start = start::guesses(&mut pencil, count);
    let zeros = count - start.len();
    let mut roots = start;
    let restless = pencil.aberth(&mut roots, zeros, go_on)?;
    if restless > 0 {
        return Err(Trouble::Restless(restless));
    }
    roots.extend(std::iter::repeat_n(Complex::ZERO, zeros));
    Ok(clusters::gather(&mut pencil, roots))
}

impl Pencil {
    fn new(n: usize, fixed: &[(u32, u32, f64)], storage: &[(u32, u32, f64)]) -> Pencil {
        let all = || fixed.iter().chain(storage);
        let places: Vec<(u32, u32)> = all().map(|(row, column, _)| (*row, *column)).collect();
        let (pattern, slots) = Pattern::from_triplets(n, &places);
        let mut pencil = Pencil {
            fixed: vec![0.0; pattern.len()],
            storage: vec![0.0; pattern.len()],
            values: vec![Dual::ZERO; pattern.len()],
            pattern,
            factors: None,
        };
        for (k, ((_, _, value), slot)) in all().zip(slots).enumerate() {
            let into = if k < fixed.len() { &mut pencil.fixed } else { &mut pencil.storage };
            into[slot as usize] += value;
        }
        pencil
    }

    /// No more roots than this: C has so many rows and columns that are not 0.
    fn rank_bound(&self) -> usize {
        let (mut rows, mut columns) = (vec![false; self.pattern.n], 0);
        for column in 0..self.pattern.n {
            let mut any = false;
            for slot in self.pattern.column(column).filter(|slot| self.storage[*slot] != 0.0) {
                rows[self.pattern.rows[slot] as usize] = true;
                any = true;
            }
            columns += usize::from(any);
        }
        columns.min(rows.into_iter().filter(|any| *any).count())
    }

    /// Factorises at s; `None` where the matrix is singular to the last digit.
    fn factorise(&mut self, s: Complex) -> Option<&Lu<Dual>> {
        for ((value, g), c) in self.values.iter_mut().zip(&self.fixed).zip(&self.storage) {
            *value = Dual { value: Complex::from(*g) + s.scaled(*c), slope: Complex::from(*c) };
        }
        let kept = self.factors.as_mut().is_some_and(|lu| lu.refactor(&self.values).is_ok());
        if !kept {
            self.factors = Lu::factor(&self.pattern, &self.values).ok();
        }
        self.factors.as_ref()
    }

    /// p'/p at s; `None` where s is a root to the last digit.
    fn slope(&mut self, s: Complex) -> Option<Complex> {
        let lu = self.factorise(s)?;
        let sum =
            lu.pivots().fold(Complex::ZERO, |sum, pivot: Dual| sum + pivot.slope / pivot.value);
        sum.is_finite().then_some(sum)
    }

    /// Improves all roots at once, `zeros` more being known to lie at 0; gives how many did not come to rest.
    fn aberth(
        &mut self,
        roots: &mut [Complex],
        zeros: usize,
        go_on: &dyn Fn() -> bool,
    ) -> Result<usize, Trouble> {
        let mut resting = vec![false; roots.len()];
        let mut last = vec![(f64::INFINITY, 0u32); roots.len()];
        for _ in 0..MOST_SWEEPS {
            for j in 0..roots.len() {
                if resting[j] {
                    continue;
                }
                if !go_on() {
                    return Err(Trouble::Stopped);
                }
                let z = roots[j];
                let Some(slope) = self.slope(z) else {
                    resting[j] = true;
                    continue;
                };
                let mut rest = slope - Complex::from(zeros as f64) / z;
                for (i, other) in roots.iter().enumerate() {
                    // Two at one place push each other nowhere.
                    if i != j && *other != z {
                        rest = rest - Complex::ONE / (z - *other);
                    }
                }
                let step = Complex::ONE / rest;
                if !step.is_finite() {
                    // A place where all pushes cancel: turned a little.
                    roots[j] = z * Complex::new(0.8, 0.6);
                    continue;
                }
                roots[j] = z - step;
                let part = size(step) / size(roots[j]).max(f64::MIN_POSITIVE);
                let idle = part < NEAR && part >= 0.9 * last[j].0;
                last[j] = (part.min(last[j].0), if idle { last[j].1 + 1 } else { 0 });
                resting[j] = part <= ROUNDING || last[j].1 >= IDLE;
            }
            if resting.iter().all(|rests| *rests) {
                break;
            }
        }
        Ok(resting.iter().filter(|rests| !**rests).count())
    }
}

fn size(z: Complex) -> f64 {
    libm::hypot(z.re, z.im)
}

#[cfg(test)]
mod tests;
