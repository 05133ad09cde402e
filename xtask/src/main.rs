//! `cargo xtask`: the commands that build, test and run this project. One module for each command.
//!
//! An error reports in one line what is wrong and what to do about it. Exit status: 1 for a failure, 2 for a wrong
//! argument or option.

#![forbid(unsafe_code)]

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};

use error::Usage;
use workspace::Workspace;

/// Like `println!`, but it is not an error when the reader, such as `head`, has ended.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

mod adding;
mod bench;
mod build;
mod command;
mod debug;
#[cfg(test)]
mod dependencies;
mod dist;
mod docs;
mod error;
mod flash;
mod fuzz;
mod group;
mod hex;
mod image;
mod images;
mod keys;
mod lint;
mod ordinary;
mod peers;
mod python;
mod renode;
mod signed;
mod sim;
mod simulated;
mod size;
mod soak;
mod sources;
mod steps;
mod table;
mod test;
mod toolchain;
#[cfg(test)]
mod workflows;
mod workspace;

/// The command line of `cargo xtask`.
#[derive(Parser, Debug)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version = register_map::version!(), about, long_about = None)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Build the loader, the images for both slots, the file of an update, and the image that runs without a loader
    Build(build::Options),
    /// Build the images for both slots, sign them, and write the file of an update, BOARD.modio
    Image(signed::Options),
    /// Sign the file of an update again, with another key or epoch; this builds nothing
    Sign(signed::Again),
    /// Make a private key that signs updates, and show its public half, which the loader needs
    Keygen(keys::New),
    /// Write the loader and the image into a board with probe-rs or through a serial port, verify and start it
    Flash(flash::Options),
    /// Build the image, run it on the board at the debug probe, or without one in the simulator, and show its log
    Run(debug::Options),
    /// Show the log of the image that runs on the board at the debug probe
    Attach(debug::Options),
    /// Debug the image with GDB, on the board at the debug probe, or without one in the simulator
    Gdb(debug::GdbOptions),
    /// Build the image and run it on the virtual board
    #[command(disable_help_flag = true)]
    Sim(PassedOn),
    /// Run the steps that a change must pass, or those named
    Test(test::Options),
    /// Run the steps of CI: formatting, lints, documentation, those of `test` and longer ones
    Ci(test::Chosen),
    /// Show flash and RAM by crate and section, and what is left of the slot, or of the smallest part
    Size(size::Options),
    /// Count the instructions of every request, the processor's load, flash and RAM
    Bench(bench::Options),
    /// Build all files of a release: loader, signed images, programs, bills of materials, check sums
    Dist(dist::Options),
    /// Test loader and image on Renode: its suites and the conformance suite
    Renode(renode::Options),
    /// Test a real board on its serial line: conformance, timing, wires
    #[command(disable_help_flag = true)]
    Hil(PassedOn),
    /// Test well-known Modbus servers with the conformance suite, and renew the table in docs/conformance.md
    Peers(peers::Options),
    /// Run the fuzz targets: framers, server, configuration store and descriptions
    Fuzz(fuzz::Options),
    /// Send a million frames, good and damaged, to the image in simulation
    Soak(soak::Options),
    /// Run the conformance suite at every rate and format of the register map, in simulation, on a board with slots with
    /// another module for each rate
    Matrix(soak::Matrix),
    /// Renew docs/register-map.md and the list of modules in renode/commands.py
    Docs,
    /// Take the pictures of the simulator's page in docs/images
    Screenshots,
}

/// The arguments of a program that parses them itself.
#[derive(clap::Args, Debug)]
struct PassedOn {
    /// Options of the program; --help lists them
    #[arg(
        value_name = "OPTIONS",
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    arguments: Vec<OsString>,
}

fn main() -> ExitCode {
    use clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand as NoCommand;
    let done = match Cli::try_parse() {
        Ok(cli) => run(cli),
        Err(error) if error.use_stderr() && error.kind() != NoCommand => {
            Err(error::usage(error::one_line(&error)))
        }
        Err(help) => help.exit(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}

fn run(cli: Cli) -> Result<()> {
    let mut workspace = Workspace::open()?;
    let workspace = &mut workspace;
    match cli.command {
        Command::Build(options) => images::run(workspace, &options),
        Command::Image(options) => signed::run(workspace, &options),
        Command::Sign(options) => signed::again(workspace, &options),
        Command::Keygen(new) => keys::run(workspace, &new),
        Command::Flash(options) => flash::run(workspace, &options),
        Command::Run(options) => debug::run(workspace, &options),
        Command::Attach(options) => debug::attach(workspace, &options),
        Command::Gdb(options) => debug::gdb(workspace, &options),
        Command::Sim(PassedOn { arguments }) => sim::run(workspace, &arguments),
        Command::Test(options) => test::run(workspace, &options),
        Command::Ci(options) => test::ci(workspace, &options),
        Command::Size(options) => size::run(workspace, &options),
        Command::Bench(options) => bench::run(workspace, &options),
        Command::Dist(options) => dist::run(workspace, &options),
        Command::Renode(options) => renode::run(workspace, &options),
        Command::Hil(PassedOn { arguments }) => {
            // This program has all options and does everything, including writing the image, for which it calls `cargo
            // xtask flash`. It replaces this process, so that it receives Ctrl-C and SIGTERM, restores the board, and
            // sets the exit status.
            let program = workspace.program("modio-conformance")?;
            let mut program = std::process::Command::new(program);
            command::exec(program.arg("hil").args(arguments))
        }
        Command::Peers(options) => peers::run(workspace, &options),
        Command::Fuzz(options) => fuzz::run(workspace, &options),
        Command::Soak(options) => soak::run(workspace, &options),
        Command::Matrix(options) => soak::matrix(workspace, &options),
        Command::Docs => {
            for (path, text) in docs::files(&workspace.root)? {
                fs_err::write(&path, text)?;
                say!("wrote {}", path.display());
            }
            Ok(())
        }
        Command::Screenshots => python::screenshots(workspace),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_is_well_formed() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
        let error = Cli::try_parse_from(["xtask", "build", "--board", "nucleo"]).unwrap_err();
        let text = error::one_line(&error);
        assert!(
            text.contains("'nucleo'") && text.contains("one of modio-02, modio-08"),
            "{text}"
        );
    }

    #[test]
    fn every_argument_of_hil_and_sim_is_passed_on_unchanged() {
        let arguments = ["--bench", "b.toml", "-h", "--help", "--version", "--", "x"];
        for name in ["hil", "sim"] {
            let command = ["xtask", name];
            let all = command.iter().chain(&arguments);
            let (Command::Hil(passed) | Command::Sim(passed)) =
                Cli::try_parse_from(all).unwrap().command
            else {
                panic!("another command");
            };
            assert_eq!(passed.arguments, arguments);
        }
    }
}

/// Programs made of a shell script, which tests call in place of the real ones.
#[cfg(all(test, unix))]
mod script {
    use std::path::{Path, PathBuf};

    /// Makes a program of that name.
    ///
    /// A shell writes the file. If this process had it open for writing while another test starts a program, that
    /// program would inherit the open file, and the file could not be executed ("text file busy").
    pub fn program(directory: &Path, name: &str, script: &str) -> PathBuf {
        let program = directory.join(name);
        let write = r#"printf '#!/bin/sh\n%s\n' "$2" > "$1" && chmod +x "$1""#;
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", write, "sh"]).arg(&program).arg(script);
        crate::command::run(&mut shell).unwrap();
        program
    }
}
