//! `cargo xtask soak`: a million frames, good and damaged, to the release image in simulation, or hours of virtual time.
//!
//! The tests are `noise` and `long_run` of `tools/sim/tests/image`, which `cargo xtask test` runs with fewer frames and
//! for seconds.

use register_map::board::MODIO_02;

use crate::workspace::Workspace;
use crate::{Result, build, command, test};

/// How many frames the test sends: read by it.
const FRAMES: &str = "MODIO_SOAK_FRAMES";
/// How many hours pass: read by the test.
const HOURS: &str = "MODIO_SOAK_HOURS";

/// How long to go on.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// So many frames
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    frames: u64,

    /// Instead of frames without pause: one request every second for so many hours of virtual time, such as 24
    #[arg(long, conflicts_with = "frames", value_parser = hours)]
    hours: Option<f64>,

    /// Corner of the part: nominal, slow or fast
    #[arg(long, default_value = test::NOMINAL, value_parser = corner)]
    corner: String,
}

/// A corner by its name.
fn corner(name: &str) -> std::result::Result<String, String> {
    if name == test::NOMINAL || test::CORNERS.contains(&name) {
        Ok(name.to_owned())
    } else {
        Err("nominal, slow or fast".to_owned())
    }
}

/// A number of hours.
fn hours(text: &str) -> std::result::Result<f64, String> {
    let hours: f64 = text.parse().map_err(|_| "not a number of hours")?;
    // Virtual time ends after 213 days.
    if (0.01..=2400.0).contains(&hours) {
        Ok(hours)
    } else {
        Err("0.01 to 2400 hours".to_owned())
    }
}

/// `cargo xtask soak`.
///
/// # Errors
///
/// When image or simulator cannot be built, the image loses a good frame or takes a bad one, or memory grows.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let elf = build::image(workspace, &MODIO_02)?.elf;
    let mut cargo = workspace.cargo("test");
    // The simulator's core, crate rigless, declares a newer rustc than it needs.
    cargo.args(["--quiet", "--ignore-rust-version", "--package", "sim"]);
    cargo.args(["--test", "image", "--", "--include-ignored", "--nocapture"]);
    cargo.env("MODIO_ELF", elf);
    cargo.env(test::CORNER, &options.corner);
    cargo.arg("--exact");
    match options.hours {
        Some(hours) => cargo
            .arg("long_run::an_input_changes_and_is_read_every_second_for_hours")
            .env(HOURS, hours.to_string()),
        None => cargo
            .arg("noise::soak")
            .env(FRAMES, options.frames.to_string()),
    };
    command::run(&mut cargo)
}
