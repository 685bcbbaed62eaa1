//! A hundred random bond graphs in stock ngspice: their netlists, unedited, against our own run of the model.
//!
//! They are the first hundred of the generator's that are well-behaved, which is said beforehand, in terms of the model,
//! of our run alone and of ngspice's alone:
//!
//! - the certificate holds, and nothing is in derivative causality, since ngspice differentiates with its own steps;
//! - no signal remembers (delays, hysteresis, samples), and no input jumps: a jump is emitted as a short ramp;
//! - each observed variable moves, by more than a thousandth of its size and 1e-6, and none exceeds 1e6;
//! - our run takes no more than 5000 steps, so that nothing in it is much faster than ngspice's steps of a millisecond.
//! - ngspice agrees with itself: of a second run with a tenth of the longest step no column is off by more than 5e-4 of
//!   its range, half of what is allowed between its run and ours; and neither ends before its time for want of a step.
//!
//! Each column may differ by 1e-3 of its range. What ngspice cannot read counts as wrong.

use crate::random_graphs::Generator;
use crate::stock_ngspice::ngspice;
use bondspice::bond::elaborate::Overrides;
use bondspice::bond::graph::SignalLaw;
use bondspice::cli::pipeline::{self, Model, Question};
use bondspice::netlist::write::write;
use bondspice::source::SourceMap;
use bondspice::trace::{Trace, compare};

const WANTED: usize = 100;
const TOLERANCE: f64 = 1e-3;
const MOST_STEPS: u64 = 5000;
/// How far ngspice's two runs may be apart.
const WITH_ITSELF: f64 = 5e-4;
const FINER: f64 = 10.0;
/// More seeds than this are not looked at.
const SEEDS: u64 = 2000;

/// The model of a seed and our run of it, if it is well-behaved.
fn well_behaved(seed: u64) -> Option<(Model, Trace)> {
    let text = Generator::text(seed, seed.is_multiple_of(4));
    if ["step(", "delay(", "hysteresis(", "sample("].iter().any(|word| text.contains(word)) {
        return None;
    }
    let mut map = SourceMap::default();
    let (file, mut d) = (map.add("random.bg", text), vec![]);
    let options = vec![("reltol".to_string(), "1e-6".to_string())];
    let precise = Overrides { options, ..Overrides::default() };
    let model = pipeline::model(&mut map, file, &Overrides::default(), &mut d)?;
    let remembers = |law: &SignalLaw| matches!(law, SignalLaw::Memory { .. });
    if !model.causality.dependent.is_empty()
        || model.graph.signals.iter().any(|signal| remembers(&signal.law))
    {
        return None;
    }
    let question = Question { seed: Some(seed), ..Question::default() };
    let how = Default::default();
    let (certificate, _) = pipeline::certificate(&mut map, &model, &question, &how, &mut d)?;
    if !certificate.holds() {
        return None;
    }
    let run = pipeline::prepare(&mut map, file, &precise, None, &mut d)?;
    let mut trace = run.trace();
    let statistics = run.go(&mut trace).ok()?;
    let moves = trace.columns.iter().skip(1).all(|column| {
        let (low, high) = column
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(*value), high.max(*value)));
        let size = low.abs().max(high.abs());
        high - low > (1e-3 * size).max(1e-6) && size < 1e6
    });
    (moves && statistics.accepted <= MOST_STEPS).then_some((model, trace))
}

#[test]
fn a_hundred_random_graphs_agree_with_ngspice() {
    if !ngspice() {
        return;
    }
    let (mut found, mut looked, mut worst, mut wrong) = (0, 0, 0.0f64, vec![]);
    let mut unsure = vec![];
    for seed in 1..=SEEDS {
        if found == WANTED {
            break;
        }
        looked = seed;
        let Some((model, mut reference)) = well_behaved(seed) else { continue };
        let (netlist, map) = (&model.translation.netlist, &model.translation.map);
        let text = write(netlist);
        let name = format!("seed {seed}");
        let runs = [text.clone(), finer(&text)]
            .map(|text| crate::stock_ngspice::run(&name, netlist, map, &text));
        let [trace, again] = match runs {
            [Ok(trace), Ok(again)] => [trace, again],
            [Err(said), _] | [_, Err(said)] if said.contains("Timestep too small") => {
                unsure.push(seed);
                continue;
            }
            [Err(said), _] | [_, Err(said)] => {
                found += 1;
                wrong.push(said);
                continue;
            }
        };
        // ngspice writes its first row after its first step.
        reference.columns.iter_mut().for_each(|column| {
            column.remove(0);
        });
        if apart(&trace, &again).iter().any(|(_, max, _)| max.is_nan() || *max > WITH_ITSELF) {
            unsure.push(seed);
            continue;
        }
        found += 1;
        for (signal, max, at) in apart(&trace, &reference) {
            worst = worst.max(max);
            if max.is_nan() || max > TOLERANCE {
                let error = format!("{signal} by {max:.1e} at {at}");
                eprintln!("{name}: {error}");
                wrong.push(format!("{name}: {error}\n{text}"));
            }
        }
    }
    println!("{found} of the first {looked} seeds; the largest difference is {worst:.1e} of range");
    println!("ngspice does not agree with itself on {unsure:?}");
    assert_eq!(found, WANTED);
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong[..wrong.len().min(2)].join("\n"));
}

/// The text with a tenth of the longest step.
fn finer(text: &str) -> String {
    let line = text.lines().find(|line| line.starts_with(".tran ")).unwrap();
    let mut words: Vec<String> = line.split(' ').map(str::to_string).collect();
    let longest: f64 = words[4].parse().unwrap();
    words[4] = format!("{}", longest / FINER);
    text.replace(line, &words.join(" "))
}

/// The largest difference of each column, in parts of the reference's range, and where.
fn apart(trace: &Trace, reference: &Trace) -> Vec<(String, f64, f64)> {
    let names = reference.names[1..].iter().map(|name| (name.clone(), name.clone()));
    let signals = Some(names.collect());
    let settings = compare::Settings { tolerance: TOLERANCE, rise: None, signals };
    let found = compare::compare(trace, reference, &settings).signals;
    found.into_iter().map(|signal| (signal.name, signal.max, signal.at)).collect()
}
