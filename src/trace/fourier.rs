//! `.four`: the harmonics of columns over the last period of a run, taken while its rows stream by.
//!
//! ```text
//! x(t) = X₀ + Σ X_k·sin(2πkf·(t − t₁) + φ_k)     t₁ = stop − 1/f
//! X_k·e^(jφ_k) = 2jf·∫ x(t)·e^(−j2πkf(t − t₁)) dt over the period
//! distortion = √(Σ_{k≥2} X_k²)/X_1
//! ```
//!
//! Rows stand so close that lines between them are as good as the run; the integral of each line times a sine is
//! exact, and jumps stand where they are, so that nothing is sampled.

use crate::source::Span;
use std::f64::consts::TAU;

/// Harmonics that are told, the mean included.
pub const HARMONICS: usize = 10;

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The lowest frequency in Hz.
    pub frequency: f64,
    /// Headers and watched columns.
    pub items: Vec<(String, usize)>,
    /// The card.
    pub span: Span,
}

/// The harmonics of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The column's header.
    pub name: String,
    /// The lowest frequency in Hz.
    pub frequency: f64,
    /// Magnitude in the column's unit and phase of the sine in degrees; the first is the mean.
    pub harmonics: Vec<(f64, f64)>,
    /// Total harmonic distortion, 1 being 100 %.
    pub distortion: f64,
}

/// Takes one request from rows.
pub struct Taking {
    request: Request,
    from: f64,
    to: f64,
    last: Option<(f64, Vec<f64>)>,
    /// Integrals of each column times cosine and sine, for each harmonic.
    sums: Vec<[(f64, f64); HARMONICS]>,
    covered: f64,
}

/// The part of the period that rounding may leave out.
const SLACK: f64 = 1e-6;

impl Taking {
    /// Before the first row of a run that ends at `stop`.
    pub fn new(request: &Request, stop: f64) -> Taking {
        let sums = vec![[(0.0, 0.0); HARMONICS]; request.items.len()];
        let from = stop - 1.0 / request.frequency;
        Taking { request: request.clone(), from, to: stop, last: None, sums, covered: 0.0 }
    }

    /// Takes the watched columns of a row.
    pub fn row(&mut self, time: f64, watched: &[f64]) {
        let value = |k: usize| watched.get(k).copied().unwrap_or(f64::NAN);
        let values: Vec<f64> = self.request.items.iter().map(|(_, k)| value(*k)).collect();
        if let Some((before, old)) = self.last.take()
            && time > before
            && time > self.from
            && before < self.to
        {
            self.line((before, &old), (time, &values));
        }
        self.last = Some((time, values));
    }

    /// Adds a line between two rows, as much of it as lies in the period.
    fn line(&mut self, (before, old): (f64, &[f64]), (time, new): (f64, &[f64])) {
        let (a, b) = (before.max(self.from), time.min(self.to));
        let (half, middle) = (0.5 * (b - a), 0.5 * (a + b));
        self.covered += 2.0 * half;
        for ((sums, x0), x1) in self.sums.iter_mut().zip(old).zip(new) {
            let slope = (x1 - x0) / (time - before);
            let mean = x0 + slope * (middle - before);
            for (k, (cosine, sine)) in sums.iter_mut().enumerate() {
                let omega = TAU * k as f64 * self.request.frequency;
                let (s, c) = libm::sincos(omega * (middle - self.from));
                // ∫ (m + g·u)·cos(ω(t + u)) du, and with the sine, over −half … half.
                let z = omega * half;
                let even = 2.0 * half * mean * sinc(z);
                let odd = 2.0 * half * half * slope * bend(z);
                *cosine += c * even - s * odd;
                *sine += s * even + c * odd;
            }
        }
    }

    /// The harmonics.
    ///
    /// # Errors
    /// Why there are none.
    pub fn finish(self) -> Result<Vec<Spectrum>, String> {
        let frequency = self.request.frequency;
        let period = 1.0 / frequency;
        if (self.covered - period).abs() > SLACK * period {
            return Err(format!("the run does not hold a whole period of {period:e} s at its end"));
        }
        let spectrum = |((name, _), sums): (&(String, usize), &[(f64, f64); HARMONICS])| {
            let harmonic = |(k, (cosine, sine)): (usize, &(f64, f64))| match k {
                0 => (frequency * cosine, 0.0),
                _ => {
                    let (a, b) = (2.0 * frequency * sine, 2.0 * frequency * cosine);
                    (libm::hypot(a, b), libm::atan2(b, a).to_degrees())
                }
            };
            let harmonics: Vec<_> = sums.iter().enumerate().map(harmonic).collect();
            let others = harmonics.iter().skip(2).map(|(x, _)| x * x).sum::<f64>();
            let distortion = others.sqrt() / harmonics[1].0;
            Spectrum { name: name.clone(), frequency, harmonics, distortion }
        };
        Ok(self.request.items.iter().zip(&self.sums).map(spectrum).collect())
    }
}

/// sin z/z.
fn sinc(z: f64) -> f64 {
    if z.abs() < 1e-4 { 1.0 - z * z / 6.0 } else { libm::sin(z) / z }
}

/// (sin z − z·cos z)/z², by its series where the difference would cancel.
fn bend(z: f64) -> f64 {
    if z.abs() > 0.3 {
        let (sine, cosine) = libm::sincos(z);
        return (sine - z * cosine) / (z * z);
    }
    let square = z * z;
    let terms = [1.0 / 3.0, -1.0 / 30.0, 1.0 / 840.0, -1.0 / 45360.0, 1.0 / 3_991_680.0];
    z * terms.iter().rev().fold(0.0, |sum, term| sum * square + term)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(rows: impl IntoIterator<Item = (f64, f64)>, stop: f64) -> Result<Spectrum, String> {
        let items = vec![("x".to_string(), 0)];
        let request = Request { frequency: 50.0, items, span: Span::NONE };
        let mut taking = Taking::new(&request, stop);
        rows.into_iter().for_each(|(t, x)| taking.row(t, &[x]));
        taking.finish().map(|mut all| all.remove(0))
    }

    #[test]
    fn lines_are_integrated_exactly() {
        // A square from −1 to 1 in four rows, after a period and a half of something else; 4/(πk) for odd k.
        let rows = [(0.0, 7.0), (0.03, 9.0), (0.03, 1.0), (0.04, 1.0), (0.04, -1.0), (0.05, -1.0)];
        let found = take(rows, 0.05).unwrap();
        for (k, (magnitude, phase)) in found.harmonics.iter().enumerate() {
            let exact = if k % 2 == 1 { 4.0 / (std::f64::consts::PI * k as f64) } else { 0.0 };
            assert!((magnitude - exact).abs() < 1e-14, "{k} {magnitude}");
            assert!(k % 2 == 0 || phase.abs() < 1e-11, "{k} {phase}");
        }
        // A sawtooth −1 … 1: 2/(πk), signs alternate.
        let found = take([(0.0, -1.0), (0.02, 1.0)], 0.02).unwrap();
        for (k, (magnitude, phase)) in found.harmonics.iter().enumerate().skip(1) {
            assert!((magnitude - 2.0 / (std::f64::consts::PI * k as f64)).abs() < 1e-14);
            assert!((phase.abs() - 180.0).abs() < 1e-9, "{phase}");
        }
    }

    #[test]
    fn a_sine_in_many_rows_has_one_harmonic() {
        let wave = |k: u32| {
            let t = 0.02 * f64::from(k) / 20000.0;
            (t, 3.0 + 2.0 * (TAU * 50.0 * t + 0.5).sin())
        };
        let found = take((0..=20000).map(wave), 0.02).unwrap();
        assert!((found.harmonics[0].0 - 3.0).abs() < 1e-7);
        assert!((found.harmonics[1].0 - 2.0).abs() < 1e-7);
        assert!((found.harmonics[1].1 - 0.5f64.to_degrees()).abs() < 1e-6);
        assert!(found.distortion < 1e-7, "{}", found.distortion);
        assert!(take([(0.0, 0.0), (0.01, 0.0)], 0.01).is_err());
    }

    #[test]
    fn the_series_meets_the_formula() {
        let formula = |z: f64| (z.sin() - z * z.cos()) / (z * z);
        for z in [0.29, -0.25, 0.2] {
            assert!((bend(z) - formula(z)).abs() < 1e-14, "{z}");
        }
    }
}
