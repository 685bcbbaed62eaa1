//! Units checked: parameters, signals, what drives inputs, and the laws of elements against the domains of their bonds.

use super::clashes::{Clash, Side, hint, merge};
use super::dimensions::{Dim, SECOND, Walk};
use super::domains::{Told, across, domain_of};
use super::frames::Here;
use super::scope::{Meaning, Scope};
use super::stated::{Clue, Stands, Stated, domains, modulus, stated};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::bond::syntax;
use crate::diagnostic::Diagnostic;
use crate::quantity::{Dimension, Domain};
use crate::source::Span;

/// Ways between elements are looked for this often at most: each costs a walk over the graph.
const MOST_WAYS: usize = 20;

impl<'a> Scope<'a> {
    /// Finds what is known of units, and checks that it agrees.
    pub fn check_units(&mut self, d: &mut Vec<Diagnostic>) {
        self.infer_units();
        let mut clashes = vec![];
        for k in 0..self.parameters.len() {
            if let Some((value, here)) = self.parameter_value(k) {
                self.check_at(here, value, &mut clashes);
            }
        }
        for source in self.sources().into_iter().flatten() {
            self.check_at(source.here(), source.expr(), &mut clashes);
        }
        self.check_drives(&mut clashes);
        self.check_defaults(&mut clashes);
        self.check_regulators(&mut clashes);
        self.here = Here::ROOT;
        self.check_settings(&mut clashes);
        self.check_ports_domains(&mut clashes);
        let mut found: Vec<Stated<'a>> = vec![];
        for id in self.graph.vertex_ids() {
            let declaration = self.declarations[id.index()];
            self.here = declaration.here;
            let shape = declaration.element.shape;
            if shape.is_two_port() {
                self.check_two_port(id, &mut clashes);
            } else if !shape.is_junction() {
                stated(&declaration, &mut found);
                self.check_one_port(id, &found, &mut clashes);
            }
        }
        self.here = Here::ROOT;
        // In the order of the text, so that of several with one cause the first is told whole.
        clashes.sort_by_key(|clash| {
            let span = clash.diagnostic.labels.first().map_or(Span::NONE, |label| label.span);
            (span.file.0, span.start)
        });
        self.units.blamed.extend(clashes.iter().flat_map(|clash| clash.names.iter().copied()));
        d.extend(merge(clashes));
    }

    /// The dimension of an expression that stands where the scope is, checked; a mistake that has been reported is not
    /// reported again.
    pub fn checked_dimension(&mut self, expr: &syntax::Expr, d: &mut Vec<Diagnostic>) -> Dim {
        let mut clashes = vec![];
        let dim = self.check_in(expr, None, &mut clashes);
        clashes.retain(|clash| !clash.names.iter().any(|name| self.units.blamed.contains(name)));
        d.extend(merge(clashes));
        dim
    }

    fn check_at(&mut self, here: Here, value: &syntax::Expr, clashes: &mut Vec<Clash>) {
        self.here = here;
        self.check_in(value, None, clashes);
    }

    fn check_in(
        &mut self,
        value: &syntax::Expr,
        own: Option<VertexId>,
        clashes: &mut Vec<Clash>,
    ) -> Dim {
        let mut walk = Walk::new(self, own);
        walk.clashes = Some(clashes);
        walk.dimension(value)
    }

    /// What drives an input instead of something else must be of its unit.
    fn check_drives(&mut self, clashes: &mut Vec<Clash>) {
        let drives = std::mem::take(&mut self.units.drives);
        for (id, source) in &drives {
            let Some(declared) = self.signal_dimensions[id.index()].known() else { continue };
            self.here = source.here();
            let Dim::Known(found) = self.dimension(source.expr(), None) else { continue };
            if found == declared {
                continue;
            }
            let side = Side::of(self, source.expr(), found);
            let name = &self.graph.signals[id.index()].name;
            let needed = declared.describe(None);
            let message =
                format!("the input `{name}` is {needed} and is driven with {}", side.words);
            let error = Diagnostic::error("E0303", source.expr().span, message)
                .says(side.words.clone())
                .label(
                    self.units.said.get(id.index()).copied().unwrap_or(Span::NONE),
                    needed.clone(),
                )
                .help("an input gets values of one unit");
            clashes.push(Clash::new(error).explain(&[&side]));
        }
        self.units.drives = drives;
    }

    /// What an instance is given must be of the unit of the model's default.
    fn check_defaults(&mut self, clashes: &mut Vec<Clash>) {
        for (k, default) in self.defaults().into_iter().enumerate() {
            let Some((default, inner)) = default else { continue };
            self.here = inner;
            let declared = self.dimension(default, None);
            let Some((value, outer)) = self.parameter_value(k) else { continue };
            self.here = outer;
            let given = self.dimension(value, None);
            let (Dim::Known(declared), Dim::Known(given)) = (declared, given) else { continue };
            if declared == given {
                continue;
            }
            let side = Side::of(self, value, given);
            let name = &self.graph.parameters[k].name;
            let needed = declared.describe(None);
            let message = format!("the parameter `{name}` is {needed} and is given {}", side.words);
            let error = Diagnostic::error("E0303", value.span, message)
                .says(side.words.clone())
                .label(default.span, needed)
                .help("the default of a parameter says its unit");
            let mut clash = Clash::new(error).explain(&[&side]);
            clash.names.push(Meaning::Parameter(ParameterId(k as u32)));
            clashes.push(clash);
        }
    }

    /// What a regulator controls follows a value of its unit, with a bandwidth and a margin.
    fn check_regulators(&mut self, clashes: &mut Vec<Clash>) {
        const RATE: Dimension = Dimension::new(0, 0, -1, 0, 0);
        for at in 0..self.regulators.len() {
            let (regulator, here) = self.regulators[at];
            self.here = here;
            let (controlled, reference) = (&regulator.controlled, &regulator.reference);
            let one = self.check_in(controlled, None, clashes);
            let two = self.check_in(reference, None, clashes);
            if let (Dim::Known(one), Dim::Known(two)) = (one, two)
                && one != two
            {
                let (a, b) = (Side::of(self, controlled, one), Side::of(self, reference, two));
                clashes.push(Clash::follows(&a, &b).explain(&[&b, &a]));
            }
            for (value, what, needed) in [
                (&regulator.bandwidth, "bandwidth", RATE),
                (&regulator.margin, "margin", Dimension::NONE),
            ] {
                let Some(value) = value else { continue };
                let Dim::Known(found) = self.check_in(value, None, clashes) else { continue };
                if found == needed {
                    continue;
                }
                let side = Side::of(self, value, found);
                let unit = if needed.is_none() { "deg" } else { "rad/s" };
                let message = format!("the {what} of a loop is {}", side.words);
                let error = Diagnostic::error("E0303", value.span, message)
                    .says(side.words.clone())
                    .help(format!("give it in a unit like {unit}"));
                clashes.push(Clash::new(error).explain(&[&side]));
            }
        }
    }

    /// What the command line sets must be of the parameter's unit.
    fn check_settings(&mut self, clashes: &mut Vec<Clash>) {
        for at in 0..self.set.len() {
            let setting = &self.set[at];
            let (Some(id), Some(value), text) = (setting.taken, setting.value, setting.text) else {
                continue;
            };
            let declared = self.parameter_dimensions[id.index()];
            let given = self.check_in(value, None, clashes);
            let (Dim::Known(declared), Dim::Known(given)) = (declared, given) else { continue };
            if declared == given {
                continue;
            }
            let side = Side::of(self, value, given);
            let name = &self.graph.parameters[id.index()].name;
            let place =
                self.parameter_value(id.index()).map_or(Span::NONE, |(value, _)| value.span);
            let error = Diagnostic::error(
                "E0303",
                Span::NONE,
                format!("`{text}` is no value for `{name}`"),
            )
            .label(place, format!("`{name}` is {}", declared.describe(None)))
            .because(format!("`{text}` is {}", side.words))
            .help(format!("set it in a unit like {}", declared.si()));
            clashes.push(Clash::new(error).explain(&[&side]));
        }
    }

    /// Ports of models that name different domains for one bond.
    fn check_ports_domains(&mut self, clashes: &mut Vec<Clash>) {
        for port in &self.ports {
            let (Some((domain, span)), Some(bond)) = (port.domain, port.bond) else { continue };
            let Some(told) = self.units.groups.told(bond) else { continue };
            if domain == Domain::Any || domain == told.domain {
                continue;
            }
            let message = format!(
                "the port `{}` is {}, but its bond is {}",
                port.name,
                domain.name(),
                told.domain.name()
            );
            let error = Diagnostic::error("E0308", span, message)
                .says(format!("declared as {}", domain.name()));
            let error = self
                .point_at_told(error, told)
                .label(self.graph.bond(bond).span, "the bond")
                .help("domains meet only across a transformer, a gyrator or a signal");
            clashes.push(Clash::new(error));
        }
    }

    /// What an element states of its bonds against their domains.
    fn check_one_port(&mut self, id: VertexId, found: &[Stated<'a>], clashes: &mut Vec<Clash>) {
        let mut failed = false;
        for stated in found {
            let before = clashes.len();
            let dim = {
                let mut walk = Walk::new(self, Some(id));
                walk.clashes = Some(clashes);
                stated.value.dimension(&mut walk)
            };
            let Dim::Known(dimension) = dim else { continue };
            let bonds = &self.graph.vertex(id).bonds;
            let at = |port: usize| bonds.get(port).and_then(|bond| self.units.groups.told(*bond));
            let (Some(told), Some(other)) = (at(stated.ports.0), at(stated.ports.1)) else {
                continue;
            };
            let needed = stated.clue.between(told.domain, other.domain);
            let needed = match stated.rate {
                true => needed.and_then(|needed| needed.over(SECOND)),
                false => needed,
            };
            let Some(needed) = needed.filter(|needed| *needed != dimension) else { continue };
            // One mistake in an element gives one error.
            if !std::mem::replace(&mut failed, true) && clashes.len() == before {
                let at_home = stated.label.is_some()
                    && found.iter().any(|other| self.fits(id, other, stated, told.domain));
                clashes.push(self.misfit(id, stated, (dimension, needed), told, at_home));
            }
        }
    }

    /// Whether what an element states beside one value is of the domain of that one's bond.
    fn fits(&mut self, id: VertexId, other: &Stated<'a>, one: &Stated<'a>, domain: Domain) -> bool {
        if other.ports != one.ports || other.value.span() == one.value.span() {
            return false;
        }
        let mut walk = Walk::new(self, Some(id));
        let needed = other.clue.between(domain, domain);
        let needed = if other.rate { needed.and_then(|n| n.over(SECOND)) } else { needed };
        needed.is_some() && other.value.dimension(&mut walk).known() == needed
    }

    /// The error for a value that does not fit its bond. `at_home`: the element does, by what else it states.
    fn misfit(
        &mut self,
        id: VertexId,
        stated: &Stated<'a>,
        (dimension, needed): (Dimension, Dimension),
        told: Told,
        at_home: bool,
    ) -> Clash {
        let expr = stated.value.expr();
        let side = Side::of(self, &expr, dimension);
        let declaration = self.declarations[id.index()];
        let (noun, name) = (declaration.element.noun, self.graph.vertex(id).name.clone());
        let needed_words = needed.describe(None);
        let domain = told.domain.name();
        let of = match stated.label {
            Some(label) => format!("`{} = …` of the {noun} `{name}`", self.map.text(label)),
            None => format!("the value of the {noun} `{name}`"),
        };
        let other = match stated.rate || stated.ports.0 != stated.ports.1 || at_home {
            true => None,
            false => domains(stated.clue.fitting(dimension)).next(),
        };
        let span = stated.value.span();
        let error = match other {
            // Of the domain that the unit tells.
            Some(other) => Diagnostic::error(
                "E0308",
                span,
                format!(
                    "the {noun} `{name}` is of domain {}, but its bond is {domain}",
                    other.name()
                ),
            )
            .says(format!("{}: {}", other.name(), side.words)),
            None => Diagnostic::error(
                "E0307",
                span,
                format!("{of} is {}, but its {domain} bond needs {needed_words}", side.words),
            )
            .says(side.words.clone()),
        };
        let mut error = self.point_at_told(error, told);
        if other.is_some()
            && let Some(root) = self.root_of(told)
            && let Some(way) = self.limited_way(root, id)
        {
            error = error.because(format!("the bonds between them: {way}"));
        }
        let help = match (other, self.other_source(stated.clue, dimension, told.domain)) {
            (_, Some(kind)) => format!("for {} write `{kind}:{name}`", side.words),
            (Some(_), None) => format!(
                "{domain} and another domain meet only across a transformer, a gyrator or a signal; \
                 or write {needed_words}"
            ),
            (None, None) => format!("write it in a unit like {}", needed.si()),
        };
        Clash::new(hint(error, &[&side], &help)).explain(&[&side])
    }

    /// The other kind of source, where the value is what that one sets.
    fn other_source(
        &self,
        clue: Clue,
        dimension: Dimension,
        domain: Domain,
    ) -> Option<&'static str> {
        match clue {
            Clue::Effort if dimension == domain.row().flow_dimension => Some("Sf"),
            Clue::Flow if dimension == domain.row().effort_dimension => Some("Se"),
            _ => None,
        }
    }

    fn limited_way(&mut self, from: VertexId, to: VertexId) -> Option<String> {
        if self.units.ways >= MOST_WAYS {
            return None;
        }
        self.units.ways += 1;
        self.way(from, to)
    }

    /// A two-port's ratio against the domains on its sides.
    fn check_two_port(&mut self, id: VertexId, clashes: &mut Vec<Clash>) {
        let declaration = self.declarations[id.index()];
        let Some((value, gain)) = modulus(&declaration) else { return };
        let before = clashes.len();
        let dim = {
            let mut walk = Walk::new(self, None);
            walk.clashes = Some(clashes);
            value.dimension(&mut walk)
        };
        let &[one, two] = self.graph.vertex(id).bonds.as_slice() else { return };
        let (one, two) = (self.units.groups.told(one), self.units.groups.told(two));
        if clashes.len() > before {
            return;
        }
        let shape = declaration.element.shape;
        let clash = match (one, two, dim) {
            (Some(one), Some(two), _) if one.domain.row().pseudo != two.domain.row().pseudo => {
                Some(self.pseudo(id, value, one, two))
            }
            (Some(one), Some(two), Dim::Known(ratio)) => {
                let fits = |gain| {
                    across(shape, one.domain, true, ratio, gain).and_then(domain_of)
                        == Some(two.domain)
                };
                (!fits(gain))
                    .then(|| self.wrong_ratio(id, (value, gain), ratio, (one, two), fits(!gain)))
            }
            (Some(known), None, Dim::Known(ratio)) | (None, Some(known), Dim::Known(ratio)) => {
                let leads = |gain| across(shape, known.domain, one.is_some(), ratio, gain);
                match leads(gain).and_then(domain_of) {
                    Some(domain) if domain.row().pseudo == known.domain.row().pseudo => None,
                    Some(domain) => {
                        let other = Told { domain, by: super::domains::By::Across(id, u32::MAX) };
                        let (one, two) =
                            if one.is_some() { (known, other) } else { (other, known) };
                        Some(self.pseudo(id, value, one, two))
                    }
                    None => leads(gain).map(|far| {
                        let inverse = leads(!gain).and_then(domain_of);
                        self.nowhere(id, (value, gain), ratio, known, far, inverse)
                    }),
                }
            }
            _ => None,
        };
        clashes.extend(clash);
    }

    /// The error for a ratio that does not lead from one side to the other.
    fn wrong_ratio(
        &mut self,
        id: VertexId,
        (value, gain): (Stands<'a>, bool),
        ratio: Dimension,
        (one, two): (Told, Told),
        inverse_fits: bool,
    ) -> Clash {
        let expr = value.expr();
        let side = Side::of(self, &expr, ratio);
        let declaration = self.declarations[id.index()];
        let (noun, name) = (declaration.element.noun, self.graph.vertex(id).name.clone());
        let (first, second) = (one.domain.row(), two.domain.row());
        let what = if gain { "gain" } else { "ratio" };
        let message = format!(
            "the {what} of the {noun} `{name}` does not lead from {} to {}",
            first.name, second.name
        );
        let error = Diagnostic::error("E0309", value.span(), message).says(side.words.clone());
        let error = self.point_at_told(self.point_at_told(error, one), two);
        let transformer = declaration.element.shape == Shape::Transformer;
        let below = if transformer { second.effort_dimension } else { second.flow_dimension };
        let needed = first.effort_dimension.over(below);
        let needed = if gain { needed.and_then(|n| n.power(-1, 1)) } else { needed };
        let help = match needed.filter(|_| consistent(transformer, one.domain, two.domain)) {
            _ if inverse_fits => self.inverse_help(gain, transformer),
            Some(needed) => format!("{}: here {}", law(transformer, gain), needed.describe(None)),
            None => format!("no {noun} joins {} and {}", first.name, second.name),
        };
        let error = self.with_inverse(hint(error, &[&side], &help), value, gain, inverse_fits);
        Clash::new(error).explain(&[&side])
    }

    /// The error for a ratio that leads to no domain.
    fn nowhere(
        &mut self,
        id: VertexId,
        (value, gain): (Stands<'a>, bool),
        ratio: Dimension,
        known: Told,
        (effort, flow): (Dimension, Dimension),
        inverse: Option<Domain>,
    ) -> Clash {
        let expr = value.expr();
        let side = Side::of(self, &expr, ratio);
        let declaration = self.declarations[id.index()];
        let (noun, name) = (declaration.element.noun, self.graph.vertex(id).name.clone());
        let transformer = declaration.element.shape == Shape::Transformer;
        let message =
            format!("the {noun} `{name}` leads from {} to no known domain", known.domain.name());
        let error = Diagnostic::error("E0310", value.span(), message).says(side.words.clone());
        let error = self.point_at_told(error, known).because(format!(
            "on its other side the effort would be {}, the flow {}",
            effort.describe(None),
            flow.describe(None)
        ));
        let help = match inverse {
            Some(domain) => {
                format!("{}, to {}", self.inverse_help(gain, transformer), domain.name())
            }
            None => law(transformer, gain).to_string(),
        };
        let error = self.with_inverse(hint(error, &[&side], &help), value, gain, inverse.is_some());
        Clash::new(error).explain(&[&side])
    }

    fn inverse_help(&self, gain: bool, transformer: bool) -> String {
        let other = if gain { "as a ratio it would fit" } else { "as a gain it would fit" };
        format!("{}; {other}", law(transformer, gain))
    }

    /// A ratio that is a gain, or the reverse, is mended for certain.
    fn with_inverse(
        &self,
        error: Diagnostic,
        value: Stands<'a>,
        gain: bool,
        fits: bool,
    ) -> Diagnostic {
        let Stands::Written(expr) = value else { return error };
        let text = self.map.text(expr.span);
        if !fits || gain || text.is_empty() {
            return error;
        }
        error.fix("make it a gain", vec![(expr.span, format!("gain = {text}"))])
    }

    /// The error for a two-port between a pseudo domain and a true one.
    fn pseudo(&mut self, id: VertexId, value: Stands<'a>, one: Told, two: Told) -> Clash {
        let declaration = self.declarations[id.index()];
        let (noun, name) = (declaration.element.noun, self.graph.vertex(id).name.clone());
        let (pseudo, real) = match one.domain.row().pseudo {
            true => (one.domain, two.domain),
            false => (two.domain, one.domain),
        };
        let message = format!(
            "the {noun} `{name}` joins {} and {}, but only one of them carries power",
            one.domain.name(),
            two.domain.name()
        );
        let error = Diagnostic::error("E0311", declaration.span, message).says(format!(
            "{} on one side, {} on the other",
            one.domain.name(),
            two.domain.name()
        ));
        let error = self.point_at_told(self.point_at_told(error, one), two);
        let row = pseudo.row();
        let error = error
            .because(format!(
                "in the pseudo domain {} effort times flow ({} times {}) is no power",
                row.name, row.effort, row.flow
            ))
            .help(format!(
                "couple {} and {} by signals, as in `Sf:heat(power(R))`",
                real.name(),
                row.name
            ));
        let side = value.expr();
        let dimension = self.dimension(&side, None).known();
        match dimension {
            Some(dimension) => {
                let side = Side::of(self, &side, dimension);
                let names = Clash::new(error.clone()).explain(&[&side]).names;
                Clash { diagnostic: error, names }
            }
            None => Clash::new(error),
        }
    }
}

/// The law of a modulus.
fn law(transformer: bool, gain: bool) -> &'static str {
    match (transformer, gain) {
        (true, false) => "the ratio r of a transformer is e1/e2 = f2/f1",
        (true, true) => "the gain of a transformer is e2/e1 = f1/f2",
        (false, false) => "the ratio r of a gyrator is e1/f2 = e2/f1",
        (false, true) => "the gain of a gyrator is f1/e2 = f2/e1",
    }
}

/// Whether some ratio joins two domains.
fn consistent(transformer: bool, one: Domain, two: Domain) -> bool {
    let (a, b) = (one.row(), two.row());
    match transformer {
        true => {
            a.effort_dimension.over(b.effort_dimension) == b.flow_dimension.over(a.flow_dimension)
        }
        false => {
            a.effort_dimension.over(b.flow_dimension) == b.effort_dimension.over(a.flow_dimension)
        }
    }
}
