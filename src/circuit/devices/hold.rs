//! Ideal sample and hold: v(first node) = v(second node) as it was just after the last of 0, T, 2T …
//!
//! It draws no current from the second node; the current of its branch runs from the first node to ground. Where several
//! hold at one instant, they do so in rounds: each sees the new values of those in the rounds before its own, and the old
//! ones of the others. Units: V, s. Source: K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 1997, ch. 2 (zero-order
//! hold).

use super::{Needs, Row};
use crate::circuit::stamper::{Stamper, voltage};
use crate::circuit::stamps::{MemoryKind, MemoryStamp};
use crate::circuit::{DeviceId, DeviceKind};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "sample and hold",
    letters: "S",
    equation: "v1(t) = v2(k·T) for k·T <= t < (k + 1)·T",
    needs: |_| Needs::BRANCH,
    stamp,
    current: super::no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Hold { period, round } = stamper.device(id).kind else { return };
    if !stamper.finite(id, &[("period", period)]) {
        return;
    }
    let (Some(branch), [held, sampled]) = (stamper.branch(id), stamper.ends(id)) else { return };
    stamper.conductance(held, Some(branch), 1.0);
    stamper.conductance(Some(branch), held, 1.0);
    stamper.stamps.memories.push(MemoryStamp {
        device: id,
        kind: MemoryKind::Hold { period, round },
        input: voltage([sampled, None]),
        into: smallvec![(branch, 1.0)],
        initial: None,
    });
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Hold;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;

    #[test]
    fn the_held_node_is_a_voltage_source() {
        let stamps = stamps(vec![("s1", vec![1, 2], Hold { period: 0.5, round: 0 })]);
        assert_eq!(conductances(&stamps), [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        let memory = &stamps.memories[0];
        assert_eq!(memory.into[..], [(UnknownId(2), 1.0)]);
        assert_eq!(value(&memory.input, &[5.0, 7.0, 0.0], &[], &[], 0.0), 7.0);
    }
}
