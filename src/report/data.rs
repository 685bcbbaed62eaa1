//! A trace in a page: columns as numbers of 32 bits in base 64, rows thinned out where they would be too many.

use crate::trace::Trace;
use serde_json::{Value, json};

/// The most values that a page holds: 5.3 letters each.
const MOST: usize = 2_500_000;

/// The columns that are drawn: no abscissa, no count of runs, no second run.
fn columns(trace: &Trace) -> std::ops::Range<usize> {
    trace.abscissa() + 1..trace.names.len()
}

/// How many rows a page has room for; a value of the abscissa counts as two.
fn room(trace: &Trace) -> usize {
    MOST / (columns(trace).len() + 2)
}

/// What is said where rows are left out.
pub fn thinned(trace: &Trace) -> Option<String> {
    let (rows, room) = (trace.rows(), room(trace));
    (rows > room).then(|| {
        format!("Of {rows} rows at most {room} are on this page: the least and the greatest of every column in each stretch.")
    })
}

/// The rows that are kept: all, or of each stretch the least and greatest of every column.
fn rows(trace: &Trace) -> Vec<usize> {
    let (count, room) = (trace.rows(), room(trace));
    if count <= room {
        return (0..count).collect();
    }
    let columns = &trace.columns[columns(trace)];
    let stretches = (room / (2 * columns.len().max(1))).max(1);
    let mut kept = vec![0, count - 1];
    for stretch in 0..stretches {
        let (from, to) = (count * stretch / stretches, count * (stretch + 1) / stretches);
        for column in columns {
            let by = |a: &usize, b: &usize| column[*a].total_cmp(&column[*b]);
            kept.extend((from..to).min_by(by));
            kept.extend((from..to).max_by(by));
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// The trace as JSON that may stand in a page.
pub fn json(trace: &Trace) -> String {
    let rows = rows(trace);
    let time: Vec<f64> = rows.iter().map(|row| trace.time()[*row]).collect();
    let name = trace.names.get(trace.abscissa()).map_or("", String::as_str);
    let unit = match trace.units.get(trace.abscissa()).map(String::as_str) {
        Some("") | None if name == "time" => "s",
        unit => unit.unwrap_or(""),
    };
    let label = if unit.is_empty() { name.to_string() } else { format!("{name} [{unit}]") };
    let mut abscissa = match grid(&time) {
        Some((start, step)) => json!({"start": start, "step": step, "count": time.len()}),
        None => json!({"packed": base64(time.iter().flat_map(|t| t.to_le_bytes()))}),
    };
    abscissa["label"] = Value::String(label);
    let column = |at: usize| {
        let values = rows.iter().flat_map(|row| (trace.columns[at][*row] as f32).to_le_bytes());
        json!({"name": trace.names[at], "unit": trace.units[at], "packed": base64(values)})
    };
    let columns: Vec<Value> = columns(trace).map(column).collect();
    // Nothing within may end the element that holds it.
    json!({"time": abscissa, "columns": columns}).to_string().replace("</", "<\\/")
}

/// Start and step of an even grid.
fn grid(time: &[f64]) -> Option<(f64, f64)> {
    let (first, last) = (*time.first()?, *time.last()?);
    let step = (last - first) / (time.len().max(2) - 1) as f64;
    let even =
        time.iter().enumerate().all(|(k, t)| (t - first - k as f64 * step).abs() <= 1e-6 * step);
    (time.len() > 1 && step > 0.0 && even).then_some((first, step))
}

/// Base 64 (RFC 4648).
fn base64(bytes: impl Iterator<Item = u8>) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.size_hint().0 / 3 * 4 + 4);
    let (mut word, mut filled) = (0_u32, 0);
    let mut push = |word: u32, count: usize| {
        for k in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * k)) as usize & 63];
            out.push(if k < count { char::from(letter) } else { '=' });
        }
    };
    for byte in bytes {
        word = word << 8 | u32::from(byte);
        filled += 1;
        if filled == 3 {
            push(word, 4);
            (word, filled) = (0, 0);
        }
    }
    if filled > 0 {
        push(word << (8 * (3 - filled)), filled + 1);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_its_standard() {
        for (text, wanted) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(text.bytes()), wanted);
        }
    }

    #[test]
    fn too_many_rows_are_thinned_and_peaks_stay() {
        let count = 3_000_000;
        let time: Vec<f64> = (0..count).map(|k| f64::from(k) * 1e-6).collect();
        let mut x = vec![0.0; count as usize];
        x[1_234_567] = 7.0;
        let trace = Trace {
            names: vec!["time".into(), "x".into()],
            units: vec!["s".into(), String::new()],
            columns: vec![time, x],
        };
        let kept = rows(&trace);
        assert!(kept.len() <= room(&trace) + 2 && kept.contains(&1_234_567), "{}", kept.len());
        assert!(thinned(&trace).is_some());
        assert!(json(&trace).len() < 20_000_000);
    }
}
