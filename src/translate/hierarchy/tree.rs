//! The tree of instances, some of which stand inlined in the one around them.

use crate::bond::graph::Instance;

/// Which instances are subcircuits, and which stand inlined.
pub struct Tree<'g> {
    /// The file first, every instance behind the one around it.
    pub instances: &'g [Instance],
    /// By instance: why it stands inlined.
    pub inlined: Vec<Option<String>>,
}

impl Tree<'_> {
    /// The subcircuit that an instance's cards stand in: itself, or the next one around that is not inlined.
    pub fn scope(&self, instance: u32) -> u32 {
        let mut at = instance;
        while at > 0 && self.inlined[at as usize].is_some() {
            at = self.instances[at as usize].parent.unwrap_or(0);
        }
        at
    }

    /// The subcircuit around a subcircuit.
    pub fn around(&self, scope: u32) -> u32 {
        self.scope(self.instances[scope as usize].parent.unwrap_or(0))
    }

    /// Whether a subcircuit is another one or stands in it.
    pub fn within(&self, mut scope: u32, other: u32) -> bool {
        // Those inside stand behind those around them.
        while scope > other {
            scope = self.around(scope);
        }
        scope == other
    }

    /// The same of instances, inlined or not.
    pub fn stands_in(&self, mut instance: u32, other: u32) -> bool {
        while instance > other {
            instance = self.instances[instance as usize].parent.unwrap_or(0);
        }
        instance == other
    }

    /// The innermost subcircuit around two.
    pub fn common(&self, mut a: u32, mut b: u32) -> u32 {
        while a != b {
            let deeper = if a > b { &mut a } else { &mut b };
            *deeper = self.around(*deeper);
        }
        a
    }

    /// How many subcircuits stand around one.
    pub fn depth(&self, mut scope: u32) -> usize {
        let mut depth = 0;
        while scope > 0 {
            scope = self.around(scope);
            depth += 1;
        }
        depth
    }

    /// Inlines all from one up to, and without, another that is around it.
    pub fn inline_up_to(&mut self, mut scope: u32, around: u32, why: &str) {
        while scope > around {
            let next = self.around(scope);
            self.inlined[scope as usize].get_or_insert_with(|| why.to_string());
            scope = next;
        }
    }
}
