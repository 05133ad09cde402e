//! Where the project and its build products are, and which toolchain was found for the target.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::toolchain::{self, Need, Way};
use crate::{Failure, Result, command};

/// The project on this machine.
#[derive(Debug)]
pub struct Workspace {
    root: PathBuf,
    target: PathBuf,
    way: Option<(Need, Way)>,
}

impl Workspace {
    /// Finds the project that xtask was built from, and cargo's target directory.
    ///
    /// # Errors
    ///
    /// When cargo cannot be asked.
    pub fn open() -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = root.parent().unwrap_or(root).to_owned();
        let text = command::read(cargo_in(&root, "metadata").args([
            "--no-deps",
            "--offline",
            "--format-version",
            "1",
        ]))?;
        let target = target_directory(&text)
            .ok_or_else(|| Failure::new("`cargo metadata` names no target directory"))?;
        Ok(Self {
            root,
            target,
            way: None,
        })
    }

    /// The directory of the root Cargo.toml.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Cargo's target directory.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Cargo for the host, run at the root.
    #[must_use]
    pub fn cargo(&self, subcommand: &str) -> Command {
        cargo_in(&self.root, subcommand)
    }

    /// Cargo for the microcontroller, run at the root. The way to compile for it is looked for once
    /// and told in one line on stderr.
    ///
    /// # Errors
    ///
    /// When this machine has no way, with what to install.
    pub fn target_cargo(&mut self, need: Need, subcommand: &str) -> Result<Command> {
        let way = match self.way {
            Some((found, way)) if found >= need => way,
            _ => {
                let mut machine = toolchain::ThisMachine::new(&self.root);
                let way = toolchain::find(&mut machine, need, &mut |line| eprintln!("{line}"))?;
                self.way = Some((need, way));
                way
            }
        };
        let mut command = way.cargo(subcommand);
        command.current_dir(&self.root);
        Ok(command)
    }
}

fn cargo_in(root: &Path, subcommand: &str) -> Command {
    // The cargo that runs xtask, so that both use the same toolchain.
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root).arg(subcommand);
    command
}

fn target_directory(metadata: &str) -> Option<PathBuf> {
    let metadata: serde_json::Value = serde_json::from_str(metadata).ok()?;
    Some(metadata.get("target_directory")?.as_str()?.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_directory_is_where_cargo_says() {
        assert_eq!(
            target_directory(r#"{"packages":[],"target_directory":"/x/target"}"#),
            Some("/x/target".into())
        );
        assert_eq!(target_directory("{}"), None);
        assert_eq!(target_directory("cargo: not found"), None);
    }

    #[test]
    fn the_project_is_found() {
        let workspace = Workspace::open().unwrap();
        assert!(workspace.root().join("xtask/src/workspace.rs").is_file());
        assert!(workspace.target().is_absolute());
    }
}
