//! Independent voltage source: v = e(t). e in V; its current runs from + through the source to −.

use super::{Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "voltage source",
    letters: "V",
    equation: "v = e(t)",
    needs: |_| Needs::BRANCH,
    stamp,
    current: no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::VoltageSource { waveform, parts } = &stamper.device(id).kind else { return };
    let Some(branch) = stamper.branch(id) else { return };
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    stamper.add_source(id, waveform, **parts, smallvec![(branch, 1.0)]);
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::VoltageSource;
    use crate::circuit::Waveform;
    use crate::circuit::devices::testing::*;

    #[test]
    fn stamps_a_branch_and_a_right_hand_side() {
        let waveform = Waveform::Pwl(vec![(0.0, 0.0), (1.0, 6.0)]);
        let stamps = stamps(vec![(
            "v1",
            vec![1, 2],
            VoltageSource { waveform: Box::new(waveform), parts: Box::default() },
        )]);
        assert_eq!(conductances(&stamps), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]]);
        assert_eq!(sources(&stamps, 0.5), [0.0, 0.0, 3.0]);
    }
}
