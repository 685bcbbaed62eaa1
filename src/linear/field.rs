//! The numbers that matrices are made of: real, complex, and two large prime fields.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A field, as far as elimination needs one.
pub trait Field:
    Copy
    + Debug
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Whether arithmetic is exact: then any pivot but 0 will do, and nothing is scaled.
    const EXACT: bool;
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Whether it is exactly 0.
    fn is_zero(self) -> bool {
        self == Self::ZERO
    }
    /// A size for choosing pivots; 1 or 0 in an exact field.
    fn magnitude(self) -> f64;
    /// Whether it is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// Times a power of two; exact fields stay as they are.
    fn scaled(self, by: f64) -> Self;
}

impl Field for f64 {
    const EXACT: bool = false;
    const ZERO: f64 = 0.0;
    const ONE: f64 = 1.0;
    fn magnitude(self) -> f64 {
        self.abs()
    }
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    fn scaled(self, by: f64) -> f64 {
        self * by
    }
}

/// A complex number.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// re + i·im.
    pub fn new(re: f64, im: f64) -> Complex {
        Complex { re, im }
    }
}

impl From<f64> for Complex {
    fn from(re: f64) -> Complex {
        Complex { re, im: 0.0 }
    }
}

impl Add for Complex {
    type Output = Complex;
    fn add(self, b: Complex) -> Complex {
        Complex::new(self.re + b.re, self.im + b.im)
    }
}

impl Sub for Complex {
    type Output = Complex;
    fn sub(self, b: Complex) -> Complex {
        Complex::new(self.re - b.re, self.im - b.im)
    }
}

impl Mul for Complex {
    type Output = Complex;
    fn mul(self, b: Complex) -> Complex {
        Complex::new(self.re * b.re - self.im * b.im, self.re * b.im + self.im * b.re)
    }
}

impl Div for Complex {
    type Output = Complex;
    /// Smith's way (1962), which neither overflows nor underflows on the way.
    fn div(self, b: Complex) -> Complex {
        if b.re.abs() >= b.im.abs() {
            let ratio = b.im / b.re;
            let bottom = b.re + b.im * ratio;
            Complex::new((self.re + self.im * ratio) / bottom, (self.im - self.re * ratio) / bottom)
        } else {
            let ratio = b.re / b.im;
            let bottom = b.re * ratio + b.im;
            Complex::new((self.re * ratio + self.im) / bottom, (self.im * ratio - self.re) / bottom)
        }
    }
}

impl Neg for Complex {
    type Output = Complex;
    fn neg(self) -> Complex {
        Complex::new(-self.re, -self.im)
    }
}

impl Field for Complex {
    const EXACT: bool = false;
    const ZERO: Complex = Complex { re: 0.0, im: 0.0 };
    const ONE: Complex = Complex { re: 1.0, im: 0.0 };
    fn magnitude(self) -> f64 {
        self.re.abs() + self.im.abs()
    }
    fn is_finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }
    fn scaled(self, by: f64) -> Complex {
        Complex::new(self.re * by, self.im * by)
    }
}

/// A whole number modulo the prime 2^K − C, where C is small.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Prime<const K: u32, const C: u64>(u64);

/// Modulo the Mersenne prime 2⁶¹ − 1.
pub type Prime61 = Prime<61, 1>;

/// Modulo the prime 2⁶² − 57.
pub type Prime62 = Prime<62, 57>;

impl<const K: u32, const C: u64> Prime<K, C> {
    /// The modulus.
    pub const MODULUS: u64 = (1 << K) - C;

    /// A whole number, reduced.
    pub fn new(value: u64) -> Self {
        Prime(value % Self::MODULUS)
    }

    /// A whole number of either sign, reduced.
    pub fn from_signed(value: i64) -> Self {
        let size = Self::new(value.unsigned_abs());
        if value < 0 { -size } else { size }
    }

    /// The representative from 0 up.
    pub fn value(self) -> u64 {
        self.0
    }

    /// A power.
    pub fn pow(self, mut exponent: u64) -> Self {
        let (mut base, mut result) = (self, Prime(1));
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        result
    }

    /// 1/self by Euclid's algorithm; 0 has none.
    pub fn inverse(self) -> Option<Self> {
        if self.0 == 0 {
            return None;
        }
        // rest = factor·self + …·modulus throughout; factors stay below the modulus in size.
        let (mut rest, mut factor) = ((Self::MODULUS, self.0), (0i64, 1i64));
        while rest.1 != 0 {
            let quotient = rest.0 / rest.1;
            rest = (rest.1, rest.0 - quotient * rest.1);
            factor = (factor.1, factor.0.wrapping_sub((quotient as i64).wrapping_mul(factor.1)));
        }
        Some(Self::from_signed(factor.0))
    }
}

impl<const K: u32, const C: u64> Add for Prime<K, C> {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        let sum = self.0 + b.0;
        Prime(if sum >= Self::MODULUS { sum - Self::MODULUS } else { sum })
    }
}

impl<const K: u32, const C: u64> Sub for Prime<K, C> {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl<const K: u32, const C: u64> Mul for Prime<K, C> {
    type Output = Self;
    /// 2^K ≡ C, so the high bits are added C times to the low ones, twice.
    fn mul(self, b: Self) -> Self {
        let mask = (1u128 << K) - 1;
        let product = u128::from(self.0) * u128::from(b.0);
        let once = (product & mask) + (product >> K) * u128::from(C);
        let twice = (once & mask) as u64 + (once >> K) as u64 * C;
        Prime(if twice >= Self::MODULUS { twice - Self::MODULUS } else { twice })
    }
}

impl<const K: u32, const C: u64> Div for Prime<K, C> {
    type Output = Self;
    /// Division by 0 gives 0; elimination asks before it divides.
    fn div(self, b: Self) -> Self {
        b.inverse().map_or(Prime(0), |inverse| self * inverse)
    }
}

impl<const K: u32, const C: u64> Neg for Prime<K, C> {
    type Output = Self;
    fn neg(self) -> Self {
        Prime(if self.0 == 0 { 0 } else { Self::MODULUS - self.0 })
    }
}

impl<const K: u32, const C: u64> Field for Prime<K, C> {
    const EXACT: bool = true;
    const ZERO: Self = Prime(0);
    const ONE: Self = Prime(1);
    fn magnitude(self) -> f64 {
        if self.0 == 0 { 0.0 } else { 1.0 }
    }
    fn is_finite(self) -> bool {
        true
    }
    fn scaled(self, _: f64) -> Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Miller and Rabin with bases that decide every number below 2⁶⁴ (J. Sorenson, J. Webster, 2015).
    fn is_prime(n: u64) -> bool {
        let power = |mut base: u128, mut exponent: u64| {
            let mut result = 1u128;
            while exponent > 0 {
                if exponent & 1 == 1 {
                    result = result * base % u128::from(n);
                }
                base = base * base % u128::from(n);
                exponent >>= 1;
            }
            result
        };
        let twos = (n - 1).trailing_zeros();
        [2u128, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37].into_iter().all(|base| {
            let mut x = power(base, (n - 1) >> twos);
            if x == 1 || x == u128::from(n - 1) {
                return true;
            }
            (1..twos).any(|_| {
                x = x * x % u128::from(n);
                x == u128::from(n - 1)
            })
        })
    }

    fn field<const K: u32, const C: u64>() {
        let p = Prime::<K, C>::MODULUS;
        assert!(is_prime(p) && !is_prime(p - 2), "{p}");
        let mut x = Prime::<K, C>::new(0x9e37_79b9_7f4a_7c15);
        for edge in [1, 2, p - 1, p - 2, p / 2] {
            let edge = Prime::<K, C>::new(edge);
            for _ in 0..100 {
                x = x * x + edge;
                let y = x + x.pow(3);
                let product =
                    (u128::from(x.value()) * u128::from(y.value()) % u128::from(p)) as u64;
                assert_eq!((x * y).value(), product);
                let inverse = y.inverse().unwrap();
                assert_eq!(y * inverse, Prime::ONE);
                assert_eq!(inverse, y.pow(p - 2), "Fermat's little theorem");
                assert_eq!(x - y + y, x);
            }
            assert_eq!(edge * edge.inverse().unwrap(), Prime::ONE);
        }
        assert_eq!(Prime::<K, C>::ZERO.inverse(), None);
    }

    #[test]
    fn both_primes_make_fields() {
        field::<61, 1>();
        field::<62, 57>();
    }
}
