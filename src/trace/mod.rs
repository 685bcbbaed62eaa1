//! Traces: names, columns, formats, resampling, comparison.

pub mod runs;
pub mod compare;
pub mod resample;
pub mod formats;
pub mod csv;
pub mod raw;
pub mod json;
pub mod vcd;
pub mod prn;
pub mod fourier;
pub mod measure;

/// Columns over a common abscissa.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Headers; the first is the abscissa (`time`, `frequency`, the source of a sweep), or `step` before it where there
    /// are several runs.
    pub names: Vec<String>,
    /// Units, one for each name; empty where none is known.
    pub units: Vec<String>,
    /// One column for each name, all of one length.
    pub columns: Vec<Vec<f64>>,
}

impl Trace {
    /// A trace without rows; units may be fewer than names.
    pub fn new(names: Vec<String>, mut units: Vec<String>) -> Trace {
        units.resize(names.len(), String::new());
        let columns = vec![vec![]; names.len()];
        Trace { names, units, columns }
    }

    /// The abscissa, mostly time in seconds; empty where there are no columns.
    pub fn time(&self) -> &[f64] {
        self.columns.get(self.abscissa()).map_or(&[], Vec::as_slice)
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// The column of a name; where none is spelled so, the only one that differs by case alone, as SPICE folds case.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.position(name).map(|at| self.columns[at].as_slice())
    }

    /// Where the column of a name stands; see [`Trace::column`].
    pub fn position(&self, name: &str) -> Option<usize> {
        let exact = self.names.iter().position(|other| other == name);
        exact.or_else(|| {
            let folded = name.to_lowercase();
            let mut same =
                (0..self.names.len()).filter(|at| self.names[*at].to_lowercase() == folded);
            let only = same.next()?;
            same.next().is_none().then_some(only)
        })
    }
}

/// Takes rows one by one while they are computed, so that a run needs no memory for them.
pub trait Sink {
    /// Takes one row, in the order of the headers, time first.
    ///
    /// # Errors
    /// What writing failed with; the run stops.
    fn row(&mut self, values: &[f64]) -> std::io::Result<()>;

    /// Takes the row of an accepted step, in a run whose rows stand on a grid: what is measured needs them.
    ///
    /// # Errors
    /// What writing failed with; the run stops.
    fn step(&mut self, _values: &[f64]) -> std::io::Result<()> {
        Ok(())
    }
}

/// Where rows go that nobody reads.
#[derive(Clone, Copy, Debug)]
pub struct Nowhere;

impl Sink for Nowhere {
    fn row(&mut self, _: &[f64]) -> std::io::Result<()> {
        Ok(())
    }
}

impl Sink for Trace {
    fn row(&mut self, values: &[f64]) -> std::io::Result<()> {
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(*value);
        }
        Ok(())
    }
}

/// Sends every row of a trace to a sink.
///
/// # Errors
/// What writing failed with.
pub fn send(trace: &Trace, sink: &mut dyn Sink) -> std::io::Result<()> {
    let mut row = vec![0.0; trace.columns.len()];
    for at in 0..trace.rows() {
        for (value, column) in row.iter_mut().zip(&trace.columns) {
            *value = column[at];
        }
        sink.row(&row)?;
    }
    Ok(())
}
