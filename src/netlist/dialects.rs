//! The dialects that netlists are written in and read from, one row each.
//!
//! Those of SPICE's family read the same cards but for what a row says. What a dialect has no word for is put in other words where
//! there are any (`adapt`), else it is an error that names the element.

use super::adapt::{self, Adapted};
use super::{Netlist, lacks, mast, write};
use crate::diagnostic::Diagnostic;
use crate::expr;

/// One row of the table.
pub struct Dialect {
    /// What `--to` and `--dialect` call it.
    pub name: &'static str,
    /// The simulator, and how far what is written for it has been tried.
    pub about: &'static str,
    /// How expressions are spelled.
    pub spelling: expr::Dialect,
    /// Where a card's comment may stand.
    pub comments: Comments,
    /// How a `.save` card begins; empty where the simulator has none.
    pub save: &'static str,
    /// The same of `.print tran`.
    pub print: &'static str,
    /// A first word of `.options`, and what it needs besides what the netlist says.
    pub options: (Option<&'static str>, &'static [&'static str]),
    /// Whether linked sources and switches may take the current of any device that has one as an unknown (E, H, B),
    /// not of V sources alone.
    pub linked_to_any: bool,
    /// Whether a sine has a place for a phase.
    pub phases: bool,
    /// What models of switches are called.
    pub switches: Switches,
    /// What stands between the names of a path into subcircuits.
    pub separator: &'static str,
    /// Whether the current of a device in a subcircuit goes by its letter, then the path.
    pub lettered: bool,
    /// Whether it takes subcircuits with parameters; else circuits are written flat.
    pub nested: bool,
    /// What it cannot say.
    pub lacks: &'static [adapt::Lack],
    /// Writes a netlist that has been put in its words, where that is done. `None`, with errors, for what has none after all.
    pub text: Option<Write>,
    /// How it is read, where it is.
    pub read: Option<Reading>,
}

/// Writes a netlist as text.
pub type Write = fn(&Netlist, &Dialect, &mut Vec<Diagnostic>) -> Option<String>;

/// What differs from one dialect to the next in reading.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Suffixes of numbers besides `t g meg k mil m u n p f`.
    pub numbers: Numbers,
    /// What begins a comment at the end of a line.
    pub comments: &'static [&'static str],
    /// Names of the ground.
    pub grounds: &'static [&'static str],
    /// Whether `a:b` in an expression is one name, of something within an instance or a device.
    pub colons: bool,
    /// Whether `ic=` of a device holds in the operating point, too.
    pub initial_holds: bool,
    /// Whether a row at a jump holds what the step that ends there arrives at.
    pub arrives: bool,
    /// Whether a parameter of an X card wins over a `.param` of its name within the subcircuit.
    pub instance_wins: bool,
    /// Whether phases are in degrees.
    pub degrees: bool,
    /// Whether `vm(a)` and its like within an expression are parts of phasors: in outputs, where no `.func` can be meant.
    pub parts: bool,
}

/// What numbers may end with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    /// `a` is 1e-18; else it is a letter without meaning.
    pub atto: bool,
    /// `x` is 1e6.
    pub x_is_mega: bool,
    /// `4k7` is 4700; else what follows the suffix has no meaning.
    pub digits_behind: bool,
}

/// Where the comment of a card may stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comments {
    /// Behind it, after `;`.
    Behind,
    /// On a line of its own only.
    Above,
}

/// Models of switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switches {
    /// `SW(vt vh ron roff)`, `CSW(it ih ron roff)`: on above vt + vh, off below vt − vh.
    Threshold,
    /// `VSWITCH(von voff ron roff)`, `ISWITCH(ion ioff ron roff)`: a smooth transition from one to the other.
    Smooth,
}

/// ngspice.
pub const NGSPICE: Dialect = Dialect {
    name: "ngspice",
    about: "ngspice 39 and later, in its default mode; every shipped model runs in it",
    spelling: expr::Dialect::Ngspice,
    comments: Comments::Behind,
    save: ".save",
    print: ".print tran",
    options: (None, &[]),
    linked_to_any: true,
    phases: true,
    switches: Switches::Threshold,
    separator: ".",
    lettered: true,
    nested: true,
    lacks: &[
        lacks::FLUX,
        lacks::INTEGRAL,
        lacks::DELAY,
        lacks::TRANSFER,
        lacks::WAVEFORM_CALL,
        lacks::SOURCE_LAW,
        lacks::PATTERN,
        lacks::LAW_SWITCH,
        lacks::SMOOTH_SWITCH,
    ],
    text: Some(|netlist, dialect, _| Some(write::text(netlist, dialect))),
    read: Some(Reading {
        numbers: Numbers { atto: true, x_is_mega: false, digits_behind: false },
        comments: &[";", "$", "//"],
        grounds: &["0", "gnd"],
        colons: false,
        initial_holds: false,
        arrives: false,
        instance_wins: false,
        degrees: false,
        parts: false,
    }),
};

/// How ngspice and what is written as for it is read.
const READING: Reading = match NGSPICE.read {
    Some(reading) => reading,
    None => unreachable!(),
};

/// Every dialect.
pub const DIALECTS: &[Dialect] = &[
    NGSPICE,
    Dialect {
        name: "xyce",
        about: "Xyce 7, by its manual; untested",
        spelling: expr::Dialect::Xyce,
        comments: Comments::Behind,
        // Its `.save` keeps an operating point; columns come from `.print`.
        save: "",
        print: ".print tran format=csv",
        // Each variable is held to its own magnitude: with the default, pressures would hide displacements.
        options: (Some("timeint"), &["newlte=3"]),
        linked_to_any: false,
        switches: Switches::Smooth,
        separator: ":",
        lettered: false,
        lacks: &[
            adapt::CHARGED_LINE,
            adapt::SWITCHING_HYSTERESIS,
            lacks::INDUCTOR_LAW,
            lacks::FLUX,
            lacks::BEGUN_INTEGRAL,
            lacks::DELAY,
            lacks::TRANSFER,
            lacks::AMPLITUDE,
        ],
        read: Some(Reading {
            numbers: Numbers { atto: false, x_is_mega: true, digits_behind: false },
            comments: &[";"],
            grounds: &["0"],
            colons: true,
            initial_holds: true,
            arrives: true,
            instance_wins: true,
            degrees: false,
            parts: false,
        }),
        ..NGSPICE
    },
    Dialect {
        name: "ltspice",
        about: "LTspice 17 and later, by its manual; untested",
        spelling: expr::Dialect::Ltspice,
        print: "",
        // Every point in double precision, none thinned out for plots.
        options: (None, &["numdgt=15", "plotwinsize=0"]),
        linked_to_any: false,
        separator: ":",
        lettered: false,
        lacks: &[
            adapt::CHARGED_LINE,
            lacks::CAPACITOR_LAW,
            lacks::INDUCTOR_LAW,
            lacks::CHARGE,
            lacks::FLUX,
            lacks::TRANSFER,
            lacks::WAVEFORM_CALL,
            lacks::SOURCE_LAW,
            lacks::REPEATED,
            lacks::PATTERN,
            lacks::AMPLITUDE,
            lacks::LAW_SWITCH,
            lacks::SMOOTH_SWITCH,
        ],
        read: Some(Reading {
            numbers: Numbers { atto: false, x_is_mega: false, digits_behind: true },
            comments: &[";"],
            degrees: true,
            ..READING
        }),
        ..NGSPICE
    },
    Dialect {
        name: "gnucap",
        about: "gnucap 0.36: linear models only; those among the shipped ones run in it",
        comments: Comments::Above,
        save: "",
        // Its voltage sources have a resistance, by default 10 µΩ, too much where amperes are hundreds of rad/s. But a
        // gyrator of two sources that take each other's current stands in its matrix with the square of the inverse, of
        // which 1e-9 Ω leave no digit and 1e-6 two. Its nodes and charges have floors far above what is usual in hydraulics.
        options: (None, &["short=3e-6", "gmin=1e-20", "abstol=1e-18", "chgtol=1e-25", "numdgt=9"]),
        linked_to_any: false,
        phases: false,
        nested: false,
        lacks: &[
            adapt::LAW,
            adapt::SWITCH,
            adapt::DIODE,
            adapt::PHASE,
            adapt::CHARGED_LINE,
            lacks::PASSIVE_LAW,
            lacks::MODELLED,
            lacks::SOURCE_LAW,
            lacks::REPEATED,
            lacks::PATTERN,
            lacks::AMPLITUDE,
            lacks::LAW_SWITCH,
        ],
        ..NGSPICE
    },
    Dialect {
        name: "saber",
        about: "Saber MAST, own templates only, by public notes on the language; untested",
        nested: false,
        lacks: mast::LACKS,
        text: Some(mast::text),
        read: None,
        ..NGSPICE
    },
    Dialect {
        name: "spice",
        about: "SPICE 3 and its kin: read only",
        text: None,
        read: Some(Reading {
            numbers: Numbers { atto: false, x_is_mega: false, digits_behind: false },
            comments: &[";", "$"],
            ..READING
        }),
        ..NGSPICE
    },
];

impl std::fmt::Debug for Dialect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Dialect {
    fn eq(&self, other: &Dialect) -> bool {
        self.name == other.name
    }
}

impl Default for &'static Dialect {
    /// What a netlist is in that says nothing else.
    fn default() -> Self {
        &DIALECTS[0]
    }
}

impl Dialect {
    /// How it is read; as ngspice where it has no reader.
    pub fn reading(&self) -> Reading {
        self.read.unwrap_or(READING)
    }

    /// The netlist in the words of the dialect, and its text. `None`, with an error for each card that it cannot say.
    pub fn write(&self, netlist: &Netlist, d: &mut Vec<Diagnostic>) -> Option<Written> {
        let text = self.text?;
        let Adapted { netlist, senses } = adapt::adapt(netlist, self, d)?;
        Some(Written { text: text(&netlist, self, d)?, senses, netlist })
    }
}

/// A netlist in a dialect.
pub struct Written {
    /// As cards.
    pub netlist: Netlist,
    /// As text.
    pub text: String,
    /// What was added: 0 V sources that carry the current of another device, each with that device's name, by their paths
    /// into subcircuits.
    pub senses: Vec<(String, String)>,
}

/// The names of the dialects that are read.
pub fn read_names() -> impl Iterator<Item = &'static str> {
    DIALECTS.iter().filter(|dialect| dialect.read.is_some()).map(|dialect| dialect.name)
}

/// The names of the dialects that are written.
pub fn written_names() -> impl Iterator<Item = &'static str> {
    DIALECTS.iter().filter(|dialect| dialect.text.is_some()).map(|dialect| dialect.name)
}

/// The dialect of a name.
pub fn find(name: &str) -> Option<&'static Dialect> {
    DIALECTS.iter().find(|dialect| dialect.name.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::read::{How, read};
    use crate::source::SourceMap;

    #[test]
    fn every_dialect_reads_what_it_writes() {
        for dialect in DIALECTS {
            let (Some(_), Some(_)) = (dialect.read, dialect.text) else { continue };
            let how = How::of(dialect);
            let mut map = SourceMap::default();
            let file = map.add("deck.cir", "a title\nr1 a 0 1000\nv1 a 0 5\n.op\n.end\n");
            let mut d = vec![];
            let write = |netlist: &Netlist| dialect.write(netlist, &mut vec![]).unwrap().text;
            let text = write(&read(&mut map, file, &how, &mut d));
            let file = map.add("again.cir", text.clone());
            assert_eq!(write(&read(&mut map, file, &how, &mut d)), text);
            assert!(d.is_empty() && find(&dialect.name.to_uppercase()).is_some(), "{d:?}");
        }
        assert!(find("nosuch").is_none());
    }
}
