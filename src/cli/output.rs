//! Results: to a file that appears whole or not at all, to standard output, or as a table on a terminal.

use super::session::{Exit, Session};
use super::table::Table;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::formats::{self, Format, Heading};
use crate::trace::runs::NUMBER;
use crate::trace::{Sink, Trace, csv, raw};
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// A file in the making: under another name until it is complete.
pub struct NewFile {
    /// The name as the user gave it.
    pub name: String,
    target: PathBuf,
    temporary: Option<PathBuf>,
    file: File,
}

impl NewFile {
    /// Begins a file. Devices and pipes are written directly.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn create(name: &str, session: &mut Session) -> Result<NewFile, Exit> {
        session.spare_inputs(name)?;
        NewFile::replace(name, session)
    }

    /// Begins a file that may take the place of an input.
    fn replace(name: &str, session: &mut Session) -> Result<NewFile, Exit> {
        let begin = || -> io::Result<NewFile> {
            let path = Path::new(name);
            // A link stays one: what it leads to is replaced.
            let target = match path.canonicalize() {
                // Links in a circle lead to nothing.
                Err(error) if path.is_symlink() && error.kind() != io::ErrorKind::NotFound => {
                    return Err(error);
                }
                other => other.unwrap_or_else(|_| path.to_path_buf()),
            };
            if target.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
                let file = File::options().write(true).open(&target)?;
                return Ok(NewFile { name: name.into(), target, temporary: None, file });
            }
            if target.is_dir() {
                return Err(io::Error::from(io::ErrorKind::IsADirectory));
            }
            let plain = target.file_name().map_or("out".into(), |n| n.to_string_lossy());
            let hidden = target.with_file_name(format!(".{plain}.{}.tmp", std::process::id()));
            let file = File::options().write(true).create_new(true).open(&hidden)?;
            Ok(NewFile { name: name.into(), target, temporary: Some(hidden), file })
        };
        begin().map_err(|error| session.unwritable(name, &error))
    }

    /// Gives the file its name, or the name with `.partial` when the work was not finished.
    ///
    /// # Errors
    /// What the system says.
    pub fn close(mut self, whole: bool) -> io::Result<PathBuf> {
        let Some(temporary) = self.temporary.take() else { return Ok(self.target.clone()) };
        let mut target = self.target.clone();
        if !whole {
            let mut name = target.file_name().unwrap_or_default().to_os_string();
            name.push(".partial");
            target.set_file_name(name);
        }
        std::fs::rename(&temporary, &target).inspect_err(|_| {
            let _ = std::fs::remove_file(&temporary);
        })?;
        Ok(target)
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            let _ = std::fs::remove_file(temporary);
        }
    }
}

/// Writes a whole text to a file, or to standard output for `None` and `-`.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn write_text(to: Option<&str>, text: &str, session: &mut Session) -> Result<(), Exit> {
    match to {
        None | Some("-") => {
            let mut stdout = io::stdout().lock();
            let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
            written.map_err(|error| session.unwritable("<stdout>", &error))
        }
        Some(name) => {
            let mut file = NewFile::create(name, session)?;
            let written = file.file.write_all(text.as_bytes());
            let written = written.and_then(|()| file.close(true));
            written.map(|_| ()).map_err(|error| session.unwritable(name, &error))
        }
    }
}

/// Puts another text into a file that was read, which keeps its permissions.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn replace_text(name: &str, text: &str, session: &mut Session) -> Result<(), Exit> {
    let mut file = NewFile::replace(name, session)?;
    let written = (|| {
        file.file.write_all(text.as_bytes())?;
        if file.temporary.is_some() {
            file.file.set_permissions(file.target.metadata()?.permissions())?;
        }
        file.close(true)
    })();
    written.map(|_| ()).map_err(|error| session.unwritable(name, &error))
}

/// Where rows go while they are computed.
pub struct Output {
    kind: Kind,
    heading: Heading,
}

enum Kind {
    Csv(Box<csv::Rows<Writer>>, Option<NewFile>),
    Raw(Box<raw::Rows<File>>, NewFile),
    /// Collected, then written.
    Whole(Trace, &'static Format, Option<NewFile>),
    /// Collected, then summed up for a terminal.
    Table(Trace),
}

/// A file or standard output.
enum Writer {
    File(File),
    Stdout(io::Stdout),
}

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Writer::File(file) => file.write(bytes),
            Writer::Stdout(stdout) => stdout.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Writer::File(file) => file.flush(),
            Writer::Stdout(stdout) => stdout.flush(),
        }
    }
}

/// The format of a result: what `--format` says, else what the ending of `-o` says, else CSV.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn format_for(
    format: Option<&str>,
    to: Option<&str>,
    session: &mut Session,
) -> Result<&'static Format, Exit> {
    let names: Vec<&str> = formats::FORMATS.iter().map(|format| format.name).collect();
    let names = names.join(", ");
    if let Some(name) = format {
        return formats::by_name(name).ok_or_else(|| {
            let message = format!("no format is called `{name}`");
            let known = format!("formats: {names}");
            session.fail(Diagnostic::error("E0941", Span::NONE, message).help(known))
        });
    }
    let csv = &formats::FORMATS[formats::FORMATS.len() - 1];
    match to {
        None | Some("-") => Ok(csv),
        Some(path) if Path::new(path).extension().is_none() => Ok(csv),
        Some(path) if !Path::new(path).is_file() && Path::new(path).exists() => Ok(csv),
        Some(path) => formats::by_ending(path).ok_or_else(|| {
            let message = format!("the ending of `{path}` says no format");
            let help = format!("add --format with one of {names}");
            session.fail(Diagnostic::error("E0941", Span::NONE, message).help(help))
        }),
    }
}

impl Output {
    /// Opens the result of a run.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn open(
        to: Option<&str>,
        format: Option<&str>,
        heading: Heading,
        names: &[String],
        units: &[String],
        session: &mut Session,
    ) -> Result<Output, Exit> {
        let chosen = format_for(format, to, session)?;
        let to = to.filter(|name| *name != "-");
        if let Some(why) = (chosen.refuses)(names) {
            let message = format!("the result cannot be written as `{}`: {why}", chosen.name);
            let error = Diagnostic::error("E0935", Span::NONE, message);
            return Err(session.fail(error.help("CSV, RAW and JSON hold every result")));
        }
        let rows = || Trace::new(names.to_vec(), units.to_vec());
        let kind = match (chosen.name, to) {
            (_, None) if format.is_none() && io::stdout().is_terminal() => Kind::Table(rows()),
            ("csv", to) => {
                let file = to.map(|name| NewFile::create(name, session)).transpose()?;
                let name = to.unwrap_or("<stdout>");
                let writer = match &file {
                    Some(file) => file.file.try_clone().map(Writer::File),
                    None => Ok(Writer::Stdout(io::stdout())),
                };
                let rows = writer.and_then(|w| csv::Rows::new(w, &heading, names, units));
                let rows = rows.map_err(|error| session.unwritable(name, &error))?;
                Kind::Csv(Box::new(rows), file)
            }
            ("raw", Some(name)) => {
                let file = NewFile::create(name, session)?;
                if file.temporary.is_none() {
                    Kind::Whole(rows(), chosen, Some(file))
                } else {
                    let writer = file.file.try_clone();
                    let rows = writer.and_then(|w| raw::Rows::new(w, &heading, names, units));
                    let rows = rows.map_err(|error| session.unwritable(name, &error))?;
                    Kind::Raw(Box::new(rows), file)
                }
            }
            (_, to) => {
                let file = to.map(|name| NewFile::create(name, session)).transpose()?;
                Kind::Whole(rows(), chosen, file)
            }
        };
        Ok(Output { kind, heading })
    }

    /// Writes what is still held back and gives files their names. When the run did not finish, what there is goes
    /// to a file with `.partial` after its name, and standard output gets no half JSON.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn close(self, whole: bool, session: &mut Session) -> Result<(), Exit> {
        let heading = self.heading;
        let mut name = "<stdout>".to_string();
        let mut named = |file: &NewFile| name.clone_from(&file.name);
        let written = match self.kind {
            Kind::Csv(rows, None) => rows.finish().and_then(|mut w| w.flush()).map(|()| None),
            Kind::Csv(rows, Some(file)) => {
                named(&file);
                rows.finish().and_then(|_| file.close(whole)).map(Some)
            }
            Kind::Raw(rows, file) => {
                named(&file);
                rows.finish().and_then(|_| file.close(whole)).map(Some)
            }
            Kind::Whole(trace, format, Some(mut file)) => {
                named(&file);
                let written = (format.write)(&trace, &heading, &mut file.file);
                written.and_then(|()| file.close(whole)).map(Some)
            }
            Kind::Whole(_, _, None) if !whole => Ok(None),
            Kind::Whole(trace, format, None) => {
                (format.write)(&trace, &heading, &mut io::stdout().lock()).map(|()| None)
            }
            Kind::Table(trace) => {
                let list = trace.names.iter().any(|name| name == NUMBER);
                let text = if list { rows(&trace) } else { summary(&trace) }.to_text();
                let written = io::stdout().lock().write_all(text.as_bytes());
                session
                    .remark("hint: -o out.csv keeps every row; --list names what can be observed");
                written.map(|()| None)
            }
        };
        match written {
            Ok(Some(path)) if !whole => {
                session.remark(&format!("the rows so far are in `{}`", path.display()));
                Ok(())
            }
            Ok(_) => Ok(()),
            Err(error) => Err(session.unwritable(&name, &error)),
        }
    }
}

impl Sink for Output {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        match &mut self.kind {
            Kind::Csv(rows, _) => rows.row(values),
            Kind::Raw(rows, _) => rows.row(values),
            Kind::Whole(trace, _, _) | Kind::Table(trace) => trace.row(values),
        }
    }
}

/// The rows of a list.
fn rows(trace: &Trace) -> Table {
    let head = trace.names.iter().zip(&trace.units).map(|(name, unit)| match unit.as_str() {
        "" => name.clone(),
        unit => format!("{name} [{unit}]"),
    });
    let head: Vec<String> = head.collect();
    let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
    for row in 0..trace.rows() {
        let cell = |column: &Vec<f64>| match column[row] {
            value if value.is_nan() => "-".to_string(),
            value => super::table::short(value),
        };
        table.row(trace.columns.iter().map(cell));
    }
    table
}

/// Name, unit, first, last, least and greatest value of each column.
pub fn summary(trace: &Trace) -> Table {
    let mut table = Table::new(&["name", "unit", "first", "last", "min", "max"]);
    for ((name, unit), column) in trace.names.iter().zip(&trace.units).zip(&trace.columns) {
        let number = |value: Option<&f64>| value.map_or("-".into(), |v| super::table::short(*v));
        let least = column.iter().min_by(|a, b| a.total_cmp(b));
        let greatest = column.iter().max_by(|a, b| a.total_cmp(b));
        table.row([
            name.clone(),
            unit.clone(),
            number(column.first()),
            number(column.last()),
            number(least),
            number(greatest),
        ]);
    }
    table
}
