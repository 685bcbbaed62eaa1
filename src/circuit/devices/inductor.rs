//! Inductor: Φ = L·i (+ M·i of those it is coupled to), v = dΦ/dt. L in H, of either sign; L = 0 is a wire.
//!
//! Source: L. W. Nagel, SPICE2, UCB/ERL M520, 1975, section 3.

use super::{Branch, Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "inductor",
    letters: "L",
    equation: "v = d(L i)/dt",
    needs: |_| Needs { branch: Branch::Always, charge: true, ..Needs::NOTHING },
    stamp,
    current: no_current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Inductor { inductance, initial } = stamper.device(id).kind else { return };
    if !stamper
        .finite(id, &[("inductance", inductance), ("initial current", initial.unwrap_or(0.0))])
    {
        return;
    }
    let Some(branch) = stamper.branch(id) else { return };
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    if let Some(flux) = stamper.charge_mut(id) {
        flux.linear.insert(0, (branch, inductance));
        flux.into.push((branch, -1.0));
        // A coupling may have written its part before.
        if let Some(current) = initial {
            flux.initial = Some(flux.initial.unwrap_or(0.0) + inductance * current);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::Inductor;
    use crate::circuit::devices::testing::*;

    #[test]
    fn stamps_a_branch_with_a_flux() {
        let stamps =
            stamps(vec![("L1", vec![1, 2], Inductor { inductance: 3.0, initial: Some(0.5) })]);
        assert_eq!(&*stamps.unknowns[2].name, "i(l1)");
        assert_eq!(conductances(&stamps), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]]);
        assert_eq!(capacitances(&stamps), [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -3.0]]);
        assert_eq!(stamps.charges[0].initial, Some(1.5));
    }
}
