//! The certificate of a netlist's text: it holds for what the translation writes, and names what was changed.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Model, Question};
use bondspice::diagnostic::Diagnostic;
use bondspice::netlist::write;
use bondspice::source::SourceMap;
use bondspice::verify::Certificate;
use std::path::Path;

/// A model and its text.
fn model(name: &str, text: String) -> Result<(SourceMap, Model, String), Vec<Diagnostic>> {
    let mut map = SourceMap::default();
    let file = map.add(name, text);
    let mut d = vec![];
    match pipeline::model(&mut map, file, &Overrides::default(), &mut d) {
        Some(model) => {
            let text = write::write(&model.translation.netlist);
            Ok((map, model, text))
        }
        None => Err(d),
    }
}

fn shipped(name: &str) -> (SourceMap, Model, String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("models/{name}.bg"));
    model(&format!("{name}.bg"), std::fs::read_to_string(path).unwrap())
        .unwrap_or_else(|d| panic!("{name}: {d:#?}"))
}

/// The certificate of a text; the errors of one that makes no circuit.
fn certificate(
    map: &mut SourceMap,
    model: &Model,
    text: &str,
) -> Result<Certificate, Vec<Diagnostic>> {
    let netlist = Some(map.add("given.cir", text.to_string()));
    let question = Question { netlist, ..Question::default() };
    let mut d = vec![];
    pipeline::certificate(map, model, &question, &Default::default(), &mut d)
        .map(|(found, _)| found)
        .ok_or(d)
}

fn models() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut found = vec![];
    for (folder, prefix) in [(folder.clone(), ""), (folder.join("textbook"), "textbook/")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if let Some(stem) = name.strip_suffix(".bg") {
                found.push(format!("{prefix}{stem}"));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn it_holds_for_every_shipped_model() {
    let mut failed = vec![];
    for name in models() {
        let (mut map, model, text) = shipped(&name);
        match certificate(&mut map, &model, &text) {
            Ok(found) if found.holds() => {
                assert!(found.exact.draws == 2 && found.exact.probability < 1e-16, "{name}");
                assert!(found.exact.variables > 5 && found.values.compared > 5, "{name}");
            }
            found => failed.push(format!("{name}: {found:#?}")),
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn the_first_difference_names_variable_and_card() {
    let (mut map, model, text) = shipped("eha_one_line");
    let changed = text.replace("R_Clp pump_port 0 {Clp}", "R_Clp jack_port 0 {Clp}");
    assert_ne!(text, changed);
    let found = certificate(&mut map, &model, &changed).unwrap();
    let first = found.exact.mismatches.first().unwrap();
    assert_eq!(first.card.as_deref(), Some("r_clp"), "{first:?}");
    assert!(!first.variable.is_empty());
    let changed = text.replace("F_dry*tanh(-(i(E_piston)/v0))", "F_dry*tanh(i(E_piston)/v0)");
    assert_ne!(text, changed);
    let found = certificate(&mut map, &model, &changed).unwrap();
    assert_eq!(found.first().unwrap().card.as_deref(), Some("E_dry"), "{found:#?}");
    assert!(found.exact.mismatches.is_empty(), "the law is cut: {found:#?}");
}

#[test]
fn draws_repeat() {
    let (mut map, model, text) = shipped("servo_axis");
    let mut once = || certificate(&mut map, &model, &text).unwrap();
    assert_eq!(once(), once());
}
