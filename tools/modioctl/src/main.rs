//! The program.

use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _};
use modioctl::cli::Cli;

fn main() -> ExitCode {
    let arguments = Cli::command().version(commit::version!()).get_matches();
    let cli = Cli::from_arg_matches(&arguments).unwrap_or_else(|error| error.exit());
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
