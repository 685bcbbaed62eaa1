//! The runs of a trace: one, or several one below the other, told apart by a first column `step`.

use super::Trace;
use std::ops::Range;

/// The header of the column that counts runs.
pub const STEP: &str = "step";

/// The name of the column that numbers the members of a list, which has no abscissa.
pub const NUMBER: &str = "number";

impl Trace {
    /// Whether the first column counts runs.
    pub fn is_stepped(&self) -> bool {
        self.names.len() > 1 && self.names[0] == STEP
    }

    /// Where the abscissa stands: first, or after `step`.
    pub fn abscissa(&self) -> usize {
        usize::from(self.is_stepped())
    }

    /// Whether the first column is no abscissa but a value, as in the single row of an operating point.
    pub fn is_point(&self) -> bool {
        let first = self.names.get(self.abscissa());
        first.is_some_and(|name| is_reading(name)) && self.runs().iter().all(|run| run.len() <= 1)
    }

    /// The rows of each run, in order.
    pub fn runs(&self) -> Vec<Range<usize>> {
        let rows = self.rows();
        if !self.is_stepped() {
            return std::iter::once(0..rows).collect();
        }
        let mut found = vec![];
        let mut start = 0;
        for row in 1..=rows {
            if row == rows || self.columns[0][row] != self.columns[0][start] {
                found.push(start..row);
                start = row;
            }
        }
        found
    }

    /// Puts a column `step` first that counts runs from 0; a run begins where the abscissa turns back.
    pub fn count_runs(&mut self) {
        let mut step = 0.0;
        let mut direction = 0.0;
        let time = self.time();
        let mut steps = Vec::with_capacity(time.len());
        for (row, value) in time.iter().enumerate() {
            let change = if row > 0 { value - time[row - 1] } else { 0.0 };
            if change * direction < 0.0 {
                step += 1.0;
                direction = 0.0;
            } else if change != 0.0 {
                direction = change;
            }
            steps.push(step);
        }
        self.names.insert(0, STEP.into());
        self.units.insert(0, String::new());
        self.columns.insert(0, steps);
    }
}

/// Whether a name is that of a voltage or current, `v(a)`, `i(l1)`. ngspice calls the abscissa of `.dc` `v(v-sweep)`.
pub fn is_reading(name: &str) -> bool {
    if name.contains("-sweep") {
        return false;
    }
    let mut letters = name.bytes().map(|byte| byte.to_ascii_lowercase());
    matches!(letters.next(), Some(b'v' | b'i')) && letters.next() == Some(b'(')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_and_found_again() {
        let mut trace = Trace::new(vec!["time".into(), "x".into()], vec!["s".into()]);
        trace.columns =
            vec![vec![0.0, 1.0, 1.0, 2.0, 0.0, 2.0, 0.0], (0..7).map(f64::from).collect()];
        assert_eq!(trace.runs(), vec![0..7]);
        trace.count_runs();
        assert_eq!(trace.names, ["step", "time", "x"]);
        assert_eq!(trace.columns[0], [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0]);
        assert_eq!(trace.runs(), [0..4, 4..6, 6..7]);
        assert_eq!((trace.abscissa(), trace.time().len()), (1, 7));
    }

    #[test]
    fn sweeps_may_fall() {
        let mut trace = Trace::new(vec!["v1".into()], vec![]);
        trace.columns = vec![vec![5.0, 4.0, 3.0, 5.0, 4.0, 3.0]];
        trace.count_runs();
        assert_eq!(trace.columns[0], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    }
}
