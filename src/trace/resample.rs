//! Values of a trace between its rows: straight lines, right-continuous at jumps (two rows of one time).

use super::Trace;

/// The place of a time in an abscissa: between `left` and `left + 1`, `part` of the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Row at or before the time; the later one of a jump.
    pub left: usize,
    /// 0 at `left`, below 1; 0 outside the abscissa, where end values hold.
    pub part: f64,
}

/// The place of a time; `None` for an empty abscissa. Times must not decrease.
pub fn place(abscissa: &[f64], time: f64) -> Option<Place> {
    let after = abscissa.partition_point(|t| *t <= time);
    if abscissa.is_empty() {
        return None;
    }
    let Some(left) = after.checked_sub(1) else { return Some(Place { left: 0, part: 0.0 }) };
    let part = match abscissa.get(left + 1) {
        Some(next) if *next > abscissa[left] => (time - abscissa[left]) / (next - abscissa[left]),
        _ => 0.0,
    };
    Some(Place { left, part })
}

/// The value of a column at a place.
pub fn value(column: &[f64], place: Place) -> f64 {
    let left = column[place.left];
    match column.get(place.left + 1) {
        // Without `part = 0` apart, an infinite neighbour would make a NaN.
        Some(right) if place.part > 0.0 => left + place.part * (right - left),
        _ => left,
    }
}

/// The trace at other times, each run of a stepped one; end values hold outside.
pub fn resample(trace: &Trace, times: &[f64]) -> Trace {
    let mut result = Trace::new(trace.names.clone(), trace.units.clone());
    let abscissa = trace.abscissa();
    for run in trace.runs() {
        let time = &trace.time()[run.clone()];
        let places: Vec<Place> = times.iter().filter_map(|t| place(time, *t)).collect();
        for (at, (to, from)) in result.columns.iter_mut().zip(&trace.columns).enumerate() {
            if at == abscissa {
                to.extend(&times[..places.len()]);
            } else if at < abscissa {
                to.extend(places.iter().map(|_| from[run.start]));
            } else {
                to.extend(places.iter().map(|place| value(&from[run.clone()], *place)));
            }
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Sink;

    #[test]
    fn lines_jumps_and_ends() {
        let mut trace = Trace::new(vec!["time".into(), "x".into()], vec![]);
        trace.columns = vec![vec![0.0, 1.0, 1.0, 3.0], vec![0.0, 2.0, 10.0, 6.0]];
        let times = [-1.0, 0.0, 0.25, 1.0, 2.0, 3.0, 4.0];
        let other = resample(&trace, &times);
        assert_eq!(other.columns[0], times);
        assert_eq!(other.columns[1], [0.0, 0.0, 0.5, 10.0, 8.0, 6.0, 6.0]);
        assert_eq!(place(&[], 1.0), None);
        trace.count_runs();
        trace.row(&[1.0, 0.0, 7.0]).unwrap();
        let other = resample(&trace, &[0.5, 2.0]);
        assert_eq!(
            other.columns,
            [[0.0, 0.0, 1.0, 1.0], [0.5, 2.0, 0.5, 2.0], [1.0, 8.0, 7.0, 7.0]]
        );
    }
}
