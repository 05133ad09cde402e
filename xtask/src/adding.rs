//! The step `adding`: adds the module of `docs/adding-a-module.md` to a copy of the project, and tests it there.
//!
//! The page and this step use the same patch, so the page cannot be out of date.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;
use fs_err as fs;
use register_map::board::MODIO_02;

use crate::workspace::{ALL, SUITE, Workspace};
use crate::{command, images};

const PATCH: &str = "docs/adding-a-module.patch";

/// The packages with files in the patch.
const PACKAGES: [&str; 3] = ["firmware", "modio-drivers", "register-map"];

/// The test of the conformance suite that reads and writes the points of every module.
const TEST: &str = "a_modio_02_conforms_with_every_module";

/// Writes the generated documents and tests the changed packages, then runs the suite on the image with every module.
pub fn check(workspace: &mut Workspace) -> Result<()> {
    let mut copy = patched(workspace)?;
    let mut docs = Command::new(copy.program("xtask")?);
    // The variable of the cargo that runs this process names the project.
    docs.env_remove("CARGO_MANIFEST_DIR");
    command::run(docs.arg("docs").current_dir(&copy.root))?;
    let mut host = copy.cargo("test");
    host.args(PACKAGES.map(|package| format!("--package={package}")));
    // Without the tests of the store, which take longest.
    command::run(host.args(["--lib", "--test=blocks"]))?;
    let images = images::variables(&mut copy, &[&MODIO_02])?;
    let mut simulated = copy.cargo("test");
    simulated.args(ALL).args(["--features", SUITE]);
    simulated.args(["--test=suite", "--", "--include-ignored", TEST]);
    command::run(simulated.envs(images))
}

/// Returns a copy of the project with the patch. Its build uses the dependencies that are already compiled for the
/// project.
fn patched(workspace: &Workspace) -> Result<Workspace> {
    let root = workspace.root.join("target").join("adding");
    if root.exists() {
        fs::remove_dir_all(&root)?;
    }
    for file in files(&workspace.root)? {
        let to = root.join(&file);
        fs::create_dir_all(to.parent().unwrap_or(&root))?;
        fs::copy(workspace.root.join(file), to)?;
    }
    // Cargo keeps packages with another version apart, so it does not build those of the project again after this step.
    let manifest = root.join("Cargo.toml");
    let text = fs::read_to_string(&manifest)?;
    fs::write(
        manifest,
        text.replacen("\nversion = ", "\nversion = \"0.0.0\" # ", 1),
    )?;
    let mut git = Command::new("git");
    // The copy is in a directory that git ignores, so git must not look for the repository.
    git.env("GIT_CEILING_DIRECTORIES", workspace.root.join("target"));
    command::run(git.current_dir(&root).args(["apply", PATCH]))?;
    let shared = format!("build.build-dir={:?}", workspace.target);
    let mut copy = workspace.with(root.join("target"), vec!["--config".to_owned(), shared]);
    copy.root = root;
    Ok(copy)
}

/// Returns the files of the project that git knows or would add. Cargo finds the configuration in the directory above
/// the copy; a second one would double its flags.
fn files(root: &Path) -> Result<Vec<PathBuf>> {
    let mut git = Command::new("git");
    git.current_dir(root);
    let list =
        command::read(git.args("ls-files -z --cached --others --exclude-standard".split(' ')))?;
    let files = list.split_terminator('\0').map(PathBuf::from);
    Ok(files
        .filter(|file| !file.starts_with(".cargo") && root.join(file).is_file())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run without a test would pass.
    #[test]
    fn the_test_of_every_module_exists() {
        let suite = include_str!("../../tools/conformance/tests/suite/main.rs");
        assert!(suite.contains(&format!("fn {TEST}()")));
    }
}
