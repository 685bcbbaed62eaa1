//! How the columns of a trace become the variables of a plot: `name.re` and `name.im` are one complex variable over
//! `frequency`, a first column `step` makes several plots.

use crate::trace::formats::Heading;
use crate::trace::runs::{STEP, is_reading};

/// A variable of a plot and the columns that hold it.
pub(super) struct Variable {
    pub name: String,
    pub kind: &'static str,
    /// The column of its real part.
    pub real: usize,
    /// The column of its imaginary part.
    pub imaginary: Option<usize>,
}

/// The variables of a plot.
pub(super) struct Layout {
    pub variables: Vec<Variable>,
    pub stepped: bool,
    pub complex: bool,
    pub plot: &'static str,
}

impl Layout {
    pub fn new(names: &[String], units: &[String]) -> Layout {
        let stepped = names.len() > 1 && names[0] == STEP;
        let first = usize::from(stepped);
        let abscissa = names.get(first).map_or("", String::as_str).to_lowercase();
        let plot = match abscissa.as_str() {
            "time" => "Transient Analysis",
            "frequency" => "AC Analysis",
            name if is_reading(name) => "Operating Point",
            _ => "DC transfer characteristic",
        };
        let unit = |at: usize| units.get(at).cloned().unwrap_or_default();
        let mut variables: Vec<Variable> = vec![];
        let mut at = first;
        while at < names.len() {
            let whole = names[at].strip_suffix(".re").filter(|_| abscissa == "frequency");
            let next = names.get(at + 1).and_then(|name| name.strip_suffix(".im"));
            let pair = whole.filter(|name| next == Some(name));
            let name = pair.unwrap_or(&names[at]);
            variables.push(Variable {
                kind: kind(name, &unit(at), at == first),
                name: name.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect(),
                real: at,
                imaginary: pair.map(|_| at + 1),
            });
            at += 1 + usize::from(pair.is_some());
        }
        let complex = variables.iter().any(|variable| variable.imaginary.is_some());
        Layout { variables, stepped, complex, plot }
    }

    /// The words of `Flags:`.
    pub fn flags(&self) -> &'static str {
        if self.complex { "complex" } else { "real" }
    }

    /// The real parts of a row, each with its imaginary part where the plot is complex.
    pub fn values<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
        let value = |at: usize| row.get(at).copied().unwrap_or(f64::NAN);
        self.variables.iter().map(move |v| (value(v.real), v.imaginary.map_or(0.0, value)))
    }

    /// The name of the plot of a run.
    pub fn plot_of(&self, step: Option<f64>) -> String {
        match step.filter(|_| self.stepped) {
            Some(step) => format!("{} (step {step})", self.plot),
            None => self.plot.to_string(),
        }
    }
}

/// The first line of the title.
pub(super) fn title(heading: &Heading) -> &str {
    let title = heading.title.split(['\n', '\r']).next().filter(|line| !line.is_empty());
    title.unwrap_or("bondspice")
}

/// What ngspice calls the kind of a vector.
fn kind(name: &str, unit: &str, first: bool) -> &'static str {
    let name = name.to_lowercase();
    match unit {
        _ if first && name == "time" => "time",
        _ if first && name == "frequency" => "frequency",
        "V" => "voltage",
        "A" => "current",
        _ if name.starts_with("v(") => "voltage",
        _ if name.starts_with("i(") => "current",
        _ => "notype",
    }
}
