//! How lines on a grid meet, exactly.

use super::Cell;

/// How two lines meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crossing {
    /// Not, or only at ends.
    Not,
    /// At a point within.
    At,
    /// Along each other for a while.
    Along,
}

/// How the lines from a to b and from c to d meet.
pub fn crosses(a: Cell, b: Cell, c: Cell, d: Cell) -> Crossing {
    let side = |p: Cell, q: Cell, r: Cell| {
        let cross = i64::from(q.0 - p.0) * i64::from(r.1 - p.1)
            - i64::from(q.1 - p.1) * i64::from(r.0 - p.0);
        cross.signum()
    };
    let (s, t, u, v) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    if s == 0 && t == 0 {
        let along = |p: Cell| if (b.0 - a.0).abs() > (b.1 - a.1).abs() { p.0 } else { p.1 };
        let (low, high) = (along(a).min(along(b)), along(a).max(along(b)));
        let (from, to) = (along(c).min(along(d)), along(c).max(along(d)));
        return if low.max(from) < high.min(to) { Crossing::Along } else { Crossing::Not };
    }
    if s * t <= 0 && u * v <= 0 {
        return Crossing::At;
    }
    Crossing::Not
}
