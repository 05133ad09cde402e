//! `cargo xtask docs`: what is written from the project's own data, docs/register-map.md.

use std::fs;

use crate::workspace::Workspace;
use crate::{Failure, Result};

/// `cargo xtask docs`.
///
/// # Errors
///
/// When the file cannot be written.
pub fn run(workspace: &Workspace) -> Result<()> {
    let path = workspace.root().join("docs/register-map.md");
    let mut text = String::new();
    register_map::docs::write_markdown(&mut text)
        .map_err(|_| Failure::new("the register map could not be put into words"))?;
    fs::write(&path, text)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))?;
    eprintln!("wrote {}", path.display());
    Ok(())
}
