//! What is told besides the cause when no solution is found: what equations leave over, how far each help came, why the last
//! steps were cut; and what an operating point leaves open.

use super::explain::{equation, listed};
use super::search::Sought;
use super::step::{Reason, Stuck};
use super::system::{System, Target};
use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// What the worst equations leave over, and the values that they speak of.
pub(crate) fn left_over(system: &System, rows: &[(usize, f64, f64)], x: &[f64]) -> Vec<String> {
    let mut notes = vec![];
    let mut spoken_of: Vec<usize> = vec![];
    for (row, left, size) in rows {
        let (what, _) = equation(system, *row);
        // Behind the equations stand the charges, in As or Vs.
        let charge = row.checked_sub(system.equations());
        let unit = match (system.spoken.is_empty(), charge) {
            (true, None) if *row < system.nodes => " A",
            (true, None) => " V",
            _ => "",
        };
        notes.push(format!(
            "{what}: {}{unit} are left over, of terms of {}{unit}{}",
            three_figures(*left),
            three_figures(*size),
            elements(system, *row),
        ));
        let terms = match charge {
            Some(charge) => system.charges.row(charge),
            None => system.conductances.row(*row),
        };
        spoken_of.extend(terms.map(|(column, _)| column));
        for group in &system.groups {
            for (o, target) in group.targets.iter().enumerate() {
                let Target::Equations(into) = target else { continue };
                if into.iter().any(|(equation, _)| *equation as usize == *row) {
                    let inputs = group.laws.row(o).map(|p| group.laws.input(p));
                    spoken_of.extend(inputs.filter(|input| *input < system.equations()));
                }
            }
        }
    }
    let mut seen = std::collections::BTreeSet::new();
    spoken_of.retain(|unknown| seen.insert(*unknown));
    let values = spoken_of.iter().filter(|k| x.get(**k).is_some_and(|x| !x.is_nan())).take(6);
    let values: Vec<String> = values
        .map(|k| format!("{} = {}", system.spoken_unknown(*k), three_figures(x[*k])))
        .collect();
    if !values.is_empty() {
        notes.push(format!("there {}", values.join(", ")));
    }
    notes
}

/// The devices whose laws stand in an equation.
fn elements(system: &System, row: usize) -> String {
    let mut names: Vec<&str> = vec![];
    for group in &system.groups {
        for (target, device) in group.targets.iter().zip(&group.devices) {
            let Target::Equations(into) = target else { continue };
            let name = system.spoken_device(*device);
            if into.iter().any(|(equation, _)| *equation as usize == row) && !names.contains(&name)
            {
                names.push(name);
            }
        }
    }
    match names.len() {
        0 => String::new(),
        _ => format!(" (laws of {})", listed(names.into_iter())),
    }
}

/// Where an unknown stands.
pub(crate) fn place(system: &System, unknown: usize) -> Span {
    system.unknowns.get(unknown).map_or(Span::NONE, |unknown| unknown.span)
}

/// Why the last steps were cut, what the worst equations left over, and the largest values by then.
pub(crate) fn last_cuts(system: &System, stuck: &Stuck) -> Vec<String> {
    let mut notes = vec![];
    let mut concerned: Vec<usize> = vec![];
    for (h, reason) in stuck.cuts.iter() {
        let why = match reason {
            Reason::Error(unknown, size) => {
                concerned.push(*unknown);
                let name = system.spoken_unknown(*unknown);
                format!("the error of {name} was {} times its tolerance", three_figures(*size))
            }
            Reason::Newton(row) => {
                format!("{} could not be satisfied", equation(system, *row).0)
            }
            Reason::Singular => "the equations were singular".into(),
            Reason::NonFinite => "a value was no finite number".into(),
        };
        notes.push(format!("a step of {} s was cut: {why}", three_figures(*h)));
    }
    if !stuck.rows.is_empty() {
        notes.extend(left_over(system, &stuck.rows, &stuck.x));
        return notes;
    }
    concerned.sort_unstable();
    concerned.dedup();
    let values: Vec<String> = concerned
        .iter()
        .filter_map(|k| Some((system.spoken_unknown(*k), stuck.x.get(*k)?)))
        .map(|(name, value)| format!("{name} = {}", three_figures(*value)))
        .collect();
    if !values.is_empty() {
        notes.push(format!("there {}", values.join(", ")));
    }
    notes
}

/// What each help came to.
pub(crate) fn how_far(sought: &Sought) -> String {
    let siemens = |value: Option<f64>| match value {
        Some(value) => format!("down to {} S", three_figures(value)),
        None => "none".into(),
    };
    let drive = match sought.drive {
        0.0 => "none".into(),
        drive => format!("up to {} %", three_figures(100.0 * drive)),
    };
    format!(
        "solutions were found with conductances at all nodes: {}; with lowered sources: {drive}; in a pseudo-transient: {}",
        siemens(sought.gmin),
        siemens(sought.pseudo)
    )
}

/// What to look at, by how far the search came.
pub(crate) fn suggestion(system: &System, sought: &Sought) -> &'static str {
    let flat = sought.singular && sought.gmin.is_some();
    match (system.spoken.is_empty(), flat, sought.drive) {
        (_, _, drive) if drive > 0.0 && drive < 1.0 => {
            "up to a part of the sources there is a solution: look for a limit that they go beyond, a source that a law cannot take up"
        }
        (true, true, _) => {
            "at rest nothing determines some values there: a law without slope; give it one, or join a resistor to it"
        }
        (true, ..) => "check the values near there; or give initial values and start with `uic`",
        (false, ..) => "check the laws near there: is there any value that satisfies them?",
    }
}

/// A value as a message gives it: three figures.
fn three_figures(value: f64) -> String {
    let short = format!("{value:.2e}").parse().unwrap_or(value);
    let plain = value == 0.0 || (1e-3..1e5).contains(&value.abs());
    if plain { format!("{short}") } else { format!("{short:e}") }
}

/// The warning that an operating point leaves a charge or flux open, which keeps its initial value.
pub(crate) fn left_open(system: &System, charge: usize, open: &[u32]) -> Diagnostic {
    let device = system.charge_devices[charge];
    let name = system.spoken_device(device);
    let nodes: Vec<usize> =
        open.iter().map(|k| *k as usize).filter(|k| *k < system.nodes).collect();
    let branch = |k: &&u32| (system.nodes..system.equations()).contains(&(**k as usize));
    let flux = nodes.is_empty() && open.iter().any(|k| branch(&k));
    let names = listed(nodes.iter().map(|node| system.spoken_unknown(*node)));
    let (code, message, because, help) = if flux {
        (
            "W0805",
            format!("the operating point leaves the current of `{name}` open"),
            "inductors and voltage sources form a loop without resistance, or have nothing else to tell their current by",
            "put a resistance into the loop, or state the start: `ic=` and `uic`",
        )
    } else {
        let what = if names.is_empty() { "what `{name}` stores".into() } else { names };
        (
            "W0804",
            format!("the operating point leaves {} open", what.replace("{name}", name)),
            "no current but that of capacitors reaches there: there is no path for a direct one",
            "join it to the rest by a resistor, or state the start: `ic=` and `uic`",
        )
    };
    Diagnostic::warning(code, system.device_span(device), message)
        .says("what is stored in all keeps its initial value")
        .because(because)
        .help(help)
}
