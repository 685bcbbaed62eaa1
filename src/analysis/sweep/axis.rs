//! What one parameter is given: a list, a range, a random value.
//!
//! ```text
//! L=1mH,2mH,5mH      L=1mH..3mH:5      L=1mH..100mH:7:log      L=normal(2mH, 0.1mH)      L=uniform(1mH, 3mH)
//! ```

use crate::quantity::{number_and_unit, random};

/// A parameter and its values, over texts or numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis<T = String> {
    /// The parameter.
    pub name: String,
    /// Its values.
    pub forms: Forms<T>,
}

/// The forms of values, over texts or numbers.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Forms<T> {
    /// These.
    List(Vec<T>),
    /// As many from one to the other, both included; in equal steps, or in equal ratios.
    Range { from: T, to: T, count: u64, log: bool },
    /// Normal, of this mean and standard deviation.
    Normal { mean: T, deviation: T },
    /// All from one to the other equally likely.
    Uniform { low: T, high: T },
}

/// The forms that have brackets, for errors.
pub const FORMS: &str = "a list `1mH,2mH`, a range `1mH..3mH:5` or `1mH..3mH:5:log`, `normal(2mH, 0.1mH)`, `uniform(1mH, 3mH)`";

/// Values of one range, at most.
const MOST_VALUES: u64 = 1_000_000;

/// A number with its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// As written before the unit.
    pub number: f64,
    /// The unit, or nothing.
    pub unit: String,
    /// What makes it SI.
    pub factor: f64,
}

impl Reading {
    /// A number and what stands behind it; `factor` knows units.
    ///
    /// # Errors
    /// That it is none.
    pub fn of(text: &str, factor: &dyn Fn(&str) -> Option<f64>) -> Result<Reading, String> {
        let text = text.trim();
        let none = || format!("`{text}` is no number with a unit");
        let (number, unit) = number_and_unit(text).ok_or_else(none)?;
        let factor = if unit.is_empty() { Some(1.0) } else { factor(unit) };
        Ok(Reading { number, unit: unit.into(), factor: factor.ok_or_else(none)? })
    }

    /// In SI.
    pub fn si(&self) -> f64 {
        self.number * self.factor
    }

    /// As the model's language writes it.
    pub fn text(&self) -> String {
        let separator = if self.unit.is_empty() { "" } else { " " };
        format!("{:e}{separator}{}", self.number, self.unit)
    }

    /// Another number of the same unit.
    fn with(&self, number: f64) -> Reading {
        Reading { number, ..self.clone() }
    }
}

impl Axis {
    /// From `NAME=VALUES`.
    ///
    /// # Errors
    /// What it is instead.
    pub fn parse(text: &str) -> Result<Axis, String> {
        let (name, values) = text.split_once('=').ok_or("there is no `=`")?;
        let (name, values) = (name.trim(), values.trim());
        if name.is_empty() || values.is_empty() {
            return Err("a name or its values are missing".into());
        }
        Ok(Axis { name: name.into(), forms: Forms::parse(values)? })
    }
}

impl Forms<String> {
    /// From what stands behind the `=`.
    ///
    /// # Errors
    /// What it is instead.
    pub fn parse(text: &str) -> Result<Forms<String>, String> {
        for word in ["normal", "uniform"] {
            let inside = text.strip_prefix(word).map(str::trim_start);
            let Some(inside) = inside.and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'))
            else {
                continue;
            };
            let two = inside.split_once(',').filter(|(_, second)| !second.contains(','));
            let (a, b) = two.ok_or_else(|| format!("`{word}` takes two values"))?;
            return Forms::random(word, a.trim().into(), b.trim().into());
        }
        if let Some((from, rest)) = text.split_once("..") {
            let mut parts = rest.split(':').map(str::trim);
            let to = parts.next().unwrap_or_default();
            let count = parts.next().and_then(|n| n.parse().ok());
            let log = match (parts.next(), parts.next()) {
                (None, _) => Some(false),
                (Some("log"), None) => Some(true),
                _ => None,
            };
            let (Some(count), Some(log)) = (count, log) else {
                return Err(format!("`{text}` is no range: `FROM..TO:COUNT` or `…:log` is one"));
            };
            return Ok(Forms::Range { from: from.trim().into(), to: to.into(), count, log });
        }
        Ok(Forms::List(text.split(',').map(|value| value.trim().to_string()).collect()))
    }

    /// The form of a random value by its name.
    ///
    /// # Errors
    /// That there is no such form.
    pub fn random(word: &str, a: String, b: String) -> Result<Forms<String>, String> {
        match word {
            "normal" => Ok(Forms::Normal { mean: a, deviation: b }),
            "uniform" => Ok(Forms::Uniform { low: a, high: b }),
            _ => Err(format!("there is no distribution `{word}`")),
        }
    }

    /// With numbers in the place of texts.
    ///
    /// # Errors
    /// Why it cannot be.
    pub fn resolve(&self, read: super::Read) -> Result<Forms<Reading>, String> {
        let both = |a: &String, b: &String| {
            let (a, b) = (read(a)?, read(b)?);
            match a.unit == b.unit {
                true => Ok((a, b)),
                false => Err(format!(
                    "`{}` and `{}` are of two units: both are to be of one",
                    a.text(),
                    b.text()
                )),
            }
        };
        Ok(match self {
            Forms::List(texts) => {
                Forms::List(texts.iter().map(|text| read(text)).collect::<Result<_, _>>()?)
            }
            Forms::Range { from, to, count, log } => {
                let (from, to) = both(from, to)?;
                if !(1..=MOST_VALUES).contains(count) {
                    return Err(format!("a range of {count} values: 1 to {MOST_VALUES} can be"));
                }
                if *log && (from.number <= 0.0 || to.number <= 0.0) {
                    return Err("both ends of a range in equal ratios must be above 0".into());
                }
                Forms::Range { from, to, count: *count, log: *log }
            }
            Forms::Normal { mean, deviation } => {
                let (mean, deviation) = both(mean, deviation)?;
                if deviation.number < 0.0 {
                    return Err("the standard deviation is below 0".into());
                }
                Forms::Normal { mean, deviation }
            }
            Forms::Uniform { low, high } => {
                let (low, high) = both(low, high)?;
                if high.number < low.number {
                    return Err("the upper end lies below the lower one".into());
                }
                Forms::Uniform { low, high }
            }
        })
    }
}

impl<T> Forms<T> {
    /// Whether each run draws a value of its own.
    pub fn is_random(&self) -> bool {
        matches!(self, Forms::Normal { .. } | Forms::Uniform { .. })
    }
}

impl Forms<Reading> {
    /// How many values a grid has of it, at least 1.
    pub fn count(&self) -> u64 {
        match self {
            Forms::List(values) => values.len().max(1) as u64,
            Forms::Range { count, .. } => *count,
            Forms::Normal { .. } | Forms::Uniform { .. } => 1,
        }
    }

    /// The value at a place of the grid; a random one is that of a run.
    pub fn value(&self, at: u64, seed: u64, run: u64) -> Reading {
        match self {
            Forms::List(values) => values[at as usize].clone(),
            Forms::Range { from, .. } if at == 0 => from.clone(),
            Forms::Range { to, count, .. } if at + 1 == *count => to.clone(),
            Forms::Range { from, to, count, log } => {
                let part = at as f64 / (count - 1) as f64;
                from.with(match log {
                    true => from.number * libm::pow(to.number / from.number, part),
                    false => from.number + part * (to.number - from.number),
                })
            }
            Forms::Normal { mean, deviation } => {
                mean.with(mean.number + deviation.number * random::normal(seed, run))
            }
            Forms::Uniform { low, high } => {
                low.with(low.number + (high.number - low.number) * random::fraction(seed, run))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_are_read() {
        let forms = |text: &str| Axis::parse(text).unwrap().forms;
        let text = |s: &str| s.to_string();
        assert_eq!(forms("L = 1mH, 2 mH"), Forms::List(vec![text("1mH"), text("2 mH")]));
        let range = |count, log| Forms::Range { from: text("1mH"), to: text("3mH"), count, log };
        assert_eq!(forms("L=1mH..3mH:5"), range(5, false));
        assert_eq!(forms("L=1mH..3mH:7:log"), range(7, true));
        let normal = Forms::Normal { mean: text("2mH"), deviation: text("1e-4 H") };
        assert_eq!(forms("L=normal(2mH, 1e-4 H)"), normal);
        for wrong in ["L", "=3", "L=", "L=1..2", "L=1..2:x", "L=1..2:3:lin", "L=normal(1)"] {
            assert!(Axis::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_keep_their_units() {
        let milli = |unit: &str| (unit == "mH").then_some(1e-3);
        let reading = Reading::of("2.5 mH", &milli).unwrap();
        assert_eq!((reading.si(), reading.text()), (2.5e-3, "2.5e0 mH".to_string()));
        assert!(Reading::of("2.5 km", &milli).is_err());
        assert!(Reading::of("mH", &milli).is_err());
        assert!(Reading::of("inf", &milli).is_err());
        assert_eq!(Reading::of("1e3", &milli).unwrap().si(), 1e3);
    }

    #[test]
    fn ranges_meet_both_ends() {
        let read = |text: &str| Reading::of(text, &|_| None);
        let values = |text: &str| -> Vec<f64> {
            let forms = Forms::parse(text).unwrap().resolve(&read).unwrap();
            (0..forms.count()).map(|at| forms.value(at, 0, 0).si()).collect()
        };
        assert_eq!(values("1..3:5"), [1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(values("1..3:1"), [1.0]);
        let log = values("0.1..1000:5:log");
        assert_eq!((log[0], log[4]), (0.1, 1000.0));
        assert!(
            log.iter().zip([0.1, 1.0, 10.0, 100.0, 1e3]).all(|(a, b)| (a / b - 1.0).abs() < 1e-14)
        );
    }
}
