//! `cargo xtask ci`: formatting, lints and documentation with every warning an error, for the host and
//! for the microcontroller, then the steps of `cargo xtask test`.

use std::process::Command;

use crate::steps::Steps;
use crate::toolchain::Need;
use crate::workspace::Workspace;
use crate::{Result, build, command, test};

/// What ends up in the image.
const TARGET_PACKAGES: [&str; 5] = [
    "firmware",
    "board-support",
    "modio-drivers",
    "modbus-server",
    "register-map",
];

/// `cargo xtask ci`.
///
/// # Errors
///
/// When a step failed; all have been run and the summary printed.
pub fn run(workspace: &mut Workspace) -> Result<()> {
    let mut steps = Steps::default();
    steps.run("formatting", || {
        command::run(workspace.cargo("fmt").args(["--all", "--check"])).into()
    });
    steps.run("lints, host", || {
        command::run(&mut host_lints(workspace.cargo("clippy"))).into()
    });
    steps.run("lints, target", || {
        let cargo = workspace.target_cargo(Need::Lint, "clippy");
        cargo
            .and_then(|cargo| command::run(&mut target_lints(cargo)))
            .into()
    });
    steps.run("documentation", || {
        command::run(&mut documentation(workspace.cargo("doc"))).into()
    });
    test::add(workspace, &mut steps, true);
    steps.finish()
}

fn host_lints(mut cargo: Command) -> Command {
    cargo.args([
        "--workspace",
        "--all-targets",
        "--ignore-rust-version",
        "--",
        "-Dwarnings",
    ]);
    cargo
}

fn target_lints(mut cargo: Command) -> Command {
    cargo.args(["--profile", build::PROFILE, "--features", "firmware/board"]);
    for package in TARGET_PACKAGES {
        cargo.args(["--package", package]);
    }
    cargo.args(["--", "-Dwarnings"]);
    cargo
}

fn documentation(mut cargo: Command) -> Command {
    cargo.args([
        "--workspace",
        "--no-deps",
        "--ignore-rust-version",
        "--document-private-items",
    ]);
    cargo.env("RUSTDOCFLAGS", "-Dwarnings");
    cargo
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(command: &Command) -> Vec<String> {
        command
            .get_args()
            .map(|argument| argument.to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn warnings_are_errors_everywhere() {
        for lints in [
            host_lints(Command::new("cargo")),
            target_lints(Command::new("cargo")),
        ] {
            assert_eq!(arguments(&lints).last().unwrap(), "-Dwarnings");
        }
        let documentation = documentation(Command::new("cargo"));
        let flags = documentation
            .get_envs()
            .find(|(name, _)| *name == "RUSTDOCFLAGS");
        assert_eq!(flags.unwrap().1.unwrap(), "-Dwarnings");
    }

    #[test]
    fn every_package_of_the_image_is_linted_for_the_target() {
        let lints = arguments(&target_lints(Command::new("cargo")));
        for package in TARGET_PACKAGES {
            assert!(lints.contains(&package.to_owned()), "{package}");
        }
    }
}
