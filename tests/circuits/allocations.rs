//! Steps take no memory: a run of twice as many steps asks for no more of it.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::{Run, prepare};
use bondspice::sim::Group;
use bondspice::source::SourceMap;
use bondspice::trace::Nowhere;

/// How often a run asks for memory, and its steps.
fn asked(deck: &str, until: &str) -> (u64, u64) {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", deck);
    let overrides = Overrides { until: Some(until.into()), ..Overrides::default() };
    let mut d = vec![];
    let run = prepare(&mut map, file, &overrides, None, &mut d).unwrap_or_else(|| panic!("{d:#?}"));
    let mut steps = 0;
    let info = allocation_counter::measure(|| {
        steps = run.go(&mut Nowhere).unwrap_or_else(|f| panic!("{:#?}", f.diagnostic)).accepted;
    });
    (info.count_total, steps)
}

#[test]
fn steps_of_every_method_take_no_memory() {
    const RC: &str = "a\nV1 in 0 SIN(0 5 1k)\nR1 in out 1k\nC1 out 0 1u\n";
    const LAW: &str = "a\nV1 in 0 SIN(0 5 1k)\nB1 in out I={1e-3*tanh(v(in,out))}\nC1 out 0 1u\nC2 out 0 Q={1n*v(out)^3}\n";
    const DIODE: &str = "a\nV1 in 0 SIN(0 5 1k)\nD1 in out d\nR1 out 0 1k\nC1 out 0 1u\n.model d D(Is=1e-14 Cjo=10p)\n";
    const INDEX_2: &str = "a\nV1 in 0 SIN(0 5 1k)\nC1 in 0 1u\nR1 in out 1k\nC2 out 0 1u\n";
    let circuits = [RC, LAW, DIODE, INDEX_2];
    let methods = ["auto", "rodas5p", "rodas4", "trbdf2", "trap", "gear"];
    for deck in circuits {
        for method in methods {
            let deck = format!("{deck}.tran 10u 1 0 20u\n.options method={method}\n");
            let (few, some) = (asked(&deck, "10m"), asked(&deck, "20m"));
            assert!(some.1 > few.1 + 200, "{method}: {} and {} steps", few.1, some.1);
            let (steps, more) = (some.1 - few.1, some.0.saturating_sub(few.0));
            assert_eq!(more, 0, "{more} times more in {steps} more steps:\n{deck}");
        }
    }
}

#[test]
fn steps_of_runs_abreast_take_no_memory_either() {
    let asked = |until: &str, method: &str| {
        let run = |r: u32| {
            let text = format!(
                "a\nV1 in 0 SIN(0 5 1k)\nB1 in out I={{1e-3*tanh(v(in,out))}}\nR1 out 0 {r}k\nC1 out 0 1u\n\
                 R2 out end 1k\nC2 end 0 1u\nR3 end far 1k\nC3 far 0 1u\n.save v(far)\n.tran 10u 1 0 20u\n\
                 .options method={method}\n"
            );
            let mut map = SourceMap::default();
            let file = map.add("deck.cir", text);
            let overrides = Overrides { until: Some(until.into()), ..Overrides::default() };
            prepare(&mut map, file, &overrides, None, &mut vec![]).unwrap()
        };
        let runs: Vec<Run> = (1..=4).map(run).collect();
        let (mut next, mut steps) = (runs.iter(), 0);
        let info = allocation_counter::measure(|| {
            let begin = |seat| {
                let run = next.next()?;
                Some(async move { run.go_beside(&mut Nowhere, seat).await.0 })
            };
            Group::default().run(4, begin, |result| {
                steps += result.unwrap_or_else(|f| panic!("{:#?}", f.diagnostic)).accepted;
                true
            });
        });
        (info.count_total, steps)
    };
    for method in ["rodas5p", "trbdf2", "trap"] {
        let (few, some) = (asked("10m", method), asked("20m", method));
        assert!(some.1 > few.1 + 800, "{method}: {} and {} steps", few.1, some.1);
        assert_eq!(some.0, few.0, "{method}: {} and {} steps", few.1, some.1);
    }
}

#[test]
fn steps_by_exponentials_take_no_memory_either() {
    let deck = "a\nV1 in 0 PULSE(0 5 1u 1u 1u 20u 50u)\nR1 in out 1k\nC1 out 0 1u\nR2 out more 1k\nC2 more 0 20n\n\
                .tran 10u 1\n.options method=exponential\n";
    let (few, some) = (asked(deck, "10m"), asked(deck, "20m"));
    assert!(some.1 > few.1 + 200, "{} and {} steps", few.1, some.1);
    assert_eq!(some.0, few.0, "{} and {} steps", few.1, some.1);
}
