//! Complex numbers with a derivative: what elimination makes of a matrix A(s), it makes of dA/ds at once.

use crate::linear::{Complex, Field};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// value + slope·ε, where ε² = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    pub value: Complex,
    pub slope: Complex,
}

impl Add for Dual {
    type Output = Dual;
    fn add(self, b: Dual) -> Dual {
        Dual { value: self.value + b.value, slope: self.slope + b.slope }
    }
}

impl Sub for Dual {
    type Output = Dual;
    fn sub(self, b: Dual) -> Dual {
        Dual { value: self.value - b.value, slope: self.slope - b.slope }
    }
}

impl Mul for Dual {
    type Output = Dual;
    fn mul(self, b: Dual) -> Dual {
        Dual { value: self.value * b.value, slope: self.value * b.slope + self.slope * b.value }
    }
}

impl Div for Dual {
    type Output = Dual;
    fn div(self, b: Dual) -> Dual {
        let value = self.value / b.value;
        Dual { value, slope: (self.slope - value * b.slope) / b.value }
    }
}

impl Neg for Dual {
    type Output = Dual;
    fn neg(self) -> Dual {
        Dual { value: -self.value, slope: -self.slope }
    }
}

impl Field for Dual {
    const EXACT: bool = false;
    const ZERO: Dual = Dual { value: Complex::ZERO, slope: Complex::ZERO };
    const ONE: Dual = Dual { value: Complex::ONE, slope: Complex::ZERO };
    fn magnitude(self) -> f64 {
        self.value.magnitude()
    }
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.slope.is_finite()
    }
    fn scaled(self, by: f64) -> Dual {
        Dual { value: self.value.scaled(by), slope: self.slope.scaled(by) }
    }
}
