//! How the units of a function's arguments hang together: one row a function.
//!
//! Each argument is a product of powers of at most three unknown dimensions, X, Y and Z, and of the second; what is
//! known of some arguments tells the others, and the value. A regulator that turns X into Y has `Kp` in Y/X and `Ki` in
//! Y/(X·s); an orifice Δp = C²·Q·√(Q² + Q0²) has C in the root of a pressure over a flow. Arguments stand in the order
//! of the function's form, under its names; those of the table of functions have none.

use crate::quantity::Formula;
use std::collections::HashMap;
use std::sync::LazyLock;

/// A function's row.
pub(super) struct Agreement {
    /// Its name.
    pub name: &'static str,
    /// The names of its arguments and what each is.
    pub arguments: &'static [(&'static str, Formula)],
    /// What its value is.
    pub result: Formula,
    /// How its arguments are written.
    pub form: Form,
}

/// How arguments are written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// One after the other, or by name.
    Plain,
    /// `pwl(t0, y0; t1, y1; …)`: each row has all arguments.
    Rows,
    /// `table(x, [x0, y0; x1, y1; …])`: the first argument, then rows of all arguments.
    Table,
    /// `tf([b1, b0], [a1, a0], x)`: two polynomials in descending powers of the Laplace variable, in 1/s, then the input.
    /// The coefficient of sⁿ is in the units of its argument times sⁿ.
    Transfer,
}

/// Xᵃ·Yᵇ·sᶜ
const fn q(x: i8, y: i8, seconds: i8) -> Formula {
    Formula { unknowns: [2 * x, 2 * y, 0], seconds: 2 * seconds }
}

const ONE: Formula = q(0, 0, 0);
const SECOND: Formula = q(0, 0, 1);
const RATE: Formula = q(0, 0, -1);
const X: Formula = q(1, 0, 0);
const Y: Formula = q(0, 1, 0);
const X_OVER_Y: Formula = q(1, -1, 0);
const Y_OVER_X: Formula = q(-1, 1, 0);

type Arguments = &'static [(&'static str, Formula)];

const fn row(name: &'static str, arguments: Arguments, result: Formula) -> Agreement {
    Agreement { name, arguments, result, form: Form::Plain }
}

/// A function of a pure number.
const fn pure(name: &'static str) -> Agreement {
    row(name, &[("", ONE)], ONE)
}

/// Every function whose arguments have units, one row each.
pub(super) const AGREEMENTS: &[Agreement] = &[
    // Functions of the table.
    row("abs", &[("", X)], X),
    row("sign", &[("", X)], ONE),
    row("sqrt", &[("", X)], Formula { unknowns: [1, 0, 0], seconds: 0 }),
    pure("exp"),
    pure("ln"),
    pure("log10"),
    pure("sin"),
    pure("cos"),
    pure("tan"),
    pure("asin"),
    pure("acos"),
    pure("atan"),
    row("atan2", &[("", X), ("", X)], ONE),
    pure("sinh"),
    pure("cosh"),
    pure("tanh"),
    pure("asinh"),
    pure("acosh"),
    pure("atanh"),
    row("min", &[("", X), ("", X)], X),
    row("max", &[("", X), ("", X)], X),
    row("clamp", &[("", X), ("", X), ("", X)], X),
    pure("floor"),
    row("mod", &[("", X), ("", X)], X),
    // Tables.
    Agreement { name: "table", arguments: &[("", X), ("", Y)], result: Y, form: Form::Table },
    // Waveforms.
    row("step", &[("t0", SECOND), ("before", Y), ("after", Y)], Y),
    row("ramp", &[("t0", SECOND), ("slope", q(0, 1, -1))], Y),
    row(
        "pulse",
        &[
            ("low", Y),
            ("high", Y),
            ("delay", SECOND),
            ("rise", SECOND),
            ("fall", SECOND),
            ("width", SECOND),
            ("period", SECOND),
        ],
        Y,
    ),
    row(
        "sine",
        &[
            ("offset", Y),
            ("amplitude", Y),
            ("frequency", RATE),
            ("delay", SECOND),
            ("damping", RATE),
            ("phase", ONE),
        ],
        Y,
    ),
    Agreement { name: "pwl", arguments: &[("", SECOND), ("", Y)], result: Y, form: Form::Rows },
    row("noise", &[("seed", ONE), ("rms", Y), ("dt", SECOND)], Y),
    // Functions with memory.
    row("integ", &[("x", X), ("ic", q(1, 0, 1))], q(1, 0, 1)),
    row("lag", &[("x", X), ("tau", SECOND), ("ic", X)], X),
    row("leadlag", &[("x", X), ("t_lead", SECOND), ("t_lag", SECOND)], X),
    row("der", &[("x", X), ("tau", SECOND)], q(1, 0, -1)),
    row(
        "pi",
        &[
            ("x", X),
            ("Kp", Y_OVER_X),
            ("Ki", q(-1, 1, -1)),
            ("lo", Y),
            ("hi", Y),
            ("Kaw", RATE),
            ("z0", Y),
        ],
        Y,
    ),
    row(
        "pid",
        &[
            ("x", X),
            ("Kp", Y_OVER_X),
            ("Ki", q(-1, 1, -1)),
            ("Kd", q(-1, 1, 1)),
            ("tau", SECOND),
            ("lo", Y),
            ("hi", Y),
            ("Kaw", RATE),
            ("z0", Y),
        ],
        Y,
    ),
    Agreement {
        name: "tf",
        arguments: &[
            ("num", Formula { unknowns: [-2, 2, 2], seconds: 0 }),
            ("den", Formula { unknowns: [0, 0, 2], seconds: 0 }),
            ("x", X),
        ],
        result: Y,
        form: Form::Transfer,
    },
    row("delay", &[("x", X), ("T", SECOND)], X),
    row("sample", &[("x", X), ("T", SECOND)], X),
    row("rate", &[("x", X), ("up", q(1, 0, -1)), ("down", q(1, 0, -1)), ("tau", SECOND)], X),
    row("hysteresis", &[("x", X), ("low", X), ("high", X)], ONE),
    row("compare", &[("a", X), ("b", X)], ONE),
    row("pwm", &[("duty", ONE), ("f", RATE)], ONE),
    // Ready laws: X an effort, Y a flow.
    row("orifice", &[("e", X), ("C", Formula { unknowns: [1, -2, 0], seconds: 0 }), ("Q0", Y)], Y),
    row("check", &[("e", X), ("Ron", X_OVER_Y), ("Roff", X_OVER_Y), ("width", X)], Y),
    row(
        "relief",
        &[("e", X), ("limit", X), ("Ron", X_OVER_Y), ("Roff", X_OVER_Y), ("width", X)],
        Y,
    ),
    row("coulomb", &[("f", X), ("F", Y), ("f_break", X)], Y),
];

/// The row of a name.
pub(super) fn agreement(name: &str) -> Option<&'static Agreement> {
    static BY_NAME: LazyLock<HashMap<&str, &Agreement>> =
        LazyLock::new(|| AGREEMENTS.iter().map(|row| (row.name, row)).collect());
    BY_NAME.get(name).copied()
}

impl Agreement {
    /// Whether it takes pure numbers alone.
    pub fn is_pure(&self) -> bool {
        self.form == Form::Plain && self.arguments.iter().all(|(_, formula)| *formula == ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::super::functions::CALLS;
    use super::*;
    use crate::expr::FUNCTIONS;

    #[test]
    fn every_function_has_a_row_with_its_arguments() {
        for function in
            FUNCTIONS.iter().filter(|row| !matches!(row.name, "abspow" | "signpow" | "realpow"))
        {
            let row = agreement(function.name).unwrap_or_else(|| panic!("{}", function.name));
            assert_eq!(row.arguments.len(), function.value.arguments(), "{}", function.name);
        }
        for signature in CALLS {
            let row = agreement(signature.name).unwrap_or_else(|| panic!("{}", signature.name));
            let names: Vec<&str> = signature.arguments.iter().map(|(name, _)| *name).collect();
            let own: Vec<&str> = row.arguments.iter().map(|(name, _)| *name).collect();
            assert!(row.form != Form::Plain || own == names, "{}: {own:?}", signature.name);
        }
        assert_eq!(agreement("exp").map(Agreement::is_pure), Some(true));
        assert_eq!(agreement("abs").map(Agreement::is_pure), Some(false));
    }
}
