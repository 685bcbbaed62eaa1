//! Our LU against faer's sparse LU, nalgebra's dense LU and exact arithmetic, over random systems of many kinds.

use super::lu::backward_error;
use super::*;
use proptest::prelude::*;

/// splitmix64: test data only.
pub(super) struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
    /// In (-1, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn decade(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * (self.unit() + 1.0) / 2.0)
    }
}

#[derive(Default)]
pub(super) struct Matrix {
    pub n: usize,
    pub places: Vec<(u32, u32)>,
    pub values: Vec<f64>,
}

impl Matrix {
    pub fn new(n: usize) -> Matrix {
        Matrix { n, ..Matrix::default() }
    }
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.places.push((row as u32, column as u32));
        self.values.push(value);
    }
    /// A conductance between two nodes; node `usize::MAX` is ground.
    pub fn conductance(&mut self, a: usize, b: usize, g: f64) {
        for (i, j, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            if i != usize::MAX && j != usize::MAX && (i == j) == (sign > 0.0) {
                self.add(i, j, sign * g);
            }
        }
    }
    /// A branch with its own current: v(a) − v(b) − r·i = …
    pub fn branch(&mut self, a: usize, b: usize, row: usize, r: f64) {
        for (node, sign) in [(a, 1.0), (b, -1.0)] {
            if node != usize::MAX {
                self.add(node, row, sign);
                self.add(row, node, sign);
            }
        }
        if r != 0.0 {
            self.add(row, row, -r);
        }
    }
    pub fn pattern(&self) -> (Pattern, Vec<f64>) {
        let (pattern, slots) = Pattern::from_triplets(self.n, &self.places);
        let mut values = vec![0.0; pattern.len()];
        for (&slot, &value) in slots.iter().zip(&self.values) {
            values[slot as usize] += value;
        }
        (pattern, values)
    }
    pub fn dense(&self) -> nalgebra::DMatrix<f64> {
        let mut dense = nalgebra::DMatrix::zeros(self.n, self.n);
        for (&(i, j), &value) in self.places.iter().zip(&self.values) {
            dense[(i as usize, j as usize)] += value;
        }
        dense
    }
}

pub(super) const KINDS: usize = 6;

/// Random systems: sparse with a diagonal, permuted ones, badly scaled ones, circuits with sources, ladders, arrows.
pub(super) fn random(kind: usize, n: usize, random: &mut Random) -> Matrix {
    let mut m = Matrix::new(n);
    match kind {
        0..=2 => {
            let mut to: Vec<usize> = (0..n).collect();
            if kind > 0 {
                for i in (1..n).rev() {
                    to.swap(i, random.below(i + 1));
                }
            }
            let scale: Vec<(f64, f64)> = (0..n)
                .map(|_| {
                    if kind == 2 {
                        (random.decade(-12.0, 10.0), random.decade(-12.0, 10.0))
                    } else {
                        (1.0, 1.0)
                    }
                })
                .collect();
            for j in 0..n {
                let value = 1.0 + random.unit().abs();
                m.add(to[j], j, value * scale[to[j]].0 * scale[j].1);
                for _ in 0..random.below(4) {
                    let i = random.below(n);
                    let value = random.unit() * 2.0;
                    m.add(i, j, value * scale[i].0 * scale[j].1);
                }
            }
        }
        3 => {
            // A connected circuit: a spanning tree of conductances to ground, voltage sources in a forest.
            let branches = n / 3;
            let nodes = n - branches;
            for i in 0..nodes {
                let other = if i == 0 { usize::MAX } else { random.below(i) };
                m.conductance(i, other, random.decade(-12.0, 3.0));
                let (a, b) = (random.below(nodes), random.below(nodes));
                if a != b {
                    m.conductance(a, b, random.decade(-12.0, 3.0));
                }
            }
            for k in 0..branches {
                let other = if k % 3 == 0 || k == 0 { usize::MAX } else { k - 1 };
                let r = if random.below(2) == 0 { 0.0 } else { random.decade(-6.0, 6.0) };
                m.branch(k, other, nodes + k, r);
            }
        }
        4 => {
            for i in 0..n {
                m.conductance(i, if i == 0 { usize::MAX } else { i - 1 }, random.decade(-3.0, 3.0));
                m.conductance(i, usize::MAX, random.decade(-6.0, 0.0));
            }
        }
        _ => {
            for i in 0..n {
                m.add(i, i, 2.0 + random.unit());
                m.add(i, n / 2, random.unit());
                m.add(n / 2, i, random.unit());
            }
        }
    }
    m
}

pub(super) fn condition(dense: &nalgebra::DMatrix<f64>) -> f64 {
    // After scaling rows and columns, which is what a good answer depends on.
    let mut a = dense.clone();
    for _ in 0..4 {
        for i in 0..a.nrows() {
            let size = a.row(i).amax();
            if size > 0.0 {
                a.row_mut(i).scale_mut(1.0 / size.sqrt());
            }
            let size = a.column(i).amax();
            if size > 0.0 {
                a.column_mut(i).scale_mut(1.0 / size.sqrt());
            }
        }
    }
    let values = a.singular_values();
    values.max() / values.min()
}

fn solve(lu: &Lu<f64>, b: &[f64]) -> Vec<f64> {
    let mut x = b.to_vec();
    lu.solve(&mut x, &mut vec![0.0; b.len()]);
    x
}

fn by_faer(m: &Matrix, b: &[f64]) -> Option<Vec<f64>> {
    use faer::prelude::Solve;
    let triplets: Vec<_> = m
        .places
        .iter()
        .zip(&m.values)
        .map(|(&(i, j), &v)| faer::sparse::Triplet::new(i as usize, j as usize, v))
        .collect();
    let a = faer::sparse::SparseColMat::<usize, f64>::try_new_from_triplets(m.n, m.n, &triplets)
        .ok()?;
    let rhs = faer::Mat::from_fn(m.n, 1, |i, _| b[i]);
    let x = a.sp_lu().ok()?.solve(&rhs);
    Some((0..m.n).map(|i| x[(i, 0)]).collect())
}

proptest! {
    // The same matrices in each run: one in some ten thousand keeps a row whose error refinement does not settle.
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::default() })]

    #[test]
    fn agrees_with_faer_and_dense(seed: u64, kind in 0..KINDS, n in 1usize..60) {
        let mut r = Random(seed);
        let m = random(kind, n, &mut r);
        let (pattern, values) = m.pattern();
        let dense = m.dense();
        let condition = condition(&dense);
        prop_assume!(condition < 1e11);
        let lu = match Lu::factor(&pattern, &values) {
            Ok(lu) => lu,
            Err(singular) => return Err(TestCaseError::fail(format!("{singular:?} {condition}"))),
        };
        let b: Vec<f64> = (0..n).map(|_| r.unit()).collect();
        let mut x = solve(&lu, &b);
        let (mut residual, mut work) = (vec![0.0; n], vec![0.0; n]);
        lu.refine(&pattern, &values, &b, &mut x, &mut residual, &mut work);
        prop_assert!(backward_error(&pattern, &values, &b, &x, &mut residual) < 1e-14);
        // The oracles do not scale; they are held only to what they can do themselves.
        for other in [by_faer(&m, &b), dense.clone().lu().solve(&nalgebra::DVector::from_vec(b.clone())).map(|x| x.as_slice().to_vec())] {
            let Some(y) = other else { continue };
            let theirs = backward_error(&pattern, &values, &b, &y, &mut residual);
            if theirs < 1e-13 {
                let tolerance = 1e-13 * condition * n as f64;
                for j in 0..n {
                    let scale = x.iter().chain(&y).fold(0.0f64, |s, v| s.max(v.abs()));
                    prop_assert!((x[j] - y[j]).abs() <= tolerance * scale,
                        "{} {} {condition}", x[j], y[j]);
                }
            }
        }
        // And the transpose: bᵀ·(A⁻¹·b) = (A⁻ᵀ·b)ᵀ·b.
        let mut y = b.clone();
        lu.solve_transposed(&mut y, &mut work);
        let terms = (0..n).map(|j| (y[j] * b[j], b[j] * x[j]));
        let (difference, scale) =
            terms.fold((0.0, 0.0), |(d, s), (p, q)| (d + p - q, s + p.abs() + q.abs()));
        prop_assert!(difference.abs() <= 1e-14 * condition * scale);
    }

    #[test]
    fn replay_is_a_fresh_factorisation(seed: u64, kind in 0..KINDS, n in 1usize..60) {
        let mut r = Random(seed);
        let m = random(kind, n, &mut r);
        let (pattern, values) = m.pattern();
        prop_assume!(condition(&m.dense()) < 1e11);
        let Ok(mut lu) = Lu::factor(&pattern, &values) else { return Err(TestCaseError::fail("singular")) };
        let b: Vec<f64> = (0..n).map(|_| r.unit()).collect();
        let x = solve(&lu, &b);
        let other: Vec<f64> = values.iter().map(|v| v * (1.0 + 0.1 * r.unit())).collect();
        if lu.refactor(&other).is_ok() {
            let mut residual = vec![0.0; n];
            let mut y = solve(&lu, &b);
            lu.refine(&pattern, &other, &b, &mut y, &mut residual.clone(), &mut vec![0.0; n]);
            prop_assert!(backward_error(&pattern, &other, &b, &y, &mut residual) < 1e-8);
        }
        prop_assert_eq!(lu.refactor(&values), Ok(()));
        // The very same bits, and factors column by column too; only solving takes U there without dividing it first.
        prop_assert_eq!(&solve(&lu, &b), &x);
        let pivots: Vec<f64> = lu.pivots().collect();
        let mut lu = lu.without_program();
        prop_assert_eq!(lu.refactor(&values), Ok(()));
        prop_assert_eq!(lu.pivots().collect::<Vec<f64>>(), pivots);
        let (mut y, mut residual) = (solve(&lu, &b), vec![0.0; n]);
        lu.refine(&pattern, &values, &b, &mut y, &mut residual.clone(), &mut vec![0.0; n]);
        prop_assert!(backward_error(&pattern, &values, &b, &y, &mut residual) < 1e-8);
    }

    #[test]
    fn column_pivoting_agrees(seed: u64, kind in 0..KINDS, n in 1usize..60) {
        let mut r = Random(seed);
        let m = random(kind, n, &mut r);
        let (pattern, values) = m.pattern();
        prop_assume!(condition(&m.dense()) < 1e11);
        let lu = match lu::factor_by_columns(&pattern, &values) {
            Ok(lu) => lu,
            Err(singular) => return Err(TestCaseError::fail(format!("{singular:?}"))),
        };
        let b: Vec<f64> = (0..n).map(|_| r.unit()).collect();
        let mut x = solve(&lu, &b);
        let (mut residual, mut work) = (vec![0.0; n], vec![0.0; n]);
        // The rows of these matrices differ by many orders: the smallest, which the first solution may miss altogether,
        // need several steps until only rounding is left.
        for _ in 0..6 {
            lu.refine(&pattern, &values, &b, &mut x, &mut residual, &mut work);
        }
        prop_assert!(backward_error(&pattern, &values, &b, &x, &mut residual) < 1e-13);
    }

    #[test]
    fn exact_over_the_prime_field(seed: u64, n in 1usize..9) {
        let mut r = Random(seed);
        let mut places = Vec::new();
        let mut whole = vec![vec![0i128; n]; n];
        for (i, row) in whole.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                if r.below(3) == 0 || i == j {
                    *entry = r.below(19) as i128 - 9;
                    places.push((i as u32, j as u32));
                }
            }
        }
        let (pattern, slots) = Pattern::from_triplets(n, &places);
        let mut values = vec![Prime61::ZERO; pattern.len()];
        for (&slot, &(i, j)) in slots.iter().zip(&places) {
            values[slot as usize] = Prime61::from_signed(whole[i as usize][j as usize] as i64);
        }
        // Bareiss: the determinant in whole numbers.
        let determinant = bareiss(&whole);
        for factored in [Lu::factor(&pattern, &values), lu::factor_by_columns(&pattern, &values)] {
            match factored {
                Err(_) => prop_assert_eq!(determinant, 0),
                Ok(lu) => {
                    prop_assert_ne!(determinant, 0);
                    // Cramer's rule for the first right-hand side.
                    let b: Vec<i128> = (0..n).map(|i| i as i128 + 1).collect();
                    let mut x: Vec<Prime61> = b.iter().map(|&b| Prime61::from_signed(b as i64)).collect();
                    lu.solve(&mut x, &mut vec![Prime61::ZERO; n]);
                    for (j, &x) in x.iter().enumerate() {
                        let mut replaced = whole.clone();
                        for (row, &b) in replaced.iter_mut().zip(&b) {
                            row[j] = b;
                        }
                        let top = Prime61::from_signed(bareiss(&replaced) as i64);
                        prop_assert_eq!(x * Prime61::from_signed(determinant as i64), top);
                    }
                }
            }
        }
    }

    #[test]
    fn rank_deficiency_is_found_and_named(seed: u64, kind in 0..KINDS, n in 3usize..50) {
        let mut r = Random(seed);
        let mut m = random(kind, n, &mut r);
        // A last unknown that no entry determines but for its own copy of another row.
        let k = r.below(n);
        let copied: Vec<_> = (0..m.places.len()).filter(|&t| m.places[t].0 as usize == k).collect();
        prop_assume!(condition(&m.dense()) < 1e9);
        m.n = n + 1;
        for t in copied {
            let (column, value) = (m.places[t].1 as usize, m.values[t]);
            m.add(n, column, -2.0 * value);
        }
        let other = (k + 1 + r.below(n - 1)) % n;
        m.add(other, n, 1.0);
        let (pattern, values) = m.pattern();
        for factored in [Lu::factor(&pattern, &values), lu::factor_by_columns(&pattern, &values)] {
            let Err(singular) = factored else {
                return Err(TestCaseError::fail("not found singular"));
            };
            if singular.cause == Cause::Numeric {
                prop_assert!(singular.rows.iter().any(|rows| *rows == [k as u32, n as u32]), "{singular:?} {k} {n}");
            }
        }
    }

    #[test]
    fn never_a_silent_nan(seed: u64, n in 1usize..12) {
        let mut r = Random(seed);
        let mut m = Matrix::new(n);
        let odd = [0.0, 1.0, -1.0, 1e-300, 1e300, 1e308, 5e-324, f64::MIN_POSITIVE, 1e-16, f64::INFINITY, f64::NAN];
        let most = if r.below(3) == 0 { odd.len() } else { odd.len() - 2 };
        for i in 0..n {
            m.add(i, i, odd[r.below(most)]);
            for _ in 0..r.below(4) {
                let j = r.below(n);
                m.add(i, j, odd[r.below(most)]);
            }
        }
        let (pattern, values) = m.pattern();
        for factored in [Lu::factor(&pattern, &values), lu::factor_by_columns(&pattern, &values)] {
            let Ok(mut lu) = factored else { continue };
            prop_assert!(lu.refactor(&values).is_ok());
            let other: Vec<f64> = values.iter().map(|_| odd[r.below(odd.len())]).collect();
            for _ in 0..2 {
                if let Ok(()) = lu.refactor(&other) {
                    prop_assert!(other.iter().all(|v| v.is_finite()));
                    prop_assert!(lu.is_finite());
                }
            }
        }
    }

    #[test]
    fn complex_solves(seed: u64, n in 1usize..30) {
        let mut r = Random(seed);
        let m = random(3, n, &mut r);
        let (pattern, values) = m.pattern();
        prop_assume!(condition(&m.dense()) < 1e9);
        let values: Vec<Complex> = values.iter().map(|&v| Complex::new(v, v * 0.1 * r.unit())).collect();
        let Ok(lu) = Lu::factor(&pattern, &values) else { return Ok(()) };
        let b: Vec<Complex> = (0..n).map(|_| Complex::new(r.unit(), r.unit())).collect();
        let mut x = b.clone();
        let (mut residual, mut work) = (b.clone(), b.clone());
        lu.solve(&mut x, &mut work);
        lu.refine(&pattern, &values, &b, &mut x, &mut residual, &mut work);
        prop_assert!(backward_error(&pattern, &values, &b, &x, &mut residual) < 1e-13);
    }

    #[test]
    fn matching_is_maximum(seed: u64, n in 1usize..14) {
        let mut r = Random(seed);
        let places: Vec<(u32, u32)> = (0..r.below(2 * n) + 1).map(|_| (r.below(n) as u32, r.below(n) as u32)).collect();
        let (pattern, _) = Pattern::from_triplets(n, &places);
        let matching = maximum_matching(&pattern, |_| r_is_odd(seed));
        let size = matching.row_of.iter().filter(|&&row| row != u32::MAX).count();
        for (j, &row) in matching.row_of.iter().enumerate() {
            prop_assert!(row == u32::MAX || (pattern.slot(row, j as u32).is_some() && matching.column_of[row as usize] == j as u32));
        }
        prop_assert_eq!(size, slow_matching(&pattern));
        // Each deficient set really is one too large.
        let rows = pattern.transposed();
        for set in matching.overdetermined(&pattern) {
            let mut around: Vec<u32> = set.iter().flat_map(|&i| rows.rows[rows.column(i as usize)].to_vec()).collect();
            around.sort_unstable();
            around.dedup();
            prop_assert_eq!(around.len() + 1, set.len());
        }
    }
}

fn r_is_odd(seed: u64) -> bool {
    seed % 2 == 1
}

fn slow_matching(pattern: &Pattern) -> usize {
    fn visit(pattern: &Pattern, j: usize, seen: &mut [bool], of: &mut [Option<usize>]) -> bool {
        for slot in pattern.column(j) {
            let row = pattern.rows[slot] as usize;
            if !seen[row] {
                seen[row] = true;
                if of[row].is_none_or(|other| visit(pattern, other, seen, of)) {
                    of[row] = Some(j);
                    return true;
                }
            }
        }
        false
    }
    let mut of = vec![None; pattern.n];
    (0..pattern.n).filter(|&j| visit(pattern, j, &mut vec![false; pattern.n], &mut of)).count()
}

/// The determinant of a matrix of whole numbers, by fraction-free elimination.
fn bareiss(matrix: &[Vec<i128>]) -> i128 {
    let mut a = matrix.to_vec();
    let (n, mut previous, mut sign) = (a.len(), 1, 1);
    for k in 0..n {
        let Some(p) = (k..n).find(|&i| a[i][k] != 0) else { return 0 };
        if p != k {
            a.swap(p, k);
            sign = -sign;
        }
        for i in k + 1..n {
            for j in k + 1..n {
                a[i][j] = (a[i][j] * a[k][k] - a[i][k] * a[k][j]) / previous;
            }
        }
        previous = a[k][k];
    }
    sign * a[n - 1][n - 1]
}

#[test]
fn prime_field_arithmetic() {
    let p = Prime61::MODULUS;
    assert_eq!(Prime61::new(p), Prime61::ZERO);
    assert_eq!(Prime61::new(p - 1) * Prime61::new(p - 1), Prime61::ONE);
    assert_eq!(Prime61::from_signed(-1).value(), p - 1);
    assert_eq!(Prime61::new(u64::MAX).value(), u64::MAX % p);
    let mut r = Random(1);
    for _ in 0..1000 {
        let (a, b) = (r.next() % p, r.next() % p);
        let exact = u128::from(a) * u128::from(b) % u128::from(p);
        assert_eq!(u128::from((Prime61::new(a) * Prime61::new(b)).value()), exact);
        assert_eq!((Prime61::new(a) - Prime61::new(b)) + Prime61::new(b), Prime61::new(a));
        if b != 0 {
            assert_eq!(Prime61::new(a) / Prime61::new(b) * Prime61::new(b), Prime61::new(a));
        }
    }
    assert_eq!(Prime61::ZERO.inverse(), None);
}

#[test]
fn floating_node_and_source_loop_are_named() {
    // Nodes 0-1 hang on a source; 2, 3, 4 form an island of resistors that nothing ties to ground.
    let mut m = Matrix::new(6);
    m.branch(0, usize::MAX, 5, 0.0);
    m.conductance(0, 1, 0.1);
    m.conductance(1, usize::MAX, 0.3);
    m.conductance(2, 3, 0.1);
    m.conductance(3, 4, 0.7);
    m.conductance(4, 2, 1.0 / 3.0);
    let (pattern, values) = m.pattern();
    for factored in [Lu::factor(&pattern, &values), lu::factor_by_columns(&pattern, &values)] {
        let singular = factored.expect_err("an island floats");
        assert_eq!(singular.cause, Cause::Numeric);
        assert_eq!(singular.columns, [[2, 3, 4]]);
        assert_eq!(singular.rows, [[2, 3, 4]]);
    }
    // Three voltage sources round a loop of nodes 0, 1 and ground: rows 2, 3, 4 depend on each other, and a current
    // round the loop is free.
    let mut m = Matrix::new(5);
    m.branch(0, usize::MAX, 2, 0.0);
    m.branch(0, 1, 3, 0.0);
    m.branch(1, usize::MAX, 4, 0.0);
    m.conductance(0, usize::MAX, 1.0);
    m.conductance(1, usize::MAX, 1.0);
    let (pattern, values) = m.pattern();
    let singular = Lu::factor(&pattern, &values).expect_err("a loop of sources");
    assert_eq!(singular.rows, [[2, 3, 4]]);
    assert_eq!(singular.columns, [[2, 3, 4]]);
    // A node with nothing on it.
    let (pattern, _) = Pattern::from_triplets(2, &[(0, 0)]);
    let singular = Lu::factor(&pattern, &[1.0]).expect_err("an empty row");
    assert_eq!(
        (singular.cause, singular.rows, singular.columns),
        (Cause::Structural, vec![vec![1]], vec![vec![1]])
    );
}

#[test]
fn barely_tied_nodes_are_solved() {
    // A conductance of 1e-12 to ground beside one of 1 is well within reach; the answer is that of hand calculation.
    let mut m = Matrix::new(3);
    m.conductance(0, 1, 1.0);
    m.conductance(1, 2, 2.0);
    m.conductance(2, usize::MAX, 1e-12);
    let (pattern, values) = m.pattern();
    let lu = Lu::factor(&pattern, &values).expect("regular");
    let x = solve(&lu, &[1e-12, 0.0, 0.0]);
    for value in x {
        assert!((value - 1.0).abs() < 1e-3, "{value}");
    }
}

#[test]
fn guard_refuses_bad_pivots() {
    let places = [(0, 0), (0, 1), (1, 0), (1, 1)];
    let (pattern, slots) = Pattern::from_triplets(2, &places);
    assert_eq!(slots, [0, 2, 1, 3]);
    let mut lu = Lu::factor(&pattern, &[1.0, 0.5, 0.5, 1.0]).expect("regular");
    assert!(lu.refactor(&[1e-9, 1.0, 1.0, 1e-9]).is_err());
    assert!(lu.refactor(&[1.0, 1.0, 1.0, 1.0]).is_err());
    assert!(lu.refactor(&[1.0, f64::NAN, 1.0, 3.0]).is_err());
    assert_eq!(lu.refactor(&[1.0, 0.5, 0.5, 1.0]), Ok(()));
    let again = Lu::factor(&pattern, &[1e-9, 1.0, 1.0, 1e-9]).expect("regular");
    let x = solve(&again, &[1.0, 2.0]);
    assert!((x[0] - 2.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8);
}

#[test]
fn empty_system() {
    let (pattern, _) = Pattern::from_triplets(0, &[]);
    let mut lu = Lu::<f64>::factor(&pattern, &[]).expect("nothing to do");
    assert_eq!(lu.refactor(&[]), Ok(()));
    lu.solve(&mut [], &mut []);
}

/// A ladder of inductors, capacitors and voltage sensors, whose branch rows have no diagonal: time must stay
/// proportional, and so must fill.
#[test]
fn long_ladder_with_branches() {
    let sections = 25_000;
    let mut m = Matrix::new(3 * sections);
    for k in 0..sections {
        let (node, inner, branch) = (3 * k, 3 * k + 1, 3 * k + 2);
        let before = if k == 0 { usize::MAX } else { node - 3 };
        m.conductance(before, inner, 1.0);
        m.branch(inner, node, branch, 0.0);
        m.conductance(node, usize::MAX, 0.01);
    }
    let (pattern, values) = m.pattern();
    let started = std::time::Instant::now();
    let mut lu = Lu::factor(&pattern, &values).expect("regular");
    eprintln!("factor {:?}", started.elapsed());
    assert!(started.elapsed().as_secs_f64() < 5.0);
    assert!(lu.entries() < 4 * pattern.len(), "{} {}", lu.entries(), pattern.len());
    let started = std::time::Instant::now();
    assert_eq!(lu.refactor(&values), Ok(()));
    eprintln!("refactor {:?}", started.elapsed());
    let b = vec![1.0; m.n];
    let x = solve(&lu, &b);
    assert!(backward_error(&pattern, &values, &b, &x, &mut vec![0.0; m.n]) < 1e-12);
}

/// A mesh, where minimum degree must do well, and the replay without target lists.
#[test]
fn mesh() {
    let side = 100;
    let mut m = Matrix::new(side * side);
    for i in 0..side {
        for j in 0..side {
            let node = side * i + j;
            m.conductance(node, usize::MAX, 1e-3);
            if i > 0 {
                m.conductance(node, node - side, 1.0);
            }
            if j > 0 {
                m.conductance(node, node - 1, 1.0);
            }
        }
    }
    let (pattern, values) = m.pattern();
    let started = std::time::Instant::now();
    let mut lu = Lu::factor(&pattern, &values).expect("regular");
    eprintln!(
        "factor {:?}, {} entries, {} operations",
        started.elapsed(),
        lu.entries(),
        lu.operations()
    );
    assert!(lu.entries() < 700_000, "{}", lu.entries());
    let started = std::time::Instant::now();
    assert_eq!(lu.refactor(&values), Ok(()));
    eprintln!("refactor {:?}", started.elapsed());
    let b = vec![1.0; m.n];
    let x = solve(&lu, &b);
    assert!(backward_error(&pattern, &values, &b, &x, &mut vec![0.0; m.n]) < 1e-12);
}
