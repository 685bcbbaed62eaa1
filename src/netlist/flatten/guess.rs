//! Where to look for an operating point: node voltages that follow from sources alone.
//!
//! Newton's method starts at 0 unless something better is known, and a law such as ln(v) has no value there. So the
//! voltages of sources between known nodes, and of laws over known nodes, are followed from ground on. They are guesses:
//! what the solver finds counts.

use crate::circuit::{Device, DeviceKind, Expr, Leaf, NodeId};

/// Rounds of following, at most; a chain that is written backwards takes one for each of its sources.
const ROUNDS: usize = 30;

/// What follows from sources, at t = 0, and from the guesses that are given.
pub fn follow(devices: &[Device], nodes: usize, guesses: &[(NodeId, f64)]) -> Vec<(NodeId, f64)> {
    let mut starts = vec![];
    let law = |device: &Device| {
        matches!(
            device.kind,
            DeviceKind::BehaviouralVoltage { .. }
                | DeviceKind::BehaviouralCurrent { .. }
                | DeviceKind::Diode { .. }
        )
    };
    if !devices.iter().any(law) {
        // A linear circuit needs no guess.
        return starts;
    }
    let mut known: Vec<Option<f64>> = vec![None; nodes];
    if let Some(ground) = known.first_mut() {
        *ground = Some(0.0);
    }
    for (node, value) in guesses {
        if let Some(known) = known.get_mut(node.0 as usize) {
            *known = Some(*value);
        }
    }
    for _ in 0..ROUNDS {
        let mut found = false;
        for device in devices {
            let &[plus, minus] = &device.nodes[..] else { continue };
            let of = |node: NodeId| known.get(node.0 as usize).copied().flatten();
            let (high, low) = (of(plus), of(minus));
            if high.is_some() == low.is_some() {
                continue;
            }
            let value = match &device.kind {
                DeviceKind::VoltageSource { waveform, .. } => Some(waveform.value(0.0)),
                DeviceKind::BehaviouralVoltage { law, .. } => value(law, &known),
                _ => None,
            };
            let Some(value) = value.filter(|value| value.is_finite()) else { continue };
            let (node, value) = match low {
                Some(low) => (plus, low + value),
                None => (minus, high.unwrap_or(0.0) - value),
            };
            if let Some(known) = known.get_mut(node.0 as usize) {
                *known = Some(value);
                starts.push((node, value));
                found = true;
            }
        }
        if !found {
            break;
        }
    }
    starts
}

/// The value of a law, where all that it speaks of is known.
fn value(law: &Expr, known: &[Option<f64>]) -> Option<f64> {
    let of = |node: &NodeId| known.get(node.0 as usize).copied().flatten();
    let mut all = true;
    law.leaves(&mut |leaf, _| {
        all &= match leaf {
            Leaf::Voltage(plus, minus) => of(plus).is_some() && of(minus).is_some(),
            Leaf::Time => true,
            _ => false,
        };
    });
    all.then(|| {
        law.evaluate(&mut |leaf| match leaf {
            Leaf::Voltage(plus, minus) => {
                of(plus).unwrap_or(f64::NAN) - of(minus).unwrap_or(f64::NAN)
            }
            _ => 0.0,
        })
    })
}
