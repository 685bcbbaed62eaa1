//! Fields: C, I, IC and R with several ports, and what makes them physical.
//!
//! Flows of all ports are counted into the field, so that Σ e·f is the power that goes into it. A port is capacitive,
//! q' = f, and its law gives e; or inertial, p' = e, and its law gives f. With x for q or p and y for what the law gives,
//!
//! ```text
//! dE/dt = Σ e·f = Σ y·x'        E(x) a function of state  ⇔  y_k = ∂E/∂x_k  ⇔  ∂y_j/∂x_k = ∂y_k/∂x_j
//! ```
//!
//! for every pair of ports, whatever their sorts: ∂e1/∂q2 = ∂e2/∂q1 in a C field, ∂f1/∂p2 = ∂f2/∂p1 in an I field, and
//! ∂f1/∂q2 = ∂e2/∂p1 in an IC field (Maxwell's reciprocity). A field that is not reciprocal gains or loses energy round
//! a closed path. A linear one, q = C·e or p = I·f, is reciprocal when its matrix is symmetric, and stores a positive
//! energy when that is positive definite. An R field e = R·f takes the power f·R·f, of which the antisymmetric part of R
//! (a gyrator's) has no share: it never gives power when the symmetric part is positive semidefinite.
//!
//! Source: D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, *System Dynamics*, 5th ed., ch. 7; W. Borutzky, *Bond Graph
//! Methodology*, 2010, ch. 2.

use super::consistent::random_sign;
use super::graph::{
    BondGraph, Dissipation, End, Expr, Field, Law, Leaf, Storage, StoreLaw, VertexId,
};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Dag, NodeId, Program};
use crate::linear::symmetric::least_eigenvalue;
use crate::source::Span;
use std::collections::HashSet;

/// The most ports that a field may have.
pub const MOST_PORTS: usize = 64;

/// Slopes, or entries of a matrix, that differ by more than this part of the larger are different.
const EQUAL: f64 = 1e-9;

/// A least eigenvalue below this part of the diagonal counts as 0.
const DEFINITE: f64 = 1e-12;

/// Checks every field: symmetry and definiteness of matrices, reciprocity of laws. Of instances of a model, whose laws
/// are the same, the first is tested for reciprocity.
pub fn check(graph: &BondGraph, d: &mut Vec<Diagnostic>) {
    let mut tested = HashSet::new();
    for id in graph.vertex_ids() {
        let Law::Field(field) = &graph.vertex(id).law else { continue };
        let stores = graph.storage(End::only(id)).is_some();
        match &field.matrix {
            Some(rows) if stores => check_storing(graph, id, rows, d),
            Some(rows) => check_passive(graph, id, rows, d),
            None if stores && tested.insert(vertex_place(graph, id)) => {
                if let Some(clash) = clash(graph, id, field) {
                    d.push(tell(graph, id, &clash));
                }
            }
            None => {}
        }
    }
}

/// Where the text of an element stands; every one made by hand, which stands nowhere, has a place of its own.
fn vertex_place(graph: &BondGraph, id: VertexId) -> (Span, Option<VertexId>) {
    let span = graph.vertex(id).span;
    (span, span.is_none().then_some(id))
}

/// Whether the energy of a storing field is a function of its stored quantities alone: its laws speak of nothing else,
/// and are reciprocal. A matrix has been found symmetric by [`check`].
pub fn is_state_function(graph: &BondGraph, id: VertexId) -> bool {
    let Law::Field(field) = &graph.vertex(id).law else { return false };
    let mut alone = true;
    let mut look = |expr: &Expr, matrix: bool| {
        expr.leaves(&mut |leaf, _| {
            alone &= match leaf {
                Leaf::Parameter(_) => true,
                Leaf::Stored(end) => !matrix && end.vertex == id,
                _ => false,
            }
        });
    };
    match &field.matrix {
        Some(rows) => rows.iter().flatten().for_each(|entry| look(entry, true)),
        None => field.ports.iter().for_each(|law| law.expressions(&mut |law| look(law, false))),
    }
    alone && (field.matrix.is_some() || clash(graph, id, field).is_none())
}

/// Whether an R field of two ports only converts: neither law speaks of its own port, so that what is imposed on one port
/// decides what may be imposed on the other. `Some(true)`: efforts on both or on none, as through a gyrator;
/// `Some(false)`: on one, as through a transformer.
pub fn converts(graph: &BondGraph, id: VertexId) -> Option<bool> {
    let Law::Field(field) = &graph.vertex(id).law else { return None };
    let [Law::Dissipator(first), Law::Dissipator(second)] = field.ports.as_slice() else {
        return None;
    };
    let mut own = false;
    for (law, bond) in field.ports.iter().zip(&graph.vertex(id).bonds) {
        law.expressions(&mut |law| {
            law.leaves(&mut |leaf, _| {
                own |= matches!(leaf, Leaf::Bond { bond: other, .. } if other == bond);
            });
        });
    }
    let gives_effort = |law: &Dissipation| !matches!(law, Dissipation::Flow(_));
    (!own).then(|| gives_effort(first) == gives_effort(second))
}

/// Two ports whose slopes differ.
struct Clash {
    ports: [u32; 2],
    /// ∂y_1/∂x_2 and ∂y_2/∂x_1.
    slopes: [f64; 2],
    /// What every port stores there.
    point: Vec<f64>,
}

/// The first pair of ports that is not reciprocal.
fn clash(graph: &BondGraph, id: VertexId, field: &Field) -> Option<Clash> {
    let mut tape = Tape::new(graph, id);
    let mut laws = vec![];
    for law in &field.ports {
        let Law::Store { law: StoreLaw::OfStored(law), .. } = law else { return None };
        laws.push(tape.add(law));
    }
    let mut pairs = vec![];
    for second in 1..laws.len() {
        for first in 0..second {
            let slopes = [
                tape.dag.derivative(laws[first], second as u32),
                tape.dag.derivative(laws[second], first as u32),
            ];
            pairs.push(([first as u32, second as u32], slopes));
        }
    }
    let (at, slopes, point) = tape.first_difference(&pairs)?;
    Some(Clash { ports: at, slopes, point: point[..laws.len()].to_vec() })
}

fn tell(graph: &BondGraph, id: VertexId, clash: &Clash) -> Diagnostic {
    let vertex = graph.vertex(id);
    let letters = |port: u32| match graph.storage(End { vertex: id, port }) {
        Some(Storage::Inertia) => ("f", "p"),
        _ => ("e", "q"),
    };
    let name = |letter: &str, port: u32| format!("{letter}{}", port + 1);
    let ([first, second], [a, b]) = (clash.ports, clash.slopes);
    let slope = |of: u32, over: u32| {
        format!("∂{}/∂{}", name(letters(of).0, of), name(letters(over).1, over))
    };
    let point: Vec<String> = (0..)
        .zip(&clash.point)
        .map(|(port, value)| format!("{} = {value:.3e}", name(letters(port).1, port)))
        .collect();
    let message = format!("the field `{}` does not conserve energy", vertex.name);
    Diagnostic::warning("W0406", vertex.span, message)
        .says(format!("{} is not {}", slope(first, second), slope(second, first)))
        .because(format!("they are {a:.6e} and {b:.6e} where {}", point.join(", ")))
        .because("the laws of a field are the slopes of its stored energy, whose mixed derivatives are equal")
        .help("derive the laws from one energy: e = ∂E/∂q, f = ∂E/∂p; f of each port counts into the field")
}

/// Laws of one field as a tape, its stored quantities first among the inputs.
struct Tape<'g> {
    graph: &'g BondGraph,
    id: VertexId,
    dag: Dag,
    /// What else the laws speak of.
    others: Vec<Leaf>,
    stored: usize,
}

impl<'g> Tape<'g> {
    fn new(graph: &'g BondGraph, id: VertexId) -> Tape<'g> {
        let stored = graph.law_ports(id).count();
        Tape { graph, id, dag: Dag::default(), others: vec![], stored }
    }

    fn add(&mut self, law: &Expr) -> NodeId {
        let Tape { graph, id, dag, others, stored } = self;
        let added: Result<NodeId, std::convert::Infallible> = dag.add(law, &mut |dag, leaf, _| {
            Ok(match leaf {
                Leaf::Parameter(id) => dag.constant(graph.parameters[id.index()].value),
                Leaf::Stored(end) if end.vertex == *id => dag.input(end.port),
                leaf => {
                    let place = others.iter().position(|other| other == leaf);
                    let place = place.unwrap_or_else(|| {
                        others.push(leaf.clone());
                        others.len() - 1
                    });
                    dag.input((*stored + place) as u32)
                }
            })
        });
        match added {
            Ok(node) => node,
        }
    }

    /// The first of some pairs whose two nodes have different values at a random point: the values, and the point.
    /// Points are of many sizes, since what is small for one quantity is large for another; where a value is not finite
    /// a point says nothing. A difference counts when it is no rounding: rounding changes when the point is moved a little.
    fn first_difference(
        &self,
        pairs: &[([u32; 2], [NodeId; 2])],
    ) -> Option<([u32; 2], [f64; 2], Vec<f64>)> {
        let open: Vec<_> = pairs.iter().filter(|(_, [a, b])| a != b).collect();
        if open.is_empty() {
            return None;
        }
        let outputs: Vec<NodeId> = open.iter().flat_map(|(_, nodes)| *nodes).collect();
        let program = Program::compile(&self.dag, &outputs);
        let mut registers = program.registers();
        let mut run = |point: &[f64]| -> Vec<f64> {
            program.run(point, &mut registers);
            program.outputs(&registers).collect()
        };
        let mut seed = 0x9e37_79b9_7f4a_7c15;
        for size in [1.0, 1e-3, 1e3, 1e-6, 1e-9, 1e6] {
            for _ in 0..8 {
                let point: Vec<f64> = (0..self.stored + self.others.len())
                    .map(|_| size * random_sign(&mut seed))
                    .collect();
                let values = run(&point);
                let moved: Vec<Vec<f64>> = (0..3)
                    .map(|_| {
                        let moved =
                            point.iter().map(|x| x * (1.0 + 1e-13 * random_sign(&mut seed)));
                        run(&moved.collect::<Vec<f64>>())
                    })
                    .collect();
                for (k, (ports, _)) in open.iter().enumerate() {
                    let (a, b) = (values[2 * k], values[2 * k + 1]);
                    let noise = moved
                        .iter()
                        .map(|m| (m[2 * k] - a).abs().max((m[2 * k + 1] - b).abs()))
                        .fold(0.0, f64::max);
                    let limit = EQUAL * a.abs().max(b.abs()) + 100.0 * noise;
                    if a.is_finite() && b.is_finite() && (a - b).abs() > limit {
                        return Some((*ports, [a, b], point));
                    }
                }
            }
        }
        None
    }
}

/// The entries of a matrix as numbers; `None` when one of them varies.
fn numbers(graph: &BondGraph, rows: &[Vec<Expr>]) -> Option<Vec<Vec<f64>>> {
    let number = |expr: &Expr| {
        let mut constant = true;
        expr.leaves(&mut |leaf, _| constant &= matches!(leaf, Leaf::Parameter(_)));
        constant.then(|| {
            expr.evaluate(&mut |leaf| match leaf {
                Leaf::Parameter(id) => graph.parameters[id.index()].value,
                _ => f64::NAN,
            })
        })
    };
    rows.iter().map(|row| row.iter().map(number).collect()).collect()
}

/// The matrix of a C or I field is symmetric and positive definite.
fn check_storing(graph: &BondGraph, id: VertexId, rows: &[Vec<Expr>], d: &mut Vec<Diagnostic>) {
    let vertex = graph.vertex(id);
    let mut tape = Tape::new(graph, id);
    let mut pairs = vec![];
    for (first, second) in (1..rows.len()).flat_map(|k| (0..k).map(move |j| (j, k))) {
        let nodes = [tape.add(&rows[first][second]), tape.add(&rows[second][first])];
        pairs.push(([first as u32, second as u32], nodes));
    }
    if let Some(([first, second], [a, b], _)) = tape.first_difference(&pairs) {
        let entry = |row: u32, column: u32| rows[row as usize][column as usize].span;
        d.push(
            Diagnostic::error(
                "E0421",
                entry(second, first),
                format!("the matrix of `{}` is not symmetric", vertex.name),
            )
            .says(format!("row {}, column {} is {b}", second + 1, first + 1))
            .label(entry(first, second), format!("row {}, column {} is {a}", first + 1, second + 1))
            .because("ports act on each other alike, or the field would gain or lose energy round a closed path")
            .help("give both entries the same value"),
        );
        return;
    }
    let Some(values) = numbers(graph, rows) else { return };
    for (k, row) in values.iter().enumerate() {
        if row[k] <= 0.0 {
            d.push(
                Diagnostic::error(
                    "E0422",
                    rows[k][k].span,
                    format!("the matrix of `{}` is not positive definite", vertex.name),
                )
                .says(format!("row {0}, column {0} is {1}", k + 1, row[k]))
                .help("the entries on the diagonal are the ports' own C or I, which are positive"),
            );
            return;
        }
    }
    // Each port in units of the root of its own entry: the diagonal becomes 1.
    let Some((least, vector)) = least_scaled(&values) else { return };
    if least > DEFINITE {
        return;
    }
    let span = rows[0][0].span.join(rows[rows.len() - 1][rows.len() - 1].span);
    let error = Diagnostic::error(
        "E0422",
        span,
        format!("the matrix of `{}` is not positive definite", vertex.name),
    );
    let power = match graph.storage(End::only(id)) {
        Some(Storage::Inertia) => "f",
        _ => "e",
    };
    d.push(match values.as_slice() {
        [one, two] => error
            .says(format!("its ports are coupled by k = {:.6}", one[1] / (one[0] * two[1]).sqrt()))
            .help("the coupling k = M/sqrt(L1*L2) lies between −1 and 1; an ideal one is a TF"),
        _ => error
            .says(format!("it would hold no energy, or less, at {}", list(power, &vector)))
            .help("weaken the coupling of these ports"),
    });
}

/// A matrix R that can give power is worth a warning.
fn check_passive(graph: &BondGraph, id: VertexId, rows: &[Vec<Expr>], d: &mut Vec<Diagnostic>) {
    let Some(values) = numbers(graph, rows) else { return };
    let n = values.len();
    let symmetric: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| 0.5 * (values[i][j] + values[j][i])).collect()).collect();
    let Some((least, vector)) = least_scaled(&symmetric) else { return };
    if least >= -DEFINITE {
        return;
    }
    let power: f64 =
        (0..n).map(|i| (0..n).map(|j| symmetric[i][j] * vector[i] * vector[j]).sum::<f64>()).sum();
    let span = rows[0][0].span.join(rows[n - 1][n - 1].span);
    let message = format!("the dissipator `{}` can give power", graph.vertex(id).name);
    d.push(
        Diagnostic::warning("W0407", span, message)
            .says(format!("it takes {power:.3e} at {}", list("f", &vector)))
            .because("the symmetric part of its matrix is not positive semidefinite")
            .help(
                "what gives power is a source, what only passes it on has an antisymmetric matrix",
            ),
    );
}

/// `f1 = 1, f2 = −0.5`.
fn list(letter: &str, vector: &[f64]) -> String {
    let items = vector.iter().enumerate().map(|(k, x)| format!("{letter}{} = {x:.3}", k + 1));
    items.collect::<Vec<_>>().join(", ")
}

/// The least eigenvalue of a symmetric matrix whose ports are measured so that its rows are near 1, and where it lies, the
/// largest component being 1.
fn least_scaled(values: &[Vec<f64>]) -> Option<(f64, Vec<f64>)> {
    let n = values.len();
    let own = |k: usize| {
        let own = values[k][k].abs();
        if own > 0.0 { own } else { values[k].iter().fold(0.0f64, |m, x| m.max(x.abs())) }
    };
    let scales: Vec<f64> = (0..n).map(own).map(|x| if x > 0.0 { x.sqrt() } else { 1.0 }).collect();
    let scaled: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| values[i][j] / (scales[i] * scales[j])).collect()).collect();
    let (least, vector) = least_eigenvalue(&scaled)?;
    let vector: Vec<f64> = vector.iter().zip(&scales).map(|(x, scale)| x / scale).collect();
    let largest = vector.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    Some((least, vector.iter().map(|x| x / largest).collect()))
}

/// What a row of a matrix gives: Σ entry·variable, without the terms that are 0.
pub fn combination(row: &[Expr], variables: &[Expr]) -> Expr {
    let mut sum: Option<Expr> = None;
    for (entry, variable) in row.iter().zip(variables) {
        let term = match entry.as_number() {
            Some(0.0) => continue,
            Some(1.0) => variable.clone(),
            Some(-1.0) => variable.clone().negate(),
            _ => entry.clone().binary(Binary::Multiply, variable.clone()),
        };
        sum = Some(match sum {
            Some(sum) => sum.binary(Binary::Add, term),
            None => term,
        });
    }
    sum.unwrap_or_else(|| Expr::number(0.0))
}
