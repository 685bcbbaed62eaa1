//! Linear circuits driven along straight lines: their exact solution, in a space of few dimensions.
//!
//! ```text
//! C·x' + G·x = b₀ + b₁·(t − t₀)          z = (x, t − t₀, 1),   z' = A·z,   z(t₀ + τ) = exp(τ·A)·z(t₀)
//! S = (I − γA)⁻¹ :   (C + γG)·x⁺ = C·x + γ·(b₀·s₀ + b₁·s₁⁺),   s₁⁺ = s₁ + γ·s₀,   s₀⁺ = s₀
//! ```
//!
//! Arnoldi's process with S makes an orthonormal basis V of the span of z, S·z, S²·z …, and S·V ≈ V·H; then
//! exp(τA)·z ≈ ‖z‖·V·exp(τ·(I − H⁻¹)/γ)·e₁ for **every** τ of the step (J. van den Eshof, M. Hochbruck, SIAM J. Sci.
//! Comput. 27:1438-1457, 2006; for circuits H. Zhuang, S.-H. Weng, J.-H. Lin, C.-K. Cheng, MATEX, DAC 2014). A step as
//! long as the way to the next corner takes one factorisation and some ten to twenty solutions, however stiff the circuit
//! is and however many rows are asked for; what the space lacks shrinks with every vector by about the same factor.
//!
//! Lengths are energies: charge k counts as q²/c with the c that it meets, so that flows into capacitors and efforts on
//! inductors are weighed as physics does, and algebraic unknowns, which hold none, do not count at all.

use super::small::{Exponentials, identity};
use super::{Work, trbdf2};
use crate::circuit::Waveform;
use crate::linear::{dot, eliminate};
use crate::sim::abreast::alone;
use crate::sim::network::Network;
use crate::sim::newton::{Cut, Frozen, correct_frozen};
use crate::sim::op::State;
use crate::sim::settings::{Settings, Tolerance};
use crate::sim::system::System;

/// So many vectors at most.
const MOST: usize = 32;
/// What so few say of the error is not believed.
const FEWEST: usize = 3;
/// An error that will not come below so much, as it has shrunk so far, is not waited for once there are a few vectors.
const HOPELESS: f64 = 1e4;
const A_FEW: usize = 10;
/// To ask for the error takes about so many operations for each entry of the small matrices, a solution so many for each
/// unknown; where it is dearer, it is asked for once for every few vectors.
const TO_ASK: usize = 70;
const TO_SOLVE: usize = 100;
const SELDOM: usize = 3;
/// A step may err by this part of its tolerance: one vector more makes of it a tenth.
const PART: f64 = 0.1;
/// Rows within it, whose errors do not add up, by this part.
const BETWEEN: f64 = 0.5;
/// γ in parts of the mean of a step and of the shortest time that matters in it.
const SHIFT: f64 = 0.3;
/// That time is this part of a step where nothing else says.
const SHORTEST: f64 = 1e-2;
/// Where less than this part of a vector is left, what is left is not yet orthogonal; less than that part has no direction.
const LITTLE: f64 = 1e-2;
const HALF: f64 = 0.5;
const NOTHING: f64 = 1e-12;
/// Unknowns are exact to this part of the largest of their kind at best, and to this part of `reltol` of it they need be:
/// what is small now may become larger.
const ROUNDING: f64 = 1e-11;
const SMALL: f64 = 1e-6;
/// As in other methods: without a nominal value no floor, with one a hundredth of it.
const PART_OF_NOMINAL: f64 = 1e-2;

/// From so many equations on solutions are dearer than what is done in the small space,
const LARGE: usize = 60;
/// where corners are few, or so many limits of the step lie between two of them.
const FEW: usize = 64;
const APART: f64 = 20.0;

/// Why it is chosen, and why another is where it was asked for.
pub(crate) const STRAIGHT: &str = "linear equations, driven along straight lines";
pub(crate) const UNFIT: &str =
    "`exponential` is for linear equations of index 1, driven along straight lines";

/// Whether a run is to begin with it.
pub(crate) fn suits(system: &System, settings: &Settings) -> bool {
    use super::Method;
    match settings.method {
        Method::Exponential => applies(system),
        Method::Auto => {
            system.equations() >= LARGE && applies(system) && has_few_corners(system, settings)
        }
        _ => false,
    }
}

fn applies(system: &System) -> bool {
    let straight = |waveform: &Waveform| {
        use Waveform::{Constant, Pulse, Pwl, Repeating};
        matches!(waveform, Constant(_) | Pulse { .. } | Pwl(_) | Repeating { .. })
    };
    system.groups.is_empty()
        && system.modes.is_empty()
        && system.memories.is_empty()
        && !system.output_rates
        && system.charges() > 0
        && system.held.iter().all(|held| *held)
        && system.sources.iter().all(|source| straight(&source.waveform))
}

fn has_few_corners(system: &System, settings: &Settings) -> bool {
    let limit = settings.hmax.unwrap_or(0.0);
    let most = match limit > 0.0 {
        true => (settings.stop / (APART * limit)) as usize,
        false => usize::MAX,
    };
    let most = most.clamp(FEW, 1 << 20);
    let all = system.sources.iter().flat_map(|source| source.waveform.corners(0.0, settings.stop));
    all.take(most + 1).count() <= most
}

/// A step in the space of `work`; one of TR-BDF2 where there is none.
pub(crate) fn step(
    network: &mut Network,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
) -> Result<f64, Cut> {
    let Some(mut space) = work.dense.space.take() else {
        return alone(trbdf2::step(network, from, to, weights, work, None));
    };
    let outcome = space.step(network, from, to, weights, work);
    work.dense.space = Some(space);
    outcome
}

/// The space of a step, and what is asked of it.
#[derive(Clone, Debug)]
pub(crate) struct Space {
    reltol: f64,
    /// The unknowns that are looked at, of each its place among them, whether it is a voltage, its floor.
    asked: Vec<u32>,
    place: Vec<u32>,
    voltage: Vec<bool>,
    least: Vec<f64>,
    /// The largest that each has been, and what it may be off.
    largest: Vec<f64>,
    allowed: Vec<f64>,
    /// √c of each charge.
    scale: Vec<f64>,
    /// Times: of the last corner, and the shortest that rows ask for.
    corner: f64,
    shortest: Option<f64>,
    /// V: charges over √c, then σ·s₁/γ and σ·s₀; of each vector the unknowns that are looked at, one vector after another.
    basis: Vec<Vec<f64>>,
    drives: Vec<[f64; 2]>,
    seen: Vec<f64>,
    /// H, column after column.
    hessenberg: Vec<f64>,
    /// ‖z‖ and the dimension of the space of the last step.
    length: f64,
    size: usize,
    small: Exponentials,
    inverse: Vec<f64>,
    matrix: Vec<f64>,
    /// Estimates of the error at h, h/2, h/4 …, of coordinates.
    errors: Vec<f64>,
    /// Coordinates at the time that is looked at, and the unknowns there.
    y: Vec<f64>,
    now: Vec<f64>,
}

impl Space {
    pub fn new(system: &System, settings: &Settings) -> Space {
        let asked = system.observed();
        let mut place = vec![u32::MAX; system.equations()];
        asked.iter().enumerate().for_each(|(i, unknown)| place[*unknown as usize] = i as u32);
        let unknowns = || asked.iter().map(|k| &system.unknowns[*k as usize]);
        let least = unknowns().map(|unknown| match (settings.tolerance, unknown.nominal) {
            (Tolerance::Spice, _) if unknown.voltage => settings.vntol,
            (Tolerance::Spice, _) => settings.abstol,
            (_, nominal) => settings.reltol * PART_OF_NOMINAL * nominal.unwrap_or(0.0).max(0.0),
        });
        let least = least.collect();
        let voltage = unknowns().map(|unknown| unknown.voltage).collect();
        let count = asked.len();
        Space {
            reltol: settings.reltol,
            least,
            voltage,
            largest: vec![0.0; count],
            allowed: vec![0.0; count],
            asked,
            place,
            scale: scales(system),
            corner: 0.0,
            shortest: settings.hmax,
            basis: vec![],
            drives: vec![[0.0; 2]; MOST + 1],
            seen: vec![0.0; count * (MOST + 1)],
            hessenberg: vec![0.0; (MOST + 1) * MOST],
            length: 0.0,
            size: 0,
            small: Exponentials::default(),
            inverse: vec![0.0; MOST * MOST],
            matrix: vec![0.0; MOST * MOST],
            errors: Vec::with_capacity(64),
            y: vec![0.0; MOST],
            now: vec![0.0; count],
        }
    }

    /// Something has happened: what moves fast may move again.
    pub fn begin(&mut self, t: f64) {
        self.corner = t;
    }

    /// The longest step worth trying: what is asked of its beginning is not too far from what is asked of its end.
    pub fn farthest(&self, t: f64) -> f64 {
        const FROM_REST: f64 = 128.0;
        const ON_THE_WAY: f64 = 32.0;
        match (self.shortest, t - self.corner) {
            (_, since) if since > 0.0 => ON_THE_WAY * since,
            (Some(limit), _) => FROM_REST * limit,
            (None, _) => f64::INFINITY,
        }
    }

    /// Looks at a part of the last step.
    pub fn look_at(&mut self, theta: f64) {
        self.small.at(theta.clamp(0.0, 1.0), self.length, &mut self.y);
        self.sum_up();
    }

    /// Looks at h/2ᵏ.
    fn look_at_half(&mut self, k: usize) {
        for (y, power) in self.y.iter_mut().zip(self.small.first_column(k)) {
            *y = self.length * power;
        }
        self.sum_up();
    }

    /// The unknowns at the time that is looked at, vector by vector.
    fn sum_up(&mut self) {
        self.now.fill(0.0);
        let vectors = self.seen.chunks_exact(self.asked.len().max(1));
        for (y, vector) in self.y[..self.size].iter().zip(vectors) {
            take(-y, vector, &mut self.now);
        }
    }

    /// An unknown at the time that is looked at; 0 where it is not asked for.
    pub fn unknown(&self, unknown: usize) -> f64 {
        match self.place[unknown] {
            u32::MAX => 0.0,
            place => self.now[place as usize],
        }
    }

    /// All unknowns that are asked for, at the time that is looked at.
    pub fn unknowns(&self, out: &mut [f64]) {
        for (unknown, now) in self.asked.iter().zip(&self.now) {
            out[*unknown as usize] = *now;
        }
    }

    /// One step. Gives the error in parts of what it may be; above 1 the space was not enough.
    pub fn step(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &mut State,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<f64, Cut> {
        let h = to.t - from.t;
        let shortest = match from.t - self.corner {
            since if since > 0.0 => since,
            _ => self.shortest.unwrap_or(SHORTEST * h),
        };
        let mean = SHIFT * (h * shortest.min(h)).sqrt();
        // Steps of about the same length share their factors.
        let gamma = libm::exp2(libm::round(libm::log2(mean)));
        network.factorise_dynamic(gamma.recip()).map_err(Cut::Singular)?;
        network.drives(from.t, &mut work.right);
        network.time_slopes(from.t, &mut work.slopes);
        let ramps = work.slopes.iter().any(|slope| *slope != 0.0);
        for (largest, unknown) in self.largest.iter_mut().zip(&self.asked) {
            *largest = largest.max(from.x[*unknown as usize].abs());
        }
        self.place_vector(0, &from.x, &from.q);
        self.drives[0] = [0.0, 1.0];
        let (mut sigma, mut error) = (1.0, f64::INFINITY);
        let (mut ask, mut first) = (FEWEST, None);
        for j in 0..MOST {
            let m = j + 1;
            self.solve(j, gamma, sigma, ramps, network, work);
            if j == 0 {
                sigma = self.scale_drives();
            }
            let left = self.orthogonalise(j);
            let closed = left == 0.0;
            if m < ask && m < MOST && !closed {
                continue;
            }
            error = self.error(m, gamma, h, left, from);
            if error <= 1.0 || closed {
                break;
            }
            ask = m + (1 + TO_ASK * m * m * m / (TO_SOLVE * from.x.len())).min(SELDOM);
            let (since, before) = *first.get_or_insert((m, error));
            let shrinks = libm::pow(error / before, 1.0 / (m - since).max(1) as f64);
            if m >= A_FEW && error * libm::pow(shrinks, (MOST - m) as f64) > HOPELESS {
                break;
            }
        }
        if error > 1.0 {
            // Not for a number that is none either.
            return Ok(if error.is_finite() { error } else { f64::MAX });
        }
        self.arrive(network, from, to, weights, work)?;
        Ok(error)
    }

    /// Takes unknowns and charges as the basis vector `j`, as yet of any length.
    fn place_vector(&mut self, j: usize, x: &[f64], q: &[f64]) {
        if self.basis.len() <= j {
            self.basis.push(vec![0.0; q.len()]);
        }
        for ((z, q), scale) in self.basis[j].iter_mut().zip(q).zip(&self.scale) {
            *z = q / scale;
        }
        let count = self.asked.len();
        for (seen, unknown) in self.seen[j * count..].iter_mut().zip(&self.asked) {
            *seen = x[*unknown as usize];
        }
    }

    /// S applied to the basis vector `j`, put behind it.
    fn solve(
        &mut self,
        j: usize,
        gamma: f64,
        sigma: f64,
        ramps: bool,
        network: &mut Network,
        work: &mut Work,
    ) {
        let Work { x, q, sum, right, slopes, .. } = work;
        let [ramp, one] = self.drives[j];
        let ramp = if ramps { ramp + one } else { 0.0 };
        for ((q, z), scale) in sum.iter_mut().zip(&self.basis[j]).zip(&self.scale) {
            *q = z * scale;
        }
        let (by_value, by_slope) = (one / sigma, gamma * ramp / sigma);
        for (x, (value, slope)) in x.iter_mut().zip(right.iter().zip(slopes.iter())) {
            *x = by_value * value + by_slope * slope;
        }
        network.system.rates.add_transposed(gamma.recip(), sum, x);
        network.solve_dynamic(x);
        q.fill(0.0);
        network.system.charges.add_product(1.0, x, q);
        self.place_vector(j + 1, x, q);
        self.drives[j + 1] = [ramp, one];
    }

    /// Gives what drives the circuit the weight of what it moves, and the first vector unit length.
    fn scale_drives(&mut self) -> f64 {
        let norms = [0, 1].map(|j: usize| dot(&self.basis[j], &self.basis[j]).sqrt());
        let sigma = match norms[0].max(norms[1]) {
            most if most > 0.0 => most,
            _ => 1.0,
        };
        self.length = (norms[0] * norms[0] + sigma * sigma).sqrt();
        for drives in &mut self.drives[..2] {
            *drives = drives.map(|drive| sigma * drive);
        }
        self.shorten(0, self.length.recip());
        self.shorten(1, self.length.recip());
        sigma
    }

    fn shorten(&mut self, j: usize, factor: f64) {
        let count = self.asked.len();
        let seen = &mut self.seen[j * count..(j + 1) * count];
        for value in self.basis[j].iter_mut().chain(seen).chain(&mut self.drives[j]) {
            *value *= factor;
        }
    }

    /// Makes the vector behind the basis vector `j` orthogonal to all before it. Gives what is left of it, 0 where that is
    /// rounding: where little is left it is made so once more, and what loses as much again was none (J. W. Daniel,
    /// W. B. Gragg, L. Kaufman, G. W. Stewart, Math. Comp. 30:772-795, 1976).
    fn orthogonalise(&mut self, j: usize) -> f64 {
        let column = j * (MOST + 1);
        self.hessenberg[column..=column + j].fill(0.0);
        let before = self.size_of(j + 1);
        let mut left = self.take_parts(j);
        if left < LITTLE * before {
            let again = self.take_parts(j);
            left = if again > HALF * left { again } else { 0.0 };
        }
        // A comparison that NaN fails.
        left = if left > NOTHING * before { left } else { 0.0 };
        self.hessenberg[column + j + 1] = left;
        if left > 0.0 {
            self.shorten(j + 1, left.recip());
        }
        left
    }

    fn size_of(&self, j: usize) -> f64 {
        let drives = self.drives[j][0].powi(2) + self.drives[j][1].powi(2);
        (dot(&self.basis[j], &self.basis[j]) + drives).sqrt()
    }

    /// Takes its parts along all before it out of the vector behind the basis vector `j` (modified Gram-Schmidt). Gives what
    /// is left of it.
    fn take_parts(&mut self, j: usize) -> f64 {
        let count = self.asked.len();
        let (basis, new) = self.basis.split_at_mut(j + 1);
        let (seen, new_seen) = self.seen.split_at_mut((j + 1) * count);
        let (drives, new_drives) = self.drives.split_at_mut(j + 1);
        let (new, new_drives) = (&mut new[0], &mut new_drives[0]);
        let column = &mut self.hessenberg[j * (MOST + 1)..];
        for (i, (other, drive)) in basis.iter().zip(&*drives).enumerate() {
            let part = dot(new, other) + drive[0] * new_drives[0] + drive[1] * new_drives[1];
            column[i] += part;
            take(part, other, new);
            take(part, &seen[i * count..(i + 1) * count], &mut new_seen[..count]);
            take(part, drive, new_drives);
        }
        self.size_of(j + 1)
    }

    /// The error of a step with the first `m` vectors, in parts of what it may be. What the space lacks of S·V is `left`
    /// times the next vector v; the error at τ is about left·|eₘᵀ·H⁻¹·y(τ)|·v, or less where nothing has moved yet.
    fn error(&mut self, m: usize, gamma: f64, h: f64, left: f64, from: &State) -> f64 {
        let square = m * m;
        for row in 0..m {
            for column in 0..m {
                let inside = row <= column + 1;
                let entry = self.hessenberg[column * (MOST + 1) + row];
                self.matrix[row * m + column] = if inside { entry } else { 0.0 };
            }
        }
        let inverse = &mut self.inverse[..square];
        identity(m, inverse);
        if !eliminate(m, &mut self.matrix, m, inverse) {
            return f64::INFINITY;
        }
        for (k, (a, inverse)) in self.matrix.iter_mut().zip(&self.inverse[..square]).enumerate() {
            let one = if k % (m + 1) == 0 { 1.0 } else { 0.0 };
            *a = (one - inverse) / gamma;
        }
        if !self.small.load(m, &self.matrix[..square], h) {
            return f64::INFINITY;
        }
        self.size = m;
        self.allow();
        let count = self.asked.len();
        let next = &self.seen[m * count..(m + 1) * count];
        let shares = next.iter().zip(&self.allowed).map(|(next, allowed)| next.abs() / allowed);
        let worst = if left > 0.0 { shares.fold(0.0, f64::max) } else { 0.0 };
        let last = &self.inverse[square - m..square];
        let mut errors = std::mem::take(&mut self.errors);
        errors.clear();
        for k in 0..=self.small.halved() {
            let kappa: f64 = last.iter().zip(self.small.first_column(k)).map(|(a, y)| a * y).sum();
            errors.push(left * (self.length * kappa).abs());
        }
        if !errors.iter().all(|error| error.is_finite()) {
            self.errors = errors;
            return f64::INFINITY;
        }
        // Between two of these times an error may pass through 0.
        let about = |k: usize| {
            let near = k.saturating_sub(1)..(k + 2).min(errors.len());
            errors[near].iter().fold(0.0, |most: f64, error| most.max(*error))
        };
        let mut error = about(0) / (PART * self.reltol * self.length);
        for k in 0..errors.len() {
            let part = if k == 0 { PART } else { BETWEEN };
            let mut here = about(k) * worst / part;
            let moved = if here > 1.0 { self.moved(k, from) / part } else { f64::INFINITY };
            here = here.min(moved);
            error = error.max(here);
            if error > 1.0 || moved <= 1.0 {
                break;
            }
        }
        self.errors = errors;
        error
    }

    /// What each unknown may be off, with what it is at the end of this step.
    fn allow(&mut self) {
        self.look_at_half(0);
        let mut top = [f64::MIN_POSITIVE; 2];
        let sizes = self.largest.iter().zip(&self.now).zip(&self.voltage);
        for (allowed, ((largest, end), voltage)) in self.allowed.iter_mut().zip(sizes) {
            *allowed = largest.max(end.abs());
            let top = &mut top[usize::from(*voltage)];
            *top = top.max(*allowed);
        }
        let part = ROUNDING.max(SMALL * self.reltol);
        let kinds = self.least.iter().zip(&self.voltage);
        for (allowed, (least, voltage)) in self.allowed.iter_mut().zip(kinds) {
            let floor = part * top[usize::from(*voltage)];
            *allowed = self.reltol * *allowed + least.max(floor);
        }
    }

    /// How far the unknowns have moved at h/2ᵏ, in parts of what they may be off.
    fn moved(&mut self, k: usize, from: &State) -> f64 {
        self.look_at_half(k);
        let all = self.asked.iter().zip(&self.now).zip(&self.allowed);
        let moved = all.map(|((k, now), allowed)| (now - from.x[*k as usize]).abs() / allowed);
        moved.fold(0.0, f64::max)
    }

    /// Charges at the end of the step, and all that follows from them.
    fn arrive(
        &mut self,
        network: &mut Network,
        from: &State,
        to: &mut State,
        weights: &[f64],
        work: &mut Work,
    ) -> Result<(), Cut> {
        let State { x, w, q, t } = to;
        q.fill(0.0);
        let coordinates = self.small.first_column(0).map(|y| self.length * y);
        for (y, basis) in coordinates.zip(&self.basis) {
            take(-y, basis, q);
        }
        q.iter_mut().zip(&self.scale).for_each(|(q, scale)| *q *= scale);
        let held = &network.system.held;
        network.factorise_frozen(held).map_err(Cut::Singular)?;
        x.copy_from_slice(&from.x);
        w.copy_from_slice(&from.w);
        let frozen = Frozen { t: *t, held, targets: q, floors: weights, most: 1, prime: false };
        correct_frozen(network, &frozen, x, w, &mut work.q, &mut work.scratch);
        Ok(())
    }
}

/// Of each charge √c: c is what a change of its unknowns by 1 gives it, as often as its rate stands in their equations.
fn scales(system: &System) -> Vec<f64> {
    let mut of_equation = vec![0.0; system.equations()];
    let scale = |k: usize| {
        system.rates.row(k).for_each(|(equation, sign)| of_equation[equation] = sign);
        let own = system.charges.row(k).map(|(x, c)| (c * of_equation[x]).abs()).sum::<f64>();
        system.rates.row(k).for_each(|(equation, _)| of_equation[equation] = 0.0);
        let any = system.charges.row(k).map(|(_, c)| c.abs()).sum::<f64>();
        match (own > 0.0, any > 0.0) {
            (true, _) => own.sqrt(),
            (_, true) => any.sqrt(),
            _ => 1.0,
        }
    };
    (0..system.charges()).map(scale).collect()
}

/// y −= factor·x
fn take(factor: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y -= factor * x);
}
