//! Which unknowns, charges and modes belong to a device, and which devices' currents anything reads.

use super::stamps::UnknownId;
use super::{Circuit, DeviceKind, Probe, Quantity};
use crate::expr;

/// An index that there may be; half as large as an `Option`, since a million devices have seven each.
#[derive(Clone, Copy)]
pub(super) struct Index(pub u32);

impl Index {
    pub const NONE: Index = Index(u32::MAX);

    pub fn get(self) -> Option<u32> {
        (self.0 != u32::MAX).then_some(self.0)
    }

    pub fn unknown(self) -> Option<UnknownId> {
        self.get().map(UnknownId)
    }
}

/// What belongs to one device alone.
#[derive(Clone, Copy)]
pub(super) struct Slots {
    pub branch: Index,
    pub second: Index,
    pub hidden: [Index; 2],
    pub internal: Index,
    pub charge: Index,
    pub mode: Index,
}

impl Slots {
    pub const NONE: Slots = Slots {
        branch: Index::NONE,
        second: Index::NONE,
        hidden: [Index::NONE; 2],
        internal: Index::NONE,
        charge: Index::NONE,
        mode: Index::NONE,
    };
}

/// Which devices' currents are read by other devices, and which by outputs.
pub(super) fn readings(circuit: &Circuit) -> (Vec<bool>, Vec<bool>) {
    fn mark(expr: &expr::Expr<super::Leaf>, marks: &mut [bool]) {
        expr.leaves(&mut |leaf, _| {
            if let super::Leaf::Current(id) | super::Leaf::Part(_, Probe::Current(id)) = leaf {
                marks[id.0 as usize] = true;
            }
        });
    }
    let mut read = vec![false; circuit.devices.len()];
    let mut observed = read.clone();
    for device in &circuit.devices {
        match &device.kind {
            DeviceKind::Cccs { control, .. } | DeviceKind::Ccvs { control, .. } => {
                read[control.0 as usize] = true
            }
            DeviceKind::BehaviouralVoltage { law }
            | DeviceKind::BehaviouralCurrent { law }
            | DeviceKind::BehaviouralResistor { law }
            | DeviceKind::BehaviouralCapacitor { law, .. }
            | DeviceKind::BehaviouralInductor { law, .. }
            | DeviceKind::Quantity(
                Quantity::Derivative { law }
                | Quantity::Integral { law, .. }
                | Quantity::Delay { law, .. },
            ) => mark(law, &mut read),
            DeviceKind::Switch { control, .. } | DeviceKind::CrossedSwitch { control, .. } => {
                mark(control, &mut read)
            }
            DeviceKind::SmoothSwitch(switch) => mark(&switch.control, &mut read),
            _ => {}
        }
    }
    circuit.outputs.iter().for_each(|output| mark(&output.expr, &mut observed));
    circuit.watched.iter().for_each(|expr| mark(expr, &mut observed));
    (read, observed)
}
