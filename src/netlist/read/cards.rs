//! Cards that begin with a dot, but those that hold others (`blocks`) or name files (`pile`).

use super::options::options;
use super::{Cursor, Reader, analyses};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::netlist::analysis::Print;
use crate::netlist::{CardKind, Definition, Expr, Leaf, Name, Subcircuit};
use crate::quantity::nearest;
use crate::source::Span;

/// What becomes of a card.
pub enum Treatment {
    /// It is read.
    Read(fn(&mut Reader, &mut Cursor) -> Option<CardKind>),
    /// It is skipped with a warning, for a reason.
    Skipped(&'static str),
    /// It is an error, for a reason.
    Refused(&'static str),
}

use Treatment::{Read, Refused, Skipped};

const ANALYSIS: &str = "this analysis is not computed";
const RESULT: &str = "it only asks for a result that is not computed here";

/// Every card but those that the reader itself knows.
#[rustfmt::skip]
pub const CARDS: &[(&str, Treatment)] = &[
    ("param", Read(parameters)),
    ("params", Read(parameters)),
    ("global_param", Read(parameters)),
    ("model", Read(model)),
    ("options", Read(options)),
    ("option", Read(options)),
    ("opt", Read(options)),
    ("ic", Read(|reader, cursor| Some(CardKind::Initial(voltages(reader, cursor)?)))),
    ("dcvolt", Read(|reader, cursor| Some(CardKind::Initial(voltages(reader, cursor)?)))),
    ("initcond", Read(|reader, cursor| Some(CardKind::Initial(voltages(reader, cursor)?)))),
    ("nodeset", Read(|reader, cursor| Some(CardKind::Guess(voltages(reader, cursor)?)))),
    ("func", Read(function)),
    ("global", Read(global)),
    ("temp", Read(temperature)),
    ("preprocess", Read(preprocess)),
    // How a schematic is to show its results.
    ("backanno", Read(|_, _| None)),
    ("save", Read(|reader, cursor| save(reader, cursor, false))),
    ("print", Read(|reader, cursor| save(reader, cursor, true))),
    ("tran", Read(transient)),
    ("op", Read(|_, _| Some(CardKind::OperatingPoint))),
    ("dc", Read(analyses::dc)),
    ("ac", Read(analyses::ac)),
    ("tf", Read(analyses::transfer)),
    ("pz", Read(analyses::pole_zero)),
    ("sens", Read(super::sensitivity::sensitivity)),
    ("step", Read(analyses::step)),
    ("data", Read(analyses::data)),
    ("enddata", Read(|_, _| None)),
    ("plot", Skipped(RESULT)),
    ("probe", Skipped(RESULT)),
    ("four", Read(super::fourier::fourier)),
    ("meas", Read(super::measure::measure)),
    ("measure", Read(super::measure::measure)),
    ("width", Skipped("it lays out another simulator's print")),
    ("noise", Refused(ANALYSIS)),
    ("disto", Refused(ANALYSIS)),
    ("hb", Refused(ANALYSIS)),
    ("pss", Refused(ANALYSIS)),
    ("csparam", Refused("it belongs to ngspice's command language")),
];

/// The cards that the reader itself knows.
const OTHERS: &[&str] = &[
    "subckt", "ends", "if", "elseif", "else", "endif", "include", "inc", "lib", "endl", "end",
    "control", "title",
];

/// The card of a line, whose keyword has been read.
pub fn card(reader: &mut Reader, cursor: &mut Cursor, span: Span) -> Option<CardKind> {
    let keyword = cursor.text[1..cursor.at].trim().to_lowercase();
    let place = cursor.span(reader, 0, cursor.at.max(1));
    match CARDS.iter().find(|(name, _)| *name == keyword) {
        Some((_, Read(read))) => {
            let kind = read(reader, cursor)?;
            reader.leftover(cursor);
            Some(kind)
        }
        Some((name, Skipped(why))) => {
            reader.diagnostics.push(
                Diagnostic::warning("W0703", span, format!("`.{name}` is skipped")).because(*why),
            );
            None
        }
        Some((name, Refused(why))) => {
            let error =
                Diagnostic::error("E0702", place, format!("`.{name}` is not read")).because(*why);
            reader.diagnostics.push(error);
            None
        }
        None => {
            let error = Diagnostic::error("E0701", place, format!("unknown card `.{keyword}`"));
            let known = CARDS.iter().map(|(name, _)| *name).chain(OTHERS.iter().copied());
            reader.diagnostics.push(match nearest(&keyword, known) {
                Some(name) => error.help(format!("did you mean `.{name}`?")),
                None => error,
            });
            None
        }
    }
}

/// `.subckt name ports … [params:] [parameter=default …]`.
pub fn subcircuit(reader: &mut Reader, cursor: &mut Cursor) -> Option<Subcircuit> {
    let word = cursor.word();
    let mut ports = vec![];
    while cursor.clone().key().is_none() {
        let (word, _) = cursor.node();
        if word.is_empty() || word.eq_ignore_ascii_case("params:") {
            break;
        }
        ports.push(reader.node_name(word));
    }
    let mut parameters = vec![];
    while let Some(key) = cursor.key() {
        match reader.value(cursor, "the default of the parameter") {
            Some(value) => parameters.push((reader.name(key), value)),
            None => break,
        }
    }
    reader.leftover(cursor);
    // Even one without a name is opened, so that its `.ends` closes it.
    if word.0.is_empty() {
        reader.missing(cursor, "the name of the subcircuit");
    }
    Some(Subcircuit { name: reader.name(word), ports, parameters, cards: vec![] })
}

/// `.param name=value name={expression} f(x)={expression} …`; a value may also be an expression with blanks, up to the
/// next `name=`.
fn parameters(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let mut parameters = vec![];
    let mut functions = false;
    while !cursor.is_done() {
        let Some(key) = cursor.key() else {
            let mut ahead = *cursor;
            let word = ahead.word();
            if !word.0.is_empty() && ahead.peek() == Some(b'(') {
                *cursor = ahead;
                let definition = definition(reader, cursor, word)?;
                reader.functions.push(definition);
                functions = true;
                continue;
            }
            let (word, from) = cursor.word();
            let span = cursor.span(reader, from, from + word.len().max(1));
            let error = Diagnostic::error("E0703", span, "`name=value` is missing");
            reader.diagnostics.push(error);
            cursor.at = cursor.text.len();
            return None;
        };
        let name = reader.name(key);
        let value = assigned(reader, cursor);
        parameters.push((name, value?));
    }
    if parameters.is_empty() && !functions {
        reader.missing(cursor, "`name=value`");
        return None;
    }
    (!parameters.is_empty()).then_some(CardKind::Parameters(parameters))
}

/// The value behind `name=`, up to the next `name=`.
fn assigned(reader: &mut Reader, cursor: &mut Cursor) -> Option<Expr> {
    cursor.blanks();
    let (from, to) = (cursor.at, before_next_key(cursor));
    cursor.at = to;
    let text = cursor.text[from..to].trim_end_matches([' ', '\t', ',']);
    reader.grouped(cursor, from, from + text.len())
}

/// `.func name(x, y) {expression}`.
fn function(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let word = cursor.word();
    if word.0.is_empty() {
        reader.missing(cursor, "the name of the function");
        return None;
    }
    cursor.blanks();
    let definition = definition(reader, cursor, word)?;
    Some(CardKind::Function(definition))
}

/// Arguments in brackets, perhaps `=`, and the value of a function.
fn definition(reader: &mut Reader, cursor: &mut Cursor, word: (&str, usize)) -> Option<Definition> {
    let span = cursor.span(reader, word.1, word.1 + word.0.len());
    if !cursor.take(b'(') {
        reader.missing(cursor, "a list of arguments, `(x, y)`,");
        return None;
    }
    let mut arguments: Vec<&str> = vec![];
    while !cursor.take(b')') {
        let (argument, _) = cursor.word();
        if argument.is_empty() {
            reader.missing(cursor, "`)`");
            return None;
        }
        arguments.push(argument);
    }
    cursor.take(b'=');
    let name = reader.name(word);
    let before = reader.calls.len();
    let body = assigned(reader, cursor)?;
    // Names that nobody else has, so that nothing else is taken for an argument.
    let own: Vec<(Name, Name)> = arguments
        .iter()
        .map(|argument| {
            let unique = format!("{argument}\u{2}{}", span.start);
            (reader.names.intern(argument), reader.names.intern(&unique))
        })
        .collect();
    let body = reader.calls.rename(before, &body, &own);
    reader.defined = true;
    Some(Definition { name, arguments: own.into_iter().map(|(_, own)| own).collect(), body, span })
}

/// `.global node …`.
fn global(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let mut nodes = vec![];
    while !cursor.is_done() {
        nodes.push(reader.node(cursor, "a node")?);
    }
    if nodes.is_empty() {
        reader.missing(cursor, "a node");
        return None;
    }
    Some(CardKind::Global(nodes))
}

/// `.temp celsius`.
fn temperature(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let value = reader.value(cursor, "the temperature in °C")?;
    let Some(celsius) = value.constant() else {
        let error = Diagnostic::error("E0732", value.span, "the temperature must be a number");
        reader.diagnostics.push(error);
        return None;
    };
    if !cursor.is_done() {
        let span = cursor.here(reader);
        let warning = Diagnostic::warning("W0703", span, "only the first temperature is run");
        reader.diagnostics.push(warning.help("a list of them: .step temp list 27 85"));
        cursor.at = cursor.text.len();
    }
    Some(CardKind::Options(vec![("temp".into(), crate::netlist::plain(celsius))]))
}

/// `.preprocess replaceground true`, which has been seen to; what else it asks for changes no value.
fn preprocess(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let (what, from) = cursor.word();
    let span = cursor.span(reader, from, from + what.len().max(1));
    cursor.at = cursor.text.len();
    if !["replaceground", "removeunused"].iter().any(|known| known.eq_ignore_ascii_case(what)) {
        let message = format!("`.preprocess {what}` is skipped");
        let warning = Diagnostic::warning("W0703", span, message);
        reader
            .diagnostics
            .push(warning.because("nodes without a path to ground are dealt with anyway"));
    }
    None
}

/// Where a value ends that the next `name=` follows, or the line's end.
fn before_next_key(cursor: &Cursor) -> usize {
    let bytes = cursor.text.as_bytes();
    let (mut depth, mut quoted) = (0i32, false);
    for at in cursor.at..bytes.len() {
        match bytes[at] {
            b'\'' => quoted = !quoted,
            b'(' | b'{' => depth += 1,
            b')' | b'}' => depth -= 1,
            b'=' if depth <= 0 && !quoted => {
                let compares = bytes.get(at + 1) == Some(&b'=')
                    || matches!(bytes[at - 1], b'=' | b'<' | b'>' | b'!');
                if !compares {
                    let before = cursor.text[cursor.at..at].trim_end();
                    // `f(x, y)=` is a key, too.
                    let name = match before.strip_suffix(')').and_then(|_| before.rfind('(')) {
                        Some(open) => before[..open].trim_end(),
                        None => before,
                    };
                    let word =
                        name.rfind(|c: char| c.is_whitespace() || c == ',').map_or(0, |k| k + 1);
                    // A key that follows a value without a blank is no key: the expression is wrong, and says so.
                    return if word == 0 { bytes.len() } else { cursor.at + word };
                }
            }
            _ => {}
        }
    }
    bytes.len()
}

/// `.model name type(key=value …)`, the brackets being optional.
fn model(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let word = cursor.word();
    if word.0.is_empty() {
        reader.missing(cursor, "the name of the model");
        return None;
    }
    let name = reader.name(word);
    cursor.loose();
    let (kind, _) = cursor.word();
    if kind.is_empty() {
        reader.missing(cursor, "the type of the model");
        return None;
    }
    let mut parameters = vec![];
    while let Some((key, _)) = cursor.key() {
        let value = reader.value(cursor, "the value of the parameter")?;
        parameters.push((key.to_lowercase(), value));
    }
    cursor.loose();
    Some(CardKind::Model { name, kind: kind.to_lowercase(), parameters })
}

/// `.ic v(node)=value …`, or `node value …`.
fn voltages(reader: &mut Reader, cursor: &mut Cursor) -> Option<Vec<(Name, Expr)>> {
    let mut values = vec![];
    while !cursor.is_done() {
        let here = cursor.here(reader);
        let (word, from) = cursor.word();
        let bracket = cursor.take(b'(');
        if !word.eq_ignore_ascii_case("v") || !bracket {
            let mut pair = *cursor;
            let value = pair.next_word();
            let number = super::number::number(value, reader.reading.numbers);
            if !bracket && !word.is_empty() && number.is_some_and(|n| n.end == value.len()) {
                let node = reader.node_name(word);
                values.push((node, reader.value(&mut pair, "the value")?));
                *cursor = pair;
                continue;
            }
            let span =
                if word.is_empty() { here } else { cursor.span(reader, from, from + word.len()) };
            let error = Diagnostic::error("E0703", span, "`v(node)=value` is missing")
                .help("currents of inductors start at the `ic=` of their cards");
            reader.diagnostics.push(error);
            return None;
        }
        let node = reader.node(cursor, "the node")?;
        let closed = cursor.take(b')') && cursor.take(b'=');
        if !closed {
            reader.missing(cursor, "`)=`");
            return None;
        }
        values.push((node, reader.value(cursor, "the value")?));
    }
    Some(values)
}

/// `.tran step stop [start [hmax]] [uic]`.
fn transient(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let (mut values, mut uic) = (vec![], false);
    while !cursor.is_done() {
        let word = cursor.next_word();
        if ["uic", "noop"].iter().any(|start| start.eq_ignore_ascii_case(word)) {
            cursor.word();
            uic = true;
        } else if values.len() < 4 {
            values.push(reader.value(cursor, "a time")?);
        } else {
            break;
        }
    }
    if values.len() == 1 && reader.dialect.name == "ltspice" {
        // `.tran stop`
        values.insert(0, Expr::number(0.0));
    }
    let mut values = values.into_iter();
    let (Some(step), Some(stop)) = (values.next(), values.next()) else {
        reader.missing(cursor, "the step or the end of `.tran step stop [start [hmax]] [uic]`");
        return None;
    };
    Some(CardKind::Transient { step, stop, start: values.next(), hmax: values.next(), uic })
}

/// How Xyce's `.print` says where columns go and what they look like.
const LAYOUT: &[&str] =
    &["format", "file", "width", "precision", "delimiter", "filter", "timescalefactor", "index"];

/// `.save v(a) i(l1) {expression} node …`; `.print tran …`. No items at all mean everything.
fn save(reader: &mut Reader, cursor: &mut Cursor, print: bool) -> Option<CardKind> {
    let mut of = Print::Any;
    if print {
        let (kind, _) = cursor.word();
        let Some(known) = analyses::print(kind) else {
            let span = cursor.span(reader, 0, cursor.at);
            let warning = Diagnostic::warning("W0703", span, format!("`.print {kind}` is skipped"))
                .because(ANALYSIS);
            reader.diagnostics.push(warning);
            cursor.at = cursor.text.len();
            return None;
        };
        of = known;
    }
    let (mut items, mut all) = (vec![], false);
    while !cursor.is_done() {
        let mut ahead = *cursor;
        if ahead.key().is_some_and(|(key, _)| LAYOUT.contains(&key.to_lowercase().as_str())) {
            ahead.word();
            *cursor = ahead;
            continue;
        }
        let from = cursor.at;
        let to = end_of_item(cursor);
        cursor.at = to;
        let text = &cursor.text[from..to];
        if text.eq_ignore_ascii_case("all") {
            all = true;
            continue;
        }
        items.push(item(reader, cursor, from, to)?);
    }
    Some(CardKind::Save { of, items: if all { vec![] } else { items } })
}

/// The items up to the end of the card.
pub fn items(reader: &mut Reader, cursor: &mut Cursor) -> Option<Vec<(String, Expr)>> {
    let mut items = vec![];
    while !cursor.is_done() {
        let from = cursor.at;
        cursor.at = end_of_item(cursor);
        items.push(item(reader, cursor, from, cursor.at)?);
    }
    Some(items)
}

/// Items end at blanks outside brackets and braces.
pub fn end_of_item(cursor: &Cursor) -> usize {
    let mut depth = 0i32;
    for (at, byte) in cursor.text.bytes().enumerate().skip(cursor.at) {
        match byte {
            b'(' | b'{' => depth += 1,
            b')' | b'}' => depth -= 1,
            b' ' | b'\t' | b'\r' if depth <= 0 => return at,
            _ => {}
        }
    }
    cursor.text.trim_end().len().max(cursor.at)
}

/// One item: how it is written, and what it means. `node` is v(node), `v1#branch` is i(v1), `@r1[i]` is i(r1).
pub fn item(
    reader: &mut Reader,
    cursor: &mut Cursor,
    from: usize,
    to: usize,
) -> Option<(String, Expr)> {
    let text = &cursor.text[from..to];
    let span = cursor.span(reader, from, to);
    let current = text.strip_suffix("#branch").or_else(|| {
        let (device, quantity) = text.strip_prefix('@')?.strip_suffix(']')?.split_once('[')?;
        matches!(quantity.to_ascii_lowercase().as_str(), "i" | "id" | "current").then_some(device)
    });
    if let Some(device) = current {
        let leaf = Leaf::Current(reader.names.intern(device));
        return Some((format!("i({device})"), Expr::new(Node::Leaf(leaf), span)));
    }
    if text.starts_with(|c: char| c.is_alphanumeric() || c == '_')
        && !text.contains(['(', ')', '{', '*', '/', ','])
    {
        // A node, or a parameter: that is known when all nodes are.
        let leaf = Leaf::Parameter(reader.names.intern(text));
        return Some((text.to_string(), Expr::new(Node::Leaf(leaf), span)));
    }
    if let Some(leaf) = analyses::reading(&mut reader.names, &reader.reading, text) {
        let name = text.split_whitespace().collect::<String>();
        return Some((name, Expr::new(Node::Leaf(leaf), span)));
    }
    // ngspice: par('expression').
    let quoted = text.get(..5).filter(|head| head.eq_ignore_ascii_case("par('"));
    let (from, to) = match quoted {
        Some(_) if text.ends_with("')") => (from + 5, to - 2),
        _ => (from, to),
    };
    let expr = reader.output(cursor, from, to)?;
    let name = cursor.text[from..to].split_whitespace().collect::<String>();
    Some((name, expr))
}
