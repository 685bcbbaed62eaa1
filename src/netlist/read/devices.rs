//! Device cards, by their first letter.

use super::{Cursor, Reader, linked, passive, waveforms};
use crate::diagnostic::Diagnostic;
use crate::netlist::{Device, Element, Expr, Name, Nodes, PassiveKind};

/// One row of the table: a letter, the number of nodes that its card names first, and what follows them.
pub struct Letter {
    /// The first letter of its names, in upper case.
    pub letter: u8,
    /// How many nodes; 0 where the card itself says.
    pub nodes: usize,
    /// How a card goes, for messages.
    pub form: &'static str,
    read: fn(&mut Reader, &mut Cursor, &mut Nodes<Name>) -> Option<Element>,
}

/// Every letter that is read.
#[rustfmt::skip]
pub const LETTERS: &[Letter] = &[
    Letter { letter: b'R', nodes: 2, form: "Rname n+ n- value [model] [tc1=… tc2=… m=…], or R={expression}", read: |r, c, n| passive::read(r, c, n, PassiveKind::Resistor) },
    Letter { letter: b'C', nodes: 2, form: "Cname n+ n- value [model] [ic=volts], or C={expression}, Q={expression}", read: |r, c, n| passive::read(r, c, n, PassiveKind::Capacitor) },
    Letter { letter: b'L', nodes: 2, form: "Lname n+ n- value [model] [ic=amperes], or L={expression}, Flux={expression}", read: |r, c, n| passive::read(r, c, n, PassiveKind::Inductor) },
    Letter { letter: b'K', nodes: 0, form: "Kname L1 L2 … coupling", read: mutual },
    Letter { letter: b'V', nodes: 2, form: "Vname n+ n- [[DC] value] [AC magnitude phase] [PULSE(…) | SIN(…) | PWL(…) | EXP(…) | SFFM(…) | AM(…) | PAT(…)]", read: |r, c, _| Some(Element::VoltageSource(Box::new(waveforms::source(r, c)?))) },
    Letter { letter: b'I', nodes: 2, form: "Iname n+ n- [[DC] value] [AC magnitude phase] [PULSE(…) | SIN(…) | PWL(…) | EXP(…) | SFFM(…) | AM(…) | PAT(…)]", read: |r, c, _| Some(Element::CurrentSource(Box::new(waveforms::source(r, c)?))) },
    Letter { letter: b'E', nodes: 2, form: "Ename n+ n- c+ c- gain, or VALUE={expression}, POLY(n) …, TABLE {x} = (x,y) …, LAPLACE {x} = {H(s)}", read: linked::vcvs },
    Letter { letter: b'G', nodes: 2, form: "Gname n+ n- c+ c- gain, or VALUE={expression}, POLY(n) …, TABLE {x} = (x,y) …, LAPLACE {x} = {H(s)}", read: linked::vccs },
    Letter { letter: b'F', nodes: 2, form: "Fname n+ n- device gain, or POLY(n) device … coefficients", read: linked::cccs },
    Letter { letter: b'H', nodes: 2, form: "Hname n+ n- device gain, or POLY(n) device … coefficients", read: linked::ccvs },
    Letter { letter: b'B', nodes: 2, form: "Bname n+ n- V=expression, or I=expression", read: linked::behavioural },
    Letter { letter: b'S', nodes: 2, form: "Sname n+ n- c+ c- model [ON | OFF], or model [ON | OFF] CONTROL={expression}", read: switch },
    Letter { letter: b'W', nodes: 2, form: "Wname n+ n- device model [ON | OFF]", read: current_switch },
    Letter { letter: b'T', nodes: 2, form: "Tname a+ a- b+ b- Z0=ohms TD=seconds, or F=hertz [NL=lengths]; [IC=v1,i1,v2,i2]", read: line },
    Letter { letter: b'D', nodes: 2, form: "Dname anode cathode model [area] [pj=… m=… temp=…]", read: diode },
    Letter { letter: b'X', nodes: 0, form: "Xname nodes … subcircuit [parameter=value …]", read: instance },
];

/// Letters of SPICE that are not read, and what they stand for.
#[rustfmt::skip]
pub const OTHER_LETTERS: &[(u8, &str)] = &[
    (b'A', "an XSPICE code model"), (b'J', "a junction field-effect transistor"), (b'M', "a MOS transistor"),
    (b'N', "a Verilog-A device"), (b'O', "a lossy transmission line"), (b'P', "a coupled transmission line"),
    (b'Q', "a bipolar transistor"), (b'U', "an RC line or a digital device"),
    (b'Y', "a lossy transmission line"), (b'Z', "a MESFET"),
];

/// The device of a line.
pub fn device(reader: &mut Reader, cursor: &mut Cursor) -> Option<Device> {
    let (name, from) = cursor.word();
    let span = cursor.span(reader, from, from + name.len().max(1));
    let Some(first) = name.bytes().next().map(|byte| byte.to_ascii_uppercase()) else {
        let letter = cursor.text.chars().next().unwrap_or(' ');
        let span = cursor.span(reader, 0, letter.len_utf8());
        let error = Diagnostic::error("E0701", span, format!("no card begins with `{letter}`"));
        reader.diagnostics.push(error);
        return None;
    };
    let Some(row) = LETTERS.iter().find(|row| row.letter == first) else {
        let error = match OTHER_LETTERS.iter().find(|(letter, _)| *letter == first) {
            Some((_, what)) => Diagnostic::error(
                "E0702",
                span,
                format!("`{name}` is {what}, which is not read yet"),
            )
            .because("a card's first letter says what it is")
            .help("devices that are read: R L C K V I E F G H B S W T D X"),
            None if first == b'+' => {
                Diagnostic::error("E0701", span, "there is no line to continue")
            }
            None => {
                let letter = name.chars().next().unwrap_or(' ');
                Diagnostic::error("E0701", span, format!("no card begins with `{letter}`"))
            }
        };
        reader.diagnostics.push(error);
        return None;
    };
    let before = reader.diagnostics.len();
    let element = element(reader, cursor, row);
    let (Some((nodes, element)), false) =
        (element, crate::diagnostic::has_errors(&reader.diagnostics[before..]))
    else {
        if let Some(error) = reader.diagnostics[before..].first_mut()
            && error.help.is_none()
        {
            error.help = Some(row.form.to_string());
        }
        return None;
    };
    let name = reader.names.intern(name);
    Some(Device { name, nodes, element })
}

fn element(
    reader: &mut Reader,
    cursor: &mut Cursor,
    row: &Letter,
) -> Option<(Nodes<Name>, Element)> {
    let mut nodes = Nodes::new();
    for k in 0..row.nodes {
        nodes.push(reader.node(cursor, if k == 0 { "the first node" } else { "the second node" })?);
    }
    let element = (row.read)(reader, cursor, &mut nodes)?;
    reader.leftover(cursor);
    Some((nodes, element))
}

fn mutual(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    let mut inductors = vec![];
    while cursor.next_word().starts_with(['l', 'L', 'x', 'X']) {
        let (word, at) = cursor.word();
        let named = Cursor { at, ..*cursor };
        // `K1 L1 L2 lk`: a parameter may begin with an l, but it comes last.
        if inductors.len() >= 2 && cursor.is_done() {
            *cursor = named;
            break;
        }
        inductors.push(reader.name((word, at)));
    }
    if inductors.len() < 2 {
        reader.missing(cursor, "the name of an inductor");
        return None;
    }
    let coupling = reader.value(cursor, "the coupling")?;
    Some(Element::Mutual { inductors, coupling })
}

fn model(reader: &mut Reader, cursor: &mut Cursor) -> Option<Name> {
    let word = cursor.node();
    if word.0.is_empty() {
        reader.missing(cursor, "the name of the model");
        return None;
    }
    Some(reader.name(word))
}

fn state(cursor: &mut Cursor) -> Option<bool> {
    let word = cursor.next_word();
    let on = match () {
        () if word.eq_ignore_ascii_case("on") => Some(true),
        () if word.eq_ignore_ascii_case("off") => Some(false),
        () => None,
    };
    if on.is_some() {
        cursor.word();
    }
    on
}

/// `c+ c- model`, or `model CONTROL={expression}`; ON or OFF anywhere behind.
fn switch(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    if let Some(element) = law_switch(reader, cursor)? {
        return Some(element);
    }
    let first = reader.node(cursor, "the first controlling node")?;
    let second = reader.node(cursor, "the second controlling node")?;
    Some(Element::Switch {
        model: model(reader, cursor)?,
        control: [first, second],
        on: state(cursor),
    })
}

fn current_switch(
    reader: &mut Reader,
    cursor: &mut Cursor,
    _: &mut Nodes<Name>,
) -> Option<Element> {
    if let Some(element) = law_switch(reader, cursor)? {
        return Some(element);
    }
    let control = linked::control(reader, cursor)?;
    Some(Element::CurrentSwitch { model: model(reader, cursor)?, control, on: state(cursor) })
}

/// A switch by an expression, if the card has one.
fn law_switch(reader: &mut Reader, cursor: &mut Cursor) -> Option<Option<Element>> {
    let mut ahead = *cursor;
    let mut words = 0;
    while words < 3 && ahead.clone().key().is_none() && !ahead.is_done() {
        ahead.node();
        words += 1;
    }
    if !ahead.key().is_some_and(|(key, _)| key.eq_ignore_ascii_case("control")) {
        return Some(None);
    }
    let model = model(reader, cursor)?;
    let before = state(cursor);
    cursor.key();
    let control = passive::law(reader, cursor, "the expression")?;
    let on = before.or(state(cursor));
    Some(Some(Element::LawSwitch { model, control, on }))
}

/// Z0 and TD, or F and NL (a quarter of a wave where it is left out): TD = NL/F.
fn line(reader: &mut Reader, cursor: &mut Cursor, nodes: &mut Nodes<Name>) -> Option<Element> {
    for what in ["the third node", "the fourth node"] {
        nodes.push(reader.node(cursor, what)?);
    }
    let (mut impedance, mut delay, mut frequency, mut lengths) = (None, None, None, None);
    let mut initial = None;
    while !cursor.is_done() {
        let span = cursor.here(reader);
        let Some((word, _)) = cursor.key() else { break };
        match word.to_ascii_lowercase().as_str() {
            "z0" | "zo" => impedance = Some(reader.value(cursor, "the impedance")?),
            "td" => delay = Some(reader.value(cursor, "the delay")?),
            "f" => frequency = Some(reader.value(cursor, "the frequency")?),
            "nl" => lengths = Some(reader.value(cursor, "the length in wavelengths")?),
            "ic" => {
                let mut values = vec![];
                for _ in 0..4 {
                    cursor.loose();
                    values.push(reader.value(cursor, "an initial value")?);
                }
                initial = <[Expr; 4]>::try_from(values).ok().map(Box::new);
                cursor.loose();
            }
            other => {
                let message = format!("`{other}=` of a line is not read");
                reader.diagnostics.push(Diagnostic::error("E0704", span, message));
                return None;
            }
        }
    }
    if impedance.is_none() {
        reader.missing(cursor, "the impedance `Z0=`");
    }
    let by_length = frequency.map(|f| {
        let lengths = lengths.unwrap_or(Expr::number(0.25));
        lengths.binary(crate::expr::Binary::Divide, f)
    });
    if delay.is_none() && by_length.is_none() {
        reader.missing(cursor, "the delay `TD=`, or `F=`");
    }
    Some(Element::Line { impedance: impedance?, delay: delay.or(by_length)?, initial })
}

fn diode(reader: &mut Reader, cursor: &mut Cursor, _: &mut Nodes<Name>) -> Option<Element> {
    let model = model(reader, cursor)?;
    let (mut area, mut parameters) = (None, vec![]);
    while !cursor.is_done() {
        let span = cursor.here(reader);
        let key = cursor.key().map(|(word, _)| word.to_ascii_lowercase());
        match key.as_deref() {
            Some("area") => area = Some(reader.value(cursor, "the area")?),
            Some(key @ ("pj" | "m" | "temp" | "dtemp" | "ic")) => {
                let value = reader.value(cursor, "the value of the parameter")?;
                parameters.push((key.to_string(), value));
            }
            Some(other) => {
                let message = format!("`{other}=` of a diode is not read");
                reader.diagnostics.push(Diagnostic::error("E0704", span, message));
                return None;
            }
            // `OFF` is a hint for the operating point.
            None if cursor.next_word().eq_ignore_ascii_case("off") => {
                cursor.word();
            }
            None if area.is_none() => area = Some(reader.value(cursor, "the area")?),
            None => break,
        }
    }
    Some(Element::Diode { model, area, parameters })
}

fn instance(reader: &mut Reader, cursor: &mut Cursor, nodes: &mut Nodes<Name>) -> Option<Element> {
    let mut words = vec![];
    loop {
        let mut ahead = *cursor;
        if ahead.key().is_some() {
            break;
        }
        let (word, from) = ahead.node();
        if word.is_empty() {
            break;
        }
        *cursor = ahead;
        if word.eq_ignore_ascii_case("params:") {
            break;
        }
        words.push((word, from));
    }
    let Some(subcircuit) = words.pop() else {
        reader.missing(cursor, "the name of the subcircuit");
        return None;
    };
    for (word, _) in words {
        nodes.push(reader.node_name(word));
    }
    let subcircuit = reader.name(subcircuit);
    let mut parameters = vec![];
    while let Some(key) = cursor.key() {
        let value = reader.value(cursor, "the value of the parameter")?;
        parameters.push((reader.name(key), value));
    }
    Some(Element::Instance { subcircuit, parameters })
}
