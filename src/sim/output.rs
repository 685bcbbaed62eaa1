//! Rows of the trace: when they are due, and their values from the charges of a step.
//!
//! Only charges are interpolated; the unknowns follow from the frozen network, so that algebraic relations hold in each
//! row. No step is ever cut for a row.

use super::methods::Work;
use super::network::Network;
use super::newton::{Frozen, correct_frozen};
use super::op::State;
use super::settings::{Interval, Settings};
use crate::trace::Sink;
use std::io;

/// Most pieces that a step is cut into for straight lines.
const MOST_PIECES: f64 = 256.0;

/// Where rows go, and which are still to come.
pub(crate) struct Rows<'a> {
    sink: &'a mut dyn Sink,
    interval: Interval,
    start: f64,
    stop: f64,
    /// Times closer than this are the same.
    slack: f64,
    reltol: f64,
    /// The next row of a grid or list.
    next: usize,
    /// Time and values of the row being made.
    row: Vec<f64>,
    /// The row at the left end of a step, and extremes of each column so far.
    left: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    /// Values on a line, while a step is looked at.
    probe: Vec<f64>,
    point: State,
    /// Charges that are states.
    held: Vec<bool>,
    /// Whether the frozen network is factorised for this step; `None`: not yet tried.
    factorised: Option<bool>,
}

impl<'a> Rows<'a> {
    pub fn new(network: &Network, settings: &Settings, sink: &'a mut dyn Sink) -> Rows<'a> {
        let system = network.system;
        let columns = system.outputs.len();
        Rows {
            sink,
            interval: settings.rows.clone(),
            start: settings.start,
            stop: settings.stop,
            slack: 1e-12 * settings.stop,
            reltol: settings.reltol,
            next: 0,
            row: vec![0.0; columns + 1],
            left: vec![0.0; columns + 1],
            low: vec![f64::INFINITY; columns],
            high: vec![f64::NEG_INFINITY; columns],
            probe: vec![0.0; columns],
            point: State::new(0.0, system.equations(), system.charges()),
            held: system.held.clone(),
            factorised: None,
        }
    }

    /// The time of the next row of a grid or list; infinite when there are no more.
    fn next_time(&mut self) -> f64 {
        loop {
            let time = match &self.interval {
                Interval::Steps => return f64::INFINITY,
                Interval::Times(times) => match times.get(self.next) {
                    Some(time) if *time <= self.stop + self.slack => *time,
                    _ => return f64::INFINITY,
                },
                Interval::Grid(step) => {
                    let before = (self.next as f64 - 1.0) * step;
                    let time = self.next as f64 * step;
                    // The last row stands at the end, however the grid falls.
                    if self.next > 0 && before >= self.stop - 1e-9 * step {
                        return f64::INFINITY;
                    }
                    if time >= self.stop - 1e-9 * step { self.stop } else { time }
                }
            };
            if time >= self.start - self.slack {
                return time;
            }
            self.next += 1;
        }
    }

    /// Writes the rows that are due at `state` (its time, after a corner or event has been passed).
    pub fn at(
        &mut self,
        network: &mut Network,
        state: &State,
        time: f64,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> io::Result<()> {
        loop {
            let due = self.next_time();
            if due > time + self.slack {
                return Ok(());
            }
            self.next += 1;
            self.point.copy_from(state);
            self.finish_point(network, due, index2 || !network.system.output_rates, weights, work);
            self.write(network, due)?;
        }
    }

    /// Writes the rows that fall inside an accepted step, without its right end.
    pub fn inside(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> io::Result<()> {
        self.factorised = None;
        loop {
            let due = self.next_time();
            if due >= to.t - self.slack {
                return Ok(());
            }
            self.next += 1;
            self.between(network, from, to, due, index2, weights, work);
            self.write(network, due)?;
        }
    }

    /// Whether rows are written at every step.
    pub fn follows_steps(&self) -> bool {
        self.interval == Interval::Steps
    }

    /// Writes a row at a step's end, or at one side of a jump.
    pub fn here(
        &mut self,
        network: &mut Network,
        state: &State,
        time: f64,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> io::Result<()> {
        self.factorised = None;
        self.point.copy_from(state);
        self.finish_point(network, state.t, index2 || !network.system.output_rates, weights, work);
        self.point.t = state.t;
        self.evaluate(network, time);
        if time >= self.start - self.slack {
            self.send(network)?;
        }
        for (c, value) in self.row[1..].iter().enumerate() {
            self.low[c] = self.low[c].min(*value);
            self.high[c] = self.high[c].max(*value);
        }
        self.left.copy_from_slice(&self.row);
        Ok(())
    }

    /// Writes as many rows inside an accepted step as keep straight lines within reltol of each column's range.
    pub fn pieces(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> io::Result<()> {
        self.factorised = None;
        if to.t < self.start {
            return Ok(());
        }
        let columns = self.probe.len();
        network.outputs(&to.x, &to.w, to.t, &mut self.probe);
        for (c, value) in self.probe.iter().enumerate() {
            self.low[c] = self.low[c].min(*value);
            self.high[c] = self.high[c].max(*value);
        }
        let mut bend: f64 = 0.0;
        for theta in [0.25, 0.5, 0.75] {
            work.dense.unknowns(theta, from, to, &mut self.point.x);
            let t = from.t + theta * (to.t - from.t);
            for (k, w) in self.point.w.iter_mut().enumerate() {
                *w = from.w[k] + theta * (to.w[k] - from.w[k]);
            }
            network.outputs(&self.point.x, &self.point.w, t, &mut self.row[1..]);
            for c in 0..columns {
                let line = self.left[c + 1] + theta * (self.probe[c] - self.left[c + 1]);
                let range = self.high[c] - self.low[c];
                let off = (self.row[c + 1] - line).abs();
                if off > self.reltol * range && range > 0.0 {
                    bend = bend.max(off / (self.reltol * range));
                }
            }
        }
        let pieces = bend.sqrt().ceil().min(MOST_PIECES);
        let mut piece = 1.0;
        while piece < pieces {
            let time = from.t + piece / pieces * (to.t - from.t);
            if time >= self.start - self.slack && time < to.t {
                self.between(network, from, to, time, index2, weights, work);
                self.write(network, time)?;
            }
            piece += 1.0;
        }
        Ok(())
    }

    /// Puts the values at a time inside a step into `self.point`.
    #[allow(clippy::too_many_arguments)]
    fn between(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        time: f64,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) {
        let theta = (time - from.t) / (to.t - from.t);
        work.dense.unknowns(theta, from, to, &mut self.point.x);
        work.dense.charges(theta, from, to, &mut self.point.q);
        for (k, w) in self.point.w.iter_mut().enumerate() {
            *w = from.w[k] + theta * (to.w[k] - from.w[k]);
        }
        self.finish_point(network, time, index2, weights, work);
    }

    /// Corrects the unknowns of `self.point` so that they belong to its charges, unless they are to be left `as_is`.
    fn finish_point(
        &mut self,
        network: &mut Network,
        time: f64,
        as_is: bool,
        weights: &[f64],
        work: &mut Work,
    ) {
        self.point.t = time;
        if as_is {
            return;
        }
        work.x.copy_from_slice(&self.point.x);
        work.w.copy_from_slice(&self.point.w);
        let targets = std::mem::take(&mut self.point.q);
        let corrected = self.correct(network, &targets, time, weights, work);
        self.point.q = targets;
        if corrected {
            self.point.x.copy_from_slice(&work.x);
            self.point.w.copy_from_slice(&work.w);
        }
    }

    fn correct(
        &mut self,
        network: &mut Network,
        targets: &[f64],
        time: f64,
        weights: &[f64],
        work: &mut Work,
    ) -> bool {
        let Work { x, w, q, scratch, .. } = work;
        let held = &self.held;
        let frozen = Frozen { t: time, held, targets, floors: weights, most: 1, prime: false };
        if self.factorised.is_none() {
            self.factorised = Some(network.factorise_frozen(held).is_ok());
        }
        for iteration in 0..6 {
            if self.factorised != Some(true) || iteration >= 2 {
                // The slopes of the step's start no longer serve.
                network.linearise(x, time, false);
                self.factorised = Some(network.factorise_frozen(held).is_ok());
                if self.factorised == Some(false) {
                    self.factorised = None;
                    return false;
                }
            }
            let update = correct_frozen(network, &frozen, x, w, q, scratch);
            if update <= 0.02 || (iteration == 0 && network.system.is_linear()) {
                return true;
            }
            if !update.is_finite() {
                break;
            }
        }
        self.factorised = None;
        false
    }

    fn evaluate(&mut self, network: &mut Network, time: f64) {
        self.row[0] = time;
        network.outputs(&self.point.x, &self.point.w, self.point.t, &mut self.row[1..]);
    }

    fn write(&mut self, network: &mut Network, time: f64) -> io::Result<()> {
        self.evaluate(network, time);
        self.send(network)
    }

    fn send(&mut self, network: &mut Network) -> io::Result<()> {
        network.statistics.rows += 1;
        for value in &mut self.row {
            // −0 becomes 0.
            *value += 0.0;
        }
        self.sink.row(&self.row)
    }
}
