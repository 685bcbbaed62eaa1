//! Tests of elaboration.

use super::*;
use crate::bond::graph::*;
use crate::bond::syntax;

fn build(text: &str) -> (Option<BondGraph>, Vec<Diagnostic>, SourceMap) {
    build_with(text, &Overrides::default())
}

fn build_with(
    text: &str,
    overrides: &Overrides,
) -> (Option<BondGraph>, Vec<Diagnostic>, SourceMap) {
    let mut map = SourceMap::default();
    let file = map.add("models/test.bg", text);
    let mut d = vec![];
    let file = syntax::parse(&map, file, &mut d);
    let graph = elaborate(&file, &map, overrides, &mut d);
    (graph, d, map)
}

#[test]
fn the_actuator() {
    let (graph, d, _) = build(include_str!("../../../models/eha_one_line.bg"));
    assert_eq!(d, []);
    let graph = graph.unwrap();
}
