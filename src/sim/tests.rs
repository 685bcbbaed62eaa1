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
        name: name.into(),
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
    DeviceKind::VoltageSource { waveform: Box::new(waveform), parts: Box::default() }
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
    names.extend(system.outputs.iter().map(|name| name.to_string()));
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

#[test]
fn lc_keeps_its_energy_and_phase() {
    let parts = vec![("L1", vec![1, 0], l(1e-3, 0.0)), ("C1", vec![1, 0], c(1e-6, 1.0))];
    let system = system(parts);
    let omega = 1.0 / (1e-9f64).sqrt();
    let stop = 20.0 * TAU / omega;
    let (trace, statistics) = run(&system, &grid(stop, stop / 400.0, 1e-8));
    let error = worst(&trace, "v(1)", |t| (omega * t).cos());
    assert!(error < 1e-6, "{error}: {statistics}");
    let (v, i) = (column(&trace, "v(1)"), column(&trace, "i(l1)"));
    for (v, i) in v.iter().zip(i) {
        assert!((0.5e-6 * v * v + 0.5e-3 * i * i - 0.5e-6).abs() < 1e-12);
    }
}

#[test]
fn rlc_rings_as_the_closed_form_says() {
    let system = system(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("R1", vec![1, 2], r(20.0)),
        ("L1", vec![2, 3], l(1e-3, 0.0)),
        ("C1", vec![3, 0], c(1e-6, 0.0)),
    ]);
    let (alpha, omega0) = (20.0 / 2e-3, 1.0 / (1e-9f64).sqrt());
    let omega = (omega0 * omega0 - alpha * alpha).sqrt();
    let exact =
        |t: f64| 1.0 - (-alpha * t).exp() * ((omega * t).cos() + alpha / omega * (omega * t).sin());
    for (method, reltol, bound) in [
        (Method::Auto, 1e-8, 1e-7),
        (Method::Rodas4, 1e-8, 1e-7),
        (Method::TrBdf2, 1e-6, 1e-4),
        (Method::Trapezoidal, 1e-6, 1e-4),
        (Method::Gear2, 1e-6, 3e-4),
    ] {
        let settings = Settings { method, ..grid(1e-3, 1e-5, reltol) };
        let (trace, statistics) = run(&system, &settings);
        let error = worst(&trace, "v(3)", exact);
        assert!(error < bound, "{method:?}: {error}: {statistics}");
    }
}

#[test]
fn coupled_inductors_follow_their_two_modes() {
    let system = system(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("R1", vec![1, 2], r(1.0)),
        ("L1", vec![2, 0], l(1.0, 0.0)),
        ("R2", vec![3, 0], r(1.0)),
        ("L2", vec![3, 0], l(1.0, 0.0)),
        ("K1", vec![], DeviceKind::Mutual { inductors: [DeviceId(2), DeviceId(4)], coupling: 0.5 }),
    ]);
    let (trace, _) = run(&system, &grid(5.0, 0.1, 1e-8));
    let mode = |t: f64, m: f64| 1.0 - (-t / m).exp();
    let exact = |t: f64, sign: f64| 0.5 * (mode(t, 1.5) + sign * mode(t, 0.5));
    assert!(worst(&trace, "i(l1)", |t| exact(t, 1.0)) < 1e-7);
    assert!(worst(&trace, "i(l2)", |t| exact(t, -1.0)) < 1e-7);
}

/// Steps of one size: the error test lets everything pass, but what iterations may leave is still a part of each step's
/// error.
fn fixed(method: Method, stop: f64, h: f64) -> Settings {
    Settings {
        method,
        hmax: Some(h),
        h0: Some(h),
        abstol: 1.0,
        vntol: 1.0,
        tolerance: Tolerance::Spice,
        rows: Interval::Times(vec![stop]),
        ..Settings::new(stop)
    }
}

/// The error at the end for two step sizes.
fn errors_at(
    system: &System,
    name: &str,
    exact: f64,
    method: Method,
    stop: f64,
    steps: [f64; 2],
) -> [f64; 2] {
    steps.map(|count| {
        let (trace, _) = run(system, &fixed(method, stop, stop / count));
        (column(&trace, name)[0] - exact).abs()
    })
}

fn order(errors: [f64; 2]) -> f64 {
    (errors[0] / errors[1]).log2()
}

/// y = 2 + sin t, x = y + y³, x' = cos t·(1 + 3·y²), with y as an algebraic unknown.
fn algebraic() -> System {
    let cube = |e: fn() -> Expr| times(e(), times(e(), e()));
    let y = || volt(2, 0);
    let rate = times(
        call(Function::Cos, time()),
        plus(Expr::number(1.0), times(Expr::number(3.0), times(y(), y()))),
    );
    let balance = plus(cube(y), volt(1, 0).negate());
    system(vec![
        ("C1", vec![1, 0], c(1.0, 10.0)),
        ("B1", vec![0, 1], DeviceKind::BehaviouralCurrent { law: rate }),
        ("R1", vec![2, 0], r(1.0)),
        ("B2", vec![2, 0], DeviceKind::BehaviouralCurrent { law: balance }),
    ])
}

#[test]
fn orders_of_convergence_on_an_algebraic_system() {
    let system = algebraic();
    let exact = 2.0 + 1f64.sin();
    for (method, steps, expected) in [
        (Method::Rodas3, [64.0, 128.0], 3.0),
        (Method::Rodas4, [64.0, 128.0], 4.0),
        (Method::Rodas5p, [32.0, 64.0], 5.0),
        (Method::TrBdf2, [32.0, 64.0], 2.0),
        (Method::Trapezoidal, [32.0, 64.0], 2.0),
        (Method::Gear2, [32.0, 64.0], 2.0),
    ] {
        for (name, exact) in [("v(2)", exact), ("v(1)", exact + exact.powi(3))] {
            let errors = errors_at(&system, name, exact, method, 1.0, steps);
            let found = order(errors);
            assert!((found - expected).abs() < 0.5, "{method:?} {name}: {found} from {errors:?}");
        }
    }
}

#[test]
fn orders_of_convergence_on_prothero_and_robinsons_problem() {
    // x' = −λ·(x − cos t) − sin t, x = cos t, λ = 1e6: errors of order h³/λ.
    let pull = times(Expr::number(1e6), plus(volt(1, 0), call(Function::Cos, time()).negate()));
    let law = plus(pull, call(Function::Sin, time()));
    let system = system(vec![
        ("C1", vec![1, 0], c(1.0, 1.0)),
        ("B1", vec![1, 0], DeviceKind::BehaviouralCurrent { law }),
    ]);
    for (method, steps, least) in [
        (Method::Rodas4, [8.0, 16.0], 2.8),
        (Method::Rodas5p, [8.0, 16.0], 2.8),
        (Method::TrBdf2, [8.0, 16.0], 1.8),
    ] {
        let errors = errors_at(&system, "v(1)", 1f64.cos(), method, 1.0, steps);
        let found = order(errors);
        assert!(found > least, "{method:?}: {found} from {errors:?}");
    }
}

#[test]
fn orders_of_convergence_with_a_charge_that_is_not_linear() {
    use crate::circuit::stamps::{Charge, Law, LawStamp, Leaf, Unknown, UnknownId};
    // d/dt (v + v³) = cos t·(1 + 3·v²), v = 2 + sin t.
    let v = || Law::leaf(Leaf::Unknown(UnknownId(0)));
    let mul = |a: Law, b: Law| a.binary(Binary::Multiply, b);
    let add = |a: Law, b: Law| a.binary(Binary::Add, b);
    let slope = add(Law::number(1.0), mul(Law::number(3.0), mul(v(), v())));
    let rate = mul(Law::call(Function::Cos, vec![Law::leaf(Leaf::Time)]), slope);
    let stamps = Stamps {
        unknowns: vec![Unknown {
            name: "v(1)".into(),
            voltage: true,
            nominal: None,
            device: None,
            span: Span::NONE,
        }],
        nodes: 1,
        charges: vec![Charge {
            pinned: false,
            device: DeviceId(0),
            linear: smallvec::smallvec![(UnknownId(0), 1.0)],
            law: Some(mul(v(), mul(v(), v()))),
            into: smallvec::smallvec![(UnknownId(0), 1.0)],
            initial: Some(10.0),
        }],
        laws: vec![LawStamp {
            device: DeviceId(1),
            law: rate,
            into: smallvec::smallvec![(UnknownId(0), -1.0)],
            junction: None,
        }],
        outputs: vec![("v(1)".into(), v())],
        ..Stamps::default()
    };
    let system = compile(&stamps, &mut vec![]).unwrap();
    for (method, steps, expected) in [
        (Method::Rodas4, [64.0, 128.0], 4.0),
        (Method::Rodas5p, [32.0, 64.0], 5.0),
        (Method::TrBdf2, [32.0, 64.0], 2.0),
        (Method::Gear2, [32.0, 64.0], 2.0),
    ] {
        let errors = errors_at(&system, "v(1)", 2.0 + 1f64.sin(), method, 1.0, steps);
        let found = order(errors);
        assert!((found - expected).abs() < 0.5, "{method:?}: {found} from {errors:?}");
    }
    // And with error control, at rows between the steps.
    let (trace, statistics) = run(&system, &grid(1.0, 0.01, 1e-8));
    let error = worst(&trace, "v(1)", |t| 2.0 + t.sin());
    assert!(error < 1e-7, "{error}: {statistics}");
}

#[test]
fn rows_between_steps_are_as_good_as_the_steps() {
    let system = algebraic();
    for (method, reltol, bound) in
        [(Method::Rodas5p, 1e-7, 1e-6), (Method::Rodas4, 1e-7, 1e-6), (Method::TrBdf2, 1e-6, 1e-4)]
    {
        let settings = Settings { method, ..grid(3.0, 1e-3, reltol) };
        let (trace, statistics) = run(&system, &settings);
        assert_eq!(trace.columns[0].len(), 3001);
        let error = worst(&trace, "v(2)", |t| 2.0 + t.sin());
        assert!(error < bound, "{method:?}: {error}: {statistics}");
        assert!(statistics.accepted < 1500, "{statistics}");
        // Algebraic relations hold in every row, to rounding.
        let (x, y) = (column(&trace, "v(1)"), column(&trace, "v(2)"));
        for (x, y) in x.iter().zip(y) {
            assert!((y + y * y * y - x).abs() < 3e-8 * x, "{y} {x}");
        }
    }
}

#[test]
fn corners_and_jumps_are_landed_on() {
    let wave = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (2.0, 2.0), (3.0, 0.0)]);
    let system = system(vec![
        ("V1", vec![1, 0], v(wave)),
        ("R1", vec![1, 2], r(1.0)),
        ("C1", vec![2, 0], c(1.0, 0.0)),
    ]);
    let exact = |t: f64| {
        let jump = if t < 1.0 { 0.0 } else { -2.0 * (-(t - 1.0)).exp_m1() };
        let s = (t - 2.0).max(0.0);
        let fall = |s: f64| -2.0 * (s + (-s).exp_m1());
        jump + fall(s) - fall((t - 3.0).max(0.0))
    };
    let (trace, statistics) = run(&system, &grid(4.0, 0.25, 1e-8));
    assert!(worst(&trace, "v(2)", exact) < 1e-7, "{statistics}");
    assert_eq!(statistics.corners, 3);
    // A row at a jump holds the value after it.
    let (source, at) = (column(&trace, "v(1)"), 4);
    assert_eq!((trace.columns[0][at], source[at - 1], source[at]), (1.0, 0.0, 2.0));
    // Without a grid there are both sides.
    let (trace, statistics) = run(&system, &Settings { reltol: 1e-4, ..Settings::new(4.0) });
    let times = &trace.columns[0];
    let jump = times.windows(2).position(|pair| pair[0] == pair[1]).expect("two rows at the jump");
    let source = column(&trace, "v(1)");
    assert_eq!((times[jump], source[jump], source[jump + 1]), (1.0, 0.0, 2.0));
    assert!(times.contains(&2.0) && times.contains(&3.0));
    // Straight lines between the rows stay within tolerance.
    let values = column(&trace, "v(2)");
    for k in 1..times.len() {
        if times[k] > times[k - 1] {
            let middle = 0.5 * (times[k] + times[k - 1]);
            let error = (0.5 * (values[k] + values[k - 1]) - exact(middle)).abs();
            assert!(error < 5e-4, "{error} at {middle}: {statistics}");
        }
    }
}

#[test]
fn the_operating_point_of_a_diode() {
    let thermal = 0.0258563;
    let model = DiodeModel {
        saturation_current: 1e-12,
        emission: thermal / crate::circuit::devices::diode::THERMAL_VOLTAGE,
        ..DiodeModel::DEFAULT
    };
    let exponential = call(Function::Exp, times(volt(2, 0), Expr::number(1.0 / thermal)));
    let law = times(Expr::number(1e-12), plus(exponential, Expr::number(-1.0)));
    let diode = DeviceKind::Diode { model: Box::new(model), instance: Box::default() };
    for (name, device) in [("D1", diode), ("B1", DeviceKind::BehaviouralCurrent { law })] {
        let system = system(vec![
            ("V1", vec![1, 0], dc(1.0)),
            ("R1", vec![1, 2], r(1e3)),
            (name, vec![2, 0], device),
        ]);
        let point = operating_point(&system).unwrap_or_else(|f| panic!("{:?}", f.diagnostic));
        assert!((point.unknowns[1] - 0.517009824).abs() < 1e-9, "{}", point.unknowns[1]);
        assert!((point.unknowns[2] + 4.82990176e-4).abs() < 1e-12, "{}", point.unknowns[2]);
    }
}

#[test]
fn an_operating_point_holds_storages_that_nothing_determines() {
    // An integrator without feedback keeps its initial value; the rest is at rest.
    let system = system(vec![
        ("V1", vec![1, 0], dc(2.0)),
        ("R1", vec![1, 2], r(1.0)),
        ("C1", vec![2, 0], c(1.0, 0.0)),
        ("G1", vec![0, 3], DeviceKind::Vccs { gain: 1.0, control: [NodeId(2), NodeId(0)] }),
        ("C2", vec![3, 0], c(1.0, 0.5)),
    ]);
    let point = operating_point(&system).unwrap();
    assert!((point.unknowns[1] - 2.0).abs() < 1e-12);
    assert!((point.unknowns[2] - 0.5).abs() < 1e-12);
    // The run starts there: v(2) stays, v(3) rises by 2 V/s.
    let settings = Settings { uic: false, ..grid(1.0, 0.5, 1e-6) };
    let (trace, _) = run(&system, &settings);
    assert!(worst(&trace, "v(2)", |_| 2.0) < 1e-9);
    assert!(worst(&trace, "v(3)", |t| 0.5 + 2.0 * t) < 1e-6);
}

#[test]
fn a_loop_of_capacitors_and_a_source_is_redistributed() {
    // C1 across the source, C2 behind a resistor: index 2, and C1's initial value is not the source's.
    let system = system(vec![
        ("V1", vec![1, 0], v(sine(1.0, 1.0))),
        ("C1", vec![1, 0], c(1.0, 5.0)),
        ("R1", vec![1, 2], r(1.0)),
        ("C2", vec![2, 0], c(0.1, 0.0)),
    ]);
    let (trace, statistics) = run(&system, &grid(2.0, 0.1, 1e-6));
    assert_eq!(statistics.method, "trbdf2");
    assert!(worst(&trace, "v(1)", |t| (TAU * t).sin()) < 1e-5);
    // i(V1) = −(C1·dv/dt + (v1 − v2)/R), away from the start, which is an impulse.
    let (times, v1) = (&trace.columns[0], column(&trace, "v(1)"));
    let (v2, i) = (column(&trace, "v(2)"), column(&trace, "i(v1)"));
    for k in 1..times.len() {
        let exact = -(TAU * (TAU * times[k]).cos() + v1[k] - v2[k]);
        assert!((i[k] - exact).abs() < 2e-2, "{} {exact} at {}", i[k], times[k]);
    }
}

#[test]
fn storages_that_follow_from_others_are_no_states() {
    // Two inductors in series, and two capacitors in parallel: one state each, and no loss of order.
    let system = system(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("R1", vec![1, 2], r(2.0)),
        ("L1", vec![2, 3], l(0.3, 0.0)),
        ("L2", vec![3, 4], l(0.1, 0.0)),
        ("R2", vec![4, 5], r(1.0)),
        ("C1", vec![5, 0], c(0.2, 0.0)),
        ("C2", vec![5, 0], c(0.3, 0.0)),
    ]);
    let (trace, statistics) = run(&system, &grid(3.0, 0.1, 1e-9));
    assert_eq!(statistics.method, "rodas5p", "{statistics}");
    assert!(system.to_string().contains("follows from the others"));
    // 0.4·i' + 3·i + q/0.5 = 1: roots of 0.4 s² + 3 s + 2.
    let root = (9.0f64 - 3.2).sqrt();
    let (a, b) = ((-3.0 + root) / 0.8, (-3.0 - root) / 0.8);
    let current = |t: f64| ((a * t).exp() - (b * t).exp()) / (0.4 * (a - b));
    let slope = |t: f64| (a * (a * t).exp() - b * (b * t).exp()) / (0.4 * (a - b));
    assert!(worst(&trace, "i(l1)", current) < 1e-8, "{statistics}");
    // The voltage across L2 is 0.1·i', and what stands beyond it R2·i + v(5).
    let (v3, v4) = (column(&trace, "v(3)"), column(&trace, "v(4)"));
    for (k, t) in trace.columns[0].iter().enumerate() {
        assert!((v3[k] - v4[k] - 0.1 * slope(*t)).abs() < 1e-8, "at {t}");
    }
}

#[test]
fn two_switches_may_flip_at_one_instant() {
    // One closes and the other opens where the same ramp crosses 0.5; the inductor's current never stops.
    let ramp = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 1.0)]);
    let switch = |control, on: f64| DeviceKind::Switch {
        control,
        on,
        off: on,
        on_resistance: 1e-2,
        off_resistance: 1e6,
        initially_on: None,
    };
    let system = system(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("V2", vec![2, 0], v(ramp)),
        ("S1", vec![1, 3], switch(Box::new(volt(2, 0)), 0.5)),
        ("S2", vec![3, 0], switch(Box::new(volt(0, 2)), -0.5)),
        ("L1", vec![3, 4], l(0.1, 1.0)),
        ("R1", vec![4, 0], r(1.0)),
    ]);
    let (trace, statistics) = run(&system, &grid(1.0, 0.01, 1e-7));
    // Rates (R + Ron)/L, the open switch's leakage left out.
    let rate = 1.01 / 0.1;
    let at_half = (-rate * 0.5f64).exp();
    let exact = |t: f64| {
        if t <= 0.5 {
            (-rate * t).exp()
        } else {
            let end = 1.0 / 1.01;
            end + (at_half - end) * (-rate * (t - 0.5)).exp()
        }
    };
    assert!(worst(&trace, "i(l1)", exact) < 1e-5, "{statistics}");
}

#[test]
fn switches_flip_where_their_control_crosses() {
    // A relaxation oscillator: the switch discharges C above 2 V until 1 V.
    let switch = DeviceKind::Switch {
        control: Box::new(volt(2, 0)),
        on: 2.0,
        off: 1.0,
        on_resistance: 10.0,
        off_resistance: 1e15,
        initially_on: None,
    };
    let system = system(vec![
        ("V1", vec![1, 0], dc(3.0)),
        ("R1", vec![1, 2], r(1e3)),
        ("C1", vec![2, 0], c(1e-6, 1.0)),
        ("S1", vec![2, 0], switch),
    ]);
    // Off: towards 3 V with 1 ms; on: towards 3·10/1010 V with 1 ms·10/1010.
    let rise = 1e-3 * (2.0f64 / 1.0).ln();
    let low: f64 = 3.0 * 10.0 / 1010.0;
    let fall = 1e-3 * 10.0 / 1010.0 * ((2.0 - low) / (1.0 - low)).ln();
    let period = rise + fall;
    let stop = 10.5 * period;
    let (trace, statistics) = run(&system, &grid(stop, period / 100.0, 1e-8));
    assert_eq!(statistics.events, 20, "{statistics}");
    let exact = |t: f64| {
        let s = t - (t / period).floor() * period;
        if s < rise {
            3.0 - 2.0 * (-s / 1e-3).exp()
        } else {
            low + (2.0 - low) * (-(s - rise) * 1010.0 / 10.0 / 1e-3).exp()
        }
    };
    assert!(worst(&trace, "v(2)", exact) < 1e-5, "{statistics}");
}

#[test]
fn a_switch_that_contradicts_itself_is_named() {
    // Closing takes the control away at once: 5 V open, 0.05 V closed, beyond its hysteresis on either side.
    let switch = DeviceKind::Switch {
        control: Box::new(volt(2, 0)),
        on: 2.5,
        off: 2.4,
        on_resistance: 10.0,
        off_resistance: 1e9,
        initially_on: None,
    };
    let system = system(vec![
        ("V1", vec![1, 0], dc(5.0)),
        ("R1", vec![1, 2], r(1e3)),
        ("S1", vec![2, 0], switch),
    ]);
    let failure = transient(&system, &Settings::new(1.0), &mut trace(&system)).unwrap_err();
    assert_eq!(failure.diagnostic.code, "E0804");
    assert_eq!(failure.kind, FailureKind::NotSolved);
}

#[test]
fn switches_take_back_the_pivots_they_had() {
    let switch = DeviceKind::Switch {
        control: Box::new(volt(3, 0)),
        on: 0.6,
        off: 0.4,
        on_resistance: 1.0,
        off_resistance: 1e9,
        initially_on: None,
    };
    let (period, width, edge) = (1e-3, 5e-4, 1e-6);
    let (low, high, delay) = (0.0, 1.0, 0.0);
    let gate = Waveform::Pulse { low, high, delay, rise: edge, fall: edge, width, period };
    let system = system(vec![
        ("V1", vec![1, 0], dc(10.0)),
        ("V2", vec![3, 0], v(gate)),
        ("S1", vec![1, 2], switch),
        ("R1", vec![2, 0], r(1.0)),
        ("L1", vec![2, 0], l(1e-3, 0.0)),
    ]);
    // Closed the current tends to 10 A within 2 ms, open to 0 within 1 ms.
    let exact = |t: f64| {
        let (mut now, mut current) = (0.0, 0.0);
        for cycle in 0..10 {
            let begin = f64::from(cycle) * period;
            let corners = [begin + 0.6 * edge, begin + edge + width + 0.6 * edge, begin + period];
            for (corner, (end, tau)) in corners.iter().zip([(0.0, 1e-3), (10.0, 2e-3), (0.0, 1e-3)])
            {
                let until = corner.min(t);
                current = end + (current - end) * ((now - until) / tau).exp();
                now = until;
            }
        }
        current
    };
    for method in [Method::Auto, Method::TrBdf2] {
        let (trace, statistics) = run(&system, &Settings { method, ..grid(1e-2, 1e-5, 1e-6) });
        assert!(worst(&trace, "i(l1)", exact) < 1e-3, "{statistics}");
        assert_eq!(statistics.events, 20, "{statistics}");
        // Two passes, two matrices, two modes.
        assert!(statistics.factorisations <= 8, "{statistics}");
    }
}

#[test]
fn floating_nodes_and_loops_of_sources_are_named() {
    let found = errors(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("R1", vec![1, 0], r(1.0)),
        ("R2", vec![2, 3], r(1.0)),
    ]);
    assert_eq!(found[0].code, "E0780");
    assert!(found[0].message.contains("v(2), v(3)"), "{}", found[0].message);
    let found = errors(vec![
        ("V1", vec![1, 0], dc(1.0)),
        ("V2", vec![1, 0], dc(2.0)),
        ("R1", vec![1, 0], r(1.0)),
    ]);
    assert_eq!(found[0].code, "E0781");
    assert!(found[0].message.contains("V1") && found[0].message.contains("V2"), "{found:?}");
    let found = errors(vec![(
        "I1",
        vec![0, 1],
        DeviceKind::CurrentSource {
            waveform: Box::new(Waveform::Constant(1.0)),
            parts: Box::default(),
        },
    )]);
    assert_eq!(found[0].code, "E0780");
}

#[test]
fn what_is_no_number_is_said_with_its_device() {
    // √(1 − t·v) ends at t = 1.
    let root = call(Function::Sqrt, plus(Expr::number(1.0), time().negate()));
    let system = system(vec![
        ("B1", vec![1, 0], DeviceKind::BehaviouralVoltage { law: root }),
        ("R1", vec![1, 2], r(1.0)),
        ("C1", vec![2, 0], c(1.0, 0.0)),
    ]);
    let failure = transient(&system, &Settings::new(2.0), &mut trace(&system)).unwrap_err();
    assert!(["E0802", "E0803"].contains(&failure.diagnostic.code), "{:?}", failure.diagnostic);
    assert!((failure.time - 1.0).abs() < 1e-6, "{}", failure.time);
    assert!(failure.statistics.rejected.total() > 0);
}

#[test]
fn counters_are_the_same_every_time() {
    let system = algebraic();
    let settings = grid(2.0, 0.1, 1e-5);
    let (first, statistics) = run(&system, &settings);
    let (second, again) = run(&system, &settings);
    assert_eq!(statistics, again);
    assert_eq!(first, second);
    assert_eq!(statistics.to_json()["schema"], 1);
    assert_eq!(statistics.to_json()["accepted"], statistics.accepted);
}

#[test]
fn an_interrupt_ends_the_run() {
    let system = algebraic();
    let flag = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let settings = Settings { interrupt: Some(flag), ..Settings::new(1.0) };
    let failure = transient(&system, &settings, &mut trace(&system)).unwrap_err();
    assert_eq!(failure.kind, FailureKind::Interrupted);
}

#[test]
fn rows_of_index_2_between_steps_are_those_of_shorter_steps() {
    let system = system(vec![
        ("V1", vec![1, 0], v(sine(2.0, 1.0))),
        ("C1", vec![1, 0], c(1.0, 0.0)),
        ("R1", vec![1, 0], r(1.0)),
    ]);
    let exact = |t: f64| 2.0 * (TAU * t).sin();
    for settings in [grid(1.0, 0.01, 1e-6), Settings::new(1.0)] {
        let (trace, statistics) = run(&system, &settings);
        assert!(worst(&trace, "v(1)", exact) < 1e-9, "{statistics}");
        let current = |t: f64| -(2.0 * TAU * (TAU * t).cos() + exact(t));
        // The first value is an extrapolation.
        assert!(worst(&trace, "i(v1)", current) < 3e-2, "{statistics}");
    }
}

#[test]
fn no_swing_of_a_source_is_jumped_over() {
    let system = system(vec![("V1", vec![1, 0], v(sine(1.0, 1000.0))), ("R1", vec![1, 0], r(1.0))]);
    for method in [Method::Auto, Method::TrBdf2, Method::Gear2, Method::Trapezoidal] {
        let (_, statistics) = run(&system, &Settings { method, ..grid(1e-2, 1e-3, 1e-3) });
        assert!(statistics.accepted >= 40, "{method:?}: {statistics}");
    }
}

#[test]
fn straight_lines_between_rows_are_within_tolerance() {
    for frequency in [1000.0, 7000.0] {
        let system =
            system(vec![("V1", vec![1, 0], v(sine(1.0, frequency))), ("R1", vec![1, 0], r(1.0))]);
        let settings = Settings { reltol: 1e-3, ..Settings::new(1e-2) };
        let (trace, statistics) = run(&system, &settings);
        let (times, values) = (&trace.columns[0], column(&trace, "v(1)"));
        for (t, v) in times.windows(2).zip(values.windows(2)) {
            for theta in [0.25, 0.5, 0.75] {
                let line = v[0] + theta * (v[1] - v[0]);
                let exact = (TAU * frequency * (t[0] + theta * (t[1] - t[0]))).sin();
                assert!((line - exact).abs() < 2.1e-3, "{line} {exact} at {}: {statistics}", t[0]);
            }
        }
        assert!(times.len() < 150 * 70, "{}", times.len());
    }
}

#[test]
fn a_row_without_a_finite_value_ends_the_run() {
    let pole = plus(time(), Expr::number(-1.0));
    let law = Expr::number(1.0).binary(Binary::Divide, pole);
    let system = system(vec![
        ("B1", vec![1, 0], DeviceKind::BehaviouralVoltage { law }),
        ("R1", vec![1, 0], r(1.0)),
    ]);
    let failure = transient(&system, &grid(2.0, 0.5, 1e-6), &mut trace(&system)).unwrap_err();
    assert_eq!(failure.diagnostic.code, "E0803", "{:?}", failure.diagnostic);
    assert_eq!(failure.kind, FailureKind::NotSolved);
    assert!((failure.time - 1.0).abs() < 1e-6, "{}", failure.time);
}

#[test]
fn an_infinite_slope_by_time_is_no_obstacle() {
    let system = system(vec![
        ("B1", vec![1, 0], DeviceKind::BehaviouralVoltage { law: call(Function::Sqrt, time()) }),
        ("R1", vec![1, 0], r(1.0)),
    ]);
    let (trace, statistics) = run(&system, &grid(1.0, 0.1, 1e-6));
    assert_eq!(statistics.method, "trbdf2");
    assert!(worst(&trace, "v(1)", f64::sqrt) < 1e-9, "{statistics}");
}

#[test]
fn what_grows_faster_than_a_step_shows_in_the_sign_of_a_determinant() {
    use super::network::Network;
    // A node that grows at 1000/s beside what decays: one, two and three storages.
    let grows = || vec![("R1", vec![1, 0], r(-1e3)), ("C1", vec![1, 0], c(1e-6, 0.0))];
    let decays = || vec![("R2", vec![2, 0], r(10.0)), ("C2", vec![2, 0], c(1e-6, 0.0))];
    let coil = || vec![("R3", vec![3, 0], r(5.0)), ("L3", vec![3, 0], l(1e-3, 0.0))];
    let cases: [Vec<Part>; 3] = [
        grows(),
        grows().into_iter().chain(decays()).collect(),
        grows().into_iter().chain(decays()).chain(coil()).collect(),
    ];
    for parts in cases {
        let system = system(parts);
        for (alpha, expected) in [(100.0, true), (999.0, true), (1001.0, false), (1e7, false)] {
            let mut network = Network::new(&system, 0.0, 1.0);
            network.linearise(&vec![0.0; system.equations()], 0.0, false);
            network.factorise_dynamic(alpha).unwrap();
            assert_eq!(network.outgrows_step(), Some(expected), "{} {alpha}", system.charges());
        }
    }
}
