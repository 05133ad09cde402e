//! The paths of this machine, which must not be in the files of a release.
//!
//! rustc writes the paths of sources into debug information and panic messages. The builds of a release therefore
//! replace the directories that differ from machine to machine. They have a target directory of their own, because
//! cargo does not compile again when only these replacements change.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use serde_json::json;

use super::rustc;
use crate::toolchain::TARGET;
use crate::workspace::Workspace;

/// Directories of this machine, and the names that replace them. If several match, the last one is used, as in rustc.
#[derive(Debug)]
pub struct Paths(Vec<(PathBuf, String)>);

impl Paths {
    /// Returns the directories of the sources, the target directory, and those of cargo and of the toolchain.
    pub fn of(workspace: &Workspace) -> Result<Self> {
        let sysroot = PathBuf::from(rustc(&["--print", "sysroot"])?);
        let version = rustc(&["-vV"])?;
        let commit = version
            .lines()
            .find_map(|line| line.strip_prefix("commit-hash: "));
        let cargo = std::env::var_os("CARGO_HOME").map(PathBuf::from);
        let cargo = cargo.or_else(|| Some(std::env::home_dir()?.join(".cargo")));
        Ok(Self(vec![
            (cargo.context("no home directory")?, "/cargo".to_owned()),
            (
                // The sources of `std`, when they are installed, have the names that they have in the compiled `std`.
                sysroot.join("lib/rustlib/src/rust"),
                format!("/rustc/{}", commit.unwrap_or("unknown")),
            ),
            (workspace.root.to_owned(), "/modio".to_owned()),
            (directory(workspace), "/modio/target".to_owned()),
        ]))
    }

    /// Returns the project with the builds of a release: for the boards, and for programs of this target.
    pub fn reproducible(&self, workspace: &Workspace, target: &str) -> Workspace {
        let flags = self.0.iter().map(|(from, to)| {
            let from = from.display();
            format!("--remap-path-prefix={from}={to}")
        });
        // A string in JSON is a string in TOML.
        let flags = json!(flags.collect::<Vec<_>>());
        let mut settings = vec![
            format!("target.{TARGET}.rustflags={flags}"),
            format!("target.{target}.rustflags={flags}"),
        ];
        if target.ends_with("-linux-musl") {
            // rustc's own linker, so that the bytes do not depend on the one of this machine.
            settings.push(format!("target.{target}.linker=\"rust-lld\""));
        }
        let mut arguments = vec!["--locked".to_owned()];
        for setting in settings {
            arguments.extend(["--config".to_owned(), setting]);
        }
        workspace.with(directory(workspace), arguments)
    }

    /// Returns a text with all of these directories replaced.
    pub fn replaced(&self, text: &str) -> String {
        let replace = |text: String, (from, to): &(PathBuf, String)| {
            text.replace(&*from.to_string_lossy(), to)
        };
        self.0.iter().rev().fold(text.to_owned(), replace)
    }
}

/// Returns the target directory of the builds of a release.
fn directory(workspace: &Workspace) -> PathBuf {
    workspace.target.join("release-files")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_directory_that_matches_is_replaced() {
        let paths = [("/home/x", "/a"), ("/home/x/target", "/b")];
        let paths = Paths(paths.map(|(from, to)| (from.into(), to.into())).into());
        let text = paths.replaced("/home/x/src/lib.rs /home/x/target/build /home/y");
        assert_eq!(text, "/a/src/lib.rs /b/build /home/y");
    }
}
