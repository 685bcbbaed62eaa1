//! What some dialects have no words for, beyond what bond graphs need (those stand in `adapt`).

use super::adapt::Lack;
use super::parts::{Operator, every_leaf, varies};
use super::{Element, Expr, Leaf, PassiveKind, Shape, Source, Waveform};

/// The laws of an element.
fn laws(element: &Element) -> Vec<&Expr> {
    match element {
        Element::BehaviouralVoltage { law }
        | Element::BehaviouralCurrent { law }
        | Element::Charge { law, .. }
        | Element::Flux { law, .. }
        | Element::LawSwitch { control: law, .. }
        | Element::Resistor { value: law }
        | Element::Capacitor { value: law, .. }
        | Element::Inductor { value: law, .. } => vec![law],
        Element::Passive(passive) => passive.value.iter().collect(),
        Element::VoltageSource(source) | Element::CurrentSource(source) => match &source.waveform {
            Waveform::Constant(law) => vec![law],
            _ => vec![],
        },
        _ => vec![],
    }
}

fn speaks_of(element: &Element, what: fn(Operator, usize) -> bool) -> bool {
    let mut found = false;
    for law in laws(element) {
        every_leaf(law, &mut |leaf, _| {
            if let Leaf::Operator(operator, arguments) = leaf {
                found |= what(*operator, arguments.len());
            }
        });
    }
    found
}

/// Whether an R, C or L has a law instead of a number.
fn by_law(element: &Element, kind: PassiveKind) -> bool {
    match (element, kind) {
        (Element::Resistor { value }, PassiveKind::Resistor)
        | (Element::Capacitor { value, .. }, PassiveKind::Capacitor)
        | (Element::Inductor { value, .. }, PassiveKind::Inductor) => varies(value),
        (Element::Passive(passive), kind) => {
            passive.kind == kind && passive.value.as_ref().is_some_and(varies)
        }
        _ => false,
    }
}

fn source(element: &Element) -> Option<&Source> {
    match element {
        Element::VoltageSource(source) | Element::CurrentSource(source) => Some(source),
        _ => None,
    }
}

const WORDS: &str = "another dialect has a word for it: ngspice, xyce or ltspice";
const LINEAR: &str = "only linear models can be written for it";

/// R, C or L with a law, or by charge or flux.
pub const PASSIVE_LAW: Lack = Lack {
    needed: |element, _| {
        use PassiveKind::{Capacitor, Inductor, Resistor};
        [Resistor, Capacitor, Inductor].into_iter().any(|kind| by_law(element, kind))
            || matches!(element, Element::Charge { .. } | Element::Flux { .. })
    },
    what: "a resistor, capacitor or inductor with a law",
    help: LINEAR,
};

/// R, C or L of a model, or with parameters.
pub const MODELLED: Lack = Lack {
    needed: |element, _| matches!(element, Element::Passive(_)),
    what: "a passive device of a model, or with temperature coefficients",
    help: "give its value as a number",
};

/// `R={…}` of voltages.
pub const CAPACITOR_LAW: Lack = Lack {
    needed: |element, _| by_law(element, PassiveKind::Capacitor),
    what: "a capacitance by a law",
    help: WORDS,
};

/// `L={…}` of currents.
pub const INDUCTOR_LAW: Lack = Lack {
    needed: |element, _| by_law(element, PassiveKind::Inductor),
    what: "an inductance by a law",
    help: WORDS,
};

/// `Q=`.
pub const CHARGE: Lack = Lack {
    needed: |element, _| matches!(element, Element::Charge { .. }),
    what: "a capacitor by a charge of more than its own voltage",
    help: WORDS,
};

/// `Flux=`.
pub const FLUX: Lack = Lack {
    needed: |element, _| matches!(element, Element::Flux { .. }),
    what: "an inductor by its flux",
    help: WORDS,
};

/// The integral of a value.
pub const INTEGRAL: Lack = Lack {
    needed: |element, _| speaks_of(element, |operator, _| operator == Operator::Integral),
    what: "an integral within an expression",
    help: "a capacitor of 1 F that a current source charges holds the same",
};

/// The integral of a value from another one than 0 on.
pub const BEGUN_INTEGRAL: Lack = Lack {
    needed: |element, _| speaks_of(element, |operator, n| operator == Operator::Integral && n > 1),
    what: "an integral with an initial value",
    help: "add the initial value to the integral",
};

/// A value of a time ago.
pub const DELAY: Lack = Lack {
    needed: |element, _| speaks_of(element, |operator, _| operator == Operator::Delay),
    what: "a delay within an expression",
    help: "a lossless line delays a voltage",
};

/// LAPLACE.
pub const TRANSFER: Lack = Lack {
    needed: |element, _| speaks_of(element, |operator, _| operator == Operator::Transfer),
    what: "a function of s",
    help: "integrators and gains say the same",
};

/// `spice_pulse(…)`.
pub const WAVEFORM_CALL: Lack = Lack {
    needed: |element, _| {
        speaks_of(element, |operator, _| matches!(operator, Operator::Waveform(_)))
    },
    what: "a waveform within an expression",
    help: "give it a voltage source of its own, and let the expression read that",
};

/// Any value over time within a law.
pub const PAST: Lack = Lack {
    needed: |element, _| speaks_of(element, |_, _| true),
    what: "what an expression says of values over time",
    help: WORDS,
};

/// A source by a law.
pub const SOURCE_LAW: Lack = Lack {
    needed: |element, _| match source(element).map(|source| &source.waveform) {
        Some(Waveform::Constant(law)) => varies(law),
        _ => false,
    },
    what: "an independent source whose value is a law",
    help: "write it as a B source",
};

/// Parts of a source for other analyses.
pub const PARTS: Lack = Lack {
    needed: |element, _| source(element).is_some_and(|s| s.dc.is_some() || s.ac.is_some()),
    what: "a source with a DC or AC part of its own",
    help: "leave these parts out: the text is for runs over time",
};

/// PWL that is repeated or comes later.
pub const REPEATED: Lack = Lack {
    needed: |element, _| {
        source(element).is_some_and(|s| matches!(s.waveform, Waveform::Points { .. }))
    },
    what: "a PWL that is repeated or delayed",
    help: "write its points out",
};

/// PAT.
pub const PATTERN: Lack = Lack {
    needed: |element, _| {
        source(element).is_some_and(|s| matches!(s.waveform, Waveform::Pattern { .. }))
    },
    what: "a pattern of bits",
    help: "write it as a PWL",
};

/// AM.
pub const AMPLITUDE: Lack = Lack {
    needed: |element, _| {
        source(element).is_some_and(|source| {
            matches!(source.waveform, Waveform::Function { shape: Shape::Am, .. })
        })
    },
    what: "an amplitude that is modulated",
    help: "a B source can multiply two sines",
};

/// A switch by an expression.
pub const LAW_SWITCH: Lack = Lack {
    needed: |element, _| matches!(element, Element::LawSwitch { .. }),
    what: "a switch by an expression",
    help: "let a source make the expression a voltage, and the switch follow that",
};

/// A switch of smooth transition.
pub const SMOOTH_SWITCH: Lack = Lack {
    needed: |element, models| {
        let (Element::Switch { model, .. } | Element::CurrentSwitch { model, .. }) = element else {
            return false;
        };
        let smooth = ["von", "voff", "ion", "ioff", "on", "off"];
        models
            .get(model)
            .is_some_and(|parameters| parameters.iter().any(|(key, _)| smooth.contains(&&**key)))
    },
    what: "a switch that goes over smoothly",
    help: "give it a model with a threshold: vt and vh",
};
