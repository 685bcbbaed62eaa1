//! Laws that an expression of a text writes out, back to what they were cut to.
//!
//! An expression may hold a law as its text, and a law that is cut has another value than its text. Where a part of the
//! expression has the value of such a text, it counts as what the law was cut to. Some parts only happen to have that
//! value: `u^2` of `1 + u^2` where another law is `e*u` and e is u. So each of those that were met may also stay as it is.

use super::draw::Modular;
use super::form::Trouble;
use std::cell::RefCell;
use std::collections::HashMap;

/// Of so many texts met in one expression all choices are tried; any further ones are always replaced.
const MOST: usize = 5;

/// What parts of an expression are replaced by.
pub struct Uncut<'a, F> {
    /// By the value of a law's text: what it was cut to.
    table: &'a HashMap<u64, F>,
    /// Values that stay as they are.
    stay: Vec<u64>,
    /// Values that were met.
    met: RefCell<Vec<u64>>,
}

impl<F: Modular> Uncut<'_, F> {
    /// What a value of a part counts as.
    pub fn of(&self, value: F) -> F {
        let (own, negative) = (value.value(), (-value).value());
        let (key, found) = match (self.table.get(&own), self.table.get(&negative)) {
            (Some(to), _) => (own, *to),
            (None, Some(to)) => (negative, -*to),
            (None, None) => return value,
        };
        if self.stay.contains(&key) {
            return value;
        }
        self.met.borrow_mut().push(key);
        found
    }
}

/// Whether an expression has a value when the laws of some table are replaced in it, all or some of them; each choice of
/// some is one more try at chance.
///
/// # Errors
/// Why it has none.
pub fn has<F: Modular>(
    tables: &[HashMap<u64, F>],
    value: F,
    tries: &mut usize,
    evaluate: &mut dyn FnMut(&Uncut<F>) -> Result<F, Trouble>,
) -> Result<bool, Trouble> {
    for table in tables {
        let mut uncut = Uncut { table, stay: vec![], met: RefCell::default() };
        if evaluate(&uncut)? == value {
            return Ok(true);
        }
        let mut met = uncut.met.take();
        met.sort_unstable();
        met.dedup();
        met.truncate(MOST);
        for choice in 1..1u32 << met.len() {
            let stays = met.iter().enumerate().filter(|(k, _)| choice >> k & 1 == 1);
            *tries += 1;
            uncut.stay = stays.map(|(_, key)| *key).collect();
            if evaluate(&uncut)? == value {
                return Ok(true);
            }
        }
    }
    Ok(false)
}
