//! A netlist in the words that a dialect has.

use super::dialects::{Dialect, NGSPICE, Switches};
use super::{Card, CardKind, Device, Element, Expr, Name, Names, Netlist, Shape, Waveform};
use crate::diagnostic::Diagnostic;
use crate::expr::Binary;
use crate::source::Span;
use std::collections::{HashMap, HashSet};

/// Something that a dialect has no words for.
pub struct Lack {
    /// Whether a device needs it, the models of the netlist by name besides.
    pub needed: fn(&Element, &Models) -> bool,
    /// What it is, after `… cannot say`.
    pub what: &'static str,
    /// What to do.
    pub help: &'static str,
}

/// Parameters of the models, by their names.
pub type Models<'a> = HashMap<Name, &'a [(String, Expr)]>;

/// The value of a behavioural source.
pub const LAW: Lack = Lack {
    needed: |element, _| {
        matches!(element, Element::BehaviouralVoltage { .. } | Element::BehaviouralCurrent { .. })
    },
    what: "a law",
    help: "only linear models can be written for it: elements with constants, sources with waveforms",
};

/// A switch.
pub const SWITCH: Lack = Lack {
    needed: |element, _| matches!(element, Element::Switch { .. } | Element::CurrentSwitch { .. }),
    what: "a switch",
    help: "only linear models can be written for it",
};

/// A diode.
pub const DIODE: Lack = Lack {
    needed: |element, _| matches!(element, Element::Diode { .. }),
    what: "a diode",
    help: "only linear models can be written for it",
};

/// A sine that starts at an angle.
pub const PHASE: Lack = Lack {
    needed: |element, _| {
        let (Element::VoltageSource(source) | Element::CurrentSource(source)) = element else {
            return false;
        };
        match &source.waveform {
            Waveform::Function { shape: Shape::Sin, arguments } => {
                arguments.get(PLAIN_SINE).is_some_and(|phase| phase.as_number() != Some(0.0))
            }
            _ => false,
        }
    },
    what: "a sine with a phase",
    help: "give the sine a delay instead",
};

/// Arguments of a sine before its phase.
const PLAIN_SINE: usize = 5;

/// A line that does not start at rest.
pub const CHARGED_LINE: Lack = Lack {
    needed: |element, _| match element {
        Element::Line { initial: Some(values), .. } => {
            values.iter().any(|value| value.as_number() != Some(0.0))
        }
        _ => false,
    },
    what: "a line with initial values",
    help: "let the delayed signal begin at 0",
};

/// A switch with two thresholds.
pub const SWITCHING_HYSTERESIS: Lack = Lack {
    needed: |element, models| {
        let (Element::Switch { model, .. } | Element::CurrentSwitch { model, .. }) = element else {
            return false;
        };
        let wide = |(key, value): &(String, Expr)| {
            matches!(key.as_str(), "vh" | "ih") && value.as_number() != Some(0.0)
        };
        models.get(model).is_some_and(|parameters| parameters.iter().any(wide))
    },
    what: "a switch with two thresholds",
    help: "its switches change smoothly between two values and remember nothing",
};

/// The netlist, and what was added to it.
pub struct Adapted {
    /// In the dialect's words.
    pub netlist: Netlist,
    /// 0 V sources, each with the device whose current it carries; those of a subcircuit once for each instance, by their
    /// paths.
    pub senses: Vec<(String, String)>,
}

/// Puts a netlist in the words of a dialect. `None`, with an error for each device that it cannot say.
pub fn adapt(netlist: &Netlist, dialect: &Dialect, d: &mut Vec<Diagnostic>) -> Option<Adapted> {
    let mut models = Models::new();
    each(&netlist.cards, &mut |card| {
        if let CardKind::Model { name, parameters, .. } = &card.kind {
            models.insert(*name, parameters);
        }
    });
    let before = d.len();
    each(&netlist.cards, &mut |card| {
        let CardKind::Device(device) = &card.kind else { return };
        for lack in dialect.lacks.iter().filter(|lack| (lack.needed)(&device.element, &models)) {
            d.push(cannot_say(dialect, lack, card, netlist.names.text(device.name)));
        }
    });
    if d.len() > before {
        return None;
    }
    let mut netlist = netlist.clone();
    let mut senses = vec![];
    netlist.header.retain(|(key, _)| key != "dialect");
    if dialect.name != NGSPICE.name {
        netlist.header.insert(0, ("dialect".to_string(), dialect.name.to_string()));
    }
    let mut cards = std::mem::take(&mut netlist.cards);
    scope(&mut cards, &mut netlist.names, dialect, &mut senses);
    netlist.cards = cards;
    let mut placed = vec![];
    if !senses.is_empty() {
        place(&netlist, &netlist.cards, "", &senses, &mut placed);
    }
    Some(Adapted { netlist, senses: placed })
}

/// Subcircuits within one another whose senses are still told one by one.
const DEEP: usize = 64;

/// Finds the senses of a block of cards and of the instances in it.
fn place(
    netlist: &Netlist,
    cards: &[Card],
    path: &str,
    senses: &[(String, String)],
    placed: &mut Vec<(String, String)>,
) {
    for card in cards {
        let CardKind::Device(device) = &card.kind else { continue };
        let name = netlist.names.text(device.name);
        if let Element::Instance { subcircuit, .. } = &device.element
            && path.matches('.').count() < DEEP
        {
            let definition = netlist.cards.iter().find_map(|card| match &card.kind {
                CardKind::Subcircuit(own) if own.name == *subcircuit => Some(own),
                _ => None,
            });
            if let Some(own) = definition {
                place(netlist, &own.cards, &format!("{path}{name}."), senses, placed);
            }
        } else if let Some((_, carried)) = senses.iter().find(|(carrier, _)| carrier == name) {
            placed.push((format!("{path}{name}"), format!("{path}{carried}")));
        }
    }
}

/// The error that a dialect lacks what a card of this name needs.
pub fn cannot_say(dialect: &Dialect, lack: &Lack, card: &Card, name: &str) -> Diagnostic {
    let message = format!("{} cannot say {}: `{name}`", dialect.name, lack.what);
    let error = Diagnostic::error("E0605", card.span, message).help(lack.help);
    // What stands for the element, when the netlist is that of a bond graph.
    match &card.comment {
        Some(comment) => error.because(format!("it stands for {comment}")),
        None => error,
    }
}

/// Every card, those of subcircuits too.
fn each<'a>(cards: &'a [Card], visit: &mut dyn FnMut(&'a Card)) {
    for card in cards {
        visit(card);
        if let CardKind::Subcircuit(subcircuit) = &card.kind {
            each(&subcircuit.cards, visit);
        }
    }
}

/// The cards of a circuit or a subcircuit.
fn scope(
    cards: &mut Vec<Card>,
    names: &mut Names,
    dialect: &Dialect,
    senses: &mut Vec<(String, String)>,
) {
    for card in cards.iter_mut() {
        match &mut card.kind {
            CardKind::Subcircuit(subcircuit) => {
                scope(&mut subcircuit.cards, names, dialect, senses);
            }
            CardKind::Model { kind, parameters, .. } if dialect.switches == Switches::Smooth => {
                smooth(kind, parameters);
            }
            CardKind::Device(Device {
                element: Element::VoltageSource(source) | Element::CurrentSource(source),
                ..
            }) if !dialect.phases => {
                if let Waveform::Function { shape: Shape::Sin, arguments } = &mut source.waveform {
                    arguments.truncate(PLAIN_SINE);
                }
            }
            _ => {}
        }
    }
    if !dialect.linked_to_any {
        sense(cards, names, senses);
    }
}

/// Puts a 0 V source in series with each device whose current another one takes, where that is no V source.
fn sense(cards: &mut Vec<Card>, names: &mut Names, senses: &mut Vec<(String, String)>) {
    let mut wanted = HashSet::new();
    for card in cards.iter() {
        if let CardKind::Device(device) = &card.kind
            && let Some(control) = control(&device.element)
        {
            wanted.insert(control);
        }
    }
    let mut carriers = HashMap::new();
    let mut at = 0;
    while at < cards.len() {
        at += 1;
        let card = &mut cards[at - 1];
        let CardKind::Device(device) = &mut card.kind else { continue };
        let source = matches!(device.element, Element::VoltageSource(_));
        if source || !wanted.contains(&device.name) {
            continue;
        }
        let carried = names.text(device.name).to_string();
        let carrier = free(names, &format!("V_{carried}"));
        let node = free(names, &format!("{carried}_in"));
        let Some(minus) = device.nodes.get_mut(1) else { continue };
        let nodes = [node, std::mem::replace(minus, node)].as_slice().into();
        carriers.insert(device.name, carrier);
        senses.push((names.text(carrier).to_string(), carried.clone()));
        let element = Element::VoltageSource(Waveform::Constant(Expr::number(0.0)).into());
        let kind = CardKind::Device(Device { name: carrier, nodes, element });
        let comment = Some(format!("carries the current of {carried}"));
        cards.insert(at, Card { kind, span: Span::NONE, comment });
        at += 1;
    }
    for card in cards {
        if let CardKind::Device(device) = &mut card.kind
            && let Element::Cccs { control, .. }
            | Element::Ccvs { control, .. }
            | Element::CurrentSwitch { control, .. } = &mut device.element
            && let Some(carrier) = carriers.get(control)
        {
            *control = *carrier;
        }
    }
}

/// The device whose current an element takes.
fn control(element: &Element) -> Option<Name> {
    match element {
        Element::Cccs { control, .. }
        | Element::Ccvs { control, .. }
        | Element::CurrentSwitch { control, .. } => Some(*control),
        _ => None,
    }
}

/// A name that nothing has yet.
fn free(names: &mut Names, wish: &str) -> Name {
    let mut text = wish.to_string();
    let mut number = 2;
    while names.find(&text).is_some() {
        text = format!("{wish}_{number}");
        number += 1;
    }
    names.intern(&text)
}

/// How far from its threshold a switch without hysteresis has changed over, in parts of the threshold.
const TRANSITION: f64 = 1e-3;

/// Two values in place of a threshold and a half width.
fn smooth(kind: &mut String, parameters: &mut [(String, Expr)]) {
    let (new, [middle, half], names) = match kind.as_str() {
        "sw" => ("vswitch", ["vt", "vh"], ["von", "voff"]),
        "csw" => ("iswitch", ["it", "ih"], ["ion", "ioff"]),
        _ => return,
    };
    let value = |key: &str| {
        let found = parameters.iter().find(|(own, _)| own == key);
        found.map_or(Expr::number(0.0), |(_, value)| value.clone())
    };
    let threshold = value(middle);
    // One that is 0 still needs some width.
    let width = match threshold.as_number() {
        Some(0.0) => Expr::number(TRANSITION),
        Some(value) => Expr::number(TRANSITION * value.abs()),
        None => threshold.clone().binary(Binary::Multiply, Expr::number(TRANSITION)),
    };
    let ends = [Binary::Add, Binary::Subtract].map(|op| {
        let end = threshold.clone().binary(op, width.clone());
        end.constant().map_or(end, Expr::number)
    });
    for ((key, value), (name, end)) in parameters
        .iter_mut()
        .filter(|(key, _)| key == middle || key == half)
        .zip(names.into_iter().zip(ends))
    {
        *key = name.to_string();
        *value = end;
    }
    *kind = new.to_string();
}
