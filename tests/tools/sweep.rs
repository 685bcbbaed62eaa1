//! Sweeps: tables against closed forms and single runs, the same bytes however they are made.

use std::path::Path;
use std::process::{Command, Output};

/// A first-order lag: v(out) = 1 − exp(−t/(r·c)).
const LAG: &str = "a lag\n.param r=1k c=1u\nV1 in 0 1\nR1 in out {r}\nC1 out 0 {c} ic=0\n.print tran v(out)\n\
                   .measure tran half when v(out)=0.5\n.tran 10u 5m uic\n.options reltol=1e-6\n";

const PLAN: &str = "model = \"lag.cir\"\nruns = 7\nseed = 11\n[set]\nr = [\"1k\", \"2k\", \"4k\"]\nc = { normal = [\"1u\", \"50n\"] }\n\
                    [measures]\nend = \"final(v(out))\"\nmean = \"mean(v(out))\"\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lag.cir"), LAG).unwrap();
    std::fs::write(folder.path().join("plan.toml"), PLAN).unwrap();
    folder
}

fn bondspice(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondspice"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.contains("TASK")) {
        command.env_remove(name);
    }
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1").output().unwrap()
}

fn made(folder: &Path, arguments: &[&str]) -> String {
    let output = bondspice(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn rows(table: &str) -> Vec<Vec<f64>> {
    let lines = table.lines().skip(1);
    lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
}

#[test]
fn measures_are_those_of_the_closed_form() {
    let folder = folder();
    let table = made(folder.path(), &["sweep", "plan.toml"]);
    assert_eq!(table.lines().next(), Some("run,r,c,half,end,mean"));
    let rows = rows(&table);
    assert_eq!(rows.len(), 21);
    for row in &rows {
        let [_, r, c, half, end, mean] = row[..] else { panic!() };
        let tau = r * c;
        let rest = (-5e-3 / tau).exp();
        // reltol is 1e-6; errors of steps add up to some times that.
        assert!((half / (tau * std::f64::consts::LN_2) - 1.0).abs() < 2e-5, "{row:?}");
        assert!((end - (1.0 - rest)).abs() < 2e-5, "{row:?}");
        assert!((mean - (1.0 - tau / 5e-3 * (1.0 - rest))).abs() < 2e-5, "{row:?}");
    }
}

#[test]
fn last_values_are_what_they_are_with_rows_and_without() {
    let folder = folder();
    let all = rows(&made(folder.path(), &["sweep", "plan.toml"]));
    let plan = std::fs::read_to_string(folder.path().join("plan.toml")).unwrap();
    let plan: Vec<&str> = plan.lines().filter(|line| !line.starts_with("mean")).collect();
    std::fs::write(folder.path().join("last.toml"), plan.join("\n")).unwrap();
    // Of the deck's own measures none is left, either.
    let deck: Vec<&str> = LAG.lines().filter(|line| !line.starts_with(".measure")).collect();
    std::fs::write(folder.path().join("lag.cir"), deck.join("\n")).unwrap();
    let table = made(folder.path(), &["sweep", "last.toml"]);
    assert_eq!(table.lines().next(), Some("run,r,c,end"));
    let last = rows(&table);
    assert_eq!(last.len(), all.len());
    for (last, all) in last.iter().zip(&all) {
        assert_eq!(last[3], all[4], "{last:?} {all:?}");
    }
}

#[test]
fn threads_parts_and_resumption_change_no_byte() {
    let folder = folder();
    let path = folder.path();
    let whole = made(path, &["sweep", "plan.toml", "--threads", "1"]);
    assert_eq!(whole, made(path, &["sweep", "plan.toml", "--threads", "5"]));
    for part in ["1/3", "2/3", "3/3"] {
        made(path, &["sweep", "plan.toml", "--shard", part, "-o", "out.csv"]);
    }
    let merged = made(path, &["sweep", "--merge", "out.3of3.csv", "out.1of3.csv", "out.2of3.csv"]);
    assert_eq!(whole, merged);
    // Stopped in the middle of a line.
    let cut = whole.match_indices('\n').nth(9).unwrap().0 + 12;
    std::fs::write(path.join("half.csv.partial"), &whole[..cut]).unwrap();
    made(path, &["sweep", "plan.toml", "-o", "half.csv", "--resume"]);
    assert_eq!(whole, std::fs::read_to_string(path.join("half.csv")).unwrap());
    assert!(!path.join("half.csv.partial").exists());
    // Another seed is another sweep.
    std::fs::write(path.join("half.csv.partial"), &whole[..cut]).unwrap();
    let other =
        bondspice(path, &["sweep", "plan.toml", "-o", "half.csv", "--resume", "--seed", "12"]);
    assert_eq!(other.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&other.stderr).contains("E1204"));
}

#[test]
fn tasks_of_an_array_make_their_own_parts() {
    let folder = folder();
    let task = |number: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(["sweep", "plan.toml", "-o", "array.csv"])
            .envs([("SLURM_ARRAY_TASK_ID", number), ("SLURM_ARRAY_TASK_MIN", "0")])
            .envs([("SLURM_ARRAY_TASK_MAX", "1"), ("SLURM_ARRAY_TASK_STEP", "1")])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(output.status.success());
    };
    task("0");
    task("1");
    let merged = made(folder.path(), &["sweep", "--merge", "array.1of2.csv", "array.2of2.csv"]);
    assert_eq!(merged, made(folder.path(), &["sweep", "plan.toml"]));
}

#[test]
fn runs_equal_single_runs_bit_for_bit() {
    let folder = folder();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/dc_motor_load.bg");
    let model = model.to_str().unwrap();
    let list = made(folder.path(), &["simulate", model, "--until", "0.2s", "--step", "10ms"]);
    let column = list.lines().next().unwrap().split(',').nth(1).unwrap().to_string();
    let parameter = std::fs::read_to_string(model).unwrap();
    let parameter = parameter.lines().find_map(|line| line.strip_prefix("param ")).unwrap();
    let (name, value) = parameter.split_once('=').unwrap();
    let (name, value) = (name.trim(), value.split_whitespace().next().unwrap());
    let value: f64 = value.parse().unwrap();
    let list: Vec<String> = (0..4).map(|k| (value * (1.0 + 0.01 * k as f64)).to_string()).collect();
    let unit = parameter.split_once('=').unwrap().1.trim().split("  ").next().unwrap();
    let unit = unit.split_once(' ').map_or("", |(_, unit)| unit.trim());
    let list: Vec<String> = list.iter().map(|value| format!("{value} {unit}")).collect();
    let vary = format!("{name}={}", list.join(","));
    let measure = format!("end=final({column})");
    let until = ["--until", "0.2s", "--step", "10ms"];
    let mut arguments = vec!["sweep", model, "--vary", &vary, "--measure", &measure];
    arguments.extend(until);
    arguments.extend(["--traces", "traces"]);
    let table = rows(&made(folder.path(), &arguments));
    for (run, value) in list.iter().enumerate() {
        let set = format!("{name}={value}");
        let mut single = vec!["simulate", model, "--set", &set, "--observe", &column];
        single.extend(until);
        let single = made(folder.path(), &single);
        let trace = folder.path().join(format!("traces/run-{run}.csv"));
        assert_eq!(single, std::fs::read_to_string(trace).unwrap());
        let last: f64 = single.lines().last().unwrap().split(',').nth(1).unwrap().parse().unwrap();
        assert_eq!(table[run].last(), Some(&last));
    }
}

/// What is set makes another course of a source (compiled once for all), another value, or another circuit.
#[test]
fn runs_of_a_deck_equal_single_runs_bit_for_bit() {
    let folder = folder();
    let deck = "a servo\n.param high=2 gain=5 bend=0\nVref ref 0 PULSE(0 {high} 1m 1m 1m 40m 100m)\n\
        Be e 0 V=tanh(V(ref)-V(x))*gain\nRe e u 500\nCu u 0 1u\nBx 0 x I=1e-3*V(u)-1e-3*V(x)-bend*V(x)^3\nCx x 0 20u\n\
        .save v(x) v(e)\n.tran 0.2m 60m 0 0.2m uic\n.end\n";
    std::fs::write(folder.path().join("servo.cir"), deck).unwrap();
    for vary in ["high=1..3:6", "gain=4..6:6", "bend=0,1e-4,2e-4,0,0,3e-4", "high=0..2:6"] {
        let traces = vary.split_once('=').unwrap().0;
        let arguments = ["--vary", vary, "--measure", "end=final(v(x))", "--traces", traces];
        let table = [&["sweep", "servo.cir", "--threads", "1", "--step", "1ms"][..], &arguments];
        let table = table.concat();
        let table = rows(&made(folder.path(), &table));
        assert_eq!(table.len(), 6);
        for row in &table {
            let set = format!("{traces}={}", row[1]);
            let single = ["simulate", "servo.cir", "--set", &set, "--observe", "v(x)"];
            let single = made(folder.path(), &[&single[..], &["--step", "1ms"]].concat());
            let trace = folder.path().join(format!("{traces}/run-{}.csv", row[0]));
            assert_eq!(single, std::fs::read_to_string(trace).unwrap(), "{set}");
            let last = single.lines().last().unwrap().split(',').nth(1).unwrap();
            let last: f64 = last.parse().unwrap();
            // Rows are corrected where steps end; what is measured there is within rounding of that.
            assert!((row[2] - last).abs() <= 1e-12 * last.abs(), "{set}: {} {last}", row[2]);
        }
    }
}
