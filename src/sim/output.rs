//! Rows of the trace: when they are due, and their values from the charges of a step.
//!
//! No step is ever cut for a row.

use super::inside::Inside;
use super::methods::{Dense, Work};
use super::network::Network;
use super::newton::Cut;
use super::op::State;
use super::settings::{Interval, Settings};
use crate::linear::LANES;
use crate::trace::Sink;
use std::io;

/// How often a step is halved for straight lines at most; one that goes all the way to a corner far more often.
const MOST_HALVED: u32 = 8;
const FAR_HALVED: u32 = 40;

/// No line is asked to be straighter than this part of a column's range, however small `reltol` is: rows would be many
/// for what nobody sees.
const STRAIGHTEST: f64 = 1e-7;

/// Columns that are measured are straight between rows within this part of what others are.
const MEASURED: f64 = 0.1;

/// A line with one bend is at a quarter, at half or at three quarters at least this part as far from a straight one as
/// at its bend.
const STRAIGHT: f64 = 0.75;

/// Of a parabola's piece each half is off by a fourth of what that is: by about as much.
const REGULAR: std::ops::Range<f64> = 3.0..5.5;

/// A step within which a column moves by less than this part of what it may be off a line is not asked.
const QUIET: f64 = 0.25;

/// What rounding may make of a column, as a part of its magnitude.
const ROUNDING: f64 = 1e-12;

/// Why rows ended.
#[derive(Debug)]
pub(crate) enum Stopped {
    /// The sink takes no more.
    Write(io::Error),
    /// There are no values at this time.
    Values(f64, Cut),
}

impl From<io::Error> for Stopped {
    fn from(error: io::Error) -> Stopped {
        Stopped::Write(error)
    }
}

/// A piece of a step: its right end, how often it has been halved, and how far its double was from a line.
type Piece = (Vec<f64>, u32, f64);

/// Where rows go, and which are still to come.
pub(crate) struct Rows<'a> {
    sink: &'a mut dyn Sink,
    interval: Interval,
    between: bool,
    start: f64,
    stop: f64,
    /// Times closer than this are the same.
    slack: f64,
    /// Lines are no longer than a step may be.
    longest: f64,
    reltol: f64,
    /// So many columns, the last ones, are measured.
    watched: usize,
    /// Whether no column bends with a junction, but at most its rate.
    only_rates_bend: bool,
    /// Differences that mean nothing in any column.
    least: f64,
    /// The next row of a grid or list.
    next: usize,
    /// Time and values of the row being made.
    row: Vec<f64>,
    /// The row at the left end of a step, and extremes of each column so far.
    left: Vec<f64>,
    middle: Vec<f64>,
    /// Pieces of a step that are still to come, and rows that wait for use.
    pile: Vec<Piece>,
    spare: Vec<Vec<f64>>,
    low: Vec<f64>,
    high: Vec<f64>,
    inside: Inside,
}

impl<'a> Rows<'a> {
    pub fn new(network: &Network, settings: &Settings, sink: &'a mut dyn Sink) -> Rows<'a> {
        let system = network.system;
        let columns = system.outputs.len();
        Rows {
            sink,
            interval: settings.rows.clone(),
            between: settings.between,
            start: settings.start,
            stop: settings.stop,
            slack: 1e-12 * settings.stop,
            longest: settings.hmax.unwrap_or(f64::INFINITY),
            reltol: settings.reltol,
            watched: system.watched,
            only_rates_bend: false,
            least: 1e-2 * settings.abstol,
            next: 0,
            row: vec![0.0; columns + 1],
            left: vec![0.0; columns + 1],
            middle: vec![0.0; columns + 1],
            pile: Vec::with_capacity(MOST_HALVED as usize + 2),
            spare: (0..MOST_HALVED + 2).map(|_| vec![0.0; columns + 1]).collect(),
            low: vec![f64::INFINITY; columns],
            high: vec![f64::NEG_INFINITY; columns],
            inside: Inside::of_outputs(network),
        }
    }

    /// Looks, once at the start of a run, at how columns follow from what storages hold.
    pub fn look_at(&mut self, network: &mut Network) {
        let system = network.system;
        let straight = system.law_columns.is_empty() && !system.output_rates;
        self.only_rates_bend = self.follows_within()
            && straight
            && system.has_junctions()
            && system.has_junctions_alone()
            && network.bends_only_rates_of(&system.observed());
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

    /// The times of the next rows before a time, and how many they are.
    fn next_times(&mut self, end: f64) -> ([f64; LANES], usize) {
        let next = self.next;
        let (mut times, mut count) = ([0.0; LANES], 0);
        while count < LANES {
            times[count] = self.next_time();
            if times[count] >= end {
                break;
            }
            count += 1;
            self.next += 1;
        }
        self.next = next;
        (times, count)
    }

    /// Whether a row of a grid or list is due before a time.
    pub fn are_due(&mut self, time: f64) -> bool {
        self.next_time() < time
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
    ) -> Result<(), Stopped> {
        loop {
            let due = self.next_time();
            if due > time + self.slack {
                return Ok(());
            }
            self.next += 1;
            self.inside.point.copy_from(state);
            // At the state's own time: past a corner the segment that ends there means nothing.
            self.inside.finish_point(network, time, index2, weights, work)?;
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
    ) -> Result<(), Stopped> {
        self.inside.begin();
        self.inside.look_within(from, to, work);
        loop {
            let due = self.next_time();
            if due >= to.t - self.slack {
                return Ok(());
            }
            if self.inside.may_foresee(due) {
                let (times, count) = self.next_times(to.t - self.slack);
                let times = &times[..count];
                self.inside.foresee(network, from, to, times, index2, weights, work);
            }
            self.next += 1;
            self.inside.between(network, from, to, due, index2, weights, work)?;
            self.write(network, due)?;
        }
    }

    /// Whether rows are made between the ends of steps, to be written or measured.
    pub fn follows_within(&self) -> bool {
        self.follows_steps() && self.between
    }

    /// Whether rows are made at every step, to be written or measured.
    pub fn follows_steps(&self) -> bool {
        self.interval == Interval::Steps || self.watched > 0
    }

    /// Whether rows are written at times of their own.
    pub fn has_times(&self) -> bool {
        self.interval != Interval::Steps
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
    ) -> Result<(), Stopped> {
        if !self.between && time < self.stop - self.slack {
            return Ok(());
        }
        self.at_end(network, state, time, index2, weights, work)?;
        if time >= self.start - self.slack {
            self.send_step(network)?;
        }
        self.widen();
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
    ) -> Result<(), Stopped> {
        self.inside.begin();
        if to.t < self.start {
            return Ok(());
        }
        self.at_end(network, to, to.t, index2, weights, work)?;
        self.widen();
        self.inside.look_within(from, to, work);
        if self.is_quiet(network, from, to, &work.dense) {
            self.left.copy_from_slice(&self.row);
            return Ok(());
        }
        // Whether columns are straight is read off parabolas, through a stage or through the past, where steps are short
        // enough for them; only what is written is solved for. Within the long steps of methods of higher order what
        // follows a source moves in ways that their polynomials do not say, unless that is straight and all is linear; nor
        // do parabolas say that a diode begins to conduct.
        // A stage is nearer than the past, but for currents that bend with a junction.
        let followed = (work.dense.by_past || (work.dense.by_unknowns && self.only_rates_bend))
            && !network.system.output_rates
            && (!network.system.has_junctions() || network.rests_within(&work.dense, from, to));
        let smooth = !index2 && (followed || network.is_straight());
        let parabolic = followed && network.system.law_columns.is_empty();
        let far = work.dense.space.is_some();
        let most_halved = if far { FAR_HALVED } else { MOST_HALVED };
        // Pieces are halved from the left; what is still to come lies on a pile.
        let mut left = std::mem::take(&mut self.left);
        left[0] = from.t;
        while let Some((last, ..)) = self.pile.pop() {
            self.spare.push(last);
        }
        let right = self.copy_of_row();
        self.pile.push((right, 0, f64::INFINITY));
        while let Some((right, halved, before)) = self.pile.pop() {
            let span = right[0] - left[0];
            let mut off = 0.0;
            let long = far && span > self.longest * (1.0 + 1e-6);
            if halved < most_halved && span > self.slack {
                // A curve that swings about its line may cross it in the middle, and a bend may lie near an end; but a
                // parabola is farthest from a line in the middle.
                let once = parabolic || long;
                let asked: &[f64] = if once { &[0.5] } else { &[0.5, 0.25, 0.75] };
                for &theta in asked {
                    let time = left[0] + theta * span;
                    if smooth {
                        self.interpolate(network, from, to, time, work);
                    } else {
                        self.inside.between(network, from, to, time, index2, weights, work)?;
                        self.evaluate(network, time);
                    }
                    self.widen();
                    off = self.off_line(theta, &left, &right).max(off);
                    if theta == 0.5 {
                        self.middle.copy_from_slice(&self.row);
                    }
                    // What halves as a parabola does is one.
                    if off > STRAIGHT || REGULAR.contains(&(before / off)) {
                        break;
                    }
                }
                self.row.copy_from_slice(&self.middle);
            }
            // What does not become straighter is rounding, but within a step that goes far, where all may happen at its
            // beginning.
            let rounded = !far && halved > 4 && off >= before;
            let straight = !long && (off <= STRAIGHT || rounded);
            if !straight {
                if smooth {
                    let time = left[0] + 0.5 * span;
                    self.inside.between(network, from, to, time, index2, weights, work)?;
                    self.evaluate(network, time);
                }
                let middle = self.copy_of_row();
                self.pile.push((right, halved + 1, off));
                self.pile.push((middle, halved + 1, off));
                continue;
            }
            left.copy_from_slice(&right);
            self.spare.push(right);
            if !self.pile.is_empty() && left[0] >= self.start - self.slack {
                self.row.copy_from_slice(&left);
                self.send_step(network)?;
            }
        }
        self.left = left;
        Ok(())
    }

    /// Whether columns move within a step by less than they may be off the line between its ends: after a jump steps are
    /// short.
    fn is_quiet(&self, network: &Network, from: &State, to: &State, dense: &Dense) -> bool {
        let followed = dense.by_unknowns || dense.by_past;
        let moved = |unknown: usize| {
            let bends = dense.x.iter().map(|k| k[unknown].abs());
            bends.fold((to.x[unknown] - from.x[unknown]).abs(), |sum, bend| sum + bend)
        };
        let mut columns = network.system.plain_outputs.iter();
        followed
            && network.system.law_columns.is_empty()
            && columns
                .all(|(c, unknown)| moved(*unknown as usize) <= QUIET * self.allowed(*c as usize))
    }

    /// How far a column may be off the line between two rows.
    fn allowed(&self, column: usize) -> f64 {
        let measured = self.low.len() - self.watched;
        let part =
            if column < measured { self.reltol.max(STRAIGHTEST) } else { MEASURED * self.reltol };
        let (low, high) = (self.low[column], self.high[column]);
        let rounding = (ROUNDING * low.abs().max(high.abs())).max(self.least);
        (part * (high - low)).max(rounding)
    }

    /// The present row, in a vector that waits for use.
    fn copy_of_row(&mut self) -> Vec<f64> {
        match self.spare.pop() {
            Some(mut row) => {
                row.copy_from_slice(&self.row);
                row
            }
            None => self.row.clone(),
        }
    }

    /// Makes the row at a time within a step from the step's own polynomials, with nothing solved.
    fn interpolate(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &State,
        time: f64,
        work: &mut Work,
    ) {
        let theta = (time - from.t) / (to.t - from.t);
        work.dense.look_at(theta);
        if network.system.law_columns.is_empty() {
            self.row[0] = time;
            for (column, unknown) in &network.system.plain_outputs {
                let value = work.dense.unknown(*unknown as usize, theta, from, to);
                self.row[*column as usize + 1] = value;
            }
            return;
        }
        work.dense.unknowns(theta, from, to, &mut self.inside.point.x);
        self.inside.point.t = time;
        self.evaluate(network, time);
    }

    /// Makes the row of a step's end, headed by a time.
    fn at_end(
        &mut self,
        network: &mut Network,
        state: &State,
        time: f64,
        index2: bool,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<(), Stopped> {
        self.inside.begin();
        if index2 || !network.system.output_rates {
            self.row[0] = time;
            network.outputs(&state.x, &state.w, state.t, &mut self.row[1..]);
            return Ok(());
        }
        self.inside.point.copy_from(state);
        self.inside.finish_point(network, state.t, false, weights, work)?;
        self.evaluate(network, time);
        Ok(())
    }

    /// Takes the present row into the extremes.
    fn widen(&mut self) {
        for (c, value) in self.row[1..].iter().enumerate() {
            self.low[c] = self.low[c].min(*value);
            self.high[c] = self.high[c].max(*value);
        }
    }

    /// How far the present row is from the line between two others, in units of what is allowed.
    fn off_line(&self, theta: f64, left: &[f64], right: &[f64]) -> f64 {
        let mut most: f64 = 0.0;
        let measured = self.low.len() - self.watched;
        // Columns that are written at times of their own need not be straight between steps.
        let first = if self.has_times() { measured } else { 0 };
        for c in first..self.low.len() {
            let (a, b) = (left[c + 1], right[c + 1]);
            let off = (self.row[c + 1] - (a + theta * (b - a))).abs();
            most = most.max(off / self.allowed(c));
        }
        most
    }

    fn evaluate(&mut self, network: &mut Network, time: f64) {
        self.row[0] = time;
        network.outputs(
            &self.inside.point.x,
            &self.inside.point.w,
            self.inside.point.t,
            &mut self.row[1..],
        );
    }

    fn write(&mut self, network: &mut Network, time: f64) -> Result<(), Stopped> {
        self.evaluate(network, time);
        self.send(network)
    }

    fn send(&mut self, network: &mut Network) -> Result<(), Stopped> {
        network.statistics.rows += 1;
        self.check_row(network)?;
        Ok(self.sink.row(&self.row)?)
    }

    /// Sends the row of a step: it is written, or only measured.
    fn send_step(&mut self, network: &mut Network) -> Result<(), Stopped> {
        if !self.has_times() {
            return self.send(network);
        }
        self.check_row(network)?;
        Ok(self.sink.step(&self.row)?)
    }

    fn check_row(&mut self, network: &mut Network) -> Result<(), Stopped> {
        for value in &mut self.row {
            // −0 becomes 0.
            *value += 0.0;
        }
        if self.row.iter().any(|value| !value.is_finite()) {
            let device = network.non_finite_law();
            return Err(Stopped::Values(self.row[0], Cut::NonFinite { device }));
        }
        Ok(())
    }
}
