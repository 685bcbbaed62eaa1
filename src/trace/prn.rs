//! Traces as tables of blanks: what Xyce writes (`.prn`), what ngspice prints (`print`, with page heads) and writes
//! (`wrdata`, with and without names), and what other simulators export as text, Saber among them.
//!
//! A first line of words names the columns (in quotes where they hold blanks; a unit may follow in round or square
//! brackets); without one the first column is `time`, the others `2`, `3`, …. Lines of other words between the numbers,
//! dashes and lines that begin with `#`, `*`, `%` or `;` are passed over, a head that comes again too. A column `index`
//! is left out; where it starts anew, or where the abscissa turns back to its first value, a next run begins. Tables of
//! ngspice that are too wide for a page follow each other with the same abscissa: they are joined.

use super::csv::number;
use super::formats::{Failed, Heading, bad, worse};
use super::{Sink, Trace, send};
use std::io::{self, Write};

/// Writes a whole trace, in Xyce's manner: `Index`, then the columns; blanks in names become underscores.
///
/// # Errors
/// What writing failed with.
pub fn write(trace: &Trace, _: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let mut to = io::BufWriter::with_capacity(1 << 16, to);
    write!(to, "Index")?;
    for name in &trace.names {
        let name: String = name.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
        write!(to, "  {name}")?;
    }
    writeln!(to)?;
    send(trace, &mut Lines { to: &mut to, index: 0, text: String::new() })?;
    to.flush()
}

struct Lines<'a, W: Write> {
    to: &'a mut W,
    index: usize,
    text: String,
}

impl<W: Write> Sink for Lines<'_, W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        write!(self.to, "{}", self.index)?;
        for value in values {
            self.text.clear();
            number(*value, &mut self.text);
            write!(self.to, "  {}", self.text)?;
        }
        self.index += 1;
        writeln!(self.to)
    }
}

/// Whether a file is probably a table of blanks: its first lines hold no comma or semicolon, and one of them is a row
/// of numbers or begins with `Index`.
pub fn recognises(bytes: &[u8]) -> bool {
    if bytes.iter().take(4096).any(|byte| *byte == 0) {
        return false;
    }
    let begin = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut lines = begin.lines().filter(|line| !line.trim().is_empty() && !is_comment(line));
    for line in lines.by_ref().take(12) {
        let mut words = line.split_whitespace();
        let first = words.next().unwrap_or("");
        if first.eq_ignore_ascii_case("index") && words.next().is_some() {
            return true;
        }
        let numbers = line.split_whitespace().all(|word| value(word).is_some());
        if numbers {
            // A single column is as good a CSV file.
            let nameless = begin.lines().next() == Some(line);
            return line.split_whitespace().nth(1).is_some()
                && (nameless || !line.trim().contains('\t'));
        }
        if separates(line) || line.contains('\t') {
            return false;
        }
    }
    false
}

/// Whether a comma or semicolon stands outside of round brackets.
fn separates(line: &str) -> bool {
    let mut depth = 0_i32;
    line.bytes().any(|byte| {
        depth += i32::from(byte == b'(') - i32::from(byte == b')');
        depth <= 0 && matches!(byte, b',' | b';')
    })
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '*', '%', ';'])
}

/// A number, as computers print them.
fn value(word: &str) -> Option<f64> {
    let begins = word.bytes().next()?;
    let plausible = begins.is_ascii_digit() || matches!(begins, b'+' | b'-' | b'.');
    let named = || ["nan", "inf", "infinity"].iter().any(|name| word.eq_ignore_ascii_case(name));
    (plausible || named()).then(|| word.trim_end_matches(',').parse().ok())?
}

/// The words of a line; those in quotes hold blanks, and a unit in brackets belongs to the word before it.
fn words(line: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = vec![];
    let mut rest = line.trim_start();
    while let Some(first) = rest.chars().next() {
        let (word, after) = match first {
            '"' => rest[1..].split_once('"').unwrap_or((&rest[1..], "")),
            _ => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        rest = after.trim_start();
        let unit = |text: &str| {
            let inner = text.strip_prefix('(').and_then(|text| text.strip_suffix(')'));
            let inner = inner.or_else(|| text.strip_prefix('[')?.strip_suffix(']'));
            inner.map(str::to_string)
        };
        match (unit(word), found.last_mut()) {
            (Some(unit), Some(before)) if before.1.is_empty() => before.1 = unit,
            _ if first == '"' => {
                let split =
                    word.rsplit_once(' ').and_then(|(name, last)| Some((name, unit(last)?)));
                found.push(match split {
                    Some((name, unit)) => (name.trim().to_string(), unit),
                    None => (word.to_string(), String::new()),
                });
            }
            _ => found.push((word.to_string(), String::new())),
        }
    }
    found
}

/// More heads in one file are not believed.
const MOST_TABLES: usize = 1000;

/// A part of a file under one head.
struct Table {
    trace: Trace,
    /// Whether rows begin with an index.
    indexed: bool,
    /// Rows before which a run begins.
    restarts: usize,
    steps: Vec<f64>,
    last_index: f64,
    /// Whether no head names the columns.
    nameless: bool,
}

/// Reads a trace.
///
/// # Errors
/// What is wrong with the table, `E0921`.
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
        worse("E0921", "the table is no text", format!("at line {line}"))
    })?;
    let mut tables: Vec<Table> = vec![];
    let mut open: Option<usize> = None;
    let mut head: Option<Vec<(String, String)>> = None;
    let mut row = vec![];
    for (line, text) in text.lines().enumerate() {
        if text.trim().is_empty() || is_comment(text) {
            continue;
        }
        row.clear();
        row.extend(text.split_whitespace().map_while(value));
        let whole = row.len() == text.split_whitespace().count();
        if !whole {
            // Words; they may be the head of what follows, or say something else.
            if row.is_empty() || !starts_with_number(text) {
                if !text.trim_start().starts_with('-') {
                    head = Some(words(text));
                }
                continue;
            }
            let word = text.split_whitespace().nth(row.len()).unwrap_or("");
            let place = format!("at line {}", line + 1);
            return Err(worse("E0921", format!("`{word}` is no number"), place));
        }
        if let Some(names) = head.take() {
            open = place(&mut tables, names, row.len()).or(open);
            if tables.len() > MOST_TABLES {
                return Err(bad("E0921", format!("more than {MOST_TABLES} tables in one file")));
            }
        }
        let at = match open {
            Some(at) => at,
            None => {
                tables.push(Table::nameless(row.len()));
                tables.len() - 1
            }
        };
        open = Some(at);
        let table = &mut tables[at];
        let width = table.trace.names.len() + usize::from(table.indexed);
        if row.len() != width {
            let message = format!("a row has {} fields, the header {width}", row.len());
            return Err(worse("E0921", message, format!("at line {}", line + 1)));
        }
        table.push(&row);
    }
    join(tables)
}

fn starts_with_number(text: &str) -> bool {
    text.split_whitespace().next().is_some_and(|word| value(word).is_some())
}

/// The table of a head: the one that has it, or a new one; none where the words are no head.
fn place(tables: &mut Vec<Table>, words: Vec<(String, String)>, width: usize) -> Option<usize> {
    if words.len() != width {
        return None;
    }
    let indexed = words.first().is_some_and(|(word, _)| word.eq_ignore_ascii_case("index"));
    let (names, units): (Vec<_>, Vec<_>) = words.into_iter().skip(usize::from(indexed)).unzip();
    let known = |table: &Table| table.indexed == indexed && table.trace.names == names;
    if let Some(at) = tables.iter().position(known) {
        return Some(at);
    }
    tables.push(Table::new(Trace::new(names, units), indexed));
    Some(tables.len() - 1)
}

impl Table {
    fn new(trace: Trace, indexed: bool) -> Table {
        Table { trace, indexed, restarts: 0, steps: vec![], last_index: -1.0, nameless: false }
    }

    fn nameless(width: usize) -> Table {
        let name = |at: usize| if at == 0 { "time".into() } else { (at + 1).to_string() };
        let units = vec!["s".to_string()];
        let trace = Trace::new((0..width).map(name).collect(), units);
        Table { nameless: true, ..Table::new(trace, false) }
    }

    fn push(&mut self, row: &[f64]) {
        let values = &row[usize::from(self.indexed)..];
        let before = self.trace.time().last().copied();
        let index = row.first().copied().filter(|_| self.indexed);
        let restarts = match (index, before) {
            (_, None) => false,
            (Some(index), _) => index <= self.last_index,
            (None, Some(before)) => {
                let back = values[self.trace.abscissa()];
                back < before && self.trace.time().first() == Some(&back)
            }
        };
        self.last_index = index.unwrap_or(0.0);
        self.restarts += usize::from(restarts);
        self.steps.push(self.restarts as f64);
        for (column, value) in self.trace.columns.iter_mut().zip(values) {
            column.push(*value);
        }
    }

    fn finish(mut self) -> Trace {
        // `wrdata` repeats the abscissa before every column.
        for at in (1..self.trace.names.len()).rev() {
            let Trace { names, units, columns } = &mut self.trace;
            if columns[at] == columns[0] && (names[at] == names[0] || self.nameless) {
                names.remove(at);
                units.remove(at);
                columns.remove(at);
            }
        }
        if self.restarts > 0 && !self.trace.is_stepped() {
            self.trace.names.insert(0, super::runs::STEP.into());
            self.trace.units.insert(0, String::new());
            self.trace.columns.insert(0, self.steps);
        }
        self.trace
    }
}

/// Tables over one abscissa are the parts of one that was too wide for a page; else the last one counts.
fn join(tables: Vec<Table>) -> Result<Trace, Failed> {
    let mut whole: Option<Trace> = None;
    for table in tables.into_iter().map(Table::finish).filter(|trace| trace.rows() > 0) {
        match &mut whole {
            Some(first)
                if first.names[0] == table.names[0] && first.columns[0] == table.columns[0] =>
            {
                let Trace { names, units, columns } = table;
                first.names.extend(names.into_iter().skip(1));
                first.units.extend(units.into_iter().skip(1));
                first.columns.extend(columns.into_iter().skip(1));
            }
            _ => whole = Some(table),
        }
    }
    whole.ok_or_else(|| bad("E0924", "the trace has no rows"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Trace {
        assert!(recognises(text.as_bytes()), "{text}");
        read(text.as_bytes()).unwrap()
    }

    #[test]
    fn tables_of_xyce_with_steps() {
        let trace = table(
            "Index       TIME              V(1)\n0   0.0   1.0\n1   1.0e-03  2.0\n0 0.0 3.0\n1 1e-3 4\n\
             End of Xyce(TM) Simulation\n",
        );
        assert_eq!(trace.names, ["step", "TIME", "V(1)"]);
        assert_eq!(trace.columns[0], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(trace.column("v(1)"), Some(&[1.0, 2.0, 3.0, 4.0][..]));
    }

    #[test]
    fn pages_of_ngspice() {
        let page = |from: usize, name: &str| {
            format!(
                "                             rc circuit\n\
                 Transient Analysis  Thu Jan  1 00:00:00  1970\n{dash}\nIndex   time            {name}            \n\
                 {dash}\n{from}\t{from}.000000e+00\t{from}.500000e+00\t\n{next}\t{next}.000000e+00\t7e0\t\n\n",
                dash = "-".repeat(60),
                next = from + 1
            )
        };
        let trace =
            table(&(page(0, "v(a)") + &page(2, "v(a)") + &page(0, "v(b)") + &page(2, "v(b)")));
        assert_eq!(trace.names, ["time", "v(a)", "v(b)"]);
        assert_eq!(trace.columns[0], [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(trace.columns[2], [0.5, 7.0, 2.5, 7.0]);
    }

    #[test]
    fn tables_without_names_and_with_units() {
        let trace = table(" 0.0  1.5 \n 1.0  2.5 \n");
        assert_eq!(trace.names, ["time", "2"]);
        let trace = table(" 0.0  1.5  0.0 7 \n 1.0  2.5 1.0 8\n");
        assert_eq!(trace.names, ["time", "2", "4"]);
        let trace = table(" time a time b\n 0 1 0 2\n 1 3 1 4\n");
        assert_eq!(trace.names, ["time", "a", "b"]);
        let trace = table("* exported\n\"time (s)\"  \"pump pressure (bar)\"\n0 1\n.5 -2e+1\n");
        assert_eq!(trace.names, ["time", "pump pressure"]);
        assert_eq!(trace.units, ["s", "bar"]);
        let trace = table("t [s]   x [mm]\n# more\n0 1\n");
        assert_eq!((&trace.names[1][..], &trace.units[1][..]), ("x", "mm"));
    }

    #[test]
    fn broken_tables_are_refused() {
        for text in ["t x\n0 1\n1\n", "t x\n0 1\n1 one\n", "Index t\n"] {
            let code = read(text.as_bytes()).unwrap_err().code;
            assert!(matches!(code, "E0921" | "E0924"), "{text}: {code}");
        }
        assert!(!recognises(b"time,x\n0,1\n") && !recognises(b"pump pressure\tx\n0\t1\n"));
    }
}
