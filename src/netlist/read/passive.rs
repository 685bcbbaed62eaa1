//! R, C and L: a value or a law, a model, parameters of their own.

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::netlist::parts::map_leaves;
use crate::netlist::{Element, Expr, Leaf, Name, Passive, PassiveKind};

/// Parameters that a card may say; what they mean is told in `flatten/passive.rs`.
const KEYS: &[&str] = &["l", "w", "tc1", "tc2", "temp", "dtemp", "m", "scale", "age", "d"];
/// Those that matter in noise analysis alone, or for a waveform's looks.
const IDLE: &[&str] = &["noisy", "noise"];

/// The card of a passive device, behind its nodes.
pub fn read(
    reader: &mut Reader,
    cursor: &mut Cursor,
    nodes: &[Name],
    kind: PassiveKind,
) -> Option<Element> {
    let what = match kind {
        PassiveKind::Resistor => "the resistance",
        PassiveKind::Capacitor => "the capacitance",
        PassiveKind::Inductor => "the inductance",
    };
    let own = Cursor { at: 0, ..*cursor }.word();
    let (mut words, mut parameters) = (vec![], vec![]);
    let (mut value, mut initial, mut stored) = (None, None, None);
    while !cursor.is_done() {
        let here = *cursor;
        let Some((word, from)) = cursor.key() else {
            // Behind a number only the name of a model may stand.
            let named = cursor.next_word().starts_with(|c: char| c.is_alphabetic() || c == '_');
            let full = match words.as_slice() {
                [] => false,
                [first] => name(first).is_none() && !named,
                _ => true,
            };
            if full {
                *cursor = here;
                break;
            }
            words.push(reader.value(cursor, what)?);
            continue;
        };
        let key = word.to_ascii_lowercase();
        match key.as_str() {
            _ if key == kind.model() => value = Some(law(reader, cursor, what)?),
            "q" if kind == PassiveKind::Capacitor => {
                stored = Some(law(reader, cursor, "the charge")?)
            }
            "flux" if kind == PassiveKind::Inductor => {
                stored = Some(law(reader, cursor, "the flux")?)
            }
            "ic" if kind != PassiveKind::Resistor => {
                initial = Some(reader.value(cursor, "the initial value")?);
            }
            "tc" => {
                parameters.push(("tc1".to_string(), reader.value(cursor, "the coefficient")?));
                if !cursor.is_done() && cursor.clone().key().is_none() {
                    parameters.push(("tc2".to_string(), reader.value(cursor, "the coefficient")?));
                }
            }
            _ if IDLE.contains(&key.as_str()) => {
                reader.value(cursor, "the value")?;
            }
            _ if KEYS.contains(&key.as_str()) => {
                parameters.push((key, reader.value(cursor, "the value of the parameter")?));
            }
            _ => {
                let span = cursor.span(reader, from, from + word.len());
                let error = Diagnostic::error("E0704", span, format!("`{word}=` is not read"));
                reader.diagnostics.push(error);
                cursor.at = cursor.text.len();
                return None;
            }
        }
    }
    if let Some(law) = stored {
        if !words.is_empty() || value.is_some() || !parameters.is_empty() {
            let span = cursor.span(reader, own.1, own.1 + own.0.len());
            reader.diagnostics.push(
                Diagnostic::error("E0770", span, "a law of what is stored stands alone")
                    .because("it takes the place of the value, and of what would change that"),
            );
            return None;
        }
        let law = with_own(reader, law, kind, own.0, nodes);
        return Some(match kind {
            PassiveKind::Inductor => Element::Flux { law, initial },
            _ => Element::Charge { law, initial },
        });
    }
    let mut words = words.into_iter();
    let (first, second) = (words.next(), words.next());
    let (value, model) = match (value, first, second) {
        (Some(value), model, None) => (Some(value), model),
        (None, Some(first), Some(second)) if name(&first).is_some() && name(&second).is_none() => {
            (Some(second), Some(first))
        }
        (value, first, second) => (value.or(first), second),
    };
    let model = match model.as_ref().map(|word| (name(word), word.span)) {
        None => None,
        Some((Some(model), _)) => Some(model),
        Some((None, span)) => {
            let error = Diagnostic::error("E0704", span, "the name of a model stands here");
            reader
                .diagnostics
                .push(error.help("one number is the value; what else there is has a key"));
            return None;
        }
    };
    if model.is_none() && parameters.is_empty() {
        let Some(value) = value else {
            reader.missing(cursor, what);
            return None;
        };
        return Some(match kind {
            PassiveKind::Resistor => Element::Resistor { value },
            PassiveKind::Capacitor => Element::Capacitor { value, initial },
            PassiveKind::Inductor => Element::Inductor { value, initial },
        });
    }
    // `R1 a b rmod l=1u`: one word that is no number may be a model or a parameter.
    let (value, model) = match (value, model) {
        (Some(word), None) if parameters.iter().any(|(key, _)| key == "l" || key == "w") => {
            match name(&word) {
                Some(model) => (None, Some(model)),
                None => (Some(word), None),
            }
        }
        other => other,
    };
    Some(Element::Passive(Box::new(Passive { kind, value, model, initial, parameters })))
}

/// The name that an expression is.
fn name(expr: &Expr) -> Option<Name> {
    match &*expr.node {
        Node::Leaf(Leaf::Parameter(name)) => Some(*name),
        _ => None,
    }
}

/// A value, which may be an expression with brackets and without braces: `R=if(v(a)>1,2,3)`.
pub fn law(reader: &mut Reader, cursor: &mut Cursor, what: &str) -> Option<Expr> {
    cursor.blanks();
    let mut ahead = *cursor;
    let bare = !matches!(ahead.peek(), Some(b'{' | b'\'' | b'"'));
    ahead.word();
    if !(bare && ahead.peek() == Some(b'(')) {
        return reader.value(cursor, what);
    }
    let (from, bytes) = (cursor.at, cursor.text.as_bytes());
    let (mut at, mut depth) = (from, 0);
    while let Some(byte) = bytes.get(at) {
        match byte {
            b'(' => depth += 1,
            b')' => depth -= 1,
            b' ' | b'\t' if depth == 0 => break,
            _ => {}
        }
        at += 1;
    }
    cursor.at = at;
    reader.expression(cursor, from, at)
}

/// In LTspice `x` is the voltage across a capacitor, or the current through an inductor, that the law is of.
fn with_own(reader: &Reader, law: Expr, kind: PassiveKind, own: &str, nodes: &[Name]) -> Expr {
    let x = reader.names.find("x").filter(|_| reader.dialect.name == "ltspice");
    let (Some(x), [plus, minus]) = (x, nodes) else { return law };
    let leaf = match (kind, reader.names.find(own)) {
        (PassiveKind::Inductor, Some(own)) => Leaf::Current(own),
        (PassiveKind::Inductor, None) => return law,
        _ => Leaf::Voltage(*plus, Some(*minus)),
    };
    map_leaves(&law, &mut |old, span| {
        let new = if *old == Leaf::Parameter(x) { leaf.clone() } else { old.clone() };
        Expr::new(Node::Leaf(new), span)
    })
}
