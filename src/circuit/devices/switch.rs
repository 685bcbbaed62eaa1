//! Switch with two resistances and hysteresis: i = g·v, g = 1/Ron or 1/Roff by a mode.
//!
//! The mode becomes 1 when the control (a voltage or a current) rises through its upper threshold and 0 when it falls
//! through its lower one: the SW and CSW of SPICE3 with Vt ± Vh, It ± Ih (T. Quarles, UCB/ERL M89/42, 1989). Where both
//! thresholds are one the switch remembers nothing: on is a condition of its law like any other, along which the
//! solution may slide.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper, voltage};
use crate::circuit::stamps::{Law, Leaf, Mode};
use crate::circuit::{DeviceId, DeviceKind};
use crate::expr::{Binary, Node};
use crate::source::Span;

/// The row of the table.
pub const ROW: Row = Row {
    name: "switch",
    letters: "SW",
    equation: "i = v / (on ? Ron : Roff)",
    needs: |kind| Needs { mode: remembers(kind), ..Needs::NOTHING },
    stamp,
    current,
};

/// Whether its thresholds differ.
fn remembers(kind: &DeviceKind) -> bool {
    matches!(kind, DeviceKind::Switch { on, off, .. } if on != off)
}

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Switch { control, on, off, on_resistance, off_resistance, initially_on } =
        &stamper.device(id).kind
    else {
        return;
    };
    let values = [
        ("Ron", *on_resistance),
        ("Roff", *off_resistance),
        ("upper threshold", *on),
        ("lower threshold", *off),
    ];
    if !stamper.finite(id, &values) {
        return;
    }
    let name = &stamper.device(id).name;
    if *on_resistance == 0.0 || *off_resistance == 0.0 {
        return stamper.error("E0752", id, format!("a resistance of the switch `{name}` is 0"));
    }
    if off > on {
        return stamper.error(
            "E0752",
            id,
            format!("the hysteresis of the switch `{name}` is negative"),
        );
    }
    let control = stamper.law(control);
    if let Some(mode) = stamper.mode(id).and_then(|k| stamper.stamps.modes.get_mut(k as usize)) {
        *mode =
            Mode { device: id, control, on: *on, off: *off, initial: *initially_on, course: None };
    }
    let into = stamper.leaving(stamper.ends(id));
    stamper.add(id, current(stamper, id), into);
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::Switch { control, on, on_resistance, off_resistance, .. } =
        &stamper.device(id).kind
    else {
        return Current::nothing();
    };
    let closed = match stamper.mode(id) {
        Some(mode) => Law::leaf(Leaf::Mode(mode)),
        None => stamper.law(control).binary(Binary::GreaterEqual, Law::number(*on)),
    };
    let (on, off) = (Law::number(1.0 / on_resistance), Law::number(1.0 / off_resistance));
    let conductance = Law::new(Node::choice(closed, on, off), Span::NONE);
    Current::Law(conductance.binary(Binary::Multiply, voltage(stamper.ends(id))))
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Switch;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::{Law, Leaf, UnknownId, stamp};
    use crate::circuit::{self, Expr, NodeId};

    fn switch(on: f64, off: f64) -> circuit::DeviceKind {
        let control = Box::new(Expr::leaf(circuit::Leaf::Voltage(NodeId(3), NodeId(0))));
        Switch {
            control,
            on,
            off,
            on_resistance: 0.5,
            off_resistance: 4.0,
            initially_on: Some(true),
        }
    }

    #[test]
    fn conducts_by_its_mode() {
        let stamps = stamps(vec![("s1", vec![1, 2], switch(2.0, 1.0))]);
        let law = &stamps.laws[0];
        assert_eq!(law.into[..], [(UnknownId(0), 1.0), (UnknownId(1), -1.0)]);
        assert_eq!(value(&law.law, &[5.0, 1.0, 0.0], &[1.0], &[], 0.0), 8.0);
        assert_eq!(value(&law.law, &[5.0, 1.0, 0.0], &[0.0], &[], 0.0), 1.0);
        let mode = &stamps.modes[0];
        assert_eq!((mode.on, mode.off, mode.initial), (2.0, 1.0, Some(true)));
        assert_eq!(mode.control, Law::leaf(Leaf::Unknown(UnknownId(2))));
    }

    #[test]
    fn without_hysteresis_it_conducts_by_its_control() {
        let stamps = stamps(vec![("s1", vec![1, 2], switch(2.0, 2.0))]);
        assert!(stamps.modes.is_empty());
        let law = &stamps.laws[0].law;
        assert_eq!(value(law, &[5.0, 1.0, 2.0], &[], &[], 0.0), 8.0);
        assert_eq!(value(law, &[5.0, 1.0, 1.9], &[], &[], 0.0), 1.0);
    }

    #[test]
    fn refuses_crossed_thresholds() {
        let mut diagnostics = vec![];
        assert!(
            stamp(&circuit(vec![("s1", vec![1, 3], switch(1.0, 2.0))]), &mut diagnostics).is_none()
        );
        assert_eq!(diagnostics[0].code, "E0752");
    }
}
