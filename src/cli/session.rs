//! One call of the program: what has been read and said, and the exit code that follows.

use crate::diagnostic::{Diagnostic, Severity, files, render};
use crate::source::loader;
use crate::source::{FileId, SourceMap, Span};
use crate::trace::{Trace, formats};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// How the program ends; the numbers are its exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is well.
    Fine = 0,
    /// A negative verdict, and nothing else.
    Negative = 1,
    /// The command line is wrong.
    Usage = 2,
    /// The input is wrong.
    Input = 3,
    /// The simulation failed.
    Simulation = 4,
    /// A file cannot be read or written.
    File = 5,
    /// Stopped by Ctrl-C.
    Interrupted = 130,
}

/// How messages are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum MessageFormat {
    /// With the lines they speak of.
    #[default]
    Human,
    /// `file:line:col: error[CODE]: message`.
    Short,
    /// One JSON object a line.
    Json,
}

/// Flags of every command.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Global {
    /// How errors and warnings are written on stderr.
    #[arg(long, global = true, value_enum, default_value = "human", value_name = "FORM")]
    pub message_format: MessageFormat,
    /// Say errors only.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say more: statistics, figures, notes.
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// One call of the program.
#[derive(Default)]
pub struct Session {
    /// All texts that were read.
    pub map: SourceMap,
    /// Everything that was said.
    pub said: Vec<Diagnostic>,
    /// Flags of every command.
    pub global: Global,
    inputs: Vec<PathBuf>,
}

impl Session {
    /// A session without anything read yet.
    pub fn new(global: Global) -> Session {
        Session { global, ..Session::default() }
    }

    /// Says diagnostics on stderr and keeps them.
    pub fn say(&mut self, diagnostics: impl IntoIterator<Item = Diagnostic>) {
        let mut stderr = std::io::stderr().lock();
        let style = style();
        for diagnostic in diagnostics {
            if self.said.contains(&diagnostic) {
                continue;
            }
            if diagnostic.severity == Severity::Error || !self.global.quiet {
                let text = match self.global.message_format {
                    MessageFormat::Human => render::human(&diagnostic, &self.map, style) + "\n",
                    MessageFormat::Short => render::short(&diagnostic, &self.map),
                    MessageFormat::Json => render::json(&diagnostic, &self.map),
                };
                // Where stderr is closed there is nobody to tell.
                let _ = stderr.write_all(text.as_bytes());
            }
            self.said.push(diagnostic);
        }
    }

    /// Says a diagnostic and what exit code it asks for.
    pub fn fail(&mut self, diagnostic: impl Into<Diagnostic>) -> Exit {
        let diagnostic = diagnostic.into();
        let exit = exit_of(diagnostic.code);
        self.say([diagnostic]);
        exit
    }

    /// Says a line on stderr, unless asked to be quiet or messages are for programs.
    pub fn remark(&self, line: &str) {
        if !self.global.quiet && self.global.message_format != MessageFormat::Json {
            let _ = writeln!(std::io::stderr().lock(), "{line}");
        }
    }

    /// Says how many errors and warnings there were.
    pub fn close(&self) {
        let errors_only = |d: &&Diagnostic| d.severity == Severity::Error || !self.global.quiet;
        let said: Vec<Diagnostic> = self.said.iter().filter(errors_only).cloned().collect();
        if let (MessageFormat::Human, Some(count)) =
            (self.global.message_format, render::count(&said))
        {
            let _ = writeln!(std::io::stderr().lock(), "{count}");
        }
    }

    /// The exit code that the errors so far ask for: that of the first.
    pub fn exit(&self) -> Exit {
        let first = self.said.iter().find(|d| d.severity == Severity::Error);
        first.map_or(Exit::Fine, |d| exit_of(d.code))
    }

    /// Reads a source; says why it cannot be.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn load(&mut self, path: &str) -> Result<FileId, Exit> {
        self.remember(path);
        match loader::load(path, &mut self.map) {
            Ok(file) => Ok(file),
            Err(error) => Err(self.fail(error)),
        }
    }

    /// Reads a trace of any format; says why it cannot be.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn load_trace(&mut self, path: &str) -> Result<Trace, Exit> {
        self.remember(path);
        let bytes = loader::read_data(path).map_err(|error| self.fail(error))?;
        formats::read(path, &bytes).map_err(|diagnostic| self.fail(*diagnostic))
    }

    /// Reads a small text of data; says why it cannot be.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn load_text(&mut self, path: &str) -> Result<String, Exit> {
        let file = self.load(path)?;
        Ok(self.map.file(file).map_or(String::new(), |file| file.text.clone()))
    }

    fn remember(&mut self, path: &str) {
        if path != "-" {
            self.inputs.push(PathBuf::from(path));
        }
    }

    /// Refuses to write over a file that was read.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn spare_inputs(&mut self, output: &str) -> Result<(), Exit> {
        let clash = self.inputs.iter().any(|input| same_file(input, Path::new(output)));
        if !clash {
            return Ok(());
        }
        let message = format!("`{output}` would be overwritten, and it is an input");
        Err(self.fail(
            Diagnostic::error("E0906", Span::NONE, message).help("choose another name after -o"),
        ))
    }

    /// Says that a file cannot be written.
    pub fn unwritable(&mut self, name: &str, error: &std::io::Error) -> Exit {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            return Exit::Fine;
        }
        self.fail(files::unwritable(name, error))
    }
}

/// The exit code that an error of this code asks for.
pub fn exit_of(code: &str) -> Exit {
    match (code.get(1..3), code.get(3..5)) {
        // Nothing to run, or an option that makes no sense: said before anything runs.
        (Some("08"), Some("06" | "07" | "10" | "16" | "17" | "18")) => Exit::Input,
        (Some("08"), _) => Exit::Simulation,
        (Some("09"), Some(number)) if number < "20" => Exit::File,
        (Some("09"), Some(number)) if number >= "40" => Exit::Usage,
        _ => Exit::Input,
    }
}

/// Whether two paths lead to one file.
pub(super) fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b || same_inode(&a, &b),
        (Err(_), Err(_)) => a == b || (a.file_name() == b.file_name() && folder(a) == folder(b)),
        _ => false,
    }
}

/// The folder of a file that need not be there yet.
fn folder(path: &Path) -> Option<PathBuf> {
    let parent = path.parent()?;
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    parent.canonicalize().ok()
}

#[cfg(unix)]
fn same_inode(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (a.metadata(), b.metadata()) {
        (Ok(a), Ok(b)) => a.is_file() && (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn same_inode(_: &Path, _: &Path) -> bool {
    false
}

/// Colours only on a terminal, and not against `NO_COLOR`.
fn style() -> render::Style {
    let terminal = std::io::stderr().is_terminal();
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let width = std::env::var("COLUMNS").ok().and_then(|text| text.parse().ok());
    render::Style { colour: terminal && !refused, width: width.unwrap_or(120) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_follow_the_stage() {
        for (code, exit) in [
            ("E0101", Exit::Input),
            ("E0703", Exit::Input),
            ("E0801", Exit::Simulation),
            ("E0806", Exit::Input),
            ("E0901", Exit::File),
            ("E0920", Exit::Input),
            ("E0940", Exit::Usage),
        ] {
            assert_eq!(exit_of(code), exit, "{code}");
        }
    }

    #[test]
    fn one_file_under_two_names_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&a, "x").unwrap();
        std::fs::hard_link(&a, &b).unwrap();
        assert!(same_file(&a, &folder.path().join(".").join("a")));
        assert!(same_file(&a, &b));
        assert!(!same_file(&a, &folder.path().join("c")));
    }
}
