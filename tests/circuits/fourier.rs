//! `.four` against closed forms and ngspice.
//!
//! Tolerances: 1e-6 of the amplitude at reltol 1e-7 against closed forms; against ngspice 39, which samples 200 points of
//! the period, what that costs: 1e-3 of the first harmonic, 1 degree.

use crate::small_signal::{has_ngspice, ngspice};
use serde_json::Value;
use std::f64::consts::PI;
use std::process::Command;

/// The spectra that the program writes for a deck.
fn spectra(deck: &str) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let (path, json) = (folder.path().join("deck.cir"), folder.path().join("four.json"));
    std::fs::write(&path, format!("title\n{deck}\n.end\n")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .arg("simulate")
        .args([&path])
        .arg("--fourier")
        .args([&json])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let value: Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(value["schema"], 1);
    value["fourier"].as_array().unwrap().clone()
}

/// Magnitudes and phases in degrees.
fn harmonics(spectrum: &Value) -> Vec<(f64, f64)> {
    let number = |line: &Value, key: &str| line[key].as_f64().unwrap();
    let lines = spectrum["harmonics"].as_array().unwrap().iter();
    lines.map(|line| (number(line, "magnitude"), number(line, "phase"))).collect()
}

#[test]
fn a_square_wave() {
    // Rises of 1 ns: a trapezoid, whose harmonics are those of the square times sinc(kf·1 ns), 1 to 1e-10.
    let found = spectra(
        "v1 a 0 pulse(-1 1 0 1n 1n 0.5m 1.000002m)\nr1 a 0 1k\n.options reltol=1e-7\n.four 999.998000004 v(a)\n.tran 1u 5.00001m",
    );
    let distortion = found[0]["distortion"].as_f64().unwrap();
    let found = harmonics(&found[0]);
    assert_eq!(found.len(), 10);
    for (k, (magnitude, _)) in found.iter().enumerate() {
        let exact = if k % 2 == 1 { 4.0 / (PI * k as f64) } else { 0.0 };
        assert!((magnitude - exact).abs() < 1e-6, "{k}: {magnitude} for {exact}");
    }
    let exact = [3.0f64, 5.0, 7.0, 9.0].iter().map(|k| 1.0 / (k * k)).sum::<f64>().sqrt();
    assert!((distortion - exact).abs() < 1e-6);
}

#[test]
fn a_rectified_sine_and_an_item_in_braces() {
    // Rows stand at the bends of |sin| to a 256th of a step: steps of 0.2 ms at most keep that out of the figures.
    // |sin|: 2/π − Σ 4/(π(4m² − 1))·cos(2mωt), of the sine's frequency only the even harmonics.
    let found = spectra(
        "v1 a 0 sin(0 1 50)\nb1 b 0 v=abs(v(a))\nr1 b 0 1k\n.options reltol=1e-7\n.four 50 v(b) {2*v(a)} a\n.tran 0.1m 60m 0 0.2m",
    );
    assert_eq!(found.len(), 3);
    assert_eq!(found[1]["output"], "{2*v(a)}");
    for (k, (magnitude, phase)) in harmonics(&found[0]).iter().enumerate() {
        let exact = match k {
            0 => 2.0 / PI,
            _ if k % 2 == 0 => 4.0 / (PI * ((k * k) as f64 - 1.0)),
            _ => 0.0,
        };
        assert!((magnitude - exact).abs() < 1e-6, "{k}: {magnitude} for {exact}");
        // −cos is a sine at −90°.
        assert!(k == 0 || k % 2 == 1 || (phase + 90.0).abs() < 1e-3, "{k} {phase}");
    }
    let doubled = harmonics(&found[1]);
    assert!((doubled[1].0 - 2.0).abs() < 1e-6 && doubled[1].1.abs() < 1e-4, "{doubled:?}");
    assert!(found[1]["distortion"].as_f64().unwrap() < 1e-6);
    assert_eq!(found[2]["output"], "v(a)");
}

#[test]
fn a_filter_takes_harmonics_as_its_transfer_function_says() {
    // The steady state of an RC behind a square wave: 1/(1 + jkωRC) of each harmonic.
    let found = spectra(
        "v1 a 0 pulse(-1 1 0 1n 1n 0.5m 1.000002m)\nr1 a b 1k\nc1 b 0 0.1u\n.options reltol=1e-7\n.four 999.998000004 v(a) v(b)\n.tran 1u 5.00001m",
    );
    let (before, after) = (harmonics(&found[0]), harmonics(&found[1]));
    for k in [1usize, 3, 5, 7, 9] {
        let x = 2.0 * PI * 999.998000004 * k as f64 * 1e-4;
        let gain = 1.0 / (1.0 + x * x).sqrt();
        assert!((after[k].0 - gain * before[k].0).abs() < 1e-6, "{k} {after:?}");
        let turned =
            (after[k].1 - before[k].1 + x.atan().to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
        assert!(turned.abs() < 1e-3, "{k} {turned}");
    }
}

#[test]
fn steps_have_their_own() {
    let found = spectra(
        "v1 a 0 sin(0 {x} 1k)\nr1 a 0 1k\n.param x=1\n.step param x list 1 3\n.four 1k v(a)\n.tran 1u 2m",
    );
    let first: Vec<f64> = found.iter().map(|one| harmonics(one)[1].0).collect();
    assert!((first[0] - 1.0).abs() < 1e-3 && (first[1] - 3.0).abs() < 3e-3, "{first:?}");
    assert_eq!((&found[0]["step"], &found[1]["step"]), (&Value::from(0.0), &Value::from(1.0)));
}

#[test]
fn ngspice_tells_the_same() {
    if !has_ngspice() {
        return;
    }
    let deck = "v1 a 0 sin(0 2 1k)\nr1 a b 1k\nd1 b 0 dm\n.model dm d(is=1e-14)\nc1 b 0 10n\n.options reltol=1e-5\n.tran 1u 3m 0 1u\n.four 1k v(b)";
    let ours = spectra(deck);
    let said = ngspice(deck, "run\nfourier 1k v(b)");
    let lines: Vec<Vec<f64>> = said
        .lines()
        .filter_map(|line| {
            let words: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
            words.ok().filter(|words| words.len() == 6)
        })
        .collect();
    assert!(lines.len() >= 10, "{said}");
    let ours = harmonics(&ours[0]);
    for (line, (magnitude, phase)) in lines.iter().zip(&ours).take(10) {
        assert!((line[2] - magnitude).abs() < 1e-3 * ours[1].0, "{line:?} {magnitude}");
        let large = line[0] > 0.0 && *magnitude > 0.05 * ours[1].0;
        let turned = (line[3] - phase + 540.0).rem_euclid(360.0) - 180.0;
        assert!(!large || turned.abs() < 1.0, "{line:?} {phase}");
    }
}
