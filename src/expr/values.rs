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

/// tanh x: near 0 the eighth convergent of its continued fraction x/(1 + x²/(3 + x²/(5 + …))) (J. H. Lambert, 1761), which is
/// off by less than x¹⁶/10¹³ of itself there; elsewhere by an exponential, which loses nothing.
pub(super) fn tanh(x: f64) -> f64 {
    const SMALL: f64 = 0.6;
    /// From here on 1 is nearer than any other number.
    const LARGE: f64 = 20.0;
    let size = x.abs();
    if size < SMALL {
        let z = x * x;
        let above = 2_027_025.0 + z * (270_270.0 + z * (6_930.0 + z * 36.0));
        let below = 2_027_025.0 + z * (945_945.0 + z * (51_975.0 + z * (630.0 + z)));
        return x * above / below;
    }
    if size >= LARGE {
        return 1f64.copysign(x);
    }
    (1.0 - 2.0 / (libm::exp(2.0 * size) + 1.0)).copysign(x)
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

    #[test]
    fn the_hyperbolic_tangent_is_exact_to_its_last_digits() {
        let mut worst = 0.0f64;
        for k in 0..400_000u32 {
            let x = f64::from(k) * 6.1e-5;
            let (own, other) = (tanh(x), libm::tanh(x));
            worst = worst.max((own - other).abs() / (f64::EPSILON * other.max(f64::MIN_POSITIVE)));
            assert_eq!(tanh(-x), -own);
        }
        // In units of the last digit of 1; either may be off by one.
        assert!(worst <= 2.0, "{worst}");
        for x in [1e-300, 1e-8, 5e-324, 0.0, 19.9, 1e3, f64::INFINITY] {
            assert!((tanh(x) - libm::tanh(x)).abs() <= 1e-15 * libm::tanh(x), "{x:e}");
        }
        assert!(tanh(f64::NAN).is_nan());
        assert_eq!(tanh(-0.0).to_bits(), (-0.0f64).to_bits());
    }
}
