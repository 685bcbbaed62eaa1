//! Every shipped model, run, against what is known of it independently: trajectories that were integrated from
//! equations derived by hand, closed forms, printed digits.
//!
//! The error is that of `trace::compare`: the largest difference over the reference's rows as a part of the
//! reference's range.

use crate::references::{agree, common, file, options, reference};
use bondspice::bond::causality;
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, run_text};
use bondspice::second;
use bondspice::source::SourceMap;
use bondspice::trace::Trace;

/// Runs a model of `models/`.
fn run(model: &str, overrides: &Overrides) -> Trace {
    match run_text(&format!("{model}.bg"), &file(&format!("models/{model}.bg")), overrides) {
        Ok((trace, _)) => trace,
        Err(diagnostics) => panic!("{model}: {diagnostics:#?}"),
    }
}

fn textbook(model: &str) {
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run(model, &options(reltol));
        let reference = common(&trace, reference(&format!("textbook/{model}")), 6);
        agree(model, &trace, &reference, tolerance);
    }
}

#[test]
fn mass_spring_damper() {
    textbook("msd");
}

#[test]
fn dc_motor_with_load() {
    textbook("dc_motor_load");
}

#[test]
fn duffing_oscillator() {
    textbook("duffing");
}

#[test]
fn dependent_gear() {
    textbook("gear_dep");
}

#[test]
fn bridge_with_coil() {
    textbook("rlc_bridge");
}

#[test]
fn two_tanks() {
    textbook("two_tank");
}

#[test]
fn buck_converter() {
    textbook("buck");
}

const ACTUATOR: &str = "x, theta, f(armature) as \"I\", f(shaft) as \"Omega\", e(pump_port) as \"dPp\", \
    f(line) as \"Qp\", e(jack_port) as \"dPj\", f(rod) as \"Vj\", e(attachment) as \"Fj\", alpha, \
    power(bus) as \"Pelec\"";

fn actuator(reference_name: &str, change: impl Fn(&mut Overrides)) {
    let reference = reference(&format!("eha/{reference_name}"));
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let mut overrides = options(reltol);
        overrides.observe = Some(ACTUATOR.to_string());
        change(&mut overrides);
        let trace = run("eha_one_line", &overrides);
        agree(reference_name, &trace, &reference, tolerance);
    }
}

#[test]
fn actuator_nominal() {
    actuator("one_line_nominal", |_| {});
}

#[test]
fn actuator_step() {
    actuator("one_line_step", |overrides| {
        overrides.drive = vec![
            "x_ref = step(0.1 s, 0 mm, 20 mm)".to_string(),
            "M_FC = pwl(0 s, 0 N*m; 0.5 s, 0 N*m; 0.6 s, -6 kN*m; 1 s, -6 kN*m)".to_string(),
        ];
        overrides.until = Some("1 s".to_string());
    });
}

/// A column by its header.
fn column<'a>(trace: &'a Trace, name: &str) -> &'a [f64] {
    let at = trace.names.iter().position(|n| n == name);
    &trace.columns[at.unwrap_or_else(|| panic!("no `{name}` in {:?}", trace.names))]
}

/// Compares columns with functions of time over all rows.
fn closed_form(
    model: &str,
    overrides: &Overrides,
    tolerance: f64,
    forms: &[(&str, &dyn Fn(f64) -> f64)],
) {
    let trace = run(model, overrides);
    let mut exact = Trace::new(vec!["time".to_string()], vec!["s".to_string()]);
    exact.columns[0] = trace.columns[0].clone();
    assert!(exact.columns[0].len() > 1);
    for (name, form) in forms {
        exact.names.push(name.to_string());
        exact.units.push(String::new());
        exact.columns.push(trace.columns[0].iter().map(|t| form(*t)).collect());
    }
    agree(model, &trace, &exact, tolerance);
}

#[test]
fn series_circuit() {
    // 10 V on 1 mH, 2 Ohm, 100 uF.
    let (l, r, c, u) = (1e-3, 2.0, 1e-4, 10.0);
    let a = r / (2.0 * l);
    let w = (1.0_f64 / (l * c) - a * a).sqrt();
    let current = |t: f64| u / (l * w) * (-a * t).exp() * (w * t).sin();
    let charge = |t: f64| c * u * (1.0 - (-a * t).exp() * ((w * t).cos() + a / w * (w * t).sin()));
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        closed_form(
            "rlc",
            &options(reltol),
            tolerance,
            &[("f(mesh)", &current), ("q(C)", &charge)],
        );
    }
}

/// The motor of Fig. 13 runs without load: its speed at a step of the voltage, in rpm, and its current.
#[test]
fn the_simplified_actuator() {
    let (l, j, r, f, phi, u, start) = (1.7e-3, 1.3e-3, 0.46, 3e-3, 0.23, 60.0, 10e-3);
    let square = (r * f + phi * phi) / (l * j);
    let a = 0.5 * (r / l + f / j);
    let w = f64::sqrt(square - a * a);
    let last = u * phi / (r * f + phi * phi);
    let swing = move |t: f64| (-a * t).exp() * (w * t).sin() / w;
    let speed = move |t: f64| {
        let t = (t - start).max(0.0);
        last * (1.0 - (-a * t).exp() * (w * t).cos() - a * swing(t))
    };
    let rpm = |t: f64| speed(t) * 30.0 / std::f64::consts::PI;
    // J·ω' + f·ω = Φ·i
    let current = |t: f64| (j * last * square * swing((t - start).max(0.0)) + f * speed(t)) / phi;
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let forms: [(&str, &dyn Fn(f64) -> f64); 2] =
            [("f(shaft)", &rpm), ("f(armature)", &current)];
        closed_form("eha_fig13", &options(reltol), tolerance, &forms);
    }
}

/// Values that other tools' tests and documentation print, or that follow from closed forms.
/// Model, parameters set, and (time, column, digits).
type Printed = (
    &'static str,
    &'static [(&'static str, &'static str)],
    &'static [(f64, &'static str, &'static str)],
);

const PRINTED: &[Printed] = &[
    (
        "A1",
        &[],
        &[
            (0.5, "q", "7.78800783"),
            (1.0, "q", "6.06530660"),
            (5.0, "q", "0.820849986"),
            (10.0, "q", "0.0673794700"),
        ],
    ),
    (
        "A2",
        &[],
        &[
            (0.5, "q", "9.45959469"),
            (1.0, "q", "8.94839317"),
            (5.0, "q", "5.73753421"),
            (10.0, "q", "3.29192988"),
        ],
    ),
    (
        "A3",
        &[],
        &[
            (0.5, "q", "0.140904120"),
            (0.5, "p", "1.27293973"),
            (5.0, "q", "0.101294275"),
            (5.0, "p", "-0.162532987"),
        ],
    ),
    ("A4", &[], &[(5.0, "q", "2.98652411")]),
    ("A5", &[], &[(5.0, "q", "0.236257515")]),
    (
        "A6",
        &[],
        &[(1.0, "q", "0.367879441"), (2.0, "q", "0.270670566"), (5.0, "q", "0.0336897350")],
    ),
    (
        "A7",
        &[],
        &[
            (1.0, "Ca", "1"),
            (1.0, "Cb", "1.41969860"),
            (1.0, "L", "0.316060279"),
            (5.0, "Ca", "1"),
            (5.0, "Cb", "0.543796655"),
            (5.0, "L", "0.469679239"),
            (60.0, "Ca", "1"),
            (60.0, "Cb", "0.5"),
            (60.0, "L", "0.5"),
        ],
    ),
    (
        "A8",
        &[],
        &[
            (10.0, "q", "8.37277877"),
            (10.0, "p", "4.58195608"),
            (100.0, "q", "-5.17395582"),
            (100.0, "p", "18.0080119"),
        ],
    ),
    (
        "C1",
        &[],
        &[
            (2e-3, "i", "6.28419224e-4"),
            (2e-3, "e2", "0.352429597"),
            (40e-3, "i", "4.25531915e-4"),
            (40e-3, "e2", "0.4"),
        ],
    ),
    (
        "D1",
        &[],
        &[
            (1.0, "y", "11.7779906"),
            (1.0, "w", "19.4788873"),
            (10.0, "y", "3.55952157"),
            (10.0, "w", "63.7252804"),
            (100.0, "y", "4.04760169"),
            (100.0, "w", "39.9204997"),
            (400.0, "y", "3.98406375"),
            (400.0, "w", "39.8406375"),
        ],
    ),
    ("D3", &[], &[(1e-3, "v", "0.283468689"), (3e-3, "v", "0.632120559")]),
    ("E2", &[], &[(1.5, "q", "0.632120559"), (3.0, "q", "0.864664717")]),
    ("E4", &[], &[(1.0, "i1", "2.5"), (1.0, "i3", "2.5"), (1.0, "i5", "0"), (1.0, "i", "5")]),
    (
        "E4",
        &[("R4", "2")],
        &[
            (1.0, "vb", "2.69230769"),
            (1.0, "vc", "3.07692308"),
            (1.0, "i5", "-0.384615385"),
            (1.0, "i", "4.23076923"),
        ],
    ),
    (
        "F1",
        &[],
        &[
            (4.76802203, "q", "1"),
            (4.76802203, "p", "0"),
            (47.6802203, "q", "1"),
            (47.6802203, "energy", "0.75"),
        ],
    ),
    ("F2", &[], &[(1.0, "v", "0.517009824"), (1.0, "i", "4.82990176e-4")]),
];

/// Half a unit of the last digit printed.
fn half_digit(digits: &str) -> f64 {
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((digits, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, after)| after.len() as i32);
    // Exact values are printed short.
    let decimals = if decimals < 4 { 9 } else { decimals };
    0.5 * 10f64.powi(exponent.parse::<i32>().unwrap() - decimals)
}

#[test]
fn textbook_cases_to_the_printed_digits() {
    let mut wrong = vec![];
    for (model, set, values) in PRINTED {
        let mut overrides = options(Some("1e-9"));
        overrides.set =
            set.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
        let trace = run(&format!("textbook/{model}"), &overrides);
        for (time, name, digits) in *values {
            let row = trace.columns[0].iter().position(|t| (t - time).abs() <= 1e-9 * time);
            let Some(row) = row else {
                wrong.push(format!("{model}: no row at {time}"));
                continue;
            };
            let value = column(&trace, name)[row];
            let expected: f64 = digits.parse().unwrap();
            let error = (value - expected).abs();
            let values = column(&trace, name);
            let high = values.iter().copied().fold(f64::MIN, f64::max);
            let low = values.iter().copied().fold(f64::MAX, f64::min);
            let scale = expected.abs().max(high - low);
            if error.is_nan() || error > 1.01 * half_digit(digits) + 1e-6 * scale {
                wrong.push(format!(
                    "{model} {name}({time}) = {value}, not {digits} (by {error:.1e})"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn textbook_cases_over_all_rows() {
    let w = 3f64.sqrt() / 2.0;
    let ring =
        |t: f64, sign: f64| (-t / 2.0).exp() * ((w * t).cos() + sign * 3f64.sqrt() * (w * t).sin());
    let check = |model: &str, forms: &[(&str, &dyn Fn(f64) -> f64)]| {
        closed_form(&format!("textbook/{model}"), &options(None), 1e-4, forms);
        closed_form(&format!("textbook/{model}"), &options(Some("1e-9")), 1e-6, forms);
    };
    check("A1", &[("q", &|t| 10.0 * (-t / 2.0).exp())]);
    check("A2", &[("q", &|t| 10.0 * (-t / 9.0).exp())]);
    check("A3", &[("q", &|t| ring(t, -1.0)), ("p", &|t| ring(t, 1.0))]);
    check("A4", &[("q", &|t| 3.0 - 2.0 * (-t).exp())]);
    check("A5", &[("q", &|t| ((2.0 * t).sin() - 2.0 * (2.0 * t).cos()) / 5.0 + 1.4 * (-t).exp())]);
    check("A6", &[("q", &|t| t * (-t).exp())]);
    check("D3", &[("v", &|t| 1.0 - (-t / 3e-3).exp())]);
    check(
        "E1",
        &[
            ("p", &|t| -10.0 * (-t / 2.0).exp() * (t / 2.0).sin()),
            ("q", &|t| 10.0 * (-t / 2.0).exp() * (t / 2.0).cos()),
        ],
    );
    check("E2", &[("q", &|t| 1.0 - (-t / 1.5).exp())]);
}

/// Every shipped model, as a path below `models/` without its ending.
fn shipped() -> Vec<String> {
    let folder = format!("{}/models", env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![];
    for (folder, before) in [(folder.clone(), ""), (format!("{folder}/textbook"), "textbook/")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "bg") {
                found.push(format!("{before}{}", path.file_stem().unwrap().to_string_lossy()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_model_has_a_test() {
    let tests = [
        include_str!("models.rs"),
        include_str!("actuators.rs"),
        include_str!("library.rs"),
        include_str!("fields.rs"),
        include_str!("event_models.rs"),
    ];
    for model in shipped() {
        let stem = model.rsplit('/').next().unwrap();
        let tested = [format!("\"{stem}\""), format!("model(\"{model}\")")];
        let tested = tested.iter().any(|name| tests.iter().any(|text| text.contains(name)));
        assert!(tested, "{stem} is not tested");
    }
}

#[test]
fn netlists_read_back_give_the_run_of_their_model() {
    for model in shipped() {
        // The golden netlists are what translation writes: another test holds them to that.
        let name = format!("netlists/{model}.cir");
        let text = file(&name);
        let (mut back, _) = run_text(&name, &text, &Overrides::default())
            .unwrap_or_else(|diagnostics| panic!("{model}: {diagnostics:#?}"));
        let trace = run(&model, &Overrides::default());
        back.units.clone_from(&trace.units);
        // Subcircuits put devices into another order, and steps may end elsewhere: each run errs by what its tolerance of
        // 1e-6 for a step comes to over all of them, up to 1.3e-6 (against runs at 1e-9).
        let tolerance = if text.contains(".subckt") { 3e-6 } else { 1e-12 };
        agree(&model, &back, &trace, tolerance);
    }
}

#[test]
fn powers_read_back_have_the_same_bits() {
    let text = "Se:U(sine(8, 4, 1)) -> 1:a -> R:n(f = orifice(e, 0.05, 0.1)), 0:b\n\
                b -> C:c(0.1), R:r(e = 0.1*f^3 + 2*f + 0.01*f^5)\nsimulate until 4 s step 0.1 s\n\
                observe e(b) as \"e\", f(n) as \"f\"\n";
    let (trace, _) = run_text("orifice.bg", text, &Overrides::default()).expect("it runs");
    let mut map = bondspice::source::SourceMap::default();
    let (file, mut d) = (map.add("orifice.bg", text), vec![]);
    let model =
        bondspice::cli::pipeline::model(&mut map, file, &Overrides::default(), &mut d).unwrap();
    let netlist = bondspice::netlist::write::write(&model.translation.netlist);
    let (back, _) = run_text("orifice.cir", &netlist, &Overrides::default()).expect("it runs");
    assert_eq!(back.columns, trace.columns);
}

#[test]
fn laws_over_time_stand_beside_dependent_storages() {
    // Two inertias on one shaft are one state; V = 10 t on R = 1 and I1 + I2 = 2: i = 10 (t - 2 (1 - exp(-t/2))).
    let text = "Se:V(10*time) -> 1:a\na -> R:R(1), I:M(1), I:y(1)\nobserve e(V) as \"v\", f(a) as \"i\"\n\
                simulate until 4 s step 0.25 s\n";
    let (trace, _) = run_text("ramp.bg", text, &Overrides::default()).expect("it runs");
    for (row, t) in trace.time().iter().enumerate() {
        let current = 10.0 * (t - 2.0 * (1.0 - (-t / 2.0).exp()));
        assert!((column(&trace, "v")[row] - 10.0 * t).abs() < 1e-9, "v at {t}");
        assert!((column(&trace, "i")[row] - current).abs() < 1e-4 * 22.0, "i at {t}");
    }
}

#[test]
fn switches_stand_beside_dependent_storages() {
    // The switch closes at 0.5 s: before it hardly any current, after it V/R (1 - exp(-t R/(L1 + L2))).
    let text = "switch\nV1 a 0 1\nVc c 0 PWL(0 0 1 1)\nS1 a b c 0 sw\nR1 b d 1\nL1 d e 0.1 IC=0\nL2 e 0 0.1 IC=0\n\
                .model sw SW(vt=0.5 vh=0 ron=1e-6 roff=1e9)\n.print tran i(l1) i(l2)\n.tran 0.01 1 0 0.1 uic\n.end\n";
    let (trace, _) = run_text("switch.cir", text, &Overrides::default()).expect("it runs");
    for (row, t) in trace.time().iter().enumerate() {
        let current = if *t <= 0.5 { 0.0 } else { 1.0 - (-(t - 0.5) * 5.0).exp() };
        for name in ["i(l1)", "i(l2)"] {
            let found = column(&trace, name)[row];
            assert!((found - current).abs() < 2e-3, "{name} at {t}: {found} for {current}");
        }
    }
}

/// A text's observed columns on both routes, on its own grid.
fn both_routes(text: &str, overrides: &Overrides) -> [Trace; 2] {
    let (trace, _) = run_text("both.bg", text, overrides).unwrap();
    let mut map = SourceMap::default();
    let (file, mut d) = (map.add("both.bg", text), vec![]);
    let graph = pipeline::graph(&mut map, file, &Overrides::default(), &mut d).unwrap();
    let causality = causality::assign(&graph, &mut d).unwrap();
    let run = second::integrate(&graph, &causality, trace.time(), &Default::default(), &mut d);
    let run = run.unwrap_or_else(|| panic!("{d:#?}"));
    let mut own = Trace::new(run.names, vec![]);
    own.columns = run.columns;
    [trace, own]
}

#[test]
fn levers_that_move_join_two_inertias() {
    // v = r(th)·w with r = 1.5·sin(th), or 1/r: J·w² + m·v² is kept, so w = w0·√(j(th0)/j(th)) and the time that th takes
    // is ∫ √(j/j0)/w0 dth, j = J + m·(v/w)². The force at the mass is m·dv/dt. The first starts where its ratio is 0.
    let (inertia, mass) = (2.0f64, 3.0f64);
    let cases = [("1.5*sin(th)", 0.0, 6), ("1.5*sin(th)", 0.5, 6), ("gain = 1.5*sin(th)", 1.0, 2)];
    for (modulus, th0, until) in cases {
        let turned = modulus.starts_with("gain");
        let text = format!(
            "1:w -> I:J(2, p0 = 2)\nw -> MTF:lever({modulus}) -> 1:v -> I:m(3)\nsignal th = integ(f(w), {th0})\n\
             simulate until {until} s step 0.05 s\nobserve th, f(w) as \"w\", f(v) as \"v\", e(m) as \"F\"\n"
        );
        let over = |th: f64| if turned { 1.0 / (1.5 * th.sin()) } else { 1.5 * th.sin() };
        let slope = |th: f64| match turned {
            true => -th.cos() / (1.5 * th.sin() * th.sin()),
            false => 1.5 * th.cos(),
        };
        let whole = |th: f64| inertia + mass * over(th) * over(th);
        let speed = |th: f64| (whole(th0) / whole(th)).sqrt();
        let takes = |th: f64| {
            // Simpson's rule.
            let n = 2000;
            let h = (th - th0) / f64::from(n);
            let weight = |i| if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            (0..=n).map(|i| weight(i) / speed(th0 + f64::from(i) * h)).sum::<f64>() * h / 3.0
        };
        for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
            let traces = both_routes(&text, &options(reltol));
            for (trace, route) in traces.iter().zip(["circuit", "second route"]) {
                let mut exact = Trace::new(trace.names.clone(), vec![]);
                exact.columns[0] = trace.time().to_vec();
                let mut th = th0;
                for t in trace.time() {
                    for _ in 0..20 {
                        th -= (takes(th) - t) * speed(th);
                    }
                    let w = speed(th);
                    let v = over(th) * w;
                    // j·w' = −m·r·r'·w², v' = r'·w² + r·w'
                    let rate = -mass * over(th) * slope(th) * w * w / whole(th);
                    let force = mass * (slope(th) * w * w + over(th) * rate);
                    let row = [th, w, v, force];
                    exact.columns[1..].iter_mut().zip(row).for_each(|(column, x)| column.push(x));
                }
                agree(&format!("{modulus} from {th0}, {route}"), trace, &exact, tolerance);
            }
        }
    }
}

#[test]
fn a_loss_without_slope_at_rest_can_start() {
    // At the start the capacitor is empty: 8 = f·|f|. At rest 8 = f² + 2f, so f = 2.
    let text = "Se:U(8) -> 1:a -> R:n(e = f*abs(f)), 0:b\nb -> C:c(0.1), R:r(2)\nobserve f(a) as \"f\"\n\
                simulate until 4 s step 1 s\n";
    let (trace, _) = run_text("loss.bg", text, &Overrides::default()).expect("it runs");
    let flow = column(&trace, "f");
    assert!((flow[0] - 8f64.sqrt()).abs() < 1e-6, "{flow:?}");
    assert!((flow[4] - 2.0).abs() < 1e-5, "{flow:?}");
}

#[test]
fn stated_node_voltages_are_held_at_the_operating_point() {
    let text = "ic\nC1 a 0 1u\nR1 a 0 1k\n.ic v(a)=5\n.print tran v(a)\n.tran 10u 1m\n.options reltol=1e-6\n.end\n";
    let (trace, _) = run_text("ic.cir", text, &Overrides::default()).expect("it runs");
    for (t, v) in trace.time().iter().zip(column(&trace, "v(a)")) {
        assert!((v - 5.0 * (-t / 1e-3).exp()).abs() < 5e-5, "{v} at {t}");
    }
}
