//! Elements and bonds of a flat text.

use super::{Piece, Writer};
use crate::bond::graph::{
    Dissipation, End, Expr, Initial, Law, Leaf, Modulus, Power, Storage, StoreInitial, StoreLaw,
    Stroke, VertexId,
};
use crate::bond::transform::Trouble;
use crate::bond::words::letter;
use crate::expr::Dialect;
use crate::expr::print::print;
use std::collections::HashSet;

impl Writer<'_> {
    /// All bonds, in chains as long as they follow each other.
    pub(super) fn chains(&self) -> Result<String, Trouble> {
        let mut text = String::new();
        let mut declared = HashSet::new();
        // The end of the chain so far, what its last arrow came from, and that arrow.
        let mut last: Option<(String, String, &str)> = None;
        for id in self.graph.vertex_ids() {
            // A field is declared alone, since its ports are named in its bonds.
            if matches!(self.graph.vertex(id).law, Law::Field(_)) {
                let name = &self.names.vertices[id.index()];
                text += &self.declared(End::only(id), name, &mut declared)?;
                text += "\n";
            }
        }
        for id in self.graph.bond_ids() {
            let bond = self.graph.bond(id);
            let sign = match bond.given {
                None => "->",
                Some(Stroke::AtFrom) => "|->",
                Some(Stroke::AtTo) => "->|",
            };
            let (from, to) = (self.tip(bond.from, false), self.tip(bond.to, true));
            match &last {
                Some((end, ..)) if *end == from => text += &format!(" {sign} "),
                Some((_, hub, arrow)) if *hub == from && *arrow == sign => text += ", ",
                _ => {
                    let first = self.declared(bond.from, &from, &mut declared)?;
                    let separator = if last.is_some() { "\n" } else { "" };
                    text += &format!("{separator}{first} {sign} ");
                }
            }
            text += &self.declared(bond.to, &to, &mut declared)?;
            // A list ends its chain.
            let listed = matches!(&last, Some((end, hub, _)) if *hub == from && *end != from);
            let end = if listed { String::new() } else { to };
            last = Some((end, from, sign));
        }
        Ok(text + "\n")
    }

    /// An end of an arrow: with its port where the direction does not say it.
    fn tip(&self, end: End, head: bool) -> String {
        let name = &self.names.vertices[end.vertex.index()];
        match &self.graph.vertex(end.vertex).law {
            Law::Transformer(_) | Law::Gyrator(_) if (end.port == 0) == head => name.clone(),
            Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => self.port(end),
            _ => name.clone(),
        }
    }

    fn declared(
        &self,
        end: End,
        tip: &str,
        declared: &mut HashSet<VertexId>,
    ) -> Result<String, Trouble> {
        if !declared.insert(end.vertex) {
            return Ok(tip.to_string());
        }
        let kind = self.graph.vertex(end.vertex).kind;
        let arguments = self.arguments(end.vertex);
        let name = &self.names.vertices[end.vertex.index()];
        Ok(match arguments.as_str() {
            "" => format!("{kind}:{tip}"),
            same if same == name => format!("{kind}:{tip}"),
            arguments => format!("{kind}:{tip}({arguments})"),
        })
    }

    fn arguments(&self, id: VertexId) -> String {
        let law = &self.graph.vertex(id).law;
        let plain = |expr: &Expr| self.expr(expr, "");
        match law {
            Law::Zero | Law::One | Law::Source { detector: true, .. } => String::new(),
            Law::Source { value, .. } => plain(value),
            Law::Transformer(Modulus::Ratio(r)) | Law::Gyrator(Modulus::Ratio(r)) => plain(r),
            Law::Transformer(Modulus::Gain(g)) | Law::Gyrator(Modulus::Gain(g)) => {
                format!("gain = {}", plain(g))
            }
            Law::Field(field) => {
                let mut parts = vec![];
                if let Some(matrix) = &field.matrix {
                    let rows = matrix
                        .iter()
                        .map(|row| row.iter().map(plain).collect::<Vec<_>>().join(", "));
                    parts.push(format!("[{}]", rows.collect::<Vec<_>>().join("; ")));
                }
                for (port, law) in field.ports.iter().enumerate() {
                    parts.extend(self.port_law(id, port as u32, law, field.matrix.is_none()));
                }
                if field.matrix.is_some() && parts.len() > 1 {
                    let (letter, values): (Vec<&str>, Vec<&str>) =
                        parts[1..].iter().filter_map(|part| part.split_once(" = ")).unzip();
                    let letter = letter.first().and_then(|l| l.get(..1)).unwrap_or("q");
                    parts = vec![parts[0].clone(), format!("{letter}0 = [{}]", values.join(", "))];
                }
                parts.join(", ")
            }
            law => self.one_port(law).join(", "),
        }
    }

    /// The law and the start of a one-port.
    fn one_port(&self, law: &Law) -> Vec<String> {
        let plain = |expr: &Expr| self.expr(expr, "");
        match law {
            Law::Dissipator(Dissipation::Linear(value)) => vec![plain(value)],
            Law::Dissipator(Dissipation::Effort(law)) => vec![format!("e = {}", plain(law))],
            Law::Dissipator(Dissipation::Flow(law)) => vec![format!("f = {}", plain(law))],
            Law::Store { kind, law, initial } => {
                let stored = if *kind == Storage::Compliance { "q" } else { "p" };
                let gives = letter(kind.gives());
                let mut parts = vec![match law {
                    StoreLaw::Linear(value) => plain(value),
                    StoreLaw::OfStored(law) => format!("{gives} = {}", self.expr(law, stored)),
                    StoreLaw::OfPower(law) => format!("{stored} = {}", plain(law)),
                }];
                match initial {
                    StoreInitial::Stored(value) => {
                        parts.push(format!("{stored}0 = {}", plain(value)))
                    }
                    StoreInitial::Power(value) => {
                        parts.push(format!("{gives}0 = {}", plain(value)))
                    }
                    StoreInitial::Unstated => {}
                }
                parts
            }
            Law::Rate { kind, rate, initial } => {
                let gives = letter(kind.gives());
                let mut parts = vec![format!("der({gives}) = {}", plain(rate))];
                if let Initial::Given(value) = initial {
                    parts.push(format!("{gives}0 = {}", plain(value)));
                }
                parts
            }
            _ => vec![],
        }
    }

    /// The law of a field's port, and its start; of one that is given by a matrix the start alone.
    fn port_law(&self, id: VertexId, port: u32, law: &Law, laws: bool) -> Vec<String> {
        let number = port + 1;
        let own = |expr: &Expr| {
            let pieces = self.pieces(expr, true);
            print(&pieces, Dialect::Bond, &mut |piece| match piece {
                Piece::Text(text) => text.clone(),
                Piece::Leaf(Leaf::Stored(end)) if end.vertex == id => {
                    let compliance = self.graph.storage(*end) == Some(Storage::Compliance);
                    format!("{}{}", if compliance { "q" } else { "p" }, end.port + 1)
                }
                Piece::Leaf(leaf @ Leaf::Bond { bond, variable, negated }) => {
                    let bonds = &self.graph.vertex(id).bonds;
                    let Some(k) = bonds.iter().position(|own| own == bond) else {
                        return self.leaf(leaf, "");
                    };
                    let out = self.graph.sign_into(*bond, id, k as u32) < 0.0;
                    let turned = *variable == Power::Flow && out != *negated;
                    let text = format!("{}{}", letter(*variable), k + 1);
                    if turned { format!("(-{text})") } else { text }
                }
                Piece::Leaf(leaf) => self.leaf(leaf, ""),
            })
        };
        let mut parts = vec![];
        match law {
            Law::Dissipator(Dissipation::Effort(law)) if laws => {
                parts.push(format!("e{number} = {}", own(law)));
            }
            Law::Dissipator(Dissipation::Flow(law)) if laws => {
                parts.push(format!("f{number} = {}", own(law)));
            }
            Law::Store { kind, law, initial } => {
                let (gives, stored) = match kind {
                    Storage::Compliance => ("e", "q"),
                    Storage::Inertia => ("f", "p"),
                };
                if laws {
                    parts.push(match law {
                        StoreLaw::OfStored(law) | StoreLaw::Linear(law) => {
                            format!("{gives}{number} = {}", own(law))
                        }
                        StoreLaw::OfPower(law) => format!("{stored}{number} = {}", own(law)),
                    });
                }
                let start = match initial {
                    StoreInitial::Stored(value) => Some((stored, value)),
                    StoreInitial::Power(value) => Some((gives, value)),
                    StoreInitial::Unstated => None,
                };
                if let Some((letter, value)) = start {
                    parts.push(format!("{letter}{number}_0 = {}", self.expr(value, "")));
                }
            }
            _ => {}
        }
        parts
    }
}

/// Where a storage starts, as far as it is said.
pub(super) fn initials(law: &Law) -> Vec<&Expr> {
    match law {
        Law::Store {
            initial: StoreInitial::Stored(value) | StoreInitial::Power(value), ..
        }
        | Law::Rate { initial: Initial::Given(value), .. } => vec![value],
        Law::Field(field) => field.ports.iter().flat_map(initials).collect(),
        _ => vec![],
    }
}
