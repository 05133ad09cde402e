//! `cargo xtask soak` and `cargo xtask matrix`: longer runs of tests that `cargo xtask test` also runs, there with
//! fewer frames, for seconds, and with selected cases.

use anyhow::Result;

use crate::test;
use crate::workspace::Workspace;

/// The options of a test run with one test, which shows its progress.
const ONE_TEST: &str = "--nocapture --exact";

/// How long to run.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Number of frames to send
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    frames: u64,

    /// Instead of frames without pause: hours of virtual time, such as 24, with a request every second
    // Virtual time ends after 213 days.
    #[arg(long, conflicts_with = "frames", value_parser = clap::value_parser!(u16).range(1..=2400))]
    hours: Option<u16>,

    /// Corner of the part: nominal, slow or fast
    #[arg(long, default_value = "nominal", value_parser = ["nominal", "slow", "fast"])]
    corner: String,
}

/// `cargo xtask soak`: tests `noise` and `long_run` of `tools/sim/tests/image`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let (name, variable, length) = match options.hours {
        Some(hours) => (
            "long_run::an_input_changes_and_is_read_every_second_for_hours",
            "MODIO_SOAK_HOURS",
            hours.into(),
        ),
        None => ("noise::soak", "MODIO_SOAK_FRAMES", options.frames),
    };
    let name = format!("{ONE_TEST} {name}");
    let variables = [
        (variable, &*length.to_string()),
        (test::CORNER, &options.corner),
    ];
    test::simulated(workspace, "--quiet --test=image", &name, &variables)
}

/// `cargo xtask matrix`: every case of the conformance suite at every rate and format of the register map, the test
/// `matrix` of `tools/conformance/tests/suite`.
pub fn matrix(workspace: &mut Workspace) -> Result<()> {
    let name = format!("{ONE_TEST} matrix::every_rate_and_format_conforms");
    let every_case = [("MODIO_MATRIX", "every case")];
    test::simulated(workspace, "--quiet --test=suite", &name, &every_case)
}
