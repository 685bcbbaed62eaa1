//! A template of MAST as data, and its text.

use super::law::Statement;

/// Lines are broken behind this many characters.
const WIDTH: usize = 100;

/// An element template: pins and refs in the order of its connections, arguments, and what holds between them.
#[derive(Default)]
pub struct Template {
    /// Its name.
    pub name: String,
    /// A line about it.
    pub about: String,
    /// Pins; the first two are `p` and `m`.
    pub pins: Vec<String>,
    /// Currents of other elements.
    pub refs: Vec<String>,
    /// Arguments with what they are when left out.
    pub numbers: Vec<(String, &'static str)>,
    /// Currents of its own, each with an equation.
    pub currents: Vec<String>,
    /// Computed values.
    pub values: Vec<String>,
    /// How they are computed.
    pub statements: Vec<Statement>,
    /// What has a value at the start, and which.
    pub initial: Vec<(String, String)>,
    /// Lines of the equations section.
    pub equations: Vec<String>,
}

impl Template {
    /// One between two pins.
    pub fn new(name: &str, about: &str) -> Template {
        let pins = ["p", "m"].map(String::from).to_vec();
        Template { name: name.to_string(), about: about.to_string(), pins, ..Template::default() }
    }

    /// With arguments; each but for initial values must be given, 1 stands there for the form's sake.
    pub fn numbers(mut self, names: &[&str]) -> Template {
        for name in names {
            let default = if name.starts_with("ic") { "0" } else { "1" };
            self.numbers.push((name.to_string(), default));
        }
        self
    }

    /// With a value.
    pub fn set(mut self, name: &str, value: &str) -> Template {
        self.values.push(name.to_string());
        self.statements.push(Statement::Set(name.to_string(), value.to_string()));
        self
    }

    /// With a state that begins at an argument.
    pub fn start(mut self, state: &str, argument: &str) -> Template {
        self.initial.push((state.to_string(), argument.to_string()));
        self
    }

    /// Its current from p to m; as an unknown of its own where another element takes it.
    pub fn current(mut self, value: &str, taken: bool) -> Template {
        if taken {
            self.name.push_str("_i");
            self.currents.push("i".to_string());
            self.equations.push("i(p->m) += i".to_string());
            self.equations.push(format!("i: i = {value}"));
        } else {
            self.equations.push(format!("i(p->m) += {value}"));
        }
        self
    }

    /// Its voltage from p to m.
    pub fn voltage(mut self, value: &str) -> Template {
        self.currents.push("i".to_string());
        self.equations.push("i(p->m) += i".to_string());
        self.equations.push(format!("i: v(p) - v(m) = {value}"));
        self
    }

    /// Its text.
    pub fn text(&self) -> String {
        let mut text = format!("# {}\n", self.about);
        let connections: Vec<String> = self.pins.iter().chain(&self.refs).cloned().collect();
        let mut head = vec!["element template".to_string(), self.name.clone()];
        head.extend(connections);
        if !self.numbers.is_empty() {
            head.push("=".to_string());
            head.extend(listed(self.numbers.iter().map(|(name, _)| name.clone())));
        }
        line(&mut text, 0, &head);
        let mut declare = |depth: usize, kind: &str, names: Vec<String>| {
            if !names.is_empty() {
                let mut words = vec![kind.to_string()];
                words.extend(listed(names.into_iter()));
                line(&mut text, depth, &words);
            }
        };
        declare(0, "electrical", self.pins.clone());
        declare(0, "ref i", self.refs.clone());
        let numbers = self.numbers.iter().map(|(name, default)| format!("{name} = {default}"));
        declare(0, "number", numbers.collect());
        text.push_str("{\n");
        let mut declare = |kind: &str, names: &[String]| {
            if !names.is_empty() {
                let mut words = vec![kind.to_string()];
                words.extend(listed(names.iter().cloned()));
                line(&mut text, 1, &words);
            }
        };
        declare("var i", &self.currents);
        declare("val nu", &self.values);
        if !self.statements.is_empty() {
            text.push_str("  values {\n");
            statements(&mut text, 2, &self.statements);
            text.push_str("  }\n");
        }
        if !self.initial.is_empty() {
            text.push_str("  control_section {\n");
            for (state, value) in &self.initial {
                text.push_str(&format!("    initial_condition({state}, {value})\n"));
            }
            text.push_str("  }\n");
        }
        text.push_str("  equations {\n");
        for equation in &self.equations {
            line(&mut text, 2, &words(equation));
        }
        text.push_str("  }\n}\n");
        text
    }
}

/// Words with a comma behind each but the last.
pub fn listed(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut words: Vec<String> = names.collect();
    let last = words.len().saturating_sub(1);
    words.iter_mut().take(last).for_each(|word| word.push(','));
    words
}

fn statements(text: &mut String, depth: usize, list: &[Statement]) {
    for statement in list {
        match statement {
            Statement::Set(name, value) => line(text, depth, &words(&format!("{name} = {value}"))),
            Statement::Cases(condition, then, otherwise) => {
                line(text, depth, &words(&format!("if ({condition}) {{")));
                statements(text, depth + 1, then);
                let mut rest = otherwise;
                // A chain of cases stays at its depth.
                while let [Statement::Cases(condition, then, otherwise)] = rest.as_slice() {
                    line(text, depth, &words(&format!("}} else if ({condition}) {{")));
                    statements(text, depth + 1, then);
                    rest = otherwise;
                }
                line(text, depth, &words("} else {"));
                statements(text, depth + 1, rest);
                line(text, depth, &words("}"));
            }
        }
    }
}

/// Begins a word that goes on behind the last one without a blank.
const ON: char = '\u{1}';

/// Words between which a line may be broken: at blanks, and behind `*` and `,` in long formulas.
pub fn words(text: &str) -> Vec<String> {
    let mut words = vec![];
    for word in text.split(' ') {
        let mut rest = word;
        let mut on = String::new();
        while rest.len() > WIDTH / 2
            && let Some(at) = rest.get(..WIDTH / 2).and_then(|piece| piece.rfind(['*', ',']))
            && let Some((piece, more)) = rest.split_at_checked(at + 1)
        {
            words.push(on + piece);
            on = ON.to_string();
            rest = more;
        }
        words.push(on + rest);
    }
    words
}

/// Adds words as a line, continued behind `\` where it would be too long.
pub fn line(text: &mut String, depth: usize, words: &[String]) {
    let indent = "  ".repeat(depth);
    let mut line = indent.clone();
    for (k, word) in words.iter().enumerate() {
        let (on, word) = match word.strip_prefix(ON) {
            Some(word) => (true, word),
            None => (k == 0, word.as_str()),
        };
        if k > 0 && line.len() + word.len() + 3 > WIDTH {
            text.push_str(&line);
            text.push_str(" \\\n");
            line = format!("{indent}    {word}");
        } else {
            if !on {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    text.push_str(&line);
    text.push('\n');
}
