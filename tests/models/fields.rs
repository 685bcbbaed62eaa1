//! Fields against closed forms, on both routes: the circuit with its default options, and the graph's own equations.
//!
//! Tolerances, in parts of each column's range: 2e-5 for the circuit at reltol 1e-7, 1e-6 for the second route; the energy of
//! the second route balances to 1e-6 (tested by both routes' verification to 1e-9 of what is moved here).

use bondspice::bond::causality::{Causality, assign};
use bondspice::bond::elaborate::{Overrides, elaborate};
use bondspice::bond::graph::BondGraph;
use bondspice::bond::initial;
use bondspice::bond::syntax::parse;
use bondspice::cli::pipeline::run_text;
use bondspice::diagnostic::Diagnostic;
use bondspice::netlist::{CardKind, Element, Netlist};
use bondspice::second;
use bondspice::source::SourceMap;
use bondspice::translate::translate;
use bondspice::verify::{Settings, verify_netlist};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// A text as graph, causality and netlist, with all that was said.
#[track_caller]
fn translated(text: &str) -> (BondGraph, Causality, Netlist, Vec<Diagnostic>) {
    let mut map = SourceMap::default();
    let file = map.add("field.bg", text.to_string());
    let mut d = vec![];
    let syntax = parse(&map, file, &mut d);
    let result = elaborate(&syntax.into(), &map, &Overrides::default(), &mut d).and_then(|graph| {
        let causality = assign(&graph, &mut d)?;
        let initial = initial::solve(&graph, &causality, &mut d)?;
        let translation = translate(&graph, &causality, &initial, &map, &mut d)?;
        Some((graph, causality, translation.netlist))
    });
    match result {
        Some((graph, causality, netlist)) => (graph, causality, netlist, d),
        None => panic!("{d:#?}\n{text}"),
    }
}

fn model(name: &str) -> String {
    let path = format!("{}/models/{name}.bg", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Both routes against a closed form, column by column in the order of what is observed; then the certificate.
#[track_caller]
fn against(text: &str, closed: &dyn Fn(f64) -> Vec<f64>) {
    let (graph, causality, netlist, _) = translated(text);
    let (until, step) = (graph.experiment.until.unwrap(), graph.experiment.step.unwrap());
    let times: Vec<f64> = (0..=(until / step).round() as usize).map(|k| k as f64 * step).collect();
    let mut d = vec![];
    let settings = second::Settings::default();
    let run = second::integrate(&graph, &causality, &times, &settings, &mut d);
    let run = run.unwrap_or_else(|| panic!("{d:#?}"));
    let mut overrides = Overrides::default();
    overrides.options.push(("reltol".into(), "1e-7".into()));
    let (trace, _) =
        run_text("field.bg", text, &overrides).unwrap_or_else(|said| panic!("{said:#?}"));
    let expected: Vec<Vec<f64>> = times.iter().map(|t| closed(*t)).collect();
    for (what, columns, tolerance) in
        [("circuit", &trace.columns, 2e-5), ("second route", &run.columns, 1e-6)]
    {
        assert_eq!(columns.len(), expected[0].len() + 1, "{what}: {:?}", trace.names);
        for (k, column) in columns[1..].iter().enumerate() {
            let all = || expected.iter().map(|row| row[k]);
            let (low, high) = all().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            let range = if high > low { high - low } else { high.abs().max(1.0) };
            let worst = column.iter().zip(all()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert_eq!(column.len(), times.len());
            assert!(
                worst <= tolerance * range,
                "{what}: {} is off by {:e} of range",
                trace.names[k + 1],
                worst / range
            );
        }
    }
    let residual = run.energy.residual.abs() / run.energy.turnover;
    assert!(residual <= 1e-9, "energy off by {residual:e}: {:#?}", run.energy);
    let report = verify_netlist(&graph, &causality, &netlist, &Settings::default(), &mut d);
    let report = report.unwrap_or_else(|| panic!("{d:#?}"));
    assert!(report.passes(), "{}", report.text());
}

/// exp(A·t)·v.
fn flow(a: &DMatrix<f64>, t: f64, v: &DVector<f64>) -> DVector<f64> {
    (a * t).exp() * v
}

#[test]
fn coupled_coils_rise_as_their_two_time_constants() {
    let l = DMatrix::from_row_slice(2, 2, &[2e-3, 3e-3, 3e-3, 8e-3]);
    let r = DMatrix::from_row_slice(2, 2, &[1.5, 0.0, 0.0, 8.0]);
    let a = -(l.clone().try_inverse().unwrap() * &r);
    let last = DVector::from_row_slice(&[12.0 / 1.5, 0.0]);
    against(&model("coupled_coils"), &|t| {
        let i = &last - flow(&a, t, &last);
        let psi = &l * &i;
        let u1 = 12.0 - 1.5 * i[0];
        // The secondary's voltage is what drives its current through its load, counted into the coil.
        vec![i[0], i[1], psi[0], psi[1], -8.0 * i[1], u1 * i[0]]
    });
    let (.., netlist, _) = translated(&model("coupled_coils"));
    let count = |wanted: fn(&Element) -> bool| {
        let device = |card: &bondspice::netlist::Card| match &card.kind {
            CardKind::Device(device) => wanted(&device.element),
            _ => false,
        };
        netlist.cards.iter().filter(|card| device(card)).count()
    };
    assert_eq!(count(|e| matches!(e, Element::Inductor { .. })), 2);
    assert_eq!(count(|e| matches!(e, Element::Mutual { .. })), 1);
}

#[test]
fn three_coils_have_a_coupling_for_each_pair() {
    let l = DMatrix::from_row_slice(3, 3, &[3.0, 1.0, -0.5, 1.0, 2.0, 0.25, -0.5, 0.25, 1.0]);
    let r = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, 2.0, 0.5]));
    let a = -(l.clone().try_inverse().unwrap() * &r);
    let first = DVector::from_row_slice(&[1.0, -2.0, 0.5]);
    let text = "I:coils([3, 1, -0.5; 1, 2, 0.25; -0.5, 0.25, 1], f0 = [1, -2, 0.5])
        coils.1 -> R:R1(1)
        coils.2 -> R:R2(2)
        R:R3(0.5) -> coils.3
        simulate until 8 step 0.1
        observe f(coils.1), f(coils.2), f(coils.3), p(coils.3)";
    against(text, &|t| {
        let i = flow(&a, t, &first);
        vec![i[0], i[1], i[2], (&l * &i)[2]]
    });
}

#[test]
fn a_field_of_three_compliances_discharges() {
    let c = DMatrix::from_row_slice(3, 3, &[3.0, -1.0, -0.5, -1.0, 2.0, -0.3, -0.5, -0.3, 1.0]);
    let g = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, 0.5, 1.0 / 3.0]));
    let a = -(c.clone().try_inverse().unwrap() * &g);
    let first = DVector::from_row_slice(&[1.0, 0.0, 0.0]);
    against(&model("textbook/G1"), &|t| {
        let e = flow(&a, t, &first);
        vec![e[0], e[1], e[2], (&c * &e)[0]]
    });
}

#[test]
fn an_antisymmetric_r_field_is_a_gyrator_and_takes_no_power() {
    against(&model("textbook/G2"), &|t| vec![t.sin(), 0.5 * (1.0 - t.cos()), 0.0]);
}

/// A T of resistors between a source and a load of 7, by its law; a circuit with a state stands beside it.
fn tee_with_a_load(law: &str) {
    let text = format!(
        "R:tee({law})
        Se:U(10) -> tee.1
        tee.2 -> R:load(7)
        Se:V(1) -> 1:x -> I:m(1), R:r(1)
        simulate until 1 step 0.1
        observe f(tee.1), f(tee.2), e(tee.2), f(x)"
    );
    let f1 = 10.0 / (4.0 - 9.0 / 12.0);
    let f2 = -3.0 * f1 / 12.0;
    against(&text, &|t| vec![f1, f2, -7.0 * f2, 1.0 - (-t).exp()]);
}

#[test]
fn an_r_field_of_a_resistive_two_port_divides_as_its_matrix_says() {
    // A T of resistors, R1 = 1, R2 = 2 and 3 between: e1 = 4·f1 + 3·f2, e2 = 3·f1 + 5·f2. Its second port loaded with 7.
    tee_with_a_load("[4, 3; 3, 5]");
}

#[test]
fn numbered_laws_of_an_r_field_may_give_efforts_and_flows() {
    // The same T in hybrid form: e1 = h11·f1 + h12·e2, f2 = −h12·f1 + h22·e2.
    tee_with_a_load("e1 = 2.2*f1 + 0.6*e2, f2 = -0.6*f1 + 0.2*e2");
}

/// A plate whose charge is cut off feels a constant force: it swings about the place where its spring bears it.
#[test]
fn a_plate_of_constant_charge_swings_about_its_new_place() {
    let text = "param d = 1
        C:plate(e1 = q1*(d + q2)/2, e2 = q1^2/4, q1_0 = 2)
        Sf:none(0) -> plate.1
        1:mech -> plate.2
        mech -> I:m(1), C:k(0.25)
        simulate until 10 step 0.05
        observe q(plate.2), f(mech), e(plate.1), e(plate.2)";
    against(text, &|t| {
        let (x, v) = (-0.25 * (1.0 - (2.0 * t).cos()), -0.5 * (2.0 * t).sin());
        vec![x, v, 1.0 + x, 1.0]
    });
}

/// A coil in short circuit keeps its flux, and the pull of its gap is constant.
#[test]
fn a_solenoid_of_constant_flux_pulls_with_constant_force() {
    let text = "IC:coil(f1 = p1*(1 + q2)/2, e2 = p1^2/4, p1_0 = 2)
        Se:short(0) -> coil.1
        1:plunger -> coil.2
        plunger -> I:m(1), C:k(0.25)
        simulate until 10 step 0.05
        observe q(coil.2), f(plunger), f(coil.1), e(coil.2), p(coil.1)";
    against(text, &|t| {
        let (x, v) = (-0.25 * (1.0 - (2.0 * t).cos()), -0.5 * (2.0 * t).sin());
        vec![x, v, 1.0 + x, 1.0, 2.0]
    });
}

/// y' = f(t, y) by the classical method of fourth order, `steps` to an interval; the values at 0, interval, 2·interval …
fn rows(
    f: &dyn Fn(f64, &[f64; 4]) -> [f64; 4],
    start: [f64; 4],
    (interval, count, steps): (f64, usize, usize),
) -> Vec<[f64; 4]> {
    let h = interval / steps as f64;
    let add = |y: &[f64; 4], k: &[f64; 4], part: f64| -> [f64; 4] {
        std::array::from_fn(|i| y[i] + part * k[i])
    };
    let (mut y, mut rows) = (start, vec![start]);
    for step in 0..count * steps {
        let t = step as f64 * h;
        // Within the step, where what jumps has its value of this step.
        let (begin, end) = (t + 1e-9 * h, t + h - 1e-9 * h);
        let k1 = f(begin, &y);
        let k2 = f(t + 0.5 * h, &add(&y, &k1, 0.5 * h));
        let k3 = f(t + 0.5 * h, &add(&y, &k2, 0.5 * h));
        let k4 = f(end, &add(&y, &k3, h));
        y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        if (step + 1) % steps == 0 {
            rows.push(y);
        }
    }
    rows
}

#[test]
fn the_plate_transducer_moves_as_its_equations_by_hand() {
    let (u, r, ea, d) = (60.0, 50e6, 8.8541878128e-12 * 4e-4, 1e-4);
    let (m, k, b) = (20e-6, 250.0, 8e-3);
    let sound = |t: f64| 2e-3 * (2.0 * PI * 400.0 * t).sin();
    // q, x, v; the charge of the suspension is x.
    let f = move |t: f64, y: &[f64; 4]| {
        let [q, x, v, _] = *y;
        let voltage = q * (d + x) / ea;
        let force = sound(t) - q * q / (2.0 * ea) - k * x - b * v;
        [(u - voltage) / r, v, force / m, 0.0]
    };
    let found = rows(&f, [ea * u / d, 0.0, 0.0, 0.0], (1e-5, 2000, 4));
    against(&model("plate_transducer"), &|t| {
        let [q, x, v, _] = found[(t / 1e-5).round() as usize];
        let voltage = q * (d + x) / ea;
        vec![sound(t), 1e3 * (u - voltage), q, 1e6 * x, voltage, q * q / (2.0 * ea), v]
    });
}

#[test]
fn the_solenoid_moves_as_its_equations_by_hand() {
    let (r, l0, a, x0) = (6.0, 0.06, 1e-3, 3e-3);
    let (m, k, b) = (0.05, 2e4, 12.0);
    let f = move |t: f64, y: &[f64; 4]| {
        let [psi, x, v, spring] = *y;
        let supply = if (1e-3..61e-3).contains(&t) { 12.0 } else { 0.0 };
        let i = psi * (1.0 + x / a) / l0;
        let pull = psi * psi / (2.0 * l0 * a);
        [supply - r * i, v, (-pull - k * spring - b * v) / m, v]
    };
    let found = rows(&f, [0.0, x0, 0.0, 0.0], (1e-4, 1200, 50));
    against(&model("solenoid"), &|t| {
        let [psi, x, v, _] = found[(t / 1e-4).round() as usize];
        vec![psi * (1.0 + x / a) / l0, 1e3 * x, psi * psi / (2.0 * l0 * a), psi, v]
    });
}

/// Nothing takes or gives energy: a coil, the plates, a mass and a spring. What is stored stays to 1e-6 on either route.
#[test]
fn a_free_plate_transducer_conserves_its_energy() {
    let text = "param d = 1
        C:plate(e1 = q1*(d + q2)/2, e2 = q1^2/4, q1_0 = 1.5)
        1:el -> plate.1
        el -> I:L(0.3)
        1:mech -> plate.2
        mech -> I:m(1), C:k(0.25)
        simulate until 40 step 0.1
        options reltol = 1e-8
        observe q(plate.1)^2*(d + q(plate.2))/4 + p(L)^2/0.6 + p(m)^2/2 + q(k)^2*2 as \"E\", q(plate.2) as \"x\"";
    let (graph, causality, netlist, _) = translated(text);
    let (trace, _) = run_text("plate.bg", text, &Overrides::default())
        .unwrap_or_else(|said| panic!("{said:#?}"));
    let energy = trace.column("E").unwrap();
    let start = 1.5f64 * 1.5 / 4.0;
    let worst = energy.iter().map(|e| (e / start - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst <= 1e-6, "energy off by {worst:e}");
    let x = trace.column("x").unwrap();
    assert!(x.iter().any(|x| *x < -0.1), "it swings");
    let mut d = vec![];
    let report = verify_netlist(&graph, &causality, &netlist, &Settings::default(), &mut d);
    let report = report.unwrap_or_else(|| panic!("{d:#?}"));
    assert!(report.passes(), "{}", report.text());
    assert!(report.energy.as_ref().unwrap().stored.abs() < 1e-8 * start, "{}", report.text());
}

/// Coils in short circuit keep their fluxes, 1 and 0, while the coupling m swings: f1 = 1/(1 − m²), f2 = −m·f1.
#[test]
fn entries_of_a_matrix_may_vary() {
    let text = "I:coils([1, 0.5*cos(time); 0.5*cos(time), 1], p0 = [1, 0])
        Se:short1(0) -> coils.1
        Se:short2(0) -> coils.2
        Se:U(1) -> 1:x -> I:m(1), R:r(1)
        simulate until 6 step 0.1
        observe f(coils.1), f(coils.2), p(coils.1), p(coils.2), f(x)";
    against(text, &|t| {
        let m = 0.5 * t.cos();
        let f1 = 1.0 / (1.0 - m * m);
        vec![f1, -m * f1, 1.0, 0.0, 1.0 - (-t).exp()]
    });
}

/// A transformer of real coils whose secondary's current is given: that port is in derivative causality.
#[test]
fn a_port_in_derivative_causality_is_no_state() {
    let text = "I:coils([2, 1; 1, 3])
        Se:U(1) -> 1:p -> R:R(1), coils.1
        Sf:I(sine(0, 1, 0.1)) -> coils.2
        simulate until 10 step 0.1
        observe f(p), p(coils.1), p(coils.2), e(coils.2)";
    let (_, causality, _, d) = translated(text);
    assert_eq!(causality.order, 1);
    let warning = d.iter().find(|d| d.code == "W0401").unwrap();
    assert!(warning.message.contains("I:coils.2 is in derivative causality: Sf:I"), "{warning:?}");
    // 2·i' + w·cos(w·t) + i = 1.
    let w = 0.2 * PI;
    let size = 1.0 + 4.0 * w * w;
    let (c, s) = (-w / size, -2.0 * w * w / size);
    let exact = move |t: f64| {
        let forced = |t: f64| 1.0 + c * (w * t).cos() + s * (w * t).sin();
        let free = -forced(0.0) * (-0.5 * t).exp();
        let i = forced(t) + free;
        let rate = -c * w * (w * t).sin() + s * w * (w * t).cos() - 0.5 * free;
        let (i2, rate2) = ((w * t).sin(), w * (w * t).cos());
        vec![i, 2.0 * i + i2, i + 3.0 * i2, rate + 3.0 * rate2]
    };
    against(text, &exact);
}

/// A gyrator written as a field passes causality on as a gyrator does.
#[test]
fn a_field_that_only_converts_constrains_causality() {
    let strokes = |field: &str, first: &str, second: &str| {
        let text = format!(
            "{field}
            {first}:x(1) -> g.1
            {second}:y(1) -> g.2
            simulate until 1 step 0.1"
        );
        let mut map = SourceMap::default();
        let file = map.add("field.bg", text);
        let mut d = vec![];
        let syntax = parse(&map, file, &mut d);
        let graph = elaborate(&syntax.into(), &map, &Overrides::default(), &mut d).unwrap();
        let causality = assign(&graph, &mut d);
        (causality.map(|causality| causality.order), d)
    };
    // An effort on one side is a flow on the other: the inertia there is in derivative causality.
    for (field, first, second, order) in [
        ("R:g([0, 2; -2, 0])", "Se", "I", 0),
        ("R:g([0, 2; -2, 0])", "Sf", "I", 1),
        ("R:g([0.1, 2; -2, 0])", "Se", "I", 1),
        ("R:g(e1 = 2*e2, f2 = -2*f1)", "Se", "I", 1),
        ("R:g(e1 = 2*e2, f2 = -2*f1)", "Sf", "I", 0),
    ] {
        // Only the source has a value of its own here.
        let (found, d) = strokes(field, first, second);
        assert_eq!(found, Some(order), "{field} {first} {second} {d:#?}");
    }
    let (found, d) = strokes("R:g([0, 2; -2, 0])", "Se", "Sf");
    assert!(found.is_none());
    let conflict = d.iter().find(|d| d.code == "E0406").unwrap();
    assert!(conflict.message.contains("two ports of R:g"), "{conflict:#?}");
}

#[test]
fn an_initial_effort_needs_one_charge() {
    let said = |initial: &str| {
        let text = format!(
            "C:plate(e1 = q1*(1 + q2)/2, e2 = q1^2/4, {initial})
            Sf:none(0) -> plate.1
            plate.2 -> R:r(1)
            simulate until 1 step 0.1"
        );
        run_text("plate.bg", &text, &Overrides::default())
            .map(|_| ())
            .map_err(|d| Box::new(d[0].clone()))
    };
    assert!(said("e1_0 = 3, q2_0 = 1").is_ok());
    // A force that q1 alone makes: no q2 gives it.
    let error = said("q1_0 = 1, e2_0 = 3").unwrap_err();
    assert_eq!(error.code, "E0503");
    assert!(error.message.contains("no q gives plate.2 the e2_0 = 3"), "{error:#?}");
    // With a gap of −1 every charge has the effort 0.
    let error = said("e1_0 = 0, q2_0 = -1").unwrap_err();
    assert!(error.message.contains("more than one q gives plate.1"), "{error:#?}");
}

/// A field may have one port, which needs no number.
#[test]
fn a_field_of_one_port_is_a_storage() {
    let text = "C:c(e1 = q1 + q1^3, q1_0 = 1)
        c -> R:r(2)
        simulate until 5 step 0.1
        observe q(c), q(c.1), e(c), f(c)";
    let (graph, causality, netlist, _) = translated(text);
    assert_eq!(causality.order, 1);
    let mut d = vec![];
    let report = verify_netlist(&graph, &causality, &netlist, &Settings::default(), &mut d);
    assert!(report.unwrap_or_else(|| panic!("{d:#?}")).passes());
}

#[test]
fn an_initial_effort_finds_its_charge() {
    // e1 = 3 with q2 = 1 asks for q1 = 3; e2 = q1²/4.
    let text = "C:plate(e1 = q1*(1 + q2)/2, e2 = q1^2/4, e1_0 = 3, q2_0 = 1)
        Sf:none(0) -> plate.1
        plate.2 -> R:r(1)
        simulate until 1 step 0.1
        observe q(plate.1), e(plate.2), q(plate.2)";
    against(text, &|t| vec![3.0, 2.25, 1.0 - 2.25 * t]);
}

#[test]
fn a_field_that_is_not_reciprocal_is_told() {
    let said = |laws: &str| {
        let text = format!(
            "{laws}
            1:a -> x.1
            1:b -> x.2
            a -> R:R1(1)
            b -> R:R2(1)
            simulate until 1 step 0.1"
        );
        let (.., d) = translated(&text);
        d.into_iter().find(|d| d.code == "W0406")
    };
    let warning = said("C:x(e1 = q1*(1 + q2), e2 = -q1^2/2)").expect("a warning");
    assert!(warning.labels[0].text.contains("∂e1/∂q2 is not ∂e2/∂q1"), "{warning:#?}");
    assert!(said("C:x(e1 = q1*(1 + q2), e2 = q1^2/2)").is_none());
    // A sign that is right for co-energy is wrong for an energy of flux and opening.
    let warning = said("IC:x(f1 = p1*(1 + q2), e2 = -p1^2/2)").expect("a warning");
    assert!(warning.labels[0].text.contains("∂f1/∂q2 is not ∂e2/∂p1"), "{warning:#?}");
    assert!(said("IC:x(f1 = p1*(1 + q2), e2 = p1^2/2)").is_none());
    // The same in other words, with functions that a random point may not have, and with rounding.
    assert!(said("C:x(e1 = sqrt(q1 + q2), e2 = (q1 + q2)^0.5)").is_none());
    assert!(said("C:x(e1 = sin(q1)^2 + cos(q1)^2 + q2, e2 = q1)").is_none());
    assert!(said("I:x(f1 = p1*p2, f2 = p1^2/2 + 1e-3*p1)").is_some());
}
