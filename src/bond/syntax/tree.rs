//! What a `.bg` file says, before any name is looked up; every part with its place in the text.

use crate::expr;
use crate::quantity::Unit;
use crate::source::{FileId, Span};

/// A file: its statements in order, and the places of all blanks and comments, so that a formatter needs no second
/// parser.
#[derive(Clone, Debug)]
pub struct File {
    /// The text it was read from.
    pub file: FileId,
    /// Its statements.
    pub statements: Vec<Statement>,
    /// Blanks, line ends and comments, in order.
    pub trivia: Vec<Trivia>,
}

/// What stands between the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trivia {
    /// Which.
    pub kind: TriviaKind,
    /// Where.
    pub span: Span,
}

/// The sorts of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriviaKind {
    /// Spaces and tabs.
    Blank,
    /// One line's end.
    LineEnd,
    /// `#` to before the line's end.
    Comment,
}

/// A statement and its place, without the blanks around it.
#[derive(Clone, Debug)]
pub struct Statement {
    /// What it says.
    pub kind: StatementKind,
    /// Where.
    pub span: Span,
}

/// The statements of the language.
#[derive(Clone, Debug)]
pub enum StatementKind {
    /// Elements and bonds.
    Chain(Chain),
    /// `param L = 1.2 mH "armature inductance"`
    Parameter {
        /// Its name.
        name: Part,
        /// Its value.
        value: Expr,
        /// The text in quotes, without them.
        description: Option<Name>,
    },
    /// `signal x = integ(f(rod))`
    Signal {
        /// Its name.
        name: Part,
        /// What it is.
        value: Expr,
    },
    /// `input x_ref`
    Input(Vec<Part>),
    /// `output x`
    Output(Vec<Part>),
    /// `drive x_ref = step(0.1 s, 0 mm, 20 mm)`
    Drive {
        /// The input.
        name: Part,
        /// What it gets.
        value: Expr,
    },
    /// `simulate until 1.5 s step 1 ms`
    Simulate {
        /// End of the run.
        until: Option<Expr>,
        /// Output interval.
        step: Option<Expr>,
    },
    /// `options reltol = 1e-5, method = trbdf2`: each a key and its text.
    Options(Vec<(Name, Name)>),
    /// `observe x in mm, e(pump_port) in bar as "pump pressure"`
    Observe(Vec<ObserveItem>),
    /// `import "eha.bg"`: the text in quotes, without them.
    Import(Name),
    /// `model DcMotor(L = 1.2 mH, Jmp) { … }`
    Model(Model),
    /// `port in supply : electrical`
    Port(Port),
    /// `for k in 1..N { … }`
    For {
        /// What counts.
        variable: Name,
        /// From and to, both included.
        range: (Expr, Expr),
        /// What stands between the braces.
        body: Vec<Statement>,
    },
    /// `if k > 1 { … } else { … }`, decided while the graph is built.
    If {
        /// Over parameters and loop variables.
        condition: Expr,
        /// When it is not 0.
        then: Vec<Statement>,
        /// When it is 0.
        otherwise: Vec<Statement>,
    },
    /// `loop alpha: f(armature) follows I_ref, bandwidth 2000 rad/s, margin 60 deg`
    Loop(Regulator),
    /// Could not be read; the error has been reported.
    Unreadable,
}

/// A model: a kind of one's own.
#[derive(Clone, Debug)]
pub struct Model {
    /// What stands before the colon of an instance.
    pub name: Name,
    /// Its public parameters.
    pub parameters: Vec<HeaderParameter>,
    /// What stands between the braces.
    pub body: Vec<Statement>,
}

/// A parameter in the header of a model: `L = 1.2 mH "armature inductance"`, or `Jmp` alone, which each
/// instance must give.
#[derive(Clone, Debug)]
pub struct HeaderParameter {
    /// Its name.
    pub name: Name,
    /// What it is when an instance does not say.
    pub default: Option<Expr>,
    /// The text in quotes, without them.
    pub description: Option<Name>,
}

/// A port of a model.
#[derive(Clone, Debug)]
pub struct Port {
    /// Whether its half arrow points into the model.
    pub into: bool,
    /// Its name; an index makes it one of several.
    pub name: Part,
    /// Its domain.
    pub domain: Option<Name>,
}

/// A regulator and what it is for, as `bondspice tune` needs to know it.
#[derive(Clone, Debug)]
pub struct Regulator {
    /// The signal made with `pi` or `pid`.
    pub signal: Path,
    /// What it controls.
    pub controlled: Expr,
    /// What that shall follow.
    pub reference: Expr,
    /// The bandwidth wanted.
    pub bandwidth: Option<Expr>,
    /// The phase margin wanted.
    pub margin: Option<Expr>,
}

/// A name or another word and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// As written.
    pub text: String,
    /// Where.
    pub span: Span,
}

/// `rod`, `t.1`, `motor.rotor`, `eha[k].supply`.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// The first name.
    pub name: Part,
    /// What follows after dots: names or numbers.
    pub members: Vec<Part>,
    /// All of it.
    pub span: Span,
}

/// A name of a path, and what stands after it in square brackets.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// As written.
    pub text: String,
    /// The indices; empty when there are none.
    pub indices: Vec<Expr>,
    /// Where the name stands, without its indices.
    pub span: Span,
}

impl From<Name> for Part {
    fn from(name: Name) -> Part {
        Part { text: name.text, indices: vec![], span: name.span }
    }
}

impl Path {
    /// The first name and those after dots.
    pub fn parts(&self) -> impl Iterator<Item = &Part> {
        std::iter::once(&self.name).chain(&self.members)
    }

    /// The names joined by dots, without indices.
    pub fn text(&self) -> String {
        let parts: Vec<&str> = self.parts().map(|part| part.text.as_str()).collect();
        parts.join(".")
    }
}

/// `Se:U(10 V) -> 1:mesh -> R:R, I:L`: lists of ends, joined by arrows. Only the last list may have several ends.
#[derive(Clone, Debug)]
pub struct Chain {
    /// What the first arrow comes from, or what is declared when there is no arrow.
    pub first: Vec<ChainEnd>,
    /// The arrows and what they go to.
    pub links: Vec<(Arrow, Vec<ChainEnd>)>,
}

/// An arrow, with or without a causal stroke.
#[derive(Clone, Copy, Debug)]
pub struct Arrow {
    /// Where the stroke is drawn.
    pub stroke: Option<crate::bond::graph::Stroke>,
    /// Where the arrow stands.
    pub span: Span,
}

/// An end of an arrow: a name, and where it is declared also its kind and arguments.
#[derive(Clone, Debug)]
pub struct ChainEnd {
    /// What stands before the colon.
    pub kind: Option<Name>,
    /// The name, with the port after a dot.
    pub path: Path,
    /// What stands in the brackets.
    pub arguments: Option<Vec<Argument>>,
    /// All of it.
    pub span: Span,
}

/// An argument of an element or of a call: `1/alpha`, `q0 = 10`, `der(e) = …`.
#[derive(Clone, Debug, PartialEq)]
pub struct Argument {
    /// What stands before `=`.
    pub label: Option<Label>,
    /// The value.
    pub value: Value,
    /// All of it.
    pub span: Span,
}

/// What stands before the `=` of an argument.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The name; that in the brackets of `der( )`.
    pub name: Name,
    /// Whether it is a derivative, `der(name)`.
    pub derivative: bool,
    /// All of it.
    pub span: Span,
}

/// A value of an argument.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// An expression.
    Expr(Expr),
    /// `[a, b; c, d]`, by rows.
    Matrix(Vec<Vec<Expr>>),
    /// `a -> b`: a bond, in readings.
    Bond(Path, Path),
    /// `"name.csv"`
    Text(Name),
}

/// An item of `observe`.
#[derive(Clone, Debug)]
pub struct ObserveItem {
    /// What is observed.
    pub expr: Expr,
    /// After `in`.
    pub unit: Option<(Unit, Span)>,
    /// After `as`, without quotes.
    pub name: Option<Name>,
    /// All of it.
    pub span: Span,
}

/// An expression of a file.
pub type Expr = expr::Expr<Leaf>;

/// What the expressions of a file are made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Leaf {
    /// A number with a unit, in SI.
    Quantity(f64, Unit),
    /// A name.
    Name(Path),
    /// A call of anything but the functions of the table: a reading, a waveform, a dynamic function.
    Call(Call),
    /// `sum(k in 1..N, x[k])`
    Sum(Sum),
}

/// A sum over an index.
#[derive(Clone, Debug, PartialEq)]
pub struct Sum {
    /// What counts.
    pub variable: Name,
    /// From and to, both included.
    pub range: (Expr, Expr),
    /// What is added up.
    pub term: Expr,
}

/// `e(rod)`, `f(a -> b)[2]`, `pwl(0, 1; 2, 3)`, `pi(x, Kp = 1)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// What is called.
    pub name: Name,
    /// Its arguments, by the rows that `;` makes.
    pub rows: Vec<Vec<Argument>>,
    /// After it in square brackets.
    pub index: Option<Expr>,
}
