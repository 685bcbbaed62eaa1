//! A bond graph in the language of Graphviz, whose own tools lay it out: for graphs of any size.

use super::letters;
use super::sketch::{NodeKind, Sketch};
use crate::bond::graph::{BondGraph, Stroke};

/// Writes a sketch.
pub fn write(graph: &BondGraph, sketch: &Sketch) -> String {
    let mut out = format!(
        "digraph {} {{\n  rankdir=LR;\n  label={};\n  labelloc=t;\n  node [shape=plaintext, fontname=\"Helvetica\"];\n  \
edge [fontname=\"Helvetica\", fontsize=10];\n",
        quoted(&graph.name),
        quoted(&sketch.title)
    );
    boxes(sketch, 0, 1, &mut out);
    for link in &sketch.links {
        let (effort, flow, ink) = letters(link.domain);
        let number = link.bond.index() + 1;
        // A half arrow at the head, a bar where the stroke is.
        let (tail, head) = match link.stroke {
            Some(Stroke::AtFrom) => ("tee", "lnormal"),
            Some(Stroke::AtTo) => ("none", "teelnormal"),
            None => ("none", "lnormal"),
        };
        let mut look = format!(
            "dir=both, arrowtail={tail}, arrowhead={head}, color=\"{}\", label={}",
            ink.row().2,
            quoted(&format!("{effort}{number}\n{flow}{number}"))
        );
        if link.dependent {
            look += ", fontcolor=\"#d7191c\"";
        }
        if link.ring > 0 {
            look += ", penwidth=3";
        }
        out += &format!("  n{} -> n{} [{look}];\n", link.from, link.to);
    }
    out + "}\n"
}

fn boxes(sketch: &Sketch, group: usize, depth: usize, out: &mut String) {
    let indent = "  ".repeat(depth);
    for (k, node) in sketch.nodes.iter().enumerate().filter(|(_, node)| node.group == group) {
        let text = match node.below.as_str() {
            "" => node.title.clone(),
            below => format!("{}\n{below}", node.title),
        };
        let ink = if node.dependent { "#d7191c" } else { letters(node.domain).2.row().2 };
        let shape = if node.kind == NodeKind::Part { ", shape=box, style=rounded" } else { "" };
        *out += &format!("{indent}n{k} [label={}, fontcolor=\"{ink}\"{shape}];\n", quoted(&text));
    }
    for (k, inner) in sketch.groups.iter().enumerate().filter(|(_, g)| g.parent == Some(group)) {
        let label = quoted(&format!("{}: {}", inner.name, inner.model));
        *out += &format!(
            "{indent}subgraph cluster_{k} {{\n{indent}  label={label};\n{indent}  style=\"dashed,rounded\";\n"
        );
        boxes(sketch, k, depth + 1, out);
        *out += &format!("{indent}}}\n");
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
