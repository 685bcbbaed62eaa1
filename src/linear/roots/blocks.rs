//! A pencil as blocks of which each leads to the next: its roots are those of the blocks.
//!
//! With rows and columns in the right order G + s·C is block triangular whatever s is, and its determinant the product of
//! the blocks' own. So parts of a model that do not act on each other, or only one way, are solved apart: faster, and equal
//! parts have equal roots to the last digit, where together they make one of a multiplicity that rounding tears apart.
//! (I. S. Duff, J. K. Reid, *An implementation of Tarjan's algorithm for the block triangularization of a matrix*, 1978.)

use super::{Root, size};
use crate::linear::{Complex, Pattern, components, maximum_matching};

/// Entries: row, column, value.
pub type Triplets = Vec<(u32, u32, f64)>;

/// One block, its rows and columns numbered from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    pub n: usize,
    pub fixed: Triplets,
    pub storage: Triplets,
}

/// Roots of different blocks that differ by less than this part are told as one: the same part written twice.
const SAME: f64 = 1e-12;

/// The blocks of G + s·C; one alone where rows and columns do not pair.
pub fn blocks(n: usize, fixed: &[(u32, u32, f64)], storage: &[(u32, u32, f64)]) -> Vec<Block> {
    let entries = fixed.iter().chain(storage).filter(|(_, _, value)| *value != 0.0);
    let places: Vec<(u32, u32)> = entries.map(|(row, column, _)| (*row, *column)).collect();
    let (pattern, _) = Pattern::from_triplets(n, &places);
    let matching = maximum_matching(&pattern, |_| true);
    if !matching.is_perfect() {
        return vec![Block { n, fixed: fixed.to_vec(), storage: storage.to_vec() }];
    }
    // A column leads to those that its rows are paired with.
    let leads: Vec<u32> =
        pattern.rows.iter().map(|row| matching.column_of[*row as usize]).collect();
    let sets = components(n, &|column| &leads[pattern.column(column)]);
    let (mut block_of, mut place) = (vec![0u32; n], vec![[0u32; 2]; n]);
    for (number, columns) in sets.iter().enumerate() {
        let mut rows: Vec<u32> = columns.iter().map(|c| matching.row_of[*c as usize]).collect();
        rows.sort_unstable();
        for (at, (row, column)) in rows.iter().zip(columns).enumerate() {
            block_of[*column as usize] = number as u32;
            place[*row as usize][0] = at as u32;
            place[*column as usize][1] = at as u32;
        }
    }
    let empty = |columns: &Vec<u32>| Block { n: columns.len(), fixed: vec![], storage: vec![] };
    let mut all: Vec<Block> = sets.iter().map(empty).collect();
    for (list, is_storage) in [(fixed, false), (storage, true)] {
        for (row, column, value) in list {
            let own = block_of[*column as usize];
            // What stands outside of the blocks has no part in the determinant.
            if block_of[matching.column_of[*row as usize] as usize] == own {
                let block = &mut all[own as usize];
                let into = if is_storage { &mut block.storage } else { &mut block.fixed };
                into.push((place[*row as usize][0], place[*column as usize][1], *value));
            }
        }
    }
    all
}

/// Makes one of roots that blocks have in common.
pub fn merge(roots: Vec<Root>) -> Vec<Root> {
    let mut merged: Vec<Root> = vec![];
    for root in roots {
        let same = |known: &&mut Root| {
            let off = size(Complex::new(known.at.re - root.at.re, known.at.im - root.at.im));
            off <= SAME * size(root.at)
        };
        match merged.iter_mut().find(same) {
            Some(known) => known.multiplicity += root.multiplicity,
            None => merged.push(root),
        }
    }
    merged
}
