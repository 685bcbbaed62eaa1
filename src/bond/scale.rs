//! Scaling of domains: the same graph with efforts divided by a factor and flows multiplied by it, so that powers stay.
//!
//! With e = s·e' and f = f'/s in a domain, q = q'/s and p = s·p'. Every quantity thus carries a power of s: +1 for e and
//! p, −1 for f and q, and a coefficient between two of them the difference: R and I +2, C −2, the r of a transformer +1
//! of its first port's domain and −1 of its second's, that of a gyrator +1 of both. Each law is the old one over s·e',
//! f'/s …, divided by the power of what it gives; signals and observed values read s·e', f'/s … and stay as they are.
//! The factor is a parameter, so that all others keep their values in SI.

use super::graph::{
    BondGraph, BondId, Dissipation, End, Expr, Initial, Law, Leaf, Modulus, Parameter, ParameterId,
    Power, SignalLaw, Storage, StoreInitial, StoreLaw, Variable, VertexId,
};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::quantity::{DOMAINS, Domain, nearest};
use crate::source::Span;

/// A domain that has been scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Which.
    pub domain: Domain,
    /// By what its efforts were divided and its flows multiplied.
    pub factor: f64,
    /// The parameter that holds the factor.
    pub parameter: ParameterId,
}

/// The factor that brings a domain's usual effort and flow to like magnitudes: the power of ten nearest to the root of
/// their quotient, and 1 where they are within a factor of a hundred of each other as they are.
pub fn usual(domain: Domain) -> f64 {
    let row = domain.row();
    let half = (row.nominal_effort / row.nominal_flow).log10() / 2.0;
    // Halves go to the larger effort: pressures in MPa.
    if half.abs() < 1.0 { 1.0 } else { 10f64.powf((half + 0.5).floor()) }
}

/// `auto`, or `hydraulic=1e6,translation=100`, or both, later ones winning: domains and their factors.
///
/// # Errors
/// What is wrong with the text.
pub fn parse(text: &str) -> Result<Vec<(Domain, f64)>, Box<Diagnostic>> {
    let wrong = |message: String| Diagnostic::error("E0940", Span::NONE, message);
    let mut scales: Vec<(Domain, f64)> = vec![];
    for item in text.split(',').map(str::trim) {
        if item == "auto" {
            let domains = DOMAINS.iter().map(|row| row.domain);
            scales.extend(domains.map(|domain| (domain, usual(domain))));
            continue;
        }
        let Some((name, factor)) = item.split_once('=') else {
            let error = wrong(format!("--scale takes auto or DOMAIN=FACTOR, not `{item}`"));
            return Err(Box::new(error.help("for example --scale auto, or --scale hydraulic=1e6")));
        };
        let (name, factor) = (name.trim(), factor.trim());
        let Some(domain) = Domain::named(name).filter(|domain| *domain != Domain::Any) else {
            let error = wrong(format!("no domain is called `{name}`"));
            let names = || DOMAINS.iter().skip(1).map(|row| row.name);
            return Err(Box::new(match nearest(&name.to_lowercase(), names()) {
                Some(meant) => error.help(format!("did you mean `{meant}`?")),
                None => error.help(format!("domains: {}", names().collect::<Vec<_>>().join(", "))),
            }));
        };
        match factor.parse::<f64>() {
            // Squares of it must stay numbers.
            Ok(value) if (1e-100..=1e100).contains(&value) => scales.push((domain, value)),
            _ => {
                let message = format!("the scale of `{name}` is no number above 0: `{factor}`");
                return Err(Box::new(
                    wrong(message).help("give a factor between 1e-100 and 1e100"),
                ));
            }
        }
    }
    Ok(scales)
}

/// Scales the domains named that the graph has; of two factors for one domain the later holds, and 1 leaves it.
pub fn scale(graph: &mut BondGraph, scales: &[(Domain, f64)]) {
    for row in DOMAINS {
        let wanted = scales.iter().rev().find(|(domain, _)| *domain == row.domain);
        let present = graph.bonds.iter().any(|bond| bond.domain == row.domain);
        let Some((domain, factor)) = wanted.filter(|(_, factor)| *factor != 1.0 && present) else {
            continue;
        };
        let parameter = ParameterId(graph.parameters.len() as u32);
        graph.scales.push(Scale { domain: *domain, factor: *factor, parameter });
        graph.parameters.push(Parameter {
            name: free_name(graph, &format!("scale_{}", row.name.replace('-', "_"))),
            expr: Expr::number(*factor),
            value: *factor,
            unit: None,
            description: format!("divides {} efforts, multiplies the flows", row.name),
            span: Span::NONE,
        });
    }
    if graph.scales.is_empty() {
        return;
    }
    let old = graph.clone();
    let of = Scaling { graph: &old };
    for id in old.vertex_ids() {
        if let Some(vertex) = graph.vertices.get_mut(id.index()) {
            of.vertex(id, &mut vertex.law);
        }
    }
    for signal in &mut graph.signals {
        match &mut signal.law {
            SignalLaw::Algebraic(expr)
            | SignalLaw::Integrator { rate: expr, .. }
            | SignalLaw::Memory { input: expr, .. } => *expr = of.read(expr, None),
            SignalLaw::Waveform(_) => {}
        }
    }
    for observation in &mut graph.experiment.observe {
        observation.expr = of.read(&observation.expr, None);
    }
    for regulator in &mut graph.regulators {
        regulator.controlled = of.read(&regulator.controlled, None);
        regulator.reference = of.read(&regulator.reference, None);
        for gain in regulator.gains.iter_mut().flatten() {
            *gain = of.read(gain, None);
        }
    }
}

/// A name that no parameter or signal has.
fn free_name(graph: &BondGraph, wanted: &str) -> String {
    let taken = |name: &str| {
        graph.parameters.iter().any(|p| p.name == name)
            || graph.signals.iter().any(|s| s.name == name)
    };
    let mut name = wanted.to_string();
    while taken(&name) {
        name.push('_');
    }
    name
}

/// The power of the factor that a power variable carries.
fn exponent(power: Power) -> i32 {
    match power {
        Power::Effort => 1,
        Power::Flow => -1,
    }
}

/// The power that the integral of a storage carries: that of what it integrates.
fn stored(kind: Storage) -> i32 {
    exponent(kind.integrates())
}

/// A quotient stays one, so that two ratios which are each other's inverse stay so to the last bit: the two pistons of
/// a cylinder, S and 1/S, at rest under equal pressures.
fn over(expr: Expr, factor: Expr) -> Expr {
    let span = expr.span;
    let node = match *expr.node {
        Node::Binary(Binary::Divide, a, b) => Node::Binary(Binary::Divide, a, times(b, factor)),
        node => Node::Binary(Binary::Divide, Expr::new(node, span), factor),
    };
    Expr::new(node, span)
}

fn times(expr: Expr, factor: Expr) -> Expr {
    let span = expr.span;
    let node = match *expr.node {
        Node::Number(1.0) => return factor,
        Node::Binary(Binary::Divide, a, b) => Node::Binary(Binary::Divide, times(a, factor), b),
        node => Node::Binary(Binary::Multiply, Expr::new(node, span), factor),
    };
    Expr::new(node, span)
}

struct Scaling<'a> {
    /// As it was, with the scales.
    graph: &'a BondGraph,
}

impl Scaling<'_> {
    /// An expression divided by a power of the factor of a bond's domain.
    fn divided(&self, expr: Expr, bond: Option<BondId>, power: i32) -> Expr {
        let domain = bond.map(|bond| self.graph.bond(bond).domain);
        self.divided_in(expr, domain.unwrap_or_default(), power)
    }

    fn divided_in(&self, expr: Expr, domain: Domain, power: i32) -> Expr {
        let Some(scale) = self.graph.scales.iter().find(|scale| scale.domain == domain) else {
            return expr;
        };
        if expr.as_number() == Some(0.0) {
            return expr;
        }
        (0..power.unsigned_abs()).fold(expr, |expr, _| {
            let factor = Expr::leaf(Leaf::Parameter(scale.parameter));
            if power > 0 { over(expr, factor) } else { times(expr, factor) }
        })
    }

    /// An expression in SI over the scaled variables; `own` is the bond of the element whose law it is.
    fn read(&self, expr: &Expr, own: Option<BondId>) -> Expr {
        let graph = self.graph;
        expr.map(&mut |leaf, span| {
            let (bond, power) = match leaf {
                Leaf::Parameter(_) | Leaf::Signal(_) | Leaf::Time => (None, 0),
                Leaf::Own(Variable::Power(power)) => (own, exponent(*power)),
                Leaf::Own(Variable::Stored) => {
                    let end = own.and_then(|bond| {
                        let bond = graph.bond(bond);
                        let kind = |end| graph.storage(end);
                        kind(bond.to).or(kind(bond.from))
                    });
                    (own, end.map_or(0, stored))
                }
                Leaf::Bond { bond, variable, .. } => (Some(*bond), exponent(*variable)),
                Leaf::Stored(end) => (graph.bond_at(*end), graph.storage(*end).map_or(0, stored)),
            };
            self.divided(Expr::new(Node::Leaf(leaf.clone()), span), bond, -power)
        })
    }

    fn vertex(&self, id: VertexId, law: &mut Law) {
        let graph = self.graph;
        let bond = |port: u32| graph.bond_at(End { vertex: id, port });
        match law {
            Law::Transformer(modulus) => self.modulus(modulus, bond(0), bond(1), [1, -1]),
            Law::Gyrator(modulus) => self.modulus(modulus, bond(0), bond(1), [1, 1]),
            Law::Field(field) => {
                for (row, entries) in field.matrix.iter_mut().flatten().enumerate() {
                    let end = End { vertex: id, port: row as u32 };
                    // e = R f, q = C e, p = I f: +1 or −1 of the row's domain and of the column's alike.
                    let power = graph.storage(end).map_or(1, stored);
                    for (column, entry) in entries.iter_mut().enumerate() {
                        let read = self.divided(self.read(entry, None), bond(row as u32), power);
                        *entry = self.divided(read, bond(column as u32), power);
                    }
                }
                for (port, law) in field.ports.iter_mut().enumerate() {
                    self.port(law, bond(port as u32));
                }
            }
            _ => self.port(law, bond(0)),
        }
    }

    /// The modulus of a two-port, whose ratio carries these powers of its ports' factors.
    fn modulus(
        &self,
        modulus: &mut Modulus,
        first: Option<BondId>,
        second: Option<BondId>,
        powers: [i32; 2],
    ) {
        let (value, sign) = match modulus {
            Modulus::Ratio(value) => (value, 1),
            Modulus::Gain(value) => (value, -1),
        };
        let domain = |bond: Option<BondId>| bond.map(|bond| self.graph.bond(bond).domain);
        let read = self.read(value, first);
        *value = if domain(first) == domain(second) {
            self.divided(read, first, sign * (powers[0] + powers[1]))
        } else {
            let half = self.divided(read, first, sign * powers[0]);
            self.divided(half, second, sign * powers[1])
        };
    }

    /// The law at a port.
    fn port(&self, law: &mut Law, bond: Option<BondId>) {
        let change = |expr: &mut Expr, power| {
            *expr = self.divided(self.read(expr, bond), bond, power);
        };
        match law {
            Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {}
            Law::Source { sets, value, .. } => change(value, exponent(*sets)),
            Law::Dissipator(Dissipation::Linear(value)) => change(value, 2),
            Law::Dissipator(Dissipation::Effort(value)) => change(value, 1),
            Law::Dissipator(Dissipation::Flow(value)) => change(value, -1),
            Law::Store { kind, law, initial } => {
                let (stored, gives) = (stored(*kind), exponent(kind.gives()));
                match law {
                    StoreLaw::Linear(value) => change(value, stored - gives),
                    StoreLaw::OfStored(value) => change(value, gives),
                    StoreLaw::OfPower(value) => change(value, stored),
                }
                match initial {
                    StoreInitial::Stored(value) => change(value, stored),
                    StoreInitial::Power(value) => change(value, gives),
                    StoreInitial::Unstated => {}
                }
            }
            Law::Rate { kind, rate, initial } => {
                let gives = exponent(kind.gives());
                change(rate, gives);
                if let Initial::Given(value) = initial {
                    change(value, gives);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_factors_are_those_of_the_domains() {
        let factor = |name| usual(Domain::named(name).unwrap());
        assert_eq!(factor("hydraulic"), 1e6);
        assert_eq!(factor("translation"), 100.0);
        assert_eq!(factor("pneumatic"), 1e4);
        assert_eq!((factor("electrical"), factor("rotation")), (1.0, 1.0));
    }

    #[test]
    fn the_flag_says_what_is_wrong_with_it() {
        let parsed = parse("auto, hydraulic=2e5").unwrap();
        assert_eq!(parsed.last(), Some(&(Domain::Hydraulic, 2e5)));
        let said = |text: &str| {
            let error = parse(text).unwrap_err();
            format!("{} {:?}", error.message, error.help)
        };
        assert!(said("hydraulics=1e6").contains("did you mean `hydraulic`?"));
        assert!(said("any=2").contains("no domain is called `any`"));
        for factor in ["0", "-1", "inf", "nan", "x", "1e300", ""] {
            assert!(said(&format!("hydraulic={factor}")).contains("no number above 0"), "{factor}");
        }
        assert!(said("1e6").contains("not `1e6`"));
        assert!(said("").contains("not ``"));
    }
}
