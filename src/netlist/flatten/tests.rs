//! Flattening: scopes, parameters, models, waveforms, outputs, errors.

use crate::circuit::stamps::{Stamps, stamp};
use crate::circuit::{Analysis, Circuit, DeviceId, DeviceKind, Leaf, NodeId, Waveform};
use crate::diagnostic::Diagnostic;
use crate::netlist::Netlist;
use crate::netlist::read::{How, read};
use crate::source::SourceMap;

fn flat(text: &str) -> (Option<Circuit>, Vec<Diagnostic>) {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let netlist = read(&mut map, file, &How::default(), &mut d);
    assert!(d.is_empty(), "{d:?}");
    (super::flatten(&netlist, &mut d), d)
}

fn circuit(text: &str) -> Circuit {
    let (circuit, d) = flat(text);
    assert!(d.is_empty(), "{d:?}");
    circuit.unwrap()
}

fn stamps(circuit: &Circuit) -> Stamps {
    let mut d = vec![];
    let stamps = stamp(circuit, &mut d);
    assert!(d.is_empty(), "{d:?}");
    stamps.unwrap()
}

fn kind<'c>(circuit: &'c Circuit, name: &str) -> &'c DeviceKind {
    &circuit
        .devices
        .iter()
        .find(|device| device.name.eq_ignore_ascii_case(name))
        .unwrap_or_else(|| panic!("{name}"))
        .kind
}

/// Decks of every kind that simulators are raced with: read, flattened and stamped without a word.
#[test]
fn whole_decks_come_down_to_stamps() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/decks");
    for (name, devices, unknowns) in [
        ("channels.cir", 33, 35),
        ("ladder.cir", 9, 6),
        ("grid.cir", 11, 6),
        ("buck.cir", 8, 9),
        ("buck_ideal.cir", 8, 8),
        ("bridge.cir", 8, 8),
        ("multiplier.cir", 11, 11),
        ("features.cir", 27, 25),
    ] {
        let path = format!("{folder}/{name}");
        let circuit =
            circuit(&std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}")));
        let stamps = stamps(&circuit);
        assert!(!stamps.outputs.is_empty(), "{name}");
        assert_eq!((circuit.devices.len(), stamps.unknowns.len()), (devices, unknowns), "{name}");
    }
}

#[test]
fn parameters_refer_to_each_other_in_any_order() {
    let c = circuit(
        "t\n.param a={b*2} b={c+1}\n.param c=2 d={pi}\nr1 x 0 {a}\nr2 x 0 {d}\nr3 x 0 {A*temper}\n",
    );
    assert_eq!(kind(&c, "r1"), &DeviceKind::Resistor { resistance: 6.0 });
    assert_eq!(kind(&c, "r2"), &DeviceKind::Resistor { resistance: std::f64::consts::PI });
    assert_eq!(kind(&c, "r3"), &DeviceKind::Resistor { resistance: 162.0 });
    let chain: String = (0..20_000).map(|k| format!(".param p{k}={{p{}+1}}\n", k + 1)).collect();
    let c = circuit(&format!("t\n{chain}.param p20000=1\nr1 x 0 {{p0}}\nr2 x 0 1\n"));
    assert_eq!(kind(&c, "r1"), &DeviceKind::Resistor { resistance: 20_001.0 });
}

#[test]
fn instances_have_scopes_of_their_own() {
    let c = circuit(
        "t\n.param g=10\n.subckt half in out r=1k\n.param twice={2*r}\nr1 in mid {r}\nr2 mid out {twice+g}\nb1 out 0 i=v(mid)*i(v1)\nv1 mid 0 0\n.ends\n\
         .subckt outer a\nx1 a 0 half r={g}\n.ends\nx1 p q half\nx2 q p half r=5\nx3 p outer\nr9 p 0 1\n.save v(x1.mid) i(x2.v1) i(v.x2.v1) v(x3.x1.mid)\n",
    );
    assert_eq!(kind(&c, "x1.r2"), &DeviceKind::Resistor { resistance: 2010.0 });
    assert_eq!(kind(&c, "x2.r2"), &DeviceKind::Resistor { resistance: 20.0 });
    assert_eq!(kind(&c, "x3.x1.r2"), &DeviceKind::Resistor { resistance: 30.0 });
    let names: Vec<_> = c.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["0", "p", "q", "x1.mid", "x2.mid", "x3.x1.mid"]);
    let DeviceKind::BehaviouralCurrent { law } = kind(&c, "x2.b1") else { panic!() };
    let mut leaves = vec![];
    law.leaves(&mut |leaf, _| leaves.push(*leaf));
    let v1 = c.devices.iter().position(|device| &*device.name == "x2.v1").unwrap() as u32;
    assert_eq!(leaves, [Leaf::Voltage(NodeId(4), NodeId(0)), Leaf::Current(DeviceId(v1))]);
    assert_eq!(c.outputs[1].expr.node, c.outputs[2].expr.node);
    let names: Vec<_> = stamps(&c).unknowns.into_iter().map(|unknown| unknown.name).collect();
    assert!(names.iter().any(|name| &**name == "i(v.x2.v1)"), "{names:?}");
}

#[test]
fn models_become_numbers() {
    let c = circuit(
        "t\n.param vt=2.5\n.model SWM SW(Vt={vt} Vh=0.1 Ron=10m)\n.model W1 csw it=1 ih=0 ron=2 roff=3\n.model DM D(Is=76.9p N=1.45 Rs=42m Cjo=26.5p tt=4n bv=5)\n\
         s1 a 0 b 0 swm on\nw1 a b v1 w1\nd1 a 0 dm 2\nv1 b 0 1\n",
    );
    let DeviceKind::Switch { on, off, on_resistance, off_resistance, initially_on, .. } =
        kind(&c, "s1")
    else {
        panic!()
    };
    assert_eq!(
        (*on, *off, *on_resistance, *off_resistance, *initially_on),
        (2.6, 2.4, 10e-3, 1e12, Some(true))
    );
    let DeviceKind::Switch { on, control, .. } = kind(&c, "w1") else { panic!() };
    assert_eq!(
        (*on, control.node.as_ref()),
        (1.0, &crate::expr::Node::Leaf(Leaf::Current(DeviceId(3))))
    );
    let DeviceKind::Diode { model, instance } = kind(&c, "d1") else { panic!() };
    assert_eq!(
        (instance.area, model.saturation_current, model.breakdown_voltage, model.grading),
        (2.0, 76.9e-12, Some(5.0), 0.5)
    );
    stamps(&c);
}

#[test]
fn sources_keep_their_parts_for_other_analyses() {
    let c = circuit(
        "t\nv1 a 0 DC 3 AC 2 90 SIN(0 1 50)\nv2 a 0 5 ac pulse(0 1)\nv3 a 0 SIN(0 1 50) ac={p} 45 dc=1\ni1 a 0 ac 1\nr1 a 0 1\n.param p=7\n.tran 1m 1 uic\n",
    );
    let parts = |name| match kind(&c, name) {
        DeviceKind::VoltageSource { waveform, parts }
        | DeviceKind::CurrentSource { waveform, parts } => {
            (waveform.value(0.0), parts.dc, parts.ac.map(|ac| (ac.magnitude, ac.phase)))
        }
        other => panic!("{other:?}"),
    };
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    assert_eq!(parts("v1"), (0.0, Some(3.0), Some((2.0, FRAC_PI_2))));
    assert_eq!(parts("v2"), (0.0, Some(5.0), Some((1.0, 0.0))));
    assert_eq!(parts("v3"), (0.0, Some(1.0), Some((7.0, FRAC_PI_4))));
    assert_eq!(parts("i1"), (0.0, None, Some((1.0, 0.0))));
}

#[test]
fn waveforms_take_the_defaults_of_spice() {
    let c = circuit(
        "t\nv1 a 0 PULSE(0 1)\nv2 a 0 PULSE(0 1 1u 0 2u 3u 4u)\nv3 a 0 SIN(0 1 0 0 0 90)\nv4 a 0 EXP(0 1)\nv5 a 0 PWL(0 0 1 2)\n.tran 1m 2 uic\n",
    );
    let waveform = |name| match kind(&c, name) {
        DeviceKind::VoltageSource { waveform, .. } => (**waveform).clone(),
        other => panic!("{other:?}"),
    };
    let pulse = |delay, rise, fall, width, period| Waveform::Pulse {
        low: 0.0,
        high: 1.0,
        delay,
        rise,
        fall,
        width,
        period,
    };
    assert_eq!(waveform("v1"), pulse(0.0, 1e-3, 1e-3, 2.0, 0.0));
    assert_eq!(waveform("v2"), pulse(1e-6, 1e-3, 2e-6, 3e-6, 4e-6));
    let Waveform::Sine { frequency, phase, .. } = waveform("v3") else { panic!() };
    assert_eq!((frequency, phase), (0.5, std::f64::consts::FRAC_PI_2));
    let Waveform::Exponential { rise_delay, rise_tau, fall_delay, fall_tau, .. } = waveform("v4")
    else {
        panic!()
    };
    assert_eq!((rise_delay, rise_tau, fall_delay, fall_tau), (1e-3, 1e-3, 2e-3, 1e-3));
    assert_eq!(waveform("v5"), Waveform::Pwl(vec![(0.0, 0.0), (1.0, 2.0)]));
}

#[test]
fn the_header_is_honoured() {
    let c = circuit(
        "t\n*bondspice hmax=auto\n*bondspice grid=0.001\n*bondspice option=reltol=1e-6\n*bondspice jump=V_x 0.1\n*bondspice jump=V_p rise\n\
         *bondspice domain=hydraulic 1e6 1e-5 v(a) i(V_p)\n*bondspice column=[\"pump pressure\",\"bar\",\"v(a)/100000\"]\n\
         V_x a 0 PWL(0 0 0.1 0 0.1001 1 1 1)\nV_p b a PULSE(0 1 0 1e-4 1e-4 1 2)\nr1 b 0 1\n.options reltol=1e-3\n.save v(b)\n.tran 1m 1 0 1e-4 uic\n",
    );
    assert_eq!(c.grid, Some(1e-3));
    assert_eq!(
        c.analyses,
        [Analysis::Transient { step: 1e-3, stop: 1.0, start: 0.0, hmax: None, uic: true }]
    );
    let options: Vec<_> = c.options.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(options, [("reltol", "0.001"), ("hmax", "auto"), ("reltol", "1e-6")]);
    let DeviceKind::VoltageSource { waveform, .. } = kind(&c, "V_x") else { panic!() };
    assert_eq!(**waveform, Waveform::Pwl(vec![(0.0, 0.0), (0.1, 0.0), (0.1, 1.0), (1.0, 1.0)]));
    let DeviceKind::VoltageSource { waveform, .. } = kind(&c, "V_p") else { panic!() };
    assert!(matches!(**waveform, Waveform::Pulse { rise: 0.0, fall: 1e-4, .. }));
    assert_eq!(
        (c.nodes[1].nominal, c.nodes[2].nominal, c.devices[1].nominal),
        (Some(1e6), None, Some(1e-5))
    );
    assert_eq!((c.outputs.len(), c.outputs[0].name.as_str()), (1, "pump pressure"));
}

#[test]
fn outputs_in_their_order_and_once() {
    let c = circuit(
        "t\nv1 a 0 1\nr1 a b 1\nr2 b 0 1\n.save v(b) i(v1)\n.print tran V(B) {v(a)*i(r1)} v(a,b)\n",
    );
    let names: Vec<_> = c.outputs.iter().map(|output| output.name.as_str()).collect();
    assert_eq!(names, ["v(b)", "i(v1)", "{v(a)*i(r1)}", "v(a,b)"]);
    assert!(circuit("t\nv1 a 0 1\nr1 a 0 1\n.save all v(a)\n").outputs.is_empty());
}

#[test]
fn initial_values_and_couplings() {
    let c = circuit(
        "t\nc1 a b 2\nl1 a 0 1\nl2 b 0 4\nl3 b 0 9\nk1 l1 l2 l3 0.5\n.ic v(a)=3 v(b)=1\n.param x=2\n",
    );
    assert_eq!(c.initial, [(NodeId(1), 3.0), (NodeId(2), 1.0)]);
    let names: Vec<_> = c.devices.iter().map(|device| &*device.name).collect();
    assert_eq!(names, ["c1", "l1", "l2", "l3", "k1", "k1#1_3", "k1#2_3"]);
    let s = stamps(&c);
    assert_eq!(s.charges[0].initial, Some(4.0));
    assert_eq!(
        s.charges[1].linear.iter().map(|(_, value)| *value).collect::<Vec<_>>(),
        [1.0, 1.0, 1.5]
    );
}

#[test]
fn errors_have_codes_and_helps() {
    for (body, code, help) in [
        ("r1 a 0 {gian}\n.param gain=1\nr2 a 0 1", "E0733", Some("did you mean `gain`?")),
        ("r1 a 0 {nowhere}\nr2 a 0 1", "E0733", Some("define it: .param nowhere=…")),
        (".param a={b} b={c} c={a}\nr1 x 0 {a}\nr2 x 0 1", "E0731", None),
        (
            "e1 a 0 a 0 {v(a)}\nr2 a 0 1",
            "E0732",
            Some("what follows a voltage, a current or time is a B source: V={…} or I={…}"),
        ),
        ("r1 a b 1\nr2 a b 1", "E0746", Some("call the reference node `0` or `gnd`")),
        (".param a=1", "E0734", None),
        ("r1 a 0 1\nR1 a 0 2", "E0735", None),
        ("x1 a 0 nosub\nr1 a 0 1", "E0738", Some("define it: .subckt nosub … .ends")),
        (".subckt s a b\nr1 a b 1\n.ends\nx1 a s\nr1 a 0 1", "E0738", None),
        (
            ".subckt s a b gain=1\nr1 a b {gain}\n.ends\nx1 a 0 s gian=2",
            "E0733",
            Some("did you mean `gain`?"),
        ),
        (".subckt s a b\nx1 a b t\n.ends\n.subckt t a b\nx1 a b s\n.ends\nx1 a 0 s", "E0739", None),
        ("b1 out 0 v=v(otu)\nr1 out 0 1", "E0740", Some("did you mean `out`?")),
        ("e1 out 0 nowhere 0 1\nr1 out 0 1", "E0740", None),
        ("f1 a 0 vv1 1\nv_1 a 0 1", "E0741", Some("did you mean `v_1`?")),
        (
            "l1 a 0 1\nl2 a 0 1\nk1 l1 l2 0.5\nb1 a 0 i=i(k1)",
            "E0741",
            Some("read the current of one of the inductors"),
        ),
        ("d1 a 0 DMOD\nr1 a 0 1\n.model DMOF D(is=1)", "E0742", Some("did you mean `DMOF`?")),
        ("d1 a 0 DM\nr1 a 0 1\n.model DM SW(vt=1)", "E0742", None),
        ("d1 a 0 DM\nr1 a 0 1\n.model DM D(iss=1)", "E0743", Some("did you mean `is`?")),
        ("v1 a 0 PWL(0 0 2 1 1 1)\nr1 a 0 1", "E0744", None),
        (
            "v1 a 0 1\nr1 a 0 1\n.tran 0 1",
            "E0745",
            Some(".tran step stop [start [hmax]] [uic], with step > 0 and 0 <= start < stop"),
        ),
        (".subckt s a\nr1 a 0 1\n.tran 1 2\n.ends\nx1 a s\nx2 a s", "E0736", None),
    ] {
        let (circuit, d) = flat(&format!("t\n{body}\n"));
        assert!(circuit.is_none(), "{body}");
        let error = d.iter().find(|d| d.code == code).unwrap_or_else(|| panic!("{body}: {d:?}"));
        assert_eq!(error.help.as_deref(), help, "{body}: {error:?}");
        assert!(d.iter().all(|d| crate::diagnostic::codes::find(d.code).is_some()));
    }
    let (_, d) = flat("t\n.param a={b} b={c} c={a}\nr1 x 0 {a}\nr2 x 0 1\n");
    assert_eq!(d[0].notes, ["a → b → c → a: each uses the next"]);
    let (_, d) =
        flat("t\n.subckt s a b\nx1 a b t\n.ends\n.subckt t a b\nx1 a b s\n.ends\nx1 a 0 s\n");
    assert_eq!(d[0].notes, ["s → t → s"]);
}

#[test]
fn nodes_named_once_are_warned_of() {
    let (circuit, d) = flat(
        "t\nv1 out 0 1\nr1 uot 0 1\nr2 out 0 1\ne1 s 0 out 0 1\n.subckt q a b\nr1 a lonely 1\n.ends\nx1 out 0 q\n.save v(s)\n",
    );
    assert!(circuit.is_some());
    assert_eq!(d.iter().map(|d| d.code).collect::<Vec<_>>(), ["W0731", "W0731"]);
    assert_eq!(d[0].help.as_deref(), Some("did you mean `out`?"));
    assert!(d[1].message.contains("lonely"));
}

#[test]
fn bombs_are_refused() {
    let mut text = String::from("t\n.subckt s0 a\nr1 a 0 1\n.ends\n");
    for k in 1..30 {
        text.push_str(&format!(".subckt s{k} a\n"));
        (0..10).for_each(|i| text.push_str(&format!("x{i} a s{}\n", k - 1)));
        text.push_str(".ends\n");
    }
    text.push_str("x1 a s29\n");
    let (circuit, d) = flat(&text);
    assert!(circuit.is_none());
    assert_eq!(d.last().map(|d| d.code), Some("E0737"));
}

fn netlist(text: &str, dialect: &str) -> Netlist {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let how = How::of(crate::netlist::dialects::find(dialect).unwrap());
    let netlist = read(&mut map, file, &how, &mut d);
    assert!(d.is_empty(), "{d:?}");
    netlist
}

/// The resistance of a device, in a step, with a seed.
fn drawn(netlist: &Netlist, step: u64, seed: &str, name: &str) -> f64 {
    let mut d = vec![];
    let options = vec![("seed".to_string(), seed.to_string())];
    let variation = super::Variation { step, options, ..Default::default() };
    let circuit = super::flatten_with(netlist, &variation, &mut d).unwrap();
    assert!(d.is_empty(), "{d:?}");
    match kind(&circuit, name) {
        DeviceKind::Resistor { resistance } => *resistance,
        other => panic!("{other:?}"),
    }
}

const RANDOM: &str = "random
.param r={agauss(1k,30,3)} same={r}
.func own(a) {a*gauss(1,0.03,3)}
.subckt part a
R1 a 0 {aunif(500,100)}
.ends
V1 a 0 1
Rr a 0 {r}
Rs a 0 {same}
Rf a 0 {own(1k)}
Rg a 0 {own(1k)}
Rl a 0 {limit(1k,100)}
Ru a 0 {unif(1k,0.5)}
X1 a part
X2 a part
.op
.end
";

#[test]
fn random_values_are_drawn_once_for_each_place_instance_step_and_seed() {
    let (ngspice, xyce) = (netlist(RANDOM, "ngspice"), netlist(RANDOM, "xyce"));
    let of = |name: &str, step, seed: &str| drawn(&ngspice, step, seed, name);
    // A parameter is drawn once; calls of a function, instances, steps and seeds each for themselves.
    assert_eq!(of("rr", 0, "1"), of("rs", 0, "1"));
    assert_eq!(of("rr", 0, "1"), of("rr", 0, "1"));
    for (a, b) in [
        (of("rf", 0, "1"), of("rg", 0, "1")),
        (of("x1.r1", 0, "1"), of("x2.r1", 0, "1")),
        (of("rr", 0, "1"), of("rr", 1, "1")),
        (of("rr", 0, "1"), of("rr", 0, "2")),
    ] {
        assert!(a != b && a.is_finite() && b.is_finite(), "{a} {b}");
    }
    // Xyce draws in analyses of samples only.
    for (name, nominal) in [("rr", 1e3), ("rf", 1e3), ("x1.r1", 500.0), ("rl", 1e3), ("ru", 1e3)] {
        assert_eq!(drawn(&xyce, 3, "1", name), nominal, "{name}");
    }
}

#[test]
fn random_values_have_the_distributions_of_their_functions() {
    const N: u64 = 400;
    // Four standard errors of mean and of variance.
    let moments = |netlist: &Netlist, name: &str, mean: f64, deviation: f64, fourth: f64| {
        let values: Vec<f64> = (0..N).map(|k| drawn(netlist, k, "7", name)).collect();
        let unit: Vec<f64> = values.iter().map(|x| (x - mean) / deviation).collect();
        let of = |f: &dyn Fn(f64) -> f64| unit.iter().map(|x| f(*x)).sum::<f64>() / N as f64;
        let room = 4.0 / (N as f64).sqrt();
        assert!(of(&|x| x).abs() < room, "{name}");
        assert!((of(&|x| x * x) - 1.0).abs() < room * (fourth - 1.0).sqrt() + 1e-12, "{name}");
        values
    };
    let ngspice = netlist(RANDOM, "ngspice");
    moments(&ngspice, "rr", 1e3, 10.0, 3.0);
    moments(&ngspice, "rf", 1e3, 10.0, 3.0);
    let uniform = moments(&ngspice, "x1.r1", 500.0, 100.0 / 3f64.sqrt(), 1.8);
    assert!(uniform.iter().all(|x| (400.0..600.0).contains(x)));
    moments(&ngspice, "ru", 1e3, 500.0 / 3f64.sqrt(), 1.8);
    let signs = moments(&ngspice, "rl", 1e3, 100.0, 1.0);
    assert!(signs.iter().all(|x| [900.0, 1100.0].contains(x)));
    let text = "ltspice\nV1 a 0 1\nRm a 0 {mc(1k,0.1)}\nRg a 0 {1k+gauss(20)}\nRf a 0 {1k+flat(50)}\n.op\n.end\n";
    let ltspice = netlist(text, "ltspice");
    moments(&ltspice, "rm", 1e3, 100.0 / 3f64.sqrt(), 1.8);
    moments(&ltspice, "rg", 1e3, 20.0, 3.0);
    moments(&ltspice, "rf", 1e3, 50.0 / 3f64.sqrt(), 1.8);
}
