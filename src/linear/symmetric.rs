//! Small symmetric matrices: the least eigenvalue, by rotations.
//!
//! Source: C. G. J. Jacobi, Journal für die reine und angewandte Mathematik 30, 1846; in the cyclic order of G. E. Forsythe
//! and P. Henrici, Transactions of the AMS 94, 1960.

/// The least eigenvalue of a symmetric matrix given by rows, and an eigenvector of length 1. Of the matrix only what is on
/// and above the diagonal is read. Cost: n³ a sweep, a handful of sweeps.
pub fn least_eigenvalue(rows: &[Vec<f64>]) -> Option<(f64, Vec<f64>)> {
    let n = rows.len();
    if rows.iter().any(|row| row.len() != n || row.iter().any(|x| !x.is_finite())) {
        return None;
    }
    let mut a: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| rows[i.min(j)][i.max(j)]).collect()).collect();
    let mut vectors: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    const SWEEPS: usize = 60;
    for _ in 0..SWEEPS {
        let size: f64 = a.iter().flatten().map(|x| x * x).sum();
        let off: f64 =
            (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j] * a[i][j]).sum();
        if off <= 1e-34 * size {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let least = (0..n).min_by(|i, j| a[*i][*i].total_cmp(&a[*j][*j]))?;
    Some((a[least][least], vectors.iter().map(|row| row[least]).collect()))
}

/// Makes a[p][q] vanish.
fn rotate(a: &mut [Vec<f64>], vectors: &mut [Vec<f64>], p: usize, q: usize) {
    if a[p][q] == 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / t.hypot(1.0);
    let sine = t * cosine;
    for row in a.iter_mut().chain(vectors.iter_mut()) {
        (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
    }
    // p < q.
    let (above, below) = a.split_at_mut(q);
    for (x, y) in above[p].iter_mut().zip(&mut below[0]) {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_nalgebra() {
        let mut seed = 0x1234_5678_9abc_def1u64;
        for n in 1..9 {
            for _ in 0..20 {
                let mut random = || {
                    seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
                };
                let mut rows = vec![vec![0.0; n]; n];
                for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
                    rows[i][j] = random();
                    rows[j][i] = rows[i][j];
                }
                let dense = nalgebra::DMatrix::from_fn(n, n, |i, j| rows[i][j]);
                let reference = dense.symmetric_eigenvalues().min();
                let (value, vector) = least_eigenvalue(&rows).unwrap();
                assert!((value - reference).abs() < 1e-12, "{value} {reference}");
                for i in 0..n {
                    let product: f64 = (0..n).map(|j| rows[i][j] * vector[j]).sum();
                    assert!((product - value * vector[i]).abs() < 1e-12);
                }
            }
        }
        assert_eq!(least_eigenvalue(&[vec![1.0, f64::NAN], vec![0.0, 1.0]]), None);
    }
}
