//! Seven sorts of change to flat texts.

use super::deck::{
    Change, Deck, Random, change, inside, is_device, is_zero, letter, node_places, replaced,
    value_place, words,
};

impl Deck {
    /// The lines of devices.
    pub fn devices(&self) -> Vec<usize> {
        (1..self.lines.len()).filter(|k| is_device(&self.lines[*k])).collect()
    }

    /// Whether anything reads the current of a device.
    fn read(&self, device: &str) -> bool {
        let current = format!("i({})", device.to_lowercase());
        let control = format!(" {} ", device.to_lowercase());
        self.map_text.contains(&current)
            || self.lines.iter().any(|line| {
                let line = format!("{} ", line.to_lowercase());
                line.contains(&current)
                    || (line.starts_with(['f', 'h', 'k'])
                        && line.find(&control).is_some_and(|at| at > 0))
            })
    }

    /// A node other than this one, and not tied to it by 0 V.
    fn other_node(&self, node: &str, random: &mut Random) -> Option<String> {
        let mut nodes: Vec<String> = vec!["0".into()];
        let mut tied: Vec<[String; 2]> = vec![];
        for k in self.devices() {
            let words = words(&self.lines[k]);
            for at in node_places(&words).0 {
                nodes.push(words[at].clone());
            }
            if letter(&words) == 'V' && is_zero(&words[3]) {
                tied.push([words[1].clone(), words[2].clone()]);
            }
        }
        nodes.sort();
        nodes.dedup();
        nodes.retain(|other| {
            other != node
                && !tied.iter().any(|pair| pair.contains(&node.to_string()) && pair.contains(other))
        });
        (!nodes.is_empty()).then(|| nodes[random.below(nodes.len())].clone())
    }

    fn sign(&self, random: &mut Random) -> Option<Change> {
        let all = self.devices();
        let k = all[random.below(all.len())];
        let words = words(&self.lines[k]);
        if let Some(law) = words.iter().position(|word| word.starts_with("VALUE=")) {
            let law_text = inside(words[law].strip_prefix("VALUE=")?);
            let by = replaced(&words, law, format!("VALUE={{-({law_text})}}"));
            return change(k, vec![by], None);
        }
        let starts = words.iter().position(|word| word.starts_with("IC="));
        let at = match starts {
            Some(at) if random.below(2) == 0 && letter(&words) != 'T' => {
                let start = words[at].strip_prefix("IC=")?;
                let same = is_zero(start).then_some("0 has no sign");
                // A parameter of value 0 is 0 as well, but it need not stay so.
                let zero =
                    inside(start).parse::<f64>().is_err() && self.parameter_is_zero(inside(start));
                let same = same.or(zero.then_some("an initial value of 0 has no sign"));
                let by = replaced(&words, at, format!("IC={{-({})}}", inside(start)));
                return change(k, vec![by], same);
            }
            _ => value_place(&words)?,
        };
        let same = is_zero(&words[at]).then_some("0 has no sign");
        change(k, vec![replaced(&words, at, format!("{{-({})}}", inside(&words[at])))], same)
    }

    fn parameter_is_zero(&self, name: &str) -> bool {
        let line = format!(".param {name}=").to_lowercase();
        self.lines.iter().any(|l| {
            l.to_lowercase()
                .strip_prefix(&line)
                .is_some_and(|value| value.trim().parse() == Ok(0.0))
        })
    }

    fn value(&self, random: &mut Random) -> Option<Change> {
        let all = self.devices();
        let k = all[random.below(all.len())];
        let words = words(&self.lines[k]);
        let factor = ["1.001", "2", "1e-3", "1000000"][random.below(4)];
        if let Some(at) = words.iter().position(|word| word.starts_with("IC="))
            && random.below(2) == 0
            && letter(&words) != 'T'
        {
            let start = inside(words[at].strip_prefix("IC=")?).to_string();
            return change(k, vec![replaced(&words, at, format!("IC={{{start}+1e-3}}"))], None);
        }
        if let Some(at) =
            words.iter().position(|word| word.starts_with("PWL(") || word.starts_with("PULSE("))
        {
            // The second number of a PULSE is a level, the last of a PWL too.
            let pulse = words[at].starts_with("PULSE(");
            let (head, rest) = words[at].split_once('(')?;
            let mut numbers = self::words(rest.strip_suffix(')')?);
            let which = if pulse { 1 } else { numbers.len() - 1 };
            numbers[which] = format!("{{{}+0.01}}", inside(&numbers[which]));
            return change(
                k,
                vec![replaced(&words, at, format!("{head}({})", numbers.join(" ")))],
                None,
            );
        }
        let at = value_place(&words)?;
        let by = match is_zero(&words[at]) {
            true => "1e-3".to_string(),
            false => format!("{{{factor}*({})}}", inside(&words[at])),
        };
        change(k, vec![replaced(&words, at, by)], None)
    }

    fn direction(&self, random: &mut Random) -> Option<Change> {
        let all = self.devices();
        let k = all[random.below(all.len())];
        let mut words = words(&self.lines[k]);
        let (carrying, control) = node_places(&words);
        if letter(&words) == 'T' || carrying.is_empty() {
            return None;
        }
        if control.len() == 2 && random.below(2) == 0 && letter(&words) != 'S' {
            words.swap(control[0], control[1]);
            return change(k, vec![words.join(" ")], None);
        }
        let read = self.read(&words[0]);
        let zero = words.len() > 3 && is_zero(&words[3]);
        let same = match letter(&words) {
            'R' if !read => Some("a resistor whose current nobody reads has no direction"),
            'V' if !read && zero => Some("a source of 0 V whose current nobody reads has none"),
            'I' if zero => Some(NOTHING),
            _ => None,
        };
        if letter(&words) == 'S' {
            return None;
        }
        words.swap(carrying[0], carrying[1]);
        change(k, vec![words.join(" ")], same)
    }

    fn node(&self, random: &mut Random) -> Option<Change> {
        let all = self.devices();
        let k = all[random.below(all.len())];
        let words = words(&self.lines[k]);
        let (mut places, control) = node_places(&words);
        places.extend(control);
        let at = *places.get(random.below(places.len()))?;
        let other = self.other_node(&words[at], random)?;
        let nothing = (letter(&words) == 'I' && is_zero(&words[3])).then_some(NOTHING);
        change(k, vec![replaced(&words, at, other)], nothing)
    }

    fn card(&self, random: &mut Random) -> Option<Change> {
        let cards: Vec<usize> = (1..self.lines.len())
            .filter(|k| {
                is_device(&self.lines[*k])
                    || (self.lines[*k].starts_with('.') && self.lines[*k] != ".end")
            })
            .collect();
        let k = cards[random.below(cards.len())];
        let line = &self.lines[k];
        if random.below(2) == 0 {
            return change(k, vec![], None);
        }
        if is_device(line) {
            let mut words = words(line);
            words[0] = format!("{}_twin", words[0]);
            let nothing = (letter(&words) == 'I' && is_zero(&words[3])).then_some(NOTHING);
            return change(k, vec![line.clone(), words.join(" ")], nothing);
        }
        let says =
            [".param", ".save", ".print", ".options"].iter().any(|card| line.starts_with(card));
        let same = says.then_some("a setting that is said twice is the same setting");
        change(k, vec![line.clone(), line.clone()], same)
    }

    fn law(&self, random: &mut Random) -> Option<Change> {
        let all: Vec<usize> =
            self.devices().into_iter().filter(|k| self.lines[*k].contains("VALUE=")).collect();
        if all.is_empty() {
            return None;
        }
        let k = all[random.below(all.len())];
        let line = &self.lines[k];
        let start = line.find("VALUE=")? + 7;
        let law = &line[start..line.len() - 1];
        let head = &line[..start];
        let whole = |law: String| change(k, vec![format!("{head}{law}}}")], None);
        match random.below(4) {
            0 => {
                // Another function or operation.
                let swaps = [
                    ("tanh(", "atan("),
                    ("sqrt(", "abs("),
                    ("min(", "max("),
                    ("max(", "min("),
                    ("sin(", "cos("),
                    ("cos(", "sin("),
                    (")*", ")+"),
                    ("exp(", "sqrt("),
                    (" < ", " > "),
                    ("-", "+"),
                ];
                let fitting: Vec<_> = swaps.iter().filter(|(from, _)| law.contains(from)).collect();
                let (from, to) = fitting.get(random.below(fitting.len()))?;
                // A sign in front of everything, or of an exponent, is of another sort.
                let at = law.find(from)?;
                if *from == "-"
                    && (at == 0
                        || !law.as_bytes()[at - 1].is_ascii_alphanumeric()
                            && law.as_bytes()[at - 1] != b')'
                        || law.as_bytes()[at - 1] == b'e')
                {
                    return None;
                }
                whole(law.replacen(from, to, 1))
            }
            1 => whole(format!("({law})*1.001")),
            2 => whole(format!("({law})+1e-3")),
            _ => {
                // Another argument: v(x) becomes v(y).
                let at = law.find("v(")?;
                let end = at + law[at..].find(')')?;
                let node = law[at + 2..end].split(',').next()?;
                let other = self.other_node(node, random)?;
                if other == "0" {
                    return None;
                }
                whole(format!("{}v({other}){}", &law[..at], &law[end + 1..]))
            }
        }
    }

    fn factor(&self, random: &mut Random) -> Option<Change> {
        let cards: Vec<usize> = (1..self.lines.len())
            .filter(|k| {
                let line = &self.lines[*k];
                line.starts_with(".param")
                    || line.starts_with("*bondspice column")
                    || line.starts_with(".tran")
            })
            .collect();
        let k = cards[random.below(cards.len())];
        let line = &self.lines[k];
        if let Some(rest) = line.strip_prefix(".param ") {
            let (name, value) = rest.split_once('=')?;
            let value = inside(value.trim());
            let by = match (random.below(3), is_zero(value)) {
                (_, true) => "1e-3".to_string(),
                (0, _) => format!("{{1.0001*({value})}}"),
                (1, _) => format!("{{({value})/1000}}"),
                _ if value.parse::<f64>().is_ok() => {
                    format!("{value}{}", ["m", "k", "u", "meg"][random.below(4)])
                }
                _ => format!("{{1000*({value})}}"),
            };
            // `1e-3m` and the like are read as numbers with a suffix.
            return change(k, vec![format!(".param {name}={by}")], None);
        }
        if let Some(rest) = line.strip_prefix(".tran ") {
            let mut numbers = words(rest);
            let at = random.below(2);
            numbers[at] = format!("{}k", numbers[at]);
            return change(k, vec![format!(".tran {}", numbers.join(" "))], None);
        }
        let (head, tail) = line.rsplit_once('"')?;
        change(k, vec![format!("{head}*1.001\"{tail}")], None)
    }
}

const NOTHING: &str = "a source of 0 A is nothing, wherever it stands";

/// Makes a change of its sort somewhere.
pub type Sort = fn(&Deck, &mut Random) -> Option<Change>;

/// Each sort of change.
pub const SORTS: &[(&str, Sort)] = &[
    ("sign", Deck::sign),
    ("value", Deck::value),
    ("direction", Deck::direction),
    ("node", Deck::node),
    ("lost or doubled card", Deck::card),
    ("law or argument", Deck::law),
    ("parameter or unit factor", Deck::factor),
];
