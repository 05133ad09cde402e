//! The program.

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, FromArgMatches as _};
use modioctl::bus::endpoint::one_line;
use modioctl::cli::Cli;
use modioctl::eprintln;
use modioctl::failure::Failure;

fn main() -> ExitCode {
    let arguments = Cli::command()
        .version(register_map::version!())
        .try_get_matches();
    let cli = match arguments.and_then(|arguments| Cli::from_arg_matches(&arguments)) {
        Ok(cli) => cli,
        Err(error) => match error.kind() {
            ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => error.exit(),
            _ => {
                eprintln!("modioctl: {}", one_line(&error));
                return ExitCode::from(Failure::usage("").status());
            }
        },
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let result = match runtime {
        Ok(runtime) => runtime.block_on(modioctl::run(cli)),
        Err(error) => {
            eprintln!("modioctl: the system provides no timers: {error}");
            return ExitCode::FAILURE;
        }
    };
    match result {
        Ok(code) => code,
        Err(failure) => {
            eprintln!("modioctl: {failure}");
            ExitCode::from(failure.status())
        }
    }
}
