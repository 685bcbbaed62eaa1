//! Values that a quantity takes one after the other: worked out one by one, so that a long sweep needs no memory.

/// An axis of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is set: one name, or those of a table's columns.
    pub names: Vec<String>,
    /// The values.
    pub points: Points,
}

/// Values of an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Points {
    /// from, from + by, …
    Linear {
        /// The first value.
        from: f64,
        /// The increment.
        by: f64,
        /// How many.
        count: u64,
    },
    /// from, from·ratio^(1/per), …; where the last value is stated the ratio is that of the ends.
    Geometric {
        /// The first value.
        from: f64,
        /// 10 or 2, or the last value by the first.
        ratio: f64,
        /// Values to one ratio.
        per: f64,
        /// How many.
        count: u64,
    },
    /// Rows of as many values as the axis has names.
    Rows(Vec<Vec<f64>>),
}

/// What rounding leaves of a last step that ends on the last value.
const ROUNDING: f64 = 1e-9;

/// More values than this have no number.
const COUNTED: f64 = 1e18;

impl Points {
    /// From, to, by; both ends included. `None` where no step leads from one to the other.
    pub fn linear(from: f64, to: f64, by: f64) -> Option<Points> {
        if from == to && from.is_finite() {
            return Some(Points::Linear { from, by: 0.0, count: 1 });
        }
        let steps = (to - from) / by;
        let sound = steps.is_finite() && steps >= 0.0;
        sound.then(|| Points::Linear { from, by, count: counted(steps) })
    }

    /// `count` values at equal distances; both ends included.
    pub fn count(from: f64, to: f64, count: f64) -> Option<Points> {
        if !(from.is_finite() && to.is_finite() && count >= 1.0 && count.is_finite()) {
            return None;
        }
        let count = count.min(COUNTED).floor();
        let by = if count > 1.0 { (to - from) / (count - 1.0) } else { 0.0 };
        Some(Points::Linear { from, by, count: count as u64 })
    }

    /// `per` values for each factor of `base`, up to `to`.
    pub fn geometric(from: f64, to: f64, base: f64, per: f64) -> Option<Points> {
        let steps = libm::log(to / from) / libm::log(base) * per;
        let sound = from != 0.0 && per > 0.0 && steps.is_finite() && steps >= 0.0;
        let per = per.floor().max(1.0);
        sound.then(|| Points::Geometric { from, ratio: base, per, count: counted(steps) })
    }

    /// About `per` values for each factor of `base`, the last being `to` exactly, as SPICE spaces frequencies.
    pub fn stretched(from: f64, to: f64, base: f64, per: f64) -> Option<Points> {
        match Points::geometric(from, to, base, per)? {
            Points::Geometric { from, count, .. } if count > 1 => {
                let per = (count - 1) as f64;
                Some(Points::Geometric { from, ratio: to / from, per, count })
            }
            other => Some(other),
        }
    }

    /// How many values there are.
    pub fn len(&self) -> u64 {
        match self {
            Points::Linear { count, .. } | Points::Geometric { count, .. } => *count,
            Points::Rows(rows) => rows.len() as u64,
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values at a place, one for each name of the axis.
    pub fn at(&self, place: u64, out: &mut Vec<f64>) {
        match self {
            Points::Linear { from, by, .. } => out.push(from + place as f64 * by),
            Points::Geometric { from, ratio, per, .. } => {
                // Whole decades exactly.
                let (whole, rest) = ((place as f64 / per).floor(), place as f64 % per);
                let part = if rest == 0.0 { 1.0 } else { libm::pow(*ratio, rest / per) };
                out.push(from * libm::pow(*ratio, whole) * part);
            }
            Points::Rows(rows) => out.extend(rows.get(place as usize).into_iter().flatten()),
        }
    }

    /// The value at a place of an axis with one name.
    pub fn value(&self, place: u64) -> f64 {
        let mut out = Vec::with_capacity(1);
        self.at(place, &mut out);
        out.first().copied().unwrap_or(f64::NAN)
    }
}

fn counted(steps: f64) -> u64 {
    (steps * (1.0 + ROUNDING) + ROUNDING).floor().min(COUNTED) as u64 + 1
}

/// The number of points of axes together.
pub fn total(axes: &[Axis]) -> u64 {
    axes.iter().fold(1, |product, axis| product.saturating_mul(axis.points.len()))
}

/// The values at a point of axes, the first running fastest: one for each name.
pub fn values(axes: &[Axis], point: u64, out: &mut Vec<f64>) {
    out.clear();
    let mut rest = point;
    for axis in axes {
        let count = axis.points.len().max(1);
        axis.points.at(rest % count, out);
        rest /= count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(points: Option<Points>) -> Vec<f64> {
        let points = points.unwrap();
        (0..points.len()).map(|k| points.value(k)).collect()
    }

    #[test]
    fn both_ends_belong_to_a_sweep() {
        assert_eq!(all(Points::linear(0.0, 1.0, 0.1)).len(), 11);
        assert_eq!(all(Points::linear(5.0, 1.0, -2.0)), [5.0, 3.0, 1.0]);
        assert_eq!(all(Points::linear(1.0, 1.0, 0.0)), [1.0]);
        assert_eq!(all(Points::linear(0.0, 1.0, 0.4)), [0.0, 0.4, 0.8]);
        assert_eq!(all(Points::count(1.0, 3.0, 5.0)), [1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(all(Points::count(7.0, 9.0, 1.0)), [7.0]);
        for wrong in [(0.0, 1.0, 0.0), (0.0, 1.0, -1.0), (0.0, f64::NAN, 1.0)] {
            assert_eq!(Points::linear(wrong.0, wrong.1, wrong.2), None, "{wrong:?}");
        }
    }

    #[test]
    fn decades_are_hit_exactly() {
        let values = all(Points::geometric(1.0, 1e6, 10.0, 3.0));
        assert_eq!(values.len(), 19);
        assert_eq!((values[3], values[18]), (10.0, 1e6));
        assert!((values[1] - 10f64.powf(1.0 / 3.0)).abs() < 1e-15);
        assert_eq!(all(Points::geometric(1.0, 9.0, 2.0, 1.0)), [1.0, 2.0, 4.0, 8.0]);
        let spice = all(Points::stretched(1.0, 50.0, 10.0, 3.0));
        // ngspice 39 prints these for `.ac dec 3 1 50`.
        for (ours, printed) in spice.iter().zip([1.0, 2.186724, 4.781762, 10.4564, 22.86525, 50.0])
        {
            assert!((ours / printed - 1.0).abs() < 1e-6, "{ours} {printed}");
        }
        assert_eq!(spice.len(), 6);
        for (from, to, per) in [(0.0, 1.0, 3.0), (1.0, -1.0, 3.0), (1.0, 0.5, 3.0), (1.0, 2.0, 0.0)]
        {
            assert_eq!(Points::geometric(from, to, 10.0, per), None, "{from} {to} {per}");
        }
    }

    #[test]
    fn huge_sweeps_are_counted_without_being_made() {
        let axis =
            |by| Axis { names: vec!["a".into()], points: Points::linear(0.0, 1.0, by).unwrap() };
        // Up to the rounding that counts of steps allow for.
        assert_eq!(total(&[axis(1e-12)]), 1_000_000_001_001);
        assert_eq!(total(&[axis(1e-12), axis(1e-12)]), u64::MAX);
        let mut values_at = vec![];
        values(&[axis(0.5), axis(0.25)], 7, &mut values_at);
        assert_eq!(values_at, [0.5, 0.5]);
    }
}
