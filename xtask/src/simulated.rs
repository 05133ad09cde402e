//! Tests that run loaders and images in the simulator, as an ordinary user.

use std::process::Stdio;

use anyhow::{Result, bail};
use register_map::Row;

use crate::workspace::{ALL, SUITE, Workspace};
use crate::{command, images, ordinary};

/// The variable with the corner of the part for the tests of the image.
pub const CORNER: &str = "MODIO_CORNER";

/// Runs tests that run the loader and the images of these boards in the simulator: those of these
/// targets whose names contain one of `names`, or all. Spaces separate targets and names. A name that begins with `--` is
/// an option of the tests. The variables choose the corner of the part, and how long a test is.
pub fn run(
    workspace: &mut Workspace,
    boards: &[&'static Row],
    targets: &str,
    names: &str,
    variables: &[(&str, &str)],
) -> Result<()> {
    let ordinary = ordinary::words()?;
    let images = images::variables(workspace, boards)?;
    let simulator = workspace.simulator()?;
    let tests = |list: &[&str]| {
        let mut cargo = workspace.cargo("test");
        cargo.args(ALL).args(["--features", SUITE]);
        if !ordinary.is_empty() {
            let runner = format!("target.'cfg(unix)'.runner={ordinary:?}");
            cargo.args(["--config", &runner]);
        }
        cargo.arg("--no-fail-fast").args(targets.split(' '));
        cargo.args(["--", "--ignored"]).args(list);
        cargo.args(names.split_whitespace());
        cargo.env(CORNER, "nominal").envs(variables.iter().copied());
        cargo.envs(images.iter().map(|(name, directory)| (name, directory)));
        // Tests of one package do not know the path of another package's program.
        cargo.env("MODIO_SIM", &simulator);
        cargo
    };
    let wanted = names.split_whitespace();
    let wanted: Vec<_> = wanted.filter(|word| !word.starts_with("--")).collect();
    if !wanted.is_empty() {
        // The messages of the compiler are shown.
        let list = command::read(tests(&["--list"]).stderr(Stdio::inherit()))?;
        all_match(&list, &wanted)?;
    }
    command::run(&mut tests(&[]))
}

/// Refuses a name that no test in this list of tests has, because a run of no test passes.
fn all_match(list: &str, names: &[&str]) -> Result<()> {
    let tests = || list.lines().filter_map(|line| line.strip_suffix(": test"));
    let absent = names
        .iter()
        .find(|name| !tests().any(|test| test.contains(**name)));
    absent.map_or(Ok(()), |name| bail!("no test has the name {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_no_test_has_is_an_error() {
        let list = "noise::soak: test\nslots::a_pulse: test\n\n2 tests, 0 benchmarks\n";
        assert!(all_match(list, &["noise::soak", "slots::"]).is_ok());
        let error = all_match(list, &["slots::", "long_run::"]).unwrap_err();
        assert_eq!(error.to_string(), "no test has the name long_run::");
        assert!(all_match("", &["tests"]).is_err());
    }
}
