//! A balance as bands: on the left what comes in, on the right what becomes of it, each as broad as it is large (the
//! diagram of M. H. P. R. Sankey, *The thermal efficiency of steam engines*, 1898).

use super::picture::{Anchor, Ink, Picture, Point, Room, Shape, Words};
use crate::second::energy::Role;
use crate::verify::EnergyReport;

/// One band.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// What it is.
    pub name: String,
    /// How large, not negative.
    pub size: f64,
    /// Its colour.
    pub ink: Ink,
}

/// The height of the larger side without gaps.
const HIGH: f64 = 320.0;
/// How long bands are on either side of the middle, and how broad ends and middle are.
const LONG: f64 = 190.0;
const BAR: f64 = 12.0;
/// The least distance of two names.
const LINE: f64 = 15.0;
/// Less than this part of the whole is drawn with the rest of its colour.
const LITTLE: f64 = 2e-3;
/// The size of letters.
const SIZE: f64 = 11.0;

/// What comes in and what becomes of it: each element of a balance on the side on which its amount is positive.
pub fn shares(balance: &EnergyReport) -> [Vec<Share>; 2] {
    let mut sides = [vec![], vec![]];
    for element in &balance.elements {
        let source = element.role == Role::Source.name();
        let ink = Ink::Curve(match element.role {
            _ if source => 0,
            role if role == Role::Dissipated.name() => 1,
            role if role == Role::Stored.name() => 2,
            _ => 3,
        });
        let (name, size) = (element.name.clone(), element.energy.abs());
        sides[usize::from(source != (element.energy > 0.0))].push(Share { name, size, ink });
    }
    if balance.jumps != 0.0 {
        let (name, ink) = ("jumps".to_string(), Ink::Curve(7));
        let side = usize::from(balance.jumps < 0.0);
        sides[side].push(Share { name, size: balance.jumps.abs(), ink });
    }
    sides
}

/// Draws what comes in and what becomes of it; `words` says how large a share is.
pub fn paint(title: &str, [into, out]: [&[Share]; 2], words: &dyn Fn(f64) -> String) -> Picture {
    let mut picture = Picture { title: title.to_string(), ..Picture::default() };
    let sum = |shares: &[Share]| shares.iter().map(|share| share.size).sum::<f64>();
    let whole = sum(into).max(sum(out));
    let whole = if whole > 0.0 { whole } else { 1.0 };
    let scale = HIGH / whole;
    let middle = LONG + BAR;
    for (side, shares) in [(-1.0, into), (1.0, out)] {
        let shares = gathered(shares, whole);
        // A name needs a line, however narrow its band.
        let room = |share: &Share| (share.size * scale).max(LINE);
        let gaps = shares.len().saturating_sub(1) as f64;
        let high: f64 = shares.iter().map(room).sum::<f64>() + 6.0 * gaps;
        let mut outer = (HIGH - high) / 2.0;
        let mut inner = (HIGH - sum(&shares) * scale) / 2.0;
        for share in &shares {
            let broad = share.size * scale;
            let top = outer + (room(share) - broad) / 2.0;
            let x = |part: f64| middle + side * (BAR / 2.0 + part);
            picture.shapes.push(Shape::Area {
                points: band((x(0.0), inner), (x(LONG), top), broad),
                fill: Some((share.ink, 0.35)),
                stroke: None,
                round: false,
            });
            let end = Room { left: 0.0, top, right: 0.0, bottom: top + broad };
            bar((x(LONG), x(LONG + BAR)), (end.top, end.bottom), share.ink, &mut picture);
            let part = 100.0 * share.size / whole;
            let says = format!("{}, {part:.1} %", words(share.size));
            let y = top + broad / 2.0;
            for (line, ink, bold) in [(&share.name, Ink::Plain, true), (&says, Ink::Faint, false)] {
                // Name and amount in one line: one after the other away from the band.
                let mut own = Words::new((0.0, y + 0.36 * SIZE), line.as_str(), SIZE, ink);
                own.bold = bold;
                own.anchor = if side < 0.0 { Anchor::End } else { Anchor::Start };
                let mut name = Words::new((0.0, 0.0), share.name.as_str(), SIZE, ink);
                name.bold = true;
                let first = x(LONG + BAR + 6.0);
                own.at.0 = if bold { first } else { first + side * (name.width() + 8.0) };
                picture.words(own);
            }
            outer += room(share) + 6.0;
            inner += broad;
        }
    }
    let rest = (sum(into) - sum(out)).abs() / whole;
    let high = HIGH;
    bar((middle - BAR / 2.0, middle + BAR / 2.0), (0.0, high), Ink::Plain, &mut picture);
    if rest > LITTLE {
        let says = format!("the sides differ by {:.1} %", 100.0 * rest);
        picture.words(Words::new((middle, high + 20.0), says, SIZE, Ink::Warning));
    }
    let all = picture.shapes.iter().map(Shape::room).reduce(|a, b| a.with(&b));
    if let (Some(all), false) = (all, title.is_empty()) {
        let mut words = Words::new((all.left, all.top - 18.0), title, 13.0, Ink::Plain);
        (words.anchor, words.bold) = (Anchor::Start, true);
        picture.words(words);
    }
    picture.fit(14.0);
    picture
}

/// The shares with the little ones of each colour in one.
fn gathered(shares: &[Share], whole: f64) -> Vec<Share> {
    let mut found: Vec<Share> = vec![];
    let mut rest: Vec<(Share, usize)> = vec![];
    for share in shares.iter().filter(|share| share.size > 0.0) {
        if share.size > LITTLE * whole {
            found.push(share.clone());
            continue;
        }
        match rest.iter_mut().find(|(other, _)| other.ink == share.ink) {
            Some((other, count)) => {
                other.size += share.size;
                *count += 1;
            }
            None => rest.push((share.clone(), 1)),
        }
    }
    found.sort_by(|a, b| b.size.total_cmp(&a.size));
    for (mut share, count) in rest.into_iter().filter(|(share, _)| share.size > 1e-9 * whole) {
        if count > 1 {
            share.name = format!("{count} others");
        }
        found.push(share);
    }
    found
}

fn bar((left, right): (f64, f64), (top, bottom): (f64, f64), ink: Ink, picture: &mut Picture) {
    let points = vec![(left, top), (right, top), (right, bottom), (left, bottom)];
    let fill = Some((ink, 1.0));
    picture.shapes.push(Shape::Area { points, fill, stroke: None, round: false });
}

/// A band of one breadth that swings from one height to another: x·x·(3 − 2·x).
fn band(from: Point, to: Point, broad: f64) -> Vec<Point> {
    const PARTS: u32 = 24;
    let edge = |by: f64| {
        move |k: u32| {
            let part = f64::from(k) / f64::from(PARTS);
            let swing = part * part * (3.0 - 2.0 * part);
            (from.0 + part * (to.0 - from.0), from.1 + swing * (to.1 - from.1) + by)
        }
    };
    (0..=PARTS).map(edge(0.0)).chain((0..=PARTS).rev().map(edge(broad))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(name: &str, size: f64, ink: u8) -> Share {
        Share { name: name.into(), size, ink: Ink::Curve(ink) }
    }

    #[test]
    fn bands_are_as_broad_as_they_are_large() {
        let into = [share("bus", 100.0, 0)];
        let out =
            [share("R", 70.0, 1), share("load", 29.9, 2), share("a", 0.05, 1), share("b", 0.05, 1)];
        let picture = paint("balance", [&into, &out], &|size| format!("{size} J"));
        let areas: Vec<Room> = picture
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Area { fill: Some((_, opacity)), .. } if *opacity == 1.0 => {
                    Some(shape.room())
                }
                _ => None,
            })
            .collect();
        let high = |k: usize| areas[k].bottom - areas[k].top;
        // The ends of the left and of the right side, then the middle.
        for (k, wanted) in [(0, 1.0), (1, 0.7), (2, 0.299), (3, 0.001), (4, 1.0)] {
            assert!((high(k) - wanted * HIGH).abs() < 1e-9, "{k}: {}", high(k));
        }
        let words: Vec<String> = picture
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Words { words, .. } => Some(words.text.clone()),
                _ => None,
            })
            .collect();
        assert!(words.contains(&"2 others".to_string()), "{words:?}");
        assert!(words.contains(&"70 J, 70.0 %".to_string()), "{words:?}");
        assert!(!words.iter().any(|text| text.contains("differ")), "{words:?}");
    }
}
