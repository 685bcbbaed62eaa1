//! The texts that fuzzing found worth keeping, the shipped models and the bad files: each is read as a bond graph, laid
//! out and elaborated, read as a deck, a number and a trace, without a crash, in less than a second and a gigabyte.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[path = "../fuzz/targets.rs"]
mod targets;

/// Every file in a folder and those below it.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
    found.sort();
}

/// The shortest of three times, as long as they are over a second: others use the machine too.
fn time(run: impl Fn()) -> Duration {
    let mut best = Duration::MAX;
    for _ in 0..3 {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed());
        if best < Duration::from_secs(1) {
            break;
        }
    }
    best
}

/// The most memory that the process has held, in kilobytes, where the system tells.
fn most_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn every_text_is_survived() {
    // As much stack as the main thread of a program has.
    let run = std::thread::Builder::new().stack_size(8 << 20).spawn(replay).unwrap();
    run.join().unwrap();
}

fn replay() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![];
    for folder in ["models", "tests/bad", "fuzz/corpus", "fuzz/found"] {
        files(&root.join(folder), &mut found);
    }
    assert!(found.len() > 100, "{} files", found.len());
    for path in found {
        let data = std::fs::read(&path).unwrap();
        for (name, target) in [
            ("parse", targets::parse as fn(&[u8])),
            ("format", targets::format),
            ("elaborate", targets::elaborate),
            ("number", targets::number),
            ("raw", targets::raw),
            ("table", targets::table),
            ("deck", targets::deck),
        ] {
            let took = time(|| target(&data));
            // A deck may expand to as many devices as there may be, in each dialect.
            let most = if name == "deck" { 60 } else { 1 };
            assert!(took < Duration::from_secs(most), "{name} {}: {took:?}", path.display());
        }
    }
    if let Some(memory) = most_memory() {
        assert!(memory < 1 << 20, "{memory} kB");
    }
}
