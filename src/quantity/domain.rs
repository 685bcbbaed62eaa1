//! The domains of bond graphs: units of effort and flow, and magnitudes to judge errors by.
//!
//! Nominal magnitudes weigh absolute tolerances and residuals: a current of 1 pA and a flow of 1e-12 m³/s are not
//! equally small. They are sizes at which a machine of a few kilowatts down to a laboratory set-up works; each pair
//! of a true domain carries about 10 W, so that errors of all domains weigh alike in power.

use super::dimension::Dimension;

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

/// What is known of a domain.
#[derive(Debug)]
pub struct DomainRow {
    /// The domain.
    pub domain: Domain,
    /// Its name in files and messages.
    pub name: &'static str,
    /// SI unit of effort, as text.
    pub effort: &'static str,
    /// SI unit of flow, as text.
    pub flow: &'static str,
    /// SI unit of ∫flow dt (q), as text.
    pub displacement: &'static str,
    /// SI unit of ∫effort dt (p), as text.
    pub momentum: &'static str,
    /// Dimension of effort.
    pub effort_dimension: Dimension,
    /// Dimension of flow.
    pub flow_dimension: Dimension,
    /// A usual magnitude of effort, in SI.
    pub nominal_effort: f64,
    /// A usual magnitude of flow, in SI.
    pub nominal_flow: f64,
    /// Whether effort times flow is not a power.
    pub pseudo: bool,
}

const fn d(m: i16, kg: i16, s: i16, a: i16, k: i16) -> Dimension {
    Dimension::new(m, kg, s, a, k)
}

/// Every domain, one row each, in the order of [`Domain`]. Where two share a dimension, the earlier is meant unless
/// something else says so (pascals are hydraulic, kelvins true thermal).
pub const DOMAINS: &[DomainRow] = &[
    DomainRow {
        domain: Domain::Any,
        name: "any",
        effort: "",
        flow: "",
        displacement: "",
        momentum: "",
        effort_dimension: Dimension::NONE,
        flow_dimension: Dimension::NONE,
        nominal_effort: 1.0,
        nominal_flow: 1.0,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Electrical,
        name: "electrical",
        effort: "V",
        flow: "A",
        displacement: "C",
        momentum: "Wb",
        effort_dimension: d(2, 1, -3, -1, 0),
        flow_dimension: d(0, 0, 0, 1, 0),
        nominal_effort: 10.0,
        nominal_flow: 1.0,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Rotation,
        name: "rotation",
        effort: "N*m",
        flow: "rad/s",
        displacement: "rad",
        momentum: "N*m*s",
        effort_dimension: d(2, 1, -2, 0, 0),
        flow_dimension: d(0, 0, -1, 0, 0),
        nominal_effort: 1.0,
        nominal_flow: 10.0,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Translation,
        name: "translation",
        effort: "N",
        flow: "m/s",
        displacement: "m",
        momentum: "N*s",
        effort_dimension: d(1, 1, -2, 0, 0),
        flow_dimension: d(1, 0, -1, 0, 0),
        nominal_effort: 100.0,
        nominal_flow: 0.1,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Hydraulic,
        name: "hydraulic",
        effort: "Pa",
        flow: "m^3/s",
        displacement: "m^3",
        momentum: "Pa*s",
        effort_dimension: d(-1, 1, -2, 0, 0),
        flow_dimension: d(3, 0, -1, 0, 0),
        nominal_effort: 1e6,
        nominal_flow: 1e-5,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Magnetic,
        name: "magnetic",
        effort: "A",
        flow: "Wb/s",
        displacement: "Wb",
        momentum: "A*s",
        effort_dimension: d(0, 0, 0, 1, 0),
        flow_dimension: d(2, 1, -3, -1, 0),
        nominal_effort: 100.0,
        nominal_flow: 0.1,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::Thermal,
        name: "thermal",
        effort: "K",
        flow: "W/K",
        displacement: "J/K",
        momentum: "K*s",
        effort_dimension: d(0, 0, 0, 0, 1),
        flow_dimension: d(2, 1, -3, 0, -1),
        nominal_effort: 10.0,
        nominal_flow: 1.0,
        pseudo: false,
    },
    DomainRow {
        domain: Domain::PseudoThermal,
        name: "pseudo-thermal",
        effort: "K",
        flow: "W",
        displacement: "J",
        momentum: "K*s",
        effort_dimension: d(0, 0, 0, 0, 1),
        flow_dimension: d(2, 1, -3, 0, 0),
        nominal_effort: 10.0,
        nominal_flow: 10.0,
        pseudo: true,
    },
    DomainRow {
        domain: Domain::Pneumatic,
        name: "pneumatic",
        effort: "Pa",
        flow: "kg/s",
        displacement: "kg",
        momentum: "Pa*s",
        effort_dimension: d(-1, 1, -2, 0, 0),
        flow_dimension: d(0, 1, -1, 0, 0),
        nominal_effort: 1e5,
        nominal_flow: 1e-3,
        pseudo: true,
    },
];

impl Domain {
    /// Its row of [`DOMAINS`].
    pub fn row(self) -> &'static DomainRow {
        &DOMAINS[self as usize]
    }

    /// Its name in files and messages.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The domain of a name in a file.
    pub fn named(name: &str) -> Option<Domain> {
        DOMAINS.iter().find(|row| row.name == name).map(|row| row.domain)
    }

    /// The first domain for whose row a test holds, [`Domain::Any`] itself left out.
    pub fn find(test: impl Fn(&DomainRow) -> bool) -> Option<Domain> {
        DOMAINS[1..].iter().find(|row| test(row)).map(|row| row.domain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Unit;

    #[test]
    fn rows_stand_in_the_order_of_the_enum_and_their_units_agree() {
        for (index, row) in DOMAINS.iter().enumerate() {
            assert_eq!(row.domain as usize, index);
            assert_eq!(Domain::named(row.name), Some(row.domain));
            if row.domain == Domain::Any {
                continue;
            }
            let unit = |text| {
                let unit = Unit::parse(text).unwrap();
                assert_eq!(unit.factor, 1.0, "{text}");
                unit.dimension
            };
            let second = unit("s");
            assert_eq!(unit(row.effort), row.effort_dimension);
            assert_eq!(unit(row.flow), row.flow_dimension);
            assert_eq!(Some(unit(row.displacement)), row.flow_dimension.times(second));
            assert_eq!(Some(unit(row.momentum)), row.effort_dimension.times(second));
            let power = row.effort_dimension.times(row.flow_dimension);
            assert_eq!(power == Some(unit("W")), !row.pseudo, "{}", row.name);
            if !row.pseudo {
                assert!((row.nominal_effort * row.nominal_flow - 10.0).abs() < 1e-12);
            }
        }
    }
}
