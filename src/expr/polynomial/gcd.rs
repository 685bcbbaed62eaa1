//! The greatest common divisor of polynomials.
//!
//! Whole numbers and monomials come first. What variables the rest of the divisor holds is asked of images: with random
//! values modulo a prime for all variables but one, the divisor's image divides that of the divisors, so that two images
//! without a common factor say that the variable is not in it. Most often none is, and that is all there is to do. Else each
//! polynomial falls into the coefficients that it has over the variables which are not in the divisor, and the divisor is
//! that of all of these. Among polynomials in the same few variables it is found by pseudo-remainders, their contents taken
//! out at each step (D. E. Knuth, *The Art of Computer Programming* 2, 4.6.1).

use super::{Monomial, Polynomial, TooLarge, VARIABLES};
use crate::linear::{Field, Prime61};
use num_bigint::BigInt;
use num_bigint::Sign;
use std::collections::BTreeMap;

/// The greatest common divisor of whole numbers that are not negative.
fn whole(mut a: BigInt, mut b: BigInt) -> BigInt {
    while b.sign() != Sign::NoSign {
        let rest = &a % &b;
        (a, b) = (b, rest);
    }
    a
}

fn size(value: &BigInt) -> BigInt {
    if value.sign() == Sign::Minus { -value } else { value.clone() }
}

impl Polynomial {
    /// The number and the monomial that divide all terms; 0 for 0.
    pub fn term_content(&self) -> Polynomial {
        let Some((first, rest)) = self.terms.split_first() else { return Polynomial::zero() };
        let (mut monomial, mut number) = (first.0, size(&first.1));
        let one = BigInt::from(1);
        for (own, value) in rest {
            if monomial != Monomial::default() {
                monomial = monomial.common(own);
            }
            if number != one {
                number = whole(number, size(value));
            }
            if number == one && monomial == Monomial::default() {
                break;
            }
        }
        Polynomial::term(monomial, number)
    }

    /// The greatest polynomial that divides both, its first coefficient positive; that of 0 and b is b.
    ///
    /// # Errors
    /// When something on the way is too large.
    pub fn gcd(&self, other: &Polynomial) -> Result<Polynomial, TooLarge> {
        divisor(&[self, other])
    }
}

/// The greatest common divisor of several polynomials.
///
/// # Errors
/// When something on the way is too large.
pub fn divisor(all: &[&Polynomial]) -> Result<Polynomial, TooLarge> {
    let mut parts: Vec<&Polynomial> = all.iter().copied().filter(|p| !p.is_zero()).collect();
    parts.sort_by_key(|p| p.len());
    parts.dedup();
    let Some((first, rest)) = parts.split_first() else { return Ok(Polynomial::zero()) };
    let mut content = first.term_content();
    for part in rest {
        content = common_term(&content, &part.term_content());
    }
    if parts.len() == 1 {
        let whole = (*first).clone();
        return Ok(if whole.is_negative() { whole.negate() } else { whole });
    }
    if first.len() == 1 {
        return Ok(content);
    }
    let primitive: Vec<Polynomial> =
        parts.iter().filter_map(|part| part.divided(&part.term_content())).collect();
    let inner = primitive_divisor(&primitive)?;
    inner.times(&content)
}

/// That of two single terms.
fn common_term(a: &Polynomial, b: &Polynomial) -> Polynomial {
    match (a.terms.as_slice(), b.terms.as_slice()) {
        ([(m, x)], [(n, y)]) => Polynomial::term(m.common(n), whole(x.clone(), y.clone())),
        _ => Polynomial::number(1),
    }
}

/// That of polynomials without contents of their own; the smallest first.
fn primitive_divisor(parts: &[Polynomial]) -> Result<Polynomial, TooLarge> {
    let one = Polynomial::number(1);
    let [first, rest @ ..] = parts else { return Ok(one) };
    // What the smallest is, is often what all share.
    if rest.iter().all(|part| part.divided(first).is_some()) {
        return Ok(first.clone());
    }
    let mut shared = vec![];
    for k in (0..VARIABLES).filter(|k| parts.iter().all(|part| part.holds(*k))) {
        if !images_are_coprime(parts, k) {
            shared.push(k);
        }
    }
    if shared.is_empty() {
        return Ok(one);
    }
    // Coefficients over the variables that are not shared.
    let mut pieces: Vec<Polynomial> = vec![];
    for part in parts {
        let mut groups: BTreeMap<Monomial, Vec<(Monomial, BigInt)>> = BTreeMap::new();
        for (monomial, value) in &part.terms {
            let inside = shared
                .iter()
                .fold(Monomial::default(), |inside, k| inside.with(*k, monomial.exponent(*k)));
            let outside = shared.iter().fold(*monomial, |outside, k| outside.with(*k, 0));
            groups.entry(outside).or_default().push((inside, value.clone()));
        }
        pieces.extend(groups.into_values().map(|terms| Polynomial { terms }));
    }
    for piece in &mut pieces {
        let content = piece.term_content();
        *piece = piece.divided(&content).unwrap_or_default();
    }
    pieces.sort_by_key(Polynomial::len);
    pieces.dedup();
    let mut result = pieces[0].clone();
    for piece in &pieces[1..] {
        if result.constant().is_some() {
            break;
        }
        if piece.divided(&result).is_none() {
            result = pair(&result, piece)?;
        }
    }
    // Without contents of its own, and positive.
    let content = result.term_content();
    let result = result.divided(&content).unwrap_or(one);
    Ok(if result.is_negative() { result.negate() } else { result })
}

/// That of two polynomials in the same few variables, by pseudo-remainders.
fn pair(a: &Polynomial, b: &Polynomial) -> Result<Polynomial, TooLarge> {
    let one = Polynomial::number(1);
    let both = |k: &usize| a.holds(*k) && b.holds(*k);
    let Some(k) = (0..VARIABLES).filter(both).min_by_key(|k| a.degree(*k).min(b.degree(*k))) else {
        // Only in numbers, and in coefficients over variables that one of them lacks.
        return match (0..VARIABLES).find(|k| a.holds(*k) || b.holds(*k)) {
            None => Ok(one),
            Some(k) => {
                let (a, b) = (a.powers(k), b.powers(k));
                divisor(&a.iter().chain(&b).collect::<Vec<_>>())
            }
        };
    };
    let contents = |p: &Polynomial| divisor(&p.powers(k).iter().collect::<Vec<_>>());
    let (content_a, content_b) = (contents(a)?, contents(b)?);
    let content = content_a.gcd(&content_b)?;
    let mut high = a.divided(&content_a).ok_or(TooLarge)?;
    let mut low = b.divided(&content_b).ok_or(TooLarge)?;
    if high.degree(k) < low.degree(k) {
        std::mem::swap(&mut high, &mut low);
    }
    while !low.is_zero() {
        if low.degree(k) == 0 {
            return Ok(content);
        }
        let rest = pseudo_remainder(&high, &low, k)?;
        high = low;
        low = match rest.is_zero() {
            true => rest,
            false => rest.divided(&contents(&rest)?).ok_or(TooLarge)?,
        };
    }
    high.times(&content)
}

/// lead(b)^…·a modulo b over one variable.
fn pseudo_remainder(a: &Polynomial, b: &Polynomial, k: usize) -> Result<Polynomial, TooLarge> {
    let degree = b.degree(k);
    let lead = b.powers(k).pop().unwrap_or_default();
    let mut rest = a.clone();
    while !rest.is_zero() && rest.degree(k) >= degree {
        let up = rest.degree(k) - degree;
        let top = rest.powers(k).pop().unwrap_or_default();
        let common = top.gcd(&lead)?;
        let (top, own) = (top.divided(&common), lead.divided(&common));
        let (top, own) = (top.ok_or(TooLarge)?, own.ok_or(TooLarge)?);
        let shift = Polynomial::term(Monomial::default().with(k, up), 1.into());
        rest = rest.times(&own)?.minus(&b.times(&top)?.times(&shift)?);
    }
    Ok(rest)
}

/// Whether with random values for the other variables nothing but a number divides all of them.
fn images_are_coprime(parts: &[Polynomial], k: usize) -> bool {
    let mut seed = 0x9e37_79b9_7f4a_7c15u64 ^ k as u64;
    let values: Vec<Prime61> = (0..VARIABLES)
        .map(|_| {
            // Steele, Lea, Flood, Fast splittable pseudorandom number generators (2014).
            seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = seed;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            Prime61::new((z ^ (z >> 31)) >> 4)
        })
        .collect();
    let mut common: Option<Vec<Prime61>> = None;
    for part in parts {
        let own = image(part, k, &values);
        // A first coefficient that vanishes by chance says nothing.
        if own.len() as u32 != part.degree(k) + 1 {
            return false;
        }
        let next = match common.take() {
            None => own,
            Some(known) => univariate(known, own),
        };
        if next.len() <= 1 {
            return true;
        }
        common = Some(next);
    }
    false
}

/// A polynomial of one variable modulo the prime, from the lowest power on.
fn image(part: &Polynomial, k: usize, values: &[Prime61]) -> Vec<Prime61> {
    let modulus = BigInt::from(Prime61::MODULUS);
    let mut image = vec![Prime61::ZERO; part.degree(k) as usize + 1];
    for (monomial, coefficient) in &part.terms {
        let rest = coefficient % &modulus;
        let digits = rest.iter_u64_digits().next().unwrap_or(0);
        let mut term = Prime61::new(digits);
        if rest.sign() == Sign::Minus {
            term = -term;
        }
        for (j, value) in values.iter().enumerate().filter(|(j, _)| *j != k) {
            let exponent = monomial.exponent(j);
            if exponent > 0 {
                term = term * value.pow(u64::from(exponent));
            }
        }
        let place = &mut image[monomial.exponent(k) as usize];
        *place = *place + term;
    }
    trim(&mut image);
    image
}

fn trim(image: &mut Vec<Prime61>) {
    while image.last().is_some_and(|value| value.is_zero()) {
        image.pop();
    }
}

/// Euclid's algorithm over the prime field.
fn univariate(mut a: Vec<Prime61>, mut b: Vec<Prime61>) -> Vec<Prime61> {
    while let Some(lead) = b.last().copied() {
        while a.len() >= b.len() {
            let Some(top) = a.last().copied() else { break };
            let factor = top / lead;
            let shift = a.len() - b.len();
            for (place, value) in a[shift..].iter_mut().zip(&b) {
                *place = *place - factor * *value;
            }
            trim(&mut a);
        }
        std::mem::swap(&mut a, &mut b);
    }
    a
}
