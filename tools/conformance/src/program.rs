//! What the commands of this package share: they parse their arguments, print one line and end with status 2 when
//! nothing could be tested, and write reports to files.

use std::fmt::Display;
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::Parser;

/// Runs a command of this name and version with its arguments. `test` returns the exit status, or why nothing could be
/// tested.
pub fn run<Cli: Parser>(
    name: &str,
    version: &'static str,
    test: impl FnOnce(&Cli) -> Result<u8>,
) -> ExitCode {
    let arguments = Cli::command().version(version).try_get_matches();
    let tested = match arguments.and_then(|found| Cli::from_arg_matches(&found)) {
        Ok(cli) => test(&cli),
        Err(error) if error.use_stderr() => Err(anyhow!(one_line(&error))),
        Err(help) => help.exit(),
    };
    match tested {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            eprintln!("{name}: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Prints one or more lines. A reader that has closed the pipe, as `head` does, is no error: the unit must still be
/// restored, and the reports written.
pub fn say(text: impl Display) {
    let _ = writeln!(io::stdout(), "{text}");
}

/// The files to which reports are written.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Files {
    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,

    /// Write the results as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

impl Files {
    /// Checks that the files can be written. A test takes long, so a wrong path must not show at its end only.
    pub fn check(&self) -> Result<()> {
        if self.junit.is_some() && self.junit == self.json {
            bail!("--junit and --json name the same file");
        }
        let mut paths = [&self.junit, &self.json].into_iter().flatten();
        paths.try_for_each(|path| check(path).with_context(|| cannot_write(path)))
    }

    /// Writes both reports, the second also when the first cannot be written.
    pub fn write(&self, junit: &str, json: &serde_json::Value) -> Result<()> {
        let junit = write(self.junit.as_deref(), junit);
        let json = write(self.json.as_deref(), &format!("{json:#}\n"));
        junit.and(json)
    }
}

/// Opens a file for writing, and leaves the file as it was.
fn check(path: &Path) -> io::Result<()> {
    let is_new = !path.exists();
    OpenOptions::new().append(true).create(true).open(path)?;
    if is_new {
        fs::remove_file(path)?;
    }
    Ok(())
}

fn write(path: Option<&Path>, text: &str) -> Result<()> {
    path.map_or(Ok(()), |path| {
        fs::write(path, text).with_context(|| cannot_write(path))
    })
}

fn cannot_write(path: &Path) -> String {
    format!("cannot write {}", path.display())
}

fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map_while(|line| (!line.is_empty()).then(|| line.trim()))
        .collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}
