//! The sources as they are when xtask runs: version, commit and security epoch. xtask may have been compiled earlier.

use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result};
use fs_err as fs;
use semver::Version;

use crate::command;

/// What a header, a tag and the files of a release say of the sources.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// The version of all packages.
    pub version: Version,
    /// The first eight digits of the commit, followed by `-dirty` when files that git tracks differ from it; `unknown`
    /// outside a git repository.
    pub commit: String,
    /// The security epoch of the images.
    pub epoch: u16,
}

impl Sources {
    /// Reads them in the directory of the root Cargo.toml.
    pub fn of(root: &Path) -> Result<Self> {
        let manifest = root.join("Cargo.toml");
        let (version, epoch) = read(&fs::read_to_string(&manifest)?)
            .with_context(|| manifest.display().to_string())?;
        let describe = [
            "describe",
            "--always",
            "--exclude=*",
            "--abbrev=8",
            "--dirty",
        ];
        let mut git = Command::new("git");
        let commit = command::read(git.current_dir(root).args(describe));
        Ok(Self {
            version,
            commit: commit.map_or("unknown".to_owned(), |line| line.trim_end().to_owned()),
            epoch,
        })
    }
}

/// Returns version and epoch of a root Cargo.toml. One without an epoch has 0.
pub fn read(manifest: &str) -> Result<(Version, u16)> {
    let table: toml::Table = manifest.parse()?;
    let workspace = table.get("workspace").context("no [workspace]")?;
    let version = workspace
        .get("package")
        .and_then(|package| package.get("version"))
        .and_then(toml::Value::as_str)
        .context("no version in [workspace.package]")?;
    let epoch = workspace
        .get("metadata")
        .and_then(|metadata| metadata.get("modio")?.get("epoch"));
    let epoch = match epoch {
        None => 0,
        Some(epoch) => epoch
            .as_integer()
            .and_then(|epoch| epoch.try_into().ok())
            .context("the epoch in [workspace.metadata.modio] is no number from 0 to 65535")?,
    };
    Ok((version.parse()?, epoch))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn version_and_epoch_are_those_of_the_manifest() {
        let manifest = "[workspace.package]\nversion = \"1.2.3-dev\"\n";
        let version = "1.2.3-dev".parse().unwrap();
        assert_eq!(read(manifest).unwrap(), (version, 0));
        let with = |epoch| format!("{manifest}[workspace.metadata.modio]\nepoch = {epoch}\n");
        assert_eq!(read(&with("7")).unwrap().1, 7);
        for wrong in ["65536", "-1", "\"7\""] {
            assert!(read(&with(wrong)).is_err(), "{wrong}");
        }
        assert!(read("[workspace]\n").is_err());
    }

    #[test]
    fn commit_is_asked_when_xtask_runs() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path();
        let git = |arguments: &[&str]| {
            let identity = ["-c", "user.name=a", "-c", "user.email=a@b"];
            let mut git = Command::new("git");
            command::read(git.current_dir(root).args(identity).args(arguments)).unwrap()
        };
        let manifest = root.join("Cargo.toml");
        fs::write(&manifest, "[workspace.package]\nversion = \"1.2.3\"\n").unwrap();
        assert_eq!(Sources::of(root).unwrap().commit, "unknown");
        git(&["init", "--quiet"]);
        git(&["add", "Cargo.toml"]);
        git(&["commit", "--quiet", "--message", "a"]);
        let head = git(&["rev-parse", "--short=8", "HEAD"]);
        assert_eq!(Sources::of(root).unwrap().commit, head.trim_end());
        fs::write(&manifest, "[workspace.package]\nversion = \"1.2.4\"\n").unwrap();
        let changed = Sources::of(root).unwrap();
        assert_eq!(changed.commit, format!("{}-dirty", head.trim_end()));
        assert_eq!(changed.version.patch, 4);
    }
}
