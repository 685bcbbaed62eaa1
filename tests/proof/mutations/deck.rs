//! Texts of shipped models, card by card, and changes to them.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Model};
use bondspice::netlist::dialects::NGSPICE;
use bondspice::netlist::write;
use bondspice::source::SourceMap;
use std::path::Path;

/// Numbers without a pattern (splitmix64, Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// A shipped model and the cards of its text, a line each.
pub struct Deck {
    pub name: String,
    pub map: SourceMap,
    pub model: Model,
    pub lines: Vec<String>,
    /// What the map reads.
    pub map_text: String,
}

/// A model's deck, with its subcircuits or flat.
pub fn deck(name: &str, nested: bool) -> Deck {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("models/{name}.bg"));
    let mut map = SourceMap::default();
    let file = map.add(format!("{name}.bg"), std::fs::read_to_string(path).unwrap());
    let mut d = vec![];
    let model = pipeline::model(&mut map, file, &Overrides::default(), &mut d);
    let model = model.unwrap_or_else(|| panic!("{name}: {d:#?}"));
    let (netlist, circuit) = model.netlist(&map, &NGSPICE, !nested);
    let text = write::write(&netlist);
    let mut lines: Vec<String> = vec![];
    for line in text.lines() {
        let line = line.split(" ; ").next().unwrap_or(line).trim_end();
        match line.strip_prefix('+') {
            Some(rest) if !line.starts_with('*') => {
                let last = lines.last_mut().unwrap();
                // Where it was broken inside braces no blank belongs.
                let open = last.matches('{').count() > last.matches('}').count();
                last.push_str(if open { rest.trim_start() } else { rest });
            }
            _ => lines.push(line.to_string()),
        }
    }
    let map_text = circuit.json(&netlist.names).to_string();
    Deck { name: name.to_string(), map, model, lines, map_text: map_text.to_lowercase() }
}

/// The words of a card; braces and brackets hold together.
pub fn words(line: &str) -> Vec<String> {
    let (mut words, mut depth) = (vec![String::new()], 0);
    for letter in line.chars() {
        match letter {
            '{' | '(' => depth += 1,
            '}' | ')' => depth -= 1,
            ' ' if depth == 0 => {
                words.push(String::new());
                continue;
            }
            _ => {}
        }
        words.last_mut().unwrap().push(letter);
    }
    words.retain(|word| !word.is_empty());
    words
}

pub fn letter(words: &[String]) -> char {
    words[0].chars().next().unwrap_or(' ').to_ascii_uppercase()
}

pub fn is_device(line: &str) -> bool {
    line.chars().next().is_some_and(|c| c.is_ascii_alphabetic())
}

/// Places among the words that are nodes: those that carry the current, and those that control.
pub fn node_places(words: &[String]) -> (Vec<usize>, Vec<usize>) {
    let law = words.iter().any(|word| word.starts_with("VALUE="));
    match letter(words) {
        'K' => (vec![], vec![]),
        'T' => (vec![1, 2, 3, 4], vec![]),
        'S' => (vec![1, 2], vec![3, 4]),
        'E' | 'G' if !law => (vec![1, 2], vec![3, 4]),
        _ => (vec![1, 2], vec![]),
    }
}

/// The value of a linear card: its last word before IC, if that is a value.
pub fn value_place(words: &[String]) -> Option<usize> {
    match letter(words) {
        'R' | 'C' | 'L' => Some(3),
        'V' | 'I' if !words[3].contains('(') || words[3].starts_with('{') => Some(3),
        'F' | 'H' => Some(4),
        'E' | 'G' if !words[3].starts_with("VALUE=") => Some(5),
        'K' => Some(words.len() - 1),
        _ => None,
    }
    .filter(|k| *k < words.len())
}

pub fn inside(word: &str) -> &str {
    word.strip_prefix('{').and_then(|w| w.strip_suffix('}')).unwrap_or(word)
}

pub fn is_zero(word: &str) -> bool {
    inside(word).parse::<f64>() == Ok(0.0)
}

/// A changed text, and the reason why it is the same circuit, if it is.
pub struct Change {
    /// The line that is changed.
    pub line: usize,
    /// The lines in its place.
    pub by: Vec<String>,
    pub same: Option<&'static str>,
}

pub fn change(line: usize, by: Vec<String>, same: Option<&'static str>) -> Option<Change> {
    Some(Change { line, by, same })
}

pub fn replaced(words: &[String], at: usize, by: String) -> String {
    let mut words = words.to_vec();
    words[at] = by;
    words.join(" ")
}
