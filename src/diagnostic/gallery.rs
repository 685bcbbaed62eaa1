//! The notes in a bad file: which diagnostics it expects, how it is run, and what would have been right.
//!
//! The files stand in `tests/bad`, whose README says how they are written. A test holds each of them to what the
//! program says, and `bondspice explain` takes its examples from them.

/// A bad file taken apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Example {
    /// Words of the command line; `{}` stands for the file.
    pub command: Vec<String>,
    /// Other files whose notes count too.
    pub with: Vec<String>,
    /// The diagnostics that it must give, in the order of its notes.
    pub expected: Vec<Expected>,
    /// The text without the notes.
    pub plain: String,
    /// The text as it would be right, where the file says so.
    pub right: Option<String>,
    /// The command line as it would be right, where the file says so.
    pub right_command: Option<Vec<String>>,
}

/// One expected diagnostic.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// Its code.
    pub code: String,
    /// The line of its first label, from 1; `None` when it points at no text.
    pub line: Option<usize>,
    /// That line in the text without the notes.
    pub plain_line: Option<usize>,
    /// Part of its message.
    pub message: String,
    /// What else must be said.
    pub more: Vec<(Part, String)>,
}

/// What else of a diagnostic is expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The whole text under the first label.
    At,
    /// Part of what a label says.
    Label,
    /// Part of a note.
    Note,
    /// Part of the help.
    Help,
    /// Part of the title of the fix.
    Fix,
}

const PARTS: &[(&str, Part)] = &[
    ("at", Part::At),
    ("label", Part::Label),
    ("note", Part::Note),
    ("help", Part::Help),
    ("fix", Part::Fix),
];

/// Reads the notes of a file; its name says how they are written.
///
/// # Errors
/// The line and what is wrong with its note.
pub fn read(name: &str, text: &str) -> Result<Example, String> {
    let netlist = name.ends_with(".cir");
    let begins = if netlist { "*" } else { "#" };
    let inside = if netlist { ";~" } else { "#~" };
    let mut example = Example::default();
    let mut plain: Vec<String> = vec![];
    let mut right: Vec<String> = vec![];
    let mut mended = false;
    // Numbers of the lines that are no notes.
    let mut lines: Vec<usize> = vec![];
    // Whether the last line that is no note still stands in the right text.
    let mut last_stands = false;
    for (number, line) in text.lines().enumerate().map(|(at, line)| (at + 1, line)) {
        let wrong = |what: &str| format!("{name}:{number}: {what}");
        let note = line.trim_start().strip_prefix(begins);
        if let Some(words) = note.and_then(|note| note.strip_prefix("!=")) {
            example.right_command = Some(split(words));
        } else if let Some(words) = note.and_then(|note| note.strip_prefix('!')) {
            let words = split(words);
            match words.first().map(String::as_str) {
                Some("with") => example.with.extend(words.into_iter().skip(1)),
                Some(_) => example.command = words,
                None => return Err(wrong("a command line is expected after `!`")),
            }
        } else if let Some(instead) = note.and_then(|note| note.strip_prefix('=')) {
            mended = true;
            if last_stands {
                right.pop();
                last_stands = false;
            }
            let instead = instead.strip_prefix(' ').unwrap_or(instead);
            if !instead.trim().is_empty() {
                right.push(instead.to_string());
            }
        } else {
            let whole = note.and_then(|note| note.strip_prefix('~'));
            let (source, notes): (&str, Vec<&str>) = match whole {
                Some(notes) => ("", notes.split(inside).collect()),
                None => {
                    let mut pieces = line.split(inside);
                    (pieces.next().unwrap_or(""), pieces.collect())
                }
            };
            if whole.is_none() {
                lines.push(number);
                plain.push(source.trim_end().to_string());
                right.push(source.trim_end().to_string());
                last_stands = true;
            }
            for note in notes {
                match note.strip_prefix('|') {
                    None => {
                        let here = usize::from(whole.is_none());
                        let expected = expected(note, &lines, here).map_err(|e| wrong(&e))?;
                        example.expected.push(expected);
                    }
                    Some(more) => {
                        let last = example.expected.last_mut();
                        let last = last.ok_or_else(|| wrong("nothing is continued here"))?;
                        last.more.push(part(more).map_err(|e| wrong(&e))?);
                    }
                }
            }
        }
    }
    if example.command.is_empty() {
        example.command = vec!["check".into(), "{}".into()];
    }
    example.plain = joined(&plain);
    example.right = mended.then(|| joined(&right));
    Ok(example)
}

fn joined(lines: &[String]) -> String {
    lines.iter().map(|line| format!("{line}\n")).collect()
}

/// `^ E0101 message`, the place before it: nothing, `^`, `^^`, `?` or `:3`.
/// `here` is 1 behind the line that it belongs to.
fn expected(note: &str, lines: &[usize], here: usize) -> Result<Expected, String> {
    let carets = note.chars().take_while(|c| *c == '^').count();
    let nowhere = "there is no such line above";
    let (line, rest) = if let Some(rest) = note.strip_prefix('?') {
        (None, rest)
    } else if let Some(rest) = note.strip_prefix(':') {
        let (number, rest) = rest.split_once(' ').unwrap_or((rest, ""));
        (Some(number.parse().map_err(|_| format!("`{number}` is no line"))?), rest)
    } else {
        // On a line of its own a note without a place belongs to the line above too.
        let back = (carets + here).max(1);
        let at = lines.len().checked_sub(back).and_then(|at| lines.get(at));
        (Some(*at.ok_or(nowhere)?), note.get(carets..).unwrap_or(""))
    };
    let (code, message) = rest.trim().split_once(' ').unwrap_or((rest.trim(), ""));
    let digits = code.get(1..).is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()));
    if !(code.len() == 5 && code.starts_with(['E', 'W', 'N']) && digits) {
        return Err(format!("`{code}` is no code: write `~ E0101 part of the message`"));
    }
    if message.trim().is_empty() {
        return Err(format!("part of the message is missing after {code}"));
    }
    let plain_line = line.and_then(|line| lines.iter().position(|at| *at == line)).map(|at| at + 1);
    let (code, message) = (code.to_string(), message.trim().to_string());
    Ok(Expected { code, line, plain_line, message, more: vec![] })
}

/// `help: text`
fn part(text: &str) -> Result<(Part, String), String> {
    let (key, value) = text.split_once(':').unwrap_or((text, ""));
    let row = PARTS.iter().find(|(name, _)| *name == key.trim());
    let (_, part) = row.ok_or("expected `at:`, `label:`, `note:`, `help:` or `fix:` after `~|`")?;
    Ok((*part, value.trim().to_string()))
}

/// Words separated by blanks; quotes keep blanks together.
fn split(line: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![];
    let mut quote = None;
    let mut open = false;
    for letter in line.chars() {
        match quote {
            Some(q) if letter == q => quote = None,
            None if letter == '\'' || letter == '"' => quote = Some(letter),
            None if letter.is_whitespace() => {
                open = false;
                continue;
            }
            _ => {}
        }
        if !open {
            words.push(String::new());
            open = true;
        }
        let mark = letter == '\'' || letter == '"';
        let kept = !mark || quote.is_some_and(|q| q != letter);
        if let (true, Some(word)) = (kept, words.last_mut()) {
            word.push(letter);
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_are_read() {
        let text = "# a graph\n#! simulate {} --drive 'x = 1 m'\nSe:U(1 Vv) #~ E0301 unknown #~ E0302 odd\n\
            #~| help: `V`\n#= Se:U(1 V)\nR:r\n#~ E0403 bond\n#~^^ W0404 twice\n#~? N0947 said\n#~:9 E0101 late\n";
        let example = read("a.bg", text).unwrap();
        assert_eq!(example.command, ["simulate", "{}", "--drive", "x = 1 m"]);
        let found: Vec<_> = example
            .expected
            .iter()
            .map(|e| (e.code.as_str(), e.line, e.message.as_str()))
            .collect();
        assert_eq!(
            found,
            [
                ("E0301", Some(3), "unknown"),
                ("E0302", Some(3), "odd"),
                ("E0403", Some(6), "bond"),
                ("W0404", Some(3), "twice"),
                ("N0947", None, "said"),
                ("E0101", Some(9), "late"),
            ]
        );
        assert_eq!(example.expected[1].more, [(Part::Help, "`V`".to_string())]);
        assert_eq!(example.plain, "# a graph\nSe:U(1 Vv)\nR:r\n");
        assert_eq!(example.right.unwrap(), "# a graph\nSe:U(1 V)\nR:r\n");
    }

    #[test]
    fn netlists_have_their_own_comments() {
        let text = "title # no note\nR1 a 0 1k ;~ E0780 floating\n*~| at: a\n*= R1 a 0 1k\n*= V1 a 0 1\n.op\n";
        let example = read("a.cir", text).unwrap();
        assert_eq!(example.expected[0].line, Some(2));
        assert_eq!(example.expected[0].more, [(Part::At, "a".to_string())]);
        assert_eq!(example.right.unwrap(), "title # no note\nR1 a 0 1k\nV1 a 0 1\n.op\n");
    }

    #[test]
    fn bad_notes_are_told() {
        for (text, told) in [
            ("#~ E0101 x", "no such line"),
            ("x #~ E01 x", "no code"),
            ("x #~ E0101", "part of the message"),
            ("x #~| help: y", "nothing is continued"),
            ("x #~ E0101 y\n#~| hlp: y", "expected `at:`"),
        ] {
            let error = read("a.bg", text).unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
    }
}
