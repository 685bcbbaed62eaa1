//! Linear circuits driven along straight lines: steps by exponentials against closed forms and against other methods.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::{Run, prepare};
use bondspice::sim::{self, Interval, Method, Settings, Statistics};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;
use proptest::prelude::*;
use std::f64::consts::PI;
use std::fmt::Write;

pub(super) fn prepared(text: &str) -> Run {
    let mut map = SourceMap::default();
    let file = map.add("circuit.cir", text);
    let mut d = vec![];
    prepare(&mut map, file, &Overrides::default(), None, &mut d).unwrap_or_else(|| panic!("{d:#?}"))
}

/// A run with other settings.
pub(super) fn run_with(run: &Run, change: impl FnOnce(&mut Settings)) -> (Trace, Statistics) {
    let mut settings = run.settings.clone().expect("a run over time");
    change(&mut settings);
    let mut d = vec![];
    let system = sim::compile_for_run(&run.stamps, &mut d).unwrap_or_else(|| panic!("{d:#?}"));
    let mut trace = Trace::new(run.names.clone(), vec![]);
    let statistics = sim::transient(&system, &settings, &mut trace)
        .unwrap_or_else(|f| panic!("{:#?}", f.diagnostic));
    (trace, statistics)
}

/// The largest difference of each column, as a part of its range in the second.
pub(super) fn differences(a: &Trace, b: &Trace) -> Vec<f64> {
    assert_eq!(a.rows(), b.rows());
    let columns = a.columns.iter().zip(&b.columns).skip(1);
    let off = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        let least = b.iter().fold(f64::INFINITY, |least, x| least.min(*x));
        let most = b.iter().fold(f64::NEG_INFINITY, |most, x| most.max(*x));
        let off = a.iter().zip(b).fold(0.0f64, |off, (a, b)| off.max((a - b).abs()));
        if off == 0.0 { 0.0 } else { off / (most - least) }
    };
    columns.map(off).collect()
}

/// R and C of 1 Ω and 1 µF in a chain of `n` sections.
fn ladder(n: usize, source: &str, end: &str) -> String {
    let mut text = format!("a ladder\nV1 n0 0 {source}\n");
    for k in 0..n {
        write!(text, "R{k} n{k} n{} 1\nC{k} n{} 0 1u\n", k + 1, k + 1).unwrap();
    }
    text + end
}

/// The voltage of node `k` of an open ladder of `n` sections at `t` after the beginning of a rise to 1 V in a microsecond:
/// each mode decays by itself, with the rate 2·(1 − cos φ)/RC of its wave number φ, an odd part of π/(2n + 1). What
/// follows a rise is the mean of what follows the steps that it is made of.
fn after_a_rise(n: usize, k: usize, t: f64) -> f64 {
    const RISE: f64 = 1e-6;
    let mode = |j: usize| {
        let phi = (2 * j + 1) as f64 * PI / (2 * n + 1) as f64;
        let rate = 2.0 * (1.0 - phi.cos()) / 1e-6;
        // The part that the constant 1 has of sin(kφ), over sections 1 to n.
        let shape = |k: usize| (k as f64 * phi).sin();
        let part = (1..=n).map(shape).sum::<f64>() / (1..=n).map(|k| shape(k).powi(2)).sum::<f64>();
        let since = |t: f64| if t > 0.0 { -(-rate * t).exp_m1() / rate } else { 0.0 };
        part * shape(k) * (since(t) - since(t - RISE))
    };
    let driven = t.max(0.0) - (t - RISE).max(0.0);
    (driven - (0..n).map(mode).sum::<f64>()) / RISE
}

#[test]
fn a_ladder_follows_a_step_as_its_modes_do() {
    let end = ".save v(n1) v(n30)\n.tran 1u 400u\n.end\n";
    let run = prepared(&ladder(120, "PULSE(0 1 10u 1u 1u 1 2)", end));
    for (reltol, most) in [(1e-3, 3e-4), (1e-6, 3e-7), (1e-9, 3e-10)] {
        let (trace, statistics) = run_with(&run, |settings| settings.reltol = reltol);
        assert_eq!(statistics.method, "exponential", "{statistics}");
        // A corner, a step or two on each side of it, up to 32 solutions each.
        assert!(statistics.accepted <= 6 && statistics.solves < 200, "{statistics}");
        let mut worst = 0.0f64;
        for (column, node) in [(1, 1), (2, 30)] {
            for (t, v) in trace.columns[0].iter().zip(&trace.columns[column]) {
                let expected = after_a_rise(120, node, t - 1e-5);
                worst = worst.max((v - expected).abs());
            }
        }
        assert!(worst < most, "reltol {reltol:e}: {worst:e}, {statistics}");
    }
}

#[test]
fn rows_are_no_farther_apart_than_a_step_may_be_and_straight_between() {
    let end = ".save v(n1) v(n30)\n.options reltol=1e-3\n.tran 1u 400u 0 2u\n.end\n";
    let run = prepared(&ladder(120, "PULSE(0 1 10u 1u 1u 1 2)", end));
    let (trace, statistics) = run_with(&run, |_| {});
    assert_eq!(statistics.method, "exponential", "{statistics}");
    let apart = trace.columns[0].windows(2).map(|t| t[1] - t[0]).fold(0.0, f64::max);
    assert!(apart < 2e-6 * (1.0 + 1e-5), "{apart:e}");
    // v(n1) rises by itself within a microsecond: lines between rows stay within reltol of its range, and a step's error.
    let middle =
        |k: usize, column: usize| 0.5 * (trace.columns[column][k] + trace.columns[column][k + 1]);
    for k in 0..trace.rows() - 1 {
        let t = middle(k, 0) - 1e-5;
        let expected = after_a_rise(120, 1, t);
        assert!(
            (middle(k, 1) - expected).abs() < 1.2e-3,
            "{} for {expected} at {t:e}",
            middle(k, 1)
        );
    }
}

#[test]
fn ramps_jumps_and_parts_of_every_kind_are_as_other_methods_find_them() {
    let run = prepared(
        "every kind\nV1 in 0 PULSE(0 1 1u 0 0 20u 50u)\nR1 in a 10\nL1 a b 10u\nC1 b 0 1n\nC2 b c 10n\nR2 c 0 100\n\
         L2 c d 5u\nK1 L1 L2 0.5\nR3 d 0 50\nI1 0 d PWL(0 0 10u 10m 30u -5m 60u 0)\nC3 d 0 0.1n\nE1 e 0 b c 3\nR4 e f 1k\n\
         C4 f 0 1n\nF1 0 f V1 0.1\nIc 0 h PULSE(0 1m 5u 1u 1u 3u 1)\nCh h 0 10n\n.options reltol=1e-5\n.tran 0.1u 100u\n\
         .save v(b) v(c) v(d) v(f) v(h) i(L1) i(V1)\n.end\n",
    );
    let grid = |settings: &mut Settings| settings.rows = Interval::Grid(0.13e-6);
    let (found, statistics) = run_with(&run, |settings| {
        grid(settings);
        settings.method = Method::Exponential;
    });
    assert_eq!(statistics.method, "exponential", "{statistics}");
    let (expected, _) = run_with(&run, |settings| {
        grid(settings);
        (settings.method, settings.reltol) = (Method::Rodas5p, 1e-10);
    });
    for off in differences(&found, &expected) {
        // A step may err by 1e-5 of what is largest.
        assert!(off < 2e-5, "{off:e}: {statistics}");
    }
}

#[test]
fn what_it_does_not_suit_goes_by_another_method() {
    let wave = |n: usize| {
        let mut text = String::from("a line\nV1 in 0 PULSE(0 1 1u 10n 10n 1 2)\nR0 in n0 50\n");
        for k in 0..n {
            write!(text, "L{k} n{k} n{} 100n\nC{k} n{} 0 40p\n", k + 1, k + 1).unwrap();
        }
        text + &format!(
            "Rl n{n} 0 1meg\n.options reltol=1e-5\n.tran 10n 6u\n.save v(n1) v(n{n})\n.end\n"
        )
    };
    // Waves that run to and fro are no decays: the space is given up, and what follows is right.
    let run = prepared(&wave(60));
    let (found, statistics) = run_with(&run, |settings| settings.rows = Interval::Grid(1e-8));
    assert_eq!(statistics.method, "rodas5p", "{statistics}");
    let (expected, _) = run_with(&run, |settings| {
        settings.rows = Interval::Grid(1e-8);
        (settings.method, settings.reltol) = (Method::Rodas5p, 1e-8);
    });
    for off in differences(&found, &expected) {
        assert!(off < 2e-3, "{off:e}");
    }
    let asked = |text: &str| {
        let run = prepared(text);
        run_with(&run, |settings| settings.method = Method::Exponential).1
    };
    let curved =
        asked("a diode\nV1 a 0 PULSE(0 1 1u 1u)\nD1 a b d\nC1 b 0 1n\n.model d D()\n.tran 1u 9u\n");
    assert!(curved.method == "trbdf2" && curved.reason.contains("index 1"), "{curved}");
    let sine = asked("a sine\nV1 a 0 SIN(0 1 1meg)\nR1 a b 1k\nC1 b 0 1n\n.tran 1u 9u\n");
    assert!(sine.method == "rodas5p" && sine.reason.contains("straight lines"), "{sine}");
    let index_2 =
        asked("a loop\nV1 a 0 PULSE(0 1 1u 1u)\nC1 a 0 1n\nR1 a b 1k\nC2 b 0 1n\n.tran 1u 9u\n");
    assert!(index_2.method == "trbdf2" && index_2.pilot > 0, "{index_2}");
}

#[test]
fn many_corners_close_together_are_left_to_steps() {
    let points: String =
        (1..400).map(|k| format!(" {k}u {}", (k * 7919 % 1000) as f64 / 1e3)).collect();
    let method = |hmax: &str| {
        let end = format!(".save v(n1)\n.tran 1u 400u 0 {hmax}\n.end\n");
        run_with(&prepared(&ladder(80, &format!("PWL(0 0{points})"), &end)), |_| {}).1.method
    };
    assert_ne!(method("1u"), "exponential");
    assert_eq!(method("10n"), "exponential");
}

/// A random network of resistors, capacitors and inductors with controlled sources, driven by pulses and lines.
fn network() -> impl Strategy<Value = String> {
    let size = 0.0..1.0f64;
    let branch = (0..7usize, 0..6usize, 0..6usize, size);
    (prop::collection::vec(branch, 4..14), 0.0..1.0f64, 0.0..1.0f64).prop_map(|(branches, a, b)| {
        let mut text = String::from("random\n");
        writeln!(text, "V1 n0 0 PULSE(0 {} 1u {}u 1u 10u 40u)", 1.0 + a, 3.0 * b).unwrap();
        writeln!(text, "I1 0 n3 PWL(0 0 {}u 1m 20u -2m 50u 0)", 2.0 + 10.0 * b).unwrap();
        for node in 1..6 {
            // Every node has a way to ground and to the source, and a capacitor of its own.
            let r = 10f64.powf(1.0 + 2.0 * a + 0.3 * node as f64);
            writeln!(text, "Ra{node} n{} n{node} {r}\nCa{node} n{node} 0 {node}n", node - 1)
                .unwrap();
        }
        for (k, (kind, from, to, size)) in branches.into_iter().enumerate() {
            let to = if from == to { "0".to_string() } else { format!("n{to}") };
            let value = 10f64.powf(3.0 * size);
            match kind {
                0 | 1 => writeln!(text, "R{k} n{from} {to} {}", 10.0 * value),
                2 if from > 0 && to != "n0" => writeln!(text, "C{k} n{from} {to} {value}p"),
                3 | 4 => {
                    writeln!(text, "L{k} n{from} m{k} {value}u\nRl{k} m{k} {to} {}", 5.0 * value)
                }
                5 => writeln!(text, "G{k} n{from} 0 n{from} {to} {}m", 0.1 * size),
                _ => writeln!(text, "E{k} e{k} 0 n{from} {to} {size}\nRe{k} e{k} n5 1k"),
            }
            .unwrap();
        }
        text + ".options reltol=1e-5\n.tran 1u 100u\n.save v(n1) v(n3) v(n5) i(V1)\n.end\n"
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(25))]
    #[test]
    fn random_networks_are_as_a_rosenbrock_method_finds_them(text in network()) {
        let run = prepared(&text);
        let course = |method: Method, reltol: f64| run_with(&run, |settings| {
            settings.rows = Interval::Grid(0.37e-6);
            (settings.method, settings.reltol) = (method, reltol);
        });
        let (found, statistics) = course(Method::Exponential, 1e-5);
        let (expected, _) = course(Method::Rodas5p, 1e-9);
        for off in differences(&found, &expected) {
            // Chosen beforehand: a few steps' tolerances.
            prop_assert!(off < 1e-4, "{off:e} {statistics}\n{text}");
        }
    }
}
