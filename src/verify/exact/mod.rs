//! The exact part of the certificate: the bond graph's own equations and those of a netlist's text, both solved over two
//! prime fields with random numbers for everything that could be changed; every mapped variable must be equal.
//!
//! The method, and the probability that a wrong text passes, are told in `docs/certificate.md`.

pub mod draw;
pub mod form;
pub mod uncut;
pub mod system;
pub mod bonds;
pub mod text;
pub mod wires;
pub mod floats;
pub mod compare;
pub mod scaled;

use super::report::{Exact, Laws, Mismatch};
use crate::bond::graph::BondGraph;
use crate::linear::{Prime61, Prime62};
use compare::{Drawn, Nothing};
use draw::{Draw, mix};
use text::Text;

/// Draws without a result until a system counts as singular, or a division as one by 0, whatever is drawn.
const TRIES: u64 = 3;

/// The largest degree of an entry of either matrix: M·s with M = k·√(L1·L2), each parameter a square, a few of them
/// multiplied or divided.
const DEGREE: f64 = 16.0;

/// A draw over one of the fields.
type OneDraw<'a> = dyn Fn(Draw) -> Result<Drawn, Nothing> + 'a;

/// Proves or refutes a text. Equal seeds give equal draws.
pub fn prove(graph: &BondGraph, text: &Text<'_>, seed: u64) -> (Exact, Laws) {
    draws(
        &|draw| compare::draw::<Prime61>(graph, text, draw),
        &|draw| compare::draw::<Prime62>(graph, text, draw),
        seed,
    )
}

/// Proves or refutes that a scaled graph is the unscaled one.
pub fn prove_scaled(plain: &BondGraph, scaled: &BondGraph, seed: u64) -> (Exact, Laws) {
    draws(
        &|draw| scaled::draw::<Prime61>(plain, scaled, draw),
        &|draw| scaled::draw::<Prime62>(plain, scaled, draw),
        seed,
    )
}

fn draws(first: &OneDraw<'_>, second: &OneDraw<'_>, seed: u64) -> (Exact, Laws) {
    let fields = [(first, Prime61::MODULUS as f64), (second, Prime62::MODULUS as f64)];
    let mut exact = Exact {
        verdict: "pass",
        seed,
        draws: 0,
        unknowns: 0,
        operations: 0,
        variables: 0,
        probability: 1.0,
        mismatches: vec![],
        singular: None,
    };
    let mut laws = Laws { verdict: "pass", laws: 0, mismatches: vec![] };
    for (field, (draw, modulus)) in fields.iter().enumerate() {
        let mut last = None;
        for attempt in 0..TRIES {
            let seed = mix(seed ^ mix(2 * attempt + field as u64));
            match draw(Draw { seed }) {
                Ok(drawn) => {
                    let size = drawn.unknowns.iter().sum::<usize>() as f64;
                    let compared = (drawn.variables + drawn.laws + drawn.tries) as f64;
                    exact.draws += 1;
                    exact.unknowns = drawn.unknowns.iter().sum();
                    exact.operations = drawn.operations;
                    exact.variables = drawn.variables;
                    exact.probability *= (compared * size * DEGREE / modulus).min(1.0);
                    laws.laws = drawn.laws;
                    merge(&mut exact.mismatches, drawn.mismatches);
                    merge(&mut laws.mismatches, drawn.wrong_laws);
                    last = None;
                    break;
                }
                Err(nothing) => last = Some(nothing),
            }
        }
        if let Some(nothing) = last {
            exact.probability = 1.0;
            merge(&mut exact.mismatches, vec![told(&nothing)]);
            if let Nothing::Singular { circuit: false, .. } = nothing {
                exact.singular = Some(told(&nothing).message);
            }
            break;
        }
    }
    exact.verdict = if exact.mismatches.is_empty() { "pass" } else { "fail" };
    laws.verdict = if laws.mismatches.is_empty() { "pass" } else { "fail" };
    (exact, laws)
}

fn merge(all: &mut Vec<Mismatch>, more: Vec<Mismatch>) {
    for mismatch in more {
        if !all.contains(&mismatch) {
            all.push(mismatch);
        }
    }
}

fn told(nothing: &Nothing) -> Mismatch {
    let list = |names: &[String]| {
        let shown: Vec<&str> = names.iter().take(6).map(String::as_str).collect();
        let more = names.len().saturating_sub(6);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", shown.join(", "))
    };
    match nothing {
        Nothing::Zero => Mismatch::of("", "every draw divides by 0"),
        Nothing::Unknown(what) => Mismatch::of(what, "it has no value"),
        Nothing::Singular { circuit, unknowns, of } => {
            let whose = if *circuit { "circuit" } else { "bond graph" };
            let mut why = format!("the {whose} does not determine {}", list(unknowns));
            if !of.is_empty() {
                why.push_str(&format!("; {} depend on each other", list(of)));
            }
            Mismatch::of(unknowns.first().map_or("", String::as_str), &why)
        }
    }
}
