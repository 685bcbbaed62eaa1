//! The linear model with its states alone: A, B, C, D in what storages hold and signals integrate.
//!
//! ```text
//! x' = A·x + B·u          E·[x; z]' = A·[x; z] + B·u        w = C·… + D·u
//! ```
//!
//! All efforts, flows and signals are eliminated but for z, one for each constraint between states (derivative causality).
//! A constraint that speaks of states alone makes one of them a combination of others, which takes it and its z out. One
//! that an input moves, as a source does with the charge of a compliance beside it, stays: E is then singular, and the model
//! is in descriptor form.

use super::linear::{Linear, Quantity};
use crate::bond::structure::{JacobianRow, Linearised, analyse};
use crate::diagnostic::Diagnostic;
use crate::linear::{Lu, Pattern};
use crate::source::Span;

/// Rows of numbers.
pub type Matrix = Vec<Vec<f64>>;

/// Matrices with names.
#[derive(Clone, Debug)]
pub struct StateSpace {
    /// x, and z in descriptor form.
    pub states: Vec<Quantity>,
    /// The diagonal of E where the model is in descriptor form: 1 for x, 0 for z.
    pub descriptor: Option<Vec<f64>>,
    /// States that the others determine: which, and its factors of them.
    pub dependent: Vec<(Quantity, Vec<f64>)>,
    /// A.
    pub a: Matrix,
    /// B, inputs in their own units.
    pub b: Matrix,
    /// C, outputs in their own units.
    pub c: Matrix,
    /// D.
    pub d: Matrix,
    /// The unknowns of `states`.
    pub unknowns: Vec<usize>,
}

/// Below this part of its terms a sum is rounding.
const ROUNDING: f64 = 1e-12;

/// Eliminates all but the states.
///
/// # Errors
/// When the equations leave something open at this point.
pub fn state_space(linear: &Linear) -> Result<StateSpace, Box<Diagnostic>> {
    let n = linear.unknowns.len();
    // States first: rows that hold a rate, and their unknowns.
    let rated: Vec<usize> = (0..n).filter(|row| linear.rated[*row]).collect();
    let others: Vec<usize> = (0..n).filter(|row| !linear.rated[*row]).collect();
    let order: Vec<usize> = rated.iter().chain(&others).copied().collect();
    let mut place = vec![0; n];
    order.iter().enumerate().for_each(|(at, unknown)| place[*unknown] = at);
    let nx = rated.len();
    let row = |row: &usize| -> JacobianRow {
        linear.rows[*row].iter().map(|(column, a)| (place[*column as usize], a.value)).collect()
    };
    let rates: Vec<JacobianRow> = rated.iter().map(row).collect();
    let algebraic: Vec<JacobianRow> = others.iter().map(row).collect();
    let equations = Linearised { states: nx, unknowns: n, rates, algebraic };
    let preference: Vec<usize> = (0..nx).collect();
    let structure = analyse(&equations, &preference);
    let open = |columns: &[usize]| {
        let names = columns.iter().take(6).map(|k| linear.unknowns[order[*k]].name.clone());
        let message =
            format!("at this point nothing determines {}", names.collect::<Vec<_>>().join(", "));
        Box::new(Diagnostic::error("E0928", Span::NONE, message).help(
            "a law without slope, a modulus of 0, or an input imposed in its place leaves a variable open",
        ))
    };
    if !structure.undetermined.is_empty() {
        return Err(open(&structure.undetermined));
    }
    if structure.higher > 0 {
        let message = "inputs prescribe what is stored, and nothing is free to move it";
        let help = "impose a variable that is no storage's own; --from names others";
        return Err(Box::new(Diagnostic::error("E0928", Span::NONE, message).help(help)));
    }
    let hidden = &structure.hidden;
    let is_constraint =
        |row: usize| structure.constraints.iter().any(|constraint| constraint.row == row);
    let inner_rows: Vec<usize> = (0..others.len()).filter(|row| !is_constraint(*row)).collect();
    let inner: Vec<usize> = (nx..n).filter(|column| !hidden.contains(column)).collect();
    if inner_rows.len() != inner.len() {
        return Err(open(&inner));
    }
    let mut column_of = vec![usize::MAX; n];
    inner.iter().enumerate().for_each(|(at, column)| column_of[*column] = at);
    // What the eliminated ones are of the kept ones: states, hidden ones, inputs.
    let kept: Vec<usize> = (0..nx).chain(hidden.iter().copied()).collect();
    let mut kept_at = vec![usize::MAX; n];
    kept.iter().enumerate().for_each(|(at, column)| kept_at[*column] = at);
    let nk = kept.len();
    let nu = linear.inputs.len();
    let mut right = vec![vec![0.0; inner.len()]; nk + nu];
    let (mut places, mut values) = (vec![], vec![]);
    for (at, r) in inner_rows.iter().enumerate() {
        for (column, value) in &equations.algebraic[*r] {
            match column_of[*column] {
                usize::MAX => right[kept_at[*column]][at] -= value,
                inner => {
                    places.push((at as u32, inner as u32));
                    values.push(*value);
                }
            }
        }
    }
    let mut inner_place = vec![usize::MAX; n];
    inner_rows.iter().enumerate().for_each(|(at, r)| inner_place[others[*r]] = at);
    for (k, input) in linear.inputs.iter().enumerate() {
        for (row, entry) in &input.entries {
            if let Some(at) = inner_place.get(*row as usize).filter(|at| **at != usize::MAX) {
                right[nk + k][*at] -= entry.value * input.factor;
            }
        }
    }
    let (pattern, slots) = Pattern::from_triplets(inner.len(), &places);
    let mut entries = vec![0.0; pattern.len()];
    slots.iter().zip(&values).for_each(|(slot, value)| entries[*slot as usize] += value);
    let lu = Lu::factor(&pattern, &entries).map_err(|singular| {
        let columns = singular.columns.first().cloned().unwrap_or_default();
        open(&columns.iter().map(|k| inner[*k as usize]).collect::<Vec<_>>())
    })?;
    let (mut work, mut residual) = (vec![0.0; inner.len()], vec![0.0; inner.len()]);
    for b in &mut right {
        let mut x = b.clone();
        lu.solve(&mut x, &mut work);
        lu.refine(&pattern, &entries, b, &mut x, &mut residual, &mut work);
        *b = x;
    }
    // A row over all unknowns as a row over states, hidden ones and inputs; what is rounding becomes 0.
    let reduce = |row: &[(usize, f64)], direct: &[f64]| -> Vec<f64> {
        let mut sums = vec![(0.0f64, 0.0f64); nk + nu];
        let mut add = |at: usize, term: f64| {
            sums[at].0 += term;
            sums[at].1 += term.abs();
        };
        for (column, value) in row {
            match column_of[*column] {
                usize::MAX => add(kept_at[*column], *value),
                inner => right.iter().enumerate().for_each(|(at, x)| add(at, value * x[inner])),
            }
        }
        direct.iter().enumerate().for_each(|(k, value)| add(nk + k, *value));
        sums.iter()
            .map(|(sum, size)| if sum.abs() <= ROUNDING * size { 0.0 } else { *sum })
            .collect()
    };
    let direct = |row: usize| -> Vec<f64> {
        let of = |input: &super::linear::Channel| {
            let entries = input.entries.iter().filter(|(own, _)| *own as usize == row);
            entries.map(|(_, entry)| entry.value * input.factor).sum()
        };
        linear.inputs.iter().map(of).collect()
    };
    let rates: Matrix = (0..nx).map(|k| reduce(&equations.rates[k], &direct(rated[k]))).collect();
    let constraints: Matrix = structure
        .constraints
        .iter()
        .map(|found| reduce(&equations.algebraic[found.row], &direct(others[found.row])))
        .collect();
    let outputs: Matrix = linear
        .outputs
        .iter()
        .zip(&linear.direct)
        .map(|(output, through)| {
            let row: Vec<(usize, f64)> = output
                .entries
                .iter()
                .map(|(column, entry)| (place[*column as usize], entry.value / output.factor))
                .collect();
            let mut direct = vec![0.0; nu];
            for (by, entry) in through {
                direct[*by as usize] +=
                    entry.value * linear.inputs[*by as usize].factor / output.factor;
            }
            reduce(&row, &direct)
        })
        .collect();
    let whole = Whole {
        names: kept.iter().map(|k| linear.unknowns[order[*k]].clone()).collect(),
        unknowns: kept.iter().map(|k| order[*k]).collect(),
        rates,
        constraints,
        outputs,
        nx,
        nu,
    };
    let moved = whole.constraints.iter().any(|row| row[nk..].iter().any(|b| *b != 0.0));
    if whole.constraints.is_empty() || moved {
        return Ok(whole.descriptor());
    }
    let dependent: Vec<usize> = structure.constraints.iter().map(|c| c.dependent).collect();
    whole.reduced(&dependent).ok_or_else(|| open(&dependent))
}

/// The model over states, hidden unknowns and inputs.
struct Whole {
    names: Vec<Quantity>,
    unknowns: Vec<usize>,
    rates: Matrix,
    constraints: Matrix,
    outputs: Matrix,
    nx: usize,
    nu: usize,
}

impl Whole {
    /// As it is.
    fn descriptor(self) -> StateSpace {
        let (nx, nk) = (self.nx, self.names.len());
        let split = |rows: &Matrix| -> (Matrix, Matrix) {
            rows.iter().map(|row| (row[..nk].to_vec(), row[nk..].to_vec())).unzip()
        };
        let (mut a, mut b) = split(&self.rates);
        let (more_a, more_b) = split(&self.constraints);
        let (c, d) = split(&self.outputs);
        a.extend(more_a);
        b.extend(more_b);
        let diagonal = (0..nk).map(|k| f64::from(k < nx)).collect();
        StateSpace {
            states: self.names,
            descriptor: (nk > nx).then_some(diagonal),
            dependent: vec![],
            a,
            b,
            c,
            d,
            unknowns: self.unknowns,
        }
    }

    /// Without dependent states and hidden unknowns: x_d = K·x_i, and z from K·x_i' = x_d'. `None` where that has no
    /// single solution.
    fn reduced(self, dependent: &[usize]) -> Option<StateSpace> {
        let (nx, nk, nu) = (self.nx, self.names.len(), self.nu);
        let free: Vec<usize> = (0..nx).filter(|k| !dependent.contains(k)).collect();
        let of_dependent: Matrix = self
            .constraints
            .iter()
            .map(|row| dependent.iter().map(|k| row[*k]).collect())
            .collect();
        let of_free: Matrix =
            self.constraints.iter().map(|row| free.iter().map(|k| -row[*k]).collect()).collect();
        let k = solve(&of_dependent, &of_free)?;
        // (H_d − K·H_i)·z = (K·A_i − A_d)·x + (K·B_i − B_d)·u
        let combine = |at: usize, column: usize| -> f64 {
            let own = self.rates[dependent[at]][column];
            let moved: f64 =
                free.iter().zip(&k[at]).map(|(i, part)| part * self.rates[*i][column]).sum();
            own - moved
        };
        let m = dependent.len();
        let left: Matrix =
            (0..m).map(|at| (nx..nk).map(|column| combine(at, column)).collect()).collect();
        let columns: Vec<usize> = (0..nx).chain(nk..nk + nu).collect();
        let right: Matrix =
            (0..m).map(|at| columns.iter().map(|column| -combine(at, *column)).collect()).collect();
        let z = solve(&left, &right)?;
        // Each row over free states and inputs.
        let project = |row: &Vec<f64>| -> (Vec<f64>, Vec<f64>) {
            let over = |column: usize| -> f64 {
                let hidden: f64 = (0..m)
                    .map(|at| row[nx + at] * z[at][if column < nx { column } else { column - m }])
                    .sum();
                row[column] + hidden
            };
            let state = |(at, i): (usize, &usize)| {
                let moved: f64 =
                    dependent.iter().zip(&k).map(|(d, parts)| parts[at] * over(*d)).sum();
                over(*i) + moved
            };
            let states = free.iter().enumerate().map(state).collect();
            (states, (nk..nk + nu).map(over).collect())
        };
        let (a, b) = free.iter().map(|i| project(&self.rates[*i])).unzip();
        let (c, d) = self.outputs.iter().map(project).unzip();
        let name = |i: &usize| self.names[*i].clone();
        Some(StateSpace {
            states: free.iter().map(name).collect(),
            descriptor: None,
            dependent: dependent.iter().map(name).zip(k.iter().cloned()).collect(),
            a,
            b,
            c,
            d,
            unknowns: free.iter().map(|i| self.unknowns[*i]).collect(),
        })
    }
}

/// A⁻¹·B for small full matrices.
fn solve(a: &Matrix, b: &Matrix) -> Option<Matrix> {
    let n = a.len();
    let mut places = vec![];
    let mut values = vec![];
    for (i, row) in a.iter().enumerate() {
        for (j, value) in row.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            places.push((i as u32, j as u32));
            values.push(*value);
        }
    }
    let (pattern, slots) = Pattern::from_triplets(n, &places);
    let mut entries = vec![0.0; pattern.len()];
    slots.iter().zip(&values).for_each(|(slot, value)| entries[*slot as usize] += value);
    let lu = Lu::factor(&pattern, &entries).ok()?;
    let columns = b.first().map_or(0, Vec::len);
    let mut solved = vec![vec![0.0; columns]; n];
    let mut work = vec![0.0; n];
    for j in 0..columns {
        let mut x: Vec<f64> = b.iter().map(|row| row[j]).collect();
        lu.solve(&mut x, &mut work);
        solved.iter_mut().zip(&x).for_each(|(row, x)| row[j] = *x);
    }
    Some(solved)
}
