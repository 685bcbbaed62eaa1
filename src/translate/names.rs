//! Names of parameters, nodes and devices that SPICE takes: ASCII, one for each thing after folding case, none
//! reserved. What had to be renamed is remembered for the map.

use crate::netlist::{Name, Names};
use std::collections::{HashMap, HashSet};

/// Words that mean something else than a parameter within expressions (each tried in ngspice, or known of another
/// simulator that reads the same text).
const RESERVED_PARAMETERS: &[&str] = &[
    "time",
    "temper",
    "hertz",
    "pi",
    "e",
    "i",
    "v",
    "if",
    "and",
    "or",
    "not",
    "div",
    "mod",
    "defined",
    "abs",
    "acos",
    "acosh",
    "agauss",
    "arctan",
    "asin",
    "asinh",
    "atan",
    "atan2",
    "atanh",
    "aunif",
    "ceil",
    "cos",
    "cosh",
    "ddt",
    "exp",
    "floor",
    "gauss",
    "idt",
    "int",
    "limit",
    "ln",
    "log",
    "log10",
    "max",
    "min",
    "nint",
    "poly",
    "pow",
    "pwl",
    "pwr",
    "pwrs",
    "sdt",
    "sgn",
    "sin",
    "sinh",
    "sqr",
    "sqrt",
    "stp",
    "table",
    "tan",
    "tanh",
    "temp",
    "ternary_fcn",
    "u",
    "u2",
    "unif",
    "uramp",
    "var",
];

/// Words that mean something else than a node.
const RESERVED_NODES: &[&str] =
    &["0", "gnd", "time", "temp", "temper", "hertz", "frequency", "pi", "e", "i", "v", "if"];

/// Letters outside ASCII that have a name of their own.
const LETTERS: &[(char, &str)] = &[
    ('α', "alpha"),
    ('β', "beta"),
    ('γ', "gamma"),
    ('δ', "delta"),
    ('ε', "epsilon"),
    ('ϵ', "epsilon"),
    ('ζ', "zeta"),
    ('η', "eta"),
    ('θ', "theta"),
    ('ϑ', "theta"),
    ('ι', "iota"),
    ('κ', "kappa"),
    ('λ', "lambda"),
    ('μ', "mu"),
    ('µ', "mu"),
    ('ν', "nu"),
    ('ξ', "xi"),
    ('ο', "omicron"),
    ('π', "pi"),
    ('ρ', "rho"),
    ('σ', "sigma"),
    ('ς', "sigma"),
    ('τ', "tau"),
    ('υ', "upsilon"),
    ('φ', "phi"),
    ('ϕ', "phi"),
    ('χ', "chi"),
    ('ψ', "psi"),
    ('ω', "omega"),
    ('Α', "Alpha"),
    ('Β', "Beta"),
    ('Γ', "Gamma"),
    ('Δ', "Delta"),
    ('Ε', "Epsilon"),
    ('Ζ', "Zeta"),
    ('Η', "Eta"),
    ('Θ', "Theta"),
    ('Ι', "Iota"),
    ('Κ', "Kappa"),
    ('Λ', "Lambda"),
    ('Μ', "Mu"),
    ('Ν', "Nu"),
    ('Ξ', "Xi"),
    ('Ο', "Omicron"),
    ('Π', "Pi"),
    ('Ρ', "Rho"),
    ('Σ', "Sigma"),
    ('Τ', "Tau"),
    ('Υ', "Upsilon"),
    ('Φ', "Phi"),
    ('Χ', "Chi"),
    ('Ψ', "Psi"),
    ('Ω', "Omega"),
    ('ä', "ae"),
    ('ö', "oe"),
    ('ü', "ue"),
    ('Ä', "Ae"),
    ('Ö', "Oe"),
    ('Ü', "Ue"),
    ('ß', "ss"),
    ('é', "e"),
    ('è', "e"),
    ('ê', "e"),
    ('ë', "e"),
    ('É', "E"),
    ('È', "E"),
    ('à', "a"),
    ('â', "a"),
    ('á', "a"),
    ('ç', "c"),
    ('ñ', "n"),
    ('ô', "o"),
    ('ó', "o"),
    ('î', "i"),
    ('ï', "i"),
    ('í', "i"),
    ('û', "u"),
    ('ù', "u"),
    ('ú', "u"),
    ('å', "a"),
    ('ø', "o"),
    ('æ', "ae"),
];

/// A name that differs from what the bond graph says.
#[derive(Clone, Debug, PartialEq)]
pub struct Renamed {
    /// In the bond graph.
    pub from: String,
    /// In the netlist.
    pub to: String,
}

/// What a node or a device is called after in the bond graph, by its full name there: `eha[2].motor.rotor`.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// The full name.
    pub name: String,
    /// A device's letter.
    pub letter: char,
}

/// Gives out names, each once. Parameters, nodes and devices are three spaces.
#[derive(Default)]
pub struct Namer {
    /// The names given out.
    pub names: Names,
    /// What had to be renamed.
    pub renamed: Vec<Renamed>,
    /// What nodes are called after.
    pub node_wishes: HashMap<Name, Wish>,
    /// What devices are called after.
    pub device_wishes: HashMap<Name, Wish>,
    parameters: HashSet<String>,
    nodes: HashSet<String>,
    devices: HashSet<String>,
}

impl Namer {
    /// A fresh name for a parameter.
    pub fn parameter(&mut self, wanted: &str) -> Name {
        let name = fresh(&mut self.parameters, RESERVED_PARAMETERS, &ascii(wanted));
        self.give(wanted, name)
    }

    /// A fresh name for a node.
    pub fn node(&mut self, wanted: &str) -> Name {
        let name = fresh(&mut self.nodes, RESERVED_NODES, &ascii(wanted));
        let name = self.give(wanted, name);
        self.node_wishes.insert(name, Wish { name: wanted.to_string(), letter: ' ' });
        name
    }

    /// A fresh name for a node within a series loop, numbered after the loop's junction.
    pub fn inner_node(&mut self, junction: &str) -> Name {
        let name = fresh(&mut self.nodes, RESERVED_NODES, &ascii(junction));
        let name = self.names.intern(&name);
        self.node_wishes.insert(name, Wish { name: junction.to_string(), letter: ' ' });
        name
    }

    /// A fresh name for a device: its letter, `_` and the element's name, unless that begins so already.
    pub fn device(&mut self, letter: char, wanted: &str) -> Name {
        let ascii = ascii(wanted);
        let mut begin = ascii.chars();
        let begins = begin.next().is_some_and(|first| first.eq_ignore_ascii_case(&letter));
        let full =
            if begins && begin.next() == Some('_') { ascii } else { format!("{letter}_{ascii}") };
        let name = fresh(&mut self.devices, &[], &full);
        if name != full {
            self.renamed.push(Renamed { from: full, to: name.clone() });
        }
        let name = self.names.intern(&name);
        self.device_wishes.insert(name, Wish { name: wanted.to_string(), letter });
        name
    }

    /// The same for what belongs to a part of the bond graph that its name does not begin with.
    pub fn device_of(&mut self, letter: char, wanted: &str, full: String) -> Name {
        let name = self.device(letter, wanted);
        self.device_wishes.insert(name, Wish { name: full, letter });
        name
    }

    /// A fresh name for a subcircuit.
    pub fn subcircuit(&mut self, wanted: &str) -> Name {
        let name = fresh(&mut self.nodes, &[], &ascii(wanted));
        self.names.intern(&name)
    }

    fn give(&mut self, wanted: &str, name: String) -> Name {
        if name != wanted {
            self.renamed.push(Renamed { from: wanted.to_string(), to: name.clone() });
        }
        self.names.intern(&name)
    }
}

/// What the names of two parts have in common of the instances that they stand in, `eha[2].`.
pub fn common_part<'a>(a: &'a str, b: &str) -> &'a str {
    let same = a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count();
    a.get(..same).and_then(|same| same.rfind('.')).map_or("", |dot| &a[..=dot])
}

/// `wanted`, or with `_2`, `_3` … where it is taken or reserved.
fn fresh(taken: &mut HashSet<String>, reserved: &[&str], wanted: &str) -> String {
    let mut name = wanted.to_string();
    let mut number = 1;
    while reserved.contains(&name.to_lowercase().as_str()) || !taken.insert(name.to_lowercase()) {
        number += 1;
        name = format!("{wanted}_{number}");
    }
    name
}

/// A name in ASCII letters, digits and `_`, beginning with a letter or `_`.
fn ascii(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        match letter {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '_' => text.push(letter),
            '.' | '[' | ' ' => text.push('_'),
            ']' => {}
            _ => match LETTERS.iter().find(|row| row.0 == letter) {
                Some((_, spelled)) => text.push_str(spelled),
                None => text.push_str(&format!("u{:x}", letter as u32)),
            },
        }
    }
    if text.starts_with(|first: char| first.is_ascii_digit()) || text.is_empty() {
        text.insert(0, '_');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(namer: &Namer, name: Name) -> &str {
        namer.names.text(name)
    }

    #[test]
    fn devices_carry_their_letter_once() {
        let mut namer = Namer::default();
        for (letter, wanted, full) in [
            ('R', "R", "R_R"),
            ('R', "R_eta", "R_eta"),
            ('L', "J1", "L_J1"),
            ('L', "L1", "L_L1"),
            ('C', "Φ", "C_Phi"),
        ] {
            let name = namer.device(letter, wanted);
            assert_eq!(text(&namer, name), full);
        }
        assert_eq!(namer.renamed, []);
    }

    #[test]
    fn names_that_spice_would_fold_or_misread_get_a_suffix() {
        let mut namer = Namer::default();
        let names =
            ["M", "m", "pi", "Ω", "Omega", "motor.L", "eha[2].x"].map(|wanted| namer.node(wanted));
        let texts = names.map(|name| text(&namer, name).to_string());
        assert_eq!(texts, ["M", "m_2", "pi_2", "Omega", "Omega_2", "motor_L", "eha_2_x"]);
        assert!(namer.renamed.contains(&Renamed { from: "m".into(), to: "m_2".into() }));
        // A parameter of the same name is another thing.
        let name = namer.parameter("M");
        assert_eq!(text(&namer, name), "M");
    }
}
