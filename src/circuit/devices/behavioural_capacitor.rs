//! Behavioural capacitor, between nodes with the voltage v across them:
//!
//! ```text
//! Q given:  q = law(voltages, currents, time),  i = dq/dt
//! C given:  i = law·dv/dt, whatever the law speaks of
//! ```
//!
//! The second is what ngspice and Xyce mean by `C={…}`; where the law speaks of v alone it is the derivative of a charge,
//! else it need not be. dv/dt is an unknown w with the row w − dv/dt = 0. Units: C, F, V, s.
//!
//! Sources: ngspice manual, version 39, section 3.2.8; Xyce Reference Guide, version 7, table of the capacitor.

use super::{Needs, Row, stored_at};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::stamps::{Law, Leaf};
use crate::circuit::{DeviceId, DeviceKind, LawOf};
use crate::expr::Binary;
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "behavioural capacitor",
    letters: "C",
    equation: "i = d(law)/dt, or i = law dv/dt",
    needs: |kind| match kind {
        DeviceKind::BehaviouralCapacitor { law_of: LawOf::Factor, .. } => {
            Needs { charge: true, hidden: 1, ..Needs::NOTHING }
        }
        _ => Needs { charge: true, ..Needs::NOTHING },
    },
    stamp,
    current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::BehaviouralCapacitor { law, law_of, initial } = &stamper.device(id).kind else {
        return;
    };
    let given = initial.or_else(|| stamper.initial_voltage(&stamper.device(id).nodes));
    if !stamper.finite(id, &[("initial voltage", given.unwrap_or(0.0))]) {
        return;
    }
    let leaving = stamper.leaving(stamper.ends(id));
    match (law_of, stamper.hidden(id, 0)) {
        (LawOf::Factor, Some(rate)) => {
            stamper.conductance(Some(rate), Some(rate), 1.0);
            let through = current(stamper, id);
            stamper.add(id, through, leaving.clone());
            if let Some(charge) = stamper.charge_mut(id) {
                charge.linear = leaving;
                charge.into = smallvec![(rate, -1.0)];
                charge.initial = given;
            }
        }
        _ => {
            let stored = stamper.law(law);
            let start = match given.map(|value| stored_at(stamper, id, value)) {
                Some(None) => return,
                other => other.flatten(),
            };
            if let Some(charge) = stamper.charge_mut(id) {
                charge.initial = start;
                charge.law = Some(stored);
                charge.into = leaving;
            }
        }
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::BehaviouralCapacitor { law, .. } = &stamper.device(id).kind else {
        return Current::nothing();
    };
    match (stamper.hidden(id, 0), stamper.charge(id)) {
        (Some(rate), _) => {
            let rate = Law::leaf(Leaf::Unknown(rate));
            Current::Law(stamper.law(law).binary(Binary::Multiply, rate))
        }
        (None, Some(charge)) => Current::Law(Law::leaf(Leaf::Rate(charge))),
        (None, None) => Current::nothing(),
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::BehaviouralCapacitor;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;
    use crate::circuit::{Expr, LawOf, Leaf, NodeId};
    use crate::expr::Binary::Multiply;

    fn square() -> Expr {
        let v = || Expr::leaf(Leaf::Voltage(NodeId(1), NodeId(0)));
        v().binary(Multiply, v())
    }

    #[test]
    fn a_charge_enters_its_nodes() {
        let kind = BehaviouralCapacitor { law: square(), law_of: LawOf::Stored, initial: None };
        let stamps = stamps(vec![("c1", vec![1, 0], kind)]);
        let charge = &stamps.charges[0];
        assert_eq!(charge.into[..], [(UnknownId(0), 1.0)]);
        assert_eq!(value(charge.law.as_ref().unwrap(), &[3.0], &[], &[], 0.0), 9.0);
    }

    #[test]
    fn a_capacitance_multiplies_the_rate_of_its_voltage() {
        let kind =
            BehaviouralCapacitor { law: square(), law_of: LawOf::Factor, initial: Some(2.0) };
        let stamps = stamps(vec![("c1", vec![1, 0], kind)]);
        // w − dv/dt = 0; v² w leaves node 1.
        assert_eq!(conductances(&stamps), [[0.0, 0.0], [0.0, 1.0]]);
        assert_eq!(capacitances(&stamps), [[0.0, 0.0], [-1.0, 0.0]]);
        assert_eq!(stamps.charges[0].initial, Some(2.0));
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(0), 1.0)]);
        assert_eq!(value(&stamps.laws[0].law, &[3.0, 5.0], &[], &[], 0.0), 45.0);
        assert_eq!(stamps.outputs.len(), 1);
    }
}
