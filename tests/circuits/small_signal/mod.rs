//! Decks run from memory, and the same decks in ngspice with what its `print` says.
#![allow(dead_code)]

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::trace::Trace;
use std::process::Command;

/// The trace of a deck without title and `.end`.
pub fn run(deck: &str) -> Trace {
    match run_text("deck.cir", &format!("title\n{deck}\n.end\n"), &Overrides::default()) {
        Ok((trace, _)) => trace,
        Err(d) => panic!("{deck}\n{d:#?}"),
    }
}

/// The codes of a deck's errors.
pub fn errors(deck: &str) -> Vec<&'static str> {
    let found = run_text("deck.cir", &format!("title\n{deck}\n.end\n"), &Overrides::default());
    found.expect_err(deck).iter().map(|d| d.code).filter(|code| code.starts_with('E')).collect()
}

/// A column that must be there.
pub fn column<'t>(trace: &'t Trace, name: &str) -> &'t [f64] {
    trace.column(name).unwrap_or_else(|| panic!("no {name} in {:?}", trace.names))
}

/// Whether ngspice is there; where it must be and is not, the test fails.
pub fn has_ngspice() -> bool {
    crate::peers::has("ngspice")
}

/// What ngspice says when it runs a deck and then these commands.
pub fn ngspice(deck: &str, commands: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.cir");
    let text = format!(
        "title\n{deck}\n.control\nset numdgt=15\nset width=250\n{commands}\necho\n.endc\n.end\n"
    );
    std::fs::write(&path, text).unwrap();
    let output = Command::new("ngspice").arg("-b").arg(&path).output().unwrap();
    String::from_utf8_lossy(&output.stdout).to_string()
}

/// The numbers after `name = ` in what ngspice printed: one, or the two parts of a complex number.
pub fn printed(said: &str, name: &str) -> Vec<f64> {
    let line = said.lines().find_map(|line| {
        let (own, value) = line.split_once('=')?;
        (own.trim() == name).then_some(value)
    });
    let line = line.unwrap_or_else(|| panic!("no {name} in\n{said}"));
    line.split(',').map(|number| number.trim().parse().unwrap()).collect()
}
