//! Dimensions: rational exponents of the seven base units.

/// Rational exponents of m, kg, s, A, K, mol, cd as (numerator, denominator) in lowest terms, denominator > 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension(pub [(i16, i16); 7]);

/// The base units, in the order of the exponents.
const BASE: [&str; 7] = ["m", "kg", "s", "A", "K", "mol", "cd"];

impl Dimension {
    /// The dimension of a pure number.
    pub const NONE: Dimension = Dimension::new(0, 0, 0, 0, 0);

    /// m^a · kg^b · s^c · A^d · K^e.
    pub const fn new(m: i16, kg: i16, s: i16, a: i16, k: i16) -> Dimension {
        Dimension([(m, 1), (kg, 1), (s, 1), (a, 1), (k, 1), (0, 1), (0, 1)])
    }

    /// Whether it is that of a pure number.
    pub fn is_none(self) -> bool {
        self == Dimension::NONE
    }

    /// self · other; `None` where an exponent leaves the range of 16 bits.
    pub fn times(self, other: Dimension) -> Option<Dimension> {
        let mut product = self;
        for (own, theirs) in product.0.iter_mut().zip(other.0) {
            let (n, d) = (i64::from(own.0), i64::from(own.1));
            let (m, c) = (i64::from(theirs.0), i64::from(theirs.1));
            *own = reduce(n * c + m * d, d * c)?;
        }
        Some(product)
    }

    /// self / other; `None` where an exponent leaves the range of 16 bits.
    pub fn over(self, other: Dimension) -> Option<Dimension> {
        self.times(other.power(-1, 1)?)
    }

    /// self^(numerator/denominator); `None` where an exponent leaves the range of 16 bits.
    pub fn power(self, numerator: i64, denominator: i64) -> Option<Dimension> {
        let mut result = self;
        for exponent in &mut result.0 {
            *exponent = reduce(
                i64::from(exponent.0).checked_mul(numerator)?,
                i64::from(exponent.1).checked_mul(denominator)?,
            )?;
        }
        Some(result)
    }
}

/// The fraction in lowest terms with a positive denominator; `None` where it does not fit or divides by 0.
pub(super) fn reduce(numerator: i64, denominator: i64) -> Option<(i16, i16)> {
    if denominator == 0 || numerator == i64::MIN || denominator == i64::MIN {
        return None;
    }
    let (mut a, mut b) = (numerator.abs(), denominator.abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    let sign = denominator.signum();
    Some((i16::try_from(sign * numerator / a).ok()?, i16::try_from(sign * denominator / a).ok()?))
}

impl Dimension {
    /// The product of named units with these exponents and of base units: `Pa^(1/2)*s/m^3`.
    pub(super) fn spell(self, named: &[(&str, (i16, i16))]) -> String {
        let factors = || named.iter().copied().chain(BASE.iter().copied().zip(self.0));
        let part = |sign: i16| {
            factors()
                .filter(|(_, (n, _))| n.signum() == sign)
                .map(|(name, (n, d))| match (n.unsigned_abs(), d) {
                    (1, 1) => name.to_string(),
                    (n, 1) => format!("{name}^{n}"),
                    (n, d) => format!("{name}^({n}/{d})"),
                })
                .collect::<Vec<_>>()
        };
        let (above, below) = (part(1), part(-1));
        let above = if above.is_empty() { "1".to_string() } else { above.join("*") };
        match below.as_slice() {
            [] => above,
            [one] => format!("{above}/{one}"),
            several => format!("{above}/({})", several.join("*")),
        }
    }
}

impl std::fmt::Display for Dimension {
    /// In base units: `kg*m^2/s^3`; `1` for a pure number.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}", self.spell(&[]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_powers() {
        let force = Dimension::new(1, 1, -2, 0, 0);
        let metre = Dimension::new(1, 0, 0, 0, 0);
        assert_eq!(force.times(metre), Some(Dimension::new(2, 1, -2, 0, 0)));
        assert_eq!(force.over(force), Some(Dimension::NONE));
        let half = metre.power(1, 2).unwrap();
        assert_eq!(half.times(half), Some(metre));
        assert_eq!(metre.power(i64::MAX, 1), None);
        assert_eq!(metre.power(1, 0), None);
    }

    #[test]
    fn spelling() {
        assert_eq!(Dimension::new(2, 1, -3, -1, 0).to_string(), "m^2*kg/(s^3*A)");
        assert_eq!(Dimension::NONE.to_string(), "1");
        assert_eq!(Dimension::new(1, 0, 0, 0, 0).power(1, 2).unwrap().to_string(), "m^(1/2)");
    }
}
