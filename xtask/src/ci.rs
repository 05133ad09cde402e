//! `cargo xtask ci`: formatting, lints and documentation with every warning an error, for the host and
//! for the microcontroller, then the steps of `cargo xtask test`, the tests of the image at the extremes of the part, the figures of `cargo xtask bench` against the
//! baseline, and every fuzz target for a short time.

use std::process::Command;

use register_map::Board;

use crate::steps::Steps;
use crate::toolchain::Need;
use crate::workspace::Workspace;
use crate::{Result, bench, build, command, fuzz, peers, renode, test};

/// What ends up in the image.
const TARGET_PACKAGES: [&str; 5] = [
    "firmware",
    "board-support",
    "modio-drivers",
    "modbus-server",
    "register-map",
];

/// The workspaces there are.
const WORKSPACES: [&str; 4] = ["Cargo.toml", fuzz::MANIFEST, bench::RIVALS, peers::MANIFEST];

/// `cargo xtask ci`.
///
/// # Errors
///
/// When a step failed; all have been run and the summary printed.
pub fn run(workspace: &mut Workspace) -> Result<()> {
    let mut steps = Steps::default();
    steps.run("formatting", || {
        let [modio, fuzz, rivals, peers] = WORKSPACES.map(|manifest| {
            let mut cargo = workspace.cargo("fmt");
            command::run(cargo.args(["--all", "--check", "--manifest-path", manifest]))
        });
        modio.and(fuzz).and(rivals).and(peers).into()
    });
    steps.run("lints, host", || {
        command::run(&mut host_lints(workspace.cargo("clippy"))).into()
    });
    for board in Board::ALL {
        steps.run(&format!("lints, target, {board}"), || {
            let cargo = workspace.target_cargo(Need::Lint, "clippy");
            cargo
                .and_then(|cargo| command::run(&mut target_lints(cargo, board)))
                .into()
        });
    }
    steps.run("lints, fuzz targets", || {
        let mut cargo = workspace.cargo("clippy");
        cargo.args(["--locked", "--target-dir"]);
        cargo.arg(workspace.target().join("fuzz"));
        command::run(&mut other_lints(cargo, fuzz::MANIFEST)).into()
    });
    steps.run("lints, rivals of the bench", || {
        let cargo = workspace.target_cargo(Need::Lint, "clippy");
        let rivals = workspace.target().join("rivals");
        cargo
            .and_then(|mut cargo| {
                cargo.args(["--release", "--target-dir"]).arg(rivals);
                command::run(&mut other_lints(cargo, bench::RIVALS))
            })
            .into()
    });
    steps.run("lints, peers", || {
        let mut cargo = workspace.cargo("clippy");
        cargo.args(["--locked", "--target-dir"]);
        cargo.arg(workspace.target().join("peers"));
        command::run(&mut other_lints(cargo, peers::MANIFEST)).into()
    });
    steps.run("documentation, host", || {
        command::run(&mut host_documentation(workspace.cargo("doc"))).into()
    });
    for board in Board::ALL {
        steps.run(&format!("documentation, target, {board}"), || {
            let cargo = workspace.target_cargo(Need::Lint, "doc");
            cargo
                .and_then(|cargo| command::run(&mut target_documentation(cargo, board)))
                .into()
        });
    }
    let images = test::add(workspace, &mut steps, true);
    test::add_corners(workspace, &mut steps, &images);
    for board in Board::ALL {
        steps.run(&format!("instructions and bytes, {board}"), || {
            images.step(board, |elf| bench::check(workspace, elf, board).into())
        });
        steps.run(&format!("Renode's suites in simulation, {board}"), || {
            images.step(board, |elf| {
                renode::checks::on_simulator(workspace, board, elf, true)
            })
        });
    }
    steps.run("servers of cargo xtask peers, briefly", || {
        peers::step(workspace)
    });
    steps.run("fuzz targets, briefly", || fuzz::step(workspace, true));
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

fn target_lints(mut cargo: Command, board: &Board) -> Command {
    for_target(&mut cargo, board);
    for package in TARGET_PACKAGES {
        cargo.args(["--package", package]);
    }
    cargo.args(["--", "-Dwarnings"]);
    cargo
}

/// What is compiled for a board.
fn for_target(cargo: &mut Command, board: &Board) {
    cargo.args(["--profile", build::PROFILE]);
    cargo.args(["--features", &format!("firmware/{board}")]);
}

/// Of a workspace of its own.
fn other_lints(mut cargo: Command, manifest: &str) -> Command {
    cargo.args(["--manifest-path", manifest, "--", "-Dwarnings"]);
    cargo
}

fn host_documentation(mut cargo: Command) -> Command {
    cargo.args(["--workspace", "--ignore-rust-version"]);
    // Most of it exists for the target alone.
    cargo.args(["--exclude", "board-support"]);
    documentation(&mut cargo);
    cargo
}

fn target_documentation(mut cargo: Command, board: &Board) -> Command {
    for_target(&mut cargo, board);
    cargo.args(["--package", "board-support", "--package", "firmware"]);
    documentation(&mut cargo);
    cargo
}

fn documentation(cargo: &mut Command) {
    cargo.args(["--no-deps", "--document-private-items"]);
    // Private items are documented too, so links to them lead somewhere.
    let flags = "-Dwarnings -Arustdoc::private-intra-doc-links";
    cargo.env("RUSTDOCFLAGS", flags);
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;

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
            target_lints(Command::new("cargo"), &MODIO_02),
            other_lints(Command::new("cargo"), fuzz::MANIFEST),
        ] {
            assert_eq!(arguments(&lints).last().unwrap(), "-Dwarnings");
        }
        let cargo = || Command::new("cargo");
        for documentation in [
            host_documentation(cargo()),
            target_documentation(cargo(), &MODIO_02),
        ] {
            let mut variables = documentation.get_envs();
            let flags = variables.find(|(name, _)| *name == "RUSTDOCFLAGS");
            let flags = flags.unwrap().1.unwrap();
            assert!(flags.to_str().unwrap().starts_with("-Dwarnings"));
        }
    }

    #[test]
    fn every_package_of_the_image_is_linted_for_the_target() {
        for board in Board::ALL {
            let lints = arguments(&target_lints(Command::new("cargo"), board));
            assert!(lints.contains(&format!("firmware/{board}")));
            for package in TARGET_PACKAGES {
                assert!(lints.contains(&package.to_owned()), "{package}");
            }
        }
    }
}
