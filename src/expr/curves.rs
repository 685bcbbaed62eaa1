//! Curves through the points of a table: straight lines, cubics that join smoothly, one polynomial through all.
//!
//! ```text
//! cubic, cell k:  y = y_k + b·u + c·u² + d·u³,  u = x − x_k
//! Akima:          slope at k = (|m_{k+1} − m_k|·m_{k−1} + |m_{k−1} − m_{k−2}|·m_k) / (|m_{k+1} − m_k| + |m_{k−1} − m_{k−2}|)
//! natural cubic:  second derivatives continuous, 0 at both ends
//! polynomial:     y = Σ w_j·y_j/(x − x_j) / Σ w_j/(x − x_j),  w_j = 1/Π_{i≠j} (x_j − x_i)
//! ```
//!
//! m_k is the slope of the line from point k to the next. Beyond the ends every curve holds its end values, as tables do.
//!
//! Sources: H. Akima, J. ACM 17:589, 1970; C. de Boor, A Practical Guide to Splines, 1978, chapter 4; J.-P. Berrut,
//! L. N. Trefethen, SIAM Review 46:501, 2004.

use super::tree::Table;

/// How the points of a table are joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Curve {
    /// By straight lines.
    #[default]
    Lines,
    /// By cubics; b, c and d of each cell.
    Cubic(Vec<[f64; 3]>),
    /// By one polynomial; its barycentric weights.
    Polynomial(Vec<f64>),
}

/// What a polynomial through all points takes at most: beyond, it swings between points that lie evenly.
pub const MOST_OF_A_POLYNOMIAL: usize = 64;

impl Table {
    /// Points joined by straight lines.
    pub fn lines(x: Vec<f64>, y: Vec<f64>) -> Table {
        Table { x, y, curve: Curve::Lines }
    }

    /// Akima's curve; where his formula is 0/0 the slope is the mean of those at both sides (R. Wodicka's supplement).
    pub fn akima(x: Vec<f64>, y: Vec<f64>) -> Table {
        let n = x.len();
        if n < 3 {
            return Table::lines(x, y);
        }
        // m[k + 2] is the slope of cell k; two go on at each end as on a parabola.
        let mut m = vec![0.0; n + 3];
        for k in 0..n - 1 {
            m[k + 2] = (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
        }
        m[1] = 2.0 * m[2] - m[3];
        m[0] = 2.0 * m[1] - m[2];
        m[n + 1] = 2.0 * m[n] - m[n - 1];
        m[n + 2] = 2.0 * m[n + 1] - m[n];
        let slope = |k: usize| {
            let (before, after) = ((m[k + 1] - m[k]).abs(), (m[k + 3] - m[k + 2]).abs());
            if before + after == 0.0 {
                0.5 * (m[k + 1] + m[k + 2])
            } else {
                (after * m[k + 1] + before * m[k + 2]) / (before + after)
            }
        };
        let slopes: Vec<f64> = (0..n).map(slope).collect();
        Table::hermite(x, y, &slopes)
    }

    /// The natural cubic spline.
    pub fn natural(x: Vec<f64>, y: Vec<f64>) -> Table {
        let n = x.len();
        if n < 3 {
            return Table::lines(x, y);
        }
        // Second derivatives by a tridiagonal system, solved from below.
        let (mut second, mut ratio) = (vec![0.0; n], vec![0.0; n]);
        for k in 1..n - 1 {
            let (left, right) = (x[k] - x[k - 1], x[k + 1] - x[k]);
            let change = (y[k + 1] - y[k]) / right - (y[k] - y[k - 1]) / left;
            let pivot = 2.0 * (left + right) - left * ratio[k - 1];
            ratio[k] = right / pivot;
            second[k] = (6.0 * change - left * second[k - 1]) / pivot;
        }
        for k in (1..n - 1).rev() {
            second[k] -= ratio[k] * second[k + 1];
        }
        let cell = |k: usize| {
            let h = x[k + 1] - x[k];
            let (s0, s1) = (second[k], second[k + 1]);
            [(y[k + 1] - y[k]) / h - h * (2.0 * s0 + s1) / 6.0, s0 / 2.0, (s1 - s0) / (6.0 * h)]
        };
        let cells = (0..n - 1).map(cell).collect();
        Table { x, y, curve: Curve::Cubic(cells) }
    }

    /// The polynomial through all points. `None` for more than [`MOST_OF_A_POLYNOMIAL`] of them.
    pub fn polynomial(x: Vec<f64>, y: Vec<f64>) -> Option<Table> {
        let n = x.len();
        if n > MOST_OF_A_POLYNOMIAL {
            return None;
        }
        // Distances in parts of a quarter of the range, so that products neither vanish nor overflow.
        let scale = 4.0 / (x[n - 1] - x[0]).max(f64::MIN_POSITIVE);
        let weight = |j: usize| {
            let apart = (0..n).filter(|i| *i != j).map(|i| (x[j] - x[i]) * scale);
            1.0 / apart.product::<f64>()
        };
        let weights = (0..n).map(weight).collect();
        Some(Table { x, y, curve: Curve::Polynomial(weights) })
    }

    /// Cubics of given slopes at the points.
    fn hermite(x: Vec<f64>, y: Vec<f64>, slopes: &[f64]) -> Table {
        let cell = |k: usize| {
            let h = x[k + 1] - x[k];
            let m = (y[k + 1] - y[k]) / h;
            let (a, b) = (slopes[k], slopes[k + 1]);
            [a, (3.0 * m - 2.0 * a - b) / h, (a + b - 2.0 * m) / (h * h)]
        };
        let cells = (0..x.len() - 1).map(cell).collect();
        Table { x, y, curve: Curve::Cubic(cells) }
    }

    /// The value; beyond the ends that of the end, NaN for a table without points.
    pub fn value(&self, x: f64) -> f64 {
        match self.segment(x) {
            Some(k) => match &self.curve {
                Curve::Lines => {
                    let (x0, x1, y0, y1) = (self.x[k], self.x[k + 1], self.y[k], self.y[k + 1]);
                    y0 + (y1 - y0) * ((x - x0) / (x1 - x0))
                }
                Curve::Cubic(cells) => {
                    let ([b, c, d], u) = (cells[k], x - self.x[k]);
                    self.y[k] + u * (b + u * (c + u * d))
                }
                Curve::Polynomial(weights) => self.barycentric(weights, x).0,
            },
            None if x.is_nan() => x,
            None if self.x.first().is_some_and(|first| x < *first) => self.y[0],
            None => self.y.last().copied().unwrap_or(f64::NAN),
        }
    }

    /// The slope; at a point the one to its right, outside 0.
    pub fn slope(&self, x: f64) -> f64 {
        match self.segment(x) {
            Some(k) => match &self.curve {
                Curve::Lines => (self.y[k + 1] - self.y[k]) / (self.x[k + 1] - self.x[k]),
                Curve::Cubic(cells) => {
                    let ([b, c, d], u) = (cells[k], x - self.x[k]);
                    b + u * (2.0 * c + u * 3.0 * d)
                }
                Curve::Polynomial(weights) => self.barycentric(weights, x).1,
            },
            None => x * 0.0,
        }
    }

    /// Value and slope of the polynomial.
    fn barycentric(&self, weights: &[f64], x: f64) -> (f64, f64) {
        if let Some(k) = self.x.iter().position(|knot| *knot == x) {
            let slopes = (0..self.x.len())
                .filter(|j| *j != k)
                .map(|j| weights[j] / weights[k] * (self.y[j] - self.y[k]) / (x - self.x[j]));
            return (self.y[k], -slopes.sum::<f64>());
        }
        let (mut above, mut below) = (0.0, 0.0);
        for ((knot, y), weight) in self.x.iter().zip(&self.y).zip(weights) {
            let part = weight / (x - knot);
            above += part * y;
            below += part;
        }
        let value = above / below;
        let slope = self.x.iter().zip(&self.y).zip(weights).map(|((knot, y), weight)| {
            let apart = x - knot;
            weight / apart * ((value - y) / apart)
        });
        (value, slope.sum::<f64>() / below)
    }

    /// The k with x[k] ≤ x < x[k+1].
    fn segment(&self, x: f64) -> Option<usize> {
        let above = self.x.partition_point(|knot| *knot <= x);
        (above > 0 && above < self.x.len()).then(|| above - 1)
    }

    /// Each cell as the coefficients of a polynomial in x − x_k, lowest first: what a text without curves writes.
    pub fn cells(&self) -> Vec<Vec<f64>> {
        (0..self.x.len().saturating_sub(1))
            .map(|k| match &self.curve {
                Curve::Lines => {
                    vec![self.y[k], (self.y[k + 1] - self.y[k]) / (self.x[k + 1] - self.x[k])]
                }
                Curve::Cubic(cells) => vec![self.y[k], cells[k][0], cells[k][1], cells[k][2]],
                Curve::Polynomial(_) => self.expanded(self.x[k]),
            })
            .collect()
    }

    /// The polynomial about a point, by divided differences.
    fn expanded(&self, about: f64) -> Vec<f64> {
        let n = self.x.len();
        let mut differences = self.y.clone();
        for order in 1..n {
            for k in (order..n).rev() {
                differences[k] =
                    (differences[k] - differences[k - 1]) / (self.x[k] - self.x[k - order]);
            }
        }
        let mut coefficients = vec![0.0; n];
        for k in (0..n).rev() {
            let shift = about - self.x[k];
            for j in (0..n).rev() {
                let lower = if j > 0 { coefficients[j - 1] } else { 0.0 };
                coefficients[j] = lower + shift * coefficients[j];
            }
            coefficients[0] += differences[k];
        }
        coefficients
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = (0..n).map(|k| k as f64 * 0.7 - 1.0).collect();
        let y = x.iter().map(|x| (1.3 * x).sin()).collect();
        (x, y)
    }

    fn curves() -> Vec<Table> {
        let (x, y) = grid(9);
        vec![
            Table::lines(x.clone(), y.clone()),
            Table::akima(x.clone(), y.clone()),
            Table::natural(x.clone(), y.clone()),
            Table::polynomial(x, y).unwrap(),
        ]
    }

    #[test]
    fn curves_pass_through_their_points_and_hold_their_ends() {
        for table in curves() {
            for (x, y) in table.x.iter().zip(&table.y) {
                assert!((table.value(*x) - y).abs() < 1e-13, "{table:?} at {x}");
            }
            assert_eq!((table.value(-9.0), table.slope(99.0)), (table.y[0], 0.0));
            assert!(table.value(f64::NAN).is_nan());
        }
    }

    #[test]
    fn slopes_agree_with_differences_and_cells_with_values() {
        for table in curves() {
            for step in 0..55 {
                let x = -0.98 + 0.1 * f64::from(step);
                let h = 1e-6;
                let difference = (table.value(x + h) - table.value(x - h)) / (2.0 * h);
                assert!((table.slope(x) - difference).abs() < 1e-7, "{x}: {table:?}");
                let k = table.x.partition_point(|knot| *knot <= x) - 1;
                let u = x - table.x[k];
                let value = table.cells()[k].iter().rev().fold(0.0, |sum, c| sum * u + c);
                assert!((value - table.value(x)).abs() < 1e-11, "{x}: {table:?}");
            }
        }
    }

    #[test]
    fn smooth_curves_follow_what_they_pass_through() {
        // Lines on sin(1.3 x) with h = 0.7 err by (1.3·0.7)²/8 = 0.1, Akima's curve by half of that at most; splines by
        // (1.3·0.7)⁴·5/384 = 9e-3, twice that with the natural ends near; the polynomial by far less.
        for (table, error) in curves().into_iter().skip(1).zip([5e-2, 2e-2, 1e-3]) {
            let worst = (0..30)
                .map(|k| 0.5 + 0.1 * f64::from(k))
                .map(|x| (table.value(x) - (1.3 * x).sin()).abs())
                .fold(0.0, f64::max);
            assert!(worst < error, "{worst}: {table:?}");
        }
        // A natural spline of a line is that line; Akima's formula is 0/0 there.
        for table in [
            Table::natural(vec![0.0, 1.0, 3.0], vec![1.0, 3.0, 7.0]),
            Table::akima(vec![0.0, 1.0, 3.0], vec![1.0, 3.0, 7.0]),
        ] {
            assert!(
                (table.value(2.2) - 5.4).abs() < 1e-14 && (table.slope(0.3) - 2.0).abs() < 1e-14
            );
        }
    }
}
