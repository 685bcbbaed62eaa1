//! Where every value goes in the two matrices of a system: their patterns, and a place for each partial derivative.

use super::sparse::Rows;
use super::system::{LawGroup, MatrixPlan, Place, Target};
use crate::linear::Pattern;

/// A system's static parts.
#[derive(Clone, Copy)]
pub(crate) struct Parts<'a> {
    /// Number of equations.
    pub n: usize,
    /// Number of nodes among the unknowns, which come first.
    pub nodes: usize,
    /// The input that time is.
    pub time: usize,
    pub conductances: &'a Rows,
    pub charges: &'a Rows,
    pub rates: &'a Rows,
}

/// The plans of both matrices; see [`System`](super::System).
pub(crate) struct Plans {
    pub dynamic: MatrixPlan,
    pub frozen: MatrixPlan,
    /// Slots of the nodes' diagonal entries, and of each charge's own w.
    pub node_slots: Vec<u32>,
    pub free_slots: Vec<u32>,
}

/// Above so many equations each matrix is planned by a thread of its own.
const LARGE: usize = 50_000;

/// Plans both matrices, and tells the groups of laws their places.
pub(crate) fn plan(parts: &Parts, groups: &mut [LawGroup]) -> Plans {
    let ((dynamic, places), frozen) = {
        let groups = &*groups;
        if parts.n < LARGE {
            (plan_dynamic(parts, groups), plan_frozen(parts, groups))
        } else {
            std::thread::scope(|scope| {
                let beside = std::thread::Builder::new();
                let beside = beside.spawn_scoped(scope, || plan_dynamic(parts, groups));
                let frozen = plan_frozen(parts, groups);
                // Where there is no thread to be had, one does both.
                let dynamic = beside.ok().and_then(|thread| thread.join().ok());
                (dynamic.unwrap_or_else(|| plan_dynamic(parts, groups)), frozen)
            })
        }
    };
    for ((group, places), (frozen, frozen_charge)) in
        groups.iter_mut().zip(places).zip(frozen.groups)
    {
        let Dynamic { dynamic, dynamic_charge, by_time, charge_slopes } = places;
        (group.dynamic, group.dynamic_charge) = (dynamic, dynamic_charge);
        (group.by_time, group.charge_slopes) = (by_time, charge_slopes);
        (group.frozen, group.frozen_charge) = (frozen, frozen_charge);
    }
    let Frozen { plan, node_slots, free_slots, .. } = frozen;
    Plans { dynamic, frozen: plan, node_slots, free_slots }
}

/// What a group of laws has in the dynamic matrix.
#[derive(Default)]
struct Dynamic {
    dynamic: Vec<Place>,
    dynamic_charge: Vec<Place>,
    by_time: Vec<(u32, u32, f64)>,
    charge_slopes: Vec<(u32, u32, u32)>,
}

/// What a group of laws has in the frozen matrix: places in equations, and with their charges those in charges.
type FrozenPlaces = (Vec<Place>, Vec<(u32, Place)>);

struct Frozen {
    plan: MatrixPlan,
    node_slots: Vec<u32>,
    free_slots: Vec<u32>,
    groups: Vec<FrozenPlaces>,
}

/// Places of a matrix while its pattern is collected.
struct Plan {
    triplets: Vec<(u32, u32)>,
}

impl Plan {
    fn with_capacity(places: usize) -> Plan {
        Plan { triplets: Vec::with_capacity(places) }
    }

    /// Asks for a place; its number stands for the slot until the pattern is known.
    fn ask(&mut self, row: usize, column: usize) -> u32 {
        self.triplets.push((row as u32, column as u32));
        self.triplets.len() as u32 - 1
    }
}

/// W(α) = G + f' + α·A·(C + q').
fn plan_dynamic(parts: &Parts, groups: &[LawGroup]) -> (MatrixPlan, Vec<Dynamic>) {
    let Parts { n, time, conductances, charges, rates, .. } = *parts;
    let (static_count, moving) = (conductances.entries(), rates.entries());
    let mut plan = Plan::with_capacity(static_count + 2 * moving);
    let mut fixed: Vec<(u32, f64)> = Vec::with_capacity(static_count);
    for (row, column, value) in conductances.triplets() {
        fixed.push((plan.ask(row, column), value));
    }
    let mut storage: Vec<Place> = Vec::with_capacity(2 * moving);
    for (k, equation, sign) in rates.triplets() {
        for (column, value) in charges.row(k) {
            let slot = plan.ask(equation, column);
            storage.push(Place { partial: k as u32, slot, factor: sign * value });
        }
    }
    let mut all: Vec<Dynamic> = vec![];
    for LawGroup { laws, targets, .. } in groups {
        let mut places = Dynamic::default();
        let Dynamic { dynamic, dynamic_charge, by_time, charge_slopes } = &mut places;
        for (o, target) in targets.iter().enumerate() {
            for p in laws.row(o) {
                let (input, partial) = (laws.input(p), p as u32);
                match target {
                    Target::Equations(into) => {
                        for (row, factor) in into {
                            if input == time {
                                by_time.push((partial, *row, *factor));
                            } else {
                                let slot = plan.ask(*row as usize, input);
                                dynamic.push(Place { partial, slot, factor: *factor });
                            }
                        }
                    }
                    Target::Charge(k) if input < n => {
                        charge_slopes.push((partial, *k, input as u32));
                        for (row, factor) in rates.row(*k as usize) {
                            let slot = plan.ask(row, input);
                            dynamic_charge.push(Place { partial, slot, factor });
                        }
                    }
                    Target::Charge(_) => {}
                }
            }
        }
        all.push(places);
    }
    let (pattern, slots) = Pattern::from_triplets(n, &plan.triplets);
    let settle = |place: &mut Place| place.slot = slots[place.slot as usize];
    for places in &mut all {
        places.dynamic.iter_mut().for_each(settle);
        places.dynamic_charge.iter_mut().for_each(settle);
    }
    storage.iter_mut().for_each(settle);
    let fixed = settled(&pattern, &slots, &fixed);
    (MatrixPlan { pattern, fixed, storage }, all)
}

/// The frozen network, with the slots of the nodes' diagonal entries and of each charge's own w.
fn plan_frozen(parts: &Parts, groups: &[LawGroup]) -> Frozen {
    let Parts { n, nodes, conductances, charges, rates, .. } = *parts;
    let (static_count, moving) = (conductances.entries(), rates.entries());
    let count = charges.len();
    let mut plan = Plan::with_capacity(static_count + moving + charges.entries() + nodes + count);
    let mut fixed: Vec<(u32, f64)> = Vec::with_capacity(static_count + moving);
    for (row, column, value) in conductances.triplets() {
        fixed.push((plan.ask(row, column), value));
    }
    for (k, equation, sign) in rates.triplets() {
        fixed.push((plan.ask(equation, n + k), sign));
    }
    let mut storage: Vec<Place> = Vec::with_capacity(charges.entries());
    for (k, column, value) in charges.triplets() {
        let slot = plan.ask(n + k, column);
        storage.push(Place { partial: k as u32, slot, factor: value });
    }
    let mut groups_places: Vec<FrozenPlaces> = vec![];
    for LawGroup { laws, targets, .. } in groups {
        let (mut frozen, mut frozen_charge) = (vec![], vec![]);
        for (o, target) in targets.iter().enumerate() {
            for p in laws.row(o) {
                let (input, partial) = (laws.input(p), p as u32);
                match target {
                    _ if input >= n => {}
                    Target::Equations(into) => {
                        for (row, factor) in into {
                            let slot = plan.ask(*row as usize, input);
                            frozen.push(Place { partial, slot, factor: *factor });
                        }
                    }
                    Target::Charge(k) => {
                        let slot = plan.ask(n + *k as usize, input);
                        frozen_charge.push((*k, Place { partial, slot, factor: 1.0 }));
                    }
                }
            }
        }
        groups_places.push((frozen, frozen_charge));
    }
    let node_slots: Vec<u32> = (0..nodes).map(|node| plan.ask(node, node)).collect();
    let free_slots: Vec<u32> = (0..count).map(|k| plan.ask(n + k, n + k)).collect();
    let (pattern, slots) = Pattern::from_triplets(n + count, &plan.triplets);
    let settle = |place: &mut Place| place.slot = slots[place.slot as usize];
    for (frozen, frozen_charge) in &mut groups_places {
        frozen.iter_mut().for_each(settle);
        frozen_charge.iter_mut().for_each(|(_, place)| settle(place));
    }
    storage.iter_mut().for_each(settle);
    let fixed = settled(&pattern, &slots, &fixed);
    let settle_all = |asked: Vec<u32>| asked.iter().map(|a| slots[*a as usize]).collect();
    Frozen {
        plan: MatrixPlan { pattern, fixed, storage },
        node_slots: settle_all(node_slots),
        free_slots: settle_all(free_slots),
        groups: groups_places,
    }
}

fn settled(pattern: &Pattern, slots: &[u32], fixed: &[(u32, f64)]) -> Vec<f64> {
    let mut values = vec![0.0; pattern.len()];
    for (asked, value) in fixed {
        values[slots[*asked as usize] as usize] += value;
    }
    values
}
