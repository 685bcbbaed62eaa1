//! The certificate of a netlist's text: it holds for what the translation writes, and names what was changed.

use bondspice::bond::elaborate::Overrides;
use bondspice::bond::scale;
use bondspice::cli::pipeline::{self, Model, Question};
use bondspice::diagnostic::Diagnostic;
use bondspice::netlist::dialects::DIALECTS;
use bondspice::netlist::read::How;
use bondspice::netlist::{Card, CardKind, write};
use bondspice::quantity::Domain;
use bondspice::source::SourceMap;
use bondspice::verify::{self, Certificate, Values};
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

/// Our own text in each dialect that is written and read, read back with that dialect's meaning.
#[test]
fn it_holds_in_every_dialect_that_is_read() {
    for dialect in DIALECTS.iter().filter(|dialect| dialect.read.is_some()) {
        if dialect.text.is_none() || dialect.name == "ngspice" {
            continue;
        }
        let (mut held, mut unsaid, mut nested) = (0, 0, 0);
        for name in models() {
            let (mut map, model, _) = shipped(&name);
            let question = Question { to: Some(dialect), ..Question::default() };
            let (how, mut d) = (Default::default(), vec![]);
            match pipeline::certificate(&mut map, &model, &question, &how, &mut d) {
                Some((found, netlist)) => {
                    assert_eq!(netlist.dialect.name, dialect.name);
                    let first = found.first().map(|first| first.line());
                    assert!(found.holds(), "{name} in {}: {first:?}", dialect.name);
                    held += 1;
                    let block = |card: &Card| matches!(card.kind, CardKind::Subcircuit(_));
                    let instances = model.graph.tree.len() > 1;
                    let subcircuits = netlist.cards.iter().any(block);
                    assert_eq!(subcircuits, instances && dialect.nested, "{name}");
                    nested += usize::from(subcircuits);
                }
                // What the dialect has no word for is an error that names the element.
                None => {
                    assert!(d.iter().any(|d| d.message.contains("cannot say")), "{name}: {d:#?}");
                    unsaid += 1;
                }
            }
        }
        let least = if dialect.name == "gnucap" { 8 } else { 20 };
        assert!(held >= least, "{}: {held} held, {unsaid} unsaid", dialect.name);
        assert!(nested >= 12 || !dialect.nested, "{}: {nested} with subcircuits", dialect.name);
    }
}

#[test]
fn a_change_is_seen_in_every_dialect() {
    for dialect in DIALECTS.iter().filter(|dialect| dialect.read.is_some()) {
        let (mut map, model, _) = shipped("eha_one_line");
        let Some(written) = dialect.write(&model.translation.netlist, &mut vec![]) else {
            continue;
        };
        let changed = written.text.replace("R_Clp pump_port 0", "R_Clp jack_port 0");
        assert_ne!(written.text, changed);
        for (text, holds) in [(written.text, true), (changed, false)] {
            let netlist = Some(map.add("given.cir", text));
            let question = Question { netlist, ..Question::default() };
            let found =
                pipeline::certificate(&mut map, &model, &question, &How::of(dialect), &mut vec![]);
            assert_eq!(found.unwrap().0.holds(), holds, "{}", dialect.name);
        }
    }
}

const SCALES: &str = "electrical=3,rotation=0.25,translation=64,hydraulic=3e6,magnetic=11,thermal=7,\
                      pseudo-thermal=13,pneumatic=3100";

/// A model and the same scaled.
fn both(name: &str, scales: &str) -> (SourceMap, [Model; 2], Vec<(Domain, f64)>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("models/{name}.bg"));
    let (mut map, scale) = (SourceMap::default(), scale::parse(scales).unwrap());
    let file = map.add(format!("{name}.bg"), std::fs::read_to_string(path).unwrap());
    let pair = [vec![], scale.clone()].map(|scale| {
        let overrides = Overrides { scale, ..Overrides::default() };
        let mut d = vec![];
        let model = pipeline::model(&mut map, file, &overrides, &mut d);
        model.unwrap_or_else(|| panic!("{name}: {d:#?}"))
    });
    (map, pair, scale)
}

fn scaling(plain: &Model, scaled: &Model, asked: &[(Domain, f64)]) -> Values {
    let graphs = [&plain.graph, &scaled.graph];
    verify::scaling(graphs, [&plain.initial, &scaled.initial], asked, verify::SEED)
}

#[test]
fn scaled_models_are_the_unscaled_ones_and_so_are_their_netlists() {
    let (mut count, mut nested) = (0, 0);
    for name in models() {
        for scales in ["auto", SCALES] {
            let (mut map, [plain, scaled], asked) = both(&name, scales);
            let found = scaling(&plain, &scaled, &asked);
            assert_eq!(found.verdict, "pass", "{name} with {scales}: {:?}", found.mismatches);
            count += usize::from(!scaled.graph.scales.is_empty());
            // With its subcircuits, where it has any; its flat text at odd factors.
            let text = match scales {
                "auto" => write::write(&scaled.nested(&map).netlist),
                _ => write::write(&scaled.translation.netlist),
            };
            nested += usize::from(text.contains(".subckt"));
            let found = certificate(&mut map, &scaled, &text).unwrap();
            let first = found.first().map(|first| first.line());
            assert!(found.holds(), "{name} with {scales}: {first:?}");
        }
    }
    assert!(count >= 25 && nested >= 12, "{count} were scaled, {nested} with subcircuits");
}

#[test]
fn wrong_scaling_is_seen() {
    let (_, [plain, mut scaled], mut asked) = both("eha_one_line", SCALES);
    let right = scaled.graph.clone();
    // A law without its factor.
    let mut changed = 0;
    for (k, vertex) in plain.graph.vertices.iter().enumerate() {
        let law = &vertex.law;
        if format!("{law:?}") == format!("{:?}", right.vertices[k].law) {
            continue;
        }
        scaled.graph = right.clone();
        scaled.graph.vertices[k].law = law.clone();
        let found = scaling(&plain, &scaled, &asked);
        assert_eq!(found.verdict, "fail", "{}", vertex.name);
        changed += 1;
    }
    assert!(changed >= 10, "{changed} laws carry a factor");
    // Another factor than was asked for.
    scaled.graph = right;
    asked.push((Domain::Hydraulic, 1e6));
    let found = scaling(&plain, &scaled, &asked);
    assert!(found.mismatches.iter().any(|m| m.variable == "scale of hydraulic"), "{found:?}");
}

#[test]
fn a_map_with_a_wrong_factor_is_seen() {
    let (mut map, [_, scaled], _) = both("eha_one_line", SCALES);
    let names = &scaled.translation.netlist.names;
    let json = scaled.translation.map.json(names);
    for wrong in [false, true] {
        let mut json = json.clone();
        let variables = json["variables"].as_array_mut().unwrap();
        let of_oil = |v: &&mut serde_json::Value| v["bg"] == "e(pump_port)";
        let variable = variables.iter_mut().find(of_oil).unwrap();
        assert_eq!(variable["factor"], 3e6);
        if wrong {
            variable["factor"] = 1.0.into();
        }
        let text = write::write(&scaled.translation.netlist);
        let netlist = Some(map.add("given.cir", text));
        let question = Question { netlist, map: Some(json), ..Question::default() };
        let how = Default::default();
        let found = pipeline::certificate(&mut map, &scaled, &question, &how, &mut vec![]);
        assert_eq!(found.unwrap().0.holds(), !wrong);
    }
}

/// A ladder of 2500 meshes: ten thousand elements.
fn ladder(meshes: usize) -> String {
    let mut text = String::from("param r = 2\nparam c = 0.1\nSe:u(1) -> 1:s0\ns0 -> R:rs0(r)\n");
    for k in 0..meshes {
        let next = k + 1;
        text += &format!("s{k} -> 0:n{k} -> 1:s{next}\n");
        text += &format!("n{k} -> C:c{k}(c), R:g{k}(f = e/(10*r))\n");
        text += &format!("s{next} -> R:rs{next}({}*r), I:ls{next}(0.05)\n", 1 + k % 7);
    }
    text + &format!("s{meshes} -> 0:last\nlast -> R:end(r), C:cl(c)\nobserve e(last)\n")
}

/// What the exact part costs, in multiplications of its eliminations: the same on every machine. A millisecond does some
/// 50 000 of them.
#[test]
fn the_exact_part_is_quick() {
    let (mut map, one, text) = shipped("eha_one_line");
    let found = certificate(&mut map, &one, &text).unwrap();
    assert!(found.exact.operations < 5_000, "{}", found.exact.operations);
    let (mut map, large, text) = model("ladder.bg", ladder(2500)).unwrap();
    assert!(large.graph.vertices.len() > 10_000);
    let found = certificate(&mut map, &large, &text).unwrap();
    assert!(found.holds(), "{:?}", found.first());
    assert!(found.exact.operations < 1_000_000, "{}", found.exact.operations);
}
