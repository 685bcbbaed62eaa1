//! Radau IIA of order 5 for M·y' = F(t, y) with M = diag(1 … 1, 0 … 0): index 1 and 2.
//!
//! Hairer & Wanner, *Solving Ordinary Differential Equations II*, IV.8 (method, transformation, error estimate, step
//! control) and VII.4 (index 2). Stages c₁, c₂, c₃ = 1; with Z = (T ⊗ I)·W Newton's systems fall apart into a real one,
//! γ/h·M − J, and a complex one, (α + iβ)/h·M − J. The solution is stiffly accurate: the third stage is the end of the
//! step, algebraic equations included. Between the ends the collocation polynomial is the solution.

use crate::bond::equations::Compiled;
use crate::linear::{Complex, Field, Lu, Pattern};

const SQRT6: f64 = 2.449_489_742_783_178;
/// Stages.
pub const C: [f64; 3] = [(4.0 - SQRT6) / 10.0, (4.0 + SQRT6) / 10.0, 1.0];
/// Quadrature weights of the stages, the last row of the method's matrix.
pub const B: [f64; 3] = [(16.0 - SQRT6) / 36.0, (16.0 + SQRT6) / 36.0, 1.0 / 9.0];
/// Error estimate: differences of the embedded method.
const E: [f64; 3] = [(-13.0 - 7.0 * SQRT6) / 3.0, (-13.0 + 7.0 * SQRT6) / 3.0, -1.0 / 3.0];
/// 3 + ∛9 − ∛3.
const GAMMA: f64 = 3.637_834_252_744_496;
/// 3 + (∛3 − ∛9)/2 and the imaginary part, (3^(5/6) + 3^(7/6))/2.
const ALPHA: f64 = 2.681_082_873_627_752;
const BETA: f64 = 3.050_430_199_247_411;
const T: [[f64; 3]; 3] = [
    [0.094_438_762_488_975_24, -0.141_255_295_020_954_2, 0.030_029_194_105_147_42],
    [0.250_213_122_965_333_3, 0.204_129_352_293_799_94, -0.382_942_112_757_261_9],
    [1.0, 1.0, 0.0],
];
const TI: [[f64; 3]; 3] = [
    [4.178_718_591_551_905, 0.327_682_820_761_062_4, 0.523_376_445_499_449_5],
    [-4.178_718_591_551_905, -0.327_682_820_761_062_4, 0.476_623_554_500_550_44],
    [0.502_872_634_945_786_8, -2.571_926_949_855_605, 0.596_039_204_828_224_9],
];
/// Collocation polynomial: y(t + x·h) = y + Σ_k x^(k+1) Σ_j Z_j P[j][k].
const P: [[f64; 3]; 3] = [
    [13.0 / 3.0 + 7.0 * SQRT6 / 3.0, -23.0 / 3.0 - 22.0 * SQRT6 / 3.0, 10.0 / 3.0 + 5.0 * SQRT6],
    [13.0 / 3.0 - 7.0 * SQRT6 / 3.0, -23.0 / 3.0 + 22.0 * SQRT6 / 3.0, 10.0 / 3.0 - 5.0 * SQRT6],
    [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
];

const NEWTON_ITERATIONS: usize = 12;
/// Newton's method has converged when what is left of its updates is below this part of the error allowed,
const CONVERGED: f64 = 1e-3;
/// or below this one when rounding keeps it from getting better.
const ROUNDING: f64 = 0.05;

/// How far the error allowed is kept above what rounding of the equations leaves open.
const ABOVE_ROUNDING: f64 = 100.0;

/// Where within a step the collocation polynomial is held against the algebraic equations: between its nodes.
const BETWEEN: [f64; 2] = [0.4, 0.85];
/// How much more error is allowed to algebraic unknowns there: it is seen in the output and carried no further.
const BETWEEN_NODES: f64 = 100.0;
/// Steps below this part of a segment are not held against them: at a jump no step is short enough,
const SHORT: f64 = 1e-7;
/// and neither are those below this many times the smallest step.
const SMALLEST: f64 = 1e4;

/// Counters of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Statistics {
    pub accepted: usize,
    pub rejected: usize,
    pub diverged: usize,
    pub evaluations: usize,
    pub factorisations: usize,
    pub events: usize,
}

impl Statistics {
    /// Adds another count.
    pub fn add(&mut self, other: &Statistics) {
        self.accepted += other.accepted;
        self.rejected += other.rejected;
        self.diverged += other.diverged;
        self.evaluations += other.evaluations;
        self.factorisations += other.factorisations;
    }

    fn tried(&self) -> usize {
        self.accepted + self.rejected + self.diverged
    }
}

/// Why a run ended early.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Stop {
    /// The step became too small at this time; the unknown whose error or update was the largest.
    StepTooSmall { t: f64, unknown: usize },
    /// The number of steps was exceeded at this time.
    TooManySteps { t: f64 },
}

/// What is to become of a step that error control has accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is kept.
    Keep,
    /// It is kept, and the segment ends with it.
    End,
    /// It is taken again with this length.
    Again(f64),
}

/// Where a segment ended, and the length that error control would choose next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// The time.
    pub t: f64,
    /// The next step.
    pub h: f64,
}

/// An accepted step.
pub struct Step<'a> {
    /// Its start.
    pub t: f64,
    /// Its length.
    pub h: f64,
    /// Values at its start.
    pub start: &'a [f64],
    /// Differences of the three stages from the start.
    pub stages: &'a [Vec<f64>; 3],
}

impl Step<'_> {
    /// The collocation polynomial at `t`.
    pub fn at(&self, t: f64, y: &mut [f64]) {
        self.part((t - self.t) / self.h, y);
    }

    /// The collocation polynomial at a part of the step, of as many unknowns as there is room for.
    pub fn part(&self, x: f64, y: &mut [f64]) {
        let weights: Vec<f64> =
            (0..3).map(|j| x * (P[j][0] + x * (P[j][1] + x * P[j][2]))).collect();
        for (i, value) in y.iter_mut().enumerate() {
            *value = self.start[i]
                + weights[0] * self.stages[0][i]
                + weights[1] * self.stages[1][i]
                + weights[2] * self.stages[2][i];
        }
    }
}

/// The integrator with its scratch space.
pub struct Radau<'a> {
    /// The equations.
    pub compiled: &'a mut Compiled,
    /// The error of a step that is allowed, for each unknown; infinite where it is not tested.
    pub weights: Vec<f64>,
    /// Adapts `weights` to the largest values so far, times this; 0 leaves them.
    pub growing: f64,
    /// Counters.
    pub statistics: Statistics,
    /// Attempts after which a run is given up.
    pub maximum_steps: usize,
    /// No step is longer: what a delay gives within it must be past.
    pub longest: f64,
    real: Option<Lu<f64>>,
    complex: Option<Lu<Complex>>,
    real_values: Vec<f64>,
    complex_values: Vec<Complex>,
    mass_slots: Vec<usize>,
}

impl<'a> Radau<'a> {
    /// An integrator with given weights.
    pub fn new(compiled: &'a mut Compiled, weights: Vec<f64>) -> Radau<'a> {
        let mass_slots = (0..compiled.states)
            .filter_map(|k| compiled.pattern.slot(k as u32, k as u32))
            .collect();
        let entries = compiled.pattern.len();
        Radau {
            compiled,
            weights,
            growing: 0.0,
            statistics: Statistics::default(),
            maximum_steps: 20_000_000,
            longest: f64::INFINITY,
            real: None,
            complex: None,
            real_values: vec![0.0; entries],
            complex_values: vec![Complex::ZERO; entries],
            mass_slots,
        }
    }

    /// Allows each unknown at least what rounding of the equations at `y` leaves open: where all flows begin at 0,
    /// their sizes say nothing, and those of the pressures they balance do.
    pub fn mind_rounding(&mut self, from: f64, to: f64, y: &[f64]) {
        let n = self.compiled.n;
        let (mut f, mut work) = (vec![0.0; n], vec![0.0; n]);
        let mut jacobian = vec![0.0; self.compiled.pattern.len()];
        self.compiled.jacobian(from, 0.5 * (from + to), y, &mut f, &mut jacobian);
        let mut noise = vec![0.0; n];
        for (j, value) in y.iter().enumerate() {
            for slot in self.compiled.pattern.column(j) {
                let row = self.compiled.pattern.rows[slot] as usize;
                noise[row] += f64::EPSILON * (jacobian[slot] * value).abs();
            }
        }
        // Within so short a step states stand still.
        noise[..self.compiled.states].fill(0.0);
        if !self.factor(1e-9 * (to - from), &jacobian) {
            return;
        }
        let Some(real) = self.real.as_ref() else { return };
        // Rounding has either sign: of two patterns one does not cancel.
        for odd in [1.0, -1.0] {
            let mut change: Vec<f64> = noise
                .iter()
                .enumerate()
                .map(|(i, noise)| if i % 2 == 0 { *noise } else { odd * noise })
                .collect();
            real.solve(&mut change, &mut work);
            for (weight, change) in self.weights.iter_mut().zip(&change) {
                if change.is_finite() {
                    *weight = weight.max(ABOVE_ROUNDING * change.abs());
                }
            }
        }
    }

    /// Integrates from `start` to exactly `to` within the segment `from..to`, starting from the consistent values `y` with
    /// a first step of `first`; `accept` judges each step.
    pub fn segment(
        &mut self,
        [start, from, to]: [f64; 3],
        y: &mut [f64],
        first: f64,
        accept: &mut dyn FnMut(&mut Compiled, &Step) -> Verdict,
    ) -> Result<Ended, Stop> {
        let n = self.compiled.n;
        let inside = 0.5 * (from + to);
        let smallest = 4.0 * f64::EPSILON * to.abs().max(to - from);
        let (mut t, mut h) = (start, first.min(to - start));
        let mut asked: Option<f64> = None;
        let mut f = vec![0.0; n];
        let mut jacobian = vec![0.0; self.compiled.pattern.len()];
        let mut stages: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; n]);
        let mut history: Option<History> = None;
        let mut last: Option<(f64, f64)> = None;
        let mut fresh = true;
        let mut after_rejection = false;
        while t < to {
            if self.statistics.tried() > self.maximum_steps {
                return Err(Stop::TooManySteps { t });
            }
            if fresh {
                self.compiled.jacobian(t, inside, y, &mut f, &mut jacobian);
                self.statistics.evaluations += 1;
                fresh = false;
            }
            let remaining = to - t;
            h = h.min(self.longest);
            let ends = asked.is_none() && h >= remaining * (1.0 - 1e-10);
            let step = match asked.take() {
                Some(asked) => asked,
                None if ends => remaining,
                None => h.min(0.5 * remaining),
            };
            if h < smallest {
                return Err(Stop::StepTooSmall { t, unknown: self.worst(&stages[2]) });
            }
            match &history {
                Some(history) => history.guess(t, step, y, &mut stages),
                None => stages.iter_mut().for_each(|z| z.fill(0.0)),
            }
            let iterations = if self.factor(step, &jacobian) {
                self.newton(t, inside, step, y, &mut stages)
            } else {
                None
            };
            let Some(iterations) = iterations else {
                self.statistics.diverged += 1;
                (h, history, after_rejection) = (0.4 * step, None, true);
                continue;
            };
            let error =
                self.error(t, inside, step, y, &f, &stages, history.is_none() || after_rejection);
            let short = (SHORT * (to - from)).max(SMALLEST * smallest);
            let error = if error <= 1.0 && step > short {
                error.max(self.between(t, inside, step, y, &stages))
            } else {
                error
            };
            // Gustafsson's predictive control (IV.8, (8.25)).
            let safety = 0.9 * (2 * NEWTON_ITERATIONS + 1) as f64
                / (2 * NEWTON_ITERATIONS + iterations) as f64;
            let predicted = match last {
                Some((h_last, error_last)) => {
                    (step / h_last * (error_last / error).powf(0.25)).min(1.0)
                }
                None => 1.0,
            };
            let factor = safety * predicted * error.max(1e-12).powf(-0.25);
            if error.is_nan() || error > 1.0 {
                self.statistics.rejected += 1;
                after_rejection = true;
                h = step * if factor.is_nan() { 0.2 } else { factor.clamp(0.2, 0.9) };
                continue;
            }
            let verdict = accept(self.compiled, &Step { t, h: step, start: y, stages: &stages });
            if let Verdict::Again(shorter) = verdict {
                self.statistics.rejected += 1;
                asked = Some(shorter);
                continue;
            }
            self.statistics.accepted += 1;
            last = Some((step, error.max(1e-3)));
            let start = y.to_vec();
            y.iter_mut().zip(&stages[2]).for_each(|(y, z)| *y += z);
            if self.growing > 0.0 {
                for (weight, value) in self.weights.iter_mut().zip(y.iter()) {
                    *weight = weight.max(self.growing * value.abs());
                }
            }
            history = Some(History { t, h: step, start, stages: stages.clone() });
            t = if ends { to } else { t + step };
            let grown = step * factor.clamp(0.2, if after_rejection { 1.0 } else { 8.0 });
            // A step that the segment's end cut short says nothing against a longer one.
            h = if step < h { grown.max(h) } else { grown };
            (fresh, after_rejection) = (true, false);
            if verdict == Verdict::End {
                break;
            }
        }
        Ok(Ended { t, h })
    }

    /// Factors γ/h·M − J and (α + iβ)/h·M − J.
    fn factor(&mut self, h: f64, jacobian: &[f64]) -> bool {
        self.statistics.factorisations += 1;
        for ((real, complex), entry) in
            self.real_values.iter_mut().zip(&mut self.complex_values).zip(jacobian)
        {
            *real = -entry;
            *complex = Complex::from(-entry);
        }
        for slot in &self.mass_slots {
            self.real_values[*slot] += GAMMA / h;
            self.complex_values[*slot] =
                self.complex_values[*slot] + Complex::new(ALPHA / h, -BETA / h);
        }
        refactor(&mut self.real, &self.compiled.pattern, &self.real_values)
            && refactor(&mut self.complex, &self.compiled.pattern, &self.complex_values)
    }

    /// Simplified Newton iterations for the stages; their number, or `None` when they do not converge.
    fn newton(
        &mut self,
        t: f64,
        inside: f64,
        h: f64,
        y: &[f64],
        stages: &mut [Vec<f64>; 3],
    ) -> Option<usize> {
        let (n, states) = (self.compiled.n, self.compiled.states);
        let (real, complex) = (self.real.as_ref()?, self.complex.as_ref()?);
        let mut w: [Vec<f64>; 3] = std::array::from_fn(|k| {
            (0..n).map(|i| (0..3).map(|j| TI[k][j] * stages[j][i]).sum()).collect()
        });
        let mut f: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; n]);
        let mut point = vec![0.0; n];
        let (mut right, mut work) = (vec![0.0; n], vec![0.0; n]);
        let (mut right2, mut work2) = (vec![Complex::ZERO; n], vec![Complex::ZERO; n]);
        let mut last_size: Option<f64> = None;
        for iteration in 1..=NEWTON_ITERATIONS {
            for j in 0..3 {
                for i in 0..n {
                    point[i] = y[i] + stages[j][i];
                }
                self.compiled.residual(t + C[j] * h, inside, &point, &mut f[j]);
            }
            self.statistics.evaluations += 3;
            for i in 0..n {
                let mixed: [f64; 3] =
                    std::array::from_fn(|k| (0..3).map(|j| TI[k][j] * f[j][i]).sum());
                right[i] = mixed[0];
                right2[i] = Complex::new(mixed[1], mixed[2]);
                if i < states {
                    right[i] -= GAMMA / h * w[0][i];
                    right2[i] = right2[i]
                        - Complex::new(ALPHA / h, -BETA / h) * Complex::new(w[1][i], w[2][i]);
                }
            }
            real.solve(&mut right, &mut work);
            complex.solve(&mut right2, &mut work2);
            for i in 0..n {
                w[0][i] += right[i];
                w[1][i] += right2[i].re;
                w[2][i] += right2[i].im;
            }
            let mut size = 0.0f64;
            for i in 0..n {
                for j in 0..3 {
                    let change =
                        T[j][0] * right[i] + T[j][1] * right2[i].re + T[j][2] * right2[i].im;
                    stages[j][i] = (0..3).map(|k| T[j][k] * w[k][i]).sum();
                    size = size.max(change.abs() / self.weights[i]);
                    if !change.is_finite() {
                        return None;
                    }
                }
            }
            if size <= 1e-6 {
                return Some(iteration);
            }
            if let Some(last) = last_size {
                let rate = size / last;
                if rate >= 1.0 {
                    // Rounding keeps updates from shrinking further; what is left is far below the error allowed.
                    return (size < ROUNDING && iteration > 2).then_some(iteration);
                }
                if rate / (1.0 - rate) * size < CONVERGED {
                    return Some(iteration);
                }
                let left = (NEWTON_ITERATIONS - iteration) as i32;
                if rate.powi(left) / (1.0 - rate) * size > ROUNDING && iteration > 4 {
                    return None;
                }
            }
            last_size = Some(size);
        }
        None
    }

    /// The error estimate of IV.8, (8.19) and (8.20), in parts of what is allowed; the largest over all unknowns.
    #[allow(clippy::too_many_arguments)]
    fn error(
        &mut self,
        t: f64,
        inside: f64,
        h: f64,
        y: &[f64],
        f: &[f64],
        stages: &[Vec<f64>; 3],
        again: bool,
    ) -> f64 {
        let (n, states) = (self.compiled.n, self.compiled.states);
        let Some(real) = self.real.as_ref() else { return f64::NAN };
        let differences: Vec<f64> = (0..n)
            .map(|i| {
                if i < states { (0..3).map(|j| E[j] * stages[j][i]).sum::<f64>() / h } else { 0.0 }
            })
            .collect();
        let mut work = vec![0.0; n];
        let mut error: Vec<f64> = (0..n).map(|i| f[i] + differences[i]).collect();
        real.solve(&mut error, &mut work);
        let mut size = self.size(&error);
        if size > 1.0 && again {
            let moved: Vec<f64> = y.iter().zip(&error).map(|(y, e)| y + e).collect();
            let mut f = vec![0.0; n];
            self.compiled.residual(t, inside, &moved, &mut f);
            self.statistics.evaluations += 1;
            let Some(real) = self.real.as_ref() else { return f64::NAN };
            error = (0..n).map(|i| f[i] + differences[i]).collect();
            real.solve(&mut error, &mut work);
            size = self.size(&error);
        }
        size
    }

    /// What Newton's method would change of the collocation polynomial between its nodes so that it satisfies the
    /// algebraic equations there, in parts of what is allowed. A source moves what follows it at once without any
    /// state: of that the error estimate knows nothing.
    fn between(&mut self, t: f64, inside: f64, h: f64, y: &[f64], stages: &[Vec<f64>; 3]) -> f64 {
        let (n, states) = (self.compiled.n, self.compiled.states);
        let Some(real) = self.real.as_ref() else { return 0.0 };
        let step = Step { t, h, start: y, stages };
        let (mut point, mut change, mut work) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut size = 0.0f64;
        for x in BETWEEN {
            let at = t + x * h;
            step.at(at, &mut point);
            self.compiled.residual(at, inside, &point, &mut change);
            self.statistics.evaluations += 1;
            change[..states].fill(0.0);
            real.solve(&mut change, &mut work);
            for (i, change) in change.iter().enumerate() {
                let part = if i < states { 1.0 } else { BETWEEN_NODES };
                let weight = self.weights[i].max(self.growing * (point[i] + change).abs());
                // Beyond the domain of a law there is nothing to compare with.
                if change.is_finite() {
                    size = size.max(change.abs() / (part * weight));
                }
            }
        }
        size
    }

    fn size(&self, error: &[f64]) -> f64 {
        let mut size = 0.0f64;
        for (error, weight) in error.iter().zip(&self.weights) {
            let part = error.abs() / weight;
            if part.is_nan() {
                return f64::NAN;
            }
            size = size.max(part);
        }
        size
    }

    /// The unknown that moves most.
    fn worst(&self, change: &[f64]) -> usize {
        let parts = change.iter().zip(&self.weights).map(|(z, w)| z.abs() / w);
        parts.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(unknown, _)| unknown)
    }
}

/// The last accepted step, whose polynomial gives the next one's first guess.
struct History {
    t: f64,
    h: f64,
    start: Vec<f64>,
    stages: [Vec<f64>; 3],
}

impl History {
    fn guess(&self, t: f64, h: f64, y: &[f64], stages: &mut [Vec<f64>; 3]) {
        let step = Step { t: self.t, h: self.h, start: &self.start, stages: &self.stages };
        for (c, z) in C.iter().zip(stages.iter_mut()) {
            step.at(t + c * h, z);
            z.iter_mut().zip(y).for_each(|(z, y)| *z -= y);
        }
    }
}

fn refactor<T: Field>(lu: &mut Option<Lu<T>>, pattern: &Pattern, values: &[T]) -> bool {
    if let Some(lu) = lu
        && lu.refactor(values).is_ok()
    {
        return true;
    }
    *lu = Lu::factor(pattern, values).ok();
    lu.is_some()
}
