//! Source texts and places in them.
//!
//! A [`Span`] travels from the text that a user wrote to the last equation of the solver, so that every failure can
//! point at a line.

pub mod examples;
pub mod library;
pub mod loader;

/// Index of a file in a [`SourceMap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FileId(pub u32);

/// A range of bytes `start..end` of one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Span {
    /// The file; `FileId(u32::MAX)` for what no text says.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// The span of what was generated and stands in no text.
    pub const NONE: Span = Span { file: FileId(u32::MAX), start: 0, end: 0 };

    /// A span of `file` from byte `start` to before byte `end`.
    pub fn new(file: FileId, start: usize, end: usize) -> Span {
        Span { file, start: start as u32, end: end as u32 }
    }

    /// Whether the span stands in no text.
    pub fn is_none(self) -> bool {
        self.file == Span::NONE.file
    }

    /// The smallest span that holds both.
    pub fn join(self, other: Span) -> Span {
        // What stands on the command line has places, too, and no file.
        if self == Span::NONE || (self.is_none() && !other.is_none()) {
            return other;
        }
        if other == Span::NONE || self.file != other.file {
            return self;
        }
        Span { file: self.file, start: self.start.min(other.start), end: self.end.max(other.end) }
    }
}

/// One text and the name that messages call it by.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// Path as the user gave it, or `<stdin>` or another name in angle brackets.
    pub name: String,
    /// The whole text.
    pub text: String,
    line_starts: Vec<u32>,
}

/// All texts that a run has read.
#[derive(Clone, Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceFile>,
}

impl SourceMap {
    /// Adds a text and returns its index. Texts are at most 4 GiB (the loader refuses larger ones).
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> FileId {
        let text = text.into();
        let ends = memchr::memchr_iter(b'\n', text.as_bytes());
        let line_starts = std::iter::once(0).chain(ends.map(|at| at as u32 + 1)).collect();
        self.files.push(SourceFile { name: name.into(), text, line_starts });
        FileId(self.files.len() as u32 - 1)
    }

    /// The file of an index that [`SourceMap::add`] returned.
    pub fn file(&self, id: FileId) -> Option<&SourceFile> {
        self.files.get(id.0 as usize)
    }

    /// The first text of a name.
    pub fn find(&self, name: &str) -> Option<FileId> {
        self.files.iter().position(|file| file.name == name).map(|at| FileId(at as u32))
    }

    /// The path of a file that another one names: relative ones count from the folder of the one that names them.
    pub fn beside(&self, file: FileId, path: &str) -> String {
        let folder = self
            .file(file)
            .filter(|file| !file.name.starts_with('<'))
            .and_then(|file| std::path::Path::new(&file.name).parent());
        match folder {
            Some(folder) => folder.join(path).to_string_lossy().into_owned(),
            None => path.to_string(),
        }
    }

    /// The text of a span; empty for [`Span::NONE`].
    pub fn text(&self, span: Span) -> &str {
        self.file(span.file)
            .and_then(|file| file.text.get(span.start as usize..span.end as usize))
            .unwrap_or("")
    }

    /// Line and column of a span's start, both from 1; columns count characters.
    pub fn position(&self, span: Span) -> Option<(usize, usize)> {
        let file = self.file(span.file)?;
        let line = file.line_starts.partition_point(|start| *start <= span.start);
        let begin = *file.line_starts.get(line.checked_sub(1)?)? as usize;
        let column = file.text.get(begin..span.start as usize)?.chars().count() + 1;
        Some((line, column))
    }
}
