//! Which storages resonate with each other, at which frequency, and what damps them.
//!
//! ```text
//! x_i' = a_ii·x_i + a_ij·x_j        ω² = −a_ij·a_ji        ζ = −(a_ii + a_jj)/2ω
//! x_j' = a_ji·x_i + a_jj·x_j
//! ```
//!
//! Two storages that drive each other round a causal loop of negative gain a_ij·a_ji/s² resonate, as if they were alone:
//! an I with a C, two of a kind through a gyrator. What damps them is asked of the dissipators one by one: how much ζ moves
//! with the slope of each law.

use super::linear::Linear;
use super::state_space::state_space;
use crate::bond::equations::{Origin, Unknown};
use crate::bond::graph::{BondGraph, Law, VertexId};
use crate::diagnostic::Diagnostic;

/// A pair of storages that resonate.
#[derive(Clone, Debug, PartialEq)]
pub struct Resonance {
    /// The two unknowns.
    pub storages: [usize; 2],
    /// ω, rad/s, of the two alone.
    pub omega: f64,
    /// ζ of the two alone.
    pub damping: f64,
    /// The dissipators that make ζ, the largest part first: ∂ζ/∂ln R by size.
    pub damped_by: Vec<(VertexId, f64)>,
}

/// Slopes are changed by this part.
const STEP: f64 = 1e-4;
/// A dissipator that makes less than this part of what the strongest makes is not told.
const LEAST: f64 = 0.05;

/// All pairs, by frequency.
///
/// # Errors
/// When the model has no states to be told at this point.
pub fn resonances(graph: &BondGraph, linear: &Linear) -> Result<Vec<Resonance>, Box<Diagnostic>> {
    let space = state_space(linear)?;
    let stores = |at: usize| {
        let unknown = space.unknowns[at];
        let holds = matches!(linear.kinds[unknown], Unknown::Stored(_) | Unknown::Rated(_));
        holds && linear.stores(unknown)
    };
    let pairs = (0..space.a.len()).filter(|i| stores(*i)).flat_map(|j| (0..j).map(move |i| (i, j)));
    let pairs: Vec<(usize, usize)> =
        pairs.filter(|(i, j)| stores(*i) && space.a[*i][*j] * space.a[*j][*i] < 0.0).collect();
    let alone = |a: &[Vec<f64>], (i, j): (usize, usize)| {
        let omega = (-a[i][j] * a[j][i]).sqrt();
        (omega, -(a[i][i] + a[j][j]) / (2.0 * omega))
    };
    let mut found: Vec<Resonance> = pairs
        .iter()
        .map(|(i, j)| {
            let (omega, damping) = alone(&space.a, (*i, *j));
            let storages = [space.unknowns[*i], space.unknowns[*j]];
            Resonance { storages, omega, damping, damped_by: vec![] }
        })
        .collect();
    for (row, origin) in linear.origins.iter().enumerate() {
        let Origin::Vertex(id) = origin else { continue };
        if !matches!(graph.vertex(*id).law, Law::Dissipator(_)) || linear.rows[row].len() < 2 {
            continue;
        }
        let mut moved = linear.clone();
        let given = moved.gives[row];
        for (_, entry) in moved.rows[row].iter_mut().filter(|(k, _)| *k != given) {
            entry.value *= 1.0 + STEP;
        }
        let Ok(other) = state_space(&moved) else { continue };
        if other.unknowns != space.unknowns {
            continue;
        }
        for (resonance, pair) in found.iter_mut().zip(&pairs) {
            let (_, damping) = alone(&other.a, *pair);
            let slope = ((damping - resonance.damping) / STEP).abs();
            if slope > 1e-9 * resonance.damping.abs() {
                resonance.damped_by.push((*id, slope));
            }
        }
    }
    for resonance in &mut found {
        resonance.damped_by.sort_by(|a, b| b.1.total_cmp(&a.1));
        let most = resonance.damped_by.first().map_or(0.0, |first| first.1);
        resonance.damped_by.retain(|(_, slope)| *slope >= LEAST * most);
    }
    found.sort_by(|a, b| a.omega.total_cmp(&b.omega));
    Ok(found)
}
