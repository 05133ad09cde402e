//! The program.

use std::process::ExitCode;

use clap::Parser;
use modioctl::cli::Cli;

fn main() -> ExitCode {
    let cli = Cli::parse();
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
