//! Resistor: v = R·i. R in Ω, of either sign; one that is 0 or next to it has a branch, since the difference of its
//! voltages would be rounding: 0 is a wire.
//!
//! Source: L. W. Nagel, SPICE2, UCB/ERL M520, 1975, section 3.

use super::{Branch, Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "resistor",
    letters: "R",
    equation: "v = R i",
    needs: |kind| match kind {
        DeviceKind::Resistor { resistance } if resistance.abs() < WIRE => Needs::BRANCH,
        _ => Needs { branch: Branch::Never, ..Needs::NOTHING },
    },
    stamp,
    current,
};

/// Below this a resistor is a wire, Ω.
const WIRE: f64 = 1e-15;

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Resistor { resistance } = stamper.device(id).kind else { return };
    if !stamper.finite(id, &[("resistance", resistance)]) {
        return;
    }
    let ends = stamper.ends(id);
    match stamper.branch(id) {
        Some(branch) => {
            stamper.through(id, branch);
            stamper.difference(Some(branch), ends, 1.0);
            stamper.conductance(Some(branch), Some(branch), -resistance);
        }
        None => {
            let [a, b] = ends;
            stamper.difference(a, [a, b], 1.0 / resistance);
            stamper.difference(b, [b, a], 1.0 / resistance);
        }
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::Resistor { resistance } = stamper.device(id).kind else {
        return Current::nothing();
    };
    let leaving = stamper.leaving(stamper.ends(id));
    Current::Linear(leaving).scaled(1.0 / resistance)
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Resistor;
    use crate::circuit::devices::testing::*;

    #[test]
    fn stamps_conductances() {
        let stamps = stamps(vec![
            ("r1", vec![1, 2], Resistor { resistance: 4.0 }),
            ("r2", vec![2, 0], Resistor { resistance: -2.0 }),
        ]);
        assert_eq!(conductances(&stamps), [[0.25, -0.25], [-0.25, 0.25 - 0.5]]);
    }

    #[test]
    fn zero_ohms_are_a_wire_with_a_current() {
        let stamps = stamps(vec![("R0", vec![1, 2], Resistor { resistance: 0.0 })]);
        assert_eq!(&*stamps.unknowns[2].name, "i(r0)");
        assert_eq!(conductances(&stamps), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]]);
    }

    #[test]
    fn a_resistor_of_no_value_is_an_error() {
        let circuit = circuit(vec![("r1", vec![1, 0], Resistor { resistance: f64::NAN })]);
        let mut diagnostics = vec![];
        assert!(crate::circuit::stamps::stamp(&circuit, &mut diagnostics).is_none());
        assert_eq!(diagnostics[0].code, "E0750");
    }
}
