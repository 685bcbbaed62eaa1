//! Completion: what may come at the cursor, by where it stands.

use super::analysis::Analysis;
use super::context::{Context, context};
use super::index::{BodyId, Index, Sort, Symbol};
use super::words;
use crate::bond::elements::{ELEMENTS, element};
use crate::bond::syntax::{Argument, Value};
use crate::quantity::{DOMAINS, PREFIXES, SYMBOLS};
use crate::sim::OPTIONS;
use crate::source::{FileId, library, loader};
use lsp_types as lsp;
use lsp_types::CompletionItemKind as Kind;

/// What is offered at once, at most.
const MOST: usize = 2000;

/// What may come at a byte.
pub fn complete(analysis: &Analysis, file: FileId, byte: usize) -> Vec<lsp::CompletionItem> {
    let text = analysis.text(file);
    let (context, begins) = context(text, byte);
    let mut offer = Offer { items: vec![] };
    let index = &analysis.index;
    let body = index.body_at(file, byte);
    let written = text.get(begins..byte).unwrap_or("");
    match context {
        Context::Nothing => {}
        Context::Import(path) => imports(analysis, file, &path, &mut offer),
        Context::Unit => units(written, &mut offer),
        Context::Statement => {
            for (word, form, meaning) in words::WORDS {
                offer.add(word, Kind::KEYWORD, form, meaning);
            }
            ends(index, file, body, &mut offer);
        }
        Context::End => ends(index, file, body, &mut offer),
        Context::NewName(kind) => new_names(index, body, &kind, &mut offer),
        Context::Member(path, thing) => members(index, body, &path, thing, &mut offer),
        Context::Thing => things(index, body, &mut offer),
        Context::Argument(kind) => {
            labels(index, file, &kind, &mut offer);
            if element(&kind).is_some() {
                values(analysis, file, byte, body, &mut offer);
            }
        }
        Context::Value => values(analysis, file, byte, body, &mut offer),
        Context::Name => names(index, body, &mut offer),
        Context::Domain => {
            for row in DOMAINS {
                let units = format!("e in {}, f in {}", row.effort, row.flow);
                let units = if row.effort.is_empty() { "nothing is said" } else { &units };
                offer.add(row.name, Kind::ENUM_MEMBER, units, "");
            }
        }
        Context::Words(all) => {
            all.iter().for_each(|word| offer.add(word, Kind::KEYWORD, "", ""));
        }
        Context::OptionKey => {
            OPTIONS.iter().for_each(|row| offer.add(row.name, Kind::PROPERTY, "", row.meaning));
        }
        Context::OptionValue(key) => option_values(&key, &mut offer),
    }
    let range = super::position::range(text, begins..byte);
    offer.items.truncate(MOST);
    for item in &mut offer.items {
        let edit = lsp::TextEdit { range, new_text: item.label.clone() };
        item.text_edit = Some(lsp::CompletionTextEdit::Edit(edit));
    }
    offer.items
}

struct Offer {
    items: Vec<lsp::CompletionItem>,
}

impl Offer {
    fn add(&mut self, label: &str, kind: Kind, detail: &str, documentation: &str) {
        if self.items.iter().any(|item| item.label == label && item.kind == Some(kind)) {
            return;
        }
        let some = |text: &str| (!text.is_empty()).then(|| text.to_string());
        // What is of this file comes before what is of the language.
        let language = [Kind::KEYWORD, Kind::FUNCTION, Kind::CLASS, Kind::UNIT].contains(&kind);
        self.items.push(lsp::CompletionItem {
            label: label.to_string(),
            kind: Some(kind),
            detail: some(detail),
            documentation: some(documentation).map(lsp::Documentation::String),
            sort_text: Some(format!("{}{label}", u8::from(language))),
            ..lsp::CompletionItem::default()
        });
    }

    fn symbol(&mut self, index: &Index, symbol: &Symbol) {
        let kind = match symbol.sort {
            Sort::Element(_) => Kind::FIELD,
            Sort::Instance(_) => Kind::MODULE,
            Sort::Port { .. } => Kind::INTERFACE,
            Sort::Parameter { .. } => Kind::CONSTANT,
            Sort::Signal | Sort::Input | Sort::Variable(_) => Kind::VARIABLE,
            Sort::Model(_) | Sort::File(_) => Kind::CLASS,
        };
        let detail = match &symbol.sort {
            Sort::Instance(model) => format!("instance of {}", index.symbol(*model).name),
            Sort::Port { into, domain } => {
                let domain = domain.as_ref().map_or(String::new(), |domain| format!(" : {domain}"));
                format!("port {}{domain}", if *into { "in" } else { "out" })
            }
            sort => sort.noun().to_string(),
        };
        self.add(&symbol.name, kind, &detail, &symbol.description);
    }
}

/// Kinds, models, and what is there to be joined.
fn ends(index: &Index, file: FileId, body: Option<BodyId>, offer: &mut Offer) {
    things(index, body, offer);
    for (name, id) in index.kinds.get(&file).into_iter().flatten() {
        offer.add(name, Kind::CLASS, index.symbol(*id).sort.noun(), "");
    }
    for row in ELEMENTS {
        offer.add(row.kind, Kind::CLASS, row.noun, words::law(row.kind).unwrap_or(""));
    }
}

/// Elements, junctions, instances and ports of a body.
fn things(index: &Index, body: Option<BodyId>, offer: &mut Offer) {
    let Some(body) = body else { return };
    index.body(body).things.values().for_each(|id| offer.symbol(index, index.symbol(*id)));
}

/// Parameters, signals and inputs of a body.
fn names(index: &Index, body: Option<BodyId>, offer: &mut Offer) {
    let Some(body) = body else { return };
    index.body(body).values.values().for_each(|id| offer.symbol(index, index.symbol(*id)));
}

/// Names for an element that takes a value: those of values, as `I:L` takes the parameter `L`.
fn new_names(index: &Index, body: Option<BodyId>, kind: &str, offer: &mut Offer) {
    let Some(body) = body else { return };
    let takes = element(kind).is_some_and(|row| !row.shape.is_junction());
    if takes {
        index.body(body).values.values().for_each(|id| offer.symbol(index, index.symbol(*id)));
    }
}

/// What stands in an expression.
fn values(analysis: &Analysis, file: FileId, byte: usize, body: Option<BodyId>, offer: &mut Offer) {
    let index = &analysis.index;
    names(index, body, offer);
    index.variables_at(file, byte).for_each(|symbol| offer.symbol(index, symbol));
    if let Some(body) = body {
        let things = index.body(body).things.values().map(|id| index.symbol(*id));
        let instances = things.filter(|symbol| matches!(symbol.sort, Sort::Instance(_)));
        instances.for_each(|symbol| offer.symbol(index, symbol));
    }
    for (name, form) in words::functions() {
        offer.add(name, Kind::FUNCTION, &form, words::meaning(name).unwrap_or(""));
    }
    for (name, meaning) in [("time", "the time of the run, in seconds"), ("pi", "the number π")] {
        offer.add(name, Kind::CONSTANT, "", meaning);
    }
    for word in ["if", "then", "else", "and", "or", "not"] {
        offer.add(word, Kind::KEYWORD, "", "");
    }
}

/// What follows after the dot of a path.
fn members(index: &Index, body: Option<BodyId>, path: &[String], thing: bool, offer: &mut Offer) {
    let mut body = body;
    for name in path {
        let Some(id) = body.and_then(|body| index.body(body).things.get(name)).copied() else {
            return;
        };
        if let Sort::Element(kind) = &index.symbol(id).sort {
            let arguments = index.symbol(id).arguments.as_deref().unwrap_or(&[]);
            for port in (1..=ports(kind, arguments)).filter(|_| thing) {
                offer.add(&port.to_string(), Kind::INTERFACE, "port", "");
            }
            return;
        }
        body = index.inside(id);
    }
    let Some(body) = body else { return };
    if thing {
        return things(index, Some(body), offer);
    }
    let inside = index.body(body);
    for (name, id) in &inside.values {
        let symbol = index.symbol(*id);
        let public = matches!(symbol.sort, Sort::Parameter { public: true });
        if public || inside.outputs.contains(name) {
            offer.symbol(index, symbol);
        }
    }
    let inner = inside.things.values().map(|id| index.symbol(*id));
    inner.filter(|symbol| matches!(symbol.sort, Sort::Instance(_))).for_each(|symbol| {
        offer.symbol(index, symbol);
    });
}

/// How many numbered ports an element has: two of a two-port, as many as its laws or its matrix say of a field.
fn ports(kind: &str, arguments: &[Argument]) -> usize {
    if element(kind).is_some_and(|row| row.shape.is_two_port()) {
        return 2;
    }
    let numbered = arguments.iter().map(|argument| match (&argument.label, &argument.value) {
        (Some(label), _) => {
            let digits = label.name.text.trim_start_matches(['e', 'f', 'q', 'p']);
            // `q0` is an initial value.
            digits.parse().ok().filter(|port| *port < 1000).unwrap_or(0)
        }
        (None, Value::Matrix(rows)) => rows.len(),
        (None, _) => 0,
    });
    numbered.max().unwrap_or(0)
}

/// Labels of arguments: a model's parameters and inputs, an element's initial values and laws.
fn labels(index: &Index, file: FileId, kind: &str, offer: &mut Offer) {
    let model = index.kinds.get(&file).and_then(|kinds| kinds.get(kind));
    if let (None, Some(body)) = (element(kind), model.and_then(|model| index.model(*model))) {
        for id in index.body(body).values.values() {
            let symbol = index.symbol(*id);
            if matches!(symbol.sort, Sort::Parameter { public: true } | Sort::Input) {
                offer.symbol(index, symbol);
            }
        }
        return;
    }
    let plain = kind.strip_prefix('M').unwrap_or(kind);
    let labels: &[(&str, &str)] = match plain {
        "R" => &[("e", "the law e = …f…"), ("f", "the law f = …e…")],
        "C" => &[
            ("e", "the law e = …q…"),
            ("q", "the law q = …e…"),
            ("q0", "the charge at first"),
            ("e0", "the effort at first"),
        ],
        "I" => &[
            ("f", "the law f = …p…"),
            ("p", "the law p = …f…"),
            ("p0", "the momentum at first"),
            ("f0", "the flow at first"),
        ],
        "TF" => &[("gain", "e2 = gain·e1, f1 = gain·f2")],
        "GY" => &[("gain", "f1 = gain·e2, f2 = gain·e1")],
        _ => &[],
    };
    labels.iter().for_each(|(label, meaning)| offer.add(label, Kind::PROPERTY, meaning, ""));
}

/// Units that begin with what is written; without anything the common ones.
fn units(written: &str, offer: &mut Offer) {
    let compound =
        DOMAINS.iter().flat_map(|row| [row.effort, row.flow, row.displacement, row.momentum]);
    let plain = SYMBOLS.iter().map(|row| row.name.to_string());
    let prefixed = SYMBOLS
        .iter()
        .filter(|row| row.prefixes && !written.is_empty())
        .flat_map(|row| PREFIXES.iter().map(move |(prefix, _)| format!("{prefix}{}", row.name)));
    let all = plain.chain(compound.map(String::from)).chain(prefixed);
    for unit in all.filter(|unit| !unit.is_empty() && unit.starts_with(written)) {
        offer.add(&unit, Kind::UNIT, "unit", "");
    }
}

fn option_values(key: &str, offer: &mut Offer) {
    let Some(row) = OPTIONS.iter().find(|row| row.name == key) else { return };
    // The words in quotes of its meaning are what it can be.
    let words = row.meaning.split('`').skip(1).step_by(2);
    words.for_each(|word| offer.add(word, Kind::VALUE, "", row.meaning));
}

/// Files that can be imported: those of the library, those below the folder of the file, those of the folders given.
fn imports(analysis: &Analysis, file: FileId, written: &str, offer: &mut Offer) {
    for (name, _) in library::LIBRARY {
        offer.add(&format!("std/{name}"), Kind::FILE, "of the library", "");
    }
    if written.starts_with("std/") {
        return;
    }
    let own = analysis.name(file);
    let folder = own.rfind('/').map_or("", |end| &own[..end]);
    for path in loader::list(folder, ".bg", 500) {
        let inside = path.strip_prefix(folder).map(|path| path.trim_start_matches('/'));
        if let Some(inside) = inside.filter(|_| path != own) {
            offer.add(inside, Kind::FILE, "", "");
        }
    }
}
