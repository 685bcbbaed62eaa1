//! Tests of reading.

use super::*;
use crate::diagnostic::Diagnostic;
use crate::source::SourceMap;

fn read(text: &str) -> (File, Vec<Diagnostic>, SourceMap) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let file = parse(&map, file, &mut d);
    (file, d, map)
}

#[test]
fn the_actuator_reads() {
    let (file, d, _) = read(include_str!("../../../models/eha_one_line.bg"));
    assert_eq!(d, []);
    assert_eq!(file.statements.len(), 57);
}
