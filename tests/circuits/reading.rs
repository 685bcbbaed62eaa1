//! Netlists of several files and in several dialects, with values that are known in closed form; where ngspice reads the
//! same text, its values besides.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Run};
use bondspice::source::SourceMap;
use bondspice::source::loader;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Runs a file; the last row by the names of its columns, and what was said.
fn run_file(path: &str, overrides: &Overrides) -> Result<BTreeMap<String, f64>, Vec<String>> {
    let mut map = SourceMap::default();
    let file = loader::load(path, &mut map).unwrap();
    let mut d = vec![];
    let run = pipeline::prepare(&mut map, file, overrides, None, &mut d);
    let said = d.iter().map(|d| format!("{} {}", d.code, d.message)).collect::<Vec<_>>();
    let run: Run = run.ok_or(said)?;
    let mut trace = run.trace();
    run.go(&mut trace).unwrap();
    let last = trace.columns.iter().map(|column| *column.last().unwrap());
    Ok(trace.names.iter().cloned().zip(last).collect())
}

fn in_dialect(dialect: &str) -> Overrides {
    Overrides { dialect: Some(dialect.into()), ..Overrides::default() }
}

/// Writes files into a folder of their own.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    folder
}

fn at(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

/// The operating point of ngspice, or `None` where it is not installed.
fn ngspice(path: &str) -> Option<BTreeMap<String, f64>> {
    if !crate::peers::has("ngspice") {
        return None;
    }
    let raw = format!("{path}.raw");
    Command::new("ngspice").args(["-b", "-r", &raw, path]).output().unwrap();
    let bytes = std::fs::read(&raw).unwrap_or_else(|_| panic!("ngspice ran {path} to no result"));
    let trace = bondspice::trace::formats::read(&raw, &bytes).unwrap();
    let last = trace.columns.iter().map(|column| *column.last().unwrap());
    Some(trace.names.iter().cloned().zip(last).collect())
}

const LIBRARY: &str = "\
* parts
.lib slow
.subckt part a b
r1 a b 10k
r2 b 0 10k
.ends
.endl
.lib fast
.subckt part a b
r1 a b 100
r2 b 0 300
.ends
.endl fast
";

#[test]
fn files_and_sections() {
    let folder = folder(&[
        (
            "deck.cir",
            "two files\nv1 1 0 8\n.lib 'lib/parts.lib' fast\nx1 1 2 part\n.include lib/load.inc\n.op\n.end\n",
        ),
        ("lib/parts.lib", LIBRARY),
        ("lib/load.inc", ".inc \"more.inc\"\nr5 2 0 {rload}\n"),
        ("lib/more.inc", ".param rload=1meg\nr4 3 0 1k\nr6 3 1 3k\n"),
    ]);
    let path = at(folder.path(), "deck.cir");
    let found = run_file(&path, &Overrides::default()).unwrap();
    let r2 = 300.0 * 1e6 / (1e6 + 300.0);
    let expected = 8.0 * r2 / (100.0 + r2);
    assert!((found["v(2)"] - expected).abs() < 1e-9, "{found:?}");
    assert!((found["v(3)"] - 2.0).abs() < 1e-9, "{found:?}");
    if let Some(theirs) = ngspice(&path) {
        for name in ["v(2)", "v(3)"] {
            assert!((theirs[name] - found[name]).abs() < 1e-6, "{name}: {theirs:?}");
        }
    }
}

#[test]
fn names_of_files_are_kept_within_a_folder() {
    let folder = folder(&[
        ("in/deck.cir", "outside\nv1 1 0 8\nr1 1 0 1\n.include ../out.inc\n.op\n.end\n"),
        ("in/link.cir", "by a link\nv1 1 0 8\nr1 1 0 1\n.include link.inc\n.op\n.end\n"),
        ("in/good.cir", "inside\nv1 1 0 8\n.include deep/in.inc\n.op\n.end\n"),
        ("in/deep/in.inc", "r1 1 0 1\n"),
        ("out.inc", "r2 1 0 1\n"),
    ]);
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.path().join("out.inc"), folder.path().join("in/link.inc"))
        .unwrap();
    let confine = Overrides { confine: Some(at(folder.path(), "in")), ..Overrides::default() };
    for name in ["in/deck.cir", "in/link.cir"] {
        let path = at(folder.path(), name);
        assert!(run_file(&path, &Overrides::default()).is_ok(), "{name}");
        let said = run_file(&path, &confine).unwrap_err();
        assert!(said.iter().any(|said| said.starts_with("E0712")), "{said:?}");
    }
    assert!(run_file(&at(folder.path(), "in/good.cir"), &confine).is_ok());
}

#[test]
fn a_missing_file_is_named_with_the_nearest() {
    let folder = folder(&[
        ("deck.cir", "missing\nv1 1 0 8\nr1 1 0 1\n.include partz.inc\n.op\n.end\n"),
        ("parts.inc", "r2 1 0 1\n"),
    ]);
    let mut map = SourceMap::default();
    let file = loader::load(&at(folder.path(), "deck.cir"), &mut map).unwrap();
    let mut d = vec![];
    assert!(pipeline::prepare(&mut map, file, &Overrides::default(), None, &mut d).is_none());
    let error = d.iter().find(|d| d.code == "E0901").unwrap_or_else(|| panic!("{d:?}"));
    assert!(error.help.as_ref().unwrap().contains("parts.inc"), "{error:?}");
    assert_eq!(map.text(error.labels[0].span), "partz.inc");
}

#[test]
fn one_text_in_each_dialect() {
    // log: natural or to base 10; ^: a power or logic; 1a, 2x, 4k7: suffixes; pwr; u and stp.
    let deck = |law: &str| {
        format!("a law\nv1 1 0 -2\nr1 1 0 1\nb1 2 0 v={{{law}}}\nr2 2 0 1\n.op\n.end\n")
    };
    for (law, ngspice, xyce, ltspice) in [
        ("log(100)", Some(100f64.ln()), Some(2.0), Some(100f64.ln())),
        ("v(1)^3", Some(8.0), Some(0.0), Some(1.0)),
        ("v(1)**3", Some(8.0), Some(-8.0), Some(-8.0)),
        ("2**3**2", Some(64.0), Some(512.0), Some(64.0)),
        ("pwr(v(1), 2)", Some(-4.0), Some(4.0), Some(4.0)),
        ("1x", Some(1.0), Some(1e6), Some(1.0)),
        ("4k7", None, None, Some(4700.0)),
        ("if(0.3, 5, 6)", Some(5.0), Some(5.0), Some(6.0)),
        ("u(0)", Some(0.5), None, Some(0.0)),
        ("stp(1)+stp(0)", None, Some(1.0), None),
        ("nint(2.5)", Some(2.0), Some(3.0), None),
        ("limit(v(1), -1, 1)", Some(-1.0), Some(-1.0), Some(-1.0)),
        ("(v(1) < 0) & (v(1) > -3)", Some(1.0), Some(1.0), Some(1.0)),
        ("v(1) < 0 ? 3 : 4", Some(3.0), Some(3.0), Some(3.0)),
    ] {
        let folder = folder(&[("deck.cir", &deck(law))]);
        let path = at(folder.path(), "deck.cir");
        for (dialect, expected) in [("ngspice", ngspice), ("xyce", xyce), ("ltspice", ltspice)] {
            let found = run_file(&path, &in_dialect(dialect)).ok().map(|row| row["v(2)"]);
            let same = match (found, expected) {
                (Some(found), Some(expected)) => {
                    (found - expected).abs() <= 1e-9 * expected.abs().max(1.0)
                }
                (_, None) => true,
                (None, _) => false,
            };
            assert!(same, "{law} in {dialect}: {found:?}, not {expected:?}");
        }
    }
}

#[test]
fn letters_of_other_encodings() {
    let deck = "* C:\\circuits\\micro.asc\nV1 1 0 5\nR1 1 2 4k7\nC1 2 0 1\u{b5} IC=1\n.tran 0 1m uic\n.backanno\n.end\n";
    let utf16: Vec<u8> =
        [0xFF, 0xFE].into_iter().chain(deck.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let latin: Vec<u8> = deck.chars().map(|letter| letter as u8).collect();
    // R·C = 4.7 ms, from 1 V towards 5 V.
    let expected = 5.0 - 4.0 * (-1e-3f64 / 4.7e-3).exp();
    for (name, bytes) in [("a.net", utf16), ("b.net", latin), ("c.net", deck.as_bytes().to_vec())] {
        let folder = folder(&[]);
        let path = at(folder.path(), name);
        std::fs::write(&path, bytes).unwrap();
        let overrides =
            Overrides { options: vec![("reltol".into(), "1e-7".into())], ..in_dialect("ltspice") };
        let found = run_file(&path, &overrides).unwrap_or_else(|said| panic!("{name}: {said:?}"));
        assert!((found["v(2)"] - expected).abs() < 1e-5, "{name}: {found:?}");
    }
}

#[test]
fn parameters_that_change_stand_in_laws() {
    let deck = "changing\n.param w=2 x={w*time} y={x+v(1)}\n.func f(a) {a+x}\nv1 1 0 {1+f(1)}\nr1 1 0 1\nx1 2 follow p={y}\nr2 2 0 1\n\
                .subckt follow out p=0\nb1 out 0 v={2*p}\n.ends\n.tran 0.1 1\n.end\n";
    let folder = folder(&[("deck.cir", deck)]);
    let found = run_file(&at(folder.path(), "deck.cir"), &Overrides::default()).unwrap();
    // At 1 s: x = 2, v(1) = 1 + 1 + 2, y = 6.
    assert!((found["v(1)"] - 4.0).abs() < 1e-9 && (found["v(2)"] - 12.0).abs() < 1e-9, "{found:?}");
    // An initial value is a number.
    let wrong = deck.replace("r2 2 0 1", "c2 2 0 1u ic={x}");
    std::fs::write(folder.path().join("wrong.cir"), wrong).unwrap();
    let said = run_file(&at(folder.path(), "wrong.cir"), &Overrides::default()).unwrap_err();
    assert!(said.iter().any(|said| said.starts_with("E0732")), "{said:?}");
}
