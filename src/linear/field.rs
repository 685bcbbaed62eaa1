//! The numbers that matrices are made of: real, complex, and the prime field of 2⁶¹ − 1 elements.

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

/// A whole number modulo the Mersenne prime 2⁶¹ − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Prime61(u64);

impl Prime61 {
    /// The modulus.
    pub const MODULUS: u64 = (1 << 61) - 1;

    /// A whole number, reduced.
    pub fn new(value: u64) -> Prime61 {
        Prime61(value % Prime61::MODULUS)
    }

    /// A whole number of either sign, reduced.
    pub fn from_signed(value: i64) -> Prime61 {
        let size = Prime61::new(value.unsigned_abs());
        if value < 0 { -size } else { size }
    }

    /// The representative in 0 ..= 2⁶¹ − 2.
    pub fn value(self) -> u64 {
        self.0
    }

    /// A power.
    pub fn pow(self, mut exponent: u64) -> Prime61 {
        let (mut base, mut result) = (self, Prime61(1));
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        result
    }

    /// 1/self by Fermat's little theorem; 0 has none.
    pub fn inverse(self) -> Option<Prime61> {
        (self.0 != 0).then(|| self.pow(Prime61::MODULUS - 2))
    }
}

impl Add for Prime61 {
    type Output = Prime61;
    fn add(self, b: Prime61) -> Prime61 {
        let sum = self.0 + b.0;
        Prime61(if sum >= Prime61::MODULUS { sum - Prime61::MODULUS } else { sum })
    }
}

impl Sub for Prime61 {
    type Output = Prime61;
    fn sub(self, b: Prime61) -> Prime61 {
        self + -b
    }
}

impl Mul for Prime61 {
    type Output = Prime61;
    /// 2⁶¹ ≡ 1, so the high bits are added to the low ones.
    fn mul(self, b: Prime61) -> Prime61 {
        let product = u128::from(self.0) * u128::from(b.0);
        let low = (product as u64) & Prime61::MODULUS;
        let high = (product >> 61) as u64;
        Prime61(low) + Prime61(high)
    }
}

impl Div for Prime61 {
    type Output = Prime61;
    /// Division by 0 gives 0; elimination asks before it divides.
    fn div(self, b: Prime61) -> Prime61 {
        b.inverse().map_or(Prime61(0), |inverse| self * inverse)
    }
}

impl Neg for Prime61 {
    type Output = Prime61;
    fn neg(self) -> Prime61 {
        Prime61(if self.0 == 0 { 0 } else { Prime61::MODULUS - self.0 })
    }
}

impl Field for Prime61 {
    const EXACT: bool = true;
    const ZERO: Prime61 = Prime61(0);
    const ONE: Prime61 = Prime61(1);
    fn magnitude(self) -> f64 {
        if self.0 == 0 { 0.0 } else { 1.0 }
    }
    fn is_finite(self) -> bool {
        true
    }
    fn scaled(self, _: f64) -> Prime61 {
        self
    }
}
