//! Small traces, decks and numbers, changed at random, through the functions that the fuzzer tries: none may panic.
//!
//! Without a fuzzer's knowledge of what has been reached, but on every toolchain. `BONDSPICE_MUTATE=600` goes on for that
//! many seconds; the seed is printed with what fails.

#[path = "../fuzz/targets.rs"]
mod targets;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Numbers without a pattern (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % below.max(1) as u64) as usize
    }
}

/// Pieces that readers look for.
const WORDS: &[&str] = &[
    "1e999",
    "-1",
    "nan",
    "18446744073709551616",
    "0",
    "1e-320",
    "\n",
    "\r\n",
    "\t",
    ",",
    ";",
    "\"",
    "{",
    "}",
    "'",
    "(",
    ")",
    "=",
    "+",
    "No. Points: ",
    "No. Variables: ",
    "Flags: complex",
    "Flags: real forward stepped",
    "Values:\n",
    "Binary:\n",
    "Variables:\n",
    "Title: ",
    "time",
    "step",
    "Index",
    "$var real 64 ! v $end\n",
    "#10\n",
    "r1.5 !\n",
    "$timescale 1 ns $end\n",
    ".subckt",
    ".ends\n",
    ".param a={a}\n",
    ".measure tran m ",
    "WHEN v(a)=",
    "TRIG",
    "TARG",
    "FIND",
    "AVG",
    "FROM=",
    ".if (1)\n",
    ".else\n",
    ".endif\n",
    ".func f(x) {f(x)}\n",
    "PULSE(",
    "VALUE={",
    "POLY(2)",
    "TABLE",
    ".model d d(",
    "uic",
    "\0",
    "\u{b5}",
    "\u{feff}",
    "//",
    "*",
    "$ ",
];

/// A text with some of its bytes changed, left out, repeated, or put elsewhere.
fn mutate(seed: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=random.next(6) {
        let at = random.next(bytes.len() + 1);
        let end = (at + 1 + random.next(24)).min(bytes.len());
        match random.next(6) {
            0 if at < bytes.len() => bytes[at] = random.next(256) as u8,
            1 if at < end => drop(bytes.drain(at..end)),
            2 if at < end => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            3 => {
                let from = random.next(other.len() + 1);
                let to = (from + random.next(64)).min(other.len());
                bytes.splice(at..at, other[from..to].iter().copied());
            }
            4 => bytes.truncate(at),
            _ => {
                let word = WORDS[random.next(WORDS.len())];
                bytes.splice(at..at, word.bytes());
            }
        }
    }
    bytes
}

fn seeds(folders: &[&str], endings: &[&str]) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<PathBuf> = vec![];
    for folder in folders {
        let entries = std::fs::read_dir(root.join(folder)).into_iter().flatten();
        paths.extend(entries.map(|entry| entry.unwrap().path()));
    }
    paths.retain(|path| {
        let ending = path.extension().map(|e| e.to_string_lossy().into_owned());
        ending.is_some_and(|ending| endings.contains(&ending.as_str()))
    });
    paths.sort();
    let texts = paths.into_iter().map(|path| std::fs::read(path).unwrap());
    texts.filter(|text| text.len() < 4096).collect()
}

fn run(name: &str, seeds: &[Vec<u8>], target: fn(&[u8])) {
    let seconds = std::env::var("BONDSPICE_MUTATE").ok().and_then(|text| text.parse().ok());
    let long = Duration::from_secs_f64(seconds.unwrap_or(1.0));
    assert!(seeds.len() > 3, "{name}: {} seeds", seeds.len());
    let start = if seconds.is_some() { std::process::id().into() } else { 20_050_523 };
    let mut random = Random(start);
    let begun = Instant::now();
    let mut tried = 0_u64;
    while begun.elapsed() < long {
        let (seed, other) = (&seeds[random.next(seeds.len())], &seeds[random.next(seeds.len())]);
        let bytes = mutate(seed, other, &mut random);
        let at = Instant::now();
        let outcome = std::panic::catch_unwind(|| target(&bytes));
        if outcome.is_err() || at.elapsed() > Duration::from_secs(120) {
            let path = std::env::temp_dir().join(format!("{name}.{start}"));
            std::fs::write(&path, &bytes).unwrap();
            panic!("{name}: {} after {tried} tries, {:?}", path.display(), at.elapsed());
        }
        tried += 1;
    }
    eprintln!("{name}: {tried} tries");
}

/// The traces of the gallery in every format.
fn traces() -> Vec<Vec<u8>> {
    use bondspice::trace::formats;
    let mut all = seeds(&["tests/bad/with", "fuzz/found"], &["csv", "json", "vcd", "prn", "raw"]);
    let read: Vec<_> = all.iter().filter_map(|bytes| formats::read("seed", bytes).ok()).collect();
    for trace in read {
        for format in formats::FORMATS {
            let mut bytes = vec![];
            (format.write)(&trace, &formats::Heading::default(), &mut bytes).unwrap();
            all.push(bytes);
        }
    }
    all
}

#[test]
fn traces_are_read_or_refused() {
    run("table", &traces(), targets::table);
    run("raw", &traces(), targets::raw);
}

#[test]
fn decks_are_read_or_refused() {
    run("deck", &seeds(&["tests/decks", "tests/bad", "netlists"], &["cir"]), targets::deck);
}

#[test]
fn numbers_are_read_or_refused() {
    let texts = ["1", "-1.5e-3", "4k7", "10meg", "3mil", "1e999", ".5u", "0x", "1\u{b5}F"];
    let texts: Vec<Vec<u8>> = texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    run("number", &texts, targets::number);
}
