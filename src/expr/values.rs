//! The values of powers, limits, signs and remainders: what the standard library leaves open is fixed here.

/// −1, 0 or 1; NaN of NaN.
pub fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x * 0.0
    }
}

/// The smaller; NaN when either is.
pub fn min(x: f64, y: f64) -> f64 {
    if x < y || x.is_nan() { x } else { y }
}

/// The larger; NaN when either is.
pub fn max(x: f64, y: f64) -> f64 {
    if x > y || x.is_nan() { x } else { y }
}

pub(super) fn clamp(x: f64, low: f64, high: f64) -> f64 {
    min(max(x, low), high)
}

/// atan2 in which zero has no sign: a product that was simplified to 0 must not turn the angle round.
pub(super) fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y + 0.0, x + 0.0)
}

/// The remainder with the divisor's sign.
pub(super) fn modulo(x: f64, y: f64) -> f64 {
    let remainder = libm::fmod(x, y);
    if remainder != 0.0 && (remainder < 0.0) != (y < 0.0) { remainder + y } else { remainder }
}

/// The real power x^y. Whole exponents up to 64 by multiplication, ½ by the square root; a negative base needs a
/// whole exponent, else the value is NaN.
pub fn power(x: f64, y: f64) -> f64 {
    if y == 2.0 {
        return x * x;
    }
    if y == 0.5 {
        return x.sqrt();
    }
    if y.abs() <= 64.0 && y == y.trunc() {
        let whole = whole_power(x, y.abs() as u32);
        return if y < 0.0 { 1.0 / whole } else { whole };
    }
    libm::pow(x, y)
}

fn whole_power(x: f64, mut exponent: u32) -> f64 {
    let (mut result, mut square) = (1.0, x);
    while exponent > 0 {
        if exponent & 1 == 1 {
            result *= square;
        }
        exponent >>= 1;
        if exponent > 0 {
            square *= square;
        }
    }
    result
}

pub(super) fn power_of_abs(x: f64, y: f64) -> f64 {
    power(x.abs(), y)
}

pub(super) fn signed_power(x: f64, y: f64) -> f64 {
    // 0 at 0 for every y, as an odd function has it; sign·∞ would be NaN.
    if x == 0.0 { 0.0 } else { sign(x) * power(x.abs(), y) }
}

/// The real part of x^y. Whole exponents keep the sign of an odd power exactly, and roots of a negative number that are
/// wholly imaginary have none, rather than rounding.
pub(super) fn real_power(x: f64, y: f64) -> f64 {
    if x >= 0.0 || y == y.trunc() || x.is_nan() {
        return power(x, y);
    }
    if (y - y.trunc()).abs() == 0.5 {
        return 0.0;
    }
    power(-x, y) * libm::cos(std::f64::consts::PI * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_real() {
        assert_eq!(power(-0.3, 3.0), -0.3 * (-0.3 * -0.3));
        assert_eq!(power(-2.0, -2.0), 0.25);
        assert_eq!(power(0.0, 0.0), 1.0);
        assert!(power(-1.0, 0.4).is_nan());
        assert_eq!(
            (real_power(-4.0, 0.5), real_power(-4.0, -1.5), real_power(4.0, 0.5)),
            (0.0, 0.0, 2.0)
        );
        assert_eq!(signed_power(-4.0, 0.5), -2.0);
        assert_eq!(power_of_abs(-3.0, 3.0), 27.0);
        assert_eq!(modulo(-1.0, 3.0), 2.0);
        assert_eq!(modulo(1.0, -3.0), -2.0);
    }

    #[test]
    fn nan_is_not_hidden_by_min_and_max() {
        for (x, y) in [(f64::NAN, 1.0), (1.0, f64::NAN)] {
            assert!(min(x, y).is_nan() && max(x, y).is_nan());
        }
    }
}
