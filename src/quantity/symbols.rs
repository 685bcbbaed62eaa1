//! The table of unit symbols and prefixes, and what a name that is none was meant to be.
//!
//! Factors are the published definitions to the last bit (BIPM, *The International System of Units*, 9th edition; the
//! inch is 25.4 mm, the pound-force per square inch 6894.757293168361 Pa).

use super::dimension::Dimension;
use super::nearest::nearest;
use std::f64::consts::PI;

/// A symbol: its name, SI units in one of it, its dimension, whether SI prefixes go with it.
pub struct Symbol {
    /// As written.
    pub name: &'static str,
    /// SI units in one of it.
    pub factor: f64,
    /// Its dimension.
    pub dimension: Dimension,
    /// Whether `m`, `k` and the others may stand before it.
    pub prefixes: bool,
}

const fn si(name: &'static str, dimension: Dimension) -> Symbol {
    Symbol { name, factor: 1.0, dimension, prefixes: true }
}

const fn other(name: &'static str, factor: f64, dimension: Dimension, prefixes: bool) -> Symbol {
    Symbol { name, factor, dimension, prefixes }
}

const fn d(m: i16, kg: i16, s: i16, a: i16, k: i16) -> Dimension {
    Dimension::new(m, kg, s, a, k)
}

const MOLE: Dimension = Dimension([(0, 1), (0, 1), (0, 1), (0, 1), (0, 1), (1, 1), (0, 1)]);
const CANDELA: Dimension = Dimension([(0, 1), (0, 1), (0, 1), (0, 1), (0, 1), (0, 1), (1, 1)]);

/// Every symbol, one row each; Ω as the Greek letter and as the sign of its own.
pub const SYMBOLS: &[Symbol] = &[
    si("m", d(1, 0, 0, 0, 0)),
    other("g", 1e-3, d(0, 1, 0, 0, 0), true),
    si("s", d(0, 0, 1, 0, 0)),
    si("A", d(0, 0, 0, 1, 0)),
    si("K", d(0, 0, 0, 0, 1)),
    si("mol", MOLE),
    si("cd", CANDELA),
    si("rad", Dimension::NONE),
    si("sr", Dimension::NONE),
    si("Hz", d(0, 0, -1, 0, 0)),
    si("N", d(1, 1, -2, 0, 0)),
    si("Pa", d(-1, 1, -2, 0, 0)),
    si("J", d(2, 1, -2, 0, 0)),
    si("W", d(2, 1, -3, 0, 0)),
    si("C", d(0, 0, 1, 1, 0)),
    si("V", d(2, 1, -3, -1, 0)),
    si("F", d(-2, -1, 4, 2, 0)),
    si("Ohm", d(2, 1, -3, -2, 0)),
    si("\u{3a9}", d(2, 1, -3, -2, 0)),
    si("\u{2126}", d(2, 1, -3, -2, 0)),
    si("S", d(-2, -1, 3, 2, 0)),
    si("Wb", d(2, 1, -2, -1, 0)),
    si("T", d(0, 1, -2, -1, 0)),
    si("H", d(2, 1, -2, -2, 0)),
    si("lm", CANDELA),
    other("bar", 1e5, d(-1, 1, -2, 0, 0), true),
    other("psi", 6894.757293168361, d(-1, 1, -2, 0, 0), true),
    other("L", 1e-3, d(3, 0, 0, 0, 0), true),
    other("min", 60.0, d(0, 0, 1, 0, 0), false),
    other("h", 3600.0, d(0, 0, 1, 0, 0), false),
    other("rpm", 2.0 * PI / 60.0, d(0, 0, -1, 0, 0), false),
    other("rev", 2.0 * PI, Dimension::NONE, false),
    other("deg", PI / 180.0, Dimension::NONE, false),
    other("inch", 0.0254, d(1, 0, 0, 0, 0), false),
    other("degC", 1.0, d(0, 0, 0, 0, 1), false),
    other("%", 0.01, Dimension::NONE, false),
];

/// SI prefixes; micro in its three spellings.
pub const PREFIXES: &[(&str, f64)] = &[
    ("da", 1e1),
    ("h", 1e2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
    ("T", 1e12),
    ("P", 1e15),
    ("E", 1e18),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("\u{b5}", 1e-6),
    ("\u{3bc}", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
    ("f", 1e-15),
    ("a", 1e-18),
];

/// Words that never are units.
pub(super) const NEVER: &[&str] =
    &["and", "or", "not", "then", "else", "step", "until", "in", "as", "follows"];

/// The powers of ten that doubles hold exactly, so that `mm` is a division by 1000 and not a product with 0.001.
fn scale(prefix: f64, factor: f64) -> f64 {
    if prefix < 1.0 { factor / (1.0 / prefix).round() } else { prefix * factor }
}

/// The symbol or prefixed symbol of a name: SI units in one, dimension.
pub(super) fn symbol(name: &str) -> Option<(f64, Dimension)> {
    if let Some(row) = SYMBOLS.iter().find(|row| row.name == name) {
        return Some((row.factor, row.dimension));
    }
    PREFIXES.iter().find_map(|(prefix, value)| {
        let rest = name.strip_prefix(prefix)?;
        let row = SYMBOLS.iter().find(|row| row.prefixes && row.name == rest)?;
        let factor = if row.name == "g" {
            // The base unit is the kilogram: kg is 1, not 1000·0.001.
            scale(value / 1e3, 1.0)
        } else {
            scale(*value, row.factor)
        };
        Some((factor, row.dimension))
    })
}

/// Whether a name is a unit's, with or without a prefix.
pub fn is_unit_name(name: &str) -> bool {
    !NEVER.contains(&name) && symbol(name).is_some()
}

/// The name of a unit nearest to one that is not.
pub(super) fn nearest_unit(name: &str) -> Option<String> {
    const FOREIGN: &[(&str, &str)] = &[
        ("ohms", "Ohm"),
        ("ohm", "Ohm"),
        ("sec", "s"),
        ("secs", "s"),
        ("l", "L"),
        ("litre", "L"),
        ("liter", "L"),
        ("cc", "cm^3"),
        ("m2", "m^2"),
        ("m3", "m^3"),
        ("cm2", "cm^2"),
        ("cm3", "cm^3"),
        ("mm2", "mm^2"),
        ("mm3", "mm^3"),
        ("Nm", "N*m"),
        ("Nms", "N*m*s"),
        ("Kg", "kg"),
        ("KG", "kg"),
        ("hz", "Hz"),
        ("volt", "V"),
        ("volts", "V"),
        ("amp", "A"),
        ("amps", "A"),
        ("meg", "M (a prefix, as in MOhm)"),
        ("degree", "deg"),
        ("degrees", "deg"),
        ("turn", "rev"),
        ("RPM", "rpm"),
        ("in", "inch"),
        ("lpm", "L/min"),
        ("As", "A*s"),
        ("Vs", "V*s"),
        ("Ws", "W*s"),
        ("Wh", "W*h"),
        ("Ah", "A*h"),
    ];
    if name.contains(['²', '³']) {
        return Some(name.replace('²', "^2").replace('³', "^3"));
    }
    let words = name.to_lowercase();
    let foreign = FOREIGN.iter().find(|(wrong, _)| *wrong == name);
    let spoken = || FOREIGN.iter().find(|(wrong, _)| wrong.len() > 3 && *wrong == words);
    if let Some((_, meant)) = foreign.or_else(spoken) {
        return Some(meant.to_string());
    }
    if name.chars().count() <= 2 {
        // Nearly every pair of letters is near some unit; only a slip of case says anything.
        let same = |candidate: &str| candidate.to_lowercase() == name.to_lowercase();
        // `mh` is `mH` rather than `MH`.
        let changes = |candidate: &String| {
            candidate.chars().zip(name.chars()).filter(|(one, other)| one != other).count()
        };
        return all_names().filter(|candidate| same(candidate)).min_by_key(changes);
    }
    // A plural, `Ohms`, before two units run together, `Ohm*s`.
    if let Some(one) =
        name.strip_suffix('s').filter(|one| one.chars().count() > 2 && is_unit_name(one))
    {
        return Some(one.to_string());
    }
    // One letter too many, `uFF`, or two units run together, `kNm`.
    let cuts = || name.char_indices().map(|(at, _)| at).skip(1);
    let last = cuts().last().filter(|at| is_unit_name(&name[..*at]));
    let joined = cuts().find(|at| is_unit_name(&name[..*at]) && is_unit_name(&name[*at..]));
    match (last, joined) {
        (Some(last), _) if name[..last].ends_with(&name[last..]) => {
            return Some(name[..last].to_string());
        }
        (_, Some(at)) => return Some(format!("{}*{}", &name[..at], &name[at..])),
        (Some(last), None) => return Some(name[..last].to_string()),
        (None, None) => {}
    }
    let names: Vec<String> = all_names().collect();
    nearest(name, names.iter().map(String::as_str)).map(str::to_string)
}

/// Every name: plain symbols first, then with each prefix.
fn all_names() -> impl Iterator<Item = String> {
    let plain = SYMBOLS.iter().map(|row| row.name.to_string());
    let prefixed = SYMBOLS
        .iter()
        .filter(|row| row.prefixes)
        .flat_map(|row| PREFIXES.iter().map(move |(prefix, _)| format!("{prefix}{}", row.name)));
    plain.chain(prefixed)
}
