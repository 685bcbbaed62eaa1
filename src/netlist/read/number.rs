//! Numbers of SPICE text: `1.5`, `2e-3`, `4.7k`, `10meg`, `100nF`.
//!
//! | suffix | t | g | meg | k | mil | m | u, µ | n | p | f | a |
//! |---|---|---|---|---|---|---|---|---|---|---|---|
//! | factor | 1e12 | 1e9 | 1e6 | 1e3 | 25.4e-6 | 1e-3 | 1e-6 | 1e-9 | 1e-12 | 1e-15 | 1e-18 |
//!
//! Case does not matter, and letters after the suffix are ignored: `1M` is a milli, `1F` a femto. Dialects differ in `a`, in
//! `x` for 1e6, and in whether `4k7` is 4700 ([`Numbers`]).

use crate::netlist::dialects::Numbers;

/// The suffixes, the longer first where one begins another. `mil` is no power of ten and stands apart.
pub const SUFFIXES: &[(&str, i32)] = &[
    ("meg", 6),
    ("t", 12),
    ("g", 9),
    ("k", 3),
    ("m", -3),
    ("u", -6),
    ("µ", -6),
    ("μ", -6),
    ("n", -9),
    ("p", -12),
    ("f", -15),
    ("a", -18),
];

/// What a text that begins with a number is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    /// Its value, rounded once: `4.7u` is the double nearest to 4.7e-6.
    pub value: f64,
    /// Where the digits end and letters may begin.
    pub letters: usize,
    /// Where the letters end.
    pub end: usize,
}

/// The number that a text begins with.
pub fn number(text: &str, numbers: Numbers) -> Option<Number> {
    let bytes = text.as_bytes();
    let digits =
        |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let signed = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits(signed);
    let mut mantissa = whole;
    if bytes.get(whole) == Some(&b'.') {
        mantissa = digits(whole + 1);
        if mantissa == signed + 1 {
            return None;
        }
    } else if whole == signed {
        return None;
    }
    let mut letters = mantissa;
    if matches!(bytes.get(mantissa), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(mantissa + 1), Some(b'+' | b'-')));
        let end = digits(mantissa + 1 + sign);
        if end > mantissa + 1 + sign {
            letters = end;
        }
    }
    let rest = &text[letters..];
    let length = rest.find(|c: char| !(c.is_alphabetic() || c == 'µ')).unwrap_or(rest.len());
    let end = letters + length;
    if length == 0 {
        return Some(Number { value: text[..letters].parse().ok()?, letters, end });
    }
    let begins =
        |suffix: &str| rest.get(..suffix.len()).is_some_and(|own| own.eq_ignore_ascii_case(suffix));
    let value = if begins("mil") {
        text[..letters].parse::<f64>().ok()? * 25.4e-6
    } else {
        let known = |suffix: &str| begins(suffix) && (suffix != "a" || numbers.atto);
        let mega = numbers.x_is_mega && begins("x");
        match SUFFIXES.iter().find(|(suffix, _)| known(suffix) || (mega && *suffix == "meg")) {
            None => text[..letters].parse().ok()?,
            Some((suffix, power)) => {
                let behind = &text[end..];
                let more = behind.bytes().take_while(u8::is_ascii_digit).count();
                // `4k7`: the suffix stands for the decimal point.
                if numbers.digits_behind && more > 0 && length == suffix.len() && letters == whole {
                    let mantissa = format!("{}.{}", &text[..letters], &behind[..more]);
                    let value = scaled(&mantissa, i64::from(*power))?;
                    return Some(Number { value, letters, end: end + more });
                }
                // The exponent is shifted in the text, so that there is one rounding.
                let written = text.get(mantissa + 1..letters).unwrap_or("0");
                // What does not even fit is infinite or 0 whatever the suffix.
                let huge: i64 = if written.starts_with('-') { -99_999 } else { 99_999 };
                let power = written.parse().unwrap_or(huge).saturating_add(i64::from(*power));
                scaled(&text[..mantissa], power)?
            }
        }
    };
    Some(Number { value, letters, end })
}

/// Powers of ten that doubles hold exactly.
#[rustfmt::skip]
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21,
    1e22,
];

/// mantissa·10^power of at most 15 digits, where that is one exact number times or over another, so that there is one
/// rounding (W. D. Clinger, PLDI 1990).
fn short(mantissa: &str, power: i64) -> Option<f64> {
    let (mut digits, mut behind, mut point) = (0u64, 0, false);
    if mantissa.len() > 15 {
        return None;
    }
    for byte in mantissa.bytes() {
        match byte {
            b'0'..=b'9' => {
                digits = digits * 10 + u64::from(byte - b'0');
                behind += i64::from(point);
            }
            b'.' => point = true,
            _ => return None,
        }
    }
    let power = power.checked_sub(behind)?;
    let factor = *POWERS.get(usize::try_from(power.unsigned_abs()).ok()?)?;
    Some(if power < 0 { digits as f64 / factor } else { digits as f64 * factor })
}

fn scaled(mantissa: &str, power: i64) -> Option<f64> {
    use std::io::Write;
    if let Some(value) = short(mantissa, power) {
        return Some(value);
    }
    let mut buffer = [0u8; 48];
    let mut left = &mut buffer[..];
    if write!(left, "{mantissa}e{power}").is_ok() {
        let used = 48 - left.len();
        return std::str::from_utf8(&buffer[..used]).ok()?.parse().ok();
    }
    format!("{mantissa}e{power}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_are_rounded_once() {
        // Against the standard library's parser, which rounds to nearest.
        let mut seed = 1u64;
        let mut next = |below: u64| {
            seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            (seed >> 33) % below
        };
        let mut exact = 0;
        for _ in 0..20_000 {
            let whole: String =
                (0..1 + next(9)).map(|_| char::from(b'0' + next(10) as u8)).collect();
            let behind: String = (0..next(7)).map(|_| char::from(b'0' + next(10) as u8)).collect();
            let mantissa = if behind.is_empty() { whole } else { format!("{whole}.{behind}") };
            let power = next(61) as i64 - 30;
            let wanted: f64 = format!("{mantissa}e{power}").parse().unwrap();
            if let Some(value) = short(&mantissa, power) {
                exact += 1;
                assert_eq!(value.to_bits(), wanted.to_bits(), "{mantissa}e{power}");
            }
            assert_eq!(scaled(&mantissa, power), Some(wanted));
        }
        assert!(exact > 10_000, "{exact}");
    }

    const NGSPICE: Numbers = Numbers { atto: true, x_is_mega: false, digits_behind: false };
    const XYCE: Numbers = Numbers { atto: false, x_is_mega: true, digits_behind: false };
    const LTSPICE: Numbers = Numbers { atto: false, x_is_mega: false, digits_behind: true };

    #[test]
    #[rustfmt::skip]
    fn the_table_of_suffixes() {
        for (text, value) in [
            ("1", 1.0), ("-1.5", -1.5), ("+.5", 0.5), ("5.", 5.0), ("1e3", 1e3), ("1E-3", 1e-3), ("1.5e+2", 150.0),
            ("4.7t", 4.7e12), ("4.7G", 4.7e9), ("4.7meg", 4.7e6), ("4.7MEG", 4.7e6), ("4.7Megohm", 4.7e6), ("4.7k", 4.7e3),
            ("4.7mil", 4.7 * 25.4e-6), ("4.7m", 4.7e-3), ("4.7M", 4.7e-3), ("4.7u", 4.7e-6), ("4.7µ", 4.7e-6), ("4.7μF", 4.7e-6),
            ("4.7n", 4.7e-9), ("4.7p", 4.7e-12), ("4.7f", 4.7e-15), ("4.7F", 4.7e-15), ("4.7a", 4.7e-18),
            ("100nF", 100e-9), ("10V", 10.0), ("3Ohm", 3.0), ("2e3k", 2e6), ("2e-3meg", 2e3), ("1e", 1.0), ("1ex", 1.0),
            ("270", 270.0), ("0.1u", 0.1e-6), ("1e400", f64::INFINITY), ("1e-999999999999999999999k", 0.0),
        ] {
            let read = number(text, NGSPICE).unwrap();
            assert_eq!((read.value, read.end), (value, text.len()), "{text}");
        }
        for text in ["", "+", ".", "-.", "e3", "k", "inf", "nan", "x1"] {
            assert_eq!(number(text, NGSPICE), None, "{text}");
        }
        assert_eq!(number("4k7", NGSPICE).map(|n| (n.value, n.end)), Some((4e3, 2)));
        assert_eq!(number("2*x", NGSPICE).map(|n| (n.value, n.end)), Some((2.0, 1)));
    }

    #[test]
    fn dialects_differ_in_suffixes() {
        let value = |text, numbers| number(text, numbers).map(|n| (n.value, n.end));
        for (text, ngspice, xyce, ltspice) in [
            ("1a", (1e-18, 2), (1.0, 2), (1.0, 2)),
            ("2x", (2.0, 2), (2e6, 2), (2.0, 2)),
            ("2Meg5", (2e6, 4), (2e6, 4), (2.5e6, 5)),
            ("4k7", (4e3, 2), (4e3, 2), (4700.0, 3)),
            ("1n05", (1e-9, 2), (1e-9, 2), (1.05e-9, 4)),
            ("1.2k7", (1200.0, 4), (1200.0, 4), (1200.0, 4)),
            ("8kHz", (8e3, 4), (8e3, 4), (8e3, 4)),
        ] {
            assert_eq!(value(text, NGSPICE), Some(ngspice), "{text}");
            assert_eq!(value(text, XYCE), Some(xyce), "{text}");
            assert_eq!(value(text, LTSPICE), Some(ltspice), "{text}");
        }
    }
}
