//! The table of runs: written in order while runs end, taken up again, put together from parts.

use super::Part;
use super::runner::Row;
use crate::analysis::sweep::Space;
use crate::cli::session::{Exit, Session};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::fs::File;
use std::io::{self, Write};

/// A table in the making: `OUT.partial` until it is complete.
pub struct Table {
    name: Option<String>,
    header: Vec<String>,
    /// Lines of the runs that are done, without the header.
    kept: Vec<Vec<String>>,
    to: Option<Box<dyn Write>>,
}

impl Table {
    /// For a file, or standard output.
    ///
    /// # Errors
    /// The exit code, when what is wrong has been said.
    pub fn open(
        name: Option<&str>,
        header: &[String],
        session: &mut Session,
    ) -> Result<Table, Exit> {
        let name = name.filter(|name| *name != "-").map(String::from);
        if let Some(name) = &name {
            session.spare_inputs(name)?;
        }
        Ok(Table { name, header: header.to_vec(), kept: vec![], to: None })
    }

    /// Where the runs so far are kept.
    pub fn partial(&self) -> Option<String> {
        self.name.as_ref().map(|name| format!("{name}.partial"))
    }

    /// Takes up the runs that a sweep before has made. Says how many.
    ///
    /// # Errors
    /// The exit code: what it has made is of another sweep.
    pub fn resume(
        &mut self,
        part: Part,
        space: &Space,
        session: &mut Session,
    ) -> Result<u64, Exit> {
        let Some(name) = self.partial() else { return Ok(0) };
        if !std::path::Path::new(&name).exists() {
            return Ok(0);
        }
        let text = session.load_text(&name)?;
        // The last line may have been cut while it was written.
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let lines = lines_of(whole);
        let foreign = |what: String, session: &mut Session| {
            let message = format!("`{name}` is of another sweep: {what}");
            let error = Diagnostic::error("E1204", Span::NONE, message);
            Err(session.fail(error.help("leave --resume out, or name another file after -o")))
        };
        match lines.first() {
            None => return Ok(0),
            Some(header) if *header != self.header => {
                return foreign(format!("its columns are {}", header.join(", ")), session);
            }
            _ => {}
        }
        let runs = (0..).map_while(|at| part.run(at));
        for (line, run) in lines[1..].iter().zip(runs) {
            let settings = space.settings(run);
            let own: Vec<String> = std::iter::once(run.to_string())
                .chain(settings.iter().map(|setting| shown(setting.value)))
                .collect();
            if line.len() != self.header.len() || line[..own.len()] != own {
                return foreign(format!("its run {} has other values", line[0]), session);
            }
        }
        if lines.len() as u64 - 1 > part.runs() {
            return foreign("it has more runs".into(), session);
        }
        self.kept = lines[1..].to_vec();
        Ok(self.kept.len() as u64)
    }

    /// Begins to write.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn begin(&mut self, session: &mut Session) -> Result<(), Exit> {
        let begun = (|| {
            let mut to: Box<dyn Write> = match self.partial() {
                Some(name) => Box::new(File::create(name)?),
                None => Box::new(io::stdout()),
            };
            let lines = std::iter::once(&self.header).chain(&self.kept);
            lines.map(|line| line_of(line)).try_for_each(|line| to.write_all(line.as_bytes()))?;
            self.to = Some(to);
            Ok(())
        })();
        begun.map_err(|error| self.unwritable(&error, session))
    }

    /// Writes the row of a run at once: a sweep may be stopped at any time.
    ///
    /// # Errors
    /// What the system says.
    pub fn row(&mut self, row: &Row) -> io::Result<()> {
        let measured = self.header.len() - 1 - row.settings.len();
        let settings = row.settings.iter().map(|setting| shown(setting.value));
        let value =
            |at: usize| row.values.get(at).copied().flatten().map(shown).unwrap_or_default();
        let cells: Vec<String> = std::iter::once(row.run.to_string())
            .chain(settings)
            .chain((0..measured).map(value))
            .collect();
        let Some(to) = &mut self.to else { return Ok(()) };
        to.write_all(line_of(&cells).as_bytes())?;
        to.flush()
    }

    /// Says that it cannot be written.
    pub fn unwritable(&self, error: &io::Error, session: &mut Session) -> Exit {
        session.unwritable(self.name.as_deref().unwrap_or("<stdout>"), error)
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn close(&mut self, session: &mut Session) -> Result<(), Exit> {
        self.to = None;
        match (self.partial(), &self.name) {
            (Some(partial), Some(name)) => {
                std::fs::rename(partial, name).map_err(|error| session.unwritable(name, &error))
            }
            _ => Ok(()),
        }
    }
}

/// The shortest digits that read back the same.
fn shown(value: f64) -> String {
    let mut digits = String::new();
    crate::trace::csv::number(value, &mut digits);
    digits
}

fn line_of(cells: &[String]) -> String {
    // An empty cell is a value that there is none of, not a name.
    let cell = |cell: &String| match cell.is_empty() {
        true => String::new(),
        false => crate::trace::csv::quoted(cell),
    };
    cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n"
}

/// Cells of a table's lines.
fn lines_of(text: &str) -> Vec<Vec<String>> {
    let mut reader =
        ::csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
    let records = reader.records().map_while(Result::ok);
    records.map(|record| record.iter().map(String::from).collect()).collect()
}

/// Puts parts of a table together, in the order of their runs.
///
/// # Errors
/// The exit code, when what is wrong has been said.
pub fn merge(parts: &[String], output: Option<&str>, session: &mut Session) -> Result<Exit, Exit> {
    let mut header: Option<(Vec<String>, &String)> = None;
    let mut lines: Vec<(u64, Vec<String>, &String)> = vec![];
    for part in parts {
        let text = session.load_text(part)?;
        let mut own = lines_of(&text).into_iter();
        let first = own.next().unwrap_or_default();
        let wrong = |message: String| Diagnostic::error("E1204", Span::NONE, message);
        if first.first().is_none_or(|name| name != "run") {
            let error =
                wrong(format!("`{part}` is no table of runs: its first column is not `run`"));
            return Err(session.fail(error));
        }
        match &header {
            Some((known, before)) if *known != first => {
                let error = wrong(format!("`{before}` and `{part}` have other columns"));
                return Err(session.fail(error.because(format!(
                    "{} and {}",
                    known.join(","),
                    first.join(",")
                ))));
            }
            Some(_) => {}
            None => header = Some((first, part)),
        }
        for line in own {
            let run = line[0]
                .parse()
                .ok()
                .filter(|_| Some(line.len()) == header.as_ref().map(|h| h.0.len()));
            let Some(run) = run else {
                return Err(session
                    .fail(wrong(format!("`{part}`: a line begins `{}` and is no run", line[0]))));
            };
            lines.push((run, line, part));
        }
    }
    lines.sort_by_key(|(run, ..)| *run);
    if let Some(pair) = lines.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let message = format!("run {} stands in `{}` and in `{}`", pair[0].0, pair[0].2, pair[1].2);
        return Err(session.fail(Diagnostic::error("E1204", Span::NONE, message)));
    }
    let missing = lines.iter().enumerate().find(|(at, (run, ..))| *at as u64 != *run);
    if let Some((at, _)) = missing {
        let message = format!("run {at} is in none of the parts");
        session.say([Diagnostic::warning("W1201", Span::NONE, message)
            .help("a part is missing, or was not finished")]);
    }
    let header = header.map(|(header, _)| header).unwrap_or_default();
    let all = std::iter::once(&header).chain(lines.iter().map(|(_, line, _)| line));
    let text: String = all.map(|line| line_of(line)).collect();
    crate::cli::output::write_text(output, &text, session)?;
    Ok(session.exit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_back_as_they_were_written() {
        let cells = ["0", "", "max(x as \"a, b\")", "1e-3", ""].map(String::from);
        assert_eq!(lines_of(&line_of(&cells)), [cells.to_vec()]);
    }
}
