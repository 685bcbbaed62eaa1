//! The map as JSON, in the spelling of the dialect that its netlist is written in, and back.

use super::{Figures, Map, MapCard, Variable};
use crate::expr::Node;
use crate::netlist::dialects::{self, NGSPICE};
use crate::netlist::read::expression::expression;
use crate::netlist::{Expr, Leaf, Name, Names, write};
use crate::quantity::Domain;
use crate::source::FileId;
use serde_json::Value;

impl Map {
    /// The map as JSON, schema 1.
    pub fn json(&self, names: &Names) -> Value {
        // A result holds no parameters: they stand here as numbers.
        let value = |expr: &Expr| {
            expr.map(&mut |leaf, span| match leaf {
                Leaf::Parameter(name) => match self.parameters.iter().find(|(p, _)| p == name) {
                    Some((_, value)) => Expr::new(Node::Number(*value), span),
                    None => Expr::leaf(leaf.clone()),
                },
                leaf => Expr::leaf(leaf.clone()),
            })
        };
        let variables: Vec<_> = self
            .variables
            .iter()
            .filter_map(|variable| Some((variable, variable.expr.as_ref()?)))
            .map(|(variable, expr)| {
                serde_json::json!({
                    "bg": variable.bg,
                    "expr": write::expression_in(self.dialect, names, &value(expr)),
                    "factor": variable.factor,
                    "unit": variable.unit,
                    "domain": variable.domain.name(),
                    "observed": variable.observed,
                })
            })
            .collect();
        let path = |name: &str| name.replace('.', self.dialect.separator);
        let cards: Vec<_> = self
            .cards
            .iter()
            .map(|card| {
                serde_json::json!({
                    "card": path(&card.card),
                    "element": card.element,
                    "bond": card.bond,
                    "line": card.line,
                })
            })
            .collect();
        let renamed: Vec<_> = self
            .renamed
            .iter()
            .map(|name| serde_json::json!({ "from": name.from, "to": path(&name.to) }))
            .collect();
        let Figures { nodes, devices, helpers } = self.figures;
        let scale: serde_json::Map<String, Value> = self
            .scales
            .iter()
            .map(|(domain, factor)| (domain.name().to_string(), (*factor).into()))
            .collect();
        serde_json::json!({
            "schema": 1,
            "dialect": self.dialect.name,
            "scale": scale,
            "variables": variables,
            "cards": cards,
            "renamed": renamed,
            "figures": { "nodes": nodes, "devices": devices, "helpers": helpers },
        })
    }

    /// A map from its JSON, its expressions in the names given, with `.` in paths whatever the dialect.
    ///
    /// # Errors
    /// Why it is none.
    pub fn from_json(json: &Value, names: &mut Names) -> Result<Map, String> {
        let said = json.get("dialect").and_then(Value::as_str);
        let dialect = said.map_or(Some(&NGSPICE), dialects::find);
        let dialect = dialect.ok_or_else(|| {
            format!("its dialect is `{}`, which I do not know", said.unwrap_or_default())
        })?;
        let list = |key: &str| json.get(key).and_then(Value::as_array).map(Vec::as_slice);
        let variables = list("variables").ok_or("it has no list of `variables`")?.iter();
        let variables = variables.map(|variable| {
            let bg = text(variable, "bg").ok_or("a variable of it has no name `bg`")?;
            let expr = match text(variable, "expr") {
                Some(text) => {
                    let text = text.replace(['\n', '\r'], " ");
                    let file = FileId(u32::MAX);
                    let read = expression(&text, names, dialect, file, 0, &mut vec![]);
                    let read = read.ok_or(format!("`{text}` of `{bg}` is no expression"))?;
                    Some(dotted(&read, names))
                }
                None => None,
            };
            Ok(Variable {
                bg,
                expr,
                factor: variable.get("factor").and_then(Value::as_f64).unwrap_or(1.0),
                unit: text(variable, "unit").unwrap_or_default(),
                domain: text(variable, "domain")
                    .and_then(|n| Domain::named(&n))
                    .unwrap_or(Domain::Any),
                observed: variable.get("observed").and_then(Value::as_bool).unwrap_or_default(),
            })
        });
        let variables = variables.collect::<Result<Vec<_>, String>>()?;
        let cards = list("cards").unwrap_or_default().iter().filter_map(|card| {
            let line = card.get("line").and_then(Value::as_u64).map(|line| line as usize);
            let name = text(card, "card")?.replace(dialect.separator, ".");
            let (element, bond) = (text(card, "element")?, text(card, "bond"));
            Some(MapCard { card: name, element, bond, line })
        });
        let cards = cards.collect();
        let figures = Figures::default();
        let (parameters, renamed, scales) = (vec![], vec![], scales(json));
        Ok(Map { dialect, variables, cards, parameters, renamed, scales, figures })
    }

    /// Without the expressions in which a number stands: it may be the value of a parameter.
    pub fn without_numbers(mut self) -> Map {
        for variable in &mut self.variables {
            variable.expr.take_if(|expr| holds_number(expr));
        }
        self
    }
}

fn text(value: &Value, key: &str) -> Option<String> {
    Some(value.get(key)?.as_str()?.to_string())
}

/// An expression whose paths have `.` between their names.
fn dotted(expr: &Expr, names: &mut Names) -> Expr {
    let mut path = |name: &Name| match names.text(*name) {
        text if text.contains(':') => {
            let text = text.replace(':', ".");
            names.intern(&text)
        }
        _ => *name,
    };
    expr.map(&mut |leaf, span| {
        let leaf = match leaf {
            Leaf::Voltage(plus, minus) => {
                let minus = minus.as_ref().map(&mut path);
                Leaf::Voltage(path(plus), minus)
            }
            Leaf::Current(device) => Leaf::Current(path(device)),
            other => other.clone(),
        };
        Expr::new(Node::Leaf(leaf), span)
    })
}

/// The scales of a map's JSON.
fn scales(json: &Value) -> Vec<(Domain, f64)> {
    let scale = json.get("scale").and_then(Value::as_object);
    let of = |(name, factor): (&String, &Value)| Some((Domain::named(name)?, factor.as_f64()?));
    scale.into_iter().flatten().filter_map(of).collect()
}

/// Whether a number stands in an expression.
fn holds_number(expr: &Expr) -> bool {
    match &*expr.node {
        Node::Number(_) | Node::Table(..) => true,
        Node::Leaf(_) => false,
        Node::Unary(_, a) => holds_number(a),
        Node::Binary(_, a, b) => holds_number(a) || holds_number(b),
        Node::Call(_, arguments) => arguments.iter().any(holds_number),
        Node::If(c, a, b) => [c, a, b].into_iter().any(holds_number),
    }
}
