//! The dialects that netlists are written in and read from, one row each.

use super::{Netlist, read, write};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, SourceMap};

/// One row of the table.
#[derive(Clone, Copy)]
pub struct Dialect {
    /// What `--to` and `--dialect` call it.
    pub name: &'static str,
    /// The simulator, and how far what is written for it has been tried.
    pub about: &'static str,
    /// Writes a netlist.
    pub write: fn(&Netlist) -> String,
    /// Reads one.
    pub read: fn(&SourceMap, FileId, &mut Vec<Diagnostic>) -> Netlist,
}

/// Every dialect.
pub const DIALECTS: &[Dialect] = &[Dialect {
    name: "ngspice",
    about: "ngspice 39 and later, in its default mode; tested against it",
    write: write::write,
    read: read::read,
}];

/// The dialect of a name.
pub fn find(name: &str) -> Option<&'static Dialect> {
    DIALECTS.iter().find(|dialect| dialect.name.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dialect_reads_what_it_writes() {
        for dialect in DIALECTS {
            let mut map = SourceMap::default();
            let file = map.add("deck.cir", "a title\nr1 a 0 1000\nv1 a 0 5\n.op\n.end\n");
            let mut d = vec![];
            let text = (dialect.write)(&(dialect.read)(&map, file, &mut d));
            let file = map.add("again.cir", text.clone());
            assert_eq!((dialect.write)(&(dialect.read)(&map, file, &mut d)), text);
            assert!(d.is_empty() && find(&dialect.name.to_uppercase()).is_some(), "{d:?}");
        }
        assert!(find("nosuch").is_none());
    }
}
