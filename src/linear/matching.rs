//! Structural matching of rows with columns (Hopcroft and Karp, 1973): which systems no values can make solvable.

use super::Pattern;

const NONE: u32 = u32::MAX;

/// A largest set of entries of which no two share a row or a column.
#[derive(Clone, Debug)]
pub struct Matching {
    /// The row of each column, `u32::MAX` where there is none.
    pub row_of: Vec<u32>,
    /// The column of each row, `u32::MAX` where there is none.
    pub column_of: Vec<u32>,
}

impl Matching {
    /// Whether every row has its column.
    pub fn is_perfect(&self) -> bool {
        self.row_of.iter().all(|&row| row != NONE)
    }

    /// For each row left over, the equations that together speak of fewer unknowns than they are.
    pub fn overdetermined(&self, pattern: &Pattern) -> Vec<Vec<u32>> {
        reaches(&pattern.transposed(), &self.column_of, &self.row_of)
    }

    /// For each column left over, the unknowns that together stand in fewer equations than they are.
    pub fn underdetermined(&self, pattern: &Pattern) -> Vec<Vec<u32>> {
        reaches(pattern, &self.row_of, &self.column_of)
    }
}

/// From each line without a partner along alternating paths, at most [`MOST`] of them.
fn reaches(lines: &Pattern, partner: &[u32], back: &[u32]) -> Vec<Vec<u32>> {
    const MOST: usize = 32;
    let lonely = (0..lines.n).filter(|&line| partner[line] == NONE).take(MOST);
    let mut seen = vec![NONE; lines.n];
    lonely
        .map(|start| {
            let mut found = vec![start as u32];
            seen[start] = start as u32;
            let mut at = 0;
            while let Some(&line) = found.get(at) {
                at += 1;
                for slot in lines.column(line as usize) {
                    let next = back[lines.rows[slot] as usize];
                    if next != NONE && seen[next as usize] != start as u32 {
                        seen[next as usize] = start as u32;
                        found.push(next);
                    }
                }
            }
            found.sort_unstable();
            found
        })
        .collect()
}

/// A maximum matching that keeps as many entries with `preferred(slot)` of a first greedy pass as it can: diagonals
/// that are not small make good pivots.
pub fn maximum_matching(pattern: &Pattern, preferred: impl Fn(usize) -> bool) -> Matching {
    let n = pattern.n;
    let mut matching = Matching { row_of: vec![NONE; n], column_of: vec![NONE; n] };
    for j in 0..n {
        if let Some(slot) = pattern.slot(j as u32, j as u32)
            && preferred(slot)
        {
            matching.row_of[j] = j as u32;
            matching.column_of[j] = j as u32;
        }
    }
    for pass in [true, false] {
        for j in 0..n {
            if matching.row_of[j] != NONE {
                continue;
            }
            let free = pattern.column(j).find(|&slot| {
                matching.column_of[pattern.rows[slot] as usize] == NONE
                    && (!pass || preferred(slot))
            });
            if let Some(slot) = free {
                matching.row_of[j] = pattern.rows[slot];
                matching.column_of[pattern.rows[slot] as usize] = j as u32;
            }
        }
    }
    let mut level = vec![0u32; n];
    let mut queue = Vec::with_capacity(n);
    let mut next = vec![0u32; n];
    while layer(pattern, &matching, &mut level, &mut queue) {
        for (j, next) in next.iter_mut().enumerate() {
            *next = pattern.starts[j];
        }
        for j in 0..n {
            if matching.row_of[j] == NONE {
                augment(pattern, &mut matching, &mut level, &mut next, j as u32);
            }
        }
    }
    matching
}

/// Distances of columns from those without a row, along alternating paths; whether a row without a column is reached.
fn layer(pattern: &Pattern, matching: &Matching, level: &mut [u32], queue: &mut Vec<u32>) -> bool {
    queue.clear();
    for (j, level) in level.iter_mut().enumerate() {
        *level = if matching.row_of[j] == NONE { 0 } else { NONE };
        if *level == 0 {
            queue.push(j as u32);
        }
    }
    let mut reached = false;
    let mut at = 0;
    while let Some(&j) = queue.get(at) {
        at += 1;
        for slot in pattern.column(j as usize) {
            let other = matching.column_of[pattern.rows[slot] as usize];
            if other == NONE {
                reached = true;
            } else if level[other as usize] == NONE {
                level[other as usize] = level[j as usize] + 1;
                queue.push(other);
            }
        }
    }
    reached
}

/// Depth first from a column down the layers to a row without a column; swaps the path when it is found.
fn augment(
    pattern: &Pattern,
    matching: &mut Matching,
    level: &mut [u32],
    next: &mut [u32],
    from: u32,
) {
    let mut path = vec![from];
    while let Some(&j) = path.last() {
        let j = j as usize;
        if next[j] == pattern.starts[j + 1] {
            level[j] = NONE;
            path.pop();
            continue;
        }
        let row = pattern.rows[next[j] as usize];
        let other = matching.column_of[row as usize];
        if other == NONE {
            // Each column on the path takes the row that it looks at, which the column after it gives up.
            for &column in &path {
                let row = pattern.rows[next[column as usize] as usize];
                matching.row_of[column as usize] = row;
                matching.column_of[row as usize] = column;
                level[column as usize] = NONE;
            }
            return;
        }
        if level[other as usize] != NONE && level[other as usize] == level[j] + 1 {
            path.push(other);
        } else {
            next[j] += 1;
        }
    }
}
