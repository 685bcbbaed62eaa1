//! Identifiers of MAST for the names of a netlist.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;

/// Words that mean something already, or may do so in some version: section heads, declarations, simulator variables,
/// functions.
const RESERVED: &[&str] = &[
    "element",
    "template",
    "electrical",
    "number",
    "var",
    "val",
    "ref",
    "state",
    "unit",
    "pin",
    "string",
    "enum",
    "struct",
    "union",
    "external",
    "branch",
    "foreign",
    "group",
    "export",
    "parameters",
    "netlist",
    "when",
    "values",
    "control_section",
    "equations",
    "initial_condition",
    "d_by_dt",
    "delay",
    "if",
    "else",
    "for",
    "while",
    "return",
    "time",
    "next_time",
    "dc_domain",
    "dc_init",
    "dc_start",
    "freq_domain",
    "freq_mag",
    "freq_phase",
    "time_domain",
    "time_init",
    "tr_done",
    "undef",
    "inf",
    "temp",
    "i",
    "v",
    "nu",
    "abs",
    "exp",
    "limexp",
    "ln",
    "log",
    "sqrt",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "min",
    "max",
    "int",
    "mod",
    "random",
    "step",
];

/// The identifiers of one scope, none given twice even where case is folded.
pub struct Words<K> {
    given: HashMap<K, String>,
    taken: HashSet<String>,
}

impl<K: Hash + Eq> Words<K> {
    /// A scope in which some words are taken.
    pub fn new(taken: &[&str]) -> Words<K> {
        let taken = RESERVED.iter().chain(taken).map(|word| word.to_string()).collect();
        Words { given: HashMap::new(), taken }
    }

    /// The identifier of a thing: its name where that is free, else with a number.
    pub fn of(&mut self, thing: K, name: &str) -> String {
        if let Some(word) = self.given.get(&thing) {
            return word.clone();
        }
        let plain = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
        let mut stem: String = name.chars().map(plain).collect();
        if !stem.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
            stem.insert(0, 'n');
        }
        let mut word = stem.clone();
        let mut number = 2;
        while !self.taken.insert(word.to_lowercase()) {
            word = format!("{stem}_{number}");
            number += 1;
        }
        self.given.insert(thing, word.clone());
        word
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_plain_and_apart() {
        let mut words = Words::new(&["m"]);
        assert_eq!(words.of(1, "x"), "x");
        assert_eq!(words.of(2, "X"), "X_2");
        assert_eq!(words.of(3, "time"), "time_2");
        assert_eq!(words.of(4, "m"), "m_2");
        assert_eq!(words.of(5, "Ω_ref"), "n__ref");
        assert_eq!(words.of(6, "2a"), "n2a");
        assert_eq!(words.of(1, "x"), "x");
    }
}
