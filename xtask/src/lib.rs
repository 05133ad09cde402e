//! What stands behind `cargo xtask`: one module for each command, and what they share.
//!
//! A command says what is wrong in one line and what to do about it; it neither panics nor shows a
//! backtrace for anything a user, a network or a missing tool can cause.

#![forbid(unsafe_code)]

use clap::{Parser, Subcommand};

/// As `println!`; a reader that has gone, as `head` goes, is no failure.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

pub mod bench;
pub mod board;
pub mod build;
pub mod ci;
pub mod command;
pub mod dist;
pub mod docs;
mod failure;
pub mod flash;
pub mod fuzz;
pub mod hil;
pub mod image;
mod matrix;
pub mod page;
pub mod peers;
pub mod pymodbus;
mod python;
pub mod renode;
#[cfg(all(test, unix))]
mod script;
pub mod sim;
pub mod size;
pub mod soak;
pub mod steps;
pub mod test;
pub mod toolchain;
pub mod workspace;

pub use failure::{Failure, Result};
use workspace::Workspace;

/// The command line of `cargo xtask`.
#[derive(Parser, Debug)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", about, long_about = None)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

impl Cli {
    /// Whether a parse error is clap's way to show the whole usage, as for no command at all.
    #[must_use]
    pub fn wants_usage(error: &clap::Error) -> bool {
        error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    }
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Build the release image: ELF and .bin
    Build(build::Options),
    /// Build all files of a release: ELF, .bin, .hex, map, bill of materials, check sums
    Dist(dist::Options),
    /// Write the image into a board with probe-rs, verify and start it
    Flash(flash::Options),
    /// Show flash and RAM by crate and section, with what is left of the parts and budgets
    Size(size::Options),
    /// Count what the image costs: instructions of every request, load, flash and RAM
    Bench(bench::Options),
    /// Build the image and run it on the virtual board
    Sim(Box<sim_options::Options>),
    /// Test the image on Renode: its suites and the conformance suite
    Renode(renode::Options),
    /// Test a real board on its serial line: conformance, timing, wires
    #[command(disable_help_flag = true)]
    Hil(hil::Options),
    /// Test well-known Modbus servers with the conformance suite, and renew the table in docs/conformance.md
    Peers(peers::Options),
    /// Feed the framers, the server and the configuration store what libFuzzer comes up with
    Fuzz(fuzz::Options),
    /// Good and damaged frames to the image in simulation, a million of them
    Soak(soak::Options),
    /// The conformance suite at every rate and format of the register map, in simulation
    Matrix,
    /// Renew docs/register-map.md
    Docs,
    /// Take the pictures of the simulator's page in docs/images
    Screenshots,
    /// Everything a change must pass
    Test(test::Options),
    /// What CI runs: formatting, lints and documentation, then the same as `test`
    Ci,
}

/// Does what the command line asks for.
///
/// # Errors
///
/// [`Failure`] says what is wrong and what to do, in a line, and carries the exit status.
pub fn run(cli: Cli) -> Result<()> {
    let mut workspace = Workspace::open()?;
    match cli.command {
        Command::Build(options) => build::run(&mut workspace, &options),
        Command::Dist(options) => dist::run(&mut workspace, &options),
        Command::Flash(options) => flash::run(&mut workspace, &options),
        Command::Size(options) => size::run(&mut workspace, &options),
        Command::Bench(options) => bench::run(&mut workspace, &options),
        Command::Sim(options) => sim::run(&mut workspace, &options, std::env::args_os().skip(2)),
        Command::Fuzz(options) => fuzz::run(&workspace, &options),
        Command::Soak(options) => soak::run(&mut workspace, &options),
        Command::Matrix => matrix::run(&mut workspace),
        Command::Renode(options) => renode::run(&mut workspace, &options),
        Command::Hil(options) => hil::run(&workspace, &options),
        Command::Peers(options) => peers::run(&workspace, &options),
        Command::Docs => docs::run(&workspace),
        Command::Screenshots => page::screenshots(&mut workspace),
        Command::Test(options) => test::run(&mut workspace, &options),
        Command::Ci => ci::run(&mut workspace),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn a_board_that_is_not_ours_is_refused_with_the_list() {
        for command in ["build", "flash", "size", "bench", "sim", "renode"] {
            let error = Cli::try_parse_from(["xtask", command, "--board", "nucleo"]).unwrap_err();
            let text = sim_options::one_line(&error);
            assert!(
                text.contains("'nucleo'") && text.contains("one of modio-02, modio-08"),
                "{command}: {text}"
            );
        }
    }

    #[test]
    fn no_command_shows_the_usage() {
        let error = Cli::try_parse_from(["xtask"]).unwrap_err();
        assert!(Cli::wants_usage(&error));
    }

    #[test]
    fn a_wrong_option_of_the_simulator_is_refused_before_anything_is_built() {
        let error = Cli::try_parse_from(["xtask", "sim", "--dip", "300"]).unwrap_err();
        assert!(sim_options::one_line(&error).contains("300 is not in 0..=255"));
    }
}
