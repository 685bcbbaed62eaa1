//! `.options [package] key=value flag …`, in the words of three dialects.
//!
//! ngspice and LTspice have one bag of keys. Xyce's come in packages; `KEYS` says which of them mean something here, and
//! all others are passed over, with one warning that names them.

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
use crate::netlist::CardKind;

/// Packages of Xyce's `.options`.
pub const PACKAGES: &[&str] = &[
    "timeint",
    "timeint-hb",
    "nonlin",
    "nonlin-tran",
    "nonlin-hb",
    "nonlin-twolevel",
    "device",
    "linsol",
    "linsol-hb",
    "loca",
    "output",
    "measure",
    "topology",
    "parser",
    "restart",
    "sensitivity",
    "fft",
    "hbint",
    "diagnostic",
];

/// Key of a package, and the option that it is here. `abstol` of `timeint` is of voltages and currents alike.
#[rustfmt::skip]
const KEYS: &[(&str, &str, &[&str])] = &[
    ("timeint", "reltol", &["reltol"]),
    ("timeint", "abstol", &["abstol", "vntol"]),
    ("timeint", "method", &["method"]),
    ("timeint", "delmax", &["hmax"]),
    ("device", "temp", &["temp"]),
    ("device", "tnom", &["tnom"]),
    ("device", "gmin", &["gmin"]),
    ("device", "smoothbsrc", &["smoothbsrc"]),
    ("device", "rcconst", &["rcconst"]),
    ("sensitivity", "direct", &["sensitivity_direct"]),
    ("sensitivity", "adjoint", &["sensitivity_adjoint"]),
    ("output", "initial_interval", &["initial_interval"]),
    // Seen beforehand, when files are looked for.
    ("output", "phase_output_radians", &[]),
];

/// A looser tolerance of Xyce is passed over: there it is a part of each present value, here of the largest so far, and
/// what dies away would be lost.
const LOOSEST: f64 = 1e-3;

/// Xyce's numbers of methods.
const METHODS: &[(&str, &str)] = &[("7", "trap"), ("8", "gear")];

/// Reads the card. Numbers lose their suffixes.
pub fn options(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let mut options = vec![];
    let mut ahead = *cursor;
    let word = ahead.word().0.to_lowercase();
    let package = PACKAGES.contains(&word.as_str()) && ahead.peek() != Some(b'=');
    let package = package.then_some(word);
    if package.is_some() {
        *cursor = ahead;
    }
    while !cursor.is_done() {
        let (key, value) = if let Some((key, _)) = cursor.key() {
            (key.to_lowercase(), value(reader, cursor)?)
        } else {
            let (flag, _) = cursor.word();
            if flag.is_empty() {
                break;
            }
            (flag.to_lowercase(), "1".to_string())
        };
        if is_always_written(reader, package.as_deref(), &key, &value) {
            continue;
        }
        let Some(package) = &package else {
            options.push((key, value));
            continue;
        };
        let row = KEYS.iter().find(|(of, known, _)| of == package && *known == key);
        let method = METHODS.iter().find(|(number, _)| key == "method" && *number == value);
        let value = method.map_or(value, |(_, name)| name.to_string());
        let loose = key == "reltol" && value.parse::<f64>().is_ok_and(|reltol| reltol > LOOSEST);
        match row {
            Some((_, _, names)) if !loose => {
                options.extend(names.iter().map(|name| (name.to_string(), value.clone())));
            }
            _ => reader.passed.push(format!("{package} {key}")),
        }
    }
    if let (Some(_), true) = (&package, options.is_empty()) {
        return None;
    }
    Some(CardKind::Options(options))
}

fn value(reader: &mut Reader, cursor: &mut Cursor) -> Option<String> {
    cursor.blanks();
    if matches!(cursor.peek(), Some(b'{' | b'\'' | b'"')) {
        let value = reader.value(cursor, "the value of the option")?;
        return Some(value.constant().map_or(String::new(), crate::netlist::plain));
    }
    let (word, from) = cursor.word();
    if word.is_empty() {
        reader.missing(cursor, "the value of the option");
        return None;
    }
    Some(match super::number::number(word, reader.reading.numbers) {
        Some(number) if number.end == word.len() => {
            let span = cursor.span(reader, from, from + word.len());
            reader.diagnostics.extend(super::suffix_warning(word, &number, span));
            crate::netlist::plain(number.value)
        }
        _ => word.to_lowercase(),
    })
}

/// Whether an option is one of those that a netlist in this dialect has whatever it says: its simulator's business.
fn is_always_written(reader: &Reader, package: Option<&str>, key: &str, value: &str) -> bool {
    let (of, own) = reader.dialect.options;
    let mut own = own.iter().filter_map(|option| option.split_once('='));
    own.any(|(name, always)| {
        of == package && name == key && always.parse::<f64>().ok() == value.parse().ok()
    })
}

/// What is said of options that were passed over.
pub fn passed(passed: &[String]) -> Option<Diagnostic> {
    let mut names: Vec<&str> = vec![];
    for name in passed {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    if names.is_empty() {
        return None;
    }
    let message = format!("options without a meaning here are passed over: {}", names.join(", "));
    let warning = Diagnostic::warning("W0704", crate::source::Span::NONE, message);
    Some(warning.because("they steer methods of another simulator"))
}
