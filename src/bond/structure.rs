//! What the linearised equations determine: dependent states, constraints, variables that nothing determines.
//!
//! The equations are x' = g(x, z, t), 0 = h(x, z, t). Elimination over z leaves rows of h that speak of x alone: each
//! is a constraint between states, and makes one of them dependent (derivative causality, index 2). A row that is left
//! with nothing says what the others say already, or contradicts them. Columns of z without a pivot are found from the
//! constraints' derivatives C·g (the efforts and flows that a dependent storage takes), or by nothing at all (the flow
//! round a ring of 0-junctions).
//!
//! Entries carry the largest magnitude that ever entered them, so that what cancels is told from what is small,
//! whatever the units.

use std::collections::{BTreeMap, BTreeSet};

/// A row of the Jacobian: columns and entries. Columns below `states` are states, the rest the other unknowns.
pub type JacobianRow = Vec<(usize, f64)>;

/// The equations around one point.
#[derive(Clone, Debug, Default)]
pub struct Linearised {
    /// Number of states.
    pub states: usize,
    /// Number of all unknowns, states first.
    pub unknowns: usize,
    /// g, one row for each state.
    pub rates: Vec<JacobianRow>,
    /// h, one row for each other unknown.
    pub algebraic: Vec<JacobianRow>,
}

/// A constraint between states.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The state that the others determine.
    pub dependent: usize,
    /// The others.
    pub on: Vec<usize>,
    /// The algebraic row that became it.
    pub row: usize,
    /// All algebraic rows that it follows from.
    pub rows: Vec<usize>,
}

/// What the equations determine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Structure {
    /// Constraints between states.
    pub constraints: Vec<Constraint>,
    /// Algebraic rows that follow from others, each with all the rows that it was made of.
    pub idle: Vec<(usize, Vec<usize>)>,
    /// Unknowns that are found from derivatives of the constraints and are free in h, one for each constraint unless
    /// some are `higher`.
    pub hidden: Vec<usize>,
    /// Whether an unknown depends on hidden ones: of index 2.
    pub index_two: Vec<bool>,
    /// Unknowns that nothing determines, one for each idle row when the equations are sound.
    pub undetermined: Vec<usize>,
    /// Whether an unknown depends on undetermined ones.
    pub loose: Vec<bool>,
    /// Constraints whose derivatives do not determine anything: index 3 or more.
    pub higher: usize,
}

/// An entry with the largest magnitude that entered it.
#[derive(Clone, Copy, Debug)]
struct Entry {
    value: f64,
    weight: f64,
}

/// Below this part of what entered it an entry counts as cancelled.
const CANCELLED: f64 = 1e-11;

#[derive(Clone, Debug, Default)]
struct Row {
    entries: BTreeMap<usize, Entry>,
    from: BTreeSet<usize>,
}

impl Row {
    /// self −= factor·other; the entry at `pivot` vanishes exactly.
    fn subtract(&mut self, factor: f64, other: &Row, pivot: usize) {
        for (&column, entry) in &other.entries {
            let taken = factor * entry.value;
            let mine = self.entries.get(&column).copied();
            let (value, weight) = match mine {
                Some(old) => (
                    old.value - taken,
                    old.weight.max(taken.abs()).max(factor.abs() * entry.weight),
                ),
                None => (-taken, taken.abs().max(factor.abs() * entry.weight)),
            };
            if column == pivot || value.abs() <= CANCELLED * weight {
                self.entries.remove(&column);
            } else {
                self.entries.insert(column, Entry { value, weight });
            }
        }
        self.from.extend(other.from.iter().copied());
    }

    fn value(&self, column: usize) -> Option<f64> {
        self.entries.get(&column).map(|entry| entry.value)
    }
}

/// Finds what the equations determine. `preference` lists the states from the one that most deserves to stay
/// independent to the one that least does.
pub fn analyse(equations: &Linearised, preference: &[usize]) -> Structure {
    let (nx, n) = (equations.states, equations.unknowns);
    let column_scales = equilibrate(equations);
    let row = |entries: &JacobianRow, from: Option<usize>| -> Row {
        let mut result = Row::default();
        let scaled: Vec<(usize, f64)> = entries
            .iter()
            .map(|&(column, value)| (column, value * column_scales[column]))
            .collect();
        let largest = scaled.iter().fold(0.0f64, |m, (_, v)| m.max(v.abs()));
        if largest > 0.0 {
            for (column, value) in scaled.into_iter().filter(|(_, v)| *v != 0.0) {
                let value = value / largest;
                result.entries.insert(column, Entry { value, weight: value.abs() });
            }
        }
        result.from.extend(from);
        result
    };
    let rows: Vec<Row> =
        equations.algebraic.iter().enumerate().map(|(i, entries)| row(entries, Some(i))).collect();

    // h over z.
    let (mut pivots, left) = eliminate(rows, nx, n);

    // What is left speaks of x alone.
    let mut structure =
        Structure { index_two: vec![false; n], loose: vec![false; n], ..Structure::default() };
    let (constraints, idle) = dependents(left, preference);
    structure.idle = idle;

    // The constraints' derivatives over the columns of z that have no pivot yet.
    let rates: Vec<Row> = equations.rates.iter().map(|entries| row(entries, None)).collect();
    let scale_of_rate = |k: usize| {
        equations.rates[k].iter().fold(0.0f64, |m, &(c, v)| m.max((v * column_scales[c]).abs()))
    };
    let mut derivatives = vec![];
    for (dependent, origin, constraint) in &constraints {
        let mut derivative = Row::default();
        for (&state, entry) in &constraint.entries {
            // x in the constraint is scaled by its column, x' is not.
            let factor = entry.value / column_scales[state] * scale_of_rate(state);
            derivative.subtract(-factor, &rates[state], usize::MAX);
        }
        derivative.entries.retain(|column, _| *column >= nx);
        for (column, pivot) in &pivots {
            if let Some(value) = derivative.value(*column)
                && let Some(at) = pivot.value(*column)
            {
                derivative.subtract(value / at, pivot, *column);
                derivative.entries.retain(|column, _| *column >= nx);
            }
        }
        derivatives.push(derivative);
        structure.constraints.push(Constraint {
            dependent: *dependent,
            on: constraint.entries.keys().copied().filter(|k| k != dependent).collect(),
            row: *origin,
            rows: constraint.from.iter().copied().collect(),
        });
    }
    let before = pivots.len();
    let (hidden, higher) = eliminate(derivatives, nx, n);
    structure.higher = higher.len();
    structure.hidden = hidden.iter().map(|(column, _)| *column).collect();

    let mut found = vec![false; n];
    for (column, _) in pivots.iter().chain(&hidden) {
        found[*column] = true;
    }
    structure.undetermined = (nx..n).filter(|column| !found[*column]).collect();
    for column in &structure.hidden {
        structure.index_two[*column] = true;
    }
    for column in &structure.undetermined {
        structure.loose[*column] = true;
    }
    pivots.extend(hidden);
    for (at, (column, pivot)) in pivots.iter().enumerate().rev() {
        let others = || pivot.entries.keys().filter(|other| *other != column);
        structure.loose[*column] |= others().any(|other| structure.loose[*other]);
        if at < before {
            structure.index_two[*column] |= others().any(|other| structure.index_two[*other]);
        }
    }
    structure
}

/// Rows with a column or their first place.
type Numbered = Vec<(usize, Row)>;

/// Eliminates over columns `nx..n`, the rows with the fewest entries there first. Returns pivot rows in order and the
/// rows that have none of these columns left.
fn eliminate(mut rows: Vec<Row>, nx: usize, n: usize) -> (Numbered, Numbered) {
    let mut holders: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
    let count = |row: &Row| row.entries.range(nx..).count();
    let mut queue = BTreeSet::new();
    for (i, row) in rows.iter().enumerate() {
        for (&column, _) in row.entries.range(nx..) {
            holders[column].insert(i);
        }
        queue.insert((count(row), i));
    }
    let (mut pivots, mut left) = (vec![], vec![]);
    while let Some((entries, i)) = queue.pop_first() {
        let row = std::mem::take(&mut rows[i]);
        if entries == 0 {
            left.push((i, row));
            continue;
        }
        let largest = row.entries.range(nx..).fold(0.0f64, |m, (_, e)| m.max(e.value.abs()));
        let Some(pivot) = row
            .entries
            .range(nx..)
            .filter(|(_, entry)| entry.value.abs() >= 0.1 * largest)
            .map(|(column, _)| *column)
            .min_by_key(|column| holders[*column].len())
        else {
            continue;
        };
        for (&column, _) in row.entries.range(nx..) {
            holders[column].remove(&i);
        }
        let at = row.value(pivot).unwrap_or(1.0);
        for other in std::mem::take(&mut holders[pivot]) {
            let target = &mut rows[other];
            let Some(value) = target.value(pivot) else { continue };
            queue.remove(&(count(target), other));
            let was: Vec<usize> = target.entries.range(nx..).map(|(c, _)| *c).collect();
            target.subtract(value / at, &row, pivot);
            for column in was {
                if !target.entries.contains_key(&column) {
                    holders[column].remove(&other);
                }
            }
            for (&column, _) in target.entries.range(nx..) {
                holders[column].insert(other);
            }
            queue.insert((count(target), other));
        }
        pivots.push((pivot, row));
    }
    (pivots, left)
}

/// Of rows over states alone: each non-empty one makes the least preferred state dependent that it can. Returns
/// reduced constraints with their dependent states, and the empty rows with what they were made of.
#[allow(clippy::type_complexity)]
fn dependents(
    mut rows: Vec<(usize, Row)>,
    preference: &[usize],
) -> (Vec<(usize, usize, Row)>, Vec<(usize, Vec<usize>)>) {
    let mut taken: Vec<Option<usize>> = vec![None; rows.len()];
    for &state in preference.iter().rev() {
        let best = (0..rows.len())
            .filter(|i| taken[*i].is_none())
            .filter_map(|i| {
                let largest = rows[i].1.entries.values().fold(0.0f64, |m, e| m.max(e.value.abs()));
                rows[i].1.value(state).map(|value| (i, value.abs() / largest))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _)) = best else { continue };
        taken[i] = Some(state);
        let pivot = rows[i].1.clone();
        let at = pivot.value(state).unwrap_or(1.0);
        for (other, (_, row)) in rows.iter_mut().enumerate() {
            if other != i
                && let Some(value) = row.value(state)
            {
                row.subtract(value / at, &pivot, state);
            }
        }
    }
    let (mut constraints, mut idle) = (vec![], vec![]);
    for ((origin, row), taken) in rows.into_iter().zip(taken) {
        match taken {
            Some(state) => constraints.push((state, origin, row)),
            None => idle.push((origin, row.from.into_iter().collect())),
        }
    }
    (constraints, idle)
}

/// Powers of two for the columns, so that entries are near 1 when each row is divided by its largest.
fn equilibrate(equations: &Linearised) -> Vec<f64> {
    let n = equations.unknowns;
    let mut columns = vec![0.0f64; n];
    for _ in 0..4 {
        let mut sums = vec![(0.0, 0usize); n];
        for row in &equations.algebraic {
            let entries = || row.iter().filter(|(_, v)| *v != 0.0 && v.is_finite());
            let count = entries().count().max(1) as f64;
            let mean: f64 =
                entries().map(|&(c, v)| v.abs().log2() + columns[c]).sum::<f64>() / count;
            for &(column, value) in entries() {
                sums[column].0 += mean - value.abs().log2();
                sums[column].1 += 1;
            }
        }
        for (column, (sum, count)) in columns.iter_mut().zip(sums) {
            if count > 0 {
                *column = sum / count as f64;
            }
        }
    }
    columns.into_iter().map(|exponent| exponent.round().clamp(-1000.0, 1000.0).exp2()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two inertias of 2 and 3 on one 1-junction with a source: unknowns p1 p2, then f1 f2 e1 e2.
    /// f1 = p1/2, f2 = p2/3, f1 = f2, e1 + e2 = 10; p1' = e1, p2' = e2.
    fn pair() -> Linearised {
        Linearised {
            states: 2,
            unknowns: 6,
            rates: vec![vec![(4, 1.0)], vec![(5, 1.0)]],
            algebraic: vec![
                vec![(2, 1.0), (0, -0.5)],
                vec![(3, 1.0), (1, -1.0 / 3.0)],
                vec![(2, 1.0), (3, -1.0)],
                vec![(4, 1.0), (5, 1.0)],
            ],
        }
    }

    #[test]
    fn two_inertias_with_a_common_flow_are_one_state() {
        let structure = analyse(&pair(), &[0, 1]);
        assert_eq!(structure.constraints.len(), 1);
        assert_eq!(structure.constraints[0].dependent, 1);
        assert_eq!(structure.constraints[0].on, [0]);
        assert_eq!(structure.constraints[0].rows, [0, 1, 2]);
        assert_eq!(structure.index_two, [false, false, false, false, true, true]);
        assert_eq!(
            (structure.idle.len(), structure.undetermined.len(), structure.higher),
            (0, 0, 0)
        );
        let turned = analyse(&pair(), &[1, 0]);
        assert_eq!(turned.constraints[0].dependent, 0);
    }

    #[test]
    fn units_do_not_matter() {
        let mut scaled = pair();
        for row in scaled.rates.iter_mut().chain(&mut scaled.algebraic) {
            for (column, value) in row.iter_mut() {
                *value *= [1e-13, 1e9, 1e-7, 1e7, 1e10, 1e-11][*column];
            }
        }
        let structure = analyse(&scaled, &[0, 1]);
        assert_eq!(structure.constraints.len(), 1);
        assert_eq!(structure.hidden.len(), 1);
    }

    #[test]
    fn what_is_said_twice_leaves_a_variable_undetermined() {
        // Efforts equal round a ring: a − b, b − c, c − a; c = 1 is not said.
        let ring = Linearised {
            states: 0,
            unknowns: 3,
            rates: vec![],
            algebraic: vec![
                vec![(0, 1.0), (1, -1.0)],
                vec![(1, 1.0), (2, -1.0)],
                vec![(2, 1.0), (0, -1.0)],
            ],
        };
        let structure = analyse(&ring, &[]);
        assert_eq!(structure.idle.len(), 1);
        assert_eq!(structure.idle[0].1, [0, 1, 2]);
        assert_eq!(structure.undetermined.len(), 1);
        assert_eq!(structure.loose, [true, true, true]);
    }
}
