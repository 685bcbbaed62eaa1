//! Runs against closed forms, orders of convergence, and what goes wrong.

use super::*;
use crate::circuit::stamps::{Stamps, stamp};
use crate::circuit::{
    Circuit, Device, DeviceId, DeviceKind, DiodeModel, Expr, Leaf, Node, NodeId, Waveform,
};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Function};
use crate::source::Span;
use crate::trace::Trace;
use std::f64::consts::TAU;

type Part<'a> = (&'a str, Vec<u32>, DeviceKind);

fn build(parts: Vec<Part>) -> Stamps {
    let count = parts.iter().flat_map(|(_, nodes, _)| nodes).max().copied().unwrap_or(0);
    let node = |k: u32| Node { name: k.to_string(), nominal: None, span: Span::NONE };
    let device = |(name, nodes, kind): Part| Device {
        name: name.to_string(),
        nodes: nodes.into_iter().map(NodeId).collect(),
        kind,
        nominal: None,
        span: Span::NONE,
    };
    let circuit = Circuit {
        nodes: (0..=count).map(node).collect(),
        devices: parts.into_iter().map(device).collect(),
        ..Circuit::default()
    };
    let mut d = vec![];
    let stamps = stamp(&circuit, &mut d);
    assert!(d.is_empty(), "{d:?}");
    stamps.unwrap()
}

fn system(parts: Vec<Part>) -> System {
    let mut d = vec![];
    let system = compile(&build(parts), &mut d);
    assert!(d.is_empty(), "{d:?}");
    system.unwrap()
}

fn errors(parts: Vec<Part>) -> Vec<Diagnostic> {
    let mut d = vec![];
    assert!(compile(&build(parts), &mut d).is_none());
    d
}

fn r(resistance: f64) -> DeviceKind {
    DeviceKind::Resistor { resistance }
}

fn c(capacitance: f64, initial: f64) -> DeviceKind {
    DeviceKind::Capacitor { capacitance, initial: Some(initial) }
}

fn l(inductance: f64, initial: f64) -> DeviceKind {
    DeviceKind::Inductor { inductance, initial: Some(initial) }
}

fn v(waveform: Waveform) -> DeviceKind {
    DeviceKind::VoltageSource { waveform }
}

fn dc(value: f64) -> DeviceKind {
    v(Waveform::Constant(value))
}

fn sine(amplitude: f64, frequency: f64) -> Waveform {
    Waveform::Sine { offset: 0.0, amplitude, frequency, delay: 0.0, damping: 0.0, phase: 0.0 }
}

fn volt(a: u32, b: u32) -> Expr {
    Expr::leaf(Leaf::Voltage(NodeId(a), NodeId(b)))
}

fn time() -> Expr {
    Expr::leaf(Leaf::Time)
}

fn call(function: Function, argument: Expr) -> Expr {
    Expr::call(function, vec![argument])
}

fn times(a: Expr, b: Expr) -> Expr {
    a.binary(Binary::Multiply, b)
}

fn plus(a: Expr, b: Expr) -> Expr {
    a.binary(Binary::Add, b)
}

fn trace(system: &System) -> Trace {
    let mut names = vec!["time".to_string()];
    names.extend(system.outputs.iter().cloned());
    let columns = vec![vec![]; names.len()];
    Trace { units: vec![String::new(); names.len()], names, columns }
}

fn run(system: &System, settings: &Settings) -> (Trace, Statistics) {
    let mut result = trace(system);
    match transient(system, settings, &mut result) {
        Ok(statistics) => (result, statistics),
        Err(failure) => panic!("{:?}\n{}", failure.diagnostic, failure.statistics),
    }
}

fn column<'a>(trace: &'a Trace, name: &str) -> &'a [f64] {
    let at = trace.names.iter().position(|n| n == name);
    &trace.columns[at.unwrap_or_else(|| panic!("no {name} in {:?}", trace.names))]
}

/// Largest difference of a column from a function of time.
fn worst(trace: &Trace, name: &str, exact: impl Fn(f64) -> f64) -> f64 {
    let times = &trace.columns[0];
    let values = column(trace, name);
    times.iter().zip(values).map(|(t, v)| (v - exact(*t)).abs()).fold(0.0, f64::max)
}

fn grid(stop: f64, step: f64, reltol: f64) -> Settings {
    Settings { rows: Interval::Grid(step), reltol, ..Settings::new(stop) }
}

#[test]
fn rc_charges() {
    let system = system(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("R1", vec![1, 2], r(1e3)),
        ("C1", vec![2, 0], c(1e-6, 0.0)),
    ]);
    for (reltol, bound) in [(1e-3, 1e-3), (1e-6, 1e-6), (1e-9, 1e-9)] {
        let (trace, statistics) = run(&system, &grid(5e-3, 1e-4, reltol));
        assert_eq!(trace.columns[0].len(), 51);
        assert_eq!(trace.columns[0][50], 5e-3);
        let error = worst(&trace, "v(2)", |t| -(-t / 1e-3).exp_m1());
        assert!(error < bound, "{error} at {reltol}: {statistics}");
        // The source's current is algebraic, and jumps at the start.
        let error = worst(&trace, "i(v1)", |t| -1e-3 * (-t / 1e-3).exp());
        assert!(error < 1e-3 * bound, "current {error} at {reltol}: {statistics}");
    }
}
