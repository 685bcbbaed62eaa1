//! Where cards of an instance end up, and when it cannot be a subcircuit.

use super::{Hierarchy, fold};
use crate::bond::causality;
use crate::bond::elaborate::{self, Overrides};
use crate::bond::initial;
use crate::netlist::write::write;
use crate::source::SourceMap;
use crate::translate::translate;

fn folded(text: &str) -> (Hierarchy, String) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let program = elaborate::load(&mut map, file, &[], &mut d);
    let graph = elaborate::elaborate(&program, &map, &Overrides::default(), &mut d);
    let graph = graph.unwrap_or_else(|| panic!("{d:?}"));
    let causality = causality::assign(&graph, &mut d).unwrap_or_else(|| panic!("{d:?}"));
    let initial = initial::solve(&graph, &causality, &mut d).unwrap_or_else(|| panic!("{d:?}"));
    let flat = translate(&graph, &causality, &initial, &map, &mut d);
    let flat = flat.unwrap_or_else(|| panic!("{d:?}"));
    let nested = fold(&graph, &causality, &map, &flat);
    let text = write(&nested.netlist);
    (nested, text)
}

const PI: &str = "model Pi(R, C = 1) { port in a; port out b\n a -> 0:left -> 1:through -> 0:right -> b\n \
                  through -> R:R\n left -> C:C1(C)\n right -> C:C2(C) }\n";

#[test]
fn equal_instances_share_a_subcircuit_and_overrides_stand_at_the_instance() {
    let text = format!(
        "{PI}param r = 2\nSe:F(1) -> 1:m -> Pi:first(R = r) -> Pi:second(R = 5, C = 3) -> R:load(1)\nm -> R:s(1)\n"
    );
    let (nested, text) = folded(&text);
    assert_eq!(nested.inlined, []);
    assert_eq!(text.matches(".subckt Pi ").count(), 1, "{text}");
    assert_eq!(text.matches(".subckt").count(), 1, "{text}");
    assert!(text.contains(".subckt Pi a_p a_m b_p b_m PARAMS: R=2 C=1"), "{text}");
    assert!(text.contains("Pi PARAMS: R={r}"), "{text}");
    assert!(text.contains("Pi PARAMS: R=5 C=3"), "{text}");
}

/// A resistance in each rail: the sides of the ports are not joined inside, and grounding both would short the lower
/// one. The circuit that is drawn holds both in one rail, which is the same series loop.
#[test]
fn a_model_in_the_middle_of_a_series_loop_is_a_subcircuit_whose_minus_sides_need_no_ground() {
    let (nested, text) = folded(
        "model Two(R = 1) { port in a; port out b\n a -> 1:loop -> b\n loop -> R:upper(R)\n loop -> I:lower(2) }\n\
         Se:E(1) -> 1:whole -> Two:two(R = 4) -> 1:rest -> C:C(1)\nwhole -> R:Rw(1)\nrest -> R:Rr(1)\n",
    );
    assert_eq!(nested.inlined, [], "{text}");
    assert!(text.contains(".subckt Two a_p a_m b_p b_m PARAMS: R=1"), "{text}");
}
