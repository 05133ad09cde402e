//! `cargo xtask docs`: writes docs/register-map.md from the register map.

use anyhow::Result;

use crate::workspace::Workspace;

/// `cargo xtask docs`.
pub fn run(workspace: &Workspace) -> Result<()> {
    let path = workspace.root().join("docs/register-map.md");
    let mut text = String::new();
    register_map::docs::write_markdown(&mut text)?;
    fs_err::write(&path, text)?;
    say!("wrote {}", path.display());
    Ok(())
}
