//! Integration methods: each takes one step of a given size and estimates its local error.

pub mod exponential;
pub mod gear2;
pub mod history;
pub mod rodas;
mod small;
pub mod trapezoidal;
pub mod trbdf2;

use self::exponential::Space;
use self::history::History;
use super::abreast::Company;
use super::network::Network;
use super::newton::{Cut, Scratch};
use super::op::State;

/// An integration method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Chosen by the circuit.
    Auto,
    /// Rosenbrock, order 4.
    Rodas4,
    /// Rosenbrock, order 5.
    Rodas5p,
    /// Trapezoidal rule and BDF2 in one step, order 2, L-stable.
    TrBdf2,
    /// Trapezoidal rule, order 2.
    Trapezoidal,
    /// BDF2 with variable steps, order 2.
    Gear2,
    /// The exact solution of linear equations driven along straight lines, in a space of few dimensions.
    Exponential,
    /// Rosenbrock, order 3, with straight lines between the ends of its steps: of pilot passes.
    Rodas3,
}

/// One row of [`METHODS`].
#[derive(Clone, Copy, Debug)]
pub struct MethodRow {
    /// As `method=` names it.
    pub name: &'static str,
    /// Other names of it.
    pub aliases: &'static [&'static str],
    /// Which it is.
    pub method: Method,
    /// Order of its error over a run; 0 where that depends.
    pub order: u32,
    /// Where it comes from.
    pub source: &'static str,
}

/// Every method, one row each.
#[rustfmt::skip]
pub const METHODS: &[MethodRow] = &[
    MethodRow { name: "auto", aliases: &[], method: Method::Auto, order: 0, source: "chosen by the circuit" },
    MethodRow { name: "rodas5p", aliases: &["rodas5"], method: Method::Rodas5p, order: 5, source: "G. Steinebach, BIT 63:27, 2023" },
    MethodRow { name: "rodas4", aliases: &["rodas4p", "rodas"], method: Method::Rodas4, order: 4, source: "G. Steinebach, Preprint 1741, TH Darmstadt, 1995" },
    MethodRow { name: "trbdf2", aliases: &[], method: Method::TrBdf2, order: 2, source: "M. E. Hosea, L. F. Shampine, Appl. Numer. Math. 20:21-37, 1996" },
    MethodRow { name: "trap", aliases: &["trapezoidal"], method: Method::Trapezoidal, order: 2, source: "L. W. Nagel, SPICE2, ERL-M520, 1975" },
    MethodRow { name: "gear", aliases: &["gear2", "bdf2"], method: Method::Gear2, order: 2, source: "E. Hairer, S. P. Nørsett, G. Wanner, Solving ODEs I, 1993, III.5" },
    MethodRow { name: "exponential", aliases: &["krylov", "expm"], method: Method::Exponential, order: 0, source: "J. van den Eshof, M. Hochbruck, SIAM J. Sci. Comput. 27:1438-1457, 2006" },
];

impl Method {
    /// By a name of the table, in any case.
    pub fn named(name: &str) -> Option<Method> {
        let matches = |n: &str| n.eq_ignore_ascii_case(name);
        let mut rows = METHODS.iter();
        rows.find(|row| matches(row.name) || row.aliases.iter().any(|a| matches(a)))
            .map(|row| row.method)
    }

    /// The name in the table.
    pub fn name(self) -> &'static str {
        METHODS.iter().find(|row| row.method == self).map_or("auto", |row| row.name)
    }

    /// The power of the step size that the error estimate of one step grows with.
    pub(crate) fn error_power(self) -> f64 {
        match self {
            Method::Rodas5p => 5.0,
            Method::Rodas4 => 4.0,
            _ => 3.0,
        }
    }

    /// Whether it takes the derivatives at a step's left end for all of it.
    pub(crate) fn is_rosenbrock(self) -> bool {
        matches!(self, Method::Rodas3 | Method::Rodas4 | Method::Rodas5p)
    }
}

/// Why a Rosenbrock method is chosen.
pub(crate) const SMOOTH: &str = "smooth equations of index 1";

/// The method that suits a circuit, and why.
pub(crate) fn choose(network: &Network, index2: bool) -> (Method, &'static str) {
    if index2 {
        (Method::TrBdf2, "loops of capacitors and sources, or cutsets of inductors: index 2")
    } else if network.system.has_junctions() {
        (Method::TrBdf2, "exponential junctions")
    } else {
        (Method::Rodas5p, SMOOTH)
    }
}

/// error^(−1/p), by which a step may grow, for the power p of a method's error.
pub(crate) fn growth(error: f64, power: f64) -> f64 {
    match power {
        3.0 => libm::cbrt(error).recip(),
        4.0 => error.sqrt().sqrt().recip(),
        _ => libm::pow(error, -1.0 / power),
    }
}

/// Values between the ends of a step, for charges and unknowns alike:
/// y(θ) = (1 − θ)·y₀ + θ·(y₁ + (1 − θ)·(k₁ + θ·(k₂ + θ·k₃)))
#[derive(Clone, Debug)]
pub(crate) struct Dense {
    /// k₁, k₂, k₃ of the unknowns.
    pub x: [Vec<f64>; 3],
    /// k₁, k₂, k₃ of the charges.
    pub q: [Vec<f64>; 3],
    /// Whether charges between are those of the unknowns between, rather than polynomials of their own: a junction that
    /// leaves its conduction has lost almost all of its charge, and the rest says where its voltage is.
    pub by_unknowns: bool,
    /// Whether unknowns between lie on parabolas through the point before: as exact as steps of second order are.
    pub by_past: bool,
    /// So many of the k of the unknowns, and of the charges, may be other than 0.
    degrees: [usize; 2],
    /// Whether polynomials by the past are still to be made.
    pending: bool,
    /// Where a run goes by exponentials: unknowns between are what this says.
    pub space: Option<Box<Space>>,
}

/// What is asked of polynomials, where that is little.
#[derive(Clone, Debug, Default)]
pub(crate) struct Asked {
    pub unknowns: Vec<u32>,
    pub charges: Vec<u32>,
}

impl Dense {
    pub fn new(n: usize, charges: usize) -> Dense {
        Dense {
            x: std::array::from_fn(|_| vec![0.0; n]),
            q: std::array::from_fn(|_| vec![0.0; charges]),
            by_unknowns: false,
            by_past: false,
            degrees: [0; 2],
            pending: false,
            space: None,
        }
    }

    /// Looks at a part of the step, where that takes more than polynomials.
    pub fn look_at(&mut self, theta: f64) {
        if let Some(space) = &mut self.space {
            space.look_at(theta);
        }
    }

    /// Polynomials of the fourth degree: rows of factors for each k, of increments of which one stands after another.
    pub fn quartic(&mut self, rows: &[&[f64]; 3], ux: &[f64], uq: &[f64]) {
        (self.by_unknowns, self.by_past, self.pending) = (false, false, false);
        self.degrees = [3; 2];
        for (k, row) in rows.iter().enumerate() {
            for (sum, u) in [(&mut self.x[k], ux), (&mut self.q[k], uq)] {
                sum.fill(0.0);
                let size = sum.len();
                for (factor, u) in row.iter().zip(u.chunks_exact(size.max(1))) {
                    add(*factor, u, sum);
                }
            }
        }
    }

    /// Makes 0 of all k of the unknowns, or of the charges, but so many.
    fn keep(&mut self, of: usize, count: usize) {
        let k = if of == 0 { &mut self.x } else { &mut self.q };
        let end = self.degrees[of].max(count);
        k[count..end].iter_mut().for_each(|k| k.fill(0.0));
        self.degrees[of] = count;
    }

    /// Straight lines of the unknowns.
    pub fn lines(&mut self) {
        self.pending = false;
        self.keep(0, 0);
    }

    /// Parabolas of the unknowns through their values at a part of the step; charges follow from them.
    pub fn parabolas(&mut self, theta: f64, from: &State, middle: &[f64], to: &State) {
        (self.by_unknowns, self.by_past, self.pending) = (true, false, false);
        self.keep(0, 1);
        let points = from.x.iter().zip(&to.x).zip(middle);
        for (k, ((from, to), middle)) in self.x[0].iter_mut().zip(points) {
            let line = (1.0 - theta) * from + theta * to;
            *k = (middle - line) / (theta * (1.0 - theta));
        }
    }

    /// Polynomials by the past, made when they are asked for: see [`hermite`](Dense::hermite).
    pub fn follow_past(&mut self) {
        (self.by_unknowns, self.by_past, self.pending) = (false, true, true);
        self.keep(1, 2);
        self.keep(0, 1);
    }

    /// Cubic polynomials of the charges through their values and rates at both ends; parabolas of the unknowns through the
    /// point before. Of all, or of the unknowns and charges `asked` for.
    fn hermite(&mut self, history: &History, from: &State, to: &State, asked: Option<&Asked>) {
        let h = to.t - from.t;
        let [first, second, _] = &mut self.q;
        let cubic = |[from, to]: [f64; 2], [from_w, to_w]: [f64; 2]| {
            let change = to - from;
            (h * from_w - change, 2.0 * change - h * (from_w + to_w))
        };
        match asked {
            Some(asked) => asked.charges.iter().map(|k| *k as usize).for_each(|k| {
                (first[k], second[k]) = cubic([from.q[k], to.q[k]], [from.w[k], to.w[k]]);
            }),
            None => {
                let ends = from.q.iter().zip(&to.q).zip(from.w.iter().zip(&to.w));
                for ((first, second), ((from, to), (from_w, to_w))) in
                    first.iter_mut().zip(second.iter_mut()).zip(ends)
                {
                    (*first, *second) = cubic([*from, *to], [*from_w, *to_w]);
                }
            }
        }
        let unknowns = asked.map(|asked| &asked.unknowns[..]);
        history.bend(from, to, &mut self.x[0], unknowns);
        self.pending = asked.is_some();
    }

    /// The unknowns at a part of the step, which is [looked at](Dense::look_at).
    pub fn unknowns(&self, theta: f64, from: &State, to: &State, out: &mut [f64]) {
        if let Some(space) = &self.space {
            return space.unknowns(out);
        }
        interpolate(theta, &from.x, &to.x, &self.x, out);
    }

    /// One unknown at a part of the step, which is [looked at](Dense::look_at); what rests does so to the last digit.
    pub fn unknown(&self, i: usize, theta: f64, from: &State, to: &State) -> f64 {
        if let Some(space) = &self.space {
            return space.unknown(i);
        }
        one(i, theta, &from.x, &to.x, &self.x)
    }

    /// One charge at a part of the step; what rests does so to the last digit.
    pub fn charge(&self, k: usize, theta: f64, from: &State, to: &State) -> f64 {
        one(k, theta, &from.q, &to.q, &self.q)
    }

    /// The charges at a part of the step.
    pub fn charges(&self, theta: f64, from: &State, to: &State, out: &mut [f64]) {
        interpolate(theta, &from.q, &to.q, &self.q, out);
    }
}

/// y += factor·x
fn add(factor: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

fn interpolate(theta: f64, from: &[f64], to: &[f64], k: &[Vec<f64>; 3], out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = between(theta, from[i], to[i], [k[0][i], k[1][i], k[2][i]]);
    }
}

fn one(i: usize, theta: f64, from: &[f64], to: &[f64], k: &[Vec<f64>; 3]) -> f64 {
    let k = [k[0][i], k[1][i], k[2][i]];
    match from[i] == to[i] && k == [0.0; 3] {
        true => to[i],
        false => between(theta, from[i], to[i], k),
    }
}

fn between(theta: f64, from: f64, to: f64, k: [f64; 3]) -> f64 {
    let rest = 1.0 - theta;
    rest * from + theta * (to + rest * (k[0] + theta * (k[1] + theta * k[2])))
}

/// What a step may use of the past, and room to work in.
#[derive(Debug)]
pub(crate) struct Work {
    /// Increments of the stages, one vector after another.
    pub ux: Vec<f64>,
    pub uq: Vec<f64>,
    pub x: Vec<f64>,
    pub q: Vec<f64>,
    pub w: Vec<f64>,
    pub beta: Vec<f64>,
    pub sum: Vec<f64>,
    pub right: Vec<f64>,
    pub slopes: Vec<f64>,
    /// The local error of each unknown.
    pub error: Vec<f64>,
    /// Weights of the rates that no unknown's error shows, since the circuit is of index 2 there; infinite elsewhere.
    pub rate_weights: Vec<f64>,
    /// What counts as nothing of their charges.
    pub rate_floors: Vec<f64>,
    pub dense: Dense,
    pub scratch: Scratch,
    /// The weighted error that iterations may leave without a test.
    pub unconfirmed: f64,
    /// The steps before, for methods of several steps.
    pub history: History,
    /// Whether the laws' derivatives are those at the left end of the step.
    pub linearised: bool,
}

impl Work {
    pub fn new(n: usize, charges: usize) -> Work {
        Work {
            ux: vec![0.0; 8 * n],
            uq: vec![0.0; 8 * charges],
            x: vec![0.0; n],
            q: vec![0.0; charges],
            w: vec![0.0; charges],
            beta: vec![0.0; charges],
            sum: vec![0.0; charges],
            right: vec![0.0; n],
            slopes: vec![0.0; n],
            error: vec![0.0; n],
            rate_weights: vec![f64::INFINITY; charges],
            rate_floors: vec![0.0; charges],
            dense: Dense::new(n, charges),
            scratch: Scratch::new(n, charges),
            unconfirmed: 0.0,
            history: History::new(n, charges),
            linearised: false,
        }
    }

    /// Makes the polynomials of a step just taken, where they are still to be made: all of them, or those `asked` for.
    pub fn complete(&mut self, from: &State, to: &State, asked: Option<&Asked>) {
        if self.dense.pending {
            self.dense.hermite(&self.history, from, to, asked);
        }
    }
}

/// One step of a method from `from` to `to.t`; `weights` are those of the error test. Gives the largest weighted error.
pub(crate) async fn step(
    method: Method,
    network: &mut Network<'_>,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
    company: Company<'_>,
) -> Result<f64, Cut> {
    match method {
        Method::Rodas3 => {
            rodas::step(&rodas::RODAS3, network, from, to, weights, work, company).await
        }
        Method::Rodas4 => {
            rodas::step(&rodas::RODAS4P, network, from, to, weights, work, company).await
        }
        Method::Rodas5p => {
            rodas::step(&rodas::RODAS5P, network, from, to, weights, work, company).await
        }
        Method::Trapezoidal => trapezoidal::step(network, from, to, weights, work, company).await,
        Method::Gear2 => gear2::step(network, from, to, weights, work, company).await,
        Method::Exponential => exponential::step(network, from, to, weights, work),
        Method::TrBdf2 | Method::Auto => {
            trbdf2::step(network, from, to, weights, work, company).await
        }
    }
}

/// Largest |error|/weight; a number that is none counts as infinite.
pub(crate) fn weighted(error: &[f64], weights: &[f64]) -> f64 {
    // Four at a time, which processors do at once. The sum keeps what a comparison would lose: NaN.
    const LANES: usize = 4;
    let (mut largest, mut sum) = ([0.0; LANES], [0.0; LANES]);
    let mut take = |lane: usize, error: f64, weight: f64| {
        let size = error.abs() / weight;
        largest[lane] = if size > largest[lane] { size } else { largest[lane] };
        sum[lane] += size;
    };
    let (errors, rest) = error.as_chunks::<LANES>();
    let (weighing, others) = weights.as_chunks::<LANES>();
    for (error, weight) in errors.iter().zip(weighing) {
        (0..LANES).for_each(|lane| take(lane, error[lane], weight[lane]));
    }
    rest.iter().zip(others).for_each(|(error, weight)| take(0, *error, *weight));
    if sum.iter().all(|sum| sum.is_finite()) {
        largest.into_iter().fold(0.0, f64::max)
    } else {
        f64::INFINITY
    }
}

/// The error of the unknowns that errors of the charges cause: W(α)⁻¹·A·α·δQ, with the factors at hand.
pub(crate) fn filtered_error(
    network: &mut Network,
    alpha: f64,
    charges: &[f64],
    error: &mut [f64],
) {
    error.fill(0.0);
    network.system.rates.add_transposed(alpha, charges, error);
    network.solve_dynamic(error);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_a_row_and_names_are_found() {
        for row in METHODS {
            assert_eq!(Method::named(row.name), Some(row.method));
            assert_eq!(row.method.name(), row.name);
            for alias in row.aliases {
                assert_eq!(Method::named(alias), Some(row.method));
            }
        }
        assert_eq!(Method::named("TRAP"), Some(Method::Trapezoidal));
        assert_eq!(Method::named("euler"), None);
    }
}
