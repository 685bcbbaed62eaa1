//! Pencils whose roots are known.

use super::*;

type Triplets = Vec<(u32, u32, f64)>;

/// Companion pencil of a polynomial a₀ + a₁·s + …: its roots are the polynomial's.
fn companion(coefficients: &[f64]) -> (usize, Triplets, Triplets) {
    let n = coefficients.len() as u32 - 1;
    let mut fixed: Vec<(u32, u32, f64)> = (1..n).map(|k| (k - 1, k, -1.0)).collect();
    fixed.extend((0..n).map(|k| (n - 1, k, coefficients[k as usize])));
    let mut storage: Vec<(u32, u32, f64)> = (0..n - 1).map(|k| (k, k, 1.0)).collect();
    storage.push((n - 1, n - 1, coefficients[n as usize]));
    (n as usize, fixed, storage)
}

fn roots(coefficients: &[f64]) -> Vec<Root> {
    let (n, fixed, storage) = companion(coefficients);
    finite_roots(n, &fixed, &storage, &|| true).unwrap()
}

fn near(found: &[Root], wanted: &[(f64, f64, usize)], part: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    for (root, (re, im, multiplicity)) in found.iter().zip(wanted) {
        let off = size(root.at - Complex::new(*re, *im)) / re.hypot(*im).max(1e-300);
        assert!(off < part, "{root:?} is {off:e} off {re} {im}");
        assert_eq!(root.multiplicity, *multiplicity, "{found:?}");
    }
}

#[test]
fn simple_roots() {
    near(&roots(&[6.0, 5.0, 1.0]), &[(-2.0, 0.0, 1), (-3.0, 0.0, 1)], 1e-14);
    near(&roots(&[5.0, 2.0, 1.0]), &[(-1.0, 2.0, 1), (-1.0, -2.0, 1)], 1e-14);
    // Right half plane, and twelve decades between two roots.
    let root = 1e6 * (1.25f64.sqrt() - 0.5);
    near(&roots(&[-1e6, 1.0, 1e-6]), &[(root, 0.0, 1), (-root - 1e6, 0.0, 1)], 1e-14);
    near(&roots(&[1.0, 1e6 + 1e-6, 1.0]), &[(-1e-6, 0.0, 1), (-1e6, 0.0, 1)], 1e-14);
}

#[test]
fn a_leading_coefficient_of_zero_takes_a_root_to_infinity() {
    near(&roots(&[6.0, 5.0, 1.0, 0.0, 0.0]), &[(-2.0, 0.0, 1), (-3.0, 0.0, 1)], 1e-14);
    assert_eq!(roots(&[3.0, 0.0, 0.0, 0.0]), []);
    let (n, mut fixed, storage) = companion(&[1.0, 1.0, 1.0]);
    fixed.clear();
    let storage: Vec<_> = storage.into_iter().filter(|(row, _, _)| *row > 0).collect();
    assert_eq!(finite_roots(n, &fixed, &storage, &|| true), Err(Trouble::Singular));
}

#[test]
fn multiple_roots_are_one_at_their_mean() {
    near(&roots(&[1.0, 2.0, 1.0]), &[(-1.0, 0.0, 2)], 1e-12);
    near(&roots(&[8.0, 12.0, 6.0, 1.0]), &[(-2.0, 0.0, 3)], 1e-11);
    // (s² + 2s + 5)²·(s + 10)
    near(
        &roots(&[250.0, 225.0, 160.0, 54.0, 14.0, 1.0]),
        &[(-1.0, 2.0, 2), (-1.0, -2.0, 2), (-10.0, 0.0, 1)],
        1e-12,
    );
    near(&roots(&[0.0, 0.0, 3.0, 1.0]), &[(0.0, 0.0, 2), (-3.0, 0.0, 1)], 1e-13);
    // Two that are only near each other stay two.
    near(&roots(&[1.0001, 2.0001, 1.0]), &[(-1.0, 0.0, 1), (-1.0001, 0.0, 1)], 1e-10);
}

#[test]
fn many_roots() {
    // A chain of n cells, s + 2 on the diagonal, −1 beside it: −4·sin²(kπ/(2(n + 1))).
    let n = 120u32;
    let mut fixed = vec![];
    for k in 0..n {
        fixed.push((k, k, 2.0));
        if k > 0 {
            fixed.extend([(k, k - 1, -1.0), (k - 1, k, -1.0)]);
        }
    }
    let storage: Vec<_> = (0..n).map(|k| (k, k, 1.0)).collect();
    let found = finite_roots(n as usize, &fixed, &storage, &|| true).unwrap();
    let exact = |k: u32| {
        let sine = (f64::from(k) * std::f64::consts::PI / (2.0 * f64::from(n + 1))).sin();
        (-4.0 * sine * sine, 0.0, 1)
    };
    near(&found, &(1..=n).map(exact).collect::<Vec<_>>(), 1e-11);
}

#[test]
fn a_determinant_of_rounding_alone_has_no_roots() {
    // (1 + s)·4e-16: exactly of degree 1, and 0 to the last digit at every s.
    let fixed = [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 1.0), (1, 1, 2.0 + 2.0 * f64::EPSILON)];
    let storage = [(0, 0, 1.0), (1, 0, 1.0)];
    assert!(matches!(finite_roots(2, &fixed, &storage, &|| true), Err(Trouble::Singular)));
}
