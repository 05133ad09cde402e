//! `cargo xtask test`: everything a change must pass, run to the end and summed up.

use std::env;
use std::path::Path;

use crate::steps::{Outcome, Steps};
use crate::workspace::Workspace;
use crate::{Result, build, command, pymodbus, size};

/// `cargo xtask test`.
///
/// # Errors
///
/// When a step failed; all have been run and the summary printed.
pub fn run(workspace: &mut Workspace) -> Result<()> {
    let mut steps = Steps::default();
    add(workspace, &mut steps, is_ci(env::var("CI").ok().as_deref()));
    steps.finish()
}

/// Adds the steps of `cargo xtask test`; when `strict` none may be skipped for want of a tool.
pub fn add(workspace: &mut Workspace, steps: &mut Steps, strict: bool) {
    steps.run("host tests", || {
        command::run(workspace.cargo("test").args([
            "--workspace",
            "--ignore-rust-version",
            "--no-fail-fast",
        ]))
        .into()
    });
    let mut elf = None;
    steps.run("release image", || {
        let built = build::image(workspace, &build::Options::release());
        built.map(|image| elf = Some(image.elf)).into()
    });
    let elf = elf.as_deref();
    steps.run("size of the image", || {
        on(elf, |elf| size::check(elf).into())
    });
    steps.run("image in simulation", || {
        on(elf, |elf| {
            let mut cargo = workspace.cargo("test");
            cargo.args([
                "--ignore-rust-version",
                "--no-fail-fast",
                "--package",
                "sim",
                "--",
                "--include-ignored",
            ]);
            command::run(cargo.env("MODIO_ELF", elf)).into()
        })
    });
    steps.run("pymodbus as master", || {
        on(elf, |elf| pymodbus::step(workspace, elf, strict))
    });
}

/// A step on the image, which is skipped when there is none: that it is missing has failed already.
fn on(elf: Option<&Path>, step: impl FnOnce(&Path) -> Outcome) -> Outcome {
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
