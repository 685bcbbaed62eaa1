//! Pictures as SVG: colours by class, so that the picture follows a dark page; places with two digits.

use super::picture::{Anchor, BELOW, INKS, Ink, Picture, Point, Shape, Stroke, Words};
use std::fmt::Write;

/// The letters: Helvetica and those of its widths.
pub const FONT: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// Writes a picture as a file of its own.
pub fn write(picture: &Picture) -> String {
    inside(
        picture,
        &format!(
            "<style>{}</style>\n<rect class=\"bs-paper-f\" width=\"100%\" height=\"100%\"/>\n",
            style()
        ),
        &|_| None,
    )
}

/// Writes a picture that stands within a page which has the [`style`] already; `link` says where words lead, by what they
/// speak of.
pub fn inside(picture: &Picture, head: &str, link: &dyn Fn(&str) -> Option<String>) -> String {
    let (w, h) = (number(picture.width), number(picture.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"bs\" width=\"{w}\" height=\"{h}\" \
viewBox=\"0 0 {w} {h}\" role=\"img\">\n<title>{}</title>\n{head}",
        escape(&picture.title)
    );
    for shape in &picture.shapes {
        let to = match shape {
            Shape::Words { words, .. } if !words.of.is_empty() => link(&words.of),
            _ => None,
        };
        if let Some(to) = &to {
            let _ = write!(out, "<a href=\"{}\">", escape(to));
        }
        self::shape(shape, &mut out);
        out.push_str(if to.is_some() { "</a>\n" } else { "\n" });
    }
    out + "</svg>\n"
}

/// The classes: `bs-NAME` for lines, `bs-NAME-f` for what is filled.
pub fn style() -> String {
    let rules = |dark: bool| {
        INKS.iter().fold(String::new(), |mut rules, (_, name, light, night)| {
            let colour = if dark { night } else { light };
            // Writing to a String cannot fail.
            let _ = write!(rules, ".bs-{name}{{stroke:{colour}}}.bs-{name}-f{{fill:{colour}}}");
            rules
        })
    };
    format!(
        ".bs{{font-family:{FONT}}}.bs polyline,.bs path{{fill:none}}{}@media screen and \
(prefers-color-scheme:dark){{{}}}",
        rules(false),
        rules(true)
    )
}

/// A number with at most two digits after the point, none that say nothing.
pub fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_string() }
}

/// A text for XML.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

fn class(ink: Ink, filled: bool) -> String {
    format!("bs-{}{}", ink.row().1, if filled { "-f" } else { "" })
}

fn pen(stroke: &Stroke) -> String {
    let mut out = format!(" class=\"{}\"", class(stroke.ink, false));
    if stroke.width != 1.0 {
        out += &format!(" stroke-width=\"{}\"", number(stroke.width));
    }
    if stroke.dashed {
        out += " stroke-dasharray=\"5 3\"";
    }
    if stroke.opacity < 1.0 {
        out += &format!(" stroke-opacity=\"{}\"", number(stroke.opacity));
    }
    out
}

/// Points, each as the way from the one before: half as many digits as their places.
fn path(points: &[Point]) -> String {
    let mut out = String::new();
    // Steps are counted in hundredths, so that no rounding adds up.
    let round = |value: f64| (value * 100.0).round() as i64;
    let mut last = (0, 0);
    for (at, point) in points.iter().enumerate() {
        let place = (round(point.0), round(point.1));
        let (x, y) = (place.0 - last.0, place.1 - last.1);
        let (x, y) = (number(x as f64 / 100.0), number(y as f64 / 100.0));
        let gap = if y.starts_with('-') { "" } else { " " };
        let letter = if at == 0 { "M" } else { "l" };
        let _ = write!(out, "{letter}{x}{gap}{y}");
        last = place;
    }
    out
}

fn list(points: &[Point]) -> String {
    let pairs = points.iter().map(|p| format!("{},{}", number(p.0), number(p.1)));
    pairs.collect::<Vec<_>>().join(" ")
}

fn shape(shape: &Shape, out: &mut String) {
    let title = |title: &str| match title {
        "" => String::new(),
        title => format!("<title>{}</title>", escape(title)),
    };
    let outline = |stroke: &Option<Stroke>| stroke.as_ref().map_or(String::new(), pen);
    let text = match shape {
        Shape::Line { points, stroke, title: told } if points.len() == 2 && told.is_empty() => {
            let (a, b) = (points[0], points[1]);
            let (x1, y1, x2, y2) = (number(a.0), number(a.1), number(b.0), number(b.1));
            format!("<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"{}/>", pen(stroke))
        }
        Shape::Line { points, stroke, title: told } => {
            let d = path(points);
            match told.as_str() {
                "" => format!("<path d=\"{d}\"{}/>", pen(stroke)),
                told => format!("<path d=\"{d}\"{}>{}</path>", pen(stroke), title(told)),
            }
        }
        Shape::Area { points, fill, stroke, round } => {
            let fill = match fill {
                None => " fill=\"none\"".to_string(),
                Some((ink, opacity)) => {
                    // A filled shape may have an outline of another colour, which its own group gives.
                    let sheer = match *opacity < 1.0 {
                        true => format!(" fill-opacity=\"{}\"", number(*opacity)),
                        false => String::new(),
                    };
                    let class = class(*ink, true);
                    match stroke {
                        None => format!(" class=\"{class}\"{sheer}"),
                        Some(_) => {
                            *out += &area(points, *round, &format!(" class=\"{class}\"{sheer}"));
                            " fill=\"none\"".to_string()
                        }
                    }
                }
            };
            area(points, *round, &(fill + &outline(stroke)))
        }
        Shape::Circle { at, radius, fill, stroke } => {
            let place = format!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"",
                number(at.0),
                number(at.1),
                number(*radius)
            );
            match (fill, stroke) {
                (Some(ink), None) => format!("{place} class=\"{}\"/>", class(*ink, true)),
                (Some(ink), Some(stroke)) => format!(
                    "{place} class=\"{}\"/>{place} fill=\"none\"{}/>",
                    class(*ink, true),
                    pen(stroke)
                ),
                (None, stroke) => format!("{place} fill=\"none\"{}/>", outline(stroke)),
            }
        }
        Shape::Arc { at, radius, from, to, stroke } => {
            let end = |angle: f64| {
                let angle = angle.to_radians();
                let (x, y) = (at.0 + radius * libm::cos(angle), at.1 + radius * libm::sin(angle));
                format!("{} {}", number(x), number(y))
            };
            let (r, large) = (number(*radius), u8::from(to - from > 180.0));
            let (a, b) = (end(*from), end(*to));
            format!("<path d=\"M{a}A{r} {r} 0 {large} 1 {b}\"{}/>", pen(stroke))
        }
        Shape::Words { words, title: told } => self::words(words, &title(told)),
        Shape::Dots { points, radius, ink } => {
            let class = class(*ink, true);
            let dots = points.iter().map(|p| {
                format!(
                    "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
                    number(p.0),
                    number(p.1),
                    number(*radius)
                )
            });
            format!("<g class=\"{class}\">{}</g>", dots.collect::<String>())
        }
    };
    out.push_str(&text);
}

fn area(points: &[Point], round: bool, look: &str) -> String {
    // Only upright rectangles have round corners.
    match (round, points) {
        (true, [a, _, c, _]) => format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"6\"{look}/>",
            number(a.0),
            number(a.1),
            number(c.0 - a.0),
            number(c.1 - a.1)
        ),
        _ => format!("<polygon points=\"{}\"{look}/>", list(points)),
    }
}

fn words(words: &Words, title: &str) -> String {
    let (x, y) = (number(words.at.0), number(words.at.1));
    let mut look =
        format!(" class=\"{}\" font-size=\"{}\"", class(words.ink, true), number(words.size));
    match words.anchor {
        Anchor::Start => {}
        Anchor::Middle => look += " text-anchor=\"middle\"",
        Anchor::End => look += " text-anchor=\"end\"",
    }
    if words.bold {
        look += " font-weight=\"bold\"";
    }
    if words.italic {
        look += " font-style=\"italic\"";
    }
    if words.upward {
        look += &format!(" transform=\"rotate(-90 {x} {y})\"");
    }
    let below = match words.below.as_str() {
        "" => String::new(),
        below => format!(
            "<tspan dy=\"{}\" font-size=\"{}\" font-style=\"normal\">{}</tspan>",
            number(0.22 * words.size),
            number(BELOW * words.size),
            escape(below)
        ),
    };
    format!("<text x=\"{x}\" y=\"{y}\"{look}>{title}{}{below}</text>", escape(&words.text))
}
