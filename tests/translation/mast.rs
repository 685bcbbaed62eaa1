//! MAST for Saber, which cannot be run here: a reader of our templates, which shares nothing with their writer, finds the
//! same equations in what is written as those of our circuit, and integrates a few models by itself.

use crate::mast_reader::{Dual, Instance, Rate, System};
use crate::translated::{models, translated};
use bondspice::bond::elaborate::Overrides;
use bondspice::circuit::stamps::{Leaf, Stamps, UnknownId, stamp};
use bondspice::circuit::{Circuit, DeviceKind};
use bondspice::cli::pipeline::run_text;
use bondspice::netlist::dialects;
use bondspice::netlist::{Netlist, flatten::flatten};
use bondspice::source::SourceMap;
use std::collections::HashMap;

/// The text for Saber, or the errors.
fn written(netlist: &Netlist) -> Result<String, Vec<String>> {
    let mut d = vec![];
    let written = dialects::find("saber").unwrap().write(netlist, &mut d);
    let errors = || d.iter().map(|d| format!("{} {}", d.code, d.message)).collect();
    written.map(|written| written.text).ok_or_else(errors)
}

fn netlist(text: &str) -> Netlist {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let netlist = bondspice::netlist::read::read(
        &mut map,
        file,
        &bondspice::netlist::read::How::default(),
        &mut d,
    );
    assert!(d.is_empty(), "{d:?}\n{text}");
    netlist
}

/// The circuit of a netlist's plain cards: edges have their widths, as other simulators see them.
fn circuit(text: &str) -> Circuit {
    let plain: Vec<&str> = text.lines().filter(|line| !line.starts_with("*bondspice")).collect();
    let mut d = vec![];
    flatten(&netlist(&plain.join("\n")), &mut d).unwrap_or_else(|| panic!("{d:?}"))
}

/// A generator of random numbers (splitmix64), seeded.
struct Random(u64);

impl Random {
    /// Between 0 and 1.
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Sums with the sum of their magnitudes.
struct Sums(Vec<(f64, f64)>);

impl Sums {
    fn new(count: usize) -> Sums {
        Sums(vec![(0.0, 0.0); count])
    }

    fn add(&mut self, place: usize, value: f64) {
        self.0[place].0 += value;
        self.0[place].1 += value.abs();
    }
}

/// The residuals of our own equations, G·x + f + A·dQ/dt − b.
fn residuals(stamps: &Stamps, x: &[f64], rates: &[f64], time: f64) -> Sums {
    let mut sums = Sums::new(x.len());
    let at = |id: &UnknownId| id.0 as usize;
    for (row, column, value) in &stamps.conductances {
        sums.add(at(row), value * x[at(column)]);
    }
    let charge_rate = |k: usize| -> f64 {
        assert!(stamps.charges[k].law.is_none());
        stamps.charges[k].linear.iter().map(|(id, factor)| factor * rates[at(id)]).sum()
    };
    for (k, charge) in stamps.charges.iter().enumerate() {
        // Term by term, for the magnitudes.
        for (row, sign) in &charge.into {
            for (id, factor) in &charge.linear {
                sums.add(at(row), sign * factor * rates[at(id)]);
            }
        }
        charge_rate(k);
    }
    let mut value = |leaf: &Leaf| match leaf {
        Leaf::Unknown(id) => x[at(id)],
        Leaf::Rate(k) => charge_rate(*k as usize),
        Leaf::Time => time,
        // Of switches with one threshold, in which nothing is remembered.
        Leaf::Mode(k) => {
            let mode = &stamps.modes[*k as usize];
            assert_eq!(mode.on, mode.off);
            let control = mode.control.evaluate(&mut |leaf| match leaf {
                Leaf::Unknown(id) => x[at(id)],
                other => panic!("{other:?}"),
            });
            f64::from(control > mode.on)
        }
    };
    for law in &stamps.laws {
        let value = law.law.evaluate(&mut value);
        for (row, factor) in &law.into {
            sums.add(at(row), factor * value);
        }
    }
    for source in &stamps.sources {
        for (row, factor) in &source.into {
            sums.add(at(row), -factor * source.waveform.value(time));
        }
    }
    assert!(stamps.memories.is_empty());
    sums
}

/// Rates of a value along the direction of its slope.
struct Along;

impl Rate for Along {
    fn rate(&mut self, _: usize, value: Dual) -> Dual {
        Dual { value: value.slope, slope: f64::NAN }
    }
}

/// The devices that an instance stands for, each with its two pins and its current.
fn devices(instance: &Instance) -> Vec<(String, [String; 2], Option<usize>)> {
    let coupled = instance.template.starts_with("bg_coupled");
    let names = instance.name.split("_and_").map(str::to_lowercase);
    let names: Vec<String> =
        if coupled { names.collect() } else { vec![instance.name.to_lowercase()] };
    let ends = |k: usize| [instance.nodes[2 * k].clone(), instance.nodes[2 * k + 1].clone()];
    let own = |k: usize| instance.own.get(k).map(|(_, place)| *place);
    names.into_iter().enumerate().map(|(k, name)| (name, ends(k), own(k))).collect()
}

/// For each unknown of the file, ours; `None` for the current of a device that has none among our unknowns. Asserts that every device stands between the same nodes in both, with every
/// initial value.
fn matched(system: &System, circuit: &Circuit, stamps: &Stamps, what: &str) -> Vec<Option<usize>> {
    let mut place: Vec<Option<usize>> = vec![None; system.unknowns.len()];
    let named: HashMap<String, usize> =
        stamps.unknowns.iter().enumerate().map(|(k, u)| (u.name.to_lowercase(), k)).collect();
    let ours: HashMap<String, _> =
        circuit.devices.iter().map(|device| (device.name.to_lowercase(), device)).collect();
    let mut seen = 0;
    for instance in &system.instances {
        let initial: HashMap<String, f64> = system.initial(instance).into_iter().collect();
        for (k, (name, ends, current)) in devices(instance).into_iter().enumerate() {
            let device = ours.get(&name).unwrap_or_else(|| panic!("{what}: {name}"));
            seen += 1;
            for (node, end) in device.nodes.iter().zip(&ends) {
                assert_eq!(node.0 == 0, end == "0", "{what}: {name}");
                if node.0 != 0 {
                    let mine = named
                        [&format!("v({})", circuit.nodes[node.0 as usize].name.to_lowercase())];
                    let theirs = system.unknowns.iter().position(|known| known == end).unwrap();
                    assert!(place[theirs].is_none_or(|before| before == mine), "{what}: {name}");
                    place[theirs] = Some(mine);
                }
            }
            if let (Some(current), Some(mine)) = (current, named.get(&device.current_name())) {
                place[current] = Some(*mine);
            }
            let starts = match &device.kind {
                DeviceKind::Capacitor { initial, .. } => Some(("vc".to_string(), initial)),
                DeviceKind::Inductor { initial, .. } => {
                    let coupled = instance.template.starts_with("bg_coupled");
                    Some((if coupled { format!("i{}", k + 1) } else { "i".to_string() }, initial))
                }
                _ => None,
            };
            if let Some((state, value)) = starts {
                assert_eq!(
                    initial.get(&state).copied(),
                    Some(value.unwrap_or(0.0)),
                    "{what}: {name}"
                );
            }
        }
    }
    let couplings =
        circuit.devices.iter().filter(|d| matches!(d.kind, DeviceKind::Mutual { .. })).count();
    assert_eq!(seen + couplings, circuit.devices.len(), "{what}");
    let mut once: Vec<usize> = place.iter().flatten().copied().collect();
    let count = once.len();
    once.sort();
    once.dedup();
    assert_eq!((once.len(), count), (stamps.unknowns.len(), stamps.unknowns.len()), "{what}");
    place
}

/// How far the residuals of both may be apart, in parts of the sum of their terms' magnitudes.
const ROUNDING: f64 = 1e-10;

/// The residuals of the equations of a file.
fn sums(system: &System, x: &[Dual], time: f64) -> Sums {
    let mut sums = Sums::new(x.len());
    for instance in &system.instances {
        let time = Dual { value: time, slope: 1.0 };
        let mut add = |place: usize, value: Dual| sums.add(place, value.value);
        system.add(instance, &|place| x[place], time, 0, &mut Along, &mut add);
    }
    sums
}

/// Compares the equations of a file with ours at random points. How many values were real comes back.
fn same_equations(text: &str, plain: &str, what: &str) -> usize {
    let system = crate::mast_reader::read(text);
    let circuit = circuit(plain);
    let mut d = vec![];
    let stamps = stamp(&circuit, &mut d).unwrap_or_else(|| panic!("{what}: {d:?}"));
    let place = matched(&system, &circuit, &stamps, what);
    let stop = circuit.analyses.iter().find_map(|analysis| match analysis {
        bondspice::circuit::Analysis::Transient { stop, .. } => Some(*stop),
        _ => None,
    });
    let stop = stop.unwrap_or(1.0);
    let count = system.unknowns.len();
    let mut random = Random(7);
    let mut real = 0;
    // The sides of an equation may stand exchanged, but then always.
    let mut exchanged: Vec<Option<bool>> = vec![None; count];
    for draw in 0..60 {
        let size = [1e-3, 1.0, 30.0][draw % 3];
        let mut x: Vec<Dual> = (0..count)
            .map(|_| Dual {
                value: size * (2.0 * random.part() - 1.0),
                slope: 2.0 * random.part() - 1.0,
            })
            .collect();
        let time = stop * random.part();
        // Currents that are unknowns only there have the values that their equations say.
        for k in (0..count).filter(|k| place[*k].is_none()) {
            x[k] = Dual::from(0.0);
            x[k].value = -sums(&system, &x, time).0[k].0;
        }
        let theirs = sums(&system, &x, time);
        let ours = stamps.unknowns.len();
        let (mut values, mut rates) = (vec![0.0; ours], vec![0.0; ours]);
        for (x, place) in x.iter().zip(&place) {
            if let Some(place) = place {
                (values[*place], rates[*place]) = (x.value, x.slope);
            }
        }
        let ours = residuals(&stamps, &values, &rates, time);
        for (k, (value, size)) in theirs.0.iter().enumerate() {
            let Some(place) = place[k] else { continue };
            let (mine, my_size) = ours.0[place];
            if !value.is_finite() || !mine.is_finite() {
                assert_eq!(value.is_finite(), mine.is_finite(), "{what}: {}", system.unknowns[k]);
                continue;
            }
            real += 1;
            let tolerance = ROUNDING * (size + my_size) + 1e-300;
            let name = &system.unknowns[k];
            let (same, opposite) =
                ((value - mine).abs() <= tolerance, (value + mine).abs() <= tolerance);
            assert!(
                same || (opposite && k >= system.nodes),
                "{what}: {name} {value} {mine} at {time}"
            );
            if same != opposite {
                let before = *exchanged[k].get_or_insert(opposite);
                assert_eq!(before, opposite, "{what}: {name}");
            }
        }
    }
    real
}

#[test]
fn every_model_has_the_equations_of_its_circuit() {
    let mut refused = vec![];
    let mut tried = 0;
    for model in models() {
        let what = model.display().to_string();
        let translated = translated(&model, &Overrides::default());
        match written(&translated.translation.netlist) {
            Err(why) => refused.push(format!("{what}: {}", why.join("; "))),
            Ok(text) => {
                let real = same_equations(&text, &translated.flat_text(), &what);
                println!("{what}: {real} residuals");
                assert!(real >= 60, "{what}: {real}");
                tried += 1;
            }
        }
    }
    assert!(refused.iter().all(|why| why.contains("E0605 saber cannot say")), "{refused:#?}");
    assert_eq!((tried >= 40, refused.len()), (true, 2), "{tried}, {refused:#?}");
}

/// A netlist of whatever can be said, and of each function.
fn of_everything() -> String {
    let mut text = String::from(
        "everything\n.param k=2 two={k*k} big={max(k,7)} third={two/3} p=3 time2=0.5\n\
         v1 a 0 SIN(1 2 3 0.1 0.5 30)\nr1 a b 10\nv2 b c EXP(0 {k} 0.1 0.2 0.5 0.3)\nr2 c 0 {two}\n\
         v3 d 0 SFFM(0.5 1 2 3 0.7)\nr3 d 0 1\ni1 d e PULSE(1 3 0.1 0.05 0.1 0.1 0.35)\nr4 e 0 {big}\n\
         i2 0 e PULSE(0 1 0.2 0.1 0.1 0.3)\ni3 e a PWL(0 0 0.2 1 0.5 -1)\ni4 a e 0.25\n\
         c1 a e 1e-3 IC={k}\nc2 e 0 2e-3\nl1 a f 0.1 IC=0.5\nl2 f 0 0.2\nl3 f g 0.3 IC=-1\nr5 g 0 1\n\
         k1 l1 l2 {1/4}\nk2 l2 l3 0.5\nl4 g 0 0.7 IC={third}\n\
         e1 h 0 a b 2\ng1 h 0 a e -3\nf1 h 0 v2 {k}\nh1 m h l2 5\nr6 m 0 1\nf2 m 0 l4 1\nf3 m 0 h1 {-k}\n\
         s1 m a e 0 sw1\nw1 m b v1 sw2\n.model sw1 sw(vt=0.5 vh=0 ron=2 roff=1e3)\n.model sw2 csw(it=0.1 ron=3)\n\
         b1 n 0 V={i(r5)*i(c1)+i(b2)+v(0,n)+v(a,b)*time}\nb2 n a I={p*v(n)-i(b1)+v(n,0)}\n",
    );
    for (k, law) in LAWS.iter().enumerate() {
        text.push_str(&format!("b_{k} q_{k} 0 V={{{law}}}\nr_{k} q_{k} 0 1\n"));
    }
    text + ".tran 0.01 1 uic\n.end\n"
}

const LAWS: [&str; 34] = [
    "abs(v(a))+sgn(v(b))",
    "sqrt(v(a))*exp(v(b)/10)",
    "ln(v(a))+log10(v(b))",
    "sin(v(a))+cos(v(b))+tan(v(e))",
    "asin(v(a)/40)+acos(v(b)/40)+atan(v(e))",
    "sinh(v(a)/10)+cosh(v(b)/10)+tanh(v(e))",
    "asinh(v(a))",
    "acosh(v(a)+1)",
    "atanh(v(a)/40)",
    "atan2(v(a),v(b))",
    "min(v(a),v(b))*max(v(e),k)",
    "min(max(v(a),-1),k)",
    "pow(v(a),3)+pow(v(b),2)",
    "pow(v(a),1.5)",
    "pwr(v(a),1.7)",
    "pwr(v(a),0.5)+pwr(v(b),3)",
    "pow(v(a),p)",
    "pwr(v(a)-v(b),p)",
    "(v(a)-v(b))**2",
    "v(a) > 0 ? v(b) : sqrt(-v(a))",
    "(v(a) > 0 && v(b) < k) + (v(a) > 1 || v(b) <= -1) + !(v(e) >= 0)",
    "(v(a) == v(a)) + (v(a) != v(b))",
    "v(a) ? 1 : 2",
    "(v(a) > 0 && (v(b) > 0 || v(e) > 0)) ? 3 : 4",
    "(v(a) > 0) * (v(b) > v(e))",
    "table(v(a), -1,3, 0,1, 5,2)",
    "pwl(min(max(v(a)-v(b),-1),2),-1,0,2,9)",
    "v(a) > 0 ? (v(b) > 0 ? min(v(a),v(b)) : 2) : table(v(e), 0,1, 1,-1)",
    "-(-v(a)) - (v(b) - v(e)) / (v(a) / v(b)) / 2",
    "1e-7*v(a) - -3*v(b)",
    "k**2*v(a) + 10**2",
    "1/(1+v(a)*v(a))",
    "time > 0.5 ? time : v(a)*time",
    "pwr(max(v(a),v(b)),2)+pow(v(a)*v(b),-2)",
];

/// Each element, source, function and form of a law that the writer knows.
#[test]
fn every_form_has_its_equations() {
    let plain = of_everything();
    let text = written(&netlist(&plain)).unwrap_or_else(|d| panic!("{d:#?}"));
    let real = same_equations(&text, &plain, "everything");
    assert!(real >= 4000, "{real}");
    // A parameter that follows by cases is a number there, one by formulas a formula.
    assert!(text.contains("number big = 7\n") && text.contains("number two = k*k\n"), "{text}");
}

/// What a reader must not take for the same.
#[test]
fn wrong_texts_are_found() {
    let plain = of_everything();
    let text = written(&netlist(&plain)).unwrap();
    let wrong = [
        ("(v(p)-v(m))/r", "(v(p)-v(m))*r"),
        ("d_by_dt(q)", "d_by_dt(vc)"),
        ("f = l*i\n", "f = l+i\n"),
        ("i(p->m) += k*ic", "i(m->p) += k*ic"),
        ("k*(v(cp)-v(cm))", "k*(v(cm)-v(cp))"),
        ("k1_2*sqrt(l1*l2)*i2", "k1_2*l1*i2"),
        ("bg_r.r1 a b = r=10", "bg_r.r1 a c = r=10"),
        ("bg_r.r1 a b = r=10", "bg_r.r1 a b = r=11"),
        ("number third = two/3", "number third = two/2"),
        ("if (time < t2) {", "if (time < t1) {"),
        ("u2 = u1-1*per", "u2 = u1"),
        ("= v1+(v2-v1)*", "= v1-(v2-v1)*"),
        ("i(bg_l.l4)", "i(bg_r_i.r5)"),
        ("ic=k\n", "ic=k*k\n"),
        ("if (v(cp)-v(cm) > vt)", "if (v(cp)-v(cm) < vt)"),
    ];
    std::panic::set_hook(Box::new(|_| {}));
    let unseen: Vec<&str> = wrong
        .iter()
        .filter(|(right, wrong)| {
            let text = text.clone();
            let changed = text.replacen(right, wrong, 1);
            let plain = plain.clone();
            changed == text
                || std::panic::catch_unwind(move || same_equations(&changed, &plain, "changed"))
                    .is_ok()
        })
        .map(|(right, _)| *right)
        .collect();
    let _ = std::panic::take_hook();
    assert!(unseen.is_empty(), "{unseen:#?}");
}

/// d_by_dt by backward differences of second order over steps of any length; of first order at the start.
struct Backward<'a> {
    /// Of the value now, before, and before that.
    factors: [f64; 3],
    /// The values before, at each site, and those before them.
    past: [&'a [f64]; 2],
    now: &'a mut Vec<f64>,
}

impl Rate for Backward<'_> {
    fn rate(&mut self, site: usize, value: Dual) -> Dual {
        self.now[site] = value.value;
        let past = self.factors[1] * self.past[0][site] + self.factors[2] * self.past[1][site];
        Dual { value: self.factors[0] * value.value + past, slope: self.factors[0] * value.slope }
    }
}

/// Solves A·x = b by elimination with row exchange, each row scaled by its largest entry.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for (row, value) in a.iter_mut().zip(&mut b) {
        let scale = row.iter().fold(0.0f64, |most, entry| most.max(entry.abs()));
        assert!(scale > 0.0, "an equation without unknowns");
        row.iter_mut().for_each(|entry| *entry /= scale);
        *value /= scale;
    }
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        assert!(a[k][k] != 0.0, "singular");
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            if factor != 0.0 {
                let (above, below) = a.split_at_mut(i);
                for (entry, from) in below[0][k..].iter_mut().zip(&above[k][k..]) {
                    *entry -= factor * from;
                }
                b[i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - sum) / a[k][k];
    }
    b
}

/// The unknowns of a file at rising times, of which the first is above 0, by steps of at most `most`.
fn integrate(system: &System, times: &[f64], most: f64) -> Vec<Vec<f64>> {
    let count = system.unknowns.len();
    let sites_of = |instance: &Instance| {
        let mut sites = 0;
        let mut none = Along;
        let x = |_| Dual::from(1.0);
        sites += system.add(instance, &x, Dual::from(1.0), 0, &mut none, &mut |_, _| {});
        sites
    };
    let sites: usize = system.instances.iter().map(sites_of).sum();
    // The charges and fluxes at the start: those at which initial conditions hold. Every model here starts at rest.
    for instance in &system.instances {
        assert!(system.initial(instance).iter().all(|(_, value)| *value == 0.0));
    }
    let (mut last, mut before) = (vec![0.0; sites], vec![0.0; sites]);
    let mut x = vec![0.0; count];
    let (mut time, mut step) = (0.0f64, 0.0f64);
    let mut rows = vec![];
    // Edges of sources begin and end steps.
    let mut ends: Vec<(f64, bool)> = times.iter().map(|time| (*time, true)).collect();
    for instance in system.instances.iter().filter(|instance| instance.template.contains("_pwl")) {
        let corners = instance
            .numbers
            .iter()
            .step_by(2)
            .filter(|t| **t > 0.0 && **t < times[times.len() - 1]);
        ends.extend(corners.map(|time| (*time, false)));
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (end, row) in ends {
        while end - time > 1e-12 * end {
            // A step at most twice the last; a short rest is shared between two.
            let mut next = if step == 0.0 { most * 1e-6 } else { (2.0 * step).min(most) };
            let rest = end - time;
            if next >= rest {
                next = rest;
            } else if 2.0 * next > rest {
                next = rest / 2.0;
            }
            let factors = if step == 0.0 {
                [1.0 / next, -1.0 / next, 0.0]
            } else {
                let w = next / step;
                let now = (1.0 + 2.0 * w) / (1.0 + w);
                [now / next, -(1.0 + w) / next, w * w / (1.0 + w) / next]
            };
            let at = if next == rest { end } else { time + next };
            let mut now = vec![0.0; sites];
            // Whether that is enough the comparison says.
            for _ in 0..12 {
                let mut matrix = vec![vec![0.0; count]; count];
                let mut residual = vec![0.0; count];
                let mut site = 0;
                for instance in &system.instances {
                    let mut used = 0;
                    for (nth, moved) in system.touched(instance).into_iter().enumerate() {
                        let slope = |place| f64::from(place == moved);
                        let value = |place: usize| Dual { value: x[place], slope: slope(place) };
                        let past = [last.as_slice(), before.as_slice()];
                        let mut rate = Backward { factors, past, now: &mut now };
                        let mut add = |row: usize, value: Dual| {
                            matrix[row][moved] += value.slope;
                            if nth == 0 {
                                residual[row] -= value.value;
                            }
                        };
                        let at = Dual::from(at);
                        used = system.add(instance, &value, at, site, &mut rate, &mut add);
                    }
                    site += used;
                }
                let by = solve(matrix, residual);
                let small = by.iter().zip(&x).all(|(by, x)| by.abs() <= 1e-9 * x.abs() + 1e-12);
                x.iter_mut().zip(&by).for_each(|(x, by)| *x += by);
                if small {
                    break;
                }
            }
            before = std::mem::replace(&mut last, now);
            (time, step) = (at, next);
        }
        if row {
            rows.push(x.clone());
        }
    }
    rows
}

/// Models that start at rest, the longest step, and how far our own run may be away in parts of each range.
const RUNS: [(&str, f64, f64); 5] = [
    ("msd.bg", 1e-3, 1e-4),
    ("rlc.bg", 0.0, 1e-4),
    ("dc_motor_load.bg", 5e-5, 1e-3),
    ("gear_dep.bg", 1e-3, 1e-4),
    ("eha_one_line.bg", 2.5e-4, 1e-3),
];

/// What is read is integrated and compared with our own run of the netlist for ngspice, every saved voltage and current.
#[test]
fn models_run_as_read() {
    for (model, most, tolerance) in RUNS {
        let translated = translated(std::path::Path::new(model), &Overrides::default());
        let text = written(&translated.translation.netlist).unwrap();
        let system = crate::mast_reader::read(&text);
        let plain = translated.text();
        let circuit = circuit(&plain);
        let names: Vec<String> = circuit.outputs.iter().map(|output| output.name.clone()).collect();
        let observe = Some(names.join(", "));
        let overrides = Overrides { observe, ..Overrides::default() };
        let (ours, _) =
            run_text("deck.cir", &plain, &overrides).unwrap_or_else(|d| panic!("{model}: {d:?}"));
        let times = &ours.time()[1..];
        let most = if most == 0.0 { (times[1] - times[0]) / 4.0 } else { most };
        let rows = integrate(&system, times, most);
        let mut compared = 0;
        for (name, column) in ours.names.iter().zip(&ours.columns).skip(1) {
            let inner = name[2..name.len() - 1].to_lowercase();
            let current = format!(".{inner})");
            let place = system.unknowns.iter().position(|known| {
                let known = known.to_lowercase();
                known == inner || (name.starts_with("i(") && known.ends_with(&current))
            });
            let Some(place) = place else { continue };
            compared += 1;
            let range = column.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))
                - column.iter().fold(f64::INFINITY, |a, b| a.min(*b));
            let apart = |(row, value): (&Vec<f64>, &f64)| (row[place] - value).abs();
            let mut apart: Vec<f64> = rows.iter().zip(&column[1..]).map(apart).collect();
            // At the rows of an edge ours are after it, those of the file on it.
            apart.sort_by(f64::total_cmp);
            let worst = apart[apart.len() - 1 - EDGES] / range.max(f64::MIN_POSITIVE);
            println!("{model}: {name} {worst:.1e}");
            assert!(worst <= tolerance, "{model}: {name} {worst:.1e} of its range");
        }
        assert!(compared >= 2, "{model}: {compared} of {:?} in {:?}", ours.names, system.unknowns);
    }
}

/// Rows that may fall on an edge.
const EDGES: usize = 2;
