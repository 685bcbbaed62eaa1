//! A file and all that it imports, as it is in the editor now: tree, index, and what checking it gives.

use super::documents::Documents;
use super::index::Index;
use super::server::Host;
use crate::bond::causality::Causality;
use crate::bond::elaborate::{self, Program};
use crate::bond::graph::BondGraph;
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, SourceMap, Span, loader};
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// What checking a file gives.
#[derive(Debug, Default)]
pub struct Checked {
    /// Everything that is said.
    pub diagnostics: Vec<Diagnostic>,
    /// The graph, where there were no errors on the way to it.
    pub graph: Option<BondGraph>,
    /// Its causality.
    pub causality: Option<Causality>,
}

/// A file and its imports, read.
pub struct Analysis {
    /// All texts.
    pub map: SourceMap,
    /// The files that were asked for, and were there.
    pub roots: Vec<FileId>,
    /// Of each of them, it and what it imports.
    pub programs: Vec<Program>,
    /// What names mean.
    pub index: Index,
    checked: OnceCell<Checked>,
}

impl Analysis {
    /// Reads files, open ones as they are in the editor.
    pub fn read(names: &[&str], documents: &Documents, folders: &[String]) -> Analysis {
        let mut map = SourceMap::default();
        for (name, document) in documents.iter() {
            map.add(name, document.text.as_str());
        }
        let found = |name: &&str, map: &mut SourceMap| {
            map.find(name).or_else(|| loader::load(name, map).ok())
        };
        let roots = names.iter().filter_map(|name| found(name, &mut map)).collect();
        Analysis::of(map, roots, folders)
    }

    /// The same files, some of them with other texts.
    pub fn with_texts(&self, texts: &BTreeMap<FileId, String>, folders: &[String]) -> Analysis {
        let mut map = SourceMap::default();
        for id in (0..).map(FileId) {
            let Some(file) = self.map.file(id) else { break };
            map.add(file.name.as_str(), texts.get(&id).unwrap_or(&file.text).as_str());
        }
        Analysis::of(map, self.roots.clone(), folders)
    }

    fn of(mut map: SourceMap, roots: Vec<FileId>, folders: &[String]) -> Analysis {
        // What is wrong is said when a file is checked.
        let mut load = |root: &FileId| elaborate::load(&mut map, *root, folders, &mut vec![]);
        let programs: Vec<Program> = roots.iter().map(&mut load).collect();
        let index = Index::new(&programs.iter().collect::<Vec<_>>(), &map);
        Analysis { map, roots, programs, index, checked: OnceCell::new() }
    }

    /// The first of the files asked for.
    pub fn root(&self) -> Option<FileId> {
        self.roots.first().copied()
    }

    /// What checking the first file gives; done when it is first asked for.
    pub fn checked(&self, host: &Host) -> &Checked {
        self.checked.get_or_init(|| match self.root() {
            // The files are all there, so that the numbers of files stay.
            Some(root) => (host.check)(&mut self.map.clone(), root, &host.folders),
            None => Checked::default(),
        })
    }

    /// The names of all files that were read for this.
    pub fn files(&self) -> BTreeSet<String> {
        let files = self.programs.iter().flat_map(|program| &program.files);
        let names = files.filter_map(|file| self.map.file(file.file));
        names.map(|file| file.name.clone()).collect()
    }

    /// The text of a file.
    pub fn text(&self, file: FileId) -> &str {
        self.map.file(file).map_or("", |file| file.text.as_str())
    }

    /// The name of a file.
    pub fn name(&self, file: FileId) -> &str {
        self.map.file(file).map_or("", |file| file.name.as_str())
    }

    /// The text of a span.
    pub fn source(&self, span: Span) -> &str {
        self.map.text(span)
    }

    /// The tree of a file.
    pub fn tree(&self, file: FileId) -> Option<&crate::bond::syntax::File> {
        self.programs.iter().flat_map(|program| &program.files).find(|tree| tree.file == file)
    }

    /// Where the protocol finds a span.
    pub fn location(&self, span: Span, documents: &Documents) -> Option<lsp_types::Location> {
        let uri = documents.uri(self.name(span.file))?;
        Some(lsp_types::Location { uri, range: self.range(span) })
    }

    /// A span in the protocol's terms.
    pub fn range(&self, span: Span) -> lsp_types::Range {
        let start = self.position(span.file, span.start as usize);
        lsp_types::Range { start, end: self.position(span.file, span.end.max(span.start) as usize) }
    }

    /// The place of a byte; the map knows where lines begin, so that a long text need not be gone through.
    fn position(&self, file: FileId, byte: usize) -> lsp_types::Position {
        let text = self.text(file);
        let byte = super::position::floor(text, byte);
        let line = self.map.position(Span::new(file, byte, byte)).map_or(1, |(line, _)| line);
        let begin = text[..byte].rfind('\n').map_or(0, |at| at + 1);
        let character = super::position::units(&text[begin..byte]) as u32;
        lsp_types::Position { line: line.saturating_sub(1) as u32, character }
    }
}
