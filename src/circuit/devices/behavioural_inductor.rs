//! Behavioural inductor with the current i through it:
//!
//! ```text
//! flux given:        Φ = law(currents, voltages, time),  v = dΦ/dt
//! inductance given:  v = law·di/dt, whatever the law speaks of
//! ```
//!
//! di/dt is then an unknown w with the row w − di/dt = 0. Units: Wb, H, A, s.
//!
//! Sources: LTspice help, L (`Flux=`); ngspice manual, version 39, section 3.2.12 (`L=`).

use super::{Branch, Needs, Row, no_current, stored_at};
use crate::circuit::stamper::{Current, Stamper};
use crate::circuit::stamps::{Law, Leaf};
use crate::circuit::{DeviceId, DeviceKind, LawOf};
use crate::expr::Binary;
use smallvec::smallvec;

/// The row of the table.
pub const ROW: Row = Row {
    name: "behavioural inductor",
    letters: "L",
    equation: "v = d(law)/dt, or v = law di/dt",
    needs: |kind| {
        let hidden = match kind {
            DeviceKind::BehaviouralInductor { law_of: LawOf::Factor, .. } => 1,
            _ => 0,
        };
        Needs { branch: Branch::Always, charge: true, hidden, ..Needs::NOTHING }
    },
    stamp,
    current: no_current,
};
fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::BehaviouralInductor { law, law_of, initial } = &stamper.device(id).kind else {
        return;
    };
    if !stamper.finite(id, &[("initial current", initial.unwrap_or(0.0))]) {
        return;
    }
    let Some(branch) = stamper.branch(id) else { return };
    let ends = stamper.ends(id);
    stamper.through(id, branch);
    stamper.difference(Some(branch), ends, 1.0);
    let law = stamper.law(law);
    match (law_of, stamper.hidden(id, 0)) {
        (LawOf::Factor, Some(rate)) => {
            stamper.conductance(Some(rate), Some(rate), 1.0);
            let drop = law.binary(Binary::Multiply, Law::leaf(Leaf::Unknown(rate)));
            stamper.add(id, Current::Law(drop), smallvec![(branch, -1.0)]);
            if let Some(flux) = stamper.charge_mut(id) {
                flux.linear = smallvec![(branch, 1.0)];
                flux.into = smallvec![(rate, -1.0)];
                flux.initial = *initial;
            }
        }
        _ => {
            let start = match initial.map(|value| stored_at(stamper, id, value)) {
                Some(None) => return,
                other => other.flatten(),
            };
            if let Some(flux) = stamper.charge_mut(id) {
                flux.initial = start;
                flux.law = Some(law);
                flux.into = smallvec![(branch, -1.0)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceKind::BehaviouralInductor;
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::UnknownId;
    use crate::circuit::{DeviceId, Expr, LawOf, Leaf};
    use crate::expr::Binary::Multiply;

    fn square() -> Expr {
        let i = || Expr::leaf(Leaf::Current(DeviceId(0)));
        i().binary(Multiply, i())
    }

    #[test]
    fn a_flux_enters_its_branch() {
        let kind = BehaviouralInductor { law: square(), law_of: LawOf::Stored, initial: None };
        let stamps = stamps(vec![("l1", vec![1, 0], kind)]);
        let flux = &stamps.charges[0];
        assert_eq!(flux.into[..], [(UnknownId(1), -1.0)]);
        assert_eq!(value(flux.law.as_ref().unwrap(), &[0.0, 3.0], &[], &[], 0.0), 9.0);
    }

    #[test]
    fn an_inductance_multiplies_the_rate_of_its_current() {
        let kind = BehaviouralInductor { law: square(), law_of: LawOf::Factor, initial: Some(2.0) };
        let stamps = stamps(vec![("l1", vec![1, 0], kind)]);
        assert_eq!(conductances(&stamps), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(capacitances(&stamps)[2], [0.0, -1.0, 0.0]);
        assert_eq!(stamps.laws[0].into[..], [(UnknownId(1), -1.0)]);
        assert_eq!(value(&stamps.laws[0].law, &[0.0, 3.0, 5.0], &[], &[], 0.0), 45.0);
        assert_eq!(stamps.charges[0].initial, Some(2.0));
    }
}
