//! The page of `report` in a browser: Chromium without a window, where it is installed.

use crate::peers;
use bondspice::draw::picture::Picture;
use bondspice::report::{Contents, write};
use bondspice::trace::Trace;
use std::path::Path;
use std::process::Command;

/// Measures in the page itself, after everything has been drawn: milliseconds from the beginning of the page to here, and of
/// ten looks at ever smaller stretches, the slowest; leaves them, and any error, where the test finds them.
const MEASURE: &str = "<script>
(async () => {
  const loaded = performance.now();
  let slowest = 0;
  for (let k = 1; k <= 10; k++) {
    const [low, high] = report.whole, part = (high - low) * Math.pow(0.5, k);
    const begin = performance.now();
    report.show(low + part, low + 2 * part);
    await Promise.resolve();
    await Promise.resolve();
    slowest = Math.max(slowest, performance.now() - begin);
  }
  const shown = report.charts[0].data[0];
  const canvas = document.querySelectorAll('canvas').length;
  document.documentElement.dataset.measured = JSON.stringify({ loaded, slowest, canvas, first: shown[0], count: shown.length, errors: window.errors });
})();
</script>
</body>";

const ERRORS: &str = "<head>\n<script>window.errors = []; window.onerror = (m) => { window.errors.push(String(m)); }; \
console.error = (m) => { window.errors.push(String(m)); };</script>";

/// A page as it stands after it has been loaded, and what the browser said.
fn browse(page: &Path, profile: &Path) -> (String, String) {
    let output = Command::new("chromium")
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

fn number(text: &str, key: &str) -> f64 {
    let rest =
        &text[text.find(&format!("&quot;{key}&quot;:")).unwrap_or_else(|| panic!("{text}"))..];
    let rest = &rest[rest.find(':').unwrap() + 1..];
    rest.split([',', '}']).next().unwrap().parse().unwrap()
}

/// Loading a million points takes less than 3 s, looking closer less than 0.1 s; the file is below 20 MB.
#[test]
fn a_million_points_load_and_zoom_without_an_error() {
    if !peers::has("chromium") {
        return;
    }
    // Five columns of 200 000 rows, of two units.
    let time: Vec<f64> = (0..200_000).map(|k| f64::from(k) * 1e-5).collect();
    let wave =
        |k: usize| time.iter().map(|t| f64::sin(40.0 * t * (k + 1) as f64)).collect::<Vec<f64>>();
    let names = ["time", "a", "b", "c", "d", "e"];
    let trace = Trace {
        names: names.iter().map(|name| name.to_string()).collect(),
        units: ["s", "V", "V", "V", "A", "A"].iter().map(|unit| unit.to_string()).collect(),
        columns: std::iter::once(time.clone()).chain((0..5).map(wave)).collect(),
    };
    let page = write(&Contents {
        name: "million",
        source: "",
        trace: &trace,
        statistics: vec![],
        graph: Ok(Picture::default()),
        circuit: Err("none".into()),
        causality: "",
        proof: None,
        netlist: "",
        cards: &[],
        lines: &Default::default(),
        warnings: &[],
    });
    assert!(page.len() < 20_000_000, "{} bytes", page.len());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report.html");
    let page = page.replacen("<head>", ERRORS, 1).replacen("</body>", MEASURE, 1);
    std::fs::write(&file, page).unwrap();
    let (dom, said) = browse(&file, &folder.path().join("profile"));
    let from = dom.find("data-measured=").unwrap_or_else(|| panic!("nothing measured: {said}"));
    let measured = dom[from..].split('>').next().unwrap();
    assert!(!said.contains("CONSOLE"), "{said}");
    assert!(measured.contains("&quot;errors&quot;:[]"), "{measured}");
    assert_eq!(number(measured, "canvas"), 2.0, "a chart for each unit: {measured}");
    assert!(number(measured, "loaded") < 3000.0, "{measured}");
    assert!(number(measured, "slowest") < 100.0, "{measured}");
    // The last stretch is a thousandth of the run, with all of its rows.
    assert!((number(measured, "first") - 2.0 / 1024.0).abs() < 1e-4, "{measured}");
    assert!((150.0..260.0).contains(&number(measured, "count")), "{measured}");
}
