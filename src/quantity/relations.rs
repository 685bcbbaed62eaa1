//! Products of unknown dimensions and what is known of them: how the units of a function's arguments hang together.
//!
//! A regulator turns X into Y with `Kp` in Y/X and `Ki` in Y/(X·s): each argument is a product of powers of a few
//! unknowns and of the second. Each known argument is an equation; taking logarithms they are linear, and Gaussian
//! elimination over the exponents finds the unknowns, or the argument that does not agree.

use super::dimension::Dimension;

/// How many unknowns a formula may speak of.
const UNKNOWNS: usize = 3;

/// A product of powers of unknown dimensions and of seconds. Exponents are counted in halves, so that the root of a
/// pressure can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Formula {
    /// Exponents of the unknowns, in halves.
    pub unknowns: [i8; UNKNOWNS],
    /// Exponent of the second, in halves.
    pub seconds: i8,
}

/// A known argument, reduced by those before it.
#[derive(Clone, Debug)]
struct Row {
    exponents: [i64; UNKNOWNS],
    /// What the product of the unknowns with these exponents is.
    dimension: Dimension,
    /// What the row has been multiplied by, over its equation.
    scale: i64,
    /// Who said it, the last said last.
    tags: Vec<usize>,
}

/// What is known so far.
#[derive(Clone, Debug, Default)]
pub struct Relations {
    rows: Vec<Row>,
}

/// Why an argument does not agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// What its dimension would have to be.
    pub expected: Dimension,
    /// Whose words it contradicts, the last said last.
    pub with: Vec<usize>,
}

impl Relations {
    /// Says that the product of a formula has a dimension. What cannot be computed within 16 bits says nothing.
    pub fn insist(
        &mut self,
        formula: Formula,
        dimension: Dimension,
        tag: usize,
    ) -> Result<(), Disagreement> {
        let Some(mut row) = self.reduce(formula, dimension) else { return Ok(()) };
        if row.exponents != [0; UNKNOWNS] {
            row.tags.push(tag);
            self.rows.push(row);
            return Ok(());
        }
        match remainder(&row) {
            Some(rest) if !rest.is_none() => match dimension.over(rest) {
                Some(expected) => Err(Disagreement { expected, with: row.tags }),
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }

    /// The dimension of a formula's product, where what was said so far gives it.
    pub fn of(&self, formula: Formula) -> Option<Dimension> {
        let row = self.reduce(formula, Dimension::NONE)?;
        if row.exponents != [0; UNKNOWNS] {
            return None;
        }
        remainder(&row)?.power(-1, 1)
    }

    /// The equation of a formula, without the unknowns that earlier rows give.
    fn reduce(&self, formula: Formula, dimension: Dimension) -> Option<Row> {
        const SECOND: Dimension = Dimension::new(0, 0, 1, 0, 0);
        // Squared, since exponents are halves: Π unknown^u = dimension² / s^k.
        let seconds = SECOND.power(-i64::from(formula.seconds), 1)?;
        let mut row = Row {
            exponents: formula.unknowns.map(i64::from),
            dimension: dimension.power(2, 1)?.times(seconds)?,
            scale: 2,
            tags: vec![],
        };
        for pivot in &self.rows {
            let Some(at) = pivot.exponents.iter().position(|k| *k != 0) else { continue };
            let (own, theirs) = (row.exponents[at], pivot.exponents[at]);
            if own == 0 {
                continue;
            }
            for (k, p) in row.exponents.iter_mut().zip(pivot.exponents) {
                *k = *k * theirs - p * own;
            }
            let raised = row.dimension.power(theirs, 1)?;
            row.dimension = raised.over(pivot.dimension.power(own, 1)?)?;
            row.scale *= theirs;
            row.tags.extend(&pivot.tags);
        }
        Some(row)
    }
}

/// By what the dimension of a row without unknowns is too large.
fn remainder(row: &Row) -> Option<Dimension> {
    row.dimension.power(1, row.scale)
}

#[cfg(test)]
mod tests {
    use super::super::Unit;
    use super::*;

    const fn formula(x: i8, y: i8, s: i8) -> Formula {
        Formula { unknowns: [2 * x, 2 * y, 0], seconds: 2 * s }
    }

    fn unit(text: &str) -> Dimension {
        Unit::parse(text).unwrap().dimension
    }

    #[test]
    fn a_regulator() {
        let (x, kp, ki, lo) =
            (formula(1, 0, 0), formula(-1, 1, 0), formula(-1, 1, -1), formula(0, 1, 0));
        let mut known = Relations::default();
        assert_eq!(known.insist(kp, unit("A*s"), 1), Ok(()));
        assert_eq!(known.of(lo), None);
        assert_eq!(known.of(ki), Some(unit("A")));
        assert_eq!(known.insist(x, unit("rad/s"), 0), Ok(()));
        assert_eq!(known.of(lo), Some(unit("A")));
        assert_eq!(known.insist(ki, unit("A"), 2), Ok(()));
        let wrong = known.insist(ki, unit("V"), 2).unwrap_err();
        assert_eq!(wrong, Disagreement { expected: unit("A"), with: vec![1] });
        let wrong = known.insist(lo, unit("V"), 3).unwrap_err();
        assert_eq!(wrong, Disagreement { expected: unit("A"), with: vec![1, 0] });
    }

    #[test]
    fn roots() {
        // An orifice: C² = e/f².
        let c = Formula { unknowns: [1, -2, 0], seconds: 0 };
        let mut known = Relations::default();
        known.insist(formula(1, 0, 0), unit("bar"), 0).unwrap();
        known.insist(c, unit("Pa^0.5*s/m^3"), 1).unwrap();
        assert_eq!(known.of(formula(0, 1, 0)), Some(unit("m^3/s")));
        let wrong = known.insist(formula(0, 1, 0), unit("m/s"), 2).unwrap_err();
        assert_eq!(wrong.expected, unit("m^3/s"));
    }
}
