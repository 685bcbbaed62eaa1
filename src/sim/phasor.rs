//! Output expressions over phasors: arithmetic of complex numbers, parts of them, and the elementary functions.

use crate::circuit::{Expr, Leaf, Part, Probe};
use crate::expr::{Binary, Function, Node, Unary};
use crate::linear::{Complex, Field};

/// Deeper expressions have no value.
const DEEPEST: usize = 2000;

/// What a leaf reads.
pub(super) fn probe(leaf: &Leaf) -> Option<Probe> {
    match *leaf {
        Leaf::Voltage(a, b) => Some(Probe::Voltage(a, b)),
        Leaf::Current(id) => Some(Probe::Current(id)),
        Leaf::Part(_, probe) => Some(probe),
        Leaf::Capacitance(_) | Leaf::Time => None,
    }
}

/// Whether an expression is a phasor, and not made of real parts of phasors alone.
pub(super) fn is_complex(expr: &Expr) -> bool {
    let mut found = false;
    expr.leaves(&mut |leaf, _| found |= matches!(leaf, Leaf::Voltage(..) | Leaf::Current(_)));
    found
}

/// The unit of a part of a phasor.
pub(super) fn unit(expr: &Expr) -> &'static str {
    match &*expr.node {
        Node::Leaf(Leaf::Part(Part::Decibel, _)) => "dB",
        Node::Leaf(Leaf::Part(Part::Phase, _)) => "rad",
        Node::Leaf(Leaf::Part(Part::Degrees, _)) => "deg",
        Node::Leaf(Leaf::Part(_, Probe::Voltage(..))) => "V",
        Node::Leaf(Leaf::Part(_, Probe::Current(_))) => "A",
        _ => "",
    }
}

/// The value of an expression.
pub(super) fn evaluate(expr: &Expr, at: &dyn Fn(Probe) -> Complex) -> Complex {
    if expr.depth() > DEEPEST { Complex::from(f64::NAN) } else { value(expr, at) }
}

fn value(expr: &Expr, at: &dyn Fn(Probe) -> Complex) -> Complex {
    let of = |expr: &Expr| value(expr, at);
    match &*expr.node {
        Node::Number(value) => Complex::from(*value),
        Node::Leaf(Leaf::Voltage(a, b)) => at(Probe::Voltage(*a, *b)),
        Node::Leaf(Leaf::Current(id)) => at(Probe::Current(*id)),
        Node::Leaf(Leaf::Part(part, probe)) => Complex::from(part_of(*part, at(*probe))),
        Node::Leaf(Leaf::Capacitance(_)) => Complex::from(f64::NAN),
        Node::Leaf(Leaf::Time) => Complex::ZERO,
        Node::Unary(Unary::Negate, a) => -of(a),
        Node::Unary(Unary::Not, a) => truth(of(a).is_zero()),
        Node::Binary(op, a, b) => {
            let (a, b) = (of(a), of(b));
            match op {
                Binary::Add => a + b,
                Binary::Subtract => a - b,
                Binary::Multiply => a * b,
                Binary::Divide => a / b,
                Binary::Power => power(a, b),
                Binary::Less => truth(a.re < b.re),
                Binary::LessEqual => truth(a.re <= b.re),
                Binary::Greater => truth(a.re > b.re),
                Binary::GreaterEqual => truth(a.re >= b.re),
                Binary::Equal => truth(a == b),
                Binary::NotEqual => truth(a != b),
                Binary::And => truth(!a.is_zero() && !b.is_zero()),
                Binary::Or => truth(!a.is_zero() || !b.is_zero()),
            }
        }
        Node::If(condition, a, b) => {
            if of(condition).is_zero() {
                of(b)
            } else {
                of(a)
            }
        }
        Node::Call(function, arguments) => {
            let arguments: Vec<Complex> = arguments.iter().map(of).collect();
            call(*function, &arguments)
        }
        Node::Table(..) => Complex::from(f64::NAN),
    }
}

fn truth(is: bool) -> Complex {
    Complex::from(f64::from(u8::from(is)))
}

/// A part of a complex number.
pub(super) fn part_of(part: Part, z: Complex) -> f64 {
    let magnitude = libm::hypot(z.re, z.im);
    match part {
        Part::Real => z.re,
        Part::Imaginary => z.im,
        Part::Magnitude => magnitude,
        Part::Phase => libm::atan2(z.im, z.re),
        Part::Degrees => libm::atan2(z.im, z.re).to_degrees(),
        Part::Decibel => 20.0 * libm::log10(magnitude),
    }
}

fn logarithm(z: Complex) -> Complex {
    Complex::new(libm::log(part_of(Part::Magnitude, z)), part_of(Part::Phase, z))
}

fn exponential(z: Complex) -> Complex {
    let (sine, cosine) = libm::sincos(z.im);
    let size = libm::exp(z.re);
    Complex::new(size * cosine, size * sine)
}

fn power(a: Complex, b: Complex) -> Complex {
    if b.im == 0.0 && b.re == b.re.trunc() && b.re.abs() <= 64.0 {
        let whole = (0..b.re.abs() as u32).fold(Complex::ONE, |product, _| product * a);
        return if b.re < 0.0 { Complex::ONE / whole } else { whole };
    }
    if a.is_zero() { Complex::ZERO } else { exponential(b * logarithm(a)) }
}

fn call(function: Function, arguments: &[Complex]) -> Complex {
    let half = Complex::from(0.5);
    let i = Complex::new(0.0, 1.0);
    match (function, arguments) {
        (Function::Abs, [z]) => Complex::from(part_of(Part::Magnitude, *z)),
        (Function::Sqrt, [z]) => power(*z, half),
        (Function::Exp, [z]) => exponential(*z),
        (Function::Ln, [z]) => logarithm(*z),
        (Function::Log10, [z]) => logarithm(*z).scaled(1.0 / std::f64::consts::LN_10),
        (Function::Sin, [z]) => (exponential(i * *z) - exponential(-(i * *z))) / i.scaled(2.0),
        (Function::Cos, [z]) => (exponential(i * *z) + exponential(-(i * *z))).scaled(0.5),
        (Function::Sinh, [z]) => (exponential(*z) - exponential(-*z)).scaled(0.5),
        (Function::Cosh, [z]) => (exponential(*z) + exponential(-*z)).scaled(0.5),
        _ if arguments.iter().all(|z| z.im == 0.0) => {
            let real: Vec<f64> = arguments.iter().map(|z| z.re).collect();
            Complex::from(function.row().value.at(&real))
        }
        _ => Complex::from(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_identities() {
        let z = Complex::new(0.7, -1.3);
        let close = |a: Complex, b: Complex| assert!((a - b).magnitude() < 1e-14, "{a:?} {b:?}");
        close(exponential(logarithm(z)), z);
        close(power(z, Complex::from(3.0)), z * z * z);
        close(power(z, Complex::from(-1.0)), Complex::ONE / z);
        let root = call(Function::Sqrt, &[z]);
        close(root * root, z);
        let (sine, cosine) = (call(Function::Sin, &[z]), call(Function::Cos, &[z]));
        close(sine * sine + cosine * cosine, Complex::ONE);
        assert_eq!(part_of(Part::Decibel, Complex::new(0.0, -10.0)), 20.0);
        assert_eq!(part_of(Part::Degrees, Complex::new(0.0, -10.0)), -90.0);
        assert_eq!(call(Function::Max, &[Complex::from(1.0), Complex::from(2.0)]).re, 2.0);
        assert!(call(Function::Max, &[z, z]).re.is_nan());
    }
}
