//! Every code that the sources use has its row in the table, and every row is used.

use std::collections::BTreeSet;
use std::path::Path;

fn texts(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            texts(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            found.push((path.to_string_lossy().into_owned(), text));
        }
    }
}

/// Every `"E0101"` and the like.
fn codes(text: &str) -> impl Iterator<Item = &str> {
    text.match_indices('"').filter_map(|(at, _)| {
        let code = text.get(at + 1..at + 6)?;
        let closed = text.get(at + 6..at + 7) == Some("\"");
        let digits = code.is_ascii()
            && code[1..].bytes().all(|byte| byte.is_ascii_digit())
            && ["0", "1"].contains(&&code[1..2]);
        (closed && digits && "EWN".contains(&code[..1])).then_some(code)
    })
}

#[test]
fn codes_and_rows_belong_together() {
    let mut found = vec![];
    texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut found);
    let rows: BTreeSet<&str> =
        bondspice::diagnostic::codes::CODES.iter().map(|row| row.code).collect();
    let mut used = BTreeSet::new();
    for (path, text) in &found {
        if path.ends_with("codes.rs") || path.ends_with("tests.rs") {
            continue;
        }
        // Tests may speak of any code.
        let code_only = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        for code in codes(code_only) {
            assert!(rows.contains(code), "{path} uses {code}, which has no row");
            used.insert(code);
        }
    }
    let unused: Vec<_> = rows.difference(&used).collect();
    assert!(unused.is_empty(), "rows that nothing uses: {unused:?}");
}
