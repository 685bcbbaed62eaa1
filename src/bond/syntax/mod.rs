//! Reading: from a text to [`File`], statement by statement.
//!
//! Nothing a text holds can make it fail: what cannot be read becomes a [`StatementKind::Unreadable`] and a
//! diagnostic, and reading goes on at the next statement.

pub mod tree;
pub mod token;
mod scan;
mod classes;
mod format;
mod parse;
mod statement;
mod expression;
mod expected;
mod data;

pub use classes::{Class, tokens};
pub use data::data_files;
pub use format::{WIDTH, format, layout, same_tokens};
pub use parse::{parse, parse_drive, parse_observe, parse_value};
pub use scan::STATEMENT_WORDS;
pub use tree::{
    Argument, Arrow, Call, Chain, ChainEnd, Expr, File, HeaderParameter, Label, Leaf, Model, Name,
    ObserveItem, Part, Path, Port, Regulator, Statement, StatementKind, Sum, Trivia, TriviaKind,
    Value,
};

#[cfg(test)]
mod generate;
#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod tests;
