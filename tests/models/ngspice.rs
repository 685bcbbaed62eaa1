//! Emitted netlists, unedited, in stock ngspice against reference trajectories, and against the second route where
//! there are none.

use crate::stock_ngspice::ngspice;
use crate::translated::{Translated, models, root, translated};
use bondspice::bond::elaborate::Overrides;
use bondspice::second;
use bondspice::trace::{Trace, compare, formats};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// The observed columns as ngspice computes them, by the map.
fn run(model: &Translated) -> Trace {
    run_as(model, &model.text())
}

/// The same of a text that differs from the model's own in how it is to be run.
fn run_as(model: &Translated, text: &str) -> Trace {
    crate::stock_ngspice::run(&model.graph.name, &model.nested.netlist, &model.nested.map, text)
        .unwrap()
}

/// Compares named columns and says every error.
fn check(
    model: &str,
    trace: &Trace,
    reference: &Trace,
    pairs: &[(&str, &str)],
    rise: f64,
    tolerance: f64,
) {
    let signals = pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    let settings = compare::Settings { tolerance, rise: Some(rise), signals: Some(signals) };
    let comparison = compare::compare(trace, reference, &settings);
    assert!(comparison.missing.is_empty(), "{model}: {:?}", comparison.missing);
    assert_eq!(comparison.signals.len(), pairs.len(), "{model}");
    let errors: Vec<String> = comparison
        .signals
        .iter()
        .map(|signal| format!("{} {:.1e} at {}", signal.name, signal.max, signal.at))
        .collect();
    println!("{model}: {}", errors.join(", "));
    let worst = comparison.signals.iter().map(|signal| signal.max).fold(0.0, f64::max);
    assert!(worst <= tolerance, "{model}: {}", errors.join(", "));
}

fn reference(name: &str) -> Trace {
    let bytes = std::fs::read(root().join("tests/reference").join(name)).unwrap();
    formats::read(name, &bytes).unwrap()
}

/// Reference columns and what the model calls them; all in SI.
const ACTUATOR: &str = "x, theta, f(armature) as \"I\", f(shaft) as \"Omega\", e(pump_port) as \"dPp\", \
                        f(line) as \"Qp\", alpha, power(bus) as \"Pelec\"";
const COLUMNS: [&str; 8] = ["x", "theta", "I", "Omega", "dPp", "Qp", "alpha", "Pelec"];

#[test]
fn the_actuator_on_its_nominal_movement() {
    if ngspice() {
        let overrides = Overrides { observe: Some(ACTUATOR.into()), ..Overrides::default() };
        let model = translated(Path::new("eha_one_line.bg"), &overrides);
        let pairs = COLUMNS.map(|name| (name, name));
        let reference = reference("eha/one_line_nominal.csv");
        check("nominal", &run(&model), &reference, &pairs, 1e-6, 2e-4);
    }
}

#[test]
fn the_actuator_on_a_step() {
    if ngspice() {
        let overrides = Overrides {
            observe: Some(ACTUATOR.into()),
            drive: vec![
                "x_ref = step(0.1 s, 0 mm, 20 mm)".into(),
                "M_FC = pwl(0 s, 0 N*m; 0.5 s, 0 N*m; 0.6 s, -6 kN*m)".into(),
            ],
            until: Some("1 s".into()),
            ..Overrides::default()
        };
        let model = translated(Path::new("eha_one_line.bg"), &overrides);
        let pairs = COLUMNS.map(|name| (name, name));
        let reference = reference("eha/one_line_step.csv");
        check("step", &run(&model), &reference, &pairs, 1e-6, 1e-3);
    }
}

/// Rows of 0.25 ms, of which ngspice's steps are a tenth: the check valves settle in some 25 us.
#[test]
fn the_actuator_of_two_lines_on_a_step_and_overloaded() {
    if !ngspice() {
        return;
    }
    for (name, run_of) in crate::references::TWO_LINES {
        let mut overrides = run_of.overrides(None);
        overrides.step = Some("0.25 ms".into());
        let model = translated(Path::new("eha_two_line.bg"), &overrides);
        let reference = reference(&format!("eha/{name}.csv"));
        let observed = model.graph.experiment.observe.iter().map(|item| item.name.clone());
        let names: Vec<String> = observed.filter(|name| reference.column(name).is_some()).collect();
        assert!(names.len() >= 25, "{names:?}");
        let pairs: Vec<_> = names.iter().map(|name| (name.as_str(), name.as_str())).collect();
        check(name, &run(&model), &reference, &pairs, 2.5e-7, 1e-3);
    }
}

/// Without a line of options, scaled and as it stands: 1e-3 of range. Then without the step limit too, where the
/// simulator's own tolerances choose the steps: scaling may not make it worse.
#[test]
fn the_scaled_actuator_with_default_tolerances() {
    if !ngspice() {
        return;
    }
    let reference = reference("eha/one_line_nominal.csv");
    let pairs = COLUMNS.map(|name| (name, name));
    let mut worst = vec![];
    for scales in ["auto", "hydraulic=1"] {
        let scale = bondspice::bond::scale::parse(scales).unwrap();
        let overrides = Overrides { observe: Some(ACTUATOR.into()), scale, ..Overrides::default() };
        let model = translated(Path::new("eha_one_line.bg"), &overrides);
        let lines: Vec<String> = model
            .text()
            .lines()
            .filter(|line| !line.to_lowercase().starts_with(".options"))
            .map(str::to_string)
            .collect();
        assert_eq!(lines.len() + 1, model.text().lines().count());
        check(scales, &run_as(&model, &(lines.join("\n") + "\n")), &reference, &pairs, 1e-6, 1e-3);
        let free: Vec<&str> = lines
            .iter()
            .map(|line| if line.starts_with(".tran") { ".tran 1m 3.8 uic" } else { line.as_str() })
            .collect();
        let trace = run_as(&model, &(free.join("\n") + "\n"));
        let signals = pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        let settings = compare::Settings { tolerance: 1.0, rise: None, signals: Some(signals) };
        let comparison = compare::compare(&trace, &reference, &settings);
        worst.push(comparison.signals.iter().map(|signal| signal.max).fold(0.0, f64::max));
    }
    println!("no step limit: off by {:.2e} scaled, by {:.2e} as it stands", worst[0], worst[1]);
    assert!(worst[0] <= 1.1 * worst[1] && worst[0] < 1e-2, "{worst:?}");
}

/// Models whose laws jump.
const EVENTS: [&str; 4] =
    ["buck_pwm.bg", "end_stop.bg", "mass_between_stops.bg", "sampled_controller.bg"];

#[test]
fn every_model_gives_what_its_own_equations_give() {
    if !ngspice() {
        return;
    }
    for path in models() {
        // A block on a belt that slips and sticks: each slip begins as an instability, whose instant ngspice's steps move.
        // The edges of the clocks of step_down and reversing_drive stand on rows, where either side is right; in stick_slip
        // ngspice gives up.
        if ["reversing_drive.bg", "rough_belt.bg", "step_down.bg", "stick_slip.bg"]
            .iter()
            .any(|name| path.starts_with(name))
        {
            continue;
        }
        let mut model = translated(&path, &Overrides::default());
        let experiment = &model.graph.experiment;
        let Some(until) = experiment.until else { continue };
        // The rows of textbook cases are few: ngspice's steps, a tenth of their interval, would be too long for it.
        if path.starts_with("textbook") {
            let step = Some(format!("{}", until / 2000.0));
            model = translated(&path, &Overrides { step, ..Overrides::default() });
        }
        let Some(step) = model.graph.experiment.step else { continue };
        let trace = run(&model);
        // A quarter second of the actuator tells as much of its translation as all of it.
        let rows = (until / step).round() as usize;
        let rows = if path.starts_with("eha_one_line.bg") { 250 } else { rows };
        // ngspice writes its first row after its first step.
        let times: Vec<f64> = (1..=rows).map(|row| row as f64 * step).collect();
        let mut d = vec![];
        let settings = second::Settings { tolerance: 1e-6, ..second::Settings::default() };
        let route = second::integrate(&model.graph, &model.causality, &times, &settings, &mut d);
        let route = route.unwrap_or_else(|| panic!("{}: {d:#?}", path.display()));
        let mut reference = Trace::new(route.names.clone(), vec![]);
        reference.columns = route.columns;
        // What stays constant but for rounding is compared with its magnitude; what stays 0 is not.
        let mut pairs = vec![];
        for (name, column) in route.names.iter().zip(&mut reference.columns).skip(1) {
            let (low, high) = column.iter().fold((f64::MAX, f64::MIN), |(low, high), value| {
                (low.min(*value), high.max(*value))
            });
            let size = high.abs().max(low.abs());
            if high - low < 1e-6 * size {
                column.fill(low);
            }
            if size > 1e-9 {
                pairs.push((name.as_str(), name.as_str()));
            }
        }
        // ngspice meets a condition by steps, of a tenth of the interval at most, and is that late.
        let events = EVENTS.iter().any(|name| path.starts_with(name));
        let (rise, tolerance) = if events { (0.1 * step, 1e-3) } else { (1e-3 * step, 5e-4) };
        check(&path.display().to_string(), &trace, &reference, &pairs, rise, tolerance);
    }
}

#[test]
fn a_netlist_on_standard_input_prints_its_columns() {
    if !ngspice() {
        return;
    }
    let text = translated(Path::new("rlc.bg"), &Overrides::default()).text();
    let mut child = Command::new("ngspice")
        .arg("-b")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    // Rows of the table begin with their number and the time; the last one is the end of the run.
    let time = |line: &str| {
        let mut words = line.split_whitespace();
        words.next()?.parse::<usize>().ok()?;
        words.next()?.parse::<f64>().ok()
    };
    let last = said.lines().filter_map(time).next_back().expect("a row");
    assert!((last - 0.02).abs() < 1e-9, "{last}");
}
