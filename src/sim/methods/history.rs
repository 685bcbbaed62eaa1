//! What steps leave behind: the points of the past, and the parabola of the unknowns that leads on from them.
//!
//! ```text
//! xₚ(t₀ + h) = x₀ + h·x[t₀, t₋₁] + h·(h + h₋₁)·x[t₀, t₋₁, t₋₂]        missed by  P·x''',  P = h·(h + h₋₁)·(h + h₋₁ + h₋₂)/6
//! ```
//!
//! A method of order 2 misses by E·x''' with a factor of its own, so that what it makes of a step differs from the
//! prediction by (P + E)·x''', and its error is E/(P + E) times that difference (W. E. Milne's device; E. Hairer,
//! S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, III.7). Iterations begin where the next
//! step would end if it led away as the last one did.

use crate::sim::op::State;

/// The left ends of the last accepted steps, the latest first.
#[derive(Debug)]
pub(crate) struct History {
    times: [f64; 2],
    x: [Vec<f64>; 2],
    count: usize,
    /// (P + E)·x'''/P of the last step, and whether there is one.
    away: Vec<f64>,
    has_away: bool,
    /// Charges and rates at the latest.
    pub q: Vec<f64>,
    pub w: Vec<f64>,
}

impl History {
    pub fn new(n: usize, charges: usize) -> History {
        History {
            times: [0.0; 2],
            x: [vec![0.0; n], vec![0.0; n]],
            count: 0,
            away: vec![0.0; n],
            has_away: false,
            q: vec![0.0; charges],
            w: vec![0.0; charges],
        }
    }

    /// Nothing of the past tells of what is to come.
    pub fn forget(&mut self) {
        self.count = 0;
        self.has_away = false;
    }

    /// Takes the left end of an accepted step, and leaves what is older in its place.
    pub fn take(&mut self, from: &mut State) {
        self.times[1] = self.times[0];
        self.times[0] = from.t;
        self.x.swap(0, 1);
        std::mem::swap(&mut self.x[0], &mut from.x);
        std::mem::swap(&mut self.q, &mut from.q);
        std::mem::swap(&mut self.w, &mut from.w);
        self.count = (self.count + 1).min(2);
    }

    /// The time before the last, if the past says anything.
    pub fn before(&self) -> Option<f64> {
        (self.count > 0).then_some(self.times[0])
    }

    /// Puts the prediction for a time into `x`. Gives P/h³ where it is that of a parabola.
    pub fn predict(&self, from: &State, time: f64, x: &mut [f64]) -> Option<f64> {
        let h = time - from.t;
        let last = from.t - self.times[0];
        match self.count {
            0 => {
                x.copy_from_slice(&from.x);
                None
            }
            1 => {
                let part = h / last;
                for ((x, now), before) in x.iter_mut().zip(&from.x).zip(&self.x[0]) {
                    *x = now + part * (now - before);
                }
                None
            }
            _ => {
                // x₀ + a·(x₀ − x₋₁) + b·(x₋₁ − x₋₂)
                let first = self.times[0] - self.times[1];
                let bend = h * (h + last) / (last + first);
                let (a, b) = (h / last + bend / last, -bend / first);
                let past = self.x[0].iter().zip(&self.x[1]);
                for ((x, now), (before, earlier)) in x.iter_mut().zip(&from.x).zip(past) {
                    *x = now + a * (now - before) + b * (before - earlier);
                }
                Some((h + last) * (h + last + first) / (6.0 * h * h))
            }
        }
    }

    /// Moves a parabola's prediction, which misses by P = `missed`·h³, to where steps have led of late.
    pub fn lead(&self, missed: f64, h: f64, x: &mut [f64]) {
        if self.has_away {
            let part = missed * h * h * h;
            x.iter_mut().zip(&self.away).for_each(|(x, away)| *x += part * away);
        }
    }

    /// Learns where a step led from what was predicted.
    pub fn learn(&mut self, missed: f64, h: f64, predicted: &[f64], reached: &[f64]) {
        let part = 1.0 / (missed * h * h * h);
        self.has_away = part.is_finite();
        for ((away, reached), predicted) in self.away.iter_mut().zip(reached).zip(predicted) {
            *away = part * (reached - predicted);
        }
    }

    /// Puts the prediction for a step's end into `to.x`, from its left end, a point within it and the point before.
    pub fn predict_on(&self, from: &State, inner: &[f64], time: f64, to: &mut State) {
        let (h, part) = (to.t - from.t, time - from.t);
        let on = h / part;
        if self.count == 0 {
            for ((to, from), inner) in to.x.iter_mut().zip(&from.x).zip(inner) {
                *to = from + on * (inner - from);
            }
            return;
        }
        // x₀ + h·x[t₀, t] + h·(h − p)·x[t₀, t, t₋₁]
        let last = from.t - self.times[0];
        let bend = h * (h - part) / (part + last);
        let (a, b) = (on + bend / part, bend / last);
        let points = to.x.iter_mut().zip(&from.x).zip(inner).zip(&self.x[0]);
        for (((to, from), inner), before) in points {
            *to = from + a * (inner - from) - b * (from - before);
        }
    }

    /// k₁ of the parabola of each unknown asked for through the point before, and the two ends of a step; 0 where there is
    /// no point before.
    pub fn bend(&self, from: &State, to: &State, k: &mut [f64], asked: Option<&[u32]>) {
        let (h, last) = (to.t - from.t, from.t - self.times[0]);
        let (a, b) = match self.count {
            0 => (0.0, 0.0),
            _ => (h / (h + last), h * h / (last * (h + last))),
        };
        let bend = |before: f64, from: f64, to: f64| b * (from - before) - a * (to - from);
        let before = &self.x[0];
        match asked {
            Some(asked) => asked.iter().map(|i| *i as usize).for_each(|i| {
                k[i] = bend(before[i], from.x[i], to.x[i]);
            }),
            None => {
                let points = to.x.iter().zip(&from.x).zip(before);
                for (k, ((to, from), before)) in k.iter_mut().zip(points) {
                    *k = bend(*before, *from, *to);
                }
            }
        }
    }
}
