//! What of a matrix solves itself: rows with one unknown left, columns with one equation left.
//!
//! A row with one entry gives its unknown, which is then known in all other rows; a column with one entry leaves its
//! equation to the end, when all else is known. Both go on until nothing of the kind is left: the *core*. Nothing fills
//! in and nothing grows, so that a pivot need only not be zero. The branch of a source goes so, with its node; and of the
//! frozen network all goes so but loops and cutsets, since charges give voltages and those the currents.

use super::Pattern;

const NONE: u32 = u32::MAX;

/// One step of substitution: `pivot`, then its other entries in the arrays beside.
#[derive(Clone, Copy, Debug)]
struct Step {
    row: u32,
    column: u32,
    /// Where its entries end.
    end: u32,
}

/// The steps before and after the core, and the core's rows and columns.
#[derive(Clone, Debug)]
pub struct Singletons {
    /// Rows with one unknown, in order: (other row of the column, …).
    before: Vec<Step>,
    /// Columns with one equation, the last one first: (other column of the row, …).
    after: Vec<Step>,
    /// The pivot of each step (whose index says nothing), then its entries.
    index: Vec<u32>,
    values: Vec<f64>,
    /// Slot of each.
    slots: Vec<u32>,
    /// Slots that were 0, and must stay so.
    zeros: Vec<u32>,
    /// Rows and columns of the core, ascending.
    pub rows: Vec<u32>,
    pub columns: Vec<u32>,
    /// Slots of the core, column by column.
    pub core: Vec<u32>,
}

/// Why factors cannot be made of new values as they were of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// There is an entry where there was none.
    Entry,
    /// A pivot is of no use, or the matrix no longer symmetric.
    Values,
}

/// Which lines of one kind are left: how many entries each has, and what their slots add up to by exclusive or, which is
/// the slot itself where there is one.
struct Lines {
    count: Vec<u32>,
    slots: Vec<u32>,
    gone: Vec<bool>,
}

impl Lines {
    fn new(n: usize) -> Lines {
        Lines { count: vec![0; n], slots: vec![0; n], gone: vec![false; n] }
    }

    fn add(&mut self, line: u32, slot: u32) {
        self.count[line as usize] += 1;
        self.slots[line as usize] ^= slot;
    }

    /// Takes an entry out; says whether one is left.
    fn take(&mut self, line: u32, slot: u32) -> bool {
        self.count[line as usize] -= 1;
        self.slots[line as usize] ^= slot;
        self.count[line as usize] == 1
    }
}

impl Singletons {
    /// Finds them. Entries that are 0 count as none unless they are to be kept.
    pub fn find(pattern: &Pattern, values: &[f64], keep_zeros: bool) -> Singletons {
        let n = pattern.n;
        let there = |slot: usize| keep_zeros || values[slot] != 0.0;
        // Entries row by row, as slots.
        let mut starts = vec![0u32; n + 1];
        let mut zeros = vec![];
        for (slot, &row) in pattern.rows.iter().enumerate() {
            if there(slot) {
                starts[row as usize + 1] += 1;
            } else {
                zeros.push(slot as u32);
            }
        }
        for row in 0..n {
            starts[row + 1] += starts[row];
        }
        let mut by_row = vec![0u32; starts[n] as usize];
        let mut column_of = vec![0u32; pattern.len()];
        let mut next = starts.clone();
        let (mut rows, mut columns) = (Lines::new(n), Lines::new(n));
        for j in 0..n {
            for slot in pattern.column(j) {
                column_of[slot] = j as u32;
                if there(slot) {
                    let row = pattern.rows[slot];
                    by_row[next[row as usize] as usize] = slot as u32;
                    next[row as usize] += 1;
                    rows.add(row, slot as u32);
                    columns.add(j as u32, slot as u32);
                }
            }
        }
        drop(next);
        let (before, after) =
            peel(pattern, &mut rows, &mut columns, &starts, &by_row, &column_of, there, values);
        let mut found = Singletons {
            before: Vec::with_capacity(before.len()),
            after: Vec::with_capacity(after.len()),
            index: vec![],
            values: vec![],
            slots: vec![],
            zeros,
            rows: (0..n as u32).filter(|row| !rows.gone[*row as usize]).collect(),
            columns: (0..n as u32).filter(|j| !columns.gone[*j as usize]).collect(),
            core: vec![],
        };
        let mut early = vec![false; n];
        for &slot in &before {
            let (row, column) = (pattern.rows[slot as usize], column_of[slot as usize]);
            early[column as usize] = true;
            found.push(NONE, slot);
            for other in pattern.column(column as usize) {
                if there(other) && other as u32 != slot {
                    found.push(pattern.rows[other], other as u32);
                }
            }
            let end = found.slots.len() as u32;
            found.before.push(Step { row, column, end });
        }
        for &slot in after.iter().rev() {
            let (row, column) = (pattern.rows[slot as usize], column_of[slot as usize]);
            found.push(NONE, slot);
            let range = starts[row as usize] as usize..starts[row as usize + 1] as usize;
            for &other in &by_row[range] {
                let j = column_of[other as usize];
                if other != slot && !early[j as usize] {
                    found.push(j, other);
                }
            }
            let end = found.slots.len() as u32;
            found.after.push(Step { row, column, end });
        }
        for &j in &found.columns {
            let slots = pattern.column(j as usize);
            let left =
                slots.filter(|slot| there(*slot) && !rows.gone[pattern.rows[*slot] as usize]);
            found.core.extend(left.map(|slot| slot as u32));
        }
        found.values = vec![0.0; found.slots.len()];
        found
    }

    fn push(&mut self, index: u32, slot: u32) {
        self.index.push(index);
        self.slots.push(slot);
    }

    /// How many rows are not of the core.
    pub fn len(&self) -> usize {
        self.before.len() + self.after.len()
    }

    /// Takes new values.
    pub fn load(&mut self, values: &[f64]) -> Result<(), Unfit> {
        if self.zeros.iter().any(|slot| values[*slot as usize] != 0.0) {
            return Err(Unfit::Entry);
        }
        for (own, slot) in self.values.iter_mut().zip(&self.slots) {
            *own = values[*slot as usize];
        }
        let mut from = 0;
        for step in self.before.iter().chain(&self.after) {
            let pivot = self.values[from];
            if pivot == 0.0 || !pivot.is_finite() {
                return Err(Unfit::Values);
            }
            from = step.end as usize;
        }
        Ok(())
    }

    /// Before the core: unknowns go to `x`, and what they are worth is taken from `b`.
    pub fn forward(&self, b: &mut [f64], x: &mut [f64]) {
        let mut from = 0;
        for step in &self.before {
            let to = step.end as usize;
            let value = b[step.row as usize] / self.values[from];
            x[step.column as usize] = value;
            for (row, entry) in self.index[from + 1..to].iter().zip(&self.values[from + 1..to]) {
                b[*row as usize] -= entry * value;
            }
            from = to;
        }
    }

    /// After the core: `b` as `forward` left it, `x` complete but for these.
    pub fn backward(&self, b: &[f64], x: &mut [f64]) {
        let mut from = self.before.last().map_or(0, |step| step.end as usize);
        for step in &self.after {
            let to = step.end as usize;
            let mut sum = b[step.row as usize];
            for (column, entry) in self.index[from + 1..to].iter().zip(&self.values[from + 1..to]) {
                sum -= entry * x[*column as usize];
            }
            x[step.column as usize] = sum / self.values[from];
            from = to;
        }
    }
}

/// The slots of the pivots: rows with one unknown in order, columns with one equation in order.
#[allow(clippy::too_many_arguments)]
fn peel(
    pattern: &Pattern,
    rows: &mut Lines,
    columns: &mut Lines,
    starts: &[u32],
    by_row: &[u32],
    column_of: &[u32],
    there: impl Fn(usize) -> bool,
    values: &[f64],
) -> (Vec<u32>, Vec<u32>) {
    let n = pattern.n as u32;
    let (mut before, mut after) = (vec![], vec![]);
    let mut waiting_rows: Vec<u32> = (0..n).filter(|k| rows.count[*k as usize] == 1).collect();
    let mut waiting_columns: Vec<u32> =
        (0..n).filter(|k| columns.count[*k as usize] == 1).collect();
    loop {
        let (slot, by_its_row) = match waiting_rows.pop() {
            Some(row) if rows.gone[row as usize] || rows.count[row as usize] != 1 => continue,
            Some(row) => (rows.slots[row as usize], true),
            None => match waiting_columns.pop() {
                Some(j) if columns.gone[j as usize] || columns.count[j as usize] != 1 => continue,
                Some(j) => (columns.slots[j as usize], false),
                None => return (before, after),
            },
        };
        if values[slot as usize] == 0.0 {
            continue;
        }
        let (row, column) = (pattern.rows[slot as usize], column_of[slot as usize]);
        (rows.gone[row as usize], columns.gone[column as usize]) = (true, true);
        if by_its_row {
            before.push(slot);
            for other in pattern.column(column as usize) {
                let i = pattern.rows[other];
                if there(other) && !rows.gone[i as usize] && rows.take(i, other as u32) {
                    waiting_rows.push(i);
                }
            }
        } else {
            after.push(slot);
            for &other in &by_row[starts[row as usize] as usize..starts[row as usize + 1] as usize]
            {
                let j = column_of[other as usize];
                if !columns.gone[j as usize] && columns.take(j, other) {
                    waiting_columns.push(j);
                }
            }
        }
    }
}
