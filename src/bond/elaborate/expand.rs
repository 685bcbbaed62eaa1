//! From statements to declarations: models become instances, loops and conditions the statements in them.
//!
//! Frames are worked through in the order in which they are declared, so nothing here is recursive but loops within
//! loops, whose depth the parser limits. Parameters are declared before anything else of their frame, since the
//! bounds of loops and the indices of names need their values.

use super::frames::*;
use super::program::Program;
use super::scope::{Declaration, Mark, RESERVED, Scope, Setting, Valued};
use crate::bond::elements::{ELEMENTS, element};
use crate::bond::graph::*;
use crate::bond::syntax::{
    Argument, ChainEnd, Expr as Syntax, Name, Part, Statement, StatementKind, Value,
};
use crate::diagnostic::Diagnostic;
use crate::expr::Expr as Tree;
use crate::quantity::{did_you_mean, nearest};
use crate::source::{SourceMap, Span};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

/// More elements, signals, parameters and instances than this are a slip of the pen.
pub const MOST_PARTS: usize = 250_000;

/// What is wrong this often, in loops and instances, needs no further rounds.
const MOST_SAID: usize = 5_000;

impl<'a> Scope<'a> {
    /// Collects every declaration of a program. `set`: what the command line sets, read.
    pub fn collect(
        program: &'a Program,
        map: &'a SourceMap,
        set: &'a [(String, String, Option<Syntax>)],
        d: &mut Vec<Diagnostic>,
    ) -> Scope<'a> {
        let mut scope = Scope::of_bodies(program, map, set, d);
        scope.expand_frames(0, d);
        scope.here = Here::ROOT;
        scope
    }

    /// Collects what stands in the models of the first file that no instance is made of, as far as that is known
    /// without one: each gets a frame of its own, in which parameters without defaults and inputs have no values.
    /// `None` when every model is used.
    pub fn collect_unused(
        program: &'a Program,
        map: &'a SourceMap,
        used: &Scope<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Scope<'a>> {
        let mut seen = vec![false; used.bodies.len()];
        used.frames.iter().for_each(|frame| seen[frame.body] = true);
        let own = |k: usize| used.bodies[k].file == 0 && used.bodies[k].header.is_some();
        if (0..seen.len()).all(|k| seen[k] || !own(k)) {
            return None;
        }
        // What is wrong with the names of models has been said.
        let mut scope = Scope::of_bodies(program, map, &[], &mut vec![]);
        // Those that stand last use those before them, and then show these in their place.
        for body in (0..seen.len()).rev() {
            if seen[body] || !own(body) {
                continue;
            }
            let first = scope.frames.len();
            scope.frames.push(frame(body, String::new(), None, Span::NONE, &[]));
            scope.expand_frames(first, d);
            scope.frames[first..].iter().for_each(|frame| seen[frame.body] = true);
        }
        scope.here = Here::ROOT;
        Some(scope)
    }

    /// Works through the frames from one on, and through those that they declare.
    fn expand_frames(&mut self, first: usize, d: &mut Vec<Diagnostic>) {
        let mut next = first;
        while next < self.frames.len() {
            self.here = Here { frame: FrameId(next as u32), round: None };
            self.expand_frame(d);
            next += 1;
        }
    }

    /// A scope that knows the models of a program, and the frame of its first file, still empty.
    fn of_bodies(
        program: &'a Program,
        map: &'a SourceMap,
        set: &'a [(String, String, Option<Syntax>)],
        d: &mut Vec<Diagnostic>,
    ) -> Scope<'a> {
        let setting = |(name, text, value): &'a (String, String, Option<Syntax>)| Setting {
            name,
            text,
            value: value.as_ref(),
            taken: None,
            declared: None,
        };
        let mut scope = Scope {
            map,
            graph: BondGraph::default(),
            here: Here::ROOT,
            frames: vec![],
            rounds: vec![],
            bodies: vec![],
            kinds: vec![],
            declarations: vec![],
            chains: vec![],
            halves: vec![],
            ports: vec![],
            between: Default::default(),
            parameters: vec![],
            signals: vec![],
            signal_order: vec![],
            outputs: vec![],
            drives: vec![],
            regulators: vec![],
            simulate: vec![],
            options: vec![],
            observe: vec![],
            set: set.iter().map(setting).collect(),
            hidden: HashMap::new(),
            tables: HashMap::new(),
            table_units: HashMap::new(),
            marks: vec![],
            evaluated: vec![],
            demands: 0,
            clock: 0,
            parameter_dimensions: vec![],
            signal_dimensions: vec![],
            searched: Default::default(),
            units: Default::default(),
        };
        scope.collect_bodies(program, d);
        scope.graph.name = scope.bodies.first().map_or(String::new(), |body| body.name.clone());
        scope.frames.push(frame(0, String::new(), None, Span::NONE, &[]));
        scope
    }

    /// The models of each file, and which can be used where. The first body is the file that is run.
    fn collect_bodies(&mut self, program: &'a Program, d: &mut Vec<Diagnostic>) {
        let mut own: Vec<Vec<usize>> = vec![];
        for (file, syntax) in program.files.iter().enumerate() {
            let mut found = vec![self.bodies.len()];
            self.bodies.push(Body {
                name: stem(self.map, syntax.file),
                header: None,
                statements: &syntax.statements,
                file,
                span: Span::NONE,
            });
            for statement in &syntax.statements {
                let StatementKind::Model(model) = &statement.kind else { continue };
                let name = model.name.text.as_str();
                if element(name).is_some() {
                    d.push(
                        Diagnostic::error(
                            "E0233",
                            model.name.span,
                            format!("a model cannot be called `{name}`"),
                        )
                        .says("the name of a kind of element")
                        .help("give it another name"),
                    );
                    continue;
                }
                let twice = found[1..].iter().find(|body| self.bodies[**body].name == name);
                if let Some(first) = twice {
                    let first = self.bodies[*first].span;
                    d.push(
                        Diagnostic::error(
                            "E0203",
                            model.name.span,
                            format!("the model `{name}` is declared twice"),
                        )
                        .says("declared again here")
                        .label(first, "first declared here"),
                    );
                    continue;
                }
                found.push(self.bodies.len());
                self.bodies.push(Body {
                    name: name.to_string(),
                    header: Some(&model.parameters),
                    statements: &model.body,
                    file,
                    span: model.name.span,
                });
            }
            own.push(found);
        }
        for (file, imports) in program.imports.iter().enumerate() {
            let mut kinds: HashMap<String, usize> = HashMap::new();
            // The file itself has no name within itself.
            for body in &own[file][1..] {
                kinds.insert(self.bodies[*body].name.clone(), *body);
            }
            let mut imported = HashSet::new();
            for (span, target) in imports {
                let Some(target) = target.filter(|target| imported.insert(*target)) else {
                    continue;
                };
                for body in &own[target] {
                    let name = &self.bodies[*body].name;
                    let whole_file = self.bodies[*body].header.is_none();
                    if whole_file && !is_model(self.bodies[*body].statements) {
                        continue;
                    }
                    match kinds.get(name) {
                        Some(known) if known != body => {
                            let known = self.bodies[*known].span;
                            let mut error = Diagnostic::error(
                                "E0203",
                                *span,
                                format!("two models are called `{name}`"),
                            )
                            .says("one comes from this import")
                            .label(known, "another is declared here");
                            error = error.label(self.bodies[*body].span, "the imported one");
                            d.push(error.help("rename one of them"));
                        }
                        _ => {
                            kinds.insert(name.clone(), *body);
                        }
                    }
                }
            }
            self.kinds.push(kinds);
        }
    }

    /// Carries out the statements of a frame.
    fn expand_frame(&mut self, d: &mut Vec<Diagnostic>) {
        let (body, outer, span, arguments) = {
            let frame = self.frame();
            (frame.body, frame.outer, frame.span, frame.arguments)
        };
        let (statements, header) = (self.bodies[body].statements, self.bodies[body].header);
        let file = header.is_none();
        // What the instance was given, by name.
        let mut given: Vec<(&'a str, &'a Argument, &'a Syntax)> = vec![];
        for argument in arguments {
            let Argument { label: Some(label), value: Value::Expr(value), .. } = argument else {
                d.push(self.argument_form(argument, body));
                continue;
            };
            if label.derivative {
                d.push(self.argument_form(argument, body));
                continue;
            }
            let name = label.name.text.as_str();
            if let Some((_, first, _)) = given.iter().find(|(known, ..)| *known == name) {
                d.push(
                    Diagnostic::error("E0234", argument.span, format!("`{name}` is given twice"))
                        .says("given again here")
                        .label(first.span, "first given here"),
                );
                continue;
            }
            given.push((name, argument, value));
        }
        let mut used = vec![false; given.len()];
        let take = |name: &str, used: &mut [bool]| {
            let at = given.iter().position(|(known, ..)| *known == name)?;
            used[at] = true;
            Some(given[at].2)
        };
        self.clock += 1;
        for parameter in header.unwrap_or(&[]) {
            let name = &parameter.name;
            let value = match (take(&name.text, &mut used), &parameter.default) {
                (Some(value), _) => outer.map(|here| (value, here)),
                (None, Some(default)) => Some((default, self.here)),
                // A model that is looked at without an instance.
                (None, None) if outer.is_none() => None,
                (None, None) => {
                    d.push(
                        Diagnostic::error(
                            "E0235",
                            span,
                            format!(
                                "the parameter `{}` of the model `{}` is not given",
                                name.text, self.bodies[body].name
                            ),
                        )
                        .says("an instance without it")
                        .label(name.span, "it has no default")
                        .help(format!("give it in the brackets: `{} = …`", name.text)),
                    );
                    None
                }
            };
            let description = parameter.description.as_ref().map_or("", |text| text.text.as_str());
            self.declare_parameter(Cow::Borrowed(&name.text), name.span, value, description, d);
            self.frame_mut().public.insert(Cow::Borrowed(&name.text));
        }
        for statement in statements {
            if let StatementKind::Parameter { name, value, description } = &statement.kind {
                self.clock += 1;
                let from_outside = if file { take(&name.text, &mut used) } else { None };
                let value = match (from_outside, outer) {
                    (Some(value), Some(outer)) => (value, outer),
                    _ => (value, self.here),
                };
                let description = description.as_ref().map_or("", |text| text.text.as_str());
                if let Some(key) = self.full_key(name, d) {
                    if file {
                        self.frame_mut().public.insert(key.clone());
                    }
                    self.declare_parameter(key, name.span, Some(value), description, d);
                }
            }
        }
        let inputs: Vec<(&'a str, &'a Syntax)> =
            given.iter().map(|(name, _, value)| (*name, *value)).collect();
        let inputs = Inputs { given: &inputs, outer };
        self.expand(statements, &inputs, true, d);
        for (k, (name, argument, _)) in given.iter().enumerate() {
            let input = matches!(self.value(name), Some(Meaning::Signal(id))
                if self.graph.signals[id.index()].origin == SignalOrigin::Input);
            if !used[k] && !input && !self.excused(name) {
                d.push(self.unknown_argument(name, argument, body));
            }
        }
    }

    fn argument_form(&self, argument: &Argument, body: usize) -> Diagnostic {
        let model = &self.bodies[body].name;
        Diagnostic::error("E0234", argument.span, "an instance takes its arguments by their names")
            .says("not of the form `name = value`")
            .help(format!("write which parameter or input of `{model}` it is: `… = …`"))
    }

    fn unknown_argument(&self, name: &str, argument: &Argument, body: usize) -> Diagnostic {
        let body = &self.bodies[body];
        let span = argument.label.as_ref().map_or(argument.span, |label| label.name.span);
        let error = Diagnostic::error(
            "E0234",
            span,
            format!("the model `{}` has no parameter or input `{name}`", body.name),
        )
        .says("not one of its parameters or inputs")
        .label(body.span, "the model");
        if let Some(Meaning::Parameter(id)) = self.value(name) {
            let declared = self.graph.parameters[id.index()].span;
            let message = format!("`{name}` is a private parameter of the model `{}`", body.name);
            return Diagnostic::error("E0234", span, message)
                .says("not the instance's to give")
                .label(declared, "declared here")
                .help("parameters that instances may set stand in the brackets after the model's name");
        }
        let frame = self.frame();
        let mut names: Vec<&str> = frame.public.iter().map(|name| name.as_ref()).collect();
        names.extend(frame.values.iter().filter_map(|(name, meaning)| match meaning {
            Meaning::Signal(id) if self.graph.signals[id.index()].origin == SignalOrigin::Input => {
                Some(name.as_ref())
            }
            _ => None,
        }));
        names.sort_unstable();
        match nearest(name, names.iter().copied()) {
            Some(meant) => did_you_mean(error, span, name, meant),
            None if names.is_empty() => error.because("it has none"),
            None => error.because(format!("it has {}", list(&names))),
        }
    }

    /// Carries out statements, those in loops and conditions as often as these say.
    fn expand(
        &mut self,
        statements: &'a [Statement],
        inputs: &Inputs<'_, 'a>,
        top: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        for item in statements {
            self.clock += 1;
            if self.too_many(item.span, d) {
                return;
            }
            let statement = self.clock;
            let here = self.here;
            let valued = |value| Valued { value, statement, here };
            match &item.kind {
                StatementKind::Chain(chain) => {
                    self.chains.push((chain, here));
                    let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, l)| l));
                    ends.for_each(|end| self.declare(end, statement, d));
                }
                StatementKind::Parameter { name, value, description } if !top => {
                    let description = description.as_ref().map_or("", |text| text.text.as_str());
                    if self.made_anew(name, d)
                        && let Some(key) = self.full_key(name, d)
                    {
                        let value = Some((value, here));
                        self.declare_parameter(key, name.span, value, description, d);
                    }
                }
                // Declared before all else.
                StatementKind::Parameter { .. } => {}
                StatementKind::Signal { name, value } => {
                    self.declare_signal(name, SignalOrigin::Signal, Some(valued(value)), d);
                }
                StatementKind::Input(names) => {
                    for name in names {
                        let given = inputs.given.iter().find(|(known, _)| *known == name.text);
                        let value = given.zip(inputs.outer).map(|((_, value), here)| Valued {
                            value,
                            statement,
                            here,
                        });
                        self.declare_signal(name, SignalOrigin::Input, value, d);
                    }
                }
                StatementKind::Output(names) => {
                    for name in names {
                        self.outputs.push((name, here));
                        if let Some(key) = self.full_key(name, d) {
                            self.frame_mut().public.insert(key);
                        }
                    }
                }
                StatementKind::Drive { name, value } => self.drives.push((name, valued(value))),
                StatementKind::Port(port) => self.declare_port(port, item.span, d),
                StatementKind::For { variable, range, body } => {
                    self.expand_loop(variable, range, body, inputs, item.span, d);
                }
                StatementKind::If { condition, then, otherwise } => {
                    match self.number(condition, "a condition", d) {
                        Some(value) => {
                            let body = if value != 0.0 { then } else { otherwise };
                            self.expand(body, inputs, false, d);
                        }
                        None => self.excuse(item.span),
                    }
                }
                StatementKind::Loop(regulator) => self.regulators.push((regulator, here)),
                StatementKind::Model(_) | StatementKind::Import(_) if top && self.is_file() => {}
                StatementKind::Simulate { until, step } if top && self.is_file() => {
                    if here == Here::ROOT {
                        self.simulate.push((until, step, item.span));
                    }
                }
                StatementKind::Options(options) if top && self.is_file() => {
                    if here == Here::ROOT {
                        self.options.extend(options);
                    }
                }
                StatementKind::Observe(items) if top && self.is_file() => {
                    if here == Here::ROOT {
                        self.observe.extend(items);
                    }
                }
                StatementKind::Model(_)
                | StatementKind::Import(_)
                | StatementKind::Simulate { .. }
                | StatementKind::Options(_)
                | StatementKind::Observe(_) => {
                    let text = self.map.text(item.span);
                    let word = text.split(|c: char| !c.is_alphabetic()).next().unwrap_or("");
                    let place = if self.is_file() { "a loop or condition" } else { "a model" };
                    d.push(
                        Diagnostic::error(
                            "E0236",
                            Span { end: item.span.start + word.len() as u32, ..item.span },
                            format!("`{word}` cannot stand in {place}"),
                        )
                        .says("belongs to a file as a whole")
                        .help("write it outside the braces"),
                    );
                }
                StatementKind::Unreadable => self.excuse(item.span),
            }
        }
    }

    /// Whether the frame is a file, run itself or used as a model.
    fn is_file(&self) -> bool {
        self.bodies[self.frame().body].header.is_none()
    }

    /// Whether there is more than any model needs; said once.
    fn too_many(&mut self, span: Span, d: &mut Vec<Diagnostic>) -> bool {
        let parts = self.graph.vertices.len()
            + self.graph.signals.len()
            + self.parameters.len()
            + self.frames.len()
            + self.rounds.len();
        if d.len() > MOST_SAID {
            // Nobody reads on, and there will be no graph.
            return true;
        }
        if parts <= MOST_PARTS && self.clock <= 4 * MOST_PARTS {
            return false;
        }
        too_large(span, d);
        true
    }

    /// What a text that was not carried out would have made is not missing for another reason.
    fn excuse(&mut self, span: Span) {
        let parts = self.map.text(span).split(|c: char| !(c.is_alphanumeric() || c == '_'));
        self.frame_mut().excused.extend(parts.filter(|part| !part.is_empty()));
    }

    fn expand_loop(
        &mut self,
        variable: &'a Name,
        range: &'a (Syntax, Syntax),
        body: &'a [Statement],
        inputs: &Inputs<'_, 'a>,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) {
        let from = self.integer(&range.0, "a bound of a loop", d);
        let to = self.integer(&range.1, "a bound of a loop", d);
        let (Some(from), Some(to)) = (from, to) else {
            return self.excuse(span);
        };
        if to.saturating_sub(from) > MOST_PARTS as i64 {
            // No need to try.
            too_large(span, d);
            return self.excuse(span);
        }
        let before = self.here;
        let name: std::rc::Rc<str> = variable.text.as_str().into();
        for value in from..=to {
            let known = d.len();
            self.here.round = Some(self.rounds.len() as u32);
            self.rounds.push(Round { name: name.clone(), value, outer: before.round });
            self.expand(body, inputs, false, d);
            self.here = before;
            // What is wrong once is wrong each time.
            if d[known..].iter().any(|d| d.severity == crate::diagnostic::Severity::Error) {
                return;
            }
        }
    }

    /// Whether a name that is declared in a loop is another one each time; else an error.
    fn made_anew(&mut self, name: &'a Part, d: &mut Vec<Diagnostic>) -> bool {
        let Some(round) = self.here.round.and_then(|at| self.rounds.get(at as usize)) else {
            return true;
        };
        if !name.indices.is_empty() {
            return true;
        }
        let indexed = format!("{}[{}]", name.text, round.name);
        self.frame_mut().excused.insert(&name.text);
        d.push(
            Diagnostic::error(
                "E0238",
                name.span,
                format!("`{}` would be declared again in each round of the loop", name.text),
            )
            .says("a name without an index")
            .help(format!(
                "write `{indexed}` for one in each round, or declare it outside the loop"
            )),
        );
        false
    }

    fn declare(&mut self, end: &'a ChainEnd, statement: usize, d: &mut Vec<Diagnostic>) {
        let Some(kind) = &end.kind else {
            if let Some(arguments) = &end.arguments {
                let name = end.path.text();
                let at = arguments.first().map_or(end.span, |argument| argument.span);
                d.push(
                    Diagnostic::error("E0209", at, format!("`{name}` has arguments but no kind"))
                        .label(end.path.span, "no kind before this name")
                        .help(format!(
                            "arguments belong where the element is declared, as in `R:{name}(…)`"
                        )),
                );
            }
            return;
        };
        let name = &end.path.name;
        let row = element(&kind.text);
        let file = self.bodies[self.frame().body].file;
        let model = self.kinds[file].get(&kind.text).copied();
        if row.is_none() && model.is_none() {
            self.frame_mut().excused.insert(&name.text);
            d.push(self.unknown_kind(kind, file));
            return;
        }
        if let Some(member) = end.path.members.first() {
            d.push(
                Diagnostic::error(
                    "E0204",
                    member.span,
                    "a port cannot be named where its element is declared",
                )
                .help(format!(
                    "declare `{}:{}` in a statement of its own, then write `{}`",
                    kind.text,
                    name.text,
                    end.path.text()
                )),
            );
        }
        if !self.made_anew(name, d) {
            return;
        }
        let Some(key) = self.full_key(name, d) else {
            self.frame_mut().excused.insert(&name.text);
            return;
        };
        if !self.is_free(&key, kind, end, d) {
            return;
        }
        let full = format!("{}{key}", self.frame().prefix);
        if let (None, Some(body)) = (row, model) {
            return self.declare_instance(body, key, full, end, d);
        }
        let Some(row) = row else { return };
        let id = VertexId(self.graph.vertices.len() as u32);
        self.frame_mut().things.insert(key, Thing::Vertex(id));
        self.graph.vertices.push(Vertex {
            name: full,
            kind: row.kind,
            law: Law::One,
            span: kind.span.join(name.span),
            bonds: vec![],
        });
        self.declarations.push(Declaration {
            element: row,
            arguments: end.arguments.as_deref(),
            name,
            span: end.span,
            statement,
            here: self.here,
        });
    }

    /// Whether a name of the space of elements is still to be had; else an error.
    fn is_free(&mut self, key: &str, kind: &Name, end: &ChainEnd, d: &mut Vec<Diagnostic>) -> bool {
        let Some(first) = self.frame().things.get(key).copied() else { return true };
        let span = self.thing_span(first);
        let same = match first {
            Thing::Vertex(id) => self.declarations[id.index()].element.kind == kind.text,
            Thing::Instance(frame) => {
                self.bodies[self.frames[frame.0 as usize].body].name == kind.text
            }
            Thing::Port(_) => false,
        };
        let again = same && end.arguments.is_none();
        let message = match again {
            true => format!("`{key}` is declared twice"),
            false => format!("two elements are called `{key}`"),
        };
        let error = Diagnostic::error("E0203", end.span, message)
            .says("declared again here")
            .label(span, "first declared here");
        d.push(if again {
            error.help("write the name alone to speak of the same element").fix(
                "leave out the kind",
                vec![(end.span, self.map.text(end.path.span).to_string())],
            )
        } else {
            error.help(
                "give one of them another name; where one was meant, its kind and value stand once",
            )
        });
        false
    }

    fn declare_instance(
        &mut self,
        body: usize,
        key: Cow<'a, str>,
        full: String,
        end: &'a ChainEnd,
        d: &mut Vec<Diagnostic>,
    ) {
        // The models that the instance would stand in.
        let mut chain = vec![];
        let mut next = Some(self.here.frame);
        while let Some(frame) = next {
            let frame = &self.frames[frame.0 as usize];
            chain.push(frame.body);
            next = frame.outer.map(|here| here.frame);
        }
        if let Some(at) = chain.iter().position(|outer| *outer == body) {
            let names: Vec<String> = chain[..=at]
                .iter()
                .rev()
                .chain([&body])
                .map(|body| format!("`{}`", self.bodies[*body].name))
                .collect();
            self.frame_mut().excused.insert(&end.path.name.text);
            d.push(
                Diagnostic::error(
                    "E0239",
                    end.span,
                    format!("the model `{}` contains itself", self.bodies[body].name),
                )
                .says("an instance of it within itself")
                .because(format!("the chain is {}", names.join(" → ")))
                .label(self.bodies[body].span, "the model"),
            );
            return;
        }
        let id = FrameId(self.frames.len() as u32);
        let arguments = end.arguments.as_deref().unwrap_or(&[]);
        if self.here.frame == Here::ROOT.frame {
            self.graph.instances.insert(full.clone(), end.span);
        }
        self.frame_mut().things.insert(key, Thing::Instance(id));
        let prefix = format!("{full}.");
        self.frames.push(frame(body, prefix, Some(self.here), end.span, arguments));
    }

    fn declare_parameter(
        &mut self,
        key: Cow<'a, str>,
        span: Span,
        value: Option<(&'a Syntax, Here)>,
        description: &str,
        d: &mut Vec<Diagnostic>,
    ) {
        let id = ParameterId(self.graph.parameters.len() as u32);
        if !self.declare_value(key.clone(), span, Meaning::Parameter(id), d) {
            return;
        }
        let name = format!("{}{key}", self.frame().prefix);
        let mut value = value.map(|(value, here)| Valued { value, statement: self.clock, here });
        let settable = self.here.frame == Here::ROOT.frame
            || self.frame().public.contains(&key)
            || self.bodies[self.frame().body]
                .header
                .is_some_and(|header| header.iter().any(|parameter| parameter.name.text == key));
        let declared = value;
        for setting in self.set.iter_mut().filter(|setting| settable && setting.name == name) {
            setting.taken = Some(id);
            setting.declared = declared;
            if let Some(set) = setting.value {
                value = Some(Valued { value: set, statement: self.clock, here: Here::ROOT });
            }
        }
        self.graph.parameters.push(Parameter {
            name,
            expr: Tree::number(f64::NAN),
            value: f64::NAN,
            unit: None,
            description: description.to_string(),
            span,
        });
        self.parameters.push(value);
        self.marks.push(Mark::Untouched);
        self.evaluated.push(false);
    }

    fn declare_signal(
        &mut self,
        name: &'a Part,
        origin: SignalOrigin,
        valued: Option<Valued<'a>>,
        d: &mut Vec<Diagnostic>,
    ) {
        if !self.made_anew(name, d) {
            return;
        }
        let Some(key) = self.full_key(name, d) else {
            self.frame_mut().excused.insert(&name.text);
            return;
        };
        let id = SignalId(self.graph.signals.len() as u32);
        let full = format!("{}{key}", self.frame().prefix);
        if !self.declare_value(key, name.span, Meaning::Signal(id), d) {
            return;
        }
        self.graph.signals.push(Signal {
            name: full,
            law: SignalLaw::Algebraic(Tree::number(0.0)),
            origin,
            span: name.span,
            unit: None,
            home: valued.map_or(self.here, |valued| valued.here).frame.0,
        });
        self.signals.push(valued);
        self.signal_order.push((self.clock, usize::MAX));
    }

    /// Takes a name into the space of values, unless it is taken or reserved.
    fn declare_value(
        &mut self,
        key: Cow<'a, str>,
        span: Span,
        meaning: Meaning,
        d: &mut Vec<Diagnostic>,
    ) -> bool {
        if let Some(reserved) = RESERVED.iter().find(|reserved| **reserved == key) {
            self.frame_mut().excused.insert(reserved);
            let means = match *reserved {
                "time" => "the time",
                "pi" => "the number π",
                _ => "an element's own variable",
            };
            d.push(
                Diagnostic::error(
                    "E0205",
                    span,
                    format!("`{key}` cannot name a parameter or a signal"),
                )
                .says(format!("in a law this is {means}"))
                .help("choose another name"),
            );
            return false;
        }
        if let Some(first) = self.value(&key) {
            let first = self.value_span(first);
            d.push(
                Diagnostic::error("E0203", span, format!("`{key}` is declared twice"))
                    .says("declared again here")
                    .label(first, "first declared here")
                    .because("parameters, signals and inputs share one space of names"),
            );
            return false;
        }
        self.frame_mut().values.insert(key, meaning);
        true
    }

    fn unknown_kind(&self, kind: &Name, file: usize) -> Diagnostic {
        let text = kind.text.as_str();
        let error =
            Diagnostic::error("E0204", kind.span, format!("`{text}` is no kind of element"))
                .says("unknown kind");
        let mut models: Vec<&str> = self.kinds[file].keys().map(String::as_str).collect();
        models.sort_unstable();
        let kinds = ELEMENTS.iter().map(|row| row.kind);
        match nearest(text, kinds.clone().chain(models.iter().copied())) {
            Some(meant) => did_you_mean(error, kind.span, text, meant),
            None => {
                let error =
                    error.because(format!("the kinds are {}", kinds.collect::<Vec<_>>().join(" ")));
                match models.as_slice() {
                    [] => error.help(format!(
                        "a kind of your own is a model: `model {text}(…) {{ … }}`, here or in a file that is imported"
                    )),
                    models => error.because(format!("the models are {}", list(models))),
                }
            }
        }
    }
}

/// What an instance was given, and where that is looked up.
struct Inputs<'i, 'a> {
    given: &'i [(&'a str, &'a Syntax)],
    outer: Option<Here>,
}

fn frame<'a>(
    body: usize,
    prefix: String,
    outer: Option<Here>,
    span: Span,
    arguments: &'a [Argument],
) -> Frame<'a> {
    Frame {
        prefix,
        body,
        outer,
        span,
        arguments,
        things: HashMap::new(),
        values: HashMap::new(),
        excused: HashSet::new(),
        ports: vec![],
        public: HashSet::new(),
    }
}

/// Names in quotes, separated by commas.
pub(super) fn list(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Whether the statements of a file outside its models make a model.
fn is_model(statements: &[Statement]) -> bool {
    statements.iter().any(|statement| {
        !matches!(statement.kind, StatementKind::Import(_) | StatementKind::Model(_))
    })
}

/// The name of a file without folders and ending.
fn stem(map: &SourceMap, file: crate::source::FileId) -> String {
    let name = map.file(file).map_or("", |file| file.name.as_str());
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let stem = last.strip_suffix(".bg").unwrap_or(last);
    stem.trim_matches(['<', '>']).to_string()
}

/// Says once that there is more than any model needs.
fn too_large(span: Span, d: &mut Vec<Diagnostic>) {
    if !d.iter().any(|d| d.code == "E0237") {
        d.push(
            Diagnostic::error("E0237", span, "the graph is too large")
                .says("here it grows beyond the limit")
                .because(format!(
                    "at most {MOST_PARTS} elements, signals, parameters and instances"
                )),
        );
    }
}
