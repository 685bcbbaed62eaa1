//! Causal paths, loops and Mason's rule; gains of regulators, measured in runs.
//!
//! Mason's rule gives the transfer function of the elimination exactly, as polynomials, and to 1e-9 in numbers where there
//! are too many loops for that. Bandwidth and margin of the designed loops are measured on runs of the circuit with a small
//! sine on the reference: the open loop's gain within 5 % of 1 at the bandwidth, its margin within 3 degrees of what was
//! asked for (the design leaves friction and the line's loss out, and the runs do not).

use bondspice::analysis::paths::{flow, mason, sink, source};
use bondspice::analysis::symbolic::transfer::transfer;
use bondspice::cli::flags::{DeckFlags, ModelFlags};
use bondspice::cli::linear::{Linearised, PointFlags, linearise_named};
use bondspice::cli::session::{Global, Session};
use bondspice::linear::{Complex, Field};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn file(model: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(model)
}

fn named(model: &str, from: &str, to: &str) -> Linearised {
    let file = file(model).to_str().unwrap().to_string();
    let flags = PointFlags {
        file,
        model: ModelFlags::default(),
        deck: DeckFlags::default(),
        at: "start".into(),
    };
    let mut session = Session::new(Global { quiet: true, ..Global::default() });
    let found = linearise_named(&flags, Some(from), Some(to), &mut session);
    found.unwrap_or_else(|exit| panic!("{model}: {exit:?} {:?}", session.said))
}

#[test]
fn masons_rule_is_the_elimination() {
    for (model, from, to) in [
        ("rlc.bg", "e(U)", "f(mesh)"),
        ("msd.bg", "e(F)", "f(m)"),
        ("gear_dep.bg", "e(T)", "f(s2)"),
        ("dc_motor_load.bg", "e(V)", "f(load)"),
        ("eha_fig13.bg", "f(feed)", "f(surface)"),
        ("eha_fig13.bg", "Ucvs", "f(surface)"),
    ] {
        let found = named(model, from, to);
        let wanted = transfer(&found.graph, &found.linear, 0).unwrap();
        let flow = flow(&found.graph, &found.linear).unwrap();
        let pair = |way: bondspice::analysis::paths::Way| (way.clone(), way.gain);
        let ways = flow.paths(source(&found.linear), sink(&found.linear)).unwrap();
        let paths: Vec<_> = ways.into_iter().map(pair).collect();
        let loops: Vec<_> = flow.loops().unwrap().into_iter().map(pair).collect();
        assert!(!paths.is_empty() && !loops.is_empty(), "{model}");
        let [top, bottom] = mason(&paths, &loops).unwrap();
        // top/bottom = N/D over the same symbols: those of the flow by their names.
        let place = |k: usize| {
            let name = &flow.symbols[k].name;
            wanted.symbols.iter().position(|symbol| symbol.name == *name)
        };
        let mut values = vec![0.0; flow.symbols.len()];
        for round in 0..8 {
            let mut own = wanted.values();
            for (k, value) in values.iter_mut().enumerate().skip(1) {
                *value = flow.symbols[k].value * (1.0 + 0.1 * ((k * 7 + round * 3) % 5) as f64);
                if let Some(place) = place(k) {
                    own[place] = *value;
                }
            }
            let at = Complex::new(-3.0 + round as f64, 2.0 + 40.0 * round as f64);
            let mine = top.value(at, &values) / bottom.value(at, &values);
            let (theirs, _) = wanted.value(at, &own);
            let off = mine - theirs;
            assert!(
                off.re.hypot(off.im) <= 1e-9 * theirs.re.hypot(theirs.im),
                "{model} {from} {to}: {mine:?} {theirs:?}"
            );
        }
        // And exactly, where the symbols stand in one order.
        let same = (0..flow.symbols.len()).all(|k| place(k) == Some(k));
        if same {
            let left = top.top.times(&bottom.bottom).unwrap().times(&wanted.denominator).unwrap();
            let right = top.bottom.times(&bottom.top).unwrap().times(&wanted.numerator).unwrap();
            assert_eq!(left, right, "{model}");
        }
    }
}

#[test]
fn masons_rule_holds_for_the_actuator_in_numbers() {
    let found = named("eha_one_line.bg", "e(chopper.2)", "f(surface)");
    let flow = flow(&found.graph, &found.linear).unwrap();
    let values: Vec<f64> = flow.symbols.iter().map(|symbol| symbol.value).collect();
    let ways = flow.paths(source(&found.linear), sink(&found.linear)).unwrap();
    let loops = flow.loops().unwrap();
    let wanted = transfer(&found.graph, &found.linear, 0).unwrap();
    for at in [Complex::new(-1.0, 3.0), Complex::new(5.0, 200.0)] {
        let pair =
            |way: &bondspice::analysis::paths::Way| (way.clone(), way.gain.value(at, &values));
        let paths: Vec<_> = ways.iter().map(pair).collect();
        let loops: Vec<_> = loops.iter().map(pair).collect();
        let [top, bottom] = mason(&paths, &loops).unwrap();
        let (theirs, _) = wanted.value(at, &wanted.values());
        let off = top / bottom - theirs;
        assert!(
            off.re.hypot(off.im) <= 1e-9 * theirs.re.hypot(theirs.im),
            "{:?} {theirs:?}",
            top / bottom
        );
    }
}

fn run(command: &str, file: &Path, flags: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_bondspice")).arg(command).arg(file).args(flags).output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command} {flags:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn columns(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_resonance_is_told_with_what_damps_it() {
    let text = run("paths", &file("rlc.bg"), &["--format", "json"]);
    let found: Value = serde_json::from_str(&text).unwrap();
    let [one] = &found["resonances"].as_array().unwrap()[..] else { panic!("{text}") };
    // 1/(2π√LC), R/2·√(C/L)
    let frequency = 1.0 / (std::f64::consts::TAU * (1e-3f64 * 100e-6).sqrt());
    assert!((one["frequency"].as_f64().unwrap() / frequency - 1.0).abs() < 1e-9);
    assert!((one["damping"].as_f64().unwrap() / (0.1f64).sqrt() - 1.0).abs() < 1e-9);
    assert_eq!(one["damped_by"][0], "R");
    let gains: Vec<&str> =
        found["loops"].as_array().unwrap().iter().map(|l| l["gain"].as_str().unwrap()).collect();
    assert_eq!(gains, ["-R/(L*s)", "-1/(C*L*s^2)"]);
}

/// Re and Im of a column's part at a frequency, over whole periods of evenly spaced rows.
fn part(rows: &[Vec<f64>], column: usize, omega: f64) -> Complex {
    rows.iter().fold(Complex::ZERO, |sum, row| {
        let angle = omega * row[0];
        sum + Complex::new(row[column] * angle.cos(), -row[column] * angle.sin())
    })
}

#[test]
fn designed_gains_hold_in_runs() {
    let model = file("eha_one_line.bg");
    let text = run("tune", &model, &["--format", "json"]);
    let design: Value = serde_json::from_str(&text).unwrap();
    let flags: Vec<&str> = design["flags"].as_str().unwrap().split(' ').collect();
    assert_eq!(flags.len(), 8);
    // The whole actuator with these gains follows, and comes to rest where it shall.
    let step = [
        "--drive",
        "x_ref = step(0.1 s, 0 mm, 20 mm)",
        "--drive",
        "M_FC = 0 N*m",
        "--until",
        "1.2s",
        "--step",
        "1ms",
    ];
    let rows = columns(&run(
        "simulate",
        &model,
        &[&flags[..], &step, &["--observe", "x in mm, f(armature)"]].concat(),
    ));
    let last = rows.last().unwrap();
    assert!((last[1] - 20.0).abs() < 0.05, "{last:?}");
    assert!(rows.iter().all(|row| row[1] < 21.0 && row[2].abs() <= 100.0));
    // The open loops, measured with a sine on the reference while the motor turns.
    let source = std::fs::read_to_string(&model).unwrap();
    let cut = |line: &str, input: &str| -> String {
        let lines =
            source.lines().filter(|own| !own.starts_with("drive") && !own.starts_with("loop"));
        lines.map(|own| if own.starts_with(line) { input.to_string() } else { own.to_string() } + "\n").collect()
    };
    let folder = tempfile::tempdir().unwrap();
    let measured = |text: &str, drive: &str, omega: f64, reference: &str, controlled: &str| {
        let path = folder.path().join("cut.bg");
        std::fs::write(&path, text).unwrap();
        let period = std::f64::consts::TAU / omega;
        let (until, step) = (format!("{:e}s", 40.0 * period), format!("{:e}s", period / 64.0));
        let observe = format!("{reference}, {controlled}");
        let more = [
            "--drive",
            drive,
            "--drive",
            "M_FC = 0 N*m",
            "--drive",
            "x_ref = 0 mm",
            "--until",
            &until,
            "--step",
            &step,
            "--observe",
            &observe,
            "--option",
            "reltol=1e-7",
        ];
        let rows = columns(&run("simulate", &path, &[&flags[..], &more].concat()));
        // The last eight periods.
        let rows = &rows[rows.len() - 8 * 64 - 1..rows.len() - 1];
        let (r, y) = (part(rows, 1, omega), part(rows, 2, omega));
        let open = y / (r - y);
        (open.re.hypot(open.im), 180.0 + open.im.atan2(open.re).to_degrees())
    };
    let wanted = |k: usize, key: &str| design["loops"][k][key].as_f64().unwrap();
    let current = measured(
        &cut("signal I_ref", "input I_ref"),
        "I_ref = 3 A + sine(0 A, 0.3 A, 318.3098861837907 Hz)",
        2000.0,
        "I_ref",
        "f(armature)",
    );
    assert!((current.0 - 1.0).abs() < 0.05, "{current:?}");
    assert!((current.1 - wanted(0, "margin_wanted")).abs() < 3.0, "{current:?}");
    let speed = measured(
        &cut("signal Omega_ref", "input Omega_ref"),
        "Omega_ref = 60 rad/s + sine(0 rad/s, 3 rad/s, 31.83098861837907 Hz)",
        200.0,
        "Omega_ref",
        "f(shaft)",
    );
    println!("measured: current {current:?}, speed {speed:?}");
    assert!((speed.0 - 1.0).abs() < 0.05, "{speed:?}");
    assert!((speed.1 - wanted(1, "margin_wanted")).abs() < 3.0, "{speed:?}");
}
