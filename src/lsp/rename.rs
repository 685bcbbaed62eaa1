//! Renaming: every place that speaks of a name, in all files that are open or belong to the workspace.
//!
//! Nothing may mean something else afterwards. An element that takes the parameter of its name, `I:L`, keeps its value:
//! it becomes `I:coil(L)` when the element is renamed, `I:L(L_a)` when the parameter is. At last the changed texts are read
//! and checked again: a new error, or a place that no longer speaks of the same thing, refuses the new name.

use super::analysis::Analysis;
use super::index::{Index, Mention, Role, Sort, Symbol, SymbolId};
use super::server::Host;
use crate::bond::elements::element;
use crate::diagnostic::{Diagnostic, Severity};
use crate::source::{FileId, Span};
use std::collections::BTreeMap;

/// Words of expressions, which name nothing.
const WORDS: [&str; 6] = ["and", "or", "not", "if", "then", "else"];

/// Names that are no parameter's and no signal's.
const OWN: [&str; 6] = ["e", "f", "q", "p", "time", "pi"];

/// What would be renamed at a byte: the word and its name.
///
/// # Errors
/// Why nothing can be renamed there.
pub fn target(analysis: &Analysis, file: FileId, byte: usize) -> Result<(Span, String), String> {
    let Some(mention) = analysis.index.at(file, byte) else {
        return Err("no name that was given here stands there".to_string());
    };
    let symbol = analysis.index.symbol(mention.symbol);
    if matches!(symbol.sort, Sort::File(_)) {
        return Err(format!("`{0}` is the file `{0}.bg`: rename the file", symbol.name));
    }
    if symbol.definitions.iter().any(|d| analysis.name(d.name.file).starts_with("std/")) {
        return Err(format!("`{}` belongs to the library", symbol.name));
    }
    Ok((mention.span, symbol.name.clone()))
}

/// The changes that give what stands at a byte another name.
///
/// # Errors
/// Why it cannot have that name.
pub fn rename(
    analysis: &Analysis,
    host: &Host,
    file: FileId,
    byte: usize,
    new: &str,
) -> Result<Vec<(Span, String)>, String> {
    let (_, old) = target(analysis, file, byte)?;
    let index = &analysis.index;
    let Some(mention) = index.at(file, byte) else { return Ok(vec![]) };
    if old == new {
        return Ok(vec![]);
    }
    allowed(index, mention.symbol, new)?;
    let edits = edits(analysis, mention.symbol, new);
    verify(analysis, host, mention.symbol, &edits)?;
    Ok(edits)
}

/// Whether a symbol may have a name.
fn allowed(index: &Index, id: SymbolId, new: &str) -> Result<(), String> {
    let symbol = index.symbol(id);
    let noun = symbol.sort.noun();
    let mut letters = new.chars();
    let begins = letters.next().is_some_and(|c| c.is_alphabetic() || c == '_');
    if !begins || !letters.all(|c| c.is_alphabetic() || c.is_ascii_digit() || c == '_') {
        return Err(format!("`{new}` is no name: a letter or `_`, then letters, digits, `_`"));
    }
    if WORDS.contains(&new) {
        return Err(format!("`{new}` is a word of the language"));
    }
    let value = symbol.sort.is_value() || matches!(symbol.sort, Sort::Variable(_));
    if value && OWN.contains(&new) {
        return Err(format!("`{new}` means something of its own in a law"));
    }
    let body = index.body(symbol.body);
    let taken = match &symbol.sort {
        Sort::Model(_) if element(new).is_some() => {
            return Err(format!("`{new}` is a kind of element"));
        }
        Sort::Model(_) => {
            let knows = index.kinds.values().filter(|kinds| kinds.values().any(|k| *k == id));
            knows.filter_map(|kinds| kinds.get(new)).next()
        }
        sort if sort.is_thing() => body.things.get(new),
        _ => body.values.get(new),
    };
    if let Some(taken) = taken {
        let taken = index.symbol(*taken).sort.noun();
        return Err(format!("`{new}` is already the name of {} {taken}", article(taken)));
    }
    // A variable of a loop hides values of its name.
    let hidden = |other: &Symbol| match other.sort {
        Sort::Variable(scope) if other.name == new && value => {
            let within = |m: &Mention| {
                m.span.file == scope.file && scope.start <= m.span.start && m.span.end <= scope.end
            };
            index.mentions(id).any(within)
        }
        _ => false,
    };
    if index.symbols.iter().any(hidden) {
        return Err(format!("`{new}` counts in a loop where this {noun} is used"));
    }
    Ok(())
}

fn article(noun: &str) -> &'static str {
    if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}

fn edits(analysis: &Analysis, id: SymbolId, new: &str) -> Vec<(Span, String)> {
    let index = &analysis.index;
    let mut edits: Vec<(Span, String)> = vec![];
    for mention in index.mentions(id) {
        match mention.role {
            Role::Definition | Role::Use => edits.push((mention.span, new.to_string())),
            Role::Implied => edits.push(given(analysis, mention, new)),
        }
    }
    // What this element took for its value because of its name.
    let symbol = index.symbol(id);
    if symbol.sort.is_thing() {
        for definition in &symbol.definitions {
            let value = analysis.source(definition.name).to_string();
            let implied = index.implied_at(definition.name);
            edits.extend(implied.map(|mention| given(analysis, mention, &value)));
        }
    }
    edits.sort_by_key(|(span, _)| (span.file, span.start, span.end));
    edits.dedup();
    edits
}

/// The change that writes down the value of an element which had it from its name.
fn given(analysis: &Analysis, mention: &Mention, value: &str) -> (Span, String) {
    let text = analysis.text(mention.span.file);
    let between = text.get(mention.span.end as usize..mention.after.start as usize).unwrap_or("");
    let indices = between.trim_end_matches('(').trim_end();
    let value = format!("{value}{indices}");
    let after = text.get(mention.after.start as usize..).unwrap_or("");
    if between.ends_with('(') {
        return (mention.after, format!("{value}, "));
    }
    match after.starts_with('(') {
        true => {
            let inside = mention.after.start + 1;
            (Span { start: inside, end: inside, ..mention.after }, value)
        }
        false => (mention.after, format!("({value})")),
    }
}

/// Whether the changed texts say the same under the new name.
fn verify(
    analysis: &Analysis,
    host: &Host,
    id: SymbolId,
    edits: &[(Span, String)],
) -> Result<(), String> {
    let mut texts: BTreeMap<FileId, String> = BTreeMap::new();
    for (span, new) in edits.iter().rev() {
        let text = texts.entry(span.file).or_insert_with(|| analysis.text(span.file).to_string());
        let range = span.start as usize..span.end as usize;
        if text.get(range.clone()).is_none() {
            return Err("the text has changed".to_string());
        }
        text.replace_range(range, new);
    }
    let after = analysis.with_texts(&texts, &host.folders);
    // The same places speak of one thing.
    let moved = |span: Span| {
        let before = edits.iter().filter(|(s, _)| s.file == span.file && s.start < span.start);
        let shift: i64 = before.map(|(s, new)| new.len() as i64 - i64::from(s.end - s.start)).sum();
        (i64::from(span.start) + shift) as usize
    };
    let index = &analysis.index;
    let spoken = |index: &Index, id| index.mentions(id).filter(|m| m.role != Role::Implied).count();
    let added = edits.iter().filter(|(span, _)| span.start == span.end).count();
    let renamed_value = index.symbol(id).sort.is_value();
    let first = index.mentions(id).find(|m| m.role == Role::Definition);
    let same = first.and_then(|first| {
        let found = after.index.at(first.span.file, moved(first.span))?;
        let expected = spoken(index, id) + if renamed_value { added } else { 0 };
        Some(spoken(&after.index, found.symbol) == expected)
    });
    if same != Some(true) {
        return Err("the name would mean something else in some place".to_string());
    }
    for (at, program) in analysis.programs.iter().enumerate() {
        if !program.files.iter().any(|file| texts.contains_key(&file.file)) {
            continue;
        }
        let Some(root) = analysis.roots.get(at) else { continue };
        let check =
            |analysis: &Analysis| (host.check)(&mut analysis.map.clone(), *root, &host.folders);
        let (before, now) = (check(analysis).diagnostics, check(&after).diagnostics);
        if let Some(error) = new_error(&before, &now) {
            return Err(format!("it would be an error: {}", error.message));
        }
    }
    Ok(())
}

/// An error of a code that there was less of before.
fn new_error<'d>(before: &[Diagnostic], now: &'d [Diagnostic]) -> Option<&'d Diagnostic> {
    let count = |all: &[Diagnostic], code: &str| {
        all.iter().filter(|d| d.severity == Severity::Error && d.code == code).count()
    };
    let errors = now.iter().filter(|d| d.severity == Severity::Error);
    errors.into_iter().find(|d| count(now, d.code) > count(before, d.code))
}
