//! Exact elimination of integer equations: which variables follow from which.
//!
//! Rows are kept as integers without a common factor, and are combined crosswise (a·row − b·pivot), so that nothing is
//! ever rounded; a number that would not fit ends the elimination. In junction structures nearly all entries stay 0, 1
//! and −1.

use std::collections::BTreeSet;

/// A row: variables in rising order and what they are multiplied by; the sum is 0.
pub type Row = Vec<(usize, i64)>;

/// What the equations say.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// Visible variables that follow from the free ones: the variable, and its row, which holds it and free ones alone.
    pub dependent: Vec<(usize, Row)>,
    /// Visible variables that can take any value.
    pub free: Vec<usize>,
    /// Hidden variables that follow from visible ones (any of them) and from hidden ones that are undetermined.
    pub hidden: Vec<(usize, Row)>,
    /// Hidden variables that nothing determines.
    pub undetermined: Vec<usize>,
}

/// Eliminates hidden variables first, then makes as many visible ones depend on the others as can be. `None` where
/// numbers grow too large.
pub fn eliminate(rows: Vec<Row>, hidden: &[bool]) -> Option<Solved> {
    let mut table = Table::new(rows, hidden.len());
    let mut solved = Solved::default();
    let mut has_row = vec![false; hidden.len()];
    let mut pivots = Vec::new();
    while let Some((row, variable)) = table.choose(hidden, true) {
        table.clear(row, variable)?;
        table.retire(row);
        has_row[variable] = true;
        pivots.push((variable, row));
    }
    while let Some((row, variable)) = table.choose(hidden, false) {
        table.clear(row, variable)?;
        has_row[variable] = true;
        solved.dependent.push((variable, vec![]));
        pivots.push((variable, row));
    }
    // Each hidden one is told by its row in terms of those that were eliminated after it.
    let mut row_of = vec![None; hidden.len()];
    for (variable, row) in pivots.iter().rev() {
        if !hidden[*variable] {
            continue;
        }
        let mut terms = table.rows[*row].clone();
        loop {
            let next = terms.iter().map(|(other, _)| *other).find_map(|other| {
                let told: Option<usize> = row_of[other];
                told.filter(|_| other != *variable).map(|told| (other, told))
            });
            let Some((other, told)) = next else { break };
            terms = combine(&terms, &solved.hidden[told].1, other)?;
        }
        row_of[*variable] = Some(solved.hidden.len());
        solved.hidden.push((*variable, terms));
    }
    let visible = pivots.iter().filter(|(variable, _)| !hidden[*variable]);
    for (slot, (_, row)) in solved.dependent.iter_mut().zip(visible) {
        slot.1 = table.rows[*row].clone();
    }
    for (variable, has_row) in has_row.iter().enumerate() {
        match (hidden[variable], has_row) {
            (true, false) => solved.undetermined.push(variable),
            (false, false) => solved.free.push(variable),
            _ => {}
        }
    }
    Some(solved)
}

/// What multiplies a variable in a row.
pub fn factor(row: &Row, variable: usize) -> i64 {
    row.binary_search_by_key(&variable, |(v, _)| *v).map_or(0, |at| row[at].1)
}

/// The combination of two rows without a variable that both hold.
fn combine(row: &Row, pivot: &Row, variable: usize) -> Option<Row> {
    let (a, b) = (factor(pivot, variable), factor(row, variable));
    let common = gcd(a, b);
    let (a, b) = (a / common, b / common);
    let mut result = Vec::with_capacity(row.len() + pivot.len());
    let (mut left, mut right) = (row.iter().peekable(), pivot.iter().peekable());
    loop {
        let (column, value) = match (left.peek().copied(), right.peek().copied()) {
            (Some(&(x, p)), Some(&(y, q))) if x == y => {
                left.next();
                right.next();
                (x, p.checked_mul(a)?.checked_sub(q.checked_mul(b)?)?)
            }
            (Some(&(x, p)), other) if other.is_none_or(|(y, _)| x < *y) => {
                left.next();
                (x, p.checked_mul(a)?)
            }
            (_, Some(&(y, q))) => {
                right.next();
                (y, q.checked_mul(b)?.checked_neg()?)
            }
            _ => break,
        };
        if value != 0 {
            result.push((column, value));
        }
    }
    let common = result.iter().fold(0, |sofar, (_, value)| gcd(sofar, *value));
    if common > 1 {
        result.iter_mut().for_each(|(_, value)| *value /= common);
    }
    Some(result)
}

fn gcd(a: i64, b: i64) -> i64 {
    let (mut a, mut b) = (a.unsigned_abs(), b.unsigned_abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    // Larger ones do not come from checked products; 1 would be right as well.
    i64::try_from(a).unwrap_or(1)
}

/// Rows, and by variable the rows that hold it.
struct Table {
    rows: Vec<Row>,
    holders: Vec<BTreeSet<usize>>,
    /// Rows that may still be pivots, the shortest first.
    queue: BTreeSet<(usize, usize)>,
    /// Rows without a hidden variable, once that is known.
    plain: BTreeSet<(usize, usize)>,
}

impl Table {
    fn new(rows: Vec<Row>, variables: usize) -> Table {
        let mut holders = vec![BTreeSet::new(); variables];
        let mut queue = BTreeSet::new();
        for (number, row) in rows.iter().enumerate() {
            queue.insert((row.len(), number));
            for (variable, _) in row {
                holders[*variable].insert(number);
            }
        }
        Table { rows, holders, queue, plain: BTreeSet::new() }
    }

    /// The next pivot: a short row, and in it a factor of ±1 if there is one, of a variable that few rows hold.
    fn choose(&mut self, hidden: &[bool], wanted: bool) -> Option<(usize, usize)> {
        if !wanted && !self.plain.is_empty() {
            let plain = std::mem::take(&mut self.plain);
            self.queue.extend(plain);
        }
        while let Some((length, row)) = self.queue.pop_first() {
            let best = self.rows[row]
                .iter()
                .filter(|(variable, _)| hidden[*variable] == wanted)
                .min_by_key(|(variable, value)| (value.abs(), self.holders[*variable].len()));
            match best {
                Some((variable, _)) => return Some((row, *variable)),
                None if wanted => {
                    self.plain.insert((length, row));
                }
                None => {}
            }
        }
        None
    }

    /// Removes a variable from all other rows.
    fn clear(&mut self, pivot: usize, variable: usize) -> Option<()> {
        for row in self.holders[variable].clone() {
            if row == pivot {
                continue;
            }
            let entry = (self.rows[row].len(), row);
            let queued = self.queue.remove(&entry);
            let plain = self.plain.remove(&entry);
            let combined = combine(&self.rows[row], &self.rows[pivot], variable)?;
            for (old, _) in &self.rows[row] {
                self.holders[*old].remove(&row);
            }
            for (new, _) in &combined {
                self.holders[*new].insert(row);
            }
            if queued || plain {
                self.queue.insert((combined.len(), row));
            }
            self.rows[row] = combined;
        }
        Some(())
    }

    /// Takes a row out of all further elimination.
    fn retire(&mut self, row: usize) {
        for (variable, _) in &self.rows[row] {
            self.holders[*variable].remove(&row);
        }
    }
}
