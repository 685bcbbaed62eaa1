//! A linear model in the words of other programs: JSON, MATLAB, python-control; and as equations to read.

use super::linear::{Channel, Linear, Quantity};
use super::point::At;
use super::poles::Pole;
use super::state_space::{Matrix, StateSpace};
use crate::linear::roots::Root;
use serde_json::{Value, json};
use std::fmt::Write;

/// Where it was linearised, as a phrase.
pub fn place(linear: &Linear) -> String {
    match linear.at {
        At::Start => "at the start".to_string(),
        At::Time(t) => format!("at {t} s"),
        At::Rest => "at rest".to_string(),
    }
}

fn place_json(linear: &Linear) -> Value {
    let kind = match linear.at {
        At::Start => "start",
        At::Time(_) => "time",
        At::Rest => "rest",
    };
    json!({"point": kind, "time": linear.time})
}

fn channels(channels: &[Channel]) -> Value {
    channels.iter().map(|c| json!({"name": c.name, "unit": c.unit})).collect()
}

fn quantity(quantity: &Quantity) -> Value {
    json!({"name": quantity.name, "unit": quantity.unit, "value": quantity.value})
}

/// `{schema, model, at, form, states, inputs, outputs, E, A, B, C, D, dependent}`; E only in descriptor form.
pub fn to_json(linear: &Linear, space: &StateSpace) -> Value {
    let names: Vec<&str> = space.states.iter().map(|state| state.name.as_str()).collect();
    let dependent = space.dependent.iter().map(|(own, factors)| {
        let on = names.iter().zip(factors).filter(|(_, factor)| **factor != 0.0);
        let on: serde_json::Map<String, Value> =
            on.map(|(name, factor)| (name.to_string(), json!(factor))).collect();
        json!({"name": own.name, "unit": own.unit, "of": on})
    });
    let mut result = json!({
        "schema": 1,
        "model": linear.name,
        "at": place_json(linear),
        "form": if space.descriptor.is_some() { "descriptor" } else { "state-space" },
        "states": space.states.iter().map(quantity).collect::<Vec<_>>(),
        "inputs": channels(&linear.inputs),
        "outputs": channels(&linear.outputs),
        "dependent": dependent.collect::<Vec<_>>(),
    });
    if let (Some(diagonal), Some(map)) = (&space.descriptor, result.as_object_mut()) {
        map.insert("E".into(), json!(full(diagonal)));
    }
    for (name, matrix) in [("A", &space.a), ("B", &space.b), ("C", &space.c), ("D", &space.d)] {
        if let Some(map) = result.as_object_mut() {
            map.insert(name.into(), json!(matrix));
        }
    }
    result
}

fn full(diagonal: &[f64]) -> Matrix {
    let n = diagonal.len();
    (0..n).map(|i| (0..n).map(|j| if i == j { diagonal[i] } else { 0.0 }).collect()).collect()
}

/// What a script says first.
fn heading(linear: &Linear, mark: &str) -> String {
    let mut text = format!("{mark} {}, linearised {} by bondspice\n", linear.name, place(linear));
    let with_units = |names: Vec<(&str, &str)>| {
        let one = |(name, unit): &(&str, &str)| match *unit {
            "" => name.to_string(),
            unit => format!("{name} [{unit}]"),
        };
        names.iter().map(one).collect::<Vec<_>>().join(", ")
    };
    let of = |channels: &[Channel]| {
        with_units(channels.iter().map(|c| (c.name.as_str(), c.unit.as_str())).collect())
    };
    let _ = writeln!(text, "{mark} inputs: {}", of(&linear.inputs));
    let _ = writeln!(text, "{mark} outputs: {}", of(&linear.outputs));
    text
}

fn states(space: &StateSpace, mark: &str) -> String {
    let mut text = String::new();
    for state in &space.states {
        let unit = if state.unit.is_empty() { String::new() } else { format!(" [{}]", state.unit) };
        let _ = writeln!(text, "{mark} state: {}{unit}, at the point {}", state.name, state.value);
    }
    text
}

fn matrices(space: &StateSpace) -> Vec<(&'static str, Matrix, [usize; 2])> {
    let (n, p) = (space.a.len(), space.c.len());
    let m = space.b.first().or(space.d.first()).map_or(0, Vec::len);
    let mut all = vec![];
    if let Some(diagonal) = &space.descriptor {
        all.push(("E", full(diagonal), [n, n]));
    }
    all.push(("A", space.a.clone(), [n, n]));
    all.push(("B", space.b.clone(), [n, m]));
    all.push(("C", space.c.clone(), [p, n]));
    all.push(("D", space.d.clone(), [p, m]));
    all
}

fn quoted<'n>(names: impl Iterator<Item = &'n str>, quote: char) -> String {
    let escaped = |name: &str| match quote {
        '\'' => name.replace('\'', "''"),
        _ => name.replace('\\', "\\\\").replace('"', "\\\""),
    };
    names.map(|name| format!("{quote}{}{quote}", escaped(name))).collect::<Vec<_>>().join(", ")
}

/// A MATLAB script that makes `sys`, of the Control System Toolbox.
pub fn to_matlab(linear: &Linear, space: &StateSpace) -> String {
    let mut text = heading(linear, "%") + &states(space, "%");
    for (name, matrix, [rows, columns]) in matrices(space) {
        if rows == 0 || columns == 0 {
            let _ = writeln!(text, "{name} = zeros({rows}, {columns});");
            continue;
        }
        let row =
            |row: &Vec<f64>| row.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" ");
        let rows: Vec<String> = matrix.iter().map(row).collect();
        let _ = writeln!(text, "{name} = [{}];", rows.join("; ..."));
    }
    text += match space.descriptor {
        Some(_) => "sys = dss(A, B, C, D, E);\n",
        None => "sys = ss(A, B, C, D);\n",
    };
    let lists = [
        ("StateName", quoted(space.states.iter().map(|s| s.name.as_str()), '\'')),
        ("InputName", quoted(linear.inputs.iter().map(|c| c.name.as_str()), '\'')),
        ("OutputName", quoted(linear.outputs.iter().map(|c| c.name.as_str()), '\'')),
    ];
    for (name, list) in lists {
        let _ = writeln!(text, "sys.{name} = {{{list}}};");
    }
    text.replace("; ...", "; ...\n     ")
}

/// A Python script that makes `system`, of python-control; in descriptor form, which that does not know, the matrices and
/// a function of s.
pub fn to_python(linear: &Linear, space: &StateSpace) -> String {
    let mut text = heading(linear, "#") + &states(space, "#");
    text += "import numpy as np\n";
    if space.descriptor.is_none() {
        text += "import control\n";
    }
    text += "\n";
    for (name, matrix, [rows, columns]) in matrices(space) {
        if rows == 0 || columns == 0 {
            let _ = writeln!(text, "{name} = np.zeros(({rows}, {columns}))");
            continue;
        }
        let row = |row: &Vec<f64>| {
            let numbers: Vec<String> = row.iter().map(|x| format!("{x:e}")).collect();
            format!("[{}]", numbers.join(", "))
        };
        let rows: Vec<String> = matrix.iter().map(row).collect();
        let _ = writeln!(text, "{name} = np.array([{}])", rows.join(",\n    "));
    }
    let lists = [
        ("states", quoted(space.states.iter().map(|s| s.name.as_str()), '"')),
        ("inputs", quoted(linear.inputs.iter().map(|c| c.name.as_str()), '"')),
        ("outputs", quoted(linear.outputs.iter().map(|c| c.name.as_str()), '"')),
    ];
    for (name, list) in &lists {
        let _ = writeln!(text, "{name} = [{list}]");
    }
    text += match space.descriptor {
        Some(_) => {
            "\n\ndef response(s):\n    \"\"\"All outputs over all inputs at a complex s.\"\"\"\n    \
             return C @ np.linalg.solve(s * E - A, B) + D\n"
        }
        None => "system = control.ss(A, B, C, D, states=states, inputs=inputs, outputs=outputs)\n",
    };
    text
}

/// A row of a matrix as a sum of names.
fn sum(row: &[f64], names: &[&str], number: &dyn Fn(f64) -> String) -> String {
    let mut text = String::new();
    for (factor, name) in row.iter().zip(names).filter(|(factor, _)| **factor != 0.0) {
        let size = if factor.abs() == 1.0 { String::new() } else { number(factor.abs()) + " " };
        let sign = match (text.is_empty(), *factor < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += &format!("{sign}{size}{name}");
    }
    if text.is_empty() { "0".into() } else { text }
}

/// The equations of the state space, a line each.
pub fn equations(linear: &Linear, space: &StateSpace, number: &dyn Fn(f64) -> String) -> String {
    let mut names: Vec<&str> = space.states.iter().map(|state| state.name.as_str()).collect();
    let states = names.len();
    names.extend(linear.inputs.iter().map(|input| input.name.as_str()));
    let joined = |a: &[f64], b: &[f64]| [a, b].concat();
    let mut text = String::new();
    for (k, (a, b)) in space.a.iter().zip(&space.b).enumerate() {
        let rated = space.descriptor.as_ref().is_none_or(|diagonal| diagonal[k] == 1.0);
        let left = if rated { format!("der({})", names[k]) } else { "0".into() };
        let _ = writeln!(text, "{left} = {}", sum(&joined(a, b), &names, number));
    }
    for (own, factors) in &space.dependent {
        let _ = writeln!(text, "{} = {}", own.name, sum(factors, &names[..states], number));
    }
    for (output, (c, d)) in linear.outputs.iter().zip(space.c.iter().zip(&space.d)) {
        let unit =
            if output.factor == 1.0 { String::new() } else { format!(" in {}", output.unit) };
        let line = sum(&joined(c, d), &names, number);
        if line != output.name {
            let _ = writeln!(text, "{}{unit} = {line}", output.name);
        }
    }
    text
}

/// `{schema, model, at, poles: [{re, im, multiplicity, frequency, damping, time_constant, parts: [{state, part}]}], zeros}`.
pub fn poles_to_json(linear: &Linear, poles: &[Pole], zeros: Option<&[Root]>) -> Value {
    let pole = |pole: &Pole| {
        let parts = pole
            .parts
            .iter()
            .map(|(state, part)| json!({"state": linear.unknowns[*state].name, "part": part}));
        json!({
            "re": pole.at.re,
            "im": pole.at.im,
            "multiplicity": pole.multiplicity,
            "frequency": pole.frequency(),
            "damping": pole.damping(),
            "time_constant": pole.time_constant(),
            "parts": parts.collect::<Vec<_>>(),
        })
    };
    let zero = |zero: &Root| json!({"re": zero.at.re, "im": zero.at.im, "multiplicity": zero.multiplicity});
    let mut result = json!({
        "schema": 1,
        "model": linear.name,
        "at": place_json(linear),
        "poles": poles.iter().map(pole).collect::<Vec<_>>(),
    });
    if let (Some(zeros), Some(map)) = (zeros, result.as_object_mut()) {
        map.insert("zeros".into(), zeros.iter().map(zero).collect());
    }
    result
}
