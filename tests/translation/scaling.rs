//! Scaled netlists, read back, against the model as it stands: whatever the factors, every column and every variable of
//! the map is the same in SI.

use crate::references::{agree, options};
use crate::translated::{models, translated};
use bondspice::bond::causality::Causality;
use bondspice::bond::elaborate::Overrides;
use bondspice::bond::scale;
use bondspice::cli::pipeline::run_text;
use bondspice::netlist::header::Header;
use bondspice::netlist::write::{expression, write};
use bondspice::quantity::Domain;
use bondspice::second;
use bondspice::trace::Trace;
use std::path::Path;

/// Factors of all domains, no two alike and none a power of ten.
const ODD: &str = "electrical=3,rotation=0.25,translation=64,hydraulic=3e6,magnetic=11,thermal=7,\
                   pseudo-thermal=13,pneumatic=3100";

fn scaled(scales: &str, reltol: &str) -> Overrides {
    Overrides { scale: scale::parse(scales).unwrap(), ..options(Some(reltol)) }
}

/// Runs a netlist's text.
#[track_caller]
fn run(name: &str, text: &str) -> Trace {
    match run_text("scaled.cir", text, &Overrides::default()) {
        Ok((trace, _)) => trace,
        Err(diagnostics) => panic!("{name}: {diagnostics:#?}\n{text}"),
    }
}

/// Columns that move by more than rounding.
fn moving(trace: &Trace) -> Trace {
    let mut kept = Trace::new(vec![], vec![]);
    for (at, column) in trace.columns.iter().enumerate() {
        let (low, high) = column
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(*value), high.max(*value)));
        if at == 0 || high - low > 1e-6 * high.abs().max(low.abs()) {
            kept.names.push(trace.names[at].clone());
            kept.units.push(String::new());
            kept.columns.push(column.clone());
        }
    }
    kept
}

#[test]
fn scaled_netlists_give_the_run_of_their_model() {
    let mut hydraulic = 0;
    for path in models() {
        // Slips on a rough belt begin as instabilities; the half wing is ten times the actuator.
        if ["rough_belt.bg", "half_wing.bg"].iter().any(|name| path.starts_with(name)) {
            continue;
        }
        let plain = translated(&path, &options(Some("1e-8")));
        if plain.graph.experiment.until.is_none() || plain.graph.experiment.step.is_none() {
            continue;
        }
        let name = path.display().to_string();
        let reference = run(&name, &plain.text());
        for scales in ["auto", ODD] {
            let model = translated(&path, &scaled(scales, "1e-8"));
            let of = |domain| model.graph.scales.iter().any(|scale| scale.domain == domain);
            hydraulic += usize::from(of(Domain::Hydraulic));
            let trace = run(&name, &model.text());
            agree(&format!("{name} with {scales}"), &trace, &moving(&reference), 2e-5);
        }
    }
    assert!(hydraulic >= 12, "{hydraulic} runs scaled a hydraulic part");
}

/// The scaled graph's own equations, without a circuit, have the trajectories of the unscaled ones.
#[test]
fn scaled_graphs_have_the_same_solutions() {
    for path in ["eha_two_line.bg", "solenoid.bg", "plate_transducer.bg", "coupled_coils.bg"] {
        let [plain, odd] = [options(None), scaled(ODD, "1e-6")].map(|overrides| {
            let graph = translated(Path::new(path), &overrides).graph;
            let (until, step) = (graph.experiment.until.unwrap(), graph.experiment.step.unwrap());
            let times: Vec<f64> =
                (0..=(until / step).round() as usize).map(|row| row as f64 * step).collect();
            let (settings, mut d) = (second::Settings::default(), vec![]);
            let run = second::integrate(&graph, &Causality::default(), &times, &settings, &mut d);
            let run = run.unwrap_or_else(|| panic!("{path}: {d:#?}"));
            let mut trace = Trace::new(run.names, vec![]);
            trace.columns = run.columns;
            trace.units = vec![String::new(); trace.names.len()];
            trace
        });
        agree(path, &odd, &moving(&plain), 1e-6);
    }
}

/// Every variable of the map, not only what is observed.
#[test]
fn the_map_gives_si_whatever_the_scale() {
    for path in ["eha_one_line.bg", "eha_two_line.bg", "coupled_coils.bg"] {
        let [plain, odd] = [options(Some("1e-8")), scaled(ODD, "1e-8")].map(|overrides| {
            let mut model = translated(Path::new(path), &overrides);
            let netlist = &mut model.translation.netlist;
            let (mut header, strange) = Header::read(&netlist.header);
            assert!(strange.is_empty(), "{strange:?}");
            header.columns.clear();
            let mut seen = std::collections::HashSet::new();
            for variable in &model.translation.map.variables {
                let Some(expr) = &variable.expr else { continue };
                if variable.observed || !seen.insert(variable.bg.clone()) {
                    continue;
                }
                header.columns.push(bondspice::netlist::header::Column {
                    name: variable.bg.clone(),
                    unit: String::new(),
                    expr: format!("({})*{:e}", expression(&netlist.names, expr), variable.factor),
                });
            }
            netlist.header = header.pairs();
            run(path, &write(netlist))
        });
        let reference = moving(&plain);
        assert!(reference.names.len() > 10, "{:?}", reference.names);
        agree(path, &odd, &reference, 2e-5);
    }
}

#[test]
fn header_and_map_say_the_scale() {
    let model = translated(Path::new("eha_one_line.bg"), &scaled("auto,translation=1", "1e-6"));
    let text = model.text();
    assert!(text.contains("\n*bondspice scale=hydraulic 1000000\n"), "{text}");
    assert!(!text.contains("scale_translation"), "{text}");
    // Physics stays in SI: parameters are the model's, and the factor is one more.
    assert!(text.contains("\n.param Clp=2e12"), "{text}");
    assert!(text.contains("\n.param scale_hydraulic=1000000"), "{text}");
    let map = model.translation.map.json(&model.translation.netlist.names);
    assert_eq!(map["scale"], serde_json::json!({ "hydraulic": 1e6 }));
}
