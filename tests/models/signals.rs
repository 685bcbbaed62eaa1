//! Every function of signals against a closed form: simulated, integrated by the second route, read back from its own
//! netlist, and in ngspice.

use bondspice::bond::causality;
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline;
use bondspice::second;
use bondspice::source::SourceMap;
use bondspice::trace::{Trace, compare, formats};
use std::process::Command;

/// A model that observes signals, and what they are.
struct Case<'a> {
    name: &'a str,
    text: &'a str,
    /// Each observed signal and its closed form, right-continuous.
    exact: &'a [(&'a str, &'a dyn Fn(f64) -> f64)],
    /// Errors in parts of each signal's range: of our routes, and of ngspice (`None`: it is not asked).
    ours: f64,
    ngspice: Option<f64>,
    /// Whether the second route is asked.
    second: bool,
    /// Rows so near to a jump of the closed form are not compared.
    near: f64,
}

const CASE: Case = Case {
    name: "",
    text: "",
    exact: &[],
    ours: 1e-6,
    ngspice: Some(1e-3),
    second: true,
    near: 0.0,
};

/// A text with a bond in it, which every graph needs.
fn with_bond(text: &str) -> String {
    format!("Se:source_(1) -> R:load_(1)\n{text}\n")
}

/// The largest error of a trace against the closed forms, in parts of their range, for each signal.
fn errors(
    case: &Case,
    times: &[f64],
    column: &dyn Fn(&str) -> Vec<f64>,
) -> Vec<(String, f64, f64)> {
    case.exact
        .iter()
        .map(|(name, exact)| {
            let values = column(name);
            assert_eq!(values.len(), times.len());
            let truth: Vec<f64> = times.iter().map(|t| exact(*t)).collect();
            let low = truth.iter().copied().fold(f64::INFINITY, f64::min);
            let high = truth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!(high > low, "{}: {name} does not move", case.name);
            let mut worst = (0.0, f64::NAN);
            for ((t, ours), truth) in times.iter().zip(&values).zip(&truth) {
                let jumps = |by: f64| {
                    let moved = (exact(t + by) - truth).abs();
                    case.near > 0.0 && moved > 5e-4 * (high - low)
                };
                if jumps(case.near) || jumps(-case.near) {
                    continue;
                }
                let error = (ours - truth).abs() / (high - low);
                if error > worst.0 || error.is_nan() {
                    worst = (error, *t);
                }
            }
            (name.to_string(), worst.0, worst.1)
        })
        .collect()
}

#[track_caller]
fn hold(case: &Case, route: &str, errors: &[(String, f64, f64)], most: f64) {
    let text: Vec<String> =
        errors.iter().map(|(name, error, at)| format!("{name} {error:.1e} at {at}")).collect();
    println!("{} {route}: {}", case.name, text.join(", "));
    for (name, error, at) in errors {
        assert!(
            *error <= most,
            "{} {route}: {name} is off by {error:e} of its range at {at}",
            case.name
        );
    }
}

#[track_caller]
fn check(case: &Case) {
    let text = with_bond(case.text);
    let name = format!("{}.bg", case.name);
    let (trace, statistics) = pipeline::run_text(&name, &text, &Overrides::default())
        .unwrap_or_else(|d| panic!("{}: {d:#?}", case.name));
    println!("{}: {} steps", case.name, statistics.accepted);
    let column = |name: &str| trace.column(name).unwrap().to_vec();
    hold(case, "simulated", &errors(case, trace.time(), &column), case.ours);

    let mut map = SourceMap::default();
    let (file, mut d) = (map.add(name, &*text), vec![]);
    let graph = pipeline::graph(&mut map, file, &Overrides::default(), &mut d).unwrap();
    let causality = causality::assign(&graph, &mut d).unwrap();
    let run = second::integrate(&graph, &causality, trace.time(), &Default::default(), &mut d);
    let run = run.unwrap_or_else(|| panic!("{}: {d:#?}", case.name));
    let column = |name: &str| {
        let at = run.names.iter().position(|known| known == name).unwrap();
        run.columns[at].clone()
    };
    if case.second {
        hold(case, "second route", &errors(case, &run.columns[0], &column), case.ours);
    }

    let model = pipeline::model(&mut map, file, &Overrides::default(), &mut d).unwrap();
    let deck = bondspice::netlist::write::write(&model.translation.netlist);
    let back = format!("{}.cir", case.name);
    let (back, _) = pipeline::run_text(&back, &deck, &Overrides::default())
        .unwrap_or_else(|d| panic!("{}: {d:#?}\n{deck}", case.name));
    let settings = compare::Settings { tolerance: 1e-12, rise: Some(0.0), signals: None };
    let comparison = compare::compare(&back, &trace, &settings);
    for signal in &comparison.signals {
        assert!(signal.max <= 1e-12, "{} read back: {} {:e}", case.name, signal.name, signal.max);
    }

    let Some(most) = case.ngspice else { return };
    let Some(result) = ngspice(case.name, &deck) else { return };
    let column =
        |name: &str| result.column(&format!("v({})", name.to_lowercase())).unwrap().to_vec();
    let near = case.near.max(2e-3 * (trace.time()[1] - trace.time()[0]));
    let case = Case { near, ..*case };
    hold(&case, "ngspice", &errors(&case, result.time(), &column), most);
}

/// A deck's run in ngspice, where it is installed.
fn ngspice(name: &str, deck: &str) -> Option<Trace> {
    if !crate::peers::has("ngspice") {
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, raw) = (folder.path().join("deck.cir"), folder.path().join("deck.raw"));
    std::fs::write(&path, deck).unwrap();
    let output = Command::new("ngspice").arg("-b").arg("-r").arg(&raw).arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).to_string()
        + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}\n{said}\n{deck}");
    let bytes = std::fs::read(&raw).unwrap_or_else(|_| panic!("{name}\n{said}\n{deck}"));
    Some(formats::read("deck.raw", &bytes).unwrap())
}

fn exp(x: f64) -> f64 {
    x.exp()
}

#[test]
fn leadlag() {
    // Y/X = (1 + 0.3 s)/(1 + 0.1 s) on a step of 2 at 0.1: 2 (1 + 2 exp(−t/0.1)); on a constant 1 from the start
    // 1 + 2 exp(−t/0.1), since the state starts at 0.
    check(&Case {
        name: "leadlag",
        text: "signal u = step(0.1 s, 0, 2)\nsignal y = leadlag(u, 0.3 s, 0.1 s)\nsignal z = leadlag(1, 0.3, 0.1)\n\
               simulate until 1 s step 1 ms\nobserve y, z",
        exact: &[
            ("y", &|t| if t < 0.1 - 1e-9 { 0.0 } else { 2.0 * (1.0 + 2.0 * exp((0.1 - t) / 0.1)) }),
            ("z", &|t| 1.0 + 2.0 * exp(-t / 0.1)),
        ],
        ..CASE
    });
}

#[test]
fn derivative() {
    // s/(tau s + 1) on cos(w t), without a kick: z' = (x − z)/tau from z(0) = x(0) = 1.
    // z = A cos + B sin + D exp(−t/tau), A = 1/(1 + w²tau²), B = w tau A, D = 1 − A; y = (cos(w t) − z)/tau.
    let (w, tau) = (std::f64::consts::TAU * 5.0, 0.01);
    let a = 1.0 / (1.0 + w * w * tau * tau);
    let y = move |t: f64| {
        let z = a * (w * t).cos() + w * tau * a * (w * t).sin() + (1.0 - a) * exp(-t / tau);
        ((w * t).cos() - z) / tau
    };
    check(&Case {
        name: "der",
        text: "signal u = sine(0, 1, 5 Hz, 0, 0, 90 deg)\nsignal y = der(u, 10 ms)\nsimulate until 1 s step 1 ms\nobserve y",
        exact: &[("y", &y)],
        ..CASE
    });
}

#[test]
fn pid() {
    // On a step of 1 at 0: y = Kp + Ki t + Kd/tau exp(−t/tau) would have a kick; from 0 the state follows: with
    // x = ramp(0.1, 2): y = 2 Kp s + Ki s² + 2 Kd (1 − exp(−s/tau)), s = t − 0.1, limited to 1.2.
    check(&Case {
        name: "pid",
        text: "signal u = ramp(0.1 s, 2)\nsignal y = pid(u, Kp = 0.5, Ki = 0.8, Kd = 0.1, tau = 20 ms)\n\
               signal z = pid(u, Kp = 0.5, Ki = 0.8, Kd = 0.1, tau = 20 ms, lo = -1, hi = 0.7, z0 = 0.1)\n\
               simulate until 1 s step 1 ms\nobserve y, z",
        exact: &[
            ("y", &|t| {
                let s = (t - 0.1f64).max(0.0);
                s + 0.8 * s * s + 0.2 * (1.0 - exp(-s / 0.02))
            }),
            ("z", &|t| {
                let s = (t - 0.1f64).max(0.0);
                (0.1 + s + 0.8 * s * s + 0.2 * (1.0 - exp(-s / 0.02))).min(0.7)
            }),
        ],
        ..CASE
    });
}

#[test]
fn transfer_functions() {
    // Partial fractions on a unit step at 0.1; the last with coefficients of 1e20 and poles at 1 and 1e4.
    let on = |t: f64| (t - 0.1).max(0.0);
    let (w, d) = (20.0f64, 0.3f64);
    let wd = w * (1.0 - d * d).sqrt();
    check(&Case {
        name: "tf",
        text: "param wn = 20 s^-1\nparam zeta = 0.3\nsignal u = step(0.1 s, 0, 1)\n\
               signal a = tf([wn^2], [1, 2*zeta*wn, wn^2], u)\n\
               signal b = tf([1, 3], [1, 3, 2], u)\n\
               signal c = tf([2, 0, 1], [1, 3, 2], u)\n\
               signal g = tf([1e20, 1e24], [1e20, 1.0001e24, 1e24], u)\n\
               signal k = tf([3], [0, 2], u)\nsignal h = tf([2], [1, 0, 0], u)\n\
               simulate until 1 s step 1 ms\nobserve a, b, c, g, k, h",
        exact: &[
            ("a", &move |t| {
                let s = on(t);
                1.0 - exp(-d * w * s) * ((wd * s).cos() + d * w / wd * (wd * s).sin())
            }),
            // (s + 3)/((s + 1)(s + 2)) = 2/(s + 1) − 1/(s + 2)
            ("b", &|t| 2.0 * (1.0 - exp(-on(t))) - 0.5 * (1.0 - exp(-2.0 * on(t)))),
            // (2s² + 1)/((s + 1)(s + 2)) = 2 + 3/(s + 1) − 9/(s + 2)
            ("c", &|t| {
                let s = on(t);
                if t < 0.1 - 1e-9 {
                    0.0
                } else {
                    2.0 + 3.0 * (1.0 - exp(-s)) - 4.5 * (1.0 - exp(-2.0 * s))
                }
            }),
            // (s + 1e4)/((s + 1)(s + 1e4)) = 1/(s + 1)
            ("g", &|t| 1.0 - exp(-on(t))),
            ("k", &|t| if t < 0.1 - 1e-9 { 0.0 } else { 1.5 }),
            ("h", &|t| on(t) * on(t)),
        ],
        ..CASE
    });
}

#[test]
fn table_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    std::fs::write(&path, "# of a sensor\nangle [deg], \"torque\"\n0, 1\n\n180, 3\n360, 2\n")
        .unwrap();
    let text = format!(
        "signal u = ramp(0, 10)\nsignal y = table(u, file(\"{}\"))\nsimulate until 1 s step 1 ms\nobserve y",
        path.display()
    );
    let pi = std::f64::consts::PI;
    let y = move |t: f64| {
        let x = 10.0 * t / pi;
        if x < 1.0 { 1.0 + 2.0 * x } else { (4.0 - x).max(2.0) }
    };
    let mut map = SourceMap::default();
    let (file, mut d) = (map.add("table.bg", with_bond(&text)), vec![]);
    let run = pipeline::prepare(&mut map, file, &Overrides::default(), None, &mut d).unwrap();
    assert!(d.is_empty(), "{d:#?}");
    let mut trace = run.trace();
    run.go(&mut trace).unwrap();
    for (t, ours) in trace.time().iter().zip(trace.column("y").unwrap()) {
        assert!((ours - y(*t)).abs() < 1e-12, "{t}: {ours}");
    }
}

#[test]
fn comparisons_and_modulated_pulses() {
    check(&Case {
        name: "compare",
        text: "signal u = sine(0, 1, 2 Hz)\nsignal y = compare(u, 0.3)\nsignal d = ramp(0, 0.8)\nsignal w = pwm(d, 20 Hz)\n\
               signal m = integ(w)\nsimulate until 0.999 s step 1 ms\nobserve y, w, m",
        exact: &[
            ("y", &|t| f64::from((std::f64::consts::TAU * 2.0 * t).sin() > 0.3)),
            // It is on while frac(20 t) < 0.8 t: in period k from k/20 to k/20/(1 − 0.04).
            ("w", &|t| f64::from((20.0 * t + 1e-9).fract() - 1e-9 < 0.8 * t && t > 0.0)),
            ("m", &|t| {
                let on = |k: f64| k / 20.0 * (1.0 / 0.96 - 1.0);
                let k = (20.0 * t + 1e-9).floor();
                let past: f64 = (0..k as u32).map(|j| on(f64::from(j))).sum();
                past + (t - k / 20.0).min(on(k))
            }),
        ],
        ..CASE
    });
}

#[test]
fn what_jumps_on_a_row_has_jumped_there() {
    // Every edge stands on a row. What would jump at the end of the run has not jumped in its last row.
    let part_of = |t: f64, period: f64| (t.min(1.0 - 1e-6) / period + 1e-9).fract();
    let on = |t: f64, period: f64, part: f64| f64::from(part_of(t, period) < part);
    let charge = |t: f64| {
        let mut y = 1.0;
        for k in 0..100 {
            let s = (t - 0.01 * f64::from(k)).clamp(0.0, 0.01);
            let u = on(0.01 * f64::from(k), 0.1, 0.3);
            y = u + (y - u) * exp(-s / 0.05);
        }
        y
    };
    check(&Case {
        name: "edges_on_rows",
        text: "signal w = pwm(0.3, 10 Hz)\nsignal v = pwm(0.42 + 0*w, 50 Hz)\nsignal y = lag(w, 50 ms)\nsignal h = sample(time, 0.1)\n\
               signal s = step(0.5, 0, 2) + step(1, 0, 2)\nsignal r = pulse(0, 1, 0.2, 0, 0, 0.1, 0.4)\n\
               simulate until 1 s step 2 ms\nobserve w, v, y, h, s, r",
        exact: &[
            ("w", &|t| on(t, 0.1, 0.3)),
            ("v", &|t| on(t, 0.02, 0.42)),
            ("y", &charge),
            ("h", &|t| ((10.0 * t + 1e-9).floor() / 10.0).min(0.9)),
            ("s", &|t| if from(t, 0.5) { 2.0 } else { 0.0 }),
            ("r", &|t| f64::from(from(t, 0.2) && part_of(t.min(1.0 - 1e-6) - 0.2, 0.4) < 0.25)),
        ],
        // Its clock of samples is as late as a part of their time.
        ngspice: None,
        ..CASE
    });
}

/// Whether a time is at or after another, grids being what they are.
fn from(t: f64, start: f64) -> bool {
    t >= start - 1e-9
}

#[test]
fn delays() {
    // A jump, a bend and a smooth curve, later; a delay of a delay; a delay in a loop, y(t) = 1 − y(t − 0.1)/2 from
    // y = 1 (the delay gives 0 at first in the loop, and what it then remembers is 1).
    let w = std::f64::consts::TAU * 3.0;
    let u = move |t: f64| if from(t, 0.2) { 1.0 + (w * (t - 0.2)).sin() } else { 0.5 };
    check(&Case {
        name: "delay",
        text: "signal u = 0.5 + step(0.2, 0, 0.5) + sine(0, 1, 3, 0.2)\nsignal a = delay(u, 0.13)\nsignal b = delay(a, 70 ms)\n\
               signal m = integ(b)\nsignal r = delay(ramp(0, 1), 0.25)\nsignal s = delay(time^2, 0.1)\n\
               simulate until 1 s step 1 ms\nobserve a, b, m, r, s",
        exact: &[
            ("a", &|t| u(t - 0.13)),
            ("b", &|t| u(t - 0.2)),
            ("m", &|t| {
                let s = t - 0.4;
                if s < 0.0 { 0.5 * t } else { 0.2 + s + (1.0 - (w * s).cos()) / w }
            }),
            ("r", &|t| (t - 0.25).max(0.0)),
            ("s", &|t| (t - 0.1).max(0.0).powi(2)),
        ],
        near: 1e-6,
        ..CASE
    });
}

#[test]
fn delays_in_loops() {
    // y' = −y(t − 1) from y = 1 before: by steps, y = 1 − t, then 1 − t + (t − 1)²/2, then with −(t − 2)³/6.
    check(&Case {
        name: "delayed_feedback",
        text: "signal y = integ(-delay(y, 1), 1)\nsimulate until 3 s step 10 ms\nobserve y",
        exact: &[("y", &|t| {
            let part = |k: f64, power: i32, over: f64| {
                let s = (t - k).max(0.0);
                if power % 2 == 0 { s.powi(power) / over } else { -s.powi(power) / over }
            };
            1.0 + part(0.0, 1, 1.0) + part(1.0, 2, 2.0) + part(2.0, 3, 6.0)
        })],
        ..CASE
    });
}

#[test]
fn samples() {
    // A held sine, its integral, one that holds another, a counter (in a ring the old value is read), a coarser one.
    let held = |t: f64, period: f64| ((t + 1e-9) / period).floor() * period;
    let x = |t: f64| (5.0 * t).sin() + if from(t, 0.3) { 1.0 } else { 0.0 };
    check(&Case {
        name: "sample",
        text: "signal x = sine(0, 1, 5/(2*pi)) + step(0.3, 0, 1)\nsignal a = sample(x, 0.1)\nsignal b = 2*a\nsignal c = sample(b + 1, 50 ms)\n\
               signal n = sample(n + 1, 0.2)\nsignal m = integ(a)\nsimulate until 0.99 s step 1 ms\nobserve a, c, n, m",
        exact: &[
            ("a", &|t| x(held(t, 0.1))),
            ("c", &|t| 2.0 * x(held(held(t, 0.05), 0.1)) + 1.0),
            ("n", &|t| 1.0 + ((t + 1e-9) / 0.2).floor()),
            ("m", &|t| {
                let last = held(t, 0.1);
                let turns = (last / 0.1).round() as u32;
                (0..turns).map(|k| 0.1 * x(0.1 * f64::from(k))).sum::<f64>() + (t - last) * x(last)
            }),
        ],
        near: 1e-6,
        // In ngspice a sample of a sample at the same instant sees it on its way, and a ring of one counts on while it
        // is sampled: a and i alone could be compared.
        ngspice: None,
        ..CASE
    });
    check(&Case {
        name: "sampled_sine",
        text: "signal x = sine(0, 1, 5/(2*pi))\nsignal a = sample(x, 0.1)\nsignal m = integ(a)\n\
               simulate until 0.99 s step 1 ms\nobserve a, m",
        exact: &[("a", &|t| (5.0 * held(t, 0.1)).sin())],
        near: 2e-4,
        ngspice: Some(2e-3),
        ..CASE
    });
}

#[test]
fn rates() {
    // A step up by 1 at 2 a second, down at 4 a second, a slow sine that is followed, one that is too fast at times.
    check(&Case {
        name: "rate",
        text: "signal u = pulse(0, 1, 0.1, 0, 0, 0.6, 0)\nsignal y = rate(u, 2, 4)\nsignal v = sine(0, 1, 0.3)\nsignal z = rate(v, 2, 2)\n\
               simulate until 1 s step 1 ms\nobserve y, z",
        exact: &[
            ("y", &|t| {
                if t < 0.7 {
                    (2.0 * (t - 0.1)).clamp(0.0, 1.0)
                } else {
                    (1.0 - 4.0 * (t - 0.7)).max(0.0)
                }
            }),
            ("z", &|t| (std::f64::consts::TAU * 0.3 * t).sin()),
        ],
        ours: 2e-5,
        ..CASE
    });
}

#[test]
fn noise_is_the_same_everywhere() {
    let held = |t: f64| bondspice::quantity::random::normal(42, ((t + 1e-9) / 0.01).floor() as u64);
    check(&Case {
        name: "noise",
        text: "signal n = noise(42, 0.5, 10 ms)\nsignal m = integ(n)\nsimulate until 0.995 s step 1 ms\nobserve n, m",
        exact: &[
            ("n", &|t| 0.5 * held(t)),
            ("m", &|t| {
                let turns = ((t + 1e-9) / 0.01).floor();
                let past: f64 = (0..turns as u64)
                    .map(|k| 0.005 * bondspice::quantity::random::normal(42, k))
                    .sum();
                past + (t - 0.01 * turns) * 0.5 * held(t)
            }),
        ],
        near: 1e-6,
        ngspice: Some(2e-3),
        ..CASE
    });
}

#[test]
fn hysteresis() {
    // A sine of 1 against ±0.5: on from asin(0.5) on, off from 7/12 of a turn on; what starts in between is 0.
    let turn = |t: f64| (2.0 * t).fract();
    check(&Case {
        name: "hysteresis",
        text: "signal u = sine(0, 1, 2 Hz)\nsignal y = hysteresis(u, -0.5, 0.5)\nsignal m = integ(y)\nsignal z = hysteresis(2*u + 1, -0.5, 0.5)\n\
               simulate until 1 s step 1 ms\nobserve y, m, z",
        exact: &[
            ("y", &|t| f64::from((1.0 / 12.0..7.0 / 12.0).contains(&turn(t)))),
            ("m", &|t| {
                let turns = (2.0 * t).floor();
                0.25 * turns + 0.5 * (turn(t) - 1.0 / 12.0).clamp(0.0, 0.5)
            }),
            // 2 sin + 1 > 0.5 from the start to 7/12 + … : off where sin falls below −3/4, on where it rises above −1/4.
            ("z", &|t| {
                let off = 0.5 + 0.75f64.asin() / std::f64::consts::TAU;
                let on = 1.0 - 0.25f64.asin() / std::f64::consts::TAU;
                f64::from(!(off..on).contains(&turn(t)))
            }),
        ],
        near: 1e-6,
        ..CASE
    });
}
