//! Random bond graphs as texts, each from a seed: trees and loops of junctions, chains of two-ports, fields, models within
//! models, laws of every shape, signals with memory. Most can be solved; some are singular or in conflict, as they come.

use std::fmt::Write;

/// A generator of numbers (splitmix64, Steele, Lea and Flood 2014), and the graph so far.
pub struct Generator {
    state: u64,
    text: String,
    junctions: Vec<Junction>,
    /// Names of parameters and of signals so far.
    parameters: Vec<String>,
    signals: Vec<String>,
    /// What can be observed.
    readings: Vec<String>,
    count: usize,
    /// Whether laws and signals may be non-linear.
    linear: bool,
}

struct Junction {
    name: String,
    zero: bool,
    bonds: usize,
    /// Whether a source sets the common variable.
    set: bool,
    /// Whether a storage or a dissipator hangs here.
    loaded: bool,
}

const MODELS: &str = "\
model Branch(a = 1) {
  port in p
  p -> 1:j
  j -> R:r(a), I:l(a/4), C:c(e = 2*q + q^3)
}
model Line(r = 2, c = 0.1) {
  port in a
  port out b
  a -> 1:first -> 0:middle -> 1:last -> b
  first -> R:r1(r), I:l(0.05)
  middle -> C:c(c), R:leak(f = e/(10*r))
  last -> R:r2(2*r)
}
model Nested(k = 3) {
  port in p
  input u
  signal s = clamp(u, -2, 2)
  p -> 0:node -> Line:line(r = k, c = 1/k) -> TF:t(1/(2 + s^2)) -> 1:end
  node -> Branch:side(a = k/2)
  end -> R:load(k)
}
";

impl Generator {
    /// The text of a seed; linear ones have no law that is not.
    pub fn text(seed: u64, linear: bool) -> String {
        let mut g = Generator {
            state: seed.wrapping_mul(0x2545_f491_4f6c_dd1d),
            text: String::new(),
            junctions: vec![],
            parameters: vec![],
            signals: vec![],
            readings: vec![],
            count: 0,
            linear,
        };
        g.graph();
        g.text
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn name(&mut self, letter: &str) -> String {
        self.count += 1;
        format!("{letter}{}", self.count)
    }

    /// 0.3 to 10, two digits.
    fn number(&mut self) -> String {
        let digits = 30 + self.below(970);
        format!("{}", digits as f64 / 100.0)
    }

    /// A positive value: a number, a parameter, something with one.
    fn value(&mut self) -> String {
        let number = self.number();
        if self.parameters.is_empty() || self.chance(40) {
            return number;
        }
        let at = self.below(self.parameters.len());
        let parameter = self.parameters[at].clone();
        match self.below(4) {
            0 => format!("{number}*{parameter}"),
            1 => format!("{parameter}/{number}"),
            _ => parameter,
        }
    }

    fn graph(&mut self) {
        let with_models = self.chance(20) && !self.linear;
        if with_models {
            self.text.push_str(MODELS);
        }
        for _ in 0..self.below(5) {
            let (name, value) = (self.name("k"), self.value());
            let value = match self.below(3) {
                0 => format!("sqrt(1 + {value}^2)"),
                _ => value,
            };
            let _ = writeln!(self.text, "param {name} = {value}");
            self.parameters.push(name);
        }
        self.waveforms();
        self.junction();
        let size = 3 + self.below(14);
        for _ in 0..size {
            match self.below(if with_models { 100 } else { 93 }) {
                0..15 => self.grow(false),
                15..28 => self.grow(true),
                28..34 => self.bridge(),
                34..42 => self.source(),
                42..48 => self.field(),
                48..56 => self.signal(),
                56..58 => self.detector(),
                58..93 => self.element(),
                _ => self.instance(),
            }
        }
        for at in 0..self.junctions.len() {
            if self.junctions[at].bonds < 2 || !self.junctions[at].loaded {
                let (name, value) = (self.name("R"), self.value());
                self.hang(at, &format!("R:{name}({value})"), &name);
            }
        }
        if !self.text.contains("Se:") && !self.text.contains("Sf:") {
            self.source();
        }
        for _ in 0..self.below(3) {
            self.signal();
        }
        self.text.push_str("simulate until 1 step 0.01\n");
        let mut observed: Vec<String> = vec![];
        for _ in 0..1 + self.below(5) {
            let at = self.below(self.readings.len());
            let reading = self.readings[at].clone();
            if !observed.contains(&reading) {
                observed.push(reading);
            }
        }
        let _ = writeln!(self.text, "observe {}", observed.join(", "));
    }

    fn waveforms(&mut self) {
        for _ in 0..1 + self.below(2) {
            let name = self.name("u");
            let (a, b) = (self.number(), self.number());
            let law = match self.below(6) {
                0 => format!("step(0.1, 0, {a})"),
                1 => format!("sine(0, {a}, {b})"),
                2 => format!("pwl(0, 0; 0.2, {a}; 0.5, {b}; 0.9, 0)"),
                3 => format!("pulse(0, {a}, 0.1, 0.02, 0.03, 0.2, 0.5)"),
                4 => format!("{a}*sin({b}*time)"),
                _ => format!("ramp(0.1, {a})"),
            };
            let _ = writeln!(self.text, "signal {name} = {law}");
            self.readings.push(name.clone());
            self.signals.push(name);
        }
    }

    fn any_signal(&mut self) -> String {
        let at = self.below(self.signals.len());
        self.signals[at].clone()
    }

    /// A reading of a junction.
    fn reading(&mut self) -> String {
        let at = self.below(self.junctions.len());
        let Junction { name, zero, .. } = &self.junctions[at];
        if *zero { format!("e({name})") } else { format!("f({name})") }
    }

    fn junction(&mut self) -> usize {
        let zero = self.chance(50);
        self.new_junction(zero)
    }

    fn new_junction(&mut self, zero: bool) -> usize {
        let name = self.name(if zero { "n" } else { "s" });
        let _ = writeln!(self.text, "{}:{name}", u8::from(!zero));
        self.readings.push(if zero { format!("e({name})") } else { format!("f({name})") });
        self.junctions.push(Junction { name, zero, bonds: 0, set: false, loaded: false });
        self.junctions.len() - 1
    }

    fn join(&mut self, a: usize, b: usize, through: Option<&str>) {
        let through = through.map_or(String::new(), |t| format!("{t} -> "));
        let (from, to) = if self.chance(50) { (a, b) } else { (b, a) };
        let _ = writeln!(
            self.text,
            "{} -> {through}{}",
            self.junctions[from].name, self.junctions[to].name
        );
        self.junctions[a].bonds += 1;
        self.junctions[b].bonds += 1;
    }

    /// Hangs an element on a junction.
    fn hang(&mut self, at: usize, element: &str, name: &str) {
        let junction = &mut self.junctions[at];
        junction.bonds += 1;
        junction.loaded = true;
        let junction = junction.name.clone();
        let _ = match self.chance(75) {
            true => writeln!(self.text, "{junction} -> {element}"),
            false => writeln!(self.text, "{element} -> {junction}"),
        };
        let letter = if self.chance(50) { 'e' } else { 'f' };
        self.readings.push(format!("{letter}({name})"));
    }

    /// A new junction at the end of a bond, or of a two-port.
    fn grow(&mut self, through: bool) {
        let at = self.below(self.junctions.len());
        let zero = if self.chance(80) { !self.junctions[at].zero } else { self.chance(50) };
        let new = self.new_junction(zero);
        if !through {
            return self.join(at, new, None);
        }
        let modulated = self.chance(30) && !self.linear;
        let value = if modulated {
            let signal = self.any_signal();
            match self.below(3) {
                0 => format!("2 + sin({signal})"),
                1 => format!("1/{signal}"),
                _ => format!("1 + {signal}^2"),
            }
        } else {
            self.value()
        };
        let kind = if self.chance(50) { "TF" } else { "GY" };
        let gain = if self.chance(30) { "gain = " } else { "" };
        let name = self.name(kind);
        let m = if modulated { "M" } else { "" };
        self.join(at, new, Some(&format!("{m}{kind}:{name}({gain}{value})")));
    }

    /// A bond between two junctions that are there.
    fn bridge(&mut self) {
        let (a, b) = (self.below(self.junctions.len()), self.below(self.junctions.len()));
        if a != b {
            let middle = self.new_junction(!self.junctions[a].zero);
            self.join(a, middle, None);
            self.join(b, middle, None);
            if self.chance(70) {
                let (name, value) = (self.name("R"), self.value());
                self.hang(middle, &format!("R:{name}({value})"), &name);
            }
        }
    }

    fn source(&mut self) {
        let at = self.below(self.junctions.len());
        // Mostly where it does not set the common variable of a junction twice.
        let common = self.chance(25) && !self.junctions[at].set;
        let effort = self.junctions[at].zero == common;
        self.junctions[at].set |= common;
        let signal = self.any_signal();
        let value = match self.below(5) {
            0 => self.value(),
            1 if !self.linear => format!("{signal}*abs({signal})"),
            2 => format!("2*{signal} + {}", self.reading()),
            _ => signal,
        };
        let kind = if effort { "Se" } else { "Sf" };
        let name = self.name(kind);
        self.hang(at, &format!("{kind}:{name}({value})"), &name);
        self.junctions[at].loaded = false;
    }

    fn detector(&mut self) {
        let at = self.below(self.junctions.len());
        let kind = if self.junctions[at].zero { "De" } else { "Df" };
        let name = self.name(kind);
        self.hang(at, &format!("{kind}:{name}"), &name);
        self.junctions[at].loaded = false;
    }

    fn element(&mut self) {
        let at = self.below(self.junctions.len());
        let (a, b) = (self.value(), self.value());
        let signal = self.any_signal();
        let (kind, law) = match self.below(if self.linear { 12 } else { 29 }) {
            0..4 => ("R", a),
            4..8 => ("C", if self.chance(30) { format!("{a}, e0 = {b}") } else { a }),
            8..12 => ("I", if self.chance(30) { format!("{a}, f0 = {b}") } else { a }),
            12 => ("R", format!("e = {a}*f + {b}*f^3")),
            13 => ("R", format!("f = {a}*e + {b}*tanh(e)")),
            14 => ("R", format!("e = {a}*f*sqrt(f^2 + 0.1)")),
            15 => ("R", "e = table(f, [-10, -20; -1, -4; 1, 5; 10, 20])".to_string()),
            16 => ("R", format!("f = if e > 0 then e/{a} else e/({a} + {b})")),
            17 => ("R", format!("e = ({a} + {signal}^2)*f")),
            18 => ("C", format!("e = q/{a} + {b}*q^3")),
            19 => ("C", format!("q = {a}*e + {b}*tanh(e)")),
            20 => ("I", format!("f = p/{a} + {b}*p^3")),
            21 => ("I", format!("p = {a}*f + {b}*f^3")),
            22 => ("C", format!("der(e) = {a}*f/(1 + e^2), e0 = 0.5")),
            23 => ("I", format!("der(f) = {a}*e*(1 + 0.1*{signal})")),
            24 => ("R", format!("e = {a}*f + {b}*sign(f)*abs(f)^1.5")),
            25 => ("C", format!("e = min(q/{a}, 2*q) + {b}*q")),
            26 => ("R", format!("e = {a}*f^3 + f*{}^2", self.reading())),
            27 => ("C", format!("{a} + 0.1*{signal}^2")),
            _ => ("R", format!("f = clamp({a}*e, -{b}, {b}) + 0.1*e")),
        };
        let name = self.name(kind);
        self.hang(at, &format!("{kind}:{name}({law})"), &name);
        if kind != "R" && self.chance(50) {
            self.readings.push(format!("{}({name})", if kind == "C" { 'q' } else { 'p' }));
        }
    }

    fn field(&mut self) {
        let (first, second) = (self.below(self.junctions.len()), self.below(self.junctions.len()));
        let (a, b) = (self.number(), self.value());
        let (kind, laws) = match self.below(if self.linear { 4 } else { 8 }) {
            0 => ("I", format!("[{a}, 0.2; 0.2, 3]")),
            1 => ("I", format!("[4, 0.1*{b}; 0.1*{b}, 5 + {b}^2]")),
            2 => ("C", format!("[{a}, 0.1; 0.1, 2]")),
            3 => ("R", format!("[{b}, 0.5; -0.5, {a}]")),
            4 => ("C", format!("e1 = {b}*q1 + q2 + q1*q2^2, e2 = q1 + (2 + {b})*q2 + q1^2*q2")),
            5 => ("IC", format!("f1 = p1*(1 + q2^2)/{b}, e2 = p1^2*q2/{b} + {a}*q2")),
            6 => ("R", format!("e1 = {a}*f1 + f1*f2^2, e2 = {b}*f2 + f2^3")),
            _ => ("I", format!("f1 = p1/{b} + 0.1*p2, f2 = 0.1*p1 + p2/{a} + p2^3")),
        };
        let name = self.name(kind);
        let _ = writeln!(self.text, "{kind}:{name}({laws})");
        for (port, at) in [(1, first), (2, second)] {
            self.junctions[at].bonds += 1;
            let junction = self.junctions[at].name.clone();
            let _ = match self.chance(75) {
                true => writeln!(self.text, "{junction} -> {name}.{port}"),
                false => writeln!(self.text, "{name}.{port} -> {junction}"),
            };
        }
        self.readings.push(format!("f({name}.1)"));
    }

    fn signal(&mut self) {
        let name = self.name("y");
        let (reading, a, b) = (self.reading(), self.value(), self.number());
        let u = self.any_signal();
        let law = match self.below(if self.linear { 5 } else { 14 }) {
            0 => format!("integ({reading})"),
            1 => format!("lag({u} - {reading}, 0.1, 0)"),
            2 => format!("{u} + 2*{reading}"),
            3 => format!("integ({u}, {b})"),
            4 => format!("{a}*({u} - {reading})"),
            5 => format!("clamp({a}*({u} - {reading}), -2, 2)"),
            6 => format!("pi({u} - {reading}, Kp = {a}, Ki = {b}, lo = -3, hi = 3, Kaw = 2)"),
            7 => format!("delay({u}, 0.05)"),
            8 => format!("hysteresis({reading}, -0.5, 0.5)"),
            9 => format!("sample({u}*{a}, 0.1)"),
            10 => format!("exp(-{u}^2)*{a}"),
            11 => format!("if {reading} > {a} then 1 else {u}"),
            12 => format!("atan2({u}, {a}) + max({u}, {reading})"),
            _ => format!("delay({reading}*{u}, 0.02)"),
        };
        let _ = writeln!(self.text, "signal {name} = {law}");
        self.readings.push(name.clone());
        self.signals.push(name);
    }

    fn instance(&mut self) {
        let at = self.below(self.junctions.len());
        let value = self.value();
        let name = self.name("m");
        let junction = self.junctions[at].name.clone();
        self.junctions[at].bonds += 1;
        self.junctions[at].loaded = true;
        let _ = match self.below(3) {
            0 => writeln!(self.text, "Branch:{name}(a = {value})\n{junction} -> {name}.p"),
            1 => {
                let signal = self.any_signal();
                writeln!(
                    self.text,
                    "Nested:{name}(k = {value}, u = {signal})\n{junction} -> {name}.p"
                )
            }
            _ => {
                let new = self.junction();
                let other = self.junctions[new].name.clone();
                self.junctions[new].bonds += 1;
                writeln!(self.text, "{junction} -> Line:{name}(r = {value}) -> {other}")
            }
        };
    }
}
