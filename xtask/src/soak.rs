//! `cargo xtask soak`: a million frames, good and damaged, to the release image in simulation.
//!
//! The test is `noise` of `tools/sim/tests/image`, which `cargo xtask test` runs with fewer frames.

use register_map::board::MODIO_02;

use crate::workspace::Workspace;
use crate::{Result, build, command, test};

/// How many frames the test sends: read by it.
const VARIABLE: &str = "MODIO_SOAK_FRAMES";

/// How long to go on.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// So many frames
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    frames: u64,

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

/// `cargo xtask soak`.
///
/// # Errors
///
/// When image or simulator cannot be built, or the image loses a good frame or takes a bad one.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let elf = build::image(workspace, &MODIO_02)?.elf;
    let mut cargo = workspace.cargo("test");
    // The simulator's core, crate rigless, declares a newer rustc than it needs.
    cargo.args(["--quiet", "--ignore-rust-version", "--package", "sim"]);
    cargo.args(["--test", "image", "--", "--include-ignored", "--nocapture"]);
    cargo.args(["--exact", "noise::soak"]);
    cargo.env("MODIO_ELF", elf);
    cargo.env(test::CORNER, &options.corner);
    command::run(cargo.env(VARIABLE, options.frames.to_string()))
}
