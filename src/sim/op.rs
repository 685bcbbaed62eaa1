//! Operating points and consistent values, both from the frozen network.
//!
//! Charges either keep their values (after corners and events, and at the start of a run with given initial values) or
//! have no rate (operating point). Where an operating point would be singular because of storages only (an integrator
//! nothing feeds back to), those storages keep their initial values.

use super::events::{Slide, settle_modes};
use super::network::Network;
use super::newton::{Cut, Scratch};
use super::remarks;
use super::search::{self, Question};
use super::step::Stuck;
use super::ties;
use crate::circuit::DeviceId;

/// Values at an instant.
#[derive(Clone, Debug, Default)]
pub(crate) struct State {
    pub t: f64,
    /// Unknowns.
    pub x: Vec<f64>,
    /// Rates dQ/dt.
    pub w: Vec<f64>,
    /// Charges and fluxes.
    pub q: Vec<f64>,
}

impl State {
    pub fn new(t: f64, n: usize, charges: usize) -> State {
        State { t, x: vec![0.0; n], w: vec![0.0; charges], q: vec![0.0; charges] }
    }

    /// Takes over the values of another, without allocation where it is as large.
    pub fn copy_from(&mut self, other: &State) {
        self.t = other.t;
        self.x.clone_from(&other.x);
        self.w.clone_from(&other.w);
        self.q.clone_from(&other.q);
    }
}

/// What a start cannot be found for.
#[derive(Clone, Debug)]
pub(crate) enum Trouble {
    /// The equations.
    Cut(Cut),
    /// Modes that keep each other from settling.
    Modes(DeviceId),
    /// A step that became too small.
    Stuck(Box<Stuck>),
}

impl From<Cut> for Trouble {
    fn from(cut: Cut) -> Trouble {
        Trouble::Cut(cut)
    }
}

/// Below this an unknown counts as 0 in an update test.
pub(crate) fn floors(network: &Network) -> Vec<f64> {
    let system = network.system;
    let floor = |u: &crate::circuit::stamps::Unknown| match u.nominal {
        Some(nominal) if nominal > 0.0 => 1e-3 * nominal,
        _ if u.voltage => 1e-3,
        _ => 1e-6,
    };
    system.unknowns.iter().map(floor).collect()
}

/// The values at `t = 0` with the charges that cards and `.ic` state (0 where nothing is said).
pub(crate) fn initial_values(network: &mut Network, t: f64) -> State {
    let system = network.system;
    let mut state = State::new(t, system.equations(), system.charges());
    for (unknown, value) in &system.initial {
        state.x[*unknown as usize] = *value;
    }
    network.evaluate(&state.x, t);
    network.charges(&state.x, &mut state.q);
    for (q, stated) in state.q.iter_mut().zip(&system.initial_charges) {
        if let Some(value) = stated {
            *q = *value;
        }
    }
    state
}

/// Finds x and w for the charges in `state`, all held, starting from the values in `state`.
pub(crate) fn consistent_values(
    network: &mut Network,
    state: &mut State,
    floors: &[f64],
    slides: &mut Vec<Slide>,
    scratch: &mut Scratch,
) -> Result<(), Trouble> {
    let held = &network.system.held;
    let mut targets = std::mem::take(&mut scratch.targets);
    targets.clone_from(&state.q);
    let question = Question { held, targets: &targets, floors, prime: false };
    let result = settle_modes(network, state, slides, |network, state| {
        search::find(network, &question, state, scratch)
    });
    if result.is_err() {
        // What the search left behind is no charge that anybody stated.
        state.q.copy_from_slice(&targets);
    }
    scratch.targets = targets;
    result
}

/// Finds the operating point at `state.t`; `state.q` holds initial charges for those storages that it leaves
/// undetermined.
pub(crate) fn operating_point(
    network: &mut Network,
    state: &mut State,
    floors: &[f64],
    slides: &mut Vec<Slide>,
    scratch: &mut Scratch,
) -> Result<(), Trouble> {
    let targets = state.q.clone();
    for (unknown, value) in network.system.starts.iter().chain(&network.system.initial) {
        state.x[*unknown as usize] = *value;
    }
    network.pins.clone_from(&network.system.initial);
    let mut held = vec![false; network.system.charges()];
    let mut tied = vec![];
    let result = settle_modes(network, state, slides, |network, state| {
        tied.clear();
        let stated = network.system.initial_charges.iter().zip(&network.system.held);
        for ((held, (initial, state)), pinned) in
            held.iter_mut().zip(stated).zip(&network.system.pinned)
        {
            let stated = network.system.initial_holds && initial.is_some();
            *held = *state && (stated || *pinned);
        }
        begin_at_guesses(network, &held, &targets, floors, state, scratch);
        loop {
            let prime = network.system.guesses.is_empty();
            let question = Question { held: &held, targets: &targets, floors, prime };
            match search::find(network, &question, state, scratch) {
                Err(Cut::Singular(singular)) => {
                    if !ties::hold_more(network, &singular, scratch, &mut held, &mut tied) {
                        return Err(Cut::Singular(singular));
                    }
                    network.forget_pivots();
                }
                Err(other) => return Err(other),
                Ok(()) => break,
            }
        }
        ties::settle(network, &tied, &targets, state, |network, targets, state| {
            let question = Question { held: &held, targets, floors, prime: false };
            search::find(network, &question, state, scratch)
        });
        Ok(())
    });
    if result.is_ok() {
        say_ties(network, &tied);
    }
    network.pins.clear();
    network.forget_pivots();
    result
}

/// The guess that `.nodeset` gives: a solution with its nodes pinned to their values, which are let go afterwards.
fn begin_at_guesses(
    network: &mut Network,
    held: &[bool],
    targets: &[f64],
    floors: &[f64],
    state: &mut State,
    scratch: &mut Scratch,
) {
    let system = network.system;
    if system.guesses.is_empty() {
        return;
    }
    let stated = |node: u32| system.initial.iter().any(|(other, _)| *other == node);
    let pins = system.guesses.iter().filter(|(node, _)| !stated(*node));
    network.pins.extend(pins);
    let start = state.clone();
    let question = Question { held, targets, floors, prime: true };
    if search::find(network, &question, state, scratch).is_err() {
        state.copy_from(&start);
        for (node, value) in &system.guesses {
            state.x[*node as usize] = *value;
        }
    }
    network.pins.truncate(system.initial.len());
    network.forget_pivots();
}

/// Warns of what the operating point left open. Bond graphs begin with what their storages are said to hold.
fn say_ties(network: &mut Network, tied: &[ties::Tie]) {
    const MOST: usize = 6;
    let system = network.system;
    if !system.spoken.is_empty() {
        return;
    }
    for tie in tied.iter().take(MOST) {
        let warning = remarks::left_open(system, tie.charge, &tie.open);
        let said = &mut network.statistics.warnings;
        if !said.iter().any(|other| other.message == warning.message) {
            said.push(warning);
        }
    }
}
