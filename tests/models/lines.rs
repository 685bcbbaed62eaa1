//! Lossless transmission lines in decks (T cards), against closed forms: waves that arrive and come back.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::trace::Trace;

#[track_caller]
fn run(text: &str) -> Trace {
    let run = run_text("line.cir", text, &Overrides::default());
    run.unwrap_or_else(|d| panic!("{d:#?}\n{text}")).0
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
