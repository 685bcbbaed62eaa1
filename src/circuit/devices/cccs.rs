//! Current-controlled current source: i = β·i(control). The control is any device with two nodes.

use super::{Branch, Needs, Row};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "current-controlled current source",
    letters: "F",
    equation: "i = gain i(control)",
    needs: |_| Needs { branch: Branch::WhenRead, ..Needs::NOTHING },
    stamp,
    current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Cccs { gain, .. } = stamper.device(id).kind else { return };
    if !stamper.finite(id, &[("gain", gain)]) {
        return;
    }
    let law = current(stamper, id);
    match stamper.branch(id) {
        Some(branch) => {
            stamper.through(id, branch);
            stamper.conductance(Some(branch), Some(branch), 1.0);
            stamper.oppose(id, branch, law);
        }
        None => {
            let into = stamper.leaving(stamper.ends(id));
            stamper.add(id, law, into);
        }
    }
}

fn current(stamper: &Stamper, id: DeviceId) -> Current {
    let DeviceKind::Cccs { gain, control } = stamper.device(id).kind else {
        return Current::nothing();
    };
    stamper.current(control).scaled(gain)
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::{Cccs, Inductor, Resistor};
    use crate::circuit::devices::testing::*;
    use crate::circuit::{DeviceId, Output};

    #[test]
    fn follows_a_branch_or_a_resistor() {
        let stamps = stamps(vec![
            ("l1", vec![1, 0], Inductor { inductance: 1.0, initial: None }),
            ("r1", vec![2, 1], Resistor { resistance: 4.0 }),
            ("f1", vec![3, 0], Cccs { gain: 2.0, control: DeviceId(0) }),
            ("f2", vec![0, 3], Cccs { gain: 8.0, control: DeviceId(1) }),
        ]);
        // i(f1) = 2·i(l1) leaves node 3; i(f2) = 8·(v2 − v1)/4 enters it.
        assert_eq!(conductances(&stamps)[2], [2.0, -2.0, 0.0, 2.0]);
    }

    #[test]
    fn a_source_that_controls_itself_has_a_branch() {
        let stamps = stamps(vec![("f1", vec![1, 0], Cccs { gain: 0.5, control: DeviceId(0) })]);
        assert_eq!(conductances(&stamps), [[0.0, 1.0], [0.0, 1.0 - 0.5]]);
    }

    #[test]
    fn an_output_reads_it_without_a_branch() {
        let mut circuit = circuit(vec![
            ("l1", vec![1, 0], Inductor { inductance: 1.0, initial: None }),
            ("f1", vec![1, 0], Cccs { gain: 2.0, control: DeviceId(0) }),
        ]);
        let expr = crate::circuit::Expr::leaf(crate::circuit::Leaf::Current(DeviceId(1)));
        circuit.outputs.push(Output { name: "i(f1)".into(), expr });
        let stamps = crate::circuit::stamps::stamp(&circuit, &mut vec![]).unwrap();
        assert_eq!(stamps.unknowns.len(), 2);
        assert_eq!(value(&stamps.outputs[0].1, &[0.0, 3.0], &[], &[], 0.0), 6.0);
    }
}
