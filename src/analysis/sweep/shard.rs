//! A part of a sweep: every N-th run, so that parts take equally long where runs grow along an axis.

/// Part `number` of `count`, from 1 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which.
    pub number: u64,
    /// Of how many.
    pub count: u64,
}

/// One row of [`SCHEDULERS`]: the variables in which a batch system tells a task which it is.
struct Scheduler {
    task: &'static str,
    first: &'static str,
    last: &'static str,
    step: &'static str,
}

/// Batch systems whose array tasks know of each other.
#[rustfmt::skip]
const SCHEDULERS: &[Scheduler] = &[
    Scheduler { task: "SLURM_ARRAY_TASK_ID", first: "SLURM_ARRAY_TASK_MIN", last: "SLURM_ARRAY_TASK_MAX", step: "SLURM_ARRAY_TASK_STEP" },
    Scheduler { task: "SGE_TASK_ID", first: "SGE_TASK_FIRST", last: "SGE_TASK_LAST", step: "SGE_TASK_STEPSIZE" },
    Scheduler { task: "LSB_JOBINDEX", first: "", last: "LSB_JOBINDEX_END", step: "LSB_JOBINDEX_STEP" },
];

impl Shard {
    /// All of it.
    pub const WHOLE: Shard = Shard { number: 1, count: 1 };

    /// From `K/N`.
    ///
    /// # Errors
    /// What it is instead.
    pub fn parse(text: &str) -> Result<Shard, String> {
        let none = || format!("`{text}` is no part: 1/4 to 4/4 are those of four");
        let (number, count) = text.split_once('/').ok_or_else(none)?;
        let whole = |text: &str| text.trim().parse().map_err(|_| none());
        let shard = Shard { number: whole(number)?, count: whole(count)? };
        let exists = (1..=shard.count).contains(&shard.number);
        if exists { Ok(shard) } else { Err(none()) }
    }

    /// The part that a batch system gives this process, from its environment.
    pub fn of_task(variable: &dyn Fn(&str) -> Option<String>) -> Option<Shard> {
        let number = |name: &str| variable(name)?.trim().parse::<u64>().ok();
        SCHEDULERS.iter().find_map(|system| {
            // Outside of arrays `SGE_TASK_ID` is `undefined`, `LSB_JOBINDEX` 0.
            let (task, last) = (number(system.task)?, number(system.last)?);
            let first = if system.first.is_empty() { 1 } else { number(system.first)? };
            let step = number(system.step).filter(|step| *step > 0).unwrap_or(1);
            let place = task.checked_sub(first)?;
            let count = last.checked_sub(first)? / step + 1;
            let shard = Shard { number: place / step + 1, count };
            (shard.number <= count && place % step == 0).then_some(shard)
        })
    }

    /// Its run at a place, of so many of all.
    pub fn run(self, at: u64, total: u64) -> Option<u64> {
        let run = self.count.checked_mul(at)?.checked_add(self.number - 1)?;
        (run < total).then_some(run)
    }

    /// How many runs it has, of so many of all.
    pub fn runs(self, total: u64) -> u64 {
        (total + self.count - self.number) / self.count
    }

    /// A file's name for this part of it: `out.csv` becomes `out.2of4.csv`.
    pub fn file(self, name: &str) -> String {
        let part = format!("{}of{}", self.number, self.count);
        match name.rsplit_once('.').filter(|(stem, end)| !stem.is_empty() && !end.contains('/')) {
            Some((stem, end)) => format!("{stem}.{part}.{end}"),
            None => format!("{name}.{part}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_disjoint_and_make_the_whole() {
        let mut all: Vec<u64> = (1..=4)
            .map(|number| Shard { number, count: 4 })
            .flat_map(|shard| (0..shard.runs(11)).map(move |at| shard.run(at, 11).unwrap()))
            .collect();
        all.sort_unstable();
        assert_eq!(all, (0..11).collect::<Vec<_>>());
        assert_eq!(Shard { number: 4, count: 4 }.run(2, 11), None);
        assert_eq!(Shard { number: 4, count: 4 }.runs(3), 0);
        assert_eq!(Shard::parse("2/4"), Ok(Shard { number: 2, count: 4 }));
        for wrong in ["0/4", "5/4", "1", "a/b", "1/0"] {
            assert!(Shard::parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(Shard { number: 2, count: 4 }.file("a/out.csv"), "a/out.2of4.csv");
        assert_eq!(Shard { number: 2, count: 4 }.file("a.b/out"), "a.b/out.2of4");
    }

    #[test]
    fn batch_systems_are_known() {
        let of = |pairs: &[(&str, &str)]| {
            let find = |name: &str| {
                pairs.iter().find(|pair| pair.0 == name).map(|pair| pair.1.to_string())
            };
            Shard::of_task(&find)
        };
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "12"),
            ("SLURM_ARRAY_TASK_MIN", "10"),
            ("SLURM_ARRAY_TASK_MAX", "16"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
        ];
        assert_eq!(of(&slurm), Some(Shard { number: 2, count: 4 }));
        let grid = [("SGE_TASK_ID", "3"), ("SGE_TASK_FIRST", "1"), ("SGE_TASK_LAST", "5")];
        assert_eq!(of(&grid), Some(Shard { number: 3, count: 5 }));
        assert_eq!(of(&[("SGE_TASK_ID", "undefined")]), None);
        assert_eq!(
            of(&[("LSB_JOBINDEX", "2"), ("LSB_JOBINDEX_END", "2")]),
            Some(Shard { number: 2, count: 2 })
        );
        assert_eq!(of(&[("LSB_JOBINDEX", "0"), ("LSB_JOBINDEX_END", "2")]), None);
        assert_eq!(of(&[]), None);
    }
}
