//! Square systems of affine forms that are all 0, solved exactly.

use super::draw::Modular;
use super::form::Form;
use crate::linear::{Lu, Pattern, Singular};

/// Equations Form = 0.
#[derive(Clone, Debug)]
pub struct System<F> {
    /// Number of unknowns.
    pub unknowns: usize,
    /// One for each equation.
    pub rows: Vec<Form<F>>,
}

/// Why there is no solution.
#[derive(Clone, Debug)]
pub struct Undetermined {
    /// Unknowns that are not determined.
    pub unknowns: Vec<u32>,
    /// Equations that depend on each other.
    pub rows: Vec<u32>,
}

impl<F: Modular> System<F> {
    /// A new unknown.
    pub fn add(&mut self) -> u32 {
        self.unknowns += 1;
        self.unknowns as u32 - 1
    }

    /// The solution, and the multiplications of the elimination.
    ///
    /// # Errors
    /// What is singular.
    pub fn solve(&self) -> Result<(Vec<F>, usize), Undetermined> {
        let n = self.unknowns.max(self.rows.len());
        let mut triplets = Vec::with_capacity(4 * n);
        for (row, form) in self.rows.iter().enumerate() {
            triplets.extend(form.terms.iter().map(|(column, _)| (row as u32, *column)));
        }
        let (pattern, slots) = Pattern::from_triplets(n, &triplets);
        let mut values = vec![F::ZERO; pattern.len()];
        let factors = self.rows.iter().flat_map(|form| form.terms.iter().map(|(_, a)| *a));
        for (slot, factor) in slots.iter().zip(factors) {
            if let Some(value) = values.get_mut(*slot as usize) {
                *value = *value + factor;
            }
        }
        let factors = Lu::factor(&pattern, &values).map_err(|singular| told(&singular))?;
        let mut solution: Vec<F> = self.rows.iter().map(|form| -form.constant).collect();
        solution.resize(n, F::ZERO);
        factors.solve(&mut solution, &mut vec![F::ZERO; n]);
        Ok((solution, factors.operations()))
    }
}

fn told(singular: &Singular) -> Undetermined {
    let one = |sets: &[Vec<u32>]| {
        let mut all: Vec<u32> = sets.iter().flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    Undetermined { unknowns: one(&singular.columns), rows: one(&singular.rows) }
}
