//! `.pz` against closed forms and ngspice.
//!
//! Tolerances: 1e-9 of the root against closed forms, of multiple roots too; 1e-6 of the root against ngspice 39, whose
//! search ends there (its thermal voltage differs in the seventh figure).

mod linear_theory;

use crate::small_signal::{errors, has_ngspice, ngspice, printed, run};
use bondspice::trace::Trace;

/// The roots in their order.
fn roots(trace: &Trace, name: &str) -> Vec<(f64, f64)> {
    let part = |part: &str| crate::small_signal::column(trace, &format!("{name}.{part}")).to_vec();
    let pairs = part("re").into_iter().zip(part("im"));
    pairs.filter(|(re, _)| !re.is_nan()).collect()
}

fn close(found: &[(f64, f64)], wanted: &[(f64, f64)], part: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?} {wanted:?}");
    for ((re, im), (x, y)) in found.iter().zip(wanted) {
        let off = (re - x).hypot(im - y);
        assert!(off <= part * x.hypot(*y), "{off:e}: {found:?}\n{wanted:?}");
    }
}

fn ladder(n: usize, card: &str) -> String {
    let mut deck = String::from("v1 n0 0 dc 0 ac 1\n");
    for k in 1..=n {
        deck += &format!("r{k} n{} n{k} 1k\nc{k} n{k} 0 1u\n", k - 1);
    }
    deck + card
}

#[test]
fn ladders_of_many_orders() {
    // Driven at one end, open at the other: s_k = −4/(RC)·sin²((2k − 1)π/(4n + 2)); no finite zeros.
    for n in [1usize, 2, 5, 20, 60] {
        let trace = run(&ladder(n, &format!(".pz n0 0 n{n} 0 vol pz")));
        let exact = |k: usize| {
            let angle = (2 * k - 1) as f64 * std::f64::consts::PI / (4 * n + 2) as f64;
            (-4e3 * angle.sin().powi(2), 0.0)
        };
        close(&roots(&trace, "pole"), &(1..=n).map(exact).collect::<Vec<_>>(), 1e-9);
        assert_eq!(roots(&trace, "zero"), [], "{n}");
    }
    // Driven by a current the first node hangs on the ladder alone: the charge of all capacitors stays, s = 0.
    let trace = run(&ladder(3, ".pz n0 0 n3 0 cur pol"));
    let exact = |k: f64| (-4e3 * (k * std::f64::consts::PI / 6.0).sin().powi(2), 0.0);
    close(&roots(&trace, "pole"), &[(0.0, 0.0), exact(1.0), exact(2.0)], 1e-9);
}

#[test]
fn resonant_circuits() {
    let deck = |r: f64| {
        format!("v1 in 0 ac 1\nr1 in a {r}\nl1 a out 1m\nc1 out 0 1u\n.pz in 0 out 0 vol pol")
    };
    // s = −R/2L ± √((R/2L)² − 1/LC)
    let (half, square) = (10.0 / 2e-3, 1e9f64);
    let imaginary = (square - half * half).sqrt();
    close(&roots(&run(&deck(10.0)), "pole"), &[(-half, imaginary), (-half, -imaginary)], 1e-9);
    let half: f64 = 100.0 / 2e-3;
    let real = (half * half - square).sqrt();
    close(&roots(&run(&deck(100.0)), "pole"), &[(real - half, 0.0), (-half - real, 0.0)], 1e-9);
    // Without loss the poles lie on the axis exactly.
    let found = roots(&run(&deck(0.0)), "pole");
    close(&found, &[(0.0, square.sqrt()), (0.0, -square.sqrt())], 1e-9);
    assert_eq!(found[0].0, 0.0);
}

#[test]
fn double_poles_are_told_twice() {
    // Critical damping: L = 1, C = 1 µ, R = 2 k. As a pair of simple poles these numbers would hold eight figures.
    let deck = "v1 in 0 ac 1\nr1 in a 2k\nl1 a out 1\nc1 out 0 1u\n.pz in 0 out 0 vol pol";
    close(&roots(&run(deck), "pole"), &[(-1e3, 0.0), (-1e3, 0.0)], 1e-9);
    // Three stages behind buffers: a triple pole; and two resonant ones, a double pair.
    let stage =
        |k: usize| format!("r{k} s{} m{k} 1k\nc{k} m{k} 0 1u\ne{k} s{k} 0 m{k} 0 1\n", k - 1);
    let three: String = (1..=3).map(stage).collect();
    let trace = run(&format!("v1 s0 0 1\n{three}.pz s0 0 s3 0 vol pz"));
    close(&roots(&trace, "pole"), &[(-1e3, 0.0); 3], 1e-9);
    let stage = |k: usize| {
        format!(
            "r{k} s{p} a{k} 10\nl{k} a{k} m{k} 1m\nc{k} m{k} 0 1u\ne{k} s{k} 0 m{k} 0 1\n",
            p = k - 1
        )
    };
    let two: String = (1..=2).map(stage).collect();
    let y = (1e9f64 - 25e6).sqrt();
    let trace = run(&format!("v1 s0 0 1\n{two}.pz s0 0 s2 0 vol pol"));
    close(&roots(&trace, "pole"), &[(-5e3, y), (-5e3, y), (-5e3, -y), (-5e3, -y)], 1e-9);
    // Two that differ by a part in a thousand are two.
    let near = "v1 s0 0 1\nr1 s0 a 1k\nc1 a 0 1u\ne1 s1 0 a 0 1\nr2 s1 b 1.001k\nc2 b 0 1u\n.pz s0 0 b 0 vol pol";
    close(&roots(&run(near), "pole"), &[(-1e3 / 1.001, 0.0), (-1e3, 0.0)], 1e-9);
}

const TWIN_T: &str = "v1 in 0 dc 0 ac 1\nr1 in a 10k\nr2 a out 10k\nc3 a 0 2u\nc1 in b 1u\nc2 b out 1u\nr3 b 0 5k\nrl out 0 1meg\n.pz in 0 out 0 vol pz";

#[test]
fn a_twin_t_blocks_one_frequency() {
    let trace = run(TWIN_T);
    let mut zeros = roots(&trace, "zero");
    zeros.sort_by(|a, b| a.1.total_cmp(&b.1));
    close(&zeros, &[(0.0, -100.0), (-100.0, 0.0), (0.0, 100.0)], 1e-9);
}

#[test]
fn amplifiers_and_zeros_of_the_right_half_plane() {
    // gm against Cf: zero at +gm/Cf. An active integrator beside it: a pole at 0.
    let trace = run(
        "v1 in 0 0\nr1 in g 1k\ncf g d 1p\ng1 d 0 g 0 10m\nr2 d 0 10k\nc2 d 0 5p\n.pz in 0 d 0 vol pz",
    );
    close(&roots(&trace, "zero"), &[(10e-3 / 1e-12, 0.0)], 1e-9);
    let (g1, g2, gm) = (1e-3f64, 1e-4, 10e-3);
    let (cf, c2) = (1e-12, 5e-12);
    // (g1 + s·cf)(g2 + s(cf + c2)) + s·cf(gm − s·cf) = 0
    let (a, b, c) = (cf * (cf + c2) - cf * cf, g1 * (cf + c2) + cf * g2 + cf * gm, g1 * g2);
    let low = -2.0 * c / (b + (b * b - 4.0 * a * c).sqrt());
    close(&roots(&trace, "pole"), &[(low, 0.0), (c / (a * low), 0.0)], 1e-9);
    let trace = run("i1 0 a 0\nc1 a 0 1u\ng1 0 b a 0 1m\nc2 b 0 1u\n.pz a 0 b 0 cur pol");
    assert_eq!(roots(&trace, "pole"), [(0.0, 0.0), (0.0, 0.0)]);
}

#[test]
fn loops_and_cutsets_have_no_pole_of_their_own() {
    // A loop of capacitors with a source, inductors in series, an inductor beside a current source.
    let trace = run(
        "v1 a 0 1\nc1 a b 1u\nc2 b 0 1u\nr1 b 0 1k\nl1 b c 1m\nl2 c 0 1m\ni1 0 d 0\nl3 d 0 1m\nr3 d 0 1k\n.pz a 0 b 0 vol pz",
    );
    // 2µ·s + 1/R + 1/(2m·s) = 0, and R3/L3, which the output does not see.
    let y = (1.0f64 / 4e-9 - 250.0 * 250.0).sqrt();
    close(&roots(&trace, "pole"), &[(-250.0, y), (-250.0, -y), (-1e6, 0.0)], 1e-9);
}

#[test]
fn ngspice_finds_the_same() {
    if !has_ngspice() {
        return;
    }
    let diode = "i1 0 a 1m\nd1 a 0 dm\n.model dm d(is=1e-14 cjo=1p tt=1n)\nr1 a b 1k\nc1 b 0 1n\nv2 c 0 1\nc2 c b 2n\nl1 b d 1m\nl2 d 0 1m\n.pz a 0 b 0 cur pz";
    let decks = [
        (ladder(5, ".pz n0 0 n5 0 vol pz"), 5, 0),
        (TWIN_T.to_string(), 3, 3),
        (diode.to_string(), 3, 1),
        ("v1 in 0 dc 0 ac 1\nr1 in a 10\nl1 a out 1m\nc1 out 0 1u\n.pz in 0 out 0 vol pz".into(), 2, 0),
        ("i1 0 in 0\nr1 in 0 1k\nc1 in 0 1n\nr2 in out 1k\nc2 out 0 3n\nc3 in out 1n\n.pz in 0 out 0 cur pz".into(), 2, 1),
    ];
    for (deck, poles, zeros) in decks {
        let said = ngspice(&deck, "run\nprint all");
        let trace = run(&deck);
        for (name, count) in [("pole", poles), ("zero", zeros)] {
            let ours = roots(&trace, name);
            assert_eq!(ours.len(), count, "{deck}\n{ours:?}");
            for k in 1..=count {
                let theirs = printed(&said, &format!("{name}({k})"));
                let (x, y) = (theirs[0], theirs[1]);
                let near = |(re, im): &(f64, f64)| (re - x).hypot(im - y) <= 1e-6 * x.hypot(y);
                assert!(ours.iter().any(near), "{deck}\n{name} {x} {y}: {ours:?}");
            }
        }
    }
}

#[test]
fn what_makes_no_sense_is_said() {
    for (card, code) in [
        (".pz a 0 b vol pz", "E0703"),
        (".pz a 0 b 0 vol", "E0703"),
        (".pz a 0 b 0 volt pz", "E0703"),
        (".pz a 0 nosuch 0 vol pz", "E0740"),
        (".pz a 0 b b vol pz", "E0787"),
        (".pz a 0 b 0 vol pz more", "E0704"),
        (".pz a 0 c 0 vol zer", "E0812"),
    ] {
        let deck = format!("v1 a 0 1\nr1 a b 1k\nc1 b 0 1u\nr2 c 0 1k\ni2 0 c 1\n{card}");
        assert!(errors(&deck).contains(&code), "{card}: {:?}", errors(&deck));
    }
}
