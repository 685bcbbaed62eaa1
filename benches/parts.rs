//! What the parts of a run cost: `cargo bench --bench parts [NAME]`, those whose name holds NAME.
//!
//! Each line is the least time of one call over a fifth of a second, and how many times as long its peer takes in the same run: the
//! tree that a program was compiled from, faer's sparse LU (its order known) for one replay and solution of a matrix, the run of a
//! netlist for the stages before it. Times of different machines say nothing of each other; ratios in one run do.

use bondspice::circuit::stamps;
use bondspice::expr::{Binary, Dag, Expr, Function, Program};
use bondspice::linear::{Factors, Orders, Pattern};
use bondspice::netlist::{flatten, read};
use bondspice::sim::{self, Settings};
use bondspice::source::SourceMap;
use bondspice::trace::Nowhere;
use faer::prelude::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, Triplet};
use std::hint::black_box;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_millis(200);

/// The least time of one call, in ns.
fn least(mut call: impl FnMut()) -> f64 {
    let begin = Instant::now();
    call();
    // So many at once that the clock's own time is nothing.
    let batch = (1e-4 / begin.elapsed().as_secs_f64().max(1e-9)).ceil() as u32;
    let mut least = f64::INFINITY;
    while begin.elapsed() < PATIENCE {
        let start = Instant::now();
        (0..batch).for_each(|_| call());
        least = least.min(start.elapsed().as_secs_f64() / f64::from(batch));
    }
    1e9 * least
}

fn tell(name: &str, ns: f64, peer: Option<(&str, f64)>) {
    let against = peer.map(|(peer, other)| format!("{:8.2} x  {peer}", other / ns));
    println!("{name:44} {ns:14.0} ns {}", against.unwrap_or_default());
}

/// A mesh of resistors and capacitors at a step of 1 µs; of one row, a ladder.
fn grid(rows: u32, columns: u32) -> (usize, Vec<(u32, u32, f64)>) {
    let at = |i: u32, j: u32| i * columns + j;
    let mut entries: Vec<(u32, u32, f64)> = vec![];
    let mut join = |a: u32, b: u32| {
        entries.extend([(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)]);
    };
    for i in 0..rows {
        for j in 0..columns {
            if i + 1 < rows {
                join(at(i, j), at(i + 1, j));
            }
            if j + 1 < columns {
                join(at(i, j), at(i, j + 1));
            }
        }
    }
    let n = rows * columns;
    entries.extend((0..n).map(|k| (k, k, 2.0)));
    (n as usize, entries)
}

/// Unsymmetric, as controlled sources make it: a few entries a row, the diagonal the largest.
fn scattered(n: u32) -> (usize, Vec<(u32, u32, f64)>) {
    let mut entries: Vec<(u32, u32, f64)> = (0..n).map(|k| (k, k, 4.0)).collect();
    for k in 0..n {
        entries.extend((1..3).map(|i| (k, (k * 7 + i * 13) % n, f64::from(i) - 2.5)));
    }
    (n as usize, entries)
}

/// One factorisation of known order and one solution, ours and faer's.
fn matrix(name: &str, (n, entries): (usize, Vec<(u32, u32, f64)>)) {
    let pairs: Vec<(u32, u32)> = entries.iter().map(|(i, j, _)| (*i, *j)).collect();
    let (pattern, slots) = Pattern::from_triplets(n, &pairs);
    let mut values = vec![0.0; pattern.len()];
    entries.iter().zip(&slots).for_each(|((.., v), slot)| values[*slot as usize] += v);
    let Ok(mut factors) = Factors::new(&pattern, &values, false, &mut Orders::default()) else {
        return println!("{name:44} singular");
    };
    let right: Vec<f64> = (0..n).map(|k| (k as f64).cos()).collect();
    let mut x = right.clone();
    let replay = least(|| {
        black_box(factors.refactor(black_box(&values)).is_ok());
    });
    let solve = least(|| {
        x.copy_from_slice(&right);
        factors.solve(black_box(&mut x));
    });
    let triplets: Vec<_> =
        entries.iter().map(|(i, j, v)| Triplet::new(*i as usize, *j as usize, *v)).collect();
    let Ok(a) = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets) else { return };
    let Ok(symbolic) = SymbolicLu::try_new(a.symbolic()) else { return };
    let b = faer::Mat::from_fn(n, 1, |i, _| right[i]);
    let mut off: f64 = 0.0;
    let peer = least(|| {
        if let Ok(lu) = Lu::try_new_with_symbolic(symbolic.clone(), a.as_ref()) {
            let theirs = lu.solve(&b);
            off = (0..n).map(|k| (theirs[(k, 0)] - x[k]).abs()).fold(0.0, f64::max);
        }
    });
    assert!(off < 1e-9, "{name}: the two differ by {off:e}");
    tell(&format!("{name}: replay"), replay, None);
    tell(&format!("{name}: solve"), solve, None);
    tell(&format!("{name}: both"), replay + solve, Some(("faer's sparse LU", peer)));
}

/// Values, and values with derivatives, of a relief valve's and a saturated controller's law.
fn laws() {
    let x = |k: u32| Expr::leaf(k);
    let square = |e: Expr<u32>| e.clone() * e;
    let over = || x(0) - Expr::number(2.5e7);
    let root = Expr::call(Function::Sqrt, vec![square(over()) + Expr::number(1e10)]);
    let relief = Expr::number(1e-9) * (over() + root);
    let angle = (Expr::number(0.4) * x(1) + Expr::number(6.0) * x(2))
        .binary(Binary::Divide, Expr::number(60.0));
    let saturated = Expr::number(60.0) * Expr::call(Function::Tanh, vec![angle]);
    for (name, law, by) in
        [("relief valve", relief, vec![0]), ("saturation", saturated, vec![1, 2])]
    {
        let mut dag = Dag::default();
        let added: Result<_, std::convert::Infallible> =
            dag.add(&law, &mut |dag, k, _| Ok(dag.input(*k)));
        let Ok(node) = added;
        let mut outputs = vec![node];
        outputs.extend(by.iter().map(|k| dag.derivative(node, *k)));
        let inputs = [2.4e7, 3.0, 0.5];
        let tree = least(|| {
            black_box(law.evaluate(&mut |k| black_box(&inputs)[*k as usize]));
        });
        for (what, outputs) in [("value", &outputs[..1]), ("value and slopes", &outputs[..])] {
            let program = Program::compile(&dag, outputs);
            let mut registers = program.registers();
            let ns = least(|| program.run(black_box(&inputs), black_box(&mut registers)));
            tell(&format!("law of a {name}: {what}"), ns, Some(("its tree's value", tree)));
        }
    }
}

/// From the text of a shipped netlist to a run of it, stage by stage.
fn netlist(name: &str) {
    let path = format!("{}/netlists/{name}.cir", env!("CARGO_MANIFEST_DIR"));
    let Ok(text) = std::fs::read_to_string(&path) else { return println!("{path} is missing") };
    let cards = || {
        let mut map = SourceMap::default();
        let file = map.add(path.as_str(), text.as_str());
        read::read(&mut map, file, &read::How::default(), &mut vec![])
    };
    let deck = cards();
    let mut d = vec![];
    let Some(circuit) = flatten::flatten(&deck, &mut d) else { return println!("{d:#?}") };
    let Some(stamped) = stamps::stamp(&circuit, &mut d) else { return println!("{d:#?}") };
    let Some(system) = sim::compile_for_run(&stamped, &mut d) else { return println!("{d:#?}") };
    let Some(settings) = Settings::of(&circuit, true, &mut d) else { return println!("{d:#?}") };
    let Ok(counted) = sim::transient(&system, &settings, &mut Nowhere) else { return };
    let run = least(|| {
        black_box(sim::transient(&system, &settings, &mut Nowhere).is_ok());
    });
    let part = |what: &str, ns: f64| tell(&format!("{name}: {what}"), ns, Some(("its run", run)));
    part("text to cards", least(|| drop(black_box(cards()))));
    part("cards to circuit", least(|| drop(black_box(flatten::flatten(&deck, &mut vec![])))));
    part("circuit to stamps", least(|| drop(black_box(stamps::stamp(&circuit, &mut vec![])))));
    part(
        "stamps to system",
        least(|| drop(black_box(sim::compile_for_run(&stamped, &mut vec![])))),
    );
    let steps = (counted.accepted + counted.rejected.error) as f64;
    part(&format!("a step, of {steps}"), run / steps);
}

fn main() {
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    let wanted = wanted.unwrap_or_default();
    let all: [(&str, &dyn Fn()); 9] = [
        ("laws", &laws),
        ("matrix scattered 23", &|| matrix("scattered, 23", scattered(23))),
        ("matrix scattered 703", &|| matrix("scattered, 703", scattered(703))),
        ("matrix ladder 1000", &|| matrix("ladder, 1000", grid(1, 1000))),
        ("matrix ladder 10000", &|| matrix("ladder, 10000", grid(1, 10_000))),
        ("matrix mesh 50", &|| matrix("mesh, 50 x 50", grid(50, 50))),
        ("matrix mesh 100", &|| matrix("mesh, 100 x 100", grid(100, 100))),
        ("netlist eha_one_line", &|| netlist("eha_one_line")),
        ("netlist rlc", &|| netlist("rlc")),
    ];
    all.iter().filter(|(name, _)| name.contains(&wanted)).for_each(|(_, run)| run());
}
