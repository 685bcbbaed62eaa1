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
    /// How it was made: for [`Structure::rows`].
    pub made: Made,
}

/// How a row was made of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Made(usize);

/// What the equations determine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Structure {
    /// Constraints between states.
    pub constraints: Vec<Constraint>,
    /// Algebraic rows that follow from others, and how each was made.
    pub idle: Vec<(usize, Made)>,
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
    trail: Trail,
}

/// What was made of what.
#[derive(Clone, Debug, Default, PartialEq)]
struct Trail {
    /// By algebraic row: the rows that were taken from it while it was eliminated.
    taken: Vec<Vec<usize>>,
    /// Rows over states: an algebraic row, or two of these joined.
    steps: Vec<Step>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Row(usize),
    Of(usize, usize),
}

impl Trail {
    fn step(&mut self, step: Step) -> usize {
        self.steps.push(step);
        self.steps.len() - 1
    }
}

impl Structure {
    /// All algebraic rows that something was made of, ascending.
    pub fn rows(&self, made: Made) -> Vec<usize> {
        let mut seen = vec![false; self.trail.steps.len()];
        let mut rows = BTreeSet::new();
        let mut open = vec![made.0];
        while let Some(at) = open.pop() {
            if std::mem::replace(&mut seen[at], true) {
                continue;
            }
            match self.trail.steps[at] {
                Step::Row(row) => drop(rows.insert(row)),
                Step::Of(a, b) => open.extend([a, b]),
            }
        }
        let mut open: Vec<usize> = rows.iter().copied().collect();
        while let Some(row) = open.pop() {
            let taken = self.trail.taken[row].iter().copied();
            open.extend(taken.filter(|other| rows.insert(*other)));
        }
        rows.into_iter().collect()
    }
}

/// An entry with the largest magnitude that entered it.
#[derive(Clone, Copy, Debug)]
struct Entry {
    value: f64,
    weight: f64,
}

/// Below this part of what entered it an entry counts as cancelled.
const CANCELLED: f64 = 1e-11;

type Row = BTreeMap<usize, Entry>;

/// What a subtraction did to the places of a row's entries.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Became {
    Entry,
    Nothing,
}

/// row −= factor·other from a column on; the entry at `pivot` vanishes exactly. Tells of each entry that appears or
/// vanishes.
fn subtract(
    row: &mut Row,
    factor: f64,
    other: &Row,
    [from, pivot]: [usize; 2],
    tell: &mut dyn FnMut(usize, Became),
) {
    for (&column, entry) in other.range(from..) {
        let taken = factor * entry.value;
        let mine = row.get(&column).copied();
        let (value, weight) = match mine {
            Some(old) => {
                (old.value - taken, old.weight.max(taken.abs()).max(factor.abs() * entry.weight))
            }
            None => (-taken, taken.abs().max(factor.abs() * entry.weight)),
        };
        if column == pivot || value.abs() <= CANCELLED * weight {
            if row.remove(&column).is_some() {
                tell(column, Became::Nothing);
            }
        } else if row.insert(column, Entry { value, weight }).is_none() {
            tell(column, Became::Entry);
        }
    }
}

fn value(row: &Row, column: usize) -> Option<f64> {
    row.get(&column).map(|entry| entry.value)
}

/// Finds what the equations determine. `preference` lists the states from the one that most deserves to stay
/// independent to the one that least does.
pub fn analyse(equations: &Linearised, preference: &[usize]) -> Structure {
    let (nx, n) = (equations.states, equations.unknowns);
    let column_scales = equilibrate(equations);
    let row = |entries: &JacobianRow| -> Row {
        let mut result = Row::new();
        let scaled: Vec<(usize, f64)> = entries
            .iter()
            .map(|&(column, value)| (column, value * column_scales[column]))
            .collect();
        let largest = scaled.iter().fold(0.0f64, |m, (_, v)| m.max(v.abs()));
        if largest > 0.0 {
            for (column, value) in scaled.into_iter().filter(|(_, v)| *v != 0.0) {
                let value = value / largest;
                result.insert(column, Entry { value, weight: value.abs() });
            }
        }
        result
    };
    let rows: Vec<Row> = equations.algebraic.iter().map(row).collect();

    // h over z.
    let Elimination { mut pivots, left, made_of } = eliminate(rows, nx, n);
    let mut trail = Trail { taken: made_of, steps: vec![] };
    let left = left.into_iter().map(|(origin, row)| {
        let from = trail.step(Step::Row(origin));
        Left { row, from, origin }
    });
    let left = left.collect();

    // What is left speaks of x alone.
    let mut structure =
        Structure { index_two: vec![false; n], loose: vec![false; n], ..Structure::default() };
    let (constraints, idle) = dependents(left, preference, &mut trail);
    structure.idle = idle;
    structure.trail = trail;

    // The constraints' derivatives over the columns of z that have no pivot yet.
    let rates: Vec<Row> = equations.rates.iter().map(row).collect();
    let scale_of_rate = |k: usize| {
        equations.rates[k].iter().fold(0.0f64, |m, &(c, v)| m.max((v * column_scales[c]).abs()))
    };
    let mut place: Vec<Option<usize>> = vec![None; n];
    for (at, (column, _)) in pivots.iter().enumerate() {
        place[*column] = Some(at);
    }
    let mut derivatives = vec![];
    for (dependent, Left { row: constraint, from, origin }) in &constraints {
        let mut derivative = Row::new();
        for (&state, entry) in constraint {
            // x in the constraint is scaled by its column, x' is not.
            let factor = entry.value / column_scales[state] * scale_of_rate(state);
            subtract(&mut derivative, -factor, &rates[state], [nx, usize::MAX], &mut |_, _| {});
        }
        // A pivot row speaks of later pivots only.
        let mut open: BTreeSet<usize> =
            derivative.keys().filter_map(|column| place[*column]).collect();
        while let Some(at) = open.pop_first() {
            let (column, pivot) = &pivots[at];
            if let (Some(own), Some(by)) = (value(&derivative, *column), value(pivot, *column)) {
                let mut tell = |column: usize, became| {
                    if became == Became::Entry {
                        open.extend(place[column]);
                    }
                };
                subtract(&mut derivative, own / by, pivot, [nx, *column], &mut tell);
            }
        }
        derivatives.push(derivative);
        structure.constraints.push(Constraint {
            dependent: *dependent,
            on: constraint.keys().copied().filter(|k| k != dependent).collect(),
            row: *origin,
            made: Made(*from),
        });
    }
    let before = pivots.len();
    let Elimination { pivots: hidden, left: higher, .. } = eliminate(derivatives, nx, n);
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
        let others = || pivot.keys().filter(|other| *other != column);
        structure.loose[*column] |= others().any(|other| structure.loose[*other]);
        if at < before {
            structure.index_two[*column] |= others().any(|other| structure.index_two[*other]);
        }
    }
    structure
}

/// What became of rows.
struct Elimination {
    /// Pivot rows in order, each with its column.
    pivots: Vec<(usize, Row)>,
    /// Rows without any of the columns left, each with its place.
    left: Vec<(usize, Row)>,
    /// By row: the pivot rows that were taken from it, by their places.
    made_of: Vec<Vec<usize>>,
}

/// Eliminates over columns `nx..n`, the rows with the fewest entries there first.
fn eliminate(mut rows: Vec<Row>, nx: usize, n: usize) -> Elimination {
    let mut holders: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
    let mut counts: Vec<usize> = rows.iter().map(|row| row.range(nx..).count()).collect();
    let mut queue = BTreeSet::new();
    for (i, row) in rows.iter().enumerate() {
        for (&column, _) in row.range(nx..) {
            holders[column].insert(i);
        }
        queue.insert((counts[i], i));
    }
    let (mut pivots, mut left) = (vec![], vec![]);
    let mut made_of = vec![vec![]; rows.len()];
    while let Some((entries, i)) = queue.pop_first() {
        let row = std::mem::take(&mut rows[i]);
        if entries == 0 {
            left.push((i, row));
            continue;
        }
        let largest = row.range(nx..).fold(0.0f64, |m, (_, e)| m.max(e.value.abs()));
        // Of columns that as few rows hold, the largest entry: so a matrix with its weight on the diagonal is eliminated
        // along it, stays symmetric and sparse, and no factor grows.
        let Some(pivot) = row
            .range(nx..)
            .map(|(column, entry)| (*column, entry.value.abs()))
            .filter(|(_, size)| *size >= 0.1 * largest)
            .min_by(|a, b| holders[a.0].len().cmp(&holders[b.0].len()).then(b.1.total_cmp(&a.1)))
            .map(|(column, _)| column)
        else {
            continue;
        };
        for (&column, _) in row.range(nx..) {
            holders[column].remove(&i);
        }
        let at = value(&row, pivot).unwrap_or(1.0);
        for other in std::mem::take(&mut holders[pivot]) {
            let target = &mut rows[other];
            let Some(own) = value(target, pivot) else { continue };
            queue.remove(&(counts[other], other));
            let count = &mut counts[other];
            let mut tell = |column: usize, became| {
                if column < nx {
                    return;
                }
                match became {
                    Became::Entry => {
                        holders[column].insert(other);
                        *count += 1;
                    }
                    Became::Nothing => {
                        holders[column].remove(&other);
                        *count -= 1;
                    }
                }
            };
            subtract(target, own / at, &row, [0, pivot], &mut tell);
            made_of[other].push(i);
            queue.insert((counts[other], other));
        }
        pivots.push((pivot, row));
    }
    Elimination { pivots, left, made_of }
}

/// A row over states alone.
struct Left {
    row: Row,
    /// The algebraic row that became it, and the step that made it.
    origin: usize,
    from: usize,
}

/// Rows by the states that they make dependent.
type Dependents = Vec<(usize, Left)>;

/// Of rows over states alone: each non-empty one makes the least preferred state dependent that it can. Returns
/// reduced constraints with their dependent states, and the empty rows with what they were made of.
fn dependents(
    mut rows: Vec<Left>,
    preference: &[usize],
    trail: &mut Trail,
) -> (Dependents, Vec<(usize, Made)>) {
    let mut taken: Vec<Option<usize>> = vec![None; rows.len()];
    let mut holders: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for (i, left) in rows.iter().enumerate() {
        for state in left.row.keys() {
            holders.entry(*state).or_default().insert(i);
        }
    }
    for &state in preference.iter().rev() {
        let here: Vec<usize> = holders.get(&state).into_iter().flatten().copied().collect();
        let best = here
            .iter()
            .filter(|i| taken[**i].is_none())
            .filter_map(|i| {
                let own = value(&rows[*i].row, state)?;
                let largest = rows[*i].row.values().fold(0.0f64, |m, e| m.max(e.value.abs()));
                Some((*i, own.abs() / largest))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _)) = best else { continue };
        taken[i] = Some(state);
        let pivot = std::mem::take(&mut rows[i].row);
        let at = value(&pivot, state).unwrap_or(1.0);
        for other in here.into_iter().filter(|other| *other != i) {
            let Some(own) = value(&rows[other].row, state) else { continue };
            let mut tell = |column: usize, became| match became {
                Became::Entry => drop(holders.entry(column).or_default().insert(other)),
                Became::Nothing => {
                    holders.get_mut(&column).map(|holders| holders.remove(&other));
                }
            };
            subtract(&mut rows[other].row, own / at, &pivot, [0, state], &mut tell);
            rows[other].from = trail.step(Step::Of(rows[other].from, rows[i].from));
        }
        rows[i].row = pivot;
    }
    let (mut constraints, mut idle) = (vec![], vec![]);
    for (left, taken) in rows.into_iter().zip(taken) {
        match taken {
            Some(state) => constraints.push((state, left)),
            None => idle.push((left.origin, Made(left.from))),
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
        assert_eq!(structure.rows(structure.constraints[0].made), [0, 1, 2]);
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
        assert_eq!(structure.rows(structure.idle[0].1), [0, 1, 2]);
        assert_eq!(structure.undetermined.len(), 1);
        assert_eq!(structure.loose, [true, true, true]);
    }
}
