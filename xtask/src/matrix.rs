//! `cargo xtask matrix`: every case of the conformance suite at every rate and format of the register map.
//!
//! The test is `matrix` of `tools/conformance/tests/image`, which `cargo xtask test` runs with chosen cases.

use register_map::board::MODIO_02;

use crate::workspace::Workspace;
use crate::{Result, build, command};

/// Makes the test run every case: read by it.
const VARIABLE: &str = "MODIO_MATRIX";

/// `cargo xtask matrix`.
///
/// # Errors
///
/// When image or simulator cannot be built, or a case fails at a rate and format.
pub fn run(workspace: &mut Workspace) -> Result<()> {
    let elf = build::image(workspace, &MODIO_02)?.elf;
    let mut cargo = workspace.cargo("test");
    // The simulator's core, crate rigless, declares a newer rustc than it needs.
    cargo.args(["--quiet", "--ignore-rust-version", "--package"]);
    cargo.args(["conformance", "--features", "sim", "--test", "image", "--"]);
    cargo.args(["--include-ignored", "--nocapture", "--exact"]);
    cargo.arg("matrix::every_rate_and_format_conforms");
    cargo.env("MODIO_ELF", elf);
    command::run(cargo.env(VARIABLE, "every case"))
}
