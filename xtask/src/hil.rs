//! `cargo xtask hil`: the image on a real board, tested on its line by `modio-hil` of package conformance.
//!
//! That program has all options and does everything, including writing the image, for which it calls `cargo xtask
//! flash`. It replaces this process, so that it receives Ctrl-C and SIGTERM, restores the board, and sets the exit
//! status.

use std::ffi::OsString;
use std::process::Command;

use anyhow::Result;

use crate::command;
use crate::workspace::Workspace;

/// The arguments for `modio-hil`.
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
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let program = workspace.program("modio-hil")?;
    command::exec(Command::new(program).args(&options.arguments))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    #[test]
    fn every_argument_is_passed_on_unchanged() {
        for arguments in [
            &["--bench", "b.toml", "--flash", "--probe", "1:2"][..],
            &["--help"],
            &["-h", "--version"],
            &["--only", "fc05/", "--", "x"],
            &[],
        ] {
            let all = ["xtask", "hil"].iter().chain(arguments);
            let crate::Command::Hil(options) = crate::Cli::try_parse_from(all).unwrap().command
            else {
                panic!("{arguments:?}");
            };
            assert_eq!(options.arguments, arguments);
        }
    }
}
