//! Coupling of two inductors: Φ1 = L1·i1 + M·i2, Φ2 = M·i1 + L2·i2, M = k·√(L1·L2), −1 ≤ k ≤ 1.
//!
//! Currents into the first nodes (the dotted ends) magnetise the same way for k > 0.
//!
//! Source: L. W. Nagel, SPICE2, UCB/ERL M520, 1975, section 3.

use super::{Needs, Row, no_current};
use crate::circuit::stamper::Stamper;
use crate::circuit::{DeviceId, DeviceKind};

/// The row of the table.
pub const ROW: Row = Row {
    name: "coupling of inductors",
    letters: "K",
    equation: "M = k sqrt(L1 L2)",
    needs: |_| Needs::NOTHING,
    stamp,
    current: no_current,
};

fn stamp(stamper: &mut Stamper, id: DeviceId) {
    let DeviceKind::Mutual { inductors, coupling } = stamper.device(id).kind else { return };
    let inductor = |id: DeviceId| match stamper.device(id).kind {
        DeviceKind::Inductor { inductance, initial } => Some((inductance, initial)),
        _ => None,
    };
    let [Some((l1, i1)), Some((l2, i2))] = inductors.map(inductor) else {
        let message = format!("`{}` couples what is no inductor", stamper.device(id).name);
        return stamper.error("E0751", id, message);
    };
    let name = &stamper.device(id).name;
    if inductors[0] == inductors[1] {
        return stamper.error("E0751", id, format!("`{name}` couples an inductor with itself"));
    }
    if !(-1.0..=1.0).contains(&coupling) {
        return stamper.error(
            "E0751",
            id,
            format!("the coupling of `{name}` is {coupling}, outside −1 to 1"),
        );
    }
    if l1 * l2 < 0.0 {
        return stamper.error(
            "E0751",
            id,
            format!("`{name}` couples inductances of opposite signs"),
        );
    }
    let mutual = coupling * (l1 * l2).sqrt();
    for (own, other, current) in
        [(inductors[0], inductors[1], i2), (inductors[1], inductors[0], i1)]
    {
        let other = stamper.branch(other);
        if let (Some(flux), Some(other)) = (stamper.charge_mut(own), other) {
            flux.linear.push((other, mutual));
            if let Some(current) = current {
                flux.initial = Some(flux.initial.unwrap_or(0.0) + mutual * current);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::DeviceId;
    use crate::circuit::DeviceKind::{Inductor, Mutual};
    use crate::circuit::devices::testing::*;
    use crate::circuit::stamps::stamp;

    #[test]
    fn adds_the_other_s_current_to_each_flux() {
        let inductors = [DeviceId(1), DeviceId(2)];
        let stamps = stamps(vec![
            ("k1", vec![], Mutual { inductors, coupling: 0.5 }),
            ("l1", vec![1, 0], Inductor { inductance: 4.0, initial: Some(1.0) }),
            ("l2", vec![2, 0], Inductor { inductance: 9.0, initial: Some(-1.0) }),
        ]);
        let c = capacitances(&stamps);
        assert_eq!((c[2][2], c[2][3], c[3][2], c[3][3]), (-4.0, -3.0, -3.0, -9.0));
        assert_eq!(stamps.charges[0].initial, Some(4.0 - 3.0));
        assert_eq!(stamps.charges[1].initial, Some(-9.0 + 3.0));
    }

    #[test]
    fn refuses_what_cannot_be_coupled() {
        for (l2, coupling) in [(9.0, 1.5), (9.0, f64::NAN), (-9.0, 0.5)] {
            let circuit = circuit(vec![
                ("l1", vec![1, 0], Inductor { inductance: 4.0, initial: None }),
                ("l2", vec![2, 0], Inductor { inductance: l2, initial: None }),
                ("k1", vec![], Mutual { inductors: [DeviceId(0), DeviceId(1)], coupling }),
            ]);
            let mut diagnostics = vec![];
            assert!(stamp(&circuit, &mut diagnostics).is_none());
            assert_eq!(diagnostics[0].code, "E0751");
        }
    }
}
