//! What the commands of this package have in common: arguments in, one line and exit status 2 when nothing
//! could be tested, reports into files.

use std::fmt::Display;
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;

/// Runs a command of this name by its arguments. `test` gives the exit status, or says in a line why it could
/// not test.
pub fn run<Cli: Parser>(name: &str, test: impl FnOnce(&Cli) -> Result<u8, String>) -> ExitCode {
    let tested = match Cli::try_parse() {
        Ok(cli) => test(&cli),
        Err(error) if error.use_stderr() => Err(one_line(&error)),
        Err(help) => help.exit(),
    };
    match tested {
        Ok(status) => ExitCode::from(status),
        Err(what) => {
            eprintln!("{name}: {what}");
            ExitCode::from(2)
        }
    }
}

/// Tells people a line or more. A reader that has gone, as `head` goes, is no failure: the unit is still to be
/// put back, and the reports are to be written.
pub fn say(text: impl Display) {
    let _ = writeln!(io::stdout(), "{text}");
}

/// The files that reports are to go to.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Files {
    /// Write what came out as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,

    /// Write what came out as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

impl Files {
    /// Makes sure that they can be written, before the time that a test takes is spent.
    ///
    /// # Errors
    ///
    /// Which cannot, and why; or that both are the same.
    pub fn check(&self) -> Result<(), String> {
        if self.junit.is_some() && self.junit == self.json {
            return Err("--junit and --json name the same file".to_owned());
        }
        for path in [&self.junit, &self.json].into_iter().flatten() {
            check(path).map_err(|error| cannot_write(path, &error))?;
        }
        Ok(())
    }

    /// Writes both, one even if the other fails.
    ///
    /// # Errors
    ///
    /// The first that cannot be written: where and why.
    pub fn write(&self, junit: &str, json: &serde_json::Value) -> Result<(), String> {
        let junit = write(self.junit.as_deref(), junit);
        let json = write(self.json.as_deref(), &format!("{json:#}\n"));
        junit.and(json)
    }
}

/// Opens a file for writing and leaves all as it was.
fn check(path: &Path) -> io::Result<()> {
    let is_new = !path.exists();
    OpenOptions::new().append(true).create(true).open(path)?;
    if is_new {
        fs::remove_file(path)?;
    }
    Ok(())
}

fn write(path: Option<&Path>, text: &str) -> Result<(), String> {
    path.map_or(Ok(()), |path| {
        fs::write(path, text).map_err(|error| cannot_write(path, &error))
    })
}

fn cannot_write(path: &Path, error: &io::Error) -> String {
    format!("cannot write {}: {error}", path.display())
}

/// What is wrong with a command line, in one line.
fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map_while(|line| (!line.is_empty()).then(|| line.trim()))
        .collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}
