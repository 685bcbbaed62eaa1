//! Netlists: cards as data. Reading, writing, flattening and the map are verbs on them.

pub mod names;
pub mod visit;
pub mod parts;
pub mod analysis;
pub mod references;
pub mod header;
pub mod read;
pub mod write;
pub mod flatten;
pub mod dialects;
pub mod adapt;
pub mod lacks;
pub mod mast;

pub use crate::circuit::{Nodes, Part};
use crate::expr;
use crate::source::Span;
use analysis::{Analysis, Data, Print, Sweep};
pub use names::{Name, Names};
pub use parts::{Draw, Operator, Passive, PassiveKind};

/// An expression of a netlist.
pub type Expr = expr::Expr<Leaf>;

/// What an expression of a netlist may speak of.
#[derive(Clone, Debug, PartialEq)]
pub enum Leaf {
    /// A parameter.
    Parameter(Name),
    /// v(a) or v(a, b); ground is the name `0`.
    Voltage(Name, Option<Name>),
    /// i(device).
    Current(Name),
    /// The power that a device takes up, v·i: `p(device)` in outputs.
    Power(Name),
    /// A part of a phasor, of one of the above: `vdb(out)`, `im(v1)` in outputs.
    Part(Part, Box<Leaf>),
    /// Time in seconds.
    Time,
    /// What follows from values over time.
    Operator(Operator, Vec<Expr>),
}

impl Leaf {
    /// The same with other names.
    pub fn renamed(&self, name: &mut dyn FnMut(Name) -> Name) -> Leaf {
        match self {
            Leaf::Parameter(a) => Leaf::Parameter(name(*a)),
            Leaf::Voltage(a, b) => Leaf::Voltage(name(*a), b.map(&mut *name)),
            Leaf::Current(a) => Leaf::Current(name(*a)),
            Leaf::Power(a) => Leaf::Power(name(*a)),
            Leaf::Part(part, inner) => Leaf::Part(*part, Box::new(inner.renamed(name))),
            Leaf::Time => Leaf::Time,
            Leaf::Operator(operator, arguments) => {
                let mut renamed = |argument: &Expr| {
                    argument.map(&mut |leaf, span| {
                        Expr::new(expr::Node::Leaf(leaf.renamed(&mut *name)), span)
                    })
                };
                Leaf::Operator(*operator, arguments.iter().map(&mut renamed).collect())
            }
        }
    }
}

/// A card and the place that it came from: its line in the netlist, or in the `.bg` file for one that was translated.
#[derive(Clone, Debug)]
pub struct Card {
    /// What it says.
    pub kind: CardKind,
    /// Where it comes from.
    pub span: Span,
    /// A comment at the end of its line, without the marker: `eha.bg:41  R:eta`.
    pub comment: Option<String>,
}

/// What cards say.
#[derive(Clone, Debug)]
pub enum CardKind {
    /// A device or an instance.
    Device(Device),
    /// `.param`.
    Parameters(Vec<(Name, Expr)>),
    /// `.subckt … .ends`.
    Subcircuit(Subcircuit),
    /// `.model name type (…)`; keys are folded to lower case.
    Model {
        /// Its name.
        name: Name,
        /// `d`, `sw`, `csw`, folded to lower case.
        kind: String,
        /// Its parameters.
        parameters: Vec<(String, Expr)>,
    },
    /// `.options`; a flag has the value `1`. Keys are folded to lower case.
    Options(Vec<(String, String)>),
    /// `.ic v(node) = value`.
    Initial(Vec<(Name, Expr)>),
    /// `.nodeset v(node) = value`: where to look for an operating point.
    Guess(Vec<(Name, Expr)>),
    /// `.global node …`: nodes that are one in every subcircuit.
    Global(Vec<Name>),
    /// `.func`; once a netlist is read, its body stands in the place of every call.
    Function(Definition),
    /// `.if (condition) … .elseif … .else … .endif`.
    Choice(Vec<Branch>),
    /// `.save` or `.print tran`: the items as written and read.
    Save {
        /// The analysis that a `.print` belongs to.
        of: Print,
        /// As written, and what it means.
        items: Vec<(String, Expr)>,
    },
    /// `.tran step stop [start [hmax]] [uic]`.
    #[allow(missing_docs)]
    Transient { step: Expr, stop: Expr, start: Option<Expr>, hmax: Option<Expr>, uic: bool },
    /// `.op`.
    OperatingPoint,
    /// `.measure`.
    Measure(Box<Measure>),
    /// `.four`: harmonics of the last period.
    Fourier(Fourier),
    /// `.dc`, `.ac`, `.tf` and the others.
    Analysis(Box<Analysis>),
    /// `.step`: everything is run at each of these values; the first of all `.step` runs fastest.
    Step(Vec<Sweep>),
    /// `.data`: values for sweeps.
    Data(Data),
    /// A whole-line comment, without the asterisk.
    Comment(String),
}

/// `.four frequency item …`.
#[derive(Clone, Debug)]
pub struct Fourier {
    /// In Hz.
    pub frequency: Expr,
    /// Items as written and read.
    pub items: Vec<(String, Expr)>,
}

/// `.func name(arguments) {body}`.
#[derive(Clone, Debug)]
pub struct Definition {
    /// Its name.
    pub name: Name,
    /// Its arguments, by names that no text can spell.
    pub arguments: Vec<Name>,
    /// Its value.
    pub body: Expr,
    /// Where it stands.
    pub span: Span,
}

/// A branch of `.if`.
#[derive(Clone, Debug)]
pub struct Branch {
    /// What holds where it counts, none before it having held; `None` for `.else`.
    pub condition: Option<Expr>,
    /// Its cards.
    pub cards: Vec<Card>,
}

/// A measure over expressions of a netlist.
pub type MeasureKind = crate::trace::measure::Kind<Expr, Expr>;

/// `.measure`.
#[derive(Clone, Debug)]
pub struct Measure {
    /// Its name.
    pub name: String,
    /// `tran`, `ac`, `dc`; empty where none is named.
    pub analysis: String,
    /// What it is.
    pub kind: MeasureKind,
    /// What stands after the keyword, as it was written.
    pub text: String,
}

/// `.subckt` to `.ends`.
#[derive(Clone, Debug)]
pub struct Subcircuit {
    /// Its name.
    pub name: Name,
    /// Its terminals.
    pub ports: Vec<Name>,
    /// Its parameters with their defaults.
    pub parameters: Vec<(Name, Expr)>,
    /// Its body.
    pub cards: Vec<Card>,
}

/// A device card.
#[derive(Clone, Debug)]
pub struct Device {
    /// Its name with its letter.
    pub name: Name,
    /// Its nodes, without controlling ones.
    pub nodes: Nodes<Name>,
    /// What it is.
    pub element: Element,
}

/// What device cards say.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Element {
    Resistor {
        value: Expr,
    },
    Capacitor {
        value: Expr,
        initial: Option<Expr>,
    },
    Inductor {
        value: Expr,
        initial: Option<Expr>,
    },
    /// An R, C or L with a model or further parameters.
    Passive(Box<Passive>),
    /// A capacitor by its charge.
    Charge {
        law: Expr,
        initial: Option<Expr>,
    },
    /// An inductor by its flux.
    Flux {
        law: Expr,
        initial: Option<Expr>,
    },
    Mutual {
        inductors: Vec<Name>,
        coupling: Expr,
    },
    VoltageSource(Box<Source>),
    CurrentSource(Box<Source>),
    Vcvs {
        gain: Expr,
        control: [Name; 2],
    },
    Vccs {
        gain: Expr,
        control: [Name; 2],
    },
    Cccs {
        gain: Expr,
        control: Name,
    },
    Ccvs {
        gain: Expr,
        control: Name,
    },
    /// A lossless line: the nodes of its near port, then those of its far one.
    Line {
        impedance: Expr,
        delay: Expr,
        /// Voltage and current of each port at the start.
        initial: Option<Box<[Expr; 4]>>,
    },
    /// `B … V=`, `E … VALUE={}`.
    BehaviouralVoltage {
        law: Expr,
    },
    /// `B … I=`, `G … VALUE={}`.
    BehaviouralCurrent {
        law: Expr,
    },
    Switch {
        model: Name,
        control: [Name; 2],
        on: Option<bool>,
    },
    CurrentSwitch {
        model: Name,
        control: Name,
        on: Option<bool>,
    },
    /// `S n+ n- model CONTROL={expression}`.
    LawSwitch {
        model: Name,
        control: Expr,
        on: Option<bool>,
    },
    /// `area` beside, its parameters are folded to lower case.
    Diode {
        model: Name,
        area: Option<Expr>,
        parameters: Vec<(String, Expr)>,
    },
    Instance {
        subcircuit: Name,
        parameters: Vec<(Name, Expr)>,
    },
}

/// What an independent source says: `[DC] value`, `AC magnitude phase`, a function of time.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its value over time.
    pub waveform: Waveform,
    /// Its value in `.op`, `.dc` and where an analysis begins at an operating point of its own, where that is not the
    /// waveform's at the start.
    pub dc: Option<Expr>,
    /// Magnitude, and phase in degrees, in `.ac`.
    pub ac: Option<[Expr; 2]>,
}

impl From<Waveform> for Box<Source> {
    fn from(waveform: Waveform) -> Box<Source> {
        Box::new(Source { waveform, dc: None, ac: None })
    }
}

/// The value of an independent source over time.
#[derive(Clone, Debug)]
pub enum Waveform {
    /// DC, or a bare value.
    Constant(Expr),
    /// `PULSE( … )`, `SIN( … )`, `PWL( … )`, `EXP( … )`, `SFFM( … )`: arguments as written.
    Function {
        /// Which; all rows are in [`read::WAVEFORMS`].
        shape: Shape,
        /// Its arguments in order.
        arguments: Vec<Expr>,
    },
    /// `PWL( … ) R=… TD=…`: points that are repeated, or come later.
    Points {
        /// Times and values in turn.
        points: Vec<Expr>,
        /// The time that it goes on from when it has come to its end.
        repeat: Option<Expr>,
        /// How much later everything is.
        delay: Option<Expr>,
    },
    /// `PAT(high low delay rise fall sample bits)`.
    Pattern {
        /// Its first six arguments.
        arguments: Vec<Expr>,
        /// Noughts and ones.
        bits: String,
        /// How often it is repeated; for ever where negative.
        repeat: Option<Expr>,
    },
}

/// Waveform functions of SPICE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Shape {
    Pulse,
    Sin,
    Pwl,
    Exp,
    Sffm,
    Am,
}

/// A netlist.
#[derive(Clone, Debug, Default)]
pub struct Netlist {
    /// What it is written in, or was read as.
    pub dialect: &'static dialects::Dialect,
    /// The first line.
    pub title: String,
    /// Its names.
    pub names: Names,
    /// `*bondspice key=value` comments, in order; keys may repeat.
    pub header: Vec<(String, String)>,
    /// Its cards, in order.
    pub cards: Vec<Card>,
}

/// A number in plain figures, without suffix: the shortest text that reads back as the same bits.
pub fn plain(value: f64) -> String {
    let text = format!("{value:?}");
    match text.strip_suffix(".0") {
        Some(whole) => whole.to_string(),
        None => text,
    }
}

#[cfg(test)]
mod round_trip;
