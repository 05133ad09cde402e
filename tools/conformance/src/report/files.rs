//! The files of the reports.

use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

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
