//! A netlist with other values in some places: what `.dc` and `.step` set at each of their points.
//!
//! | name | what it sets |
//! |---|---|
//! | `temp` | the temperature, in °C |
//! | `p` | a parameter of the top, `.param` or `.global_param` |
//! | `r1`, `x1.r1` | the first value of a device: resistance, gain, DC value … |
//! | `r1:r`, `x1:r1:r`, `@r1[r]` | a value of a device by its key |
//! | `model:key`, `model(key)` | a value of a `.model` of the top |

use super::scope::Table;
use crate::diagnostic::Diagnostic;
use crate::netlist::{
    Card, CardKind, Device, Element, Expr, Name, Netlist, Passive, PassiveKind, Waveform,
};
use crate::quantity::nearest;
use crate::source::Span;
use std::collections::HashMap;

/// Values that stand in the place of those that a netlist says.
#[derive(Debug, Default)]
pub struct Variation {
    pub(super) parameters: Table<Expr>,
    /// Devices by their full names, folded.
    pub(super) devices: HashMap<String, Device>,
    pub(super) models: Table<Vec<(String, Expr)>>,
    /// In °C.
    pub(super) temperature: Option<f64>,
    /// The name of the analysis that is run; without one the last.
    pub analysis: Option<String>,
    /// Options besides those of the netlist, which win.
    pub options: Vec<(String, String)>,
    /// The step of `.step`, from 0 on: each draws its own random values.
    pub step: u64,
}

/// The names of the temperature.
const TEMPERATURE: &[&str] = &["temp", "temper"];

impl Variation {
    /// Sets what a name means to a value.
    ///
    /// # Errors
    /// When nothing of this name can be set.
    pub fn set(
        &mut self,
        netlist: &Netlist,
        name: &str,
        value: f64,
        span: Span,
    ) -> Result<(), Box<Diagnostic>> {
        let number = Expr::number(value);
        if let Some(own) = netlist.names.find(name)
            && is_parameter(netlist, own)
        {
            self.parameters.insert(own, number);
            return Ok(());
        }
        if TEMPERATURE.iter().any(|own| own.eq_ignore_ascii_case(name)) {
            self.temperature = Some(value);
            return Ok(());
        }
        let name = match name.strip_prefix('@').and_then(|rest| rest.strip_suffix(']')) {
            Some(inner) => inner.replace('[', ":"),
            None => name.to_string(),
        };
        let split = name.rsplit_once(':').map(|(path, key)| (path.to_string(), Some(key)));
        for (path, key) in std::iter::once((name.clone(), None)).chain(split) {
            let path = path.replace(':', ".").to_lowercase();
            let changed = self.devices.get(&path).cloned();
            if let Some(mut device) = changed.or_else(|| find(netlist, &path).cloned()) {
                return match value_of(&mut device.element, key) {
                    Some(place) => {
                        *place = number;
                        if let Element::VoltageSource(source) | Element::CurrentSource(source) =
                            &mut device.element
                            && matches!(source.waveform, Waveform::Constant(_))
                        {
                            source.waveform = Waveform::Constant(Expr::number(value));
                        }
                        self.devices.insert(path, device);
                        Ok(())
                    }
                    None => {
                        let what = key.map_or(String::new(), |key| format!(" called `{key}`"));
                        let message = format!("`{path}` has no value{what} that can be set");
                        Err(Box::new(Diagnostic::error("E0785", span, message)))
                    }
                };
            }
            let Some(key) = key else { continue };
            let model = netlist.names.find(&path).and_then(|name| model(netlist, name));
            if let Some((name, parameters)) = model {
                let own = self.models.entry(name).or_insert_with(|| parameters.to_vec());
                own.retain(|(known, _)| !known.eq_ignore_ascii_case(key));
                own.push((key.to_lowercase(), number));
                return Ok(());
            }
        }
        Err(Box::new(unknown(netlist, &name, span)))
    }
}

/// The value of a `.model` of the top that `model:key` names.
pub fn model_value<'n>(netlist: &'n Netlist, text: &str) -> Option<&'n Expr> {
    let (path, key) = text.rsplit_once(':')?;
    let (_, parameters) = model(netlist, netlist.names.find(path)?)?;
    parameters.iter().find(|(own, _)| own.eq_ignore_ascii_case(key)).map(|(_, value)| value)
}

fn is_parameter(netlist: &Netlist, name: Name) -> bool {
    netlist.cards.iter().any(|card| match &card.kind {
        CardKind::Parameters(parameters) => parameters.iter().any(|(own, _)| *own == name),
        _ => false,
    })
}

fn model(netlist: &Netlist, name: Name) -> Option<(Name, &[(String, Expr)])> {
    netlist.cards.iter().find_map(|card| match &card.kind {
        CardKind::Model { name: own, parameters, .. } if *own == name => {
            Some((name, &parameters[..]))
        }
        _ => None,
    })
}

/// A device by its full name, folded: within instances `x1.x2.r1`.
fn find<'n>(netlist: &'n Netlist, path: &str) -> Option<&'n Device> {
    let mut around: Vec<&[Card]> = vec![&netlist.cards];
    let mut rest = path;
    loop {
        let (first, more) = match rest.split_once('.') {
            Some((first, more)) => (first, Some(more)),
            None => (rest, None),
        };
        let name = netlist.names.find(first)?;
        let device = around.last()?.iter().find_map(|card| match &card.kind {
            CardKind::Device(device) if device.name == name => Some(device),
            _ => None,
        })?;
        let Some(more) = more else {
            return (!matches!(device.element, Element::Instance { .. })).then_some(device);
        };
        let Element::Instance { subcircuit, .. } = &device.element else { return None };
        let definition = around.iter().rev().find_map(|cards| {
            cards.iter().find_map(|card| match &card.kind {
                CardKind::Subcircuit(own) if own.name == *subcircuit => Some(own),
                _ => None,
            })
        })?;
        around.push(&definition.cards);
        rest = more;
    }
}

/// The value of an element that a key names, as it stands there; its first without a key.
pub fn value_in(element: &Element, key: Option<&str>) -> Option<Expr> {
    if let Element::VoltageSource(source) | Element::CurrentSource(source) = element
        && let (None, Waveform::Constant(value)) = (&source.dc, &source.waveform)
        && key.is_none_or(|key| DIRECT.iter().any(|own| own.eq_ignore_ascii_case(key)))
    {
        return Some(value.clone());
    }
    if let Some(key) = key.filter(|key| is_passive(key)) {
        let parameters = match element {
            Element::Passive(passive) => &passive.parameters[..],
            Element::Resistor { .. } | Element::Capacitor { .. } | Element::Inductor { .. } => &[],
            _ => return None,
        };
        let said = parameters.iter().find(|(own, _)| own.eq_ignore_ascii_case(key));
        let one = || key.eq_ignore_ascii_case("m").then(|| Expr::number(1.0));
        return said.map(|(_, value)| value.clone()).or_else(one);
    }
    value_of(&mut element.clone(), key).cloned()
}

fn is_passive(key: &str) -> bool {
    PASSIVE.iter().any(|own| own.eq_ignore_ascii_case(key))
}

/// Keys of the DC value of a source.
const DIRECT: &[&str] = &["dc", "dcv0", "v", "i"];

/// Keys that any resistor, capacitor or inductor may have.
const PASSIVE: &[&str] = &["m", "temp", "tc1", "tc2"];

/// The value of an element that a key names, to be set; its first without a key.
pub fn value_of<'e>(element: &'e mut Element, key: Option<&str>) -> Option<&'e mut Expr> {
    let is =
        |names: &[&str]| key.is_none_or(|key| names.iter().any(|n| n.eq_ignore_ascii_case(key)));
    if let Some(key) = key.filter(|key| is_passive(key)) {
        let passive = as_passive(element)?;
        let key = key.to_lowercase();
        let known = passive.parameters.iter().position(|(own, _)| *own == key);
        let at = known.unwrap_or_else(|| {
            passive.parameters.push((key, Expr::number(0.0)));
            passive.parameters.len() - 1
        });
        return passive.parameters.get_mut(at).map(|(_, value)| value);
    }
    match element {
        Element::Passive(passive) if is(passive.kind.keys()) => passive.value.as_mut(),
        Element::Resistor { value } if is(PassiveKind::Resistor.keys()) => Some(value),
        Element::Capacitor { value, .. } if is(PassiveKind::Capacitor.keys()) => Some(value),
        Element::Inductor { value, .. } if is(PassiveKind::Inductor.keys()) => Some(value),
        Element::Mutual { coupling, .. } if is(&["k", "coupling"]) => Some(coupling),
        Element::VoltageSource(source) | Element::CurrentSource(source) => {
            if is(DIRECT) {
                Some(source.dc.get_or_insert(Expr::number(0.0)))
            } else if is(&["acmag", "acphase"]) {
                let ac = source.ac.get_or_insert([Expr::number(0.0), Expr::number(0.0)]);
                let phase = key.is_some_and(|key| key.eq_ignore_ascii_case("acphase"));
                Some(&mut ac[usize::from(phase)])
            } else {
                None
            }
        }
        Element::Vcvs { gain, .. }
        | Element::Vccs { gain, .. }
        | Element::Cccs { gain, .. }
        | Element::Ccvs { gain, .. }
            if is(&["gain"]) =>
        {
            Some(gain)
        }
        Element::Line { impedance, .. } if is(&["z0", "zo"]) => Some(impedance),
        Element::Line { delay, .. } if is(&["td"]) => Some(delay),
        Element::Diode { area, .. } if is(&["area"]) => Some(area.get_or_insert(Expr::number(1.0))),
        _ => None,
    }
}

/// A resistor, capacitor or inductor as one that may have parameters.
fn as_passive(element: &mut Element) -> Option<&mut Passive> {
    let plain = |kind, value: &Expr, initial: &Option<Expr>| Passive {
        kind,
        value: Some(value.clone()),
        model: None,
        initial: initial.clone(),
        parameters: vec![],
    };
    let passive = match &*element {
        Element::Resistor { value } => plain(PassiveKind::Resistor, value, &None),
        Element::Capacitor { value, initial } => plain(PassiveKind::Capacitor, value, initial),
        Element::Inductor { value, initial } => plain(PassiveKind::Inductor, value, initial),
        Element::Passive(passive) => (**passive).clone(),
        _ => return None,
    };
    *element = Element::Passive(Box::new(passive));
    match element {
        Element::Passive(passive) => Some(passive),
        _ => None,
    }
}

fn unknown(netlist: &Netlist, name: &str, span: Span) -> Diagnostic {
    let message = format!("nothing is called `{name}` that could take other values");
    let known = netlist.cards.iter().flat_map(|card| match &card.kind {
        CardKind::Parameters(parameters) => parameters.iter().map(|(name, _)| *name).collect(),
        CardKind::Device(device) => vec![device.name],
        _ => vec![],
    });
    let known = known.take(super::values::NEAR).map(|name| netlist.names.text(name));
    let error = Diagnostic::error("E0784", span, message);
    match nearest(name, known.chain(["temp"])) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error.help(
            "a parameter, a device (`r1`, `r1:r`, `x1:r1:r`), a value of a model (`model:key`) or `temp`",
        ),
    }
}
