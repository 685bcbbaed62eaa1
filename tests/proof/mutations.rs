//! Netlists made wrong, card by card: the certificate refuses every one that is not the same circuit.
//!
//! Sorts of change to flat texts, and to what stands in texts with subcircuits alone, each drawn at random from all places
//! of the shipped models' texts where it can be made. What changes nothing is told apart beforehand, by a reason that is
//! looked up in the text, and not counted; that the certificate holds for those is asserted too, so that a reason cannot
//! hide a change.

mod deck;
mod flat;
mod nested;

use bondspice::cli::pipeline::{self, Question};
use deck::{Deck, Random, deck};
use flat::Sort;
use std::collections::{BTreeMap, HashMap};

/// Wrong texts of each sort.
const EACH: usize = 110;
const SEED: u64 = 2026;

/// Makes changes of each sort until enough of them are refused.
fn all_are_refused(mut decks: Vec<Deck>, sorts: &[(&str, Sort)]) {
    for deck in &mut decks {
        let file = deck.map.add("given.cir", deck.lines.join("\n") + "\n");
        let question = Question { netlist: Some(file), ..Question::default() };
        let mut d = vec![];
        let found = pipeline::certificate(
            &mut deck.map,
            &deck.model,
            &question,
            &Default::default(),
            &mut d,
        );
        assert!(found.is_some_and(|(found, _)| found.holds()), "{}: {d:#?}", deck.name);
    }
    let mut random = Random(SEED);
    let (mut accepted, mut misjudged) = (vec![], vec![]);
    let mut same: BTreeMap<&str, usize> = BTreeMap::new();
    let mut refused: HashMap<&str, usize> = HashMap::new();
    for (sort, make) in sorts {
        let mut tried = 0;
        while *refused.entry(sort).or_default() < EACH && tried < 40 * EACH {
            tried += 1;
            let at = random.below(decks.len());
            let deck = &mut decks[at];
            let Some(change) = make(deck, &mut random) else { continue };
            let mut lines = deck.lines.clone();
            let before = lines[change.line].clone();
            lines.splice(change.line..=change.line, change.by.clone());
            let file = deck.map.add("given.cir", lines.join("\n") + "\n");
            let question = Question { netlist: Some(file), ..Question::default() };
            let mut d = vec![];
            let found = pipeline::certificate(
                &mut deck.map,
                &deck.model,
                &question,
                &Default::default(),
                &mut d,
            );
            let holds = found.is_some_and(|(certificate, _)| certificate.holds());
            let told = || format!("{sort}, {}: `{before}` became {:?}", deck.name, change.by);
            match (change.same, holds) {
                (None, false) => *refused.entry(sort).or_default() += 1,
                (Some(reason), true) => *same.entry(reason).or_default() += 1,
                (None, true) => accepted.push(told()),
                (Some(reason), false) => misjudged.push(format!("{} ({reason})", told())),
            }
        }
    }
    eprintln!("refused {refused:?}; the same: {same:#?}");
    assert!(accepted.is_empty(), "{} wrong texts pass\n{}", accepted.len(), accepted.join("\n"));
    assert!(misjudged.is_empty(), "{} right texts fail\n{}", misjudged.len(), misjudged.join("\n"));
    for (sort, _) in sorts {
        assert!(refused[sort] >= 100, "{sort}: {}", refused[sort]);
    }
}

#[test]
fn every_wrong_text_is_refused() {
    let names = [
        "eha_one_line",
        "servo_axis",
        "plate_transducer",
        "solenoid",
        "buck_pwm",
        "coupled_coils",
        "dc_motor_load",
        "duffing",
        "gear_dep",
        "hydraulic_press",
        "rlc_bridge",
        "two_tank",
        "textbook/A7",
        "textbook/F1",
        "stick_slip",
    ];
    all_are_refused(names.iter().map(|name| deck(name, false)).collect(), flat::SORTS);
}

#[test]
fn every_wrong_text_with_subcircuits_is_refused() {
    let names = [
        "drive_train",
        "servo_axis",
        "step_down",
        "hydraulic_press",
        "lifting_jack",
        "mass_between_stops",
        "rough_belt",
        "reversing_drive",
    ];
    all_are_refused(names.iter().map(|name| deck(name, true)).collect(), nested::SORTS);
}
