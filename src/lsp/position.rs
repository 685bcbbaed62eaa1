//! Places in a text as the protocol counts them: lines from 0, columns in units of UTF-16, so that Φ is one unit and an
//! emoji two.

use lsp_types::{Position, Range};

/// The place of a byte. Bytes beyond the text, or within a character, count as the nearest place before them.
pub fn position(text: &str, byte: usize) -> Position {
    let before = text.get(..floor(text, byte)).unwrap_or("");
    let begin = before.rfind('\n').map_or(0, |at| at + 1);
    let line = before.bytes().filter(|byte| *byte == b'\n').count();
    Position { line: line as u32, character: units(&before[begin..]) as u32 }
}

/// The byte of a place. A place beyond its line's end counts as that end, a line beyond the text as the text's end, and
/// the second half of a character as its beginning.
pub fn byte(text: &str, place: Position) -> usize {
    let mut begin = 0;
    for _ in 0..place.line {
        match text[begin..].find('\n') {
            Some(at) => begin += at + 1,
            None => return text.len(),
        }
    }
    let line = text[begin..].split('\n').next().unwrap_or("");
    let line = line.strip_suffix('\r').unwrap_or(line);
    let mut left = place.character as usize;
    for (at, letter) in line.char_indices() {
        if left < letter.len_utf16() {
            return begin + at;
        }
        left -= letter.len_utf16();
    }
    begin + line.len()
}

/// The places of a range of bytes.
pub fn range(text: &str, bytes: std::ops::Range<usize>) -> Range {
    Range { start: position(text, bytes.start), end: position(text, bytes.end.max(bytes.start)) }
}

/// Units of UTF-16.
pub fn units(text: &str) -> usize {
    text.chars().map(char::len_utf16).sum()
}

/// The start of the character that a byte belongs to.
pub fn floor(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(line: u32, character: u32) -> Position {
        Position { line, character }
    }

    #[test]
    fn columns_are_units_of_utf_16() {
        let text = "# 🚀 Φ\nGY:Φ(2)\r\nlast";
        // The rocket is 4 bytes and 2 units, Φ 2 bytes and 1 unit.
        for (byte_at, place) in [
            (0, at(0, 0)),
            (2, at(0, 2)),
            (6, at(0, 4)),
            (7, at(0, 5)),
            (9, at(0, 6)),
            (10, at(1, 0)),
            (13, at(1, 3)),
            (15, at(1, 4)),
            (20, at(2, 0)),
            (24, at(2, 4)),
        ] {
            assert_eq!(position(text, byte_at), place, "{byte_at}");
            assert_eq!(byte(text, place), byte_at, "{place:?}");
        }
    }

    #[test]
    fn places_outside_are_brought_inside() {
        let text = "a🚀b\r\n\nΦ";
        assert_eq!(byte(text, at(0, 2)), 1, "the rocket's second half");
        assert_eq!(byte(text, at(0, 99)), 6, "before the line's end");
        assert_eq!(byte(text, at(1, 5)), 8);
        assert_eq!(byte(text, at(7, 0)), text.len());
        assert_eq!(byte(text, at(u32::MAX, u32::MAX)), text.len());
        assert_eq!(position(text, 3), at(0, 1));
        assert_eq!(position(text, 10_000), at(2, 1));
        assert_eq!(byte("", at(3, 3)), 0);
    }

    #[test]
    fn there_and_back() {
        let text = "param Φ = 1 Ω # 𝛼 🚀\r\n\r\n🚀🚀\nx";
        for (at, _) in text.char_indices().filter(|(_, c)| *c != '\n') {
            assert_eq!(byte(text, position(text, at)), at, "{at}");
        }
    }
}
