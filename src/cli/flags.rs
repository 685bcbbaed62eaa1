//! Flags that several commands share: what to change in a model, and how to run it.

use super::pipeline;
use super::session::{Exit, Session};
use crate::bond::elaborate::Overrides;
use crate::diagnostic::Diagnostic;
use crate::netlist::dialects::{self, Dialect};
use crate::netlist::read::How;
use crate::quantity::nearest;
use crate::source::{FileId, Span};

/// What the command line says instead of the file.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ModelFlags {
    /// Set a parameter, with a unit where it has one: L=2mH (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Drive an input: 'x_ref = step(0.1 s, 0 mm, 20 mm)' (repeatable)
    #[arg(long, value_name = "NAME=SOURCE")]
    pub drive: Vec<String>,
    /// Columns of the result: 'EXPR [in UNIT] [as "NAME"], …', or all
    #[arg(long, value_name = "LIST")]
    pub observe: Option<String>,
    /// Set an option of the solver: reltol=1e-8, method=trap, hmax=auto (repeatable; beats the file)
    #[arg(long, value_name = "KEY=VALUE")]
    pub option: Vec<String>,
    /// End of the run: 1.5s
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub until: Option<String>,
    /// Output interval: 1ms
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub step: Option<String>,
    /// A folder in which imports are looked for, after that of the file that imports (repeatable)
    #[arg(short = 'I', value_name = "DIR")]
    pub include: Vec<String>,
}

/// How a netlist is read.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct DeckFlags {
    /// The dialect of a netlist: ngspice, xyce, ltspice, spice; without it guessed from what the text says
    #[arg(long, value_name = "DIALECT")]
    pub dialect: Option<String>,
    /// Read no file outside of this folder that a netlist names (.include, .lib, tables)
    #[arg(long, value_name = "DIR")]
    pub confine: Option<String>,
}

impl DeckFlags {
    /// Adds the flags to those of a model.
    ///
    /// # Errors
    /// The exit code, when what is wrong has been said.
    pub fn add_to(&self, overrides: &mut Overrides, session: &mut Session) -> Result<(), Exit> {
        if let Some(name) = &self.dialect {
            dialect(name).map_err(|error| session.fail(*error))?;
        }
        overrides.dialect = self.dialect.clone();
        overrides.confine = self.confine.clone();
        Ok(())
    }
}

/// The dialect of a name that netlists are read in.
///
/// # Errors
/// That there is none.
pub fn dialect(name: &str) -> Result<&'static Dialect, Box<Diagnostic>> {
    let found = dialects::find(name).filter(|dialect| dialect.read.is_some());
    found.ok_or_else(|| {
        let message = format!("netlists in the dialect `{name}` are not read");
        let error = Diagnostic::error("E0943", Span::NONE, message);
        Box::new(match nearest(&name.to_lowercase(), dialects::read_names()) {
            Some(meant) => error.help(format!("did you mean `{meant}`?")),
            None => {
                let names: Vec<&str> = dialects::read_names().collect();
                error.help(format!("known: {}", names.join(", ")))
            }
        })
    })
}

/// How a netlist is to be read, by the flags.
pub fn how(overrides: &Overrides) -> How {
    How {
        dialect: overrides.dialect.as_deref().and_then(dialects::find),
        confine: overrides.confine.clone(),
        folders: overrides.folders.clone(),
    }
}

/// Flags of a command that reads a model and writes a result as text or JSON.
#[derive(Clone, Debug, clap::Args)]
pub struct ReportFlags {
    /// The bond graph (.bg); - for standard input
    pub file: String,
    #[command(flatten)]
    /// What to change in it.
    pub model: ModelFlags,
    /// Form of the result
    #[arg(long, value_name = "FORM", value_parser = ["text", "json"], default_value = "text")]
    pub format: String,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<String>,
}

impl ModelFlags {
    /// Reads a file that must hold a bond graph, and what is to be changed in it; `what` is to be done with it.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn of(
        &self,
        file: &str,
        what: &str,
        session: &mut Session,
    ) -> Result<(FileId, Overrides), Exit> {
        let overrides = self.overrides(session)?;
        let file = session.load(file)?;
        pipeline::require_bond(session, file, what)?;
        Ok((file, overrides))
    }

    /// The flags in the words of elaboration.
    ///
    /// # Errors
    /// The exit code, when what is wrong has been said.
    pub fn overrides(&self, session: &mut Session) -> Result<Overrides, Exit> {
        Ok(Overrides {
            set: pairs("--set", &self.set, session)?,
            drive: self.drive.clone(),
            observe: self.observe.clone(),
            until: self.until.clone(),
            step: self.step.clone(),
            options: pairs("--option", &self.option, session)?,
            folders: self.include.clone(),
            ..Overrides::default()
        })
    }
}

/// `NAME=VALUE` into its two sides.
fn pairs(
    flag: &str,
    texts: &[String],
    session: &mut Session,
) -> Result<Vec<(String, String)>, Exit> {
    let split = |text: &String| {
        let (name, value) = text.split_once('=')?;
        let (name, value) = (name.trim(), value.trim());
        (!name.is_empty() && !value.is_empty()).then(|| (name.to_string(), value.to_string()))
    };
    texts
        .iter()
        .map(|text| {
            split(text).ok_or_else(|| {
                let message = format!("{flag} takes NAME=VALUE, not `{text}`");
                session.fail(Diagnostic::error("E0940", Span::NONE, message))
            })
        })
        .collect()
}
