//! `.measure`: what is to be taken from the rows of a run, in the forms of ngspice, Xyce, LTspice and HSPICE.
//!
//! ```text
//! .measure tran NAME TRIG v(a) VAL=0.5 RISE=1 TARG v(b) VAL=0.5 FALL=LAST
//! .measure tran NAME FIND v(b) WHEN v(a)=0.5 CROSS=2        also AT=1m
//! .measure tran NAME WHEN v(a)=v(b) FROM=1m TO=2m TD=1u
//! .measure tran NAME DERIV v(a) AT=1m
//! .measure tran NAME AVG v(a) FROM=1m TO=2m                 RMS MIN MAX PP INTEG MIN_AT MAX_AT; TRIG … TARG … as limits
//! .measure tran NAME PARAM='other/2'                        also EQN
//! ```

use super::{Cursor, Reader};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::netlist::{CardKind, Expr, Leaf, Measure, MeasureKind};
use crate::quantity::nearest;
use crate::trace::measure::{ANALYSES, Edge, Event, Kind, Statistic, Which, Window};

/// Those that others measure too.
const OTHERS: &[&str] =
    &["tran_cont", "ac_cont", "dc_cont", "noise", "noise_cont", "op", "sp", "fft", "four", "tf"];

/// What is made of a column over a window.
const STATISTICS: &[(&str, Statistic)] = &[
    ("avg", Statistic::Average),
    ("rms", Statistic::Rms),
    ("min", Statistic::Minimum),
    ("max", Statistic::Maximum),
    ("pp", Statistic::PeakToPeak),
    ("integ", Statistic::Integral),
    ("integral", Statistic::Integral),
    ("integrate", Statistic::Integral),
    ("min_at", Statistic::MinimumAt),
    ("minat", Statistic::MinimumAt),
    ("max_at", Statistic::MaximumAt),
    ("maxat", Statistic::MaximumAt),
];

/// The other forms.
const FORMS: &[&str] =
    &["trig", "targ", "find", "when", "deriv", "derivative", "param", "eqn", "equation"];

/// Forms of Xyce that are passed over with a warning.
const PASSED: &[&str] = &[
    "duty", "freq", "on_time", "off_time", "error", "err", "err1", "err2", "four", "fft", "enob",
    "sfdr", "snr", "thd", "sndr",
];

/// Keys that say nothing of the value: goals of optimisers, layouts.
const IGNORED: &[&str] = &[
    "goal",
    "minval",
    "weight",
    "print",
    "precision",
    "output",
    "default_val",
    "ignore",
    "ymin",
    "ymax",
];

/// The card, whose keyword has been read.
pub fn measure(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let begin = cursor.at;
    let mut word = cursor.word();
    let mut analysis = String::new();
    let folded = word.0.to_lowercase();
    if ANALYSES.contains(&folded.as_str()) || OTHERS.contains(&folded.as_str()) {
        analysis = folded;
        word = cursor.word();
    }
    if word.0.is_empty() {
        reader.missing(cursor, "the name of the measure");
        return None;
    }
    let name = word.0.to_string();
    let (form, from) = cursor.word();
    if form.is_empty() {
        reader.missing(cursor, "the form of the measure");
        return None;
    }
    let form = form.to_lowercase();
    if OTHERS.contains(&analysis.as_str()) || PASSED.contains(&form.as_str()) {
        let what = if PASSED.contains(&form.as_str()) { &form } else { &analysis };
        let span = cursor.span(reader, 0, cursor.text.len());
        let message = format!("the measure `{name}` is not taken");
        let warning = Diagnostic::warning("W0790", span, message);
        reader.diagnostics.push(warning.because(format!("measures of `{what}` are not computed")));
        cursor.at = cursor.text.len();
        return None;
    }
    let kind = if let Some((_, what)) = STATISTICS.iter().find(|(word, _)| *word == form) {
        let column = item(reader, cursor)?;
        Kind::Over(*what, column, window(reader, cursor)?)
    } else {
        match form.as_str() {
            "trig" => {
                let trig = event(reader, cursor)?;
                if !cursor.word().0.eq_ignore_ascii_case("targ") {
                    reader.missing(cursor, "`TARG`");
                    return None;
                }
                Kind::Delay(trig, event(reader, cursor)?)
            }
            "when" => Kind::When(event(reader, cursor)?),
            "find" => Kind::Find(item(reader, cursor)?, place(reader, cursor)?),
            "deriv" | "derivative" => Kind::Slope(item(reader, cursor)?, place(reader, cursor)?),
            "param" | "eqn" | "equation" => {
                cursor.take(b'=');
                cursor.blanks();
                let from = cursor.at;
                let text = cursor.text[from..].trim_end();
                cursor.at = cursor.text.len();
                Kind::Formula(reader.grouped(cursor, from, from + text.len())?)
            }
            _ => {
                let span = cursor.span(reader, from, cursor.at);
                let message = format!("`{form}` is no form of a measure");
                let error = Diagnostic::error("E0816", span, message);
                let known = FORMS.iter().copied().chain(STATISTICS.iter().map(|(word, _)| *word));
                reader.diagnostics.push(match nearest(&form, known) {
                    Some(near) => error.help(format!("did you mean `{near}`?")),
                    None => error,
                });
                cursor.at = cursor.text.len();
                return None;
            }
        }
    };
    let text = cursor.text[begin..].split_whitespace().collect::<Vec<_>>().join(" ");
    Some(CardKind::Measure(Box::new(Measure { name, analysis, kind, text })))
}

/// Where an expression ends: at a blank, comma or `=` outside brackets and quotes.
fn end_of_item(cursor: &Cursor) -> usize {
    let bytes = cursor.text.as_bytes();
    let (mut depth, mut quote) = (0_i32, None);
    for (at, byte) in bytes.iter().enumerate().skip(cursor.at) {
        match (byte, quote) {
            (_, Some(open)) if *byte == open => quote = None,
            (_, Some(_)) => {}
            (b'\'' | b'"', None) => quote = Some(*byte),
            (b'(' | b'{', None) => depth += 1,
            (b')' | b'}', None) => depth -= 1,
            (b'=', None) if depth <= 0 => {
                let beside = |byte: Option<&u8>| matches!(byte, Some(b'=' | b'<' | b'>' | b'!'));
                if !beside(bytes.get(at + 1)) && !beside(bytes.get(at.wrapping_sub(1))) {
                    return at;
                }
            }
            (b' ' | b'\t' | b'\r' | b',', None) if depth <= 0 => return at,
            _ => {}
        }
    }
    cursor.text.trim_end().len().max(cursor.at)
}

/// An expression: `v(a)`, `{…}`, `'…'`, `par('…')`.
fn item(reader: &mut Reader, cursor: &mut Cursor) -> Option<Expr> {
    cursor.blanks();
    let from = cursor.at;
    let to = end_of_item(cursor);
    if from == to {
        reader.missing(cursor, "what is measured");
        return None;
    }
    cursor.at = to;
    let text = &cursor.text[from..to];
    let inner = text.get(..4).filter(|begin| begin.eq_ignore_ascii_case("par("));
    match inner.and_then(|_| text.strip_suffix(')')) {
        Some(_) => reader.output(cursor, from + 4, to - 1),
        // `v1#branch` and `@r1[i]`, as `.print` takes them.
        None if text.contains('#') || text.starts_with('@') => {
            super::cards::item(reader, cursor, from, to).map(|(_, expr)| expr)
        }
        // `vdb(out)`, `p(r1)`.
        None => match super::analyses::reading(&mut reader.names, &reader.reading, text) {
            Some(leaf) => Some(Expr::new(Node::Leaf(leaf), cursor.span(reader, from, to))),
            None => reader.output(cursor, from, to),
        },
    }
}

/// A value after an `=` that may be left out.
fn value(reader: &mut Reader, cursor: &mut Cursor) -> Option<Expr> {
    cursor.take(b'=');
    item(reader, cursor)
}

/// What may stand after the thing measured.
#[derive(Default)]
struct Limits {
    level: Option<Expr>,
    at: Option<Expr>,
    delay: Option<Expr>,
    from: Option<Expr>,
    to: Option<Expr>,
    edge: Option<(Edge, Which)>,
}

impl Limits {
    fn from(&mut self) -> Expr {
        self.from.take().or(self.delay.take()).unwrap_or(Expr::number(f64::NEG_INFINITY))
    }

    fn to(&mut self) -> Expr {
        self.to.take().unwrap_or(Expr::number(f64::INFINITY))
    }
}

/// Reads keys up to a word that begins something else.
fn limits(reader: &mut Reader, cursor: &mut Cursor) -> Option<Limits> {
    let mut limits = Limits::default();
    while !cursor.is_done() {
        let mut ahead = *cursor;
        let (word, _) = ahead.word();
        let key = word.to_lowercase();
        let place = match key.as_str() {
            "val" => &mut limits.level,
            "at" => &mut limits.at,
            "td" | "delay" => &mut limits.delay,
            "from" => &mut limits.from,
            "to" => &mut limits.to,
            "rise" | "fall" | "cross" => {
                *cursor = ahead;
                let edge = match key.as_str() {
                    "rise" => Edge::Rise,
                    "fall" => Edge::Fall,
                    _ => Edge::Cross,
                };
                limits.edge = Some((edge, which(reader, cursor)?));
                continue;
            }
            "trig" | "targ" | "when" => return Some(limits),
            _ if IGNORED.contains(&key.as_str()) => {
                *cursor = ahead;
                cursor.take(b'=');
                cursor.blanks();
                cursor.at = end_of_item(cursor);
                continue;
            }
            _ => {
                let span = cursor.here(reader);
                let word = cursor.text[cursor.at..].split_whitespace().next().unwrap_or("");
                let message = format!("`{word}` is no part of a measure");
                reader.diagnostics.push(Diagnostic::error("E0816", span, message));
                cursor.at = cursor.text.len();
                return None;
            }
        };
        *cursor = ahead;
        *place = Some(value(reader, cursor)?);
    }
    Some(limits)
}

/// The number of a crossing: 1, 2 …, or `LAST`.
fn which(reader: &mut Reader, cursor: &mut Cursor) -> Option<Which> {
    cursor.take(b'=');
    let (word, from) = cursor.word();
    if word.eq_ignore_ascii_case("last") {
        return Some(Which::Last);
    }
    let number =
        super::number::number(word, reader.reading.numbers).filter(|read| read.end == word.len());
    match number.map(|read| read.value).filter(|n| *n >= 1.0 && n.fract() == 0.0) {
        Some(n) => Some(Which::Number(n as u64)),
        None => {
            let span = cursor.span(reader, from, from + word.len());
            let error = Diagnostic::error("E0816", span, format!("`{word}` counts no crossings"));
            reader.diagnostics.push(error.help("write a whole number from 1 on, or `LAST`"));
            None
        }
    }
}

/// `WHEN …` or `AT=…`.
fn place(reader: &mut Reader, cursor: &mut Cursor) -> Option<Event<Expr, Expr>> {
    let mut before = limits(reader, cursor)?;
    if let Some(at) = before.at {
        return Some(Event::At(at));
    }
    if !cursor.word().0.eq_ignore_ascii_case("when") {
        reader.missing(cursor, "`WHEN` or `AT=`");
        return None;
    }
    let mut event = event(reader, cursor)?;
    // ngspice takes the limits on either side of the condition.
    if let Event::Crossing { from, to, .. } = &mut event {
        if before.from.is_some() || before.delay.is_some() {
            *from = before.from();
        }
        if before.to.is_some() {
            *to = before.to();
        }
    }
    Some(event)
}

/// `v(a)=0.5 RISE=1`, `v(a) VAL=0.5`, `AT=1m`.
fn event(reader: &mut Reader, cursor: &mut Cursor) -> Option<Event<Expr, Expr>> {
    if cursor.next_word().eq_ignore_ascii_case("at") {
        return limits(reader, cursor)?.at.map(Event::At);
    }
    let column = item(reader, cursor)?;
    let beside = if cursor.take(b'=') { Some(item(reader, cursor)?) } else { None };
    let mut limits = limits(reader, cursor)?;
    let Some(level) = beside.or(limits.level.take()) else {
        reader.missing(cursor, "the level that is passed, `=0.5` or `VAL=0.5`,");
        return None;
    };
    let (edge, which) = limits.edge.unwrap_or((Edge::Cross, Which::Number(1)));
    let (from, to) = (limits.from(), limits.to());
    let mut varies = false;
    level.leaves(&mut |leaf, _| varies |= !matches!(leaf, Leaf::Parameter(_)));
    let (column, level) = match varies {
        true => (column.binary(Binary::Subtract, level), Expr::number(0.0)),
        false => (column, level),
    };
    Some(Event::Crossing { column, level, edge, which, from, to })
}

/// `FROM=… TO=…`, or `TRIG … TARG …`.
fn window(reader: &mut Reader, cursor: &mut Cursor) -> Option<Window<Expr, Expr>> {
    let mut limits = limits(reader, cursor)?;
    if cursor.next_word().eq_ignore_ascii_case("trig") {
        cursor.word();
        let trig = event(reader, cursor)?;
        if !cursor.word().0.eq_ignore_ascii_case("targ") {
            reader.missing(cursor, "`TARG`");
            return None;
        }
        return Some(Window::Events(trig, event(reader, cursor)?));
    }
    Some(Window::Between(limits.from(), limits.to()))
}

/// Calls `visit` for every expression that a measure reads.
pub fn expressions(kind: &MeasureKind, visit: &mut dyn FnMut(&Expr)) {
    let visit = std::cell::RefCell::new(visit);
    let mut column = |expr: &Expr| {
        visit.borrow_mut()(expr);
        Some(())
    };
    let mut value = |expr: &Expr| {
        visit.borrow_mut()(expr);
        Some(())
    };
    kind.try_map(&mut column, &mut value);
}
