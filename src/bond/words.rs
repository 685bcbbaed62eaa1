//! The graph in words: its expressions, laws and signals, elements by name.

use super::graph::{
    BondGraph, Dissipation, Expr, Initial, Law, Leaf, Memory, Modulus, Power, SignalLaw, Storage,
    StoreInitial, StoreLaw, Variable, Waveform,
};
use crate::expr::Dialect;
use crate::expr::print::print;

/// An expression of the graph, elements and signals by name.
pub fn expression(graph: &BondGraph, expr: &Expr) -> String {
    expression_with(graph, expr, "stored")
}

/// The same with a word for what the element itself stores.
pub fn expression_with(graph: &BondGraph, expr: &Expr, stored: &str) -> String {
    print(expr, Dialect::Bond, &mut |leaf| match leaf {
        Leaf::Parameter(id) => graph.parameters[id.index()].name.clone(),
        Leaf::Signal(id) => graph.signals[id.index()].name.clone(),
        Leaf::Time => "time".into(),
        Leaf::Own(Variable::Power(power)) => letter(*power).into(),
        Leaf::Own(Variable::Stored) => stored.into(),
        Leaf::Bond { bond, variable, negated } => {
            let reading = format!("{}({})", letter(*variable), graph.bond_name(*bond));
            if *negated { format!("(-{reading})") } else { reading }
        }
        Leaf::Stored(end) => format!("stored({})", graph.port_name(*end)),
    })
}

/// e or f.
pub fn letter(power: Power) -> &'static str {
    match power {
        Power::Effort => "e",
        Power::Flow => "f",
    }
}

/// What a signal is.
pub fn signal_law(graph: &BondGraph, law: &SignalLaw) -> String {
    signal_law_in(&|expr| expression(graph, expr), law)
}

/// The same with expressions spelt by `text`.
pub fn signal_law_in(text: &dyn Fn(&Expr) -> String, law: &SignalLaw) -> String {
    let list = |name: &str, arguments: &[&Expr]| {
        let arguments: Vec<String> = arguments.iter().map(|a| text(a)).collect();
        format!("{name}({})", arguments.join(", "))
    };
    match law {
        SignalLaw::Algebraic(expr) => text(expr),
        SignalLaw::Integrator { rate, initial } => {
            format!("integ({}, {})", text(rate), initial_value(text, initial))
        }
        SignalLaw::Memory { kind, input } => match kind {
            Memory::Hysteresis { low, high } => {
                format!("hysteresis({}, {}, {})", text(input), text(low), text(high))
            }
            Memory::Sample { period } => format!("sample({}, {})", text(input), text(period)),
            Memory::Delay { by } => format!("delay({}, {})", text(input), text(by)),
        },
        SignalLaw::Waveform(waveform) => match waveform {
            Waveform::Noise { seed, rms, dt } => {
                format!("noise({}, {}, {})", text(seed), text(rms), text(dt))
            }
            Waveform::Step { at, before, after } => list("step", &[at, before, after]),
            Waveform::Ramp { at, slope } => list("ramp", &[at, slope]),
            Waveform::Pulse { low, high, delay, rise, fall, width, period } => {
                list("pulse", &[low, high, delay, rise, fall, width, period])
            }
            Waveform::Sine { offset, amplitude, frequency, delay, damping, phase } => {
                list("sine", &[offset, amplitude, frequency, delay, damping, phase])
            }
            Waveform::Pwl(points) => {
                let points: Vec<String> =
                    points.iter().map(|(t, y)| format!("{}, {}", text(t), text(y))).collect();
                format!("pwl({})", points.join("; "))
            }
        },
    }
}

fn initial_value(text: &dyn Fn(&Expr) -> String, initial: &Initial) -> String {
    match initial {
        Initial::Given(expr) => text(expr),
        Initial::Implied => "implied".into(),
    }
}

/// What an element does.
pub fn law(graph: &BondGraph, law: &Law) -> String {
    let text = |expr: &Expr| expression(graph, expr);
    let stored = |kind: &Storage| match kind {
        Storage::Compliance => "q",
        Storage::Inertia => "p",
    };
    match law {
        Law::Zero => "common effort".into(),
        Law::One => "common flow".into(),
        Law::Source { detector: true, sets, .. } => format!("{} = 0, detector", letter(*sets)),
        Law::Source { sets, value, .. } => format!("{} = {}", letter(*sets), text(value)),
        Law::Dissipator(Dissipation::Linear(r)) => format!("e = ({})*f", text(r)),
        Law::Dissipator(Dissipation::Effort(law)) => format!("e = {}", text(law)),
        Law::Dissipator(Dissipation::Flow(law)) => format!("f = {}", text(law)),
        Law::Store { kind, law, initial } => {
            let (gives, stored) = (letter(kind.gives()), stored(kind));
            let law = match law {
                StoreLaw::Linear(c) => format!("{gives} = {stored}/({})", text(c)),
                StoreLaw::OfStored(law) => format!("{gives} = {}", text(law)),
                StoreLaw::OfPower(law) => format!("{stored} = {}", text(law)),
            };
            let initial = match initial {
                StoreInitial::Stored(value) => format!(", {stored}0 = {}", text(value)),
                StoreInitial::Power(value) => format!(", {gives}0 = {}", text(value)),
                StoreInitial::Unstated => String::new(),
            };
            law + &initial
        }
        Law::Rate { kind, rate, initial } => {
            let gives = letter(kind.gives());
            format!("der({gives}) = {}, {gives}0 = {}", text(rate), initial_value(&text, initial))
        }
        Law::Field(field) => {
            let ports = field.ports.iter().enumerate();
            let ports =
                ports.map(|(k, port)| format!("port {}: {}", k + 1, self::law(graph, port)));
            ports.collect::<Vec<_>>().join("; ")
        }
        Law::Transformer(modulus) => format!("transformer, {}", self::modulus(graph, modulus)),
        Law::Gyrator(modulus) => format!("gyrator, {}", self::modulus(graph, modulus)),
    }
}

fn modulus(graph: &BondGraph, modulus: &Modulus) -> String {
    match modulus {
        Modulus::Ratio(ratio) => format!("ratio {}", expression(graph, ratio)),
        Modulus::Gain(gain) => format!("gain {}", expression(graph, gain)),
    }
}
