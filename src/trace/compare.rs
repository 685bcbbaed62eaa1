//! Comparing a trace with a reference.
//!
//! The error of a signal is the largest |a − b| / (max − min of b) over the rows of the reference b, the trace a
//! interpolated there. Rows within one rise of a jump of that signal are skipped and counted. A jump is two rows of
//! equal time with different values in either trace; where a rise is stated (translated circuits have rises of
//! step/1000 instead of jumps), also a change of more than [`STEEP`] of the range within one rise.
//!
//! Stepped traces are compared run by run, in their order. A run of one row whose first column is no abscissa (an
//! operating point) is compared in every column.
//!
//! A reference that never changes has no range: its magnitude takes the place; for one that is 0 throughout, errors
//! are absolute.

use super::Trace;
use super::resample::{place, value};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::HashMap;

/// Part of the range by which a signal changes within one rise to be called a jump.
pub const STEEP: f64 = 1e-3;

/// How to compare.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Errors above this part of the range are differences.
    pub tolerance: f64,
    /// Duration of the rises that stand for jumps, in seconds; without it a thousandth of the reference's interval
    /// around exact jumps.
    pub rise: Option<f64>,
    /// Reference's name and trace's name of each signal to compare; without it every column of the reference.
    pub signals: Option<Vec<(String, String)>>,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { tolerance: 1e-3, rise: None, signals: None }
    }
}

/// What comparing found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Version of the form.
    pub schema: u32,
    /// `same` or `different`.
    pub verdict: &'static str,
    /// Every signal that both have.
    pub signals: Vec<Signal>,
    /// Signals of the reference that the trace lacks.
    pub missing: Vec<String>,
}

/// The errors of one signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Signal {
    /// Its name in the reference.
    pub name: String,
    /// The largest error, as a part of the range. Infinite (`null` in JSON) where a value is no number.
    pub max: f64,
    /// The root mean square of the errors.
    pub rms: f64,
    /// Where the largest error is, in the abscissa's unit.
    pub at: f64,
    /// max − min of the reference.
    pub range: f64,
    /// The tolerance it was held against.
    pub tolerance: f64,
    /// Rows skipped because of a jump.
    pub skipped: usize,
    /// Rows of the reference outside the trace's abscissa.
    pub uncovered: usize,
}

impl Signal {
    /// Whether the signal is within its tolerance everywhere.
    pub fn same(&self) -> bool {
        self.max <= self.tolerance && self.uncovered == 0
    }
}

impl Comparison {
    /// Whether nothing differs and nothing is missing.
    pub fn same(&self) -> bool {
        self.missing.is_empty() && self.signals.iter().all(Signal::same)
    }

    /// The signal of a name.
    pub fn signal(&self, name: &str) -> Option<&Signal> {
        self.signals.iter().find(|signal| signal.name == name)
    }

    /// The signal with the largest error.
    pub fn worst(&self) -> Option<&Signal> {
        self.signals.iter().max_by(|a, b| a.max.total_cmp(&b.max))
    }
}

/// Compares a trace with a reference.
pub fn compare(trace: &Trace, reference: &Trace, settings: &Settings) -> Comparison {
    let every: Vec<(String, String)>;
    let pairs = match &settings.signals {
        Some(pairs) => pairs,
        None => {
            let skipped = reference.abscissa() + usize::from(!reference.is_point());
            every = reference.names.iter().skip(skipped).map(|n| (n.clone(), n.clone())).collect();
            &every
        }
    };
    let mut comparison =
        Comparison { schema: 1, verdict: "same", signals: vec![], missing: vec![] };
    let (trace, reference) = (Named::new(trace), Named::new(reference));
    for (theirs, ours) in pairs {
        match (trace.columns(ours), reference.columns(theirs)) {
            (Some(a), Some(b)) => comparison.signals.push(signal(theirs, &a, &b, settings)),
            (None, _) => comparison.missing.push(ours.clone()),
            (_, None) => comparison.missing.push(theirs.clone()),
        }
    }
    if !comparison.same() {
        comparison.verdict = "different";
    }
    comparison
}

/// A trace whose columns are found by name at once, and its runs.
struct Named<'a> {
    trace: &'a Trace,
    places: HashMap<&'a str, usize>,
    /// Those that differ from others by more than case, in lower case.
    folded: HashMap<String, Option<usize>>,
    runs: Vec<std::ops::Range<usize>>,
    point: bool,
}

impl<'a> Named<'a> {
    fn new(trace: &'a Trace) -> Named<'a> {
        let names = trace.names.iter().enumerate();
        let mut folded = HashMap::new();
        for (at, name) in names.clone() {
            folded.entry(name.to_lowercase()).and_modify(|place| *place = None).or_insert(Some(at));
        }
        let places = names.map(|(at, name)| (name.as_str(), at)).collect();
        Named { trace, places, folded, runs: trace.runs(), point: trace.is_point() }
    }

    /// A column, as one over its abscissa for each run.
    fn columns(&self, name: &str) -> Option<Vec<Column<'a>>> {
        let folded = || self.folded.get(&name.to_lowercase()).copied().flatten();
        let place = self.places.get(name).copied().or_else(folded)?;
        let (trace, time) = (self.trace, self.trace.time());
        let values = &trace.columns[place];
        let run = |rows: &std::ops::Range<usize>| {
            let (time, values) = (&time[rows.clone()], &values[rows.clone()]);
            if self.point {
                return Column { time: Cow::Owned(vec![0.0; rows.len()]), values: values.into() };
            }
            if time.first() > time.last() {
                let turned = |column: &[f64]| Cow::Owned(column.iter().rev().copied().collect());
                return Column { time: turned(time), values: turned(values) };
            }
            Column { time: time.into(), values: values.into() }
        };
        Some(self.runs.iter().map(run).collect())
    }
}

/// A column over its abscissa, which rises.
struct Column<'a> {
    time: Cow<'a, [f64]>,
    values: Cow<'a, [f64]>,
}

/// The error of a signal over all runs.
fn signal(name: &str, a: &[Column], b: &[Column], settings: &Settings) -> Signal {
    let all = b.iter().flat_map(|run| run.values.iter());
    let (low, high) =
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    let range = if high >= low { high - low } else { 0.0 };
    let magnitude = low.abs().max(high.abs());
    let unit = match range {
        0.0 if magnitude > 0.0 && magnitude.is_finite() => magnitude,
        0.0 => 1.0,
        _ => range,
    };
    let mut result = Signal {
        name: name.to_string(),
        max: 0.0,
        rms: 0.0,
        at: b.first().and_then(|run| run.time.first()).copied().unwrap_or(0.0),
        range,
        tolerance: settings.tolerance,
        skipped: 0,
        uncovered: 0,
    };
    let (mut squares, mut counted) = (0.0, 0_usize);
    let nothing = Column { time: Cow::Owned(vec![]), values: Cow::Owned(vec![]) };
    for (at, b) in b.iter().enumerate() {
        run(a.get(at).unwrap_or(&nothing), b, unit, settings, &mut result, |error| {
            squares += error * error;
            counted += 1;
        });
    }
    result.rms = if counted > 0 { (squares / counted as f64).sqrt() } else { 0.0 };
    result
}

/// Takes the errors of one run into the result.
fn run(
    a: &Column,
    b: &Column,
    unit: f64,
    settings: &Settings,
    result: &mut Signal,
    mut count: impl FnMut(f64),
) {
    let interval = interval(&b.time);
    let rise = settings.rise.unwrap_or(interval / 1000.0);
    let mut jumps = jumps(b, unit, settings.rise);
    jumps.extend(self::jumps(a, unit, settings.rise));
    jumps.sort_by(|p, q| p.0.total_cmp(&q.0));
    // Times are sums of steps: a few last digits are no distance.
    let slack = rise + 1e-12 * b.time.last().map_or(0.0, |t| t.abs());
    let (first, last) = match (a.time.first(), a.time.last()) {
        (Some(first), Some(last)) => {
            // A simulator may write its first row one step after 0; a whole interval must not be missing.
            let part = 0.999 * interval;
            (first - part, last + part)
        }
        _ => (f64::INFINITY, f64::NEG_INFINITY),
    };
    let mut jump = 0;
    for (&time, &wanted) in b.time.iter().zip(b.values.iter()) {
        while jumps.get(jump).is_some_and(|(_, end)| end + slack < time) {
            jump += 1;
        }
        if jumps.get(jump).is_some_and(|(start, _)| start - slack <= time) {
            result.skipped += 1;
            continue;
        }
        let covered = first <= time && time <= last;
        let Some(place) = place(&a.time, time).filter(|_| covered) else {
            result.uncovered += 1;
            continue;
        };
        let error = (value(&a.values, place) - wanted).abs() / unit;
        let error = if error.is_nan() { f64::INFINITY } else { error };
        count(error);
        if error > result.max {
            result.max = error;
            result.at = time;
        }
    }
}

/// The middle one of the intervals that are not 0: the output interval of a run on a grid.
fn interval(time: &[f64]) -> f64 {
    let mut gaps: Vec<f64> =
        time.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > 0.0).collect();
    let middle = gaps.len() / 2;
    if gaps.is_empty() {
        return 0.0;
    }
    *gaps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Where a column jumps: begin and end of each jump, in order.
fn jumps(column: &Column, unit: f64, rise: Option<f64>) -> Vec<(f64, f64)> {
    let Column { time, values } = column;
    let mut found: Vec<(f64, f64)> = vec![];
    for row in 0..time.len() {
        for next in row + 1..time.len() {
            let gap = time[next] - time[row];
            let change = (values[next] - values[row]).abs();
            let jump = if gap == 0.0 {
                change > 0.0
            } else if rise.is_some_and(|rise| gap <= rise * (1.0 + 1e-6)) {
                change > STEEP * unit
            } else {
                break;
            };
            if jump {
                found.push((time[row], time[next]));
                break;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(rows: &[(f64, f64)]) -> Trace {
        Trace {
            names: vec!["time".into(), "x".into()],
            units: vec!["s".into(), String::new()],
            columns: vec![rows.iter().map(|r| r.0).collect(), rows.iter().map(|r| r.1).collect()],
        }
    }

    fn grid(f: impl Fn(f64) -> f64) -> Trace {
        trace(&(0..=10).map(|k| (0.1 * k as f64, f(0.1 * k as f64))).collect::<Vec<_>>())
    }

    #[test]
    fn the_error_is_the_largest_difference_over_the_range() {
        let reference = grid(|t| 4.0 * t - 1.0);
        let other = trace(&[(0.0, -1.0), (0.5, 1.02), (1.0, 3.0)]);
        let comparison = compare(&other, &reference, &Settings::default());
        let x = comparison.signal("x").unwrap();
        assert!((x.max - 0.02 / 4.0).abs() < 1e-15 && x.at == 0.5 && x.range == 4.0, "{x:?}");
        let squares: f64 =
            (0..=10).map(|k| 1.0 - (k as f64 - 5.0).abs() / 5.0).map(|e| e * e).sum();
        assert!((x.rms - 0.005 * (squares / 11.0).sqrt()).abs() < 1e-12);
        assert_eq!(comparison.verdict, "different");
        let settings = Settings { tolerance: 0.006, ..Settings::default() };
        assert_eq!(compare(&other, &reference, &settings).verdict, "same");
    }

    #[test]
    fn rows_at_jumps_are_skipped_and_counted() {
        let reference = trace(&[(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (1.0, 1.0)]);
        let other = trace(&[(0.0, 0.0), (0.5, 0.0), (0.5005, 1.0), (1.0, 1.0)]);
        let settings = Settings { tolerance: 1e-12, ..Settings::default() };
        let comparison = compare(&other, &reference, &settings);
        assert!(comparison.same() && comparison.signals[0].skipped == 2, "{comparison:?}");
        // A grid shows no jump by itself; the rise of the circuit tells where the other one jumps.
        let reference = grid(|t| if t >= 0.5 { 1.0 } else { 0.0 });
        let other = trace(&[(0.0, 0.0), (0.5, 0.0), (0.50005, 0.6), (0.5001, 1.0), (1.0, 1.0)]);
        assert_eq!(compare(&other, &reference, &settings).signals[0].max, 1.0);
        let settings = Settings { rise: Some(1e-4), ..settings };
        let comparison = compare(&other, &reference, &settings);
        assert!(comparison.same() && comparison.signals[0].skipped == 1, "{comparison:?}");
        // An error beside the jump is seen all the same.
        let mut wrong = other.clone();
        wrong.columns[1][4] = 1.1;
        assert!(!compare(&wrong, &reference, &settings).same());
    }

    #[test]
    fn what_is_missing_or_no_number_is_different() {
        let reference = grid(f64::sin);
        let settings = Settings { tolerance: 1e9, ..Settings::default() };
        let mut other = reference.clone();
        other.names[1] = "y".into();
        let comparison = compare(&other, &reference, &settings);
        assert_eq!((comparison.verdict, &comparison.missing[..]), ("different", &["x".into()][..]));
        let pairs = Some(vec![("x".into(), "y".into())]);
        assert!(
            compare(&other, &reference, &Settings { signals: pairs, ..settings.clone() }).same()
        );
        other = reference.clone();
        other.columns[1][3] = f64::NAN;
        assert_eq!(compare(&other, &reference, &settings).signals[0].max, f64::INFINITY);
        let short = trace(&[(0.0, 0.0), (0.3, 0.3_f64.sin())]);
        let comparison = compare(&short, &reference, &settings);
        assert!(!comparison.same() && comparison.signals[0].uncovered == 7, "{comparison:?}");
    }

    #[test]
    fn constants_are_held_against_their_magnitude() {
        let reference = grid(|_| 100.0);
        let x = compare(&grid(|_| 101.0), &reference, &Settings::default()).signals.remove(0);
        assert_eq!((x.max, x.range), (0.01, 0.0));
        let x = compare(&grid(|_| 1e-9), &grid(|_| 0.0), &Settings::default()).signals.remove(0);
        assert_eq!(x.max, 1e-9);
    }
}
