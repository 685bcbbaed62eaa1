//! Panels as text: a quick look, with the eight dots of Braille letters as pixels.

use super::axis::Ruler;
use super::{Panel, Scale};

/// Writes panels `wide` letters wide, each `high` lines high.
pub fn write(panels: &[Panel], wide: usize, high: usize) -> String {
    let mut out = String::new();
    for panel in panels {
        out += &self::panel(panel, wide.max(24), high.max(3));
    }
    out
}

/// The bits of a Braille letter's dots, by row and column.
const DOTS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];

fn panel(panel: &Panel, wide: usize, high: usize) -> String {
    let points = || panel.curves.iter().flat_map(|curve| curve.points.iter());
    let across = Ruler::new(&panel.x, points().map(|p| p.0), 5, true);
    let (low, last) = panel.x.limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let seen = points().filter(|p| (low..=last).contains(&p.0)).map(|p| p.1);
    let up = Ruler::new(&panel.y, seen, high / 2, false);
    let margin =
        up.ticks.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(1).max(4) + 1;
    let columns = wide - margin - 1;
    let mut cells = vec![vec![0_u8; columns]; high];
    let (width, height) = (2 * columns, 4 * high);
    let mut dot = |x: f64, y: f64| {
        if (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y) {
            let column = ((x * width as f64) as usize).min(width - 1);
            let row = (((1.0 - y) * height as f64) as usize).min(height - 1);
            cells[row / 4][column / 2] |= DOTS[row % 4][column % 2];
        }
    };
    for curve in &panel.curves {
        let mut last: Option<(f64, f64)> = None;
        for point in &curve.points {
            let (x, y) = (across.place(point.0), up.place(point.1));
            if !x.is_finite() || !y.is_finite() {
                last = None;
                continue;
            }
            let from = last.unwrap_or((x, y));
            let steps = ((x - from.0).abs() * width as f64).max((y - from.1).abs() * height as f64);
            let steps = (steps.ceil() as usize).clamp(1, 4 * (width + height));
            for k in 1..=steps {
                let part = k as f64 / steps as f64;
                dot(from.0 + part * (x - from.0), from.1 + part * (y - from.1));
            }
            last = Some((x, y));
        }
    }
    let names: Vec<&str> =
        panel.curves.iter().map(|c| c.name.as_str()).filter(|name| !name.is_empty()).collect();
    let mut out = String::new();
    if !panel.title.is_empty() {
        out += &format!("{}\n", panel.title);
    }
    out += &format!("{}  {}\n", panel.y.label, super::super::text::cut(&names.join(", "), wide));
    for (row, line) in cells.iter().enumerate() {
        let in_row =
            |part: f64| ((1.0 - part) * high as f64).min(high as f64 - 0.5) as usize == row;
        let label = up.ticks.iter().find(|(part, _)| in_row(*part));
        let label = label.map_or("", |(_, text)| text.as_str());
        let letters = line.iter().filter_map(|bits| char::from_u32(0x2800 + u32::from(*bits)));
        let letters: String = letters.collect();
        out += &format!("{label:>margin$}│{}\n", letters.trim_end_matches('\u{2800}'));
    }
    out += &format!("{:>margin$}└{}\n", "", "─".repeat(columns));
    let value = |end: f64| match panel.x.scale {
        Scale::Linear => short(end),
        Scale::Logarithmic => short(libm::pow(10.0, end)),
    };
    let (first, last) = (value(across.ends.0), value(across.ends.1));
    let label = &panel.x.label;
    let gap = columns
        .saturating_sub(first.chars().count() + last.chars().count() + label.chars().count());
    let (before, behind) = (gap / 2, gap - gap / 2);
    out + &format!(
        "{:margin$} {first}{}{label}{}{last}\n\n",
        "",
        " ".repeat(before),
        " ".repeat(behind)
    )
}

/// A number in six digits.
fn short(value: f64) -> String {
    let text = format!("{value:.6}");
    let plain = text.trim_end_matches('0').trim_end_matches('.').to_string();
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) { format!("{value:.3e}") } else { plain }
}
