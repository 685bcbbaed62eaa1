//! The first step after a corner or event, from what did after the last one of its kind: a switch that closes under the
//! same diode, a pulse that rises again.

use super::Run;
use crate::sim::network::Network;

/// So many kinds are known at once; a new one takes the place of the one known longest.
const KINDS: usize = 16;

/// Values and slopes of a source that differ by no more than this part of their size are the same.
const SAME: f64 = 1e-6;

/// The part of a charge by which it may change in a first step.
const LITTLE: f64 = 0.01;

/// What ends a stretch of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A source, its value and its slope after the corner.
    Corner(usize, f64, f64),
    /// A mode and its value after the event.
    Event(usize, f64),
}

impl Kind {
    fn is_like(self, other: Kind) -> bool {
        let same = |a: f64, b: f64| (a - b).abs() <= SAME * a.abs().max(b.abs());
        match (self, other) {
            (Kind::Corner(k, value, slope), Kind::Corner(j, other, other_slope)) => {
                k == j && same(value, other) && same(slope, other_slope)
            }
            (Kind::Event(..), Kind::Event(..)) => self == other,
            _ => false,
        }
    }
}

/// What is known of corners or events of a kind.
#[derive(Clone, Copy, Debug)]
struct Known {
    kind: Kind,
    /// The step that did after it, where longer ones had failed.
    did: Option<f64>,
    /// How often the layer after it could not be passed over.
    stayed: u32,
}

/// What is known of kinds of corners and events.
#[derive(Debug, Default)]
pub(super) struct First {
    known: Vec<Known>,
    /// The next to be forgotten.
    oldest: usize,
    /// That of the last corner or event.
    present: Option<usize>,
    /// Half of the last step before it.
    usual: f64,
}

impl First {
    pub fn new() -> First {
        First { known: Vec::with_capacity(KINDS), ..First::default() }
    }

    /// The corner that has just been passed: a mode over time that changed there, else the first of the sources whose segment
    /// begins there.
    pub fn corner(&mut self, network: &Network, t: f64, slack: f64) {
        if let Some((mode, value)) = network.struck {
            return self.event(mode, value);
        }
        let mut segments = network.segments().iter();
        let found = segments.position(|segment| (segment.start - t).abs() <= slack);
        self.present = found.map(|k| {
            let segment = &network.segments()[k];
            let at = segment.start;
            self.place(Kind::Corner(k, segment.value(at), segment.derivative(at)))
        });
    }

    /// The event that has just changed a mode.
    pub fn event(&mut self, mode: usize, value: f64) {
        self.present = Some(self.place(Kind::Event(mode, value)));
    }

    /// The step that did after the last corner or event of the present kind, where longer ones had failed.
    fn did(&self) -> Option<f64> {
        self.present.and_then(|place| self.known[place].did)
    }

    /// How often the layer after the last corner or event could not be passed over, where that is of a known kind.
    pub fn stayed(&mut self) -> Option<&mut u32> {
        self.present.map(|place| &mut self.known[place].stayed)
    }

    /// The place of a kind, a new one where it is not known.
    fn place(&mut self, kind: Kind) -> usize {
        if let Some(place) = self.known.iter().position(|known| known.kind.is_like(kind)) {
            return place;
        }
        let new = Known { kind, did: None, stayed: 0 };
        if self.known.len() < KINDS {
            self.known.push(new);
            return self.known.len() - 1;
        }
        let place = self.oldest;
        self.oldest = (place + 1) % KINDS;
        self.known[place] = new;
        place
    }
}

impl Run<'_> {
    /// Shortens the step after a corner or event.
    pub(super) fn shorten(&mut self) {
        self.begin_far(self.first.did());
        self.first.usual = 0.5 * self.h;
        self.be_careful();
    }

    /// Makes the next step a careful first one, and no longer than what did after the last corner or event of its kind, where
    /// longer ones had failed.
    pub(super) fn be_careful(&mut self) {
        let careful = (0.1 * self.distance()).min(self.until_charges_change());
        let most = self.first.did().map_or(careful, |did| did.min(careful));
        self.h = self.first.usual.min(most).max(self.smallest);
    }

    /// Where there are junctions, the time in which rates change a charge by a small part of the largest it has been at a
    /// corner or event (E. Hairer, S. P. Nørsett, G. Wanner, Solving ODEs I, 1993, II.4). What begins to conduct within a
    /// step shows at neither of its stages.
    fn until_charges_change(&mut self) -> f64 {
        let Run { state, network, largest_charges, .. } = self;
        if !network.system.has_junctions() {
            return f64::INFINITY;
        }
        let mut fastest: f64 = 0.0;
        for ((largest, q), w) in largest_charges.iter_mut().zip(&state.q).zip(&state.w) {
            *largest = largest.max(q.abs());
            if *largest > 0.0 {
                fastest = fastest.max(w.abs() / *largest);
            }
        }
        LITTLE / fastest
    }

    /// The first step after a corner or event says how long the next one of its kind may be.
    pub(super) fn learn_first(&mut self, h: f64, failed: bool) {
        if let Some(place) = self.first.present.take() {
            self.first.known[place].did = failed.then_some(h);
        }
    }
}
