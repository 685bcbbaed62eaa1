//! `.dc`, `.ac`, `.tf`, `.step` and `.data` against closed forms, separate runs, and ngspice's figures.
//!
//! Tolerances: 1e-9 of the value against closed forms, equal bits for steps against separate runs, 1e-6 of the value
//! against what ngspice 39 prints with seven figures.

use crate::small_signal::{column, errors, has_ngspice, ngspice, run};
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{prepare, run_text};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;
use std::f64::consts::TAU;

/// The largest |ours − exact| by |exact| of a phasor column.
fn misfit(trace: &Trace, name: &str, exact: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (re, im) = (column(trace, &format!("{name}.re")), column(trace, &format!("{name}.im")));
    let rows = column(trace, "frequency").iter().zip(re.iter().zip(im));
    rows.map(|(f, (re, im))| {
        let (x, y) = exact(*f);
        (re - x).hypot(im - y) / x.hypot(y)
    })
    .fold(0.0, f64::max)
}

fn divide((a, b): (f64, f64), (c, d): (f64, f64)) -> (f64, f64) {
    let size = c * c + d * d;
    ((a * c + b * d) / size, (b * c - a * d) / size)
}

#[test]
fn a_resonant_circuit_in_ac() {
    let trace = run(
        "v1 in 0 0 ac 1\nr1 in a 10\nl1 a out 1m\nc1 out 0 1u\n.ac dec 7 100 1meg\n.print ac v(out) vdb(out) i(l1)",
    );
    let bottom = |f: f64| (1.0 - (TAU * f).powi(2) * 1e-9, TAU * f * 1e-5);
    assert!(misfit(&trace, "v(out)", |f| divide((1.0, 0.0), bottom(f))) < 1e-9);
    assert!(misfit(&trace, "i(l1)", |f| divide((0.0, TAU * f * 1e-6), bottom(f))) < 1e-9);
    for ((f, db), _) in column(&trace, "frequency").iter().zip(column(&trace, "vdb(out)")).zip(0..)
    {
        let (x, y) = bottom(*f);
        assert!((db + 20.0 * x.hypot(y).log10()).abs() < 1e-9, "{f}");
    }
}

#[test]
fn ladders_in_ac() {
    // n equal sections RC, open at the end: 1/v(n) = B_n(x) = Σ C(n + k, n − k)·x^k, x = jωRC (Morgan-Voyce polynomials).
    for n in [1u64, 3, 8] {
        let mut deck = String::from("v1 n0 0 ac 1\n");
        for k in 1..=n {
            deck += &format!("r{k} n{} n{k} 1k\nc{k} n{k} 0 1u\n", k - 1);
        }
        let trace = run(&format!("{deck}.ac dec 5 0.1 100k\n.print ac v(n{n})"));
        let choose = |n: u64, k: u64| (1..=k).fold(1.0, |c, j| c * (n - k + j) as f64 / j as f64);
        let exact = |f: f64| {
            let (mut sum, mut power) = ((0.0, 0.0), (1.0, 0.0));
            for k in 0..=n {
                let c = choose(n + k, n - k);
                sum = (sum.0 + c * power.0, sum.1 + c * power.1);
                power = (-power.1 * TAU * f * 1e-3, power.0 * TAU * f * 1e-3);
            }
            divide((1.0, 0.0), sum)
        };
        let off = misfit(&trace, &format!("v(n{n})"), exact);
        assert!(off < 1e-9, "{n} sections: {off:e}");
    }
}

/// A deck in a dialect.
fn run_as(dialect: &str, deck: &str) -> Trace {
    let overrides = Overrides { dialect: Some(dialect.into()), ..Overrides::default() };
    match run_text("deck.cir", &format!("title\n{deck}\n.end\n"), &overrides) {
        Ok((trace, _)) => trace,
        Err(d) => panic!("{deck}\n{d:#?}"),
    }
}

#[test]
fn phases_are_in_the_unit_of_the_dialect() {
    let deck = "v1 a 0 ac 1\nr1 a b 1k\nc1 b 0 1u\n.ac list 100\n.print ac vp(b) ip(c1) vdb(b)";
    let exact = -(TAU * 0.1).atan();
    for (dialect, unit, factor) in [
        ("ngspice", "rad", 1.0),
        ("xyce", "rad", 1.0),
        ("spice", "rad", 1.0),
        ("ltspice", "deg", 360.0 / TAU),
    ] {
        let trace = run_as(dialect, deck);
        assert!((column(&trace, "vp(b)")[0] - exact * factor).abs() < 1e-9, "{dialect}");
        let current = (TAU / 4.0 + exact) * factor;
        assert!((column(&trace, "ip(c1)")[0] - current).abs() < 1e-9, "{dialect}");
        assert_eq!(trace.units[1], unit, "{dialect}");
    }
}

#[test]
fn parts_of_phasors_within_expressions() {
    let trace = run(
        "v1 a 0 ac 2\nr1 a b 1k\nc1 b 0 1u\n.param k=3\n.ac list 100 1k\n.print ac {k*vm(b)} {vr(b)*vr(b)+vi(b)*vi(b)} {db(v(b))-vdb(a,b)} par('im(c1)*1k') {vm(a)/vm(b)} {v(b)/v(a)} im(v(b)) {2*im(v(b))} re(v(b))",
    );
    for (k, f) in [100.0f64, 1e3].iter().enumerate() {
        let x = TAU * f * 1e-3;
        let size = 2.0 / (1.0 + x * x).sqrt();
        let close = |name: &str, exact: f64| {
            let ours = column(&trace, name)[k];
            assert!((ours - exact).abs() < 1e-9 * exact.abs(), "{name}: {ours} for {exact}");
        };
        close("{k*vm(b)}", 3.0 * size);
        close("{vr(b)*vr(b)+vi(b)*vi(b)}", size * size);
        close("{db(v(b))-vdb(a,b)}", -20.0 * x.log10());
        close("im(c1)*1k", x * size);
        close("{vm(a)/vm(b)}", (1.0 + x * x).sqrt());
        close("{v(b)/v(a)}.re", 1.0 / (1.0 + x * x));
        close("im(v(b))", -2.0 * x / (1.0 + x * x));
        close("{2*im(v(b))}", -4.0 * x / (1.0 + x * x));
        close("re(v(b))", 2.0 / (1.0 + x * x));
    }
    // A function of the deck's own keeps its meaning where outputs do not stand.
    let trace = run(".func vm(x) {7*x}\nv1 a 0 {vm(2)}\nr1 a 0 1\n.op\n.print op v(a)");
    assert_eq!(column(&trace, "v(a)"), [14.0]);
}

#[test]
fn a_capacitor_beside_a_source_carries_its_current() {
    // Over time the source is constant, so that the charge never moves; in phasors it does.
    let trace = run("v1 a 0 5 ac 2\nc1 a 0 3u\n.ac lin 3 10 1000\n.print ac i(v1) i(c1)");
    assert!(misfit(&trace, "i(c1)", |f| (0.0, TAU * f * 3e-6 * 2.0)) < 1e-9);
    assert!(misfit(&trace, "i(v1)", |f| (0.0, -TAU * f * 3e-6 * 2.0)) < 1e-9);
}

#[test]
fn coupled_inductors_and_a_line_in_ac() {
    let trace = run(
        "v1 a 0 0 ac 1\nl1 a 0 4m\nl2 b 0 1m\nk1 l1 l2 0.5\nr2 b 0 50\n.ac list 10 1k 100k\n.print ac v(b)",
    );
    // v2 = M/L1·v1 behind the leakage L2·(1 − k²).
    let exact = |f: f64| divide((0.25 * 50.0, 0.0), (50.0, TAU * f * 1e-3 * 0.75));
    assert!(misfit(&trace, "v(b)", exact) < 1e-9);
    let trace = run(
        "v1 in 0 0 ac 1\nr1 in a 50\nt1 a 0 b 0 z0=75 td=10n\nr2 b 0 20\n.ac lin 21 1meg 200meg\n.print ac v(b)",
    );
    // V(b) = E·Z·Zl / ((Zs·Zl + Z²)·j·sin θ + Z·(Zs + Zl)·cos θ)
    let exact = |f: f64| {
        let theta = TAU * f * 10e-9;
        let bottom = (75.0 * 70.0 * theta.cos(), (50.0 * 20.0 + 75.0 * 75.0) * theta.sin());
        divide((75.0 * 20.0, 0.0), bottom)
    };
    assert!(misfit(&trace, "v(b)", exact) < 1e-9);
}

#[test]
fn a_diode_is_linear_at_its_operating_point() {
    // The current source sets the current, so gd = I/(n·Vt) up to Is.
    let trace =
        run("i1 0 a 1m ac 1\nd1 a 0 dm\n.model dm d(is=1e-14)\n.ac list 1k\n.print ac v(a)");
    let vt = 1.380_649e-23 / 1.602_176_634e-19 * 300.15;
    let resistance = column(&trace, "v(a).re")[0];
    assert!((resistance / (vt / 1e-3) - 1.0).abs() < 1e-5, "{resistance}");
}

#[test]
fn transfer_functions_of_dividers_and_amplifiers() {
    let trace = run("v1 in 0 1\nr1 in out 1k\nr2 out 0 3k\n.tf v(out) v1");
    let row = |trace: &Trace| trace.columns.iter().map(|column| column[0]).collect::<Vec<_>>();
    for (ours, exact) in row(&trace).iter().zip([0.75, 4000.0, 750.0]) {
        assert!((ours / exact - 1.0).abs() < 1e-9, "{:?}", trace.columns);
    }
    // An inverting amplifier of gain A: −A·R2/(R2 + R1·(1 + A)).
    let trace = run("v1 in 0 0\nr1 in n 1k\nr2 n out 10k\ne1 out 0 0 n 1e4\n.tf v(out) v1");
    let gain = -1e4 * 10.0 / (10.0 + 1.0 + 1e4);
    assert!((row(&trace)[0] / gain - 1.0).abs() < 1e-9);
    let trace = run("i1 0 a 1m\nr1 a 0 2k\nr2 a b 1k\nv2 b 0 0\n.tf i(v2) i1");
    for (ours, exact) in row(&trace).iter().zip([2.0 / 3.0, 2000.0 / 3.0, 3000.0]) {
        assert!((ours / exact - 1.0).abs() < 1e-9, "{:?}", trace.columns);
    }
}

const DIODE: &str = "v1 a 0 0\nr1 a b 100\nd1 b 0 dm\n.model dm d(is=1e-14 n=1.5)";

#[test]
fn a_diode_over_its_voltage_obeys_kirchhoff() {
    let trace = run(&format!("{DIODE}\n.dc v1 -1 1 0.5\n.print dc v(b) i(v1)"));
    assert_eq!(trace.names, ["v1", "v(b)", "i(v1)"]);
    assert_eq!(column(&trace, "v1"), [-1.0, -0.5, 0.0, 0.5, 1.0]);
    for (v1, (vb, i)) in
        column(&trace, "v1").iter().zip(column(&trace, "v(b)").iter().zip(column(&trace, "i(v1)")))
    {
        // Kirchhoff's law, and with forward voltage the diode's own.
        assert!(((v1 - vb) / 100.0 + i).abs() < 1e-9 * i.abs() + 1e-15);
        let thermal = 1.5 * 1.380_649e-23 / 1.602_176_634e-19 * 300.15;
        if *v1 > 0.0 {
            let exact = 1e-14 * ((vb / thermal).exp() - 1.0);
            assert!((exact + i).abs() < 1e-4 * i.abs(), "{v1} {i} {exact}");
        }
    }
}

/// The rows of a table that ngspice prints, without their numbers.
fn table(said: &str, columns: usize) -> Vec<Vec<f64>> {
    let row = |line: &str| -> Option<Vec<f64>> {
        let words: Vec<&str> = line.split_whitespace().collect();
        words.first()?.parse::<u32>().ok()?;
        words[1..].iter().map(|word| word.parse().ok()).collect()
    };
    said.lines().filter_map(row).filter(|row| row.len() == columns).collect()
}

#[test]
fn sweeps_of_voltage_and_temperature_as_ngspice_has_them() {
    if !has_ngspice() {
        return;
    }
    // The temperature reaches resistors with coefficients and diodes. ngspice's constants differ in the seventh figure.
    let warm = format!("{DIODE}\nr2 c 0 1k tc1=2m tc2=5u\ni2 0 c 1m");
    for (deck, card, items) in [
        (DIODE, ".dc v1 -1 1 0.25", "v(b) i(v1)"),
        (&*warm, ".dc temp -20 100 30", "v(c) v(b) i(v1)"),
    ] {
        let deck = deck.replace("v1 a 0 0", "v1 a 0 1");
        let text =
            format!("{deck}\n{card}\n.options reltol=1e-8 abstol=1e-18 vntol=1e-12 gmin=1e-15");
        let trace = run(&format!("{text}\n.print dc {items}"));
        let said = ngspice(&text, &format!("run\nprint {items}"));
        let theirs = table(&said, trace.names.len());
        assert_eq!(theirs.len(), trace.rows(), "{said}");
        for (k, row) in theirs.iter().enumerate() {
            for (ours, theirs) in trace.columns.iter().map(|column| column[k]).zip(row) {
                let off = (ours - theirs).abs();
                assert!(off <= 1e-5 * theirs.abs() + 1e-12, "{card} row {k}: {ours} {theirs}");
            }
        }
    }
}

#[test]
fn the_temperature_reaches_devices_in_sweeps_and_steps() {
    let deck = "i1 0 a 1m\nr1 a 0 1k tc=1m,2u\nd1 b 0 dm\ni2 0 b 1m\n.model dm d(is=1e-14)";
    let swept = run(&format!("{deck}\n.dc temp -23 77 50\n.print dc v(a) v(b)"));
    let stepped = run(&format!("{deck}\n.op\n.step temp -23 77 50\n.print op v(a) v(b)"));
    for (k, t) in [-23.0f64, 27.0, 77.0].iter().enumerate() {
        let d = t - 27.0;
        let exact = 1.0 + 1e-3 * d + 2e-6 * d * d;
        assert!((column(&swept, "v(a)")[k] - exact).abs() < 1e-9, "{t}");
        assert!((column(&stepped, "v(a)")[k] - exact).abs() < 1e-9, "{t}");
        let diodes = [&swept, &stepped].map(|trace| column(trace, "v(b)")[k]);
        // About -2 mV/K.
        let slope = (diodes[0] - column(&swept, "v(b)")[1]) / d;
        assert!(d == 0.0 || (-2.5e-3..-1.0e-3).contains(&slope), "{t} {slope}");
        assert!((diodes[0] - diodes[1]).abs() < 1e-9, "{diodes:?}");
    }
}

#[test]
fn an_error_in_a_sweep_says_where_it_was() {
    let said = |deck: &str| {
        let text = format!("title\n{deck}\n.end\n");
        let found = run_text("deck.cir", &text, &Overrides::default()).expect_err(deck);
        found.iter().map(|d| format!("{} {:?}", d.message, d.notes)).collect::<String>()
    };
    // Values for which a device makes no sense, in a sweep and in a step; one for which there is no operating point.
    let deck = "v1 a 0 1\nr1 a b 1k\nc1 b 0 1u\nt1 b 0 c 0 z0={z} td=1n\nr2 c 0 50\n.param z=50";
    let dc = said(&format!("{deck}\n.dc z list 50 75 -1"));
    assert!(dc.contains("at z = -1e0"), "{dc}");
    let step = said(&format!("{deck}\n.op\n.step param z list 50 75 -1"));
    assert!(step.contains("in step 2: z = -1e0"), "{step}");
    let table = said(&format!("{deck}\n.data t z v1\n+ 50 1\n+ -1 2\n.enddata\n.dc data=t"));
    assert!(table.contains("at z = -1e0, v1 = 2e0"), "{table}");
}

#[test]
fn sweeps_nest_and_set_parameters_devices_and_tables() {
    let divider = "v1 a 0 1\nr1 a b {r}\nr2 b 0 1k\n.param r=1k\n.print dc v(b) r1:r {r}";
    let trace = run(&format!("{divider}\n.dc v1 1 2 1 r 1k 3k 2k"));
    assert_eq!(column(&trace, "v1"), [1.0, 2.0, 1.0, 2.0]);
    assert_eq!(column(&trace, "r1:r"), [1e3, 1e3, 3e3, 3e3]);
    for (v, exact) in column(&trace, "v(b)").iter().zip([0.5, 1.0, 0.25, 0.5]) {
        assert!((v - exact).abs() < 1e-12);
    }
    let trace = run(&format!("{divider}\n.dc r2 list 1k 3k"));
    assert!((column(&trace, "v(b)")[1] - 0.75).abs() < 1e-12);
    let trace =
        run(&format!("{divider}\n.data points r v1\n+ 1k 4\n+ 3k 8\n.enddata\n.dc data=points"));
    assert!((column(&trace, "v(b)")[1] - 2.0).abs() < 1e-12, "{trace:?}");
    let trace = run(&format!("{divider}\n.dc dec v1 1 100 1"));
    assert_eq!(column(&trace, "v1"), [1.0, 10.0, 100.0]);
}

#[test]
fn steps_are_separate_runs_bit_for_bit() {
    let deck = |r: &str, step: &str| {
        format!(
            "v1 a 0 sin(0 1 1k)\nr1 a b {r}\nc1 b 0 1u\nd1 b 0 dm\n.model dm d(is=1e-14)\n.tran 10u 2m\n.print tran v(b)\n{step}"
        )
    };
    let stepped = run(&deck("{r}", ".param r=1\n.step param r list 100 330 1k"));
    assert_eq!(stepped.names, ["step", "time", "v(b)"]);
    let mut from = 0;
    for (k, r) in ["100", "330", "1k"].iter().enumerate() {
        let alone = run(&deck(r, ""));
        let to = from + alone.rows();
        assert!(column(&stepped, "step")[from..to].iter().all(|step| *step == k as f64));
        assert_eq!(&column(&stepped, "time")[from..to], column(&alone, "time"));
        assert_eq!(&column(&stepped, "v(b)")[from..to], column(&alone, "v(b)"));
        from = to;
    }
    assert_eq!(from, stepped.rows());
    // The first of two runs fastest.
    let nested = run(
        "v1 a 0 {x*10+y}\nr1 a 0 1\n.param x=0 y=0\n.op\n.step x 1 2 1\n.step y 1 2 1\n.print op v(a)",
    );
    assert_eq!(column(&nested, "v(a)"), [11.0, 21.0, 12.0, 22.0]);
}

#[test]
fn an_analysis_is_picked_by_its_name() {
    let text = "t\nv1 a 0 1 ac 1\nr1 a b 1k\nc1 b 0 1u\n.dc v1 1 2 1\n.ac list 1k\n.op\n.end\n";
    for (pick, first, rows) in [("dc", "v1", 2), ("ac", "frequency", 1), ("op", "v(a)", 1)] {
        let mut map = SourceMap::default();
        let file = map.add("deck.cir", text);
        let mut d = vec![];
        let run = prepare(&mut map, file, &Overrides::default(), Some(pick), &mut d).unwrap();
        let mut trace = run.trace();
        run.go(&mut trace).unwrap();
        assert_eq!((trace.names[0].as_str(), trace.rows()), (first, rows), "{d:?}");
    }
}

#[test]
fn what_makes_no_sense_is_said() {
    for (card, code) in [
        (".dc v1 0 1 1p", "E0789"),
        (".dc nosuch 0 1 1", "E0784"),
        (".dc v1 0 1 -1", "E0782"),
        (".ac oct 3 0 10", "E0782"),
        (".ac 10 1 100", "E0703"),
        (".tf v(a) r1", "E0786"),
        (".dc v1 0", "E0703"),
        (".op\n.step r1 1 2 1p", "E0789"),
        (".noise v(a) v1 dec 1 1 10", "E0702"),
    ] {
        assert!(errors(&format!("v1 a 0 1\nr1 a 0 1k\n{card}")).contains(&code), "{card}");
    }
}

#[test]
fn phases_are_in_degrees_or_radians_as_the_deck_says() {
    let deck = "v1 in 0 0 ac 1\nr1 in out 1k\nc1 out 0 1u\n.ac list 159.15494309189535\n.print ac vp(out)\n";
    let phase = |text: &str, dialect: &str| {
        let (mut map, overrides) = (SourceMap::default(), Overrides::default());
        let text = format!("*bondspice dialect={dialect}\n{deck}{text}");
        let file = map.add("deck.cir", format!("t\n{text}.end\n"));
        let mut d = vec![];
        let run = prepare(&mut map, file, &overrides, None, &mut d).unwrap();
        let mut trace = run.trace();
        run.go(&mut trace).unwrap();
        column(&trace, "vp(out)")[0]
    };
    let quarter = std::f64::consts::FRAC_PI_4;
    for (text, dialect, expected) in [
        ("", "xyce", -quarter),
        (".options output phase_output_radians=false\n", "xyce", -45.0),
        (".options output phase_output_radians=1\n", "xyce", -quarter),
        ("", "ltspice", -45.0),
    ] {
        let phase = phase(text, dialect);
        assert!((phase - expected).abs() < 1e-9, "{text} {phase}");
    }
}

#[test]
fn several_instances_equal_as_many_written_out() {
    // Every kind of device within, with currents that others read, terminals that lead on, and instances within.
    let part = ".subckt inner p q
r1 p q 3k
c1 q 0 0.3u ic=0.2
.ends
.subckt part a b
v1 a c 0.1
r1 c d 100
l1 d e 1m
l2 f 0 4m
k1 l1 l2 0.6
r2 f 0 50
d1 e b dm
c1 e 0 1u
f1 0 g v1 2
r3 g 0 1k
h1 h 0 v1 100
b1 b 0 i=0.1m*v(h)*v(h)+0.01*i(l1)
r4 h 0 1k
x1 e b inner m=2
.ends
.model dm d(is=1e-12)
v1 in 0 sin(0 3 1k)
rb out 0 500
";
    let written = "x1 in out part\nx2 in out part\nx3 in out part\n";
    let last = ".options reltol=1e-7\n.tran 20u 1m uic\n.print tran i(v1) v(out) v(x1.e) v(x1.g) i(x1.l1) v(x1.x1.q)\n";
    let one = run(&format!("{part}{written}{last}"));
    let several = run(&format!("{part}x1 in out part m=3\n{last}"));
    let found = bondspice::trace::compare::compare(&several, &one, &Default::default());
    assert!(found.missing.is_empty() && found.signals.len() == 6, "{found:?}");
    // Each run takes steps of its own, whose errors of 1e-7 add up.
    for signal in &found.signals {
        assert!(signal.max < 4e-6 * signal.range, "{signal:?}");
    }
    // Not a whole number of instances: a conductance.
    let trace = run(
        ".subckt part a\nr1 a 0 1k\n.ends\nv1 a 0 1\nx1 a part m={k/2}\n.param k=3\n.op\n.print op i(v1)\n",
    );
    assert!((column(&trace, "i(v1)")[0] + 1.5e-3).abs() < 1e-15);
}
