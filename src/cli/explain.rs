//! `bondspice explain CODE`: what a code means, with a wrong and a right example.
//!
//! The examples are files of the gallery of bad files (`tests/bad`), embedded. Wrong ones are run here, so that what is
//! shown is what the program says; only those that need files beside them show what they are expected to say.

use super::flags::ModelFlags;
use super::output::write_text;
use super::pipeline;
use super::session::{Exit, Session};
use crate::diagnostic::codes::{self, CODES, Code, STAGES};
use crate::diagnostic::gallery::{self, Example, Expected, Part};
use crate::diagnostic::{Diagnostic, Severity, examples, fix, render};
use crate::quantity::nearest;
use crate::source::{FileId, SourceMap, Span};
use clap::{Args, FromArgMatches};
use serde_json::{Value, json};

/// What it does, in a line.
pub const ABOUT: &str = "Explain a code of an error or warning, with a wrong and a right example";

/// An example for the help.
pub const EXAMPLE: &str =
    "Without a code all of them are listed.\n\nExample: bondspice explain E0406";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The code, as E0406; without it all codes are listed
    code: Option<String>,
    /// Form of the answer
    #[arg(long, value_name = "FORM", value_parser = ["text", "json"], default_value = "text")]
    format: String,
}

/// Explains.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    let json = arguments.format == "json";
    let text = match &arguments.code {
        None if json => format!("{}\n", list_json()),
        None => list(),
        Some(word) => match find(word) {
            Ok(code) => {
                let shown = Shown::of(code);
                if json { format!("{}\n", shown.json()) } else { shown.text() }
            }
            Err(error) => return session.fail(*error),
        },
    };
    match write_text(None, &text, session) {
        Ok(()) => Exit::Fine,
        Err(exit) => exit,
    }
}

/// The row of a code, whatever the case of its letter.
fn find(word: &str) -> Result<&'static Code, Box<Diagnostic>> {
    let code = word.trim().to_uppercase();
    if let Some(row) = codes::find(&code) {
        return Ok(row);
    }
    let error = Diagnostic::error("E0949", Span::NONE, format!("no code is called `{word}`"));
    // The same number with another letter is nearer than another number.
    let number = code.trim_start_matches(|c: char| !c.is_ascii_digit());
    let same = CODES.iter().find(|row| !number.is_empty() && row.code.ends_with(number));
    let stage = codes::stage(&code);
    let of_stage = CODES.iter().filter(|row| codes::stage(row.code) == stage);
    let list: Vec<&str> = of_stage.map(|row| row.code).collect();
    let near = same.map(|row| row.code).or_else(|| nearest(&code, list.iter().copied()));
    let error = match stage {
        Some(stage) => error.because(format!("codes of {stage}: {}", list.join(" "))),
        None => error,
    };
    Err(Box::new(match near {
        Some(near) => error.help(format!("did you mean `{near}`? `bondspice explain` lists all")),
        None => error.help("`bondspice explain` lists all"),
    }))
}

/// All codes by stage.
fn list() -> String {
    let mut text = String::new();
    for (first, last, stage, exit) in STAGES {
        let of_stage = |row: &&Code| codes::stage(row.code) == Some(*stage);
        text += &format!("{stage} ({first:04} to {last:04}, exit code {exit})\n");
        for row in CODES.iter().filter(of_stage) {
            text += &format!("  {}  {}\n", row.code, row.title);
        }
        text.push('\n');
    }
    text += "`bondspice explain CODE` shows a wrong and a right example of one.\n";
    text
}

fn list_json() -> Value {
    let row = |row: &Code| {
        json!({
            "code": row.code, "severity": severity(row.code), "title": row.title,
            "stage": codes::stage(row.code),
        })
    };
    json!({ "schema": 1, "codes": CODES.iter().map(row).collect::<Vec<_>>() })
}

fn severity(code: &str) -> &'static str {
    render::severity_name(match code.as_bytes().first() {
        Some(b'E') => Severity::Error,
        Some(b'W') => Severity::Warning,
        _ => Severity::Note,
    })
}

/// A code with its examples.
struct Shown {
    code: &'static Code,
    /// `None` for the few codes that no file can show.
    wrong: Option<Wrong>,
}

/// A wrong example and what would be right.
struct Wrong {
    /// The name of its file.
    name: String,
    example: Example,
    /// Files that it reads, without their notes.
    beside: Vec<(&'static str, String)>,
    /// Its text, and what is said of it.
    map: SourceMap,
    said: Vec<Diagnostic>,
    right: Option<String>,
}

impl Shown {
    fn of(code: &'static Code) -> Shown {
        let wrong = examples::find(code.code).and_then(|(notes, text)| {
            let example = gallery::read(notes, text).ok()?;
            let name = notes.strip_suffix(".expected").unwrap_or(notes).to_string();
            Some(Wrong::of(code.code, name, example))
        });
        Shown { code, wrong }
    }

    fn text(&self) -> String {
        let Code { code, title, explanation } = self.code;
        let stage = codes::stage(code).unwrap_or("");
        let mut text = format!("{}[{code}]: {title} ({stage})\n\n", severity(code));
        text += &wrapped(explanation);
        if let Some(wrong) = &self.wrong {
            text += &wrong.text();
        }
        text
    }

    fn json(&self) -> Value {
        let Code { code, title, explanation } = self.code;
        let example = self.wrong.as_ref().map(|wrong| {
            let said = wrong.said.iter().map(|d| render::json(d, &wrong.map));
            let said: Vec<Value> = said.filter_map(|s| serde_json::from_str(&s).ok()).collect();
            let command = |words: &[String]| wrong.command(words);
            let right = wrong.example.right_command.as_deref().unwrap_or(&wrong.example.command);
            json!({
                "wrong": { "command": command(&wrong.example.command), "text": wrong.example.plain, "says": said },
                "right": { "command": command(right), "text": wrong.right },
            })
        });
        json!({
            "schema": 1, "code": code, "severity": severity(code), "title": title,
            "stage": codes::stage(code), "explanation": explanation, "example": example,
        })
    }
}

impl Wrong {
    fn of(code: &str, name: String, example: Example) -> Wrong {
        let mut map = SourceMap::default();
        let file = map.add(name.clone(), example.plain.clone());
        // Files that it reads are found in the map before any folder is looked into.
        let beside = beside(&example.plain);
        for (name, text) in &beside {
            map.add(*name, text.clone());
        }
        let mut said = vec![];
        if !example.plain.trim().is_empty() {
            run_here(&example, &mut map, file, &mut said);
        }
        let fixed = fix::apply(&example.plain, file, &said);
        let right = match (&example.right, &example.right_command) {
            (Some(right), _) => Some(right.clone()),
            (None, None) if !fixed.1.is_empty() => Some(fixed.0),
            _ => None,
        };
        said.retain(|d| d.code == code);
        if said.is_empty() {
            said = expected(&example, code, file);
        }
        // One of a kind is enough.
        said.truncate(1);
        Wrong { name, example, beside, map, said, right }
    }

    /// The command line of an example as a user types it.
    fn command(&self, words: &[String]) -> String {
        let mut line = String::from("bondspice");
        for word in words {
            let word = word.replace("{}", &self.name);
            let plain = word.chars().all(|c| c.is_alphanumeric() || "-_./=,:".contains(c));
            line +=
                &if plain && !word.is_empty() { format!(" {word}") } else { format!(" '{word}'") };
        }
        line
    }

    fn text(&self) -> String {
        let mut text = format!("\nWrong, as `{}` says:\n\n", self.command(&self.example.command));
        if !self.example.plain.trim().is_empty() {
            text += &indented(&self.example.plain);
            text.push('\n');
        }
        for (name, content) in &self.beside {
            text += &format!("where `{name}` is\n\n{}\n", indented(content));
        }
        for diagnostic in &self.said {
            text += &render::human(diagnostic, &self.map, render::Style::default());
        }
        match (&self.right, &self.example.right_command) {
            (Some(right), None) => text += &format!("\nRight:\n\n{}", indented(right)),
            (Some(right), Some(command)) => {
                let command = self.command(command);
                text += &format!("\nRight, with `{command}`:\n\n{}", indented(right));
            }
            (None, Some(command)) => {
                text += &format!("\nRight:\n\n    {}\n", self.command(command));
            }
            (None, None) => {}
        }
        text
    }
}

/// Runs an example from memory, as far as its command is one that reads one text and the flags of models.
fn run_here(example: &Example, map: &mut SourceMap, file: FileId, d: &mut Vec<Diagnostic>) {
    let Some((command, rest)) = example.command.split_first() else { return };
    if rest.first().map(String::as_str) != Some("{}") {
        return;
    }
    let flags = ModelFlags::augment_args(clap::Command::new("example"));
    let Ok(matches) = flags.try_get_matches_from(rest) else { return };
    let mut silent = Session::default();
    silent.global.quiet = true;
    let flags = ModelFlags::from_arg_matches(&matches).ok();
    let Some(Ok(overrides)) = flags.map(|flags| flags.overrides(&mut silent)) else { return };
    match command.as_str() {
        "check" => drop(pipeline::check(map, file, &overrides, d)),
        "simulate" => {
            if let Some(run) = pipeline::prepare(map, file, &overrides, None, d)
                && let Err(failure) = run.go(&mut run.trace())
            {
                d.push(*failure.diagnostic);
            }
        }
        _ => {}
    }
}

/// What the notes of an example expect of a code.
fn expected(example: &Example, code: &str, file: FileId) -> Vec<Diagnostic> {
    let known = codes::find(code).map_or("", |row| row.code);
    let of_code = example.expected.iter().filter(|expected| expected.code == code);
    of_code
        .map(|expected| {
            let message = expected.message.clone();
            let place = place(example, expected, file);
            let mut diagnostic = match known.as_bytes().first() {
                Some(b'E') => Diagnostic::error(known, place, message),
                Some(b'W') => Diagnostic::warning(known, place, message),
                _ => Diagnostic::note(known, place, message),
            };
            for (part, text) in &expected.more {
                match part {
                    Part::Note => diagnostic.notes.push(text.clone()),
                    Part::Help => diagnostic.help = Some(text.clone()),
                    Part::Label => diagnostic = diagnostic.says(text.clone()),
                    Part::At | Part::Fix => {}
                }
            }
            diagnostic
        })
        .collect()
}

/// Where an expected diagnostic points in the text without notes: at the text that its notes name, else at its line.
fn place(example: &Example, expected: &Expected, file: FileId) -> Span {
    let Some(number) = expected.plain_line.filter(|_| expected.line.is_some()) else {
        return Span::NONE;
    };
    let mut start = 0;
    for (at, line) in example.plain.lines().enumerate() {
        if at + 1 == number {
            let under = expected.more.iter().find(|(part, _)| *part == Part::At);
            let found = under.and_then(|(_, text)| Some((line.find(text.as_str())?, text.len())));
            let (from, length) = found.unwrap_or((0, line.len()));
            return Span::new(file, start + from, start + from + length);
        }
        start += line.len() + 1;
    }
    Span::NONE
}

/// The files beside an example that its text names.
fn beside(plain: &str) -> Vec<(&'static str, String)> {
    let named = examples::BESIDE.iter().filter(|(name, _)| plain.contains(name));
    named
        .map(|(name, text)| {
            let plain = gallery::read(name, text).map(|example| example.plain);
            (*name, plain.unwrap_or_else(|_| text.to_string()))
        })
        .collect()
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("    {line}\n")).collect()
}

/// A paragraph in lines of at most 100 characters.
fn wrapped(text: &str) -> String {
    let mut wrapped = String::new();
    let mut width = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if width > 0 && width + 1 + length > 100 {
            wrapped.push('\n');
            width = 0;
        } else if width > 0 {
            wrapped.push(' ');
            width += 1;
        }
        wrapped += word;
        width += length;
    }
    wrapped.push('\n');
    wrapped
}
