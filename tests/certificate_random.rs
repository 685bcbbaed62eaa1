//! The certificate on random bond graphs: it holds for each that can be solved, and each that cannot is told by name.

mod random_graphs;

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Question};
use bondspice::diagnostic::{Diagnostic, Severity};
use bondspice::source::SourceMap;
use random_graphs::Generator;
use std::collections::BTreeMap;
use std::time::Instant;

/// What became of a graph.
enum Fate {
    /// The certificate holds.
    Proven,
    /// The graph is refused, or found singular: by this code, with a name.
    Told(String),
    /// Anything else.
    Wrong(String),
}

fn errors(d: &[Diagnostic]) -> Vec<&Diagnostic> {
    d.iter().filter(|d| d.severity == Severity::Error).collect()
}

/// Whether an error points at a place of the text, or names something.
fn by_name(d: &Diagnostic) -> bool {
    !d.labels.is_empty() || d.message.contains('`')
}

fn fate(seed: u64) -> Fate {
    let text = Generator::text(seed, seed.is_multiple_of(4));
    let mut map = SourceMap::default();
    let file = map.add("random.bg", text.clone());
    let mut d = vec![];
    let wrong = |why: String| Fate::Wrong(format!("seed {seed}: {why}\n{text}"));
    let Some(model) = pipeline::model(&mut map, file, &Overrides::default(), &mut d) else {
        let errors = errors(&d);
        return match errors.iter().find(|d| by_name(d)) {
            Some(error) => Fate::Told(error.code.to_string()),
            None => wrong(format!("refused without a name: {errors:#?}")),
        };
    };
    let question = Question { seed: Some(seed), ..Question::default() };
    let mut d = vec![];
    match pipeline::certificate(&mut map, &model, &question, &Default::default(), &mut d) {
        Some((found, _)) if found.holds() => Fate::Proven,
        Some((found, _)) => match &found.exact.singular {
            Some(why) if why.contains('(') || why.contains("depend") => {
                Fate::Told("singular".to_string())
            }
            _ => wrong(format!(
                "{:#?}\n{}",
                found
                    .laws
                    .mismatches
                    .iter()
                    .chain(&found.exact.mismatches)
                    .chain(&found.values.mismatches)
                    .take(6)
                    .collect::<Vec<_>>(),
                bondspice::netlist::write::write(&model.translation.netlist)
            )),
        },
        None => wrong(format!("its own text cannot be read: {:#?}", errors(&d))),
    }
}

/// Graphs, or as many as asked for in the environment, from the seed given there.
fn count(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

#[test]
fn random_graphs_are_proven_or_told_by_name() {
    let (first, count) = (count("BONDSPICE_SEED", 1), count("BONDSPICE_GRAPHS", 300));
    let start = Instant::now();
    let (mut proven, mut told, mut wrong) = (0u64, BTreeMap::<String, u64>::new(), vec![]);
    for seed in first..first + count {
        let begin = Instant::now();
        let fate = fate(seed);
        if begin.elapsed().as_secs_f64() > 2.0 {
            eprintln!("seed {seed} takes {:.1} s", begin.elapsed().as_secs_f64());
        }
        match fate {
            Fate::Proven => proven += 1,
            Fate::Told(code) => *told.entry(code).or_default() += 1,
            Fate::Wrong(why) => wrong.push(why),
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("{proven} proven, {told:?} told by name, in {seconds:.1} s");
    let shown = count_shown();
    assert!(
        wrong.is_empty(),
        "{} wrong\n{}",
        wrong.len(),
        wrong[..wrong.len().min(shown)].join("\n")
    );
    assert!(proven >= count / 2, "{proven} of {count} can be solved");
}

fn count_shown() -> usize {
    count("BONDSPICE_SHOWN", 3) as usize
}
