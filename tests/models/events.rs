//! Conditions whose value jumps: when their events happen, against closed forms, and what they cost.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, run_text};
use bondspice::sim::{Interval, Statistics};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;

/// Runs a text with rows at every step, and on both sides of every jump.
#[track_caller]
fn steps(text: &str) -> (Trace, Statistics) {
    let mut map = SourceMap::default();
    let file = map.add("events.bg", text);
    let mut d = vec![];
    let run = pipeline::prepare(&mut map, file, &Overrides::default(), None, &mut d);
    let mut run = run.unwrap_or_else(|| panic!("{d:#?}"));
    run.settings.as_mut().unwrap().rows = Interval::Steps;
    let mut trace = run.trace();
    let statistics = run.go(&mut trace).unwrap_or_else(|failure| panic!("{failure:#?}"));
    (trace, statistics)
}

/// Runs a text on the grid that it asks for.
#[track_caller]
fn grid(text: &str) -> (Trace, Statistics) {
    run_text("events.bg", text, &Overrides::default()).unwrap_or_else(|d| panic!("{d:#?}"))
}

fn column<'a>(trace: &'a Trace, name: &str) -> &'a [f64] {
    trace.column(name).unwrap_or_else(|| panic!("no {name} in {:?}", trace.names))
}

/// The times with two rows.
fn jumps(trace: &Trace) -> Vec<f64> {
    let pairs = trace.time().windows(2).filter(|pair| pair[0] == pair[1]);
    let mut times: Vec<f64> = pairs.map(|pair| pair[0]).collect();
    times.dedup();
    times
}

#[track_caller]
fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    let errors = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = errors.fold(0.0, f64::max);
    println!("{} event times, the worst off by {worst:.1e} s", found.len());
    assert!(worst <= tolerance, "off by {worst:e}: {found:?} for {expected:?}");
}

#[test]
fn conditions_over_time_are_landed_on_to_the_last_digit() {
    // Every 0.3 s from 0, for 0.1 s; then a condition whose changes have no closed form: sin(7 t) = 0.3.
    let text = "signal d = if mod(time, 0.3) < 0.1 then 2 else 0\nSe:U(d) -> 1:a -> R:r(1), I:l(1)\n\
                simulate until 2 s step 0.5 s\nobserve d, f(a) as \"f\"\n";
    let (trace, statistics) = steps(text);
    let mut expected = vec![];
    for k in 0..7 {
        expected.extend([0.3 * f64::from(k), 0.3 * f64::from(k) + 0.1]);
    }
    expected.retain(|t| *t > 0.0 && *t < 2.0);
    near(&jumps(&trace), &expected, 1e-14);
    assert_eq!(statistics.rejected.event, 0, "{statistics}");
    // The current by its closed form from jump to jump.
    let (mut f, mut t) = (0.0, 0.0);
    let exact = |f: f64, dt: f64, t: f64| -> f64 {
        let d = if (t + 1e-9) % 0.3 < 0.1 { 2.0 } else { 0.0 };
        d + (f - d) * (-dt).exp()
    };
    for end in expected.iter().copied().chain([2.0]) {
        f = exact(f, end - t, t);
        t = end;
        let row = trace.time().iter().position(|time| *time >= t - 1e-12).unwrap();
        assert!((column(&trace, "f")[row] - f).abs() < 2e-6, "at {t}");
    }
    let text = "signal d = if sin(7*time) > 0.3 then 2 else 0\nSe:U(d) -> 1:a -> R:r(1), I:l(1)\n\
                simulate until 2 s step 0.5 s\nobserve d\n";
    let first = 0.3f64.asin();
    let pi = std::f64::consts::PI;
    let turn = |k: f64| [(first + 2.0 * pi * k) / 7.0, (pi - first + 2.0 * pi * k) / 7.0];
    let mut expected: Vec<f64> = (0..3).flat_map(|k| turn(f64::from(k))).collect();
    expected.retain(|t| *t < 2.0);
    near(&jumps(&steps(text).0), &expected, 1e-14);
}

#[test]
fn a_row_at_a_jump_holds_the_later_value() {
    let text = "signal a = if time > 0.5 then 1 else 0\nsignal b = if time >= 0.5 then 1 else 0\nsignal c = floor(2*time)\n\
                signal d = time > 0\nSe:U(a + b + c + d) -> R:r(1)\nsimulate until 1.25 s step 0.25 s\nobserve a, b, c, d, f(r) as \"f\"\n";
    let (trace, _) = grid(text);
    assert_eq!(column(&trace, "a"), [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    assert_eq!(column(&trace, "b"), [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    assert_eq!(column(&trace, "c"), [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]);
    assert_eq!(column(&trace, "d"), [1.0; 6]);
    assert_eq!(column(&trace, "f"), [1.0, 1.0, 4.0, 4.0, 5.0, 5.0]);
}

/// A mass of 1 kg that flies freely at 1 m/s until it meets a stop with a spring and a damper at 0.1 m.
const STOP: &str = "1:mass -> I:m(1, p0 = 1)\nsignal x = integ(f(mass))\n\
                    signal F = if x > 0.1 then 1e4*(x - 0.1) + 50*f(mass) else 0\nmass -> Se:stop(F)\n\
                    simulate until 0.3 s step 1 ms\nobserve x, f(mass) as \"v\", F\n";

#[test]
fn an_end_stop_is_met_and_left_when_it_is() {
    let (trace, statistics) = steps(STOP);
    let (decay, wd) = (25.0f64, (1e4f64 - 625.0).sqrt());
    let leaves = 0.1 + std::f64::consts::PI / wd;
    // The first is met in free flight, exactly; to the second lead steps that err by parts of 1e-6.
    near(&jumps(&trace)[..1], &[0.1], 1e-9 * 0.3);
    near(&jumps(&trace), &[0.1, leaves], 1e-8 * 0.3);
    assert_eq!((statistics.events, statistics.slides), (2, 0), "{statistics}");
    let back = -(-decay * (leaves - 0.1)).exp();
    for (row, t) in trace.time().iter().enumerate() {
        let s = t - 0.1;
        let (x, v) = if *t <= 0.1 {
            (*t, 1.0)
        } else if *t <= leaves {
            let (sin, cos) = (wd * s).sin_cos();
            let fades = (-decay * s).exp();
            (0.1 + fades * sin / wd, fades * (cos - decay / wd * sin))
        } else {
            (0.1 + back * (t - leaves), back)
        };
        assert!((column(&trace, "x")[row] - x).abs() < 2e-6 * 0.11, "x at {t}");
        assert!((column(&trace, "v")[row] - v).abs() < 2e-6 * 1.5, "v at {t}");
    }
}

#[test]
fn a_relay_slides_along_its_set_level_and_leaves_it() {
    // x' = −sign(x) + 1.5·t: from −0.5 up to 0, where it slides until the drive exceeds 1 at t = 2/3.
    let text = "signal x = integ(-sign(x) + 1.5*time, -0.1)\nSe:U(x) -> R:r(1)\nsimulate until 1 s step 10 ms\nobserve x\n";
    let (trace, statistics) = grid(text);
    assert!(statistics.slides == 1 && statistics.warnings.len() == 1, "{statistics}");
    let said = &statistics.warnings[0];
    assert_eq!(said.code, "W0803", "{said:?}");
    // −0.1 + t + 0.75·t² = 0.
    let meets = (-1.0 + (1.0f64 + 0.3).sqrt()) / 1.5;
    for (t, x) in trace.time().iter().zip(column(&trace, "x")) {
        let exact = if *t < meets {
            -0.1 + t + 0.75 * t * t
        } else if *t < 2.0 / 3.0 {
            0.0
        } else {
            0.75 * (t - 2.0 / 3.0) * (t - 2.0 / 3.0)
        };
        assert!((x - exact).abs() < 2e-6, "{x} for {exact} at {t}: {statistics}");
    }
}

#[test]
fn a_guard_that_dips_below_its_threshold_within_a_step_is_seen() {
    // x = 1 − cos(t) is below 1e-4 around 2π for 0.028 s only; then the current jumps.
    let text = "1:a -> I:l(1), C:c(1, q0 = 1)\nsignal x = 1 - e(c)\nsignal n = integ(if x < 1e-4 then 1 else 0)\n\
                Se:U(n) -> R:r(1)\nsimulate until 10 s step 1 s\noptions reltol = 1e-9\nobserve n\n";
    let (trace, statistics) = grid(text);
    let half = (1.0f64 - 1e-4).acos();
    let end = *column(&trace, "n").last().unwrap();
    assert!((end - 3.0 * half).abs() < 1e-6, "{end} for {}: {statistics}", 3.0 * half);
    assert_eq!(statistics.events, 3, "{statistics}");
}

#[test]
fn guards_that_cross_together_do_so_at_one_instant() {
    // Both reach 1 at t = 0.5, written differently; each adds 1 from then on.
    let text = "signal x = integ(2)\nsignal y = integ(4*time + 1)\nsignal u = (x > 1) + (y > 1) + (1 <= x)\n\
                Se:U(u) -> 1:a -> R:r(1), I:l(1)\nsimulate until 1 s step 0.1 s\nobserve u\n";
    let (trace, statistics) = steps(text);
    near(&jumps(&trace), &[0.5], 1e-12);
    assert_eq!(column(&trace, "u").last(), Some(&3.0));
    assert_eq!(statistics.events, 2, "{statistics}");
}

#[test]
fn a_guard_that_starts_on_its_threshold_or_rests_there_is_no_trouble() {
    // x starts exactly on 1 and falls; y stays exactly on 0 until 0.5 s.
    let text = "signal x = integ(-1, 1)\nsignal y = integ(if time < 0.5 then 0 else 1)\n\
                signal u = (x >= 1) + 2*(y > 0) + 4*(y == 0)\nSe:U(u) -> 1:a -> R:r(1), I:l(1)\n\
                simulate until 1 s step 0.25 s\nobserve u\n";
    let (trace, statistics) = grid(text);
    assert_eq!(column(&trace, "u"), [5.0, 4.0, 4.0, 2.0, 2.0], "{statistics}");
    assert_eq!(statistics.slides, 0, "{statistics}");
}

#[test]
fn whole_numbers_are_counted_up_and_down() {
    // floor of 2.5·sin(t): ±1, ±2 and 0 are passed at asin(n/2.5).
    let text = "1:a -> I:l(1, p0 = 2.5), C:c(1)\nsignal n = floor(e(c))\nSe:U(n) -> 1:b -> R:r(1), I:k(1)\n\
                simulate until 6 s step 1 s\nobserve n\n";
    let (trace, _) = steps(text);
    let pi = std::f64::consts::PI;
    let (one, two) = ((1.0f64 / 2.5).asin(), (2.0f64 / 2.5).asin());
    let expected =
        [one, two, pi - two, pi - one, pi, pi + one, pi + two, 2.0 * pi - two, 2.0 * pi - one];
    // The integrator's own error moves the events: reltol 1e-6.
    near(&jumps(&trace), &expected, 1e-5);
    assert_eq!(column(&trace, "n").first(), Some(&0.0));
    assert_eq!(column(&trace, "n").last(), Some(&-1.0));
}

#[test]
fn kinks_are_no_events() {
    // A clamp, a magnitude, a dead zone written with `if`: nothing jumps.
    let text = "1:a -> I:l(1, p0 = 1), C:c(1), R:r(e = 0.1*abs(f) + 0.2*(if e(c) > 0.5 then e(c) - 0.5 else 0))\n\
                signal s = clamp(3*e(c), -1, 1)\nSe:U(s) -> R:k(1)\nsimulate until 10 s step 0.1 s\nobserve s\n";
    let (_, statistics) = grid(text);
    assert_eq!((statistics.events, statistics.slides), (0, 0), "{statistics}");
}

#[test]
fn hard_limits_of_the_actuator_cost_no_events() {
    let path = format!("{}/models/eha_one_line.bg", env!("CARGO_MANIFEST_DIR"));
    let overrides = Overrides {
        drive: vec!["x_ref = step(0.1 s, 0 mm, 20 mm)".into()],
        until: Some("1 s".into()),
        ..Overrides::default()
    };
    let text = std::fs::read_to_string(path).unwrap();
    let (_, statistics) = run_text("eha_one_line.bg", &text, &overrides).unwrap();
    assert_eq!((statistics.events, statistics.rejected.event), (0, 0), "{statistics}");
}

#[test]
fn a_loop_without_a_consistent_side_slides() {
    // v = sign(0.2 − v) has no solution with 0.2 − v on either side; between them v = 0.2.
    let text = "loop\nV1 a 0 0.2\nB1 b 0 V=sgn(v(a)-v(b))\nR1 b 0 1\n.print tran v(b)\n.tran 0.1 1 uic\n.end\n";
    let (trace, statistics) = run_text("loop.cir", text, &Overrides::default()).unwrap();
    assert_eq!(statistics.warnings.len(), 1, "{statistics}");
    for v in column(&trace, "v(b)") {
        assert!((v - 0.2).abs() < 1e-5, "{v}");
    }
}

#[test]
fn a_system_whose_events_accumulate_comes_to_its_end() {
    // Levant's twisting algorithm: both x and v are 0 after finite time and infinitely many switchings.
    let text = "signal x = integ(v, 1)\nsignal v = integ(-2*sign(x) - sign(v))\nSe:U(x) -> R:r(1)\n\
                simulate until 10 s step 10 ms\nobserve x, v\n";
    let (trace, statistics) = grid(text);
    println!("{statistics}");
    assert!(statistics.accepted < 20_000, "{statistics}");
    assert!(column(&trace, "x").last().unwrap().abs() < 1e-4, "{statistics}");
}

#[test]
fn switches_without_hysteresis_slide_along_their_threshold() {
    // 1 V through 1 kOhm onto a switch that closes above 0.5 V of its own and opens below: it holds 0.5 V, at once or, with
    // a capacitor of 1 uF, from ln 2 of the time constant on; while it does, it takes 0.5 mA.
    for (capacitor, tolerance) in [("", 1e-6), ("C1 b 0 1u ic=0\n", 1e-6)] {
        let text = format!(
            "a switch that opens itself\nV1 a 0 1\nR1 a b 1k\n{capacitor}S1 b 0 b 0 sm\n\
             .model sm sw(vt=0.5 vh=0 ron=1 roff=1e9)\n.options reltol=1e-6\n.print tran v(b) i(v1)\n.tran 10u 5m uic\n.end\n"
        );
        let run = run_text("slides.cir", &text, &Overrides::default());
        let (trace, statistics) = run.unwrap_or_else(|d| panic!("{d:#?}"));
        assert_eq!(statistics.warnings.len(), 1, "{statistics}");
        assert_eq!(statistics.warnings[0].code, "W0803", "{statistics}");
        assert!(statistics.warnings[0].message.contains("`S1`"), "{:?}", statistics.warnings[0]);
        let mut rows = 0;
        for ((t, v), i) in
            trace.time().iter().zip(column(&trace, "v(b)")).zip(column(&trace, "i(v1)"))
        {
            let free = 1.0 - (-t / 1e-3).exp();
            let exact = if capacitor.is_empty() { 0.5 } else { free.min(0.5) };
            assert!((v - exact).abs() <= tolerance, "{v} for {exact} at {t}: {statistics}");
            assert!((i + (1.0 - exact) / 1e3).abs() <= tolerance * 1e-3, "{i} at {t}");
            rows += 1;
        }
        assert!(rows >= 5 && statistics.accepted < 2000, "{statistics}");
    }
}
