//! Decks that are hard to start: each comes to the right answer (a closed form, or a root found here by bisection), or fails
//! with an error that names the cause.

use std::process::Command;

/// k·300.15 K/q, V.
const VT: f64 = 1.380_649e-23 * 300.15 / 1.602_176_634e-19;

/// Standard output, standard error and exit code of `bondspice simulate` on a deck with a title added.
fn simulate(deck: &str, flags: &[&str]) -> (String, String, i32) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.cir");
    std::fs::write(&path, format!("a difficult deck\n{deck}\n.end\n")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondspice"));
    let output = command.arg("simulate").arg(&path).args(flags).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), text(output.stderr), output.status.code().unwrap())
}

/// Rows of numbers.
fn rows(deck: &str, flags: &[&str]) -> Vec<Vec<f64>> {
    let (out, err, code) = simulate(deck, flags);
    assert_eq!(code, 0, "{deck}\n{err}");
    let lines = out.lines().skip(1);
    lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

/// The values of an operating point.
fn point(deck: &str) -> Vec<f64> {
    rows(deck, &["-q"]).pop().unwrap()
}

/// The rows at given times.
fn at(deck: &str, times: &[f64], flags: &[&str]) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("times");
    let text: Vec<String> = times.iter().map(|t| format!("{t:e}\n")).collect();
    std::fs::write(&path, text.concat()).unwrap();
    let flags: Vec<&str> = [&["-q", "--times", path.to_str().unwrap()], flags].concat();
    rows(deck, &flags)
}

/// Where a rising function crosses 0 between two bounds.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    assert!(f(low) <= 0.0 && f(high) >= 0.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

fn close(value: f64, exact: f64, tolerance: f64) {
    assert!((value - exact).abs() <= tolerance, "{value} instead of {exact}");
}

/// Fails with this code, and says all of this.
fn fails(deck: &str, code: i32, says: &[&str]) {
    let (_, err, got) = simulate(deck, &[]);
    assert_eq!(got, code, "{deck}\n{err}");
    for text in says {
        assert!(err.contains(text), "{deck}\nshould say `{text}`:\n{err}");
    }
}

#[test]
fn chains_and_bridges_of_diodes() {
    let diodes = |n: usize, last: &str, model: &str| -> String {
        let node = |k: usize| if k == n { last.to_string() } else { format!("d{k}") };
        let cards: Vec<String> =
            (0..n).map(|k| format!("D{k} {} {} dm\n", node(k), node(k + 1))).collect();
        format!("{}.model dm D({model})\n", cards.concat())
    };
    let chain = format!("V1 a 0 10\nR1 a d0 1k\nR2 z 0 1m\n{}", diodes(12, "z", "is=1e-14"));
    let i = root(0.0, 0.01, |i| i * 1000.001 + 12.0 * VT * (i / 1e-14 + 1.0).ln() - 10.0);
    close(point(&format!("{chain}.save v(d0)\n.op"))[0], 10.0 - 1e3 * i, 1e-6);

    let chain = format!("V1 d0 0 20\n{}", diodes(40, "0", "is=1e-14 rs=0.1"));
    let i = root(0.0, 5.0, |i| 0.1 * i + VT * (i / 1e-14 + 1.0).ln() - 0.5);
    let values = point(&format!("{chain}.save v(d1) i(V1)\n.op"));
    close(values[0], 19.5, 1e-9);
    close(values[1], -i, 1e-6 * i);

    let bridge = "V1 p n 20\nD1 p o dm\nD2 n o dm\nD3 0 p dm\nD4 0 n dm\nR1 o 0 1k\n\
                  .model dm D(is=1e-12 n=1.5)\n.save v(o)\n.op";
    let i = root(0.0, 0.02, |i| i * 1e3 + 3.0 * VT * (i / 1e-12 + 1.0).ln() - 20.0);
    close(point(bridge)[0], 1e3 * i, 1e-6);
}

#[test]
fn exponential_sources_with_huge_arguments() {
    for (supply, r, law, f) in [
        (
            5.0,
            1e3,
            "1e-14*exp(V(b)/0.02585)",
            (|v| 1e-14 * f64::exp(v / 0.02585)) as fn(f64) -> f64,
        ),
        (100.0, 1.0, "1e-30*exp(1000*V(b))", |v| 1e-30 * f64::exp(1e3 * v)),
        (1000.0, 1.0, "exp(1e5*V(b))-1", |v| f64::exp(1e5 * v) - 1.0),
    ] {
        let deck = format!("V1 a 0 {supply}\nR1 a b {r}\nB1 b 0 I={law}\n.save v(b)\n.op");
        let exact = root(0.0, 1.0, |v| f(v).min(1e300) - (supply - v) / r);
        close(point(&deck)[0], exact, 1e-9);
    }
}

#[test]
fn feedback() {
    // Inverting amplifiers of gain 1e9: linear, with a diode, with limits.
    let exact = -10.0 / (1.0 + 11e-9);
    close(
        point("V1 i 0 1\nR1 i m 1k\nR2 m o 10k\nE1 o 0 0 m 1e9\n.save v(o)\n.op")[0],
        exact,
        1e-8,
    );
    let exact = -VT * (1e-3f64 / 1e-14 + 1.0).ln();
    let diode =
        "V1 i 0 1\nR1 i m 1k\nD1 m o dm\nE1 o 0 0 m 1e9\n.model dm D(is=1e-14)\n.save v(o)\n.op";
    close(point(diode)[0], exact, 1e-8);
    let limited =
        "V1 i 0 1\nR1 i m 1k\nR2 m o 10k\nB1 o 0 V=15*tanh(-1e9*V(m)/15)\n.save v(o)\n.op";
    let m = root(-1e-6, 1e-6, |m| (m - 1.0) / 1e3 + (m + 15.0 * (1e9 * m / 15.0).tanh()) / 1e4);
    close(point(limited)[0], -15.0 * (1e9 * m / 15.0).tanh(), 1e-6);
    // Three inverters in a ring rest half way.
    let ring = "B1 a 0 V=-5*tanh(10*V(c))\nB2 b 0 V=-5*tanh(10*V(a))\nB3 c 0 V=-5*tanh(10*V(b))\nR1 a 0 1k\n.save v(a)\n.op";
    close(point(ring)[0], 0.0, 1e-9);
}

#[test]
fn a_latch_goes_where_ic_says() {
    let deck = |q: f64, qb: f64| {
        format!(
            "V1 vdd 0 5\nR1 vdd q 1k\nR2 vdd qb 1k\nC1 q 0 1n\nC2 qb 0 1n\n\
             B1 q 0 I=2.5m*(1+tanh(4*(V(qb)-2)))*tanh(5*V(q))\n\
             B2 qb 0 I=2.5m*(1+tanh(4*(V(q)-2)))*tanh(5*V(qb))\n\
             .ic v(q)={q} v(qb)={qb}\n.save v(q) v(qb)\n.tran 1u 20u"
        )
    };
    // The two currents at rest, by turns.
    let half = |other: f64| {
        root(0.0, 5.0, |v| {
            2.5 * (1.0 + (4.0 * (other - 2.0)).tanh()) * (5.0 * v).tanh() - (5.0 - v)
        })
    };
    let (mut high, mut low) = (5.0, 0.0);
    for _ in 0..100 {
        low = half(high);
        high = half(low);
    }
    assert!(high - low > 2.0);
    let end = at(&deck(5.0, 0.0), &[20e-6], &["--option", "reltol=1e-6"]);
    close(end[0][1], high, 1e-4);
    close(end[0][2], low, 1e-4);
    let end = at(&deck(0.0, 5.0), &[20e-6], &["--option", "reltol=1e-6"]);
    close(end[0][1], low, 1e-4);
    close(end[0][2], high, 1e-4);
}

#[test]
fn a_schmitt_trigger_flips_at_its_two_thresholds() {
    let deck = "V1 in 0 PWL(0 0 1m 5 2m 0)\nE1 e 0 p in 1e4\nB1 o 0 V=2.5+2.5*tanh(V(e))\nC1 p 0 1p\n\
                R1 o p 10k\nR2 p m 10k\nV2 m 0 2.5\n.save v(o)\n.tran 1u 2m";
    let times = [0.70e-3, 0.74e-3, 0.76e-3, 1.0e-3, 1.74e-3, 1.76e-3, 1.9e-3];
    let exact = [5.0, 5.0, 0.0, 0.0, 0.0, 5.0, 5.0];
    for (row, exact) in at(deck, &times, &[]).iter().zip(exact) {
        assert!((row[1] - exact).abs() < 1e-3, "{} at {}", row[1], row[0]);
    }
}

#[test]
fn laws_with_no_slope_or_an_infinite_one_at_rest() {
    for law in ["sgn(V(b))*sqrt(abs(V(b)))", "pwr(V(b),0.3)", "V(b)*abs(V(b))"] {
        let deck = format!("V1 a 0 0\nR1 a b 1\nB1 b 0 I={law}\n.save v(b)\n.op");
        close(point(&deck)[0], 0.0, 1e-9);
    }
    let root_law = "B1 b 0 I=sgn(V(b))*sqrt(abs(V(b)))";
    close(point(&format!("V1 a 0 2\nR1 a b 1\n{root_law}\n.save v(b)\n.op"))[0], 1.0, 1e-9);
    let two =
        format!("V1 a 0 0\nB2 a b I=sgn(V(a,b))*sqrt(abs(V(a,b)))\n{root_law}\n.save v(b)\n.op");
    close(point(&two)[0], 0.0, 1e-9);
    // v + √v = s, and its mirror, through 0.
    let swing = format!("V1 a 0 SIN(0 1 50)\nR1 a b 1\n{root_law}\n.save v(b)\n.tran 10u 40m");
    let times = [1e-3, 4e-3, 9e-3, 12e-3, 16e-3, 33e-3, 38e-3];
    for row in at(&swing, &times, &["--option", "reltol=1e-5"]) {
        let s = (100.0 * std::f64::consts::PI * row[0]).sin();
        let root = 0.5 * ((1.0 + 4.0 * s.abs()).sqrt() - 1.0);
        close(row[1], s.signum() * root * root, 1e-5);
    }
}

#[test]
fn quadratic_laws_in_a_row_start_from_rest() {
    // Two orifices: V = 2·i·|i|.
    let deck = "V0 s 0 PULSE(0 4 1m 1u 1u 10m 30m)\nV1 s b 0\nB1 b c V=I(V1)*abs(I(V1))\nV2 c d 0\n\
                B2 d 0 V=I(V2)*abs(I(V2))\n.save i(V1)\n.tran 1u 5m";
    let times = [0.5e-3, 1.0005e-3, 1.001e-3, 5e-3];
    let exact = [0.0, 1.0, 2.0f64.sqrt(), 2.0f64.sqrt()];
    for (row, exact) in at(deck, &times, &[]).iter().zip(exact) {
        close(row[1], exact, 1e-6);
    }
}

#[test]
fn a_kink_of_twelve_decades_at_the_start() {
    let deck = "V1 a 0 SIN(0 10 1k)\nR1 a b 1\nB1 b 0 I=V(b)>0 ? 1e6*V(b) : 1e-6*V(b)\n.save v(b)\n.tran 1u 2m";
    for row in at(deck, &[0.1e-3, 0.25e-3, 0.6e-3, 0.75e-3, 1.3e-3, 1.9e-3], &[]) {
        let s = 10.0 * (2e3 * std::f64::consts::PI * row[0]).sin();
        let exact = s / if s > 0.0 { 1.0 + 1e6 } else { 1.0 + 1e-6 };
        close(row[1], exact, 1e-3 * 10.0);
    }
}

#[test]
fn a_law_of_time_across_a_capacitor() {
    // Its current is C·dv/dt, which no state shows.
    let deck =
        "B1 a 0 V=sin(6283185.307179586*time)\nC1 a 0 1u\nR1 a 0 1\n.save i(B1)\n.tran 1u 20u";
    let times: Vec<f64> = (1..60).map(|k| f64::from(k) * 0.331e-6).collect();
    for row in at(deck, &times, &["--option", "reltol=1e-4"]) {
        let phase = 6283185.307179586 * row[0];
        let exact = -(std::f64::consts::TAU * phase.cos() + phase.sin());
        close(row[1], exact, 1e-3 * 12.6);
    }
}

#[test]
fn storages_that_no_equation_of_rest_determines() {
    let warned = |deck: &str, says: &str| {
        let (out, err, code) = simulate(deck, &[]);
        assert!(code == 0 && err.contains(says), "{err}");
        let last = out.lines().last().unwrap();
        last.split(',').map(|field| field.parse().unwrap()).collect::<Vec<f64>>()
    };
    // The charge on the gate stays 0.
    let gate = "V1 a 0 5\nC1 a g 1p\nC2 g 0 3p\n.save v(g)\n.op";
    close(warned(gate, "W0804]: the operating point leaves v(g) open")[0], 1.25, 1e-9);
    // It does so while the supply moves.
    let gate = "V1 a 0 PULSE(1 5 1u 1n 1n 10u 20u)\nC1 a g 1p\nC2 g 0 3p\n.save v(g)\n.tran 1n 5u";
    close(warned(gate, "W0804")[1], 1.25, 1e-6);
    // Two capacitors with a resistor between them come to one voltage.
    let pair = "V1 a 0 6\nC1 a b 1n\nR1 b c 1k\nC2 c 0 2n\n.save v(b) v(c)\n.op";
    let values = warned(pair, "leaves v(b), v(c) open");
    close(values[0], 2.0, 1e-9);
    close(values[1], 2.0, 1e-9);
    // A current shared by two inductors: the flux round their loop stays 0.
    let loops = "I1 0 a 1\nL1 a 0 1m\nL2 a 0 2m\n.save i(L1) i(L2)\n.op";
    let values = warned(loops, "W0805]: the operating point leaves the current of `L2` open");
    close(values[0], 2.0 / 3.0, 1e-9);
    close(values[1], 1.0 / 3.0, 1e-9);
    // What a source moves for ever begins where it is said to.
    let values = warned("I1 0 a 1u\nC1 a 0 1n ic=2\n.save v(a)\n.op", "leaves v(a) open");
    close(values[0], 2.0, 1e-9);
    close(warned("V1 a 0 5\nL1 a 0 1m\n.save i(L1)\n.op", "current of `L1` open")[0], 0.0, 1e-12);
}

#[test]
fn a_relaxation_oscillator() {
    let deck = "V1 v 0 5\nR1 v a 1k\nC1 a 0 1u ic=0\nS1 a 0 a 0 sm\n.save v(a)\n\
                .model sm SW(vt=2 vh=0.5 ron=10 roff=1meg)\n.tran 1u 10m uic";
    // Charging to 2.5 V, discharging to 1.5 V, by turns.
    let charge: (f64, f64) = (5.0 / 1.001, 1e-6 * 1e3 / 1.001);
    let drain = (5.0 * 10.0 / 1010.0, 1e-6 * 1e3 * 10.0 / 1010.0);
    let (mut t, mut v, mut on) = (0.0, 0.0_f64, false);
    let end = loop {
        let ((to, tau), goal): ((f64, f64), f64) = if on { (drain, 1.5) } else { (charge, 2.5) };
        let time = tau * ((v - to) / (goal - to)).ln();
        if t + time > 10e-3 {
            break to + (v - to) * (-(10e-3 - t) / tau).exp();
        }
        (t, v, on) = (t + time, goal, !on);
    };
    close(at(deck, &[10e-3], &["--option", "reltol=1e-6"])[0][1], end, 1e-4);
}

#[test]
fn what_has_no_solution_says_why() {
    fails("I1 0 a 1m\nI2 a 0 2m\n.op", 3, &["E0780", "v(a) is not determined"]);
    fails("I1 a b 1m\nR1 a b 1k\nR2 c 0 1\n.op", 3, &["E0780", "v(a), v(b) are not determined"]);
    fails("V1 a 0 5\nV2 a 0 4\nR1 a 0 1\n.op", 3, &["E0781", "V1, V2 form a loop"]);
    fails("V1 a 0 5\nR1 a 0 1\nE1 b 0 b 0 1\nR2 b 0 1\n.op", 3, &["v(b) is not determined"]);
    fails(
        "V1 a 0 -1\nR1 a b 1\nB1 b 0 V=sqrt(V(a))\n.op",
        4,
        &["E0803", "the law of `B1`", "root"],
    );
    fails(
        "I1 0 a 1\nB1 a 0 I=-1-V(a)*V(a)\n.op",
        4,
        &["E0801", "the node of v(a)", "laws of B1", "there v(a) = ", "lowered sources: none"],
    );
    fails(
        "V1 a 0 1\nR1 a 0 1\nB1 b 0 I=V(b)*V(b)+1\nR2 b 0 1\n.op",
        4,
        &["E0801", "the node of v(b) is satisfied worst", "laws of B1"],
    );
    fails(
        "B1 0 a I=V(a)*V(a)\nC1 a 0 1 ic=1\n.tran 1m 2 uic",
        4,
        &["E0802", "the error of v(a) stays too large", "a step of", "grows without bound"],
    );
    fails(
        "V1 v 0 5\nR1 v a 1k\nS1 a 0 a 0 sm\n.model sm SW(vt=2 vh=0.1 ron=1 roff=1meg)\n.op",
        4,
        &["E0804", "`S1` switches to and fro"],
    );
}

#[test]
fn sources_beyond_a_limit_are_told_by_how_far_they_can_go() {
    // The law takes up no more than 1 mA, the source wants 3 mA.
    let deck = "I1 0 a 3m\nB1 a 0 I=1m*tanh(V(a))\n.op";
    fails(deck, 4, &["E0801", "with lowered sources: up to 33", "a limit that they go beyond"]);
}

#[test]
fn big_decks_are_searched_for_floating_nodes_and_loops() {
    let ladder: String =
        (0..2500).map(|k| format!("R{k} n{k} n{} 1\nC{k} n{k} 0 1u\n", k + 1)).collect();
    let end = "V1 n0 0 1\nRend n2500 0 1\n.tran 1u 2u";
    fails(
        &format!("{ladder}R9001 x y 1\nR9002 x y 2\n{end}"),
        3,
        &["E0780", "v(x), v(y) are not determined: the nodes float together"],
    );
    fails(
        &format!("{ladder}V9001 n7 m 1\nV9002 m n9 2\nV9003 n9 n7 1\n{end}"),
        3,
        &["E0781", "V9001, V9002, V9003 form a loop of voltage sources"],
    );
    fails(&format!("{ladder}I9001 0 x 1\nI9002 x 0 1\n{end}"), 3, &["E0780", "v(x)"]);
    let (_, err, code) = simulate(&format!("{ladder}{end}\n.save v(n9)"), &[]);
    assert_eq!(code, 0, "{err}");
}

/// A latch of two inverters with two states at rest and one between.
const LATCH: &str = "R1 a 0 1meg\nB1 q 0 V=2.5-2.5*tanh(4*(V(qb)-2.5))\nB2 x 0 V=2.5-2.5*tanh(4*(V(q)-2.5))\n\
                     R2 x qb 1k\nC1 qb 0 1n\nV9 a 0 1\n.save v(q) v(qb)\n";

#[test]
fn nodeset_chooses_between_solutions_and_holds_nothing() {
    // q = f(qb), qb = f(q): high and low.
    let f = |v: f64| 2.5 - 2.5 * (4.0 * (v - 2.5)).tanh();
    let (mut high, mut low) = (5.0, 0.0);
    for _ in 0..200 {
        (high, low) = (f(low), f(high));
    }
    for (set, q, qb) in [("v(q)=5 v(qb)=0", high, low), ("v(q)=0 v(qb)=5", low, high)] {
        // Values far from the solution: they are where the search begins, no more.
        let values = point(&format!("{LATCH}.nodeset {set}\n.op"));
        close(values[0], q, 1e-9);
        close(values[1], qb, 1e-9);
    }
}

#[test]
fn initial_values_hold_at_rest_where_the_dialect_says_so() {
    let deck = "V1 a 0 5\nR1 a b 1k\nC1 b 0 1u ic=2\nL1 a c 1m ic=3m\nR2 c 0 1k\n.save v(b) i(L1)\n.tran 1u 1m";
    let first = |flags: &[&str]| at(deck, &[0.0, 1e-3], flags);
    // ngspice leaves `ic=` aside without `uic`.
    let rows = first(&["--dialect", "ngspice", "--option", "reltol=1e-6"]);
    close(rows[0][1], 5.0, 1e-9);
    close(rows[0][2], 5e-3, 1e-12);
    // Xyce holds C1 at 2 V and L1 at 3 mA, and lets go.
    let rows = first(&["--dialect", "xyce", "--option", "reltol=1e-6"]);
    close(rows[0][1], 2.0, 1e-9);
    close(rows[0][2], 3e-3, 1e-12);
    close(rows[1][1], 5.0 - 3.0 * (-1.0f64).exp(), 1e-5);
    close(rows[1][2], 5e-3, 1e-8);
}

#[test]
fn ic_holds_a_node_until_the_run_begins() {
    // Without `uic` the node is held while the rest comes to rest; with it the capacitor starts from the node's value.
    for uic in ["", " uic"] {
        let deck =
            format!("V1 a 0 5\nR1 a b 1k\nC1 b 0 1u\n.ic v(b)=1\n.save v(b)\n.tran 1u 2m{uic}");
        let rows = at(&deck, &[0.0, 1e-3, 2e-3], &["--option", "reltol=1e-6"]);
        close(rows[0][1], 1.0, 1e-6);
        close(rows[1][1], 5.0 - 4.0 * (-1.0f64).exp(), 1e-5);
        close(rows[2][1], 5.0 - 4.0 * (-2.0f64).exp(), 1e-5);
    }
}

#[test]
fn an_oscillator_keeps_its_energy_over_ten_thousand_periods() {
    // The trapezoidal rule turns (v, i) by an angle without changing the energy.
    let (l, c) = (1e-3f64, 1e-6f64);
    let period = 2.0 * std::f64::consts::PI * (l * c).sqrt();
    let stop = 1e4 * period;
    let deck = format!(
        "L1 a 0 1m ic=0\nC1 a 0 1u ic=1\n.options method=trap\n.save v(a) i(L1)\n.tran {:e} {stop:e} uic",
        period / 40.0
    );
    let times: Vec<f64> = (0..=20).map(|k| 500.0 * f64::from(k) * period).collect();
    let limit = format!("hmax={:e}", period / 40.0);
    for row in at(&deck, &times, &["--option", &limit]) {
        let energy = 0.5 * c * row[1] * row[1] + 0.5 * l * row[2] * row[2];
        close(energy / (0.5 * c), 1.0, 1e-3);
    }
}

#[test]
fn rows_between_steps_where_diodes_store_next_to_nothing() {
    // The source is what it is at every row; the clamped node never leaves the supplies by more than a diode's voltage.
    let deck = "V1 s 0 5\nV2 i 0 SIN(0 10 1k)\nD1 n s dm\nD2 0 n dm\nR1 n i 1k\nR2 s n 3.3k\nR3 n 0 3.3k\nR4 o 0 5.6k\nC1 n o 0.47u\n\
                .model dm D(is=4e-10 rs=0.1 n=1.5 tt=0.8u cjo=20p vj=0.4 m=0.4)\n.save v(i) v(n)\n.tran 2n 2m";
    let times: Vec<f64> = (1..400).map(|k| 5.01e-6 * f64::from(k)).collect();
    let tight = at(deck, &times, &["--option", "reltol=1e-7"]);
    for (row, fine) in at(deck, &times, &["--option", "reltol=1e-5"]).iter().zip(&tight) {
        close(row[1], 10.0 * (2e3 * std::f64::consts::PI * row[0]).sin(), 1e-4 * 20.0);
        close(row[2], fine[2], 1e-3 * 6.0);
    }
}

/// A switch without hysteresis in a divider turned by a sine: on while it is above its threshold, at every crossing, though
/// the current that the switch would carry with the other resistance is a thousand times what it ever carries.
#[test]
fn a_switch_without_hysteresis_turns_at_each_crossing() {
    let deck = "V1 a 0 SIN(0 1 1k)\nS1 a b a 0 sm\n.model sm SW(vt=0.5 ron=1 roff=1meg)\nR1 b 0 1k\n\
                .tran 10u 4m\n.print tran v(a) v(b)";
    let times: Vec<f64> = (0..400).map(|k| 1e-5 * f64::from(k) + 3e-6).collect();
    for row in at(deck, &times, &[]) {
        let exact = (2e3 * std::f64::consts::PI * row[0]).sin();
        let resistance = if exact > 0.5 { 1.0 } else { 1e6 };
        close(row[1], exact, 1e-6);
        close(row[2], exact * 1e3 / (1e3 + resistance), 1e-3);
    }
}

#[test]
fn a_charge_that_folds_back_ends_the_solution() {
    // `^` takes magnitudes: Q has an extreme at -1.83 V. A coarse run beforehand finds no charges at a corner on its way,
    // and what it would say of that speaks of a charge, not of an equation.
    let deck = "Vs s 0 SIN(0 3.490609322579473 2k)\nRs s in 10\nC1 in 0 Q={1u*v(in)+0.1u*v(in)^3}\n\
        T1 in 0 far 0 Z0=50 TD=20u\nRfar far 0 587.3065747400642\n\
        B1 in mid I={1e-3*tanh(1.431713324480724*v(in,mid))}\nC2 mid 0 1u\n\
        B2 mid 0 I={if(v(mid)>0.2,2e-3,1e-3)*v(mid)}\nL1 mid end 1m\nRe end 0 10\n.save v(in) v(far) i(l1)\n\
        .tran 50u 6m 0 50u uic";
    fails(deck, 4, &["the step became too small", "the sum of currents at the node of v(in)"]);
}
