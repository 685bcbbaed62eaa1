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
    if !crate::peers::has("ngspice") {
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

const PASSIVE: &str = "\
* values by laws, from models, at temperatures, many in parallel
V1 in 0 SIN(0 2 1k)
R1 in a 1k tc1=2m tc2=1e-5
R2 a 0 R='1k*(1+v(a)*v(a))'
C1 a 0 C='1u*(1+v(a)*v(a))'
R3 in b rm l=20u w=2u
C2 b 0 cm l=100u w=50u
R4 in c 500 m=2
C3 c 0 2u m=3
L1 c d 1m tc1=1m
R5 d 0 100 temp=60 tc1=3m
C4 in e Q='1u*v(in,e)*(1+0.1*v(in,e))'
R6 e 0 200
.model rm r(rsh=100 tc1=1m tnom=20)
.model cm c(cj=1e-4 cjsw=1e-9 tc1=1m)
.options temp=50 reltol=1e-6 method=gear
.save v(a) v(b) v(c) v(d) v(e)
";

#[test]
fn passive_devices_by_laws_and_models() {
    // ngspice's second order at steps of 0.2 us: (2 pi 1e3 2e-7)^2 = 2e-6. Ours integrates at 1e-9, a thousandth of what the
    // deck says: at 1e-6 a step its error adds up to 4e-5 over the run.
    same(PASSIVE, ".options reltol=1e-9\n.tran 1u 2m", ".tran 1u 2m 0 0.2u", 1e-5);
}

const WAVEFORMS: &str = "\
* waveforms that repeat, that are modulated, polynomials of voltages and of currents
V1 a 0 PWL(0 0 1m 1 1.5m 0 3m 2) r=1m td=0.5m
R1 a 0 1k
V2 b 0 AM(2 0.5 200 1k 0.3m)
R2 b 0 1k
E1 c 0 POLY(2) a 0 b 0 0.1 1 2 3 4 5
R3 c 0 1k
Vs a2 0 SIN(0 1 500)
R4 a2 0 10
F1 0 d POLY(1) Vs 0 2 3
R5 d 0 1
.options reltol=1e-6
.save v(a) v(b) v(c) v(d)
";

#[test]
fn waveforms_and_polynomials() {
    // Between points ngspice's straight lines at 1 us are 5e-6 off a sine of 1 kHz, and 4 times that off its square.
    same(WAVEFORMS, ".tran 1u 9m", ".tran 1u 9m 0 1u", 5e-5);
}

const DIODES: &str = "\
* diodes hot, with a sidewall, in breakdown, at high injection, five in parallel
V1 in 0 SIN(0 8 1k)
R1 in a 100
D1 a 0 DA area=2 temp=100
R2 in b 100
D2 b 0 DB pj=3 area=1
R3 in c 100
D3 0 c DC
R4 in d 10
D4 d 0 DD m=5
.model DA D(IS=1e-12 N=1.2 RS=1 CJO=20p TT=5n EG=1.11 XTI=3 VJ=0.8 M=0.4)
.model DB D(IS=1e-14 JSW=1e-12 CJO=10p CJSW=30p PHP=0.7 MJSW=0.3)
.model DC D(IS=1e-13 BV=4 IBV=1m NBV=2)
.model DD D(IS=1e-12 IKF=10m RS=0.5)
.options reltol=1e-6 abstol=1e-15 gmin=1e-15
.save v(a) v(b) v(c) v(d)
";

#[test]
fn diodes_in_all_regions() {
    // ngspice takes its first steps, of tstep/100, at first order: they must be short beside the 4 ns of D1.
    same(DIODES, ".tran 1u 2m", ".tran 0.01u 2m 0 0.5u", 1e-4);
}

const CROSSED: &str = "\
* a switch of negative hysteresis, and one of positive
V1 c 0 SIN(0 2 1k)
V2 s 0 1
R1 s a 1k
S1 a 0 c 0 SN
R2 s b 1k
S2 b 0 c 0 SP
.model SN SW(vt=0.5 vh=-0.7 ron=100 roff=10k)
.model SP SW(vt=0.5 vh=0.7 ron=100 roff=10k)
.options reltol=1e-6
";

#[test]
fn switches_of_either_hysteresis() {
    // The mean over time shows where they change, to the step of ngspice: 0.1 us of 1 ms for each of four changes.
    let run = |ours: &str| run_text("deck.cir", ours, &Overrides::default());
    let deck = format!("{CROSSED}.save v(a) v(b)\n");
    let (trace, _) = run(&format!("{deck}.tran 1u 3m\n.end\n")).unwrap_or_else(|d| panic!("{d:?}"));
    let Some(reference) = ngspice(&format!("{deck}.tran 1u 3m 0 0.1u\n.end\n")) else { return };
    let mean = |trace: &Trace, name: &str| {
        let (t, v) = (trace.time(), trace.column(name).unwrap());
        let area: f64 = (1..t.len()).map(|k| 0.5 * (v[k] + v[k - 1]) * (t[k] - t[k - 1])).sum();
        area / 3e-3
    };
    for name in ["v(a)", "v(b)"] {
        let (own, theirs) = (mean(&trace, name), mean(&reference, name));
        assert!((own - theirs).abs() < 1e-3, "{name}: {own} {theirs}");
    }
}
