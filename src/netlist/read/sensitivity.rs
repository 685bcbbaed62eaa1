//! `.sens`: which slopes are to be told.
//!
//! ```text
//! .sens v(out)                         ngspice: by every value of a device, at the operating point
//! .sens v(out) ac dec 10 1 1meg        the same over frequencies
//! .sens objfunc={v(a)**2},v(b) param=R1:R,gain      Xyce: along the deck's other analysis; also acobjfunc= and objvars=
//! ```

use super::cards::{end_of_item, item};
use super::{Cursor, Reader, analyses};
use crate::diagnostic::Diagnostic;
use crate::netlist::analysis::{Analysis, Over};
use crate::netlist::{CardKind, Expr, Leaf};

/// Keys of Xyce's form.
const KEYS: &[&str] = &["objfunc", "acobjfunc", "objvars", "param"];

/// The card, whose keyword has been read.
pub fn sensitivity(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let mut ahead = *cursor;
    let keyed = ahead.key().is_some_and(|(key, _)| KEYS.contains(&key.to_lowercase().as_str()));
    let analysis = if keyed { listed(reader, cursor)? } else { plain(reader, cursor)? };
    Some(CardKind::Analysis(Box::new(analysis)))
}

/// ngspice's form; `param=` may stand at its end.
fn plain(reader: &mut Reader, cursor: &mut Cursor) -> Option<Analysis> {
    cursor.blanks();
    let from = cursor.at;
    let to = end_of_item(cursor);
    if to == from {
        reader.missing(cursor, "the output of `.sens v(out)`");
        return None;
    }
    cursor.at = to;
    let outputs = vec![item(reader, cursor, from, to)?];
    let mut over = Over::Rest;
    if cursor.next_word().eq_ignore_ascii_case("dc") {
        cursor.word();
    } else if cursor.next_word().eq_ignore_ascii_case("ac") {
        cursor.word();
        over = Over::Frequencies(analyses::frequencies(reader, cursor)?);
    }
    let mut parameters = None;
    let mut ahead = *cursor;
    if ahead.key().is_some_and(|(key, _)| key.eq_ignore_ascii_case("param")) {
        *cursor = ahead;
        parameters = Some(names(reader, cursor)?);
    }
    Some(Analysis::Sensitivity { outputs, parameters, over })
}

/// Xyce's form.
fn listed(reader: &mut Reader, cursor: &mut Cursor) -> Option<Analysis> {
    let (mut outputs, mut parameters) = (vec![], vec![]);
    while !cursor.is_done() {
        let here = cursor.here(reader);
        let key = cursor.key().map(|(key, _)| key.to_lowercase()).unwrap_or_default();
        match key.as_str() {
            "objfunc" | "acobjfunc" => {
                for (from, to) in parts(cursor) {
                    outputs.push(item(reader, cursor, from, to)?);
                }
            }
            "objvars" => {
                for (name, span) in names(reader, cursor)? {
                    let word = reader.names.text(name).to_string();
                    let node = reader.node_name(&word);
                    let leaf = crate::expr::Node::Leaf(Leaf::Voltage(node, None));
                    outputs.push((format!("v({word})"), Expr::new(leaf, span)));
                }
            }
            "param" => parameters.extend(names(reader, cursor)?),
            _ => {
                let message = format!("`.sens` takes {}", KEYS.join("=, ") + "=");
                reader.diagnostics.push(Diagnostic::error("E0704", here, message));
                return None;
            }
        }
    }
    for (missing, what) in [
        (outputs.is_empty(), "`objfunc={…}` of `.sens`"),
        (parameters.is_empty(), "`param=R1:R,…` of `.sens`"),
    ] {
        if missing {
            reader.missing(cursor, what);
            return None;
        }
    }
    Some(Analysis::Sensitivity { outputs, parameters: Some(parameters), over: Over::Other })
}

/// Where the parts of a list separated by commas stand; the cursor moves over it. Blanks may stand after commas.
fn parts(cursor: &mut Cursor) -> Vec<(usize, usize)> {
    cursor.blanks();
    let bytes = cursor.text.as_bytes();
    let (mut found, mut depth, mut from, mut at) = (vec![], 0i32, cursor.at, cursor.at);
    let after_comma =
        |found: &Vec<(usize, usize)>, from: usize, at: usize| !found.is_empty() && from == at;
    while at < bytes.len() {
        match bytes[at] {
            b'(' | b'{' => depth += 1,
            b')' | b'}' => depth -= 1,
            b',' if depth <= 0 => {
                found.push((from, at));
                from = at + 1;
            }
            b' ' | b'\t' if depth <= 0 && after_comma(&found, from, at) => from = at + 1,
            b' ' | b'\t' if depth <= 0 => break,
            _ => {}
        }
        at += 1;
    }
    let end = from + cursor.text[from..at].trim_end().len();
    found.push((from, end));
    found.retain(|(from, to)| from < to);
    cursor.at = at;
    found
}

/// Names separated by commas.
fn names(
    reader: &mut Reader,
    cursor: &mut Cursor,
) -> Option<Vec<(crate::netlist::Name, crate::source::Span)>> {
    let parts = parts(cursor);
    if parts.is_empty() {
        reader.missing(cursor, "a name");
        return None;
    }
    let name = |(from, to): (usize, usize)| {
        let span = cursor.span(reader, from, to);
        (reader.names.intern(cursor.text[from..to].trim()), span)
    };
    Some(parts.into_iter().map(name).collect())
}
