//! `cargo xtask test`: everything a change must pass, run to the end and summed up.

use std::env;
use std::path::{Path, PathBuf};

use register_map::Board;
use register_map::board::{MODIO_02, MODIO_08};

use crate::steps::{Outcome, Steps};
use crate::workspace::Workspace;
use crate::{Result, build, command, page, pymodbus, renode, sim, size};

/// The variable that names the corner of the part to the tests of the image.
pub const CORNER: &str = "MODIO_CORNER";
/// The simulator's nominal corner (`sim::Corner`): the typical part.
pub const NOMINAL: &str = "nominal";
/// The corners of the part, beside the nominal one, at which the tests of the image run.
pub const CORNERS: [&str; 2] = ["slow", "fast"];

/// The options of `cargo xtask test`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Without the simulator: host tests, images and sizes
    #[arg(long)]
    host: bool,
}

/// `cargo xtask test`.
///
/// # Errors
///
/// When a step failed; all have been run and the summary printed.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let mut steps = Steps::default();
    if options.host {
        add_host(workspace, &mut steps, &[]);
    } else {
        add(workspace, &mut steps, is_ci(env::var("CI").ok().as_deref()));
    }
    steps.finish()
}

/// The images that were built, with their boards.
#[derive(Debug, Default)]
pub struct Images(Vec<(&'static Board, PathBuf)>);

impl Images {
    /// The image of a board, if it was built.
    fn of(&self, board: &Board) -> Option<&Path> {
        let image = self.0.iter().find(|(built, _)| *built == board);
        image.map(|(_, elf)| elf.as_path())
    }

    /// A step on the image of a board, which is skipped when there is none: that it is missing has failed already.
    pub fn step(&self, board: &Board, step: impl FnOnce(&Path) -> Outcome) -> Outcome {
        match self.of(board) {
            Some(elf) => step(elf),
            None => Outcome::Skipped(format!("there is no image of the {board}")),
        }
    }
}

/// The variable that names the image of a board to the tests of the image.
fn variable(board: &Board) -> &'static str {
    if *board == MODIO_02 {
        "MODIO_ELF"
    } else {
        "MODIO_ELF_08"
    }
}

/// Adds the steps of `cargo xtask test`; when `strict` none may be skipped for want of a tool. Gives the images that
/// were tested, as far as they could be built.
pub fn add(workspace: &mut Workspace, steps: &mut Steps, strict: bool) -> Images {
    let images = add_host(workspace, steps, &["--workspace"]);
    steps.run("images in simulation", || {
        in_simulation(workspace, &images, &["sim"], &[], NOMINAL)
    });
    steps.run("conformance of the images", || {
        let package = ["conformance", "--features", "sim"];
        in_simulation(workspace, &images, &package, &[], NOMINAL)
    });
    steps.run("modioctl on the simulator", || {
        in_simulation(
            workspace,
            &images,
            &["modioctl", "--test", "simulator"],
            &[],
            NOMINAL,
        )
    });
    steps.run("pymodbus as master", || {
        images.step(&MODIO_02, |elf| {
            pymodbus::step(workspace, elf, images.of(&MODIO_08), strict)
        })
    });
    steps.run("the simulator's page in Chromium", || {
        images.step(&MODIO_02, |modio_02| {
            images.step(&MODIO_08, |modio_08| {
                let both = page::Images { modio_02, modio_08 };
                page::step(workspace, both, strict)
            })
        })
    });
    for board in Board::ALL {
        steps.run(&format!("files for Renode, {board}"), || {
            images.step(board, |elf| {
                renode::checks::step(workspace, board, elf, strict)
            })
        });
    }
    images
}

/// Adds the steps that need no simulator. The host's tests are those of `packages`, which is cargo's
/// choice of packages; without one, of the workspace's default members. Gives the images that could be built.
fn add_host(workspace: &mut Workspace, steps: &mut Steps, packages: &[&str]) -> Images {
    steps.run("host tests", || {
        let mut cargo = workspace.cargo("test");
        cargo.args(packages);
        command::run(cargo.args(["--ignore-rust-version", "--no-fail-fast"])).into()
    });
    let mut images = Images::default();
    for board in Board::ALL {
        steps.run(&format!("release image, {board}"), || {
            let built = build::image(workspace, board);
            built.map(|image| images.0.push((board, image.elf))).into()
        });
        steps.run(&format!("size of the image, {board}"), || {
            images.step(board, |elf| size::check(elf, board).into())
        });
    }
    images
}

/// Adds the tests of the images at the corners beside the nominal one.
pub fn add_corners(workspace: &Workspace, steps: &mut Steps, images: &Images) {
    for corner in CORNERS {
        steps.run(&format!("images in simulation, {corner} corner"), || {
            let common = in_simulation(workspace, images, &["sim", "--test", "image"], &[], corner);
            let own = ["sim", "--test", "image_08"];
            match common {
                Outcome::Passed => in_simulation(workspace, images, &own, &OWN_OF_08, corner),
                other => other,
            }
        });
    }
}

/// The tests of the modio-08 that run at the corners: those about the board itself, its start and its store. The others
/// are the same code as on the modio-02, and take as long again.
const OWN_OF_08: [&str; 6] = [
    "analog::",
    "boot::",
    "digital::",
    "faults_of_slots::",
    "power_cut::",
    "slots::",
];

/// The tests of a package, and how it is built, whose names contain one of `names` (all when there are none), that run the images in the simulator at a corner of the part. The
/// tests of an image that could not be built fail.
fn in_simulation(
    workspace: &Workspace,
    images: &Images,
    package: &[&str],
    names: &[&str],
    corner: &str,
) -> Outcome {
    let mut cargo = workspace.cargo("test");
    cargo.args(["--ignore-rust-version", "--no-fail-fast", "--package"]);
    cargo.args(package).args(["--", "--include-ignored"]);
    cargo.args(names);
    for (board, elf) in &images.0 {
        cargo.env(variable(board), elf);
    }
    cargo.env(CORNER, corner);
    // Tests of one package cannot find the programs of another.
    let simulator = match sim::simulator(workspace) {
        Ok(simulator) => simulator,
        Err(failure) => return Outcome::from(Err(failure)),
    };
    command::run(cargo.env("MODIO_SIM", simulator)).into()
}

/// Whether the variable `CI`, which every CI service sets, says that this is one.
fn is_ci(variable: Option<&str>) -> bool {
    !matches!(variable, None | Some("" | "0" | "false"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ci_is_known_by_its_variable() {
        for (variable, is) in [
            (None, false),
            (Some(""), false),
            (Some("false"), false),
            (Some("0"), false),
            (Some("true"), true),
            (Some("1"), true),
        ] {
            assert_eq!(is_ci(variable), is, "{variable:?}");
        }
    }

    #[test]
    fn without_an_image_its_steps_are_skipped() {
        let images = Images(vec![(&MODIO_02, "x".into())]);
        let outcome = images.step(&MODIO_08, |_| panic!("run without an image"));
        let why = "there is no image of the modio-08".to_owned();
        assert_eq!(outcome, Outcome::Skipped(why));
        let passed = |elf: &Path| {
            assert_eq!(elf, Path::new("x"));
            Outcome::Passed
        };
        assert_eq!(images.step(&MODIO_02, passed), Outcome::Passed);
    }

    #[test]
    fn every_board_has_a_variable_of_its_own() {
        assert_ne!(variable(&MODIO_02), variable(&MODIO_08));
        assert_eq!(Board::ALL.len(), 2);
    }
}
