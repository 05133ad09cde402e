//! The step `adding`: adds the module of `docs/adding-a-module.md` and the board of `docs/porting.md` to a copy of the
//! project, and tests them there: the suite runs on the new board, with every module.
//!
//! The pages and this step use the same patches, so the pages cannot be out of date.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;
use fs_err as fs;

use crate::command;
use crate::toolchain::TARGET;
use crate::workspace::{ALL, SUITE, Workspace};

/// A page can be a patch, too: git skips the text between its blocks.
const PATCHES: [&str; 2] = ["docs/adding-a-module.patch", "docs/porting.md"];

/// The packages with files in the patches and with tests of the rows.
const PACKAGES: [&str; 4] = ["board-support", "firmware", "modio-drivers", "register-map"];

/// The new board.
const BOARD: &str = "modio-04";

/// What xtask and the conformance suite test: that every board is in the generated documents and in the workflows, and
/// that the points of every module can be read and written.
const TESTS: [&str; 3] = [
    "docs::tests::the_files_are_up_to_date",
    "matrix_of_every_board_runs_at_night",
    "a_board_conforms_with_every_module",
];

/// Writes the generated documents and tests the changed packages, then runs the suite on the image of the new board.
pub fn check(workspace: &mut Workspace) -> Result<()> {
    let copy = patched(workspace)?;
    let program = copy.program("xtask")?;
    let xtask = || {
        let mut xtask = Command::new(&program);
        // The variable of the cargo that runs this process names the project.
        xtask.env_remove("CARGO_MANIFEST_DIR");
        xtask.env("CARGO_BUILD_BUILD_DIR", &workspace.target);
        xtask.current_dir(&copy.root);
        xtask
    };
    command::run(xtask().arg("docs"))?;
    let mut host = copy.cargo("test");
    host.args(PACKAGES.map(|package| format!("--package={package}")));
    // Without the tests of the store, which take longest.
    command::run(host.args(["--lib", "--test=blocks"]))?;
    command::run(xtask().args(["build", "--board", BOARD]))?;
    let mut simulated = copy.cargo("test");
    simulated.args(ALL).args(["--features", SUITE]);
    simulated.args(["--bin=xtask", "--test=suite", "--", "--include-ignored"]);
    simulated.args(TESTS).env("MODIO_BOARD", BOARD);
    let images = copy.target.join(BOARD).join(TARGET).join("firmware");
    command::run(simulated.env("MODIO_IMAGES_MODIO_04", images))
}

/// Returns a copy of the project with the patches. Its build uses the dependencies that are already compiled for the
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
    command::run(git.current_dir(&root).arg("apply").args(PATCHES))?;
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
    fn the_tests_exist() {
        let files = [
            include_str!("docs.rs"),
            include_str!("workflows.rs"),
            include_str!("../../tools/conformance/tests/suite/main.rs"),
        ];
        for (file, test) in files.into_iter().zip(TESTS) {
            let (_, name) = test.rsplit_once("::").unwrap_or(("", test));
            assert!(file.contains(&format!("fn {name}()")), "{test}");
        }
    }
}
