//! What a run is asked for: span, rows, tolerances, method. Every option is a row of [`OPTIONS`].

use super::Method;
use crate::circuit::{Analysis, Circuit};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// When rows are wanted.
#[derive(Clone, Debug, PartialEq)]
pub enum Interval {
    /// At every accepted step, on both sides of jumps, and so often between that straight lines stay within reltol.
    Steps,
    /// At 0, T, 2·T … and at the end.
    Grid(f64),
    /// At these times.
    Times(Vec<f64>),
}

/// What absolute tolerances mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// Per unknown: reltol times its magnitude in a pilot pass, at most its nominal value and at least a hundredth of
    /// that; without a nominal value vntol or abstol, but no more than 1e-3·reltol of the magnitude.
    Scaled,
    /// vntol for voltages and abstol for currents, as they stand.
    Spice,
}

/// Called with the part of the run that is done, 0 to 1.
pub type Progress = Arc<dyn Fn(f64) + Send + Sync>;

/// All that a transient run is asked for.
#[derive(Clone)]
pub struct Settings {
    /// First time that rows are wanted for, s.
    pub start: f64,
    /// End of the run, s.
    pub stop: f64,
    /// The step that `.tran` names, s: the width of emitted rises and a first guess; never a step limit.
    pub step: f64,
    /// Start from the stated initial values instead of an operating point.
    pub uic: bool,
    /// When rows are wanted.
    pub rows: Interval,
    /// Whether those that follow steps are to stand wherever a line would not be straight; otherwise the last one alone.
    pub between: bool,
    /// Relative tolerance of one step.
    pub reltol: f64,
    /// Absolute tolerance of currents, A.
    pub abstol: f64,
    /// Absolute tolerance of voltages, V.
    pub vntol: f64,
    /// What absolute tolerances mean.
    pub tolerance: Tolerance,
    /// Largest step, s.
    pub hmax: Option<f64>,
    /// First step, s.
    pub h0: Option<f64>,
    /// Integration method.
    pub method: Method,
    /// Which value a row of a grid or list holds at a jump.
    pub jumps: Side,
    /// Ends the run when it becomes true.
    pub interrupt: Option<Arc<AtomicBool>>,
    /// Told of progress.
    pub progress: Option<Progress>,
}

/// A side of a jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The value that is arrived at: at 0 that of the operating point. What simulators write whose rows are their steps.
    Before,
    /// The value that goes on.
    After,
}

impl fmt::Debug for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Settings")
            .field("start", &self.start)
            .field("stop", &self.stop)
            .field("uic", &self.uic)
            .field("rows", &self.rows)
            .field("reltol", &self.reltol)
            .field("hmax", &self.hmax)
            .field("method", &self.method)
            .finish_non_exhaustive()
    }
}

impl Settings {
    /// From 0 to `stop` with given initial values, rows at steps, reltol 1e-3.
    pub fn new(stop: f64) -> Settings {
        Settings {
            start: 0.0,
            stop,
            step: stop / 50.0,
            uic: true,
            rows: Interval::Steps,
            between: true,
            reltol: 1e-3,
            abstol: 1e-12,
            vntol: 1e-6,
            tolerance: Tolerance::Scaled,
            hmax: None,
            h0: None,
            method: Method::Auto,
            jumps: Side::After,
            interrupt: None,
            progress: None,
        }
    }

    /// As a circuit's last `.tran`, options and grid say. `native`: the circuit comes from a bond graph, so that
    /// reltol is 1e-6 where nothing is said. `None` when there is no `.tran` or an option makes no sense.
    pub fn of(circuit: &Circuit, native: bool, d: &mut Vec<Diagnostic>) -> Option<Settings> {
        let transient = circuit.analyses.iter().rev().find_map(|analysis| match *analysis {
            Analysis::Transient { step, stop, start, hmax, uic } => {
                Some(Settings { start, step, hmax, uic, ..Settings::new(stop) })
            }
            _ => None,
        });
        let Some(mut settings) = transient else {
            d.push(
                Diagnostic::error("E0806", Span::NONE, "there is no transient analysis to run")
                    .help("add `.tran step stop`, or in a bond graph `simulate until 1 s`"),
            );
            return None;
        };
        if native {
            settings.reltol = 1e-6;
        }
        if let Some(grid) = circuit.grid {
            settings.rows = Interval::Grid(grid);
        }
        let before = d.len();
        for (key, value) in &circuit.options {
            if let Err(diagnostic) = settings.set(key, value) {
                d.push(*diagnostic);
            }
        }
        (!crate::diagnostic::has_errors(&d[before..])).then_some(settings)
    }

    /// Sets one option by its name, in any case.
    ///
    /// # Errors
    /// `E0807` for a value that makes no sense, the warning `W0801` for a name that is not known.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), Box<Diagnostic>> {
        let Some(row) = OPTIONS.iter().find(|row| row.name.eq_ignore_ascii_case(key)) else {
            if IGNORED.iter().any(|name| name.eq_ignore_ascii_case(key)) {
                return Ok(());
            }
            let message = format!("option `{key}` is not known, and is ignored");
            let known: Vec<&str> = OPTIONS.iter().map(|row| row.name).collect();
            let warning = Diagnostic::warning("W0801", Span::NONE, message);
            return Err(Box::new(warning.because(format!("known are {}", known.join(", ")))));
        };
        if (row.set)(self, value.trim()) {
            return Ok(());
        }
        let message = format!("option `{key}` cannot be `{value}`");
        let error = Diagnostic::error("E0807", Span::NONE, message);
        Err(Box::new(error.because(format!("{} is {}", row.name, row.meaning))))
    }
}

/// One option.
pub struct OptionRow {
    /// Its name in `options` and `.options`.
    pub name: &'static str,
    /// What it is and which values it takes.
    pub meaning: &'static str,
    /// Sets it; `false` when the value makes no sense.
    set: fn(&mut Settings, &str) -> bool,
}

/// Every option of a run, one row each.
#[rustfmt::skip]
pub const OPTIONS: &[OptionRow] = &[
    OptionRow { name: "reltol", meaning: "the relative tolerance of one step, above 0 and below 1", set: |s, v| number(v, &mut s.reltol, |r| r > 0.0 && r < 1.0) },
    OptionRow { name: "abstol", meaning: "the absolute tolerance of currents, above 0", set: |s, v| number(v, &mut s.abstol, |a| a > 0.0) },
    OptionRow { name: "vntol", meaning: "the absolute tolerance of voltages, above 0", set: |s, v| number(v, &mut s.vntol, |a| a > 0.0) },
    OptionRow { name: "tol", meaning: "`scaled` (absolute tolerances by magnitude) or `spice` (vntol and abstol as they stand)", set: set_tolerance },
    OptionRow { name: "hmax", meaning: "the largest step in seconds, above 0, or `auto`", set: |s, v| time(v, &mut s.hmax) },
    OptionRow { name: "h0", meaning: "the first step in seconds, above 0, or `auto`", set: |s, v| time(v, &mut s.h0) },
    OptionRow { name: "jumps", meaning: "`after` or `before`: which value a row of a grid or list holds at a jump", set: set_jumps },
    OptionRow { name: "method", meaning: "`auto`, `exponential`, `rodas5p`, `rodas4`, `trbdf2`, `trap` or `gear`", set: set_method },
];

/// Options of other simulators that have no meaning here and do no harm.
const IGNORED: &[&str] = &[
    "acct",
    "noacct",
    "nopage",
    "list",
    "node",
    "opts",
    "nomod",
    "temp",
    "seed",
    "smoothbsrc",
    "rcconst",
    "tnom",
    "gmin",
    "maxord",
    "itl1",
    "itl2",
    "itl3",
    "itl4",
    "itl5",
    "itl6",
    "trtol",
    "chgtol",
    "pivtol",
    "pivrel",
    "limpts",
    "numdgt",
    "cptime",
    "limtim",
    "noopiter",
    "gminsteps",
    "srcsteps",
    "rseries",
    "klu",
    "sparse",
    "xmu",
    "savecurrents",
    "interp",
    "plotwinsize",
];

fn number(text: &str, target: &mut f64, valid: impl Fn(f64) -> bool) -> bool {
    match parse(text) {
        Some(value) if value.is_finite() && valid(value) => {
            *target = value;
            true
        }
        _ => false,
    }
}

fn time(text: &str, target: &mut Option<f64>) -> bool {
    if text.eq_ignore_ascii_case("auto") {
        *target = None;
        return true;
    }
    let mut value = 0.0;
    let valid = number(text, &mut value, |t| t > 0.0);
    if valid {
        *target = Some(value);
    }
    valid
}

fn set_tolerance(settings: &mut Settings, text: &str) -> bool {
    settings.tolerance = match text.to_ascii_lowercase().as_str() {
        "scaled" | "auto" => Tolerance::Scaled,
        "spice" => Tolerance::Spice,
        _ => return false,
    };
    true
}

fn set_jumps(settings: &mut Settings, text: &str) -> bool {
    settings.jumps = match text.to_ascii_lowercase().as_str() {
        "after" => Side::After,
        "before" => Side::Before,
        _ => return false,
    };
    true
}

fn set_method(settings: &mut Settings, text: &str) -> bool {
    let method = Method::named(text);
    if let Some(method) = method {
        settings.method = method;
    }
    method.is_some()
}

/// A number with SPICE's suffixes; letters after a suffix are a unit.
fn parse(text: &str) -> Option<f64> {
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let letters = text.find(|c: char| c.is_ascii_alphabetic())?;
    let (digits, unit) = text.split_at(letters);
    let unit = unit.to_ascii_lowercase();
    let factor = [
        ("meg", 1e6),
        ("mil", 25.4e-6),
        ("t", 1e12),
        ("g", 1e9),
        ("k", 1e3),
        ("m", 1e-3),
        ("u", 1e-6),
        ("n", 1e-9),
        ("p", 1e-12),
        ("f", 1e-15),
        ("s", 1.0),
    ];
    let (_, factor) = factor.iter().find(|(suffix, _)| unit.starts_with(suffix))?;
    digits.trim().parse::<f64>().ok().map(|value| value * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_set_by_name_and_checked() {
        let mut settings = Settings::new(1.0);
        for (key, value) in [
            ("RELTOL", "1e-8"),
            ("hmax", "10us"),
            ("method", "Trap"),
            ("tol", "spice"),
            ("vntol", "1u"),
        ] {
            settings.set(key, value).unwrap();
        }
        assert_eq!(settings.reltol, 1e-8);
        assert!((settings.hmax.unwrap() - 1e-5).abs() < 1e-18);
        assert_eq!(settings.method, Method::Trapezoidal);
        assert_eq!(settings.tolerance, Tolerance::Spice);
        settings.set("hmax", "auto").unwrap();
        assert_eq!(settings.hmax, None);
        for (key, value, code) in [
            ("reltol", "0", "E0807"),
            ("reltol", "nan", "E0807"),
            ("method", "euler", "E0807"),
            ("hmax", "-1", "E0807"),
            ("colour", "red", "W0801"),
        ] {
            assert_eq!(settings.set(key, value).unwrap_err().code, code, "{key}={value}");
        }
        assert!(settings.set("gmin", "1e-12").is_ok());
    }
}
