//! What the bond graph's equations give once they are solved, or do not give.

use super::super::draw::Modular;
use super::super::form::{Form, Reading, Trouble};
use super::super::system::Undetermined;
use super::{Alike, Bonds, Place};
use crate::bond::graph::{BondId, Expr, Law, Storage, VertexId};
use std::collections::HashMap;

impl<F: Modular> Bonds<'_, F> {
    /// The values of an expression at a solution.
    ///
    /// # Errors
    /// Why it has none.
    pub fn value(&self, expr: &Expr, own: Option<VertexId>, solution: &[F]) -> Result<F, Trouble> {
        Reading { draw: self.draw, cut: None }
            .number(expr, &mut |leaf, _| Ok(Form::number(self.leaf(leaf, own)?.at(solution))))
    }

    /// Laws and moduli whose value at a solution another has too, or its negative.
    ///
    /// # Errors
    /// What has no value in this draw.
    pub fn alike(&self, solution: &[F]) -> Result<Alike<F>, Trouble> {
        let size = |value: F| value.value().min((-value).value());
        let mut count: HashMap<u64, usize> = HashMap::new();
        let mut alike = Alike::default();
        for (place, cut) in &self.cuts {
            // The ports of a two-port have a modulus in common.
            let two_port = match place {
                Place::Port(end) => {
                    matches!(
                        self.graph.vertex(end.vertex).law,
                        Law::Transformer(_) | Law::Gyrator(_)
                    )
                }
                Place::Signal(_) => false,
            };
            if !two_port {
                alike.laws.insert(*place, self.value(&cut.law, cut.own, solution)?);
            }
        }
        for (modulus, own, _) in &self.moduli {
            alike.moduli.insert(*own, self.value(modulus, Some(*own), solution)?);
        }
        for value in alike.laws.values().chain(alike.moduli.values()) {
            *count.entry(size(*value)).or_default() += 1;
        }
        let shared = |value: &F| !value.is_zero() && count.get(&size(*value)) > Some(&1);
        alike.laws.retain(|_, value| shared(value));
        alike.moduli.retain(|_, value| shared(value));
        Ok(alike)
    }

    /// Of every law that is cut the value of its text, and what it was cut to. Laws of one text are cut to different
    /// values: each has its own table. So has a law whose text is 0, as the product with a flow that is forced to 0:
    /// there are other zeros in an expression than this one.
    ///
    /// # Errors
    /// What has no value in this draw.
    pub fn cut_values(&self, solution: &[F]) -> Result<Vec<HashMap<u64, F>>, Trouble> {
        let mut pairs = vec![];
        for (modulus, own, number) in &self.moduli {
            pairs.push((self.value(modulus, Some(*own), solution)?, *number));
        }
        for cut in self.cuts.values() {
            let value = self.value(&cut.law, cut.own, solution)?;
            pairs.push((value, cut.value.at(solution)));
        }
        pairs.sort_by_key(|(value, to)| (value.value(), to.value()));
        pairs.dedup();
        let zeros: Vec<F> =
            pairs.extract_if(.., |(value, _)| value.is_zero()).map(|(_, to)| to).collect();
        let mut tables: Vec<HashMap<u64, F>> = vec![];
        for (value, to) in pairs {
            let key = value.value();
            match tables.iter_mut().find(|table| table.get(&key).is_none_or(|known| *known == to)) {
                Some(table) => {
                    table.insert(key, to);
                }
                None => tables.push(HashMap::from([(key, to)])),
            }
        }
        if tables.is_empty() && !zeros.is_empty() {
            tables.push(HashMap::new());
        }
        let with_zeros = zeros.iter().flat_map(|to| {
            tables.iter().map(|table| {
                let mut table = table.clone();
                table.insert(0, *to);
                table
            })
        });
        let with_zeros: Vec<_> = with_zeros.collect();
        tables.extend(with_zeros);
        Ok(tables)
    }

    /// The names of what is not determined, and of the laws that depend on each other.
    pub fn explain(&self, found: &Undetermined) -> (Vec<String>, Vec<String>) {
        let unknowns = found.unknowns.iter().map(|column| self.name(*column)).collect();
        let mut origins: Vec<String> = vec![];
        for row in &found.rows {
            let name = match self.origins.get(*row as usize) {
                Some(Place::Port(end)) => self.graph.vertex(end.vertex).name.clone(),
                Some(Place::Signal(id)) => self.graph.signals[id.index()].name.clone(),
                None => continue,
            };
            if !origins.contains(&name) {
                origins.push(name);
            }
        }
        (unknowns, origins)
    }

    fn name(&self, column: u32) -> String {
        let bond = BondId(column / 2);
        if bond.index() < self.graph.bonds.len() {
            let letter = if column.is_multiple_of(2) { 'e' } else { 'f' };
            return format!("{letter}({})", self.graph.bond_name(bond));
        }
        if let Some(k) = self.signals.iter().position(|signal| *signal == column) {
            return self.graph.signals[k].name.clone();
        }
        let stored = self.stored.iter().find(|(_, own)| **own == column);
        stored.map_or_else(String::new, |(end, _)| {
            let inertia = self.graph.storage(*end) == Some(Storage::Inertia);
            format!("{}({})", if inertia { 'p' } else { 'q' }, self.graph.port_name(*end))
        })
    }
}

impl<F> Default for Alike<F> {
    fn default() -> Self {
        Alike { laws: HashMap::new(), moduli: HashMap::new() }
    }
}

impl<F> Alike<F> {
    /// Whether there is nothing to cut alike.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty() && self.moduli.is_empty()
    }
}
