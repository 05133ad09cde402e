//! `cargo xtask build`: every program of a board, and the file of an update; and the variables with which tests find them.

use std::path::PathBuf;

use anyhow::Result;
use register_map::Row;

use crate::build::{self, Options};
use crate::signed;
use crate::workspace::Workspace;

/// `cargo xtask build`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    for file in all(workspace, options.board)? {
        say!("{}", file.display());
    }
    Ok(())
}

/// Builds every program of a board, and returns the files: the loader, the application for both slots, the file of an
/// update that has them, signed with the development key, and the image that runs alone.
pub fn all(workspace: &mut Workspace, board: &'static Row) -> Result<Vec<PathBuf>> {
    let loader = build::loader(workspace, board)?;
    let ([a, b], update) = signed::update(workspace, board)?;
    let slots = [a, b].map(|image| image.with_extension(""));
    let alone = build::image(workspace, board)?;
    let bin = alone.with_extension("bin");
    Ok([vec![loader], slots.into(), vec![update, alone, bin]].concat())
}

/// Builds the loader of these boards, and the signed images for both slots. Returns for each board the variable with which
/// tests find the directory of these files.
pub fn variables(
    workspace: &mut Workspace,
    boards: &[&'static Row],
) -> Result<Vec<(String, PathBuf)>> {
    let mut directories = Vec::new();
    for board in boards {
        let loader = build::loader(workspace, board)?;
        signed::update(workspace, board)?;
        let name = board.name.to_uppercase().replace('-', "_");
        directories.push((format!("MODIO_IMAGES_{name}"), loader.with_file_name("")));
    }
    Ok(directories)
}
