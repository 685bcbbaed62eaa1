//! The command line as users see it: exit codes, what goes where, and what is said about bad input.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Runs the program in a folder.
fn bondspice(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ends by itself")
}

/// What is said about a bad file, and the exit code.
fn said(file: &str) -> String {
    let command = if file.ends_with(".bg") { "check" } else { "simulate" };
    let output = bondspice(&folder("tests/bad"), &[command, file]);
    assert!(output.stdout.is_empty(), "{file}: {}", stdout(&output));
    format!("{}exit code {}\n", stderr(&output), code(&output))
}

/// One test for each bad file, so that all are seen at once.
macro_rules! bad {
    ($($name:ident: $file:literal = $code:literal)*) => { $(
        #[test]
        fn $name() {
            let text = said($file);
            assert!(text.ends_with(concat!("exit code ", $code, "\n")), "{text}");
            assert!(!text.contains("panicked"), "{text}");
            insta::assert_snapshot!(text);
        }
    )* };
}

bad! {
    n1_two_effort_sources: "n1_two_effort_sources.bg" = 3
    n2_two_flow_sources: "n2_two_flow_sources.bg" = 3
    n3_port_used_twice: "n3_port_used_twice.bg" = 3
    n4_unknown_port: "n4_unknown_port.bg" = 3
    n5_two_port_one_bond: "n5_two_port_one_bond.bg" = 3
    n6_transformer_two_efforts: "n6_transformer_two_efforts.bg" = 3
    unknown_unit: "unknown_unit.bg" = 3
    missing_parameter: "missing_parameter.bg" = 3
    unclosed_bracket: "unclosed_bracket.bg" = 3
    empty: "empty.bg" = 3
    binary: "binary.bg" = 3
    not_utf8: "not_utf8.bg" = 3
    missing_file: "n1_two_effort_source.bg" = 5
    no_ground: "no_ground.cir" = 3
    floating_node: "floating_node.cir" = 3
    voltage_loop: "voltage_loop.cir" = 3
}

/// A folder with two traces that differ by 1 % of range in `y`.
fn traces() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.csv"), "time,x,y\n0,0,0\n1,1,1.01\n2,2,1\n").unwrap();
    std::fs::write(folder.path().join("b.csv"), "time,x,y\n0,0,0\n1,1,1\n2,2,1\n").unwrap();
    folder
}

#[test]
fn compare_answers_as_diff_does() {
    let folder = traces();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    let same = run(&["compare", "a.csv", "b.csv", "--tolerance", "0.02"]);
    assert_eq!((code(&same), stderr(&same)), (0, String::new()));
    let different = run(&["compare", "a.csv", "b.csv"]);
    assert_eq!((code(&different), stderr(&different)), (1, String::new()));
    insta::assert_snapshot!(stdout(&different));
    let json = run(&["compare", "a.csv", "b.csv", "--format", "json", "--signals", "y"]);
    let value: serde_json::Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(value["schema"], 1);
    assert_eq!(value["verdict"], "different");
    let signal = value["signals"][0].as_object().unwrap();
    for key in ["name", "max", "rms", "at", "range", "tolerance", "skipped"] {
        assert!(signal.contains_key(key), "{key} in {signal:?}");
    }
    assert!((signal["max"].as_f64().unwrap() - 0.01).abs() < 1e-12);
    for trouble in [
        &["compare", "a.csv", "nothing.csv"][..],
        &["compare", "a.csv", "b.csv", "--signals", "z"],
        &["compare", "a.csv"],
        &["compare", "a.csv", "b.csv", "--tolerance", "-1"],
        &["compare", "-", "-"],
    ] {
        let output = run(trouble);
        assert_eq!(code(&output), 2, "{trouble:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{trouble:?}");
    }
}

#[test]
fn messages_come_in_three_forms() {
    let folder = traces();
    let run = |form: &str| {
        let output = bondspice(
            folder.path(),
            &["compare", "nothing.csv", "b.csv", "--message-format", form],
        );
        assert_eq!(code(&output), 2);
        stderr(&output)
    };
    assert_eq!(run("human"), "error[E0901]: no file `nothing.csv`\n\n1 error\n");
    assert_eq!(run("short"), "error[E0901]: no file `nothing.csv`\n");
    let object: serde_json::Value = serde_json::from_str(&run("json")).unwrap();
    assert_eq!(object["code"], "E0901");
    assert_eq!(object["severity"], "error");
    for key in ["message", "labels", "notes", "help", "fix"] {
        assert!(object.get(key).is_some(), "{key}");
    }
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = traces();
    let before = std::fs::read(folder.path().join("b.csv")).unwrap();
    for name in ["b.csv", "./b.csv"] {
        let output = bondspice(folder.path(), &["compare", "a.csv", "b.csv", "-o", name]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("E0906"), "{}", stderr(&output));
    }
    assert_eq!(std::fs::read(folder.path().join("b.csv")).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
}

#[test]
fn help_and_version_are_answers() {
    let here = folder(".");
    let version = bondspice(&here, &["--version"]);
    assert_eq!(stdout(&version), format!("bondspice {}\n", env!("CARGO_PKG_VERSION")));
    for row in bondspice::cli::COMMANDS {
        let output = bondspice(&here, &[row.name, "--help"]);
        assert_eq!(code(&output), 0, "{}", row.name);
        assert!(stdout(&output).contains("Example:"), "{}", row.name);
        assert!(output.stderr.is_empty());
    }
    let output = bondspice(&here, &["compar"]);
    assert_eq!(code(&output), 2);
    assert!(output.stdout.is_empty() && stderr(&output).contains("tip:"));
}

/// A folder with a model of each kind.
fn models() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let rlc = "# a series RLC circuit\nSe:U(10 V) -> 1:mesh\nmesh -> I:L(1 mH), R:R(2 Ohm), C:C(100 uF)\n\
        simulate until 20 ms step 10 us\nobserve f(mesh) in mA as \"current\", e(C)\n";
    std::fs::write(folder.path().join("rlc.bg"), rlc).unwrap();
    let rc = "a discharge\n.param R=1k\nC1 out 0 1u IC=1\nR1 out 0 {R}\n.tran 10u 5m uic\n.print tran v(out)\n.end\n";
    std::fs::write(folder.path().join("rc.cir"), rc).unwrap();
    folder
}

/// The rows of a CSV, without its header.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|field| field.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_bond_graph_runs_into_a_table() {
    let folder = models();
    let output = bondspice(folder.path(), &["simulate", "rlc.bg", "-q"]);
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    let text = stdout(&output);
    assert_eq!(text.lines().next(), Some("time,current,e(C)"));
    let rows = rows(&text);
    assert_eq!(rows.len(), 2001);
    // u'' + (R/L)·u' + u/(L·C) = U/(L·C), from rest: decay 1000/s, ω = 3000/s.
    let (a, w) = (1000.0_f64, 3000.0_f64);
    for row in rows {
        let t = row[0];
        let (decay, (sin, cos)) = ((-a * t).exp(), (w * t).sin_cos());
        let u = 10.0 * (1.0 - decay * (cos + a / w * sin));
        let i = 10.0 / (w * 1e-3) * decay * sin;
        assert!((row[2] - u).abs() < 1e-3 && (row[1] - 1e3 * i).abs() < 1e-4 * 2.5e3, "{row:?}");
    }
}

#[test]
fn units_formats_and_files() {
    let folder = models();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    let output = run(&["simulate", "rlc.bg", "-q", "--units", "-o", "run.csv"]);
    assert_eq!((code(&output), stdout(&output)), (0, String::new()));
    let csv = std::fs::read_to_string(folder.path().join("run.csv")).unwrap();
    assert_eq!(csv.lines().next(), Some("time [s],current [mA],e(C) [V]"));
    for name in ["run.raw", "run.json"] {
        assert_eq!(code(&run(&["simulate", "rlc.bg", "-q", "-o", name])), 0);
        let same = run(&["compare", name, "run.csv", "--tolerance", "0"]);
        assert_eq!(code(&same), 0, "{}", stdout(&same));
    }
    assert_eq!(code(&run(&["simulate", "rlc.bg", "-o", "run.xyz"])), 2);
    assert_eq!(code(&run(&["simulate", "rlc.bg", "-o", "rlc.bg", "--format", "csv"])), 5);
    assert_eq!(code(&run(&["simulate", "rlc.bg", "-o", "no/such/folder.csv"])), 5);
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 5, "{left:?}");
}

#[test]
fn the_command_line_beats_the_file() {
    let folder = models();
    let run = |arguments: &[&str]| {
        let output = bondspice(folder.path(), arguments);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stdout(&output)
    };
    let text = run(&[
        "simulate",
        "rlc.bg",
        "-q",
        "--until",
        "1ms",
        "--step",
        "0.5 ms",
        "--observe",
        "e(R) as \"u\"",
    ]);
    assert_eq!(text.lines().next(), Some("time,u"));
    assert_eq!(rows(&text).iter().map(|row| row[0]).collect::<Vec<_>>(), [0.0, 0.0005, 0.001]);
    let text = run(&["simulate", "rc.cir", "-q", "--set", "R=2k", "--step", "1ms"]);
    assert_eq!(text.lines().next(), Some("time,v(out)"));
    for row in rows(&text) {
        assert!((row[1] - (-row[0] / 2e-3).exp()).abs() < 2e-3, "{row:?}");
    }
    std::fs::write(folder.path().join("times"), "0\n\n0.0001\n0.00025\n").unwrap();
    let text = run(&["simulate", "rc.cir", "-q", "--times", "times", "--option", "reltol=1e-8"]);
    let rows = rows(&text);
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), [0.0, 1e-4, 2.5e-4]);
    assert!((rows[2][1] - (-0.25_f64).exp()).abs() < 1e-6, "{rows:?}");
}

/// A folder with `m.bg`: the smallest model that runs, with another first line.
fn model_with(text: &str) -> tempfile::TempDir {
    let folder = models();
    let text = format!("{text}\nsimulate until 1 s step 100 ms\n");
    std::fs::write(folder.path().join("m.bg"), text).unwrap();
    folder
}

#[test]
fn a_graph_without_default_columns_shows_its_elements() {
    let folder = model_with("Se:u(1 V) -> R:r(1 Ohm)");
    let output = bondspice(folder.path(), &["simulate", "m.bg", "-q"]);
    assert_eq!(stdout(&output).lines().next(), Some("time,e(u),f(u),e(r),f(r)"));
    let verified = bondspice(folder.path(), &["verify", "m.bg"]);
    assert_eq!(code(&verified), 0, "{}", stderr(&verified));
    assert!(stdout(&verified).contains("e(r)"), "{}", stdout(&verified));
}

#[test]
fn a_time_beyond_the_run_is_refused() {
    let folder = model_with("Se:u(1 V) -> R:r(1 Ohm)");
    let run = |times: &str| {
        std::fs::write(folder.path().join("times"), times).unwrap();
        bondspice(folder.path(), &["simulate", "m.bg", "-q", "--times", "times"])
    };
    let output = run("0\n0.5\n1.5\n");
    assert_eq!((code(&output), stdout(&output)), (3, String::new()));
    assert!(stderr(&output).contains("E0933") && stderr(&output).contains("1.5 s"));
    assert_eq!(rows(&stdout(&run("0.5\n1\n1.0000000000000002\n"))).len(), 3);
}

#[test]
fn a_scale_is_a_factor_of_a_domain() {
    let folder = models();
    for (scale, words) in [
        ("hydraulics=1e6", "did you mean `hydraulic`?"),
        ("electrical=0", "no number above 0"),
        ("electrical=-3", "no number above 0"),
        ("electrical=inf", "no number above 0"),
        ("1e6", "takes auto or DOMAIN=FACTOR"),
    ] {
        let output = bondspice(folder.path(), &["convert", "rlc.bg", "--scale", scale]);
        assert_eq!((code(&output), stdout(&output)), (2, String::new()), "{scale}");
        assert!(stderr(&output).contains("E0940"), "{}", stderr(&output));
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
    let arguments = ["convert", "rlc.bg", "--scale", "electrical=20", "-o", "scaled.cir"];
    assert_eq!(code(&bondspice(folder.path(), &arguments)), 0);
    let [scaled, plain] = ["scaled.cir", "rlc.bg"]
        .map(|file| rows(&stdout(&bondspice(folder.path(), &["simulate", file]))));
    assert_eq!(scaled.len(), plain.len());
    for (a, b) in scaled.iter().flatten().zip(plain.iter().flatten()) {
        assert!((a - b).abs() <= 1e-4 * (1.0 + b.abs()), "{a}, not {b}");
    }
}

#[test]
fn two_outputs_need_two_places() {
    let folder = models();
    for arguments in [
        &["-o", "m.json", "--map", "m.json"][..],
        &["-o", "m.json", "--map", "./m.json"],
        &["-o", "-", "--map", "-"],
        &["--map", "-"],
    ] {
        let arguments = [&["convert", "rlc.bg"], arguments].concat();
        let output = bondspice(folder.path(), &arguments);
        assert_eq!((code(&output), stdout(&output)), (2, String::new()), "{arguments:?}");
        assert!(stderr(&output).contains("E0940"), "{}", stderr(&output));
    }
    assert!(!folder.path().join("m.json").exists());
}

#[test]
fn options_are_checked_at_their_place() {
    let folder = model_with("Se:u(1 V) -> R:r(1 Ohm)\noptions relto = 1e-4");
    let run = |arguments: &[&str]| {
        let output =
            bondspice(folder.path(), &[arguments, &["--message-format", "short"]].concat());
        (code(&output), stderr(&output))
    };
    let (denied, said) = run(&["check", "m.bg", "--deny", "warnings"]);
    assert_eq!(denied, 1, "{said}");
    assert!(said.starts_with("m.bg:2:9: warning[W0801]"), "{said}");
    let (fine, said) = run(&["simulate", "m.bg", "-o", "m.csv"]);
    assert_eq!((fine, said.matches("W0801").count()), (0, 1), "{said}");
    assert!(said.contains("m.bg:2:9: warning[W0801]"), "{said}");
    let human = bondspice(folder.path(), &["check", "m.bg"]);
    assert!(stderr(&human).contains("did you mean `reltol`?"), "{}", stderr(&human));
    let (wrong, said) = run(&["check", "rlc.bg", "--option", "reltol=much"]);
    assert_eq!((wrong, said.matches("E0807").count()), (3, 1), "{said}");
}

#[test]
fn quiet_wins_over_verbose() {
    let folder = models();
    let output = bondspice(folder.path(), &["simulate", "rlc.bg", "-q", "-v", "-o", "x.csv"]);
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
}

#[test]
fn a_second_column_time_is_an_error_at_its_place() {
    let folder = model_with("Se:u(1 V) -> R:r(1 Ohm)\nobserve e(r) as \"time\"");
    let output = bondspice(folder.path(), &["simulate", "m.bg", "--message-format", "short"]);
    assert_eq!(code(&output), 3);
    assert!(stderr(&output).starts_with("m.bg:2:9: error[E0221]"), "{}", stderr(&output));
}

#[test]
fn a_variable_stands_in_the_map_once() {
    let folder = models();
    let observed = ["--observe", "e(C) in mV, f(mesh), q(C), f(R)*1 as \"x\""];
    let arguments = [&["convert", "rlc.bg", "-q", "-o", "c.cir", "--map", "m.json"], &observed[..]];
    assert_eq!(code(&bondspice(folder.path(), &arguments.concat())), 0);
    let text = std::fs::read_to_string(folder.path().join("m.json")).unwrap();
    let map: serde_json::Value = serde_json::from_str(&text).unwrap();
    let variables = map["variables"].as_array().unwrap();
    let of = |name: &str| variables.iter().filter(|v| v["bg"] == name).collect::<Vec<_>>();
    for name in ["e(C)", "f(mesh)", "q(C)"] {
        let found = of(name);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(
            (&found[0]["observed"], &found[0]["domain"]),
            (&true.into(), &"electrical".into())
        );
    }
    assert_eq!(of("x")[0]["domain"], "any");
    assert_eq!(of("e(R)")[0]["observed"], false);
}

#[test]
fn negative_and_endless_times_are_told_as_such() {
    let folder = models();
    for (arguments, exit, told) in [
        (&["simulate", "rlc.bg", "--until", "-1ms"][..], 3, "must be positive"),
        (&["simulate", "rlc.bg", "--step", "-1ms"], 3, "must be positive"),
        (&["compare", "a.csv", "b.csv", "--tolerance", "-1"], 2, "cannot be negative"),
        (&["simulate", "rlc.bg", "--until", "1e300"], 3, "more than 1e9 rows"),
        (&["simulate", "rlc.bg", "--step", "1e-300s"], 3, "more than 1e9 rows"),
        (&["simulate", "rc.cir", "--step", "1e-300"], 3, "more than 1e9 rows"),
    ] {
        let output = bondspice(folder.path(), arguments);
        assert_eq!((code(&output), stdout(&output)), (exit, String::new()), "{arguments:?}");
        assert!(stderr(&output).contains(told), "{}", stderr(&output));
    }
}

#[test]
fn a_netlist_has_no_graph() {
    let folder = models();
    for command in ["causality", "convert", "verify"] {
        let output = bondspice(folder.path(), &[command, "rc.cir"]);
        assert_eq!((code(&output), stdout(&output)), (2, String::new()), "{command}");
        assert!(stderr(&output).contains("E0944"), "{}", stderr(&output));
    }
}

#[test]
fn hints_lead_somewhere() {
    let folder = models();
    let said = |line: &str, arguments: &[&str]| {
        std::fs::write(folder.path().join("m.bg"), format!("{line}\n")).unwrap();
        let output = bondspice(folder.path(), &[&["check", "m.bg"], arguments].concat());
        assert_eq!(code(&output), 3, "{}", stdout(&output));
        stderr(&output)
    };
    for (value, meant) in [("1k", "1e3"), ("2.5M", "2.5e6"), ("1 u", "1e-6"), ("10meg", "10e6")] {
        let text = said(&format!("param a = {value}"), &[]);
        let hint = format!("prefixes stand on units, never on bare numbers: write `{meant}`");
        assert!(text.contains(&hint) && !text.contains("write `1K`"), "{text}");
    }
    let text = said("Se:u(1 V) -> I:L(1 mH)", &["--set", "L=2mH"]);
    let hint = "`L` is an inertia with the value 1 mH; write `param L = 1 mH`";
    assert!(text.contains("E0223") && text.contains(hint), "{text}");
    let text = said("Se:u(1 V) -> I:L(1 mH)\nobserve q(L)", &[]);
    assert!(text.contains("an inertia stores no `q`"), "{text}");
}

#[test]
fn standard_input_is_read_and_told_apart() {
    let folder = models();
    for (name, header) in [("rlc.bg", "time,current,e(C)"), ("rc.cir", "time,v(out)")] {
        let file = std::fs::File::open(folder.path().join(name)).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(["simulate", "-", "-q"])
            .stdin(file)
            .output()
            .unwrap();
        assert_eq!(stdout(&output).lines().next(), Some(header), "{}", stderr(&output));
    }
}

#[test]
fn our_own_netlist_gives_the_same_run() {
    let folder = models();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    assert_eq!(code(&run(&["convert", "rlc.bg", "-q", "-o", "rlc.cir", "--map", "map.json"])), 0);
    assert_eq!(code(&run(&["simulate", "rlc.bg", "-q", "-o", "bg.csv"])), 0);
    assert_eq!(code(&run(&["simulate", "rlc.cir", "-q", "-o", "cir.csv"])), 0);
    let same = run(&["compare", "cir.csv", "bg.csv", "--tolerance", "1e-12"]);
    assert_eq!(code(&same), 0, "{}", stdout(&same));
    let map: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("map.json")).unwrap())
            .unwrap();
    assert_eq!(map["schema"], 1);
    for key in ["dialect", "variables", "cards", "figures"] {
        assert!(map.get(key).is_some(), "{key}");
    }
}

#[test]
fn another_simulators_result_gets_our_names() {
    let folder = models();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    assert_eq!(code(&run(&["convert", "rlc.bg", "-q", "-o", "rlc.cir", "--map", "map.json"])), 0);
    let ngspice = Command::new("ngspice")
        .args(["-b", "-r", "rlc.raw", "rlc.cir"])
        .current_dir(folder.path())
        .output();
    if ngspice.is_err() {
        crate::peers::missing("ngspice");
        return;
    }
    let renamed = run(&["trace", "rlc.raw", "--map", "map.json", "-o", "peer.csv"]);
    assert_eq!(code(&renamed), 0, "{}", stderr(&renamed));
    let peer = std::fs::read_to_string(folder.path().join("peer.csv")).unwrap();
    assert_eq!(peer.lines().next(), Some("time,current,e(C)"));
    assert_eq!(code(&run(&["simulate", "rlc.bg", "-q", "-o", "bg.csv"])), 0);
    let same = run(&["compare", "peer.csv", "bg.csv", "--tolerance", "1e-3"]);
    assert_eq!(code(&same), 0, "{}", stdout(&same));
}

#[test]
fn verdicts_end_with_0_and_1() {
    let folder = models();
    let run = |arguments: &[&str]| bondspice(folder.path(), arguments);
    let verified = run(&["verify", "rlc.bg", "--format", "json"]);
    assert_eq!(code(&verified), 0, "{}", stderr(&verified));
    let report: serde_json::Value = serde_json::from_str(&stdout(&verified)).unwrap();
    assert_eq!((&report["schema"], &report["verdict"]), (&1.into(), &"pass".into()));
    assert_eq!(code(&run(&["check", "rlc.bg", "--deny", "warnings"])), 0);
    // Two compliances on one junction: one of them depends on the other.
    let text = "Se:U(1 V) -> 1:m -> R:R(1 Ohm)\nm -> 0:n -> C:a(1 F)\nn -> C:b(2 F)\nsimulate until 1 s step 1 ms\n";
    std::fs::write(folder.path().join("dependent.bg"), text).unwrap();
    assert_eq!(code(&run(&["check", "dependent.bg"])), 0);
    let denied = run(&["check", "dependent.bg", "--deny", "warnings"]);
    assert_eq!(code(&denied), 1, "{}", stderr(&denied));
    let causality = run(&["causality", "dependent.bg", "--format", "json"]);
    let report: serde_json::Value = serde_json::from_str(&stdout(&causality)).unwrap();
    assert_eq!(report["order"], 1);
    for key in ["bonds", "states", "derivative", "loops", "conflicts"] {
        assert!(report[key].is_array(), "{key}");
    }
}

#[test]
fn statistics_are_json_on_stderr() {
    let folder = models();
    let output =
        bondspice(folder.path(), &["simulate", "rlc.bg", "-q", "--stats", "json", "-o", "x.csv"]);
    let statistics: serde_json::Value = serde_json::from_str(&stderr(&output)).unwrap();
    for key in
        ["accepted", "rejected", "evaluations", "factorisations", "solves", "events", "method"]
    {
        assert!(statistics.get(key).is_some(), "{key} in {statistics}");
    }
}

#[test]
fn simulators_without_a_dialect_are_refused() {
    let folder = models();
    for simulator in ["spectre", "hspice"] {
        let output = bondspice(folder.path(), &["convert", "rlc.bg", "--to", simulator]);
        assert_eq!(code(&output), 2);
        assert!(output.stdout.is_empty() && stderr(&output).contains(simulator));
    }
}

#[test]
fn every_stage_prints() {
    let folder = models();
    for stage in ["graph", "causality", "netlist", "circuit", "system"] {
        let output = bondspice(folder.path(), &["simulate", "rlc.bg", "-q", "--emit", stage]);
        assert_eq!(code(&output), 0, "{stage}: {}", stderr(&output));
        insta::assert_snapshot!(stage, stdout(&output));
    }
}

#[test]
fn ten_thousand_brackets_are_refused() {
    let folder = models();
    let (open, close) = ("(".repeat(10_000), ")".repeat(10_000));
    let graph = format!("Se:U(1 V) -> R:R({open}1 Ohm{close})\nsimulate until 1 s step 1 ms\n");
    std::fs::write(folder.path().join("deep.bg"), graph).unwrap();
    let deck = format!("deep\nB1 a 0 V={open}1{close}\nR1 a 0 1\n.op\n.end\n");
    std::fs::write(folder.path().join("deep.cir"), deck).unwrap();
    for name in ["deep.bg", "deep.cir"] {
        let output = bondspice(folder.path(), &["simulate", name]);
        assert_eq!(code(&output), 3, "{}", stderr(&output));
        insta::assert_snapshot!(name.replace('.', "_"), stderr(&output));
    }
}

#[cfg(unix)]
#[test]
fn a_broken_pipe_is_silent() {
    let folder = models();
    let mut child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(["simulate", "rlc.bg", "-q", "--step", "1us", "--until", "100ms"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_what_was_computed() {
    use std::io::Read;
    let folder = models();
    std::fs::write(folder.path().join("run.csv"), "precious\n").unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(["simulate", "rlc.bg", "--step", "1us", "--until", "500s", "-o", "run.csv"])
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let hidden = |folder: &Path| {
        let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap());
        let begun = |e: &std::fs::DirEntry| e.metadata().is_ok_and(|m| m.len() > 100_000);
        entries.into_iter().any(|e| e.file_name().to_string_lossy().ends_with(".tmp") && begun(&e))
    };
    for _ in 0..1000 {
        if hidden(folder.path()) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(status.code(), Some(130), "{said}");
    assert_eq!(std::fs::read_to_string(folder.path().join("run.csv")).unwrap(), "precious\n");
    let partial = std::fs::read_to_string(folder.path().join("run.csv.partial")).unwrap();
    assert!(partial.starts_with("time,current,e(C)\n0,0,0\n"), "{}", &partial[..200]);
    assert!(partial.ends_with('\n'));
    assert!(!hidden(folder.path()));
}
