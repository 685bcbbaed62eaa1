//! The gallery of bad files: each gives exactly the diagnostics that its comments expect. See tests/bad/README.md.

use bondspice::cli::session::{Exit, exit_of};
use bondspice::diagnostic::codes::CODES;
use bondspice::diagnostic::gallery::{self, Example, Expected, Part};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad")
}

/// A bad file and what the program says of it.
struct Bad {
    /// The file's name, or that of the command where there is no file.
    name: String,
    /// What the program is given; `None` for a command without a file of its own.
    bytes: Option<Vec<u8>>,
    example: Example,
    said: Said,
}

/// One call of the program.
#[derive(Debug)]
struct Said {
    exit: i32,
    diagnostics: Vec<Value>,
    /// What is no diagnostic.
    other: String,
    stdout: String,
}

/// Every file of the gallery with what the program says, in the order of their names.
fn gallery() -> &'static [Bad] {
    static GALLERY: OnceLock<Vec<Bad>> = OnceLock::new();
    GALLERY.get_or_init(|| {
        let entries = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
        let mut paths: Vec<PathBuf> = entries.filter(|path| path.is_file()).collect();
        paths.sort();
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        let names: BTreeSet<String> = paths.iter().map(|path| name(path)).collect();
        let mut all = vec![];
        for path in paths {
            let notes = name(&path);
            let noted_elsewhere = names.contains(&format!("{notes}.expected"));
            if notes == "README.md" || noted_elsewhere {
                continue;
            }
            let text = std::fs::read(&path).unwrap();
            let own = notes.strip_suffix(".expected").unwrap_or(&notes).to_string();
            let bytes = match own == notes {
                true => Some(text.clone()),
                false => std::fs::read(folder().join(&own)).ok(),
            };
            let text = String::from_utf8(text).unwrap_or_else(|_| {
                panic!("{notes} is not UTF-8: note what it expects in {notes}.expected")
            });
            let example = gallery::read(&notes, &text).unwrap_or_else(|error| panic!("{error}"));
            let said = run(&own, bytes.as_deref(), &example.command, &["json"]);
            all.push(Bad { name: own, bytes, example, said });
        }
        all
    })
}

/// Copies a folder and all below it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for path in std::fs::read_dir(from).unwrap().map(|entry| entry.unwrap().path()) {
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &to);
        } else {
            std::fs::copy(&path, to).unwrap();
        }
    }
}

/// Runs a command line in a folder that holds the file and those in `with/`; the messages in the form named.
fn run(name: &str, bytes: Option<&[u8]>, command: &[String], form: &[&str]) -> Said {
    let folder = tempfile::tempdir().unwrap();
    copy(&self::folder().join("with"), &folder.path().join("with"));
    if let Some(bytes) = bytes {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let words = command.iter().map(|word| word.replace("{}", name));
    let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(words)
        .arg("--message-format")
        .args(form)
        .current_dir(folder.path())
        .env("NO_COLOR", "1")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    let mut said = Said {
        exit: output.status.code().unwrap_or(-1),
        diagnostics: vec![],
        other: String::new(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
    };
    for line in text.lines() {
        match serde_json::from_str::<Value>(line) {
            Ok(value) if value.is_object() => said.diagnostics.push(value),
            _ => said.other += &format!("{line}\n"),
        }
    }
    said
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or("")
}

fn errors(diagnostics: &[Value]) -> impl Iterator<Item = &Value> {
    diagnostics.iter().filter(|d| d["severity"] == "error")
}

/// The first label's file and line; `None` when it points at no text.
fn place(diagnostic: &Value) -> Option<(&str, usize)> {
    let label = diagnostic["labels"].get(0)?;
    Some((text(label, "file"), label["line"].as_u64()? as usize))
}

/// Why a diagnostic is not the one expected in a file; `None` when it is.
fn differs(expected: &Expected, file: &str, bytes: &[u8], found: &Value) -> Option<String> {
    if found["code"] != expected.code.as_str() {
        return Some("another code".into());
    }
    if place(found) != expected.line.map(|line| (file, line)) {
        return Some(format!("stands at {:?}", place(found)));
    }
    if !text(found, "message").contains(&expected.message) {
        return Some(format!("says `{}`", text(found, "message")));
    }
    for (part, wanted) in &expected.more {
        let labels = found["labels"].as_array().cloned().unwrap_or_default();
        let strings = |list: &Value| -> Vec<String> {
            let list = list.as_array().cloned().unwrap_or_default();
            list.iter().map(|item| item.as_str().unwrap_or("").to_string()).collect()
        };
        let texts: Vec<String> = match part {
            Part::At => {
                let end =
                    |key: &str| labels.first().map_or(0, |l| l[key].as_u64().unwrap() as usize);
                let under = bytes.get(end("start")..end("end")).unwrap_or(b"");
                vec![String::from_utf8_lossy(under).into_owned()]
            }
            Part::Label => labels.iter().map(|label| text(label, "text").to_string()).collect(),
            Part::Note => strings(&found["notes"]),
            Part::Help => vec![text(found, "help").to_string()],
            Part::Fix => vec![text(&found["fix"], "title").to_string()],
        };
        let fits = |text: &String| match part {
            Part::At => text.trim() == wanted,
            _ => text.contains(wanted),
        };
        if !texts.iter().any(fits) {
            return Some(format!("{part:?} is {texts:?}, not `{wanted}`"));
        }
    }
    None
}

/// What the notes of a file and the program disagree about, as lines for a reader.
fn disagreements(bad: &Bad) -> Vec<String> {
    let file = &bad.name;
    let mut wanted: Vec<(String, Vec<u8>, Expected)> = vec![];
    let bytes = bad.bytes.clone().unwrap_or_default();
    for expected in &bad.example.expected {
        wanted.push((file.clone(), bytes.clone(), expected.clone()));
    }
    for other in &bad.example.with {
        let bytes = std::fs::read(folder().join(other)).unwrap();
        let notes = gallery::read(other, &String::from_utf8_lossy(&bytes));
        for expected in notes.unwrap_or_else(|error| panic!("{error}")).expected {
            wanted.push((other.clone(), bytes.clone(), expected));
        }
    }
    let mut found: Vec<&Value> = bad.said.diagnostics.iter().collect();
    let mut said = vec![];
    for (file, bytes, expected) in &wanted {
        let at = found.iter().position(|d| differs(expected, file, bytes, d).is_none());
        match at {
            Some(at) => drop(found.remove(at)),
            None => {
                let near = found.iter().find(|d| d["code"] == expected.code.as_str());
                let why = match near {
                    Some(near) => differs(expected, file, bytes, near).unwrap_or_default(),
                    None => "not said".into(),
                };
                let line = expected.line.map_or("?".into(), |line| line.to_string());
                said.push(format!(
                    "{file}:{line}: expected {} `{}`: {why}",
                    expected.code, expected.message
                ));
            }
        }
    }
    for extra in found {
        let (file, line) = place(extra).unwrap_or((file, 0));
        said.push(format!(
            "{file}:{line}: not noted: {} {}\n        {extra}",
            text(extra, "code"),
            text(extra, "message")
        ));
    }
    if !bad.said.other.is_empty() {
        said.push(format!("{file}: no diagnostic: {}", bad.said.other));
    }
    said
}

#[test]
fn every_file_says_what_it_expects() {
    let said: Vec<String> = gallery().iter().flat_map(disagreements).collect();
    assert!(said.is_empty(), "{}\n\nHow notes are written: tests/bad/README.md", said.join("\n"));
    for bad in gallery() {
        assert!(
            !bad.example.expected.is_empty() || !bad.example.with.is_empty(),
            "{} expects nothing",
            bad.name
        );
    }
}

#[test]
fn exit_codes_follow_the_first_error() {
    for bad in gallery() {
        let first = errors(&bad.said.diagnostics).next();
        let exit = match first {
            // As for `diff`, any trouble of a comparison.
            Some(_) if bad.example.command[0] == "compare" => Exit::Usage,
            Some(error) => exit_of(text(error, "code")),
            None => Exit::Fine,
        };
        assert_eq!(bad.said.exit, exit as i32, "{}", bad.name);
    }
}

/// Codes that no file can show, with the reason.
const IMPOSSIBLE: &[(&str, &str)] = &[
    (
        "E0602",
        "the flows that a circuit does not hold are found from others; this is the net below that",
    ),
    ("E0808", "nobody interrupts a test at a known time; tests/tools/cli.rs does it with a signal"),
    ("E0851", "the circuit runs first and stops at the same corner"),
    ("E0852", "it takes minutes to take so many steps"),
    ("E0904", "a file of more than 1 GiB"),
];

#[test]
fn every_code_is_shown() {
    let noted = |bad: &Bad| -> Vec<String> {
        bad.said.diagnostics.iter().map(|d| text(d, "code").to_string()).collect()
    };
    let shown: BTreeSet<String> = gallery().iter().flat_map(noted).collect();
    let missing: Vec<String> = CODES
        .iter()
        .filter(|row| !IMPOSSIBLE.iter().any(|(code, _)| *code == row.code))
        .filter(|row| !shown.contains(row.code))
        .map(|row| format!("{} ({})", row.code, row.title))
        .collect();
    assert!(
        missing.is_empty(),
        "no bad file shows {}.\nAdd tests/bad/SOME_NAME.bg (or .cir), the smallest that is wrong in this way, with \
         `#~ E0000 part of the message` behind the line that it points at, and `#= …` below with what the line should \
         be. tests/bad/README.md says more.",
        missing.join(", "),
    );
    for (code, why) in IMPOSSIBLE {
        assert!(!shown.contains(*code), "{code} is shown, so this is no reason any more: {why}");
    }
}

/// A message without its names and numbers.
fn shape(message: &str) -> String {
    let mut shape = String::new();
    for (at, piece) in message.split('`').enumerate() {
        match at % 2 {
            0 => shape += piece,
            _ => shape.push('…'),
        }
    }
    let number = |c: char| c.is_ascii_digit();
    let mut plain = String::new();
    let mut before = ' ';
    for letter in shape.chars() {
        if number(letter) {
            if !number(before) {
                plain.push('0');
            }
        } else {
            plain.push(letter);
        }
        before = letter;
    }
    plain
}

#[test]
fn no_two_errors_are_alike() {
    let mut seen: BTreeMap<(String, String), String> = BTreeMap::new();
    let mut alike = vec![];
    for bad in gallery() {
        for error in errors(&bad.said.diagnostics) {
            let key = (text(error, "code").to_string(), shape(text(error, "message")));
            // A file may need the same error several times, as the one that ends in too many.
            if let Some(other) = seen.insert(key.clone(), bad.name.clone())
                && other != bad.name
            {
                alike.push(format!("{} and {}: {} {}", other, bad.name, key.0, key.1));
            }
        }
    }
    assert!(alike.is_empty(), "one file is enough for each of these:\n{}", alike.join("\n"));
}

/// A text with the edits of fixes made; those that overlap an earlier one are left out.
fn mended<'a>(text: &[u8], file: &str, fixes: impl IntoIterator<Item = &'a Value>) -> Vec<u8> {
    let mut edits: Vec<(usize, usize, String)> = vec![];
    for fix in fixes {
        let list = fix["edits"].as_array().unwrap();
        let edit = |edit: &Value| {
            assert_eq!(edit["file"], file, "a fix edits the file that is checked");
            let number = |key: &str| edit[key].as_u64().unwrap() as usize;
            (number("start"), number("end"), text_of(edit))
        };
        let new: Vec<_> = list.iter().map(edit).collect();
        assert!(!new.is_empty(), "a fix without edits: {fix}");
        let overlaps = |(start, end, _): &(usize, usize, String)| {
            edits.iter().any(|(from, to, _)| start < to && from < end || start == from)
        };
        if !new.iter().any(overlaps) {
            edits.extend(new);
        }
    }
    edits.sort();
    let mut text = text.to_vec();
    for (start, end, instead) in edits.iter().rev() {
        text.splice(*start..*end, instead.bytes());
    }
    text
}

fn text_of(edit: &Value) -> String {
    edit["text"].as_str().unwrap().to_string()
}

/// Whether a diagnostic stands among others, wherever.
fn said_again(diagnostic: &Value, others: &[Value]) -> bool {
    let same = |other: &Value| {
        other["code"] == diagnostic["code"] && other["message"] == diagnostic["message"]
    };
    others.iter().any(same)
}

#[test]
fn fixes_mend() {
    let mut count = 0;
    for bad in gallery() {
        let Some(bytes) = &bad.bytes else { continue };
        let with_fix: Vec<&Value> =
            bad.said.diagnostics.iter().filter(|d| d["fix"].is_object()).collect();
        let (name, command) = (&bad.name, &bad.example.command);
        for diagnostic in &with_fix {
            let after = mended(bytes, name, [&diagnostic["fix"]]);
            let text = String::from_utf8_lossy(&after).into_owned();
            let said = run(name, Some(&after), command, &["json"]);
            assert!(
                !said_again(diagnostic, &said.diagnostics),
                "{name}: the fix of {diagnostic} leaves it there:\n{text}"
            );
            for other in errors(&said.diagnostics) {
                assert!(
                    said_again(other, &bad.said.diagnostics),
                    "{name}: the fix of {diagnostic} makes {other}:\n{text}"
                );
            }
            count += 1;
        }
        if with_fix.is_empty() {
            continue;
        }
        let after = mended(bytes, name, with_fix.iter().map(|d| &d["fix"]));
        let text = String::from_utf8_lossy(&after).into_owned();
        let said = run(name, Some(&after), command, &["json"]);
        let left: Vec<_> = errors(&said.diagnostics).collect();
        assert!(
            left.is_empty(),
            "{name}: with all its fixes made, errors remain; put what has no fix into a file of its own\n{text}\n{left:?}"
        );
    }
    assert!(count > 0, "only {count} fixes were tried");
}

#[test]
fn what_is_right_runs() {
    let mut right_of = BTreeSet::new();
    for bad in gallery() {
        // Where there are errors, what else was said may stay.
        let wrong = errors(&bad.said.diagnostics).count() > 0;
        let said = bad.said.diagnostics.iter().filter(|d| !wrong || d["severity"] == "error");
        let codes: BTreeSet<&str> = said.map(|d| text(d, "code")).collect();
        let fixes: Vec<&Value> = bad.said.diagnostics.iter().map(|d| &d["fix"]).collect();
        let all_fixed = wrong
            && bad
                .said
                .diagnostics
                .iter()
                .all(|d| d["severity"] != "error" || d["fix"].is_object());
        let bytes = match (&bad.example.right, &bad.example.right_command) {
            (Some(right), _) => Some(right.clone().into_bytes()),
            (None, Some(_)) => bad.bytes.clone(),
            (None, None) if all_fixed => {
                let fixes = fixes.into_iter().filter(|fix| fix.is_object());
                bad.bytes.as_ref().map(|bytes| mended(bytes, &bad.name, fixes))
            }
            (None, None) => continue,
        };
        let command = bad.example.right_command.as_ref().unwrap_or(&bad.example.command);
        let said = run(&bad.name, bytes.as_deref(), command, &["json"]);
        let left: Vec<_> = said
            .diagnostics
            .iter()
            .filter(|d| d["severity"] == "error" || codes.contains(text(d, "code")))
            .collect();
        assert!(
            left.is_empty() && [0, 1].contains(&said.exit),
            "{}: what should be right is not:\n{}\n{left:?}\n{}",
            bad.name,
            String::from_utf8_lossy(&bytes.unwrap_or_default()),
            said.other
        );
        let gone = bad.said.diagnostics.iter().map(|d| text(d, "code"));
        let gone = gone.filter(|code| said.diagnostics.iter().all(|d| text(d, "code") != *code));
        right_of.extend(gone.map(String::from));
    }
    let shown: BTreeSet<String> = gallery()
        .iter()
        .flat_map(|bad| bad.said.diagnostics.iter().map(|d| text(d, "code").to_string()))
        .collect();
    let missing: Vec<_> = shown.difference(&right_of).collect();
    assert!(
        missing.is_empty(),
        "no bad file of {missing:?} shows what would be right: add a line `#= …` below the wrong one"
    );
}

/// Whether a file's notes say what would be right, or every error of it carries a fix.
fn says_what_is_right(bad: &Bad) -> bool {
    let wanted =
        |d: &&Value| d["severity"] == "error" || errors(&bad.said.diagnostics).count() == 0;
    bad.example.right.is_some()
        || bad.example.right_command.is_some()
        || bad.said.diagnostics.iter().filter(wanted).all(|d| d["fix"].is_object())
}

#[test]
fn every_code_has_its_example_in_the_program() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/diagnostic/examples.rs");
    let mut rows = String::new();
    for row in CODES {
        let notes = |bad: &Bad| {
            let plain = folder().join(&bad.name).is_file()
                && !folder().join(format!("{}.expected", bad.name)).is_file();
            if plain { bad.name.clone() } else { format!("{}.expected", bad.name) }
        };
        let shows = |bad: &&Bad| {
            bad.said.diagnostics.iter().any(|d| text(d, "code") == row.code)
                && says_what_is_right(bad)
        };
        let written = bondspice::diagnostic::examples::find(row.code).map(|(name, _)| name);
        let stays = gallery().iter().filter(shows).find(|bad| Some(notes(bad).as_str()) == written);
        // Of those that say nothing else the smallest.
        let others = |bad: &&Bad| {
            let other = bad.said.diagnostics.iter().filter(|d| text(d, "code") != row.code).count();
            (other, bad.example.plain.len() + 10 * bad.example.command.len(), bad.name.clone())
        };
        if let Some(bad) = stays.or_else(|| gallery().iter().filter(shows).min_by_key(others)) {
            rows += &format!("    \"{}\" \"{}\"\n", row.code, notes(bad));
        }
    }
    let mut beside = String::new();
    for name in text_files_beside() {
        let read = |bad: &Bad| {
            rows.contains(&format!(" \"{}\"\n", bad.name)) && bad.example.plain.contains(&name)
        };
        if gallery().iter().any(read) {
            beside += &format!("    \"{name}\"\n");
        }
    }
    let source = std::fs::read_to_string(&path).unwrap();
    let table = |source: &str, start: &str, rows: &str| -> String {
        let (head, rest) = source.split_once(start).unwrap();
        let (_, tail) = rest.split_once("};").unwrap();
        let rows = if rows.is_empty() { String::new() } else { format!("\n{rows}") };
        format!("{head}{start}{rows}}};{tail}")
    };
    let wanted = table(&source, "= examples! {", &rows);
    let wanted = table(&wanted, "= beside! {", &beside);
    if std::env::var_os("GALLERY").is_some_and(|value| value == "write") {
        std::fs::write(&path, wanted).unwrap();
        return;
    }
    assert_eq!(
        source, wanted,
        "the examples of `bondspice explain` do not fit the files of the gallery.\n\
         Run `GALLERY=write cargo test --test tools gallery`; it writes src/diagnostic/examples.rs."
    );
}

/// The names of the texts in `with/`, as files call them.
fn text_files_beside() -> Vec<String> {
    let entries = std::fs::read_dir(folder().join("with")).unwrap().map(|entry| entry.unwrap());
    let texts = entries.filter(|entry| std::fs::read_to_string(entry.path()).is_ok());
    let mut names: Vec<String> =
        texts.map(|entry| format!("with/{}", entry.file_name().to_string_lossy())).collect();
    names.sort();
    names
}

#[test]
fn every_code_is_explained() {
    for row in CODES {
        let said = run("", None, &["explain".into(), row.code.to_lowercase()], &["json"]);
        assert_eq!((said.exit, said.other.as_str()), (0, ""), "{}", row.code);
        let stdout = said.stdout;
        assert!(stdout.contains(&format!("[{}]: {}", row.code, row.title)), "{stdout}");
        if bondspice::diagnostic::examples::find(row.code).is_some() {
            assert!(stdout.contains("\nWrong, as `bondspice "), "{stdout}");
            assert!(stdout.contains("\nRight"), "{stdout}");
            assert!(stdout.matches(row.code).count() > 1, "the example shows no {stdout}");
        }
        assert!(!stdout.contains("#~") && !stdout.contains("*~"), "{stdout}");
    }
}

/// The keys of a JSON object, in their order.
fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn json_has_the_form_that_programs_rely_on() {
    let place = |value: &Value, of: &Value| {
        assert_eq!(keys(value), ["file", "start", "end", "line", "column", "text"], "{of}");
        let number = |key: &str| value[key].as_u64().unwrap_or_else(|| panic!("{key} in {of}"));
        assert!(value["file"].is_string() && value["text"].is_string(), "{of}");
        assert!(
            number("start") <= number("end") && number("line") > 0 && number("column") > 0,
            "{of}"
        );
    };
    let mut count = 0;
    for diagnostic in gallery().iter().flat_map(|bad| &bad.said.diagnostics) {
        let of = diagnostic;
        let wanted = ["code", "severity", "message", "labels", "notes", "help", "fix"];
        assert_eq!(keys(diagnostic), wanted, "{of}");
        let code = text(diagnostic, "code");
        let row = CODES.iter().find(|row| row.code == code);
        assert!(row.is_some(), "{code} has no row");
        let severity = match &code[..1] {
            "E" => "error",
            "W" => "warning",
            _ => "note",
        };
        assert_eq!(diagnostic["severity"], severity, "{of}");
        let message = text(diagnostic, "message");
        assert!(!message.is_empty() && !message.ends_with('.') && !message.contains('\n'), "{of}");
        for label in diagnostic["labels"].as_array().unwrap() {
            place(label, of);
        }
        assert!(diagnostic["notes"].as_array().unwrap().iter().all(Value::is_string), "{of}");
        assert!(diagnostic["help"].is_string() || diagnostic["help"].is_null(), "{of}");
        if !diagnostic["fix"].is_null() {
            assert_eq!(keys(&diagnostic["fix"]), ["title", "edits"], "{of}");
            assert!(diagnostic["fix"]["title"].is_string(), "{of}");
            for edit in diagnostic["fix"]["edits"].as_array().unwrap() {
                place(edit, of);
            }
        }
        count += 1;
    }
    assert!(count >= 200, "only {count} diagnostics");
}

#[test]
fn short_says_the_same_in_a_line_each() {
    for bad in gallery() {
        let said = run(&bad.name, bad.bytes.as_deref(), &bad.example.command, &["short"]);
        let line = |d: &Value| {
            let place = place(d).map_or(String::new(), |(file, line)| {
                format!("{file}:{line}:{}: ", d["labels"][0]["column"])
            });
            format!("{place}{}[{}]: {}\n", text(d, "severity"), text(d, "code"), text(d, "message"))
        };
        let wanted: String = bad.said.diagnostics.iter().map(line).collect();
        // `explain` and `simulate` end with a word of their own on a good run.
        assert_eq!(said.other, wanted, "{}", bad.name);
        assert_eq!(said.exit, bad.said.exit, "{}", bad.name);
    }
}
