//! All roots of a function of one variable that a search over every magnitude finds.

/// Roots by sign changes between points of ±10^(−30 … 30), sixteen a decade, each refined by bisection; poles are left
/// out. Roots that touch zero without crossing it are found only when a point hits them.
pub fn roots(f: &dyn Fn(f64) -> f64) -> Vec<f64> {
    const DECADES: i32 = 30;
    const POINTS: i32 = 16;
    let size = |k: i32| 10f64.powf(f64::from(k) / f64::from(POINTS));
    let last = DECADES * POINTS;
    let points = (-last..=last)
        .rev()
        .map(|k| -size(k))
        .chain(std::iter::once(0.0))
        .chain((-last..=last).map(size));
    let mut found = vec![];
    let mut left: Option<(f64, f64)> = None;
    for x in points {
        let value = f(x);
        if !value.is_finite() {
            left = None;
            continue;
        }
        if value == 0.0 {
            found.push(x);
            left = None;
            continue;
        }
        if let Some((a, fa)) = left
            && (fa < 0.0) != (value < 0.0)
            && let Some(root) = bisect(f, (a, fa), (x, value))
        {
            found.push(root);
        }
        left = Some((x, value));
    }
    found
}

fn bisect(f: &dyn Fn(f64) -> f64, (mut a, fa): (f64, f64), (mut b, fb): (f64, f64)) -> Option<f64> {
    let negative_left = fa < 0.0;
    let (mut value_a, mut value_b) = (fa, fb);
    loop {
        let middle = a + 0.5 * (b - a);
        if middle <= a || middle >= b {
            break;
        }
        let value = f(middle);
        if value == 0.0 {
            return Some(middle);
        }
        if !value.is_finite() {
            return None;
        }
        if (value < 0.0) == negative_left {
            (a, value_a) = (middle, value)
        } else {
            (b, value_b) = (middle, value)
        }
    }
    let (root, value) = if value_a.abs() <= value_b.abs() { (a, value_a) } else { (b, value_b) };
    // At a pole values grow towards it.
    (value.abs() <= fa.abs().max(fb.abs())).then_some(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_laws() {
        assert_eq!(roots(&|q| q + q * q * q - 10.0), [2.0]);
        assert_eq!(roots(&|q| q * q - 4.0), [-2.0, 2.0]);
        assert!(roots(&|q| q * q + 1.0).is_empty());
        assert!(roots(&|q| 1.0 / (q - 0.3)).is_empty());
        let tiny = roots(&|q: f64| (q / 1e-12).tanh() - 0.5);
        assert!(tiny.len() == 1 && (tiny[0] / (1e-12 * 0.5f64.atanh()) - 1.0).abs() < 1e-12);
    }
}
