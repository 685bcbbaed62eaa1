//! Lossless transmission lines in decks (T cards), against closed forms: waves that arrive and come back. Lines of many
//! sections, and storages that are tied to each other in large numbers.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::trace::Trace;

#[track_caller]
fn run(text: &str) -> Trace {
    let run = run_text("line.cir", text, &Overrides::default());
    run.unwrap_or_else(|d| panic!("{d:#?}\n{text}")).0
}

#[track_caller]
fn on_a_grid(text: &str, step: &str) -> Trace {
    let grid = Overrides { step: Some(step.to_string()), ..Overrides::default() };
    run_text("line.cir", text, &grid).unwrap_or_else(|d| panic!("{d:#?}")).0
}

fn column<'a>(trace: &'a Trace, name: &str) -> &'a [f64] {
    trace.column(name).unwrap_or_else(|| panic!("no {name} in {:?}", trace.names))
}

/// Both ends of a line of 50 ohm and 1 ns that a source behind `source` ohm drives from 0 to 2 V at 0.5 ns, ended by
/// `load` ohm: the bounce diagram (C. W. Davidson, Transmission Lines for Communications, 1989, ch. 2).
fn bounces(source: f64, load: f64, t: f64) -> (f64, f64) {
    let (z, delay, start) = (50.0, 1e-9, 0.5e-9);
    let (at_source, at_load) = match load.is_infinite() {
        true => ((source - z) / (source + z), 1.0),
        false => ((source - z) / (source + z), (load - z) / (load + z)),
    };
    let (mut near, mut far) = (0.0, 0.0);
    let (mut wave, mut leaves) = (2.0 * z / (z + source), start);
    if t >= start {
        near += wave;
    }
    while leaves <= t {
        if t >= leaves + delay {
            far += wave * (1.0 + at_load);
        }
        wave *= at_load;
        if t >= leaves + 2.0 * delay {
            near += wave * (1.0 + at_source);
        }
        wave *= at_source;
        leaves += 2.0 * delay;
    }
    (near, far)
}

#[test]
fn steps_are_reflected_at_open_shorted_and_matched_ends() {
    // Open, shorted through next to nothing, matched, and in between; from behind other resistances than the line's too.
    for (source, load) in
        [(50.0, 1e12), (50.0, 1e-9), (50.0, 50.0), (10.0, 150.0), (150.0, 1e12), (25.0, 1e-9)]
    {
        // Two equal times make a jump; F and NL say the same delay as TD: 0.25/250 MHz.
        for delay in ["td=1n", "f=250meg nl=0.25", "f=250meg"] {
            let text = format!(
                "a step onto a line\nV1 s 0 PWL(0 0 0.5n 0 0.5n 2)\nR1 s in {source}\nT1 in 0 out 0 z0=50 {delay}\n\
                 R2 out 0 {load}\n.options reltol=1e-6\n.print tran v(in) v(out) i(v1)\n.tran 0.02n 9.99n\n.end\n"
            );
            let trace = run(&text);
            let (near, far) = (column(&trace, "v(in)"), column(&trace, "v(out)"));
            let mut seen = 0;
            for (row, t) in trace.time().iter().enumerate() {
                // Rows on both sides of a wave's arrival stand there.
                let after = (t - 0.5e-9) / 1e-9;
                if (after - after.round()).abs() < 1e-6 {
                    continue;
                }
                seen += 1;
                let exact = bounces(source, if load > 1e9 { f64::INFINITY } else { load }, *t);
                assert!(
                    (near[row] - exact.0).abs() <= 2e-6,
                    "{source} {load} {delay}: in at {t}: {} {}",
                    near[row],
                    exact.0
                );
                assert!(
                    (far[row] - exact.1).abs() <= 2e-6,
                    "{source} {load} {delay}: out at {t}: {} {}",
                    far[row],
                    exact.1
                );
                let drive = if *t < 0.5e-9 { 0.0 } else { 2.0 };
                let current = -(drive - exact.0) / source;
                assert!((column(&trace, "i(v1)")[row] - current).abs() <= 2e-6 / source, "{t}");
            }
            assert!(seen >= 10, "{seen}");
        }
    }
}

#[test]
fn at_rest_a_line_is_a_wire() {
    let text =
        "a line at rest\nV1 s 0 3\nR1 s in 10\nT1 in 0 out 0 z0=75 td=2n\nR2 out 0 20\n.op\n.end\n";
    let trace = run(text);
    for (name, value) in [("v(in)", 2.0), ("v(out)", 2.0), ("i(v1)", -0.1)] {
        assert!(
            (column(&trace, name)[0] - value).abs() < 1e-9,
            "{name}: {:?}",
            column(&trace, name)
        );
    }
}

#[test]
fn a_line_from_its_operating_point_stays_there() {
    let text = "a line at rest goes on\nV1 s 0 3\nR1 s in 10\nT1 in 0 out 0 z0=75 td=2n\nR2 out 0 20\n\
                .print tran v(in) v(out)\n.tran 0.1n 20n\n.end\n";
    let trace = run(text);
    for name in ["v(in)", "v(out)"] {
        assert!(column(&trace, name).iter().all(|v| (v - 2.0).abs() < 1e-9), "{name}");
    }
}

#[test]
fn a_swinging_source_sees_the_lines_input_impedance() {
    // A line of a quarter of the wave turns 100 ohm into 50²/100 = 25: after some bounces, 1 V behind 50 ohm leaves 1/3 V
    // at the input, in phase.
    let text = "a quarter of a wave\nV1 s 0 SIN(0 1 250meg)\nR1 s in 50\nT1 in 0 out 0 z0=50 f=250meg nl=0.25\nR2 out 0 100\n\
                .options reltol=1e-6\n.print tran v(in) v(out)\n.tran 0.05n 20n\n.end\n";
    let trace = run(text);
    let w = std::f64::consts::TAU * 250e6;
    for (row, t) in trace.time().iter().enumerate().filter(|(_, t)| **t > 2.0e-9) {
        let (sin, cos) = (w * t).sin_cos();
        // Matched at the source: the first echo is the last.
        let near = column(&trace, "v(in)")[row];
        let far = column(&trace, "v(out)")[row];
        assert!((near - sin / 3.0).abs() < 1e-5, "in at {t}: {near} for {}", sin / 3.0);
        assert!((far + cos * 2.0 / 3.0).abs() < 1e-5, "out at {t}: {far} for {}", -cos * 2.0 / 3.0);
    }
}

/// Two lines of sections R, L and C, coupled by M and by a capacitor between them in each section, which closes a loop of
/// three: none of these has an initial value of its own. Their even and odd modes are two lines that know nothing of each
/// other, with (1 + k)·L and C, and with (1 − k)·L and C + 2·Cm.
#[test]
fn two_hundred_coupled_sections_are_their_two_modes() {
    let n = 200;
    let ladder = |name: &str, l: f64, c: f64| -> String {
        let section = |k: usize| {
            let [from, to] = [k, k + 1].map(|k| format!("{name}{k}"));
            format!(
                "R{name}{k} {from} x{to} 0.1\nL{name}{k} x{to} {to} {l:e}\nC{name}{k} {to} 0 {c:e}\n"
            )
        };
        let sections: String = (0..n).map(section).collect();
        format!("{sections}Rend{name} {name}{n} 0 70\n")
    };
    let coupled: String =
        (0..n).map(|k| format!("Kab{k} La{k} Lb{k} 0.4\nCm{k} a{0} b{0} 0.5p\n", k + 1)).collect();
    let step = "PWL(0 0 50p 1)";
    let tail = ".options reltol=1e-7\n.tran 10p 3n\n.end\n";
    let deck = format!(
        "coupled lines\nVa ina 0 {step}\nRa ina a0 50\nRb b0 0 50\n{}{}{coupled}.save v(a40) v(b40)\n{tail}",
        ladder("a", 1e-9, 1e-12),
        ladder("b", 1e-9, 1e-12),
    );
    let modes = format!(
        "modes\nVe ine 0 {step}\nRe ine e0 50\nRo ine o0 50\n{}{}.save v(e40) v(o40)\n{tail}",
        ladder("e", 1.4e-9, 1e-12),
        ladder("o", 0.6e-9, 2e-12),
    );
    let (lines, modes) = (on_a_grid(&deck, "0.1n"), on_a_grid(&modes, "0.1n"));
    let (even, odd) = (column(&modes, "v(e40)"), column(&modes, "v(o40)"));
    let (a, b) = (column(&lines, "v(a40)"), column(&lines, "v(b40)"));
    assert!(even.iter().fold(0.0f64, |most, v| most.max(v.abs())) > 0.1);
    for k in 0..even.len() {
        // Both runs keep 1e-7 in each of some thousand steps.
        assert!((a[k] - 0.5 * (even[k] + odd[k])).abs() < 1e-5, "{} at row {k}", a[k]);
        assert!((b[k] - 0.5 * (even[k] - odd[k])).abs() < 1e-5, "{} at row {k}", b[k]);
    }
}

/// 20,000 capacitors side by side, of seven sizes, are one.
#[test]
fn twenty_thousand_parallel_capacitors_are_one() {
    let n = 20_000;
    let sizes = (0..n).map(|k| 1e-12 * (1.0 + (k % 7) as f64));
    let cards: String =
        sizes.clone().enumerate().map(|(k, c)| format!("C{k} a 0 {c:e}\n")).collect();
    let deck = format!(
        "side by side\nV1 in 0 1\nR1 in a 1k\n{cards}.save v(a) i(C3)\n.options reltol=1e-5\n.tran 1u 100u uic\n.end\n"
    );
    let total: f64 = sizes.sum();
    let trace = on_a_grid(&deck, "10u");
    let (v, i) = (column(&trace, "v(a)"), column(&trace, "i(c3)"));
    let tau = 1e3 * total;
    for (k, t) in trace.time().iter().enumerate() {
        let left = (-t / tau).exp();
        assert!((v[k] - (1.0 - left)).abs() < 1e-4, "{} at {t}", v[k]);
        // The fourth capacitor takes its part of the current.
        assert!(
            (i[k] - 4e-12 / total * 1e-3 * left).abs() < 1e-4 * 4e-12 / total * 1e-3,
            "{} at {t}",
            i[k]
        );
    }
}
