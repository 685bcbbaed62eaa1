//! The devices: one file each, with equation, sign, units, source and test, and one row each in [`DEVICES`].
//!
//! A device knows neither time step nor method nor matrix: it writes terms of the one equation (see
//! [`stamps`](super::stamps)). Signs as SPICE: a current runs from the first node through the device to the second.
//! Units: V, A, Ω, F, H, s.

pub mod resistor;
pub mod capacitor;
pub mod inductor;
pub mod mutual;
pub mod voltage_source;
pub mod current_source;
pub mod vcvs;
pub mod vccs;
pub mod cccs;
pub mod ccvs;
pub mod behavioural_voltage;
pub mod behavioural_current;
pub mod behavioural_resistor;
pub mod behavioural_capacitor;
pub mod behavioural_inductor;
pub mod switch;
pub mod crossed_switch;
pub mod smooth_switch;
pub mod line;
pub mod hold;
pub mod quantity;
pub mod diode;

use super::stamper::{Current, Stamper};
use super::{DeviceId, DeviceKind, Leaf};
use crate::diagnostic::Diagnostic;

/// Whether a device has its current as an unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// Its law gives no current.
    Always,
    /// Only where another device reads its current: laws then stay small, and may speak of themselves.
    WhenRead,
    /// Also where an output alone reads it.
    WhenObserved,
    /// Its current is always an expression.
    Never,
}

/// What a device has of its own.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub struct Needs {
    pub branch: Branch,
    pub internal: bool,
    pub charge: bool,
    pub mode: bool,
    /// A second branch.
    pub second: bool,
    /// Unknowns that no output shows unasked, at most 2.
    pub hidden: u8,
}

impl Needs {
    /// Nothing.
    pub const NOTHING: Needs = Needs {
        branch: Branch::Never,
        internal: false,
        charge: false,
        mode: false,
        second: false,
        hidden: 0,
    };
    /// A branch.
    pub const BRANCH: Needs = Needs { branch: Branch::Always, ..Needs::NOTHING };
}

/// One row of the table.
#[derive(Clone, Copy)]
pub struct Row {
    /// What it is called.
    pub name: &'static str,
    /// The letters of its cards.
    pub letters: &'static str,
    /// Its equation.
    pub equation: &'static str,
    /// What it has of its own.
    pub needs: fn(&DeviceKind) -> Needs,
    /// Writes its terms.
    pub stamp: fn(&mut Stamper, DeviceId),
    /// Its current where it has no branch.
    pub current: fn(&Stamper, DeviceId) -> Current,
}

/// Every device, one row each.
pub const DEVICES: &[Row] = &[
    resistor::ROW,
    capacitor::ROW,
    inductor::ROW,
    mutual::ROW,
    voltage_source::ROW,
    current_source::ROW,
    vcvs::ROW,
    vccs::ROW,
    cccs::ROW,
    ccvs::ROW,
    behavioural_voltage::ROW,
    behavioural_current::ROW,
    behavioural_resistor::ROW,
    behavioural_capacitor::ROW,
    behavioural_inductor::ROW,
    switch::ROW,
    crossed_switch::ROW,
    smooth_switch::ROW,
    line::ROW,
    hold::ROW,
    quantity::ROW,
    diode::ROW,
];

/// The row of a device.
pub fn row(kind: &DeviceKind) -> &'static Row {
    match kind {
        DeviceKind::Resistor { .. } => &resistor::ROW,
        DeviceKind::Capacitor { .. } => &capacitor::ROW,
        DeviceKind::Inductor { .. } => &inductor::ROW,
        DeviceKind::Mutual { .. } => &mutual::ROW,
        DeviceKind::VoltageSource { .. } => &voltage_source::ROW,
        DeviceKind::CurrentSource { .. } => &current_source::ROW,
        DeviceKind::Vcvs { .. } => &vcvs::ROW,
        DeviceKind::Vccs { .. } => &vccs::ROW,
        DeviceKind::Cccs { .. } => &cccs::ROW,
        DeviceKind::Ccvs { .. } => &ccvs::ROW,
        DeviceKind::BehaviouralVoltage { .. } => &behavioural_voltage::ROW,
        DeviceKind::BehaviouralCurrent { .. } => &behavioural_current::ROW,
        DeviceKind::BehaviouralResistor { .. } => &behavioural_resistor::ROW,
        DeviceKind::BehaviouralCapacitor { .. } => &behavioural_capacitor::ROW,
        DeviceKind::BehaviouralInductor { .. } => &behavioural_inductor::ROW,
        DeviceKind::Switch { .. } => &switch::ROW,
        DeviceKind::CrossedSwitch { .. } => &crossed_switch::ROW,
        DeviceKind::SmoothSwitch(_) => &smooth_switch::ROW,
        DeviceKind::Line { .. } => &line::ROW,
        DeviceKind::Hold { .. } => &hold::ROW,
        DeviceKind::Quantity(_) => &quantity::ROW,
        DeviceKind::Diode { .. } => &diode::ROW,
    }
}

/// The current of a device that always has a branch, or none: never asked for, but 0 is true of nothing else.
fn no_current(_: &Stamper, _: DeviceId) -> Current {
    Current::nothing()
}

/// What a behavioural storage holds when its own voltage, or its own current, is `value`; an error where its law speaks of
/// anything else.
fn stored_at(stamper: &mut Stamper, id: DeviceId, value: f64) -> Option<f64> {
    let device = stamper.device(id);
    let (law, coil) = match &device.kind {
        DeviceKind::BehaviouralCapacitor { law, .. } => (law, false),
        DeviceKind::BehaviouralInductor { law, .. } => (law, true),
        _ => return None,
    };
    let stored = law.evaluate(&mut |leaf| match *leaf {
        Leaf::Voltage(a, b) if !coil && device.nodes[..] == [a, b] => value,
        Leaf::Voltage(a, b) if !coil && device.nodes[..] == [b, a] => -value,
        Leaf::Current(own) if coil && own == id => value,
        Leaf::Time => 0.0,
        _ => f64::NAN,
    });
    if !stored.is_finite() {
        let message = format!("what `{}` holds at the start is not known", device.name);
        let own = if coil { "current" } else { "voltage" };
        let error = Diagnostic::error("E0755", device.span, message)
            .because(format!("its law speaks of more than its own {own}, or has no value there"))
            .help("leave `ic=` out, and let `.ic` say the voltages of the nodes");
        stamper.report(error);
        return None;
    }
    Some(stored)
}

#[cfg(test)]
pub(crate) mod testing {
    //! A circuit in a few words, and its stamps as matrices.

    use crate::circuit::stamps::{Stamps, stamp};
    use crate::circuit::*;

    /// A circuit of devices between nodes named by numbers.
    pub fn circuit(devices: Vec<(&str, Vec<u32>, DeviceKind)>) -> Circuit {
        let count = devices.iter().flat_map(|(_, nodes, _)| nodes).max().copied().unwrap_or(0);
        let node =
            |k: u32| Node { name: k.to_string(), nominal: None, span: crate::source::Span::NONE };
        let device = |(name, nodes, kind): (&str, Vec<u32>, DeviceKind)| Device {
            name: name.into(),
            nodes: nodes.into_iter().map(NodeId).collect(),
            kind,
            nominal: None,
            span: crate::source::Span::NONE,
        };
        Circuit {
            nodes: (0..=count).map(node).collect(),
            devices: devices.into_iter().map(device).collect(),
            ..Circuit::default()
        }
    }

    /// Its stamps, which must be without errors.
    pub fn stamps(devices: Vec<(&str, Vec<u32>, DeviceKind)>) -> Stamps {
        let mut diagnostics = vec![];
        let stamps = stamp(&circuit(devices), &mut diagnostics);
        assert!(diagnostics.is_empty(), "{diagnostics:?}");
        stamps.unwrap()
    }

    /// G as a dense matrix.
    pub fn conductances(stamps: &Stamps) -> Vec<Vec<f64>> {
        let n = stamps.unknowns.len();
        let mut matrix = vec![vec![0.0; n]; n];
        for (row, column, value) in &stamps.conductances {
            matrix[row.0 as usize][column.0 as usize] += value;
        }
        matrix
    }

    /// C = A·c as a dense matrix.
    pub fn capacitances(stamps: &Stamps) -> Vec<Vec<f64>> {
        let n = stamps.unknowns.len();
        let mut matrix = vec![vec![0.0; n]; n];
        for charge in &stamps.charges {
            for (row, sign) in &charge.into {
                for (column, value) in &charge.linear {
                    matrix[row.0 as usize][column.0 as usize] += sign * value;
                }
            }
        }
        matrix
    }

    /// b at a time.
    pub fn sources(stamps: &Stamps, t: f64) -> Vec<f64> {
        let mut b = vec![0.0; stamps.unknowns.len()];
        for source in &stamps.sources {
            for (row, factor) in &source.into {
                b[row.0 as usize] += factor * source.waveform.value(t);
            }
        }
        b
    }

    /// A tree's value, computed by walking it: independent of the programs of the solver.
    pub fn value(
        law: &crate::circuit::stamps::Law,
        x: &[f64],
        modes: &[f64],
        rates: &[f64],
        t: f64,
    ) -> f64 {
        use crate::circuit::stamps::Leaf;
        use crate::expr::{Binary::*, Function, Node, Unary};
        let of = |e: &crate::circuit::stamps::Law| value(e, x, modes, rates, t);
        match &*law.node {
            Node::Number(v) => *v,
            Node::Leaf(Leaf::Unknown(k)) => x[k.0 as usize],
            Node::Leaf(Leaf::Rate(k)) => rates[*k as usize],
            Node::Leaf(Leaf::Time) => t,
            Node::Leaf(Leaf::Mode(k)) => modes[*k as usize],
            Node::Unary(Unary::Negate, a) => -of(a),
            Node::Unary(Unary::Not, a) => f64::from(of(a) == 0.0),
            Node::Binary(op, a, b) => {
                let (a, b) = (of(a), of(b));
                match op {
                    Add => a + b,
                    Subtract => a - b,
                    Multiply => a * b,
                    Divide => a / b,
                    Less => f64::from(a < b),
                    GreaterEqual => f64::from(a >= b),
                    other => panic!("no value of {other:?} here"),
                }
            }
            Node::Call(Function::Exp, a) => of(&a[0]).exp(),
            Node::Call(Function::Abs, a) => of(&a[0]).abs(),
            Node::Call(Function::Sqrt, a) => of(&a[0]).sqrt(),
            Node::Call(Function::PowerOfAbs, a) => of(&a[0]).abs().powf(of(&a[1])),
            Node::If(c, a, b) => {
                if of(c) != 0.0 {
                    of(a)
                } else {
                    of(b)
                }
            }
            other => panic!("no value of {other:?} here"),
        }
    }

    #[test]
    fn every_row_is_its_kind_s_own() {
        for row in super::DEVICES {
            assert!(!row.name.is_empty() && !row.equation.is_empty());
        }
        let names: std::collections::BTreeSet<_> =
            super::DEVICES.iter().map(|row| row.name).collect();
        assert_eq!(names.len(), super::DEVICES.len());
        let ground = [NodeId(0), NodeId(0)];
        let row = |kind| super::row(&kind).name;
        assert_eq!(row(DeviceKind::Resistor { resistance: 1.0 }), "resistor");
        assert_eq!(
            row(DeviceKind::Vccs { gain: 1.0, control: ground }),
            "voltage-controlled current source"
        );
        assert_eq!(
            row(DeviceKind::BehaviouralCurrent { law: Expr::number(0.0) }),
            "behavioural current source"
        );
    }
}
