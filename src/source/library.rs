//! The library that comes with the program: files that `import "std/…"` finds without a folder of theirs.

/// Each file by its path after `std/`, and its text.
pub const LIBRARY: &[(&str, &str)] = &[
    ("control.bg", include_str!("../../models/std/control.bg")),
    ("electrical.bg", include_str!("../../models/std/electrical.bg")),
    ("hydraulic.bg", include_str!("../../models/std/hydraulic.bg")),
    ("mechanical.bg", include_str!("../../models/std/mechanical.bg")),
];

/// The text of a file of the library.
pub fn find(name: &str) -> Option<&'static str> {
    LIBRARY.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
