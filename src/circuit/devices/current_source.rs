//! Independent current source: i = j(t). j in A, from the first node through the source to the second.
//!
//! A source whose current is read has it as an unknown, since a waveform is no expression.

use super::{Branch, Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "current source",
    letters: "I",
    equation: "i = j(t)",
    needs: |_| Needs { branch: Branch::WhenObserved, ..Needs::NOTHING },
    stamp,
    current: no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::CurrentSource { waveform, parts } = &stamper.device(id).kind else { return };
    match stamper.branch(id) {
        Some(branch) => {
            stamper.through(id, branch);
            stamper.conductance(Some(branch), Some(branch), 1.0);
            stamper.add_source(id, waveform, **parts, smallvec![(branch, 1.0)]);
        }
        None => {
            let leaving = stamper.leaving(stamper.ends(id));
            let right = leaving.into_iter().map(|(row, sign)| (row, -sign)).collect();
            stamper.add_source(id, waveform, **parts, right);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{Ccvs, CurrentSource};
    use crate::circuit::devices::testing::*;
    use crate::circuit::{DeviceId, Waveform};

    #[test]
    fn draws_from_its_first_node() {
        let waveform = Waveform::Constant(2.0);
        let stamps = stamps(vec![(
            "i1",
            vec![1, 2],
            CurrentSource { waveform: Box::new(waveform), parts: Box::default() },
        )]);
        assert_eq!(sources(&stamps, 0.0), [-2.0, 2.0]);
    }

    #[test]
    fn has_a_branch_where_it_is_read() {
        let waveform = Waveform::Constant(2.0);
        let stamps = stamps(vec![
            (
                "i1",
                vec![1, 0],
                CurrentSource { waveform: Box::new(waveform), parts: Box::default() },
            ),
            ("h1", vec![2, 0], Ccvs { gain: 3.0, control: DeviceId(0) }),
        ]);
        let expected = [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 1.0, -3.0, 0.0],
        ];
        assert_eq!(conductances(&stamps), expected);
        assert_eq!(sources(&stamps, 0.0), [0.0, 0.0, 2.0, 0.0]);
    }
}
