//! Numbers with a derivative along one direction.

use std::ops::{Add, Div, Mul, Sub};

/// A value and its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    pub value: f64,
    pub slope: f64,
}

impl From<f64> for Dual {
    fn from(value: f64) -> Dual {
        Dual { value, slope: 0.0 }
    }
}

impl Add for Dual {
    type Output = Dual;
    fn add(self, other: Dual) -> Dual {
        Dual { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl Sub for Dual {
    type Output = Dual;
    fn sub(self, other: Dual) -> Dual {
        Dual { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl Mul for Dual {
    type Output = Dual;
    fn mul(self, other: Dual) -> Dual {
        let slope = self.slope * other.value + self.value * other.slope;
        Dual { value: self.value * other.value, slope }
    }
}

impl Div for Dual {
    type Output = Dual;
    fn div(self, other: Dual) -> Dual {
        let value = self.value / other.value;
        Dual { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

impl Dual {
    /// A function with the derivative `slope` at the value.
    fn through(self, value: f64, slope: f64) -> Dual {
        let slope = if self.slope == 0.0 { 0.0 } else { slope * self.slope };
        Dual { value, slope }
    }

    /// A function of one argument by its name.
    pub fn call(self, name: &str) -> Dual {
        let x = self.value;
        match name {
            "abs" => self.through(x.abs(), if x < 0.0 { -1.0 } else { 1.0 }),
            "sqrt" => self.through(x.sqrt(), 0.5 / x.sqrt()),
            "exp" => self.through(x.exp(), x.exp()),
            "ln" => self.through(x.ln(), 1.0 / x),
            "sin" => self.through(x.sin(), x.cos()),
            "cos" => self.through(x.cos(), -x.sin()),
            "tan" => self.through(x.tan(), 1.0 + x.tan() * x.tan()),
            "asin" => self.through(x.asin(), 1.0 / (1.0 - x * x).sqrt()),
            "acos" => self.through(x.acos(), -1.0 / (1.0 - x * x).sqrt()),
            "atan" => self.through(x.atan(), 1.0 / (1.0 + x * x)),
            "sinh" => self.through(x.sinh(), x.cosh()),
            "cosh" => self.through(x.cosh(), x.sinh()),
            "tanh" => self.through(x.tanh(), 1.0 - x.tanh() * x.tanh()),
            other => panic!("no function is called {other}"),
        }
    }
}
