//! A symbolic transfer function as text, LaTeX and JSON.

use super::symbols::{Ratio, Symbol};
use super::transfer::Transfer;
use crate::expr::polynomial::Polynomial;
use num_bigint::{BigInt, Sign};
use serde_json::{Value, json};
use std::fmt::Write;

/// A coefficient of more terms is counted, not written, in text for people.
const MOST_TERMS: usize = 40;
/// A quotient up to so many letters is written in one line, too.
const ONE_LINE: usize = 160;

/// What a number, a symbol and a power look like.
struct Style {
    symbol: fn(&str) -> String,
    power: fn(&str, u32) -> String,
    times: &'static str,
}

const TEXT: Style = Style {
    symbol: |name| name.to_string(),
    power: |name, exponent| format!("{name}^{exponent}"),
    times: "*",
};

const LATEX: Style = Style {
    symbol: latex_name,
    power: |name, exponent| match name.contains('^') {
        true => format!("\\left({name}\\right)^{{{exponent}}}"),
        false => format!("{name}^{{{exponent}}}"),
    },
    times: " ",
};

const GREEK: &[&str] = &[
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu",
    "nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta",
    "Lambda", "Phi", "Psi", "Omega",
];

/// `Jmp` as J with the index mp, `R_eta` as R with the index η, `f(shaft)` as f with the index shaft.
fn latex_name(name: &str) -> String {
    let word = |text: &str| match GREEK.contains(&text) {
        true => format!("\\{text}"),
        false if text.chars().all(|c| c.is_ascii_digit()) || text.chars().count() == 1 => {
            text.to_string()
        }
        false => format!("\\mathrm{{{}}}", text.replace('_', "\\_")),
    };
    if let Some((head, inside)) = name.split_once('(')
        && let Some(inside) = inside.strip_suffix(')')
    {
        return format!("{}_{{{}}}", word(head), word(&inside.replace("->", "\\to ")));
    }
    if GREEK.contains(&name) {
        return word(name);
    }
    let first = name.chars().next().map_or(0, char::len_utf8);
    let (head, index) = match name.split_once('_') {
        Some((head, index)) if head.chars().count() == 1 || GREEK.contains(&head) => (head, index),
        _ => name.split_at(first),
    };
    match index {
        "" => word(head),
        index => format!("{}_{{{}}}", word(head), word(index)),
    }
}

/// A polynomial as a sum.
fn sum(of: &Polynomial, symbols: &[Symbol], style: &Style) -> String {
    let mut text = String::new();
    for (monomial, coefficient) in &of.terms {
        let negative = coefficient.sign() == Sign::Minus;
        text += match (text.is_empty(), negative) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        let size = if negative { -coefficient } else { coefficient.clone() };
        let mut factors = vec![];
        for (k, symbol) in symbols.iter().enumerate().rev() {
            let exponent = monomial.exponent(k);
            let name = (style.symbol)(&symbol.name);
            match exponent {
                0 => {}
                1 => factors.push(name),
                _ => factors.push((style.power)(&name, exponent)),
            }
        }
        // s stands last.
        if size != BigInt::from(1) || factors.is_empty() {
            factors.insert(0, size.to_string());
        }
        text += &factors.join(style.times);
    }
    if text.is_empty() { "0".into() } else { text }
}

/// A quotient as text.
pub fn ratio(of: &Ratio, symbols: &[Symbol]) -> String {
    let bracketed = |text: String, always: bool| {
        let sum = text.contains(" + ") || text.contains(" - ");
        if sum || (always && text.contains('*')) { format!("({text})") } else { text }
    };
    let top = sum(&of.top, symbols, &TEXT);
    match of.bottom.is_one() {
        true => top,
        false => {
            let bottom = bracketed(sum(&of.bottom, symbols, &TEXT), true);
            format!("{}/{bottom}", bracketed(top, false))
        }
    }
}

/// A polynomial by falling powers of s, the coefficients in brackets where they are sums.
fn by_powers(of: &Polynomial, transfer: &Transfer, style: &Style) -> String {
    let mut text = String::new();
    for (power, coefficient) in of.powers(0).iter().enumerate().rev() {
        if coefficient.is_zero() {
            continue;
        }
        let flip = coefficient.len() == 1 && coefficient.is_negative();
        let own = if flip { coefficient.clone().negate() } else { coefficient.clone() };
        let s = match power {
            0 => String::new(),
            1 => "s".to_string(),
            power => (style.power)("s", power as u32),
        };
        let factor = match (own.is_one(), own.len()) {
            (true, _) if power > 0 => String::new(),
            (_, 1) => sum(&own, &transfer.symbols, style),
            // The constant term needs no brackets.
            _ if power == 0 => sum(&own, &transfer.symbols, style),
            _ => format!("({})", sum(&own, &transfer.symbols, style)),
        };
        let between = if factor.is_empty() || s.is_empty() { "" } else { style.times };
        text += match (text.is_empty(), flip) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += &format!("{factor}{between}{s}");
    }
    if text.is_empty() { "0".into() } else { text }
}

/// For people: the quotient where it is short, the coefficients of the powers of s, the symbols.
pub fn to_text(transfer: &Transfer, number: &dyn Fn(f64) -> String) -> String {
    let Transfer { from, to, numerator, denominator, .. } = transfer;
    let mut text = String::new();
    let (top, bottom) =
        (by_powers(numerator, transfer, &TEXT), by_powers(denominator, transfer, &TEXT));
    let line = match bottom.as_str() {
        "1" => top,
        _ => {
            let part = |text: String| {
                if text.contains(' ') || text.contains('*') { format!("({text})") } else { text }
            };
            format!("{}/{}", part(top), part(bottom))
        }
    };
    if line.len() <= ONE_LINE {
        let _ = writeln!(text, "{to}/{from} = {line}\n");
    } else {
        let _ = writeln!(text, "{to}/{from} = numerator/denominator\n");
    }
    for (name, part) in [("numerator", numerator), ("denominator", denominator)] {
        let _ = writeln!(text, "{name}");
        let coefficients = transfer.coefficients(part);
        for (power, (coefficient, value)) in coefficients.iter().enumerate().rev() {
            if coefficient.is_zero() {
                continue;
            }
            let s = match power {
                0 => "1".to_string(),
                1 => "s".to_string(),
                power => format!("s^{power}"),
            };
            let sum = match coefficient.len() {
                count if count > MOST_TERMS => format!("a sum of {count} terms"),
                _ => sum(coefficient, &transfer.symbols, &TEXT),
            };
            let _ = writeln!(text, "  {s:<5} {sum}    [{}]", number(*value));
        }
        if part.is_zero() {
            let _ = writeln!(text, "  0");
        }
    }
    let long = |part: &Polynomial| part.powers(0).iter().any(|power| power.len() > MOST_TERMS);
    if long(numerator) || long(denominator) {
        text += "\n--format json and --format latex write long sums out\n";
    }
    text += "\n";
    let used = transfer.symbols.iter().enumerate().skip(1).filter(|(k, _)| transfer.uses(*k));
    for (_, symbol) in used {
        let meaning = match symbol.meaning.as_str() {
            "" => String::new(),
            meaning => format!("    {meaning}"),
        };
        let _ = writeln!(text, "{} = {}{meaning}", symbol.name, number(symbol.value));
    }
    let (worst, points) = transfer.checked;
    let _ =
        writeln!(text, "agrees with the numeric response at {points} random points to {worst:.0e}");
    text
}

/// `\frac{…}{…}` by falling powers of s.
pub fn to_latex(transfer: &Transfer) -> String {
    let Transfer { from, to, numerator, denominator, .. } = transfer;
    format!(
        "\\frac{{{}}}{{{}}} = \\frac{{{}}}{{{}}}\n",
        latex_name(to),
        latex_name(from),
        by_powers(numerator, transfer, &LATEX),
        by_powers(denominator, transfer, &LATEX)
    )
}

/// `{schema, from, to, states, numerator: [{power, coefficient, value}], denominator, symbols: [{name, value, meaning}],
/// checked: {points, difference}}`, powers of s falling, in SI.
pub fn to_json(transfer: &Transfer) -> Value {
    let part = |part: &Polynomial| -> Value {
        let coefficients = transfer.coefficients(part);
        let rows = coefficients.iter().enumerate().rev().filter(|(_, (own, _))| !own.is_zero());
        rows.map(|(power, (coefficient, value))| {
            json!({"power": power, "coefficient": sum(coefficient, &transfer.symbols, &TEXT), "value": value})
        })
        .collect()
    };
    let symbols = transfer.symbols.iter().enumerate().skip(1).filter(|(k, _)| transfer.uses(*k));
    json!({
        "schema": 1,
        "from": transfer.from,
        "to": transfer.to,
        "states": transfer.states,
        "numerator": part(&transfer.numerator),
        "denominator": part(&transfer.denominator),
        "symbols": symbols.map(|(_, symbol)| json!({
            "name": symbol.name,
            "value": symbol.value,
            "meaning": symbol.meaning,
        })).collect::<Vec<_>>(),
        "checked": {"points": transfer.checked.1, "difference": transfer.checked.0},
    })
}
