//! Unknowns that follow from others by an equation of their own, put in their places before a run.
//!
//! Circuits of bond graphs and of controllers are chains: the currents of sources that nobody asks for, junctions of 0 V
//! sources, gains, laws whose value is another law's argument. A run that carries each link as an unknown solves for all
//! of them at each step. Here a row without storage and without memory,
//!
//! ```text
//! g_c·x_c + Σ g_j·x_j + Σ F_l·f_l(x) = Σ S_s·b_s(t)
//! ```
//!
//! is solved for one of its unknowns, which is replaced everywhere: in other equations by adding a multiple of the row
//! (the step of Gaussian elimination), in laws by the expression itself. Where nothing else speaks of x_c, the row goes
//! with it. What is written, remembered, switched by or stated to begin with stays an unknown, and so does what stores:
//! charges and fluxes, their equations, and everything that an error test must see stay as they are.
//!
//! Exact but for rounding, since pivots are chosen as in a factorisation with threshold: of an unknown that other equations
//! speak of too, a row of several terms is not solved where that takes multiples of others that are, in the equations' own
//! scales, more than [`THRESHOLD`] times as large.

use super::abreast::{Seat, alone};
use super::compile::compile;
use super::driven;
use super::explain::{Failure, FailureKind};
use super::settings::Settings;
use super::statistics::Statistics;
use super::step;
use super::system::System;
use crate::circuit::stamps::{
    Charge, Law, LawStamp, Leaf, MemoryStamp, Mode, SourceStamp, Stamps, Terms, UnknownId,
};
use crate::expr::Node;
use crate::trace::{Nowhere, Sink};
use smallvec::SmallVec;
use std::collections::{BTreeMap, BTreeSet};

/// The largest multiple, in scales that make the entries of rows and columns about 1.
const THRESHOLD: f64 = 100.0;
/// Entries that an elimination may add besides as many as it removes.
const FILL: usize = 16;
/// Nodes of a law's tree after a replacement.
const LARGEST_LAW: usize = 256;
/// Circuits of more unknowns stay as they are: there the order of elimination is the factorisation's concern.
const MOST_UNKNOWNS: usize = 100_000;
/// How often all equations are gone through: chains are mostly followed in one go.
const MOST_ROUNDS: usize = 64;
/// What is left of a difference after so many units of the last place of its terms is rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Runs a circuit over time, compiled by [`compile_for_run`](super::compile_for_run) from these stamps. Where that finds
/// no way, the circuit is run as it stands: from the start if there is no row yet, otherwise for what is wrong in all its
/// unknowns' names.
///
/// # Errors
/// Those of [`transient`](super::transient).
pub fn run(
    stamps: &Stamps,
    system: &System,
    settings: &Settings,
    sink: &mut dyn Sink,
) -> Result<Statistics, Failure> {
    alone(run_in_company(stamps, system, settings, sink, None))
}

/// The same beside other runs, where there is a place for it: to the last bit what it gives alone.
///
/// # Errors
/// Those of [`transient`](super::transient).
pub async fn run_in_company(
    stamps: &Stamps,
    system: &System,
    settings: &Settings,
    sink: &mut dyn Sink,
    seat: Option<Seat<'_>>,
) -> Result<Statistics, Failure> {
    let mut counted = Counted { sink, rows: 0 };
    let outcome = step::in_company(system, settings, &mut counted, seat).await;
    let failure = match outcome {
        Err(failure) if failure.kind == FailureKind::NotSolved && system.condensed => failure,
        outcome => return outcome,
    };
    let Some(whole) = compile(stamps, &mut vec![]) else { return Err(failure) };
    if counted.rows == 0 {
        return step::transient(&whole, settings, counted.sink);
    }
    let again = Settings { progress: None, ..settings.clone() };
    match step::transient(&whole, &again, &mut Nowhere) {
        Err(told) if told.kind == FailureKind::NotSolved => Err(told),
        _ => Err(failure),
    }
}

/// A sink that knows how many rows it took.
struct Counted<'a> {
    sink: &'a mut dyn Sink,
    rows: u64,
}

impl Sink for Counted<'_> {
    fn row(&mut self, values: &[f64]) -> std::io::Result<()> {
        self.rows += 1;
        self.sink.row(values)
    }

    fn step(&mut self, values: &[f64]) -> std::io::Result<()> {
        self.rows += 1;
        self.sink.step(values)
    }
}

/// The same circuit with fewer unknowns; `None` where laws leave nothing to replace.
pub(crate) fn condense(stamps: &Stamps) -> Option<Stamps> {
    let has_laws = stamps.laws.iter().any(|law| law.junction.is_none());
    if !has_laws || stamps.unknowns.len() > MOST_UNKNOWNS {
        return None;
    }
    let mut scheduled;
    let mut stamps = stamps;
    let courses = driven::courses(stamps);
    if courses.iter().any(Option::is_some) {
        scheduled = stamps.clone();
        for (mode, course) in scheduled.modes.iter_mut().zip(courses) {
            if course.is_some() {
                mode.control = Law::number(0.0);
            }
            mode.course = course;
        }
        stamps = &scheduled;
    }
    let mut condenser = Condenser::new(stamps);
    // The cheapest first: what they leave is often cheaper then.
    const CAPS: [usize; 5] = [0, 1, 2, 4, usize::MAX];
    (0..MOST_ROUNDS).any(|_| !CAPS.iter().any(|cap| condenser.round(*cap)));
    let known = stamps.modes.iter().any(|mode| mode.course.is_some());
    (known || condenser.gone.contains(&true)).then(|| condenser.finish())
}

/// A law, or the law of a charge.
struct Item {
    law: Law,
    /// The unknowns that it speaks of.
    reads: BTreeSet<u32>,
    /// Its number of nodes.
    size: usize,
    /// Whether it may be put into other laws: no junction, whose voltage is limited, and no charge.
    free: bool,
}

impl Item {
    fn new(law: Law, free: bool) -> Item {
        Item { reads: reads(&law).into_iter().collect(), size: law.size(), law, free }
    }
}

/// An equation without its storages and memories: terms, sources, laws, each with its factor.
#[derive(Default)]
struct Row {
    terms: BTreeMap<u32, f64>,
    sources: BTreeMap<u32, f64>,
    laws: BTreeMap<u32, f64>,
}

struct Condenser<'a> {
    stamps: &'a Stamps,
    /// Equations by number; `None` where one is used up.
    rows: Vec<Option<Row>>,
    /// Equations that must stay: storages and memories enter them, or their nodes are pinned.
    bound: Vec<bool>,
    /// For each unknown the equations with a term of it.
    columns: Vec<BTreeSet<u32>>,
    /// Unknowns that must stay, and those that are gone.
    kept: Vec<bool>,
    gone: Vec<bool>,
    /// Laws of equations first, in the order of the stamps, then those of charges.
    items: Vec<Item>,
    /// For each unknown the items that speak of it.
    readers: Vec<BTreeSet<u32>>,
    /// Scales of the unknowns.
    scales: Vec<f64>,
}

impl<'a> Condenser<'a> {
    fn new(stamps: &'a Stamps) -> Condenser<'a> {
        let n = stamps.unknowns.len();
        let mut rows: Vec<Row> = (0..n).map(|_| Row::default()).collect();
        for (row, column, value) in &stamps.conductances {
            *rows[row.0 as usize].terms.entry(column.0).or_insert(0.0) += value;
        }
        for (s, source) in stamps.sources.iter().enumerate() {
            for (row, factor) in &source.into {
                *rows[row.0 as usize].sources.entry(s as u32).or_insert(0.0) += factor;
            }
        }
        let mut items = vec![];
        for (l, stamp) in stamps.laws.iter().enumerate() {
            let free = stamp.junction.is_none();
            let affine = if free { linear(&stamp.law, n as u32) } else { None };
            for (row, factor) in &stamp.into {
                let row = &mut rows[row.0 as usize];
                match &affine {
                    Some(factors) => factors.iter().for_each(|(column, slope)| {
                        *row.terms.entry(*column).or_insert(0.0) += factor * slope;
                    }),
                    None => *row.laws.entry(l as u32).or_insert(0.0) += factor,
                }
            }
            // An affine law is in the rows' terms now.
            let law = if affine.is_some() { Law::number(0.0) } else { stamp.law.clone() };
            items.push(Item::new(law, free));
        }
        let curved = stamps.charges.iter().filter_map(|charge| charge.law.as_ref());
        items.extend(curved.map(|law| Item::new(law.clone(), false)));
        rows.iter_mut().for_each(|row| row.terms.retain(|_, value| *value != 0.0));

        let mut bound = vec![false; n];
        let mut kept = vec![false; n];
        for charge in &stamps.charges {
            charge.into.iter().for_each(|(row, _)| bound[row.0 as usize] = true);
            charge.linear.iter().for_each(|(unknown, _)| kept[unknown.0 as usize] = true);
        }
        for (row, _) in stamps.memories.iter().flat_map(|memory| &memory.into) {
            bound[row.0 as usize] = true;
        }
        for (node, _) in stamps.initial.iter().chain(&stamps.guesses) {
            bound[node.0 as usize] = true;
            kept[node.0 as usize] = true;
        }
        let outputs = stamps.outputs.iter().map(|(_, law)| law);
        let remembered = stamps.memories.iter().map(|memory| &memory.input);
        let controls = stamps.modes.iter().map(|mode| &mode.control);
        let junctions = stamps.laws.iter().filter(|law| law.junction.is_some());
        let junctions = junctions.map(|stamp| &stamp.law);
        for law in outputs.chain(remembered).chain(controls).chain(junctions) {
            reads(law).into_iter().for_each(|unknown| kept[unknown as usize] = true);
        }
        for junction in stamps.laws.iter().filter_map(|law| law.junction) {
            junction.across.iter().flatten().for_each(|node| kept[node.0 as usize] = true);
        }

        let mut columns = vec![BTreeSet::new(); n];
        for (r, row) in rows.iter().enumerate() {
            row.terms.keys().for_each(|c| {
                columns[*c as usize].insert(r as u32);
            });
        }
        let mut readers = vec![BTreeSet::new(); n];
        for (k, item) in items.iter().enumerate() {
            item.reads.iter().for_each(|c| {
                readers[*c as usize].insert(k as u32);
            });
        }
        let scales = scales(&rows, n);
        Condenser {
            stamps,
            rows: rows.into_iter().map(Some).collect(),
            bound,
            columns,
            kept,
            gone: vec![false; n],
            items,
            readers,
            scales,
        }
    }

    /// Uses up what rows can be for no more than a cost, in their order; says whether any was.
    fn round(&mut self, cap: usize) -> bool {
        let mut any = false;
        for r in 0..self.rows.len() {
            if self.bound[r] || self.rows[r].is_none() {
                continue;
            }
            if let Some(unknown) = self.choose(r, cap) {
                self.eliminate(r, unknown);
                any = true;
            }
        }
        any
    }

    /// The unknown that a row is best solved for, at no more than a cost: of entries that it makes.
    fn choose(&self, r: usize, cap: usize) -> Option<u32> {
        let row = self.rows[r].as_ref()?;
        let scaled = |c: &u32, value: &f64| value.abs() * self.scales[*c as usize];
        let largest = row.terms.iter().map(|(c, value)| scaled(c, value)).fold(0.0, f64::max);
        let entries = row.terms.len() + row.laws.len() + row.sources.len() - 1;
        let mut candidates: SmallVec<[(usize, u32); 4]> = SmallVec::new();
        for (c, value) in row.terms.iter().filter(|(c, _)| !self.kept[**c as usize]) {
            let others = self.columns[*c as usize].len() - 1;
            let uses = others + self.readers[*c as usize].len();
            let cost = entries * uses;
            // A row of two says what one is as exactly as what the other is, and one that alone speaks of an unknown
            // says all that is known of it.
            let sure = row.terms.len() <= 2 || others == 0;
            let fits = cost <= cap.min((entries + uses + 1).max(FILL));
            if fits && (sure || scaled(c, value) * THRESHOLD >= largest) {
                candidates.push((cost, *c));
            }
        }
        candidates.sort_unstable();
        let mut candidates = candidates.into_iter().map(|(_, c)| c);
        candidates.find(|c| {
            // Where nothing else speaks of it, the row goes with it.
            let alone =
                self.columns[*c as usize].len() == 1 && self.readers[*c as usize].is_empty();
            alone || self.defines(row, *c)
        })
    }

    /// Whether a row gives an expression that may stand wherever the unknown does.
    fn defines(&self, row: &Row, c: u32) -> bool {
        let readers = &self.readers[c as usize];
        // Sources are driven by what seeks an operating point, and laws know nothing of that.
        let still = |l: &u32| self.items[*l as usize].reads.is_empty();
        if !readers.is_empty() && (!row.sources.is_empty() || row.laws.keys().any(still)) {
            return false;
        }
        let mut size = 4 * row.terms.len();
        for l in row.laws.keys() {
            let item = &self.items[*l as usize];
            if !item.free || item.reads.contains(&c) {
                return false;
            }
            size += 4 + item.size;
        }
        readers.iter().all(|k| {
            let item = &self.items[*k as usize];
            item.size + size * occurrences(&item.law, c) <= LARGEST_LAW
        })
    }

    /// Solves row `r` for unknown `c`, and puts the result in its place.
    fn eliminate(&mut self, r: usize, c: u32) {
        let Some(row) = self.rows[r].take() else { return };
        self.gone[c as usize] = true;
        for column in row.terms.keys() {
            self.columns[*column as usize].remove(&(r as u32));
        }
        let Some(pivot) = row.terms.get(&c).copied() else { return };
        for i in std::mem::take(&mut self.columns[c as usize]) {
            let Some(other) = &mut self.rows[i as usize] else { continue };
            let Some(factor) = other.terms.remove(&c).map(|value| value / pivot) else { continue };
            for (column, value) in row.terms.iter().filter(|(column, _)| **column != c) {
                let of_column = &mut self.columns[*column as usize];
                match subtract(&mut other.terms, *column, factor * value) {
                    true => of_column.insert(i),
                    false => of_column.remove(&i),
                };
            }
            for (s, value) in &row.sources {
                subtract(&mut other.sources, *s, factor * value);
            }
            for (l, value) in &row.laws {
                subtract(&mut other.laws, *l, factor * value);
            }
        }
        let readers = std::mem::take(&mut self.readers[c as usize]);
        if readers.is_empty() {
            return;
        }
        let place = self.expression(&row, c, pivot);
        for k in readers {
            let item = &mut self.items[k as usize];
            let law = item.law.map(&mut |leaf, span| match leaf {
                Leaf::Unknown(id) if id.0 == c => place.clone(),
                leaf => Law::new(Node::Leaf(*leaf), span),
            });
            *item = Item::new(law, item.free);
            for unknown in &item.reads {
                self.readers[*unknown as usize].insert(k);
            }
        }
    }

    /// The unknown of a row in terms of the rest: −(Σ g_j·x_j + Σ F_l·f_l)/g_c.
    fn expression(&self, row: &Row, c: u32, pivot: f64) -> Law {
        let terms = row.terms.iter().filter(|(column, _)| **column != c);
        let terms =
            terms.map(|(column, g)| (-g / pivot, Law::leaf(Leaf::Unknown(UnknownId(*column)))));
        let laws = row.laws.iter();
        let laws = laws.map(|(l, factor)| (-factor / pivot, self.items[*l as usize].law.clone()));
        let mut sum: Option<Law> = None;
        for (factor, part) in terms.chain(laws) {
            let size = if factor.abs() == 1.0 { part } else { Law::number(factor.abs()) * part };
            sum = Some(match sum {
                None if factor < 0.0 => -size,
                None => size,
                Some(sum) if factor < 0.0 => sum - size,
                Some(sum) => sum + size,
            });
        }
        sum.unwrap_or_else(|| Law::number(0.0))
    }

    /// The stamps of what is left.
    fn finish(self) -> Stamps {
        let Condenser { stamps, rows, gone, items, columns, readers, .. } = self;
        // What is large makes room for what is made of it, piece by piece.
        drop((columns, readers));
        let kept: Vec<u32> = (0..gone.len() as u32).filter(|c| !gone[*c as usize]).collect();
        let nodes = kept.iter().filter(|c| (**c as usize) < stamps.nodes).count();
        // Each unknown keeps the equation of its number where that is left; the others are dealt out.
        let alive = |r: &u32| rows[*r as usize].is_some();
        let left_over = |r: &u32| gone[*r as usize];
        let mut spare = (0..rows.len() as u32).filter(|r| alive(r) && left_over(r));
        let order: Vec<u32> =
            kept.iter().filter_map(|c| if alive(c) { Some(*c) } else { spare.next() }).collect();
        let (column_of, row_of) = (places(&kept, gone.len()), places(&order, gone.len()));
        let column = |c: u32| UnknownId(column_of[c as usize]);
        let at = |r: UnknownId| UnknownId(row_of[r.0 as usize]);
        let into = |terms: &Terms| terms.iter().map(|(row, factor)| (at(*row), *factor)).collect();
        let renamed = |law: &Law| {
            law.map(&mut |leaf, span| {
                let leaf = match leaf {
                    Leaf::Unknown(id) => Leaf::Unknown(column(id.0)),
                    other => *other,
                };
                Law::new(Node::Leaf(leaf), span)
            })
        };

        let mut conductances = vec![];
        let mut of_sources = vec![Terms::new(); stamps.sources.len()];
        let mut of_laws = vec![Terms::new(); stamps.laws.len()];
        for (r, row) in order.iter().filter_map(|r| rows[*r as usize].as_ref().map(|row| (*r, row)))
        {
            let own = at(UnknownId(r));
            conductances.extend(row.terms.iter().map(|(c, value)| (own, column(*c), *value)));
            row.sources.iter().for_each(|(s, factor)| of_sources[*s as usize].push((own, *factor)));
            row.laws.iter().for_each(|(l, factor)| of_laws[*l as usize].push((own, *factor)));
        }
        let left = |values: &Terms| -> Terms {
            let left = values.iter().filter(|(node, _)| !gone[node.0 as usize]);
            left.map(|(node, value)| (column(node.0), *value)).collect()
        };
        // Corners of sources that nothing follows from end no step.
        let sources = stamps.sources.iter().zip(of_sources).filter(|(_, into)| !into.is_empty());
        let mut items = items.into_iter();
        let laws = stamps.laws.iter().zip(of_laws).zip(items.by_ref());
        let laws = laws.filter(|((_, into), _)| !into.is_empty()).map(|((stamp, into), item)| {
            let mut junction = stamp.junction;
            for end in junction.iter_mut().flat_map(|junction| &mut junction.across).flatten() {
                *end = column(end.0);
            }
            LawStamp { device: stamp.device, law: renamed(&item.law), into, junction }
        });
        let laws = laws.collect();
        // Of charges only those with laws have items.
        let mut law_of = |charge: &Charge| {
            charge.law.as_ref().and_then(|_| items.next()).map(|item| renamed(&item.law))
        };
        Stamps {
            spoken: stamps.spoken.clone(),
            unknowns: kept.iter().map(|c| stamps.unknowns[*c as usize].clone()).collect(),
            nodes,
            conductances,
            charges: stamps
                .charges
                .iter()
                .map(|charge| Charge {
                    law: law_of(charge),
                    linear: charge.linear.iter().map(|(c, v)| (column(c.0), *v)).collect(),
                    into: into(&charge.into),
                    ..*charge
                })
                .collect(),
            laws,
            sources: sources.map(|(source, into)| SourceStamp { into, ..source.clone() }).collect(),
            memories: stamps
                .memories
                .iter()
                .map(|memory| MemoryStamp {
                    input: renamed(&memory.input),
                    into: into(&memory.into),
                    ..*memory
                })
                .collect(),
            modes: stamps
                .modes
                .iter()
                .map(|mode| Mode { control: renamed(&mode.control), ..mode.clone() })
                .collect(),
            outputs: stamps
                .outputs
                .iter()
                .map(|(name, law)| (name.clone(), renamed(law)))
                .collect(),
            watched: stamps.watched,
            initial: left(&stamps.initial),
            guesses: left(&stamps.guesses),
            starts: left(&stamps.starts),
            initial_holds: stamps.initial_holds,
            devices: stamps.devices.clone(),
        }
    }
}

/// Scales of the unknowns with which the entries of rows and columns are about 1: in turn each is divided by the geometric
/// mean of its largest and its smallest entry (J. K. Reid's and A. R. Curtis's scaling by a cheap way to about the same).
fn scales(rows: &[Row], n: usize) -> Vec<f64> {
    const TURNS: usize = 8;
    let mut of_rows = vec![1.0f64; rows.len()];
    let mut of_columns = vec![1.0f64; n];
    // Largest and smallest entry.
    let none = (0.0f64, f64::INFINITY);
    let see = |(most, least): (f64, f64), size: f64| (most.max(size), least.min(size));
    let mean = |(most, least): (f64, f64)| match most > 0.0 {
        true => (most.sqrt() * least.sqrt()).recip(),
        false => 1.0,
    };
    for _ in 0..TURNS {
        for (row, scale) in rows.iter().zip(&mut of_rows) {
            let sizes = row.terms.iter().map(|(c, value)| value.abs() * of_columns[*c as usize]);
            *scale = mean(sizes.fold(none, see));
        }
        let mut seen = vec![none; n];
        for (row, scale) in rows.iter().zip(&of_rows) {
            for (c, value) in &row.terms {
                seen[*c as usize] = see(seen[*c as usize], value.abs() * scale);
            }
        }
        of_columns = seen.into_iter().map(mean).collect();
    }
    of_columns
}

/// For each number its place in a list, where it has one.
fn places(list: &[u32], n: usize) -> Vec<u32> {
    let mut places = vec![u32::MAX; n];
    list.iter().enumerate().for_each(|(at, k)| places[*k as usize] = at as u32);
    places
}

/// Takes a value off an entry, which is left out where nothing but rounding is left; says whether it is there then.
fn subtract(entries: &mut BTreeMap<u32, f64>, key: u32, value: f64) -> bool {
    let before = entries.get(&key).copied().unwrap_or(0.0);
    let left = before - value;
    if left.abs() <= ROUNDING * before.abs().max(value.abs()) {
        entries.remove(&key);
        return false;
    }
    entries.insert(key, left);
    true
}

/// The unknowns that a law speaks of, as often as it does.
fn reads(law: &Law) -> Vec<u32> {
    let mut unknowns = vec![];
    law.leaves(&mut |leaf, _| {
        if let Leaf::Unknown(id) = leaf {
            unknowns.push(id.0);
        }
    });
    unknowns
}

fn occurrences(law: &Law, unknown: u32) -> usize {
    reads(law).into_iter().filter(|own| *own == unknown).count()
}

/// The factors of a law that is a sum of multiples of unknowns, and nothing besides.
fn linear(law: &Law, n: u32) -> Option<Vec<(u32, f64)>> {
    let (constant, factors) = driven::affine(law, n)?;
    (constant == 0.0 && factors.iter().all(|(input, _)| *input < n)).then_some(factors)
}
