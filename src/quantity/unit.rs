//! Units: their text, and where one ends in a file.
//!
//! A unit is a product of powers of symbols, `m^3/(s*Pa)`; a symbol may carry one SI prefix where its row allows it.
//! The symbols are a table of their own.

use super::dimension::{Dimension, reduce};
use super::symbols::{NEVER, is_unit_name, nearest_unit, symbol};

/// A unit: what it multiplies a number by to make it SI, and its dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// As written, `bar`, `m^3/(s*Pa)`.
    pub text: String,
    /// SI units in one of it.
    pub factor: f64,
    /// Its dimension.
    pub dimension: Dimension,
}

/// Why a text is no unit, and where in it (bytes).
#[derive(Clone, Debug, PartialEq)]
pub enum UnitError {
    /// A name that no row knows, and the nearest that one does.
    Unknown {
        /// Where in the text.
        at: std::ops::Range<usize>,
        /// The name.
        name: String,
        /// What was probably meant.
        nearest: Option<String>,
    },
    /// Not of the form of a unit.
    Syntax {
        /// Where in the text.
        at: std::ops::Range<usize>,
    },
    /// An exponent that cannot be kept exactly.
    Exponent {
        /// Where in the text.
        at: std::ops::Range<usize>,
    },
}

fn is_name_char(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '°'
}

/// Bytes of the name at the start of a text: letters, digits, `_`, or one `%`.
fn name_length(text: &str) -> usize {
    match text.chars().next() {
        Some('%') => 1,
        Some(c) if is_name_char(c) && !c.is_ascii_digit() => {
            text.find(|c| !is_name_char(c)).unwrap_or(text.len())
        }
        _ => 0,
    }
}

/// Bytes of the exponent at the start of a text (after `^`): `2`, `-1`, `0.5`, `(1/2)`, `(-1/2)`.
fn exponent_length(text: &str) -> usize {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let bracket = text.starts_with('(');
    let mut at = usize::from(bracket);
    at += usize::from(text[at..].starts_with('-'));
    let whole = digits(&text[at..]);
    at += whole;
    if whole == 0 {
        return 0;
    }
    let separator = if bracket && text[at..].starts_with('/') { '/' } else { '.' };
    if text[at..].starts_with(separator) {
        let more = digits(&text[at + 1..]);
        if more > 0 {
            at += 1 + more;
        }
    }
    if bracket {
        return if text[at..].starts_with(')') { at + 1 } else { 0 };
    }
    if text[at..].starts_with(|c| is_name_char(c) || c == '(') { 0 } else { at }
}

/// Bytes of the bracket of unit names at the start of a text, 0 when it is another bracket.
fn bracket_length(text: &str, depth: u32) -> usize {
    if depth > 16 || !text.starts_with('(') {
        return 0;
    }
    let mut at = 1;
    loop {
        let factor = factor_length(&text[at..], depth + 1);
        if factor == 0 {
            return 0;
        }
        at += factor;
        match text[at..].chars().next() {
            Some('*' | '/') => at += 1,
            Some(')') => return at + 1,
            _ => return 0,
        }
    }
}

/// Bytes of a known unit name or a bracket of them, with its exponent; 0 for anything else.
fn factor_length(text: &str, depth: u32) -> usize {
    let name = name_length(text);
    let base = if name > 0 {
        // `3 V*min(a, b)` calls a function.
        if is_unit_name(&text[..name]) && !text[name..].starts_with('(') { name } else { 0 }
    } else {
        bracket_length(text, depth)
    };
    base + if base > 0 { power_length(&text[base..]) } else { 0 }
}

/// Bytes of `^exponent` at the start of a text, or 0.
fn power_length(text: &str) -> usize {
    match text.strip_prefix('^').map(exponent_length) {
        Some(exponent) if exponent > 0 => 1 + exponent,
        _ => 0,
    }
}

/// Bytes of the unit at the start of a text; 0 when none stands there.
///
/// The first name always counts as a unit's (so that a wrong one is found), unless it is one of the words that never
/// are; after it the unit goes on over `*`, `/` and `^` only as long as a unit name, a bracket of unit names or an
/// exponent follows: `2 N*m` is newton metres, `2 N*x` is x times two newtons.
pub fn scan_unit(text: &str) -> usize {
    let mut at = name_length(text);
    if at == 0 || NEVER.contains(&&text[..at]) {
        return 0;
    }
    at += power_length(&text[at..]);
    while text[at..].starts_with(['*', '/']) {
        let factor = factor_length(&text[at + 1..], 0);
        if factor == 0 {
            break;
        }
        at += 1 + factor;
    }
    at
}

/// The whole number that a factor is the inverse of, as 1000 for milli: dividing by it rounds once only.
fn inverse(factor: f64) -> Option<f64> {
    let whole = (1.0 / factor).round();
    (factor < 1.0 && whole < 1e15 && 1.0 / whole == factor).then_some(whole)
}

/// A finite number, and what stands behind it: `2.5 mH`.
pub fn number_and_unit(text: &str) -> Option<(f64, &str)> {
    let digits = |c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-');
    let mut end = text.find(|c| !digits(c)).unwrap_or(text.len());
    // The `e` of `2 eV` begins a unit.
    if text[end..].starts_with(['e', 'E']) {
        let more = text[end + 1..].find(|c| !digits(c)).map_or(text.len(), |at| end + 1 + at);
        end = if more > end + 1 { more } else { end };
    }
    let number = text[..end].parse::<f64>().ok().filter(|number| number.is_finite())?;
    Some((number, text[end..].trim()))
}

impl Unit {
    /// A number of this unit in SI: 1.7 mH is the double nearest to 0.0017.
    pub fn to_si(&self, value: f64) -> f64 {
        inverse(self.factor).map_or(value * self.factor, |inverse| value / inverse)
    }

    /// Reads a unit; blanks are not part of one.
    pub fn parse(text: &str) -> Result<Unit, UnitError> {
        let mut reader = Reader { text, at: 0, depth: 0 };
        let (factor, dimension) = reader.product()?;
        if reader.at < text.len() {
            return Err(reader.syntax());
        }
        if !(factor.is_finite() && factor > 0.0) {
            return Err(UnitError::Exponent { at: 0..text.len() });
        }
        Ok(Unit { text: text.to_string(), factor, dimension })
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: u32,
}

impl Reader<'_> {
    fn syntax(&self) -> UnitError {
        let end = self.text[self.at..].chars().next().map_or(0, char::len_utf8);
        UnitError::Syntax { at: self.at..self.at + end }
    }

    fn take(&mut self, c: char) -> bool {
        let found = self.text[self.at..].starts_with(c);
        self.at += if found { c.len_utf8() } else { 0 };
        found
    }

    fn product(&mut self) -> Result<(f64, Dimension), UnitError> {
        let start = self.at;
        let overflow = |end| UnitError::Exponent { at: start..end };
        let (mut factor, mut dimension) = self.factor()?;
        loop {
            let divide = match self.text[self.at..].chars().next() {
                Some('*') => false,
                Some('/') => true,
                _ => return Ok((factor, dimension)),
            };
            self.at += 1;
            let (f, d) = self.factor()?;
            factor = if divide { factor / f } else { factor * f };
            let result = if divide { dimension.over(d) } else { dimension.times(d) };
            dimension = result.ok_or_else(|| overflow(self.at))?;
        }
    }

    fn factor(&mut self) -> Result<(f64, Dimension), UnitError> {
        let start = self.at;
        let (factor, dimension) = if self.take('(') {
            self.depth += 1;
            if self.depth > 16 {
                return Err(self.syntax());
            }
            let inside = self.product()?;
            if !self.take(')') {
                return Err(self.syntax());
            }
            self.depth -= 1;
            inside
        } else if self.text[self.at..].starts_with("1/") {
            self.at += 1;
            (1.0, Dimension::NONE)
        } else {
            let name = &self.text[self.at..self.at + name_length(&self.text[self.at..])];
            if name.is_empty() {
                return Err(self.syntax());
            }
            let at = self.at..self.at + name.len();
            self.at = at.end;
            symbol(name).ok_or_else(|| UnitError::Unknown {
                at,
                name: name.to_string(),
                nearest: nearest_unit(name),
            })?
        };
        if !self.take('^') {
            return Ok((factor, dimension));
        }
        let length = exponent_length(&self.text[self.at..]);
        if length == 0 {
            return Err(self.syntax());
        }
        let text = &self.text[self.at..self.at + length];
        self.at += length;
        let too_large = || UnitError::Exponent { at: start..self.at };
        let (n, d) = exponent(text).ok_or_else(too_large)?;
        let raised = dimension.power(i64::from(n), i64::from(d)).ok_or_else(too_large)?;
        let factor = match inverse(factor) {
            _ if d != 1 => libm::pow(factor, f64::from(n) / f64::from(d)),
            Some(inverse) => 1.0 / inverse.powi(i32::from(n)),
            None => factor.powi(i32::from(n)),
        };
        Ok((factor, raised))
    }
}

/// The exponent of a text that [`exponent_length`] accepted, in lowest terms.
fn exponent(text: &str) -> Option<(i16, i16)> {
    let text = text.trim_start_matches('(').trim_end_matches(')');
    if let Some((above, below)) = text.split_once('/') {
        return reduce(above.parse().ok()?, below.parse().ok()?);
    }
    let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
    let below = 10i64.checked_pow(u32::try_from(decimals.len()).ok()?)?;
    reduce(format!("{whole}{decimals}").parse().ok()?, below)
}

#[cfg(test)]
mod tests {
    use super::super::symbols::{PREFIXES, SYMBOLS};
    use super::*;
    use std::f64::consts::PI;

    fn unit(text: &str) -> Unit {
        Unit::parse(text).unwrap_or_else(|e| panic!("{text}: {e:?}"))
    }

    #[test]
    fn table() {
        // (unit, SI value of one, the same in other words)
        for (text, factor, same) in [
            ("mm", 1e-3, "m"),
            ("kg", 1.0, "N*s^2/m"),
            ("g", 1e-3, "kg"),
            ("mg", 1e-6, "kg"),
            ("bar", 1e5, "Pa"),
            ("GPa", 1e9, "N/m^2"),
            ("psi", 6894.757293168361, "Pa"),
            ("L/min", 1e-3 / 60.0, "m^3/s"),
            ("cm^3/rad", 1e-6, "m^3"),
            ("rpm", 2.0 * PI / 60.0, "rad/s"),
            ("rev", 2.0 * PI, "rad"),
            ("deg", PI / 180.0, "rad"),
            ("inch", 0.0254, "m"),
            ("kOhm", 1e3, "V/A"),
            ("mΩ", 1e-3, "Ohm"),
            ("µF", 1e-6, "C/V"),
            ("uF", 1e-6, "A*s/V"),
            ("mH", 1e-3, "Wb/A"),
            ("kN*s/m", 1e3, "N*s/m"),
            ("m^3/(s*Pa)", 1.0, "m^4*s/kg"),
            ("A^-1*s^-1", 1.0, "1/(A*s)"),
            ("Pa^0.5*s/m^3", 1.0, "Pa^(1/2)*s/m^3"),
            ("degC", 1.0, "K"),
            ("%", 0.01, "rad"),
            ("cm^2", 1e-4, "m^2"),
            ("kWb/s", 1e3, "V"),
            ("W*h", 3600.0, "J"),
            ("T", 1.0, "Wb/m^2"),
            ("S", 1.0, "1/Ohm"),
            ("Hz", 1.0, "s^-1"),
        ] {
            let (unit, same) = (unit(text), unit(same));
            assert!((unit.factor / factor - 1.0).abs() < 1e-15, "{text}: {}", unit.factor);
            assert_eq!(unit.dimension, same.dimension, "{text}");
        }
        assert_eq!(unit("mm").factor, 1e-3);
        assert_eq!(unit("kg").factor, 1.0);
        assert_eq!(unit("mH").factor, 1e-3);
    }

    #[test]
    fn no_name_has_two_meanings() {
        let mut seen = std::collections::HashMap::new();
        for row in SYMBOLS {
            assert!(seen.insert(row.name.to_string(), row.factor).is_none(), "{}", row.name);
        }
        for row in SYMBOLS.iter().filter(|row| row.prefixes) {
            for (prefix, _) in PREFIXES {
                let name = format!("{prefix}{}", row.name);
                // min is the minute, cd the candela, Pa the pascal: a plain symbol goes before a prefixed one.
                if SYMBOLS.iter().any(|row| row.name == name) {
                    continue;
                }
                assert!(seen.insert(name.clone(), row.factor).is_none(), "{name}");
            }
        }
    }

    #[test]
    fn where_a_unit_ends() {
        for (text, unit) in [
            ("N*m", "N*m"),
            ("N * m", "N"),
            ("N*x", "N"),
            ("m^3/(s*Pa)", "m^3/(s*Pa)"),
            ("m^3/(s*Pa))", "m^3/(s*Pa)"),
            ("m^3/(x*Pa)", "m^3"),
            ("A^-1*s^-1, b", "A^-1*s^-1"),
            ("Pa^0.5*s/m^3", "Pa^0.5*s/m^3"),
            ("V^x", "V"),
            ("V^2x", "V"),
            ("then 1", ""),
            ("in mm", ""),
            ("inch", "inch"),
            ("step 1", ""),
            ("%*x", "%"),
            ("bananas/s", "bananas/s"),
            ("Ω", "Ω"),
            ("V;", "V"),
            ("Pa^(1/2)", "Pa^(1/2)"),
            ("s*(m)", "s*(m)"),
            ("*m", ""),
            ("", ""),
        ] {
            assert_eq!(&text[..scan_unit(text)], unit, "{text}");
        }
    }

    #[test]
    fn wrong_units_have_a_nearest_one() {
        for (text, meant) in [
            ("ohm", Some("Ohm")),
            ("kOhn", Some("kOhm")),
            ("Nm", Some("N*m")),
            ("HZ", Some("Hz")),
            ("pa", Some("Pa")),
            ("m3", Some("m^3")),
            ("kNm", Some("kN*m")),
            ("Ohms", Some("Ohm")),
            ("bars", Some("bar")),
            ("Volts", Some("V")),
            ("mHy", Some("mH")),
            ("bananas", None),
        ] {
            let Err(UnitError::Unknown { nearest, .. }) = Unit::parse(text) else {
                panic!("{text}")
            };
            assert_eq!(nearest.as_deref(), meant, "{text}");
        }
        assert!(matches!(Unit::parse("m^"), Err(UnitError::Syntax { .. })));
        assert!(matches!(Unit::parse("m^99999"), Err(UnitError::Exponent { .. })));
        assert!(matches!(Unit::parse("km^200"), Err(UnitError::Exponent { .. })));
        assert!(matches!(Unit::parse(""), Err(UnitError::Syntax { .. })));
        let deep = format!("{}m{}", "(".repeat(10_000), ")".repeat(10_000));
        assert!(Unit::parse(&deep).is_err());
        assert_eq!(scan_unit(&format!("m/{deep}")), 1);
    }

    #[test]
    fn numbers_end_where_their_units_begin() {
        for (text, number, unit) in [
            ("2.5 mH", 2.5, "mH"),
            ("-1e-3", -1e-3, ""),
            ("1E3rad/s", 1e3, "rad/s"),
            ("2 eV", 2.0, "eV"),
            ("2eV", 2.0, "eV"),
        ] {
            assert_eq!(number_and_unit(text), Some((number, unit)), "{text}");
        }
        for none in ["", "mH", "inf", "1e400", "1.2.3 s", "--1"] {
            assert_eq!(number_and_unit(none), None, "{none}");
        }
    }
}
