//! Points of one run corrected several at once: rows within a step, which wait for nothing of each other.

use super::equations::Equations;
use crate::linear::{Flat, Number, Pack, put_lane, take_lane};
use crate::sim::network::Network;
use crate::sim::op::State;
use crate::sim::system::System;

/// A point in each lane, and what a correction in the frozen network makes of it.
#[derive(Debug)]
pub(crate) struct Points {
    equations: Equations,
    /// The frozen network's factors, by their number.
    flat: Option<(u64, Flat<Pack>)>,
    held: Vec<bool>,
    w: Vec<Pack>,
    targets: Vec<Pack>,
    /// Residuals, then corrections of unknowns and rates.
    vector: Vec<Pack>,
    work: Vec<Pack>,
}

impl Points {
    /// For a circuit with these charges held; nothing of one that gains nothing by it.
    pub fn new(system: &System, held: &[bool]) -> Option<Points> {
        let charges = system.charges();
        let all = vec![Pack::ZERO; system.equations() + charges];
        Some(Points {
            equations: Equations::new(system)?,
            flat: None,
            held: held.to_vec(),
            w: vec![Pack::ZERO; charges],
            targets: vec![Pack::ZERO; charges],
            vector: all.clone(),
            work: all,
        })
    }

    /// Takes the frozen network's factors, where they are such as are solved with in lanes; says whether it has.
    pub fn begin(&mut self, network: &Network) -> bool {
        let (number, flat) = network.frozen_factors();
        let Some(flat) = flat else { return false };
        let known = self.flat.as_mut().is_some_and(|(known, own)| {
            let serves = *known == number || own.put_all(flat);
            *known = number;
            serves
        });
        if !known {
            self.flat = Some((number, flat.abreast()));
        }
        true
    }

    /// Puts a point into a lane, whose charges are those that it is to have; `work` has room for −b.
    pub fn put(&mut self, lane: usize, network: &mut Network, point: &State, work: &mut [f64]) {
        network.begin_residual(point.t, work);
        self.equations.ask(lane, network, (point.t, &point.x), work);
        put_lane(&mut self.w, lane, &point.w);
        put_lane(&mut self.targets, lane, &point.q);
    }

    /// One correction in every lane, as [`correct_frozen`](crate::sim::newton::correct_frozen) makes it.
    pub fn correct(&mut self) {
        self.equations.evaluate();
        let Equations { residual, rates, q, .. } = &mut self.equations;
        rates.add_transposed(Pack::splat(1.0), &self.w, residual);
        let (unknowns, charges) = self.vector.split_at_mut(residual.len());
        unknowns.copy_from_slice(residual);
        for (k, r) in charges.iter_mut().enumerate() {
            *r = if self.held[k] { q[k] - self.targets[k] } else { self.w[k] };
        }
        if let Some((_, flat)) = &self.flat {
            flat.solve(&mut self.vector, &mut self.work);
        }
    }

    /// The correction of a lane: unknowns, then rates.
    pub fn take(&self, lane: usize, correction: &mut [f64]) {
        take_lane(&self.vector, lane, correction);
    }
}
