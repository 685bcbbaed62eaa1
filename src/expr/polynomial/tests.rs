//! Identities of polynomials, and divisors that were put in beforehand.

use super::gcd::divisor;
use super::*;

/// A polynomial in some of the first variables with small coefficients.
fn random(seed: &mut u64, variables: usize, terms: usize, degree: u64) -> Polynomial {
    let mut next = |most: u64| {
        *seed =
            seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 33) % most
    };
    let mut sum = Polynomial::zero();
    for _ in 0..terms {
        let mut term = Polynomial::number(next(19) as i64 - 9);
        for k in 0..variables {
            for _ in 0..next(degree + 1) {
                term = term.times(&Polynomial::variable(k)).unwrap();
            }
        }
        sum = sum.plus(&term);
    }
    sum
}

#[test]
fn rings_and_quotients() {
    let mut seed = 1;
    for _ in 0..40 {
        let [a, b, c] = std::array::from_fn(|_| random(&mut seed, 4, 6, 2));
        let left = a.plus(&b).times(&c).unwrap();
        let right = a.times(&c).unwrap().plus(&c.times(&b).unwrap());
        assert_eq!(left, right);
        assert!(left.minus(&right).is_zero());
        let product = a.times(&b).unwrap();
        if !b.is_zero() {
            assert_eq!(product.divided(&b), Some(a.clone()));
            let more = product.plus(&Polynomial::number(1));
            assert!(b.len() == 1 || more.divided(&b).is_none_or(|q| q.times(&b).unwrap() == more));
        }
    }
    let x = Polynomial::variable(0);
    assert!(x.plus(&Polynomial::number(1)).divided(&x).is_none());
}

#[test]
fn divisors_come_back() {
    let mut seed = 7;
    for round in 0..60 {
        let variables = 2 + round % 4;
        let [a, b, g] = [4, 5, 3].map(|terms| random(&mut seed, variables, terms, 2));
        if a.is_zero() || b.is_zero() || g.is_zero() {
            continue;
        }
        let (p, q) = (a.times(&g).unwrap(), b.times(&g).unwrap());
        let found = p.gcd(&q).unwrap();
        // It divides both, g divides it, and nothing more is left: the rests have none.
        let rests = [p.divided(&found).unwrap(), q.divided(&found).unwrap()];
        assert!(found.divided(&g).is_some() || found.clone().negate().divided(&g).is_some());
        assert!(rests[0].gcd(&rests[1]).unwrap().is_one(), "{round}: {found:?}");
    }
}

#[test]
fn divisors_of_many_variables() {
    // (x0 + 2·x1)·x7 … of sums over thirty variables.
    let sum = |from: usize| {
        (from..30).fold(Polynomial::number(1), |sum, k| sum.plus(&Polynomial::variable(k)))
    };
    let g = Polynomial::variable(0)
        .plus(&Polynomial::number(2).times(&Polynomial::variable(1)).unwrap());
    let (p, q) = (sum(3).times(&g).unwrap(), sum(4).times(&g).unwrap());
    assert_eq!(divisor(&[&p, &q]).unwrap(), g);
    assert!(sum(3).gcd(&sum(4)).unwrap().is_one());
    assert_eq!(divisor(&[&Polynomial::zero(), &g]).unwrap(), g);
}

#[test]
fn growth_ends() {
    let x = Polynomial::variable(3);
    let mut power = x.clone();
    for _ in 0..6 {
        power = power.times(&power).unwrap();
    }
    assert_eq!(power.degree(3), 64);
    assert_eq!(power.times(&power), Err(TooLarge));
    assert_eq!(x.plus(&Polynomial::number(3)).evaluate(&[0.0, 0.0, 0.0, -5.0]), (-2.0, 8.0));
}
