//! `report.html`: what is known of a model on one page that needs nothing else: waveforms, drawings, causality, the
//! certificate, the balance of energy, source and netlist with links between them.
//!
//! The page holds uPlot 1.6 (Leon Sorokin, MIT licence, `assets/uplot`); the rest is our own. Same input, same bytes.

mod data;

use crate::draw::balance;
use crate::draw::picture::Picture;
use crate::draw::svg::{self, escape};
use crate::trace::Trace;
use crate::verify::Report as Proof;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A card of the netlist, the element it stands for, its place in the source.
#[derive(Clone, Debug)]
pub struct Card {
    /// The device's name.
    pub card: String,
    /// `R:eta`.
    pub element: String,
    /// The bond of its port.
    pub bond: Option<String>,
    /// The line of the source, from 1 on.
    pub line: Option<usize>,
}

/// What a page shows.
pub struct Contents<'a> {
    /// The model's name.
    pub name: &'a str,
    /// Its text.
    pub source: &'a str,
    /// The run.
    pub trace: &'a Trace,
    /// Counters of the run, name and value.
    pub statistics: Vec<(String, String)>,
    /// The bond graph, or why it is not drawn.
    pub graph: Result<Picture, String>,
    /// The circuit, or why it is not drawn.
    pub circuit: Result<Picture, String>,
    /// Strokes, states, loops as text.
    pub causality: &'a str,
    /// The certificate; nothing where none was asked for.
    pub proof: Option<&'a Proof>,
    /// The netlist's text.
    pub netlist: &'a str,
    /// Where its cards come from.
    pub cards: &'a [Card],
    /// Junctions and elements, `1:shaft`, with their lines of the source; those of an instance with the instance's.
    pub lines: &'a BTreeMap<String, usize>,
    /// Warnings of all stages, one text each.
    pub warnings: &'a [String],
}

/// Writes the page.
pub fn write(contents: &Contents) -> String {
    let mut out =
        String::from("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    let name = escape(contents.name);
    out += "<meta name=\"viewport\" content=\"width=device-width\">\n<link rel=\"icon\" href=\"data:,\">\n";
    // Writing to a String cannot fail, here and below.
    let _ = writeln!(out, "<title>{name}: bondspice report</title>");
    let _ = writeln!(
        out,
        "<style>\n{}{}\n{}\n</style>\n</head>\n<body>",
        include_str!("../../assets/uplot/uPlot.min.css"),
        svg::style(),
        include_str!("../../assets/report/page.css")
    );
    let _ = writeln!(out, "<h1>{name}</h1>\n<nav>");
    for (anchor, title, _) in SECTIONS {
        let _ = write!(out, "<a href=\"#{anchor}\">{title}</a>");
    }
    out += "</nav>\n";
    out += &summary(contents);
    for (anchor, title, section) in SECTIONS {
        let _ = writeln!(
            out,
            "<section id=\"{anchor}\">\n<h2>{title}</h2>\n{}</section>",
            section(contents)
        );
    }
    let _ = writeln!(
        out,
        "<script type=\"application/json\" id=\"data\">{}</script>\n<script>\n/*\n{}*/\n{}\n</script>\n<script>\n{}</script>\n</body>\n</html>",
        data::json(contents.trace),
        include_str!("../../assets/uplot/LICENSE"),
        include_str!("../../assets/uplot/uPlot.iife.min.js"),
        include_str!("../../assets/report/page.js")
    );
    out
}

type Section = (&'static str, &'static str, fn(&Contents) -> String);

/// The sections in their order: anchor, title, what stands in them.
const SECTIONS: &[Section] = &[
    ("waveforms", "Waveforms", waveforms),
    ("graph", "Bond graph", |contents| picture(&contents.graph, &|of| element_link(contents, of))),
    ("circuit", "Circuit", |contents| picture(&contents.circuit, &|of| card_link(contents, of))),
    ("causality", "Causality", |contents| format!("<pre>{}</pre>\n", lines(contents.causality))),
    ("certificate", "Certificate", certificate),
    ("energy", "Energy", energy),
    ("elements", "Elements and cards", elements),
    ("source", "Source", source),
    ("netlist", "Netlist", netlist),
    ("statistics", "Statistics", statistics),
];

/// A text of several lines for HTML: [`escape`] makes blanks of what is no letter.
fn lines(text: &str) -> String {
    text.lines().map(|line| escape(line) + "\n").collect()
}

fn summary(contents: &Contents) -> String {
    let mut out = String::new();
    let rows = contents.trace.rows();
    let _ = write!(out, "<p>{} columns, {rows} rows", contents.trace.names.len());
    let _ = match contents.proof {
        Some(proof) if proof.passes() => {
            write!(out, "; <span class=\"good\">certificate: pass</span>")
        }
        Some(_) => write!(out, "; <span class=\"bad\">certificate: fail</span>"),
        None => write!(out, "; <span class=\"faint\">no certificate asked for</span>"),
    };
    out += "</p>\n";
    for warning in contents.warnings {
        let _ = writeln!(out, "<pre class=\"warning\">{}</pre>", lines(warning));
    }
    out
}

fn waveforms(contents: &Contents) -> String {
    let mut out = String::from(
        "<p class=\"screen faint\">Drag to look closer, double click or <button id=\"all\">whole run</button> to look at everything.</p>\n",
    );
    if let Some(note) = data::thinned(contents.trace) {
        let _ = writeln!(out, "<p class=\"faint\">{note}</p>");
    }
    out + "<div id=\"charts\"></div>\n"
}

/// Where an element of the bond graph leads: to its cards, else to its line.
fn element_link(contents: &Contents, of: &str) -> Option<String> {
    let row = elements_in_order(contents.cards).into_iter().position(|(element, _)| element == of);
    let line = || contents.lines.get(of).map(|line| format!("#line-{line}"));
    row.map(|row| format!("#element-{row}")).or_else(line)
}

/// Where a device of the circuit leads: to its card.
fn card_link(contents: &Contents, of: &str) -> Option<String> {
    let card = contents.cards.iter().find(|card| card.card.eq_ignore_ascii_case(of))?;
    Some(format!("#{}", anchor(&card.card)))
}

fn picture(picture: &Result<Picture, String>, link: &dyn Fn(&str) -> Option<String>) -> String {
    match picture {
        Ok(picture) => format!("<div class=\"picture\">{}</div>\n", svg::inside(picture, "", link)),
        Err(why) => format!("<p class=\"faint\">{}</p>\n", escape(why)),
    }
}

fn certificate(contents: &Contents) -> String {
    let Some(proof) = contents.proof else {
        return "<p class=\"faint\">Not asked for.</p>\n".to_string();
    };
    let mut out = format!("<pre>{}</pre>\n", lines(&proof.text()));
    if !proof.trajectories.is_empty() {
        out += "<table>\n<tr><th>variable</th><th>largest difference of range</th><th>rms</th><th>at</th><th>tolerance</th></tr>\n";
        for t in &proof.trajectories {
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td class=\"n\">{:.2e}</td><td class=\"n\">{:.2e}</td><td class=\"n\">{:.6} s</td><td class=\"n\">{:.1e}</td></tr>",
                escape(&t.name),
                t.max,
                t.rms,
                t.at,
                t.tolerance
            );
        }
        out += "</table>\n";
    }
    out
}

fn energy(contents: &Contents) -> String {
    let Some(energy) = contents.proof.and_then(|proof| proof.energy.as_ref()) else {
        return "<p class=\"faint\">No balance: it comes with the certificate.</p>\n".to_string();
    };
    let mut out = String::new();
    let [into, out_of] = balance::shares(energy);
    if !into.is_empty() && energy.holds() {
        let words = |size: f64| format!("{size:.4} J");
        let bands = balance::paint("", [&into, &out_of], &words);
        let _ =
            writeln!(out, "<div class=\"picture\">{}</div>", svg::inside(&bands, "", &|_| None));
    }
    out += "<table>\n<tr><th>part</th><th>energy</th></tr>\n";
    for (name, value) in [
        ("delivered by sources", energy.delivered),
        ("dissipated", energy.dissipated),
        ("stored", energy.stored),
        ("modulated", energy.modulated),
    ] {
        let _ = writeln!(out, "<tr><td>{name}</td><td class=\"n\">{value:.6} J</td></tr>");
    }
    let _ = writeln!(
        out,
        "<tr><td>residual, of what goes through</td><td class=\"n\">{:.1e}</td></tr>\n</table>\n<table>\n<tr><th>element</th><th>role</th><th>energy</th></tr>",
        energy.residual
    );
    for element in &energy.elements {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{:.6} J</td></tr>",
            escape(&element.name),
            element.role,
            element.energy
        );
    }
    out + "</table>\n"
}

/// The anchor of a card: names hold nothing that an anchor may not but what is escaped.
fn anchor(card: &str) -> String {
    format!("card-{}", escape(card).replace(' ', "_"))
}

/// Elements in the order of their first cards, each with its cards.
fn elements_in_order(cards: &[Card]) -> Vec<(&str, Vec<&Card>)> {
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut found: Vec<(&str, Vec<&Card>)> = vec![];
    for card in cards {
        let place = *places.entry(&card.element).or_insert(found.len());
        match found.get_mut(place) {
            Some((_, own)) => own.push(card),
            None => found.push((&card.element, vec![card])),
        }
    }
    found
}

fn elements(contents: &Contents) -> String {
    let mut out = String::from(
        "<table>\n<tr><th>element</th><th>bond</th><th>source</th><th>cards</th></tr>\n",
    );
    for (at, (element, own)) in elements_in_order(contents.cards).into_iter().enumerate() {
        let bond = own.iter().find_map(|card| card.bond.as_deref()).unwrap_or("");
        let line = own.iter().find_map(|card| card.line);
        let line =
            line.map_or(String::new(), |line| format!("<a href=\"#line-{line}\">line {line}</a>"));
        let links: Vec<String> = own
            .iter()
            .map(|card| format!("<a href=\"#{}\">{}</a>", anchor(&card.card), escape(&card.card)))
            .collect();
        let _ = writeln!(
            out,
            "<tr id=\"element-{at}\"><td>{}</td><td>{}</td><td>{line}</td><td>{}</td></tr>",
            escape(element),
            escape(bond),
            links.join(", ")
        );
    }
    out + "</table>\n"
}

fn source(contents: &Contents) -> String {
    let mut cards: BTreeMap<usize, Vec<&Card>> = BTreeMap::new();
    for card in contents.cards {
        cards.entry(card.line.unwrap_or(0)).or_default().push(card);
    }
    let mut out = String::from("<div class=\"code\">\n");
    for (at, line) in contents.source.lines().enumerate() {
        let number = at + 1;
        let links: Vec<String> = cards
            .get(&number)
            .into_iter()
            .flatten()
            .map(|card| format!("<a href=\"#{}\">{}</a>", anchor(&card.card), escape(&card.card)))
            .collect();
        let links = if links.is_empty() {
            String::new()
        } else {
            format!("   <span class=\"faint\">→ </span>{}", links.join(" "))
        };
        let _ = writeln!(
            out,
            "<div id=\"line-{number}\"><span class=\"no\">{number}</span>{}{links}</div>",
            escape(line)
        );
    }
    out + "</div>\n"
}

fn netlist(contents: &Contents) -> String {
    let places: BTreeMap<String, &Card> =
        contents.cards.iter().map(|card| (card.card.to_lowercase(), card)).collect();
    let mut out = String::from("<div class=\"code\">\n");
    for line in contents.netlist.lines() {
        let first = line.split_whitespace().next().unwrap_or("");
        let (text, card) = (escape(line), places.get(&first.to_lowercase()));
        let _ = match card {
            Some(card) => {
                let back = card.line.map_or(String::new(), |line| {
                    format!("   <a href=\"#line-{line}\">← {}</a>", escape(&card.element))
                });
                writeln!(out, "<div id=\"{}\">{text}{back}</div>", anchor(&card.card))
            }
            None => writeln!(out, "<div>{text}</div>"),
        };
    }
    out + "</div>\n"
}

fn statistics(contents: &Contents) -> String {
    let mut out = String::from("<table>\n");
    for (name, value) in &contents.statistics {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"n\">{}</td></tr>",
            escape(name),
            escape(value)
        );
    }
    out + "</table>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::picture::{Ink, Words};

    #[test]
    fn names_and_texts_are_escaped_and_links_lead_somewhere() {
        let cards = [Card {
            card: "R_r".into(),
            element: "R:r".into(),
            bond: Some("a -> r".into()),
            line: Some(2),
        }];
        let trace = Trace {
            names: vec!["time".into(), "</script><b>".into()],
            units: vec!["s".into(), String::new()],
            columns: vec![vec![0.0, 1.0], vec![1.0, 2.0]],
        };
        let drawn = |of: &str| {
            let mut picture = Picture { title: "<c>".into(), ..Picture::default() };
            let mut words = Words::new((5.0, 5.0), "r", 10.0, Ink::Plain);
            words.of = of.into();
            picture.words(words);
            picture
        };
        let contents = Contents {
            name: "a & b",
            source: "# x < y\n0:a -> R:r(1 Ohm)\n",
            trace: &trace,
            statistics: vec![("rows".into(), "2".into())],
            graph: Ok(drawn("R:r")),
            circuit: Ok(drawn("R_r")),
            causality: "a ->| r",
            proof: None,
            netlist: "* a\nr_r a 0 1\n",
            cards: &cards,
            lines: &BTreeMap::new(),
            warnings: &["watch <out>".into()],
        };
        let page = write(&contents);
        // Words in drawings lead to the element's row and to the card.
        assert!(page.contains("<a href=\"#element-0\"><text") && page.contains("id=\"element-0\""));
        assert!(page.contains("<a href=\"#card-R_r\"><text"));
        assert!(page.contains("<title>a &amp; b: bondspice report</title>"));
        assert!(page.contains("x &lt; y") && page.contains("watch &lt;out&gt;"));
        assert_eq!(page.matches("</script>").count(), 3, "data cannot end its element");
        for anchor in ["card-R_r", "line-2"] {
            assert!(
                page.contains(&format!("href=\"#{anchor}\""))
                    && page.contains(&format!("id=\"{anchor}\"")),
                "{anchor}"
            );
        }
        assert!(page.contains("Copyright (c) 2022 Leon Sorokin") || page.contains("Leon Sorokin"));
        assert_eq!(page, write(&contents));
    }
}
