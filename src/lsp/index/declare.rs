//! What is declared: the bodies of all files, and the names in each.

use super::*;
use crate::bond::elements::element;
use crate::bond::syntax::{ChainEnd, Model, Name, Part, Statement, StatementKind};

/// Collects the bodies of files and their declarations.
pub(super) fn declare(
    index: &mut Index,
    files: &BTreeMap<FileId, (&File, Vec<Import>)>,
    map: &SourceMap,
) {
    // Models first: what stands before a colon may come from another file.
    let mut own: BTreeMap<FileId, (BodyId, SymbolId)> = BTreeMap::new();
    for (id, (file, imports)) in files {
        let text = map.file(*id).map_or("", |file| file.text.as_str());
        let whole = Span::new(*id, 0, text.len());
        let name = stem(map, *id);
        let start = Span::new(*id, 0, 0);
        let definition = Definition { name: start, whole: start };
        let body = index.add_body(name.clone(), whole, true);
        let symbol = index.add(Symbol::new(&name, Sort::File(body), body, definition));
        own.insert(*id, (body, symbol));
        let mut kinds = BTreeMap::new();
        for statement in &file.statements {
            let StatementKind::Model(model) = &statement.kind else { continue };
            let inner = index.add_body(model.name.text.clone(), statement.span, false);
            let definition = Definition { name: model.name.span, whole: statement.span };
            let sort = Sort::Model(inner);
            let symbol = index.add(Symbol::new(&model.name.text, sort, body, definition));
            index.mention(model.name.span, symbol, Role::Definition);
            kinds.entry(model.name.text.clone()).or_insert(symbol);
        }
        index.kinds.insert(*id, kinds);
        index.imports.extend(imports);
    }
    let declared = index.kinds.clone();
    for (id, (_, imports)) in files {
        for target in imports.iter().filter_map(|import| import.file) {
            let Some((body, file)) = own.get(&target) else { continue };
            let name = index.body(*body).name.clone();
            let inner = declared.get(&target).into_iter().flatten();
            let all: Vec<(String, SymbolId)> = inner
                .map(|(name, symbol)| (name.clone(), *symbol))
                .chain([(name, *file)])
                .collect();
            let Some(kinds) = index.kinds.get_mut(id) else { continue };
            for (name, symbol) in all {
                kinds.entry(name).or_insert(symbol);
            }
        }
    }
    for (id, (file, _)) in files {
        let Some((body, _)) = own.get(id) else { continue };
        statements(index, *body, &file.statements, true);
        for statement in &file.statements {
            if let StatementKind::Model(model) = &statement.kind {
                let inner = index.model_declared_at(model.name.span);
                if let Some(inner) = inner {
                    header(index, inner, model);
                    statements(index, inner, &model.body, false);
                }
            }
        }
    }
}

fn header(index: &mut Index, body: BodyId, model: &Model) {
    for parameter in &model.parameters {
        let name = &parameter.name;
        let whole =
            parameter.default.as_ref().map_or(name.span, |value| name.span.join(value.span));
        let definition = Definition { name: name.span, whole };
        let sort = Sort::Parameter { public: true };
        let symbol = index.declare_value(body, &name.text, sort, definition);
        let text = parameter.description.as_ref().map_or("", |text: &Name| text.text.as_str());
        index.symbols[symbol.0].description = text.to_string();
    }
}

fn statements(index: &mut Index, body: BodyId, all: &[Statement], public: bool) {
    for statement in all {
        let whole = statement.span;
        let at = |part: &Part| Definition { name: part.span, whole };
        match &statement.kind {
            StatementKind::Chain(chain) => {
                let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
                ends.for_each(|end| declare_end(index, body, end));
            }
            StatementKind::Parameter { name, description, .. } => {
                let sort = Sort::Parameter { public };
                let symbol = index.declare_value(body, &name.text, sort, at(name));
                let text = description.as_ref().map_or("", |text: &Name| text.text.as_str());
                index.symbols[symbol.0].description = text.to_string();
            }
            StatementKind::Signal { name, .. } => {
                index.declare_value(body, &name.text, Sort::Signal, at(name));
            }
            StatementKind::Input(names) => {
                for name in names {
                    index.declare_value(body, &name.text, Sort::Input, at(name));
                }
            }
            StatementKind::Output(names) => {
                let names = names.iter().map(|name| name.text.clone());
                index.bodies[body.0].outputs.extend(names);
            }
            StatementKind::Port(port) => {
                let domain = port.domain.as_ref().map(|domain| domain.text.clone());
                let sort = Sort::Port { into: port.into, domain };
                index.declare_thing(body, &port.name.text, sort, at(&port.name));
            }
            StatementKind::For { body: inner, .. } => statements(index, body, inner, public),
            StatementKind::If { then, otherwise, .. } => {
                statements(index, body, then, public);
                statements(index, body, otherwise, public);
            }
            StatementKind::Drive { .. }
            | StatementKind::Simulate { .. }
            | StatementKind::Options(_)
            | StatementKind::Observe(_)
            | StatementKind::Import(_)
            | StatementKind::Model(_)
            | StatementKind::Loop(_)
            | StatementKind::Unreadable => {}
        }
    }
}

fn declare_end(index: &mut Index, body: BodyId, end: &ChainEnd) {
    let Some(kind) = &end.kind else { return };
    let file = index.body(body).file;
    let model = index.kinds.get(&file).and_then(|kinds| kinds.get(&kind.text)).copied();
    let sort = match (element(&kind.text), model) {
        (None, Some(model)) => {
            index.mention(kind.span, model, Role::Use);
            Sort::Instance(model)
        }
        _ => Sort::Element(kind.text.clone()),
    };
    let name = &end.path.name;
    let definition = Definition { name: name.span, whole: end.span };
    let symbol = index.declare_thing(body, &name.text, sort, definition);
    let symbol = &mut index.symbols[symbol.0];
    if symbol.arguments.is_none() {
        symbol.arguments = Some(end.arguments.clone().unwrap_or_default());
    }
}

impl Symbol {
    fn new(name: &str, sort: Sort, body: BodyId, definition: Definition) -> Symbol {
        let definitions = vec![definition];
        let name = name.to_string();
        Symbol { name, sort, body, definitions, description: String::new(), arguments: None }
    }
}

impl Index {
    fn add_body(&mut self, name: String, span: Span, is_file: bool) -> BodyId {
        let (things, values) = (BTreeMap::new(), BTreeMap::new());
        let outputs = vec![];
        self.bodies.push(Body { name, file: span.file, span, is_file, things, values, outputs });
        BodyId(self.bodies.len() - 1)
    }

    fn model_declared_at(&self, name: Span) -> Option<BodyId> {
        let here = |symbol: &&Symbol| {
            matches!(symbol.sort, Sort::Model(_)) && symbol.definitions[0].name == name
        };
        let model = self.symbols.iter().find(here)?;
        match model.sort {
            Sort::Model(body) => Some(body),
            _ => None,
        }
    }

    fn declare_thing(&mut self, body: BodyId, name: &str, sort: Sort, at: Definition) -> SymbolId {
        let known = self.body(body).things.get(name).copied();
        let symbol = self.declared(known, body, name, sort, at);
        self.bodies[body.0].things.insert(name.to_string(), symbol);
        symbol
    }

    pub(super) fn declare_value(
        &mut self,
        body: BodyId,
        name: &str,
        sort: Sort,
        at: Definition,
    ) -> SymbolId {
        let known = self.body(body).values.get(name).copied();
        let symbol = self.declared(known, body, name, sort, at);
        self.bodies[body.0].values.insert(name.to_string(), symbol);
        symbol
    }

    /// A variable of a loop or a sum, known within `scope`.
    pub(super) fn declare_variable(&mut self, body: BodyId, name: &Name, scope: Span) -> SymbolId {
        let at = Definition { name: name.span, whole: name.span };
        self.declared(None, body, &name.text, Sort::Variable(scope), at)
    }

    fn declared(
        &mut self,
        known: Option<SymbolId>,
        body: BodyId,
        name: &str,
        sort: Sort,
        at: Definition,
    ) -> SymbolId {
        let symbol = match known {
            Some(known) => {
                self.symbols[known.0].definitions.push(at);
                known
            }
            None => self.add(Symbol::new(name, sort, body, at)),
        };
        self.mention(at.name, symbol, Role::Definition);
        symbol
    }
}

/// The name of a file without folders and ending.
fn stem(map: &SourceMap, file: FileId) -> String {
    let name = map.file(file).map_or("", |file| file.name.as_str());
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    last.strip_suffix(".bg").unwrap_or(last).to_string()
}
