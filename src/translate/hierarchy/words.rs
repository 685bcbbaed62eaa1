//! Names as each subcircuit spells them: `Rotor` the model beside `rotor` the node of another one.

use crate::netlist::{Name, Names};
use std::collections::HashMap;

/// The names of a netlist that is to be written.
#[derive(Default)]
pub struct Words {
    /// All of them.
    pub names: Names,
    spelled: HashMap<String, Name>,
}

impl Words {
    /// The name of a text in exactly this spelling.
    pub fn intern(&mut self, text: &str) -> Name {
        if let Some(name) = self.spelled.get(text) {
            return *name;
        }
        let name = match self.names.find(text) {
            None => self.names.intern(text),
            Some(_) => self.names.add(text),
        };
        self.spelled.insert(text.to_string(), name);
        name
    }

    /// The text of a name.
    pub fn text(&self, name: Name) -> &str {
        self.names.text(name)
    }
}
