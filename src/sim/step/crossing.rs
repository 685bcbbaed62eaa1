//! Crossings of thresholds within a step: the step is taken again until it ends on the first of them, then the mode
//! changes.

use super::Run;
use crate::sim::events;
use crate::sim::explain::{Failure, Moment, failure};
use crate::sim::op::Trouble;

impl Run<'_> {
    /// Looks for the first crossing of a threshold within the step just tried.
    pub(super) fn locate(&mut self, h: f64, search: &mut Search) -> Located {
        const TOLERANCE: f64 = 1e-9;
        if self.network.modes.is_empty() {
            return Located::Nothing;
        }
        let Run { network, state, next, controls, work, .. } = self;
        network.controls(&next.x, next.t, &mut controls.right);
        let crossing = events::first_crossing(network, controls);
        if let Some(mode) = search.mode {
            let range = search.range.max((controls.right[mode] - controls.left[mode]).abs());
            let past = events::past(network, mode, controls.right[mode]);
            network.mode_room[mode] = 4.0 * TOLERANCE * range;
            let done = past.abs() <= TOLERANCE * range || search.tries >= 3;
            if crossing.is_none_or(|(first, _)| first == mode) && (done || h <= self.smallest) {
                if past < -TOLERANCE * range && search.tries >= 3 {
                    // Still before the threshold: keep the step, the crossing is in the next one.
                    return Located::Nothing;
                }
                return Located::Here(mode);
            }
        }
        let Some((mode, _)) = crossing else {
            let Some(mode) = search.mode else { return Located::Nothing };
            // The step now ends before the threshold: go on between here and where it was past.
            let past = events::past(network, mode, controls.right[mode]);
            search.before = (h, past);
            return search.again();
        };
        let past = events::past(network, mode, controls.right[mode]);
        if search.mode != Some(mode) {
            let start = events::past(network, mode, controls.left[mode]);
            *search = Search {
                mode: Some(mode),
                tries: search.tries,
                before: (0.0, start.min(0.0)),
                after: (h, past),
                range: (controls.right[mode] - controls.left[mode]).abs(),
            };
            network.mode_room[mode] = 4.0 * TOLERANCE * search.range;
            if past <= TOLERANCE * search.range || h <= self.smallest {
                return Located::Here(mode);
            }
            // First guess: the root on the interpolant.
            let theta = root(|theta| {
                work.dense.unknowns(theta, state, next, &mut work.x);
                let t = state.t + theta * h;
                network.controls(&work.x, t, &mut controls.right);
                events::past(network, mode, controls.right[mode])
            });
            search.tries += 1;
            return Located::Redo((theta * h).max(self.smallest));
        }
        search.after = (h, past);
        search.again()
    }

    /// Changes a mode and finds the values after it.
    pub(super) fn pass_event(&mut self, mode: usize) -> Result<(), Failure> {
        let device = self.network.system.modes[mode].device;
        let (since, count) = &mut self.crowd;
        if self.state.t - *since > 1e-9 * self.settings.stop {
            *since = self.state.t;
            *count = 0;
        }
        *count += 1;
        if *count > 100 {
            let network = &self.network;
            let trouble = Trouble::Modes(device);
            return Err(failure(
                network.system,
                Moment::Restart,
                self.state.t,
                &trouble,
                &network.statistics,
            ));
        }
        // Other modes may stand on their thresholds at the same instant, on their way across.
        let Run { network, controls, .. } = self;
        events::flip_all(network, mode, &controls.right, &controls.left);
        self.restart(Moment::Restart)?;
        self.shorten();
        self.row_here()
    }
}

/// What was found in a step.
pub(super) enum Located {
    Nothing,
    /// The step ends on this mode's threshold.
    Here(usize),
    /// Take the step again with this size.
    Redo(f64),
}

/// The search for a crossing: step sizes and how far past the threshold they ended.
#[derive(Default)]
pub(super) struct Search {
    mode: Option<usize>,
    tries: u32,
    before: (f64, f64),
    after: (f64, f64),
    range: f64,
}

impl Search {
    /// The next size to try: where a straight line between the bracketing sizes crosses.
    fn again(&mut self) -> Located {
        self.tries += 1;
        let (h0, g0) = self.before;
        let (h1, g1) = self.after;
        let part = if g1 > g0 { -g0 / (g1 - g0) } else { 0.5 };
        Located::Redo(h0 + part.clamp(0.0, 1.0) * (h1 - h0))
    }
}

/// The root in 0..1 of a function that is not positive at 0 and positive at 1, by bisection and false position.
fn root(mut f: impl FnMut(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let (mut below, mut above) = (f(0.0), f(1.0));
    if below > 0.0 {
        return 0.0;
    }
    for round in 0..60 {
        let middle = if round % 3 == 2 || above - below <= 0.0 {
            0.5 * (low + high)
        } else {
            low + (high - low) * (-below / (above - below)).clamp(0.01, 0.99)
        };
        let value = f(middle);
        if value > 0.0 {
            (high, above) = (middle, value);
        } else {
            (low, below) = (middle, value);
        }
        if high - low < 1e-12 {
            break;
        }
    }
    high
}
