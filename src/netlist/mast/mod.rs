//! Netlists in MAST, the language of Saber: templates of our own, and their instances.
//!
//! Nothing rests on a library: every element is an element template that the file holds itself, with `i(p->m) +=`
//! and `d_by_dt`; a law or a waveform is one made for it. Only the templates that are used are written. Where a law or
//! a linked source takes the current of another element, it has a `ref` for it, and that element a current of its own.

mod law;
mod elements;
mod laws;
mod sources;
mod template;
mod words;

use super::adapt::{self, Lack};
use super::dialects::Dialect;
use super::header::Header;
use super::lacks;
use super::{Card, CardKind, Device, Element, Expr, Leaf, Name, Netlist, Waveform};
use crate::diagnostic::{Diagnostic, has_errors};
use crate::expr::print::number;
use law::Statement;
use std::collections::{BTreeMap, HashMap, HashSet};
use template::{Template, line, listed};
use words::Words;

/// What MAST, as far as it is known, has no words for.
pub const LACKS: &[Lack] = &[
    Lack {
        needed: |element, _| match element {
            Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law } => {
                !law::sayable(law)
            }
            _ => false,
        },
        what: "a whole part, a remainder or a power with a varying exponent",
        help: "nothing is known of a word for it; a pulse source instead of `mod(time, …)` can be written",
    },
    Lack {
        needed: |element, _| matches!(element, Element::Line { .. }),
        what: "a delay",
        help: "nothing is known of a word for it; a chain of small elements can be written",
    },
    Lack {
        needed: |element, _| matches!(element, Element::Diode { .. }),
        what: "a diode",
        help: "a resistor whose law is that of the diode can be written",
    },
    Lack {
        needed: |element, _| matches!(element, Element::Instance { .. }),
        what: "a subcircuit",
        help: "a flat netlist can be written",
    },
    lacks::PASSIVE_LAW,
    lacks::MODELLED,
    lacks::PAST,
    lacks::SOURCE_LAW,
    lacks::PARTS,
    lacks::REPEATED,
    lacks::PATTERN,
    lacks::AMPLITUDE,
    lacks::LAW_SWITCH,
    lacks::SMOOTH_SWITCH,
    Lack { help: "one with a single threshold can be written", ..adapt::SWITCHING_HYSTERESIS },
];

/// A value that only a case by case computation gives, where a number must stand.
const CASES: Lack = Lack {
    needed: |_, _| false,
    what: "a value that follows from others by cases",
    help: "give it as a number",
};

/// Initial values of nodes.
const INITIAL: Lack = Lack {
    needed: |_, _| false,
    what: "initial values of nodes",
    help: "give each storage its own",
};

/// What has a word in a netlist.
#[derive(PartialEq, Eq, Hash)]
enum Thing {
    Parameter(Name),
    Node(Name),
}

/// An instance of a template.
struct Entry {
    template: String,
    name: String,
    connections: Vec<String>,
    /// Elements whose currents it takes, behind the other connections.
    controls: Vec<Name>,
    arguments: Vec<(String, String)>,
    comment: Option<String>,
}

/// A line of the netlist itself.
enum Line {
    Text(String),
    Entry(Entry),
}

struct Writer<'a> {
    netlist: &'a Netlist,
    dialect: &'a Dialect,
    words: Words<Thing>,
    devices: Words<Name>,
    /// Nodes whose names could not stay.
    renamed: BTreeMap<String, String>,
    /// Parameters as numbers.
    values: HashMap<Name, f64>,
    models: adapt::Models<'a>,
    /// Whose current another element takes.
    taken: HashSet<Name>,
    /// Inductors in groups that are coupled, with the couplings between places of the group.
    coupled: Vec<elements::Coupled<'a>>,
    /// Step and end of the analysis.
    step: f64,
    stop: f64,
    /// Whether storages begin at their own values.
    uic: bool,
    templates: Vec<Template>,
    lines: Vec<Line>,
    /// Template, instance and variable that carry an element's current.
    carriers: HashMap<Name, String>,
    d: &'a mut Vec<Diagnostic>,
}

/// The text of a netlist. `None`, with errors, where MAST cannot say it.
pub fn text(netlist: &Netlist, dialect: &Dialect, d: &mut Vec<Diagnostic>) -> Option<String> {
    let mut writer = Writer {
        netlist,
        dialect,
        words: Words::new(&[]),
        devices: Words::new(&[]),
        renamed: BTreeMap::new(),
        values: values(netlist),
        models: HashMap::new(),
        taken: HashSet::new(),
        coupled: elements::coupled(netlist),
        step: 0.0,
        stop: 1.0,
        uic: false,
        templates: vec![],
        lines: vec![],
        carriers: HashMap::new(),
        d: &mut vec![],
    };
    writer.survey();
    for card in &netlist.cards {
        writer.card(card);
    }
    let text = writer.finish();
    let said = std::mem::take(writer.d);
    let failed = has_errors(&said);
    d.extend(said);
    (!failed).then_some(text)
}

/// The parameters as numbers, as far as they follow from each other.
fn values(netlist: &Netlist) -> HashMap<Name, f64> {
    let mut open: Vec<(Name, &Expr)> = vec![];
    for card in &netlist.cards {
        if let CardKind::Parameters(parameters) = &card.kind {
            open.extend(parameters.iter().map(|(name, value)| (*name, value)));
        }
    }
    let mut values = HashMap::new();
    // One may speak of another that stands behind it.
    loop {
        let before = values.len();
        open.retain(|(name, value)| match evaluate(value, &values) {
            Some(value) => {
                values.insert(*name, value);
                false
            }
            None => true,
        });
        if values.len() == before {
            return values;
        }
    }
}

/// The value of an expression of known parameters.
fn evaluate(expr: &Expr, values: &HashMap<Name, f64>) -> Option<f64> {
    let mut known = true;
    expr.leaves(&mut |leaf, _| match leaf {
        Leaf::Parameter(name) => known &= values.contains_key(name),
        _ => known = false,
    });
    let mut leaf = |leaf: &Leaf| match leaf {
        Leaf::Parameter(name) => values.get(name).copied().unwrap_or(f64::NAN),
        _ => f64::NAN,
    };
    known.then(|| expr.evaluate(&mut leaf))
}

impl<'a> Writer<'a> {
    /// What must be known of the whole before the first line.
    fn survey(&mut self) {
        for card in &self.netlist.cards {
            match &card.kind {
                // Nodes keep their names before parameters do: maps speak of nodes.
                CardKind::Device(device) => {
                    for node in &device.nodes {
                        self.node(*node);
                    }
                }
                CardKind::Transient { step, stop, uic, .. } => {
                    let value = |expr| evaluate(expr, &self.values);
                    self.step = value(step).unwrap_or(0.0);
                    self.stop = value(stop).unwrap_or(1.0);
                    self.uic = *uic;
                }
                CardKind::Model { name, parameters, .. } => {
                    self.models.insert(*name, parameters);
                }
                _ => {}
            }
        }
        for card in &self.netlist.cards {
            match &card.kind {
                CardKind::Parameters(parameters) => {
                    for (name, _) in parameters {
                        self.parameter(*name);
                    }
                }
                CardKind::Device(device) => match &device.element {
                    Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law } => {
                        law.leaves(&mut |leaf, _| {
                            if let Leaf::Current(name) = leaf {
                                self.taken.insert(*name);
                            }
                        });
                    }
                    Element::Cccs { control, .. }
                    | Element::Ccvs { control, .. }
                    | Element::CurrentSwitch { control, .. } => {
                        self.taken.insert(*control);
                    }
                    _ => {}
                },
                _ => {}
            }
        }
    }

    fn name(&self, name: Name) -> &'a str {
        self.netlist.names.text(name)
    }

    fn parameter(&mut self, name: Name) -> String {
        let text = self.name(name);
        self.words.of(Thing::Parameter(name), text)
    }

    fn node(&mut self, name: Name) -> String {
        match self.name(name) {
            "0" => "0".to_string(),
            text => {
                let word = self.words.of(Thing::Node(name), text);
                if word != text {
                    self.renamed.insert(word.clone(), text.to_string());
                }
                word
            }
        }
    }

    fn device(&mut self, name: Name) -> String {
        let text = self.name(name);
        self.devices.of(name, text)
    }

    fn card(&mut self, card: &'a Card) {
        match &card.kind {
            CardKind::Comment(comment) => {
                self.lines.push(Line::Text(format!("# {}", comment.trim())));
            }
            CardKind::Parameters(parameters) => {
                for (name, value) in parameters {
                    let (word, value) = (self.parameter(*name), self.value(card, value));
                    let mut comment = behind(card.comment.as_deref());
                    if word != self.name(*name) {
                        comment = format!("  # stands for {}{comment}", self.name(*name));
                    }
                    self.lines.push(Line::Text(format!("number {word} = {value}{comment}")));
                }
            }
            CardKind::Device(device) => self.element(card, device),
            CardKind::Initial(values) => {
                if let Some((name, _)) = values.first() {
                    self.cannot_say(&INITIAL, card, *name);
                }
            }
            // What can be asked of a simulator is said at the top; instances of subcircuits are refused.
            CardKind::Subcircuit(_)
            | CardKind::Choice(_)
            | CardKind::Function(_)
            | CardKind::Global(_)
            | CardKind::Guess(_)
            | CardKind::Model { .. }
            | CardKind::Options(_)
            | CardKind::Save { .. }
            | CardKind::Transient { .. }
            | CardKind::OperatingPoint
            | CardKind::Measure(_)
            | CardKind::Fourier(_)
            | CardKind::Analysis(_)
            | CardKind::Step(_)
            | CardKind::Data(_) => {}
        }
    }

    fn cannot_say(&mut self, lack: &Lack, card: &Card, name: Name) {
        let error = adapt::cannot_say(self.dialect, lack, card, self.name(name));
        self.d.push(error);
    }

    /// A value as a formula of parameters; as a number where it follows from them by cases.
    fn value(&mut self, card: &Card, expr: &Expr) -> String {
        if law::sayable(expr) {
            let mut leaf = |leaf: &Leaf| match leaf {
                Leaf::Parameter(name) => law::Formula::leaf(self.parameter(*name)),
                _ => law::Formula::number(f64::NAN),
            };
            let mut before = vec![];
            let text = law::Writer::inline().text(expr, &mut leaf, &mut before);
            if before.is_empty() {
                return text;
            }
        }
        match evaluate(expr, &self.values) {
            Some(value) => number(value),
            None => {
                let name = match &card.kind {
                    CardKind::Device(device) => Some(device.name),
                    CardKind::Parameters(parameters) => parameters.first().map(|(name, _)| *name),
                    _ => None,
                };
                if let Some(name) = name {
                    self.cannot_say(&CASES, card, name);
                }
                String::new()
            }
        }
    }

    /// Adds an instance of a template, which is added where it is new.
    fn entry(
        &mut self,
        card: &Card,
        device: &Device,
        template: Template,
        controls: Vec<Name>,
        arguments: Vec<String>,
    ) {
        let name = self.device(device.name);
        if !template.currents.is_empty() {
            let carrier = format!("i({}.{name})", template.name);
            self.carriers.insert(device.name, carrier);
        }
        let connections = device.nodes.iter().map(|node| self.node(*node)).collect();
        self.add(card, name, template, connections, controls, arguments);
    }

    fn add(
        &mut self,
        card: &Card,
        name: String,
        template: Template,
        connections: Vec<String>,
        controls: Vec<Name>,
        arguments: Vec<String>,
    ) {
        let names = template.numbers.iter().map(|(name, _)| name.clone());
        self.lines.push(Line::Entry(Entry {
            template: template.name.clone(),
            name,
            connections,
            controls,
            arguments: names.zip(arguments).collect(),
            comment: card.comment.clone(),
        }));
        if !self.templates.iter().any(|known| known.name == template.name) {
            self.templates.push(template);
        }
    }

    fn finish(&mut self) -> String {
        // Headings of what stands elsewhere, or has no place here, lead nowhere.
        while let Some(Line::Text(text)) = self.lines.last()
            && text.starts_with('#')
        {
            self.lines.pop();
        }
        let mut text = head(self.netlist, self.step, self.stop);
        for (word, name) in &self.renamed {
            text.push_str(&format!(
                "# node {word} stands for {}\n",
                name.replace(['\n', '\r'], " ")
            ));
        }
        for template in &self.templates {
            text.push('\n');
            text.push_str(&template.text());
        }
        text.push('\n');
        for content in &self.lines {
            let entry = match content {
                Line::Text(content) => {
                    text.push_str(&content.replace(['\n', '\r'], " "));
                    text.push('\n');
                    continue;
                }
                Line::Entry(entry) => entry,
            };
            if let Some(comment) = &entry.comment {
                text.push_str(&format!("# {}\n", comment.replace(['\n', '\r'], " ")));
            }
            let mut words = vec![format!("{}.{}", entry.template, entry.name)];
            words.extend(entry.connections.iter().cloned());
            for control in &entry.controls {
                words.push(self.carriers.get(control).cloned().unwrap_or_default());
            }
            if !entry.arguments.is_empty() {
                words.push("=".to_string());
                let arguments =
                    entry.arguments.iter().map(|(name, value)| format!("{name}={value}"));
                words.extend(listed(arguments));
            }
            line(&mut text, 0, &words);
        }
        text
    }
}

/// A comment behind something, or nothing.
fn behind(comment: Option<&str>) -> String {
    comment.map_or(String::new(), |comment| format!("  # {}", comment.replace(['\n', '\r'], " ")))
}

/// What a reader must know.
fn head(netlist: &Netlist, step: f64, stop: f64) -> String {
    let mut text = format!("# {}\n", netlist.title.replace(['\n', '\r'], " "));
    text.push_str(
        "# MAST for Saber, written by public notes on the language; it has not been run in Saber. Not sure are\n\
         # - var and val within the braces of a template, and if in its values section\n\
         # - time in values sections\n\
         # - abs, exp, ln, sqrt, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh by these names\n\
         # - connections such as i(bg_v.V_x), the current of V_x, for a ref\n\
         # All templates stand in this file. Effort is voltage and flow is current, in SI, in every domain.\n\
         # Sources set no breakpoints: steps must be shorter than their edges.\n",
    );
    text.push_str(&format!(
        "# To run: dc, then tr (ts {}, te {}, tb 0)\n",
        number(step),
        number(stop)
    ));
    let (header, _) = Header::read(&netlist.header);
    for column in &header.columns {
        let unit =
            if column.unit.is_empty() { String::new() } else { format!(" [{}]", column.unit) };
        let column = format!("# {}{unit} = {}", column.name, column.expr);
        text.push_str(&column.replace(['\n', '\r'], " "));
        text.push('\n');
    }
    text
}
