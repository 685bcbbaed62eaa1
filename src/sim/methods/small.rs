//! The exponential of a small dense matrix, at every binary fraction of a time and so at any time.
//!
//! exp(h·A) is squared from exp(h·A/2ˢ), whose Taylor series is short (C. Moler, C. Van Loan, SIAM Rev. 45:3-49, 2003,
//! method 3); the powers on the way are kept. Where θ is a sum of negative powers of 2, exp(θ·h·A)·v is a product of some
//! of them with v; what is left of θ is less than 2⁻ˢ, where a few terms of the series do.

/// Below this norm a series of few terms is exact to the last digits.
const SMALL: f64 = 1.0 / 32.0;
/// Terms of the series of a matrix, and of one that acts on a vector.
const TERMS: usize = 8;
/// So many halvings at most: eigenvalues farther apart are at rest within the least time that counts.
const MOST_HALVED: usize = 60;
/// Times are told apart to this part of h.
const FINEST: f64 = (1u64 << 46) as f64;

/// exp(θ·h·A) for 0 ≤ θ ≤ 1; matrices are stored row by row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exponentials {
    size: usize,
    /// So often h has been halved.
    halved: usize,
    /// A·h/2ˢ, and exp(h·A/2ᵏ) for k = s, s − 1, …, 0, one after another.
    least: Vec<f64>,
    powers: Vec<f64>,
    /// exp(θ·h·A)·v for the θ that the leading binary digits of the last time make, for every number of them up to that
    /// which is known.
    digits: u64,
    partial: Vec<f64>,
    known: usize,
    term: Vec<f64>,
}

impl Exponentials {
    /// Works out the powers for a matrix `a` of `size` rows; false where it is no matrix of finite numbers.
    pub fn load(&mut self, size: usize, a: &[f64], h: f64) -> bool {
        let square = size * size;
        let rows = a[..square].chunks_exact(size.max(1));
        let norm =
            rows.map(|row| row.iter().map(|a| (h * a).abs()).sum::<f64>()).fold(0.0, f64::max);
        if !norm.is_finite() {
            return false;
        }
        self.size = size;
        self.known = 0;
        self.halved = 0;
        let mut scale = 1.0;
        while norm * scale > SMALL && self.halved < MOST_HALVED {
            scale *= 0.5;
            self.halved += 1;
        }
        self.least.clear();
        self.least.extend(a[..square].iter().map(|a| scale * h * a));
        self.powers.resize(square * (self.halved + 1), 0.0);
        self.partial.resize(size * (self.halved + 2), 0.0);
        self.term.resize(square.max(2 * size), 0.0);
        // I + X·(I + X/2·(I + X/3·(…)))
        let first = &mut self.powers[..square];
        identity(size, first);
        for k in (1..=TERMS).rev() {
            product(size, &self.least, first, &mut self.term);
            for (power, term) in first.iter_mut().zip(&self.term) {
                *power = term / k as f64;
            }
            first.iter_mut().step_by(size + 1).for_each(|diagonal| *diagonal += 1.0);
        }
        for k in 1..=self.halved {
            let (known, next) = self.powers[(k - 1) * square..].split_at_mut(square);
            product(size, known, known, next);
        }
        true
    }

    /// So many times the time has been halved.
    pub fn halved(&self) -> usize {
        self.halved
    }

    /// exp(h·A/2ᵏ).
    fn power(&self, k: usize) -> &[f64] {
        let square = self.size * self.size;
        let at = (self.halved - k) * square;
        &self.powers[at..at + square]
    }

    /// exp(h·A/2ᵏ)·e₁, a first column.
    pub fn first_column(&self, k: usize) -> impl Iterator<Item = f64> + '_ {
        self.power(k).iter().step_by(self.size.max(1)).copied()
    }

    /// exp(θ·h·A)·e₁·`start` for 0 ≤ θ ≤ 1, into `out`.
    pub fn at(&mut self, theta: f64, start: f64, out: &mut [f64]) {
        let (size, halved) = (self.size, self.halved);
        // What rounding has made of a binary fraction is one again.
        let theta = (theta * FINEST).round() / FINEST;
        let scaled = theta * (1u64 << halved) as f64;
        let digits = scaled.floor() as u64;
        let rest = scaled - scaled.floor();
        // Of the number 2ˢ·θ the digit of 2ˢ⁻ᵏ stands for exp(h·A/2ᵏ); what begins as the last time did is known.
        let alike = (self.digits ^ digits).leading_zeros() as usize + halved;
        let from = alike.saturating_sub(63).min(self.known);
        let end = (halved + 1).saturating_sub(digits.trailing_zeros() as usize);
        if from == 0 {
            self.partial[..size].fill(0.0);
            self.partial[0] = start;
        }
        for k in from..end {
            let (before, next) = self.partial[k * size..].split_at_mut(size);
            if digits >> (halved - k) & 1 == 1 {
                let at = (halved - k) * size * size;
                apply(size, &self.powers[at..at + size * size], before, next);
            } else {
                next[..size].copy_from_slice(before);
            }
        }
        (self.digits, self.known) = (digits, end);
        let out = &mut out[..size];
        out.copy_from_slice(&self.partial[end * size..(end + 1) * size]);
        if rest > 0.0 {
            let (term, next) = self.term.split_at_mut(size);
            term.copy_from_slice(out);
            for k in 1..=TERMS {
                apply(size, &self.least, term, next);
                for ((term, next), out) in term.iter_mut().zip(&*next).zip(out.iter_mut()) {
                    *term = rest / k as f64 * next;
                    *out += *term;
                }
            }
        }
    }
}

/// The matrix of `size` rows that changes nothing.
pub(crate) fn identity(size: usize, a: &mut [f64]) {
    a.fill(0.0);
    a.iter_mut().step_by(size + 1).for_each(|diagonal| *diagonal = 1.0);
}

/// c = a·b
fn product(size: usize, a: &[f64], b: &[f64], c: &mut [f64]) {
    for (row, out) in a.chunks_exact(size).zip(c.chunks_exact_mut(size)) {
        out.fill(0.0);
        for (factor, b) in row.iter().zip(b.chunks_exact(size)) {
            for (out, b) in out.iter_mut().zip(b) {
                *out += factor * b;
            }
        }
    }
}

/// y = a·x
fn apply(size: usize, a: &[f64], x: &[f64], y: &mut [f64]) {
    for (row, y) in a.chunks_exact(size).zip(y) {
        *y = row.iter().zip(x).map(|(a, x)| a * x).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_and_a_decay_are_what_they_are_at_any_time() {
        // y' = −ω·z, z' = ω·y beside u' = λ·(y − u) with λ of ten thousand.
        let (omega, lambda) = (3.0, 1e4);
        let a = [0.0, -omega, 0.0, omega, 0.0, 0.0, lambda, 0.0, -lambda];
        let mut of = Exponentials::default();
        let h = 2.0;
        assert!(of.load(3, &a, h));
        let mut y = [0.0; 3];
        let times = [0.0, 0.5, 0.25, 0.3, 1.0 / 3.0, 0.999_999_9, 1.0, 1e-7, 0.7];
        for theta in times {
            of.at(theta, 2.0, &mut y);
            let t: f64 = theta * h;
            // u follows y with a lag: λ·∫e^{−λ(t−s)}·2·cos ωs ds.
            let lag = |t: f64| {
                let (s, c) = (omega * t).sin_cos();
                let sum = lambda * lambda + omega * omega;
                2.0 * lambda * (lambda * c + omega * s - lambda * (-lambda * t).exp()) / sum
            };
            let expected = [2.0 * (omega * t).cos(), 2.0 * (omega * t).sin(), lag(t)];
            for (y, expected) in y.iter().zip(expected) {
                assert!((y - expected).abs() < 1e-9, "{theta}: {y} {expected}");
            }
        }
    }
}
