//! Modes: switches that change where their control crosses a threshold, and conditions of laws.
//!
//! A mode is constant during a step. When its guard has crossed within the step just tried, the step is redone until it
//! ends there ([`crossing`](super::step)); then the mode changes and the values after it are sought. A condition is
//!
//! - *held* at its mode, as a rule;
//! - *free*, evaluated as it stands, where the laws have been seen not to jump with it: error control meets kinks;
//! - a *ramp* where neither side lasts: both lead back to the threshold at once, so that the solution slides along it.
//!   On a ramp of width w around the threshold the law takes the value between that keeps the solution there.

use super::network::Network;
use super::newton::Cut;
use super::op::{State, Trouble};
use super::system::Guard;

/// A control of a switch counts as past its threshold when it is by more than this part of its magnitude.
const SLACK: f64 = 1e-9;

/// A crossing is found to this part of the range that its guard has run through.
pub(crate) const LOCATED: f64 = 1e-9;

/// Errors of unknowns by this part of their absolute tolerance count as rounding of a guard.
const NOISE: f64 = 1e-3;

/// Two values agree when they differ by no more than this part of their magnitude.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The width of a ramp, as a part of the range that its guard has run through.
const RAMP: f64 = 1e-7;

/// How often a guard comes back before it has left its threshold, until it is said to slide.
const BOUNCES: u32 = 4;

/// What a condition's hold may be.
pub(crate) const HELD: f64 = 0.0;
pub(crate) const FREE: f64 = 1.0;
pub(crate) const RAMPED: f64 = 2.0;

/// What is known of a mode's guard.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    /// Extremes of a − b so far, and the largest magnitude of a and b.
    low: f64,
    high: f64,
    size: f64,
    /// What errors of the unknowns make of it.
    noise: f64,
    /// How far past its threshold a switch's control may be by the tolerance of location.
    pub located: f64,
    /// The value of a − b at the last step's end; where it last crossed, how far it has been from there since, and how
    /// often it has come back from next to nothing.
    last: f64,
    edge: f64,
    excursion: f64,
    bounces: u32,
    /// Whether it has been said that it slides.
    said: bool,
    /// The next change of a condition over time.
    pub next: f64,
}

impl Default for Track {
    fn default() -> Track {
        Track {
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            size: 0.0,
            noise: 0.0,
            located: 0.0,
            last: f64::INFINITY,
            edge: 0.0,
            excursion: 0.0,
            bounces: 0,
            said: false,
            next: f64::INFINITY,
        }
    }
}

impl Track {
    /// Takes over what another run has seen of the guard's range.
    pub(crate) fn learn(&mut self, other: &Track) {
        (self.low, self.high, self.size) = (other.low, other.high, other.size);
    }

    fn spread(&self) -> f64 {
        (self.high - self.low).max(0.0)
    }

    pub(crate) fn see(&mut self, a: f64, b: f64) {
        let value = a - b;
        self.low = self.low.min(value);
        self.high = self.high.max(value);
        self.size = self.size.max(a.abs()).max(b.abs());
        self.excursion = self.excursion.max((value - self.edge).abs());
        self.last = value;
    }
}

/// Room for the guards of all modes, two values each, and for comparing laws.
#[derive(Clone, Debug)]
pub(crate) struct Controls {
    pub left: Vec<f64>,
    pub right: Vec<f64>,
    pub inside: Vec<f64>,
    /// Values of all laws and guards before and after a change, the largest magnitudes of those before in the run, and of
    /// those after in a step.
    pub before: Vec<f64>,
    pub after: Vec<f64>,
    pub sizes: Vec<f64>,
    pub other_sizes: Vec<f64>,
}

impl Controls {
    pub fn new(modes: usize) -> Controls {
        let room = || vec![0.0; 2 * modes];
        Controls {
            left: room(),
            right: room(),
            inside: room(),
            before: vec![],
            after: vec![],
            sizes: vec![],
            other_sizes: vec![],
        }
    }
}

/// The two values of a mode's guard.
pub(crate) fn pair(controls: &[f64], mode: usize) -> (f64, f64) {
    (controls[2 * mode], controls[2 * mode + 1])
}

impl Network<'_> {
    fn slot(&self, mode: usize) -> usize {
        self.system.modes[mode].slot as usize
    }

    /// The mode's value.
    pub(crate) fn mode(&self, mode: usize) -> f64 {
        self.modes[self.slot(mode)]
    }

    pub(crate) fn set_mode(&mut self, mode: usize, value: f64) {
        let slot = self.slot(mode);
        self.modes[slot] = value;
        self.forget_modes();
    }

    /// Whether it is a condition that follows from the solution.
    pub(crate) fn is_condition(&self, mode: usize) -> bool {
        let data = &self.system.modes[mode];
        data.clock.is_none() && !matches!(data.guard, Guard::Switch { .. })
    }

    /// How a mode is held; switches always are.
    pub(crate) fn hold(&self, mode: usize) -> f64 {
        if self.is_condition(mode) { self.modes[self.slot(mode) + 1] } else { HELD }
    }

    pub(crate) fn set_hold(&mut self, mode: usize, hold: f64) {
        let slot = self.slot(mode);
        self.modes[slot + 1] = hold;
        self.forget_modes();
    }

    /// Whether steps must end where its guard crosses, or leaves its ramp.
    pub(crate) fn is_watched(&self, mode: usize) -> bool {
        self.system.modes[mode].clock.is_none()
    }

    /// Values of the modes before anything is known: switches as cards state them, conditions free, those over time by
    /// the time.
    pub(crate) fn start_modes(&mut self, t: f64) {
        for mode in 0..self.system.modes.len() {
            let data = &self.system.modes[mode];
            match (&data.clock, data.guard) {
                (_, Guard::Switch { initial, .. }) => {
                    self.set_mode(mode, if initial == Some(true) { 1.0 } else { 0.0 });
                }
                (Some(_), _) => {}
                (None, _) => self.set_hold(mode, FREE),
            }
        }
        self.set_clocks(t, None);
        self.statistics.events = 0;
    }

    /// Lets conditions follow their guards again; switches stay as they are.
    pub(crate) fn free_conditions(&mut self) {
        for mode in 0..self.system.modes.len() {
            if self.is_condition(mode) {
                self.set_hold(mode, FREE);
            }
        }
    }

    /// Sets the conditions over time to what they are just after `t`, those included that change within `slack` after
    /// it; without `slack` all of them for the first time.
    pub(crate) fn set_clocks(&mut self, t: f64, slack: Option<f64>) {
        for mode in 0..self.system.modes.len() {
            let Some(clock) = &self.system.modes[mode].clock else { continue };
            let next = self.tracks[mode].next;
            let due = slack.is_some_and(|slack| next <= t + slack);
            if slack.is_some() && !due && clock.is_searched() {
                continue;
            }
            let now = if due { next.max(t) } else { t };
            let before = self.mode(mode);
            let value = clock.value(now, before, &self.modes, self.stop);
            self.tracks[mode].next = clock.next(now, value, &self.modes, self.stop);
            if value != before {
                self.set_mode(mode, value);
                self.changed();
                self.struck = Some((mode, value));
                if matches!(self.system.modes[mode].guard, Guard::Switch { .. }) {
                    self.change_pivots();
                }
            }
        }
    }

    /// Takes a change of a mode to account.
    fn changed(&mut self) {
        self.statistics.events += 1;
        self.forget_constant_factors();
    }

    /// Holds all free conditions at what their guards say.
    pub(crate) fn hold_all(&mut self, controls: &[f64]) {
        for mode in 0..self.system.modes.len() {
            if self.hold(mode) == FREE && self.is_condition(mode) {
                let (a, b) = pair(controls, mode);
                self.set_mode(mode, answer(self.system.modes[mode].guard, a, b));
                self.set_hold(mode, HELD);
            }
        }
    }

    /// Lets all held conditions go.
    pub(crate) fn free_all(&mut self) -> bool {
        let mut any = false;
        for mode in 0..self.system.modes.len() {
            if self.is_condition(mode) && self.hold(mode) == HELD {
                self.set_hold(mode, FREE);
                any = true;
            }
        }
        any
    }

    /// Whether any condition is free.
    pub(crate) fn any_free(&self) -> bool {
        (0..self.system.modes.len()).any(|mode| self.hold(mode) == FREE)
    }

    /// Whether the solution slides along any.
    pub(crate) fn any_ramped(&self) -> bool {
        (0..self.system.modes.len()).any(|mode| self.hold(mode) == RAMPED)
    }

    /// How far a guard is past the threshold of the mode it is in (positive: it must change).
    pub(crate) fn excess(&self, mode: usize, a: f64, b: f64) -> f64 {
        let value = self.mode(mode);
        if self.hold(mode) == RAMPED {
            return (a - b - self.tracks[mode].edge).abs() - self.width(mode);
        }
        match self.system.modes[mode].guard {
            Guard::Switch { off, .. } if value > 0.5 => off - a,
            Guard::Switch { on, .. } => a - on,
            Guard::Side if value == 0.0 => (a - b).abs() - self.room(mode),
            Guard::Side => -value * (a - b),
            Guard::Cell => (a - (value + 1.0)).max(value - a),
        }
    }

    /// The distance from its threshold within which a guard counts as on it.
    pub(crate) fn room(&self, mode: usize) -> f64 {
        let track = &self.tracks[mode];
        track.noise.max(track.located).max(self.tolerance(mode))
    }

    /// How exactly a crossing is to be found.
    pub(crate) fn tolerance(&self, mode: usize) -> f64 {
        let track = &self.tracks[mode];
        let spread = match self.system.modes[mode].guard {
            Guard::Cell => track.spread().min(1.0),
            _ => track.spread(),
        };
        (LOCATED * spread).max(ROUNDING * track.size)
    }

    /// The distance that rounding and the search for a crossing may make of a guard.
    pub(crate) fn slack(&self, mode: usize, a: f64) -> f64 {
        match self.system.modes[mode].guard {
            Guard::Switch { .. } => self.rounding(mode, a).max(self.tracks[mode].located),
            _ => self.room(mode),
        }
    }

    /// The distance that rounding alone may make of it.
    pub(crate) fn rounding(&self, mode: usize, a: f64) -> f64 {
        match self.system.modes[mode].guard {
            Guard::Switch { on, off, .. } => SLACK * a.abs().max(on.abs()).max(off.abs()),
            _ => self.room(mode),
        }
    }

    /// The width of a ramp.
    fn width(&self, mode: usize) -> f64 {
        1.0 / self.modes[self.slot(mode) + 2]
    }

    /// The value that a mode takes when its guard crosses at (a, b).
    pub(crate) fn next_value(&self, mode: usize, a: f64, b: f64) -> f64 {
        let value = self.mode(mode);
        if self.hold(mode) == RAMPED {
            return answer(self.system.modes[mode].guard, a, b);
        }
        match self.system.modes[mode].guard {
            Guard::Switch { .. } => 1.0 - value,
            Guard::Side if value == 0.0 => crate::expr::values::sign(a - b),
            Guard::Side => -value,
            Guard::Cell if a > value + 0.5 => value + 1.0,
            Guard::Cell => value - 1.0,
        }
    }

    /// Works out anew what errors of the unknowns make of guards.
    pub(crate) fn see_noise(&mut self, x: &[f64], t: f64, errors: &[f64]) {
        if !(0..self.system.modes.len()).any(|mode| self.is_condition(mode)) {
            return;
        }
        let noise = self.control_noise(x, t, errors);
        for (mode, track) in self.tracks.iter_mut().enumerate() {
            let (a, b) = pair(&noise, mode);
            track.noise = if (a + b).is_finite() { NOISE * (a + b) } else { 0.0 };
        }
    }

    /// Takes the guards at the end of an accepted step into what is known of them: free conditions follow.
    pub(crate) fn see_guards(&mut self, controls: &[f64]) {
        for mode in 0..self.system.modes.len() {
            let (a, b) = pair(controls, mode);
            self.tracks[mode].see(a, b);
            // Nothing follows from the mode of a free condition: what is known of the laws stays so.
            if self.hold(mode) == FREE && self.excess(mode, a, b) > self.room(mode) {
                let slot = self.slot(mode);
                self.modes[slot] = answer(self.system.modes[mode].guard, a, b);
            }
        }
    }

    /// Changes a mode whose guard stands at (a, b). Says whether it has come back again and again before it had left
    /// its threshold.
    pub(crate) fn flip(&mut self, mode: usize, value: f64, a: f64, b: f64) -> bool {
        let before = self.mode(mode);
        self.set_mode(mode, value);
        self.changed();
        if self.hold(mode) == RAMPED {
            // The ramp has been left.
            self.set_hold(mode, HELD);
            return false;
        }
        let edge = match self.system.modes[mode].guard {
            Guard::Switch { .. } => {
                self.change_pivots();
                return false;
            }
            Guard::Side => 0.0,
            Guard::Cell => before.max(value),
        };
        let room = 16.0 * self.room(mode).max((a - b - edge).abs());
        let track = &mut self.tracks[mode];
        let stays = track.excursion <= room && track.edge == edge;
        track.bounces = if stays { track.bounces + 1 } else { 0 };
        track.edge = edge;
        track.excursion = 0.0;
        track.bounces >= BOUNCES
    }

    /// Makes a condition a ramp around the threshold that it stands at; says its width.
    pub(crate) fn ramp(&mut self, mode: usize, a: f64, b: f64, reltol: f64) -> f64 {
        // What the law makes of the rounding of the unknowns must stay below what is allowed to it.
        let rounding = (f64::EPSILON / (reltol * reltol)).clamp(1.0, 1e2);
        let track = &self.tracks[mode];
        let spread = if track.spread() > 0.0 { track.spread() } else { track.size };
        let noise = rounding * track.noise / NOISE;
        let width = (RAMP * spread).max(noise).max(f64::MIN_POSITIVE / ROUNDING);
        self.set_ramp(mode, a, b, width);
        width
    }

    fn set_ramp(&mut self, mode: usize, a: f64, b: f64, width: f64) {
        let cell = self.system.modes[mode].guard == Guard::Cell;
        let edge = if cell { (a - b).round() } else { 0.0 };
        if cell {
            self.set_mode(mode, edge);
        }
        let slot = self.slot(mode);
        self.modes[slot + 1] = RAMPED;
        self.modes[slot + 2] = 1.0 / width;
        self.tracks[mode].edge = edge;
        self.tracks[mode].bounces = 0;
        self.forget_modes();
    }

    /// Whether a slide of this mode is new to whoever started the run.
    pub(crate) fn is_news(&mut self, mode: usize) -> bool {
        !std::mem::replace(&mut self.tracks[mode].said, true)
    }
}

/// What a condition's guards say.
fn answer(guard: Guard, a: f64, b: f64) -> f64 {
    match guard {
        Guard::Side => crate::expr::values::sign(a - b),
        Guard::Cell if (a - a.round()).abs() <= ROUNDING * a.abs() => a.round(),
        Guard::Cell => a.floor(),
        Guard::Switch { .. } => 0.0,
    }
}

/// A condition that became a ramp while values were sought.
pub(crate) struct Slide {
    pub mode: usize,
    pub width: f64,
}

/// Solves, changes the modes that the solution contradicts, and solves again until none does; at most twice as often
/// as there are modes. A condition that no mode of agrees with the solution becomes a ramp.
pub(crate) fn settle_modes(
    network: &mut Network,
    state: &mut State,
    slides: &mut Vec<Slide>,
    mut solve: impl FnMut(&mut Network, &mut State) -> Result<(), Cut>,
) -> Result<(), Trouble> {
    let count = network.system.modes.len();
    let mut controls = vec![0.0; 2 * count];
    for _ in 0..=count {
        for _ in 0..=2 * count {
            if let Err(cut) = solve(network, state) {
                // What does not converge as it stands may do so with one branch at a time.
                if !network.any_free() {
                    return Err(cut.into());
                }
                network.controls(&state.x, state.t, &mut controls);
                network.hold_all(&controls);
                continue;
            }
            network.controls(&state.x, state.t, &mut controls);
            let Some((worst, value)) = most_contradicted(network, &controls) else {
                return Ok(());
            };
            network.set_mode(worst, value);
            network.changed();
            if matches!(network.system.modes[worst].guard, Guard::Switch { .. }) {
                network.change_pivots();
            }
        }
        let worst = most_contradicted(network, &controls).map_or(0, |(mode, _)| mode);
        if !network.is_condition(worst) {
            return Err(Trouble::Modes(network.system.modes[worst].device));
        }
        // A wide ramp first, which Newton's method finds its way along.
        let (a, b) = pair(&controls, worst);
        let size = a.abs().max(b.abs()).max(network.tracks[worst].size);
        let mut width = size;
        for narrower in 0..=6 {
            width = size * libm::pow(0.1, f64::from(narrower));
            network.set_ramp(worst, a, b, width);
            solve(network, state)
                .map_err(|_| Trouble::Modes(network.system.modes[worst].device))?;
        }
        slides.push(Slide { mode: worst, width });
    }
    Err(Trouble::Modes(network.system.modes[0].device))
}

/// The mode that its guard contradicts most, and the value it should have. A guard that has jumped onto its threshold
/// stands on it; one that has moved there continuously stays on its side.
fn most_contradicted(network: &Network, controls: &[f64]) -> Option<(usize, f64)> {
    let mut worst: Option<(usize, f64, f64)> = None;
    for mode in 0..network.system.modes.len() {
        if !network.is_watched(mode) || network.hold(mode) != HELD {
            continue;
        }
        let (a, b) = pair(controls, mode);
        let guard = network.system.modes[mode].guard;
        let room = network.slack(mode, a);
        let mut by = network.excess(mode, a, b);
        let mut value = match guard {
            Guard::Switch { .. } => 1.0 - network.mode(mode),
            _ => answer(guard, a, b),
        };
        if by <= room && !matches!(guard, Guard::Switch { .. }) {
            let (edge, zero) = match guard {
                Guard::Cell => (network.mode(mode) + 1.0, network.mode(mode) + 1.0),
                _ => (0.0, 0.0),
            };
            let lands = (a - b - edge).abs() <= ROUNDING * a.abs().max(b.abs());
            let jumped = (network.tracks[mode].last - edge).abs() > room.max(1e-6 * a.abs());
            if !(lands && jumped && network.mode(mode) != zero) {
                continue;
            }
            (by, value) = (2.0 * room, zero);
        } else if by <= room {
            continue;
        }
        let by = by / room.max(f64::MIN_POSITIVE);
        if worst.is_none_or(|(_, _, most)| by > most) {
            worst = Some((mode, value, by));
        }
    }
    worst.map(|(mode, value, _)| (mode, value))
}
