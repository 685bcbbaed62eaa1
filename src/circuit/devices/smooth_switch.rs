//! Switch whose resistance goes over smoothly from Roff to Ron while its control goes from `off` to `on`:
//!
//! ```text
//! S = (control − off)/(on − off), held within 0 and 1;  u = 2·S − 1
//! ln R = ln √(Ron·Roff) + ¾·ln(Ron/Roff)·u − ¼·ln(Ron/Roff)·u³
//! i = v/R
//! ```
//!
//! `on` may lie below `off`. With a hysteresis a switch that is on goes over between `holds_on` and `off` only, one that is
//! off between `holds_off` and `on`; it is on from `on` until `off` is reached, so that nothing jumps. Resistances in Ω,
//! above 0.
//!
//! Source: Xyce Reference Guide, version 7, voltage- and current-controlled switches.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper, voltage};
use crate::circuit::stamps::{Law, Leaf, Mode};
use crate::circuit::{DeviceId, DeviceKind, SmoothSwitch};
use crate::expr::{Binary, Function, Node};
use crate::source::Span;

/// The row of the table.
pub const ROW: Row = Row {
    name: "smooth switch",
    letters: "SW",
    equation: "ln R = ln sqrt(Ron Roff) + ln(Ron/Roff) (3 u - u^3)/4",
    needs: |kind| {
        let DeviceKind::SmoothSwitch(switch) = kind else { return Needs::NOTHING };
        let remembers = switch.holds_on.is_some() || switch.holds_off.is_some();
        Needs { mode: remembers, ..Needs::NOTHING }
    },
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::SmoothSwitch(switch) = &stamper.device(id).kind else { return };
    let SmoothSwitch {
        control,
        on,
        off,
        holds_on,
        holds_off,
        on_resistance,
        off_resistance,
        initially_on,
    } = &**switch;
    let values = [
        ("Ron", *on_resistance),
        ("Roff", *off_resistance),
        ("value that it is on at", *on),
        ("value that it is off at", *off),
        ("value that it stays on down to", holds_on.unwrap_or(*on)),
        ("value that it stays off up to", holds_off.unwrap_or(*off)),
    ];
    if !stamper.finite(id, &values) {
        return;
    }
    let name = stamper.device(id).name.clone();
    if *on_resistance <= 0.0 || *off_resistance <= 0.0 {
        let message = format!("both resistances of the switch `{name}` must be above 0");
        return stamper.error("E0752", id, message);
    }
    let inside = |value: f64| (value - off) * (value - on) <= 0.0;
    if on == off || !inside(holds_on.unwrap_or(*on)) || !inside(holds_off.unwrap_or(*off)) {
        let message = format!("the switch `{name}` goes over between values that are in disorder");
        return stamper.error("E0752", id, message);
    }
    let control = stamper.law(control);
    if let Some(mode) = stamper.mode(id).and_then(|k| stamper.stamps.modes.get_mut(k as usize)) {
        let turned = on < off;
        let control = if turned { control.negate() } else { control };
        let (on, off) = if turned { (-*on, -*off) } else { (*on, *off) };
        *mode = Mode { device: id, control, on, off, initial: *initially_on, course: None };
    }
    let into = stamper.leaving(stamper.ends(id));
    stamper.add(id, current(stamper, id), into);
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::SmoothSwitch(switch) = &stamper.device(id).kind else {
        return Current::nothing();
    };
    let SmoothSwitch {
        control, on, off, holds_on, holds_off, on_resistance, off_resistance, ..
    } = &**switch;
    let middle = 0.5 * (on_resistance * off_resistance).ln();
    let ratio = (on_resistance / off_resistance).ln();
    let number = Law::number;
    let times = |a: Law, b: Law| a.binary(Binary::Multiply, b);
    let plus = |a: Law, b: Law| a.binary(Binary::Add, b);
    // The conductance while the control goes from `low` to `high`.
    let conductance = |low: f64, high: f64| {
        let u = || {
            let slope = 2.0 / (high - low);
            let u = plus(times(stamper.law(control), number(slope)), number(-1.0 - slope * low));
            Law::call(Function::Clamp, vec![u, number(-1.0), number(1.0)])
        };
        let square = times(u(), u());
        let shape = times(u(), plus(number(0.75 * ratio), times(number(-0.25 * ratio), square)));
        Law::call(Function::Exp, vec![plus(number(-middle), shape.negate())])
    };
    let conductance = match stamper.mode(id) {
        Some(mode) => {
            let when_on = conductance(*off, holds_on.unwrap_or(*on));
            let when_off = conductance(holds_off.unwrap_or(*off), *on);
            Law::new(Node::choice(Law::leaf(Leaf::Mode(mode)), when_on, when_off), Span::NONE)
        }
        None => conductance(*off, *on),
    };
    Current::Law(times(conductance, voltage(stamper.ends(id))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::devices::testing::circuit;
    use crate::circuit::stamps::{Stamps, stamp};
    use crate::circuit::{Expr, Leaf, NodeId};
    use crate::expr::Dag;

    fn switch(on: f64, off: f64, holds: Option<(f64, f64)>) -> DeviceKind {
        DeviceKind::SmoothSwitch(Box::new(SmoothSwitch {
            control: Expr::leaf(Leaf::Voltage(NodeId(2), NodeId(0))),
            on,
            off,
            holds_on: holds.map(|(on, _)| on),
            holds_off: holds.map(|(_, off)| off),
            on_resistance: 1.0,
            off_resistance: 100.0,
            initially_on: None,
        }))
    }

    fn stamps(kind: DeviceKind) -> Option<Stamps> {
        stamp(&circuit(vec![("s1", vec![1, 0], kind)]), &mut vec![])
    }

    /// The resistance, by the program of the law.
    fn resistance(stamps: &Stamps, control: f64, mode: f64) -> f64 {
        let mut dag = Dag::default();
        let leaf = |dag: &mut Dag, leaf: &crate::circuit::stamps::Leaf, _: Span| {
            use crate::circuit::stamps::Leaf;
            let value = match leaf {
                Leaf::Unknown(k) if k.0 == 0 => 1.0,
                Leaf::Unknown(_) => control,
                _ => mode,
            };
            Ok::<_, ()>(dag.constant(value))
        };
        let node = dag.add(&stamps.laws[0].law, &mut { leaf }).unwrap();
        1.0 / dag.as_constant(node).unwrap()
    }

    #[test]
    fn goes_over_as_the_cubic_of_the_logarithm() {
        let forward = stamps(switch(1.0, 0.0, None)).unwrap();
        let backward = stamps(switch(0.0, 1.0, None)).unwrap();
        for (control, expected) in
            [(-1.0, 100.0), (0.0, 100.0), (0.5, 10.0), (1.0, 1.0), (3.0, 1.0)]
        {
            assert!((resistance(&forward, control, 0.0) / expected - 1.0).abs() < 1e-12);
            assert!((resistance(&backward, 1.0 - control, 0.0) / expected - 1.0).abs() < 1e-12);
        }
        let ratio = 0.01f64.ln();
        let expected = 10.0 * (-0.375 * ratio + 0.25 * ratio * 0.125).exp();
        assert!((resistance(&forward, 0.25, 0.0) / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn holds_within_its_hysteresis() {
        let stamps = stamps(switch(1.0, 0.0, Some((0.55, 0.45)))).unwrap();
        assert_eq!((stamps.modes[0].on, stamps.modes[0].off), (1.0, 0.0));
        assert!((resistance(&stamps, 0.56, 1.0) - 1.0).abs() < 1e-12);
        assert!((resistance(&stamps, 0.44, 0.0) - 100.0).abs() < 1e-12);
        assert!((resistance(&stamps, 0.275, 1.0) - 10.0).abs() < 1e-12);
        assert!((resistance(&stamps, 0.725, 0.0) - 10.0).abs() < 1e-12);
    }

    #[test]
    fn refuses_values_in_disorder() {
        assert!(stamps(switch(1.0, 1.0, None)).is_none());
        assert!(stamps(switch(1.0, 0.0, Some((1.5, 0.0)))).is_none());
    }
}
