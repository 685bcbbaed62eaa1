//! Behavioural current source: i = law(voltages, currents, time), from the first node through the source to the second.
//!
//! One whose current another device reads has it as an unknown: laws of laws stay small, and a law may speak of its own
//! current.

use super::{Branch, Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::{DeviceId, DeviceKind};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "behavioural current source",
    letters: "BG",
    equation: "i = law",
    needs: |_| Needs { branch: Branch::WhenRead, ..Needs::NOTHING },
    stamp,
    current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let law = current(stamper, id);
    match stamper.branch(id) {
        Some(branch) => {
            stamper.through(id, branch);
            stamper.conductance(Some(branch), Some(branch), 1.0);
            stamper.add(id, law, smallvec![(branch, -1.0)]);
        }
        None => {
            let into = stamper.leaving(stamper.ends(id));
            stamper.add(id, law, into);
        }
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    match &stamper.device(id).kind {
        DeviceKind::BehaviouralCurrent { law } => Current::Law(stamper.law(law)),
        _ => Current::nothing(),
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{BehaviouralCurrent, Ccvs};
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;
    use crate::circuit::{DeviceId, Expr, Leaf, NodeId};
    use crate::expr::Binary::Multiply;

    fn square() -> Expr {
        let v = || Expr::leaf(Leaf::Voltage(NodeId(2), NodeId(0)));
        v().binary(Multiply, v())
    }

    #[test]
    fn its_law_leaves_the_first_node() {
        let stamps = stamps(vec![("b1", vec![1, 2], BehaviouralCurrent { law: square() })]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(0), 1.0), (UnknownId(1), -1.0)]);
        assert_eq!(value(&stamps.laws[0].law, &[0.0, 3.0], &[], &[], 0.0), 9.0);
        assert!(stamps.conductances.is_empty());
    }

    #[test]
    fn has_a_branch_where_it_is_read() {
        let stamps = stamps(vec![
            ("b1", vec![1, 0], BehaviouralCurrent { law: square() }),
            ("h1", vec![2, 0], Ccvs { gain: 3.0, control: DeviceId(0) }),
        ]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(2), -1.0)]);
        let g = conductances(&stamps);
        assert_eq!((g[0][2], g[2][2], g[3][2]), (1.0, 1.0, -3.0));
    }
}
