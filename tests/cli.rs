//! The command line as users see it: exit codes, what goes where, and what is said about bad input.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Runs the program in a folder.
fn bondspice(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ends by itself")
}

/// A folder with two traces that differ by 1 % of range in `y`.
fn traces() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.csv"), "time,x,y\n0,0,0\n1,1,1.01\n2,2,1\n").unwrap();
    std::fs::write(folder.path().join("b.csv"), "time,x,y\n0,0,0\n1,1,1\n2,2,1\n").unwrap();
    folder
}

#[test]
fn compare_answers_as_diff_does() {
    let folder = traces();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    let same = run(&["compare", "a.csv", "b.csv", "--tolerance", "0.02"]);
    assert_eq!((code(&same), stderr(&same)), (0, String::new()));
    let different = run(&["compare", "a.csv", "b.csv"]);
    assert_eq!((code(&different), stderr(&different)), (1, String::new()));
    insta::assert_snapshot!(stdout(&different));
    let json = run(&["compare", "a.csv", "b.csv", "--format", "json", "--signals", "y"]);
    let value: serde_json::Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(value["schema"], 1);
    assert_eq!(value["verdict"], "different");
    let signal = value["signals"][0].as_object().unwrap();
    for key in ["name", "max", "rms", "at", "range", "tolerance", "skipped"] {
        assert!(signal.contains_key(key), "{key} in {signal:?}");
    }
    assert!((signal["max"].as_f64().unwrap() - 0.01).abs() < 1e-12);
    for trouble in [
        &["compare", "a.csv", "nothing.csv"][..],
        &["compare", "a.csv", "b.csv", "--signals", "z"],
        &["compare", "a.csv"],
        &["compare", "a.csv", "b.csv", "--tolerance", "-1"],
        &["compare", "-", "-"],
    ] {
        let output = run(trouble);
        assert_eq!(code(&output), 2, "{trouble:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{trouble:?}");
    }
}

#[test]
fn messages_come_in_three_forms() {
    let folder = traces();
    let run = |form: &str| {
        let output = bondspice(
            folder.path(),
            &["compare", "nothing.csv", "b.csv", "--message-format", form],
        );
        assert_eq!(code(&output), 2);
        stderr(&output)
    };
    assert_eq!(run("human"), "error[E0901]: no file `nothing.csv`\n\n1 error\n");
    assert_eq!(run("short"), "error[E0901]: no file `nothing.csv`\n");
    let object: serde_json::Value = serde_json::from_str(&run("json")).unwrap();
    assert_eq!(object["code"], "E0901");
    assert_eq!(object["severity"], "error");
    for key in ["message", "labels", "notes", "help", "fix"] {
        assert!(object.get(key).is_some(), "{key}");
    }
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = traces();
    let before = std::fs::read(folder.path().join("b.csv")).unwrap();
    for name in ["b.csv", "./b.csv"] {
        let output = bondspice(folder.path(), &["compare", "a.csv", "b.csv", "-o", name]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("E0906"), "{}", stderr(&output));
    }
    assert_eq!(std::fs::read(folder.path().join("b.csv")).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
}

#[test]
fn help_and_version_are_answers() {
    let here = folder(".");
    let version = bondspice(&here, &["--version"]);
    assert_eq!(stdout(&version), format!("bondspice {}\n", env!("CARGO_PKG_VERSION")));
    for row in bondspice::cli::COMMANDS {
        let output = bondspice(&here, &[row.name, "--help"]);
        assert_eq!(code(&output), 0, "{}", row.name);
        assert!(stdout(&output).contains("Example:"), "{}", row.name);
        assert!(output.stderr.is_empty());
    }
    let output = bondspice(&here, &["compar"]);
    assert_eq!(code(&output), 2);
    assert!(output.stdout.is_empty() && stderr(&output).contains("tip:"));
}
