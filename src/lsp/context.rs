//! Where the cursor stands, as far as the text before it tells: what kind of word could come there.
//!
//! The statement is most often unfinished, so that there is no tree of it: the words before the cursor are looked at.

use super::words;
use crate::bond::elaborate::READINGS;

/// What kind of word could come.
#[derive(Clone, Debug, PartialEq)]
pub enum Context {
    /// None that we know.
    Nothing,
    /// The file of an import, with what is written of it.
    Import(String),
    /// A unit.
    Unit,
    /// A statement: its word, a kind, or the name of what is there.
    Statement,
    /// An end of a bond: a kind, or the name of what is there.
    End,
    /// The name of a new element or instance of a kind.
    NewName(String),
    /// What follows after the dot of a path; whether a thing is meant, and not a value.
    Member(Vec<String>, bool),
    /// What can be read.
    Thing,
    /// An argument of an element or instance of a kind: its label, or a value.
    Argument(String),
    /// A value.
    Value,
    /// The name of a parameter, signal or input alone.
    Name,
    /// A domain.
    Domain,
    /// One of these words.
    Words(&'static [&'static str]),
    /// The key of an option.
    OptionKey,
    /// The value of an option.
    OptionValue(String),
}

/// What could come at a byte, and where the word begins that is already written.
pub fn context(text: &str, byte: usize) -> (Context, usize) {
    let before = &text[..super::position::floor(text, byte)];
    let scan = scan(before);
    let statement = &before[scan.statement..];
    match scan.within {
        Within::Comment => return (Context::Nothing, before.len()),
        Within::Text(quote) => {
            let written = before[quote + 1..].to_string();
            let word = first_word(statement.trim_start());
            let context =
                if word == "import" { Context::Import(written) } else { Context::Nothing };
            return (context, quote + 1);
        }
        Within::Code => {}
    }
    // No name begins with a digit: what follows digits at once is a unit.
    let word =
        before.len() - tail_word(before).trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let head = &before[scan.statement..word];
    let context = unit(head, before, word)
        .or_else(|| member(head, &scan, before))
        .unwrap_or_else(|| of_head(head.trim_end(), head.trim_start(), &scan, before));
    (context, word)
}

/// What the text up to the cursor ends within.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Within {
    Code,
    Comment,
    /// A text in quotes; where it begins.
    Text(usize),
}

struct Scan {
    within: Within,
    /// Where the statement begins.
    statement: usize,
    /// Round and square brackets that are open, with their places.
    open: Vec<(char, usize)>,
}

/// Goes over a text once.
fn scan(text: &str) -> Scan {
    let mut scan = Scan { within: Within::Code, statement: 0, open: vec![] };
    // Whether a line's end does not count after the last word.
    let mut goes_on = false;
    for (at, letter) in text.char_indices() {
        match (scan.within, letter) {
            (Within::Comment, '\n') | (Within::Text(_), '\n') | (Within::Code, '\n') => {
                scan.within = Within::Code;
                if scan.open.is_empty() && !goes_on {
                    scan.statement = at + 1;
                }
            }
            (Within::Comment, _) => {}
            (Within::Text(_), '"') => scan.within = Within::Code,
            (Within::Text(_), _) => {}
            (Within::Code, '#') => scan.within = Within::Comment,
            (Within::Code, letter) => {
                match letter {
                    '"' => scan.within = Within::Text(at),
                    '(' | '[' => scan.open.push((letter, at)),
                    ')' | ']' => {
                        scan.open.pop();
                    }
                    '{' | '}' => {
                        scan.open.clear();
                        scan.statement = at + 1;
                    }
                    ';' if scan.open.is_empty() => scan.statement = at + 1,
                    _ => {}
                }
                if !letter.is_whitespace() {
                    let upto = &text[..at + letter.len_utf8()];
                    goes_on = ["->", "->|", ","].iter().any(|sign| upto.ends_with(sign));
                }
            }
        }
    }
    scan
}

/// A unit: after a number and at most one blank, or after the `in` of an `observe`.
fn unit(head: &str, before: &str, word: usize) -> Option<Context> {
    let near = head.strip_suffix(' ').unwrap_or(head);
    let digits = near.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.');
    let number =
        digits.len() < near.len() && near.ends_with(|c: char| c.is_ascii_digit() || c == '.');
    // The digits of a name, of a member and of a range are no number.
    let plain = !digits.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ']');
    let exponent = digits
        .strip_suffix(['e', 'E'])
        .or_else(|| digits.strip_suffix(['-', '+'])?.strip_suffix(['e', 'E']))
        .is_some_and(|rest| rest.ends_with(|c: char| c.is_ascii_digit() || c == '.'));
    // Directly after the digits a word is a unit as soon as it has a letter.
    let written = word < before.len() || near.len() < head.len();
    if number && (plain || exponent) && written && !near[digits.len()..].contains("..") {
        return Some(Context::Unit);
    }
    let observed = first_word(head.trim_start()) == "observe" && head.trim_end().ends_with(" in");
    (observed && head.ends_with(' ')).then_some(Context::Unit)
}

/// What follows after a dot.
fn member(head: &str, scan: &Scan, before: &str) -> Option<Context> {
    let mut rest = head.strip_suffix('.')?;
    let mut names = vec![];
    loop {
        while rest.ends_with(']') {
            rest = &rest[..opening(rest)?];
        }
        let name = tail_word(rest);
        if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        names.push(name.to_string());
        rest = &rest[..rest.len() - name.len()];
        match rest.strip_suffix('.') {
            Some(more) => rest = more,
            None => break,
        }
    }
    names.reverse();
    let thing = match scan.open.last() {
        Some((_, at)) => READINGS.contains(&tail_word(&before[..*at])),
        None => {
            let word = first_word(head.trim_start());
            !words::WORDS.iter().any(|(known, ..)| *known == word)
        }
    };
    Some(Context::Member(names, thing))
}

/// Where the bracket opens that a text ends with.
fn opening(text: &str) -> Option<usize> {
    let mut depth = 0;
    for (at, letter) in text.char_indices().rev() {
        match letter {
            ']' => depth += 1,
            '[' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

fn of_head(head: &str, statement: &str, scan: &Scan, before: &str) -> Context {
    if let Some((bracket, at)) = scan.open.last() {
        return in_bracket(*bracket, *at, head, scan, before);
    }
    let word = first_word(statement);
    let rest = statement[word.len()..].trim();
    // A word of a statement may name an element too: then a sign of chains follows.
    let chain = ["->", "|->", ".", ":", ","].iter().any(|sign| rest.starts_with(sign));
    let after_value = |c: char| c.is_alphanumeric() || "_)]\"%".contains(c);
    match word {
        "" => Context::Statement,
        _ if chain && word != "observe" => of_chain(head),
        "param" | "signal" | "drive" => match (rest.contains('='), word) {
            (true, _) if head.ends_with(after_value) => {
                Context::Words(&["and", "or", "then", "else"])
            }
            (true, _) => Context::Value,
            (false, "drive") if rest.is_empty() => Context::Name,
            _ => Context::Nothing,
        },
        "output" => Context::Name,
        "observe" if rest.is_empty() || head.ends_with(',') => Context::Value,
        "observe" if head.ends_with(after_value) => Context::Words(&["in", "as"]),
        "observe" | "if" => Context::Value,
        "simulate" => Context::Words(&["until", "step"]),
        "port" if rest.is_empty() => Context::Words(&["in", "out"]),
        "port" if rest.ends_with(':') => Context::Domain,
        "options" => match rest.rsplit(',').next().unwrap_or("").split_once('=') {
            Some((key, _)) => Context::OptionValue(key.trim().to_string()),
            None => Context::OptionKey,
        },
        "for" if rest.contains(" in") => Context::Value,
        "loop" if rest.is_empty() => Context::Name,
        "loop" if head.ends_with(after_value) => Context::Words(&["follows"]),
        "loop" if head.ends_with(',') => Context::Words(&["bandwidth", "margin"]),
        "loop" => Context::Value,
        "model" | "input" | "import" | "port" | "for" => Context::Nothing,
        _ => of_chain(head),
    }
}

/// Outside brackets of a chain.
fn of_chain(head: &str) -> Context {
    if ["->", "->|", ","].iter().any(|sign| head.ends_with(sign)) {
        return Context::End;
    }
    match head.strip_suffix(':') {
        Some(kind) => Context::NewName(tail_word(kind.trim_end()).to_string()),
        None => Context::Nothing,
    }
}

fn in_bracket(bracket: char, at: usize, head: &str, scan: &Scan, before: &str) -> Context {
    let outside = before[..at].trim_end();
    if bracket == '(' && READINGS.contains(&tail_word(outside)) {
        return Context::Thing;
    }
    if bracket == '(' && scan.open.len() == 1 {
        let mut name = outside;
        while name.ends_with(']') {
            match opening(name) {
                Some(at) => name = &name[..at],
                None => return Context::Value,
            }
        }
        let kind = name[..name.len() - tail_word(name).len()].trim_end().strip_suffix(':');
        if let (Some(kind), true) = (kind, head.ends_with(['(', ','])) {
            return Context::Argument(tail_word(kind.trim_end()).to_string());
        }
        if first_word(before[scan.statement..].trim_start()) == "model" && !head.ends_with('=') {
            return Context::Nothing;
        }
    }
    Context::Value
}

/// The letters, digits and `_` that a text begins with.
fn first_word(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

/// The letters, digits and `_` that a text ends with.
fn tail_word(text: &str) -> &str {
    let part = |c: &char| c.is_alphanumeric() || *c == '_';
    let length: usize = text.chars().rev().take_while(part).map(char::len_utf8).sum();
    &text[text.len() - length..]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_end(text: &str) -> Context {
        context(text, text.len()).0
    }

    #[test]
    fn statements_and_chains() {
        for text in ["", "R", "1:a\n  pa", "1:a; ", "model M() {\n", "# c\n", "if 1 { "] {
            assert_eq!(at_end(text), Context::Statement, "{text}");
        }
        for text in ["a -> ", "a ->", "a -> R:r, ", "a ->| ", "a |-> b", "a -> b,\n  ", "input -> "]
        {
            assert_eq!(at_end(text), Context::End, "{text}");
        }
        assert_eq!(at_end("a -> MTF:"), Context::NewName("MTF".into()));
        assert_eq!(at_end("R:e"), Context::NewName("R".into()));
        assert_eq!(at_end("a -> R:r(1) "), Context::Nothing);
        assert_eq!(at_end("# R"), Context::Nothing);
    }

    #[test]
    fn units() {
        for text in [
            "param L = 1.2 ",
            "param L = 1.2 m",
            "param L = 12m",
            "R:r(1e-3 O",
            "R:r(.5 O",
            "simulate until 20 ",
            "observe x in ",
            "observe e(a) in ba",
        ] {
            assert_eq!(at_end(text), Context::Unit, "{text}");
        }
        for text in ["param L2 ", "param L = R1 ", "a -> t.1 ", "for k in 1..3 ", "param L = 12"] {
            assert_ne!(at_end(text), Context::Unit, "{text}");
        }
    }

    #[test]
    fn brackets() {
        assert_eq!(at_end("signal x = integ(f(ro"), Context::Thing);
        assert_eq!(at_end("signal x = integ(a*"), Context::Value);
        assert_eq!(at_end("C:c("), Context::Argument("C".into()));
        assert_eq!(at_end("C:c(1, q"), Context::Argument("C".into()));
        assert_eq!(at_end("DcMotor:m[k+1](L = 1, "), Context::Argument("DcMotor".into()));
        assert_eq!(at_end("DcMotor:m(L = "), Context::Value);
        assert_eq!(at_end("model M(L"), Context::Nothing);
        assert_eq!(at_end("model M(L = "), Context::Value);
        assert_eq!(at_end("param x = "), Context::Value);
        assert_eq!(at_end("observe "), Context::Value);
        assert_eq!(at_end("if k > "), Context::Value);
    }

    #[test]
    fn members() {
        let path = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(at_end("a -> motor."), Context::Member(path(&["motor"]), true));
        assert_eq!(at_end("a -> m[k].in.sh"), Context::Member(path(&["m", "in"]), true));
        assert_eq!(at_end("observe e(motor.ro"), Context::Member(path(&["motor"]), true));
        assert_eq!(at_end("signal x = motor."), Context::Member(path(&["motor"]), false));
        assert_eq!(at_end("param x = 1."), Context::Value);
    }

    #[test]
    fn words() {
        assert_eq!(at_end("port "), Context::Words(&["in", "out"]));
        assert_eq!(at_end("port in a : el"), Context::Domain);
        assert_eq!(at_end("options reltol = 1e-3, me"), Context::OptionKey);
        assert_eq!(at_end("options method = "), Context::OptionValue("method".into()));
        assert_eq!(at_end("import \"st"), Context::Import("st".into()));
        assert_eq!(at_end("drive "), Context::Name);
        assert_eq!(at_end("observe x "), Context::Words(&["in", "as"]));
    }

    #[test]
    fn no_place_of_any_text_is_too_odd() {
        let text = "model Φ🚀(L = 1.2 mH { port in s: \"x\n}}]])) e(a -> t.1. ..5e-3 m; # é\n\"\n[[]. ].\n";
        for at in 0..=text.len() + 2 {
            context(text, at);
        }
    }
}
