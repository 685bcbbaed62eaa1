//! Two equal lines that are driven against each other, lumped into one. (Langlois et al. 2005, III.F and Fig. 11.)
//!
//! Let every part of line 2 be the mirror of one of line 1: equal linear or odd laws, and half arrows such that what one
//! line takes the other gives. Then e1 = m + e/2 and e2 = m − e/2 at their 0-junctions, with a mean m that stays as it
//! was at the start. One line with the effort e = e1 − e2 and the flow of the first does the same: R and I count twice, C
//! half. What lies between the lines has the effort e already, and two-ports into them keep their ratios.
//!
//! Signs. As much power goes into a part of one line as into its mirror. So of two bonds whose efforts have opposite signs
//! the flows have, too, where their half arrows point alike, and are equal where they point against each other: that says
//! of two 1-junctions whether their flows are equal or opposite, and must say the same at all their bonds.

use super::across::factor;
use super::arguments::Scaling;
use super::factor::{Factor, level};
use super::plan::{Change, Plan, Read};
use super::{Source, Trouble};
use crate::bond::graph::{
    BondId, Dissipation, Expr, Law, Leaf, Modulus, StoreInitial, StoreLaw, VertexId,
};
use crate::bond::words;
use crate::diagnostic::Diagnostic;
use crate::expr::print::number;
use std::collections::HashMap;

/// Two numbers that differ by less than this are the same.
const SAME: f64 = 1e-12;

struct Lines<'s> {
    source: &'s Source,
    /// By part of either line, the other's.
    partner: HashMap<VertexId, VertexId>,
    /// Pairs, the first line's part first, in the order found.
    pairs: Vec<(VertexId, VertexId)>,
    /// By part of the first line, what its own effort and flow are in the second: 1 the same, −1 with the other sign; of
    /// 1-junctions that of their flow.
    sign: HashMap<VertexId, f64>,
    plan: Plan,
}

/// Lumps the lines that two junctions stand in, the first of which stays.
///
/// # Errors
/// Which pair differs, or what else is not symmetric.
pub fn lump(source: &Source, first: &str, second: &str) -> Result<Plan, Trouble> {
    let (a, b) = (source.find(first)?, source.find(second)?);
    let mut lines = Lines {
        source,
        partner: HashMap::new(),
        pairs: vec![],
        sign: HashMap::new(),
        plan: Plan::default(),
    };
    for id in [a, b] {
        if source.graph.vertex(id).kind != "0" {
            return Err(lines.refuse(id, id, "lines are named by two 0-junctions, one in each"));
        }
    }
    if a == b {
        return Err(lines.refuse(a, b, "they are the same junction"));
    }
    lines.pair(a, b);
    let mut next = 0;
    while let Some(&(x, y)) = lines.pairs.get(next) {
        lines.follow(x, y)?;
        next += 1;
    }
    let mean = lines.mean()?;
    lines.finish(mean.as_ref())
}

impl Lines<'_> {
    fn pair(&mut self, x: VertexId, y: VertexId) {
        self.partner.insert(x, y);
        self.partner.insert(y, x);
        self.pairs.push((x, y));
    }

    fn refuse(&self, x: VertexId, y: VertexId, why: &str) -> Trouble {
        let (x, y) = (self.source.graph.vertex(x), self.source.graph.vertex(y));
        let names = if x.name == y.name {
            format!("`{}`", x.name)
        } else {
            format!("`{}` and `{}`", x.name, y.name)
        };
        let message = format!("the lines cannot be lumped at {names}: {why}");
        let error = Diagnostic::error("E1102", x.span, message).says("in the first line");
        Box::new(if x.name == y.name { error } else { error.label(y.span, "in the second") })
    }

    /// Whether a bond points into a vertex.
    fn heads(&self, bond: BondId, id: VertexId) -> bool {
        self.source.graph.bond(bond).to.vertex == id
    }

    /// Pairs what hangs on a pair.
    fn follow(&mut self, x: VertexId, y: VertexId) -> Result<(), Trouble> {
        let graph = &self.source.graph;
        self.equal(x, y)?;
        if graph.vertex(x).bonds.len() == 1 {
            return Ok(());
        }
        let mut left: Vec<BondId> = graph.vertex(y).bonds.clone();
        for bond in &graph.vertex(x).bonds {
            let near = self.source.beyond(*bond, x);
            let mut found = left.iter().enumerate().filter(|(_, other)| {
                let far = self.source.beyond(**other, y);
                match self.partner.get(&near) {
                    Some(known) => *known == far,
                    None if near == far => true,
                    None => {
                        !self.partner.contains_key(&far)
                            && graph.vertex(near).kind == graph.vertex(far).kind
                            && graph.vertex(near).bonds.len() == graph.vertex(far).bonds.len()
                    }
                }
            });
            // Of several the one with the same law, where there is one.
            let all: Vec<(usize, BondId)> = found.by_ref().map(|(k, bond)| (k, *bond)).collect();
            let best = all.iter().find(|(_, other)| {
                let far = self.source.beyond(*other, y);
                near == far
                    || self.partner.get(&near) == Some(&far)
                    || (self.equal(near, far).is_ok() && self.hangs_on(near) == self.hangs_on(far))
            });
            let Some((k, other)) = best.or(all.first()).copied() else {
                let why = format!("`{}` hangs on the first alone", self.source.title(near));
                return Err(self.refuse(x, y, &why));
            };
            left.remove(k);
            if near == y {
                return Err(self.refuse(x, y, "they are bonded to each other"));
            }
            self.same_ratio((x, *bond), (y, other))?;
            let far = self.source.beyond(other, y);
            let against = self.heads(*bond, x) != self.heads(other, y);
            if near == far {
                if graph.vertex(near).kind != "1" {
                    let why =
                        format!("`{}` has an effort in common with both", self.source.title(near));
                    return Err(self.refuse(x, y, &why));
                }
                if !against {
                    let why = format!(
                        "the half arrows at `{}` drive both alike, not against each other",
                        self.source.title(near)
                    );
                    return Err(self.refuse(x, y, &why));
                }
                self.plan.cut.insert(other);
                self.set_sign((x, y), x, 1.0)?;
                continue;
            } else if !self.partner.contains_key(&near) {
                self.pair(near, far);
            }
            self.note_sign((x, y), near, against)?;
        }
        if let Some(bond) = left.first() {
            let why = format!(
                "`{}` hangs on the second alone",
                self.source.title(self.source.beyond(*bond, y))
            );
            return Err(self.refuse(x, y, &why));
        }
        Ok(())
    }

    /// The laws of what hangs on a junction alone: of several branches the one with the same is its mirror.
    fn hangs_on(&self, id: VertexId) -> Vec<String> {
        let near =
            self.source.graph.vertex(id).bonds.iter().map(|bond| self.source.beyond(*bond, id));
        let laws = near.map(|near| self.source.graph.vertex(near));
        let mut laws: Vec<String> = laws
            .filter(|vertex| vertex.bonds.len() == 1)
            .map(|vertex| self.words(&vertex.law))
            .collect();
        laws.sort();
        laws
    }

    /// What a bond of a pair, and whether its mirror points against it, says of signs.
    fn note_sign(
        &mut self,
        (x, y): (VertexId, VertexId),
        near: VertexId,
        against: bool,
    ) -> Result<(), Trouble> {
        let graph = &self.source.graph;
        let one = |id: VertexId| graph.vertex(id).kind == "1";
        let one_port = |id: VertexId| graph.vertex(id).bonds.len() == 1;
        let by_arrows = if against { 1.0 } else { -1.0 };
        match (one(x), one(near)) {
            (true, true) => {
                let known = self.sign.get(&x).or(self.sign.get(&near)).copied();
                let Some(sign) = known else { return Ok(()) };
                self.set_sign((x, y), x, sign)?;
                self.set_sign((x, y), near, sign)
            }
            (true, false) if one_port(near) => {
                let sign = self.sign.get(&x).copied().unwrap_or(1.0);
                self.set_sign((x, y), near, -sign * by_arrows)
            }
            (true, false) => self.set_sign((x, y), x, by_arrows),
            (false, true) => self.set_sign((x, y), near, by_arrows),
            (false, false) if one_port(near) => self.set_sign((x, y), near, -1.0),
            (false, false) => Ok(()),
        }
    }

    fn set_sign(
        &mut self,
        (x, y): (VertexId, VertexId),
        of: VertexId,
        sign: f64,
    ) -> Result<(), Trouble> {
        if self.source.graph.vertex(of).kind == "0" || *self.sign.entry(of).or_insert(sign) == sign
        {
            return Ok(());
        }
        Err(self.refuse(x, y, "their half arrows are not each other's mirror"))
    }

    /// Whether two laws are the same, and such as the difference of the two lines may have.
    fn equal(&self, x: VertexId, y: VertexId) -> Result<(), Trouble> {
        let graph = &self.source.graph;
        let (a, b) = (graph.vertex(x), graph.vertex(y));
        if a.kind.trim_start_matches('M') != b.kind.trim_start_matches('M') {
            return Err(self.refuse(x, y, "they are not of one kind"));
        }
        match (&a.law, &b.law) {
            (Law::Zero, Law::Zero) | (Law::One, Law::One) => return Ok(()),
            // Their ratios are compared where their ports are known.
            (Law::Transformer(_), Law::Transformer(_)) => {
                factor(self.source, x)?;
                factor(self.source, y)?;
                return Ok(());
            }
            (Law::Gyrator(_), _) => {
                let why = "behind a gyrator efforts and flows are exchanged: move it away first";
                return Err(self.refuse(x, y, why));
            }
            (Law::Source { detector: true, .. }, _) => return Ok(()),
            (Law::Source { .. }, _) => {
                return Err(self.refuse(
                    x,
                    y,
                    "sources drive both lines alike; leave them out first",
                ));
            }
            (Law::Store { law: StoreLaw::Linear(_), initial, .. }, _) => {
                let stored = matches!(initial, StoreInitial::Stored(_)) || a.kind.ends_with('I');
                if stored && !matches!(initial, StoreInitial::Unstated) {
                    return Err(self.refuse(x, y, "state their starts as `e0`, or not at all"));
                }
            }
            (Law::Dissipator(Dissipation::Linear(_)), _) => {}
            (Law::Dissipator(Dissipation::Effort(law) | Dissipation::Flow(law)), _) => {
                if !self.odd(law) {
                    let why = "the law is not odd: it does not treat both directions alike";
                    return Err(self.refuse(x, y, why));
                }
            }
            _ => return Err(self.refuse(x, y, "their laws are not linear")),
        }
        let (first, second) = (self.words(&a.law), self.words(&b.law));
        if first != second {
            return Err(self.refuse(x, y, &format!("{first} is not {second}")));
        }
        Ok(())
    }

    /// Whether two transformers, joined by these bonds, are each other's mirror.
    fn same_ratio(
        &self,
        (x, bond): (VertexId, BondId),
        (y, other): (VertexId, BondId),
    ) -> Result<(), Trouble> {
        let graph = &self.source.graph;
        let (Law::Transformer(r), Law::Transformer(s)) =
            (&graph.vertex(x).law, &graph.vertex(y).law)
        else {
            return Ok(());
        };
        let ratio = |modulus: &Modulus| match modulus {
            Modulus::Ratio(value) => self.constant(value).unwrap_or(f64::NAN),
            Modulus::Gain(value) => self.constant(value).map_or(f64::NAN, f64::recip),
        };
        let port = |id: VertexId, bond| graph.vertex(id).bonds.iter().position(|b| *b == bond);
        let turned = port(x, bond) != port(y, other);
        let (r, s) = (ratio(r), if turned { ratio(s).recip() } else { ratio(s) });
        if (r - s).abs() <= SAME * r.abs() {
            return Ok(());
        }
        Err(self.refuse(x, y, &format!("seen from the same side their ratios are {r} and {s}")))
    }

    /// A law with the values of its parameters.
    fn words(&self, law: &Law) -> String {
        let mut law = law.clone();
        law.expressions_mut(&mut |expr| *expr = self.valued(expr));
        if let Law::Store { initial: StoreInitial::Power(value), .. } = &mut law {
            *value = self.valued(value);
        }
        words::law(&self.source.graph, &law)
    }

    fn valued(&self, expr: &Expr) -> Expr {
        let valued = expr.map(&mut |leaf, span| match leaf {
            Leaf::Parameter(id) => {
                let value = self.source.graph.parameters[id.index()].value;
                Expr::new(crate::expr::Node::Number(value), span)
            }
            other => Expr::new(crate::expr::Node::Leaf(other.clone()), span),
        });
        valued.constant().map_or(valued, Expr::number)
    }

    fn constant(&self, expr: &Expr) -> Option<f64> {
        self.valued(expr).constant()
    }

    /// Whether a law changes sign with its variable; one that reads anything else does not count.
    fn odd(&self, law: &Expr) -> bool {
        let mut alone = true;
        law.leaves(&mut |leaf, _| alone &= matches!(leaf, Leaf::Parameter(_) | Leaf::Own(_)));
        let at = |x: f64| {
            law.evaluate(&mut |leaf| match leaf {
                Leaf::Parameter(id) => self.source.graph.parameters[id.index()].value,
                _ => x,
            })
        };
        let points = (-9..10).flat_map(|n| [1.0, 3.7].map(|m| m * 10f64.powi(n)));
        alone
            && points.into_iter().all(|x| {
                let (a, b) = (at(x), at(-x));
                !a.is_finite() || (a + b).abs() <= 1e-9 * a.abs().max(b.abs())
            })
    }

    /// The effort that both lines start from, as text with how tightly it binds.
    fn mean(&self) -> Result<Option<(String, u8)>, Trouble> {
        let mut mean: Option<(f64, String, u8)> = None;
        for (x, y) in &self.pairs {
            let Law::Store { initial, .. } = &self.source.graph.vertex(*x).law else { continue };
            if self.source.graph.vertex(*x).kind.ends_with('I') {
                continue;
            }
            let value = match initial {
                StoreInitial::Power(value) => self.constant(value).unwrap_or(f64::NAN),
                _ => 0.0,
            };
            let (text, level) = self.start_text(*x).unwrap_or_else(|| (number(value), 2));
            match &mean {
                Some((known, ..))
                    if (known - value).abs() > SAME * known.abs() || value.is_nan() =>
                {
                    return Err(self.refuse(*x, *y, "not all compliances of a line start alike"));
                }
                Some(_) => {}
                None => mean = Some((value, text, level)),
            }
        }
        let Some((value, text, level)) = mean.filter(|(value, ..)| *value != 0.0) else {
            return Ok(None);
        };
        for (x, y) in &self.pairs {
            let vertex = self.source.graph.vertex(*x);
            let on_zero = |id: VertexId| {
                let junction = self.source.beyond(self.source.graph.vertex(id).bonds[0], id);
                self.source.graph.vertex(junction).kind == "0"
            };
            let stores = matches!(vertex.law, Law::Store { .. }) && vertex.kind.ends_with('C');
            if stores && self.sign.get(x).is_some_and(|sign| *sign > 0.0) {
                let why = "they lie along the lines, so that their starts do not cancel";
                return Err(self.refuse(*x, *y, why));
            }
            if matches!(vertex.law, Law::Dissipator(_)) && on_zero(*x) {
                let why = format!("they let the mean effort of {} go", number(value));
                return Err(self.refuse(*x, *y, &why));
            }
        }
        Ok(Some((text, level)))
    }

    fn start_text(&self, id: VertexId) -> Option<(String, u8)> {
        let declared = self.source.declared.get(&id)?;
        declared.arguments.iter().flatten().find_map(|argument| {
            let label = argument.label.as_ref()?;
            match &argument.value {
                crate::bond::syntax::Value::Expr(expr) if label.name.text == "e0" => {
                    Some((self.source.slice(expr.span).to_string(), level(expr)))
                }
                _ => None,
            }
        })
    }

    fn finish(mut self, mean: Option<&(String, u8)>) -> Result<Plan, Trouble> {
        let graph = &self.source.graph;
        let scaling = Scaling::Scaled { factor: Factor::number(2), effort: 1, flow: 0 };
        let mut names = [vec![], vec![]];
        let with_mean = |sign: char, half: &str| match (mean, sign) {
            (Some((mean, _)), sign) => format!("({mean} {sign} {half})"),
            (None, '-') => format!("(-{half})"),
            (None, _) => format!("({half})"),
        };
        for (x, y) in &self.pairs {
            let (a, b) = (graph.vertex(*x), graph.vertex(*y));
            names[0].push(a.name.clone());
            names[1].push(b.name.clone());
            self.plan.gone.insert(*y);
            self.plan.cut.extend(b.bonds.iter().copied());
            self.plan.laws.insert(*x, Change::Lumped(scaling.clone()));
            let half = format!("e({})/2", a.name);
            let sign = self.sign.get(x).copied().unwrap_or(-1.0);
            let minus = if sign < 0.0 { "-" } else { "" };
            let mut read = |what: &'static str, of: &str, text: String| {
                self.plan.readings.push((Read::Of(what, of.to_string()), text));
            };
            match a.kind.trim_start_matches('M') {
                "0" => {
                    read("e", &a.name, with_mean('+', &half));
                    read("e", &b.name, with_mean('-', &half));
                }
                "C" if sign < 0.0 => {
                    read("e", &a.name, with_mean('+', &half));
                    read("e", &b.name, with_mean('-', &half));
                }
                "1" => {
                    read("f", &a.name, format!("f({})", a.name));
                    read("f", &b.name, format!("({minus}f({}))", a.name));
                }
                _ => {
                    read("e", &a.name, format!("({half})"));
                    read("e", &b.name, format!("({minus}{half})"));
                }
            }
            if a.kind.ends_with('C')
                && let (Some((mean, own)), Some((value, expr))) = (mean, self.source.value(*x))
            {
                let value = super::factor::at(&value, expr.map_or(2, level), 1);
                let mean = super::factor::at(mean, *own, 1);
                read("q", &a.name, format!("({value}*{mean} + q({}))", a.name));
            }
            if !matches!(a.kind, "0" | "1") && a.bonds.len() == 1 {
                read("f", &a.name, format!("f({})", a.name));
                read("f", &b.name, format!("({minus}f({}))", a.name));
            }
        }
        let about = mean.map_or(String::new(), |(mean, _)| format!(" {mean}"));
        self.plan.why = format!(
            "Two lines in one: {} with {}. They are equal and driven against each other, so that the efforts of the second \
             are those of the first with the other sign about their mean{about}: e({}) is now the difference of both, the \
             flow is that of each. R and I count twice, C half; what lies between the lines stays.",
            names[0].join(", "),
            names[1].join(", "),
            names[0].first().map_or("", String::as_str),
        );
        Ok(self.plan)
    }
}
