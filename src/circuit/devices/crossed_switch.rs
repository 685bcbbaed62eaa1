//! Switch with a negative hysteresis, as ngspice has it: within the band of its thresholds it is already what it is
//! becoming. It turns on when the control rises through the lower one, off when it falls through the upper one:
//!
//! ```text
//! control ≥ above: on;  control < below: off;  between: on when it came from below, off when it came from above
//! ```
//!
//! A mode remembers from which side it came. i = v/Ron or v/Roff. Source: ngspice manual, version 39, section 4.6.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper, voltage};
use crate::circuit::stamps::{Law, Leaf, Mode};
use crate::circuit::{DeviceId, DeviceKind};
use crate::expr::{Binary, Node, Unary};
use crate::source::Span;

/// The row of the table.
pub const ROW: Row = Row {
    name: "switch of negative hysteresis",
    letters: "SW",
    equation: "i = v / (on ? Ron : Roff)",
    needs: |_| Needs { mode: true, ..Needs::NOTHING },
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::CrossedSwitch {
        control,
        above,
        below,
        on_resistance,
        off_resistance,
        initially_on,
    } = &stamper.device(id).kind
    else {
        return;
    };
    let values = [
        ("Ron", *on_resistance),
        ("Roff", *off_resistance),
        ("upper threshold", *above),
        ("lower threshold", *below),
    ];
    if !stamper.finite(id, &values) {
        return;
    }
    if *on_resistance == 0.0 || *off_resistance == 0.0 {
        let name = stamper.device(id).name.clone();
        return stamper.error("E0752", id, format!("a resistance of the switch `{name}` is 0"));
    }
    let control = stamper.law(control);
    if let Some(mode) = stamper.mode(id).and_then(|k| stamper.stamps.modes.get_mut(k as usize)) {
        // On within the band means that it came from below.
        let initial = initially_on.map(|on| !on);
        *mode = Mode { device: id, control, on: *above, off: *below, initial, course: None };
    }
    let into = stamper.leaving(stamper.ends(id));
    stamper.add(id, current(stamper, id), into);
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let (
        DeviceKind::CrossedSwitch { control, above, below, on_resistance, off_resistance, .. },
        Some(mode),
    ) = (&stamper.device(id).kind, stamper.mode(id))
    else {
        return Current::nothing();
    };
    let at_least =
        |limit: f64| stamper.law(control).binary(Binary::GreaterEqual, Law::number(limit));
    let choice = |c, a, b| Law::new(Node::choice(c, a, b), Span::NONE);
    let from_below = Law::new(Node::Unary(Unary::Not, Law::leaf(Leaf::Mode(mode))), Span::NONE);
    let within = choice(at_least(*below), from_below, Law::number(0.0));
    let closed = choice(at_least(*above), Law::number(1.0), within);
    let conductance =
        choice(closed, Law::number(1.0 / on_resistance), Law::number(1.0 / off_resistance));
    Current::Law(conductance.binary(Binary::Multiply, voltage(stamper.ends(id))))
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::CrossedSwitch;
    use crate::circuit::devices::testing::*;
    use crate::circuit::{Expr, Leaf, NodeId};

    #[test]
    fn within_the_band_it_is_what_it_is_becoming() {
        let switch = CrossedSwitch {
            control: Box::new(Expr::leaf(Leaf::Voltage(NodeId(2), NodeId(0)))),
            above: 2.0,
            below: 1.0,
            on_resistance: 0.5,
            off_resistance: 4.0,
            initially_on: Some(true),
        };
        let stamps = stamps(vec![("s1", vec![1, 0], switch)]);
        let law = &stamps.laws[0].law;
        // The control, whether it was above last, and the conductance.
        for (control, mode, expected) in
            [(2.5, 1.0, 2.0), (1.5, 1.0, 0.25), (0.5, 0.0, 0.25), (1.5, 0.0, 2.0), (2.0, 0.0, 2.0)]
        {
            assert_eq!(
                value(law, &[1.0, control], &[mode], &[], 0.0),
                expected,
                "{control} {mode}"
            );
        }
        assert_eq!(stamps.modes[0].initial, Some(false));
    }
}
