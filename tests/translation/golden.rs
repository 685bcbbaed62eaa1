//! The netlists in `netlists/` are what translation makes of the models. `UPDATE=1 cargo test --test translation golden` writes them
//! anew.

use crate::translated::{models, root, translated};
use bondspice::bond::elaborate::Overrides;
use bondspice::netlist::dialects;
use std::path::PathBuf;

/// Linked sources, laws with conditions, tables, switches, coupled inductors, lines.
const FOR_THE_EYE: [&str; 6] = [
    "eha_one_line.bg",
    "dc_motor_load.bg",
    "buck_pwm.bg",
    "coupled_coils.bg",
    "hydraulic_line.bg",
    "sampled_controller.bg",
];

/// The same in Saber's language, which has no word for whole parts: those that it can say.
const IN_SABER: [&str; 5] =
    ["eha_one_line.bg", "dc_motor_load.bg", "step_down.bg", "coupled_coils.bg", "msd.bg"];

#[test]
fn netlists_are_what_translation_makes_of_the_models() {
    let update = std::env::var_os("UPDATE").is_some_and(|value| value == "1");
    let mut different = vec![];
    let mut kept = std::collections::BTreeSet::new();
    let all = models().into_iter().map(|model| (model, "ngspice"));
    // Those that cannot be run here are kept for the eye, a few models each.
    let others = ["xyce", "ltspice"]
        .into_iter()
        .flat_map(|dialect| FOR_THE_EYE.iter().map(move |model| (PathBuf::from(model), dialect)));
    let saber = IN_SABER.iter().map(|model| (PathBuf::from(model), "saber"));
    for (model, dialect) in all.chain(others).chain(saber) {
        let folder = root().join("netlists");
        let folder = if dialect == "ngspice" { folder } else { folder.join(dialect) };
        let ending = if dialect == "saber" { "sin" } else { "cir" };
        let golden = folder.join(&model).with_extension(ending);
        let model = translated(&model, &Overrides::default());
        let dialect = dialects::find(dialect).unwrap();
        let netlist =
            if dialect.nested { &model.nested.netlist } else { &model.translation.netlist };
        let text = dialect.write(netlist, &mut vec![]).unwrap().text;
        kept.insert(golden.clone());
        if update {
            std::fs::create_dir_all(golden.parent().unwrap()).unwrap();
            std::fs::write(&golden, &text).unwrap();
        }
        let before = std::fs::read_to_string(&golden).unwrap_or_default();
        if before != text {
            let line = text.lines().zip(before.lines()).position(|(new, old)| new != old);
            let line = line.unwrap_or_else(|| text.lines().count().min(before.lines().count()));
            different.push(format!(
                "{}:{}\n  is   {}\n  was  {}",
                golden.display(),
                line + 1,
                text.lines().nth(line).unwrap_or("(end)"),
                before.lines().nth(line).unwrap_or("(end)")
            ));
        }
    }
    assert!(
        different.is_empty(),
        "{}\nUPDATE=1 cargo test --test translation golden writes the netlists anew: look at the difference first",
        different.join("\n")
    );
    for folder in ["", "/textbook", "/xyce", "/ltspice", "/saber"] {
        let folder = format!("netlists{folder}");
        for entry in std::fs::read_dir(root().join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let stale =
                path.extension().is_some_and(|e| e == "cir" || e == "sin") && !kept.contains(&path);
            assert!(!stale, "{} belongs to no model", path.display());
        }
    }
}

#[test]
fn lines_are_short_and_nothing_is_added_to_power_nodes() {
    for model in models() {
        let text = translated(&model, &Overrides::default()).text();
        for line in text.lines() {
            let name = model.display();
            assert!(
                line.starts_with("*bondspice column") || line.chars().count() < 80,
                "{name}: {line}"
            );
            let lower = line.to_lowercase();
            assert!(!lower.contains("rshunt") && !lower.contains("guard"), "{name}: {line}");
        }
    }
}

#[test]
fn the_actuator_needs_one_ammeter_and_no_coupler() {
    let actuator = translated(std::path::Path::new("eha_one_line.bg"), &Overrides::default());
    assert_eq!(actuator.translation.figures.helpers, 1);
    assert!(actuator.text().contains("V_sense_line pump_port line 0"));
    assert!(!actuator.text().contains("coupler"));
}
