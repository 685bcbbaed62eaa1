//! Interned names. SPICE folds case: names that differ only in case are one.
//!
//! Big decks hold millions of names, so they stand in one buffer, found by a hash of their own that folds case on the
//! way and allocates nothing.

/// An interned name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Name(pub u32);

/// The names of a netlist, spelled as first seen.
#[derive(Clone, Debug, Default)]
pub struct Names {
    text: String,
    /// Where each name ends in `text`, and its hash.
    ends: Vec<(usize, u32)>,
    /// Open addressing, a power of two in length; `EMPTY`, or an index into `ends` and the hash, which stands here too
    /// so that names that differ are told apart without a look elsewhere.
    slots: Vec<(u32, u32)>,
    /// The last names asked for, by the lowest bits of their hashes: cards that follow each other speak of the same ones,
    /// and these stay in the cache where `slots` does not.
    recent: Vec<(u32, u32)>,
}

/// So many recent names, a power of two.
const RECENT: usize = 512;

const EMPTY: (u32, u32) = (u32::MAX, 0);

impl Names {
    /// The name of a text.
    pub fn intern(&mut self, text: &str) -> Name {
        // At most half full: rows that fall together are as long as they are.
        if (self.ends.len() + 1) * 2 > self.slots.len() {
            self.grow();
        }
        let hash = hash(text);
        let place = hash as usize % RECENT;
        let (last, own) = self.recent[place];
        if last != EMPTY.0 && own == hash && equal(self.text(Name(last)), text) {
            return Name(last);
        }
        let name = match self.slot(text, hash) {
            Ok(name) => name,
            Err(slot) => {
                let name = self.ends.len() as u32;
                self.text.push_str(text);
                self.ends.push((self.text.len(), hash));
                self.slots[slot] = (name, hash);
                Name(name)
            }
        };
        self.recent[place] = (name.0, hash);
        name
    }

    /// A new name of a text, whether or not another is spelled alike but for case. `find` goes on giving the first, so
    /// that this is for netlists that are to be written, not looked up in.
    pub fn add(&mut self, text: &str) -> Name {
        self.text.push_str(text);
        self.ends.push((self.text.len(), hash(text)));
        Name(self.ends.len() as u32 - 1)
    }

    /// The name of a text that has been seen before.
    pub fn find(&self, text: &str) -> Option<Name> {
        if self.slots.is_empty() { None } else { self.slot(text, hash(text)).ok() }
    }

    /// How a name was first spelled.
    pub fn text(&self, name: Name) -> &str {
        let k = name.0 as usize;
        let start = if k == 0 { 0 } else { self.ends[k - 1].0 };
        &self.text[start..self.ends[k].0]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The name, or the free slot where it would stand.
    fn slot(&self, text: &str, hash: u32) -> Result<Name, usize> {
        let mask = self.slots.len() - 1;
        let mut slot = hash as usize & mask;
        loop {
            match self.slots[slot] {
                EMPTY => return Err(slot),
                (name, own) if own == hash && equal(self.text(Name(name)), text) => {
                    return Ok(Name(name));
                }
                _ => {}
            }
            slot = (slot + 1) & mask;
        }
    }

    fn grow(&mut self) {
        let size = (self.slots.len() * 2).max(64);
        self.slots = vec![EMPTY; size];
        self.recent.resize(RECENT, EMPTY);
        for (name, (_, hash)) in self.ends.iter().enumerate() {
            let mut slot = *hash as usize & (size - 1);
            while self.slots[slot] != EMPTY {
                slot = (slot + 1) & (size - 1);
            }
            self.slots[slot] = (name as u32, *hash);
        }
    }
}

fn equal(a: &str, b: &str) -> bool {
    if a.is_ascii() && b.is_ascii() {
        a.eq_ignore_ascii_case(b)
    } else {
        a.chars().flat_map(char::to_lowercase).eq(b.chars().flat_map(char::to_lowercase))
    }
}

/// Names that are counted through (`n17`, `n18`) stand beside each other, this many in a row, since cards mostly speak of
/// them in their order: a block in the cache holds them all.
const ROW: u32 = 16;

/// FNV-1a over the folded text but for the number that it ends with; of that the higher part is mixed in, and the lower
/// one says where in the row.
fn hash(text: &str) -> u32 {
    let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
    let digits = text.bytes().rev().take(9).take_while(u8::is_ascii_digit).count();
    let (word, number) = text.split_at(text.len() - digits);
    let number = number.bytes().fold(0, |number, digit| 10 * number + u32::from(digit - b'0'));
    let start = 0xcbf2_9ce4_8422_2325;
    let hash = if word.is_ascii() {
        word.bytes().fold(start, |hash, byte| mix(hash, byte.to_ascii_lowercase()))
    } else {
        let mut bytes = [0; 4];
        word.chars()
            .flat_map(char::to_lowercase)
            .fold(start, |hash, letter| letter.encode_utf8(&mut bytes).bytes().fold(hash, mix))
    };
    // The last multiplication spreads only upwards, and the lowest bits are those that count.
    let hash = (hash ^ u64::from(number / ROW)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((hash >> 32) as u32 & !(ROW - 1)) | (number % ROW)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn case_is_folded_and_the_first_spelling_kept() {
        let mut names = Names::default();
        assert_eq!(names.find("x"), None);
        let out = names.intern("Out");
        let omega = names.intern("Ω_ref");
        assert_eq!((names.intern("oUT"), names.find("OUT")), (out, Some(out)));
        assert_eq!(names.intern("ω_REF"), omega);
        assert_eq!((names.text(out), names.text(omega), names.len()), ("Out", "Ω_ref", 2));
    }

    #[test]
    fn many_names_stay_apart() {
        let mut names = Names::default();
        let interned: Vec<_> = (0..10_000).map(|k| names.intern(&format!("n{k}"))).collect();
        for (k, name) in interned.iter().enumerate() {
            assert_eq!(names.text(*name), format!("n{k}"));
            assert_eq!(names.find(&format!("N{k}")), Some(*name));
        }
    }
}
