//! Entries of the linear equations as quotients of polynomials in s, parameters and what else has a name.
//!
//! A parameter is a symbol by its name, a value written at an element (`R:R(2 Ohm)`) one by the element's name. Where a
//! slope of a non-linear law depends on the point, the variables there are symbols, too, but for those that are 0; a function
//! of symbols that is no polynomial is a symbol of its own. Conditions and limits are as they are at the point.

use crate::analysis::linear::Linear;
use crate::bond::equations::slopes::Stands;
use crate::bond::equations::{Input, Unknown};
use crate::bond::graph::{
    BondGraph, BondId, Dissipation, Expr, Law, Leaf, Modulus, Parameter, ParameterId, Power,
    StoreLaw,
};
use crate::expr::dag::Op;
use crate::expr::polynomial::{Polynomial, TooLarge, VARIABLES};
use crate::expr::{Binary, Function, Node, NodeId, Program, Unary};
use crate::source::Span;
use num_bigint::BigInt;
use rustc_hash::FxHashMap;

/// A symbol.
#[derive(Clone, Debug, PartialEq)]
pub struct Symbol {
    /// Its name.
    pub name: String,
    /// Its value at the point.
    pub value: f64,
    /// What it is, where that is no parameter.
    pub meaning: String,
    /// The operation that gives it; none for s.
    pub node: Option<NodeId>,
}

/// A quotient.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// Above.
    pub top: Polynomial,
    /// Below; never 0.
    pub bottom: Polynomial,
}

/// Why there is no symbolic form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// More symbols than fit.
    Symbols,
    /// Polynomials became too large.
    TooLarge,
    /// Something is divided by 0.
    Zero,
    /// The equations leave the output open.
    Singular,
}

impl From<TooLarge> for Trouble {
    fn from(_: TooLarge) -> Trouble {
        Trouble::TooLarge
    }
}

/// The same graph with a parameter for each value that is written at an element as a number.
pub fn name_values(graph: &BondGraph) -> BondGraph {
    let mut named = graph.clone();
    let taken: Vec<String> = graph.parameters.iter().map(|p| p.name.clone()).collect();
    let mut parameters = named.parameters.clone();
    for vertex in &mut named.vertices {
        let (name, kind) = (vertex.name.clone(), vertex.kind);
        let value = match &mut vertex.law {
            Law::Dissipator(Dissipation::Linear(value))
            | Law::Store { law: StoreLaw::Linear(value), .. }
            | Law::Transformer(Modulus::Ratio(value) | Modulus::Gain(value))
            | Law::Gyrator(Modulus::Ratio(value) | Modulus::Gain(value)) => value,
            _ => continue,
        };
        let Some(number) = value.as_number().filter(|number| *number != 0.0) else { continue };
        let mut own = name.clone();
        while taken.contains(&own) {
            own = format!("{own}_{kind}");
        }
        let name = own;
        let id = ParameterId(parameters.len() as u32);
        parameters.push(Parameter {
            name,
            expr: Expr::number(number),
            value: number,
            unit: None,
            description: String::new(),
            span: Span::NONE,
        });
        *value = Expr::leaf(Leaf::Parameter(id));
    }
    named.parameters = parameters;
    named
}

impl Ratio {
    /// 1.
    pub fn one() -> Ratio {
        Ratio::whole(Polynomial::number(1))
    }

    /// −self.
    pub fn negated(self) -> Ratio {
        Ratio { top: self.top.negate(), bottom: self.bottom }
    }

    fn whole(top: Polynomial) -> Ratio {
        Ratio { top, bottom: Polynomial::number(1) }
    }

    /// The number itself, to its shortest decimal digits.
    fn number(value: f64) -> Ratio {
        let text = format!("{value:e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let power: i32 = power.parse().unwrap_or(0);
        let (before, after) = digits.split_once('.').unwrap_or((digits, ""));
        let whole: BigInt = format!("{before}{after}").parse().unwrap_or_default();
        let power = power - after.len() as i32;
        let ten = BigInt::from(10).pow(power.unsigned_abs());
        let (top, bottom) = if power < 0 { (whole, ten) } else { (whole * ten, BigInt::from(1)) };
        Ratio { top: Polynomial::number(top), bottom: Polynomial::number(bottom) }
            .reduced_by_terms()
    }

    /// Without what number and monomial both have in common.
    fn reduced_by_terms(self) -> Ratio {
        let common = self.top.term_content().gcd(&self.bottom.term_content());
        let Ok(mut common) = common else { return self };
        // What is below counts as positive.
        if self.bottom.is_negative() {
            common = common.negate();
        }
        match (self.top.divided(&common), self.bottom.divided(&common)) {
            (Some(top), Some(bottom)) => Ratio { top, bottom },
            _ => self,
        }
    }

    /// self + other, or self − other.
    ///
    /// # Errors
    /// When it is too large.
    pub fn plus(&self, other: &Ratio, subtract: bool) -> Result<Ratio, TooLarge> {
        let join = |a: &Polynomial, b: &Polynomial| if subtract { a.minus(b) } else { a.plus(b) };
        if self.bottom == other.bottom {
            let top = join(&self.top, &other.top);
            return Ok(Ratio { top, bottom: self.bottom.clone() }.reduced_by_terms());
        }
        let (a, b) = (self.top.times(&other.bottom)?, other.top.times(&self.bottom)?);
        Ok(Ratio { top: join(&a, &b), bottom: self.bottom.times(&other.bottom)? }
            .reduced_by_terms())
    }

    /// self · other.
    ///
    /// # Errors
    /// When it is too large.
    pub fn times(&self, other: &Ratio) -> Result<Ratio, TooLarge> {
        let (top, bottom) = (self.top.times(&other.top)?, self.bottom.times(&other.bottom)?);
        Ok(Ratio { top, bottom }.reduced_by_terms())
    }

    /// 1/self.
    ///
    /// # Errors
    /// When it is 0.
    pub fn inverse(&self) -> Result<Ratio, Trouble> {
        match self.top.is_zero() {
            true => Err(Trouble::Zero),
            false => Ok(Ratio { top: self.bottom.clone(), bottom: self.top.clone() }),
        }
    }

    fn power(&self, exponent: i32) -> Result<Ratio, Trouble> {
        let base = if exponent < 0 { self.inverse()? } else { self.clone() };
        let mut result = Ratio::one();
        for _ in 0..exponent.unsigned_abs() {
            result = result.times(&base)?;
        }
        Ok(result)
    }

    /// The number that it is.
    fn constant(&self) -> Option<f64> {
        let float = |p: &Polynomial| Some(crate::expr::polynomial::to_float(&p.constant()?));
        Some(float(&self.top)? / float(&self.bottom)?)
    }

    /// Its factor and its power of s, where s stands in it as a power alone; else the factor at s = 1.
    pub fn power_of_s(&self, values: &[f64]) -> (f64, i32) {
        let mut values = values.to_vec();
        if let Some(s) = values.first_mut() {
            *s = 1.0;
        }
        let power = self.top.degree(0) as i32 - self.bottom.degree(0) as i32;
        (self.top.evaluate(&values).0 / self.bottom.evaluate(&values).0, power)
    }

    /// The value at a complex s.
    pub fn value(&self, at: crate::linear::Complex, values: &[f64]) -> crate::linear::Complex {
        super::transfer::value_of(&self.top, at, values).0
            / super::transfer::value_of(&self.bottom, at, values).0
    }

    /// Its root, where both parts are squares of single terms.
    fn root(&self) -> Option<Ratio> {
        let of = |p: &Polynomial| {
            let [(monomial, value)] = p.terms.as_slice() else { return None };
            let root = value.sqrt();
            (&root * &root == *value).then_some(())?;
            let mut all = Polynomial::number(root);
            for k in 0..VARIABLES {
                let exponent = monomial.exponent(k);
                if exponent % 2 != 0 {
                    return None;
                }
                for _ in 0..exponent / 2 {
                    all = all.times(&Polynomial::variable(k)).ok()?;
                }
            }
            Some(all)
        };
        Some(Ratio { top: of(&self.top)?, bottom: of(&self.bottom)? })
    }
}

/// Reads entries as quotients, and gathers the symbols on its way.
pub struct Reader<'m> {
    graph: &'m BondGraph,
    linear: &'m Linear,
    /// The symbols; s is the first.
    pub symbols: Vec<Symbol>,
    known: FxHashMap<NodeId, Ratio>,
    numbers: FxHashMap<NodeId, f64>,
}

impl<'m> Reader<'m> {
    /// A reader of a model whose values have names ([`name_values`]); `nodes` are all that it will be asked for.
    pub fn new(graph: &'m BondGraph, linear: &'m Linear, nodes: &[NodeId]) -> Reader<'m> {
        let dag = &linear.slopes.dag;
        let below = dag.below(nodes);
        let program = Program::compile(dag, &below);
        let mut registers = program.registers();
        program.run(&linear.values, &mut registers);
        let numbers = below.iter().copied().zip(program.outputs(&registers)).collect();
        let s = Symbol { name: "s".into(), value: 0.0, meaning: String::new(), node: None };
        Reader { graph, linear, symbols: vec![s], known: FxHashMap::default(), numbers }
    }

    /// The quotient of a node.
    ///
    /// # Errors
    /// When it is too large, or divides by 0.
    pub fn ratio(&mut self, node: NodeId) -> Result<Ratio, Trouble> {
        for below in self.linear.slopes.dag.below(&[node]) {
            if !self.known.contains_key(&below) {
                let ratio = self.one(below)?;
                self.known.insert(below, ratio);
            }
        }
        Ok(self.known[&node].clone())
    }

    fn value(&self, node: NodeId) -> f64 {
        self.numbers.get(&node).copied().unwrap_or(f64::NAN)
    }

    /// A node whose operands are known.
    fn one(&mut self, node: NodeId) -> Result<Ratio, Trouble> {
        let value = self.value(node);
        let of = |reader: &Self, node: NodeId| reader.known[&node].clone();
        Ok(match self.linear.slopes.dag.op(node) {
            Op::Constant(bits) => Ratio::number(f64::from_bits(bits)),
            Op::Input(k) => self.input(k, node)?,
            Op::Unary(Unary::Negate, a) => {
                let a = of(self, a);
                Ratio { top: a.top.negate(), bottom: a.bottom }
            }
            Op::Unary(Unary::Not, _) => Ratio::number(value),
            Op::Binary(Binary::Add, a, b) => of(self, a).plus(&of(self, b), false)?,
            Op::Binary(Binary::Subtract, a, b) => of(self, a).plus(&of(self, b), true)?,
            Op::Binary(Binary::Multiply, a, b) => of(self, a).times(&of(self, b))?,
            Op::Binary(Binary::Divide, a, b) => of(self, a).times(&of(self, b).inverse()?)?,
            Op::Binary(Binary::Power, a, b) => {
                match of(self, b).constant().filter(|y| y.fract() == 0.0 && y.abs() < 32.0) {
                    Some(exponent) => of(self, a).power(exponent as i32)?,
                    None => self.opaque(node, value)?,
                }
            }
            Op::Binary(..) => Ratio::number(value),
            Op::Select(c, a, b) => of(self, if self.value(c) != 0.0 { a } else { b }),
            Op::Two(Function::Min | Function::Max, a, b) => {
                of(self, if self.value(a) == value { a } else { b })
            }
            Op::One(Function::Abs, a) => match self.value(a) < 0.0 {
                true => Ratio { top: of(self, a).top.negate(), bottom: of(self, a).bottom },
                false => of(self, a),
            },
            Op::One(Function::Sign | Function::Floor, _) => Ratio::number(value),
            Op::One(Function::Sqrt, a) => match of(self, a).root() {
                Some(root) => root,
                None => self.opaque(node, value)?,
            },
            Op::One(_, a) if of(self, a).constant().is_some() => Ratio::number(value),
            Op::One(..) | Op::Two(..) | Op::Table(..) | Op::Slope(..) => {
                self.opaque(node, value)?
            }
        })
    }

    fn input(&mut self, k: u32, node: NodeId) -> Result<Ratio, Trouble> {
        let value = self.linear.values[k as usize];
        let (name, meaning) = match self.linear.slopes.stands(k) {
            Stands::For(Input::Parameter(id)) => {
                // One that only passes another one on goes by the name of that.
                let mut parameter = &self.graph.parameters[id as usize];
                while let Node::Leaf(Leaf::Parameter(id)) = &*parameter.expr.node {
                    parameter = &self.graph.parameters[id.index()];
                }
                (parameter.name.clone(), String::new())
            }
            Stands::For(Input::Unknown(_)) if value == 0.0 => return Ok(Ratio::number(0.0)),
            Stands::For(Input::Unknown(k)) => {
                let name = short_name(self.graph, self.linear, k as usize);
                let meaning = format!("{name} at the point");
                (name, meaning)
            }
            _ => return Ok(Ratio::number(value)),
        };
        self.symbol(name, meaning, value, node)
    }

    fn symbol(
        &mut self,
        name: String,
        meaning: String,
        value: f64,
        node: NodeId,
    ) -> Result<Ratio, Trouble> {
        // A parameter may be called as Laplace's variable is.
        let name = if name == "s" { "s_".to_string() } else { name };
        let known = self.symbols.iter().position(|symbol| symbol.name == name);
        let k = match known {
            Some(k) => k,
            None => {
                self.symbols.push(Symbol { name, value, meaning, node: Some(node) });
                self.symbols.len() - 1
            }
        };
        if k >= VARIABLES {
            Err(Trouble::Symbols)
        } else {
            Ok(Ratio::whole(Polynomial::variable(k)))
        }
    }

    /// A symbol for what is no polynomial.
    fn opaque(&mut self, node: NodeId, value: f64) -> Result<Ratio, Trouble> {
        if value == 0.0 {
            return Ok(Ratio::number(0.0));
        }
        let text = self.text(node, 0).filter(|text| text.len() <= 60);
        let taken = |name: &String| {
            self.symbols.iter().any(|symbol| symbol.name == *name)
                || self.graph.parameters.iter().any(|parameter| parameter.name == *name)
        };
        let mut free = (1..).map(|k| format!("k_{k}")).skip_while(taken);
        let name = free.next().unwrap_or_default();
        let known = self.symbols.iter().find(|symbol| symbol.node == Some(node));
        let name = known.map_or(name, |symbol| symbol.name.clone());
        let meaning = text.unwrap_or_else(|| "a slope at the point".into());
        self.symbol(name, meaning, value, node)
    }

    /// An operation as text, where that is short.
    fn text(&self, node: NodeId, depth: u32) -> Option<String> {
        if depth > 6 {
            return None;
        }
        let of = |node: NodeId| self.text(node, depth + 1);
        let slopes = &self.linear.slopes;
        Some(match slopes.dag.op(node) {
            Op::Constant(bits) => crate::expr::print::number(f64::from_bits(bits)),
            Op::Input(k) => match slopes.stands(k) {
                Stands::For(Input::Parameter(id)) => {
                    self.graph.parameters[id as usize].name.clone()
                }
                Stands::For(Input::Unknown(k)) => short_name(self.graph, self.linear, k as usize),
                _ => return None,
            },
            Op::Unary(Unary::Negate, a) => format!("(-{})", of(a)?),
            Op::Binary(op, a, b) => {
                let sign = match op {
                    Binary::Add => "+",
                    Binary::Subtract => "-",
                    Binary::Multiply => "*",
                    Binary::Divide => "/",
                    Binary::Power => "^",
                    _ => return None,
                };
                format!("({}{sign}{})", of(a)?, of(b)?)
            }
            Op::One(function, a) => {
                let inner = of(a)?;
                let inner =
                    inner.strip_prefix('(').and_then(|t| t.strip_suffix(')')).unwrap_or(&inner);
                format!("{}({inner})", function.row().name)
            }
            Op::Two(function, a, b) => format!("{}({}, {})", function.row().name, of(a)?, of(b)?),
            _ => return None,
        })
    }
}

/// The name of an unknown, a bond's variable as [`bond_variable`] has it.
pub fn short_name(graph: &BondGraph, linear: &Linear, k: usize) -> String {
    match linear.kinds[k] {
        Unknown::Effort(bond) => bond_variable(graph, bond, Power::Effort),
        Unknown::Flow(bond) => bond_variable(graph, bond, Power::Flow),
        _ => linear.unknowns[k].name.clone(),
    }
}

/// A bond's variable by the junction that shares it, or by the element whose own it is.
pub fn bond_variable(graph: &BondGraph, bond: BondId, variable: Power) -> String {
    let (letter, shares) = match variable {
        Power::Effort => ("e", "0"),
        Power::Flow => ("f", "1"),
    };
    let ends = [graph.bond(bond).from, graph.bond(bond).to].map(|end| graph.vertex(end.vertex));
    let junction = ends.iter().find(|vertex| vertex.kind == shares);
    let one_port = ends.iter().find(|vertex| vertex.bonds.len() == 1);
    let name = junction.or(one_port).map_or(graph.bond_name(bond), |vertex| vertex.name.clone());
    format!("{letter}({name})")
}

/// The monomial of s.
pub fn s() -> Polynomial {
    Polynomial::variable(0)
}
