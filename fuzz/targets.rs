//! What is tried on a text, by the fuzzer and by the test that replays its corpus.
#![allow(dead_code)]

use bondspice::bond::{causality, elaborate, syntax};
use bondspice::diagnostic::{Diagnostic, has_errors};
use bondspice::netlist::{self, dialects::DIALECTS};
use bondspice::source::{FileId, SourceMap};
use bondspice::trace::{compare, formats, resample};

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

/// Reads a number of SPICE text in every dialect: what is taken is a piece of the text, the digits are those of its value.
pub fn number(data: &[u8]) {
    let Some(text) = std::str::from_utf8(data).ok().filter(|text| text.len() <= LONGEST) else {
        return;
    };
    for reading in DIALECTS.iter().filter_map(|dialect| dialect.read) {
        let Some(read) = netlist::read::number::number(text, reading.numbers) else {
            continue;
        };
        assert!(read.letters <= read.end && text.get(..read.end).is_some(), "{text:?}: {read:?}");
        assert!(!read.value.is_nan(), "{text:?}");
        let digits: f64 = text[..read.letters].parse().unwrap();
        if read.letters == read.end {
            assert_eq!(digits.to_bits(), read.value.to_bits(), "{text:?}");
        }
        assert!(digits.is_sign_negative() == read.value.is_sign_negative(), "{text:?}: {read:?}");
    }
}

/// Reads a trace of any format; what is read can be written in every format that takes it, and read back.
pub fn trace(data: &[u8]) {
    let Ok(trace) = formats::read("fuzzed", data) else { return };
    let numbers: usize = trace.columns.iter().map(Vec::len).sum();
    assert!(trace.columns.iter().all(|column| column.len() == trace.rows()));
    let most = data.len() * 8 + (1 << 20);
    assert!(numbers <= most, "{numbers} numbers of {} bytes", data.len());
    let other = resample::resample(&trace, &[0.0, 1e-9, 1.0]);
    assert_eq!(other.names, trace.names);
    let found = compare::compare(&trace, &trace, &compare::Settings::default());
    assert!(found.missing.is_empty());
    for format in formats::FORMATS.iter().filter(|format| (format.refuses)(&trace.names).is_none())
    {
        let mut bytes = vec![];
        (format.write)(&trace, &formats::Heading::default(), &mut bytes).unwrap();
        // A table whose first column is called `Title: …` begins as a RAW file does.
        let plain = trace.names[0]
            .starts_with(|c: char| c.is_alphanumeric() && c != 'T' && c != 't')
            || trace.names[0].starts_with("time");
        if format.name == "json" || format.name == "csv" && plain {
            let back = formats::read("back", &bytes).unwrap();
            assert_eq!((back.rows(), back.names.len()), (trace.rows(), trace.names.len()));
        }
    }
}

/// Reads a RAW file: the first bytes of one stand before the data.
pub fn raw(data: &[u8]) {
    if (formats::FORMATS[0].recognises)(data) {
        return trace(data);
    }
    let mut bytes = b"Title: fuzzed\n".to_vec();
    bytes.extend_from_slice(data);
    trace(&bytes);
}

/// Reads a table: CSV, or one of blanks.
pub fn table(data: &[u8]) {
    let by = |name: &str| formats::by_name(name).map(|format| (format.read)(data));
    let (csv, prn) = (by("csv"), by("prn"));
    assert!(csv.is_some() && prn.is_some());
    trace(data);
}

/// Reads a netlist in every dialect and flattens it. No file of the disk is read.
pub fn deck(data: &[u8]) {
    let text = std::str::from_utf8(data).ok().filter(|text| text.len() <= LONGEST);
    let Some(text) = text.filter(|text| {
        let folded = text.to_lowercase();
        !["inc", "lib", "file"].iter().any(|word| folded.contains(word))
    }) else {
        return;
    };
    for dialect in DIALECTS.iter().filter(|dialect| dialect.read.is_some()) {
        let mut map = SourceMap::default();
        let file = map.add("fuzzed.cir", text);
        let mut d = vec![];
        let how = netlist::read::How::of(dialect);
        let read = netlist::read::read(&mut map, file, &how, &mut d);
        let circuit = if has_errors(&d) { None } else { netlist::flatten::flatten(&read, &mut d) };
        if let Some(circuit) = circuit {
            bondspice::circuit::stamps::stamp(&circuit, &mut d);
        }
        places_are_in(text, file, &d);
    }
}
