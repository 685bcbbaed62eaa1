//! `.measure`: numbers taken from the rows of a run while they stream by.
//!
//! Between two rows everything runs in a straight line. A crossing is found on that line, integrals and extremes
//! include the ends of their window, and a slope is that of the parabola through three rows. The rows are those at
//! accepted steps and so many between them that lines stay within a tenth of reltol of each column's range; so
//! values are exact to that, and the time of a crossing to that over the slope. Of the two rows at a jump, what is found
//! at its very time is the value after it.
//!
//! A measure that depends on others by its limits (`at='t1+1u'`) is taken when the run is over, from rows that were kept.

pub mod event;
pub mod over;

use crate::expr::Expr;
use crate::source::Span;
pub use event::{Edge, Event, Which};
use event::{Search, Segment};
use over::Running;
pub use over::{Statistic, Window};

/// What the value of a limit may speak of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The result of a measure before this one.
    Measure(usize),
    /// A watched column: its value in the last row.
    Column(usize),
}

/// A number, or one that follows from other measures.
pub type Value = Expr<Source>;

/// A measure.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Its name.
    pub name: String,
    /// Its card.
    pub span: Span,
    /// The analysis whose rows it is taken from, `tran`, `ac` or `dc`; empty for any.
    pub analysis: String,
    /// What it is.
    pub kind: Kind,
}

/// Analyses whose rows are measured.
pub const ANALYSES: &[&str] = &["tran", "ac", "dc"];

impl Measure {
    /// Whether it is taken from the rows of an analysis.
    pub fn is_of(&self, analysis: &str) -> bool {
        let any = self.analysis.is_empty() && ANALYSES.contains(&analysis);
        any || self.analysis == analysis
    }
}

/// The forms of measures, over columns (here, indices of the watched ones) and values.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind<C = usize, V = Value> {
    /// `TRIG … TARG …`: the abscissa of the second event less that of the first.
    Delay(Event<C, V>, Event<C, V>),
    /// `WHEN …`: the abscissa of an event.
    When(Event<C, V>),
    /// `FIND column WHEN …`: the value at an event.
    Find(C, Event<C, V>),
    /// `DERIV column WHEN …`: the slope at an event.
    Slope(C, Event<C, V>),
    /// `AVG column FROM=… TO=…` and its like.
    Over(Statistic, C, Window<C, V>),
    /// `PARAM='…'`.
    Formula(V),
}

impl<C, V> Kind<C, V> {
    /// Whether it asks for nothing but the last row.
    pub fn is_of_end(&self) -> bool {
        matches!(self, Kind::Formula(_))
    }

    /// The same over other columns and values; none where one of them has none.
    pub fn try_map<D, W>(
        &self,
        column: &mut dyn FnMut(&C) -> Option<D>,
        value: &mut dyn FnMut(&V) -> Option<W>,
    ) -> Option<Kind<D, W>> {
        Some(match self {
            Kind::Delay(a, b) => Kind::Delay(a.try_map(column, value)?, b.try_map(column, value)?),
            Kind::When(event) => Kind::When(event.try_map(column, value)?),
            Kind::Find(c, event) => Kind::Find(column(c)?, event.try_map(column, value)?),
            Kind::Slope(c, event) => Kind::Slope(column(c)?, event.try_map(column, value)?),
            Kind::Over(what, c, window) => {
                Kind::Over(*what, column(c)?, window.try_map(column, value)?)
            }
            Kind::Formula(formula) => Kind::Formula(value(formula)?),
        })
    }
}

/// What became of a measure.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Its name.
    pub name: String,
    /// Its value; none where it failed.
    pub value: Option<f64>,
    /// Where it was found: `at`, `from`, `to`, `trig`, `targ`.
    pub places: Vec<(&'static str, f64)>,
    /// Why it failed.
    pub why: Option<String>,
}

/// What has been found.
pub(crate) type Found = Result<(f64, Vec<(&'static str, f64)>), String>;

impl Kind {
    /// Every value that the measure depends on.
    fn values(&self) -> Vec<&Value> {
        match self {
            Kind::Delay(a, b) => a.values().into_iter().chain(b.values()).collect(),
            Kind::When(event) | Kind::Find(_, event) | Kind::Slope(_, event) => event.values(),
            Kind::Over(_, _, window) => window.values(),
            Kind::Formula(_) => vec![],
        }
    }

    /// Whether it can be taken only when others are known.
    fn waits(&self) -> bool {
        self.values().iter().any(|value| value.constant().is_none())
    }
}

/// Takes measures from rows.
pub struct Measures {
    list: Vec<Measure>,
    analysis: String,
    taking: Vec<Option<Taking>>,
    /// Rows for those that wait, one after the other, the abscissa first.
    kept: Option<Vec<f64>>,
    last: Row,
    before: Row,
    rows: usize,
}

/// A row.
#[derive(Clone, Default)]
struct Row {
    x: f64,
    values: Vec<f64>,
}

/// A measure that is being taken.
enum Taking {
    Delay(Search, Search),
    When(Search),
    Find(usize, Search, Option<f64>),
    Slope(usize, Search, Option<(f64, bool)>),
    Over(Running),
    /// It is made of others.
    Formula,
}

impl Measures {
    /// Ready for the rows of a run of an analysis; measures of others are left out.
    pub fn new(list: &[Measure], analysis: &str) -> Measures {
        let nothing = |_: &Source| f64::NAN;
        let begin = |measure: &Measure| {
            let now = measure.is_of(analysis) && !measure.kind.waits();
            now.then(|| Taking::new(&measure.kind, &nothing))
        };
        let waits = |measure: &Measure| measure.is_of(analysis) && measure.kind.waits();
        let kept = list.iter().any(waits).then(Vec::new);
        Measures {
            taking: list.iter().map(begin).collect(),
            list: list.to_vec(),
            analysis: analysis.to_string(),
            kept,
            last: Row::default(),
            before: Row::default(),
            rows: 0,
        }
    }

    /// Takes the watched columns of a row.
    pub fn row(&mut self, x: f64, values: &[f64]) {
        if let Some(kept) = &mut self.kept {
            kept.push(x);
            kept.extend_from_slice(values);
        }
        if self.rows == 0 {
            self.last.values = values.to_vec();
            self.before.values = values.to_vec();
            (self.last.x, self.before.x) = (x, x);
        }
        let segment = Segment {
            x0: self.last.x,
            x1: x,
            y0: &self.last.values,
            y1: values,
            before: (self.rows > 1).then_some((self.before.x, &self.before.values[..])),
        };
        for taking in self.taking.iter_mut().flatten() {
            taking.take(&segment);
        }
        std::mem::swap(&mut self.last, &mut self.before);
        self.last.x = x;
        self.last.values.clear();
        self.last.values.extend_from_slice(values);
        self.rows += 1;
    }

    /// The results, in the order of the cards.
    pub fn finish(self) -> Vec<Outcome> {
        let Measures { list, analysis, taking, kept, last, rows, .. } = self;
        let mut results: Vec<Option<f64>> = vec![];
        let mut outcomes = vec![];
        for (measure, taking) in list.iter().zip(taking) {
            if !measure.is_of(&analysis) {
                results.push(None);
                continue;
            }
            let source = |source: &Source| match source {
                Source::Measure(at) => results.get(*at).copied().flatten().unwrap_or(f64::NAN),
                Source::Column(at) => last.values.get(*at).copied().unwrap_or(f64::NAN),
            };
            let found = match (taking, &measure.kind) {
                _ if rows == 0 => Err("the run has no rows".to_string()),
                (_, Kind::Formula(value)) => Ok((value.evaluate(&mut |s| source(s)), vec![])),
                (Some(taking), _) => taking.finish(&last),
                (None, kind) => {
                    let unknown = kind
                        .values()
                        .iter()
                        .any(|value| !value.evaluate(&mut |s| source(s)).is_finite());
                    match unknown {
                        true => Err("a measure that it depends on has failed".to_string()),
                        false => again(measure, &source, kept.as_deref().unwrap_or(&[]), &last),
                    }
                }
            };
            let found = found.and_then(|(value, places)| match value.is_finite() {
                true => Ok((value, places)),
                false => Err("its value is no number".to_string()),
            });
            let (value, places, why) = match found {
                Ok((value, places)) => (Some(value), places, None),
                Err(why) => (None, vec![], Some(why)),
            };
            results.push(value);
            outcomes.push(Outcome { name: measure.name.clone(), value, places, why });
        }
        outcomes
    }
}

/// A measure over rows that were kept.
fn again(measure: &Measure, source: &dyn Fn(&Source) -> f64, kept: &[f64], last: &Row) -> Found {
    let mut fixed = |value: &Value| Some(Value::number(value.evaluate(&mut |s| source(s))));
    let kind = measure.kind.try_map(&mut |column| Some(*column), &mut fixed);
    let alone = Measure { kind: kind.ok_or("it has no value")?, ..measure.clone() };
    let mut measures = Measures::new(std::slice::from_ref(&alone), &alone.analysis);
    for row in kept.chunks_exact(last.values.len() + 1) {
        measures.row(row[0], &row[1..]);
    }
    let last = measures.last.clone();
    match measures.taking.pop().flatten() {
        Some(taking) => taking.finish(&last),
        None => Err("its limits depend on it".to_string()),
    }
}

impl Taking {
    fn new(kind: &Kind, source: &dyn Fn(&Source) -> f64) -> Taking {
        match kind {
            Kind::Delay(a, b) => Taking::Delay(Search::new(a, source), Search::new(b, source)),
            Kind::When(event) => Taking::When(Search::new(event, source)),
            Kind::Find(column, event) => Taking::Find(*column, Search::new(event, source), None),
            Kind::Slope(column, event) => Taking::Slope(*column, Search::new(event, source), None),
            Kind::Over(what, column, window) => {
                Taking::Over(Running::new(*what, *column, window, source))
            }
            Kind::Formula(_) => Taking::Formula,
        }
    }

    fn take(&mut self, segment: &Segment) {
        match self {
            Taking::Delay(a, b) => {
                a.take(segment);
                b.take(segment);
            }
            Taking::When(search) => {
                search.take(segment);
            }
            Taking::Find(column, search, value) => {
                if let Some(x) = search.take(segment) {
                    *value = Some(segment.value(*column, x));
                }
            }
            Taking::Slope(column, search, slope) => {
                // The row after the event makes the parabola where there was none before it.
                if let Some((value, false)) = *slope {
                    let better = search.hit.and_then(|x| segment.slope_before(*column, x));
                    *slope = Some((better.unwrap_or(value), true));
                }
                if let Some(x) = search.take(segment) {
                    *slope = Some(segment.slope(*column, x));
                }
            }
            Taking::Over(running) => running.take(segment),
            Taking::Formula => {}
        }
    }

    fn finish(self, last: &Row) -> Found {
        match self {
            Taking::Delay(a, b) => {
                let trig = a.finish(last.x).map_err(|why| format!("TRIG: {why}"))?;
                let targ = b.finish(last.x).map_err(|why| format!("TARG: {why}"))?;
                Ok((targ - trig, vec![("targ", targ), ("trig", trig)]))
            }
            Taking::When(search) => search.finish(last.x).map(|x| (x, vec![])),
            Taking::Find(column, search, value) => {
                let x = search.finish(last.x)?;
                // An event at the very end stands in the last row.
                let value = value.unwrap_or_else(|| last.values[column]);
                Ok((value, vec![("at", x)]))
            }
            Taking::Slope(_, search, slope) => {
                let x = search.finish(last.x)?;
                let (slope, _) = slope.ok_or("it stands at the end of the run")?;
                Ok((slope, vec![("at", x)]))
            }
            Taking::Over(running) => running.finish(),
            Taking::Formula => Err("it is made of others".to_string()),
        }
    }
}

#[cfg(test)]
mod tests;
