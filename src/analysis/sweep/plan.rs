//! Plans of sweeps, in TOML.
//!
//! ```toml
//! model = "motor.bg"                  # beside the plan
//! runs = 200                          # samples of random values, at each point of the grid
//! seed = 7
//! until = "2 s"                       # as the flags of the same names: until, step, observe, options
//!
//! [set]
//! L = ["1 mH", "2 mH"]                # these
//! R = { from = "0.1 Ohm", to = "10 Ohm", n = 5, log = true }
//! J = { normal = ["1e-4 kg*m^2", "1e-5 kg*m^2"] }
//! k = { uniform = [0.1, 0.2] }        # numbers without a unit are in SI
//!
//! [measures]
//! peak = "max(f(rotor))"
//! ```

use super::axis::{Axis, Forms};
use super::measure::Wanted;
use crate::diagnostic::Diagnostic;
use crate::quantity::{did_you_mean, nearest};
use crate::source::{FileId, SourceMap, Span};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What a plan says. Each part with its place.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// The model's file, from the plan's folder.
    pub model: Option<(String, Span)>,
    /// See [`Space`](super::Space).
    pub runs: Option<u64>,
    /// What random values follow from.
    pub seed: Option<u64>,
    /// What is varied, in order.
    pub axes: Vec<(Axis, Span)>,
    /// What is taken from each run.
    pub measures: Vec<(Wanted, Span)>,
    /// The end of each run.
    pub until: Option<String>,
    /// The output interval of traces.
    pub step: Option<String>,
    /// The columns of traces.
    pub observe: Option<String>,
    /// Options of the solver.
    pub options: Vec<(String, String)>,
}

const KEYS: &[&str] =
    &["model", "runs", "seed", "set", "measures", "until", "step", "observe", "options"];

/// Reads a plan; says everything that is wrong with it.
pub fn read(map: &SourceMap, file: FileId, d: &mut Vec<Diagnostic>) -> Plan {
    let text = map.file(file).map_or("", |file| &file.text);
    let (table, errors) = DeTable::parse_recoverable(text);
    let place = |range: std::ops::Range<usize>| Span {
        file,
        start: range.start as u32,
        end: range.end as u32,
    };
    // What follows an error in its line is a consequence of it.
    let mut line = 0;
    for error in &errors {
        let span = place(error.span().unwrap_or(0..0));
        let own = map.position(span).map_or(0, |(line, _)| line);
        if own != line {
            let message = format!("this is no TOML: {}", error.message().replace('\n', "; "));
            d.push(Diagnostic::error("E1200", span, message));
        }
        line = own;
    }
    if !errors.is_empty() {
        return Plan::default();
    }
    let mut reader = Reader { place: &place, d };
    let mut plan = Plan::default();
    for (key, span, value) in in_order(table.get_ref(), &place) {
        reader.entry(&mut plan, key, span, value);
    }
    plan
}

/// Entries of a table in the order of the text.
fn in_order<'t, 'i>(
    table: &'t DeTable<'i>,
    place: &dyn Fn(std::ops::Range<usize>) -> Span,
) -> Vec<(&'t str, Span, &'t Spanned<DeValue<'i>>)> {
    let mut entries: Vec<_> = table
        .iter()
        .map(|(key, value)| (key.get_ref().as_ref(), place(key.span()), value))
        .collect();
    entries.sort_by_key(|(_, span, _)| span.start);
    entries
}

struct Reader<'a> {
    place: &'a dyn Fn(std::ops::Range<usize>) -> Span,
    d: &'a mut Vec<Diagnostic>,
}

impl Reader<'_> {
    fn entry(&mut self, plan: &mut Plan, key: &str, at: Span, value: &Spanned<DeValue>) {
        match key {
            "model" => plan.model = self.text(key, value).map(|text| (text, self.at(value))),
            "runs" => plan.runs = self.whole(key, value),
            "seed" => plan.seed = self.whole(key, value),
            "until" => plan.until = self.text(key, value),
            "step" => plan.step = self.text(key, value),
            "observe" => plan.observe = self.text(key, value),
            "set" => {
                for (name, span, value) in self.table(key, value) {
                    if let Some(forms) = self.forms(name, value) {
                        plan.axes.push((Axis { name: name.into(), forms }, span));
                    }
                }
            }
            "measures" => {
                for (name, _, value) in self.table(key, value) {
                    let Some(text) = self.text(name, value) else { continue };
                    match Wanted::parse(name, &text) {
                        Ok(wanted) => plan.measures.push((wanted, self.at(value))),
                        Err(why) => self.d.push(Diagnostic::error("E1203", self.at(value), why)),
                    }
                }
            }
            "options" => {
                for (name, _, value) in self.table(key, value) {
                    if let Some(text) = self.scalar(name, value) {
                        plan.options.push((name.into(), text));
                    }
                }
            }
            _ => {
                let error = Diagnostic::error("E1201", at, format!("a plan has no key `{key}`"));
                self.d.push(match nearest(key, KEYS.iter().copied()) {
                    Some(meant) => did_you_mean(error, at, key, meant),
                    None => error.help(format!("known are {}", KEYS.join(", "))),
                });
            }
        }
    }

    fn at(&self, value: &Spanned<DeValue>) -> Span {
        (self.place)(value.span())
    }

    fn wrong(&mut self, value: &Spanned<DeValue>, message: String) {
        let span = self.at(value);
        self.d.push(Diagnostic::error("E1201", span, message));
    }

    fn text(&mut self, key: &str, value: &Spanned<DeValue>) -> Option<String> {
        let text = value.get_ref().as_str().map(String::from);
        if text.is_none() {
            self.wrong(value, format!("`{key}` takes a text in quotes"));
        }
        text
    }

    fn whole(&mut self, key: &str, value: &Spanned<DeValue>) -> Option<u64> {
        let number = value.get_ref().as_integer();
        let number =
            number.and_then(|number| u64::from_str_radix(number.as_str(), number.radix()).ok());
        if number.is_none() {
            self.wrong(value, format!("`{key}` takes a whole number from 0 on"));
        }
        number
    }

    /// A text, or a number as it is written.
    fn scalar(&mut self, key: &str, value: &Spanned<DeValue>) -> Option<String> {
        let text = match value.get_ref() {
            DeValue::String(text) => Some(text.to_string()),
            DeValue::Integer(number) if number.radix() == 10 => Some(number.as_str().into()),
            DeValue::Float(number) => Some(number.as_str().into()),
            _ => None,
        };
        if text.is_none() {
            self.wrong(value, format!("`{key}` takes numbers, or texts in quotes: 2e-3, \"2 mH\""));
        }
        text
    }

    fn table<'t, 'i>(
        &mut self,
        key: &str,
        value: &'t Spanned<DeValue<'i>>,
    ) -> Vec<(&'t str, Span, &'t Spanned<DeValue<'i>>)> {
        match value.get_ref() {
            DeValue::Table(table) => in_order(table, self.place),
            _ => {
                self.wrong(value, format!("`{key}` is a table: write `[{key}]` above its entries"));
                vec![]
            }
        }
    }

    fn forms(&mut self, name: &str, value: &Spanned<DeValue>) -> Option<Forms<String>> {
        match value.get_ref() {
            DeValue::Array(values) if !values.is_empty() => {
                let texts: Vec<_> = values.iter().map(|value| self.scalar(name, value)).collect();
                Some(Forms::List(texts.into_iter().collect::<Option<_>>()?))
            }
            DeValue::Table(table) => self.form(name, value, table),
            DeValue::Array(_) => {
                self.wrong(value, format!("`{name}` has no values"));
                None
            }
            _ => Some(Forms::List(vec![self.scalar(name, value)?])),
        }
    }

    /// `{ from, to, n, log }`, `{ normal = [mean, deviation] }`, `{ uniform = [low, high] }`.
    fn form(
        &mut self,
        name: &str,
        whole: &Spanned<DeValue>,
        table: &DeTable,
    ) -> Option<Forms<String>> {
        let (mut from, mut to, mut count, mut log) = (None, None, None, false);
        for (key, span, value) in in_order(table, self.place) {
            match key {
                "normal" | "uniform" if table.len() == 1 => {
                    let two = value.get_ref().as_array().filter(|two| two.len() == 2);
                    let Some(two) = two else {
                        self.wrong(value, format!("`{key}` takes two values: [a, b]"));
                        return None;
                    };
                    let texts: Vec<_> = two.iter().map(|value| self.scalar(name, value)).collect();
                    let mut texts = texts.into_iter().flatten();
                    return Forms::random(key, texts.next()?, texts.next()?).ok();
                }
                "from" => from = Some(self.scalar(name, value)?),
                "to" => to = Some(self.scalar(name, value)?),
                "n" => count = Some(self.whole(key, value)?),
                "log" => match value.get_ref().as_bool() {
                    Some(is) => log = is,
                    None => self.wrong(value, "`log` is true or false".into()),
                },
                _ => {
                    let message = format!("values of `{name}` have no `{key}`");
                    let known = "a list, { from, to, n, log }, { normal = [mean, deviation] } \
                                 or { uniform = [low, high] }";
                    let error = Diagnostic::error("E1201", span, message);
                    self.d.push(error.help(known));
                    return None;
                }
            }
        }
        match (from, to, count) {
            (Some(from), Some(to), Some(count)) => Some(Forms::Range { from, to, count, log }),
            _ => {
                self.wrong(whole, format!("a range of `{name}` takes `from`, `to` and `n`"));
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str) -> (Plan, Vec<Diagnostic>) {
        let mut map = SourceMap::default();
        let file = map.add("plan.toml", text);
        let mut d = vec![];
        let plan = read(&map, file, &mut d);
        (plan, d)
    }

    #[test]
    fn the_plan_of_the_help_is_read() {
        let (plan, d) = plan(
            "model = \"motor.bg\"\nruns = 200\nseed = 7\nuntil = \"2 s\"\n[set]\nR = { from = \"0.1 Ohm\", to = \"10 Ohm\", n = 5, log = true }\n\
             L = [\"1 mH\", 2e-3]\nJ = { normal = [1e-4, 1e-5] }\n[measures]\npeak = \"max(f(rotor))\"\n[options]\nreltol = 1e-4\n",
        );
        assert!(d.is_empty(), "{d:?}");
        assert_eq!(
            (plan.runs, plan.seed, plan.until.as_deref()),
            (Some(200), Some(7), Some("2 s"))
        );
        let names: Vec<&str> = plan.axes.iter().map(|(axis, _)| axis.name.as_str()).collect();
        assert_eq!(names, ["R", "L", "J"]);
        assert_eq!(plan.axes[1].0.forms, Forms::List(vec!["1 mH".into(), "2e-3".into()]));
        assert_eq!(plan.options, [("reltol".to_string(), "1e-4".to_string())]);
        assert_eq!(plan.measures[0].0.name, "peak");
    }

    #[test]
    fn everything_that_is_wrong_is_said_at_its_place() {
        let text = "model = 3\nrans = 4\n[set]\nL = { from = 1, to = 2 }\nR = []\nC = { normal = [1] }\n[measures]\na = \"maxx(v)\"\n";
        let (_, d) = plan(text);
        let said: Vec<(&str, &str)> = d
            .iter()
            .map(|d| {
                (d.code, &text[d.labels[0].span.start as usize..d.labels[0].span.end as usize])
            })
            .collect();
        assert_eq!(
            said,
            [
                ("E1201", "3"),
                ("E1201", "rans"),
                ("E1201", "{ from = 1, to = 2 }"),
                ("E1201", "[]"),
                ("E1201", "[1]"),
                ("E1203", "\"maxx(v)\"")
            ]
        );
        let codes = |text: &str| plan(text).1.iter().map(|d| d.code).collect::<Vec<_>>();
        assert_eq!(codes("a = = 2\nb = = 3\n"), ["E1200", "E1200"]);
    }
}
