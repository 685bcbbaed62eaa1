//! Models as circuits, for tests: each `.bg` file below `models/` and what translation makes of it.

use bondspice::bond::causality::{self, Causality};
use bondspice::bond::elaborate::{self, Overrides};
use bondspice::bond::graph::BondGraph;
use bondspice::bond::{initial, scale};
use bondspice::netlist::write::write;
use bondspice::source::SourceMap;
use bondspice::translate::hierarchy::{Hierarchy, fold};
use bondspice::translate::{Translation, translate};
use std::path::{Path, PathBuf};

/// A model on its way to the circuit. Each test uses its part of it.
#[allow(dead_code)]
pub struct Translated {
    pub graph: BondGraph,
    pub causality: Causality,
    /// The flat circuit.
    pub translation: Translation,
    /// The same with instances as subcircuits.
    pub nested: Hierarchy,
}

#[allow(dead_code)]
impl Translated {
    /// The netlist's text, as it is emitted.
    pub fn text(&self) -> String {
        write(&self.nested.netlist)
    }

    /// That of the flat circuit.
    pub fn flat_text(&self) -> String {
        write(&self.translation.netlist)
    }
}

/// The folder of the repository.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every model, in order, as paths relative to `models/`.
pub fn models() -> Vec<PathBuf> {
    let folder = root().join("models");
    let mut found = vec![];
    let mut waiting = vec![folder.clone()];
    while let Some(path) = waiting.pop() {
        for entry in std::fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                // The library's files hold models for others to use, and run nothing themselves.
                if path.file_name().is_none_or(|name| name != "std") {
                    waiting.push(path);
                }
            } else if path.extension().is_some_and(|ending| ending == "bg") {
                found.push(path.strip_prefix(&folder).unwrap().to_path_buf());
            }
        }
    }
    found.sort();
    assert!(found.len() >= 20, "only {} models", found.len());
    found
}

/// Translates a model.
pub fn translated(model: &Path, overrides: &Overrides) -> Translated {
    let path = root().join("models").join(model);
    let mut map = SourceMap::default();
    let file =
        map.add(format!("models/{}", model.display()), std::fs::read_to_string(path).unwrap());
    let mut d = vec![];
    let program = elaborate::load(&mut map, file, &overrides.folders, &mut d);
    let graph = elaborate::elaborate(&program, &map, overrides, &mut d);
    let mut graph = graph.unwrap_or_else(|| panic!("{}: {d:#?}", model.display()));
    scale::scale(&mut graph, &overrides.scale);
    let causality = causality::assign(&graph, &mut d);
    let causality = causality.unwrap_or_else(|| panic!("{}: {d:#?}", model.display()));
    let initial = initial::solve(&graph, &causality, &mut d);
    let initial = initial.unwrap_or_else(|| panic!("{}: {d:#?}", model.display()));
    let translation = translate(&graph, &causality, &initial, &map, &mut d);
    let translation = translation.unwrap_or_else(|| panic!("{}: {d:#?}", model.display()));
    let nested = fold(&graph, &causality, &map, &translation);
    Translated { graph, causality, translation, nested }
}
