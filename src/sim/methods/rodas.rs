//! Rosenbrock methods that are stiffly accurate, of order 3 (Rodas3), 4 (Rodas4P) and 5 (Rodas5P), for equations of index 1.
//!
//! With the charges Q as differential unknowns, Q' = w, 0 = Q(x) − Q and 0 = G·x + f + A·w − b form a system of index 1
//! in (Q; x, w). In each stage the increments of Q and w are eliminated by hand, so that the matrix stays n × n, w never
//! appears, and non-linear charges need nothing special:
//!
//! ```text
//! xᵢ = x₀ + Σ aᵢⱼ·uⱼ,  Qᵢ = Q₀ + Σ aᵢⱼ·vⱼ,  gᵢ = Q(xᵢ) − Qᵢ,  α = 1/(γh)
//! W(α)·uᵢ = b(tᵢ) − G·xᵢ − f(xᵢ, tᵢ) + dᵢ·h·∂/∂t(b − f) + A·(Σ cᵢⱼ/h·vⱼ − α·gᵢ),    vᵢ = gᵢ + (C + q')·uᵢ
//! ```
//!
//! W, ∂/∂t and q' are taken at the left end; the last stage's u is the error estimate. Coefficients in the form of
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 1996, IV.7.

use super::{Work, add, weighted};
use crate::linear::Cause;
use crate::sim::abreast::Company;
use crate::sim::network::Network;
use crate::sim::newton::Cut;
use crate::sim::op::State;

/// Coefficients of a method. Stages beyond the rows of `a` start where the one before them ended.
pub(crate) struct Tableau {
    pub stages: usize,
    pub gamma: f64,
    /// Rows 2, 3, … of a.
    pub a: &'static [&'static [f64]],
    /// Rows 2, 3, … of c.
    pub c: &'static [&'static [f64]],
    /// Abscissae and factors of the derivative by time; for the stages beyond they are 1 and 0.
    pub at: &'static [f64],
    pub d: &'static [f64],
    /// Rows for k₁, k₂, k₃ of the dense output.
    pub dense: [&'static [f64]; 3],
}

/// A. Sandu et al., Benchmarking stiff ODE solvers for atmospheric chemistry problems II, Atmos. Environ. 31:3459-3472,
/// 1997: order 3, estimate of order 2. Straight lines between its ends.
#[rustfmt::skip]
pub(crate) const RODAS3: Tableau = Tableau {
    stages: 4,
    gamma: 0.5,
    a: &[&[0.0], &[2.0, 0.0]],
    c: &[&[4.0], &[1.0, -1.0], &[1.0, -1.0, -8.0 / 3.0]],
    at: &[0.0, 0.0],
    d: &[0.5, 1.5],
    dense: [&[], &[], &[]],
};

/// G. Steinebach, Order-reduction of ROW-methods for DAEs and method of lines applications, Preprint 1741, TH
/// Darmstadt, 1995: order 4 (also on Prothero and Robinson's problem), estimate of order 3.
#[rustfmt::skip]
pub(crate) const RODAS4P: Tableau = Tableau {
    stages: 6,
    gamma: 0.25,
    a: &[
        &[3.0],
        &[1.831036793486759, 0.4955183967433795],
        &[2.304376582692669, -0.05249275245743001, -1.176798761832782],
        &[-7.170454962423024, -4.741636671481785, -16.31002631330971, -1.062004044111401],
    ],
    c: &[
        &[-12.0],
        &[-8.791795173947035, -2.207865586973518],
        &[10.81793056857153, 6.780270611428266, 19.5348594464241],
        &[34.19095006749676, 15.49671153725963, 54.7476087596413, 14.16005392148534],
        &[34.62605830930532, 15.30084976114473, 56.99955578662667, 18.40807009793095, -5.714285714285717],
    ],
    at: &[0.0, 0.75, 0.21, 0.63],
    d: &[0.25, -0.5, -0.023504, -0.0362],
    dense: [
        &[25.09876703708589, 11.62013104361867, 28.49148307714626, -5.664021568594133, 0.0],
        &[1.638054557396973, -0.7373619806678748, 8.47791821923899, 15.9925314877952, -1.882352941176471],
        &[],
    ],
};

/// G. Steinebach, Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
/// Differential Equations package, BIT Numerical Mathematics 63:27, 2023: order 5, estimate of order 4.
#[rustfmt::skip]
pub(crate) const RODAS5P: Tableau = Tableau {
    stages: 8,
    gamma: 0.21193756319429014,
    a: &[
        &[3.0],
        &[2.849394379747939, 0.45842242204463923],
        &[-6.954028509809101, 2.489845061869568, -10.358996098473584],
        &[2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
        &[-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946],
    ],
    c: &[
        &[-14.155112264123755],
        &[-17.97296035885952, -2.859693295451294],
        &[147.12150275711716, -1.41221402718213, 71.68940251302358],
        &[165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
        &[24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471],
        &[30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623, -28.087943162872662],
        &[37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002, -54.66780262877968, -9.48861652309627],
    ],
    at: &[0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664],
    d: &[0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069],
    dense: [
        &[25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073, 1.1241088310450404, 0.4272876194431874, -0.17202221070155493],
        &[-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372],
        &[11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722],
    ],
};

pub(crate) async fn step(
    tableau: &Tableau,
    network: &mut Network<'_>,
    from: &State,
    to: &mut State,
    weights: &[f64],
    work: &mut Work,
    company: Company<'_>,
) -> Result<f64, Cut> {
    let n = from.x.len();
    let charges = from.q.len();
    let h = to.t - from.t;
    let alpha = 1.0 / (tableau.gamma * h);
    let Work { ux, uq, q, sum, right, slopes, error, dense, linearised, .. } = work;
    let fresh = !*linearised;
    if fresh {
        network.linearise(&from.x, from.t, false);
        network.time_slopes(from.t, slopes);
        *linearised = true;
    }
    if let Err(singular) = network.factorise_dynamic(alpha) {
        return Err(match singular.cause {
            Cause::NotFinite => Cut::NonFinite { device: network.non_finite_law() },
            _ => Cut::Singular(singular),
        });
    }
    let curved = network.system.curved.contains(&true);
    to.x.copy_from_slice(&from.x);
    to.q.copy_from_slice(&from.q);
    for i in 0..tableau.stages {
        // Stage point: from x₀ by the row of a, or one more increment on the point before.
        if let Some(row) = i.checked_sub(1).and_then(|r| tableau.a.get(r)) {
            to.x.copy_from_slice(&from.x);
            to.q.copy_from_slice(&from.q);
            for (j, a) in row.iter().enumerate() {
                add(*a, &ux[j * n..(j + 1) * n], &mut to.x);
                add(*a, &uq[j * charges..(j + 1) * charges], &mut to.q);
            }
        } else if i > 0 {
            add(1.0, &ux[(i - 1) * n..i * n], &mut to.x);
            add(1.0, &uq[(i - 1) * charges..i * charges], &mut to.q);
        }
        let t = from.t + tableau.at.get(i).unwrap_or(&1.0) * h;
        let evaluated = i > 0 || !fresh;
        sum.fill(0.0);
        if let Some(row) = i.checked_sub(1).and_then(|r| tableau.c.get(r)) {
            for (j, c) in row.iter().enumerate() {
                add(c / h, &uq[j * charges..(j + 1) * charges], sum);
            }
        }
        let v = &mut uq[i * charges..(i + 1) * charges];
        if let Some(seated) = company.filter(|_| !curved) {
            let by_time = tableau.d.get(i).map(|d| (d * h, &slopes[..]));
            if seated.stage(network, (t, &to.x), by_time, sum, [&mut *right, &mut *v]).await {
                network.statistics.evaluations += u64::from(evaluated);
                ux[i * n..(i + 1) * n].copy_from_slice(right);
                continue;
            }
        }
        if evaluated {
            network.evaluate(&to.x, t);
        }
        network.residual(&to.x, t, right);
        for r in right.iter_mut() {
            *r = -*r;
        }
        if let Some(d) = tableau.d.get(i) {
            add(d * h, slopes, right);
        }
        v.fill(0.0);
        if curved {
            network.charges(&to.x, q);
            for (k, v) in v.iter_mut().enumerate() {
                if network.system.curved[k] {
                    *v = q[k] - to.q[k];
                    sum[k] -= alpha * *v;
                }
            }
        }
        network.system.rates.add_transposed(1.0, sum, right);
        network.solve_dynamic(right);
        ux[i * n..(i + 1) * n].copy_from_slice(right);
        network.add_charge_change(1.0, right, v);
    }
    let last = tableau.stages - 1;
    error.copy_from_slice(&ux[last * n..(last + 1) * n]);
    add(1.0, error, &mut to.x);
    add(1.0, &uq[last * charges..(last + 1) * charges], &mut to.q);
    to.w.copy_from_slice(&from.w);
    let size = weighted(error, weights);
    if !size.is_finite() || to.x.iter().any(|x| !x.is_finite()) {
        return Err(Cut::NonFinite { device: network.non_finite_law() });
    }
    if size <= 1.0 {
        dense.quartic(&tableau.dense, ux, uq);
    }
    Ok(size)
}
