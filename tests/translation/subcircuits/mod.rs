//! Instances as subcircuits: what is written is the flat circuit, no more, and each terminal pair is a port.

mod ports;

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Model, Question, run_text};
use bondspice::diagnostic::Diagnostic;
use bondspice::netlist::write::write;
use bondspice::netlist::{Netlist, flatten::flatten, read};
use bondspice::source::SourceMap;
use bondspice::translate::hierarchy::Hierarchy;
use std::path::{Path, PathBuf};

/// A model with its subcircuits.
pub struct Folded {
    pub map: SourceMap,
    pub model: Model,
    pub nested: Hierarchy,
    pub text: String,
}

impl Folded {
    /// Why an instance stands inlined.
    fn inlined(&self, instance: &str) -> Option<&str> {
        let found = self.nested.inlined.iter().find(|(name, _)| name == instance);
        found.map(|(_, why)| why.as_str())
    }

    /// The lines of the text with what goes on behind `+`, without comments.
    pub fn cards(&self) -> Vec<String> {
        cards(&self.text)
    }

    /// Whether the certificate holds for a text.
    pub fn holds(&mut self, text: &str) -> bool {
        let netlist = Some(self.map.add("given.cir", text));
        let question = Question { netlist, ..Question::default() };
        let (how, mut d) = (Default::default(), vec![]);
        let found = pipeline::certificate(&mut self.map, &self.model, &question, &how, &mut d);
        found.is_some_and(|(found, _)| found.holds())
    }
}

/// The cards of a text.
pub fn cards(text: &str) -> Vec<String> {
    let mut cards: Vec<String> = vec![];
    for line in text.lines().skip(1).filter(|line| !line.starts_with('*')) {
        let line = line.split(" ; ").next().unwrap_or(line).trim_end();
        match line.strip_prefix('+') {
            Some(rest) => cards.last_mut().unwrap().push_str(rest),
            None => cards.push(line.to_string()),
        }
    }
    cards
}

pub fn folded(name: &str, text: &str) -> Result<Folded, Vec<Diagnostic>> {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    let file = map.add(format!("{name}.bg"), text);
    let model = pipeline::model(&mut map, file, &Overrides::default(), &mut d).ok_or(d)?;
    let nested = model.nested(&map);
    let text = write(&nested.netlist);
    Ok(Folded { map, model, nested, text })
}

#[track_caller]
fn of(text: &str) -> Folded {
    folded("test", text).unwrap_or_else(|d| panic!("{d:#?}\n{text}"))
}

fn shipped() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let folders = [folder.clone(), folder.join("textbook")];
    let entries = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "bg"));
    paths.sort();
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), std::fs::read_to_string(path).unwrap())).collect()
}

fn again(text: &str) -> Netlist {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    let file = map.add("again.cir", text);
    let netlist = read::read(&mut map, file, &Default::default(), &mut d);
    assert!(d.is_empty(), "{d:?}\n{text}");
    netlist
}

/// Nodes and devices.
fn size(text: &str) -> (usize, usize) {
    let mut d = vec![];
    let circuit = flatten(&again(text), &mut d).unwrap_or_else(|| panic!("{d:?}\n{text}"));
    (circuit.nodes.len(), circuit.devices.len())
}

#[test]
fn shipped_models_take_no_more_circuit_in_subcircuits_than_flat_and_their_texts_are_proven() {
    let mut with_subcircuits = 0;
    for (name, text) in shipped() {
        let mut model = folded(&name, &text).unwrap_or_else(|d| panic!("{name}: {d:#?}"));
        if model.model.graph.tree.len() < 2 {
            continue;
        }
        let (nested, flat) = (model.text.clone(), write(&model.model.translation.netlist));
        assert!(nested.contains("\n.subckt "), "{name}");
        assert!(!flat.contains(".subckt"), "{name}");
        assert_eq!(size(&nested), size(&flat), "{name}");
        assert_eq!(model.nested.map.figures, model.model.translation.map.figures, "{name}");
        assert!(model.holds(&nested), "{name}\n{nested}");
        // Every instance is a subcircuit, or a comment says why not.
        for instance in model.model.graph.tree.iter().skip(1) {
            let name = &instance.name;
            let stands = model.nested.subcircuits.iter().any(|(own, _)| own == name);
            let said = nested.contains(&format!("\n* {name} stands inlined:\n"));
            assert!(stands != said, "{name}: {:?}", model.inlined(name));
        }
        with_subcircuits += 1;
    }
    assert!(with_subcircuits >= 14, "{with_subcircuits}");
}

#[test]
fn ten_actuators_are_ten_cards_of_one_subcircuit() {
    let (name, text) = shipped().into_iter().find(|(name, _)| name == "half_wing").unwrap();
    let wing = folded(&name, &text).unwrap_or_else(|d| panic!("{d:#?}"));
    let begins = |what: &str| wing.cards().iter().filter(|card| card.starts_with(what)).count();
    assert_eq!(wing.nested.inlined, []);
    for (model, card) in [("Actuator", "X_eha_"), ("Cable", "X_cable_")] {
        assert_eq!(begins(&format!(".subckt {model}")), 1, "{model}");
        assert_eq!(begins(card), 10, "{card}");
    }
    // What differs stands at the card of each.
    let cables: Vec<String> =
        wing.cards().into_iter().filter(|card| card.starts_with("X_cable_")).collect();
    assert!(cables[6].ends_with("Cable PARAMS: R={7*Rc} L={7*Lc}"), "{cables:#?}");
}

const PI: &str = "model Pi(C = 1) {\n port in a; port out b\n a -> 0:left -> 1:through -> 0:right -> b\n \
                  left -> C:C1(C)\n through -> C:C2(C)\n right -> C:C3(C)\n}\n";

const BRIDGE: &str = "model Bridge(R = 1) {\n port in s; port out d\n s -> 0:top\n top -> 1:a1 -> 0:left -> 1:a3\n \
                      top -> 1:a2 -> 0:right -> 1:a4\n a1 -> R:R1(R)\n a2 -> R:R2(2*R)\n a3 -> R:R3(3*R)\n \
                      a4 -> R:R4(5*R)\n left -> 1:across -> right\n across -> d\n}\n";

/// The − sides of the pi's ports are one node, which a resistance keeps from ground.
#[test]
fn a_pi_of_compliances_keeps_its_return_from_ground() {
    let mut pi = of(&format!(
        "{PI}Se:E(1) -> 1:m -> Pi:pi(C = 2) -> 1:n -> R:Rn(1)\nm -> R:R(1)\nm -> 0:y -> R:Ry(7)\ny -> n\nobserve f(m)\n"
    ));
    let cards = pi.cards();
    assert!(cards.contains(&"X_pi pi_left y pi_right y Pi PARAMS: C=2".to_string()), "{}", pi.text);
    assert!(cards.contains(&"R_Ry y 0 7".to_string()), "{}", pi.text);
    assert_eq!(pi.nested.map.figures.helpers, 0);
    let text = pi.text.clone();
    assert!(pi.holds(&text));
    // As if both sides were grounded.
    assert!(!pi.holds(&text.replace("X_pi pi_left y pi_right y", "X_pi pi_left 0 pi_right 0")));
}

/// The ports of a bridge have no node in common.
#[test]
fn the_diagonals_of_a_bridge_are_two_ports() {
    let mut bridge = of(&format!(
        "{BRIDGE}Se:E(1) -> 1:m -> Bridge:bridge(R = 4) -> 1:n -> R:Rd(5)\nm -> R:Rs(1)\nobserve f(n)\n"
    ));
    let card = "X_bridge bridge_top 0 bridge_left bridge_right Bridge PARAMS: R=4".to_string();
    assert!(bridge.cards().contains(&card), "{}", bridge.text);
    assert_eq!(bridge.nested.map.figures.helpers, 0);
    let text = bridge.text.clone();
    assert!(bridge.holds(&text));
    let shorted =
        text.replace("bridge_top 0 bridge_left bridge_right", "bridge_top 0 bridge_left 0");
    assert!(!bridge.holds(&shorted));
}

/// Both diagonals in one series loop would short an arm: no circuit does that, and a counted coupler stands outside.
#[test]
fn a_bridge_with_both_diagonals_in_one_loop_takes_one_coupler_that_a_comment_names() {
    let mut bridge = of(&format!(
        "{BRIDGE}Se:E(1) -> 1:loop -> Bridge:bridge\nbridge.d -> loop\nloop -> R:Rs(1)\nobserve f(loop)\n"
    ));
    assert_eq!(bridge.nested.inlined, []);
    assert_eq!(bridge.nested.map.figures.helpers, 1);
    assert!(bridge.text.contains("1:1 coupler, closes the loop at loop -> bridge.top"));
    let text = bridge.text.clone();
    assert!(bridge.holds(&text), "{text}");
}

/// The names of the subcircuits of a text that is proven to be its bond graph.
#[track_caller]
fn definitions(text: &str) -> Vec<String> {
    let mut model = of(text);
    assert_eq!(model.nested.inlined, [], "{}", model.text);
    let own = model.text.clone();
    assert!(model.holds(&own), "{own}");
    let definition =
        |card: String| Some(card.strip_prefix(".subckt ")?.split(' ').next()?.to_string());
    let mut found: Vec<String> = model.cards().into_iter().filter_map(definition).collect();
    let mut used: Vec<String> =
        model.nested.subcircuits.into_iter().map(|(_, name)| name).collect();
    found.sort();
    used.sort();
    used.dedup();
    assert_eq!(found, used, "{own}");
    found
}

#[test]
fn instances_share_a_subcircuit_and_variants_are_named_by_what_differs() {
    // A transformer is written by its effort at one port or at the other, as causality has it.
    let tf = "model Tf(n = 2) {\n port in a; port out b\n a -> TF:t(n) -> b\n}\n";
    let two = |load: &str| {
        format!(
            "{tf}Se:E(1) -> Tf:x -> R:load(1)\nSf:F(1) -> Tf:y(n = 3) -> {load}\nobserve e(load)\n"
        )
    };
    assert_eq!(definitions(&two("C:c(1)")), ["Tf", "Tf_causality"]);
    assert_eq!(definitions(&two("R:r(1)").replace("Sf:F", "Se:F")), ["Tf"]);
    // Its load stands before or behind what the model holds in the series loop.
    let cell = "model Cell(R = 1) {\n port in a; port out b\n a -> 1:through -> b\n through -> R:R, I:L(1)\n}\n";
    let chain = format!(
        "{cell}Se:E(1) -> 1:m -> Cell:x -> 0:mid -> Cell:y(R = 3) -> 0:end -> R:load(1)\nm -> R:Rs(1)\nmid -> C:C(1)\n"
    );
    assert_eq!(definitions(&chain.replace("-> 0:end ", "")), ["Cell", "Cell_realisation"]);
    assert_eq!(definitions(&chain), ["Cell"]);
    // The flow of one is read outside: its current has a terminal of its own.
    let chain = format!("{chain}end -> C:Ce(1)\n");
    assert_eq!(
        definitions(&format!("{chain}\nsignal s = integ(2*f(y.through) + 0.1)\n")),
        ["Cell", "Cell_with_s"]
    );
}

/// Two circuits of R and C, 1 − exp(−t/(R·C)) each; the card of one is edited.
#[test]
fn an_edited_card_of_an_instance_changes_that_instance_alone() {
    let mut model =
        of("model Rc(R = 1 Ohm, C = 1 F) {\n port in a\n a -> 1:loop\n loop -> R:R, C:C\n}\n\
                        Se:E(1 V) -> 0:bus\nbus -> Rc:x(R = 2 Ohm)\nbus -> Rc:y(R = 3 Ohm)\n\
                        simulate until 4 s step 0.1 s\nobserve e(x.C) as \"x\", e(y.C) as \"y\"\n");
    let text = model.text.clone();
    assert!(model.holds(&text));
    let edited = text.replace("Rc PARAMS: R=3", "Rc PARAMS: R=0.5 C=3");
    assert_ne!(text, edited);
    assert!(!model.holds(&edited));
    for (text, time_constants) in [(&text, [2.0, 3.0]), (&edited, [2.0, 1.5])] {
        let (trace, _) = run_text("edited.cir", text, &Overrides::default())
            .unwrap_or_else(|d| panic!("{d:#?}\n{text}"));
        for (name, tau) in ["x", "y"].into_iter().zip(time_constants) {
            let values = trace.time().iter().zip(trace.column(name).unwrap());
            let apart = values.map(|(t, v)| (v - (1.0 - (-t / tau).exp())).abs());
            let worst = apart.fold(0.0, f64::max);
            assert!(worst < 1e-5, "{name}: {worst:e}\n{text}");
        }
    }
}

/// What an edited text says wrongly of its subcircuits is an error that names it.
#[test]
fn wrong_cards_of_instances_are_told() {
    let model = of("model Rc(R = 1, C = 1) {\n port in a\n a -> 1:loop\n loop -> R:R, C:C\n}\n\
                    Se:E(1) -> 0:bus -> Rc:x(R = 2)\nsimulate until 1 s step 0.1 s\nobserve e(x.C)\n");
    let card = "X_x bus 0 Rc PARAMS: R=2";
    assert!(model.text.contains(card), "{}", model.text);
    for (wrong, code, named) in [
        ("X_x bus 0 Rx PARAMS: R=2", "E0738", "Rx"),
        ("X_x bus Rc PARAMS: R=2", "E0738", "X_x"),
        ("X_x bus 0 0 Rc PARAMS: R=2", "E0738", "X_x"),
        ("X_x bus 0 Rc PARAMS: Q=2", "E0733", "Q"),
        ("X_x bus 0 Rc PARAMS: R={q}", "E0733", "q"),
    ] {
        let said = run_text("wrong.cir", &model.text.replace(card, wrong), &Overrides::default());
        let said = said.map(|_| ()).unwrap_err();
        let [only] = &said[..] else { panic!("{wrong}: {said:#?}") };
        assert!(only.code == code && only.message.contains(named), "{wrong}: {only:#?}");
    }
}
