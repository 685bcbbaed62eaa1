//! What is said when a file cannot be read or written.

use super::Diagnostic;
use crate::source::Span;
use crate::source::loader::{LoadError, LoadErrorKind, reason};

impl From<LoadError> for Diagnostic {
    fn from(error: LoadError) -> Diagnostic {
        let name = &error.name;
        let file = |code, message| Diagnostic::error(code, Span::NONE, message);
        match error.kind {
            LoadErrorKind::Missing { nearest } => {
                let missing = file("E0901", format!("no file `{name}`"));
                match nearest {
                    Some(nearest) => missing.help(format!("did you mean `{nearest}`?")),
                    None => missing,
                }
            }
            LoadErrorKind::Unreadable(reason) => {
                file("E0902", format!("cannot read `{name}`: {reason}"))
            }
            LoadErrorKind::Folder => {
                file("E0903", format!("`{name}` is a folder, a file is needed"))
            }
            LoadErrorKind::TooLarge { limit } => {
                let limit = limit >> 20;
                file("E0904", format!("`{name}` is too large: more than {limit} MiB"))
            }
            LoadErrorKind::NotUtf8 { offset, span } => {
                Diagnostic::error("E0191", span, format!("`{name}` is not UTF-8"))
                    .says(format!("byte {offset} begins no character"))
                    .help("save the file as UTF-8")
            }
            LoadErrorKind::Binary { offset, span } => {
                Diagnostic::error("E0192", span, format!("`{name}` is no text"))
                    .says(format!("byte {offset} is zero"))
                    .help("a source is text; results are read by `bondspice compare` and `trace`")
            }
            LoadErrorKind::Empty { span } => {
                Diagnostic::error("E0193", span, format!("`{name}` is empty"))
            }
        }
    }
}

/// A file that cannot be written.
pub fn unwritable(name: &str, error: &std::io::Error) -> Diagnostic {
    Diagnostic::error("E0905", Span::NONE, format!("cannot write `{name}`: {}", reason(error)))
}
