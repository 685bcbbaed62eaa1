//! Factors in parts (what solves itself, then a symmetric or a general core) against the LU of the whole matrix, over random
//! meshes with sources and inductors, badly scaled ones, and matrices that are not what they look like.

use super::factors::Factors;
use super::lu::backward_error;
use super::tests::{Matrix, Random, condition, random};
use super::*;
use proptest::prelude::*;

/// A random mesh: `nodes` nodes with capacitances to ground, conductances between them over some decades; sources from
/// ground at `sources` of them; behind these `inductors` branches with −αL on their diagonal.
fn mesh(nodes: usize, sources: usize, inductors: usize, decades: f64, r: &mut Random) -> Matrix {
    let mut m = Matrix::new(nodes + sources + inductors);
    for i in 0..nodes {
        m.conductance(i, usize::MAX, r.decade(-decades, decades));
        for _ in 0..2 {
            let other = r.below(nodes);
            if other != i {
                m.conductance(i, other, r.decade(-decades, decades));
            }
        }
    }
    for k in 0..sources {
        // At different nodes.
        m.branch(k * (nodes / sources.max(1)), usize::MAX, nodes + k, 0.0);
    }
    for k in 0..inductors {
        let (a, b) = (r.below(nodes), r.below(nodes));
        let b = if a == b { usize::MAX } else { b };
        m.branch(a, b, nodes + sources + k, r.decade(-decades, decades));
    }
    m
}

/// Solves with one step of refinement, and says what error was left.
fn refined(factors: &mut Factors, pattern: &Pattern, values: &[f64], b: &[f64]) -> (Vec<f64>, f64) {
    let mut residual = vec![0.0; b.len()];
    let mut x = b.to_vec();
    factors.solve(&mut x);
    for _ in 0..2 {
        backward_error(pattern, values, b, &x, &mut residual);
        factors.solve(&mut residual);
        x.iter_mut().zip(&residual).for_each(|(x, d)| *x += d);
    }
    let error = backward_error(pattern, values, b, &x, &mut residual);
    (x, error)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(11), ..ProptestConfig::default() })]

    #[test]
    fn long_lines_are_solved_many_nodes_at_a_time(
        seed: u64, nodes in 256usize..700, taps in 0usize..20, decades in 0.0f64..3.0,
    ) {
        let mut r = Random(seed);
        let mut m = Matrix::new(nodes + 1);
        for i in 0..nodes {
            m.conductance(i, usize::MAX, r.decade(-decades, decades));
            if i > 0 {
                m.conductance(i, i - 1, r.decade(-decades, decades));
            }
        }
        // Branches from one part of the line to another, and a source at its end.
        for _ in 0..taps {
            let (a, b) = (r.below(nodes), r.below(nodes));
            if a != b {
                m.conductance(a, b, r.decade(-decades, decades));
            }
        }
        m.branch(0, usize::MAX, nodes, 0.0);
        let (pattern, values) = m.pattern();
        let mut factors = Factors::new(&pattern, &values, false, &mut Orders::default()).unwrap();
        prop_assert!(factors.is_symmetric());
        let b: Vec<f64> = (0..m.n).map(|_| r.unit()).collect();
        let k = r.decade(-3.0, 3.0);
        let scaled: Vec<f64> = values.iter().map(|v| k * v).collect();
        for values in [&values, &scaled] {
            prop_assert_eq!(factors.refactor(values), Ok(()));
            let (x, error) = refined(&mut factors, &pattern, values, &b);
            prop_assert!(error < 1e-13, "{error}");
            let lu = Lu::factor(&pattern, values).unwrap();
            let (mut y, mut residual, mut work) = (b.clone(), vec![0.0; m.n], vec![0.0; m.n]);
            lu.solve(&mut y, &mut work);
            lu.refine(&pattern, values, &b, &mut y, &mut residual, &mut work);
            let scale = y.iter().fold(0.0f64, |s, v| s.max(v.abs()));
            prop_assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() <= 1e-9 * scale));
        }
    }

    #[test]
    fn meshes_are_factored_as_symmetric_ones(
        seed: u64, nodes in 2usize..70, sources in 0usize..3, inductors in 0usize..6, decades in 0.0f64..4.0,
    ) {
        let mut r = Random(seed);
        let m = mesh(nodes, sources.min(nodes - 1), inductors, decades, &mut r);
        let (pattern, values) = m.pattern();
        let condition = condition(&m.dense());
        prop_assume!(condition < 1e10);
        let mut factors = Factors::in_parts(&pattern, &values, &mut Orders::default()).unwrap();
        // Where all solves itself, nothing is left to be symmetric.
        prop_assert!(!factors.is_general() || decades > 2.0);
        let b: Vec<f64> = (0..m.n).map(|_| r.unit()).collect();
        let (x, error) = refined(&mut factors, &pattern, &values, &b);
        prop_assert!(error < 1e-13, "{error}");
        let lu = Lu::factor(&pattern, &values).unwrap();
        let mut y = b.clone();
        let (mut residual, mut work) = (vec![0.0; m.n], vec![0.0; m.n]);
        lu.solve(&mut y, &mut work);
        lu.refine(&pattern, &values, &b, &mut y, &mut residual, &mut work);
        let scale = x.iter().chain(&y).fold(0.0f64, |s, v| s.max(v.abs()));
        for (x, y) in x.iter().zip(&y) {
            prop_assert!((x - y).abs() <= 1e-13 * condition * scale, "{x} {y} {condition}");
        }
        // Other values of the same pattern, of which the symmetric ones go the same way.
        let k = r.decade(-3.0, 3.0);
        let scaled: Vec<f64> = values.iter().map(|v| k * v).collect();
        prop_assert_eq!(factors.refactor(&scaled), Ok(()));
        let (z, _) = refined(&mut factors, &pattern, &scaled, &b);
        for (x, z) in x.iter().zip(&z) {
            prop_assert!((x - k * z).abs() <= 1e-13 * condition * scale, "{x} {z} {condition}");
        }
        // And the first ones again give the same bits.
        prop_assert_eq!(factors.refactor(&values), Ok(()));
        prop_assert_eq!(refined(&mut factors, &pattern, &values, &b).0, x);
    }

    #[test]
    fn any_matrix_is_solved_in_parts(seed: u64, kind in 0..super::tests::KINDS, n in 1usize..60) {
        let mut r = Random(seed);
        let m = random(kind, n, &mut r);
        let (pattern, values) = m.pattern();
        let condition = condition(&m.dense());
        prop_assume!(condition < 1e10);
        let Some(mut factors) = Factors::in_parts(&pattern, &values, &mut Orders::default()) else {
            // Nothing solves itself: the whole matrix is factored.
            return Ok(());
        };
        let b: Vec<f64> = (0..n).map(|_| r.unit()).collect();
        let (_, error) = refined(&mut factors, &pattern, &values, &b);
        prop_assert!(error < 1e-11, "{error} {condition}");
    }

    #[test]
    fn indefinite_ones_go_the_general_way(seed: u64, nodes in 4usize..60) {
        let mut r = Random(seed);
        let mut m = mesh(nodes, 1, 0, 1.0, &mut r);
        // A negative conductance between two nodes that outweighs all others: symmetric with a positive diagonal, not
        // positive definite.
        let (a, b) = (1, 2 + r.below(nodes - 2));
        m.add(a, b, 1e4);
        m.add(b, a, 1e4);
        let (pattern, values) = m.pattern();
        prop_assume!(condition(&m.dense()) < 1e10);
        let mut factors = Factors::in_parts(&pattern, &values, &mut Orders::default()).unwrap();
        prop_assert!(!factors.is_symmetric());
        let b: Vec<f64> = (0..m.n).map(|_| r.unit()).collect();
        let (_, error) = refined(&mut factors, &pattern, &values, &b);
        prop_assert!(error < 1e-13, "{error}");
    }
}

#[test]
fn values_of_another_kind_are_refused() {
    let mut m = mesh(40, 1, 2, 1.0, &mut Random(3));
    m.add(5, 7, 0.0);
    m.add(7, 5, 0.0);
    m.add(9, 9, 0.0);
    let (pattern, values) = m.pattern();
    let mut factors = Factors::in_parts(&pattern, &values, &mut Orders::default()).unwrap();
    assert!(factors.is_symmetric());
    let changed = |row: u32, column: u32, by: f64| {
        let mut values = values.clone();
        values[pattern.slot(row, column).unwrap()] += by;
        values
    };
    // A slope that only one of two nodes feels, mostly where there was no entry; a negative conductance; no number.
    let zero = values[pattern.slot(5, 7).unwrap()] == 0.0;
    assert_eq!(
        factors.refactor(&changed(7, 5, 1.0)),
        Err(if zero { Unfit::Entry } else { Unfit::Values })
    );
    let mut indefinite = changed(9, 9, 0.0);
    let (row, column) =
        m.places.iter().copied().find(|(i, j)| *i == 9 && *j < 40 && *j > 9).unwrap();
    indefinite[pattern.slot(row, column).unwrap()] = 1e4;
    indefinite[pattern.slot(column, row).unwrap()] = 1e4;
    assert_eq!(factors.refactor(&indefinite), Err(Unfit::Values));
    assert_eq!(factors.refactor(&changed(9, 9, f64::NAN)), Err(Unfit::Values));
    assert_eq!(factors.refactor(&values), Ok(()));
}

#[test]
fn floating_meshes_are_singular() {
    // Nothing leads to ground: no pivot is exactly 0, and none is taken for more than it is.
    let mut m = Matrix::new(400);
    for i in 0..20 {
        for j in 0..20 {
            if i + 1 < 20 {
                m.conductance(20 * i + j, 20 * i + j + 20, 1.0 / 3.0 + i as f64);
            }
            if j + 1 < 20 {
                m.conductance(20 * i + j, 20 * i + j + 1, 0.1 + j as f64);
            }
        }
    }
    let (pattern, values) = m.pattern();
    assert!(Factors::in_parts(&pattern, &values, &mut Orders::default()).is_none());
    // With a source at one node nothing floats any more.
    m.n = 401;
    m.branch(0, usize::MAX, 400, 0.0);
    let (pattern, values) = m.pattern();
    let factors = Factors::in_parts(&pattern, &values, &mut Orders::default());
    assert!(factors.unwrap().is_symmetric());
}

#[test]
fn large_meshes_are_symmetric_and_others_stay() {
    let grid = |side: usize| {
        let mut m = Matrix::new(side * side + 1);
        for i in 0..side {
            for j in 0..side {
                let node = side * i + j;
                m.conductance(node, usize::MAX, 1.0);
                for (next, there) in [(node + side, i + 1 < side), (node + 1, j + 1 < side)] {
                    if there {
                        m.conductance(node, next, 1.0);
                    }
                }
            }
        }
        m.branch(0, usize::MAX, side * side, 0.0);
        m
    };
    for (side, symmetric) in [(10, false), (60, true)] {
        let m = grid(side);
        let (pattern, values) = m.pattern();
        let mut orders = Orders::default();
        let mut factors = Factors::new(&pattern, &values, false, &mut orders).unwrap();
        assert_eq!(factors.is_symmetric(), symmetric, "{side}");
        // The current that a source of 1 V gives is what flows through all conductances to ground.
        let mut x = vec![0.0; m.n];
        x[side * side] = 1.0;
        factors.solve(&mut x);
        assert_eq!(x[0], 1.0);
        let drawn: f64 = x[..side * side].iter().sum();
        assert!((drawn + x[side * side]).abs() < 1e-13 * drawn, "{drawn} {}", x[side * side]);
    }
}
