//! How many roots det(G + s·C) has: its degree, worked out exactly modulo a prime.
//!
//! Values are taken at whole numbers s; the degree is the order of the last divided difference that is not 0. Matrices
//! of numbers in floating point cancel to rounding and hide which roots are infinite; these cancel to 0.

use super::{Pencil, Trouble};
use crate::linear::{Field, Lu, Prime62};

/// The degree; an error where the determinant is 0 for every s.
pub fn degree(pencil: &Pencil, go_on: &dyn Fn() -> bool) -> Result<usize, Trouble> {
    let most = pencil.rank_bound();
    let mut differences: Vec<Prime62> = vec![];
    let points: Vec<Prime62> = (0..=most as u64).map(|k| Prime62::new(0x2545_f491 + k)).collect();
    let fixed: Vec<Prime62> = pencil.fixed.iter().map(|value| exact(*value)).collect();
    let storage: Vec<Prime62> = pencil.storage.iter().map(|value| exact(*value)).collect();
    for s in &points {
        if !go_on() {
            return Err(Trouble::Stopped);
        }
        let values: Vec<Prime62> = fixed.iter().zip(&storage).map(|(g, c)| *g + *s * *c).collect();
        let mut value = match Lu::factor(&pencil.pattern, &values) {
            Ok(lu) => determinant(&lu),
            Err(_) => Prime62::ZERO,
        };
        for (j, difference) in differences.iter().enumerate() {
            value = (value - *difference) / (*s - points[j]);
        }
        differences.push(value);
    }
    differences.iter().rposition(|difference| !difference.is_zero()).ok_or(Trouble::Singular)
}

/// A number in floating point, which is a whole number times a power of two.
fn exact(value: f64) -> Prime62 {
    if value == 0.0 || !value.is_finite() {
        return Prime62::ZERO;
    }
    let bits = value.to_bits();
    let power = ((bits >> 52) & 0x7ff) as i64;
    let mantissa = (bits & ((1 << 52) - 1)) | if power > 0 { 1 << 52 } else { 0 };
    let power = power.max(1) - 1075;
    let two = Prime62::new(2).pow(power.unsigned_abs());
    let size = Prime62::new(mantissa);
    let size = if power < 0 { size / two } else { size * two };
    if value < 0.0 { -size } else { size }
}

/// The product of the pivots, with the sign of the order.
fn determinant(lu: &Lu<Prime62>) -> Prime62 {
    let product = lu.pivots().fold(Prime62::ONE, |product, pivot| product * pivot);
    if lu.is_odd() { -product } else { product }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_floating_point_are_exact() {
        let three = exact(0.75) * Prime62::new(4);
        assert_eq!(three, Prime62::new(3));
        assert_eq!(exact(-6.0), -Prime62::new(6));
        assert_ne!(exact(0.1) + exact(0.2), exact(0.1 + 0.2));
        assert_eq!(exact(5e-324) * Prime62::new(2).pow(1074), Prime62::ONE);
    }
}
