//! Decks with diodes and switches against ngspice, which runs them with steps so small that its own error is not seen.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::trace::{Trace, formats, resample};
use std::process::Command;

const BRIDGE: &str = "\
* diode bridge
V1 p n SIN(0 20 50)
D1 p o DM
D2 n o DM
D3 0 p DM
D4 0 n DM
C1 o 0 100u
R1 o 0 1k
Rg n 0 1meg
.model DM D(Is=76.9p N=1.45 Rs=42m Cjo=26.5p tt=4n)
.options reltol=1e-5
.save v(o)
";

const FLOATING_BRIDGE: &str = "\
* diode bridge whose supply floats: what returns through ground is nothing but rounding
V1 a b SIN(0 12 50)
D1 a p dm
D2 b p dm
D3 n a dm
D4 n b dm
C1 p n 100u
R1 p n 200
Rg n 0 1
.model dm D(IS=1e-12 N=1.5 RS=0.1 CJO=20p TT=10n)
.options reltol=1e-5
.save v(p)
";

const LINES: &str = "\
* two lines in a row, the second one given by its wave, between unmatched ends
V1 s 0 PULSE(0 2 1n 0.3n 0.3n 6n 100n)
R1 s a 30
T1 a 0 b 0 Z0=50 TD=1.5n
C1 b 0 4p
T2 b 0 c 0 Z0=75 F=200meg NL=0.5
R2 c 0 200
L2 c d 20n
R3 d 0 40
.options reltol=1e-5
.save v(a) v(b) v(c) i(L2)
";

const BUCK: &str = "\
* buck converter with a switch and a diode
Vin in 0 24
Vg g 0 PULSE(0 5 0 20n 20n 20u 50u)
S1 in sw g 0 SWM
D1 0 sw DM
L1 sw out 100u ic=0
Resr out c 20m
C1 c 0 220u ic=0
Rl out 0 2.4
.model SWM SW(Vt=2.5 Vh=0.1 Ron=10m Roff=1MEG)
.model DM D(Is=1e-9 N=1.05 Rs=5m Cjo=200p tt=10n)
.options reltol=1e-5
.save v(out) i(L1)
";

const TWO_SWITCHES: &str = "\
* buck converter whose two switches change at one instant
Vin in 0 24
Vg g 0 PULSE(0 5 0 20n 20n 20u 50u)
S1 in sw g 0 SWM
L1 sw out 100u ic=0
Resr out c 20m
C1 c 0 220u ic=0
Rl out 0 2.4
S2 0 sw 0 g SWN
.model SWM SW(Vt=2.5 Vh=0.1 Ron=10m Roff=1MEG)
.model SWN SW(Vt=-2.5 Vh=0.1 Ron=10m Roff=1MEG)
.options reltol=1e-5
.save v(out) i(L1)
";

/// ngspice's trace of a deck; `None` where ngspice is not installed and need not be.
fn ngspice(deck: &str) -> Option<Trace> {
    if Command::new("ngspice").arg("--version").output().is_err() {
        assert!(std::env::var_os("BONDSPICE_REQUIRE_PEERS").is_none(), "ngspice is missing");
        eprintln!("SKIPPED: ngspice is not installed");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, raw) = (folder.path().join("deck.cir"), folder.path().join("deck.raw"));
    std::fs::write(&path, deck).unwrap();
    let output = Command::new("ngspice").arg("-b").arg("-r").arg(&raw).arg(&path).output().unwrap();
    let bytes = std::fs::read(&raw)
        .unwrap_or_else(|_| panic!("ngspice: {}", String::from_utf8_lossy(&output.stderr)));
    Some(formats::read("deck.raw", &bytes).unwrap())
}

/// Runs a deck here and there, and compares every column at ngspice's times, as parts of its range.
fn same(deck: &str, ours: &str, theirs: &str, tolerance: f64) {
    let run = run_text("deck.cir", &format!("{deck}{ours}\n.end\n"), &Overrides::default());
    let (trace, statistics) = run.unwrap_or_else(|d| panic!("{d:?}"));
    let Some(reference) = ngspice(&format!("{deck}{theirs}\n.end\n")) else { return };
    for name in &reference.names[1..] {
        let expected = reference.column(name).unwrap();
        let position = trace.names.iter().position(|n| n.eq_ignore_ascii_case(name));
        let column = &trace.columns[position.unwrap_or_else(|| panic!("no {name}"))];
        let (low, high) = expected
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut worst = (0.0, 0.0);
        for (time, expected) in reference.time().iter().zip(expected) {
            let place = resample::place(trace.time(), *time).unwrap();
            let error = (resample::value(column, place) - expected).abs() / (high - low);
            if error > worst.0 {
                worst = (error, *time);
            }
        }
        assert!(worst.0 < tolerance, "{name}: {worst:?}\n{statistics}");
    }
}

#[test]
fn a_diode_bridge() {
    same(BRIDGE, ".tran 10u 40m", ".tran 10u 40m 0 2u", 1e-3);
}

#[test]
fn a_diode_bridge_with_a_floating_supply() {
    same(FLOATING_BRIDGE, ".tran 10u 40m", ".tran 10u 40m 0 2u", 1e-3);
}

#[test]
fn a_buck_converter_with_switch_and_diode() {
    same(BUCK, ".tran 1u 500u uic", ".tran 1u 500u 0 20n uic", 1e-3);
}

#[test]
fn a_buck_converter_with_two_switches() {
    same(TWO_SWITCHES, ".tran 1u 500u uic", ".tran 1u 500u 0 20n uic", 1e-3);
}

#[test]
fn lossless_lines() {
    same(LINES, ".tran 0.05n 40n", ".tran 0.05n 40n 0 2p", 1e-3);
}
