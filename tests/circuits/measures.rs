//! `.measure` against closed forms, and against ngspice's own results on the same text.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program in a folder.
fn bondspice(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// The measures of a deck by name, one value for each step; a failed one is no number.
fn measures(deck: &str, flags: &[&str]) -> (BTreeMap<String, Vec<f64>>, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("deck.cir"), deck).unwrap();
    let mut arguments = vec!["simulate", "deck.cir", "-o", "run.csv", "--measures", "m.json"];
    arguments.extend(flags);
    let output = bondspice(folder.path(), &arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let text = std::fs::read_to_string(folder.path().join("m.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["schema"], 1);
    let names = json["names"].as_array().unwrap().iter();
    let columns = json["columns"].as_array().unwrap().iter();
    let values = |column: &serde_json::Value| -> Vec<f64> {
        column.as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let found =
        names.zip(columns).map(|(n, c)| (n.as_str().unwrap().to_lowercase(), values(c))).collect();
    (found, said)
}

fn deck() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/decks/measures.cir");
    std::fs::read_to_string(path).unwrap()
}

/// Where a function that falls passes 0, by halving.
fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}

/// What the deck's measures are, with the tolerance for each as a part of 1, 1 V or the value.
fn closed_forms() -> Vec<(&'static str, f64, f64)> {
    let tau = 1e-3_f64;
    let charge = |t: f64| 1.0 - (-t / tau).exp();
    let meet = root(|t| (2000.0 * PI * t).cos() - charge(t), 0.0, 0.25e-3);
    vec![
        ("t_half", tau * 2.0_f64.ln(), 1e-6),
        ("rise", tau * 9.0_f64.ln(), 1e-6),
        ("at_tau", charge(tau), 1e-6),
        ("beside", charge(1e-3 + 1e-3 / 6.0), 1e-5),
        ("slope", (-1.0_f64).exp() / tau, 1e-4),
        ("mean", 1.0 - (tau / 5e-3) * charge(5e-3), 1e-6),
        ("effective", 0.5_f64.sqrt(), 1e-5),
        ("lowest", -1.0, 1e-5),
        ("lowest_at", 0.5e-3, 1e-2),
        ("swing", 2.0, 1e-5),
        ("area", 0.65e-3, 1e-6),
        ("width", 0.65e-3, 1e-6),
        ("period", 1e-3, 1e-5),
        ("final", 9.25e-3, 1e-5),
        ("late", 3.25e-3, 1e-5),
        ("meet", meet, 1e-5),
        ("twice", 2.0 * tau * 2.0_f64.ln(), 1e-6),
    ]
}

/// The step limit of the deck is for ngspice; without it every method takes its own steps.
#[test]
fn closed_forms_are_met() {
    let text = deck();
    for flags in [&["--option", "hmax=auto"][..], &["--option", "hmax=auto", "--step", "1ms"]] {
        let (found, said) = measures(&text, flags);
        for (name, wanted, tolerance) in closed_forms() {
            let value = found[name][0];
            let error = (value - wanted).abs() / wanted.abs();
            assert!(error <= tolerance, "{name}: {value:e}, not {wanted:e}: {error:.1e}\n{said}");
        }
        assert!(said.contains("t_half") && said.contains("targ="), "{said}");
    }
}

/// ngspice integrates by points of the trapezoidal rule at most 1 µs apart: 1e-4.
#[test]
fn ngspice_measures_the_same() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("deck.cir"), deck()).unwrap();
    let run = Command::new("ngspice")
        .args(["-b", "deck.cir"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output();
    let Ok(run) = run else {
        crate::peers::missing("ngspice");
        return;
    };
    let said = String::from_utf8_lossy(&run.stdout);
    let mut theirs = BTreeMap::new();
    for line in said.lines() {
        let Some((name, rest)) = line.split_once(" =") else { continue };
        let value = rest.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
        if let (Some(value), false) = (value, name.trim().contains(' ')) {
            theirs.insert(name.trim().to_string(), value);
        }
    }
    let (ours, _) = measures(&deck(), &[]);
    let mut compared = 0;
    for (name, ..) in closed_forms() {
        let Some(value) = theirs.get(name) else { continue };
        let error = (ours[name][0] - value).abs() / value.abs();
        // The place of a flat extreme, and a slope by differences, are coarse there.
        let tolerance = if matches!(name, "lowest_at" | "slope") { 1e-2 } else { 1e-4 };
        assert!(error <= tolerance, "{name}: {} here, {value:e} there", ours[name][0]);
        compared += 1;
    }
    assert!(compared >= 14, "{compared} measures: {said}");
}

#[test]
fn what_fails_is_said() {
    let text = deck().replace(
        ".print",
        ".meas tran never WHEN v(out)=2\n.meas tran fifth WHEN v(p)=0.5 RISE=9\n\
         .meas tran beyond AVG v(out) FROM=20m TO=30m\n.meas tran on_them PARAM='never+1'\n\
         .meas ac elsewhere MAX v(out)\n.meas tran odd DUTY v(p) ON=0.5\n.print",
    );
    let (found, said) = measures(&text, &["--option", "hmax=auto"]);
    for name in ["never", "fifth", "beyond", "on_them"] {
        assert!(found[name][0].is_nan(), "{name}: {:?}", found[name]);
        assert!(said.contains(&format!("the measure `{name}` failed")), "{said}");
    }
    assert!(said.contains("passed 5 times only") && said.contains("=  failed"), "{said}");
    assert!(said.contains("W0792") && said.contains("W0790"), "{said}");
    assert!(!found.contains_key("elsewhere") && !found.contains_key("odd"));
}

/// Forms of LTspice and HSPICE: no analysis named, limits by events, values of other measures as limits.
#[test]
fn forms_of_others() {
    let text = deck().replace(
        ".print",
        ".MEAS m1 FIND V(out) WHEN V(a)=0 CROSS=1\n\
         .MEAS TRAN m2 AVG V(p) TRIG V(p)=0.5 RISE=1 TARG V(p)=0.5 FALL=1\n\
         .meas tran m3 find par('v(out)*2') at='t_half'\n\
         .meas tran m4 max 'v(p)+1' from = 0 to = 3m\n\
         .meas tran m5 integ v(in) from='t_half' to='t_half+1m' goal=3\n.print",
    );
    let (found, _) = measures(&text, &["--option", "hmax=auto"]);
    let close = |name: &str, wanted: f64, tolerance: f64| {
        let value = found[name][0];
        assert!((value / wanted - 1.0).abs() <= tolerance, "{name}: {value}, not {wanted}");
    };
    close("m1", 1.0 - (-0.25_f64).exp(), 1e-5);
    // Ramps from 0.5 to 1 in 0.05 ms and down in 0.1 ms, 0.5 ms at 1 between.
    close("m2", (0.5 + 0.75 * 0.15) / 0.65, 1e-5);
    close("m3", 1.0, 1e-5);
    close("m4", 2.0, 1e-9);
    close("m5", 1e-3, 1e-6);
}

/// One row a step, with the limits of each step's own parameters, also where rows stand on a grid; sweeps and phasors.
#[test]
fn steps_sweeps_and_phasors() {
    let text = "charging\n.param half=0.5 r=1k\n.options reltol=1e-6\nVs in 0 1\nR1 in out {r}\nC1 out 0 1u IC=0\n\
                .tran 10u 5m UIC\n.step param half list 0.25 0.5 0.75\n\
                .meas ac other MAX v(out)\n.meas tran t WHEN v(out)='half'\n.meas tran more PARAM='2*t'\n\
                .print tran v(out)\n.end\n";
    for flags in [&[][..], &["--step", "1ms"]] {
        let (found, said) = measures(text, flags);
        assert_eq!(found["step"], [0.0, 1.0, 2.0]);
        for (at, part) in [0.25_f64, 0.5, 0.75].into_iter().enumerate() {
            let wanted = -1e-3 * (1.0 - part).ln();
            assert!((found["t"][at] / wanted - 1.0).abs() < 1e-5, "{at}: {:?}", found["t"]);
            assert!((found["more"][at] / wanted - 2.0).abs() < 1e-5, "{:?}", found["more"]);
        }
        assert!(said.contains("step") && said.contains("W0792"), "{said}");
    }
    let low = "low pass\nVs in 0 DC 0 AC 1\nR1 in out 1k\nC1 out 0 1u\n.ac dec 100 1 100k\n\
               .meas ac corner WHEN vdb(out)=-3.0102999566398 CROSS=1\n.meas ac top MAX v(out)\n\
               .print ac v(out)\n.end\n";
    let corner = 1e3 / (2.0 * PI);
    // Also where every voltage and current is written.
    for text in [low.to_string(), low.replace(".print ac v(out)\n", "")] {
        let (found, _) = measures(&text, &[]);
        // Lines between 100 points a decade.
        assert!((found["corner"][0] / corner - 1.0).abs() < 1e-3, "{:?}", found["corner"]);
        assert!((found["top"][0] - 1.0).abs() < 1e-4, "{:?}", found["top"]);
    }
    let divider = "divider\nV1 in 0 0\nR1 in out 1k\nR2 out 0 3k\n.dc V1 0 10 0.5\n\
                   .meas dc where WHEN v(out)=3\n.meas dc mean AVG v(out)\n.print dc v(out)\n.end\n";
    let (found, _) = measures(divider, &[]);
    assert!((found["where"][0] - 4.0).abs() < 1e-9, "{:?}", found["where"]);
    assert!((found["mean"][0] - 3.75).abs() < 1e-9, "{:?}", found["mean"]);
}
