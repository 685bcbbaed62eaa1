//! Frequency response: w/u at s = iω, from the sparse equations themselves.

use super::linear::{Entry, Linear};
use crate::diagnostic::Diagnostic;
use crate::linear::{Complex, Field, Lu, Pattern};
use crate::source::Span;

/// The factors of s·E − A for one s after another.
pub struct Resolvent<'l> {
    linear: &'l Linear,
    pattern: Pattern,
    places: Vec<u32>,
    fixed: Vec<(u32, u32, f64)>,
    storage: Vec<(u32, u32, f64)>,
    values: Vec<Complex>,
    factors: Option<Lu<Complex>>,
    work: Vec<Complex>,
    kept: Vec<Complex>,
}

impl<'l> Resolvent<'l> {
    /// Room for a model.
    pub fn new(linear: &'l Linear) -> Resolvent<'l> {
        let [fixed, storage] = linear.pencil();
        let n = linear.unknowns.len();
        let triplets: Vec<(u32, u32)> =
            fixed.iter().chain(&storage).map(|(i, j, _)| (*i, *j)).collect();
        let (pattern, places) = Pattern::from_triplets(n, &triplets);
        let values = vec![Complex::ZERO; pattern.len()];
        let (work, kept) = (vec![Complex::ZERO; n], vec![Complex::ZERO; n]);
        Resolvent { linear, pattern, places, fixed, storage, values, factors: None, work, kept }
    }

    /// Factorises at s. False where s is a pole.
    pub fn at(&mut self, s: Complex) -> bool {
        self.values.fill(Complex::ZERO);
        let fixed = self.fixed.iter().map(|(_, _, value)| Complex::from(*value));
        let storage = self.storage.iter().map(|(_, _, value)| s.scaled(*value));
        for (value, place) in fixed.chain(storage).zip(&self.places) {
            let slot = &mut self.values[*place as usize];
            *slot = *slot + value;
        }
        let kept = self.factors.as_mut().is_some_and(|lu| lu.refactor(&self.values).is_ok());
        if !kept {
            self.factors = Lu::factor(&self.pattern, &self.values).ok();
        }
        self.factors.is_some()
    }

    /// Solves (s·E − A)·y = b in place, refined once.
    pub fn solve(&mut self, b: &mut [Complex]) {
        let Some(lu) = &self.factors else { return };
        self.kept.copy_from_slice(b);
        lu.solve(b, &mut self.work);
        let mut residual = self.kept.clone();
        let mut product = vec![Complex::ZERO; b.len()];
        self.pattern.multiply(&self.values, b, &mut product);
        residual.iter_mut().zip(&product).for_each(|(r, p)| *r = *r - *p);
        lu.solve(&mut residual, &mut self.work);
        b.iter_mut().zip(&residual).for_each(|(x, dx)| *x = *x + *dx);
    }

    /// Solves the same, or the transposed, without refinement.
    pub(super) fn solve_either(&mut self, b: &mut [Complex], transposed: bool) {
        match &self.factors {
            Some(lu) if transposed => lu.solve_transposed(b, &mut self.work),
            Some(lu) => lu.solve(b, &mut self.work),
            None => {}
        }
    }

    /// All outputs over all inputs, each in its own unit: `[input][output]`. `None` where s is a pole.
    pub fn transfer(&mut self, s: Complex) -> Option<Vec<Vec<Complex>>> {
        if !self.at(s) {
            return None;
        }
        let linear = self.linear;
        let mut all = vec![];
        for (k, input) in linear.inputs.iter().enumerate() {
            let mut y = vec![Complex::ZERO; linear.unknowns.len()];
            for (row, entry) in &input.entries {
                y[*row as usize] = y[*row as usize] + Complex::from(entry.value);
            }
            self.solve(&mut y);
            let read = |output: usize| {
                let channel = &linear.outputs[output];
                let mut sum = Complex::ZERO;
                for (column, entry) in &channel.entries {
                    sum = sum + y[*column as usize].scaled(entry.value);
                }
                for (_, Entry { value, .. }) in
                    linear.direct[output].iter().filter(|(by, _)| *by as usize == k)
                {
                    sum = sum + Complex::from(*value);
                }
                sum.scaled(input.factor / channel.factor)
            };
            all.push((0..linear.outputs.len()).map(read).collect());
        }
        Some(all)
    }
}

/// A frequency response.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Frequencies, Hz, ascending.
    pub frequencies: Vec<f64>,
    /// By output: its value over the input at each of them.
    pub values: Vec<Vec<Complex>>,
}

/// The response of all outputs to an input, at some frequencies in Hz.
///
/// # Errors
/// Where a frequency is a pole.
pub fn response(
    linear: &Linear,
    input: usize,
    frequencies: &[f64],
) -> Result<Response, Box<Diagnostic>> {
    let mut resolvent = Resolvent::new(linear);
    let mut values = vec![Vec::with_capacity(frequencies.len()); linear.outputs.len()];
    for frequency in frequencies {
        let s = Complex::new(0.0, std::f64::consts::TAU * frequency);
        let found = resolvent.transfer(s).and_then(|mut all| all.drain(..).nth(input));
        let Some(found) = found.filter(|found| found.iter().all(|w| w.is_finite())) else {
            let message =
                format!("the response at {frequency} Hz is infinite: a pole stands there");
            let error = Diagnostic::error("E0928", Span::NONE, message);
            return Err(Box::new(
                error.help("choose other frequencies with --start, --stop, --points"),
            ));
        };
        values.iter_mut().zip(found).for_each(|(column, value)| column.push(value));
    }
    Ok(Response { frequencies: frequencies.to_vec(), values })
}

/// Frequencies evenly spaced by their logarithms, `points` a decade, both ends included.
pub fn decades(start: f64, stop: f64, points: usize) -> Vec<f64> {
    let spans = (stop / start).log10() * points as f64;
    let count = (spans.round() as usize).max(1);
    let step = (stop / start).ln() / count as f64;
    (0..=count).map(|k| if k == count { stop } else { start * (step * k as f64).exp() }).collect()
}

/// The angle of each value in degrees, without leaps of 360.
pub fn phases(values: &[Complex]) -> Vec<f64> {
    let mut phases: Vec<f64> = Vec::with_capacity(values.len());
    for value in values {
        let phase = libm::atan2(value.im, value.re).to_degrees();
        let turns = phases.last().map_or(0.0, |before| ((before - phase) / 360.0).round());
        phases.push(phase + 360.0 * turns);
    }
    phases
}
