//! The floors of the house: which module may use which. Reads the sources; tests within them may use anything.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The modules from the lowest floor to the highest; each uses only those before it.
const FLOORS: &[&str] = &[
    "source",
    "diagnostic",
    "quantity",
    "linear",
    "expr",
    "trace",
    "bond",
    "circuit",
    "netlist",
    "translate",
    "sim",
    "second",
    "verify",
    "analysis",
    "draw",
    "report",
    "lsp",
    "cli",
];

/// A use of a top-level module by a file.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Use {
    by: String,
    of: String,
    file: String,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found.sort();
}

/// Every source file with its module path and its code, without tests and comments.
fn files() -> Vec<(Vec<String>, String, String)> {
    let mut found = vec![];
    sources(&root(), &mut found);
    let mut files = vec![];
    for path in found {
        let inside = path.strip_prefix(root()).unwrap();
        let name = inside.to_string_lossy().into_owned();
        let mut module: Vec<String> =
            inside.iter().map(|part| part.to_string_lossy().replace(".rs", "")).collect();
        if module.iter().any(|part| part == "tests") || is_test_module(&path) {
            continue;
        }
        if module.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
            module.pop();
        }
        files.push((module, name, code(&std::fs::read_to_string(&path).unwrap())));
    }
    assert!(files.len() > 50, "only {} sources were found", files.len());
    files
}

/// Whether the module that a file belongs to is declared for tests alone.
fn is_test_module(path: &Path) -> bool {
    let name = path.file_stem().unwrap().to_string_lossy();
    let parent = path.parent().unwrap().join("mod.rs");
    let Ok(text) = std::fs::read_to_string(parent) else { return false };
    let lines: Vec<&str> = text.lines().collect();
    lines.windows(2).any(|pair| {
        let declared = pair[1].trim_start_matches("pub(crate) ").strip_prefix("mod ");
        pair[0] == "#[cfg(test)]" && declared == Some(&format!("{name};"))
    })
}

/// The text without comments and without what stands after the first `#[cfg(test)]` before a `mod … {`.
fn code(text: &str) -> String {
    let end = text.match_indices("#[cfg(test)]").find(|(at, _)| {
        let rest = text[*at..].split_whitespace().skip(1).take(3).collect::<Vec<_>>();
        rest.first() == Some(&"mod") && rest.last() == Some(&"{")
    });
    let text = &text[..end.map_or(text.len(), |(at, _)| at)];
    let line = |line: &str| match line.find("//") {
        Some(at) => line[..at].to_string(),
        None => line.to_string(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// The names directly after `crate::`, and after as many `super::` as lead to the crate.
fn uses_of(module: &[String], code: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let first = |rest: &str| -> Vec<String> {
        let rest = rest.trim_start();
        let word = |text: &str| {
            text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
        };
        match rest.strip_prefix('{') {
            None => vec![word(rest)],
            Some(list) => {
                let mut depth = 1;
                let mut item = true;
                let mut found = vec![];
                for (at, letter) in list.char_indices() {
                    match letter {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        ',' if depth == 1 => item = true,
                        c if item && depth == 1 && (c.is_alphanumeric() || c == '_') => {
                            found.push(word(&list[at..]));
                            item = false;
                        }
                        _ => {}
                    }
                    if depth == 0 {
                        break;
                    }
                }
                found
            }
        }
    };
    let boundary = |at: usize| {
        !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$' || c == ':')
    };
    for (at, _) in code.match_indices("crate::").filter(|(at, _)| boundary(*at)) {
        names.extend(first(&code[at + 7..]));
    }
    for (at, _) in code.match_indices("super::").filter(|(at, _)| boundary(*at)) {
        let mut rest = &code[at..];
        let mut level = module.len();
        while let Some(inner) = rest.strip_prefix("super::") {
            rest = inner;
            level = level.saturating_sub(1);
        }
        if level == 0 {
            names.extend(first(rest));
        }
    }
    names.retain(|name| !name.is_empty() && !name.starts_with("__"));
    names
}

fn uses() -> Vec<Use> {
    let mut uses = vec![];
    for (module, file, code) in files() {
        let Some(by) = module.first() else { continue };
        for of in uses_of(&module, &code) {
            if of != *by {
                uses.push(Use { by: by.clone(), of, file: file.clone() });
            }
        }
    }
    uses
}

fn floor(module: &str) -> Option<usize> {
    FLOORS.iter().position(|name| *name == module)
}

#[test]
fn uses_are_found() {
    let module = |path: &str| path.split('/').map(String::from).collect::<Vec<_>>();
    let found = |path: &str, text: &str| {
        uses_of(&module(path), &code(text)).into_iter().collect::<Vec<_>>()
    };
    assert_eq!(found("sim/newton", "use crate::{expr::{Expr, Dag}, linear};"), ["expr", "linear"]);
    assert_eq!(found("sim/newton", "let x = crate::bond::graph::f();"), ["bond"]);
    assert_eq!(found("sim/newton", "use super::super::netlist::Name; super::step();"), ["netlist"]);
    assert_eq!(found("sim", "use super::bond;"), ["bond"]);
    assert!(found("sim/newton", "use super::bond; // crate::bond").is_empty());
    assert!(found("sim", "fn f() {}\n#[cfg(test)]\nmod tests { use crate::bond; }").is_empty());
}

#[test]
fn every_module_has_its_floor() {
    let lib = std::fs::read_to_string(root().join("lib.rs")).unwrap();
    let modules: Vec<&str> =
        lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert_eq!(modules, FLOORS);
}

#[test]
fn modules_use_only_those_below_them() {
    for Use { by, of, file } in uses() {
        let (Some(upper), Some(lower)) = (floor(&by), floor(&of)) else {
            panic!("{file} uses crate::{of}, which has no floor");
        };
        assert!(lower < upper, "{file} uses {of}, which is above {by}");
    }
}

#[test]
fn the_second_route_shares_little_with_the_first() {
    let allowed = ["source", "diagnostic", "quantity", "linear", "expr", "bond"];
    for Use { file, of, .. } in uses().into_iter().filter(|u| u.by == "second") {
        assert!(allowed.contains(&of.as_str()), "{file} uses {of}");
    }
}

#[test]
fn the_simulator_knows_no_text() {
    for Use { file, of, .. } in uses().into_iter().filter(|u| u.by == "sim") {
        assert!(!["netlist", "bond", "translate"].contains(&of.as_str()), "{file} uses {of}");
    }
}

#[test]
fn devices_know_no_matrix() {
    for Use { file, of, .. } in uses().into_iter().filter(|u| u.by == "circuit") {
        assert!(of != "linear", "{file} uses linear");
    }
}

#[test]
fn few_know_bonds_and_netlists_together() {
    let all = uses();
    let knows = |by: &str, of: &str| all.iter().any(|u| u.by == by && u.of == of);
    for module in FLOORS.iter().filter(|m| !["translate", "verify", "cli"].contains(m)) {
        let bonds = *module == "bond" || knows(module, "bond");
        let netlists = *module == "netlist" || knows(module, "netlist");
        assert!(!(bonds && netlists), "{module} knows bonds and netlists");
    }
}

#[test]
fn files_and_terminals_have_their_places() {
    for (module, file, code) in files() {
        let top = module.first().map_or("", String::as_str);
        if !["source", "cli", ""].contains(&top) {
            for word in ["std::fs", "std::env", "File::open", "stdin()"] {
                assert!(!code.contains(word), "{file} reads by itself: {word}");
            }
        }
        if !["cli", ""].contains(&top) {
            for word in ["println!", "print!(", "stdout()", "stderr()", "dbg!"] {
                assert!(!code.contains(word), "{file} prints by itself: {word}");
            }
        }
        for word in ["todo!", "unimplemented!"] {
            assert!(!code.contains(word), "{file} holds {word}");
        }
    }
}
