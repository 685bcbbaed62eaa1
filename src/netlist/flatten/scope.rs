//! Scopes: the top of a netlist, and each instance of a subcircuit.

use crate::circuit::{DeviceId, NodeId};
use crate::diagnostic::Diagnostic;
use crate::netlist::parts::every_leaf;
use crate::netlist::{Card, Draw, Expr, Leaf, Name, Names, Operator, Subcircuit};
use crate::quantity::{nearest, random};
use crate::source::Span;
use rustc_hash::FxHashMap;

/// A table by names. Never walked, so that no order of a hash shows.
pub type Table<V> = FxHashMap<Name, V>;

/// Nodes or devices by names: at the top, where a big netlist has most of its names, at their numbers, elsewhere hashed.
pub enum Numbers {
    /// The number of each name; `u32::MAX` where it has none.
    Dense(Vec<u32>),
    /// By name.
    Sparse(Table<u32>),
}

impl Default for Numbers {
    fn default() -> Numbers {
        Numbers::Sparse(Table::default())
    }
}

impl Numbers {
    const NONE: u32 = u32::MAX;

    /// Room for every name below a number.
    pub fn dense(names: usize) -> Numbers {
        Numbers::Dense(vec![Numbers::NONE; names])
    }

    /// The number of a name.
    pub fn get(&self, name: Name) -> Option<u32> {
        match self {
            Numbers::Dense(all) => {
                all.get(name.0 as usize).copied().filter(|number| *number != Numbers::NONE)
            }
            Numbers::Sparse(table) => table.get(&name).copied(),
        }
    }

    /// Gives a name a number; says which it had before.
    pub fn insert(&mut self, name: Name, number: u32) -> Option<u32> {
        match self {
            Numbers::Dense(all) => {
                let known = self::slot(all, name.0 as usize);
                let before = std::mem::replace(known, number);
                (before != Numbers::NONE).then_some(before)
            }
            Numbers::Sparse(table) => table.insert(name, number),
        }
    }
}

/// The place of an index in a list that grows as far as it is asked for.
fn slot(all: &mut Vec<u32>, index: usize) -> &mut u32 {
    if index >= all.len() {
        all.resize(index + 1, Numbers::NONE);
    }
    &mut all[index]
}

/// Index of a scope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScopeId(pub u32);

/// A model: its card, its type, its parameters.
pub type Model<'n> = (&'n Card, &'n str, &'n [(String, Expr)]);

/// A scope.
#[derive(Default)]
pub struct Scope<'n> {
    /// `x1.x2.`, or nothing at the top.
    pub path: String,
    /// The scope that its definition stands in.
    pub parent: Option<ScopeId>,
    /// Parameters as numbers.
    pub parameters: Table<f64>,
    /// Those that change during the run: they stand in laws as they are written.
    pub varying: Table<()>,
    /// Both as they are written, and the scope whose words they use.
    pub written: Table<(ScopeId, &'n Expr)>,
    /// Nodes.
    pub nodes: Numbers,
    /// Devices; of a K with several pairs the first.
    pub devices: Numbers,
    /// Models.
    pub models: Table<Model<'n>>,
    /// Definitions.
    pub subcircuits: Table<&'n Subcircuit>,
}

/// All scopes, the top first.
#[derive(Default)]
pub struct Scopes<'n> {
    /// By [`ScopeId`].
    pub all: Vec<Scope<'n>>,
    /// Nodes that are one in every scope.
    pub globals: Table<()>,
    /// The temperature of the circuit, in °C.
    pub temperature: f64,
    /// Where random values come from: that of the netlist and its step.
    pub seed: u64,
}

/// The temperature where nothing is said, in °C.
pub const NOMINAL: f64 = 27.0;

/// The top of the netlist.
pub const TOP: ScopeId = ScopeId(0);

impl Scope<'_> {
    /// The node of a name.
    pub fn node(&self, name: Name) -> Option<NodeId> {
        self.nodes.get(name).map(NodeId)
    }

    /// The device of a name.
    pub fn device(&self, name: Name) -> Option<DeviceId> {
        self.devices.get(name).map(DeviceId)
    }
}

impl<'n> Scopes<'n> {
    /// The scope of an index.
    pub fn get(&self, id: ScopeId) -> &Scope<'n> {
        &self.all[id.0 as usize]
    }

    /// The scope of an index, to write to.
    pub fn get_mut(&mut self, id: ScopeId) -> &mut Scope<'n> {
        &mut self.all[id.0 as usize]
    }

    /// A scope and those around it.
    pub fn around(&self, id: ScopeId) -> impl Iterator<Item = (ScopeId, &Scope<'n>)> {
        std::iter::successors(Some(id), |id| self.get(*id).parent).map(|id| (id, self.get(id)))
    }

    /// The scope of a parameter that changes during the run, where a name is one.
    pub fn varying(&self, id: ScopeId, name: Name) -> Option<ScopeId> {
        let known = |(_, scope): &(ScopeId, &Scope)| {
            scope.varying.contains_key(&name) || scope.parameters.contains_key(&name)
        };
        let (place, scope) = self.around(id).find(known)?;
        scope.varying.contains_key(&name).then_some(place)
    }

    /// The value of a parameter, here or around.
    pub fn parameter(&self, id: ScopeId, name: Name) -> Option<f64> {
        self.around(id).find_map(|(_, scope)| scope.parameters.get(&name).copied())
    }

    /// The value of a parameter, here or around, or of a constant that needs no `.param`.
    pub fn value(&self, id: ScopeId, name: Name, names: &Names) -> Option<f64> {
        self.parameter(id, name).or_else(|| match names.text(name) {
            text if ["temper", "temp"].iter().any(|own| text.eq_ignore_ascii_case(own)) => {
                Some(self.temperature)
            }
            text if text.eq_ignore_ascii_case("vt") => Some(thermal_voltage(self.temperature)),
            text => constant(text),
        })
    }
}

/// kT/q in V at a temperature in °C, with the constants of SPICE.
pub fn thermal_voltage(celsius: f64) -> f64 {
    1.380_622_6e-23 / 1.602_191_8e-19 * (celsius + 273.15)
}

/// Whether an expression changes during the run: it speaks of time, a voltage or a current, itself or through a parameter.
pub fn varies(scopes: &Scopes, id: ScopeId, expr: &Expr) -> bool {
    let mut found = false;
    expr.leaves(&mut |leaf, _| {
        found |= match leaf {
            Leaf::Parameter(name) => scopes.varying(id, *name).is_some(),
            Leaf::Operator(Operator::Draw(..), _) => false,
            _ => true,
        }
    });
    found
}

/// Constants that need no `.param`.
pub fn constant(name: &str) -> Option<f64> {
    match name.to_ascii_lowercase().as_str() {
        "pi" => Some(std::f64::consts::PI),
        // Xyce's; as functions of one argument are called, nothing else is hidden.
        "exp" => Some(std::f64::consts::E),
        "ctok" => Some(273.15),
        "temper" => Some(NOMINAL),
        _ => None,
    }
}

/// Parameters of one scope: names and expressions, in their order; the last of a name counts. Each may use any other
/// of them, whatever the order, and those of the scopes around.
pub fn parameters(
    scopes: &mut Scopes,
    id: ScopeId,
    given: &[(Name, &Expr)],
    names: &Names,
    d: &mut Vec<Diagnostic>,
) {
    let mut wanted: Table<&Expr> = Table::default();
    for (name, expr) in given {
        wanted.insert(*name, expr);
    }
    let mut failed: Table<()> = Table::default();
    for (name, _) in given {
        // A stack of its own, since chains may be long.
        let mut chain = vec![*name];
        let mut open: Table<usize> = Table::default();
        open.insert(*name, 0);
        while let Some(top) = chain.last().copied() {
            let known = |name: &Name| {
                let own = scopes.get(id);
                own.parameters.contains_key(name)
                    || own.varying.contains_key(name)
                    || failed.contains_key(name)
            };
            let Some(expr) = wanted.get(&top).filter(|_| !known(&top)) else {
                chain.pop();
                open.remove(&top);
                continue;
            };
            let mut next = None;
            every_leaf(expr, &mut |leaf, span| {
                if let Leaf::Parameter(used) = leaf
                    && next.is_none()
                    && wanted.contains_key(used)
                    && !known(used)
                {
                    next = Some((*used, span));
                }
            });
            match next {
                Some((used, span)) => match open.get(&used).copied() {
                    Some(start) => {
                        let round: Vec<_> = chain[start..]
                            .iter()
                            .chain([&used])
                            .map(|name| names.text(*name))
                            .collect();
                        d.push(
                            Diagnostic::error("E0731", span, "parameters that define each other")
                                .because(format!("{}: each uses the next", round.join(" → "))),
                        );
                        for name in &chain {
                            failed.insert(*name, ());
                        }
                    }
                    None => {
                        open.insert(used, chain.len());
                        chain.push(used);
                    }
                },
                None if !failed_within(expr, &failed) && varies(scopes, id, expr) => {
                    scopes.get_mut(id).varying.insert(top, ());
                    chain.pop();
                }
                None => {
                    let value = if failed_within(expr, &failed) {
                        None
                    } else {
                        number(scopes, id, expr, names, d)
                    };
                    match value {
                        Some(value) => {
                            scopes.get_mut(id).parameters.insert(top, value);
                        }
                        None => {
                            failed.insert(top, ());
                        }
                    }
                    chain.pop();
                    open.remove(&top);
                }
            }
        }
    }
    // What failed has been reported; its users need no report of their own.
    for (name, _) in given {
        let own = scopes.get_mut(id);
        if !own.varying.contains_key(name) {
            own.parameters.entry(*name).or_insert(f64::NAN);
        }
    }
}

fn failed_within(expr: &Expr, failed: &Table<()>) -> bool {
    let mut found = false;
    every_leaf(expr, &mut |leaf, _| {
        if let Leaf::Parameter(name) = leaf {
            found |= failed.contains_key(name);
        }
    });
    found
}

/// The value of an expression of parameters.
pub fn number(
    scopes: &Scopes,
    id: ScopeId,
    expr: &Expr,
    names: &Names,
    d: &mut Vec<Diagnostic>,
) -> Option<f64> {
    if let Some(value) = expr.as_number() {
        return Some(value);
    }
    let (mut wrong, look) = (None, super::values::near(d));
    expr.leaves(&mut |leaf, span| {
        let error = match leaf {
            Leaf::Parameter(name) if scopes.varying(id, *name).is_some() => {
                let text = names.text(*name);
                Some(
                    Diagnostic::error("E0732", span, "this value must be a number")
                        .says(format!("`{text}` changes during the run")),
                )
            }
            Leaf::Parameter(name) => {
                let known = scopes.value(id, *name, names).is_some();
                (!known).then(|| unknown_parameter(scopes, id, *name, span, names, look))
            }
            Leaf::Operator(Operator::Draw(..), _) => None,
            _ => Some(
                Diagnostic::error("E0732", span, "this value must be a number")
                    .says("it changes during the run")
                    .help(
                        "what follows a voltage, a current or time is a B source: V={…} or I={…}",
                    ),
            ),
        };
        if wrong.is_none() {
            wrong = error;
        }
    });
    if let Some(error) = wrong {
        d.push(error);
        return None;
    }
    Some(expr.evaluate(&mut |leaf| match leaf {
        Leaf::Parameter(name) => scopes.value(id, *name, names).unwrap_or(f64::NAN),
        Leaf::Operator(Operator::Draw(draw, place), _) => self::draw(scopes, id, *draw, *place),
        _ => f64::NAN,
    }))
}

/// The random number of a place in a scope.
pub fn draw(scopes: &Scopes, id: ScopeId, draw: Draw, place: u32) -> f64 {
    let seed = random::below(scopes.seed, &scopes.get(id).path.to_lowercase());
    match draw {
        Draw::Normal => random::normal(seed, u64::from(place)),
        Draw::Uniform => 2.0 * random::fraction(seed, u64::from(place)) - 1.0,
        Draw::Sign if random::fraction(seed, u64::from(place)) < 0.5 => -1.0,
        Draw::Sign => 1.0,
    }
}

/// The error for a parameter that nobody defines.
pub fn unknown_parameter(
    scopes: &Scopes,
    id: ScopeId,
    name: Name,
    span: Span,
    names: &Names,
    look: usize,
) -> Diagnostic {
    let text = names.text(name);
    let known = (0..names.len().min(look) as u32)
        .map(Name)
        .filter(|name| scopes.parameter(id, *name).is_some())
        .map(|name| names.text(name));
    let error = Diagnostic::error("E0733", span, format!("unknown parameter `{text}`"));
    match nearest(text, known) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error.help(format!("define it: .param {text}=…")),
    }
}
