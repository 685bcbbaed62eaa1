//! The language server, asked by a scripted client over its standard input and output.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Longer than any answer takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

struct Client {
    child: Child,
    stdin: Option<ChildStdin>,
    answers: Receiver<Value>,
    next: i64,
    /// The diagnostics of each file as last told.
    diagnostics: BTreeMap<String, Vec<Value>>,
    /// How often diagnostics came.
    told: usize,
}

impl Client {
    /// A server that nothing has been said to.
    fn silent() -> Client {
        let mut child = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .arg("lsp")
            .env("XDG_CACHE_HOME", std::env::temp_dir().join("bondspice-test-cache"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let stdout = child.stdout.take().unwrap();
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            let mut input = BufReader::new(stdout);
            while let Some(message) = read(&mut input) {
                if sender.send(message).is_err() {
                    return;
                }
            }
        });
        let stdin = child.stdin.take();
        Client { child, stdin, answers, next: 0, diagnostics: BTreeMap::new(), told: 0 }
    }

    /// A server that knows a workspace.
    fn new(folder: &Path) -> Client {
        let mut client = Client::silent();
        let folders = json!([{ "uri": uri(folder), "name": "work" }]);
        let params = json!({ "capabilities": {}, "workspaceFolders": folders });
        let answer = client.ask("initialize", params);
        assert_eq!(answer["serverInfo"]["name"], "bondspice");
        client.tell("initialized", json!({}));
        client
    }

    fn raw(&mut self, text: &str) {
        let stdin = self.stdin.as_mut().unwrap();
        write!(stdin, "Content-Length: {}\r\n\r\n{text}", text.len()).unwrap();
        stdin.flush().unwrap();
    }

    fn tell(&mut self, method: &str, params: Value) {
        self.raw(&json!({ "jsonrpc": "2.0", "method": method, "params": params }).to_string());
    }

    fn send(&mut self, method: &str, params: Value) -> i64 {
        self.next += 1;
        let message =
            json!({ "jsonrpc": "2.0", "id": self.next, "method": method, "params": params });
        self.raw(&message.to_string());
        self.next
    }

    /// The next message; diagnostics are noted on the way.
    fn receive(&mut self, patience: Duration) -> Option<Value> {
        let message = self.answers.recv_timeout(patience).ok()?;
        if message["method"] == "textDocument/publishDiagnostics" {
            let params = &message["params"];
            let list = params["diagnostics"].as_array().unwrap().clone();
            self.diagnostics.insert(params["uri"].as_str().unwrap().to_string(), list);
            self.told += 1;
        }
        Some(message)
    }

    fn answer(&mut self, id: i64) -> Value {
        loop {
            let message = self.receive(PATIENCE).expect("an answer");
            if message["id"] == id {
                return message;
            }
        }
    }

    /// The result of a request, which must have one.
    fn ask(&mut self, method: &str, params: Value) -> Value {
        let id = self.send(method, params);
        let message = self.answer(id);
        assert!(message.get("error").is_none(), "{method}: {message}");
        message["result"].clone()
    }

    /// The error of a request, which must have one.
    fn refused(&mut self, method: &str, params: Value) -> (i64, String) {
        let id = self.send(method, params);
        let message = self.answer(id);
        let error = &message["error"];
        (
            error["code"].as_i64().unwrap_or_else(|| panic!("{method}: {message}")),
            error["message"].as_str().unwrap().to_string(),
        )
    }

    fn open(&mut self, uri: &str, text: &str) {
        let document = json!({ "uri": uri, "languageId": "bg", "version": 1, "text": text });
        self.tell("textDocument/didOpen", json!({ "textDocument": document }));
    }

    /// Replaces a whole text.
    fn change(&mut self, uri: &str, version: i64, text: &str) {
        let document = json!({ "uri": uri, "version": version });
        let changes = json!([{ "text": text }]);
        let params = json!({ "textDocument": document, "contentChanges": changes });
        self.tell("textDocument/didChange", params);
    }

    /// The codes that are told of a file, when diagnostics have come for it and then nothing more.
    fn codes(&mut self, uri: &str) -> Vec<String> {
        let before = self.told;
        while self.told == before {
            self.receive(PATIENCE).expect("diagnostics");
        }
        while self.receive(Duration::from_millis(700)).is_some() {}
        self.shown(uri)
    }

    fn shown(&self, uri: &str) -> Vec<String> {
        let list = self.diagnostics.get(uri).into_iter().flatten();
        list.map(|d| d["code"].as_str().unwrap().to_string()).collect()
    }

    fn hover(&mut self, uri: &str, text: &str, at: &str) -> String {
        let found = self.ask("textDocument/hover", place(uri, text, at));
        found["contents"]["value"].as_str().unwrap_or("").to_string()
    }

    fn labels(&mut self, uri: &str, text: &str, at: &str) -> Vec<String> {
        let found = self.ask("textDocument/completion", place(uri, text, at));
        let items = found.as_array().unwrap();
        items.iter().map(|item| item["label"].as_str().unwrap().to_string()).collect()
    }

    /// Says goodbye in the right order.
    fn close(mut self) {
        assert_eq!(self.ask("shutdown", Value::Null), Value::Null);
        self.tell("exit", Value::Null);
        assert!(self.end().success());
    }

    fn end(mut self) -> ExitStatus {
        drop(self.stdin.take());
        self.child.wait().unwrap()
    }
}

fn read(input: &mut impl BufRead) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if input.read_line(&mut line).ok()? == 0 {
            return None;
        }
        match line.trim().strip_prefix("Content-Length: ") {
            Some(number) => length = number.parse().ok()?,
            None if line.trim().is_empty() => break,
            None => {}
        }
    }
    let mut bytes = vec![0; length];
    input.read_exact(&mut bytes).ok()?;
    serde_json::from_slice(&bytes).ok()
}

fn uri(path: &Path) -> String {
    format!("file://{}", path.to_string_lossy())
}

/// The place of `|` in `at`, the rest of which stands once in the text; columns in units of UTF-16.
fn position(text: &str, at: &str) -> Value {
    let (before, after) = at.split_once('|').expect("a | in the place");
    let found: Vec<usize> = text.match_indices(&format!("{before}{after}")).map(|m| m.0).collect();
    assert_eq!(found.len(), 1, "`{before}{after}` in\n{text}");
    let byte = found[0] + before.len();
    let line = text[..byte].matches('\n').count();
    let column = text[..byte].rsplit('\n').next().unwrap().encode_utf16().count();
    json!({ "line": line, "character": column })
}

fn place(uri: &str, text: &str, at: &str) -> Value {
    json!({ "textDocument": { "uri": uri }, "position": position(text, at) })
}

/// The text of a range of the protocol.
fn slice<'t>(text: &'t str, range: &Value) -> &'t str {
    &text[byte(text, &range["start"])..byte(text, &range["end"])]
}

fn byte(text: &str, place: &Value) -> usize {
    let line = place["line"].as_u64().unwrap() as usize;
    let column = place["character"].as_u64().unwrap() as usize;
    let start: usize = text.split_inclusive('\n').take(line).map(str::len).sum();
    let mut units = 0;
    for (at, letter) in text[start..].char_indices() {
        if units >= column {
            return start + at;
        }
        units += letter.len_utf16();
    }
    text.len()
}

/// A text after the changes that the protocol lists for it.
fn applied(text: &str, edits: &Value) -> String {
    let mut edits: Vec<(usize, usize, String)> = edits
        .as_array()
        .unwrap()
        .iter()
        .map(|edit| {
            let range = &edit["range"];
            let (start, end) = (byte(text, &range["start"]), byte(text, &range["end"]));
            (start, end, edit["newText"].as_str().unwrap().to_string())
        })
        .collect();
    edits.sort();
    let mut text = text.to_string();
    for (start, end, new) in edits.iter().rev() {
        text.replace_range(start..end, new);
    }
    text
}

/// Whether the program finds nothing wrong with a text.
fn checks(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(["check", name])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
}

const MOTOR: &str = "# A motor 🚀 with brushes.
model DcMotor(L = 1.2 mH, R = 0.1 Ohm, Φ = 0.5 V*s, Jmp = 2e-3 kg*m^2) {
  port in  supply : electrical
  port out shaft  : rotation
  input brake
  supply -> 1:armature -> GY:Φ -> 1:rotor -> shaft
  armature -> I:L, R:R
  rotor -> I:Jmp, Se:stop(brake)
  signal angle = integ(f(rotor)) # 🚀 after Φ
  output angle
}
";

const DRIVE: &str = "import \"motor.bg\"
param U = 270 V \"of the bus\"
Se:bus(U) -> 1:feed
DcMotor:m(L = 2 mH, brake = 0)
feed -> m.supply
m.shaft -> 1:load
load -> C:spring(3e-3), R:drag(k)
param k = 1e-4*2
observe f(load) in rpm, m.angle, e(m.supply)
simulate until 1 s step 1 ms
";

/// A folder with both files, and the address of each.
fn pair() -> (tempfile::TempDir, String, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("motor.bg"), MOTOR).unwrap();
    std::fs::write(folder.path().join("drive.bg"), DRIVE).unwrap();
    let (motor, drive) =
        (uri(&folder.path().join("motor.bg")), uri(&folder.path().join("drive.bg")));
    (folder, motor, drive)
}

#[test]
fn the_two_files_are_right() {
    let (folder, ..) = pair();
    checks(folder.path(), "drive.bg", DRIVE);
}

#[test]
fn diagnostics_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    // As editors write `Φ 🚀.bg`.
    let file = uri(&folder.path().join("%CE%A6%20%F0%9F%9A%80.bg"));
    // The columns before the error are of two bytes, and of two units.
    let wrong = "Se:U(10 V) -> 1:Φ\nΦ -> R:R(2 Ohm), C:C(1 mF), I:🚀\n";
    client.open(&file, wrong);
    assert_eq!(client.codes(&file), ["E0102"]);
    let wrong = "# Φ🚀\nSe:U(10 V) -> 1:Φ ; Φ -> R:Φ_R(2 Ohms)\nΦ -> R:x\nobserve f(Ψ)";
    client.change(&file, 2, wrong);
    let codes = client.codes(&file);
    assert_eq!(codes, ["E0301", "E0207", "E0206"], "all at once");
    let all = client.diagnostics[&file].clone();
    assert_eq!(slice(wrong, &all[0]["range"]), "Ohms");
    assert_eq!(slice(wrong, &all[1]["range"]), "R:x");
    assert_eq!(slice(wrong, &all[2]["range"]), "Ψ");
    let message = all[0]["message"].as_str().unwrap();
    assert!(message.contains("\nhelp: did you mean `Ohm`?"), "{message}");
    assert_eq!(all[0]["source"], "bondspice");
    client.change(&file, 3, "Se:U(10 V) -> 1:Φ\nΦ -> R:R(2 Ohm)\n");
    assert_eq!(client.codes(&file), [""; 0]);
    // Other places of an error stand beside it.
    let twice = "Se:U(10 V) -> R:R(1)\nparam k = 1\nparam k = 2\n";
    client.change(&file, 4, twice);
    assert_eq!(client.codes(&file), ["E0203"]);
    let related = &client.diagnostics[&file][0]["relatedInformation"];
    assert_eq!(related[0]["message"], "first declared here");
    assert_eq!(related[0]["location"]["range"]["start"]["line"], 1);
    client.tell("textDocument/didClose", json!({ "textDocument": { "uri": file } }));
    assert_eq!(client.codes(&file), [""; 0]);
    client.close();
}

#[test]
fn what_is_typed_quickly_is_checked_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    let file = uri(&folder.path().join("fast.bg"));
    client.open(&file, "Se:U(1) -> R:R(1)");
    client.codes(&file);
    let before = client.told;
    for version in 0..40 {
        client.change(&file, 2 + version, &format!("Se:U(1) -> R:R(1)\nparam x{version} = y"));
    }
    assert_eq!(client.codes(&file), ["E0208"]);
    assert!(client.told - before <= 3, "{} times", client.told - before);
    client.close();
}

#[test]
fn errors_of_a_file_that_is_imported_stand_in_it() {
    let (_folder, motor, drive) = pair();
    let mut client = Client::new(_folder.path());
    client.open(&drive, DRIVE);
    assert_eq!(client.codes(&drive), [""; 0]);
    // The buffer counts, and not the file on disk.
    client.open(&motor, &MOTOR.replace("I:Jmp,", "I:Jmp_,"));
    client.codes(&motor);
    assert_eq!(client.shown(&motor), ["E0207"]);
    assert_eq!(client.shown(&drive), [""; 0]);
    client.change(&motor, 2, &MOTOR.replace("port in  supply", "port in  supply_2"));
    client.codes(&drive);
    assert!(client.shown(&drive).contains(&"E0206".to_string()), "{:?}", client.diagnostics);
    client.change(&motor, 3, MOTOR);
    client.codes(&drive);
    assert_eq!((client.shown(&motor), client.shown(&drive)), (vec![], vec![]));
    client.close();
}

#[test]
fn hover_says_law_unit_domain_causality_and_value() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&drive, DRIVE);
    let said = client.hover(&drive, DRIVE, "R:dr|ag(k)");
    for part in ["e = k·f", "R = 2e-4 (SI)", "stroke at the far side: flow in, effort out"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let said = client.hover(&drive, DRIVE, "Se:b|us(U)");
    for part in ["e = U", "value = 270 (SI)", "electrical (e in V, f in A)"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let said = client.hover(&drive, DRIVE, "C:|spring(3e-3)");
    for part in ["e = q/3e-3", "integral causality, a state"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let said = client.hover(&drive, DRIVE, "Se:bus(|U)");
    for part in ["param U = 270 V", "of the bus", "= 270 V"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let said = client.hover(&drive, DRIVE, "DcM|otor:m");
    for part in [
        "model DcMotor(L = 1.2 mH",
        "A motor 🚀 with brushes.",
        "`in supply : electrical`",
        "`brake`",
        "`angle`",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert!(client.hover(&drive, DRIVE, "m.an|gle").contains("signal angle = integ(f(rotor))"));
    assert!(client.hover(&drive, DRIVE, "e|(m.supply)").contains("effort"));
    assert!(client.hover(&drive, DRIVE, "S|e:bus").contains("effort source"));
    assert!(client.hover(&drive, DRIVE, "obs|erve").contains("columns"));
    assert!(client.hover(&drive, DRIVE, "m.sup|ply\nm.shaft").contains("port in  supply"));
    // Values of a model are those of its instances, and columns count in units of UTF-16.
    client.open(&motor, MOTOR);
    let said = client.hover(&motor, MOTOR, "GY:|Φ ->");
    assert!(said.contains("gyrator"), "{said}");
    let said = client.hover(&motor, MOTOR, "🚀 after Φ|");
    assert_eq!(said, "");
    let said = client.hover(&drive, DRIVE, "DcMotor:m(L| = 2");
    assert!(said.contains("`m.L` = 2 mH = 0.002"), "{said}");
    client.close();
}

#[test]
fn definitions_lead_into_other_files() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&drive, DRIVE);
    let mut found = |at: &str| {
        let found = client.ask("textDocument/definition", place(&drive, DRIVE, at));
        let found = found.as_array().unwrap().clone();
        assert_eq!(found.len(), 1, "{at}: {found:?}");
        let target = found[0]["uri"].as_str().unwrap().to_string();
        let text = if target == motor { MOTOR } else { DRIVE };
        let range = &found[0]["range"];
        (target, slice(text, range).to_string(), range["start"]["line"].as_u64().unwrap())
    };
    assert_eq!(found("e(m.|supply)"), (motor.clone(), "supply".into(), 2));
    assert_eq!(found("|DcMotor:m"), (motor.clone(), "DcMotor".into(), 1));
    assert_eq!(found("m(|L = 2"), (motor.clone(), "L".into(), 1));
    assert_eq!(found("brake| = 0"), (motor.clone(), "brake".into(), 4));
    assert_eq!(found("m.an|gle"), (motor.clone(), "angle".into(), 8));
    assert_eq!(found("import \"mo|tor"), (motor.clone(), String::new(), 0));
    assert_eq!(found("f(lo|ad)"), (drive.clone(), "load".into(), 5));
    assert_eq!(found("R:drag(|k)"), (drive.clone(), "k".into(), 7));
    let references = |client: &mut Client, uri: &str, text: &str, at: &str| {
        let mut params = place(uri, text, at);
        params["context"] = json!({ "includeDeclaration": true });
        let found = client.ask("textDocument/references", params);
        let mut lines: Vec<(bool, u64)> = found
            .as_array()
            .unwrap()
            .iter()
            .map(|l| (l["uri"] == motor, l["range"]["start"]["line"].as_u64().unwrap()))
            .collect();
        lines.sort_unstable();
        lines
    };
    // The motor was never opened: it belongs to the workspace.
    let supply = [(false, 4), (false, 8), (true, 2), (true, 5)];
    assert_eq!(references(&mut client, &drive, DRIVE, "feed -> m.sup|ply"), supply);
    let load = [(false, 5), (false, 6), (false, 8)];
    assert_eq!(references(&mut client, &drive, DRIVE, "f(lo|ad)"), load);
    client.close();
}

/// The texts of both files after a rename.
fn renamed(client: &mut Client, uris: [&str; 2], uri: &str, at: &str, new: &str) -> [String; 2] {
    let text = if uri == uris[0] { MOTOR } else { DRIVE };
    let mut params = place(uri, text, at);
    params["newName"] = json!(new);
    let edit = client.ask("textDocument/rename", params);
    let changes = &edit["changes"];
    let new_text = |uri: &str, text: &str| match changes.get(uri) {
        Some(edits) => applied(text, edits),
        None => text.to_string(),
    };
    [new_text(uris[0], MOTOR), new_text(uris[1], DRIVE)]
}

#[test]
fn renaming_keeps_the_meaning() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&drive, DRIVE);
    let uris = [motor.as_str(), drive.as_str()];
    // File, place, new name; what the motor and the drive hold afterwards.
    type Case<'c> = (&'c str, &'c str, &'c str, &'c [&'c str], &'c [&'c str]);
    let cases: [Case<'_>; 9] = [
        (
            &drive,
            "feed -> m.sup|ply",
            "inlet",
            &["port in  inlet :", "inlet -> 1:"],
            &["m.inlet", "e(m.inlet)"],
        ),
        (&drive, "f(lo|ad)", "shaft", &[], &["1:shaft", "shaft -> C:spring", "f(shaft) in"]),
        (&drive, "|DcMotor:m", "Motor", &["model Motor("], &["Motor:m(L"]),
        (&drive, "DcMotor:|m(", "motor", &[], &["motor.supply", "motor.angle", "e(motor.supply)"]),
        (&drive, "m.an|gle", "φ", &["signal φ =", "output φ"], &["m.φ,"]),
        // Elements that take the parameter of their name keep it, whichever of the two is renamed.
        (&drive, "m(|L = 2", "L_a", &["(L_a = 1.2 mH", "I:L(L_a), R:R\n"], &["m(L_a = 2 mH"]),
        (&motor, "GY:|Φ ->", "gyro", &["GY:gyro(Φ) ->", "Φ = 0.5 V*s"], &[]),
        (&motor, "Ohm, |Φ =", "K", &["K = 0.5 V*s", "GY:Φ(K) ->"], &[]),
        (&drive, "brake| = 0", "torque", &["input torque", "Se:stop(torque)"], &["torque = 0"]),
    ];
    for (file, at, new, in_motor, in_drive) in cases {
        let [new_motor, new_drive] = renamed(&mut client, uris, file, at, new);
        for part in in_motor {
            assert!(new_motor.contains(&part.replace("\\n", "\n")), "{part}: {new_motor}");
        }
        for part in in_drive {
            assert!(new_drive.contains(part), "{part}: {new_drive}");
        }
        let work = tempfile::tempdir().unwrap();
        std::fs::write(work.path().join("motor.bg"), new_motor).unwrap();
        checks(work.path(), "drive.bg", &new_drive);
    }
    let place = place(&drive, DRIVE, "f(lo|ad)");
    let ready = client.ask("textDocument/prepareRename", place);
    assert_eq!(ready["placeholder"], "load");
    client.close();
}

#[test]
fn a_name_that_would_mean_something_else_is_refused() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&drive, DRIVE);
    for (file, text, at, new, reason) in [
        (&drive, DRIVE, "f(lo|ad)", "feed", "already the name of a 1-junction"),
        (&drive, DRIVE, "f(lo|ad)", "2x", "is no name"),
        (&drive, DRIVE, "f(lo|ad)", "", "is no name"),
        (&drive, DRIVE, "f(lo|ad)", "and", "a word of the language"),
        (&drive, DRIVE, "R:drag(|k)", "U", "already the name of a parameter"),
        (&drive, DRIVE, "R:drag(|k)", "f", "something of its own"),
        (&drive, DRIVE, "|DcMotor:m", "R", "a kind of element"),
        (&motor, MOTOR, "input br|ake", "R", "already the name of a parameter"),
        (&drive, DRIVE, "observe f(load) in r|pm", "x", "no name that was given here"),
    ] {
        let mut params = place(file, text, at);
        params["newName"] = json!(new);
        let (_, message) = client.refused("textDocument/rename", params);
        assert!(message.contains(reason), "{at} to {new}: {message}");
    }
    // A variable that would hide a parameter, and an element that would take a value it has not.
    let file = uri(&folder.path().join("loop.bg"));
    let text = "param k = 2\nSe:U(1) -> 1:a\nfor n in 1..2 { a -> R:r[n](k*n) }\n";
    client.open(&file, text);
    let mut params = place(&file, text, "param |k");
    params["newName"] = json!("n");
    let (_, message) = client.refused("textDocument/rename", params);
    assert!(message.contains("counts in a loop"), "{message}");
    let mut params = place(&file, text, "R:|r[n]");
    params["newName"] = json!("branch");
    let edit = client.ask("textDocument/rename", params);
    let new = applied(text, &edit["changes"][&file]);
    assert!(new.contains("R:branch[n](k*n)"), "{new}");
    client.close();
}

#[test]
fn completion_knows_the_place() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&drive, DRIVE);
    client.open(&motor, MOTOR);
    let has = |found: &[String], wanted: &[&str], not: &[&str]| {
        for label in wanted {
            assert!(found.iter().any(|l| l == label), "{label} in {found:?}");
        }
        for label in not {
            assert!(!found.iter().any(|l| l == label), "no {label} in {found:?}");
        }
    };
    let mut offered = |text: &str, at: &str| {
        client.change(&drive, 7, text);
        client.labels(&drive, text, at)
    };
    let with = |line: &str| format!("{DRIVE}{line}\n");
    let found = offered(&with("pa"), "pa|\n");
    has(&found, &["param", "Se", "MTF", "DcMotor", "load", "m"], &["sin", "k", "rotor"]);
    has(&offered(&with("load -> R"), "load -> R|\n"), &["R", "DcMotor", "feed"], &["param", "U"]);
    has(
        &offered(&with("feed -> m."), "feed -> m.|\n"),
        &["supply", "shaft", "rotor"],
        &["angle", "load"],
    );
    has(
        &offered(&with("signal y = m."), "signal y = m.|\n"),
        &["angle", "L"],
        &["supply", "brake"],
    );
    has(
        &offered(&with("signal y = f("), "signal y = f(|\n"),
        &["load", "drag", "m"],
        &["U", "sin"],
    );
    let found = offered(&with("signal y = i"), "signal y = i|\n");
    has(&found, &["integ", "U", "k", "sin", "if", "pi", "time"], &["load", "Se"]);
    has(&offered(&with("param z = 3 m"), "param z = 3 m|\n"), &["mm", "mH", "m"], &["V", "U"]);
    has(
        &offered(&with("DcMotor:n("), "DcMotor:n(|\n"),
        &["L", "R", "Φ", "Jmp", "brake"],
        &["angle"],
    );
    has(&offered(&with("load -> C:coil("), "coil(|\n"), &["q0", "e0", "k"], &["p0"]);
    has(&offered(&with("import \""), "import \"|\n"), &["motor.bg"], &["drive.bg"]);
    has(&offered(&with("options method = "), "method = |\n"), &["trbdf2", "auto"], &["sin"]);
    has(&offered(&with("port in a : "), "port in a : |\n"), &["rotation", "hydraulic"], &["sin"]);
    has(&offered(&with("# pa"), "# pa|\n"), &[], &["param"]);
    // Within the model its own names are offered, by what follows them.
    let found = client.labels(&motor, MOTOR, "R:R|\n");
    has(&found, &["Jmp", "brake", "R"], &["U", "sin"]);
    client.close();
}

#[test]
fn the_outline_has_models_with_their_parts() {
    let (folder, motor, drive) = pair();
    let mut client = Client::new(folder.path());
    client.open(&motor, MOTOR);
    let found =
        client.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": motor } }));
    assert_eq!(found[0]["name"], "DcMotor");
    let inner: Vec<&str> = found[0]["children"]
        .as_array()
        .unwrap()
        .iter()
        .map(|child| child["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        inner,
        [
            "L",
            "R",
            "Φ",
            "Jmp",
            "supply",
            "shaft",
            "brake",
            "1:armature",
            "GY:Φ",
            "1:rotor",
            "I:L",
            "R:R",
            "I:Jmp",
            "Se:stop",
            "angle"
        ]
    );
    let gyrator = &found[0]["children"][8]["selectionRange"];
    assert_eq!(slice(MOTOR, gyrator), "GY:Φ");
    let found =
        client.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": drive } }));
    assert!(found.as_array().unwrap().iter().any(|s| s["name"] == "DcMotor:m"), "{found}");
    client.close();
}

#[test]
fn a_mend_is_offered_and_mends() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    let file = uri(&folder.path().join("wrong.bg"));
    let text = "# 🚀\nSe:U(10 V) -> 1:Φ\nΦ -> R:R(2 Ohms)\n";
    client.open(&file, text);
    assert_eq!(client.codes(&file), ["E0301"]);
    let diagnostic = client.diagnostics[&file][0].clone();
    let mut ask = |range: &Value| {
        let context = json!({ "diagnostics": [] });
        let params = json!({ "textDocument": { "uri": file }, "range": range, "context": context });
        client.ask("textDocument/codeAction", params)
    };
    let actions = ask(&diagnostic["range"]);
    assert_eq!(actions[0]["title"], "Write `Ohm`");
    assert_eq!(actions[0]["kind"], "quickfix");
    let mended = applied(text, &actions[0]["edit"]["changes"][&file]);
    checks(folder.path(), "mended.bg", &mended);
    let start = json!({ "line": 0, "character": 0 });
    assert_eq!(ask(&json!({ "start": start, "end": start })), json!([]));
    client.close();
}

#[test]
fn a_text_is_laid_out_as_fmt_does() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    let file = uri(&folder.path().join("wild.bg"));
    let text = "# 🚀\n  Se:U( 10 V )->1:Φ   # Φ\nΦ->R:R(2   ),C:C( 1 mF)\n";
    client.open(&file, text);
    let format = |client: &mut Client| {
        let options = json!({ "tabSize": 2, "insertSpaces": true });
        let params = json!({ "textDocument": { "uri": file }, "options": options });
        client.ask("textDocument/formatting", params)
    };
    let edits = format(&mut client);
    let new = applied(text, &edits);
    assert!(new != text && new.contains("Se:U(10 V) -> 1:Φ"), "{new}");
    std::fs::write(folder.path().join("wild.bg"), text).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .args(["fmt", "wild.bg"])
        .current_dir(folder.path())
        .status();
    assert!(done.unwrap().success());
    assert_eq!(std::fs::read_to_string(folder.path().join("wild.bg")).unwrap(), new);
    // What is in order stays as it is, and so does what cannot be read.
    client.change(&file, 2, &new);
    assert_eq!(format(&mut client), json!([]));
    client.change(&file, 3, "Se:U(->");
    assert_eq!(format(&mut client), json!([]));
    client.close();
}

#[test]
fn colours_follow_the_meaning() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::silent();
    let answer = client.ask("initialize", json!({ "capabilities": {} }));
    let legend = answer["capabilities"]["semanticTokensProvider"]["legend"]["tokenTypes"].clone();
    let file = uri(&folder.path().join("colours.bg"));
    let text = "# 🚀 Φ\nparam Φ = 2 mH \"🚀\" # c\nSe:U(step(0 s, 0, Φ)) -> 1:step\n";
    client.open(&file, text);
    let found =
        client.ask("textDocument/semanticTokens/full", json!({ "textDocument": { "uri": file } }));
    let numbers: Vec<u64> =
        found["data"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    let (mut line, mut column) = (0, 0);
    let mut coloured = vec![];
    for token in numbers.chunks(5) {
        column = if token[0] == 0 { column + token[1] } else { token[1] };
        line += token[0];
        let at = |column: u64| json!({ "line": line, "character": column });
        let range = json!({ "start": at(column), "end": at(column + token[2]) });
        let sort = legend[token[3] as usize].as_str().unwrap();
        coloured.push(format!("{} {sort}", slice(text, &range)));
    }
    for wanted in [
        "# 🚀 Φ comment",
        "param keyword",
        "Φ variable",
        "2 number",
        "mH macro",
        "\"🚀\" string",
        "# c comment",
        "Se type",
        "step function",
        "step variable",
        "-> operator",
        "1 type",
    ] {
        assert!(coloured.iter().any(|token| token == wanted), "{wanted} in {coloured:?}");
    }
    client.close();
}

#[test]
fn files_of_the_library_are_shown_and_not_changed() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    let (name, text) = bondspice::source::library::LIBRARY[0];
    let model = text.lines().find_map(|line| line.strip_prefix("model ")).expect(name);
    let model = model.split('(').next().unwrap().trim();
    let file = uri(&folder.path().join("user of it.bg"));
    let source = format!("import \"std/{name}\"\n{model}:part\n");
    client.open(&file, &source);
    let at = place(
        &file.replace(' ', "%20"),
        &source,
        &format!("\n{}|{}:part", &model[..1], &model[1..]),
    );
    let found = client.ask("textDocument/definition", at.clone());
    let target = found[0]["uri"].as_str().unwrap().strip_prefix("file://").unwrap();
    assert_eq!(std::fs::read_to_string(target).unwrap(), text);
    assert!(std::fs::metadata(target).unwrap().permissions().readonly());
    let mut rename = at;
    rename["newName"] = json!("Mine");
    let (_, reason) = client.refused("textDocument/rename", rename);
    assert!(reason.contains("belongs to the library"), "{reason}");
    client.close();
}

#[test]
fn nothing_that_is_said_brings_it_down() {
    let (folder, motor, drive) = pair();
    let mut client = Client::silent();
    // Nothing works before the beginning.
    assert_eq!(client.refused("textDocument/hover", json!({})).0, -32002);
    client.raw("this is no JSON");
    client.raw("{\"jsonrpc\": \"2.0\"}");
    client.ask("initialize", json!({ "capabilities": {} }));
    assert_eq!(client.refused("initialize", json!({ "capabilities": {} })).0, -32600);
    assert_eq!(client.refused("no/such/thing", json!({})).0, -32601);
    assert_eq!(client.refused("textDocument/hover", json!({ "position": 3 })).0, -32602);
    client.tell("no/such/note", json!([1, 2]));
    client.tell("textDocument/didOpen", json!({ "textDocument": 1 }));
    client.tell(
        "textDocument/didChange",
        json!({ "textDocument": { "uri": "file:///x", "version": 1 }, "contentChanges": [] }),
    );
    let missing = json!({ "textDocument": { "uri": uri(&folder.path().join("no.bg")) } });
    assert_eq!(client.refused("textDocument/documentSymbol", missing).0, -32602);
    client.open(&drive, DRIVE);
    client.open(&motor, MOTOR);
    // Every place of a text and many outside it, also in the midst of a character and of every state of typing.
    let places =
        [(0, 0), (0, 9), (1, 39), (5, 27), (8, 33), (9, 999), (99, 0), (4_000_000, 4_000_000)];
    for (line, character) in places {
        let position = json!({ "line": line, "character": character });
        let at = json!({ "textDocument": { "uri": motor }, "position": position });
        for method in ["hover", "definition", "completion", "documentHighlight"] {
            client.ask(&format!("textDocument/{method}"), at.clone());
        }
        let mut references = at.clone();
        references["context"] = json!({ "includeDeclaration": false });
        client.ask("textDocument/references", references);
    }
    let mut typed = String::new();
    for (number, letter) in DRIVE.chars().enumerate() {
        typed.push(letter);
        if number % 7 == 0 {
            client.change(&drive, 100 + number as i64, &typed);
            let end = json!({ "line": 999, "character": 0 });
            let at = json!({ "textDocument": { "uri": drive }, "position": end });
            client.ask("textDocument/completion", at.clone());
            client.ask("textDocument/hover", at);
            client.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": drive } }));
        }
    }
    let odd = [
        "",
        "{",
        "}}}",
        "model",
        "import \"drive.bg\"",
        "\u{0}",
        "for k in 1..20000 {R:r[k](1)}",
        "🚀",
    ];
    for (number, text) in odd.iter().enumerate() {
        client.change(&drive, 9000 + number as i64, text);
        client.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": drive } }));
    }
    client.close();
}

#[test]
fn whoever_leaves_without_a_word_is_told_by_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let mut client = Client::new(folder.path());
    client.tell("exit", Value::Null);
    assert_eq!(client.end().code(), Some(1));
    let client = Client::new(folder.path());
    assert_eq!(client.end().code(), Some(1));
}
