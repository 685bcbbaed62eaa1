//! Models cut at random out of random graphs of junctions: whatever is drawn as a subcircuit is the same circuit, and what
//! enters each of its ports at + leaves it at −, found by solving networks of random conductances.

use super::{cards, folded, size};
use bondspice::netlist::write::write;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;

/// Numbers without a pattern (splitmix64, Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// 0.5 to 1.5.
    fn unit(&mut self) -> f64 {
        0.5 + self.next() as f64 / u64::MAX as f64
    }
}

/// A graph of which some junctions stand in a model.
fn cut(random: &mut Random) -> String {
    let count = 4 + random.below(6);
    let kinds: Vec<usize> = (0..count).map(|_| random.below(2)).collect();
    let inner: Vec<bool> =
        (0..count).map(|k| k == 0 || (k > 1 && random.below(100) < 40)).collect();
    let mut bonds: Vec<[usize; 2]> = (1..count).map(|k| [random.below(k), k]).collect();
    for _ in 0..random.below(4) {
        let pair = [random.below(count), random.below(count)];
        if pair[0] != pair[1] {
            bonds.push(pair);
        }
    }
    let (mut ports, mut inside, mut outside) = (String::new(), String::new(), String::new());
    for k in 0..count {
        let text = if inner[k] { &mut inside } else { &mut outside };
        let element = ["R", "R", "R", "C", "I"][random.below(5)];
        let _ = writeln!(text, "  {}:j{k} -> {element}:e{k}({})", kinds[k], 1 + random.below(9));
    }
    for (at, [from, to]) in bonds.iter().enumerate() {
        match (inner[*from], inner[*to]) {
            (true, true) => drop(writeln!(inside, "  j{from} -> j{to}")),
            (false, false) => drop(writeln!(outside, "  j{from} -> j{to}")),
            (true, false) => {
                let _ = writeln!(ports, "  port out p{at}");
                let _ = writeln!(inside, "  j{from} -> p{at}");
                let _ = writeln!(outside, "  m.p{at} -> j{to}");
            }
            (false, true) => {
                let _ = writeln!(ports, "  port in p{at}");
                let _ = writeln!(inside, "  p{at} -> j{to}");
                let _ = writeln!(outside, "  j{from} -> m.p{at}");
            }
        }
    }
    format!("model M() {{\n{ports}{inside}}}\nM:m\nSe:E(1) -> j1\n{outside}observe f(E)\n")
}

/// A branch of the circuit: its ends, and those by their names in the subcircuit when it stands there.
struct Branch {
    ends: [String; 2],
    local: Option<[String; 2]>,
}

/// The branches of a text with at most one instance, and the terminals of that: each with its node around.
fn branches(text: &str) -> (Vec<Branch>, Vec<(String, String)>) {
    let cards: Vec<Vec<String>> = (cards(text).iter())
        .map(|card| card.split_whitespace().map(str::to_string).collect())
        .collect();
    let ports: Vec<&String> = (cards.iter())
        .filter(|words| words[0] == ".subckt")
        .flat_map(|words| &words[2..])
        .take_while(|word| *word != "PARAMS:")
        .collect();
    let around = cards.iter().find(|words| words[0] == "X_m");
    let around = around.map_or(&[][..], |words| &words[1..=ports.len()]);
    let terminals: Vec<(String, String)> =
        ports.into_iter().cloned().zip(around.iter().cloned()).collect();
    let places: HashMap<&String, &String> = terminals.iter().map(|(a, b)| (a, b)).collect();
    let (mut found, mut within) = (vec![], false);
    for words in &cards {
        within = (within || words[0] == ".subckt") && words[0] != ".ends";
        if !words[0].starts_with(|first: char| "RCLVIEFGH".contains(first)) {
            continue;
        }
        let own = [words[1].clone(), words[2].clone()];
        let place = |name: &String| match places.get(name) {
            Some(node) => (*node).clone(),
            None if name == "0" => name.clone(),
            None => format!("m.{name}"),
        };
        found.push(match within {
            true => Branch { ends: [place(&own[0]), place(&own[1])], local: Some(own) },
            false => Branch { ends: own, local: None },
        });
    }
    (found, terminals)
}

/// The currents of the branches as random conductances beside random sources of current. Each node counts from ground,
/// where anything leads there, else from the first of those it hangs together with.
fn currents(branches: &[Branch], random: &mut Random) -> Vec<f64> {
    let mut nodes: BTreeMap<&String, usize> = BTreeMap::new();
    for end in branches.iter().flat_map(|branch| &branch.ends) {
        let next = nodes.len();
        nodes.entry(end).or_insert(next);
    }
    let count = nodes.len();
    let mut matrix = vec![vec![0.0; count + 1]; count];
    let branches: Vec<([usize; 2], f64, f64)> = (branches.iter())
        .map(|b| ([nodes[&b.ends[0]], nodes[&b.ends[1]]], random.unit(), random.unit()))
        .collect();
    for ([a, b], conductance, source) in &branches {
        for (from, to, sign) in [(*a, *b, 1.0), (*b, *a, -1.0)] {
            matrix[from][from] += conductance;
            matrix[from][to] -= conductance;
            matrix[from][count] -= sign * source;
        }
    }
    // Gauss and Jordan; a node without a pivot stays at 0.
    let mut pivots = vec![None; count];
    let mut used = vec![false; count];
    for column in 0..count {
        let rows = (0..count).filter(|row| !used[*row]);
        let best =
            rows.max_by(|x, y| matrix[*x][column].abs().total_cmp(&matrix[*y][column].abs()));
        let Some(row) = best.filter(|row| matrix[*row][column].abs() > 1e-9) else { continue };
        used[row] = true;
        pivots[column] = Some(row);
        let pivot = matrix[row].clone();
        for (other, values) in matrix.iter_mut().enumerate().filter(|(other, _)| *other != row) {
            let factor = values[column] / pivot[column];
            let _ = other;
            values.iter_mut().zip(&pivot).for_each(|(value, p)| *value -= factor * p);
        }
    }
    let value =
        |node: usize| pivots[node].map_or(0.0, |row| matrix[row][count] / matrix[row][node]);
    branches.iter().map(|([a, b], g, source)| g * (value(*a) - value(*b)) + source).collect()
}

/// What enters a terminal.
fn into(terminal: &str, branches: &[Branch], currents: &[f64]) -> f64 {
    let of = |(branch, current): (&Branch, &f64)| match &branch.local {
        Some([a, b]) => {
            current * (f64::from(u8::from(a == terminal)) - f64::from(u8::from(b == terminal)))
        }
        None => 0.0,
    };
    branches.iter().zip(currents).map(of).sum()
}

#[test]
fn models_cut_at_random_are_the_same_circuit_and_each_terminal_pair_is_a_port() {
    let mut random = Random(7);
    let (mut stand, mut inlined, mut pairs, mut groups) = (0, BTreeMap::new(), 0, 0);
    let count =
        std::env::var("BONDSPICE_GRAPHS").ok().and_then(|text| text.parse().ok()).unwrap_or(120);
    for _ in 0..count {
        let text = cut(&mut random);
        // What has no solution is of no interest here.
        let Ok(mut model) = folded("cut", &text) else { continue };
        let (nested, flat) = (model.text.clone(), write(&model.model.translation.netlist));
        assert_eq!(size(&nested), size(&flat), "{text}\n{nested}");
        if !model.holds(&flat) {
            // Undetermined, as rings of junctions are.
            continue;
        }
        assert!(model.holds(&nested), "{text}\n{nested}");
        if let Some(why) = model.inlined("m") {
            let kind =
                ["meets the rest", "need not leave", "no two nodes", "is shorted", "ground alone"];
            let kind = kind.into_iter().find(|kind| why.contains(kind));
            *inlined.entry(kind.unwrap_or_else(|| panic!("{why}\n{text}"))).or_insert(0) += 1;
            continue;
        }
        stand += 1;
        let (branches, terminals) = branches(&nested);
        let currents = currents(&branches, &mut random);
        // Terminals that are one node around count as one; so do those at ground that the inside takes for one.
        let mut left: Vec<Vec<usize>> =
            (0..terminals.len() / 2).map(|k| vec![2 * k, 2 * k + 1]).collect();
        let idle = |at: usize| {
            let name = &terminals[at].0;
            !branches.iter().filter_map(|b| b.local.as_ref()).flatten().any(|local| local == name)
        };
        let mut joined: Vec<Vec<usize>> = vec![];
        while let Some(mut group) = left.pop() {
            let shares = |other: &Vec<usize>, group: &Vec<usize>| {
                other.iter().any(|a| {
                    group.iter().any(|b| {
                        let (x, y) = (&terminals[*a].1, &terminals[*b].1);
                        x == y && (x != "0" || idle(*a) || idle(*b))
                    })
                })
            };
            while let Some(at) = left.iter().position(|other| shares(other, &group)) {
                group.extend(left.swap_remove(at));
            }
            joined.push(group);
        }
        for group in joined {
            let sum: f64 =
                group.iter().map(|at| into(&terminals[*at].0, &branches, &currents)).sum();
            assert!(sum.abs() < 1e-9, "{sum:e} into {group:?} of {terminals:?}\n{text}\n{nested}");
            pairs += usize::from(group.len() == 2);
            groups += usize::from(group.len() > 2);
        }
    }
    println!("{stand} subcircuits, {pairs} ports alone, {groups} groups; inlined {inlined:?}");
    assert!(
        stand >= 60 && pairs >= 10 && groups >= 30,
        "{stand} subcircuits, {pairs} ports; {inlined:?}"
    );
}
