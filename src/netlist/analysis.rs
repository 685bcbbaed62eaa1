//! What cards ask to be computed, beyond `.op` and `.tran`, and over which values.

use super::{Expr, Name, Names};
use crate::circuit::{Drive, Roots};
use crate::source::Span;

/// An analysis.
#[derive(Clone, Debug)]
pub enum Analysis {
    /// `.dc`: operating points over sweeps, the first of which runs fastest.
    Dc(Vec<Sweep>),
    /// `.ac`: phasors over frequencies, in Hz.
    Ac(Points),
    /// `.tf output source`: gain and resistances at the operating point.
    Transfer {
        /// v(a), v(a, b) or i(device), as written and read.
        output: (String, Expr),
        /// The independent source.
        source: Name,
    },
    /// `.pz in+ in- out+ out- cur|vol pol|zer|pz`.
    PoleZero {
        /// The pair of nodes that is driven.
        input: [Name; 2],
        /// The pair between which the output is taken.
        output: [Name; 2],
        /// By what it is driven.
        drive: Drive,
        /// What is asked for.
        roots: Roots,
    },
    /// `.sens`.
    Sensitivity {
        /// What changes, as written and read.
        outputs: Vec<(String, Expr)>,
        /// With what; `None`: with every value of a device.
        parameters: Option<Vec<(Name, Span)>>,
        /// Where.
        over: Over,
    },
}

/// Where sensitivities are taken.
#[derive(Clone, Debug)]
pub enum Over {
    /// At the operating point: ngspice's.
    Rest,
    /// Over frequencies: ngspice's.
    Frequencies(Points),
    /// Wherever the deck's other analysis goes: Xyce's.
    Other,
}

/// A quantity and its values, or the rows of a table.
#[derive(Clone, Debug)]
pub enum Sweep {
    /// One quantity: a source, a parameter, `temp`, `r1`, `r1:r`, `model:key`.
    Quantity {
        /// Its name.
        name: Name,
        /// Its values.
        points: Points,
        /// Where it stands.
        span: Span,
    },
    /// `data=name`.
    Table {
        /// The name of the `.data` card.
        name: Name,
        /// Where it stands.
        span: Span,
    },
}

/// Values of a sweep.
#[derive(Clone, Debug)]
pub enum Points {
    /// From, to, by.
    Linear([Expr; 3]),
    /// From, to, number of values.
    Count([Expr; 3]),
    /// From, to, values for each decade.
    Decade([Expr; 3]),
    /// From, to, values for each octave.
    Octave([Expr; 3]),
    /// These.
    List(Vec<Expr>),
    /// The column of this name, or the only one, of a `.data` card.
    Table(Name),
}

/// `.data name column … value …`.
#[derive(Clone, Debug)]
pub struct Data {
    /// Its name.
    pub name: Name,
    /// What its columns set.
    pub columns: Vec<Name>,
    /// Its rows, one after the other.
    pub values: Vec<Expr>,
}

/// Which analysis a `.print` belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Print {
    Transient,
    Dc,
    Ac,
    OperatingPoint,
    Transfer,
    PoleZero,
    Sensitivity,
    /// `.save`, and `.probe`: of every analysis.
    Any,
}

impl Print {
    /// The word after `.print`.
    pub fn word(self) -> &'static str {
        match self {
            Print::Transient | Print::Any => "tran",
            Print::Dc => "dc",
            Print::Ac => "ac",
            Print::OperatingPoint => "op",
            Print::Transfer => "tf",
            Print::PoleZero => "pz",
            Print::Sensitivity => "sens",
        }
    }
}

/// How names and values are written in a dialect.
pub(super) struct Spelling<'a> {
    pub names: &'a Names,
    pub value: Box<dyn Fn(&Expr) -> String + 'a>,
}

impl Spelling<'_> {
    fn name(&self, name: Name) -> String {
        self.names.text(name).to_string()
    }

    /// The words of an analysis card.
    pub fn analysis(&self, analysis: &Analysis) -> Vec<String> {
        let word = |text: &str| text.to_string();
        match analysis {
            Analysis::Dc(sweeps) => self.sweeps(".dc", sweeps),
            Analysis::Ac(points) => {
                std::iter::once(word(".ac")).chain(self.frequencies(points)).collect()
            }
            Analysis::Transfer { output, source } => {
                vec![word(".tf"), output.0.clone(), self.name(*source)]
            }
            Analysis::Sensitivity { outputs, parameters, over } => {
                let names: Vec<String> = outputs.iter().map(|(text, _)| text.clone()).collect();
                let mut words = vec![word(".sens")];
                match over {
                    Over::Other => words.push(format!("objfunc={}", names.join(","))),
                    _ => words.extend(names),
                }
                if let Over::Frequencies(points) = over {
                    words.push(word("ac"));
                    words.extend(self.frequencies(points));
                }
                if let Some(parameters) = parameters {
                    let names = parameters.iter().map(|(name, _)| self.name(*name));
                    words.push(format!("param={}", names.collect::<Vec<_>>().join(",")));
                }
                words
            }
            Analysis::PoleZero { input, output, drive, roots } => {
                let drive = match drive {
                    Drive::Voltage => "vol",
                    Drive::Current => "cur",
                };
                let roots = match roots {
                    Roots::Poles => "pol",
                    Roots::Zeros => "zer",
                    Roots::Both => "pz",
                };
                let nodes = input.iter().chain(output).map(|node| self.name(*node));
                std::iter::once(word(".pz"))
                    .chain(nodes)
                    .chain([word(drive), word(roots)])
                    .collect()
            }
        }
    }

    /// A card of sweeps.
    pub fn sweeps(&self, card: &str, sweeps: &[Sweep]) -> Vec<String> {
        let mut words = vec![card.to_string()];
        for sweep in sweeps {
            let (name, points) = match sweep {
                Sweep::Table { name, .. } => {
                    words.push(format!("data={}", self.name(*name)));
                    continue;
                }
                Sweep::Quantity { name, points, .. } => (self.name(*name), points),
            };
            let (kind, values) = self.points(points);
            if kind == "list" {
                words.extend([name, kind.to_string()]);
            } else {
                words.extend((!kind.is_empty()).then(|| kind.to_string()));
                words.push(name);
            }
            words.extend(values);
        }
        words
    }

    /// `.data … .enddata`.
    pub fn data(&self, data: &Data) -> Vec<String> {
        let mut words = vec![".data".to_string(), self.name(data.name)];
        words.extend(data.columns.iter().map(|name| self.name(*name)));
        words.extend(data.values.iter().map(|value| (self.value)(value)));
        words
    }

    fn points(&self, points: &Points) -> (&'static str, Vec<String>) {
        let all = |values: &[Expr]| values.iter().map(|value| (self.value)(value)).collect();
        match points {
            Points::Linear(values) => ("", all(values)),
            Points::Count(values) => ("lin", all(values)),
            Points::Decade(values) => ("dec", all(values)),
            Points::Octave(values) => ("oct", all(values)),
            Points::List(values) => ("list", all(values)),
            Points::Table(name) => ("data", vec![self.name(*name)]),
        }
    }

    /// Frequencies: the number before the ends.
    fn frequencies(&self, points: &Points) -> Vec<String> {
        let (kind, mut values) = self.points(points);
        match points {
            Points::Table(_) => return vec![format!("data={}", values.concat())],
            Points::List(_) => {}
            _ => values.rotate_right(1),
        }
        values.insert(0, kind.to_string());
        values
    }
}

/// Calls `visit` for every expression of an analysis.
pub(super) fn expressions_mut(analysis: &mut Analysis, visit: &mut dyn FnMut(&mut Expr)) {
    match analysis {
        Analysis::Dc(sweeps) => sweeps_mut(sweeps, visit),
        Analysis::Ac(points) => points_mut(points, visit),
        Analysis::Transfer { output, .. } => visit(&mut output.1),
        Analysis::PoleZero { .. } => {}
        Analysis::Sensitivity { outputs, over, .. } => {
            outputs.iter_mut().for_each(|(_, value)| visit(value));
            if let Over::Frequencies(points) = over {
                points_mut(points, visit);
            }
        }
    }
}

/// Calls `visit` for every expression of sweeps.
pub(super) fn sweeps_mut(sweeps: &mut [Sweep], visit: &mut dyn FnMut(&mut Expr)) {
    for sweep in sweeps {
        if let Sweep::Quantity { points, .. } = sweep {
            points_mut(points, visit);
        }
    }
}

fn points_mut(points: &mut Points, visit: &mut dyn FnMut(&mut Expr)) {
    match points {
        Points::Linear(values)
        | Points::Count(values)
        | Points::Decade(values)
        | Points::Octave(values) => values.iter_mut().for_each(visit),
        Points::List(values) => values.iter_mut().for_each(visit),
        Points::Table(_) => {}
    }
}
