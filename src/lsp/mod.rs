//! The language server: what an editor asks of `.bg` files while they are written.
//!
//! It reads finished nouns (the tree of a text, diagnostics, the graph and its causality) and changes none of them:
//!
//! ```text
//! transport ─messages→ server ─texts→ documents ─file and its imports→ analysis ─tree→ index ─→ hover, rename, …
//! ```
//!
//! Places are bytes everywhere inside, and lines with columns of UTF-16 units (the protocol's) at the edges: `position`.

pub mod position;
pub mod transport;
mod documents;
mod analysis;
mod index;
mod words;
mod context;
mod diagnostics;
mod hover;
mod completion;
mod rename;
mod symbols;
mod actions;
mod tokens;
mod server;

pub use analysis::Checked;
pub use server::{Host, serve};
pub use words::{LAWS, MEANINGS, WORDS};
