//! The nearest name: what somebody probably meant.

use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// Adds the nearest name as a hint; and as a fix, where what is written at `span` is surely a slip for it.
pub fn did_you_mean(error: Diagnostic, span: Span, written: &str, meant: &str) -> Diagnostic {
    let error = error.help(format!("did you mean `{meant}`?"));
    if span.is_none() || !is_slip(written, meant) {
        return error;
    }
    error.fix(format!("write `{meant}`"), vec![(span, meant.to_string())])
}

/// The candidate nearest to `name` by edit distance, when it is near enough to be a likely slip; letters that differ
/// only in case, and two neighbours swapped, count less. The first of several equally near ones.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters: Vec<char> = name.chars().take(LONGEST).collect();
    let held = letters_held(name);
    let mut limit = 2 * letters.len().div_ceil(3).clamp(1, 3);
    let mut best = None;
    for candidate in candidates {
        // No edit costs less than the letters that it brings in and takes away: most names need no closer look.
        if (held ^ letters_held(candidate)).count_ones() as usize > limit || candidate == name {
            continue;
        }
        let Some(distance) = distance(&letters, candidate, limit) else { continue };
        // A letter has every other letter near it: there only a slip of case counts; of two letters the first must be
        // right.
        let longest = candidate.chars().count().max(letters.len());
        let begins = candidate.chars().next() == letters.first().copied();
        if distance == 1 || longest > 2 || (longest == 2 && letters.len() == 2 && begins) {
            best = Some(candidate);
            match distance {
                0 | 1 => break,
                _ => limit = distance - 1,
            }
        }
    }
    best
}

/// Letters of a name that are looked at.
const LONGEST: usize = 64;

/// Which letters and figures a name holds, without regard to case, one bit each; others share bits.
fn letters_held(name: &str) -> u64 {
    name.chars().take(LONGEST).fold(0, |held, letter| {
        let bit = match letter {
            'a'..='z' => letter as u32 - 'a' as u32,
            'A'..='Z' => letter as u32 - 'A' as u32,
            '0'..='9' => 26 + (letter as u32 - '0' as u32),
            '_' => 36,
            '.' => 37,
            // Beyond ASCII case is not looked at, since a letter may change its number of them.
            _ => return held,
        };
        held | 1 << bit
    })
}

/// Whether a name is surely a slip of the pen for another: letters of the wrong case, two neighbours swapped, or one
/// letter too many or too few. A letter or figure in the place of another may be another name, as `R_1` is not `R_2`.
pub fn is_slip(name: &str, meant: &str) -> bool {
    if name.to_lowercase() == meant.to_lowercase() {
        return true;
    }
    let (a, b): (Vec<char>, Vec<char>) = (name.chars().collect(), meant.chars().collect());
    let same = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    let (short, long) = if a.len() < b.len() { (&a, &b) } else { (&b, &a) };
    if short.len() == long.len() {
        let swapped = a.get(same) == b.get(same + 1) && a.get(same + 1) == b.get(same);
        return swapped && a.get(same + 2..) == b.get(same + 2..);
    }
    let extra = long.get(same).is_some_and(|c| !c.is_ascii_digit());
    short.len() >= 3 && extra && short.get(same..) == long.get(same + 1..)
}

/// Twice the edit distance (optimal string alignment), a change of case counting one half; `None` above a limit.
fn distance(a: &[char], b: &str, limit: usize) -> Option<usize> {
    let mut letters = ['\0'; LONGEST];
    let mut count = 0;
    for (place, letter) in letters.iter_mut().zip(b.chars()) {
        *place = letter;
        count += 1;
    }
    let b = &letters[..count];
    if 2 * a.len().abs_diff(count) > limit {
        return None;
    }
    let mut before = [0usize; LONGEST + 1];
    let mut last: [usize; LONGEST + 1] = std::array::from_fn(|j| 2 * j);
    for i in 1..=a.len() {
        let mut row = [2 * i; LONGEST + 1];
        for j in 1..=count {
            let change = if a[i - 1] == b[j - 1] {
                0
            } else if a[i - 1].to_lowercase().eq(b[j - 1].to_lowercase()) {
                1
            } else {
                2
            };
            row[j] = (last[j - 1] + change).min(last[j] + 2).min(row[j - 1] + 2);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 2);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    Some(last[count]).filter(|distance| *distance <= limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_told_from_other_names() {
        for (name, meant) in [
            ("SQRT", "sqrt"),
            ("armatuer", "armature"),
            ("xref", "x_ref"),
            ("R_etta", "R_eta"),
            ("Rr", "rR"),
        ] {
            assert!(is_slip(name, meant) && is_slip(meant, name), "{name} {meant}");
        }
        for (name, meant) in [
            ("cbrt", "sqrt"),
            ("R_1", "R_2"),
            ("R_load1", "R_load"),
            ("Ki", "Kp"),
            ("ab", "abc"),
            ("", "a"),
        ] {
            assert!(!is_slip(name, meant) && !is_slip(meant, name), "{name} {meant}");
        }
    }

    #[test]
    fn likely_slips() {
        let names = ["armature", "shaft", "pump_port", "L", "rod"];
        assert_eq!(nearest("armatre", names), Some("armature"));
        assert_eq!(nearest("pumpport", names), Some("pump_port"));
        assert_eq!(nearest("l", names), Some("L"));
        assert_eq!(nearest("x", names), None);
        assert_eq!(nearest("DM", ["DN", "QM"]), Some("DN"));
        assert_eq!(nearest("y2", ["x2", "z"]), None);
        assert_eq!(nearest("zzzzzz", names), None);
        assert_eq!(nearest("rdo", names), Some("rod"));
    }
}
