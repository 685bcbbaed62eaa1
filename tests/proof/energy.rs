//! Where energy is and goes: `energy` against closed forms at every row.
//!
//! Tolerances: 1e-8 of all the energy that is moved, and of the greatest power.

use bondspice::trace::{Trace, formats};
use serde_json::Value;
use std::process::Command;

/// What `energy` finds of a text: its JSON and the flows at every row.
fn energies(text: &str, flags: &[&str]) -> (Value, Trace) {
    let folder = tempfile::tempdir().unwrap();
    let (model, flows) = (folder.path().join("model.bg"), folder.path().join("flows.csv"));
    std::fs::write(&model, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondspice"));
    command.arg("energy").arg(&model).args(["--format", "json", "--trace"]).arg(&flows);
    let output = command.args(flags).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let trace = formats::read("flows.csv", &std::fs::read(flows).unwrap()).unwrap();
    (serde_json::from_slice(&output.stdout).unwrap(), trace)
}

fn holds(trace: &Trace, name: &str, scale: f64, wanted: impl Fn(f64) -> f64) {
    let values = trace.column(name).unwrap_or_else(|| panic!("{name}: {:?}", trace.names));
    for (t, value) in trace.time().iter().zip(values) {
        let off = (value - wanted(*t)).abs();
        assert!(off <= 1e-8 * scale, "{name} at {t}: {value} instead of {}", wanted(*t));
    }
}

#[test]
fn a_capacitor_is_charged_through_a_resistor() {
    let text =
        "Se:U(10 V) -> 1:mesh\nmesh -> R:R(100 Ohm), C:C(20 uF)\nsimulate until 8 ms step 0.1 ms\n";
    let (found, flows) = energies(text, &[]);
    let (u, r, c): (f64, f64, f64) = (10.0, 100.0, 20e-6);
    let fall = |t: f64| (-t / (r * c)).exp();
    let (all, most) = (c * u * u, u * u / r);
    assert_eq!(flows.rows(), 81);
    holds(&flows, "energy(U)", all, |t| all * (1.0 - fall(t)));
    holds(&flows, "energy(R)", all, |t| 0.5 * all * (1.0 - fall(2.0 * t)));
    holds(&flows, "energy(C)", all, |t| 0.5 * all * (1.0 - fall(t)).powi(2));
    holds(&flows, "power(U)", most, |t| most * fall(t));
    holds(&flows, "power(R)", most, |t| most * fall(2.0 * t));
    holds(&flows, "power(C)", most, |t| most * (fall(t) - fall(2.0 * t)));
    let elements = found["elements"].as_array().unwrap();
    let of = |name: &str| elements.iter().find(|element| element["name"] == name).unwrap();
    let end = 0.5 * all * (1.0 - fall(16e-3));
    assert!((of("R")["energy"].as_f64().unwrap() - end).abs() <= 1e-8 * all);
    assert!((of("U")["peak"]["power"].as_f64().unwrap() - most).abs() <= 1e-8 * most);
    assert!(found["residual"].as_f64().unwrap().abs() < 1e-8);
}

/// A hard spring e = k·q³ holds k·q⁴/4 and gives it to a mass; a gas spring e = a/(v0 + q) has no energy at q = −v0, and
/// counts from q = 0.
#[test]
fn storages_hold_what_their_laws_say() {
    let text = "I:m(2 kg, p0 = 0 N*s) -> 1:v\n1:v -> C:s(e = 8 N/m^3*q^3, q0 = 1 m)\nsimulate until 3 s step 50 ms\nobserve q(s), f(v)\n";
    let text = text.replace("I:m(2 kg, p0 = 0 N*s) -> 1:v\n1:v", "1:v -> I:m(2 kg)\nv");
    let (_, flows) = energies(&text, &[]);
    let held = flows.column("energy(s)").unwrap();
    assert!((held[0] - 2.0).abs() < 1e-12, "{}", held[0]);
    let least = held.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(least < 0.2, "it swings: {least}");
    for (spring, mass) in held.iter().zip(flows.column("energy(m)").unwrap()) {
        assert!((spring + mass - 2.0).abs() <= 1e-8 * 2.0);
    }
    let gas = "1:v -> I:m(2 kg), C:s(e = 5 N*m/(1 m + q) - 5 N, q0 = 0.4 m)\nsimulate until 2 s step 50 ms\n";
    let (_, flows) = energies(gas, &[]);
    let wanted = 5.0 * 1.4f64.ln() - 2.0;
    assert!((flows.column("energy(s)").unwrap()[0] - wanted).abs() < 1e-12);
    // From nowhere: log q has no value at 0.
    let odd =
        "1:v -> I:m(2 kg), C:s(e = 5 N*m/q - 5 N, q0 = 1.4 m)\nsimulate until 2 s step 50 ms\n";
    let (_, flows) = energies(odd, &[]);
    let (held, mass) = (flows.column("energy(s)").unwrap(), flows.column("energy(m)").unwrap());
    assert_eq!(held[0], 0.0);
    for (spring, mass) in held.iter().zip(mass) {
        assert!((spring + mass).abs() <= 1e-8, "{spring} {mass}");
    }
}
