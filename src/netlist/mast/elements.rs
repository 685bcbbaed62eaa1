//! Elements as instances of templates.

use super::template::Template;
use super::{Card, CardKind, Device, Element, Expr, Name, Netlist, Writer};
use crate::expr::print::number;

/// Inductors that are coupled.
pub struct Coupled<'a> {
    /// The inductors, by the card and place of each.
    inductors: Vec<(&'a Device, &'a Expr, Option<&'a Expr>)>,
    /// Couplings between places of the group.
    couplings: Vec<([usize; 2], &'a Expr)>,
}

/// The groups of coupled inductors, each in the order of their cards.
pub fn coupled(netlist: &Netlist) -> Vec<Coupled<'_>> {
    let mut groups: Vec<Coupled> = vec![];
    let devices = || {
        netlist.cards.iter().filter_map(|card| match &card.kind {
            CardKind::Device(device) => Some(device),
            _ => None,
        })
    };
    for device in devices() {
        if let Element::Inductor { value, initial } = &device.element {
            let inductors = vec![(device, value, initial.as_ref())];
            groups.push(Coupled { inductors, couplings: vec![] });
        }
    }
    for device in devices() {
        let Element::Mutual { inductors, coupling } = &device.element else { continue };
        for (k, a) in inductors.iter().enumerate() {
            for b in inductors.iter().skip(k + 1) {
                couple(&mut groups, [*a, *b], coupling);
            }
        }
    }
    groups.retain(|group| !group.couplings.is_empty());
    groups
}

/// Adds a coupling; the groups of both inductors become one.
fn couple<'a>(groups: &mut Vec<Coupled<'a>>, pair: [Name; 2], coupling: &'a Expr) {
    let find = |groups: &[Coupled], name: Name| {
        groups.iter().position(|group| group.inductors.iter().any(|(d, ..)| d.name == name))
    };
    let (Some(a), Some(b)) = (find(groups, pair[0]), find(groups, pair[1])) else { return };
    if a != b {
        let taken = groups.remove(a.max(b));
        if let Some(kept) = groups.get_mut(a.min(b)) {
            let shift = kept.inductors.len();
            kept.inductors.extend(taken.inductors);
            let moved = taken.couplings.into_iter();
            kept.couplings.extend(moved.map(|([a, b], k)| ([a + shift, b + shift], k)));
        }
    }
    if let Some(group) = groups.get_mut(a.min(b)) {
        let place = |name| group.inductors.iter().position(|(device, ..)| device.name == name);
        if let (Some(a), Some(b)) = (place(pair[0]), place(pair[1])) {
            group.couplings.push(([a.min(b), a.max(b)], coupling));
        }
    }
}

impl<'a> Writer<'a> {
    /// An element.
    pub(super) fn element(&mut self, card: &'a Card, device: &'a Device) {
        let taken = self.taken.contains(&device.name);
        let across = "v(p)-v(m)";
        match &device.element {
            Element::Resistor { value } => {
                let template = Template::new("bg_r", "resistor").numbers(&["r"]);
                let template = template.current("(v(p)-v(m))/r", taken);
                let value = self.value(card, value);
                self.entry(card, device, template, vec![], vec![value]);
            }
            Element::Capacitor { value, initial } => {
                let initial = self.initial(card, initial.as_ref());
                let name = if initial.is_some() { "bg_c" } else { "bg_c_free" };
                let mut template = Template::new(name, "capacitor")
                    .numbers(&["c"])
                    .set("vc", across)
                    .set("q", "c*vc");
                if initial.is_some() {
                    template = template.numbers(&["ic"]).start("vc", "ic");
                }
                let template = template.current("d_by_dt(q)", taken);
                let value = self.value(card, value);
                let arguments = [value].into_iter().chain(initial).collect();
                self.entry(card, device, template, vec![], arguments);
            }
            Element::Inductor { value, initial } => {
                if self.in_a_group(card, device) {
                    return;
                }
                let initial = self.initial(card, initial.as_ref());
                let name = if initial.is_some() { "bg_l" } else { "bg_l_free" };
                let mut template = Template::new(name, "inductor").numbers(&["l"]).set("f", "l*i");
                if initial.is_some() {
                    template = template.numbers(&["ic"]).start("i", "ic");
                }
                let template = template.voltage("d_by_dt(f)");
                let value = self.value(card, value);
                let arguments = [value].into_iter().chain(initial).collect();
                self.entry(card, device, template, vec![], arguments);
            }
            // It stands in the template of the inductors.
            Element::Mutual { .. } => {}
            Element::VoltageSource(source) => self.source(card, device, &source.waveform, true),
            Element::CurrentSource(source) => self.source(card, device, &source.waveform, false),
            Element::Vcvs { gain, control } => {
                let template = linked("bg_vcvs", "voltage source linked to a voltage", true);
                let template = template.voltage("k*(v(cp)-v(cm))");
                self.linked(card, device, template, Some(*control), vec![], gain);
            }
            Element::Vccs { gain, control } => {
                let template = linked("bg_vccs", "current source linked to a voltage", true);
                let template = template.current("k*(v(cp)-v(cm))", taken);
                self.linked(card, device, template, Some(*control), vec![], gain);
            }
            Element::Ccvs { gain, control } => {
                let template = linked("bg_ccvs", "voltage source linked to a current", false);
                self.linked(card, device, template.voltage("k*ic"), None, vec![*control], gain);
            }
            Element::Cccs { gain, control } => {
                let template = linked("bg_cccs", "current source linked to a current", false);
                let template = template.current("k*ic", taken);
                self.linked(card, device, template, None, vec![*control], gain);
            }
            Element::BehaviouralVoltage { law } => self.law(card, device, law, true),
            Element::BehaviouralCurrent { law } => self.law(card, device, law, false),
            Element::Switch { model, control, .. } => {
                let template = linked("bg_switch", "switch, closed above vt", true);
                self.switch(
                    card,
                    device,
                    template,
                    "v(cp)-v(cm)",
                    *model,
                    "vt",
                    Some(*control),
                    vec![],
                );
            }
            Element::CurrentSwitch { model, control, .. } => {
                let template = linked("bg_switch_c", "switch, closed above it", false);
                self.switch(card, device, template, "ic", *model, "it", None, vec![*control]);
            }
            // Refused by the table of lacks.
            Element::Line { .. }
            | Element::Diode { .. }
            | Element::Passive(_)
            | Element::Charge { .. }
            | Element::Flux { .. }
            | Element::LawSwitch { .. }
            | Element::Instance { .. } => {}
        }
    }

    /// The value that a storage begins at, where it has one.
    fn initial(&mut self, card: &Card, initial: Option<&Expr>) -> Option<String> {
        if !self.uic {
            return None;
        }
        Some(initial.map_or("0".to_string(), |initial| self.value(card, initial)))
    }

    fn linked(
        &mut self,
        card: &Card,
        device: &Device,
        template: Template,
        nodes: Option<[Name; 2]>,
        currents: Vec<Name>,
        gain: &Expr,
    ) {
        let mut template = template;
        template.numbers.push(("k".to_string(), "1"));
        let gain = self.value(card, gain);
        let mut device = device.clone();
        device.nodes.extend(nodes.into_iter().flatten());
        self.entry(card, &device, template, currents, vec![gain]);
    }

    #[allow(clippy::too_many_arguments)]
    fn switch(
        &mut self,
        card: &Card,
        device: &Device,
        mut template: Template,
        control: &str,
        model: Name,
        threshold: &'static str,
        nodes: Option<[Name; 2]>,
        currents: Vec<Name>,
    ) {
        let taken = self.taken.contains(&device.name);
        let parameters = self.models.get(&model).copied().unwrap_or(&[]);
        let keys = [(threshold, 0.0), ("ron", 1.0), ("roff", OPEN)];
        let arguments = keys
            .iter()
            .map(|(key, default)| {
                let found = parameters.iter().find(|(own, _)| own == key);
                found.map_or(number(*default), |(_, value)| self.value(card, value))
            })
            .collect();
        template = template.numbers(&keys.map(|(key, _)| key));
        let current = |resistance: &str| {
            vec![super::Statement::Set("x".to_string(), format!("(v(p)-v(m))/{resistance}"))]
        };
        template.values.push("x".to_string());
        let condition = format!("{control} > {threshold}");
        template.statements.push(super::Statement::Cases(
            condition,
            current("ron"),
            current("roff"),
        ));
        let template = template.current("x", taken);
        let mut device = device.clone();
        device.nodes.extend(nodes.into_iter().flatten());
        self.entry(card, &device, template, currents, arguments);
    }

    /// Whether an inductor is coupled with others; its group is added where it is the first of it.
    fn in_a_group(&mut self, card: &'a Card, device: &'a Device) -> bool {
        let place = self.coupled.iter().position(|group| {
            group.inductors.iter().any(|(member, ..)| member.name == device.name)
        });
        let Some(place) = place else { return false };
        let first = self.coupled.get(place).and_then(|group| group.inductors.first());
        if first.is_none_or(|(first, ..)| first.name != device.name) {
            return true;
        }
        let Some(group) = self.coupled.get(place) else { return true };
        let (inductors, couplings) = (group.inductors.clone(), group.couplings.clone());
        let count = inductors.len();
        let mut template = Template::new(&format!("bg_coupled{count}"), "coupled inductors");
        template.pins = (1..=count).flat_map(|k| [format!("p{k}"), format!("m{k}")]).collect();
        let mut arguments = vec![];
        let mut connections = vec![];
        let mut names = vec![];
        for (k, (member, value, _)) in inductors.iter().enumerate() {
            template.numbers.push((format!("l{}", k + 1), "1"));
            arguments.push(self.value(card, value));
            connections.extend(member.nodes.iter().map(|node| self.node(*node)));
            names.push(self.device(member.name));
        }
        for a in 0..count {
            for b in a + 1..count {
                template.numbers.push((format!("k{}_{}", a + 1, b + 1), "0"));
                // A pair that two cards couple is coupled by their sum.
                let between: Vec<String> = couplings
                    .iter()
                    .filter(|(pair, _)| *pair == [a, b])
                    .map(|(_, value)| self.value(card, value))
                    .collect();
                arguments.push(if between.is_empty() {
                    "0".to_string()
                } else {
                    between.join("+")
                });
            }
        }
        for k in 1..=count {
            let flux: Vec<String> = (1..=count)
                .map(|j| match j {
                    j if j == k => format!("l{k}*i{k}"),
                    j => {
                        let (a, b) = (k.min(j), k.max(j));
                        format!("k{a}_{b}*sqrt(l{a}*l{b})*i{j}")
                    }
                })
                .collect();
            template = template.set(&format!("f{k}"), &flux.join("+"));
            template.currents.push(format!("i{k}"));
            template.equations.push(format!("i(p{k}->m{k}) += i{k}"));
            template.equations.push(format!("i{k}: v(p{k}) - v(m{k}) = d_by_dt(f{k})"));
        }
        for (k, (.., initial)) in inductors.iter().enumerate() {
            match self.initial(card, *initial) {
                Some(initial) => {
                    let argument = format!("ic{}", k + 1);
                    template = template.numbers(&[&argument]);
                    template = template.start(&format!("i{}", k + 1), &argument);
                    arguments.push(initial);
                }
                None if k == 0 => template.name.push_str("_free"),
                None => {}
            }
        }
        let name = names.join("_and_");
        for (k, (member, ..)) in inductors.iter().enumerate() {
            let carrier = format!("i{}({}.{name})", k + 1, template.name);
            self.carriers.insert(member.name, carrier);
        }
        self.add(card, name, template, connections, vec![], arguments);
        true
    }
}

/// The resistance of an open switch whose model says none, in ohms, as in SPICE.
const OPEN: f64 = 1e12;

/// A template with two more pins, or with a current of another element.
fn linked(name: &str, about: &str, by_voltage: bool) -> Template {
    let mut template = Template::new(name, about);
    if by_voltage {
        template.pins.extend(["cp", "cm"].map(String::from));
    } else {
        template.refs.push("ic".to_string());
    }
    template
}
