//! Other simulators, where they are installed.
#![allow(dead_code)]

use std::process::Command;

/// Whether a simulator is there; where it must be and is not, the test fails.
pub fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        missing(program);
    }
    found
}

/// Says that a simulator is missing; where it must be there, the test fails.
pub fn missing(program: &str) {
    let required = std::env::var_os("BONDSPICE_REQUIRE_PEERS").is_some_and(|v| v == "1");
    assert!(!required, "{program} is missing");
    eprintln!("skipped: {program} is missing");
}
