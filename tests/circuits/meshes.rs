//! Large meshes against closed forms: the modes of a grid decay and swing by themselves.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::prepare;
use bondspice::sim::Statistics;
use bondspice::source::SourceMap;
use bondspice::trace::Sink;
use std::f64::consts::PI;
use std::fmt::Write;

#[derive(Default)]
struct Kept(Vec<Vec<f64>>);

impl Sink for Kept {
    fn row(&mut self, row: &[f64]) -> std::io::Result<()> {
        self.0.push(row.to_vec());
        Ok(())
    }
}

fn run(deck: &str, sink: &mut dyn Sink) -> Statistics {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", deck);
    let mut d = vec![];
    let run = prepare(&mut map, file, &Overrides::default(), None, &mut d);
    let run = run.unwrap_or_else(|| panic!("{d:#?}"));
    run.go(sink).unwrap_or_else(|f| panic!("{:#?}", f.diagnostic))
}

/// The mode (k, l) of a grid of so many nodes a side, at a node.
fn mode(side: usize, [k, l]: [usize; 2], i: usize, j: usize) -> f64 {
    let part = |k: usize, i: usize| (PI * k as f64 * (i as f64 + 0.5) / side as f64).cos();
    part(k, i) * part(l, j)
}

/// How fast it decays in units of the edges' conductance over the nodes' capacitance.
fn eigenvalue(side: usize, [k, l]: [usize; 2]) -> f64 {
    let part = |k: usize| 2.0 - 2.0 * (PI * k as f64 / side as f64).cos();
    part(k) + part(l)
}

/// A grid with `edge` between neighbours and `node` at each node, both written with what they are called and stand at, the
/// latter with its initial voltage.
fn grid(
    side: usize,
    modes: &[([usize; 2], f64)],
    edge: impl Fn(&str, &str, &str) -> String,
    node: impl Fn(&str, &str, f64) -> String,
) -> String {
    let mut text = String::from("a grid\n");
    let name = |i: usize, j: usize| format!("n{i}_{j}");
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        let initial = modes.iter().map(|(m, size)| size * mode(side, *m, i, j)).sum();
        let _ = writeln!(text, "{}", node(&format!("{i}_{j}"), &name(i, j), initial));
        if i + 1 < side {
            let _ = writeln!(text, "{}", edge(&format!("a{i}_{j}"), &name(i, j), &name(i + 1, j)));
        }
        if j + 1 < side {
            let _ = writeln!(text, "{}", edge(&format!("b{i}_{j}"), &name(i, j), &name(i, j + 1)));
        }
    }
    text
}

/// The largest difference of a run's rows from a closed form of time and node, as a part of the range.
fn difference(
    kept: &Kept,
    nodes: &[(usize, usize)],
    exact: impl Fn(f64, usize, usize) -> f64,
) -> f64 {
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for row in &kept.0 {
        for ((i, j), value) in nodes.iter().zip(&row[1..]) {
            let exact = exact(row[0], *i, *j);
            worst = worst.max((value - exact).abs());
            largest = largest.max(exact.abs());
        }
    }
    worst / largest
}

const NODES: [(usize, usize); 3] = [(0, 0), (7, 20), (25, 4)];

fn saved() -> String {
    let nodes: Vec<String> = NODES.iter().map(|(i, j)| format!("v(n{i}_{j})")).collect();
    format!(".save {}\n", nodes.join(" "))
}

/// 2116 nodes: above what is factored with a choice of pivots.
#[test]
fn modes_of_a_grid_of_resistors_decay() {
    const SIDE: usize = 46;
    let modes = [([1, 0], 1.0), ([2, 5], 0.5), ([9, 9], 0.2)];
    let text = grid(
        SIDE,
        &modes,
        |name, a, b| format!("R{name} {a} {b} 1"),
        |name, at, initial| format!("C{name} {at} 0 1u ic={initial:e}"),
    );
    let exact = |t: f64, i: usize, j: usize| {
        let part = |(m, size): &([usize; 2], f64)| {
            size * mode(SIDE, *m, i, j) * (-eigenvalue(SIDE, *m) * t / 1e-6).exp()
        };
        modes.iter().map(part).sum()
    };
    for (reltol, tolerance) in [("1e-3", 5e-3), ("1e-5", 1e-4)] {
        let deck = format!("{text}{}.options reltol={reltol}\n.tran 1u 20u uic\n.end\n", saved());
        let mut kept = Kept::default();
        let statistics = run(&deck, &mut kept);
        assert!(statistics.symmetric > 0, "{statistics}");
        let difference = difference(&kept, &NODES, exact);
        assert!(difference < tolerance, "reltol={reltol}: {difference:e}\n{statistics}");
    }
}

/// 729 nodes and 1404 inductors, whose branches have a negative diagonal.
#[test]
fn modes_of_a_grid_of_inductors_swing() {
    const SIDE: usize = 27;
    let modes = [([1, 0], 1.0), ([3, 2], 0.5)];
    let text = grid(
        SIDE,
        &modes,
        |name, a, b| format!("L{name} {a} {b} 1m ic=0"),
        |name, at, initial| format!("C{name} {at} 0 1u ic={initial:e}\nR{name} {at} 0 200"),
    );
    // v'' + v'/(RC) + λ/(LC)·v = 0 with v'(0) = −v/(RC), since no current flows yet.
    let damping = 0.5 / (200.0 * 1e-6);
    let exact = |t: f64, i: usize, j: usize| {
        let part = |(m, size): &([usize; 2], f64)| {
            let square = eigenvalue(SIDE, *m) / (1e-3 * 1e-6) - damping * damping;
            assert!(square > 0.0);
            let omega = square.sqrt();
            let (sine, cosine) = (omega * t).sin_cos();
            let shape = (-damping * t).exp() * (cosine - damping / omega * sine);
            size * mode(SIDE, *m, i, j) * shape
        };
        modes.iter().map(part).sum()
    };
    let deck = format!("{text}{}.options reltol=1e-4\n.tran 10u 300u uic\n.end\n", saved());
    let mut kept = Kept::default();
    let statistics = run(&deck, &mut kept);
    assert!(statistics.symmetric > 0, "{statistics}");
    let difference = difference(&kept, &NODES, exact);
    assert!(difference < 1e-3, "{difference:e}\n{statistics}");
}
