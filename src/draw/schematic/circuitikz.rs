//! A schematic for LaTeX with the circuitikz package: a document that compiles as it stands.

use super::super::svg::number;
use super::super::tikz::escape;
use super::place::Schematic;
use super::symbols::Symbol;

/// Picture units in a centimetre: a device of 74 units is two centimetres long.
const SCALE: f64 = 37.0;

/// Writes a schematic.
pub fn write(schematic: &Schematic) -> String {
    let at = |(x, y): (f64, f64)| format!("({},{})", number(x / SCALE), number(-y / SCALE));
    let mut out = String::from(
        "\\documentclass[border=4pt]{standalone}\n\\usepackage[utf8]{inputenc}\n\\usepackage[T1]{fontenc}\n\
\\usepackage{textcomp}\n\\usepackage[europeanresistors,americaninductors]{circuitikz}\n\\begin{document}\n",
    );
    out += &format!("% {}\n", escape(&schematic.title));
    out += "\\begin{circuitikz}[font=\\scriptsize]\n";
    for (a, b) in &schematic.wires {
        out += &format!("\\draw {} -- {};\n", at(*a), at(*b));
    }
    for device in &schematic.devices {
        let (name, value) = (escape(&device.words.0), escape(&device.words.1));
        let (a, b) = device.ends;
        let kind = match device.symbol {
            Symbol::Resistor => "R",
            Symbol::Capacitor => "C",
            Symbol::Inductor => "L",
            Symbol::VoltageSource => "american voltage source, invert",
            Symbol::CurrentSource => "american current source",
            Symbol::ControlledVoltage => "american controlled voltage source, invert",
            Symbol::ControlledCurrent => "american controlled current source",
            Symbol::Switch => "switch",
            Symbol::Diode => "D*",
            Symbol::Sense => "rmeterwa, t=A",
            Symbol::Block => "generic",
        };
        // Labels stand to the left of the way along: the way to the right, or upward, puts them above, to the left.
        let side = if b.0 > a.0 || b.1 > a.1 { "l" } else { "l_" };
        let upright = (b.0 - a.0).abs() < 1.0;
        let words = match (upright, value.is_empty()) {
            // Beside a device that stands, its value below its name.
            (true, false) => format!("{side}={{\\shortstack[l]{{{name}\\\\{value}}}}}"),
            (true, true) => format!("{side}={{{name}}}"),
            (false, _) => {
                let other = if side == "l" { "a_" } else { "a" };
                format!("{side}={{{name}}}, {other}={{{value}}}")
            }
        };
        out += &format!("\\draw {} to[{kind}, {words}] {};\n", at(a), at(b));
    }
    for dot in &schematic.dots {
        out += &format!("\\node[circ] at {} {{}};\n", at(*dot));
    }
    for ground in &schematic.grounds {
        out += &format!("\\node[ground] at {} {{}};\n", at(*ground));
    }
    for (place, name) in &schematic.names {
        out += &format!(
            "\\node[anchor=base west,inner sep=0,blue!70!black] at {} {{{}}};\n",
            at(*place),
            escape(name)
        );
    }
    for (place, text) in &schematic.repeats {
        out += &format!(
            "\\node[anchor=base west,inner sep=0,gray] at {} {{{}}};\n",
            at(*place),
            escape(text)
        );
    }
    out + "\\end{circuitikz}\n\\end{document}\n"
}
