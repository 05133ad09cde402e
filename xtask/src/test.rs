//! `cargo xtask test`: everything a change must pass, run to the end and summed up.

use std::env;
use std::path::{Path, PathBuf};

use crate::steps::{Outcome, Steps};
use crate::workspace::Workspace;
use crate::{Result, build, command, pymodbus, renode, sim, size};

/// The variable that names the corner of the part to the tests of the image.
pub const CORNER: &str = "MODIO_CORNER";
/// The simulator's nominal corner (`sim::Corner`): the typical part.
pub const NOMINAL: &str = "nominal";
/// The corners of the part, beside the nominal one, at which the tests of the image run.
pub const CORNERS: [&str; 2] = ["slow", "fast"];

/// The options of `cargo xtask test`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Without the simulator, which is for Linux: host tests, image and size
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

/// Adds the steps of `cargo xtask test`; when `strict` none may be skipped for want of a tool. Gives
/// the image that was tested, if it could be built.
pub fn add(workspace: &mut Workspace, steps: &mut Steps, strict: bool) -> Option<PathBuf> {
    let elf = add_host(workspace, steps, &["--workspace"]);
    let image = elf.as_deref();
    steps.run("image in simulation", || {
        on(image, |elf| {
            in_simulation(workspace, elf, &["sim"], NOMINAL)
        })
    });
    steps.run("conformance of the image", || {
        on(image, |elf| {
            let package = ["conformance", "--features", "sim"];
            in_simulation(workspace, elf, &package, NOMINAL)
        })
    });
    steps.run("pymodbus as master", || {
        on(image, |elf| pymodbus::step(workspace, elf, strict))
    });
    steps.run("files for Renode", || {
        on(image, |elf| renode::checks::step(workspace, elf, strict))
    });
    elf
}

/// Adds the steps that need no simulator. The host's tests are those of `packages`, which is cargo's
/// choice of packages; without one, of the workspace's default members. Gives the image, if it could be
/// built.
fn add_host(workspace: &mut Workspace, steps: &mut Steps, packages: &[&str]) -> Option<PathBuf> {
    steps.run("host tests", || {
        let mut cargo = workspace.cargo("test");
        cargo.args(packages);
        command::run(cargo.args(["--ignore-rust-version", "--no-fail-fast"])).into()
    });
    let mut elf = None;
    steps.run("release image", || {
        let built = build::image(workspace, &build::Options::release());
        built.map(|image| elf = Some(image.elf)).into()
    });
    steps.run("size of the image", || {
        on(elf.as_deref(), |elf| size::check(elf).into())
    });
    elf
}

/// Adds the tests of the image at the corners beside the nominal one.
pub fn add_corners(workspace: &Workspace, steps: &mut Steps, image: Option<&Path>) {
    for corner in CORNERS {
        steps.run(&format!("image in simulation, {corner} corner"), || {
            on(image, |elf| {
                in_simulation(workspace, elf, &["sim", "--test", "image"], corner)
            })
        });
    }
}

/// The tests of a package, and how it is built, that run the image in the simulator at a corner of the part.
fn in_simulation(workspace: &Workspace, elf: &Path, package: &[&str], corner: &str) -> Outcome {
    let mut cargo = workspace.cargo("test");
    cargo.args(["--ignore-rust-version", "--no-fail-fast", "--package"]);
    cargo.args(package).args(["--", "--include-ignored"]);
    cargo.env("MODIO_ELF", elf).env(CORNER, corner);
    // Tests of one package cannot find the programs of another.
    let simulator = match sim::simulator(workspace) {
        Ok(simulator) => simulator,
        Err(failure) => return Outcome::from(Err(failure)),
    };
    command::run(cargo.env("MODIO_SIM", simulator)).into()
}

/// A step on the image, which is skipped when there is none: that it is missing has failed already.
pub fn on(elf: Option<&Path>, step: impl FnOnce(&Path) -> Outcome) -> Outcome {
    elf.map_or_else(|| Outcome::Skipped("there is no image".to_owned()), step)
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
        let outcome = on(None, |_| panic!("run without an image"));
        assert_eq!(outcome, Outcome::Skipped("there is no image".to_owned()));
        assert_eq!(
            on(Some(Path::new("x")), |_| Outcome::Passed),
            Outcome::Passed
        );
    }
}
