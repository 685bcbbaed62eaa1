//! From traces to panels: one for each unit, files and runs one over the other; phasors as Bode or Nyquist plots; a trace
//! beside its reference with the tube of the tolerance.

use super::super::picture::{CURVES, Ink, Point};
use super::axis::{Axis, Scale};
use super::{Band, Curve, Mark, Panel};
use crate::trace::Trace;
use crate::trace::compare::Comparison;
use crate::trace::resample::{place, value};
use std::f64::consts::PI;

/// A trace and what it is called.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The name of its file.
    pub name: &'a str,
    /// Its columns.
    pub trace: &'a Trace,
}

/// What is drawn of phasors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Magnitude in decibels and phase in degrees over a logarithmic frequency.
    #[default]
    Bode,
    /// The imaginary part over the real part.
    Nyquist,
}

/// What to draw.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Columns by name; all where there is none.
    pub signals: Vec<String>,
    /// Columns that are divided by a base, in their units.
    pub per_unit: Vec<(String, f64)>,
    /// The column that is the abscissa, where it is not the trace's own.
    pub over: Option<String>,
    /// How phasors are drawn.
    pub kind: Kind,
    /// The part of the abscissa that is shown.
    pub limits: Option<(f64, f64)>,
}

/// A name that no trace has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing(pub String);

/// A column that is drawn: its name, the place of its values, that of its imaginary parts.
#[derive(Clone, Debug)]
struct Column {
    name: String,
    at: usize,
    imaginary: Option<usize>,
}

/// The panels of some traces.
///
/// # Errors
/// A name that is asked for and that no trace has.
pub fn panels(sources: &[Source], choice: &Choice) -> Result<Vec<Panel>, Missing> {
    let per_unit = choice.per_unit.iter().map(|(name, _)| name);
    for name in choice.signals.iter().chain(per_unit).chain(&choice.over) {
        let has = |s: &Source| s.trace.position(name).is_some() || column(s.trace, name).is_some();
        if !sources.iter().any(has) {
            return Err(Missing(name.clone()));
        }
    }
    let mut panels: Vec<(String, Panel)> = vec![];
    for (order, source) in sources.iter().enumerate() {
        let columns = match choice.signals.is_empty() {
            true => columns(source.trace, choice),
            false => choice.signals.iter().filter_map(|name| column(source.trace, name)).collect(),
        };
        for column in &columns {
            let names = Names { column, source, order, files: sources.len(), all: columns.len() };
            match (column.imaginary, choice.kind) {
                (None, _) => real(&names, choice, &mut panels),
                (Some(imaginary), Kind::Bode) => bode(&names, imaginary, choice, &mut panels),
                (Some(imaginary), Kind::Nyquist) => nyquist(&names, imaginary, choice, &mut panels),
            }
        }
    }
    let mut panels: Vec<Panel> = panels.into_iter().map(|(_, panel)| panel).collect();
    for panel in &mut panels {
        // One curve alone is named at its axis.
        if let [curve] = &mut panel.curves[..] {
            curve.name.clear();
        }
    }
    Ok(panels)
}

/// A column and whose it is.
struct Names<'a> {
    column: &'a Column,
    source: &'a Source<'a>,
    order: usize,
    files: usize,
    all: usize,
}

impl Names<'_> {
    /// What the legend says of a run.
    fn curve(&self, run: Option<usize>) -> String {
        let mut name = self.column.name.clone();
        if let Some(run) = run {
            name += &format!(" #{run}");
        }
        if self.files > 1 {
            name += &format!(" ({})", self.source.name);
        }
        name
    }
}

/// All columns that are no abscissa, pairs of parts as one.
fn columns(trace: &Trace, choice: &Choice) -> Vec<Column> {
    let over = choice.over.as_deref().and_then(|name| trace.position(name));
    let first = trace.abscissa() + 1;
    let names = (first..trace.names.len()).filter(|at| Some(*at) != over);
    let mut found = vec![];
    for at in names {
        let name = &trace.names[at];
        let base = name.strip_suffix(".re");
        if let Some(column) = base.and_then(|base| column(trace, base)) {
            found.push(column);
            continue;
        }
        let real = name.strip_suffix(".im").map(|base| format!("{base}.re"));
        if real.is_none_or(|real| trace.position(&real).is_none()) {
            found.push(Column { name: name.clone(), at, imaginary: None });
        }
    }
    found
}

/// The column of a name, of a phasor by its name alone.
fn column(trace: &Trace, name: &str) -> Option<Column> {
    if let Some(at) = trace.position(name) {
        return Some(Column { name: trace.names[at].clone(), at, imaginary: None });
    }
    let at = trace.position(&format!("{name}.re"))?;
    let imaginary = Some(trace.position(&format!("{name}.im"))?);
    Some(Column { name: name.to_string(), at, imaginary })
}

/// The panel of a key, made where there is none.
fn panel_of(
    panels: &mut Vec<(String, Panel)>,
    key: String,
    make: impl FnOnce() -> Panel,
) -> &mut Panel {
    let at = panels.iter().position(|(other, _)| *other == key).unwrap_or_else(|| {
        panels.push((key, make()));
        panels.len() - 1
    });
    &mut panels[at].1
}

fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} [{unit}]") }
}

fn ink(panel: &Panel) -> Ink {
    Ink::Curve((panel.curves.len() % usize::from(CURVES)) as u8)
}

fn abscissa(trace: &Trace, choice: &Choice) -> (usize, Axis) {
    let named = choice.over.as_deref().and_then(|name| trace.position(name));
    let at = named.unwrap_or_else(|| trace.abscissa());
    let name = trace.names.get(at).map_or("", String::as_str);
    let unit = match trace.units.get(at).map(String::as_str) {
        Some("") | None if name == "time" => "s",
        Some("") | None if name == "frequency" => "Hz",
        unit => unit.unwrap_or(""),
    };
    let scale = if name == "frequency" { Scale::Logarithmic } else { Scale::Linear };
    let axis = Axis { label: labelled(name, unit), scale, limits: choice.limits, step: None };
    (at, axis)
}

/// Adds the curves of a column, one for each run.
fn add(panel: &mut Panel, names: &Names, runs: Vec<Vec<Point>>) {
    let many = runs.len() > 1;
    for (run, points) in runs.into_iter().enumerate() {
        // Of many runs the first are named: their order is that of the colours.
        let named = !many || run < usize::from(CURVES);
        panel.curves.push(Curve {
            name: if named { names.curve(many.then_some(run)) } else { String::new() },
            ink: ink(panel),
            dashed: names.order % 2 == 1,
            width: 1.4,
            points,
        });
    }
}

fn real(names: &Names, choice: &Choice, panels: &mut Vec<(String, Panel)>) {
    let Names { column, source: Source { trace, .. }, .. } = names;
    let (over, x) = abscissa(trace, choice);
    let base = choice.per_unit.iter().find(|(name, _)| *name == column.name).map(|(_, base)| *base);
    let unit = trace.units.get(column.at).cloned().unwrap_or_default();
    let label = match (base, unit.as_str()) {
        (Some(base), unit) => {
            let of = format!("{base} {unit}");
            format!("{} [p.u. of {}]", column.name, of.trim_end())
        }
        (None, unit) => labelled(&column.name, unit),
    };
    // Columns of one unit share a panel; those of no known unit have one each.
    let key = match base {
        None if !unit.is_empty() => format!("[{unit}]"),
        _ => column.name.to_lowercase(),
    };
    let panel = panel_of(panels, key, || Panel {
        x,
        y: Axis { label: label.clone(), ..Axis::default() },
        ..Panel::default()
    });
    if panel.y.label != label && base.is_none() {
        panel.y.label = format!("[{unit}]");
    }
    let scale = 1.0 / base.unwrap_or(1.0);
    let points = |rows: std::ops::Range<usize>| {
        let pair = |k: usize| (trace.columns[over][k], trace.columns[column.at][k] * scale);
        rows.map(pair).collect()
    };
    let runs: Vec<Vec<Point>> = trace.runs().into_iter().map(points).collect();
    let first = panel.curves.len();
    add(panel, names, runs);
    if trace.names.first().is_some_and(|name| name == RUN) {
        panel.curves[first..].iter_mut().for_each(|curve| table(curve, &mut panel.marks));
    }
}

/// The first column of a table of runs, as `sweep` writes it.
const RUN: &str = "run";

/// A row of a table of runs is a point; a line joins them only where they stand in order.
fn table(curve: &mut Curve, marks: &mut Vec<Mark>) {
    let mark = |at: &Point| Mark { at: *at, ink: curve.ink, cross: false, name: String::new() };
    marks.extend(curve.points.iter().map(mark));
    let rises = curve.points.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if !rises {
        curve.points.clear();
    }
}

fn bode(names: &Names, imaginary: usize, choice: &Choice, panels: &mut Vec<(String, Panel)>) {
    let Names { column, source: Source { trace, .. }, .. } = names;
    let (over, x) = abscissa(trace, choice);
    let (re, im) = (&trace.columns[column.at], &trace.columns[imaginary]);
    let (mut size, mut angle) = (vec![], vec![]);
    for rows in trace.runs() {
        let (mut sizes, mut angles) = (vec![], vec![]);
        let mut last: Option<f64> = None;
        for k in rows {
            let at = trace.columns[over][k];
            sizes.push((at, 20.0 * libm::log10(libm::hypot(re[k], im[k]))));
            let mut phase = libm::atan2(im[k], re[k]);
            // From point to point a phase goes the shorter way.
            if let Some(last) = last {
                phase += 2.0 * PI * ((last - phase) / (2.0 * PI)).round();
            }
            last = Some(phase).filter(|phase| phase.is_finite()).or(last);
            angles.push((at, phase.to_degrees()));
        }
        size.push(sizes);
        angle.push(angles);
    }
    let name = if names.all > 1 { String::new() } else { format!("{} ", column.name) };
    for (key, label, runs) in [("|", "magnitude [dB]", size), ("∠", "phase [deg]", angle)] {
        let panel = panel_of(panels, key.to_string(), || Panel {
            x: x.clone(),
            y: Axis { label: format!("{name}{label}"), ..Axis::default() },
            ..Panel::default()
        });
        add(panel, names, runs);
    }
}

fn nyquist(names: &Names, imaginary: usize, choice: &Choice, panels: &mut Vec<(String, Panel)>) {
    let Names { column, source: Source { trace, .. }, .. } = names;
    let (over, _) = abscissa(trace, choice);
    let axis = |label: &str| Axis { label: label.to_string(), ..Axis::default() };
    let (low, high) = choice.limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let panel = panel_of(panels, "nyquist".into(), || Panel {
        x: axis("real part"),
        y: axis("imaginary part"),
        equal: true,
        marks: vec![Mark { at: (-1.0, 0.0), ink: Ink::Warning, cross: true, name: String::new() }],
        ..Panel::default()
    });
    let points = |rows: std::ops::Range<usize>| {
        let rows = rows.filter(|k| (low..=high).contains(&trace.columns[over][*k]));
        rows.map(|k| (trace.columns[column.at][k], trace.columns[imaginary][k])).collect()
    };
    let runs = trace.runs().into_iter().map(points).collect();
    add(panel, names, runs);
}

/// A trace and its reference: for each signal the two with the tube of the tolerance around the reference, and below
/// the error as a part of the range with its bounds.
pub fn compared(
    trace: Source,
    reference: Source,
    comparison: &Comparison,
    pairs: Option<&[(String, String)]>,
) -> Vec<Panel> {
    let mut panels = vec![];
    for signal in &comparison.signals {
        let own = pairs.and_then(|pairs| pairs.iter().find(|(theirs, _)| *theirs == signal.name));
        let own = own.map_or(signal.name.as_str(), |(_, own)| own.as_str());
        let (Some(a), Some(b)) =
            (trace.trace.position(own), reference.trace.position(&signal.name))
        else {
            continue;
        };
        let (_, x) = abscissa(reference.trace, &Choice::default());
        let (here, there) = (series(trace.trace, a), series(reference.trace, b));
        let scale = if signal.range > 0.0 { signal.range } else { 1.0 };
        let off = signal.tolerance * scale;
        let shifted = |by: f64| there.iter().map(|p| (p.0, p.1 + by)).collect();
        let unit = reference.trace.units[b].as_str();
        let verdict = if signal.same() { "same" } else { "different" };
        panels.push(Panel {
            title: format!(
                "{}: {verdict}, error {:.2e} of range at {:.6}",
                signal.name, signal.max, signal.at
            ),
            x: x.clone(),
            y: Axis { label: labelled(&signal.name, unit), ..Axis::default() },
            bands: vec![Band {
                name: format!("± {:e} of range", signal.tolerance),
                ink: Ink::Curve(2),
                edges: [shifted(-off), shifted(off)],
            }],
            curves: vec![
                curve(reference.name, Ink::Curve(0), 2.4, there.clone()),
                curve(trace.name, Ink::Curve(1), 1.2, here),
            ],
            ..Panel::default()
        });
        let errors = errors(trace.trace, a, reference.trace, b, scale);
        let flat = |level: f64| errors.iter().map(|p| (p.0, level)).collect();
        let edges = [flat(-signal.tolerance), flat(signal.tolerance)];
        panels.push(Panel {
            x,
            y: Axis { label: "error [of range]".into(), ..Axis::default() },
            bands: vec![Band { name: String::new(), ink: Ink::Curve(2), edges }],
            curves: vec![curve("", Ink::Curve(1), 1.2, errors)],
            ..Panel::default()
        });
    }
    panels
}

fn curve(name: &str, ink: Ink, width: f64, points: Vec<Point>) -> Curve {
    Curve { name: name.to_string(), ink, dashed: false, width, points }
}

/// A column over its abscissa, runs one after the other with a gap between them.
fn series(trace: &Trace, at: usize) -> Vec<Point> {
    let mut points = vec![];
    for rows in trace.runs() {
        points.extend(rows.map(|k| (trace.time()[k], trace.columns[at][k])));
        points.push((f64::NAN, f64::NAN));
    }
    points.pop();
    points
}

/// Differences at the reference's rows, as a part of a range.
fn errors(trace: &Trace, a: usize, reference: &Trace, b: usize, range: f64) -> Vec<Point> {
    let mut points = vec![];
    for (own, theirs) in trace.runs().into_iter().zip(reference.runs()) {
        let (time, values) = (&trace.time()[own.clone()], &trace.columns[a][own]);
        for row in theirs {
            let at = reference.time()[row];
            let found = place(time, at).map(|place| value(values, place));
            let error = found.map_or(f64::NAN, |found| (found - reference.columns[b][row]) / range);
            points.push((at, error));
        }
    }
    points
}
