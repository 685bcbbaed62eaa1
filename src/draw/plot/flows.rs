//! Where the energy of a run is and where it goes: what storages hold, one upon the other; power of sources, of what
//! dissipates and of what is modulated; and the balance since the start.

use super::super::picture::{CURVES, Ink, Point};
use super::{Axis, Band, Curve, Panel};
use crate::second::energy::Role;
use crate::second::flows::Flow;

/// So many elements have curves of their own; the rest is drawn as a sum.
const MOST: usize = CURVES as usize - 1;
/// What moves less than this part of all is drawn with the rest.
const LITTLE: f64 = 1e-3;
/// Areas have edges with about as many points as can be seen.
const EDGES: usize = 700;

/// The values of some elements, the largest first, and the sum of the rest.
fn sorted(flows: &[&Flow], of: fn(&Flow) -> &[f64]) -> Vec<(String, Vec<f64>)> {
    let size = |flow: &Flow| of(flow).iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let mut order: Vec<(f64, &Flow)> = flows.iter().map(|flow| (size(flow), *flow)).collect();
    // Equal ones in the order of the file.
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let most = order.first().map_or(0.0, |first| first.0);
    let own = order.iter().filter(|(size, _)| *size > LITTLE * most).count();
    let own = if own > MOST { MOST - 1 } else { own };
    let mut found: Vec<(String, Vec<f64>)> =
        order[..own].iter().map(|(_, flow)| (flow.name.clone(), of(flow).to_vec())).collect();
    let rest = &order[own..];
    if rest.iter().any(|(size, _)| *size > 0.0) {
        let rows = of(rest[0].1).len();
        let sum = (0..rows).map(|row| rest.iter().map(|(_, flow)| of(flow)[row]).sum());
        let name = match rest {
            [(_, one)] => one.name.clone(),
            rest => format!("{} others", rest.len()),
        };
        found.push((name, sum.collect()));
    }
    found
}

fn power(flow: &Flow) -> &[f64] {
    &flow.power
}

fn energy(flow: &Flow) -> &[f64] {
    &flow.energy
}

fn axis(label: &str) -> Axis {
    Axis { label: label.to_string(), ..Axis::default() }
}

fn curves(time: &[f64], values: Vec<(String, Vec<f64>)>) -> Vec<Curve> {
    let curve = |(k, (name, values)): (usize, (String, Vec<f64>))| Curve {
        name,
        ink: Ink::Curve((k % usize::from(CURVES)) as u8),
        dashed: false,
        width: 1.4,
        points: time.iter().copied().zip(values).collect(),
    };
    values.into_iter().enumerate().map(curve).collect()
}

/// The panels of a run's flows.
pub fn flows(time: &[f64], flows: &[Flow]) -> Vec<Panel> {
    let of = |role: Role| flows.iter().filter(|flow| flow.role == role).collect::<Vec<_>>();
    let panel = |label: &str, curves: Vec<Curve>| Panel {
        x: axis("time [s]"),
        y: axis(label),
        curves,
        ..Panel::default()
    };
    let mut panels = vec![];
    let stores = of(Role::Stored);
    if !stores.is_empty() {
        panels.push(stored(time, sorted(&stores, energy)));
    }
    for (role, label) in [
        (Role::Source, "delivered power [W]"),
        (Role::Dissipated, "dissipated power [W]"),
        (Role::Modulated, "power to what modulates [W]"),
    ] {
        let own = of(role);
        if !own.is_empty() {
            panels.push(panel(label, curves(time, sorted(&own, power))));
        }
    }
    let sum = |role: Role| -> Vec<f64> {
        let own = of(role);
        let from = |flow: &Flow| flow.energy.first().copied().filter(|_| role == Role::Stored);
        let starts: Vec<f64> = own.iter().map(|flow| from(flow).unwrap_or(0.0)).collect();
        let at = |row: usize| own.iter().zip(&starts).map(|(f, start)| f.energy[row] - start).sum();
        (0..time.len()).map(at).collect()
    };
    let balance: Vec<(String, Vec<f64>)> = [
        (Role::Source, "delivered"),
        (Role::Dissipated, "dissipated"),
        (Role::Stored, "gained by storages"),
        (Role::Modulated, "given to what modulates"),
    ]
    .into_iter()
    .filter(|(role, _)| !of(*role).is_empty())
    .map(|(role, name)| (name.to_string(), sum(role)))
    .collect();
    panels.push(panel("energy since the start [J]", curves(time, balance)));
    panels
}

/// What storages hold, one upon the other; where one can hold less than nothing, side by side.
fn stored(time: &[f64], values: Vec<(String, Vec<f64>)>) -> Panel {
    let most = values.iter().flat_map(|(_, v)| v).fold(0.0, |most: f64, v| most.max(v.abs()));
    let piled = values.iter().flat_map(|(_, v)| v).all(|v| *v >= -1e-9 * most);
    let plain = Panel { x: axis("time [s]"), y: axis("stored energy [J]"), ..Panel::default() };
    if !piled {
        return Panel { curves: curves(time, values), ..plain };
    }
    let total: Vec<f64> =
        (0..time.len()).map(|row| values.iter().map(|(_, v)| v[row]).sum()).collect();
    let rows = rows(&total);
    let mut below = vec![0.0; rows.len()];
    let mut bands = vec![];
    let edge = |heights: &[f64]| -> Vec<Point> {
        rows.iter().zip(heights).map(|(row, height)| (time[*row], *height)).collect()
    };
    for (k, (name, values)) in values.into_iter().enumerate() {
        let lower = edge(&below);
        below.iter_mut().zip(&rows).for_each(|(height, row)| *height += values[*row]);
        let ink = Ink::Curve((k % usize::from(CURVES)) as u8);
        bands.push(Band { name, ink, edges: [lower, edge(&below)] });
    }
    let top = Curve {
        name: String::new(),
        ink: Ink::Plain,
        dashed: false,
        width: 1.0,
        points: time.iter().copied().zip(total).collect(),
    };
    Panel { bands, curves: vec![top], ..plain }
}

/// Of each stretch the first row and the one with the greatest sum, and the last of all.
fn rows(total: &[f64]) -> Vec<usize> {
    let count = total.len();
    if count <= EDGES {
        return (0..count).collect();
    }
    let stretches = EDGES / 2;
    let mut kept = vec![count - 1];
    for k in 0..stretches {
        let (from, to) = (count * k / stretches, count * (k + 1) / stretches);
        kept.push(from);
        kept.extend((from..to).max_by(|a, b| total[*a].total_cmp(&total[*b])));
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_stay_where_rows_are_left_out() {
        let mut total = vec![0.0; 10_000];
        total[4321] = 1.0;
        let kept = rows(&total);
        assert!(kept.len() <= EDGES + 1 && kept.contains(&4321) && kept.contains(&9999));
        assert_eq!(rows(&[1.0; 30]).len(), 30);
    }
}
