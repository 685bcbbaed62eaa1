//! Netlists as linear models: matrices, poles and responses against closed forms, and against `.ac`, `.pz`, `.tf` of the
//! same deck, to 1e-8.

use crate::small_signal::{column, run};
use bondspice::analysis::linear::Linear;
use bondspice::analysis::poles::{poles, zeros};
use bondspice::analysis::response::response;
use bondspice::analysis::state_space::state_space;
use bondspice::cli::flags::{DeckFlags, ModelFlags};
use bondspice::cli::linear::{PointFlags, linearise};
use bondspice::cli::session::{Global, Session};
use bondspice::linear::Complex;

fn asked(deck: &str, at: &str, from: Option<&str>, to: Option<&str>) -> Result<Linear, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("deck.cir");
    std::fs::write(&file, format!("a deck\n{deck}\n.end\n")).unwrap();
    let file = file.to_str().unwrap().to_string();
    let (model, deck) = (ModelFlags::default(), DeckFlags::default());
    let flags = PointFlags { file, model, deck, at: at.into() };
    let mut session = Session::new(Global { quiet: true, ..Global::default() });
    linearise(&flags, from, to, &mut session).map_err(|_| {
        let said = session.said.iter().map(|d| format!("{} {} {:?}", d.code, d.message, d.help));
        said.collect::<Vec<_>>().join("\n")
    })
}

fn of(deck: &str, from: &str, to: &str) -> Linear {
    asked(deck, "start", Some(from), Some(to)).unwrap_or_else(|said| panic!("{said}"))
}

fn close(found: Complex, wanted: Complex, part: f64, what: &str) {
    let error = (found.re - wanted.re).hypot(found.im - wanted.im);
    assert!(error <= part * wanted.re.hypot(wanted.im), "{what}: {found:?} is not {wanted:?}");
}

const RLC: &str = "v1 in 0 dc 1 ac 1\nl1 in a 10m\nr1 a b 20\nc1 b 0 1u";

#[test]
fn matrices_of_a_series_circuit() {
    // phi' = u - R·phi/L - q/C, q' = phi/L.
    let linear = of(RLC, "V1", "v(b), i(l1), i(c1)");
    let space = state_space(&linear).unwrap();
    let names: Vec<&str> = space.states.iter().map(|state| state.name.as_str()).collect();
    let units: Vec<&str> = space.states.iter().map(|state| state.unit.as_str()).collect();
    let phi = names.iter().position(|name| name.eq_ignore_ascii_case("phi(l1)")).unwrap();
    assert_eq!(units[phi], "Wb");
    assert_eq!(units[1 - phi], "C");
    let (q, near) =
        (1 - phi, |a: f64, b: f64| assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} {b}"));
    near(space.a[phi][phi], -2000.0);
    near(space.a[phi][q], -1e6);
    near(space.a[q][phi], 100.0);
    near(space.a[q][q], 0.0);
    near(space.b[phi][0], 1.0);
    near(space.c[0][q], 1e6);
    near(space.c[1][phi], 100.0);
    // The current of a capacitor is the rate of its charge.
    near(space.c[2][phi], 100.0);
    // At the operating point the capacitor holds C·1 V, the inductor carries nothing.
    near(space.states[q].value, 1e-6);
    let found = poles(&linear).unwrap();
    let w = (1e8f64 - 1e6).sqrt();
    for pole in &found {
        let wanted = Complex::new(-1000.0, w * pole.at.im.signum());
        close(pole.at, wanted, 1e-9, "pole");
    }
}

/// Floating and parallel capacitors, coupled coils, a diode at its operating point, both kinds of sources.
const MIXED: &str = "v1 in 0 dc 0.7 ac 1\nr1 in a 1k\nc1 a b 10n\nc3 a b 3n\nd1 b 0 dm\n.model dm d is=1e-14 cjo=5p tt=1n
r2 b 0 100k\nl1 a c 1m\nl2 d 0 4m\nk1 l1 l2 0.6\nr3 c 0 50\nr4 d 0 500\ni2 0 c dc 1m\nc4 in 0 1n";

#[test]
fn responses_are_those_of_ac() {
    let trace =
        run(&format!("{MIXED}\n.ac dec 4 100 10meg\n.print ac v(b) i(c1) v(d) i(l1) i(v1)"));
    let linear = of(MIXED, "v1", "v(b), i(c1), v(d), i(l1), i(v1)");
    let frequencies = column(&trace, "frequency").to_vec();
    let found = response(&linear, 0, &frequencies).unwrap();
    assert!(frequencies.len() > 20 && found.values.len() == 5);
    for (output, values) in linear.outputs.iter().zip(&found.values) {
        let part = |part: &str| column(&trace, &format!("{}.{part}", output.name)).to_vec();
        let (re, im) = (part("re"), part("im"));
        let largest = re.iter().zip(&im).map(|(re, im)| re.hypot(*im)).fold(0.0, f64::max);
        for ((value, re), im) in values.iter().zip(re).zip(im) {
            let error = (value.re - re).hypot(value.im - im);
            assert!(error <= 1e-8 * largest, "{}: {value:?} is not {re} {im}", output.name);
        }
    }
}

#[test]
fn poles_and_zeros_are_those_of_pz() {
    let deck =
        "v1 in 0 dc 0 ac 1\nr1 in a 1k\nc1 a b 10n\nr2 b 0 2k\nl1 b c 5m\nr3 c 0 30\nc2 c 0 20n";
    let trace = run(&format!("{deck}\n.pz in 0 c 0 vol pz"));
    let linear = of(deck, "v1", "v(c)");
    let wanted = |name: &str| -> Vec<Complex> {
        let part = |part: &str| column(&trace, &format!("{name}.{part}")).to_vec();
        let pairs = part("re").into_iter().zip(part("im")).filter(|(re, _)| !re.is_nan());
        pairs.map(|(re, im)| Complex::new(re, im)).collect()
    };
    let (found, zeros) = (poles(&linear).unwrap(), zeros(&linear, 0, 0).unwrap());
    let found: Vec<Complex> =
        found.iter().flat_map(|pole| std::iter::repeat_n(pole.at, pole.multiplicity)).collect();
    let zeros: Vec<Complex> =
        zeros.iter().flat_map(|zero| std::iter::repeat_n(zero.at, zero.multiplicity)).collect();
    for (found, wanted, what) in [(found, wanted("pole"), "pole"), (zeros, wanted("zero"), "zero")]
    {
        assert_eq!(found.len(), wanted.len(), "{what} {found:?} {wanted:?}");
        for root in &found {
            let off = |other: &&Complex| (root.re - other.re).hypot(root.im - other.im);
            let near = wanted.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            // A zero at 0 is one to the size of the others.
            let size = near.re.hypot(near.im).max(1.0);
            assert!(off(&near) <= 1e-8 * size, "{what} {root:?} {near:?}");
        }
    }
}

#[test]
fn the_gain_at_rest_is_that_of_tf() {
    let trace = run(&format!("{MIXED}\n.tf v(d,b) i2"));
    let linear = of(MIXED, "i2", "v(d,b)");
    let found = response(&linear, 0, &[0.0]).unwrap().values[0][0];
    let gain = trace.columns[trace
        .names
        .iter()
        .position(|name| name.contains("gain") || name.contains("transfer"))
        .unwrap()][0];
    close(found, Complex::new(gain, 0.0), 1e-8, "gain");
}

#[test]
fn what_cannot_be_asked_says_why() {
    for (deck, at, from, says) in [
        (RLC, "1s", None, "E0944"),
        (RLC, "start", Some("v2"), "E0929"),
        ("v1 in 0 1\nt1 in 0 out 0 z0=50 td=1n\nr1 out 0 50", "rest", None, "E0927"),
        ("v1 in 0 1\nr1 in 0 (", "rest", None, "E0"),
    ] {
        let said = asked(deck, at, from, None).expect_err(says);
        assert!(said.contains(says), "{said}");
    }
    let said = asked(RLC, "start", Some("v2"), None).unwrap_err();
    assert!(said.contains("did you mean `V1`?") || said.contains("did you mean `v1`?"), "{said}");
}

#[test]
fn equal_islands_have_equal_poles() {
    // Ten circuits side by side, the poles of each −R/2L ± i·sqrt(1/LC − (R/2L)²); together each ten times, not nine and one.
    let mut deck = String::new();
    for k in 0..10 {
        deck +=
            &format!("v{k} in{k} 0 ac 1\nl{k} in{k} a{k} 10m\nr{k} a{k} b{k} 20\nc{k} b{k} 0 1u\n");
    }
    // A chain that each of them drives and that drives none.
    for k in 0..10 {
        deck += &format!("g{k} 0 s b{k} 0 1m\n");
    }
    let linear = of(&(deck + "rs s 0 1k\ncs s 0 1n"), "v0", "v(s)");
    let found = poles(&linear).unwrap();
    let w = (1e8f64 - 1e6).sqrt();
    assert_eq!(found.len(), 3, "{found:?}");
    for pole in &found {
        let (wanted, times) = match pole.at.im == 0.0 {
            true => (Complex::new(-1e6, 0.0), 1),
            false => (Complex::new(-1000.0, w * pole.at.im.signum()), 10),
        };
        assert_eq!(pole.multiplicity, times);
        close(pole.at, wanted, 1e-12, "pole");
    }
}
