//! Voltage-controlled current source: i = g·(v(c+) − v(c−)). g in S.

use super::{Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "voltage-controlled current source",
    letters: "G",
    equation: "i = gain (v(c+) - v(c-))",
    needs: |_| Needs::NOTHING,
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Vccs { gain, .. } = stamper.device(id).kind else { return };
    if stamper.finite(id, &[("gain", gain)]) {
        let into = stamper.leaving(stamper.ends(id));
        stamper.add(id, current(stamper, id), into);
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::Vccs { gain, control } = stamper.device(id).kind else {
        return Current::nothing();
    };
    Current::Linear(stamper.leaving(control.map(|node| stamper.node(node)))).scaled(gain)
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Vccs;
    use crate::circuit::NodeId;
    use crate::circuit::devices::testing::*;

    #[test]
    fn stamps_four_entries() {
        let control = [NodeId(3), NodeId(4)];
        let stamps = stamps(vec![
            ("g1", vec![1, 2], Vccs { gain: 2.0, control }),
            ("g2", vec![3, 4], Vccs { gain: 0.0, control }),
        ]);
        let g = conductances(&stamps);
        assert_eq!(g[0], [0.0, 0.0, 2.0, -2.0]);
        assert_eq!(g[1], [0.0, 0.0, -2.0, 2.0]);
        assert_eq!((&g[2], &g[3]), (&vec![0.0; 4], &vec![0.0; 4]));
    }
}
