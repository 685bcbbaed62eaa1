//! What is said of the word under the pointer: for a name its declaration, law, unit, domain, causality and value; for a
//! kind, a function or another word of the language what it means.

use super::analysis::{Analysis, Checked};
use super::index::{BodyId, Sort, Symbol, SymbolId};
use super::words;
use crate::bond::causality::Causality;
use crate::bond::elements::element;
use crate::bond::graph::{
    BondGraph, BondId, Dissipation, End, Expr, Law, Leaf, Modulus, Power, Storage, StoreLaw,
    Vertex, VertexId,
};
use crate::expr::print::number;
use crate::quantity::Domain;
use crate::source::{FileId, Span};

/// Of an array so many are told one by one.
const MOST: usize = 6;

/// What is said at a byte, as Markdown, and the word that it is said of.
pub fn hover(
    analysis: &Analysis,
    checked: &Checked,
    file: FileId,
    byte: usize,
) -> Option<(String, Span)> {
    if let Some(mention) = analysis.index.at(file, byte) {
        return Some((of_symbol(analysis, checked, mention.symbol), mention.span));
    }
    let text = analysis.text(file);
    let word = word_at(text, byte)?;
    let span = Span::new(file, word.start, word.end);
    let name = text.get(word.clone())?;
    let after = text.get(word.end..)?;
    let before = text.get(..word.start)?;
    if after.trim_start_matches(' ').starts_with(':')
        && let Some(row) = element(name)
    {
        return Some((of_kind(row.kind, row.noun), span));
    }
    if after.starts_with('(')
        && let Some((_, form)) = words::functions().into_iter().find(|(known, _)| *known == name)
    {
        let meaning = words::meaning(name).unwrap_or("");
        return Some((format!("{}\n\n{meaning}", code(&form)), span));
    }
    let starts =
        before.rsplit(['\n', ';', '{', '}']).next().is_some_and(|line| line.trim().is_empty());
    if let Some((_, form, meaning)) = words::WORDS.iter().find(|(word, ..)| starts && *word == name)
    {
        return Some((format!("{}\n\n{meaning}", code(form)), span));
    }
    let said = match name {
        "time" => "the time of the run, in seconds",
        "pi" => "the number π",
        "e" | "f" | "q" | "p" => "in a law: the element's own variable, counted into the element",
        _ => return None,
    };
    Some((said.to_string(), span))
}

/// The word of letters, digits and `_` at a byte, or before it.
pub fn word_at(text: &str, byte: usize) -> Option<std::ops::Range<usize>> {
    let byte = super::position::floor(text, byte);
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let before = &text[..byte];
    let start = before.len()
        - before.chars().rev().take_while(|c| part(*c)).map(char::len_utf8).sum::<usize>();
    let end =
        byte + text[byte..].chars().take_while(|c| part(*c)).map(char::len_utf8).sum::<usize>();
    (start < end).then_some(start..end)
}

fn code(text: &str) -> String {
    format!("```bg\n{}\n```", text.trim_end())
}

fn of_kind(kind: &str, noun: &str) -> String {
    format!("**{kind}** · {noun}\n\n{}", words::law(kind).unwrap_or(""))
}

/// Everything that is known of a symbol.
pub fn of_symbol(analysis: &Analysis, checked: &Checked, id: SymbolId) -> String {
    let symbol = analysis.index.symbol(id);
    let mut lines = match &symbol.sort {
        Sort::Element(kind) => of_element(analysis, checked, symbol, kind),
        Sort::Instance(model) => {
            let mut lines =
                vec![code(&declaration(analysis, symbol)), "an instance of".to_string()];
            lines.push(
                analysis.index.model(*model).map_or(String::new(), |body| of_model(analysis, body)),
            );
            lines
        }
        Sort::Port { .. } => {
            let mut lines = vec![code(&declaration(analysis, symbol))];
            lines.push(format!("port of `{}`", analysis.index.body(symbol.body).name));
            lines
        }
        Sort::Parameter { .. } => of_parameter(analysis, checked, symbol),
        Sort::Signal | Sort::Input => of_signal(analysis, checked, symbol),
        Sort::Variable(_) => vec![format!("`{}` counts in a loop or a sum", symbol.name)],
        Sort::Model(body) | Sort::File(body) => vec![of_model(analysis, *body)],
    };
    lines.retain(|line| !line.is_empty());
    lines.join("\n\n")
}

/// The text that declares a symbol.
fn declaration(analysis: &Analysis, symbol: &Symbol) -> String {
    let Some(definition) = symbol.definitions.first() else { return symbol.name.clone() };
    let text = analysis.source(definition.whole);
    match text.char_indices().nth(400) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

/// A model's head, the comment above it, its ports, inputs and outputs.
fn of_model(analysis: &Analysis, id: BodyId) -> String {
    let body = analysis.index.body(id);
    let text = analysis.source(body.span);
    let head = match (body.is_file, text.find('{')) {
        (false, Some(end)) => text[..end].trim_end().to_string(),
        _ => format!("{}.bg", body.name),
    };
    let mut lines = vec![code(&head)];
    let above = match body.is_file {
        true => leading_comment(text),
        false => comment_above(analysis.text(body.file), body.span.start as usize),
    };
    lines.push(above);
    let values = |wanted: &dyn Fn(&str, &Sort) -> bool| -> Vec<String> {
        let all = body.values.iter();
        let all = all.filter(|(name, id)| wanted(name, &analysis.index.symbol(**id).sort));
        all.map(|(name, _)| format!("`{name}`")).collect()
    };
    let ports: Vec<String> = body
        .things
        .iter()
        .filter_map(|(name, id)| match &analysis.index.symbol(*id).sort {
            Sort::Port { into, domain } => {
                let domain = domain.as_ref().map_or(String::new(), |domain| format!(" : {domain}"));
                Some(format!("`{} {name}{domain}`", if *into { "in" } else { "out" }))
            }
            _ => None,
        })
        .collect();
    let inputs = values(&|_, sort| *sort == Sort::Input);
    let outputs = values(&|name, _| body.outputs.iter().any(|output| output == name));
    for (what, names) in [("ports", ports), ("inputs", inputs), ("outputs", outputs)] {
        if !names.is_empty() {
            lines.push(format!("{what}: {}", names.join(", ")));
        }
    }
    lines.retain(|line| !line.is_empty());
    lines.join("\n\n")
}

/// The comment that a text begins with.
fn leading_comment(text: &str) -> String {
    let lines = text.lines().map_while(|line| line.trim_start().strip_prefix('#'));
    lines.map(str::trim).collect::<Vec<_>>().join("\n")
}

/// The comment on the lines directly above a byte.
fn comment_above(text: &str, byte: usize) -> String {
    let before = text.get(..byte).unwrap_or("");
    let begin = before.rfind('\n').map_or(0, |at| at + 1);
    let lines = before[..begin].lines().rev().map_while(|line| line.trim_start().strip_prefix('#'));
    let mut lines: Vec<&str> = lines.map(str::trim).collect();
    lines.reverse();
    lines.join("\n")
}

/// Whether a thing of the graph is declared by a symbol: its span ends with the name.
fn declared_by(symbol: &Symbol, span: Span) -> bool {
    let same =
        |name: Span| name.file == span.file && name.end == span.end && span.start <= name.start;
    symbol.definitions.iter().any(|definition| same(definition.name))
}

fn of_parameter(analysis: &Analysis, checked: &Checked, symbol: &Symbol) -> Vec<String> {
    let text = declaration(analysis, symbol);
    let word = if text.starts_with("param") { "" } else { "param " };
    let mut lines = vec![code(&format!("{word}{text}")), symbol.description.clone()];
    let Some(graph) = &checked.graph else { return lines };
    let all: Vec<_> = graph
        .parameters
        .iter()
        .filter(|p| declared_by(symbol, p.span) && p.value.is_finite())
        .collect();
    for parameter in all.iter().take(MOST) {
        let value = match &parameter.unit {
            Some(unit) if unit.factor != 1.0 => {
                format!(
                    "{} {} = {}",
                    short(parameter.value / unit.factor),
                    unit.text,
                    short(parameter.value)
                )
            }
            Some(unit) => format!("{} {}", short(parameter.value), unit.text),
            None => short(parameter.value),
        };
        lines.push(format!("`{}` = {value}", parameter.name));
    }
    more(all.len(), &mut lines);
    lines
}

fn of_signal(analysis: &Analysis, checked: &Checked, symbol: &Symbol) -> Vec<String> {
    let mut lines = vec![code(&declaration(analysis, symbol))];
    if symbol.sort == Sort::Input {
        lines.push("an input: an instance or `drive` gives it".to_string());
    }
    let Some(graph) = &checked.graph else { return lines };
    let signal = graph.signals.iter().find(|signal| declared_by(symbol, signal.span));
    if let Some(unit) = signal.and_then(|signal| signal.unit.as_ref()) {
        lines.push(match unit.text.as_str() {
            "" => "a pure number".to_string(),
            text => format!("in {text}"),
        });
    }
    lines
}

fn of_element(analysis: &Analysis, checked: &Checked, symbol: &Symbol, kind: &str) -> Vec<String> {
    let mut lines = vec![code(&declaration(analysis, symbol))];
    let noun = symbol.sort.noun();
    let law = words::law(kind).unwrap_or("");
    let Some(graph) = &checked.graph else {
        lines.push(format!("{noun}: {law}"));
        return lines;
    };
    let all: Vec<VertexId> =
        graph.vertex_ids().filter(|id| declared_by(symbol, graph.vertex(*id).span)).collect();
    let first = all.first().map(|id| graph.vertex(*id));
    lines.push(match first.and_then(|vertex| equation(analysis, symbol, &vertex.law)) {
        Some(equation) => format!("{noun}: {equation}"),
        None => format!("{noun}: {law}"),
    });
    for id in all.iter().take(MOST) {
        let vertex = graph.vertex(*id);
        let mut said = vec![];
        said.extend(value(graph, &vertex.law));
        said.extend(domains(graph, vertex));
        said.extend(checked.causality.as_ref().and_then(|c| causality(graph, c, *id)));
        let said = said.join("  \n");
        lines.push(if all.len() > 1 { format!("`{}`: {said}", vertex.name) } else { said });
    }
    more(all.len(), &mut lines);
    lines
}

fn more(number: usize, lines: &mut Vec<String>) {
    if number > MOST {
        lines.push(format!("and {} more", number - MOST));
    }
}

/// The law with the value as it is written.
fn equation(analysis: &Analysis, symbol: &Symbol, law: &Law) -> Option<String> {
    let arguments = symbol.arguments.as_deref().unwrap_or(&[]);
    let plain = arguments.iter().find(|argument| argument.label.is_none());
    let value = plain.map_or(symbol.name.as_str(), |argument| analysis.source(argument.span));
    let plain_number = value.parse::<f64>().is_ok();
    let held = match !plain_number && value.contains([' ', '+', '-', '*', '/']) {
        true => format!("({value})"),
        false => value.to_string(),
    };
    // A law with a label is the text itself.
    let labelled = || {
        let law = arguments.iter().find(|argument| {
            argument.label.as_ref().is_some_and(|l| l.derivative || !l.name.text.ends_with('0'))
        });
        law.map(|argument| analysis.source(argument.span).to_string())
    };
    Some(match law {
        Law::Source { detector: true, .. } | Law::Zero | Law::One => return None,
        Law::Field(_) => {
            let laws: Vec<&str> = arguments.iter().map(|law| analysis.source(law.span)).collect();
            laws.join(", ")
        }
        Law::Source { sets: Power::Effort, .. } => format!("e = {value}"),
        Law::Source { sets: Power::Flow, .. } => format!("f = {value}"),
        Law::Dissipator(Dissipation::Linear(_)) => format!("e = {held}·f"),
        Law::Store { kind: Storage::Compliance, law: StoreLaw::Linear(_), .. } => {
            format!("e = q/{held}")
        }
        Law::Store { kind: Storage::Inertia, law: StoreLaw::Linear(_), .. } => {
            format!("f = p/{held}")
        }
        Law::Transformer(_) if plain.is_some() || arguments.is_empty() => {
            format!("e1 = {held}·e2, f2 = {held}·f1")
        }
        Law::Gyrator(_) if plain.is_some() || arguments.is_empty() => {
            format!("e1 = {held}·f2, e2 = {held}·f1")
        }
        _ => return labelled(),
    })
}

/// The value of a linear law that parameters alone give, in SI.
fn value(graph: &BondGraph, law: &Law) -> Option<String> {
    let (name, expr): (&str, &Expr) = match law {
        Law::Source { detector: false, value, .. } => ("value", value),
        Law::Dissipator(Dissipation::Linear(r)) => ("R", r),
        Law::Store { kind: Storage::Compliance, law: StoreLaw::Linear(c), .. } => ("C", c),
        Law::Store { kind: Storage::Inertia, law: StoreLaw::Linear(i), .. } => ("I", i),
        Law::Transformer(Modulus::Ratio(r)) | Law::Gyrator(Modulus::Ratio(r)) => ("ratio", r),
        Law::Transformer(Modulus::Gain(g)) | Law::Gyrator(Modulus::Gain(g)) => ("gain", g),
        _ => return None,
    };
    let value = expr.evaluate(&mut |leaf| match leaf {
        Leaf::Parameter(id) => graph.parameters[id.index()].value,
        _ => f64::NAN,
    });
    if value.is_finite() {
        return Some(format!("{name} = {} (SI)", short(value)));
    }
    Some(format!("{name} changes during a run: modulated"))
}

/// The domain at each port.
fn domains(graph: &BondGraph, vertex: &Vertex) -> Option<String> {
    let mut rows: Vec<Domain> = vertex.bonds.iter().map(|bond| graph.bond(*bond).domain).collect();
    if !matches!(vertex.law, Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_)) {
        rows.truncate(1);
    }
    rows.dedup();
    let text = |domain: &Domain| {
        let row = domain.row();
        format!("{} (e in {}, f in {})", row.name, row.effort, row.flow)
    };
    let known: Vec<String> = rows.iter().filter(|d| **d != Domain::Any).map(text).collect();
    (!known.is_empty()).then(|| known.join(" to "))
}

/// What causality makes of an element.
fn causality(graph: &BondGraph, causality: &Causality, id: VertexId) -> Option<String> {
    let vertex = graph.vertex(id);
    let receives =
        |bond: BondId, port: u32| causality.receives_effort(graph, bond, End { vertex: id, port });
    let other = |bond: BondId| {
        let bond = graph.bond(bond);
        let end = if bond.from.vertex == id { bond.to } else { bond.from };
        graph.vertex(end.vertex).name.as_str()
    };
    let stroke = |effort: bool| match effort {
        true => "stroke at its side: effort in, flow out",
        false => "stroke at the far side: flow in, effort out",
    };
    let storage = |end: End| {
        let dependent = causality.dependent.iter().find(|row| row.storage == end);
        Some(match dependent {
            Some(row) => {
                let on: Vec<String> =
                    row.on.iter().map(|on| format!("`{}`", graph.port_name(*on))).collect();
                format!("derivative causality, determined by {}", on.join(", "))
            }
            None if causality.states.contains(&end) => "integral causality, a state".to_string(),
            None => return None,
        })
    };
    match (&vertex.law, vertex.bonds.as_slice()) {
        (Law::Store { .. } | Law::Rate { .. }, [bond, ..]) => {
            let kind = storage(End { vertex: id, port: 0 })?;
            Some(format!("{kind}; {}", stroke(receives(*bond, 0)?)))
        }
        (Law::Field(_), bonds) => {
            let said = graph.law_ports(id).zip(bonds).filter_map(|(end, bond)| {
                let stroke = stroke(receives(*bond, end.port)?);
                let kind = storage(end).map_or(String::new(), |kind| format!("{kind}; "));
                Some(format!("port {}: {kind}{stroke}", end.port + 1))
            });
            Some(said.collect::<Vec<_>>().join("  \n"))
        }
        (Law::Zero | Law::One, bonds) => {
            // The one bond that sets the common variable.
            let zero = matches!(vertex.law, Law::Zero);
            let setting = bonds.iter().find(|bond| receives(**bond, 0) == Some(zero))?;
            let what = if zero { "effort" } else { "flow" };
            Some(format!("its {what} comes from `{}`", other(*setting)))
        }
        (Law::Transformer(_) | Law::Gyrator(_), [first, second]) => {
            let side = |effort: bool| if effort { "effort in" } else { "flow in" };
            let (one, two) = (receives(*first, 0)?, receives(*second, 1)?);
            Some(format!("port 1: {}, port 2: {}", side(one), side(two)))
        }
        (_, [bond]) => Some(stroke(receives(*bond, 0)?).to_string()),
        _ => None,
    }
}

/// A number to six digits.
fn short(value: f64) -> String {
    number(format!("{value:.5e}").parse().unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words() {
        let text = "GY:Φ_2(x)🚀y";
        let word = |byte| word_at(text, byte).map(|range| &text[range]);
        assert_eq!(word(0), Some("GY"));
        assert_eq!(word(2), Some("GY"));
        assert_eq!(word(4), Some("Φ_2"));
        assert_eq!(word(100), Some("y"));
        assert_eq!(word_at("🚀", 2), None);
        assert_eq!(word_at("", 0), None);
    }

    #[test]
    fn comments_belong_to_what_follows_them() {
        let text = "# file\n\n# A motor.\n# With brushes.\nmodel M() {}\n";
        assert_eq!(comment_above(text, text.find("model").unwrap()), "A motor.\nWith brushes.");
        assert_eq!(leading_comment(text), "file");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(0.1 + 0.2), "0.3");
        assert_eq!(short(1.23456789e-7), "1.23457e-7");
    }
}
