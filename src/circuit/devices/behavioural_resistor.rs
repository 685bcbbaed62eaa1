//! Behavioural resistor: v = R·i with R = law(voltages, currents, time), in Ω.
//!
//! Its current is an unknown, so that R may pass through 0 and may speak of the current itself.

use super::{Needs, Row, no_current};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::stamps::{Law, Leaf};
use crate::circuit::{DeviceId, DeviceKind};
use crate::expr::Binary;
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "behavioural resistor",
    letters: "R",
    equation: "v = law i",
    needs: |_| Needs::BRANCH,
    stamp,
    current: no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::BehaviouralResistor { law } = &stamper.device(id).kind else { return };
    let Some(branch) = stamper.branch(id) else { return };
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    let drop = stamper.law(law).binary(Binary::Multiply, Law::leaf(Leaf::Unknown(branch)));
    stamper.add(id, Current::Law(drop), smallvec![(branch, -1.0)]);
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::BehaviouralResistor;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;
    use crate::circuit::{Expr, Leaf, NodeId};
    use crate::expr::Binary::Add;

    #[test]
    fn drops_its_law_times_its_current() {
        let law = Expr::leaf(Leaf::Voltage(NodeId(2), NodeId(0))).binary(Add, Expr::number(1.0));
        let stamps = stamps(vec![("r1", vec![1, 2], BehaviouralResistor { law })]);
        assert_eq!(conductances(&stamps), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(2), -1.0)]);
        // R = v2 + 1 = 4, i = 5
        assert_eq!(value(&stamps.laws[0].law, &[7.0, 3.0, 5.0], &[], &[], 0.0), 20.0);
    }
}
