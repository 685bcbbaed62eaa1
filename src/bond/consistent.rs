//! Consistent values: efforts, flows and signals that satisfy the equations at one instant.
//!
//! Every question is one square system, each of its rows a·F + b·(y − v) with F a row of the equations:
//! frozen states (y − v), rows as they are (F), an implicit Euler step (y − v − h·g). Newton's method with damping
//! solves it; what depends on hidden variables (index 2) is found from Euler steps of vanishing length.

use super::equations::Compiled;
use super::structure::Structure;
use crate::linear::{Lu, Pattern, Singular};

/// One row of the system: a·F + b·(y[column] − value).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Factor of the equations' own row, a rate for a state.
    pub factor: f64,
    /// Column and value of the other part, if there is one.
    pub fixed: Option<(usize, f64)>,
}

impl Slot {
    /// The equations' row itself.
    pub const OWN: Slot = Slot { factor: 1.0, fixed: None };

    /// y[column] = value.
    pub fn fix(column: usize, value: f64) -> Slot {
        Slot { factor: 0.0, fixed: Some((column, value)) }
    }

    /// y = value + h·rate.
    pub fn euler(column: usize, value: f64, h: f64) -> Slot {
        Slot { factor: -h, fixed: Some((column, value)) }
    }
}

/// Why no values were found.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// The rows contradict each other, or leave something open.
    Singular(Singular),
    /// Newton's method did not converge.
    Diverged {
        /// The row that is off by most.
        row: usize,
    },
}

/// Newton's method stops when each row holds to this part of its terms.
const BACKWARD: f64 = 1e-13;
/// Where it gets no better it may be this one.
const COARSE: f64 = 1e-11;
/// Or, where the terms of a row are 0 but for rounding, when whole steps with a Jacobian that does not change any more
/// leave as much as they took away, so often in a row.
const REFINEMENTS: usize = 2;
const SAME: f64 = 1e-12;
const LEFT: f64 = 4.0;
const ITERATIONS: usize = 200;
const HALVINGS: usize = 40;

/// Solves the system from the guess in `y`.
pub fn newton(
    compiled: &mut Compiled,
    slots: &[Slot],
    t: f64,
    inside: f64,
    y: &mut [f64],
) -> Result<(), Trouble> {
    let n = compiled.n;
    let (pattern, places) = system_pattern(compiled, slots);
    let mut f = vec![0.0; n];
    let mut jacobian = vec![0.0; compiled.pattern.len()];
    let mut values = vec![0.0; pattern.len()];
    let mut lu: Option<Lu<f64>> = None;
    let (mut work, mut trial) = (vec![0.0; n], vec![0.0; n]);
    let mut best = f64::INFINITY;
    let mut worst_row = 0;
    let (mut before, mut taken, mut refined) = (vec![], vec![], 0);
    for _ in 0..ITERATIONS {
        compiled.jacobian(t, inside, y, &mut f, &mut jacobian);
        assemble(compiled, slots, &places, &jacobian, &mut values);
        let mut residual = vec![0.0; n];
        combine(slots, &f, y, &mut residual);
        let (error, row) = backward_error(&pattern, &values, slots, &residual, y);
        worst_row = row;
        if error <= BACKWARD || (error <= COARSE && error >= 0.5 * best) {
            return Ok(());
        }
        let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * b.abs();
        let same = !before.is_empty() && before.iter().zip(&values).all(near);
        refined = if same && !taken.is_empty() { refined + 1 } else { 0 };
        if refined >= REFINEMENTS {
            let terms = row_terms(&pattern, &values, slots, |i| y[i]);
            let left = spread(&pattern, &values, vec![0.0; n], |i| taken[i]);
            let rounding = |i: usize| COARSE * terms[i] + LEFT * left[i];
            if (0..n).all(|i| residual[i].abs() <= rounding(i)) {
                return Ok(());
            }
        }
        before.clone_from(&values);
        best = best.min(error);
        if lu.as_mut().is_none_or(|lu| lu.refactor(&values).is_err()) {
            lu = Some(Lu::factor(&pattern, &values).map_err(Trouble::Singular)?);
        }
        let Some(lu) = &lu else { break };
        let mut step: Vec<f64> = residual.iter().map(|r| -r).collect();
        lu.solve(&mut step, &mut work);
        if step.iter().any(|s| !s.is_finite()) {
            break;
        }
        let weights = row_weights(&pattern, &values, slots, y, &step);
        let merit = |r: &[f64]| -> f64 {
            r.iter().zip(&weights).map(|(r, w)| if *w > 0.0 { (r / w).powi(2) } else { 0.0 }).sum()
        };
        let start = merit(&residual);
        let mut length = 1.0;
        let mut better = false;
        for _ in 0..HALVINGS {
            for i in 0..n {
                trial[i] = y[i] + length * step[i];
            }
            compiled.residual(t, inside, &trial, &mut f);
            combine(slots, &f, &trial, &mut residual);
            let now = merit(&residual);
            better = now.is_finite() && (now <= start * (1.0 - 0.25 * length) || now < 1e-26);
            if better {
                break;
            }
            length *= 0.5;
        }
        if !better && same {
            // Rounding is all that there is to be improved.
            length = 1.0;
            y.iter_mut().zip(&step).for_each(|(y, step)| *y += step);
        } else {
            y.copy_from_slice(&trial);
        }
        taken = if length == 1.0 { step } else { vec![] };
    }
    Err(Trouble::Diverged { row: worst_row })
}

/// Newton's method from the guess, then from others: what is singular or has no slope at 0 may be sound beside it.
pub fn newton_from_anywhere(
    compiled: &mut Compiled,
    slots: &[Slot],
    t: f64,
    inside: f64,
    y: &mut [f64],
) -> Result<(), Trouble> {
    let mut first = None;
    for attempt in 0..6 {
        let mut trial = y.to_vec();
        if attempt > 0 {
            let size = 10f64.powi(3 - 3 * attempt);
            let mut seed = 0x9e37_79b9_7f4a_7c15u64.wrapping_mul(attempt as u64);
            for value in &mut trial {
                if *value == 0.0 {
                    *value = size * random_sign(&mut seed);
                }
            }
        }
        match newton(compiled, slots, t, inside, &mut trial) {
            Ok(()) => {
                y.copy_from_slice(&trial);
                return Ok(());
            }
            Err(trouble) => first = first.or(Some(trouble)),
        }
    }
    // Where a condition's sides both lead back to it, what holds lies between them.
    if compiled.ramp_free(1.0) {
        let mut trial = y.to_vec();
        let mut last = Ok(());
        for narrower in 0..10 {
            compiled.ramp_free(10f64.powi(narrower));
            last = newton(compiled, slots, t, inside, &mut trial);
            if last.is_err() {
                break;
            }
        }
        compiled.ramp_free(0.0);
        if last.is_ok() {
            y.copy_from_slice(&trial);
            return Ok(());
        }
    }
    Err(first.unwrap_or(Trouble::Diverged { row: 0 }))
}

/// A number of ±(0.5 .. 1.5).
pub fn random_sign(seed: &mut u64) -> f64 {
    // Xorshift of Marsaglia (2003).
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    let size = 0.5 + (*seed >> 11) as f64 / (1u64 << 53) as f64;
    if *seed & 1024 == 0 { size } else { -size }
}

/// With the states in `y` kept, finds everything else at time `t` within the segment that holds `inside`. Index-2
/// unknowns come from implicit Euler steps of lengths below `horizon`, the time to the next corner. States that
/// violate a constraint (a source jumps across a storage) are moved as an impulse would move them.
pub fn settle(
    compiled: &mut Compiled,
    structure: &Structure,
    t: f64,
    inside: f64,
    horizon: f64,
    y: &mut [f64],
) -> Result<(), Trouble> {
    if structure.constraints.is_empty() {
        let slots: Vec<Slot> = (0..compiled.n)
            .map(|i| if i < compiled.states { Slot::fix(i, y[i]) } else { Slot::OWN })
            .collect();
        return newton_from_anywhere(compiled, &slots, t, inside, y);
    }
    let mut off = false;
    {
        // Do the states satisfy their constraints?
        let mut free = y.to_vec();
        newton_from_anywhere(
            compiled,
            &free_dependents(compiled, structure, y),
            t,
            inside,
            &mut free,
        )?;
        for constraint in &structure.constraints {
            let (was, is) = (y[constraint.dependent], free[constraint.dependent]);
            let size = was.abs().max(is.abs());
            off |= (was - is).abs() > 1e-7 * size && size > 1e-250;
        }
        if !off {
            y[compiled.states..].copy_from_slice(&free[compiled.states..]);
        }
    }
    if off {
        let h = 1e-10 * horizon;
        let slots = euler(compiled, y, h);
        newton_from_anywhere(compiled, &slots, t, inside, y)?;
        let mut free = y.to_vec();
        newton_from_anywhere(
            compiled,
            &free_dependents(compiled, structure, y),
            t,
            inside,
            &mut free,
        )?;
        y[compiled.states..].copy_from_slice(&free[compiled.states..]);
    }
    hidden(compiled, structure, t, inside, horizon, y)
}

/// Slots that keep the independent states of `y`, free the dependent ones and pin the hidden unknowns instead.
pub fn free_dependents(compiled: &Compiled, structure: &Structure, y: &[f64]) -> Vec<Slot> {
    let mut slots: Vec<Slot> = (0..compiled.n)
        .map(|i| if i < compiled.states { Slot::fix(i, y[i]) } else { Slot::OWN })
        .collect();
    for (constraint, hidden) in structure.constraints.iter().zip(&structure.hidden) {
        slots[constraint.dependent] = Slot::fix(*hidden, y[*hidden]);
    }
    slots
}

fn euler(compiled: &Compiled, y: &[f64], h: f64) -> Vec<Slot> {
    (0..compiled.n)
        .map(|i| if i < compiled.states { Slot::euler(i, y[i], h) } else { Slot::OWN })
        .collect()
}

/// Index-2 unknowns by Euler steps of lengths h and h/2, extrapolated to 0; of several h the one that agrees best with
/// the next.
pub fn hidden(
    compiled: &mut Compiled,
    structure: &Structure,
    t: f64,
    inside: f64,
    horizon: f64,
    y: &mut [f64],
) -> Result<(), Trouble> {
    let mut previous: Option<Vec<f64>> = None;
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut last = Ok(());
    for exponent in 2..10 {
        let h = horizon * 10f64.powi(-exponent);
        let mut step = |h: f64| -> Result<Vec<f64>, Trouble> {
            let mut end = y.to_vec();
            newton(compiled, &euler(compiled, y, h), t + h, inside, &mut end)?;
            Ok(end)
        };
        let values = match (step(h), step(0.5 * h)) {
            (Ok(whole), Ok(half)) => whole
                .iter()
                .zip(&half)
                .map(|(whole, half)| 2.0 * half - whole)
                .collect::<Vec<f64>>(),
            (Err(trouble), _) | (_, Err(trouble)) => {
                last = Err(trouble);
                continue;
            }
        };
        if let Some(previous) = &previous {
            let scale = |i: usize| values[i].abs().max(y[i].abs());
            let largest =
                (0..compiled.n).filter(|i| structure.index_two[*i]).map(scale).fold(0.0, f64::max);
            let difference = (0..compiled.n)
                .filter(|i| structure.index_two[*i])
                .map(|i| (values[i] - previous[i]).abs() / (scale(i) + 1e-6 * largest + 1e-300))
                .fold(0.0, f64::max);
            if best.as_ref().is_none_or(|(so_far, _)| difference < *so_far) {
                best = Some((difference, values.clone()));
            }
        }
        previous = Some(values);
    }
    match best {
        Some((_, values)) => {
            for i in compiled.states..compiled.n {
                if structure.index_two[i] {
                    y[i] = values[i];
                }
            }
            Ok(())
        }
        None => last,
    }
}

/// The pattern of the system: of each row its own part where it has one, and its fixed column.
fn system_pattern(compiled: &Compiled, slots: &[Slot]) -> (Pattern, Vec<Option<u32>>) {
    let mut triplets = vec![];
    let mut own = vec![];
    for column in 0..compiled.n {
        for slot in compiled.pattern.column(column) {
            let row = compiled.pattern.rows[slot];
            own.push(slots[row as usize].factor != 0.0);
            if slots[row as usize].factor != 0.0 {
                triplets.push((row, column as u32));
            }
        }
    }
    for (row, slot) in slots.iter().enumerate() {
        if let Some((column, _)) = slot.fixed {
            triplets.push((row as u32, column as u32));
        }
    }
    let (pattern, places) = Pattern::from_triplets(compiled.n, &triplets);
    let mut places = places.into_iter();
    let mut result: Vec<Option<u32>> =
        own.into_iter().map(|own| if own { places.next() } else { None }).collect();
    result.extend(places.map(Some));
    (pattern, result)
}

fn assemble(
    compiled: &Compiled,
    slots: &[Slot],
    places: &[Option<u32>],
    jacobian: &[f64],
    values: &mut [f64],
) {
    values.fill(0.0);
    for ((entry, row), place) in jacobian.iter().zip(&compiled.pattern.rows).zip(places) {
        if let Some(place) = place {
            values[*place as usize] += slots[*row as usize].factor * entry;
        }
    }
    for place in places[jacobian.len()..].iter().flatten() {
        values[*place as usize] += 1.0;
    }
}

fn combine(slots: &[Slot], f: &[f64], y: &[f64], residual: &mut [f64]) {
    for (i, slot) in slots.iter().enumerate() {
        residual[i] = if slot.factor == 0.0 { 0.0 } else { slot.factor * f[i] };
        if let Some((column, value)) = slot.fixed {
            residual[i] += y[column] - value;
        }
    }
}

/// Σ |entry·y| of each row, and what is fixed in it.
fn row_terms(
    pattern: &Pattern,
    values: &[f64],
    slots: &[Slot],
    y: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let fixed = slots.iter().map(|slot| slot.fixed.map_or(0.0, |(_, value)| value.abs()));
    spread(pattern, values, fixed.collect(), y)
}

/// Adds Σ |entry·y| to the sum of each row.
fn spread(
    pattern: &Pattern,
    values: &[f64],
    mut sums: Vec<f64>,
    y: impl Fn(usize) -> f64,
) -> Vec<f64> {
    for column in 0..pattern.n {
        for slot in pattern.column(column) {
            sums[pattern.rows[slot] as usize] += (values[slot] * y(column)).abs();
        }
    }
    sums
}

fn row_weights(
    pattern: &Pattern,
    values: &[f64],
    slots: &[Slot],
    y: &[f64],
    step: &[f64],
) -> Vec<f64> {
    row_terms(pattern, values, slots, |i| y[i].abs() + step[i].abs())
}

fn backward_error(
    pattern: &Pattern,
    values: &[f64],
    slots: &[Slot],
    residual: &[f64],
    y: &[f64],
) -> (f64, usize) {
    let terms = row_terms(pattern, values, slots, |i| y[i]);
    let mut worst = (0.0, 0);
    for (row, (r, terms)) in residual.iter().zip(&terms).enumerate() {
        let error = if *r == 0.0 { 0.0 } else { r.abs() / terms.max(f64::MIN_POSITIVE) };
        if error > worst.0 || error.is_nan() {
            worst = (if error.is_nan() { f64::INFINITY } else { error }, row);
        }
    }
    worst
}
