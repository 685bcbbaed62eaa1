//! Diagnostics as text: for humans with the lines they point at, in one line each, or as JSON.

use super::{Diagnostic, Fix, Label, Severity};
use crate::source::{SourceMap, Span};
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Patch, Renderer, Snippet};
use serde_json::{Value, json};

/// Labels farther apart than this, in lines, get a snippet each.
const NEAR: usize = 40;

/// A span of more lines than this is shown by its first line.
const TALL: usize = 6;

/// For humans: message, lines with marks, causes, help and mend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// Whether to colour.
    pub colour: bool,
    /// Columns of the terminal; longer lines are cut.
    pub width: usize,
}

impl Default for Style {
    fn default() -> Style {
        Style { colour: false, width: 120 }
    }
}

/// How a severity is called.
pub fn severity_name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

fn level(severity: Severity) -> Level<'static> {
    match severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
        Severity::Note => Level::NOTE,
    }
}

/// A diagnostic for humans, with its lines of text; ends with a line feed.
pub fn human(diagnostic: &Diagnostic, map: &SourceMap, style: Style) -> String {
    let renderer = if style.colour { Renderer::styled() } else { Renderer::plain() };
    let renderer = renderer.term_width(style.width.max(40));
    let windows = windows(diagnostic, map);
    let title = level(diagnostic.severity)
        .primary_title(printable(&diagnostic.message))
        .id(diagnostic.code);
    let mut group = Group::with_title(title);
    for window in &windows {
        let mut snippet = Snippet::source(window.text.as_str())
            .path(window.name.as_str())
            .line_start(window.line)
            .fold(true);
        for mark in &window.marks {
            let kind = if mark.primary { AnnotationKind::Primary } else { AnnotationKind::Context };
            let text = (!mark.text.is_empty()).then(|| printable(&mark.text));
            snippet = snippet.annotation(kind.span(mark.range.clone()).label(text));
        }
        group = group.element(snippet);
    }
    if windows.is_empty() {
        // A file without lines to show is at least named.
        let name = diagnostic.labels.first().and_then(|label| map.file(label.span.file));
        if let Some(file) = name {
            group = group.element(Origin::path(file.name.as_str()).line(1).char_column(1));
        }
    }
    for note in &diagnostic.notes {
        group = group.element(Level::NOTE.message(printable(note)));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(printable(help)));
    }
    let mend = diagnostic.fix.as_ref().and_then(|fix| mend(fix, map));
    let mut report = vec![group];
    if let Some((title, window, patches)) = &mend {
        let mut snippet = Snippet::source(window.text.as_str())
            .path(window.name.as_str())
            .line_start(window.line)
            .fold(true);
        for (range, text) in patches {
            snippet = snippet.patch(Patch::new(range.clone(), text.as_str()));
        }
        let title = Level::HELP.secondary_title(title.as_str());
        report.push(Group::with_title(title).element(snippet));
    }
    let mut text = renderer.render(&report);
    text.push('\n');
    text
}

/// Text that a terminal takes as text: control characters become visible ones.
fn printable(text: &str) -> String {
    annotate_snippets::normalize_untrusted_str(text)
}

/// Lines of a file around marks.
struct Window {
    name: String,
    line: usize,
    text: String,
    marks: Vec<Mark>,
}

struct Mark {
    range: std::ops::Range<usize>,
    text: String,
    primary: bool,
}

/// The labels by file and nearness, those near each other in one window.
fn windows(diagnostic: &Diagnostic, map: &SourceMap) -> Vec<Window> {
    let mut groups: Vec<Vec<(usize, &Label, Lines)>> = vec![];
    for (index, label) in diagnostic.labels.iter().enumerate() {
        let Some(lines) = lines_of(label.span, map) else { continue };
        let near = |group: &&mut Vec<(usize, &Label, Lines)>| {
            group.iter().any(|(_, other, at)| {
                other.span.file == label.span.file && at.first.abs_diff(lines.first) <= NEAR
            })
        };
        match groups.iter_mut().find(near) {
            Some(group) => group.push((index, label, lines)),
            None => groups.push(vec![(index, label, lines)]),
        }
    }
    groups.into_iter().filter_map(|group| window(&group, map)).collect()
}

fn window(group: &[(usize, &Label, Lines)], map: &SourceMap) -> Option<Window> {
    let file = map.file(group.first()?.1.span.file)?;
    let start = group.iter().map(|(_, _, lines)| lines.start).min()?;
    let end = group.iter().map(|(_, _, lines)| lines.end).max()?;
    let line = group.iter().map(|(_, _, lines)| lines.first).min()?;
    let text = file.text.get(start..end)?.to_string();
    let marks = group
        .iter()
        .map(|(index, label, lines)| Mark {
            range: lines.mark.start - start..lines.mark.end - start,
            text: label.text.clone(),
            primary: *index == 0,
        })
        .collect();
    Some(Window { name: file.name.clone(), line, text, marks })
}

/// The whole lines that a span stands on, and the span itself, cut to what can be shown.
struct Lines {
    first: usize,
    start: usize,
    end: usize,
    mark: std::ops::Range<usize>,
}

fn lines_of(span: Span, map: &SourceMap) -> Option<Lines> {
    let text = &map.file(span.file)?.text;
    let floor = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let from = floor(span.start as usize);
    let mut to = floor(span.end as usize).max(from);
    let bytes = text.as_bytes();
    let line_end = |at: usize| {
        bytes[at..].iter().position(|byte| *byte == b'\n').map_or(text.len(), |n| at + n)
    };
    if text[from..to].matches('\n').count() >= TALL {
        to = line_end(from);
    }
    let start = text[..from].rfind('\n').map_or(0, |n| n + 1);
    let end = line_end(if to > from { to - 1 } else { to }).max(to);
    if text[start..end].trim().is_empty() && text.trim().is_empty() {
        return None;
    }
    let (first, _) = map.position(Span { start: from as u32, ..span })?;
    Some(Lines { first, start, end, mark: from..to })
}

type Mend = (String, Window, Vec<(std::ops::Range<usize>, String)>);

/// The mend as a window with patches, where all of it stands in one file and near each other.
fn mend(fix: &Fix, map: &SourceMap) -> Option<Mend> {
    let labels: Vec<Label> = fix
        .edits
        .iter()
        .map(|(span, _)| Label { span: *span, text: String::new(), of_use: false })
        .collect();
    let group: Vec<(usize, &Label, Lines)> = labels
        .iter()
        .enumerate()
        .map(|(index, label)| Some((index, label, lines_of(label.span, map)?)))
        .collect::<Option<_>>()?;
    let whole = |(_, label, lines): &(usize, &Label, Lines)| {
        lines.mark == (label.span.start as usize..label.span.end as usize)
            && label.span.file == labels[0].span.file
    };
    if group.is_empty() || !group.iter().all(whole) {
        return None;
    }
    let window = window(&group, map)?;
    let patches = window
        .marks
        .iter()
        .zip(&fix.edits)
        .map(|(mark, (_, text))| (mark.range.clone(), text.clone()))
        .collect();
    Some((fix.title.clone(), window, patches))
}

/// `file:line:col: error[E0101]: message` and a line feed.
pub fn short(diagnostic: &Diagnostic, map: &SourceMap) -> String {
    let place = diagnostic.labels.first().and_then(|label| {
        let (line, column) = map.position(label.span)?;
        Some(format!("{}:{line}:{column}: ", map.file(label.span.file)?.name))
    });
    format!(
        "{}{}[{}]: {}\n",
        place.unwrap_or_default(),
        severity_name(diagnostic.severity),
        diagnostic.code,
        printable(&diagnostic.message)
    )
}

/// One JSON object and a line feed: `{code, severity, message, labels, notes, help, fix}`.
pub fn json(diagnostic: &Diagnostic, map: &SourceMap) -> String {
    let place = |span: Span| {
        let (line, column) = map.position(span).unwrap_or((0, 0));
        let file = map.file(span.file).map_or("", |file| file.name.as_str());
        (file.to_string(), line, column)
    };
    let labels: Vec<Value> = diagnostic
        .labels
        .iter()
        .map(|label| {
            let (file, line, column) = place(label.span);
            json!({
                "file": file, "start": label.span.start, "end": label.span.end,
                "line": line, "column": column, "text": label.text,
            })
        })
        .collect();
    let fix = diagnostic.fix.as_ref().map(|fix| {
        let edits: Vec<Value> = fix
            .edits
            .iter()
            .map(|(span, text)| {
                let (file, line, column) = place(*span);
                json!({
                    "file": file, "start": span.start, "end": span.end,
                    "line": line, "column": column, "text": text,
                })
            })
            .collect();
        json!({ "title": fix.title, "edits": edits })
    });
    let object = json!({
        "code": diagnostic.code,
        "severity": severity_name(diagnostic.severity),
        "message": diagnostic.message,
        "labels": labels,
        "notes": diagnostic.notes,
        "help": diagnostic.help,
        "fix": fix,
    });
    format!("{object}\n")
}

/// `2 errors, 1 warning`; `None` where there is neither.
pub fn count(diagnostics: &[Diagnostic]) -> Option<String> {
    let of = |severity| diagnostics.iter().filter(|d| d.severity == severity).count();
    let say = |number: usize, name: &str| match number {
        0 => None,
        1 => Some(format!("1 {name}")),
        _ => Some(format!("{number} {name}s")),
    };
    let parts: Vec<String> =
        [say(of(Severity::Error), "error"), say(of(Severity::Warning), "warning")]
            .into_iter()
            .flatten()
            .collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> (SourceMap, Diagnostic) {
        let mut map = SourceMap::default();
        let file = map.add("a.bg", "# graph\nSe:U(1 V) -> 1:m\nm -> R:r(5 Ohn)\n");
        let diagnostic = Diagnostic::error("E0193", Span::new(file, 36, 39), "unknown unit `Ohn`")
            .says("no such unit")
            .label(Span::new(file, 8, 12), "the source")
            .because("units are spelled as in physics books")
            .help("did you mean `Ohm`?")
            .fix("write `Ohm`", vec![(Span::new(file, 36, 39), "Ohm".into())]);
        (map, diagnostic)
    }

    #[test]
    fn humans_see_the_line_and_the_mend() {
        let (map, diagnostic) = example();
        let text = human(&diagnostic, &map, Style::default());
        insta::assert_snapshot!(text);
    }

    #[test]
    fn one_line_each() {
        let (map, diagnostic) = example();
        assert_eq!(short(&diagnostic, &map), "a.bg:3:12: error[E0193]: unknown unit `Ohn`\n");
    }

    #[test]
    fn json_holds_everything() {
        let (map, diagnostic) = example();
        let value: Value = serde_json::from_str(&json(&diagnostic, &map)).unwrap();
        assert_eq!(value["labels"][0]["line"], 3);
        assert_eq!(value["labels"][0]["column"], 12);
        assert_eq!(value["labels"][1]["text"], "the source");
        assert_eq!(value["fix"]["edits"][0]["text"], "Ohm");
        assert_eq!(value["help"], "did you mean `Ohm`?");
    }

    #[test]
    fn nothing_breaks_the_terminal() {
        let mut map = SourceMap::default();
        let long = format!("{}\u{1b}[31m!{}", "(".repeat(100_000), ")".repeat(100_000));
        let file = map.add("long.bg", long);
        let diagnostic = Diagnostic::error("E0193", Span::new(file, 100_000, 100_001), "bad\u{7}");
        let text = human(&diagnostic, &map, Style::default());
        assert!(text.len() < 2000, "{} bytes", text.len());
        assert!(!text.contains('\u{1b}') && !text.contains('\u{7}'), "{text}");
        // Spans outside the text, inside a character or over all lines must not panic either.
        let file = map.add("odd.bg", "é\n".repeat(1000));
        for (start, end) in [(1, 2), (0, 3000), (2999, 3000), (3000, 3000), (4000, 5000), (2, 1)] {
            let span = Span { file, start, end };
            let diagnostic = Diagnostic::error("E0193", span, "odd");
            assert!(!human(&diagnostic, &map, Style::default()).is_empty());
            assert!(!short(&diagnostic, &map).is_empty());
            assert!(!json(&diagnostic, &map).is_empty());
        }
    }

    #[test]
    fn counts() {
        let (_, diagnostic) = example();
        let warning = Diagnostic::warning("E0193", Span::NONE, "w");
        let all = [diagnostic.clone(), diagnostic, warning];
        assert_eq!(count(&all).unwrap(), "2 errors, 1 warning");
        assert_eq!(count(&[]), None);
    }
}
