//! How wide words are: the advance widths of Helvetica (Adobe's AFM file), which Arial and Liberation Sans share.

/// Widths of the characters from blank to `~`, in thousandths of the size.
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667,
    611, 778, 722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667,
    667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500,
    222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];

/// How wide a text of a size is, in the units of the size; letters beyond ASCII count as wide ones.
pub fn width(text: &str, size: f64) -> f64 {
    let one = |letter: char| match (letter as usize).checked_sub(32) {
        Some(at) if at < WIDTHS.len() => u32::from(WIDTHS[at]),
        _ => 640,
    };
    f64::from(text.chars().map(one).sum::<u32>()) * size / 1000.0
}

/// A text cut to a number of letters, with an ellipsis where something was cut.
pub fn cut(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_string();
    }
    let kept: String = text.chars().take(letters.saturating_sub(1)).collect();
    kept.trim_end().to_string() + "…"
}
