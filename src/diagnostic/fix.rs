//! Fixes made in a text.

use super::{Diagnostic, Fix};
use crate::source::FileId;

/// The text with fixes made, and how many were made, those of the diagnostics in their order.
///
/// Fixes that change another file, or a place that an earlier one has changed, are left out whole.
pub fn apply<'d>(
    text: &str,
    file: FileId,
    diagnostics: impl IntoIterator<Item = &'d Diagnostic>,
) -> (String, Vec<&'d Diagnostic>) {
    let mut edits: Vec<(usize, usize, &str)> = vec![];
    let mut made = vec![];
    for diagnostic in diagnostics {
        let Some(Fix { edits: wanted, .. }) = &diagnostic.fix else { continue };
        let wanted: Option<Vec<_>> = wanted
            .iter()
            .map(|(span, instead)| {
                let (start, end) = (span.start as usize, span.end as usize);
                let inside = span.file == file && text.get(start..end).is_some();
                inside.then_some((start, end, instead.as_str()))
            })
            .collect();
        let free = |(start, end, _): &(usize, usize, &str)| {
            edits.iter().all(|(from, to, _)| (end <= from || to <= start) && start != from)
        };
        if let Some(wanted) = wanted.filter(|wanted| !wanted.is_empty() && wanted.iter().all(free))
        {
            edits.extend(wanted);
            made.push(diagnostic);
        }
    }
    edits.sort_unstable();
    let mut mended = String::with_capacity(text.len());
    let mut at = 0;
    for (start, end, instead) in edits {
        // Edits of one fix may touch each other; what overlaps all the same is not made.
        if start >= at {
            mended += &text[at..start];
            mended += instead;
            at = end;
        }
    }
    mended += &text[at..];
    (mended, made)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Span;

    fn fix(edits: &[(usize, usize, &str)]) -> Diagnostic {
        let edit = |(start, end, text): &(usize, usize, &str)| {
            (Span::new(FileId(0), *start, *end), text.to_string())
        };
        Diagnostic::error("E0101", Span::NONE, "m").fix("mend", edits.iter().map(edit).collect())
    }

    #[test]
    fn edits_are_made_from_wherever_they_come() {
        let d = [fix(&[(4, 5, "five")]), fix(&[(0, 1, "one"), (2, 3, "")])];
        let (text, made) = apply("1 3 5", FileId(0), &d);
        assert_eq!((text.as_str(), made.len()), ("one  five", 2));
        let (text, made) = apply("1 3 5", FileId(1), &d);
        assert_eq!((text.as_str(), made.len()), ("1 3 5", 0));
    }

    #[test]
    fn of_two_in_one_place_the_first_is_made() {
        let d =
            [fix(&[(0, 3, "x")]), fix(&[(2, 5, "y")]), fix(&[(0, 0, "z")]), fix(&[(90, 91, "")])];
        let (text, made) = apply("1 3 5", FileId(0), &d);
        assert_eq!((text.as_str(), made.len()), ("x 5", 1));
    }
}
