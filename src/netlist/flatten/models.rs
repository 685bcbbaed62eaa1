//! Models by name, and what their parameters say.

use super::expand::Pending;
use super::values::Lookup;
use crate::diagnostic::Diagnostic;
use crate::netlist::{Expr, Name};
use crate::quantity::nearest;
use crate::source::Span;

/// A key of a model or of a device: its name and its default; NaN where being left out means something.
pub type Key = (&'static str, f64);

/// One that has no default.
pub const OPEN: f64 = f64::NAN;

/// What a kind of model takes.
pub struct Kind {
    /// The types that it is called by; any of them will do.
    pub names: &'static [&'static str],
    /// Its keys.
    pub keys: &'static [Key],
    /// Keys that matter in other analyses only.
    pub idle: &'static [&'static str],
    /// Other spellings of keys.
    pub spellings: &'static [(&'static str, &'static str)],
}

/// The values of a model, and the type that it has.
pub struct Values<'k> {
    /// Its type, as written, folded to lower case.
    pub kind: String,
    keys: &'k [Key],
    values: Vec<f64>,
}

impl Values<'_> {
    /// The value of a key.
    pub fn get(&self, key: &str) -> f64 {
        self.keys.iter().position(|(own, _)| *own == key).map_or(f64::NAN, |k| self.values[k])
    }

    /// The value of a key that may be left out.
    pub fn given(&self, key: &str) -> Option<f64> {
        Some(self.get(key)).filter(|value| !value.is_nan())
    }
}

/// Whether a name means a model here.
pub fn is_model(lookup: &Lookup, pending: &Pending, name: Name) -> bool {
    lookup.flat.scopes.around(pending.scope).any(|(_, scope)| scope.models.contains_key(&name))
}

/// The values of a model of a kind.
pub fn model<'k>(
    lookup: &Lookup,
    pending: &Pending,
    name: Name,
    kind: &'k Kind,
    d: &mut Vec<Diagnostic>,
) -> Option<Values<'k>> {
    let text = lookup.names.text(name);
    let found = lookup
        .flat
        .scopes
        .around(pending.scope)
        .find_map(|(id, scope)| scope.models.get(&name).map(|model| (id, *model)));
    let first = kind.names[0];
    let Some((id, (card, own, parameters))) = found else {
        let models =
            lookup.flat.scopes.around(pending.scope).flat_map(|(_, scope)| scope.models.keys());
        let mut known: Vec<&str> = models.map(|name| lookup.names.text(*name)).collect();
        known.sort_unstable();
        let error =
            Diagnostic::error("E0742", pending.card.span, format!("unknown model `{text}`"));
        d.push(match nearest(text, known) {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None => error.help(format!("define it: .model {text} {first}(…)")),
        });
        return None;
    };
    if !kind.names.contains(&own) {
        let wanted: Vec<String> = kind.names.iter().map(|name| format!("`{name}`")).collect();
        let message =
            format!("`{text}` is a model of type `{own}`, {} is needed", wanted.join(" or "));
        d.push(
            Diagnostic::error("E0742", pending.card.span, message).label(card.span, "the model"),
        );
        return None;
    }
    let mut values: Vec<f64> = kind.keys.iter().map(|(_, default)| *default).collect();
    for (key, expr) in parameters {
        let key =
            kind.spellings.iter().find(|(other, _)| other == key).map_or(key.as_str(), |(_, k)| k);
        if let Some(k) = kind.keys.iter().position(|(known, _)| *known == key) {
            values[k] = lookup.number(id, expr, d)?;
        } else if !kind.idle.contains(&key) {
            let span = if expr.span.is_none() { card.span } else { expr.span };
            let what = format!("models of type `{own}`");
            unknown_key(&what, key, span, kind.keys, d);
            return None;
        }
    }
    Some(Values { kind: own.to_string(), keys: kind.keys, values })
}

/// The values that a card gives itself.
pub fn own<'k>(
    lookup: &Lookup,
    pending: &Pending,
    what: &str,
    given: &[(String, Expr)],
    keys: &'k [Key],
    d: &mut Vec<Diagnostic>,
) -> Option<Values<'k>> {
    let mut values: Vec<f64> = keys.iter().map(|(_, default)| *default).collect();
    for (key, expr) in given {
        let Some(k) = keys.iter().position(|(known, _)| known == key) else {
            let span = if expr.span.is_none() { pending.card.span } else { expr.span };
            unknown_key(what, key, span, keys, d);
            return None;
        };
        values[k] = lookup.number(pending.scope, expr, d)?;
    }
    Some(Values { kind: String::new(), keys, values })
}

fn unknown_key(what: &str, key: &str, span: Span, keys: &[Key], d: &mut Vec<Diagnostic>) {
    let error = Diagnostic::error("E0743", span, format!("{what} have no parameter `{key}`"));
    let error = match nearest(key, keys.iter().map(|(known, _)| *known)) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error,
    };
    // One model, one message, however many devices use it.
    if !d.contains(&error) {
        d.push(error);
    }
}
