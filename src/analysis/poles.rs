//! Poles with the storages that take part in them, and zeros.
//!
//! ```text
//! poles    det(s·E − A) = 0
//! zeros    det [ s·E − A   −B ] = 0      for one input and one output
//!              [   C        D ]
//! ```
//!
//! What part a storage has in a pole is the diagonal of the pole's spectral projector, for a simple pole w_k·v_k with its
//! left and right eigenvectors (I. J. Pérez-Arriaga, G. C. Verghese, F. C. Schweppe, *Selective modal analysis*, 1982). It
//! is found by inverse iteration; round poles that are multiple, or nearly, as (1/2πi)·∮ (s·E − A)⁻¹·E ds. The parts of all storages
//! sum to the pole's multiplicity; they are complex, and told by their size.

use super::linear::Linear;
use super::response::Resolvent;
use crate::diagnostic::Diagnostic;
use crate::linear::roots::{Root, Trouble, finite_roots};
use crate::linear::{Complex, Field};
use crate::source::Span;

/// A pole.
#[derive(Clone, Debug, PartialEq)]
pub struct Pole {
    /// Where it lies, 1/s.
    pub at: Complex,
    /// How often it counts.
    pub multiplicity: usize,
    /// What part each storage and integrator has in it, the largest first: unknowns and sizes. Of two conjugate poles only
    /// the upper one has the list.
    pub parts: Vec<(usize, f64)>,
}

impl Pole {
    /// |s|/2π, Hz.
    pub fn frequency(&self) -> f64 {
        size(self.at) / std::f64::consts::TAU
    }

    /// −Re s/|s|: 1 for a real pole on the left, 0 for one on the imaginary axis; none for one at 0.
    pub fn damping(&self) -> Option<f64> {
        let size = size(self.at);
        (size > 0.0).then(|| -self.at.re / size)
    }

    /// −1/Re s, seconds: none where nothing decays.
    pub fn time_constant(&self) -> Option<f64> {
        (self.at.re < 0.0).then(|| -1.0 / self.at.re)
    }
}

/// A pole that is this part of its size from others has eigenvectors of its own.
const APART: f64 = 1e-4;
/// Inverse iteration starts this part of the way to the next pole off.
const CLOSE: f64 = 1e-7;
/// Points on the circle round a pole.
const POINTS: usize = 48;
/// Beyond so many unknowns with a rate no parts are told.
pub const MOST_PARTS: usize = 400;

/// All poles, by size; conjugate ones follow each other, the upper first.
///
/// # Errors
/// When the model has no poles.
pub fn poles(linear: &Linear) -> Result<Vec<Pole>, Box<Diagnostic>> {
    let [fixed, storage] = linear.pencil();
    let roots = finite_roots(linear.unknowns.len(), &fixed, &storage, &|| true)
        .map_err(|trouble| explain(trouble, "poles"))?;
    let parts = (0..linear.states).filter(|k| linear.stores(*k)).count() <= MOST_PARTS;
    let of = |root: &Root| Pole {
        at: root.at,
        multiplicity: root.multiplicity,
        parts: match parts && root.at.im >= 0.0 {
            true => participation(linear, root, &roots),
            false => vec![],
        },
    };
    Ok(roots.iter().map(of).collect())
}

/// All zeros between an input and an output.
///
/// # Errors
/// When every s is one, because nothing of the input reaches the output.
pub fn zeros(linear: &Linear, input: usize, output: usize) -> Result<Vec<Root>, Box<Diagnostic>> {
    let [mut fixed, storage] = linear.pencil();
    let n = linear.unknowns.len() as u32;
    let input_of = &linear.inputs[input];
    fixed.extend(input_of.entries.iter().map(|(row, entry)| (*row, n, -entry.value)));
    let output_of = &linear.outputs[output];
    fixed.extend(output_of.entries.iter().map(|(column, entry)| (n, *column, entry.value)));
    let direct = linear.direct[output].iter().filter(|(by, _)| *by as usize == input);
    fixed.extend(direct.map(|(_, entry)| (n, n, entry.value)));
    finite_roots(n as usize + 1, &fixed, &storage, &|| true)
        .map_err(|trouble| explain(trouble, "zeros"))
}

fn explain(trouble: Trouble, what: &str) -> Box<Diagnostic> {
    let (message, help) = match trouble {
        Trouble::Singular if what == "zeros" => (
            "nothing of the input reaches the output, so that every s is a zero".to_string(),
            "`bondspice paths --from … --to …` shows what ways there are",
        ),
        Trouble::Singular => (
            "the linear equations have no single solution at any s, and so no poles".to_string(),
            "see what `bondspice check` says of the model; impose less with --from",
        ),
        Trouble::Restless(count) => (
            format!("{count} of the {what} did not come to rest"),
            "values of very different sizes may be at fault; `bondspice bode` shows what they do",
        ),
        Trouble::Stopped => (format!("the search for {what} was ended"), "run it again"),
    };
    Box::new(Diagnostic::error("E0928", Span::NONE, message).help(help))
}

/// What part each storage has in a pole.
fn participation(linear: &Linear, root: &Root, roots: &[Root]) -> Vec<(usize, f64)> {
    let apart = |other: &Root| size(other.at - root.at);
    let nearest = roots.iter().map(apart).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    let own = if root.at == Complex::ZERO { 1.0 } else { size(root.at) };
    let radius = if nearest.is_finite() { 0.5 * nearest } else { own };
    let storages: Vec<usize> = (0..linear.states).filter(|k| linear.stores(*k)).collect();
    if root.multiplicity == 1 && radius > APART * own {
        let parts = eigenvectors(linear, root.at + Complex::from(CLOSE * radius), &storages);
        if let Some(parts) = parts {
            return sorted(&storages, parts);
        }
    }
    let mut sums = vec![Complex::ZERO; storages.len()];
    let mut resolvent = Resolvent::new(linear);
    let mut column = vec![Complex::ZERO; linear.unknowns.len()];
    for point in 0..POINTS {
        let angle = std::f64::consts::TAU * (point as f64 + 0.5) / POINTS as f64;
        let turn = Complex::new(radius * libm::cos(angle), radius * libm::sin(angle));
        if !resolvent.at(root.at + turn) {
            return vec![];
        }
        for (sum, k) in sums.iter_mut().zip(&storages) {
            column.fill(Complex::ZERO);
            column[*k] = Complex::ONE;
            resolvent.solve(&mut column);
            *sum = *sum + turn * column[*k];
        }
    }
    let part = |sum: &Complex| size(*sum) / POINTS as f64;
    sorted(&storages, sums.iter().map(part).collect())
}

/// w_k·v_k over their sum, of the pole next to s.
fn eigenvectors(linear: &Linear, s: Complex, storages: &[usize]) -> Option<Vec<f64>> {
    let mut resolvent = Resolvent::new(linear);
    if !resolvent.at(s) {
        return None;
    }
    let n = linear.unknowns.len();
    let mut vectors = [vec![Complex::ZERO; n], vec![Complex::ZERO; n]];
    // No eigenvector is likely to be at right angles to this.
    for (at, k) in storages.iter().enumerate() {
        let start = Complex::new(1.0, 0.37 + 0.61 * (at as f64 * 1.7).sin());
        vectors.iter_mut().for_each(|vector| vector[*k] = start);
    }
    for (vector, transposed) in vectors.iter_mut().zip([false, true]) {
        for _ in 0..3 {
            // E·v: what has no rate is left out.
            let largest = storages.iter().map(|k| size(vector[*k])).fold(0.0, f64::max);
            let mut next = vec![Complex::ZERO; n];
            storages.iter().for_each(|k| next[*k] = vector[*k].scaled(1.0 / largest));
            resolvent.solve_either(&mut next, transposed);
            *vector = next;
        }
    }
    let [right, left] = &vectors;
    let products: Vec<Complex> = storages.iter().map(|k| right[*k] * left[*k]).collect();
    let sum = products.iter().fold(Complex::ZERO, |sum, product| sum + *product);
    let parts: Vec<f64> = products.iter().map(|product| size(*product / sum)).collect();
    parts.iter().all(|part| part.is_finite()).then_some(parts)
}

/// The largest first.
fn sorted(storages: &[usize], parts: Vec<f64>) -> Vec<(usize, f64)> {
    let mut parts: Vec<(usize, f64)> = storages.iter().copied().zip(parts).collect();
    parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    parts
}

/// |z|.
fn size(z: Complex) -> f64 {
    libm::hypot(z.re, z.im)
}
