//! Symmetric matrices, such as meshes have: L·D·Lᵀ without a choice of pivots, by faer's sparse factorisation.
//!
//! Diagonals may have both signs, those of inductors' branches being negative: what is positive and negative definite in
//! its parts (*quasi-definite*) has such factors in every order (R. J. Vanderbei, SIAM J. Optim. 5:100-113, 1995). Whether
//! a matrix is, its pivots tell: they have the signs of the diagonal, and are not much smaller or larger than it.
//! The order and the places of all entries are worked out once; the rest is arithmetic in place.

use super::singletons::Unfit;
use super::{Pattern, paths};
use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, simplicial, supernodal,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::fmt;
use std::sync::Arc;

/// A pivot that lost more than this part of its diagonal is not to be trusted: singular matrices are for the LU to judge.
const LOST: f64 = 1e-13;
/// Nor is one that grew more than this: what the diagonal said is gone from it.
const GROWN: f64 = 1e7;
/// Two entries are the same up to rounding of the sums that they are.
const ALIKE: f64 = 1e-14;

/// The order of a graph, and what its factors look like.
pub struct Order {
    /// Rows of the matrix that the graph's nodes are, and the graph: of each node its neighbours of greater number.
    nodes: Vec<u32>,
    starts: Vec<u32>,
    greater: Vec<u32>,
    /// Rows of the matrix in the order of elimination.
    order: Vec<u32>,
    /// So many of them went as nodes of paths.
    of_paths: usize,
    symbolic: SymbolicCholesky<u32>,
    /// Where it is no blocks: columns one after another that have as many entries, diagonals included.
    runs: Vec<Run>,
    /// The triangle that the factorisation reads, column by column.
    triangle: Pattern,
    /// The place in it of each diagonal, then of each edge in the order of `greater`.
    places: Vec<u32>,
}

impl fmt::Debug for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Order of {}", self.nodes.len())
    }
}

/// The orders worked out so far, to be used again for the same graph: of a mesh all matrices have the same.
#[derive(Clone, Debug, Default)]
pub struct Orders(Vec<Arc<Order>>);

impl Orders {
    /// So many are remembered.
    const MOST: usize = 4;

    fn get(&mut self, nodes: &[u32], starts: &[u32], greater: &[u32]) -> Option<Arc<Order>> {
        let same = |known: &&Arc<Order>| {
            known.nodes == nodes && known.starts == starts && known.greater == greater
        };
        if let Some(known) = self.0.iter().find(same) {
            return Some(known.clone());
        }
        let new = Arc::new(Order::new(nodes, starts, greater)?);
        if self.0.len() == Self::MOST {
            self.0.remove(0);
        }
        self.0.push(new.clone());
        Some(new)
    }
}

impl Order {
    fn new(nodes: &[u32], starts: &[u32], greater: &[u32]) -> Option<Order> {
        let n = nodes.len();
        let edges = || {
            (0..n).flat_map(|j| {
                let range = starts[j] as usize..starts[j + 1] as usize;
                greater[range].iter().map(move |i| (j as u32, *i))
            })
        };
        let mut left = n;
        let order = paths::order(n, edges(), |rest| {
            left = rest.n;
            by_degree(rest)
        })?;
        let mut place = vec![0u32; n];
        order.iter().enumerate().for_each(|(k, node)| place[*node as usize] = k as u32);
        let triangle = |upper: bool| {
            let pairs: Vec<(u32, u32)> = (0..n as u32)
                .map(|j| (j, j))
                .chain(edges())
                .map(|(j, i)| {
                    let (j, i) = (place[j as usize], place[i as usize]);
                    if upper { (i.min(j), i.max(j)) } else { (i.max(j), i.min(j)) }
                })
                .collect();
            Pattern::from_triplets(n, &pairs)
        };
        let (mut triangle_used, mut places) = triangle(true);
        let symbolic = factorize_symbolic_cholesky(
            symbolic_of(&triangle_used),
            faer::Side::Upper,
            SymmetricOrdering::Identity,
            CholeskySymbolicParams::default(),
        )
        .ok()?;
        let mut runs = vec![];
        match symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(_) => (triangle_used, places) = triangle(false),
            SymbolicCholeskyRaw::Simplicial(factor) => runs = Run::all(factor.col_ptr()),
        }
        Some(Order {
            nodes: nodes.to_vec(),
            starts: starts.to_vec(),
            greater: greater.to_vec(),
            order: order.iter().map(|node| nodes[*node as usize]).collect(),
            of_paths: n - left,
            symbolic,
            runs,
            triangle: triangle_used,
            places,
        })
    }
}

/// Nodes of a graph by approximate minimum degree.
fn by_degree(graph: &Pattern) -> Option<Vec<u32>> {
    let (mut order, mut place) = (vec![0u32; graph.n], vec![0u32; graph.n]);
    let scratch = amd::order_scratch::<u32>(graph.n, graph.len());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    let control = amd::Control::default();
    let stack = MemStack::new(&mut memory);
    amd::order(&mut order, &mut place, symbolic_of(graph), control, stack).ok()?;
    Some(order)
}

fn symbolic_of(pattern: &Pattern) -> SymbolicSparseColMatRef<'_, u32> {
    SymbolicSparseColMatRef::new_checked(pattern.n, pattern.n, &pattern.starts, None, &pattern.rows)
}

/// The factors of a symmetric part of a matrix.
pub struct Cholesky {
    order: Arc<Order>,
    /// The slot of each entry of the triangle, and of its mirror image.
    slots: Vec<[u32; 2]>,
    values: Vec<f64>,
    /// L with D on its diagonal, and 1/D.
    factors: Vec<f64>,
    inverse: Vec<f64>,
    memory: MemBuffer,
    /// The vector in the order of elimination, and what a block takes from it.
    vector: Vec<f64>,
    block: Vec<f64>,
}

impl fmt::Debug for Cholesky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Cholesky, {:?}, {} entries", self.order, self.factors.len())
    }
}

impl Cholesky {
    /// Room for the factors of the rows and columns `nodes`, where these are a symmetric matrix for the values; `slots`
    /// are its entries.
    pub fn find(
        pattern: &Pattern,
        values: &[f64],
        nodes: &[u32],
        slots: &[u32],
        orders: &mut Orders,
    ) -> Option<Cholesky> {
        let n = nodes.len();
        const NONE: u32 = u32::MAX;
        let mut number = vec![NONE; pattern.n];
        for (k, node) in nodes.iter().enumerate() {
            number[*node as usize] = k as u32;
        }
        let mut diagonal = vec![NONE; n];
        let mut starts = vec![0u32];
        let (mut greater, mut pairs) = (vec![], vec![]);
        let mut less = 0usize;
        let mut at = slots.iter().copied().peekable();
        for (j, &column) in nodes.iter().enumerate() {
            while let Some(slot) =
                at.next_if(|slot| pattern.column(column as usize).contains(&(*slot as usize)))
            {
                let row = pattern.rows[slot as usize];
                match number[row as usize] {
                    NONE => return None,
                    i if i as usize == j => diagonal[j] = slot,
                    i if i as usize > j => {
                        let mirror = pattern.slot(column, row)? as u32;
                        greater.push(i);
                        pairs.push([slot, mirror]);
                    }
                    _ => less += 1,
                }
            }
            starts.push(greater.len() as u32);
        }
        let alike = |[a, b]: &[u32; 2]| alike(values[*a as usize], values[*b as usize]);
        if less != pairs.len() || diagonal.contains(&NONE) || !pairs.iter().all(alike) {
            return None;
        }
        let order = orders.get(nodes, &starts, &greater)?;
        let mut slots = vec![[0, 0]; order.triangle.len()];
        let all = diagonal.iter().map(|slot| [*slot, *slot]).chain(pairs);
        for (place, pair) in order.places.iter().zip(all) {
            slots[*place as usize] = pair;
        }
        let (scratch, widest) = match order.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(_) => {
                (simplicial::factorize_simplicial_numeric_ldlt_scratch::<u32, f64>(n), 0)
            }
            SymbolicCholeskyRaw::Supernodal(factor) => (
                supernodal::factorize_supernodal_numeric_ldlt_scratch::<u32, f64>(
                    factor,
                    Par::Seq,
                    Default::default(),
                ),
                Blocks::of(factor).map(|block| block.height - block.width).max().unwrap_or(0),
            ),
        };
        Some(Cholesky {
            values: vec![0.0; slots.len()],
            slots,
            factors: vec![0.0; order.symbolic.len_val()],
            inverse: vec![0.0; n],
            memory: MemBuffer::try_new(scratch).ok()?,
            vector: vec![0.0; n],
            block: vec![0.0; widest],
            order,
        })
    }

    /// Whether most of it is long paths, which are solved many nodes at a time.
    pub fn is_of_paths(&self) -> bool {
        2 * self.order.of_paths > self.order.nodes.len()
    }

    /// Factors new values.
    pub fn load(&mut self, values: &[f64]) -> Result<(), Unfit> {
        for (own, [slot, mirror]) in self.values.iter_mut().zip(&self.slots) {
            *own = values[*slot as usize];
            if !alike(*own, values[*mirror as usize]) {
                return Err(Unfit::Values);
            }
        }
        let order = &*self.order;
        let matrix = SparseColMatRef::new(symbolic_of(&order.triangle), &self.values);
        let stack = MemStack::new(&mut self.memory);
        let regular = LdltRegularization::default();
        match order.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(factor) => {
                simplicial::factorize_simplicial_numeric_ldlt(
                    &mut self.factors,
                    matrix,
                    regular,
                    factor,
                    stack,
                )
                .map_err(|_| Unfit::Values)?;
                // In the upper triangle a column ends with its diagonal.
                for (j, &start) in factor.col_ptr()[..order.nodes.len()].iter().enumerate() {
                    let last = order.triangle.starts[j + 1] as usize - 1;
                    let pivot = self.factors[start as usize];
                    self.inverse[j] = inverse(pivot, self.values[last])?;
                }
            }
            SymbolicCholeskyRaw::Supernodal(factor) => {
                supernodal::factorize_supernodal_numeric_ldlt(
                    &mut self.factors,
                    matrix,
                    regular,
                    factor,
                    Par::Seq,
                    stack,
                    Default::default(),
                )
                .map_err(|_| Unfit::Values)?;
                for block in Blocks::of(factor) {
                    for k in 0..block.width {
                        let j = block.first + k;
                        let pivot = self.factors[block.values + k * block.height + k];
                        let first = order.triangle.starts[j] as usize;
                        self.inverse[j] = inverse(pivot, self.values[first])?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Solves for the nodes: `b` by rows of the whole matrix, `x` by its columns.
    pub fn solve(&mut self, b: &[f64], x: &mut [f64]) {
        for (own, row) in self.vector.iter_mut().zip(&self.order.order) {
            *own = b[*row as usize];
        }
        match self.order.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(factor) => {
                let lower = Lower {
                    runs: &self.order.runs,
                    starts: factor.col_ptr(),
                    rows: factor.row_idx(),
                    factors: &self.factors,
                };
                lower.solve(&self.inverse, &mut self.vector);
            }
            SymbolicCholeskyRaw::Supernodal(factor) => {
                let (vector, block) = (&mut self.vector, &mut self.block);
                solve_blocks(factor, &self.factors, &self.inverse, vector, block);
            }
        }
        for (own, column) in self.vector.iter().zip(&self.order.order) {
            x[*column as usize] = *own;
        }
    }
}

fn alike(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= ALIKE * a.abs()
}

/// 1/pivot, where the pivot can be trusted.
fn inverse(pivot: f64, diagonal: f64) -> Result<f64, Unfit> {
    let ratio = pivot / diagonal;
    // Not for a NaN either.
    if (LOST..=GROWN).contains(&ratio) { Ok(1.0 / pivot) } else { Err(Unfit::Values) }
}

/// Columns one after another that have as many entries, the diagonals included.
#[derive(Clone, Copy)]
struct Run {
    first: usize,
    count: usize,
    length: usize,
}

impl Run {
    fn all(starts: &[u32]) -> Vec<Run> {
        let mut runs: Vec<Run> = vec![];
        for (j, ends) in starts.windows(2).enumerate() {
            let length = (ends[1] - ends[0]) as usize;
            match runs.last_mut() {
                Some(run) if run.length == length => run.count += 1,
                _ => runs.push(Run { first: j, count: 1, length }),
            }
        }
        runs
    }
}

/// L by columns, in each of which the diagonal comes first; a loop for each run of columns of few entries.
struct Lower<'a> {
    runs: &'a [Run],
    starts: &'a [u32],
    rows: &'a [u32],
    factors: &'a [f64],
}

impl Lower<'_> {
    /// L·D·Lᵀ·x = b in place.
    fn solve(&self, inverse: &[f64], x: &mut [f64]) {
        for run in self.runs {
            match run.length {
                1 => {}
                2 => self.forward::<2>(run, x),
                3 => self.forward::<3>(run, x),
                4 => self.forward::<4>(run, x),
                _ => (run.first..run.first + run.count).for_each(|j| {
                    let (rows, factors) = self.below(j);
                    let value = x[j];
                    for (row, l) in rows.iter().zip(factors) {
                        x[*row as usize] -= l * value;
                    }
                }),
            }
        }
        for run in self.runs.iter().rev() {
            match run.length {
                1 => self.backward::<1>(run, inverse, x),
                2 => self.backward::<2>(run, inverse, x),
                3 => self.backward::<3>(run, inverse, x),
                4 => self.backward::<4>(run, inverse, x),
                _ => (run.first..run.first + run.count).rev().for_each(|j| {
                    let (rows, factors) = self.below(j);
                    let mut sum = x[j] * inverse[j];
                    for (row, l) in rows.iter().zip(factors) {
                        sum -= l * x[*row as usize];
                    }
                    x[j] = sum;
                }),
            }
        }
    }

    fn below(&self, j: usize) -> (&[u32], &[f64]) {
        let range = self.starts[j] as usize + 1..self.starts[j + 1] as usize;
        (&self.rows[range.clone()], &self.factors[range])
    }

    /// The columns of a run of N entries each.
    fn columns<const N: usize>(&self, run: &Run) -> (&[[u32; N]], &[[f64; N]]) {
        let range = self.starts[run.first] as usize..self.starts[run.first + run.count] as usize;
        (self.rows[range.clone()].as_chunks().0, self.factors[range].as_chunks().0)
    }

    fn forward<const N: usize>(&self, run: &Run, x: &mut [f64]) {
        let (rows, factors) = self.columns::<N>(run);
        for (k, (rows, factors)) in rows.iter().zip(factors).enumerate() {
            let value = x[run.first + k];
            for i in 1..N {
                x[rows[i] as usize] -= factors[i] * value;
            }
        }
    }

    fn backward<const N: usize>(&self, run: &Run, inverse: &[f64], x: &mut [f64]) {
        let (rows, factors) = self.columns::<N>(run);
        let inverse = &inverse[run.first..run.first + run.count];
        for (k, ((rows, factors), inverse)) in
            rows.iter().zip(factors).zip(inverse).enumerate().rev()
        {
            let mut sum = x[run.first + k] * inverse;
            for i in 1..N {
                sum -= factors[i] * x[rows[i] as usize];
            }
            x[run.first + k] = sum;
        }
    }
}

/// A block of columns with the same rows below them: its first column, how many columns and rows it has, where its
/// values and the rows below begin.
struct Block {
    first: usize,
    width: usize,
    height: usize,
    values: usize,
    rows: usize,
}

/// The blocks of a factor, in order.
struct Blocks<'a> {
    factor: &'a supernodal::SymbolicSupernodalCholesky<u32>,
}

impl Blocks<'_> {
    fn of(
        factor: &supernodal::SymbolicSupernodalCholesky<u32>,
    ) -> impl DoubleEndedIterator<Item = Block> + '_ {
        let blocks = Blocks { factor };
        (0..factor.n_supernodes()).map(move |k| blocks.get(k))
    }

    fn get(&self, k: usize) -> Block {
        let first = self.factor.supernode_begin()[k] as usize;
        let width = self.factor.supernode_end()[k] as usize - first;
        let rows = self.factor.col_ptr_for_row_idx()[k] as usize;
        let below = self.factor.nnz_per_super()[k] as usize;
        let values = self.factor.col_ptr_for_val()[k] as usize;
        Block { first, width, height: width + below, values, rows }
    }
}

/// The same where L is dense blocks of columns.
fn solve_blocks(
    factor: &supernodal::SymbolicSupernodalCholesky<u32>,
    factors: &[f64],
    inverse: &[f64],
    x: &mut [f64],
    taken: &mut [f64],
) {
    let all_rows = factor.row_idx();
    for block in Blocks::of(factor) {
        let Block { first, width, height, values, rows } = block;
        let rows = &all_rows[rows..rows + height - width];
        let taken = &mut taken[..rows.len()];
        taken.fill(0.0);
        let (_, own) = x.split_at_mut(first);
        for (k, column) in factors[values..values + width * height].chunks_exact(height).enumerate()
        {
            let value = own[k];
            let (above, below) = column.split_at(width);
            for (x, l) in own[k + 1..width].iter_mut().zip(&above[k + 1..]) {
                *x -= l * value;
            }
            for (x, l) in taken.iter_mut().zip(below) {
                *x += l * value;
            }
        }
        for (row, taken) in rows.iter().zip(taken) {
            x[*row as usize] -= *taken;
        }
    }
    for block in Blocks::of(factor).rev() {
        let Block { first, width, height, values, rows } = block;
        let rows = &all_rows[rows..rows + height - width];
        let taken = &mut taken[..rows.len()];
        for (taken, row) in taken.iter_mut().zip(rows) {
            *taken = x[*row as usize];
        }
        let columns = factors[values..values + width * height].chunks_exact(height);
        for (k, column) in columns.enumerate().rev() {
            let (above, below) = column.split_at(width);
            let j = first + k;
            let sum = dot(&above[k + 1..], &x[j + 1..first + width]) + dot(below, taken);
            x[j] = x[j] * inverse[j] - sum;
        }
    }
}

/// Σ a·b, always in the same order: eight sums side by side.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_parts, b_parts) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a_parts.remainder().iter().zip(b_parts.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_parts.zip(b_parts) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    rest + sums.iter().sum::<f64>()
}
