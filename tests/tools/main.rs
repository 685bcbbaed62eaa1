//! The command line, the language server, messages, documentation, and the order of the house.

mod cli;
mod lsp;
mod examples;
mod docs;
mod editors;
mod gallery;
mod codes;
mod architecture;
