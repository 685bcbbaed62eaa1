//! Lossless transmission line of impedance Z and delay T, by the waves that arrive at its ends (F. H. Branin, Proc. IEEE
//! 55:2012, 1967):
//!
//! ```text
//! v1(t) − Z·i1(t) = v2(t − T) + Z·i2(t − T)
//! v2(t) − Z·i2(t) = v1(t − T) + Z·i1(t − T)
//! ```
//!
//! i1 and i2 run into the first node of each port and out of its second. Until the first delay is over the waves are those
//! of the initial values. Units: V, A, Ω, s.

use super::{Branch, Needs, Row};
use crate::circuit::stamper::{Stamper, voltage};
use crate::circuit::stamps::{Law, Leaf, MemoryKind, MemoryStamp, UnknownId};
use crate::circuit::{DeviceId, DeviceKind};
use crate::expr::Binary;
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "lossless line",
    letters: "T",
    equation: "v1 − Z·i1 = (v2 + Z·i2)(t − T), and the other way round",
    needs: |_| Needs { branch: Branch::Always, second: true, ..Needs::NOTHING },
    stamp,
    current: super::no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let device = stamper.device(id);
    let DeviceKind::Line { impedance, delay, initial } = &device.kind else { return };
    let (impedance, delay) = (*impedance, *delay);
    if !stamper.finite(id, &[("impedance", impedance), ("delay", delay)]) {
        return;
    }
    if impedance <= 0.0 || delay <= 0.0 {
        let message = format!("impedance and delay of the line `{}` must be above 0", device.name);
        return stamper.error("E0754", id, message);
    }
    let (Some(first), Some(second), [a, b, c, d]) =
        (stamper.branch(id), stamper.second(id), stamper.four_ends(id))
    else {
        return;
    };
    let ports = [(first, [a, b]), (second, [c, d])];
    for (branch, [plus, minus]) in ports {
        stamper.conductance(plus, Some(branch), 1.0);
        stamper.conductance(minus, Some(branch), -1.0);
        stamper.difference(Some(branch), [plus, minus], 1.0);
        stamper.conductance(Some(branch), Some(branch), -impedance);
    }
    let wave = |(branch, ends): (UnknownId, [Option<UnknownId>; 2])| {
        let current = Law::leaf(Leaf::Unknown(branch));
        voltage(ends).binary(Binary::Add, Law::number(impedance).binary(Binary::Multiply, current))
    };
    let start =
        initial.as_deref().map(|[v1, i1, v2, i2]| [v1 + impedance * i1, v2 + impedance * i2]);
    for (row, from, initial) in [(0, 1, start.map(|s| s[1])), (1, 0, start.map(|s| s[0]))] {
        stamper.stamps.memories.push(MemoryStamp {
            device: id,
            kind: MemoryKind::Delay { by: delay },
            input: wave(ports[from]),
            into: smallvec![(ports[row].0, 1.0)],
            initial,
        });
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Line;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::{MemoryKind, UnknownId, stamp};

    #[test]
    fn each_end_sees_the_wave_of_the_other() {
        let line =
            Line { impedance: 50.0, delay: 1e-9, initial: Some(Box::new([1.0, 0.02, 3.0, -0.04])) };
        let stamps = stamps(vec![("t1", vec![1, 0, 2, 3], line)]);
        // v1 v2 v3 i1 i2
        assert_eq!(
            conductances(&stamps),
            [
                [0.0, 0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0],
                [0.0, 0.0, 0.0, 0.0, -1.0],
                [1.0, 0.0, 0.0, -50.0, 0.0],
                [0.0, 1.0, -1.0, 0.0, -50.0],
            ]
        );
        let at = |k: usize| {
            let memory = &stamps.memories[k];
            (
                memory.into[0],
                value(&memory.input, &[5.0, 7.0, 4.0, 0.1, 0.2], &[], &[], 0.0),
                memory.initial,
            )
        };
        assert_eq!(at(0), ((UnknownId(3), 1.0), 7.0 - 4.0 + 10.0, Some(1.0)));
        assert_eq!(at(1), ((UnknownId(4), 1.0), 5.0 + 5.0, Some(2.0)));
        assert_eq!(stamps.memories[0].kind, MemoryKind::Delay { by: 1e-9 });
    }

    #[test]
    fn refuses_a_line_without_delay() {
        let line = Line { impedance: 50.0, delay: 0.0, initial: None };
        let mut diagnostics = vec![];
        assert!(stamp(&circuit(vec![("t1", vec![1, 0, 2, 0], line)]), &mut diagnostics).is_none());
        assert_eq!(diagnostics[0].code, "E0754");
    }
}
