//! Values that laws speak of and that no tree of theirs can say, each an unknown u:
//!
//! ```text
//! derivative  u − d(law)/dt = 0
//! integral    du/dt − law = 0,  u(0) = initial
//! delay       x − law = 0,  u = x(t − T); until the first delay is over x as it was at the start
//! signal      u = waveform(t), its corners landed on
//! ```
//!
//! They stand between no nodes and draw no current; what laws read as their current is u.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::stamps::{Law, Leaf, MemoryKind, MemoryStamp};
use crate::circuit::{DeviceId, DeviceKind, Parts, Quantity};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "quantity",
    letters: "",
    equation: "u = d(law)/dt, du/dt = law, u = law(t - T), u = waveform(t)",
    needs: |kind| match kind {
        DeviceKind::Quantity(Quantity::Derivative { .. } | Quantity::Integral { .. }) => {
            Needs { charge: true, hidden: 1, ..Needs::NOTHING }
        }
        DeviceKind::Quantity(Quantity::Delay { .. }) => Needs { hidden: 2, ..Needs::NOTHING },
        _ => Needs { hidden: 1, ..Needs::NOTHING },
    },
    stamp,
    current: |stamper, id| {
        Current::Linear(stamper.hidden(id, 0).map(|u| (u, 1.0)).into_iter().collect())
    },
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Quantity(quantity) = &stamper.device(id).kind else { return };
    let Some(own) = stamper.hidden(id, 0) else { return };
    match quantity {
        Quantity::Derivative { law } => {
            stamper.conductance(Some(own), Some(own), 1.0);
            let law = stamper.law(law);
            if let Some(charge) = stamper.charge_mut(id) {
                charge.law = Some(law);
                charge.into = smallvec![(own, -1.0)];
            }
        }
        Quantity::Integral { law, initial, pinned } => {
            if !stamper.finite(id, &[("initial value", *initial)]) {
                return;
            }
            let law = stamper.law(law);
            stamper.add_law(id, law, smallvec![(own, -1.0)]);
            if let Some(charge) = stamper.charge_mut(id) {
                charge.linear = smallvec![(own, 1.0)];
                charge.into = smallvec![(own, 1.0)];
                charge.initial = Some(*initial);
                charge.pinned = *pinned;
            }
        }
        Quantity::Delay { law, by } => {
            if !stamper.finite(id, &[("delay", *by)]) {
                return;
            }
            if *by <= 0.0 {
                let name = stamper.device(id).name.clone();
                return stamper.error("E0754", id, format!("the delay `{name}` must be above 0"));
            }
            let Some(input) = stamper.hidden(id, 1) else { return };
            stamper.conductance(Some(input), Some(input), 1.0);
            let law = stamper.law(law);
            stamper.add_law(id, law, smallvec![(input, -1.0)]);
            stamper.conductance(Some(own), Some(own), 1.0);
            stamper.stamps.memories.push(MemoryStamp {
                device: id,
                kind: MemoryKind::Delay { by: *by },
                input: Law::leaf(Leaf::Unknown(input)),
                into: smallvec![(own, 1.0)],
                initial: None,
            });
        }
        Quantity::Signal { waveform } => {
            stamper.conductance(Some(own), Some(own), 1.0);
            stamper.add_source(id, waveform, Parts::default(), smallvec![(own, 1.0)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{self, BehaviouralVoltage};
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::{MemoryKind, UnknownId, stamp};
    use crate::circuit::{DeviceId, Expr, Leaf, NodeId, Quantity, Waveform};
    use crate::expr::Binary::Multiply;

    fn square() -> Expr {
        let v = || Expr::leaf(Leaf::Voltage(NodeId(1), NodeId(0)));
        v().binary(Multiply, v())
    }

    /// A source that says what a quantity of v(1)² is, at node 1.
    fn read(quantity: Quantity) -> crate::circuit::stamps::Stamps {
        let law = Expr::leaf(Leaf::Current(DeviceId(1)));
        stamps(vec![
            ("b1", vec![1, 0], BehaviouralVoltage { law }),
            ("u", vec![], DeviceKind::Quantity(quantity)),
        ])
    }

    #[test]
    fn derivatives_and_integrals_are_rows_with_a_charge() {
        // v1, i(b1), u
        let stamps = read(Quantity::Derivative { law: square() });
        assert_eq!(conductances(&stamps)[2], [0.0, 0.0, 1.0]);
        assert_eq!(stamps.charges[0].into[..], [(UnknownId(2), -1.0)]);
        assert_eq!(value(stamps.charges[0].law.as_ref().unwrap(), &[3.0], &[], &[], 0.0), 9.0);
        assert_eq!(value(&stamps.laws[0].law, &[0.0, 0.0, 7.0], &[], &[], 0.0), 7.0);
        let stamps = read(Quantity::Integral { law: square(), initial: 4.0, pinned: true });
        assert_eq!(capacitances(&stamps)[2], [0.0, 0.0, 1.0]);
        assert_eq!((stamps.charges[0].initial, stamps.charges[0].pinned), (Some(4.0), true));
        assert_eq!(stamps.laws[1].into[..], [(UnknownId(2), -1.0)]);
        assert_eq!(value(&stamps.laws[1].law, &[3.0], &[], &[], 0.0), 9.0);
        assert_eq!(stamps.outputs.len(), 2);
    }

    #[test]
    fn delays_and_signals_are_right_hand_sides() {
        let stamps = read(Quantity::Delay { law: square(), by: 0.5 });
        assert_eq!(conductances(&stamps)[2], [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(conductances(&stamps)[3], [0.0, 0.0, 0.0, 1.0]);
        let memory = &stamps.memories[0];
        assert_eq!(
            (memory.kind, &*memory.into),
            (MemoryKind::Delay { by: 0.5 }, &[(UnknownId(2), 1.0)][..])
        );
        assert_eq!(value(&memory.input, &[0.0, 0.0, 0.0, 8.0], &[], &[], 0.0), 8.0);
        let waveform = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 6.0)]);
        assert_eq!(
            sources(&read(Quantity::Signal { waveform: Box::new(waveform) }), 0.5),
            [0.0, 0.0, 3.0]
        );
    }

    #[test]
    fn a_delay_of_nothing_is_refused() {
        let quantity = Quantity::Delay { law: square(), by: 0.0 };
        let circuit = circuit(vec![
            ("r1", vec![1, 0], DeviceKind::Resistor { resistance: 1.0 }),
            ("u", vec![], DeviceKind::Quantity(quantity)),
        ]);
        let mut diagnostics = vec![];
        assert!(stamp(&circuit, &mut diagnostics).is_none());
        assert_eq!(diagnostics[0].code, "E0754");
    }
}
