//! What is taken from each run: `max(x)`, `at(f(motor) in rpm, 5 ms)`, `rise(v(out), 2.5)`.

use super::Read;
use crate::quantity::nearest;
use crate::trace::measure::{Edge, Event, Kind, Source, Statistic, Value, Which, Window};

/// A measure of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// How its column is headed.
    pub name: String,
    /// What is observed for it, as `--observe` takes it.
    pub item: String,
    function: Function,
    arguments: Vec<String>,
}

/// One row of [`FUNCTIONS`].
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// What stands in its brackets after the item, for the help.
    pub arguments: &'static str,
    /// How many arguments it takes after the item.
    counts: &'static [usize],
    function: Function,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Function {
    Over(Statistic),
    Initial,
    Final,
    At,
    Crossing(Edge),
}

const WINDOW: &str = ", [FROM, TO]";

/// What can be measured, one row each.
#[rustfmt::skip]
pub const FUNCTIONS: &[Row] = &[
    Row { name: "max", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::Maximum) },
    Row { name: "min", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::Minimum) },
    Row { name: "pp", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::PeakToPeak) },
    Row { name: "mean", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::Average) },
    Row { name: "rms", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::Rms) },
    Row { name: "integral", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::Integral) },
    Row { name: "max_at", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::MaximumAt) },
    Row { name: "min_at", arguments: WINDOW, counts: &[0, 2], function: Function::Over(Statistic::MinimumAt) },
    Row { name: "initial", arguments: "", counts: &[0], function: Function::Initial },
    Row { name: "final", arguments: "", counts: &[0], function: Function::Final },
    Row { name: "at", arguments: ", TIME", counts: &[1], function: Function::At },
    Row { name: "rise", arguments: ", LEVEL, [AFTER]", counts: &[1, 2], function: Function::Crossing(Edge::Rise) },
    Row { name: "fall", arguments: ", LEVEL, [AFTER]", counts: &[1, 2], function: Function::Crossing(Edge::Fall) },
    Row { name: "cross", arguments: ", LEVEL, [AFTER]", counts: &[1, 2], function: Function::Crossing(Edge::Cross) },
];

impl Wanted {
    /// From a name and a text, `peak` and `max(x in mm)`.
    ///
    /// # Errors
    /// What it is instead.
    pub fn parse(name: &str, text: &str) -> Result<Wanted, String> {
        let name = name.trim().to_string();
        let form =
            || format!("`{text}` is no measure: `max(x)`, `at(x, 5 ms)`, `rise(x, 0.9)` are");
        let inside = text.trim().strip_suffix(')').and_then(|text| text.split_once('('));
        let (function, inside) = inside.ok_or_else(form)?;
        let function = function.trim();
        let row =
            FUNCTIONS.iter().find(|row| row.name == function).ok_or_else(|| {
                match nearest(function, FUNCTIONS.iter().map(|row| row.name)) {
                    Some(meant) => {
                        format!("nothing measures `{function}`: did you mean `{meant}`?")
                    }
                    None => {
                        let names: Vec<&str> = FUNCTIONS.iter().map(|row| row.name).collect();
                        format!("nothing measures `{function}`: known are {}", names.join(", "))
                    }
                }
            })?;
        let mut arguments = pieces(inside);
        let item = if arguments.is_empty() { String::new() } else { arguments.remove(0) };
        if name.is_empty() || item.is_empty() || arguments.iter().any(String::is_empty) {
            return Err(form());
        }
        if !row.counts.contains(&arguments.len()) {
            return Err(format!("it is `{}(ITEM{})`, not `{text}`", row.name, row.arguments));
        }
        Ok(Wanted { name, item, function: row.function, arguments })
    }

    /// From `NAME=TEXT`; the text alone is its own name.
    ///
    /// # Errors
    /// What it is instead.
    pub fn parse_flag(text: &str) -> Result<Wanted, String> {
        // An item may hold `==` or `>=` within its brackets.
        match text.split_once('=').filter(|(name, _)| !name.contains('(')) {
            Some((name, measure)) => Wanted::parse(name, measure),
            None => Wanted::parse(text, text),
        }
    }

    /// The measure over a watched column. Levels are in the column's unit.
    ///
    /// # Errors
    /// Which argument is no number.
    pub fn kind(&self, column: usize, read: Read) -> Result<Kind, String> {
        let number = |k: usize| {
            let argument = self.arguments.get(k).map(|text| read(text)).transpose()?;
            Ok::<_, String>(argument.map(|reading| Value::number(reading.si())))
        };
        let (first, second) = (number(0)?, number(1)?);
        let start = || Value::number(f64::NEG_INFINITY);
        let end = || Value::number(f64::INFINITY);
        Ok(match self.function {
            Function::Over(what) => {
                let window =
                    Window::Between(first.unwrap_or_else(start), second.unwrap_or_else(end));
                Kind::Over(what, column, window)
            }
            Function::Initial => Kind::Find(column, Event::At(Value::number(0.0))),
            Function::Final => Kind::Formula(Value::leaf(Source::Column(column))),
            Function::At => Kind::Find(column, Event::At(first.unwrap_or_else(start))),
            Function::Crossing(edge) => Kind::When(Event::Crossing {
                column,
                level: first.unwrap_or_else(start),
                edge,
                which: Which::Number(1),
                from: second.unwrap_or_else(start),
                to: end(),
            }),
        })
    }
}

/// Pieces between the commas that stand in no brackets and no quotes.
pub fn pieces(text: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let (mut depth, mut quoted) = (0_i32, false);
    for letter in text.chars() {
        quoted ^= letter == '"';
        depth += i32::from("([".contains(letter) && !quoted)
            - i32::from(")]".contains(letter) && !quoted);
        match pieces.last_mut() {
            Some(piece) if letter != ',' || depth > 0 || quoted => piece.push(letter),
            _ => pieces.push(String::new()),
        }
    }
    pieces.into_iter().map(|piece| piece.trim().to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::sweep::Reading;
    use crate::trace::measure::{Measure, Measures};

    #[test]
    fn measures_are_those_of_the_rows() {
        let read = |text: &str| Reading::of(text, &|unit| (unit == "ms").then_some(1e-3));
        let texts = [
            ("max(x)", 3.0),
            ("min(x)", 0.0),
            ("pp(x)", 3.0),
            ("mean(x)", 1.75),
            ("integral(x, 1000 ms, 2)", 2.5),
            ("max_at(x)", 2.0),
            ("initial(x)", 0.0),
            ("final(x)", 3.0),
            ("at(x, 500 ms)", 1.0),
            ("rise(x, 2.5)", 1.5),
            ("cross(x, 0.5)", 0.25),
        ];
        let list: Vec<Measure> = texts
            .iter()
            .map(|(text, _)| Measure {
                name: text.to_string(),
                span: crate::source::Span::NONE,
                analysis: String::new(),
                kind: Wanted::parse("m", text).unwrap().kind(0, &read).unwrap(),
            })
            .collect();
        let mut measures = Measures::new(&list, "tran");
        // x rises to 2 within 1 s, then to 3 within another, and stays: exactly, straight lines.
        for (t, x) in [(0.0, 0.0), (1.0, 2.0), (2.0, 3.0), (2.0, 3.0)] {
            measures.row(t, &[x]);
        }
        for (outcome, (text, expected)) in measures.finish().iter().zip(texts) {
            let value = outcome.value.unwrap_or(f64::NAN);
            assert!((value - expected).abs() < 1e-12, "{text}: {value}, not {expected}");
        }
    }

    #[test]
    fn texts_are_taken_apart_at_their_own_commas() {
        let wanted = Wanted::parse_flag(r#"peak=max(v(a,b) in mV as "a, b", 1m, 2m)"#).unwrap();
        assert_eq!(
            (wanted.name.as_str(), wanted.item.as_str()),
            ("peak", r#"v(a,b) in mV as "a, b""#)
        );
        assert_eq!(wanted.arguments, ["1m", "2m"]);
        assert_eq!(Wanted::parse_flag("max(x)").unwrap().name, "max(x)");
    }

    #[test]
    fn what_is_no_measure_is_told() {
        let why = |text: &str| Wanted::parse_flag(text).unwrap_err();
        assert!(why("maks(x)").contains("did you mean `max`"));
        assert!(why("x").contains("is no measure"));
        assert!(why("max()").contains("is no measure"));
        assert!(why("max(x, 1)").contains("[FROM, TO]"));
        assert!(why("at(x)").contains("TIME"));
    }
}
