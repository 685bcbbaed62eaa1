//! Behavioural sources as templates, one for each law.

use super::law::{Formula, Statement};
use super::template::Template;
use super::{Card, Device, Expr, Leaf, Name, Writer, law};
use crate::expr::Binary;
use std::collections::HashMap;

/// What has a word within the template of a law.
#[derive(PartialEq, Eq, Hash, Clone, Copy)]
enum Local {
    Parameter(Name),
    Node(Name),
    Current(Name),
}

impl<'a> Writer<'a> {
    /// A source whose voltage, or else whose current, is a law.
    pub(super) fn law(&mut self, card: &'a Card, device: &'a Device, law: &Expr, voltage: bool) {
        let word = self.device(device.name);
        let mut template = Template::new(&format!("bg_law_{word}"), &format!("the law of {word}"));
        // The values that it needs on the way have names before anything else.
        let mut count = law::Writer::default();
        count.text(law, &mut |_| Formula::leaf(String::new()), &mut vec![]);
        let values: Vec<String> = (1..=count.values).map(|k| format!("x{k}")).collect();
        let mut taken = vec!["p", "m", "x"];
        taken.extend(values.iter().map(String::as_str));
        let mut words = super::Words::new(&taken);
        let mut known: HashMap<Local, String> = HashMap::new();
        // Its own pins are p and m, its own current is i.
        for (node, pin) in device.nodes.iter().zip(["p", "m"]).rev() {
            known.insert(Local::Node(*node), pin.to_string());
        }
        known.insert(Local::Current(device.name), "i".to_string());
        let (mut others, mut controls, mut arguments) = (vec![], vec![], vec![]);
        let mut local = |writer: &Self, thing: Local| {
            if let Some(word) = known.get(&thing) {
                return word.clone();
            }
            let word = match thing {
                Local::Parameter(name) => {
                    arguments.push(name);
                    words.of(thing, writer.name(name))
                }
                Local::Node(name) => {
                    others.push(name);
                    words.of(thing, writer.name(name))
                }
                Local::Current(name) => {
                    controls.push(name);
                    words.of(thing, &format!("i_{}", writer.name(name)))
                }
            };
            match thing {
                Local::Parameter(_) => template.numbers.push((word.clone(), "1")),
                Local::Node(_) => template.pins.push(word.clone()),
                Local::Current(_) => template.refs.push(word.clone()),
            }
            known.insert(thing, word.clone());
            word
        };
        let this = &*self;
        let mut leaf = |leaf: &Leaf| match leaf {
            Leaf::Parameter(name) => Formula::leaf(local(this, Local::Parameter(*name))),
            Leaf::Current(name) => Formula::leaf(local(this, Local::Current(*name))),
            Leaf::Time => Formula::leaf("time".to_string()),
            // Operators are refused by the table of lacks; powers and parts of phasors stand in outputs alone.
            Leaf::Operator(..) | Leaf::Power(_) | Leaf::Part(..) => Formula::number(f64::NAN),
            Leaf::Voltage(plus, minus) => {
                let mut of = |node: Name| match this.name(node) {
                    "0" => None,
                    _ => Some(Formula::leaf(format!("v({})", local(this, Local::Node(node))))),
                };
                match (of(*plus), minus.and_then(of)) {
                    (Some(plus), Some(minus)) => plus.binary(Binary::Subtract, minus),
                    (Some(plus), None) => plus,
                    (None, Some(minus)) => minus.negate(),
                    (None, None) => Formula::number(0.0),
                }
            }
        };
        let mut statements = vec![];
        let text = law::Writer::default().text(law, &mut leaf, &mut statements);
        statements.push(Statement::Set("x".to_string(), text));
        template.statements = statements;
        template.values = values;
        template.values.push("x".to_string());
        let template = if voltage {
            template.voltage("x")
        } else {
            template.current("x", self.taken.contains(&device.name))
        };
        let mut device = device.clone();
        device.nodes.extend(others);
        let arguments = arguments.into_iter().map(|name| self.parameter(name)).collect();
        self.entry(card, &device, template, controls, arguments);
    }
}
