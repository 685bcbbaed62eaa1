//! What people call a dimension: the unit that engineers write, and what is measured in it.

use super::dimension::Dimension;

/// A unit, what it is the unit of, and its dimension.
struct Word {
    unit: &'static str,
    noun: &'static str,
    dimension: Dimension,
}

const fn word(unit: &'static str, noun: &'static str, d: [i16; 5]) -> Word {
    Word { unit, noun, dimension: Dimension::new(d[0], d[1], d[2], d[3], d[4]) }
}

/// Known units, one row each; exponents of m, kg, s, A, K. Of several with one dimension the first is written where
/// nothing says which was meant.
const WORDS: &[Word] = &[
    word("m", "length", [1, 0, 0, 0, 0]),
    word("kg", "mass", [0, 1, 0, 0, 0]),
    word("s", "time", [0, 0, 1, 0, 0]),
    word("A", "current", [0, 0, 0, 1, 0]),
    word("K", "temperature", [0, 0, 0, 0, 1]),
    word("V", "voltage", [2, 1, -3, -1, 0]),
    word("N", "force", [1, 1, -2, 0, 0]),
    word("N*m", "torque", [2, 1, -2, 0, 0]),
    word("J", "energy", [2, 1, -2, 0, 0]),
    word("Pa", "pressure", [-1, 1, -2, 0, 0]),
    word("W", "power", [2, 1, -3, 0, 0]),
    word("m/s", "velocity", [1, 0, -1, 0, 0]),
    word("rad/s", "rate", [0, 0, -1, 0, 0]),
    word("Hz", "frequency", [0, 0, -1, 0, 0]),
    word("m^3/s", "volume flow", [3, 0, -1, 0, 0]),
    word("kg/s", "mass flow", [0, 1, -1, 0, 0]),
    word("N*s/m", "damping", [0, 1, -1, 0, 0]),
    word("W/K", "entropy flow", [2, 1, -3, 0, -1]),
    word("m^2", "area", [2, 0, 0, 0, 0]),
    word("m^3", "volume", [3, 0, 0, 0, 0]),
    word("m/s^2", "acceleration", [1, 0, -2, 0, 0]),
    word("rad/s^2", "angular acceleration", [0, 0, -2, 0, 0]),
    word("s^2", "squared time", [0, 0, 2, 0, 0]),
    word("m^2/s^2", "squared velocity", [2, 0, -2, 0, 0]),
    word("kg/m^3", "density", [-3, 1, 0, 0, 0]),
    word("C", "charge", [0, 0, 1, 1, 0]),
    word("Wb", "flux", [2, 1, -2, -1, 0]),
    word("Ohm", "resistance", [2, 1, -3, -2, 0]),
    word("S", "conductance", [-2, -1, 3, 2, 0]),
    word("F", "capacitance", [-2, -1, 4, 2, 0]),
    word("H", "inductance", [2, 1, -2, -2, 0]),
    word("T", "flux density", [0, 1, -2, -1, 0]),
    word("N*s", "momentum", [1, 1, -1, 0, 0]),
    word("N*m*s", "angular momentum", [2, 1, -1, 0, 0]),
    word("Pa*s", "pressure momentum", [-1, 1, -1, 0, 0]),
    word("kg*m^2", "moment of inertia", [2, 1, 0, 0, 0]),
    word("N/m", "stiffness", [0, 1, -2, 0, 0]),
    word("m/N", "compliance", [0, -1, 2, 0, 0]),
    word("rad/(N*m)", "torsional compliance", [-2, -1, 2, 0, 0]),
    word("Pa*s/m^3", "hydraulic resistance", [-4, 1, -1, 0, 0]),
    word("m^3/(s*Pa)", "hydraulic conductance", [4, -1, 1, 0, 0]),
    word("m^3/Pa", "hydraulic compliance", [4, -1, 2, 0, 0]),
    word("Pa*s^2/m^3", "hydraulic inertance", [-4, 1, 0, 0, 0]),
    word("J/K", "heat capacity", [2, 1, -2, 0, -1]),
    word("K/W", "thermal resistance", [-2, -1, 3, 0, 1]),
    word("K*s", "temperature impulse", [0, 0, 1, 0, 1]),
];

/// What a dimension is divided by when it has no row of its own; the simplest remainder is written.
const PARTS: [&str; 9] = ["Pa", "N", "V", "W", "J", "Ohm", "F", "H", "Wb"];

fn row(unit: &str) -> Option<&'static Word> {
    WORDS.iter().find(|word| word.unit == unit)
}

impl Dimension {
    /// The SI unit that engineers write: `Pa`, `m^3/s`, `Pa^(1/2)*s/m^3`; `1` for a pure number.
    pub fn si(self) -> String {
        if let Some(word) = WORDS.iter().find(|word| word.dimension == self) {
            return word.unit.to_string();
        }
        let cost = |n: i16, d: i16| {
            if n == 0 { 0 } else { n.saturating_abs().saturating_add(2 * (d.min(99) - 1)) }
        };
        let length =
            |d: Dimension| d.0.iter().map(|(n, d)| cost(*n, *d)).fold(0, i16::saturating_add);
        let mut best = (length(self), self.to_string());
        for name in PARTS {
            let Some(part) = row(name) else { continue };
            for (n, d) in [(1i16, 1i16), (-1, 1), (1, 2), (-1, 2), (2, 1), (-2, 1)] {
                let power = part.dimension.power(i64::from(n), i64::from(d));
                let Some(rest) = power.and_then(|power| self.over(power)) else { continue };
                // A named unit says more than base units, and less below a fraction's line.
                let named = cost(n, d) + 1 + i16::from(n < 0);
                let total = length(rest).saturating_add(named);
                if total < best.0 {
                    best = (total, rest.spell(&[(name, (n, d))]));
                }
            }
        }
        best.1
    }

    /// What is measured in it, with its unit: `a pressure (Pa)`, `a pure number`, `a value in Pa/m`. A unit as somebody
    /// wrote it, `kJ`, tells an energy from a torque.
    pub fn describe(self, written: Option<&str>) -> String {
        if self.is_none() {
            return match written {
                Some(unit @ ("rad" | "deg" | "rev")) => format!("an angle ({unit})"),
                _ => "a pure number".to_string(),
            };
        }
        let unit = self.si();
        let rows = || WORDS.iter().filter(|word| word.dimension == self);
        // The longest: `mHz` ends in `Hz` and in `z` alone nothing does, `N*m` in `N*m` and not in `m`.
        let meant = rows().filter(|word| written.is_some_and(|text| text.ends_with(word.unit)));
        match meant.max_by_key(|word| word.unit.len()).or(rows().next()) {
            Some(Word { noun, unit, .. }) => format!("{} {noun} ({unit})", article(noun)),
            None => format!("a value in {unit}"),
        }
    }
}

/// The article of a noun.
fn article(noun: &str) -> &'static str {
    if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}

#[cfg(test)]
mod tests {
    use super::super::Unit;
    use super::*;

    #[test]
    fn rows_are_units_of_their_dimensions() {
        for word in WORDS {
            let unit = Unit::parse(word.unit).unwrap();
            assert_eq!((unit.factor, unit.dimension), (1.0, word.dimension), "{}", word.unit);
        }
        for part in PARTS {
            assert!(row(part).is_some(), "{part}");
        }
    }

    #[test]
    fn what_engineers_write() {
        for (text, unit) in [
            ("bar", "Pa"),
            ("kg*m^2/s^2", "N*m"),
            ("cm^3/rad", "m^3"),
            ("L/min", "m^3/s"),
            ("Pa^0.5*s/m^3", "Pa^(1/2)*s/m^3"),
            ("rpm", "rad/s"),
            ("V/m^2", "V/m^2"),
            ("1/Pa", "1/Pa"),
            ("A^-1*s^-1", "1/(s*A)"),
            ("V*s/m", "N/A"),
            ("%", "1"),
        ] {
            let unit_of = Unit::parse(text).unwrap_or_else(|e| panic!("{text}: {e:?}"));
            assert_eq!(unit_of.dimension.si(), unit, "{text}");
            let same = Unit::parse(unit).map(|unit| unit.dimension);
            assert!(unit == "1" || same == Ok(unit_of.dimension), "{text}");
        }
    }

    #[test]
    fn what_is_measured() {
        let describe = |unit: &str| Unit::parse(unit).unwrap().dimension.describe(Some(unit));
        assert_eq!(describe("bar"), "a pressure (Pa)");
        assert_eq!(describe("kN*m"), "a torque (N*m)");
        assert_eq!(describe("kJ"), "an energy (J)");
        assert_eq!(describe("kHz"), "a frequency (Hz)");
        assert_eq!(describe("rpm"), "a rate (rad/s)");
        assert_eq!(describe("mm^2"), "an area (m^2)");
        assert_eq!(describe("deg"), "an angle (deg)");
        assert_eq!(describe("%"), "a pure number");
        assert_eq!(describe("V/m^2"), "a value in V/m^2");
    }
}
