//! The files for editors: the grammar of colours is written from the tables of the crate, the snippets are bond graphs,
//! the files of the extension belong together. `UPDATE=1 cargo test --test tools editors` writes the grammar anew.

use bondspice::bond::elaborate::{READINGS, forms};
use bondspice::bond::elements::ELEMENTS;
use bondspice::bond::syntax::{self, STATEMENT_WORDS};
use bondspice::expr::FUNCTIONS;
use bondspice::quantity::{DOMAINS, PREFIXES, SYMBOLS};
use bondspice::source::SourceMap;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("editors/vscode")
}

fn text(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn parsed(name: &str) -> Value {
    serde_json::from_str(&text(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Words as alternatives of a pattern, longer ones first where one begins another.
fn any<'w>(words: impl IntoIterator<Item = &'w str>) -> String {
    let mut words: Vec<&str> = words.into_iter().collect();
    words.sort_by_key(|word| (std::cmp::Reverse(word.chars().count()), word.to_string()));
    words.dedup();
    words.join("|")
}

/// The grammar of colours.
fn grammar() -> Value {
    const NAME: &str = r"[\p{L}_][\p{L}\d_]*";
    let end = r"(?![\p{L}\d_])";
    let begin = r"(?<![\p{L}\d_.])";
    let statements = any(STATEMENT_WORDS.iter().copied());
    let kinds = any(ELEMENTS.iter().map(|row| row.kind));
    let plain = FUNCTIONS.iter().map(|row| row.name);
    let functions = any(plain.chain(forms().map(|(name, _)| name)).chain(["sum"]));
    let readings = any(READINGS);
    let domains = any(DOMAINS.iter().map(|row| row.name));
    let prefixes = any(PREFIXES.iter().map(|(prefix, _)| *prefix));
    let scaled = any(SYMBOLS.iter().filter(|row| row.prefixes).map(|row| row.name));
    let symbols = any(SYMBOLS.iter().map(|row| row.name));
    let name = format!("(?:(?:{symbols})|(?:{prefixes})(?:{scaled})){end}");
    let exponent = r"(?:\^(?:-?\d+(?:\.\d+)?|\(-?\d+/\d+\)))?";
    let factor =
        format!(r"(?:{name}{exponent}|\({name}{exponent}(?:[*/]{name}{exponent})*\){exponent})");
    let unit = format!(r"{name}{exponent}(?:[*/]{factor})*");
    let number = r"(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?:[eE][+-]?\d+)?";
    let starts = r"(^|[;{}])\s*";
    let statement = |word: &str| format!(r"{starts}({word}){end}");
    // A word of a statement may name an element: then a sign of chains follows.
    let no_name = r"(?!\s*(?:->|\|->|\.|,|\[|$))";
    json!({
        "$schema": "https://raw.githubusercontent.com/martinring/tmlanguage/master/tmlanguage.json",
        "name": "Bond graph",
        "scopeName": "source.bg",
        "fileTypes": ["bg"],
        "patterns": [
            { "include": "#comment" },
            { "include": "#text" },
            {
                "comment": "the head of a model",
                "match": format!(r"{}\s+({NAME})", statement("model")),
                "captures": {
                    "2": { "name": "keyword.declaration.bg" },
                    "3": { "name": "entity.name.type.bg" }
                }
            },
            {
                "comment": "a port",
                "match": format!(r"{}\s+(in|out)\s+({NAME})(?:\s*(:)\s*({domains})(?![\w-]))?", statement("port")),
                "captures": {
                    "2": { "name": "keyword.declaration.bg" },
                    "3": { "name": "storage.modifier.bg" },
                    "4": { "name": "variable.parameter.bg" },
                    "6": { "name": "support.type.domain.bg" }
                }
            },
            {
                "comment": "a name that is declared",
                "match": format!(r"{}\s+({NAME})", statement("param|signal|drive")),
                "captures": {
                    "2": { "name": "keyword.declaration.bg" },
                    "3": { "name": "variable.other.declaration.bg" }
                }
            },
            {
                "comment": "another word that begins a statement",
                "match": format!("{}{no_name}", statement(&statements)),
                "captures": { "2": { "name": "keyword.control.bg" } }
            },
            {
                "comment": "an element: kind and name",
                "match": format!(r"(?<![\p{{L}}\d_.])({kinds})\s*(:)\s*({NAME})"),
                "captures": {
                    "1": { "name": "storage.type.bg" },
                    "2": { "name": "punctuation.separator.bg" },
                    "3": { "name": "entity.name.tag.bg" }
                }
            },
            {
                "comment": "an instance: model and name",
                "match": format!(r"{begin}({NAME})(:)({NAME})"),
                "captures": {
                    "1": { "name": "entity.name.type.bg" },
                    "2": { "name": "punctuation.separator.bg" },
                    "3": { "name": "entity.name.tag.bg" }
                }
            },
            { "name": "keyword.operator.arrow.bg", "match": r"->\||\|->|->" },
            {
                "comment": "a number with its unit",
                "match": format!(r"(?:{begin}|(?<=\.\.))({number})(?: ?({unit}))?"),
                "captures": {
                    "1": { "name": "constant.numeric.bg" },
                    "2": { "name": "keyword.other.unit.bg" }
                }
            },
            {
                "comment": "the unit of a column",
                "match": format!(r"{begin}(in)\s+({unit})"),
                "captures": {
                    "1": { "name": "keyword.other.bg" },
                    "2": { "name": "keyword.other.unit.bg" }
                }
            },
            { "name": "support.function.reading.bg", "match": format!(r"{begin}({readings})(?=\()") },
            { "name": "support.function.bg", "match": format!(r"{begin}({functions})(?=\()") },
            { "name": "keyword.control.bg", "match": format!("{begin}(if|then|else|and|or|not){end}") },
            {
                "name": "keyword.other.bg",
                "match": format!("{begin}(until|step|in|as|follows|bandwidth|margin){end}")
            },
            { "name": "constant.language.bg", "match": format!("{begin}(time|pi){end}") },
            { "name": "keyword.operator.bg", "match": r"<=|>=|==|!=|<>|\.\.|[-+*/^<>=!]" },
            { "name": "variable.other.bg", "match": NAME }
        ],
        "repository": {
            "comment": { "name": "comment.line.number-sign.bg", "match": "#.*$" },
            "text": { "name": "string.quoted.double.bg", "match": "\"[^\"\\n]*\"?" }
        }
    })
}

#[test]
fn the_grammar_of_colours_follows_the_tables() {
    let path = folder().join("syntaxes/bg.tmLanguage.json");
    let wanted = serde_json::to_string_pretty(&grammar()).unwrap() + "\n";
    if std::env::var_os("UPDATE").is_some_and(|value| value == "1") {
        std::fs::write(&path, &wanted).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    let line = found.lines().zip(wanted.lines()).position(|(a, b)| a != b);
    assert!(
        found == wanted,
        "UPDATE=1 cargo test --test tools editors writes {}:{} anew",
        path.display(),
        line.unwrap_or(0) + 1
    );
}

/// The text of a snippet with its proposals filled in.
fn filled(body: &str) -> String {
    let mut text = String::new();
    let mut rest = body;
    while let Some(at) = rest.find('$') {
        text += &rest[..at];
        rest = &rest[at + 1..];
        match rest.strip_prefix('{') {
            Some(inside) => {
                let end = inside.find('}').expect(body);
                text += inside[..end].split_once(':').expect(body).1;
                rest = &inside[end + 1..];
            }
            None => rest = rest.trim_start_matches(|c: char| c.is_ascii_digit()),
        }
    }
    text + rest
}

#[test]
fn snippets_are_bond_graphs() {
    let snippets = parsed("snippets/bg.json");
    for (name, snippet) in snippets.as_object().unwrap() {
        let body = match &snippet["body"] {
            Value::Array(lines) => {
                lines.iter().map(|line| line.as_str().unwrap()).collect::<Vec<_>>().join("\n")
            }
            line => line.as_str().unwrap().to_string(),
        };
        let text = filled(&body);
        let mut map = SourceMap::default();
        let file = map.add("snippet.bg", text.as_str());
        let mut d = vec![];
        let tree = syntax::parse(&map, file, &mut d);
        assert!(d.is_empty() && !tree.statements.is_empty(), "{name}:\n{text}\n{d:?}");
        assert!(snippet["prefix"].is_string() && snippet["description"].is_string(), "{name}");
    }
    assert_eq!(filled("a ${1:x} -> ${2:y}$0"), "a x -> y");
}

#[test]
fn the_extension_hangs_together() {
    let package = parsed("package.json");
    assert_eq!(package["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(package["license"], env!("CARGO_PKG_LICENSE"));
    let language = &package["contributes"]["languages"][0];
    assert_eq!(language["extensions"], json!([".bg"]));
    let there = |value: &Value| assert!(folder().join(value.as_str().unwrap()).exists(), "{value}");
    there(&package["main"]);
    there(&language["configuration"]);
    there(&package["contributes"]["snippets"][0]["path"]);
    let grammar = &package["contributes"]["grammars"][0];
    there(&grammar["path"]);
    assert_eq!(grammar["language"], language["id"]);
    assert_eq!(grammar["scopeName"], parsed("syntaxes/bg.tmLanguage.json")["scopeName"]);
    assert_eq!(parsed("language-configuration.json")["comments"]["lineComment"], "#");
    // What the extension reads is what the package declares.
    let code = text("extension.js");
    for setting in ["path", "include"] {
        assert!(code.contains(&format!("\"{setting}\"")), "{setting}");
        let name = format!("bondspice.{setting}");
        assert!(package["contributes"]["configuration"]["properties"][name].is_object());
    }
    let command = package["contributes"]["commands"][0]["command"].as_str().unwrap();
    assert!(code.contains(command), "{command}");
    assert!(code.contains("\"lsp\""));
}

#[test]
fn node_reads_the_extension() {
    let check = std::process::Command::new("node")
        .arg("--check")
        .arg(folder().join("extension.js"))
        .output();
    match check {
        Ok(output) => {
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr))
        }
        Err(_) => eprintln!("passed over: there is no node"),
    }
}
