//! Voltage-controlled voltage source: v = µ·(v(c+) − v(c−)).

use super::{Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "voltage-controlled voltage source",
    letters: "E",
    equation: "v = gain (v(c+) - v(c-))",
    needs: |_| Needs::BRANCH,
    stamp,
    current: no_current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Vcvs { gain, control } = stamper.device(id).kind else { return };
    let Some(branch) = stamper.branch(id) else { return };
    if !stamper.finite(id, &[("gain", gain)]) {
        return;
    }
    let (ends, control) = (stamper.ends(id), control.map(|node| stamper.node(node)));
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    stamper.difference(Some(branch), control, -gain);
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Vcvs;
    use crate::circuit::NodeId;
    use crate::circuit::devices::testing::*;

    #[test]
    fn stamps_a_branch_that_follows() {
        let control = [NodeId(2), NodeId(3)];
        let stamps = stamps(vec![
            ("e1", vec![1, 0], Vcvs { gain: 5.0, control }),
            ("e2", vec![3, 2], Vcvs { gain: 0.0, control }),
        ]);
        let g = conductances(&stamps);
        assert_eq!(g[3], [1.0, -5.0, 5.0, 0.0, 0.0]);
        assert_eq!((g[0][3], g[1][4], g[2][4]), (1.0, -1.0, 1.0));
    }
}
