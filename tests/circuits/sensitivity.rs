//! `.sens` against closed forms, against differences of separate runs, and against ngspice.
//!
//! Tolerances: 1e-9 of the slope against closed forms at rest and over frequencies; 1e-5 against central differences of
//! two runs; direct and adjoint agree to 1e-9; over time, at reltol 1e-7, 1e-5 of the largest slope of the column. ngspice
//! takes its own differences and is met to 1e-4.

use crate::small_signal::{column, errors, has_ngspice, ngspice, printed, run};
use bondspice::trace::Trace;
use std::f64::consts::TAU;

fn close(ours: f64, exact: f64, part: f64, what: &str) {
    assert!((ours - exact).abs() <= part * exact.abs(), "{what}: {ours} for {exact}");
}

#[test]
fn a_divider_at_rest() {
    let deck = "v1 a 0 2\nr1 a b 1k\nr2 b 0 {3*k}\n.param k=1k\nc1 b 0 1u\n";
    let trace = run(&format!("{deck}.sens v(b) param=r1,r2:r,v1,k"));
    let value = |name: &str| column(&trace, name)[0];
    close(value("v(b)"), 1.5, 1e-12, "v(b)");
    for (name, exact) in [
        ("d_v(b)/d_r1", -2.0 * 3e3 / 16e6),
        ("d_v(b)/d_r2:r", 2.0 * 1e3 / 16e6),
        ("d_v(b)/d_v1", 0.75),
        ("d_v(b)/d_k", 3.0 * 2.0 * 1e3 / 16e6),
    ] {
        close(value(name), exact, 1e-9, name);
    }
    // Without names every value of a device.
    let trace = run(&format!("{deck}.sens v(b)"));
    assert_eq!(trace.names, ["v(b)", "d_v(b)/d_v1", "d_v(b)/d_r1", "d_v(b)/d_r2"]);
    close(column(&trace, "d_v(b)/d_r1")[0], -2.0 * 3e3 / 16e6, 1e-9, "r1");
}

#[test]
fn outputs_that_are_expressions_both_ways_along_a_sweep() {
    // Xyce's form: with the sweep of the deck, wherever the card stands.
    let deck = ".sens objfunc={0.5*(v(b)-3)**2},v(b) param=r1:r,r2:r\n.options sensitivity direct=1 adjoint=1\nv1 a 0 2\nr1 a b 1k\nr2 b 0 3k\n.dc v1 1 4 1";
    let trace = run(deck);
    assert_eq!(trace.names[..3], ["v1", "{0.5*(v(b)-3)**2}", "v(b)"]);
    for (k, v1) in column(&trace, "v1").iter().enumerate() {
        let vb = 0.75 * v1;
        for (r, slope) in [("r1:r", -v1 * 3e3 / 16e6), ("r2:r", v1 * 1e3 / 16e6)] {
            for way in ["dir", "adj"] {
                let name = format!("d_v(b)/d_{r}_{way}");
                close(column(&trace, &name)[k], slope, 1e-9, &name);
                let name = format!("d_{{0.5*(v(b)-3)**2}}/d_{r}_{way}");
                let exact = (vb - 3.0) * slope;
                let ours = column(&trace, &name)[k];
                assert!(
                    (ours - exact).abs() <= 1e-9 * exact.abs() + 1e-15,
                    "{name} {ours} {exact}"
                );
            }
        }
    }
}

/// A central difference of two runs of a deck in which `{x}` stands.
fn difference(deck: &str, value: f64, name: &str) -> Vec<f64> {
    let step = 1e-4 * value;
    let at = |x: f64| column(&run(&deck.replace("{x}", &format!("{x:e}"))), name).to_vec();
    let (above, below) = (at(value + step), at(value - step));
    above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)).collect()
}

#[test]
fn diodes_models_and_temperature_at_rest() {
    let deck = |r: &str, is: &str, temp: &str| {
        format!(
            "v1 a 0 2\nr1 a b {r}\nd1 b c dm\nd2 c 0 dm\nr2 c 0 10k\n.model dm d(is={is} n=1.5 rs=2)\n.options temp={temp} reltol=1e-12 abstol=1e-20 vntol=1e-15\n"
        )
    };
    let plain = deck("1k", "1e-13", "27");
    let trace = run(&format!("{plain}.sens objfunc=v(b),i(v1) param=r1,dm:is,temp\n.op"));
    for (param, text, value) in [
        ("r1", deck("{x}", "1e-13", "27"), 1e3),
        ("dm:is", deck("1k", "{x}", "27"), 1e-13),
        ("temp", deck("1k", "1e-13", "{x}"), 27.0),
    ] {
        for output in ["v(b)", "i(v1)"] {
            let exact = difference(&format!("{text}.op\n.print op v(b) i(v1)"), value, output)[0];
            for way in ["dir", "adj"] {
                let name = format!("d_{output}/d_{param}_{way}");
                close(column(&trace, &name)[0], exact, 1e-5, &name);
            }
            let [a, b] =
                ["dir", "adj"].map(|way| column(&trace, &format!("d_{output}/d_{param}_{way}"))[0]);
            close(a, b, 1e-9, "direct and adjoint");
        }
    }
}

#[test]
fn a_filter_over_frequencies() {
    let deck = "v1 a 0 ac 1\nr1 a b 1k\nc1 b 0 1u\n.options sensitivity direct=1 adjoint=1\n.ac dec 2 10 10k\n.sens objfunc=v(b),vm(b),vdb(b) param=r1,c1:c";
    let trace = run(deck);
    for (k, f) in column(&trace, "frequency").iter().enumerate() {
        let x = TAU * f * 1e-3;
        let square = 1.0 + x * x;
        for (param, value) in [("r1", 1e3), ("c1:c", 1e-6)] {
            for way in ["dir", "adj"] {
                // d/dp 1/(1 + jx) = −jx/p·(1 − jx)²/(1 + x²)²
                let factor = -x / value / (square * square);
                let get = |name: &str| column(&trace, &format!("d_{name}/d_{param}_{way}"));
                let at = |part: &str| column(&trace, &format!("d_v(b)/d_{param}_{way}.{part}"))[k];
                close(at("re"), factor * 2.0 * x, 1e-9, "re");
                let exact = factor * (1.0 - x * x);
                assert!((at("im") - exact).abs() <= 1e-9 * (factor * square).abs(), "im at {f}");
                close(get("vm(b)")[k], -x * x / value / square.powf(1.5), 1e-8, "vm");
                close(get("vdb(b)")[k], -20.0 / 10f64.ln() * x * x / value / square, 1e-8, "vdb");
            }
        }
    }
}

#[test]
fn a_diode_over_frequencies_moves_its_operating_point() {
    let deck = |r: &str| {
        format!(
            "v1 a 0 2 ac 1\nr1 a b {r}\nd1 b 0 dm\nc1 b 0 10n\n.model dm d(is=1e-14 cjo=1n tt=10n)\n.options reltol=1e-12 abstol=1e-20 vntol=1e-15\n"
        )
    };
    let trace = run(&format!("{}.sens v(b) ac dec 3 1k 1meg param=r1", deck("1k")));
    let slopes = ["re", "im"].map(|part| column(&trace, &format!("d_v(b)/d_r1.{part}")).to_vec());
    let text = format!("{}.ac dec 3 1k 1meg\n.print ac v(b)", deck("{x}"));
    let exact = ["re", "im"].map(|part| difference(&text, 1e3, &format!("v(b).{part}")));
    for k in 0..slopes[0].len() {
        let size = exact[0][k].hypot(exact[1][k]);
        let off = (slopes[0][k] - exact[0][k]).hypot(slopes[1][k] - exact[1][k]);
        assert!(off < 1e-5 * size, "row {k}: {off:e} of {size:e}");
    }
}

/// Asserts that the slopes of a run over time are these.
fn over_time(trace: &Trace, slope: &str, exact: impl Fn(f64) -> f64) {
    let times = column(trace, "time");
    assert!(times.len() > 50);
    let slopes = column(trace, &format!("{slope}_dir"));
    let most = times.iter().map(|t| exact(*t).abs()).fold(0.0, f64::max);
    let off = |k: usize| (slopes[k] - exact(times[k])).abs() / most;
    let worst = (0..times.len()).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap();
    assert!(off(worst) < 1e-5, "{slope}: {:e} at {}", off(worst), times[worst]);
}

/// Asserts that direct and adjoint slopes agree in every row.
fn both_ways(trace: &Trace, slope: &str) {
    let [direct, adjoint] = ["dir", "adj"].map(|way| column(trace, &format!("{slope}_{way}")));
    let most = direct.iter().fold(0.0f64, |most, slope| most.max(slope.abs()));
    assert!(most > 0.0 && direct.len() > 20, "{slope}");
    for (a, b) in direct.iter().zip(adjoint) {
        assert!((a - b).abs() <= 1e-9 * most, "{slope}: {a} {b}");
    }
}

#[test]
fn a_capacitor_is_charged_over_time() {
    let trace = run(
        "v1 a 0 5\nr1 a b 1k\nc1 b 0 1u ic=1\n.options reltol=1e-7\n.tran 10u 5m uic\n.sens objfunc={v(b)} param=r1:r,c1:c,v1",
    );
    // v = V + (v0 − V)·e^(−t/RC)
    let decay = |t: f64| (-t / 1e-3).exp();
    over_time(&trace, "d_{v(b)}/d_r1:r", |t| -4.0 * decay(t) * t / 1e-3 / 1e3);
    over_time(&trace, "d_{v(b)}/d_c1:c", |t| -4.0 * decay(t) * t / 1e-3 / 1e-6);
    over_time(&trace, "d_{v(b)}/d_v1", |t| 1.0 - decay(t));
}

#[test]
fn a_pulse_through_an_inductor_from_rest() {
    // A jump of the source at 1 ms, before which all is at rest: i = V/R·(1 − e^(−(t − t0)R/L)).
    let trace = run(
        "v1 a 0 pwl(0 0 1m 0 1m 2)\nr1 a b 10\nl1 b 0 10m\n.options reltol=1e-7\n.tran 10u 6m\n.sens objfunc=i(l1) param=r1,l1:l",
    );
    let tau = |t: f64| (t - 1e-3).max(0.0) / 1e-3;
    over_time(&trace, "d_i(l1)/d_r1", |t| {
        let x = tau(t);
        2.0 / 100.0 * (-(1.0 - (-x).exp()) + x * (-x).exp())
    });
    over_time(&trace, "d_i(l1)/d_l1:l", |t| {
        let x = tau(t);
        -0.2 * x * (-x).exp() / 10e-3
    });
}

#[test]
fn the_adjoint_goes_back_over_steps_jumps_and_starts() {
    // From rest over a jump; from stated charges; with the charge of a junction.
    for (deck, params) in [
        (
            "v1 a 0 pwl(0 0 1m 0 1m 2)\nr1 a b 10\nl1 b c 10m\nr2 c 0 5\nc2 c 0 10u\n.tran 10u 4m",
            ["r1", "l1:l", "c2"],
        ),
        (
            "v1 a 0 5\nr1 a b 1k\nc1 b 0 1u ic=1\nr2 b c 2k\nc2 c 0 1u ic=3\n.tran 10u 5m uic",
            ["r1", "c1:c", "v1"],
        ),
        (
            "v1 a 0 sin(0 2 1k)\nr1 a b 100\nd1 b c dm\nc1 c 0 1u\nr2 c 0 2k\n.model dm d(is=1e-12 n=2 cjo=10n)\n.tran 1u 1m",
            ["r1", "dm:is", "c1"],
        ),
    ] {
        let text = format!(
            "{deck}\n.options sensitivity direct=1 adjoint=1\n.sens objfunc={{v(b)*v(b)}},v(c) param={}",
            params.join(",")
        );
        let text = if deck.contains(" c ") { text } else { text.replace(",v(c)", "") };
        let trace = run(&text);
        for param in params {
            both_ways(&trace, &format!("d_{{v(b)*v(b)}}/d_{param}"));
            both_ways(&trace, &format!("d_v(c)/d_{param}"));
        }
    }
}

#[test]
fn a_diode_over_time_against_separate_runs() {
    // Each run is right to about 2e-8 V, so that their differences over 4 Ω and 8 Ω are to about 4e-9 V/Ω: 4e-6 of the
    // largest slope, of which 1e-5 is asked.
    let deck = |r: &str, tolerance: &str| {
        format!(
            "v1 a 0 sin(0 2 1k)\nr1 a b {r}\nd1 b c dm\nc1 c 0 1u\nr2 c 0 2k\n.model dm d(is=1e-12 n=2)\n.options reltol={tolerance}\n.tran 1u 0.4m\n"
        )
    };
    let trace = run(&format!("{}.sens objfunc=v(c) param=r1", deck("100", "1e-7")));
    let slopes = column(&trace, "d_v(c)/d_r1_dir");
    let most = slopes.iter().fold(0.0f64, |most, slope| most.max(slope.abs()));
    let end = slopes.last().copied().unwrap();
    let at = |r: f64| {
        let trace = run(&format!("{}.print tran v(c)", deck(&format!("{r:e}"), "1e-8")));
        column(&trace, "v(c)").last().copied().unwrap()
    };
    let slope = |step: f64| (at(100.0 + step) - at(100.0 - step)) / (2.0 * step);
    let exact = (4.0 * slope(2.0) - slope(4.0)) / 3.0;
    assert!((end - exact).abs() < 1e-5 * most, "{end} {exact} of {most}");
}

#[test]
fn ngspice_has_the_same_slopes() {
    if !has_ngspice() {
        return;
    }
    let deck = "v1 a 0 2\nr1 a b 1k\nr2 b 0 3k\nd1 b 0 dm\n.model dm d(is=1e-12)\ng1 0 c b 0 1m\nr3 c 0 2k\n.options reltol=1e-8 vntol=1e-12 abstol=1e-16\n.sens v(c)";
    let said = ngspice(deck, "run\nprint all");
    let trace = run(deck);
    for name in ["v1", "r1", "r2", "r3"] {
        close(column(&trace, &format!("d_v(c)/d_{name}"))[0], printed(&said, name)[0], 1e-4, name);
    }
}

#[test]
fn what_makes_no_sense_is_said() {
    for (card, code) in [
        (".sens", "E0703"),
        (".sens v(nosuch)", "E0740"),
        (".sens v(b) ac dec 10", "E0703"),
        (".sens objfunc={v(b)}", "E0703"),
        (".sens param=r1", "E0703"),
        (".sens objfunc=v(b) param=r9", "E0788"),
        (".sens objfunc=v(b) parm=r1", "E0704"),
        (".sens v(b) param=b1", "E0788"),
        (".tran 1u 1m\n.sens objfunc=i(c9) param=r1\nc9 b 0 1n", "E0814"),
        (".tran 1u 1m\n.sens objfunc=v(b) param=r1\nc9 b 0 1n\n.ic v(b)=2", "E0814"),
    ] {
        let deck = format!("v1 a 0 1\nr1 a b 1k\nr2 b 0 1k\nb1 c 0 v=v(b)*2\nr3 c 0 1\n{card}");
        assert!(errors(&deck).contains(&code), "{card}: {:?}", errors(&deck));
    }
}
