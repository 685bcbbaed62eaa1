//! The table of functions: name, number of arguments, value, derivative, spelling in each dialect.

/// A function that expressions may call; its row in [`FUNCTIONS`] says the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Function {
    Abs,
    /// −1, 0 or 1.
    Sign,
    Sqrt,
    Exp,
    Ln,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Sinh,
    Cosh,
    Tanh,
    Min,
    Max,
    /// `clamp(x, lo, hi)`
    Clamp,
    Floor,
    /// `mod(x, y)` with the divisor's sign.
    Mod,
    /// `|x|^y` (SPICE's `pow` of ngspice, LTspice's `pwr`).
    PowerOfAbs,
    /// `sign(x)·|x|^y` (ngspice's `pwr`).
    SignedPower,
}

/// One row of the table.
pub struct Row {
    /// The function.
    pub function: Function,
    /// Its name in `.bg`.
    pub name: &'static str,
    /// Fewest and most arguments.
    pub arguments: (usize, usize),
}

/// Every function, one row each.
pub const FUNCTIONS: &[Row] = &[];
