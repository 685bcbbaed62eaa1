//! Linear analysis against closed forms, the actuator's reference and python-control.
//!
//! Tolerances: 1e-8 of the value against closed forms and python-control; half a unit of the last printed digit against the
//! reference's table of the actuator's poles.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// What the program prints for a model's text, or for a file where the text is its name.
fn bondspice(command: &str, model: &str, flags: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = match model.ends_with(".bg") {
        true => root().join(model),
        false => {
            let file = folder.path().join("model.bg");
            std::fs::write(&file, model).unwrap();
            file
        }
    };
    let output =
        Command::new(env!("CARGO_BIN_EXE_bondspice")).arg(command).arg(file).args(flags).output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command} {flags:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(command: &str, model: &str, flags: &[&str]) -> Value {
    let text = bondspice(command, model, &[flags, &["--format", "json"]].concat());
    let value: Value = serde_json::from_str(&text).unwrap();
    assert!(command == "bode" || value["schema"] == 1);
    value
}

fn roots(value: &Value) -> Vec<(f64, f64)> {
    let of = |root: &Value| (root["re"].as_f64().unwrap(), root["im"].as_f64().unwrap());
    let all = value.as_array().unwrap().iter();
    all.flat_map(|root| vec![of(root); root["multiplicity"].as_u64().unwrap() as usize]).collect()
}

fn close(found: &[(f64, f64)], wanted: &[(f64, f64)], part: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?} {wanted:?}");
    for (re, im) in wanted {
        let off = |(x, y): &(f64, f64)| (re - x).hypot(im - y);
        let least = found.iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(least <= part * re.hypot(*im), "{re} {im} is missing: {found:?}");
    }
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() <= 1e-8 * wanted.abs(), "{found} {wanted}");
}

const RLC: &str =
    "Se:U(10 V) -> 1:mesh\nmesh -> I:L(2 mH), R:R(3 Ohm), C:C(100 uF)\nobserve f(mesh)";

#[test]
fn a_series_circuit() {
    let (l, r, c): (f64, f64, f64) = (2e-3, 3.0, 100e-6);
    let space = json("linearize", RLC, &[]);
    // x = (p, q): p' = u − R·p/L − q/C, q' = p/L, f = p/L.
    let a = [[-r / l, -1.0 / c], [1.0 / l, 0.0]];
    for (row, wanted) in matrix(&space["A"]).iter().zip(a) {
        row.iter().zip(wanted).for_each(|(found, wanted)| near(*found, wanted));
    }
    assert_eq!(matrix(&space["B"]), [[1.0], [0.0]]);
    near(matrix(&space["C"])[0][0], 1.0 / l);
    assert_eq!(space["states"][0]["name"], "p(L)");
    assert_eq!(space["states"][1]["unit"], "C");
    assert_eq!(space["inputs"][0]["name"], "e(U)");
    let poles = json("poles", RLC, &["--from", "e(U)", "--to", "f(mesh)"]);
    let (half, w) = (r / (2.0 * l), (1.0 / (l * c) - (r / (2.0 * l)).powi(2)).sqrt());
    close(&roots(&poles["poles"]), &[(-half, w), (-half, -w)], 1e-8);
    close(&roots(&poles["zeros"]), &[(0.0, 0.0)], 1e-8);
    let pole = &poles["poles"][0];
    near(pole["frequency"].as_f64().unwrap(), (1.0 / (l * c)).sqrt() / std::f64::consts::TAU);
    near(pole["damping"].as_f64().unwrap(), half * (l * c).sqrt());
    near(pole["time_constant"].as_f64().unwrap(), 1.0 / half);
    // Parts of p: (s·L)/(2·s·L + R) at the pole, of q the same turned round.
    let (top, bottom) = ((-half * l).hypot(w * l), 2.0 * w * l);
    for part in pole["parts"].as_array().unwrap() {
        near(part["part"].as_f64().unwrap(), top / bottom);
    }
}

#[test]
fn a_motor_and_its_two_inputs() {
    let (l, r, k, j, b): (f64, f64, f64, f64, f64) = (1.7e-3, 0.46, 0.23, 1.3e-3, 3e-3);
    let text = "Se:U(u) -> 1:armature -> GY:motor(0.23 V*s) -> 1:shaft
armature -> I:L(1.7 mH), R:R(0.46 Ohm)
shaft -> I:J(1.3e-3 kg*m^2), R:b(3e-3 N*m*s)
Se:load(T) -> shaft
input u
input T
observe f(shaft), f(armature)";
    // (L·s + R)·I + K·Ω = u, (J·s + b)·Ω = K·I + T
    let (p, q) = (l * b + r * j, r * b + k * k);
    let wide = (p * p - 4.0 * l * j * q) / (4.0 * l * l * j * j);
    let (middle, off) = (-p / (2.0 * l * j), wide.abs().sqrt());
    let poles = json("poles", text, &["--from", "T", "--to", "f(shaft)"]);
    assert!(wide < 0.0);
    close(&roots(&poles["poles"]), &[(middle, off), (middle, -off)], 1e-8);
    close(&roots(&poles["zeros"]), &[(-r / l, 0.0)], 1e-8);
    let space = json("linearize", text, &["--from", "u, T", "--to", "f(shaft) in rpm"]);
    assert_eq!(space["inputs"].as_array().unwrap().len(), 2);
    near(matrix(&space["C"])[0][1], 60.0 / std::f64::consts::TAU / j);
    // Imposing the current leaves the shaft alone.
    let shaft = json("poles", text, &["--from", "f(armature)", "--to", "f(shaft)"]);
    let shaft = roots(&shaft["poles"]);
    assert!(
        shaft.iter().any(|(re, im)| (re + b / j).abs() < 1e-8 * b / j && *im == 0.0),
        "{shaft:?}"
    );
}

#[test]
fn two_masses_and_a_gear() {
    // A force on one of two masses with a spring between: poles 0, 0, ±i√(k(1/m + 1/M)), zeros ±i√(k/M).
    let (m, big, k): (f64, f64, f64) = (2.0, 5.0, 1e4);
    let text = "Se:F(u) -> 1:a -> 0:spring -> 1:b
a -> I:m(2 kg)\nb -> I:M(5 kg)\nspring -> C:k(1e-4 m/N)\ninput u\nobserve f(a)";
    let found = json("poles", text, &["--from", "u", "--to", "f(a)"]);
    let (fast, slow) = ((k * (1.0 / m + 1.0 / big)).sqrt(), (k / big).sqrt());
    close(&roots(&found["poles"]), &[(0.0, fast), (0.0, -fast), (0.0, 0.0)], 1e-8);
    close(&roots(&found["zeros"]), &[(0.0, slow), (0.0, -slow)], 1e-8);
    // Two inertias geared together are one state: J1 + J2/r².
    let text = "Se:T(3 N*m) -> 1:a -> TF:gear(4) -> 1:b
a -> I:J1(2 kg*m^2)\nb -> I:J2(8 kg*m^2), R:bearing(0.5 N*m*s)\nobserve f(b)";
    let space = json("linearize", text, &[]);
    assert_eq!(space["states"].as_array().unwrap().len(), 1);
    assert_eq!(space["form"], "state-space");
    // e_a = 4·e_b, f_b = 4·f_a: seen from a, J2 and b count 16 times.
    near(matrix(&space["A"])[0][0], -16.0 * 0.5 / (2.0 + 16.0 * 8.0));
    let [own] = &space["dependent"].as_array().unwrap()[..] else { panic!("{space}") };
    let of = own["of"].as_object().unwrap().values().next().unwrap().as_f64().unwrap();
    let wanted = if own["name"] == "p(J2)" { 8.0 * 4.0 / 2.0 } else { 2.0 / (8.0 * 4.0) };
    near(of, wanted);
}

#[test]
fn a_source_across_a_compliance_is_a_descriptor() {
    let text = "Se:U(u) -> 0:node -> C:C(3 uF), R:R(50 Ohm)\ninput u\nobserve f(U)";
    let space = json("linearize", text, &["--from", "u", "--to", "f(U)"]);
    assert_eq!(space["form"], "descriptor");
    // I = u/R + s·C·u at any s, from E, A, B, C, D by Cramer's rule for two unknowns.
    let [e, a, b, c, d] = ["E", "A", "B", "C", "D"].map(|name| matrix(&space[name]));
    let s = 7.0;
    let m = |i: usize, j: usize| s * e[i][j] - a[i][j];
    let det = m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0);
    let x = [b[0][0] * m(1, 1) - m(0, 1) * b[1][0], m(0, 0) * b[1][0] - b[0][0] * m(1, 0)];
    near((c[0][0] * x[0] + c[0][1] * x[1]) / det + d[0][0], 1.0 / 50.0 + s * 3e-6);
}

#[test]
fn poles_of_the_actuator_are_those_of_the_reference() {
    let model = "models/eha_one_line.bg";
    let found = roots(&json("poles", model, &["--at", "600ms"])["poles"]);
    let wanted = [
        ((-17.06, 0.0), 0.01),
        ((-40.75, 0.0), 0.04),
        ((-145.4, 0.0), 0.1),
        ((-10.8, 162.9), 0.05),
        ((-314.0, 0.0), 0.5),
        ((-1244.0, 0.0), 0.5),
        ((-1762.0, 0.0), 0.5),
        ((-15680.0, 0.0), 5.0),
    ];
    for ((re, im), off) in wanted {
        let near = |(x, y): &(f64, f64)| (re - x).hypot(im - y) <= off;
        assert!(found.iter().any(near), "{re} {im}: {found:?}");
    }
    let still = roots(&json("poles", model, &["--at", "rest"])["poles"]);
    for ((re, im), off) in [((-48.3, 219.6), 0.05), ((-1.67e5, 0.0), 500.0)] {
        let near = |(x, y): &(f64, f64)| (re - x).hypot(im - y) <= off;
        assert!(still.iter().any(near), "{re} {im}: {still:?}");
    }
}

/// The interpreter that knows python-control: our own environment's, else any.
fn python() -> Option<PathBuf> {
    let own = root().join("target/venv/bin/python");
    let found = [own, PathBuf::from("python3")].into_iter().find(|python| {
        let asked = Command::new(python).args(["-c", "import control"]).output();
        asked.is_ok_and(|output| output.status.success())
    });
    let required = std::env::var("BONDSPICE_REQUIRE_PEERS").is_ok_and(|value| !value.is_empty());
    assert!(found.is_some() || !required, "python-control is required and not installed");
    found
}

#[test]
fn python_control_finds_the_same() {
    let Some(python) = python() else { return };
    let cases = [
        ("models/rlc.bg", "e(U)", "f(mesh)", vec![1.0, 503.0, 1e4]),
        ("models/dc_motor_load.bg", "e(V)", "f(load)", vec![0.1, 13.0, 100.0]),
        ("models/eha_one_line.bg", "x_ref", "theta", vec![0.5, 30.0, 300.0]),
    ];
    for (model, from, to, frequencies) in cases {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("system.py");
        let flags = ["--from", from, "--to", to, "-o", script.to_str().unwrap()];
        bondspice("linearize", model, &flags);
        let list: Vec<String> = frequencies.iter().map(|f| format!("{f:e}")).collect();
        let text = format!(
            "import sys; sys.path.insert(0, {:?})\nfrom system import system\nimport control, json, math\n\
             w = [2*math.pi*f for f in [{}]]\nvalues = [complex(system(1j*x)) for x in w]\n\
             print(json.dumps({{'poles': [[p.real, p.imag] for p in map(complex, system.poles())],\n\
             'values': [[v.real, v.imag] for v in values]}}))",
            folder.path().to_str().unwrap(),
            list.join(",")
        );
        let output = Command::new(&python).args(["-c", &text]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let pairs: Vec<(f64, f64)> = serde_json::from_value(found["poles"].clone()).unwrap();
        let own = roots(&json("poles", model, &["--from", from, "--to", to])["poles"]);
        // What lies at 0 lies there but for rounding of the largest.
        let largest = own.iter().map(|(re, im)| re.hypot(*im)).fold(0.0, f64::max);
        for (re, im) in &own {
            let off = |(x, y): &(f64, f64)| (re - x).hypot(im - y);
            let least = pairs.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(
                least <= 1e-8 * re.hypot(*im) + 1e-14 * largest,
                "{model} {re} {im}: {pairs:?}"
            );
        }
        let values: Vec<(f64, f64)> = serde_json::from_value(found["values"].clone()).unwrap();
        for (frequency, (re, im)) in frequencies.iter().zip(values) {
            let (start, stop) = (format!("{frequency}Hz"), format!("{}Hz", 10.0 * frequency));
            let flags =
                ["--from", from, "--to", to, "--start", &start, "--stop", &stop, "--points", "1"];
            let text = bondspice("bode", model, &flags);
            let row: Vec<f64> =
                text.lines().nth(1).unwrap().split(',').map(|x| x.parse().unwrap()).collect();
            let off = (row[1] - re).hypot(row[2] - im);
            assert!(off <= 1e-8 * re.hypot(im), "{model} {frequency} Hz: {row:?} {re} {im}");
        }
    }
}

#[test]
fn matlab_and_json_hold_the_same_numbers() {
    let text = bondspice("linearize", RLC, &["--format", "matlab"]);
    let numbers = |line: &str| -> Vec<f64> {
        let inside = line.split_once('[').unwrap().1.split_once(']').unwrap().0;
        inside.replace("...", " ").split([' ', ';', '\n']).filter_map(|x| x.parse().ok()).collect()
    };
    let a = text.split("A = ").nth(1).unwrap();
    let own: Vec<f64> = matrix(&json("linearize", RLC, &[])["A"]).concat();
    assert_eq!(numbers(a), own);
    assert!(
        text.contains("sys = ss(A, B, C, D);")
            && text.contains("sys.StateName = {'p(L)', 'q(C)'};")
    );
    assert!(Path::new(env!("CARGO_BIN_EXE_bondspice")).exists());
}
