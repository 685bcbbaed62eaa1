//! The pictures of all shipped models: what can be read in them, and that those in `docs/pictures` are as the program
//! draws them today. `BONDSPICE_REWRITE=1 cargo test --test tools drawings` draws them anew.

use bondspice::bond::causality;
use bondspice::bond::elaborate::Overrides;
use bondspice::circuit::{Circuit, NodeId};
use bondspice::cli::draw::circuit_of;
use bondspice::cli::pipeline;
use bondspice::cli::session::{Global, Session};
use bondspice::draw::bond_graph::{MOST, Placed, Sketch, paint, place, sketch};
use bondspice::draw::grid::{Crossing, crosses};
use bondspice::draw::picture::{Ink, Picture, Room, Shape};
use bondspice::draw::plot::{self, Axis, Curve, Panel};
use bondspice::draw::{schematic, svg};
use bondspice::source::{SourceMap, loader};
use bondspice::trace::{Trace, formats};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every shipped model that is a graph of its own.
fn models() -> Vec<(String, PathBuf)> {
    let mut found = vec![];
    for folder in ["models", "models/textbook"] {
        for entry in std::fs::read_dir(root().join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|ending| ending == "bg") {
                found.push((path.file_stem().unwrap().to_string_lossy().into_owned(), path));
            }
        }
    }
    found.sort();
    found
}

/// A stored picture that must be what the program draws.
pub fn holds(name: &str, drawn: &str, stale: &mut Vec<String>) {
    let path = root().join("docs/pictures").join(name);
    if std::env::var_os("BONDSPICE_REWRITE").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, drawn).unwrap();
    } else if std::fs::read_to_string(&path).ok().as_deref() != Some(drawn) {
        stale.push(name.to_string());
    }
}

/// Words over words, words out of the picture, lines through words of their own elements.
pub fn trouble(picture: &Picture) -> Vec<String> {
    let mut found = vec![];
    let page = Room { left: 0.0, top: 0.0, right: picture.width, bottom: picture.height };
    let words: Vec<(&str, Room)> = picture
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            Shape::Words { words, .. } => Some((words.text.as_str(), words.room())),
            _ => None,
        })
        .collect();
    for (k, (text, room)) in words.iter().enumerate() {
        for (other, place) in &words[k + 1..] {
            // The lines of one title are as close as lines are.
            if room.grown(-0.5).overlaps(&place.grown(-0.5)) {
                found.push(format!("`{text}` over `{other}`"));
            }
        }
    }
    for shape in &picture.shapes {
        let room = shape.room();
        if room.left < page.left
            || room.top < page.top
            || room.right > page.right
            || room.bottom > page.bottom
        {
            found.push(format!("out of the picture: {shape:?}"));
        }
        if let Shape::Line { points, title, .. } = shape
            && !title.is_empty()
        {
            for (text, room) in &words {
                if room.grown(-0.5).cuts(points[0], points[1]).is_some() {
                    found.push(format!("{title} through `{text}`"));
                }
            }
        }
    }
    found
}

fn crossings(sketch: &Sketch, placed: &Placed) -> usize {
    let mut count = 0;
    for (k, one) in sketch.links.iter().enumerate() {
        for other in &sketch.links[k + 1..] {
            let ends = [one.from, one.to, other.from, other.to].map(|node| placed.cells[node]);
            let shared =
                [one.from, one.to].iter().any(|node| [other.from, other.to].contains(node));
            let meet = crosses(ends[0], ends[1], ends[2], ends[3]);
            count += usize::from(meet == Crossing::Along || (meet == Crossing::At && !shared));
        }
    }
    count
}

/// Bonds that cross in the pictures of models in which any do; all others have none.
const CROSSINGS: &[(&str, usize)] = &[("eha_two_line", 2)];

#[test]
fn bond_graphs_of_all_models_can_be_read_and_are_in_the_documentation() {
    let (mut bad, mut stale) = (vec![], vec![]);
    let all = models();
    assert!(all.len() > 40, "{} models", all.len());
    for (name, path) in all {
        let mut map = SourceMap::default();
        let mut d = vec![];
        let file = loader::load(&path.to_string_lossy(), &mut map).unwrap();
        let graph = pipeline::graph(&mut map, file, &Overrides::default(), &mut d).unwrap();
        let causality = causality::analyse(&graph, &mut d);
        let mut sketched = sketch(&graph, &causality, usize::MAX);
        while sketched.nodes.len() > MOST {
            sketched = sketch(&graph, &causality, sketched.depth - 1);
        }
        let placed = place(&sketched);
        let picture = paint(&graph, &sketched, &placed);
        bad.extend(trouble(&picture).into_iter().map(|what| format!("{name}: {what}")));
        let allowed = CROSSINGS.iter().find(|row| row.0 == name).map_or(0, |row| row.1);
        let found = crossings(&sketched, &placed);
        if found != allowed {
            bad.push(format!("{name}: {found} crossings, {allowed} in the table"));
        }
        holds(&format!("{name}.svg"), &svg::write(&picture), &mut stale);
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    assert!(stale.is_empty(), "not as drawn today (BONDSPICE_REWRITE=1 rewrites): {stale:?}");
}

/// Reads the circuit back from the drawing: what wires join must be the circuit's nodes, all of them and no others.
fn wrong_connections(circuit: &Circuit, drawn: &schematic::Schematic) -> Vec<String> {
    let mut points: Vec<(f64, f64)> = vec![];
    let ends = drawn.devices.iter().flat_map(|d| [d.ends.0, d.ends.1]);
    let wires = drawn.wires.iter().flat_map(|(a, b)| [*a, *b]);
    for point in ends.chain(wires).chain(drawn.grounds.iter().copied()) {
        if !points.contains(&point) {
            points.push(point);
        }
    }
    let mut set: Vec<usize> = (0..points.len()).collect();
    for (a, b) in &drawn.wires {
        // A wire joins every end that lies on it; wires that only cross are not joined.
        let on = |p: &(f64, f64)| {
            let along = (a.0.min(b.0)..=a.0.max(b.0)).contains(&p.0)
                && (a.1.min(b.1)..=a.1.max(b.1)).contains(&p.1);
            along && ((b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0)).abs() < 1e-6
        };
        let joined: Vec<usize> = (0..points.len()).filter(|k| on(&points[*k])).collect();
        let names: Vec<usize> = joined.iter().map(|k| set[*k]).collect();
        let to = names[0];
        set.iter_mut().filter(|name| names.contains(name)).for_each(|name| *name = to);
    }
    let place = |p: &(f64, f64)| set[points.iter().position(|q| q == p).unwrap()];
    let mut node_of: BTreeMap<usize, NodeId> = BTreeMap::new();
    let mut found = vec![];
    for ground in &drawn.grounds {
        node_of.insert(place(ground), NodeId(0));
    }
    let mut parts: BTreeMap<NodeId, usize> = BTreeMap::new();
    for device in &drawn.devices {
        let own = &circuit.devices[device.device.0 as usize];
        for (node, end) in own.nodes.iter().zip([device.ends.0, device.ends.1]) {
            let part = place(&end);
            if *node_of.entry(part).or_insert(*node) != *node {
                found.push(format!("{} is joined to another node", own.name));
            }
            // Ground is drawn several times.
            if node.0 != 0 && *parts.entry(*node).or_insert(part) != part {
                found.push(format!("{} hangs loose", own.name));
            }
        }
    }
    found
}

#[test]
fn circuits_of_all_models_can_be_read_and_are_in_the_documentation() {
    let (mut bad, mut stale) = (vec![], vec![]);
    for (name, path) in models() {
        let mut session = Session::new(Global { quiet: true, ..Global::default() });
        let mut d = vec![];
        let file = session.load(&path.to_string_lossy()).unwrap();
        let overrides = Overrides::default();
        let (circuit, kept) = circuit_of(&mut session, file, &overrides, &mut d).unwrap();
        let placed = schematic::place(&circuit, &|id| kept[id.0 as usize]);
        let placed = placed.unwrap_or_else(|devices| panic!("{name}: {devices} devices"));
        let picture = schematic::paint(&placed);
        bad.extend(
            wrong_connections(&circuit, &placed).into_iter().map(|what| format!("{name}: {what}")),
        );
        bad.extend(trouble(&picture).into_iter().map(|what| format!("{name}: {what}")));
        // Devices keep clear of each other, and no wire runs through one or through words.
        let words = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Words { words, .. } if words.text != "A" => {
                Some((words.text.clone(), words.room()))
            }
            _ => None,
        });
        let body = |d: &schematic::Placed| {
            let (a, b) = d.ends;
            let middle = ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0);
            Room { left: middle.0, top: middle.1, right: middle.0, bottom: middle.1 }.grown(14.0)
        };
        let bodies: Vec<Room> = placed.devices.iter().map(body).collect();
        for (k, one) in bodies.iter().enumerate() {
            for other in &bodies[k + 1..] {
                if one.overlaps(other) {
                    bad.push(format!("{name}: two devices in one place"));
                }
            }
            for (a, b) in &placed.wires {
                if one.cuts(*a, *b).is_some() {
                    bad.push(format!("{name}: a wire through {}", placed.devices[k].words.0));
                }
            }
        }
        // The picture is the schematic moved by a margin: the first wire or device tells by how much.
        let offset = picture.shapes.iter().find_map(|shape| match (shape, placed.wires.first()) {
            (Shape::Line { points, .. }, Some((a, _))) => {
                Some((points[0].0 - a.0, points[0].1 - a.1))
            }
            _ => None,
        });
        if let Some((x, y)) = offset {
            for (text, room) in words {
                for (a, b) in &placed.wires {
                    let (a, b) = ((a.0 + x, a.1 + y), (b.0 + x, b.1 + y));
                    if room.grown(-0.5).cuts(a, b).is_some() {
                        bad.push(format!("{name}: a wire through `{text}`"));
                    }
                }
            }
        }
        holds(&format!("{name}.circuit.svg"), &svg::write(&picture), &mut stale);
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    assert!(stale.is_empty(), "not as drawn today (BONDSPICE_REWRITE=1 rewrites): {stale:?}");
}

/// A stored picture that may differ by what rounding does to a simulation: the same text but for numbers, those within
/// a twentieth of a unit.
fn nearly_holds(name: &str, drawn: &str, stale: &mut Vec<String>) {
    let parts = |text: &str| -> (String, Vec<f64>) {
        let is_digit = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
        let numbers = text.split(|c| !is_digit(c)).filter_map(|word| word.parse().ok());
        (text.replace(is_digit, ""), numbers.collect())
    };
    let path = root().join("docs/pictures").join(name);
    let stored = std::fs::read_to_string(path).unwrap_or_default();
    let ((words, numbers), (own, values)) = (parts(&stored), parts(drawn));
    let near = numbers.len() == values.len()
        && numbers.iter().zip(&values).all(|(a, b)| (a - b).abs() <= 0.05);
    if words != own || !near {
        holds(name, drawn, stale);
    }
}

/// What a command draws: its arguments, and the flag that takes the name of the picture.
fn drawn_by(arguments: &[&str], flag: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("picture.svg");
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondspice"));
    let output = command.current_dir(root()).args(arguments).arg(flag).arg(&file).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    std::fs::read_to_string(file).unwrap()
}

#[test]
fn plots_of_the_documentation_are_drawn_as_it_says() {
    let mut stale = vec![];
    let arguments = ["poles", "models/eha_one_line.bg", "--from", "x_ref", "--to", "x"];
    nearly_holds("poles.svg", &drawn_by(&arguments, "--plot"), &mut stale);
    let energy = ["energy", "models/drive_train.bg", "-q", "-o", "/dev/null"];
    nearly_holds("energy.svg", &drawn_by(&energy, "--plot"), &mut stale);
    nearly_holds("balance.svg", &drawn_by(&energy, "--sankey"), &mut stale);
    assert!(stale.is_empty(), "not as drawn today (BONDSPICE_REWRITE=1 rewrites): {stale:?}");
}

/// Figures 16, 17 and 18 of the paper, with its ticks, for the actuator with one line: our run of its netlist, and the
/// independent reference trajectory.
#[test]
fn the_figures_of_the_paper_are_redrawn() {
    let text = std::fs::read_to_string(root().join("models/eha_one_line.bg")).unwrap();
    // As many rows as a picture shows.
    let overrides = Overrides { step: Some("5ms".into()), ..Overrides::default() };
    let (run, _) = pipeline::run_text("eha_one_line.bg", &text, &overrides).unwrap();
    let bytes = std::fs::read(root().join("tests/reference/eha/one_line_nominal.csv")).unwrap();
    let reference = formats::read("reference.csv", &bytes).unwrap();
    let mut stale = vec![];
    // Number, title, our column, the reference's and how many of our units it is, the base, the ticks of the paper.
    for (number, title, own, theirs, unit, base, tick) in [
        (16, "pump ΔP [p.u. of 344.7 bar]", "pump pressure", "dPp", 1e-5, 344.7, 0.29),
        (17, "pump flow [p.u. of 17.86 L/min]", "pump flow", "Qp", 6e4, 17.86, 0.28),
        (18, "electrical power [p.u. of 11.11 kW]", "electrical power", "Pelec", 1e-3, 11.11, 0.09),
    ] {
        let points = |trace: &Trace, column: &str, scale: f64, each: usize| -> Vec<(f64, f64)> {
            let values = trace.column(column).unwrap();
            let rows = trace.time().iter().zip(values).step_by(each);
            rows.map(|(t, v)| (*t, v * scale / base)).collect()
        };
        let (ours, wanted) = (points(&run, own, 1.0, 1), points(&reference, theirs, unit, 5));
        assert_eq!(ours.len(), wanted.len());
        let range = wanted.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max)
            - wanted.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let error = ours.iter().zip(&wanted).map(|(a, b)| (a.1 - b.1).abs()).fold(0.0, f64::max);
        // The tolerance that the reference's own page calls fair for another tool.
        assert!(error / range < 1e-6, "figure {number}: {error}");
        let curve = |name: &str, ink: u8, width: f64, dashed: bool, points| Curve {
            name: name.into(),
            ink: Ink::Curve(ink),
            dashed,
            width,
            points,
        };
        let panel = Panel {
            x: Axis { label: "time [s]".into(), ..Axis::default() },
            y: Axis { label: title.into(), step: Some(tick), ..Axis::default() },
            curves: vec![
                curve("netlist of the bond graph, simulated", 0, 3.5, false, ours),
                curve("state equations by hand, scipy", 1, 1.3, true, wanted),
            ],
            ..Panel::default()
        };
        let name = format!("Figure {number} of the paper, redrawn for models/eha_one_line.bg");
        let picture = plot::paint(&name, &[panel]);
        let trouble = trouble(&picture);
        assert!(trouble.is_empty(), "{trouble:?}");
        nearly_holds(&format!("figure{number}.svg"), &svg::write(&picture), &mut stale);
    }
    assert!(stale.is_empty(), "not as drawn today (BONDSPICE_REWRITE=1 rewrites): {stale:?}");
}
