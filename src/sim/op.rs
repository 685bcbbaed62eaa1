//! Operating points and consistent values, both from the frozen network.
//!
//! Charges either keep their values (after corners and events, and at the start of a run with given initial values) or
//! have no rate (operating point). Where an operating point would be singular because of storages only (an integrator
//! nothing feeds back to), those storages keep their initial values.

use super::events::{Slide, settle_modes};
use super::network::Network;
use super::newton::{Cut, Frozen, Scratch, solve_frozen};
use crate::circuit::DeviceId;

/// Values at an instant.
#[derive(Clone, Debug)]
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

    /// Takes over the values of another, without allocation.
    pub fn copy_from(&mut self, other: &State) {
        self.t = other.t;
        self.x.copy_from_slice(&other.x);
        self.w.copy_from_slice(&other.w);
        self.q.copy_from_slice(&other.q);
    }
}

/// What a start cannot be found for.
#[derive(Clone, Debug)]
pub(crate) enum Trouble {
    /// The equations.
    Cut(Cut),
    /// Modes that keep each other from settling.
    Modes(DeviceId),
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
    let targets = state.q.clone();
    let result = settle_modes(network, state, slides, |network, state| {
        find(network, held, &targets, floors, state, false, scratch)
    });
    if result.is_err() {
        // What the search left behind is no charge that anybody stated.
        state.q.copy_from_slice(&targets);
    }
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
    let system = network.system;
    for (unknown, value) in system.guesses.iter().chain(&system.initial) {
        state.x[*unknown as usize] = *value;
    }
    network.pin_initial = true;
    let result = settle_modes(network, state, slides, |network, state| {
        let mut held = network.system.pinned.clone();
        loop {
            match find(network, &held, &targets, floors, state, true, scratch) {
                Err(Cut::Singular(singular)) => {
                    let n = network.system.equations() as u32;
                    let before = held.iter().filter(|h| **h).count();
                    // A storage whose value is open (its unknowns are in a null vector) and whose rate would satisfy
                    // the equations that contradict each other (its row is in a null vector of the transpose).
                    for row in singular.rows.iter().flatten().filter(|row| **row >= n) {
                        let k = (row - n) as usize;
                        if !network.system.held[k] {
                            continue;
                        }
                        let open = |unknown: usize| {
                            singular.columns.iter().any(|set| set.contains(&(unknown as u32)))
                        };
                        held[k] |= network.system.charges.row(k).any(|(unknown, _)| open(unknown));
                        held[k] |= network.system.curved[k];
                    }
                    if held.iter().filter(|h| **h).count() == before {
                        return Err(Cut::Singular(singular));
                    }
                    network.forget_pivots();
                }
                other => return other,
            }
        }
    });
    network.pin_initial = false;
    network.forget_pivots();
    result
}

/// Newton from the guess, then with a conductance at every node that is taken away step by step, then with sources
/// that are turned up step by step.
fn find(
    network: &mut Network,
    held: &[bool],
    targets: &[f64],
    floors: &[f64],
    state: &mut State,
    prime: bool,
    scratch: &mut Scratch,
) -> Result<(), Cut> {
    let mut frozen = Frozen { t: state.t, held, targets, floors, most: 100, prime };
    let State { x, w, q, .. } = state;
    let guess = (x.clone(), w.clone());
    let first = match solve_frozen(network, &frozen, x, w, q, scratch) {
        Ok(()) => return Ok(()),
        Err(cut) => cut,
    };
    if network.system.is_linear() {
        return Err(first);
    }
    if matches!(first, Cut::Singular(_)) {
        // A law may have no slope just where the guess is (f·|f| at rest): look from beside it.
        for scale in [1.0, -1.0, 1e3, -1e3, 1e6, -1e6] {
            for (x, floor) in x.iter_mut().zip(floors) {
                *x = scale * floor;
            }
            w.fill(0.0);
            network.forget_pivots();
            if solve_frozen(network, &frozen, x, w, q, scratch).is_ok() {
                return Ok(());
            }
        }
        network.forget_pivots();
    }
    // gmin stepping
    x.fill(0.0);
    w.fill(0.0);
    frozen.most = 60;
    let mut found = true;
    let (mut gmin, mut factor) = (1.0, 10.0);
    let mut kept = (x.clone(), w.clone());
    while gmin > 1e-21 {
        network.gmin = gmin;
        if solve_frozen(network, &frozen, x, w, q, scratch).is_ok() {
            kept = (x.clone(), w.clone());
            frozen.prime = false;
            gmin /= factor;
        } else {
            x.copy_from_slice(&kept.0);
            w.copy_from_slice(&kept.1);
            if factor < 1.2 || gmin >= 1.0 {
                found = false;
                break;
            }
            gmin *= factor;
            factor = factor.sqrt();
            gmin /= factor;
        }
    }
    network.gmin = 0.0;
    if found && solve_frozen(network, &frozen, x, w, q, scratch).is_ok() {
        return Ok(());
    }
    // source stepping
    x.fill(0.0);
    w.fill(0.0);
    frozen.prime = false;
    let (mut reached, mut step) = (0.0_f64, 0.125_f64);
    kept = (x.clone(), w.clone());
    while reached < 1.0 && step > 1e-4 {
        let next: f64 = (reached + step).min(1.0);
        network.drive = next;
        if solve_frozen(network, &frozen, x, w, q, scratch).is_ok() {
            kept = (x.clone(), w.clone());
            reached = next;
            step *= 2.0;
        } else {
            x.copy_from_slice(&kept.0);
            w.copy_from_slice(&kept.1);
            step *= 0.25;
        }
    }
    network.drive = 1.0;
    if reached >= 1.0 {
        return Ok(());
    }
    x.copy_from_slice(&guess.0);
    w.copy_from_slice(&guess.1);
    Err(first)
}
