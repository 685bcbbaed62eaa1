//! Measures of columns with closed forms.

use super::*;

fn number(value: f64) -> Value {
    Value::number(value)
}

fn crossing(column: usize, level: f64, edge: Edge, which: Which) -> Event {
    let (from, to) = (number(f64::NEG_INFINITY), number(f64::INFINITY));
    Event::Crossing { column, level: number(level), edge, which, from, to }
}

fn all() -> Window {
    Window::Between(number(f64::NEG_INFINITY), number(f64::INFINITY))
}

/// Measures of sin(x) and x² from 0 to 4π, in lines within 2e-7 of the range.
fn measured(kinds: Vec<Kind>) -> Vec<Outcome> {
    let measure = |(k, kind)| Measure {
        name: format!("m{k}"),
        span: Span::NONE,
        analysis: String::new(),
        kind,
    };
    let list: Vec<Measure> = kinds.into_iter().enumerate().map(measure).collect();
    let mut measures = Measures::new(&list, "tran");
    let rows = 10_000;
    for row in 0..=rows {
        let x = 4.0 * std::f64::consts::PI * f64::from(row) / f64::from(rows);
        measures.row(x, &[x.sin(), x * x]);
    }
    measures.finish()
}

fn close(outcome: &Outcome, wanted: f64, tolerance: f64) {
    let value = outcome.value.unwrap_or_else(|| panic!("{outcome:?}"));
    assert!((value - wanted).abs() <= tolerance, "{outcome:?}: {wanted}");
}

#[test]
fn crossings_of_a_sine() {
    use std::f64::consts::PI;
    let rise = |n| crossing(0, 0.5, Edge::Rise, Which::Number(n));
    let fall = |which| crossing(0, 0.5, Edge::Fall, which);
    let found = measured(vec![
        Kind::When(rise(1)),
        Kind::When(rise(2)),
        Kind::When(rise(3)),
        Kind::When(fall(Which::Last)),
        Kind::When(crossing(0, 0.5, Edge::Cross, Which::Number(3))),
        Kind::Delay(rise(1), fall(Which::Number(1))),
        Kind::Find(1, fall(Which::Number(1))),
        Kind::Find(1, Event::At(number(2.0))),
        Kind::Find(1, Event::At(number(4.0 * PI))),
        Kind::Find(1, Event::At(number(13.0))),
        Kind::Slope(0, Event::At(number(1.0))),
        Kind::Slope(1, Event::At(number(0.0))),
        Kind::Slope(0, fall(Which::Number(1))),
    ]);
    close(&found[0], PI / 6.0, 1e-6);
    close(&found[1], 2.0 * PI + PI / 6.0, 1e-6);
    assert!(found[2].why.as_deref().is_some_and(|why| why.contains("2 times only")), "{found:?}");
    close(&found[3], 2.0 * PI + 5.0 * PI / 6.0, 1e-6);
    close(&found[4], 2.0 * PI + PI / 6.0, 1e-6);
    close(&found[5], 4.0 * PI / 6.0, 1e-6);
    close(&found[6], (5.0 * PI / 6.0_f64).powi(2), 5e-6);
    close(&found[7], 4.0, 1e-6);
    close(&found[8], 16.0 * PI * PI, 1e-9);
    assert!(found[9].value.is_none());
    close(&found[10], 1.0_f64.cos(), 1e-6);
    close(&found[11], 0.0, 1e-9);
    close(&found[12], (5.0 * PI / 6.0).cos(), 1e-6);
}

#[test]
fn integrals_and_extremes() {
    use std::f64::consts::PI;
    let half = Window::Between(number(0.0), number(PI));
    let between = Window::Events(
        crossing(0, 0.0, Edge::Fall, Which::Number(1)),
        crossing(0, 0.0, Edge::Rise, Which::Number(1)),
    );
    let over = |what, window: &Window| Kind::Over(what, 0, window.clone());
    let found = measured(vec![
        over(Statistic::Average, &half),
        over(Statistic::Rms, &all()),
        over(Statistic::Integral, &half),
        over(Statistic::PeakToPeak, &all()),
        over(Statistic::MaximumAt, &half),
        over(Statistic::MinimumAt, &half),
        over(Statistic::Integral, &between),
        Kind::Over(Statistic::Maximum, 1, Window::Between(number(1.0), number(1.5))),
        Kind::Over(Statistic::Minimum, 1, Window::Between(number(20.0), number(30.0))),
    ]);
    close(&found[0], 2.0 / PI, 1e-6);
    close(&found[1], 0.5_f64.sqrt(), 1e-6);
    close(&found[2], 2.0, 1e-6);
    close(&found[3], 2.0, 1e-6);
    close(&found[4], 0.5 * PI, 2e-3);
    close(&found[5], 0.0, 0.0);
    close(&found[6], -2.0, 1e-6);
    close(&found[7], 2.25, 1e-6);
    assert!(found[8].value.is_none(), "{:?}", found[8]);
}

#[test]
fn measures_of_measures() {
    let at = |source| Event::At(Expr::leaf(source) + number(1.0));
    let found = measured(vec![
        Kind::When(crossing(1, 4.0, Edge::Rise, Which::Number(1))),
        Kind::Find(1, at(Source::Measure(0))),
        Kind::Formula(Expr::leaf(Source::Measure(0)) * Expr::leaf(Source::Measure(1))),
        Kind::Find(1, at(Source::Measure(5))),
        Kind::Formula(Expr::leaf(Source::Column(1))),
        Kind::When(crossing(0, 4.0, Edge::Rise, Which::Number(1))),
    ]);
    close(&found[0], 2.0, 1e-6);
    close(&found[1], 9.0, 1e-5);
    close(&found[2], 18.0, 1e-5);
    assert!(found[3].value.is_none());
    close(&found[4], 16.0 * std::f64::consts::PI.powi(2), 1e-9);
    assert!(found[5].value.is_none());
}

#[test]
fn jumps_and_falling_sweeps() {
    let list: Vec<Measure> = [
        Kind::Find(0, Event::At(number(1.0))),
        Kind::When(crossing(0, 0.5, Edge::Rise, Which::Number(1))),
        Kind::Over(Statistic::Integral, 0, all()),
        Kind::Over(Statistic::Average, 0, Window::Between(number(0.5), number(1.5))),
    ]
    .into_iter()
    .map(|kind| Measure { name: String::new(), span: Span::NONE, analysis: String::new(), kind })
    .collect();
    let run = |rows: &[(f64, f64)]| -> Vec<Option<f64>> {
        let mut measures = Measures::new(&list, "tran");
        rows.iter().for_each(|(x, y)| measures.row(*x, &[*y]));
        measures.finish().into_iter().map(|outcome| outcome.value).collect()
    };
    let found = run(&[(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (2.0, 2.0)]);
    assert_eq!(found, [Some(2.0), Some(1.0), Some(2.0), Some(1.0)]);
    let found = run(&[(2.0, 0.0), (0.0, 1.0)]);
    assert_eq!(found, [Some(0.5), Some(1.0), Some(-1.0), Some(0.5)]);
}
