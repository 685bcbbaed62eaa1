//! Where the search for roots begins: on circles that hold as many roots as p'/p says.

use super::Pencil;
use crate::linear::Complex;

/// Roots are sought from here to there; those within the first circle lie at 0.
const LEAST: f64 = 1e-20;
const MOST: f64 = 1e30;
/// From circle to circle.
const RATIO: f64 = 1.778_279_410_038_922_8;
/// Directions in the upper half plane at which p'/p is asked; p is real, so that the lower half says the same.
const RAYS: [f64; 4] = [0.35, 1.13, 1.92, 2.8];

/// One place for each of `count` roots but for those at 0.
pub fn guesses(pencil: &mut Pencil, count: usize) -> Vec<Complex> {
    if count == 0 {
        return vec![];
    }
    let goal = count as f64;
    // (radius, roots within) from the smallest circle up; the counts never fall.
    let mut circles = vec![(1.0, within(pencil, 1.0, count))];
    while let Some(&(radius, inside)) = circles.first()
        && inside > 0.2
        && radius > LEAST
    {
        circles.insert(0, (radius / RATIO, within(pencil, radius / RATIO, count)));
    }
    while let Some(&(radius, inside)) = circles.last()
        && inside < goal - 0.2
        && radius < MOST
    {
        circles.push((radius * RATIO, within(pencil, radius * RATIO, count)));
    }
    let mut most: f64 = 0.0;
    for (_, inside) in &mut circles {
        most = most.max(*inside);
        *inside = most;
    }
    let zeros = match circles[0] {
        (radius, inside) if radius <= LEAST => (inside.round() as usize).min(count),
        _ => 0,
    };
    (zeros..count)
        .map(|k| {
            let radius = radius_of(&circles, k as f64 + 0.5);
            // Turned by the golden ratio each time: no two alike, none on an axis of symmetry.
            let turn = 0.7 + 2.399_963_229_728_653 * k as f64;
            let (sine, cosine) = libm::sincos(turn);
            Complex::new(radius * cosine, radius * sine)
        })
        .collect()
}

/// The circle that so many roots lie within.
fn radius_of(circles: &[(f64, f64)], number: f64) -> f64 {
    let above = circles.iter().position(|(_, inside)| *inside >= number);
    match above {
        Some(0) => circles[0].0,
        Some(k) => {
            let ((a, low), (b, high)) = (circles[k - 1], circles[k]);
            a * libm::pow(b / a, (number - low) / (high - low))
        }
        None => circles.last().map_or(1.0, |(radius, _)| *radius),
    }
}

/// About how many roots lie within a circle: the mean of Re(s·p'/p) along it.
fn within(pencil: &mut Pencil, radius: f64, count: usize) -> f64 {
    let (mut sum, mut rays) = (0.0, 0);
    for turn in RAYS {
        let (sine, cosine) = libm::sincos(turn);
        let s = Complex::new(radius * cosine, radius * sine);
        if let Some(slope) = pencil.slope(s) {
            sum += (s * slope).re.clamp(0.0, count as f64);
            rays += 1;
        }
    }
    if rays == 0 { 0.0 } else { sum / f64::from(rays) }
}
