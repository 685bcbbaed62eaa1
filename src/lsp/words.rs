//! What is said of the words of the language: kinds, functions, words of statements. One row one word.

/// The law of each kind of element; a kind with an M before it has the same.
pub const LAWS: &[(&str, &str)] = &[
    ("0", "common effort; the flows add up to 0, counted in by half arrows that point in"),
    ("1", "common flow; the efforts add up to 0, counted in by half arrows that point in"),
    ("Se", "e = value, whatever flows"),
    ("Sf", "f = value, whatever the effort"),
    ("R", "e = R·f, or a law `R:name(e = …f…)`, `R:name(f = …e…)`"),
    (
        "C",
        "e = q/C with q = ∫f dt, or a law `C:name(e = …q…)`, `C:name(q = …e…)`, or the rate form `C:name(der(e) = …f…)`; starts at `q0 =` or `e0 =`",
    ),
    (
        "I",
        "f = p/I with p = ∫e dt, or a law `I:name(f = …p…)`, `I:name(p = …f…)`, or the rate form `I:name(der(f) = …e…)`; starts at `p0 =` or `f0 =`",
    ),
    (
        "IC",
        "a field of ports that store q and ports that store p: numbered laws, as `IC:coil(f1 = p1/L(q2), e2 = …)`",
    ),
    ("TF", "ratio r: e1 = r·e2, f2 = r·f1; `gain = g`: e2 = g·e1, f1 = g·f2"),
    ("GY", "ratio r: e1 = r·f2, e2 = r·f1; `gain = g`: f1 = g·e2, f2 = g·e1"),
    ("De", "f = 0: measures the effort, `e(name)`"),
    ("Df", "e = 0: measures the flow, `f(name)`"),
];

/// What each function gives.
pub const MEANINGS: &[(&str, &str)] = &[
    ("e", "the effort of a 0-junction, an element, a port or a bond `e(a -> b)`"),
    ("f", "the flow of a 1-junction, an element (into it), a port or a bond `f(a -> b)`"),
    ("q", "what a compliance stores: q = ∫f dt"),
    ("p", "what an inertia stores: p = ∫e dt"),
    ("power", "e·f of an element (into it), a source (out of it), a port or a bond"),
    ("abs", "|x|"),
    ("sign", "−1, 0 or 1"),
    ("sqrt", "√x"),
    ("exp", "eˣ"),
    ("ln", "the natural logarithm"),
    ("log10", "the logarithm to base 10"),
    ("sin", "the sine of an angle in radians"),
    ("cos", "the cosine of an angle in radians"),
    ("tan", "the tangent of an angle in radians"),
    ("asin", "the angle in radians whose sine is x"),
    ("acos", "the angle in radians whose cosine is x"),
    ("atan", "the angle in radians whose tangent is x"),
    ("atan2", "the angle in radians of the point (x, y): atan2(y, x)"),
    ("sinh", "the hyperbolic sine"),
    ("cosh", "the hyperbolic cosine"),
    ("tanh", "the hyperbolic tangent"),
    ("asinh", "the inverse of sinh"),
    ("acosh", "the inverse of cosh"),
    ("atanh", "the inverse of tanh"),
    ("min", "the smaller of two"),
    ("max", "the larger of two"),
    ("clamp", "x, held between lo and hi"),
    ("floor", "the largest whole number not above x"),
    ("mod", "the rest of x by y, with the sign of y"),
    ("abspow", "|x|^y"),
    ("signpow", "|x|^y with the sign of x"),
    ("realpow", "the real part of x^y"),
    ("sum", "a sum over whole numbers: sum(k in 1..N, x[k])"),
    ("step", "`before` until t0, then `after`"),
    ("ramp", "0 until t0, then slope·(t − t0)"),
    ("pulse", "a periodic pulse, as SPICE's PULSE; a rise or fall of 0 is an exact jump"),
    ("sine", "offset + amplitude·exp(−damping·(t − delay))·sin(2π·frequency·(t − delay) + phase)"),
    ("pwl", "straight lines between points over time; two equal times make a jump"),
    ("noise", "random values, normally distributed, each held for dt"),
    ("table", "straight lines between points over x, holding the end values"),
    ("integ", "y' = x, y(0) = ic"),
    ("lag", "tau·y' = x − y, starting at ic, else at x"),
    ("leadlag", "Y/X = (1 + t_lead·s)/(1 + t_lag·s)"),
    ("der", "the derivative of x behind a lag: tau·z' = x − z, y = z'"),
    ("pi", "u = Kp·x + z, y = clamp(u, lo, hi), z' = Ki·x + Kaw·(y − u)"),
    ("pid", "as `pi`, with u = Kp·x + z + Kd·der(x, tau)"),
    ("tf", "a transfer function, coefficients by falling powers of s"),
    ("delay", "x, T seconds ago"),
    ("sample", "x, taken at 0, T, 2T, … and held"),
    ("rate", "x, changing no faster than up and down"),
    ("hysteresis", "1 from x rising above high until it falls below low, else 0"),
    ("compare", "1 where a > b, else 0"),
    ("pwm", "1 while frac(f·t) < duty, else 0"),
    ("orifice", "the flow through an orifice: the inverse of e = C²·f·√(f² + Q0²)"),
    ("check", "the flow of a check valve: 1/Ron for e > 0, 1/Roff for e < 0, smooth over width"),
    ("relief", "the flow of a relief valve that opens beyond ±limit, smooth over width"),
    ("coulomb", "dry friction: F·tanh(f/f_break)"),
];

/// What each word that begins a statement declares, and its form.
pub const WORDS: &[(&str, &str, &str)] = &[
    ("param", "param NAME = VALUE \"description\"", "A value that does not change during a run."),
    ("signal", "signal NAME = EXPRESSION", "A value over time that carries no power."),
    (
        "input",
        "input NAME, …",
        "A signal that is given from outside: by an instance, or by `drive`.",
    ),
    ("output", "output NAME, …", "A signal that can be read from outside, as `instance.name`."),
    ("port", "port in|out NAME : DOMAIN", "A place where one bond enters or leaves a model."),
    ("model", "model NAME(PARAMETER = DEFAULT, …) { … }", "A kind of one's own."),
    ("import", "import \"FILE.bg\"", "Makes the models of another file known here."),
    ("for", "for k in 1..N { … }", "Repeats what is declared with an index."),
    ("if", "if CONDITION { … } else { … }", "Decided while the graph is built."),
    (
        "drive",
        "drive INPUT = EXPRESSION",
        "What an input gets when nothing else is connected to it.",
    ),
    (
        "simulate",
        "simulate until TIME step TIME",
        "How long a run lasts, and how often a row is written.",
    ),
    ("options", "options KEY = VALUE, …", "Options of the solver."),
    ("observe", "observe EXPRESSION in UNIT as \"NAME\", …", "The columns of the result."),
    (
        "loop",
        "loop SIGNAL: CONTROLLED follows REFERENCE, bandwidth W, margin PHI",
        "What a regulator is for.",
    ),
];

/// The law of a kind.
pub fn law(kind: &str) -> Option<&'static str> {
    let find = |kind: &str| LAWS.iter().find(|(name, _)| *name == kind).map(|(_, law)| *law);
    find(kind).or_else(|| find(kind.strip_prefix('M')?))
}

/// What a function gives.
pub fn meaning(function: &str) -> Option<&'static str> {
    MEANINGS.iter().find(|(name, _)| *name == function).map(|(_, meaning)| *meaning)
}

/// Every function that expressions may call, as it is called: `lag(x, tau, [ic])`.
pub fn functions() -> Vec<(&'static str, String)> {
    let arguments = |number| match number {
        1 => "x",
        2 => "x, y",
        _ => "x, lo, hi",
    };
    let readings = crate::bond::elaborate::READINGS.iter();
    let readings = readings.map(|name| (*name, format!("{name}(element)")));
    let plain = crate::expr::functions::FUNCTIONS.iter();
    let plain =
        plain.map(|row| (row.name, format!("{}({})", row.name, arguments(row.value.arguments()))));
    let sum = ("sum", "sum(k in 1..N, x[k])".to_string());
    readings.chain(plain).chain([sum]).chain(crate::bond::elaborate::forms()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bond::elements::ELEMENTS;
    use crate::bond::syntax::STATEMENT_WORDS;

    #[test]
    fn every_word_has_its_row() {
        for row in ELEMENTS {
            assert!(law(row.kind).is_some(), "the kind {} has no row", row.kind);
        }
        for (name, form) in functions() {
            assert!(meaning(name).is_some(), "the function {form} has no row");
        }
        for word in STATEMENT_WORDS {
            assert!(WORDS.iter().any(|(name, ..)| name == word), "the word {word} has no row");
        }
    }
}
