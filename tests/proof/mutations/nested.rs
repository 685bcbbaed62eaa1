//! Eight sorts of change that only a text with subcircuits has room for: at the cards of instances, at the heads of
//! subcircuits, within their bodies.

use super::deck::{
    Change, Deck, Random, change, inside, is_device, is_zero, letter, node_places, replaced,
    value_place, words,
};
use super::flat::Sort;

/// A subcircuit: its head and its body.
struct Block {
    head: Vec<String>,
    at: usize,
    body: std::ops::Range<usize>,
}

/// The card of an instance: its line, and that of the block around it.
struct Instance {
    at: usize,
    words: Vec<String>,
    around: std::ops::Range<usize>,
}

/// Where the parameters of a head or of an instance's card begin.
fn parameters(words: &[String]) -> usize {
    words.iter().position(|word| word == "PARAMS:").map_or(words.len(), |at| at + 1)
}

/// The terminals' places: of a head behind its name, of an instance before that of its subcircuit.
fn terminals(words: &[String]) -> std::ops::Range<usize> {
    let end = words.iter().position(|word| word == "PARAMS:").unwrap_or(words.len());
    if words[0] == ".subckt" { 2..end } else { 1..end - 1 }
}

fn one(places: std::ops::Range<usize>, random: &mut Random) -> usize {
    places.start + random.below(places.len())
}

const IDLE: &str = "no card stands at these terminals";
const ONE_NODE: &str = "both lead to one node in every instance";
const DEFAULT: &str = "it is the default";
const ALL_GIVE: &str = "every instance gives this parameter";
const ODD: &str = "its one law is odd, so that it has no direction, and nobody reads its current";
const COPY: &str = "one is a copy of the other";

/// Those whose only device has an odd law: f(-x) = -f(x).
const ODD_LAWS: [&str; 3] = ["StribeckFriction", "ReliefValve", "Orifice"];

impl Deck {
    fn blocks(&self) -> Vec<Block> {
        let heads = (0..self.lines.len()).filter(|at| self.lines[*at].starts_with(".subckt "));
        let block = |at: usize| {
            let end = (at..).find(|at| self.lines[*at].starts_with(".ends")).unwrap();
            Block { head: words(&self.lines[at]), at, body: at + 1..end }
        };
        heads.map(block).collect()
    }

    fn instances(&self) -> Vec<Instance> {
        let blocks = self.blocks();
        let cards = (1..self.lines.len()).filter(|at| self.lines[*at].starts_with("X_"));
        let instance = |at: usize| {
            let around = blocks.iter().find(|block| block.body.contains(&at));
            let around = around.map_or(1..self.lines.len(), |block| block.body.clone());
            Instance { at, words: words(&self.lines[at]), around }
        };
        cards.map(instance).collect()
    }

    fn instance(&self, random: &mut Random) -> (Instance, Block) {
        let mut all = self.instances();
        let instance = all.swap_remove(random.below(all.len()));
        let name = &instance.words[terminals(&instance.words).end];
        let block = self.blocks().into_iter().find(|block| block.head[1] == *name).unwrap();
        (instance, block)
    }

    /// The words of a block's cards, whatever they are names of; those of laws and brackets apart.
    fn names(&self, lines: std::ops::Range<usize>) -> Vec<String> {
        let text = lines.map(|at| self.lines[at].as_str()).filter(|line| !line.starts_with('*'));
        let text = text.collect::<Vec<_>>().join(" ");
        text.split(|c: char| !c.is_alphanumeric() && c != '_').map(str::to_string).collect()
    }

    /// Whether no card of a subcircuit speaks of a terminal.
    fn is_idle(&self, block: &Block, terminal: usize) -> bool {
        !self.names(block.body.clone()).contains(&block.head[2 + terminal])
    }

    /// The nodes of a block: those that its devices stand at.
    fn nodes(&self, lines: std::ops::Range<usize>) -> Vec<String> {
        let inner: Vec<Block> =
            self.blocks().into_iter().filter(|block| lines.contains(&block.at)).collect();
        let own = lines.filter(|at| !inner.iter().any(|block| block.body.contains(at)));
        let mut nodes = vec![];
        for at in own.filter(|at| is_device(&self.lines[*at])) {
            let words = words(&self.lines[at]);
            match letter(&words) {
                'X' => nodes.extend_from_slice(&words[terminals(&words)]),
                _ => nodes.extend(node_places(&words).0.into_iter().map(|at| words[at].clone())),
            }
        }
        nodes.sort();
        nodes.dedup();
        nodes
    }

    /// Whether a subcircuit is a device with an odd law, and these two of its terminals are where that stands.
    fn is_odd(&self, block: &Block, mut terminals: [usize; 2]) -> bool {
        terminals.sort();
        let mut devices = block.body.clone().filter(|at| is_device(&self.lines[*at]));
        let (only, more) = (devices.next(), devices.next());
        let nodes = only.map(|at| words(&self.lines[at])[1..3].to_vec());
        let own = terminals.map(|terminal| block.head[2 + terminal].clone()).to_vec();
        more.is_none() && nodes == Some(own) && ODD_LAWS.contains(&block.head[1].as_str())
    }

    /// Whether one of two nodes holds a copy of the other's voltage, and nothing else stands there.
    fn is_copy(&self, a: &str, b: &str) -> bool {
        let copies = |from: &str, to: &str| format!(" {to} 0 {from} 0 1");
        let ends = [copies(a, b), copies(b, a)];
        self.lines.iter().any(|line| {
            line.starts_with("E_") && ends.iter().any(|end| line.ends_with(end.as_str()))
        })
    }

    /// Whether two nodes of a subcircuit are one node around each of its instances.
    fn one_node(&self, block: &Block, a: &str, b: &str) -> bool {
        let place = |name: &str| block.head[terminals(&block.head)].iter().position(|t| t == name);
        let (a, b) = match (place(a), place(b)) {
            (Some(a), Some(b)) => (a, Some(b)),
            (Some(a), None) if b == "0" => (a, None),
            (None, Some(b)) if a == "0" => (b, None),
            _ => return false,
        };
        let (own, blocks) = (self.instances(), self.blocks());
        let mut own = own.iter().filter(|x| x.words[terminals(&x.words).end] == block.head[1]);
        own.all(|x| {
            let (a, b) = (&x.words[1 + a], b.map_or("0", |b| x.words[1 + b].as_str()));
            // They may be terminals of what is around.
            let around = blocks.iter().find(|block| block.body == x.around);
            a == b || around.is_some_and(|around| self.one_node(around, a, b))
        })
    }

    fn swapped_terminals(&self, random: &mut Random) -> Option<Change> {
        let (Instance { at, mut words, .. }, block) = self.instance(random);
        let places = terminals(&words);
        let (a, b) = (one(places.clone(), random), one(places, random));
        if words[a] == words[b] {
            return None;
        }
        words.swap(a, b);
        let idle = self.is_idle(&block, a - 1) && self.is_idle(&block, b - 1);
        let odd = self.is_odd(&block, [a - 1, b - 1]);
        change(at, vec![words.join(" ")], idle.then_some(IDLE).or(odd.then_some(ODD)))
    }

    fn wrong_node(&self, random: &mut Random) -> Option<Change> {
        let (instance, block) = self.instance(random);
        let at = one(terminals(&instance.words), random);
        let mut nodes = self.nodes(instance.around.clone());
        nodes.push("0".to_string());
        nodes.retain(|node| *node != instance.words[at]);
        let node = nodes[random.below(nodes.len())].clone();
        let around = self.blocks().into_iter().find(|block| block.body == instance.around);
        let was = &instance.words[at];
        let one = around.is_some_and(|around| self.one_node(&around, was, &node));
        let same = (self.is_idle(&block, at - 1).then_some(IDLE))
            .or(one.then_some(ONE_NODE))
            .or(self.is_copy(was, &node).then_some(COPY));
        change(instance.at, vec![replaced(&instance.words, at, node)], same)
    }

    fn given_value(&self, random: &mut Random) -> Option<Change> {
        let (Instance { at, mut words, .. }, block) = self.instance(random);
        let (first, defaults) = (parameters(&words), &block.head[parameters(&block.head)..]);
        let default = |key: &str| {
            let of = |word: &String| Some(word.strip_prefix(key)?.strip_prefix('=')?.to_string());
            defaults.iter().find_map(of)
        };
        if random.below(4) == 0 {
            // One that it does not give.
            let key = defaults.get(random.below(defaults.len()))?.split('=').next()?.to_string();
            if words[first.min(words.len())..]
                .iter()
                .any(|word| word.starts_with(&format!("{key}=")))
            {
                return None;
            }
            if first == words.len() {
                words.push("PARAMS:".to_string());
            }
            let value = default(&key)?;
            let keep = random.below(3) == 0;
            words.push(match keep {
                true => format!("{key}={value}"),
                false => format!("{key}={{{}+1e-3}}", inside(&value)),
            });
            return change(at, vec![words.join(" ")], keep.then_some(DEFAULT));
        }
        if first >= words.len() {
            return None;
        }
        let which = one(first..words.len(), random);
        let (key, value) = words[which].split_once('=')?;
        let (key, value) = (key.to_string(), value.to_string());
        if random.below(4) == 0 {
            let same = default(&key) == Some(value);
            words.remove(which);
            return change(at, vec![words.join(" ")], same.then_some(DEFAULT));
        }
        let factor = ["1.001", "2", "-1", "1e-3"][random.below(4)];
        let by = match is_zero(&value) {
            true => format!("{key}=1e-3"),
            false => format!("{key}={{{factor}*({})}}", inside(&value)),
        };
        change(at, vec![replaced(&words, which, by)], None)
    }

    fn instance_lost_or_doubled(&self, random: &mut Random) -> Option<Change> {
        let (Instance { at, words, .. }, _) = self.instance(random);
        if random.below(2) == 0 {
            return change(at, vec![], None);
        }
        let twin = replaced(&words, 0, format!("{}_twin", words[0]));
        change(at, vec![self.lines[at].clone(), twin], None)
    }

    fn wrong_subcircuit(&self, random: &mut Random) -> Option<Change> {
        let (Instance { at, words, .. }, block) = self.instance(random);
        let place = terminals(&words).end;
        let count = terminals(&block.head).len();
        let mut others = self.blocks();
        others.retain(|other| {
            other.head[1] != block.head[1] && terminals(&other.head).len() == count
        });
        let name = match others.is_empty() {
            true => "Nosuch".to_string(),
            false => others[random.below(others.len())].head[1].clone(),
        };
        let mut words = replaced(&words, place, name);
        // With its own values, of which the other may know none; and without them.
        if random.below(2) == 0 {
            words = words.split(" PARAMS:").next()?.to_string();
        }
        change(at, vec![words], None)
    }

    fn swapped_head(&self, random: &mut Random) -> Option<Change> {
        let mut blocks = self.blocks();
        let block = blocks.swap_remove(random.below(blocks.len()));
        let places = terminals(&block.head);
        let (a, b) = (one(places.clone(), random), one(places, random));
        if a == b {
            return None;
        }
        let idle = self.is_idle(&block, a - 2) && self.is_idle(&block, b - 2);
        let one_node = self.one_node(&block, &block.head[a], &block.head[b]);
        let mut head = block.head.clone();
        head.swap(a, b);
        let odd = self.is_odd(&block, [a - 2, b - 2]);
        let same = (idle.then_some(IDLE)).or(one_node.then_some(ONE_NODE)).or(odd.then_some(ODD));
        change(block.at, vec![head.join(" ")], same)
    }

    fn default_value(&self, random: &mut Random) -> Option<Change> {
        let mut blocks = self.blocks();
        let block = blocks.swap_remove(random.below(blocks.len()));
        let first = parameters(&block.head);
        if first >= block.head.len() {
            return None;
        }
        let which = one(first..block.head.len(), random);
        let (key, value) = block.head[which].split_once('=')?;
        let by = match is_zero(value) {
            true => format!("{key}=1e-3"),
            false => format!("{key}={{1.001*({})}}", inside(value)),
        };
        let begin = format!("{key}=");
        let all = self.instances();
        let mut own = all.iter().filter(|x| x.words[terminals(&x.words).end] == block.head[1]);
        let given = own.all(|x| x.words.iter().any(|word| word.starts_with(&begin)));
        change(block.at, vec![replaced(&block.head, which, by)], given.then_some(ALL_GIVE))
    }

    fn body(&self, random: &mut Random) -> Option<Change> {
        let mut blocks = self.blocks();
        let block = blocks.swap_remove(random.below(blocks.len()));
        let at = one(block.body.clone(), random);
        let line = &self.lines[at];
        let words = words(line);
        if !is_device(line) || letter(&words) == 'X' {
            return None;
        }
        match random.below(4) {
            0 => change(at, vec![], None),
            1 => {
                let twin = replaced(&words, 0, format!("{}_twin", words[0]));
                change(at, vec![line.clone(), twin], None)
            }
            2 => {
                let (mut places, control) = node_places(&words);
                places.extend(control);
                let place = *places.get(random.below(places.len()))?;
                let mut nodes = self.nodes(block.body.clone());
                nodes.extend_from_slice(&block.head[terminals(&block.head)]);
                nodes.retain(|node| *node != words[place]);
                let node = nodes[random.below(nodes.len())].clone();
                let same = self.one_node(&block, &words[place], &node).then_some(ONE_NODE);
                change(at, vec![replaced(&words, place, node)], same)
            }
            _ => {
                let law = words.iter().position(|word| word.starts_with("VALUE="));
                if let Some(place) = law {
                    let law = inside(words[place].strip_prefix("VALUE=")?).to_string();
                    let by = [format!("-({law})"), format!("1.001*({law})")];
                    let by = &by[random.below(2)];
                    return change(
                        at,
                        vec![replaced(&words, place, format!("VALUE={{{by}}}"))],
                        None,
                    );
                }
                let place = value_place(&words)?;
                if is_zero(&words[place]) {
                    return change(at, vec![replaced(&words, place, "1e-3".to_string())], None);
                }
                let factor = ["-1", "1.001", "1000"][random.below(3)];
                let by = format!("{{{factor}*({})}}", inside(&words[place]));
                change(at, vec![replaced(&words, place, by)], None)
            }
        }
    }
}

/// Each sort of change.
pub const SORTS: &[(&str, Sort)] = &[
    ("terminals of an instance exchanged", Deck::swapped_terminals),
    ("an instance at a wrong node", Deck::wrong_node),
    ("an instance's parameter", Deck::given_value),
    ("an instance lost or doubled", Deck::instance_lost_or_doubled),
    ("an instance of a wrong subcircuit", Deck::wrong_subcircuit),
    ("terminals of a subcircuit exchanged", Deck::swapped_head),
    ("a subcircuit's default", Deck::default_value),
    ("a card within a subcircuit", Deck::body),
];
