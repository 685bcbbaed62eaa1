//! What no values of its parts could make solvable in a circuit: found before anything is solved.
//!
//! Up to [`SMALL`] unknowns the matrix W(α) is factorised with slopes drawn at random, which finds everything. Beyond that
//! three searches of linear cost find what happens in practice: a structural rank below the number of equations (a largest
//! matching on the pattern), nodes whose equations speak of differences among themselves only (they float together), and
//! branches that close a loop of voltage sources.

use super::system::System;
use crate::linear::{Cause, Lu, SMALL, Singular, maximum_matching};

/// Most groups that are reported.
const MOST: usize = 8;

/// Whether W(α) can be solved with for some slopes of the laws.
pub(crate) fn check(system: &System) -> Result<(), Singular> {
    let values = drawn(system);
    if system.equations() <= SMALL {
        return Lu::factor(&system.dynamic.pattern, &values).map(|_| ());
    }
    let pattern = &system.dynamic.pattern;
    let matching = maximum_matching(pattern, |slot| values[slot] != 0.0);
    if !matching.is_perfect() {
        return Err(Singular {
            cause: Cause::Structural,
            rows: matching.overdetermined(pattern),
            columns: matching.underdetermined(pattern),
        });
    }
    let mut columns = floating(system, &values);
    columns.extend(loops(system, &values));
    if columns.is_empty() {
        return Ok(());
    }
    columns.truncate(MOST);
    Err(Singular { cause: Cause::Numeric, rows: vec![], columns })
}

/// W(α) with slopes drawn at random, so that one that happens to vanish somewhere is not taken for a fault of the circuit.
fn drawn(system: &System) -> Vec<f64> {
    const ALPHA: f64 = 1e6;
    let plan = &system.dynamic;
    let mut values = plan.fixed.clone();
    for place in &plan.storage {
        values[place.slot as usize] += ALPHA * place.factor;
    }
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        0.5 + (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    for group in &system.groups {
        let slopes: Vec<f64> = (0..group.laws.partials()).map(|_| draw()).collect();
        for place in group.dynamic.iter().chain(&group.dynamic_charge) {
            values[place.slot as usize] += place.factor * slopes[place.partial as usize];
        }
    }
    values
}

/// Sets that grow together.
struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    fn new(n: usize) -> Sets {
        Sets { parent: (0..n as u32).collect() }
    }

    fn root(&mut self, mut k: u32) -> u32 {
        while self.parent[k as usize] != k {
            self.parent[k as usize] = self.parent[self.parent[k as usize] as usize];
            k = self.parent[k as usize];
        }
        k
    }

    /// Whether they were apart before.
    fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// Groups of nodes whose voltages may all be raised by the same without any equation noticing: each row's coefficients of
/// node voltages add up to nothing, or to something, and then it speaks of ground too.
fn floating(system: &System, values: &[f64]) -> Vec<Vec<u32>> {
    let (pattern, nodes) = (&system.dynamic.pattern, system.nodes);
    let n = pattern.n;
    let mut sums = vec![(0.0f64, 0.0f64); n];
    for column in 0..nodes {
        for slot in pattern.column(column) {
            let (sum, size) = &mut sums[pattern.rows[slot] as usize];
            *sum += values[slot];
            *size += values[slot].abs();
        }
    }
    let ground = nodes as u32;
    let mut sets = Sets::new(nodes + 1);
    let mut first: Vec<Option<u32>> = vec![None; n];
    for column in 0..nodes as u32 {
        for slot in pattern.column(column as usize) {
            let row = pattern.rows[slot] as usize;
            let (sum, size) = sums[row];
            if values[slot] == 0.0 {
                continue;
            }
            // The slack is that of rounding in sums of stamps, which are made of equal and opposite numbers.
            if sum.abs() > 1e-12 * size {
                sets.join(column, ground);
            } else if let Some(other) = first[row] {
                sets.join(column, other);
            }
            first[row].get_or_insert(column);
        }
    }
    let home = sets.root(ground);
    let mut groups: Vec<(u32, Vec<u32>)> = vec![];
    let mut place = vec![usize::MAX; nodes + 1];
    for node in 0..nodes as u32 {
        let root = sets.root(node);
        if root == home {
            continue;
        }
        let at = &mut place[root as usize];
        if *at == usize::MAX {
            if groups.len() >= MOST {
                continue;
            }
            *at = groups.len();
            groups.push((root, vec![]));
        }
        groups[*at].1.push(node);
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// Loops of branches whose currents nothing but Kirchhoff's law speaks of.
fn loops(system: &System, values: &[f64]) -> Vec<Vec<u32>> {
    let (pattern, nodes) = (&system.dynamic.pattern, system.nodes);
    let ground = nodes as u32;
    let mut sets = Sets::new(nodes + 1);
    // Branches taken so far, by their ends, to find the way round when one closes a loop.
    let mut taken: Vec<Vec<(u32, u32)>> = vec![vec![]; nodes + 1];
    let mut found = vec![];
    for branch in nodes..pattern.n {
        let mut ends = [ground; 2];
        let mut sum = 0.0;
        let mut count = 0;
        let mut plain = true;
        for slot in pattern.column(branch) {
            let (row, value) = (pattern.rows[slot], values[slot]);
            if value == 0.0 {
                continue;
            }
            plain &= (row as usize) < nodes && value.abs() == 1.0 && count < 2;
            if plain {
                ends[count] = row;
                sum += value;
                count += 1;
            }
        }
        if !plain || count == 0 || (count == 2 && sum != 0.0) {
            continue;
        }
        if sets.join(ends[0], ends[1]) {
            taken[ends[0] as usize].push((ends[1], branch as u32));
            taken[ends[1] as usize].push((ends[0], branch as u32));
        } else if found.len() < MOST {
            let mut way = way(&taken, ends[0], ends[1]);
            way.push(branch as u32);
            way.sort_unstable();
            found.push(way);
        }
    }
    found
}

/// The branches from one node to another in a forest.
fn way(forest: &[Vec<(u32, u32)>], from: u32, to: u32) -> Vec<u32> {
    let mut came = std::collections::HashMap::from([(from, (from, u32::MAX))]);
    let mut queue = std::collections::VecDeque::from([from]);
    while let Some(node) = queue.pop_front() {
        if node == to {
            break;
        }
        for (next, branch) in &forest[node as usize] {
            came.entry(*next).or_insert_with(|| {
                queue.push_back(*next);
                (node, *branch)
            });
        }
    }
    let mut branches = vec![];
    let mut at = to;
    while let Some((before, branch)) = came.get(&at).filter(|(_, branch)| *branch != u32::MAX) {
        branches.push(*branch);
        at = *before;
    }
    branches
}
