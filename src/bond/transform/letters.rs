//! Where a text reads efforts, flows and what is stored: every reading with what it reads.

use super::arguments::inside;
use super::plan::{Change, Plan, Read};
use super::respell::visit;
use super::{Source, Trouble};
use crate::bond::elaborate::READINGS;
use crate::bond::graph::{BondId, VertexId};
use crate::bond::syntax::{Call, Chain, Expr, Leaf, Path, Statement, StatementKind, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::source::Span;

/// A reading in the text.
struct Reading {
    what: &'static str,
    of: Of,
    span: Span,
}

enum Of {
    Vertex(VertexId, String),
    Bonds(Vec<BondId>),
}

/// What every reading that a plan touches becomes, by its place.
///
/// # Errors
/// That one has no counterpart afterwards.
pub fn respelt(source: &Source, plan: &Plan) -> Result<Vec<(Span, String)>, Trouble> {
    let mut edits = vec![];
    let mut trouble = None;
    let gone: Vec<Span> = plan
        .gone
        .iter()
        .filter_map(|id| source.declared.get(id).map(|declared| declared.span))
        .collect();
    expressions(&source.syntax.statements, &mut |expr| {
        visit(expr, &mut |leaf, span| {
            let Leaf::Call(call) = leaf else { return true };
            let Some(reading) = reading(source, call, span) else { return true };
            // What elements that go read is of no use any more.
            if gone.iter().any(|whole| inside(span, *whole)) {
                return false;
            }
            match instead(source, plan, &reading) {
                Ok(None) => {}
                Ok(Some(text)) => {
                    // Alone it needs no brackets.
                    let bare = text.strip_prefix('(').and_then(|text| text.strip_suffix(')'));
                    let whole = expr.span == span;
                    edits.push((span, bare.filter(|_| whole).unwrap_or(&text).to_string()));
                }
                Err(error) => {
                    trouble.get_or_insert(error);
                }
            }
            false
        });
    });
    match trouble {
        Some(trouble) => Err(trouble),
        None => Ok(edits),
    }
}

/// Whether anything reads an element, junction or bond.
pub fn is_read(source: &Source, id: VertexId) -> bool {
    let mut read = false;
    expressions(&source.syntax.statements, &mut |expr| {
        visit(expr, &mut |leaf, span| {
            let Leaf::Call(call) = leaf else { return true };
            let found = reading(source, call, span);
            read |= found.is_some_and(|found| match found.of {
                Of::Vertex(vertex, _) => vertex == id,
                Of::Bonds(bonds) => bonds.iter().any(|bond| {
                    let bond = source.graph.bond(*bond);
                    bond.from.vertex == id || bond.to.vertex == id
                }),
            });
            true
        });
    });
    read
}

fn instead(source: &Source, plan: &Plan, reading: &Reading) -> Result<Option<String>, Trouble> {
    let lost = || {
        let text = source.slice(reading.span);
        let message = format!("`{text}` is read, and nothing is the same after the change");
        let error = Diagnostic::error("E1103", reading.span, message).says("read here");
        Box::new(error.help("read a neighbour that stays, or take the reading away"))
    };
    match &reading.of {
        Of::Vertex(id, name) => {
            let key = Read::Of(reading.what, name.clone());
            if let Some((_, text)) = plan.readings.iter().find(|(read, _)| *read == key) {
                return Ok(Some(text.clone()));
            }
            match plan.laws.get(id) {
                Some(Change::Scaled(scaling)) if reading.what != "power" => {
                    let spell = |new: &str| format!("{new}({name})");
                    Ok(Some(scaling.spelt(reading.what, &spell)))
                }
                Some(Change::Scaled(_)) => Ok(None),
                Some(Change::Text(..) | Change::Lumped(_)) => Err(lost()),
                None if plan.gone.contains(id) => Err(lost()),
                None => Ok(None),
            }
        }
        Of::Bonds(bonds) => {
            for bond in bonds {
                let key = Read::Bond(reading.what, *bond);
                if let Some((_, text)) = plan.readings.iter().find(|(read, _)| *read == key) {
                    return Ok(Some(text.clone()));
                }
            }
            let touched = |bond: &BondId| {
                let ends = source.graph.bond(*bond);
                plan.cut.contains(bond)
                    || plan.through.contains_key(bond)
                    || plan.ends.keys().any(|(moved, _)| moved == bond)
                    || [ends.from.vertex, ends.to.vertex]
                        .iter()
                        .any(|id| plan.laws.contains_key(id) || plan.gone.contains(id))
            };
            if bonds.iter().any(touched) { Err(lost()) } else { Ok(None) }
        }
    }
}

fn reading(source: &Source, call: &Call, span: Span) -> Option<Reading> {
    let what = READINGS.iter().find(|what| **what == call.name.text)?;
    let [row] = call.rows.as_slice() else { return None };
    let [argument] = row.as_slice() else { return None };
    let vertex = |path: &Path| {
        let plain = path.parts().all(|part| part.indices.is_empty());
        plain.then(|| source.names.get(&path.name.text).copied()).flatten()
    };
    let of = match &argument.value {
        Value::Expr(expr) => match &*expr.node {
            Node::Leaf(Leaf::Name(path)) => Of::Vertex(vertex(path)?, path.text()),
            _ => return None,
        },
        Value::Bond(from, to) => {
            let (from, to) = (vertex(from)?, vertex(to)?);
            let same = |id: &BondId| {
                let bond = source.graph.bond(*id);
                bond.from.vertex == from && bond.to.vertex == to
            };
            Of::Bonds(source.graph.bond_ids().filter(same).collect())
        }
        _ => return None,
    };
    Some(Reading { what, of, span })
}

/// Calls `see` for every expression that may read something.
pub fn expressions(statements: &[Statement], see: &mut dyn FnMut(&Expr)) {
    for statement in statements {
        match &statement.kind {
            StatementKind::Chain(chain) => chain_values(chain, see),
            StatementKind::Signal { value, .. } | StatementKind::Drive { value, .. } => see(value),
            StatementKind::Observe(items) => items.iter().for_each(|item| see(&item.expr)),
            StatementKind::Loop(regulator) => {
                see(&regulator.controlled);
                see(&regulator.reference);
            }
            StatementKind::For { body, .. } => expressions(body, see),
            StatementKind::If { then, otherwise, .. } => {
                expressions(then, see);
                expressions(otherwise, see);
            }
            _ => {}
        }
    }
}

fn chain_values(chain: &Chain, see: &mut dyn FnMut(&Expr)) {
    let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
    for argument in ends.flat_map(|end| end.arguments.iter().flatten()) {
        match &argument.value {
            Value::Expr(expr) => see(expr),
            Value::Matrix(rows) => rows.iter().flatten().for_each(&mut *see),
            Value::Bond(..) | Value::Text(_) => {}
        }
    }
}
