//! Pivots by Markowitz's rule: of the entries that are large enough in their column, the one whose elimination can
//! fill in least (Markowitz, 1957; search limited as by Zlatev, 1980).

use super::pivots::{Columns, Elimination, NOISE};
use super::{Field, Pattern, Singular};

/// The least size of a pivot relative to the largest entry of its column.
const THRESHOLD: f64 = 0.05;
/// Lines that are looked at once a candidate is known.
const PATIENCE: usize = 6;
const NONE: u32 = u32::MAX;

/// An entry of the part that is still to be eliminated. `size`: the largest number that entered it, which bounds the
/// rounding noise in it.
#[derive(Clone, Copy)]
struct Entry<T> {
    row: u32,
    value: T,
    size: f64,
}

impl<T: Field> Entry<T> {
    fn is_noise(&self, noise: f64) -> bool {
        self.value.magnitude() <= noise * self.size
    }
}

/// Lines (rows, then columns) by their number of entries.
struct Counts {
    head: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    count: Vec<u32>,
}

impl Counts {
    fn new(n: usize) -> Counts {
        Counts {
            head: vec![NONE; n + 1],
            next: vec![NONE; n],
            previous: vec![NONE; n],
            count: vec![NONE; n],
        }
    }

    fn remove(&mut self, line: u32) {
        let i = line as usize;
        if self.count[i] == NONE {
            return;
        }
        let (next, previous) = (self.next[i], self.previous[i]);
        if previous == NONE {
            self.head[self.count[i] as usize] = next;
        } else {
            self.next[previous as usize] = next;
        }
        if next != NONE {
            self.previous[next as usize] = previous;
        }
        self.count[i] = NONE;
    }

    fn set(&mut self, line: u32, count: usize) {
        if self.count[line as usize] == count as u32 {
            return;
        }
        self.remove(line);
        let first = self.head[count];
        self.next[line as usize] = first;
        self.previous[line as usize] = NONE;
        if first != NONE {
            self.previous[first as usize] = line;
        }
        self.head[count] = line;
        self.count[line as usize] = count as u32;
    }

    fn lines(&self, count: usize) -> impl Iterator<Item = u32> + '_ {
        let mut line = self.head[count];
        std::iter::from_fn(move || {
            let current = (line != NONE).then_some(line)?;
            line = self.next[current as usize];
            Some(current)
        })
    }
}

struct Active<T> {
    columns: Vec<Vec<Entry<T>>>,
    rows: Vec<Vec<u32>>,
    row_counts: Counts,
    column_counts: Counts,
}

/// Chooses pivots for (scaled) values.
pub fn eliminate<T: Field>(pattern: &Pattern, values: &[T]) -> Result<Elimination<T>, Singular> {
    let n = pattern.n;
    let mut active = Active {
        columns: (0..n)
            .map(|j| {
                let entry = |slot: usize| {
                    let size = values[slot].magnitude();
                    Entry { row: pattern.rows[slot], value: values[slot], size }
                };
                pattern.column(j).map(entry).collect()
            })
            .collect(),
        rows: vec![Vec::new(); n],
        row_counts: Counts::new(n),
        column_counts: Counts::new(n),
    };
    for j in 0..n {
        for slot in pattern.column(j) {
            active.rows[pattern.rows[slot] as usize].push(j as u32);
        }
    }
    for line in (0..n as u32).rev() {
        active.row_counts.set(line, active.rows[line as usize].len());
        active.column_counts.set(line, active.columns[line as usize].len());
    }
    let mut noise = if T::EXACT { 0.0 } else { NOISE };
    let mut result = Elimination::new();
    // Of each column, what has gone into pivot rows so far.
    let mut above: Vec<Vec<(u32, T)>> = vec![Vec::new(); n];
    let mut place = vec![NONE; n];
    while result.pivots.len() < n {
        let Some((row, column)) = choose(&active, noise) else {
            let left_over: Vec<_> = (0..n)
                .filter(|&j| active.column_counts.count[j] != NONE)
                .map(|j| (j as u32, above[j].clone()))
                .collect();
            let noisy = active.columns.iter().flatten().any(|entry| !entry.value.is_zero());
            finish(&mut result, &above);
            if let Some(singular) = result.singular(pattern, values, &left_over, noisy) {
                return Err(singular);
            }
            // What looked like noise is all that is left and means something: go on with it.
            noise = 0.0;
            result.upper = Columns::new();
            continue;
        };
        step(&mut active, &mut result, &mut above, &mut place, row, column);
    }
    finish(&mut result, &above);
    Ok(result)
}

/// Hands the parts above the pivots over, column by column in the order of pivots.
fn finish<T: Field>(result: &mut Elimination<T>, above: &[Vec<(u32, T)>]) {
    for &column in &result.columns {
        for &(k, u) in &above[column as usize] {
            result.upper.push(k, u);
        }
        result.upper.close();
    }
}

/// The cheapest acceptable entry: (row, column).
fn choose<T: Field>(active: &Active<T>, noise: f64) -> Option<(u32, u32)> {
    let n = active.columns.len();
    let mut best: Option<(usize, f64, u32, u32)> = None;
    let mut looked = 0;
    for count in 1..=n {
        let done = |best: &Option<(usize, f64, u32, u32)>, looked: usize| {
            best.is_some_and(|(cost, ..)| cost <= (count - 1) * (count - 1) || looked >= PATIENCE)
        };
        for column in active.column_counts.lines(count) {
            if done(&best, looked) {
                break;
            }
            looked += 1;
            let entries = &active.columns[column as usize];
            let least = THRESHOLD * largest(entries, noise);
            for entry in entries {
                consider(active, &mut best, entry, column, least, noise);
            }
        }
        for row in active.row_counts.lines(count) {
            if done(&best, looked) {
                break;
            }
            looked += 1;
            for &column in &active.rows[row as usize] {
                let entries = &active.columns[column as usize];
                let least = THRESHOLD * largest(entries, noise);
                if let Some(entry) = entries.iter().find(|entry| entry.row == row) {
                    consider(active, &mut best, entry, column, least, noise);
                }
            }
        }
        if done(&best, looked) {
            break;
        }
    }
    best.map(|(_, _, row, column)| (row, column))
}

fn largest<T: Field>(entries: &[Entry<T>], noise: f64) -> f64 {
    entries
        .iter()
        .filter(|entry| !entry.is_noise(noise))
        .fold(0.0, |largest, entry| largest.max(entry.value.magnitude()))
}

fn consider<T: Field>(
    active: &Active<T>,
    best: &mut Option<(usize, f64, u32, u32)>,
    entry: &Entry<T>,
    column: u32,
    least: f64,
    noise: f64,
) {
    let size = entry.value.magnitude();
    if size < least || entry.is_noise(noise) {
        return;
    }
    let cost =
        (active.rows[entry.row as usize].len() - 1) * (active.columns[column as usize].len() - 1);
    let better = match *best {
        None => true,
        Some((least_cost, largest, ..)) => {
            cost < least_cost || (cost == least_cost && size > largest)
        }
    };
    if better {
        *best = Some((cost, size, entry.row, column));
    }
}

/// Eliminates one row and column.
fn step<T: Field>(
    active: &mut Active<T>,
    result: &mut Elimination<T>,
    above: &mut [Vec<(u32, T)>],
    place: &mut [u32],
    row: u32,
    column: u32,
) {
    let k = result.pivots.len() as u32;
    let mut multipliers = std::mem::take(&mut active.columns[column as usize]);
    active.row_counts.remove(row);
    active.column_counts.remove(column);
    let at = multipliers.iter().position(|entry| entry.row == row).unwrap_or(0);
    let pivot = multipliers.remove(at);
    for entry in &mut multipliers {
        let l = entry.value / pivot.value;
        let size = (entry.size / pivot.value.magnitude())
            .max(l.magnitude() * pivot.size / pivot.value.magnitude());
        entry.value = l;
        entry.size = size;
        active.rows[entry.row as usize].retain(|&j| j != column);
        result.lower.push(entry.row, l);
    }
    result.lower.close();
    result.rows.push(row);
    result.columns.push(column);
    result.pivots.push(pivot.value);
    for j in std::mem::take(&mut active.rows[row as usize]) {
        if j == column {
            continue;
        }
        let entries = &mut active.columns[j as usize];
        let Some(at) = entries.iter().position(|entry| entry.row == row) else { continue };
        let upper = entries.swap_remove(at);
        above[j as usize].push((k, upper.value));
        for (at, entry) in entries.iter().enumerate() {
            place[entry.row as usize] = at as u32;
        }
        for entry in &multipliers {
            let term = -(entry.value * upper.value);
            let size =
                (entry.value.magnitude() * upper.size).max(entry.size * upper.value.magnitude());
            let at = place[entry.row as usize];
            if at == NONE {
                entries.push(Entry { row: entry.row, value: term, size });
                active.rows[entry.row as usize].push(j);
            } else {
                let target = &mut entries[at as usize];
                target.value = target.value + term;
                target.size = target.size.max(size);
            }
        }
        for entry in entries.iter() {
            place[entry.row as usize] = NONE;
        }
        active.column_counts.set(j, entries.len());
    }
    for entry in &multipliers {
        active.row_counts.set(entry.row, active.rows[entry.row as usize].len());
    }
}
