//! What is tried on a text, by the fuzzer and by the test that replays its corpus.
#![allow(dead_code)]

use bondspice::bond::{causality, elaborate, syntax};
use bondspice::diagnostic::{Diagnostic, has_errors};
use bondspice::source::{FileId, SourceMap};

/// Bytes of the longest text that is tried.
pub const LONGEST: usize = 16 << 10;

fn read(data: &[u8]) -> Option<(SourceMap, FileId, &str)> {
    let text = std::str::from_utf8(data).ok().filter(|text| text.len() <= LONGEST)?;
    let mut map = SourceMap::default();
    let file = map.add("fuzzed.bg", text);
    Some((map, file, text))
}

/// Every place that a message speaks of lies in the text, on whole characters.
fn places_are_in(text: &str, file: FileId, d: &[Diagnostic]) {
    for label in d.iter().flat_map(|d| &d.labels).filter(|label| label.span.file == file) {
        let (start, end) = (label.span.start as usize, label.span.end as usize);
        assert!(text.get(start..end).is_some(), "{label:?}");
    }
}

/// Reads a text: the statements stand in it one after the other, its tokens cover it.
pub fn parse(data: &[u8]) {
    let Some((map, file, text)) = read(data) else { return };
    let mut d = vec![];
    let tree = syntax::parse(&map, file, &mut d);
    places_are_in(text, file, &d);
    assert!(d.len() <= 32, "{} messages", d.len());
    for statement in &tree.statements {
        assert!(statement.span.start <= statement.span.end, "{statement:?}");
        assert!(text.get(statement.span.start as usize..statement.span.end as usize).is_some());
    }
    let mut at = 0;
    for (_, span) in syntax::tokens(text) {
        assert_eq!(span.start, at);
        at = span.end;
    }
    assert_eq!(at, text.len());
    let mut d = vec![];
    syntax::parse_value(text, file, &mut d);
    syntax::parse_drive(text, file, &mut d);
    syntax::parse_observe(text, file, &mut d);
    places_are_in(text, file, &d);
}

/// Formats a text without errors: nothing is lost, it means the same, and is formatted then.
pub fn format(data: &[u8]) {
    let Some((mut map, file, text)) = read(data) else { return };
    let mut d = vec![];
    let before = syntax::parse(&map, file, &mut d);
    if has_errors(&d) {
        // Nobody asks for it, but it must not break.
        syntax::layout(text);
        return;
    }
    let formatted = syntax::layout(text);
    assert!(syntax::same_tokens(text, &formatted), "{text:?}\n{formatted:?}");
    let file = map.add("formatted.bg", formatted.clone());
    let after = syntax::parse(&map, file, &mut d);
    assert!(!has_errors(&d), "{text:?}\n{formatted:?}\n{d:#?}");
    assert_eq!(shape(&before), shape(&after), "{text:?}\n{formatted:?}");
    assert_eq!(syntax::layout(&formatted), formatted, "{text:?}");
}

/// Builds the graph of a text and assigns causality.
pub fn elaborate(data: &[u8]) {
    let Some((mut map, file, text)) = read(data) else { return };
    let mut d = vec![];
    // No file of the disk is read: imports are those of the library, tables stand in the text.
    let count = |word: &str| text.matches(word).count();
    let program = if count("file") == 0 && count("import") == count("import \"std/") {
        elaborate::load(&mut map, file, &[], &mut d)
    } else {
        elaborate::Program::from(syntax::parse(&map, file, &mut d))
    };
    let overrides = elaborate::Overrides::default();
    let graph = elaborate::elaborate(&program, &map, &overrides, &mut d);
    assert_eq!(graph.is_none(), has_errors(&d), "{d:#?}");
    if let Some(graph) = graph {
        causality::assign(&graph, &mut d);
    }
    places_are_in(text, file, &d);
}

/// A tree without its places.
pub fn shape(file: &syntax::File) -> String {
    let text = format!("{:?}", file.statements);
    let mut shape = String::with_capacity(text.len() / 2);
    let mut rest = text.as_str();
    while let Some(at) = rest.find("Span {") {
        shape.push_str(&rest[..at]);
        rest = rest[at..].split_once("end: ").map_or("", |(_, end)| end);
        rest = rest.split_once('}').map_or("", |(_, after)| after);
    }
    shape + rest
}
