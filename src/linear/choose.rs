//! Scaling, and which way of choosing pivots: Markowitz for small matrices, an order beforehand for large ones.

use super::pivots::{Cause, Elimination, Singular};
use super::{Field, Pattern, degree, gilbert, markowitz, matching};

/// Pivots for scaled values.
pub fn choose_pivots<T: Field>(
    pattern: &Pattern,
    scaled: &[T],
    small: bool,
) -> Result<Elimination<T>, Singular> {
    let structural = |matching: &matching::Matching| Singular {
        cause: Cause::Structural,
        rows: matching.overdetermined(pattern),
        columns: matching.underdetermined(pattern),
    };
    if small {
        return markowitz::eliminate(pattern, scaled).map_err(|numeric| {
            let matching = matching::maximum_matching(pattern, |_| true);
            if matching.is_perfect() { numeric } else { structural(&matching) }
        });
    }
    // Diagonals that are not small, as nodes have, make good pivots; branches without one take a row of their nodes.
    let matching = matching::maximum_matching(pattern, |slot| scaled[slot].magnitude() > 0.01);
    if !matching.is_perfect() {
        return Err(structural(&matching));
    }
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); pattern.n];
    for j in 0..pattern.n {
        for slot in pattern.column(j) {
            let i = matching.column_of[pattern.rows[slot] as usize];
            if i as usize != j {
                neighbours[i as usize].push(j as u32);
                neighbours[j].push(i);
            }
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    let order = degree::minimum_degree(neighbours);
    gilbert::eliminate(pattern, scaled, &order, &matching.row_of)
}

/// Powers of two for rows and columns that bring the largest entry of each near to 1 (Ruiz, 2001).
pub fn equilibrate<T: Field>(pattern: &Pattern, values: &[T]) -> (Vec<f64>, Vec<f64>) {
    let n = pattern.n;
    let (mut rows, mut columns) = (vec![0i32; n], vec![0i32; n]);
    if !T::EXACT {
        for _ in 0..4 {
            let (mut row_largest, mut column_largest) = (vec![i32::MIN; n], vec![i32::MIN; n]);
            for j in 0..n {
                for slot in pattern.column(j) {
                    let size = values[slot].magnitude();
                    if size > 0.0 {
                        let i = pattern.rows[slot] as usize;
                        let exponent = exponent(size) + rows[i] + columns[j];
                        row_largest[i] = row_largest[i].max(exponent);
                        column_largest[j] = column_largest[j].max(exponent);
                    }
                }
            }
            let adjust = |scales: &mut [i32], largest: &[i32]| {
                for (scale, &largest) in scales.iter_mut().zip(largest) {
                    if largest != i32::MIN {
                        *scale = (*scale - largest.div_euclid(2)).clamp(-500, 500);
                    }
                }
            };
            adjust(&mut rows, &row_largest);
            adjust(&mut columns, &column_largest);
        }
    }
    let power = |scales: Vec<i32>| {
        scales.into_iter().map(|k| f64::from_bits(((1023 + k) as u64) << 52)).collect()
    };
    (power(rows), power(columns))
}

/// The whole part of log₂ of a positive number.
fn exponent(size: f64) -> i32 {
    let bits = (size.to_bits() >> 52) as i32 & 0x7ff;
    if bits == 0 { exponent(size * 18_014_398_509_481_984.0) - 54 } else { bits - 1023 }
}
