//! Sweeps: which runs there are, what each of them sets, what is taken from it.
//!
//! Axes with stated values make a grid, whose last axis runs fastest; at each of its points there are as many samples as
//! `runs` says, in which the random axes have values of their own. A random value depends on the seed, on the name of what
//! it is for and on the number of the run, and on nothing else: any part of a sweep can be made anywhere, in any order.

pub mod axis;
pub mod measure;
pub mod plan;
pub mod shard;

use crate::quantity::random;
pub use axis::{Axis, Forms, Reading};
pub use measure::Wanted;

/// A number as it is read by the language of the model.
pub type Read<'a> = &'a dyn Fn(&str) -> Result<Reading, String>;

/// All runs of a sweep.
#[derive(Clone, Debug)]
pub struct Space {
    axes: Vec<Axis<Reading>>,
    samples: u64,
    seed: u64,
}

/// What a run sets: a name, its value in SI, and the value as the model's language writes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The parameter.
    pub name: String,
    /// In SI.
    pub value: f64,
    /// With its unit.
    pub text: String,
}

/// A sweep of more runs than this is a slip of the pen.
pub const MOST_RUNS: u64 = 100_000_000;

impl Space {
    /// From axes; `runs` is how many samples there are at each point of the grid.
    ///
    /// # Errors
    /// Why it is none: the axis, where one is to blame, and a sentence.
    pub fn new(
        axes: &[Axis],
        runs: Option<u64>,
        seed: u64,
        read: Read,
    ) -> Result<Space, (Option<usize>, String)> {
        let mut resolved = vec![];
        for (at, axis) in axes.iter().enumerate() {
            if axes[..at].iter().any(|other| other.name == axis.name) {
                return Err((Some(at), format!("`{}` is varied twice", axis.name)));
            }
            let forms = axis.forms.resolve(read).map_err(|why| (Some(at), why))?;
            resolved.push(Axis { name: axis.name.clone(), forms });
        }
        let random = axes.iter().find(|axis| axis.forms.is_random());
        let samples = match (random, runs) {
            (_, Some(0)) => return Err((None, "a sweep of 0 runs".into())),
            (Some(_), Some(runs)) => runs,
            (None, None) => 1,
            (Some(axis), None) => {
                let why = format!("`{}` is random, and nothing says how many runs", axis.name);
                return Err((None, why));
            }
            (None, Some(_)) => {
                let why = "`runs` counts the samples of random values, and nothing is random";
                return Err((None, why.into()));
            }
        };
        let space = Space { axes: resolved, samples, seed };
        match space.count() {
            Some(_) => Ok(space),
            None => Err((None, format!("the sweep has more than {MOST_RUNS} runs"))),
        }
    }

    fn count(&self) -> Option<u64> {
        let lengths = self.axes.iter().map(|axis| axis.forms.count());
        let total = lengths.chain([self.samples]).try_fold(1u64, u64::checked_mul);
        total.filter(|total| *total <= MOST_RUNS)
    }

    /// How many runs there are.
    pub fn runs(&self) -> u64 {
        self.count().unwrap_or(0)
    }

    /// The names of what is set, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.axes.iter().map(|axis| axis.name.as_str())
    }

    /// What a run sets, one setting for each axis.
    pub fn settings(&self, run: u64) -> Vec<Setting> {
        let mut point = run / self.samples.max(1);
        let mut settings: Vec<Setting> = vec![];
        for Axis { name, forms } in self.axes.iter().rev() {
            let length = forms.count();
            let reading = forms.value(point % length, random::below(self.seed, name), run);
            point /= length;
            let (value, text) = (reading.si(), reading.text());
            settings.push(Setting { name: name.clone(), value, text });
        }
        settings.reverse();
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Reading, String> {
        Reading::of(text, &|_| Some(1.0))
    }

    fn space(
        axes: &[&str],
        runs: Option<u64>,
        seed: u64,
    ) -> Result<Space, (Option<usize>, String)> {
        let axes: Vec<Axis> = axes.iter().map(|text| Axis::parse(text).unwrap()).collect();
        Space::new(&axes, runs, seed, &read)
    }

    #[test]
    fn the_last_axis_runs_fastest_and_samples_inside_it() {
        let space = space(&["a=1,2", "z=normal(0,1)", "b=10..30:3"], Some(2), 7).unwrap();
        assert_eq!(space.runs(), 12);
        let value = |run: u64, at: usize| space.settings(run)[at].value;
        let stated: Vec<(f64, f64)> = (0..12).map(|k| (value(k, 0), value(k, 2))).collect();
        let expected = [1.0, 2.0]
            .into_iter()
            .flat_map(|a| [10.0, 20.0, 30.0].into_iter().flat_map(move |b| [(a, b), (a, b)]));
        assert_eq!(stated, expected.collect::<Vec<_>>());
        let random: Vec<f64> = (0..12).map(|k| value(k, 1)).collect();
        assert!(random.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn random_values_depend_on_seed_name_and_run_alone() {
        let one = space(&["z=normal(5,2)"], Some(100), 1).unwrap();
        let more = space(&["x=uniform(0,1)", "z=normal(5,2)"], Some(50), 1).unwrap();
        let other = space(&["z=normal(5,2)"], Some(100), 2).unwrap();
        for run in 0..50 {
            assert_eq!(one.settings(run)[0], more.settings(run)[1]);
            assert_ne!(one.settings(run)[0], other.settings(run)[0]);
        }
    }

    #[test]
    fn random_values_have_their_moments() {
        const N: u64 = 100_000;
        let space = space(&["n=normal(5,2)", "u=uniform(-1,3)"], Some(N), 3).unwrap();
        let column = |at: usize| (0..N).map(move |k| (k, at));
        let values = |at: usize| column(at).map(|(k, at)| space.settings(k)[at].value);
        let mean = |at: usize| values(at).sum::<f64>() / N as f64;
        let spread = |at: usize, mean: f64| {
            (values(at).map(|x| (x - mean) * (x - mean)).sum::<f64>() / N as f64).sqrt()
        };
        // Four standard errors: of the mean σ/√N, of σ about σ/√(2N).
        let root = (N as f64).sqrt();
        let uniform = 4.0 / 12.0f64.sqrt();
        assert!((mean(0) - 5.0).abs() < 4.0 * 2.0 / root);
        assert!((spread(0, 5.0) - 2.0).abs() < 4.0 * 2.0 / (root * 2.0f64.sqrt()));
        assert!((mean(1) - 1.0).abs() < 4.0 * uniform / root);
        assert!((spread(1, 1.0) - uniform).abs() < 4.0 * uniform / root);
        assert!(values(1).all(|u| (-1.0..3.0).contains(&u)));
    }

    #[test]
    fn senseless_sweeps_are_told() {
        let why = |axes: &[&str], runs| space(axes, runs, 0).unwrap_err().1;
        assert!(why(&["a=1,2", "a=3"], None).contains("twice"));
        assert!(why(&["a=normal(1,2)"], None).contains("how many runs"));
        assert!(why(&["a=1,2"], Some(3)).contains("nothing is random"));
        assert!(why(&["a=normal(1,2)"], Some(0)).contains("0 runs"));
        assert!(why(&["a=1..2:100000", "b=1..2:100000"], None).contains("more than"));
        assert!(why(&["a=-1..2:4:log"], None).contains("above 0"));
        assert!(why(&["a=normal(1,-2)"], Some(4)).contains("below 0"));
    }
}
