//! `cargo xtask hil`: the image on a real board, tested on its line by `modio-hil` of package conformance.
//!
//! That program has all options and does everything, the writing of the image included, for which it calls
//! `cargo xtask flash`. It takes this one's place, so that Ctrl-C and SIGTERM reach it, it puts the board back,
//! and its exit status is ours.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use crate::workspace::Workspace;
use crate::{Result, command};

/// What is passed on to `modio-hil`.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Options of modio-hil; --help lists them
    #[arg(
        value_name = "OPTIONS",
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    arguments: Vec<OsString>,
}

/// `cargo xtask hil`.
///
/// # Errors
///
/// When the program does not build or cannot be run. What it finds, it reports by its own exit status.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let mut test = Command::new(tester(workspace)?);
    become_tester(test.args(&options.arguments))
}

/// Builds the program that tests; returns where it is.
fn tester(workspace: &Workspace) -> Result<PathBuf> {
    let mut cargo = workspace.cargo("build");
    cargo.args(["--quiet", "--package", "conformance", "--bin", "modio-hil"]);
    command::run(&mut cargo)?;
    let name = format!("modio-hil{}", std::env::consts::EXE_SUFFIX);
    Ok(workspace.target().join("debug").join(name))
}

#[cfg(unix)]
use command::exec as become_tester;

/// Without exec: Ctrl-C goes to the tester as well, which is waited for, and its status passed on.
#[cfg(not(unix))]
fn become_tester(tester: &mut Command) -> Result<()> {
    use crate::Failure;

    ctrlc::set_handler(|| {})
        .map_err(|error| Failure::new(format!("no handler for Ctrl-C: {error}")))?;
    let status = tester
        .status()
        .map_err(|error| Failure::new(format!("modio-hil cannot be run: {error}")))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    match code.unwrap_or(1) {
        0 => Ok(()),
        code => {
            let mut failure = Failure::new("the board has not passed");
            failure.code = code;
            Err(failure)
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Cli;
    use clap::Parser;

    #[test]
    fn every_argument_is_passed_on_as_it_is() {
        for arguments in [
            &["--bench", "b.toml", "--flash", "--probe", "1:2"][..],
            &["--help"],
            &["-h", "--version"],
            &["--only", "fc05/", "--", "x"],
            &[],
        ] {
            let all = ["xtask", "hil"].iter().chain(arguments);
            let cli = Cli::try_parse_from(all).unwrap();
            let crate::Command::Hil(options) = cli.command else {
                panic!("{arguments:?}");
            };
            assert_eq!(options.arguments, arguments);
        }
    }
}
