//! Events of measures: a stated abscissa, or the n-th time that a column passes a level.

use super::{Source, Value};

/// Where a measure looks.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<C = usize, V = Value> {
    /// `AT=…`.
    At(V),
    /// `v(a)=… RISE=n TD=… FROM=… TO=…`.
    Crossing {
        /// The watched column.
        column: C,
        /// The level that it passes.
        level: V,
        /// In which direction.
        edge: Edge,
        /// Which of them.
        which: Which,
        /// Rows before this abscissa do not count (`TD`, `FROM`).
        from: V,
        /// Rows after it neither.
        to: V,
    },
}

/// A direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Edge {
    Rise,
    Fall,
    Cross,
}

/// Which of several crossings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The n-th, from 1 on.
    Number(u64),
    /// The last of the run.
    Last,
}

impl<C, V> Event<C, V> {
    pub(super) fn values(&self) -> Vec<&V> {
        match self {
            Event::At(value) => vec![value],
            Event::Crossing { level, from, to, .. } => vec![level, from, to],
        }
    }

    pub(super) fn try_map<D, W>(
        &self,
        column: &mut dyn FnMut(&C) -> Option<D>,
        value: &mut dyn FnMut(&V) -> Option<W>,
    ) -> Option<Event<D, W>> {
        Some(match self {
            Event::At(at) => Event::At(value(at)?),
            Event::Crossing { column: c, level, edge, which, from, to } => Event::Crossing {
                column: column(c)?,
                level: value(level)?,
                edge: *edge,
                which: *which,
                from: value(from)?,
                to: value(to)?,
            },
        })
    }
}

/// Two rows that follow each other.
pub(super) struct Segment<'a> {
    pub x0: f64,
    pub x1: f64,
    pub y0: &'a [f64],
    pub y1: &'a [f64],
    /// The row before both.
    pub before: Option<(f64, &'a [f64])>,
}

impl Segment<'_> {
    /// The value of a column on the line; at a jump, the one after it.
    pub fn value(&self, column: usize, x: f64) -> f64 {
        let (a, b) = (self.y0[column], self.y1[column]);
        if self.x1 == self.x0 { b } else { a + (x - self.x0) / (self.x1 - self.x0) * (b - a) }
    }

    /// The slope of a column, of the parabola through the row before and these two where there is one; whether there is.
    pub fn slope(&self, column: usize, x: f64) -> (f64, bool) {
        let line = (self.y1[column] - self.y0[column]) / (self.x1 - self.x0);
        match self.curvature(column) {
            Some(second) => (line + second * (2.0 * x - self.x0 - self.x1), true),
            None => (line, false),
        }
    }

    /// The slope at a place between the row before and the first of these two.
    pub fn slope_before(&self, column: usize, x: f64) -> Option<f64> {
        let (before, _) = self.before?;
        let line = (self.y1[column] - self.y0[column]) / (self.x1 - self.x0);
        let second = self.curvature(column).filter(|_| x >= before)?;
        Some(line + second * (2.0 * x - self.x0 - self.x1))
    }

    /// The second divided difference.
    fn curvature(&self, column: usize) -> Option<f64> {
        let (before, values) = self.before?;
        let line = (self.y1[column] - self.y0[column]) / (self.x1 - self.x0);
        let last = (self.y0[column] - values[column]) / (self.x0 - before);
        let second = (line - last) / (self.x1 - before);
        second.is_finite().then_some(second)
    }
}

/// An event that is looked for.
pub(super) struct Search {
    at: Option<f64>,
    column: usize,
    level: f64,
    edge: Edge,
    which: Which,
    from: f64,
    to: f64,
    /// Whether the column was at or above the level.
    above: Option<bool>,
    count: u64,
    /// Where it was found.
    pub hit: Option<f64>,
}

impl Search {
    pub fn new(event: &Event, source: &dyn Fn(&Source) -> f64) -> Search {
        let value = |value: &Value| value.evaluate(&mut |s| source(s));
        let mut search = Search {
            at: None,
            column: 0,
            level: 0.0,
            edge: Edge::Cross,
            which: Which::Number(1),
            from: f64::NEG_INFINITY,
            to: f64::INFINITY,
            above: None,
            count: 0,
            hit: None,
        };
        match event {
            Event::At(at) => search.at = Some(value(at)),
            Event::Crossing { column, level, edge, which, from, to } => {
                (search.column, search.edge, search.which) = (*column, *edge, *which);
                (search.level, search.from, search.to) = (value(level), value(from), value(to));
            }
        }
        search
    }

    /// Looks at a segment; says where the event is, if it is there.
    pub fn take(&mut self, segment: &Segment) -> Option<f64> {
        let (x0, x1) = (segment.x0, segment.x1);
        if let Some(at) = self.at {
            let inside = (x0 <= at && at < x1) || (x1 < at && at <= x0);
            return if inside && self.hit.is_none() { self.found(at) } else { None };
        }
        let done = matches!(self.which, Which::Number(n) if self.count >= n);
        if done || x1 < self.from || x0 > self.to {
            return None;
        }
        let above = segment.y1[self.column] >= self.level;
        // The first row that counts, or the value where the window opens.
        let was = match self.above {
            Some(was) => was,
            None if x0 < self.from && x1 > self.from => {
                segment.value(self.column, self.from) >= self.level
            }
            None => above,
        };
        self.above = Some(above);
        let counts = match self.edge {
            Edge::Rise => above && !was,
            Edge::Fall => !above && was,
            Edge::Cross => above != was,
        };
        if !counts {
            return None;
        }
        let (a, b) = (segment.y0[self.column], segment.y1[self.column]);
        let part = (self.level - a) / (b - a);
        let x = if x1 == x0 || b == a { x1 } else { x0 + part.clamp(0.0, 1.0) * (x1 - x0) };
        if x < self.from || x > self.to {
            return None;
        }
        self.count += 1;
        match self.which {
            Which::Number(n) if n != self.count => None,
            _ => self.found(x),
        }
    }

    fn found(&mut self, x: f64) -> Option<f64> {
        self.hit = Some(x);
        self.hit
    }

    /// Where the event was found; `last` is the end of the run.
    pub fn finish(&self, last: f64) -> Result<f64, String> {
        match (self.hit, self.at) {
            (Some(x), _) => Ok(x),
            (None, Some(at)) if (at - last).abs() <= 1e-12 * last.abs() => Ok(at),
            (None, Some(at)) => Err(format!("{at:e} lies outside the run")),
            (None, None) if self.count > 0 => {
                Err(format!("{:e} is passed {} times only", self.level, self.count))
            }
            (None, None) => Err(format!("{:e} is never passed that way", self.level)),
        }
    }
}
