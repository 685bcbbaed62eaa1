//! Files that we write, read by others: spicelib (Python). Those of ngspice are tried in `src/trace/raw`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SCRIPT: &str = r#"
import json, sys
from spicelib import RawRead
result = {}
for name in sys.argv[1:]:
    raw = RawRead(name, verbose=False)
    traces = {}
    for trace in raw.get_trace_names():
        data = raw.get_trace(trace).data
        traces[trace.lower()] = [[float(value.real), float(value.imag)] for value in data]
    result[name] = traces
print(json.dumps(result))
"#;

/// A Python that has spicelib: the one of the environment that `.ci/run` makes, or the system's.
fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/venv/bin/python");
    [own, PathBuf::from("python3")].into_iter().find(|python| {
        let tried = Command::new(python)
            .args(["-c", "import spicelib"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        tried.is_ok_and(|status| status.success())
    })
}

#[test]
fn spicelib_reads_what_we_write() {
    let Some(python) = python() else {
        crate::peers::missing("Python with spicelib");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let tran = "time,v(a),i(l1)\n0,0.1,1e-3\n0.5,-2.5,1e-9\n1,1e7,3\n";
    let ac = "frequency,v(a).re,v(a).im\n10,1,-2\n100,0.5,0.25\n";
    let stepped = "step,time,v(a)\n0,0,1\n0,1,2\n1,0,3\n1,0.5,4\n1,1,5\n";
    let mut files = vec![];
    for (name, text) in [("tran", tran), ("ac", ac), ("stepped", stepped)] {
        std::fs::write(folder.path().join(name), text).unwrap();
        for format in ["raw", "rawascii", "ltspice"] {
            // Several plots in a file are ngspice's way, which spicelib reads one of.
            if name == "stepped" && format != "ltspice" {
                continue;
            }
            let file = format!("{name}_{format}.raw");
            let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
                .args(["trace", name, "--format", format, "-o", &file])
                .current_dir(folder.path())
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            files.push(file);
        }
    }
    // spicelib takes the values of steps from LTspice's log.
    let log = "Circuit: * x\n\n.step n=0\n.step n=1\n";
    std::fs::write(folder.path().join("stepped_ltspice.log"), log).unwrap();
    let output = Command::new(python)
        .args(["-c", SCRIPT])
        .args(&files)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("{said}"));
    let json: serde_json::Value = serde_json::from_str(line).unwrap();
    let values = |file: &str, trace: &str| -> Vec<(f64, f64)> {
        let list = json[file][trace].as_array().unwrap_or_else(|| panic!("{file} {trace}: {json}"));
        list.iter().map(|pair| (pair[0].as_f64().unwrap(), pair[1].as_f64().unwrap())).collect()
    };
    for format in ["raw", "rawascii", "ltspice"] {
        let tran = format!("tran_{format}.raw");
        let real = |v: f64| (v, 0.0);
        assert_eq!(values(&tran, "v(a)"), [0.1, -2.5, 1e7].map(real), "{tran}");
        assert_eq!(values(&tran, "i(l1)"), [1e-3, 1e-9, 3.0].map(real), "{tran}");
        assert_eq!(values(&tran, "time"), [0.0, 0.5, 1.0].map(real), "{tran}");
        let ac = format!("ac_{format}.raw");
        assert_eq!(values(&ac, "v(a)"), [(1.0, -2.0), (0.5, 0.25)], "{ac}");
    }
    let stepped = values("stepped_ltspice.raw", "v(a)");
    assert_eq!(stepped, [1.0, 2.0, 3.0, 4.0, 5.0].map(|v| (v, 0.0)));
}
