//! Capacitor: q = C·v, i = dq/dt. C in F, of either sign; C = 0 is dropped.
//!
//! Under `uic` it starts with C·IC, or with what `.ic` says of its nodes where it has no `IC=` of its own.
//!
//! Source: L. W. Nagel, SPICE2, UCB/ERL M520, 1975, section 3.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::stamps::{Law, Leaf};
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "capacitor",
    letters: "C",
    equation: "i = d(C v)/dt",
    needs: |kind| match kind {
        DeviceKind::Capacitor { capacitance, .. } if *capacitance == 0.0 => Needs::NOTHING,
        _ => Needs { charge: true, ..Needs::NOTHING },
    },
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Capacitor { capacitance, initial } = stamper.device(id).kind else { return };
    let given = initial.or_else(|| stamper.initial_voltage(&stamper.device(id).nodes));
    if !stamper
        .finite(id, &[("capacitance", capacitance), ("initial voltage", given.unwrap_or(0.0))])
    {
        return;
    }
    let leaving = stamper.leaving(stamper.ends(id));
    if let Some(charge) = stamper.charge_mut(id) {
        charge.linear =
            leaving.iter().map(|(unknown, sign)| (*unknown, sign * capacitance)).collect();
        charge.into = leaving;
        charge.initial = given.map(|voltage| capacitance * voltage);
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    match stamper.charge(id) {
        Some(charge) => Current::Law(Law::leaf(Leaf::Rate(charge))),
        None => Current::nothing(),
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{BehaviouralVoltage, Capacitor};
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::{Law, Leaf, UnknownId, stamp};
    use crate::circuit::{self, DeviceId, NodeId};

    #[test]
    fn stamps_charge_and_initial_charge() {
        let stamps = stamps(vec![
            ("c1", vec![1, 2], Capacitor { capacitance: 2.0, initial: Some(3.0) }),
            ("c2", vec![2, 0], Capacitor { capacitance: 0.0, initial: Some(1.0) }),
            ("c3", vec![0, 2], Capacitor { capacitance: 5.0, initial: None }),
        ]);
        assert_eq!(capacitances(&stamps), [[2.0, -2.0], [-2.0, 2.0 + 5.0]]);
        assert_eq!(stamps.charges.iter().map(|q| q.initial).collect::<Vec<_>>(), [Some(6.0), None]);
        assert_eq!(stamps.charges[1].linear[..], [(UnknownId(1), -5.0)]);
        assert_eq!(stamps.charges[1].into[..], [(UnknownId(1), -1.0)]);
    }

    #[test]
    fn node_values_stand_in_for_a_missing_one() {
        let mut circuit = circuit(vec![
            ("c1", vec![1, 2], Capacitor { capacitance: 2.0, initial: None }),
            ("c2", vec![1, 0], Capacitor { capacitance: 2.0, initial: Some(7.0) }),
        ]);
        circuit.initial = vec![(NodeId(1), 9.0), (NodeId(1), 5.0), (NodeId(2), 1.0)];
        let stamps = stamp(&circuit, &mut vec![]).unwrap();
        assert_eq!(
            stamps.charges.iter().map(|q| q.initial).collect::<Vec<_>>(),
            [Some(8.0), Some(14.0)]
        );
        assert_eq!(stamps.initial.last(), Some(&(UnknownId(1), 1.0)));
    }

    #[test]
    fn its_current_is_the_rate_of_its_charge() {
        let law = circuit::Expr::leaf(circuit::Leaf::Current(DeviceId(0)));
        let stamps = stamps(vec![
            ("c1", vec![1, 0], Capacitor { capacitance: 2.0, initial: None }),
            ("b1", vec![2, 0], BehaviouralVoltage { law }),
        ]);
        assert_eq!(stamps.laws[0].law, Law::leaf(Leaf::Rate(0)));
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(2), -1.0)]);
    }
}
