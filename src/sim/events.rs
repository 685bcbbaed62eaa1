//! Modes: two-state devices that change where their control crosses a threshold.

use super::network::Network;
use super::newton::Cut;
use super::op::{State, Trouble};

/// A control counts as past its threshold when it is by more than this part of its magnitude.
const SLACK: f64 = 1e-9;

/// What a mode's control says of it: how far it is past the threshold of the state it is in (positive: it must change).
fn excess(network: &Network, mode: usize, control: f64) -> f64 {
    let data = &network.system.modes[mode];
    if network.modes[mode] > 0.5 { data.off - control } else { control - data.on }
}

/// The distance that rounding may make of a control.
fn slack(network: &Network, mode: usize, control: f64) -> f64 {
    let data = &network.system.modes[mode];
    let rounding = SLACK * control.abs().max(data.on.abs()).max(data.off.abs());
    rounding.max(network.mode_room[mode])
}

/// Room for the controls of all modes.
#[derive(Clone, Debug)]
pub(crate) struct Controls {
    pub left: Vec<f64>,
    pub right: Vec<f64>,
}

impl Controls {
    pub fn new(modes: usize) -> Controls {
        Controls { left: vec![0.0; modes], right: vec![0.0; modes] }
    }
}

/// The modes whose control has crossed its threshold within a step, the most advanced first: its index and the part
/// of the step after which a straight line crosses.
pub(crate) fn first_crossing(network: &Network, controls: &Controls) -> Option<(usize, f64)> {
    let mut first: Option<(usize, f64)> = None;
    for mode in 0..network.modes.len() {
        let before = excess(network, mode, controls.left[mode]);
        let after = excess(network, mode, controls.right[mode]);
        if after <= slack(network, mode, controls.right[mode]) {
            continue;
        }
        let part = if before >= 0.0 { 0.0 } else { before / (before - after) };
        if first.is_none_or(|(_, earliest)| part < earliest) {
            first = Some((mode, part));
        }
    }
    first
}

/// Signed excess of a mode at a control value, for root finding.
pub(crate) fn past(network: &Network, mode: usize, control: f64) -> f64 {
    excess(network, mode, control)
}

/// Changes a mode to its other state.
pub(crate) fn flip(network: &mut Network, mode: usize) {
    network.modes[mode] = 1.0 - network.modes[mode];
    network.statistics.events += 1;
    network.forget_pivots();
}

/// Changes a mode, and all others whose controls have come to their thresholds in the same step (`before` → `now`).
pub(crate) fn flip_all(network: &mut Network, mode: usize, before: &[f64], now: &[f64]) {
    for other in 0..network.modes.len() {
        let past = excess(network, other, now[other]);
        let rising = past > excess(network, other, before[other]);
        let range = (now[other] - before[other]).abs();
        let room = slack(network, other, now[other]).max(4.0 * SLACK * range);
        if other != mode && rising && past >= -room {
            network.mode_room[other] = room;
            flip(network, other);
        }
    }
    flip(network, mode);
}

/// Solves, changes the modes that the solution contradicts, and solves again until none does; at most twice as often
/// as there are modes.
pub(crate) fn settle_modes(
    network: &mut Network,
    state: &mut State,
    mut solve: impl FnMut(&mut Network, &mut State) -> Result<(), Cut>,
) -> Result<(), Trouble> {
    let count = network.modes.len();
    let mut controls = vec![0.0; count];
    for _ in 0..=2 * count {
        solve(network, state)?;
        network.controls(&state.x, state.t, &mut controls);
        let Some(worst) = most_contradicted(network, &controls) else {
            return Ok(());
        };
        flip(network, worst);
    }
    let worst = most_contradicted(network, &controls).unwrap_or(0);
    Err(Trouble::Modes(network.system.modes[worst].device))
}

/// The mode that is farthest past its threshold.
pub(crate) fn most_contradicted(network: &Network, controls: &[f64]) -> Option<usize> {
    let mut worst: Option<(usize, f64)> = None;
    for (mode, control) in controls.iter().enumerate() {
        let room = slack(network, mode, *control);
        let by = excess(network, mode, *control);
        if by > room && worst.is_none_or(|(_, most)| by / room > most) {
            worst = Some((mode, by / room.max(f64::MIN_POSITIVE)));
        }
    }
    worst.map(|(mode, _)| mode)
}
