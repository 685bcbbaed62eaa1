//! Writes a netlist as text, in the forms that every simulator of SPICE's family reads alike; where they differ, the row of
//! the dialect says how (`dialects.rs`).
//!
//! Lines stay under 80 columns: a longer card goes on behind `+`, broken at blanks. Numbers carry no suffix. A card's
//! comment stands at the end of its line where there is room, else on a line above.

use super::analysis::Print;
use super::dialects::{Comments, Dialect, NGSPICE};
use super::parts::{Draw, Operator, varies};
use super::{
    Card, CardKind, Device, Element, Expr, Leaf, Name, Names, Netlist, Source, Waveform, read,
};
use crate::expr::print::{number, print};

/// Lines are shorter than this.
const WIDTH: usize = 80;
/// Comments begin here where they can.
const COMMENT: usize = 44;
/// The same behind a parameter.
const PARAMETER_COMMENT: usize = 26;

/// The text of a netlist for ngspice.
pub fn write(netlist: &Netlist) -> String {
    text(netlist, &NGSPICE)
}

/// The names of a netlist and the dialect that they are written in.
#[derive(Clone, Copy)]
struct Form<'a> {
    names: &'a Names,
    dialect: &'a Dialect,
}

impl Form<'_> {
    /// A call of an operator. One that the dialect lacks has been refused.
    fn operator(&self, operator: Operator, arguments: &[Expr]) -> String {
        let name = match operator {
            Operator::Derivative => "ddt".to_string(),
            // Of two arguments where it does not begin at 0.
            Operator::Integral if arguments.len() > 1 => "idt".to_string(),
            Operator::Integral => "sdt".to_string(),
            Operator::Delay => "delay".to_string(),
            Operator::Transfer => "laplace".to_string(),
            Operator::Table => "table".to_string(),
            Operator::Waveform(shape) => format!("spice_{}", read::waveforms::row(shape).name),
            Operator::Draw(Draw::Normal, _) => return "agauss(0,1,1)".to_string(),
            Operator::Draw(Draw::Uniform, _) => return "aunif(0,1)".to_string(),
            Operator::Draw(Draw::Sign, _) => return "limit(0,1)".to_string(),
        };
        let arguments: Vec<String> = arguments.iter().map(|a| self.expression(a)).collect();
        format!("{name}({})", arguments.join(","))
    }

    fn name(&self, name: Name) -> String {
        self.names.text(name).to_string()
    }

    /// A name that may lead into subcircuits.
    fn inside(&self, name: Name) -> String {
        self.names.text(name).replace('.', self.dialect.separator)
    }

    fn expression(&self, expr: &Expr) -> String {
        print(expr, self.dialect.spelling, &mut |leaf| self.leaf(leaf))
    }

    fn spelling(&self) -> super::analysis::Spelling<'_> {
        super::analysis::Spelling { names: self.names, value: Box::new(|expr| value(*self, expr)) }
    }

    fn leaf(&self, leaf: &Leaf) -> String {
        match leaf {
            Leaf::Parameter(name) => self.name(*name),
            Leaf::Voltage(plus, None) => format!("v({})", self.inside(*plus)),
            Leaf::Voltage(plus, Some(minus)) => {
                format!("v({},{})", self.inside(*plus), self.inside(*minus))
            }
            Leaf::Current(device) => match self.dialect.lettered {
                true => format!("i({})", lettered(self.names.text(*device))),
                false => format!("i({})", self.inside(*device)),
            },
            Leaf::Power(device) => format!("p({})", self.inside(*device)),
            Leaf::Part(part, inner) => format!("{}({})", part.name(), self.leaf(inner)),
            Leaf::Time => "time".to_string(),
            Leaf::Operator(operator, arguments) => self.operator(*operator, arguments),
        }
    }
}

/// A device in a subcircuit as ngspice calls it: `h.X_motor.H_emf`, its letter before the path.
fn lettered(name: &str) -> String {
    let Some((path, own)) = name.rsplit_once('.') else { return name.to_string() };
    let letter = own.get(..1).unwrap_or("").to_lowercase();
    let first = path.split('.').next().unwrap_or("");
    // Names that were read stand so already.
    match first.eq_ignore_ascii_case(&letter) {
        true => name.to_string(),
        false => format!("{letter}.{name}"),
    }
}

/// The text of a netlist that the dialect can say (`dialects::Dialect::write` sees to that).
pub(super) fn text(netlist: &Netlist, dialect: &Dialect) -> String {
    let form = Form { names: &netlist.names, dialect };
    let mut text = String::new();
    text.push_str(&netlist.title.replace(['\n', '\r'], " "));
    text.push('\n');
    for (key, value) in &netlist.header {
        text.push_str(&format!("*bondspice {key}={value}\n"));
    }
    cards(&mut text, form, &netlist.cards);
    text.push_str(".end\n");
    text
}

/// An expression as a netlist for ngspice writes it.
pub fn expression(names: &Names, expr: &Expr) -> String {
    expression_in(&NGSPICE, names, expr)
}

/// An expression as a netlist in a dialect writes it.
pub fn expression_in(dialect: &Dialect, names: &Names, expr: &Expr) -> String {
    Form { names, dialect }.expression(expr)
}

/// A card that holds no others, on one line, as for ngspice.
pub fn card(names: &Names, kind: &CardKind) -> String {
    words(Form { names, dialect: &NGSPICE }, kind).join(" ")
}

fn cards(text: &mut String, form: Form, cards: &[Card]) {
    for card in cards {
        match &card.kind {
            CardKind::Comment(comment) => text.push_str(&format!("*{comment}\n")),
            CardKind::Subcircuit(subcircuit) => {
                let mut words = vec![".subckt".to_string(), form.name(subcircuit.name)];
                words.extend(subcircuit.ports.iter().map(|port| form.name(*port)));
                words.extend(given(form, &subcircuit.parameters));
                line(text, &words, card.comment.as_deref(), form.dialect.comments);
                self::cards(text, form, &subcircuit.cards);
                line(
                    text,
                    &[".ends".into(), form.name(subcircuit.name)],
                    None,
                    form.dialect.comments,
                );
            }
            CardKind::Choice(branches) => {
                for (k, branch) in branches.iter().enumerate() {
                    let word = if k == 0 { ".if" } else { ".elseif" };
                    let words = match &branch.condition {
                        Some(condition) => {
                            vec![word.to_string(), format!("({})", form.expression(condition))]
                        }
                        None => vec![".else".to_string()],
                    };
                    line(text, &words, None, form.dialect.comments);
                    self::cards(text, form, &branch.cards);
                }
                line(text, &[".endif".to_string()], None, form.dialect.comments);
            }
            kind => line(text, &words(form, kind), card.comment.as_deref(), form.dialect.comments),
        }
    }
}

/// The words of a card, between which a line may be broken.
fn words(form: Form, kind: &CardKind) -> Vec<String> {
    let word = |text: &str| text.to_string();
    match kind {
        CardKind::Device(device) => device_words(form, device),
        CardKind::Parameters(parameters) => {
            std::iter::once(word(".param")).chain(assignments(form, parameters)).collect()
        }
        CardKind::Model { name, kind, parameters } => {
            let mut words = vec![word(".model"), form.name(*name), format!("{kind}(")];
            words.extend(
                parameters.iter().map(|(key, expr)| format!("{key}={}", value(form, expr))),
            );
            words.push(word(")"));
            words
        }
        CardKind::Options(options) => std::iter::once(word(".options"))
            .chain(form.dialect.options.0.map(word))
            .chain(options.iter().map(|(key, value)| format!("{key}={value}")))
            .chain(form.dialect.options.1.iter().map(|more| word(more)))
            .collect(),
        CardKind::Global(nodes) => std::iter::once(word(".global"))
            .chain(nodes.iter().map(|node| form.name(*node)))
            .collect(),
        CardKind::Initial(values) | CardKind::Guess(values) => {
            std::iter::once(word(if matches!(kind, CardKind::Guess(_)) {
                ".nodeset"
            } else {
                ".ic"
            }))
            .chain(
                values
                    .iter()
                    .map(|(node, expr)| format!("v({})={}", form.name(*node), value(form, expr))),
            )
            .collect()
        }
        CardKind::Save { of, items } => {
            let saves = if *of == Print::Any { form.dialect.save } else { form.dialect.print };
            if saves.is_empty() {
                return vec![];
            }
            let mut words: Vec<String> =
                saves.replace("tran", of.word()).split(' ').map(word).collect();
            words.extend(items.iter().map(|(text, expr)| match text.contains('.') {
                true => form.expression(expr),
                false => text.clone(),
            }));
            words
        }
        CardKind::Transient { step, stop, start, hmax, uic } => {
            let mut words = vec![word(".tran"), value(form, step), value(form, stop)];
            if start.is_some() || hmax.is_some() {
                words.push(start.as_ref().map_or(word("0"), |start| value(form, start)));
            }
            words.extend(hmax.as_ref().map(|hmax| value(form, hmax)));
            words.extend(uic.then(|| word("uic")));
            words
        }
        CardKind::OperatingPoint => vec![word(".op")],
        CardKind::Fourier(fourier) => {
            let items = fourier.items.iter().map(|(text, expr)| match text.contains('.') {
                true => form.expression(expr),
                false => text.clone(),
            });
            [word(".four"), value(form, &fourier.frequency)].into_iter().chain(items).collect()
        }
        CardKind::Measure(measure) => vec![word(".measure"), measure.text.clone()],
        CardKind::Analysis(analysis) => form.spelling().analysis(analysis),
        CardKind::Step(sweeps) => form.spelling().sweeps(".step", sweeps),
        CardKind::Data(data) => form.spelling().data(data),
        CardKind::Comment(_)
        | CardKind::Subcircuit(_)
        | CardKind::Choice(_)
        | CardKind::Function(_) => vec![],
    }
}

fn device_words(form: Form, device: &Device) -> Vec<String> {
    let name = |name: &Name| form.name(*name);
    let full = name(&device.name);
    let behavioural = full.starts_with(['B', 'b']);
    let mut words = vec![full];
    words.extend(device.nodes.iter().map(name));
    let law = |key: &str, law: &Expr| {
        let key = if behavioural { key } else { "VALUE" };
        vec![format!("{key}={{{}}}", breakable(&form.expression(law)))]
    };
    let initial = |initial: &Option<Expr>| {
        initial.as_ref().map(|initial| format!("IC={}", value(form, initial)))
    };
    let state = |on: &Option<bool>| on.map(|on| if on { "ON" } else { "OFF" }.to_string());
    match &device.element {
        Element::Resistor { value } => words.push(size(form, "R", value)),
        Element::Capacitor { value, initial: ic } => {
            words.push(size(form, "C", value));
            words.extend(initial(ic));
        }
        Element::Inductor { value, initial: ic } => {
            words.push(size(form, "L", value));
            words.extend(initial(ic));
        }
        Element::Charge { law, initial: ic } => {
            words.push(format!("Q={{{}}}", breakable(&form.expression(law))));
            words.extend(initial(ic));
        }
        Element::Flux { law, initial: ic } => {
            words.push(format!("Flux={{{}}}", breakable(&form.expression(law))));
            words.extend(initial(ic));
        }
        Element::Passive(passive) => {
            let letter = passive.kind.model().to_uppercase();
            words.extend(passive.value.as_ref().map(|value| size(form, &letter, value)));
            words.extend(passive.model.as_ref().map(name));
            words.extend(keyed(form, &passive.parameters));
            words.extend(initial(&passive.initial));
        }
        Element::Mutual { inductors, coupling } => {
            words.extend(inductors.iter().map(name));
            words.push(value(form, coupling));
        }
        Element::VoltageSource(source) | Element::CurrentSource(source) => {
            words.extend(source_words(form, source));
        }
        Element::Vcvs { gain, control } | Element::Vccs { gain, control } => {
            words.extend(control.iter().map(name));
            words.push(value(form, gain));
        }
        Element::Cccs { gain, control } | Element::Ccvs { gain, control } => {
            words.push(name(control));
            words.push(value(form, gain));
        }
        Element::Line { impedance, delay, initial } => {
            words.push(format!("Z0={}", value(form, impedance)));
            words.push(format!("TD={}", value(form, delay)));
            words.extend(initial.as_ref().map(|initial| {
                let values: Vec<String> = initial.iter().map(|v| value(form, v)).collect();
                format!("IC={}", values.join(","))
            }));
        }
        Element::BehaviouralVoltage { law: expr } => words.extend(law("V", expr)),
        Element::BehaviouralCurrent { law: expr } => words.extend(law("I", expr)),
        Element::Switch { model, control, on } => {
            words.extend(control.iter().map(name));
            words.push(name(model));
            words.extend(state(on));
        }
        Element::CurrentSwitch { model, control, on } => {
            words.extend([name(control), name(model)]);
            words.extend(state(on));
        }
        Element::LawSwitch { model, control, on } => {
            words.push(name(model));
            words.extend(state(on));
            words.push(format!("CONTROL={{{}}}", breakable(&form.expression(control))));
        }
        Element::Diode { model, area, parameters } => {
            words.push(name(model));
            words.extend(area.as_ref().map(|area| value(form, area)));
            words.extend(keyed(form, parameters));
        }
        Element::Instance { subcircuit, parameters } => {
            words.push(name(subcircuit));
            words.extend(given(form, parameters));
        }
    }
    words
}

/// What an independent source says behind its nodes.
fn source_words(form: Form, source: &Source) -> Vec<String> {
    let mut words = vec![];
    match (&source.dc, &source.waveform) {
        (Some(dc), _) => words.extend(["DC".to_string(), value(form, dc)]),
        // What stands before `AC` is read as the value, with or without a word for it.
        (None, Waveform::Constant(constant)) => words.push(value(form, constant)),
        (None, _) => {}
    }
    if let Some([magnitude, phase]) = &source.ac {
        words.extend(["AC".to_string(), value(form, magnitude), value(form, phase)]);
    }
    let numbers = |arguments: &[Expr]| -> Vec<String> {
        arguments.iter().map(|argument| value(form, argument)).collect()
    };
    let option = |key: &str, expr: &Option<Expr>| {
        expr.as_ref().map(|expr| format!("{key}={}", value(form, expr)))
    };
    match &source.waveform {
        Waveform::Constant(_) => {}
        Waveform::Function { shape, arguments } => {
            let name = read::waveforms::row(*shape).name.to_uppercase();
            words.extend(called(&name, numbers(arguments)));
        }
        Waveform::Points { points, repeat, delay } => {
            words.extend(called("PWL", numbers(points)));
            words.extend(option("R", repeat));
            words.extend(option("TD", delay));
        }
        Waveform::Pattern { arguments, bits, repeat } => {
            let mut arguments = numbers(arguments);
            arguments.push(format!("b{bits}"));
            words.extend(called("PAT", arguments));
            words.extend(option("R", repeat));
        }
    }
    words
}

/// `NAME(a b c)`, word by word.
fn called(name: &str, mut arguments: Vec<String>) -> Vec<String> {
    match arguments.first_mut() {
        Some(first) => *first = format!("{name}({first}"),
        None => arguments.push(format!("{name}(")),
    }
    if let Some(last) = arguments.last_mut() {
        last.push(')');
    }
    arguments
}

/// The value of an R, C or L: a law after its letter, a number as it stands.
fn size(form: Form, letter: &str, expr: &Expr) -> String {
    match varies(expr) {
        true => format!("{letter}={{{}}}", breakable(&form.expression(expr))),
        false => value(form, expr),
    }
}

/// `key=value` of parameters.
fn keyed(form: Form, parameters: &[(String, Expr)]) -> Vec<String> {
    parameters.iter().map(|(key, expr)| format!("{key}={}", value(form, expr))).collect()
}

/// Parameters of a subcircuit.
fn given(form: Form, parameters: &[(Name, Expr)]) -> Vec<String> {
    let begin = (!parameters.is_empty()).then(|| "PARAMS:".to_string());
    begin.into_iter().chain(assignments(form, parameters)).collect()
}

fn assignments(form: Form, parameters: &[(Name, Expr)]) -> Vec<String> {
    parameters
        .iter()
        .map(|(name, expr)| format!("{}={}", form.name(*name), value(form, expr)))
        .collect()
}

/// A number as it is, anything else in braces.
fn value(form: Form, expr: &Expr) -> String {
    match expr.as_number() {
        Some(value) => number(value),
        None => format!("{{{}}}", form.expression(expr)),
    }
}

/// Stands in a word where a line may be broken without a blank.
const BREAK: char = '\u{1}';

/// An expression with breaks behind its operators.
fn breakable(text: &str) -> String {
    let mut marked = String::with_capacity(text.len() + 8);
    let mut before = ['\0'; 2];
    // v(a,b) stays whole.
    let mut voltage = false;
    for letter in text.chars() {
        marked.push(letter);
        let exponent = before[1].eq_ignore_ascii_case(&'e')
            && (before[0].is_ascii_digit() || before[0] == '.');
        match letter {
            '(' => voltage = before[1] == 'v' && !before[0].is_alphanumeric(),
            ')' => voltage = false,
            _ => {}
        }
        if matches!(letter, '*' | '/')
            || (letter == ',' && !voltage)
            || (matches!(letter, '+' | '-') && !exponent)
        {
            marked.push(BREAK);
        }
        before = [before[1], letter];
    }
    marked
}

/// Adds a card of words, broken into lines, with its comment; nothing of no words.
fn line(text: &mut String, words: &[String], comment: Option<&str>, comments: Comments) {
    if words.is_empty() {
        return;
    }
    let mut lines: Vec<String> = vec![String::new()];
    for word in words.iter().flat_map(|word| word.split(' ')) {
        for (index, piece) in word.split(BREAK).enumerate() {
            let Some(last) = lines.last_mut() else { continue };
            let blank = usize::from(index == 0 && !last.is_empty());
            if last.is_empty() || last.len() + blank + piece.len() < WIDTH {
                last.extend(std::iter::repeat_n(' ', blank));
                last.push_str(piece);
            } else {
                lines.push(format!("+ {piece}"));
            }
        }
    }
    let comment = comment.map(|comment| comment.replace(['\n', '\r'], " "));
    match (comment, lines.as_mut_slice()) {
        (None, _) => {}
        (Some(comment), [only])
            if comments == Comments::Behind && only.len() + 3 + comment.chars().count() < WIDTH =>
        {
            let column = if words.first().is_some_and(|word| word == ".param") {
                PARAMETER_COMMENT
            } else {
                COMMENT
            };
            let column = if column + 3 + comment.chars().count() < WIDTH { column } else { 0 };
            *only = format!("{only:<column$} ; {comment}");
        }
        (Some(comment), _) => text.push_str(&format!("* {comment}\n")),
    }
    for line in lines {
        text.push_str(&line);
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::Shape;
    use crate::source::Span;

    fn number(value: f64) -> Expr {
        Expr::number(value)
    }

    fn netlist() -> Netlist {
        let mut names = Names::default();
        let [a, b, r, v, e, p] = ["a", "b", "R_1", "V_1", "E_1", "Rload"].map(|n| names.intern(n));
        let ground = names.intern("0");
        let device = |name, nodes: [Name; 2], element, comment: &str| Card {
            kind: CardKind::Device(Device { name, nodes: nodes.as_slice().into(), element }),
            span: Span::NONE,
            comment: (!comment.is_empty()).then(|| comment.to_string()),
        };
        let voltage = Expr::leaf(Leaf::Voltage(a, Some(b)));
        let term = voltage.binary(crate::expr::Binary::Multiply, Expr::leaf(Leaf::Current(v)));
        let law =
            (0..9).fold(number(1.0), |sum, _| sum.binary(crate::expr::Binary::Add, term.clone()));
        Netlist {
            title: "a test".into(),
            header: vec![("hmax".into(), "auto".into())],
            cards: vec![
                Card {
                    kind: CardKind::Parameters(vec![(p, number(5e-12))]),
                    span: Span::NONE,
                    comment: Some("x.bg:1 load".into()),
                },
                device(
                    v,
                    [a, ground],
                    Element::VoltageSource(
                        Waveform::Function {
                            shape: Shape::Pwl,
                            arguments: vec![number(0.0), number(1.0)],
                        }
                        .into(),
                    ),
                    "",
                ),
                device(
                    r,
                    [a, b],
                    Element::Resistor { value: Expr::leaf(Leaf::Parameter(p)) },
                    "x.bg:2 R:1",
                ),
                device(e, [b, ground], Element::BehaviouralVoltage { law }, "x.bg:3 R:2"),
                Card {
                    kind: CardKind::Transient {
                        step: number(1e-3),
                        stop: number(1.0),
                        start: None,
                        hmax: Some(number(1e-4)),
                        uic: true,
                    },
                    span: Span::NONE,
                    comment: None,
                },
            ],
            names,
            ..Netlist::default()
        }
    }

    #[test]
    fn cards_as_an_engineer_writes_them() {
        insta::assert_snapshot!(write(&netlist()));
    }

    #[test]
    fn lines_are_short() {
        assert!(write(&netlist()).lines().all(|line| line.chars().count() < WIDTH));
    }
}
