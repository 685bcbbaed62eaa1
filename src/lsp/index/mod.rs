//! What every name in a set of files means: symbols, where they are declared, and every place that speaks of them.
//!
//! It is made from the trees of the texts alone, so that it is there while a file is wrong, and it knows models that
//! nobody uses yet. Names with indices, `eha[k]`, are one symbol, `eha`: it is written with one word.

mod declare;
mod mentions;

use crate::bond::elaborate::Program;
use crate::bond::syntax::{Argument, File};
use crate::source::{FileId, SourceMap, Span};
use std::collections::BTreeMap;

/// Index of a symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SymbolId(pub usize);

/// Index of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyId(pub usize);

/// What a symbol is.
#[derive(Clone, Debug, PartialEq)]
pub enum Sort {
    /// An element or junction: what stands before its colon, also when that is no kind.
    Element(String),
    /// An instance of a model.
    Instance(SymbolId),
    /// A port of a model.
    Port {
        /// Whether its half arrow points into the model.
        into: bool,
        /// Its domain as written.
        domain: Option<String>,
    },
    /// A parameter.
    Parameter {
        /// Whether an instance may set it.
        public: bool,
    },
    /// A signal.
    Signal,
    /// An input.
    Input,
    /// What counts in a loop or a sum, and where it is known.
    Variable(Span),
    /// A model.
    Model(BodyId),
    /// A file as a model.
    File(BodyId),
}

impl Sort {
    /// In the words of the language.
    pub fn noun(&self) -> &'static str {
        match self {
            Sort::Element(kind) => {
                crate::bond::elements::element(kind).map_or("element", |row| row.noun)
            }
            Sort::Instance(_) => "instance",
            Sort::Port { .. } => "port",
            Sort::Parameter { .. } => "parameter",
            Sort::Signal => "signal",
            Sort::Input => "input",
            Sort::Variable(_) => "variable",
            Sort::Model(_) => "model",
            Sort::File(_) => "file",
        }
    }

    /// Whether its name is one of elements, junctions, instances and ports.
    pub fn is_thing(&self) -> bool {
        matches!(self, Sort::Element(_) | Sort::Instance(_) | Sort::Port { .. })
    }

    /// Whether its name is one of parameters, signals and inputs.
    pub fn is_value(&self) -> bool {
        matches!(self, Sort::Parameter { .. } | Sort::Signal | Sort::Input)
    }
}

/// A declaration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// The name.
    pub name: Span,
    /// All of what declares it.
    pub whole: Span,
}

/// A name and what it stands for.
#[derive(Clone, Debug)]
pub struct Symbol {
    /// As written, without indices.
    pub name: String,
    /// What it is.
    pub sort: Sort,
    /// Where it is known.
    pub body: BodyId,
    /// Where it is declared; with indices there may be several places.
    pub definitions: Vec<Definition>,
    /// The text in quotes after a parameter.
    pub description: String,
    /// For an element: its arguments as written.
    pub arguments: Option<Vec<Argument>>,
}

/// A model, or the statements of a file outside its models.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name; a file's stem.
    pub name: String,
    /// Where it stands.
    pub file: FileId,
    /// All of it; for a file the whole text.
    pub span: Span,
    /// Whether it is a file.
    pub is_file: bool,
    /// Elements, junctions, instances and ports.
    pub things: BTreeMap<String, SymbolId>,
    /// Parameters, signals and inputs.
    pub values: BTreeMap<String, SymbolId>,
    /// The values that can be read from outside.
    pub outputs: Vec<String>,
}

/// What a place has to do with its symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It declares it.
    Definition,
    /// It speaks of it.
    Use,
    /// It names something else, whose value is for want of another that of the symbol: `I:L` takes the parameter `L`.
    Implied,
}

/// A place that speaks of a symbol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mention {
    /// The name.
    pub span: Span,
    /// What it stands for.
    pub symbol: SymbolId,
    /// How.
    pub role: Role,
    /// Where a value in brackets would be written, for what is implied.
    pub after: Span,
}

/// An import.
#[derive(Clone, Copy, Debug)]
pub struct Import {
    /// The text in quotes.
    pub span: Span,
    /// The file, where there is one.
    pub file: Option<FileId>,
}

/// Everything that names mean in a set of files.
#[derive(Debug, Default)]
pub struct Index {
    /// All symbols.
    pub symbols: Vec<Symbol>,
    /// All bodies; that of a file before those of its models.
    pub bodies: Vec<Body>,
    /// All imports.
    pub imports: Vec<Import>,
    /// By file, what may stand before a colon there.
    pub kinds: BTreeMap<FileId, BTreeMap<String, SymbolId>>,
    /// Sorted by place.
    mentions: Vec<Mention>,
}

impl Index {
    /// The index of the files of several programs over one map; files that they share count once.
    pub fn new(programs: &[&Program], map: &SourceMap) -> Index {
        let mut files: BTreeMap<FileId, (&File, Vec<Import>)> = BTreeMap::new();
        for program in programs {
            for (at, file) in program.files.iter().enumerate() {
                let imports = program.imports.get(at).map_or(&[][..], Vec::as_slice);
                let target = |at: Option<usize>| Some(program.files.get(at?)?.file);
                let imports =
                    imports.iter().map(|(span, at)| Import { span: *span, file: target(*at) });
                files.entry(file.file).or_insert_with(|| (file, imports.collect()));
            }
        }
        let mut index = Index::default();
        declare::declare(&mut index, &files, map);
        mentions::collect(&mut index, &files);
        let key = |m: &Mention| (m.span.file, m.span.start, m.span.end, m.role);
        index.mentions.sort_by_key(key);
        index.mentions.dedup();
        index
    }

    /// A symbol.
    pub fn symbol(&self, id: SymbolId) -> &Symbol {
        &self.symbols[id.0]
    }

    /// A body.
    pub fn body(&self, id: BodyId) -> &Body {
        &self.bodies[id.0]
    }

    /// The body of a kind that is a model.
    pub fn model(&self, id: SymbolId) -> Option<BodyId> {
        match self.symbol(id).sort {
            Sort::Model(body) | Sort::File(body) => Some(body),
            _ => None,
        }
    }

    /// The body of an instance's model.
    pub fn inside(&self, id: SymbolId) -> Option<BodyId> {
        match self.symbol(id).sort {
            Sort::Instance(model) => self.model(model),
            _ => None,
        }
    }

    /// What stands at a byte, or ends there.
    pub fn at(&self, file: FileId, byte: usize) -> Option<&Mention> {
        let byte = byte as u32;
        let end = self.mentions.partition_point(|m| (m.span.file, m.span.start) <= (file, byte));
        let before = self.mentions[..end].iter().rev();
        let near = before.take_while(|m| m.span.file == file).take(8);
        near.filter(|m| m.span.end >= byte && m.span.end > m.span.start)
            .min_by_key(|m| (byte == m.span.end, m.role))
    }

    /// Every place that speaks of a symbol.
    pub fn mentions(&self, symbol: SymbolId) -> impl Iterator<Item = &Mention> {
        self.mentions.iter().filter(move |mention| mention.symbol == symbol)
    }

    /// The values that names take at a span because of their spelling.
    pub fn implied_at(&self, span: Span) -> impl Iterator<Item = &Mention> {
        self.mentions.iter().filter(move |m| m.span == span && m.role == Role::Implied)
    }

    /// The innermost body around a byte.
    pub fn body_at(&self, file: FileId, byte: usize) -> Option<BodyId> {
        let byte = byte as u32;
        let around = |body: &&(usize, &Body)| {
            let span = body.1.span;
            span.file == file && (body.1.is_file || span.start <= byte && byte <= span.end)
        };
        let bodies: Vec<(usize, &Body)> = self.bodies.iter().enumerate().collect();
        let found = bodies.iter().filter(around).min_by_key(|(_, body)| {
            if body.is_file { u32::MAX } else { body.span.end - body.span.start }
        });
        found.map(|(at, _)| BodyId(*at))
    }

    /// The variables of loops and sums that are known at a byte.
    pub fn variables_at(&self, file: FileId, byte: usize) -> impl Iterator<Item = &Symbol> {
        let byte = byte as u32;
        self.symbols.iter().filter(move |symbol| {
            matches!(symbol.sort, Sort::Variable(scope)
                if scope.file == file && scope.start <= byte && byte <= scope.end)
        })
    }

    /// Takes a new symbol.
    fn add(&mut self, symbol: Symbol) -> SymbolId {
        self.symbols.push(symbol);
        SymbolId(self.symbols.len() - 1)
    }

    /// Notes a place.
    fn mention(&mut self, span: Span, symbol: SymbolId, role: Role) {
        self.mentions.push(Mention { span, symbol, role, after: span });
    }
}
