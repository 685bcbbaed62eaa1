//! The library's models, each in a shipped model or a small one of its own, against references made elsewhere, closed
//! forms, and the same equations written by hand and integrated here.
//!
//! The error is that of `trace::compare`: the largest difference over the reference's rows as a part of the
//! reference's range.

use crate::references::{agree, common, file, options, reference};
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::source::library::LIBRARY;
use bondspice::trace::Trace;
use std::f64::consts::PI;

/// Runs a text.
#[track_caller]
fn run(name: &str, text: &str, overrides: &Overrides) -> Trace {
    match run_text(name, text, overrides) {
        Ok((trace, _)) => trace,
        Err(diagnostics) => panic!("{name}: {diagnostics:#?}"),
    }
}

/// Runs a model of `models/`.
#[track_caller]
fn shipped(model: &str, overrides: &Overrides) -> Trace {
    run(&format!("{model}.bg"), &file(&format!("models/{model}.bg")), overrides)
}

/// The equations are the same, so what is left is rounding and the choice of steps: nothing once both runs are far more
/// exact than the tolerance.
#[test]
fn the_actuator_of_components_is_the_flat_one() {
    for (reltol, tolerance) in [(None, 2e-5), (Some("1e-10"), 1e-9)] {
        let flat = shipped("eha_one_line", &options(reltol));
        let components = shipped("eha_components", &options(reltol));
        assert_eq!(components.names, flat.names);
        assert_eq!(components.time(), flat.time());
        agree("eha_components", &components, &flat, tolerance);
    }
}

/// A trace of functions of time over the rows of another.
fn closed_form(rows: &Trace, forms: &[(&str, &dyn Fn(f64) -> f64)]) -> Trace {
    let mut exact = Trace::new(vec!["time".to_string()], vec!["s".to_string()]);
    exact.columns[0] = rows.time().to_vec();
    assert!(exact.columns[0].len() > 1);
    for (name, form) in forms {
        exact.names.push(name.to_string());
        exact.units.push(String::new());
        exact.columns.push(rows.time().iter().map(|t| form(*t)).collect());
    }
    exact
}

/// Integrates x' = rate(t, x) by the classical Runge-Kutta method, `parts` equal steps from row to row, and lists what
/// `observed` makes of each row. Corners of the inputs must lie on steps.
fn by_hand<const N: usize>(
    rows: &Trace,
    parts: usize,
    start: [f64; N],
    names: &[&str],
    rate: impl Fn(f64, &[f64; N]) -> [f64; N],
    observed: impl Fn(f64, &[f64; N]) -> Vec<f64>,
) -> Trace {
    let add = |x: &[f64; N], k: &[f64; N], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let mut trace = closed_form(rows, &[]);
    trace.names.extend(names.iter().map(|name| name.to_string()));
    trace.units.resize(names.len() + 1, String::new());
    trace.columns.resize(names.len() + 1, vec![]);
    let mut x = start;
    for (row, t) in rows.time().iter().enumerate() {
        let before = rows.time()[row.saturating_sub(1)];
        let h = (t - before) / parts as f64;
        for part in 0..if row == 0 { 0 } else { parts } {
            let t = before + part as f64 * h;
            // Inputs jump at steps: the end of a step belongs to it.
            let (middle, end) = (t + h / 2.0, t + h * (1.0 - 1e-9));
            let k1 = rate(t + h * 1e-9, &x);
            let k2 = rate(middle, &add(&x, &k1, h / 2.0));
            let k3 = rate(middle, &add(&x, &k2, h / 2.0));
            let k4 = rate(end, &add(&x, &k3, h));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        for (column, value) in trace.columns[1..].iter_mut().zip(observed(*t, &x)) {
            column.push(value);
        }
    }
    trace
}

#[test]
fn components_move_as_the_references_of_flat_models() {
    let cases = [("drive_train", "", "dc_motor_load", 12), ("step_down", "duty=0.4", "buck", 9)];
    for (model, set, path, least) in cases {
        for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
            let mut overrides = options(reltol);
            let set = set.split_once('=');
            overrides.set.extend(set.map(|(name, value)| (name.to_string(), value.to_string())));
            let trace = shipped(model, &overrides);
            let reference = common(&trace, reference(&format!("textbook/{path}")), least);
            agree(model, &trace, &reference, tolerance);
        }
    }
}

#[test]
fn a_rigid_gear_joins_two_rotors() {
    let text = "import \"std/mechanical.bg\"\nsignal T = sine(0 N*m, 5 N*m, 6/(2*pi) * 1 Hz)\n\
        Se:T -> Rotor:first(J = 0.02 kg*m^2, b = 0.05 N*m*s) -> Gear:gear(n = 0.25)\n\
        gear -> Rotor:second(J = 0.8 kg*m^2, b = 0.3 N*m*s) -> C:k(1/(20 N*m))\n\
        simulate until 6 s step 5 ms\n\
        observe T, p(first.J) as \"p1\", q(k) as \"theta2\", f(first.turning) as \"w1\", \
        f(second.turning) as \"w2\", p(second.J) as \"p2\", e(first.to) as \"tau_TF_in\", \
        e(second.from) as \"tau_TF_out\"\n";
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("gear.bg", text, &options(reltol));
        agree("gear", &trace, &common(&trace, reference("textbook/gear_dep"), 9), tolerance);
    }
}

/// The ladder's own closed form: with half capacitances at its ends its modes are cosines,
/// C·p_k' = q_k − q_(k+1), L·q_k' = p_(k−1) − p_k − R·q_k, ω_j = 2/√(LC)·sin(jπ/2N).
#[test]
fn a_long_line_rings_as_a_ladder_of_pi_sections() {
    let (n, length, area, rho, beta, r, q): (usize, f64, f64, f64, f64, f64, f64) =
        (20, 20.0, 1e-4, 850.0, 1.4e9, 5e6, 1e-4);
    let h = length / n as f64;
    let (l, c, r) = (rho * h / area, area * h / beta, r * h);
    let pressure = |k: usize, t: f64| {
        let mut sum = q * t / (c * n as f64);
        for j in 1..=n {
            let half = j as f64 * PI / n as f64;
            let w2 = 4.0 / (l * c) * (half / 2.0).sin().powi(2);
            let a = r / (2.0 * l);
            let w = (w2 - a * a).sqrt();
            let (cos, sin) = ((w * t).cos(), (w * t).sin());
            // The step response of the mode: c_j·s'' + (r/l)·c_j·s' + w2·c_j·s = (d/dt + r/l) of the flow.
            let decay = (-a * t).exp();
            let response = decay * sin / w + r / l * (1.0 - decay * (cos + a / w * sin)) / w2;
            let weight = if j == n { 1.0 } else { 2.0 };
            sum += weight * q / (c * n as f64) * (half * k as f64).cos() * response;
        }
        sum / 1e5
    };
    let mean = |t: f64| (0..=n).map(|k| pressure(k, t)).sum::<f64>() / (n as f64 + 1.0);
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = shipped("hydraulic_line", &options(reltol));
        let (near, far) = (|t: f64| pressure(0, t), |t: f64| pressure(n, t));
        let forms: [(&str, &dyn Fn(f64) -> f64); 3] =
            [("near end", &near), ("far end", &far), ("mean", &mean)];
        agree("hydraulic_line", &trace, &closed_form(&trace, &forms), tolerance);
        // The wave needs length/√(beta/rho) = 15.6 ms to the far end.
        let arrival = length / (beta / rho).sqrt();
        let before = trace.time().iter().position(|t| *t > 0.8 * arrival).unwrap();
        let after = trace.time().iter().position(|t| *t > 1.2 * arrival).unwrap();
        let (far, mean) = (&trace.columns[2], &trace.columns[3]);
        assert!(far[before] < 0.02 * mean[after] && far[after] > mean[after]);
    }
}

#[test]
fn ten_motors_share_a_bus() {
    const N: usize = 10;
    let (u, r_s, cap, wait) = (270.0, 0.05, 1e-3, 0.02);
    let (l, r, phi, j, b) = (1.7e-3, 0.36, 0.23, 1.3e-3, 2e-3);
    let alpha = |k: usize, t: f64| if t >= (k + 1) as f64 * wait { 0.5 } else { 0.0 };
    let bus = |x: &[f64; 40]| u - r_s * x[..N].iter().sum::<f64>();
    let rate = |t: f64, x: &[f64; 40]| {
        let bus = bus(x);
        let mut d = [0.0; 4 * N];
        for k in 0..N {
            let (feed, link, i, w) = (x[k], x[N + k], x[2 * N + k], x[3 * N + k]);
            let (distance, a) = ((k + 1) as f64, alpha(k, t));
            d[k] = (bus - link - 0.02 * distance * feed) / (1e-5 * distance);
            d[N + k] = (feed - a * i) / cap;
            d[2 * N + k] = (a * link - r * i - phi * w) / l;
            d[3 * N + k] = (phi * i - b * w - 2.0 * w.tanh()) / j;
        }
        d
    };
    let rpm = 30.0 / PI;
    let observed = |t: f64, x: &[f64; 40]| {
        let power = |k: usize| alpha(k, t) * x[N + k] * x[2 * N + k] / 1e3;
        let loss = |k: usize| 0.02 * (k + 1) as f64 * x[k] * x[k] / 1e3;
        let sum = |of: &dyn Fn(usize) -> f64| (0..N).map(of).sum::<f64>();
        let current = x[..N].iter().sum();
        vec![bus(x), current, x[3 * N] * rpm, x[4 * N - 1] * rpm, sum(&power), sum(&loss)]
    };
    let names = ["bus", "current", "first", "last", "motors", "cables"];
    let start = std::array::from_fn(|k| if (N..2 * N).contains(&k) { u } else { 0.0 });
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = shipped("ten_motors", &options(reltol));
        let hand = by_hand(&trace, 100, start, &names, rate, observed);
        agree("ten_motors", &trace, &hand, tolerance);
    }
}

#[test]
fn friction_sticks_and_slips() {
    let (m, k, pull) = (1.0, 100.0, 0.02);
    let friction = |v: f64| {
        (1.0 + (2.0 - 1.0) * (-(v / 0.05_f64).powi(2)).exp()) * (v / 1e-3).tanh() + 0.4 * v
    };
    let rate = |_, x: &[f64; 2]| [pull - x[1], (k * x[0] - friction(x[1])) / m];
    let observed = |_, x: &[f64; 2]| vec![k * x[0], x[1], friction(x[1])];
    let names = ["pull", "speed", "friction"];
    // A slip begins as an instability, which magnifies what was wrong before.
    for (reltol, tolerance) in [(None, 1e-3), (Some("1e-10"), 1e-6)] {
        let trace = shipped("rough_belt", &options(reltol));
        let hand = by_hand(&trace, 500, [0.0; 2], &names, rate, observed);
        agree("rough_belt", &trace, &hand, tolerance);
        let speed = &trace.columns[2];
        let sticks = speed.iter().filter(|v| **v < 0.05 * pull).count();
        assert!(sticks > speed.len() / 2 && speed.iter().any(|v| *v > 4.0 * pull));
    }
}

/// With F = k·d·(1 + c·v) the speed v before and w after a hit fulfil v/c − ln(1 + cv)/c² = −w/c − ln(1 − cw)/c²:
/// m·v·dv/(1 + cv) = −k·d·dd from contact to contact.
#[test]
fn a_stop_returns_the_speed_of_its_closed_form() {
    let c = 0.2;
    let after = |v: f64| {
        let hit = v / c - (1.0 + c * v).ln() / (c * c);
        let (mut low, mut high) = (0.0, v);
        for _ in 0..200 {
            let w = (low + high) / 2.0;
            let left = -w / c - (1.0 - c * w).ln() / (c * c);
            if left < hit { low = w } else { high = w }
        }
        (low + high) / 2.0
    };
    let trace = shipped("mass_between_stops", &Overrides::default());
    let (position, speed, force) = (&trace.columns[1], &trace.columns[2], &trace.columns[3]);
    let mut expected = 1.0;
    let mut free = vec![speed[0].abs()];
    for row in 1..trace.rows() {
        let inside = |row: usize| position[row].abs() < 49.9;
        if inside(row) && !inside(row - 1) {
            expected = after(expected);
        }
        if inside(row) {
            assert!((speed[row].abs() - expected).abs() < 1e-6, "{} {expected}", speed[row]);
            free.push(speed[row].abs());
        }
        assert!(force[row] * position[row] >= -1e-9, "a stop never pulls: {}", force[row]);
    }
    free.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
    assert!(free.len() >= 4, "hits: {free:?}");
}

#[test]
fn a_press_moves_as_its_equations() {
    let (w, beta, s, d, g) = (150.0, 1.2e9, 5e-3, 1.5e-6, 2e-12);
    let check = |p: f64| p * (1e-14 + (1e-9 - 1e-14) * (1.0 + (p / 2e4).tanh()) / 2.0);
    let soft = |z: f64| z.max(0.0) + 1e5 * (-z.abs() / 1e5).exp().ln_1p();
    let relief = |p: f64| p / 1e14 + (soft(p - 1.2e7) - soft(-p - 1.2e7)) / 5e9;
    let orifice = |p: f64| {
        let y = p / (4e14);
        2f64.sqrt() * y / (1e-12 + (1e-24 + 4.0 * y * y).sqrt()).sqrt()
    };
    let gas = |q: f64| 6e6 * (1e-3 / (1e-3 - q)).powf(1.4) - 1e5;
    // Pump's pressure, fluid in the accumulator, ram's pressure, its speed, its position.
    let rate = |_, x: &[f64; 5]| {
        let [pump, stored, ram, v, at] = *x;
        let rail = gas(stored);
        let (feed, press) = (check(pump - rail), orifice(rail - ram));
        [
            beta / 50e-6 * (d * w - g * pump - relief(pump) - feed),
            feed - press,
            beta / (2e-4 + s * at) * (press - s * v),
            (s * ram - 2e3 * v - 1.5e6 * at - 1e3 * v) / 80.0,
            v,
        ]
    };
    let observed = |_, x: &[f64; 5]| {
        let flow = relief(x[0]) * 6e4;
        vec![x[0] / 1e5, gas(x[1]) / 1e5, x[2] / 1e5, x[4] * 1e3, flow, x[1] * 1e3]
    };
    let names = ["pump", "rail", "ram", "travel", "relief", "stored"];
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = shipped("hydraulic_press", &options(reltol));
        let hand = by_hand(&trace, 2000, [0.0, 3e-4, 0.0, 0.0, 0.0], &names, rate, observed);
        agree("hydraulic_press", &trace, &hand, tolerance);
    }
}

#[test]
fn a_jack_lifts_as_its_equations() {
    let (q, r, s, beta, m) = (2e-4, 5e9, 2e-3, 1.2e9, 400.0);
    // Pressures, speed, stroke.
    let rate = |t: f64, x: &[f64; 4]| {
        let [below, above, v, at] = *x;
        let pumped = if t >= 0.02 { q } else { 0.0 };
        [
            beta / (60e-6 + s * at) * (pumped - s * v),
            beta / (300e-6 - s * at) * (s * v - above / r),
            (s * (below - above) - 4e3 * v - 60e3 * at - m * 9.81) / m,
            v,
        ]
    };
    let observed = |_, x: &[f64; 4]| vec![x[0] / 1e5, x[1] / 1e5, x[3] * 1e3, x[2]];
    let names = ["below", "above", "stroke", "speed"];
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = shipped("lifting_jack", &options(reltol));
        let hand = by_hand(&trace, 200, [5e5, 5e5, 0.0, 0.0], &names, rate, observed);
        agree("lifting_jack", &trace, &hand, tolerance);
    }
}

#[test]
fn a_switched_bridge_reverses_a_motor_as_its_equations() {
    let (u, fs, on, l, resistance, phi, j, b) = (48.0, 1e3, 0.02, 2e-3, 0.5, 0.06, 2e-4, 1.1e-3);
    let modulus = |t: f64| {
        let mean = if t < 0.05 { 0.6 } else { -0.4 };
        // The edges lie on rows, those of the test's steps 1e-9 of a step beside them.
        let phase = (t * fs).fract();
        if phase < (1.0 + mean) / 2.0 { 1.0 } else { -1.0 }
    };
    let rate = |t: f64, x: &[f64; 2]| {
        let [i, w] = *x;
        [(modulus(t) * u - (on + resistance) * i - phi * w) / l, (phi * i - b * w) / j]
    };
    let observed = |t: f64, x: &[f64; 2]| {
        // The last row is the one before its jump.
        let d = if t > 0.0999 { -1.0 } else { modulus(t + 1e-9) };
        vec![x[0], x[1], d * u * x[0], d]
    };
    let names = ["current", "speed", "power", "modulus"];
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = shipped("reversing_drive", &options(reltol));
        let hand = by_hand(&trace, 20, [0.0, 0.0], &names, rate, observed);
        agree("reversing_drive", &trace, &hand, tolerance);
        let regenerated = trace.column("power").unwrap().iter().copied().fold(0.0, f64::min);
        assert!(regenerated < -100.0, "{regenerated} W");
    }
}

#[test]
fn an_arm_on_a_gear_that_gives() {
    let (n, k, c, weight, l) = (0.02, 2e3, 5.0, 4.0 * 9.81, 0.3);
    let reference = |t: f64| if t >= 0.1 { 60f64.to_radians() } else { 0.0 };
    // Current, speed, twist, arm's speed, arm's angle, the regulators' integrators.
    let signals = |t: f64, x: &[f64; 7]| {
        let [i, w, .., theta, z_w, z_i] = *x;
        let w_ref = (6.0 * (reference(t) - theta)).clamp(-2.0, 2.0) / n;
        let u_w = 0.15 * (w_ref - w) + z_w;
        let i_ref = u_w.clamp(-15.0, 15.0);
        let u_i = 0.03 * (i_ref - i) + z_i;
        let alpha = u_i.clamp(-1.0, 1.0);
        (w_ref, u_w, i_ref, u_i, alpha)
    };
    let torque = |x: &[f64; 7]| k * x[2] + c * (n * x[1] - x[3]);
    let rate = |t: f64, x: &[f64; 7]| {
        let [i, w, _, wl, theta, ..] = *x;
        let (w_ref, u_w, i_ref, u_i, alpha) = signals(t, x);
        let supply = 48.0 - 0.1 * alpha * i;
        let torque = torque(x);
        [
            (alpha * supply - 0.02 * i - 0.5 * i - 0.08 * w) / 1e-3,
            (0.08 * i - 1e-4 * w - n * torque) / 2e-4,
            n * w - wl,
            (torque - 0.05 * wl - l * theta.cos() * weight) / 0.8,
            wl,
            3.0 * (w_ref - w) + 20.0 * (i_ref - u_w),
            15.0 * (i_ref - i) + 500.0 * (alpha - u_i),
        ]
    };
    let observed = |t: f64, x: &[f64; 7]| {
        let alpha = signals(t, x).4;
        vec![x[4].to_degrees(), x[1] * 30.0 / PI, x[0], alpha, torque(x), 48.0 * alpha * x[0]]
    };
    let names = ["theta", "motor", "current", "duty cycle", "torque", "power"];
    for (reltol, tolerance) in [(None, 1e-3), (Some("1e-8"), 1e-6)] {
        let trace = shipped("servo_axis", &options(reltol));
        let hand = by_hand(&trace, 100, [0.0; 7], &names, rate, observed);
        agree("servo_axis", &trace, &hand, tolerance);
    }
}

/// Bipolar switching of a coil with a resistance: within each part of the period i tends to ±U/R with L/R.
#[test]
fn a_bridge_switches_and_its_mean_is_the_averaged_one() {
    let text = "import \"std/electrical.bg\"\nDcSource:bus(U = 100 V) -> \
        SwitchedBridge:bridge(fs = 1 kHz, alpha = 0.3) -> 1:load -> R:R(2 Ohm), I:L(5 mH)\n\
        simulate until 20 ms step 20 us\nobserve f(load) as \"i\", bridge.d as \"d\"\n";
    let (tau, top) = (5e-3 / 2.0, 100.0 / 2.0);
    let current = |t: f64| {
        let period = (t / 1e-3 + 1e-9).floor();
        let within = t - period * 1e-3;
        let part = |i: f64, d: f64, t: f64| d * top + (i - d * top) * (-t / tau).exp();
        let mut i = 0.0;
        for _ in 0..period as usize {
            i = part(part(i, 1.0, 0.65e-3), -1.0, 0.35e-3);
        }
        if within <= 0.65e-3 {
            part(i, 1.0, within)
        } else {
            part(part(i, 1.0, 0.65e-3), -1.0, within - 0.65e-3)
        }
    };
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("bridge.bg", text, &options(reltol));
        let exact = closed_form(&trace, &[("i", &current)]);
        agree("bridge", &trace, &exact, tolerance);
        let rows = trace.rows();
        let last = &trace.columns[1][rows - 51..rows - 1];
        let mean = last.iter().sum::<f64>() / last.len() as f64;
        assert!((mean / (0.3 * top) - 1.0).abs() < 0.02, "{mean}");
    }
}

#[test]
fn a_motor_comes_to_its_speed() {
    // Both poles in closed form; u = 12 V behind 0.5 Ohm in all.
    let text = "import \"std/electrical.bg\"\nDcSource:battery(U = 12 V, R = 0.1 Ohm) -> \
        Cable:cable(R = 0.05 Ohm) -> AveragedConverter:chopper(alpha = 0.5, R_on = 0.04 Ohm)\n\
        chopper -> DcMotor:motor(L = 1 mH, R = 0.4 Ohm, Phi = 0.05 V*s, J = 1e-4 kg*m^2, b = 1e-4 N*m*s)\n\
        motor -> Se:torque(0.02 N*m)\nsimulate until 1 s step 1 ms\n\
        observe f(motor.armature) as \"i\", f(motor.rotor) as \"w\"\n";
    // What the supply sees through the chopper counts 0.25-fold.
    let (r, l, phi, j, b, u, m) = (0.44 + 0.25 * 0.15, 1e-3, 0.05, 1e-4, 1e-4, 6.0, 0.02);
    let det = (r * b + phi * phi) / (l * j);
    let half = (r / l + b / j) / 2.0;
    let root = f64::sqrt(half * half - det);
    let (s1, s2): (f64, f64) = (-half + root, -half - root);
    let steady = ((u * b + phi * m) / (l * j * det), (phi * u - r * m) / (l * j * det));
    let form = |start: f64, slope: f64| {
        let a = (slope - s2 * start) / (s1 - s2);
        move |t: f64| a * (s1 * t).exp() + (start - a) * (s2 * t).exp()
    };
    let (di, dw) = (form(-steady.0, u / l), form(-steady.1, -m / j));
    let (i, w) = (|t| steady.0 + di(t), |t| steady.1 + dw(t));
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("motor.bg", text, &options(reltol));
        agree("motor", &trace, &closed_form(&trace, &[("i", &i), ("w", &w)]), tolerance);
    }
}

#[test]
fn an_accumulator_takes_a_constant_flow() {
    let text = "import \"std/hydraulic.bg\"\nSf:Q(0.02 L/s) -> Accumulator:gas(P0 = 60 bar, V0 = 1 L, n = 1.4, \
        q0 = 0.1 L)\nsimulate until 30 s step 0.1 s\nobserve e(gas.line) as \"P\"\n";
    let pressure = |t: f64| 60e5 * (1.0_f64 / (1.0 - 0.1 - 0.02 * t)).powf(1.4);
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("gas.bg", text, &options(reltol));
        agree("gas", &trace, &closed_form(&trace, &[("P", &pressure)]), tolerance);
    }
}

/// Closed chambers, the rod moved steadily: dP/dt = ∓beta·S·v/(V ± S·x), so P = P0 ∓ beta·ln(1 ± S·x/V).
#[test]
fn moving_chambers_follow_their_volume() {
    let text = "import \"std/hydraulic.bg\"\nMovingCylinder:jack(S = 40 cm^2, V1 = 250 cm^3, V2 = 300 cm^3, \
        beta = 0.8 GPa, M = 10 kg, P0 = 200 bar)\nSf:closed1(0 m^3/s) -> jack.line1\n\
        jack.line2 -> Sf:closed2(0 m^3/s)\njack.rod -> Sf:pulled(v)\nparam v = 1 mm/s\n\
        simulate until 1 s step 10 ms\nobserve jack.x as \"x\", e(jack.side1) as \"P1\", e(jack.side2) as \"P2\"\n";
    let (s, v, beta) = (40e-4, 1e-3, 0.8e9);
    let p1 = |t: f64| 200e5 - beta * (1.0 + s * v * t / 250e-6_f64).ln();
    let p2 = |t: f64| 200e5 - beta * (1.0 - s * v * t / 300e-6_f64).ln();
    let x = |t: f64| v * t;
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("jack.bg", text, &options(reltol));
        let forms: [(&str, &dyn Fn(f64) -> f64); 3] = [("x", &x), ("P1", &p1), ("P2", &p2)];
        agree("jack", &trace, &closed_form(&trace, &forms), tolerance);
    }
}

/// Static laws: the same pressure ramp on each, flows against the formulas of the headers.
#[test]
fn valves_and_losses_have_their_laws() {
    let text = "import \"std/hydraulic.bg\"\nSe:P(400 bar * time/(1 s) - 200 bar) -> 0:in\n\
        in -> Orifice:orifice(Cl = 1e7 Pa^0.5*s/m^3, Q0 = 1e-6 m^3/s) -> Se:a(0 bar)\n\
        in -> Line:line(Cl = 1e7 Pa^0.5*s/m^3, Q0 = 1e-6 m^3/s) -> Se:b(0 bar)\n\
        in -> CheckValve:check(Ron = 1e10 Pa*s/m^3, Roff = 1e13 Pa*s/m^3, width = 5 bar) -> Se:c(0 bar)\n\
        in -> ReliefValve:relief(limit = 100 bar, Ron = 1e10 Pa*s/m^3, Roff = 1e13 Pa*s/m^3, width = 2 bar) -> Se:d(0 bar)\n\
        simulate until 1 s step 1 ms\nobserve f(orifice.flow) as \"orifice\", f(line.flow) as \"line\", \
        f(check.flow) as \"check\", f(relief.flow) as \"relief\"\n";
    let p = |t: f64| 400e5 * t - 200e5;
    let loss = |t: f64| {
        // Q·√(Q² + Q0²) = P/Cl², a quadratic equation in Q².
        let y: f64 = p(t) / 1e14;
        let q2 = (-1e-12 + (1e-24 + 4.0 * y * y).sqrt()) / 2.0;
        y.signum() * q2.sqrt()
    };
    let check = |t: f64| {
        let opening = (1.0 + (p(t) / 5e5).tanh()) / 2.0;
        p(t) * (1e-13 + (1e-10 - 1e-13) * opening)
    };
    let soft = |z: f64| if z > 1e8 { z } else { 2e5 * (z / 2e5).exp().ln_1p() };
    let relief = |t: f64| p(t) / 1e13 + (soft(p(t) - 1e7) - soft(-p(t) - 1e7)) / 1e10;
    let trace = run("valves.bg", text, &options(Some("1e-9")));
    let forms: [(&str, &dyn Fn(f64) -> f64); 4] =
        [("orifice", &loss), ("line", &loss), ("check", &check), ("relief", &relief)];
    // Near rest the quadratic equation above loses digits, and so does Newton's: 1e-8 of the range.
    agree("valves", &trace, &closed_form(&trace, &forms), 1e-8);
}

/// A limited regulator: z tends to where Ki·x = Kaw·(u − hi) while the error lasts, and comes back from there.
#[test]
fn an_integrator_does_not_wind_up() {
    let text = "import \"std/control.bg\"\nsignal error = step(1 s, 1, -1)\n\
        PI:reg(Kp = 0.5, Ki = 2 s^-1, lo = -1, hi = 1, Kaw = 10 s^-1, x = error)\nsignal y = reg.y\n\
        Se:y -> R:R(1)\nsimulate until 2 s step 1 ms\nobserve y\n";
    let y = |t: f64| {
        // Until u = 0.5 + 2t reaches 1, then z' = 2 + 10·(1 − 0.5 − z).
        let limit = |t: f64| 0.7 + (0.5 - 0.7) * (-10.0 * (t - 0.25)).exp();
        let turned = limit(1.0);
        if t < 0.25 {
            return 0.5 + 2.0 * t;
        }
        if t < 1.0 {
            return 1.0;
        }
        // u = −0.5 + z falls by 2 a second, and meets −1 where z = −0.5.
        (-0.5 + turned - 2.0 * (t - 1.0)).max(-1.0)
    };
    for (reltol, tolerance) in [(None, 1e-4), (Some("1e-8"), 1e-6)] {
        let trace = run("pi.bg", text, &options(reltol));
        agree("pi", &trace, &closed_form(&trace, &[("y", &y)]), tolerance);
    }
}

/// The examples of docs/library.md: one for each model of the library, complete files.
#[test]
fn the_examples_of_the_documentation_run() {
    let text = file("docs/library.md");
    let mut shown = vec![];
    for section in text.split("\n### ").skip(1) {
        let name = section.lines().next().unwrap_or_default();
        let example = section.split("```bg\n").nth(1).and_then(|rest| rest.split("\n```").next());
        let example = example.unwrap_or_else(|| panic!("{name} has no example"));
        assert!(example.contains(&format!("{name}:")), "{name} does not stand in its example");
        let trace = run(&format!("{name}.bg"), &format!("{example}\n"), &Overrides::default());
        assert!(trace.rows() > 20 && trace.columns.iter().flatten().all(|value| value.is_finite()));
        shown.push(name.to_string());
    }
    let mut models = vec![];
    for (_, text) in LIBRARY {
        for line in text.lines().filter_map(|line| line.strip_prefix("model ")) {
            let (name, header) = line.split_once('(').expect("a header");
            let header = header.trim_end_matches(" {").trim_end_matches(')');
            models.push(name.to_string());
            // Its parameters, as they stand there.
            let section = text_of(&file("docs/library.md"), name);
            for parameter in header.split(", ") {
                assert!(section.contains(&format!("`{parameter}`")), "{name}: {parameter}");
            }
        }
    }
    shown.sort();
    models.sort();
    assert_eq!(shown, models);
}

/// The section of a model in the documentation.
fn text_of(text: &str, name: &str) -> String {
    let begin = format!("\n### {name}\n");
    let at = text.find(&begin).unwrap_or_else(|| panic!("no section on {name}")) + begin.len();
    text[at..].split("\n### ").next().unwrap_or_default().to_string()
}
