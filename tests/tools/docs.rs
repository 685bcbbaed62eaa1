//! Every example of the documentation runs, and every wrong one is wrong in the way that it says.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline;
use bondspice::diagnostic::Severity;
use bondspice::netlist::dialects::NGSPICE;
use bondspice::netlist::write::write;
use bondspice::source::SourceMap;
use std::path::{Path, PathBuf};

/// An example: where it stands, what stands behind its fence, and its text.
struct Example {
    place: String,
    says: String,
    text: String,
}

fn pages(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    found.sort();
    found
}

fn examples() -> Vec<Example> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![];
    for page in pages(&root.join("docs")).into_iter().chain([root.join("README.md")]) {
        let text = std::fs::read_to_string(&page).unwrap();
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        let mut open: Option<Example> = None;
        for (number, line) in text.lines().enumerate() {
            match (&mut open, line.strip_prefix("```")) {
                (None, Some(says)) => {
                    let place = format!("{name}:{}", number + 1);
                    open = Some(Example { place, says: says.to_string(), text: String::new() });
                }
                (Some(_), Some(_)) => found.extend(open.take()),
                (Some(example), None) => {
                    example.text.push_str(line);
                    example.text.push('\n');
                }
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{name}: an example is not closed");
    }
    found
}

#[test]
fn examples_run() {
    let mut run = 0;
    let mut wrong = 0;
    let mut trouble = vec![];
    for example in examples() {
        let mut words = example.says.split_whitespace();
        if words.next() != Some("bg") {
            continue;
        }
        let mut map = SourceMap::default();
        // In a folder of its own: what an example imports comes from the library.
        let file = map.add(example.place.clone() + ".bg", example.text.clone());
        let mut d = vec![];
        let overrides = Overrides::default();
        let graph = pipeline::graph(&mut map, file, &overrides, &mut d);
        if let Some(graph) = &graph {
            pipeline::causality(graph, &mut d);
        }
        if words.next() == Some("wrong") {
            wrong += 1;
            let code = words.next().unwrap_or("no code");
            let said: Vec<&str> = d.iter().map(|d| d.code).collect();
            if !said.contains(&code) {
                trouble.push(format!("{}: expected {code}, said {said:?}", example.place));
            }
            continue;
        }
        run += 1;
        let errors: Vec<_> = d.iter().filter(|d| d.severity == Severity::Error).collect();
        if !errors.is_empty() {
            trouble.push(format!("{}: {errors:#?}", example.place));
            continue;
        }
        if graph.is_some_and(|graph| graph.experiment.until.is_some())
            && let Err(d) =
                pipeline::run_text(&(example.place.clone() + ".bg"), &example.text, &overrides)
        {
            trouble.push(format!("{}: {d:#?}", example.place));
        }
    }
    assert!(trouble.is_empty(), "{}", trouble.join("\n"));
    // Guards against a change of the fences that would leave nothing to run.
    assert!(run >= 20 && wrong >= 5, "{run} examples, {wrong} wrong ones");
}

/// Decks of the documentation run without an error, wrong ones give the code that they say.
#[test]
fn decks_run() {
    let (mut run, mut wrong) = (0, 0);
    let mut trouble = vec![];
    for example in examples() {
        let mut words = example.says.split_whitespace();
        if words.next() != Some("cir") {
            continue;
        }
        let name = example.place.clone() + ".cir";
        let outcome = pipeline::run_text(&name, &example.text, &Overrides::default());
        if words.next() == Some("wrong") {
            wrong += 1;
            let code = words.next().unwrap_or("no code");
            let said: Vec<&str> = outcome.err().iter().flatten().map(|d| d.code).collect();
            if !said.contains(&code) {
                trouble.push(format!("{}: expected {code}, said {said:?}", example.place));
            }
            continue;
        }
        run += 1;
        if let Err(said) = outcome {
            trouble.push(format!("{}: {said:#?}", example.place));
        }
    }
    assert!(trouble.is_empty(), "{}", trouble.join("\n"));
    assert!(run >= 2 && wrong >= 1, "{run} decks, {wrong} wrong ones");
}

/// What a page shows of a netlist stands in that of the bond graph before it, line by line.
#[test]
fn netlists_are_those_of_their_examples() {
    let (mut bond, mut shown) = (None, 0);
    for example in examples() {
        match example.says.as_str() {
            "bg" => bond = Some(example.text),
            "netlist" => {
                let mut map = SourceMap::default();
                let file = map.add("cells.bg", bond.clone().unwrap());
                let mut d = vec![];
                let model = pipeline::model(&mut map, file, &Overrides::default(), &mut d);
                let (netlist, _) = model.unwrap().netlist(&map, &NGSPICE, false);
                let text = write(&netlist);
                let mut lines = text.lines();
                for line in example.text.lines().filter(|line| *line != "...") {
                    let found = lines.any(|own| own == line);
                    assert!(found, "{}: `{line}` is not in\n{text}", example.place);
                }
                shown += 1;
            }
            _ => {}
        }
    }
    assert!(shown >= 1);
}

#[test]
fn links_between_pages_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let all = pages(&root.join("docs")).into_iter().chain([root.join("README.md")]);
    for page in all {
        let text = std::fs::read_to_string(&page).unwrap();
        for (_, rest) in text.match_indices("](").map(|(at, _)| text.split_at(at + 2)) {
            let target = rest.split(')').next().unwrap();
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            if path.contains("://") {
                continue;
            }
            let other =
                if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            assert!(other.exists(), "{}: {target} leads nowhere", page.display());
            if anchor.is_empty() || other.is_dir() {
                continue;
            }
            let titles = std::fs::read_to_string(&other).unwrap();
            let found = titles.lines().filter(|line| line.starts_with('#')).any(|line| {
                let title = line.trim_start_matches('#').trim().to_lowercase();
                let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-');
                title.chars().filter(kept).collect::<String>().replace(' ', "-") == anchor
            });
            assert!(found, "{}: {target} names no title", page.display());
        }
    }
}
