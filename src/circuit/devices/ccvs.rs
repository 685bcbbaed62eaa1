//! Current-controlled voltage source: v = r·i(control). r in Ω. The control is any device with two nodes.

use super::{Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "current-controlled voltage source",
    letters: "H",
    equation: "v = gain i(control)",
    needs: |_| Needs::BRANCH,
    stamp,
    current: no_current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Ccvs { gain, control } = stamper.device(id).kind else { return };
    let Some(branch) = stamper.branch(id) else { return };
    if !stamper.finite(id, &[("gain", gain)]) {
        return;
    }
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    let current = stamper.current(control).scaled(gain);
    stamper.oppose(id, branch, current);
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceId;
    use crate::circuit::DeviceKind::{Capacitor, Ccvs, VoltageSource};
    use crate::circuit::Waveform;
    use crate::circuit::devices::testing::*;

    #[test]
    fn follows_a_branch_or_a_rate() {
        let stamps = stamps(vec![
            (
                "v1",
                vec![1, 0],
                VoltageSource {
                    waveform: Box::new(Waveform::Constant(0.0)),
                    parts: Box::default(),
                },
            ),
            ("h1", vec![2, 0], Ccvs { gain: 3.0, control: DeviceId(0) }),
            ("c1", vec![2, 0], Capacitor { capacitance: 1.0, initial: None }),
            ("h2", vec![3, 2], Ccvs { gain: 7.0, control: DeviceId(2) }),
        ]);
        let g = conductances(&stamps);
        assert_eq!(g[4], [0.0, 1.0, 0.0, -3.0, 0.0, 0.0]);
        assert_eq!(g[5], [0.0, -1.0, 1.0, 0.0, 0.0, 0.0]);
        let law = &stamps.laws[0];
        assert_eq!(law.into[..], [(crate::circuit::stamps::UnknownId(5), 1.0)]);
        assert_eq!(value(&law.law, &[], &[], &[2.0], 0.0), -14.0);
    }
}
