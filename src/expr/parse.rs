//! From the pairs of the shared grammar `grammar/expression.pest` to an [`Expr`].
//!
//! A language (`.bg`, netlists) derives a parser from the shared grammar and its own, and tells here what its rules
//! are and what its atoms mean:
//!
//! ```text
//! impl Language for Netlist<'_> {
//!     type Rule = Rule;
//!     type Leaf = netlist::Leaf;
//!     expr::roles!(Rule);
//!     fn dialect(&self) -> Dialect { Dialect::Ngspice }
//!     fn span(&self, span: pest::Span<'_>) -> Span { Span::new(self.file, span.start() + self.offset, …) }
//!     fn atom(&mut self, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr<Leaf>> { … }
//!     fn call(&mut self, name: &str, pair: Pair<'_, Rule>, d: &mut Vec<Diagnostic>) -> Option<Expr<Leaf>> { … }
//! }
//! let mut pairs = Parser::parse(Rule::expression, text)?;    // after parse::nesting(text) has passed
//! let expr = parse::expression(&mut language, pairs.next()?, diagnostics);
//! ```
//!
//! `atom` gets every `number`, `reference` and `special` pair. `call` gets each call whose name is not in the table of
//! functions, as the raw pair: first the `function_name`, then the arguments as the grammar's own `argument` gave them
//! (those that are plain have the role [`Role::Expression`] and go through [`expression`] again), and a `row_break`
//! for each `;`. When it knows no such function either, it pushes [`unknown_function`].
//!
//! Depth. The text is checked for nesting before pest runs ([`nesting`]); chains of one precedence
//! (`a + b + c + …`, however long) become balanced trees; what is deeper than [`MAX_DEPTH`] all the same is refused.
//! So no later stage that walks a tree can overflow its stack.

use super::chains::{Operator, Part, Stack, join, measured};
use super::functions::{Dialect, Function, Slot, Template};
use super::names::{self, Meaning};
use super::tree::{Binary, Expr, Node};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use pest::RuleType;
use pest::iterators::Pair;

/// Brackets and conditions within one another, at most.
pub const MAX_NESTING: usize = 200;

/// Levels of a tree, at most.
pub const MAX_DEPTH: usize = 1000;

/// What a grammar's rule is to expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The rule `expression`.
    Expression,
    /// The rule `conditional`.
    Conditional,
    /// The rule `call`.
    Call,
    /// An operator between operands, or the same sign before one.
    Infix(Binary),
    /// `not`.
    Not,
    /// `?` and `:`, `if`, `then`, `else`.
    Word,
    /// `;` between arguments.
    RowBreak,
    /// Anything else: the language's own.
    Atom,
}

/// What the shared converter asks of a language; see the module's page.
pub trait Language {
    /// The derived parser's rules.
    type Rule: RuleType;
    /// Its leaves.
    type Leaf: Clone;
    /// Whose names of functions it has, and whose meaning of `^`.
    fn dialect(&self) -> Dialect;
    /// What a rule is; written by [`roles!`](crate::expr::roles).
    fn role(rule: Self::Rule) -> Role;
    /// Where a piece of the parsed text stands.
    fn span(&self, span: pest::Span<'_>) -> Span;
    /// The tree of a `number`, a `reference` or a special form. On an error, pushes it and gives `None`.
    fn atom(
        &mut self,
        pair: Pair<'_, Self::Rule>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr<Self::Leaf>>;
    /// The tree of a call that the language reads in its own way, whatever the table of functions says; `None` leaves it
    /// to the table. On an error, pushes it and gives `Some(None)`.
    #[allow(clippy::option_option)]
    fn own_call(
        &mut self,
        _name: &str,
        _pair: &Pair<'_, Self::Rule>,
        _d: &mut Vec<Diagnostic>,
    ) -> Option<Option<Expr<Self::Leaf>>> {
        None
    }
    /// The tree of a call that the table of functions does not know. On an error, pushes it and gives `None`.
    fn call(
        &mut self,
        name: &str,
        pair: Pair<'_, Self::Rule>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr<Self::Leaf>>;
}

/// Writes [`Language::role`] for a parser that includes `grammar/expression.pest`.
#[macro_export]
#[doc(hidden)]
macro_rules! __expression_roles {
    ($rule:ident) => {
        fn role(rule: $rule) -> $crate::expr::parse::Role {
            use $crate::expr::{Binary, parse::Role};
            match rule {
                $rule::expression => Role::Expression,
                $rule::conditional => Role::Conditional,
                $rule::call => Role::Call,
                $rule::op_plus => Role::Infix(Binary::Add),
                $rule::op_minus => Role::Infix(Binary::Subtract),
                $rule::op_times => Role::Infix(Binary::Multiply),
                $rule::op_divide => Role::Infix(Binary::Divide),
                $rule::op_power => Role::Infix(Binary::Power),
                $rule::op_less => Role::Infix(Binary::Less),
                $rule::op_less_equal => Role::Infix(Binary::LessEqual),
                $rule::op_greater => Role::Infix(Binary::Greater),
                $rule::op_greater_equal => Role::Infix(Binary::GreaterEqual),
                $rule::op_equal => Role::Infix(Binary::Equal),
                $rule::op_not_equal => Role::Infix(Binary::NotEqual),
                $rule::op_and => Role::Infix(Binary::And),
                $rule::op_or => Role::Infix(Binary::Or),
                $rule::op_not => Role::Not,
                $rule::question
                | $rule::colon
                | $rule::key_if
                | $rule::key_then
                | $rule::key_else => Role::Word,
                $rule::row_break => Role::RowBreak,
                _ => Role::Atom,
            }
        }
    };
}

/// Finds the first byte at which brackets, `if` or `?` stand deeper than [`MAX_NESTING`], for the language to refuse
/// the text with [`too_deep`] before pest recurses into it. `comment` starts a comment that ends with the line.
pub fn nesting(text: &str, comment: Option<u8>) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut open, mut conditions, mut at) = (0usize, 0usize, 0usize);
    let is_word = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80;
    while at < bytes.len() {
        match bytes[at] {
            b'(' | b'[' | b'{' => open += 1,
            b')' | b']' | b'}' => open = open.saturating_sub(1),
            b'?' => conditions += 1,
            b'\n' if open == 0 => conditions = 0,
            byte if Some(byte) == comment => {
                at += bytes[at..].iter().position(|b| *b == b'\n').unwrap_or(bytes.len() - at);
                continue;
            }
            byte if is_word(byte) => {
                let length =
                    bytes[at..].iter().position(|b| !is_word(*b)).unwrap_or(bytes.len() - at);
                conditions += usize::from(&bytes[at..at + length] == b"if");
                at += length;
                if open + conditions > MAX_NESTING {
                    return Some(at - length);
                }
                continue;
            }
            _ => {}
        }
        if open + conditions > MAX_NESTING {
            return Some(at);
        }
        at += 1;
    }
    None
}

/// The error for what is nested too deeply.
pub fn too_deep(span: Span) -> Diagnostic {
    Diagnostic::error("E0110", span, "nested too deeply")
        .says("deeper than this is not read")
        .because(format!("at most {MAX_NESTING} brackets and conditions, {MAX_DEPTH} operations within one another"))
        .help("name a part of it as a parameter or a signal")
}

/// The error for a call of a function that nobody knows.
pub fn unknown_function(dialect: Dialect, name: &str, span: Span) -> Diagnostic {
    let error = Diagnostic::error("E0210", span, format!("unknown function `{name}`"));
    match names::nearest(dialect, name) {
        Some(nearest) => error.help(format!("did you mean `{nearest}`?")),
        None => error,
    }
}

/// The tree of an `expression` pair. `None` when anything within it was wrong; the errors are pushed.
pub fn expression<L: Language>(
    language: &mut L,
    pair: Pair<'_, L::Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Expr<L::Leaf>> {
    convert(language, pair, d).map(|mut part| {
        // A number or a name in brackets keeps its own place.
        if !matches!(*part.expr.node, Node::Number(_) | Node::Leaf(_)) {
            part.expr.span = part.place;
        }
        part.expr
    })
}

fn convert<L: Language>(
    language: &mut L,
    pair: Pair<'_, L::Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Part<L::Leaf>> {
    let whole = language.span(pair.as_span());
    let mut failed = false;
    let mut branches = vec![];
    let mut stack =
        Stack { dialect: language.dialect(), operands: vec![], operators: vec![], diagnostics: d };
    let (mut after_operand, mut branching) = (false, false);
    for part in pair.into_inner() {
        let span = language.span(part.as_span());
        let role = L::role(part.as_rule());
        match role {
            Role::Word => branching = true,
            _ if branching => branches.push(part),
            Role::Infix(op) if after_operand => {
                // `^` is a power to some, and logic to others.
                let logic = op == Binary::Power
                    && matches!(stack.dialect, Dialect::Xyce | Dialect::Ltspice)
                    && part.as_str() == "^";
                let taken = if logic { stack.exclusive_or() } else { stack.infix(op, span) };
                failed |= taken.is_none();
                after_operand = false;
            }
            Role::Infix(Binary::Subtract) => stack.operators.push(Operator::Negate(span)),
            Role::Infix(_) => stack.operators.push(Operator::Plus),
            Role::Not => {
                let loose = stack.dialect == Dialect::Bond
                    || (part.as_str() == "~" && stack.dialect == Dialect::Xyce);
                stack.operators.push(Operator::Not(span, loose));
            }
            _ => {
                let operand = match role {
                    Role::Expression => {
                        let place = bracketed(part.as_span()).map(|span| language.span(span));
                        let mut operand = convert(language, part, stack.diagnostics);
                        if let (Some(operand), Some(place)) = (&mut operand, place) {
                            operand.place = place;
                        }
                        operand
                    }
                    Role::Conditional => conditional(language, part, stack.diagnostics),
                    Role::Call => call(language, part, stack.diagnostics),
                    _ => language.atom(part, stack.diagnostics).map(measured),
                };
                failed |= operand.is_none();
                stack.operands.push(operand.unwrap_or_else(|| measured(Expr::number(f64::NAN))));
                after_operand = true;
            }
        }
    }
    failed |= stack.reduce(0).is_none();
    let mut value = stack.operands.pop();
    if !branches.is_empty() {
        value = value.and_then(|value| stack.truth(value));
    }
    let d = stack.diagnostics;
    let mut branches = branches.into_iter();
    let value = match (branches.next(), branches.next()) {
        (Some(then), Some(otherwise)) => {
            let (then, otherwise) = (convert(language, then, d), convert(language, otherwise, d));
            choice(value?, then?, otherwise?, whole, d)
        }
        _ => value,
    };
    value.filter(|_| !failed)
}

/// The place of an expression with the brackets around it, which are no pairs of the grammar.
fn bracketed(inner: pest::Span<'_>) -> Option<pest::Span<'_>> {
    let input = inner.get_input();
    let before = input.get(..inner.start())?.trim_end().strip_suffix('(')?;
    let behind = input.get(inner.end()..)?.trim_start().strip_prefix(')')?;
    pest::Span::new(input, before.len(), input.len() - behind.len())
}

fn choice<L>(
    condition: Part<L>,
    then: Part<L>,
    otherwise: Part<L>,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Part<L>> {
    let depth = condition.depth.max(then.depth).max(otherwise.depth);
    join(Node::choice(condition.expr, then.expr, otherwise.expr), depth, span, d)
}

fn conditional<L: Language>(
    language: &mut L,
    pair: Pair<'_, L::Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Part<L::Leaf>> {
    let span = language.span(pair.as_span());
    let mut parts = vec![];
    for part in pair.into_inner().filter(|p| L::role(p.as_rule()) == Role::Expression) {
        parts.push(convert(language, part, d));
    }
    let mut parts = parts.into_iter().flatten();
    let (condition, then, otherwise) = (parts.next()?, parts.next()?, parts.next()?);
    choice(condition, then, otherwise, span, d)
}

fn call<L: Language>(
    language: &mut L,
    pair: Pair<'_, L::Rule>,
    d: &mut Vec<Diagnostic>,
) -> Option<Part<L::Leaf>> {
    let span = language.span(pair.as_span());
    let mut inner = pair.clone().into_inner();
    let name = inner.next()?.as_str().trim_end();
    if let Some(own) = language.own_call(name, &pair, d) {
        return own.map(measured);
    }
    let Some(meaning) = names::find(language.dialect(), name) else {
        return language.call(name, pair.clone(), d).map(measured);
    };
    let (mut arguments, mut strange) = (vec![], false);
    for argument in inner {
        if L::role(argument.as_rule()) == Role::Expression {
            arguments.push(convert(language, argument, d));
        } else {
            // Said of the first; the others are alike.
            if !std::mem::replace(&mut strange, true) {
                let place = language.span(argument.as_span());
                let message = format!("`{name}` takes plain values, separated by commas");
                d.push(Diagnostic::error("E0111", place, message));
            }
            arguments.push(None);
        }
    }
    let arguments: Vec<_> = arguments.into_iter().collect::<Option<_>>()?;
    let (wanted, most) = meaning.arguments();
    let associative =
        matches!(meaning, Meaning::Function(Function::Min | Function::Max)) && arguments.len() > 2;
    if !(wanted..=most).contains(&arguments.len()) && !associative {
        let plural = if wanted == 1 { "" } else { "s" };
        d.push(
            Diagnostic::error("E0112", span, format!("`{name}` takes {wanted} argument{plural}"))
                .says(format!("{} given", arguments.len())),
        );
        return None;
    }
    match meaning {
        Meaning::Function(function) if associative => {
            let mut rest = arguments.into_iter();
            let first = rest.next()?;
            rest.try_fold(first, |left, right| {
                let depth = left.depth.max(right.depth);
                join(Node::Call(function, vec![left.expr, right.expr]), depth, span, d)
            })
        }
        Meaning::Function(function) => {
            let depth = arguments.iter().map(|a| a.depth).max().unwrap_or(0);
            let arguments = arguments.into_iter().map(|a| a.expr).collect();
            join(Node::Call(function, arguments), depth, span, d)
        }
        Meaning::Expansion { template, .. } => {
            let template = template();
            let depth = template.depth() + arguments.iter().map(|a| a.depth).max().unwrap_or(0);
            if depth >= MAX_DEPTH {
                d.push(too_deep(span));
                return None;
            }
            let copies: Vec<_> = arguments.into_iter().map(|a| a.expr).collect();
            let mut expr = substitute(&template, &copies);
            expr.span = span;
            Some(Part { expr, depth, place: span })
        }
    }
}

/// The template with its arguments put in.
pub(super) fn substitute<L: Clone>(template: &Template, arguments: &[Expr<L>]) -> Expr<L> {
    template.map(&mut |slot, _| match slot {
        Slot::Argument(k) if *k < arguments.len() => arguments[*k].clone(),
        _ => Expr::number(f64::NAN),
    })
}
