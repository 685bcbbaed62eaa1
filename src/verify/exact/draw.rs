//! Random elements of a prime field: the same for the same seed and question, whoever asks and in whatever order.

use crate::linear::{Field, Prime};

/// A prime field, as far as the certificate needs one.
pub trait Modular: Field + Eq {
    /// The number of its elements.
    const MODULUS: u64;
    /// A whole number, reduced.
    fn new(value: u64) -> Self;
    /// Its representative.
    fn value(self) -> u64;
    /// A power.
    fn pow(self, exponent: u64) -> Self;
}

impl<const K: u32, const C: u64> Modular for Prime<K, C> {
    const MODULUS: u64 = Prime::<K, C>::MODULUS;
    fn new(value: u64) -> Self {
        Prime::new(value)
    }
    fn value(self) -> u64 {
        Prime::value(self)
    }
    fn pow(self, exponent: u64) -> Self {
        Prime::pow(self, exponent)
    }
}

/// What a random number stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Of {
    /// s of the Laplace transform.
    S,
    Time,
    Parameter(usize),
    /// What a port's storage starts from: its power variable, or what it stores.
    InitialPower(u32, u32),
    InitialStored(u32, u32),
    InitialSignal(usize),
    /// A waveform, by its signal.
    Waveform(usize),
    /// The value of a law of a port that is cut, at 0 and by its own variable.
    Offset(u32, u32),
    Slope(u32, u32),
    /// The value of a signal whose law is cut, and of what a memory remembers.
    Signal(usize),
    Remembered(usize),
    /// A source that nobody claims, and a switch's conductance, by device.
    Unclaimed(usize),
    Switch(usize),
}

impl Of {
    fn words(self) -> [u64; 3] {
        let one = |kind: u64, k: usize| [kind, k as u64, 0];
        let two = |kind: u64, a: u32, b: u32| [kind, u64::from(a), u64::from(b)];
        match self {
            Of::S => [0, 0, 0],
            Of::Time => [1, 0, 0],
            Of::Parameter(k) => one(2, k),
            Of::InitialPower(a, b) => two(3, a, b),
            Of::InitialStored(a, b) => two(4, a, b),
            Of::InitialSignal(k) => one(5, k),
            Of::Waveform(k) => one(6, k),
            Of::Offset(a, b) => two(7, a, b),
            Of::Slope(a, b) => two(8, a, b),
            Of::Signal(k) => one(9, k),
            Of::Remembered(k) => one(10, k),
            Of::Unclaimed(k) => one(11, k),
            Of::Switch(k) => one(12, k),
        }
    }
}

/// One draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Everything follows from it.
    pub seed: u64,
}

/// Steele, Lea and Flood's mixing of 64 bits (SplitMix, 2014).
pub fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl Draw {
    fn element<F: Modular>(self, words: impl IntoIterator<Item = u64>) -> F {
        let hash = words.into_iter().fold(self.seed, |hash, word| mix(hash ^ mix(word)));
        // 128 random bits, so that no remainder is likelier than another by more than 2⁻⁶⁶.
        let wide = (u128::from(mix(hash)) << 64) | u128::from(mix(!hash));
        F::new((wide % u128::from(F::MODULUS)) as u64)
    }

    /// The random number of a thing.
    pub fn of<F: Modular>(self, what: Of) -> F {
        self.element(what.words())
    }

    /// The value of a function that means nothing in the field: equal for equal names and equal arguments.
    pub fn opaque<F: Modular>(self, name: u64, arguments: &[F]) -> F {
        self.element(
            [0x6f70_6171_7565, name].into_iter().chain(arguments.iter().map(|a| a.value())),
        )
    }
}

/// A square root. The modulus is 3 more than a multiple of 4: of a square it is the root that is itself a square, and
/// of a product always the product of the roots.
pub fn square_root<F: Modular>(x: F) -> F {
    x.pow(F::MODULUS / 4 + 1)
}

/// A number as it is written: its shortest decimal digits are a fraction of whole numbers.
pub fn decimal<F: Modular>(value: f64) -> Option<F> {
    if value == 0.0 || !value.is_finite() {
        return value.is_finite().then_some(F::ZERO);
    }
    if value.fract() == 0.0 && value.abs() < 9e15 {
        let size = F::new(value.abs() as u64);
        return Some(if value < 0.0 { -size } else { size });
    }
    let text = format!("{:e}", value.abs());
    let (digits, exponent) = text.split_once('e')?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let number: u64 = format!("{whole}{fraction}").parse().ok()?;
    let exponent = exponent.parse::<i64>().ok()? - fraction.len() as i64;
    let power = F::new(10).pow(exponent.unsigned_abs());
    let size = if exponent < 0 { F::new(number) / power } else { F::new(number) * power };
    Some(if value < 0.0 { -size } else { size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{Prime61, Prime62};

    #[test]
    fn decimals_are_fractions() {
        let tenth = decimal::<Prime61>(0.1).unwrap();
        assert_eq!(tenth * Prime61::new(10), Prime61::new(1));
        assert_eq!(
            decimal::<Prime62>(-2.5e-3).unwrap() * Prime62::new(400),
            Prime62::from_signed(-1)
        );
        assert_eq!(decimal::<Prime62>(8e300).unwrap(), Prime62::new(8) * Prime62::new(10).pow(300));
        assert_eq!(decimal::<Prime61>(f64::NAN), None);
    }

    #[test]
    fn roots_multiply() {
        let (a, b) = (Prime62::new(123_456_789), Prime62::new(987_654_321));
        assert_eq!(square_root(a) * square_root(b), square_root(a * b));
        assert_eq!(square_root(a * a) * square_root(a * a), a * a);
    }

    #[test]
    fn draws_repeat_and_differ() {
        let draw = Draw { seed: 7 };
        let x: Prime61 = draw.of(Of::Parameter(3));
        assert_eq!(x, draw.of(Of::Parameter(3)));
        assert_ne!(x, draw.of(Of::Parameter(4)));
        assert_ne!(x, draw.of(Of::Waveform(3)));
        assert_ne!(x, Draw { seed: 8 }.of(Of::Parameter(3)));
    }
}
