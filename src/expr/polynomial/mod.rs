//! Polynomials of many variables with whole coefficients, sparse.
//!
//! A monomial packs its exponents into bytes, the first variable in the highest, so that comparing words compares
//! lexicographically; a polynomial is a list of terms in falling order. Sizes are bounded: what grows beyond [`MOST_TERMS`]
//! or the exponents that fit is [`TooLarge`].

mod gcd;
#[cfg(test)]
mod tests;

pub use gcd::divisor;
use num_bigint::BigInt;
use num_bigint::Sign;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// Variables at most.
pub const VARIABLES: usize = 8 * WORDS;
const WORDS: usize = 6;
/// The high bit of every exponent, which stays free.
const HIGH: u64 = 0x8080_8080_8080_8080;
/// Terms of one polynomial at most.
pub const MOST_TERMS: usize = 200_000;
/// Products of terms within one multiplication or division at most.
const MOST_PRODUCTS: usize = 20_000_000;

/// A polynomial grew beyond all bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

/// Exponents of all variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Monomial([u64; WORDS]);

impl Monomial {
    /// A variable with the exponent 1.
    pub fn variable(k: usize) -> Monomial {
        let mut words = [0; WORDS];
        words[k / 8] = 1 << (56 - 8 * (k % 8));
        Monomial(words)
    }

    /// The exponent of a variable.
    pub fn exponent(&self, k: usize) -> u32 {
        (self.0[k / 8] >> (56 - 8 * (k % 8))) as u32 & 0x7f
    }

    fn with(mut self, k: usize, exponent: u32) -> Monomial {
        let shift = 56 - 8 * (k % 8);
        self.0[k / 8] = self.0[k / 8] & !(0xff << shift) | u64::from(exponent & 0x7f) << shift;
        self
    }

    fn times(&self, other: &Monomial) -> Result<Monomial, TooLarge> {
        let mut words = [0; WORDS];
        let mut high = 0;
        for ((word, a), b) in words.iter_mut().zip(self.0).zip(other.0) {
            *word = a + b;
            high |= *word;
        }
        if high & HIGH == 0 { Ok(Monomial(words)) } else { Err(TooLarge) }
    }

    fn over(&self, other: &Monomial) -> Option<Monomial> {
        let mut words = [0; WORDS];
        let mut whole = true;
        for ((word, a), b) in words.iter_mut().zip(self.0).zip(other.0) {
            let difference = (a | HIGH).wrapping_sub(b);
            whole &= difference & HIGH == HIGH;
            *word = difference & !HIGH;
        }
        whole.then_some(Monomial(words))
    }

    /// The largest that divides both.
    fn common(&self, other: &Monomial) -> Monomial {
        (0..VARIABLES).fold(Monomial::default(), |result, k| {
            result.with(k, self.exponent(k).min(other.exponent(k)))
        })
    }
}

/// A polynomial.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Polynomial {
    /// Monomials in falling order, and coefficients that are not 0.
    pub terms: Vec<(Monomial, BigInt)>,
}

impl Polynomial {
    /// 0.
    pub fn zero() -> Polynomial {
        Polynomial::default()
    }

    /// A whole number.
    pub fn number(value: impl Into<BigInt>) -> Polynomial {
        Polynomial::term(Monomial::default(), value.into())
    }

    /// A variable.
    pub fn variable(k: usize) -> Polynomial {
        Polynomial::term(Monomial::variable(k), 1.into())
    }

    fn term(monomial: Monomial, coefficient: BigInt) -> Polynomial {
        match coefficient.sign() {
            Sign::NoSign => Polynomial::zero(),
            _ => Polynomial { terms: vec![(monomial, coefficient)] },
        }
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    /// Whether it is 1.
    pub fn is_one(&self) -> bool {
        self.constant().is_some_and(|value| value == BigInt::from(1))
    }

    /// Its value, where it is a number.
    pub fn constant(&self) -> Option<BigInt> {
        match self.terms.as_slice() {
            [] => Some(BigInt::default()),
            [(monomial, value)] if *monomial == Monomial::default() => Some(value.clone()),
            _ => None,
        }
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.terms.len()
    }

    /// Whether it has no terms: it is 0.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// The highest exponent of a variable.
    pub fn degree(&self, k: usize) -> u32 {
        self.terms.iter().map(|(monomial, _)| monomial.exponent(k)).max().unwrap_or(0)
    }

    /// The coefficients of the powers of a variable, from 0 on.
    pub fn powers(&self, k: usize) -> Vec<Polynomial> {
        let mut powers = vec![Polynomial::zero(); self.degree(k) as usize + 1];
        for (monomial, coefficient) in &self.terms {
            let power = monomial.exponent(k) as usize;
            powers[power].terms.push((monomial.with(k, 0), coefficient.clone()));
        }
        // Without one variable terms stay in their order within each power.
        powers
    }

    fn of(sums: impl IntoIterator<Item = (Monomial, BigInt)>) -> Result<Polynomial, TooLarge> {
        let mut terms: Vec<(Monomial, BigInt)> =
            sums.into_iter().filter(|(_, value)| value.sign() != Sign::NoSign).collect();
        if terms.len() > MOST_TERMS {
            return Err(TooLarge);
        }
        terms.sort_unstable_by_key(|(monomial, _)| std::cmp::Reverse(*monomial));
        Ok(Polynomial { terms })
    }

    /// −self.
    pub fn negate(mut self) -> Polynomial {
        self.terms.iter_mut().for_each(|(_, value)| *value = -std::mem::take(value));
        self
    }

    /// self + other.
    pub fn plus(&self, other: &Polynomial) -> Polynomial {
        self.merge(other, false)
    }

    /// self − other.
    pub fn minus(&self, other: &Polynomial) -> Polynomial {
        self.merge(other, true)
    }

    fn merge(&self, other: &Polynomial, subtract: bool) -> Polynomial {
        let own = |value: &BigInt| if subtract { -value } else { value.clone() };
        let (mut a, mut b) = (self.terms.iter().peekable(), other.terms.iter().peekable());
        let mut terms = Vec::with_capacity(self.len() + other.len());
        loop {
            match (a.peek(), b.peek()) {
                (Some((x, p)), Some((y, q))) if x == y => {
                    let sum = if subtract { p - q } else { p + q };
                    if sum.sign() != Sign::NoSign {
                        terms.push((*x, sum));
                    }
                    a.next();
                    b.next();
                }
                (Some((x, p)), Some((y, _))) if x > y => {
                    terms.push((*x, p.clone()));
                    a.next();
                }
                (_, Some((y, q))) => {
                    terms.push((*y, own(q)));
                    b.next();
                }
                (Some((x, p)), None) => {
                    terms.push((*x, p.clone()));
                    a.next();
                }
                (None, None) => return Polynomial { terms },
            }
        }
    }

    /// self · other.
    ///
    /// # Errors
    /// When it is too large.
    pub fn times(&self, other: &Polynomial) -> Result<Polynomial, TooLarge> {
        if self.len().saturating_mul(other.len()) > MOST_PRODUCTS {
            return Err(TooLarge);
        }
        match (self.terms.as_slice(), other.terms.as_slice()) {
            ([(monomial, value)], _) => other.scaled(monomial, value),
            (_, [(monomial, value)]) => self.scaled(monomial, value),
            _ => {
                let mut sums: FxHashMap<Monomial, BigInt> = FxHashMap::default();
                for (a, x) in &self.terms {
                    for (b, y) in &other.terms {
                        *sums.entry(a.times(b)?).or_default() += x * y;
                    }
                }
                Polynomial::of(sums)
            }
        }
    }

    fn scaled(&self, by: &Monomial, value: &BigInt) -> Result<Polynomial, TooLarge> {
        let terms = self.terms.iter().map(|(own, x)| Ok((own.times(by)?, x * value)));
        Ok(Polynomial { terms: terms.collect::<Result<_, TooLarge>>()? })
    }

    /// self / other, where that is a polynomial with whole coefficients.
    pub fn divided(&self, other: &Polynomial) -> Option<Polynomial> {
        let (lead, lead_value) = other.terms.first()?;
        if let [_] = other.terms.as_slice() {
            let term = |(own, x): &(Monomial, BigInt)| {
                let quotient = x / lead_value;
                (&quotient * lead_value == *x).then_some((own.over(lead)?, quotient))
            };
            return Some(Polynomial { terms: self.terms.iter().map(term).collect::<Option<_>>()? });
        }
        let mut rest: BTreeMap<Monomial, BigInt> = self.terms.iter().cloned().collect();
        let mut terms = vec![];
        let mut work = 0;
        while let Some((top, value)) = rest.pop_last() {
            let monomial = top.over(lead)?;
            let quotient = &value / lead_value;
            work += other.len();
            if &quotient * lead_value != value || work > MOST_PRODUCTS {
                return None;
            }
            for (own, x) in &other.terms[1..] {
                let place = own.times(&monomial).ok()?;
                let entry = rest.entry(place).or_default();
                *entry -= &quotient * x;
                if entry.sign() == Sign::NoSign {
                    rest.remove(&place);
                }
            }
            terms.push((monomial, quotient));
        }
        Some(Polynomial { terms })
    }

    /// The value where the variables have values, and the sum of the sizes of all terms.
    pub fn evaluate(&self, values: &[f64]) -> (f64, f64) {
        let mut sum = (0.0, 0.0);
        for (monomial, coefficient) in &self.terms {
            let mut term = to_float(coefficient);
            for (k, value) in values.iter().enumerate() {
                let exponent = monomial.exponent(k);
                if exponent > 0 {
                    term *= value.powi(exponent as i32);
                }
            }
            sum = (sum.0 + term, sum.1 + term.abs());
        }
        sum
    }

    /// Whether the first term is negative.
    pub fn is_negative(&self) -> bool {
        self.terms.first().is_some_and(|(_, value)| value.sign() == Sign::Minus)
    }

    /// Whether a variable stands in it.
    pub fn holds(&self, k: usize) -> bool {
        self.terms.iter().any(|(monomial, _)| monomial.exponent(k) > 0)
    }
}

/// The nearest number of 53 bits.
pub fn to_float(value: &BigInt) -> f64 {
    value.to_string().parse().unwrap_or(f64::NAN)
}
