//! Traces: names, columns, formats, resampling, comparison.

/// Columns over a common abscissa.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Headers; the first is `time`.
    pub names: Vec<String>,
    /// Units, one for each name; empty where none is known.
    pub units: Vec<String>,
    /// One column for each name, all of one length.
    pub columns: Vec<Vec<f64>>,
}

/// Takes rows one by one while they are computed, so that a run needs no memory for them.
pub trait Sink {
    /// Takes one row, in the order of the headers, time first.
    ///
    /// # Errors
    /// What writing failed with; the run stops.
    fn row(&mut self, values: &[f64]) -> std::io::Result<()>;
}

impl Sink for Trace {
    fn row(&mut self, values: &[f64]) -> std::io::Result<()> {
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(*value);
        }
        Ok(())
    }
}
