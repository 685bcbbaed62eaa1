//! The second route against closed forms.

use super::*;
use crate::bond::build::*;
use crate::bond::graph::*;
use crate::expr::{Binary, Function};

fn run(graph: &BondGraph, times: &[f64]) -> Run {
    let mut d = vec![];
    let run = integrate(graph, &Causality::default(), times, &Settings::default(), &mut d);
    match run {
        Some(run) => run,
        None => panic!("{d:#?}"),
    }
}

#[track_caller]
fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b} within {tolerance}");
}

#[test]
fn a_compliance_discharges_through_a_resistor() {
    let mut b = Build::default();
    let r = b.vertex("R", "R", resistor(2.0));
    let c = b.vertex("C", "C", compliance(1.0, stored(10.0)));
    b.bond(c, r);
    b.observe_stored(c);
    let run = run(&b.graph, &[0.0, 0.5, 1.0, 5.0, 10.0]);
    for (t, q) in run.columns[0].iter().zip(&run.columns[1]) {
        near(*q, 10.0 * (-t / 2.0).exp(), 1e-7);
    }
    near(run.energy.stored, -50.0 * (1.0 - (-10.0f64).exp()), 1e-7);
    near(run.energy.residual / run.energy.turnover, 0.0, 1e-8);
}

#[test]
fn two_compliances_in_parallel_are_one_state() {
    // D3: Se=1 -> 1(R=1e3) -> 0(C1=1e-6, C2=2e-6), v = 1 − exp(−t/3e-3).
    let mut b = Build::default();
    let source = b.vertex("Se", "U", effort_source(n(1.0)));
    let one = b.one("a");
    let r = b.vertex("R", "R", resistor(1e3));
    let zero = b.zero("b");
    let c1 = b.vertex("C", "C1", compliance(1e-6, StoreInitial::Unstated));
    let c2 = b.vertex("C", "C2", compliance(2e-6, StoreInitial::Unstated));
    b.bond(source, one);
    b.fan(one, &[r, zero]);
    let into = b.bond(zero, c1);
    let other = b.bond(zero, c2);
    b.observe_bond("v", into, Power::Effort);
    b.observe_bond("i1", into, Power::Flow);
    b.observe_bond("i2", other, Power::Flow);
    let run = run(&b.graph, &[0.0, 1e-3, 3e-3]);
    for (row, t) in run.columns[0].iter().enumerate() {
        near(run.columns[1][row], 1.0 - (-t / 3e-3).exp(), 1e-8);
        near(run.columns[2][row], 1e-3 / 3.0 * (-t / 3e-3).exp(), 1e-11);
        near(run.columns[3][row], 2e-3 / 3.0 * (-t / 3e-3).exp(), 1e-11);
    }
}

fn sine(amplitude: f64, w: f64) -> SignalLaw {
    SignalLaw::Waveform(Waveform::Sine {
        offset: n(0.0),
        amplitude: n(amplitude),
        frequency: n(w / std::f64::consts::TAU),
        delay: n(0.0),
        damping: n(0.0),
        phase: n(0.0),
    })
}

/// Two inertias joined by a rigid gear; returns the graph and what is observed: p1, θ2, ω1, ω2, p2, torques of the gear.
fn gear() -> BondGraph {
    let mut b = Build::default();
    let torque = b.signal("T", sine(5.0, 6.0));
    let source = b.vertex("Se", "T", effort_source(Expr::leaf(Leaf::Signal(torque))));
    let (one1, one2) = (b.one("one1"), b.one("one2"));
    let j1 = b.vertex("I", "J1", inertia(0.02, StoreInitial::Unstated));
    let b1 = b.vertex("R", "b1", resistor(0.05));
    let tf = b.vertex("TF", "TF", Law::Transformer(Modulus::Ratio(n(0.25))));
    let j2 = b.vertex("I", "J2", inertia(0.8, StoreInitial::Unstated));
    let b2 = b.vertex("R", "b2", resistor(0.3));
    let k = b.vertex("C", "k", compliance(1.0 / 20.0, StoreInitial::Unstated));
    b.bond(source, one1);
    b.fan(one1, &[j1, b1]);
    let into = b.bond(one1, tf);
    let out = b.bond(tf, one2);
    b.fan(one2, &[j2, b2, k]);
    b.observe_stored(j1);
    b.observe_stored(k);
    b.observe_bond("w1", into, Power::Flow);
    b.observe_bond("w2", out, Power::Flow);
    b.observe_stored(j2);
    b.observe_bond("tau_in", into, Power::Effort);
    b.observe_bond("tau_out", out, Power::Effort);
    b.graph
}

#[test]
fn a_rigid_gear_has_the_closed_form_of_one_oscillator() {
    // Je·w1' = T − (b1 + n²b2)·w1 − n²k·∫w1 with T = 5 sin 6t, from rest.
    let times: Vec<f64> = (0..=600).map(|i| f64::from(i) * 0.01).collect();
    let run = run(&gear(), &times);
    let (n2, w) = (0.0625f64, 6.0f64);
    let (m, c, k) = (0.02 + n2 * 0.8, 0.05 + n2 * 0.3, n2 * 20.0);
    // θ1 = A sin wt + B cos wt + exp(−at)(C cos vt + D sin vt)
    let (re, im) = (k - m * w * w, c * w);
    let (sin, cos) = (5.0 * re / (re * re + im * im), -5.0 * im / (re * re + im * im));
    let a = c / (2.0 * m);
    let v = (k / m - a * a).sqrt();
    let (c0, d0) = (-cos, (-cos * a - sin * w) / v);
    for (row, t) in run.columns[0].iter().enumerate() {
        let decay = (-a * t).exp();
        let speed = sin * w * (w * t).cos() - cos * w * (w * t).sin()
            + decay * ((v * d0 - a * c0) * (v * t).cos() - (v * c0 + a * d0) * (v * t).sin());
        let angle = sin * (w * t).sin()
            + cos * (w * t).cos()
            + decay * (c0 * (v * t).cos() + d0 * (v * t).sin());
        let torque = 5.0 * (w * t).sin();
        let acceleration = (torque - c * speed - k * angle) / m;
        near(run.columns[3][row], speed, 2e-8);
        near(run.columns[2][row], 0.25 * angle, 1e-8);
        near(run.columns[6][row], torque - 0.05 * speed - 0.02 * acceleration, 1e-7);
    }
    assert!(run.energy.residual.abs() < 1e-7 * run.energy.turnover);
    assert!(run.energy.junctions.0 < 1e-9, "{:?}", run.energy.junctions);
}

#[test]
fn a_nonlinear_oscillator_keeps_its_energy_and_its_period() {
    // F1: e = q + q³, q0 = 1, I = 1; period 4.76802203.
    let mut b = Build::default();
    let zero = b.zero("a");
    let cube = q().binary(Binary::Power, n(3.0));
    let law = Law::Store {
        kind: Storage::Compliance,
        law: StoreLaw::OfStored(plus(q(), cube)),
        initial: stored(1.0),
    };
    let c = b.vertex("C", "C", law);
    let i = b.vertex("I", "I", inertia(1.0, StoreInitial::Unstated));
    b.fan(zero, &[c, i]);
    b.observe_stored(c);
    let run = run(&b.graph, &[0.0, 4.76802203, 47.6802203]);
    near(run.columns[1][1], 1.0, 1e-8);
    near(run.columns[1][2], 1.0, 1e-7);
    near(run.energy.residual, 0.0, 1e-8);
}

#[test]
fn a_diode_in_series_has_the_printed_operating_point() {
    // F2: v = .517009824, i = 4.82990176e-4.
    let mut b = Build::default();
    let source = b.vertex("Se", "U", effort_source(n(1.0)));
    let one = b.one("a");
    let r = b.vertex("R", "R", resistor(1e3));
    let exponential = Expr::call(Function::Exp, vec![e().binary(Binary::Divide, n(0.0258563))]);
    let law = times(n(1e-12), exponential.binary(Binary::Subtract, n(1.0)));
    let diode = b.vertex("R", "D", Law::Dissipator(Dissipation::Flow(law)));
    b.bond(source, one);
    b.bond(one, r);
    let bond = b.bond(one, diode);
    b.observe_bond("v", bond, Power::Effort);
    b.observe_bond("i", bond, Power::Flow);
    let run = run(&b.graph, &[0.0, 1.0]);
    for row in 0..2 {
        near(run.columns[1][row], 0.517009824, 1e-9);
        near(run.columns[2][row], 4.82990176e-4, 1e-12);
    }
}

#[test]
fn a_gyrator_can_tie_an_inertia_to_a_compliance() {
    // D1: e_C and w at 1, 10, 100.
    let mut b = Build::default();
    let source = b.vertex("Se", "U", effort_source(n(20.0)));
    let (one1, zero, one2) = (b.one("a"), b.zero("b"), b.one("c"));
    let i = b.vertex("I", "L", inertia(1.0, power(20.0)));
    let r = b.vertex("R", "R", resistor(0.01));
    let gy = b.vertex("GY", "G", Law::Gyrator(Modulus::Ratio(n(0.5))));
    let c = b.vertex("C", "C", compliance(10.0, power(10.0)));
    let j = b.vertex("I", "J", inertia(1.0, power(10.0)));
    let rj = b.vertex("R", "Rj", resistor(0.1));
    b.bond(source, one1);
    b.fan(one1, &[i, r, gy]);
    b.bond(gy, zero);
    let into = b.bond(zero, c);
    b.bond(zero, one2);
    let speed = b.bond(one2, j);
    b.bond(one2, rj);
    b.observe_bond("y", into, Power::Effort);
    b.observe_bond("w", speed, Power::Flow);
    let run = run(&b.graph, &[0.0, 1.0, 10.0, 100.0]);
    let expected = [
        (10.0, 10.0),
        (11.7779906, 19.4788873),
        (3.55952157, 63.7252804),
        (4.04760169, 39.9204997),
    ];
    for (row, (y, w)) in expected.iter().enumerate() {
        near(run.columns[1][row], *y, 1e-7);
        near(run.columns[2][row], *w, 1e-7);
    }
}

#[test]
fn a_bridge_that_is_a_ring_of_junctions_is_solved() {
    // E4 with R4 = 2.
    let mut b = Build::default();
    let source = b.vertex("Se", "U", effort_source(n(5.0)));
    let (top, left, right) = (b.zero("top"), b.zero("left"), b.zero("right"));
    let (arm1, arm2, bridge) = (b.one("arm1"), b.one("arm2"), b.one("bridge"));
    let supply = b.bond(source, top);
    let r: Vec<VertexId> = [1.0, 1.0, 1.0, 2.0, 1.0]
        .iter()
        .enumerate()
        .map(|(i, value)| b.vertex("R", ["R1", "R2", "R3", "R4", "R5"][i], resistor(*value)))
        .collect();
    b.bond(top, arm1);
    b.bond(arm1, r[0]);
    b.bond(arm1, left);
    b.bond(top, arm2);
    b.bond(arm2, r[1]);
    b.bond(arm2, right);
    b.bond(left, bridge);
    b.bond(bridge, r[4]);
    b.bond(bridge, right);
    let l = b.bond(left, r[2]);
    let rr = b.bond(right, r[3]);
    let across = b.graph.vertex(r[4]).bonds[0];
    b.observe_bond("left", l, Power::Effort);
    b.observe_bond("right", rr, Power::Effort);
    b.observe_bond("bridge", across, Power::Flow);
    b.observe_bond("source", supply, Power::Flow);
    let run = run(&b.graph, &[0.0, 1.0]);
    for (column, value) in [2.69230769, 3.07692308, -0.384615385, 4.23076923].iter().enumerate() {
        near(run.columns[column + 1][1], *value, 1e-8);
    }
}

#[test]
fn steps_are_landed_on_and_rows_there_hold_the_later_value() {
    // RC behind a source that steps at 0.3 s.
    let mut b = Build::default();
    let step = b.signal(
        "u",
        SignalLaw::Waveform(Waveform::Step { at: n(0.3), before: n(0.0), after: n(2.0) }),
    );
    let source = b.vertex("Se", "U", effort_source(Expr::leaf(Leaf::Signal(step))));
    let one = b.one("a");
    let r = b.vertex("R", "R", resistor(1.0));
    let c = b.vertex("C", "C", compliance(0.5, StoreInitial::Unstated));
    b.bond(source, one);
    let current = b.bond(one, r);
    b.bond(one, c);
    b.observe_bond("i", current, Power::Flow);
    let run = run(&b.graph, &[0.0, 0.2, 0.3, 0.8]);
    assert_eq!(run.columns[0], [0.0, 0.2, 0.3, 0.8]);
    near(run.columns[1][1], 0.0, 1e-12);
    near(run.columns[1][2], 2.0, 1e-9);
    near(run.columns[1][3], 2.0 * (-1.0f64).exp(), 1e-8);
}

#[test]
fn conditions_on_time_alone_are_corners() {
    // 1 C' = −e + u with u = 2 while mod(t, 1) < 0.4, R = C = 1.
    let mut b = Build::default();
    let time = Expr::leaf(Leaf::Time);
    let within = Expr::call(Function::Mod, vec![time, n(1.0)]).binary(Binary::Less, n(0.4));
    let source = b.vertex("Se", "U", effort_source(Expr::choice(within, n(2.0), n(0.0))));
    let one = b.one("a");
    let r = b.vertex("R", "R", resistor(1.0));
    let c = b.vertex("C", "C", compliance(1.0, StoreInitial::Unstated));
    b.bond(source, one);
    b.fan(one, &[r, c]);
    b.observe_stored(c);
    let run = run(&b.graph, &[0.0, 0.4, 1.0, 1.4, 2.0]);
    let mut q = 0.0;
    for (row, (u, dt)) in [(2.0, 0.4), (0.0, 0.6), (2.0, 0.4), (0.0, 0.6f64)].iter().enumerate() {
        q = u + (q - u) * (-dt).exp();
        near(run.columns[1][row + 1], q, 1e-8);
    }
    assert_eq!(run.corners.len(), 5);
}

#[test]
fn the_rate_form_exchanges_energy_with_what_modulates_it() {
    // der(e) = 4·f through R = 1 from e0 = 1: e = exp(−4t), and ∫ e·f dt = (e² − 1)/8.
    let mut b = Build::default();
    let law = Law::Rate {
        kind: Storage::Compliance,
        rate: times(n(4.0), f()),
        initial: Initial::Given(n(1.0)),
    };
    let c = b.vertex("C", "chamber", law);
    let r = b.vertex("R", "R", resistor(1.0));
    let bond = b.bond(c, r);
    b.observe_bond("e", bond, Power::Effort);
    b.observe_stored(c);
    let run = run(&b.graph, &[0.0, 0.25, 1.0]);
    for (t, (e, q)) in run.columns[0].iter().zip(run.columns[1].iter().zip(&run.columns[2])) {
        near(*e, (-4.0 * t).exp(), 1e-8);
        near(*q, ((-4.0 * t).exp() - 1.0) / 4.0, 1e-8);
    }
    near(run.energy.modulated, ((-8.0f64).exp() - 1.0) / 8.0, 1e-9);
    near(run.energy.dissipated, -run.energy.modulated, 1e-9);
}

#[test]
fn a_source_that_jumps_across_a_storage_moves_it_at_once() {
    let mut b = Build::default();
    let step = b.signal(
        "u",
        SignalLaw::Waveform(Waveform::Step { at: n(0.3), before: n(1.0), after: n(2.0) }),
    );
    let source = b.vertex("Se", "U", effort_source(Expr::leaf(Leaf::Signal(step))));
    let zero = b.zero("a");
    let c = b.vertex("C", "C", compliance(3.0, StoreInitial::Unstated));
    let r = b.vertex("R", "R", resistor(4.0));
    let supply = b.bond(source, zero);
    b.fan(zero, &[c, r]);
    b.observe_stored(c);
    b.observe_bond("i", supply, Power::Flow);
    let run = run(&b.graph, &[0.0, 0.2, 0.3, 0.5]);
    for (row, u) in [1.0, 1.0, 2.0, 2.0].iter().enumerate() {
        near(run.columns[1][row], 3.0 * u, 1e-8);
        near(run.columns[2][row], u / 4.0, 1e-6);
    }
}

#[test]
fn what_follows_a_source_at_once_is_right_between_the_steps() {
    // 2·sin(44 t) across 1 ohm: no state at all.
    let mut b = Build::default();
    let w = 14.0 * std::f64::consts::PI;
    let u = b.signal("u", sine(2.0, w));
    let source = b.vertex("Se", "U", effort_source(Expr::leaf(Leaf::Signal(u))));
    let r = b.vertex("R", "R", resistor(1.0));
    let bond = b.bond(source, r);
    b.observe_bond("f", bond, Power::Flow);
    let times: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.01).collect();
    let run = run(&b.graph, &times);
    for (t, f) in run.columns[0].iter().zip(&run.columns[1]) {
        near(*f, 2.0 * (w * t).sin(), 1e-6);
    }
    near(run.energy.delivered, 2.0, 1e-6);
}

#[test]
fn a_source_across_a_storage_gives_the_current_between_the_steps() {
    // C = 3 behind 2·sin(44 t): the current is 6·44·cos(44 t).
    let mut b = Build::default();
    let w = 14.0 * std::f64::consts::PI;
    let u = b.signal("u", sine(2.0, w));
    let source = b.vertex("Se", "U", effort_source(Expr::leaf(Leaf::Signal(u))));
    let c = b.vertex("C", "C", compliance(3.0, StoreInitial::Unstated));
    let bond = b.bond(source, c);
    b.observe_bond("f", bond, Power::Flow);
    let times: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.01).collect();
    let run = run(&b.graph, &times);
    for (t, f) in run.columns[0].iter().zip(&run.columns[1]) {
        near(f / (6.0 * w), (w * t).cos(), 2e-6);
    }
}

#[test]
fn a_tank_with_two_compliances_starts_whatever_rounding_leaves_of_its_constraint() {
    // e = 0.23·cos(w t) with w² = 1/(1 + 0.87).
    let mut b = Build::default();
    let zero = b.zero("a");
    let c1 = b.vertex("C", "a", compliance(1.0, power(0.23)));
    let i = b.vertex("I", "L", inertia(1.0, StoreInitial::Unstated));
    let c2 = b.vertex("C", "b", compliance(0.87, StoreInitial::Unstated));
    let first = b.bond(zero, c1);
    b.bond(zero, i);
    let second = b.bond(zero, c2);
    b.observe_bond("e", first, Power::Effort);
    b.observe_bond("f", second, Power::Flow);
    let times: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.1).collect();
    let run = run(&b.graph, &times);
    let w = (1.0f64 / 1.87).sqrt();
    for (row, t) in run.columns[0].iter().enumerate() {
        near(run.columns[1][row], 0.23 * (w * t).cos(), 1e-7);
        near(run.columns[2][row], -0.23 * 0.87 * w * (w * t).sin(), 1e-6);
    }
}
