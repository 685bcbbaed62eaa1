//! Axes with known ticks, panels of small traces.

use super::axis::Ruler;
use super::*;
use crate::draw::picture::Shape;
use crate::draw::svg;
use crate::trace::Trace;

fn trace(names: &[&str], units: &[&str], columns: Vec<Vec<f64>>) -> Trace {
    let text = |list: &[&str]| list.iter().map(|s| s.to_string()).collect();
    Trace { names: text(names), units: text(units), columns }
}

#[test]
fn ticks_are_round_numbers_with_the_digits_they_need() {
    let texts =
        |low, high, step| ticks(low, high, step).into_iter().map(|t| t.1).collect::<Vec<_>>();
    assert_eq!(texts(-0.9, 0.4, 0.29), ["−0.87", "−0.58", "−0.29", "0", "0.29"]);
    assert_eq!(texts(0.0, 3.8, 1.0), ["0", "1", "2", "3"]);
    assert_eq!(texts(0.0, 4e6, 2e6), ["0", "2e6", "4e6"]);
    let log = Axis { scale: Scale::Logarithmic, ..Axis::default() };
    let ruler = Ruler::new(&log, [1.0, 1000.0].into_iter(), 9, true);
    let texts: Vec<&str> = ruler.ticks.iter().map(|t| t.1.as_str()).collect();
    assert_eq!(texts, ["1", "10", "100", "1000"]);
    assert!((ruler.place(10.0) - 1.0 / 3.0).abs() < 1e-15 && ruler.place(0.0).is_nan());
}

#[test]
fn columns_of_one_unit_share_a_panel() {
    let time = vec![0.0, 1.0];
    let own = trace(
        &["time", "u", "v", "i", "w"],
        &["s", "V", "V", "A", ""],
        vec![time.clone(), time.clone(), time.clone(), time.clone(), time],
    );
    let source = Source { name: "run", trace: &own };
    let found = panels(&[source], &Choice::default()).unwrap();
    let labels: Vec<&str> = found.iter().map(|panel| panel.y.label.as_str()).collect();
    assert_eq!(labels, ["[V]", "i [A]", "w"]);
    assert_eq!(found[0].curves.len(), 2);
    let choice = Choice {
        per_unit: vec![("i".into(), 4.0)],
        signals: vec!["i".into()],
        ..Choice::default()
    };
    let found = panels(&[source, source], &choice).unwrap();
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].curves[1].points[1], (1.0, 0.25));
    assert_eq!(found[0].curves[1].name, "i (run)");
    let choice = Choice { signals: vec!["x".into()], ..Choice::default() };
    assert_eq!(panels(&[source], &choice).unwrap_err(), Missing("x".into()));
}

#[test]
fn a_lag_of_first_order_has_its_bode_plot() {
    let f: Vec<f64> = (0..=40).map(|k| libm::pow(10.0, 0.1 * f64::from(k) - 2.0)).collect();
    // 1/(1 + j f), three times over: the phase goes to −270 degrees without a jump.
    let cube = |f: &f64| {
        let (re, im) = (1.0 / (1.0 + f * f), -f / (1.0 + f * f));
        let (a, b) = (re * re - im * im, 2.0 * re * im);
        (a * re - b * im, a * im + b * re)
    };
    let (re, im) = f.iter().map(cube).unzip();
    let own = trace(&["frequency", "h.re", "h.im"], &["Hz", "", ""], vec![f, re, im]);
    let source = Source { name: "ac", trace: &own };
    let found = panels(&[source], &Choice::default()).unwrap();
    assert_eq!(found.len(), 2);
    let at_corner = found[0].curves[0].points[20];
    assert!((at_corner.1 + 30.0 * libm::log10(2.0)).abs() < 1e-9, "{at_corner:?}");
    let phases = &found[1].curves[0].points;
    assert!((phases[20].1 + 135.0).abs() < 1e-9);
    assert!((phases[40].1 + 270.0).abs() < 2.0);
    let nyquist = Choice { kind: Kind::Nyquist, ..Choice::default() };
    let found = panels(&[source], &nyquist).unwrap();
    assert!(found.len() == 1 && found[0].equal && found[0].marks[0].at == (-1.0, 0.0));
}

#[test]
fn a_table_of_runs_is_drawn_as_points() {
    let table = |l: [f64; 3]| {
        let columns = vec![vec![0.0, 1.0, 2.0], l.to_vec(), vec![5.0, 7.0, 6.0]];
        trace(&["run", "L", "peak"], &["", "", ""], columns)
    };
    let choice =
        Choice { signals: vec!["peak".into()], over: Some("L".into()), ..Choice::default() };
    // In order they are joined by a line, drawn by chance they are not.
    for (l, line) in [([1.0, 2.0, 3.0], 3), ([2.0, 1.0, 3.0], 0)] {
        let own = table(l);
        let found = panels(&[Source { name: "sweep", trace: &own }], &choice).unwrap();
        assert_eq!((found[0].marks.len(), found[0].curves[0].points.len()), (3, line));
    }
}

#[test]
fn a_million_points_are_drawn_by_what_can_be_seen_of_them() {
    let time: Vec<f64> = (0..1_000_000).map(|k| f64::from(k) * 1e-6).collect();
    let mut x: Vec<f64> = time.iter().map(|t| libm::sin(40.0 * t)).collect();
    x[123_456] = 3.0;
    let own = trace(&["time", "x"], &["s", "m"], vec![time, x]);
    let found = panels(&[Source { name: "run", trace: &own }], &Choice::default()).unwrap();
    let picture = paint("", &found);
    let drawn: Vec<&Vec<(f64, f64)>> = picture
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            Shape::Line { points, .. } if points.len() > 10 => Some(points),
            _ => None,
        })
        .collect();
    assert_eq!(drawn.len(), 1);
    assert!(drawn[0].len() < 4000, "{}", drawn[0].len());
    // The spike of one row is still there: it alone is as high as this.
    let top = drawn[0].iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let others = drawn[0].iter().filter(|p| p.1 < top + 20.0).count();
    assert!(others <= 3, "{others}");
    assert!(svg::write(&picture).len() < 60_000);
}

#[test]
fn a_part_of_the_abscissa_fills_the_panel() {
    let time: Vec<f64> = (0..100).map(f64::from).collect();
    let own = trace(&["time", "x"], &["s", "m"], vec![time.clone(), time]);
    let choice = Choice { limits: Some((10.0, 20.0)), ..Choice::default() };
    let found = panels(&[Source { name: "run", trace: &own }], &choice).unwrap();
    let picture = paint("", &found);
    let texts: Vec<&str> = picture
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            Shape::Words { words, .. } => Some(words.text.as_str()),
            _ => None,
        })
        .collect();
    assert!(texts.contains(&"20") && !texts.contains(&"40"), "{texts:?}");
}

#[test]
fn text_for_a_terminal_shows_the_curve() {
    let time: Vec<f64> = (0..100).map(f64::from).collect();
    let own = trace(&["time", "x"], &["s", "m"], vec![time.clone(), time]);
    let found = panels(&[Source { name: "run", trace: &own }], &Choice::default()).unwrap();
    let text = terminal(&found, 60, 8);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("x [m]"), "{text}");
    assert!(lines[1].trim_end().ends_with(|c| ('\u{2801}'..='\u{28ff}').contains(&c)), "{text}");
    assert!(text.contains("time [s]"));
    assert!(lines.iter().all(|line| line.chars().count() <= 60), "{text}");
}
