//! Logical lines: physical ones with their continuations, without comments.
//!
//! A line with continuations is handed on as a copy of the same length in which line ends, `+` and comments have
//! become blanks, so that a place in it is a place in the text.

use std::borrow::Cow;

/// A logical line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    /// Where it starts in the file.
    pub start: usize,
    /// What it says, without the comment at its end.
    pub text: Cow<'a, str>,
    /// The comment at its end, without the marker; those of several lines are joined by a blank.
    pub comment: Option<String>,
}

/// The logical lines of a text after its title. Whole-line comments come as lines of their own, beginning with `*`;
/// blank lines are skipped. A comment between a line and its continuation comes before both.
pub struct Lines<'a> {
    text: &'a str,
    at: usize,
    /// Lines that were found while looking for continuations, in reverse order.
    held: Vec<Line<'a>>,
    /// What begins a comment at the end of a line.
    marks: &'static [&'static str],
}

impl<'a> Lines<'a> {
    /// The lines of `text` from byte `at` on; `marks` are of `;`, `$`, `//`.
    pub fn new(text: &'a str, at: usize, marks: &'static [&'static str]) -> Lines<'a> {
        Lines { text, at, held: vec![], marks }
    }

    /// The next physical line: its start and its end, without the line end.
    fn physical(&self, at: usize) -> Option<(usize, usize)> {
        if at >= self.text.len() {
            return None;
        }
        let end = memchr::memchr(b'\n', &self.text.as_bytes()[at..]);
        Some((at, end.map_or(self.text.len(), |length| at + length)))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if let Some(line) = self.held.pop() {
            return Some(line);
        }
        loop {
            let (start, end) = self.physical(self.at)?;
            self.at = end + 1;
            let physical = &self.text[start..end];
            let content = physical.trim_start();
            if content.is_empty() {
                continue;
            }
            let indent = physical.len() - content.len();
            if content.starts_with('*') {
                let text = Cow::Borrowed(content.trim_end());
                return Some(Line { start: start + indent, text, comment: None });
            }
            let (cut, comment) = split_comment(content, self.marks);
            if content[..cut].trim().is_empty() {
                // A line of `; …` or `$ …` alone is as good as one of `* …`.
                continue;
            }
            let mut line = Line {
                start: start + indent,
                text: Cow::Borrowed(content[..cut].trim_end()),
                comment,
            };
            self.continuations(&mut line);
            return match self.held.pop() {
                None => Some(line),
                Some(first) => {
                    // Comments in between go before the line, in their order.
                    self.held.insert(0, line);
                    Some(first)
                }
            };
        }
    }
}

impl<'a> Lines<'a> {
    /// Appends the continuations of a line.
    fn continuations(&mut self, line: &mut Line<'a>) {
        let (mut at, mut between) = (self.at, vec![]);
        while let Some((start, end)) = self.physical(at) {
            let physical = &self.text[start..end];
            let content = physical.trim_start();
            let indent = physical.len() - content.len();
            if content.starts_with('*') {
                let text = Cow::Borrowed(content.trim_end());
                between.push(Line { start: start + indent, text, comment: None });
            } else if let Some(continued) = content.strip_prefix('+') {
                let (cut, comment) = split_comment(continued, self.marks);
                let from = start + indent + 1;
                let whole = line.text.to_mut();
                whole.extend(std::iter::repeat_n(
                    ' ',
                    (from - line.start).saturating_sub(whole.len()),
                ));
                whole.push_str(continued[..cut].trim_end());
                if let Some(comment) = comment {
                    match &mut line.comment {
                        Some(before) => {
                            before.push(' ');
                            before.push_str(&comment);
                        }
                        none => *none = Some(comment),
                    }
                }
                self.at = end + 1;
                self.held.append(&mut between);
            } else if !content.is_empty() {
                break;
            }
            at = end + 1;
        }
        self.held.reverse();
    }
}

/// Where the comment at the end of a line begins, and its text: `;`, `//`, or `$` after a blank or comma or at the
/// beginning. A marker within double quotes is none.
fn split_comment(line: &str, marks: &[&str]) -> (usize, Option<String>) {
    let bytes = line.as_bytes();
    // Most lines hold none of the marks.
    if memchr::memchr3(b';', b'$', b'/', bytes).is_none() {
        return (line.len(), None);
    }
    let mut quoted = false;
    for (at, byte) in bytes.iter().enumerate() {
        let marker = match byte {
            b'"' => {
                quoted = !quoted;
                0
            }
            b';' => 1,
            b'/' if bytes.get(at + 1) == Some(&b'/') => 2,
            b'$' if at == 0 || matches!(bytes[at - 1], b' ' | b'\t' | b',') => 1,
            _ => 0,
        };
        if marker > 0 && !quoted && marks.contains(&&line[at..at + marker]) {
            let text = line[at + marker..].trim();
            return (at, (!text.is_empty()).then(|| text.to_string()));
        }
    }
    (line.len(), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(usize, String, Option<String>)> {
        Lines::new(text, 0, &[";", "$", "//"])
            .map(|line| (line.start, line.text.into_owned(), line.comment))
            .collect()
    }

    #[test]
    fn continuations_keep_their_places() {
        let text = "r1 a $ one\n* between\n\n + b ; two\r\n+ 1k\nc1 a 0 1u\n";
        let lines = lines(text);
        assert_eq!(lines[0], (11, "* between".into(), None));
        let (start, line, comment) = &lines[1];
        assert_eq!((*start, comment.as_deref()), (0, Some("one two")));
        assert_eq!(line.split_whitespace().collect::<Vec<_>>(), ["r1", "a", "b", "1k"]);
        let at = line.find("1k").unwrap();
        assert_eq!(&text[start + at..start + at + 2], "1k");
        assert_eq!(lines[2].1, "c1 a 0 1u");
        assert_eq!(lines.len(), 3);
    }

    #[test]
    fn comments_of_four_kinds() {
        let found = lines(
            "  * whole\n; also whole\nr1 a b 1 ; x ; y\nr2 a$b c 1 $ z\nr3 a b 1 //w\nr4 \"a;b\" 1\n",
        );
        let comments: Vec<_> =
            found.iter().map(|(_, text, comment)| (text.as_str(), comment.as_deref())).collect();
        assert_eq!(
            comments,
            [
                ("* whole", None),
                ("r1 a b 1", Some("x ; y")),
                ("r2 a$b c 1", Some("z")),
                ("r3 a b 1", Some("w")),
                ("r4 \"a;b\" 1", None),
            ]
        );
    }

    #[test]
    fn several_comments_between_come_in_order() {
        let found = lines("r1 a\n* 1\n* 2\n+ b 1\n* 3\nr2\n");
        let texts: Vec<_> = found.iter().map(|(_, text, _)| text.trim()).collect();
        assert_eq!(texts[0], "* 1");
        assert_eq!(texts[1], "* 2");
        assert!(texts[2].starts_with("r1 a"));
        assert_eq!(&texts[3..], ["* 3", "r2"]);
    }
}
