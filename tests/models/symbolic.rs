//! Transfer functions in symbols: the paper's own, exactly and in the reference's numbers; and their forms as text.
//!
//! Symbols are compared exactly, N·D' = N'·D; numbers to 1e-8, the digits that the reference prints.

use bondspice::analysis::symbolic::print::{to_json, to_latex, to_text};
use bondspice::analysis::symbolic::transfer::{Transfer, transfer};
use bondspice::cli::flags::{DeckFlags, ModelFlags};
use bondspice::cli::linear::{PointFlags, linearise_named};
use bondspice::cli::session::{Global, Session};
use bondspice::expr::polynomial::Polynomial;
use bondspice::linear::Complex;
use std::path::Path;

fn of(model: &str, at: &str, from: &str, to: &str) -> Transfer {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(model);
    let file = file.to_str().unwrap().to_string();
    let flags = PointFlags {
        file,
        model: ModelFlags::default(),
        deck: DeckFlags::default(),
        at: at.into(),
    };
    let mut session = Session::new(Global { quiet: true, ..Global::default() });
    let found = linearise_named(&flags, Some(from), Some(to), &mut session);
    let found = found.unwrap_or_else(|exit| panic!("{model}: {exit:?} {:?}", session.said));
    transfer(&found.graph, &found.linear, 0).unwrap_or_else(|error| panic!("{model}: {error:?}"))
}

/// A sum of products: `3*Vt*S^2 + Jmp*L`, over the symbols of a transfer function.
fn read(text: &str, transfer: &Transfer) -> Polynomial {
    let mut sum = Polynomial::zero();
    for term in text.split('+') {
        let mut product = Polynomial::number(1);
        for factor in term.split('*').map(str::trim) {
            let (name, exponent) = factor.split_once('^').unwrap_or((factor, "1"));
            let base = match name.parse::<i64>() {
                Ok(number) => Polynomial::number(number),
                Err(_) => {
                    let place = transfer.symbols.iter().position(|symbol| symbol.name == name);
                    Polynomial::variable(place.unwrap_or_else(|| panic!("no symbol {name}")))
                }
            };
            for _ in 0..exponent.parse::<u32>().unwrap() {
                product = product.times(&base).unwrap();
            }
        }
        sum = sum.plus(&product);
    }
    sum
}

/// Whether it is top/bottom, exactly.
fn is(transfer: &Transfer, top: &Polynomial, bottom: &Polynomial) {
    let left = transfer.numerator.times(bottom).unwrap();
    assert_eq!(left, top.times(&transfer.denominator).unwrap());
}

/// The coefficients of both polynomials, from the highest power on, are these times one factor.
fn in_numbers(transfer: &Transfer, wanted: [&[f64]; 2]) {
    let mut factor = None;
    for (part, wanted) in [&transfer.numerator, &transfer.denominator].into_iter().zip(wanted) {
        let found = transfer.coefficients(part);
        assert_eq!(found.len(), wanted.len());
        for ((_, found), wanted) in found.iter().rev().zip(wanted) {
            let factor = *factor.get_or_insert(found / wanted);
            assert!(
                (found / factor - wanted).abs() <= 1e-8 * wanted,
                "{} {wanted}",
                found / factor
            );
        }
    }
}

#[test]
fn the_surface_over_the_jack_is_that_of_figure_13() {
    let found = of("eha_fig13.bg", "start", "f(feed)", "f(surface)");
    let poly = |text: &str| read(text, &found);
    let times = |a: &Polynomial, b: &Polynomial| a.times(b).unwrap();
    // k1 + c1·s and M·s² times Vt and la², so that they are polynomials.
    let first = poly("2*beta*S^2 + 2*Chj*S^2*Vt*s");
    let second = poly("Rmj + Cmj*s");
    let both = times(&first, &second);
    let top = times(&both, &poly("la^2"));
    let sum = first.plus(&times(&second, &poly("Vt")));
    let bottom = top.plus(&times(&poly("J*s^2"), &sum));
    is(&found, &top, &bottom);
    assert_eq!(found.states, 3);
    in_numbers(
        &found,
        [
            &[7.14069552e9, 1.65426113e13, 9.52092736e15],
            &[298811337.0, 3.51765499e11, 1.65426113e13, 9.52092736e15],
        ],
    );
    assert!(found.checked.1 == 12 && found.checked.0 < 1e-8);
}

#[test]
fn the_current_over_the_voltage_is_that_of_the_paper() {
    let found = of("eha_fig13.bg", "start", "Ucvs", "f(armature)");
    let top = read("Jmp*s + fmp + fetam", &found);
    let bottom = read(
        "L*Jmp*s^2 + L*fmp*s + L*fetam*s + R*Jmp*s + R_eta*Jmp*s + R*fmp + R*fetam + R_eta*fmp + R_eta*fetam + Phi^2",
        &found,
    );
    is(&found, &top, &bottom);
    let (l, r, j, f, phi) = (1.7e-3, 0.46, 1.3e-3, 3e-3, 0.23);
    in_numbers(&found, [&[j, f], &[l * j, l * f + r * j, r * f + phi * phi]]);
    // Poles of the reference: −136.448 ± 77.091j.
    let (value, _) = found.value(Complex::new(-136.448, 77.091), &found.values());
    assert!(value.re.hypot(value.im) > 1e4, "{value:?}");
    let speed = of("eha_fig13.bg", "start", "f(armature)", "f(shaft)");
    is(&speed, &read("Phi", &speed), &read("Jmp*s + fmp + fetam", &speed));
}

#[test]
fn the_whole_actuator_in_symbols_is_what_its_numbers_say() {
    // Six states of the armature's way with all the hydraulics behind it, at rest and in movement.
    for (at, states) in [("start", 6), ("600ms", 6)] {
        let found = of("eha_one_line.bg", at, "e(chopper.2)", "f(armature)");
        assert_eq!(found.states, states);
        assert!(found.checked.1 >= 4 && found.checked.0 < 1e-8, "{:?}", found.checked);
        assert_eq!(found.denominator.degree(0), 6);
    }
    // The line's loss is linear in small flows: Q0 stands for its root.
    let still = of("eha_one_line.bg", "start", "e(chopper.2)", "f(armature)");
    assert!(still.symbols.iter().any(|symbol| symbol.name == "Q0" && symbol.node.is_some()));
    for (model, from, to) in [
        ("dc_motor_load.bg", "e(V)", "f(load)"),
        ("gear_dep.bg", "p(J1)", "q(k)"),
        ("coupled_coils.bg", "e(U)", "f(coils.2)"),
        ("two_tank.bg", "f(Qin)", "e(T2)"),
    ] {
        let found = of(model, "1s", from, to);
        assert!(found.checked.0 < 1e-8, "{model} {:?}", found.checked);
    }
}

#[test]
fn a_transfer_function_reads_well() {
    let found = of("rlc.bg", "start", "e(U)", "f(mesh)");
    let text = to_text(&found, &|x| x.to_string());
    assert!(text.starts_with("f(mesh)/e(U) = (C*s)/(C*L*s^2 + C*R*s + 1)\n"), "{text}");
    let latex = to_latex(&found);
    let wanted = "\\frac{f_{\\mathrm{mesh}}}{e_{U}} = \\frac{C s}{C L s^{2} + C R s + 1}\n";
    assert_eq!(latex, wanted);
    let json = to_json(&found);
    assert_eq!(json["schema"], 1);
    assert_eq!(json["denominator"][0]["coefficient"], "C*L");
    assert_eq!(json["denominator"][0]["power"], 2);
}
