//! Integrals and extremes over a window of a run.

use super::event::{Event, Search, Segment};
use super::{Found, Source, Value};

/// What is made of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Statistic {
    Average,
    Rms,
    Minimum,
    Maximum,
    PeakToPeak,
    Integral,
    MinimumAt,
    MaximumAt,
}

/// Where.
#[derive(Clone, Debug, PartialEq)]
pub enum Window<C = usize, V = Value> {
    /// `FROM=… TO=…`, or all of the run.
    Between(V, V),
    /// From one event to another (`TRIG … TARG …`).
    Events(Event<C, V>, Event<C, V>),
}

impl<C, V> Window<C, V> {
    pub(super) fn values(&self) -> Vec<&V> {
        match self {
            Window::Between(from, to) => vec![from, to],
            Window::Events(from, to) => from.values().into_iter().chain(to.values()).collect(),
        }
    }

    pub(super) fn try_map<D, W>(
        &self,
        column: &mut dyn FnMut(&C) -> Option<D>,
        value: &mut dyn FnMut(&V) -> Option<W>,
    ) -> Option<Window<D, W>> {
        Some(match self {
            Window::Between(from, to) => Window::Between(value(from)?, value(to)?),
            Window::Events(a, b) => {
                Window::Events(a.try_map(column, value)?, b.try_map(column, value)?)
            }
        })
    }
}

/// The limits of a window while rows come.
enum Limits {
    Fixed(f64, f64),
    Events(Search, Search),
}

/// An integral or extreme so far.
pub(super) struct Running {
    what: Statistic,
    column: usize,
    limits: Limits,
    /// Where the window began and ends so far.
    span: Option<(f64, f64)>,
    integral: f64,
    square: f64,
    low: (f64, f64),
    high: (f64, f64),
}

impl Running {
    pub fn new(
        what: Statistic,
        column: usize,
        window: &Window,
        source: &dyn Fn(&Source) -> f64,
    ) -> Running {
        let value = |value: &Value| value.evaluate(&mut |s| source(s));
        let limits = match window {
            Window::Between(from, to) => {
                let (from, to) = (value(from), value(to));
                Limits::Fixed(from.min(to), from.max(to))
            }
            Window::Events(from, to) => {
                Limits::Events(Search::new(from, source), Search::new(to, source))
            }
        };
        Running {
            what,
            column,
            limits,
            span: None,
            integral: 0.0,
            square: 0.0,
            low: (f64::INFINITY, 0.0),
            high: (f64::NEG_INFINITY, 0.0),
        }
    }

    pub fn take(&mut self, segment: &Segment) {
        let (left, right) = (segment.x0.min(segment.x1), segment.x0.max(segment.x1));
        let (from, to) = match &mut self.limits {
            Limits::Fixed(from, to) => (*from, *to),
            Limits::Events(from, to) => {
                from.take(segment);
                to.take(segment);
                match (from.hit, to.hit) {
                    (None, _) => return,
                    (Some(from), to) => (from, to.unwrap_or(f64::INFINITY)),
                }
            }
        };
        let (from, to) = (left.max(from), right.min(to));
        if from > to {
            return;
        }
        // In the direction of the run.
        let (a, b) = if segment.x1 < segment.x0 { (to, from) } else { (from, to) };
        let jump = segment.x0 == segment.x1;
        let y0 = if jump { segment.y0[self.column] } else { segment.value(self.column, a) };
        let y1 = segment.value(self.column, b);
        let width = b - a;
        self.integral += 0.5 * width * (y0 + y1);
        self.square += width * (y0 * y0 + y0 * y1 + y1 * y1) / 3.0;
        for (y, x) in [(y0, a), (y1, b)] {
            if y < self.low.0 {
                self.low = (y, x);
            }
            if y > self.high.0 {
                self.high = (y, x);
            }
        }
        self.span = Some((self.span.map_or(a, |(first, _)| first), b));
    }

    pub fn finish(self) -> Found {
        if let Limits::Events(from, to) = &self.limits {
            from.finish(f64::NAN).map_err(|why| format!("TRIG: {why}"))?;
            to.finish(f64::NAN).map_err(|why| format!("TARG: {why}"))?;
        }
        let (from, to) = self.span.ok_or("its window holds no row of the run")?;
        let places = vec![("from", from), ("to", to)];
        let width = to - from;
        Ok(match self.what {
            Statistic::Average => (self.integral / width, places),
            Statistic::Rms => ((self.square / width).max(0.0).sqrt(), places),
            Statistic::Integral => (self.integral, places),
            Statistic::PeakToPeak => (self.high.0 - self.low.0, places),
            Statistic::Minimum => (self.low.0, vec![("at", self.low.1)]),
            Statistic::Maximum => (self.high.0, vec![("at", self.high.1)]),
            Statistic::MinimumAt => (self.low.1, vec![("min", self.low.0)]),
            Statistic::MaximumAt => (self.high.1, vec![("max", self.high.0)]),
        })
    }
}
