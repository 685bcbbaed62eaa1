//! Pictures as TikZ, for LaTeX: a document that compiles as it stands (`pdflatex model.tex`), the picture within it.

use super::picture::{Anchor, BELOW, INKS, Ink, Picture, Point, Shape, Stroke, Words};
use super::svg::number;

/// Writes a picture.
pub fn write(picture: &Picture) -> String {
    let mut out = String::from(
        "\\documentclass[border=2pt]{standalone}\n\\usepackage[utf8]{inputenc}\n\\usepackage[T1]{fontenc}\n\\usepackage{textcomp}\n\\usepackage{tikz}\n\
\\renewcommand{\\familydefault}{\\sfdefault}\n",
    );
    for (_, name, light, _) in INKS {
        out += &format!("\\definecolor{{bs{name}}}{{HTML}}{{{}}}\n", light[1..].to_uppercase());
    }
    out += &format!("\\begin{{document}}\n% {}\n", escape(&picture.title));
    out += "\\begin{tikzpicture}[x=1bp,y=-1bp,line join=round]\n";
    for shape in &picture.shapes {
        out += &self::shape(shape);
    }
    out + "\\end{tikzpicture}\n\\end{document}\n"
}

/// A text for LaTeX.
pub fn escape(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(letter);
            }
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '…' => out += "\\dots{}",
            '→' => out += "$\\to$",
            '−' => out += "$-$",
            'Ω' => out += "$\\Omega$",
            'ω' => out += "$\\omega$",
            'τ' => out += "$\\tau$",
            'µ' | 'μ' => out += "$\\mu$",
            '·' => out += "$\\cdot$",
            '×' => out += "$\\times$",
            '²' => out += "$^2$",
            '³' => out += "$^3$",
            '°' => out += "$^\\circ$",
            'ζ' => out += "$\\zeta$",
            '∠' => out += "$\\angle$",
            '∫' => out += "$\\int$",
            'φ' | 'Φ' => out += "$\\Phi$",
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

fn place(point: Point) -> String {
    format!("({},{})", number(point.0), number(point.1))
}

fn colour(ink: Ink) -> String {
    format!("bs{}", ink.row().1)
}

fn pen(stroke: &Stroke) -> String {
    let mut out = format!("draw={},line width={}bp", colour(stroke.ink), number(stroke.width));
    if stroke.dashed {
        out += ",dash pattern=on 5bp off 3bp";
    }
    if stroke.opacity < 1.0 {
        out += &format!(",draw opacity={}", number(stroke.opacity));
    }
    out
}

fn shape(shape: &Shape) -> String {
    let through =
        |points: &[Point]| points.iter().map(|p| place(*p)).collect::<Vec<_>>().join(" -- ");
    match shape {
        Shape::Line { points, stroke, .. } => {
            format!("\\path[{}] {};\n", pen(stroke), through(points))
        }
        Shape::Area { points, fill, stroke, round } => {
            let mut look = vec![];
            if let Some((ink, opacity)) = fill {
                look.push(format!("fill={},fill opacity={}", colour(*ink), number(*opacity)));
            }
            look.extend(stroke.as_ref().map(pen));
            if *round {
                look.push("rounded corners=6bp".into());
            }
            format!("\\path[{}] {} -- cycle;\n", look.join(","), through(points))
        }
        Shape::Circle { at, radius, fill, stroke } => {
            let mut look: Vec<String> =
                fill.iter().map(|ink| format!("fill={}", colour(*ink))).collect();
            look.extend(stroke.as_ref().map(pen));
            format!(
                "\\path[{}] {} circle[radius={}bp];\n",
                look.join(","),
                place(*at),
                number(*radius)
            )
        }
        Shape::Arc { at, radius, from, to, stroke } => {
            let start = from.to_radians();
            let start = (at.0 + radius * libm::cos(start), at.1 + radius * libm::sin(start));
            format!(
                "\\path[{}] {} arc[start angle={},end angle={},radius={}bp];\n",
                pen(stroke),
                place(start),
                // Radii have units of their own, so that angles count upward here.
                number(-*from),
                number(-*to),
                number(*radius)
            )
        }
        Shape::Words { words, .. } => self::words(words),
        Shape::Dots { points, radius, ink } => {
            let circles = points
                .iter()
                .map(|p| format!("{} circle[radius={}bp]", place(*p), number(*radius)));
            format!("\\path[fill={}] {};\n", colour(*ink), circles.collect::<Vec<_>>().join(" "))
        }
    }
}

fn words(words: &Words) -> String {
    let anchor = match words.anchor {
        Anchor::Start => "base west",
        Anchor::Middle => "base",
        Anchor::End => "base east",
    };
    let turned = if words.upward { ",rotate=90" } else { "" };
    // A node's letters are as large as its font says; 1.2 is the usual distance of lines.
    let font = format!(
        "\\fontsize{{{}bp}}{{{}bp}}\\selectfont{}{}",
        number(words.size),
        number(1.2 * words.size),
        if words.bold { "\\bfseries" } else { "" },
        if words.italic { "\\itshape" } else { "" }
    );
    let below = match words.below.as_str() {
        "" => String::new(),
        below => format!(
            "\\raisebox{{{}bp}}{{\\fontsize{{{s}bp}}{{{s}bp}}\\selectfont\\upshape {}}}",
            number(-0.22 * words.size),
            escape(below),
            s = number(BELOW * words.size)
        ),
    };
    format!(
        "\\node[anchor={anchor},inner sep=0,text={}{turned},font={{{font}}}] at {} {{{}{below}}};\n",
        colour(words.ink),
        place(words.at),
        escape(&words.text)
    )
}
