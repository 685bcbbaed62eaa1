//! Roots that cannot be told apart made one, rounding taken away, conjugate ones paired.
//!
//! ```text
//! mean of the k roots within a circle = c + 1/(2πi·k) ∮ (s − c)·p'/p ds
//! uncertainty of a simple root       ≈ ε·|y|ᵀ(|G| + |z||C|)|x| / |yᵀC x|      (G + zC)x = 0, yᵀ(G + zC) = 0
//! ```

use super::{Dual, Pencil, Root, size};
use crate::linear::{Complex, Field};

/// Numbers are known to about this part.
const KNOWN: f64 = 1e-15;
/// Roots are one where so many times the uncertainty of either reaches to the other.
const TOGETHER: f64 = 30.0;
/// The uncertainty of a root at which nothing is simple, as a part of it.
const UNKNOWN: f64 = 1e-4;
/// Points of a circle.
const POINTS: u32 = 32;

/// A root as it came, and how far it may lie off by the rounding of G and by that of C.
struct Rough {
    at: Complex,
    by_fixed: f64,
    by_storage: f64,
}

/// Makes one of those that belong together, and orders them by size.
pub fn gather(pencil: &mut Pencil, mut roots: Vec<Complex>) -> Vec<Root> {
    mirror(&mut roots);
    let mut rough: Vec<Rough> = roots.into_iter().map(|at| Rough::of(pencil, at)).collect();
    // Beyond all that G says: at infinity but for rounding.
    rough.retain(|root| root.by_storage < 0.1 * size(root.at) || root.at == Complex::ZERO);
    for root in rough.iter_mut().filter(|root| root.by_fixed >= size(root.at)) {
        root.at = Complex::ZERO;
    }
    let mut found: Vec<Root> = vec![];
    for group in groups(&rough) {
        let multiplicity = group.len();
        let sum = group.iter().fold(Complex::ZERO, |sum, k| sum + rough[*k].at);
        let centre = sum.scaled(1.0 / multiplicity as f64);
        let mut off = 4.0 * KNOWN * size(centre);
        let mut at = centre;
        if multiplicity > 1 && centre != Complex::ZERO {
            at = mean(pencil, &rough, &group, centre);
            // Means are not as exact as simple roots.
            off *= 1e3;
        } else if let [k] = group[..] {
            off += 16.0 * (rough[k].by_fixed + rough[k].by_storage);
        }
        for part in [&mut at.re, &mut at.im] {
            if part.abs() <= off {
                *part = 0.0;
            }
        }
        found.push(Root { at, multiplicity });
    }
    pair(&mut found);
    found
}

/// Makes roots of the lower half the mirrors of those of the upper one, so that both fall into the same groups.
fn mirror(roots: &mut [Complex]) {
    let half = |sign: f64| {
        let own = (0..roots.len()).filter(|k| roots[*k].im * sign > 0.0);
        own.collect::<Vec<_>>()
    };
    let (upper, mut lower) = (half(1.0), half(-1.0));
    if upper.len() != lower.len() {
        return;
    }
    for k in upper {
        let mirrored = Complex::new(roots[k].re, -roots[k].im);
        let near = |a: &usize, b: &usize| {
            size(roots[*a] - mirrored).total_cmp(&size(roots[*b] - mirrored))
        };
        let Some(nearest) = (0..lower.len()).min_by(|a, b| near(&lower[*a], &lower[*b])) else {
            return;
        };
        // Imaginary parts that are rounding have nothing to do with each other.
        if size(roots[lower[nearest]] - mirrored) < 0.1 * mirrored.im.abs() {
            roots[lower.swap_remove(nearest)] = mirrored;
        }
    }
}

/// Indices of roots that belong together.
fn groups(roots: &[Rough]) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..roots.len()).collect();
    for (i, a) in roots.iter().enumerate() {
        for (j, b) in roots.iter().enumerate().take(i) {
            let reach = (a.by_fixed + a.by_storage).max(b.by_fixed + b.by_storage);
            if group[i] != group[j] && size(a.at - b.at) <= TOGETHER * reach {
                let (from, to) = (group[i], group[j]);
                group.iter_mut().filter(|own| **own == from).for_each(|own| *own = to);
            }
        }
    }
    let members = |of: usize| (0..roots.len()).filter(|k| group[*k] == of).collect::<Vec<_>>();
    (0..roots.len()).map(members).filter(|group| !group.is_empty()).collect()
}

/// The mean of a group, by an integral round it from which the other roots are taken.
fn mean(pencil: &mut Pencil, roots: &[Rough], group: &[usize], centre: Complex) -> Complex {
    let spread = group.iter().map(|k| size(roots[*k].at - centre)).fold(0.0, f64::max);
    let others: Vec<Complex> =
        (0..roots.len()).filter(|k| !group.contains(k)).map(|k| roots[k].at).collect();
    let free = others.iter().map(|z| size(*z - centre)).fold(size(centre), f64::min);
    // Far enough from the group for p'/p to be exact, near enough for nothing else to matter.
    let radius = (0.3 * free).max(2.0 * spread);
    let mut sum = Complex::ZERO;
    for k in 0..POINTS {
        let turn = std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(POINTS);
        let (sine, cosine) = libm::sincos(turn);
        let off = Complex::new(radius * cosine, radius * sine);
        let s = centre + off;
        let Some(slope) = pencil.slope(s) else { return centre };
        let rest = others.iter().fold(slope, |rest, z| rest - Complex::ONE / (s - *z));
        // (s − c)·p'/p ds, ds = i·(s − c)·dφ.
        sum = sum + off * off * rest;
    }
    centre + sum.scaled(1.0 / (f64::from(POINTS) * group.len() as f64))
}

impl Rough {
    fn of(pencil: &mut Pencil, at: Complex) -> Rough {
        if at == Complex::ZERO {
            return Rough { at, by_fixed: 0.0, by_storage: 0.0 };
        }
        let (by_fixed, by_storage) = uncertainty(pencil, at).unwrap_or((UNKNOWN * size(at), 0.0));
        Rough { at, by_fixed, by_storage }
    }
}

/// How far a root may lie off, by the rounding of G and by that of C.
fn uncertainty(pencil: &mut Pencil, z: Complex) -> Option<(f64, f64)> {
    let n = pencil.pattern.n;
    // At the root itself the matrix is singular to the last digit, at a multiple one for some way round it.
    let beside = [1e-9, 1e-7, 1e-5, 1e-3];
    beside.iter().find(|by| pencil.factorise(z + z.scaled(**by)).is_some())?;
    let lu = pencil.factors.as_ref()?;
    let vector = |transposed: bool| {
        let mut x = vec![Dual::ONE; n];
        let mut work = x.clone();
        // Near a multiple root the vectors of its parts are all but parallel.
        for _ in 0..4 {
            let mut b = vec![Dual::ZERO; n];
            for column in 0..n {
                for slot in pencil.pattern.column(column) {
                    let row = pencil.pattern.rows[slot] as usize;
                    let (to, from) = if transposed { (column, row) } else { (row, column) };
                    b[to] = b[to] + x[from].scaled(pencil.storage[slot]);
                }
            }
            match transposed {
                true => lu.solve_transposed(&mut b, &mut work),
                false => lu.solve(&mut b, &mut work),
            }
            let most = b.iter().map(|v| v.magnitude()).fold(f64::MIN_POSITIVE, f64::max);
            x = b;
            for value in &mut x {
                *value = Dual { value: value.value.scaled(1.0 / most), slope: Complex::ZERO };
            }
        }
        x.into_iter().map(|v| v.value).collect::<Vec<_>>()
    };
    let (x, y) = (vector(false), vector(true));
    let (mut fixed, mut storage, mut product) = (0.0, 0.0, Complex::ZERO);
    for (column, right) in x.iter().enumerate() {
        for slot in pencil.pattern.column(column) {
            let row = pencil.pattern.rows[slot] as usize;
            let weight = size(y[row]) * size(*right);
            fixed += weight * pencil.fixed[slot].abs();
            storage += weight * pencil.storage[slot].abs();
            product = product + (y[row] * *right).scaled(pencil.storage[slot]);
        }
    }
    let bottom = size(product);
    let known = 0.5 * f64::EPSILON / bottom;
    (bottom > 0.0).then(|| (known * fixed, known * storage * size(z)))
}

/// Sorts by size and makes conjugate roots exactly so; a multiple root that has no partner is real.
pub fn pair(found: &mut Vec<Root>) {
    found.sort_by(|a, b| size(a.at).total_cmp(&size(b.at)).then(b.at.im.total_cmp(&a.at.im)));
    let mut left: Vec<Root> = std::mem::take(found);
    while !left.is_empty() {
        let mut root = left.remove(0);
        if root.at.im == 0.0 {
            found.push(root);
            continue;
        }
        let mirrored = Complex::new(root.at.re, -root.at.im);
        let near = |other: &Root| size(other.at - mirrored);
        let partner = (0..left.len())
            .filter(|k| left[*k].multiplicity == root.multiplicity)
            .min_by(|a, b| near(&left[*a]).total_cmp(&near(&left[*b])))
            .filter(|k| near(&left[*k]) < near(&root).min(1e-3 * size(root.at)));
        match partner {
            Some(k) => {
                let other = left.remove(k);
                let re = 0.5 * (root.at.re + other.at.re);
                let im = 0.5 * (root.at.im - other.at.im).abs();
                root.at = Complex::new(re, im);
                found.extend([root, Root { at: Complex::new(re, -im), ..root }]);
            }
            None => {
                root.at.im = 0.0;
                found.push(root);
            }
        }
    }
}
