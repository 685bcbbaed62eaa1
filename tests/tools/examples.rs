//! What comes with the program: example models, completions of shells, manual pages.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn bondspice(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    text
}

fn files(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else {
            let name = path.strip_prefix(root().join("models")).unwrap();
            found.insert(name.to_string_lossy().replace('\\', "/"));
        }
    }
}

#[test]
fn every_shipped_model_is_an_example() {
    let mut there = BTreeSet::new();
    files(&root().join("models"), &mut there);
    there.retain(|name| !name.starts_with("std/"));
    let rows = bondspice::source::examples::EXAMPLES;
    let known: BTreeSet<String> = rows.iter().map(|(name, _)| name.to_string()).collect();
    assert_eq!(known, there, "give each file of models/ a row in src/source/examples.rs");
    let list = stdout(&bondspice(&root(), &["examples"]));
    for name in known.iter().filter_map(|name| name.strip_suffix(".bg")) {
        assert!(list.lines().any(|line| line.starts_with(&format!("{name} "))), "{name}\n{list}");
    }
}

#[test]
fn every_example_is_shown_as_it_is_and_a_copy_of_it_checks() {
    let folder = tempfile::tempdir().unwrap();
    let mut copied = BTreeSet::new();
    for (name, text) in bondspice::source::examples::EXAMPLES {
        let Some(name) = name.strip_suffix(".bg") else { continue };
        assert_eq!(stdout(&bondspice(folder.path(), &["examples", "show", name])), *text);
        let work = format!("work/{name}");
        stdout(&bondspice(folder.path(), &["examples", "copy", name, "-o", &work]));
        let file = format!("{work}/{}.bg", name.rsplit('/').next().unwrap());
        stdout(&bondspice(folder.path(), &["check", &file]));
        copied.insert(file);
    }
    assert!(copied.len() > 20);
}

#[test]
fn a_copy_overwrites_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rlc.bg");
    std::fs::write(&path, "mine").unwrap();
    let output = bondspice(folder.path(), &["examples", "copy", "rlc"]);
    assert_eq!(output.status.code(), Some(5));
    assert_eq!(std::fs::read_to_string(path).unwrap(), "mine");
}

#[test]
fn shells_complete_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stdout(&bondspice(&root(), &["completions", shell]));
        for row in bondspice::cli::COMMANDS {
            assert!(script.contains(row.name), "{shell}: {}", row.name);
        }
        assert!(script.contains("message-format"), "{shell}");
    }
    // What bash itself makes of the script, where there is one.
    let script = stdout(&bondspice(&root(), &["completions", "bash"]));
    let ask = "COMP_WORDS=(bondspice simulate --unt); COMP_CWORD=2; \
        _bondspice bondspice --unt simulate; echo \"${COMPREPLY[@]}\"";
    let Ok(answer) = Command::new("bash").arg("-c").arg(format!("{script}\n{ask}")).output() else {
        eprintln!("passed over: there is no bash");
        return;
    };
    assert_eq!(String::from_utf8_lossy(&answer.stdout).trim(), "--until");
}

#[test]
fn every_command_has_its_page() {
    let folder = tempfile::tempdir().unwrap();
    let into = folder.path().join("man/man1");
    bondspice(folder.path(), &["man", "-o", "man/man1"]);
    let first = stdout(&bondspice(folder.path(), &["man"]));
    assert_eq!(std::fs::read_to_string(into.join("bondspice.1")).unwrap(), first);
    for row in bondspice::cli::COMMANDS {
        let page = std::fs::read_to_string(into.join(format!("bondspice-{}.1", row.name))).unwrap();
        assert!(page.contains(".TH") && page.contains(".SH NAME"), "{page}");
        assert!(page.contains(row.name), "{page}");
        assert!(first.contains(&format!("bondspice\\-{}", row.name)), "{}", row.name);
        let one = stdout(&bondspice(folder.path(), &["man", row.name]));
        assert_eq!(page, one);
    }
    assert!(into.join("bondspice-examples-copy.1").exists());
    let output = bondspice(folder.path(), &["man", "simulat"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("did you mean `simulate`"));
}
