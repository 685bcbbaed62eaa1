//! Small dense systems.

/// Solves A·X = B by Gaussian elimination with partial pivoting. `a` has `n` rows and is used up, `b` has as many of `width`
/// and becomes X, both row by row. False where A is singular or a value no finite number; then `b` means nothing.
pub fn eliminate(n: usize, a: &mut [f64], width: usize, b: &mut [f64]) -> bool {
    for k in 0..n {
        let size_of = |a: &[f64], row: usize| a[row * n + k].abs();
        let best = (k..n).max_by(|i, j| size_of(a, *i).total_cmp(&size_of(a, *j)));
        // A comparison that NaN fails.
        let Some(best) = best.filter(|best| size_of(a, *best) > 0.0) else { return false };
        let pivot = 1.0 / a[best * n + k];
        for (matrix, width) in [(&mut *a, n), (&mut *b, width)] {
            if best > k {
                let (above, below) = matrix.split_at_mut(best * width);
                above[k * width..(k + 1) * width].swap_with_slice(&mut below[..width]);
            }
            matrix[k * width..(k + 1) * width].iter_mut().for_each(|value| *value *= pivot);
        }
        for row in (0..n).filter(|row| *row != k) {
            let factor = a[row * n + k];
            if factor == 0.0 {
                continue;
            }
            for (matrix, width) in [(&mut *a, n), (&mut *b, width)] {
                for column in 0..width {
                    matrix[row * width + column] -= factor * matrix[k * width + column];
                }
            }
        }
    }
    b[..n * width].iter().all(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::eliminate;

    #[test]
    fn solutions_solve_and_singular_systems_have_none() {
        let a = [0.0, 2.0, 1.0, 1.0, 1e-3, 0.0, 4.0, -1.0, 3.0];
        let b = [1.0, 0.0, -2.0, 5.0, 3.0, 1e-3];
        let mut x = b;
        assert!(eliminate(3, &mut a.clone(), 2, &mut x));
        for (row, b) in a.chunks(3).zip(b.chunks(2)) {
            for (column, b) in b.iter().enumerate() {
                let sum: f64 = row.iter().zip(x.chunks(2)).map(|(a, x)| a * x[column]).sum();
                assert!((sum - b).abs() < 1e-12, "{x:?}");
            }
        }
        assert!(!eliminate(2, &mut [1.0, 2.0, 2.0, 4.0], 1, &mut [1.0, 1.0]));
        assert!(!eliminate(1, &mut [f64::NAN], 1, &mut [1.0]));
        assert!(!eliminate(1, &mut [1e-300], 1, &mut [1e300]));
    }
}
