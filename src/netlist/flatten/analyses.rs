//! Analyses and sweeps as numbers and indices.

use super::expand::Flat;
use super::experiment::item;
use super::scope::TOP;
use super::values::Lookup;
use crate::circuit::{self, Axis, Points};
use crate::diagnostic::Diagnostic;
use crate::netlist::analysis::{self, Analysis, Data, Sweep};
use crate::netlist::{CardKind, Element, Expr, Name};
use crate::source::Span;

/// The points of one run, at most.
const MOST_POINTS: u64 = 100_000_000;
/// Runs of `.step`, at most.
const MOST_STEPS: u64 = 1_000_000;

/// An analysis card; `None` when it makes no sense, which has been said.
pub fn analysis(
    flat: &Flat,
    wanted: &Analysis,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<circuit::Analysis> {
    let lookup = Lookup::new(flat, &flat.netlist.names);
    match wanted {
        Analysis::Dc(sweeps) => {
            let axes = axes(flat, sweeps, d)?;
            limit(&axes, MOST_POINTS, span, d)?;
            Some(circuit::Analysis::Dc { axes })
        }
        Analysis::Ac(given) => {
            Some(circuit::Analysis::Ac { frequencies: frequencies(flat, given, span, d)? })
        }
        Analysis::Transfer { output, source } => {
            let output = item(&lookup, &output.0, &output.1, d);
            let device = lookup.device(TOP, *source, span, d)?;
            let pending = flat.devices.get(device.0 as usize)?;
            let element = &pending.device.element;
            if !matches!(element, Element::VoltageSource(_) | Element::CurrentSource(_)) {
                let name = flat.netlist.names.text(*source);
                let message = format!("`{name}` is no independent source");
                let help = "`.tf v(out) vin`: the last word is a V or an I";
                d.push(Diagnostic::error("E0786", span, message).help(help));
                return None;
            }
            Some(circuit::Analysis::Transfer { output: output?, source: device })
        }
        // Follows from the others.
        Analysis::Sensitivity { .. } => None,
        Analysis::PoleZero { input, output, drive, roots } => {
            let mut pair = |names: &[Name; 2]| {
                let [a, b] = names.map(|name| lookup.node(TOP, name, span, d));
                Some([a?, b?])
            };
            let (input, output) = (pair(input), pair(output));
            let (input, output) = (input?, output?);
            if let Some(which) =
                [(input, "input"), (output, "output")].iter().find(|(p, _)| p[0] == p[1])
            {
                let message = format!("both nodes of the {} are one", which.1);
                let help = "`.pz in 0 out 0 vol pz`: two nodes of the input, two of the output";
                d.push(Diagnostic::error("E0787", span, message).help(help));
                return None;
            }
            Some(circuit::Analysis::PoleZero { input, output, drive: *drive, roots: *roots })
        }
    }
}

/// The axes of all `.step` cards.
pub fn steps(flat: &Flat, d: &mut Vec<Diagnostic>) -> Vec<Axis> {
    let mut all = vec![];
    for card in &flat.live {
        let CardKind::Step(sweeps) = &card.kind else { continue };
        all.extend(axes(flat, sweeps, d).unwrap_or_default());
        if limit(&all, MOST_STEPS, card.span, d).is_none() {
            return vec![];
        }
    }
    all
}

fn limit(axes: &[Axis], most: u64, span: Span, d: &mut Vec<Diagnostic>) -> Option<()> {
    let count = circuit::sweep::total(axes);
    if count <= most {
        return Some(());
    }
    let message =
        format!("the sweep has {:.3e} points, {:.0e} is the most", count as f64, most as f64);
    d.push(Diagnostic::error("E0789", span, message).help("take a larger increment"));
    None
}

fn axes(flat: &Flat, sweeps: &[Sweep], d: &mut Vec<Diagnostic>) -> Option<Vec<Axis>> {
    sweeps.iter().map(|sweep| axis(flat, sweep, d)).collect()
}

fn axis(flat: &Flat, sweep: &Sweep, d: &mut Vec<Diagnostic>) -> Option<Axis> {
    let text = |name: &Name| flat.netlist.names.text(*name).to_string();
    match sweep {
        Sweep::Quantity { name, points: given, span } => {
            Some(Axis { names: vec![text(name)], points: points(flat, given, *span, d)? })
        }
        Sweep::Table { name, span } => {
            let data = table(flat, *name, *span, d)?;
            let values = numbers(flat, &data.values, d)?;
            let rows = values.chunks(data.columns.len().max(1)).map(<[f64]>::to_vec);
            Some(Axis {
                names: data.columns.iter().map(text).collect(),
                points: Points::Rows(rows.collect()),
            })
        }
    }
}

fn table<'n>(flat: &Flat<'n>, name: Name, span: Span, d: &mut Vec<Diagnostic>) -> Option<&'n Data> {
    let tables = || {
        flat.live.iter().filter_map(|card| match &card.kind {
            CardKind::Data(data) => Some(data),
            _ => None,
        })
    };
    let found = tables().find(|data| data.name == name);
    if found.is_none() {
        let names = &flat.netlist.names;
        let text = names.text(name);
        let error = Diagnostic::error("E0783", span, format!("no `.data` card is called `{text}`"));
        let near = crate::quantity::nearest(text, tables().map(|data| names.text(data.name)));
        d.push(match near {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error.help(format!("`.data {text} p q`, rows of values, `.enddata`")),
        });
    }
    found
}

fn numbers(flat: &Flat, values: &[Expr], d: &mut Vec<Diagnostic>) -> Option<Vec<f64>> {
    let lookup = Lookup::new(flat, &flat.netlist.names);
    values.iter().map(|value| lookup.number(TOP, value, d)).collect()
}

fn points(
    flat: &Flat,
    given: &analysis::Points,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Points> {
    use analysis::Points as Given;
    let three = |values: &[Expr; 3], d: &mut Vec<Diagnostic>| -> Option<[f64; 3]> {
        numbers(flat, values, d)?.try_into().ok()
    };
    let made = match given {
        Given::Linear(values) => {
            let [from, to, by] = three(values, d)?;
            Points::linear(from, to, by)
        }
        Given::Count(values) => {
            let [from, to, count] = three(values, d)?;
            Points::count(from, to, count)
        }
        Given::Decade(values) => {
            let [from, to, per] = three(values, d)?;
            Points::geometric(from, to, 10.0, per)
        }
        Given::Octave(values) => {
            let [from, to, per] = three(values, d)?;
            Points::geometric(from, to, 2.0, per)
        }
        Given::List(values) => {
            let values = numbers(flat, values, d)?;
            let finite = values.iter().all(|value| value.is_finite());
            finite.then(|| Points::Rows(values.into_iter().map(|value| vec![value]).collect()))
        }
        Given::Table(name) => {
            let data = table(flat, *name, span, d)?;
            let values = numbers(flat, &data.values, d)?;
            let named = |name: &&str| ["freq", "frequency", "hertz"].contains(name);
            let columns = data.columns.iter().map(|name| flat.netlist.names.text(*name));
            let folded: Vec<String> = columns.map(str::to_lowercase).collect();
            let column = folded.iter().position(|name| named(&name.as_str())).unwrap_or(0);
            let rows = values.chunks(folded.len().max(1));
            Some(Points::Rows(rows.map(|row| vec![row[column]]).collect()))
        }
    };
    if made.is_none() {
        d.push(
            Diagnostic::error("E0782", span, "these values make no sweep")
                .because("the increment must lead from the first value to the last, decades and octaves go between values of one sign, and there is at least one value"),
        );
    }
    made
}

/// Frequencies, which are above 0 or 0 itself.
pub fn frequencies(
    flat: &Flat,
    given: &analysis::Points,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Points> {
    use analysis::Points as Given;
    let stretched = match given {
        Given::Decade(values) | Given::Octave(values) => {
            let values = numbers(flat, values, d)?;
            let base = if matches!(given, Given::Decade(_)) { 10.0 } else { 2.0 };
            Points::stretched(values[0], values[1], base, values[2])
        }
        _ => None,
    };
    let points = match stretched {
        Some(points) => points,
        None => points(flat, given, span, d)?,
    };
    let axis = Axis { names: vec!["frequency".into()], points };
    limit(std::slice::from_ref(&axis), MOST_POINTS, span, d)?;
    let negative = match &axis.points {
        Points::Rows(rows) => rows.iter().flatten().any(|f| *f < 0.0 || !f.is_finite()),
        points => points.value(0) < 0.0 || points.value(points.len() - 1) < 0.0,
    };
    if negative {
        d.push(Diagnostic::error("E0782", span, "a frequency is below 0"));
        return None;
    }
    Some(axis.points)
}
