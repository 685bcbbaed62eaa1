//! Traces as value change dumps (IEEE 1364, 18): times in whole multiples of a time scale, `real` variables.
//!
//! Written, every variable has its value at every time; two rows of one time (the sides of a jump) follow each other
//! under one `#`. Times are rounded to the time scale, the finest of 1 fs, 10 fs, 100 fs … with which the last one fits
//! into 62 bits. Read, `real` variables run in straight lines from value to value, as other traces do, and others
//! (wires, registers) hold theirs until it changes: such a change is two rows of one time. `x` and `z` are no numbers.

use super::csv::number;
use super::formats::{Failed, Heading, bad, worse};
use super::runs::STEP;
use super::{Sink, Trace, send};
use std::collections::HashMap;
use std::io::{self, Write};

/// Powers of ten of the time scales, in seconds, and how they are written.
const SCALES: &[(i32, &str)] =
    &[(-15, "fs"), (-12, "ps"), (-9, "ns"), (-6, "us"), (-3, "ms"), (0, "s")];

/// More variables than this are not believed.
const MOST_VARIABLES: usize = 1 << 20;

/// A dump says what changes, a trace everything: so many values for each byte of it, beside those of [`ANYWAY`], are
/// the most.
const VALUES: usize = 8;

/// So many values are taken of the smallest dump.
const ANYWAY: usize = 1 << 20;

/// Why a trace of these columns cannot be written.
pub fn refuses(names: &[String]) -> Option<&'static str> {
    match names.first().map(String::as_str) {
        Some("time") => None,
        Some(STEP) => Some("it holds one run, and this result has steps"),
        _ => Some("it holds values over time alone"),
    }
}

/// Writes a whole trace.
///
/// # Errors
/// What writing failed with.
pub fn write(trace: &Trace, heading: &Heading, to: &mut dyn Write) -> io::Result<()> {
    let mut to = io::BufWriter::with_capacity(1 << 16, to);
    let last = trace.time().iter().fold(0.0_f64, |most, t| most.max(t.abs()));
    let fits = |power: &i32| last * 10_f64.powi(-power) < 4e18;
    let power = (-15..=0).find(fits).unwrap_or(0);
    let (base, unit) = SCALES.iter().rev().find(|(base, _)| *base <= power).unwrap_or(&SCALES[0]);
    let title = heading.title.split(['\n', '\r']).next().unwrap_or("").replace("$end", "");
    write!(
        to,
        "$version bondspice 0.1 $end\n$comment {title} $end\n$timescale {} {unit} $end\n\
         $scope module bondspice $end\n",
        10_u32.pow((power - base) as u32)
    )?;
    for (at, name) in trace.names.iter().enumerate().skip(1) {
        let name: String = name.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
        writeln!(to, "$var real 64 {} {name} $end", code(at))?;
    }
    to.write_all(b"$upscope $end\n$enddefinitions $end\n")?;
    send(trace, &mut Changes { to: &mut to, power, at: None, text: String::new() })?;
    to.flush()
}

/// The code of a variable: printable letters without blanks.
fn code(mut at: usize) -> String {
    let mut code = String::new();
    loop {
        code.push((b'!' + (at % 94) as u8) as char);
        at /= 94;
        if at == 0 {
            return code;
        }
    }
}

struct Changes<'a, W: Write> {
    to: &'a mut W,
    power: i32,
    at: Option<i64>,
    text: String,
}

impl<W: Write> Sink for Changes<'_, W> {
    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        let time = (values[0] * 10_f64.powi(-self.power)).round() as i64;
        if self.at != Some(time) {
            self.at = Some(time);
            writeln!(self.to, "#{time}")?;
        }
        for (at, value) in values.iter().enumerate().skip(1) {
            self.text.clear();
            number(*value, &mut self.text);
            writeln!(self.to, "r{} {}", self.text, code(at))?;
        }
        Ok(())
    }
}

/// Whether a file begins as value change dumps do.
pub fn recognises(bytes: &[u8]) -> bool {
    let mut words = bytes.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let first = words.next().unwrap_or_default();
    let keywords: [&[u8]; 7] =
        [b"$date", b"$version", b"$comment", b"$timescale", b"$scope", b"$var", b"$enddefinitions"];
    keywords.contains(&first)
}

/// A dump on its way.
#[derive(Default)]
struct Dump<'a> {
    /// Power of ten of a tick, in seconds.
    power: i32,
    scopes: Vec<&'a str>,
    names: Vec<String>,
    /// Whether the variable holds its value until it changes.
    holds: Vec<bool>,
    codes: HashMap<&'a str, Vec<usize>>,
    /// The time of the changes that are being read.
    time: f64,
    /// Values at the end of the last row, and those that are being read.
    before: Vec<f64>,
    now: Vec<f64>,
    changed: Vec<bool>,
    dirty: bool,
    /// Values that may still be written.
    left: usize,
    columns: Vec<Vec<f64>>,
}

/// Reads a trace.
///
/// # Errors
/// What is wrong with the file, `E0934`.
pub fn read(bytes: &[u8]) -> Result<Trace, Failed> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| worse("E0934", "the dump is no text", error.to_string()))?;
    let mut words = text.split_ascii_whitespace();
    let left = bytes.len() * VALUES + ANYWAY;
    let mut dump = Dump { power: -9, left, ..Dump::default() };
    while let Some(word) = words.next() {
        if let Some(keyword) = word.strip_prefix('$') {
            dump.command(keyword, &mut words)?;
        } else {
            dump.change(word, &mut words)?;
        }
    }
    dump.end_row()?;
    let mut trace = Trace { names: dump.names, columns: dump.columns, units: vec![] };
    if trace.columns.is_empty() {
        trace.columns = vec![vec![]; trace.names.len() + 1];
    }
    trace.names.insert(0, "time".into());
    trace.units = vec![String::new(); trace.names.len()];
    trace.units[0] = "s".into();
    Ok(trace)
}

impl<'a> Dump<'a> {
    fn command(
        &mut self,
        keyword: &str,
        words: &mut std::str::SplitAsciiWhitespace<'a>,
    ) -> Result<(), Failed> {
        // The values of these are changes like others.
        if matches!(keyword, "dumpvars" | "dumpall" | "dumpon" | "dumpoff" | "end") {
            return Ok(());
        }
        let mut inside = vec![];
        loop {
            match words.next() {
                Some("$end") => break,
                Some(word) if inside.len() < 16 => inside.push(word),
                Some(_) => {}
                None => return Err(bad("E0934", format!("`${keyword}` never ends"))),
            }
        }
        match (keyword, inside.as_slice()) {
            ("timescale", parts) => {
                let text = parts.concat();
                let digits = text.bytes().take_while(u8::is_ascii_digit).count();
                let unit = SCALES.iter().find(|(_, unit)| *unit == &text[digits..]);
                let tens = ["1", "10", "100"].iter().position(|ten| *ten == &text[..digits]);
                match (unit, tens) {
                    (Some((power, _)), Some(tens)) => self.power = power + tens as i32,
                    _ => return Err(bad("E0934", format!("`{text}` is no time scale"))),
                }
            }
            ("scope", [_, name, ..]) => self.scopes.push(name),
            ("upscope", _) => {
                self.scopes.pop();
            }
            ("var", [kind, _, code, name, ..]) => self.variable(kind, code, name)?,
            ("var", _) => return Err(bad("E0934", "a variable of the dump has no name")),
            _ => {}
        }
        Ok(())
    }

    fn variable(&mut self, kind: &str, code: &'a str, name: &str) -> Result<(), Failed> {
        if self.names.len() >= MOST_VARIABLES || self.dirty || !self.columns.is_empty() {
            return Err(bad("E0934", "the dump declares too many variables, or too late"));
        }
        let known = self.codes.entry(code).or_default();
        known.push(self.names.len());
        // The outermost scope is the design itself.
        let mut path: Vec<&str> = self.scopes.iter().skip(1).copied().collect();
        path.push(name);
        self.names.push(path.join("."));
        self.holds.push(!matches!(kind, "real" | "realtime"));
        self.before.push(f64::NAN);
        self.now.push(f64::NAN);
        self.changed.push(false);
        Ok(())
    }

    /// A time `#…`, or the new value of a variable.
    fn change(
        &mut self,
        word: &'a str,
        words: &mut std::str::SplitAsciiWhitespace<'a>,
    ) -> Result<(), Failed> {
        let wrong = || bad("E0934", format!("`{word}` is no change of a value"));
        if let Some(ticks) = word.strip_prefix('#') {
            let digits = !ticks.is_empty() && ticks.bytes().all(|byte| byte.is_ascii_digit());
            let time = format!("{ticks}e{}", self.power).parse().ok().filter(|_| digits);
            let time: f64 = time.ok_or_else(|| bad("E0934", format!("`{word}` is no time")))?;
            self.end_row()?;
            self.time = time;
            return Ok(());
        }
        let (kind, rest) = word.split_at_checked(1).ok_or_else(wrong)?;
        let (value, code) = match kind {
            "r" | "R" => (rest.parse().map_err(|_| wrong())?, words.next().ok_or_else(wrong)?),
            "b" | "B" => (binary(rest).ok_or_else(wrong)?, words.next().ok_or_else(wrong)?),
            "s" | "S" => (f64::NAN, words.next().ok_or_else(wrong)?),
            "0" => (0.0, rest),
            "1" => (1.0, rest),
            "x" | "X" | "z" | "Z" => (f64::NAN, rest),
            _ => return Err(wrong()),
        };
        let places = self.codes.get(code).ok_or_else(|| {
            bad("E0934", format!("the dump changes `{code}`, which no variable is called"))
        })?;
        // A second value at one time is the other side of a jump.
        if places.iter().any(|place| self.changed[*place] && !self.holds[*place]) {
            self.end_row()?;
        }
        let places = self.codes.get(code).map_or(&[][..], Vec::as_slice);
        spend(&mut self.left, places.len())?;
        for place in places {
            self.now[*place] = value;
            self.changed[*place] = true;
        }
        self.dirty = true;
        Ok(())
    }

    /// Writes the row of the changes so far; where a value that holds has changed, a row before it.
    fn end_row(&mut self) -> Result<(), Failed> {
        if !self.dirty {
            return Ok(());
        }
        spend(&mut self.left, 2 * (self.names.len() + 1))?;
        if self.columns.is_empty() {
            self.columns = vec![vec![]; self.names.len() + 1];
        }
        let first = self.columns[0].is_empty();
        let steps = (0..self.now.len()).any(|k| {
            self.holds[k] && self.changed[k] && self.now[k].to_bits() != self.before[k].to_bits()
        });
        if steps && !first {
            self.columns[0].push(self.time);
            for (k, column) in self.columns.iter_mut().skip(1).enumerate() {
                column.push(if self.holds[k] { self.before[k] } else { self.now[k] });
            }
        }
        self.columns[0].push(self.time);
        for (column, value) in self.columns.iter_mut().skip(1).zip(&self.now) {
            column.push(*value);
        }
        self.before.copy_from_slice(&self.now);
        self.changed.fill(false);
        self.dirty = false;
        Ok(())
    }
}

/// Takes values from those that are left.
fn spend(left: &mut usize, values: usize) -> Result<(), Failed> {
    match left.checked_sub(values) {
        Some(rest) => *left = rest,
        None => {
            let message = "the dump is too sparse: as a trace it would be many times as large";
            let error = bad("E0934", message);
            return Err(Box::new(error.help("dump fewer variables, or over a shorter time")));
        }
    }
    Ok(())
}

/// A binary number; no number where a digit is unknown.
fn binary(digits: &str) -> Option<f64> {
    digits.bytes().try_fold(0.0, |value: f64, digit| match digit {
        b'0' => Some(2.0 * value),
        b'1' => Some(2.0 * value + 1.0),
        b'x' | b'X' | b'z' | b'Z' => Some(f64::NAN),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wires_hold_and_reals_run() {
        let dump = b"$date today $end $timescale 10 ns $end $scope module top $end\n\
            $var wire 1 ! clk $end $scope module a $end $var reg 4 # bus [3:0] $end $upscope $end\n\
            $var real 64 % v $end $upscope $end $enddefinitions $end\n\
            #0 $dumpvars 0! b0000 # r0 % $end\n#5 1! r0.5 %\n#10 0! b101 # r1.0 %\n#20 x! r2 %\n";
        let trace = read(dump).unwrap();
        assert_eq!(trace.names, ["time", "clk", "a.bus", "v"]);
        let near = |a: &[f64], b: &[f64]| {
            assert!(
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-20),
                "{a:?}"
            );
        };
        near(&trace.columns[0], &[0.0, 50e-9, 50e-9, 100e-9, 100e-9, 200e-9, 200e-9]);
        assert_eq!(trace.columns[1][..6], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        assert!(trace.columns[1][6].is_nan());
        assert_eq!(trace.columns[2], [0.0, 0.0, 0.0, 0.0, 5.0, 5.0, 5.0]);
        assert_eq!(trace.columns[3], [0.0, 0.5, 0.5, 1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn broken_dumps_are_refused() {
        for dump in [
            "$timescale 3 ns $end",
            "$timescale 1 min $end",
            "$var real 64 ! $end",
            "$scope module",
            "$enddefinitions $end #x",
            "$enddefinitions $end #0 r1 !",
            "$var real 64 ! v $end #0 rone !",
            "$var real 64 ! v $end #0 r1",
            "$var real 64 ! v $end #0 q1 !",
            "$var real 64 ! v $end #0 \u{b5}",
            "$var real 64 ! v $end #0 r1 ! $var real 64 # w $end #1 r1 #",
        ] {
            assert_eq!(read(dump.as_bytes()).unwrap_err().code, "E0934", "{dump}");
        }
        assert_eq!(read(b"$var real 1 ! a $end \xff").unwrap_err().code, "E0934");
    }

    #[test]
    fn sparse_dumps_do_not_unfold() {
        let mut dump: String = (0..4000).map(|k| format!("$var wire 1 {k} w{k} $end\n")).collect();
        (0..4000).for_each(|k| dump += &format!("#{k} 1{k}\n"));
        assert_eq!(read(dump.as_bytes()).unwrap_err().code, "E0934");
    }

    #[test]
    fn many_variables_have_codes_of_their_own() {
        let codes: std::collections::HashSet<String> = (0..20_000).map(code).collect();
        assert_eq!(codes.len(), 20_000);
    }
}
