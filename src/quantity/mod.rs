//! Units with rational exponents, and the domains of bond graphs.

/// A unit: what it multiplies a number by to make it SI, and its dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// As written, `bar`, `m^3/(s*Pa)`.
    pub text: String,
    /// SI units in one of it.
    pub factor: f64,
    /// Exponents of m, kg, s, A, K, mol, cd as (numerator, denominator) in lowest terms, denominator > 0.
    pub dimension: Dimension,
}

/// Rational exponents of m, kg, s, A, K, mol, cd.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension(pub [(i16, i16); 7]);

/// The domain of a bond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Domain {
    /// Nothing says which.
    #[default]
    Any,
    Electrical,
    Rotation,
    Translation,
    Hydraulic,
    Magnetic,
    Thermal,
    PseudoThermal,
    Pneumatic,
}
