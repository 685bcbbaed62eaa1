//! Netlists in stock ngspice, and the observed columns of what it computes, by the map.

use bondspice::expr::Expr;
use bondspice::netlist::write::expression;
use bondspice::netlist::{Leaf, Netlist};
use bondspice::trace::{Trace, formats};
use bondspice::translate::Map;
use std::process::Command;

/// Whether ngspice is there; where it must be and is not, the test fails.
pub fn ngspice() -> bool {
    crate::peers::has("ngspice")
}

/// The observed columns as ngspice computes them from a text of this netlist.
///
/// # Errors
/// What ngspice said.
pub fn run(name: &str, netlist: &Netlist, map: &Map, text: &str) -> Result<Trace, String> {
    let folder = tempfile::tempdir().unwrap();
    let deck = folder.path().join("deck.cir");
    let raw = folder.path().join("deck.raw");
    std::fs::write(&deck, text).unwrap();
    let output = Command::new("ngspice").arg("-b").arg("-r").arg(&raw).arg(&deck).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).to_string()
        + &String::from_utf8_lossy(&output.stderr);
    let told = || format!("{name}\n{said}\n{text}");
    if !output.status.success() {
        return Err(told());
    }
    let bytes = std::fs::read(&raw).map_err(|_| told())?;
    let result = formats::read("deck.raw", &bytes).map_err(|why| format!("{why:?}\n{}", told()))?;
    let names = &netlist.names;
    let ground = names.find("0").unwrap();
    let observed: Vec<_> = map.variables.iter().filter(|variable| variable.observed).collect();
    let mut trace = Trace::new(
        std::iter::once("time".to_string()).chain(observed.iter().map(|v| v.bg.clone())).collect(),
        vec![],
    );
    trace.columns[0] = result.time().to_vec();
    let column = |wanted: String| {
        let wanted = wanted.to_lowercase();
        result.column(&wanted).unwrap_or_else(|| panic!("{name}: no {wanted}"))
    };
    for (at, variable) in observed.iter().enumerate() {
        let expr: Expr<(Vec<f64>, f64)> = variable.expr.as_ref().unwrap().map(&mut |leaf, _| {
            let zero = || vec![0.0; result.rows()];
            let voltage = |node| match node == ground {
                true => zero(),
                false => column(format!("v({})", names.text(node))).to_vec(),
            };
            let values = match leaf {
                Leaf::Voltage(plus, None) => voltage(*plus),
                Leaf::Voltage(plus, Some(minus)) => {
                    voltage(*plus).iter().zip(voltage(*minus)).map(|(a, b)| a - b).collect()
                }
                Leaf::Current(_) => column(expression(names, &Expr::leaf(leaf.clone()))).to_vec(),
                Leaf::Time => result.time().to_vec(),
                Leaf::Parameter(own) => {
                    let value = map.parameters.iter().find(|(known, _)| known == own).unwrap().1;
                    vec![value; result.rows()]
                }
                other => panic!("maps do not speak of {other:?}"),
            };
            Expr::leaf((values, 0.0))
        });
        trace.columns[at + 1] = (0..result.rows())
            .map(|row| expr.evaluate(&mut |(values, _)| values[row]) * variable.factor)
            .collect();
    }
    Ok(trace)
}
