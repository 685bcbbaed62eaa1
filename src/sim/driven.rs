//! What follows from sources alone: the voltage of a node that a source holds, and what is made of such.
//!
//! A switch whose gate a source drives changes at times that are known beforehand. Then no guard is watched, no crossing
//! sought, and where nothing else sees the source its corners end no step.

use crate::circuit::Waveform;
use crate::circuit::stamps::{Course, Law, Leaf, Stamps};
use crate::expr::Dag;
use std::collections::BTreeMap;

/// So often all equations are gone through: sources stand on one another in short chains.
const MOST_ROUNDS: usize = 8;

/// A sum of sources by number.
type Sum = BTreeMap<u32, f64>;

/// The courses of the modes' controls, where they are known and of straight lines.
pub(super) fn courses(stamps: &Stamps) -> Vec<Option<Course>> {
    if stamps.modes.is_empty() {
        return vec![];
    }
    let driven = driven(stamps);
    stamps.modes.iter().map(|mode| course(stamps, &mode.control, &driven)).collect()
}

/// Whether it consists of straight lines.
fn is_lines(waveform: &Waveform) -> bool {
    match waveform {
        Waveform::Pulse { .. } | Waveform::Pwl(_) | Waveform::Repeating { .. } => true,
        other => other.is_constant(),
    }
}

/// For each unknown the sum of sources that it is, if any.
fn driven(stamps: &Stamps) -> Vec<Option<Sum>> {
    let n = stamps.unknowns.len();
    let mut terms: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); n];
    let mut sources: Vec<Sum> = vec![BTreeMap::new(); n];
    // Equations with more in them than unknowns and sources.
    let mut other = vec![false; n];
    for (row, column, value) in &stamps.conductances {
        *terms[row.0 as usize].entry(column.0).or_insert(0.0) += value;
    }
    for (k, source) in stamps.sources.iter().enumerate() {
        for (row, factor) in &source.into {
            *sources[row.0 as usize].entry(k as u32).or_insert(0.0) += factor;
        }
    }
    let laws = stamps.laws.iter().flat_map(|law| &law.into);
    let charges = stamps.charges.iter().flat_map(|charge| &charge.into);
    let memories = stamps.memories.iter().flat_map(|memory| &memory.into);
    laws.chain(charges).chain(memories).for_each(|(row, _)| other[row.0 as usize] = true);
    let mut found: Vec<Option<Sum>> = vec![None; n];
    for _ in 0..MOST_ROUNDS {
        let mut any = false;
        for row in (0..n).filter(|row| !other[*row]) {
            let mut open = terms[row].iter().filter(|(c, _)| found[**c as usize].is_none());
            let (Some((&column, &pivot)), None) = (open.next(), open.next()) else { continue };
            if pivot == 0.0 {
                continue;
            }
            let mut sum: Sum = sources[row].clone();
            for (c, value) in terms[row].iter().filter(|(c, _)| **c != column) {
                for (source, factor) in found[*c as usize].iter().flatten() {
                    *sum.entry(*source).or_insert(0.0) -= value * factor;
                }
            }
            sum.values_mut().for_each(|factor| *factor /= pivot);
            found[column as usize] = Some(sum);
            any = true;
        }
        if !any {
            break;
        }
    }
    found
}

/// The course of a sum of unknowns that are all driven.
fn course(stamps: &Stamps, control: &Law, driven: &[Option<Sum>]) -> Option<Course> {
    let (constant, factors) = affine(control, stamps.unknowns.len() as u32)?;
    let mut sum = Sum::new();
    for (unknown, factor) in factors {
        for (source, by) in driven.get(unknown as usize)?.as_ref()? {
            *sum.entry(*source).or_insert(0.0) += factor * by;
        }
    }
    let terms = sum.into_iter().map(|(source, factor)| {
        let waveform = &stamps.sources[source as usize].waveform;
        is_lines(waveform).then(|| (factor, waveform.clone()))
    });
    Some(Course { constant, terms: terms.collect::<Option<_>>()? })
}

/// Constant and factors of a law that is affine in what it speaks of: unknowns by their numbers, anything else by `n`.
pub(super) fn affine(law: &Law, n: u32) -> Option<(f64, Vec<(u32, f64)>)> {
    let mut dag = Dag::default();
    let added: Result<_, std::convert::Infallible> = dag.add(law, &mut |dag, leaf, _| {
        Ok(dag.input(match leaf {
            Leaf::Unknown(id) => id.0,
            Leaf::Time | Leaf::Rate(_) | Leaf::Mode(_) => n,
        }))
    });
    let Ok(node) = added;
    dag.affine(node)
}
