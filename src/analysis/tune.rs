//! Gains of PI regulators from the bandwidth and the phase margin that are wanted, innermost loop first.
//!
//! ```text
//! L(s) = (Kp + Ki/s)·P(s)        |L(iω)| = 1, arg L(iω) = −π + margin at ω = bandwidth
//! C = 1/|P|, at the angle θ = −π + margin − arg P:        Kp = C·cos θ        Ki = −ω·C·sin θ
//! ```
//!
//! P is what leads from the regulator's signal to what it controls, with the loops inside closed by the gains that they have
//! been given, and whatever is outside cut off. Laws of dissipators that are not linear are left out, as the paper leaves
//! them out: friction of rest would pass for damping.

use super::linear::{Entry, Linear, linearise};
use super::point::{At, find};
use super::poles::poles;
use super::response::Resolvent;
use super::symbolic::symbols::bond_variable;
use crate::bond::causality::Causality;
use crate::bond::elaborate::unit_of;
use crate::bond::equations::slopes::Stands;
use crate::bond::equations::{Input as Speaks, Origin, Unknown};
use crate::bond::graph::{
    BondGraph, Dissipation, Expr, Law, Leaf, Observation, ParameterId, Power, Regulator, SignalId,
};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::linear::{Complex, Field};
use crate::source::Span;
use std::f64::consts::{PI, TAU};

/// A loop with its gains.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// The regulator's signal.
    pub signal: String,
    /// What it controls, and follows.
    pub controlled: String,
    /// The bandwidth and the margin that were wanted, rad/s and rad.
    pub wanted: [f64; 2],
    /// The names of the parameters Kp and Ki.
    pub names: [String; 2],
    /// Kp and Ki, SI.
    pub gains: [f64; 2],
    /// What the open loop has with them.
    pub margins: Margins,
    /// Poles on the right of the imaginary axis with this loop closed.
    pub unstable: usize,
    /// Whether the margin is larger than wanted, since more integral action would be needed to make it as small.
    pub larger: bool,
}

/// What an open loop says of the closed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Where the open loop's gain falls through 1 for the last time, rad/s.
    pub crossover: f64,
    /// The least phase margin at such places, rad.
    pub phase: f64,
    /// The least factor that makes the loop unstable, and where, rad/s; none where no factor does.
    pub gain: Option<(f64, f64)>,
    /// Where the closed loop has fallen by 3 dB, rad/s.
    pub bandwidth: Option<f64>,
}

/// More lag than this is not asked of a regulator, rad.
const MOST_LAG: f64 = 80.0 * PI / 180.0;
/// Frequencies a decade, and decades to either side of the bandwidth.
const POINTS: usize = 200;
const DECADES: f64 = 3.0;

/// Designs all loops of a model; the names of the elements whose laws were left out.
pub fn tune(
    graph: &BondGraph,
    causality: &Causality,
    at: At,
    d: &mut Vec<Diagnostic>,
) -> Option<(Vec<Tuned>, Vec<String>)> {
    if graph.regulators.is_empty() {
        let error = Diagnostic::error("E0939", Span::NONE, "the model has no `loop` statements");
        d.push(error.help("say what regulates what: `loop alpha: f(armature) follows I_ref, bandwidth 2000 rad/s, margin 60 deg`"));
        return None;
    }
    let mut graph = graph.clone();
    let mut done = vec![];
    let mut left_out = vec![];
    for regulator in inner_first(&graph.regulators) {
        let tuned = one(&mut graph, causality, at, &regulator, &mut left_out, d)?;
        done.push(tuned);
    }
    left_out.sort();
    left_out.dedup();
    Some((done, left_out))
}

/// A regulator stands behind those whose references its signal makes.
fn inner_first(regulators: &[Regulator]) -> Vec<Regulator> {
    let makes = |outer: &Regulator, inner: &Regulator| {
        let mut found = false;
        inner.reference.leaves(&mut |leaf, _| found |= *leaf == Leaf::Signal(outer.signal));
        found
    };
    let mut left: Vec<Regulator> = regulators.to_vec();
    let mut ordered = vec![];
    while !left.is_empty() {
        // Where they go in a circle any may be first.
        let next = (0..left.len()).find(|k| {
            let outer = &left[*k];
            !left.iter().any(|inner| inner.signal != outer.signal && makes(outer, inner))
        });
        ordered.push(left.remove(next.unwrap_or(0)));
    }
    ordered
}

fn refuse(regulator: &Regulator, message: String, help: &str) -> Diagnostic {
    Diagnostic::error("E0939", regulator.span, message).help(help)
}

fn one(
    graph: &mut BondGraph,
    causality: &Causality,
    at: At,
    regulator: &Regulator,
    left_out: &mut Vec<String>,
    d: &mut Vec<Diagnostic>,
) -> Option<Tuned> {
    let name = graph.signals[regulator.signal.index()].name.clone();
    let (Some(omega), Some(margin)) = (regulator.bandwidth, regulator.margin) else {
        let message = format!("the loop of `{name}` says no bandwidth, or no margin");
        let help = "both are needed: `…, bandwidth 2000 rad/s, margin 60 deg`";
        d.push(refuse(regulator, message, help));
        return None;
    };
    let gains = match parameters(regulator) {
        Some(gains) => gains,
        None => {
            let message = format!("the gains of `{name}` are no parameters of their own");
            let help = "write it as `pi(x, Kp = Kp_name, Ki = Ki_name, …)` with two parameters; `pid` is not designed";
            d.push(refuse(regulator, message, help));
            return None;
        }
    };
    let observe = |graph: &mut BondGraph, expr: &Expr, name: &str| {
        let si_unit = unit_of(graph, expr);
        let unit = (String::new(), 1.0);
        graph.experiment.observe =
            vec![Observation { name: name.into(), expr: expr.clone(), unit, si_unit }];
        graph.experiment.observe.clone()
    };
    let signal = Expr::leaf(Leaf::Signal(regulator.signal));
    let imposed = observe(graph, &signal, &name);
    observe(graph, &regulator.controlled, "controlled");
    let mut plant = linear(graph, causality, at, &imposed, d)?;
    left_out.extend(leave_out(graph, &mut plant));
    let mut resolvent = Resolvent::new(&plant);
    let mut p = |omega: f64| -> Option<Complex> {
        let all = resolvent.transfer(Complex::new(0.0, omega))?;
        all.first()?.first().copied().filter(|p| p.is_finite())
    };
    let here = p(omega).filter(|p| *p != Complex::ZERO);
    let Some(here) = here else {
        let message = format!("`{name}` does not reach what it controls at {omega} rad/s");
        d.push(refuse(
            regulator,
            message,
            "choose another point with --at, where the slopes are not 0",
        ));
        return None;
    };
    // A plant of negative gain wants negative gains; at low frequencies it leads by more than any lag makes up for.
    let low = p(1e-3 * omega).map_or(0.0, |p| libm::atan2(p.im, p.re));
    let sign = if low > 0.25 * PI { -1.0 } else { 1.0 };
    let mut theta = wrapped(-PI + margin - libm::atan2(sign * here.im, sign * here.re));
    if theta > 1e-9 {
        let most = (margin - theta).to_degrees();
        let message = format!(
            "a PI regulator cannot give `{name}` this margin: the plant leaves {most:.1} deg"
        );
        d.push(refuse(regulator, message, "ask for less bandwidth or less margin"));
        return None;
    }
    let larger = theta < -MOST_LAG;
    theta = theta.max(-MOST_LAG);
    let size = sign / libm::hypot(here.re, here.im);
    let values = [size * libm::cos(theta), -size * omega * libm::sin(theta)];
    let open = |omega: f64, p: Complex| p * Complex::new(values[0], -values[1] / omega);
    let margins = margins(omega, &mut |w| p(w).map(|p| open(w, p)));
    for (id, value) in gains.iter().zip(values) {
        graph.parameters[id.index()].value = value;
    }
    // Poles with this loop closed and what is outside cut off.
    let reference = observe(graph, &regulator.reference, "reference");
    observe(graph, &regulator.controlled, "controlled");
    let mut closed = linear(graph, causality, at, &reference, d)?;
    leave_out(graph, &mut closed);
    let found = poles(&closed).map_err(|error| d.push(*error)).ok()?;
    let fastest = found.iter().map(|pole| libm::hypot(pole.at.re, pole.at.im)).fold(0.0, f64::max);
    let right = found.iter().filter(|pole| pole.at.re > 1e-12 * fastest);
    let unstable = right.map(|pole| pole.multiplicity).sum();
    let names = gains.map(|id| graph.parameters[id.index()].name.clone());
    let controlled = spoken(graph, &regulator.controlled);
    Some(Tuned {
        signal: name,
        controlled,
        wanted: [omega, margin],
        names,
        gains: values,
        margins: margins.unwrap_or(Margins {
            crossover: omega,
            phase: margin,
            gain: None,
            bandwidth: None,
        }),
        unstable,
        larger,
    })
}

/// The parameters Kp and Ki are.
fn parameters(regulator: &Regulator) -> Option<[ParameterId; 2]> {
    let own = |expr: &Expr| match &*expr.node {
        Node::Leaf(Leaf::Parameter(id)) => Some(*id),
        _ => None,
    };
    let [kp, ki] = regulator.gains.as_ref()?;
    let (kp, ki) = (own(kp)?, own(ki)?);
    (kp != ki).then_some([kp, ki])
}

fn linear(
    graph: &BondGraph,
    causality: &Causality,
    at: At,
    inputs: &[Observation],
    d: &mut Vec<Diagnostic>,
) -> Option<Linear> {
    let point = find(graph, causality, at, d)?;
    linearise(graph, causality, &point, Some(inputs), d)
}

/// Takes the laws of dissipators that are not linear for 0, and tells their names.
fn leave_out(graph: &BondGraph, linear: &mut Linear) -> Vec<String> {
    let mut names = vec![];
    for (row, origin) in linear.origins.iter().enumerate() {
        let Origin::Vertex(id) = origin else { continue };
        let vertex = graph.vertex(*id);
        let given = match &vertex.law {
            Law::Dissipator(Dissipation::Effort(_)) => Power::Effort,
            Law::Dissipator(Dissipation::Flow(_)) => Power::Flow,
            _ => continue,
        };
        let kept = |unknown: u32| match linear.kinds[unknown as usize] {
            Unknown::Effort(_) => given == Power::Effort,
            Unknown::Flow(_) => given == Power::Flow,
            _ => false,
        };
        let varies = |entry: &Entry| {
            let inputs = entry.node.map_or(vec![], |node| linear.slopes.dag.inputs_of(node));
            let of = |k: u32| linear.slopes.stands(k);
            inputs.into_iter().any(|k| matches!(of(k), Stands::For(Speaks::Unknown(_))))
        };
        if !linear.rows[row].iter().any(|(_, entry)| varies(entry)) {
            continue;
        }
        let own = vertex.bonds.first().map(|bond| match given {
            Power::Effort => Unknown::Effort(*bond),
            Power::Flow => Unknown::Flow(*bond),
        });
        let is_own = |k: &u32| kept(*k) && Some(linear.kinds[*k as usize]) == own;
        let entries: Vec<(u32, Entry)> =
            linear.rows[row].iter().filter(|(k, _)| is_own(k)).copied().collect();
        // A row that an imposed variable has taken is no law any more.
        if entries.len() == 1 && linear.rows[row].len() > 1 {
            linear.rows[row] = entries;
            names.push(vertex.name.clone());
        }
    }
    names
}

/// An angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    let turns = ((angle + PI) / TAU).floor();
    angle - TAU * turns
}

/// The margins of an open loop around a frequency.
fn margins(omega: f64, open: &mut dyn FnMut(f64) -> Option<Complex>) -> Option<Margins> {
    let count = (2.0 * DECADES) as usize * POINTS;
    let step = |k: usize| omega * 10f64.powf(k as f64 / POINTS as f64 - DECADES);
    let (mut phase, mut crossover, mut gain, mut bandwidth) = (f64::INFINITY, None, None, None);
    let mut last: Option<(f64, Complex)> = None;
    for k in 0..=count {
        let at = step(k);
        let Some(now) = open(at) else { continue };
        if let Some((before, was)) = last {
            let size = |z: Complex| libm::hypot(z.re, z.im);
            if size(was) >= 1.0 && size(now) < 1.0 || size(was) < 1.0 && size(now) >= 1.0 {
                let cross = between(before, at, &mut |w| open(w).map(|z| size(z) - 1.0));
                if let Some(z) = open(cross) {
                    phase = f64::min(phase, wrapped(PI + libm::atan2(z.im, z.re)));
                    crossover = Some(cross);
                }
            }
            if (was.im < 0.0) != (now.im < 0.0) && was.re < 0.0 && now.re < 0.0 {
                let cross = between(before, at, &mut |w| open(w).map(|z| z.im));
                if let Some(z) = open(cross) {
                    let factor = 1.0 / size(z);
                    if factor > 1.0 && gain.is_none_or(|(least, _)| factor < least) {
                        gain = Some((factor, cross));
                    }
                }
            }
            let closed = |z: Complex| size(z / (Complex::ONE + z));
            let edge = std::f64::consts::FRAC_1_SQRT_2;
            if bandwidth.is_none() && at > 0.1 * omega && closed(was) >= edge && closed(now) < edge
            {
                bandwidth = Some(between(before, at, &mut |w| open(w).map(|z| closed(z) - edge)));
            }
        }
        last = Some((at, now));
    }
    Some(Margins { crossover: crossover?, phase, gain, bandwidth })
}

/// Where a function changes its sign between two frequencies.
fn between(mut a: f64, mut b: f64, f: &mut dyn FnMut(f64) -> Option<f64>) -> f64 {
    let negative = f(a).is_some_and(|value| value < 0.0);
    for _ in 0..60 {
        let middle = (a * b).sqrt();
        match f(middle) {
            Some(value) if (value < 0.0) == negative => a = middle,
            Some(_) => b = middle,
            None => break,
        }
    }
    (a * b).sqrt()
}

/// A variable in the words of the model.
fn spoken(graph: &BondGraph, expr: &Expr) -> String {
    let of = |id: &SignalId| graph.signals[id.index()].name.clone();
    crate::expr::print::print(expr, crate::expr::Dialect::Bond, &mut |leaf| match leaf {
        Leaf::Signal(id) => of(id),
        Leaf::Parameter(id) => graph.parameters[id.index()].name.clone(),
        Leaf::Bond { bond, variable, negated } => {
            format!("{}{}", if *negated { "-" } else { "" }, bond_variable(graph, *bond, *variable))
        }
        Leaf::Stored(end) => format!("q({})", graph.port_name(*end)),
        Leaf::Time => "time".into(),
        Leaf::Own(_) => "own".into(),
    })
}
