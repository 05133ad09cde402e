//! What a release needs of git: a commit without changes, and with a tag the tag of this version at this commit, and a
//! security epoch that follows the highest one of the tags before.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::command;
use crate::error::usage;
use crate::keys::PRODUCTION;
use crate::sources::{self, Sources};

/// Refuses sources that no commit has, and public keys of releases that it has not.
pub fn check_commit(root: &Path, sources: &Sources) -> Result<()> {
    let commit = &sources.commit;
    if commit.ends_with("-dirty") || commit == "unknown" {
        return Err(usage(format!(
            "the commit of these sources is {commit}; a release needs a commit without changes"
        )));
    }
    let mut git = Command::new("git");
    git.current_dir(root);
    let tracked = git.args(["ls-files", "--error-unmatch", PRODUCTION]);
    if root.join(PRODUCTION).exists() && command::read(tracked).is_err() {
        return Err(usage(format!(
            "{PRODUCTION} is in no commit, so nobody could build these files again: git add and commit it"
        )));
    }
    Ok(())
}

/// Refuses a tag that is not the one of these sources, and an epoch that does not follow. `jump` allows one that is more
/// than one higher: a confirmed image of epoch 65535 is the last one that a unit ever takes.
pub fn check(root: &Path, tag: &str, sources: &Sources, jump: bool) -> Result<()> {
    let git = |arguments: &[&str]| {
        let printed = command::read(Command::new("git").current_dir(root).args(arguments));
        printed.map(|text| text.trim_end().to_owned())
    };
    let version = &sources.version;
    if !version.pre.is_empty() {
        return Err(usage(format!(
            "version {version} is not a release; docs/releasing.md says how it becomes one"
        )));
    }
    if tag != format!("v{version}") {
        return Err(usage(format!(
            "the tag {tag} is not the tag of these sources, v{version}"
        )));
    }
    if git(&["rev-parse", "--is-shallow-repository"])? == "true" {
        return Err(usage(
            "this clone has no history, which has the epoch of the tag before: git fetch --unshallow --tags",
        ));
    }
    let commit = git(&[
        "rev-parse",
        "--verify",
        &format!("refs/tags/{tag}^{{commit}}"),
    ]);
    if commit.map_err(|_| usage(format!("there is no tag {tag}")))? != git(&["rev-parse", "HEAD"])?
    {
        return Err(usage(format!("the tag {tag} is not at this commit")));
    }
    let tags = git(&["tag", "--merged", "HEAD", "--list", "v*"])?;
    let epochs = tags.lines().filter(|other| *other != tag).map(|other| {
        // A tag from before the workspace had a version, too, has no epoch.
        git(&["show", &format!("{other}:Cargo.toml")])
            .and_then(|manifest| sources::read(&manifest))
            .map_or(0, |(_, epoch)| epoch)
    });
    // The highest, whatever the names of the tags are.
    let before = epochs.max().unwrap_or_default();
    let epoch = sources.epoch;
    if epoch < before {
        return Err(usage(format!(
            "epoch {epoch} is below {before}, that of a tag before: no unit would take these images"
        )));
    }
    if epoch > before.saturating_add(1) && !jump {
        return Err(usage(format!(
            "epoch {epoch} is more than one above {before}, the highest of the tags before; --epoch-jump says that this is \
             meant"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fs_err as fs;

    /// A repository with a commit for each of these manifests, and a tag at each that has one.
    fn repository(commits: &[(&str, u16, Option<&str>)]) -> tempfile::TempDir {
        let directory = tempfile::tempdir().unwrap();
        let git = |arguments: &[&str]| {
            let identity = [
                "-c",
                "user.name=a",
                "-c",
                "user.email=a@b",
                "-c",
                "tag.gpgsign=false",
            ];
            let mut git = Command::new("git");
            git.current_dir(directory.path()).args(identity);
            command::read(git.args(arguments)).unwrap();
        };
        git(&["init", "--quiet"]);
        for (version, epoch, tag) in commits {
            let epoch = match epoch {
                0 => String::new(),
                epoch => format!("[workspace.metadata.modio]\nepoch = {epoch}\n"),
            };
            let manifest = format!("[workspace.package]\nversion = \"{version}\"\n{epoch}");
            fs::write(directory.path().join("Cargo.toml"), manifest).unwrap();
            git(&["add", "."]);
            git(&["commit", "--quiet", "--message", "a"]);
            if let Some(tag) = tag {
                git(&["tag", tag]);
            }
        }
        directory
    }

    fn checked(root: &Path, tag: &str, jump: bool) -> Result<(), String> {
        let sources = Sources::of(root).unwrap();
        check_commit(root, &sources).map_err(|error| error.to_string())?;
        check(root, tag, &sources, jump).map_err(|error| error.to_string())
    }

    fn refused(root: &Path, tag: &str, part: &str) {
        let error = checked(root, tag, false).unwrap_err();
        assert!(error.contains(part), "{error}");
    }

    #[test]
    fn tag_is_that_of_the_version_at_this_commit_without_changes() {
        let repository = repository(&[("1.2.3", 0, Some("v1.2.3")), ("1.2.4", 0, Some("v1.2.4"))]);
        let root = repository.path();
        assert_eq!(checked(root, "v1.2.4", false), Ok(()));
        refused(root, "v1.2.3", "not the tag of these sources");
        let git = |arguments: &[&str]| {
            command::read(Command::new("git").current_dir(root).args(arguments)).unwrap()
        };
        git(&["tag", "--delete", "v1.2.4"]);
        refused(root, "v1.2.4", "no tag");
        git(&["tag", "v1.2.4", "HEAD~"]);
        refused(root, "v1.2.4", "not at this commit");
        git(&["tag", "--force", "v1.2.4"]);
        assert_eq!(checked(root, "v1.2.4", false), Ok(()));
        let shallow = tempfile::tempdir().unwrap();
        let from = format!("file://{}", root.display());
        let to = shallow.path().join("clone");
        let mut clone = Command::new("git");
        clone
            .args(["clone", "--quiet", "--depth=1", &from])
            .arg(&to);
        command::read(&mut clone).unwrap();
        refused(&to, "v1.2.4", "no history");
        let public = root.join(PRODUCTION);
        fs::create_dir_all(public.parent().unwrap()).unwrap();
        fs::write(&public, "keys").unwrap();
        refused(root, "v1.2.4", "is in no commit");
        fs::remove_file(public).unwrap();
        fs::write(
            root.join("Cargo.toml"),
            "[workspace.package]\nversion = \"1.2.4\"\n\n",
        )
        .unwrap();
        refused(root, "v1.2.4", "without changes");
    }

    #[test]
    fn version_with_dev_is_no_release() {
        let repository = repository(&[("1.2.3-dev", 0, Some("v1.2.3-dev"))]);
        refused(repository.path(), "v1.2.3-dev", "not a release");
    }

    #[test]
    fn epoch_follows_that_of_the_tag_before() {
        let of = |before, now| {
            repository(&[
                ("1.9.0", before, Some("v1.9.0")),
                ("1.10.0-dev", 9, None),
                ("1.10.0", now, Some("v1.10.0")),
            ])
        };
        for (before, now) in [(0, 0), (0, 1), (4, 4), (4, 5)] {
            assert_eq!(checked(of(before, now).path(), "v1.10.0", false), Ok(()));
        }
        refused(of(4, 3).path(), "v1.10.0", "below 4");
        let jump = of(4, 6);
        refused(jump.path(), "v1.10.0", "more than one above 4");
        assert_eq!(checked(jump.path(), "v1.10.0", true), Ok(()));
        // A tag with another name, at sources without an epoch, hides nothing.
        let odd = repository(&[
            ("1.8.0", 0, Some("verified")),
            ("1.9.0", 1, Some("v1.9.0")),
            ("1.10.0", 0, Some("v1.10.0")),
        ]);
        refused(odd.path(), "v1.10.0", "below 1");
        let first = repository(&[("1.0.0", 2, Some("v1.0.0"))]);
        refused(first.path(), "v1.0.0", "more than one above 0");
    }
}
