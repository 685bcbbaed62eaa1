//! Hostile input: every case ends in time, within a stated multiple of its size in memory, with a message that names a
//! code and without a panic or half a file.

#![cfg(unix)]

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Memory that the program needs without any input: its code, and the stack that is set aside for deep trees.
const BASE: usize = 512 << 20;

/// Bytes of memory for each byte of a trace: a value of 8 bytes may be written as two (`1,`), a column of 100 as seven,
/// and both grow by doubling.
const TRACE: usize = 64;

/// Whatever takes longer would not end; on an idle machine each case takes a few seconds.
const PATIENCE: Duration = Duration::from_secs(180);

/// Runs the program under a limit of memory, in bytes.
fn limited(folder: &Path, memory: usize, arguments: &[&str]) -> Output {
    let script = format!("ulimit -v {}; exec \"$0\" \"$@\"", memory / 1024);
    Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_bondspice")])
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// Runs the program on a file; it must end in time with the exit code and say the code named.
fn refused(name: &str, bytes: &[u8], arguments: &[&str], exit: i32, code: &str) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let begun = Instant::now();
    // What a deck expands to is limited by number, to about half a gigabyte.
    let expansion = if name == "power.cir" { 512 << 20 } else { 0 };
    let memory = BASE + expansion + 64 * bytes.len().max(1 << 20);
    let output = limited(folder.path(), memory, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    let short: String = said.chars().take(2000).collect();
    assert_eq!(output.status.code(), Some(exit), "{name} {arguments:?}: {short}");
    assert!(said.contains(code), "{name}: not {code}: {short}");
    assert!(!said.contains("panicked"), "{name}: {short}");
    assert!(begun.elapsed() < PATIENCE, "{name}: {:?}", begun.elapsed());
    assert!(output.stdout.is_empty(), "{name}: half a result");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "{name}: {left:?}");
}

/// A RAW file with counts of one's choice.
fn raw(variables: &str, points: &str, flags: &str, numbers: &[u8]) -> Vec<u8> {
    let mut bytes = format!(
        "Title: x\nDate: y\nPlotname: Transient Analysis\nFlags: {flags}\nNo. Variables: {variables}\n\
         No. Points: {points}\nVariables:\n\t0\ttime\ttime\n\t1\tv(a)\tvoltage\nBinary:\n"
    )
    .into_bytes();
    bytes.extend(numbers);
    bytes
}

#[test]
fn traces_that_lie_about_themselves() {
    let wide = |text: &[u8]| -> Vec<u8> { text.iter().flat_map(|byte| [*byte, 0]).collect() };
    let noise: Vec<u8> =
        (0..100_000_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let nan = [f64::NAN.to_le_bytes(), 1.0_f64.to_le_bytes()].concat();
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("points.raw", raw("2", "1000000000000000000", "real", &[0; 64]), "E0922"),
        ("points_as_a_float.raw", raw("2", "1e18", "real", &[0; 64]), "E0922"),
        ("points_beyond.raw", raw("2", "99999999999999999999999", "real", &[0; 64]), "E0922"),
        ("points_times_size.raw", raw("2", "1152921504606846976", "complex", &[0; 64]), "E0922"),
        ("negative.raw", raw("2", "-3", "real", &[0; 64]), "E0922"),
        ("variables.raw", raw("1000000000000", "1", "real", &[0; 64]), "E0922"),
        ("fewer_variables.raw", raw("16000000", "1", "real", &[0; 64]), "E0922"),
        ("no_variables.raw", raw("0", "1", "real", &[0; 64]), "E0922"),
        ("cut_off.raw", raw("2", "4", "real", &[0; 63]), "E0922"),
        ("nan.raw", raw("2", "1", "real", &nan), "E0926"),
        ("ltspice.raw", wide(&raw("2", "1000000000000000000", "real forward", &[])), "E0922"),
        ("fastaccess.raw", wide(&raw("2", "7", "real forward fastaccess", &[])), "E0922"),
        ("one_line.raw", [b"Title:".to_vec(), vec![b'x'; 3 << 20]].concat(), "E0922"),
        ("noise.bin", noise.clone(), "E0920"),
        (
            "noise.csv",
            [b"time,x\n".to_vec(), noise.iter().map(|b| b | 128).collect()].concat(),
            "E0921",
        ),
        ("quote.csv", [b"time,\"x\n".to_vec(), vec![b'1'; 1 << 20]].concat(), "E0924"),
        ("nan.csv", b"time,x\n0,1\nnan,2\n".to_vec(), "E0926"),
        ("commas.csv", vec![b','; 1 << 20], "E0924"),
        ("deep.json", vec![b'['; 1 << 20], "E0924"),
        ("deeper.json", [b"{\"names\":".to_vec(), vec![b'['; 1 << 20]].concat(), "E0923"),
        ("endless.vcd", b"$comment for ever".to_vec(), "E0934"),
        ("empty.prn", b"Index TIME V(1)\n".to_vec(), "E0924"),
    ];
    for (name, bytes, code) in cases {
        refused(name, &bytes, &["trace", name], 3, code);
        // As in `diff`, any trouble of a comparison is 2.
        refused(name, &bytes, &["compare", name, name], 2, code);
    }
}

#[test]
fn memory_is_a_multiple_of_a_trace() {
    let rows = 1 << 20;
    let ones = "1\n".repeat(rows);
    let commas = format!(
        "{}\n{}\n",
        (0..rows).map(|k| format!("{k:x}")).collect::<Vec<_>>().join(","),
        vec!["1"; rows].join(",")
    );
    let json = format!("{{\"names\":[\"x\"],\"columns\":[[{}]]}}", vec!["1"; rows].join(","));
    for (name, text) in
        [("ones.csv", format!("x\n{ones}")), ("wide.csv", commas), ("ones.json", json)]
    {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), &text).unwrap();
        let memory = BASE + TRACE * text.len();
        let output = limited(folder.path(), memory, &["trace", name, "-o", "out.csv"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(0), "{name}: {said}");
        assert!(!said.contains("memory"), "{name}: {said}");
    }
}

#[test]
fn bombs_in_decks_are_refused() {
    let deep = 100_000;
    let device = "V1 a 0 1\n";
    let expression =
        format!("x\nB1 a 0 V={}1{}\n.tran 1u 1m\n.end\n", "(".repeat(deep), ")".repeat(deep));
    let minus = format!("x\nB1 a 0 V={}1\n.tran 1u 1m\n.end\n", "-".repeat(deep));
    let sum = format!("x\nB1 a 0 V=1{}\n.tran 1u 1m\n.end\n", "+1".repeat(deep));
    let nested: String = (0..deep).map(|k| format!(".subckt s{k} a\n")).collect();
    let nested = format!("x\n{device}{nested}{}X1 a s0\n.op\n.end\n", ".ends\n".repeat(deep));
    let itself = format!("x\n{device}.subckt s a\nX1 a s\n.ends\nX1 a s\n.op\n.end\n");
    let each_other = format!(
        "x\n{device}.subckt s a\nX1 a t\n.ends\n.subckt t a\nX1 a s\n.ends\nX1 a s\n.op\n.end\n"
    );
    // Ten instances in each of ten levels are 1e10 resistors.
    let mut power = format!("x\n{device}.subckt s0 a\nR1 a 0 1\n.ends\n");
    for level in 1..=10 {
        let inner: String = (0..10).map(|k| format!("X{k} a s{}\n", level - 1)).collect();
        power += &format!(".subckt s{level} a\n{inner}.ends\n");
    }
    power += "X1 a s10\n.op\n.end\n";
    let deep = deep / 5;
    let chain: String = (0..deep).map(|k| format!(".param p{k}={{p{}+1}}\n", k + 1)).collect();
    let chain = format!("x\n{device}{chain}.param p{deep}=1\nR1 a 0 {{p0}}\n.op\n.end\n");
    for (name, deck, exit, code) in [
        ("brackets.cir", expression, 3, "E0110"),
        ("nested.cir", nested, 3, "E0710"),
        ("itself.cir", itself, 3, "E0739"),
        ("each_other.cir", each_other, 3, "E0739"),
        ("power.cir", power, 3, "E0737"),
        ("rows.cir", format!("x\n{device}.tran 1u 1\n.end\n"), 3, "E0807"),
        ("endless.cir", format!("x\n{device}R1 a 0 1e999\n.op\n.end\n"), 3, "E07"),
        ("no_number.cir", format!("x\n{device}R1 a 0 {{0/0}}\n.op\n.end\n"), 3, "E07"),
        ("endless_run.cir", format!("x\n{device}R1 a 0 1\n.tran 1 1e999\n.end\n"), 3, "E0745"),
    ] {
        let mut arguments = vec!["simulate", name];
        if name == "rows.cir" {
            arguments.extend(["--step", "1e-18"]);
        }
        refused(name, deck.as_bytes(), &arguments, exit, code);
    }
    // Long is not deep: a hundred thousand minuses and terms, and parameters of parameters twenty thousand deep are read.
    for (name, deck) in [("minus.cir", minus), ("sum.cir", sum), ("chain.cir", chain)] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), &deck).unwrap();
        let begun = Instant::now();
        let memory = BASE + 64 * deck.len();
        let output = limited(folder.path(), memory, &["simulate", name, "-o", "out.csv"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {said}");
        assert!(begun.elapsed() < PATIENCE, "{name}: {:?}", begun.elapsed());
    }
}

/// Files that name each other: in a circle, through links, and each the next one twice.
#[test]
fn bombs_of_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let deck = |name: &str| format!("x\nV1 a 0 1\nR1 a 0 1\n.include {name}\n.op\n.end\n");
    write("itself.cir", &deck("itself.cir"));
    write("one.inc", ".include two.inc\n");
    write("two.inc", ".include one.inc\n");
    write("circle.cir", &deck("one.inc"));
    std::os::unix::fs::symlink("b.inc", folder.path().join("a.inc")).unwrap();
    std::os::unix::fs::symlink("a.inc", folder.path().join("b.inc")).unwrap();
    write("links.cir", &deck("a.inc"));
    for level in 0..40 {
        write(
            &format!("d{level}.inc"),
            &format!(".include d{0}.inc\n.include d{0}.inc\n", level + 1),
        );
    }
    write("d40.inc", "* the end\n");
    write("doubling.cir", &deck("d0.inc"));
    write("device.cir", &deck("/dev/zero"));
    write("folder.cir", &deck("."));
    for (name, code) in [
        ("itself.cir", "E0711"),
        ("circle.cir", "E0711"),
        ("links.cir", "E0902"),
        ("doubling.cir", "E0713"),
        ("device.cir", "E0"),
        ("folder.cir", "E0903"),
    ] {
        let begun = Instant::now();
        let output = limited(folder.path(), 5 * BASE, &["simulate", name, "-o", "out.csv"]);
        let said: String = String::from_utf8_lossy(&output.stderr).chars().take(2000).collect();
        assert!(matches!(output.status.code(), Some(3 | 5)), "{name}: {said}");
        assert!(said.contains(code) && !said.contains("panicked"), "{name}: {said}");
        assert!(begun.elapsed() < PATIENCE, "{name}: {:?}", begun.elapsed());
    }
}

#[test]
fn many_measures_and_long_lines() {
    let measures: String =
        (0..5000).map(|k| format!(".meas tran m{k} FIND 'v(a)*{k}' AT=1m\n")).collect();
    let folder = tempfile::tempdir().unwrap();
    let deck = format!("x\nV1 a 0 1\nR1 a 0 1\n.tran 1m 2m\n{measures}.print tran v(a)\n.end\n");
    std::fs::write(folder.path().join("deck.cir"), &deck).unwrap();
    let begun = Instant::now();
    let arguments = ["simulate", "deck.cir", "-o", "out.csv", "--measures", "m.csv", "-q"];
    let output = limited(folder.path(), BASE + 64 * deck.len().max(1 << 20), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.path().join("m.csv")).unwrap();
    assert!(text.ends_with(",4999\n"), "{}", &text[text.len() - 50..]);
    assert!(begun.elapsed() < PATIENCE, "{:?}", begun.elapsed());
}

/// A ladder of so many lines is read in a time that grows with it, not with its square.
#[test]
fn a_deck_of_many_lines_is_read() {
    let lines = 100_000;
    let mut deck = String::from("ladder\nV1 n0 0 1\n");
    for k in 0..lines {
        deck += &format!("R{k} n{k} n{} 1\n", k + 1);
    }
    deck += &format!("Rend n{lines} 0 1\n.op\n.end\n");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("deck.cir"), &deck).unwrap();
    let begun = Instant::now();
    let output = limited(
        folder.path(),
        BASE + 400 * deck.len(),
        &["simulate", "deck.cir", "--emit", "circuit", "-o", "out"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(begun.elapsed() < PATIENCE, "{:?}", begun.elapsed());
}

#[test]
fn files_that_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::os::unix::fs::symlink("b", path("a")).unwrap();
    std::os::unix::fs::symlink("a", path("b")).unwrap();
    std::fs::create_dir(path("folder")).unwrap();
    for (name, code) in
        [("a", "E0902"), ("folder", "E0903"), ("/dev/null", "E0"), ("none", "E0901")]
    {
        for command in ["simulate", "trace"] {
            let output = limited(folder.path(), BASE + (64 << 20), &[command, name]);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(said.contains(code) && !said.contains("panicked"), "{command} {name}: {said}");
            assert!(matches!(output.status.code(), Some(3 | 5)), "{command} {name}: {said}");
        }
    }
    // Endless input is refused when it is too much, not when memory is at its end.
    let deck = "x\nV1 a 0 1\nR1 a 0 1\n.tran 1m 2m\n.end\n";
    std::fs::write(path("deck.cir"), deck).unwrap();
    let output = limited(folder.path(), BASE, &["simulate", "deck.cir", "-o", "a"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("E0905"), "{said}");
}

/// A disk that is full: the error says so, nothing stands half written.
#[test]
fn full_disks_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let deck = "x\nV1 a 0 SIN(0 1 1k)\nR1 a 0 1\n.tran 1u 5m\n.print tran v(a)\n.end\n";
    std::fs::write(folder.path().join("deck.cir"), deck).unwrap();
    if !Path::new("/dev/full").exists() {
        return;
    }
    for format in ["csv", "raw", "rawascii", "ltspice", "vcd", "json", "prn"] {
        let arguments = ["simulate", "deck.cir", "-o", "/dev/full", "--format", format];
        let output = limited(folder.path(), BASE + (64 << 20), &arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(5), "{format}: {said}");
        assert!(said.contains("E0905") && !said.contains("panicked"), "{format}: {said}");
    }
    // Also where the measures go.
    let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(["simulate", "deck.cir"])
        .current_dir(folder.path())
        .stdout(std::fs::File::options().write(true).open("/dev/full").unwrap())
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A small file system that fills up: the old result stays, no temporary file is left. Needs root.
#[test]
fn a_small_disk_fills_up() {
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount =
        Command::new("mount").args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"]).arg(&disk).output();
    if !mount.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: no file system can be mounted");
        return;
    }
    let deck = "x\nV1 a 0 SIN(0 1 1k)\nR1 a 0 1\n.tran 1u 50m\n.print tran v(a)\n.end\n";
    std::fs::write(folder.path().join("deck.cir"), deck).unwrap();
    std::fs::write(disk.join("out.csv"), "old\n").unwrap();
    let mut outcomes = vec![];
    for format in ["csv", "raw", "json"] {
        let arguments =
            ["simulate", "deck.cir", "-o", "disk/out.csv", "--format", format, "--step", "5us"];
        outcomes.push((format, limited(folder.path(), BASE + (64 << 20), &arguments)));
    }
    let old = std::fs::read_to_string(disk.join("out.csv"));
    let left: Vec<_> =
        std::fs::read_dir(&disk).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    Command::new("umount").arg(&disk).status().unwrap();
    for (format, output) in outcomes {
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(5), "{format}: {said}");
        assert!(said.contains("E0905"), "{format}: {said}");
    }
    assert_eq!(old.unwrap(), "old\n");
    assert_eq!(left, ["out.csv"]);
}

/// A reader that closes the pipe ends the run, silently, in every format.
#[test]
fn a_closed_pipe_is_silent() {
    let folder = tempfile::tempdir().unwrap();
    let deck = "x\nV1 a 0 SIN(0 1 1k)\nR1 a 0 1\n.tran 1u 100m\n.print tran v(a)\n.end\n";
    std::fs::write(folder.path().join("deck.cir"), deck).unwrap();
    for format in ["csv", "rawascii", "vcd", "prn", "json"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(["simulate", "deck.cir", "--format", format, "-q"])
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut begin = [0; 10];
        child.stdout.take().unwrap().read_exact(&mut begin).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{format}");
        assert!(output.stderr.is_empty(), "{format}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Ctrl-C: what was computed stays beside the old result, in every format.
#[test]
fn an_interrupt_keeps_the_rows_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let deck =
        "x\nV1 a 0 SIN(0 1 1k)\nR1 a b 1k\nC1 b 0 1u\n.tran 1u 1e6\n.print tran v(b)\n.end\n";
    std::fs::write(folder.path().join("deck.cir"), deck).unwrap();
    for format in ["csv", "raw", "vcd", "prn"] {
        let out = folder.path().join("out");
        std::fs::write(&out, "old\n").unwrap();
        let child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args([
                "simulate",
                "deck.cir",
                "-o",
                "out",
                "--format",
                format,
                "--option",
                "reltol=1e-2",
            ])
            .current_dir(folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs(2));
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{format}: {said}");
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "old\n", "{format}");
        let partial = std::fs::read(folder.path().join("out.partial")).unwrap();
        let trace = bondspice::trace::formats::read(format, &partial).unwrap();
        assert!(trace.rows() > 10 && trace.column("v(b)").is_some(), "{format}: {}", trace.rows());
    }
}

/// What comes through a pipe is as good as a file, and as bad.
#[test]
fn standard_input_is_no_less_guarded() {
    for (arguments, bytes, code) in [
        (&["trace", "-"][..], raw("2", "1000000000000000000", "real", &[0; 64]), "E0922"),
        (&["simulate", "-"], vec![0; 1 << 20], "E0192"),
        (&["simulate", "-"], vec![0xff; 1 << 20], "E0"),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // It may have ended before it has taken everything.
        let _ = child.stdin.take().unwrap().write_all(&bytes);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(code) && !said.contains("panicked"), "{arguments:?}: {said}");
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {said}");
    }
}
