//! The command line, the language server, messages, documentation, and the order of the house.

#[path = "../peers/mod.rs"]
mod peers;

mod cli;
mod lsp;
mod examples;
mod docs;
mod editors;
mod drawings;
mod report;
mod sweep;
mod gallery;
mod codes;
mod architecture;
