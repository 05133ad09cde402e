//! A program for the host, as a file that runs without Rust and without this repository.
//!
//! On Linux it is linked against musl, so that it needs no library of the system and runs on every distribution.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::workspace::Workspace;
use crate::{Failure, Result, command};

/// Longest time for rustup to fetch a target, which is about 40 MB.
const FETCHING: Duration = Duration::from_secs(300);

/// Builds a package's program, and gives its file and the name that it has in a release. `with` may add to cargo's
/// environment.
///
/// # Errors
///
/// When rustup cannot fetch the target, or it does not build.
pub fn build(
    workspace: &Workspace,
    package: &str,
    program: &str,
    with: impl FnOnce(&mut Command),
) -> Result<(PathBuf, String)> {
    let host = host(&command::read(Command::new("rustc").arg("-vV"))?)?;
    let target = target(&host);
    if target != host {
        have(workspace.root(), &target)?;
    }
    let mut cargo = workspace.cargo("build");
    cargo.args(["--locked", "--ignore-rust-version", "--profile", "tool"]);
    cargo.args(["--package", package, "--bin", program, "--target", &target]);
    with(&mut cargo);
    command::run(&mut cargo)?;
    let suffix = std::env::consts::EXE_SUFFIX;
    let built = workspace.target().join(&target).join("tool");
    Ok((
        built.join(format!("{program}{suffix}")),
        format!("{program}-{target}{suffix}"),
    ))
}

/// Copies a built program into a release.
///
/// # Errors
///
/// When the file cannot be copied.
pub fn copy(file: &Path, to: &Path) -> Result<()> {
    fs::copy(file, to)
        .map(|_| ())
        .map_err(|error| Failure::new(format!("cannot copy {}: {error}", file.display())))
}

/// The machine's own target, from what `rustc -vV` says.
fn host(version: &str) -> Result<String> {
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned)
        .ok_or_else(|| Failure::new("rustc does not say which target this machine is"))
}

/// What the tool is built for on a machine: Linux with musl, others as they are.
fn target(host: &str) -> String {
    match host.split_once("-unknown-linux-") {
        Some((processor, _)) => format!("{processor}-unknown-linux-musl"),
        None => host.to_owned(),
    }
}

/// Has rustup fetch a target that is not there.
fn have(root: &Path, target: &str) -> Result<()> {
    let print = ["--print", "target-libdir", "--target", target];
    let directory = command::read(Command::new("rustc").args(print).current_dir(root))?;
    if Path::new(directory.trim()).is_dir() {
        return Ok(());
    }
    let mut rustup = Command::new("rustup");
    rustup.args(["target", "add", target]).current_dir(root);
    let output = command::within(FETCHING, &mut rustup)?;
    if output.status.success() {
        return Ok(());
    }
    let why = command::complaint(&output);
    Err(Failure::new(format!(
        "the target {target} is missing: `rustup target add {target}` ({why})"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_linux_the_tool_needs_no_library_of_the_system() {
        let version = "rustc 1.95.0\nbinary: rustc\nhost: aarch64-unknown-linux-gnu\n";
        let host = host(version).unwrap();
        assert_eq!(target(&host), "aarch64-unknown-linux-musl");
        assert_eq!(target("x86_64-pc-windows-msvc"), "x86_64-pc-windows-msvc");
        assert_eq!(target("aarch64-apple-darwin"), "aarch64-apple-darwin");
        assert!(super::host("rustc 1.95.0").is_err());
    }
}
