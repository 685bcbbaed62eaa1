//! Behavioural voltage source: v = law(voltages, currents, time).

use super::{Needs, Row, no_current};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::{DeviceId, DeviceKind};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "behavioural voltage source",
    letters: "BE",
    equation: "v = law",
    needs: |_| Needs::BRANCH,
    stamp,
    current: no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::BehaviouralVoltage { law } = &stamper.device(id).kind else { return };
    let Some(branch) = stamper.branch(id) else { return };
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    // As a term with the factor −1 and not as −law: equal laws of several cards then stay equal.
    stamper.add(id, Current::Law(stamper.law(law)), smallvec![(branch, -1.0)]);
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{BehaviouralVoltage, Resistor};
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;
    use crate::circuit::{DeviceId, Expr, Leaf, NodeId};
    use crate::expr::Binary::Multiply;

    #[test]
    fn stamps_a_branch_that_its_law_enters() {
        let square = Expr::leaf(Leaf::Voltage(NodeId(2), NodeId(1)))
            .binary(Multiply, Expr::leaf(Leaf::Current(DeviceId(1))))
            .binary(Multiply, Expr::leaf(Leaf::Time));
        let stamps = stamps(vec![
            ("b1", vec![1, 0], BehaviouralVoltage { law: square }),
            ("r1", vec![0, 2], Resistor { resistance: 2.0 }),
        ]);
        assert_eq!(conductances(&stamps)[2], [1.0, 0.0, 0.0]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(2), -1.0)]);
        // v(2, 1) = 4, i(r1) = −6/2, t = 10
        assert_eq!(value(&stamps.laws[0].law, &[2.0, 6.0, 0.0], &[], &[], 10.0), 4.0 * -3.0 * 10.0);
    }
}
