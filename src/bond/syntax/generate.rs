//! Random files of the whole language, for tests: a walk over its grammar with a seed.

/// A generator of numbers (splitmix64, Steele, Lea and Flood 2014), and the text so far.
pub struct Generator {
    state: u64,
    /// Brackets that are open: within them a line may end anywhere.
    open: usize,
    /// Whether the block stands on one line.
    one_line: bool,
}

const NAMES: &[&str] = &[
    "x", "rod", "armature", "Φ", "R_eta", "_k1", "größe", "e", "q", "loop", "in", "step", "until",
    "model", "port", "observe2", "follows", "as", "sum", "param_1", "Ω_ref",
];
const UNITS: &[&str] =
    &["V", "mH", "N*m", "m^3/(s*Pa)", "Pa^0.5*s/m^3", "%", "s^-1", "rpm", "kΩ", "Ohm", "m^(1/2)"];
const KINDS: &[&str] =
    &["0", "1", "Se", "R", "C", "IC", "MTF", "GY", "DcMotor", "De", "in", "Φ", "12"];
const DOMAINS: &[&str] = &["electrical", "rotation", "pseudo-thermal", "any"];
const CALLED: &[&str] = &["e", "f", "integ", "pi", "lag", "pwl", "step", "orifice", "Φ"];
const COMMENTS: &[&str] = &["# a comment", "#", "#  ; } \" ( μ", "#x  "];

impl Generator {
    /// A generator; the same seed gives the same files.
    pub fn new(seed: u64) -> Generator {
        Generator { state: seed, open: 0, one_line: false }
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

    fn pick(&mut self, words: &[&'static str]) -> &'static str {
        words[self.below(words.len())]
    }

    /// A file.
    pub fn file(&mut self) -> String {
        let mut text = String::new();
        let statements = self.below(8);
        for _ in 0..statements {
            text += &self.trivia();
            text += &self.statement(3);
            text += &self.end();
        }
        text += &self.trivia();
        text
    }

    /// What may stand between statements.
    fn trivia(&mut self) -> String {
        let mut text = String::new();
        while self.chance(30) {
            text += match self.below(6) {
                0 => "\n",
                1 => "\n\n",
                2 => "  ",
                3 => "\t",
                4 => ";",
                _ if self.one_line => " ",
                _ => return format!("{text}{}\n", self.pick(COMMENTS)),
            };
            if self.one_line {
                text = text.replace('\n', " ");
            }
        }
        text
    }

    /// What ends a statement.
    fn end(&mut self) -> String {
        match self.below(if self.one_line { 2 } else { 6 }) {
            0 => "; ".into(),
            1 => ";".into(),
            2 => format!("  {}\n", self.pick(COMMENTS)),
            3 => "\r\n".into(),
            _ => "\n".into(),
        }
    }

    /// Any number of blanks; within brackets also a line's end.
    fn blank(&mut self) -> String {
        let text = match self.below(12) {
            0 => "  ",
            1 => "\t",
            2 => "\u{a0}",
            3 if self.open > 0 && !self.one_line => "\n   ",
            4 if self.open > 0 && !self.one_line => {
                return format!(" {}\n", self.pick(COMMENTS));
            }
            5..8 => " ",
            _ => "",
        };
        text.to_string()
    }

    /// At least one blank.
    fn gap(&mut self) -> String {
        format!(" {}", self.blank())
    }

    fn statement(&mut self, depth: usize) -> String {
        let gap = self.gap();
        match self.below(if depth > 0 { 18 } else { 14 }) {
            0 => {
                let text = match self.chance(50) {
                    true => format!("{}\"a text; with # signs\"", self.blank()),
                    false => String::new(),
                };
                format!("param{gap}{}{text}", self.assignment())
            }
            1 => format!("signal{gap}{}", self.assignment()),
            2 => format!("{}{gap}{}", self.pick(&["input", "output"]), self.list(Self::part)),
            3 => format!("drive{gap}{}", self.assignment()),
            4 => format!("import{}\"std/motor.bg\"", self.blank()),
            5 => {
                let way = self.pick(&["in", "out"]);
                let domain = match self.chance(70) {
                    true => format!("{}:{}{}", self.blank(), self.blank(), self.pick(DOMAINS)),
                    false => String::new(),
                };
                format!("port{gap}{way} {}{domain}", self.part())
            }
            6 => {
                let until = format!("until{}{}", self.gap(), self.value(2));
                let step = format!("step{}{}", self.gap(), self.value(2));
                match self.below(3) {
                    0 => format!("simulate{gap}{until} {step}"),
                    1 => format!("simulate{gap}{step} {until}"),
                    _ => format!("simulate{gap}{until}"),
                }
            }
            7 => format!("options{gap}{}", self.list(Self::option)),
            8 => format!("observe{gap}{}", self.list(Self::observed)),
            9 => self.regulator(),
            14 => self.model(depth),
            15 | 16 => {
                let range = self.range();
                let name = self.pick(NAMES);
                format!("for{gap}{name} in {range}{}", self.block(depth - 1))
            }
            17 => self.condition(depth),
            _ => self.chain(),
        }
    }

    fn list(&mut self, item: fn(&mut Self) -> String) -> String {
        let mut text = item(self);
        while self.chance(30) {
            let line = if self.chance(20) && !self.one_line { "\n\n    " } else { "" };
            text = format!("{text}{},{line}{}{}", self.blank(), self.blank(), item(self));
        }
        text
    }

    fn assignment(&mut self) -> String {
        format!("{}{}={}{}", self.part(), self.blank(), self.blank(), self.value(3))
    }

    fn option(&mut self) -> String {
        let value = match self.below(3) {
            0 => self.pick(NAMES).to_string(),
            1 => self.quantity(),
            _ => self.number(),
        };
        format!("{}{}={}{value}", self.pick(NAMES), self.blank(), self.blank())
    }

    fn observed(&mut self) -> String {
        let mut text = self.value(2);
        if self.chance(40) {
            text += &format!(" in {}", self.pick(UNITS));
        }
        if self.chance(40) {
            text += &format!(" as{}\"a name\"", self.blank());
        }
        text
    }

    fn regulator(&mut self) -> String {
        let mut text = format!(
            "loop {}{}:{}{} follows{}{}",
            self.path(),
            self.blank(),
            self.blank(),
            self.value(2),
            self.gap(),
            self.value(2)
        );
        if self.chance(60) {
            text += &format!(",{}bandwidth {}", self.blank(), self.value(1));
        }
        if self.chance(60) {
            text += &format!("{}, margin {}", self.blank(), self.value(1));
        }
        text
    }

    fn model(&mut self, depth: usize) -> String {
        let header = match self.below(4) {
            0 => String::new(),
            1 => "()".into(),
            _ => self.bracketed("(", ")", |g| {
                g.list(|g| match g.below(4) {
                    0 | 1 => g.pick(NAMES).to_string(),
                    2 => format!("{} \"in; ohms\"", g.pick(NAMES)),
                    _ => format!("{} = {}", g.pick(NAMES), g.value(2)),
                })
            }),
        };
        format!("model {}{}{header}{}", self.pick(NAMES), self.blank(), self.block(depth - 1))
    }

    fn condition(&mut self, depth: usize) -> String {
        let mut text = format!("if {}{}", self.value(2), self.block(depth - 1));
        while self.chance(25) {
            text += &format!("{} else if {}{}", self.turn(), self.value(2), self.block(depth - 1));
        }
        if self.chance(50) {
            text += &format!("{} else{}", self.turn(), self.block(depth - 1));
        }
        text
    }

    /// What may stand before `else` and `{`.
    fn turn(&mut self) -> String {
        match self.below(if self.one_line { 2 } else { 5 }) {
            0 => "",
            1 => " ",
            2 => "\n",
            3 => " # why\n",
            _ => "\n\n  # why\n",
        }
        .to_string()
    }

    fn block(&mut self, depth: usize) -> String {
        let turn = self.turn();
        let outer = self.one_line;
        self.one_line |= self.chance(25);
        let mut text = format!("{turn} {{");
        text += &self.trivia();
        for _ in 0..self.below(4) {
            text += &self.statement(depth);
            text += &self.end();
            text += &self.trivia();
        }
        if self.chance(10) {
            text += &self.statement(0);
        }
        self.one_line = outer;
        text + "}"
    }

    fn chain(&mut self) -> String {
        let mut text = self.chain_end();
        if self.chance(15) {
            return format!("{text}, {}", self.list(Self::chain_end));
        }
        while self.chance(60) {
            let arrow = self.pick(&["->", "->", "->|", "|->"]);
            let line = if self.chance(15) && !self.one_line { "\n  " } else { "" };
            text += &format!("{}{arrow}{line}{}{}", self.blank(), self.blank(), self.chain_end());
        }
        if text.contains("->") && self.chance(30) {
            text += &format!(", {}", self.list(Self::chain_end));
        }
        text
    }

    fn chain_end(&mut self) -> String {
        let mut text = match self.chance(60) {
            true => format!("{}{}:{}", self.pick(KINDS), self.blank(), self.blank()),
            false => String::new(),
        };
        text += &self.path();
        if self.chance(50) {
            let arguments = self.bracketed("(", ")", |g| match g.chance(10) {
                true => String::new(),
                false => g.list(Self::argument),
            });
            text += &format!("{}{arguments}", if self.chance(10) { " " } else { "" });
        }
        text
    }

    fn bracketed(
        &mut self,
        open: &str,
        close: &str,
        inner: impl FnOnce(&mut Self) -> String,
    ) -> String {
        self.open += 1;
        let text = format!("{open}{}{}{}{close}", self.blank(), inner(self), self.blank());
        self.open -= 1;
        text
    }

    fn path(&mut self) -> String {
        let mut text = self.part();
        while self.chance(20) {
            text += ".";
            text += &if self.chance(40) { self.below(12).to_string() } else { self.part() };
        }
        text
    }

    fn part(&mut self) -> String {
        let name = self.pick(NAMES);
        if !self.chance(20) {
            return name.to_string();
        }
        let indices = self.bracketed("[", "]", |g| match g.chance(30) {
            true => format!("{}, {}", g.value(1), g.value(1)),
            false => g.value(1),
        });
        format!("{name}{indices}")
    }

    fn argument(&mut self) -> String {
        let label = match self.below(4) {
            0 => format!("{}{}={}", self.pick(NAMES), self.blank(), self.blank()),
            1 if self.chance(30) => format!("der({}) = ", self.pick(NAMES)),
            _ => String::new(),
        };
        let value = match self.below(8) {
            0 => self.matrix(),
            1 => "\"data.csv\"".to_string(),
            _ => self.value(2),
        };
        label + &value
    }

    fn matrix(&mut self) -> String {
        self.bracketed("[", "]", |g| {
            if g.chance(5) {
                return String::new();
            }
            let mut text = g.value(1);
            while g.chance(60) {
                text += &format!("{}{}{}", g.pick(&[",", ";", ", ", " ; "]), g.blank(), g.value(1));
            }
            text
        })
    }

    fn range(&mut self) -> String {
        let dots = self.pick(&["..", " ..", ".. ", " .. "]);
        let from = match self.chance(60) {
            true => "1".to_string(),
            false => self.value(1),
        };
        format!("{from}{dots}{}", self.value(1))
    }

    fn number(&mut self) -> String {
        match self.below(6) {
            0 => self.below(1000).to_string(),
            1 => format!("{}.{}", self.below(10), self.below(1000)),
            2 => format!(".{}", self.below(100)),
            3 => format!("{}e-{}", self.below(10), self.below(20)),
            4 => format!("1.5E+{}", self.below(9)),
            _ => self.below(10).to_string(),
        }
    }

    fn quantity(&mut self) -> String {
        format!("{}{}{}", self.number(), self.pick(&["", " "]), self.pick(UNITS))
    }

    /// An expression.
    fn value(&mut self, depth: usize) -> String {
        if depth == 0 {
            return self.atom(0);
        }
        match self.below(12) {
            0 => {
                format!("{} {} {}", self.truth(depth), self.pick(&["and", "or"]), self.truth(depth))
            }
            1 => self.truth(depth),
            2 => format!(
                "if {} then {} else {}",
                self.value(depth - 1),
                self.value(depth - 1),
                self.value(depth - 1)
            ),
            _ => self.total(depth),
        }
    }

    fn truth(&mut self, depth: usize) -> String {
        let not = if self.chance(30) { "not " } else { "" };
        let sign = self.pick(&["<", "<=", ">", ">=", "==", "!=", "<>"]);
        let (a, b) = (self.total(depth - 1), self.total(depth - 1));
        format!("{not}{a}{}{sign}{}{b}", self.blank(), self.blank())
    }

    fn total(&mut self, depth: usize) -> String {
        let mut text = self.atom(depth);
        while depth > 0 && self.chance(35) {
            let sign = self.pick(&["+", "-", "*", "/", "^"]);
            // A power of a unit is the unit's.
            let next = match sign {
                "^" => format!("(x + {})", self.atom(depth - 1)),
                _ => self.atom(depth - 1),
            };
            text = format!("{text}{}{sign}{}{next}", self.blank(), self.blank());
        }
        text
    }

    fn atom(&mut self, depth: usize) -> String {
        let choices = if depth == 0 { 4 } else { 11 };
        match self.below(choices) {
            0 => self.number(),
            1 => self.quantity(),
            2 | 3 => self.reference(depth),
            4 => {
                let sign = self.pick(&["-", "+", "- "]);
                format!("{sign}{}", self.atom(depth - 1))
            }
            5 => self.bracketed("(", ")", |g| g.value(depth - 1)),
            6 => {
                let arguments = self.bracketed("(", ")", |g| g.value(depth - 1));
                format!("{}{arguments}", self.pick(&["sqrt", "abs", "tanh"]))
            }
            7 => {
                let arguments = self.bracketed("(", ")", |g| {
                    format!("{}, {}, {}", g.value(0), g.value(0), g.value(0))
                });
                format!("{}{arguments}", self.pick(&["min", "max", "clamp"]))
            }
            8 => {
                let inner = self.bracketed("(", ")", |g| {
                    let range = g.range();
                    format!("{} in {range}, {}", g.pick(NAMES), g.value(depth - 1))
                });
                format!("sum{inner}")
            }
            9 => {
                let bond = self.bracketed("(", ")", |g| {
                    format!("{}{}->{}{}", g.path(), g.blank(), g.blank(), g.path())
                });
                let index = match self.chance(40) {
                    true => self.bracketed("[", "]", |g| g.value(0)),
                    false => String::new(),
                };
                format!("{}{bond}{index}", self.pick(&["e", "f", "power"]))
            }
            _ => {
                let arguments = self.bracketed("(", ")", |g| {
                    let mut text = match g.chance(10) {
                        true => return String::new(),
                        false => g.list(Self::argument),
                    };
                    while g.chance(20) {
                        text += &format!(";{}{}", g.blank(), g.list(Self::argument));
                    }
                    text
                });
                format!("{}{arguments}", self.pick(CALLED))
            }
        }
    }

    /// A name within an expression: none of its words, and nothing that a unit may follow.
    fn reference(&mut self, depth: usize) -> String {
        if depth == 0 {
            return self.pick(NAMES).to_string();
        }
        self.path()
    }
}
