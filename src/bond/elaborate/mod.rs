//! From what a file says to the flat graph: names, parameters, signals, elements, bonds, and what a run does.
//!
//! The order is that of what needs what: names are collected first (the order of statements never matters), bonds are
//! joined, parameters evaluated, domains follow from their units along the bonds; then laws and signals, and at last
//! what is observed. Each step goes on after an error as far as it can.

mod program;
mod scope;
mod frames;
mod expand;
mod structure;
mod parameters;
mod value;
mod reading;
mod functions;
mod call;
mod dynamics;
mod tables;
mod signals;
mod regulators;
mod laws;
mod fields;
mod agreements;
mod has_units;
mod dimensions;
mod stated;
mod domains;
mod inference;
mod clashes;
mod checks;
mod experiment;
mod observe;
mod instances;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod units_tests;
#[cfg(test)]
mod hints_tests;
#[cfg(test)]
mod unused_tests;

pub use expand::MOST_PARTS;
pub use experiment::require_drives;
pub use observe::{observables, unit_of};
pub use program::{Program, load};
pub use reading::READINGS;

use super::graph::BondGraph;
use super::syntax;
use crate::diagnostic::{Diagnostic, has_errors, merge_repeats};
use crate::source::{SourceMap, Span};

/// What the command line says instead of the file.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// `--set`: parameters and their values, `("L", "2mH")`.
    pub set: Vec<(String, String)>,
    /// `--drive`: what inputs get, `x_ref = step(0.1 s, 0 mm, 20 mm)`.
    pub drive: Vec<String>,
    /// `--observe`: a list as in the statement, or `all`.
    pub observe: Option<String>,
    /// `--until`
    pub until: Option<String>,
    /// `--step`
    pub step: Option<String>,
    /// `--option`: keys and values; they come after the file's.
    pub options: Vec<(String, String)>,
    /// `-I`: folders in which imports are looked for.
    pub folders: Vec<String>,
    /// `--dialect`: that of a netlist; guessed where none is said.
    pub dialect: Option<String>,
    /// `--confine`: the folder outside of which no file is read that a netlist names.
    pub confine: Option<String>,
    /// `--scale`: domains and their factors, later ones winning; applied to the elaborated graph.
    pub scale: Vec<(crate::quantity::Domain, f64)>,
}

/// Every function beyond those of expressions, and its form: `lag(x, tau, [ic])`.
pub fn forms() -> impl Iterator<Item = (&'static str, String)> {
    functions::CALLS.iter().map(|row| (row.name, row.form()))
}

/// Checks the models of a file that no instance is made of, as far as their bodies can be without one: parameters
/// without defaults have no values, and what depends on them is not looked at.
fn check_unused(
    program: &Program,
    map: &SourceMap,
    used: &scope::Scope<'_>,
    d: &mut Vec<Diagnostic>,
) {
    let mut found = vec![];
    let Some(mut scope) = scope::Scope::collect_unused(program, map, used, &mut found) else {
        return;
    };
    scope.join_bonds(&mut found);
    scope.evaluate_parameters(&mut found);
    scope.make_laws(&mut found);
    scope.make_signals(&[], &mut found);
    // Nothing drives its inputs, and all such models together may be more than one graph may hold.
    found.retain(|said| !matches!(said.code, "W0201" | "E0237"));
    d.extend(found);
}

/// Makes the graph of a program: its first file, and what that imports. `None` when anything was wrong; errors in `d`
/// of an earlier stage count too, since a statement that could not be read leaves a hole.
pub fn elaborate(
    program: &Program,
    map: &SourceMap,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<BondGraph> {
    let before = d.len();
    let mut set = vec![];
    for (name, text) in &overrides.set {
        let known = d.len();
        let value = syntax::parse_value(text, Span::NONE.file, d);
        for error in &mut d[known..] {
            error.notes.push(format!("in the value that was set: {name}={text}"));
        }
        set.push((name.clone(), text.clone(), value));
    }
    let mut scope = scope::Scope::collect(program, map, &set, d);
    scope.join_bonds(d);
    scope.evaluate_parameters(d);
    scope.set_run(overrides, d);
    scope.make_laws(d);
    scope.make_signals(&overrides.drive, d);
    scope.set_observed(overrides.observe.as_deref(), d);
    scope.remember_instances();
    if !has_errors(&d[before..]) {
        crate::bond::fields::check(&scope.graph, d);
        if overrides.observe.is_none() && program.observes() {
            scope.warn_of_unread(d);
        }
    }
    check_unused(program, map, &scope, d);
    merge_repeats(d, before);
    (!has_errors(d)).then_some(scope.graph)
}
