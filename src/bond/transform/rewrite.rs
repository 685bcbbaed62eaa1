//! A plan made in the author's text: statements that it touches are written anew, all else stays as it is.

use super::arguments::{inside, scaled};
use super::letters::respelt;
use super::plan::{Change, Plan, Side};
use super::respell::splice;
use super::{Source, Trouble};
use crate::bond::graph::{BondId, Stroke, VertexId};
use crate::bond::syntax::{self, Chain, ChainEnd, StatementKind, TriviaKind};
use crate::source::Span;
use std::collections::{HashMap, HashSet};

/// Characters of a line of comments.
const WIDTH: usize = 116;

/// An end of an arrow, as it is to be written.
#[derive(Clone, Debug, PartialEq)]
struct Tip {
    name: String,
    /// A port, with its dot.
    port: String,
}

/// A chain, as it is to be written: tips with arrows between; the last arrow may lead to several.
struct Run {
    tips: Vec<Tip>,
    arrows: Vec<&'static str>,
    last: Vec<Tip>,
}

/// A statement that is written anew.
struct Anew {
    /// Index of the statement.
    at: usize,
    runs: Vec<Run>,
}

/// Makes a plan in the text, and lays it out. All of it must stand [`within`] the text.
///
/// # Errors
/// That a reading has no counterpart, or a law cannot follow.
pub fn apply(source: &Source, plan: &Plan) -> Result<String, Trouble> {
    let readings = respelt(source, plan)?;
    let mut anew = vec![];
    let mut changed_ends: Vec<Span> = vec![];
    for (at, statement) in source.syntax.statements.iter().enumerate() {
        let StatementKind::Chain(chain) = &statement.kind else { continue };
        if let Some(runs) = rechain(source, plan, chain) {
            anew.push(Anew { at, runs });
        }
    }
    declare(source, plan, &mut anew);
    let replaced: Vec<Span> =
        anew.iter().map(|one| source.syntax.statements[one.at].span).collect();
    let anew_at = |span: Span| replaced.iter().any(|whole| inside(span, *whole));
    let mut written = HashSet::new();
    let mut edits: Vec<(Span, String)> = vec![];
    let mut first = None;
    for statement in &anew {
        let span = source.syntax.statements[statement.at].span;
        let mut lines = comments_in(source, span);
        for run in &statement.runs {
            lines.push(print(source, plan, run, &readings, &anew_at, &mut written)?);
        }
        first = first.or(Some(statement.at));
        edits.push((span, lines.join("\n")));
    }
    // Declarations in statements that stay as they are.
    let mut laws: Vec<_> = plan.laws.keys().collect();
    laws.sort_unstable();
    for id in laws {
        let Some(declared) = source.declared.get(id) else { continue };
        if !anew_at(declared.span) && !plan.gone.contains(id) {
            let text = declaration(source, plan, *id, &readings)?;
            edits.push((declared.span, text));
            changed_ends.push(declared.span);
            let at = source.syntax.statements.iter().position(|s| inside(declared.span, s.span));
            first = first.min(at).or(at);
        }
    }
    for (span, text) in &readings {
        if !anew_at(*span) && !changed_ends.iter().any(|whole| inside(*span, *whole)) {
            edits.push((*span, text.clone()));
        }
    }
    name_columns(source, &readings, &mut edits);
    if edits.is_empty() {
        return Ok(source.text.clone());
    }
    if let Some(span) = first.map(|at| source.syntax.statements[at].span) {
        explain(source, span, plan, &mut edits);
    }
    let text = splice(&source.text, 0, &mut merge(edits));
    Ok(syntax::format(&drop_empty(&text)))
}

/// Whether all that a plan changes stands at the top of the file, where it can be changed.
pub fn within(source: &Source, plan: &Plan) -> bool {
    let bonds = plan.cut.iter().chain(plan.ends.keys().map(|(bond, _)| bond));
    let mut ends = bonds.chain(plan.through.keys()).flat_map(|bond| {
        let bond = source.graph.bond(*bond);
        [bond.from.vertex, bond.to.vertex]
    });
    ends.all(|id| source.own(id))
        && plan.gone.iter().chain(plan.laws.keys()).all(|id| source.own(*id))
}

/// A chain after the change; `None` when it stays as it is.
fn rechain(source: &Source, plan: &Plan, chain: &Chain) -> Option<Vec<Run>> {
    let tip = |end: &ChainEnd| Tip {
        name: source.slice(end.path.name.span).to_string()
            + match end.path.name.indices.is_empty() {
                true => "",
                false => after_name(source, end),
            },
        port: ports(source, end),
    };
    let mut changed = false;
    let mut runs: Vec<Run> = vec![];
    if chain.links.is_empty() {
        for end in &chain.first {
            match source.vertex_of(end) {
                Some(id) if plan.gone.contains(&id) => changed = true,
                _ => runs.push(Run { tips: vec![tip(end)], arrows: vec![], last: vec![] }),
            }
        }
        return changed.then_some(runs);
    }
    let mut from = chain.first.first()?;
    for (arrow, ends) in &chain.links {
        let sign = match arrow.stroke {
            Some(Stroke::AtTo) => "->|",
            Some(Stroke::AtFrom) => "|->",
            None => "->",
        };
        for to in ends {
            let bond = bond_of(source, from, to);
            let Some(bond) = bond else {
                join(&mut runs, tip(from), sign, tip(to));
                continue;
            };
            if plan.cut.contains(&bond) {
                changed = true;
                continue;
            }
            let moved = |side: Side, end: &ChainEnd| match plan.ends.get(&(bond, side)) {
                Some(name) => (Tip { name: name.clone(), port: String::new() }, true),
                None => (tip(end), false),
            };
            let (tail, first) = moved(Side::From, from);
            let (head, second) = moved(Side::To, to);
            changed |= first || second;
            match plan.through.get(&bond) {
                Some((_, name)) => {
                    changed = true;
                    let middle = Tip { name: name.clone(), port: String::new() };
                    join(&mut runs, tail, sign, middle.clone());
                    join(&mut runs, middle, sign, head);
                }
                None => join(&mut runs, tail, sign, head),
            }
        }
        from = ends.last()?;
    }
    changed.then_some(runs)
}

/// What follows the first name of an end before its ports: its indices.
fn after_name<'s>(source: &'s Source, end: &ChainEnd) -> &'s str {
    let span = end.path.name.span;
    let until = end.path.members.first().map_or(end.path.span.end, |part| part.span.start - 1);
    source.slice(Span { start: span.end, end: until, ..span })
}

fn ports(source: &Source, end: &ChainEnd) -> String {
    match end.path.members.first() {
        None => String::new(),
        Some(part) => {
            let span = Span { start: part.span.start - 1, end: end.path.span.end, ..part.span };
            source.slice(span).to_string()
        }
    }
}

/// Adds a bond to the chain that it goes on with, or begins one.
fn join(runs: &mut Vec<Run>, from: Tip, sign: &'static str, to: Tip) {
    if let Some(run) = runs.last_mut() {
        if run.last.is_empty() && run.tips.last() == Some(&from) {
            run.arrows.push(sign);
            run.tips.push(to);
            return;
        }
        let hub = run.tips.len().checked_sub(2).and_then(|k| run.tips.get(k));
        if hub == Some(&from) && run.arrows.last() == Some(&sign) {
            run.last.push(to);
            return;
        }
    }
    runs.push(Run { tips: vec![from, to], arrows: vec![sign], last: vec![] });
}

/// The bond of an arrow between two ends: it stands where both stand, or, within a list, where the second does.
fn bond_of(source: &Source, from: &ChainEnd, to: &ChainEnd) -> Option<BondId> {
    let spans = [to.span, from.span.join(to.span)];
    let (from, to) = (source.vertex_of(from)?, source.vertex_of(to)?);
    source.graph.bond_ids().find(|id| {
        let bond = source.graph.bond(*id);
        spans.contains(&bond.span) && bond.from.vertex == from && bond.to.vertex == to
    })
}

/// Sees to it that everything that is left is declared somewhere: declarations alone where no chain is left, and the
/// statement written anew where a declaration has to move to.
fn declare(source: &Source, plan: &Plan, anew: &mut [Anew]) {
    let statements = &source.syntax.statements;
    let home = |span: Span| statements.iter().position(|s| inside(span, s.span));
    let mut lost: Vec<(usize, String)> = vec![];
    let mut ids: Vec<_> = source.declared.keys().copied().collect();
    ids.sort_unstable();
    for id in ids {
        if plan.gone.contains(&id) {
            continue;
        }
        let name = &source.graph.vertex(id).name;
        let Some(at) = home(source.declared[&id].span) else { continue };
        let Some(own) = anew.iter().find(|anew| anew.at == at) else { continue };
        let occurs = |anew: &Anew| {
            anew.runs.iter().any(|r| r.tips.iter().chain(&r.last).any(|t| t.name == *name))
        };
        if !occurs(own) && !anew.iter().any(occurs) {
            lost.push((at, name.clone()));
        }
    }
    for (at, name) in lost {
        // Alone: what other statements say of it needs no declaration there.
        if let Some(own) = anew.iter_mut().find(|anew| anew.at == at) {
            let tip = Tip { name, port: String::new() };
            own.runs.push(Run { tips: vec![tip], arrows: vec![], last: vec![] });
        }
    }
}

fn print(
    source: &Source,
    plan: &Plan,
    run: &Run,
    readings: &[(Span, String)],
    anew_at: &dyn Fn(Span) -> bool,
    written: &mut HashSet<String>,
) -> Result<String, Trouble> {
    let mut tip = |tip: &Tip| -> Result<String, Trouble> {
        let new = plan.through.values().find(|(_, name)| *name == tip.name);
        let declares = match source.names.get(&tip.name) {
            Some(id) => {
                let declared = source.declared.get(id);
                source.own(*id) && declared.is_some_and(|declared| anew_at(declared.span))
            }
            None => new.is_some(),
        };
        if !declares || !written.insert(tip.name.clone()) {
            return Ok(format!("{}{}", tip.name, tip.port));
        }
        let text = match (source.names.get(&tip.name), new) {
            (Some(id), _) => declaration(source, plan, *id, readings)?,
            (None, Some((kind, name))) => format!("{kind}:{name}"),
            (None, None) => tip.name.clone(),
        };
        // A port stands after the name, before the arguments.
        Ok(match (tip.port.is_empty(), text.find('(')) {
            (true, _) => text,
            (false, Some(at)) => format!("{}{}{}", &text[..at], tip.port, &text[at..]),
            (false, None) => text + &tip.port,
        })
    };
    let mut text = String::new();
    for (k, one) in run.tips.iter().enumerate() {
        if k > 0 {
            text += &format!(" {} ", run.arrows[k - 1]);
        }
        text += &tip(one)?;
    }
    for one in &run.last {
        text += ", ";
        text += &tip(one)?;
    }
    Ok(text)
}

/// `I:J(J/la^2)`
fn declaration(
    source: &Source,
    plan: &Plan,
    id: VertexId,
    readings: &[(Span, String)],
) -> Result<String, Trouble> {
    let Some(declared) = source.declared.get(&id) else { return Ok(String::new()) };
    let vertex = source.graph.vertex(id);
    let (kind, arguments) = match plan.laws.get(&id) {
        None => {
            let span = declared.span;
            let mut own: Vec<_> =
                readings.iter().filter(|(place, _)| inside(*place, span)).cloned().collect();
            let text = splice(source.slice(span), span.start, &mut own);
            // Without the port that stands here.
            let head = format!("{}:{}", declared.kind.text, vertex.name);
            let rest = text.find('(').map_or("", |at| &text[at..]);
            return Ok(head + rest);
        }
        Some(change @ (Change::Scaled(scaling) | Change::Lumped(scaling))) => {
            let starts = matches!(change, Change::Scaled(_));
            (scaling.kind(vertex.kind), scaled(source, id, scaling, starts, readings)?)
        }
        Some(Change::Text(kind, arguments)) => (*kind, arguments.clone()),
    };
    let name = &vertex.name;
    // An element of the name of its value needs no argument.
    let brief = arguments.is_empty() || arguments == *name;
    Ok(if brief { format!("{kind}:{name}") } else { format!("{kind}:{name}({arguments})") })
}

/// The comments within a statement, to stand above it.
fn comments_in(source: &Source, span: Span) -> Vec<String> {
    let trivia = source.syntax.trivia.iter();
    let own = trivia.filter(|t| t.kind == TriviaKind::Comment && inside(t.span, span));
    own.map(|comment| source.slice(comment.span).trim_end().to_string()).collect()
}

/// Columns that are headed by what they read keep their headings.
fn name_columns(source: &Source, readings: &[(Span, String)], edits: &mut Vec<(Span, String)>) {
    for statement in &source.syntax.statements {
        let StatementKind::Observe(items) = &statement.kind else { continue };
        for item in items.iter().filter(|item| item.name.is_none()) {
            let touched = readings.iter().any(|(span, _)| inside(*span, item.expr.span));
            if touched {
                let heading: String =
                    source.slice(item.expr.span).chars().filter(|c| !c.is_whitespace()).collect();
                let end = Span { start: item.span.end, end: item.span.end, ..item.span };
                edits.push((end, format!(" as \"{heading}\"")));
            }
        }
    }
}

/// Puts the comment above the first statement that changes.
fn explain(source: &Source, span: Span, plan: &Plan, edits: &mut Vec<(Span, String)>) {
    let before = &source.text[..span.start as usize];
    let line = before.rfind('\n').map_or(0, |at| at + 1);
    let indent: String = before[line..].chars().take_while(|c| c.is_whitespace()).collect();
    let place = Span::new(source.file, line, line);
    edits.push((place, comment(&plan.why, &indent)));
}

/// A text as lines of comments.
pub fn comment(text: &str, indent: &str) -> String {
    let mut lines = String::new();
    for paragraph in text.lines() {
        let mut line = format!("{indent}#");
        for word in paragraph.split_whitespace() {
            let longer = line.chars().count() + 1 + word.chars().count();
            if longer > WIDTH && line.len() > indent.len() + 1 {
                lines += &line;
                lines += "\n";
                line = format!("{indent}#");
            }
            line += " ";
            line += word;
        }
        lines += &line;
        lines += "\n";
    }
    lines
}

/// Edits in order, those at one place joined.
fn merge(mut edits: Vec<(Span, String)>) -> Vec<(Span, String)> {
    edits.sort_by_key(|(span, _)| (span.start, span.end));
    let mut merged: HashMap<u32, usize> = HashMap::new();
    let mut all: Vec<(Span, String)> = vec![];
    for (span, text) in edits {
        match merged.get(&span.start) {
            Some(at) if all[*at].0.end == span.start => {
                let before = &mut all[*at];
                before.0.end = span.end;
                before.1 += &text;
            }
            _ => {
                merged.insert(span.start, all.len());
                all.push((span, text));
            }
        }
    }
    // A statement of which nothing is left leaves a mark, so that its line goes, too.
    for (span, text) in &mut all {
        if span.start < span.end && text.trim().is_empty() {
            *text = EMPTY.to_string();
        } else if span.start < span.end && text.ends_with('\n') {
            text.push_str(EMPTY);
        }
    }
    all
}

/// Stands where a statement was; no text of a model holds it.
const EMPTY: &str = "\u{1}";

/// Takes lines away on which a statement was and nothing is now but a comment on it.
fn drop_empty(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        match line.contains(EMPTY) {
            false => kept += line,
            true => {
                let rest = line.replace(EMPTY, "");
                let code = rest.split('#').next().unwrap_or("");
                if !code.trim().trim_matches(';').trim().is_empty() {
                    kept += &rest;
                }
            }
        }
    }
    kept
}
