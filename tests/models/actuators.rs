//! Actuators made of the library's components, on both routes: with both hydraulic lines, with chambers that follow their
//! piston, with a lever that turns away, and ten of them on one bus.

use crate::references::{agree, common, file, options, reference};
use bondspice::bond::causality::Causality;
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, run_text};
use bondspice::second::{self, Run, Settings};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;

/// The first route: the circuit.
#[track_caller]
fn circuit(name: &str, text: &str, overrides: &Overrides) -> Trace {
    match run_text(&format!("{name}.bg"), text, overrides) {
        Ok((trace, _)) => trace,
        Err(diagnostics) => panic!("{name}: {diagnostics:#?}"),
    }
}

/// The second route: the bond graph's own equations. Its energy must balance: what sources deliver is dissipated,
/// stored or exchanged by modulation, and no junction makes power.
#[track_caller]
fn equations(name: &str, text: &str, overrides: &Overrides, times: &[f64]) -> (Trace, Run) {
    let mut map = SourceMap::default();
    let id = map.add(format!("{name}.bg"), text);
    let mut d = vec![];
    let graph = pipeline::graph(&mut map, id, overrides, &mut d);
    let graph = graph.unwrap_or_else(|| panic!("{name}: {d:#?}"));
    let settings = Settings::default();
    let run = second::integrate(&graph, &Causality::default(), times, &settings, &mut d);
    let run = run.unwrap_or_else(|| panic!("{name}: {d:#?}"));
    let residual = run.energy.residual.abs() / run.energy.turnover;
    assert!(residual <= 1e-6, "{name}: energy off by {residual:e}, {:#?}", run.energy);
    assert!(run.energy.junctions.0 < 1e-9, "{name}: {:?} makes power", run.energy.junctions);
    let mut trace = Trace::new(run.names.clone(), vec![String::new(); run.names.len()]);
    trace.columns.clone_from(&run.columns);
    (trace, run)
}

fn model(name: &str) -> String {
    file(&format!("models/{name}.bg"))
}

/// A column by its header.
#[track_caller]
fn column<'a>(trace: &'a Trace, name: &str) -> &'a [f64] {
    trace.column(name).unwrap_or_else(|| panic!("no `{name}` in {:?}", trace.names))
}

fn low(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn high(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Against trajectories integrated elsewhere from equations derived by hand.
#[test]
fn the_actuator_of_two_lines() {
    for (name, run) in crate::references::TWO_LINES {
        let text = model("eha_two_line");
        for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
            let overrides = run.overrides(reltol);
            let trace = circuit("eha_two_line", &text, &overrides);
            let reference = common(&trace, reference(&format!("eha/{name}")), 26);
            agree(name, &trace, &reference, tolerance);
        }
        let reference = reference(&format!("eha/{name}"));
        let (trace, _) = equations("eha_two_line", &text, &run.overrides(None), reference.time());
        agree(name, &trace, &common(&trace, reference, 26), 1e-6);
    }
}

/// The jack of `eha_two_line` with chambers that follow the piston.
fn moving_chambers() -> String {
    let text = model("eha_two_line");
    assert!(text.contains("\nCylinder:jack("));
    text.replace("\nCylinder:jack(", "\nMovingCylinder:jack(")
}

/// A constant bulk modulus beside a moving volume does not conserve V P^2/(2 beta): the energies balance with the power
/// S v (P1^2 - P2^2)/(2 beta) that the piston exchanges, and do not without it.
#[test]
fn the_energy_of_moving_chambers_balances_only_with_what_their_modulation_exchanges() {
    let text = moving_chambers()
        + "\nsignal work = integ(e(jack.chamber1.fluid)*f(jack.chamber1.fluid) + e(jack.chamber2.fluid)*f(jack.chamber2.fluid))\n\
           signal exchanged = integ(S*f(jack.moving)*(e(jack.chamber1.fluid)^2 - e(jack.chamber2.fluid)^2)/(2*beta))\n\
           signal stored = ((Vt + S*jack.x)*e(jack.chamber1.fluid)^2 + (Vt - S*jack.x)*e(jack.chamber2.fluid)^2)/(2*beta)\n";
    let mut overrides = options(Some("1e-8"));
    overrides.observe = Some("work, exchanged, stored, e(pump1) in bar as \"rest\"".to_string());
    let trace = circuit("moving", &text, &overrides);
    let (second, run) = equations("moving", &text, &overrides, trace.time());
    agree("moving chambers", &second, &trace, 1e-6);
    for trace in [&trace, &second] {
        let [work, exchanged, stored] =
            ["work", "exchanged", "stored"].map(|name| column(trace, name));
        let scale = high(stored) - low(stored);
        let (mut with, mut without) = (0.0_f64, 0.0_f64);
        for row in 0..stored.len() {
            let gained = stored[row] - stored[0];
            with = with.max((gained - work[row] - exchanged[row]).abs() / scale);
            without = without.max((gained - work[row]).abs() / scale);
        }
        println!("moving chambers: off by {with:.1e} with the exchange, {without:.1e} without");
        assert!(with < 1e-6, "{with:e}");
        assert!(without > 1e-2, "{without:e}");
    }
    // What such chambers take is counted as exchanged, on a line of its own.
    let modulated = run.energy.modulated;
    let work = *column(&second, "work").last().unwrap();
    assert!((modulated - work).abs() < 1e-6 * run.energy.turnover, "{modulated} J, not {work} J");
}

/// Nothing leads the fluid back to the accumulator, so that the lines rest above its 20 bar: at 153 bar with constant
/// volumes, at 215 bar with moving ones, as tests/reference/eha says of its own integration, to the bar.
#[test]
fn the_lines_rest_at_the_pressures_of_the_reference() {
    for (text, bar) in [(model("eha_two_line"), 153.0), (moving_chambers(), 215.0)] {
        let observe = "e(pump1) in bar as \"line 1\", e(pump2) in bar as \"line 2\"";
        let overrides = Overrides { observe: Some(observe.to_string()), ..options(None) };
        let trace = circuit("rest", &text, &overrides);
        for name in ["line 1", "line 2"] {
            let rest = *column(&trace, name).last().unwrap();
            assert!((rest - bar).abs() <= 0.5, "{name} rests at {rest} bar, not {bar}");
        }
    }
}

/// The arm turns away by the angle that the surface has: the rod is where the crank has it, plus what the attachment is
/// stretched, at every angle, x = la sin(theta) + stretch.
#[test]
fn the_lever_turns_away_from_its_rod() {
    let text = model("eha_lever");
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let observe = "x, theta, q(attachment.spring) as \"stretch\", e(pump.outlet) as \"dPp\", \
            f(surface) as \"Omega_FC\", power(bus) as \"Pelec\"";
        let overrides = Overrides { observe: Some(observe.to_string()), ..options(reltol) };
        let trace = circuit("eha_lever", &text, &overrides);
        let (second, _) = equations("eha_lever", &text, &overrides, trace.time());
        agree("eha_lever", &trace, &second, tolerance);
        let [x, theta, stretch] = ["x", "theta", "stretch"].map(|name| column(&trace, name));
        let range = high(x) - low(x);
        let (mut turned, mut flat) = (0.0_f64, 0.0_f64);
        for row in 0..x.len() {
            let rest = x[row] - stretch[row];
            turned = turned.max((rest - 0.119 * theta[row].sin()).abs() / range);
            flat = flat.max((rest - 0.119 * theta[row]).abs() / range);
        }
        println!("eha_lever: off by {turned:.1e} of the range, {flat:.1e} for a flat lever");
        assert!(turned < tolerance, "{turned:e}");
        assert!(flat > 5e-3, "the angles are too small to tell: {flat:e}");
    }
}

/// A twentieth of the movement: |theta| stays below 0.02, where the cosine is within theta^2/2 = 2e-4 of 1; the two
/// actuators may differ by five times that, since forces, speeds and what the regulators make of them add up.
#[test]
fn at_small_angles_the_lever_is_the_flat_one() {
    let mut overrides = options(Some("1e-8"));
    overrides.drive = vec![
        "x_ref = pwl(0 s, 0 mm; 0.1 s, 0 mm; 1 s, -1.8 mm; 1.5 s, -1.8 mm; 2.7 s, 0.6 mm; 3.8 s, 0 mm)".into(),
        "M_FC = pwl(0 s, 0 N*m; 0.1 s, 0 N*m; 1 s, 350 N*m; 1.5 s, 350 N*m; 2.7 s, -200 N*m; 3.8 s, 0 N*m)".into(),
    ];
    overrides.observe = Some("x, theta, e(pump.outlet) as \"dPp\", power(bus) as \"Pelec\"".into());
    let turning = circuit("eha_lever", &model("eha_lever"), &overrides);
    let flat = circuit("eha_components", &model("eha_components"), &overrides);
    let theta = column(&flat, "theta");
    assert!(high(theta).max(-low(theta)) < 0.02, "{}", high(theta).max(-low(theta)));
    agree("a lever at small angles", &turning, &flat, 1e-3);
}

/// Ten actuators: both routes alike within 1e-4 of range; gusts push surfaces so that actuators feed the bus.
#[test]
fn the_half_wing_feeds_its_bus_when_gusts_push() {
    let text = model("half_wing");
    let start = std::time::Instant::now();
    let trace = circuit("half_wing", &text, &options(None));
    let own = start.elapsed().as_secs_f64();
    let (second, run) = equations("half_wing", &text, &options(None), trace.time());
    println!("half wing: {own:.2} s, second route {:.2} s", start.elapsed().as_secs_f64() - own);
    agree("half_wing", &trace, &second, 1e-4);
    // The source alone would hold the bus within its drop at the largest current; the filter's coil adds some.
    let bus = column(&trace, "bus");
    assert!(low(bus) > 265.0 && high(bus) < 275.0, "{} to {}", low(bus), high(bus));
    // Fed back into: above the no-load voltage, the current reversed, each actuator observed a source for a while.
    assert!(high(bus) > 271.0, "{}", high(bus));
    assert!(low(column(&trace, "current of the source")) < -30.0);
    for name in ["power of the first", "power of the last", "power of all"] {
        let power = column(&trace, name);
        assert!(low(power) < -1.0 && high(power) > 2.0, "{name}: {} kW", low(power));
    }
    // What the source delivers over the run is what its voltage and current say.
    let delivered = run.energy.shares.iter().find(|share| share.name == "source.U").unwrap().energy;
    let current = column(&second, "current of the source");
    let by_rows: f64 =
        (current.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).sum::<f64>()) * 1e-3 * 270.0;
    assert!((delivered - by_rows).abs() < 1e-3 * run.energy.turnover, "{delivered} J, {by_rows} J");
}
