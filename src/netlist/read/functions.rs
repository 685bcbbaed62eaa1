//! Functions of one's own: `.func f(x, y) {expression}`, `.param f(x, y)={expression}`, and Xyce's `ddx(expression, x)`.
//!
//! A call may stand before its definition, and a subcircuit may define a function of a name that another has outside. So
//! a call is read as a name that no text can spell, and when all is read the bodies are put in the place of calls, with
//! the functions of the innermost block around each. After that the netlist holds no calls and no definitions.

use super::Reader;
use crate::diagnostic::Diagnostic;
use crate::expr::parse::{MAX_DEPTH, too_deep, unknown_function};
use crate::expr::slope::slope;
use crate::netlist::parts::{every_leaf, map_leaves};
use crate::netlist::visit::expressions_mut;
use crate::netlist::{Card, CardKind, Definition, Expr, Leaf, Name, Names, Netlist, Operator};
use crate::quantity::nearest;
use crate::source::Span;
use std::collections::HashMap;

/// Nodes that all bodies together may add.
const MOST_NODES: usize = 2_000_000;

/// Calls within calls, at most.
const DEEPEST: usize = 100;

/// The calls that were read, each by the name that stands for it.
#[derive(Default)]
pub struct Calls {
    calls: HashMap<Name, Call>,
    order: Vec<Name>,
    /// How many places draw a random number.
    draws: u32,
}

/// A call of a function that the table of functions does not know.
struct Call {
    function: Name,
    arguments: Vec<Expr>,
    span: Span,
}

impl Calls {
    /// The leaf that stands for a call.
    pub fn add(
        &mut self,
        names: &mut Names,
        function: &str,
        arguments: Vec<Expr>,
        span: Span,
    ) -> Leaf {
        let own = names.intern(&format!("{function}()\u{2}{}", self.calls.len()));
        let function = names.intern(function);
        self.calls.insert(own, Call { function, arguments, span });
        self.order.push(own);
        Leaf::Parameter(own)
    }

    /// The number of a new place that draws a random number.
    pub fn draw(&mut self) -> u32 {
        self.draws += 1;
        self.draws
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// A body with other names for its arguments, in the calls within it (those from `since` on), too.
    pub fn rename(&mut self, since: usize, body: &Expr, names: &[(Name, Name)]) -> Expr {
        let renamed = |expr: &Expr| {
            map_leaves(expr, &mut |leaf, span| {
                let other = match leaf {
                    Leaf::Parameter(name) => names.iter().find(|(own, _)| own == name),
                    _ => None,
                };
                let leaf = other.map_or(leaf.clone(), |(_, other)| Leaf::Parameter(*other));
                Expr::new(crate::expr::Node::Leaf(leaf), span)
            })
        };
        for name in &self.order[since..] {
            if let Some(call) = self.calls.get_mut(name) {
                call.arguments = call.arguments.iter().map(renamed).collect();
            }
        }
        renamed(body)
    }
}

/// Puts the bodies of functions in the place of their calls, and takes the definitions out.
pub fn resolve(reader: &mut Reader, netlist: &mut Netlist) {
    let calls = std::mem::take(&mut reader.calls.calls);
    let mut resolver = Resolver {
        calls: &calls,
        names: &reader.names,
        dialect: reader.dialect.spelling,
        scopes: vec![],
        chain: vec![],
        left: MOST_NODES,
        draws: reader.calls.draws,
        d: reader.diagnostics,
    };
    if !calls.is_empty() || reader.defined {
        resolver.block(&mut netlist.cards);
    }
}

struct Resolver<'a> {
    calls: &'a HashMap<Name, Call>,
    names: &'a Names,
    dialect: crate::expr::Dialect,
    /// The functions of each block, the innermost last.
    scopes: Vec<HashMap<Name, Definition>>,
    /// The functions whose bodies are being put in.
    chain: Vec<Name>,
    left: usize,
    /// How many places draw a random number.
    draws: u32,
    d: &'a mut Vec<Diagnostic>,
}

impl Resolver<'_> {
    fn block(&mut self, cards: &mut Vec<Card>) {
        let mut own = HashMap::new();
        take_definitions(cards, &mut own);
        self.scopes.push(own);
        self.cards(cards);
        self.scopes.pop();
    }

    fn cards(&mut self, cards: &mut [Card]) {
        for card in cards {
            expressions_mut(card, &mut |expr| {
                let mut calls = false;
                every_leaf(expr, &mut |leaf, _| calls |= self.call(leaf).is_some());
                if calls {
                    *expr = self.expr(expr);
                }
            });
            match &mut card.kind {
                CardKind::Subcircuit(subcircuit) => self.block(&mut subcircuit.cards),
                CardKind::Choice(branches) => {
                    branches.iter_mut().for_each(|branch| self.cards(&mut branch.cards));
                }
                _ => {}
            }
        }
    }

    fn call(&self, leaf: &Leaf) -> Option<&Call> {
        match leaf {
            Leaf::Parameter(name) => self.calls.get(name),
            _ => None,
        }
    }

    /// The expression without calls. What is wrong in it has been said, and is NaN.
    fn expr(&mut self, expr: &Expr) -> Expr {
        map_leaves(expr, &mut |leaf, span| {
            let known = match leaf {
                Leaf::Parameter(name) => self.calls.get(name),
                _ => None,
            };
            let Some(call) = known else {
                return Expr::new(crate::expr::Node::Leaf(leaf.clone()), span);
            };
            self.body(call).unwrap_or_else(|error| {
                // Once for each call, however often its body is put in.
                if !self.d.contains(&error) {
                    self.d.push(*error);
                }
                Expr::number(f64::NAN)
            })
        })
    }

    fn body(&mut self, call: &Call) -> Result<Expr, Box<Diagnostic>> {
        let text = self.names.text(call.function);
        let arguments: Vec<Expr> = call.arguments.iter().map(|a| self.expr(a)).collect();
        let found = self.scopes.iter().rev().find_map(|scope| scope.get(&call.function)).cloned();
        let Some(function) = found else {
            return match (text.eq_ignore_ascii_case("ddx"), &arguments[..]) {
                (true, [law, by]) => derivative(law, by, call.span),
                _ => Err(Box::new(self.unknown(text, call.span))),
            };
        };
        if function.arguments.len() != arguments.len() {
            let (wanted, given) = (function.arguments.len(), arguments.len());
            let plural = if wanted == 1 { "" } else { "s" };
            let message = format!("`{text}` takes {wanted} argument{plural}");
            let error =
                Diagnostic::error("E0112", call.span, message).says(format!("{given} given"));
            return Err(Box::new(error.label(function.span, "defined here")));
        }
        if self.chain.contains(&call.function) || self.chain.len() >= DEEPEST {
            let round =
                self.chain.iter().chain([&call.function]).map(|name| self.names.text(*name));
            let round: Vec<&str> = round.collect();
            let error = Diagnostic::error("E0714", call.span, "a function that calls itself")
                .because(round[round.len().saturating_sub(8)..].join(" → "));
            return Err(Box::new(error));
        }
        self.chain.push(call.function);
        let body = self.expr(&function.body);
        self.chain.pop();
        let mut renumbered: Vec<(u32, u32)> = vec![];
        let body = map_leaves(&body, &mut |leaf, span| {
            let argument = match leaf {
                Leaf::Parameter(name) => function.arguments.iter().position(|own| own == name),
                // Each call draws for itself.
                Leaf::Operator(Operator::Draw(draw, number), _) => {
                    let known = renumbered.iter().find(|(old, _)| old == number);
                    let new = known.map_or(self.draws + 1, |(_, new)| *new);
                    if known.is_none() {
                        self.draws = new;
                        renumbered.push((*number, new));
                    }
                    let leaf = Leaf::Operator(Operator::Draw(*draw, new), vec![]);
                    return Expr::new(crate::expr::Node::Leaf(leaf), span);
                }
                _ => None,
            };
            match argument.and_then(|k| arguments.get(k)) {
                Some(argument) => argument.clone(),
                None => Expr::new(crate::expr::Node::Leaf(leaf.clone()), span),
            }
        });
        self.left = self.left.saturating_sub(size(&body));
        if self.left == 0 {
            let message = "the functions of the netlist grow too large";
            let error = Diagnostic::error("E0714", call.span, message).because(format!(
                "their bodies in the place of calls are more than {MOST_NODES} operations"
            ));
            return Err(Box::new(error));
        }
        if body.depth() >= MAX_DEPTH {
            return Err(Box::new(too_deep(call.span)));
        }
        Ok(Expr { span: call.span, ..body })
    }

    fn unknown(&self, text: &str, span: Span) -> Diagnostic {
        let known =
            self.scopes.iter().flat_map(|scope| scope.keys()).map(|name| self.names.text(*name));
        let mut known: Vec<&str> = known.collect();
        known.sort_unstable();
        match nearest(text, known) {
            Some(near) => Diagnostic::error("E0210", span, format!("unknown function `{text}`"))
                .help(format!("did you mean `{near}`?")),
            None => unknown_function(self.dialect, text, span),
        }
    }
}

/// The definitions of a block, those within its choices too; the last of a name counts.
fn take_definitions(cards: &mut Vec<Card>, into: &mut HashMap<Name, Definition>) {
    cards.retain_mut(|card| match &mut card.kind {
        CardKind::Function(definition) => {
            into.insert(definition.name, definition.clone());
            false
        }
        CardKind::Choice(branches) => {
            branches.iter_mut().for_each(|branch| take_definitions(&mut branch.cards, into));
            true
        }
        _ => true,
    });
}

/// `ddx(law, x)`: the derivative of a law by a voltage, a current or a parameter that it speaks of.
fn derivative(law: &Expr, by: &Expr, span: Span) -> Result<Expr, Box<Diagnostic>> {
    let crate::expr::Node::Leaf(by) = &*by.node else {
        let message = "`ddx` takes an expression, and a voltage, a current or a name";
        return Err(Box::new(Diagnostic::error("E0703", span, message).help("ddx(V(a)**2, V(a))")));
    };
    let mut own = |leaf: &Leaf| match (leaf, by) {
        (Leaf::Voltage(plus, minus), Leaf::Voltage(node, None)) => {
            f64::from(plus == node) - f64::from(minus.as_ref() == Some(node))
        }
        (leaf, by) => f64::from(leaf == by),
    };
    Ok(Expr { span, ..slope(law, &mut own) })
}

fn size(expr: &Expr) -> usize {
    let mut count = 0;
    expr.leaves(&mut |_, _| count += 1);
    2 * count + 1
}
