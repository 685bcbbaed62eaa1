//! Measures and harmonics: their expressions become columns that are watched, their limits numbers or follow from other measures.

use super::expand::Flat;
use super::experiment;
use super::scope::TOP;
use super::values::Lookup;
use crate::circuit;
use crate::diagnostic::Diagnostic;
use crate::expr;
use crate::netlist::{CardKind, Expr, Fourier, Leaf};
use crate::source::Span;
use crate::trace::fourier::Request;
use crate::trace::measure::{Measure, Source, Value};
use std::collections::{HashMap, HashSet};

/// What is taken from the rows of a run, and the columns that this watches.
#[derive(Default)]
pub struct Taken {
    /// `.measure`.
    pub measures: Vec<Measure>,
    /// `.four`.
    pub harmonics: Vec<Request>,
    /// The columns.
    pub watched: Vec<circuit::Expr>,
}

/// What the cards of a netlist take from rows.
pub fn resolve(flat: &Flat, d: &mut Vec<Diagnostic>) -> Taken {
    let cards = flat.live.iter().filter_map(|card| match &card.kind {
        CardKind::Measure(measure) => Some((measure, card.span)),
        _ => None,
    });
    let cards: Vec<_> = cards.collect();
    let fourier = flat.live.iter().filter_map(|card| match &card.kind {
        CardKind::Fourier(fourier) => Some((fourier, card.span)),
        _ => None,
    });
    let fourier: Vec<_> = fourier.collect();
    if cards.is_empty() && fourier.is_empty() {
        return Taken::default();
    }
    let mut resolver = Resolver {
        lookup: Lookup::new(flat, &flat.netlist.names),
        places: HashMap::new(),
        names: cards.iter().map(|(measure, _)| measure.name.to_lowercase()).collect(),
        watched: vec![],
        columns: HashMap::new(),
        seen: HashSet::new(),
        d,
    };
    let mut measures = vec![];
    for (measure, span) in cards {
        // Those of different analyses may share a name.
        let key = (measure.analysis.clone(), measure.name.to_lowercase());
        if !resolver.seen.insert(key) {
            let message = format!("two measures are called `{}`", measure.name);
            resolver.d.push(Diagnostic::error("E0817", span, message));
        }
        let resolver = std::cell::RefCell::new(&mut resolver);
        let kind = measure
            .kind
            .try_map(&mut |column| resolver.borrow_mut().column(column), &mut |value| {
                resolver.borrow_mut().value(value)
            });
        if let Some(kind) = kind {
            let (name, analysis) = (measure.name.clone(), measure.analysis.clone());
            resolver.borrow_mut().places.insert(name.to_lowercase(), measures.len());
            measures.push(Measure { name, span, analysis, kind });
        }
    }
    let harmonics = fourier.iter().filter_map(|(card, span)| resolver.fourier(card, *span));
    let harmonics = harmonics.collect();
    Taken { measures, harmonics, watched: resolver.watched }
}

struct Resolver<'a, 'f, 'n> {
    lookup: Lookup<'f, 'n>,
    /// Measures so far, by name.
    places: HashMap<String, usize>,
    /// The names of all, folded.
    names: HashSet<String>,
    watched: Vec<circuit::Expr>,
    /// Where a column stands, by its text.
    columns: HashMap<String, usize>,
    seen: HashSet<(String, String)>,
    d: &'a mut Vec<Diagnostic>,
}

impl Resolver<'_, '_, '_> {
    /// A `.four` card.
    fn fourier(&mut self, card: &Fourier, span: Span) -> Option<Request> {
        let frequency = self.lookup.number(TOP, &card.frequency, self.d)?;
        let mut items = vec![];
        for (text, expr) in &card.items {
            let output = experiment::item(&self.lookup, text, expr, self.d)?;
            items.push((output.name, self.watch(&output.expr)));
        }
        if !(frequency > 0.0 && frequency.is_finite()) {
            let message = format!("{frequency} Hz is no frequency of a period");
            let error = Diagnostic::error("E0819", span, message);
            self.d.push(error.help("`.four 50 v(out)`: the frequency first, in Hz and above 0"));
            return None;
        }
        Some(Request { frequency, items, span })
    }

    /// A column that is watched.
    fn column(&mut self, expr: &Expr) -> Option<usize> {
        let law = self.lookup.law(TOP, expr, self.d)?;
        Some(self.watch(&law))
    }

    /// Where a law stands among the columns.
    fn watch(&mut self, law: &circuit::Expr) -> usize {
        // Places in the text do not tell columns apart.
        let law = law.map(&mut |leaf, _| circuit::Expr::leaf(*leaf));
        let next = self.watched.len();
        let place = *self.columns.entry(format!("{law:?}")).or_insert(next);
        if place == next {
            self.watched.push(law);
        }
        place
    }

    /// A limit, or the formula of a measure.
    fn value(&mut self, expr: &Expr) -> Option<Value> {
        expr.try_map(&mut |leaf, span| {
            let Leaf::Parameter(name) = leaf else {
                let alone = Expr::new(expr::Node::Leaf(leaf.clone()), span);
                return self.column(&alone).map(|k| Value::leaf(Source::Column(k))).ok_or(());
            };
            let text = self.lookup.names.text(*name);
            let folded = text.to_lowercase();
            if let Some(place) = self.places.get(&folded) {
                return Ok(Value::leaf(Source::Measure(*place)));
            }
            if self.names.contains(&folded) {
                let message = format!("the measure `{text}` stands after the one that uses it");
                self.d.push(Diagnostic::error("E0818", span, message));
                return Err(());
            }
            let alone = Expr::new(expr::Node::Leaf(leaf.clone()), span);
            self.lookup.number(TOP, &alone, self.d).map(Value::number).ok_or(())
        })
        .ok()
    }
}
